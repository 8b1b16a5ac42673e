"""The timing of blocks for the methods on a constant carrier: periods, and mean increments.

A speed F along the path, in steps per clock, and a carrier period of T clocks say how far a period
leads, F·T steps at most. A block then has N periods, as many as its length needs. Everything here
is worked out from the blocks alone, by :class:`~fractions.Fraction` and whole numbers; only the
angle of an arc, which is no fraction, is a double.
"""

from fractions import Fraction
from math import floor, isqrt, radians

import numpy as np

from discreta.sim.arcs import squared_radii, swept
from discreta.sim.points import BadInputError, say_point

__all__ = [
    "DEFAULT_PERIOD",
    "DEFAULT_SPEED",
    "MAX_PERIOD",
    "add_timing",
    "angles",
    "arc_periods",
    "check_timing",
    "least_periods",
    "lengths",
    "line_periods",
    "mean_angle",
    "mean_increments",
    "most_periods",
]

#: Steps per clock, and clocks.
DEFAULT_SPEED, DEFAULT_PERIOD = Fraction(1, 10), 200

#: Clocks of the longest carrier period there is.
MAX_PERIOD = (1 << 24) - 1

#: What an angle may be off by its rounding as a double, as a part of it; some hundred times that.
_ROUNDING = Fraction(1, 1 << 44)


