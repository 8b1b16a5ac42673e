"""`discreta send`, to the simulated board and to a port."""

import json
import re
import signal
import sys
from pathlib import Path

import pytest

from discreta import cli
from discreta import send as sending
from discreta.boards.host import Host, LinkError
from discreta.hdl.controller import Controller
from discreta.hdl.device import exact_device
from discreta.sim.board import Board, BoardTerminal
from discreta.sim.plotter import Plotter, PulseTiming

POINTS = [(0, 0), (100, 0), (100, 60), (50, 100), (0, 60), (0, 0), (100, 60)]
CSV = "x,y\n" + "".join(f"{x},{y}\n" for x, y in POINTS)
GCODE = """G21 G90 F600
G1 X10 Y0
G3 X10 Y6 I0 J3
G1 X0
G2 X0 Y0 R3
M2
"""
WIDTH = ["--width", "8"]
PATH = ["send", "sim:", "house.csv", "--feed", "1/8", "--pulse", "2,2,3,3", *WIDTH]
PROGRAM = ["send", "sim:", "plate.ngc", "--steps-per-mm", "10", "--clock", "0.01", *WIDTH]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Work in a folder with a path and a program."""
    monkeypatch.chdir(tmp_path)
    Path("house.csv").write_text(CSV)
    Path("plate.ngc").write_text(GCODE)
    return tmp_path


@pytest.fixture
def discreta(capfd, optimized_engine):  # noqa: ARG001
    """Run the command line here; give exit code, standard output and standard error."""

    def run(*arguments):
        code = cli._run([str(argument) for argument in arguments])
        sys.stdout.flush()
        out, err = capfd.readouterr()
        return code, out, err

    return run


def table(text):
    """Give what a summary says, by its names."""
    return dict(re.split(r"  +", line, maxsplit=1) for line in text.splitlines())


def test_a_path_to_the_simulated_board(discreta):
    code, out, err = discreta(*PATH, "--plotter", "seen.png", "--json", "sent.json")
    assert (code, err) == (0, "")
    said = table(out)
    assert said["blocks"] == said["blocks done"] == "7"
    assert said["position"] == "100,60"
    assert said["pulses"] == "300,260"
    assert said["timing rules broken"] == said["bytes damaged"] == said["frames lost"] == "0"
    assert said["same points from the pins"] == said["position is the pulses"] == "yes"
    assert Path("seen.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads(Path("sent.json").read_text())["pulses"] == [300, 260]


@pytest.mark.parametrize("words", [PATH, PROGRAM], ids=["path", "program"])
def test_damage_and_loss_change_nothing_but_the_time(discreta, words):
    code, out, err = discreta(*words, "--damage", "0.02", "--lose", "0.1", "--seed", "3")
    assert (code, err) == (0, "")
    said = table(out)
    assert int(said["bytes damaged"]) > 0
    assert int(said["frames lost"]) > 0
    assert int(said["frames"]) > int(said["blocks"]) + 10
    assert said["blocks done"] == said["blocks"]
    assert said["same points from the pins"] == "yes"


def test_what_differs_at_the_pins_fails(discreta, monkeypatch):
    def without_one(*arguments):
        return sending_points(*arguments)[:-1]

    sending_points = sending.expected_points
    monkeypatch.setattr(sending, "expected_points", without_one)
    code, out, _ = discreta(*PATH)
    assert code == 1
    assert table(out)["same points from the pins"] == "no"


def test_an_interrupt_stops_the_machine_and_tells_where_it_stands(discreta, monkeypatch):
    follow = Host.send

    def interrupted(self, blocks, progress):
        def interrupt(status):
            if status.position[0] > 3:
                signal.raise_signal(signal.SIGINT)
            progress(status)

        follow(self, blocks, interrupt)
        self.wait(interrupt)

    monkeypatch.setattr(Host, "send", interrupted)
    code, out, err = discreta(*PATH[:4], "1/2000", *PATH[5:])
    assert (code, err) == (1, "")
    said = table(out)
    assert said["stopped"] == "STOP"
    x, y = map(int, said["position"].split(","))
    assert 3 < x < 100
    assert y == 0
    assert said["blocks done"] == "1"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_board_at_a_port(discreta):
    plotter = Plotter(POINTS[0], PulseTiming(2, 2, 3, 3))
    board = Board(Controller(exact_device(8), 8), watch=plotter.follow)
    terminal = BoardTerminal(board)
    try:
        code, out, err = discreta("send", terminal.name, *PATH[2:], "--baud", "9600")
        assert (code, err) == (0, "")
        assert "damaged" not in set(table(out))
        # And once more, from where it stands: it is told that it stands at the start.
        assert discreta("send", terminal.name, *PATH[2:])[0] == 0
    finally:
        terminal.close()
    assert plotter.pulses.tolist() == [600, 520]


def test_a_board_that_stands_still_for_a_reason(discreta):
    board = Board(Controller(exact_device(8), 8))
    terminal = BoardTerminal(board)
    try:
        board.switch("emergency", 1)
        code, _, err = discreta("send", terminal.name, *PATH[2:])
        expected = "the machine stands still: EMERGENCY; see to it, and give --clear"
        assert (code, err) == (1, f"discreta: {expected}\n")
        code, _, err = discreta("send", terminal.name, *PATH[2:], "--clear")
        assert code == 1
        assert "release the emergency button" in err
        board.switch("emergency", 0)
        assert discreta("send", terminal.name, *PATH[2:], "--clear")[0] == 0
    finally:
        terminal.close()


def test_no_answer_is_said_in_one_line(discreta, monkeypatch, folder):
    def nobody(_self):
        raise LinkError("no answer from the board")

    monkeypatch.setattr(Host, "open", nobody)
    code, out, err = discreta(*PATH, "--json", "sent.json")
    assert (code, out, err) == (1, "", "discreta: no answer from the board\n")
    assert not (folder / "sent.json").exists()


def test_without_pyserial(discreta, monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", None)
    code, _, err = discreta("send", "/dev/null", *PATH[2:])
    assert code == 2
    assert err == (
        "discreta: send needs pyserial: install it, or discreta with its extra, discreta[boards]\n"
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["send", "no-such-port", *PATH[2:]], "cannot open no-such-port: "),
        ([*PATH, "--baud", "9600"], "--baud is for a port, and sim: is none: leave it out"),
        (["send", "/dev/x", *PATH[2:], "--lose", "0.1"], "--lose is for the simulated board: give"),
        (["send", "/dev/x", *PATH[2:], "--plotter", "a.png"], "--plotter is for the simulated"),
        ([*PATH, "--damage", "1"], "1 is no part: choose a number from 0 to less than 1"),
        ([*PATH, "--clocks-per-bit", "3"], "clocks per bit are 3: choose a whole number from 4"),
        ([*PATH, "--kinds", "line,spline"], "'line,spline' are no kinds: give one or more of"),
        ([*PATH, "--kinds", "arc"], "--kinds arc: the path has lines: build the board with them"),
        ([*PROGRAM, "--kinds", "line"], "--kinds line: the path has arcs: build the board with"),
        (["send", "sim:", "house.csv"], "a path of support points has no speed: give --feed"),
        ([*PATH, "--clock", "1"], "--clock goes with G-code, and house.csv is read as CSV"),
        ([*PROGRAM, "--feed", "1"], "--feed does not go with G-code, the speed is that of F"),
        (PROGRAM[:5], "G-code has mm a minute: give --clock, that of the board, in MHz"),
        (["send", "sim:", "plate.ngc"], "plate.ngc is in mm or inches: give --steps-per-mm"),
        (["send", "sim:", "none.csv", "--feed", "1"], "cannot read none.csv: "),
        ([*PATH, "--plotter", "a.txt"], "--plotter a.txt: choose a name that ends in"),
    ],
)
def test_bad_input(discreta, folder, words, said):
    before = sorted(folder.iterdir())
    code, out, err = discreta(*words)
    assert (code, out) == (2, "")
    assert said in err
    assert err.startswith("discreta: ")
    assert err.count("\n") == 1
    assert sorted(folder.iterdir()) == before


def test_a_machine_that_stops_on_its_way_is_told_with_its_place(discreta):
    plotter = Plotter(POINTS[0], PulseTiming(2, 2, 3, 3))
    board = Board(Controller(exact_device(8), 8), watch=plotter.follow)
    board.switch("high_limit_y", 1)
    terminal = BoardTerminal(board)
    try:
        code, out, err = discreta("send", terminal.name, *PATH[2:])
    finally:
        terminal.close()
    assert (code, err) == (1, "")
    said = table(out)
    assert (said["stopped"], said["position"]) == ("LIMIT", "100,0")
    assert plotter.position.tolist() == [100, 0]
