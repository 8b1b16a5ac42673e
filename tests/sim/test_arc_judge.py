"""The judge of exact arcs in C++ is one of a few lines in NumPy, on sound and on wrong runs."""

import numpy as np
import pytest

from discreta.hdl.exact_arc import ExactArc
from discreta.sim import arc_judge
from discreta.sim.arc_judge import ArcJudge
from discreta.sim.arcs import is_empty
from discreta.sim.contour import ArcContour
from discreta.sim.groups import survey_groups
from discreta.sim.methods import METHODS
from discreta.sim.simulate import simulate
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import Stretch

pytestmark = pytest.mark.usefixtures("compiled_engine")

CLOCK, ACCEPTED, DONE, ERROR, TAKEN = range(5)


class Slow(ArcContour):
    """Judges with NumPy: ends are left out, and a step back is infinitely far."""

    def __init__(self, blocks):
        super().__init__(blocks)
        self._side = np.where(blocks[:, 6] == 1, -1, 1)

    def errors(self, points, blocks):
        ends = np.all(points == self.ends[blocks], axis=1)
        return np.where(ends, 0.0, super().errors(points, blocks))

    def _judge(self, which, points, errors):
        if len(which):
            before = np.roll(points, 1, axis=0)
            first = np.flatnonzero(np.diff(which, prepend=-1))
            before[first] = self._places[which[first]]
            (x, y), (u, v) = (before - self.centers[which]).T, (points - before).T
            errors[self._side[which] * (x * v - y * u) < 0] = np.inf
        super()._judge(which, points, errors)


def agree(blocks, stretches):
    """Give both what is judged; it must be the same."""
    quick, slow = ArcJudge(blocks), Slow(blocks)
    for stretch in stretches:
        quick.follow(stretch)
        slow.follow(stretch)
    np.testing.assert_array_equal(quick.block_steps, slow.block_steps)
    np.testing.assert_array_equal(quick.reached, slow.reached)
    np.testing.assert_array_equal(quick.block_errors, slow.block_errors)
    assert quick.largest_error == slow.largest_error
    return quick, slow


@pytest.mark.parametrize("stalls", [NO_STALLS, Stalls(7, 0.3, 0.4)], ids=["", "stalled"])
def test_what_the_rtl_draws(stalls):
    """Arcs and circles of 6 bits: below half a step, every end reached."""
    core = ExactArc(6)
    for group in survey_groups(METHODS["exact_arc"], 6):
        blocks = group.blocks[:300]
        quick, slow = agree(
            blocks, simulate(core, blocks, limit=1 << 20, engine="compiled", stalls=stalls)
        )
        assert quick.reached.all()
        assert 0.4 < quick.largest_error < 0.5
        assert quick.error_at == slow.error_at


def test_arcs_of_no_length_and_ends_off_the_circle():
    blocks = np.array(
        [
            [5, 5, 5, 5, 5, 5, 0, 0],
            [9, 0, 0, 9, 0, 0, 0, 0],
            [5, 5, 5, 5, 5, 5, 1, 0],
            # Its end is 0.54 of a step off, which is not counted.
            [3, -4, -4, -4, 0, 0, 1, 0],
        ]
    )
    quick, _ = agree(blocks, simulate(ExactArc(6), blocks, limit=500, engine="compiled"))
    assert quick.reached.all()
    assert quick.block_steps[[0, 2]].tolist() == [0, 0]
    assert quick.largest_error < 0.5


def events_of(random, blocks):
    """Write a run in which anything may happen: any step, any answer, and an answer too many."""
    rows, clock = [], 0
    for *_, clockwise, _ in [*blocks.tolist(), [0] * 8]:
        rows.append([clock, 1, 0, 0, 0, 0, 0, 0])
        moves = random.integers(-1, 2, (random.integers(0, 9), 2))
        for index, move in enumerate(moves[np.any(moves, axis=1)].tolist()):
            clock += int(random.integers(1, 3))
            rows.append([clock, 0, 0, 0, 1, *move, int(index == len(moves) - 1 or clockwise)])
        clock += 1
        done = random.integers(0, 2)
        rows.append([clock, 0, done, 2 * (1 - done), 0, 0, 0, 0])
    return np.array(rows, dtype=np.int64)


def test_runs_that_are_wrong():
    """Steps back, ends missed, errors, more answers than blocks, in stretches cut anywhere."""
    random = np.random.default_rng(1970)
    backward = missed = 0
    for _ in range(200):
        blocks = random.integers(-4, 5, (6, 8))
        blocks[:, 6], blocks[:, 7] = random.integers(0, 2, 6), 0
        blocks[::3, 2:4] = blocks[::3, :2]
        blocks[0, 4:6] = blocks[0, :2]
        events = events_of(random, blocks)
        cuts = np.sort(random.integers(0, len(events), 3))
        # Of more answers than blocks the last one's steps are not compared: to both it is late.
        answers = np.cumsum((events[:, DONE] | events[:, ERROR]) != 0)
        events = events[(answers < len(blocks)) | (events[:, TAKEN] == 0)]
        stretches = [
            Stretch(0, 0, 0, part, np.empty((0, 0), dtype=np.int64))
            for part in np.split(events, np.minimum(cuts, len(events)))
        ]
        quick, _ = agree(blocks, stretches)
        backward += int(np.isinf(quick.block_errors).sum())
        missed += int((~quick.reached).sum())
    assert backward > 100
    assert missed > 100


def test_the_point_of_a_step_back():
    blocks = np.array([[12, 3, 3, 12, 3, 3, 0, 0]])
    assert not is_empty(blocks).any()
    moves = [(0, 1), (0, 1), (0, -1), (-1, 1)]
    events = np.array([[k, 0, 0, 0, 1, *move, 0] for k, move in enumerate(moves)])
    stretch = Stretch(len(moves), 1, 0, events, np.empty((0, 0), dtype=np.int64))
    quick, slow = agree(blocks, [stretch])
    assert quick.largest_error == np.inf
    assert quick.error_at == slow.error_at == (12, 4)


def test_without_a_compiler(monkeypatch):
    monkeypatch.setattr("discreta.sim.compiled.compiler", lambda: None)
    arc_judge._library.cache_clear()
    with pytest.raises(RuntimeError, match=r"no C\+\+ compiler"):
        ArcJudge(np.zeros((1, 8), dtype=np.int64))
