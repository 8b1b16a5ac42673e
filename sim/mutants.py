"""Mutants of a core: one small defect each, made by Yosys, and which check catches it.

Yosys' ``mutate`` chooses a bit at a port of a cell, spread over the whole core, and inverts it,
sets it to 0 or 1, or inverts it where another bit is 0 or 1; clocks are left alone. All mutants are
in one design with a selector, which is 0 for the core itself. Every one is tried

- in Icarus, on the golden vectors of :mod:`discreta.sim.vectors`: the outputs at every clock, as in
  the test bench of the Verilog; if they are right every register besides, as in the simulations of
  the ladder;
- then by SMT: one clock of it is the core's, for all states and inputs, in every register and
  output.

The last one leaves no doubt: a mutant is caught, or proven to be the same machine, in every state
that there is. Such a one is no defect: what was changed makes no difference to anything.

Source: none, it is ours. The mutations are those of Yosys and of MCY.
"""

import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import z3
from amaranth.back import rtlil

from discreta.hdl.contract import Part
from discreta.hdl.plain import PlainPorts
from discreta.sim.equal import run_yosys
from discreta.sim.foreign import build_icarus, run_program
from discreta.sim.methods import METHODS
from discreta.sim.smt import Rtl
from discreta.sim.testbench import testbench
from discreta.sim.units import UNITS
from discreta.sim.vectors import SEED, Vectors, golden_vectors

__all__ = ["FEWEST", "Mutant", "Verdict", "judge", "mutants"]

#: A sample of fewer mutants says little.
FEWEST = 200

#: The input that chooses the mutant, and its bits: more than there will be mutants.
_SELECTOR, _BITS = "mutsel", 16

#: Milliseconds after which a solver gives up on a mutant.
_TIMEOUT = 60_000

#: The names of the checks, the weakest first.
OUTPUTS, REGISTERS, PROOF = "outputs", "registers", "proof"
CHECKS = (OUTPUTS, REGISTERS, PROOF)


@dataclass(frozen=True)
class Mutant:
    """One defect.

    Attributes
    ----------
    number : int
        From 1.
    what : str
        What is done to which bit of which cell.
    where : str
        The lines of the source that the cell comes from.
    """

    number: int
    what: str
    where: str


@dataclass(frozen=True)
class Verdict:
    """What the checks see of a mutant, up to the first that catches it.

    Attributes
    ----------
    mutant : Mutant
    caught : str
        The first one of :data:`CHECKS` that catches it, or empty.
    same : bool
        It is proven to be the core.
    """

    mutant: Mutant
    caught: str
    same: bool


@dataclass(frozen=True)
class _Mutated:
    """A core with all its mutants: the core's Verilog and SMT-LIB, and what the mutants are."""

    verilog: str
    smt: str
    mutants: tuple[Mutant, ...]


def mutants(top: PlainPorts, count: int, seed: int) -> _Mutated:
    """Make mutants of a core.

    Parameters
    ----------
    top : PlainPorts
        The core, all its registers observed.
    count : int
        How many.
    seed : int
        Which ones.
    """
    design = {"core.il": rtlil.convert(top, name="other")}
    base, listed = run_yosys(
        design,
        (
            "read_rtlil core.il",
            "proc -norom",
            "flatten",
            "opt -full",
            "wreduce",
            "opt -full",
            "opt_clean -purge",
            "write_rtlil base.il",
            f"mutate -list {2 * count} -seed {seed} -o list.txt",
        ),
        "base.il",
        "list.txt",
    )
    # Behind a flip-flop it would have no value before the first clock, the core itself neither; and
    # the clock is no logic.
    commands = [
        line
        for line in listed.splitlines()
        if "-mode " in line and not re.search(r"-port (Q|CLK) ", line)
    ][:count]
    chosen = "\n".join(
        f"{command} -ctrl {_SELECTOR} {_BITS} {number}"
        for number, command in enumerate(commands, start=1)
    )
    verilog, smt = run_yosys(
        {"base.il": base, "mutate.ys": chosen + "\n"},
        (
            "read_rtlil base.il",
            "script mutate.ys",
            "opt_clean",
            "write_verilog -noattr mutants.v",
            "async2sync",
            "dffunmap",
            "write_smt2 -bv mutants.smt2",
        ),
        "mutants.v",
        "mutants.smt2",
    )
    cells = re.findall(r"^  cell (\S+) (\S+)$", base, re.MULTILINE)
    kinds = {name: kind for kind, name in cells}
    found = [_said(number, command, kinds) for number, command in enumerate(commands, start=1)]
    return _Mutated(verilog, smt, tuple(found))


