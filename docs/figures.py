"""Draws the pictures of the documentation: ``python docs/figures.py [NAME]...``, from the root.

The pictures are committed, so that the pages show without building anything. The same version of
schemdraw gives the same bytes on every machine: text stays text, and no font is measured.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import click
import schemdraw
from amaranth.sim import Simulator
from schemdraw.backends import svg
from schemdraw.elements import Element
from schemdraw.logic import TimingDiagram
from schemdraw.segments import Segment, SegmentCircle, SegmentPoly, SegmentText

from discreta.boards.catalogue import BOARDS
from discreta.hdl.circular import Circular
from discreta.hdl.conic import Conic
from discreta.hdl.contract import Part
from discreta.hdl.linear import Linear
from discreta.sim.interpreted import CLOCK_PERIOD

__all__ = [
    "FIGURES",
    "TIMINGS",
    "Lane",
    "Sheet",
    "Timing",
    "board_wiring",
    "circular_blocks",
    "circular_turn",
    "conic_blocks",
    "conic_turn",
    "draw",
    "linear_blocks",
    "linear_carry",
    "main",
]

FONT = "Arial, Helvetica, Liberation Sans, DejaVu Sans, sans-serif"
INK, CONTROL, QUIET, PAPER = "#1b1f24", "#1a56b0", "#57606a", "#ffffff"
REGISTER_FILL, LOGIC_FILL, CONTROL_FILL, SHADE = "#e3eefc", "#f3f3ef", "#fff1cc", "#fff1cc"
#: What a picture is about.
EYE = "#c2410c"
NAME_SIZE, TEXT_SIZE = 12, 10
LINE = 1.2

XY = tuple[float, float]
Align = Literal["left", "center", "right"]
Run = dict[str, list[int]]
#: A place in a timing diagram: a lane and a moment of it, in clocks.
Spot = tuple[str, float]


class Sheet(Element):
    """White paper with boxes, wires and words at given places; a unit is half an inch.

    An area is given by its left, bottom, right and top.

    The paper is drawn, not left to the page: the lines are dark, and the page may be too.
    """

    def __init__(self, *area: float):
        super().__init__()
        self._rectangle(area, PAPER, PAPER, zorder=-1)

    def _rectangle(self, area, color, fill, zorder):
        left, bottom, right, top = area
        corners = [(left, bottom), (left, top), (right, top), (right, bottom)]
        self.segments.append(
            SegmentPoly(corners, color=color, fill=fill, lw=1.3, joinstyle="miter", zorder=zorder)
        )

    def words(
        self, at: XY, words: str, align: Align = "left", color: str = INK, size: float = TEXT_SIZE
    ) -> None:
        """Write one line, with its left end, center or right end ``at`` the place."""
        self.segments.append(
            SegmentText(at, words, align=(align, "center"), color=color, fontsize=size)
        )

    def box(
        self, *area: float, fill: str, name: str, words: str = "", middle: float | None = None
    ) -> None:
        """Draw a box with a name and smaller lines of ``words`` under it, around its ``middle``."""
        left, bottom, right, top = area
        self._rectangle(area, INK, fill, zorder=1)
        lines = words.splitlines()
        x = (left + right) / 2 if middle is None else middle
        y = (bottom + top) / 2 + 0.19 * len(lines)
        self.words((x, y), name, "center", size=NAME_SIZE)
        for number, line in enumerate(lines, 1):
            self.words((x, y - 0.38 * number), line, "center")

    def wire(self, *path: XY, color: str = INK, weight: float = LINE) -> None:
        """Draw an arrow along ``path``, whose last line goes up, down or sideways."""
        (x0, y0), (x, y) = path[-2:]
        dx, dy = (x > x0) - (x < x0), (y > y0) - (y < y0)
        # The library's own heads stop short of the point they show.
        scale = (weight / LINE) ** 0.5
        base = (x - 0.2 * scale * dx, y - 0.2 * scale * dy)
        head = [
            (base[0] + half * dy, base[1] + half * dx) for half in (0.08 * scale, -0.08 * scale)
        ]
        self.segments += [
            Segment([*path[:-1], base], color=color, lw=weight, joinstyle="miter", zorder=2),
            SegmentPoly([(x, y), *head], color=color, fill=color, lw=0.1, zorder=2),
        ]

    def gap(self, *path: XY, weight: float) -> None:
        """Leave the paper free along ``path``, so that the wire that follows crosses over."""
        self.segments.append(Segment(list(path), color=PAPER, lw=weight, zorder=2))

    def dot(self, at: XY, color: str = INK) -> None:
        """Show that the wires that meet here are joined."""
        self.segments.append(SegmentCircle(at, 0.07, color=color, fill=color, lw=0.1, zorder=2))

    def signal(self, *path: XY, words: str = "", at: XY = (0, 0), align: Align = "left") -> None:
        """Draw a wire of the control unit, with its name."""
        self.wire(*path, color=CONTROL)
        self.words(at, words, align, color=CONTROL)

    def block(self, edge: float, top: float, *fields: str) -> None:
        """Draw the stream of blocks with its ``fields``, from ``top`` down, into the input."""
        self.words((0.1, top + 0.7), "blocks", color=QUIET)
        for row, what in enumerate((*fields, "valid", "ready")):
            y = top - 0.7 * row
            ends = (0.1, y), (edge, y)
            self.wire(*(reversed(ends) if what == "ready" else ends))
            self.words((0.1, y + 0.22), what)

    def summator(
        self,
        axis: str,
        counter: str,
        left: float,
        y: float,
        outer: float,
        edge: float,
        carry: str = "carry",
    ) -> None:
        """Draw the summator of an axis, its counter ``outer`` of it, its carry to the output."""
        side = 1 if outer > y else -1
        self.box(
            *(left, y - 0.6, left + 1.5, y + 0.6),
            fill=REGISTER_FILL,
            name=f"S{axis}",
            words="summator",
        )
        self.box(
            *(left + 2.0, outer - 0.6, left + 3.3, outer + 0.6),
            fill=REGISTER_FILL,
            name=counter,
            words=f"KO{axis}",
        )
        # The carry is a step, and one less to go; none to go stops the summator.
        self.wire((left + 1.5, y), (edge, y))
        self.words((left + 1.6, y - 0.25 * side), carry)
        self.dot((left + 2.65, y))
        self.wire((left + 2.65, y), (left + 2.65, outer - 0.6 * side))
        self.words((left + 2.75, outer - 0.95 * side), "−1")
        zero, x = outer - 0.3 * side, left + 1.15
        self.wire((left + 2.0, zero), (x, zero), (x, y + 0.6 * side))
        self.words((x - 0.1, zero), "0: stop", "right")

    def position(self, start: XY, edge: float, boxes: Iterable[tuple[str, str]], y: float) -> None:
        """Draw the coordinates, x at ``y``, counted by the output and loaded from ``start``."""
        corner = edge + 0.5
        self.wire(start, (corner, start[1]), (corner, y - 1.9), (edge + 1.2, y - 1.9))
        self.words((start[0] + 0.1, start[1] + 0.22), "XH, YH")
        self.dot((corner, y + 0.3))
        self.wire((corner, y + 0.3), (edge + 1.2, y + 0.3))
        self.words((edge + 2.7, y + 0.4), "position", color=QUIET)
        for row, ((name, words), coordinate) in enumerate(zip(boxes, ("XT", "YT"), strict=True)):
            at = y - 2.2 * row
            area = (edge + 1.2, at - 0.6, edge + 2.5, at + 0.6)
            self.box(*area, fill=REGISTER_FILL, name=name, words=words)
            self.wire((edge, at - 0.3), (edge + 1.2, at - 0.3))
            self.words((edge + 0.58, at - 0.53), "±1")
            self.wire((edge + 2.5, at), (edge + 3.1, at))
            self.words((edge + 3.2, at), coordinate)
            top = (edge + 1.85, at + 0.6)
            self.load(top, 1)

    def load(self, at: XY, side: int, words: str = "load", align: Align = "left") -> None:
        """Draw a signal that comes to a register from above (``side`` 1) or below (−1)."""
        x, y = at
        label = (x + (0.1 if align == "left" else -0.1), y + 0.35 * side)
        self.signal((x, y + 0.5 * side), at, words=words, at=label, align=align)

    def answers(self, edge: float, top: float) -> None:
        """Draw what the control unit has to do with the world, from ``top`` down."""
        self.signal((edge + 1.1, top), (edge, top), words="steps: ready", at=(edge + 1.2, top))
        for row, words in enumerate(("steps: last", "busy", "done (край)", "error"), 1):
            y = top - 0.45 * row
            self.signal((edge, y), (edge + 1.1, y), words=words, at=(edge + 1.2, y))


def linear_blocks() -> Iterable[Element]:
    """Draw the block diagram of the linear interpolator, after the lecture's."""
    s = Sheet(-0.1, -2.5, 20.5, 10.5)
    s.box(
        *(2.4, 1.3, 4.6, 10.1),
        fill=LOGIC_FILL,
        name="Input",
        words="processing\n\n|end − start|\nand the signs;\none block\nahead",
    )
    s.box(
        *(5.45, 3.0, 7.45, 6.8),
        fill=LOGIC_FILL,
        name="Normalizer",
        words="(optional)\n\n× 2ˢ,\nthe same s\nfor both",
    )
    s.box(
        *(14.4, 1.3, 16.5, 8.5),
        fill=LOGIC_FILL,
        name="Output",
        words="processing\n\nputs in the\nsigns; holds\na step until\nit is taken",
    )
    s.box(
        *(2.4, -2.2, 16.5, 0.2),
        fill=CONTROL_FILL,
        name="УУ",
        words="control unit\n\n"
        "start (старт) takes the prepared block, load puts it into the registers",
    )

    # The axes mirror each other.
    for axis, number, y, outer, side in (("X", 1, 6.0, 7.9, 1), ("Y", 2, 3.8, 1.9, -1)):
        p1 = f"P{number}"
        s.box(8.0, y - 0.6, 9.2, y + 0.6, fill=REGISTER_FILL, name=p1, words=f"Δ{axis} · 2ˢ")
        s.summator(axis, f"P{number + 4}", 10.1, y, outer, 14.4)
        # The increment: through the normalizer to the summator, and past it to the counter.
        s.wire((4.6, y), (5.45, y))
        s.words((4.7, y - 0.25 * side), f"Δ{axis}")
        s.dot((5.05, y))
        s.wire((5.05, y), (5.05, outer + 0.3 * side), (12.1, outer + 0.3 * side))
        s.wire((7.45, y), (8.0, y))
        s.wire((9.2, y + 0.25 * side), (10.1, y + 0.25 * side))

    # In and out: the block, the steps, the coordinates.
    s.block(2.4, 6.8, "start XH, YH", "end XK, YK")
    s.wire((4.6, 9.3), (15.9, 9.3), (15.9, 8.5))
    s.words((4.7, 9.08), "signs")
    s.position((4.6, 9.8), 16.5, (("P3", "XT"), ("P4", "YT")), 7.4)
    s.wire((16.5, 3.4), (17.6, 3.4))
    s.words((17.7, 3.4), "steps: x, y, valid")

    # The control unit.
    for x, y, side in (
        *((8.6, 6.6, 1), (10.4, 6.6, 1), (12.75, 8.5, 1), (15.0, 8.5, 1)),
        *((8.6, 3.2, -1), (10.4, 3.2, -1), (12.3, 1.3, -1)),
    ):
        s.load((x, y), side)
    s.signal((2.8, 0.2), (2.8, 1.3), words="start, idle", at=(2.9, 0.75))
    s.signal((4.4, 1.3), (4.4, 0.2), words="pending, fault, empty", at=(4.5, 0.75))
    s.signal((9.65, 0.2), (9.65, 5.75), (10.1, 5.75), words="clock", at=(9.75, 0.75))
    s.dot((9.65, 4.05), CONTROL)
    s.signal((9.65, 4.05), (10.1, 4.05))
    s.signal((13.2, 1.3), (13.2, 0.2))
    s.signal((13.4, 7.9), (13.9, 7.9), (13.9, 0.2), words="ending", at=(14.0, 0.75))
    s.signal((15.1, 1.3), (15.1, 0.2), words="waiting", at=(15.2, 0.75))
    s.signal((16.3, 0.2), (16.3, 1.3), words="clock, taken", at=(16.4, 0.75))
    s.answers(16.5, -0.1)
    return [s]


