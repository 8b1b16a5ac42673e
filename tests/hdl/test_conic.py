"""The whole device: the contract, clock by clock, and equality to the golden model."""

from itertools import product
from unittest.mock import patch

import numpy as np
import pytest

from discreta.hdl.conic import MAX_WIDTH, ORDERS, Conic, conic_block_layout
from discreta.sim import compiled as engine
from discreta.sim import conics
from discreta.sim.compiled import CompiledModel
from discreta.sim.golden.conic import Conic as GoldenConic
from discreta.sim.interpreted import PysimModel
from discreta.sim.smt import Rtl
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS
from tests.conics import (
    FIELDS,
    LANDS,
    LECTURE,
    SHARP,
    draw_conics,
    fault,
    is_empty,
    moved_far,
    run_conics,
)
from tests.hdl.parts.clocked import BAD_GUARDS, assert_refused
from tests.hdl.traces import golden_trace

VARIANTS = [
    {"order": order, "preload": preload, "guard": guard}
    for order, preload, guard in product(
        ("implicit", "alternated", "simultaneous"), ("half", "zero"), (2, 0)
    )
]
SOME = [VARIANTS[k] for k in (0, 3, 5, 6, 8)]
STALLED = Stalls(1, stall=0.5, gap=0.3)

#: A quarter of a circle that the tests run to have something behind or before something else.
QUARTER, BACK = (1, 0, 1, 0, 0, 5, 0, 0, 5, 0, 0), (1, 0, 1, 0, 0, 0, 5, 5, 0, 1, 0)


#: Wrong ends: x, and y, has gone beyond its own when the last piece begins.
BACKWARD = [(1, 0, 1, 0, 0, 4, 0, 2, 2, 0, 1), (1, 0, 1, 0, 0, 0, 4, 2, 2, 1, 1)]


def names(variant):
    return "-".join(map(str, variant.values()))


def assert_equal(make_model, width, variant, blocks, stalls):
    """Compare every register and output at every clock."""
    golden = GoldenConic(width, **variant)
    watch = tuple(f"reg_{name}" for name in golden.registers())
    outputs = tuple(golden.outputs(golden.reset()))
    model = make_model(Conic(width, **variant), watch=(*watch, *outputs))
    expected = np.hstack(
        golden_trace(golden, model.block_fields, blocks, 60_000, stalls, until_idle=True)
    )
    seen = model.run(blocks, len(expected), stalls=stalls)
    assert (seen.fed, seen.answered) == (len(blocks), len(blocks))
    wrong = np.argwhere(seen.watch != expected)
    assert [(clock, model.watch[column]) for clock, column in wrong[:5].tolist()] == []
    return dict(zip(model.watch, seen.watch.T, strict=True))


@pytest.mark.parametrize(
    ("variant", "stalls"),
    [(VARIANTS[0], NO_STALLS), (LECTURE, NO_STALLS), *((variant, STALLED) for variant in SOME)],
    ids=lambda value: names(value) if isinstance(value, dict) else str(value),
)
def test_every_register_at_every_clock_in_pysim(variant, stalls):
    blocks = draw_conics(4, 10, seed=2 + stalls.seed, turns=2)
    blocks[[1, 4]] = BACKWARD
    seen = assert_equal(PysimModel, 4, variant, blocks, stalls)
    assert set(seen["reg_error"]) == {0, SHARP}
    for name in ("turns", "backward_x", "backward_y", "held", "running"):
        assert seen[f"reg_{name}"].any(), name


@pytest.mark.parametrize("variant", [{"guard": 4}, LECTURE], ids=["guard", "lecture"])
def test_every_register_at_every_clock_with_24_bits(variant):
    """Far out and with large numbers, where every bit counts; no register has more than 64."""
    blocks = moved_far(draw_conics(4, 10, seed=4, turns=1), MAX_WIDTH)
    seen = assert_equal(PysimModel, MAX_WIDTH, variant, blocks, NO_STALLS)
    for name, (bits, signed) in GoldenConic(MAX_WIDTH, **variant).registers().items():
        if name[0] in "abcdegs" and signed:
            assert np.abs(seen[f"reg_{name}"]).max() >= 2 ** (bits - 4), name


