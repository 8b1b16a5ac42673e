"""The lecture's circular algorithm as printed: where it is right, and where it waits for ever."""

from dataclasses import astuple
from itertools import pairwise, product
from math import sqrt
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from discreta.hdl.circular import Circular
from discreta.sim.golden.circular import Circular as Golden
from discreta.sim.simulate import simulate
from discreta.sim.stretch import EVENT_COLUMNS
from tests import lecture
from tests.lecture import CHECKS, ENDS, LEAVES, ORDERS, SIGNS, WAITS, Reading, run, run_all

#: The lecture's orders, and those of our settings that are meant.
READINGS = [("device", "simultaneous"), ("steps", "alternated")]

#: The first arc between whole degrees that waits for ever in the device of the block diagram.
HANGING = (2, 4), (0, 5)


@pytest.fixture(scope="module")
def arcs():
    return np.array(list(lecture.degree_arcs()))


def block(start, end):
    return np.array([[*start, *end, 0, 0, 0, 0]])


def test_an_arc_worked_out_by_hand():
    """4 bits: M is 16."""
    result = run((2, 0), (0, 2), 4)
    points = [(at.xt, at.yt) for at in result.cells]
    # SY has 2 more every time, 16 after 8 and after 16 summations: then Y has no steps left.
    assert points[:8] == [(2, 0)] * 8
    assert points[8:16] == [(2, 1)] * 8
    # SX has had 1 eight times, and has 2 more from now on: 16 after another 4, and after 8 more.
    assert points[16:20] == [(2, 2)] * 4
    assert points[20:28] == [(1, 2)] * 8
    assert points[28:] == [(0, 2)]
    assert result.fate == ENDS
    assert result.error == pytest.approx(sqrt(8) - 2)


@pytest.mark.parametrize("reading", list(product(SIGNS, ORDERS, CHECKS)), ids="-".join)
def test_many_arcs_at_a_time_as_one_by_one(arcs, reading):
    chosen = arcs[::997]
    fates, last = run_all(chosen, 8, Reading(*reading))
    for arc, fate, (*cells, summations) in zip(
        chosen.tolist(), fates.tolist(), last.tolist(), strict=True
    ):
        result = run(tuple(arc[:2]), tuple(arc[2:]), 8, Reading(*reading))
        assert lecture.FATES[fate] == result.fate
        assert (astuple(result.cells[-1]), len(result.cells) - 1) == (tuple(cells), summations)


@pytest.mark.parametrize("order", ORDERS)
def test_it_waits_for_ever(order):
    """X is 0, so nothing is added to SY: the one step that is left never comes."""
    result = run(*HANGING, 8, Reading(order=order))
    assert result.fate == WAITS
    last = result.cells[-1]
    assert last == result.cells[-2]
    assert (last.xt, last.yt, last.kox, last.koy) == (0, 4, 0, 1)


@pytest.mark.parametrize(("order", "setting"), READINGS)
def test_our_device_ends_there_with_its_completing_step(order, setting):
    """The lecture's steps, each a clock after its summation, and then the one that is left."""
    start, end = HANGING
    width = 8
    cells = run(start, end, width, Reading(order=order)).cells
    settings: dict[str, Any] = Circular.LECTURE | {"order": setting}
    core = Circular(width, **settings)
    events = np.concatenate(
        [part.events for part in simulate(core, block(start, end), limit=2 * len(cells))]
    )
    column = {name: events[:, index] for index, name in enumerate(EVENT_COLUMNS)}
    taken = column["taken"] == 1
    points = start + np.cumsum(events[taken, len(EVENT_COLUMNS) : -1], axis=0)
    points = list(zip(column["clock"][taken].tolist(), map(tuple, points.tolist()), strict=True))
    # Prepared from clock 0 to 2n + 4 and started in clock 2n + 5; t summations stand in the cells
    # in clock 2n + 6 + t, in which the step of the last of them leaves.
    steps = [
        (2 * width + 6 + t, (now.xt, now.yt))
        for t, (before, now) in enumerate(pairwise(cells), start=1)
        if (before.xt, before.yt) != (now.xt, now.yt)
    ]
    assert points[:-1] == steps
    # The summation that changes nothing is the one that completes.
    assert points[-1] == (2 * width + 6 + len(cells) - 1, end)
    assert column["done"].tolist() == [0] * (len(events) - 1) + [1]


