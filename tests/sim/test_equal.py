import re
from dataclasses import replace

import pytest

from discreta.hdl.verilog import verilog
from discreta.sim.equal import (
    netlist,
    netlist_equivalence,
    simulate_netlist,
    verilog_equivalence,
)
from discreta.sim.fpga import SynthesisError
from discreta.sim.methods import METHODS
from discreta.sim.smt import check
from discreta.sim.units import UNITS
from tests.needs import need

NETLISTS = ["linear", "circular", "exact_line", "exact_arc"]


def core_of(name, width=5):
    design = (METHODS | UNITS)[name]
    choices = UNITS["device"].variants()[0] if name == "device" else design.settings["default"]
    return design.core(width, **choices)


def failed(obligations):
    verdicts = [check(obligation) for obligation in obligations]
    assert len(verdicts) == 3
    return [verdict for verdict in verdicts if not verdict.holds]


# The conics and the feed unit are proven, too, but each takes its minute:
# `discreta prove exact_conic --width 4 --verilog`.
@pytest.mark.parametrize(
    "name",
    [
        *("exact_line", "linear", "comparison", "circular", "exact_arc"),
        *("carrier_linear", "two_stage_linear", "pulse"),
    ],
)
def test_the_verilog_read_again_is_the_rtl(name):
    assert failed(verilog_equivalence(core_of(name))) == []


@pytest.mark.parametrize("name", NETLISTS)
def test_the_netlist_is_the_rtl(name):
    assert failed(netlist_equivalence(core_of(name))) == []


@pytest.mark.parametrize("name", [*NETLISTS, "exact_conic"])
def test_the_netlist_shows_what_the_golden_model_does(name):
    need("icarus")
    same, said = simulate_netlist(METHODS[name], 5, METHODS[name].settings["default"])
    assert same, said
    assert re.match(r"PASS: core, \d+ clocks, \d+ blocks, \d+ steps\n", said)


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        (r"\bsy <= total;", "sy <= total + 1'b1;", "every register"),
        (r"(reg \[5:0\] p3) = 6'h00", r"\1 = 6'h01", "it starts"),
    ],
)
def test_a_fault_in_the_verilog_is_seen(old, new, part):
    core = core_of("linear")
    text, count = re.subn(old, new, verilog(core, "other"))
    assert count == 1
    wrong = failed(verilog_equivalence(core, text))
    assert wrong
    assert any(part in verdict.title for verdict in wrong)


def test_a_state_that_no_register_has_is_seen():
    """Every 65,536 clocks a step is dropped, by a counter that is not in the RTL."""
    core = core_of("linear")
    text, count = re.subn(
        r"assign steps_x = (.*);",
        r"reg [15:0] late = 0; always @(posedge clk) late <= late + 1;\n"
        r"  assign steps_x = late == 16'hffff ? 2'd0 : \1;",
        verilog(core, "other"),
    )
    assert count == 1
    assert [verdict.title for verdict in failed(verilog_equivalence(core, text))] == [
        "Verilog = RTL: every output (10), for all states in which the two agree"
    ]


@pytest.mark.parametrize("what", ["look-up table", "register"])
def test_a_fault_in_the_netlist_is_seen(what):
    core = core_of("linear")
    made = netlist(core, "other")
    if what == "look-up table":
        tables = re.findall(r"\.LUT_INIT\(16'h([0-9a-f]{4})\)", made.text)
        assert len(tables) > 50
        table = next(table for table in tables if "0" < table[0] < "f")
        text = made.text.replace(f"16'h{table}", f"16'h{int(table, 16) ^ 0xFFFF:04x}", 1)
        broken = replace(made, text=text)
    else:
        bits = made.registers["sx"]
        broken = replace(made, registers=made.registers | {"sx": bits[::-1]})
    assert broken != made
    assert failed(netlist_equivalence(core, broken))


def test_what_yosys_says_is_passed_on():
    core = core_of("linear")
    text = verilog(core, "other").replace("endmodule", "endmodul", 1)
    with pytest.raises(SynthesisError, match=r"ERROR: .*syntax error"):
        verilog_equivalence(core, text)


def test_every_bit_of_a_register_is_somewhere():
    core = core_of("linear")
    made = netlist(core, "other")
    held = {bit for bits in made.registers.values() for bit in bits if isinstance(bit, str)}
    flip_flops = sum(count for cell, count in made.cells.items() if cell.startswith("SB_DFF"))
    assert len(held) == flip_flops
    assert {name: len(bits) for name, bits in made.registers.items()} == {
        name: len(register) for name, register in core.registers.items()
    }
