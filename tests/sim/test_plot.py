import re
from itertools import pairwise
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest

from discreta.sim.curves import Arc, Polyline
from discreta.sim.plot import PathPlot, picture_format
from discreta.sim.points import BadInputError
from tests.lines import distance, line_steps

CORNERS = np.array([(0, 0), (20, 9), (-7, -13), (-7, -13), (0, 0)])
SVG = "{http://www.w3.org/2000/svg}"


def steps_of(corners):
    """Give the points behind every step, and their errors."""
    points, errors = [], []
    for start, end in pairwise(corners.tolist()):
        for _, point in line_steps(start, end, width=8, normalize=True, preload="half"):
            points.append(point)
            errors.append(distance(point, start, end))
    return np.array(points).reshape(-1, corners.shape[1]), np.array(errors)


def picture(tmp_path, curve, points, errors, *, cuts=(), kind=".svg"):
    plot = PathPlot(curve if isinstance(curve, Arc) else Polyline(curve))
    for part, error in zip(np.split(points, cuts), np.split(errors, cuts), strict=True):
        plot.follow(part, error)
    path = tmp_path / f"picture{kind}"
    plot.save(path, kind, "a path")
    return path.read_bytes()


def vertices(svg, name):
    """Give the vertices of a curve, in the picture's units, upwards."""
    root = ElementTree.fromstring(svg)
    (group,) = (group for group in root.iter(f"{SVG}g") if group.get("id") == name)
    curve = next(group.iter(f"{SVG}path")).get("d")
    assert curve is not None
    pairs = re.findall(r"[ML] (\S+) (\S+)", curve)
    return np.array(pairs, dtype=float) * (1, -1)


def markers(svg, name):
    """Give the places of a curve's markers; the curve itself ends where the window does."""
    root = ElementTree.fromstring(svg)
    (group,) = (group for group in root.iter(f"{SVG}g") if group.get("id") == name)
    places = [(use.get("x"), use.get("y")) for use in group.iter(f"{SVG}use")]
    return np.array(places, dtype=float) * (1, -1)


def texts(svg):
    return [node.text for node in ElementTree.fromstring(svg).iter(f"{SVG}text")]


def scale(seen, known):
    """Give the function from the picture's units to steps, from points that are known."""
    low, high = known.argmin(axis=0), known.argmax(axis=0)
    column = np.arange(known.shape[1])
    factor = (known[high, column] - known[low, column]) / (seen[high, column] - seen[low, column])
    return lambda points: known[low, column] + (points - seen[low, column]) * factor


def test_the_staircase_is_the_trace(tmp_path):
    points, errors = steps_of(CORNERS)
    svg = picture(tmp_path, CORNERS, points, errors)
    true = vertices(svg, "true")
    assert len(true) == len(CORNERS)
    in_steps = scale(true, CORNERS)
    assert in_steps(true) == pytest.approx(CORNERS, abs=1e-3)
    trace = np.vstack([CORNERS[:1], points])
    assert len(trace) < 128  # above, lines are simplified
    assert in_steps(vertices(svg, "steps")) == pytest.approx(trace, abs=1e-3)
    # One unit of both axes is as long.
    one = np.diff([in_steps(np.zeros(2)), in_steps(np.ones(2))], axis=0)[0]
    assert one[0] == pytest.approx(one[1], rel=1e-3)


def test_the_curve_of_the_error(tmp_path):
    points, errors = steps_of(CORNERS)
    svg = picture(tmp_path, CORNERS, points, errors)
    known = np.column_stack([np.arange(len(points) + 1), [0, *errors]])
    seen = vertices(svg, "error")
    assert scale(seen, known)(seen) == pytest.approx(known, abs=2e-3)
    assert "distance from the true path" in texts(svg)


def test_the_window_stands_at_the_largest_error(tmp_path):
    points, errors = steps_of(CORNERS)
    svg = picture(tmp_path, CORNERS, points, errors)
    worst = int(np.argmax(errors))
    near = np.vstack([CORNERS[:1], points])[max(0, worst + 1 - 28) : worst + 1 + 29]
    seen = markers(svg, "near")
    assert scale(seen, near)(seen) == pytest.approx(near, abs=1e-3)
    assert f"largest error: {errors[worst]:.4f} step" in texts(svg)


@pytest.mark.parametrize("kind", [".svg", ".png"])
def test_the_same_path_gives_the_same_bytes(tmp_path, kind):
    """However the steps come, and whatever the user likes his own plots to be."""
    points, errors = steps_of(CORNERS)
    first = picture(tmp_path, CORNERS, points, errors, kind=kind)
    worst = int(np.argmax(errors))
    for cuts in ([0, 0], [1, 2, 3], [worst], [worst + 1], [worst - 3, worst + 2, worst + 9]):
        assert picture(tmp_path, CORNERS, points, errors, cuts=cuts, kind=kind) == first
    with mpl.rc_context({"lines.linewidth": 7, "font.size": 30, "figure.facecolor": "red"}):
        assert picture(tmp_path, CORNERS, points, errors, kind=kind) == first


