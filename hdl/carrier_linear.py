"""The linear interpolator on a constant carrier: the mean increment, period by period."""

from typing import Any, ClassVar

from amaranth import Cat, Module, Mux, Signal, Value
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.carrier import (
    PERIOD_BITS,
    CarrierOutput,
    increment_layout,
    periods_bits,
    timed_layout,
)
from discreta.hdl.contract import ErrorCode, Part, check_choice, check_width, point_layout
from discreta.hdl.parts import PRELOADS, ControlUnit
from discreta.hdl.parts.divider import Divider
from discreta.hdl.quadrant import QuadrantInput, line_block_layout

__all__ = ["MAX_WIDTH", "CarrierLinear"]

#: Devices of more bits would have registers of more than 64.
MAX_WIDTH = 24


class CarrierLinear(Part):
    """Draws a straight line in equal parts, one every carrier period.

    Computes, for every axis, with Δ = \\|end − start\\|, N = ``periods``, f = n + 12 bits of
    fraction and the mean increment m = ⌊Δ·2^f / N⌋ / 2^f, in every period::

        full := m + S; put out ⌊full⌋ steps; S := full − ⌊full⌋

    The fraction S starts from the preload, 0 or ½: after i periods ⌊S₀ + i·m⌋ steps are put out. In
    period N what is left to the end point is put out. A block also ends with the period that brings
    it to its end point, which with preload ½ is one before the N-th when m < ½ on both axes.

    Registers: P1, P2 = mean increments, n + f bits; P3, P4 = coordinates now; P5, P6 = steps left;
    SX, SY = fractions kept; ``periods`` = periods left; ``period`` = T; ``timer`` = clocks until
    the next increments are due.

    Latency: a block accepted in clock 0 is divided in clocks 1 to 2n + 13 and started in clock 2n +
    14; its first increments wait from clock 2n + 16, if the carrier period before is over.

    Throughput: one result every T clocks, T ≥ 2, within a block and from block to block, if the
    next block is prepared by then. The next block is prepared while this one runs. A block of no
    length and a rejected block take one clock, and one more behind a block that moved.

    Steps: ``steps`` holds the signed steps of a period, n + 2 bits an axis, until they are taken;
    the carrier waits for it. ``last`` is given with the last ones. ``position`` shows what was
    taken; starting a block loads it with the block's start.

    Reset: everything 0 (SX, SY their preload), nothing pending, position at the origin.

    Overflow: ``error`` is ``RANGE`` for one clock, in place of ``done``, for a block with an axis
    longer than 2^n − 1 steps, with no periods, or with a period of less than 2 clocks; nothing
    moves and the next block runs as ever.

    Error bound: the points put out are off the line by less than 17/16 of a step an axis with
    preload 0, 9/16 with preload ½ (a 16th of it is the division's). The last increment of an axis
    differs from its mean by less than 1 + N/2^f steps; the end point is exact.

    Source: Ukrainian lecture, linear interpolation by digital differential analysers; the division,
    the preload ½ and the timer are ours.

    Parameters
    ----------
    width : int
        n, 4 to 24. Coordinates are signed, n + 1 bits; steps are 1 long.
    preload : str
        What the fractions start from: ``"zero"`` or ``"half"``.

    Attributes
    ----------
    parameters : dict of str to object
        The parameters it was made with.
    least_period : int
        The least T, 2.
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

    notation = "n = width, T = blocks_period, N = blocks_periods"

    LECTURE: ClassVar[dict[str, Any]] = {"preload": "zero"}

    def __init__(self, width: int = 16, *, preload: str = "half"):
        check_width(width, MAX_WIDTH)
        check_choice("preload", preload, PRELOADS)
        super().__init__(
            {
                "blocks": In(stream.Signature(timed_layout(line_block_layout(width, 2), width))),
                "steps": Out(stream.Signature(increment_layout(width))),
                "position": Out(point_layout(width, 2)),
                "busy": Out(1),
                "done": Out(1),
                "error": Out(ErrorCode),
            }
        )
        self.width = width
        self.preload = preload
        self.parameters: dict[str, object] = {"width": width, "preload": preload}
        self.fraction_bits = width + 12
        self.least_period = 2
        self.preloaded = 1 << (self.fraction_bits - 1) if preload == "half" else 0

        bits = width + self.fraction_bits
        self.input = QuadrantInput(width, 2)
        self.divider = {a: Divider(bits, periods_bits(width), name=f"_{a}") for a in "xy"}
        self.uu = ControlUnit()
        self.output = CarrierOutput(width)
        self.tick = Signal(range(bits + 2))
        self.next_periods = Signal(periods_bits(width))
        self.next_period = Signal(PERIOD_BITS)
        self.mean = {a: Signal(bits, name=name) for a, name in (("x", "p1"), ("y", "p2"))}
        self.left = {a: Signal(width, name=name) for a, name in (("x", "p5"), ("y", "p6"))}
        self.fraction = {
            a: Signal(self.fraction_bits, init=self.preloaded, name=f"s{a}") for a in "xy"
        }
        self.direction = {a: Signal(name=f"direction_{a}") for a in "xy"}
        self.periods = Signal(periods_bits(width))
        self.period = Signal(PERIOD_BITS)
        self.busy_behind = Signal()
        self.answered_empty = Signal()

        inp, out, uu = self.input, self.output, self.uu
        groups = {
            "P1, P2 mean increments": [*self.mean.values()],
            "SX, SY fractions kept": [*self.fraction.values()],
            "P5, P6 steps left": [*self.left.values()],
            "P3, P4 position": [*out.place.values()],
            "carrier": [self.periods, self.period, out.timer, *self.direction.values()],
            "УУ": [uu.running, uu.done_register, uu.error_register],
            "increments that wait": [out.waiting_register, *out.out.values()],
            "prepared block": [
                inp.pending_register,
                inp.fault_register,
                *inp.start_registers.values(),
                *inp.delta_registers.values(),
                *inp.negative_registers.values(),
                self.next_periods,
                self.next_period,
                self.tick,
                *(part.quotient for part in self.divider.values()),
                *(part.rest for part in self.divider.values()),
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
        block, tick = self.blocks.payload, self.tick
        m.submodules.input = inp
        m.submodules.uu = uu
        m.submodules.output = out
        accept, bad = Signal(name="accept"), Signal(name="bad")
        m.d.comb += [
            inp.blocks.payload.start.eq(block.start),
            inp.blocks.payload.end.eq(block.end),
            inp.blocks.valid.eq(self.blocks.valid),
            self.blocks.ready.eq(inp.blocks.ready),
            accept.eq(self.blocks.valid & self.blocks.ready),
            # A prepared block leaves in the clock in which it is started, and the next may come.
            inp.idle.eq(uu.idle & uu.pending),
            inp.take.eq(uu.start),
            uu.pending.eq(inp.pending & (tick == 0) & ~(self.busy_behind & (bad | inp.empty))),
            uu.empty.eq(inp.empty),
            uu.waiting.eq(out.waiting),
            uu.ready.eq(self.steps.ready),
            self.answered_empty.eq(uu.load & uu.empty),
            self.steps.valid.eq(out.waiting),
            self.steps.payload.last.eq(uu.last),
            self.busy.eq(inp.pending | uu.busy),
            self.done.eq(uu.done),
            self.error.eq(uu.error),
        ]
        with m.If(accept):
            m.d.sync += [
                self.next_periods.eq(block.periods),
                self.next_period.eq(block.period),
                tick.eq(1),
            ]
        with m.Elif(tick == len(self.mean["x"]) + 1):
            m.d.sync += tick.eq(0)
        with m.Elif(tick != 0):
            m.d.sync += tick.eq(tick + 1)
        m.d.comb += [
            bad.eq(
                (inp.fault != ErrorCode.NONE) | (self.next_periods == 0) | (self.next_period < 2)
            ),
            # The code of a bad length, or that of a bad timing.
            uu.fault.eq(inp.fault.as_value() | bad),
        ]

        due = Signal()
        arriving = Signal(2)
        m.d.comb += [
            due.eq(uu.clock & out.due),
            out.load.eq(uu.load),
            out.start.eq(inp.start),
            out.put.eq(due),
            out.period.eq(self.period),
            out.taken.eq(uu.taken),
            self.position.x.eq(out.place["x"]),
            self.position.y.eq(out.place["y"]),
            uu.ending.eq(out.due & ((self.periods == 1) | arriving.all())),
        ]
        with m.If(uu.load):
            m.d.sync += [self.periods.eq(self.next_periods), self.period.eq(self.next_period)]
        with m.Elif(due):
            m.d.sync += self.periods.eq(self.periods - 1)
        for index, a in enumerate("xy"):
            divider, mean, fraction = self.divider[a], self.mean[a], self.fraction[a]
            left, direction = self.left[a], self.direction[a]
            m.submodules[f"divider_{a}"] = divider
            rest, whole = (
                Signal(self.fraction_bits, name=f"rest_{a}"),
                Signal(self.width + 1, name=f"whole_{a}"),
            )
            now = Signal(self.width, name=f"now_{a}")
            m.d.comb += [
                divider.load.eq(tick == 1),
                divider.dividend.eq(inp.delta[a] << self.fraction_bits),
                divider.divisor.eq(self.next_periods),
                Cat(rest, whole).eq(mean + fraction),
                arriving[index].eq(whole == left),
                now.eq(Mux(self.periods == 1, left, whole)),
                out.increment[a].eq(Mux(direction, -now, now)),
                self.steps.payload[a].eq(out.out[a]),
            ]
            m.d.comb += divider.divide.eq(tick != 0)
            with m.If(uu.load):
                m.d.sync += [
                    mean.eq(divider.quotient),
                    fraction.eq(self.preloaded),
                    left.eq(inp.delta[a]),
                    direction.eq(inp.negative[a]),
                ]
            with m.Elif(due):
                m.d.sync += [fraction.eq(rest), left.eq(left - now)]
        return m
