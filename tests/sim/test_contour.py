from fractions import Fraction
from math import hypot, isqrt, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discreta.hdl.circular import Circular
from discreta.hdl.conic import Conic
from discreta.sim.arcs import is_empty, refusals
from discreta.sim.conics import KINDS, random_blocks
from discreta.sim.contour import (
    ArcContour,
    ConicContour,
    ExactConicContour,
    LineContour,
    distance_from_circle,
    distance_from_line,
)
from discreta.sim.simulate import simulate
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS, Stretch
from tests.lines import distance

ACCEPTED_IN = 3


DONE, RANGE = 0, 1


@st.composite
def runs(draw):
    """Draw blocks, and any steps at all for those that move; then where stretches are cut."""
    axes = draw(st.integers(2, 6))
    coordinate = st.integers(-(2**32), 2**32 - 1) if draw(st.booleans()) else st.integers(-9, 9)
    point = st.tuples(*[coordinate] * axes)
    blocks = draw(st.lists(st.tuples(point, point, st.booleans()), min_size=1, max_size=6))
    blocks = [(start, start if stays else end) for start, end, stays in blocks]
    codes = [draw(st.sampled_from([DONE, DONE, RANGE])) for _ in blocks]
    move = st.tuples(*[st.integers(-1, 1)] * axes).filter(any)
    steps = [
        draw(st.lists(move, min_size=1, max_size=9)) if start != end and code == DONE else []
        for (start, end), code in zip(blocks, codes, strict=True)
    ]
    cuts = draw(st.lists(st.integers(0, 100), max_size=5))
    return blocks, codes, steps, sorted(cuts)


def events_of(steps, axes, codes=None):
    """Write the steps as a device would: accepted, moved, answered."""
    clock = ACCEPTED_IN
    rows = []
    for moves, code in zip(steps, codes or [DONE] * len(steps), strict=True):
        rows.append([clock, 1, 0, 0, 0, *[0] * axes, 0])
        for index, move in enumerate(moves):
            clock += 2
            rows.append([clock, 0, 0, 0, 1, *move, int(index == len(moves) - 1)])
        clock += 1
        rows.append([clock, 0, int(code == DONE), code, 0, *[0] * axes, 0])
        clock += 1
    return np.array(rows, dtype=np.int64)


def joined(points):
    """Write starts and ends as blocks."""
    return np.array([(*start, *end) for start, end in points], dtype=np.int64)


@settings(derandomize=True, database=None, max_examples=150, deadline=None)
@given(runs())
def test_against_exact_numbers(run):
    blocks, codes, steps, cuts = run
    events = events_of(steps, len(blocks[0][0]), codes)
    contour = LineContour(joined(blocks))
    seen = []
    for part in np.split(events, [min(cut, len(events)) for cut in cuts]):
        columns = contour.follow(Stretch(len(part), 0, 0, part, np.empty((0, 0))))
        seen += zip(*(column.tolist() for column in columns), strict=True)

    expected, reached, clocks, worst = [], [], [], []
    clock, before = 0, 0
    for (start, end), code, moves in zip(blocks, codes, steps, strict=True):
        point = start
        worst.append(0)
        for move in moves:
            clock += 2
            point = tuple(a + b for a, b in zip(point, move, strict=True))
            expected.append((clock, point, distance(point, start, end)))
            worst[-1] = max(worst[-1], expected[-1][-1])
        reached.append(point == end and code == DONE)
        clock += 1
        # A block without steps ends with its answer, a clock behind where the last step would be.
        clocks.append(clock - bool(moves) - before)
        before += clocks[-1]
        clock += 1
    assert [(when, tuple(point)) for when, point, _ in seen] == [row[:2] for row in expected]
    errors = [error for *_, error in expected]
    assert [error for *_, error in seen] == pytest.approx(errors, rel=1e-6, abs=1e-6)
    assert contour.steps == len(expected)
    assert contour.clocks == (expected[-1][0] if expected else 0)
    assert contour.reached.tolist() == reached
    assert contour.ends_reached == sum(reached)
    assert contour.block_steps.tolist() == [len(moves) for moves in steps]
    assert contour.block_clocks.tolist() == clocks
    assert contour.block_errors.tolist() == pytest.approx(worst, rel=1e-6, abs=1e-6)
    largest = max(errors, default=0)
    assert contour.largest_error == pytest.approx(largest, rel=1e-6, abs=1e-6)
    if largest > 1e-5:
        at = [error for _, point, error in expected if point == contour.error_at]
        assert max(at) == pytest.approx(largest, rel=1e-6, abs=1e-6)
    else:
        assert len(contour.error_at) == len(blocks[0][0])


