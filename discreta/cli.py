"""The command line: ``discreta``."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict
from fractions import Fraction
from functools import partial
from hashlib import sha256
from importlib import metadata
from io import TextIOWrapper
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, cast

import click
from amaranth.hdl import Fragment
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from discreta.boards.board import Board, constraints
from discreta.boards.catalogue import BOARDS
from discreta.boards.project import project
from discreta.boards.top import Top
from discreta.hdl.carrier_circular import FORMULAS
from discreta.hdl.comparison import FIRSTS, FORMS
from discreta.hdl.conic import MAX_WIDTH as CONIC_MAX_WIDTH
from discreta.hdl.conic import ORDERS
from discreta.hdl.contract import (
    MAX_AXES,
    MAX_GUARD,
    MAX_WIDTH,
    MIN_AXES,
    MIN_WIDTH,
    Part,
    check_axes,
    check_guard,
    check_width,
)
from discreta.hdl.device import Device, exact_device
from discreta.hdl.harness import LoneAccumulator
from discreta.hdl.parts import PRELOADS
from discreta.hdl.parts.coefficient_unit import COEFFICIENTS
from discreta.hdl.plain import PlainPorts
from discreta.hdl.queue import KINDS as CURVE_KINDS
from discreta.hdl.verilog import verilog as emit_verilog
from discreta.sim.bitstream import RUNS as BUILD_RUNS
from discreta.sim.bitstream import SEEDS as BUILD_SEEDS
from discreta.sim.bitstream import Bitstream, build
from discreta.sim.carrier import DEFAULT_PERIOD, DEFAULT_SPEED, MAX_PERIOD
from discreta.sim.compiled import compiler
from discreta.sim.conics import ConicBlock, ellipse, from_coefficients, parabola
from discreta.sim.corefile import core_file
from discreta.sim.curves import Arc, Conic, Curve, Polyline
from discreta.sim.foreign import available
from discreta.sim.fpga import FPGAS, SynthesisError, check_tools
from discreta.sim.gcode import IGNORABLE, SUFFIXES, Move, is_gcode, read_moves
from discreta.sim.machine import Drive, device_blocks
from discreta.sim.methods import DEFAULTS, METHODS, Design, Method
from discreta.sim.outputs import Outputs
from discreta.sim.plot import picture_format
from discreta.sim.plotter import PulseTiming
from discreta.sim.points import (
    MAX_TURNS,
    BadInputError,
    check_line,
    check_turns,
    parse_point,
    read_points,
    say_point,
)
from discreta.sim.program import CORES, Program, program_blocks, run_program, speeds
from discreta.sim.run import run, say_choices
from discreta.sim.simulate import ENGINES, DeadCoreError, default_engine
from discreta.sim.synth import RUNS, Measurement, measure
from discreta.sim.testbench import testbench as write_bench
from discreta.sim.vectors import golden_vectors

if TYPE_CHECKING:
    from discreta.sim.groups import Group

__all__ = ["main"]


class _Point(click.ParamType):
    """A point: whole numbers of steps, one for every axis. Or other whole numbers."""

    name = "X,Y"

    def __init__(
        self,
        most: int,
        least: int = MIN_AXES,
        what: str = "a point",
        unit: str = "steps",
        like: str = "200,99",
    ):
        self._most, self._least = most, least
        self._count = f"{least} to {most}" if most > least else f"{least}"
        self._what, self._unit, self._like = what, unit, like

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[int, ...]:
        point = parse_point(value.split(","))
        if point is None or not self._least <= len(point) <= self._most:
            self.fail(
                f"{value!r} is not {self._what}: give {self._count} whole numbers of {self._unit} "
                f"with commas between, like {self._like}",
                param,
                ctx,
            )
        return point


#: A number of no more digits than any device can tell apart.
_NUMBER = re.compile(
    r"\s*[+-]?(\d{1,40}(\.\d{0,40})?(e[+-]?\d{1,2})?|\d{1,40}/0*[1-9]\d{0,40})\s*", re.ASCII
)


class _Numbers(click.ParamType):
    """Numbers: whole ones, decimals or fractions."""

    def __init__(self, name: str, like: str):
        self.name = name
        self._like = like

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[Fraction, ...]:
        cells = value.split(",")
        count = self._like.count(",") + 1
        if len(cells) != count or not all(map(_NUMBER.fullmatch, cells)):
            self.fail(
                f"{value!r} is not {self.name}: give {count} numbers with commas between, like "
                f"{self._like}",
                param,
                ctx,
            )
        return tuple(Fraction(cell) for cell in cells)


class _Speed(click.ParamType):
    """A speed: a number more than 0, a whole one, a decimal or a fraction. Or another such one."""

    name = "F"

    def __init__(self, what: str = "a speed", unit: str = "steps per clock"):
        self._what, self._unit = what, unit

    def convert(self, value: Any, param: Any, ctx: Any) -> Fraction:
        if not _NUMBER.fullmatch(value):
            self.fail(f"{value!r} is not {self._what}: give a number like 0.1 or 1/10", param, ctx)
        speed = Fraction(value)
        if speed <= 0:
            self.fail(
                f"{value} {self._unit} are no {self._what[2:]}: choose more than 0", param, ctx
            )
        return speed


#: The name of the family of the exact methods.
_EXACT = "exact"


class _Part(click.ParamType):
    """A part of a whole: a number from 0 to less than 1."""

    name = "PART"

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        if not _NUMBER.fullmatch(value) or not 0 <= Fraction(value) < 1:
            self.fail(f"{value} is no part: choose a number from 0 to less than 1", param, ctx)
        return float(Fraction(value))


class _Kinds(click.ParamType):
    """Kinds of curves that a device draws."""

    name = "KINDS"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[str, ...]:
        kinds = tuple(dict.fromkeys(value.split(",")))
        if not set(kinds) <= set(CURVE_KINDS):
            self.fail(
                f"{value!r} are no kinds: give one or more of {', '.join(CURVE_KINDS)} with commas "
                "between",
                param,
                ctx,
            )
        return kinds


class _MethodName(click.ParamType):
    """The name of a method, or of a unit of the device, too.

    With a kind of curve ``exact`` is its exact method.
    """

    name = "METHOD"

    def __init__(self, *, units: bool = False, curve: str | None = None):
        self._units, self._curve = units, curve

    def convert(self, value: Any, param: Any, ctx: Any) -> Design:
        if isinstance(value, Design):
            return value
        if value == _EXACT and self._curve:
            value = DEFAULTS[self._curve]
        there_are: dict[str, Design] = dict(METHODS)
        if self._units:
            # Not needed by the commands that run a method alone.
            from discreta.sim.units import UNITS

            there_are |= UNITS
        if value not in there_are:
            self.fail(f"there is no method {value!r}: choose {' or '.join(there_are)}", param, ctx)
        return there_are[value]


class _MethodNames(_MethodName):
    """The name of a method or unit, or of the family of the exact ones, which are several."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if value == _EXACT:
            return [METHODS[name] for name in DEFAULTS.values()]
        return value if isinstance(value, list) else [super().convert(value, param, ctx)]


def _methods_argument(*, units: bool = False, required: bool = True) -> Callable:
    """Make the argument that names one or more methods; the command has them in a tuple."""
    return click.argument(
        "methods",
        type=_MethodNames(units=units),
        nargs=-1,
        required=required,
        metavar="METHOD..." if required else "[METHOD...]",
        callback=lambda _context, _parameter, named: tuple(chain.from_iterable(named)),
    )


class _Number(click.ParamType):
    """A whole number that the hardware's own check accepts."""

    name = "N"

    def __init__(self, what: str, low: int, high: int, check: Callable[[int], None]):
        self._what, self._low, self._high, self._check = what, low, high, check

    def convert(self, value: Any, param: Any, ctx: Any) -> int:
        number = parse_point([str(value)])
        if number is None:
            limits = f"a whole number from {self._low} to {self._high}"
            self.fail(f"{self._what} is {value!r}: choose {limits}", param, ctx)
        try:
            self._check(*number)
        except ValueError as error:
            self.fail(str(error), param, ctx)
        return number[0]


def _options(*options: Callable) -> Callable:
    def decorate(function: Callable) -> Callable:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


def _width_option(default: int, most: int = MAX_WIDTH) -> Callable:
    return click.option(
        "--width",
        type=_Number("width", MIN_WIDTH, most, lambda width: check_width(width, most)),
        default=default,
        show_default=True,
        help=f"Bits of the device, {MIN_WIDTH} to {most}: "
        + (
            f"lines and radii are up to 2^N - 1 steps long (conics: {MIN_WIDTH} to "
            f"{CONIC_MAX_WIDTH}), "
            if most == MAX_WIDTH
            else ""
        )
        + "coordinates lie between -2^N and 2^N - 1.",
    )


_width = _width_option(16)


_axes = click.option(
    "--axes",
    type=_Number("number of axes", MIN_AXES, MAX_AXES, check_axes),
    default=2,
    show_default=True,
    help="2 to 6 for lines, 2 for arcs and conics.",
)


def _defaults(choice: str) -> str:
    """Say what a choice is by default, in every setting; of which method, where they differ."""
    words = []
    for setting in ("default", "lecture"):
        said = {
            method.name: say_choices({choice: method.settings[setting][choice]})
            for method in METHODS.values()
            if choice in method.settings.get(setting, {})
        }
        said = {name: value.removeprefix(f"{choice} ") for name, value in said.items()}
        if len(set(said.values())) == 1:
            words.append(next(iter(said.values())))
        else:
            words.append(", ".join(f"{value} ({name})" for name, value in said.items()))
    return f"[default: {words[0]}; lecture: {words[1]}]"


