"""Broken variants of the interpolators, and which rungs of the ladder must catch each.

A variant is the sound device with a few assignments added behind its own: in Amaranth the last one
wins. Its registers keep their names, so it can be simulated, compiled, converted and proven like
the sound one.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal
from amaranth.hdl import Value

from discreta.hdl.carrier_circular import CarrierCircular
from discreta.hdl.carrier_linear import CarrierLinear
from discreta.hdl.circular import Circular
from discreta.hdl.comparison import Comparison
from discreta.hdl.conic import Conic
from discreta.hdl.contract import ErrorCode, Part
from discreta.hdl.exact_arc import ExactArc
from discreta.hdl.exact_line import ExactLine
from discreta.hdl.linear import Linear
from discreta.hdl.two_stage import TwoStage
from discreta.sim.golden.carrier_circular import CarrierCircular as GoldenCarrierCircular
from discreta.sim.golden.carrier_linear import CarrierLinear as GoldenCarrierLinear
from discreta.sim.golden.circular import Circular as GoldenCircular
from discreta.sim.golden.comparison import Comparison as GoldenComparison
from discreta.sim.golden.conic import Conic as GoldenConic
from discreta.sim.golden.linear import Linear as GoldenLinear
from discreta.sim.golden.logic import equal, where
from discreta.sim.golden.two_stage import TwoStage as GoldenTwoStage
from discreta.sim.methods import METHODS, Method

__all__ = ["SOUND", "VARIANTS", "Variant"]

DOCUMENTS, SIMULATION, EQUIVALENCE, PROMISES, COMPILED, ICARUS, VERILATOR = ALL = (
    "documents",
    "simulation",
    "equivalence",
    "promises",
    "compiled",
    "Icarus",
    "Verilator",
)
VERILOG = {ICARUS, VERILATOR}

#: The rungs that compare registers with the golden model.
REGISTERS = {SIMULATION, EQUIVALENCE, COMPILED}


@dataclass(frozen=True)
class Variant:
    """A design to send up the ladder.

    Attributes
    ----------
    method : Method
        Sound device and golden model.
    name, what : str
        What it is called, and what is broken, in one line.
    caught_by : set of str
        The rungs that must catch it; all others must let it pass.
    options : dict
        The parameters of the device besides its width.
    break_it : callable
        Breaks a sound device that has just been made.
    """

    method: Method
    name: str
    what: str
    caught_by: set[str] = field(default_factory=set)
    options: dict[str, Any] = field(default_factory=dict)
    break_it: Callable[[Any], None] = lambda _: None

    def device(self, width: int) -> Part:
        """Make the device."""
        core = self.method.core(width, **self.options)
        self.break_it(core)
        return core

    def golden(self, width: int) -> Any:
        """Make the golden model that goes with it."""
        return self.method.model(width, **self.options)


#: Arcs on a carrier by the formula that is quickest to prepare and to run.
PLAIN: dict[str, Any] = {"formula": "plain", "coefficient": "series", "preload": "half"}
#: The same with a corrector.
CORRECTED: dict[str, Any] = PLAIN | {"formula": "predictor_corrector"}

SOUND = [
    Variant(METHODS["linear"], "sound line", "nothing: normalized, preload half"),
    Variant(
        METHODS["linear"],
        "sound line, plain",
        "nothing: as in the documents, not normalized, preload zero",
        options=METHODS["linear"].settings["lecture"],
    ),
    Variant(METHODS["comparison"], "sound comparison", "nothing: one signed summator"),
    Variant(
        METHODS["comparison"],
        "sound comparison, lecture",
        "nothing: two summators, as in the article's table",
        options=METHODS["comparison"].settings["lecture"],
    ),
    Variant(METHODS["circular"], "sound arc", "nothing: the default setting"),
    Variant(
        METHODS["circular"],
        "sound arc, lecture",
        "nothing: as in the lecture's block diagram",
        options=METHODS["circular"].settings["lecture"],
    ),
    Variant(METHODS["exact_line"], "sound exact line", "nothing"),
    Variant(METHODS["exact_arc"], "sound exact arc", "nothing"),
    Variant(METHODS["exact_conic"], "sound exact conic", "nothing"),
    Variant(METHODS["conic"], "sound conic", "nothing: the default setting"),
    Variant(
        METHODS["conic"],
        "sound conic, lecture",
        "nothing: summed as in the lecture's block diagram",
        options=METHODS["conic"].settings["lecture"],
    ),
    Variant(METHODS["carrier_linear"], "sound carrier line", "nothing: preload half"),
    Variant(
        METHODS["carrier_linear"],
        "sound carrier line, lecture",
        "nothing: preload zero",
        options=METHODS["carrier_linear"].settings["lecture"],
    ),
    Variant(
        METHODS["carrier_circular"],
        "sound carrier arc",
        "nothing: the plain formula, preload half",
        options=PLAIN,
    ),
    Variant(
        METHODS["carrier_circular"],
        "sound carrier arc, lecture",
        "nothing: the plain formula, preload zero",
        options=METHODS["carrier_circular"].settings["lecture"],
    ),
    Variant(METHODS["carrier_circular"], "sound carrier arc, rotation", "nothing: the default"),
    Variant(METHODS["two_stage_linear"], "sound two-stage line", "nothing: preload half"),
    Variant(
        METHODS["two_stage_circular"],
        "sound two-stage arc",
        "nothing: the plain formula, preload half",
        options=PLAIN,
    ),
]
VARIANTS: list[Variant] = []


def _variant(
    method: str, caught_by: set[str], *, golden: Callable[..., Any] | None = None, **options: Any
) -> Callable[[Callable[[Any], None]], None]:
    """List a function that breaks a device, under its name and with its docstring.

    ``golden`` replaces the golden model, by one that makes the same mistake.
    """
    broken = METHODS[method] if golden is None else replace(METHODS[method], golden=golden)

    def add(break_it: Callable[[Any], None]) -> None:
        name, what = break_it.__name__.replace("_", " "), break_it.__doc__ or ""
        VARIANTS.append(Variant(broken, name, what, caught_by, options, break_it))

    return add


_line, _arc = partial(_variant, "linear"), partial(_variant, "circular")
_exact_arc = partial(_variant, "exact_arc")
_exact_line = partial(_variant, "exact_line")
_conic = partial(_variant, "conic")
_comparison = partial(_variant, "comparison")
_carrier_line = partial(_variant, "carrier_linear")
_carrier_arc = partial(_variant, "carrier_circular", **PLAIN)
_two_stage = partial(_variant, "two_stage_linear")


def _amend(part: Part, change: Callable[[Module], None]) -> None:
    """Let ``change`` have the last word whenever the part describes its hardware."""
    elaborate = part.elaborate

    def amended(platform):
        m = elaborate(platform)
        change(m)
        return m

    part.elaborate = amended


def _assign(part: Part, target: Value, value: Any) -> None:
    """Assign a value to one of the part's combinational signals, in place of its own."""

    def change(m: Module) -> None:
        m.d.comb += target.eq(value)

    _amend(part, change)


