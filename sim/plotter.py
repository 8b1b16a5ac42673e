"""A virtual plotter: it sees nothing but the pins, and moves, judges and draws by them.

It stands where the drives of a machine would: every active edge of a step pin moves its axis, and
what a drive could miss, or take for something else, is noted.

Source: exercise 3, section III, where the computer is the machine too, and draws a point on its
screen, 320 × 200 in four colours, instead of a move.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from discreta.hdl.contract import AXIS_LETTERS, check_axes, check_choice

__all__ = ["KINDS", "PALETTE", "Pen", "Plotter", "PulseTiming", "Screen"]

#: What the two pins of an axis are: step and direction, or a and b, a quarter of a turn apart.
KINDS = ("step_direction", "quadrature")

#: Broken rules that are kept in words; all are counted.
_KEPT = 100

#: The time of what has never happened; it and any clock are less than 2^63 apart.
_NEVER = -(1 << 62)

#: Broken rules of one axis: the clocks, the values, and the words for them.
_Broken = tuple[np.ndarray, np.ndarray, str]


@dataclass(frozen=True)
class PulseTiming:
    """What the pulse unit is programmed with, in clocks: what a drive asks for.

    Attributes
    ----------
    length : int
        A pulse lasts as long at least; 0 is as 1.
    space : int
        So long the pin is inactive before the next pulse, at least; 0 is as 1.
    setup : int
        So long the direction has been as it is when a pulse begins, at least; 0 is as 1.
    hold : int
        So long it stays behind the end of a pulse, at least.

    Raises
    ------
    TypeError, ValueError
        One is no whole number, or less than 0.
    """

    length: int = 1
    space: int = 1
    setup: int = 1
    hold: int = 1

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, int) or isinstance(value, bool):
                raise TypeError(f"pulse {field.name} must be a whole number from 0, not {value!r}")
            if value < 0:
                raise ValueError(f"pulse {field.name} is {value}: choose a whole number from 0")


class _StepDirectionAxis:
    """One axis with a step pin and a direction pin, both as active levels."""

    def __init__(self, timing: PulseTiming):
        self._length, self._space = max(1, timing.length), max(1, timing.space)
        self._setup, self._hold = max(1, timing.setup), timing.hold
        self._step = self._direction = False
        #: When the step pin last changed, when a pulse last ended, when the direction last changed.
        self._edge = self._ended = self._turned = _NEVER

    def follow(
        self, clocks: np.ndarray, step: np.ndarray, direction: np.ndarray
    ) -> tuple[np.ndarray, list[_Broken]]:
        """Give what every change moves, −1, 0 or +1, and which rules it breaks."""
        before = np.concatenate([[self._step], step[:-1]])
        turns = np.flatnonzero(direction != np.concatenate([[self._direction], direction[:-1]]))
        edges = np.flatnonzero(step != before)
        leads = step[edges]
        leading, trailing = edges[leads], edges[~leads]

        # An edge ends what the one before it has begun, a pulse or a space.
        lasted = np.diff(clocks[edges], prepend=self._edge)
        turned = np.concatenate([[self._turned], clocks[turns]])
        ended = np.concatenate([[self._ended], clocks[trailing]])
        stood = clocks[leading] - turned[np.searchsorted(turns, leading, side="right")]
        held = clocks[turns] - ended[np.searchsorted(trailing, turns, side="right")]
        inside = before[turns] & step[turns]

        broken = [
            _less(clocks[trailing], lasted[~leads], self._length, "pulse length"),
            _less(clocks[leading], lasted[leads], self._space, "space between pulses"),
            _less(clocks[leading], stood, self._setup, "direction set-up"),
            _less(clocks[turns[~inside]], held[~inside], self._hold, "direction hold"),
            (
                clocks[turns[inside]],
                np.ones(np.count_nonzero(inside), dtype=np.int64),
                "direction changes during a pulse {}, at most 0",
            ),
        ]
        moves = np.zeros(len(clocks), dtype=np.int64)
        moves[leading] = np.where(direction[leading], -1, 1)

        self._step, self._direction = bool(step[-1]), bool(direction[-1])
        self._turned, self._ended = int(turned[-1]), int(ended[-1])
        if len(edges):
            self._edge = int(clocks[edges[-1]])
        return moves, broken

    def out_since(self) -> int | None:
        """Give the clock in which the pulse began that is still out, if there is one."""
        return self._edge if self._step else None


class _QuadratureAxis:
    """One axis with pins a and b, both as active levels: 00, 10, 11, 01 counts up."""

    def __init__(self, timing: PulseTiming):
        self._apart = max(1, timing.length) + max(1, timing.space)
        self._phase = 0
        #: When a pin last changed.
        self._changed = _NEVER

    def follow(
        self, clocks: np.ndarray, a: np.ndarray, b: np.ndarray
    ) -> tuple[np.ndarray, list[_Broken]]:
        """Give what every change moves, −1, 0 or +1, and which rules it breaks."""
        phase = 2 * b.astype(np.int64) + (a ^ b)
        turned = np.diff(phase, prepend=self._phase) % 4
        changes = np.flatnonzero(turned)
        both = clocks[turned == 2]
        times = clocks[changes]
        broken = [
            _less(times, np.diff(times, prepend=self._changed), self._apart, "quadrature spacing"),
            (
                both,
                np.full(len(both), 2, dtype=np.int64),
                "quadrature pins that change at once {}, at most 1",
            ),
        ]
        self._phase = int(phase[-1])
        if len(times):
            self._changed = int(times[-1])
        return np.array([0, 1, 0, -1])[turned], broken

    def out_since(self) -> int | None:
        """Give None: a quadrature signal has no pulse that could be out."""
        return None


def _less(clocks: np.ndarray, values: np.ndarray, limit: int, what: str) -> _Broken:
    """Find the values below a limit."""
    below = values < limit
    return clocks[below], values[below], f"{what} {{}}, at least {limit}"


class Plotter:
    """The virtual machine: it counts pulses, knows where it stands, and judges the pins.

    A pulse moves its axis at its leading edge: up with the direction pin at 0, down at 1 (before
    inversion). Pulses of several axes that begin in the same clock are one move. In quadrature
    every change of one of a, b is a pulse: (a, b) = 00, 10, 11, 01 counts up. If both change in a
    clock the way is not known: nothing moves, the step is lost.

    The rules of :class:`PulseTiming` are judged by the edges of the pins alone. A change of
    direction in the clock of a leading edge has a set-up of 0, one in the clock of a trailing edge
    a hold of 0. In quadrature there is one rule of time: changes of an axis are ``length + space``
    clocks apart, each of them 1 at least.

    Parameters
    ----------
    start : sequence of int
        Where it stands at first, one coordinate for each of 2 to 6 axes, in steps.
    timing : PulseTiming
    kind : str
        One of :data:`KINDS`.
    inverted_steps, inverted_directions : str
        Letters of the axes whose step pin, or direction pin, is active low. In quadrature: whose a,
        or b.
    keep_moves : bool
        False: :attr:`moves` stays empty, so that a run may be of any length; :meth:`follow` gives
        them.

    Attributes
    ----------
    position : array of int64, shape (axes,)
        Where it stands, in steps.
    low, high : arrays of int64, shape (axes,)
        Corners of all it has seen of the plane, the start too, in steps.
    pulses : array of int64, shape (axes,)
        Pulses of every axis.
    violations : list of str
        The first 100 broken rules, in order of clock and axis: clock, axis, rule, value and limit.
    violation_count : int
        All broken rules.
    unfinished : list of str
        Pulses still out when the books were closed; how long they were to be cannot be said.

    Raises
    ------
    ValueError, TypeError
        The kind, the number of axes or the inverted pins are not possible.
    """

    def __init__(
        self,
        start: Sequence[int] | np.ndarray,
        timing: PulseTiming,
        *,
        kind: str = "step_direction",
        inverted_steps: str = "",
        inverted_directions: str = "",
        keep_moves: bool = True,
    ):
        check_choice("kind of pins", kind, KINDS)
        check_axes(len(start))
        self.axes = len(start)
        self.start = np.array(start, dtype=np.int64)
        self.position, self.low, self.high = (self.start.copy() for _ in range(3))
        self.pulses = np.zeros(self.axes, dtype=np.int64)
        self.violations: list[str] = []
        self.violation_count = 0
        self.unfinished: list[str] = []
        self._letters = AXIS_LETTERS[: self.axes]
        inverted = [
            self._check_inverted("steps", inverted_steps),
            self._check_inverted("directions", inverted_directions),
        ]
        #: The level of every pin that is inactive, in the order of the pins.
        self._idle = np.array([[a in pins for pins in inverted] for a in self._letters]).ravel()
        axis = _StepDirectionAxis if kind == "step_direction" else _QuadratureAxis
        self._watched = [axis(timing) for _ in self._letters]
        self._clock = _NEVER
        self._keep_moves = keep_moves
        self._moves = [(np.empty(0, dtype=np.int64), np.empty((0, self.axes), dtype=np.int64))]

    def _check_inverted(self, what: str, letters: str) -> str:
        if set(letters) - set(self._letters) or len(set(letters)) < len(letters):
            axes = self._letters
            raise ValueError(
                f"inverted {what} are {letters!r}: choose letters of {axes!r}, each once"
            )
        return letters

    @property
    def moves(self) -> tuple[np.ndarray, np.ndarray]:
        """Every move: its clock, shape (moves,), and where it led, in steps, (moves, axes)."""
        when, points = (np.concatenate(parts) for parts in zip(*self._moves, strict=True))
        self._moves = [(when, points)]
        return when, points

    def follow(self, clocks: np.ndarray, pins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Take in changes of the pins; what was before is known from the calls before.

        Before the first one all pins are inactive, and have been for ever.

        Parameters
        ----------
        clocks : array of int64, shape (changes,)
            When some pin changed, rising from call to call.
        pins : array of 0 and 1, shape (changes, 2 × axes)
            Levels from then on: step and direction, or a and b, of x, then of y, and so on.

        Returns
        -------
        tuple of arrays
            These changes' part of :attr:`moves`.

        Raises
        ------
        ValueError
            The shapes do not fit, the clocks do not rise, or a level is neither 0 nor 1.
        """
        clocks, pins = np.asarray(clocks), np.asarray(pins)
        if clocks.ndim != 1 or pins.shape != (len(clocks), 2 * self.axes):
            raise ValueError(
                f"pins have the shape {pins.shape}, clocks {clocks.shape}: give every clock"
                f" {2 * self.axes} levels"
            )
        if not len(clocks):
            return np.empty(0, dtype=np.int64), np.empty((0, self.axes), dtype=np.int64)
        clocks = clocks.astype(np.int64)
        if clocks[0] <= self._clock or np.any(clocks[1:] <= clocks[:-1]):
            raise ValueError("the clocks of changes must rise: give every clock once, in order")
        levels = np.ascontiguousarray(pins.T)
        if np.any((levels != 0) & (levels != 1)):
            raise ValueError("a level of a pin must be 0 or 1")
        active = levels.astype(bool) ^ self._idle[:, None]

        seen = [
            axis.follow(clocks, *active[2 * k : 2 * k + 2]) for k, axis in enumerate(self._watched)
        ]
        self._clock = int(clocks[-1])
        self._note([broken for _, broken in seen])

        steps = np.stack([moves for moves, _ in seen])
        self.pulses += np.count_nonzero(steps, axis=1)
        moving = np.any(steps != 0, axis=0)
        when = clocks[moving]
        points = self.position + np.cumsum(steps[:, moving].T, axis=0)
        if len(points):
            self.position = points[-1].copy()
            self.low = np.minimum(self.low, points.min(axis=0))
            self.high = np.maximum(self.high, points.max(axis=0))
            if self._keep_moves:
                self._moves.append((when, points))
        return when, points

    def _note(self, broken: list[list[_Broken]]) -> None:
        """Count broken rules, given by axis, and put the first ones in words."""
        rows = [
            np.stack([clocks, *(np.full(len(clocks), k) for k in (axis, rule)), values], axis=1)
            for axis, rules in enumerate(broken)
            for rule, (clocks, values, _) in enumerate(rules)
        ]
        found = np.concatenate(rows)
        self.violation_count += len(found)
        room = _KEPT - len(self.violations)
        if room and len(found):
            order = np.lexsort(found[:, 2::-1].T)[:room]
            for clock, axis, rule, value in found[order].tolist():
                words = broken[axis][rule][2].format(value)
                self.violations.append(f"clock {clock}, axis {self._letters[axis]}: {words}")

    def finish(self, clock: int) -> None:
        """Close the books: ``clock`` is the first one that was not seen.

        Raises
        ------
        ValueError
            A change in that clock or behind it was taken in.
        """
        if clock <= self._clock:
            raise ValueError(f"the end is clock {clock}: choose one behind the last change")
        for letter, axis in zip(self._letters, self._watched, strict=True):
            since = axis.out_since()
            if since is not None:
                self.unfinished.append(
                    f"clock {since}, axis {letter}: pulse still out after {clock - since}"
                )


