"""The command line: ``discreta``."""

import csv
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from importlib import metadata
from itertools import pairwise
from pathlib import Path
from typing import IO, Any

import click
import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from discreta.hdl.contract import AXIS_LETTERS, MAX_AXES, MIN_AXES, check_axes, check_width
from discreta.hdl.parts import PRELOADS
from discreta.hdl.verilog import verilog as emit_verilog
from discreta.sim.contour import LineContour
from discreta.sim.methods import METHODS, Method
from discreta.sim.outputs import Outputs
from discreta.sim.plot import FORMATS, PathPlot
from discreta.sim.simulate import ENGINES, DeadCoreError, default_engine, simulate
from discreta.sim.view import write_view

__all__ = ["main"]

#: Clocks a block may take beside its summations: acceptance, start, and the last step.
_OVERHEAD = 4

_stderr = Console(stderr=True, highlight=False)


class _Point(click.ParamType):
    """A point: whole numbers of steps, one for every axis."""

    name = "X,Y"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[int, ...]:
        if isinstance(value, tuple):
            return value
        try:
            point = tuple(int(item) for item in value.split(","))
        except ValueError:
            point = ()
        if not MIN_AXES <= len(point) <= MAX_AXES:
            self.fail(
                f"{value!r} is not a point: give {MIN_AXES} to {MAX_AXES} whole numbers of steps "
                "with commas between, like 200,99",
                param,
                ctx,
            )
        return point


class _MethodName(click.ParamType):
    """The name of a method."""

    name = "METHOD"

    def convert(self, value: Any, param: Any, ctx: Any) -> Method:
        if isinstance(value, Method):
            return value
        if value not in METHODS:
            self.fail(f"there is no method {value!r}: choose {' or '.join(METHODS)}", param, ctx)
        return METHODS[value]


def _checked(check: Callable[[int], None]) -> Callable[..., int]:
    """Make a click callback of one of the hardware's own checks."""

    def callback(ctx: click.Context, param: click.Parameter, value: Any) -> Any:
        try:
            for item in value if isinstance(value, tuple) else (value,):
                check(item)
        except ValueError as error:
            raise click.BadParameter(str(error), ctx, param) from None
        return value

    return callback


def _options(*options: Callable) -> Callable:
    def decorate(function: Callable) -> Callable:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


_width = click.option(
    "--width",
    type=int,
    default=16,
    show_default=True,
    callback=_checked(check_width),
    help="Bits of the increments, 4 to 32; coordinates have one more and a sign.",
)
_preload = click.option(
    "--preload",
    type=click.Choice(PRELOADS),
    default="half",
    show_default=True,
    help="What the summators start from.",
)
_normalize = click.option(
    "--normalize/--no-normalize",
    default=True,
    show_default=True,
    help="Shift the increments left together first: faster, same path bound.",
)
_run_options = _options(
    click.option(
        "--method",
        type=_MethodName(),
        default="linear",
        show_default=True,
        help="See `discreta methods`.",
    ),
    _width,
    _preload,
    _normalize,
    click.option(
        "--engine",
        type=click.Choice(ENGINES),
        help="[default: compiled where there is a C++ compiler and no --vcd, else pysim]",
    ),
    click.option("--trace", metavar="FILE.csv|-", help="Every step: clock, then the coordinates."),
    click.option("--vcd", metavar="FILE.vcd", help="Waveform, with a .gtkw view beside it."),
    click.option("--plot", metavar="FILE.svg|.png", help="Picture of the path and its error."),
    click.option("--json", "json_file", metavar="FILE|-", help="The summary, as JSON."),
)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(metadata.version("discreta"), prog_name="discreta")
def cli() -> None:
    """Interpolators as hardware: from a start to an end along a curve, every smallest step."""


@cli.group("simulate")
def simulate_group() -> None:
    """Run the RTL clock by clock."""


