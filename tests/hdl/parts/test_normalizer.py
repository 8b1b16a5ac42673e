import random
from itertools import product

import numpy as np
import pytest

from discreta.hdl.contract import AXIS_LETTERS
from discreta.hdl.parts import Normalizer
from tests.hdl.parts.clocked import BAD_AXES, BAD_WIDTHS, assert_refused, run


def shifted_one_place_at_a_time(increments, width, signed):
    """Double all of them as long as nothing is lost; give what comes of them and the places."""
    low, high = (-(2 ** (width - 1)), 2 ** (width - 1) - 1) if signed else (0, 2**width - 1)
    places = 0
    while any(increments) and all(low <= 2 * value <= high for value in increments):
        increments = [2 * value for value in increments]
        places += 1
    return list(increments), places


def assert_normalizes(width, axes, sets, *, signed=False):
    part = Normalizer(width, axes, signed=signed)
    letters = AXIS_LETTERS[:axes]

    async def bench(ctx):
        for increments in sets:
            ctx.set(part.increments, dict(zip(letters, increments, strict=True)))
            normalized = [ctx.get(part.normalized[letter]) for letter in letters]
            shifted, places = shifted_one_place_at_a_time(increments, width, signed)
            assert normalized == shifted, increments
            if any(increments):
                assert ctx.get(part.places) == places, increments

    run(part, bench)


def test_every_pair_of_four_bits():
    assert_normalizes(4, 2, product(range(16), repeat=2))


@pytest.mark.parametrize(
    ("width", "axes"), [(4, 6), (5, 2), (5, 3), (8, 2), (8, 3), (12, 2), (12, 6), (32, 2), (32, 6)]
)
def test_random_sets(width, axes):
    rng = np.random.default_rng([width, axes])
    # A size first, then values below it: every shift is met, and so is all zero.
    sizes = 2 ** rng.integers(width + 1, size=150)
    assert_normalizes(width, axes, [rng.integers(size, size=axes).tolist() for size in sizes])


@pytest.mark.parametrize("width", [5, 8, 12, 32])
@pytest.mark.parametrize("axes", [2, 6])
def test_one_bit_of_one_axis_limits_all(width, axes):
    sets = [
        [1 << place if axis == chosen else 0 for axis in range(axes)]
        for place in range(width)
        for chosen in range(axes)
    ]
    full = [[(1 << bits) - 1] * axes for bits in range(width + 1)]
    assert_normalizes(width, axes, sets + full)


@pytest.mark.parametrize("signed", [False, True])
def test_a_limit(signed):
    """The places are those there are room for, or the limit when that is less; all zero too."""
    part = Normalizer(6, 2, signed=signed)
    numbers = (0, 1, 2, 3, 5, 9, 17, 31, *((-1, -2, -5, -16, -32) if signed else (32, 63)))

    async def bench(ctx):
        for x, y, limit in product(numbers, numbers, range(8)):
            ctx.set(part.increments, {"x": x, "y": y})
            ctx.set(part.limit, limit)
            _, room = shifted_one_place_at_a_time((x, y), 6, signed)
            places = min(room, limit) if x or y else limit
            assert ctx.get(part.places) == places, (x, y, limit)
            assert ctx.get(part.normalized.x) == x << places, (x, y, limit)
            assert ctx.get(part.normalized.y) == y << places, (x, y, limit)

    run(part, bench)


# With a sign.


def test_every_pair_of_signed_numbers():
    for width in (2, 4, 5):
        numbers = range(-(2 ** (width - 1)), 2 ** (width - 1))
        assert_normalizes(width, 2, product(numbers, repeat=2), signed=True)


@pytest.mark.parametrize(("width", "axes"), [(15, 5), (39, 5), (55, 5), (71, 2), (72, 6)])
def test_signed_numbers_of_every_size(width, axes):
    """The least number −2^(w − 1) lets nothing move, and −2^k goes a place farther than 2^k."""
    powers = [sign * 2**k for k in range(width - 1) for sign in (1, -1)]
    alone = [*powers, *(power - 1 for power in powers), -(2 ** (width - 1)), 0, -1]
    alone = [value for value in alone if value < 2 ** (width - 1)]
    sets = [[0] * k + [value] + [0] * (axes - 1 - k) for value in alone for k in (0, axes - 1)]
    sets += [[value, -1] + [0] * (axes - 2) for value in alone]
    draw = random.Random(width)
    for _ in range(150):
        size = 2 ** draw.randrange(width)
        sets.append([draw.randint(-size, size - 1) for _ in range(axes)])
    assert_normalizes(width, axes, sets, signed=True)


def test_signed_numbers_by_hand():
    for numbers, shifted in (
        ((-1, 0), (-16, 0)),
        ((1, 0), (8, 0)),
        ((-3, 2), (-12, 8)),
        ((-4, 3), (-16, 12)),
        ((-4, 4), (-8, 8)),
        ((-8, -8), (-16, -16)),
        ((-16, 1), (-16, 1)),
        ((-9, 7), (-9, 7)),
        ((0, 0), (0, 0)),
    ):
        assert shifted_one_place_at_a_time(numbers, 5, True)[0] == list(shifted)
        assert_normalizes(5, 2, [numbers], signed=True)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), Normalizer, width, 2)


@pytest.mark.parametrize(("axes", "error", "message"), BAD_AXES)
def test_refuses_axes(axes, error, message):
    assert_refused((error, message), Normalizer, 8, axes)
