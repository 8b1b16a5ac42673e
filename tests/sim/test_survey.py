"""Surveys of small widths against brute force, and of broken devices."""

import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import product
from math import hypot, pi

import numpy as np
import pytest
from amaranth import Signal
from click.testing import CliRunner

from discreta.cli import cli
from discreta.hdl.carrier_linear import CarrierLinear
from discreta.hdl.circular import Circular
from discreta.hdl.contract import ErrorCode
from discreta.hdl.linear import Linear
from discreta.sim import groups as choice
from discreta.sim import survey as module
from discreta.sim.arcs import refusals
from discreta.sim.conics import distance as distance_from_conic
from discreta.sim.conics import random_blocks
from discreta.sim.golden.linear import Linear as GoldenLinear
from discreta.sim.groups import Group, survey_groups
from discreta.sim.methods import METHODS
from discreta.sim.survey import SurveyRow, say_worst, survey
from tests import lecture
from tests.arcs import run_arcs
from tests.conics import conic_steps, first_way, run_conics, velocity
from tests.lines import distance, line_steps

LINES, ARCS, CONICS = METHODS["linear"], METHODS["circular"], METHODS["conic"]
CARRIER = METHODS["carrier_linear"]

#: The arcs' method without normalizer and guard bits: order and preload alone.
PLAIN = replace(ARCS, choices={**ARCS.choices, "normalize": (False,), "guard": (0,)})


@pytest.fixture
def one_process(monkeypatch):
    """Survey in this process, which has what a test has changed."""
    monkeypatch.setattr(
        module, "ProcessPoolExecutor", lambda _, **options: ThreadPoolExecutor(1, **options)
    )


def rows_of(method, width, groups):
    """Give the rows of every group, by the values of the choices."""
    rows = [
        {tuple(variant.values()): SurveyRow(variant, number) for variant in method.variants()}
        for number in range(len(groups))
    ]
    for part in survey(method, width, groups, method.variants()):
        rows[part.group][tuple(part.variant.values())].add(part)
    return rows


def lines_brute_force(normalize, preload):
    """Give the largest error, summations, and steps of the longer axes of all 4-bit lines."""
    largest, summations, longest = 0.0, 0, 0
    for length in product(range(16), repeat=2):
        last = 0
        for t, point in line_steps((0, 0), length, width=4, normalize=normalize, preload=preload):
            largest = max(largest, distance(point, (0, 0), length))
            last = t
        summations += last
        longest += max(length)
    return largest, summations, longest


@pytest.mark.usefixtures("compiled_engine")
def test_every_line_of_4_bits():
    """On all cores, as the command runs it."""
    groups = survey_groups(LINES, 4)
    (rows,) = rows_of(LINES, 4, groups)
    assert len(rows) == 4
    for (normalize, preload), row in rows.items():
        largest, summations, longest = lines_brute_force(normalize, preload)
        assert row.largest_error == pytest.approx(largest, abs=1e-12)
        assert (row.summations, row.length) == (summations, longest)
        assert (row.blocks, row.compared, row.ends_missed, row.completed) == (256, 256, 0, 0)
        assert row.findings == []
        assert row.good
        line, at = (tuple(map(int, text.split(","))) for text in say_worst(LINES, groups[0], row))
        assert distance(at, (0, 0), line) == pytest.approx(largest, abs=1e-12)
        steps = line_steps(
            (0, 0), [abs(c) for c in line], width=4, normalize=normalize, preload=preload
        )
        assert tuple(abs(c) for c in at) in [step for _, step in steps]


def quarter(radius, width, order, preload):
    """Run a quarter arc by x' = −ky, y' = kx with k = 2^−n alone; give the point of every clock."""
    modulus = 2**width
    x, y = radius, 0
    sx = sy = 0 if preload == "zero" else modulus // 2
    for _ in range(3 * modulus):
        if x == 0 and y == radius:
            return
        before = x
        if x > 0:
            carry, sx = divmod(sx + y, modulus)
            x -= carry
        if y < radius:
            carry, sy = divmod(sy + (x if order == "alternated" else before), modulus)
            y += carry
        yield x, y
    raise AssertionError(f"no end of radius {radius} in {3 * modulus} clocks")


