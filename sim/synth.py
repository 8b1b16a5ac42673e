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
import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from amaranth.back import rtlil

from discreta.hdl.contract import Part, check_choice
from discreta.hdl.harness import Harness, bit_name
from discreta.hdl.plain import PlainPorts
from discreta.sim.yosys import yosys

__all__ = [
    "DEVICES",
    "RUNS",
    "SEEDS",
    "CriticalPath",
    "Fpga",
    "Measurement",
    "SynthesisError",
    "check_tools",
    "measure",
]

#: Those of the placement.
SEEDS = (1, 2, 3, 4, 5)

#: Processes of a measurement with these: two of Yosys, and nextpnr's, one of which only packs.
RUNS = 3 + len(SEEDS)

#: MHz asked for: more than any core reaches, so that nextpnr never rests.
_TARGET = 400

#: The files with what an FPGA has of cells of its own, and of places of pins.
_MAP, _PINS = "map.v", "pins.cst"

#: Seconds between two looks at what runs.
_POLL = 0.02

#: What the way out of a carry cell is called.
_CARRY_OUT = ("COUT", "FCO")


class SynthesisError(Exception):
    """Yosys or nextpnr made nothing of a core; the message is what they say."""


@dataclass(frozen=True)
class Fpga:
    """An FPGA, and what makes a circuit of it.

    Attributes
    ----------
    name, title : str
    synthesis : str
        The command of Yosys, without its top module and its output.
    place : str
        The part of the name of nextpnr's package that follows ``yowasp_nextpnr_``.
    options : tuple of str
        What nextpnr is told of the FPGA.
    logic : str
        What nextpnr calls a LUT that is taken, be it as a LUT, for a carry or on the way to a
        flip-flop. On iCE40 every flip-flop takes one.
    cells : dict of str to str
        Regular expressions of the types of cells to count, by what is counted.
    map : str
        Verilog modules that stand for cells in the end, as Yosys' ``techmap`` takes them.
    pins : str
        Places of the harness's pins, for a nextpnr that chooses none, in its own words.
    """

    name: str
    title: str
    synthesis: str
    place: str
    options: tuple[str, ...]
    logic: str
    cells: dict[str, str]
    map: str = ""
    pins: str = ""


# nextpnr knows the delays of Gowin's LUT4 alone: what goes through a smaller one it takes for no
# path at all, and may find a clock of more than twice the real one.
_LUT4 = """
(* techmap_celltype = "LUT1" *)
module lut1 (input I0, output F);
    parameter INIT = 2'b0;
    LUT4 #(.INIT({8{INIT[1:0]}})) _TECHMAP_REPLACE_ (
        .I0(I0), .I1(1'b0), .I2(1'b0), .I3(1'b0), .F(F)
    );
endmodule
(* techmap_celltype = "LUT2" *)
module lut2 (input I0, I1, output F);
    parameter INIT = 4'b0;
    LUT4 #(.INIT({4{INIT[3:0]}})) _TECHMAP_REPLACE_ (
        .I0(I0), .I1(I1), .I2(1'b0), .I3(1'b0), .F(F)
    );
endmodule
(* techmap_celltype = "LUT3" *)
module lut3 (input I0, I1, I2, output F);
    parameter INIT = 8'b0;
    LUT4 #(.INIT({2{INIT[7:0]}})) _TECHMAP_REPLACE_ (
        .I0(I0), .I1(I1), .I2(I2), .I3(1'b0), .F(F)
    );
endmodule
"""

_HX8K = Fpga(
    name="hx8k",
    title="Lattice iCE40 HX8K",
    synthesis="synth_ice40 -device hx",
    place="ice40",
    options=("--hx8k", "--package", "ct256"),
    logic="ICESTORM_LC",
    cells={
        "luts": "SB_LUT4",
        "carries": "SB_CARRY",
        "multipliers": "SB_MAC16",
        "memories": "SB_RAM40_4K.*",
        "flip_flops": "SB_DFF.*",
    },
)

DEVICES = {
    fpga.name: fpga
    for fpga in (
        _HX8K,
        replace(
            _HX8K,
            name="up5k",
            title="Lattice iCE40 UP5K",
            synthesis="synth_ice40 -device u -dsp",
            options=("--up5k", "--package", "sg48"),
        ),
        Fpga(
            name="ecp5-25k",
            title="Lattice ECP5-25",
            synthesis="synth_ecp5",
            place="ecp5",
            options=("--25k", "--speed", "6", "--package", "CABGA381"),
            logic="TRELLIS_COMB",
            cells={
                "luts": "LUT4",
                "carries": "CCU2C",
                "multipliers": "MULT.*|ALU54B",
                "memories": "DP16KD|PDPW16KD",
                "flip_flops": "TRELLIS_FF",
            },
        ),
        Fpga(
            name="gw1n-9",
            title="Gowin GW1NR-9",
            synthesis="synth_gowin -family gw1n -nowidelut",
            place="himbaechel_gowin",
            options=("--device", "GW1NR-LV9QN88PC6/I5", "--vopt", "family=GW1N-9C"),
            logic="LUT4",
            cells={
                "luts": "LUT4",
                "carries": "ALU",
                "multipliers": "MULT.*|ALU54D",
                "memories": "(DP|SDP|SP|ROM|DPX9|SDPX9|SPX9|ROMX9)B?",
                "flip_flops": "DFF.*",
            },
            map=_LUT4,
            pins='IO_LOC "clk" 52;\nIO_LOC "d" 25;\nIO_LOC "q" 26;\n',
        ),
    )
}


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