@pytest.mark.usefixtures("compiled_engine")
def test_every_register_at_every_clock_compiled():
    blocks = np.concatenate([moved_far(draw_conics(5, 24, seed=3, turns=2), 8), [LANDS]])
    # Quick to build rather than to run: the runs are short.
    with patch.object(engine, "_FLAGS", (*engine._FLAGS, "-O0")):
        seen = assert_equal(CompiledModel, 8, {}, blocks, Stalls(2, stall=0.3, gap=0.5))
    assert set(seen["steps_last"][seen["steps_valid"] == 1]) == {0, 1}


def column(events, name):
    return events[:, EVENT_COLUMNS.index(name)]


@pytest.mark.parametrize("variant", [{}, LECTURE, {"order": "alternated", "guard": 1}], ids=str)
def test_clocks_of_blocks_and_between_them(variant):
    """Every clock of acceptance, steps and answers, and every step, as the docstring tells them."""
    blocks = draw_conics(4, 16, seed=5, turns=2)
    runs = list(run_conics(blocks.tolist(), width=4, **variant))
    limit = runs[-1].answered + 1
    seen = PysimModel(Conic(4, **variant)).run(blocks, limit, event_room=limit)
    clocks = column(seen.events, "clock")
    accepted = clocks[column(seen.events, "accepted") == 1]
    assert accepted.tolist() == [run.accepted for run in runs]
    done, error = column(seen.events, "done"), column(seen.events, "error")
    answers = [[run.answered, int(not run.code), run.code] for run in runs]
    assert np.stack([clocks, done, error], axis=1)[(done | error) != 0].tolist() == answers
    wanted = []
    for run, block in zip(runs, blocks.tolist(), strict=True):
        path = [block[5:7], *(point for _, point in run.steps)]
        for k, (clock, (x, y)) in enumerate(run.steps):
            last = int(k == len(run.steps) - 1)
            wanted.append([clock, x - path[k][0], y - path[k][1], last])
    steps = np.column_stack([clocks, seen.events[:, len(EVENT_COLUMNS) :]])
    assert steps[column(seen.events, "taken") == 1].tolist() == wanted


def test_clocks_of_a_half_circle_by_hand():
    """(4, 0) over (0, 4) to (−4, 0) in the lecture's machine of 4 bits, behind an empty block."""
    watch = tuple(f"reg_{name}" for name in ("tick", "held", "running", "gx", "gy", "turns"))
    blocks = np.array([[1, 0, 1, 0, 0, 4, 0, 4, 0, 0, 0], [1, 0, 1, 0, 0, 4, 0, -4, 0, 0, 1]])
    model = PysimModel(Conic(4, **LECTURE), watch=watch)
    seen = model.run(blocks, 60, until_answered=2, event_room=60)
    tick, held, running, gx, gy, turns = seen.watch.T
    # Prepared in n + 4 clocks, of which the last one starts it: 1 to 8. It is answered in clock 9,
    # and in the same clock the next one is accepted, which runs from clock 18 on.
    assert tick[:9].tolist() == [0, 1, 2, 3, 4, 5, 6, 7, 0]
    assert held.tolist()[:20] == [0, *[1] * 8, 0, *[1] * 8, 0, 0]
    assert column(seen.events, "clock")[column(seen.events, "accepted") == 1].tolist() == [0, 9]
    assert column(seen.events, "clock")[column(seen.events, "done") == 1].tolist()[0] == 9
    assert (gx[17], gy[17]) == (8, 0)
    assert (np.flatnonzero(running)[0], running[18]) == (18, 1)
    # x' = −2y, y' = 2x, in parts of M = 2^14 and shifted below it; SX starts from just below 1,
    # for x falls. G = (8, 0), shifted by 10: in clock 18 SY is 1/2, in 19 it carries, y = 1.
    # (8, 2): x' = −1/8. 20: 7/8, 1/2. 21: 3/4, carry, y = 2. (8, 4): 22: 1/2, 1/2. 23: 1/4, y = 3.
    # (8, 6): 24: 1/4 − 3/8 borrows, x = 3 and 7/8, 1/2. (6, 6) by 11: 25: 1/8, 5/4 and y = 4.
    # (6, 8) by 10: 26: −3/8, x = 2 and 5/8, 5/8. (4, 8): 27: 1/8, 7/8. 28: −3/8, x = 1 and 5/8,
    # 9/8 and y = 5. (2, 10): 29: just below 0, x = 0 and 1, 1/4. (0, 10): y is turned round in 30.
    # x has 4 to go, y 5. 31: 3/8, y stands still. 32: −1/4, x = −1 and 3/4. (−2, 10): 33: 1/8, 1/8.
    # 34: −1/2, x = −2 and 1/2, 0 is no borrow. (−4, 10): 35: −1/8, x = −3 and 7/8, −1/4, y = 4 and
    # 3/4. (−6, 8): 36: 3/8, 3/8. 37: −1/8, x = −4 is there, 0. (−8, 8): y alone, and −8 by 11 is
    # −1: a step a clock.
    pulses = [
        *[(19, (0, 1)), (21, (0, 1)), (23, (0, 1)), (24, (-1, 0)), (25, (0, 1)), (26, (-1, 0))],
        *[(28, (-1, 1)), (29, (-1, 0)), (32, (-1, 0)), (34, (-1, 0)), (35, (-1, -1))],
        *[(37, (-1, 0)), (38, (0, -1)), (39, (0, -1)), (40, (0, -1)), (41, (0, -1))],
    ]
    taken = seen.events[column(seen.events, "taken") == 1]
    rows = taken[:, [0, 5, 6, 7]].tolist()
    assert [(clock - 1, (x, y)) for clock, x, y, _ in rows] == pulses
    assert [last for *_, last in rows] == [0] * (len(pulses) - 1) + [1]
    assert turns[29:32].tolist() == [1, 1, 0]
    assert seen.events[-1, [0, 2]].tolist() == [43, 1]