_setting_options = _options(
    click.option(
        "--setting",
        metavar="NAME",
        default="default",
        show_default=True,
        help="Values of the options below that are not given: default, or lecture, the machine of "
        "the documents.",
    ),
    click.option(
        "--preload",
        type=click.Choice(PRELOADS),
        help=f"What the summators start from: 0, or half of what they hold. {_defaults('preload')}",
    ),
    click.option(
        "--normalize/--no-normalize",
        default=None,
        help="Lines and arcs: shift what is summed left first, as far as it goes: fewer clocks. "
        f"{_defaults('normalize')}",
    ),
    click.option(
        "--order",
        type=click.Choice(ORDERS),
        help="Arcs and conics: the axis that is summed second takes account of the step of the "
        "first one (alternated), on conics of its own step too (implicit), or both of neither "
        "(simultaneous). "
        f"{_defaults('order')}",
    ),
    click.option(
        "--guard",
        type=_Number("number of guard bits", 0, MAX_GUARD, check_guard),
        help="Arcs and conics: bits more in the summators, 0 to 4: each halves the increments, for "
        f"less error in twice the clocks. {_defaults('guard')}",
    ),
    click.option(
        "--form",
        type=click.Choice(FORMS),
        help="Comparison: two summators that are compared with each other, or their difference "
        f"alone, signed. {_defaults('form')}",
    ),
    click.option(
        "--first",
        type=click.Choice(FIRSTS),
        help=f"Comparison: the axis that steps first at 45 degrees. {_defaults('first')}",
    ),
    click.option(
        "--formula",
        type=click.Choice(FORMULAS),
        help="Arcs on a carrier: how a point is turned by the angle of a period: by its cosine "
        "(rotation), as the mean of where it was and would be (predictor_corrector), or along the "
        f"tangent alone (plain). {_defaults('formula')}",
    ),
    click.option(
        "--coefficient",
        type=click.Choice(COEFFICIENTS),
        help="Arcs on a carrier: where rotation has cosine and sine from. "
        f"{_defaults('coefficient')}",
    ),
)
#: What these give besides the setting.
_CHOICES = (
    *("preload", "normalize", "order", "guard", "form", "first"),
    *("formula", "coefficient"),
)


def _check_period(period: int) -> None:
    if not 1 <= period <= MAX_PERIOD:
        raise ValueError(f"period is {period}: choose a whole number from 1 to {MAX_PERIOD}")


_timing_options = _options(
    click.option(
        "--speed",
        type=_Speed(),
        help="On a carrier: steps of path per clock at most, a decimal or a fraction. "
        f"[default: {float(DEFAULT_SPEED):g}]",
    ),
    click.option(
        "--period",
        type=_Number("period", 1, MAX_PERIOD, _check_period),
        help=f"On a carrier: clocks of its period. [default: {DEFAULT_PERIOD}]",
    ),
)


#: What a run on the whole device is given; any of them asks for one.
_DRIVE = ("feed", "accel", "pulse")
_DRIVE_CHOICES = (
    click.option(
        "--accel",
        type=_Numbers("an acceleration", "1e-6"),
        metavar="A",
        help="Acceleration from the start and down to the end, in steps per clock^2; 0 for none. "
        "[default: 0]",
    ),
    click.option(
        "--pulse",
        type=_Point(4, 4, "a timing", "clocks", "2,2,5,5"),
        metavar="L,S,U,H",
        help="Clocks of the pulses: length, space behind, set-up and hold of the direction. "
        "[default: 1,1,1,1]",
    ),
)
_drive_options = _options(
    click.option(
        "--feed",
        type=_Speed(),
        help="Run on the whole device, at this speed along the path: steps per clock, up to 1, a "
        "decimal or a fraction. [default: 1 with any of the four below]",
    ),
    *_DRIVE_CHOICES,
    click.option(
        "--plotter",
        metavar="FILE.svg|.png",
        help="Picture of what a machine draws that sees only the step and direction pins.",
    ),
    click.option(
        "--screen",
        metavar="FILE.png|.svg",
        help="The same on the exercise's own screen, 320 x 200 pixels in four colours.",
    ),
)


class _StepsPerMm(click.ParamType):
    """Steps a millimetre: a number for all axes, or one for each."""

    name = "N|x=N,y=N,z=N"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[Fraction, ...]:
        cells = value.lower().replace(" ", "").split(",")
        if len(cells) == 1 and "=" not in value:
            cells = [f"{letter}={value}" for letter in "xyz"]
        given = dict(cell.split("=", 1) for cell in cells if "=" in cell)
        numbers = [given.get(letter, given.get("y", "")) for letter in "xyz"]
        if len(given) != len(cells) or set(given) not in ({"x", "y"}, {"x", "y", "z"}):
            numbers = [""]
        if not all(_NUMBER.fullmatch(number) and Fraction(number) > 0 for number in numbers):
            self.fail(
                f"{value!r} is not steps a mm: give a number more than 0 for all axes, like 80, or "
                "one for each, like x=80,y=80,z=400",
                param,
                ctx,
            )
        return tuple(Fraction(number) for number in numbers)


class _Words(click.ParamType):
    """Words of G-code that are to be ignored."""

    name = "WORD,…"

    def convert(self, value: Any, param: Any, ctx: Any) -> frozenset[str]:
        words = frozenset(word.strip().upper() for word in value.split(","))
        for word in sorted(words - set(IGNORABLE)):
            self.fail(f"{word!r} cannot be ignored: choose of {','.join(IGNORABLE)}", param, ctx)
        return words


_GCODE = ("steps_per_mm", "clock", "rapid", "ignore")
_gcode_options = _options(
    click.option(
        "--steps-per-mm",
        type=_StepsPerMm(),
        help="G-code: steps a millimetre, of all axes or of each.",
    ),
    click.option(
        "--clock",
        type=_Speed("a clock", "MHz"),
        metavar="MHZ",
        help="G-code: run on the whole device, whose clock this is, at the speeds of F.",
    ),
    click.option(
        "--rapid",
        type=_Speed("a speed", "mm a minute"),
        metavar="SPEED",
        help="G-code: speed of G0, in mm a minute.",
    ),
    click.option(
        "--ignore",
        type=_Words(),
        help=f"G-code: what may be left out of {','.join(IGNORABLE)}, like M3,M5,S.",
    ),
)


def _run_options(curve: str, width: Callable = _width) -> Callable:
    return _options(
        _drive_options,
        click.option(
            "--method",
            type=_MethodName(curve=curve),
            help=f"See `discreta methods`; {_EXACT} is {DEFAULTS[curve]}. "
            f"[default: {DEFAULTS[curve]}]",
        ),
        width,
        _setting_options,
        click.option(
            "--engine",
            type=click.Choice(ENGINES),
            help="[default: compiled where there is a C++ compiler and no --vcd, else pysim]",
        ),
        click.option(
            "--trace", metavar="FILE.csv|-", help="Every step: clock, then the coordinates."
        ),
        click.option("--vcd", metavar="FILE.vcd", help="Waveform, with a .gtkw view beside it."),
        click.option("--plot", metavar="FILE.svg|.png", help="Picture of the path and its error."),
        click.option("--json", "summary_file", metavar="FILE|-", help="The summary, as JSON."),
    )


def _chosen(method: Design, setting: str, given: dict[str, Any]) -> dict[str, Any]:
    """Give a method's choices: those of a setting, and in their place what is given.

    Raises
    ------
    BadInputError
        The method has no such setting or choice, or none of this value.
    """
    if setting not in method.settings:
        raise BadInputError(
            f"--setting {setting}: choose {' or '.join(method.settings)} for {method.name}"
        )
    choices = dict(method.settings[setting])
    for name, value in given.items():
        if value is not None and name not in choices:
            raise BadInputError(
                f"--{name} is no option of {method.name}, which has "
                f"{' and '.join(f'--{choice}' for choice in choices) or 'none'}: leave it out"
            )
        if isinstance(value, str) and value not in method.choices[name]:
            raise BadInputError(
                f"--{name} {value}: choose {' or '.join(method.choices[name])} for {method.name}"
            )
        if value is not None:
            choices[name] = value
    return choices


def _default(curve: str, setting: str, given: dict[str, Any]) -> Method:
    """Give the method of a kind of curve that is run when none is named.

    Raises
    ------
    BadInputError
        It has no such setting or choice, but another one has.
    """
    method = METHODS[DEFAULTS[curve]]
    chosen = [name for name, value in given.items() if value is not None]
    if setting in method.settings and not set(chosen) - set(method.choices):
        return method
    for other in METHODS.values():
        if other.curve == curve and setting in other.settings and set(chosen) <= set(other.choices):
            missing = f"no setting {setting!r}"
            if setting in method.settings:
                missing = f"no option --{next(c for c in chosen if c not in method.choices)}"
            raise BadInputError(f"{method.name} has {missing}: add --method {other.name}")
    return method


def _check_width(method: Design, width: int) -> None:
    """Raise :class:`BadInputError` for a width that a method's devices do not have."""
    if width > method.max_width:
        raise BadInputError(
            f"--width {width}: {method.name} has up to {method.max_width} bits: choose "
            f"{MIN_WIDTH} to {method.max_width}"
        )


