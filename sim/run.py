"""Runs a curve through a method and writes what was asked for: all of ``discreta simulate``."""

import csv
import json
from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from discreta.hdl.contract import AXIS_LETTERS
from discreta.sim.carrier import (
    DEFAULT_PERIOD,
    DEFAULT_SPEED,
    add_timing,
    check_timing,
    lengths,
    mean_angle,
    mean_increments,
)
from discreta.sim.curves import Curve
from discreta.sim.machine import Drive, Machine, Trail, pace_limit
from discreta.sim.methods import METHODS, Method
from discreta.sim.outputs import Outputs
from discreta.sim.pace import Pace
from discreta.sim.plot import PathPlot, picture_format
from discreta.sim.points import BadInputError
from discreta.sim.simulate import default_engine, simulate
from discreta.sim.view import write_view

__all__ = ["choose_engine", "run", "say_choices"]

#: Clocks of a run beside those of its blocks: up to the first acceptance, and the last answer.
_OVERHEAD = 2


def run(
    curve: Curve,
    method: Method,
    *,
    width: int = 16,
    engine: str | None = None,
    trace: str | None = None,
    vcd: str | None = None,
    plot: str | None = None,
    summary_file: str | None = None,
    reads: Iterable[str] = (),
    speed: Fraction | None = None,
    period: int | None = None,
    drive: Drive | None = None,
    plotter: str | None = None,
    screen: str | None = None,
    progress: Callable[[int, int], object] | None = None,
    **choices: Any,
) -> dict[str, Any]:
    """Run a curve from reset, every step taken at once, and give the summary.

    With ``drive`` the whole device runs it, too: what leaves its pins must be the same points in
    the same order. Trace and waveform are those of the device then.

    Parameters
    ----------
    curve : Curve
        A :class:`~discreta.sim.curves.Polyline`, an :class:`~discreta.sim.curves.Arc` or a
        :class:`~discreta.sim.curves.Conic`.
    method : Method
        One whose blocks are of that kind.
    width : int
        4 to 32, as far as the method goes.
    engine : str or None
        ``"pysim"`` or ``"compiled"``; None: the compiled engine where it can be used.
    trace, summary_file : str or None
        Files for every step (CSV) and for the summary (JSON); ``"-"`` is the standard output.
    vcd, plot : str or None
        Files for the waveform, with a ``.gtkw`` view beside it, and for the picture.
    reads : iterable of str
        Files that must not be written over.
    speed : Fraction or None
        Of a method on a carrier: F > 0, in steps of path per clock; None: 1/10.
    period : int or None
        Of such a method: T, in clocks; None: 200.
    drive : Drive or None
        Speed, acceleration and pulses of the whole device; None: the interpolator runs alone.
    plotter, screen : str or None
        Files for what a virtual machine draws that sees the device's pins: with a pen, and on the
        exercise's screen.
    progress : callable or None
        Called with the clocks run and the most there can be; the first time when every file has its
        place.
    choices
        The method's own choices; of those left out the device has defaults.

    Raises
    ------
    BadInputError
        What was asked for cannot be done.
    OSError
        A file cannot be written.
    DeadCoreError
        The device does not answer.
    """
    fitting = {name: other for name, other in METHODS.items() if other.curve == curve.kind}
    if method.curve != curve.kind:
        raise BadInputError(
            f"method {method.name} draws {method.curve}s and no {curve.kind}s: choose "
            f"{' or '.join(fitting)}"
        )
    if curve.axes not in method.axes:
        able = [name for name, other in fitting.items() if curve.axes in other.axes]
        raise BadInputError(
            f"the {curve.kind} has {curve.axes} axes and method {method.name} {method.axes[0]}: "
            f"choose {' or '.join(able)}"
        )
    given = {"speed": speed, "period": period}
    for name in () if method.timed else [name for name in given if given[name] is not None]:
        timed = [other.name for other in fitting.values() if other.timed]
        raise BadInputError(
            f"--{name} is no option of {method.name}, which has no carrier: "
            f"{f'choose --method {timed[0]}' if timed else 'leave it out'}"
        )
    if drive is not None and method.timed:
        raise BadInputError(
            f"method {method.name} has a timing of its own and does not run on the device: choose "
            f"another, or leave out --feed, --accel, --pulse, --plotter and --screen"
        )
    curve.check(width)
    engine = choose_engine(engine, trace=trace, vcd=vcd, summary_file=summary_file)
    kind = picture_format("--plot", plot)
    plotter_kind, screen_kind = (
        picture_format("--plotter", plotter),
        picture_format("--screen", screen),
    )

    golden = method.model(width, curve.axes, **choices)
    blocks = _timed(curve, golden, width, speed, period) if method.timed else curve.blocks
    limit = int(method.clocks(golden, blocks).sum()) + _OVERHEAD
    contour, pace = curve.contour(), None if method.timed else Pace()
    contour.done_ends = method.timed and not method.per_period
    picture = PathPlot(curve, periods=method.per_period)
    steps, here, trail = 0, curve.start[None], Trail(curve.start)
    pace_at_most = 0 if drive is None else pace_limit(curve, drive, limit)
    with Outputs(reads) as outputs:
        trace_file = outputs.open(trace) if trace is not None else None
        json_file = outputs.open(summary_file) if summary_file is not None else None
        plot_part = outputs.place(plot) if plot is not None else None
        plotter_part = outputs.place(plotter) if plotter is not None else None
        screen_part = outputs.place(screen) if screen is not None else None
        vcd_part = outputs.place(vcd) if vcd is not None else None
        view = outputs.open(str(Path(vcd).with_suffix(".gtkw"))) if vcd is not None else None
        vcd_file = outputs.write(vcd_part) if vcd_part else None
        core = method.core(width, curve.axes, **choices)
        if progress:
            progress(0, limit + pace_at_most)
        rows = csv.writer(trace_file, lineterminator="\n") if trace_file else None
        if rows:
            rows.writerow(["clock", *AXIS_LETTERS[: curve.axes]])
            rows.writerow([0, *curve.start.tolist()])
        clocks = 0
        stretches = simulate(
            core,
            blocks,
            limit=limit,
            engine=engine,
            watch=("reg_running",) if pace else (),
            vcd=vcd_file if drive is None else None,
        )
        for stretch in stretches:
            when, reached, errors = contour.follow(stretch)
            if pace:
                pace.follow(stretch)
            if len(reached):
                moves = np.diff(reached, axis=0, prepend=here)
                steps, here = steps + int(np.abs(moves).max(axis=1).sum()), reached[-1:]
            trail.follow(reached)
            if rows and drive is None:
                rows.writerows(np.column_stack([when, reached]).tolist())
            if plot_part:
                picture.follow(reached, errors)
            clocks += stretch.ran
            if progress:
                progress(clocks, limit + pace_at_most)
        pictured = f"{method.name}, {width} bits"
        machine: Machine | None = None
        if drive is not None:
            machine = Machine(curve, {curve.kind: core}, drive, trail)
            for when, reached in machine.run(limit=pace_at_most, engine=engine, vcd=vcd_file):
                if rows:
                    rows.writerows(np.column_stack([when, reached]).tolist())
                if progress:
                    progress(clocks + machine.clocks, limit + pace_at_most)
            title = f"{pictured}, F = {float(drive.programmed):g}"
            if plotter_part:
                machine.pen.draw(plotter_part, plotter_kind, title)
            if screen_part:
                machine.screen.save(screen_part, screen_kind)
        bound = method.bound(golden)
        summary = {
            "method": method.name,
            **core.parameters,
            "engine": engine,
            "clocks": contour.clocks,
            **({} if pace is None else {"summations": pace.summations}),
            "steps": steps,
            "clocks per step": round(contour.clocks / steps, 4) if steps else None,
            **(_timing_facts(curve, blocks, width) if method.timed else {}),
            "largest error": round(contour.largest_error, 4),
            "largest error at": list(contour.error_at),
            **({} if bound is None else {"error bound": round(bound, 4)}),
            **curve.facts(contour, pace),
            **({} if machine is None else machine.facts()),
            "end point reached": contour.ends_reached == len(blocks)
            and (machine is None or machine.good),
        }
        if vcd and vcd_file and vcd_part and view:
            vcd_file.close()
            shown = core if machine is None else machine.device
            write_view(view, vcd_part, Path(vcd).name, shown)
        if plot_part:
            chosen = say_choices({name: core.parameters[name] for name in method.choices})
            picture.save(plot_part, kind, ", ".join(filter(None, (pictured, chosen))))
        if json_file:
            json.dump(summary, json_file, indent=2)
            json_file.write("\n")
    return summary


