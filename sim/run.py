"""Runs a path through a method and writes what was asked for: all of ``discreta simulate``."""

import csv
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from discreta.hdl.contract import AXIS_LETTERS
from discreta.sim.contour import LineContour
from discreta.sim.methods import Method
from discreta.sim.outputs import Outputs
from discreta.sim.pace import Pace
from discreta.sim.plot import PathPlot, picture_format
from discreta.sim.points import BadInputError, check_path
from discreta.sim.simulate import default_engine, simulate
from discreta.sim.view import write_view

__all__ = ["run_path", "say_choices"]

#: Clocks a block may take beside its summations: acceptance, start, and the last step.
_OVERHEAD = 4


def run_path(
    points: np.ndarray,
    method: Method,
    *,
    width: int = 16,
    engine: str | None = None,
    trace: str | None = None,
    vcd: str | None = None,
    plot: str | None = None,
    summary_file: str | None = None,
    reads: Iterable[str] = (),
    progress: Callable[[int, int], object] | None = None,
    **choices: Any,
) -> dict[str, Any]:
    """Run a polyline from reset, every step taken at once, and give the summary.

    Parameters
    ----------
    points : array of int, shape (points, axes)
        Support points, in steps; two of them for a line.
    method : Method
    width : int
        4 to 32.
    engine : str or None
        ``"pysim"`` or ``"compiled"``; None: the compiled engine where it can be used.
    trace, summary_file : str or None
        Files for every step (CSV) and for the summary (JSON); ``"-"`` is the standard output.
    vcd, plot : str or None
        Files for the waveform, with a ``.gtkw`` view beside it, and for the picture.
    reads : iterable of str
        Files that must not be written over.
    progress : callable or None
        Called with the clocks run and the most there can be; the first time when every file has its
        place.
    choices
        The method's own choices.

    Raises
    ------
    BadInputError
        What was asked for cannot be done.
    OSError
        A file cannot be written.
    DeadCoreError
        The device does not answer.
    """
    check_path(points, width)
    if vcd is not None and (vcd == "-" or Path(vcd).is_char_device() or Path(vcd).is_fifo()):
        raise BadInputError("--vcd needs a file: its .gtkw view goes beside it")
    if vcd and engine == "compiled":
        raise BadInputError("--vcd is written by pysim: leave out --engine compiled")
    if trace == summary_file == "-":
        raise BadInputError("--trace - and --json - would mix: send one of them to a file")
    if engine is None:
        engine = "pysim" if vcd else default_engine()
    elif engine == "compiled" and default_engine() != "compiled":
        raise BadInputError("--engine compiled needs a C++ compiler: install one or use pysim")
    kind = picture_format(plot) if plot is not None else ""

    axes = points.shape[1]
    starts, ends = points[:-1], points[1:]
    golden = method.golden(width, axes, **choices)
    summations = method.summations(golden, np.abs(ends - starts))
    limit = int(summations.sum()) + _OVERHEAD * (len(starts) + 1)
    contour, pace, picture = LineContour(starts, ends), Pace(), PathPlot(points)
    with Outputs(reads) as outputs:
        trace_file = outputs.open(trace) if trace is not None else None
        json_file = outputs.open(summary_file) if summary_file is not None else None
        plot_part = outputs.place(plot) if plot is not None else None
        vcd_part = outputs.place(vcd) if vcd is not None else None
        view = outputs.open(str(Path(vcd).with_suffix(".gtkw"))) if vcd is not None else None
        vcd_file = outputs.write(vcd_part) if vcd_part else None
        core = method.device(width, axes, **choices)
        if progress:
            progress(0, limit)
        rows = csv.writer(trace_file, lineterminator="\n") if trace_file else None
        if rows:
            rows.writerow(["clock", *AXIS_LETTERS[:axes]])
            rows.writerow([0, *points[0].tolist()])
        clocks = 0
        blocks = np.concatenate([starts, ends], axis=1)
        stretches = simulate(
            core, blocks, limit=limit, engine=engine, watch=("reg_running",), vcd=vcd_file
        )
        for stretch in stretches:
            when, reached, errors = contour.follow(stretch)
            pace.follow(stretch)
            if rows:
                rows.writerows(np.column_stack([when, reached]).tolist())
            if plot_part:
                picture.follow(reached, errors)
            clocks += stretch.ran
            if progress:
                progress(clocks, limit)
        summary = {
            "method": method.name,
            **core.parameters,
            "engine": engine,
            "clocks": contour.clocks,
            "summations": pace.summations,
            "steps": contour.steps,
            "clocks per step": round(contour.clocks / contour.steps, 4) if contour.steps else None,
            "largest error": round(contour.largest_error, 4),
            "largest error at": list(contour.error_at),
            "error bound": round(method.bound(golden), 4),
            "segments": len(starts),
            "support points hit": contour.ends_reached,
            "path closed": bool(np.array_equal(points[0], points[-1])),
            "clocks lost between blocks": pace.lost,
            "end point reached": contour.ends_reached == len(starts),
        }
        if vcd and vcd_file and vcd_part and view:
            vcd_file.close()
            write_view(view, vcd_part, Path(vcd).name, core)
        if plot_part:
            chosen = say_choices({name: core.parameters[name] for name in method.choices})
            picture.save(plot_part, kind, f"{method.name}, {width} bits, {chosen}")
        if json_file:
            json.dump(summary, json_file, indent=2)
            json_file.write("\n")
    return summary


def say_choices(choices: dict[str, Any]) -> str:
    """Write a method's choices in words: ``no normalize, preload half``."""
    words = []
    for name, value in choices.items():
        if isinstance(value, bool):
            words.append(name if value else f"no {name}")
        else:
            words.append(f"{name} {value}")
    return ", ".join(words)
