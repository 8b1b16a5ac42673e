"""Speeds, accelerations and lengths as the feed unit takes them.

A speed is F = (1 + mantissa/2^16) / 2^exponent steps per clock, an acceleration a whole number of
2^-48 steps per clock², a length the sum of the pauses of its steps: 1 for a step on one axis, √k
for one on k axes.
"""

from collections.abc import Callable
from decimal import Context
from fractions import Fraction
from math import pi, sqrt

import numpy as np

from discreta.hdl.feed import ACCELERATION_BITS, AHEAD_BITS, RATE_BITS, feed_layout
from discreta.sim.arcs import seen_from_center, swept
from discreta.sim.conics import curve_points, motion
from discreta.sim.points import BadInputError

__all__ = ["ahead", "encode_acceleration", "encode_feed", "feed_of", "octagon", "of_conic"]

#: Of the slowest speed: there are 1 : 2^24.
_LAST_EXPONENT = 24
_MANTISSAS = 1 << feed_layout()["mantissa"].width

#: What the shorter axis adds to a pause, for every step that it makes together with the longer one.
_TOGETHER = sqrt(2) - 1


def _say(number: Fraction) -> str:
    """Write a number shortly, however large or small it is."""
    short = Context(prec=6).divide(number.numerator, number.denominator)
    return f"{short.normalize():g}"


def encode_feed(speed: Fraction) -> tuple[int, int]:
    """Give mantissa and exponent of the speed that is nearest, within 2^-17 of it.

    Parameters
    ----------
    speed : Fraction
        In steps per clock, 2^-24 to 1.

    Raises
    ------
    BadInputError
        There is no such speed.
    """
    if not Fraction(1, 1 << _LAST_EXPONENT) <= speed <= 1:
        raise BadInputError(
            f"the speed is {_say(speed)} steps per clock: the feed unit has 2^-{_LAST_EXPONENT} "
            f"to 1; choose a {'slower' if speed > 1 else 'faster'} one"
        )
    exponent = 0
    while speed * (1 << exponent) < 1:
        exponent += 1
    mantissa = round((speed * (1 << exponent) - 1) * _MANTISSAS)
    return (mantissa, exponent) if mantissa < _MANTISSAS else (0, exponent - 1)


def feed_of(mantissa: int, exponent: int) -> Fraction:
    """Give the speed of a mantissa and an exponent, in steps per clock."""
    return Fraction(_MANTISSAS + mantissa, _MANTISSAS << exponent)


def encode_acceleration(acceleration: Fraction) -> int:
    """Give the nearest acceleration in 2^-48 steps per clock²; 0 is for no ramp.

    Parameters
    ----------
    acceleration : Fraction
        In steps per clock², 0 or 2^-48 to almost 2^-8.

    Raises
    ------
    BadInputError
        There is no such acceleration.
    """
    scaled = acceleration * (1 << RATE_BITS)
    nearest = round(scaled)
    if acceleration != 0 and (scaled < 1 or nearest >= 1 << ACCELERATION_BITS):
        raise BadInputError(
            f"the acceleration is {_say(acceleration)} steps per clock²: the feed unit has "
            f"2^-{RATE_BITS} to (1 - 2^-{ACCELERATION_BITS})·2^-{RATE_BITS - ACCELERATION_BITS}, "
            f"or 0 for no ramp; choose a {'larger' if scaled < 1 else 'smaller'} one"
        )
    return nearest


def octagon(blocks: np.ndarray, kind: str) -> np.ndarray:
    """Give how long blocks are for the feed unit: ∫(max + (√2 - 1)·min) of |dx| and |dy|.

    Parameters
    ----------
    blocks : array of int64
        As the interpolator of this kind takes them, one a row.
    kind : str
        ``"line"``, of any number of axes, ``"arc"`` or ``"conic"``.

    Returns
    -------
    array of float, shape (blocks,)
        In steps.

    Raises
    ------
    BadInputError
        A conic does not lead from its start to its end.
    """
    if kind == "line":
        axes = blocks.shape[1] // 2
        return _of_moves(blocks[:, axes:] - blocks[:, :axes])
    if kind == "arc":
        return _of_arcs(blocks)
    return np.array([of_conic(block, _of_moves) for block in blocks], dtype=float)


def _of_moves(moves: np.ndarray) -> np.ndarray:
    """Give the lengths of straight moves, shape (moves, axes)."""
    longest_first = -np.sort(-np.abs(moves), axis=1)
    roots = np.sqrt(np.arange(moves.shape[1] + 1))
    return longest_first @ np.diff(roots)


def _of_arcs(blocks: np.ndarray) -> np.ndarray:
    """Give the lengths of arcs: R·∫(max(|cos φ|, |sin φ|) + (√2 - 1)·min(…)) dφ."""
    start, _ = seen_from_center(blocks)
    x, y = start.T.astype(float)
    begin = np.arctan2(np.where(blocks[:, 6] == 1, -y, y), x)
    eighth = sqrt(0.5) + _TOGETHER * (1 - sqrt(0.5))

    def integral(angle: np.ndarray) -> np.ndarray:
        quarters, rest = np.divmod(angle, pi / 2)
        near = np.minimum(rest, pi / 2 - rest)
        part = np.sin(near) + _TOGETHER * (1 - np.cos(near))
        return 2 * eighth * quarters + np.where(rest < pi / 4, part, 2 * eighth - part)

    angle = np.radians(np.abs(swept(blocks)))
    return np.hypot(x, y) * (integral(begin + angle) - integral(begin))


def of_conic(block: np.ndarray, measure: Callable[[np.ndarray], np.ndarray]) -> float:
    """Give the length of a second-order curve along points of it, whole turns with it.

    Parameters
    ----------
    block : array of int64, shape (11,)
    measure : callable
        Gives the lengths of straight moves, shape (moves, 2).
    """
    a, b, c = (int(number) for number in block[:3])
    part = block.copy()
    part[10] = 0  # whole turns left out
    moves = np.diff(curve_points(part), axis=0)
    length = float(measure(moves).sum())
    if 4 * a * c <= b * b:
        return length
    turn = part.copy()
    turn[7:9] = turn[5:7]
    around = np.diff(curve_points(turn), axis=0)
    longer, whole = (np.abs(row).max(axis=1).sum() for row in (moves, around))
    turns = round((motion(block[None]).steps[0] - longer) / whole)
    return length + turns * float(measure(around).sum())


def ahead(lengths: np.ndarray) -> np.ndarray:
    """Give the path from the beginning of every block of a chain to the end of the chain.

    Parameters
    ----------
    lengths : array of float, shape (blocks,)
        In steps.

    Returns
    -------
    array of int64, shape (blocks,)
        In whole steps, at most 2^28 - 1.
    """
    left = np.cumsum(np.asarray(lengths, dtype=float)[::-1])[::-1]
    return np.minimum(np.rint(left), (1 << AHEAD_BITS) - 1).astype(np.int64)
