from fractions import Fraction
from math import hypot, sqrt
from pathlib import Path

import numpy as np
import pytest
from amaranth.hdl import Fragment

from discreta.hdl.device import Device
from discreta.hdl.plain import block_fields
from discreta.hdl.queue import BlockKind
from discreta.sim.gcode import Move, moves_of, read_moves
from discreta.sim.golden.exact_arc import ExactArc
from discreta.sim.golden.exact_line import ExactLine
from discreta.sim.machine import Drive
from discreta.sim.points import BadInputError
from discreta.sim.program import CORES, Cores, Program, program_blocks, run_program, speeds
from discreta.sim.simulate import default_engine

PLATE = str(Path(__file__).parents[2] / "examples" / "plate.ngc")
ENGINES = ["pysim"] + (["compiled"] if default_engine() == "compiled" else [])


def program(text, *, scale=10, width=16):
    lines = text.splitlines(keepends=True)
    return Program(moves_of(lines, "a.ngc", [Fraction(scale)] * 3, width))


def golden_path(move: Move, width: int) -> np.ndarray:
    """Give the points of a move by the golden model of its core, one clock at a time."""
    axes = len(move.start)
    letters, points = "xyz"[:axes], ("start", "end")
    if move.kind == "line":
        golden, names = ExactLine(width, axes), [f"{p}_{a}" for p in points for a in letters]
    else:
        golden, letters = ExactArc(width), "xy"
        names = [f"{p}_{a}" for p in (*points, "center") for a in "xy"]
        names += ["clockwise", "full_turns"]
    block = {f"blocks_{name}": value for name, value in zip(names, move.block, strict=True)}
    state, place, path = golden.reset(), np.array(move.start), []
    limit = 8 * int(move.true_length) + 200
    for clock in range(limit):
        out = golden.outputs(state)
        if out["steps_valid"]:
            place = place.copy()
            place[: len(letters)] += [out[f"steps_{a}"] for a in letters]
            path.append(place)
        if out["done"] or out["error"]:
            break
        state = golden.step(state, block | {"blocks_valid": int(clock == 0), "steps_ready": 1})
    else:
        pytest.fail(f"the golden model has not ended after {limit} clocks")
    return np.array(path)


def test_the_cores_step_as_the_golden_models_do_in_order():
    plate = Program(read_moves(PLATE, [Fraction(4)] * 3, 10))
    assert {move.kind for move in plate.moves} == set(CORES)
    cores = Cores(plate, 10)
    cores.run("pysim")
    assert cores.ends_reached == len(plate.moves)
    here = plate.start
    last = 0
    for number, when, points in cores:
        move = plate.moves[number]
        expected = golden_path(move, 10)
        assert np.array_equal(points, expected)
        assert np.abs(np.diff(points, axis=0, prepend=here[None])).max() == 1
        assert points[-1].tolist() == list(move.end)
        here = points[-1]
        # One after the other, a clock a step and some more for an arc's octants.
        assert (np.diff(when, prepend=last) > 0).all()
        last = when[-1]
        # Rounded by up to half a step on both axes at each end, and half a step by the steps.
        assert plate.errors(number, points).max() < 2.5
    assert last == cores.clocks
    for engine in ENGINES[1:]:
        again = Cores(plate, 10)
        again.run(engine)
        for (_, when, points), (_, other, there) in zip(cores, again, strict=True):
            assert np.array_equal(points, there)
            assert np.array_equal(when, other)


def test_on_the_grid_nothing_is_lost_by_rounding():
    square = program("F1 G0 X10\nG3 X0 Y10 I-10\nG1 X-10\nY0\nG3 X10 I10\nM2")
    cores = Cores(square, 10)
    cores.run("pysim")
    for number, _, points in cores:
        assert square.errors(number, points).max(initial=0) < 0.5 + 1e-9


