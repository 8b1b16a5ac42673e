"""Draws the pictures of the documentation: ``python docs/figures.py [NAME]...``, from the root.

The pictures are committed, so that the pages show without building anything. The same version of
schemdraw gives the same bytes on every machine: text stays text, and no font is measured.
"""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Literal

import click
import schemdraw
from amaranth.sim import Simulator
from schemdraw.backends import svg
from schemdraw.elements import Element
from schemdraw.logic import TimingDiagram
from schemdraw.segments import Segment, SegmentCircle, SegmentPoly, SegmentText

from discreta.hdl.linear import Linear
from discreta.sim.interpreted import CLOCK_PERIOD

__all__ = [
    "CLOCKS",
    "END",
    "FIGURES",
    "HELD_CLOCK",
    "LANES",
    "NUMBERS",
    "WIDTH",
    "carry_run",
    "carry_wave",
    "draw",
    "main",
]

FONT = "Arial, Helvetica, Liberation Sans, DejaVu Sans, sans-serif"
INK, CONTROL, QUIET, PAPER = "#1b1f24", "#1a56b0", "#57606a", "#ffffff"
REGISTER_FILL, LOGIC_FILL, CONTROL_FILL, HELD_FILL = "#e3eefc", "#f3f3ef", "#fff1cc", "#fff1cc"
NAME_SIZE, TEXT_SIZE = 12, 10

#: The block of the timing diagram, (0, 0) to END on n = WIDTH bits, and the clocks shown of it.
WIDTH, END, CLOCKS = 8, (200, 99), 10
#: The clock in which the step of the first carry waits: it is refused for this one clock.
HELD_CLOCK = 4

#: The lanes of the timing diagram, what they mean, and which of them are numbers.
LANES = {
    "blocks.valid": "a block is offered",
    "blocks.ready": "and accepted",
    "УУ start": "loads the registers",
    "УУ clock": "a summation in this clock",
    "P1 = ΔX": "increment",
    "SX": f"sum modulo {1 << WIDTH}",
    "SX carry": f"the summation reaches {1 << WIDTH}",
    "P5 = KOX": "steps left along x",
    "steps.valid": "a step waits",
    "steps.ready": "and is taken",
    "P3 = XT": "coordinate",
    "done = край": "end of the block",
}
NUMBERS = ("P1 = ΔX", "SX", "P5 = KOX", "P3 = XT")

INPUT_WORDS = "processing\n\n|end − start|\nand the signs;\none block\nahead"
NORMALIZER_WORDS = "(optional)\n\n× 2ˢ,\nthe same s\nfor both"
OUTPUT_WORDS = "processing\n\nputs in the\nsigns; holds\na step until\nit is taken"
CONTROL_WORDS = (
    "control unit\n\nstart (старт) takes the prepared block, load puts it into the registers"
)

XY = tuple[float, float]
Align = Literal["left", "center", "right"]


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

    def box(self, *area: float, fill: str, name: str, words: str = "") -> None:
        """Draw a box with a name and smaller lines of ``words`` under it, all in the middle."""
        left, bottom, right, top = area
        self._rectangle(area, INK, fill, zorder=1)
        lines = words.splitlines()
        x, y = (left + right) / 2, (bottom + top) / 2 + 0.19 * len(lines)
        self.words((x, y), name, "center", size=NAME_SIZE)
        for number, line in enumerate(lines, 1):
            self.words((x, y - 0.38 * number), line, "center")

    def wire(self, *path: XY, color: str = INK) -> None:
        """Draw an arrow along ``path``, whose lines go up and down or sideways."""
        (x0, y0), (x, y) = path[-2:]
        dx, dy = (x > x0) - (x < x0), (y > y0) - (y < y0)
        # The library's own heads stop short of the point they show.
        base = (x - 0.2 * dx, y - 0.2 * dy)
        head = [(base[0] + half * dy, base[1] + half * dx) for half in (0.08, -0.08)]
        self.segments += [
            Segment([*path[:-1], base], color=color, lw=1.2, joinstyle="miter", zorder=2),
            SegmentPoly([(x, y), *head], color=color, fill=color, lw=0.1, zorder=2),
        ]

    def dot(self, at: XY, color: str = INK) -> None:
        """Show that the wires that meet here are joined."""
        self.segments.append(SegmentCircle(at, 0.07, color=color, fill=color, lw=0.1, zorder=2))

    def signal(self, *path: XY, words: str = "", at: XY = (0, 0)) -> None:
        """Draw a wire of the control unit, with its name."""
        self.wire(*path, color=CONTROL)
        self.words(at, words, color=CONTROL)