@pytest.mark.usefixtures("compiled_engine")
def test_every_quarter_arc_of_5_bits():
    """All four of order and preload, against the sums alone."""
    groups = survey_groups(PLAIN, 5)[:1]
    (rows,) = rows_of(PLAIN, 5, groups)
    assert len(rows) == 4
    for (order, preload, _, _), row in rows.items():
        runs = [list(quarter(radius, 5, order, preload)) for radius in range(1, 32)]
        errors = {
            (radius, point): abs(hypot(*point) - radius)
            for radius, points in enumerate(runs, start=1)
            for point in points
        }
        assert row.largest_error == pytest.approx(max(errors.values()), abs=1e-12)
        worst = int(groups[0].blocks[row.error_index][0])
        x, y = row.error_at
        assert errors[worst, (x, y)] == pytest.approx(row.largest_error, abs=1e-12)
        # Taking half an increment off SX takes a clock.
        halving = 31 if (order, preload) == ("alternated", "half") else 0
        assert row.summations == sum(map(len, runs)) + halving
        assert (row.blocks, row.compared, row.ends_missed, row.completed) == (31, 31, 0, 0)
        assert row.good


@pytest.mark.usefixtures("compiled_engine")
def test_circles_turns_and_arcs_of_5_bits(monkeypatch):
    """Against arcs worked out quadrant by quadrant, to the clock; in one run and in many."""
    monkeypatch.setattr(choice, "_ARCS", 150)
    monkeypatch.setattr(choice, "_TEN_TURNS", 8)
    method = replace(
        PLAIN, choices={**PLAIN.choices, "order": ("alternated",), "preload": ("half",)}
    )
    (variant,) = method.variants()
    groups = survey_groups(method, 5)
    whole = rows_of(method, 5, groups)
    monkeypatch.setattr(module, "_PART", 4096)
    parts = list(survey(method, 5, groups, [variant]))
    assert len(parts) > 2 * len(groups)
    split = [SurveyRow(variant, number) for number in range(len(groups))]
    for part in sorted(parts, key=lambda part: -part.largest_error):
        split[part.group].add(part)
    for group, rows, other in zip(groups, whole, split, strict=True):
        (row,) = rows.values()
        runs = list(run_arcs(group.blocks.tolist(), width=5, **variant))
        errors = [
            max(abs(hypot(*(point - b[4:6])) - hypot(*(b[:2] - b[4:6]))) for _, point in run.steps)
            for run, b in zip(runs, group.blocks, strict=True)
        ]
        assert row.largest_error == pytest.approx(max(errors), abs=1e-12)
        assert row.error_index == np.flatnonzero(np.isclose(errors, max(errors)))[0]
        assert row.error_at in [point for _, point in runs[row.error_index].steps]
        # One answer a block; the last clock is that of the last of them.
        assert row.clocks == runs[-1].answered + 1
        assert (row.blocks, row.compared, row.ends_missed) == (len(runs), len(runs), 0)
        assert row.good
        for name in ("blocks", "compared", "largest_error", "error_index", "error_at"):
            assert getattr(other, name) == getattr(row, name)
        for name in ("ends_missed", "completed", "summations", "findings"):
            assert getattr(other, name) == getattr(row, name)
        assert other.length == pytest.approx(row.length)


@pytest.fixture
def few_conics(monkeypatch):
    monkeypatch.setattr(choice, "_CURVES", 15)
    monkeypatch.setattr(choice, "_TEN_TURNS", 2)


