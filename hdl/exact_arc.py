"""The exact arc interpolator: the sign of the circle's own residual chooses every step."""

from amaranth import Cat, Const, Module, Mux, Signal, Value
from amaranth.hdl import signed, unsigned
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.arc_input import FULL_TURNS_BITS, TURNS_BITS, arc_block_layout
from discreta.hdl.contract import ErrorCode, Part, check_width, per_axis, point_layout, step_layout

__all__ = ["ExactArc", "ExactArcInput"]

#: What the register ``mode`` says a clock is for.
STEP, CHANGE, OCTANT_NEXT, AXIS_NEXT = range(4)


class ExactArcInput(Part):
    """Prepares arcs for :class:`ExactArc`, a block in two clocks, in three stages.

    As for :class:`~discreta.hdl.arc_input.ArcInput` every arc is brought to one that begins in
    quadrant I and runs counter-clockwise there, and the crossings are counted from the quadrants of
    start and end and, when these are one, from whether the end is ahead. That is seen from the way
    from start to end: no axis may go against its direction. Nothing is squared and no root drawn,
    so whether the end is on the circle, and whether the arc stays in the coordinates there are, is
    not looked at.

    1. ``from`` = start seen from the centre, ``to`` = the end, complemented; in the clock after
       that (``coded``) ``first_past`` = start − end, the quadrants, the signs and what is too far.
    2. ``seen_x``, ``seen_y`` = −XH, YH; the crossings, without the ``seen_round`` that an end
       behind the start in its own quadrant takes; the fault and the directions.
    3. ``ready_diagonal`` = YH − XH; all crossings.

    - ``pending``: stage 3 holds a block, until ``take``; ``still``: it makes no step, because it is
      ``empty`` (start, end and centre are one point) or has a ``fault``: ``RANGE`` when a
      coordinate seen from the centre does not fit n bits, else ``OFF_CURVE`` when the start is the
      centre and the end is not;
    - ``second`` says that X leads at the start, YH ≥ XH or radius 1; ``axial`` = −XH then, else YH;
      ``residual`` = E, with its sign complemented when X leads;
    - ``unit`` says that the start is (1, 0): a circle of radius 1.

    Latency: a block accepted in clock 0 is ``pending`` in clock 4. Throughput: a block in two
    clocks; a stage takes a block over when it is empty, stage 1 also while it gives its own away.
    ``blocks.ready`` depends on registers alone.
    Reset: nothing held. Overflow: reported by ``fault``. Error: none, it is exact.
    Source: ours; the frame is the lecture's (circular interpolation, the first quadrant).

    Parameters
    ----------
    width : int
        n, 4 to 32; coordinates are signed, n + 1 bits; in steps.

    Raises
    ------
    TypeError, ValueError
        ``width`` is not a whole number from 4 to 32.
    """

    def __init__(self, width: int):
        check_width(width)
        way, flags = per_axis(2, signed(width + 2)), per_axis(2, 1)
        super().__init__(
            {
                "blocks": In(stream.Signature(arc_block_layout(width))),
                "take": In(1),
                "held": Out(1),
                "pending": Out(1),
                "still": Out(1),
                "fault": Out(ErrorCode),
                "empty": Out(1),
                "past": Out(way),
                "end": Out(point_layout(width, 2)),
                "negative": Out(flags),
                "turns": Out(TURNS_BITS),
                "unit": Out(1),
                "second": Out(1),
                "lead": Out(1),
                "residual": Out(signed(width + 3)),
                "axial": Out(signed(width + 2)),
                "diagonal": Out(signed(width + 2)),
            }
        )
        self.width = width
        way_shape, end_shape = signed(width + 2), signed(width + 1)
        registers: dict[str, Signal] = {}

        def register(name: str, shape: object = 1) -> Signal:
            registers[name] = signal = Signal(shape, name=name)
            return signal

        self.held_register = register("held")
        self.coded = register("coded")
        self.seen_from = {a: register(f"from_{a}", way_shape) for a in "xy"}
        self.seen_to = {a: register(f"to_{a}", way_shape) for a in "xy"}
        self.first_past = {a: register(f"first_past_{a}", way_shape) for a in "xy"}
        self.first_end = {a: register(f"first_end_{a}", end_shape) for a in "xy"}
        self.clockwise = register("clockwise")
        self.full_turns = register("full_turns", FULL_TURNS_BITS)
        self.quadrant = register("quadrant", 2)
        self.end_quadrant = register("end_quadrant", 2)
        self.minus = {a: register(f"minus_{a}") for a in "xy"}
        self.too_far = register("too_far")
        self.at_center = register("at_center")
        self.to_center = register("to_center")
        for stage in ("seen", "ready"):
            register(f"{stage}_held")
            register(f"{stage}_fault", ErrorCode)
            for name in ("empty", "swap", "negative_x", "negative_y"):
                register(f"{stage}_{name}")
            register(f"{stage}_turns", TURNS_BITS)
            for a in "xy":
                register(f"{stage}_past_{a}", way_shape)
            for a in "xy":
                register(f"{stage}_end_{a}", end_shape)
            register(f"{stage}_x", end_shape)
            register(f"{stage}_y", unsigned(width))
        register("ready_diagonal", way_shape)
        register("ready_unit")
        register("seen_round")
        self.registers = registers

    def elaborate(self, platform):
        """Describe the hardware."""
        n = self.width
        m = Module()
        block, r = self.blocks.payload, self.registers
        accept, code, leave, follow = (
            Signal(name=name) for name in ("accept", "code", "leave", "follow")
        )
        held, coded, seen, ready = (r[k] for k in ("held", "coded", "seen_held", "ready_held"))
        m.d.comb += [
            self.blocks.ready.eq(~held | (coded & ~seen)),
            accept.eq(self.blocks.valid & self.blocks.ready),
            code.eq(held & ~coded),
            leave.eq(coded & ~seen),
            follow.eq(seen & ~ready),
            self.held.eq(held | seen | ready),
        ]
        m.d.sync += [
            held.eq(accept | (held & ~leave)),
            coded.eq(code | (coded & ~leave)),
            seen.eq(leave | (seen & ~follow)),
            ready.eq(follow | (ready & ~self.take)),
        ]

        # Stage 1: the differences, and a clock later what follows from their signs.
        with m.If(accept):
            m.d.sync += [self.clockwise.eq(block.clockwise), self.full_turns.eq(block.full_turns)]
            for a in "xy":
                m.d.sync += [
                    self.seen_from[a].eq(block.start[a] - block.center[a]),
                    # Complemented, so that it is subtracted without inverters.
                    self.seen_to[a].eq(~(block.end[a] - block.center[a])),
                    self.first_end[a].eq(block.end[a]),
                ]
        start = _Seen(m, "start", self.seen_from, self.clockwise, n)
        to = {a: (~self.seen_to[a]).as_signed() for a in "xy"}
        finish = _Seen(m, "finish", to, self.clockwise, n)
        first, last = Signal(2, name="first"), Signal(2, name="last")
        with m.If(start.right & ~start.below):
            m.d.comb += first.eq(0)
        with m.Elif(~start.right & start.above):
            m.d.comb += first.eq(1)
        with m.Elif(start.left):
            m.d.comb += first.eq(2)
        with m.Else():
            m.d.comb += first.eq(3)
        with m.If(finish.right & ~finish.above):
            m.d.comb += last.eq(3)
        with m.Elif(~finish.right & finish.below):
            m.d.comb += last.eq(2)
        with m.Elif(finish.left):
            m.d.comb += last.eq(1)
        with m.Else():
            m.d.comb += last.eq(0)
        with m.If(code):
            m.d.sync += [
                self.quadrant.eq(first),
                self.end_quadrant.eq(last),
                self.minus["x"].eq(Mux(first[0], self.seen_from["y"][-1], self.seen_from["x"][-1])),
                self.minus["y"].eq(Mux(first[0], self.seen_from["x"][-1], self.seen_from["y"][-1])),
                *[
                    self.first_past[a].eq(_sum(self.seen_from[a], self.seen_to[a], Const(1, 1)))
                    for a in "xy"
                ],
                self.too_far.eq(start.too_far | finish.too_far),
                self.at_center.eq(start.center),
                self.to_center.eq(finish.center),
            ]

        # Stage 2: the start turned onto the first quadrant, and the crossings.
        negative = {
            "x": ~self.quadrant[1],
            "y": self.quadrant[0] ^ self.quadrant[1] ^ self.clockwise,
        }
        crossings, once_round = Signal(2), Signal()
        stands = {a: self.first_past[a] == 0 for a in "xy"}
        wrong = Cat(~stands[a] & ~(self.first_past[a][-1] ^ negative[a]) for a in "xy")
        m.d.comb += [
            crossings.eq(self.end_quadrant - self.quadrant),
            once_round.eq((crossings == 0) & (wrong.any() | (stands["x"] & stands["y"]))),
        ]
        # −X and Y, whatever the signs.
        flips = {"x": ~self.minus["x"], "y": self.minus["y"]}
        away: dict[str, Signal] = {}
        for a, other, bits in (("x", "y", n + 1), ("y", "x", n)):
            away[a] = Signal(bits, name=f"away_{a}")
            side = Mux(self.quadrant[0], self.seen_from[other], self.seen_from[a])
            m.d.comb += away[a].eq(side[:bits] ^ flips[a].replicate(bits))
        with m.If(leave):
            m.d.sync += [
                r["seen_fault"].eq(
                    Mux(
                        self.too_far,
                        ErrorCode.RANGE,
                        Mux(self.at_center & ~self.to_center, ErrorCode.OFF_CURVE, ErrorCode.NONE),
                    )
                ),
                r["seen_empty"].eq(self.at_center & self.to_center),
                r["seen_swap"].eq(self.quadrant[0]),
                r["seen_turns"].eq(Cat(crossings, self.full_turns)),
                r["seen_round"].eq(once_round),
            ]
            for a in "xy":
                m.d.sync += [
                    r[f"seen_{a}"].eq(_sum(away[a], Const(0, 1), flips[a])),
                    r[f"seen_negative_{a}"].eq(negative[a]),
                    r[f"seen_past_{a}"].eq(self.first_past[a]),
                    r[f"seen_end_{a}"].eq(self.first_end[a]),
                ]

        # Stage 3: which axis leads.
        x, y = r["seen_x"], r["seen_y"]
        with m.If(follow):
            for name, signal in r.items():
                stage, _, rest = name.partition("_")
                if stage == "ready" and rest not in ("held", "turns", "diagonal", "unit"):
                    m.d.sync += signal.eq(r[f"seen_{rest}"])
            m.d.sync += [
                r["ready_turns"].eq(r["seen_turns"] + Cat(Const(0, 2), r["seen_round"])),
                r["ready_diagonal"].eq(x + y),
                r["ready_unit"].eq((x == -1) & (y == 0)),
            ]

        # What the core loads.
        x, y, diagonal = r["ready_x"], r["ready_y"], r["ready_diagonal"]
        second, residual = Signal(), Signal(n + 3)
        m.d.comb += [
            self.pending.eq(ready),
            self.fault.eq(r["ready_fault"]),
            self.empty.eq(r["ready_empty"]),
            self.still.eq(r["ready_empty"] | (r["ready_fault"] != ErrorCode.NONE)),
            self.turns.eq(r["ready_turns"]),
            self.unit.eq(r["ready_unit"]),
            second.eq(~diagonal[-1] | self.unit),
            self.second.eq(second),
            self.lead.eq(~r["ready_swap"] ^ second),
            self.diagonal.eq(diagonal),
            self.axial.eq(Mux(second, x, y)),
            residual.eq(_sum(_longer(diagonal, n + 3), _longer(self.axial, n + 3), Const(1, 1))),
            self.residual.eq(Cat(residual[:-1], residual[-1] ^ second)),
        ]
        for a in "xy":
            m.d.comb += [
                self.past[a].eq(r[f"ready_past_{a}"]),
                self.end[a].eq(r[f"ready_end_{a}"]),
                self.negative[a].eq(r[f"ready_negative_{a}"]),
            ]
        return m


