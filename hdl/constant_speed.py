"""Constant speed along the path: when the steps of a line or an arc leave, tick by tick."""

from typing import Any

from amaranth import Cat, Module, Mux, Signal, Value
from amaranth.hdl import signed, unsigned
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.arc_input import FULL_TURNS_BITS
from discreta.hdl.contract import (
    AXIS_LETTERS,
    ErrorCode,
    Part,
    check_axes,
    point_layout,
    step_layout,
)
from discreta.hdl.exact_arc import ExactArc
from discreta.hdl.exact_line import ExactLine

__all__ = [
    "FRACTION_BITS",
    "ConstantSpeed",
    "constant_arc",
    "constant_line",
    "constant_speed_layout",
    "pace_bits",
    "ticks_bits",
]

#: Fraction bits of an arc's ``pace``; a line's has n more.
FRACTION_BITS = 12


def pace_bits(width: int) -> int:
    """Give the bits of the field ``pace``."""
    return width + FRACTION_BITS + 1


def ticks_bits(width: int) -> int:
    """Give the bits of the field ``ticks``: a circle's length, as often as it may be run round."""
    return width + 3 + FULL_TURNS_BITS


def constant_speed_layout(core: data.StructLayout, width: int, axes: int) -> data.StructLayout:
    """Lay out the blocks of a core that are run at constant speed; ``core`` has its own."""
    point = point_layout(width, axes)
    fields: dict[str, Any] = dict(core.members)
    further = axes > len(fields["start"].members)
    fields |= {"start": point, "end": point, "pace": pace_bits(width)}
    return data.StructLayout(fields | ({"ticks": ticks_bits(width)} if further else {}))