@pytest.mark.usefixtures("compiled_engine", "few_conics")
def test_conics_of_5_bits():
    """Against the sums worked out from their definitions, to the clock."""
    # Of all kinds at once, for fewer runs.
    found = survey_groups(CONICS, 5)
    columns = (
        np.concatenate([getattr(group, name) for group in found])
        for name in ("blocks", "answers", "lengths")
    )
    group = Group("conics", *columns)
    variants = list(CONICS.settings.values())
    rows = list(survey(CONICS, 5, [group], variants))
    assert len(rows) == len(variants)
    for row in rows:
        runs = list(run_conics(group.blocks.tolist(), width=5, **row.variant))
        errors = [
            distance_from_conic(b[:5], b[5:7], np.array([p for _, p in run.steps])).max()
            for run, b in zip(runs, group.blocks, strict=True)
        ]
        assert row.largest_error == pytest.approx(max(errors), abs=1e-9)
        assert row.error_index == np.flatnonzero(np.isclose(errors, max(errors)))[0]
        assert row.error_at in [point for _, point in runs[row.error_index].steps]
        *_, last, most = sorted(errors)
        # So many of the blocks, counted from 0, lie below it.
        share = 0.999 * (len(errors) - 1) - (len(errors) - 2)
        assert row.usual_error == pytest.approx(last + share * (most - last), abs=1e-9)
        assert row.clocks == runs[-1].answered + 1
        # From the clock behind the start to that in which the last step shows.
        assert row.summations == sum(r.steps[-1][0] - r.started - 1 for r in runs)
        assert (row.blocks, row.compared, row.ends_missed) == (len(runs), len(runs), 0)
        assert row.good
        # Parts and budget are shared out by about the clocks that they take; what simultaneous
        # sums lead farther and farther out takes more.
        golden = CONICS.model(5, **row.variant)
        expected = module._CURVES["conic", False].clocks(CONICS, golden, group).sum()
        assert row.clocks > 0.75 * expected
        assert row.clocks < 1.25 * expected or golden.order == "simultaneous"


def completes(block, width):
    """Tell of a block without changes of direction whether nothing moves but what is completed."""
    point, way = block[5:7], first_way(block)
    for _, step in conic_steps(block, width=width):
        speed = velocity(block, point)
        left = [goal - now for goal, now in zip(block[7:9], point, strict=True)]
        if not any(speed[k] * way[k] > 0 and left[k] * way[k] > 0 for k in (0, 1)):
            return True
        point = step
    return False


@pytest.mark.usefixtures("compiled_engine")
def test_completing_steps_of_conics_are_counted(monkeypatch):
    """Those that the definition of the velocities asks for, compared or not."""
    random = np.random.default_rng(5)
    kinds = [random_blocks(kind, 5, 200, random) for kind in ("circle", "ellipse", "hyperbola")]
    blocks = np.concatenate(kinds)
    blocks = blocks[blocks[:, 10] == 0]
    # A step aside, over the vertex and before it.
    blocks[:, 7:9] += random.integers(-1, 2, (len(blocks), 2))
    inside = (np.abs(blocks[:, 7:9]) < 31).all(axis=1)
    blocks = blocks[inside & (blocks[:, 7:9] != blocks[:, 5:7]).any(axis=1)]
    expected = sum(completes(block, 5) for block in blocks.tolist())
    assert 10 < expected < len(blocks) / 2
    group = Group("conics", blocks, np.zeros(len(blocks), dtype=int), np.ones(len(blocks)))
    variant = CONICS.settings["default"]
    for budget in (module.REGISTER_BUDGET, 0):
        monkeypatch.setattr(module, "REGISTER_BUDGET", budget)
        (row,) = survey(CONICS, 5, [group], [variant])
        assert row.completed == expected
        assert row.compared == (row.blocks if budget else 0)
        assert row.good


def group_of(blocks, width):
    """Make a group of arcs, with the answers that are due."""
    blocks = np.array(blocks, dtype=np.int64)
    return Group("arcs", blocks, refusals(blocks, width), np.ones(len(blocks)))


