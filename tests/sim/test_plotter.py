import re
from itertools import pairwise
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from PIL import Image

from discreta.sim.plotter import KINDS, PALETTE, Pen, Plotter, PulseTiming, Screen

SVG = "{http://www.w3.org/2000/svg}"
TIMING = PulseTiming(length=3, space=4, setup=5, hold=2)

#: Two pulses down and one up, everything as short as TIMING lets it: pin 0 steps, 1 directs.
SOUND = [(0, 1), (5, 0), (8, 0), (12, 0), (15, 0), (17, 1), (22, 0), (25, 0)]


def changes(toggles, pins=4, idle=()):
    """Give clocks and levels from the toggles (clock, pin); the pins in ``idle`` begin at 1."""
    level = np.array([pin in idle for pin in range(pins)], dtype=np.int64)
    rows = {}
    for clock, pin in sorted(toggles):
        level[pin] ^= 1
        rows[clock] = level.copy()
    return np.array(list(rows), dtype=np.int64), np.array(list(rows.values())).reshape(-1, pins)


def seen(toggles, timing=TIMING, *, start=(0, 0), idle=(), **options):
    plotter = Plotter(start, timing, **options)
    plotter.follow(*changes(toggles, 2 * len(start), idle))
    return plotter


def moved(toggles, old, new):
    """Move one toggle to another clock."""
    assert old in toggles
    return [new if toggle == old else toggle for toggle in toggles]


def on_y(toggles):
    return [(clock, pin + 2) for clock, pin in toggles]


def test_the_shortest_pulses_keep_the_rules():
    plotter = seen(SOUND + on_y(SOUND), start=(10, -10))
    assert plotter.violations == []
    assert plotter.violation_count == 0
    assert plotter.position.tolist() == [9, -11]
    assert plotter.pulses.tolist() == [3, 3]
    clocks, points = plotter.moves
    assert clocks.tolist() == [5, 12, 22]
    assert points.tolist() == [[9, -11], [8, -12], [9, -11]]
    assert (plotter.low.tolist(), plotter.high.tolist()) == ([8, -12], [10, -10])


@pytest.mark.parametrize("axis", "xy")
@pytest.mark.parametrize(
    ("toggles", "broken"),
    [
        (moved(SOUND, (8, 0), (7, 0)), "clock 7, axis {}: pulse length 2, at least 3"),
        (
            moved(moved(SOUND, (12, 0), (11, 0)), (15, 0), (14, 0)),
            "clock 11, axis {}: space between pulses 3, at least 4",
        ),
        (moved(SOUND, (0, 1), (1, 1)), "clock 5, axis {}: direction set-up 4, at least 5"),
        (moved(SOUND, (0, 1), (5, 1)), "clock 5, axis {}: direction set-up 0, at least 5"),
        (moved(SOUND, (17, 1), (16, 1)), "clock 16, axis {}: direction hold 1, at least 2"),
        (moved(SOUND, (17, 1), (15, 1)), "clock 15, axis {}: direction hold 0, at least 2"),
        (
            moved(SOUND, (17, 1), (13, 1)),
            "clock 13, axis {}: direction changes during a pulse 1, at most 0",
        ),
    ],
)
def test_a_clock_short_of_a_rule(toggles, broken, axis):
    """One clock less anywhere is one broken rule, of that axis alone, and no other motion."""
    pair = [toggles, on_y(SOUND)] if axis == "x" else [SOUND, on_y(toggles)]
    plotter = seen([toggle for toggles in pair for toggle in toggles])
    assert plotter.violations == [broken.format(axis)]
    assert plotter.violation_count == 1
    assert plotter.position.tolist() == [-1, -1]


def test_a_rule_of_no_clocks_is_one_of_one():
    """Only the hold may be left out: the direction may change as the pulse ends."""
    nothing = PulseTiming(0, 0, 0, 0)
    shortest = [(1, 1), (2, 0), (3, 0), (3, 1), (4, 0), (5, 0)]
    assert seen(shortest, nothing).violations == []
    assert seen(shortest, PulseTiming()).violations == [
        "clock 3, axis x: direction hold 0, at least 1"
    ]
    late = moved(shortest, (3, 1), (4, 1))
    assert seen(late, nothing).violations == ["clock 4, axis x: direction set-up 0, at least 1"]


