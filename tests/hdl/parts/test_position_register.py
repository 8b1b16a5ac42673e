from itertools import product

import numpy as np
import pytest

from discreta.hdl.parts import PositionRegister
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run


def wrapped(value, width, magnitude=False):
    if magnitude:
        return value % 2**width
    return (value + 2**width) % 2 ** (width + 1) - 2**width


def limits(width, magnitude):
    return (0, 2**width - 1) if magnitude else (-(2**width), 2**width - 1)


async def load(ctx, part, value):
    ctx.set(part.load, 1)
    ctx.set(part.initial, value)
    await ctx.tick()
    ctx.set(part.load, 0)


@pytest.mark.parametrize("magnitude", [False, True])
def test_every_value_and_every_command(magnitude):
    part = PositionRegister(4, magnitude=magnitude)
    low, high = limits(4, magnitude)

    async def bench(ctx):
        for value, loads, up, down in product(range(low, high + 1), *[(0, 1)] * 3):
            await load(ctx, part, value)
            assert ctx.get(part.register) == value
            other = low + high - value
            ctx.set(part.load, loads)
            ctx.set(part.initial, other)
            ctx.set(part.up, up)
            ctx.set(part.down, down)
            await ctx.tick()
            counted = wrapped(value + up - down, 4, magnitude)
            assert ctx.get(part.register) == (other if loads else counted)

    run(part, bench)


@pytest.mark.parametrize("magnitude", [False, True])
@pytest.mark.parametrize("width", [4, 8, 32])
def test_wraps_at_both_ends(width, magnitude):
    part = PositionRegister(width, magnitude=magnitude, name="p3")
    low, high = limits(width, magnitude)

    async def bench(ctx):
        assert ctx.get(part.register) == 0  # after reset
        await load(ctx, part, high)
        ctx.set(part.up, 1)
        await ctx.tick()
        assert ctx.get(part.register) == low
        ctx.set(part.up, 0)
        ctx.set(part.down, 1)
        await ctx.tick()
        assert ctx.get(part.register) == high

    run(part, bench)
    assert part.register.name == "p3"


@pytest.mark.parametrize("magnitude", [False, True])
@pytest.mark.parametrize("width", [4, 8, 32])
def test_random_clocks(width, magnitude):
    part = PositionRegister(width, magnitude=magnitude)
    rng = np.random.default_rng(width)
    low, high = limits(width, magnitude)

    async def bench(ctx):
        value = 0
        for _ in range(300):
            loads, up, down = (int(rng.random() < chance) for chance in (0.05, 0.6, 0.4))
            initial = int(rng.integers(low, high, endpoint=True))
            ctx.set(part.load, loads)
            ctx.set(part.initial, initial)
            ctx.set(part.up, up)
            ctx.set(part.down, down)
            await ctx.tick()
            value = initial if loads else wrapped(value + up - down, width, magnitude)
            assert ctx.get(part.register) == value

    run(part, bench)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), PositionRegister, width)