#: Vertices above which a line loses those that no eye misses, and above which it loses others too.
_VERTICES, _MOST = 20_000, 100_000

#: Vertices that are gathered before they are thinned out.
_BATCH = 1 << 17

#: A vertex this part of the picture's longer side off the line is not seen: half a pixel or less.
_SEEN = 1 / 2000

#: Of so many vertices one is kept in any case, so that thinning out takes as many rounds at most.
_SPAN = 64

#: Letters of a title in the common size; of longer ones they are smaller.
_TITLE = 72


def _thinned(points: np.ndarray, tolerance: float) -> np.ndarray:
    """Leave out vertices that are up to ``tolerance`` off the line through those that stay.

    Every span of the line that strays farther from its chord is split where it does so most, until
    none does (Ramer, 1972; Douglas and Peucker, 1973), all spans in one round.
    """
    kept = np.zeros(len(points), dtype=bool)
    kept[::_SPAN] = kept[-1] = True
    index = np.arange(len(points) - 1)
    while True:
        ends = np.flatnonzero(kept)
        if len(ends) == 1:
            return points[ends]
        span = np.searchsorted(ends, index, side="right") - 1
        first = points[ends[:-1]]
        chord = (points[ends[1:]] - first).astype(float)
        squares = np.maximum(np.sum(chord * chord, axis=1), 1)
        ahead = points[:-1] - first[span]
        along = np.clip(np.sum(ahead * chord[span], axis=1) / squares[span], 0, 1)
        off = np.hypot(*(ahead - along[:, None] * chord[span]).T)
        farthest = np.maximum.reduceat(off, ends[:-1])
        worst = np.flatnonzero((off == farthest[span]) & (off > tolerance))
        if not len(worst):
            return points[kept]
        # Of several that are as far off, the first.
        kept[worst[np.unique(span[worst], return_index=True)[1]]] = True