def draw_blocks() -> Iterable[Element]:
    """Draw the block diagram of the linear interpolator, after the lecture's."""
    s = Sheet(-0.1, -2.5, 20.5, 10.5)
    s.box(2.4, 1.3, 4.6, 10.1, fill=LOGIC_FILL, name="Input", words=INPUT_WORDS)
    s.box(5.45, 3.0, 7.45, 6.8, fill=LOGIC_FILL, name="Normalizer", words=NORMALIZER_WORDS)
    s.box(14.4, 1.3, 16.5, 8.5, fill=LOGIC_FILL, name="Output", words=OUTPUT_WORDS)
    s.box(2.4, -2.2, 16.5, 0.2, fill=CONTROL_FILL, name="УУ", words=CONTROL_WORDS)

    # The axes mirror each other.
    for axis, number, y, outer, side in (("X", 1, 6.0, 7.9, 1), ("Y", 2, 3.8, 1.9, -1)):
        p1, p5 = f"P{number}", f"P{number + 4}"
        s.box(8.0, y - 0.6, 9.2, y + 0.6, fill=REGISTER_FILL, name=p1, words=f"Δ{axis} · 2ˢ")
        s.box(10.1, y - 0.6, 11.6, y + 0.6, fill=REGISTER_FILL, name=f"S{axis}", words="summator")
        box = (12.1, outer - 0.6, 13.4, outer + 0.6)
        s.box(*box, fill=REGISTER_FILL, name=p5, words=f"KO{axis}")
        # The increment: through the normalizer to the summator, and past it to the counter.
        s.wire((4.6, y), (5.45, y))
        s.words((4.7, y - 0.25 * side), f"Δ{axis}")
        s.dot((5.05, y))
        s.wire((5.05, y), (5.05, outer + 0.3 * side), (12.1, outer + 0.3 * side))
        s.wire((7.45, y), (8.0, y))
        s.wire((9.2, y + 0.25 * side), (10.1, y + 0.25 * side))
        # The carry is a step, and one less to go; none to go stops the summator.
        s.wire((11.6, y), (14.4, y))
        s.words((11.7, y - 0.25 * side), "carry")
        s.dot((12.75, y))
        s.wire((12.75, y), (12.75, outer - 0.6 * side))
        s.words((12.85, y + 0.95 * side), "−1")
        zero = outer - 0.3 * side
        s.wire((12.1, zero), (11.25, zero), (11.25, y + 0.6 * side))
        s.words((11.15, zero), "0: stop", "right")

    # In and out: the block, the steps, the coordinates.
    s.words((0.1, 7.5), "blocks", color=QUIET)
    for y, what in ((6.8, "start XH, YH"), (6.1, "end XK, YK"), (5.4, "valid")):
        s.wire((0.1, y), (2.4, y))
        s.words((0.1, y + 0.22), what)
    s.wire((2.4, 4.7), (0.1, 4.7))
    s.words((0.1, 4.92), "ready")
    s.wire((4.6, 9.3), (15.9, 9.3), (15.9, 8.5))
    s.words((4.7, 9.08), "signs")
    s.wire((4.6, 9.8), (17.0, 9.8), (17.0, 5.5), (17.7, 5.5))
    s.words((4.7, 10.02), "XH, YH")
    s.dot((17.0, 7.7))
    s.wire((17.0, 7.7), (17.7, 7.7))
    for name, coordinate, y in (("P3", "XT", 7.4), ("P4", "YT", 5.2)):
        s.box(17.7, y - 0.6, 19.0, y + 0.6, fill=REGISTER_FILL, name=name, words=coordinate)
        s.wire((16.5, y - 0.3), (17.7, y - 0.3))
        s.words((17.08, y - 0.53), "±1")
        s.wire((19.0, y), (19.6, y))
        s.words((19.7, y), coordinate)
    s.words((19.2, 7.8), "position", color=QUIET)
    s.wire((16.5, 3.4), (17.6, 3.4))
    s.words((17.7, 3.4), "steps: x, y, valid")

    # The control unit.
    for x, y, side in (
        *((8.6, 6.6, 1), (10.4, 6.6, 1), (12.75, 8.5, 1), (15.0, 8.5, 1)),
        *((8.6, 3.2, -1), (10.4, 3.2, -1), (12.3, 1.3, -1), (18.35, 8.0, 1), (18.35, 5.8, 1)),
    ):
        s.signal((x, y + 0.5 * side), (x, y), words="load", at=(x + 0.1, y + 0.35 * side))
    s.signal((2.8, 0.2), (2.8, 1.3), words="start, idle", at=(2.9, 0.75))
    s.signal((4.4, 1.3), (4.4, 0.2), words="pending, fault, empty", at=(4.5, 0.75))
    s.signal((9.65, 0.2), (9.65, 5.75), (10.1, 5.75), words="clock", at=(9.75, 0.75))
    s.dot((9.65, 4.05), CONTROL)
    s.signal((9.65, 4.05), (10.1, 4.05))
    s.signal((13.2, 1.3), (13.2, 0.2))
    s.signal((13.4, 7.9), (13.9, 7.9), (13.9, 0.2), words="ending", at=(14.0, 0.75))
    s.signal((15.1, 1.3), (15.1, 0.2), words="waiting", at=(15.2, 0.75))
    s.signal((16.3, 0.2), (16.3, 1.3), words="clock, taken", at=(16.4, 0.75))
    s.signal((17.6, -0.1), (16.5, -0.1), words="steps: ready", at=(17.7, -0.1))
    for row, words in enumerate(("steps: last", "busy", "done (край)", "error"), 1):
        y = -0.1 - 0.45 * row
        s.signal((16.5, y), (17.6, y), words=words, at=(17.7, y))
    return [s]