class ConstantSpeed(Part):
    """Spreads the steps of an exact line or arc over ticks, each the same length of path.

    Every transfer at ``steps`` is a tick; whoever takes them at a constant rate moves the machine
    at a constant speed along the path, one step's length a tick. A tick carries the next step of
    the core, or no step.

    Computes a debt D, which a step raises by the length of path that it leads along, and a tick
    pays off. With D < 0 the tick carries the step that waits in the core, and then::

        line:   D := D + (length/L − 1)                     L, the longest way of an axis
        arc:    D := D + |X·dY − Y·dX| − R                  X, Y from the centre, before the step

    and with D ≥ 0 it carries none, and D loses 1 (line) or R (arc). D begins with half a tick's
    worth below 0. A line's leading axis steps every length/L ticks; of an arc X·dY − Y·dX is twice
    the area that the step sweeps over, which on a circle is R times its length (what Kepler found
    of planets), whichever axis leads.

    Blocks: those of the core and, behind them, ``pace``. Of a line it is length/L − 1 in
    2^-(n + 12); of an arc R in 2^-12 steps. With ``pace`` 0 every tick carries a step: full speed.
    So the square roots are the sender's, and rounded as it likes.

    Helix: of an arc with more than two axes the further ones move linearly along it, |Δ| steps in
    ``ticks``, T, another field of the block: each tick SZ := SZ + \\|ΔZ\\|, and where that is T or
    more, T is taken off and Z steps. SZ begins with ⌊T/2⌋. T is the arc's length, or that of the
    longest further axis if it is longer, and ``pace`` R·length/T then. The last step of the arc
    waits until no further axis has more than one step left, and takes that along: so the end is
    exact whatever ``ticks`` is.

    Registers: ``timer_debt`` D, ``timer_pace``, ``timer_full`` (pace 0), ``timer_x`` and
    ``timer_y``; of a further axis ZT = position, KOZ = steps left, SZ, ``timer_way_z``; ``ticks``.
    ``timer_here``: a block runs; ``timer_next``: the one behind it is in the core, too, its values
    are in ``next_…``. And those of the core.

    Latency: that of the core; a step is offered in the clock in which it waits there.

    Throughput: a tick a clock. Between blocks as the core, as far as two blocks in it allow that.
    ``position``, ``last``, ``done``: as of the core.

    Reset: nothing held. Overflow: with a ``pace`` that is not the block's own the speed is another
    one, and every step still leaves, in order. D wraps then.
    ``error``: the core's; and ``OFF_CURVE`` where an arc that makes no step (start, end and centre
    one point) has further axes to move.

    Error: the way along the path that was made in t ticks is t within one step on lines and on arcs
    of R ≥ 20, two below (measured); a ``pace`` rounded to its last bit adds less than 2^-8 a turn.
    A further axis is within half a step of where it belongs in this tick, and a step more where
    ``ticks`` is not what the arc takes.

    Source: design of the exact interpolator (a timer modulo R or L, started at half, decides when
    the leading axis steps). That rule gives up half a step at every change of octant, and was 3
    steps off on a circle of R = 100; so an arc is timed by area here.

    Parameters
    ----------
    core : ExactLine or ExactArc
    axes : int or None
        Of an arc: 2 to 6, those beyond two move along it; None: as many as the core has.

    Attributes
    ----------
    parameters : dict of str to object
        Those of the core, and the number of axes.
    diagram : dict of str to list of Signal
        Every register there is, grouped, by the group's title.
    registers : dict of str to Signal
        The same registers, by their names in waveforms.

    Raises
    ------
    TypeError, ValueError
        The number of axes is out of range, or not that of a line.
    """

    notation = "n = width, T = ticks"

    def __init__(self, core: ExactLine | ExactArc, axes: int | None = None):
        axes = core.axes if axes is None else axes
        check_axes(axes)
        self.round = isinstance(core, ExactArc)
        if not self.round and axes != core.axes:
            raise ValueError(f"number of axes is {axes}: a line's are its core's, {core.axes}")
        width = core.width
        point = point_layout(width, axes)
        layout = constant_speed_layout(core.blocks.payload.shape(), width, axes)
        super().__init__(
            {
                "blocks": In(stream.Signature(layout)),
                "steps": Out(stream.Signature(step_layout(axes))),
                "position": Out(point),
                "busy": Out(1),
                "done": Out(1),
                "error": Out(ErrorCode),
            }
        )
        self.core = core
        self.width = width
        self.axes = axes
        self.letters = AXIS_LETTERS[:axes]
        #: Axes that move along the arc.
        self.along = self.letters[core.axes :]
        self.parameters: dict[str, object] = core.parameters | {"axes": axes}

        pace, ticks = unsigned(pace_bits(width)), unsigned(ticks_bits(width))
        wide, seen = signed(width + 1), signed(width + 2)
        flag = unsigned(1)
        groups: dict[str, dict[str, Any]] = {
            "timer": {"timer_debt": signed(pace_bits(width) + 2), "timer_pace": pace},
            "timer's УУ": dict.fromkeys(("timer_here", "timer_next", "timer_ended"), flag),
            "block behind": {"next_pace": pace},
        }
        if self.round:
            groups["timer"] |= {"timer_full": flag, "timer_clockwise": flag}
            groups["timer"] |= dict.fromkeys(("timer_x", "timer_y"), seen)
            groups["block behind"] |= {"next_clockwise": flag}
            groups["block behind"] |= dict.fromkeys(("next_x", "next_y"), seen)
        if self.along:
            groups["further axes"] = {"ticks": ticks}
            groups["block behind"]["next_ticks"] = ticks
        for a in self.along:
            groups["further axes"] |= {f"{a}t": wide, f"ko{a}": unsigned(width + 1)}
            groups["further axes"] |= {f"timer_way_{a}": unsigned(width + 1), f"s{a}": ticks}
            groups["further axes"][f"timer_negative_{a}"] = flag
            groups["block behind"] |= {f"next_start_{a}": wide, f"next_way_{a}": seen}
        made = {
            title: {name: Signal(shape, name=name) for name, shape in group.items()}
            for title, group in groups.items()
        }
        self.own = {name: signal for group in made.values() for name, signal in group.items()}
        self.diagram: dict[str, list[Signal]] = {
            title: list(group.values()) for title, group in made.items()
        } | core.diagram
        self.registers: dict[str, Signal] = self.own | core.registers

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        m.submodules.core = core = self.core
        r = self.own
        here, behind = r["timer_here"], r["timer_next"]
        tick, due, load, accept, ended, answered, leaves, held, lost, runs = (
            Signal(name=name)
            for name in (
                *("tick", "due", "load", "accept", "ended", "answered", "leaves"),
                *("held", "lost", "runs"),
            )
        )
        block, waits = self.blocks.payload, core.steps.payload
        negative = r["timer_debt"][-1]
        m.d.comb += [
            self.blocks.ready.eq(core.blocks.ready & ~behind),
            core.blocks.valid.eq(self.blocks.valid & ~behind),
            accept.eq(self.blocks.valid & self.blocks.ready),
            runs.eq(core.steps.valid & here),
            tick.eq(runs & self.steps.ready),
            due.eq((negative | (r["timer_full"] if self.round else 0)) & ~(waits.last & held)),
            self.steps.valid.eq(runs),
            self.steps.payload.last.eq(waits.last & due),
            core.steps.ready.eq(self.steps.ready & here & due),
            ended.eq(tick & due & waits.last),
            answered.eq((core.done & ~r["timer_ended"]) | (core.error != ErrorCode.NONE)),
            leaves.eq(here & (ended | answered)),
            load.eq(behind & (~here | leaves)),
            self.busy.eq(core.busy | here | behind),
            self.done.eq(core.done & ~lost),
            self.error.eq(Mux(lost, ErrorCode.OFF_CURVE, core.error)),
        ]
        for field in core.blocks.payload.shape().members:
            own, given = core.blocks.payload[field], block[field]
            if field in ("start", "end"):
                m.d.comb += [own[a].eq(given[a]) for a in self.letters[: core.axes]]
            else:
                m.d.comb += own.eq(given)
        for a in self.letters[: core.axes]:
            m.d.comb += [
                self.steps.payload[a].eq(Mux(due, waits[a], 0)),
                self.position[a].eq(core.position[a]),
            ]
        m.d.sync += [
            here.eq(load | (here & ~leaves)),
            behind.eq(accept | (behind & ~load)),
            r["timer_ended"].eq(ended),
        ]
        with m.If(accept):
            m.d.sync += r["next_pace"].eq(block.pace)
        with m.If(load):
            m.d.sync += r["timer_pace"].eq(r["next_pace"])
        if self.round:
            self._time_arc(m, tick, due, accept, load)
        else:
            self._time_line(m, tick, due, load)
        self._move_along(m, tick, due, accept, load, held)
        left = Cat(r[f"ko{a}"].any() for a in self.along).any() if self.along else 0
        m.d.comb += lost.eq(core.done & ~r["timer_ended"] & here & left)
        return m

    def _time_line(self, m: Module, tick: Value, due: Value, load: Value) -> None:
        """A step is length/L ticks long."""
        r = self.own
        debt, one = r["timer_debt"], 1 << (self.width + FRACTION_BITS)
        with m.If(load):
            m.d.sync += debt.eq(-(one >> 1))
        with m.Elif(tick):
            m.d.sync += debt.eq(debt + Mux(due, r["timer_pace"], -one))

    def _time_arc(self, m: Module, tick: Value, due: Value, accept: Value, load: Value) -> None:
        """A step is as long as the area that it sweeps over, by R/2."""
        r, block, waits = self.own, self.blocks.payload, self.core.steps.payload
        debt, pace, clockwise = r["timer_debt"], r["timer_pace"], r["timer_clockwise"]
        # ±X for a step in y, ±Y for one in x; the complement is a carry short of the negative.
        against = {"x": waits.y[-1] ^ clockwise, "y": ~waits.x[-1] ^ clockwise}
        parts = []
        for a, other in ("xy", "yx"):
            part = Signal(signed(self.width + 3), name=f"swept_{a}")
            flip = against[a] & waits[other][0]
            side = Mux(waits[other][0], r[f"timer_{a}"], 0)
            turned = Cat(side) ^ flip.replicate(len(side))
            m.d.comb += part.eq(turned.as_signed() + flip)
            parts.append(part)
            with m.If(accept):
                m.d.sync += r[f"next_{a}"].eq(block.start[a] - block.center[a])
            with m.If(load):
                m.d.sync += r[f"timer_{a}"].eq(r[f"next_{a}"])
            with m.Elif(tick & due):
                m.d.sync += r[f"timer_{a}"].eq(r[f"timer_{a}"] + waits[a])
        area = Signal(signed(self.width + 4), name="area")
        m.d.comb += area.eq(parts[0] + parts[1])
        with m.If(accept):
            m.d.sync += r["next_clockwise"].eq(block.clockwise)
        with m.If(load):
            m.d.sync += [
                clockwise.eq(r["next_clockwise"]),
                r["timer_full"].eq(r["next_pace"] == 0),
                debt.eq(-(r["next_pace"] >> 1)),
            ]
        # A last step that waits for further axes lets D be.
        with m.Elif(tick & (due | ~debt[-1])):
            m.d.sync += debt.eq(debt - pace + Mux(due, area << FRACTION_BITS, 0))

    def _move_along(
        self, m: Module, tick: Value, due: Value, accept: Value, load: Value, held: Value
    ) -> None:
        """Move the further axes, linearly in ticks."""
        r, block = self.own, self.blocks.payload
        final = due & self.core.steps.payload.last
        if self.along:
            m.d.comb += held.eq(Cat(r[f"ko{a}"] >= 2 for a in self.along).any())
            with m.If(accept):
                m.d.sync += r["next_ticks"].eq(block.ticks)
            with m.If(load):
                m.d.sync += r["ticks"].eq(r["next_ticks"])
        for a in self.along:
            way, left, place, total = r[f"timer_way_{a}"], r[f"ko{a}"], r[f"{a}t"], r[f"s{a}"]
            given, negative = r[f"next_way_{a}"], r[f"timer_negative_{a}"]
            size = ticks_bits(self.width)
            summed = Signal(size + 1, name=f"summed_{a}")
            carry, moves = Signal(name=f"carry_{a}"), Signal(name=f"moves_{a}")
            length = Signal(self.width + 1, name=f"length_{a}")
            m.d.comb += [
                length.eq(Mux(given[-1], -given, given)),
                summed.eq(total + way),
                carry.eq(summed >= r["ticks"]),
                moves.eq(left.any() & (final | carry)),
                self.steps.payload[a].eq(Cat(moves, moves & negative)),
                self.position[a].eq(place),
            ]
            with m.If(accept):
                m.d.sync += [
                    r[f"next_start_{a}"].eq(block.start[a]),
                    given.eq(block.end[a] - block.start[a]),
                ]
            with m.If(load):
                m.d.sync += [
                    place.eq(r[f"next_start_{a}"]),
                    way.eq(length),
                    left.eq(length),
                    negative.eq(given[-1]),
                    total.eq(r["next_ticks"] >> 1),
                ]
            with m.Elif(tick):
                m.d.sync += [
                    total.eq(Mux(carry, summed - r["ticks"], summed)),
                    left.eq(left - moves),
                    place.eq(place + self.steps.payload[a]),
                ]


def constant_line(width: int = 16, axes: int = 2) -> ConstantSpeed:
    """Make an exact line at constant speed."""
    return ConstantSpeed(ExactLine(width, axes))


def constant_arc(width: int = 16, axes: int = 2) -> ConstantSpeed:
    """Make an exact arc at constant speed; axes beyond two move along it."""
    check_axes(axes)
    return ConstantSpeed(ExactArc(width), axes)