# Broken sums, counters and steps: whoever looks at a single line sees it.


@_line({*ALL})
def carry_dropped(core: Linear) -> None:
    """When SX and SY carry in the same clock, the step of x is dropped."""
    x, y = core.summator["x"].carry, core.summator["y"].carry
    _assign(core, core.output.carry["x"], x & ~y)


@_line({*ALL})
def counter_not_stopping(core: Linear) -> None:
    """P5 never counts down: a line along x never ends."""
    _assign(core, core.remaining["x"].count, 0)


@_line({*ALL})
def normalized_too_far(core: Linear) -> None:
    """The increments are shifted one place too far, and their top bits are lost."""

    def change(m: Module) -> None:
        for a, register in core.increment.items():
            m.d.comb += register.initial.eq(m.submodules.normalizer.normalized[a] << 1)

    _amend(core, change)


@_line({*ALL})
def wrong_preload(core: Linear) -> None:
    """Both summators start a block from M/2 − 1 instead of M/2."""
    for summator in core.summator.values():
        summator.preloaded -= 1


@_line({*ALL})
def early_end(core: Linear) -> None:
    """A block ends when one of its counters is empty, not both."""
    remaining = core.remaining
    _assign(core, core.uu.ending, remaining["x"].ending | remaining["y"].ending)


# The steps are right, the coordinates are not: the documents' program judges the steps alone.
@_line({*ALL} - {DOCUMENTS})
def position_too_soon(core: Linear) -> None:
    """P3 counts with the carry, a clock before its step can be taken."""
    carry, negative = core.summator["x"].carry, core.output.direction_registers["x"]
    _assign(core, core.place["x"].up, carry & ~negative)
    _assign(core, core.place["x"].down, carry & negative)


# Between two blocks: invisible to a single line from reset.


@_line({*ALL})
def preload_forgotten(core: Linear) -> None:
    """Only reset sets SX to its preload; a block starts from what the one before left."""
    _assign(core, core.summator["x"].load, 0)


@_line({*ALL})
def turned_too_soon(core: Linear) -> None:
    """The sign of a step is that of the prepared block, not of the running one."""
    _assign(core, core.output.load, 1)


@_line({*ALL})
def answer_lost(core: Linear) -> None:
    """An empty block starts while the last step before it is taken: two blocks, one answer."""
    uu = core.uu
    _assign(uu, uu.start, uu.pending & ~uu.running & (~uu.waiting | uu.ready))


# Only with the right stimuli: neither the documents nor the survey stalls, errs or resets.


@_line({*ALL} - {DOCUMENTS, COMPILED})
def step_lost_under_stall(core: Linear) -> None:
    """A step that is not taken is forgotten, and the next one is computed."""
    _assign(core, core.uu.ready, 1)


@_line({*ALL} - {DOCUMENTS, COMPILED})
def fault_not_raised(core: Linear) -> None:
    """A block that is too long is run with the low bits of its lengths."""
    _assign(core, core.uu.fault, ErrorCode.NONE)


# The promises start from the initial values, and the other benches reset nothing that runs.
@_line({EQUIVALENCE} | VERILOG)
def reset_incomplete(core: Linear) -> None:
    """A step of x that waits survives a reset, and is taken after it."""
    fresh = Signal.like(core.registers["pulse_x"], name="pulse_x", reset_less=True)
    core.registers["pulse_x"] = core.output.pulse_registers["x"] = fresh


# No simulation gets there: with preload zero all counters are empty at the same time, so what an
# empty counter lets through is 0; and no bench runs for 65,536 clocks.


@_line({EQUIVALENCE, PROMISES}, preload="zero")
def sum_not_gated(core: Linear) -> None:
    """SX goes on summing when its counter is empty."""
    _assign(core, core.summator["x"].enable, core.uu.clock)


@_line({EQUIVALENCE, PROMISES})
def late_failure(core: Linear) -> None:
    """A counter that no one watches drops a step of x every 65,536 clocks."""
    clocks = Signal(16)

    def change(m: Module) -> None:
        m.d.sync += clocks.eq(clocks + 1)
        m.d.comb += core.output.carry["x"].eq(core.summator["x"].carry & ~clocks.all())

    _amend(core, change)


# Equal to its golden model, and wrong: only what does not rest on the golden model sees it.


class _AxisMisread(GoldenLinear):
    """The mistake of :func:`axis_misread`, made a second time."""

    def step(self, state, inputs):
        after = super().step(state, inputs)
        accept = inputs["blocks_valid"] & self.outputs(state)["blocks_ready"]
        return after | {"negative_y": after["negative_y"] ^ accept}


class _StallMisread(GoldenLinear):
    """The mistake of :func:`stall_misread`, made a second time."""

    def step(self, state, inputs):
        return super().step(state, inputs | {"steps_ready": 1})


@_line({DOCUMENTS, PROMISES, COMPILED}, golden=_AxisMisread)
def axis_misread(core: Linear) -> None:
    """Device and golden model both take y to grow downwards, as on a screen."""
    inp = core.input

    def change(m: Module) -> None:
        with m.If(inp.blocks.valid & inp.blocks.ready):
            block = inp.blocks.payload
            m.d.sync += inp.negative_registers["y"].eq(block.end.y >= block.start.y)

    _amend(inp, change)


@_line({PROMISES}, golden=_StallMisread)
def stall_misread(core: Linear) -> None:
    """Device and golden model both take a step to be gone after a clock, taken or not."""
    _assign(core, core.uu.ready, 1)


# Arcs. Broken sums, counters and frames: whoever looks at some arcs sees it.


def _turns(core: Circular) -> Value:
    """Tell the clock in which the frame is turned."""
    return core.uu.clock & ~core.fresh & (core.turns != 0) & core.p3.zero


def _put_out(core: Circular, step_x: Value, step_y: Value) -> None:
    """Have these steps in place of the device's own, wherever they go."""

    def change(m: Module) -> None:
        m.d.comb += [
            core.p1.down.eq(step_x & ~core.backward),
            core.p1.up.eq(step_x & core.backward),
            core.p2.up.eq(step_y),
            core.p3.count.eq(step_x),
            core.p4.count.eq(step_y),
            core.output.carry.x.eq(Mux(core.swap, step_y, step_x)),
            core.output.carry.y.eq(Mux(core.swap, step_x, step_y)),
        ]

    _amend(core, change)


@_arc({*ALL})
def sign_as_printed(core: Circular) -> None:
    """P1 counts up when X steps, as the lecture prints it, and not down."""
    _assign(core, core.p1.up, core.p3.count)
    _assign(core, core.p1.down, 0)


@_arc({*ALL})
def order_swapped(core: Circular) -> None:
    """SY adds the X from before the summation, though the order is alternated."""

    def change(m: Module) -> None:
        m.d.comb += core.sy.addend.eq(m.submodules.normalizer.normalized.x)

    _amend(core, change)


