"""Speeds, accelerations and lengths as the feed unit takes them."""

import re
from fractions import Fraction
from math import pi, sqrt

import numpy as np
import pytest

from discreta.sim.conics import ellipse, from_coefficients, parabola
from discreta.sim.feed import (
    ahead,
    encode_acceleration,
    encode_feed,
    feed_of,
    octagon,
    of_conic,
)
from discreta.sim.points import BadInputError


def assert_refused(message, make, *args):
    with pytest.raises(BadInputError, match=rf"\A{re.escape(message)}\Z"):
        make(*args)


@pytest.mark.parametrize(
    ("speed", "code"),
    [
        (Fraction(1), (0, 0)),
        (Fraction(1, 2), (0, 1)),
        (Fraction(3, 4), (2**15, 1)),
        (Fraction(1, 3), (21845, 2)),
        (Fraction(1, 2**24), (0, 24)),
        (1 - Fraction(1, 2**17), (2**16 - 1, 1)),
        # Nearer to the next power of two.
        (1 - Fraction(1, 2**19), (0, 0)),
        (Fraction(1, 8) - Fraction(1, 2**23), (0, 3)),
    ],
    ids=str,
)
def test_speeds_by_hand(speed, code):
    assert encode_feed(speed) == code


def test_every_speed_is_the_nearest():
    random = np.random.default_rng(3)
    for exponent in range(25):
        for _ in range(20):
            part = Fraction(int(random.integers(10**9)), 10**9)
            speed = (1 + part) / 2**exponent if exponent else 1 - part / 2
            mantissa, found = encode_feed(speed)
            assert 0 <= mantissa < 2**16
            assert 0 <= found <= 24
            near = feed_of(mantissa, found)
            assert abs(near / speed - 1) <= Fraction(1, 2**17)
            # Neither neighbour is nearer.
            step = Fraction(1, 2 ** (16 + found))
            assert abs(near - speed) <= step / 2
            assert encode_feed(near) == (mantissa, found)


def test_a_speed_is_one_and_its_mantissa_over_a_power_of_two():
    assert feed_of(0, 0) == 1
    assert feed_of(2**15, 2) == Fraction(3, 8)
    assert feed_of(1, 24) == Fraction(65537, 2**40)


@pytest.mark.parametrize(
    ("speed", "said", "cure"),
    [
        (Fraction(2), "2", "slower"),
        (1 + Fraction(1, 10**9), "1", "slower"),
        (Fraction(10) ** 400, "1e+400", "slower"),
        (Fraction(1, 2**25), "2.98023e-8", "faster"),
        (Fraction(0), "0", "faster"),
        (Fraction(-1, 3), "-0.333333", "faster"),
    ],
    ids=str,
)
def test_refuses_other_speeds(speed, said, cure):
    assert_refused(
        f"the speed is {said} steps per clock: the feed unit has 2^-24 to 1; choose a {cure} one",
        encode_feed,
        speed,
    )


def test_accelerations():
    unit = Fraction(1, 2**48)
    for value in (1, 2, 12345, 2**40 - 1):
        assert encode_acceleration(value * unit) == value
    assert encode_acceleration(Fraction(0)) == 0
    assert encode_acceleration(Fraction(14, 10) * unit) == 1
    assert encode_acceleration(Fraction(16, 10) * unit) == 2
    assert encode_acceleration((2**40 - 1 + Fraction(1, 3)) * unit) == 2**40 - 1


@pytest.mark.parametrize(
    ("acceleration", "said", "cure"),
    [
        (Fraction(1, 256), "0.00390625", "smaller"),
        (Fraction(2**41 - 1, 2**49), "0.00390625", "smaller"),
        (Fraction(9, 10 * 2**48), "3.19744e-15", "larger"),
        (Fraction(-1), "-1", "larger"),
    ],
    ids=str,
)
def test_refuses_other_accelerations(acceleration, said, cure):
    assert_refused(
        f"the acceleration is {said} steps per clock²: the feed unit has 2^-48 to "
        f"(1 - 2^-40)·2^-8, or 0 for no ramp; choose a {cure} one",
        encode_acceleration,
        acceleration,
    )


def test_lines():
    lines = np.array([[0, 0, 10, 0], [3, 4, 3, -1], [5, 5, -5, -5], [0, 0, -7, 3], [2, 2, 2, 2]])
    wanted = [10, 5, 10 * sqrt(2), 4 + 3 * sqrt(2), 0]
    assert octagon(lines, "line") == pytest.approx(wanted, abs=1e-9)


def test_lines_of_more_axes():
    """Of 7, 5 and 2 steps 2 are on three axes, 3 more on two and 2 more on one."""
    lines = np.array([[0, 0, 0, 5, -7, 2], [1, 1, 1, 4, 4, 4], [0, 0, 0, 0, 0, 9]])
    wanted = [2 * sqrt(3) + 3 * sqrt(2) + 2, 3 * sqrt(3), 9]
    assert octagon(lines, "line") == pytest.approx(wanted, abs=1e-9)


#: What a full circle of radius 1 takes: 8·(√½ + (√2 − 1)·(1 − √½)).
CIRCLE = 8 * (sqrt(0.5) + (sqrt(2) - 1) * (1 - sqrt(0.5)))


def way(start_angle, angle, radius, pieces=200_000):
    """Sum the lengths of many short chords of an arc."""
    at = start_angle + np.linspace(0, angle, pieces + 1)
    moves = np.abs(np.diff(radius * np.array([np.cos(at), np.sin(at)])))
    return (moves.max(axis=0) + (sqrt(2) - 1) * moves.min(axis=0)).sum()