def _maker(
    method: Design, width: int, axes: int, setting: str, given: dict[str, Any]
) -> Callable[[], Part]:
    """Give what makes the RTL of a design, or raise :class:`BadInputError` if nothing does."""
    if axes not in method.axes:
        raise BadInputError(f"--axes {axes}: {method.name} has {method.axes[0]} axes: leave it out")
    _check_width(method, width)
    return partial(method.core, width, axes, **_chosen(method, setting, given))


_one_setting = click.option(
    "--setting",
    metavar="NAME",
    help="One setting alone, default or lecture. [default: every combination of the options]",
)


def _variants(method: Design, setting: str | None) -> list[dict[str, Any]]:
    """Give the variants of a method, or of them the one that is a setting."""
    if setting is None:
        return method.variants()
    return [_chosen(method, setting, {})]


class _Commands(click.Group):
    """Commands whose standard output may end before they do."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; when nobody reads what it prints, end as other commands do."""
        try:
            try:
                return super().invoke(ctx)
            finally:
                sys.stdout.flush()
        except BrokenPipeError:
            raise click.exceptions.Exit(128 + signal.SIGPIPE) from None


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(metadata.version("discreta"), prog_name="discreta")
def cli() -> None:
    """Interpolators as hardware: from a start to an end along a curve, every smallest step.

    Example: discreta simulate line --start 0,0 --end 200,99 --plot line.svg
    """


@cli.group("simulate")
def simulate_group() -> None:
    """Run the RTL clock by clock.

    Example: discreta simulate line --start 0,0 --end 200,99 --plot line.svg
    """


@simulate_group.command("line")
@click.option(
    "--start", type=_Point(MAX_AXES), required=True, help="Where the line begins, in steps."
)
@click.option("--end", type=_Point(MAX_AXES), required=True, help="Where it ends.")
@_run_options("line")
@_timing_options
def simulate_line(start: tuple[int, ...], end: tuple[int, ...], width: int, **options: Any) -> None:
    """Run one line in two to six axes.

    Exits 1 when the end is not reached.

    Example: discreta simulate line --start 0,0 --end 200,99 --plot line.svg
    """
    if len(start) != len(end):
        raise BadInputError(
            f"--start has {len(start)} coordinates and --end has {len(end)}: give both as many"
        )
    check_line(start, end, width)
    _simulate(Polyline([start, end]), width=width, **options)


@simulate_group.command("path")
@click.argument("file", metavar="FILE")
@_gcode_options
@_run_options("line")
@_timing_options
def simulate_path(file: str, width: int, **options: Any) -> None:
    """Run a polyline or a program in G-code.

    A CSV FILE has a header with the axis letters (x,y and so on) and a support point in every row,
    in steps, which are run without a gap. A path whose last point is its first is closed. A point
    that repeats the one before it takes a clock or two and no step. Exits 1 when a point is missed.

    A FILE whose name ends in .ngc, .nc, .gcode or .tap has G-code, in mm or inches, and needs
    --steps-per-mm. Its lines run on exact_line and its arcs on exact_arc; with --clock on the whole
    device, at the speeds that F says. What is not understood is refused with file and line. So:
    discreta simulate path examples/plate.ngc --steps-per-mm 80 --plot plate.svg

    Example: discreta simulate path examples/bulgaria.csv --plot border.svg
    """
    program = {name: options.pop(name) for name in _GCODE}
    if is_gcode(file):
        _simulate_program(file, width, program, options)
        return
    _check_no_gcode(file, program)
    _simulate(Polyline(read_points(file, width)), width=width, reads=(file,), **options)


def _check_no_gcode(file: str, program: dict[str, Any]) -> None:
    """Refuse options of G-code for a file that has none."""
    for name, value in program.items():
        if value:
            raise BadInputError(
                f"--{name.replace('_', '-')} goes with G-code, and {file} is read as CSV: leave it "
                f"out, or name a file that ends in {', '.join(SUFFIXES)}"
            )


def _read_program(file: str, width: int, program: dict[str, Any]) -> list[Move]:
    """Read a program in G-code."""
    if program["steps_per_mm"] is None:
        raise BadInputError(
            f"{file} is in mm or inches: give --steps-per-mm, like --steps-per-mm 80"
        )
    return read_moves(file, program["steps_per_mm"], width, program["ignore"] or ())


def _feeds(file: str, moves: list[Move], program: dict[str, Any]) -> list[Fraction]:
    """Give the speed of every move of a program, in steps per clock."""
    try:
        return speeds(moves, program["clock"] * 10**6, program["rapid"])
    except BadInputError as error:
        raise BadInputError(f"{file}, {error}") from None


def _simulate_program(
    file: str, width: int, program: dict[str, Any], options: dict[str, Any]
) -> None:
    """Run a program in G-code."""
    for name in (*_CHOICES, "speed", "period", "feed"):
        if options.pop(name) is not None:
            why = "the speed is that of F and --rapid" if name == "feed" else "its cores have none"
            raise BadInputError(f"--{name} does not go with G-code, {why}: leave it out")
    if options.pop("setting") != "default" or options.pop("method") not in (None, CORES["line"]):
        raise BadInputError(
            f"G-code runs on {' and '.join(core.name for core in CORES.values())}: leave out "
            "--method and --setting"
        )
    moves = _read_program(file, width, program)
    device = {name: options.pop(name) for name in ("accel", "pulse")} | {"feed": None}
    asked = [
        f"--{name}"
        for name in ("rapid", "accel", "pulse", "plotter", "screen")
        if (program | device | options)[name] is not None
    ]
    if program["clock"] is None and asked:
        raise BadInputError(
            f"{asked[0]} goes with the whole device, which turns mm a minute into clocks: give "
            "--clock, too"
        )
    drive, feeds = None, []
    if program["clock"] is not None:
        feeds = _feeds(file, moves, program)
        drive = _drive(device | {"feed": max(feeds)}, options)
    _run_shown(
        partial(run_program, Program(moves), width=width, drive=drive, feeds=feeds, reads=(file,)),
        options,
    )


@simulate_group.command("arc")
@click.option("--start", type=_Point(2), required=True, help="Where the arc begins, in steps.")
@click.option(
    "--end",
    type=_Point(2),
    required=True,
    help="Where it ends, on the circle of the start or up to a step off it; the start itself is a "
    "full turn away.",
)
@click.option("--center", type=_Point(2), required=True, help="The center of the circle.")
@click.option(
    "--direction",
    type=click.Choice(["ccw", "cw"]),
    required=True,
    help="Counter-clockwise, as seen with x to the right and y upwards, or clockwise.",
)
@click.option(
    "--turns",
    type=_Number("number of turns", 1, MAX_TURNS, check_turns),
    default=1,
    show_default=True,
    help=f"The turn in which it ends, up to {MAX_TURNS}, like the P of G2 and G3.",
)
@_run_options("arc")
@_timing_options
def simulate_arc(
    start: tuple[int, ...],
    end: tuple[int, ...],
    center: tuple[int, ...],
    direction: str,
    turns: int,
    **options: Any,
) -> None:
    """Run one arc of a circle, up to 256 turns of it.

    In the summary, turn is the angle in degrees, positive counter-clockwise. Exits 1 when the end
    is not reached.

    \b
    Example: discreta simulate arc --start 100,0 --end 0,100 \\
                 --center 0,0 --direction ccw
    """
    _simulate(Arc(start, end, center, clockwise=direction == "cw", turns=turns), **options)


@simulate_group.command("conic")
@click.option(
    "--coefficients",
    type=_Numbers("A,B,C,D,E", "1,0,1,0,0"),
    help="A curve Ax^2 + Bxy + Cy^2 + Dx + Ey + F = 0; F follows from the start.",
)
@click.option(
    "--ellipse",
    "shape",
    type=_Numbers("X,Y,R1,R2,DEGREES", "0,0,300,120,30"),
    help="An ellipse by its center, its semi-axes, and the angle of the first one to the x axis.",
)
@click.option(
    "--parabola",
    "control",
    type=_Point(2),
    help="A parabola: the point where its tangents at start and end meet.",
)
@click.option("--start", type=_Point(2), help="Where the curve begins, in steps.")
@click.option("--end", type=_Point(2), help="Where it ends, on the curve or up to a step off it.")
@click.option(
    "--direction",
    type=click.Choice(["ccw", "cw"]),
    help="With the bend to the left (ccw) or to the right (cw), as seen with x to the right and y "
    "upwards. A straight line goes to its end in any case.",
)
@click.option(
    "--angles",
    type=_Numbers("FROM,TO", "0,90"),
    help="Where an ellipse begins and ends: in degrees, 0 at the end of the first semi-axis and 90 "
    "at that of the second. [default: 0,360]",
)
@click.option(
    "--turns",
    type=_Number("number of turns", 1, MAX_TURNS, check_turns),
    help=f"The turn of an ellipse or circle in which it ends, up to {MAX_TURNS}. [default: 1]",
)
@_run_options("conic", _width_option(16, CONIC_MAX_WIDTH))
def simulate_conic(width: int, **options: Any) -> None:
    """Run one piece of an ellipse, circle, parabola, hyperbola or line.

    The curve is given by --coefficients with --start, --end and --direction, by --ellipse with
    --direction, or by --parabola with --start and --end, which say its direction. Numbers may be
    whole, decimals or fractions. In the summary, curve moved is how far it had to be moved for the
    device's coefficients, in steps. Exits 1 when the end is not reached.

    \b
    Example: discreta simulate conic --ellipse 0,0,300,120,30 \\
                 --direction ccw --plot ellipse.svg
    """
    given = {name: options.pop(name) for name in _CONIC_OPTIONS}
    _simulate(Conic(_conic_block(given, width)), width=width, **options)


