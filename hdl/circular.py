"""The circular interpolator: two cross-coupled summators in the first quadrant."""

from typing import Any, ClassVar

from amaranth import Cat, Module, Mux, Signal, Value
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.arc_input import TURNS_BITS, ArcInput, arc_block_layout
from discreta.hdl.contract import (
    ErrorCode,
    Part,
    check_choice,
    check_flag,
    check_guard,
    check_width,
    point_layout,
    step_layout,
)
from discreta.hdl.parts import (
    PRELOADS,
    ControlUnit,
    IncrementRegister,
    Normalizer,
    PositionRegister,
    RemainingCounter,
    Summator,
)
from discreta.hdl.quadrant import QuadrantOutput

__all__ = ["ORDERS", "Circular"]

ORDERS = ("alternated", "simultaneous")


class Circular(Part):
    """Draws an arc: each coordinate is summed to move the other; the carries are the steps.

    Computes, seen from the centre in the first quadrant and counter-clockwise, with M = 2^(n + g)
    and s the shift that brings the top bit of the larger of X and Y to its place (0 without
    ``normalize``), at every summation::

        SX := SX + Y·2^s; on carry X := X − 1
        SY := SY + X·2^s; on carry Y := Y + 1

    which is x' = −ky, y' = kx. In order ``simultaneous`` SY adds the X from before the summation,
    in order ``alternated`` the one after it. The summators start from the preload, 0 or M/2;
    alternated with preload M/2, SX starts from M/2 − ⌊Y·2^s / 2⌋ instead, since X is half a
    summation behind Y from then on.

    Registers: P1, P2 = X, Y now, seen from the centre in the quadrant of the moment, which is
    turned onto the first; P3, P4 = steps left of X and of Y in this quadrant; SX, SY; XT, YT =
    coordinates now; ``turns`` = axis crossings to come; XK, YK = the end, seen as X and Y are in
    its own quadrant.

    An arc of more than one quadrant is run piece by piece. When X has come to 0 with crossings to
    come, one clock turns the frame by a right angle: P1 := P2, P2 := 0, SY := SX, and SX := M − 1 −
    SY, since the axis that rose now falls and its fraction is counted the other way. P3 and P4 are
    loaded: for a piece that ends on an axis with X and ``limit`` = ⌊R⌋ + 1, beyond which no axis
    rises; for the last piece with \\|X − XK\\| and YK. Should X be below XK there, it is
    ``backward`` and stands still.

    An axis with no steps left stops. The block ends when none has any. When none of those left
    would move any more, because its addend is 0 or it is ``backward``, what is left is put out as
    completing steps, one of an axis a clock: a block always ends on its end point.

    Latency: a block accepted in clock 0 is prepared from clock 0 to 2n + 4 and started in clock 2n
    + 5; with order alternated and preload M/2 clock 2n + 6 takes the half increment off SX; then
    it is summed. A carry is a step in the next clock. ``done`` follows the last step by a clock.

    Throughput: one summation a clock, one clock for every axis crossing. A turn of radius R takes
    about 2π·2^(n + g) summations, with ``normalize`` between π and 2π times 2^(bitlen(R) + g). The
    next block is prepared while this one runs and is started in the very clock in which the last
    step is taken, if 2n + 5 clocks have gone since its acceptance. A block of no length (start =
    end = centre) and a rejected block take one clock, and one more behind a block that moved.

    Steps: ``steps`` holds a step until it is taken and everything waits for it. ``position`` shows
    the steps taken, not the one that waits; starting a block loads it with the block's start.

    Reset: everything 0, nothing held, position at the origin.

    Overflow: ``error`` is ``RANGE`` or ``OFF_CURVE`` for one clock, in place of ``done``, for an
    arc that does not fit or whose end is more than one step off the circle of its start (see
    :class:`~discreta.hdl.arc_input.ArcInput`); nothing moves and the next block runs as ever. No
    summation carries more than once, since the increments are below 2^n ≤ M.

    Error bound: none is proven. Measured over every radius of 8, 10 and 12 bits, quarter arcs are
    off the circle by at most 1.81 steps (simultaneous, preload 0), 1.28 (simultaneous, M/2), 1.48
    (alternated, 0), 0.96 (alternated, M/2), without guard bits; see docs/circular.md. The end point
    is exact.

    Source: lecture, circular interpolation, steps 1–10, with X decremented in step 9.1 (the printed
    + 1 contradicts DX = XH − XK and x' = −ky), and the constant k. Order, preload, guard bits, the
    pieces, the limit and the completing steps are ours.

    Parameters
    ----------
    width : int
        n, 4 to 32. Coordinates are signed, n + 1 bits; steps are 1 long.
    order : str
        ``"alternated"`` or ``"simultaneous"``.
    normalize : bool
        Shift X and Y left together before every summation.
    preload : str
        What the summators start from: ``"zero"`` or ``"half"`` (of M).
    guard : int
        g, 0 to 4: bits that the summators have below those of the coordinates.

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

    notation = "n = width, g = guard, M = 2^(n + g)"

    LECTURE: ClassVar[dict[str, Any]] = {
        "order": "simultaneous",
        "normalize": False,
        "preload": "zero",
        "guard": 0,
    }

    def __init__(
        self,
        width: int = 16,
        *,
        order: str = "alternated",
        normalize: bool = True,
        preload: str = "half",
        guard: int = 2,
    ):
        check_width(width)
        check_choice("order", order, ORDERS)
        check_flag("normalize", normalize)
        check_choice("preload", preload, PRELOADS)
        check_guard(guard)
        super().__init__(
            {
                "blocks": In(stream.Signature(arc_block_layout(width))),
                "steps": Out(stream.Signature(step_layout(2))),
                "position": Out(point_layout(width, 2)),
                "busy": Out(1),
                "done": Out(1),
                "error": Out(ErrorCode),
            }
        )
        self.width = width
        self.order = order
        self.normalize = normalize
        self.preload = preload
        self.guard = guard
        self.parameters: dict[str, object] = {
            "width": width,
            "order": order,
            "normalize": normalize,
            "preload": preload,
            "guard": guard,
        }
        self.halves = order == "alternated" and preload == "half"

        self.input = ArcInput(width)
        self.uu = ControlUnit()
        self.output = QuadrantOutput(2)
        self.p1 = PositionRegister(width, magnitude=True, name="p1")
        self.p2 = PositionRegister(width, magnitude=True, name="p2")
        self.p3 = RemainingCounter(width, name="p3")
        self.p4 = RemainingCounter(width, name="p4")
        self.sx = Summator(width, guard=guard, preload=preload, name="sx")
        self.sy = Summator(width, guard=guard, preload=preload, name="sy")
        self.xt = PositionRegister(width, name="xt")
        self.yt = PositionRegister(width, name="yt")
        self.xk = IncrementRegister(width, name="xk")
        self.yk = IncrementRegister(width, name="yk")
        self.limit = IncrementRegister(width, name="limit")
        self.turns = Signal(TURNS_BITS)
        self.swap = Signal()
        self.backward = Signal()
        self.fresh = Signal()

        inp, out, uu = self.input, self.output, self.uu
        meter = inp.meter
        groups = {
            "P1, P2 coordinates seen from the centre": [self.p1.register, self.p2.register],
            "SX, SY summators": [self.sx.register, self.sy.register],
            "P3, P4 steps left": [self.p3.register, self.p4.register],
            "XT, YT position": [self.xt.register, self.yt.register],
            "pieces": [
                self.turns,
                self.swap,
                self.backward,
                *([self.fresh] if self.halves else []),
                self.xk.register,
                self.yk.register,
                self.limit.register,
            ],
            "УУ": [uu.running, uu.done_register, uu.error_register],
            "step that waits": [*out.pulse_registers.values(), *out.direction_registers.values()],
            "prepared block": [
                inp.held_register,
                inp.fault_register,
                inp.empty_register,
                *inp.start_registers.values(),
                *inp.center_registers.values(),
                inp.swap_register,
                *inp.negative_registers.values(),
                inp.turns_register,
            ],
            "radius meter": [
                meter.tick,
                meter.mask,
                *meter.start_registers.values(),
                *meter.end_registers.values(),
                meter.start_square,
                meter.end_square,
                meter.rest,
                meter.root_register,
            ],
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
        inp, out, uu = self.input, self.output, self.uu
        p1, p2, p3, p4, sx, sy = self.p1, self.p2, self.p3, self.p4, self.sx, self.sy
        xt, yt, xk, yk, limit = self.xt, self.yt, self.xk, self.yk, self.limit
        m.submodules.input = inp
        m.submodules.uu = uu
        m.submodules.output = out
        m.submodules.p1_register = p1
        m.submodules.p2_register = p2
        m.submodules.p3_counter = p3
        m.submodules.p4_counter = p4
        m.submodules.sx_summator = sx
        m.submodules.sy_summator = sy
        m.submodules.xt_register = xt
        m.submodules.yt_register = yt
        m.submodules.xk_register = xk
        m.submodules.yk_register = yk
        m.submodules.limit_register = limit
        m.d.comb += [
            inp.blocks.payload.eq(self.blocks.payload),
            inp.blocks.valid.eq(self.blocks.valid),
            self.blocks.ready.eq(inp.blocks.ready),
            inp.take.eq(uu.start),
            uu.pending.eq(inp.pending),
            uu.fault.eq(inp.fault),
            uu.empty.eq(inp.empty),
            uu.waiting.eq(out.waiting),
            uu.ready.eq(self.steps.ready),
            self.steps.valid.eq(out.waiting),
            self.steps.payload.last.eq(uu.last),
            self.busy.eq(inp.held | uu.busy),
            self.done.eq(uu.done),
            self.error.eq(uu.error),
        ]

        # A clock pulse of УУ takes off the half increment, turns the frame, or sums.
        whole, halve, turn, add, last, dead, complete = (
            Signal(name=name)
            for name in ("whole", "halve", "turn", "add", "last_piece", "dead", "complete")
        )
        m.d.comb += [
            last.eq(self.turns == 0),
            halve.eq(uu.clock & self.fresh),
            whole.eq(uu.clock & ~self.fresh),
            turn.eq(whole & ~last & p3.zero),
            add.eq(whole & ~turn),
            dead.eq(
                last
                & (p3.zero | self.backward | (p2.register == 0))
                & (p4.zero | (p1.register == 0))
            ),
            complete.eq(add & dead),
        ]
        if self.halves:
            with m.If(uu.load):
                m.d.sync += self.fresh.eq(1)
            with m.Elif(uu.clock):
                m.d.sync += self.fresh.eq(0)

        # The summators, each with the other axis's coordinate.
        coordinates = [p1.register, p2.register]
        if self.order == "alternated":
            # X − 1 is never the largest: it is shifted along and changes nothing.
            lower = Signal(self.width)
            m.d.comb += lower.eq(Mux(p1.register == 0, 0, p1.register - 1))
            coordinates.append(lower)
        if self.normalize:
            m.submodules.normalizer = normalizer = Normalizer(self.width, len(coordinates))
            m.d.comb += normalizer.increments.as_value().eq(Cat(coordinates))
            coordinates = [normalizer.normalized[a] for a in "xyz"[: len(coordinates)]]
        x, y, *lowered = coordinates
        half_increment = (y >> 1) if self.halves else 0
        m.d.comb += [
            sx.addend.eq(y),
            sx.enable.eq(add & ~p3.zero & ~self.backward),
            sx.load.eq(uu.load | turn | halve),
            sx.initial.eq(Mux(turn, ~sy.register, sx.preloaded - half_increment)),
            sy.addend.eq(Mux(sx.carry, lowered[0], x) if lowered else x),
            sy.enable.eq(add & ~p4.zero),
            sy.load.eq(uu.load | turn),
            sy.initial.eq(Mux(turn, sx.register, sy.preloaded)),
        ]
        if self.halves:
            with m.If(uu.load):
                m.d.comb += sx.initial.eq(sx.preloaded)

        # Steps: carries, or what is left when there can be no more carries.
        step_x, step_y = Signal(name="step_x"), Signal(name="step_y")
        m.d.comb += [
            step_x.eq(sx.carry | (complete & ~p3.zero)),
            step_y.eq(sy.carry | (complete & ~p4.zero)),
            p1.down.eq(step_x & ~self.backward),
            p1.up.eq(step_x & self.backward),
            p2.up.eq(step_y),
            p3.count.eq(step_x),
            p4.count.eq(step_y),
            uu.ending.eq(last & p3.ending & p4.ending),
        ]

        # What a block, and what a turn of the frame loads.
        entering = Signal()
        short = Signal()
        m.d.comb += [
            entering.eq(self.turns == 1),
            short.eq(p2.register < xk.register),
            Cat(p1.load, p2.load, p3.load, p4.load).eq((uu.load | turn).replicate(4)),
            Cat(xt.load, yt.load, xk.load, yk.load, limit.load).eq(uu.load.replicate(5)),
            xt.initial.eq(inp.start.x),
            yt.initial.eq(inp.start.y),
            xk.initial.eq(inp.to_xy.x),
            yk.initial.eq(inp.to_xy.y),
            limit.initial.eq(inp.limit),
        ]
        one_piece = Signal()
        m.d.comb += one_piece.eq(inp.first_turns == 0)
        with m.If(uu.load):
            m.d.comb += [
                p1.initial.eq(inp.from_xy.x),
                p2.initial.eq(inp.from_xy.y),
                p3.initial.eq(inp.from_xy.x - Mux(one_piece, inp.to_xy.x, 0)),
                p4.initial.eq(Mux(one_piece, inp.to_xy.y, inp.limit) - inp.from_xy.y),
            ]
            m.d.sync += [
                self.turns.eq(inp.first_turns),
                self.swap.eq(inp.first_swap),
                self.backward.eq(0),
            ]
        with m.Else():
            left = Mux(short, xk.register - p2.register, p2.register - xk.register)
            m.d.comb += [
                p1.initial.eq(p2.register),
                p2.initial.eq(0),
                p3.initial.eq(Mux(entering, left, p2.register)),
                p4.initial.eq(Mux(entering, yk.register, limit.register)),
            ]
            with m.If(turn):
                m.d.sync += [
                    self.turns.eq(self.turns - 1),
                    self.swap.eq(~self.swap),
                    self.backward.eq(entering & short),
                ]

        # Output processing: X and Y are the machine's axes, or with swap the other way round.
        x_now, y_now = out.direction_registers["x"], out.direction_registers["y"]
        other_way = ~(entering & short)
        m.d.comb += [
            out.load.eq(uu.load | turn),
            # The axis that rose falls now, and so goes the other way.
            out.negative.x.eq(Mux(uu.load, inp.negative.x, x_now ^ (self.swap & other_way))),
            out.negative.y.eq(Mux(uu.load, inp.negative.y, y_now ^ (~self.swap & other_way))),
            out.clock.eq(uu.clock),
            out.carry.x.eq(Mux(self.swap, step_y, step_x)),
            out.carry.y.eq(Mux(self.swap, step_x, step_y)),
            out.taken.eq(uu.taken),
            xt.up.eq(out.up.x),
            xt.down.eq(out.down.x),
            yt.up.eq(out.up.y),
            yt.down.eq(out.down.y),
            self.steps.payload.x.eq(out.step.x),
            self.steps.payload.y.eq(out.step.y),
            self.position.x.eq(xt.register),
            self.position.y.eq(yt.register),
        ]
        return m
