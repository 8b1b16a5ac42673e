"""The exact interpolator: the contract, clock by clock, and equality to the golden model."""

from collections.abc import Callable
from unittest.mock import patch

import numpy as np
import pytest
from amaranth import Module, Mux

from discreta.hdl.exact_conic import MAX_WIDTH, ExactConic, preparation_clocks
from discreta.sim import compiled as engine
from discreta.sim import conics
from discreta.sim.compiled import CompiledModel
from discreta.sim.golden.exact_conic import ExactConic as GoldenExactConic
from discreta.sim.interpreted import PysimModel
from discreta.sim.smt import check, equivalence
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS
from tests.conics import SHARP, draw_conics, fault, is_empty, moved_far
from tests.hdl.traces import golden_trace

STALLED = Stalls(1, stall=0.5, gap=0.3)
RANGE, OFF_CURVE = 1, 2
QUARTER, BACK = (1, 0, 1, 0, 0, 5, 0, 0, 5, 0, 0), (1, 0, 1, 0, 0, 0, 5, 5, 0, 1, 0)

#: Blocks that lead past their ends, or out of the coordinates of 4 bits.
BEHIND = [(1, 0, 1, 0, 0, 8, 0, 15, -9, 0, 0), (0, 0, 0, 3, -7, -9, -9, -15, 0, 0, 0)]
OUT = [(0, 0, 0, 3, -7, -9, -9, 0, 0, 0, 3), (0, 0, 0, -1, -1, 0, 0, 15, -2, 0, 9)]


def watched(golden):
    return (*(f"reg_{name}" for name in golden.registers()), *golden.outputs(golden.reset()))


def difference(make_model, core, blocks, stalls, limit=60_000):
    """Give the first clocks and names in which RTL and golden model differ, and what was seen."""
    golden = GoldenExactConic(core.width)
    model = make_model(core, watch=watched(golden))
    trace = golden_trace(golden, model.block_fields, blocks, limit, stalls, until_idle=True)
    expected = np.hstack(trace)
    seen = model.run(blocks, len(expected), stalls=stalls)
    wrong = np.argwhere(seen.watch != expected)
    names = [(clock, model.watch[column]) for clock, column in wrong[:5].tolist()]
    return names, dict(zip(model.watch, seen.watch.T, strict=True))


def some_blocks():
    blocks = draw_conics(4, 24, seed=2, turns=4)
    return np.concatenate([blocks[:12], BEHIND[:1], OUT[:1], blocks[12:], BEHIND[1:], OUT[1:]])


@pytest.mark.parametrize("stalls", [NO_STALLS, STALLED], ids=["free", "stalled"])
def test_every_register_at_every_clock_in_pysim(stalls):
    wrong, seen = difference(PysimModel, ExactConic(4), some_blocks(), stalls)
    assert wrong == []
    assert set(seen["error"]) == {0, RANGE, OFF_CURVE, SHARP}
    for name in ("steep", "slows", "turning", "diagonal", "fresh", "held", "turns"):
        assert set(seen[f"reg_{name}"]) >= {0, 1}, name


def test_every_register_at_every_clock_with_24_bits():
    """Far out and with large numbers, where every bit counts."""
    blocks = moved_far(draw_conics(4, 10, seed=4, turns=1), MAX_WIDTH)
    wrong, seen = difference(PysimModel, ExactConic(MAX_WIDTH), blocks, NO_STALLS)
    assert wrong == []
    kinds = GoldenExactConic(MAX_WIDTH).registers()
    for name in ("d", "e", "gx", "gy"):
        assert np.abs(seen[f"reg_{name}"]).max() >= 2 ** (kinds[name][0] - 6), name


@pytest.mark.usefixtures("compiled_engine")
def test_every_register_at_every_clock_compiled():
    blocks = moved_far(draw_conics(5, 24, seed=3, turns=4), 8)
    # Quick to build rather than to run: the runs are short.
    with patch.object(engine, "_FLAGS", (*engine._FLAGS, "-O0")):
        stalls = Stalls(2, stall=0.3, gap=0.5)
        wrong, seen = difference(CompiledModel, ExactConic(8), blocks, stalls)
    assert wrong == []
    assert set(seen["steps_last"][seen["steps_valid"] == 1]) == {0, 1}