#: What gives a conic: what goes with each, and what must.
_CONICS = {
    "coefficients": (("start", "end", "direction", "turns"), ("start", "end", "direction")),
    "shape": (("direction", "angles", "turns"), ("direction",)),
    "control": (("start", "end"), ("start", "end")),
}
_CONIC_OPTIONS = (*_CONICS, "start", "end", "direction", "angles", "turns")


def _conic_block(given: dict[str, Any], width: int) -> ConicBlock:
    """Make the block of a conic from the options, of which those that are not given are None."""
    named = {"shape": "--ellipse", "control": "--parabola"}
    words = {name: named.get(name, f"--{name}") for name in given}
    chosen = [name for name in _CONICS if given[name] is not None]
    if len(chosen) != 1:
        raise BadInputError(
            f"{' and '.join(words[name] for name in chosen) or 'no curve'} given: choose one of "
            f"{', '.join(words[name] for name in _CONICS)}"
        )
    (way,) = chosen
    fitting, needed = _CONICS[way]
    for name, value in given.items():
        if value is not None and name not in (way, *fitting):
            raise BadInputError(f"{words[name]} does not go with {words[way]}: leave it out")
        if value is None and name in needed:
            raise BadInputError(f"{words[way]} needs {words[name]} too: give it")
    clockwise, full_turns = given["direction"] == "cw", (given["turns"] or 1) - 1
    start, end = given["start"], given["end"]
    if way == "coefficients":
        return from_coefficients(given[way], start, end, clockwise, width, full_turns)
    if way == "control":
        return parabola(start, given[way], end, width)
    x, y, r1, r2, turned = given[way]
    if x.denominator * y.denominator != 1:
        raise BadInputError(
            f"the center {float(x):g},{float(y):g} of --ellipse is between the steps: give whole "
            "numbers"
        )
    first, last = given["angles"] or (0, 0)
    return ellipse(
        (int(x), int(y)),
        (r1, r2),
        turned,
        width,
        start_angle=first,
        end_angle=last,
        clockwise=clockwise,
        full_turns=full_turns,
    )


def _simulate(curve: Curve, *, method: Method | None, setting: str, **options: Any) -> None:
    given = {name: options.pop(name) for name in _CHOICES}
    method = method or _default(curve.kind, setting, given)
    choices = _chosen(method, setting, given)
    _check_width(method, options["width"])
    drive = _drive({name: options.pop(name) for name in _DRIVE}, options)
    _run_shown(partial(run, curve, method, drive=drive, **choices), options)


def _run_shown(run_it: Callable[..., dict[str, Any]], options: dict[str, Any]) -> None:
    """Run something under a progress bar and print its summary; exit 1 when an end is missed."""
    trace, vcd = options["trace"], options["vcd"]
    # Without a word the run would only seem slow.
    slow = options["engine"] is None and vcd is None and default_engine() == "pysim"
    # The steps may go to the very terminal of the bar.
    with _progress("clocks", quiet=trace == "-") as show:

        def progress(done: int, total: int) -> None:
            if slow and not done:
                click.echo(
                    "no C++ compiler found: running on pysim, which is much slower", err=True
                )
            show(done, total)

        began = time.perf_counter()
        summary = run_it(progress=progress, **options)
        seconds = time.perf_counter() - began
    _print_summary(summary, seconds, err="-" in (trace, options["summary_file"]))
    if not summary["end point reached"]:
        raise click.exceptions.Exit(1)


def _drive(given: dict[str, Any], options: dict[str, Any]) -> Drive | None:
    """Give what the whole device is programmed with; None when nothing asks for it."""
    pictures = (options["plotter"], options["screen"])
    if all(value is None for value in (*given.values(), *pictures)):
        return None
    chosen: dict[str, Any] = {}
    if given["feed"] is not None:
        chosen["feed"] = given["feed"]
    if given["accel"] is not None:
        (chosen["acceleration"],) = given["accel"]
    if given["pulse"] is not None:
        try:
            chosen["timing"] = PulseTiming(*given["pulse"])
        except ValueError as error:
            raise BadInputError(f"--pulse: {error}") from None
    return Drive(**chosen)


def _print_summary(summary: dict[str, Any], seconds: float, *, err: bool) -> None:
    room = max(map(len, summary))
    for name, value in summary.items():
        if value is None:
            value = "-"
        elif isinstance(value, bool):
            value = "yes" if value else "no"
        elif isinstance(value, float):
            value = f"{value:.4f}"
        elif isinstance(value, list):
            value = say_point(value)
        click.echo(f"{name:{room}}  {value}", err=err)
    click.echo(f"{'time':{room}}  {seconds:.2f} s", err=err)


