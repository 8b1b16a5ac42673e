"""The device on real boards."""
