"""The interpolator of curves of the second order: two derivatives, summed with carry and borrow."""

from typing import ClassVar

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
from discreta.hdl.parts import PRELOADS, ControlUnit, Normalizer, ScaleConverter
from discreta.hdl.parts.scale_converter import (
    coefficient_bits,
    derivative_bits,
    linear_bits,
    times,
)
from discreta.hdl.quadrant import QuadrantOutput

__all__ = ["ORDERS", "TURNS_BITS", "Conic", "conic_block_layout"]

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
    falls. With M/2, and not in order simultaneous, half of the first increment is taken off the sum
    that is added to first, unless the curve is a straight line.

    Scale: before every summation Gx, Gy and with them 2A, B, 2C are shifted left together until one
    has its top bit set. A derivative of which the axis does not go counts as 0 there.

    Registers: P1, P2 = x, y; GX, GY; SX, SY; P3, P4 = steps left of x and y in this piece (in the
    last one those to the end, before it those to the edge of the coordinates); A…E; XT, YT =
    coordinates now; ``turns``; XK, YK = the end.

    The end: on entering the last piece the counters are loaded with the way to the end. An axis for
    which that leads back has overshot, is ``backward`` and stands still. The block ends when no
    steps are left. When none of those left would move any more, they are put out as completing
    steps, one of an axis a clock: a block always ends on its end point.

    Latency: a block accepted in clock 0 is prepared from clock 1 to n + 3, started in clock n + 4
    and summed from the clock after (with the half increment from the one after that). A carry is a
    step in the next clock. ``done`` follows the last step by a clock.

    Throughput: one summation a clock, and one clock for every change of direction. Blocks are
    accepted when nothing runs or waits: n + 5 clocks lie between the last step of one and the first
    summation of the next.

    Steps: ``steps`` holds a step until it is taken and everything waits for it. ``position`` shows
    the steps taken, not the one that waits; starting a block loads it with the block's start.

    Reset: everything 0, nothing held, position at the origin.

    Overflow: none: with coefficients of n + 4 and 2n + 5 bits the derivatives have 2n + 7 bits, and
    no axis goes beyond −2^n … 2^n − 1. ``error`` is ``SHARP`` for one clock, in place of ``done``,
    when both derivatives are 0 at the start, or \|Gx\| + \|Gy\| < 4·(\|A\| + \|B\| + \|C\|): the
    radius of curvature may be below two steps there. Nothing moves and the next block runs as ever.

    Error bound: none is proven; see docs/conic.md for what was measured.

    Source: lecture, general curve and its block diagram (with x'/y' = −(Bx + 2Cy + E)/(2Ax + By +
    D); the printed By and the missing sign are errata). Order, pieces, preload, guard bits and the
    end are ours.

    Parameters
    ----------
    width : int
        n, 4 to 32. Coordinates are signed, n + 1 bits; steps are 1 long.
    order : str
        ``"implicit"``, ``"alternated"`` or ``"simultaneous"``.
    preload : str
        What the summators start from: ``"zero"`` or ``"half"`` (of M).
    guard : int
        g, 0 to 4: each bit halves the increments and doubles the clocks.

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

    LECTURE: ClassVar[dict[str, object]] = {"order": "simultaneous", "preload": "zero", "guard": 0}

    def __init__(
        self, width: int = 16, *, order: str = "implicit", preload: str = "half", guard: int = 2
    ):
        check_width(width)
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
        self.halves = order != "simultaneous" and preload == "half"
        n, w = width, derivative_bits(width)
        coordinate = signed(n + 1)
        sum_shape = signed(w + guard + 1)
        self.modulus = 1 << (w - 1 + guard)
        self.initial_sum = self.modulus // 2 if preload == "half" else 0
        self.uu = ControlUnit()
        self.output = QuadrantOutput(2)
        self.p1, self.p2 = Signal(coordinate, name="p1"), Signal(coordinate, name="p2")
        self.p3, self.p4 = Signal(n + 1, name="p3"), Signal(n + 1, name="p4")
        self.sx = Signal(sum_shape, name="sx", init=self.initial_sum)
        self.sy = Signal(sum_shape, name="sy", init=self.initial_sum)
        self.converter = {a: ScaleConverter(width, name=f"g{a}") for a in "xy"}
        self.gx, self.gy = (converter.register for converter in self.converter.values())
        self.xt, self.yt = Signal(coordinate, name="xt"), Signal(coordinate, name="yt")
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
        self.held = Signal()
        self.fault = Signal(ErrorCode)
        self.tick = Signal(range(n + 4), name="tick")

        out, uu = self.output, self.uu
        groups = {
            "P1, P2 coordinates": [self.p1, self.p2],
            "GX, GY derivatives": [self.gx, self.gy],
            "SX, SY summators": [self.sx, self.sy],
            "P3, P4 steps left": [self.p3, self.p4],
            "XT, YT position": [self.xt, self.yt],
            "scale converters": [*self.coefficients.values()],
            "pieces": [
                self.turns,
                *self.backward.values(),
                *([self.fresh] if self.halves else []),
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
        n = self.width
        out, uu = self.output, self.uu
        m.submodules.uu = uu
        m.submodules.output = out
        p1, p2, p3, p4, sx, sy, gx, gy = (
            *(self.p1, self.p2, self.p3, self.p4),
            *(self.sx, self.sy, self.gx, self.gy),
        )
        cw = self.clockwise
        accept, empty, pending = Signal(), Signal(), Signal()
        m.d.comb += [
            # A block is prepared in the registers it runs in: when they are free.
            self.blocks.ready.eq(~self.held & uu.idle),
            accept.eq(self.blocks.valid & self.blocks.ready),
            empty.eq((self.turns == 0) & (p1 == self.xk) & (p2 == self.yk)),
            pending.eq(self.held & (self.tick == 0)),
            uu.pending.eq(pending),
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
        # The velocities' signs, and the axis that is summed first: the other one slows down.
        direction = out.direction_registers
        piece = {k: direction[k] ^ self.backward[k] for k in "xy"}
        below = {"x": Mux(cw, gy < 0, gy > 0), "y": Mux(cw, gx > 0, gx < 0)}
        moves = {
            "x": (gy != 0) & (below["x"] == piece["x"]),
            "y": (gx != 0) & (below["y"] == piece["y"]),
        }
        x_first = Signal()
        m.d.comb += x_first.eq(piece["x"] ^ piece["y"] ^ cw)
        last, whole, halve, turn, add, dead, complete = (
            Signal(name=name)
            for name in ("last_piece", "whole", "halve", "turn", "add", "dead", "complete")
        )
        left = {"x": p3 != 0, "y": p4 != 0}
        able = {k: left[k] & ~self.backward[k] & moves[k] for k in "xy"}
        m.d.comb += [
            last.eq(self.turns == 0),
            halve.eq(uu.clock & self.fresh),
            whole.eq(uu.clock & ~self.fresh),
            dead.eq(~able["x"] & ~able["y"]),
            turn.eq(whole & ~last & (dead | ~Mux(x_first, moves["y"], moves["x"]))),
            add.eq(whole & ~turn),
            complete.eq(add & last & dead),
        ]
        if self.halves:
            with m.If(uu.load):
                m.d.sync += self.fresh.eq(1)
            with m.Elif(uu.clock):
                m.d.sync += self.fresh.eq(0)

        step = self._sum(m, x_first, piece, able, add, halve)
        step = {
            "x": step["x"] | (complete & left["x"]),
            "y": step["y"] | (complete & left["y"]),
        }
        delta = {}
        for k in "xy":
            delta[k] = Signal(signed(2), name=f"delta_{k}")
            m.d.comb += delta[k].eq(Cat(step[k], step[k] & direction[k]))
        with m.If(add):
            m.d.sync += [
                p1.eq(p1 + delta["x"]),
                p2.eq(p2 + delta["y"]),
                p3.eq(p3 - step["x"]),
                p4.eq(p4 - step["y"]),
            ]
        with m.If(turn):
            m.d.sync += self.turns.eq(self.turns - 1)
        self._prepare(m, accept, empty, add, delta)

        # What a block and a change of direction load: the way to go, and how far.
        first = {
            "x": Mux(gy == 0, ~below["y"] ^ cw, below["x"]),
            "y": Mux(gx == 0, below["x"] ^ cw, below["y"]),
        }
        slows = {"x": ~x_first, "y": x_first}
        ahead = {}
        for k in "xy":
            ahead[k] = Signal(name=f"ahead_{k}")
            m.d.comb += ahead[k].eq(Mux(uu.load, first[k], piece[k] ^ slows[k]))
        final = Signal()
        m.d.comb += [
            final.eq(Mux(uu.load, last, self.turns == 1)),
            out.load.eq(uu.load | turn),
        ]
        for k, p, end, count in (("x", p1, self.xk, p3), ("y", p2, self.yk, p4)):
            way = Signal(signed(n + 2), name=f"way_{k}")
            back = Signal(name=f"back_{k}")
            room = Cat(p[:n], ~p[n])
            m.d.comb += [
                way.eq(end - p),
                back.eq(final & (way != 0) & ((way < 0) != ahead[k])),
                out.negative[k].eq(ahead[k] ^ back),
            ]
            with m.If(out.load):
                m.d.sync += [
                    self.backward[k].eq(back),
                    count.eq(Mux(final, Mux(way < 0, -way, way), Mux(ahead[k], room, ~room))),
                ]
        for k, s in (("x", sx), ("y", sy)):
            with m.If(uu.load):
                falling = self.modulus - 1 - self.initial_sum
                m.d.sync += s.eq(Mux(ahead[k], falling, self.initial_sum))
        for k, t, p in (("x", self.xt, p1), ("y", self.yt, p2)):
            with m.If(uu.load):
                m.d.sync += t.eq(p)
            with m.Elif(out.up[k]):
                m.d.sync += t.eq(t + 1)
            with m.Elif(out.down[k]):
                m.d.sync += t.eq(t - 1)
            m.d.comb += [
                self.position[k].eq(t),
                out.carry[k].eq(step[k]),
                self.steps.payload[k].eq(out.step[k]),
            ]
        m.d.comb += [
            uu.ending.eq(last & (p3 == step["x"]) & (p4 == step["y"])),
            out.clock.eq(uu.clock),
            out.taken.eq(uu.taken),
        ]
        with m.If(uu.start):
            m.d.sync += self.held.eq(0)
        with m.If(accept):
            m.d.sync += self.held.eq(1)
        return m

    def _prepare(self, m: Module, accept, empty, move, delta) -> None:
        """Multiply the start by the coefficients, bit by bit, while its coordinates turn round."""
        n = self.width
        block = self.blocks.payload
        a, b, c, d, e = self.coefficients.values()
        p1, p2, gx, gy, tick = self.p1, self.p2, self.gx, self.gy, self.tick
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
            size = Signal(2 * n + 9)
            bend = Signal(n + 7)
            m.d.comb += [
                size.eq(abs(gx) + abs(gy)),
                bend.eq(2 * (abs(a) + abs(b) + abs(c))),
            ]
            with m.If(~empty & ((size < 2 * bend) | (size == 0))):
                m.d.sync += self.fault.eq(ErrorCode.SHARP)
        with m.Elif(tick != 0):
            m.d.sync += tick.eq(tick + 1)
            with m.If(tick < n + 2):
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
                converter.multiply.eq((tick != 0) & (tick < n + 2)),
                converter.sign.eq(tick == 1),
                converter.x_bit.eq(p1[n]),
                converter.y_bit.eq(p2[n]),
                converter.add.eq(tick == n + 2),
                converter.move.eq(move),
                converter.x_step.eq(delta["x"]),
                converter.y_step.eq(delta["y"]),
            ]

    def _sum(self, m: Module, x_first, piece, able, add, halve) -> dict[str, Signal]:
        """Sum the velocities of both axes, in their order; give which axes step."""
        a, b, c = (self.coefficients[k] for k in "abc")
        cw, sx, sy = self.clockwise, self.sx, self.sy
        w = derivative_bits(self.width)
        m.submodules.normalizer = normalizer = Normalizer(w, 5, signed=True)
        # An axis that does not go must not hold the other one up.
        gx, gy = Mux(able["y"], self.gx, 0), Mux(able["x"], self.gy, 0)
        for lane, value in zip("xyzab", (gx, gy, a << 1, b, c << 1), strict=True):
            m.d.comb += normalizer.increments[lane].eq(value)
        big_gx, big_gy, big_a, big_b, big_c = (normalizer.normalized[k] for k in "xyzab")
        vx, vy = Signal(signed(w + 1)), Signal(signed(w + 1))
        m.d.comb += [vx.eq(Mux(cw, big_gy, -big_gy)), vy.eq(Mux(cw, -big_gx, big_gx))]

        # The first axis summed and the second: x and y, or with ``swap`` the other way round.
        ordered = self.order != "simultaneous"
        swap = ~x_first if ordered else Const(0, 1)
        change: Value = Const(0, 1)
        after, steps = [], []
        for number, is_y in enumerate((swap, ~swap)):
            down = Mux(is_y, piece["y"], piece["x"])
            can = add & Mux(is_y, able["y"], able["x"])
            total = Signal(signed(w + self.guard + 3), name=f"total_{number}")
            hit, step = Signal(name=f"hit_{number}"), Signal(signed(2), name=f"step_{number}")
            m.d.comb += [
                total.eq(Mux(is_y, sy, sx) + Mux(is_y, vy, vx) + change),
                hit.eq(can & Mux(down, total < 0, total >= self.modulus)),
                step.eq(Cat(hit, hit & down)),
            ]
            rest = total - times(step, Const(self.modulus))
            # What a step changes in the velocity of the second axis: that is y' = Gx, or x' = −Gy.
            other_way = swap ^ cw
            if number == 1 and self.order == "implicit":
                own = times(step, big_b)
                rest = rest + Mux(other_way, -own, own)
            after.append((can, rest))
            steps.append(hit)
            if ordered and number == 0:
                cross = times(step, Mux(swap, big_c, big_a))
                change = Mux(other_way, -cross, cross)
        for s, mine in ((sx, swap), (sy, ~swap)):
            (can_0, after_0), (can_1, after_1) = after
            with m.If(Mux(mine, can_1, can_0)):
                m.d.sync += s.eq(Mux(mine, after_1, after_0))
        step = {"x": Mux(swap, steps[1], steps[0]), "y": Mux(swap, steps[0], steps[1])}
        if self.halves:
            # On a straight line neither axis waits for the other.
            bent = (a != 0) | (b != 0) | (c != 0)
            with m.If(halve & bent & x_first):
                m.d.sync += sx.eq(sx - (vx >> 1))
            with m.If(halve & bent & ~x_first):
                m.d.sync += sy.eq(sy - (vy >> 1))
        return step
