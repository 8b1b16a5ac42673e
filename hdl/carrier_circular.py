"""The circular interpolator on a constant carrier: the angle of a period, turned by each period."""

from typing import Any, ClassVar

from amaranth import Const, Module, Mux, Signal, Value
from amaranth.hdl import signed
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.arc_input import ArcInput, arc_block_layout
from discreta.hdl.carrier import (
    PERIOD_BITS,
    CarrierOutput,
    increment_layout,
    periods_bits,
    timed_layout,
)
from discreta.hdl.contract import ErrorCode, Part, check_choice, check_width, point_layout
from discreta.hdl.parts import PRELOADS, ControlUnit
from discreta.hdl.parts.angle_meter import (
    ANGLE_INTEGER_BITS,
    AngleMeter,
    angle_bits,
    turnings,
)
from discreta.hdl.parts.coefficient_unit import COEFFICIENTS, CoefficientUnit, factor_bits
from discreta.hdl.parts.divider import Divider

__all__ = ["FORMULAS", "MAX_WIDTH", "CarrierCircular"]

#: At 16 bits the quotient of the angle has 67 bits and all other registers up to 59: wider devices
#: would be beyond what the engines watch.
MAX_WIDTH = 16

FORMULAS = ("rotation", "predictor_corrector", "plain")

#: Products of a coordinate, one after the other, that the first period of a block needs.
_ROUNDS = {"plain": 1, "predictor_corrector": 2, "rotation": 3}


