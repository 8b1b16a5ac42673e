import math

import numpy as np
import pytest

from discreta.sim.methods import METHODS

LINEAR = METHODS["linear"]


def test_variants_are_all_combinations():
    chosen = {(row["normalize"], row["preload"]) for row in LINEAR.variants()}
    assert chosen == {(n, p) for n in (True, False) for p in ("half", "zero")}
    assert len(LINEAR.variants()) == 4


@pytest.mark.parametrize("axes", [2, 3, 6])
def test_no_point_of_the_fractions_is_farther_than_the_bound(axes):
    """A point is off its line by its fractions, less what lies along the line."""
    random = np.random.default_rng(axes)
    directions = random.random((20_000, axes)) ** 4 + 1e-9
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    corners = random.integers(0, 2, directions.shape)
    for preload, fractions in (("zero", corners), ("half", corners - 0.5)):
        bound = LINEAR.bound(LINEAR.golden(8, axes, preload=preload))
        along = np.sum(fractions * directions, axis=1, keepdims=True)
        off = np.linalg.norm(fractions - along * directions, axis=1)
        assert off.max() <= bound
        assert off.max() > 0.9 * bound
    assert math.isclose(LINEAR.bound(LINEAR.golden(8, 2, preload="half")), math.sqrt(1 / 2))


def test_summations_are_the_power_of_two_above_the_longest_axis():
    lengths = np.array([[0, 0], [1, 0], [5, 3], [8, 7], [255, 1]])
    normalized = LINEAR.summations(LINEAR.golden(8, 2, normalize=True), lengths)
    assert normalized.tolist() == [0, 2, 8, 16, 256]
    plain = LINEAR.summations(LINEAR.golden(8, 2, normalize=False), lengths)
    assert plain.tolist() == [0, 256, 256, 256, 256]