def _bounded(line: np.ndarray, tolerance: float) -> tuple[np.ndarray, float]:
    """Leave out more and more vertices, up to twice as far off in every round, until few stay."""
    while len(line) > _MOST:
        tolerance *= 2
        line = _thinned(line, tolerance)
    return line, tolerance


class Pen:
    """Draws what the pen does: all moves as one line from the start.

    The first two axes are drawn. Runs of equal moves are one stroke. A line of more than 20,000
    vertices loses those that cannot be seen, less than a pixel off; one that still has more than
    100,000 loses more.

    Parameters
    ----------
    start : sequence of int
        Where the pen stands at first, in steps.
    """

    def __init__(self, start: Sequence[int] | np.ndarray):
        self._axes = len(start)
        self._last = np.array(start, dtype=np.int64)[:2]
        self._move = np.zeros(2, dtype=np.int64)
        #: Vertices that were thinned out, and those still to be; the last point is not among them.
        self._line = self._new = np.empty((0, 2), dtype=np.int64)
        #: Their corners, and how far off those were that had to go.
        self._low = self._high = self._last
        self._off = 0.0

    def follow(self, points: np.ndarray) -> None:
        """Take in points, shape (moves, axes), in steps; the moves lead from one to the next."""
        path = np.concatenate([self._last[None], points[:, :2]])
        moves = np.diff(path, axis=0)
        moved = np.any(moves != 0, axis=1)
        moves, origins = moves[moved], path[:-1][moved]
        if not len(moves):
            return
        turns = np.any(moves != np.concatenate([self._move[None], moves[:-1]]), axis=1)
        self._last, self._move = path[-1], moves[-1]
        self._new = np.concatenate([self._new, origins[turns]])
        while len(self._new) >= _BATCH:
            batch, self._new = np.split(self._new, [_BATCH])
            self._low = np.minimum(self._low, batch.min(axis=0))
            self._high = np.maximum(self._high, batch.max(axis=0))
            off = max(self._off, float(np.max(self._high - self._low)) * _SEEN)
            line = np.concatenate([self._line, _thinned(batch, off)])
            self._line, self._off = _bounded(line, off)

    def vertices(self) -> np.ndarray:
        """Give the line as it is drawn, shape (vertices, 2), in steps."""
        line = np.concatenate([self._line, self._new, self._last[None]])
        if len(line) > _VERTICES:
            off = max(self._off, float(np.max(np.ptp(line, axis=0))) * _SEEN)
            line, _ = _bounded(_thinned(line, off), off)
        return line

    def draw(self, path: Path, kind: str, title: str) -> None:
        """Write the picture; ``kind`` is ``png`` or ``svg``, or one of them behind a dot."""
        # Not needed, and half the start, of a command that draws nothing.
        from matplotlib import style
        from matplotlib.figure import Figure

        kind = _format(kind)
        if self._axes > 2:
            title += f"; x and y of {AXIS_LETTERS[: self._axes]}"
        line = self.vertices()
        # The same path gives the same bytes: no one's own settings, no date, no random names.
        own = {"svg.hashsalt": "discreta", "svg.fonttype": "none", "font.size": 9}
        with style.context(["default", own]):
            figure = Figure(figsize=(9, 6.5), dpi=110, layout="constrained")
            axes = figure.subplots()
            axes.plot(*line.T, color="#222222", lw=0.7, label="pen", gid="pen")
            axes.plot(*line[0], "o", color="#2ca02c", ms=8, label="start", gid="start")
            axes.plot(*line[-1], "s", color="#c0392b", ms=4, label="end", gid="end")
            axes.set_aspect("equal", adjustable="datalim")
            axes.set(title=title, xlabel="x, steps", ylabel="y, steps")
            axes.title.set_fontsize(10.8 * min(1, _TITLE / max(1, len(title))))
            axes.locator_params(integer=True)
            axes.ticklabel_format(useOffset=False, style="plain")
            axes.grid(alpha=0.3)
            handles = axes.get_lines()
            figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
            metadata = {"Date": None} if kind == "svg" else {"Software": None}
            figure.savefig(path, format=kind, metadata=metadata)


