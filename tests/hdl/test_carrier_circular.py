"""The whole device: the contract, clock by clock, and equality to the golden model."""

from dataclasses import dataclass
from math import atan2, cos, floor, hypot, pi, sin

import numpy as np
import pytest

from discreta.hdl.carrier_circular import FORMULAS, MAX_WIDTH, CarrierCircular
from discreta.sim.compiled import CompiledModel
from discreta.sim.golden.carrier_circular import CarrierCircular as GoldenCarrierCircular
from discreta.sim.interpreted import PysimModel
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS
from tests.arcs import OFF_CURVE, RANGE, draw_arcs, fault, is_empty, seen
from tests.hdl.parts.clocked import assert_refused
from tests.hdl.traces import golden_trace

PLAIN = {"formula": "plain", "coefficient": "series", "preload": "half"}
LECTURE = PLAIN | {"preload": "zero"}
CORRECTED = PLAIN | {"formula": "predictor_corrector"}
SERIES = PLAIN | {"formula": "rotation"}
TABLE = SERIES | {"coefficient": "table", "preload": "zero"}
VARIANTS = [LECTURE, CORRECTED, SERIES, TABLE]
ROUNDS = {"plain": 1, "predictor_corrector": 2, "rotation": 3}
BAD_WIDTHS = [
    (3, ValueError, "width is 3: choose a whole number from 4 to 16"),
    (17, ValueError, "width is 17: choose a whole number from 4 to 16"),
    (8.0, TypeError, "width must be a whole number from 4 to 16, not 8.0"),
    ("8", TypeError, "width must be a whole number from 4 to 16, not '8'"),
    (True, TypeError, "width must be a whole number from 4 to 16, not True"),
]


def names(variant):
    return "-".join(variant.values())


def least_period(width, formula):
    """Give the least T: b + 4, 2b + 5 or 3b + 6."""
    rounds = ROUNDS[formula]
    return rounds * (3 * width + 8) + rounds + 3


def latency(width, formula, coefficient):
    """Give the clock in which a block accepted in clock 0 is started at the earliest.

    2n + 5 clocks of the radius meter, 2 × (n + 7) of the angle meter, b + 12 of the division, and
    with rotation 2 and 15 products of b + 2 clocks, or 5 of them.
    """
    bits = 3 * width + 8
    clocks = 2 * width + 5 + 2 * (width + 7) + bits + 12
    if formula == "rotation":
        clocks += 2 + {"series": 15, "table": 5}[coefficient] * (bits + 2)
    return clocks


def angle_of(block):
    """Give the angle that an arc sweeps, in radians; a whole turn where it ends as it begins."""
    (x, y), (u, v) = seen(block[:8])
    cross, dot = x * v - y * u, x * u + y * v
    angle = atan2(cross, dot) % (2 * pi) if cross or dot < 0 else 2 * pi
    return angle + 2 * pi * block[7]


def radius_of(block):
    return hypot(block[0] - block[4], block[1] - block[5])


def answer(block, *, width, formula, **_):
    """Give the code that answers a block; its angle must not be near to another answer."""
    code = fault(block[:8], width)
    *_, periods, period = block
    if code or is_empty(block[:8]):
        timed = periods > 0 and period >= least_period(width, formula)
        return code or (0 if timed else RANGE)
    angle, unsure = angle_of(block), 0.25 / radius_of(block)
    answers = {
        periods < 1
        or period < least_period(width, formula)
        or measured / periods >= 0.5
        or (formula != "rotation" and periods < (floor(measured) + 1) ** 2)
        for measured in (angle - unsure, angle, angle + unsure)
    }
    assert len(answers) == 1, block
    return RANGE if answers.pop() else 0


def least_periods(block, formula):
    """Give how few periods an arc may have for sure."""
    angle = angle_of(block) + 0.25 / radius_of(block)
    return max(floor(2 * angle) + 1, (floor(angle) + 1) ** 2 if formula != "rotation" else 1)