@pytest.mark.parametrize(
    ("inverted", "idle"),
    [
        ({"inverted_steps": "x"}, (0,)),
        ({"inverted_directions": "x"}, (1,)),
        ({"inverted_steps": "xy", "inverted_directions": "x"}, (0, 1, 2)),
    ],
)
def test_pins_that_are_active_low(inverted, idle):
    plotter = seen(SOUND, idle=idle, **inverted)
    assert plotter.violations == []
    assert plotter.moves[0].tolist() == [5, 12, 22]
    assert plotter.position.tolist() == [-1, 0]
    # Taken as active high they are other pulses, or go another way.
    assert seen(SOUND, idle=idle).moves[1].tolist() != plotter.moves[1].tolist()


#: Up, up, up, up, down in quadrature, at the highest rate of TIMING.
TURNING = [(9, 0), (16, 1), (23, 0), (30, 1), (37, 1)]


def test_quadrature_counts_every_change():
    plotter = seen(TURNING + on_y(TURNING)[:3], start=(0, 7), kind="quadrature")
    assert plotter.violations == []
    assert plotter.moves[1].tolist() == [[1, 8], [2, 9], [3, 10], [4, 10], [3, 10]]
    assert plotter.pulses.tolist() == [5, 3]


@pytest.mark.parametrize(
    ("inverted", "idle"),
    [({"inverted_steps": "x"}, (0,)), ({"inverted_directions": "x"}, (1,))],
)
def test_quadrature_pins_that_are_active_low(inverted, idle):
    toggles = [(9, 0), (16, 1)]
    both_ways = [seen(toggles, idle=idle, kind="quadrature", **pins) for pins in (inverted, {})]
    # The pin that seems to be on from the start comes with the first change: both at once, or back.
    assert both_ways[0].position.tolist() == [2, 0]
    assert both_ways[1].position.tolist() != [2, 0]


def test_quadrature_is_broken_by_both_pins_and_by_haste():
    both = seen(moved(TURNING, (16, 1), (9, 1)), kind="quadrature")
    assert both.violations == ["clock 9, axis x: quadrature pins that change at once 2, at most 1"]
    assert both.position.tolist() == [1, 0]  # (1, 1), then 01, 00, and 01 again
    assert both.moves[0].tolist() == [23, 30, 37]
    early = seen(moved(TURNING, (16, 1), (15, 1)), kind="quadrature")
    assert early.violations == ["clock 15, axis x: quadrature spacing 6, at least 7"]
    assert early.position.tolist() == [3, 0]
    one = PulseTiming(0, 0)
    assert seen([(3, 0), (5, 1)], one, kind="quadrature").violations == []
    assert seen([(3, 0), (4, 1)], one, kind="quadrature").violations == [
        "clock 4, axis x: quadrature spacing 1, at least 2"
    ]


def judged(clocks, pins, start, timing, kind, inverted):
    """Read the rules clock by clock: the moves, and every broken rule as clock, axis and value."""
    moves, broken, position = [], [], list(start)
    axes = len(start)
    idle = [letter in pin for letter in "xyzabc"[:axes] for pin in inverted]
    level = [0] * (2 * axes)
    far = -(10**9)
    last = [{"lead": far, "trail": far, "turn": far, "change": far} for _ in start]
    length, space, setup = (max(1, n) for n in (timing.length, timing.space, timing.setup))
    for clock, row in zip(clocks.tolist(), pins.tolist(), strict=True):
        now = [pin ^ off for pin, off in zip(row, idle, strict=True)]
        moving = False
        for k in range(axes):
            (p, q), (old_p, old_q), at = now[2 * k : 2 * k + 2], level[2 * k : 2 * k + 2], last[k]
            if kind == "quadrature":
                order = [(0, 0), (1, 0), (1, 1), (0, 1)]
                way = (order.index((p, q)) - order.index((old_p, old_q))) % 4
                if way:
                    if clock - at["change"] < length + space:
                        broken.append((clock, k, clock - at["change"]))
                    at["change"] = clock
                if way == 2:
                    broken.append((clock, k, 2))
                elif way:
                    position[k] += 1 if way == 1 else -1
                    moving = True
                continue
            if old_p and not p:
                if clock - at["lead"] < length:
                    broken.append((clock, k, clock - at["lead"]))
                at["trail"] = clock
            if q != old_q:
                at["turn"] = clock
            if p and not old_p:
                if clock - at["trail"] < space:
                    broken.append((clock, k, clock - at["trail"]))
                if clock - at["turn"] < setup:
                    broken.append((clock, k, clock - at["turn"]))
                at["lead"] = clock
                position[k] += -1 if q else 1
                moving = True
            if q != old_q:
                if p and old_p:
                    broken.append((clock, k, 1))
                elif clock - at["trail"] < timing.hold:
                    broken.append((clock, k, clock - at["trail"]))
        level = now
        if moving:
            moves.append((clock, tuple(position)))
    return moves, broken


