"""A GTKWave view of a waveform: the block diagram's registers in groups, coordinates as curves."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from vcd.gtkw import GTKWFlag, GTKWSave

from discreta.hdl.contract import AXIS_LETTERS, Part

__all__ = ["write_view"]

#: Where pysim puts the interpolator.
_CORE = ["bench", "top", "core"]

#: Beginnings of the names of the ports that are shown.
_STREAMS = ("blocks", "steps", "pins", "busy", "done", "error", "reason")

#: Ends of the names of signed ports: coordinates and steps.
_AXES = [f"_{letter}" for letter in AXIS_LETTERS]

#: Height of a curve, in rows of GTKWave, and size of its window, in pixels.
_CURVE_ROWS = 3
_WINDOW = (1400, 900)


def write_view(view: IO[str], vcd: Path, shown_as: str, core: Part) -> None:
    """Write a GTKWave save file for a waveform of ``core`` that pysim has written.

    Parameters
    ----------
    view : file
        The ``.gtkw`` file.
    vcd : Path
        The waveform, whole.
    shown_as : str
        Its name as seen from the save file.
    core : Part
        The interpolator, with its ``diagram``.
    """
    ports = _ports(vcd)
    save = GTKWSave(view)
    save.dumpfile(shown_as, abspath=False)
    save.treeopen(".".join(_CORE) + ".")
    save.sst_expanded(False)
    save.signals_width(200)
    save.size(*_WINDOW)
    with save.group("coordinates"):
        for port in ports:
            if port.startswith("position_"):
                save.trace(
                    ports[port],
                    alias=port,
                    datafmt="signed",
                    extraflags=GTKWFlag.analog_step,
                )
                for _ in range(_CURVE_ROWS):
                    save.blank(analog_extend=True)
    interpolators = getattr(core, "interpolators", {})
    for title, registers in core.diagram.items():
        kind = title.partition(": ")[0]
        names = _inside(vcd, [*_CORE, kind] if kind in interpolators else _CORE)
        with save.group(title):
            for register in registers:
                datafmt = "signed" if register.shape().signed else "dec"
                save.trace(names[register.name], alias=register.name, datafmt=datafmt)
    with save.group("blocks and steps"):
        save.trace(ports["clk"], alias="clk")
        for port in ports:
            if port.split("_")[0] in _STREAMS:
                datafmt = "signed" if port[-2:] in _AXES else "dec"
                save.trace(ports[port], alias=port, datafmt=datafmt)


def _variables(vcd: Path) -> Iterator[tuple[list[str], str, str]]:
    """Yield (scope, name, name with its bits) of every variable in the waveform's header."""
    scope: list[str] = []
    with vcd.open(encoding="utf-8") as lines:
        for line in lines:
            if match := re.match(r"\$scope module (\S+) \$end", line):
                scope.append(match[1])
            elif line.startswith("$upscope"):
                scope.pop()
            elif match := re.match(r"\$var \w+ (\d+) \S+ (\S+) \$end", line):
                size = int(match[1])
                bits = f"[{size - 1}:0]" if size > 1 else ""
                yield list(scope), match[2], ".".join((*scope, match[2])) + bits
            elif line.startswith("$enddefinitions"):
                return


def _inside(vcd: Path, part: list[str]) -> dict[str, str]:
    """Give every variable of a part by its name; of several, the one nearest its top."""
    inside = [variable for variable in _variables(vcd) if variable[0][: len(part)] == part]
    inside.sort(key=lambda variable: -len(variable[0]))
    return {name: path for _, name, path in inside}


def _ports(vcd: Path) -> dict[str, str]:
    """Give the plain ports."""
    return {
        name: path
        for scope, name, path in _variables(vcd)
        if scope == ["bench", "top"] and re.fullmatch(r"[a-z]+(_[a-z]+)*", name)
    }