def check_tools(device: str) -> None:
    """Raise :class:`ModuleNotFoundError` if Yosys or nextpnr is not there for one of the devices.

    To be asked before a core is made, as one that is made must be used.
    """
    for needed in ("pyosys", f"yowasp_nextpnr_{DEVICES[device].place}"):
        if find_spec(needed) is None:
            raise ModuleNotFoundError(f"no module named {needed!r}", name=needed)


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
        One of :data:`DEVICES`.
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
    check_choice("device", device, tuple(DEVICES))
    fpga, seeds = DEVICES[device], tuple(seeds)
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
        Path(folder, _MAP).write_text(fpga.map)
        Path(folder, _PINS).write_text(fpga.pins)
        run = _Runner(folder, workers, progress)
        run(*(_synthesize(fpga, module) for module in ("core", "harness")))
        (log,) = run(_nextpnr(fpga, "--json", "core.json", "--pack-only"))
        used = {kind: int(count) for kind, count in re.findall(r"(\w+): +(\d+)/ *\d+", log)}
        types = [cell["type"] for cell in _module(folder / "core.json")["cells"].values()]
        cells = Counter(kind for kind in sorted(types) if not kind.startswith("$"))
        counts: dict[str, Any] = {
            what: sum(count for kind, count in cells.items() if re.fullmatch(kinds, kind))
            for what, kinds in fpga.cells.items()
        }
        measured = Measurement(**counts, cells=dict(cells), logic_cells=used[fpga.logic])
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


def _synthesize(fpga: Fpga, module: str) -> list[str]:
    command = f"{fpga.synthesis} -top {module}"
    # Flip-flops are named after their registers as long as these have their own values: one that
    # starts from 1 is inverted where there are none but those that start from 0.
    return yosys(
        f"read_rtlil {module}.il",
        f"{command} -run begin:map_ffs",
        "rename -wire t:$_*DFF*_",
        f"{command} -run map_ffs:",
        f"techmap -map {_MAP}",
        *(["delete -port x:*", "delete t:?BUF"] if module == "core" else []),
        f"write_json {module}.json",
    )


def _nextpnr(fpga: Fpga, *arguments: str) -> list[str]:
    name = f"nextpnr_{fpga.place}"
    script = f"import sys; from yowasp_{name} import run_{name} as run; sys.exit(run(sys.argv[1:]))"
    return [sys.executable, "-c", script, *fpga.options, *arguments]


def _place(fpga: Fpga, seed: int) -> list[str]:
    target = ("--freq", str(_TARGET), "--timing-allow-fail", "--seed", str(seed))
    results = ("--report", f"report-{seed}.json", "--write", f"placed-{seed}.json")
    pins = ("--vopt", f"cst={_PINS}") if fpga.pins else ()
    return _nextpnr(fpga, "--json", "harness.json", *target, *results, *pins)


class _Runner:
    """Runs commands in a folder, some at once, and ends them when it is interrupted."""

    def __init__(self, folder: Path, workers: int, progress: Callable[[], None]):
        self._folder, self._workers, self._progress = folder, workers, progress

    def __call__(self, *commands: list[str]) -> list[str]:
        """Run all of them; give what each has said."""
        logs = [self._folder / f"{number}.log" for number in range(len(commands))]
        waiting = list(zip(commands, logs, strict=True))
        running: dict[Path, subprocess.Popen] = {}
        try:
            while waiting or running:
                while waiting and len(running) < self._workers:
                    command, log = waiting.pop(0)
                    with log.open("w") as out:
                        # A session of its own: Yosys starts processes, too, that must end with it.
                        running[log] = subprocess.Popen(
                            command,
                            cwd=self._folder,
                            env=os.environ | {"TMPDIR": str(self._folder)},
                            stdout=out,
                            stderr=subprocess.STDOUT,
                            start_new_session=True,
                        )
                time.sleep(_POLL)
                for log, process in list(running.items()):
                    if process.poll() is not None:
                        del running[log]
                        self._progress()
                        if process.returncode:
                            raise SynthesisError(_complaint(log.read_text()))
        finally:
            for process in running.values():
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
                process.wait()
        return [log.read_text() for log in logs]


def _complaint(log: str) -> str:
    """Find in a log what went wrong: the error, or the last line."""
    lines = [line for line in log.splitlines() if line.strip()] or ["it ended without a word"]
    errors = [line for line in lines if line.startswith("ERROR: ")]
    return (errors or lines[-1:])[0].removeprefix("ERROR: ")


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
