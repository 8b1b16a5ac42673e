import re
from functools import cache

import pytest

from discreta.hdl.plain import PlainPorts
from discreta.hdl.verilog import verilog
from discreta.sim.foreign import SIMULATORS, run_testbench
from discreta.sim.methods import METHODS
from discreta.sim.testbench import testbench as write_bench
from discreta.sim.units import UNITS
from discreta.sim.vectors import golden_vectors
from tests.needs import need

DESIGNS = METHODS | UNITS


@cache
def texts(name, width=6, **others):
    """Write a core and its bench."""
    design = DESIGNS[name]
    axes = others.pop("axes", 2)
    choices = design.settings["default"] | others
    top = PlainPorts(design.core(width, axes, **choices))
    vectors = golden_vectors(design, top, design.model(width, axes, **choices))
    return verilog(top, "core"), write_bench(top, "core", vectors)


def run(text, bench, simulator="icarus"):
    need(simulator)
    return run_testbench(text, bench, "core_tb", simulator)


@pytest.mark.parametrize("name", DESIGNS)
def test_every_design_passes_in_icarus(name):
    code, said = run(*texts(name))
    assert re.match(r"PASS: core, \d+ clocks", said), said
    assert code == 0


@pytest.mark.parametrize(
    ("name", "width", "options"),
    [
        ("linear", 4, {"axes": 6}),
        ("linear", 32, {"preload": "zero"}),
        ("exact_line", 5, {"axes": 3}),
        ("circular", 16, METHODS["circular"].settings["lecture"]),
        ("exact_conic", 24, {}),
        ("carrier_circular", 8, METHODS["carrier_circular"].settings["lecture"]),
        ("device", 5, {"depth": 1, "kinds": ("line",)}),
        ("device", 5, {"depth": 2, "kinds": ("line", "arc")}),
        ("device", 5, {"depth": 3, "kinds": ("line",)}),
    ],
)
def test_other_parameters_pass_in_icarus(name, width, options):
    assert run(*texts(name, width, **options))[0] == 0


@pytest.mark.parametrize("name", ["linear", "device"])
def test_passes_in_verilator(name):
    code, said = run(*texts(name), "verilator")
    assert said.startswith("PASS: core, ")
    assert code == 0


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_a_broken_core_fails(simulator):
    text, bench = texts("linear")
    broken, count = re.subn(r"\bsy <= total;", "sy <= total + 1'b1;", text)
    assert count == 1
    code, said = run(broken, bench, simulator)
    assert code != 0
    assert re.match(r"FAIL: clock \d+: \w+ is -?\d+, expected -?\d+\n", said)
    assert "PASS" not in said


@pytest.mark.parametrize("what", ["register", "output"])
def test_what_is_unknown_fails(what):
    text, bench = texts("linear")
    if what == "register":
        broken, more = re.subn(r"(reg \[\d+:0\] p3) = \S+", r"\1", text)
        broken, count = re.subn(r"if \(rst\) p3 <= \S+;\n    else ", "", broken)
        assert more == 1
    else:
        broken, count = re.subn(r"assign position_x = .*;", "", text)
    assert count == 1
    code, said = run(broken, bench)
    assert code != 0
    assert re.match(r"FAIL: clock \d+: position_x is [xz], expected -?\d+\n", said)


def test_a_dead_core_fails():
    text, bench = texts("exact_arc")
    dead, count = re.subn(r"\.steps__valid\(steps_valid\)", ".steps__valid()", text)
    assert count == 1
    code, said = run(dead, bench)
    assert code != 0
    assert "steps_valid is z, expected" in said


def test_plain_verilog_of_1995_and_2001():
    """No word of it that a simulator of then would not know, but for $fatal."""
    _, bench = texts("device")
    assert not re.search(r"\b(logic|bit|int|always_\w+|string|assert)\b", bench)
    assert bench.isascii()
    assert set(re.findall(r"\$\w+", bench.partition("module ")[2])) == {
        "$display",
        "$fatal",
        "$finish",
    }
