import math
from fractions import Fraction

import numpy as np
import pytest

from discreta.sim.arcs import refusals, swept
from discreta.sim.carrier import (
    MAX_PERIOD,
    add_timing,
    angles,
    arc_periods,
    check_timing,
    least_periods,
    lengths,
    line_periods,
    mean_angle,
    mean_increments,
    most_periods,
)
from discreta.sim.methods import METHODS
from discreta.sim.points import BadInputError

QUARTER = [100, 0, 0, 100, 0, 0, 0, 0]


def random_lines(count, axes=2):
    random = np.random.default_rng(7)
    start = random.integers(-(2**16), 2**16, (count, axes))
    reach = 2 ** random.integers(0, 17, (count, 1))
    return np.hstack([start, start + random.integers(-reach, reach, (count, axes))])


@pytest.mark.parametrize(("speed", "period"), [("1/10", 200), ("1/3", 7), ("22/7", 3), ("1e-3", 9)])
@pytest.mark.parametrize("axes", [2, 3])
def test_a_line_has_the_fewest_periods_that_are_not_faster(speed, period, axes):
    speed, lines = Fraction(speed), random_lines(300, axes)
    for line, periods in zip(lines, line_periods(lines, speed, period), strict=True):
        square = sum(int(delta) ** 2 for delta in line[axes:] - line[:axes])
        assert square <= (periods * speed * period) ** 2
        assert periods == 1 or square > ((periods - 1) * speed * period) ** 2


def test_a_line_that_takes_whole_periods_has_no_other_one():
    """Of 3, 4, 5: a root of a double, a hair too large, would make one more of some."""
    speed = Fraction(1, 3)
    for factor in (1, 7, 3**5, 10**4):
        line, longer = np.array([[[0, 0, 3 * factor + more, 4 * factor]] for more in (0, 1)])
        assert line_periods(line, speed, 3 * 5)[0] == factor
        assert line_periods(longer, speed, 3 * 5)[0] == factor + 1
    assert line_periods(np.array([[5, 6, 5, 6]]), speed, 3)[0] == 1


@pytest.mark.parametrize("radius", [1, 8, 41, 65535])
def test_periods_of_arcs(radius):
    for block, angle in (
        ([radius, 0, 0, radius, 0, 0, 0, 0], math.pi / 2),
        ([radius, 0, 0, radius, 0, 0, 1, 0], 3 * math.pi / 2),
        ([radius, 0, radius, 0, 0, 0, 1, 9], 20 * math.pi),
    ):
        speed, period, arcs = Fraction(1, 9), 100, np.array([block])
        exact = radius * angle * 9 / period
        assert abs(exact - round(exact)) > 1e-6
        assert arc_periods(arcs, speed, period).tolist() == [max(1, math.ceil(exact))]
        assert lengths("arc", arcs)[0] == pytest.approx(radius * angle)
        assert angles(arcs)[0] == pytest.approx(angle)
    assert arc_periods(np.array([[3, 4, 3, 4, 3, 4, 0, 0]]), Fraction(1), 5).tolist() == [1]


def test_an_arc_is_never_too_fast_by_the_rounding_of_its_length():
    """As long as a whole number of periods in doubles, it may be longer than that in truth."""
    arcs = np.array([QUARTER])
    step = Fraction(float(lengths("arc", arcs)[0])) / 8
    assert arc_periods(arcs, step / 10, 10)[0] == 9
    assert arc_periods(arcs, step / 10 * (1 + Fraction(1, 2**40)), 10)[0] == 8


def test_mean_increments_are_rounded_down_as_the_device_does():
    width, lines = 16, random_lines(200)
    random = np.random.default_rng(8)
    for line in lines:
        periods = int(random.integers(1, 2 ** random.integers(1, 24)))
        deltas = (line[2:] - line[:2]).tolist()
        for mean, delta in zip(mean_increments(line, periods, width), deltas, strict=True):
            assert (mean * 2 ** (width + 12)).denominator == 1
            short = abs(Fraction(delta, periods)) - abs(mean)
            assert 0 <= short < Fraction(1, 2 ** (width + 12))
            assert mean * delta >= 0


@pytest.mark.parametrize("width", [8, 16])
def test_mean_angles_are_rounded_down(width):
    one = 2 ** (3 * width + 8)
    clockwise = [*QUARTER[:6], 1, 3]
    for block in (QUARTER, clockwise):
        angle = math.radians(swept(np.array([block]))[0])
        for periods in (4, 77, 9999):
            mean = mean_angle(np.array(block), periods, width)
            assert (mean * one).denominator == 1
            assert 0 <= abs(Fraction(angle)) / periods - abs(mean) < Fraction(1, one)
            assert (mean < 0) == (angle < 0)


def test_the_timing_stands_behind_the_other_fields():
    lines = np.array([[0, 0, 3, 4], [3, 4, 3, 4]])
    timed = add_timing("line", lines, Fraction(1, 2), 4)
    assert timed.tolist() == [[0, 0, 3, 4, 3, 4], [3, 4, 3, 4, 1, 4]]
    checked = check_timing("line", timed, 8, least_period=2)
    assert checked.dtype == np.int64
    assert checked.tolist() == timed.tolist()


