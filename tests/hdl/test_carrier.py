"""What the constant-carrier methods share: the layouts, and the output with its timer."""

import numpy as np
import pytest
from amaranth import Shape, signed, unsigned
from amaranth.lib import data

from discreta.hdl.arc_input import arc_block_layout
from discreta.hdl.carrier import (
    PERIOD_BITS,
    CarrierOutput,
    increment_layout,
    periods_bits,
    timed_layout,
)
from discreta.hdl.quadrant import line_block_layout
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run


@pytest.mark.parametrize("width", [4, 8, 24])
def test_layouts(width):
    assert (PERIOD_BITS, periods_bits(width)) == (24, width + 8)
    steps = increment_layout(width)
    assert steps == data.StructLayout({"x": signed(width + 2), "y": signed(width + 2), "last": 1})
    for block in (line_block_layout(width, 2), arc_block_layout(width)):
        timed = timed_layout(block, width)
        # The block as it was, and its timing behind it.
        assert list(timed.members) == [*block.members, "periods", "period"]
        assert all(timed[name] == block[name] for name in block.members)
        assert Shape.cast(timed["periods"].shape) == unsigned(width + 8)
        assert Shape.cast(timed["period"].shape) == unsigned(24)
        assert timed.size == block.size + width + 8 + 24


async def put(ctx, part, increment, period):
    ctx.set(part.increment, dict(zip("xy", increment, strict=True)))
    ctx.set(part.period, period)
    ctx.set(part.put, 1)
    await ctx.tick()
    ctx.set(part.put, 0)
    ctx.set(part.increment, {"x": 0, "y": 0})
    ctx.set(part.period, 0)


def shown(ctx, part):
    """Give the increments, the position, and the position after what waits."""
    out = [ctx.get(part.out[a]) for a in "xy"]
    place = [ctx.get(part.place[a]) for a in "xy"]
    return out, place, [ctx.get(part.reached[a]) for a in "xy"]


def test_nothing_waits_after_reset_and_increments_are_due():
    part = CarrierOutput(4)

    async def bench(ctx):
        for _ in range(3):
            assert (ctx.get(part.due), ctx.get(part.waiting), ctx.get(part.timer)) == (1, 0, 0)
            assert shown(ctx, part) == ([0, 0], [0, 0], [0, 0])
            await ctx.tick()

    run(part, bench)


@pytest.mark.parametrize("period", [1, 2, 3, 7, 2**24 - 1])
def test_the_next_increments_are_due_after_the_period(period):
    part = CarrierOutput(4)

    async def bench(ctx):
        ctx.set(part.taken, 1)
        for _ in range(2):
            await put(ctx, part, (1, -1), period)
            for clock in range(1, min(period, 20)):
                assert ctx.get(part.due) == 0
                # They wait from the clock after, and were taken in it.
                assert ctx.get(part.waiting) == (clock == 1)
                await ctx.tick()
            assert ctx.get(part.due) == (period < 20)
            assert ctx.get(part.timer) == (0 if period < 20 else period - 20)

    run(part, bench)


def test_the_carrier_stands_still_while_increments_are_not_taken():
    part = CarrierOutput(4)

    async def bench(ctx):
        await put(ctx, part, (5, -7), 4)
        for _ in range(9):
            assert (ctx.get(part.due), ctx.get(part.waiting), ctx.get(part.timer)) == (0, 1, 3)
            assert shown(ctx, part) == ([5, -7], [0, 0], [5, -7])
            await ctx.tick()
        ctx.set(part.taken, 1)
        await ctx.tick()
        ctx.set(part.taken, 0)
        for timer in (2, 1, 0, 0):
            assert (ctx.get(part.due), ctx.get(part.waiting)) == (timer == 0, 0)
            assert ctx.get(part.timer) == timer
            assert shown(ctx, part)[1:] == ([5, -7], [5, -7])
            await ctx.tick()

    run(part, bench)


def test_a_start_is_loaded_and_goes_before_what_is_taken():
    part = CarrierOutput(8)

    async def bench(ctx):
        await put(ctx, part, (3, 4), 9)
        ctx.set(part.start, {"x": -256, "y": 255})
        ctx.set(part.load, 1)
        ctx.set(part.taken, 1)
        await ctx.tick()
        ctx.set(part.load, 0)
        assert shown(ctx, part)[1] == [-256, 255]
        assert ctx.get(part.waiting) == 0
        # ``taken`` is never given with nothing that waits; it would move nothing either.
        await ctx.tick().repeat(2)
        ctx.set(part.taken, 0)
        # What waits is added to what was reached, without loss: to 1 beyond the coordinates here.
        await put(ctx, part, (511, 1), 9)
        assert shown(ctx, part) == ([511, 1], [-256, 255], [255, 256])

    run(part, bench)


@pytest.mark.parametrize("width", [4, 24])
def test_random_clocks(width):
    part = CarrierOutput(width)
    rng = np.random.default_rng(width)
    most = 2**width - 1

    async def bench(ctx):
        place, out, waiting, timer = np.zeros(2, int), np.zeros(2, int), False, 0
        puts = 0
        for _ in range(1500):
            assert ctx.get(part.waiting) == waiting
            assert ctx.get(part.due) == (timer == 0)
            reached = place + waiting * out
            assert shown(ctx, part) == (out.tolist(), place.tolist(), reached.tolist())

            taken = waiting and rng.random() < 0.6
            load = not waiting and rng.random() < 0.05
            putting = timer == 0 and not load and (not waiting or taken) and rng.random() < 0.7
            # From the whole of the coordinates to the whole of them.
            target = rng.integers(-most - 1, most, 2, endpoint=True)
            period = int(rng.integers(1, 6))
            for name, value in (("taken", taken), ("load", load), ("put", putting)):
                ctx.set(getattr(part, name), int(value))
            ctx.set(part.start, dict(zip("xy", target.tolist(), strict=True)))
            ctx.set(part.increment, dict(zip("xy", (target - reached).tolist(), strict=True)))
            ctx.set(part.period, period)
            await ctx.tick()

            if putting or taken or not waiting:
                timer = period - 1 if putting else max(timer - 1, 0)
            if load:
                place = target
            elif taken:
                place = reached
            if putting:
                out = target - reached
                puts += 1
            waiting = putting or (waiting and not taken)
        assert puts > 200

    run(part, bench)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), CarrierOutput, width)