@contextmanager
def _progress(what: str, *, quiet: bool = False) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar on a terminal; give the function that takes what is done of the total."""
    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    off = quiet or not sys.stderr.isatty()
    with Progress(*columns, console=console, transient=True, disable=off) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def _out(*, err: bool = False) -> Console:
    """Give the standard output or error: tables fold on a terminal and are whole in a file."""
    stream = sys.stderr if err else sys.stdout
    return Console(
        highlight=False, markup=False, stderr=err, width=None if stream.isatty() else 250
    )


@cli.command(short_help="Write a method or the device as Verilog-2005 with plain ports.")
@click.argument("method", type=_MethodName(units=True))
@_width
@_axes
@_setting_options
@click.option("--output", metavar="FILE.v", default="-", help="[default: standard output]")
@click.option(
    "--testbench",
    is_flag=True,
    help="Write a self-checking test bench with golden vectors beside it, FILE_tb.v.",
)
@click.option(
    "--vectors", is_flag=True, help="Write these vectors beside it for cocotb, FILE.json."
)
@click.option(
    "--core", is_flag=True, help="Write a FuseSoC core file beside it, FILE.core, for both."
)
def verilog(
    method: Design,
    width: int,
    axes: int,
    setting: str,
    output: str,
    testbench: bool,
    vectors: bool,
    core: bool,
    **given: Any,
) -> None:
    """Write a method as Verilog-2005 with plain ports, or the whole device, or a unit of it.

    These are device (lines, arcs and conics from one queue to the pins of the motor drivers), feed,
    pulse, and link, uart_receiver and uart_transmitter, which take it to a serial line.
    The test bench runs in any simulator that knows $fatal, and prints PASS or FAIL.

    Example: discreta verilog exact_line --width 16 --output line.v --testbench
    """
    make = _maker(method, width, axes, setting, given)
    name = f"discreta_{method.name}"
    beside = (("testbench", testbench), ("vectors", vectors), ("core", core))
    for option, on in beside:
        if on and output == "-":
            raise BadInputError(f"--{option} is written beside the core: give --output FILE.v")
    file = Path(output)
    bench_file = file.with_name(f"{file.stem}_tb.v")
    with Outputs() as outputs:
        outputs.open(output).write(emit_verilog(top := PlainPorts(make()), name))
        if testbench or vectors:
            golden = method.model(width, axes, **_chosen(method, setting, given))
            found = golden_vectors(method, top, golden)
            if testbench:
                outputs.open(str(bench_file)).write(write_bench(top, name, found))
            if vectors:
                json.dump(asdict(found), outputs.open(str(file.with_suffix(".json"))))
        if core:
            bench = bench_file.name if testbench else None
            text = core_file(method.name, method.summary, name, file.name, bench)
            outputs.open(str(file.with_suffix(".core"))).write(text)


@cli.command("synth", short_help="Measure cells and clock speed on an FPGA.")
@_methods_argument(units=True)
@_width
@click.option(
    "--device",
    type=click.Choice(tuple(FPGAS)),
    default=next(iter(FPGAS)),
    show_default=True,
    help="The FPGA.",
)
@_axes
@_setting_options
@click.option("--json", "json_file", metavar="FILE|-", help="All there is to know, as JSON.")
def synth_command(
    methods: tuple[Design, ...],
    width: int,
    device: str,
    axes: int,
    setting: str,
    json_file: str | None,
    **given: Any,
) -> None:
    """Measure what methods, units or the whole device take of an FPGA, and how fast they are.

    Cells are those of the core by itself, logic cells those that it takes when packed. The clock
    is that of the core between registers: the median, the lowest and the highest of 5 placements.
    The last row is an accumulator alone, the limit of everything that sums; the last column is the
    clock in parts of that limit. The second table shows what sets the clock: the critical path of
    the median. Takes from half a minute to some minutes a method. Exits 1 when one does not fit.

    Example: discreta synth exact --width 16 --device hx8k
    """
    makers = [_maker(method, width, axes, setting, given) for method in methods]
    makers.append(partial(LoneAccumulator, width))
    workers = min(2, os.cpu_count() or 1)  # one may take 400 MB, and all together shall take 1 GB
    names = [*(method.name for method in methods), "accumulator"]
    done = 0

    def progress() -> None:
        nonlocal done
        done += 1
        show(done, len(makers) * RUNS)

    with Outputs() as outputs, _progress("runs") as show:
        file = None if json_file is None else outputs.open(json_file)
        show(0, len(makers) * RUNS)
        try:
            check_tools(device)
            rows = [measure(make(), device, workers=workers, progress=progress) for make in makers]
        except ModuleNotFoundError as error:
            raise BadInputError(
                f"synthesis needs {error.name}: install the extra, pip install 'discreta[boards]'"
            ) from None
        if file is not None:
            found = [
                {"core": name, "median": row.median, "of_the_limit": row.of(rows[-1])} | asdict(row)
                for name, row in zip(names, rows, strict=True)
            ]
            json.dump({"device": device, "width": width, "cores": found}, file, indent=2)
            file.write("\n")
    title = f"{FPGAS[device].title}, width {width}"
    _print_measurements(title, list(zip(names, rows, strict=True)), err=json_file == "-")
    if any(row.problem for row in rows):
        raise click.exceptions.Exit(1)


def _print_measurements(title: str, rows: list[tuple[str, Measurement]], *, err: bool) -> None:
    """Print what cores take of an FPGA, the last one the limit of all, and their critical paths."""
    counts = ("LUTs", "carries", "multipliers", "block RAM", "flip-flops", "logic cells")
    table = _table(("core", *counts, "MHz", "lowest", "highest", "of the limit"))
    paths = _table(("core", "ns", "on wires", "levels", "carries", "from", "to"))
    for name, row in rows:
        cells = (row.luts, row.carries, row.multipliers, row.memories, row.flip_flops)
        speeds = ["-"] * 4
        if row.median is not None:
            clocks = (row.median, min(row.fmax.values()), max(row.fmax.values()))
            speeds[:3] = [f"{clock:.1f}" for clock in clocks]
        if (share := row.of(rows[-1][1])) is not None:
            speeds[3] = f"{share:.3f}"
        table.add_row(name, *map(str, (*cells, row.logic_cells)), *speeds)
        if (path := row.path) is not None:
            times = (f"{path.nanoseconds:.2f}", f"{path.routing_nanoseconds:.2f}")
            through = (str(path.levels), str(path.carries))
            paths.add_row(name, *times, *through, path.start, path.end)
    out = _out(err=err)
    out.print(title)
    out.print(table)
    out.print("critical paths")
    out.print(paths)
    for name, row in rows:
        if row.problem:
            click.echo(f"{name}: {row.problem}", err=True)


@cli.command("compare", short_help="All methods side by side: error, pace, cells, clock.")
@_methods_argument(required=False)
@_width
@click.option(
    "--device",
    type=click.Choice(tuple(FPGAS)),
    default=next(iter(FPGAS)),
    show_default=True,
    help="The FPGA.",
)
def compare_command(methods: tuple[Method, ...], width: int, device: str) -> None:
    """Compare methods in their default settings: how exact, how quick, how large, how fast.

    The largest error is that of a survey of 6 bits; clocks are those from one step to the next in
    the mean; cells and clock those of `discreta synth`; the last column is the clock by the clocks
    of a step. Without METHOD all there are, which takes a quarter of an hour. Exits 1 when a survey
    finds a register or an end that is not as it must be, or a method does not fit the FPGA.

    Example: discreta compare exact_line linear comparison
    """
    from discreta.sim.compare import PASSES, SURVEY_WIDTH, compare

    _needs_compiler()
    names = [method.name for method in methods] or list(METHODS)
    headings = ("method", "curve", f"error, {SURVEY_WIDTH} bits", "clocks a step", "LUTs")
    table = _table((*headings, "flip-flops", "logic cells", "MHz", "steps/s"), left=2)
    rows, done = [], 0

    def progress() -> None:
        nonlocal done
        done += 1
        show(done, len(names) * PASSES)

    with _progress("passes") as show:
        show(0, len(names) * PASSES)
        try:
            rows = list(compare(names, width, device, progress=progress))
        except ModuleNotFoundError as error:
            raise BadInputError(
                f"synthesis needs {error.name}: install the extra, pip install 'discreta[boards]'"
            ) from None
    for row in rows:
        clocks, clock, speed = row.clocks_per_step, row.cells.median, row.steps_per_second
        table.add_row(
            row.name,
            row.curve,
            f"{row.error:.4f}",
            "as timed" if clocks is None else f"{clocks:.2f}",
            *map(str, (row.cells.luts, row.cells.flip_flops, row.cells.logic_cells)),
            "-" if clock is None else f"{clock:.1f}",
            "-" if speed is None else f"{speed:,.0f}",
        )
    out = _out()
    out.print(f"{FPGAS[device].title}, width {width}")
    out.print(table)
    if not all(row.sound and not row.cells.problem for row in rows):
        raise click.exceptions.Exit(1)


@cli.command(short_help="Prove that the RTL equals its model and keeps its promises.")
@_methods_argument(units=True)
@_width
@_one_setting
@click.option(
    "--verilog", is_flag=True, help="Prove instead that the Verilog, read again, is the RTL."
)
def prove(methods: tuple[Design, ...], width: int, setting: str | None, verilog: bool) -> None:
    """Prove a method: RTL = golden model, and its promises, for every block of a width.

    Or a unit of the device: feed, pulse, or the device itself, with a queue of one block.

    Every combination of the method's options is proven, in the plane; what they share is proven
    once. What is marked as checked was run in every case there is, which it names. Exits 1 when
    something does not hold, with the values that break it.

    Example: discreta prove exact --width 8
    """
    try:
        from discreta.sim.prover import prove_variant, prove_verilog, shares
    except ModuleNotFoundError as error:
        raise BadInputError(
            f"proofs need {error.name}: install the extra, pip install 'discreta[prove]'"
        ) from None
    for method in methods:
        _check_width(method, width)
    out = Console(highlight=False, soft_wrap=True)
    jobs = [
        (method, variant)
        for method in methods
        for variant in [
            *([None] if shares(method.name) and not verilog else []),
            *_variants(method, setting),
        ]
    ]
    good = True
    began = time.perf_counter()
    count = {"proven": 0, "checked": 0}
    with ProcessPoolExecutor(min(len(jobs), os.cpu_count() or 1)) as pool:
        results = pool.map(
            prove_verilog if verilog else prove_variant,
            [method.name for method, _ in jobs],
            [width] * len(jobs),
            [variant for _, variant in jobs],
        )
        with _progress("variants") as show:
            show(0, len(jobs))
            for done, ((method, variant), verdicts) in enumerate(
                zip(jobs, results, strict=True), start=1
            ):
                show(done, len(jobs))
                what = "every variant" if variant is None else say_choices(variant)
                out.print(", ".join(filter(None, (f"{method.name}, width {width}", what))))
                for verdict in verdicts:
                    kind = "checked" if verdict.exhaustive else "proven"
                    mark = kind if verdict.holds else "FAILED"
                    took = f"{verdict.seconds:{12 - len(mark)}.2f} s"
                    out.print(f"  {mark} {took}  {verdict.title}", markup=False)
                    if not verdict.holds:
                        out.print(f"         {verdict.counterexample}", markup=False)
                    count[kind] += verdict.holds
                good &= all(verdict.holds for verdict in verdicts)
    seconds = time.perf_counter() - began
    counted = f"{count['proven']} proven, "
    counted += f"{count['checked']} checked in every case, " if count["checked"] else ""
    out.print(f"{counted}{'all hold' if good else 'NOT ALL HOLD'}, {seconds:.1f} s")
    if not good:
        raise click.exceptions.Exit(1)


@cli.command("netlist", short_help="Simulate and prove the netlist for an iCE40.")
@click.argument("methods", type=_MethodName(), nargs=-1, required=True, metavar="METHOD...")
@_width
@_one_setting
@click.option(
    "--prove/--no-prove",
    default=True,
    show_default=True,
    help="Whether to prove the netlist equal to the RTL, for all states and inputs.",
)
def netlist_command(
    methods: tuple[Method, ...], width: int, setting: str | None, prove: bool
) -> None:
    """Synthesize methods for the iCE40, and show that the netlist is the method still.

    Golden vectors run through the netlist in Icarus, with Yosys' models of the cells, and every
    output is compared at every clock; then one clock of netlist and RTL is proven equal, from all
    states. Without --setting that of the default. Exits 1 when something differs or is not proven.

    Example: discreta netlist linear circular exact_line exact_arc --width 16
    """
    try:
        from discreta.sim.equal import netlist, simulate_netlist
        from discreta.sim.prover import prove_netlist
    except ModuleNotFoundError as error:
        raise BadInputError(
            f"netlists need {error.name}: install the extra, pip install 'discreta[prove]'"
        ) from None
    if reason := available("icarus"):
        raise BadInputError(reason)
    for method in methods:
        _check_width(method, width)
    table = _table(("method", "LUTs", "carries", "flip-flops", "simulated", "proven"))
    findings = []
    with _progress("methods") as show:
        show(0, len(methods))
        for done, method in enumerate(methods, start=1):
            choices = _chosen(method, setting or "default", {})
            try:
                cells = netlist(method.core(width, **choices), "core").cells
                same, said = simulate_netlist(method, width, choices)
                verdicts = prove_netlist(method.name, width, choices) if prove else []
            except (SynthesisError, RuntimeError) as error:
                raise SynthesisError(f"{method.name}: {error}") from None
            wrong = [it for it in verdicts if not it.holds]
            findings += [f"{method.name}: {said}"] if not same else []
            findings += [f"{method.name}: {it.title}: {it.counterexample}" for it in wrong]
            table.add_row(
                method.name,
                *(
                    str(sum(count for cell, count in cells.items() if cell.startswith(kind)))
                    for kind in ("SB_LUT4", "SB_CARRY", "SB_DFF")
                ),
                said.splitlines()[0].partition(", ")[2] if same else "DIFFERS",
                ("NOT PROVEN" if wrong else f"{sum(it.seconds for it in verdicts):.1f} s")
                if prove
                else "-",
            )
            show(done, len(methods))
    out = _out()
    out.print(f"Lattice iCE40, width {width}")
    out.print(table)
    for finding in findings:
        click.echo(finding, err=True)
    if findings:
        raise click.exceptions.Exit(1)


@cli.command("mutants", short_help="Make defects of a method, and tell which check catches each.")
@click.argument("methods", type=_MethodName(), nargs=-1, required=True, metavar="METHOD...")
@_width_option(8)
@click.option(
    "--count",
    type=click.IntRange(1, 10_000),
    default=200,
    show_default=True,
    help="How many mutants of each method.",
)
@click.option("--seed", type=click.IntRange(0), default=1970, show_default=True)
def mutants_command(methods: tuple[Method, ...], width: int, count: int, seed: int) -> None:
    """Make mutants of methods in their default settings, one defect each, and try every one.

    Yosys changes one bit in the core. Golden vectors run through the mutant in Icarus, the outputs
    and then every register compared at every clock; and it is compared with the core for all states
    by SMT. The columns count the mutants by the first check that catches them. What none catches is
    proven to be the same machine in every state: it is listed with its place. Exits 1 when a mutant
    is neither.

    Example: discreta mutants linear --count 200
    """
    try:
        from discreta.sim.mutants import CHECKS, judge
    except ModuleNotFoundError as error:
        raise BadInputError(
            f"mutants need {error.name}: install the extra, pip install 'discreta[prove]'"
        ) from None
    if reason := available("icarus"):
        raise BadInputError(reason)
    for method in methods:
        _check_width(method, width)
    table = _table(("method", "mutants", *CHECKS, "none", "time"))
    left, good = [], True
    for method in methods:
        began = time.perf_counter()
        first = Counter()
        with _progress(f"mutants of {method.name}") as show:
            try:
                for verdict in judge(
                    method.name,
                    width,
                    method.settings["default"],
                    count=count,
                    seed=seed,
                    workers=os.cpu_count() or 1,
                    progress=show,
                ):
                    first[verdict.caught] += 1
                    good &= bool(verdict.caught) or verdict.same
                    if not verdict.caught:
                        left.append((method.name, verdict))
            except RuntimeError as error:
                raise SynthesisError(f"{method.name}: {error}") from None
        caught = [str(first[check]) for check in CHECKS]
        seconds = f"{time.perf_counter() - began:.0f} s"
        table.add_row(method.name, str(first.total()), *caught, str(first[""]), seconds)
    out = _out()
    out.print(f"width {width}, seed {seed}; by the first check that catches them")
    out.print(table)
    for name, verdict in left:
        mutant = verdict.mutant
        how = "the same machine" if verdict.same else "NOT DECIDED"
        where = mutant.where or "no line"
        click.echo(f"{name} {mutant.number}: {mutant.what} ({where}): {how}")
    if not good:
        raise click.exceptions.Exit(1)


@cli.command("survey", short_help="Run every block there is and compare every register.")
@_methods_argument()
@_width_option(8)
@_one_setting
@click.option(
    "--whole-degrees",
    is_flag=True,
    help="Arcs: instead of the usual ones all that lead from one whole degree to another on 66 "
    "circles, their points rounded to whole steps.",
)
def survey_command(
    methods: tuple[Method, ...], width: int, setting: str | None, whole_degrees: bool
) -> None:
    """Run all blocks of a kind, or a seeded sample, and judge every step and every register.

    Lines: of all lengths. Arcs: all quarter arcs and circles about the origin, some circles ten
    times round, and a sample of any arcs. Conics: 20,000 of every kind, and some ellipses ten times
    round. On a carrier: a sample of them all with a sample of timings, and some whose timing is to
    be refused. The column 99.9 % has the error that so many of the blocks do not exceed. Clocks are
    those in which the device sums, per step of the axis that moves faster. Runs on the compiled
    engine. Exits 1 when a register differs from the golden model, an end is missed or an error is
    above the proven bound.

    Example: discreta survey exact_line --width 8
    """
    from discreta.sim import groups as choice

    if default_engine() != "compiled":
        raise BadInputError("a survey needs the compiled engine: install a C++ compiler")
    choose = choice.whole_degrees if whole_degrees else choice.survey_groups
    try:
        surveys = [
            (method, choose(method, width), _variants(method, setting)) for method in methods
        ]
    except ValueError as error:
        raise BadInputError(str(error)) from None
    good = [_survey(method, width, groups, variants) for method, groups, variants in surveys]
    if not all(good):
        raise click.exceptions.Exit(1)


def _survey(
    method: Method, width: int, groups: list["Group"], variants: list[dict[str, Any]]
) -> bool:
    """Survey one method and print what was found; tell whether all was as it must be."""
    from discreta.sim.groups import SEED
    from discreta.sim.survey import SurveyRow, say_worst, survey

    rows = [[SurveyRow(variant, number) for variant in variants] for number in range(len(groups))]
    total = sum(len(group.blocks) for group in groups) * len(variants)
    ran = 0
    began = time.perf_counter()
    with _progress(f"{method.curve}s") as show:
        show(0, total)
        for part in survey(method, width, groups, variants):
            rows[part.group][variants.index(part.variant)].add(part)
            ran += part.blocks
            show(ran, total)
    seconds = time.perf_counter() - began

    out = _out()
    for group, found in zip(groups, rows, strict=True):
        every = all(row.compared == row.blocks for row in found)
        compared = "every register" if every else f"registers of some (seed {SEED})"
        refused = sum(group.answers != 0)
        to_refuse = f", {refused} to be refused" if refused else ""
        title = f"{method.name}, width {width}: {group.title}{to_refuse}, {compared} compared"
        headings = ["variant", "largest error", "99.9 %", f"on the {method.curve}", "at"]
        headings += [] if method.timed else ["clocks/step"]
        headings += ["ends missed"]
        headings += [] if method.curve == "line" or method.timed else ["completed"]
        headings += [] if every else ["compared"]
        table = Table(box=None, pad_edge=False)
        for heading in headings:
            table.add_column(heading, justify="left" if heading == "variant" else "right")
        for row in found:
            cells = {
                "variant": say_choices(row.variant),
                "largest error": f"{row.largest_error:.4f}",
                "99.9 %": f"{row.usual_error:.4f}",
                "clocks/step": f"{row.summations / max(row.length, 1):.4f}",
                "ends missed": str(row.ends_missed),
                "completed": str(row.completed),
                "compared": str(row.compared),
            }
            cells[f"on the {method.curve}"], cells["at"] = say_worst(method, group, row)
            table.add_row(*(cells[heading] for heading in headings))
        out.print(title, soft_wrap=True)
        out.print(table)
    every_row = [row for found in rows for row in found]
    clocks = sum(row.clocks for row in every_row)
    out.print(
        f"{clocks} clocks of RTL in {seconds:.1f} s, {clocks / seconds / 1e6:.1f} million a second"
    )
    for row in every_row:
        for finding in row.findings:
            click.echo(f"{say_choices(row.variant)}: {finding}", err=True)
    return all(row.good for row in every_row)


def _needs_compiler() -> None:
    if default_engine() != "compiled":
        raise BadInputError("this needs the compiled engine: install a C++ compiler")


def _table(headings: tuple[str, ...], left: int = 1) -> Table:
    """Make a table, its first columns to the left."""
    table = Table(box=None, pad_edge=False)
    for index, heading in enumerate(headings):
        table.add_column(heading, justify="left" if index < left else "right")
    return table


@cli.command("feed", short_help="Measure the speed along the path, and the accuracy of F.")
def feed_command() -> None:
    """Measure speed along the path, and how exactly F is kept, on the device's pins.

    The first table is of the exact lines and arcs: how far, in steps, the machine is at most ahead
    of F·t or behind it, on lines at every whole degree and on whole circles; the second one of arcs
    with a further axis. Then the lecture's interpolators, whose speed is made by pauses: for the
    same lines and for circles, how far the speed is from F in windows of 40 moves, in percent: with
    the device's own rule for the pauses after a step, with the exercise's, and with the exercise's
    but for the root of 2. The last one shows the error of the mean pause for speeds of every octave
    from 1 to 2^-24, in 2^-16. Takes a minute or so. Exits 1 when F is off by more than that
    anywhere, or a machine by 2 steps, or a further axis misses its end.

    Example: discreta feed
    """
    from discreta.sim.speed import RULES, accuracy, along_path, drift, helices

    _needs_compiler()
    out = _out()
    table = _table(("curves", "how many", "ahead of F·t, steps", "behind", "at the end"))
    drifts = drift()
    for row in drifts:
        off = (f"{value:.3f}" for value in (row.ahead, row.behind, row.at_end))
        table.add_row(row.what, str(row.curves), *off)
    out.print("constant speed")
    out.print(table)
    columns = ("steps for one of arc", "helices", "ends missed", "off the circle, steps")
    table = _table((*columns, "off the line, steps", "ticks off"), left=0)
    turned = helices()
    for row in turned:
        off = (f"{row.off_circle:.4f}", f"{row.off_line:.4f}", f"{row.off_ticks:g}")
        table.add_row(f"{row.steepness:g}", str(row.helices), str(row.ends_missed), *off)
    out.print("arcs with a further axis")
    out.print(table)
    for rule in RULES:
        table = _table(("curves", "windows", "slowest, %", "at", "fastest, %", "at"))
        for row in along_path(rule):
            slowest, fastest = f"{row.smallest:+.2f}", f"{row.largest:+.2f}"
            table.add_row(
                row.what, str(row.windows), slowest, row.smallest_at, fastest, row.largest_at
            )
        out.print(f"speed along the path, {rule.title}")
        out.print(table)
    table = _table(("F from", "speeds", "largest error, 2^-16", "clocks"), left=0)
    rows = accuracy()
    for row in rows:
        error = f"{row.largest_error:.4f}"
        table.add_row(f"2^-{row.octave}", str(row.speeds), error, str(row.clocks))
    out.print("accuracy of F")
    out.print(table)
    good = max(row.largest_error for row in rows) <= 1
    good &= max(max(row.ahead, row.behind) for row in drifts) < 2
    good &= not any(row.ends_missed for row in turned)
    if not good:
        raise click.exceptions.Exit(1)


@cli.command("limits", short_help="Time of a step and highest speed of every method.")
@_width
@click.option(
    "--clock",
    type=click.FloatRange(0, min_open=True),
    default=100.0,
    show_default=True,
    metavar="MHZ",
    help="The device's clock, in MHz.",
)
def limits_command(width: int, clock: float) -> None:
    """Time of a step and highest speed of every method, and of the whole device.

    The exercise's control questions 5 and 6. Every step is taken at once; clocks are those from one
    step to the next: the fewest, in the mean, and the most, at which the speed is kept at every
    step. On a carrier they are those of a whole period.

    Example: discreta limits --clock 100
    """
    from discreta.sim.speed import limits

    _needs_compiler()
    headings = ("method", "curve", "bits", "clocks", "mean", "most", "ns", "most")
    table = _table((*headings, "steps/s in the mean", "kept"), left=2)
    for row in limits(width, clock * 1e6):
        speeds = [
            "-" if speed is None else f"{speed:,.0f}" for speed in (row.mean_speed, row.kept_speed)
        ]
        name = f"{row.method}, a period" if row.per_period else row.method
        clocks = (str(row.least), f"{row.mean:.2f}", str(row.most))
        times = (f"{row.mean_ns:.1f}", f"{row.most_ns:.0f}")
        table.add_row(name, row.curve, str(row.width), *clocks, *times, *speeds)
    _out().print(table)


@cli.command("stress", short_help="Run random blocks through the device and judge its pins.")
@click.option(
    "--blocks", type=click.IntRange(1), default=100_000, show_default=True, help="How many blocks."
)
@click.option("--seed", type=click.IntRange(0), default=1970, show_default=True)
def stress_command(blocks: int, seed: int) -> None:
    """Run random blocks of all kinds through the whole device, and judge its pins.

    With random speeds, accelerations, pulses, gaps, holds, single steps, overrides, stops,
    emergency stops and limit switches; the steps are compared with the golden models'. Exits 1 when
    a step is lost or too many, the position is not the pulses, or a rule of timing is broken.

    Example: discreta stress --blocks 1000
    """
    from discreta.sim.stress import stress

    _needs_compiler()
    done = 0
    with _progress("blocks") as show:

        def progress(more: int) -> None:
            nonlocal done
            done += more
            show(done, blocks)

        report = stress(blocks, seed=seed, progress=progress, workers=os.cpu_count() or 1)
    table = _table(("", ""), left=1)
    table.show_header = False
    for name, value in report.rows():
        table.add_row(name, value)
    _out().print(table)
    if not report.good:
        raise click.exceptions.Exit(1)


def _check_seed(seed: int) -> None:
    if not 0 <= seed < 1 << 32:
        raise ValueError(f"seed is {seed}: choose a whole number from 0 to {(1 << 32) - 1}")


def _check_bits(clocks: int) -> None:
    # Not needed by any other command.
    from discreta.hdl.uart import check_clocks_per_bit

    check_clocks_per_bit(clocks)


def _job(file: str, width: int, kinds: tuple[str, ...], given: dict[str, Any]) -> Any:
    """Give what a file has to be sent, with its speeds."""
    from discreta.send import Job

    program = {name: given.pop(name) for name in _GCODE}
    pictures = {"plotter": None, "screen": None}
    if not is_gcode(file):
        _check_no_gcode(file, program)
        if given["feed"] is None:
            raise BadInputError("a path of support points has no speed: give --feed, like 1/100")
        points = read_points(file, width)
        curve = Polyline(points)
        curve.check(width)
        drive = cast(Drive, _drive(given, pictures))
        device = _exact_device(width, curve.axes, kinds, ["line"])
        return Job(device, device_blocks(device, curve, drive), drive)
    if given["feed"] is not None:
        raise BadInputError("--feed does not go with G-code, the speed is that of F: leave it out")
    moves = _read_program(file, width, program)
    if program["clock"] is None:
        raise BadInputError("G-code has mm a minute: give --clock, that of the board, in MHz")
    feeds = _feeds(file, moves, program)
    drive = cast(Drive, _drive(given | {"feed": max(feeds)}, pictures))
    whole = Program(moves)
    used = sorted({move.kind for move in moves})
    device = _exact_device(width, whole.axes, kinds, used)
    return Job(device, program_blocks(device, whole, drive, feeds), drive)


def _exact_device(width: int, axes: int, kinds: tuple[str, ...], used: list[str]) -> Device:
    """Make a device like the board's, if it can draw what is used."""
    for kind in used:
        if kind not in kinds:
            raise BadInputError(
                f"--kinds {','.join(kinds)}: the path has {kind}s: build the board with them"
            )
    try:
        device = exact_device(width, axes, kinds)
    except ValueError as error:
        raise BadInputError(str(error)) from None
    # It says what blocks are like, and often no hardware is made of it, which Amaranth warns of.
    Fragment.get(device, None)
    return device