def test_before_the_first_step_the_error_is_at_the_start():
    contour = LineContour(np.array([[5, 6, 7, 8]]))
    assert (contour.error_at, contour.largest_error, contour.ends_reached) == ((5, 6), 0, 0)


def test_an_end_counts_with_the_last_step_alone():
    """A device that comes by its end and goes on has missed it."""
    blocks = np.array([[0, 0, 1, 0], [5, 5, 5, 7]])
    by, on = [[(1, 0), (1, 1)], [(0, 1), (0, 1)]], [[(1, 1), (0, -1)], [(0, 1), (0, 1)]]
    for steps, hit in ((by, 1), (on, 2)):
        contour = LineContour(blocks)
        events = events_of(steps, 2)
        contour.follow(Stretch(len(events), 0, 0, events, np.empty((0, 0))))
        assert contour.ends_reached == hit


def test_a_block_of_no_length_that_steps_has_missed_its_end():
    contour = LineContour(np.array([[5, 5, 5, 5], [5, 5, 6, 5]]))
    events = events_of([[(1, 0), (-1, 0)], [(1, 0)]], 2)
    contour.follow(Stretch(len(events), 0, 0, events, np.empty((0, 0))))
    assert contour.reached.tolist() == [False, True]


def test_a_block_that_moves_and_is_answered_without_a_step_has_missed_its_end():
    contour = ArcContour(np.array([[5, 0, 5, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 0, 0]]))
    events = events_of([[], []], 2)
    contour.follow(Stretch(len(events), 0, 0, events, np.empty((0, 0))))
    assert contour.reached.tolist() == [False, True]


def test_a_step_in_the_clock_of_an_answer_is_of_the_next_block():
    """Written out by hand: the answer comes a clock behind its block's last step."""
    contour = LineContour(np.array([[0, 0, 1, 0], [5, 5, 5, 6]]))
    rows = [(0, 1, 0, 0, 0, 0, 0, 0), (4, 1, 0, 0, 1, 1, 0, 1)]
    rows += [(5, 0, 1, 0, 1, 0, 1, 1), (6, 0, 1, 0, 0, 0, 0, 0)]
    _, points, _ = contour.follow(Stretch(7, 2, 2, np.array(rows), np.empty((0, 0))))
    assert points.tolist() == [[1, 0], [5, 6]]
    assert contour.block_clocks.tolist() == [4, 1]
    assert contour.reached.all()


def test_more_answers_than_blocks_do_no_harm():
    contour = LineContour(np.array([[0, 0, 1, 0]]))
    events = events_of([[], [(1, 0)], []], 2)
    contour.follow(Stretch(len(events), 0, 0, events, np.empty((0, 0))))
    assert contour.steps == 1


@settings(derandomize=True, database=None, max_examples=200, deadline=None)
@given(st.data())
def test_distances_of_the_longest_lines(data):
    """Near a line of up to 2^33 steps, where squares do not fit 64 bits."""
    axes = data.draw(st.integers(2, 6))
    direction = data.draw(
        st.lists(st.integers(1 - 2**32, 2**32 - 1), min_size=axes, max_size=axes).filter(any)
    )
    part = data.draw(st.fractions(0, 1, max_denominator=2**20))
    off = data.draw(st.lists(st.integers(-2, 2), min_size=axes, max_size=axes))
    point = [round(part * d) + o for d, o in zip(direction, off, strict=True)]
    seen = float(distance_from_line(np.array(point), np.array(direction)))
    assert seen == pytest.approx(distance(point, [0] * axes, direction), abs=1e-6)


