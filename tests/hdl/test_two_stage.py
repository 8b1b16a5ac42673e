"""Two stages: every step of a line or an arc, spread evenly over its carrier periods."""

from math import hypot, sqrt

import numpy as np
import pytest

from discreta.hdl.carrier_circular import CarrierCircular
from discreta.hdl.two_stage import TwoStage, two_stage_circular, two_stage_linear
from discreta.sim.compiled import CompiledModel
from discreta.sim.golden import two_stage as golden_models
from discreta.sim.interpreted import PysimModel
from discreta.sim.stalls import NO_STALLS, Stalls
from tests.hdl.parts.clocked import assert_refused
from tests.hdl.test_carrier_circular import angle_of, few_arcs, least_period, radius_of, timed_arcs
from tests.hdl.test_carrier_linear import (
    answers_of,
    is_refused,
    periods_of,
    taken_of,
    timed_blocks,
)
from tests.hdl.traces import golden_trace

STALLS = [NO_STALLS, Stalls(1, stall=0.5, gap=0.3), Stalls(2, stall=0.9)]
PRELOADS = ("half", "zero")


def assert_equal(make_model, device, golden, blocks, stalls):
    """Compare every register at every clock, until all blocks are answered."""
    kinds = golden.registers()
    # No engine's record has room for the others: the quotient of the widest arcs.
    watched = [index for index, (bits, _) in enumerate(kinds.values()) if bits <= 64]
    watch = tuple(f"reg_{list(kinds)[index]}" for index in watched)
    model = make_model(device, watch=watch)
    expected, _ = golden_trace(golden, model.block_fields, blocks, 20_000, stalls, until_idle=True)
    seen = model.run(blocks, len(expected), stalls=stalls)
    assert (seen.fed, seen.answered) == (len(blocks), len(blocks))
    wrong = np.argwhere(seen.watch != expected[:, watched])
    assert [(clock, watch[place]) for clock, place in wrong[:5].tolist()] == []
    return dict(zip(watch, seen.watch.T, strict=True))


@pytest.mark.parametrize("stalls", STALLS, ids=str)
@pytest.mark.parametrize("preload", PRELOADS)
def test_every_register_of_lines_in_pysim(preload, stalls):
    seen = assert_equal(
        PysimModel,
        two_stage_linear(4, preload=preload),
        golden_models.two_stage_linear(4, preload),
        timed_blocks(4, 11, seed=6, periods=5, period=7),
        stalls,
    )
    assert set(seen["reg_error"]) == {0, 1}
    # Some periods have more steps than clocks.
    assert (seen["reg_span"] > seen["reg_period"]).any()


@pytest.mark.parametrize(
    ("formula", "preload", "stalls"),
    [("plain", "zero", NO_STALLS), ("predictor_corrector", "half", STALLS[1])],
    ids=str,
)
def test_every_register_of_arcs_in_pysim(formula, preload, stalls):
    device = two_stage_circular(4, formula=formula, preload=preload)
    golden = golden_models.two_stage_circular(4, formula=formula, preload=preload)
    blocks = few_arcs(4, formula)[[0, 3, 1, 2, 4]]
    seen = assert_equal(PysimModel, device, golden, blocks, stalls)
    assert set(seen["reg_error"]) == {0, 1, 2}


@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize(("width", "curve"), [(8, "line"), (16, "arc")])
def test_every_register_compiled(width, curve):
    if curve == "line":
        device, golden = two_stage_linear(width), golden_models.two_stage_linear(width)
        blocks = timed_blocks(width, 9, seed=7, periods=9, period=9)
    else:
        device, golden = (
            two_stage_circular(width, formula="predictor_corrector"),
            golden_models.two_stage_circular(width, formula="predictor_corrector"),
        )
        blocks = timed_arcs(width, 8, 8, formula="predictor_corrector", radius=2**14)
        blocks = np.array([row for row in blocks if row[8] < 6][:2])
    assert_equal(CompiledModel, device, golden, blocks, Stalls(3, stall=0.4, gap=0.9))