def noise(rng, axes, count, idle):
    """Give changes of pins at random, now and then slow enough for the rules."""
    clocks = np.cumsum(rng.integers(1, rng.choice([2, 4, 12]), count, endpoint=True))
    toggled = rng.random((count, 2 * axes)) < rng.choice([0.1, 0.4])
    return clocks, (np.cumsum(toggled, axis=0) + idle) % 2


def numbers(line):
    found = re.fullmatch(r"clock (\d+), axis (.): .* (\d+), at .*", line)
    assert found is not None
    clock, letter, value = found.groups()
    return int(clock), "xyzabc".index(letter), int(value)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(12))
def test_the_rules_read_clock_by_clock(kind, seed):
    """The same moves and broken rules, and wherever the changes are cut."""
    rng = np.random.default_rng(seed)
    axes = int(rng.integers(2, 7))
    timing = PulseTiming(*rng.integers(0, 9, 4).tolist())
    inverted = ["".join(a for a in "xyzabc"[:axes] if rng.random() < 0.4) for _ in range(2)]
    idle = [int(a in pins) for a in "xyzabc"[:axes] for pins in inverted]
    clocks, pins = noise(rng, axes, 400, idle)
    start = rng.integers(-99, 99, axes).tolist()
    options = {"kind": kind, "inverted_steps": inverted[0], "inverted_directions": inverted[1]}
    moves, broken = judged(clocks, pins, start, timing, kind, inverted)
    assert len(moves) > 50
    assert len(broken) > 10

    cuts = [[], [0, 1, 1, 399, 400], range(400), np.sort(rng.integers(0, 400, 9))]
    for cut in cuts:
        plotter = Plotter(start, timing, **options)
        parts = zip(np.split(clocks, cut), np.split(pins, cut), strict=True)
        given = [plotter.follow(*part) for part in parts]
        plotter.finish(int(clocks[-1]) + 1)
        when, points = plotter.moves
        assert list(zip(when.tolist(), map(tuple, points.tolist()), strict=True)) == moves
        assert [clock for clocks, _ in given for clock in clocks.tolist()] == when.tolist()
        assert np.concatenate([led for _, led in given]).tolist() == points.tolist()
        assert plotter.violation_count == len(broken)
        assert list(map(numbers, plotter.violations)) == broken[:100]
        whole = [tuple(start), *(point for _, point in moves)]
        assert tuple(plotter.position.tolist()) == whole[-1]
        assert plotter.pulses.tolist() == [
            sum(a[k] != b[k] for a, b in pairwise(whole)) for k in range(axes)
        ]
        assert plotter.low.tolist() == np.min(whole, axis=0).tolist()
        assert plotter.high.tolist() == np.max(whole, axis=0).tolist()
        if kind == "step_direction":
            out = [k for k in range(axes) if pins[-1, 2 * k] != idle[2 * k]]
            assert [line.split()[3] for line in plotter.unfinished] == [
                f"{'xyzabc'[k]}:" for k in out
            ]
        else:
            assert plotter.unfinished == []


