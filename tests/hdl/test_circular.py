"""The whole device: the contract, clock by clock, and equality to the golden model."""

from itertools import product

import numpy as np
import pytest

from discreta.hdl.circular import ORDERS, Circular
from discreta.sim.compiled import CompiledModel
from discreta.sim.golden.circular import Circular as GoldenCircular
from discreta.sim.interpreted import PysimModel
from discreta.sim.smt import Rtl
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS
from tests.arcs import OFF_CURVE, RANGE, draw_arcs, fault, is_empty, run_arcs
from tests.hdl.parts.clocked import BAD_GUARDS, BAD_WIDTHS, assert_refused
from tests.hdl.traces import golden_trace

VARIANTS = [
    {"order": order, "normalize": normalize, "preload": preload, "guard": guard}
    for order, normalize, preload, guard in product(
        ("alternated", "simultaneous"), (True, False), ("half", "zero"), (2, 0)
    )
]
LECTURE = {"order": "simultaneous", "normalize": False, "preload": "zero", "guard": 0}
STALLED = Stalls(1, stall=0.5, gap=0.3)


def names(variant):
    return "-".join(map(str, variant.values()))


def assert_equal(make_model, width, variant, blocks, stalls):
    """Compare every register at every clock, but those that no engine's record has room for."""
    golden = GoldenCircular(width, **variant)
    kinds = golden.registers()
    watched = [index for index, (bits, _) in enumerate(kinds.values()) if bits <= 64]
    watch = tuple(f"reg_{list(kinds)[index]}" for index in watched)
    model = make_model(Circular(width, **variant), watch=watch)
    expected, _ = golden_trace(golden, model.block_fields, blocks, 60_000, stalls, until_idle=True)
    seen = model.run(blocks, len(expected), stalls=stalls)
    assert (seen.fed, seen.answered) == (len(blocks), len(blocks))
    wrong = np.argwhere(seen.watch != expected[:, watched])
    assert [(clock, watch[column]) for clock, column in wrong[:5].tolist()] == []
    return dict(zip(watch, seen.watch.T, strict=True))


@pytest.mark.parametrize(
    ("variant", "stalls"),
    [(VARIANTS[0], NO_STALLS), (LECTURE, NO_STALLS), *((variant, STALLED) for variant in VARIANTS)],
    ids=lambda value: names(value) if isinstance(value, dict) else str(value),
)
def test_every_register_at_every_clock_in_pysim(variant, stalls):
    blocks = draw_arcs(4, 8, seed=2 + stalls.seed, radius=3, turns=1)
    seen = assert_equal(PysimModel, 4, variant, blocks, stalls)
    assert seen["reg_turns"].max() >= 4
    assert set(seen["reg_error"]) > {0}


@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize("stalls", [NO_STALLS, Stalls(2, stall=0.6, gap=0.9)], ids=str)
@pytest.mark.parametrize(
    ("width", "variant", "radius"), [(5, LECTURE, 12), (8, {}, 15), (32, {}, 7)]
)
def test_every_register_at_every_clock_compiled(width, variant, radius, stalls):
    blocks = draw_arcs(width, 10, seed=3, radius=radius, turns=1)
    if width == 32:
        # Far out, where every bit of a coordinate counts, and one piece of a large circle.
        blocks[0, :6] += 2**32 - 1 - blocks[0, :6].max()
        blocks[1] = [2**32 - 1, 1, 2**32 - 1, 40, 0, 0, 0, 0]
    assert_equal(CompiledModel, width, variant, blocks, stalls)


def column(events, name):
    return events[:, EVENT_COLUMNS.index(name)]