def test_arcs():
    arcs = np.array(
        [
            [100, 0, 100, 0, 0, 0, 0, 0],  # a full turn
            [100, 0, 0, 100, 0, 0, 0, 0],  # a quarter
            [100, 0, 0, 100, 0, 0, 1, 0],  # the other way round: three quarters
            [5, 105, 105, 5, 5, 5, 1, 2],  # two turns and a quarter
            [60, 80, 80, 60, 0, 0, 0, 0],
            [60, 80, 80, 60, 0, 0, 1, 0],
            [7, 7, 7, 7, 7, 7, 0, 0],  # no length
        ]
    )
    assert octagon(arcs[:4], "arc") / (100 * CIRCLE) == pytest.approx([1, 1 / 4, 3 / 4, 9 / 4])
    inner = np.arctan2(80, 60) - np.arctan2(60, 80)
    wanted = [way(np.arctan2(80, 60), 2 * pi - inner, 100), way(np.arctan2(60, 80), inner, 100)]
    assert octagon(arcs[4:], "arc") == pytest.approx([*wanted, 0], rel=1e-8)


def test_arcs_of_any_place_and_length():
    random = np.random.default_rng(4)
    start, angle = random.uniform(0, 2 * pi, 25), random.uniform(0.1, 6.2, 25)
    clockwise = random.integers(0, 2, 25)
    turn = np.where(clockwise == 1, -angle, angle)
    radius = 2**30
    ends = [np.rint(radius * np.array([np.cos(at), np.sin(at)])).T for at in (start, start + turn)]
    blocks = np.zeros((25, 8), dtype=np.int64)
    blocks[:, :2], blocks[:, 2:4], blocks[:, 6] = *ends, clockwise
    wanted = [way(*row, radius, 20_000) for row in zip(start, turn, strict=True)]
    assert octagon(blocks, "arc") == pytest.approx(wanted, rel=1e-6)


def conics(*made):
    return octagon(np.array([it.block for it in made], dtype=np.int64), "conic")


def test_circles_are_as_long_as_arcs():
    """Whole turns count, and an end that is just before the start is nearly a turn away."""
    found = conics(
        ellipse((0, 0), (100, 100), 0, 12),
        ellipse((0, 0), (100, 100), 0, 12, end_angle=90),
        ellipse((9, 3), (100, 100), 0, 12, end_angle=90, full_turns=2),
        ellipse((0, 0), (100, 100), 0, 12, end_angle=90, clockwise=True, full_turns=1),
        ellipse((0, 0), (100, 100), 0, 12, full_turns=3),
        ellipse((0, 0), (100, 100), 0, 12, end_angle=-1),
    )
    rounds = [1, 1 / 4, 2 + 1 / 4, 1 + 3 / 4, 4]
    assert found[:5] / (100 * CIRCLE) == pytest.approx(rounds, rel=2e-4)
    # A degree is 100·π/180 steps, along y where it starts.
    assert found[0] - found[5] == pytest.approx(100 * pi / 180, abs=0.5)


@pytest.mark.parametrize("turns", [0, 1, 5])
def test_a_turned_ellipse(turns):
    """Against the sum of many chords of the ellipse as it is described."""
    angle = np.radians(25)
    at = np.linspace(0, 2 * pi * (turns + 1), 100_001)
    x, y = 300 * np.cos(at), 120 * np.sin(at)
    points = np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y
    moves = np.abs(np.diff(points))
    wanted = (moves.max(axis=0) + (sqrt(2) - 1) * moves.min(axis=0)).sum()
    found = conics(ellipse((0, 0), (300, 120), 25, 12, full_turns=turns))
    # The start is a point of the grid, and the ellipse is moved to it: by half a step of each axis.
    assert found == pytest.approx([wanted], rel=1e-3)


def test_other_conics():
    """A straight line like a line; a parabola like the sum of its chords."""
    found = conics(
        from_coefficients((0, 0, 0, 3, -5), (0, 0), (50, 30), False, 12),
        parabola((0, 0), (200, 300), (500, 0), 12),
    )
    assert found[0] == pytest.approx(50 + (sqrt(2) - 1) * 30)
    t = np.linspace(0, 1, 100_001)
    points = np.array([400 * t * (1 - t) + 500 * t * t, 600 * t * (1 - t)])
    moves = np.abs(np.diff(points))
    wanted = (moves.max(axis=0) + (sqrt(2) - 1) * moves.min(axis=0)).sum()
    assert found[1] == pytest.approx(wanted, rel=1e-4)


def test_a_conic_that_does_not_lead_to_its_end_is_refused():
    assert_refused(
        "the hyperbola does not lead from 10,0 to -10,0: give another end",
        octagon,
        np.array([[1, 0, -1, 0, 0, 10, 0, -10, 0, 0, 0]]),
        "conic",
    )


def test_path_ahead():
    assert ahead(np.array([10.25, 5.25, 1.25, 0.4])).tolist() == [17, 7, 2, 0]
    assert ahead(np.array([2.0**28, 100.0, 2.0**28 - 50])).tolist() == [2**28 - 1] * 2 + [
        2**28 - 50
    ]
    empty = ahead(np.array([]))
    assert (empty.shape, empty.dtype) == ((0,), np.int64)


def test_a_conic_is_as_long_as_its_curve():
    """A circle of R = 100 as a conic, three times round: 2πR a turn, seen along its points."""
    made = ellipse(
        (0, 0), (100, 100), 0, 8, start_angle=0, end_angle=0, clockwise=False, full_turns=2
    )
    length = of_conic(np.array(made.block), lambda moves: np.hypot(*moves.T))
    assert length == pytest.approx(600 * pi, rel=1e-3)
