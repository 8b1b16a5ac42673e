import random
from itertools import product

import pytest

from discreta.hdl.parts.scale_converter import (
    ScaleConverter,
    coefficient_bits,
    derivative_bits,
    linear_bits,
)
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run

COMMANDS = ("clear", "multiply", "add", "move")


def limits(bits):
    return -(2 ** (bits - 1)), 2 ** (bits - 1) - 1


def give(ctx, part, **inputs):
    for name in (*COMMANDS, "sign", "x_bit", "y_bit", "x_step", "y_step"):
        ctx.set(getattr(part, name), inputs.get(name, 0))


async def multiply(ctx, part, x, y):
    """Have G worked out the multiplying way, and give the clocks that it took from ``clear``."""
    give(ctx, part, clear=1)
    await ctx.tick()
    clocks = 0
    for place in reversed(range(part.width + 1)):
        sign = place == part.width
        give(ctx, part, multiply=1, sign=sign, x_bit=x >> place & 1, y_bit=y >> place & 1)
        await ctx.tick()
        clocks += 1
    give(ctx, part, add=1)
    await ctx.tick()
    give(ctx, part)
    return clocks + 1


def set_scales(ctx, part, p, q, r):
    ctx.set(part.x_scale, p)
    ctx.set(part.y_scale, q)
    ctx.set(part.rest, r)


class Converter(ScaleConverter):
    """The part, with its width at hand."""

    def __init__(self, width):
        super().__init__(width)
        self.width = width


@pytest.mark.parametrize("width", [4, 5, 32])
def test_the_multiplying_shape(width):
    """P·x + Q·y + R for extreme and random numbers, n + 2 clocks after ``clear``."""
    part = Converter(width)
    draw = random.Random(width)
    point, scale, rest = (
        limits(bits) for bits in (width + 1, coefficient_bits(width) + 1, linear_bits(width))
    )
    low, high = limits(derivative_bits(width))
    kinds = (point, point, scale, scale, rest)
    rows = list(product(*kinds))
    rows += [(0, 0, *row[2:]) for row in rows[:8]] + [(-1, 1, *row[2:]) for row in rows[:8]]
    rows += [tuple(draw.randint(*kind) for kind in kinds) for _ in range(20)]

    async def bench(ctx):
        for x, y, p, q, r in rows:
            set_scales(ctx, part, p, q, r)
            assert await multiply(ctx, part, x, y) == width + 2
            # It wraps, but not for a block: of P and Q one has a bit less there.
            value = (p * x + q * y + r - low) % (high - low + 1) + low
            assert ctx.get(part.register) == value, (x, y, p, q, r)

    run(part, bench)


@pytest.mark.parametrize("width", [4, 8, 32])
def test_no_block_makes_it_wrap(width):
    """The extremes of the coefficients, the one of the axis' own doubled, fit 2n + 7 bits."""
    part = Converter(width)
    low, high = limits(derivative_bits(width))
    point, scale, rest = (
        limits(bits) for bits in (width + 1, coefficient_bits(width), linear_bits(width))
    )

    async def bench(ctx):
        for x, y, p, q, r in product(point, point, scale, scale, rest):
            value = 2 * p * x + q * y + r
            assert low <= value <= high
            set_scales(ctx, part, 2 * p, q, r)
            await multiply(ctx, part, x, y)
            assert ctx.get(part.register) == value

    run(part, bench)


@pytest.mark.parametrize("width", [4, 12, 32])
def test_the_incremental_shape_is_the_multiplying_one_step_by_step(width):
    """A path of steps of all eight kinds; now and then the multiplying shape starts anew on it."""
    part = Converter(width)
    draw = random.Random(width)
    (low, high), scale, rest = (
        limits(bits) for bits in (width + 1, coefficient_bits(width), linear_bits(width))
    )

    async def bench(ctx):
        met = set()
        for _ in range(6):
            p, q, r = (draw.randint(*kind) for kind in (scale, scale, rest))
            x, y = (draw.randint(low, high) for _ in range(2))
            set_scales(ctx, part, 2 * p, q, r)
            await multiply(ctx, part, x, y)
            for _ in range(40):
                assert ctx.get(part.register) == 2 * p * x + q * y + r, (x, y, p, q, r)
                moves = draw.random() < 0.8
                dx, dy = (
                    min(max(place + draw.randint(-1, 1), low), high) - place for place in (x, y)
                )
                met.add((dx, dy, moves))
                give(ctx, part, move=moves, x_step=dx, y_step=dy)
                await ctx.tick()
                x, y = x + moves * dx, y + moves * dy
        assert len(met) == 18

    run(part, bench)


def test_of_several_commands_the_first_is_done():
    part = Converter(4)

    async def bench(ctx):
        set_scales(ctx, part, 100, 7, 90)
        assert ctx.get(part.register) == 0  # after reset
        for commands in product((0, 1), repeat=4):
            # 100·1 + 7·2 + 90
            await multiply(ctx, part, 1, 2)
            assert ctx.get(part.register) == 204
            chosen = dict(zip(COMMANDS, commands, strict=True))
            give(ctx, part, **chosen, x_bit=1, y_bit=1, x_step=-1, y_step=1)
            await ctx.tick()
            clear, multiplies, add, move = commands
            if clear:
                value = 0
            elif multiplies:
                value = 408 + 107
            elif add:
                value = 294
            else:
                value = 111 if move else 204
            assert ctx.get(part.register) == value, chosen
            # Steps and bits alone do nothing.
            give(ctx, part, sign=1, x_bit=1, y_bit=1, x_step=-1, y_step=1)
            await ctx.tick()
            assert ctx.get(part.register) == value

    run(part, bench)


def test_bits_by_hand():
    """Those of a block's limits at 16 bits."""
    assert (coefficient_bits(16), linear_bits(16), derivative_bits(16)) == (20, 37, 39)
    part = ScaleConverter(16, name="gx")
    assert (part.register.name, part.register.shape().width) == ("gx", 39)

    async def bench(_):
        pass

    run(part, bench)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), ScaleConverter, width)
