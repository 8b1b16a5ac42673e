"""Blocks of the conic interpolator against closed forms, whole numbers and the motion itself."""

import math
from fractions import Fraction

import numpy as np
import pytest

from discreta.sim.conics import (
    KINDS,
    curve_near,
    curve_points,
    distance,
    ellipse,
    from_coefficients,
    motion,
    parabola,
    random_blocks,
)
from discreta.sim.points import BadInputError
from tests.conics import derivatives

WIDTH = 12


def offset(points, normals, by):
    """Move points along normals: by less than the radius of curvature, that is their distance."""
    return points + normals / np.hypot(*normals.T)[:, None] * by[:, None]


# Distances


@pytest.mark.parametrize(
    ("r1", "r2", "center"),
    [(300, 120, (0, 0)), (60000, 400, (-3000, 77)), (16_000_000, 8000, (5, 400_000))],
)
def test_distance_from_an_ellipse(r1, r2, center):
    random = np.random.default_rng(1)
    angle, by = random.uniform(0, 2 * np.pi, 3000), random.uniform(-2, 2, 3000)
    cos, sin = np.cos(angle), np.sin(angle)
    points = offset(np.stack([r1 * cos, r2 * sin], 1), np.stack([r2 * cos, r1 * sin], 1), by)
    x, y = center
    a, c = (np.array([r2, r1]) ** 2 // math.gcd(r1, r2) ** 2).tolist()
    five = np.array([a, 0, c, -2 * x * a, -2 * y * c])
    seen = distance(five, np.array([x + r1, y]), points + center)
    assert seen == pytest.approx(np.abs(by), abs=1e-6)


@pytest.mark.parametrize(("p", "reach"), [(2, 400), (100, 2000), (50_000, 1 << 16)])
def test_distance_from_a_parabola(p, reach):
    """y² = 2px, with the radius of curvature p at the vertex."""
    random = np.random.default_rng(2)
    y, by = random.uniform(-reach, reach, 3000), random.uniform(-1.9, 1.9, 3000)
    points = offset(np.stack([y * y / (2 * p), y], 1), np.stack([np.full(3000, p), -y], 1), by)
    seen = distance(np.array([0, 0, 1, -2 * p, 0]), np.array([0, 0]), points)
    assert seen == pytest.approx(np.abs(by), abs=1e-6)


def test_distance_from_a_hyperbola():
    """xy = 40000: the nearest branch counts, whichever the start is on."""
    random = np.random.default_rng(3)
    x = 200 * np.exp(random.uniform(-5, 5, 3000)) * random.choice((-1, 1), 3000)
    by = random.uniform(-2, 2, 3000)
    points = offset(np.stack([x, 40000 / x], 1), np.stack([40000 / x, x], 1), by)
    for sign in (1, -1):  # of the coefficients, which says nothing of the curve
        seen = distance(np.array([0, sign, 0, 0, 0]), np.array([200, 200]), points)
        assert seen == pytest.approx(np.abs(by), abs=1e-6)


def test_distance_where_what_cancels_does_not_fit_a_float():
    """A hyperbola with a vertex of 20 steps radius, from a start that is 2^23 steps away."""
    scale, shift = 2**27 - 1, 6400
    five, start = np.array([scale, 0, -scale, 0, shift]), np.array([2**23, 2**23])
    above = shift / (2 * scale)
    radius = math.sqrt(shift * 2**23 / scale - above**2)
    random = np.random.default_rng(4)
    t, by = random.uniform(-4, 4, 3000), random.uniform(-2, 2, 3000)
    normals = np.stack([np.cosh(t), -np.sinh(t)], 1)
    points = offset(np.stack([radius * np.cosh(t), above + radius * np.sinh(t)], 1), normals, by)
    assert distance(five, start, points) == pytest.approx(np.abs(by), abs=1e-6)


def test_distance_of_points_so_far_away_that_f_does_not_fit_64_bits():
    scale, radius = 2**27 - 1, 2**24 - 1
    points = np.array([[1000, 0], [0, -50_000], [radius, radius]])
    seen = distance(np.array([scale, 0, scale, 0, 0]), np.array([radius, 0]), points)
    wanted = [radius - 1000, radius - 50_000, (math.sqrt(2) - 1) * radius]
    assert seen == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("width", [12, 16, 24])
def test_distance_of_grid_points_from_circles_is_exact(width):
    """With the largest coefficients there are; the radius in whole numbers, 20 digits long."""
    random = np.random.default_rng(width)
    scale = 2 ** (width + 3) - 1
    x, y, start_x, start_y = random.integers(-(2**width), 2**width, 4).tolist()
    five = [scale, 0, scale, -2 * scale * x, -2 * scale * y]
    radius = math.isqrt(((start_x - x) ** 2 + (start_y - y) ** 2) * 10**24)
    angle = random.uniform(0, 2 * np.pi, 300)
    off = radius * 1e-12 * np.stack([np.cos(angle), np.sin(angle)], 1)
    points = np.rint(off + np.array([x, y])).astype(np.int64)
    seen = distance(np.array(five), np.array([start_x, start_y]), points)
    for (px, py), value in zip(points.tolist(), seen, strict=True):
        wanted = abs(math.isqrt(((px - x) ** 2 + (py - y) ** 2) * 10**24) - radius) / 1e12
        assert value == pytest.approx(wanted, abs=1e-6)


def test_distance_from_a_line_and_of_many_curves_at_once():
    fives = np.array([[0, 0, 0, 3, 4], [1, 0, 1, 0, 0]])[:, None]
    starts = np.array([[0, 0], [0, 13]])[:, None]
    seen = distance(fives, starts, np.array([[3, 4], [0, 0], [-5, -12]]))
    assert seen == pytest.approx(np.array([[5, 0, 12.6], [8, 13, 0]]), abs=1e-6)


# The named curves


def test_circle_and_line():
    circle = from_coefficients([1, 0, 1, 0, 0], (100, 0), (100, 0), False, 16)
    assert circle.block == (1, 0, 1, 0, 0, 100, 0, 100, 0, 0, 3)
    assert (circle.kind, circle.moved) == ("circle", 0)
    assert ellipse((0, 0), (100, 100), 0, 16) == circle
    quarter = ellipse((0, 0), (100, 100), 0, 16, end_angle=90)
    assert quarter.block == (1, 0, 1, 0, 0, 100, 0, 0, 100, 0, 0)
    around = ellipse((0, 0), (100, 100), 0, 16, end_angle=90, clockwise=True, full_turns=2)
    assert around.block == (1, 0, 1, 0, 0, 100, 0, 0, 100, 1, 10)
    sixty_eighty = from_coefficients([1, 0, 1, 0, 0], (60, 80), (60, 80), False, 16)
    assert sixty_eighty.block[-1] == 4

    for sign in (1, -1):
        line = from_coefficients([0, 0, 0, 99 * sign, -200 * sign], (0, 0), (200, 99), False, 16)
        # Counter-clockwise a line runs along (−e, d).
        assert line.block == (0, 0, 0, 99, -200, 0, 0, 200, 99, 0, 0)
        assert (line.kind, line.moved) == ("line", 0)
    back = from_coefficients([0, 0, 0, 99, -200], (0, 0), (200, 99), True, 16)
    assert back.block == (0, 0, 0, -99, 200, 0, 0, 200, 99, 1, 0)


def test_parabola_and_hyperbola():
    """Out along the upper half of y² = 200x it bends to the right, down xy = 40000 to the left."""
    half = parabola((0, 0), (0, 1000), (20000, 2000), 16)
    assert half.block == (0, 0, 1, -200, 0, 0, 0, 20000, 2000, 1, 0)
    assert (half.kind, half.moved) == ("parabola", 0)
    assert from_coefficients([0, 0, -1, 200, 0], (0, 0), (20000, 2000), True, 16) == half
    lower = parabola((20000, -2000), (0, -1000), (0, 0), 16)
    assert lower.block == (0, 0, 1, -200, 0, 20000, -2000, 0, 0, 1, 0)
    both = parabola((800, 400), (-800, 0), (800, -400), 16)
    assert both.block == (0, 0, 1, -200, 0, 800, 400, 800, -400, 0, 1)

    falls = from_coefficients([0, 1, 0, 0, 0], (20, 2000), (2000, 20), False, 16)
    assert falls.block == (0, -1, 0, 0, 0, 20, 2000, 2000, 20, 0, 0)
    assert (falls.kind, falls.moved) == ("hyperbola", 0)
    rises = from_coefficients([0, 1, 0, 0, 0], (-2000, -20), (-20, -2000), True, 16)
    assert rises.block == (0, -1, 0, 0, 0, -2000, -20, -20, -2000, 1, 0)


def of_coefficients(five, start):
    """Give centre, semi-axes (as columns) of an ellipse, by linear algebra."""
    a, b, c, d, e = five
    second = np.array([[a, b / 2], [b / 2, c]])
    center = np.linalg.solve(-2 * second, [d, e])
    values, vectors = np.linalg.eigh(second)
    off = np.array(start) - center
    return center, vectors * np.sqrt(off @ second @ off / values)


def gaps(points, curve):
    """Give how far each point is from a dense polyline."""
    result = []
    for point in points:
        nearest = np.argmin(np.hypot(*(curve - point).T))
        near = np.take(curve, range(nearest - 1, nearest + 2), axis=0, mode="wrap")
        way, off = np.diff(near, axis=0), point - near[:-1]
        part = np.clip((off * way).sum(axis=1) / (way * way).sum(axis=1).clip(1e-30), 0, 1)
        result.append(np.hypot(*(off - part[:, None] * way).T).min())
    return np.array(result)


@pytest.mark.parametrize(
    ("width", "center", "r1", "r2", "degrees", "first"),
    [
        (16, (0, 0), 300, 120, 30, 0),
        (16, (-70, 41), 120, 300.5, 77.7, 123),
        (16, (0, 0), 6000, 300, 17, 40),
        (8, (30, 0), 180, 40, -20, 250),
        (5, (0, 1), 19, 11, 10, 60),
    ],
)
def test_a_turned_ellipse_is_moved_by_no_more_than_its_start(width, center, r1, r2, degrees, first):
    """What is said to be moved is: points of the ellipse asked for against the block's own."""
    made = ellipse(center, (r1, r2), degrees, width, start_angle=first, end_angle=first)
    *five, x, y, end_x, end_y, clockwise, turns = made.block
    assert (made.kind, (end_x, end_y), clockwise, turns) == ("ellipse", (x, y), 0, 4)
    assert max(map(abs, five[:3])) < 2 ** (width + 3)
    assert max(map(abs, five[3:])) < 2 ** (2 * width + 4)

    angles = np.radians(np.arange(0, 360, 2) + first)
    turned = math.radians(degrees)
    shape = np.array([[math.cos(turned), -math.sin(turned)], [math.sin(turned), math.cos(turned)]])
    asked = (shape * (r1, r2) @ [np.cos(angles), np.sin(angles)]).T + center
    assert np.hypot(*(asked[0] - (x, y))) <= math.sqrt(0.5)
    middle, axes = of_coefficients(five, (x, y))
    angles = np.linspace(0, 2 * np.pi, 20_001)
    dense = (axes @ [np.cos(angles), np.sin(angles)]).T + middle
    moved = gaps(asked, dense).max()
    assert moved == pytest.approx(made.moved, rel=0.02, abs=1e-3)

    angles = np.radians(np.linspace(0, 360, 20_001))
    dense = (shape * (r1, r2) @ [np.cos(angles), np.sin(angles)]).T + center
    (missed,) = gaps([(x, y)], dense)
    # Any curve through the start is this far off; rounding adds less than a fiftieth of a step.
    assert missed - 1e-3 <= made.moved <= missed + 0.02


@pytest.mark.parametrize("clockwise", [False, True])
def test_an_arc_of_an_ellipse_begins_and_ends_where_it_is_asked_to(clockwise):
    made = ellipse(
        (10, -20), (300, 120), 30, 16, start_angle=10, end_angle=200, clockwise=clockwise
    )
    *five, x, y, end_x, end_y, direction, turns = made.block
    asked = []
    for degrees in (10, 200):
        u, v = 300 * math.cos(math.radians(degrees)), 120 * math.sin(math.radians(degrees))
        asked.append((10 + u * 0.75**0.5 - v / 2, -20 + u / 2 + v * 0.75**0.5))
    assert np.abs(np.array(asked[0]) - (x, y)).max() <= 0.5
    assert np.abs(np.array(asked[1]) - (end_x, end_y)).max() <= 0.5 + made.moved
    assert distance(np.array(five), np.array([x, y]), np.array([end_x, end_y])) < math.sqrt(0.5)
    assert direction == clockwise
    # It turns 190 degrees one way, past the ends of x and y on the far left, and 170 the other way.
    assert turns == 2


def test_whole_turns_before_a_short_arc_count_for_the_rounding():
    whole = ellipse((0, 0), (250, 60), 20, 8, start_angle=90, end_angle=90)
    short = ellipse((0, 0), (250, 60), 20, 8, start_angle=90, end_angle=100)
    both = ellipse((0, 0), (250, 60), 20, 8, start_angle=90, end_angle=100, full_turns=1)
    assert both.block[:5] == whole.block[:5]
    assert both.moved == pytest.approx(whole.moved, abs=1e-6)
    assert both.block[5:] == (*short.block[5:10], short.block[10] + 4)

    five = [math.pi, 1, math.e, -40, 30]
    whole = from_coefficients(five, (40, 20), (40, 20), False, 6)
    both = from_coefficients(five, (40, 20), (38, 22), False, 6, full_turns=1)
    assert (both.block[:5], both.moved) == (whole.block[:5], whole.moved)
    assert from_coefficients(five, (40, 20), (38, 22), False, 6).moved < whole.moved


@pytest.mark.parametrize("y", [99, 100, 101])
def test_an_end_beside_an_extreme_has_not_passed_it(y):
    """x² − xy + y² = 7500 is highest at 50,100, which is nearest to 50,99 and 50,101."""
    for clockwise, start, end in ((False, (100, 50), (50, y)), (True, (100, 50), (-50, -y))):
        made = from_coefficients([1, -1, 1, 0, 0], start, end, clockwise, 8)
        assert made.block[10] == 0


@pytest.mark.parametrize("clockwise", [False, True])
def test_a_short_way_on_a_flat_ellipse_is_not_a_whole_turn(clockwise):
    """Half a step off its end, the gradient is that of a point a hundred steps away."""
    five, start = [9, 0, 10**6, 0, 0], (707, 3)
    for steps in range(1, 40):
        end = (707 + (steps if clockwise else -steps), 3)
        assert from_coefficients(five, start, end, clockwise, 17).block[10] == 0
        back = (707 - (steps if clockwise else -steps), 3)
        with pytest.raises(BadInputError, match=r"it bends within 0\.01 steps"):
            from_coefficients(five, start, back, clockwise, 17)


# From coefficients


def test_whole_coefficients_are_kept_and_bend_to_the_side_they_are_run():
    for five, clockwise, wanted in (
        ([4095, 0, 4095, 0, 0], False, [4095, 0, 4095, 0, 0]),
        ([-6, 0, -6, 0, 0], True, [6, 0, 6, 0, 0]),
        # 4096 does not fit, a circle of these is the same.
        ([1 << 40, 0, 1 << 40, 0, 0], True, [1, 0, 1, 0, 0]),
        ([12 * 4096, 0, 18 * 4096, 0, 4096], False, [12, 0, 18, 0, 1]),
        ([Fraction(1, 3), 0, 0.5, 0, 0], False, [2, 0, 3, 0, 0]),
    ):
        made = from_coefficients(five, (100, 0), (100, 0), clockwise, 9)
        assert made.block[:5] == tuple(wanted)
        assert made.moved == 0


@pytest.mark.parametrize("factor", [1, -3, Fraction(1, 7), 1e-200, 1e200])
def test_a_factor_changes_nothing(factor):
    """sqrt(2) and the like do not fit: what does is near, and does not depend on the scale."""
    five = [Fraction(math.sqrt(k)) for k in (2, 3, 5, 7, 11)]
    wanted = from_coefficients(five, (100, -60), (100, -60), True, 16)
    made = from_coefficients([k * factor for k in five], (100, -60), (100, -60), True, 16)
    assert made.moved == pytest.approx(wanted.moved, abs=1e-6)
    assert 0 < made.moved < 1e-3
    assert np.array(made.block[:5]) / made.block[0] == pytest.approx(
        np.array([float(k / five[0]) for k in five]), rel=1e-3
    )


def test_rounded_coefficients_move_the_curve_by_what_is_said():
    five = [math.pi, 1, math.e, -40, 30]
    made = from_coefficients(five, (40, 20), (40, 20), False, 6)
    asked, own = (of_coefficients(numbers, (40, 20)) for numbers in (five, made.block[:5]))
    angles = np.linspace(0, 2 * np.pi, 20_001)
    curves = [(axes @ [np.cos(angles), np.sin(angles)]).T + center for center, axes in (asked, own)]
    assert made.moved > 1e-4
    assert gaps(curves[0][::250], curves[1]).max() == pytest.approx(made.moved, rel=0.05, abs=2e-3)


def test_a_parabola_that_does_not_fit_is_rounded():
    made = parabola((-300, 17), (501, 1003), (3000, 100), 16)
    assert made.kind == "parabola"
    assert 0 < made.moved < 1e-3
    t = np.linspace(0, 1, 101)[:, None]
    asked = (1 - t) ** 2 * (-300, 17) + 2 * t * (1 - t) * (501, 1003) + t**2 * (3000, 100)
    five = np.array(made.block[:5])
    assert distance(five, np.array([-300, 17]), asked).max() == pytest.approx(made.moved, rel=0.01)
    assert made.block[9:] == (1, 1)


CIRCLE, HYPERBOLA = (1, 0, 1, 0, 0), (0, 1, 0, 0, 0)


@pytest.mark.parametrize(
    ("five", "start", "end", "clockwise", "turns", "message"),
    [
        (CIRCLE, (0, 0), (1, 1), 0, 0, "no direction at its start 0,0, where both derivatives"),
        ((0,) * 5, (3, 4), (5, 5), 0, 0, "no direction at its start 3,4"),
        ((1, 0, -1, 0, 0), (5, 5), (9, 9), 0, 0, "through 5,5 is a pair of straight lines"),
        (CIRCLE, (100, 0), (90, 90), 0, 0, "90,90 is 27.28 steps off .* such as 71,71$"),
        (HYPERBOLA, (100, 10), (-100, -10), 1, 0, "-100,-10 is on the other branch"),
        (HYPERBOLA, (100, 10), (10, 100), 0, 0, "10,100 is not ahead of the start 100,10"),
        ((0, 0, 1, -9, 0), (25, 15), (4, 6), 1, 0, "not ahead of the start 25,15 on the parabola"),
        ((1, 0, 1, 0, 0), (0, -9), (19, 0), 0, 0, "10.00 steps off"),
        ((0, 0, 0, 1, -1), (0, 0), (-1, 1), 0, 0, "1.42 steps off the curve"),
        (CIRCLE, (3, 0), (3, 0), 0, 0, r"too sharp at its start 3,0: .* is 3.00 times"),
        ((1, 0, 9, 0, 0), (0, 5), (0, -5), 0, 0, "it bends within 1.66 steps, where 2 are needed"),
        (CIRCLE, (0, -255), (-255, 0), 0, 0, "as far as x = 255.0, where .*; give --width 9 or a"),
        ((1, 0, 1, 300, 0), (-200, 50), (-200, 50), 0, 0, None),
        ((1, 0, 1, 350, 0), (-200, 140), (-200, 140), 0, 0, "as far as x = -317.2, .* for -255 to"),
        (CIRCLE, (256, 0), (0, 256), 0, 0, "coordinate 256 is out of range: width 8"),
        (CIRCLE, (0, 100), (0, 1000), 0, 0, "coordinate 1000 is out of range"),
        (CIRCLE, (100, 0), (100, 0), 0, 511, None),
        (CIRCLE, (100, 0), (100, 0), 0, 512, "512 whole turns are too many: .* room for 511"),
        (CIRCLE, (100, 0), (100, 0), 0, -1, "-1 whole turns cannot be made"),
        ((1, 0, 1, 300, 0), (-100, 180), (-120, 184), 0, 0, None),
        ((1, 0, 1, 300, 0), (-100, 180), (-120, 184), 0, 1, "as far as x = -336.8, where width 8"),
        (
            HYPERBOLA,
            (10, 100),
            (100, 10),
            0,
            1,
            "a hyperbola does not come back to its start: leave",
        ),
        ((1, 0, math.nan, 0, 0), (3, 0), (3, 0), 0, 0, "nan is no number to work with"),
        ((1, 0, 1), (3, 0), (3, 0), 0, 0, "3 numbers are given, where 5 are needed"),
        ((1, 0, 3e-7, 0, 0), (100, 0), (100, 0), 0, 0, "it bends within 0.05 steps"),
        # Gentle, but the other branch is 1.5 steps away.
        (
            (-10000, 0, 50, 0, 0),
            (10, 141),
            (10, -141),
            0,
            0,
            "within 0.77 steps of a point without",
        ),
    ],
)
def test_what_cannot_be_run_is_refused(five, start, end, clockwise, turns, message):
    if message is None:
        assert from_coefficients(five, start, end, bool(clockwise), 8, turns).moved == 0
        return
    with pytest.raises(BadInputError, match=message) as error:
        from_coefficients(five, start, end, bool(clockwise), 8, turns)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ellipse((0, 0), (1, 30), 0, 8), "semi-axis 1 is too short: give 2 or more"),
        (lambda: ellipse((0, 0), (30, 1e9), 0, 8), r"semi-axis 1e\+09 is out of .*--width 22$"),
        (
            lambda: ellipse((0, 70000), (30, 30), 0, 8),
            "center 0,70000 is out of range: .*--width 9$",
        ),
        (lambda: ellipse((0, 0), (30, 30), 0, 8, end_angle=0.1), "within a step of 30,0"),
        (lambda: ellipse((0, 0), (250, 20), 0, 8), "too sharp at its start 250,0"),
        (
            lambda: ellipse((0, 0), (250, 20), 0, 8, start_angle=90, end_angle=-90),
            "it bends within 1.60 steps",
        ),
        (lambda: ellipse((200, 0), (250, 24), 33, 8), "coordinate 410 is out of range"),
        (lambda: ellipse((0, 0), (30, 30), math.inf, 8), "inf is no number"),
        (lambda: parabola((0, 0), (5, 5), (10, 10), 8), "0,0, 5,5 and 10,10 are in a line"),
        (lambda: parabola((0, 0), (700, 200), (0, 200), 8), "as far as x = 350.0, where width 8"),
    ],
)
def test_shapes_that_cannot_be_run_are_refused(make, message):
    with pytest.raises(BadInputError, match=message) as error:
        make()
    assert "\n" not in str(error.value)


