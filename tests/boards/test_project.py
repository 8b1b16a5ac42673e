"""The project for Vivado: Verilog that goes with its pins."""

import re
import subprocess

import pytest

from discreta.boards.catalogue import BOARDS
from discreta.boards.project import project
from discreta.boards.top import Top
from discreta.sim.yosys import yosys
from tests.sim.test_synth import needs_boards

BOARD = BOARDS["arty-a7"]


@pytest.fixture(scope="module")
def texts():
    return project(BOARD, Top(BOARD))


def test_files_of_the_project(texts):
    assert list(texts) == ["top.v", "top.xdc", "build.tcl"]
    assert f"-part {BOARD.fpga}" in texts["build.tcl"]
    assert re.findall(r"read_\w+ (\S+)", texts["build.tcl"]) == [*texts][:2]
    assert project(BOARD, Top(BOARD)) == texts


def test_ports_are_the_pins(texts):
    (header,) = re.findall(r"^module top\((.*)\);", texts["top.v"], flags=re.MULTILINE)
    assert set(header.split(", ")) == {pin.port for pin in BOARD.pins}
    for pin in BOARD.pins:
        assert f"  {'output' if pin.output else 'input'} {pin.port};" in texts["top.v"]


@needs_boards
def test_cells_of_xilinx_are_called_as_they_are(texts, tmp_path):
    (tmp_path / "top.v").write_text(texts["top.v"])
    library = "read_verilog -lib +/xilinx/cells_sim.v +/xilinx/cells_xtra.v"
    command = yosys(library, "read_verilog top.v", "hierarchy -check -top top", "check -assert")
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=120)


def test_the_clock_manager_makes_the_clock(texts):
    """Within what the data sheet allows: 600 to 1200 MHz inside."""
    (period, times, share) = (
        float(re.findall(rf"\.{name}\((\S+?)\)", texts["top.v"])[0])
        for name in ("CLKIN1_PERIOD", "CLKFBOUT_MULT_F", "CLKOUT0_DIVIDE_F")
    )
    assert 600 <= 1000 / period * times <= 1200
    assert 1e9 / period * times / share == pytest.approx(BOARD.clock)
