# amaranth: UnusedElaboratable=no
# (A part that refuses its parameters cannot be simulated.)
"""What the tests of the parts share."""

import re
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from amaranth.sim import Simulator

from discreta.hdl.contract import Part

BAD_WIDTHS = [
    (3, ValueError, "width is 3: choose a whole number from 4 to 32"),
    (33, ValueError, "width is 33: choose a whole number from 4 to 32"),
    (8.0, TypeError, "width must be a whole number from 4 to 32, not 8.0"),
    ("8", TypeError, "width must be a whole number from 4 to 32, not '8'"),
    (True, TypeError, "width must be a whole number from 4 to 32, not True"),
]
BAD_AXES = [
    (1, ValueError, "number of axes is 1: choose a whole number from 2 to 6"),
    (7, ValueError, "number of axes is 7: choose a whole number from 2 to 6"),
    (2.0, TypeError, "number of axes must be a whole number from 2 to 6, not 2.0"),
    ("xy", TypeError, "number of axes must be a whole number from 2 to 6, not 'xy'"),
    (True, TypeError, "number of axes must be a whole number from 2 to 6, not True"),
]
BAD_GUARDS = [
    (-1, ValueError, "number of guard bits is -1: choose a whole number from 0 to 4"),
    (5, ValueError, "number of guard bits is 5: choose a whole number from 0 to 4"),
    (1.0, TypeError, "number of guard bits must be a whole number from 0 to 4, not 1.0"),
    (False, TypeError, "number of guard bits must be a whole number from 0 to 4, not False"),
]


def run(part: Part, bench: Callable[[Any], Awaitable[None]]) -> None:
    """Simulate until the bench returns."""
    simulator = Simulator(part)
    simulator.add_clock(1e-8, if_exists=True)
    simulator.add_testbench(bench)
    simulator.run()


def assert_refused(refusal: tuple[type[Exception], str], make: Callable, *args, **kwargs) -> None:
    """Check the type of the error and every word of its message."""
    error, message = refusal
    with pytest.raises(error, match=rf"\A{re.escape(message)}\Z") as caught:
        make(*args, **kwargs)
    assert caught.type is error
