"""The device, in Amaranth: interpolators and the parts they are made of."""