@pytest.mark.parametrize(("order", "setting"), READINGS)
def test_the_golden_model_is_the_corrected_algorithm(arcs, order, setting):
    """Cell by cell after every summation, for arcs that end; the setting is the lecture's."""
    width = 5
    inside = arcs[(arcs.max(axis=1) < 2**width) & ~lecture.off_circle(arcs)]
    chosen = np.random.default_rng(1970).choice(inside, 300)
    runs = [
        run(tuple(arc[:2]), tuple(arc[2:]), width, Reading(order=order)) for arc in chosen.tolist()
    ]
    ending = [at.fate == ENDS for at in runs]
    assert sum(ending) > 290
    settings: dict[str, Any] = Circular.LECTURE | {"order": setting}
    golden = Golden(width, **settings)
    state = {name: np.full(len(chosen), value) for name, value in golden.reset().items()}
    fields = ("start_x", "start_y", "end_x", "end_y")
    inputs = {f"blocks_{name}": column for name, column in zip(fields, chosen.T, strict=True)}
    inputs |= dict.fromkeys(("blocks_center_x", "blocks_center_y", "blocks_clockwise"), 0)
    inputs |= {"blocks_full_turns": 0, "blocks_valid": 1, "steps_ready": 1}
    longest = max(len(at.cells) for at in runs)
    seen = []
    for clock in range(2 * width + 6 + longest):
        seen.append(np.stack([state[name] for name in ("p1", "p2", "p3", "p4", "sx", "sy")]))
        state = golden.step(state, inputs | {"blocks_valid": int(clock == 0)})
    for lane in np.flatnonzero(ending):
        cells = [astuple(now) for now in runs[lane].cells]
        rows = [tuple(row[:, lane].tolist()) for row in seen[2 * width + 6 :]]
        assert rows[: len(cells)] == cells
        # It has ended: nothing is summed any more.
        assert set(rows[len(cells) :]) <= {cells[-1]}


def test_a_fifth_of_a_percent_waits_for_ever(arcs):
    """The device of the block diagram; always one step short, and on the circle within a step."""
    # 66 radii, 91 · 90 / 2 pairs of degrees; small circles have fewer points.
    assert 0.98 * 66 * 4095 < len(arcs) < 66 * 4095
    fates, last = run_all(arcs, 8, Reading(order="device"))
    waits = fates == lecture.FATES.index(WAITS)
    assert 0.0015 < np.count_nonzero(waits) / len(arcs) < 0.0025
    first = arcs[np.flatnonzero(waits)[0]].tolist()
    assert first == [*HANGING[0], *HANGING[1]]
    assert np.all(last[waits, 0] == 0)
    assert np.all(last[waits, 2:4] == [0, 1])
    assert not np.any(waits & lecture.off_circle(arcs))
    # All others end on their end points.
    assert np.all(fates[~waits] == lecture.FATES.index(ENDS))
    assert np.array_equal(last[~waits, :2], arcs[~waits, 2:])


@pytest.mark.parametrize("order", ORDERS)
def test_with_the_sign_as_printed_no_end_is_reached(arcs, order):
    """Where X has to move at all it moves away."""
    chosen = arcs[::29]
    moves = chosen[:, 0] != chosen[:, 2]
    assert 0 < np.count_nonzero(~moves) < 0.02 * len(chosen)
    for check in CHECKS:
        _, last = run_all(chosen, 8, Reading("printed", order, check))
        assert np.all(last[moves, 0] > chosen[moves, 2])


def test_without_the_check_of_exercise_3_axes_run_past_their_ends(arcs):
    """The lecture alone does not say that an axis stops; then a third leaves the quadrant."""
    fates, _ = run_all(arcs[::29], 8, Reading(check="text"))
    leaves = np.mean(fates == lecture.FATES.index(LEAVES))
    assert leaves > 0.25


def test_points_of_whole_degrees_are_nearest():
    for radius, degree in product((2, 5, 101, 197), range(91)):
        x, y = lecture.nearest(radius, degree)
        true = radius * np.exp(1j * np.radians(degree))
        assert max(abs(x - true.real), abs(y - true.imag)) < 0.5 + 1e-9
    # 5 · cos 60° is two and a half.
    assert (lecture.nearest(5, 60), lecture.nearest(5, 30)) == ((3, 4), (4, 3))


def test_off_circle_is_more_than_a_step():
    near = [[3, 4, 0, 6], [3, 4, 0, 4], [0, 6, 3, 4], [5, 0, 5, 0]]
    assert not lecture.off_circle(np.array(near)).any()
    # √32 is 5.66 and √2 is 1.41.
    assert lecture.off_circle(np.array([[3, 4, 0, 7], [4, 4, 0, 4], [1, 1, 0, 0]])).all()


def test_the_command_tells_what_happens():
    def say(*words):
        result = CliRunner().invoke(lecture.main, words)
        return result.exit_code, result.output

    assert say("--start", "2,4", "--end", "0,5", "--order", "device") == (
        0,
        "waits for ever after 129 summations at 0,4, NOT on its end point, with KOX = 0, KOY = 1, "
        "SX = 0, SY = 192\nlargest distance from the circle 0.4721 steps\n",
    )
    code, output = say("--start", "20,0", "--end", "0,20")
    assert code == 0
    assert output.startswith("ends after ")
    assert " at 0,20, on its end point, with KOX = 0, KOY = 0, " in output
    code, output = say("--start", "20,0", "--end", "0,20", "--sign", "printed")
    assert code == 0
    assert " at 40,20, NOT on its end point, " in output
    for words in ([], ["--start", "1,1", "--end", "2,2"], ["--start", "one", "--end", "2,2"]):
        assert say(*words)[0] == 2
