"""Arcs as blocks: which axes they cross, how far they may reach, and which the device refuses.

An arc block has eight fields: XH, YH, XK, YK (start and end), the centre's x and y, ``clockwise``
(0 or 1) and ``full_turns`` (whole turns made before the arc itself, 0 to 255). Everything here
takes many of them as an array of int64, shape (blocks, 8), and is exact, but for the angle swept.
Coordinates must lie in −2^32 … 2^32 − 1.

Seen from the centre, a start on an axis belongs to the quadrant after it, as the arc runs, and an
end on an axis to the quadrant before it. So start = end is a full turn.
"""

from collections.abc import Callable
from math import atan2, degrees, isqrt, pi, sqrt

import numpy as np

__all__ = [
    "OFF_CURVE",
    "RANGE",
    "crossings",
    "faster_steps",
    "in_parts",
    "is_empty",
    "limits",
    "radii",
    "reaches",
    "refusals",
    "seen_from_center",
    "squared_radii",
    "swept",
]

#: Blocks of a part: so many take some MiB to work with.
_PART = 1 << 16

#: What :func:`refusals` gives, and the device's port ``error``.
RANGE, OFF_CURVE = 1, 2


def in_parts(function: Callable[[np.ndarray], np.ndarray], blocks: np.ndarray) -> np.ndarray:
    """Give what a function gives for blocks, some thousands at a time: millions need memory."""
    return np.concatenate(
        [function(blocks[first : first + _PART]) for first in range(0, max(len(blocks), 1), _PART)]
    )


