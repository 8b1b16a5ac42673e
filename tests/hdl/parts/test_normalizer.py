from itertools import product

import numpy as np
import pytest

from discreta.hdl.contract import AXIS_LETTERS
from discreta.hdl.parts import Normalizer
from tests.hdl.parts.clocked import BAD_AXES, BAD_WIDTHS, assert_refused, run


def shifted_one_place_at_a_time(increments, width):
    while any(increments) and max(increments) < 2 ** (width - 1):
        increments = [2 * value for value in increments]
    return list(increments)


def assert_normalizes(width, axes, sets):
    part = Normalizer(width, axes)
    letters = AXIS_LETTERS[:axes]

    async def bench(ctx):
        for increments in sets:
            ctx.set(part.increments, dict(zip(letters, increments, strict=True)))
            normalized = [ctx.get(part.normalized[letter]) for letter in letters]
            assert normalized == shifted_one_place_at_a_time(increments, width), increments

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


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), Normalizer, width, 2)


@pytest.mark.parametrize(("axes", "error", "message"), BAD_AXES)
def test_refuses_axes(axes, error, message):
    assert_refused((error, message), Normalizer, 8, axes)
