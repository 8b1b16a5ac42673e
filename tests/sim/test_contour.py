from fractions import Fraction
from math import sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discreta.sim.contour import LineContour, distance_from_line
from discreta.sim.stretch import Stretch
from tests.lines import distance

ACCEPTED_IN = 3


@st.composite
def runs(draw):
    """Draw blocks, and any steps at all for those that move; then where stretches are cut."""
    axes = draw(st.integers(2, 6))
    coordinate = st.integers(-(2**32), 2**32 - 1) if draw(st.booleans()) else st.integers(-9, 9)
    point = st.tuples(*[coordinate] * axes)
    blocks = draw(st.lists(st.tuples(point, point, st.booleans()), min_size=1, max_size=6))
    blocks = [(start, start if stays else end) for start, end, stays in blocks]
    move = st.tuples(*[st.integers(-1, 1)] * axes).filter(any)
    steps = [
        draw(st.lists(move, min_size=1, max_size=9)) if start != end else []
        for start, end in blocks
    ]
    cuts = draw(st.lists(st.integers(0, 100), max_size=5))
    return blocks, steps, sorted(cuts)


def events_of(steps, axes):
    """Write the steps as a device would: accepted, moved, answered."""
    clock = ACCEPTED_IN
    rows = []
    for moves in steps:
        rows.append([clock, 1, 0, 0, 0, *[0] * axes, 0])
        for index, move in enumerate(moves):
            clock += 2
            rows.append([clock, 0, 0, 0, 1, *move, int(index == len(moves) - 1)])
        clock += 1
        rows.append([clock, 0, 1, 0, 0, *[0] * axes, 0])
        clock += 1
    return np.array(rows, dtype=np.int64)


@settings(derandomize=True, database=None, max_examples=150, deadline=None)
@given(runs())
def test_against_exact_numbers(run):
    blocks, steps, cuts = run
    events = events_of(steps, len(blocks[0][0]))
    starts, ends = (np.array(points, dtype=np.int64) for points in zip(*blocks, strict=True))
    contour = LineContour(starts, ends)
    seen = []
    for part in np.split(events, [min(cut, len(events)) for cut in cuts]):
        columns = contour.follow(Stretch(len(part), 0, 0, part, np.empty((0, 0))))
        seen += zip(*(column.tolist() for column in columns), strict=True)

    expected = []
    clock, hit = 0, 0
    for (start, end), moves in zip(blocks, steps, strict=True):
        point = start
        for move in moves:
            clock += 2
            point = tuple(a + b for a, b in zip(point, move, strict=True))
            expected.append((clock, point, distance(point, start, end)))
        hit += point == end
        clock += 2
    assert [(when, tuple(point)) for when, point, _ in seen] == [row[:2] for row in expected]
    errors = [error for *_, error in expected]
    assert [error for *_, error in seen] == pytest.approx(errors, rel=1e-6, abs=1e-6)
    assert contour.steps == len(expected)
    assert contour.clocks == (expected[-1][0] if expected else 0)
    assert contour.ends_reached == hit
    largest = max(errors, default=0)
    assert contour.largest_error == pytest.approx(largest, rel=1e-6, abs=1e-6)
    if largest > 1e-5:
        at = [error for _, point, error in expected if point == contour.error_at]
        assert max(at) == pytest.approx(largest, rel=1e-6, abs=1e-6)
    else:
        assert len(contour.error_at) == len(blocks[0][0])


def test_before_the_first_step_the_error_is_at_the_start():
    contour = LineContour(np.array([[5, 6]]), np.array([[7, 8]]))
    assert (contour.error_at, contour.largest_error, contour.ends_reached) == ((5, 6), 0, 0)


def test_an_end_counts_with_the_last_step_alone():
    """A device that comes by its end and goes on has missed it."""
    starts, ends = np.array([[0, 0], [5, 5]]), np.array([[1, 0], [5, 7]])
    by, on = [[(1, 0), (1, 1)], [(0, 1), (0, 1)]], [[(1, 1), (0, -1)], [(0, 1), (0, 1)]]
    for steps, hit in ((by, 1), (on, 2)):
        contour = LineContour(starts, ends)
        events = events_of(steps, 2)
        contour.follow(Stretch(len(events), 0, 0, events, np.empty((0, 0))))
        assert contour.ends_reached == hit


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
