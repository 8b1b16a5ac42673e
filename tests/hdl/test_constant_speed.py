# amaranth: UnusedElaboratable=no
# (Cores that are refused, or found in the cache, are not built.)
"""Constant speed: the exact cores' steps, spread over ticks; further axes along an arc."""

from math import hypot
from typing import Any

import numpy as np
import pytest
from amaranth.hdl import Fragment

from discreta.hdl.constant_speed import ConstantSpeed, constant_arc, constant_line
from discreta.hdl.exact_arc import ExactArc
from discreta.hdl.exact_line import ExactLine
from discreta.sim.compiled import CompiledModel
from discreta.sim.constant_speed import paced
from discreta.sim.golden import constant_speed as golden_models
from discreta.sim.interpreted import PysimModel
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS
from tests.hdl.traces import golden_trace

STALLS = [NO_STALLS, Stalls(1, stall=0.5, gap=0.3), Stalls(2, stall=0.9)]
COLUMN = {name: index for index, name in enumerate(EVENT_COLUMNS)}
MAKE: dict[str, tuple[Any, Any]] = {
    "line": (constant_line, golden_models.constant_line),
    "arc": (constant_arc, golden_models.constant_arc),
}

#: Of 3 axes and 5 bits: a helix up and one down, the plane alone, a steep one, two turns, nothing,
#: a start that is the centre, half a circle.
HELICES = np.array(
    [
        [10, 0, 0, 0, 10, 7, 0, 0, 0, 0],
        [0, 10, 7, 0, 10, -20, 0, 0, 1, 0],
        [0, 10, -20, 10, 0, -20, 0, 0, 1, 0],
        [10, 0, -20, 7, 7, 20, 0, 0, 0, 0],
        [7, 7, 20, 7, 7, 20, 0, 0, 0, 1],
        [4, 4, 0, 4, 4, 0, 4, 4, 0, 0],
        [4, 4, 9, 4, 4, 9, 4, 4, 0, 0],
        [4, 4, 9, 9, 4, 9, 4, 4, 0, 0],
        [4, 4, 9, 4, -4, 8, 0, 0, 1, 0],
    ]
)


def lines_of(axes):
    """Give some lines end to end: of no length, of one step, short, long, too long."""
    random = np.random.default_rng(5)
    points = [
        [0] * axes,
        [0] * axes,
        [1, -1, *[1] * (axes - 2)],
        *random.integers(-15, 16, (5, axes)),
    ]
    points += [[-32] * axes, [31] * axes]
    points = np.array(points)
    return np.concatenate([points[:-1], points[1:]], axis=1)


def blocks_of(kind, width, axes):
    """Give blocks of a kind with their pace, and some with another one."""
    plane = HELICES if axes == 3 else HELICES[:, [0, 1, 3, 4, *range(6, 10)]]
    blocks = paced(kind, lines_of(axes) if kind == "line" else plane, width, axes)
    again = blocks.copy()
    pace = -2 if kind == "arc" and axes > 2 else -1
    again[::2, pace] = 0
    again[1::2, pace] //= 2
    if pace == -2:
        again[::2, -1] //= 3
        # What has no arc takes no axis along.
        again[6, 5] = 12
    return np.concatenate([blocks, again])


@pytest.mark.parametrize("stalls", STALLS, ids=str)
@pytest.mark.parametrize(("kind", "axes"), [("line", 2), ("line", 3), ("arc", 2), ("arc", 3)])
def test_every_register_in_pysim(kind, axes, stalls):
    device, golden = (make(5, axes) for make in MAKE[kind])
    watch = tuple(f"reg_{name}" for name in golden.registers())
    model = PysimModel(device, watch=watch)
    blocks = blocks_of(kind, 5, axes)
    expected, _ = golden_trace(golden, model.block_fields, blocks, 9_000, stalls, until_idle=True)
    seen = model.run(blocks, len(expected), stalls=stalls)
    assert (seen.fed, seen.answered) == (len(blocks), len(blocks))
    wrong = np.argwhere(seen.watch != expected)
    assert [(clock, watch[place]) for clock, place in wrong[:5].tolist()] == []


def run(device, blocks, stalls=NO_STALLS):
    """Run blocks; give ticks, shape (ticks, axes), when, which were the last, and the errors."""
    model = CompiledModel(device)
    try:
        return run_on(model, blocks, stalls)
    finally:
        model.close()


def run_on(model, blocks, stalls=NO_STALLS):
    """Run blocks from reset, as above."""
    model.reset()
    seen = model.run(blocks, 40_000, until_answered=len(blocks), event_room=40_000, stalls=stalls)
    assert seen.answered == len(blocks)
    events = seen.events
    taken = events[:, COLUMN["taken"]] == 1
    ticks = events[taken, len(EVENT_COLUMNS) :]
    errors = events[events[:, COLUMN["error"]] != 0, COLUMN["error"]]
    return ticks[:, :-1], events[taken, COLUMN["clock"]], ticks[:, -1] == 1, errors.tolist()