@_arc({*ALL})
def half_increment_forgotten(core: Circular) -> None:
    """The first clock leaves SX at M/2."""
    _assign(core, core.sx.load, core.uu.load | _turns(core))


@_arc({*ALL})
def fraction_not_turned(core: Circular) -> None:
    """At a crossing SX takes over SY as it is, though the axis falls now."""

    def change(m: Module) -> None:
        with m.If(_turns(core)):
            m.d.comb += core.sx.initial.eq(core.sy.register)

    _amend(core, change)


@_arc({*ALL})
def direction_not_turned(core: Circular) -> None:
    """At a crossing both axes go on in the direction in which they moved."""
    _assign(core, core.output.load, core.uu.load)


@_arc({*ALL})
def axes_not_swapped(core: Circular) -> None:
    """X is always the machine's x, in every quadrant."""
    _assign(core, core.output.carry.x, core.p3.count)
    _assign(core, core.output.carry.y, core.p4.count)


@_arc({*ALL})
def a_crossing_too_many(core: Circular) -> None:
    """An arc of several pieces is loaded with one turn more than it has."""

    def change(m: Module) -> None:
        with m.If(core.uu.load):
            turns = core.input.first_turns
            m.d.sync += core.turns.eq(turns + (turns != 0))

    _amend(core, change)


@_arc({*ALL})
def counters_loaded_too_early(core: Circular) -> None:
    """The counters of the last piece are loaded on entering the one before it."""

    def change(m: Module) -> None:
        y, xk = core.p2.register, core.xk.register
        left = Mux(y < xk, xk - y, y - xk)
        early = core.turns == 2
        with m.If(_turns(core)):
            m.d.comb += core.p3.initial.eq(Mux(early, left, y))
            m.d.comb += core.p4.initial.eq(Mux(early, core.yk.register, core.limit.register))

    _amend(core, change)


@_arc({*ALL})
def completing_step_missing(core: Circular) -> None:
    """What is left when there can be no more carries is never put out."""
    _put_out(core, core.sx.carry, core.sy.carry)


@_arc({*ALL})
def backward_ignored(core: Circular) -> None:
    """An X that lies short of its end is summed on, and P1 counts down."""

    def change(m: Module) -> None:
        with m.If(_turns(core)):
            m.d.sync += core.backward.eq(0)

    _amend(core, change)


@_arc({*ALL}, **METHODS["circular"].settings["lecture"])
def limit_ignored(core: Circular) -> None:
    """An axis may rise as far as n bits go."""
    _assign(core.input, core.input.limit, 2**core.width - 1)


# An end that is just a step off: the arcs of a survey end nearer to their circles.
@_arc({*ALL} - {COMPILED})
def radius_check_off_by_one(core: Circular) -> None:
    """An end that is a whole step outside the circle is refused."""
    meter = core.input.meter
    difference, root = meter.end_square, meter.root_register
    near = (difference + root >= 1) & (difference - 1 < root) & (root != 0)
    _assign(meter, meter.near, near)


# The steps are right, the coordinates are not: the documents judge the steps alone.
@_arc({*ALL} - {DOCUMENTS})
def centre_ignored(core: Circular) -> None:
    """XT starts from the start as it is seen from the centre."""
    inp = core.input
    _assign(core, core.xt.initial, inp.start.x - inp.center_registers["x"])


# Only with the right stimuli: neither the documents nor the survey stalls or errs.


@_arc({*ALL} - {DOCUMENTS, COMPILED})
def off_curve_not_refused(core: Circular) -> None:
    """An arc is run wherever it ends, unless it starts from its centre."""
    _assign(core.input.meter, core.input.meter.near, core.input.meter.root_register != 0)


@_arc({*ALL} - {DOCUMENTS, COMPILED})
def crossing_does_not_wait(core: Circular) -> None:
    """The frame is turned while the step before it still waits, which turns with it."""

    def change(m: Module) -> None:
        turn = core.uu.running & ~core.fresh & (core.turns != 0) & core.p3.zero
        parts = (core.p1, core.p2, core.p3, core.p4, core.sx, core.sy, core.output)
        with m.If(turn):
            m.d.comb += [part.load.eq(1) for part in parts]
            m.d.sync += [core.turns.eq(core.turns - 1), core.swap.eq(~core.swap)]

    _amend(core, change)


# Equal to its golden model, and wrong.


class _WayMisread(GoldenCircular):
    """The mistake of :func:`way_misread`, made a second time."""

    def step(self, state, inputs):
        return super().step(state, inputs | {"blocks_clockwise": inputs["blocks_clockwise"] ^ 1})


class _RimMisread(GoldenCircular):
    """The mistake of :func:`rim_misread`, made a second time."""

    def step(self, state, inputs):
        after = super().step(state, inputs)
        measured = equal(state["tick"], 2 * self.width + 4) & after["empty"]
        at_rim = equal(state["center_x"], 2**self.width - 1)
        return after | {"fault": where(measured & at_rim, 1, after["fault"])}


@_arc({DOCUMENTS, PROMISES, COMPILED}, golden=_WayMisread)
def way_misread(core: Circular) -> None:
    """Device and golden model both take clockwise for counter-clockwise."""
    _assign(core, core.input.blocks.payload.clockwise, ~core.blocks.payload.clockwise)


@_arc({PROMISES}, golden=_RimMisread)
def rim_misread(core: Circular) -> None:
    """Device and golden model both take a block of no length at the rim to go round."""
    inp = core.input

    def change(m: Module) -> None:
        at_rim = inp.center_registers["x"] == 2**core.width - 1
        measured = inp.meter.measured & ~(inp.blocks.valid & inp.blocks.ready)
        with m.If(measured & inp.meter.zero & at_rim):
            m.d.sync += inp.fault_register.eq(ErrorCode.RANGE)

    _amend(inp, change)


# Curves of the second order. Broken sums, derivatives and pieces: whoever looks at some sees it.


def _sums(core: Conic) -> Value:
    """Tell a clock in which a carry or a borrow would be a step."""
    return core.adders[0].enable | core.adders[1].enable


@_conic({*ALL})
def borrow_taken_for_a_carry(core: Conic) -> None:
    """A borrow is a step upwards, and M is taken off the sum instead of added."""
    for adder in core.adders:
        _assign(adder, adder.step[1], 0)


@_conic({*ALL})
def b_forgotten(core: Conic) -> None:
    """A step of y does not change GX."""
    converter = core.converter["x"]
    _assign(core, converter.y_step, 0)


@_conic({*ALL})
def turns_not_counted(core: Conic) -> None:
    """No change of direction is counted: the last piece is never entered."""

    def change(m: Module) -> None:
        with m.If(core.output.load & ~core.uu.load):
            m.d.sync += core.turns.eq(core.turns)

    _amend(core, change)


