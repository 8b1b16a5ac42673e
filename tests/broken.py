"""Broken variants of the linear interpolator, and which rungs of the ladder must catch each.

A variant is the sound device with a few assignments added behind its own: in Amaranth the last one
wins. Its registers keep their names, so it can be simulated, compiled, converted and proven like
the sound one.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from amaranth import Module, Signal
from amaranth.hdl import Value

from discreta.hdl.contract import ErrorCode, Part
from discreta.hdl.linear import Linear
from discreta.sim.golden.linear import Linear as GoldenLinear

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


@dataclass(frozen=True)
class Variant:
    """A design to send up the ladder.

    Attributes
    ----------
    name, what : str
        What it is called, and what is broken, in one line.
    caught_by : set of str
        The rungs that must catch it; all others must let it pass.
    options : dict
        The parameters of the device besides its width.
    break_it : callable
        Breaks a sound device that has just been made.
    golden_class : type
        The golden model that the device is compared with.
    """

    name: str
    what: str
    caught_by: set[str] = field(default_factory=set)
    options: dict[str, Any] = field(default_factory=dict)
    break_it: Callable[[Linear], None] = lambda _: None
    golden_class: type[GoldenLinear] = GoldenLinear

    def device(self, width: int) -> Linear:
        """Make the device."""
        core = Linear(width, 2, **self.options)
        self.break_it(core)
        return core

    def golden(self, width: int) -> GoldenLinear:
        """Make the golden model that goes with it."""
        return self.golden_class(width, 2, **self.options)


SOUND = [
    Variant("sound", "nothing: normalized, preload half"),
    Variant(
        "sound, plain",
        "nothing: as in the documents, not normalized, preload zero",
        options={"normalize": False, "preload": "zero"},
    ),
]
VARIANTS: list[Variant] = []


def _variant(
    caught_by: set[str], *, golden_class: type[GoldenLinear] = GoldenLinear, **options: Any
) -> Callable[[Callable[[Linear], None]], None]:
    """List a function that breaks a device, under its name and with its docstring."""

    def add(break_it: Callable[[Linear], None]) -> None:
        name, what = break_it.__name__.replace("_", " "), break_it.__doc__ or ""
        VARIANTS.append(Variant(name, what, caught_by, options, break_it, golden_class))

    return add


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


@_variant({*ALL})
def carry_dropped(core: Linear) -> None:
    """When SX and SY carry in the same clock, the step of x is dropped."""
    x, y = core.summator["x"].carry, core.summator["y"].carry
    _assign(core, core.output.carry["x"], x & ~y)


@_variant({*ALL})
def counter_not_stopping(core: Linear) -> None:
    """P5 never counts down: a line along x never ends."""
    _assign(core, core.remaining["x"].count, 0)


@_variant({*ALL})
def normalized_too_far(core: Linear) -> None:
    """The increments are shifted one place too far, and their top bits are lost."""

    def change(m: Module) -> None:
        for a, register in core.increment.items():
            m.d.comb += register.initial.eq(m.submodules.normalizer.normalized[a] << 1)

    _amend(core, change)


@_variant({*ALL})
def wrong_preload(core: Linear) -> None:
    """Both summators start a block from M/2 − 1 instead of M/2."""
    for summator in core.summator.values():
        summator.initial -= 1


@_variant({*ALL})
def early_end(core: Linear) -> None:
    """A block ends when one of its counters is empty, not both."""
    remaining = core.remaining
    _assign(core, core.uu.ending, remaining["x"].ending | remaining["y"].ending)


# The steps are right, the coordinates are not: the documents' program judges the steps alone.
@_variant({*ALL} - {DOCUMENTS})
def position_too_soon(core: Linear) -> None:
    """P3 counts with the carry, a clock before its step can be taken."""
    carry, negative = core.summator["x"].carry, core.output.direction_registers["x"]
    _assign(core, core.place["x"].up, carry & ~negative)
    _assign(core, core.place["x"].down, carry & negative)


# Between two blocks: invisible to a single line from reset, which is all the survey runs.


@_variant({*ALL} - {COMPILED})
def preload_forgotten(core: Linear) -> None:
    """Only reset sets SX to its preload; a block starts from what the one before left."""
    _assign(core, core.summator["x"].load, 0)


@_variant({*ALL} - {COMPILED})
def turned_too_soon(core: Linear) -> None:
    """The sign of a step is that of the prepared block, not of the running one."""
    _assign(core, core.output.load, 1)


@_variant({*ALL} - {COMPILED})
def answer_lost(core: Linear) -> None:
    """An empty block starts while the last step before it is taken: two blocks, one answer."""
    uu = core.uu
    _assign(uu, uu.start, uu.pending & ~uu.running & (~uu.waiting | uu.ready))


# Only with the right stimuli: neither the documents nor the survey stalls, errs or resets.


@_variant({*ALL} - {DOCUMENTS, COMPILED})
def step_lost_under_stall(core: Linear) -> None:
    """A step that is not taken is forgotten, and the next one is computed."""
    _assign(core, core.uu.ready, 1)


@_variant({*ALL} - {DOCUMENTS, COMPILED})
def fault_not_raised(core: Linear) -> None:
    """A block that is too long is run with the low bits of its lengths."""
    _assign(core, core.uu.fault, ErrorCode.NONE)


# The promises start from the initial values, and the other benches reset nothing that runs.
@_variant({EQUIVALENCE} | VERILOG)
def reset_incomplete(core: Linear) -> None:
    """A step of x that waits survives a reset, and is taken after it."""
    fresh = Signal.like(core.registers["pulse_x"], name="pulse_x", reset_less=True)
    core.registers["pulse_x"] = core.output.pulse_registers["x"] = fresh


# No simulation gets there: with preload zero all counters are empty at the same time, so what an
# empty counter lets through is 0; and no bench runs for 65,536 clocks.


@_variant({EQUIVALENCE, PROMISES}, preload="zero")
def sum_not_gated(core: Linear) -> None:
    """SX goes on summing when its counter is empty."""
    _assign(core, core.summator["x"].enable, core.uu.clock)


@_variant({EQUIVALENCE, PROMISES})
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


@_variant({DOCUMENTS, PROMISES, COMPILED}, golden_class=_AxisMisread)
def axis_misread(core: Linear) -> None:
    """Device and golden model both take y to grow downwards, as on a screen."""
    inp = core.input

    def change(m: Module) -> None:
        with m.If(inp.blocks.valid & inp.blocks.ready):
            block = inp.blocks.payload
            m.d.sync += inp.negative_registers["y"].eq(block.end.y >= block.start.y)

    _amend(inp, change)


@_variant({PROMISES}, golden_class=_StallMisread)
def stall_misread(core: Linear) -> None:
    """Device and golden model both take a step to be gone after a clock, taken or not."""
    _assign(core, core.uu.ready, 1)