@cli.command("send", short_help="Send a path to a board, or to the simulated one.")
@click.argument("port", metavar="PORT")
@click.argument("file", metavar="FILE")
@click.option(
    "--feed",
    type=_Speed(),
    help="CSV: speed along the path: steps per clock of the board, up to 1, a decimal or a "
    "fraction.",
)
@_gcode_options
@_options(*_DRIVE_CHOICES)
@_width
@click.option(
    "--kinds",
    type=_Kinds(),
    default="line,arc",
    show_default=True,
    help="What the board draws, as it was built: of line, arc and conic.",
)
@click.option("--baud", type=click.IntRange(1200), help="Of the port. [default: 115200]")
@click.option(
    "--clear",
    is_flag=True,
    help="Go on where the machine stands still for an emergency, a limit switch or a refused "
    "block.",
)
@click.option(
    "--clocks-per-bit",
    type=_Number("clocks per bit", 4, 65536, _check_bits),
    help="Of the simulated board. [default: 8]",
)
@click.option(
    "--damage",
    type=_Part(),
    help="Of the line to the simulated board: the part of all bytes that arrive as others. "
    "[default: 0]",
)
@click.option(
    "--lose", type=_Part(), help="The part of all frames that do not arrive. [default: 0]"
)
@click.option(
    "--seed", type=_Number("seed", 0, 2**32 - 1, _check_seed), help="Which ones. [default: 0]"
)
@click.option(
    "--plotter",
    metavar="FILE.svg|.png",
    help="Picture of what a machine draws that sees only the simulated board's pins.",
)
@click.option("--json", "summary_file", metavar="FILE|-", help="The summary, as JSON.")
def send_command(
    port: str,
    file: str,
    width: int,
    kinds: tuple[str, ...],
    baud: int | None,
    clear: bool,
    plotter: str | None,
    summary_file: str | None,
    **given: Any,
) -> None:
    """Send a path to a board at a serial port, and wait until it is drawn.

    FILE is G-code, which needs --steps-per-mm and --clock, or a CSV file of support points, which
    needs --feed: as for `discreta simulate path`. The machine is said to stand at its start.

    PORT is a serial port like /dev/ttyUSB0, or sim: for the simulated board: the RTL of the whole
    controller, compiled, behind a pseudo-terminal, with a machine at its pins that sees nothing
    else. Ctrl-C stops the machine down its ramp and tells where it stands. Exits 1 when the machine
    has stopped before the end, the board does not answer, or the simulated machine was not just
    where the golden models are.

    \b
    Example: discreta send sim: examples/bulgaria.csv --feed 1/4 \\
                 --damage 0.01 --lose 0.01 --plotter sent.png
    """
    from discreta.boards.host import LinkError
    from discreta.send import SIMULATED, Simulation, send

    simulated = {name: given.pop(name) for name in ("clocks_per_bit", "damage", "lose", "seed")}
    simulated = {name: value for name, value in simulated.items() if value is not None}
    for name in (*simulated, *(["plotter"] if plotter else [])):
        if port != SIMULATED:
            raise BadInputError(
                f"--{name.replace('_', '-')} is for the simulated board: give {SIMULATED} for the "
                "port, or leave it out"
            )
    if baud is not None and port == SIMULATED:
        raise BadInputError(f"--baud is for a port, and {SIMULATED} is none: leave it out")
    kind = picture_format("--plotter", plotter)
    job = _job(file, width, kinds, given)
    if port == SIMULATED:
        _needs_compiler()
    try:
        with Outputs((file,)) as outputs:
            json_file = outputs.open(summary_file) if summary_file is not None else None
            picture = outputs.place(plotter) if plotter is not None else None
            with _progress("blocks", quiet=False) as show:
                began = time.perf_counter()
                good = True
                if port == SIMULATED:
                    board = Simulation(job, **simulated)
                    try:
                        summary = send(job, board.name, clear=clear, progress=show)
                    finally:
                        board.close()
                    summary |= board.facts(summary)
                    good = board.good
                    if picture is not None:
                        board.pen.draw(picture, kind, f"sent, {width} bits")
                else:
                    speed = {} if baud is None else {"baud": baud}
                    summary = send(job, port, clear=clear, progress=show, **speed)
            if json_file:
                json.dump(summary, json_file, indent=2)
                json_file.write("\n")
    except LinkError as error:
        _complain(str(error))
        raise click.exceptions.Exit(1) from None
    _print_summary(summary, time.perf_counter() - began, err=summary_file == "-")
    if not good or "stopped" in summary:
        raise click.exceptions.Exit(1)