@_conic({*ALL})
def half_increment_on_the_wrong_axis(core: Conic) -> None:
    """The first increment is halved of the axis that is added to second."""
    first, second = core.adders
    bent = Cat(core.coefficients[k] for k in "abc").any()

    def change(m: Module) -> None:
        with m.If(core.fresh & bent):
            m.d.comb += [first.change.eq(0), second.change.eq(-(second.velocity >> 1))]

    _amend(core, change)


@_conic({*ALL})
def still_axis_holds_up(core: Conic) -> None:
    """The derivative of an axis that does not go is not left out of the scale."""

    def change(m: Module) -> None:
        increments = core.normalizer.increments
        m.d.comb += [increments.x.eq(core.gx), increments.y.eq(core.gy)]

    _amend(core, change)


@_conic({*ALL})
def completing_steps_missing(core: Conic) -> None:
    """What is left when there can be no more carries and borrows is never put out."""

    def change(m: Module) -> None:
        with m.If(core.uu.clock & (core.turns == 0) & ~_sums(core)):
            m.d.comb += [core.p3.count.eq(0), core.p4.count.eq(0), core.uu.ending.eq(0)]
            m.d.comb += [core.output.carry.x.eq(0), core.output.carry.y.eq(0)]
            m.d.comb += [converter.move.eq(0) for converter in core.converter.values()]
            m.d.sync += [core.p1.eq(core.p1), core.p2.eq(core.p2)]

    _amend(core, change)


@_conic({*ALL})
def own_change_forgotten(core: Conic) -> None:
    """A step of the second axis adds nothing to its sum, as in order alternated."""
    _assign(core, core.adders[1].own, 0)


@_conic({*ALL}, **METHODS["conic"].settings["lecture"])
def falling_sum_not_complemented(core: Conic) -> None:
    """The sum of an axis that falls starts from 0 too."""

    def change(m: Module) -> None:
        with m.If(core.uu.load):
            m.d.sync += [core.sx.eq(0), core.sy.eq(0)]

    _amend(core, change)


# The steps are right, the coordinates are not: the documents judge the steps alone.
@_conic({*ALL} - {DOCUMENTS})
def position_not_loaded(core: Conic) -> None:
    """XT goes on from where the block before ended."""
    _assign(core, core.xt.load, 0)


# Only with the right stimuli: neither the documents nor the survey stalls, errs, resets, or gives
# wrong turns.


@_conic({*ALL} - {DOCUMENTS, COMPILED})
def conic_step_lost_under_stall(core: Conic) -> None:
    """A step that is not taken is forgotten, and the next one is computed."""
    _assign(core, core.uu.ready, 1)


@_conic({*ALL} - {DOCUMENTS, COMPILED})
def sharp_not_refused(core: Conic) -> None:
    """A curve is run however sharp it is at its start, or without a direction."""
    _assign(core, core.uu.fault, ErrorCode.NONE)


@_conic({*ALL} - {DOCUMENTS, COMPILED})
def end_without_a_step_unanswered(core: Conic) -> None:
    """A block whose last change of direction finds the end reached is never done."""
    _assign(core, core.uu.stepless, 0)


@_conic({EQUIVALENCE} | VERILOG)
def preparation_not_reset(core: Conic) -> None:
    """A block that is being prepared survives a reset, with what was prepared of it lost."""
    fresh = Signal.like(core.held, name="held", reset_less=True)
    core.registers["held"] = core.held = fresh


# Equal to its golden model, and wrong.


class _SideMisread(GoldenConic):
    """The mistake of :func:`side_misread`, made a second time."""

    def step(self, state, inputs, tell=lambda _, value: value):
        misread = inputs | {"blocks_clockwise": inputs["blocks_clockwise"] ^ 1}
        return super().step(state, misread, tell)


# A survey of conics tells the largest error, but there is no bound that it could be held to; and
# what the promises say of a direction they say of the register.
@_conic({DOCUMENTS}, golden=_SideMisread)
def side_misread(core: Conic) -> None:
    """Device and golden model both take clockwise for counter-clockwise."""

    def change(m: Module) -> None:
        with m.If(core.blocks.valid & core.blocks.ready):
            m.d.sync += core.clockwise.eq(~core.blocks.payload.clockwise)

    _amend(core, change)


# Comparison lines. A broken rule, sum, counter or end: whoever looks at all lines sees it.


def _sum_up(core: Comparison, by_x: Value, by_y: Value) -> None:
    """Have S change by these, by a step of x and by one of y, in place of its own change."""
    s = core.sums["s"]

    def change(m: Module) -> None:
        with m.If(core.uu.clock):
            m.d.sync += s.eq(Mux(core.turn, s + by_x, s + by_y))

    _amend(core, change)


def _lengths(core: Comparison) -> tuple[Signal, Signal]:
    return core.increment["x"].register, core.increment["y"].register


@_comparison({*ALL})
def lengths_exchanged(core: Comparison) -> None:
    """A step of x adds ΔX, and one of y takes ΔY off."""
    dx, dy = _lengths(core)
    _sum_up(core, dx, -dy)


@_comparison({*ALL})
def equal_sums_step_y(core: Comparison) -> None:
    """Of equal sums y steps, whichever axis is longer."""
    _assign(core, core.turn, core.sums["s"] < 0)


@_comparison({*ALL})
def shorter_axis_first(core: Comparison) -> None:
    """Of equal sums the shorter axis steps."""
    s, (dx, dy) = core.sums["s"], _lengths(core)
    _assign(core, core.turn, (s < 0) | ((s == 0) & (dx < dy)))


# No line of the benches that draw theirs is at 45°.
@_comparison({DOCUMENTS, EQUIVALENCE, PROMISES, COMPILED})
def other_side_at_45_degrees(core: Comparison) -> None:
    """Of equally long axes y goes first, though it is x that was asked for."""
    s, (dx, dy) = core.sums["s"], _lengths(core)
    _assign(core, core.turn, (s < 0) | ((s == 0) & (dx > dy)))


@_comparison({*ALL})
def difference_a_bit_short(core: Comparison) -> None:
    """S is worked out in n bits, sign and all."""
    s, (dx, dy) = core.sums["s"], _lengths(core)

    def change(m: Module) -> None:
        with m.If(core.uu.clock):
            m.d.sync += s.eq(Mux(core.turn, s + dy, s - dx)[: core.width].as_signed())

    _amend(core, change)


@_comparison({*ALL}, **METHODS["comparison"].settings["lecture"])
def sums_compared_short(core: Comparison) -> None:
    """Only the lower n bits of SX and SY are compared."""
    sx, sy = (register[: core.width] for register in core.sums.values())
    dx, dy = _lengths(core)
    _assign(core, core.turn, (sx < sy) | ((sx == sy) & (dx >= dy)))


@_comparison({*ALL})
def count_of_x_stuck(core: Comparison) -> None:
    """P5 never counts down: no line along x ends."""
    _assign(core, core.remaining["x"].count, 0)