def circular_blocks() -> Iterable[Element]:
    """Draw the block diagram of the circular interpolator, after the lecture's."""
    s = Sheet(-0.1, -4.6, 22.0, 11.2)
    s.box(
        *(3.0, 0.1, 5.2, 10.7),
        fill=LOGIC_FILL,
        name="Input",
        words="processing\n\nseen from the\ncentre: mirrors\na clockwise arc,\n"
        "turns its start\nto quadrant I;\none block\nahead",
    )
    s.box(
        *(0.0, 0.1, 2.5, 4.3),
        fill=LOGIC_FILL,
        name="Radius meter",
        words="\nS = XH² + YH²,\n⌊2√S⌋\n\nend off by more\nthan a step?\n\n"
        "bit by bit,\n2n + 4 clocks",
    )
    s.wire((3.0, 3.2), (2.5, 3.2))
    s.wire((2.5, 1.2), (3.0, 1.2))
    s.box(
        *(7.9, 2.2, 9.8, 7.2),
        fill=LOGIC_FILL,
        name="Normalizer",
        words="(optional)\n\n× 2ˢ,\nthe same s\nfor both,\nevery clock",
    )
    s.box(
        *(16.2, 0.1, 18.3, 9.3),
        fill=LOGIC_FILL,
        name="Output",
        words="processing\n\nturns back,\nputs in the\nsigns; holds\na step until\nit is taken",
    )

    # The axes mirror each other, but for where the carry leads.
    rows = (("X", 1, 6.4, 8.7, 1, "−1"), ("Y", 2, 3.0, 0.7, -1, "+1"))
    for axis, number, y, outer, side, count in rows:
        area = (6.0, y - 0.6, 7.3, y + 0.6)
        s.box(*area, fill=REGISTER_FILL, name=f"P{number}", words=f"{axis} now")
        s.summator(axis, f"P{number + 2}", 12.0, y, outer, 16.2)
        s.wire((5.2, y), (6.0, y))
        s.words((5.3, y - 0.25 * side), axis)
        s.wire((5.2, outer + 0.3 * side), (14.0, outer + 0.3 * side))
        s.words((5.3, outer + 0.52 * side), f"steps of {axis} left")
        back = y + 1.15 * side
        s.dot((14.65, back))
        s.wire((14.65, back), (6.65, back), (6.65, y + 0.6 * side))
        s.words((6.75, y + 0.88 * side), count)
        s.load((6.3, y - 0.6 * side), -side, "load, turn")
        s.load((12.3, y - 0.6 * side), -side, "clock, load, turn")

    # Each coordinate moves the other.
    s.wire((7.3, 6.4), (7.9, 6.4), color=EYE, weight=3)
    s.wire((7.3, 3.0), (7.9, 3.0), color=EYE, weight=3)
    falling = ((9.8, 6.4), (10.1, 6.4), (11.4, 3.0), (12.0, 3.0))
    rising = ((9.8, 3.0), (10.1, 3.0), (11.4, 6.4), (12.0, 6.4))
    s.wire(*falling, color=EYE, weight=3)
    s.gap((10.6, 4.31), (10.9, 5.09), weight=8)
    s.wire(*rising, color=EYE, weight=3)
    s.words((11.95, 6.75), "Y · 2ˢ", "right", EYE)
    s.words((11.95, 2.65), "X · 2ˢ", "right", EYE)
    s.words((13.45, 4.92), "x′ = −k·y,  y′ = k·x", "center", EYE, NAME_SIZE)
    s.words((13.45, 4.48), "alternated: SY adds the new X", "center", QUIET)

    # In and out: the block, the steps, the coordinates.
    fields = "start XH, YH", "end XK, YK", "center", "clockwise", "full_turns"
    s.block(3.0, 9.7, *fields)
    s.wire((5.2, 9.9), (17.9, 9.9), (17.9, 9.3))
    s.words((5.3, 9.68), "directions")
    s.position((5.2, 10.4), 18.3, (("XT", ""), ("YT", "")), 7.2)
    s.wire((18.3, 2.6), (19.4, 2.6))
    s.words((19.5, 2.6), "steps: x, y, valid")

    # The control unit, and what it does at an axis.
    s.box(
        *(3.0, -4.3, 18.3, -0.9),
        fill=CONTROL_FILL,
        name="УУ",
        words="control unit\n\nstart (старт) takes the\nprepared block, load puts\n"
        "it into the registers",
        middle=5.3,
    )
    s.box(7.7, -2.5, 10.3, -1.2, fill=REGISTER_FILL, name="turns", words="axis crossings\nto come")
    s.box(7.7, -4.0, 10.3, -2.7, fill=REGISTER_FILL, name="swap", words="X is the\nmachine’s y")
    s.box(10.6, -4.1, 18.0, -1.1, fill=PAPER, name="")
    s.words((14.3, -1.38), "turn", "center", size=NAME_SIZE)
    s.words((14.3, -1.76), "of the frame by 90°, when P3 = 0 and turns > 0", "center")
    for row, pair in enumerate(
        (
            ("P1 ← P2", "SX ← ~SY"),
            ("P2 ← 0", "SY ← SX"),
            ("turns ← turns − 1", "swap ← ~swap"),
            ("P3 ← P2, at last |P2 − XK|", "P4 ← ⌊R⌋ + 1, at last YK"),
        )
    ):
        for x, words in zip((10.85, 14.7), pair, strict=True):
            s.words((x, -2.35 - 0.45 * row), words)
    s.load((14.3, 9.3), 1, "load, turn")
    s.load((14.2, 0.1), -1, "load, turn", "right")
    s.load((16.5, 9.3), 1, "load, turn")
    s.signal((3.3, -0.9), (3.3, 0.1), words="start", at=(3.4, -0.4))
    s.signal(
        (4.4, 0.1),
        (4.4, -0.9),
        words="pending, fault, empty;  turns, swap, XK, YK, ⌊R⌋ + 1",
        at=(4.5, -0.4),
    )
    s.signal((15.0, 0.1), (15.0, -0.9))
    s.signal(
        (15.3, 8.7),
        (15.75, 8.7),
        (15.75, -0.9),
        words="0, ending",
        at=(14.85, -0.68),
        align="right",
    )
    s.signal((16.5, 0.1), (16.5, -0.9), words="waiting", at=(16.6, -0.4))
    s.signal((18.0, -0.9), (18.0, 0.1), words="clock, taken, swap", at=(18.1, -0.4))
    s.answers(18.3, -1.3)
    return [s]