def timed_arcs(width, count, seed, *, formula, radius, turns=0, refused=True, more=3, slack=9):
    """Draw arcs of all kinds with a timing; some of them with one that is refused."""
    random = np.random.default_rng([seed, width])
    rows = []
    for index, arc in enumerate(
        draw_arcs(width, count, seed=seed, radius=radius, turns=max(turns, 1)).tolist()
    ):
        if turns == 0:
            arc[7] = 0
        # Of no length: so many that none is too few.
        periods = 50 * (1 + arc[7])
        period = least_period(width, formula) + int(random.integers(slack))
        if not fault(arc, width) and not is_empty(arc):
            periods = least_periods(arc, formula) + int(random.integers(more))
            if refused and index % 9 == 4:
                periods = 0
            if refused and index % 9 == 5:
                # Half of what the angle needs; of a small one ½ a radian and more a period.
                periods //= 2
        if refused and index % 9 == 0:
            period = least_period(width, formula) - 1
        rows.append([*arc, periods, period])
    return rows


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


def assert_equal(make_model, width, variant, blocks, stalls):
    """Compare every register at every clock, but those that no engine's record has room for."""
    golden = GoldenCarrierCircular(width, **variant)
    kinds = golden.registers()
    watched = [index for index, (bits, _) in enumerate(kinds.values()) if bits <= 64]
    assert len(kinds) - len(watched) <= (width > 15)
    watch = tuple(f"reg_{list(kinds)[index]}" for index in watched)
    model = make_model(CarrierCircular(width, **variant), watch=watch)
    expected, _ = golden_trace(golden, model.block_fields, blocks, 20_000, stalls, until_idle=True)
    run = model.run(blocks, len(expected), stalls=stalls)
    assert (run.fed, run.answered) == (len(blocks), len(blocks))
    wrong = np.argwhere(run.watch != expected[:, watched])
    assert [(clock, watch[place]) for clock, place in wrong[:5].tolist()] == []
    return dict(zip(watch, run.watch.T, strict=True))


#: A quarter; clockwise, off the axes, around another centre; of no length; off the curve; more than
#: ½ a radian a period; three quarters, which 4 periods are too few for.
FEW = [
    [5, 0, 0, 5, 0, 0, 0, 0, 4],
    [4, -4, -3, -4, 0, 1, 1, 0, 5],
    [3, 3, 3, 3, 3, 3, 0, 0, 50],
    [3, 3, 9, 9, 0, 0, 0, 0, 9],
    [0, 5, 5, 0, 0, 0, 1, 0, 3],
    [-9, 9, -6, 6, -6, 9, 0, 0, 4],
]


def few_arcs(width, formula):
    least = least_period(width, formula)
    rows = [[*row, least + index] for index, row in enumerate(FEW)]
    rows.append([15, 0, 0, 15, 0, 0, 0, 0, 0, least])
    rows.append([1, 1, 2, 1, 2, 2, 0, 0, 6, least - 1])
    # It comes to its end a period early: 72° of 90 are (0.31, 0.95).
    rows.append([1, 0, 0, 1, 0, 0, 0, 0, 5, least])
    return np.array(rows)


@pytest.mark.parametrize(
    ("variant", "stalls"),
    [
        *((variant, Stalls(1, stall=0.5, gap=0.3)) for variant in VARIANTS),
        (PLAIN, NO_STALLS),
    ],
    ids=lambda value: names(value) if isinstance(value, dict) else str(value),
)
def test_every_register_at_every_clock_in_pysim(variant, stalls):
    blocks = few_arcs(4, variant["formula"])
    if variant["formula"] == "rotation":
        blocks = blocks[[0, 2, 8, 1, 3, 4]]
    found = assert_equal(PysimModel, 4, variant, blocks, stalls)
    assert set(found["reg_error"]) == {0, RANGE, OFF_CURVE}
    assert set(found["reg_clockwise"]) == {0, 1}