#: nextpnr takes seeds of 32 bits, and calls every one of less than 1 the same.
_MAX_SEED = 2**31 - 1


def _check_placement_seed(seed: int) -> None:
    if not 1 <= seed <= _MAX_SEED:
        raise ValueError(f"seed is {seed}: choose a whole number from 1 to {_MAX_SEED}")


class _BoardName(click.ParamType):
    """The name of a board."""

    name = "BOARD"

    def convert(self, value: Any, param: Any, ctx: Any) -> Board:
        if value not in BOARDS:
            self.fail(f"there is no board {value!r}: choose {' or '.join(BOARDS)}", param, ctx)
        return BOARDS[value]


@cli.command("boards", short_help="The boards there are, and their pins.")
@click.argument("board", type=_BoardName(), required=False)
def boards_command(board: Board | None) -> None:
    """List the boards there are; with BOARD: what each of its pins is for.

    Example: discreta boards icebreaker
    """
    out = _out()
    if board is None:
        table = _table(("board", "is", "draws", "clock"), 3)
        for each in BOARDS.values():
            table.add_row(each.name, each.title, each.draws, f"{each.clock / 1e6:g} MHz")
        out.print(table)
        return
    out.print(f"{board.title}, serial link at {board.baud} baud")
    table = _table(("port", "is", "on the board", "pin of the FPGA", "", "volts"), 5)
    for pin in board.pins:
        table.add_row(*pin.row())
    out.print(table)