def column(events, name):
    return events[:, EVENT_COLUMNS.index(name)]


def run(blocks, width, stalls=NO_STALLS, clocks=30_000):
    model = PysimModel(ExactConic(width), watch=("position_x", "position_y", "reg_running"))
    return model.run(
        np.array(blocks), clocks, until_answered=len(blocks), event_room=clocks, stalls=stalls
    )


def test_clocks_of_a_quarter_by_hand():
    """Accepted in 0, prepared to n + 8, started in n + 9; a step a clock, one for the octant."""
    seen = run([QUARTER, BACK], 4)
    accepted = seen.events[column(seen.events, "accepted") == 1, 0]
    # The next block is accepted in the clock after the first one's start.
    assert accepted.tolist() == [0, preparation_clocks(4) + 1]
    taken = seen.events[column(seen.events, "taken") == 1]
    first = taken[:7]
    assert first[0, 0] == preparation_clocks(4) + 2
    points = (np.cumsum(first[:, 5:7], axis=0) + np.array([5, 0])).tolist()
    # Of (4, 3) and (3, 4) both lie on the circle; between them is the change of the frame.
    assert points == [[5, 1], [5, 2], [4, 3], [3, 4], [2, 5], [1, 5], [0, 5]]
    assert sorted(np.diff(first[:, 0]).tolist()) == [1, 1, 1, 1, 1, 2]
    assert first[:, 7].tolist() == [0] * 6 + [1]
    done = seen.events[column(seen.events, "done") == 1, 0]
    assert done[0] == first[-1, 0] + 1


def test_one_clock_lies_between_blocks_when_the_next_is_prepared():
    half = (1, 0, 1, 0, 0, 40, 0, -40, 0, 0, 1)
    way_back = (1, 0, 1, 0, 0, -40, 0, 40, 0, 0, 1)
    seen = run([half, way_back, half], 6)
    taken = seen.events[column(seen.events, "taken") == 1]
    last = np.flatnonzero(taken[:-1, 7] == 1)
    assert len(last) == 2
    assert (taken[last + 1, 0] - taken[last, 0]).tolist() == [2, 2]


def test_a_step_every_clock_but_for_changes_of_the_frame():
    blocks = [
        conics.ellipse((1, -2), axes, angle, 8, start_angle=20, end_angle=20, clockwise=cw).block
        for axes, angle, cw in (((100, 40), 30, False), ((60, 90), 75, True))
    ]
    for block in blocks:
        seen = run([block], 8)
        taken = seen.events[column(seen.events, "taken") == 1]
        gaps = np.diff(taken[:, 0])
        assert set(gaps) == {1, 2}
        assert (gaps == 2).sum() <= 8
        assert taken[-1, 7] == 1
        assert taken[:, 5:7].sum(axis=0).tolist() == [0, 0]


def test_the_path_is_the_same_however_long_a_step_waits():
    blocks = draw_conics(4, 16, seed=6, turns=4).tolist()
    free, held = run(blocks, 4), run(blocks, 4, Stalls(7, stall=0.7))
    moves = [it.events[column(it.events, "taken") == 1][:, 5:8] for it in (free, held)]
    assert np.array_equal(moves[0], moves[1])
    assert held.ran > free.ran


def test_every_block_is_answered_and_ends_on_its_end():
    blocks = draw_conics(4, 40, seed=8, turns=4).tolist()
    seen = run(blocks, 4)
    answered = (column(seen.events, "done") | column(seen.events, "error")) != 0
    answers = seen.events[answered]
    assert column(answers, "error").tolist() == [fault(block) for block in blocks]
    begin = 0
    for block, answer in zip(blocks, answers[:, 0].tolist(), strict=True):
        steps = seen.events[(seen.events[:, 0] >= begin) & (seen.events[:, 0] < answer)]
        steps = steps[column(steps, "taken") == 1]
        moved = (steps[:, 5:7].sum(axis=0) + block[5:7]).tolist()
        if fault(block) or is_empty(block):
            assert len(steps) == 0
        else:
            assert moved == block[7:9]
            assert steps[:, 7].tolist() == [0] * (len(steps) - 1) + [1]
        begin = answer