def conic_blocks() -> Iterable[Element]:
    """Draw the block diagram of the interpolator of second-order curves, after the lecture's."""
    s = Sheet(-0.1, -4.6, 22.6, 11.2)
    s.box(
        *(5.6, 4.95, 8.0, 7.6),
        fill=REGISTER_FILL,
        name="GX",
        words="scale converter\n2A·x + B·y + D\n\na step: ±2A, ±B",
    )
    s.box(
        *(5.6, 1.8, 8.0, 4.45),
        fill=REGISTER_FILL,
        name="GY",
        words="scale converter\nB·x + 2C·y + E\n\na step: ±B, ±2C",
    )
    s.box(
        *(8.5, 2.2, 10.4, 7.2),
        fill=LOGIC_FILL,
        name="Normalizer",
        words="× 2ˢ,\nthe same s\nfor GX, GY,\n2A, B, 2C,\nevery clock",
    )
    s.box(
        *(16.8, 0.1, 18.9, 9.3),
        fill=LOGIC_FILL,
        name="Output",
        words="processing\n\nputs in the\nsigns; holds\na step until\nit is taken",
    )
    s.box(3.0, 8.5, 4.6, 10.1, fill=REGISTER_FILL, name="A … E", words="coefficients")
    rows = (("X", "1", 6.4, 8.7, 1), ("Y", "2", 3.0, 0.7, -1))
    for axis, number, y, outer, side in rows:
        s.box(
            3.0, y - 0.6, 4.6, y + 0.6, fill=REGISTER_FILL, name=f"P{number}", words=f"{axis} now"
        )
        counter = f"P{int(number) + 2}"
        s.summator(axis, counter, 12.6, y, outer, 16.8, "carry, borrow")
        s.wire((4.6, y), (5.6, y))
        # The steps count the coordinate and move both derivatives.
        back = y + 1.53 * side
        s.dot((15.25, back))
        s.wire((15.25, back), (3.8, back), (3.8, y + 0.6 * side))
        s.words((3.9, y + 0.95 * side), "±1")
        s.dot((6.8, back))
        s.wire((6.8, back), (6.8, y + 1.2 * side))
        s.words((8.3, back + 0.22 * side), "each step goes to both")
        s.load((3.3, y - 0.6 * side), -side)
        s.load((12.9, y - 0.6 * side), -side, "clock, load")
    # Each point goes to both converters, bit by bit, while the block is prepared.
    for y, other in ((6.4, 3.8), (3.0, 5.6)):
        s.dot((5.1, y))
        s.wire((5.1, y), (5.1, other), (5.6, other))
    s.wire((4.6, 9.7), (7.6, 9.7), (7.6, 7.6))
    s.words((4.7, 9.92), "P, Q, R of both converters")

    # Each derivative moves the other axis.
    s.wire((8.0, 6.4), (8.5, 6.4), color=EYE, weight=3)
    s.wire((8.0, 3.0), (8.5, 3.0), color=EYE, weight=3)
    falling = ((10.4, 6.4), (10.7, 6.4), (12.0, 3.0), (12.6, 3.0))
    rising = ((10.4, 3.0), (10.7, 3.0), (12.0, 6.4), (12.6, 6.4))
    s.wire(*falling, color=EYE, weight=3)
    s.gap((11.2, 4.31), (11.5, 5.09), weight=8)
    s.wire(*rising, color=EYE, weight=3)
    s.words((12.5, 6.75), "−GY · 2ˢ", "right", EYE)
    s.words((12.5, 2.65), "GX · 2ˢ", "right", EYE)
    s.words((14.3, 4.92), "x′ = −k·GY,  y′ = k·GX", "center", EYE, NAME_SIZE)
    s.words((14.3, 4.48), "the axis that speeds up first", "center", QUIET)

    # In and out: the block, the steps, the coordinates.
    s.box(2.1, 2.4, 2.4, 10.9, fill=LOGIC_FILL, name="")
    s.block(2.1, 9.7, "A, B, C, D, E", "start XH, YH", "end XK, YK", "clockwise", "turns")
    for y in (9.7, 6.4, 3.0):
        s.wire((2.4, y), (3.0, y))
    s.position((2.4, 10.5), 18.9, (("XT", ""), ("YT", "")), 7.2)
    s.wire((18.9, 2.6), (20.0, 2.6))
    s.words((20.1, 2.6), "steps: x, y, valid")

    # The control unit, and what it does at a change of direction.
    s.box(
        *(3.0, -4.3, 18.9, -0.9),
        fill=CONTROL_FILL,
        name="УУ",
        words="control unit\n\nprepares a block in\nn + 4 clocks, in the\nregisters it runs in",
        middle=5.3,
    )
    s.box(
        *(7.7, -2.5, 10.6, -1.2),
        fill=REGISTER_FILL,
        name="turns",
        words="changes of direction\nto come",
    )
    s.box(7.7, -4.0, 10.6, -2.7, fill=REGISTER_FILL, name="XK, YK", words="the end")
    s.box(10.9, -4.1, 18.6, -1.1, fill=PAPER, name="")
    s.words((14.75, -1.38), "turn", "center", size=NAME_SIZE)
    s.words((14.75, -1.76), "of the slower axis, when it stands still and turns > 0", "center")
    for row, words in enumerate(
        (
            "its direction ← ~direction, turns ← turns − 1",
            "P3, P4 ← room to the edge of the coordinates,",
            "at last |XK − P1|, |YK − P2|",
        )
    ):
        s.words((11.2, -2.45 - 0.5 * row), words)
    s.load((14.9, 9.3), 1, "load, turn")
    s.load((14.8, 0.1), -1, "load, turn", "right")
    s.load((17.1, 9.3), 1, "load, turn")
    s.wire((2.25, 2.4), (2.25, -2.6), (3.0, -2.6))
    s.words((2.35, 0.0), "XK, YK, clockwise, turns")
    s.signal(
        (15.9, 8.7),
        (16.35, 8.7),
        (16.35, -0.9),
        words="0, ending",
        at=(15.45, -0.68),
        align="right",
    )
    s.signal((15.6, 0.1), (15.6, -0.9))
    s.signal((17.1, 0.1), (17.1, -0.9), words="waiting", at=(17.2, -0.4))
    s.signal((18.6, -0.9), (18.6, 0.1), words="clock, taken", at=(18.7, -0.4))
    s.answers(18.9, -1.3)
    return [s]


