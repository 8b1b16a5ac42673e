"""A program of lines and arcs run through the exact cores, or on the whole device, in order.

The lines go through :class:`~discreta.hdl.exact_line.ExactLine`, the arcs through
:class:`~discreta.hdl.exact_arc.ExactArc`; each step is compared with the curve that was programmed,
not with the rounded one. Alone the cores run one behind the other, and clocks are the sum of those
of every move. On the device both have one queue, and F and G0 say the speed of every move.
"""

import csv
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import atan2, ceil, hypot, tau
from pathlib import Path
from typing import Any

import numpy as np

from discreta.hdl.constant_speed import constant_arc
from discreta.hdl.contract import AXIS_LETTERS, Part
from discreta.hdl.device import Device
from discreta.hdl.plain import block_fields
from discreta.sim.constant_speed import paced, plane, ticks_of
from discreta.sim.contour import ArcContour, LineContour
from discreta.sim.feed import ahead, encode_feed
from discreta.sim.gcode import Move, distance_from_arc
from discreta.sim.machine import Drive, Machine, Trail, device_blocks, pace_limit_of, path_of
from discreta.sim.methods import METHODS
from discreta.sim.outputs import Outputs
from discreta.sim.plot import PathPlot, picture_format
from discreta.sim.points import BadInputError
from discreta.sim.run import choose_engine
from discreta.sim.simulate import simulate
from discreta.sim.stretch import EVENT_COLUMNS
from discreta.sim.view import write_view

__all__ = ["CORES", "Cores", "Program", "program_blocks", "run_program", "speeds"]

#: The method of every kind of move.
CORES = {"line": METHODS["exact_line"], "arc": METHODS["exact_arc"]}

#: Clocks of a run beside those of its blocks.
_OVERHEAD = 2

#: Points of an arc in a picture, at most.
_ROUND = 1 << 12


class Program:
    """The moves of a program, as the true curve of a picture and as blocks.

    Parameters
    ----------
    moves : sequence of Move
        One or more; each starts where the one before it ends.
    """

    def __init__(self, moves: Sequence[Move]):
        self.moves = moves
        self.axes = len(moves[0].start)
        self.start = np.array(moves[0].start, dtype=np.int64)

    def which(self, kind: str) -> np.ndarray:
        """Give the numbers of the moves of a kind, in order."""
        return np.array([i for i, move in enumerate(self.moves) if move.kind == kind], dtype=int)

    def blocks(self, kind: str) -> np.ndarray:
        """Give the blocks of the moves of a kind, shape (moves, block fields)."""
        flat = kind == "line" or self.axes == 2
        which = (self.moves[i] for i in self.which(kind))
        rows = [move.block if flat else (*move.start, *move.end, *move.block[4:]) for move in which]
        return np.array(rows, dtype=np.int64).reshape(len(rows), -1)

    def errors(self, number: int, points: np.ndarray) -> np.ndarray:
        """Give how far points, shape (points, axes), are from the curve of a move, in steps."""
        move = self.moves[number]
        if move.true_center is not None:
            return distance_from_arc(move, points[:, :2])
        start, end = np.array(move.true_start), np.array(move.true_end)
        along = end - start
        part = np.clip((points - start) @ along / (along @ along), 0, 1)
        return np.sqrt((((points - start) - part[:, None] * along) ** 2).sum(axis=1))

    def outline(self) -> np.ndarray:
        """Give the programmed curves as one polyline, in steps, fine for a picture."""
        return np.concatenate([_outline(move, _ROUND) for move in self.moves])

    def near(self, point: np.ndarray, reach: float) -> np.ndarray:
        """Give what of the curves may lie near a point, pieces with rows of NaN between."""
        pieces = []
        for move in self.moves:
            points = _outline(move, ceil(move.true_length) + 1)
            if move.true_center is not None:
                points = points[np.hypot(*(points - point[:2]).T) < 2 * reach]
            pieces += [points, np.full((1, 2), np.nan)]
        return np.concatenate(pieces)


def _outline(move: Move, most: int) -> np.ndarray:
    """Give the programmed curve of a move as a polyline in X and Y of up to so many points."""
    ends = np.array([move.true_start[:2], move.true_end[:2]])
    if move.true_center is None:
        return ends
    once = min(move.sweep, tau)
    part = np.linspace(0, 1, max(2, min(most, ceil(_ROUND * once / tau)) + 1))
    (x, y), (u, v) = ends - move.true_center
    angle = atan2(y, x) + (-once if move.clockwise else once) * part
    radius = hypot(x, y) + (hypot(u, v) - hypot(x, y)) * part
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.array(move.true_center) + radius[:, None] * circle


