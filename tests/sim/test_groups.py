"""Which blocks a survey has: as many as said, all of them different, and the same every time."""

import re
from math import hypot, pi, sqrt

import numpy as np
import pytest

from discreta.sim import groups
from discreta.sim.arcs import RANGE
from discreta.sim.conics import KINDS, motion
from discreta.sim.groups import SAMPLE_BUDGET, SEED, WHOLE_BUDGET, survey_groups, whole_degrees
from discreta.sim.methods import METHODS
from tests import lecture
from tests.arcs import fault, on_curve, quadrant_after, seen
from tests.conics import derivatives

LINES, ARCS, CONICS = METHODS["linear"], METHODS["circular"], METHODS["conic"]
EXACT_ARCS, EXACT_CONICS = METHODS["exact_arc"], METHODS["exact_conic"]


@pytest.mark.parametrize("width", [4, 8, 9, 10, 19])
def test_lines(width):
    (group,) = survey_groups(LINES, width)
    modulus = 2**width
    exhaustive = width <= 9
    count = modulus**2 if exhaustive else min(1 << 16, SAMPLE_BUDGET // modulus)
    some = "all" if exhaustive else f"a sample (seed {SEED}) of"
    assert group.title == f"{some} {count} lines"
    assert group.blocks.shape == (count, 4)
    lengths = np.abs(group.blocks[:, 2:] - group.blocks[:, :2])
    assert lengths.max() < modulus
    assert group.blocks.min() >= -modulus
    assert group.blocks.max() < modulus
    if exhaustive:
        assert len(np.unique(lengths, axis=0)) == modulus**2
        # The line of no length is behind one that moves.
        assert lengths[-2:].tolist() == [[modulus - 1, modulus - 1], [0, 0]]
    else:
        assert lengths.max() > 0.9 * modulus
    # Every quadrant, and starts on either side.
    for column in range(2):
        assert {-1, 1} <= set(np.sign(group.blocks[:, 2 + column] - group.blocks[:, column]))
        assert {-1, 1} <= set(np.sign(group.blocks[:, column]))
    np.testing.assert_array_equal(group.lengths, lengths.max(axis=1))
    assert not group.answers.any()


TIMED = [method for method in METHODS.values() if method.timed]


@pytest.mark.parametrize("method", TIMED, ids=lambda method: method.name)
@pytest.mark.parametrize("width", [4, 8, 11])
def test_blocks_on_a_carrier(method, width):
    models = [method.model(width, **variant) for variant in method.variants()]
    least = max(model.least_period for model in models)
    for group in survey_groups(method, width):
        blocks, period = group.blocks, group.blocks[:, -1]
        good = group.answers == 0
        assert set(group.answers[~good]) == {RANGE}
        assert re.fullmatch(
            rf"(all|a sample \(seed {SEED}\) of) {sum(good)} (lines|quarter arcs|circles|arcs), "
            "and 64 of bad timing",
            group.title,
        )
        assert np.count_nonzero(~good) == 64
        assert not group.lengths[~good].any()
        # What is refused follows the same block.
        behind = np.flatnonzero(~good)
        shapes = blocks[:, :-2]
        alike = (shapes[behind] == shapes[behind - 1]).all(axis=1)
        assert alike.all()
        bad = blocks[~good]
        assert np.all((bad[:, -2] == 0) | (bad[:, -1] < 2) | (bad[:, -2] == 1))
        blocks, period, lengths = blocks[good], period[good], group.lengths[good]
        assert (period.min(), period.max()) >= (least, least)
        assert period.max() <= least + 64
        assert np.sum(blocks[:, -2] * period) <= SAMPLE_BUDGET
        if method.curve == "line":
            steps = lengths / blocks[:, -2]
            assert steps.max() <= 20
            assert steps[lengths > 9].min() > 0.28
        else:
            start, end = blocks[:, :2] - blocks[:, 4:6], blocks[:, 2:4] - blocks[:, 4:6]
            way = np.where(blocks[:, 6] == 1, -1, 1)
            phi = way * (np.arctan2(*end.T[::-1]) - np.arctan2(*start.T[::-1]))
            phi = np.where(phi > 1e-9, phi, phi + 2 * pi)
            assert np.all(phi / blocks[:, -2] < 0.5)
            assert np.all(blocks[:, -2] >= (np.floor(phi) + 1) ** 2)
            assert np.all(blocks[:, -2] >= np.hypot(*start.T) * phi / 20 - 1e-9)


@pytest.mark.parametrize("method", TIMED, ids=lambda method: method.name)
def test_blocks_on_a_carrier_that_would_take_too_long(method):
    with pytest.raises(ValueError, match=r"^width 12 is too large .* choose a width up to 11$"):
        survey_groups(method, 12)


@pytest.fixture
def few_conics(monkeypatch):
    """Have few curves, for what does not depend on their number."""
    monkeypatch.setattr(groups, "_CURVES", 300)
    monkeypatch.setattr(groups, "_TEN_TURNS", 3)


@pytest.mark.usefixtures("few_conics")
@pytest.mark.parametrize("method", [LINES, ARCS, CONICS, *TIMED])
def test_the_same_every_time(method):
    for group, again in zip(survey_groups(method, 10), survey_groups(method, 10), strict=True):
        assert group.title == again.title
        np.testing.assert_array_equal(group.blocks, again.blocks)


@pytest.mark.parametrize("width", [4, 8, 12])
def test_quarter_arcs_and_circles_of_all_radii(width):
    quarters, circles, turns, _ = survey_groups(ARCS, width)
    # A circle's axes may rise to R + 1.
    top = 2**width - 1
    assert quarters.title == f"all {top} quarter arcs"
    assert quarters.blocks.tolist() == [[r, 0, 0, r, 0, 0, 0, 0] for r in range(1, top + 1)]
    assert circles.title == f"all {top - 1} circles"
    assert circles.blocks.tolist() == [[r, 0, r, 0, 0, 0, 0, 0] for r in range(1, top)]
    count = min(32, top - 1)
    assert turns.title == f"ten turns of {count} circles"
    radii = turns.blocks[:, 0]
    assert turns.blocks.tolist() == [[r, 0, r, 0, 0, 0, 0, 9] for r in radii.tolist()]
    assert (len(radii), radii[0], radii[-1]) == (count, 1, top - 1)
    # Evenly spread.
    assert np.ptp(np.diff(radii)) <= 1
    assert np.diff(radii).min() > 0
    for group, angle in ((quarters, 1), (circles, 4), (turns, 40)):
        assert not group.answers.any()
        # In an octant the faster axis goes as far as R·sin 45°.
        np.testing.assert_allclose(group.lengths, sqrt(2) * angle * group.blocks[:, 0])


@pytest.mark.parametrize("width", [12, 13, 16])
def test_what_would_take_too_long_is_a_sample(width):
    clocks = pi / 2 * 2 ** (width + 2)  # of a quarter arc with two guard bits and no normalizer
    for group, angle, what in zip(
        survey_groups(ARCS, width), (1, 4, 40), ("quarter arcs", "circles", ""), strict=False
    ):
        radii = group.blocks[:, 0]
        assert np.diff(radii).min() > 0
        whole = 2**width - 1 if angle == 1 else 2**width - 2
        if what and whole * angle * clocks < WHOLE_BUDGET:
            assert group.title == f"all {whole} {what}"
        elif what:
            assert group.title == f"a sample (seed {SEED}) of {len(radii)} {what}"
            assert radii[0] < whole / 4
            assert radii[-1] > 3 * whole / 4
        if len(radii) < whole:
            assert angle * clocks * len(radii) <= SAMPLE_BUDGET
        assert len(radii) >= 2


@pytest.mark.parametrize("width", [4, 8, 16])
def test_arcs_of_all_kinds(width):
    *_, group = survey_groups(ARCS, width)
    blocks = group.blocks.tolist()
    assert group.title == f"a sample (seed {SEED}) of {len(blocks)} arcs"
    assert len(blocks) == {4: 1024, 8: 1024, 16: 40}[width]
    assert not group.answers.any()
    kinds = set()
    for block in blocks:
        assert fault(block, width) == 0
        assert all(-(2**width) <= value < 2**width for value in block[:6])
        start, end = seen(block)
        # The end is nearest to the circle of the start.
        assert abs(hypot(*start) - hypot(*end)) <= sqrt(0.5)
        kinds.add((quadrant_after(start), block[6]))
    assert len(kinds) == 8
    assert np.unique(group.blocks[:, 4:6], axis=0).shape[0] > len(blocks) / 4


def test_steps_of_the_faster_axis():
    """Against the same walked in small steps."""
    *_, group = survey_groups(ARCS, 8)
    for block, length in zip(group.blocks[:40].tolist(), group.lengths[:40], strict=True):
        (x, y), (u, v) = seen(block)
        begin = np.arctan2(y, x)
        angle = (np.arctan2(v, u) - begin) % (2 * pi) or 2 * pi
        walked = np.exp(1j * (begin + np.linspace(0, angle, 20_001))) * hypot(x, y)
        moves = np.diff(walked)
        faster = np.maximum(np.abs(moves.real), np.abs(moves.imag)).sum()
        assert length == pytest.approx(faster, rel=1e-3)


def kind_of(block):
    """Tell the kind of a curve by its coefficients."""
    a, b, c = block[:3]
    if (a, b, c) == (0, 0, 0):
        return "line"
    if a == c and b == 0:
        return "circle"
    return {1: "ellipse", 0: "parabola", -1: "hyperbola"}[np.sign(4 * a * c - b * b)]


def test_a_hundred_thousand_conics_of_12_bits(monkeypatch):
    monkeypatch.setattr(groups, "_TEN_TURNS", 1)
    *kinds, _ = survey_groups(CONICS, 12)
    assert len(kinds) == len(KINDS)
    assert sum(len(group.blocks) for group in kinds) >= 100_000
    for kind, group in zip(KINDS, kinds, strict=True):
        assert group.title == f"a sample (seed {SEED}) of {len(group.blocks)} {kind}s"
        assert group.blocks.shape == (len(group.lengths), 11)
        assert not group.answers.any()
        # Of a thousand ellipses some are round when their coefficients are whole.
        found = {kind_of(block) for block in group.blocks[::20].tolist()}
        assert found - ({"circle"} if kind == "ellipse" else set()) == {kind}
        assert len(np.unique(group.blocks, axis=0)) > 0.99 * len(group.blocks)
        assert np.abs(group.blocks[:, 5:9]).max() > 0.99 * 2**12
        assert set(group.blocks[:, 9]) == {0, 1}


def of_ellipse(block):
    """Give the semi-axes and extents along x and y of an ellipse, and along the diagonals.

    Of u·S⁻¹·u = 1 the extent along a unit vector n is √(n·S·n).
    """
    a, b, c, d, e, x, y = map(float, block[:7])
    curl = 4 * a * c - b * b
    center = np.array([b * e - 2 * c * d, b * d - 2 * a * e]) / curl
    u, v = (x, y) - center
    size = (a * u * u + b * u * v + c * v * v) * 2 / curl
    p, r, q = size * 2 * c, -size * b, size * 2 * a
    axes = np.sqrt(np.linalg.eigvalsh([[p, r], [r, q]]))
    return axes, np.sqrt([p, q]), np.sqrt([p + q + 2 * r, p + q - 2 * r]), center


@pytest.mark.parametrize("width", [4, 12])
def test_ten_turns_of_ellipses(monkeypatch, width):
    monkeypatch.setattr(groups, "_CURVES", 10)
    monkeypatch.setattr(groups, "_TEN_TURNS", 12)
    *_, group = survey_groups(CONICS, width)
    blocks = group.blocks.tolist()
    assert group.title == "ten turns of 12 ellipses"
    assert len(blocks) == 12
    assert not group.answers.any()
    ratios, turned = [], []
    for block, length in zip(blocks, group.lengths, strict=True):
        assert kind_of(block) in ("ellipse", "circle")
        assert block[5:7] == block[7:9]
        # Of those at the start, on an axis, the first is no change.
        assert block[10] == 40 - (0 in derivatives(block, block[5:7]))
        (shorter, longer), extents, diagonals, center = of_ellipse(block)
        assert shorter**2 / longer > 2
        assert np.all(np.abs(center) + extents < 2**width - 1)
        ratios.append(longer / shorter)
        turned.append(np.ptp(diagonals) / longer)
        # From diagonal to diagonal tangent the same axis is faster: 2·(√(n·S·n) + √(m·S·m)).
        assert length == pytest.approx(10 * 2 * diagonals.sum())
    # Up to √(longer / 3), by the logarithm.
    assert min(ratios) < {4: 1.2, 12: 3}[width]
    assert max(ratios) > {4: 1.5, 12: 20}[width]
    assert max(turned) > 0.3
    assert {block[9] for block in blocks} == {0, 1}


def test_conics_that_would_take_too_long_are_a_sample(monkeypatch):
    monkeypatch.setattr(groups, "_TEN_TURNS", 12)
    *kinds, turns = survey_groups(CONICS, 14)
    # Half of 2^-2 of a step of the steepest place a clock.
    clocks = []
    for group in (*kinds, turns):
        course = motion(group.blocks)
        np.testing.assert_array_equal(group.lengths, course.steps)
        clocks.append(8 * np.fmax(course.steps, course.time * course.largest).sum())
    for group, taken in zip(kinds, clocks, strict=False):
        if len(group.blocks) == 20_000:
            assert taken <= WHOLE_BUDGET
        else:
            assert 0.9 * SAMPLE_BUDGET < taken <= SAMPLE_BUDGET
    assert 0 < sum(len(group.blocks) == 20_000 for group in kinds) < 5
    assert turns.title == f"ten turns of {len(turns.blocks)} ellipses"
    # Ten turns of 2^14 steps of radius are up to 40·√2·2^14 steps.
    assert len(turns.blocks) < 12
    assert 1 - 8 * 40 * sqrt(2) * 2**14 / SAMPLE_BUDGET < clocks[-1] / SAMPLE_BUDGET <= 1


def test_all_whole_degrees():
    blocks = groups._first_quadrant(groups._degree_points())
    np.testing.assert_array_equal(blocks[:, :4], list(lecture.degree_arcs()))
    assert not blocks[:, 4:].any()


#: A few of the radii, and of the arcs all round as many of each as there are.
RADII, STRIDE = range(2, 200, 33), 181


@pytest.fixture(scope="module")
def degrees():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(groups, "_RADII", RADII)
        patch.setattr(groups, "_STRIDE", STRIDE)
        return whole_degrees(ARCS, 8)


def test_whole_degrees_in_the_first_quadrant(degrees):
    first = degrees[0]
    assert first.title == f"all {len(first.blocks)} arcs in quadrant I, counter-clockwise"
    arcs = first.blocks[:, :4]
    assert set(arcs[arcs[:, 1] == 0, 0]) == set(RADII)
    assert 0.95 * len(RADII) * 4095 < len(arcs) < len(RADII) * 4095
    # Refused just when the end is off the circle by more than a step.
    np.testing.assert_array_equal(first.answers, np.where(lecture.off_circle(arcs), 2, 0))
    assert not first.lengths[first.answers != 0].any()


def test_whole_degrees_turned_to_all_quadrants(degrees):
    first, turned, _ = degrees
    np.testing.assert_array_equal(first.answers, turned.answers)
    np.testing.assert_allclose(first.lengths, turned.lengths)
    kinds = set()
    for number, (block, image) in enumerate(
        zip(first.blocks[:7000].tolist(), turned.blocks[:7000].tolist(), strict=True)
    ):
        # Of the eight ways to lay a square onto itself, all but the one that changes nothing.
        way, mirrored = (number % 7 + 1) % 4, (number % 7 + 1) // 4
        for k in (0, 2):
            x, y = block[k], -block[k + 1] if mirrored else block[k + 1]
            at = complex(x, y) * 1j**way
            assert image[k : k + 2] == [at.real, at.imag]
        assert image[4:] == [0, 0, mirrored, 0]
        if image[0] * image[1]:
            kinds.add((quadrant_after((image[0], image[1])), mirrored))
    assert len(kinds) == 7


def test_whole_degrees_all_round(degrees):
    group = degrees[2]
    count = len(group.blocks)
    assert group.title == f"all {count} arcs all round, every {STRIDE}th there is"
    # From 360 degrees by 360 in two directions; without those of a single point.
    assert 0.98 < count / (len(RADII) * 360 * 360 * 2 / STRIDE) < 1
    for block, answer in zip(group.blocks[::7].tolist(), group.answers[::7], strict=True):
        assert answer == (0 if on_curve(block) else 2)
    assert set(group.blocks[:, 6]) == {0, 1}
    starts = {quadrant_after((x, y)) for x, y in group.blocks[:, :2].tolist()}
    assert len(starts) == 4
    # Full turns: one sweep of 360.
    full = np.all(group.blocks[:, :2] == group.blocks[:, 2:4], axis=1)
    assert 0.3 / 360 < full.mean() < 3 / 360


def test_whole_degrees_of_a_larger_width_are_a_sample(monkeypatch):
    monkeypatch.setattr(groups, "_RADII", range(101, 200, 48))
    for group in whole_degrees(ARCS, 16)[:2]:
        assert group.title.startswith(f"a sample (seed {SEED}) of {len(group.blocks)} ")
        right_angles = group.lengths / sqrt(2) / np.hypot(*group.blocks[:, :2].T)
        clocks = right_angles.sum() * pi / 2 * 2**18
        assert 0.5 * SAMPLE_BUDGET < clocks < 1.5 * SAMPLE_BUDGET


@pytest.mark.parametrize("width", [20, 32])
def test_a_width_that_takes_too_long_is_refused(width):
    message = (
        f"^width {width} is too large to survey: one line takes up to {2**width} clocks; "
        "choose a width up to 19$"
    )
    with pytest.raises(ValueError, match=message):
        survey_groups(LINES, width)


@pytest.mark.parametrize("width", [17, 32])
def test_a_width_that_takes_too_long_for_conics(width):
    message = (
        f"^width {width} is too large to survey: one curve of {2**width} steps takes up to "
        f"{2 ** (width + 3)} clocks; choose a width up to 16$"
    )
    with pytest.raises(ValueError, match=message):
        survey_groups(CONICS, width)


@pytest.mark.parametrize("choose", [survey_groups, whole_degrees])
@pytest.mark.parametrize(("width", "clocks"), [(17, 823550), (32, 26986075410)])
def test_a_width_that_takes_too_long_for_arcs(choose, width, clocks):
    assert clocks - 1 < pi / 2 * 2 ** (width + 2) <= clocks
    message = (
        f"^width {width} is too large to survey: one quarter arc takes up to {clocks} clocks; "
        "choose a width up to 16$"
    )
    with pytest.raises(ValueError, match=message):
        choose(ARCS, width)


def test_whole_degrees_need_eight_bits_and_arcs():
    message = (
        "^the arcs between whole degrees go up to 198 steps from their center: width 7 has room "
        "for 127; choose a width from 8$"
    )
    with pytest.raises(ValueError, match=message):
        whole_degrees(ARCS, 7)
    with pytest.raises(ValueError, match="there are no lines between"):
        whole_degrees(LINES, 8)


@pytest.mark.parametrize("width", [4, 8, 12])
def test_exact_arcs(monkeypatch, width):
    """Every circle, and arcs that have room: of 12 bits those of the issue, here some of them."""
    assert groups._EXACT_ARCS == {12: 2_000_000}
    monkeypatch.setitem(groups._EXACT_ARCS, 12, 100_000)
    quarters, circles, turns, arcs = survey_groups(EXACT_ARCS, width)
    top = 2**width - 1
    assert quarters.title == f"all {top} quarter arcs"
    assert circles.title == f"all {top} circles"
    assert turns.title == f"ten turns of {len(turns.blocks)} circles"
    assert sorted(circles.blocks[:, 0].tolist()) == list(range(1, top + 1))
    np.testing.assert_array_equal(circles.blocks[:, :2], circles.blocks[:, 2:4])
    np.testing.assert_array_equal(quarters.blocks[:, [0, 1]], quarters.blocks[:, [3, 2]])
    count = {12: 100_000}.get(width, 1 << 16)
    assert arcs.title == f"a sample (seed {SEED}) of {count} arcs"
    start, end = arcs.blocks[:, :2] - arcs.blocks[:, 4:6], arcs.blocks[:, 2:4] - arcs.blocks[:, 4:6]
    radius, reached = np.hypot(*start.T), np.hypot(*end.T)
    assert radius.max() == pytest.approx(2800 / 4096 * 2**width, abs=1)
    # Off the circle by the rounding of the end alone.
    assert 0.4 < np.abs(reached - radius).max() <= sqrt(0.5)
    assert set(arcs.blocks[:, 6]) == {0, 1}
    # Room for the whole circle.
    assert (np.abs(arcs.blocks[:, 4:6]) + radius[:, None]).max() < 2**width
    for group in (quarters, circles, turns, arcs):
        assert not group.answers.any()
        assert (group.lengths > 0).all()


def test_whole_turned_ellipses(monkeypatch):
    """More than 400 of them, closed, of any angle, in both directions; of no other method."""
    monkeypatch.setattr(groups, "_CURVES", 20)
    title = "512 whole turned ellipses"
    (group,) = [g for g in survey_groups(EXACT_CONICS, 8) if "whole" in g.title]
    assert group.title == title
    assert not any("whole" in g.title for g in survey_groups(CONICS, 8))
    blocks = group.blocks
    assert len(np.unique(blocks, axis=0)) == 512
    np.testing.assert_array_equal(blocks[:, 5:7], blocks[:, 7:9])
    a, b, c = blocks[:, :3].T
    assert (4 * a * c > b * b).all()
    assert (b != 0).mean() > 0.9
    assert set(blocks[:, 9]) == {0, 1}
    assert set(blocks[:, 10]) == {4}
    assert (group.lengths > 0.3 * 255).all()