def board_wiring() -> Iterable[Element]:
    """Yield the wires from an iCEBreaker to drivers, motors and switches."""
    board = BOARDS["icebreaker"]
    labels = {pin.port: pin.label for pin in board.pins}
    sheet = Sheet(-2.6, -0.7, 17.4, 12.3)
    edge, bus = 6.6, 10.4

    def line(*path: XY) -> None:
        sheet.segments.append(Segment(list(path), color=INK, lw=LINE, zorder=2))

    def pin(y: float, label: str, port: str = "") -> None:
        sheet.words((edge - 0.15, y), label, "right")
        sheet.words((edge + 0.15, y + 0.22), port)

    sheet.box(2.4, -0.3, edge, 11.7, fill=LOGIC_FILL, name=board.name, middle=3.5)
    sheet.box(-2.3, 8.6, 0.2, 10.2, fill=REGISTER_FILL, name="computer")
    line((0.2, 9.4), (2.4, 9.4))
    sheet.words((1.3, 9.65), "USB", "center")
    for axis, top in (("x", 10.8), ("y", 6.8)):
        sheet.box(bus, top - 2.6, 13.0, top + 0.5, fill=REGISTER_FILL, name="")
        sheet.words((11.7, top + 0.8), f"driver {axis}", "center", size=NAME_SIZE)
        sheet.box(14.6, top - 1.4, 17.0, top + 0.4, fill=REGISTER_FILL, name=f"motor {axis}")
        wires = (
            (labels[f"step_{axis}"], f"step_{axis}", "STEP"),
            (labels[f"direction_{axis}"], f"direction_{axis}", "DIR"),
            ("3V3", "", "VDD"),
            ("GND", "", "GND, EN"),
        )
        for row, (label, port, name) in enumerate(wires):
            y = top - 0.6 * row
            pin(y, label, port)
            sheet.words((bus + 0.15, y), name)
            if port:
                sheet.wire((edge, y), (bus, y))
            else:
                line((edge, y), (bus, y))
        supplied = top - 2.3
        line((13.6, 2.0), (13.6, supplied), (13.0, supplied))
        sheet.words((12.85, supplied), "VMOT, GND", "right")
        for row, name in enumerate(("1A", "1B", "2A", "2B")):
            y = top - 0.35 * row
            # The supply's wire goes over those of the motor that is nearer to it.
            line((13.0, y), (13.45 if axis == "y" else 14.6, y))
            line((13.75, y), (14.6, y))
            sheet.words((12.85, y), name, "right")
    sheet.dot((13.6, 4.5))
    sheet.box(
        *(12.4, 0.4, 17.0, 2.0),
        fill=CONTROL_FILL,
        name="motor supply",
        words="cut by a stop button",
    )
    for row, port in enumerate(("low_x", "high_x", "low_y", "high_y", "stop")):
        y = 3.0 - 0.6 * row
        pin(y, labels[port], port)
        line((edge, y), (8.6, y))
        line((8.6, y), (9.2, y + 0.28))
        line((9.2, y), (bus - 0.6, y))
        sheet.dot((bus - 0.6, y))
    line((bus - 0.6, 3.0), (bus - 0.6, 0.0), (edge, 0.0))
    pin(0.0, "GND")
    yield sheet


