"""What is proven of every method beyond its equality to the golden model."""