@pytest.mark.parametrize(
    ("width", "variant", "radius"),
    [
        (6, {}, 9),
        (5, {"preload": "zero", "guard": 1}, 5),
        (4, {"normalize": False, "guard": 0}, 4),
        (5, LECTURE, 6),
    ],
)
def test_clocks_of_blocks_and_between_them(width, variant, radius):
    """Every clock of acceptance, steps and answers, and every step, as the docstring tells them."""
    blocks = draw_arcs(width, 32, seed=5, radius=radius, turns=1)
    # A block of no length and a rejected one behind a block that moved, long prepared.
    blocks = np.concatenate([blocks[[3, 6, 3, 7, 2]], blocks])
    runs = list(run_arcs(blocks.tolist(), width=width, **variant))
    limit = runs[-1].answered + 1
    model = PysimModel(Circular(width, **variant))
    seen = model.run(blocks, limit, event_room=limit)
    clocks = column(seen.events, "clock")
    accepted = clocks[column(seen.events, "accepted") == 1]
    assert accepted.tolist() == [run.accepted for run in runs]
    done, error = column(seen.events, "done"), column(seen.events, "error")
    answers = [(run.answered, int(not run.code), run.code) for run in runs]
    assert np.stack([clocks, done, error], axis=1)[(done | error) != 0].tolist() == [
        list(answer) for answer in answers
    ]
    taken = column(seen.events, "taken") == 1
    wanted = []
    for run, block in zip(runs, blocks.tolist(), strict=True):
        path = [tuple(block[:2]), *(point for _, point in run.steps)]
        for k, (clock, (x, y)) in enumerate(run.steps):
            last = int(k == len(run.steps) - 1)
            wanted.append([clock, x - path[k][0], y - path[k][1], last])
    steps = np.column_stack([clocks, seen.events[:, len(EVENT_COLUMNS) :]])
    assert steps[taken].tolist() == wanted
    # Some were started in the very clock in which a last step was taken, some one clock later.
    free = [run.answered - bool(run.steps) for run in runs]
    gaps = [run.started - before for run, before in zip(runs[1:], free, strict=False)]
    late = [run.started - run.accepted - 2 * width - 5 for run in runs[1:]]
    assert {gap for gap, wait in zip(gaps, late, strict=True) if wait > 0} == {0, 1}


def test_clocks_of_a_quarter_by_hand():
    """(2, 0) to (0, 2) in the lecture's machine of 4 bits, where M = 16."""
    seen = PysimModel(Circular(4, **Circular.LECTURE)).run(
        np.array([[2, 0, 0, 2, 0, 0, 0, 0]]), 60, event_room=60
    )
    taken = seen.events[column(seen.events, "taken") == 1]
    # Started in clock 13, first summation in 14. SY = 8·2 carries in the 8th, in clock 21, and its
    # step leaves in 22. Now Y is 1 and SX grows too; SY carries again 8 later, when SX is 8. Y is 2
    # and at its end: SX carries 4 later and, from 0, another 8 later.
    assert taken[:, [0, 5, 6, 7]].tolist() == [
        [22, 0, 1, 0],
        [30, 0, 1, 0],
        [34, -1, 0, 0],
        [42, -1, 0, 1],
    ]