# Random blocks, against the motion: nothing of it is used to make them


def walk(block, total, count):
    """Give points and velocities at even times.

    (x, y, 1)' is a matrix times (x, y, 1): its power series, over and over.
    """
    a, b, c, d, e, x, y, *_, clockwise, _ = block
    rate = np.array([[-b, -2 * c, -e], [2 * a, b, d], [0, 0, 0]], dtype=np.longdouble)
    rate = -rate if clockwise else rate
    step = term = np.eye(3, dtype=np.longdouble)
    for order in range(1, 12):
        term = term @ rate * (total / count / order)
        step = step + term
    points = np.empty((count + 1, 3), dtype=np.longdouble)
    points[0] = x, y, 1
    done = 1
    while done <= count:
        more = min(done, count + 1 - done)
        points[done : done + more] = points[:more] @ step.T
        step, done = step @ step, done + more
    return points[:, :2].astype(float), (points @ rate[:2].T).astype(float)


def motion_to_end(block):
    """Give points and velocities up to where it is nearest to the end."""
    a, b, c, d, e, x, y, end_x, end_y, *_ = block
    curl = 4 * a * c - b * b
    if curl > 0:
        # One whole turn passes every point once.
        total = 2 * math.pi / math.sqrt(curl)
    else:
        # Longer and longer, until the end is passed by.
        speed = math.hypot(2 * a * x + b * y + d, b * x + 2 * c * y + e)
        total = math.hypot(end_x - x, end_y - y) / speed / 64
        for _ in range(60):
            points, _ = walk(block, total, 1 << 11)
            off = np.hypot(*(points - (end_x, end_y)).T)
            last = int(np.argmin(off))
            if 0 < last < len(off) - 1 and off[last] < 1 + np.ptp(off[last - 1 : last + 2]):
                total *= (last + 2) / len(off)
                break
            total *= 2
    points, velocities = walk(block, total, 1 << 14)
    if curl > 0:
        assert points[-1] == pytest.approx([x, y], abs=1e-3)
    last = int(np.argmin(np.hypot(*(points - (end_x, end_y)).T)))
    if last and (x, y) != (end_x, end_y):
        return points[: last + 1], velocities[: last + 1]
    return points, velocities


