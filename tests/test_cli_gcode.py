"""G-code on the command line."""

import csv
import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from discreta import cli
from discreta.sim.simulate import default_engine

PLATE = str(Path(__file__).parents[1] / "examples" / "plate.ngc")
PATH = ("simulate", "path")


@pytest.fixture
def discreta(monkeypatch, tmp_path):
    """Run a command in a folder of its own; give exit code, standard output and error."""
    monkeypatch.chdir(tmp_path)

    def run(*words, **files):
        for name, text in files.items():
            Path(f"{name}.ngc").write_text(text, encoding="utf-8")
        result = CliRunner().invoke(cli.cli, words, standalone_mode=False)
        error = result.exception
        if isinstance(error, cli.BadInputError | cli.click.UsageError):
            return 2, result.stdout, str(getattr(error, "message", error))
        if error:
            raise error
        return result.return_value or 0, result.stdout, result.stderr

    return run


def test_the_plate(discreta):
    files = ("--json", "plate.json", "--trace", "plate.csv", "--plot", "plate.png")
    code, out, err = discreta(*PATH, PLATE, "--steps-per-mm", "4", *files)
    assert (code, err) == (0, "")
    summary = json.loads(Path("plate.json").read_text())
    shown = {line.split("  ")[0]: line.split("  ")[-1] for line in out.splitlines()}
    assert shown["methods"] == summary["methods"] == "exact_line, exact_arc"
    assert (summary["moves"], summary["lines"], summary["arcs"]) == (21, 12, 9)
    assert summary["end point reached"] is True
    assert 0.5 <= summary["largest error"] < 2.5
    rows = list(csv.reader(Path("plate.csv").read_text().splitlines()))
    assert rows[:2] == [["clock", "x", "y"], ["0", "0", "0"]]
    assert len(rows) == 2 + summary["steps"]
    assert rows[-1] == [str(summary["clocks"]), "0", "0"]
    assert Path("plate.png").stat().st_size > 10_000


def test_the_plate_on_the_device(discreta):
    if default_engine() != "compiled":
        pytest.skip("takes too long without a C++ compiler")
    drive = ("--clock", "0.01", "--rapid", "3000", "--accel", "1e-3", "--pulse", "2,2,5,5")
    files = ("--json", "plate.json", "--plotter", "pins.png", "--screen", "screen.png")
    code, _, _ = discreta(*PATH, PLATE, "--steps-per-mm", "4", *drive, *files, "--trace", "t.csv")
    assert code == 0
    summary = json.loads(Path("plate.json").read_text())
    assert summary["same points from the pins"] is True
    assert summary["timing rules broken"] == 0
    # 4 steps a mm and 3000 mm a minute at 10,000 clocks a second.
    assert summary["feed"] == pytest.approx(0.02, rel=1e-4)
    assert len(Path("t.csv").read_text().splitlines()) == 2 + summary["steps"]
    assert all(Path(name).stat().st_size > 1000 for name in ("pins.png", "screen.png"))


def test_a_waveform_shows_the_device(discreta):
    words = ("--steps-per-mm", "1", "--clock", "0.001", "--vcd", "a.vcd")
    code, _, _ = discreta(*PATH, "a.ngc", *words, a="F600 G1 X3 Y4\nG2 X4 Y5 I1\nM2")
    assert code == 0
    assert "line_" in Path("a.gtkw").read_text()
    assert "arc_" in Path("a.gtkw").read_text()


@pytest.mark.parametrize(
    ("text", "axes"),
    [("x=80,y=80,z=400", (80, 80, 400)), ("X=1/2,Y=.5", None), ("x=2,y=4", (2, 4, 4))],
)
def test_steps_per_mm(discreta, text, axes):
    if axes is None:
        code, _, err = discreta(*PATH, "a.ngc", "--steps-per-mm", text, a="")
        assert code == 2
        assert "is not steps a mm" in err
        return
    z = "Z1 " if "z" in text else ""
    program = f"F1 G1 X1 Y1 {z}\nM2"
    code, _, _ = discreta(*PATH, "a.ngc", "--steps-per-mm", text, "--trace", "t.csv", a=program)
    assert code == 0
    last = Path("t.csv").read_text().splitlines()[-1]
    assert last.split(",")[1:] == [str(value) for value in axes[: 3 if z else 2]]


SCALE = ("--steps-per-mm", "10")
GOOD = "G0 X1\nF60 G1 X2\nM2"


@pytest.mark.parametrize(
    ("text", "words", "message"),
    [
        (GOOD, (), "a.ngc is in mm or inches: give --steps-per-mm, like --steps-per-mm 80"),
        ("G0 X1\nM3\nM2", SCALE, "a.ngc, line 2: M3 is not understood (the machine has no "
         "spindle): leave it out, or give --ignore M3"),
        (GOOD, (*SCALE, "--feed", "1"), "--feed does not go with G-code, the speed is that of F "
         "and --rapid: leave it out"),
        (GOOD, (*SCALE, "--preload", "half"), "--preload does not go with G-code, its cores have "
         "none: leave it out"),
        (GOOD, (*SCALE, "--method", "comparison"), "G-code runs on exact_line and exact_arc: leave "
         "out --method and --setting"),
        (GOOD, (*SCALE, "--rapid", "60"), "--rapid goes with the whole device, which turns mm a "
         "minute into clocks: give --clock, too"),
        (GOOD, (*SCALE, "--plotter", "a.png"), "--plotter goes with the whole device, which turns "
         "mm a minute into clocks: give --clock, too"),
        (GOOD, (*SCALE, "--clock", "1"), "a.ngc, line 1 is a rapid: give --rapid, its speed in mm "
         "a minute"),
        (GOOD, (*SCALE, "--vcd", "a.vcd"), "--vcd shows the device: give --clock, too"),
        (GOOD, (*SCALE, "--ignore", "G1"), "'G1' cannot be ignored: choose of G43,H,M0,M1,M3,M4,M5,"
         "M6,M7,M8,M9,M48,M49,S,T"),
        (GOOD, ("--steps-per-mm", "0"), "'0' is not steps a mm: give a number more than 0 for all "
         "axes, like 80, or one for each, like x=80,y=80,z=400"),
        (GOOD, (*SCALE, "--clock", "0"), "0 MHz are no clock: choose more than 0"),
    ],
)  # fmt: skip
def test_bad_input(discreta, text, words, message):
    code, out, err = discreta(*PATH, "a.ngc", *words, a=text)
    assert (code, out, err) == (2, "", message)
    assert [path.name for path in Path().iterdir()] == ["a.ngc"]


@pytest.mark.parametrize("words", [SCALE, ("--clock", "1"), ("--rapid", "1"), ("--ignore", "M3")])
def test_options_of_gcode_do_not_go_with_points(discreta, words):
    Path("p.csv").write_text("x,y\n0,0\n3,4\n")
    code, _, err = discreta(*PATH, "p.csv", *words)
    assert code == 2
    assert err == (
        f"{words[0]} goes with G-code, and p.csv is read as CSV: leave it out, or name a file that "
        "ends in .ngc, .nc, .gcode, .tap"
    )


def test_what_is_ignored(discreta):
    program = "M3 S1000\nG0 X1\nM5\nM30"
    assert discreta(*PATH, "a.ngc", *SCALE, "--ignore", "m3,M5,S", a=program)[0] == 0
