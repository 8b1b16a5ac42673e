from fractions import Fraction
from math import factorial, isqrt

import numpy as np
import pytest

from discreta.hdl.parts.coefficient_unit import COEFFICIENTS, CoefficientUnit, factor_bits
from discreta.sim.golden.carrier_circular import CarrierCircular
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run

PRODUCTS = {"series": 15, "table": 5}


def kappa_and_sine(angle):
    """Give 2(1 − cos Δφ) and sin Δφ of a fraction below ½, to 2^−90."""
    terms = range(14)
    kappa = sum(2 * (-1) ** k * angle ** (2 * k + 2) / factorial(2 * k + 2) for k in terms)
    sine = sum((-1) ** k * angle ** (2 * k + 1) / factorial(2 * k + 1) for k in terms)
    return kappa, sine


def bounds(width, coefficient):
    """Give what κ and the sine may be off by: a part of themselves, and units of the last place.

    Units: what is cut off a term is at most 4 of them, but it is multiplied by Δφ² < ¼ or by Δφ <
    ½; Δφ² itself and the last product lose less than one each.
    """
    units = 4
    if coefficient == "series":
        return (Fraction(1, 2**28), units), (Fraction(1, 2**26), units)
    # A table's entry is rounded, to half of 2^−(n + 8), and multiplied by Δφ² < ¼. That tells in
    # devices of few bits, where it is some units of the last place too.
    rounded = Fraction(1, 2 ** (width + 11)) if width < 8 else Fraction(0)
    return tuple((Fraction(1, 2**18) + rounded, units) for _ in range(2))


def assert_near(width, coefficient, angle, found):
    one = 2 ** factor_bits(width)
    for name, value, true, (part, units) in zip(
        ("kappa", "sine"),
        found,
        kappa_and_sine(Fraction(angle, one)),
        bounds(width, coefficient),
        strict=True,
    ):
        off = abs(Fraction(value, one) - true)
        assert off <= part * true + Fraction(units, one), (name, angle, float(off * one))


def draw_angles(width, count, seed):
    """Draw angles below ½ of all sizes, and those that are the last or the first of a table's."""
    rng = np.random.default_rng([seed, width])
    bits = factor_bits(width)
    half = 2 ** (bits - 1)
    angles = [0, 1, half - 1, half // 2]
    for _ in range(count):
        entry = int(rng.integers(1, 257))
        # Δφ² is entry/1024 or just less.
        edge = isqrt((entry << (2 * bits)) // 1024)
        angles += [min(edge + 1, half - 1), edge - 1]
        angles += [int(rng.integers(half)), int(half * 2.0 ** (-rng.uniform(0, bits)))]
    return angles


async def compute(ctx, part, angle):
    """Have an angle computed; give κ, the sine and the clocks it was busy."""
    ctx.set(part.angle, angle)
    ctx.set(part.begin, 1)
    assert ctx.get(part.busy) == 0
    await ctx.tick()
    ctx.set(part.begin, 0)
    clocks = 0
    while ctx.get(part.busy):
        clocks += 1
        await ctx.tick()
    return ctx.get(part.kappa), ctx.get(part.sine), clocks


@pytest.mark.parametrize("coefficient", COEFFICIENTS)
@pytest.mark.parametrize(("width", "count"), [(4, 3), (8, 2), (16, 1)])
def test_error_and_latency_of_the_part(width, count, coefficient):
    part = CoefficientUnit(width, coefficient=coefficient)
    count *= 1 if coefficient == "series" else 2

    async def bench(ctx):
        assert [ctx.get(register) for register in part.registers] == [0] * len(part.registers)
        for angle in draw_angles(width, count, seed=1):
            *found, clocks = await compute(ctx, part, angle)
            assert_near(width, coefficient, angle, found)
            assert clocks == PRODUCTS[coefficient] * (3 * width + 10)
            # It stays, and is not busy again by itself.
            for _ in range(3):
                assert [ctx.get(part.kappa), ctx.get(part.sine)] == found
                assert ctx.get(part.busy) == 0
                await ctx.tick()

    run(part, bench)


def golden_coefficients(width, coefficient, angles):
    """Give what the golden model makes of all the angles at once."""
    golden = CarrierCircular(width, "rotation", coefficient)
    state = {name: np.zeros(len(angles), np.int64) for name in golden.registers()}
    state["quotient_angle"] = np.array(angles, np.int64)
    state |= golden._coefficient(state, np.ones(len(angles), np.int64))
    for _ in range(PRODUCTS[coefficient] * (3 * width + 10)):
        assert state["order"].all()
        state |= golden._coefficient(state, np.zeros(len(angles), np.int64))
    assert not state["order"].any()
    return list(zip(state["kappa"].tolist(), state["sine"].tolist(), strict=True))


@pytest.mark.parametrize(
    ("width", "coefficient", "count"),
    [(4, "series", 40), (4, "table", 40), (8, "series", 30), (8, "table", 30), (16, "series", 10)],
)
def test_error_of_many_angles(width, coefficient, count):
    angles = draw_angles(width, count, seed=2)
    for angle, found in zip(angles, golden_coefficients(width, coefficient, angles), strict=True):
        assert_near(width, coefficient, angle, found)


@pytest.mark.parametrize("coefficient", COEFFICIENTS)
def test_the_part_computes_what_the_golden_model_does(coefficient):
    angles = draw_angles(8, 2, seed=3)
    part = CoefficientUnit(8, coefficient=coefficient)

    async def bench(ctx):
        for angle, wanted in zip(angles, golden_coefficients(8, coefficient, angles), strict=True):
            assert (await compute(ctx, part, angle))[:2] == wanted, angle

    run(part, bench)


def test_in_units_of_the_last_place_at_four_bits():
    """Some hundreds of angles: at most 3 of 2^−20 by series, 10 (κ) and 20 (sine) by table."""
    angles = list(range(0, 2**19, 97 * 64))
    for coefficient, most in (("series", (3, 3)), ("table", (10, 20))):
        for angle, found in zip(angles, golden_coefficients(4, coefficient, angles), strict=True):
            true = kappa_and_sine(Fraction(angle, 2**20))
            for value, exact, units in zip(found, true, most, strict=True):
                assert abs(value - exact * 2**20) <= units, (coefficient, angle)


def test_a_new_angle_starts_afresh():
    """Begun again in the middle of a product, it gives the second angle's values."""
    part = CoefficientUnit(4, coefficient="table")
    first, second = 2**18 + 12345, 2**17 + 999

    async def bench(ctx):
        wanted = await compute(ctx, part, second)
        ctx.set(part.angle, first)
        ctx.set(part.begin, 1)
        await ctx.tick()
        ctx.set(part.begin, 0)
        for _ in range(40):
            await ctx.tick()
        ctx.set(part.angle, second)
        ctx.set(part.begin, 1)
        await ctx.tick()
        ctx.set(part.begin, 0)
        for _ in range(5 * 22):
            assert ctx.get(part.busy) == 1
            await ctx.tick()
        assert ctx.get(part.busy) == 0
        assert (ctx.get(part.kappa), ctx.get(part.sine)) == wanted[:2]

    run(part, bench)


def test_sizes_and_choices():
    assert COEFFICIENTS == ("series", "table")
    assert [factor_bits(width) for width in (4, 8, 16)] == [20, 32, 56]


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), CoefficientUnit, width)


@pytest.mark.parametrize("coefficient", ["cosine", "", 0, None])
def test_refuses_coefficient(coefficient):
    message = f"coefficient is {coefficient!r}: choose 'series' or 'table'"
    assert_refused((ValueError, message), CoefficientUnit, 8, coefficient=coefficient)
