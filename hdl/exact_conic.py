"""The exact interpolator of curves of the second order: a step every clock, from a residual."""

from amaranth import Cat, Module, Mux, Signal, Value
from amaranth.hdl import signed
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.conic import MAX_WIDTH, TURNS_BITS, conic_block_layout
from discreta.hdl.contract import ErrorCode, Part, check_width, point_layout, step_layout
from discreta.hdl.parts import ControlUnit, PositionRegister
from discreta.hdl.parts.scale_converter import coefficient_bits, derivative_bits, linear_bits
from discreta.hdl.quadrant import QuadrantOutput

__all__ = ["MAX_WIDTH", "ExactConic", "preparation_clocks"]


def preparation_clocks(width: int) -> int:
    """Give the clocks from the acceptance of a block to the one that may start it: n + 9."""
    return width + 9


class ExactConic(Part):
    r"""Draws any curve of the second order through the points of the grid nearest to it.

    The curve is F = A·x² + B·x·y + C·y² + D·x + E·y + F₀ = 0; F₀ follows from the start. Let u be
    the axis that is faster now and v the other one, both counted in the direction in which they go:
    a piece of the curve has one such frame. Let g and h be the derivatives of F by u and by v, α,
    β, γ the coefficients of u², u·v, v². A step leads to (1, 0) or to (1, 1), seen from the point
    (0, 0) that the curve is at. Which of them is nearer on the line u = 1 the sign of F in the
    middle between them tells, and that is all that is kept of F::

        residual = ⌊2·F(1, ½)⌋ = 2F + 2g + h + 2α + β + ⌊γ/2⌋
        axial    = 2g + 6α + β             what a step to (1, 0) adds to it
        across   = h + 2β + 2γ             half of what the step of v adds besides

        step:      residual += axial + (2·across if v steps)
                   axial    += 4α    + (2β       if v steps)
                   across   += β     + (2γ       if v steps)

    F is positive outside, on the side that the curve turns its back to: the coefficients must have
    the sign for which A·Gy² − B·Gx·Gy + C·Gx² is not negative; discreta.sim.conics makes such
    blocks. So v steps where it slows down if the residual is negative, and where it speeds up if it
    is not (``diagonal``). There is no multiplier.

    Frames: v speeds up until it is as fast as u, then it leads and the other one slows down, until
    it stands still and turns round. ``outer`` is what ``residual`` would be in the frame to come,
    moved along like it. When it says that the curve passes beside both candidates (``turning``),
    one clock without a step changes the frame: ``residual`` becomes ``outer``, and::

        v turns round:  outer  += α + ⌊α/2⌋ + 2β + ⌊β/2⌋ + 4γ − ⌊γ/2⌋ − ⌊axial/2⌋ − across
                        axial  −= 2β;  across := 4γ − across;  β := −β
        v leads:        outer  += 6α − β − axial
                        axial, across := 2·across + 2γ − 3β, ⌊axial/2⌋ + 2β − α − ⌊β/2⌋
                        α, γ := γ, α

    What these add is worked out in the clock after a change (``turn_outer``, ``turn_axial``,
    ``turn_across``). Should the next change follow at once, as it can where the radius of curvature
    is below 3.5 steps, it waits a clock (``fresh``).

    The end: with one change of direction to come or none, a point from which the end is a king's
    move away (or nothing) is the last but one; that move is the last step, with ``last``. A change
    of direction with none to come is not made. If the end turns out to lie two steps or more behind
    the last piece, or a step would leave −2^n … 2^n − 1, the block is ended with a late ``error``,
    OFF_CURVE or RANGE, in place of ``done``: steps were made, none of them was ``last``, and
    ``position`` is where they led. Only blocks that discreta.sim.conics refuses or whose curve ends
    half a step beyond the edge of the coordinates can end like that. A block always ends: two
    changes of the frame a turn, and between two changes of direction each axis goes one way. (If a
    block with wrong ``turns`` stands on its end with one to come, ``done`` follows at once.)

    Registers: ``residual``, ``outer``, ``axial``, ``across``; ``alpha``, ``beta``, ``gamma`` = α,
    β, γ; the constants of the frame; P1, P2 = x, y; P3, P4 = way to the end, signed; XT, YT =
    coordinates now; ``steep`` = y leads, ``slows`` = v slows down; ``turns``. Those of a prepared
    block begin with ``next_``, or are A…E, GX, GY.

    Latency: a block accepted in clock 0 is prepared from clock 1 to n + 8 in registers of its own,
    while the block before runs. It starts in clock n + 9 or, if that is later, in the clock in
    which the last step of the block before is taken. Its first step is there two clocks later.
    ``done`` follows the last step by a clock.

    Throughput: a step a clock, and one clock more for every change of the frame: 8 in a whole
    ellipse. Between the last step of a block and the first one of the next lies one clock, if the
    next was accepted n + 9 clocks or more before that last step was taken; the next block is
    accepted from the clock after a block's start on. Behind a block of fewer clocks the rest of
    the preparation is waited for: up to n + 11 clocks in all.

    Steps: ``steps`` holds a step until it is taken and everything waits for it. ``position`` shows
    the steps taken, not the one that waits; starting a block loads it with the block's start.

    Reset: everything 0, nothing held, position at the origin.

    Overflow: with A, B, C of n + 4 and D, E of 2n + 5 bits, signed, \|g\| and \|h\| are at most
    2.5·2^(2n + 4) everywhere, so that ``axial``, below 2^(2n + 7), and ``across``, below
    2^(2n + 6), never wrap. The middles are within two steps of the curve, and a residual there is
    within 2·2·2.5·2^(2n + 4) < 2^(2n + 8). It wraps, 2n + 9 bits, only away from the curve, in
    blocks that discreta.sim.conics refuses; these end all the same. ``error`` is ``SHARP`` for one
    clock, in place of ``done``, when both derivatives are 0 at the start or \|Gx\| + \|Gy\| <
    4·(\|A\| + \|B\| + \|C\|). Nothing moves and the next block runs as ever.

    Error bound: ½ step. Of the points on the line u = 1 the nearest one is taken, as long as the
    curve passes each such line once in a frame; measured over random curves with radii of
    curvature down to 2 steps it is 0.5000. An end that is off the curve has that much of an error
    itself. See docs/exact_conic.md.

    Source: design, section 6.9 (the faster axis steps, the sign of the residual decides the other
    one); the middle as the place of the residual, frames, end and preparation are ours.

    Parameters
    ----------
    width : int
        n, 4 to 24. Coordinates are signed, n + 1 bits; steps are 1 long.

    Attributes
    ----------
    parameters : dict of str to object
        The parameters it was made with.
    diagram : dict of str to list of Signal
        Every register there is, in groups, by the group's title.
    registers : dict of str to Signal
        The same registers, by their names in waveforms.

    Raises
    ------
    TypeError, ValueError
        ``width`` is not a whole number from 4 to 24.
    """

    notation = "n = width"

    def __init__(self, width: int = 16):
        check_width(width, MAX_WIDTH)
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
        self.width = n = width
        self.parameters: dict[str, object] = {"width": width}
        point, way, square = signed(n + 1), signed(n + 2), signed(coefficient_bits(n))
        bits, linear = derivative_bits(n), signed(linear_bits(n))
        constant, factor = signed(n + 8), signed(n + 5)
        self.uu = ControlUnit()
        self.output = QuadrantOutput(2)
        self.p1, self.p2 = Signal(point, name="p1"), Signal(point, name="p2")
        self.p3, self.p4 = Signal(way, name="p3"), Signal(way, name="p4")
        self.residual = Signal(signed(bits + 2))
        self.outer = Signal(signed(bits + 2))
        self.axial = Signal(signed(bits + 1))
        self.across = Signal(signed(bits))
        self.alpha = Signal(square)
        self.beta = Signal(factor)
        self.gamma = Signal(square)
        self.outer_straight = Signal(constant)
        self.outer_aslant = Signal(constant)
        self.turn_outer = Signal(constant)
        self.turn_axial = Signal(constant)
        self.turn_across = Signal(constant)
        self.steep = Signal()
        self.slows = Signal()
        self.diagonal = Signal()
        self.turning = Signal()
        self.fresh = Signal()
        self.turns = Signal(TURNS_BITS)
        self.xt, self.yt = PositionRegister(n, name="xt"), PositionRegister(n, name="yt")
        self.late = Signal(ErrorCode)

        self.held = Signal()
        self.prepared = Signal()
        self.fault = Signal(ErrorCode)
        self.tick = Signal(range(n + 9))
        self.a = Signal(square)
        self.b = Signal(factor)
        self.c = Signal(square)
        self.d = Signal(linear)
        self.e = Signal(linear)
        self.gx = Signal(signed(bits + 1))
        self.gy = Signal(signed(bits))
        self.bend = Signal(n + 6)
        self.next_residual = Signal(signed(bits + 2))
        self.next_outer = Signal(signed(bits + 2))
        self.clockwise = Signal()
        self.still_x = Signal()
        self.still_y = Signal()
        self.leads_x = Signal()
        self.tie = Signal()
        self.next_down_x = Signal()
        self.next_down_y = Signal()
        self.next_steep = Signal()
        self.next_slows = Signal()
        self.next_turns = Signal(TURNS_BITS)
        self.next_empty = Signal()
        self.next_x = Signal(point)
        self.next_y = Signal(point)
        self.next_p3 = Signal(way)
        self.next_p4 = Signal(way)

        out, uu = self.output, self.uu
        groups = {
            "P1, P2 coordinates": [self.p1, self.p2],
            "P3, P4 way to the end": [self.p3, self.p4],
            "residuals": [self.residual, self.outer, self.axial, self.across],
            "coefficients": [self.alpha, self.beta, self.gamma],
            "constants of the frame": [
                *(self.outer_straight, self.outer_aslant),
                *(self.turn_outer, self.turn_axial, self.turn_across),
            ],
            "frame": [
                *(self.steep, self.slows, self.diagonal, self.turning, self.fresh, self.turns)
            ],
            "XT, YT position": [self.xt.register, self.yt.register],
            "УУ": [uu.running, uu.done_register, uu.error_register, self.late],
            "step that waits": [*out.pulse_registers.values(), *out.direction_registers.values()],
            "prepared block": [
                *(self.held, self.prepared, self.fault, self.tick),
                *(self.a, self.b, self.c, self.d, self.e, self.gx, self.gy, self.bend),
                *(self.next_residual, self.next_outer, self.clockwise),
                *(self.still_x, self.still_y, self.leads_x, self.tie),
                *(self.next_down_x, self.next_down_y, self.next_steep, self.next_slows),
                *(self.next_turns, self.next_empty),
                *(self.next_x, self.next_y, self.next_p3, self.next_p4),
            ],
        }
        self.diagram: dict[str, list[Signal]] = {
            title: [Value.cast(register) for register in group] for title, group in groups.items()
        }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }
        summed = (self.residual, self.outer, self.axial, self.across)
        summed += (self.alpha, self.beta, self.gamma)
        self.between: dict[str, Signal] = {
            "increment": Signal(signed(bits + 2)),
            "opposite": Signal(signed(bits + 2)),
            **{f"{it.name}_after": Signal.like(it, name=f"{it.name}_after") for it in summed},
            **{f"more_{name}": Signal(constant) for name in ("alpha", "beta", "gamma")},
        }
        self.intermediates = self.between
        #: What a clock does: it takes over a block, makes a step, ends the block.
        self.accept = Signal()
        self.goes = Signal()
        self.near = Signal()
        self.missed = Signal()
        self.outside = Signal()

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        uu, out = self.uu, self.output
        m.submodules.uu = uu
        m.submodules.output = out
        m.submodules.xt_register = self.xt
        m.submodules.yt_register = self.yt
        m.d.comb += [
            self.blocks.ready.eq(~self.held),
            self.accept.eq(self.blocks.valid & ~self.held),
            uu.pending.eq(self.prepared),
            uu.fault.eq(self.fault),
            uu.empty.eq(self.next_empty),
            uu.waiting.eq(out.waiting),
            uu.ready.eq(self.steps.ready),
            self.steps.valid.eq(out.waiting),
            self.steps.payload.last.eq(uu.last),
            self.busy.eq(self.held | ~uu.idle),
            self.done.eq(uu.done),
            self.error.eq(Value.cast(uu.error) | Value.cast(self.late)),
        ]
        with m.If(self.accept):
            m.d.sync += self.held.eq(1)
        with m.Elif(uu.start):
            m.d.sync += self.held.eq(0)
        self._move(m)
        self._sum(m)
        self._prepare(m)
        with m.If(uu.start):
            m.d.sync += self.prepared.eq(0)
        return m

    def _move(self, m: Module) -> None:
        """Step, end, or change the direction of an axis."""
        n, uu, out = self.width, self.uu, self.output
        steep, diagonal = self.steep, self.diagonal
        down = out.direction_registers
        steps = {"x": ~steep | diagonal, "y": steep | diagonal}
        minor = {"x": steep, "y": ~steep}
        flip = Signal()
        m.d.comb += flip.eq(self.turning & ~self.fresh & self.slows)
        close, passed, edge = [], [], []
        axes = (("x", self.p1, self.p3, self.xt), ("y", self.p2, self.p4, self.yt))
        for k, place, left, position in axes:
            pulse, move = Signal(name=f"pulse_{k}"), Signal(signed(2), name=f"move_{k}")
            moves = ~self.turning & steps[k]
            wanted = steps[k]
            # −1, 0 or 1; and beyond it upwards or downwards.
            small = left[1:].all() | ~left[1:].any()
            close.append(small & ~(left == -2))
            passed.append(Mux(down[k], ~left[-1] & left[1:].any(), left[-1] & (left != -1)))
            edge.append(wanted & (place[:-1] == Mux(down[k], 0, 2**n - 1)) & (place[-1] == down[k]))
            m.d.comb += [
                pulse.eq(Mux(self.near, left.any(), self.goes & wanted)),
                # In the clock that ends the block they do not matter.
                move.eq(Cat(moves, moves & down[k])),
                out.carry[k].eq(pulse),
                out.negative[k].eq(
                    Mux(
                        uu.load,
                        self.next_down_x if k == "x" else self.next_down_y,
                        Mux(self.near, left[-1], down[k] ^ (flip & minor[k])),
                    )
                ),
                self.steps.payload[k].eq(out.step[k]),
                position.load.eq(uu.load),
                position.initial.eq(self.next_x if k == "x" else self.next_y),
                position.up.eq(out.up[k]),
                position.down.eq(out.down[k]),
                self.position[k].eq(position.register),
            ]
            with m.If(uu.load):
                first = (self.next_x, self.next_p3) if k == "x" else (self.next_y, self.next_p4)
                m.d.sync += [place.eq(first[0]), left.eq(first[1])]
            with m.Elif(uu.clock):
                m.d.sync += [place.eq(place + move), left.eq(left - move)]
        m.d.comb += [
            self.near.eq((self.turns < 2) & close[0] & close[1]),
            self.missed.eq((self.turns == 0) & ~self.near & (passed[0] | passed[1])),
            self.outside.eq((edge[0] | edge[1]) & ~(self.near | self.missed | self.turning)),
            self.goes.eq(~(self.near | self.missed | self.turning | self.outside)),
            out.clock.eq(uu.clock),
            out.taken.eq(uu.taken),
            out.load.eq(uu.load | uu.clock),
            uu.ending.eq(self.near | self.missed | self.outside),
            uu.stepless.eq(self.near & ~Cat(self.p3, self.p4).any()),
        ]
        m.d.sync += self.late.eq(ErrorCode.NONE)
        with m.If(uu.clock):
            with m.If(self.missed):
                m.d.sync += self.late.eq(ErrorCode.OFF_CURVE)
            with m.Elif(self.outside):
                m.d.sync += self.late.eq(ErrorCode.RANGE)

    def _sum(self, m: Module) -> None:
        """Add up the residuals and what belongs to them, for a step or a change of the frame."""
        residual, outer, axial, across = self.residual, self.outer, self.axial, self.across
        alpha, beta, gamma = self.alpha, self.beta, self.gamma
        slows, diagonal, turning = self.slows, self.diagonal, self.turning
        load, half = self.uu.load, axial >> 1

        increment, opposite = self.between["increment"], self.between["opposite"]
        m.d.comb += [
            increment.eq(axial + Mux(diagonal, across << 1, 0)),
            opposite.eq(self.turn_outer - (Mux(slows, half, axial) + Mux(slows, across, 0))),
        ]
        extra = Mux(diagonal, self.outer_aslant, self.outer_straight)
        # What a block loads, a change of the frame makes, a step makes.
        sums = (
            (residual, self.next_residual, outer, residual + increment),
            (
                outer,
                self.next_outer,
                outer + opposite,
                outer + increment + extra,
            ),
            (
                axial,
                self.gx,
                Mux(slows, axial, across << 1) + self.turn_axial,
                axial + (alpha << 2) + Mux(diagonal, beta << 1, 0),
            ),
            (
                across,
                self.gy,
                Mux(slows, -across, half) + self.turn_across,
                across + beta + Mux(diagonal, gamma << 1, 0),
            ),
        )
        # Right after a change of the frame the constants of the next one are not there yet.
        waits, enable = Signal(), Signal()
        m.d.comb += [
            waits.eq(turning & self.fresh),
            enable.eq(load | (self.uu.clock & ~waits)),
        ]
        for register, loaded, changed, stepped in sums:
            value = self.between[f"{register.name}_after"]
            m.d.comb += value.eq(Mux(load, loaded, Mux(turning, changed, stepped)))
            with m.If(enable):
                m.d.sync += register.eq(value)

        # The frame of the next clock, and what goes with it.
        flip, swap = turning & slows, turning & ~slows
        new_slows, new_turns = Signal.like(slows), Signal.like(self.turns)
        m.d.comb += [
            self.between["alpha_after"].eq(Mux(load, self.a, Mux(swap, gamma, alpha))),
            self.between["beta_after"].eq(Mux(load, self.b, Mux(flip, -beta, beta))),
            self.between["gamma_after"].eq(Mux(load, self.c, Mux(swap, alpha, gamma))),
            new_slows.eq(Mux(load, self.next_slows, slows ^ turning)),
            new_turns.eq(Mux(load, self.next_turns, self.turns - flip)),
        ]
        stays = new_slows & (new_turns == 0)
        alpha_2, beta_2, gamma_2 = alpha << 1, beta << 1, gamma << 1
        with m.If(enable):
            m.d.sync += [
                alpha.eq(self.between["alpha_after"]),
                beta.eq(self.between["beta_after"]),
                gamma.eq(self.between["gamma_after"]),
                slows.eq(new_slows),
                self.turns.eq(new_turns),
                self.steep.eq(Mux(load, self.next_steep, self.steep ^ swap)),
                diagonal.eq(~(self.between["residual_after"][-1] ^ new_slows)),
                turning.eq(~self.between["outer_after"][-1] & ~stays),
                self.fresh.eq(load | turning),
            ]
            with m.If(load):
                m.d.sync += [self.outer_straight.eq(self.d), self.outer_aslant.eq(self.e)]
            with m.Elif(turning):
                m.d.sync += [
                    self.outer_straight.eq(Mux(slows, -beta - alpha_2, -beta_2)),
                    self.outer_aslant.eq(Mux(slows, gamma_2 - alpha_2, -beta_2 - (alpha << 2))),
                ]
        with m.Elif(self.uu.clock):
            m.d.sync += self.fresh.eq(0)
        more = self.between
        m.d.comb += [
            more["more_alpha"].eq(alpha + (alpha >> 1)),
            more["more_beta"].eq(beta_2 + (beta >> 1)),
            more["more_gamma"].eq((gamma << 2) - (gamma >> 1)),
        ]
        pairs = (
            (
                self.turn_outer,
                more["more_alpha"] + more["more_beta"] + more["more_gamma"],
                (alpha << 2) + alpha_2 - beta,
            ),
            (self.turn_axial, -beta_2, gamma_2 - beta - beta_2),
            (self.turn_across, gamma << 2, beta_2 - alpha - (beta >> 1)),
        )
        m.d.sync += [register.eq(Mux(slows, slow, fast)) for register, slow, fast in pairs]

    def _prepare(self, m: Module) -> None:
        """Multiply the start by the coefficients, bit by bit, and find the frame it begins in."""
        n, tick, block = self.width, self.tick, self.blocks.payload
        a, b, c, d, e, gx, gy = self.a, self.b, self.c, self.d, self.e, self.gx, self.gy
        total, outer, cw = self.next_residual, self.next_outer, self.clockwise
        steep, slows = self.next_steep, self.next_slows
        with m.If(self.accept):
            m.d.sync += [
                *[getattr(self, k).eq(block[k]) for k in "abcde"],
                self.next_x.eq(block.start.x),
                self.next_y.eq(block.start.y),
                self.next_p3.eq(block.end.x),
                self.next_p4.eq(block.end.y),
                self.next_turns.eq(block.turns),
                cw.eq(block.clockwise),
                self.fault.eq(ErrorCode.NONE),
                gx.eq(0),
                gy.eq(0),
                tick.eq(1),
            ]
        with m.Else():
            with m.If(tick == n + 8):
                m.d.sync += tick.eq(0)
            with m.Elif(tick != 0):
                m.d.sync += tick.eq(tick + 1)
            multiplies = Signal()
            m.d.comb += multiplies.eq((tick != 0) & (tick < n + 2))
            with m.If(multiplies):
                m.d.sync += [p.eq(p.rotate_left(1)) for p in (self.next_x, self.next_y)]
                # The first bits are signs: what they stand for is taken off.
                off = tick == 1
                for g, x_scale, y_scale in ((gx, a << 1, b), (gy, b, c << 1)):
                    digits = [Signal.like(g, name=f"{g.name}_digit_{k}") for k in "xy"]
                    m.d.comb += [
                        digits[0].eq(Mux(self.next_x[n], x_scale, 0)),
                        digits[1].eq(Mux(self.next_y[n], y_scale, 0)),
                    ]
                    x_part, y_part = (digit ^ off.replicate(len(g)) for digit in digits)
                    m.d.sync += g.eq(_three(Cat(off, g)[: len(g)], x_part, y_part, off))
            with m.If(tick == n + 2):
                m.d.sync += [
                    self.next_p3.eq(self.next_p3 - self.next_x),
                    self.next_p4.eq(self.next_p4 - self.next_y),
                ]
            with m.If((tick == n + 2) | (tick == n + 7)):
                m.d.sync += [gx.eq(Mux(tick == n + 2, gx, gx << 1) + d), gy.eq(gy + e)]
            with m.If(tick == n + 3):
                rising, falling = gx + gy, gx - gy
                no_way = ~Cat(self.next_p3, self.next_p4).any()
                m.d.sync += [
                    self.next_empty.eq((self.next_turns == 0) & no_way),
                    self.still_x.eq(gy == 0),
                    self.still_y.eq(gx == 0),
                    self.leads_x.eq(rising[-1] ^ falling[-1]),
                    self.tie.eq((rising == 0) | (falling == 0)),
                    self.bend.eq(abs(a) + abs(c)),
                ]
            with m.If(tick == n + 4):
                self._frame(m)
                m.d.sync += self.bend.eq(self.bend + abs(b))
            with m.If(tick == n + 5):
                down_x, down_y = self.next_down_x, self.next_down_y
                m.d.sync += [
                    gx.eq(_opposed(Mux(steep, down_y, down_x), Mux(steep, gy, gx))),
                    gy.eq(_opposed(Mux(steep, down_x, down_y), Mux(steep, gx, gy))),
                    a.eq(Mux(steep, c, a)),
                    b.eq(_opposed(down_x ^ down_y, b)),
                    c.eq(Mux(steep, a, c)),
                ]
            # D and E have been added: their registers hold what else there is to add.
            with m.If(tick == n + 6):
                m.d.sync += [
                    total.eq(Mux(slows, gy - gx, gx - gy)),
                    d.eq((a << 2) + (a << 1) + b),
                    e.eq((b + c) << 1),
                ]
            with m.If(tick == n + 7):
                sharp = (total < (self.bend << 2)) | (self.still_x & self.still_y)
                with m.If(~self.next_empty & sharp):
                    m.d.sync += self.fault.eq(ErrorCode.SHARP)
                m.d.sync += [
                    total.eq((gx << 1) + gy),
                    outer.eq(Mux(slows, (gx << 1) - gy, (gy << 1) + gx)),
                    d.eq((a << 1) + b + (c >> 1)),
                    e.eq(Mux(slows, (a << 1) - b + (c >> 1), (c << 1) + b + (a >> 1))),
                ]
            with m.If(tick == n + 8):
                # What is left of a frame is what its steps add to the outer residual.
                m.d.sync += [
                    total.eq(total + d),
                    outer.eq(outer + e),
                    d.eq(Mux(slows, -(b << 1), b - (a << 1))),
                    e.eq(Mux(slows, -(b << 1) - (c << 2), (c << 1) - (a << 1))),
                    self.prepared.eq(1),
                ]

    def _frame(self, m: Module) -> None:
        """Tell the directions at the start, the axis that leads, and whether the other one slows.

        An axis that stands still goes where the curve bends to.
        """
        cw, gx, gy = self.clockwise, self.gx, self.gy
        below_x, below_y = ~(gy[-1] ^ cw), gx[-1] ^ cw
        down_x = Mux(self.still_x, ~below_y ^ cw, below_x)
        down_y = Mux(self.still_y, below_x ^ cw, below_y)
        x_slows, leads_x = Signal(name="x_slows"), Signal(name="x_leads")
        m.d.comb += [
            x_slows.eq(~(down_x ^ down_y ^ cw)),
            # As fast as each other: the one that does not slow down.
            leads_x.eq(Mux(self.tie, ~x_slows, self.leads_x)),
        ]
        m.d.sync += [
            self.next_down_x.eq(down_x),
            self.next_down_y.eq(down_y),
            self.next_steep.eq(~leads_x),
            self.next_slows.eq(x_slows ^ leads_x),
        ]


def _three(a: Value, b: Value, c: Value, carry: Value) -> Value:
    """Add three numbers of as many bits, and a carry, with one carry chain."""
    carries = Cat(carry, (a & b) | (a & c) | (b & c))
    return ((a ^ b ^ c) + carries)[: len(a)]


def _opposed(opposed: Value, value: Value) -> Value:
    """Give a value or, where a condition holds, its opposite: by one adder."""
    return (value ^ opposed.replicate(len(value))).as_signed() + opposed
