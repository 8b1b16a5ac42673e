# amaranth: UnusedElaboratable=no
# (A model that is found in the cache is not built again.)
"""Measurements of speed: along the path, of F itself, and what the methods allow.

All is measured on the RTL; of a whole device on its pins alone. The exercise asks for it: the speed
along the path shall be that which is programmed (section II), and control questions 5 and 6 ask for
the time of a step and the highest speed.
"""

import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from fractions import Fraction
from itertools import repeat
from math import ceil, cos, hypot, pi, radians, sin, sqrt

import numpy as np

from discreta.hdl.circular import Circular
from discreta.hdl.comparison import Comparison
from discreta.hdl.constant_speed import constant_arc
from discreta.hdl.contract import Part
from discreta.hdl.device import Device, exact_device
from discreta.hdl.linear import Linear
from discreta.hdl.plain import block_fields
from discreta.hdl.queue import KINDS, BlockKind
from discreta.sim.carrier import add_timing, lengths
from discreta.sim.compiled import CompiledModel
from discreta.sim.conics import KINDS as CONIC_KINDS
from discreta.sim.conics import random_blocks
from discreta.sim.constant_speed import paced, plane, ticks_of
from discreta.sim.contour import distance_from_circle
from discreta.sim.feed import encode_feed, feed_of
from discreta.sim.machine import Drive
from discreta.sim.methods import METHODS
from discreta.sim.plotter import Plotter
from discreta.sim.simulate import simulate
from discreta.sim.stretch import EVENT_COLUMNS

__all__ = [
    "DEVICE",
    "MOVES",
    "RULES",
    "AccuracyRow",
    "DriftRow",
    "HelixRow",
    "LimitRow",
    "Rule",
    "SpeedRow",
    "accuracy",
    "along_path",
    "drift",
    "helices",
    "limits",
    "move_beginnings",
    "step_clocks",
]

SEED = 1970

#: Moves of a window.
MOVES = 40

#: The speed along the path is measured at this F: slow enough for every interpolator, and the
#: default pauses are whole clocks, so that a window is not a clock longer or shorter by chance.
_SLOW = Fraction(1, 128)

#: How far the machine is at any time is measured at this one.
_STEADY = Fraction(1, 8)

#: Bits of the devices that are measured along the path and at different F.
_PATH_WIDTH, _PACE_WIDTH = 10, 18

#: Clocks in which F is measured at least: one clock more or less is then 2^-18 of it.
_LONG = 1 << 18

#: Mantissas in every octave of F, besides one that is drawn. From this octave on, where a pause
#: takes over 2^20 clocks, that one is the only one; but the slowest speed of all is measured too.
_MANTISSAS, _SLOW_OCTAVE = (0, 0x5555, 0xFFFF), 21
_LAST_OCTAVE = 24

#: Pins can make a step on one axis in two clocks: faster than that two axes have to take turns.
_FASTEST_OF_ONE_AXIS = Fraction(1, 2)

#: Curves of the limits: their size in bits at most, lengths and circles, conics of every kind.
_SIZE_BITS, _LENGTHS, _CIRCLES, _CONICS = 10, 4, 24, 8

#: Clocks that an interpolator takes for a step at most, in the mean; and that stand around a block.
_STEP_CLOCKS, _AROUND = 16, 64

#: What the limits of the whole device are called.
DEVICE = "device"

_PLACE = int(BlockKind.PLACE.value)  # pyright: ignore[reportAttributeAccessIssue]

#: A block of a device: fields and values; those left out are 0.
_Block = dict[str, int]


@dataclass(frozen=True)
class Rule:
    """What pauses a feed unit makes after a step.

    Attributes
    ----------
    title : str
    pauses : tuple of int or None
        See :class:`~discreta.hdl.feed.FeedUnit`.
    pairing : bool
    """

    title: str
    pauses: tuple[int, ...] | None
    pairing: bool


#: The device's default, the exercise's own rule, and the same one with √2.
RULES = (
    Rule("pairing", None, pairing=True),
    Rule("1.4 after a step on both axes", (256, 358), pairing=False),
    Rule("√2 after a step on both axes", None, pairing=False),
)


