from math import atan2, hypot, pi

import numpy as np
import pytest

from discreta.hdl.parts.angle_meter import (
    ANGLE_INTEGER_BITS,
    AngleMeter,
    angle_bits,
    turnings,
)
from discreta.sim.golden.carrier_circular import CarrierCircular
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run

Point = tuple[int, int]

#: The most axis crossings that an arc can make: 255 full turns and one that begins between axes.
MOST_TURNS = 1024


def true_angle(start: Point, end: Point, turns: int) -> float:
    """Give the angle swept, in radians; a double is good for some 2^−42 of it."""
    return turns * pi / 2 + atan2(end[1], end[0]) - atan2(start[1], start[0])


def possible(start: Point, end: Point, turns: int) -> bool:
    """Tell whether input processing can give such an arc: its end is on it, and ahead."""
    s, e = (x * x + y * y for x, y in (start, end))
    near = (e + s - 1) ** 2 <= 4 * e * s
    ahead = end[0] <= start[0] and end[1] >= start[1] and start != end
    # A start on an axis belongs to the quadrant after it, an end to the one before it.
    return start[0] > 0 and end[1] > 0 and near and (ahead or turns > 0)


def draw_arc(rng: np.random.Generator, width: int) -> tuple[Point, Point, int]:
    """Draw start, end and crossings of an arc that is possible; small and large alike."""
    while True:
        radius = 2 ** rng.uniform(0, width)
        points: list[Point] = []
        for angle in rng.random(2) * pi / 2:
            away = radius + rng.uniform(-0.7, 0.7)
            points.append((round(away * np.cos(angle)), round(away * np.sin(angle))))
        turns = int(rng.choice([0, 0, 1, 2, 3, 4, 7, MOST_TURNS]))
        inside = max(max(point) for point in points) < 2**width
        if inside and min(map(min, points)) >= 0 and possible(points[0], points[1], turns):
            return points[0], points[1], turns


async def measure(ctx, part, start, end, turns):
    """Measure as the docstring says, and give the angle; n + 6 turnings for each point."""
    ctx.set(part.end, {"x": end[0], "y": end[1]})
    ctx.set(part.start, {"x": start[0], "y": start[1]})
    ctx.set(part.turns, turns)
    for loading, subtract in ((part.load_end, 0), (part.load_start, 1)):
        ctx.set(loading, 1)
        await ctx.tick()
        ctx.set(loading, 0)
        ctx.set(part.subtract, subtract)
        ctx.set(part.turn, 1)
        for index in range(part.width + 6):
            ctx.set(part.index, index)
            await ctx.tick()
        ctx.set(part.turn, 0)
    return ctx.get(part.angle)


@pytest.mark.parametrize("width", [4, 8, 16, 24, 32])
def test_error_of_the_part(width):
    """Below a quarter of a step along the arc, in the part itself."""
    part = AngleMeter(width)
    rng = np.random.default_rng([1, width])
    top = 2**width - 1
    arcs = [((top, 0), (0, top), 0), ((top, 0), (top, 1), 0), ((1, top), (0, top), 0)]
    arcs += [((1, 0), (0, 1), 0), ((top, top), (top, top), MOST_TURNS)]
    arcs += [draw_arc(rng, width) for _ in range(12)]

    async def bench(ctx):
        assert ctx.get(part.angle) == ctx.get(part.positive) == 0  # after reset
        for start, end, turns in arcs:
            angle = await measure(ctx, part, start, end, turns)
            off = angle / 2 ** angle_bits(width) - true_angle(start, end, turns)
            assert abs(off) * hypot(*start) < 0.25, (start, end, turns)
            assert ctx.get(part.positive) == max(angle, 0)
            # It stays until the next load.
            await ctx.tick()
            assert ctx.get(part.angle) == angle

    run(part, bench)


def test_the_sizes_of_what_it_measures():
    assert (angle_bits(8), turnings(8)) == (24, 14)
    assert (MOST_TURNS + 4) * pi / 2 < 2**ANGLE_INTEGER_BITS
    part = AngleMeter(8)

    async def bench(ctx):
        assert len(part.angle) == 1 + ANGLE_INTEGER_BITS + 24
        ctx.set(part.load_end, 1)
        ctx.set(part.turns, MOST_TURNS)
        await ctx.tick()
        assert ctx.get(part.positive) == MOST_TURNS * round(pi / 2 * 2**24)

    run(part, bench)


