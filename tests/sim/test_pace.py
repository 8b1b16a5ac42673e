from itertools import pairwise

import numpy as np
import pytest

from discreta.hdl.linear import Linear
from discreta.sim import simulate as simulation
from discreta.sim.pace import Pace
from discreta.sim.simulate import simulate
from discreta.sim.stretch import EVENT_COLUMNS, Stretch

WIDTH = 6


def pace_of(points, **options):
    points = np.array(points)
    blocks = np.hstack([points[:-1], points[1:]])
    pace = Pace()
    core = Linear(WIDTH, points.shape[1], **options)
    for stretch in simulate(core, blocks, limit=len(blocks) * 70, watch=("reg_running",)):
        pace.follow(stretch)
    return pace


def lost_to_points_that_stay(points):
    """Every run of k blocks of no length between two that move costs k + 1 clocks."""
    stays = [start == end for start, end in pairwise(points)]
    moving = [index for index, stay in enumerate(stays) if not stay]
    between = [b - a - 1 for a, b in pairwise(moving)]
    return sum(k + 1 for k in between if k)


PATHS = {
    "one line": [(0, 0), (20, 9)],
    "long lines": [(0, 0), (20, 9), (-20, 3), (-20, 4), (5, 5)],
    "steps alone": [(0, 0), (1, 0), (1, 1), (0, 0), (1, 0), (1, 1), (0, 1)],
    "one point twice": [(0, 0), (1, 0), (1, 0), (2, 1)],
    "one point thrice": [(0, 0), (1, 0), (1, 0), (1, 0), (2, 1)],
    "doubles everywhere": [(3, 3), (3, 3), (9, 1), (9, 1), (8, 1), (8, 1), (8, 1), (0, 0), (0, 0)],
    "no move": [(3, 3), (3, 3), (3, 3)],
}


@pytest.mark.parametrize("stretch", [1, 2, 7, 1 << 16])
@pytest.mark.parametrize("points", PATHS.values(), ids=PATHS)
def test_only_points_that_stay_lose_clocks(points, stretch, monkeypatch):
    monkeypatch.setattr(simulation, "STRETCH", stretch)
    assert pace_of(points).lost == lost_to_points_that_stay(points)


def test_summations():
    """Without the normalizer and with preload zero a line takes 2^n summations."""
    options = {"normalize": False, "preload": "zero"}
    assert pace_of([(0, 0), (1, 0), (1, 0), (-20, 9)], **options).summations == 2 * 2**WIDTH
    assert pace_of([(0, 0), (0, 0)], **options).summations == 0


def test_idle_clocks_are_lost():
    """Written out by hand: blocks of 2 and 1 summations with 3 clocks between that do nothing."""
    running = [0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0]
    rows = [(0, 1, 0, 0, 0, 0, 0), (3, 0, 0, 0, 1, 1, 0), (4, 0, 0, 0, 1, 1, 1)]
    rows += [(7, 1, 1, 0, 0, 0, 0), (9, 0, 0, 0, 1, 1, 1), (10, 0, 1, 0, 0, 0, 0)]
    assert len(EVENT_COLUMNS) == 5
    stretch = Stretch(
        ran=len(running),
        fed=2,
        answered=2,
        events=np.array(rows),
        watch=np.array(running)[:, None],
    )
    pace = Pace()
    assert pace.lost == 0
    pace.follow(stretch)
    assert (pace.summations, pace.lost) == (3, 3)