def speeds(moves: Sequence[Move], clock: Fraction, rapid: Fraction | None) -> list[Fraction]:
    """Give the speed of every move along its path, in steps per clock.

    Parameters
    ----------
    moves : sequence of Move
    clock : Fraction
        In Hz.
    rapid : Fraction or None
        Of G0, in mm a minute; None: there must not be any.

    Raises
    ------
    BadInputError
        The device has no such speed, or there is none for G0; with the line.
    """
    found = []
    for move in moves:
        feed = rapid if move.feed is None else move.feed
        if feed is None:
            raise BadInputError(
                f"line {move.line_number} is a rapid: give --rapid, its speed in mm a minute"
            )
        # Where the axes differ in steps a mm, the way of the move says how many it has.
        steps_per_mm = Fraction(move.true_length / move.length)
        speed = feed * steps_per_mm / 60 / clock
        try:
            encode_feed(speed)
        except BadInputError as error:
            raise BadInputError(
                f"line {move.line_number} has {float(feed):g} mm a minute: {error}, or another "
                "--clock"
            ) from None
        found.append(speed)
    return found


@dataclass(frozen=True)
class _Part:
    """The moves of one kind, as a curve for :func:`~discreta.sim.machine.device_blocks`."""

    kind: str
    axes: int
    start: np.ndarray
    blocks: np.ndarray


def program_blocks(
    device: Device, program: Program, drive: Drive, feeds: Sequence[Fraction]
) -> np.ndarray:
    """Give what a device is given for a program, shape (1 + moves, block fields).

    The first block tells it where the machine stands. Every other one has the speed of its move.

    Parameters
    ----------
    device : Device
        With interpolators for all kinds of moves.
    program : Program
    drive : Drive
    feeds : sequence of Fraction
        In steps per clock, by moves.
    """
    fields = list(block_fields(device))
    blocks = np.zeros((1 + len(program.moves), len(fields)), dtype=np.int64)
    paths = np.zeros(len(program.moves))
    for kind in [kind for kind in device.interpolators if len(program.which(kind))]:
        part = _Part(kind, program.axes, program.start, program.blocks(kind))
        made = device_blocks(device, part, drive)
        blocks[0] = made[0]
        blocks[1 + program.which(kind)] = made[1:]
        paths[program.which(kind)] = path_of(device, part)
    # A tick of a helix is a step of arc or of Z, whichever way is longer.
    ticked = [
        feed * Fraction(min(1.0, path / move.true_length)) if move.helical else feed
        for feed, path, move in zip(feeds, paths.tolist(), program.moves, strict=True)
    ]
    encoded = np.array([encode_feed(feed) for feed in ticked])
    blocks[1:, fields.index("blocks_feed_mantissa")] = encoded[:, 0]
    blocks[1:, fields.index("blocks_feed_exponent")] = encoded[:, 1]
    blocks[1:, fields.index("blocks_ahead")] = ahead(paths)
    return blocks


class _ProgramMachine(Machine):
    """A program on a device with the cores of all its kinds."""

    def __init__(
        self,
        program: Program,
        cores: dict[str, Part],
        drive: Drive,
        expected: Trail,
        feeds: Sequence[Fraction],
    ):
        super().__init__(program, cores, drive, expected)
        self._feeds = feeds

    def blocks(self) -> np.ndarray:
        """Give what the device is given."""
        return program_blocks(self.device, self._curve, self._drive, self._feeds)

    @property
    def length(self) -> float:
        """Give the programmed curves' length, in steps."""
        return sum(move.true_length for move in self._curve.moves)


