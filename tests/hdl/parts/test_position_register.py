from itertools import product

import numpy as np
import pytest

from discreta.hdl.parts import PositionRegister
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run


def wrapped(value, width):
    return (value + 2**width) % 2 ** (width + 1) - 2**width


async def load(ctx, part, value):
    ctx.set(part.load, 1)
    ctx.set(part.initial, value)
    await ctx.tick()
    ctx.set(part.load, 0)


def test_every_value_and_every_command():
    part = PositionRegister(4)

    async def bench(ctx):
        for value, loads, up, down in product(range(-16, 16), *[(0, 1)] * 3):
            await load(ctx, part, value)
            assert ctx.get(part.register) == value
            other = -1 - value
            ctx.set(part.load, loads)
            ctx.set(part.initial, other)
            ctx.set(part.up, up)
            ctx.set(part.down, down)
            await ctx.tick()
            assert ctx.get(part.register) == (other if loads else wrapped(value + up - down, 4))

    run(part, bench)


@pytest.mark.parametrize("width", [4, 8, 32])
def test_wraps_at_both_ends(width):
    part = PositionRegister(width, name="p3")
    low, high = -(2**width), 2**width - 1

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


@pytest.mark.parametrize("width", [4, 8, 32])
def test_random_clocks(width):
    part = PositionRegister(width)
    rng = np.random.default_rng(width)

    async def bench(ctx):
        value = 0
        for _ in range(300):
            loads, up, down = (int(rng.random() < chance) for chance in (0.05, 0.6, 0.4))
            initial = int(rng.integers(-(2**width), 2**width))
            ctx.set(part.load, loads)
            ctx.set(part.initial, initial)
            ctx.set(part.up, up)
            ctx.set(part.down, down)
            await ctx.tick()
            value = initial if loads else wrapped(value + up - down, width)
            assert ctx.get(part.register) == value

    run(part, bench)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), PositionRegister, width)