def spread(increment, period, preload):
    """Give the clocks of a period and its steps: (clock after that of the taking, x, y)."""
    span = max(period, *map(abs, increment))
    sums = [{"zero": 0, "half": span // 2}[preload]] * 2
    steps = []
    for clock in range(1, span + 1):
        step = [0, 0]
        for k in (0, 1):
            sums[k] += abs(increment[k])
            if sums[k] >= span:
                sums[k] -= span
                step[k] = 1 if increment[k] > 0 else -1
        if any(step):
            # A carry is a step in the clock after.
            steps.append((clock + 1, *step))
    assert sums[0] == sums[1] < span  # what they began with
    return span, steps


def run_lines(blocks, *, width, preload):
    """Yield answer (clock, done, error) and steps (clock, x, y, last) of blocks, by the docstring.

    Nothing has to wait, and blocks are offered all the time.
    """
    accepted = free = next_take = last_step = answered = 0
    moved = False
    for block in blocks:
        code = int(is_refused(block, width))
        still = code != 0 or block[:2] == block[2:4]
        prepared = accepted + 2 * width + 14
        if still:
            # When no block before it is open.
            started = max(prepared, answered)
            idle = True
            steps, answered, free = [], started + 1, started + 1
            yield [answered, 1 - code, code], steps
        else:
            started = max(prepared, free)
            idle = not moved or started != free
            # The first stage's increments wait two clocks later, or a period after those before.
            take = max(started + 2, next_take, last_step)
            steps = []
            increments = periods_of(block, width=width, preload=preload)
            for increment in increments:
                free = take
                span, moves = spread(increment, block[5], preload)
                steps += [[take + clock, x, y, 0] for clock, x, y in moves]
                take += span
            next_take, last_step = take, steps[-1][0]
            steps[-1][3] = 1
            answered = last_step + 1
            yield [answered, 1, 0], steps
        accepted, moved = started + (not idle), not still


@pytest.mark.parametrize("preload", PRELOADS)
@pytest.mark.parametrize("width", [4, 5])
def test_clocks_of_lines_and_between_them(width, preload):
    """Every clock of steps and answers, and every step, as the docstring tells them."""
    # Refused ones and such of no length, prepared long before the steps in front of them have left.
    long = [0, 0, 15, -9, 6, 12]
    rows = [long, [3, 3, 4, 4, 0, 3], long, [5, 5, 5, 5, 1, 2], long, [15, -9, 0, 3, 4, 20], long]
    rows += [[0, 0, 15, 15, 1, 2], [15, 15, 0, 0, 2, 3]]
    rows += timed_blocks(width, 14, seed=8, periods=5, period=6).tolist()
    wanted = list(run_lines(rows, width=width, preload=preload))
    limit = wanted[-1][0][0] + 1
    model = PysimModel(two_stage_linear(width, preload=preload))
    seen = model.run(np.array(rows), limit, event_room=limit)
    assert answers_of(seen.events).tolist() == [answer for answer, _ in wanted]
    assert taken_of(seen.events).tolist() == [step for _, steps in wanted for step in steps]
    # Accepted in clock 0, taken over in 2n + 16 by the second stage.
    first = spread(periods_of(long, width=width, preload=preload)[0], 12, preload)[1][0]
    assert wanted[0][1][0][0] == 2 * width + 16 + first[0]
    # The path begins three times more with the same increments. With preload ½ no clock is lost
    # between two blocks, with 0 one: there the last step leaves on the last clock of its period.
    lost = wanted[6][1][0][0] - wanted[4][1][0][0] - 6 * 12 - 4 * 20
    assert lost == {"half": 0, "zero": 2}[preload]


def test_steps_of_a_line_by_hand():
    """(0, 0) to (5, −3) in one period of 8 clocks: X and Y carry as sums of 8 from 4 on."""
    seen = PysimModel(two_stage_linear(4)).run(
        np.array([[0, 0, 5, -3, 1, 8]]), 60, until_answered=1, event_room=60
    )
    # SX: 9, 6, 11, 8, 5, 10, 7, 12: carries 1, 3, 4, 6, 8. SY: 7, 10, 5, 8, 3, 6, 9, 4: 2, 4, 7.
    # Taken in clock 24, so that a carry in clock 25 is a step in 26.
    assert taken_of(seen.events).tolist() == [
        [26, 1, 0, 0],
        [27, 0, -1, 0],
        [28, 1, 0, 0],
        [29, 1, -1, 0],
        [31, 1, 0, 0],
        [32, 0, -1, 0],
        [33, 1, 0, 1],
    ]
    assert answers_of(seen.events).tolist() == [[34, 1, 0]]


def test_a_period_of_more_steps_than_clocks_is_stretched():
    seen = PysimModel(two_stage_linear(4), watch=("reg_span",)).run(
        np.array([[0, 0, 15, 10, 1, 2], [15, 10, 11, 10, 2, 2]]),
        100,
        until_answered=2,
        event_room=100,
    )
    steps = taken_of(seen.events)
    # 15 clocks for 15 steps of x, one in every clock.
    assert steps[:15, 0].tolist() == list(range(26, 41))
    assert steps[:15, 1].tolist() == [1] * 15
    assert steps[:15, 2].sum() == 10
    assert set(np.unique(seen.watch)) == {0, 15, 2}


@pytest.mark.parametrize("preload", PRELOADS)
def test_steps_are_even_within_a_period(preload):
    """⌊M/Δ⌋ or ⌈M/Δ⌉ clocks apart, of every number of steps in a period of 16 to 17 clocks."""
    rows = [[0, 0, x, -((5 * x) % 16), 1, 16 + x % 2] for x in range(1, 16)]
    model = PysimModel(two_stage_linear(4, preload=preload))
    seen = model.run(np.array(rows), 900, until_answered=len(rows), event_room=900)
    steps = taken_of(seen.events)
    begin = 0
    for row, end in zip(rows, np.flatnonzero(steps[:, 3]) + 1, strict=True):
        part = steps[begin:end]
        begin = end
        assert np.abs(part[:, 1:3]).max() == 1
        assert part[:, 1:3].sum(axis=0).tolist() == row[2:4]
        for k, count in ((1, row[2]), (2, -row[3])):
            apart = set(np.diff(part[part[:, k] != 0][:, 0]).tolist())
            assert apart <= {row[5] // max(count, 1), -(-row[5] // max(count, 1))}, row
    assert begin == len(steps)


def distance(points, start, end):
    """Give how far points are from the straight line through two others."""
    along = (end - start) / hypot(*(end - start))
    return np.abs((points - start) @ np.array([-along[1], along[0]]))


@pytest.mark.parametrize("preload", PRELOADS)
def test_distance_from_the_line(preload):
    """√½ or 1 from the first stage's line, and this by 9/16 or 17/16 on both axes from the true."""
    bound = {"half": sqrt(0.5) + sqrt(2) * 9 / 16, "zero": 1 + sqrt(2) * 17 / 16}[preload]
    coarse = {"half": sqrt(0.5) + 1e-9, "zero": 1.0}[preload]
    rows = timed_blocks(6, 24, seed=9, periods=9, period=14).tolist()
    rows = [row for row in rows if not is_refused(row, 6) and row[:2] != row[2:4]]
    assert len(rows) > 8
    model = PysimModel(two_stage_linear(6, preload=preload))
    limit = 20_000
    seen = model.run(np.array(rows), limit, until_answered=len(rows), event_room=limit)
    steps = taken_of(seen.events)
    begin, largest = 0, 0.0
    for row, end in zip(rows, np.flatnonzero(steps[:, 3]) + 1, strict=True):
        start, finish = np.array(row[:2]), np.array(row[2:4])
        points = start + steps[begin:end, 1:3].cumsum(axis=0)
        begin = end
        assert points[-1].tolist() == finish.tolist()
        off = distance(points, start, finish)
        assert off.max() <= bound, row
        largest = max(largest, off.max())
        knots = start + np.cumsum([[0, 0], *periods_of(row, width=6, preload=preload)], axis=0)
        counts = np.abs(np.diff(knots, axis=0)).sum(axis=1)
        taken = np.abs(np.diff(np.array([start, *points]), axis=0)).sum(axis=1).cumsum()
        for k, total in enumerate(counts.cumsum().tolist()):
            within = (taken > total - counts[k]) & (taken <= total)
            if counts[k]:
                assert distance(points[within], knots[k], knots[k + 1]).max() <= coarse, row
    assert largest > 0.5


def test_distance_from_the_arc():
    """A step and the formula's drift, √½ for the steps, and R·Δφ²/8 for the chords."""
    rows = [[12, 5, -5, 12, 0, 0, 0, 0, 4, 66], [-5, 12, 13, 0, 0, 0, 1, 0, 5, 70]]
    for formula in ("plain", "rotation"):
        model = PysimModel(two_stage_circular(4, formula=formula))
        seen = model.run(np.array(rows), 2500, until_answered=2, event_room=2500)
        assert answers_of(seen.events)[:, 1].tolist() == [1, 1]
        steps = taken_of(seen.events)
        begin = 0
        for row, end in zip(rows, np.flatnonzero(steps[:, 3]) + 1, strict=True):
            radius, angle = radius_of(row), angle_of(row)
            step = angle / row[8]
            drift = 1.34 * radius * angle * step / 2 if formula == "plain" else 0
            points = np.array(row[:2]) + steps[begin:end, 1:3].cumsum(axis=0)
            begin = end
            off = np.abs(np.hypot(*points.T) - radius)
            assert off.max() <= 1 + drift + sqrt(0.5) + radius * step**2 / 8
            assert points[-1].tolist() == row[2:4]
            # They go round the right way, and never far back.
            ways = np.unwrap(np.arctan2(points[:, 1], points[:, 0])) * (-1 if row[6] else 1)
            assert np.diff(ways).min() > -1 / radius


@pytest.mark.parametrize("preload", PRELOADS)
def test_steps_of_an_arc_are_those_of_its_increments(preload):
    """The first stage's increments, each spread over its period from the clock it waits in."""
    rows = few_arcs(4, "plain")[[0, 1]]
    first, second = (
        PysimModel(make(4, formula="plain", preload=preload)).run(
            rows, 900, until_answered=2, event_room=900
        )
        for make in (CarrierCircular, two_stage_circular)
    )
    increments = taken_of(first.events)
    # With preload 0 the second block comes a clock later, behind the last step of the first.
    late = 0
    wanted = []
    for clock, x, y, last in increments.tolist():
        period = int(rows[len(wanted) and int(increments[: len(wanted), 3].sum())][9])
        span, steps = spread([x, y], period, preload)
        assert span == period
        wanted.append([[clock + late + after, *step] for after, *step in steps])
        late += last * (preload == "zero")
    assert taken_of(second.events)[:, :3].tolist() == [step for steps in wanted for step in steps]


def test_an_arc_whose_last_increments_are_nothing():
    """``done`` follows a last step that was still to come by a clock; else no step is last."""
    # By hand, from the sines: whole parts are those of the end in the 2nd of 4 periods, or in the
    # 1st, and with the 3rd the block ends.
    late, early = [-1, 5, -3, 4, 0, 0, 0, 0, 4, 66], [1, 0, 0, -1, 0, 0, 1, 0, 4, 66]
    rows = [late, early, [2, 2, 2, 2, 2, 2, 0, 0, 50, 66]]
    for stalls in (NO_STALLS, Stalls(4, stall=0.6)):
        model = PysimModel(
            two_stage_circular(4, coefficient="table", preload="zero"),
            watch=("steps_valid", "done", "position_x", "position_y"),
        )
        run = model.run(np.array(rows), 4000, until_answered=3, stalls=stalls, event_room=4000)
        assert answers_of(run.events)[:, 1].tolist() == [1] * 3
        done = answers_of(run.events)[:, 0]
        # No step waits when it is said to be done, and the position is the end.
        assert run.watch[done].tolist() == [[0, 1, -3, 4], [0, 1, 0, -1], [0, 1, 2, 2]]
        steps = taken_of(run.events)
        assert steps[:, 1:].tolist() == [[-1, -1, 0], [-1, 0, 1], [-1, -1, 0]]
        assert steps[1, 0] == done[0] - 1
        if stalls is NO_STALLS:
            # The last increments but one and the last, nothing, are each taken a period later: the
            # step is one of the last clock of the first period.
            assert done[1] == steps[2, 0] + 66


def test_answers_keep_their_order_while_steps_are_still_to_come():
    """Refused blocks and such of no length wait for the steps of the block before, all of them."""
    long = [0, 0, 12, 7, 1, 80]
    rows = [long, [0, 0, 1, 1, 0, 9], long, [3, 3, 3, 3, 1, 9], [0, -16, 0, 15, 1, 9], long]
    watch = ("position_x", "position_y", "steps_valid", "busy")
    for stalls in (NO_STALLS, Stalls(5, stall=0.8)):
        model = PysimModel(two_stage_linear(4), watch=watch)
        seen = model.run(np.array(rows), 4000, until_answered=6, stalls=stalls, event_room=4000)
        answers = answers_of(seen.events)
        assert answers[:, 2].tolist() == [0, 1, 0, 0, 1, 0]
        steps = taken_of(seen.events)
        lasts = steps[steps[:, 3] == 1, 0]
        assert answers[[0, 2, 5], 0].tolist() == (lasts + 1).tolist()
        # Answered by the clock after, and no step in between.
        assert answers[1, 0] == answers[0, 0] + 1
        assert answers[3, 0] == answers[2, 0] + 1
        assert np.diff(answers[:, 0]).min() > 0
        assert seen.watch[answers[0, 0], :2].tolist() == [12, 7]
        assert seen.watch[answers[3, 0], :2].tolist() == [3, 3]
        # Busy until the last answer.
        assert seen.watch[1 : answers[-1, 0], 3].all()
        assert not seen.watch[answers[-1, 0], 3]


@pytest.mark.parametrize("preload", PRELOADS)
def test_a_step_waits_unchanged_and_the_path_is_the_same(preload):
    watch = ("steps_valid", "steps_x", "steps_y", "steps_last", "position_x", "position_y")
    names = ("fine_p1", "fine_p2", "fine_p5", "fine_p6", "fine_sx", "fine_sy", "clocks_left")
    watch += tuple(f"reg_{name}" for name in (*names, "span", "timer", "sx", "fine_running"))
    blocks = timed_blocks(5, 9, seed=10, periods=4, period=8)
    free = PysimModel(two_stage_linear(5, preload=preload)).run(
        blocks, 4000, until_answered=9, event_room=4000
    )
    model = PysimModel(two_stage_linear(5, preload=preload), watch=watch)
    stalls = Stalls(6, stall=0.6)
    held = model.run(blocks, 4000, until_answered=9, stalls=stalls, event_room=4000)
    assert np.array_equal(taken_of(free.events)[:, 1:], taken_of(held.events)[:, 1:])
    assert np.array_equal(answers_of(free.events)[:, 1:], answers_of(held.events)[:, 1:])
    found = held.watch
    ready = np.array([stalls.ready(clock) for clock in range(len(found))])
    waits = (found[:-1, 0] == 1) & ~ready[:-1]
    assert waits.sum() > 25
    second = [index for index, name in enumerate(watch) if name not in ("reg_timer", "reg_sx")]
    assert np.array_equal(found[:-1, second][waits], found[1:, second][waits])
    # The position moves by the steps taken; else only by the start of a block.
    taken = (found[:-1, 0] == 1) & ready[:-1]
    moved = found[1:, 4:6] - found[:-1, 4:6]
    between = found[:-1, 3] == 0
    assert np.array_equal(moved[taken & between], found[:-1, 1:3][taken & between])
    assert np.abs(found[:, 1:3]).max() == 1


@pytest.mark.parametrize(
    ("period", "refused"), [(1, True), (2, False), (2**24 - 1, False)], ids=str
)
def test_least_period_of_lines(period, refused):
    model = PysimModel(two_stage_linear(4))
    seen = model.run(
        np.array([[0, 0, 1, 1, 1, period]]), 60, until_answered=1 + (period > 9), event_room=9
    )
    assert (answers_of(seen.events)[:, 2].tolist() == [1]) == refused


def test_least_period_of_arcs():
    for formula in ("plain", "rotation"):
        least = least_period(4, formula)
        rows = [[5, 0, 0, 5, 0, 0, 0, 0, 4, least - 1], [5, 0, 0, 5, 0, 0, 0, 0, 4, least]]
        model = PysimModel(two_stage_circular(4, formula=formula))
        seen = model.run(np.array(rows), 2000, until_answered=2, event_room=2000)
        assert answers_of(seen.events)[:, 1:].tolist() == [[0, 1], [1, 0]]
        ends = taken_of(seen.events)
        # A quarter in 4 periods: steps of each in their own T clocks.
        assert ends[-1, 0] - ends[0, 0] < 4 * least
        assert ends[:, 1:3].sum(axis=0).tolist() == [-5, 5]


@pytest.mark.parametrize("curve", ["line", "arc"])
def test_registers_hold_every_flip_flop(curve):
    smt = pytest.importorskip("discreta.sim.smt")
    core = two_stage_linear(4) if curve == "line" else two_stage_circular(4, formula="plain")
    golden = (
        golden_models.two_stage_linear(4)
        if curve == "line"
        else golden_models.two_stage_circular(4, formula="plain")
    )
    assert sum(map(len, core.registers.values())) == smt.Rtl(core).flip_flops
    assert list(core.registers) == [
        register.name for group in core.diagram.values() for register in group
    ]
    assert {name: len(register) for name, register in core.registers.items()} == {
        name: bits for name, (bits, _) in golden.registers().items()
    }


def test_settings():
    line = two_stage_linear(8, preload="zero")
    arc = two_stage_circular(8, formula="plain", coefficient="table", preload="zero")
    for core, settings in (
        (line, {"width": 8, "preload": "zero"}),
        (arc, {"width": 8, "formula": "plain", "coefficient": "table", "preload": "zero"}),
    ):
        assert isinstance(core, TwoStage)
        assert core.parameters == core.coarse.parameters == settings
        fields = {line: 6, arc: 10}[core]
        PysimModel(core).run(np.empty((0, fields)), 1)  # an unused core is an error


def test_refuses_what_the_first_stage_refuses():
    message = "width is 25: choose a whole number from 4 to 24"
    assert_refused((ValueError, message), two_stage_linear, 25)
    message = "width is 17: choose a whole number from 4 to 16"
    assert_refused((ValueError, message), two_stage_circular, 17)
    message = "preload is 'full': choose 'zero' or 'half'"
    assert_refused((ValueError, message), two_stage_linear, 8, preload="full")
    message = "formula is 'cosine': choose 'rotation' or 'predictor_corrector' or 'plain'"
    assert_refused((ValueError, message), two_stage_circular, 8, formula="cosine")