@dataclass(frozen=True)
class SpeedRow:
    """How far the speed along the path is from F.

    Attributes
    ----------
    what : str
        The curves that were run.
    windows : int
        How many times :data:`MOVES` moves were measured.
    smallest, largest : float
        Deviations from F, in % of it; below 0 it is too slow.
    smallest_at, largest_at : str
        The curve, and where on it this window begins.
    """

    what: str
    windows: int
    smallest: float
    smallest_at: str
    largest: float
    largest_at: str


@dataclass(frozen=True)
class DriftRow:
    """How far a machine is from where a constant speed would have it, along the path.

    Attributes
    ----------
    what : str
        The curves that were run.
    curves : int
        How many.
    ahead, behind : float
        At most, in steps, from the first step to the last.
    at_end : float
        The larger of both, at the end.
    """

    what: str
    curves: int
    ahead: float
    behind: float
    at_end: float


@dataclass(frozen=True)
class HelixRow:
    """What arcs with a further axis do.

    Attributes
    ----------
    steepness : float
        Steps of the further axis for every step of arc, at most.
    helices : int
    ends_missed : int
        Of them were not done on their end point, in all axes.
    off_circle : float
        Largest distance from the circle, in steps; of points from which a step remains.
    off_line : float
        Largest distance of the further axis from where it belongs after so many ticks, in steps.
    off_ticks : float
        Largest difference between ``ticks`` and those there were.
    """

    steepness: float
    helices: int
    ends_missed: int
    off_circle: float
    off_line: float
    off_ticks: float


@dataclass(frozen=True)
class AccuracyRow:
    """How exactly a speed is kept.

    Attributes
    ----------
    octave : int
        F is 2^-octave or more, and less than twice that; of octave 0 only 1.
    speeds : int
        How many were measured.
    largest_error : float
        Of the mean pause from 1/F, in 2^-16 of it.
    clocks : int
        Of the shortest measurement: one clock, which is a matter of luck, is 2^16 / clocks of that.
    """

    octave: int
    speeds: int
    largest_error: float
    clocks: int


@dataclass(frozen=True)
class LimitRow:
    """How long a step takes, and how fast a method can be.

    Every step is taken at once, so that the method alone sets the pace; ``DEVICE`` is a whole
    device at F = 1 with the shortest pulses. A step is a clock in which some axis steps, a diagonal
    one like any other. It is measured from step to step of a block, blocks one at a time.

    Attributes
    ----------
    method : str
        Of :data:`~discreta.sim.methods.METHODS`, with its default settings, or :data:`DEVICE`.
    curve : str
        What was run: ``"line"``, ``"arc"`` or ``"conic"``.
    width : int
        n; no more than the method has.
    per_period : bool
        What it puts out are the steps of a whole carrier period at once: then all that follows is
        of these, and there is no highest speed in steps, as they may be any number.
    steps : int
        How many there were.
    least, mean, most : int, float, int
        Clocks from one step to the next.
    mean_ns, most_ns : float
        The time of a step: in the mean, and of the slowest one.
    mean_speed, kept_speed : float or None
        The highest speed in steps per second: in the mean, and the one that is kept at every step.
    """

    method: str
    curve: str
    width: int
    per_period: bool
    steps: int
    least: int
    mean: float
    most: int
    mean_ns: float
    most_ns: float
    mean_speed: float | None
    kept_speed: float | None


def along_path(
    rule: Rule,
    *,
    degrees: Sequence[int] = range(360),
    radii: Sequence[int] = (100, 200, 400),
    length: int = 200,
) -> list[SpeedRow]:
    """Measure the speed along straight lines and circles, on the pins of a device.

    A move is a step, or two that follow each other and move different axes, as a diagonal in two
    halves. The speed of a window of :data:`MOVES` moves is the way from the place where the first
    one begins to the one where the next window's would, along the line or the circle, by the time
    between these two steps. The first move of a curve is left out: axes may have to turn before it.

    Parameters
    ----------
    rule : Rule
    degrees : sequence of int
        Directions of the lines, 0 to 359.
    radii : sequence of int
        Of the circles, each in both directions; up to 1022 steps.
    length : int
        Of the lines, in steps.

    Returns
    -------
    list of SpeedRow
        Of the lines of every quadrant, and of the circles of every radius.

    Raises
    ------
    RuntimeError
        There is no C++ compiler.
    """
    device = Device(
        line=Linear(_PATH_WIDTH) if degrees else None,
        arc=Circular(_PATH_WIDTH) if radii else None,
        pauses=rule.pauses,
        pairing=rule.pairing,
    )
    curves = [_line(degree, length) for degree in degrees]
    curves += [_circle(radius, clockwise) for radius in radii for clockwise in (False, True)]
    rows: dict[str, SpeedRow] = {}
    for curve, (clocks, points, begins) in zip(curves, _run_all(device, curves), strict=True):
        measured = _windows(curve, clocks, points, begins)
        if measured is None:
            continue
        before = rows.get(curve.group)
        rows[curve.group] = measured if before is None else _joined(before, measured)
    return list(rows.values())