def test_errors_are_those_from_the_programmed_curve():
    line, arc = program("F1 G1 X1.24 Y0.34\nG2 X2.24 I0.5\nM2").moves
    both = Program([line, arc])
    assert (line.end, arc.end) == ((12, 3), (22, 3))
    points = np.array([line.end, (0, 0), (15, 3)])
    off = both.errors(0, points)
    length = hypot(12.4, 3.4)
    assert off[0] == pytest.approx(abs(12 * 3.4 - 3 * 12.4) / length)
    assert off[1] == 0
    # Beyond the end it is that from the end.
    assert off[2] == pytest.approx(hypot(2.6, 0.4))
    assert both.errors(1, np.array([[17, 8]]))[0] == pytest.approx(abs(hypot(0.4, 4.6) - 5))


def test_lines_in_three_axes_with_arcs_between_run_core_by_core():
    drill = program("F1 G0 X10 Z-1\nG3 X0 Y10 I-10\nG1 X1 Y2 Z-7\nM2")
    cores = Cores(drill, 10)
    cores.run("pysim")
    assert cores.ends_reached == 3
    for (_, _, points), move in zip(cores, drill.moves, strict=True):
        assert np.array_equal(points, golden_path(move, 10))


def test_a_helix_moves_z_evenly_along_the_arc_and_ends_exactly():
    helix = program("F1 G0 X10\nG3 X0 Y10 Z3 I-10\nG2 X10 Y0 Z-2 I0 J-10 P2\nM2")
    cores = Cores(helix, 12)
    cores.run("pysim")
    assert cores.ends_reached == 3
    for (number, _, points), move in zip(cores, helix.moves, strict=True):
        assert points[-1].tolist() == list(move.end)
        if move.helical:
            x, y, z = points.T
            assert helix.errors(number, points).max() < 0.5 + 1e-9
            turned = np.abs(np.unwrap(np.arctan2(y, x)) - np.arctan2(move.start[1], move.start[0]))
            on_line = move.start[2] + (move.end[2] - move.start[2]) * turned / move.sweep
            # Half a step, and where the arc is up to a step and a half ahead or behind.
            assert np.abs(z - on_line).max() < 0.5 + 1.5 * 30 / 157 + 0.1


@pytest.mark.usefixtures("optimized_engine")
def test_a_helix_on_the_device():
    helix = program("F60 G0 X10\nG3 X0 Y10 Z3 I-10\nG2 X10 Y0 Z-2 I0 J-10 P2\nM2")
    feeds = speeds(helix.moves, Fraction(10_000), Fraction(600))
    summary = run_program(helix, width=12, engine="compiled", drive=Drive(), feeds=feeds)
    assert summary["end point reached"]
    assert summary["same points from the pins"]
    # The pauses of all moves are their lengths by their speeds.
    due = sum(move.true_length / feed for move, feed in zip(helix.moves, feeds, strict=True))
    assert abs(summary["device clocks"] / due - 1) < 0.01


def test_speeds_are_along_the_path():
    moves = program("G0 X1\nG1 F60 Y3\nG1 X4 Y7\nG3 X5 Y8 R1\nM2").moves
    rapid, *feeds = speeds(moves, Fraction(10_000), Fraction(600))
    assert rapid == Fraction(1, 100)
    # 60 mm a minute are 10 steps a second.
    assert [float(feed) for feed in feeds] == [pytest.approx(1 / 1000)] * 3
    # Where the axes differ, a line has as many steps a mm as lie on its way.
    scale = [Fraction(10), Fraction(10), Fraction(40)]
    (move,) = moves_of(["G1 F60 X3 Z4\n", "M2"], "a.ngc", scale, 16)
    assert float(speeds([move], Fraction(10_000), None)[0]) == pytest.approx(
        hypot(30, 160) / 5 / 10_000
    )


@pytest.mark.parametrize(
    ("clock", "rapid", "message"),
    [
        (100, None, "line 1 is a rapid: give --rapid, its speed in mm a minute"),
        (
            1,
            600,
            "line 1 has 600 mm a minute: the speed is 1e+2 steps per clock: the feed unit has "
            "2^-24 to 1; choose a slower one, or another --clock",
        ),
        (
            10**9,
            6000,
            "line 2 has 60 mm a minute: the speed is 1e-8 steps per clock: the feed unit has "
            "2^-24 to 1; choose a faster one, or another --clock",
        ),
    ],
)
def test_speeds_that_the_device_has_not(clock, rapid, message):
    moves = program("G0 X1\nG1 F60 Y3\nM2").moves
    with pytest.raises(BadInputError) as error:
        speeds(moves, Fraction(clock), None if rapid is None else Fraction(rapid))
    assert str(error.value) == message