def _said(number: int, command: str, kinds: Mapping[str, str]) -> Mutant:
    """Say what a command of Yosys does, and where."""
    options = dict(re.findall(r"-(mode|cell|port|portbit|ctrlbit|wire|wirebit) (\S+)", command))
    sources = re.findall(r"-src (\S+)", command)
    where = sorted({line for source in sources for line in source.split("|")})
    shown = [re.sub(r"^.*/(?:site-packages/|(?=(?:hdl|sim|boards)/))", "", line) for line in where]
    shown = [re.sub(r":(\d+)(?:\.\d+-\d+\.\d+)?$", r":\1", line) for line in shown]
    doing = {
        "inv": "inverted",
        "const0": "always 0",
        "const1": "always 1",
        "cnot0": f"inverted where bit {options.get('ctrlbit')} is 0",
        "cnot1": f"inverted where bit {options.get('ctrlbit')} is 1",
    }[options["mode"]]
    kind = kinds.get(options.get("cell", ""), "?").lstrip("\\")
    wire = options.get("wire", "").lstrip("\\")
    port = f"{options.get('port', '').lstrip(chr(92))}[{options.get('portbit', '')}] of a {kind}"
    at = f", near {wire}[{options.get('wirebit')}]" if wire else ""
    return Mutant(number, f"{port}{at}: {doing}", ", ".join(dict.fromkeys(shown)))


