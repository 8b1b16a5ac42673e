import numpy as np
import pytest

from discreta.hdl.parts import PRELOADS, Summator
from tests.hdl.parts.clocked import BAD_GUARDS, BAD_WIDTHS, assert_refused, run


def preload_value(bits, preload):
    return {"zero": 0, "half": 2 ** (bits - 1)}[preload]


async def load(ctx, part, value):
    ctx.set(part.load, 1)
    ctx.set(part.initial, value)
    await ctx.tick()
    ctx.set(part.load, 0)


def test_preloads():
    assert PRELOADS == ("zero", "half")


@pytest.mark.parametrize("preload", ["zero", "half"])
@pytest.mark.parametrize("guard", range(5))
def test_the_preload_is_half_of_the_modulus_or_nothing(guard, preload):
    part = Summator(5, guard=guard, preload=preload, name="sx")
    assert part.preloaded == preload_value(5 + guard, preload)
    assert (part.register.name, len(part.register)) == ("sx", 5 + guard)

    async def bench(ctx):
        assert ctx.get(part.register) == part.preloaded  # after reset
        for value in (0, part.preloaded, 2 ** (5 + guard) - 1):
            await load(ctx, part, value)
            assert ctx.get(part.register) == value

    run(part, bench)


@pytest.mark.parametrize("guard", [0, 2])
def test_carries_exactly_when_the_sum_reaches_the_modulus(guard):
    part = Summator(4, guard=guard)
    modulus = 2 ** (4 + guard)

    async def bench(ctx):
        for value in range(modulus):
            for addend in range(16):
                await load(ctx, part, value)
                assert ctx.get(part.register) == value

                ctx.set(part.enable, 1)
                ctx.set(part.addend, addend)
                assert ctx.get(part.carry) == (value + addend >= modulus)
                ctx.set(part.enable, 0)
                assert ctx.get(part.carry) == 0
                await ctx.tick()
                assert ctx.get(part.register) == value
                ctx.set(part.enable, 1)
                await ctx.tick()
                assert ctx.get(part.register) == (value + addend) % modulus
                ctx.set(part.enable, 0)

    run(part, bench)


@pytest.mark.parametrize("preload", ["zero", "half"])
@pytest.mark.parametrize(("width", "guard"), [(4, 0), (8, 4), (32, 0), (32, 4)])
def test_random_clocks(width, guard, preload):
    part = Summator(width, guard=guard, preload=preload)
    rng = np.random.default_rng([width, guard])
    modulus = 2 ** (width + guard)

    async def bench(ctx):
        value = preload_value(width + guard, preload)
        carries = summed = 0
        for clock in range(400):
            assert ctx.get(part.register) == value  # in clock 0: after reset
            loads, enable = clock in (7, 300), rng.random() < 0.8
            addend, initial = int(rng.integers(2**width)), int(rng.integers(modulus))
            ctx.set(part.load, loads)
            ctx.set(part.initial, initial)
            ctx.set(part.enable, enable)
            ctx.set(part.addend, addend)
            total = value + addend
            assert ctx.get(part.carry) == (enable and total >= modulus)
            carries += ctx.get(part.carry)
            summed += enable * addend
            await ctx.tick()
            if loads:
                value = initial
            elif enable:
                value = total % modulus
        # Two loads put the sum wrong by less than one carry each.
        assert abs(carries - summed / modulus) < 3

    run(part, bench)


@pytest.mark.parametrize("guard", [0, 3])
@pytest.mark.parametrize("width", [4, 8, 32])
def test_load_goes_before_enable(width, guard):
    part = Summator(width, guard=guard)

    async def bench(ctx):
        ctx.set(part.enable, 1)
        ctx.set(part.addend, 3)
        await ctx.tick()
        assert ctx.get(part.register) == 3
        await load(ctx, part, 9)
        assert ctx.get(part.register) == 9
        await ctx.tick()
        assert ctx.get(part.register) == 12

    run(part, bench)


@pytest.mark.parametrize("guard", [0, 1])
@pytest.mark.parametrize("preload", ["zero", "half"])
def test_error_bound(preload, guard):
    part = Summator(4, guard=guard, preload=preload)
    modulus = 2 ** (4 + guard)
    behind, ahead = {"zero": (modulus - 1, 0), "half": (modulus // 2, modulus // 2)}[preload]

    async def bench(ctx):
        for addend in range(16):
            ctx.set(part.enable, 0)
            await load(ctx, part, part.preloaded)
            ctx.set(part.enable, 1)
            ctx.set(part.addend, addend)
            steps = 0
            for summations in range(1, 2 * modulus + 1):
                steps += ctx.get(part.carry)
                await ctx.tick()
                # In parts of a step, M to the step: the line less the steps put out.
                assert -ahead <= summations * addend - modulus * steps <= behind

    run(part, bench)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), Summator, width)


@pytest.mark.parametrize(("guard", "error", "message"), BAD_GUARDS)
def test_refuses_guard(guard, error, message):
    assert_refused((error, message), Summator, 8, guard=guard)


@pytest.mark.parametrize("preload", ["full", "", 0, None])
def test_refuses_preload(preload):
    message = f"preload is {preload!r}: choose 'zero' or 'half'"
    assert_refused((ValueError, message), Summator, 8, preload=preload)