def test_the_blocks_of_the_device():
    path = program("G1 F60 X3 Y4\nG2 F30 X4 Y5 I1\nG1 X0 Y0\nM2")
    device = Device(**{kind: CORES[kind].core(10) for kind in CORES})
    Fragment.get(device, None)  # it must be used
    fields = list(block_fields(device))
    feeds = [Fraction(1, 4), Fraction(1, 8), Fraction(3, 16)]
    blocks = program_blocks(device, path, Drive(), feeds)
    rows = [dict(zip(fields, row, strict=True)) for row in blocks.tolist()]
    kinds = [BlockKind(row["blocks_kind"]).name for row in rows]
    assert kinds == ["PLACE", "LINE", "ARC", "LINE"]
    assert [(row["blocks_end_x"], row["blocks_end_y"]) for row in rows] == [
        *[(0, 0), (30, 40), (40, 50), (0, 0)]
    ]
    assert (rows[2]["blocks_center_x"], rows[2]["blocks_center_y"]) == (40, 40)
    assert [row["blocks_clockwise"] for row in rows] == [0, 0, 1, 0]
    speed = [(row["blocks_feed_mantissa"], row["blocks_feed_exponent"]) for row in rows[1:]]
    assert speed == [(0, 2), (0, 3), (1 << 15, 3)]
    rest = [row["blocks_ahead"] for row in rows[1:]]
    last = 50 - 40 + 40 * sqrt(2)
    assert rest[2] == round(last)
    assert rest[0] > rest[1] > rest[2]


@pytest.mark.parametrize("engine", ENGINES)
def test_a_program_on_the_whole_device(engine):
    path = program("F60 G0 X3 Y4\nG2 X4 Y5 I1\nG1 X0 Y0\nM2")
    feeds = speeds(path.moves, Fraction(1000), Fraction(6000))
    drive = Drive(feed=max(feeds))
    alone = run_program(path, width=10, engine=engine)
    summary = run_program(path, width=10, engine=engine, drive=drive, feeds=feeds)
    assert summary["end point reached"]
    assert summary["same points from the pins"]
    assert summary["timing rules broken"] == 0
    assert {name: summary[name] for name in alone} == alone
    # 50 steps at 1000 steps a second, and the rest at 10: of 1000 clocks a second.
    rest = path.moves[1].true_length + path.moves[2].true_length
    assert summary["device clocks"] == pytest.approx(50 + rest * 100, rel=0.1)


def test_a_step_that_is_missing_fails(monkeypatch):
    path = program("F60 G1 X3 Y4\nG2 X4 Y5 I1\nM2")
    feeds = speeds(path.moves, Fraction(1000), None)

    def all_but_the_last(*given):
        return program_blocks(*given)[:-1]

    monkeypatch.setattr("discreta.sim.program.program_blocks", all_but_the_last)
    summary = run_program(path, width=10, drive=Drive(), feeds=feeds)
    assert not summary["same points from the pins"]
    assert not summary["end point reached"]


def test_the_picture_has_every_curve():
    path = program("F60 G1 X3 Y4\nG2 X4 Y5 I1\nG3 X4 Y5 I2 J0\nM2")
    outline = path.outline()
    assert outline[0].tolist() == [0, 0]
    assert outline[-1].tolist() == pytest.approx([40, 50])
    circle = outline[np.hypot(*(outline - [60, 50]).T) < 20 + 1e-6]
    assert len(circle) > 100
    near = path.near(np.array([40, 50]), 14)
    near = near[~np.isnan(near).any(axis=1)]
    assert (np.hypot(*(near - [80, 50]).T) > 25).all()
    assert np.hypot(*(near - [40, 50]).T).min() < 1