@pytest.mark.parametrize("variant", [{}, LECTURE], ids=["default", "lecture"])
def test_the_path_is_the_same_however_long_a_step_waits(variant):
    blocks = draw_conics(4, 16, seed=6, turns=2)
    free, held = (
        PysimModel(Conic(4, **variant)).run(
            blocks, 20_000, until_answered=16, stalls=stalls, event_room=20_000
        )
        for stalls in (NO_STALLS, Stalls(7, stall=0.7))
    )
    fields = [EVENT_COLUMNS.index("taken") + k for k in (1, 2, 3)]
    moves = [run.events[column(run.events, "taken") == 1][:, fields] for run in (free, held)]
    assert np.array_equal(moves[0], moves[1])
    answers = [
        run.events[(column(run.events, "done") | column(run.events, "error")) != 0][:, 2:4]
        for run in (free, held)
    ]
    assert np.array_equal(answers[0], answers[1])
    assert held.ran > free.ran


def test_a_step_waits_unchanged_and_nothing_moves_meanwhile():
    watch = ("steps_valid", "steps_x", "steps_y", "steps_last", "position_x", "position_y")
    moving = ("p1", "p2", "p3", "p4", "gx", "gy", "sx", "sy", "turns", "backward_x", "backward_y")
    moving = tuple(f"reg_{name}" for name in moving)
    model = PysimModel(Conic(4), watch=(*watch, "busy", *moving, "reg_running"))
    stalls = Stalls(8, stall=0.6)
    blocks = draw_conics(4, 16, seed=7, turns=2)
    seen = model.run(blocks, 20_000, until_answered=16, stalls=stalls).watch
    ready = np.array([stalls.ready(clock) for clock in range(len(seen))])
    waits = (seen[:-1, 0] == 1) & ~ready[:-1]
    assert waits.sum() > 100
    # No block is accepted while one is there, so that nothing moves but in the last clock of one.
    assert np.array_equal(seen[:-1][waits], seen[1:][waits])
    steps = seen[:, 1:3]
    assert np.abs(steps).max() == 1
    assert np.array_equal(np.any(steps != 0, axis=1), seen[:, 0] == 1)
    assert seen[seen[:, 0] == 1, 6].all()
    # The position moves with a step that is taken; else only the start of a block sets it.
    taken = (seen[:-1, 0] == 1) & ready[:-1]
    moved = seen[1:, 4:6] - seen[:-1, 4:6]
    assert np.array_equal(moved[taken], steps[:-1][taken])
    running = seen[:-1, -1] == 1
    assert not moved[running & ~taken].any()