@cli.command("build", short_help="Make the bits of a board, checked against its clock.")
@click.argument("board", type=_BoardName())
@click.option(
    "--output",
    metavar="FILE|FOLDER",
    help="The bits, or the folder of a project.  [default: named after the board]",
)
@click.option(
    "--seed",
    type=_Number("seed", 1, _MAX_SEED, _check_placement_seed),
    help="That of the placement.  [default: the first of 1 to 5 that reaches the clock]",
)
@click.option(
    "--normally-closed",
    is_flag=True,
    help="Limit and stop switches open when they act; else they close to ground.",
)
@click.option("--json", "json_file", metavar="FILE|-", help="What is printed, as JSON.")
def build_command(
    board: Board,
    output: str | None,
    seed: int | None,
    normally_closed: bool,
    json_file: str | None,
) -> None:
    """Make the bits of a board: the device, its serial link, and the board's pins.

    Prints the cells that it takes, and how much faster than the board's clock it could run. Exits 1
    when it does not fit or does not reach that clock. The same seed gives the same bits on every
    machine. For arty-a7, which needs Vivado, it writes a project and builds nothing.

    Example: discreta build icebreaker
    """
    if board.fpga not in FPGAS:
        if seed is not None or json_file is not None:
            raise BadInputError(f"{board.name} is not built here: leave out --seed and --json")
        _write_project(board, output or board.name, normally_closed)
        return
    fpga = FPGAS[board.fpga]
    path = output or f"{board.name}.{fpga.tools.bits}"
    done = 0

    def progress() -> None:
        nonlocal done
        done += 1
        show(done, max(done, BUILD_RUNS))

    with Outputs() as outputs, _progress("runs", quiet=json_file == "-") as show:
        place = outputs.place(path)
        file = None if json_file is None else outputs.open(json_file)
        show(0, BUILD_RUNS)
        try:
            check_tools(board.fpga, packs=True)
            top = Top(board, normally_closed=normally_closed)
            made = build(
                top,
                top.ports.values(),
                board.fpga,
                constraints(board, fpga.tools.constraints),
                board.clock / 1e6,
                BUILD_SEEDS if seed is None else (seed,),
                progress=progress,
            )
        except ModuleNotFoundError as error:
            raise BadInputError(
                f"a build needs {error.name}: install the extra, pip install 'discreta[boards]'"
            ) from None
        except SynthesisError as error:
            raise SynthesisError(f"{board.name}: {error}") from None
        place.write_bytes(made.bits)
        summary = {
            "board": board.name,
            "draws": board.draws,
            "seed": made.seed,
            "clock": made.clock,
            "fastest": made.fmax,
            "margin": made.margin,
            "used": made.used,
            "available": made.available,
            "bytes": len(made.bits),
            "sha256": sha256(made.bits).hexdigest(),
        }
        if file is not None:
            json.dump(summary, file, indent=2)
            file.write("\n")
    _print_build(board, path, made, summary["sha256"], err=json_file == "-")


def _print_build(board: Board, path: str, made: Bitstream, digest: str, *, err: bool) -> None:
    """Print what bits take of their board."""
    out = _out(err=err)
    out.print(f"{board.title}: {board.draws}")
    table = _table(("", "used", "there", "%"))
    for what, used in made.used.items():
        there = made.available[what]
        share = f"{100 * used / there:.0f}" if there else "-"
        table.add_row(what, str(used), str(there), share)
    out.print(table)
    out.print(
        f"clock {made.clock:g} MHz, {made.fmax:.2f} reached: margin {made.margin:.0f} %, "
        f"seed {made.seed}"
    )
    out.print(f"{path}: {len(made.bits)} bytes, sha256 {digest}")
    out.print(f"load it: {board.load.format(path)}")


def _write_project(board: Board, folder: str, normally_closed: bool) -> None:
    """Write a project for a board that is not built here."""
    texts = project(board, Top(board, normally_closed=normally_closed))
    fresh = not os.path.lexists(folder)
    Path(folder).mkdir(exist_ok=True)
    try:
        with Outputs() as outputs:
            for name, text in texts.items():
                outputs.open(str(Path(folder, name))).write(text)
    except BaseException:
        if fresh:
            Path(folder).rmdir()
        raise
    click.echo(
        f"{board.title} is not built here: {folder} has a project for Vivado, "
        "vivado -mode batch -source build.tcl"
    )


@cli.command("methods")
def methods_command() -> None:
    """List the methods, with error bound and clocks per step.

    Those marked as default are what `discreta simulate` runs without --method. Where METHOD... may
    be several, exact stands for these three.

    Example: discreta methods
    """
    headings = ("draws", "error bound, steps", "clocks per step of the longest axis")
    table = _table(("method", "", *headings), left=5)
    for method in METHODS.values():
        mark = "default" if method.name in DEFAULTS.values() else ""
        facts = (method.summary, method.error_bound, method.clocks_per_step)
        table.add_row(method.name, mark, *facts)
    _out().print(table)


def main() -> None:
    """Run the command line: exit 0 on success, 1 when a check fails, 2 on bad input."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_DFL:  # else the caller has them ignored
            signal.signal(number, _end)
    # A pool ends its own processes by SIGTERM: there it must stay what it is.
    os.register_at_fork(after_in_child=lambda: signal.signal(signal.SIGTERM, signal.SIG_DFL))
    for stream in (sys.stdout, sys.stderr):
        # An old terminal has no letters such as √ and УУ: any sign will do there.
        cast(TextIOWrapper, stream).reconfigure(errors="replace")
    code = _run()
    try:
        sys.stdout.flush()
    except OSError:
        # It has failed once, and must not fail again at the end of Python.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(code)


def _end(number: int, _: Any) -> NoReturn:
    """End by a signal as by an exception, so that no half file is left."""
    raise SystemExit(128 + number)


def _run(arguments: list[str] | None = None) -> int:
    """Run one command; every failure that is no bug is one line on the standard error."""
    try:
        return cli.main(arguments, prog_name="discreta", standalone_mode=False) or 0
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return 2
    except click.UsageError as error:
        _complain(error.format_message().rstrip(".") + _hint(error))
        return 2
    except BadInputError as error:
        _complain(str(error))
        return 2
    except (click.Abort, KeyboardInterrupt):
        _complain("interrupted, no file is written")
        return 128 + signal.SIGINT
    except subprocess.CalledProcessError as error:
        if error.cmd[0] != compiler():
            raise
        _complain(f"{error.cmd[0]} does not work as a C++ compiler: set CXX to one that does")
        return 2
    except OSError as error:
        name = "" if error.filename is None else f" {error.filename or repr('')}"
        _complain(f"cannot write{name}: {error.strerror}")
        return 2
    except (DeadCoreError, SynthesisError) as error:
        _complain(str(error))
        return 1


def _complain(message: str) -> None:
    click.echo(f"discreta: {' '.join(message.split())}", err=True)


def _hint(error: click.UsageError) -> str:
    """Say where to look, unless the message itself names what to give."""
    named = isinstance(error, click.BadParameter) and not isinstance(error, click.MissingParameter)
    if named or error.ctx is None:
        return ""
    return f": see {error.ctx.command_path} --help"
