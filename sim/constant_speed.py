"""What a sender tells an exact interpolator of its path, so that every tick is as long.

``pace`` and, for axes that move along an arc, ``ticks``: see
:class:`~discreta.hdl.constant_speed.ConstantSpeed`. The square roots are drawn here.
"""

import numpy as np

from discreta.hdl.constant_speed import FRACTION_BITS, ticks_bits
from discreta.sim.arcs import radii, swept
from discreta.sim.points import BadInputError

__all__ = ["paced", "plane", "ticks_of"]


def plane(blocks: np.ndarray, axes: int) -> np.ndarray:
    """Give the arc of blocks whose start and end have more axes: the eight fields of the plane."""
    kept = [0, 1, axes, axes + 1, *range(2 * axes, 2 * axes + 4)]
    return blocks[:, kept]


def ticks_of(kind: str, blocks: np.ndarray, axes: int) -> np.ndarray:
    """Give how many ticks blocks take, shape (blocks,): their length, or the longest further way.

    Parameters
    ----------
    kind : str
        ``"line"`` or ``"arc"``.
    blocks : array of int64
        As the interpolator at full speed takes them: start and end of all axes, then for an arc
        the centre, ``clockwise`` and ``full_turns``.
    axes : int
    """
    ways = (blocks[:, axes : 2 * axes] - blocks[:, :axes]).astype(float)
    if kind == "line":
        return np.sqrt((ways**2).sum(axis=1))
    arcs = plane(blocks, axes)
    length = radii(arcs) * np.radians(np.abs(swept(arcs)))
    return np.max(np.abs(np.column_stack([length, ways[:, 2:]])), axis=1)


def paced(kind: str, blocks: np.ndarray, width: int, axes: int) -> np.ndarray:
    """Add the fields with which the speed is constant, as for :func:`ticks_of`.

    Raises
    ------
    BadInputError
        An arc's further axis is so much longer that its steps would be half a step off.
    """
    ticks = ticks_of(kind, blocks, axes)
    if kind == "line":
        longest = np.abs(blocks[:, axes : 2 * axes] - blocks[:, :axes]).max(axis=1)
        pace = (ticks / np.maximum(longest, 1) - 1) * 2.0 ** (width + FRACTION_BITS)
        return np.column_stack([blocks, np.rint(np.maximum(pace, 0)).astype(np.int64)])
    arcs = plane(blocks, axes)
    length = radii(arcs) * np.radians(np.abs(swept(arcs)))
    exact = radii(arcs) * length / np.maximum(ticks, 1) * 2.0**FRACTION_BITS
    pace = np.maximum(np.rint(exact), 1).astype(np.int64)
    if axes == 2:
        return np.column_stack([blocks, pace])
    whole = np.maximum(np.rint(ticks), 1).astype(np.int64)
    off = np.abs(exact / pace - 1) * ticks
    for number in np.flatnonzero((off > 0.5) | (whole >= 1 << ticks_bits(width)))[:1].tolist():
        raise BadInputError(
            f"an axis moves {ticks[number]:.0f} steps along an arc of {length[number]:.4g}: choose "
            "fewer, a line, or an arc in more turns"
        )
    return np.column_stack([blocks, pace, whole])