def test_rejected_and_empty_blocks_move_nothing_and_the_next_runs():
    still = [
        (1, 0, 1, -6, -4, 3, 2, 0, 0, 0, 1),  # from the centre, where both derivatives are 0
        (0, 0, 0, 0, 0, 3, 2, 0, 0, 0, 0),  # nothing at all
        (1, 0, 1, 0, 0, 3, 0, 0, 3, 0, 0),  # |Gx| + |Gy| = 6 where 8 are needed
        (1, 0, 1, 0, 0, 9, -9, 9, -9, 1, 0),  # empty
        (1, 0, 1, -18, 18, 9, -9, 9, -9, 1, 0),  # empty, with nothing to say of its direction
        (3, -5, 2, 7, 36, 0, 0, -4, -4, 1, 2),  # |Gx| + |Gy| = 43, too, but A… = 10 needs 40
    ]
    # |Gx| + |Gy| = 2^16, of which no bit may be lost; it has one step to go.
    steep = (255, 255, 255, 9053, 9053, 31, 31, 30, 31, 0, 0)
    codes = [SHARP, SHARP, SHARP, 0, 0, 0]
    assert [fault(block) for block in still] == codes
    assert [is_empty(block) for block in still] == [False, False, False, True, True, False]
    order = [QUARTER, *still[:2], BACK, still[3], still[2], steep, still[4], BACK]
    model = PysimModel(Conic(5), watch=("position_x", "position_y", "busy"))
    seen = model.run(np.array(order), 5000, until_answered=len(order), event_room=5000)
    answered = (column(seen.events, "done") | column(seen.events, "error")) != 0
    answers = seen.events[answered]
    assert column(answers, "error").tolist() == [fault(block) for block in order]
    assert column(answers, "done").tolist() == [int(not fault(block)) for block in order]
    position, clock = None, 0
    for block, answer in zip(order, answers[:, 0].tolist(), strict=True):
        steps = seen.events[(seen.events[:, 0] >= clock) & (seen.events[:, 0] < answer)]
        assert column(steps, "taken").any() == (block in (QUARTER, BACK, steep))
        # The end of a curve, the start of an empty block; a rejected one leaves it alone.
        position = position if fault(block) else block[7:9]
        assert tuple(seen.watch[answer][:2].tolist()) == position
        # Busy from the clock after its acceptance to the one before its answer.
        assert seen.watch[clock + 1 : answer, 2].all()
        assert not seen.watch[answer, 2]
        clock = answer


def ends_of(events):
    """Give where every block's last step leads to, from the first block's start on."""
    taken = events[column(events, "taken") == 1]
    return np.cumsum(taken[:, 5:7], axis=0)[taken[:, 7] == 1]


def test_blocks_of_several_pieces_behind_one_another():
    """Nothing of a block is left to the next: turns, backward, scale, half an increment."""
    blocks = [block for block in draw_conics(4, 14, seed=9).tolist() if not fault(block)]
    blocks = [block for block in blocks if not is_empty(block)]
    for order in (blocks, blocks[::-1]):
        runs = list(run_conics(order, width=4))
        limit = runs[-1].answered + 1
        seen = PysimModel(Conic(4)).run(np.array(order), limit, event_room=limit)
        taken = seen.events[column(seen.events, "taken") == 1]
        assert taken[:, 0].tolist() == [clock for run in runs for clock, _ in run.steps]
        moves = np.array(order)[:, 7:9] - np.array(order)[:, 5:7]
        assert np.diff(ends_of(seen.events), axis=0, prepend=[[0, 0]]).tolist() == moves.tolist()


@pytest.mark.parametrize("variant", [{"guard": 0}, LECTURE], ids=["default", "lecture"])
def test_whole_turned_ellipses_close_and_a_step_may_land_on_the_end(variant):
    blocks = [
        conics.ellipse(
            (10, -20), (14, 7), 30, 8, start_angle=first, end_angle=first, clockwise=clockwise
        ).block
        for first, clockwise in ((0, False), (50, True), (235, False))
    ]
    blocks.append(LANDS)
    seen = PysimModel(Conic(8, **variant)).run(
        np.array(blocks), 3000, until_answered=4, event_room=3000
    )
    assert column(seen.events, "done").sum() == seen.answered == 4
    moves = np.diff(ends_of(seen.events), axis=0, prepend=[[0, 0]])
    assert moves.tolist() == [[0, 0], [0, 0], [0, 0], [0, -2]]
    assert column(seen.events, "taken").sum() > 3 * 50