def with_minus(value: object) -> str:
    """Write numbers with a minus sign, not a hyphen."""
    return str(value).replace("-", "−")


@dataclass(frozen=True)
class Lane:
    """A line of a timing diagram: a signal, what it means, and whether it is drawn as a number."""

    signal: Any
    meaning: str
    number: bool = False


@dataclass(frozen=True)
class Timing:
    """A timing diagram: some clocks of a block that the RTL runs, lane by lane.

    Attributes
    ----------
    core : Part
        The interpolator.
    block : dict
        The payload of ``blocks``, offered in clock 0.
    lanes : dict of str to Lane
        By the names that are drawn, from the top down.
    clocks : range
        The clocks to draw.
    shaded : callable
        Gives the clock to shade, from the values of the lanes.
    shade_name : str
        What is written below that clock.
    arrows : callable
        Gives the arrows, from the values of the lanes.
    caption : str
        What is run.
    held : int or None
        The clock in which a step that waits is not taken.
    arrow, arrow_color : str
        How WaveJSON writes the shape of the arrows, and their colour.
    """

    core: Part
    block: dict[str, Any]
    lanes: dict[str, Lane]
    clocks: range
    shaded: Callable[[Run], int]
    shade_name: str
    arrows: Callable[[Run], list[tuple[Spot, Spot]]]
    caption: str
    held: int | None = None
    arrow: str = "~>"
    arrow_color: str = CONTROL

    def run(self) -> Run:
        """Run the block; give the values of every lane, clock by clock."""
        run: Run = {name: [] for name in self.lanes}

        async def bench(ctx):
            ctx.set(self.core.blocks.payload, self.block)
            for clock in range(self.clocks.stop):
                ctx.set(self.core.blocks.valid, clock == 0)
                ctx.set(self.core.steps.ready, clock != self.held)
                if clock in self.clocks:
                    for name, lane in self.lanes.items():
                        run[name].append(int(ctx.get(lane.signal)))
                await ctx.tick()

        simulator = Simulator(self.core)
        simulator.add_clock(CLOCK_PERIOD)
        simulator.add_testbench(bench)
        simulator.run()
        return run

    def wave(self, run: Run) -> dict[str, Any]:
        """Turn a run into WaveJSON."""
        signal: list[dict[str, Any]] = [
            {"name": "clock", "wave": "p" + "." * (len(self.clocks) - 1)}
        ]
        for name, values in run.items():
            number = self.lanes[name].number
            new = [i == 0 or value != values[i - 1] for i, value in enumerate(values)]
            # A wave has a letter a clock: a level, 5 for a number in a blue box, a point for no
            # change.
            letters = ("5" if number else str(value) for value in values)
            wave = (letter if n else "." for letter, n in zip(letters, new, strict=True))
            lane: dict[str, Any] = {"name": name, "wave": "".join(wave)}
            if number:
                lane["data"] = [
                    with_minus(value) for value, n in zip(values, new, strict=True) if n
                ]
            signal.append(lane)
        rows = {name: row for row, name in enumerate(run, 1)}
        first = self.clocks.start
        return {
            "signal": signal,
            "edge": [
                self.arrow.join(f"[{rows[name]}:{moment - first}]" for name, moment in arrow)
                for arrow in self.arrows(run)
            ],
            "head": {"tock": first},
            "shade": [f"{self.shaded(run) - first} * {SHADE}"],
        }

    def draw(self) -> Iterable[Element]:
        """Draw it, with what the lanes mean beside them."""
        run = self.run()
        diagram = TimingDiagram(
            self.wave(run),
            namecolor=INK,
            tickcolor=INK,
            edgecolor=self.arrow_color,
            gridcolor="#c9ced4",
            fontsize=TEXT_SIZE,
            datafontsize=TEXT_SIZE,
        )
        width, foot = len(self.clocks), round(-0.8 * len(self.lanes), 1)
        room = 0.6 + 0.16 * max(len(lane.meaning) for lane in self.lanes.values())
        s = Sheet(-2.6, foot - 1.3, width + room, 1.4)
        for row, lane in enumerate(self.lanes.values(), 1):
            s.words((width + 0.2, 0.18 - 0.8 * row), lane.meaning, color=QUIET)
        shaded = self.shaded(run) - self.clocks.start
        s.words((shaded + 0.5, foot - 0.45), self.shade_name, "center")
        s.words((width / 2, foot - 0.95), self.caption, "center", QUIET)
        return [s, diagram]


