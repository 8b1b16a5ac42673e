"""Interpolators as hardware: give a start, an end and a curve, and get every smallest step."""

import os

# An old system Yosys would otherwise be picked up silently and change what is emitted.
os.environ["AMARANTH_USE_YOSYS"] = "builtin"
