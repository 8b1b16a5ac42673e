"""The whole device: the contract, clock by clock, and equality to the golden model."""

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import floor

import numpy as np
import pytest

from discreta.hdl.carrier_linear import MAX_WIDTH, CarrierLinear
from discreta.sim.compiled import CompiledModel
from discreta.sim.golden.carrier_linear import CarrierLinear as GoldenCarrierLinear
from discreta.sim.interpreted import PysimModel
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS
from tests.hdl.parts.clocked import assert_refused
from tests.hdl.traces import golden_trace

LECTURE = {"preload": "zero"}
STALLS = [NO_STALLS, Stalls(1, stall=0.5, gap=0.3), Stalls(2, stall=0.9), Stalls(3, gap=0.95)]
BAD_WIDTHS = [
    (3, ValueError, "width is 3: choose a whole number from 4 to 24"),
    (25, ValueError, "width is 25: choose a whole number from 4 to 24"),
    (8.0, TypeError, "width must be a whole number from 4 to 24, not 8.0"),
    ("8", TypeError, "width must be a whole number from 4 to 24, not '8'"),
    (True, TypeError, "width must be a whole number from 4 to 24, not True"),
]


def timed_blocks(width, count, seed, *, periods=6, period=9):
    """Blocks of all kinds and signs: too long, of no length, and with a timing that is refused."""
    random = np.random.default_rng([seed, width])
    low, top = -(2**width), 2**width - 1
    span = 2 ** random.integers(0, width + 1, (count, 1))
    starts = random.integers(low, top, (count, 2), endpoint=True)
    moves = random.integers(-span, span, (count, 2), endpoint=True)
    ends = np.clip(starts + moves, low, top)
    ends[::5] = starts[::5]
    starts[1], ends[1] = low, top
    # A line on one axis, and the longest there is.
    ends[2] = starts[2] + np.array([0, -1 if starts[2, 1] > 0 else 1])
    starts[3], ends[3] = (0, low + 1), (top, 0)
    timing = np.stack(
        [
            random.integers(1, periods, count, endpoint=True),
            random.integers(2, period, count, endpoint=True),
        ],
        axis=1,
    )
    timing[6::11, 0] = 0
    timing[8::11, 1] = random.integers(2, size=len(timing[8::11]))
    return np.concatenate([starts, ends, timing], axis=1)


def is_refused(block, width):
    """Tell whether a block is answered by an error."""
    xh, yh, xk, yk, periods, period = block
    return max(abs(xk - xh), abs(yk - yh)) >= 2**width or periods < 1 or period < 2


