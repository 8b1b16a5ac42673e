from itertools import product
from math import isqrt

import numpy as np
import pytest
from amaranth import Module, ResetInserter, Signal
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part, per_axis
from discreta.hdl.parts import RadiusMeter
from discreta.sim.compiled import CompiledModel
from discreta.sim.stretch import EVENT_COLUMNS
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run
from tests.needs import needs_compiler


def expected(start, end):
    """Give ⌊2R⌋, whether both points are the centre, and whether the end is near."""
    s, e = (x * x + y * y for x, y in (start, end))
    # |√e − √s| ≤ 1 squared: e + s − 1 ≤ 2√(e·s). In a start in the centre no circle ends.
    near = s > 0 and (e + s <= 1 or (e + s - 1) ** 2 <= 4 * e * s)
    return isqrt(4 * s), s == e == 0, near


async def load(ctx, part, start, end):
    """Load two points; ends in the clock after the load."""
    for port, (x, y) in ((part.initial_start, start), (part.initial_end, end)):
        ctx.set(port, {"x": x, "y": y})
    ctx.set(part.load, 1)
    await ctx.tick()
    ctx.set(part.load, 0)
    for port in (part.initial_start, part.initial_end):
        ctx.set(port, {"x": 0, "y": 0})


async def until_measured(ctx, part):
    """Wait to the clock in which ``measured`` is 1, which is n more after the load."""
    n = part.width
    for clock in range(1, 2 * n + 4):
        assert ctx.get(part.busy) == 1
        assert ctx.get(part.measured) == 0
        assert ctx.get(part.squared) == (clock == n + 1)
        await ctx.tick()
    assert ctx.get(part.busy) == ctx.get(part.measured) == 1
    assert ctx.get(part.squared) == 0


def assert_shows(ctx, part, start, end):
    got = ctx.get(part.root), ctx.get(part.zero), ctx.get(part.near)
    assert got == expected(start, end), (start, end)
    for port, point in ((part.start, start), (part.end, end)):
        assert (ctx.get(port.x), ctx.get(port.y)) == point


class Stage(Part):
    """The meter with the face of an interpolator, so that the compiled engine can drive it."""

    def __init__(self, width):
        point = per_axis(2, width)
        shown = data.StructLayout({"root": width + 2, "zero": 1, "near": 1, "start": point})
        super().__init__(
            {
                "blocks": In(stream.Signature(data.StructLayout({"start": point, "end": point}))),
                "steps": Out(stream.Signature(shown)),
                "done": Out(1),
                "error": Out(1),
            }
        )
        self.meter = RadiusMeter(width)
        self.registers = {}

    def elaborate(self, _platform):
        m = Module()
        m.submodules.meter = meter = self.meter
        shown = self.steps.payload
        m.d.comb += [
            # The next load may fall in the clock of the answer.
            self.blocks.ready.eq(~meter.busy | meter.measured),
            meter.load.eq(self.blocks.valid & self.blocks.ready),
            meter.initial_start.eq(self.blocks.payload.start),
            meter.initial_end.eq(self.blocks.payload.end),
            shown.root.eq(meter.root),
            shown.zero.eq(meter.zero),
            shown.near.eq(meter.near),
            shown.start.eq(meter.start),
            self.steps.valid.eq(meter.measured),
            self.done.eq(meter.measured),
        ]
        return m


@needs_compiler
def test_every_pair_of_four_bit_points():
    points = list(product(range(16), repeat=2))
    blocks = np.array([(*start, *end) for start, end in product(points, points)])
    model = CompiledModel(Stage(4))
    seen = model.run(blocks, 12 * len(blocks) + 13, event_room=2 * len(blocks))
    answers = seen.events[seen.events[:, EVENT_COLUMNS.index("done")] == 1]
    # A measurement in 2n + 4 clocks, the first loaded in clock 0.
    assert answers[:, 0].tolist() == list(range(12, 12 * len(blocks) + 1, 12))
    wanted = [(*expected(a, b), *a) for a, b in product(points, points)]
    assert np.array_equal(answers[:, len(EVENT_COLUMNS) :], np.array(wanted))


def barely(width):
    """Give pairs of points whose radii differ by just 1, or by the least more than that."""
    top = 2**width - 1
    # 3-4-5 and its like: whole radii off the axes.
    whole = [(3, 4), (5, 12), (8, 15), (20, 21), (12 << (width - 5), 5 << (width - 5))]
    for x, y in whole:
        radius = isqrt(x * x + y * y)
        yield (x, y), (radius + 1, 0)
        yield (x, y), (0, radius - 1)
        yield (radius + 1, 0), (y, x)
        yield (x, y), (radius + 1, 1)
        yield (radius + 1, 1), (x, y)
        yield (x, y), (radius + 2, 0)
    yield (top - 1, 0), (top, 0)
    yield (top - 1, 0), (top, 1)
    yield (0, top), (1, top)
    yield (top, top), (top, top - 1)
    yield (top, top), (top - 1, top - 1)
    yield (0, 1), (0, 0)
    yield (0, 0), (1, 0)
    yield (0, 0), (0, 0)
    yield (top, top), (0, 0)
    yield (0, 0), (top, top)


@pytest.mark.parametrize("width", [5, 8, 32])
def test_points_at_the_bound_and_at_random(width):
    part = RadiusMeter(width)
    rng = np.random.default_rng(width)
    pairs = list(barely(width))
    assert {expected(*pair)[2] for pair in pairs} == {True, False}
    for size in rng.integers(1, width + 1, 20):
        x, y, u, v = rng.integers(2 ** int(size), size=4).tolist()
        pairs.append(((x, y), (u, v)))

    async def bench(ctx):
        for start, end in pairs:
            await load(ctx, part, start, end)
            await until_measured(ctx, part)
            assert_shows(ctx, part, start, end)

    run(part, bench)


def test_the_answer_stays_until_the_next_load():
    part = RadiusMeter(6)

    async def bench(ctx):
        for start, end, rest in (((3, 4), (5, 0), 7), ((40, 9), (9, 40), 1), ((1, 0), (9, 9), 0)):
            await load(ctx, part, start, end)
            await until_measured(ctx, part)
            assert_shows(ctx, part, start, end)
            for _ in range(rest):
                await ctx.tick()
                assert ctx.get(part.busy) == ctx.get(part.measured) == ctx.get(part.squared) == 0
                assert_shows(ctx, part, start, end)

    run(part, bench)


@pytest.mark.parametrize("reset", [False, True])
def test_reset_or_a_load_in_the_middle_of_a_measurement(reset):
    part, rst = RadiusMeter(6), Signal()

    def is_fresh(ctx):
        shown = [ctx.get(port) for port in (part.busy, part.measured, part.squared, part.near)]
        registers = (part.start_square, part.end_square, part.mask, part.rest, part.root_register)
        return shown == [0] * 4 and not any(ctx.get(register) for register in registers)

    async def bench(ctx):
        assert is_fresh(ctx)
        for clocks in range(16):
            await load(ctx, part, (63, 62), (61, 60))
            for _ in range(clocks):
                await ctx.tick()
            if reset:
                ctx.set(rst, 1)
                await ctx.tick()
                ctx.set(rst, 0)
                assert is_fresh(ctx)
            await load(ctx, part, (11, 60), (61, 0))
            await until_measured(ctx, part)
            assert_shows(ctx, part, (11, 60), (61, 0))

    run(ResetInserter(rst)(part), bench)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), RadiusMeter, width)