@pytest.mark.parametrize(
    ("blocks", "code"), [(BEHIND, OFF_CURVE), (OUT, RANGE)], ids=["behind", "out"]
)
def test_a_block_that_misses_its_end_is_ended_late_and_the_next_runs(blocks, code):
    for block in blocks:
        seen = run([block, QUARTER], 4)
        answers = seen.events[(column(seen.events, "done") | column(seen.events, "error")) != 0]
        assert column(answers, "error").tolist() == [code, 0]
        taken = seen.events[column(seen.events, "taken") == 1]
        before = taken[taken[:, 0] <= answers[0, 0]]
        assert not before[:, 7].any()
        assert taken[len(before) :, 5:7].sum(axis=0).tolist() == [-5, 5]
        assert taken[-1, 7] == 1


# Broken devices


def amended(core: ExactConic, change: Callable[[Module], None]) -> ExactConic:
    """Add assignments behind those of the device: the last one wins."""
    sound = core.elaborate

    def elaborate(platform):
        m = sound(platform)
        change(m)
        return m

    core.elaborate = elaborate
    return core


def no_halves(core, m):
    """The change of the frame forgets a half of axial."""
    m.d.comb += core.between["opposite"].eq(core.turn_outer - core.across)


def steps_straight(core, m):
    """The slower axis steps, but the residual is not told."""
    m.d.comb += core.between["increment"].eq(core.axial)


def beta_kept(core, m):
    """B keeps its sign when an axis turns round."""
    m.d.comb += core.between["beta_after"].eq(Mux(core.uu.load, core.b, core.beta))


def decides_late(core, m):
    """The sign of the residual before the step decides."""
    with m.If(core.uu.clock):
        m.d.sync += core.diagonal.eq(~(core.residual[-1] ^ core.slows))


def never_fresh(core, m):
    """The constants of the change before are used again at once."""
    m.d.sync += core.fresh.eq(0)


def not_ended(core, m):
    """A block that has passed its end goes on."""
    m.d.comb += core.missed.eq(0)


def lost_under_stall(core, m):
    """A step that is not taken is forgotten."""
    m.d.comb += core.uu.ready.eq(1)


def turns_kept(core, m):
    """No turn is counted."""
    with m.If(core.uu.clock):
        m.d.sync += core.turns.eq(core.turns)


BROKEN = [
    *(no_halves, steps_straight, beta_kept, decides_late),
    *(never_fresh, not_ended, lost_under_stall, turns_kept),
]


def broken(change, width=4):
    core = ExactConic(width)
    return amended(core, lambda m: change(core, m))


@pytest.mark.parametrize("change", BROKEN, ids=lambda it: it.__name__)
def test_simulation_catches_a_broken_device(change):
    wrong, _ = difference(PysimModel, broken(change), some_blocks(), STALLED)
    assert wrong != []


@pytest.mark.parametrize("change", BROKEN, ids=lambda it: it.__name__)
def test_equivalence_catches_a_broken_device(change):
    verdicts = [check(it) for it in equivalence(broken(change), GoldenExactConic(4))]
    found = [verdict.counterexample for verdict in verdicts if not verdict.holds]
    assert found
    assert not any("gave up" in counterexample for counterexample in found)


@pytest.mark.parametrize("width", [4, 8])
def test_the_device_is_equal_to_its_golden_model(width):
    verdicts = [check(it) for it in equivalence(ExactConic(width), GoldenExactConic(width))]
    assert len(verdicts) == 5
    assert [verdict for verdict in verdicts if not verdict.holds] == []