class Cores:
    """The cores of a program, one for each kind of its moves, and what they alone make of it.

    Parameters
    ----------
    program : Program
    width : int
        4 to 32.

    Attributes
    ----------
    kinds : list of str
        Of the moves there are.
    limit : int
        The most clocks that all moves together may take.
    ends_reached : int
        Moves whose end was reached with their last step.
    clocks : int
        Of all moves together.

    Raises
    ------
    BadInputError
        There is no core for a move.
    """

    def __init__(self, program: Program, width: int):
        self._program, self._width = program, width
        self.kinds = [kind for kind in CORES if len(program.which(kind))]
        self._blocks = {kind: program.blocks(kind) for kind in self.kinds}
        self._given = dict(self._blocks)
        if program.axes > 2 and "arc" in self.kinds:
            self._given["arc"] = paced("arc", self._blocks["arc"], width, program.axes)
        self._limits = {kind: self._limit(kind) for kind in self.kinds}
        self.limit = sum(self._limits.values())
        self.ends_reached = self.clocks = 0
        self._steps: dict[str, _Steps] = {}

    def _limit(self, kind: str) -> int:
        method, axes = CORES[kind], self._program.axes
        blocks, ticks = self._blocks[kind], np.zeros(1)
        if kind == "arc" and axes > 2:
            ticks = ticks_of(kind, blocks, axes) + _OVERHEAD
            blocks, axes = plane(blocks, axes), 2
        golden = method.model(self._width, axes)
        return int(np.sum(method.clocks(golden, blocks) + ticks)) + _OVERHEAD

    @cached_property
    def parts(self) -> dict[str, Part]:
        """Make the RTL of every kind."""
        width, axes = self._width, self._program.axes
        return {
            kind: constant_arc(width, axes)
            if kind == "arc" and axes > 2
            else CORES[kind].core(width, axes)
            for kind in self.kinds
        }

    def run(self, engine: str, progress: Callable[[int], object] | None = None) -> None:
        """Run the moves of every kind through their core, every step taken at once.

        ``progress`` is called with the clocks run.
        """
        ran = 0
        for kind, core in self.parts.items():
            blocks, axes, last = self._blocks[kind], self._program.axes, 0
            contour = LineContour(blocks) if kind == "line" else ArcContour(blocks, axes)
            moved, gaps = [], []
            given, limit = self._given[kind], self._limits[kind]
            for stretch in simulate(core, given, limit=limit, engine=engine):
                when, _, _ = contour.follow(stretch)
                taken = stretch.events[:, EVENT_COLUMNS.index("taken")] == 1
                first = len(EVENT_COLUMNS)
                moved.append(stretch.events[taken, first : first + axes].astype(np.int8))
                gaps.append(np.diff(when, prepend=last).astype(np.uint16))
                last = contour.clocks
                ran += stretch.ran
                if progress:
                    progress(ran)
            counts = contour.block_steps.tolist()
            self._steps[kind] = _Steps(np.concatenate(moved), np.concatenate(gaps), counts)
            self.ends_reached += contour.ends_reached
            self.clocks += contour.clocks

    def __iter__(self) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Give number, clocks and points of every move that was run, in the program's order.

        Clocks are counted as if every move began where the one before it ended.
        """
        steps = {kind: iter(part) for kind, part in self._steps.items()}
        clock = 0
        for number, move in enumerate(self._program.moves):
            moved, gaps = next(steps[move.kind])
            points = np.array(move.start) + np.cumsum(moved, axis=0, dtype=np.int64)
            when = clock + np.cumsum(gaps, dtype=np.int64)
            clock = int(when[-1])
            # Some ticks of an arc with a further axis move nothing.
            moves = moved.any(axis=1)
            yield number, when[moves], points[moves]


@dataclass(frozen=True)
class _Steps:
    """The steps of the moves of a kind, a few bytes each: a program may have a great many.

    Attributes
    ----------
    moved : array of int8, shape (steps, axes)
    gaps : array of uint16, shape (steps,)
        Clocks since the step before.
    counts : list of int
        Steps of every move.
    """

    moved: np.ndarray
    gaps: np.ndarray
    counts: list[int]

    def __iter__(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Give the steps of every move, and their gaps."""
        first = 0
        for count in self.counts:
            part = slice(first, first + count)
            yield self.moved[part], self.gaps[part]
            first += count