def choose_engine(
    engine: str | None, *, trace: str | None, vcd: str | None, summary_file: str | None
) -> str:
    """Give the engine that can write what is asked for.

    Raises
    ------
    BadInputError
        None can.
    """
    if vcd is not None and (vcd == "-" or Path(vcd).is_char_device() or Path(vcd).is_fifo()):
        raise BadInputError("--vcd needs a file: its .gtkw view goes beside it")
    if vcd and engine == "compiled":
        raise BadInputError("--vcd is written by pysim: leave out --engine compiled")
    if trace == summary_file == "-":
        raise BadInputError("--trace - and --json - would mix: send one of them to a file")
    if engine == "compiled" and default_engine() != "compiled":
        raise BadInputError("--engine compiled needs a C++ compiler: install one or use pysim")
    return engine or ("pysim" if vcd else default_engine())


def _timed(
    curve: Curve, golden: Any, width: int, speed: Fraction | None, period: int | None
) -> np.ndarray:
    """Give the blocks of a curve with their timing, if a device takes them."""
    blocks = add_timing(
        curve.kind,
        curve.blocks,
        DEFAULT_SPEED if speed is None else speed,
        DEFAULT_PERIOD if period is None else period,
    )
    return check_timing(
        curve.kind,
        blocks,
        width,
        least_period=golden.least_period,
        formula=getattr(golden, "formula", "rotation"),
    )


def _timing_facts(curve: Curve, blocks: np.ndarray, width: int) -> dict[str, Any]:
    """Give periods and mean steps of path in one; of one block the mean increments or angle."""
    periods = blocks[:, -2].tolist()
    facts = {
        "period": int(blocks[0, -1]),
        "periods": sum(periods),
        "steps per period": round(float(lengths(curve.kind, curve.blocks).sum() / sum(periods)), 4),
    }
    if len(blocks) > 1:
        return facts
    if curve.kind == "line":
        means = mean_increments(curve.blocks[0], periods[0], width)
        return facts | {"mean increments": [round(float(mean), 4) for mean in means]}
    return facts | {"mean angle": round(float(mean_angle(curve.blocks[0], periods[0], width)), 6)}


def say_choices(choices: dict[str, Any]) -> str:
    """Write a method's choices in words: ``no normalize, preload half``."""
    words = []
    for name, value in choices.items():
        if isinstance(value, bool):
            words.append(name if value else f"no {name}")
        else:
            words.append(f"{name} {value}")
    return ", ".join(words)