class CarrierCircular(Part):
    r"""Draws an arc in equal angles, one every carrier period.

    With N = ``periods``, A the angle that the arc sweeps and Δφ = A / N, rounded down, from the
    values x, y of the period before alone, seen from the centre, counter-clockwise (clockwise with
    the signs of both products of Δφ and of the sine changed)::

        plain                 x := x − y·Δφ;  y := y + x·Δφ
        predictor_corrector   x* = x − y·Δφ;  y* = y + x·Δφ;
                              x := x − (y + y*)/2·Δφ;  y := y + (x + x*)/2·Δφ
        rotation              Δx := Δx − κ·x;  Δy := Δy − κ·y;  x := x + Δx;  y := y + Δy

    with κ = 2(1 − cos Δφ), and Δx, Δy at first x·κ/2 − y·sin Δφ and y·κ/2 + x·sin Δφ: what the
    period before the start would have made. In every period the steps are put out that lead to the
    whole part of x and y (preload 0) or to that of x + ½ and y + ½; the fractions are kept. No axis
    leaves the coordinates −2^n … 2^n − 1. Period N puts out what is left to the end point, and so
    does period N − 1 when it comes to the end point by itself.

    Registers: P1, P2 = x, y with 2n + 8 bits of fraction; P3, P4 = coordinates now; DX, DY;
    PX, PY = products, which grow bit by bit from the bottom: ``factor`` = Δφ (or κ) turns to the
    right in its register, and every clock one bit of it adds P1, P2 or not and halves the sum.
    ``digit`` = bits to come, ``pass`` = which product it is, ``computed``; ``periods`` = periods
    left; ``timer``; the end XK, YK and the centre XC, YC. UX, UY = means of old and predicted.

    The prepared block has its angle measured by turnings, divided by N, and with ``rotation`` its κ
    and sine worked out by their series or from a table; see
    :class:`~discreta.hdl.parts.angle_meter.AngleMeter`,
    :class:`~discreta.hdl.parts.divider.Divider` and
    :class:`~discreta.hdl.parts.coefficient_unit.CoefficientUnit`.

    Latency: with b = 3n + 8 bits of Δφ, a block accepted in clock 0 is started in clock 4n + b +
    31, with rotation in clock 4n + 16b + 63 (series) or 4n + 6b + 43 (table); its first increments
    wait 2 clocks and 1, 2 or 3 (plain, predictor_corrector, rotation) times b + 1 later.

    Throughput: one result every T clocks, within a block and from block to block, if the next block
    is prepared by then, for T of at least b + 4 (plain), 2b + 5 (predictor_corrector) or 3b + 6
    (rotation) clocks: :attr:`least_period`. The next block is prepared while this one runs. A block
    of no length (start = end = centre) and a rejected block take one clock, and one more behind a
    block that moved.

    Steps: ``steps`` holds the signed steps of a period, n + 2 bits an axis, until they are taken;
    everything waits for it. ``last`` is given with the last ones. ``position`` shows what was
    taken; starting a block loads it with the block's start.

    Reset: everything 0, nothing held, position at the origin.

    Overflow: ``error`` is ``RANGE`` or ``OFF_CURVE`` for one clock, in place of ``done``, for an
    arc that does not fit or whose end is not on it (see :class:`~discreta.hdl.arc_input.ArcInput`);
    ``RANGE`` too when N is 0, T less than the least period, Δφ ½ or more, or, but for rotation, N
    less than (⌊A⌋ + 1)²: the radius would grow beyond e^½ times itself. Nothing moves and the next
    block runs as ever. No register overflows.

    Error bound: the points put out are off the arc of radius R after the angle φ by no more than
    what the formula drifts, about R·φ·Δφ/2 (plain), R·φ·Δφ³/8 (predictor_corrector) or nothing
    (rotation) along the radius, and √½ step (preload ½) or less than √2 (0) for the whole parts;
    see docs/carrier_circular.md. The last increment makes up for the drift: it differs from R·Δφ by
    no more than the formula's whole distance from the arc's end and 2 steps. The end is exact.

    Source: Ukrainian lecture, circular interpolation by digital differential analysers and its
    figure 6.27, with the formulas that the text has lost read as in design.md, 6.6. The
    measurement of the angle, the first Δx and Δy and the admission are ours.

    Parameters
    ----------
    width : int
        n, 4 to 16. Coordinates are signed, n + 1 bits; steps are 1 long.
    formula : str
        ``"plain"``, ``"rotation"`` or ``"predictor_corrector"``.
    coefficient : str
        Where rotation has its coefficient from: ``"series"`` or ``"table"``; the other formulas
        have none.
    preload : str
        What the fractions start from: ``"zero"`` or ``"half"``.

    Attributes
    ----------
    parameters : dict of str to object
        The parameters it was made with.
    preparation, least_period : int
        Clocks from the acceptance of a block to its start at the earliest, and the least T.
    diagram : dict of str to list of Signal
        Every register there is, grouped as in the block diagram, by the group's title.
    registers : dict of str to Signal
        The same registers, by their names in waveforms.
    busy_behind : Signal
        Driven by a second stage: it still works on what was taken, and answers have to wait.
    answered_empty : Signal
        A block of no length is started in this clock.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """

    notation = "n = width, b = 3n + 8, T = blocks_period, N = blocks_periods"

    LECTURE: ClassVar[dict[str, Any]] = {
        "formula": "plain",
        "coefficient": "series",
        "preload": "zero",
    }

    def __init__(
        self,
        width: int = 16,
        *,
        formula: str = "rotation",
        coefficient: str = "series",
        preload: str = "half",
    ):
        check_width(width, MAX_WIDTH)
        check_choice("formula", formula, FORMULAS)
        check_choice("coefficient", coefficient, COEFFICIENTS)
        check_choice("preload", preload, PRELOADS)
        super().__init__(
            {
                "blocks": In(stream.Signature(timed_layout(arc_block_layout(width), width))),
                "steps": Out(stream.Signature(increment_layout(width))),
                "position": Out(point_layout(width, 2)),
                "busy": Out(1),
                "done": Out(1),
                "error": Out(ErrorCode),
            }
        )
        self.width = width
        self.formula = formula
        self.coefficient = coefficient
        self.preload = preload
        self.parameters: dict[str, object] = {
            "width": width,
            "formula": formula,
            "coefficient": coefficient,
            "preload": preload,
        }
        n, bits = width, factor_bits(width)
        rotation = formula == "rotation"
        self.fraction_bits = 2 * n + 8
        self.least_period = _ROUNDS[formula] * (bits + 1) + 3

        self.input = ArcInput(n)
        self.angle = AngleMeter(n)
        self.divider = Divider(ANGLE_INTEGER_BITS + bits, periods_bits(n), name="_angle")
        self.unit = CoefficientUnit(n, coefficient=coefficient) if rotation else None
        self.uu = ControlUnit()
        self.output = CarrierOutput(n)

        # The stages of the preparation after that of the radius meter.
        self.second = turnings(n) + 1
        self.dividing = 2 * self.second
        self.divided = self.dividing + len(self.divider.quotient) + 1
        self.prepared = self.divided + 2 * rotation
        self.preparation = 2 * n + 5 + self.prepared
        if self.unit is not None:
            self.preparation += len(self.unit.program) * (bits + 2)
        self.stage = Signal(range(self.prepared + 1))
        self.next_end = {a: Signal(signed(n + 1), name=f"next_end_{a}") for a in "xy"}
        self.next_clockwise = Signal()
        self.next_periods = Signal(periods_bits(n))
        self.next_period = Signal(PERIOD_BITS)

        full = signed(n + 3 + self.fraction_bits)
        self.place = {a: Signal(full, name=name) for a, name in (("x", "p1"), ("y", "p2"))}
        self.product = {a: Signal(full, name=f"p{a}") for a in "xy"}
        self.increment = {a: Signal(full, name=f"d{a}") for a in "xy"}
        self.mean = {a: Signal(full, name=f"u{a}") for a in "xy"}
        self.factor, self.other = Signal(bits, name="factor"), Signal(bits, name="other")
        self.digit = Signal(range(bits + 1))
        self.round = Signal(2, name="pass")
        self.computed = Signal()
        self.center = {a: Signal(signed(n + 1), name=f"{a}c") for a in "xy"}
        self.end = {a: Signal(signed(n + 1), name=f"{a}k") for a in "xy"}
        self.clockwise = Signal()
        self.periods = Signal(periods_bits(n))
        self.period = Signal(PERIOD_BITS)
        self.busy_behind = Signal()
        self.answered_empty = Signal()

        inp, out, uu, meter = self.input, self.output, self.uu, self.input.meter
        groups = {
            "P1, P2 coordinates seen from the centre": [*self.place.values()],
            "increments": [*self.increment.values()] if rotation else [],
            "products": [
                *self.product.values(),
                *([*self.mean.values()] if formula == "predictor_corrector" else []),
                self.factor,
                *([self.other] if rotation else []),
                self.digit,
                *([] if formula == "plain" else [self.round]),
                self.computed,
            ],
            "P3, P4 position": [*out.place.values()],
            "carrier": [self.periods, self.period, out.timer],
            "arc": [*self.center.values(), *self.end.values(), self.clockwise],
            "УУ": [uu.running, uu.done_register, uu.error_register],
            "increments that wait": [out.waiting_register, *out.out.values()],
            "prepared block": [
                inp.held_register,
                inp.fault_register,
                inp.empty_register,
                *inp.start_registers.values(),
                *inp.center_registers.values(),
                inp.swap_register,
                *inp.negative_registers.values(),
                inp.turns_register,
                *self.next_end.values(),
                self.next_clockwise,
                self.next_periods,
                self.next_period,
                self.stage,
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
            "angle meter and divider": [
                *(self.angle.vx, self.angle.vy, self.angle.angle),
                *(self.divider.quotient, self.divider.rest),
            ],
            "coefficient": [] if self.unit is None else self.unit.registers,
        }
        self.diagram: dict[str, list[Signal]] = {
            title: [Value.cast(register) for register in group]
            for title, group in groups.items()
            if group
        }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        inp, out, uu = self.input, self.output, self.uu
        m.submodules.input = inp
        m.submodules.uu = uu
        m.submodules.output = out
        bad = self._prepare(m)
        m.d.comb += [
            inp.take.eq(uu.start),
            uu.pending.eq(
                (self.stage == self.prepared)
                & ~(self.busy_behind & (bad | inp.empty | (inp.fault != ErrorCode.NONE)))
            ),
            uu.fault.eq(
                Mux(bad & (inp.fault == ErrorCode.NONE), Const(1), inp.fault.as_value()),
            ),
            uu.empty.eq(inp.empty),
            uu.waiting.eq(out.waiting),
            uu.ready.eq(self.steps.ready),
            self.answered_empty.eq(uu.load & uu.empty),
            self.steps.valid.eq(out.waiting),
            self.steps.payload.last.eq(uu.last),
            self.steps.payload.x.eq(out.out["x"]),
            self.steps.payload.y.eq(out.out["y"]),
            self.busy.eq(inp.held | ~uu.idle),
            self.done.eq(uu.done),
            self.error.eq(uu.error),
            self.position.x.eq(out.place["x"]),
            self.position.y.eq(out.place["y"]),
        ]

        finish, complete = Signal(), Signal()
        due, final = Signal(name="due"), Signal(name="final")
        m.d.comb += [
            finish.eq(uu.clock & ~self.computed & (self.digit == 0)),
            due.eq(uu.clock & self.computed & out.due),
            out.load.eq(uu.load),
            out.start.eq(inp.start),
            out.put.eq(due),
            out.period.eq(self.period),
            out.taken.eq(uu.taken),
            uu.ending.eq(self.computed & out.due & final),
        ]
        self._multiply(m, finish, complete, due)
        with m.If(uu.load):
            m.d.sync += self.computed.eq(0)
        with m.Elif(finish & complete):
            m.d.sync += self.computed.eq(1)
        with m.Elif(due):
            m.d.sync += [self.computed.eq(0), self.periods.eq(self.periods - 1)]
        with m.If(uu.load):
            m.d.sync += [
                self.periods.eq(self.next_periods),
                self.period.eq(self.next_period),
                self.clockwise.eq(self.next_clockwise),
                *[self.center[a].eq(inp.center_registers[a]) for a in "xy"],
                *[self.end[a].eq(self.next_end[a]) for a in "xy"],
            ]

        # The whole parts, as coordinates that there are.
        top = (1 << self.width) - 1
        arrived = Signal(2)
        last = self.periods == 1
        for index, a in enumerate("xy"):
            half = 1 << (self.fraction_bits - 1) if self.preload == "half" else 0
            whole = Signal(signed(self.width + 5), name=f"whole_{a}")
            target = Signal(signed(self.width + 1), name=f"target_{a}")
            m.d.comb += [
                whole.eq(((self.place[a] + half) >> self.fraction_bits) + self.center[a]),
                target.eq(Mux(whole > top, top, Mux(whole < ~top, ~top, whole))),
                arrived[index].eq(target == self.end[a]),
                out.increment[a].eq(Mux(last, self.end[a], target) - out.reached[a]),
            ]
        m.d.comb += final.eq(last | ((self.periods == 2) & arrived.all()))
        return m

    def _prepare(self, m: Module) -> Signal:
        """Describe what prepares a block; the signal tells that its timing is out of range."""
        inp, angle, divider, stage = self.input, self.angle, self.divider, self.stage
        m.submodules.angle_meter = angle
        m.submodules.divider = divider
        block = self.blocks.payload
        for field in ("start", "end", "center", "clockwise", "full_turns"):
            m.d.comb += getattr(inp.blocks.payload, field).eq(getattr(block, field))
        m.d.comb += [
            inp.blocks.valid.eq(self.blocks.valid),
            self.blocks.ready.eq(inp.blocks.ready),
        ]
        with m.If(self.blocks.valid & self.blocks.ready):
            m.d.sync += [
                *[self.next_end[a].eq(block.end[a]) for a in "xy"],
                self.next_clockwise.eq(block.clockwise),
                self.next_periods.eq(block.periods),
                self.next_period.eq(block.period),
            ]
        bits, least = factor_bits(self.width), self.least_period
        goes = self._goes(m)
        with m.If(self.uu.start):
            m.d.sync += stage.eq(0)
        with m.Elif(stage == 0):
            m.d.sync += stage.eq(inp.pending)
        with m.Elif(goes):
            m.d.sync += stage.eq(stage + 1)
        second = stage > self.second
        m.d.comb += [
            angle.start.eq(inp.from_xy),
            angle.end.eq(inp.to_xy),
            angle.turns.eq(inp.first_turns),
            angle.load_end.eq(stage == 0),
            angle.load_start.eq(stage == self.second),
            angle.turn.eq(stage < self.dividing),
            angle.subtract.eq(second),
            angle.index.eq(Mux(second, stage - (self.second + 1), stage - 1)),
            divider.load.eq(stage == self.dividing),
            divider.dividend.eq(angle.positive << (bits - angle_bits(self.width))),
            divider.divisor.eq(self.next_periods),
            divider.divide.eq((stage > self.dividing) & (stage < self.divided)),
        ]
        bad, few = Signal(name="bad"), Signal(name="few")
        around = Signal(ANGLE_INTEGER_BITS + 1)
        m.d.comb += [
            around.eq((angle.positive >> angle_bits(self.width)) + 1),
            few.eq(0 if self.unit is not None else self.next_periods < around * around),
            bad.eq(
                (self.next_periods == 0)
                | (self.next_period < least)
                | (~inp.empty & (divider.quotient[bits - 1 :].any() | few))
            ),
        ]
        return bad

    def _goes(self, m: Module) -> Value:
        """Tell whether the preparation goes on with its next stage, after a clock of each."""
        goes = self.stage != self.prepared
        if self.unit is not None:
            m.submodules.coefficient_unit = self.unit
            m.d.comb += [
                self.unit.begin.eq(self.stage == self.divided),
                self.unit.angle.eq(self.divider.quotient),
            ]
            goes &= ~((self.stage == self.divided + 1) & self.unit.busy)
        return goes

    def _multiply(self, m: Module, finish: Signal, complete: Signal, due: Signal) -> None:
        """Describe the products of a period, and what is made of them."""
        uu, inp, bits = self.uu, self.input, factor_bits(self.width)
        angle = self.divider.quotient[:bits]
        start = {
            a: (inp.start_registers[a] - inp.center_registers[a]) << self.fraction_bits
            for a in "xy"
        }
        bit = self.factor[0]
        across, along = self.product["y"], self.product["x"]
        # What turning counter-clockwise by the factor adds, before and after the sign.
        turned = {
            "x": Mux(self.clockwise, across, -across),
            "y": Mux(self.clockwise, -along, along),
        }
        multiplying = uu.clock & ~self.computed & (self.digit != 0)
        with m.If(uu.load | finish | due):
            m.d.sync += self.digit.eq(bits)
        with m.Elif(multiplying):
            m.d.sync += self.digit.eq(self.digit - 1)

        multiplicand: dict[str, Value] = {**self.place}
        begun = self.round == 0
        if self.formula == "predictor_corrector":
            multiplicand = {a: Mux(begun, self.place[a], self.mean[a]) for a in "xy"}
        for a in "xy":
            place, product = self.place[a], self.product[a]
            with m.If(uu.load | finish | due):
                m.d.sync += product.eq(0)
            with m.Elif(multiplying):
                m.d.sync += product.eq((product + Mux(bit, multiplicand[a], 0)) >> 1)
            with m.If(uu.load):
                m.d.sync += place.eq(start[a])
            with m.Elif(finish):
                if self.formula == "plain":
                    m.d.sync += place.eq(place + turned[a])
                elif self.formula == "predictor_corrector":
                    with m.If(begun):
                        m.d.sync += self.mean[a].eq((2 * place + turned[a]) >> 1)
                    with m.Else():
                        m.d.sync += place.eq(place + turned[a])
                else:
                    increment = self.increment[a]
                    with m.If(begun):
                        m.d.sync += increment.eq(product >> 1)
                    with m.Elif(self.round == 1):
                        m.d.sync += increment.eq(increment + turned[a])
                    with m.Else():
                        m.d.sync += [
                            increment.eq(increment - product),
                            place.eq(place + increment - product),
                        ]

        # The factor comes round; rotation has two of them.
        if self.formula == "rotation":
            assert self.unit is not None
            m.d.comb += complete.eq(self.round == 2)
            with m.If(uu.load):
                m.d.sync += [
                    self.factor.eq(self.unit.kappa),
                    self.other.eq(self.unit.sine),
                    self.round.eq(0),
                ]
            with m.Elif(finish & ~complete):
                m.d.sync += [
                    self.factor.eq(self.other),
                    self.other.eq(self.factor),
                    self.round.eq(self.round + 1),
                ]
            with m.Elif(multiplying):
                m.d.sync += self.factor.eq(self.factor.rotate_right(1))
            return
        m.d.comb += complete.eq(1 if self.formula == "plain" else ~begun)
        with m.If(uu.load):
            m.d.sync += self.factor.eq(angle)
        with m.Elif(multiplying):
            m.d.sync += self.factor.eq(self.factor.rotate_right(1))
        if self.formula == "predictor_corrector":
            with m.If(uu.load | due):
                m.d.sync += self.round.eq(0)
            with m.Elif(finish):
                m.d.sync += self.round.eq(1)