@dataclass(frozen=True)
class _Path:
    """A curve to be run: its block, where it starts, and its radius, if it is a circle."""

    group: str
    title: str
    block: _Block
    start: tuple[int, int]
    radius: int | None = None

    @property
    def way(self) -> float:
        """Its length, in steps."""
        if self.radius is not None:
            return 2 * pi * self.radius
        return hypot(self.block["end_x"], self.block["end_y"])


def _line(degree: int, length: int) -> _Path:
    """Make a line from the origin."""
    quadrant = degree // 90 * 90
    x, y = (round(length * part) for part in (cos(radians(degree)), sin(radians(degree))))
    block = {"kind": KINDS["line"].value, "end_x": x, "end_y": y}
    group = f"lines, {quadrant} to {quadrant + 90} degrees"
    return _Path(group, f"line of {degree} degrees", block, (0, 0))


def _circle(radius: int, clockwise: bool) -> _Path:
    """Make a whole circle about the origin."""
    block = {"kind": KINDS["arc"].value, "end_x": radius, "clockwise": int(clockwise)}
    way = "clockwise" if clockwise else "counter-clockwise"
    return _Path(f"circles, R = {radius}", f"R = {radius}, {way}", block, (radius, 0), radius)


def drift(
    *,
    degrees: Sequence[int] = range(360),
    radii: Sequence[int] = (100, 1000, 4000),
    length: int = 1000,
    width: int = 13,
) -> list[DriftRow]:
    """Measure the distance travelled less F·t, on the pins of a device at constant speed.

    Of lines it is the way along the line, of circles the angle times R. The first step leaves when
    a step's length is due, at F·t = 1. Looked at just before every step, when the machine is
    farthest behind, and at it.

    Parameters
    ----------
    degrees : sequence of int
        Directions of the lines, 0 to 359.
    radii : sequence of int
        Of the circles, each in both directions.
    length : int
        Of the lines, in steps.
    width : int
        n of the device.

    Raises
    ------
    RuntimeError
        There is no C++ compiler.
    """
    device = exact_device(width, kinds=("line", "arc"), depth=1)
    curves = [_line(degree, length) for degree in degrees]
    curves += [_circle(radius, clockwise) for radius in radii for clockwise in (False, True)]
    for curve in curves:
        kind = "line" if curve.radius is None else "arc"
        block = [*curve.start, curve.block["end_x"], curve.block.get("end_y", 0)]
        block += [0, 0, curve.block["clockwise"], 0] if kind == "arc" else []
        curve.block["pace"] = int(paced(kind, np.array([block]), width, 2)[0, -1])
    rows: dict[str, DriftRow] = {}
    measured = _run_all(device, curves, _STEADY)
    for curve, (clocks, points, _) in zip(curves, measured, strict=True):
        way = _way(curve, points)
        before = np.concatenate([[0], way[:-1]])
        due = 1 + float(_STEADY) * (clocks - clocks[0])
        group = curve.group if curve.radius is not None else f"lines of {length} steps"
        row = rows.get(group, DriftRow(group, 0, 0.0, 0.0, 0.0))
        rows[group] = DriftRow(
            group,
            row.curves + 1,
            max(row.ahead, float(np.max(way - due))),
            max(row.behind, float(np.max(due - before))),
            max(row.at_end, float(abs(way[-1] - due[-1]))),
        )
    return list(rows.values())