def line_periods(lines: np.ndarray, speed: Fraction, period: int) -> np.ndarray:
    """Give the periods N of lines: ⌈L / (F·T)⌉, at least 1, exactly.

    So a line is never drawn faster than F, and slower by less than a period's part.

    Parameters
    ----------
    lines : array of int64, shape (lines, 2 × axes)
        Start and end of every line, in steps; its length L is that of all axes together.
    speed : Fraction
        F > 0, in steps of path per clock.
    period : int
        T, in clocks.

    Returns
    -------
    array of int, shape (lines,)
        Python's own, of any size.
    """
    step = speed * period
    start, end = np.hsplit(lines, 2)
    found = []
    for line in (end - start).tolist():
        square = sum(value * value for value in line) * step.denominator**2
        # √S ≤ N·step for a whole N just when ⌈√S⌉ is.
        root = isqrt(square) + (isqrt(square) ** 2 < square)
        found.append(max(1, -(-root // step.numerator)))
    return np.array(found, dtype=object)


def arc_periods(arcs: np.ndarray, speed: Fraction, period: int) -> np.ndarray:
    """Give the periods N of arcs: ⌈R·A / (F·T)⌉ of start radius R and angle A, at least 1.

    The length R·A is rounded up, by less than 2^−43 of itself: N is never too small, and one too
    large only where the quotient is that little below a whole number.

    Parameters
    ----------
    arcs : array of int64, shape (arcs, 8)
        See :mod:`discreta.sim.arcs`.
    speed : Fraction
        F > 0, in steps of path per clock.
    period : int
        T, in clocks.

    Returns
    -------
    array of int, shape (arcs,)
        Python's own, of any size.
    """
    step = speed * period
    found = []
    for (square, _), angle in zip(squared_radii(arcs), angles(arcs), strict=True):
        radius = Fraction(isqrt(square << 128) + 1, 1 << 64) if square else Fraction(0)
        length = radius * Fraction(float(angle)) * (1 + _ROUNDING)
        found.append(max(1, -floor(-length / step)))
    return np.array(found, dtype=object)


def angles(arcs: np.ndarray) -> np.ndarray:
    """Give the angles A that arcs sweep, whole turns with them, in radians without a sign."""
    return np.radians(np.abs(swept(arcs)))


def lengths(kind: str, blocks: np.ndarray) -> np.ndarray:
    """Give the lengths of blocks of a kind, ``"line"`` or ``"arc"``, in steps of path."""
    if kind == "line":
        start, end = np.hsplit(blocks, 2)
        return np.sqrt(np.sum((end - start).astype(float) ** 2, axis=1))
    radii = np.sqrt([float(square) for square, _ in squared_radii(blocks)])
    return radii * angles(blocks)


def mean_increments(line: np.ndarray, periods: int, width: int) -> tuple[Fraction, ...]:
    """Give the mean increments of a line as a device rounds them: ⌊\\|Δ\\|·2^f / N⌋ / 2^f.

    Parameters
    ----------
    line : array of int64, shape (2 × axes,)
        Start and end, in steps.
    periods : int
        N.
    width : int
        n; the increments have f = n + 12 bits of fraction.

    Returns
    -------
    tuple of Fraction
        For every axis, in steps per period, with the sign of Δ.
    """
    one = 1 << (width + 12)
    start, end = np.split(line, 2)
    return tuple(
        Fraction((abs(delta) * one // periods) * (-1 if delta < 0 else 1), one)
        for delta in (end - start).tolist()
    )


def mean_angle(arc: np.ndarray, periods: int, width: int) -> Fraction:
    """Give the mean angle of an arc: Δφ = A / N, rounded down to 3n + 8 bits of fraction.

    A is a double; the device measures it itself, to less than a quarter of a step along the arc.

    Parameters
    ----------
    arc : array of int64, shape (8,)
        See :mod:`discreta.sim.arcs`.
    periods : int
        N.
    width : int
        n.

    Returns
    -------
    Fraction
        In radians, positive counter-clockwise.
    """
    one = 1 << (3 * width + 8)
    turn = radians(float(swept(arc[None])[0]))
    angle = Fraction(floor(abs(Fraction(turn)) * one / periods), one)
    return -angle if turn < 0 else angle


def most_periods(width: int) -> int:
    """Give the most periods that a block may have: N has n + 8 bits."""
    return (1 << (width + 8)) - 1


def least_periods(arcs: np.ndarray, formula: str = "rotation") -> np.ndarray:
    """Give how few periods arcs may have so that a device is sure to run them.

    Δφ must be less than ½ and, but for the formula ``rotation``, N no less than (⌊A⌋ + 1)². The
    device measures A to a quarter of a step along the arc: so much is added here.

    Parameters
    ----------
    arcs : array of int64, shape (arcs, 8)
        See :mod:`discreta.sim.arcs`.
    formula : str

    Returns
    -------
    array of int64, shape (arcs,)
    """
    radii = np.sqrt([float(square) for square, _ in squared_radii(arcs)])
    most = np.where(radii > 0, angles(arcs) + 0.25 / np.maximum(radii, 1), 0)
    least = np.floor(2 * most).astype(np.int64) + 1
    if formula != "rotation":
        least = np.maximum(least, (np.floor(most).astype(np.int64) + 1) ** 2)
    return least


def add_timing(kind: str, blocks: np.ndarray, speed: Fraction, period: int) -> np.ndarray:
    """Append the columns periods and period, of Python's own int, to blocks of a kind.

    Parameters
    ----------
    kind : str
        ``"line"`` or ``"arc"``.
    blocks : array of int64, shape (blocks, block fields)
    speed : Fraction
        F > 0, in steps of path per clock.
    period : int
        T, in clocks.
    """
    periods = {"line": line_periods, "arc": arc_periods}[kind](blocks, speed, period)
    return np.column_stack([blocks.astype(object), periods, np.full(len(blocks), period, object)])


def check_timing(
    kind: str, blocks: np.ndarray, width: int, *, least_period: int, formula: str = "rotation"
) -> np.ndarray:
    """Refuse blocks that a device would refuse because of their timing.

    Parameters
    ----------
    kind : str
        ``"line"`` or ``"arc"``.
    blocks : array of int, shape (blocks, block fields)
        With periods and period at their end, as from :func:`add_timing`.
    width : int
        n.
    least_period : int
        Clocks that a period must have in this device.
    formula : str
        The device's formula, for arcs.

    Returns
    -------
    array of int64, shape (blocks, block fields)
        The same blocks.

    Raises
    ------
    BadInputError
        T or N is out of range, or N is too small for the angle.
    """
    for period in blocks[:, -1].tolist():
        if not least_period <= period <= MAX_PERIOD:
            raise BadInputError(
                f"--period {period}: the device takes {least_period} to {MAX_PERIOD} clocks; "
                "choose one of these"
            )
    for block in blocks.tolist():
        if block[-2] > most_periods(width):
            raise BadInputError(
                f"{_name(kind, block)} takes {block[-2]} periods: width {width} has room for "
                f"{most_periods(width)}; raise --speed or --period"
            )
    blocks = blocks.astype(np.int64)
    if kind == "arc":
        least = least_periods(blocks, formula)
        for index in np.flatnonzero(blocks[:, -2] < least)[:1]:
            block = blocks[index].tolist()
            raise BadInputError(
                f"{_name(kind, block)} has {float(angles(blocks[[index]])[0]):.4f} radians and so "
                f"needs {least[index]} periods or more with formula {formula}, where it takes "
                f"{block[-2]}: too few periods; lower --speed or --period"
            )
    return blocks


def _name(kind: str, block: list[int]) -> str:
    """Name a block by its start and end."""
    points = block[:4] if kind == "arc" else block[:-2]
    half = len(points) // 2
    return f"the {kind} from {say_point(points[:half])} to {say_point(points[half:])}"
