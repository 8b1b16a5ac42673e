"""The interpolator of curves of the second order: two derivatives, summed with carry and borrow."""

from typing import Any, ClassVar

from amaranth import Cat, Const, Module, Mux, Signal, Value
from amaranth.hdl import signed
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import (
    ErrorCode,
    Part,
    check_choice,
    check_guard,
    check_width,
    point_layout,
    step_layout,
)
from discreta.hdl.parts import (
    PRELOADS,
    ControlUnit,
    Normalizer,
    PositionRegister,
    RemainingCounter,
    ScaleConverter,
    StepAdder,
)
from discreta.hdl.parts.scale_converter import coefficient_bits, derivative_bits, linear_bits
from discreta.hdl.parts.step_adder import times
from discreta.hdl.quadrant import QuadrantOutput

__all__ = ["MAX_WIDTH", "ORDERS", "TURNS_BITS", "Conic", "conic_block_layout"]

MAX_WIDTH = 24
ORDERS = ("implicit", "alternated", "simultaneous")
TURNS_BITS = 11


def conic_block_layout(width: int) -> data.StructLayout:
    """Lay out a conic block: A…E, two points in steps, the direction, direction changes to come."""
    point = point_layout(width, 2)
    square, linear = signed(coefficient_bits(width)), signed(linear_bits(width))
    return data.StructLayout(
        {
            "a": square,
            "b": square,
            "c": square,
            "d": linear,
            "e": linear,
            "start": point,
            "end": point,
            "clockwise": 1,
            "turns": TURNS_BITS,
        }
    )