@pytest.mark.usefixtures("compiled_engine")
def test_every_register_at_every_clock_compiled():
    # Those of 16 bits are seen behind a second stage, in test_two_stage.py.
    width, variant = 8, SERIES
    rows = timed_arcs(width, 8, 3, formula=variant["formula"], radius=2 ** (width - 2), slack=30)
    rows = [row for row in rows if row[8] < 8][:4]
    # Far out, where every bit of a coordinate counts.
    far = 2**width - 1
    few = 2 if variant["formula"] == "rotation" else 1
    rows.insert(1, [far, 0, far - 1, 40, 0, 0, 0, 0, few, least_period(width, variant["formula"])])
    stalls = Stalls(2, stall=0.6, gap=0.9)
    found = assert_equal(CompiledModel, width, variant, np.array(rows), stalls)
    assert found["reg_running"].any()


@dataclass(frozen=True)
class Run:
    """What becomes of a block, when nothing has to wait and blocks are offered all the time."""

    accepted: int
    started: int
    answered: int
    code: int
    taken: list[int]


def run_arcs(blocks, counts, *, width, **variant):
    """Yield the clocks of blocks, one behind the other; ``counts``: the periods they really have.

    A block is prepared from its acceptance on and started in the clock in which the last increments
    before it are taken, if it is prepared by then.
    """
    formula = variant["formula"]
    accepted = free = due = 0
    moved = False
    for block, count in zip(blocks, counts, strict=True):
        still = count == 0
        started = max(accepted + latency(width, formula, variant["coefficient"]), free)
        if still and moved and started == free:
            started += 1
        taken = []
        if still:
            answered = free = started + 1
        else:
            first = max(started + ROUNDS[formula] * (3 * width + 9) + 2, due)
            taken = [first + i * block[9] for i in range(count)]
            answered, free, due = taken[-1] + 1, taken[-1], taken[-1] + block[9]
        yield Run(accepted, started, answered, answer(block, width=width, **variant), taken)
        accepted, moved = started + 1, not still


def formula_points(block, formula, count):
    """Give the points after 1 … N periods by the docstring's formula, with the true angle."""
    xh, yh, _, _, xc, yc, clockwise, _, periods, _ = block
    step = angle_of(block) / periods * (-1 if clockwise else 1)
    x, y = float(xh - xc), float(yh - yc)
    dx, dy = x - (x * cos(step) + y * sin(step)), y - (y * cos(step) - x * sin(step))
    kappa = 2 * (1 - cos(step))
    points = []
    for _ in range(count):
        if formula == "plain":
            x, y = x - y * step, y + x * step
        elif formula == "predictor_corrector":
            u, v = x - y * step, y + x * step
            x, y = x - (y + v) / 2 * step, y + (x + u) / 2 * step
        else:
            dx, dy = dx - kappa * x, dy - kappa * y
            x, y = x + dx, y + dy
        points.append((x, y))
    return np.array(points) + np.array([xc, yc])


def split(taken, blocks, codes):
    """Give the increments of every block: none where it was refused or has no length."""
    ends = iter(np.flatnonzero(taken[:, 3]) + 1)
    begin, parts = 0, []
    for block, code in zip(blocks, codes, strict=True):
        end = begin if code or is_empty(block[:8]) else int(next(ends))
        parts.append(taken[begin:end])
        begin = end
    assert begin == len(taken)
    return parts


def assert_arcs(model, width, variant, blocks):
    """Check increments and answers against the formula with the true angle, and the exact clocks.

    Give the largest distance of a coordinate from the formula's.
    """
    formula, preload = variant["formula"], variant["preload"]
    limit = sum(max(row[8], 1) * row[9] for row in blocks) + len(blocks) * (
        latency(width, formula, variant["coefficient"]) + 200
    )
    run = model.run(np.array(blocks), limit, until_answered=len(blocks), event_room=limit)
    codes = [answer(block, width=width, **variant) for block in blocks]
    assert answers_of(run.events)[:, 2].tolist() == codes
    parts = split(taken_of(run.events), blocks, codes)
    largest = 0.0
    for block, part in zip(blocks, parts, strict=True):
        if not len(part):
            continue
        periods, start, end = block[8], np.array(block[:2]), np.array(block[2:4])
        points = start + part[:, 1:3].cumsum(axis=0)
        assert points[-1].tolist() == end.tolist(), block
        assert len(part) == periods or len(part) == periods - 1, block
        wanted = formula_points(block, formula, len(part))
        if preload == "zero":
            wanted -= 0.5
        # No axis leaves the coordinates, and period N puts out what is left.
        wanted = np.clip(wanted, -(2**width), 2**width - 1)
        free = slice(None, -1) if len(part) == periods else slice(None)
        off = np.abs(points - wanted)[free]
        if off.size:
            # Half a step for the whole part, a quarter for the angle that was measured.
            assert off.max() < 0.75, (block, off)
            largest = max(largest, off.max())
        # Period N − 1 is the last one just when it comes to the end.
        if len(part) == periods > 1:
            assert points[-2].tolist() != end.tolist(), block
    clocks = column(run.events, "clock")
    runs = list(run_arcs(blocks, map(len, parts), width=width, **variant))
    assert clocks[column(run.events, "accepted") == 1].tolist() == [one.accepted for one in runs]
    assert answers_of(run.events).tolist() == [
        [one.answered, int(not one.code), one.code] for one in runs
    ]
    assert taken_of(run.events)[:, 0].tolist() == [clock for one in runs for clock in one.taken]
    return largest, runs


