"""Pins, and what is made of them."""

import re
from dataclasses import replace

import pytest

from discreta.boards.board import Board, Pin, constraints
from discreta.boards.catalogue import BOARDS

#: How a file of constraints says that a port is at a site.
PLACED = {
    "pcf": r"set_io(?: -pullup yes)? (\w+) (\w+)",
    "lpf": r'LOCATE COMP "(\w+)" SITE "(\w+)";',
    "cst": r'IO_LOC "(\w+)" (\w+);',
    "xdc": r"set_property -dict \{PACKAGE_PIN (\w+) .*\} \[get_ports (\w+)\]",
}

#: What every board has to have.
PORTS = {
    *("clk", "rx", "tx", "step_x", "direction_x", "step_y", "direction_y"),
    *("low_x", "high_x", "low_y", "high_y", "stop", "led_moving", "led_stopped"),
}

every_board = pytest.mark.parametrize("board", BOARDS.values(), ids=BOARDS)


def placed(board: Board, ending: str) -> list[tuple[str, ...]]:
    found = [match.groups() for match in re.finditer(PLACED[ending], constraints(board, ending))]
    return [pair[::-1] for pair in found] if ending == "xdc" else found


@every_board
@pytest.mark.parametrize("ending", PLACED)
def test_constraints_say_what_the_table_says(board, ending):
    rows = [pin.row() for pin in board.pins]
    assert placed(board, ending) == [(port, site) for port, _, _, site, *_ in rows]


@every_board
def test_every_pin_and_every_port_is_used_once(board):
    for values in (
        [pin.port for pin in board.pins],
        [pin.site for pin in board.pins],
        [pin.label for pin in board.pins if pin.label != "USB"],
    ):
        assert len(set(values)) == len(values)
    assert {pin.port for pin in board.pins} >= PORTS


@every_board
def test_only_inputs_are_pulled_and_every_switch_is(board):
    for pin in board.pins:
        assert not (pin.output and pin.pull)
        if pin.port.partition("_")[0] in ("low", "high", "stop"):
            # Nothing connected, nothing acts.
            assert (pin.pull, pin.low) == ("up", True)
        assert pin.meaning
        assert "{" not in pin.meaning


@every_board
def test_the_serial_link_keeps_its_baud_rate(board):
    """A receiver bears 5 % of both together, and the computer may be 2 % off."""
    assert board.clock / board.clocks_per_bit == pytest.approx(board.baud, rel=0.01)


def test_words_of_the_placers():
    board = replace(
        BOARDS["icebreaker"],
        oscillator=12_500_000,
        pins=(
            Pin("clk", "A1", "clock"),
            Pin("stop", "B2", "J1 1", pull="up", low=True, volts=1.8),
            Pin("tx", "C3", "USB", output=True),
        ),
    )
    assert constraints(board, "pcf") == "set_io clk A1\nset_io -pullup yes stop B2\nset_io tx C3\n"
    assert constraints(board, "lpf").splitlines() == [
        'LOCATE COMP "clk" SITE "A1";',
        'IOBUF PORT "clk" IO_TYPE=LVCMOS33 PULLMODE=NONE;',
        'LOCATE COMP "stop" SITE "B2";',
        'IOBUF PORT "stop" IO_TYPE=LVCMOS18 PULLMODE=UP;',
        'LOCATE COMP "tx" SITE "C3";',
        'IOBUF PORT "tx" IO_TYPE=LVCMOS33 PULLMODE=NONE;',
        'FREQUENCY PORT "clk" 12.5 MHZ;',
    ]
    assert constraints(board, "cst").splitlines() == [
        'IO_LOC "clk" A1;',
        'IO_PORT "clk" IO_TYPE=LVCMOS33 PULL_MODE=NONE;',
        'IO_LOC "stop" B2;',
        'IO_PORT "stop" IO_TYPE=LVCMOS18 PULL_MODE=UP;',
        'IO_LOC "tx" C3;',
        'IO_PORT "tx" IO_TYPE=LVCMOS33 PULL_MODE=NONE;',
    ]
    assert constraints(board, "xdc").splitlines()[:4] == [
        "set_property -dict {PACKAGE_PIN A1 IOSTANDARD LVCMOS33} [get_ports clk]",
        "set_property -dict {PACKAGE_PIN B2 IOSTANDARD LVCMOS18 PULLUP TRUE} [get_ports stop]",
        "set_property -dict {PACKAGE_PIN C3 IOSTANDARD LVCMOS33} [get_ports tx]",
        "create_clock -name clk -period 80 [get_ports clk]",
    ]
