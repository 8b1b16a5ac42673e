from itertools import product

import numpy as np
import pytest

from discreta.hdl.parts import RemainingCounter
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run


async def load(ctx, part, value):
    ctx.set(part.load, 1)
    ctx.set(part.initial, value)
    await ctx.tick()
    ctx.set(part.load, 0)


def test_every_value_and_every_command():
    part = RemainingCounter(4)

    async def bench(ctx):
        for value, loads, count in product(range(16), (0, 1), (0, 1)):
            await load(ctx, part, value)
            assert ctx.get(part.register) == value
            other = 15 - value
            ctx.set(part.load, loads)
            ctx.set(part.initial, other)
            ctx.set(part.count, count)
            assert ctx.get(part.zero) == (value == 0)
            assert ctx.get(part.ending) == (value == 0 or (value == 1 and count == 1))
            await ctx.tick()
            assert ctx.get(part.register) == (other if loads else max(value - count, 0))

    run(part, bench)


@pytest.mark.parametrize("width", [4, 8, 32])
def test_counts_to_zero_and_stays(width):
    part = RemainingCounter(width, name="p5")

    async def bench(ctx):
        ctx.set(part.count, 1)
        for _ in range(3):
            assert ctx.get(part.register) == 0  # after reset, and ever after
            assert ctx.get(part.zero) == 1
            await ctx.tick()
        await load(ctx, part, 3)
        for value in (3, 2, 1, 0, 0, 0):
            assert ctx.get(part.register) == value
            assert ctx.get(part.ending) == (value <= 1)
            await ctx.tick()

    run(part, bench)
    assert part.register.name == "p5"


@pytest.mark.parametrize("width", [4, 8, 32])
def test_random_clocks(width):
    part = RemainingCounter(width)
    rng = np.random.default_rng(width)

    async def bench(ctx):
        value = 0
        for _ in range(300):
            loads, count = rng.random() < 0.1, int(rng.random() < 0.7)
            # Small and large values alike, so that zero is reached and long borrows are too.
            initial = int(rng.integers(2 ** int(rng.integers(1, width + 1))))
            ctx.set(part.load, loads)
            ctx.set(part.initial, initial)
            ctx.set(part.count, count)
            assert ctx.get(part.zero) == (value == 0)
            assert ctx.get(part.ending) == (value - count <= 0)
            await ctx.tick()
            value = initial if loads else max(value - count, 0)
            assert ctx.get(part.register) == value

    run(part, bench)


@pytest.mark.parametrize("width", [8, 32])
def test_borrows_through_all_bits(width):
    part = RemainingCounter(width)

    async def bench(ctx):
        for value in (2 ** (width - 1), 2**width - 1):
            await load(ctx, part, value)
            ctx.set(part.count, 1)
            assert ctx.get(part.ending) == 0
            await ctx.tick()
            assert ctx.get(part.register) == value - 1
            ctx.set(part.count, 0)

    run(part, bench)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), RemainingCounter, width)