def test_how_few_periods_an_arc_may_have():
    """Δφ < ½, and N ≥ (⌊A⌋ + 1)² where the radius grows; with room for how A is measured."""
    half = [100, 0, -100, 0, 0, 0, 0, 0]
    turns = [100, 0, 100, 0, 0, 0, 1, 1]
    point = [3, 4, 3, 4, 3, 4, 0, 0]
    arcs = np.array([QUARTER, half, turns, point])
    assert least_periods(arcs).tolist() == [4, 7, 26, 1]
    for formula in ("plain", "predictor_corrector"):
        assert least_periods(arcs, formula).tolist() == [4, 16, 169, 1]


LINE = [0, 0, 9, 9]


@pytest.mark.parametrize(
    ("kind", "block", "options", "message"),
    [
        ("line", [*LINE, 5, 1], {}, "--period 1: the device takes 2 to 16777215 clocks; choose"),
        ("line", [*LINE, 5, MAX_PERIOD + 1], {}, "--period 16777216: the device takes 2 to"),
        (
            "line",
            [*LINE, 1 << 16, 9],
            {},
            "the line from 0,0 to 9,9 takes 65536 periods: width 8 has room for 65535; raise "
            "--speed or --period",
        ),
        ("line", [*LINE, 10**40, 9], {}, "width 8 has room for 65535; raise --speed"),
        ("arc", [*QUARTER, 1 << 16, 9], {}, "the arc from 100,0 to 0,100 takes 65536 periods"),
        (
            "arc",
            [*QUARTER, 3, 9],
            {"formula": "rotation"},
            "the arc from 100,0 to 0,100 has 1.5708 radians and so needs 4 periods or more with "
            "formula rotation, where it takes 3: too few periods; lower --speed or --period",
        ),
        ("arc", [100, 0, -100, 0, 0, 0, 0, 0, 15, 9], {"formula": "plain"}, "needs 16 periods"),
    ],
)
def test_what_a_device_would_refuse(kind, block, options, message):
    good = [*block[:-2], 30, 9]
    blocks = np.array([good, block, good], dtype=object)
    with pytest.raises(BadInputError) as caught:
        check_timing(kind, blocks, 8, least_period=2, **options)
    assert message in str(caught.value)


def test_limits_are_admitted():
    most = most_periods(8)
    lines = np.array([[*LINE, 1, 2], [*LINE, most, MAX_PERIOD]], dtype=object)
    assert check_timing("line", lines, 8, least_period=2).tolist() == lines.tolist()
    arcs = np.array([[*QUARTER, 4, 2], [*QUARTER, most, 2]], dtype=object)
    for formula in ("rotation", "plain"):
        assert len(check_timing("arc", arcs, 8, least_period=2, formula=formula)) == 2


def random_arcs(width, count):
    """Draw arcs about the origin of any angle that are not refused for their shape."""
    random = np.random.default_rng(9)
    radius = random.integers(1, 2**width - 1, count)
    begin, end = (random.uniform(0, 2 * math.pi, count) for _ in range(2))
    start = np.rint(radius * [np.cos(begin), np.sin(begin)]).T
    far = np.hypot(*start.T)
    points = [start, np.rint(far * [np.cos(end), np.sin(end)]).T, np.zeros((count, 2))]
    arcs = np.column_stack([*points, random.integers(0, 2, (count, 2))]).astype(np.int64)
    return arcs[refusals(arcs, width) == 0]


def faults(golden, blocks):
    """Give what many blocks are answered, each prepared by a device of its own."""
    fields = [f"blocks_{point}_{axis}" for point in ("start", "end", "center") for axis in "xy"]
    fields += [f"blocks_{name}" for name in ("clockwise", "full_turns", "periods", "period")]
    inputs = dict(zip(fields, blocks.T, strict=True)) | {"steps_ready": 1}
    state = {name: np.full(len(blocks), value) for name, value in golden.reset().items()}
    for clock in range(200):
        after = golden.step(state, inputs | {"blocks_valid": int(clock == 0)})
        state = {name: np.broadcast_to(value, len(blocks)) for name, value in after.items()}
        if state["stage"][0] == golden.divided:
            return golden.fault(state)
    raise AssertionError("the angle is not divided")


@pytest.mark.parametrize("formula", ["rotation", "plain"])
@pytest.mark.parametrize("width", [4, 8])
def test_the_device_runs_what_is_admitted(width, formula):
    """And refuses nearly every arc that has a period less."""
    golden = METHODS["carrier_circular"].model(width, formula=formula)
    arcs = random_arcs(width, 2000)
    least = least_periods(arcs, formula)
    for periods, refused in ((least, 0), (least - 1, 0.85)):
        blocks = np.column_stack([arcs, periods, np.full(len(arcs), 400)])
        found = np.mean(faults(golden, blocks) != 0)
        assert found > refused if refused else not found