def test_a_block_with_wrong_turns_still_ends():
    """From beside its end, and from the end itself: answered once, and the next one runs."""
    wrong = [
        (1, 0, 1, 0, 0, 10, 5, 10, 5, 0, 1),
        (1, 0, 1, 0, 0, 10, 5, 10, 6, 0, 2),
        (1, 0, 1, 0, 0, 10, 5, 9, 6, 1, 6),
        (0, 0, 1, -8, 0, 0, 0, 2, 4, 1, 3),
        (0, 0, 0, 3, -7, -9, -9, 0, 0, 0, 1),
    ]
    order = [block for bad in wrong for block in (bad, QUARTER)]
    model = PysimModel(Conic(4), watch=("position_x", "position_y"))
    seen = model.run(np.array(order), 8000, until_answered=len(order), event_room=8000)
    answers = seen.events[column(seen.events, "done") == 1][:, 0]
    assert len(answers) == len(order)
    there = [seen.watch[min(clock, len(seen.watch) - 1)].tolist() for clock in answers.tolist()]
    assert there == [list(block[7:9]) for block in order]


def test_an_end_without_a_step():
    """A block whose last change of direction finds the end reached: ``done`` in the next clock."""
    # In the corner, from which nothing moves: it is turned round in its first clock pulse.
    corner = (0, 0, 0, 1, -1, 15, 15, 15, 15, 0, 1)
    (run,) = run_conics([corner], width=4)
    assert run.steps == []
    blocks = np.array([corner, QUARTER])
    seen = PysimModel(Conic(4)).run(blocks, 900, until_answered=2, event_room=900)
    # Started in clock 8, turned round in 9, done in 10, in which the next one is accepted.
    assert seen.events[:2, :5].tolist() == [[0, 1, 0, 0, 0], [10, 1, 1, 0, 0]]
    assert ends_of(seen.events).tolist() == [[-5, 5]]


@pytest.mark.parametrize("variant", [VARIANTS[0], LECTURE], ids=names)
def test_registers_hold_every_flip_flop(variant):
    core = Conic(4, **variant)
    assert sum(map(len, core.registers.values())) == Rtl(core).flip_flops
    assert list(core.registers) == [
        register.name for group in core.diagram.values() for register in group
    ]
    assert {name: len(register) for name, register in core.registers.items()} == {
        name: bits for name, (bits, _) in GoldenConic(4, **variant).registers().items()
    }


def test_a_block():
    """The fields, in the order in which Verilog users have them, and their bits at 16 bits."""
    layout = conic_block_layout(16)
    sizes = [20, 20, 20, 37, 37, 34, 34, 1, 11]
    assert list(layout.members) == [*"abcde", "start", "end", "clockwise", "turns"]
    assert [field.width for _, field in layout] == sizes
    model = PysimModel(Conic(16))
    assert model.block_fields == tuple(f"blocks_{name}" for name in FIELDS)
    model.run(np.empty((0, 11)), 1)  # an unused core is an error


def test_settings():
    assert ORDERS == ("implicit", "alternated", "simultaneous")
    assert Conic.LECTURE == LECTURE
    best = {"order": "implicit", "preload": "half", "guard": 2}
    for core, settings in ((Conic(), best), (Conic(16, **Conic.LECTURE), LECTURE)):
        PysimModel(core).run(np.empty((0, 11)), 1)  # an unused core is an error
        assert core.parameters == {"width": 16, **settings}


def test_refuses_width():
    for width in (3, 25):
        message = f"width is {width}: choose a whole number from 4 to 24"
        assert_refused((ValueError, message), Conic, width)
    message = "width must be a whole number from 4 to 24, not 8.0"
    assert_refused((TypeError, message), Conic, 8.0)


@pytest.mark.parametrize(("guard", "error", "message"), BAD_GUARDS)
def test_refuses_guard(guard, error, message):
    assert_refused((error, message), Conic, 8, guard=guard)


def test_refuses_other_choices():
    message = "order is 'lecture': choose 'implicit' or 'alternated' or 'simultaneous'"
    assert_refused((ValueError, message), Conic, 8, order="lecture")
    message = "preload is 'full': choose 'zero' or 'half'"
    assert_refused((ValueError, message), Conic, 8, preload="full")