@pytest.mark.parametrize("kind", KINDS)
def test_random_blocks_are_what_they_are_said_to_be(kind):
    blocks = random_blocks(kind, WIDTH, 3000, np.random.default_rng(8))
    assert blocks.shape == (3000, 11)
    assert blocks.dtype == np.int64
    again = random_blocks(kind, WIDTH, 3000, np.random.default_rng(8))
    assert np.array_equal(blocks, again)
    assert not np.array_equal(blocks, random_blocks(kind, WIDTH, 3000, np.random.default_rng(9)))
    a, b, c, d, e, x, y, end_x, end_y, clockwise, turns = blocks.T
    assert np.abs(blocks[:, :3]).max() < 1 << (WIDTH + 3)
    assert np.abs(blocks[:, 3:5]).max() < 1 << (2 * WIDTH + 4)
    assert blocks[:, 5:9].min() >= -(1 << WIDTH)
    assert blocks[:, 5:9].max() < 1 << WIDTH
    assert 0.45 < clockwise.mean() < 0.55
    curl = 4 * a * c - b * b
    assert np.all(
        {
            "line": (a == 0) & (b == 0) & (c == 0),
            "circle": (a == c) & (b == 0) & (a > 0),
            "ellipse": curl > 0,
            "parabola": (curl == 0) & (a + c > 0),
            "hyperbola": curl < 0,
        }[kind]
    )
    gx, gy = 2 * a * x + b * y + d, b * x + 2 * c * y + e
    size = np.abs(gx) + np.abs(gy)
    assert np.all((size > 0) & (size >= 4 * (np.abs(a) + np.abs(b) + np.abs(c))))
    same = (x == end_x) & (y == end_y)
    if kind in ("circle", "ellipse"):
        assert 0.05 < same.mean() < 0.2
        assert {3, 4, 8} <= set(turns[same].tolist())
    else:
        assert not np.any(same)
    assert distance(blocks[:, :5], blocks[:, 5:7], blocks[:, 7:9]).max() <= math.sqrt(0.5) + 1e-6