def test_another_path_gives_another_picture(tmp_path):
    points, errors = steps_of(CORNERS)
    first = picture(tmp_path, CORNERS, points, errors)
    points[30] += (0, 1)
    assert picture(tmp_path, CORNERS, points, errors) != first


@pytest.mark.parametrize("cuts", [[], [1, 2, 150_000, 299_999], list(range(0, 300_000, 65_536))])
def test_long_paths_keep_their_end_and_the_largest_error(tmp_path, cuts):
    """Hundreds of thousands of steps: a picture of bounded size that still shows a single peak."""
    count = 300_003  # no multiple of what is left out
    corners = np.array([(0, 0), (count, 0), (count, count)])
    points = np.column_stack([np.arange(1, count + 1), np.zeros(count, dtype=int)])
    errors = np.full(count, 0.25)
    errors[100_000:150_000] = 0
    peak = 234_567
    errors[peak] = 0.75
    points[peak, 1] = 1
    svg = picture(tmp_path, corners, points, errors, cuts=cuts)
    assert len(svg) < 1_000_000
    heights = np.unique(vertices(svg, "error")[:, 1])
    assert heights[-1] - heights[0] == pytest.approx(
        3 * (np.median(vertices(svg, "error")[:, 1]) - heights[0]), rel=1e-3
    )
    in_steps = scale(vertices(svg, "true"), corners)
    steps = in_steps(vertices(svg, "steps"))
    assert steps[0] == pytest.approx((0, 0), abs=0.5)
    assert steps[-1] == pytest.approx((count, 0), abs=0.5)
    assert "distance from the true path, the largest of every 256 steps" in texts(svg)


def test_more_axes_say_which_are_drawn(tmp_path):
    corners = np.array([(0, 0, 0, 0), (3, -9, 2, 1)])
    points, errors = steps_of(corners)
    svg = picture(tmp_path, corners, points, errors)
    assert "a path; x and y of xyza" in texts(svg)
    in_steps = scale(vertices(svg, "true"), corners[:, :2])
    trace = np.vstack([corners[:1], points])[:, :2]
    assert in_steps(vertices(svg, "steps")) == pytest.approx(trace, abs=1e-3)


@pytest.mark.parametrize("corners", [[(5, 5), (5, 5)], [(5, 5)] * 4, [(0, 0), (1, 0)]])
def test_paths_of_no_steps_or_one(tmp_path, corners):
    corners = np.array(corners)
    svg = picture(tmp_path, corners, *steps_of(corners))
    moves = bool(np.any(corners[0] != corners[-1]))
    assert any("largest error" in (text or "") for text in texts(svg)) == moves


def round_steps(radius, center, angles):
    """Give rounded points of a circle, and their errors."""
    exact = np.stack([radius * np.cos(angles), radius * np.sin(angles)], axis=1)
    points = np.rint(exact).astype(int)
    return points + center, np.abs(np.hypot(*points.T) - radius)


@pytest.mark.parametrize("turns", [1, 3])
def test_an_arc(tmp_path, turns):
    """The true path is the circle, however many turns; the staircase is the trace."""
    arc = Arc((65, 4), (65, 4), (5, 4), clockwise=False, turns=turns)
    angles = np.linspace(0, 2 * np.pi * turns, 480 * turns + 1)[1:]
    svg = picture(tmp_path, arc, *round_steps(60, (5, 4), angles))
    curves = {name: vertices(svg, name) for name in ("steps", "true")}
    # Lines are simplified, but not at the outermost points.
    low, high = curves["steps"].min(axis=0), curves["steps"].max(axis=0)
    steps, true = (
        (curve - low) / (high - low) * 120 + (5 - 60, 4 - 60) for curve in curves.values()
    )
    for curve in (steps, true):
        assert curve[[0, -1]] == pytest.approx(np.array([[65, 4], [65, 4]]), abs=0.01)
    assert np.abs(np.hypot(*(steps - (5, 4)).T) - 60).max() < 0.8
    assert np.hypot(*(true - (5, 4)).T) == pytest.approx(60, abs=0.05)
    assert len(true) > 100