def _format(kind: str) -> str:
    check_choice("kind of picture", kind.removeprefix("."), ("png", "svg"))
    return kind.removeprefix(".")


#: The four colours of mode 5 of INT 10H, red, green and blue: black, cyan, red, white.
PALETTE = ((0, 0, 0), (85, 255, 255), (255, 85, 85), (255, 255, 255))

#: The side of one of the screen's pixels in a picture.
_ZOOM = 3


class Screen:
    """The exercise's own machine: a screen of 320 × 200 pixels in four colours.

    A step is a pixel if the path fits, and else a pixel is the smallest whole number of steps with
    which it does. The pixels of an axis are counted from coordinate 0 if the path fits so, thus
    0 … 319 and 0 … 199 are left as they are; else from the lowest coordinate. y goes upwards, as in
    every picture here; the exercise's own screen counts it downwards and shows this upside down.

    Parameters
    ----------
    start : sequence of int
        Where the path starts, in steps: plotted in colour 3, as the exercise draws a point before
        it moves. The first two axes are drawn.
    low, high : sequences of int
        Corners of all that will be plotted, the start too, in steps.

    Attributes
    ----------
    scale : int
        Steps a pixel.
    pixels : array of uint8, shape (200, 320)
        Numbers of colours in :data:`PALETTE`, row by row from the top.
    """

    #: Pixels in a row and rows.
    SIZE = (320, 200)

    def __init__(
        self,
        start: Sequence[int] | np.ndarray,
        low: Sequence[int] | np.ndarray,
        high: Sequence[int] | np.ndarray,
    ):
        low, high, size = (np.array(part[:2], dtype=np.int64) for part in (low, high, self.SIZE))
        self._low, self._high = low, high
        self.scale = int(np.max((high - low) // size)) + 1
        as_it_is = (low >= 0) & (high // self.scale < size)
        self._origin = np.where(as_it_is, 0, low)
        self.pixels = np.zeros(self.SIZE[::-1], dtype=np.uint8)
        self.plot(np.array(start, dtype=np.int64)[None])

    def plot(self, points: np.ndarray, colour: int = 3) -> None:
        """Draw points, shape (points, axes), in steps.

        Raises
        ------
        ValueError
            A point is not between the corners, or there is no such colour.
        """
        check_choice("colour", str(colour), tuple(map(str, range(len(PALETTE)))))
        points = points[:, :2]
        outside = np.flatnonzero(np.any((points < self._low) | (points > self._high), axis=1))
        if len(outside):
            point, low, high = (
                tuple(part.tolist()) for part in (points[outside[0]], self._low, self._high)
            )
            raise ValueError(
                f"point {point} is not on the screen: give corners beyond {low}, {high}"
            )
        x, y = (points - self._origin).T // self.scale
        self.pixels[self.SIZE[1] - 1 - y, x] = colour

    def save(self, path: Path, kind: str) -> None:
        """Write the screen; ``kind`` is ``png`` or ``svg``, or one of them behind a dot.

        Every pixel is a square of 3 × 3, so that the picture has 960 × 600.
        """
        if _format(kind) == "svg":
            path.write_text(self._svg(), encoding="utf-8")
            return
        # Not needed by a command that draws nothing.
        from PIL import Image

        image = Image.fromarray(self.pixels.repeat(_ZOOM, axis=0).repeat(_ZOOM, axis=1))
        # A picture of numbers becomes one of the palette's colours.
        image.putpalette([part for colour in PALETTE for part in colour])
        image.save(path, format="png")

    def _svg(self) -> str:
        """Give one shape for every colour: the runs of its pixels in every row."""
        width, height = self.SIZE
        shapes = []
        for colour, parts in enumerate(PALETTE[1:], 1):
            edges = np.diff((self.pixels == colour).astype(np.int8), prepend=0, append=0, axis=1)
            rows, firsts = np.nonzero(edges == 1)
            lengths = np.nonzero(edges == -1)[1] - firsts
            runs = zip(firsts.tolist(), rows.tolist(), lengths.tolist(), strict=True)
            shape = "".join(f"M{x} {y}h{run}v1h-{run}z" for x, y, run in runs)
            if shape:
                shapes.append(f'<path fill="{_hex(parts)}" d="{shape}"/>\n')
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{_ZOOM * width}"'
            f' height="{_ZOOM * height}" viewBox="0 0 {width} {height}"'
            ' shape-rendering="crispEdges">\n'
            f'<rect width="{width}" height="{height}" fill="{_hex(PALETTE[0])}"/>\n'
            f"{''.join(shapes)}</svg>\n"
        )


def _hex(parts: tuple[int, int, int]) -> str:
    return "#" + bytes(parts).hex()