def _way(curve: _Path, points: np.ndarray) -> np.ndarray:
    """Give how far points are along a line or a circle, in steps."""
    if curve.radius is None:
        end = np.array([curve.block["end_x"], curve.block["end_y"]], dtype=float)
        return points @ (end / np.hypot(*end))
    turned = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    sign = -1 if curve.block["clockwise"] else 1
    return sign * turned * curve.radius


def helices(
    steepnesses: Sequence[float] = (0.1, 1, 5), count: int = 300, *, width: int = 12
) -> list[HelixRow]:
    """Run random arcs with a further axis, and measure all axes at every tick.

    Parameters
    ----------
    steepnesses : sequence of float
        Steps of the further axis for every step of arc, at most; drawn up to that.
    count : int
        Helices of each.
    width : int
        n; radii are up to 2^(n − 2).

    Raises
    ------
    RuntimeError
        There is no C++ compiler.
    """
    random = np.random.default_rng([SEED, width])
    core = constant_arc(width, 3)
    model = CompiledModel(core)
    rows = []
    try:
        for steepness in steepnesses:
            blocks = _random_helices(random, count, steepness, width)
            rows.append(_helix_row(model, blocks, steepness, width))
    finally:
        model.close()
    return rows


def _random_helices(
    random: np.random.Generator, count: int, steepness: float, width: int
) -> np.ndarray:
    """Draw arcs about the origin, both ends rounded, and a way of a third axis."""
    blocks = np.zeros((count, 10), dtype=np.int64)
    radius = np.exp(random.uniform(np.log(8), np.log(1 << (width - 2)), count))
    for column in (0, 3):
        angle = random.uniform(0, 2 * pi, count)
        points = radius * [np.cos(angle), np.sin(angle)]
        blocks[:, column : column + 2] = np.rint(points).T
    blocks[:, 8] = random.integers(0, 2, count)
    length = ticks_of("arc", blocks, 3)
    top = (1 << width) - 1
    way = np.rint(random.uniform(-1, 1, count) * steepness * length)
    blocks[:, 2] = random.integers(-top // 4, top // 4, count)
    blocks[:, 5] = np.clip(blocks[:, 2] + way, -top, top)
    return blocks


def _helix_row(model: CompiledModel, blocks: np.ndarray, steepness: float, width: int) -> HelixRow:
    """Run helices one by one from reset."""
    missed, off_circle, off_line, off_ticks = 0, 0.0, 0.0, 0.0
    told = paced("arc", blocks, width, 3)
    for block, row in zip(blocks, told, strict=True):
        model.reset()
        room = 4 * int(row[-1]) + _AROUND
        seen = model.run(row[None], room, until_answered=1, event_room=room)
        column = dict(zip(EVENT_COLUMNS, seen.events.T, strict=False))
        taken = column["taken"] == 1
        moves = seen.events[taken, len(EVENT_COLUMNS) : len(EVENT_COLUMNS) + 3]
        points = block[:3] + np.cumsum(moves, axis=0)
        ticks = len(points)
        bad = seen.answered != 1 or column["error"].any() or not ticks
        if bad or not np.array_equal(points[-1], block[3:6]):
            missed += 1
            continue
        off_ticks = max(off_ticks, abs(ticks - int(row[-1])))
        on_line = block[2] + (block[5] - block[2]) * np.arange(1, ticks + 1) / int(row[-1])
        off_line = max(off_line, float(np.max(np.abs(points[:-1, 2] - on_line[:-1]), initial=0)))
        start = np.broadcast_to(plane(block[None], 3)[0, :2], points[:-1, :2].shape)
        away = distance_from_circle(points[:-1, :2], start)
        off_circle = max(off_circle, float(np.max(away, initial=0)))
    return HelixRow(steepness, len(blocks), missed, off_circle, off_line, off_ticks)


def _run_all(
    device: Device, curves: Sequence[_Path], feed: Fraction = _SLOW
) -> Iterable[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Run curves in one go; give for each clocks and points of its steps, and where moves begin.

    The points are those after the steps; the step number ``begins[k]`` is the first of a move.
    """
    mantissa, exponent = encode_feed(feed)
    blocks = []
    for curve in curves:
        x, y = curve.start
        blocks.append({"kind": _PLACE, "end_x": x, "end_y": y})
        blocks.append({**curve.block, "feed_mantissa": mantissa, "feed_exponent": exponent})
    limit = _most_clocks(sum(curve.way for curve in curves), feed, len(blocks))
    clocks, points, answers = _run_on_pins(device, blocks, limit)
    begins = move_beginnings(np.diff(points, axis=0, prepend=0))
    # A place is answered when the pulses before it are over, and before the next ones.
    splits = np.searchsorted(clocks, answers[2::2])
    firsts, lasts = np.append(0, splits), np.append(splits, len(clocks))
    for curve, first, last in zip(curves, firsts, lasts, strict=True):
        # The plotter does not see that the machine is said to stand somewhere else.
        shift = curve.start - (points[first - 1] if first else np.zeros(2, dtype=np.int64))
        own = begins[(begins >= first) & (begins < last)] - first
        yield clocks[first:last], points[first:last] + shift, own


def _most_clocks(way: float, feed: Fraction, blocks: int) -> int:
    """Give clocks that must do for blocks of a length in all: twice the octagon's path."""
    return ceil(2 * sqrt(2) * way * max(1 / feed, _STEP_CLOCKS)) + _AROUND * blocks


def _run_on_pins(
    device: Device, blocks: Sequence[_Block], limit: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run blocks; give clocks and points of the steps as the pins show them, and of the answers."""
    drive = Drive()
    names = block_fields(device)
    rows = np.array(
        [[block.get(name.removeprefix("blocks_"), 0) for name in names] for block in blocks],
        dtype=np.int64,
    )
    plotter = Plotter((0, 0), drive.timing)
    answers = []
    for stretch in simulate(device, rows, limit=limit, engine="compiled", controls=drive.controls):
        column = dict(zip(EVENT_COLUMNS, stretch.events.T, strict=False))
        changed = column["taken"] == 1
        plotter.follow(column["clock"][changed], stretch.events[changed, len(EVENT_COLUMNS) :])
        answers.append(column["clock"][column["done"] == 1])
    assert not plotter.violation_count
    return *plotter.moves, np.concatenate(answers)


def move_beginnings(steps: np.ndarray) -> np.ndarray:
    """Give the numbers of the steps that begin a move, of steps of shape (steps, axes).

    A step belongs to the move before it if that has not moved one of its axes yet.
    """
    begins = []
    moved = np.ones(steps.shape[1], dtype=bool)
    for number, moves in enumerate(steps != 0):
        if np.any(moved & moves):
            begins.append(number)
            moved = moves
        else:
            moved = moved | moves
    return np.array(begins, dtype=np.int64)


def _windows(
    path: _Path, clocks: np.ndarray, points: np.ndarray, begins: np.ndarray
) -> SpeedRow | None:
    """Measure all windows of a path; None if it has none."""
    first, last = begins[1:-MOVES], begins[1 + MOVES :]
    if not len(last):
        return None
    # A step leads from the point before it.
    low, high = points[first - 1], points[last - 1]
    way = np.hypot(*(high - low).T)
    if path.radius is not None:
        way = 2 * path.radius * np.arcsin(way / (2 * path.radius))
    deviations = 100 * (way / (clocks[last] - clocks[first]) / float(_SLOW) - 1)
    worst = [int(find(deviations)) for find in (np.argmin, np.argmax)]
    where = [f"{path.title}, from ({low[k][0]}, {low[k][1]})" for k in worst]
    smallest, largest = (float(deviations[k]) for k in worst)
    return SpeedRow(path.group, len(deviations), smallest, where[0], largest, where[1])


def _joined(one: SpeedRow, other: SpeedRow) -> SpeedRow:
    """Join the rows of two curves of the same group."""
    low = min(one, other, key=lambda row: row.smallest)
    high = max(one, other, key=lambda row: row.largest)
    return SpeedRow(
        one.what,
        one.windows + other.windows,
        low.smallest,
        low.smallest_at,
        high.largest,
        high.largest_at,
    )


def accuracy(*, octaves: Iterable[int] = range(_LAST_OCTAVE + 1)) -> list[AccuracyRow]:
    """Measure the mean pause between the steps of a straight line, at all speeds F there are.

    On the pins, for F up to ½ along x, on a device with the default pauses. A pin needs two clocks
    for a pulse: for higher F on a line under 45 degrees, whose steps are on x and y in turns, and
    without pairing, so that each of them is followed by a whole pause. The interpolator is the
    comparison, which has a step ready in every clock.

    Of every octave the first and the last speed and two more are measured, from octave 21 on only
    one, and the slowest speed of all: over 2^18 clocks or one pause, whichever is longer. A step
    leaves at a whole clock: so the mean of many pauses is known to one clock in all. On both cores.

    Parameters
    ----------
    octaves : iterable of int
        Of 0 to 24.

    Raises
    ------
    RuntimeError
        There is no C++ compiler.
    """
    speeds = [(octave, mantissa) for octave in octaves for mantissa in _mantissas(octave)]
    # The longest ones first, so that no core is left with one of them at the end.
    speeds.sort(key=lambda speed: feed_of(speed[1], speed[0]))
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        try:
            # Compiled here, found in the cache by every measurement.
            turns = {_takes_turns(feed_of(m, octave)) for octave, m in speeds}
            list(pool.map(_compile_pace, turns))
            measured = list(pool.map(_measure_pace, speeds))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    rows: dict[int, list[tuple[float, int]]] = {}
    for (octave, _), result in zip(speeds, measured, strict=True):
        rows.setdefault(octave, []).append(result)
    return [
        AccuracyRow(
            octave,
            len(results),
            max(error for error, _ in results),
            min(clocks for _, clocks in results),
        )
        for octave, results in sorted(rows.items())
    ]


def _mantissas(octave: int) -> tuple[int, ...]:
    """Choose which speeds of an octave are measured."""
    if octave == 0:
        return (0,)
    drawn = int(np.random.default_rng([SEED, octave]).integers(1 << 16))
    if octave < _SLOW_OCTAVE:
        return (*_MANTISSAS, drawn)
    return (0, drawn) if octave == _LAST_OCTAVE else (drawn,)


def _takes_turns(feed: Fraction) -> bool:
    return feed > _FASTEST_OF_ONE_AXIS


def _pace_device(takes_turns: bool) -> Device:
    return Device(line=Comparison(_PACE_WIDTH), depth=1, pairing=not takes_turns)


def _compile_pace(takes_turns: bool) -> None:
    CompiledModel(_pace_device(takes_turns)).close()


def _measure_pace(speed: tuple[int, int]) -> tuple[float, int]:
    """Give the error of a speed, octave and mantissa, in 2^-16, and the clocks it was seen in."""
    octave, mantissa = speed
    feed = feed_of(mantissa, octave)
    turns = _takes_turns(feed)
    pauses = max(1, ceil(_LONG * feed))
    # Of two axes as many steps each.
    pauses += turns and 1 - pauses % 2
    x, y = ((pauses + 1) // 2, (pauses + 1) // 2) if turns else (pauses + 1, 0)
    block = {"kind": KINDS["line"].value, "end_x": x, "end_y": y}
    block |= {"feed_mantissa": mantissa, "feed_exponent": octave}
    limit = ceil(2 * pauses / feed) + _AROUND
    clocks, points, _ = _run_on_pins(_pace_device(turns), [block], limit)
    assert len(clocks) == pauses + 1
    assert tuple(points[-1]) == (x, y)
    ran = int(clocks[-1] - clocks[0])
    return float(abs(ran * feed / pauses - 1) * (1 << 16)), ran


def limits(
    width: int, clock_hz: float, *, methods: Sequence[str] = (*METHODS, DEVICE)
) -> list[LimitRow]:
    """Measure how long a step takes and how fast every method can be, at a clock of ``clock_hz``.

    Lines in every direction of 15 degrees, of several lengths; whole circles from as many places,
    in both directions; conics of all kinds: all of them up to 2^10 steps, drawn from the seed. On a
    carrier the same with the shortest period that the device has, and F = 1. On both cores.

    Parameters
    ----------
    width : int
        n, 4 to 32.
    clock_hz : float
    methods : sequence of str
        Which are measured.

    Raises
    ------
    ValueError
        The clock is not above 0.
    RuntimeError
        There is no C++ compiler.
    """
    if not clock_hz > 0:
        raise ValueError(f"clock_hz is {clock_hz!r}: choose a frequency above 0")
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        try:
            found = list(pool.map(_limits_of, methods, repeat(width)))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    rows = []
    for name, kinds in zip(methods, found, strict=True):
        for kind, clocks in kinds.items():
            method = METHODS.get(name)
            per_period = method is not None and method.per_period
            mean, most = float(clocks.mean()), int(clocks.max())
            rows.append(
                LimitRow(
                    name,
                    kind,
                    width if method is None else min(width, method.max_width),
                    per_period,
                    len(clocks),
                    int(clocks.min()),
                    mean,
                    most,
                    1e9 * mean / clock_hz,
                    1e9 * most / clock_hz,
                    None if per_period else clock_hz / mean,
                    None if per_period else clock_hz / most,
                )
            )
    return rows


def _limits_of(name: str, width: int) -> dict[str, np.ndarray]:
    """Give the clocks between all steps of a method, by the kind of its curves."""
    if name == DEVICE:
        device = exact_device(width)
        return {
            kind: _device_clocks(device, kind, _sample(kind, width)) for kind in ("line", "arc")
        }
    method = METHODS[name]
    width = min(width, method.max_width)
    choices = method.settings["default"]
    core, golden = method.core(width, **choices), method.model(width, **choices)
    blocks = _sample(method.curve, width)
    if method.timed:
        blocks = add_timing(method.curve, blocks, Fraction(1), golden.least_period)
        blocks = blocks.astype(np.int64)
    return {method.curve: step_clocks(core, blocks, method.clocks(golden, blocks))}


def _sample(kind: str, width: int) -> np.ndarray:
    """Draw blocks of a kind, shape (blocks, block fields)."""
    bits = min(width, _SIZE_BITS)
    random = np.random.default_rng([SEED, width])
    if kind == "conic":
        drawn = [random_blocks(kind, bits, _CONICS, random) for kind in CONIC_KINDS]
        return np.concatenate(drawn)
    count = 24 * _LENGTHS if kind == "line" else _CIRCLES
    # The device's axes may rise to R + 1, and rounding adds to R.
    size = random.uniform(1 << (bits - 1), (1 << bits) - 3, count)
    angles = np.radians(15 * np.arange(count))
    points = np.rint(size * [np.cos(angles), np.sin(angles)]).T.astype(np.int64)
    if kind == "line":
        return np.concatenate([np.zeros_like(points), points], axis=1)
    blocks = np.zeros((count, 8), dtype=np.int64)
    blocks[:, :2] = blocks[:, 2:4] = points
    blocks[:, 6] = np.arange(count) % 2
    return blocks


def step_clocks(core: Part, blocks: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Give the clocks from step to step of an interpolator whose steps are taken at once.

    Parameters
    ----------
    core : Part
        The interpolator.
    blocks : array of int64, shape (blocks, block fields)
        Run one at a time, each from reset on.
    most : array of int, shape (blocks,)
        Clocks that each may take.
    """
    model = CompiledModel(core)
    found = []
    try:
        for block, limit in zip(blocks, most.tolist(), strict=True):
            model.reset()
            room = limit + _AROUND
            stretch = model.run(block[None], room, until_answered=1, event_room=room)
            events = dict(zip(EVENT_COLUMNS, stretch.events.T, strict=False))
            assert stretch.answered == 1
            assert not events["error"].any()
            found.append(np.diff(events["clock"][events["taken"] == 1]))
    finally:
        model.close()
    return np.concatenate(found)


def _device_clocks(device: Device, kind: str, blocks: np.ndarray) -> np.ndarray:
    """Give the same of a device at F = 1, from its pins."""
    rows: list[_Block] = []
    for block in blocks.tolist():
        (x, y), (end_x, end_y) = block[:2], block[2:4]
        rows.append({"kind": _PLACE, "end_x": x, "end_y": y})
        rows.append({"kind": KINDS[kind].value, "end_x": end_x, "end_y": end_y})
        if kind == "arc":
            own = ("center_x", "center_y", "clockwise")
            rows[-1] |= dict(zip(own, block[4:7], strict=True))
    way = float(lengths(kind, blocks).sum())
    clocks, _, answers = _run_on_pins(device, rows, _most_clocks(way, Fraction(1), len(rows)))
    parts = np.split(clocks, np.searchsorted(clocks, answers[2::2]))
    return np.concatenate([np.diff(part) for part in parts])
