"""The golden model of the exact line against its closed form, and all small lines at once."""

import numpy as np
import pytest

from discreta.sim.golden.exact_line import ExactLine


def run(golden, blocks, limit, ready=lambda _: 1):
    """Run many single blocks at once, shape (blocks, 2·axes): positions of every taken step.

    Gives the steps, shape (clocks, axes, blocks), 0 where none is taken; and clocks of the answer.
    """
    state = {name: np.full(len(blocks), value) for name, value in golden.reset().items()}
    columns = dict(
        zip(
            (f"blocks_{p}_{a}" for p in ("start", "end") for a in golden.letters),
            blocks.T,
            strict=True,
        )
    )
    steps, answered = [], np.full(len(blocks), -1)
    for clock in range(limit):
        out = golden.outputs(state)
        answers = (out["done"] | out["error"]) == 1
        answered = np.where(answers & (answered < 0), clock, answered)
        take = ready(clock)
        taken = out["steps_valid"] * take
        steps.append([taken * out[f"steps_{a}"] for a in golden.letters])
        inputs = columns | {"blocks_valid": np.int64(clock == 0), "steps_ready": np.int64(take)}
        state = golden.step(state, inputs)
    return np.array(steps), answered


@pytest.mark.parametrize(
    "ready", [lambda _: 1, lambda clock: int(clock % 3 == 1)], ids=["", "stalled"]
)
def test_every_line_of_four_bits_goes_through_the_nearest_points(ready):
    span = np.arange(-15, 16)
    ends = np.stack(np.meshgrid(span, span), axis=-1).reshape(-1, 2)
    blocks = np.concatenate([0 * ends, ends], axis=1)
    steps, answered = run(ExactLine(4), blocks, 90, ready)
    assert answered.min() >= 0
    for number, end in enumerate(ends):
        made = steps[:, :, number]
        made = made[np.any(made != 0, axis=1)]
        longest = int(np.abs(end).max())
        k = np.arange(1, longest + 1)[:, None]
        # ⌊k·Δ/L + ½⌋ in whole numbers.
        assert np.array_equal(
            np.cumsum(made, axis=0), (2 * k * end + longest) // (2 * longest or 1)
        )


def test_every_line_of_eight_bits_is_half_a_step_off_at_most():
    """And some by as good as that: 0.5000 in the survey's four places."""
    ways = np.array([(a, b) for a in range(1, 256) for b in range(a + 1)])
    blocks = np.concatenate([0 * ways, ways], axis=1)
    steps, answered = run(ExactLine(8), blocks, 270)
    assert answered.min() >= 0
    points = np.cumsum(steps, axis=0)
    assert np.array_equal(points[-1].T, ways)
    beside = points[:, 0] * ways[:, 1] - points[:, 1] * ways[:, 0]
    distance = np.abs(beside) / np.hypot(*ways.T)
    assert 0.4999 < distance.max() < 0.5
    # A step a clock: the leading axis is done L clocks after its first step.
    assert np.array_equal(answered, ways[:, 0] + 8)


def test_a_tie_goes_upwards():
    """Half way between two points: up, whichever way the line goes."""
    for end, points in (((2, 1), [(1, 1), (2, 1)]), ((-2, -1), [(-1, 0), (-2, -1)])):
        steps, _ = run(ExactLine(4), np.array([(0, 0, *end)]), 20)
        made = steps[:, :, 0]
        assert np.cumsum(made[np.any(made != 0, axis=1)], axis=0).tolist() == [*map(list, points)]


def test_too_long_by_one_is_refused_both_ways():
    blocks = np.array([(-8, 0, 8, 0), (8, 0, -8, 0), (-8, 3, 7, 3), (7, 3, -8, 3)])
    golden = ExactLine(4)
    steps, answered = run(golden, blocks, 40)
    assert answered.min() >= 0
    assert np.abs(steps).sum(axis=(0, 1)).tolist() == [0, 0, 15, 15]


@pytest.mark.parametrize("axes", [3, 6])
def test_more_axes(axes):
    random = np.random.default_rng(axes)
    ways = random.integers(-15, 16, (200, axes))
    blocks = np.concatenate([0 * ways, ways], axis=1)
    steps, answered = run(ExactLine(4, axes), blocks, 40)
    assert answered.min() >= 0
    for number, way in enumerate(ways):
        made = steps[:, :, number]
        made = made[np.any(made != 0, axis=1)]
        longest = int(np.abs(way).max())
        k = np.arange(1, longest + 1)[:, None]
        assert np.array_equal(
            np.cumsum(made, axis=0), (2 * k * way + longest) // (2 * longest or 1)
        )