def seen_from_center(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give start and end minus the centre, two arrays of shape (blocks, 2), in steps."""
    return blocks[:, 0:2] - blocks[:, 4:6], blocks[:, 2:4] - blocks[:, 4:6]


def is_empty(blocks: np.ndarray) -> np.ndarray:
    """Tell the blocks of no length: start, end and centre are one point. Shape (blocks,)."""
    start, end = seen_from_center(blocks)
    return ~np.any(start, axis=1) & ~np.any(end, axis=1)


def _counterclockwise(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give start and end seen from the centre, clockwise arcs mirrored along y."""
    mirror = np.where(blocks[:, 6:7] == 1, [1, -1], 1)
    start, end = seen_from_center(blocks)
    return start * mirror, end * mirror


def _in_first_quadrant(points: np.ndarray, quadrant: np.ndarray) -> np.ndarray:
    """Turn points of ``quadrant`` 0 to 3 onto the first."""
    far = np.abs(points)
    return np.where(quadrant[:, None] % 2 == 1, far[:, ::-1], far)


def _runs(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give the quadrant of every start, 0 to 3 counter-clockwise, and the axes crossed after it."""
    start, end = _counterclockwise(blocks)
    (x, y), (u, v) = start.T, end.T
    first = np.select([(x > 0) & (y >= 0), (x <= 0) & (y > 0), (x < 0) & (y <= 0)], [0, 1, 2], 3)
    # An end that is the centre, a step off a start of radius 1, has no angle: the first is taken.
    last = np.select([(u < 0) & (v >= 0), (u <= 0) & (v < 0), (u > 0) & (v <= 0)], [1, 2, 3], 0)
    # In one quadrant the end is ahead when X has fallen and Y has risen: two points of one circle,
    # or of two that are no farther apart than a step, never differ in another way.
    (x, y), (u, v) = _in_first_quadrant(start, first).T, _in_first_quadrant(end, last).T
    ahead = (u <= x) & (v >= y) & ((u != x) | (v != y))
    count = (last - first) % 4
    count = np.where((count == 0) & ~ahead, 4, count) + 4 * blocks[:, 7]
    return first, np.where(is_empty(blocks), 0, count)


def crossings(blocks: np.ndarray) -> np.ndarray:
    """Count how often each arc goes through an axis of its centre. Shape (blocks,).

    An axis on which the arc begins or ends is not gone through there: a full turn from (100, 0) has
    3 crossings, one from (60, 80) has 4. Where :func:`refusals` finds ``OFF_CURVE`` an end that is
    not ahead of the start on both axes counts as a turn away.
    """
    return _runs(blocks)[1]


def squared_radii(blocks: np.ndarray) -> list[tuple[int, int]]:
    """Give the squares of the distances of start and end from the centre, which need 66 bits."""
    start, end = (points.tolist() for points in seen_from_center(blocks))
    return [(x * x + y * y, u * u + v * v) for (x, y), (u, v) in zip(start, end, strict=True)]


def limits(blocks: np.ndarray) -> np.ndarray:
    """Give ⌊R⌋ + 1, how far an arc that crosses axes may go along one. Shape (blocks,)."""
    return np.array([isqrt(square) + 1 for square, _ in squared_radii(blocks)], dtype=np.int64)


def reaches(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give how far arcs may go where they go through the axes +x, +y, −x and −y of their centres.

    Returns
    -------
    coordinates : array of int64, shape (blocks, 4)
        Centre and limit together: x, y, x and y, in steps.
    crossed : array of bool, shape (blocks, 4)
        Whether the arc goes through that axis.
    """
    first, count = _runs(blocks)
    axis = np.arange(4)
    # Counter-clockwise; a clockwise arc is mirrored, and what it crosses with it.
    seen = np.where(blocks[:, 6:7] == 1, -axis % 4, axis)
    crossed = count[:, None] > (seen - first[:, None] - 1) % 4
    sign = np.array([1, 1, -1, -1])
    return np.tile(blocks[:, 4:6], 2) + sign * limits(blocks)[:, None], crossed


def _off_circle(start: int, end: int) -> bool:
    """Tell from the squares whether radii differ by more than 1, or the start alone has none."""
    low, high = sorted((start, end))
    apart = high - low - 1  # more than 2 √low just when √high > √low + 1
    return apart > isqrt(4 * low) or start == 0 < end


def refusals(blocks: np.ndarray, width: int) -> np.ndarray:
    """Tell which arcs a device refuses, and why, as it does.

    ``RANGE``: a coordinate of start or end seen from the centre is beyond ±(2^n − 1); or the arc
    crosses an axis and its limit is more than 2^n − 1, or leads out of −2^n … 2^n − 1 from the
    centre in a direction in which the arc goes through the axis. Else ``OFF_CURVE``: the radii of
    start and end differ by more than 1 step, or the start is the centre and the end is not.

    Parameters
    ----------
    blocks : array of int64, shape (blocks, 8)
    width : int
        n, 4 to 32.

    Returns
    -------
    array of int64, shape (blocks,)
        0, :data:`RANGE` or :data:`OFF_CURVE`.
    """
    modulus = 1 << width
    start, end = seen_from_center(blocks)
    reached, crossed = reaches(blocks)
    far = np.any((np.abs(start) >= modulus) | (np.abs(end) >= modulus), axis=1)
    far |= np.any(crossed, axis=1) & (limits(blocks) >= modulus)
    far |= np.any(crossed & ((reached < -modulus) | (reached >= modulus)), axis=1)
    off = np.array([_off_circle(*squares) for squares in squared_radii(blocks)], dtype=bool)
    return np.where(far, RANGE, np.where(off, OFF_CURVE, 0))


def swept(blocks: np.ndarray) -> np.ndarray:
    """Give the angle that each arc sweeps, full turns with it, in degrees. Shape (blocks,).

    Positive counter-clockwise, negative clockwise; 0 for a block of no length.
    """
    start, end = (points.tolist() for points in _counterclockwise(blocks))
    angles = []
    for (x, y), (u, v) in zip(start, end, strict=True):
        # Both are whole numbers: an end that is just behind the start is nearly a turn ahead.
        sine, cosine = x * v - y * u, x * u + y * v
        behind = sine < 0 or sine == 0 < cosine
        angles.append(degrees(atan2(sine, cosine)) + 360 * behind)
    total = np.where(is_empty(blocks), 0, np.array(angles) + 360 * blocks[:, 7])
    return np.where(blocks[:, 6] == 1, -total, total)


def radii(blocks: np.ndarray) -> np.ndarray:
    """Give the distance of every start from its centre, in steps. Shape (blocks,)."""
    start, _ = seen_from_center(blocks)
    return np.hypot(*start.T.astype(float))


def faster_steps(blocks: np.ndarray) -> np.ndarray:
    """Give the steps of the axis that moves faster, R·∫max(|cos φ|, |sin φ|) dφ, by blocks."""
    start, _ = seen_from_center(blocks)
    begin = np.arctan2(start[:, 1] * np.where(blocks[:, 6] == 1, -1, 1), start[:, 0])

    def integral(angle: np.ndarray) -> np.ndarray:
        quarters, rest = np.divmod(angle, pi / 2)
        part = np.where(rest < pi / 4, np.sin(rest), sqrt(2) - np.cos(rest))
        return quarters * sqrt(2) + part

    angle = np.radians(np.abs(swept(blocks)))
    return radii(blocks) * (integral(begin + angle) - integral(begin))