@pytest.mark.parametrize("kind", KINDS[1:])
def test_turns_and_limits_of_random_blocks_by_their_motion(kind):
    seen = set()
    for block in random_blocks(kind, WIDTH, 80, np.random.default_rng(5)).tolist():
        a, b, c, d, e, x, y, end_x, end_y, clockwise, turns = block
        points, velocities = motion_to_end(block)
        whole = (x, y) == (end_x, end_y)
        apart = np.hypot(*(points[-1] - points[-2]))
        assert np.hypot(*(points[-1] - (end_x, end_y))) < 0.75 + apart / 2
        if whole:
            velocities[-1] = velocities[0]
        # An axis that stands still at the start or at the end does not change direction there.
        still = 1e-9 * np.abs(velocities).max()
        expected = 0
        before, after = np.empty(2), np.empty(2)
        latest = 0
        for axis, column in enumerate(velocities.T):
            signs = np.where(np.abs(column) < still, 0, np.sign(column))
            moving = np.flatnonzero(signs)
            changes = moving[1:][np.diff(signs[moving]) != 0]
            expected += len(changes)
            latest = max(latest, changes.max(initial=0))
            after[axis] = signs[moving[-1]]
        # The end itself, a little off the curve, may be on the near side of the last change.
        for axis, column in enumerate(velocities[:latest].T if latest else velocities.T):
            signs = np.sign(column[np.abs(column) >= still])
            before[axis] = signs[-1]
        gx, gy = 2 * a * end_x + b * end_y + d, b * end_x + 2 * c * end_y + e
        own = np.sign([gy, -gx] if clockwise else [-gy, gx])
        near_side = bool(not whole and latest and np.all((own == before) | (own == 0)))
        full = 4 if whole and turns > 4 else 0
        assert turns == expected - near_side + full, block
        seen.add(turns - full)

        # It bends to its side everywhere, nowhere sharper than 2 steps, and stays inside.
        (vx, vy), speed = velocities.T, np.hypot(*velocities.T)
        bend = a * vx * vx + b * vx * vy + c * vy * vy
        assert np.all(bend > 0)
        assert np.all(speed**3 / (2 * bend) > 2 - 1e-3)
        assert points.min() >= -(2**WIDTH) - 0.75
        assert points.max() <= 2**WIDTH - 0.25
        middle = points[8:-8]
        extreme = np.sign(np.diff(middle, axis=0))
        for axis in range(2):
            turned = middle[1:-1, axis][extreme[1:, axis] * extreme[:-1, axis] < 0]
            assert np.abs(turned + 0.5).max(initial=0) < 2**WIDTH - 1.5 + 1e-3
    assert seen >= ({0, 1, 2, 3, 4} if kind in ("circle", "ellipse") else {0, 1})