def linear_carry() -> Timing:
    """Show a carry of SX, and its step that has to wait for a clock."""
    width, end, held = 8, (200, 99), 4
    core = Linear(width, 2, normalize=False, preload="zero")
    registers = core.registers

    def arrows(run: Run) -> list[tuple[Spot, Spot]]:
        carry = run["SX carry"].index(1)
        waits = zip(run["steps.valid"], run["steps.ready"], strict=True)
        taken = [valid and ready for valid, ready in waits].index(1)
        return [
            (("SX carry", carry), ("steps.valid", carry + 1)),
            (("steps.ready", taken), ("P3 = XT", taken + 1)),
        ]

    return Timing(
        core,
        {"start": {"x": 0, "y": 0}, "end": dict(zip("xy", end, strict=True))},
        {
            "blocks.valid": Lane(core.blocks.valid, "a block is offered"),
            "blocks.ready": Lane(core.blocks.ready, "and accepted"),
            "УУ start": Lane(core.uu.start, "loads the registers"),
            "УУ clock": Lane(core.uu.clock, "a summation in this clock"),
            "P1 = ΔX": Lane(registers["p1"], "increment", number=True),
            "SX": Lane(registers["sx"], f"sum modulo {1 << width}", number=True),
            "SX carry": Lane(core.summator["x"].carry, f"the summation reaches {1 << width}"),
            "P5 = KOX": Lane(registers["p5"], "steps left along x", number=True),
            "steps.valid": Lane(core.steps.valid, "a step waits"),
            "steps.ready": Lane(core.steps.ready, "and is taken"),
            "P3 = XT": Lane(registers["p3"], "coordinate", number=True),
            "done = край": Lane(core.done, "end of the block"),
        },
        range(10),
        lambda _: held,
        "held",
        arrows,
        f"block (0, 0) → {end}, n = {width}, no normalizer, preload 0",
        held=held,
    )


