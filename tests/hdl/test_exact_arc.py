"""The exact interpolator of arcs: the contract, clock by clock, and equality to its model."""

import numpy as np
import pytest
from amaranth import Module, ResetInserter, Signal
from amaranth.sim import Simulator

from discreta.hdl.exact_arc import ExactArc
from discreta.sim.compiled import CompiledModel
from discreta.sim.golden.exact_arc import ExactArc as GoldenExactArc
from discreta.sim.interpreted import PysimModel
from discreta.sim.smt import Rtl
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS
from tests.arcs import OFF_CURVE, RANGE, draw_arcs
from tests.exact_arcs import exact_steps
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused
from tests.hdl.traces import golden_trace

STALLED = Stalls(1, stall=0.5, gap=0.3)

#: Radius 1 and less than 2, ends inside and outside, an end behind, the centre as a start and all.
SMALL = [
    *((1, 0, 0, 1, 0, 0, 0, 0), (1, 0, 1, 0, 0, 0, 0, 1), (0, -1, 0, -1, 0, 0, 1, 0)),
    *((1, 0, 0, 2, 0, 0, 0, 0), (1, 0, 0, 0, 0, 0, 0, 0), (1, 1, 1, 1, 0, 0, 1, 0)),
    *((1, 1, -1, 2, 0, 0, 0, 0), (5, 0, 1, 7, 0, 0, 0, 0), (0, 0, 0, 0, 0, 0, 0, 3)),
    *((0, 0, 1, 0, 0, 0, 0, 0), (2, 0, 2, 0, 0, 0, 0, 0), (3, 0, 4, 1, 0, 0, 1, 0)),
    *((-16, 0, 15, 0, 15, 0, 0, 0), (15, 9, 15, 9, 15, -7, 0, 0)),
]


def assert_equal(make_model, width, blocks, stalls):
    """Compare every register at every clock."""
    golden = GoldenExactArc(width)
    watch = tuple(f"reg_{name}" for name in golden.registers())
    model = make_model(ExactArc(width), watch=watch)
    expected, _ = golden_trace(golden, model.block_fields, blocks, 60_000, stalls, until_idle=True)
    seen = model.run(blocks, len(expected), stalls=stalls)
    assert (seen.fed, seen.answered) == (len(blocks), len(blocks))
    wrong = np.argwhere(seen.watch != expected)
    assert [(clock, watch[column]) for clock, column in wrong[:5].tolist()] == []
    return dict(zip(watch, seen.watch.T, strict=True))


@pytest.mark.parametrize("stalls", [NO_STALLS, STALLED], ids=str)
def test_every_register_at_every_clock_in_pysim(stalls):
    blocks = np.concatenate([draw_arcs(4, 24, seed=2 + stalls.seed, radius=9, turns=1), SMALL])
    seen = assert_equal(PysimModel, 4, blocks, stalls)
    assert seen["reg_turns"].max() >= 4
    assert set(seen["reg_mode"]) == {0, 1, 2, 3}
    assert set(seen["reg_error"]) == {0, RANGE, OFF_CURVE}
    assert seen["reg_lost"].any()


@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize("stalls", [NO_STALLS, Stalls(2, stall=0.6, gap=0.9)], ids=str)
@pytest.mark.parametrize(("width", "radius"), [(5, 20), (8, 90), (16, 150), (32, 150)])
def test_every_register_at_every_clock_compiled(width, radius, stalls):
    blocks = draw_arcs(width, 16, seed=3, radius=radius, turns=1)
    if width == 32:
        # Far out, where every bit of a coordinate counts, and a piece of a large circle.
        blocks[0, :6] += 2**32 - 1 - blocks[0, :6].max()
        blocks[1] = [2**32 - 1, 1, 2**32 - 1, 40, 0, 0, 0, 0]
    assert_equal(CompiledModel, width, blocks, stalls)


def column(events, name):
    return events[:, EVENT_COLUMNS.index(name)]


def run(width, blocks, stalls=NO_STALLS):
    blocks = np.array(blocks, dtype=np.int64)
    model = PysimModel(ExactArc(width))
    return model.run(
        blocks, 40_000, until_answered=len(blocks), event_room=40_000, stalls=stalls
    ).events