@simulate_group.command("line")
@click.option("--start", type=_Point(), required=True, help="Where the line begins, in steps.")
@click.option("--end", type=_Point(), required=True, help="Where it ends.")
@_run_options
def simulate_line(start: tuple[int, ...], end: tuple[int, ...], **options: Any) -> None:
    """Run one line in two to six axes.

    Example: discreta simulate line --start 0,0 --end 200,99 --plot line.svg
    """
    if len(start) != len(end):
        raise click.UsageError(
            f"--start has {len(start)} coordinates and --end has {len(end)}: give both as many"
        )
    _simulate(np.array([start, end], dtype=object), path=False, **options)


@simulate_group.command("path")
@click.argument("file", metavar="FILE.csv")
@_run_options
def simulate_path(file: str, **options: Any) -> None:
    """Run a polyline of support points without a gap.

    FILE.csv has a header with the axis letters (x,y and so on) and a support point in every row, in
    steps. A path whose last point is its first is closed.

    Example: discreta simulate path examples/bulgaria.csv --plot border.svg
    """
    _simulate(_read_points(file), path=True, **options)


def _read_points(file: str) -> np.ndarray:
    """Read the support points of a path, shape (points, axes)."""
    try:
        with Path(file).open(encoding="utf-8-sig", newline="") as lines:
            rows = list(csv.reader(lines))
    except OSError as error:
        raise click.UsageError(f"cannot read {file}: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise click.UsageError(f"{file} is not a CSV file: {error}") from None
    header = [name.strip().lower() for name in rows[0]] if rows else []
    axes = len(header)
    if not MIN_AXES <= axes <= MAX_AXES or header != list(AXIS_LETTERS[:axes]):
        said = ",".join(header)
        raise click.UsageError(
            f"{file} begins with {said!r}: the first line must name the axes, like x,y"
            if rows
            else f"{file} is empty: give a line x,y and a support point in every line after it"
        )
    points = []
    for number, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        try:
            point = [int(item) for item in row]
        except ValueError:
            point = []
        if len(point) != axes:
            raise click.UsageError(
                f"{file}, line {number}: {','.join(row)!r} is not a point: "
                f"give {axes} whole numbers of steps"
            )
        points.append(point)
    if len(points) < 2:
        raise click.UsageError(
            f"{file} has too few support points, {len(points)}: a path needs at least 2"
        )
    return np.array(points, dtype=object)


def _check_range(points: np.ndarray, width: int) -> np.ndarray:
    """Refuse coordinates and lengths that the device has no bits for."""
    modulus = 1 << width
    for point in points:
        for value in point:
            if not -modulus <= value < modulus:
                raise click.UsageError(
                    f"coordinate {value} of {_name(point)} is out of range: width {width} has room "
                    f"for {-modulus} to {modulus - 1}; give a larger --width (up to 32)"
                )
    for start, end in pairwise(points):
        length = max(abs(end - start))
        if length >= modulus:
            raise click.UsageError(
                f"the line from {_name(start)} to {_name(end)} is {length} steps long: width "
                f"{width} has room for {modulus - 1}; give a larger --width (up to 32)"
            )
    return points.astype(np.int64)


def _name(point: Any) -> str:
    return ",".join(str(value) for value in point)


def _simulate(
    points: np.ndarray,
    *,
    path: bool,
    method: Method,
    width: int,
    preload: str,
    normalize: bool,
    engine: str | None,
    trace: str | None,
    vcd: str | None,
    plot: str | None,
    json_file: str | None,
) -> None:
    points = _check_range(points, width)
    if vcd == "-":
        raise click.UsageError("--vcd needs a file: its .gtkw view goes beside it")
    if vcd and engine == "compiled":
        raise click.UsageError("--vcd is written by pysim: leave out --engine compiled")
    if trace == json_file == "-":
        raise click.UsageError("--trace - and --json - would mix: send one of them to a file")
    kind = Path(plot).suffix.lower() if plot else ""
    if plot and kind not in FORMATS:
        raise click.UsageError(f"--plot {plot}: choose a name that ends in {' or '.join(FORMATS)}")
    if engine is None:
        engine = "pysim" if vcd else default_engine()
        if not vcd and engine == "pysim":
            _stderr.print("no C++ compiler found: running on pysim, a thousand times slower")
    elif engine == "compiled" and default_engine() != "compiled":
        raise click.UsageError("--engine compiled needs a C++ compiler: install one or use pysim")

    choices = {"normalize": normalize, "preload": preload}
    axes = points.shape[1]
    starts, ends = points[:-1], points[1:]
    golden = method.golden(width, axes, **choices)
    core = method.device(width, axes, **choices)
    bound = method.summations(golden, np.abs(ends - starts))
    contour = LineContour(starts, ends)
    picture = PathPlot(points) if plot else None
    runs = _Runs()
    with Outputs() as outputs:
        trace_file = outputs.open(trace) if trace else None
        json_out = outputs.open(json_file) if json_file else None
        plot_part = outputs.place(plot) if plot else None
        vcd_part = outputs.place(vcd) if vcd else None
        view = outputs.open(str(Path(vcd).with_suffix(".gtkw"))) if vcd else None
        vcd_file = outputs.write(vcd_part) if vcd_part else None
        rows = csv.writer(trace_file, lineterminator="\n") if trace_file else None
        if rows:
            rows.writerow(["clock", *AXIS_LETTERS[:axes]])
            rows.writerow([0, *points[0].tolist()])
        began = time.perf_counter()
        with _progress("blocks", len(starts)) as advance:
            for stretch in simulate(
                core,
                np.concatenate([starts, ends], axis=1),
                limit=int(bound.sum()) + _OVERHEAD * (len(starts) + 1),
                engine=engine,
                watch=("reg_running",),
                vcd=vcd_file,
                progress=advance,
            ):
                clocks, reached, errors = contour.follow(stretch)
                runs.follow(stretch)
                if rows:
                    rows.writerows(np.column_stack([clocks, reached]).tolist())
                if picture:
                    picture.follow(reached, errors)
        seconds = time.perf_counter() - began
        summary = _summarize(method, core, engine, points, contour, runs, path)
        if view and vcd_file and vcd_part and vcd:
            vcd_file.close()
            write_view(view, vcd_part, Path(vcd).name, core)
        if picture and plot_part:
            title = f"{method.name}, {width} bits, preload {preload}"
            picture.save(plot_part, kind, title)
        if json_out:
            json.dump(summary, json_out, indent=2, ensure_ascii=False)
            json_out.write("\n")
    to_stdout = "-" not in (trace, json_file)
    _print_summary(summary, seconds, sys.stdout if to_stdout else sys.stderr)
    if not summary["end point reached"]:
        raise click.exceptions.Exit(1)


class _Runs:
    """Counts the summations, and the clocks lost between blocks."""

    def __init__(self):
        self.summations = 0
        self.lost = 0
        self._was_running = False
        self._ended: int | None = None
        self._clock = 0

    def follow(self, stretch: Any) -> None:
        """Take in a stretch with ``reg_running`` watched; every step is taken at once."""
        running = stretch.watch[:, 0] == 1
        self.summations += int(np.count_nonzero(running))
        before = np.r_[self._was_running, running[:-1]]
        begins = np.flatnonzero(running & ~before) + self._clock
        # The last step of a block waits, and is taken, in the first clock without a summation.
        ends = np.flatnonzero(before & ~running) + self._clock
        if self._ended is not None:
            ends = np.r_[self._ended, ends]
        for begin in begins:
            earlier = ends[ends < begin]
            if len(earlier):
                self.lost += int(begin - earlier[-1] - 1)
        if len(ends):
            self._ended = int(ends[-1])
        if len(running):
            self._was_running = bool(running[-1])
        self._clock += len(running)


def _summarize(
    method: Method,
    core: Any,
    engine: str,
    points: np.ndarray,
    contour: LineContour,
    runs: _Runs,
    path: bool,
) -> dict[str, Any]:
    segments = len(points) - 1
    summary: dict[str, Any] = {
        "method": method.name,
        **core.parameters,
        "engine": engine,
        "clocks": contour.clocks,
        "summations": runs.summations,
        "steps": contour.steps,
        "clocks per step": round(contour.clocks / contour.steps, 4) if contour.steps else None,
        "largest error": round(contour.largest_error, 4),
        "largest error at": list(contour.error_at),
        "error bound": method.error_bound,
    }
    if path:
        summary |= {
            "segments": segments,
            "support points hit": contour.ends_reached,
            "path closed": bool(np.array_equal(points[0], points[-1])),
            "clocks lost between blocks": runs.lost,
        }
    return summary | {"end point reached": contour.ends_reached == segments}


def _print_summary(summary: dict[str, Any], seconds: float, file: IO[str]) -> None:
    table = Table(show_header=False, box=None, pad_edge=False)
    for name, value in summary.items():
        if isinstance(value, bool):
            value = "yes" if value else "no"
        elif isinstance(value, list):
            value = _name(value)
        table.add_row(name, str(value))
    table.add_row("time", f"{seconds:.2f} s")
    Console(file=file, highlight=False).print(table)


@contextmanager
def _progress(what: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a progress bar on a terminal; give the function that moves it on."""
    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=_stderr, transient=True, disable=not sys.stderr.isatty())
    with bar:
        task = bar.add_task(what, total=total)
        yield lambda count: bar.advance(task, count)


@cli.command()
@click.argument("method", type=_MethodName())
@_width
@click.option(
    "--axes", type=int, default=2, show_default=True, callback=_checked(check_axes), help="2 to 6."
)
@_preload
@_normalize
@click.option("--output", metavar="FILE.v", default="-", help="[default: standard output]")
def verilog(
    method: Method, width: int, axes: int, preload: str, normalize: bool, output: str
) -> None:
    """Write a method as Verilog-2005 with plain ports.

    Example: discreta verilog linear --width 16 --output linear.v
    """
    core = method.device(width, axes, normalize=normalize, preload=preload)
    with Outputs() as outputs:
        outputs.open(output).write(emit_verilog(core, f"discreta_{method.name}"))


@cli.command()
@click.argument("methods", type=_MethodName(), nargs=-1, required=True, metavar="METHOD...")
@_width
def prove(methods: tuple[Method, ...], width: int) -> None:
    """Prove a method: RTL = golden model, and its promises, for every block of a width.

    All options of the method are proven, in the plane. Exits 1 when something does not hold, with
    the values that break it.

    Example: discreta prove linear --width 32
    """
    try:
        from discreta.sim.prover import prove_variant
    except ModuleNotFoundError as error:
        raise click.UsageError(
            f"proofs need {error.name}: install the extra, pip install 'discreta[prove]'"
        ) from None
    out = Console(highlight=False, soft_wrap=True)
    jobs = [(method, variant) for method in methods for variant in method.variants()]
    good = True
    began = time.perf_counter()
    count = 0
    with ProcessPoolExecutor(min(len(jobs), os.cpu_count() or 1)) as pool:
        results = pool.map(
            prove_variant,
            [method.name for method, _ in jobs],
            [width] * len(jobs),
            [variant for _, variant in jobs],
        )
        with _progress("variants", len(jobs)) as advance:
            for (method, variant), verdicts in zip(jobs, results, strict=True):
                advance(1)
                out.print(f"{method.name}, width {width}, {_variant_name(variant)}")
                for verdict in verdicts:
                    mark = "proven" if verdict.holds else "FAILED"
                    out.print(f"  {mark} {verdict.seconds:6.2f} s  {verdict.title}", markup=False)
                    if not verdict.holds:
                        out.print(f"         {verdict.counterexample}", markup=False)
                count += sum(verdict.holds for verdict in verdicts)
                good &= all(verdict.holds for verdict in verdicts)
    seconds = time.perf_counter() - began
    out.print(f"{count} proven, {'all hold' if good else 'NOT ALL HOLD'}, {seconds:.1f} s")
    if not good:
        raise click.exceptions.Exit(1)


def _variant_name(variant: dict[str, Any]) -> str:
    words = []
    for name, value in variant.items():
        if isinstance(value, bool):
            words.append(name if value else f"no {name}")
        else:
            words.append(f"{name} {value}")
    return ", ".join(words)


@cli.command("survey")
@click.argument("method", type=_MethodName())
@_width
def survey_command(method: Method, width: int) -> None:
    """Run every line of a width, or a seeded sample, and judge every register at every clock.

    Runs on the compiled engine. Exits 1 when a register differs from the golden model or an end is
    missed.

    Example: discreta survey linear --width 8
    """
    from discreta.sim.survey import SEED, SurveyRow, survey, survey_lines

    if default_engine() != "compiled":
        raise click.UsageError("a survey needs the compiled engine: install a C++ compiler")
    try:
        blocks, exhaustive = survey_lines(width)
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    variants = method.variants()
    rows = [SurveyRow(variant) for variant in variants]
    began = time.perf_counter()
    with _progress("lines", len(blocks) * len(variants)) as advance:
        for part in survey(method, width):
            rows[variants.index(part.variant)].add(part)
            advance(part.lines)
    seconds = time.perf_counter() - began

    out = Console(highlight=False)
    kind = "all" if exhaustive else f"a sample (seed {SEED}) of"
    out.print(f"{method.name}, width {width}: {kind} {len(blocks)} lines, every register compared")
    table = Table(box=None, pad_edge=False)
    for heading in ("variant", "largest error", "on the line", "at", "clocks/step", "ends missed"):
        table.add_column(heading, justify="left" if heading == "variant" else "right")
    for row in rows:
        table.add_row(
            _variant_name(row.variant),
            f"{row.largest_error:.4f}",
            _name(row.error_at[:2]),
            _name(row.error_at[2:]),
            f"{row.summations / row.longest:.4f}",
            str(row.ends_missed),
        )
    out.print(table)
    clocks = sum(row.clocks for row in rows)
    out.print(
        f"{clocks} clocks of RTL in {seconds:.1f} s, {clocks / seconds / 1e6:.1f} million a second"
    )
    for row in rows:
        for mismatch in row.mismatches:
            _stderr.print(f"{_variant_name(row.variant)}: {mismatch}", markup=False)
    if not all(row.good for row in rows):
        raise click.exceptions.Exit(1)


@cli.command("methods")
def methods_command() -> None:
    """List the methods, with error bound and clocks per step.

    Example: discreta methods
    """
    table = Table(box=None, pad_edge=False)
    for heading in ("method", "draws", "error bound, steps", "clocks per step of the longest axis"):
        table.add_column(heading)
    for method in METHODS.values():
        table.add_row(method.name, method.summary, method.error_bound, method.clocks_per_step)
    Console(highlight=False).print(table)


def main() -> None:
    """Run the command line: exit 0 on success, 1 when a check fails, 2 on bad input."""
    sys.exit(_run())


def _run() -> int:
    try:
        return cli.main(prog_name="discreta", standalone_mode=False) or 0
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return 2
    except click.ClickException as error:
        line = " ".join(error.format_message().split())
        click.echo(f"discreta: {line}", err=True)
        return 2
    except (click.Abort, KeyboardInterrupt):
        click.echo("discreta: interrupted, nothing written", err=True)
        return 130
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            # Whoever read the output has seen enough.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        click.echo(f"discreta: cannot write {error.filename}: {error.strerror}", err=True)
        return 2
    except DeadCoreError as error:
        click.echo(f"discreta: {error}", err=True)
        return 1