def run_program(
    program: Program,
    *,
    width: int = 16,
    engine: str | None = None,
    trace: str | None = None,
    vcd: str | None = None,
    plot: str | None = None,
    summary_file: str | None = None,
    reads: Iterable[str] = (),
    drive: Drive | None = None,
    feeds: Sequence[Fraction] = (),
    plotter: str | None = None,
    screen: str | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> dict[str, Any]:
    """Run a program from reset, and give the summary; with ``drive`` on the whole device, too.

    The steps of the device must be those of the cores alone, in the same order.

    Parameters
    ----------
    program : Program
    width, engine, trace, plot, summary_file, reads, plotter, screen, progress
        As in :func:`~discreta.sim.run.run`.
    vcd : str or None
        The waveform of the device.
    drive : Drive or None
        Acceleration and pulses; its speed is that of the fastest move.
    feeds : sequence of Fraction
        With ``drive`` the speed of every move, in steps per clock.

    Raises
    ------
    BadInputError
        What was asked for cannot be done.
    OSError
        A file cannot be written.
    DeadCoreError
        The device does not answer.
    """
    cores = Cores(program, width)
    if vcd is not None and drive is None:
        raise BadInputError("--vcd shows the device: give --clock, too")
    engine = choose_engine(engine, trace=trace, vcd=vcd, summary_file=summary_file)
    kind_of = {
        name: picture_format(f"--{name}", file)
        for name, file in (("plot", plot), ("plotter", plotter), ("screen", screen))
    }

    limit = cores.limit
    pace = 0 if drive is None else _pace_limit(program, drive, feeds, limit)
    trail, picture = Trail(program.start), PathPlot(program)
    with Outputs(reads) as outputs:
        trace_file = outputs.open(trace) if trace is not None else None
        json_file = outputs.open(summary_file) if summary_file is not None else None
        plot_part = outputs.place(plot) if plot is not None else None
        plotter_part = outputs.place(plotter) if plotter is not None else None
        screen_part = outputs.place(screen) if screen is not None else None
        vcd_part = outputs.place(vcd) if vcd is not None else None
        view = outputs.open(str(Path(vcd).with_suffix(".gtkw"))) if vcd is not None else None
        vcd_file = outputs.write(vcd_part) if vcd_part else None
        made = cores.parts
        show = progress or (lambda _done, _total: None)
        show(0, limit + pace)
        cores.run(engine, lambda ran: show(ran, limit + pace))

        rows = csv.writer(trace_file, lineterminator="\n") if trace_file else None
        if rows:
            rows.writerow(["clock", *AXIS_LETTERS[: program.axes]])
            rows.writerow([0, *program.start.tolist()])
        worst = _Worst(tuple(program.start.tolist()))
        for number, when, points in cores:
            errors = program.errors(number, points)
            worst.follow(program.moves[number], points, errors)
            trail.follow(points)
            picture.follow(points, errors)
            if rows and drive is None:
                rows.writerows(np.column_stack([when, points]).tolist())

        machine: Machine | None = None
        if drive is not None:
            machine = _ProgramMachine(program, made, drive, trail, feeds)
            for when, points in machine.run(limit=pace, engine=engine, vcd=vcd_file):
                if rows:
                    rows.writerows(np.column_stack([when, points]).tolist())
                show(limit + machine.clocks, limit + pace)
        title = f"{' and '.join(CORES[kind].name for kind in cores.kinds)}, {width} bits"
        if machine and plotter_part:
            machine.pen.draw(plotter_part, kind_of["plotter"], title)
        if machine and screen_part:
            machine.screen.save(screen_part, kind_of["screen"])
        if machine and vcd and vcd_file and vcd_part and view:
            vcd_file.close()
            write_view(view, vcd_part, Path(vcd).name, machine.device)
        if plot_part:
            picture.save(plot_part, kind_of["plot"], title)
        summary = {
            "methods": ", ".join(CORES[kind].name for kind in cores.kinds),
            "width": width,
            "axes": program.axes,
            "engine": engine,
            "moves": len(program.moves),
            "lines": len(program.which("line")),
            "arcs": len(program.which("arc")),
            "clocks": cores.clocks,
            "steps": trail.moves,
            "clocks per step": round(cores.clocks / trail.moves, 4),
            "largest error": round(worst.error, 4),
            "largest error at": list(worst.at),
            "largest error in line": worst.line,
            **({} if machine is None else machine.facts()),
            "end point reached": cores.ends_reached == len(program.moves)
            and (machine is None or machine.good),
        }
        if json_file:
            json.dump(summary, json_file, indent=2)
            json_file.write("\n")
    return summary


@dataclass
class _Worst:
    """The point that is farthest from what was programmed."""

    at: tuple[int, ...]
    error: float = 0.0
    line: int | None = None

    def follow(self, move: Move, points: np.ndarray, errors: np.ndarray) -> None:
        """Take in the points of a move."""
        if len(errors) and errors.max() > self.error:
            worst = int(np.argmax(errors))
            self.at, self.error = tuple(points[worst].tolist()), float(errors[worst])
            self.line = move.line_number


def _pace_limit(
    program: Program, drive: Drive, feeds: Sequence[Fraction], interpolator_clocks: int
) -> int:
    """Give the most clocks that a program may take on the device."""
    paths = np.zeros(len(program.moves))
    for kind in CORES:
        paths[program.which(kind)] = ticks_of(kind, program.blocks(kind), program.axes)
    given = np.array(feeds, dtype=float)
    pauses = float((paths / given).sum())
    return pace_limit_of(
        float(paths.sum()), pauses, given.max(), len(paths), drive, interpolator_clocks
    )