@pytest.mark.usefixtures("compiled_engine")
def test_completing_steps_are_counted():
    """They are taken in just the arcs that wait for ever in the lecture, and in no others."""
    method = replace(ARCS, choices={name: (value,) for name, value in Circular.LECTURE.items()})
    arcs = np.array(list(lecture.degree_arcs()))
    inside = np.unique(arcs[arcs.max(axis=1) < 32], axis=0)
    fates, _ = lecture.run_all(inside, 5, lecture.Reading(order="device"))
    waits = (fates == lecture.FATES.index(lecture.WAITS)) & ~lecture.off_circle(inside)
    group = group_of(np.pad(inside, ((0, 0), (0, 4))), 5)
    ((row,),) = (rows.values() for rows in rows_of(method, 5, [group]))
    assert row.completed == np.count_nonzero(waits) > 2
    assert row.blocks == len(inside) > 500
    assert np.count_nonzero(group.answers) > 2
    assert row.good


@pytest.mark.usefixtures("compiled_engine")
def test_registers_are_compared_in_a_sample_when_there_are_too_many_clocks(monkeypatch):
    method = replace(LINES, choices={"normalize": (True,), "preload": ("half",)})
    groups = survey_groups(LINES, 4)
    ((everything,),) = (rows.values() for rows in rows_of(method, 4, groups))
    # A line of 4 bits takes up to 20 clocks.
    monkeypatch.setattr(module, "REGISTER_BUDGET", 1000)
    parts = list(survey(method, 4, groups, method.variants()))
    assert sorted(part.compared == part.blocks for part in parts) == [False, True]
    row = SurveyRow(method.variants()[0], 0)
    for part in parts:
        row.add(part)
    assert 50 <= row.compared < 256
    assert replace(row, compared=256, clocks=0) == replace(everything, clocks=0)
    again = list(survey(method, 4, groups, method.variants()))
    assert sum(part.compared for part in again) == row.compared


def broken(monkeypatch, method, device, **values):
    """Make a method of a broken device or golden model, in place of the sound one."""
    other = {"golden": device} if hasattr(device, "step") else {"device": device}
    choices = {**{name: value[:1] for name, value in method.choices.items()}, **values}
    changed = replace(method, name=device.__name__, choices=choices, **other)
    monkeypatch.setitem(METHODS, changed.name, changed)
    return changed


def row_of(method, width, groups):
    ((row,),) = (rows.values() for rows in rows_of(method, width, groups))
    return row


class Wrong(Linear):
    """Starts its summators from the other preload."""

    def __init__(self, width, axes, *, normalize, preload):
        other = {"zero": "half", "half": "zero"}[preload]
        super().__init__(width, axes, normalize=normalize, preload=other)


@pytest.mark.usefixtures("compiled_engine", "one_process")
@pytest.mark.parametrize(("preload", "seen", "right"), [("half", 0, 8), ("zero", 8, 0)])
def test_a_broken_device_is_reported(monkeypatch, preload, seen, right):
    groups = survey_groups(LINES, 4)
    row = row_of(broken(monkeypatch, LINES, Wrong, preload=(preload,)), 4, groups)
    assert not row.good
    line = groups[0].blocks[0].tolist()
    register, *above = row.findings
    assert register == (
        f"sx is {seen} in clock 0 of the line {line}, where the golden model has {right}"
    )
    # Preload zero leads farther off than is proven of preload half.
    assert [finding.endswith("where 0.7071 is proven") for finding in above] == [True] * (not seen)
    # It is judged by what it did: as the other preload.
    other = {"zero": "half", "half": "zero"}[preload]
    assert row.largest_error == pytest.approx(lines_brute_force(True, other)[0], abs=1e-12)


class Upright(Linear):
    """Moves along y alone."""

    def elaborate(self, platform):
        m = super().elaborate(platform)
        m.d.comb += self.input.blocks.payload.end.x.eq(self.blocks.payload.start.x)
        return m


@pytest.mark.usefixtures("compiled_engine", "one_process")
def test_ends_that_are_missed_are_counted(monkeypatch):
    row = row_of(broken(monkeypatch, LINES, Upright), 4, survey_groups(LINES, 4))
    assert not row.good
    # All lines but those that are upright anyway.
    assert (row.blocks, row.ends_missed) == (256, 240)
    register, above = row.findings
    assert "where the golden model has" in register
    assert above.startswith("the error is 10.6066 at ")
    # The corner (0, 15) is that far from the line to (15, 15).
    assert row.largest_error == pytest.approx(15 / 2**0.5)