class ExactArc(Part):
    """Draws an arc: the circle's own residual chooses every step; no step is half a step off.

    Computes, seen from the centre in the quadrant of the moment turned onto the first, where X
    falls and Y rises, with F = X² + Y² − R² and R that of the start: of the two points that may
    come next the one with the smaller |F|. While Y leads these are (0, +1) and (−1, +1) away, then
    X leads and they are (−1, 0) and (−1, +1). Twice E and 1 is the sum of F at both, which is odd,
    so there are no ties::

        Y leads: E = F + 2Y − X + 1, diagonal if E ≥ 0; else E := E + 2·axial + 1, axial = Y + 1
        X leads: E = F − 2X + Y + 1, diagonal if E < 0; else E := E + 2·axial + 1, axial = 1 − X
        diagonal, in both:              E := E + 2·diagonal + 1, diagonal = Y − X + 2

    ``axial`` grows by 1 with every step, ``diagonal`` by 1 or, with a diagonal step, by 2. F is 0
    at the start, so E begins with 2Y − X + 1 or Y − 2X + 1: no multiplier, no radius, no root.

    Where the leading axis changes E loses X + Y, and where Y comes to lead in the next quadrant it
    loses 2Y. One clock before that step ``axial`` and ``diagonal`` are set to what this step and
    the change together add to E: 0 and 1 − X where the octant changes (E then gains ``odd`` = Y − X
    + 2 more, or diagonally ``odd`` + 1), −Y and 0 where an axis is reached (and 1 more). The octant
    is left with the first step from Y − X ≥ −2: near 45° the choice has room to spare.

    Registers: ``f`` = E, its sign bit complemented while X leads (``second``), so that a step is
    diagonal when it is 0 in either octant; ``mode`` = what the clock is for: a step, a step with a
    change, the clock before a change of octant or before an axis; ``turns`` = axis crossings to
    come, ``sole`` and ``final`` that this is 1 or 0; ``unit`` a circle of radius 1, a step for a
    quarter; ``lead`` the machine's y leads; ``negative_x``, ``negative_y`` the way each moves;
    KOX, KOY = position − end, XK, YK = end: the position is their sum.

    The end: when there are no crossings left and the point that is left is no more than a step from
    the end on each axis (``near``), the next step leads there and is ``last``. So an end that is
    off the circle by up to a step is reached exactly, and never by a step back.

    Latency: a block accepted in clock 0 is prepared from clock 1 to 4 and loaded in clock 5; its
    first step is decided in clock 6 and offered in clock 7, or a clock later if it is a change's.
    ``done`` follows the last step by a clock.

    Throughput: one clock a step, and one more before a step with which the leading axis changes or
    an axis is crossed. Between blocks there is one clock, that of loading, which is the one in
    which the last step before is taken: steps of two blocks are two clocks apart, also of blocks of
    a single step. A block without a step takes a clock, and one more behind a block that moved.

    Steps: ``steps`` holds a step until it is taken and everything but the preparation waits for it.
    ``ready`` only enables registers. ``position`` shows the steps taken, not the one that waits;
    loading a block sets it to the block's start.

    Reset: everything 0 but ``axial`` = 1, nothing held, position at the origin.

    Overflow: ``error`` is ``RANGE`` for one clock, in place of ``done``, when a coordinate seen
    from the centre does not fit n bits, and ``OFF_CURVE`` when the start is the centre and the end
    is not: nothing moves. **One departure from the contract:** that the end is more than a step off
    the circle, or that the arc leads out of the coordinates, is not seen beforehand (it would take
    the radius); the host's helper, ``discreta.sim.points.check_arc``, sees it. Such an end is
    missed: then the block ends late, where X is 0 in the last quadrant or where the end is more
    than 4 steps behind on an
    axis, with ``OFF_CURVE``, no step is ``last`` and the position is that of the steps taken. An
    arc that leads out of the coordinates wraps. E takes n + 3 bits: \\|E\\| ≤ 2R + 2, R ≤ √2·(2^n −
    1) < 2^(n+1) − 1; X and Y are less than 1.5·2^n, so that ``axial`` and ``diagonal`` take n + 2.

    Error bound: less than half a step, radially, at every point but an end that is itself off the
    circle; proven (``discreta prove exact_arc``). The end point is exact.

    Source: ours, beyond the documents; E is the midpoint rule's (Pitteway 1967, Bresenham 1977),
    quadrants, directions and turns are those of the lecture's circular interpolation.

    Parameters
    ----------
    width : int
        n, 4 to 32. Coordinates are signed, n + 1 bits; steps are 1 long.
    axes : int
        2.

    Attributes
    ----------
    parameters : dict of str to object
        The parameters it was made with.
    diagram : dict of str to list of Signal
        Every register there is, by the title of its group.
    registers : dict of str to Signal
        The same registers, by their names in waveforms.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """

    notation = "n = width"

    def __init__(self, width: int = 16, axes: int = 2):
        check_width(width)
        if axes != 2:
            raise ValueError(f"number of axes is {axes!r}: an arc lies in a plane, choose 2")
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
        self.axes = axes
        self.parameters: dict[str, object] = {"width": width}
        self.input = ExactArcInput(width)

        way_shape, end_shape = signed(width + 2), signed(width + 1)
        self.f = Signal(signed(width + 3))
        self.axial = Signal(way_shape, init=1)
        self.diagonal = Signal(way_shape)
        self.mode = Signal(2)
        self.second = Signal()
        self.to_second = Signal()
        self.odd = Signal()
        self.turns = Signal(TURNS_BITS)
        self.sole = Signal()
        self.final = Signal()
        self.unit = Signal()
        self.lead = Signal()
        self.negative = {a: Signal(name=f"negative_{a}") for a in "xy"}
        self.past = {a: Signal(way_shape, name=f"ko{a}") for a in "xy"}
        self.end = {a: Signal(end_shape, name=f"{a}k") for a in "xy"}
        self.near = Signal()
        self.behind = Signal()
        self.lost = Signal()
        self.running = Signal()
        self.loading = Signal()
        self.done_register = Signal(name="done")
        self.error_register = Signal(ErrorCode, name="error")
        self.waiting = Signal()
        self.pulse = {a: Signal(name=f"pulse_{a}") for a in "xy"}
        self.direction = {a: Signal(name=f"direction_{a}") for a in "xy"}
        self.last = Signal()
        self.load_f = Signal(signed(width + 3))
        self.load_axial = Signal(way_shape)
        self.load_diagonal = Signal(way_shape)
        self.load_past = {a: Signal(way_shape, name=f"load_past_{a}") for a in "xy"}
        self.load_end = {a: Signal(end_shape, name=f"load_end_{a}") for a in "xy"}

        groups = {
            "E and what it grows by": [self.f, self.axial, self.diagonal],
            "octant": [self.mode, self.second, self.to_second, self.odd],
            "pieces": [
                *(self.turns, self.sole, self.final, self.unit, self.lead),
                *self.negative.values(),
            ],
            "KOX, KOY steps left": list(self.past.values()),
            "XK, YK end": list(self.end.values()),
            "УУ": [
                *(self.near, self.behind, self.lost, self.running, self.loading),
                *(self.done_register, self.error_register),
            ],
            "step that waits": [
                *(self.waiting, *self.pulse.values(), *self.direction.values(), self.last),
            ],
            "block to load": [
                *(self.load_f, self.load_axial, self.load_diagonal),
                *self.load_past.values(),
                *self.load_end.values(),
            ],
            "prepared blocks": list(self.input.registers.values()),
        }
        self.diagram: dict[str, list[Signal]] = {
            title: [Value.cast(register) for register in group] for title, group in groups.items()
        }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }

    def elaborate(self, platform):
        """Describe the hardware."""
        n = self.width
        m = Module()
        m.submodules.input = inp = self.input
        free, idle, begin, step, ends, missed = (
            Signal(name=name) for name in ("free", "idle", "begin", "step", "ends", "missed")
        )
        goes_on, frozen, turn, leads = (
            Signal(name=name) for name in ("goes_on", "frozen", "turn", "leads")
        )
        to_second = self.to_second
        moves = self.loading | (self.running & ~frozen)
        prepares, changes = self.mode[1], self.mode == CHANGE
        # The sign of E is kept the other way round while X leads.
        slanted = ~self.f[-1]
        m.d.comb += [
            inp.blocks.payload.eq(self.blocks.payload),
            inp.blocks.valid.eq(self.blocks.valid),
            self.blocks.ready.eq(inp.blocks.ready),
            self.steps.valid.eq(self.waiting),
            self.steps.payload.last.eq(self.last),
            self.busy.eq(inp.held | self.loading | self.running | self.waiting),
            self.done.eq(self.done_register),
            self.error.eq(self.error_register),
            free.eq(~self.waiting | self.steps.ready),
            idle.eq(~self.running & ~self.loading),
            # A block without a step lets the one before it be answered first.
            inp.take.eq(
                inp.pending
                & Mux(inp.still, idle & ~self.waiting, (idle | (self.running & self.near)) & free)
            ),
            begin.eq(inp.pending & ~inp.still & (idle | (self.running & self.near))),
            frozen.eq(self.unit & ~self.final),
            goes_on.eq(self.running & ~(self.near | self.lost)),
            missed.eq(self.running & self.lost & ~self.near),
            ends.eq(self.running & (self.near | self.lost)),
            step.eq(self.running & (self.near | ~(prepares | self.lost))),
            turn.eq((changes & self.second) | (frozen & self.running)),
            leads.eq(to_second | (frozen & self.running)),
        ]

        # E: the step is on the diagonal when it is not negative.
        carry, addend, half = Signal(), Signal(n + 2), Signal(n + 2)
        m.d.comb += [
            addend.eq(Mux(slanted, self.diagonal, self.axial) | self.load_f[1:]),
            carry.eq(
                Mux(
                    to_second,
                    Mux(slanted, self.f[0] | self.odd, self.f[0] & self.odd),
                    self.f[0],
                )
            ),
            half.eq(_sum(self.f[1:], Cat(addend[:-1], addend[-1] ^ changes), carry)),
        ]
        low = Mux(self.loading, self.load_f[0], self.f[0] ^ Mux(to_second, slanted ^ self.odd, 1))
        # What is set to what reset sets it to comes first: it spares gates.
        with m.If(free & moves & ends):
            m.d.sync += self.f.eq(0)
        with m.Elif(free & moves & ~prepares):
            m.d.sync += self.f.eq(Cat(low, half))

        # What it grows by. Each takes over the other, or its complement, where the octant changes.
        new_axial, new_diagonal = Signal(signed(n + 2)), Signal(signed(n + 2))
        by_axial, by_diagonal = Signal(n + 2), Signal(n + 2)
        with m.Switch(self.mode):
            with m.Case(STEP):
                m.d.comb += [by_axial.eq(self.axial), by_diagonal.eq(self.diagonal)]
            with m.Case(CHANGE):
                m.d.comb += [by_axial.eq(self.diagonal), by_diagonal.eq(self.axial)]
            with m.Case(OCTANT_NEXT):
                m.d.comb += [by_axial.eq(-1), by_diagonal.eq(~self.axial)]
            with m.Case(AXIS_NEXT):
                m.d.comb += [by_axial.eq(~self.diagonal), by_diagonal.eq(-1)]
        more_axial, more_diagonal, low_diagonal = Signal(), Signal(), Signal()
        m.d.comb += more_axial.eq(Mux(to_second, slanted, ~self.loading))
        crosses = changes & ~to_second
        if_slanted, if_not = Signal(), Signal()
        with m.Switch(self.mode):
            with m.Case(OCTANT_NEXT):
                m.d.comb += [if_slanted.eq(self.diagonal[0]), if_not.eq(self.diagonal[0])]
            with m.Case(AXIS_NEXT):
                m.d.comb += [if_slanted.eq(0), if_not.eq(0)]
            with m.Default():
                m.d.comb += [if_slanted.eq(~crosses), if_not.eq(crosses)]
        m.d.comb += [
            more_diagonal.eq(Mux(slanted, if_slanted, if_not)),
            # Axial is 0 where the octant changes.
            low_diagonal.eq(Mux(to_second, self.odd, by_diagonal[0] | self.load_diagonal[0])),
        ]
        m.d.comb += [
            new_axial.eq(
                _sum(
                    by_axial,
                    Cat(self.load_axial[0] | (self.mode == AXIS_NEXT), self.load_axial[1:]),
                    more_axial,
                )
            ),
            new_diagonal.eq(
                _sum(
                    Cat(low_diagonal, by_diagonal[1:]),
                    Cat(more_diagonal, self.load_diagonal[1:]),
                    Const(1, 1),
                )
            ),
        ]
        with m.If(free & moves & ends):
            m.d.sync += [self.axial.eq(1), self.diagonal.eq(0)]
        with m.Elif(free & moves):
            m.d.sync += [self.axial.eq(new_axial), self.diagonal.eq(new_diagonal)]

        # Where the octant changes next, from what the registers come to.
        next_second, next_final = Signal(), Signal()
        may_octant, may_axis, changing = Signal(), Signal(), Signal()
        goes_now = Signal()
        m.d.comb += [
            next_second.eq(self.second ^ changes),
            next_final.eq(self.final | (turn & self.sole)),
            goes_now.eq(self.loading | goes_on),
            changing.eq(goes_on & prepares),
            may_octant.eq(goes_now & ~changing & ~next_second),
            # Before the last piece no end is near.
            may_axis.eq(
                (self.loading | (self.running & ~prepares))
                & next_second
                & ~(self.final | self.unit)
            ),
        ]
        with m.If(free):
            # The signs are known last.
            axis_next = may_axis & ~new_axial[-1]
            m.d.sync += self.mode.eq(
                Cat(axis_next | changing, (may_octant & ~new_diagonal[-1]) | axis_next)
            )
            m.d.sync += [
                self.odd.eq(self.diagonal[0]),
                to_second.eq(goes_on & (self.mode == OCTANT_NEXT)),
            ]
            with m.If(begin):
                m.d.sync += [
                    self.second.eq(inp.second),
                    self.lead.eq(inp.lead),
                    self.turns.eq(inp.turns),
                    self.sole.eq(inp.turns == 1),
                    self.final.eq(inp.turns == 0),
                    self.unit.eq(inp.unit),
                    *[self.negative[a].eq(inp.negative[a]) for a in "xy"],
                ]
            with m.Else():
                m.d.sync += [
                    self.second.eq(next_second),
                    self.lead.eq(self.lead ^ leads),
                    self.sole.eq(
                        (self.turns[2:] == 0) & Mux(turn, self.turns[:2] == 2, self.turns[:2] == 1)
                    ),
                    self.final.eq(next_final),
                    # What rose falls now: that axis which does not lead.
                    self.negative["x"].eq(self.negative["x"] ^ (turn & self.lead)),
                    self.negative["y"].eq(self.negative["y"] ^ (turn & ~self.lead)),
                ]
                with m.If(turn):
                    m.d.sync += self.turns.eq(self.turns - 1)
        loads = [
            (self.load_f, inp.residual),
            (self.load_axial, inp.axial),
            (self.load_diagonal, inp.diagonal),
        ]
        with m.If(free & ~begin):
            m.d.sync += [register.eq(0) for register, _ in loads]
        with m.Elif(free):
            m.d.sync += [register.eq(value) for register, value in loads]
        with m.If(free):
            m.d.sync += [
                self.loading.eq(begin),
                self.running.eq(self.loading | goes_on),
                self.waiting.eq(step),
                self.last.eq(self.near),
            ]

        # The way to the end: of the steps that are put out in the registers, and of the next one.
        close, back = Signal(2), Signal(2)
        for index, a in enumerate("xy"):
            past, pulse, direction = self.past[a], self.pulse[a], self.direction[a]
            way = self.negative[a]
            moves = slanted | (self.lead if a == "y" else ~self.lead)
            counted = Signal(n + 2, name=f"counted_{a}")
            here, rest = Signal(3, name=f"here_{a}"), Signal(3, name=f"rest_{a}")
            few, about = Signal(name=f"few_{a}"), Signal(name=f"about_{a}")
            less = pulse & direction
            m.d.comb += [
                counted.eq(_sum(past, less.replicate(n + 2), pulse & ~direction)),
                here.eq(_moved(past[:3], pulse, direction)),
                few.eq(_few(past)),
            ]
            next_pulse = ~prepares & moves
            m.d.comb += [
                rest.eq(Mux(self.loading, self.load_past[a][:3], _moved(here, next_pulse, way))),
                about.eq((rest == 0) | (rest == 1) | (rest == 7)),
                close[index].eq(about & Mux(self.loading, _few(self.load_past[a]), few)),
                back[index].eq(~few & ~(past[-1] ^ way)),
                self.steps.payload[a].eq(Cat(pulse, pulse & direction)),
                self.position[a].eq(self.end[a] + past),
            ]
            with m.If(free):
                m.d.sync += [
                    self.load_past[a].eq(inp.past[a]),
                    self.load_end[a].eq(inp.end[a]),
                    past.eq(Mux(self.loading, self.load_past[a], counted)),
                    pulse.eq(step & Mux(self.near, here[0], moves)),
                    direction.eq(Mux(self.near, ~here[1], way)),
                ]
                with m.If(self.loading):
                    m.d.sync += self.end[a].eq(self.load_end[a])
        to_axis = self.second & ~self.axial[-1]
        with m.If(free):
            m.d.sync += [
                self.near.eq(goes_now & next_final & close.all()),
                self.behind.eq(self.running & self.final & back.any()),
                self.lost.eq(goes_on & self.final & (to_axis | self.behind)),
            ]

        m.d.sync += [
            self.done_register.eq(
                (self.waiting & self.steps.ready & self.last)
                | (inp.take & inp.empty & (inp.fault == ErrorCode.NONE))
            ),
            self.error_register.eq(
                Mux(
                    missed & free,
                    ErrorCode.OFF_CURVE,
                    Mux(inp.take, inp.fault, ErrorCode.NONE),
                )
            ),
        ]
        return m