@pytest.mark.parametrize(
    ("width", "variant"),
    [(4, LECTURE), (5, PLAIN), (4, CORRECTED), (4, SERIES), (4, TABLE)],
    ids=lambda value: names(value) if isinstance(value, dict) else str(value),
)
def test_points_and_clocks_of_blocks_and_between_them(width, variant):
    """Every clock of acceptance, increments and answers, and every point, by the docstring."""
    formula = variant["formula"]
    rows = few_arcs(width, formula).tolist()
    count = {"plain": 7, "predictor_corrector": 4, "rotation": 2}[formula]
    rows += [
        row
        for row in timed_arcs(width, count, 4, formula=formula, radius=7)
        if row[8] < 14 or formula == "plain"
    ]
    # Behind a long one everything is prepared in time: a refused one, one of no length, an arc.
    least = least_period(width, formula)
    long = latency(width, formula, variant["coefficient"]) // least + 3
    arc = [7, 0, 0, -7, 0, 0, 1, 0]
    rows += [[*arc, max(long, 4), least], rows[3], [*arc, max(long, 4), least], rows[2]]
    rows += [[*arc, max(long, 4), least], [0, -7, 7, 0, 0, 0, 0, 0, 4, least + 2]]
    _, runs = assert_arcs(PysimModel(CarrierCircular(width, **variant)), width, variant, rows)
    # In one clock with the last increments, and one clock later where nothing is to move.
    assert runs[-1].started == runs[-2].taken[-1]
    assert runs[-1].taken[0] - runs[-2].taken[-1] == least
    assert np.all(np.diff(runs[-1].taken) == least + 2)
    assert [runs[-k].started - runs[-k - 1].taken[-1] for k in (3, 5)] == [1, 1]


@pytest.mark.usefixtures("compiled_engine")
def test_points_of_many_arcs_of_eight_bits():
    """Both directions, all quadrants and several turns, with the series' rotation."""
    rows = timed_arcs(8, 24, 5, formula="rotation", radius=120, turns=2, refused=False, more=20)
    # Five turns and more of the largest circle that fits, and one whose angles are tiny.
    rows += [[254, 0, 0, 254, 0, 0, 1, 5, 75, 102], [254, 0, 253, 3, 0, 0, 0, 0, 150, 102]]
    model = CompiledModel(CarrierCircular(8, **SERIES))
    largest, _ = assert_arcs(model, 8, SERIES, rows)
    # A bound below half a step would be seen to be broken.
    assert largest > 0.5