@_comparison({*ALL})
def one_axis_ends_it(core: Comparison) -> None:
    """A block ends when one of its counters is empty, not both."""
    remaining = core.remaining
    _assign(core, core.uu.ending, remaining["x"].ending | remaining["y"].ending)


# The article judges the steps alone, not the coordinates, and knows of no second line.


@_comparison({*ALL} - {DOCUMENTS})
def coordinate_too_soon(core: Comparison) -> None:
    """P3 counts with the summation, a clock before its step can be taken."""
    step, negative = core.output.carry.x, core.output.direction_registers["x"]
    _assign(core, core.place["x"].up, step & ~negative)
    _assign(core, core.place["x"].down, step & negative)


@_comparison({*ALL} - {DOCUMENTS})
def clock_lost_between_blocks(core: Comparison) -> None:
    """The next block starts only when the last step before it has been taken."""
    uu = core.uu
    _assign(uu, uu.start, uu.pending & ~uu.running & ~uu.waiting)


# Only with the right stimuli: neither the article nor the survey stalls, errs or resets.


@_comparison({*ALL} - {DOCUMENTS, COMPILED})
def comparison_step_lost_under_stall(core: Comparison) -> None:
    """A step that is not taken is forgotten, and the next one is computed."""
    _assign(core, core.uu.ready, 1)


@_comparison({*ALL} - {DOCUMENTS, COMPILED})
def comparison_fault_not_raised(core: Comparison) -> None:
    """A block that is too long is run with the low bits of its lengths."""
    _assign(core, core.uu.fault, ErrorCode.NONE)


@_comparison({EQUIVALENCE} | VERILOG)
def waiting_step_not_reset(core: Comparison) -> None:
    """A step of y that waits survives a reset, and is taken after it."""
    fresh = Signal.like(core.registers["pulse_y"], name="pulse_y", reset_less=True)
    core.registers["pulse_y"] = core.output.pulse_registers["y"] = fresh


# No simulation sees these: a line leaves S at 0, where the next one starts, and the benches that
# reset a running line look at the outputs alone.


@_comparison({EQUIVALENCE, PROMISES})
def sum_not_cleared(core: Comparison) -> None:
    """Only reset sets S to 0; a block starts from what the one before left."""

    def change(m: Module) -> None:
        with m.If(core.uu.load):
            m.d.sync += core.sums["s"].eq(core.sums["s"])

    _amend(core, change)


@_comparison({EQUIVALENCE})
def sum_not_reset(core: Comparison) -> None:
    """S survives a reset, until the next block starts."""
    fresh = Signal.like(core.sums["s"], name="s", reset_less=True)
    core.registers["s"] = core.sums["s"] = fresh


# Equal to its golden model, and wrong: the survey's bound holds on both sides of a line.


class _FirstMisread(GoldenComparison):
    """The mistake of :func:`first_misread`, made a second time."""

    def summed(self, state, clock):
        return GoldenComparison(self.width, "signed", "y").summed(state, clock)


@_comparison({DOCUMENTS, PROMISES}, golden=_FirstMisread)
def first_misread(core: Comparison) -> None:
    """Device and golden model both start with y at 45°, though it is x that was asked for."""
    core.first = "y"


# Lines on a carrier. Broken sums, ends and timers.


@_carrier_line({*ALL})
def fraction_forgotten(core: CarrierLinear) -> None:
    """What is left of a period's increment of x is lost, and the preload is there again."""

    def change(m: Module) -> None:
        with m.If(core.output.put):
            m.d.sync += core.fraction["x"].eq(core.preloaded)

    _amend(core, change)


@_carrier_line({*ALL})
def mean_rounded_up(core: CarrierLinear) -> None:
    """A mean increment that has more bits than its register is rounded up."""

    def change(m: Module) -> None:
        with m.If(core.uu.load):
            for a, divider in core.divider.items():
                m.d.sync += core.mean[a].eq(divider.quotient + (divider.rest != 0))

    _amend(core, change)


@_carrier_line({*ALL}, **METHODS["carrier_linear"].settings["lecture"])
def last_period_like_the_others(core: CarrierLinear) -> None:
    """The last period puts out the mean of x and its fraction, whatever is left."""
    full = core.mean["x"] + core.fraction["x"]
    whole = full[core.fraction_bits :]
    _assign(core, core.output.increment["x"], Mux(core.direction["x"], -whole, whole))


@_carrier_line({*ALL})
def timer_one_short(core: CarrierLinear) -> None:
    """A carrier period is over a clock too soon."""
    _assign(core, core.output.period, core.period - 1)


@_carrier_line({*ALL})
def period_of_the_prepared_block(core: CarrierLinear) -> None:
    """The timer is set to the period of the block that was accepted last."""
    _assign(core, core.output.period, core.next_period)


@_carrier_line({*ALL})
def carrier_preload_forgotten(core: CarrierLinear) -> None:
    """A block goes on with the fraction of x that the one before left."""

    def change(m: Module) -> None:
        with m.If(core.uu.load):
            m.d.sync += core.fraction["x"].eq(core.fraction["x"])

    _amend(core, change)


@_carrier_line({*ALL})
def carrier_answer_lost(core: CarrierLinear) -> None:
    """An empty block starts while the last increments before it are taken: one answer for two."""
    uu = core.uu
    _assign(uu, uu.start, uu.pending & ~uu.running & (~uu.waiting | uu.ready))


# The increments are right, the coordinates are not.
@_carrier_line({*ALL} - {DOCUMENTS})
def increments_placed_too_soon(core: CarrierLinear) -> None:
    """P3 counts when increments begin to wait, not when they are taken."""
    out = core.output

    def change(m: Module) -> None:
        with m.If(out.load):
            m.d.sync += out.place["x"].eq(out.start.x)
        with m.Elif(out.put):
            m.d.sync += out.place["x"].eq(out.place["x"] + out.increment.x)
        with m.Else():
            m.d.sync += out.place["x"].eq(out.place["x"])

    _amend(out, change)


# Only with the right stimuli.


@_carrier_line({*ALL} - {DOCUMENTS, COMPILED})
def timer_runs_while_increments_wait(core: CarrierLinear) -> None:
    """The carrier period goes on though increments wait and are not taken."""
    out = core.output

    def change(m: Module) -> None:
        with m.If(~out.put & ~out.due):
            m.d.sync += out.timer.eq(out.timer - 1)

    _amend(out, change)


@_carrier_line({*ALL} - {DOCUMENTS})
def timing_not_refused(core: CarrierLinear) -> None:
    """A block with no periods, or with a period too short, is run."""
    _assign(core, core.uu.fault, core.input.fault)


@_carrier_line({EQUIVALENCE} | VERILOG)
def waiting_increments_not_reset(core: CarrierLinear) -> None:
    """Increments that wait survive a reset, and are taken after it."""
    out = core.output
    fresh = Signal.like(out.waiting_register, name="waiting", reset_less=True)
    core.registers["waiting"] = out.waiting_register = fresh


