"""Cells and clock speed of a core on an FPGA, measured alone between registers.

Yosys makes the cells and nextpnr places them and finds the critical path; both come from PyPI, with
the ``boards`` extra. The same core gives the same numbers on every machine.

The cells are those of the core by itself, as its own top module. For the clock it is placed and
routed in a :class:`~discreta.hdl.harness.Harness`, which has three pins, however many ports the
core has. The seed of the placement changes the clock by some percent, so there are several runs and
the median counts.

Source: none, it is ours.
"""

import json
import re
import statistics
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from amaranth.back import rtlil

from discreta.hdl.contract import Part, check_choice
from discreta.hdl.harness import Harness, bit_name
from discreta.hdl.plain import PlainPorts
from discreta.sim.fpga import (
    FPGAS,
    MAP,
    Fpga,
    Runner,
    SynthesisError,
    check_tools,
    nextpnr,
    synthesize,
    utilization,
)

__all__ = [
    "RUNS",
    "SEEDS",
    "CriticalPath",
    "Measurement",
    "measure",
]

#: Those of the placement.
SEEDS = (1, 2, 3, 4, 5)

#: Processes of a measurement with these: two of Yosys, and nextpnr's, one of which only packs.
RUNS = 3 + len(SEEDS)

#: MHz asked for: more than any core reaches, so that nextpnr never rests.
_TARGET = 400

#: Passes that leave the ports of a core open.
_ALONE = ("delete -port x:*", "delete t:?BUF")

#: What the way out of a carry cell is called.
_CARRY_OUT = ("COUT", "FCO")


@dataclass(frozen=True)
class CriticalPath:
    """The path that sets the clock of one run.

    Attributes
    ----------
    start, end : str
        Register, with the bit; ``input`` or ``output`` and the port for the harness's own.
    nanoseconds : float
    routing_nanoseconds : float
        What of it is spent on wires.
    levels : int
        Logic cells that it goes through, but for those along a carry.
    carries : int
        Carry cells that it goes through.
    """

    start: str
    end: str
    nanoseconds: float
    routing_nanoseconds: float
    levels: int
    carries: int


@dataclass(frozen=True)
class Measurement:
    """What a core takes of an FPGA, and how fast it is there.

    Attributes
    ----------
    luts, carries, multipliers, memories, flip_flops : int
        Cells of the core by itself, as Yosys counts them.
    cells : dict of str to int
        Cells of all types there are.
    logic_cells : int
        Logic cells of the FPGA that the core by itself takes when nextpnr has packed it.
    fmax : dict of int to float
        MHz, by seed; empty when it cannot be placed.
    path : CriticalPath or None
        That of the run with the median clock.
    problem : str
        Why it cannot be placed.
    """

    luts: int
    carries: int
    multipliers: int
    memories: int
    flip_flops: int
    cells: dict[str, int]
    logic_cells: int
    fmax: dict[int, float] = field(default_factory=dict)
    path: CriticalPath | None = None
    problem: str = ""

    @property
    def median(self) -> float | None:
        """The clock that counts, in MHz: that of one of the runs."""
        return statistics.median_low(self.fmax.values()) if self.fmax else None

    def of(self, limit: "Measurement") -> float | None:
        """Give its clock in parts of another one's; None when either cannot be placed."""
        if self.median is None or limit.median is None:
            return None
        return self.median / limit.median