def test_distances_known_without_a_formula():
    points = np.array([[[0, 5], [7, 0]], [[3, 4], [0, 1]]])
    directions = np.array([[[1, 0]], [[-1, 1]]])
    seen = distance_from_line(points, directions)
    assert seen == pytest.approx(np.array([[5, 0], [7 / sqrt(2), 1 / sqrt(2)]]))
    cube = distance_from_line(np.array([1, 0, 0]), np.array([9, 9, 9]))
    assert cube == pytest.approx(float(Fraction(2, 3)) ** 0.5)


def off_circle(point, start):
    """Give the difference of two radii from whole numbers alone, to 20 places."""
    radii = [isqrt(10**40 * sum(value * value for value in each)) for each in (point, start)]
    return abs(radii[0] - radii[1]) / 10**20


@settings(derandomize=True, database=None, max_examples=300, deadline=None)
@given(st.data())
def test_distances_from_the_largest_circles(data):
    """Near a circle of up to 2^32 steps, where squares do not fit 64 bits."""
    bits = data.draw(st.integers(1, 32))
    coordinate = st.integers(1 - 2**bits, 2**bits - 1)
    start = data.draw(st.tuples(coordinate, coordinate).filter(any))
    radius = isqrt(sum(value * value for value in start))
    x = data.draw(st.integers(-radius, radius))
    side = data.draw(st.sampled_from([1, -1]))
    off = data.draw(st.tuples(st.integers(-2, 2), st.integers(-2, 2)))
    point = x + off[0], side * isqrt(radius * radius - x * x) + off[1]
    if data.draw(st.booleans()):
        point = point[::-1]
    seen = float(distance_from_circle(np.array(point), np.array(start)))
    assert seen == pytest.approx(off_circle(point, start), abs=1e-6)


def test_distances_from_circles_known_without_a_formula():
    points = np.array([[3, 4], [0, -6], [0, 0], [0, 0], [2**32 - 1, 1]])
    starts = np.array([[0, 5], [5, 0], [-5, 0], [0, 0], [0, 2**32 - 1]])
    # The last is off by 1 / 2R.
    assert distance_from_circle(points, starts) == pytest.approx([0, 1, 5, 0, 2**-33], abs=1e-12)


def refused_and_drawn(count):
    """Draw arcs of four bits back to back, with blocks of no length and some that are refused."""
    random = np.random.default_rng(8)
    center = random.integers(-9, 9, (count, 2))
    seen = random.integers(-6, 7, (count, 2))
    end = np.where(random.random((count, 1)) < 0.5, seen[:, ::-1], -seen)
    end += random.integers(-1, 2, (count, 2)) * (random.random((count, 1)) < 0.3)
    direction, turns = random.integers(0, 2, (2, count))
    return np.column_stack([center + seen, center + end, center, direction, turns])


@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize("stalls", [NO_STALLS, Stalls(3, stall=0.4, gap=0.5)])
def test_thousands_of_arcs_in_one_run(stalls):
    """Every point against its own circle, block by block, whatever is between."""
    blocks = refused_and_drawn(2000)
    contour = ArcContour(blocks)
    seen, answers = [], []
    core = Circular(4, guard=0)
    for stretch in simulate(core, blocks, limit=10**6, engine="compiled", stalls=stalls):
        seen.append(contour.follow(stretch))
        columns = [EVENT_COLUMNS.index(name) for name in ("done", "error")]
        answers += [tuple(row) for row in stretch.events[:, columns] if any(row)]
    clocks, points, errors = (np.concatenate(parts) for parts in zip(*seen, strict=True))
    refused = np.array([error for _, error in answers])
    np.testing.assert_array_equal(refused, refusals(blocks, 4))
    assert np.count_nonzero(refused) > 100
    assert 0 < np.count_nonzero(is_empty(blocks)) < 100
    np.testing.assert_array_equal(contour.reached, refused == 0)
    np.testing.assert_array_equal(contour.block_steps == 0, (refused != 0) | is_empty(blocks))

    # Cut into blocks by nothing but their numbers of steps.
    cuts = np.cumsum(contour.block_steps)[:-1]
    for block, path, off, largest in zip(
        blocks.tolist(),
        np.split(points, cuts),
        np.split(errors, cuts),
        contour.block_errors,
        strict=True,
    ):
        if not len(path):
            assert largest == 0
            continue
        xh, yh, xk, yk, x, y, *_ = block
        moves = np.diff(np.vstack([[xh, yh], path]), axis=0)
        assert np.all(np.abs(moves).max(axis=1) == 1)
        assert path[-1].tolist() == [xk, yk]
        radius = hypot(xh - x, yh - y)
        assert off == pytest.approx([abs(hypot(u - x, v - y) - radius) for u, v in path], abs=1e-9)
        assert largest == off.max()
    assert contour.steps == len(points)
    assert contour.largest_error == errors.max()
    assert contour.clocks == clocks[-1]
    assert np.all(contour.block_clocks > 0)
    last = np.flatnonzero(contour.block_steps)[-1]
    assert contour.block_clocks[: last + 1].sum() == contour.clocks