# Equal to its golden model, and wrong: what the division gives, a proof of a clock cannot tell.


class _MeanMisread(GoldenCarrierLinear):
    """The mistake of :func:`mean_misread`, made a second time."""

    def step(self, state, inputs, busy_behind=0):
        after = super().step(state, inputs, busy_behind)
        half = where(equal(state["tick"], 1), state["next_periods"] >> 1, 0)
        return after | {f"quotient_{a}": after[f"quotient_{a}"] + half for a in "xy"}


@_carrier_line({DOCUMENTS}, golden=_MeanMisread)
def mean_misread(core: CarrierLinear) -> None:
    """Device and golden model both round the mean increments to the nearest number there is."""
    for a, divider in core.divider.items():
        dividend = (core.input.delta[a] << core.fraction_bits) + (core.next_periods >> 1)
        _assign(core, divider.dividend, dividend)


# Lines in two stages.


def _taken(core: TwoStage) -> Value:
    """Tell the clock in which the second stage takes a period's increments."""
    return core.coarse.steps.valid & core.coarse.steps.ready


def _summed(core: TwoStage) -> Value:
    """Tell a clock of the second stage."""
    return core.running & (~Cat(core.step["x"], core.step["y"]).any() | core.steps.ready)


def _sum_of_x(core: TwoStage, span: Value, *, equal_carries: bool = True) -> None:
    """Have SX carry at this modulus, in place of its own."""

    def change(m: Module) -> None:
        total = core.sum["x"] + core.increment["x"]
        carry = total >= span if equal_carries else total > span
        with m.If(_summed(core)):
            m.d.sync += core.step["x"].eq(Cat(carry, carry & core.direction["x"]))
            with m.If(~_taken(core)):
                m.d.sync += core.sum["x"].eq(Mux(carry, total - span, total))
                m.d.sync += core.left["x"].eq(core.left["x"] - carry)

    _amend(core, change)


@_two_stage({*ALL})
def carry_one_too_late(core: TwoStage) -> None:
    """SX carries when it is more than the modulus, not when it comes to it."""
    _sum_of_x(core, core.span, equal_carries=False)


@_two_stage({*ALL})
def modulus_fixed(core: TwoStage) -> None:
    """SX has a modulus of its bits, as the linear interpolator, and not the period's clocks."""
    _sum_of_x(core, Const(1 << core.width))


@_two_stage({*ALL})
def period_never_longer(core: TwoStage) -> None:
    """A period lasts T clocks, though it has more steps than that."""

    def change(m: Module) -> None:
        with m.If(_taken(core)):
            m.d.sync += [core.span.eq(core.coarse.period), core.clocks_left.eq(core.coarse.period)]

    _amend(core, change)


@_two_stage({*ALL})
def second_preload_forgotten(core: TwoStage) -> None:
    """SX of the second stage starts a period from 0, though the preload is half."""

    def change(m: Module) -> None:
        with m.If(_taken(core)):
            m.d.sync += core.sum["x"].eq(0)

    _amend(core, change)


@_two_stage({*ALL}, **METHODS["two_stage_linear"].settings["lecture"])
def direction_of_the_next_period(core: TwoStage) -> None:
    """The sign of a step is that of the increments that wait, not of those that are summed."""

    def change(m: Module) -> None:
        carry = core.sum["x"] + core.increment["x"] >= core.span
        with m.If(_summed(core)):
            m.d.sync += core.step["x"].eq(Cat(carry, carry & (core.coarse.steps.payload.x < 0)))

    _amend(core, change)


@_two_stage({*ALL})
def last_flag_lost(core: TwoStage) -> None:
    """No step is marked as the last one of its block."""

    def change(m: Module) -> None:
        m.d.sync += core.step_last.eq(0)

    _amend(core, change)


@_two_stage({*ALL} - {DOCUMENTS})
def next_start_placed_too_soon(core: TwoStage) -> None:
    """XT is loaded when the first stage starts a block, while steps of the one before are left."""
    coarse = core.coarse

    def change(m: Module) -> None:
        with m.If(coarse.output.load):
            m.d.sync += core.place["x"].eq(coarse.output.start.x)

    _amend(core, change)


@_two_stage({*ALL} - {DOCUMENTS})
def answer_overtakes(core: TwoStage) -> None:
    """A block of no length or a refused one is answered while steps before it are left."""
    _assign(core, core.coarse.busy_behind, 0)


@_two_stage({*ALL} - {DOCUMENTS, COMPILED})
def second_stage_does_not_wait(core: TwoStage) -> None:
    """A step that is not taken is forgotten, and the next one is computed."""

    def change(m: Module) -> None:
        with m.If(core.running & ~_summed(core) & (core.clocks_left != 1)):
            m.d.sync += core.clocks_left.eq(core.clocks_left - 1)
            for a in "xy":
                total = core.sum[a] + core.increment[a]
                carry = total >= core.span
                m.d.sync += [
                    core.sum[a].eq(Mux(carry, total - core.span, total)),
                    core.left[a].eq(core.left[a] - carry),
                    core.step[a].eq(Cat(carry, carry & core.direction[a])),
                ]

    _amend(core, change)


@_two_stage({EQUIVALENCE} | VERILOG)
def open_block_not_reset(core: TwoStage) -> None:
    """That a block is not answered yet survives a reset."""
    fresh = Signal.like(core.open, name="open", reset_less=True)
    core.registers["open"] = core.open = fresh


# Equal to its golden model, and wrong: the promises of the second stage take the first as it comes.


class _CarrierAxisMisread(GoldenCarrierLinear):
    """The mistake of :func:`carrier_axis_misread`, made a second time."""

    def step(self, state, inputs, busy_behind=0):
        after = super().step(state, inputs, busy_behind)
        accept = inputs["blocks_valid"] & self.outputs(state, busy_behind)["blocks_ready"]
        return after | {"negative_y": after["negative_y"] ^ accept}


def _two_stage_axis_misread(width: int, preload: str = "half") -> GoldenTwoStage:
    return GoldenTwoStage(_CarrierAxisMisread(width, preload))


@_two_stage({DOCUMENTS, COMPILED}, golden=_two_stage_axis_misread)
def carrier_axis_misread(core: TwoStage) -> None:
    """Device and golden model both take y to grow downwards in the first stage."""
    inp = core.coarse.input

    def change(m: Module) -> None:
        with m.If(inp.blocks.valid & inp.blocks.ready):
            block = inp.blocks.payload
            m.d.sync += inp.negative_registers["y"].eq(block.end.y >= block.start.y)

    _amend(inp, change)


# Arcs on a carrier. Broken products, angles and ends.


def _finished(core: CarrierCircular) -> Value:
    """Tell the clock in which a product is used."""
    return core.uu.clock & ~core.computed & (core.digit == 0)