def judge(
    name: str,
    width: int,
    choices: Mapping[str, Any],
    *,
    count: int = FEWEST,
    seed: int = SEED,
    workers: int = 1,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Iterator[Verdict]:
    """Try the mutants of a core, and give what catches each.

    Parameters
    ----------
    name : str
        That of the method.
    width : int
    choices : mapping
        The variant.
    count, seed : int
        How many mutants, and which.
    workers : int
        How many processes to run at once.
    progress : callable
        Called with how many of how many are judged.

    Raises
    ------
    RuntimeError
        Icarus is missing, or the core itself does not pass.
    """
    design = (METHODS | UNITS)[name]
    core = design.core(width, **choices)
    top = PlainPorts(core, observe=core.registers)
    mutated = mutants(top, count, seed)
    golden = design.model(width, **choices)
    vectors = golden_vectors(design, top, golden)
    shown = {port: row for port, row in vectors.outputs.items() if not port.startswith("reg_")}
    some = Vectors(vectors.inputs, shown)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for what, seen in ((REGISTERS, vectors), (OUTPUTS, some)):
            bench = testbench(top, "other", seen).replace(
                ".clk(clk)", f".clk(clk), .{_SELECTOR}(which)"
            )
            bench = bench.replace(
                "  reg clk;",
                f"  reg clk;\n  reg [{_BITS - 1}:0] which;\n"
                '  initial if (!$value$plusargs("which=%d", which)) which = 0;',
            )
            build_icarus(folder, mutated.verilog, bench, "other_tb", what)
        jobs = [mutant.number for mutant in mutated.mutants]
        with ProcessPoolExecutor(
            workers, initializer=_begin, initargs=(name, width, dict(choices), mutated.smt, place)
        ) as pool:
            # Of sums of many terms the solver may not decide whether Yosys has kept them.
            caught, _ = next(pool.map(_try, [0]))
            if caught:
                raise RuntimeError(f"{name} itself does not pass: {caught}")
            progress(0, len(jobs))
            results = pool.map(_try, jobs)
            found = zip(mutated.mutants, results, strict=True)
            for done, (mutant, (caught, same)) in enumerate(found, start=1):
                progress(done, len(jobs))
                yield Verdict(mutant, caught, same)


class _Judge:
    """What a process needs to try mutants: one clock of core and mutants, in the solver."""

    def __init__(self, core: Part, smt: str, folder: str):
        self.folder = Path(folder)
        self._rtl = rtl = Rtl(core)
        lines = [smt]
        # Twice: the mutant, and the core as it is in the same design.
        for prefix in ("mutant", "core"):
            for state, mark in (("before", ""), ("after", "'")):
                lines.append(f"(declare-fun |{prefix}.{state}| () |other_s|)")
                kinds = {f"{name}{mark}": (name, bits) for name, (bits, _) in rtl.inputs.items()}
                kinds |= {f"rst{mark}": ("rst", 1)}
                kinds |= {f"{prefix}.{_SELECTOR}{mark}": (_SELECTOR, _BITS)}
                kinds |= {
                    f"{prefix}.out.{name}{mark}": (name, bits)
                    for name, (bits, _) in rtl.outputs.items()
                }
                kinds |= {
                    f"{prefix}.{name}{mark}": (f"reg_{name}", bits)
                    for name, (bits, _) in rtl.registers.items()
                }
                for symbol, (port, bits) in kinds.items():
                    value = f"(|other_n {port}| |{prefix}.{state}|)"
                    value = f"(ite {value} #b1 #b0)" if bits == 1 else value
                    if prefix == "mutant" or symbol.startswith(prefix):
                        lines.append(f"(declare-fun |{symbol}| () (_ BitVec {bits}))")
                    lines.append(f"(assert (= |{symbol}| {value}))")
            lines.append(f"(assert (|other_t| |{prefix}.before| |{prefix}.after|))")
        self._clock = list(z3.parse_smt2_string("\n".join(lines)))
        self._core = self._chosen("core", 0)

    def _chosen(self, prefix: str, number: int) -> list[z3.BoolRef]:
        """State which mutant there is, in both clocks."""
        return [z3.BitVec(f"{prefix}.{_SELECTOR}{mark}", _BITS) == number for mark in ("", "'")]

    def _unlike(self, prefix: str) -> list[z3.BoolRef]:
        """State that the mutant leaves the same state in another way, or shows something else.

        ``prefix``: of the symbols of the other machine, empty for the RTL.
        """
        alike, claims = [], []
        for name, (bits, _) in self._rtl.registers.items():
            alike.append(z3.BitVec(f"mutant.{name}", bits) == z3.BitVec(prefix + name, bits))
            claims.append(z3.BitVec(f"mutant.{name}'", bits) == z3.BitVec(f"{prefix}{name}'", bits))
        for name, (bits, _) in self._rtl.outputs.items():
            name = f"out.{name}"
            claims.append(z3.BitVec(f"mutant.{name}", bits) == z3.BitVec(prefix + name, bits))
        return [*alike, z3.Not(z3.And(claims))]

    def differs(self, number: int) -> bool | None:
        """Tell whether a mutant differs from the core in any state; 0: the core, from its RTL.

        None: the solver gave up.
        """
        facts = [*self._clock, *self._core, *self._chosen("mutant", number)]
        facts += self._unlike("core.") if number else [*self._rtl.transition, *self._unlike("")]
        tactics = ("simplify", "propagate-values", "solve-eqs", "bit-blast", "aig", "sat")
        for solver in (z3.Then(*tactics).solver(), z3.Solver()):
            solver.set("timeout", _TIMEOUT)
            # One formula: adding many one by one takes longer than many a proof.
            solver.add(z3.And(*facts))
            answer = solver.check()
            if answer != z3.unknown:
                return answer == z3.sat
        return None

    def simulated(self, number: int, what: str) -> bool:
        """Tell whether a bench sees a mutant."""
        code, _ = run_program(["vvp", "-n", what, f"+which={number}"], self.folder)
        return code != 0


_judge: list[_Judge] = []


def _begin(name: str, width: int, choices: dict[str, Any], smt: str, folder: str) -> None:
    _judge[:] = [_Judge((METHODS | UNITS)[name].core(width, **choices), smt, folder)]


def _try(number: int) -> tuple[str, bool]:
    """Give the first check that catches a mutant, and whether it is the core; 0 is the core."""
    (judge,) = _judge
    for what in (OUTPUTS, REGISTERS):
        if judge.simulated(number, what):
            return what, False
    differs = judge.differs(number)
    return PROOF if differs else "", differs is False