def test_the_radius_of_the_formulas():
    """Farther out by R·φ·Δφ/2 and R·φ·Δφ³/8 (plain, corrected), or not at all, by a step."""
    block = [0, -14, 14, 0, 0, 0, 0, 0]
    angle, radius = pi / 2, 14.0
    for variant, periods in ((PLAIN, 4), (CORRECTED, 4), (SERIES, 4)):
        step = angle / periods
        points = formula_points([*block, periods, 99], variant["formula"], periods)
        away = np.hypot(*points.T)[-1] - radius
        drift = {
            "plain": radius * angle * step / 2,
            "predictor_corrector": radius * angle * step**3 / 8,
            "rotation": 0.0,
        }[variant["formula"]]
        # "About": by a third at this angle.
        assert drift * 0.9 - 1e-9 <= away <= drift * 1.34 + 1e-9
        row = [*block, periods, least_period(4, variant["formula"])]
        model = PysimModel(CarrierCircular(4, **variant))
        run = model.run(np.array([row]), 2000, until_answered=1, event_room=2000)
        found = np.array(block[:2]) + taken_of(run.events)[:, 1:3].cumsum(axis=0)
        far = np.hypot(*found[:-1].T) - radius
        part = np.arange(1, periods) / periods
        assert np.all(np.abs(far - drift * part) < 1 + 0.34 * drift)
        assert found[-1].tolist() == block[2:4]


@pytest.mark.parametrize("variant", [PLAIN, CORRECTED, SERIES], ids=names)
def test_admission(variant):
    """The least periods and the fewest periods are taken, and one less is refused."""
    formula = variant["formula"]
    least = least_period(4, formula)
    assert least == {"plain": 24, "predictor_corrector": 45, "rotation": 66}[formula]
    core = CarrierCircular(4, **variant)
    assert core.least_period == least
    # 1.79 radians in 4 periods; 2π in 13, or in 49.
    piece, turn = [9, 0, -2, 9, 0, 0, 0, 0], [3, 0, 3, 0, 0, 0, 1, 0]
    few = 13 if formula == "rotation" else 49
    rows = [
        [*piece, 4, least],
        [*piece, 4, least - 1],
        [*piece, 3, least],
        [*piece, 0, least],
        [*turn, few - 1, least],
        [3, 0, 9, 9, 0, 0, 0, 0, 0, 0],  # off the curve, and refused for its timing as well
        [-16, 0, 15, 0, 0, 0, 0, 0, 9, least],  # too far
        [1, 1, 1, 1, 1, 1, 0, 0, 0, least],  # of no length, and refused
        [1, 1, 1, 1, 1, 1, 0, 0, 50, least],
    ]
    if formula == "plain":
        rows.append([*turn, few, least])
    model = PysimModel(core, watch=("position_x", "position_y"))
    run = model.run(np.array(rows), 9000, until_answered=len(rows), event_room=9000)
    wanted = [0, RANGE, RANGE, RANGE, RANGE, OFF_CURVE, RANGE, RANGE, 0, 0][: len(rows)]
    assert answers_of(run.events)[:, 2].tolist() == wanted
    assert answers_of(run.events)[:, 1].tolist() == [int(not code) for code in wanted]
    ends = taken_of(run.events)[:, 3]
    assert ends.sum() == len(rows) - 8
    # Refused blocks load nothing: what is seen belongs to the others.
    places = {tuple(place) for place in run.watch.tolist()}
    assert (1, 1) in places
    assert (-16, 0) not in places


@pytest.mark.parametrize("variant", [PLAIN, SERIES], ids=names)
def test_a_block_of_no_length_needs_no_more_than_a_period(variant):
    """It sweeps no angle, so that one period is not too few."""
    row = [1, 1, 1, 1, 1, 1, 0, 0, 1, least_period(4, variant["formula"])]
    assert is_empty(row[:8])
    run = PysimModel(CarrierCircular(4, **variant)).run(
        np.array([row]), 500, until_answered=1, event_room=9
    )
    assert answers_of(run.events)[:, 1:].tolist() == [[1, 0]]


