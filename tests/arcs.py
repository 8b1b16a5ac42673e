"""Arcs worked out from the documents and exact geometry alone, for comparison.

A block is (XH, YH, XK, YK, the centre's x and y, clockwise, full turns). Angles are compared by
cross products of whole numbers, radii by their squares.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isqrt

import numpy as np

RANGE, OFF_CURVE = 1, 2

Point = tuple[int, int]

#: The half axes, counter-clockwise; quadrant k lies behind half axis k.
HALF_AXES = ((1, 0), (0, 1), (-1, 0), (0, -1))


def turn(point: Point, right_angles: int) -> Point:
    """Turn a point counter-clockwise around the origin."""
    x, y = point
    for _ in range(right_angles % 4):
        x, y = -y, x
    return x, y


def seen(block: Sequence[int]) -> tuple[Point, Point]:
    """Give start and end as seen from the centre, mirrored along y for a clockwise arc."""
    xh, yh, xk, yk, xc, yc, clockwise, _ = block
    side = -1 if clockwise else 1
    return (xh - xc, side * (yh - yc)), (xk - xc, side * (yk - yc))


def _cross(a: Point, b: Point) -> int:
    return a[0] * b[1] - a[1] * b[0]


def _half(base: Point, point: Point) -> int:
    """Tell whether a point is 180 degrees or more ahead of ``base``, counter-clockwise."""
    side = _cross(base, point)
    return int(side < 0 or (side == 0 and base[0] * point[0] + base[1] * point[1] < 0))


def _before(base: Point, a: Point, b: Point) -> bool:
    """Tell whether one who turns counter-clockwise from ``base`` meets a before b."""
    halves = _half(base, a), _half(base, b)
    return halves[0] < halves[1] or (halves[0] == halves[1] and _cross(a, b) > 0)


def crossed(start: Point, end: Point) -> list[int]:
    """List the half axes strictly between two angles, in their order, counter-clockwise.

    An end at the very angle of the start is a whole turn away.
    """
    whole_turn = _cross(start, end) == 0 and _half(start, end) == 0
    met = [(quadrant_after(start) + k) % 4 for k in range(1, 5)]
    return [
        k
        for k in met
        if (_cross(start, HALF_AXES[k]) or _half(start, HALF_AXES[k]))
        and (whole_turn or _before(start, HALF_AXES[k], end))
    ]


def on_curve(block: Sequence[int]) -> bool:
    """Tell whether the end is at most one step off the circle on which the start lies."""
    start, end = seen(block)
    s, e = (x * x + y * y for x, y in (start, end))
    # |√e − √s| ≤ 1 squared: e + s − 1 ≤ 2√(e·s).
    return s > 0 and (e + s <= 1 or (e + s - 1) ** 2 <= 4 * e * s)


def is_empty(block: Sequence[int]) -> bool:
    """Tell whether start, end and centre are one point."""
    return seen(block) == ((0, 0), (0, 0))


def fits(block: Sequence[int], width: int) -> bool:
    """Tell whether start and end seen from the centre have n bits."""
    return all(abs(value) < 2**width for point in seen(block) for value in point)


def stays_inside(block: Sequence[int], width: int, half_axes: Sequence[int]) -> bool:
    """Tell whether ⌊R⌋ + 1 fits n bits and leads to a coordinate along every one of them."""
    (x, y), _ = seen(block)
    limit = isqrt(x * x + y * y) + 1
    side = -1 if block[6] else 1
    for k in half_axes:
        far = block[4] + limit * HALF_AXES[k][0], block[5] + limit * HALF_AXES[k][1] * side
        if limit >= 2**width or not all(-(2**width) <= value < 2**width for value in far):
            return False
    return True


def fault(block: Sequence[int], width: int) -> int:
    """Tell with which code a block is refused; 0: it is run."""
    start, end = seen(block)
    if not fits(block, width):
        return RANGE
    if is_empty(block):
        return 0
    if (0, 0) in (start, end):
        # It has no angle, so no one can tell what such an arc would cross.
        assert stays_inside(block, width, range(4))
        return 0 if on_curve(block) else OFF_CURVE
    axes = crossed(start, end)
    if not on_curve(block) and len(axes) in (0, 4):
        # Here the angle tells nothing: the end counts as ahead if X has fallen and Y has risen.
        x, y = turn(start, -quadrant_after(start))
        u, v = turn(end, -quadrant_before(end))
        axes = [] if u <= x and v >= y else [0, 1, 2, 3]
    if not stays_inside(block, width, range(4) if block[7] else axes):
        return RANGE
    return 0 if on_curve(block) else OFF_CURVE


def quadrant_after(point: Point) -> int:
    """Give the quadrant, 0 to 3, into which an arc leads that starts there."""
    return next(k for k in range(4) if turn(point, -k)[0] > 0 and turn(point, -k)[1] >= 0)


def quadrant_before(point: Point) -> int:
    """Give the quadrant, 0 to 3, from which an arc comes that ends there."""
    return next(k for k in range(4) if turn(point, -k)[0] >= 0 and turn(point, -k)[1] > 0)


@dataclass(frozen=True)
class Prepared:
    """What input processing makes of a sound block that has a length.

    Attributes
    ----------
    from_xy, to_xy : tuple of int
        Start and end, each in its own quadrant turned onto the first.
    swap : bool
        X, which falls, is the machine's y.
    negative : tuple of bool
        Whether the machine's x, and y, fall at first.
    turns : int
        Axis crossings.
    limit : int
        ⌊R⌋ + 1.
    """

    from_xy: Point
    to_xy: Point
    swap: bool
    negative: tuple[bool, bool]
    turns: int
    limit: int


def prepare(block: Sequence[int]) -> Prepared:
    """Bring an arc to one that begins in quadrant I and runs counter-clockwise."""
    start, end = seen(block)
    quadrant = quadrant_after(start)
    falls, rises = turn((-1, 0), quadrant), turn((0, 1), quadrant)
    side = -1 if block[6] else 1
    return Prepared(
        turn(start, -quadrant),
        turn(end, -quadrant_before(end)),
        falls[0] == 0,
        (falls[0] + rises[0] < 0, side * (falls[1] + rises[1]) < 0),
        len(crossed(start, end)) + 4 * block[7],
        isqrt(start[0] ** 2 + start[1] ** 2) + 1,
    )


def arc_steps(
    block: Sequence[int],
    *,
    width: int,
    order: str = "alternated",
    normalize: bool = True,
    preload: str = "half",
    guard: int = 2,
) -> Iterator[tuple[int, Point]]:
    """Yield (clock, point) of every step of a sound block that no step of has to wait.

    Told in the machine's own axes, and piece by piece: a piece is what lies in one quadrant. Every
    axis has its own sum, which is the part of a step it has gone beyond its point, in the direction
    in which it moves. The block is accepted in clock 0.
    """
    modulus = 2 ** (width + guard)
    initial = {"zero": 0, "half": modulus // 2}[preload]
    (x, y), end = seen(block)
    side = -1 if block[6] else 1
    limit = isqrt(x * x + y * y) + 1
    pieces = len(crossed((x, y), end)) + 4 * block[7] + 1
    quadrant = quadrant_after((x, y))
    place = [x, y]
    sums = [initial, initial]
    clock = 2 * width + 5

    def scale() -> int:
        larger, factor = max(map(abs, place)), 1
        while normalize and 0 < larger * factor < 2 ** (width - 1):
            factor *= 2
        return factor

    for piece in range(pieces):
        # In quadrants I and III x is the axis that comes to 0.
        falling = quadrant % 2
        rising = 1 - falling
        away = {rising: turn((0, 1), quadrant)[rising], falling: turn((1, 0), quadrant)[falling]}
        last = piece == pieces - 1
        if last:
            target = {axis: away[axis] * end[axis] for axis in (falling, rising)}
        else:
            target = {falling: 0, rising: limit}
        overshot = away[falling] * place[falling] < target[falling]
        if piece == 0 and order == "alternated" and preload == "half":
            clock += 1
            sums[falling] -= abs(place[rising]) * scale() // 2
        while True:
            fall = away[falling] * place[falling] != target[falling]
            rise = away[rising] * place[rising] != target[rising]
            if not (fall or rise) or not (last or fall):
                break
            clock += 1
            assert clock < 100_000 * pieces
            before = tuple(place)
            factor = scale()
            dead_fall = not fall or overshot or place[rising] == 0
            dead_rise = not rise or place[falling] == 0
            if last and dead_fall and dead_rise:
                if fall:
                    place[falling] += away[falling] if overshot else -away[falling]
                if rise:
                    place[rising] += away[rising]
            else:
                old = abs(place[falling])
                if fall and not overshot:
                    sums[falling] += abs(place[rising]) * factor
                    if sums[falling] >= modulus:
                        sums[falling] -= modulus
                        place[falling] -= away[falling]
                if rise:
                    added = old if order == "simultaneous" else abs(place[falling])
                    sums[rising] += added * factor
                    if sums[rising] >= modulus:
                        sums[rising] -= modulus
                        place[rising] += away[rising]
            if tuple(place) != before:
                yield clock + 1, (block[4] + place[0], block[5] + side * place[1])
        if not last:
            clock += 1
            sums[rising] = modulus - 1 - sums[rising]
            quadrant = (quadrant + 1) % 4


@dataclass(frozen=True)
class Run:
    """What becomes of a block, when no step has to wait and blocks are offered all the time.

    Attributes
    ----------
    accepted, started, answered : int
        Clocks: ``answered`` is that of ``done`` or ``error``.
    code : int
        0, RANGE or OFF_CURVE.
    steps : list of (clock, point)
    """

    accepted: int
    started: int
    answered: int
    code: int
    steps: list[tuple[int, Point]]


def run_arcs(blocks: Sequence[Sequence[int]], *, width: int, **variant) -> Iterator[Run]:
    """Yield what becomes of blocks, one behind the other, from reset.

    A block is prepared from its acceptance on, one ahead of the running one, and started when that
    takes its last step. A block that does not move lets a last step go first.
    """
    latency = 2 * width + 5
    accepted, free = 0, 0
    moved = False
    for block in blocks:
        code = fault(block, width)
        still = code != 0 or is_empty(block)
        started = max(accepted + latency, free + (still and moved))
        steps: list[tuple[int, Point]] = []
        if not still:
            steps = [
                (clock + started - latency, point)
                for clock, point in arc_steps(block, width=width, **variant)
            ]
        answered = steps[-1][0] + 1 if steps else started + 1
        yield Run(accepted, started, answered, code, steps)
        accepted, free, moved = started + 1, answered - bool(steps), bool(steps)


def draw_arcs(width: int, count: int, *, seed: int, radius: int, turns: int = 2) -> np.ndarray:
    """Draw arc blocks of all kinds, seeded: most are run, every eighth is refused.

    Radii are up to ``radius``; every fourth arc begins on an axis, every eighth makes up to
    ``turns`` full turns besides, ends where it begins, or has no length.
    """
    random = np.random.default_rng([seed, width])
    modulus = 2**width
    blocks: list[list[int]] = []
    while len(blocks) < count:
        kind = len(blocks) % 8
        r = random.integers(1, radius + 1)
        room = modulus - 2 - r if r < modulus - 2 else 0
        center = random.integers(-room, room, 2, endpoint=True)
        angles = random.random(2) * 2 * np.pi
        if kind in (1, 5):
            angles[0] = random.integers(4) * np.pi / 2
        points = np.rint(r * np.stack([np.cos(angles), np.sin(angles)], axis=1)).astype(np.int64)
        full_turns = random.integers(1, turns + 1) if kind == 2 else 0
        if kind == 3:
            points[1] = points[0]
        if kind == 6:
            points[:] = 0
        if kind == 7:
            points[1] += random.integers(-modulus, modulus, 2)
        points = np.clip(points + center, -modulus, modulus - 1)
        block = [*points.reshape(4).tolist(), *center.tolist(), int(random.integers(2)), full_turns]
        # The few that are not what their kind promises are drawn again.
        if (fault(block, width) != 0) == (kind == 7) and (kind == 6) == is_empty(block):
            blocks.append([int(value) for value in block])
    return np.array(blocks, dtype=np.int64)