@_carrier_arc({*ALL} - {PROMISES})
def sign_of_a_product(core: CarrierCircular) -> None:
    """x grows by y times the angle instead of falling, whichever way the arc runs."""

    def change(m: Module) -> None:
        with m.If(_finished(core)):
            added = Mux(core.clockwise, -core.product["y"], core.product["y"])
            m.d.sync += core.place["x"].eq(core.place["x"] + added)

    _amend(core, change)


@_carrier_arc({*ALL} - {PROMISES})
def new_x_used_for_y(core: CarrierCircular) -> None:
    """y grows by the new x times the angle, not by that of the period before."""

    def change(m: Module) -> None:
        across = Mux(core.clockwise, core.product["y"], -core.product["y"])
        along = ((core.place["x"] + across) * core.factor) >> len(core.factor)
        with m.If(_finished(core)):
            m.d.sync += core.place["y"].eq(core.place["y"] + Mux(core.clockwise, -along, along))

    _amend(core, change)


@_carrier_arc({*ALL} - {PROMISES})
def factor_not_coming_round(core: CarrierCircular) -> None:
    """The angle is shifted out of its register: from the second period on it is 0."""

    def change(m: Module) -> None:
        with m.If(core.uu.clock & ~core.computed & (core.digit != 0)):
            m.d.sync += core.factor.eq(core.factor >> 1)

    _amend(core, change)


@_carrier_arc(REGISTERS)
def product_not_cleared(core: CarrierCircular) -> None:
    """The product of x begins with what the one before came to."""

    def change(m: Module) -> None:
        with m.If(_finished(core) | core.output.put):
            m.d.sync += core.product["x"].eq(core.product["x"])

    _amend(core, change)


@_carrier_arc({*ALL} - {PROMISES})
def half_turn_lost(core: CarrierCircular) -> None:
    """The angle of an arc that crosses two axes is measured a half turn short."""
    _assign(core, core.angle.turns, core.input.first_turns & ~2)


@_carrier_arc(REGISTERS)
def angle_one_turning_short(core: CarrierCircular) -> None:
    """The last turning that measures an angle is left out."""
    last = core.angle.index == core.width + 5
    _assign(core, core.angle.turn, (core.stage < core.dividing) & ~last)


@_carrier_arc({*ALL})
def end_of_the_prepared_block(core: CarrierCircular) -> None:
    """The last period leads to the end of the block that was accepted last."""
    out = core.output

    def change(m: Module) -> None:
        with m.If(core.periods == 1):
            m.d.comb += [out.increment[a].eq(core.next_end[a] - out.reached[a]) for a in "xy"]

    _amend(core, change)


@_carrier_arc({*ALL})
def clamp_missing(core: CarrierCircular) -> None:
    """An arc may be led out of the coordinates there are."""
    out, half = core.output, 1 << (core.fraction_bits - 1)

    def change(m: Module) -> None:
        with m.If(core.periods != 1):
            for a in "xy":
                whole = ((core.place[a] + half) >> core.fraction_bits) + core.center[a]
                m.d.comb += out.increment[a].eq(whole - out.reached[a])

    _amend(core, change)


@_carrier_arc({*ALL} - {PROMISES})
def early_end_missed(core: CarrierCircular) -> None:
    """The last period comes though the one before has led to the end."""
    _assign(core, core.uu.ending, core.computed & core.output.due & (core.periods == 1))


@_carrier_arc({*ALL})
def arc_timer_one_long(core: CarrierCircular) -> None:
    """A carrier period takes a clock more than it should."""
    _assign(core, core.output.period, core.period + 1)


@_carrier_arc({*ALL})
def fraction_not_kept(core: CarrierCircular) -> None:
    """What is put out of x is taken off its fraction too."""

    def change(m: Module) -> None:
        with m.If(core.output.put):
            whole = (core.place["x"] >> core.fraction_bits) << core.fraction_bits
            m.d.sync += core.place["x"].eq(whole)

    _amend(core, change)


@_variant("carrier_circular", {*ALL} - {PROMISES}, **CORRECTED)
def predicted_for_the_mean(core: CarrierCircular) -> None:
    """The correction is made with the predicted x alone, not with its mean with the old one."""

    def change(m: Module) -> None:
        with m.If(_finished(core) & (core.round == 0)):
            turned = Mux(core.clockwise, core.product["y"], -core.product["y"])
            m.d.sync += core.mean["x"].eq(core.place["x"] + turned)

    _amend(core, change)


@_variant("carrier_circular", REGISTERS)
def series_cut(core: CarrierCircular) -> None:
    """The series of κ is cut after its first term: κ = Δφ²."""
    unit = core.unit
    assert unit is not None
    first = next(i for i, (_, _, to) in enumerate(unit.program) if to is unit.kappa)
    unit.program[first - 1] = (unit.scaled, 0, unit.term)


# Only with the right stimuli.


@_carrier_arc({*ALL} - {DOCUMENTS})
def arc_timing_not_refused(core: CarrierCircular) -> None:
    """An arc is run whatever its number of periods and their length."""
    _assign(core, core.uu.fault, core.input.fault)


@_carrier_arc({*ALL} - {DOCUMENTS, COMPILED})
def increments_lost_under_stall(core: CarrierCircular) -> None:
    """Increments that are not taken are forgotten, and the next ones are put out."""
    _assign(core, core.uu.ready, 1)


@_carrier_arc({EQUIVALENCE} | VERILOG)
def arc_preparation_not_reset(core: CarrierCircular) -> None:
    """A block that is being prepared survives a reset, with what was prepared of it lost."""
    inp = core.input
    fresh = Signal.like(inp.held_register, name="held", reset_less=True)
    core.registers["held"] = inp.held_register = fresh


# Equal to its golden model, and wrong.


class _TurningMisread(GoldenCarrierCircular):
    """The mistake of :func:`turning_misread`, made a second time."""

    def step(self, state, inputs, busy_behind=0):
        misread = inputs | {"blocks_clockwise": inputs["blocks_clockwise"] ^ 1}
        return super().step(state, misread, busy_behind)


@_carrier_arc({DOCUMENTS, COMPILED}, golden=_TurningMisread)
def turning_misread(core: CarrierCircular) -> None:
    """Device and golden model both take clockwise for counter-clockwise."""
    clockwise = ~core.blocks.payload.clockwise

    def change(m: Module) -> None:
        m.d.comb += core.input.blocks.payload.clockwise.eq(clockwise)
        with m.If(core.blocks.valid & core.blocks.ready):
            m.d.sync += core.next_clockwise.eq(clockwise)

    _amend(core, change)


# Exact arcs: what a step adds, the changes of octant and quadrant, the end.


def _clocked(part: Part, *assigned: tuple[Value, Any], when: Value | int = 1) -> None:
    """Assign values to registers of a part, in place of its own, in the clocks told."""

    def change(m: Module) -> None:
        with m.If(when):
            for register, value in assigned:
                m.d.sync += register.eq(value)

    _amend(part, change)


