import numpy as np
import pytest

from discreta.hdl.parts.divider import Divider
from tests.hdl.parts.clocked import run


async def load(ctx, part, dividend, divisor):
    ctx.set(part.dividend, dividend)
    ctx.set(part.divisor, divisor)
    ctx.set(part.load, 1)
    await ctx.tick()
    ctx.set(part.load, 0)
    # The dividend was taken over; the divisor has to stay.
    ctx.set(part.dividend, 0)


async def divide(ctx, part):
    ctx.set(part.divide, 1)
    for _ in range(len(part.quotient)):
        await ctx.tick()
    ctx.set(part.divide, 0)


def test_registers_are_named_and_nothing_stands_in_them_after_reset():
    part = Divider(7, 3, name="_x")
    assert (part.quotient.name, len(part.quotient)) == ("quotient_x", 7)
    assert (part.rest.name, len(part.rest)) == ("rest_x", 3)

    async def bench(ctx):
        assert (ctx.get(part.quotient), ctx.get(part.rest)) == (0, 0)

    run(part, bench)


def test_every_quotient_of_five_bits():
    part = Divider(5, 3)

    async def bench(ctx):
        for dividend in range(32):
            for divisor in range(8):
                await load(ctx, part, dividend, divisor)
                assert (ctx.get(part.quotient), ctx.get(part.rest)) == (dividend, 0)
                await divide(ctx, part)
                if divisor:
                    found = (ctx.get(part.quotient), ctx.get(part.rest))
                    assert found == divmod(dividend, divisor), (dividend, divisor)
                else:
                    assert ctx.get(part.quotient) == 31

    run(part, bench)


# Of the widest line and of the widest arc there are, and with a divisor wider than the dividend.
@pytest.mark.parametrize(("dividend_bits", "divisor_bits"), [(60, 32), (67, 24), (6, 20)])
def test_random_quotients(dividend_bits, divisor_bits):
    part = Divider(dividend_bits, divisor_bits)
    rng = np.random.default_rng([dividend_bits, divisor_bits])

    def draw(bits):
        value = int.from_bytes(rng.bytes(16), "big") >> (128 - bits)
        # Of all lengths.
        return value >> int(rng.integers(bits))

    async def bench(ctx):
        top = 2**dividend_bits - 1, 2**divisor_bits - 1
        pairs = [(top[0], 1), top, (0, top[1]), (top[1] & top[0], top[1] & top[0])]
        pairs += [(draw(dividend_bits), draw(divisor_bits) or 1) for _ in range(40)]
        for dividend, divisor in pairs:
            await load(ctx, part, dividend, divisor)
            await divide(ctx, part)
            found = (ctx.get(part.quotient), ctx.get(part.rest))
            assert found == divmod(dividend, divisor), (dividend, divisor)

    run(part, bench)


def test_a_bit_a_clock_and_only_when_told():
    """After k clocks the top k bits are divided, and the others still stand above the quotient."""
    part = Divider(9, 4)
    dividend, divisor = 0b101101110, 5

    async def bench(ctx):
        await load(ctx, part, dividend, divisor)
        for clock in range(10):
            left = 9 - clock
            quotient, rest = divmod(dividend >> left, divisor)
            for _ in range(2):
                assert ctx.get(part.rest) == rest
                assert ctx.get(part.quotient) == (dividend << clock) % 512 | quotient
                await ctx.tick()
            ctx.set(part.divide, 1)
            await ctx.tick()
            ctx.set(part.divide, 0)

    run(part, bench)


def test_load_goes_before_divide():
    part = Divider(6, 4)

    async def bench(ctx):
        await load(ctx, part, 61, 3)
        await divide(ctx, part)
        ctx.set(part.divide, 1)
        await load(ctx, part, 50, 7)
        assert (ctx.get(part.quotient), ctx.get(part.rest)) == (50, 0)
        await divide(ctx, part)
        assert (ctx.get(part.quotient), ctx.get(part.rest)) == divmod(50, 7)

    run(part, bench)
