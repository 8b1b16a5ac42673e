# amaranth: UnusedElaboratable=no
# (What is refused is not built.)
"""Whole ways through Yosys and nextpnr, of small cores."""

import json
import subprocess
import tempfile
from dataclasses import replace
from importlib.util import find_spec

import pytest
from amaranth import Module, Signal
from amaranth.back import rtlil
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part
from discreta.hdl.harness import Harness, LoneAccumulator
from discreta.hdl.linear import Linear
from discreta.hdl.parts import Summator
from discreta.sim.fpga import FPGAS
from discreta.sim.synth import RUNS, SEEDS, measure
from discreta.sim.yosys import yosys
from tests.hdl.parts.clocked import assert_refused
from tests.hdl.test_harness import Twice

MISSING = [
    name
    for name in (
        "pyosys",
        *sorted({f"yowasp_nextpnr_{fpga.tools.name}" for fpga in FPGAS.values()}),
    )
    if find_spec(name) is None
]
needs_boards = pytest.mark.skipif(
    bool(MISSING), reason=f"no {' and no '.join(MISSING)}: pip install 'discreta[boards]'"
)


class Wide(Part):
    """As many flip-flops as it has bits, each of another value."""

    def __init__(self, width):
        super().__init__({"a": In(1), "b": Out(1)})
        self.register = Signal(width)

    def elaborate(self, _):
        m = Module()
        register = self.register
        m.d.sync += register.eq((register << 1) ^ (register << 2) ^ self.a)
        m.d.comb += self.b.eq(register[-1])
        return m


def path_of(measured):
    assert measured.path is not None
    return measured.path


@needs_boards
@pytest.mark.parametrize(
    ("device", "least", "most"), [("hx8k", 184, 193), ("ecp5-25k", 200, 400), ("gw1n-9", 100, 400)]
)
def test_the_lone_accumulator(device, least, most):
    measured = measure(LoneAccumulator(16), device, (1,))
    assert measured.problem == ""
    assert (measured.flip_flops, measured.multipliers, measured.memories) == (17, 0, 0)
    assert measured.carries >= 8
    assert least < measured.fmax[1] < most
    path = path_of(measured)
    assert path.end in ("carry", "acc[15]")
    assert path.start.startswith("input addend[")
    # All along the carry, and neither the harness nor its reset.
    assert path.carries >= 6
    assert path.nanoseconds == pytest.approx(1000 / measured.fmax[1])
    assert 0 < path.routing_nanoseconds < path.nanoseconds


@needs_boards
def test_a_method():
    core = Linear(4)
    measured = measure(core, seeds=(1,), workers=2)
    assert measured.problem == ""
    # Every LUT and every flip-flop has a logic cell, some a common one.
    cells = measured.luts + measured.flip_flops
    assert max(measured.luts, measured.flip_flops) < measured.logic_cells < cells
    # Of the two codes of an error only the lower bits are ever set.
    assert measured.flip_flops == sum(map(len, core.registers.values())) - 2
    path = path_of(measured)
    assert {name.partition("[")[0] for name in (path.start, path.end)} <= core.registers.keys()
    assert path.levels + path.carries > 2


@needs_boards
def test_on_gowin_no_path_is_overlooked():
    measured = measure(Linear(4), "gw1n-9", (1,), workers=2)
    assert measured.luts == measured.cells["LUT4"] > 0
    # nextpnr knows no delay of these, and leaves out what goes through them.
    assert not measured.cells.keys() & {"LUT1", "LUT2", "LUT3"}
    assert path_of(measured).levels > 2


@needs_boards
def test_the_same_again_whatever_runs_at_once():
    went = []
    measured = measure(
        Summator(4, preload="half"), seeds=(3, 1), workers=2, progress=lambda: went.append(None)
    )
    assert len(went) == RUNS - len(SEEDS) + 2
    assert list(measured.fmax) == [3, 1]
    path = path_of(measured)
    assert measured.median == min(measured.fmax.values()) == pytest.approx(1000 / path.nanoseconds)
    assert measure(Summator(4, preload="half"), seeds=(3, 1)) == measured
    # A bit that starts from 1 is kept inverted, and found under its name all the same.
    assert not any("$" in end or "SB_" in end for end in (path.start, path.end))


@needs_boards
def test_nothing_of_core_and_harness_is_shared_or_left_out(tmp_path):
    harness = Harness(Twice())
    pins = [harness.domain.clk, harness.d, harness.q]
    (tmp_path / "twice.il").write_text(rtlil.convert(harness, ports=pins, name="top"))
    command = yosys("read_rtlil twice.il", "synth_ice40 -top top", "write_json twice.json")
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    netlist = json.loads((tmp_path / "twice.json").read_text())["modules"]["top"]
    kinds = [cell["type"] for cell in netlist["cells"].values()]
    # Both outputs are the same register: they are caught in the same three.
    count = len(harness.fed) + 3 + len(harness.caught) // 2 + len(harness.folded)
    assert sum(kind.startswith("SB_DFF") for kind in kinds) == count


@needs_boards
def test_what_does_not_fit_is_counted_but_not_placed(monkeypatch):
    small = replace(FPGAS["hx8k"], options=("--lp384", "--package", "qn32"))
    monkeypatch.setitem(FPGAS, "lp384", small)
    measured = measure(Wide(400), "lp384", (1,))
    assert (measured.fmax, measured.median, measured.path) == ({}, None, None)
    assert measured.flip_flops == 400
    assert measured.logic_cells >= 400
    assert "ICESTORM_LC" in measured.problem


@needs_boards
def test_an_interrupt_ends_all_that_runs_and_leaves_nothing(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    started = []

    class Popen(subprocess.Popen):
        def __init__(self, *args, **kwargs):
            super().__init__(*args, **kwargs)
            started.append(self)

    monkeypatch.setattr(subprocess, "Popen", Popen)

    def interrupt():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        measure(LoneAccumulator(4), workers=2, progress=interrupt)
    assert len(started) == 2
    assert None not in [process.returncode for process in started]
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_asked():
    core = LoneAccumulator(4)
    choose = " or ".join(map(repr, FPGAS))
    assert_refused(
        (ValueError, f"device is 'hx4k': choose {choose}"), lambda: measure(core, "hx4k")
    )
    assert_refused(
        (ValueError, "seeds are none: give one or more whole numbers"),
        lambda: measure(core, seeds=()),
    )