def test_all_are_counted_and_a_hundred_kept():
    toggles = [(clock, 0) for clock in range(1000, 1300)]
    plotter = seen(toggles, PulseTiming(2, 1))
    assert plotter.violation_count == 150
    assert plotter.violations[0] == "clock 1001, axis x: pulse length 1, at least 2"
    assert plotter.violations[99] == "clock 1199, axis x: pulse length 1, at least 2"
    assert len(plotter.violations) == 100


def test_pulses_still_out_at_the_end():
    plotter = seen([(5, 0), (7, 2), (9, 2)], PulseTiming(2, 2))
    plotter.finish(12)
    assert plotter.unfinished == ["clock 5, axis x: pulse still out after 7"]
    assert plotter.violations == []
    with pytest.raises(ValueError, match=r"^the end is clock 9: choose one behind the last change"):
        seen([(5, 0), (9, 2)]).finish(9)


def test_moves_need_not_be_kept():
    plotter = seen(SOUND, keep_moves=False)
    assert [len(part) for part in plotter.moves] == [0, 0]
    assert plotter.position.tolist() == [-1, 0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"kind": "abz"},
            "kind of pins is 'abz': choose 'step_direction' or 'quadrature'",
        ),
        ({"start": (1,)}, "number of axes is 1: choose a whole number from 2 to 6"),
        ({"inverted_steps": "z"}, "inverted steps are 'z': choose letters of 'xy', each once"),
        (
            {"inverted_directions": "xx"},
            "inverted directions are 'xx': choose letters of 'xy', each once",
        ),
    ],
)
def test_plotters_that_cannot_be(arguments, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        Plotter(**{"start": (0, 0), "timing": TIMING, **arguments})


def test_timings_that_cannot_be():
    with pytest.raises(ValueError, match=r"^pulse hold is -1: choose a whole number from 0$"):
        PulseTiming(hold=-1)
    with pytest.raises(TypeError, match=r"^pulse length must be a whole number from 0, not True$"):
        PulseTiming(length=True)


@pytest.mark.parametrize(
    ("clocks", "pins", "message"),
    [
        ([3, 4], [[0, 0, 0, 0]], "pins have the shape (1, 4), clocks (2,): give every clock 4 lev"),
        ([3], [[0, 0]], "pins have the shape (1, 2), clocks (1,): give every clock 4 levels"),
        ([4, 4], [[0] * 4] * 2, "the clocks of changes must rise: give every clock once, in order"),
        ([2], [[0] * 4], "the clocks of changes must rise: give every clock once, in order"),
        ([4], [[0, 0, 2, 0]], "a level of a pin must be 0 or 1"),
    ],
)
def test_changes_that_cannot_be(clocks, pins, message):
    plotter = seen([(2, 0)])
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        plotter.follow(np.array(clocks), np.array(pins))


def drawn(tmp_path, points, kind, *, cuts=(), title="a path"):
    """Draw points, the first of which is the start."""
    pen = Pen(points[0])
    for part in np.split(points[1:], cuts):
        pen.follow(part)
    path = tmp_path / "pen"
    pen.draw(path, kind, title)
    return path.read_bytes()


def vertices(svg, name="pen"):
    """Give the vertices of a curve, in the picture's units, upwards."""
    (group,) = (g for g in ElementTree.fromstring(svg).iter(f"{SVG}g") if g.get("id") == name)
    curve = next(group.iter(f"{SVG}path")).get("d")
    assert curve is not None
    return np.array(re.findall(r"[ML] (\S+) (\S+)", curve), dtype=float) * (1, -1)


STAIRS = np.array([(0, 0), (1, 0), (2, 0), (3, 1), (4, 2), (4, 2), (4, 1), (4, 0), (3, 0), (3, 9)])


def test_the_pen_draws_runs_of_moves_as_strokes(tmp_path):
    corners = np.array([(0, 0), (2, 0), (4, 2), (4, 0), (3, 0), (3, 9)])
    for cuts in ([], range(1, 9), [0, 4, 4]):
        pen = Pen(STAIRS[0])
        for part in np.split(STAIRS[1:], cuts):
            pen.follow(part)
        assert pen.vertices().tolist() == corners.tolist()
    seen = vertices(drawn(tmp_path, STAIRS, "svg"))
    unit = (seen[-1, 1] - seen[0, 1]) / 9
    assert (seen - seen[0]) / unit == pytest.approx(corners, abs=1e-3)  # equal scales


def test_a_pen_that_stands_still(tmp_path):
    assert Pen((5, -5)).vertices().tolist() == [[5, -5]]
    assert b"pen" in drawn(tmp_path, np.array([(5, -5)]), "svg")


@pytest.mark.parametrize("kind", ["svg", "png"])
def test_the_same_path_gives_the_same_bytes(tmp_path, kind):
    first = drawn(tmp_path, STAIRS, kind)
    assert drawn(tmp_path, STAIRS, f".{kind}", cuts=[1, 2, 6]) == first
    with mpl.rc_context({"lines.linewidth": 7, "font.size": 30, "figure.facecolor": "red"}):
        assert drawn(tmp_path, STAIRS, kind) == first
    assert drawn(tmp_path, STAIRS[:-1], kind) != first


def test_the_pen_says_what_it_draws(tmp_path):
    svg = drawn(tmp_path, np.pad(STAIRS, ((0, 0), (0, 1))), "svg", title="a solid")
    texts = [node.text for node in ElementTree.fromstring(svg).iter(f"{SVG}text")]
    assert {"a solid; x and y of xyz", "x, steps", "y, steps", "pen", "start", "end"} <= {*texts}
    assert len(vertices(svg)) == 6
    with pytest.raises(ValueError, match=r"^kind of picture is 'pdf': choose 'png' or 'svg'$"):
        drawn(tmp_path, STAIRS, ".pdf")


def test_the_pen_as_pixels(tmp_path):
    drawn(tmp_path, np.array([(0, 0), (100, 0), (100, 100), (0, 100)]), "png")
    with Image.open(tmp_path / "pen") as image:
        assert (image.format, image.size) == ("PNG", (990, 715))
        pixels = np.array(image.convert("RGB"))
    # The frame is black, the pen nearly so.
    pen = np.all((pixels > 20) & (pixels < 70), axis=2)
    rows, columns = (np.count_nonzero(pen, axis=axis) for axis in (1, 0))
    (top, bottom), (right,) = np.flatnonzero(rows > 300), np.flatnonzero(columns > 300)
    # Three sides of a square; the ends are under their marks.
    side = bottom - top
    assert rows[[top, bottom]] == pytest.approx(side, abs=12)
    assert columns[right] == pytest.approx(side, abs=2)


def from_line(points, line):
    """Give the largest distance of points from the nearest of a line's strokes, in steps."""
    first, way = line[:-1, None], np.diff(line, axis=0)[:, None].astype(float)
    ahead = points[None] - first
    along = np.sum(ahead * way, axis=2) / np.maximum(np.sum(way**2, axis=2), 1)
    off = ahead - np.clip(along, 0, 1)[..., None] * way
    return np.sqrt(np.min(np.sum(off**2, axis=2), axis=0)).max()


def rose(count, radius):
    angle = np.linspace(0, np.pi, count)
    radii = radius * np.cos(3 * angle)
    return np.rint(np.stack([radii * np.cos(angle), radii * np.sin(angle)], axis=1)).astype(int)


def test_a_long_line_is_thinned_out_to_what_can_be_seen(tmp_path):
    points = rose(400_000, 50_000)
    svg = drawn(tmp_path, points, "svg")
    assert len(svg) < 100_000
    pen = Pen(points[0])
    pen.follow(points[1:])
    line = pen.vertices()
    assert len(line) < 5000
    assert line[[0, -1]].tolist() == points[[0, -1]].tolist()
    # A picture has no 1000 pixels on its longer side.
    longer = np.ptp(points, axis=0).max()
    assert from_line(points[::97], line) < longer / 1000
    for cuts in ([1, 2, 200_001], range(0, 400_000, 65_536)):
        pen = Pen(points[0])
        for part in np.split(points[1:], cuts):
            pen.follow(part)
        assert pen.vertices().tolist() == line.tolist()


def test_the_sharp_corners_of_a_long_line_stay():
    """Slanted strokes, each many steps long: nothing but their ends is left."""
    rng = np.random.default_rng(5)
    corners = rng.integers(-30_000, 30_000, (12, 2))
    strokes = []
    for start, end in pairwise(corners):
        count = np.abs(end - start).max()
        strokes.append(np.rint(start + np.outer(np.arange(1, count + 1) / count, end - start)))
    pen = Pen(corners[0])
    pen.follow(np.concatenate(strokes).astype(int))
    line = pen.vertices()
    assert len(line) < 10_000
    near = np.abs(line[None] - corners[:, None]).max(axis=2).min(axis=1)
    assert near.max() <= 60  # a thousandth of the picture
    assert from_line(line, corners) <= 60


def test_a_stroke_there_and_back_stays():
    """It is on the line through its neighbours, but not between them."""
    index = np.arange(30_000)
    x = index // 2 + 2 * (index % 2)
    x[15_001] = 40_000
    pen = Pen((0, 0))
    pen.follow(np.stack([x, 0 * x], axis=1))
    line = pen.vertices()
    assert len(line) < 1000
    assert line[:, 0].max() == 40_000


def test_a_scribble_stays_a_small_picture(tmp_path):
    rng = np.random.default_rng(3)
    points = np.cumsum(rng.integers(-1, 2, (400_000, 2)), axis=0)
    svg = drawn(tmp_path, points, "svg")
    assert len(svg) < 3_000_000
    line = vertices(svg)
    # It still goes as far in every direction.
    shape = np.ptp(line, axis=0)
    assert shape[0] / shape[1] == pytest.approx(np.divide(*np.ptp(points, axis=0)), rel=0.02)


def exercise(xh, yh, xk, yk):
    """Run exercise 3's program; give its points: INT 10H with AH = 0CH, column CX, row DX."""
    ddx = kox = xk - xh
    ddy = koy = yk - yh
    cx, dx, sx, sy = xh, yh, 0, 0
    while True:
        yield cx, dx  # L1
        flag = 0
        while not flag:  # L2
            if not kox and not koy:
                return
            if kox:  # L6
                sx += ddx
                if sx > 0xFFFF:
                    sx, cx, kox, flag = sx & 0xFFFF, cx + 1, kox - 1, flag + 1
            if koy:  # L5
                sy += ddy
                if sy > 0xFFFF:
                    sy, dx, koy, flag = sy & 0xFFFF, dx + 1, koy - 1, flag + 1


def pulsed(points, timing):
    """Give the pins that step from point to point, each move in its own time."""
    toggles, clock, down = [], 1, [False] * len(points[0])
    for start, end in pairwise(points):
        for k, way in enumerate(np.subtract(end, start)):
            if way and (way < 0) != down[k]:
                down[k] = not down[k]
                toggles.append((clock, 2 * k + 1))
            if way:
                lead = clock + timing.setup
                toggles += [(lead, 2 * k), (lead + timing.length, 2 * k)]
        clock += timing.setup + timing.length + max(timing.hold, timing.space)
    return changes(toggles, 2 * len(points[0]))


def colours(path):
    """Read a PNG picture of the screen back: numbers of colours, row 0 at the bottom."""
    with Image.open(path) as image:
        assert (image.format, image.size) == ("PNG", (960, 600))
        parts = np.array(image.convert("RGB"))
    number = np.full(parts.shape[:2], -1)
    for colour, rgb in enumerate(PALETTE):
        number[np.all(parts == rgb, axis=2)] = colour
    assert number.min() >= 0
    assert np.array_equal(number, number[1::3, 1::3].repeat(3, axis=0).repeat(3, axis=1))
    return number[1::3, 1::3][::-1]


def shapes(path):
    """Read an SVG picture of the screen back in the same way."""
    root = ElementTree.fromstring(path.read_text())
    assert root.get("viewBox") == "0 0 320 200"
    ground = root.find(f"{SVG}rect")
    assert ground is not None
    assert ground.attrib == {"width": "320", "height": "200", "fill": "#000000"}
    number = np.zeros((200, 320), dtype=int)
    names = ["#" + bytes(rgb).hex() for rgb in PALETTE]
    for shape in root.iter(f"{SVG}path"):
        runs = re.findall(r"M(\d+) (\d+)h(\d+)v1h-(\d+)z", shape.get("d", ""))
        for x, y, run, back in (map(int, run) for run in runs):
            assert run == back
            assert not number[y, x : x + run].any()
            number[y, x : x + run] = names.index(shape.get("fill", ""))
    return number[::-1]


def test_the_exercise_on_its_own_screen(tmp_path):
    """The line of the exercise, through the pins: just the pixels its program draws."""
    program = list(exercise(0, 0, 200, 99))
    assert program[0] == (0, 0)
    assert program[-1] == (200, 99)
    plotter = Plotter(program[0], TIMING)
    plotter.follow(*pulsed(program, TIMING))
    assert plotter.violations == []
    screen = Screen(plotter.start, plotter.low, plotter.high)
    screen.plot(plotter.moves[1])
    white = {*program}
    for kind, read in ((".png", colours), (".svg", shapes)):
        path = tmp_path / f"screen{kind}"
        screen.save(path, kind)
        pixels = read(path)
        assert {*zip(*(part.tolist() for part in np.nonzero(pixels)[::-1]), strict=True)} == white
        assert {*np.unique(pixels).tolist()} == {0, 3}
        assert path.stat().st_size < 10_000


def test_colours_of_the_screen(tmp_path):
    screen = Screen((0, 0), (0, 0), (319, 199))
    for colour in range(4):
        row = np.array([(x, 10 * colour + 5) for x in range(7, 7 + 100 * colour, 2)] or [(0, 0)])
        screen.plot(row, colour)
    screen.plot(np.array([(319, 199)]), 2)
    for kind, read in (("png", colours), ("svg", shapes)):
        screen.save(tmp_path / kind, kind)
        pixels = read(tmp_path / kind)
        assert np.array_equal(pixels[::-1], screen.pixels)
        assert [np.count_nonzero(pixels == colour) for colour in range(1, 4)] == [50, 101, 150]
        assert pixels[0, 0] == 0  # black wipes out the start
        assert pixels[199, 319] == 2
        assert (pixels[15, 7], pixels[15, 8], pixels[25, 9], pixels[35, 11]) == (1, 0, 2, 3)


@pytest.mark.parametrize(
    ("low", "high", "scale", "first", "last"),
    [
        ((0, 0), (319, 199), 1, (0, 0), (319, 199)),
        ((3, 4), (319, 199), 1, (3, 4), (319, 199)),
        ((-1, 4), (318, 9), 1, (0, 4), (319, 9)),
        ((3, -4), (320, 90), 1, (0, 0), (317, 94)),
        ((5000, -900), (5319, -701), 1, (0, 0), (319, 199)),
        ((0, 0), (320, 199), 2, (0, 0), (160, 99)),
        ((0, 0), (10, 200), 2, (0, 0), (5, 100)),
        ((10, 0), (640, 100), 2, (0, 0), (315, 50)),
        ((-65_536, -65_536), (65_535, 65_535), 656, (0, 0), (199, 199)),
    ],
)
def test_where_a_path_is_on_the_screen(low, high, scale, first, last):
    screen = Screen(low, low, high)
    assert screen.scale == scale
    screen.plot(np.array([high]), 1)
    y, x = np.nonzero(screen.pixels[::-1])
    assert {*zip(x.tolist(), y.tolist(), strict=True)} == {first, last}


def test_the_screen_of_more_axes_shows_two():
    screen = Screen((1, 2, 9), (1, 2, -9), (5, 5, 9))
    screen.plot(np.array([(5, 5, -9)]))
    assert (screen.pixels[199 - 2, 1], screen.pixels[199 - 5, 5]) == (3, 3)


def test_points_beyond_the_screen():
    screen = Screen((0, 0), (0, 0), (30, 20))
    message = "point (31, 0) is not on the screen: give corners beyond (0, 0), (30, 20)"
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        screen.plot(np.array([(3, 3), (31, 0), (0, 21)]))
    assert np.count_nonzero(screen.pixels) == 1
    with pytest.raises(ValueError, match=r"^colour is '4': choose '0' or '1' or '2' or '3'$"):
        screen.plot(np.array([(3, 3)]), 4)