@pytest.mark.parametrize("width", [4, 24])
def test_random_blocks_of_other_widths(width):
    for kind in KINDS:
        blocks = random_blocks(kind, width, 20, np.random.default_rng(width))
        assert blocks.dtype == np.int64
        assert all(abs(k) < 2 ** (width + 3) for k in blocks[:, :3].ravel().tolist())
        assert all(abs(k) < 2 ** (2 * width + 4) for k in blocks[:, 3:5].ravel().tolist())
        # f at the end, exactly, against the gradient there.
        for a, b, c, d, e, x, y, p, q, *_ in blocks.tolist():
            value = a * (p * p - x * x) + b * (p * q - x * y) + c * (q * q - y * y)
            value += d * (p - x) + e * (q - y)
            gradient = math.hypot(2 * a * p + b * q + d, b * p + 2 * c * q + e)
            assert abs(value) <= gradient


def test_a_kind_there_is_not():
    with pytest.raises(ValueError, match="kind is 'spiral': choose 'line' or 'circle'"):
        random_blocks("spiral", 8, 1, np.random.default_rng(0))


# Pictures


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("width", [8, 20])
def test_points_of_a_curve_are_on_it_and_in_order(kind, width):
    for block in random_blocks(kind, width, 25, np.random.default_rng(3)):
        points = curve_points(block)
        assert 2 <= len(points) <= 4096
        five, start, end = block[:5], block[5:7], block[7:9]
        assert distance(five, start, points).max() < 1e-6
        assert points[0] == pytest.approx(start, abs=1e-6)
        assert np.hypot(*(points[-1] - end)) < 0.75
        # Along the velocity, and between them not far away.
        a, b, c, d, e = five.tolist()
        x, y = (points[:-1] + points[1:]).T / 2
        gx, gy = 2 * a * x + b * y + d, b * x + 2 * c * y + e
        move = np.diff(points, axis=0)
        along = (move[:, 1] * gx - move[:, 0] * gy) * (-1 if block[9] else 1)
        assert np.all(along > 0)
        if len(points) < 4096:
            assert distance(five, start, np.stack([x, y], 1)).max() < 0.011