@pytest.mark.usefixtures("compiled_engine")
class TestCompiled:
    @pytest.mark.parametrize("stalls", STALLS, ids=str)
    @pytest.mark.parametrize("kind", ["line", "arc"])
    def test_the_steps_are_those_of_the_core(self, kind, stalls):
        """Whatever the pace says: the same steps, in order, and the same answers."""
        blocks = blocks_of(kind, 5, 2)
        core = ExactLine(5) if kind == "line" else ExactArc(5)
        ticks, _, last, errors = run(MAKE[kind][0](5), blocks, stalls)
        steps, _, core_last, core_errors = run(core, blocks[:, :-1], stalls)
        moving = ticks.any(axis=1)
        assert np.array_equal(ticks[moving], steps)
        assert np.array_equal(last[moving], core_last)
        assert not last[~moving].any()
        assert errors == core_errors
        assert len(errors) > 0

    def test_at_full_speed_every_tick_is_a_step(self):
        for kind in ("line", "arc"):
            blocks = blocks_of(kind, 5, 2)[:8]
            blocks[:, -1] = 0
            ticks, *_ = run(MAKE[kind][0](5), blocks)
            assert ticks.any(axis=1).all()

    @pytest.mark.parametrize(("x", "y"), [(200, 0), (200, 200), (-200, 83), (17, -240)])
    def test_a_line_takes_as_many_ticks_as_it_is_long(self, x, y):
        blocks = paced("line", np.array([[0, 0, x, y]]), 8, 2)
        ticks, when, *_ = run(constant_line(8), blocks)
        assert abs(len(ticks) - hypot(x, y)) <= 1.5
        # A tick a clock, none lost; the first step of a line waits in clock 8.
        assert when.tolist() == list(range(8, 8 + len(ticks)))

    def test_between_lines_is_one_clock(self):
        points = np.array([[0, 0], [100, 0], [100, 80], [20, 0], [19, -90]])
        blocks = paced("line", np.concatenate([points[:-1], points[1:]], axis=1), 8, 2)
        ticks, when, last, _ = run(constant_line(8), blocks)
        ends = np.flatnonzero(last)
        assert len(ends) == 4
        assert np.diff(when)[ends[:-1]].tolist() == [2, 2, 2]
        assert (np.delete(np.diff(when), ends[:-1]) == 1).all()
        assert ticks.sum(axis=0).tolist() == [19, -90]

    def test_an_arc_takes_as_many_ticks_as_it_is_long(self):
        blocks = np.array([[200, 0, 200, 0, 0, 0, 1, 0], [120, 160, -160, 120, 0, 0, 0, 0]])
        for block, length in zip(blocks, (400 * np.pi, 100 * np.pi), strict=True):
            ticks, *_ = run(constant_arc(9), paced("arc", block[None], 9, 2))
            assert abs(len(ticks) - length) <= 2

    def test_helices_end_exactly_in_all_axes_whatever_their_ticks(self):
        model = CompiledModel(constant_arc(5, 3))
        for block in blocks_of("arc", 5, 3):
            ticks, _, last, errors = run_on(model, block[None])
            way = block[3:6] - block[:3]
            at_center = np.array_equal(block[:2], block[6:8])
            if at_center and way.any():
                assert errors == [2]
                assert len(ticks) == 0
            else:
                assert errors == []
                assert ticks.sum(axis=0).tolist() == way.tolist()
                assert last.tolist() == [False] * (len(ticks) - 1) + [True] * (len(ticks) > 0)
        model.close()

    def test_a_further_axis_moves_evenly(self):
        blocks = paced("arc", np.array([[100, 0, 0, 100, 0, 55, 0, 0, 0, 2]]), 8, 3)
        ticks, _, _, errors = run(constant_arc(8, 3), blocks)
        assert errors == []
        place = np.cumsum(ticks[:, 2])
        where = 55 * np.arange(1, len(ticks) + 1) / blocks[0, -1]
        assert np.abs(place - where)[:-1].max() <= 0.5 + 1e-9
        assert place[-1] == 55

    def test_a_helix_steeper_than_its_arc_moves_that_axis_every_tick(self):
        blocks = paced("arc", np.array([[20, 0, 0, 0, 20, 90, 0, 0, 0, 0]]), 8, 3)
        ticks, *_ = run(constant_arc(8, 3), blocks)
        assert len(ticks) == 90
        assert (ticks[:, 2] == 1).all()


def test_parameters_are_checked():
    with pytest.raises(ValueError, match="number of axes is 3: a line's are its core's, 2"):
        ConstantSpeed(ExactLine(4), 3)
    with pytest.raises(ValueError, match="number of axes is 7: choose a whole number from 2 to 6"):
        constant_arc(4, 7)
    core = constant_arc(6, 4)
    Fragment.get(core, None)  # it must be used
    assert core.parameters["axes"] == 4