def amend(part, change):
    """Let ``change`` have the last word when the part describes its hardware."""
    elaborate = part.elaborate

    def amended(platform):
        m = elaborate(platform)
        change(m)
        return m

    part.elaborate = amended


def few(method, width, count):
    """Give some blocks of every group, the first of bad timing with them."""
    for group in survey_groups(method, width):
        first = int(np.flatnonzero(group.answers)[0])
        chosen = slice(max(0, first - count // 2), first + count)
        parts = {name: getattr(group, name)[chosen] for name in ("blocks", "answers", "lengths")}
        yield replace(group, **parts)


@pytest.mark.usefixtures("compiled_engine", "one_process")
def test_a_carrier(monkeypatch):
    """Every register equal, every block judged, and worst where the line's own formula has it."""
    groups = list(few(CARRIER, 5, 40))
    (group,) = groups
    row = row_of(broken(monkeypatch, CARRIER, CarrierLinear, preload=("zero",)), 5, groups)
    assert row.good
    assert (row.compared, row.completed) == (len(group.blocks), 0)
    assert 0 < np.count_nonzero(group.answers) == row.blocks - len(row.block_errors)
    errors = []
    for *line, periods, _ in group.blocks[group.answers == 0].tolist():
        start, end = line[:2], line[2:]
        length = [b - a for a, b in zip(start, end, strict=True)]
        off = [0.0]
        for i in range(periods):
            moved = [(abs(delta) * 2**17 // periods * i) >> 17 for delta in length]
            signs = [np.sign(delta) for delta in length]
            point = [a + s * m for a, s, m in zip(start, signs, moved, strict=True)]
            off.append(distance(point, start, end))
        errors.append(max(off))
    np.testing.assert_allclose(row.block_errors, errors, atol=1e-9)
    assert row.largest_error == pytest.approx(max(errors))
    line, point = say_worst(CARRIER, group, row)
    assert re.fullmatch(r"-?\d+,-?\d+ in \d+ periods", line)
    assert re.fullmatch(r"-?\d+,-?\d+", point)


class Hasty(CarrierLinear):
    """Runs what has no time to run."""

    def elaborate(self, platform):
        def change(m):
            m.d.comb += self.uu.fault.eq(0)

        m = super().elaborate(platform)
        change(m)
        return m


@pytest.mark.usefixtures("compiled_engine", "one_process")
def test_a_bad_timing_that_is_run_is_reported(monkeypatch):
    (group,) = few(CARRIER, 5, 9)
    row = row_of(broken(monkeypatch, CARRIER, Hasty, preload=("half",)), 5, [group])
    assert row.ends_missed > 0
    assert row.findings


class Late(Linear):
    """Changes a register that nobody needs any more, behind its last block."""

    def elaborate(self, platform):
        inp, late = self.input, Signal()

        def change(m):
            with m.If(self.uu.running & ~inp.pending_register & ~self.blocks.valid & ~late):
                m.d.sync += [late.eq(1), inp.delta_registers["x"].eq(5)]

        amend(inp, change)
        return super().elaborate(platform)


@pytest.mark.usefixtures("compiled_engine", "one_process")
def test_one_register_in_one_late_clock_is_seen(monkeypatch):
    (group,) = survey_groups(LINES, 4)
    kept = {name: getattr(group, name)[:-1] for name in ("blocks", "answers", "lengths")}
    row = row_of(broken(monkeypatch, LINES, Late), 4, [replace(group, **kept)])
    # The last line that moves, (15, 15), is accepted in the clock in which the one before it, (15,
    # 14), first sums. That sums 16 times; in the clock after these its last step leaves and the
    # last line is started, in the next one it runs, and behind that the register is another.
    line = kept["blocks"][-1].tolist()
    assert row.findings == [
        f"delta_x is 5 in clock 18 of the line {line}, where the golden model has 15"
    ]
    assert row.ends_missed == 0
    assert row.clocks > 3000
    assert row.largest_error == pytest.approx(lines_brute_force(True, "half")[0], abs=1e-12)


class Dead(Linear):
    """Starts no block."""

    def elaborate(self, platform):
        def change(m):
            m.d.comb += self.uu.start.eq(0)

        amend(self.uu, change)
        return super().elaborate(platform)


@pytest.mark.usefixtures("compiled_engine", "one_process")
def test_a_dead_device_is_given_up(monkeypatch):
    row = row_of(broken(monkeypatch, LINES, Dead), 4, survey_groups(LINES, 4))
    assert (row.blocks, row.ends_missed, row.summations) == (256, 256, 0)
    difference, given_up = row.findings
    assert re.fullmatch(r"p3 is .* of the line \[.*\], where the golden model has .*", difference)
    assert re.fullmatch(
        r"0 of 256 blocks are answered after \d+ clocks, where \d+ must do", given_up
    )


class Odd(GoldenLinear):
    """Turns the direction of x after every block."""

    def step(self, state, inputs):
        after = super().step(state, inputs)
        return after | {"direction_x": after["direction_x"] ^ after["done"]}


@pytest.mark.usefixtures("compiled_engine", "one_process")
def test_a_golden_model_with_other_numbers_is_reported(monkeypatch):
    row = row_of(broken(monkeypatch, LINES, Odd), 4, survey_groups(LINES, 4))
    (finding,) = row.findings
    # The first line is of no length: accepted, started, done.
    assert finding.startswith("direction_x is ")
    assert " in clock 0 of the line " in finding
    assert row.ends_missed == 0
    assert not row.good


class Lenient(Circular):
    """Refuses no arc whose end is off its circle."""

    def elaborate(self, platform):
        m = super().elaborate(platform)
        m.d.comb += self.uu.fault.eq(ErrorCode.NONE)
        return m


@pytest.mark.usefixtures("compiled_engine", "one_process")
def test_arcs_that_must_be_refused_and_are_not(monkeypatch):
    device = broken(monkeypatch, PLAIN, Lenient)
    # Three steps out at their end: X comes to 0 and completing steps lead on to it.
    group = group_of([[3, 0, 0, 3, 0, 0, 0, 0], [3, 0, 0, 6, 0, 0, 0, 0]], 5)
    assert group.answers.tolist() == [0, 2]
    row = row_of(device, 5, [group])
    assert row.ends_missed == 1
    (finding,) = row.findings
    assert finding.endswith(", where the golden model has 0")
    assert " of the arc [3, 0, 0, 6, 0, 0, 0, 0]" in finding


class Strict(Circular):
    """Refuses every arc."""

    def elaborate(self, platform):
        m = super().elaborate(platform)
        m.d.comb += self.uu.fault.eq(ErrorCode.OFF_CURVE)
        return m


@pytest.mark.usefixtures("compiled_engine", "one_process")
def test_arcs_that_are_refused_and_must_not_be(monkeypatch):
    row = row_of(broken(monkeypatch, PLAIN, Strict), 5, survey_groups(PLAIN, 5)[:1])
    assert (row.blocks, row.ends_missed) == (31, 31)


@pytest.mark.usefixtures("compiled_engine", "one_process")
def test_an_error_above_the_proven_bound_is_reported(monkeypatch):
    """As if the lecture's arcs and lines were promised to be exact."""
    monkeypatch.setattr(module, "REGISTER_BUDGET", 0)
    exact = METHODS["exact_arc"]
    arcs = replace(
        exact, device=Circular, clocks=lambda golden, blocks: 9 * exact.clocks(golden, blocks)
    )
    for method, bound in ((arcs, 0.5), (LINES, 0.69)):
        choices = {name: values[:1] for name, values in method.choices.items()}
        changed = replace(method, name="Worse", choices=choices, bound=lambda _, most=bound: most)
        monkeypatch.setitem(METHODS, "Worse", changed)
        row = row_of(changed, 6, survey_groups(method, 6)[:1])
        assert row.largest_error > bound
        assert not row.good
        assert not row.ends_missed
        said = rf"the error is {row.largest_error:.4f} at -?\d+,-?\d+, where {bound:.4f} is proven"
        assert [re.fullmatch(said, finding) is None for finding in row.findings] == [False]


def test_parts_of_a_row_add_up():
    row = SurveyRow({}, 0, blocks=2, clocks=30, largest_error=0.5, error_index=4, error_at=(1, 2))
    row.add(SurveyRow({}, 0, blocks=1, clocks=9, largest_error=0.7, error_index=9, error_at=(5, 6)))
    row.add(SurveyRow({}, 0, summations=3, largest_error=0.6, error_index=1, error_at=(9, 9)))
    # Of equal errors that of the first block.
    row.add(SurveyRow({}, 0, length=1.5, largest_error=0.7, error_index=7, error_at=(7, 8)))
    row.add(SurveyRow({}, 0, compared=1, largest_error=0.7, error_index=8, error_at=(3, 4)))
    assert row == SurveyRow(
        {},
        0,
        blocks=3,
        compared=1,
        clocks=39,
        largest_error=0.7,
        error_index=7,
        error_at=(7, 8),
        summations=3,
        length=1.5,
    )
    assert row.good
    assert row.usual_error == 0
    row.add(SurveyRow({}, 0, block_errors=np.arange(600, 1001)))
    row.add(SurveyRow({}, 0, block_errors=np.arange(600)))
    assert row.usual_error == 999
    row.add(SurveyRow({}, 0, ends_missed=1))
    assert not row.good
    assert not SurveyRow({}, 0, findings=["p1 is 3"]).good


def test_the_worst_of_a_row_as_a_table_has_it():
    arcs = group_of([[3, 4, -5, 0, 0, 0, 0, 0], [5, 6, 7, 8, 6, 7, 1, 0]], 5)
    row = SurveyRow({}, 0, error_at=(0, 5))
    assert say_worst(ARCS, arcs, row) == ("3,4 to -5,0", "0,5")
    row = replace(row, error_index=1)
    assert say_worst(ARCS, arcs, row) == ("5,6 to 7,8 about 6,7 cw", "0,5")
    lines = Group("lines", np.array([[3, 4, 1, 9]]), np.zeros(1), np.zeros(1))
    assert say_worst(LINES, lines, SurveyRow({}, 0, error_at=(2, 6))) == ("-2,5", "-1,2")
    curves = np.array([[0, 1, 0, 0, -2, 2, 5, 3, 4, 0, 1], [1, 0, 1, 0, 0, 7, 0, 7, 0, 1, 39]])
    conics = Group("conics", curves, np.zeros(2), np.zeros(2))
    row = SurveyRow({}, 0, error_at=(0, 5))
    assert say_worst(CONICS, conics, row) == ("0,1,0,0,-2 from 2,5 to 3,4", "0,5")
    row = replace(row, error_index=1)
    assert say_worst(CONICS, conics, row)[0] == "1,0,1,0,0 from 7,0 to 7,0 cw, 10 turns"


@pytest.mark.usefixtures("compiled_engine")
def test_the_command(monkeypatch):
    monkeypatch.setattr(choice, "_ARCS", 20)
    method = replace(PLAIN, choices={**PLAIN.choices, "order": ("alternated",)})
    monkeypatch.setitem(METHODS, "circular", method)
    result = CliRunner().invoke(cli, ["survey", "circular", "--width", "5"])
    assert result.exit_code == 0
    lines = result.output.splitlines()
    titles = [line for line in lines if line.startswith("circular, width 5: ")]
    assert titles == [
        f"circular, width 5: {what}, every register compared"
        for what in (
            "all 31 quarter arcs",
            "all 30 circles",
            "ten turns of 30 circles",
            "a sample (seed 1970) of 20 arcs",
        )
    ]
    assert re.split(r"  +", lines[1].strip()) == [
        *("variant", "largest error", "99.9 %", "on the arc", "at", "clocks/step"),
        *("ends missed", "completed"),
    ]
    assert len(lines) == 4 * (2 + 2) + 1
    for line, variant in zip(lines[2:4], method.variants(), strict=True):
        name, largest, usual, arc, _, clocks, missed, completed = re.split(r"  +", line.strip())
        assert name == (
            f"order {variant['order']}, preload {variant['preload']}, no normalize, guard 0"
        )
        errors = {
            radius: max(
                abs(hypot(*at) - radius)
                for at in quarter(radius, 5, variant["order"], variant["preload"])
            )
            for radius in range(1, 32)
        }
        assert largest == f"{max(errors.values()):.4f}"
        last, most = sorted(errors.values())[-2:]
        assert usual == f"{most - 0.03 * (most - last):.4f}"
        radius = int(arc.split(",")[0])
        assert arc == f"{radius},0 to 0,{radius}"
        assert errors[radius] == pytest.approx(max(errors.values()), abs=1e-12)
        # The 32 of a radian by the √2 R / (π R / 2) of a step.
        assert float(clocks) > 2
        assert (missed, completed) == ("0", "0")


@pytest.mark.usefixtures("compiled_engine", "few_conics")
def test_the_command_with_conics(monkeypatch):
    kinds = ("line", "hyperbola")
    monkeypatch.setattr(choice, "KINDS", kinds)
    result = CliRunner().invoke(cli, ["survey", "conic", "--width", "5", "--setting", "default"])
    assert result.exit_code == 0
    *tables, _ = result.output.splitlines()
    titles, heads, rows = tables[::3], tables[1::3], tables[2::3]
    whats = [*(f"a sample (seed 1970) of 15 {kind}s" for kind in kinds), "ten turns of 2 ellipses"]
    assert titles == [f"conic, width 5: {what}, every register compared" for what in whats]
    assert re.split(r"  +", heads[0].strip()) == [
        *("variant", "largest error", "99.9 %", "on the conic", "at", "clocks/step"),
        *("ends missed", "completed"),
    ]
    # An ellipse has the scale of its steepest place all round: 2π·p instead of 4·√(p² + q²).
    for row, slow in zip(rows, (1, pi / 2, pi / 2), strict=True):
        name, largest, usual, _, _, clocks, missed, _ = re.split(r"  +", row.strip())
        assert name == "order implicit, preload half, guard 2"
        assert 0.5 < float(usual) <= float(largest) < 2
        # 4 to 8, in the mean 4 / ln 2, and a clock for every change of direction.
        assert 4 < float(clocks) < 8 * slow
        assert missed == "0"


@pytest.mark.usefixtures("compiled_engine", "one_process")
def test_the_command_fails_when_an_end_is_missed_or_a_register_differs(monkeypatch):
    broken(monkeypatch, LINES, Upright)
    result = CliRunner().invoke(cli, ["survey", "Upright", "--width", "4"])
    assert result.exit_code == 1
    assert re.search(r"^normalize, preload half .* 240$", result.output, flags=re.MULTILINE)
    assert re.search(r"^normalize, preload half: \w+ is ", result.stderr, flags=re.MULTILINE)
    monkeypatch.setattr(module, "REGISTER_BUDGET", 1000)
    broken(monkeypatch, LINES, Odd)
    result = CliRunner().invoke(cli, ["survey", "Odd", "--width", "4"])
    assert result.exit_code == 1
    title, head, row, *_ = result.output.splitlines()
    assert title == "Odd, width 4: all 256 lines, registers of some (seed 1970) compared"
    assert re.split(r"  +", head.strip())[-2:] == ["ends missed", "compared"]
    assert re.split(r"  +", row.strip())[-2] == "0"
    assert 50 <= int(re.split(r"  +", row.strip())[-1]) < 256


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["linear", "--whole-degrees"], "there are no lines between whole degrees"),
        (["circular", "--width", "7", "--whole-degrees"], "choose a width from 8"),
        (["circular", "--width", "17"], "choose a width up to 16"),
        (["conic", "--whole-degrees"], "there are no conics between whole degrees"),
        (["conic", "--width", "17"], "choose a width up to 16"),
    ],
)
def test_what_cannot_be_surveyed(words, message):
    result = CliRunner().invoke(cli, ["survey", *words])
    assert isinstance(result.exception, ValueError)
    assert message in str(result.exception)