def test_points_of_whole_turns_and_of_no_way():
    circle = from_coefficients([1, 0, 1, 0, 0], (100, 0), (0, 100), False, 16, full_turns=3)
    points = curve_points(circle.block)
    assert points[-1] == pytest.approx([100, 0], abs=1e-6)
    assert points.min() == pytest.approx(-100, abs=0.02)
    quarter = curve_points((*circle.block[:-1], 0))
    assert quarter[-1] == pytest.approx([0, 100], abs=1e-6)
    assert quarter.min() > -1e-6
    with pytest.raises(BadInputError, match="does not lead from 100,10 to -100,-10"):
        curve_points((0, -1, 0, 0, 0, 100, 10, -100, -10, 1, 0))


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_near_is_all_there_is_and_nothing_else(kind):
    """Around places of a curve and beside it: against its points, and its distance."""
    for block in random_blocks(kind, 8, 12, np.random.default_rng(6)):
        points = curve_points(block, 1 << 14)
        for place in (0, len(points) // 3, len(points) - 1):
            center = np.rint(points[place]) + np.array([3, -2])
            near = curve_near(block, center, 9)
            pieces = np.split(near, np.flatnonzero(np.isnan(near[:, 0])))
            drawn = near[~np.isnan(near[:, 0])]
            assert distance(block[:5], block[5:7], drawn).max() < 1e-6
            assert np.hypot(*(drawn - center).T).max() <= 9.2
            for piece in pieces:
                piece = piece[~np.isnan(piece[:, 0])]
                assert np.hypot(*np.diff(piece, axis=0).T).max() <= 0.1 + 1e-9
            inside = points[np.hypot(*(points - center).T) <= 9]
            for point in inside[:: 1 + len(inside) // 20]:
                assert np.hypot(*(drawn - point).T).min() <= 0.05 + 1e-6
    with pytest.raises(BadInputError, match="does not lead from 100,10 to -100,-10"):
        curve_near((0, -1, 0, 0, 0, 100, 10, -100, -10, 1, 0), np.array([0, 0]), 9)


def test_steps_of_the_faster_axis():
    """Where |Gx| = |Gy| the other axis becomes the faster one."""
    root = math.sqrt(0.5)
    for block, length in (
        ((0, 0, 0, 3, -4, 0, 0, 40, 30, 0, 0), 40),
        ((1, 0, 1, 0, 0, 100, 0, 0, 100, 0, 0), 100 * 2 * root),
        ((1, 0, 1, 0, 0, 100, 0, 0, -100, 0, 2), 300 * 2 * root),
        ((1, 0, 1, 0, 0, 100, 0, 0, -100, 1, 0), 100 * 2 * root),
        ((1, 0, 1, 0, 0, 100, 0, 100, 0, 1, 4), 400 * 2 * root),
        ((1, 0, 1, 0, 0, 100, 0, 0, -100, 1, 8), 900 * 2 * root),
        # x² / 80² + y² / 60² = 1: a quarter is √(80² + 60²).
        ((9, 0, 16, 0, 0, 80, 0, -80, 0, 0, 2), 200),
        ((9, 0, 16, 0, 0, 0, 60, 0, 60, 1, 12), 1200),
        # y² = 200x: 100 of y up to (50, 100), then 150 of x.
        (parabola((0, 0), (0, 100), (200, 200), 8).block, 250),
        # xy = 40,000: 200 of y to the vertex, then 200 of x.
        ((0, 1, 0, 0, 0, 100, 400, 400, 100, 0, 0), 400),
        ((0, -1, 0, 0, 0, 400, 100, 100, 400, 1, 0), 400),
    ):
        (found,) = motion(np.array([block])).steps
        assert found == pytest.approx(length), block


@pytest.mark.parametrize("width", [5, 12])
@pytest.mark.parametrize("kind", KINDS)
def test_motion_is_that_of_the_curves_points(kind, width):
    """Walked in small steps. Where the curve is nearest to the end they are not quite at one."""
    blocks = random_blocks(kind, width, 40, np.random.default_rng(11))
    seen = motion(blocks)
    for k, block in enumerate(blocks.tolist()):
        points = curve_points(block, 1 << 12)
        rounds = max(1, -(-block[10] // 4))
        moves, middle = np.diff(points, axis=0).T, (points[:-1] + points[1:]).T / 2
        walked = rounds * np.abs(moves).max(axis=0).sum()
        assert seen.steps[k] == pytest.approx(walked, rel=2e-3, abs=0.15)
        along, steep = derivatives(block, points.T), derivatives(block, middle)
        time = rounds * (np.hypot(*moves) / np.hypot(*steep)).sum()
        sizes, size = np.abs(along).max(axis=0), np.hypot(*along)
        assert seen.time[k] == pytest.approx(time, rel=3e-3, abs=0.15 / size.min())
        assert seen.first[k] == pytest.approx(sizes[0])
        assert seen.largest[k] == pytest.approx(sizes.max(), rel=2e-2)
        if kind in ("circle", "ellipse"):
            # Of all of it, which some of these go round.
            whole = curve_points((*block[:7], *block[5:7], block[9], 4), 1 << 12)
            size = np.hypot(*derivatives(block, whole.T))
        assert seen.smallest[k] == pytest.approx(size.min(), rel=2e-2)


def test_motion_of_many_turns_and_without_a_way():
    circle = from_coefficients([1, 0, 1, 0, 0], (0, -300), (300, 0), True, 16, full_turns=200)
    line = from_coefficients([0, 0, 0, 99, -200], (0, 0), (200, 99), False, 16)
    # x² / 80² + y² / 60² = 1, three times round: the period is 2π/√(4ac).
    flat = (9, 0, 16, 0, 0, 0, 60, 0, 60, 1, 12)
    seen = motion(np.array([circle.block, line.block, flat]))
    root = math.sqrt(0.5)
    assert seen.steps == pytest.approx([8 * 300 * root * 200.75, 200, 1200])
    assert seen.time == pytest.approx([200.75 * math.pi, 1, 3 * 2 * math.pi / 24])
    assert seen.first == pytest.approx([600, 200, 1920])
    assert seen.largest == pytest.approx([600, 200, 1920])
    assert seen.smallest == pytest.approx([600, math.hypot(200, 99), 1440])
    # A quarter of it from the sharp end, where |Gx| = 1440, to the flat one.
    (quarter,) = motion(np.array([(9, 0, 16, 0, 0, 80, 0, 0, 60, 0, 0)])).largest
    assert quarter == pytest.approx(1920)
    nowhere = (1, 0, 1, 0, 0, 5, 5, 5, 5, 0, 0)
    assert motion(np.array([nowhere])).steps == pytest.approx(0, abs=1e-9)