class _Seen:
    """A point seen from the centre, mirrored along y when the arc runs clockwise."""

    def __init__(self, m: Module, name: str, point: dict[str, Signal], clockwise: Value, n: int):
        zero, too_far = Signal(2, name=f"{name}_zero"), Signal(2, name=f"{name}_too_far")
        for index, a in enumerate("xy"):
            value, low = point[a], Signal(name=f"{name}_low_{a}")
            m.d.comb += [
                low.eq(value[:n] == 0),
                zero[index].eq(low & (value[n:] == 0)),
                # −2^n is too far as well.
                too_far[index].eq((value[n] ^ value[n + 1]) | (value[n] & low)),
            ]
        self.too_far = too_far.any()
        self.center = zero.all()
        self.left, self.right = point["x"][-1], ~point["x"][-1] & ~zero[0]
        low, high = point["y"][-1], ~point["y"][-1] & ~zero[1]
        self.below, self.above = Mux(clockwise, high, low), Mux(clockwise, low, high)


def _sum(a: Value, b: Value, carry: Value) -> Value:
    """Add with a carry, in one carry chain."""
    bits = max(len(a), len(b))
    return (Cat(carry, _longer(a, bits)) + Cat(carry, _longer(b, bits)))[1 : bits + 1]


def _longer(value: Value, bits: int) -> Value:
    """Extend a value by its own sign."""
    shape = Value.cast(value).shape()
    top = value[-1] if shape.signed else Const(0, 1)
    return Cat(value, top.replicate(bits - len(value)))


def _few(value: Value) -> Value:
    """Tell the values −4 to 3."""
    return (value[2:].all()) | ~(value[2:].any())


def _moved(value: Value, pulse: Value, negative: Value) -> Value:
    """Add a step to a number of three bits."""
    low, mid = value[0] ^ negative, value[1] ^ negative
    return Cat(
        value[0] ^ pulse,
        value[1] ^ (pulse & low),
        value[2] ^ (pulse & low & mid),
    )