# A block, points, and how far they are from its curve, all known without a formula.
CONICS = {
    "circle": ([1, 0, 1, 0, 0, 0, 13, 13, 0, 1, 0], [(3, 4), (-5, -12), (12, 16)], [8, 0, 7]),
    "line": ([0, 0, 0, 3, 4, 0, 0, 8, -6, 0, 0], [(3, 4), (4, -3), (-3, 6)], [5, 0, 3]),
    # 9x² + 25y² = 225 at the ends of its axes.
    "ellipse": ([9, 0, 25, 0, 0, 5, 0, 0, 3, 0, 0], [(6, 0), (0, -2), (4, 0)], [1, 1, 1]),
    # x² = 8y, with the focus at 0,2: from there the vertex is nearest.
    "parabola": ([1, 0, 0, 0, -8, 0, 0, 8, 8, 0, 0], [(0, 1), (0, -4), (8, 8)], [1, 4, 0]),
    "hyperbola": ([0, -1, 0, 0, 0, 9, 4, 4, 9, 1, 0], [(5, 5), (-7, -7), (36, 1)], [2**0.5] * 2),
}
CONICS["hyperbola"][2].append(0)


def test_distances_from_conics_known_without_a_formula():
    """All of them in one run, mixed."""
    contour = ConicContour(np.array([block for block, _, _ in CONICS.values()]))
    which = np.repeat(np.arange(len(CONICS)), 3)[::-1]
    points = np.array([points for _, points, _ in CONICS.values()]).reshape(-1, 2)[::-1]
    wanted = np.array([off for _, _, off in CONICS.values()]).ravel()[::-1]
    assert contour.errors(points, which) == pytest.approx(wanted, abs=1e-9)
    # However many points there are at a time.
    for times in (5_000, 3_000):
        many = contour.errors(np.tile(points, (times, 1)), np.tile(which, times))
        assert many == pytest.approx(np.tile(wanted, times), abs=1e-9)


@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize("stalls", [NO_STALLS, Stalls(3, stall=0.4, gap=0.5)])
def test_hundreds_of_conics_in_one_run(stalls):
    """Of every kind, with blocks of no length and some that are refused between them."""
    blocks = np.concatenate(
        [random_blocks(kind, 6, 80, np.random.default_rng(4)) for kind in KINDS]
    )
    np.random.default_rng(4).shuffle(blocks)
    blocks[::9, 7:11] = blocks[::9, [5, 6, 9, 10]]
    blocks[::9, 10] = 0
    refused = np.arange(len(blocks)) % 11 == 5
    blocks[refused, :5], blocks[refused, 10] = 0, 1  # no direction anywhere
    empty = (np.arange(len(blocks)) % 9 == 0) & ~refused
    contour = ConicContour(blocks)
    seen = []
    core = Conic(6, **Conic.LECTURE)
    for stretch in simulate(core, blocks, limit=10**6, engine="compiled", stalls=stalls):
        seen.append(contour.follow(stretch))
    _, points, errors = (np.concatenate(parts) for parts in zip(*seen, strict=True))
    np.testing.assert_array_equal(contour.reached, ~refused)
    np.testing.assert_array_equal(contour.block_steps == 0, refused | empty)
    assert contour.largest_error == errors.max()

    cuts = np.cumsum(contour.block_steps)[:-1]
    judged = 0
    for block, path, off, largest in zip(
        blocks.tolist(),
        np.split(points, cuts),
        np.split(errors, cuts),
        contour.block_errors,
        strict=True,
    ):
        assert largest == off.max(initial=0)
        if not len(path):
            continue
        a, b, c, d, e, x, y, *_ = block
        # The distance is between these two: of first order, and where the curve is met for sure.
        u, v = path.T
        value = a * (u * u - x * x) + b * (u * v - x * y) + c * (v * v - y * y)
        value += d * (u - x) + e * (v - y)
        steep = np.hypot(2 * a * u + b * v + d, b * u + 2 * c * v + e)
        second = abs(a + c) + np.hypot(a - c, b)
        np.testing.assert_array_less(np.abs(value), off * (steep + second * off / 2) + 1e-6)
        good = off * second < steep / 4
        judged += np.count_nonzero(good)
        bend = off * steep - second * off**2 / 2 * (1 + 1e-9)
        np.testing.assert_array_less(bend[good], np.abs(value)[good] + 1e-6 * steep[good])
    assert judged > 0.8 * len(points)