def test_the_window_shows_a_small_circle(tmp_path):
    arc = Arc((4, 3), (-3, 4), (0, 0), clockwise=False)
    points, errors = round_steps(5, (0, 0), np.arctan2(3, 4) + np.arange(1, 8) / 5)
    svg = picture(tmp_path, arc, points, errors)
    in_steps = scale(markers(svg, "near"), np.vstack([[4, 3], points]))
    true = in_steps(vertices(svg, "true-near"))
    assert np.hypot(*true.T) == pytest.approx(5, abs=0.02)
    assert true[[0, -1]] == pytest.approx(np.array([[4, 3], [-3, 4]]), abs=0.02)


@pytest.mark.parametrize("radius", [10**6, 4 * 10**9])
def test_the_window_shows_a_large_circle(tmp_path, radius):
    """At the largest error it is as far off as that says, not as the outline's chord is."""
    x, y = start = 4 * radius // 5, 3 * radius // 5
    arc = Arc(start, (-y, x), (0, 0), clockwise=False)
    angle = np.arctan2(y, x) + np.pi / 4096  # in the middle of a chord
    points, errors = round_steps(radius, (0, 0), angle + np.arange(-3, 4) / radius)
    worst = int(np.argmax(errors))
    svg = picture(tmp_path, arc, points, errors)
    in_steps = scale(markers(svg, "near")[-len(points) :], points)  # the start is far away
    true = in_steps(vertices(svg, "true-near"))
    assert np.hypot(*true.T) == pytest.approx(radius, abs=0.02)
    (x, y), (u, v) = true[0] - points[worst], true[-1] - points[worst]
    assert min(np.hypot(x, y), np.hypot(u, v)) > 7  # out of the window at both ends
    assert abs(x * v - y * u) / np.hypot(u - x, v - y) == pytest.approx(errors[worst], abs=0.03)
    # Long numbers are written out.
    tens = [str(value)[:-1] for value in points[worst]]
    written = [re.sub(r"\D", "", text or "") for text in texts(svg)]
    assert all(any(text.startswith(number) for text in written) for number in tens)


def moves_of(svg, name, count):
    """Give the height of a curve of steps in the middle of every period, in the picture's units."""
    x, y = vertices(svg, f"moves-{name}").T
    middles = np.interp((np.arange(count) + 0.5) / count, (0, 1), (x[0], x[-1]))
    return y[np.searchsorted(x, middles, side="right") - 1]


@pytest.mark.parametrize("cuts", [[], [1, 4]])
def test_what_every_period_moves_is_drawn(tmp_path, cuts):
    moves = np.array([[5, 2], [4, 2], [-1, 0], [0, -3], [9, 4], [9, -9], [0, 0], [7, 1]])
    points = np.cumsum(moves, axis=0)
    curve = Polyline([(0, 0), points[-1]])
    plot = PathPlot(curve, periods=True)
    for part in np.split(points, cuts):
        plot.follow(part, np.full(len(part), 0.5))
    plot.save(tmp_path / "picture.svg", ".svg", "a path")
    svg = (tmp_path / "picture.svg").read_bytes()
    seen = np.stack([moves_of(svg, name, len(moves)) for name in "xy"])
    # Both curves have one scale.
    unit = (seen[0].max() - seen[0].min()) / 10
    assert (seen - seen[0, -2]) / unit == pytest.approx(moves.T, abs=1e-3)
    for text in ("steps per period", "steps along x", "distance from the true path", "periods"):
        assert text in texts(svg)
    assert "steps taken" not in texts(svg)


def test_of_many_periods_the_mean_is_drawn(tmp_path):
    count = 5000
    moves = np.array([[0, 3], [1, 0]] * (count // 2))
    plot = PathPlot(Polyline([(0, 0), moves.sum(axis=0)]), periods=True)
    plot.follow(np.cumsum(moves, axis=0), np.zeros(count))
    plot.save(tmp_path / "picture.svg", ".svg", "a path")
    svg = (tmp_path / "picture.svg").read_bytes()
    assert "steps per period, the mean of every 4" in texts(svg)
    # The first column has three periods, as number 0 is the start, and the last one.
    seen = np.stack([moves_of(svg, name, count) for name in "xy"])[:, [0, count // 2, -1]]
    heights = np.array([[1 / 3, 1 / 2, 1], [2, 3 / 2, 0]])
    scaled = (seen - seen[1, 2]) / (seen[1, 0] - seen[1, 2]) * 2
    assert scaled == pytest.approx(heights, abs=1e-3)


def test_names_of_pictures():
    assert picture_format("--plot", "a/b.c.SVG") == ".svg"
    assert picture_format("--plot", "x.png") == ".png"
    assert picture_format("--plot", None) == ""
    for name in ("x.pdf", "x", "-", ".svg"):
        message = f"^--plot {re.escape(name)}: choose a name that ends in .png or .svg$"
        with pytest.raises(BadInputError, match=message):
            picture_format("--plot", name)