class Conic(Part):
    r"""Draws any curve of the second order: its two derivatives are summed with carry and borrow.

    The curve is A·x² + B·x·y + C·y² + D·x + E·y + F = 0; F follows from the start. With Gx = 2A·x +
    B·y + D and Gy = B·x + 2C·y + E, M = 2^(2n + 6 + g) and s the common scale of a summation (see
    below), counter-clockwise (to the left) every summation makes::

        SX := SX − Gy·2^s; on carry x := x + 1, on borrow x := x − 1
        SY := SY + Gx·2^s; on carry y := y + 1, on borrow y := y − 1

    and clockwise the same with the signs of both velocities changed. The coefficients must have the
    sign for which A·Gy² − B·Gx·Gy + C·Gx² is not negative, so that the curve bends to the left when
    it runs counter-clockwise; discreta.sim.conics makes such blocks.

    Pieces: between two changes of direction both axes go one way. The axis that speeds up is summed
    first, the other one, which slows down, second. A piece ends when the slow one stands still or
    would go back, with ``turns`` changes of direction to come; one clock then turns it round.

    Order: ``simultaneous``, as the lecture prints it, takes both velocities from before the
    summation; the path grows, by e^(h²·(4AC − B²)) a summation of scale h in area. ``alternated``
    takes the second velocity with the first axis's new coordinate; for B ≠ 0 the path shrinks, by
    1 − h²·B². ``implicit`` also takes the second axis's own new coordinate, adding what its step
    changes afterwards; the area stays, whatever B is.

    Preload: the summators start from 0 or M/2 when their axis rises, from the complement when it
    falls. With M/2, and not in order simultaneous, the very first increment of the axis that is
    added to first is half as large, unless the curve is a straight line: that axis is then half a
    summation before the other one, as it must be for the path to be true.

    Scale: before every summation Gx, Gy and with them 2A, B, 2C are shifted left together until one
    has its top bit set. But the scale s does not rise within a block, while both axes go (not in
    order simultaneous, and not on circles): so an ellipse comes to one scale, with which it does
    not drift. When s falls by 1 the axis that is added to first adds the mean of both scales, 3/2
    of its increment, so that it stays half a summation before the other one. On circles s goes to
    and fro, and what the mean leaves out comes back: there the points are those of the circular
    interpolator. A derivative of which the axis does not go counts as 0.

    Registers: P1, P2 = x, y; GX, GY; SX, SY; P3, P4 = steps left of x and y in this piece (in the
    last one those to the end, before it those to the edge of the coordinates); A…E; XT, YT =
    coordinates now; ``turns``; XK, YK = the end.

    The end: on entering the last piece the counters are loaded with the way to the end. An axis for
    which that leads back has overshot, is ``backward`` and stands still. The block ends when no
    steps are left, or with a step that lands on the end while one change of direction is to come.
    When none of the axes with steps left would move any more, these are put out as completing
    steps, one of an axis a clock: a block always ends on its end point. (Should the last change of
    direction, in a block with wrong ``turns``, find the end reached already, ``done`` follows at
    once and no step was ``last``.)

    Latency: a block accepted in clock 0 is prepared from clock 1 to n + 3, started in clock n + 4
    and summed from the clock after. A carry is a step in the next clock. ``done`` follows the last
    step by a clock.

    Throughput: one summation a clock, and one clock for every change of direction. Blocks are
    accepted when nothing runs or waits: n + 5 clocks lie between the last step of one and the first
    summation of the next.

    Steps: ``steps`` holds a step until it is taken and everything waits for it. ``position`` shows
    the steps taken, not the one that waits; starting a block loads it with the block's start.

    Reset: everything 0 (the summators their preload), nothing held, position at the origin.

    Overflow: none, whatever the block is. With A, B, C of n + 4 and D, E of 2n + 5 bits, signed,
    the derivatives fit their 2n + 7 bits at every point; no axis goes beyond −2^n … 2^n − 1; a
    summator has 2n + 8 + g bits, −2M … 2M − 1, and stays at a limit that it would go beyond, which
    only happens where a curve is too sharp for the grid. ``error`` is ``SHARP`` for one clock, in
    place of ``done``, when both derivatives are 0 at the start, or \|Gx\| + \|Gy\| < 4·(\|A\| +
    \|B\| + \|C\|): the radius of curvature may be below two steps there. Nothing moves and the next
    block runs as ever.

    Error bound: none is proven; see docs/conic.md for what was measured.

    Source: lecture, general curve and its block diagram (with x'/y' = −(Bx + 2Cy + E)/(2Ax + By +
    D); the printed By and the missing sign are errata). Order, pieces, preload, guard bits and the
    end are ours.

    Parameters
    ----------
    width : int
        n, 4 to 24: no register of a wider one would fit 64 bits. Coordinates are signed, n + 1
        bits; steps are 1 long.
    order : str
        ``"implicit"``, ``"alternated"`` or ``"simultaneous"``.
    preload : str
        What the summators start from: ``"zero"`` or ``"half"`` (of M).
    guard : int
        g, 0 to 4: each bit halves the increments, for less error in twice the clocks.

    Attributes
    ----------
    LECTURE : dict of str to object
        The parameters of the lecture's own machine.
    parameters : dict of str to object
        The parameters it was made with.
    diagram : dict of str to list of Signal
        Every register there is, grouped as in the block diagram, by the group's title.
    registers : dict of str to Signal
        The same registers, by their names in waveforms.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """

    notation = "n = width, g = guard, M = 2^(2n + 6 + g)"

    LECTURE: ClassVar[dict[str, Any]] = {"order": "simultaneous", "preload": "zero", "guard": 0}

    def __init__(
        self, width: int = 16, *, order: str = "implicit", preload: str = "half", guard: int = 2
    ):
        check_width(width, MAX_WIDTH)
        check_choice("order", order, ORDERS)
        check_choice("preload", preload, PRELOADS)
        check_guard(guard)
        super().__init__(
            {
                "blocks": In(stream.Signature(conic_block_layout(width))),
                "steps": Out(stream.Signature(step_layout(2))),
                "position": Out(point_layout(width, 2)),
                "busy": Out(1),
                "done": Out(1),
                "error": Out(ErrorCode),
            }
        )
        self.width = width
        self.order = order
        self.preload = preload
        self.guard = guard
        self.parameters: dict[str, object] = {
            "width": width,
            "order": order,
            "preload": preload,
            "guard": guard,
        }
        self.ordered = order != "simultaneous"
        n, w = width, derivative_bits(width)
        coordinate = signed(n + 1)
        sum_shape = signed(w + guard + 1)
        self.modulus = 1 << (w - 1 + guard)
        self.initial_sum = self.modulus // 2 if preload == "half" else 0
        self.uu = ControlUnit()
        self.output = QuadrantOutput(2)
        self.p1, self.p2 = Signal(coordinate, name="p1"), Signal(coordinate, name="p2")
        self.p3 = RemainingCounter(n + 1, name="p3")
        self.p4 = RemainingCounter(n + 1, name="p4")
        self.sx = Signal(sum_shape, name="sx", init=self.initial_sum)
        self.sy = Signal(sum_shape, name="sy", init=self.initial_sum)
        self.converter = {a: ScaleConverter(width, name=f"g{a}") for a in "xy"}
        self.gx, self.gy = (converter.register for converter in self.converter.values())
        self.xt, self.yt = PositionRegister(n, name="xt"), PositionRegister(n, name="yt")
        square, linear = signed(coefficient_bits(n)), signed(linear_bits(n))
        self.coefficients = {
            **{k: Signal(square, name=k) for k in "abc"},
            **{k: Signal(linear, name=k) for k in "de"},
        }
        self.xk, self.yk = Signal(coordinate, name="xk"), Signal(coordinate, name="yk")
        self.clockwise = Signal()
        self.turns = Signal(TURNS_BITS)
        self.backward = {a: Signal(name=f"backward_{a}") for a in "xy"}
        self.fresh = Signal()
        self.scale = Signal((derivative_bits(width) - 1).bit_length())
        self.held = Signal()
        self.fault = Signal(ErrorCode)
        self.tick = Signal(range(n + 4), name="tick")

        bits = derivative_bits(width)
        self.normalizer = Normalizer(bits, 5, signed=True)
        #: Of the axis that is added to first, and of the other one.
        self.adders = tuple(StepAdder(bits + 1, bits - 1 + guard) for _ in range(2))
        lanes = zip(("gx", "gy", "2a", "b", "2c"), "xyzab", strict=True)
        self.intermediates = {
            **({"limit": self.normalizer.limit} if self.ordered else {}),
            "places": self.normalizer.places,
            **{f"scaled_{name}": self.normalizer.normalized[lane] for name, lane in lanes},
            **{
                f"{which}_{name}": signal
                for which, adder in zip(("first", "second"), self.adders, strict=True)
                for name, signal in (
                    ("velocity", adder.velocity),
                    ("change", adder.change),
                    ("total", adder.total),
                    ("step", adder.step),
                    ("own", adder.own),
                    ("carried", adder.carried),
                    ("unlimited", adder.unlimited),
                    ("rest", adder.rest),
                )
            },
        }

        out, uu = self.output, self.uu
        groups = {
            "P1, P2 coordinates": [self.p1, self.p2],
            "GX, GY derivatives": [self.gx, self.gy],
            "SX, SY summators": [self.sx, self.sy],
            "P3, P4 steps left": [self.p3.register, self.p4.register],
            "XT, YT position": [self.xt.register, self.yt.register],
            "scale converters": [*self.coefficients.values()],
            "pieces": [
                self.turns,
                *self.backward.values(),
                *([self.fresh, self.scale] if self.ordered else []),
                self.clockwise,
                self.xk,
                self.yk,
            ],
            "УУ": [uu.running, uu.done_register, uu.error_register],
            "step that waits": [*out.pulse_registers.values(), *out.direction_registers.values()],
            "prepared block": [self.held, self.fault, self.tick],
        }
        self.diagram: dict[str, list[Signal]] = {
            title: [Value.cast(register) for register in group] for title, group in groups.items()
        }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        out, uu = self.output, self.uu
        p1, p2, p3, p4 = self.p1, self.p2, self.p3, self.p4
        m.submodules.uu = uu
        m.submodules.output = out
        m.submodules.p3_counter = p3
        m.submodules.p4_counter = p4
        m.submodules.xt_register = self.xt
        m.submodules.yt_register = self.yt
        accept, empty = Signal(), Signal()
        m.d.comb += [
            # A block is prepared in the registers it runs in: when they are free.
            self.blocks.ready.eq(~self.held & uu.idle),
            accept.eq(self.blocks.valid & self.blocks.ready),
            uu.pending.eq(self.held & (self.tick == 0)),
            uu.fault.eq(self.fault),
            uu.empty.eq(empty),
            uu.waiting.eq(out.waiting),
            uu.ready.eq(self.steps.ready),
            self.steps.valid.eq(out.waiting),
            self.steps.payload.last.eq(uu.last),
            self.busy.eq(self.held | uu.busy),
            self.done.eq(uu.done),
            self.error.eq(uu.error),
        ]
        with m.If(accept):
            m.d.sync += self.held.eq(1)
        with m.Elif(uu.start):
            m.d.sync += self.held.eq(0)

        # Which way each axis would go now, and whether that is the way of the piece.
        cw = self.clockwise
        direction = out.direction_registers
        piece = {k: direction[k] ^ self.backward[k] for k in "xy"}
        below = {
            "x": Mux(cw, self.gy < 0, self.gy > 0),
            "y": Mux(cw, self.gx > 0, self.gx < 0),
        }
        still = {"x": self.gy == 0, "y": self.gx == 0}
        goes = {k: ~still[k] & (below[k] == piece[k]) for k in "xy"}
        left = {"x": ~p3.zero, "y": ~p4.zero}
        able = {k: left[k] & ~self.backward[k] & goes[k] for k in "xy"}
        # The axis that speeds up; the other one slows down, stops, and goes back.
        x_first = Signal()
        m.d.comb += x_first.eq(piece["x"] ^ piece["y"] ^ cw)

        # A clock pulse of УУ turns an axis round, or sums.
        turn, add, dead, complete = (
            Signal(name=name) for name in ("turn", "add", "dead", "complete")
        )
        last, entering = Signal(name="last_piece"), Signal()
        m.d.comb += [
            last.eq(self.turns == 0),
            entering.eq(self.turns == 1),
            dead.eq(~able["x"] & ~able["y"]),
            turn.eq(uu.clock & ~last & (dead | ~Mux(x_first, goes["y"], goes["x"]))),
            add.eq(uu.clock & ~turn),
            complete.eq(add & last & dead),
        ]
        with m.If(turn):
            m.d.sync += self.turns.eq(self.turns - 1)

        # Steps: carries and borrows, or what is left when there can be no more of them.
        hit = self._sum(m, x_first, piece, able, add)
        step = {k: hit[k] | (complete & left[k]) for k in "xy"}
        moves = {}
        for k in "xy":
            moves[k] = Signal(signed(2), name=f"move_{k}")
            m.d.comb += [
                moves[k].eq(Cat(step[k], step[k] & direction[k])),
                out.carry[k].eq(step[k]),
                self.steps.payload[k].eq(out.step[k]),
            ]
        with m.If(add):
            m.d.sync += [p1.eq(p1 + moves["x"]), p2.eq(p2 + moves["y"])]
        m.d.comb += [
            out.clock.eq(uu.clock),
            out.taken.eq(uu.taken),
            out.load.eq(uu.load | turn),
        ]
        self._prepare(m, accept, empty, moves)

        # What a block and a change of direction load: the way to go, and how far.
        first = {
            "x": Mux(still["x"], ~below["y"] ^ cw, below["x"]),
            "y": Mux(still["y"], below["x"] ^ cw, below["y"]),
        }
        slows = {"x": ~x_first, "y": x_first}
        final = Mux(uu.load, last, entering)
        falling = self.modulus - 1 - self.initial_sum
        here, lands = {}, {}
        for k, p, end, count, s, t in (
            ("x", p1, self.xk, p3, self.sx, self.xt),
            ("y", p2, self.yk, p4, self.sy, self.yt),
        ):
            way = Signal(signed(self.width + 2), name=f"way_{k}")
            ahead, back = Signal(name=f"ahead_{k}"), Signal(name=f"back_{k}")
            # As far as the coordinates go, upwards or downwards.
            room = Mux(ahead, Cat(p[:-1], ~p[-1]), Cat(~p[:-1], p[-1]))
            m.d.comb += [
                way.eq(end - p),
                ahead.eq(Mux(uu.load, first[k], piece[k] ^ slows[k])),
                back.eq(final & (way != 0) & ((way < 0) != ahead)),
                out.negative[k].eq(ahead ^ back),
                count.load.eq(out.load),
                count.initial.eq(Mux(final, Mux(way < 0, -way, way), room)),
                count.count.eq(step[k]),
                t.load.eq(uu.load),
                t.initial.eq(p),
                t.up.eq(out.up[k]),
                t.down.eq(out.down[k]),
                self.position[k].eq(t.register),
            ]
            with m.If(out.load):
                m.d.sync += self.backward[k].eq(back)
            here[k] = way == 0
            lands[k] = Mux(step[k], way == Mux(direction[k], -1, 1), here[k])
            with m.If(uu.load):
                m.d.sync += s.eq(Mux(ahead, falling, self.initial_sum))

        # A step that lands on the end with one change of direction to come is the last one too:
        # after the change there would be no step left to be the last.
        arrived = Signal()
        m.d.comb += [
            empty.eq(last & here["x"] & here["y"]),
            arrived.eq(add & (step["x"] | step["y"]) & (last | entering) & lands["x"] & lands["y"]),
            uu.stepless.eq(turn & entering & here["x"] & here["y"]),
            uu.ending.eq(arrived | uu.stepless),
        ]
        return m

    def _prepare(self, m: Module, accept, empty, moves) -> None:
        """Multiply the start by the coefficients, bit by bit, while its coordinates turn round."""
        n = self.width
        block = self.blocks.payload
        a, b, c, d, e = self.coefficients.values()
        p1, p2, gx, gy, tick = self.p1, self.p2, self.gx, self.gy, self.tick
        multiply = Signal()
        m.d.comb += multiply.eq((tick != 0) & (tick < n + 2))
        size, bend = Signal(2 * n + 8), Signal(n + 6)
        m.d.comb += [
            size.eq(abs(gx) + abs(gy)),
            bend.eq(abs(a) + abs(b) + abs(c)),
        ]
        with m.If(accept):
            m.d.sync += [
                *[self.coefficients[k].eq(block[k]) for k in "abcde"],
                p1.eq(block.start.x),
                p2.eq(block.start.y),
                self.xk.eq(block.end.x),
                self.yk.eq(block.end.y),
                self.clockwise.eq(block.clockwise),
                self.turns.eq(block.turns),
                self.fault.eq(ErrorCode.NONE),
                tick.eq(1),
            ]
        with m.Elif(tick == n + 3):
            m.d.sync += tick.eq(0)
            with m.If(~empty & ((size < 4 * bend) | (size == 0))):
                m.d.sync += self.fault.eq(ErrorCode.SHARP)
        with m.Elif(tick != 0):
            m.d.sync += tick.eq(tick + 1)
            with m.If(multiply):
                m.d.sync += [p1.eq(p1.rotate_left(1)), p2.eq(p2.rotate_left(1))]
        scales = {"x": (a << 1, b, d), "y": (b, c << 1, e)}
        for k, converter in self.converter.items():
            m.submodules[f"g{k}_converter"] = converter
            x_scale, y_scale, rest = scales[k]
            m.d.comb += [
                converter.x_scale.eq(x_scale),
                converter.y_scale.eq(y_scale),
                converter.rest.eq(rest),
                converter.clear.eq(accept),
                converter.multiply.eq(multiply),
                converter.sign.eq(tick == 1),
                converter.x_bit.eq(p1[n]),
                converter.y_bit.eq(p2[n]),
                converter.add.eq(tick == n + 2),
                converter.move.eq(moves["x"].any() | moves["y"].any()),
                converter.x_step.eq(moves["x"]),
                converter.y_step.eq(moves["y"]),
            ]

    def _sum(self, m: Module, x_first, piece, able, add) -> dict[str, Value]:
        """Sum the velocities of both axes, in their order; give which axes step."""
        a, b, c = (self.coefficients[k] for k in "abc")
        cw, bits = self.clockwise, derivative_bits(self.width)
        m.submodules.normalizer = normalizer = self.normalizer
        # An axis that does not go must not hold the other one up.
        lanes = (Mux(able["y"], self.gx, 0), Mux(able["x"], self.gy, 0), a << 1, b, c << 1)
        for lane, value in zip("xyzab", lanes, strict=True):
            m.d.comb += normalizer.increments[lane].eq(value)
        big_gx, big_gy, big_a, big_b, big_c = (normalizer.normalized[k] for k in "xyzab")
        velocity = {k: Signal(signed(bits + 1), name=f"velocity_{k}") for k in "xy"}
        m.d.comb += [
            velocity["x"].eq(Mux(cw, big_gy, -big_gy)),
            velocity["y"].eq(Mux(cw, -big_gx, big_gx)),
        ]

        # The axis that is added to first, and the other one: x and y, or with ``swap`` y and x.
        swap = Signal()
        sums = {"x": self.sx, "y": self.sy}
        m.submodules.first_adder, m.submodules.second_adder = earlier, later = self.adders
        for adder, is_y in ((earlier, swap), (later, ~swap)):
            mine = Signal(name="mine")
            m.d.comb += [
                adder.sum.eq(Mux(is_y, sums["y"], sums["x"])),
                adder.velocity.eq(Mux(is_y, velocity["y"], velocity["x"])),
                adder.down.eq(Mux(is_y, piece["y"], piece["x"])),
                mine.eq(Mux(is_y, able["y"], able["x"])),
                adder.enable.eq(add & mine),
            ]
            with m.If(adder.enable & ~is_y):
                m.d.sync += sums["x"].eq(adder.rest)
            with m.If(adder.enable & is_y):
                m.d.sync += sums["y"].eq(adder.rest)
        if self.ordered:
            # What steps change in the velocity of the second axis: that is y' = Gx, or x' = −Gy.
            opposite = swap ^ cw
            cross = times(earlier.step, Mux(swap, big_c, big_a))
            m.d.comb += [swap.eq(~x_first), later.change.eq(Mux(opposite, -cross, cross))]
            if self.order == "implicit":
                m.d.comb += later.own.eq(Mux(opposite, -big_b, big_b))
            self._centre(m, Mux(swap, velocity["y"], velocity["x"]), able["x"] & able["y"], add)
        return {
            "x": Mux(swap, later.step[0], earlier.step[0]),
            "y": Mux(swap, earlier.step[0], later.step[0]),
        }

    def _centre(self, m: Module, velocity, both, add) -> None:
        """Limit the scale, and sum the first axis from the middle of a summation to the next one's.

        The scale falls where the curve is faster and does not rise again, so that ellipses come to
        one scale, with which they do not drift. A single axis has no ratio to keep.
        """
        a, b, c = (self.coefficients[k] for k in "abc")
        limit, places = self.normalizer.limit, self.normalizer.places
        change = self.adders[0].change
        circle, line, none = Signal(), Signal(), ~Const(0, len(limit))
        m.d.comb += [
            circle.eq((b == 0) & (a == c)),
            line.eq(circle & (a == 0)),
            limit.eq(Mux(self.fresh | circle | ~both, none, self.scale)),
        ]
        with m.If(self.fresh):
            if self.preload == "half":
                m.d.comb += change.eq(Mux(line, 0, -(velocity >> 1)))
        with m.Elif((limit != none) & (limit == places + 1)):
            m.d.comb += change.eq(velocity >> 1)
        with m.If(self.uu.load):
            m.d.sync += self.fresh.eq(1)
        with m.Elif(add):
            m.d.sync += [self.fresh.eq(0), self.scale.eq(Mux(both, places, none))]