@pytest.mark.parametrize("cut", [None, 3])
def test_a_block_without_a_last_step_ends_when_it_is_done(cut):
    """On its end, if it is allowed to; a step that was the last one is believed."""
    lines = np.array([[0, 0, 2, 1], [2, 1, 4, 1], [4, 1, 6, 1], [6, 1, 6, 1]])
    # One that says nothing, one that does so a step too early, one that is not there yet.
    moves = [[(1, 0, 0), (1, 1, 0)], [(1, 0, 1), (1, 0, 0)], [(1, 0, 0)], []]
    rows = []
    for block in moves:
        rows += [[len(rows) + index, 0, 0, 0, 1, *move] for index, move in enumerate(block)]
        rows.append([len(rows), 0, 1, 0, 0, 0, 0, 0])
    for timed, reached in (
        (False, [False, False, False, True]),
        (True, [True, False, False, True]),
    ):
        contour = LineContour(np.pad(lines, ((0, 0), (0, 2)), constant_values=9), 2)
        contour.done_ends = timed
        for part in (rows[:cut], rows[len(rows) if cut is None else cut :]):
            events = np.array(part, dtype=np.int64).reshape(-1, len(EVENT_COLUMNS) + 3)
            contour.follow(Stretch(9, 0, 0, events, np.empty((0, 0))))
        assert contour.reached.tolist() == reached


def test_columns_behind_those_of_a_curve_are_its_timing():
    lines = np.array([[0, 0, 3, 4, 7, 200], [3, 4, 3, 4, 1, 200]])
    contour = LineContour(lines, 2)
    assert (contour.starts.tolist(), contour.ends.tolist()) == ([[0, 0], [3, 4]], [[3, 4]] * 2)
    assert contour.errors(np.array([[4, -3]]), np.array([0])).tolist() == [5]
    arcs = np.array([[3, 4, 5, 0, 0, 0, 0, 0, 7, 200]])
    assert ArcContour(arcs).errors(np.array([[0, 7]]), np.array([0])).tolist() == [2]


def test_the_end_of_an_exact_conic_is_not_counted():
    """A circle of radius 5, to an end that is a step off it, beyond one that is half as far."""
    block = np.array([[1, 0, 1, 0, 0, 5, 0, 4, 5, 0, 0]])
    moves = [[0, 1], [0, 1], [0, 1], [-1, 1], [0, 1]]
    stretch = Stretch(7, 1, 1, events_of([moves], 2), np.empty((0, 0), dtype=np.int64))
    counted, exact = ConicContour(block), ExactConicContour(block)
    for contour in (counted, exact):
        contour.follow(stretch)
        assert contour.reached.all()
        assert contour.steps == len(moves)
    assert counted.largest_error == pytest.approx(sqrt(41) - 5)
    assert counted.error_at == (4, 5)
    assert exact.largest_error == pytest.approx(sqrt(34) - 5)
    assert exact.error_at == (5, 3)
