"""Everything that runs or checks the device."""