def circular_turn() -> Timing:
    """Show an arc that crosses an axis: the clock in which the frame is turned by 90°."""
    width, start, end = 4, (5, 12), (-5, 12)
    lecture: dict[str, Any] = Circular.LECTURE
    core = Circular(width, **lecture)
    registers, top = core.registers, (1 << width) - 1
    clocks = range(16, 30)

    def turn(run: Run) -> int:
        return clocks[run["turns"].index(0) - 1]

    def arrows(run: Run) -> list[tuple[Spot, Spot]]:
        before, after = turn(run) + 0.68, turn(run) + 1.28
        return [
            ((source, before), (target, after))
            for source, target in (("P2 = Y", "P1 = X"), ("SX", "SY"), ("SY", "SX"))
        ]

    step = core.steps.payload
    points = {"start": start, "end": end, "center": (0, 0)}
    return Timing(
        core,
        {
            **{name: dict(zip("xy", point, strict=True)) for name, point in points.items()},
            "clockwise": 0,
            "full_turns": 0,
        },
        {
            "УУ clock": Lane(core.uu.clock, "a summation in this clock, or the turn"),
            "turns": Lane(registers["turns"], "axis crossings to come", number=True),
            "swap": Lane(registers["swap"], "X is the machine’s y"),
            "P1 = X": Lane(registers["p1"], "falls; P2 after the turn", number=True),
            "P2 = Y": Lane(registers["p2"], "rises; 0 after the turn", number=True),
            "P3 = KOX": Lane(registers["p3"], "steps of X left in this quadrant", number=True),
            "P4 = KOY": Lane(registers["p4"], "steps of Y left in this quadrant", number=True),
            "SX": Lane(registers["sx"], f"sum of Y; {top} − SY after the turn", number=True),
            "SY": Lane(registers["sy"], "sum of X; SX after the turn", number=True),
            "steps.valid": Lane(core.steps.valid, "a step waits, and is taken"),
            "steps.x": Lane(step.x, "the step along x", number=True),
            "steps.y": Lane(step.y, "the step along y", number=True),
            "XT": Lane(registers["xt"], "coordinate", number=True),
            "YT": Lane(registers["yt"], "coordinate", number=True),
            "done = край": Lane(core.done, "end of the block"),
        },
        clocks,
        turn,
        "turn",
        arrows,
        f"block {start} → {with_minus(end)} around (0, 0), n = {width}, the lecture’s settings",
        arrow="->",
        arrow_color=EYE,
    )