@_exact_arc({*ALL})
def octant_never_changed(core: ExactArc) -> None:
    """Y leads as far as the axis."""
    _clocked(core, (core.mode[1], 0))


@_exact_arc({*ALL})
def odd_forgotten(core: ExactArc) -> None:
    """Where the octant changes Y − X is taken for even."""
    _clocked(core, (core.odd, 0))


@_exact_arc({*ALL})
def rising_axis_not_turned(core: ExactArc) -> None:
    """What rose up to an axis goes on rising behind it."""
    _clocked(core, (core.negative["x"], core.negative["x"]), when=core.mode == 1)


@_exact_arc({*ALL})
def last_crossing_forgotten(core: ExactArc) -> None:
    """With the last crossing the last piece does not begin."""
    _clocked(core, (core.sole, 0))


@_exact_arc({*ALL})
def end_never_near(core: ExactArc) -> None:
    """The end is not seen coming."""
    _clocked(core, (core.near, 0))


@_exact_arc({*ALL})
def sign_not_complemented(core: ExactArc) -> None:
    """An arc that begins where X leads loads E with its own sign."""
    inp = core.input
    _assign(inp, inp.residual[-1], inp.diagonal[-1] ^ inp.axial[-1])


@_exact_arc({*ALL})
def next_diagonal_added(core: ExactArc) -> None:
    """What was loaded is added once more in the next clock."""
    _clocked(core, (core.load_diagonal, core.input.diagonal), when=core.loading)


@_exact_arc({*ALL} - {DOCUMENTS})
def position_from_the_end(core: ExactArc) -> None:
    """The position is taken for the end in the clock in which a step is taken."""
    _assign(core, core.position.x, Mux(core.waiting & core.last, core.end["x"], core.past["x"]))


# Only with the right stimuli: neither the documents nor the survey stalls or errs.


@_exact_arc({*ALL} - {DOCUMENTS, COMPILED})
def missed_end_not_seen(core: ExactArc) -> None:
    """An arc that has missed its end runs on."""
    _clocked(core, (core.lost, 0))


@_exact_arc({*ALL} - {DOCUMENTS, COMPILED})
def stalled_step_lost(core: ExactArc) -> None:
    """A step that is not taken at once is forgotten."""
    _clocked(core, (core.waiting, 0), when=core.waiting & ~core.steps.ready)


# Exact lines


def _goes(core: ExactLine) -> Value:
    """Tell when steps go on: none waits, or it is taken."""
    return ~core.registers["waiting"] | core.steps.ready


@_exact_line({*ALL})
def rare_twice_in_a_row(core: ExactLine) -> None:
    """The sign of the residual is looked at also after a decision of the rare kind."""
    r = core.registers

    def change(m: Module) -> None:
        with m.If(_goes(core) & r["running"] & core.left[-1]):
            m.d.sync += r["rare"].eq(0)

    _amend(core, change)


@_exact_line({*ALL})
def addend_of_the_other_kind(core: ExactLine) -> None:
    """What is added is Δ, whether the follower moves or not."""
    r = core.registers

    def change(m: Module) -> None:
        with m.If(_goes(core) & core.left[-1]):
            m.d.sync += r["addend"].eq(r["gain"])

    _amend(core, change)


@_exact_line({*ALL})
def total_of_the_block_before(core: ExactLine) -> None:
    """A block's first residual is added to what the block before has left."""
    r = core.registers

    def change(m: Module) -> None:
        with m.If(_goes(core) & ~core.left[-1]):
            m.d.sync += r["total"].eq(r["total"])

    _amend(core, change)


@_exact_line({*ALL})
def one_step_too_many(core: ExactLine) -> None:
    """A leader that goes upwards makes one step more than its way is long."""

    def change(m: Module) -> None:
        m.d.sync += core.registers["more"].eq(0)

    _amend(core, change)


@_exact_line(REGISTERS)
def equal_ways_led_by_y(core: ExactLine) -> None:
    """Of equal ways that of y is said to lead, whichever does: the points are the same."""
    r = core.registers

    def change(m: Module) -> None:
        with m.If(~r["chosen"] & (r["delta_x"] == r["delta_y"])):
            m.d.sync += r["way_follow_x"].eq(1)

    _amend(core, change)


@_exact_line({*ALL})
def first_residual_rounded_down(core: ExactLine) -> None:
    """Half the leader's way is taken off without the carry that rounds it."""
    r = core.registers

    def change(m: Module) -> None:
        with m.If(r["room"]):
            m.d.sync += r["ready_rest"].eq(r["way_follow"] + (r["way_lead"] >> 1))

    _amend(core, change)


@_exact_line({*ALL})
def block_taken_over_twice(core: ExactLine) -> None:
    """A block that has been loaded is still prepared."""
    r = core.registers

    def change(m: Module) -> None:
        with m.If(r["prepared"]):
            m.d.sync += r["prepared"].eq(1)

    _amend(core, change)


@_exact_line({*ALL} - {DOCUMENTS, COMPILED})
def way_too_long_by_one_done(core: ExactLine) -> None:
    """A block with a way of −2^n is answered by done, not refused."""
    r = core.registers

    def change(m: Module) -> None:
        with m.If(r["room"]):
            m.d.sync += r["ready_fault"].eq(r["way_fault"])

    _amend(core, change)


@_exact_line({*ALL} - {DOCUMENTS, COMPILED})
def done_before_the_last_step_is_taken(core: ExactLine) -> None:
    """The block is done in every clock in which its last step waits."""
    r = core.registers

    def change(m: Module) -> None:
        with m.If(r["waiting"] & r["last"]):
            m.d.sync += r["done"].eq(1)

    _amend(core, change)


@_exact_line({*ALL} - {DOCUMENTS, COMPILED})
def place_before_the_step_is_taken(core: ExactLine) -> None:
    """P3 counts in every clock in which a step of x waits."""
    r = core.registers

    def change(m: Module) -> None:
        with m.If(r["waiting"] & r["pulse_x"] & ~core.steps.ready):
            m.d.sync += core.place["x"].eq(core.place["x"] + 1)

    _amend(core, change)


@_exact_line({*ALL} - {DOCUMENTS, COMPILED})
def exact_step_lost_under_stall(core: ExactLine) -> None:
    """A step of x that is not taken is forgotten."""
    r = core.registers

    def change(m: Module) -> None:
        with m.If(r["waiting"] & ~core.steps.ready):
            m.d.sync += r["pulse_x"].eq(0)

    _amend(core, change)


@_exact_line({EQUIVALENCE} | VERILOG)
def decided_step_not_reset(core: ExactLine) -> None:
    """A step that is decided survives a reset."""
    fresh = Signal.like(core.registers["decided"], name="decided", reset_less=True)
    core.registers["decided"] = fresh