def test_clocks_of_a_quarter_by_hand():
    """(2, 0) to (0, 2): the end is a king's move away from (1, 2), where X leads already."""
    events = run(4, [[2, 0, 0, 2, 0, 0, 0, 0]])
    taken = events[column(events, "taken") == 1]
    # Accepted in clock 0, prepared in 1 to 4, loaded in 5. Y − X + 2 is 0 at once, so the step in
    # clock 7 is prepared in 6 and leaves in 8; the next is the last one.
    assert taken[:, [0, 5, 6, 7]].tolist() == [[8, 0, 1, 0], [9, -1, 1, 0], [10, -1, 0, 1]]
    assert events[column(events, "done") == 1][:, 0].tolist() == [11]


@pytest.mark.parametrize(("width", "radius"), [(4, 7), (6, 30)])
def test_every_step_and_its_clock(width, radius):
    """One clock a step, one where octant or quadrant change, one between blocks."""
    blocks = draw_arcs(width, 40, seed=5, radius=radius, turns=1).tolist()
    blocks = [b for k, b in enumerate(blocks) if k % 8 not in (6, 7)]
    events = run(width, blocks)
    accepted = events[column(events, "accepted") == 1][:, 0].tolist()
    taken = events[column(events, "taken") == 1]
    wanted, free = [], 0
    for block, when in zip(blocks, accepted, strict=True):
        # The clock of loading: the last step before leaves in it.
        loads = max(when + 5, free)
        point = block[:2]
        steps = exact_steps(block)
        for number, (clock, to) in enumerate(steps):
            last = int(number == len(steps) - 1)
            wanted.append([loads + 2 + clock, to[0] - point[0], to[1] - point[1], last])
            point = to
        free = wanted[-1][0]
        assert tuple(point) == tuple(block[2:4])
    assert taken[:, [0, 5, 6, 7]].tolist() == wanted
    done = events[column(events, "done") == 1][:, 0].tolist()
    assert done == [clock + 1 for clock, *_, last in wanted if last]


def test_one_clock_between_blocks_of_a_step():
    blocks = [(k, 9, k + 1, 9, k, -30, 1, 0) for k in range(12)]
    events = run(6, blocks)
    taken = events[column(events, "taken") == 1]
    assert np.diff(taken[:, 0]).tolist() == [2] * 11
    assert taken[:, 5:8].tolist() == [[1, 0, 1]] * 12
    accepted = events[column(events, "accepted") == 1][:, 0]
    assert np.diff(accepted)[2:].tolist() == [2] * 9


def test_the_path_is_the_same_however_long_a_step_waits():
    blocks = np.concatenate([draw_arcs(5, 16, seed=6, radius=12, turns=1), SMALL])
    free, held = (run(5, blocks, stalls) for stalls in (NO_STALLS, Stalls(7, stall=0.7)))
    moves = [events[column(events, "taken") == 1][:, 5:8] for events in (free, held)]
    assert np.array_equal(moves[0], moves[1])
    answers = [
        events[(column(events, "done") | column(events, "error")) != 0][:, 2:4]
        for events in (free, held)
    ]
    assert np.array_equal(answers[0], answers[1])
    assert held[-1, 0] > free[-1, 0]


def test_a_step_waits_unchanged_and_nothing_moves_meanwhile():
    watch = ("steps_valid", "steps_x", "steps_y", "steps_last", "position_x", "position_y")
    moving = tuple(f"reg_{name}" for name in ("f", "axial", "diagonal", "mode", "turns", "near"))
    model = PysimModel(ExactArc(5), watch=(*watch, *moving))
    stalls = Stalls(8, stall=0.6)
    blocks = draw_arcs(5, 16, seed=7, radius=12, turns=1)
    seen = model.run(blocks, 20_000, until_answered=16, stalls=stalls).watch
    ready = np.array([stalls.ready(clock) for clock in range(len(seen))])
    waits = (seen[:-1, 0] == 1) & ~ready[:-1]
    assert waits.sum() > 100
    assert np.array_equal(seen[:-1][waits], seen[1:][waits])
    assert np.array_equal(np.any(seen[:, 1:3] != 0, axis=1), seen[:, 0] == 1)