@pytest.mark.parametrize("variant", [LECTURE, CORRECTED], ids=names)
def test_increments_wait_unchanged_and_nothing_moves_meanwhile(variant):
    watch = ("steps_valid", "steps_x", "steps_y", "steps_last", "position_x", "position_y")
    moving = ("p1", "p2", "px", "py", "factor", "digit", "computed", "periods", "timer", "running")
    watch += tuple(f"reg_{name}" for name in moving)
    model = PysimModel(CarrierCircular(4, **variant), watch=watch)
    stalls = Stalls(8, stall=0.97)
    blocks = few_arcs(4, variant["formula"])[:3]
    run = model.run(blocks, 5000, until_answered=3, stalls=stalls, event_room=5000)
    free = PysimModel(CarrierCircular(4, **variant)).run(
        blocks, 5000, until_answered=3, event_room=5000
    )
    assert np.array_equal(taken_of(run.events)[:, 1:], taken_of(free.events)[:, 1:])
    assert np.array_equal(answers_of(run.events)[:, 1:], answers_of(free.events)[:, 1:])
    assert run.ran > free.ran
    found = run.watch
    ready = np.array([stalls.ready(clock) for clock in range(len(found))])
    waits = (found[:-1, 0] == 1) & ~ready[:-1]
    assert waits.sum() > 30
    assert np.array_equal(found[:-1][waits], found[1:][waits])


def test_no_axis_leaves_the_coordinates():
    """Plain drifts out by some steps at the edge; the coordinates stay, the end is exact."""
    rows = [[15, 0, 0, 15, 0, 0, 0, 0, 4, 24], [-16, 0, 0, -16, 0, 0, 0, 0, 4, 24]]
    rows[1][:4] = [-14, 0, 0, -14]
    for width, preload in ((4, "half"), (4, "zero")):
        model = PysimModel(
            CarrierCircular(width, formula="plain", preload=preload),
            watch=("position_x", "position_y"),
        )
        run = model.run(np.array(rows), 900, until_answered=2, event_room=900)
        assert answers_of(run.events)[:, 1].tolist() == [1, 1]
        assert run.watch.max() == 15
        moves = taken_of(run.events)
        # Without the edge the third point would lie at 16 or more.
        assert formula_points(rows[0], "plain", 4)[2:, 1].max() > 16
        assert moves[:4, 1:3].sum(axis=0).tolist() == [-15, 15]


@pytest.mark.parametrize("variant", [PLAIN, SERIES, CORRECTED], ids=names)
def test_preparation_is_the_clock_of_the_start(variant):
    """Clocks from the acceptance of a block to its start at the earliest."""
    core = CarrierCircular(4, **variant)
    model = PysimModel(core, watch=("reg_running",))
    run = model.run(np.array([few_arcs(4, variant["formula"])[0]]), 500)
    # Started in the clock before that in which it runs.
    started = int(np.flatnonzero(run.watch[:, 0])[0]) - 1
    assert started == latency(4, variant["formula"], variant["coefficient"])
    assert core.preparation == started


@pytest.mark.parametrize("variant", [CORRECTED, SERIES], ids=names)
def test_registers_hold_every_flip_flop(variant):
    smt = pytest.importorskip("discreta.sim.smt")
    core = CarrierCircular(4, **variant)
    assert sum(map(len, core.registers.values())) == smt.Rtl(core).flip_flops
    assert list(core.registers) == [
        register.name for group in core.diagram.values() for register in group
    ]
    assert {name: len(register) for name, register in core.registers.items()} == {
        name: bits for name, (bits, _) in GoldenCarrierCircular(4, **variant).registers().items()
    }


def test_settings():
    assert FORMULAS == ("rotation", "predictor_corrector", "plain")
    assert MAX_WIDTH == 16
    assert CarrierCircular.LECTURE == LECTURE
    for core, settings in ((CarrierCircular(), SERIES), (CarrierCircular(16, **LECTURE), LECTURE)):
        PysimModel(core).run(np.empty((0, 10)), 1)  # an unused core is an error
        assert core.parameters == {"width": 16, **settings}


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), CarrierCircular, width)


def test_refuses_other_choices():
    message = "formula is 'cosine': choose 'rotation' or 'predictor_corrector' or 'plain'"
    assert_refused((ValueError, message), CarrierCircular, 8, formula="cosine")
    message = "coefficient is 'cosine': choose 'series' or 'table'"
    assert_refused((ValueError, message), CarrierCircular, 8, coefficient="cosine")
    # Checked where there is none, too.
    assert_refused((ValueError, message), CarrierCircular, 8, formula="plain", coefficient="cosine")
    message = "preload is 'full': choose 'zero' or 'half'"
    assert_refused((ValueError, message), CarrierCircular, 8, preload="full")