def conic_turn() -> Timing:
    """Show a parabola about its vertex: the clock in which x turns round."""
    width, start, end = 4, (2, 4), (2, -4)
    core = Conic(width, **Conic.LECTURE)
    registers = core.registers
    step = core.steps.payload

    def turn(run: Run) -> int:
        return clocks[run["turns"].index(0) - 1]

    def arrows(run: Run) -> list[tuple[Spot, Spot]]:
        before, after = turn(run) + 0.68, turn(run) + 1.28
        return [(("GY", before), (name, after)) for name in ("x falls", "P3", "P4")]

    clocks = range(9, 22)
    return Timing(
        core,
        {
            **{"a": 0, "b": 0, "c": 1, "d": -8, "e": 0, "clockwise": 0, "turns": 1},
            "start": dict(zip("xy", start, strict=True)),
            "end": dict(zip("xy", end, strict=True)),
        },
        {
            "УУ clock": Lane(core.uu.clock, "a summation in this clock, or the turn"),
            "turns": Lane(registers["turns"], "changes of direction to come", number=True),
            "x falls": Lane(registers["direction_x"], "which way x goes"),
            "P1 = X": Lane(registers["p1"], "coordinate, a step ahead", number=True),
            "P2 = Y": Lane(registers["p2"], "coordinate, a step ahead", number=True),
            "P3": Lane(registers["p3"], "steps of x to the edge, then to the end", number=True),
            "P4": Lane(registers["p4"], "steps of y to the edge, then to the end", number=True),
            "GX": Lane(registers["gx"], "2A·x + B·y + D = −8: how fast y goes", number=True),
            "GY": Lane(registers["gy"], "B·x + 2C·y + E = 2y: how fast x goes back", number=True),
            "SX": Lane(registers["sx"], "sum of −GY · 2ˢ; a borrow is a step back", number=True),
            "SY": Lane(registers["sy"], "sum of GX · 2ˢ", number=True),
            "steps.valid": Lane(core.steps.valid, "a step waits, and is taken"),
            "steps.x": Lane(step.x, "the step along x", number=True),
            "steps.y": Lane(step.y, "the step along y", number=True),
            "done = край": Lane(core.done, "end of the block"),
        },
        clocks,
        turn,
        "turn",
        arrows,
        f"block y² = 8x, {start} → {with_minus(end)}, n = {width}, the lecture’s settings",
        arrow="->",
        arrow_color=EYE,
    )


#: The timing diagrams, by the names of their files.
TIMINGS: dict[str, Callable[[], Timing]] = {
    "linear-carry": linear_carry,
    "circular-turn": circular_turn,
    "conic-turn": conic_turn,
}

#: The pictures, by the names of their files.
FIGURES: dict[str, Callable[[], Iterable[Element]]] = {
    "linear-blocks": linear_blocks,
    "linear-carry": lambda: linear_carry().draw(),
    "circular-blocks": circular_blocks,
    "circular-turn": lambda: circular_turn().draw(),
    "conic-blocks": conic_blocks,
    "conic-turn": lambda: conic_turn().draw(),
    "board-wiring": board_wiring,
}


def draw(name: str) -> str:
    """Draw a picture of :data:`FIGURES`, as the text of an SVG file."""
    svg.config.text = "text"
    svg.Figure.total_clips = 0  # it numbers them through the life of the process
    drawing = schemdraw.Drawing(canvas="svg", show=False, font=FONT, bgcolor=PAPER, margin=0)
    for element in FIGURES[name]():
        drawing.add(element)
    return drawing.get_imagedata("svg").decode() + "\n"


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(list(FIGURES)))
def main(names: tuple[str, ...]) -> None:
    """Draw the pictures of the documentation, or the NAMES of them, beside this file."""
    for name in names or FIGURES:
        Path(__file__).with_name(f"{name}.svg").write_text(draw(name), encoding="utf-8")


if __name__ == "__main__":
    main()
