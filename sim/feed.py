"""Speeds and paths as the feed unit has them: what a user programs, in the device's own numbers."""

from fractions import Fraction
from math import pi, sqrt

import numpy as np

from discreta.hdl.feed import ACCELERATION_BITS, AHEAD_BITS, RATE_BITS
from discreta.sim.arcs import seen_from_center, swept
from discreta.sim.conics import curve_points, motion
from discreta.sim.points import BadInputError

__all__ = ["SLOWEST", "ahead", "encode_acceleration", "encode_feed", "feed_of", "octagon"]

#: The slowest speed that is promised, in steps per clock.
SLOWEST = Fraction(1, 1 << 24)

_SIGNIFICAND = 1 << 16


def encode_feed(speed: Fraction) -> tuple[int, int]:
    """Give mantissa and exponent of the programmed speed that is nearest.

    F = (1 + mantissa/2^16) / 2^exponent; it is off by 2^-17 of the speed at most.

    Raises
    ------
    BadInputError
        The speed is not between 2^-24 and 1 step per clock.
    """
    if not SLOWEST <= speed <= 1:
        raise BadInputError(
            f"feed is {float(speed):g} steps per clock: choose {float(SLOWEST):g} (2^-24) to 1"
        )
    exponent = 0
    while speed < 1:
        speed, exponent = 2 * speed, exponent + 1
    mantissa = round((speed - 1) * _SIGNIFICAND)
    if mantissa == _SIGNIFICAND:
        return 0, exponent - 1
    return mantissa, exponent


def feed_of(mantissa: int, exponent: int) -> Fraction:
    """Give F in steps per clock."""
    return (1 + Fraction(mantissa, _SIGNIFICAND)) / (1 << exponent)


def encode_acceleration(acceleration: Fraction) -> int:
    """Give an acceleration in 2^-48 steps per clock², the nearest; 0 stays 0: no ramp.

    Raises
    ------
    BadInputError
        It is less than 0, too small, or too large.
    """
    value = round(acceleration * (1 << RATE_BITS))
    most = (1 << ACCELERATION_BITS) - 1
    if acceleration and not 1 <= value <= most:
        one = 2.0**-RATE_BITS
        raise BadInputError(
            f"acceleration is {float(acceleration):g} steps per clock^2: choose {one:.3g} (2^-48) "
            f"to {most * one:.3g}, or 0 for none"
        )
    return value


def octagon(blocks: np.ndarray, kind: str) -> np.ndarray:
    """Give the path of every block as the pauses measure it, in steps.

    Of a straight piece that is max + (√2 − 1)·min of what it moves along x and y, and with more
    axes, from the longest to the shortest, Σ(√k − √(k − 1))·Δ: what a diagonal step is paused for.

    Parameters
    ----------
    blocks : array of int64, shape (blocks, block fields)
        Of an interpolator.
    kind : str
        ``"line"``, ``"arc"`` or ``"conic"``.
    """
    if kind == "line":
        start, end = np.hsplit(blocks, 2)
        return _of_pieces((end - start).astype(float))
    if kind == "arc":
        return _of_arcs(blocks)
    return np.array([_of_conic(block) for block in blocks])


def ahead(lengths: np.ndarray) -> np.ndarray:
    """Give, for a chain of blocks, the path from the start of each to the end of the chain.

    Rounded to whole steps; at most 2^28 − 1, which is as good as far.
    """
    rest = np.cumsum(lengths[::-1])[::-1]
    return np.minimum(np.rint(rest), (1 << AHEAD_BITS) - 1).astype(np.int64)


def _of_pieces(moves: np.ndarray) -> np.ndarray:
    """Measure straight pieces, shape (pieces, axes)."""
    ranked = np.sort(np.abs(moves), axis=1)[:, ::-1]
    return ranked @ np.diff(np.sqrt(np.arange(ranked.shape[1] + 1)))


def _of_arcs(blocks: np.ndarray) -> np.ndarray:
    """R·∫(max + (√2 − 1)·min of |cos φ|, |sin φ|) dφ; an eighth of a turn has 2·(√2 − 1)."""
    start, _ = seen_from_center(blocks)
    begin = np.arctan2(start[:, 1] * np.where(blocks[:, 6] == 1, -1, 1), start[:, 0])
    less = sqrt(2) - 1

    def first(angle: np.ndarray) -> np.ndarray:
        return np.sin(angle) + less * (1 - np.cos(angle))

    def integral(angle: np.ndarray) -> np.ndarray:
        eighths, rest = np.divmod(angle, pi / 4)
        # Every second eighth mirrors the first.
        mirrored = 2 * less - first(pi / 4 - rest)
        return eighths * 2 * less + np.where(eighths % 2 == 0, first(rest), mirrored)

    angle = np.radians(np.abs(swept(blocks)))
    return np.hypot(*start.T.astype(float)) * (integral(begin + angle) - integral(begin))


def _of_conic(block: np.ndarray) -> float:
    """Measure the curve as it is drawn, and whole turns as often as they are run."""
    moves = np.diff(curve_points(block), axis=0)
    once = float(np.abs(moves).max(axis=1).sum())
    steps = float(motion(block[None]).steps[0])
    times = round(steps / once) if once and np.isfinite(steps) else 1
    return float(_of_pieces(moves).sum()) * max(1, times)