def carry_run() -> dict[str, list[int]]:
    """Run the block of the timing diagram; give the values of every lane, clock by clock."""
    core = Linear(WIDTH, 2, normalize=False, preload="zero")
    signals = {
        "blocks.valid": core.blocks.valid,
        "blocks.ready": core.blocks.ready,
        "УУ start": core.uu.start,
        "УУ clock": core.uu.clock,
        "P1 = ΔX": core.registers["p1"],
        "SX": core.registers["sx"],
        "SX carry": core.summator["x"].carry,
        "P5 = KOX": core.registers["p5"],
        "steps.valid": core.steps.valid,
        "steps.ready": core.steps.ready,
        "P3 = XT": core.registers["p3"],
        "done = край": core.done,
    }
    run: dict[str, list[int]] = {name: [] for name in LANES}

    async def bench(ctx):
        end = dict(zip("xy", END, strict=True))
        ctx.set(core.blocks.payload, {"start": {"x": 0, "y": 0}, "end": end})
        for clock in range(CLOCKS):
            ctx.set(core.blocks.valid, clock == 0)
            ctx.set(core.steps.ready, clock != HELD_CLOCK)
            for name, values in run.items():
                values.append(int(ctx.get(signals[name])))
            await ctx.tick()

    simulator = Simulator(core)
    simulator.add_clock(CLOCK_PERIOD)
    simulator.add_testbench(bench)
    simulator.run()
    return run


def carry_wave(run: dict[str, list[int]]) -> dict[str, Any]:
    """Turn a run into WaveJSON, with arrows from the first carry to its step and its taking."""
    signal: list[dict[str, Any]] = [{"name": "clock", "wave": "p" + "." * (CLOCKS - 1)}]
    for name, values in run.items():
        new = [clock == 0 or values[clock] != values[clock - 1] for clock in range(CLOCKS)]
        # A wave has a letter a clock: a level, 5 for a number in a blue box, a point for no change.
        letters = ("5" if name in NUMBERS else str(value) for value in values)
        lane: dict[str, Any] = {
            "name": name,
            "wave": "".join(letter if n else "." for letter, n in zip(letters, new, strict=True)),
        }
        if name in NUMBERS:
            lane["data"] = [str(value) for value, n in zip(values, new, strict=True) if n]
        signal.append(lane)
    carry = run["SX carry"].index(1)
    taken = [a and b for a, b in zip(run["steps.valid"], run["steps.ready"], strict=True)].index(1)
    for name, clock, node in (
        ("SX carry", carry, "A"),
        ("steps.valid", carry + 1, "B"),
        ("steps.ready", taken, "C"),
        ("P3 = XT", taken + 1, "D"),
    ):
        lane = next(lane for lane in signal if lane["name"] == name)
        lane["node"] = "." * clock + node
    return {
        "signal": signal,
        "edge": ["A~>B", "C~>D"],
        "head": {"tock": 0},
        "shade": [f"{HELD_CLOCK} * {HELD_FILL}"],
    }


def draw_carry() -> Iterable[Element]:
    """Draw a carry of SX, and its step that has to wait for a clock."""
    diagram = TimingDiagram(
        carry_wave(carry_run()),
        namecolor=INK,
        tickcolor=INK,
        edgecolor=CONTROL,
        gridcolor="#c9ced4",
        fontsize=TEXT_SIZE,
        datafontsize=TEXT_SIZE,
    )
    s = Sheet(-2.6, -10.9, 14.6, 1.4)
    for row, meaning in enumerate(LANES.values(), 1):
        s.words((CLOCKS + 0.2, 0.18 - 0.8 * row), meaning, color=QUIET)
    s.words((HELD_CLOCK + 0.5, -10.05), "held", "center")
    block = f"block (0, 0) → {END}, n = {WIDTH}, no normalizer, preload 0"
    s.words((CLOCKS / 2, -10.55), block, "center", QUIET)
    return [s, diagram]


#: The pictures, by the names of their files.
FIGURES: dict[str, Callable[[], Iterable[Element]]] = {
    "linear-blocks": draw_blocks,
    "linear-carry": draw_carry,
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
