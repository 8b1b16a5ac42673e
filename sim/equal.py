"""Proves that what became of a core is the core still: its Verilog read again, its netlist.

The RTL and the other design go through Yosys to SMT-LIB each, and one clock of the two is compared,
all registers and inputs symbolic, ``rst`` too. The registers of the RTL have their names in the
other design as well; a state of the two belongs together where all of these agree. It is shown that

- the other design starts in a state that belongs to the reset state of the RTL;
- from states that belong together one clock leads to states that do, whatever the inputs;
- in such states every output is the same.

So the two show the same at every clock, for ever. No flip-flop of the other design is left out: one
without the name of a register may have any value in this. Where synthesis found that a bit never
changes, or that two are always the same, so has the other design, and the proof shows that it is
right. Needs the ``prove`` extra, which brings the iCE40's synthesis and cell models as well.

Source: none, it is ours.
"""

import json
import re
import subprocess
import tempfile
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import z3
from amaranth.back import rtlil
from amaranth.hdl import Fragment
from amaranth.hdl._ir import PortDirection  # there is no public way to it

from discreta.hdl.contract import Part
from discreta.hdl.plain import PlainPorts
from discreta.hdl.verilog import verilog
from discreta.sim.foreign import run_testbench
from discreta.sim.fpga import SynthesisError
from discreta.sim.methods import Design
from discreta.sim.smt import Obligation, Rtl, same
from discreta.sim.testbench import testbench
from discreta.sim.vectors import golden_vectors
from discreta.sim.yosys import yosys

__all__ = [
    "Netlist",
    "cell_models",
    "netlist",
    "netlist_equivalence",
    "run_yosys",
    "simulate_netlist",
    "verilog_equivalence",
]

#: What makes SMT-LIB of a design whose top module is given; names are kept for the comparison.
_TO_SMT = (
    "hierarchy -check -top {top}",
    "proc -norom",
    "flatten",
    "opt -full",
    "async2sync",
    "dffunmap",
    "write_smt2 -bv -wires out.smt2",
)


