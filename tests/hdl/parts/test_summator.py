import numpy as np
import pytest

from discreta.hdl.parts import PRELOADS, Summator
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run


def preload_value(width, preload):
    return {"zero": 0, "half": 2 ** (width - 1)}[preload]


def test_preloads():
    assert PRELOADS == ("zero", "half")


@pytest.mark.parametrize("preload", ["zero", "half"])
def test_carries_exactly_when_the_sum_reaches_2_to_the_n(preload):
    part = Summator(4, preload=preload)

    async def bench(ctx):
        for value in range(16):
            for addend in range(16):
                ctx.set(part.load, 1)
                await ctx.tick()
                ctx.set(part.load, 0)
                ctx.set(part.enable, 1)
                ctx.set(part.addend, (value - preload_value(4, preload)) % 16)
                await ctx.tick()
                assert ctx.get(part.register) == value

                ctx.set(part.addend, addend)
                assert ctx.get(part.carry) == (value + addend >= 16)
                ctx.set(part.enable, 0)
                assert ctx.get(part.carry) == 0
                await ctx.tick()
                assert ctx.get(part.register) == value
                ctx.set(part.enable, 1)
                await ctx.tick()
                assert ctx.get(part.register) == (value + addend) % 16

    run(part, bench)


@pytest.mark.parametrize("preload", ["zero", "half"])
@pytest.mark.parametrize("width", [4, 8, 32])
def test_random_clocks(width, preload):
    part = Summator(width, preload=preload)
    rng = np.random.default_rng(width)
    modulus = 2**width

    async def bench(ctx):
        value = preload_value(width, preload)
        carries = 0
        for clock in range(400):
            assert ctx.get(part.register) == value  # in clock 0: after reset
            load, enable = clock in (7, 300), rng.random() < 0.8
            addend = int(rng.integers(modulus))
            ctx.set(part.load, load)
            ctx.set(part.enable, enable)
            ctx.set(part.addend, addend)
            total = value + addend
            assert ctx.get(part.carry) == (enable and total >= modulus)
            carries += ctx.get(part.carry)
            await ctx.tick()
            if load:
                value = preload_value(width, preload)
            elif enable:
                value = total % modulus
        assert 0 < carries < 400

    run(part, bench)


@pytest.mark.parametrize("preload", ["zero", "half"])
@pytest.mark.parametrize("width", [4, 8, 32])
def test_load_goes_before_enable(width, preload):
    part = Summator(width, preload=preload)
    initial = preload_value(width, preload)

    async def bench(ctx):
        ctx.set(part.enable, 1)
        ctx.set(part.addend, 3)
        await ctx.tick()
        assert ctx.get(part.register) == initial + 3
        ctx.set(part.load, 1)
        await ctx.tick()
        assert ctx.get(part.register) == initial

    run(part, bench)


@pytest.mark.parametrize(("preload", "behind", "ahead"), [("zero", 15, 0), ("half", 8, 8)])
def test_error_bound(preload, behind, ahead):
    # In sixteenths of a step: the line less the steps put out.
    part = Summator(4, preload=preload)

    async def bench(ctx):
        for addend in range(16):
            ctx.set(part.load, 1)
            ctx.set(part.enable, 0)
            await ctx.tick()
            ctx.set(part.load, 0)
            ctx.set(part.enable, 1)
            ctx.set(part.addend, addend)
            steps = 0
            for summations in range(1, 33):
                steps += ctx.get(part.carry)
                await ctx.tick()
                assert -ahead <= summations * addend - 16 * steps <= behind

    run(part, bench)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), Summator, width)


@pytest.mark.parametrize("preload", ["full", "", 0, None])
def test_refuses_preload(preload):
    message = f"preload is {preload!r}: choose 'zero' or 'half'"
    assert_refused((ValueError, message), Summator, 8, preload=preload)
