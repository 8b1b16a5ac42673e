"""Bits for an FPGA from a top level: synthesised, placed, timed, packed.

The tools are those of :mod:`discreta.sim.fpga`. The same top level, constraints and seed give the
same bits on every machine.

Source: none, it is ours.
"""

import json
import re
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from amaranth import Elaboratable
from amaranth.back import rtlil
from amaranth.hdl import Signal

from discreta.hdl.contract import check_choice
from discreta.sim.fpga import (
    FPGAS,
    MAP,
    Fpga,
    Runner,
    SynthesisError,
    check_tools,
    nextpnr,
    pack,
    synthesize,
    utilization,
)

__all__ = ["RUNS", "SECONDS", "SEEDS", "Bitstream", "build"]

#: Those of the placements that are tried, one after the other until one meets the clock.
SEEDS = (1, 2, 3, 4, 5)

#: Processes of a build that meets its clock at once.
RUNS = 3

#: What nextpnr says where it is nearly full: another seed may find a place.
_CROWDED = re.compile("legal placement|place chain|expand region")

#: What a placement may take: many times what it does, so that it never depends on the machine
#: which one is the first that comes to an end. nextpnr can go on for ever.
SECONDS = 900


@dataclass(frozen=True)
class Bitstream:
    """Bits, and what they take of their FPGA.

    Attributes
    ----------
    bits : bytes
        The file that a loader takes.
    seed : int
        That of the placement.
    used, available : dict of str to int
        Cells, by what they are.
    fmax : float
        MHz that it may have at most.
    clock : float
        MHz that it has.
    """

    bits: bytes
    seed: int
    used: dict[str, int]
    available: dict[str, int]
    fmax: float
    clock: float

    @property
    def margin(self) -> float:
        """How much faster than its clock it could be, in percent."""
        return 100 * (self.fmax / self.clock - 1)


def build(
    top: Elaboratable,
    ports: Iterable[Signal],
    fpga: str,
    constraints: str,
    clock: float,
    seeds: Iterable[int] = SEEDS,
    *,
    progress: Callable[[], None] = lambda: None,
) -> Bitstream:
    """Make the bits of a top level.

    Parameters
    ----------
    top : Elaboratable
    ports : iterable of Signal
        Its own, named as in ``constraints``; one is ``clk``.
    fpga : str
        One of :data:`~discreta.sim.fpga.FPGAS`.
    constraints : str
        Places of pins, in the words of that FPGA's nextpnr.
    clock : float
        MHz that it must reach.
    seeds : iterable of int
        Those of the placements: the first that reaches the clock counts.
    progress : callable
        Called after every process.

    Raises
    ------
    ValueError
        There is no such FPGA, or no seed.
    ModuleNotFoundError
        A tool is not installed: the extra ``boards`` brings all of them.
    SynthesisError
        It does not fit, or no placement reaches the clock.
    """
    check_choice("FPGA", fpga, tuple(FPGAS))
    chosen, seeds = FPGAS[fpga], tuple(seeds)
    if not seeds:
        raise ValueError("seeds are none: give one or more whole numbers")
    check_tools(fpga, packs=True)
    tools = chosen.tools
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        text = rtlil.convert(top, ports=list(ports), name="top", emit_src=False)
        Path(folder, "top.il").write_text(text)
        Path(folder, MAP).write_text(chosen.map)
        Path(folder, f"top.{tools.constraints}").write_text(constraints)
        run = Runner(folder, 1, progress)
        run(synthesize(chosen, "top"))
        reached: dict[int, str] = {}
        for seed in seeds:
            target = ("--freq", f"{clock:g}", "--timing-allow-fail", "--seed", str(seed))
            files = ("--json", "top.json", "--report", "report.json")
            command = nextpnr(chosen, *files, *target, *tools.read, *tools.write)
            try:
                (log,) = run(command, seconds=SECONDS)
            except TimeoutError:
                reached[seed] = "no end"
                continue
            except SynthesisError as error:
                _check_room(chosen, folder)
                if not _CROWDED.search(str(error)):
                    raise
                reached[seed] = "no place for all cells"
                continue
            report = json.loads(Path(folder, "report.json").read_text())
            fmax = min(clock["achieved"] for clock in report["fmax"].values())
            if fmax < clock:
                reached[seed] = f"{fmax:.2f} MHz"
                continue
            run(pack(chosen))
            places = _places(chosen, log)
            return Bitstream(
                bits=Path(folder, f"top.{tools.bits}").read_bytes(),
                seed=seed,
                used={what: used for what, (used, _) in places.items()},
                available={what: available for what, (_, available) in places.items()},
                fmax=fmax,
                clock=clock,
            )
    said = ", ".join(f"{result} with seed {seed}" for seed, result in reached.items())
    raise SynthesisError(f"it does not reach its clock of {clock:g} MHz: {said}")


def _places(fpga: Fpga, log: str) -> dict[str, tuple[int, int]]:
    """Give cells used and there, by what they are, as far as the FPGA has any."""
    places = utilization(log)
    return {what: places[place] for what, place in fpga.places.items() if place in places}


def _check_room(fpga: Fpga, folder: Path) -> None:
    """Raise :class:`SynthesisError` if the one log that there is says that there is no room."""
    (log,) = folder.glob("*.log")
    for what, (used, available) in _places(fpga, log.read_text()).items():
        if used > available:
            raise SynthesisError(f"it does not fit: {used} {what} of {available}")