def run_yosys(files: Mapping[str, str], commands: Iterable[str], *wanted: str) -> list[str]:
    """Run commands of Yosys in a folder with some files, and give texts that it writes there.

    Raises
    ------
    SynthesisError
        It says that something is wrong.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for name, text in files.items():
            (folder / name).write_text(text)
        done = subprocess.run(
            yosys(*commands), cwd=folder, capture_output=True, text=True, check=False
        )
        if done.returncode:
            said = done.stdout + done.stderr
            errors = re.findall(r"ERROR: .*", said) or said.splitlines()[-1:]
            raise SynthesisError("; ".join(errors))
        return [(folder / name).read_text() for name in wanted]


@dataclass(frozen=True)
class Netlist:
    """What synthesis for the iCE40 made of a core.

    Attributes
    ----------
    text : str
        Verilog, of the FPGA's own cells.
    cells : dict of str to int
        How many of each type there are.
    registers : dict of str to list of (str or int)
        What holds the bits of every register, the lowest first: a flip-flop by its name, or 0 or 1
        where the bit never changes.
    """

    text: str
    cells: dict[str, int]
    registers: dict[str, list[str | int]]


def netlist(core: Part, module: str) -> Netlist:
    """Synthesize a core for the iCE40.

    Parameters
    ----------
    core : Part
    module : str
        Name of the top module; its ports are those of :class:`~discreta.hdl.plain.PlainPorts`.

    Raises
    ------
    SynthesisError
        Yosys refuses the core.
    """
    top = core if isinstance(core, PlainPorts) else PlainPorts(core)
    synthesis = f"synth_ice40 -device hx -top {module}"
    commands = (
        "read_rtlil core.il",
        f"{synthesis} -run begin:map_ffs",
        # From here on a flip-flop keeps its name; later the wires of the registers are gone.
        "rename -wire t:$_*DFF*_",
        f"select {module}",
        "write_json -selected named.json",
        "select -clear",
        f"{synthesis} -run map_ffs:",
        "delete t:$scopeinfo",
        "write_json made.json",
        "write_verilog -noattr netlist.v",
    )
    design = {"core.il": rtlil.convert(top, name=module, emit_src=False)}
    text, named, made = run_yosys(design, commands, "netlist.v", "named.json", "made.json")
    wires, flip_flops = (json.loads(named)["modules"][module][of] for of in ("netnames", "cells"))
    holders: dict[Any, str | int] = {"0": 0, "1": 1}
    for name, cell in flip_flops.items():
        if "DFF" in cell["type"]:
            (bit,) = cell["connections"]["Q"]
            holders[bit] = name
    registers = {}
    for name, path in _paths(top).items():
        bits = wires[".".join(path)]["bits"]
        registers[name] = [holders[bit] for bit in bits]
    cells = json.loads(made)["modules"][module]["cells"]
    lost = [
        holder
        for bits in registers.values()
        for holder in bits
        if isinstance(holder, str) and holder not in cells
    ]
    if lost:
        raise SynthesisError(f"flip-flops that synthesis has renamed: {', '.join(lost)}")
    kinds = Counter(cell["type"] for cell in cells.values())
    return Netlist(text, dict(sorted(kinds.items())), registers)


def cell_models() -> str:
    """Give Yosys' own models of the iCE40's cells, as Verilog."""
    import pyosys

    (package,) = pyosys.__path__
    # A default of a port is not Verilog.
    text = Path(package, "share", "ice40", "cells_sim.v").read_text()
    return "`define NO_ICE40_DEFAULT_ASSIGNMENTS\n`define ICE40_HX\n" + text


def netlist_equivalence(core: Part, made: Netlist | None = None) -> list[Obligation]:
    """State that the iCE40 netlist of a core is the core.

    ``made``: the netlist, its top module called ``other``; by default what is synthesized.
    """
    made = netlist(core, "other") if made is None else made
    commands = [
        "read_verilog netlist.v",
        "read_verilog -defer -D ICE40_HX -D NO_ICE40_DEFAULT_ASSIGNMENTS +/ice40/cells_sim.v",
        *_commands(),
    ]
    (smt,) = run_yosys({"netlist.v": made.text}, commands, "out.smt2")
    values = {}
    for name, bits in made.registers.items():
        # No flip-flop of an iCE40 starts from 1: such a one holds its bit inverted.
        init = core.registers[name].init
        values[name] = [
            holder if isinstance(holder, int) else (f"{holder}.Q", bool(init >> index & 1))
            for index, holder in enumerate(bits)
        ]
    return _equivalence(core, smt, values, "iCE40 netlist")


def simulate_netlist(design: Design, width: int, choices: Mapping[str, Any]) -> tuple[bool, str]:
    """Run golden vectors through the netlist of a core in Icarus, with Yosys' models of its cells.

    Every output is compared at every clock.

    Returns
    -------
    same, said : bool, str
        Whether all are the same, and the bench's own word.

    Raises
    ------
    RuntimeError
        Icarus is missing, or did not end in time.
    """
    top = PlainPorts(design.core(width, **choices))
    made = netlist(top, "core")
    vectors = golden_vectors(design, top, design.model(width, **choices))
    code, said = run_testbench(
        f"{made.text}\n{cell_models()}", testbench(top, "core", vectors), "core_tb", "icarus"
    )
    return code == 0 and said.startswith("PASS: "), said


def verilog_equivalence(core: Part, text: str | None = None) -> list[Obligation]:
    """State that the Verilog of a core, read again by Yosys, is the core.

    Parameters
    ----------
    core : Part
    text : str
        The Verilog, with ``other`` for its top module; by default what is emitted.
    """
    text = verilog(core, "other") if text is None else text
    commands = ["read_verilog design.v", *_commands()]
    (smt,) = run_yosys({"design.v": text}, commands, "out.smt2")
    wires, held = _wires(smt)
    found: dict[str, _Place] = {}
    for name, (parts, aliases) in _aliases(core).items():
        # A keyword has a mark behind it; a name that came twice in the module has a number, or none
        # where the other one is gone.
        likely, possible = [], []
        for alias in sorted(aliases, key=lambda alias: alias.partition("$")[0] != name):
            stem = re.sub(r"[$][0-9]+", "", alias)
            likely.append(re.sub(r"\W", "_", stem) + (r"_\d+" if stem != alias else "_?"))
            possible.append(re.sub(r"\W", "_", stem) + r"(_\d*)?")
        before = "".join(rf"u_{re.sub(r'[$][0-9]+', '', part)}(?:_\d+)?\." for part in parts)
        bits = len(core.registers[name])
        candidates = [
            wire
            for like in (*likely, *possible)
            for wire in wires
            if wires[wire] == bits and re.fullmatch(before + like, wire)
        ]
        # The state itself is one.
        candidates.sort(key=lambda wire: wire not in held)
        # One that no one reads is gone.
        if candidates:
            found[name] = candidates[0]
    return _equivalence(core, smt, found, "Verilog")


def _commands() -> list[str]:
    return [command.format(top="other") for command in _TO_SMT]


def _wires(smt: str) -> tuple[dict[str, int], set[str]]:
    """Give the named wires of a design and their bits, and those of them that hold a state."""
    found = re.findall(r"^; yosys-smt2-(\w+) (\S+) (\d+)", smt, re.MULTILINE)
    wires = {name: int(bits) for kind, name, bits in found if kind != "input"}
    return wires, {name for kind, name, _ in found if kind == "register"}


def _paths(core: Part) -> dict[str, tuple[str, ...]]:
    """Give the place of every register: the instances that lead to it, and its own name."""
    top = core if isinstance(core, PlainPorts) else PlainPorts(core)
    ports = {name: (port, PortDirection.Input) for name, port in top.inputs.items()}
    ports |= {name: (port, PortDirection.Output) for name, port in top.outputs.items()}
    _, names = rtlil.convert_fragment(Fragment.get(top, None), ports, "other", emit_src=False)
    return {name: tuple(names[register][1:]) for name, register in top.core.registers.items()}


def _aliases(core: Part) -> dict[str, tuple[tuple[str, ...], set[str]]]:
    """Give the instances that lead to every register, and all names it has in its module."""
    design = {"core.il": rtlil.convert(PlainPorts(core), name="other", emit_src=False)}
    (text,) = run_yosys(design, ("read_rtlil core.il", "proc", "write_json core.json"), "core.json")
    modules = json.loads(text)["modules"]
    found = {}
    for name, (*parts, last) in _paths(core).items():
        module = modules["other"]
        for part in parts:
            module = modules[module["cells"][part]["type"]]
        nets = {net: wire["bits"] for net, wire in module["netnames"].items()}
        same_bits = {net.lstrip("\\") for net, bits in nets.items() if bits == nets[last]}
        found[name] = (tuple(parts), same_bits)
    return found


#: Where a register of the other design is: a wire, or bit by bit, the lowest first, a constant or a
#: wire and whether it is inverted.
_Place = str | list[int | tuple[str, bool]]


def _equivalence(core: Part, smt: str, places: Mapping[str, _Place], what: str) -> list[Obligation]:
    """State that a design in SMT-LIB, its module ``other``, is the core."""
    rtl = Rtl(core)
    lines = [smt]
    for state, mark in (("before", ""), ("after", "'")):
        lines.append(f"(declare-fun |{state}| () |other_s|)")
        wires: dict[str, tuple[_Place, int]] = {"rst": ("rst", 1)}
        wires |= {name: (name, bits) for name, (bits, _) in rtl.inputs.items()}
        wires |= {f"other.out.{name}": (name, bits) for name, (bits, _) in rtl.outputs.items()}
        wires |= {
            f"other.{name}": (place, rtl.registers[name][0]) for name, place in places.items()
        }
        for symbol, (place, bits) in wires.items():
            lines.append(f"(declare-fun |{symbol}{mark}| () (_ BitVec {bits}))")
            lines.append(f"(assert (= |{symbol}{mark}| {_value(place, bits, state)}))")
    lines += ["(assert (|other_t| |before| |after|))", "(assert (|other_i| |before|))"]
    *clock, initial = z3.parse_smt2_string("\n".join(lines))

    def agree(prefix: str, mark: str, names: Iterable[str]) -> dict[str, z3.BoolRef]:
        kinds = rtl.outputs if prefix else rtl.registers
        return same(
            {name: z3.BitVec(f"other.{prefix}{name}{mark}", kinds[name][0]) for name in names},
            {name: z3.BitVec(f"{prefix}{name}{mark}", kinds[name][0]) for name in names},
        )

    registers, outputs = tuple(places), tuple(rtl.outputs)
    together = [*rtl.transition, *clock, *agree("", "", registers).values()]
    begin = {
        name: z3.BitVec(f"other.{name}", register.shape().width) == register.init
        for name, register in core.registers.items()
        if name in places
    }
    there_are = f"{len(registers)} of {len(rtl.registers)}"
    return [
        Obligation(
            f"{what} = RTL: it starts from the reset state, in all registers left ({there_are})",
            [*clock, initial],
            begin,
        ),
        Obligation(
            f"{what} = RTL: every register after one clock, with and without rst, for all states "
            "in which the two agree and all inputs",
            together,
            agree("", "'", registers),
            together=True,
        ),
        Obligation(
            f"{what} = RTL: every output ({len(outputs)}), for all states in which the two agree",
            together,
            agree("out.", "", outputs),
            together=True,
        ),
    ]


def _value(place: _Place, bits: int, state: str) -> str:
    """Write the value of a register in a state, in SMT-LIB."""
    if isinstance(place, str):
        value = f"(|other_n {place}| |{state}|)"
        return f"(ite {value} #b1 #b0)" if bits == 1 else value
    digits = []
    for bit in reversed(place):
        if isinstance(bit, int):
            digits.append(f"#b{bit}")
        else:
            wire, inverted = bit
            high, low = ("#b0", "#b1") if inverted else ("#b1", "#b0")
            digits.append(f"(ite (|other_n {wire}| |{state}|) {high} {low})")
    return f"(concat {' '.join(digits)})" if len(digits) > 1 else digits[0]