def measure(
    core: Part,
    device: str = "hx8k",
    seeds: Iterable[int] = SEEDS,
    *,
    workers: int = 1,
    progress: Callable[[], None] = lambda: None,
) -> Measurement:
    """Measure a core on an FPGA.

    Parameters
    ----------
    core : Part
        Its ``registers``, if it has such an attribute, name the ends of the critical path.
    device : str
        One of :data:`FPGAS`.
    seeds : iterable of int
        Those of the placements, at least one.
    workers : int
        How many processes to run at once.
    progress : callable
        Called after every process; there are three, and one for every seed.

    Raises
    ------
    ValueError
        There is no such device, or no seed.
    ModuleNotFoundError
        Yosys or nextpnr is not installed: the extra ``boards`` brings both.
    SynthesisError
        Yosys refuses the core, or nextpnr has no cells of a kind that it needs.
    """
    check_choice("device", device, tuple(FPGAS))
    fpga, seeds = FPGAS[device], tuple(seeds)
    if not seeds:
        raise ValueError("seeds are none: give one or more whole numbers")
    check_tools(device)
    top = core if isinstance(core, PlainPorts) else PlainPorts(core)
    harness = Harness(top)
    pins = [harness.domain.clk, harness.d, harness.q]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write = Path(folder, "harness.il").write_text
        write(rtlil.convert(harness, ports=pins, name="harness", emit_src=False))
        Path(folder, "core.il").write_text(rtlil.convert(top, name="core", emit_src=False))
        Path(folder, MAP).write_text(fpga.map)
        Path(folder, f"top.{fpga.tools.constraints}").write_text(fpga.pins)
        run = Runner(folder, workers, progress)
        run(synthesize(fpga, "core", *_ALONE), synthesize(fpga, "harness"))
        (log,) = run(nextpnr(fpga, "--json", "core.json", "--pack-only"))
        types = [cell["type"] for cell in _module(folder / "core.json")["cells"].values()]
        cells = Counter(kind for kind in sorted(types) if not kind.startswith("$"))
        counts: dict[str, Any] = {
            what: sum(count for kind, count in cells.items() if re.fullmatch(kinds, kind))
            for what, kinds in fpga.cells.items()
        }
        measured = Measurement(
            **counts, cells=dict(cells), logic_cells=utilization(log)[fpga.logic][0]
        )
        try:
            run(*(_place(fpga, seed) for seed in seeds))
        except SynthesisError as error:
            return replace(measured, problem=str(error))
        reports = {seed: _json(folder / f"report-{seed}.json") for seed in seeds}
        measured = replace(measured, fmax={seed: _fmax(reports[seed]) for seed in seeds})
        seed = next(seed for seed in seeds if measured.fmax[seed] == measured.median)
        return replace(measured, path=_path(reports[seed], _Names(harness, folder, seed)))


def _json(file: Path) -> Any:
    return json.loads(file.read_text())


def _module(file: Path) -> Any:
    """Read the one module of a netlist; Yosys writes the library's, too."""
    return next(
        module
        for module in _json(file)["modules"].values()
        if "blackbox" not in module["attributes"] and "whitebox" not in module["attributes"]
    )


def _place(fpga: Fpga, seed: int) -> list[str]:
    target = ("--freq", str(_TARGET), "--timing-allow-fail", "--seed", str(seed))
    results = ("--report", f"report-{seed}.json", "--write", f"placed-{seed}.json")
    pins = fpga.tools.read if fpga.pins else ()
    return nextpnr(fpga, "--json", "harness.json", *target, *results, *pins)


def _fmax(report: Any) -> float:
    """Give MHz of the one clock there is."""
    (clock,) = report["fmax"].values()
    return clock["achieved"]


class _Names:
    """Says which register a cell of a placed netlist holds."""

    def __init__(self, harness: Harness, folder: Path, seed: int):
        placed = _module(folder / f"placed-{seed}.json")
        self._cells = placed["cells"]
        self._nets = {net["bits"][0]: name for name, net in placed["netnames"].items()}
        netlist = _module(folder / "harness.json")
        self._bits = {
            bit_name(name, index, len(net["bits"])): bit
            for name, net in netlist["netnames"].items()
            for index, bit in enumerate(net["bits"])
        }
        registers = getattr(harness.core.core, "registers", {})
        around = {"fed": ("input", harness.inputs), "caught": ("output", harness.outputs)}
        self._registers: dict[Any, str] = {}
        for name, cell in netlist["cells"].items():
            named = re.fullmatch(r"(.*?)(?:\$\d+)?(\[\d+\])?\$_\w+", name)
            if named is None or "Q" not in cell["connections"]:
                continue
            path, index = named[1], named[2] or ""
            register = path.rpartition(".")[2]
            if path in around:
                what, ports = around[path]
                path, index = f"{what} {ports[int(index[1:-1] or 0)]}", ""
            elif register in registers:
                path = register
            (driven,) = cell["connections"]["Q"]
            self._registers[driven] = path.removeprefix("core.core.") + index

    def __call__(self, cell: str) -> str:
        """Name the register, or the cell when it holds none."""
        outputs = self._cells[cell]["connections"]
        bits = outputs.get("Q") or outputs.get("O") or [None]
        return self._registers.get(self._bits.get(self._nets.get(bits[0], "")), cell)


def _path(report: Any, names: _Names) -> CriticalPath:
    """Read the critical path between two registers from nextpnr's report."""
    path = next(path for path in report["critical_paths"] if path["from"] == path["to"])["path"]
    through = [part["to"]["port"] for part in path if part["type"] == "logic"]
    carries = sum(port in _CARRY_OUT for port in through)
    return CriticalPath(
        start=names(path[0]["from"]["cell"]),
        end=names(path[-1]["to"]["cell"]),
        nanoseconds=sum(part["delay"] for part in path),
        routing_nanoseconds=sum(part["delay"] for part in path if part["type"] == "routing"),
        levels=len(through) - carries,
        carries=carries,
    )