def test_a_missed_end_is_told_late_and_the_position_is_exact():
    arc, back = (5, 0, 0, 5, 0, 0, 0, 0), (0, 5, 5, 0, 0, 0, 1, 0)
    missed = [
        (9, 0, 1, 7, 0, 0, 0, 0),  # inside: X comes to 0
        (9, 0, 7, 9, 0, 0, 0, 0),  # outside
        (0, 9, -9, 9, 0, 0, 0, 0),  # in the next octant
        (9, 0, 0, 0, 0, 0, 1, 1),  # the centre
    ]
    still = [(0, 0, 3, 4, 0, 0, 0, 2), (-9, 9, -9, 9, -9, 9, 1, 3), (-32, 0, 31, 0, 31, 0, 0, 0)]
    order = [arc, missed[0], back, missed[1], arc, *still, missed[2], back, missed[3], arc]
    model = PysimModel(ExactArc(5), watch=("position_x", "position_y"))
    seen = model.run(np.array(order), 5000, until_answered=len(order), event_room=5000)
    events = seen.events
    answers = events[(column(events, "done") | column(events, "error")) != 0]
    codes = [OFF_CURVE if b in (*missed, still[0]) else RANGE * (b == still[2]) for b in order]
    assert column(answers, "error").tolist() == codes
    assert column(answers, "done").tolist() == [int(code == 0) for code in codes]
    clock = 0
    for block, answer in zip(order, answers[:, 0].tolist(), strict=True):
        inside = (events[:, 0] >= clock) & (events[:, 0] < answer)
        steps = events[inside & (column(events, "taken") == 1)]
        assert len(steps) == 0 if block in still else len(steps) > 0
        assert steps[:, 7].sum() == (block in (arc, back))
        if block in missed:
            place = np.array(block[:2]) + steps[:, 5:7].sum(axis=0)
            assert seen.watch[answer].tolist() == place.tolist()
            radius = np.hypot(block[0], block[1])
            assert abs(np.hypot(*place) - radius) < 0.5
        clock = answer


def test_a_device_that_stops_leaves_nothing_of_an_arc():
    """The device resets its interpolators by an inserted reset, not by that of the domain."""
    core, clear, m = ExactArc(5), Signal(), Module()
    m.submodules.core = ResetInserter(clear)(core)
    seen = []

    async def bench(ctx):
        block = core.blocks.payload
        ctx.set(block, {"start": {"x": 15, "y": 0}, "end": {"x": 0, "y": 15}})
        ctx.set(core.blocks.valid, 1)
        ctx.set(core.steps.ready, 1)
        for clock in range(24):
            if clock % 12 == 11:
                seen.append({name: ctx.get(it) for name, it in core.registers.items()})
                ctx.set(clear, 1)
                ctx.set(core.blocks.valid, 0)
            await ctx.tick()
        seen.append({name: ctx.get(it) for name, it in core.registers.items()})

    simulator = Simulator(m)
    simulator.add_clock(1e-8)
    simulator.add_testbench(bench)
    simulator.run()
    reset = GoldenExactArc(5).reset()
    assert seen[0]["running"] == 1
    assert min(abs(seen[0][name] - reset[name]) for name in ("f", "axial", "diagonal")) > 0
    assert seen[-1] == reset


def test_registers_hold_every_flip_flop():
    core = ExactArc(4)
    assert sum(map(len, core.registers.values())) == Rtl(core).flip_flops
    assert list(core.registers) == [
        register.name for group in core.diagram.values() for register in group
    ]
    assert {name: len(register) for name, register in core.registers.items()} == {
        name: bits for name, (bits, _) in GoldenExactArc(4).registers().items()
    }


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), ExactArc, width)


def test_refuses_other_axes():
    message = "number of axes is 3: an arc lies in a plane, choose 2"
    assert_refused((ValueError, message), ExactArc, 8, axes=3)
