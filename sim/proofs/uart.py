"""Promises of the two ends of a serial line: every byte, checked one by one.

They are shown of the golden models' own source, which the RTL is proven equal to, on the line as it
is drawn by hand: a start bit, the data bits with the lowest first, a stop bit.
"""

from collections.abc import Iterable

import numpy as np

from discreta.sim.golden.uart import UartReceiver, UartTransmitter
from discreta.sim.smt import Exhaustive

__all__ = ["promises"]

_BYTES = np.arange(256)
#: Slots of a byte on the line.
_SLOTS = 10


def promises(golden: UartReceiver | UartTransmitter) -> list[Exhaustive]:
    """Give everything that is promised of one end of a line."""
    if isinstance(golden, UartTransmitter):
        return [
            Exhaustive(
                "every byte, with every other one behind it at once, is on the line as a start "
                "bit, its bits with the lowest first, and a stop bit, and the line is 1 before "
                "and after",
                lambda: _sent(golden),
            )
        ]
    return [
        Exhaustive(
            "every byte, with every other one behind it at once, is received as it is, in the "
            "middle of its stop bit and once",
            lambda: _received(golden, stop=1),
        ),
        Exhaustive(
            "every byte without a stop bit is told to be an error, and the next one is received",
            lambda: _received(golden, stop=0),
        ),
        Exhaustive(
            "a pulse that is shorter than half a bit is no byte",
            lambda: _noise(golden),
        ),
    ]


def _pairs() -> tuple[np.ndarray, np.ndarray]:
    """Give every byte with every other one."""
    return np.repeat(_BYTES, 256), np.tile(_BYTES, 256)


def _line(byte: np.ndarray, clocks: int, stop: int) -> Iterable[np.ndarray]:
    """Draw bytes, clock by clock."""
    slots = [0 * byte, *(byte >> bit & 1 for bit in range(8)), 0 * byte + stop]
    return [level for level in slots for _ in range(clocks)]


def _sent(golden: UartTransmitter) -> str:
    """Find a pair of bytes that is sent in another way."""
    first, second = _pairs()
    n = golden.clocks_per_bit
    one = np.ones_like(first)
    expected = [one, *_line(first, n, 1), *_line(second, n, 1), one, one]
    state = {name: value * one for name, value in golden.reset().items()}
    left = 2 * one
    for clock, level in enumerate(expected):
        out = golden.outputs(state)
        wrong = np.flatnonzero(out["tx"] != level)
        if wrong.size:
            return f"bytes={first[wrong[0]]},{second[wrong[0]]}, clock={clock}"
        given = {"bytes": np.where(left == 2, first, second), "bytes_valid": (left > 0).astype(int)}
        left = left - (given["bytes_valid"] & out["bytes_ready"])
        state = golden.step(state, given)
    return ""


def _received(golden: UartReceiver, stop: int) -> str:
    """Find a pair of bytes of which something else is received."""
    first, second = _pairs()
    n = golden.clocks_per_bit
    one = np.ones_like(first)
    line = [*_line(first, n, stop), *([] if stop else [one] * n), *_line(second, n, 1), *[one] * n]
    # A byte is seen in the clock after the middle of its stop bit.
    middle = (_SLOTS - 1) * n + n // 2 + 1
    when = {middle: (first, 1 - stop), middle + (_SLOTS + 1 - stop) * n: (second, 0)}
    state = {name: value * one for name, value in golden.reset().items()}
    for clock, level in enumerate(line):
        out = golden.outputs(state)
        byte, error = when.get(clock, (out["bytes_data"], out["bytes_error"]))
        wrong = out["bytes_valid"] != int(clock in when)
        wrong |= (out["bytes_data"] != byte) | (out["bytes_error"] != error)
        if wrong.any():
            at = np.flatnonzero(wrong)[0]
            return f"bytes={first[at]},{second[at]}, clock={clock}"
        state = golden.step(state, {"rx": level, "bytes_ready": one})
    return ""


def _noise(golden: UartReceiver) -> str:
    """Find a short pulse of which something is received."""
    n = golden.clocks_per_bit
    for length in range(1, n // 2 + 1):
        state = golden.reset()
        for clock in range(12 * n):
            state = golden.step(state, {"rx": int(clock >= length), "bytes_ready": 1})
            if golden.outputs(state)["bytes_valid"]:
                return f"pulse={length}"
    return ""