def test_turnings_add_and_subtract_and_loads_go_first():
    """(1, 0) is turned by −45°, then by +26.57°, and so on; the load of the end before all else."""
    part = AngleMeter(4)
    one = 2 ** angle_bits(4)

    async def bench(ctx):
        for subtract, sign in ((0, 1), (1, -1)):
            ctx.set(part.end, {"x": 1, "y": 0})
            ctx.set(part.start, {"x": 0, "y": 3})
            ctx.set(part.turns, 2)
            ctx.set(part.subtract, subtract)
            for name in ("load_end", "load_start", "turn"):
                ctx.set(getattr(part, name), 1)
            ctx.set(part.index, 0)
            await ctx.tick()
            angle = ctx.get(part.angle)
            assert angle == 2 * round(pi / 2 * one)
            assert (ctx.get(part.vx), ctx.get(part.vy)) == (256, 0)
            ctx.set(part.load_end, 0)
            await ctx.tick()
            assert ctx.get(part.angle) == angle
            assert (ctx.get(part.vx), ctx.get(part.vy)) == (0, 3 * 256)
            ctx.set(part.load_start, 0)
            await ctx.tick()
            assert ctx.get(part.angle) == angle + sign * round(pi / 4 * one)
            assert (ctx.get(part.vx), ctx.get(part.vy)) == (3 * 256, 3 * 256)
            ctx.set(part.index, 1)
            for _ in range(2):
                await ctx.tick()
            # Once down past the axis, and once more: 768 − 384 = 384, then 384 − 576 = −192.
            assert ctx.get(part.vy) == -192
            await ctx.tick()
            assert ctx.get(part.vy) > 0
            back = round(atan2(1, 2) * one)
            assert ctx.get(part.angle) == angle + sign * (round(pi / 4 * one) + back)
            ctx.set(part.turn, 0)
            await ctx.tick()
            assert ctx.get(part.angle) == angle + sign * (round(pi / 4 * one) + back)

    run(part, bench)


def golden_angles(width, arcs):
    """Give the angles that the golden model's preparation measures, for all arcs at once."""
    golden = CarrierCircular(width, "plain")
    # The angle times 2^b does not fit 64 bits in the widest.
    kind = np.int64 if width <= 8 else object
    columns = np.array([[*start, *end, turns] for start, end, turns in arcs]).T.astype(kind)
    state = {name: np.zeros(len(arcs), kind) for name in golden.registers()}
    state["stage"] = np.zeros(len(arcs), np.int64)
    for name, column in zip(
        ("from_x", "from_y", "to_x", "to_y", "first_turns"), columns, strict=True
    ):
        state[name] = column
    state["held"] = state["held"] + 1
    state["next_periods"] = state["next_periods"] + 1
    for _ in range(golden.dividing):
        state |= golden._prepare(state, 0)
    return state["angle"].astype(float) / 2 ** angle_bits(width)


def assert_all_near(width, arcs):
    measured = golden_angles(width, arcs)
    starts, ends, turns = (np.array(column, dtype=float) for column in zip(*arcs, strict=True))
    angles = turns * pi / 2 + np.arctan2(ends[:, 1], ends[:, 0])
    angles -= np.arctan2(starts[:, 1], starts[:, 0])
    off = np.abs(measured - angles) * np.hypot(*starts.T)
    worst = int(off.argmax())
    assert off[worst] < 0.25, arcs[worst]
    return off[worst]


def test_error_of_every_arc_of_four_bits():
    points = [(x, y) for x in range(16) for y in range(16)]
    arcs = [
        (start, end, turns)
        for start in points
        for end in points
        for turns in (0, 1, 2, 3, 4, MOST_TURNS)
        if possible(start, end, turns)
    ]
    assert len(arcs) > 10_000
    # A meter without the guard bits or with fewer turnings is far worse.
    assert assert_all_near(4, arcs) > 0.01


@pytest.mark.parametrize(("width", "count"), [(8, 6000), (16, 600)])
def test_error_of_random_arcs(width, count):
    rng = np.random.default_rng([2, width])
    assert_all_near(width, [draw_arc(rng, width) for _ in range(count)])


def test_the_part_measures_what_the_golden_model_does():
    rng = np.random.default_rng(3)
    arcs = [draw_arc(rng, 8) for _ in range(15)]
    part = AngleMeter(8)

    async def bench(ctx):
        for arc, wanted in zip(arcs, golden_angles(8, arcs), strict=True):
            assert await measure(ctx, part, *arc) == wanted * 2 ** angle_bits(8), arc

    run(part, bench)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), AngleMeter, width)