def periods_of(block, *, width, preload):
    """Give the increments of every period, by exact fractions of the docstring's formula."""
    xh, yh, xk, yk, periods, _ = block
    initial = Fraction({"zero": 0, "half": 1}[preload], 2)
    lengths = abs(xk - xh), abs(yk - yh)
    signs = 1 if xk >= xh else -1, 1 if yk >= yh else -1
    one = 2 ** (width + 12)
    means = [Fraction(length * one // periods, one) for length in lengths]
    before = 0, 0
    increments = []
    for i in range(1, periods + 1):
        out = tuple(floor(initial + i * mean) for mean in means)
        if i == periods:
            out = lengths
        increments.append([(out[k] - before[k]) * signs[k] for k in (0, 1)])
        before = out
        if out == lengths:
            break
    return increments


@dataclass(frozen=True)
class Run:
    """What becomes of a block, when nothing has to wait and blocks are offered all the time."""

    accepted: int
    started: int
    answered: int
    code: int
    taken: list[int]
    increments: list[list[int]]


def run_lines(blocks, *, width, preload="half"):
    """Yield what becomes of blocks, one behind the other, from reset, as the docstring tells it."""
    accepted = free = due = 0
    moved = False
    for block in blocks:
        code = int(is_refused(block, width))
        still = code != 0 or block[:2] == block[2:4]
        started = max(accepted + 2 * width + 14, free + (still and moved))
        idle = not moved or started != free
        taken, increments = [], []
        if still:
            answered = started + 1
            free = started + 1
        else:
            increments = periods_of(block, width=width, preload=preload)
            first = max(started + 2, due)
            taken = [first + i * block[5] for i in range(len(increments))]
            answered, free = taken[-1] + 1, taken[-1]
            due = taken[-1] + block[5]
        yield Run(accepted, started, answered, code, taken, increments)
        # The next one comes in the clock in which this one leaves, if nothing waits then.
        accepted, moved = started + (not idle), not still


def watched(golden):
    return tuple(f"reg_{name}" for name in golden.registers())


def assert_equal(make_model, device, golden, blocks, stalls):
    """Compare every register at every clock, until all blocks are answered."""
    watch = watched(golden)
    model = make_model(device, watch=watch)
    expected, _ = golden_trace(golden, model.block_fields, blocks, 60_000, stalls, until_idle=True)
    seen = model.run(blocks, len(expected), stalls=stalls)
    assert (seen.fed, seen.answered) == (len(blocks), len(blocks))
    wrong = np.argwhere(seen.watch != expected)
    assert [(clock, watch[column]) for clock, column in wrong[:5].tolist()] == []
    return dict(zip(watch, seen.watch.T, strict=True))


def column(events, name):
    return events[:, EVENT_COLUMNS.index(name)]


def answers_of(events):
    """Give (clock, done, error) of all answers."""
    answered = (column(events, "done") | column(events, "error")) != 0
    return np.stack([column(events, name) for name in ("clock", "done", "error")], axis=1)[answered]


def taken_of(events):
    """Give (clock, x, y, last) of all increments taken."""
    fields = [0, *range(len(EVENT_COLUMNS), len(EVENT_COLUMNS) + 3)]
    return events[column(events, "taken") == 1][:, fields]


@pytest.mark.parametrize("stalls", STALLS, ids=str)
@pytest.mark.parametrize("preload", ["half", "zero"])
def test_every_register_at_every_clock_in_pysim(preload, stalls):
    blocks = timed_blocks(4, 14, seed=1)
    seen = assert_equal(
        PysimModel,
        CarrierLinear(4, preload=preload),
        GoldenCarrierLinear(4, preload),
        blocks,
        stalls,
    )
    assert set(seen["reg_error"]) == {0, 1}
    assert seen["reg_out_x"].min() < 0 < seen["reg_out_x"].max()


@pytest.mark.usefixtures("compiled_engine")
def test_every_register_at_every_clock_compiled():
    # Those of 8 bits are seen before a second stage, in test_two_stage.py.
    width, preload = 16, "zero"
    golden, device = GoldenCarrierLinear(width, preload), CarrierLinear(width, preload=preload)
    blocks = timed_blocks(width, 14, seed=2, periods=20, period=9)
    # At last the most periods there are, of which some are seen.
    blocks[-1, 4:] = [2 ** (width + 8) - 1, 2]
    watch = watched(golden)
    model = CompiledModel(device, watch=watch)
    for stalls in (NO_STALLS, Stalls(1, stall=0.6, gap=0.9)):
        model.reset()
        expected, _ = golden_trace(golden, model.block_fields, blocks, 2000, stalls)
        seen = model.run(blocks, len(expected), stalls=stalls)
        assert seen.fed == len(blocks)
        wrong = np.argwhere(seen.watch != expected)
        assert [(clock, watch[place]) for clock, place in wrong[:5].tolist()] == []


@pytest.mark.parametrize("preload", ["half", "zero"])
@pytest.mark.parametrize("width", [4, 6])
def test_clocks_of_blocks_and_between_them(width, preload):
    """Every clock of acceptance, increments and answers, and every increment, by the docstring."""
    blocks = timed_blocks(width, 24, seed=3, periods=25, period=5)
    # Blocks behind one another with periods of all lengths, then long ones, with refused ones and
    # such of no length prepared long before the block in front of them ends.
    rows = [[0, 0, 9, -4, 40, 2], [9, -4, 0, 0, 15, 7], [0, 0, 0, 0, 1, 2], [1, 1, 1, 9, 30, 3]]
    rows += [[1, 1, 2, 2, 0, 2], [2, 2, 15, 15, 1, 60], [15, 15, 3, 3, 1, 2], *blocks.tolist()]
    rows += [[3, 3, 4, -4, 20, 2]] * 3
    runs = list(run_lines(rows, width=width, preload=preload))
    limit = runs[-1].answered + 1
    model = PysimModel(CarrierLinear(width, preload=preload))
    seen = model.run(np.array(rows), limit, event_room=limit)
    clocks = column(seen.events, "clock")
    assert clocks[column(seen.events, "accepted") == 1].tolist() == [run.accepted for run in runs]
    answers = [[run.answered, int(not run.code), run.code] for run in runs]
    assert answers_of(seen.events).tolist() == answers
    wanted = [
        [clock, *increment, int(index == len(run.taken) - 1)]
        for run in runs
        for index, (clock, increment) in enumerate(zip(run.taken, run.increments, strict=True))
    ]
    assert taken_of(seen.events).tolist() == wanted
    # No clock is lost between the first two blocks, nor behind the block of no length.
    assert runs[1].taken[0] == runs[0].taken[-1] + 2
    assert np.all(np.diff(runs[1].taken) == 7)
    assert runs[0].taken[0] == 2 * width + 16
    moving = [run for run in runs if run.taken]
    gaps = [b.taken[0] - a.taken[-1] for a, b in pairwise(moving)]
    assert gaps[-2:] == [2, 2]


def test_the_period_before_is_kept_behind_it():
    """The first increments come when the block before's period is over, not when they could."""
    rows = [[0, 0, 3, 2, 1, 90], [3, 2, 0, 0, 2, 4], [0, 0, 1, 1, 1, 2]]
    seen = PysimModel(CarrierLinear(4)).run(np.array(rows), 300, until_answered=3, event_room=300)
    # Waiting from 2n + 16 = 24; the second line's a period of 90 later; the third's one of 4.
    assert taken_of(seen.events).tolist() == [
        [24, 3, 2, 1],
        [114, -2, -1, 0],
        [118, -1, -1, 1],
        [122, 1, 1, 1],
    ]


def test_increments_of_a_line_by_hand():
    """From (0, 0) to (7, −2) in 4 periods: 7/4 and 1/2 a period."""
    row = [0, 0, 7, -2, 4, 3]
    wanted = {
        # ⌊7i/4⌋ = 1, 3, 5, 7; ⌊i/2⌋ = 0, 1, 1, 2.
        "zero": [[1, 0], [2, -1], [2, 0], [2, -1]],
        # ⌊(7i + 2)/4⌋ = 2, 4, 5, 7; ⌊(i + 1)/2⌋ = 1, 1, 2, 2.
        "half": [[2, -1], [2, 0], [1, -1], [2, 0]],
    }
    for preload, increments in wanted.items():
        model = PysimModel(CarrierLinear(4, preload=preload))
        seen = model.run(np.array([row]), 60, until_answered=1, event_room=60)
        taken = taken_of(seen.events)
        assert taken[:, 1:3].tolist() == increments
        assert taken[:, 0].tolist() == [24, 27, 30, 33]
        assert taken[:, 3].tolist() == [0, 0, 0, 1]
        assert answers_of(seen.events).tolist() == [[34, 1, 0]]


def test_a_block_may_end_before_its_last_period():
    """1/10 of a step a period with preload ½: the step is put out in the 6th, and is the last."""
    seen = PysimModel(CarrierLinear(4)).run(
        np.array([[0, 0, 1, 0, 10, 2]]), 80, until_answered=1, event_room=80
    )
    taken = taken_of(seen.events)
    # 10 times the mean of 16 bits is less than 1, so that 5 times it and ½ is too.
    assert taken[:, 1].tolist() == [0, 0, 0, 0, 0, 1]
    assert taken[:, 3].tolist() == [0, 0, 0, 0, 0, 1]
    assert answers_of(seen.events).tolist() == [[24 + 5 * 2 + 1, 1, 0]]


@pytest.mark.parametrize("preload", ["half", "zero"])
def test_the_path_is_the_same_however_long_increments_wait(preload):
    blocks = timed_blocks(5, 12, seed=4)
    free, held = (
        PysimModel(CarrierLinear(5, preload=preload)).run(
            blocks, 5000, until_answered=12, stalls=stalls, event_room=5000
        )
        for stalls in (NO_STALLS, Stalls(7, stall=0.8))
    )
    assert np.array_equal(taken_of(free.events)[:, 1:], taken_of(held.events)[:, 1:])
    assert np.array_equal(answers_of(free.events)[:, 1:], answers_of(held.events)[:, 1:])
    assert held.ran > free.ran


def test_increments_wait_unchanged_and_nothing_moves_meanwhile():
    watch = ("steps_valid", "steps_x", "steps_y", "steps_last", "position_x", "position_y")
    moving = ("p1", "p2", "p5", "p6", "sx", "sy", "periods", "period", "timer", "running")
    model = PysimModel(CarrierLinear(5), watch=(*watch, *(f"reg_{name}" for name in moving)))
    stalls = Stalls(8, stall=0.7)
    blocks = timed_blocks(5, 14, seed=5)
    seen = model.run(blocks, 5000, until_answered=14, stalls=stalls).watch
    ready = np.array([stalls.ready(clock) for clock in range(len(seen))])
    waits = (seen[:-1, 0] == 1) & ~ready[:-1]
    assert waits.sum() > 50
    assert np.array_equal(seen[:-1][waits], seen[1:][waits])
    # The position moves with what is taken; else only the start of a block sets it.
    taken = (seen[:-1, 0] == 1) & ready[:-1]
    running = seen[:, -1] == 1
    moved = seen[1:, 4:6] - seen[:-1, 4:6]
    goes_on = running[:-1] | ~running[1:]
    assert np.array_equal(moved[goes_on & taken], seen[:-1, 1:3][goes_on & taken])
    assert not moved[running[:-1] & ~taken].any()


def test_refused_and_empty_blocks_move_nothing_and_the_next_runs():
    line = [3, -3, 9, 4, 3, 4]
    still = [
        [-16, 0, 15, 0, 4, 4],  # too long in x
        [3, -16, 3, 0, 4, 4],  # too long in y, by a step
        [3, 3, 4, 4, 0, 4],  # no periods
        [3, 3, 4, 4, 5, 1],  # a period of one clock
        [3, 3, 4, 4, 5, 0],  # of none
        [-16, 15, -16, 15, 5, 4],  # of no length
        [-16, 15, -16, 15, 0, 4],  # of no length and refused
    ]
    order = [line]
    for row in still:
        order += [row, row, line]
    model = PysimModel(CarrierLinear(4), watch=("position_x", "position_y"))
    seen = model.run(np.array(order), 3000, until_answered=len(order), event_room=3000)
    codes = [int(is_refused(row, 4)) for row in order]
    assert codes[1::3] == [1, 1, 1, 1, 1, 0, 1]
    assert answers_of(seen.events)[:, 2].tolist() == codes
    assert answers_of(seen.events)[:, 1].tolist() == [1 - code for code in codes]
    taken = taken_of(seen.events)
    increments = periods_of(line, width=4, preload="half")
    assert taken[:, 1:3].tolist() == increments * order.count(line)
    # A block of no length loads its start; a refused one leaves the position alone.
    places = {tuple(place) for place in seen.watch.tolist()}
    assert (-16, 15) in places
    assert not {(-16, 0), (3, -16), (3, 3)} & places


def assert_promises(taken, blocks, preload, width):
    """Check increments against the true lines: ends, distance, and the last increment.

    Give the largest distances found: of an axis from its line, and of the last increment.
    """
    ends = np.flatnonzero(taken[:, 3])
    assert len(ends) == len(blocks)
    most, least = {"zero": (17 / 16, 0.0), "half": (9 / 16, 0.5)}[preload]
    largest = [0.0, 0.0]
    begin = 0
    for block, end in zip(blocks, ends.tolist(), strict=True):
        xh, yh, xk, yk, periods, _ = block
        moves = taken[begin : end + 1, 1:3]
        begin = end + 1
        points = moves.cumsum(axis=0)
        length = np.array([xk - xh, yk - yh])
        assert points[-1].tolist() == length.tolist(), block
        assert len(moves) <= periods
        line = np.arange(1, len(moves) + 1)[:, None] * length / periods
        behind = ((line - points) * np.sign(length))[:-1]
        if len(behind):
            assert behind.max() < most, block
            assert behind.min() >= -least, block
            largest[0] = max(largest[0], behind.max())
        mean = np.array([abs(part) * 2 ** (width + 12) // periods for part in length.tolist()])
        off = np.abs(np.abs(moves[-1]) - mean / 2 ** (width + 12))
        assert off.max() < 1 + periods / 2 ** (width + 12), block
        largest[1] = max(largest[1], off.max())
    return largest


@pytest.mark.parametrize("preload", ["half", "zero"])
def test_every_length_of_four_bits(preload):
    """Ends, distance from the line and last increment; every pair is the golden model's test."""
    rows = [
        [0, 0, x, -(7 * x + 3) % 16, periods, 2] for periods in (1, 2, 3, 7, 16) for x in range(16)
    ]
    model = PysimModel(CarrierLinear(4, preload=preload))
    limit = sum(row[4] * row[5] for row in rows) + 60 * len(rows)
    seen = model.run(np.array(rows), limit, until_answered=len(rows), event_room=limit)
    assert seen.answered == len(rows)
    largest = assert_promises(taken_of(seen.events), rows, preload, 4)
    # Broken bounds would be seen: these are reached but for little.
    assert largest[0] > {"zero": 0.9, "half": 0.4}[preload]
    assert largest[1] > {"zero": 0.85, "half": 0.4}[preload]


@pytest.mark.parametrize("preload", ["half", "zero"])
def test_registers_hold_every_flip_flop(preload):
    smt = pytest.importorskip("discreta.sim.smt")
    core = CarrierLinear(4, preload=preload)
    assert sum(map(len, core.registers.values())) == smt.Rtl(core).flip_flops
    assert list(core.registers) == [
        register.name for group in core.diagram.values() for register in group
    ]
    assert {name: len(register) for name, register in core.registers.items()} == {
        name: bits for name, (bits, _) in GoldenCarrierLinear(4, preload).registers().items()
    }


def test_settings():
    assert CarrierLinear.LECTURE == LECTURE
    assert MAX_WIDTH == 24
    for core, preload in ((CarrierLinear(), "half"), (CarrierLinear(16, **LECTURE), "zero")):
        PysimModel(core).run(np.empty((0, 6)), 1)  # an unused core is an error
        assert core.parameters == {"width": 16, "preload": preload}
    core = CarrierLinear(24)
    PysimModel(core).run(np.empty((0, 6)), 1)
    assert max(map(len, core.registers.values())) <= 64


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), CarrierLinear, width)


def test_refuses_preload():
    message = "preload is 'full': choose 'zero' or 'half'"
    assert_refused((ValueError, message), CarrierLinear, 8, preload="full")