@pytest.mark.parametrize("variant", [{}, LECTURE], ids=["default", "lecture"])
def test_the_path_is_the_same_however_long_a_step_waits(variant):
    blocks = draw_arcs(5, 10, seed=6, radius=5, turns=1)
    free, held = (
        PysimModel(Circular(5, **variant)).run(
            blocks, 20_000, until_answered=10, stalls=stalls, event_room=20_000
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
    moving = ("p1", "p2", "p3", "p4", "sx", "sy", "turns", "swap", "backward")
    moving = tuple(f"reg_{name}" for name in moving)
    model = PysimModel(Circular(5), watch=(*watch, *moving, "reg_running"))
    stalls = Stalls(8, stall=0.6)
    blocks = draw_arcs(5, 12, seed=7, radius=5, turns=1)
    seen = model.run(blocks, 20_000, until_answered=12, stalls=stalls).watch
    ready = np.array([stalls.ready(clock) for clock in range(len(seen))])
    waits = (seen[:-1, 0] == 1) & ~ready[:-1]
    assert waits.sum() > 100
    running = seen[:-1, -1] == 1
    assert np.array_equal(seen[:-1][waits][:, :6], seen[1:][waits][:, :6])
    assert np.array_equal(seen[:-1][waits & running], seen[1:][waits & running])
    steps = seen[:, 1:3]
    assert np.abs(steps).max() == 1
    assert np.array_equal(np.any(steps != 0, axis=1), seen[:, 0] == 1)
    # The position moves with a step that is taken; else only the start of a block sets it.
    taken = (seen[:-1, 0] == 1) & ready[:-1]
    moved = seen[1:, 4:6] - seen[:-1, 4:6]
    goes_on = running | (seen[1:, -1] == 0)
    assert np.array_equal(moved[goes_on & taken], steps[:-1][goes_on & taken])
    assert not moved[running & ~taken].any()


def test_rejected_and_empty_blocks_move_nothing_and_the_next_runs():
    arc, back = (5, 0, 0, 5, 0, 0, 0, 0), (0, 5, 5, 0, 0, 0, 1, 0)
    still = [
        (0, 5, 31, -28, 0, 0, 0, 0),  # off the circle
        (0, 0, 3, 4, 0, 0, 0, 2),  # from the centre
        (-9, 9, -9, 9, -9, 9, 1, 3),  # of no length
        (-32, 0, 31, 0, 31, 0, 0, 0),  # too far from the centre
        (31, 0, -31, 0, 0, 0, 0, 0),  # over an axis, where the limit is 32
        (20, 9, 20, 9, 26, 9, 0, 0),  # leads out of the coordinates
    ]
    codes = [fault(block, 5) for block in still]
    assert codes == [OFF_CURVE, OFF_CURVE, 0, RANGE, RANGE, RANGE]
    assert [is_empty(block) for block in still] == [code == 0 for code in codes]
    order = [arc, still[0], back, still[1], still[2], arc, *still[3:], back]
    model = PysimModel(Circular(5), watch=("position_x", "position_y"))
    seen = model.run(np.array(order), 5000, until_answered=len(order), event_room=5000)
    answered = (column(seen.events, "done") | column(seen.events, "error")) != 0
    answers = seen.events[answered]
    assert column(answers, "error").tolist() == [fault(block, 5) for block in order]
    assert column(answers, "done").tolist() == [int(not fault(block, 5)) for block in order]
    position, clock = None, 0
    for block, answer in zip(order, answers[:, 0].tolist(), strict=True):
        there = tuple(seen.watch[min(answer, len(seen.watch) - 1)].tolist())
        steps = seen.events[(seen.events[:, 0] >= clock) & (seen.events[:, 0] < answer)]
        moves = column(steps, "taken").any()
        assert moves == (block in (arc, back))
        # The end of an arc, the start of a block of no length; a rejected one leaves it alone.
        position = position if fault(block, 5) else block[2:4]
        assert there == position
        clock = answer


def test_arcs_of_several_pieces_behind_one_another():
    """Nothing of a block is left to the next: turns, backward, the turned frame."""
    # Ends backward; a quarter; two turns and more; ends short of Y; the other way round.
    blocks = [
        (-8, 5, -10, -1, 0, 0, 0, 0),
        (-10, 0, 0, -10, 0, 0, 0, 0),
        (0, -10, -8, 6, 0, 0, 0, 2),
        (-12, 14, 19, 0, 0, 0, 0, 0),
        (19, 0, -12, 14, 0, 0, 1, 0),
        (-12, 14, -12, 14, -12, 13, 1, 1),
    ]
    for order in (blocks, blocks[::-1]):
        runs = list(run_arcs(order, width=6))
        limit = runs[-1].answered + 1
        seen = PysimModel(Circular(6)).run(np.array(order), limit, event_room=limit)
        taken = seen.events[column(seen.events, "taken") == 1]
        assert taken[:, 0].tolist() == [clock for run in runs for clock, _ in run.steps]
        ends = np.cumsum(taken[:, 5:7], axis=0)[taken[:, 7] == 1]
        moves = np.array(order)[:, 2:4] - np.array(order)[:, :2]
        assert np.diff(ends, axis=0, prepend=[[0, 0]]).tolist() == moves.tolist()


@pytest.mark.parametrize("variant", [VARIANTS[0], VARIANTS[5], LECTURE], ids=names)
def test_registers_hold_every_flip_flop(variant):
    core = Circular(4, **variant)
    assert sum(map(len, core.registers.values())) == Rtl(core).flip_flops
    assert list(core.registers) == [
        register.name for group in core.diagram.values() for register in group
    ]
    assert {name: len(register) for name, register in core.registers.items()} == {
        name: bits for name, (bits, _) in GoldenCircular(4, **variant).registers().items()
    }


def test_settings():
    assert ORDERS == ("alternated", "simultaneous")
    assert Circular.LECTURE == LECTURE
    best = {"order": "alternated", "normalize": True, "preload": "half", "guard": 2}
    for core, settings in ((Circular(), best), (Circular(16, **Circular.LECTURE), LECTURE)):
        PysimModel(core).run(np.empty((0, 8)), 1)  # an unused core is an error
        assert core.parameters == {"width": 16, **settings}


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), Circular, width)


@pytest.mark.parametrize(("guard", "error", "message"), BAD_GUARDS)
def test_refuses_guard(guard, error, message):
    assert_refused((error, message), Circular, 8, guard=guard)


def test_refuses_other_choices():
    message = "order is 'lecture': choose 'alternated' or 'simultaneous'"
    assert_refused((ValueError, message), Circular, 8, order="lecture")
    message = "preload is 'full': choose 'zero' or 'half'"
    assert_refused((ValueError, message), Circular, 8, preload="full")
    message = "normalize must be True or False, not 0"
    assert_refused((TypeError, message), Circular, 8, normalize=0)
