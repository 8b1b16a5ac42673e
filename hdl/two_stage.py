# amaranth: UnusedElaboratable=no
# (A first stage that is refused is not used.)
"""Two-stage interpolation: whole increments of a constant carrier, spread over their period."""

from amaranth import Cat, Module, Mux, Signal
from amaranth.hdl import signed
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.carrier import PERIOD_BITS
from discreta.hdl.carrier_circular import CarrierCircular
from discreta.hdl.carrier_linear import CarrierLinear
from discreta.hdl.contract import ErrorCode, Part, point_layout, step_layout

__all__ = ["TwoStage", "two_stage_circular", "two_stage_linear"]


class TwoStage(Part):
    """Gives every step of a line or an arc, from the increments of a constant-carrier method.

    The first stage, which is any of the constant-carrier methods, puts out whole increments ΔX, ΔY
    once a carrier period; the second one is the linear interpolator with a modulus of its own. With
    M = max(T, \\|ΔX\\|, \\|ΔY\\|) and S₀ = 0 or ⌊M/2⌋, as the first stage has its preload, it makes
    in each of M clocks::

        SX := SX + |ΔX|, SY := SY + |ΔY|; where that is M or more: take off M, and step

    so that an axis makes just \\|Δ\\| steps in the period, ⌊M/Δ⌋ or ⌈M/Δ⌉ clocks apart: evenly, to
    one clock. A period lasts its T clocks, or as many as it has steps.

    Registers: those of the first stage by their names, and of the second FINE_P1, FINE_P2 =
    increments; FINE_P5, FINE_P6 = steps left in this period; FINE_SX, FINE_SY; ``span`` = M and
    ``clocks_left`` in this period; XT, YT = coordinates now; the step that waits; ``open`` = a
    block is not answered yet.

    Latency: that of the first stage; its increments are taken in the clock in which they wait and
    summed from the next clock on, and a carry is a step in the clock after. ``done`` follows the
    last step by a clock.

    Throughput: one period in T clocks, within a block and from block to block, if the first stage
    has the next block prepared by then and every step is taken at once; one clock more between two
    blocks when the last step of the first falls on the last clock of its period (as with preload
    0), since the next block loads the position. A block of no length and a rejected block are
    answered when no block before them is open.

    Steps: ``steps`` holds a step until it is taken and the second stage waits for it, and with it
    the first one. ``position`` shows the steps taken, not the one that waits; with its first
    increments a block loads it with its start. Should the last increments of a block be 0 (an arc
    that moves by less than two steps a period) and the step before them be taken already, ``done``
    follows at once and no step was ``last``.

    Reset: everything 0, nothing open, position at the origin.

    Overflow, errors: those of the first stage.

    Error bound: between two points of the first stage the steps are off their straight line by at
    most √½ step (preload ½), or by less than one on each axis (0), and this line by the first
    stage's own error at its ends; an arc lies R·Δφ²/8 beyond it in the middle. The end point is
    exact.

    Source: Ukrainian lecture (increments are handed on once a carrier period); lecture, linear
    interpolation. The modulus T is ours.

    Parameters
    ----------
    coarse : CarrierLinear or CarrierCircular
        The first stage.

    Attributes
    ----------
    parameters : dict of str to object
        Those of the first stage.
    diagram : dict of str to list of Signal
        Every register there is, grouped as in the block diagram, by the group's title.
    registers : dict of str to Signal
        The same registers, by their names in waveforms.
    """

    notation = "n = width, T = blocks_period, N = blocks_periods"

    def __init__(self, coarse: CarrierLinear | CarrierCircular):
        width = coarse.width
        super().__init__(
            {
                "blocks": In(coarse.signature.members["blocks"].signature.flip()),
                "steps": Out(stream.Signature(step_layout(2))),
                "position": Out(point_layout(width, 2)),
                "busy": Out(1),
                "done": Out(1),
                "error": Out(ErrorCode),
            }
        )
        self.coarse = coarse
        self.width = width
        self.parameters = coarse.parameters

        bits, steps = max(PERIOD_BITS, width + 2), width + 2
        self.increment = {
            a: Signal(steps, name=name) for a, name in (("x", "fine_p1"), ("y", "fine_p2"))
        }
        self.left = {
            a: Signal(steps, name=name) for a, name in (("x", "fine_p5"), ("y", "fine_p6"))
        }
        self.sum = {a: Signal(bits, name=f"fine_s{a}") for a in "xy"}
        self.direction = {a: Signal(name=f"fine_direction_{a}") for a in "xy"}
        self.span, self.clocks_left = Signal(bits, name="span"), Signal(bits, name="clocks_left")
        self.final = Signal(init=1, name="fine_last")
        self.running = Signal(name="fine_running")
        self.step = {a: Signal(signed(2), name=f"step_{a}") for a in "xy"}
        self.step_last = Signal()
        self.place = {a: Signal(signed(width + 1), name=f"{a}t") for a in "xy"}
        self.open = Signal()
        self.done_register = Signal(name="fine_done")

        self.diagram: dict[str, list[Signal]] = {
            "fine P1, P2 increments": [*self.increment.values()],
            "fine SX, SY summators": [*self.sum.values()],
            "fine P5, P6 steps left": [*self.left.values()],
            "period": [self.span, self.clocks_left, self.final, *self.direction.values()],
            "XT, YT position": [*self.place.values()],
            "fine УУ": [self.running, self.open, self.done_register],
            "step that waits": [*self.step.values(), self.step_last],
        } | {f"first stage: {title}": group for title, group in coarse.diagram.items()}
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        m.submodules.coarse = coarse = self.coarse
        waiting, taken, clock, last_clock, take, nothing_more, stepless, answered = (
            Signal(name=name)
            for name in (
                *("waiting_step", "taken", "clock", "last_clock", "take"),
                *("nothing_more", "stepless", "answered"),
            )
        )
        carry = Signal(2)
        increments = coarse.steps.payload
        free = ~waiting | self.steps.ready
        m.d.comb += [
            coarse.blocks.payload.eq(self.blocks.payload),
            coarse.blocks.valid.eq(self.blocks.valid),
            self.blocks.ready.eq(coarse.blocks.ready),
            coarse.busy_behind.eq(self.open),
            waiting.eq(Cat(self.step["x"], self.step["y"]).any()),
            taken.eq(waiting & self.steps.ready),
            clock.eq(self.running & free),
            last_clock.eq(self.clocks_left == 1),
            # A new block waits until the one before it is answered, or has its last step taken.
            take.eq(
                coarse.steps.valid
                & free
                & (~self.running | last_clock)
                & (~self.final | ~self.open | (taken & self.step_last))
            ),
            coarse.steps.ready.eq(take),
            nothing_more.eq(take & increments.last & (increments.x == 0) & (increments.y == 0)),
            stepless.eq(nothing_more & ~carry.any()),
            answered.eq((taken & self.step_last) | stepless | coarse.answered_empty),
            self.steps.valid.eq(waiting),
            self.steps.payload.last.eq(self.step_last),
            self.busy.eq(coarse.busy | self.open),
            self.done.eq(self.done_register),
            self.error.eq(coarse.error),
        ]
        m.d.sync += self.done_register.eq(answered)
        with m.If(take):
            m.d.sync += self.open.eq(~stepless)
        with m.Elif(answered):
            m.d.sync += self.open.eq(0)

        lengths = {a: Signal(self.width + 2, name=f"length_{a}") for a in "xy"}
        longer, span = (
            Signal(self.width + 2, name="longer"),
            Signal.like(self.span, name="next_span"),
        )
        m.d.comb += [
            longer.eq(Mux(lengths["x"] < lengths["y"], lengths["y"], lengths["x"])),
            span.eq(Mux(coarse.period < longer, longer, coarse.period)),
        ]
        with m.If(take):
            m.d.sync += [
                self.span.eq(span),
                self.clocks_left.eq(span),
                self.final.eq(increments.last),
                self.running.eq(1),
            ]
        with m.Elif(clock):
            m.d.sync += self.clocks_left.eq(self.clocks_left - 1)
            with m.If(last_clock):
                m.d.sync += self.running.eq(0)

        halved = self.coarse.preload == "half"
        none_left = Signal(2)
        for index, a in enumerate("xy"):
            total = Signal(len(self.span) + 1, name=f"total_{a}")
            increment, left, direction = self.increment[a], self.left[a], self.direction[a]
            step, place = self.step[a], self.place[a]
            negative = increments[a] < 0
            m.d.comb += [
                total.eq(self.sum[a] + increment),
                carry[index].eq(clock & (total >= self.span)),
                none_left[index].eq(left == carry[index]),
                lengths[a].eq(Mux(negative, -increments[a], increments[a])),
                self.steps.payload[a].eq(step),
                self.position[a].eq(place),
            ]
            with m.If(take):
                m.d.sync += [
                    increment.eq(lengths[a]),
                    left.eq(lengths[a]),
                    direction.eq(negative),
                    self.sum[a].eq(span >> 1 if halved else 0),
                ]
            with m.Elif(clock):
                m.d.sync += [
                    self.sum[a].eq(Mux(carry[index], total - self.span, total)),
                    left.eq(left - carry[index]),
                ]
            with m.If(clock):
                m.d.sync += step.eq(Cat(carry[index], carry[index] & direction))
            with m.Elif(taken):
                m.d.sync += step.eq(0)
            with m.If(coarse.answered_empty):
                m.d.sync += place.eq(coarse.output.start[a])
            with m.Elif(take & self.final):
                m.d.sync += place.eq(coarse.position[a])
            with m.Elif(taken):
                m.d.sync += place.eq(place + step)
        with m.If(clock):
            # The step may turn out to be the last one because nothing more comes.
            m.d.sync += self.step_last.eq((self.final & none_left.all()) | nothing_more)
        return m


def two_stage_linear(width: int = 16, *, preload: str = "half") -> TwoStage:
    """Make a line in two stages; see :class:`~discreta.hdl.carrier_linear.CarrierLinear`."""
    return TwoStage(CarrierLinear(width, preload=preload))


def two_stage_circular(
    width: int = 16,
    *,
    formula: str = "rotation",
    coefficient: str = "series",
    preload: str = "half",
) -> TwoStage:
    """Make an arc in two stages; see :class:`~discreta.hdl.carrier_circular.CarrierCircular`."""
    return TwoStage(
        CarrierCircular(width, formula=formula, coefficient=coefficient, preload=preload)
    )
