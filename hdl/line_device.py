"""The smallest device: lines in, motor pulses out, for an FPGA that has no room for the whole."""

from amaranth import Module, ResetInserter, Signal
from amaranth.hdl import Value
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.comparison import Comparison
from discreta.hdl.contract import Part, check_number, check_width, per_axis, point_layout
from discreta.hdl.feed import ACCELERATION_BITS, OVERRIDE_BITS
from discreta.hdl.pulse import TIMING_BITS, PulseUnit
from discreta.hdl.queue import StopReason

__all__ = ["PERIOD_BITS", "LineDevice", "line_device_layout"]

#: Bits of the clocks from step to step.
PERIOD_BITS = 16

_TIMINGS = ("pulse_length", "pulse_space", "direction_setup", "direction_hold")


def line_device_layout(width: int) -> data.StructLayout:
    """Lay out a block: its end, and the clocks from step to step, less one."""
    return data.StructLayout({"end": point_layout(width, 2), "period": PERIOD_BITS})


class LineDevice(Part):
    """Runs lines in two axes, one behind the other, each at a rate of its own.

    Two parts: the :class:`~discreta.hdl.comparison.Comparison` interpolator works out the steps,
    the :class:`~discreta.hdl.pulse.PulseUnit` puts them out and counts the position. Between them a
    counter in place of a feed unit. It has the ports of a :class:`~discreta.hdl.device.Device`.

    Blocks: ``end`` and ``period``, P; a line begins where the machine stands. The next one is
    accepted when the last pulse of the one before it and the space behind it are over.

    Speed: a step of either axis leaves every P clocks, or as soon as the pulses allow; so along an
    axis 1/P steps per clock, and along a diagonal, which takes two steps, 1/√2 of that. No ramp.

    Inputs: the limit switches as in the pulse unit; ``hold`` keeps back the next step, at once. The
    timings are fixed: pulse, space, set-up and hold of the direction are ``timing`` clocks each.
    ``override``, ``acceleration``, ``single`` and the timings at the ports do nothing. ``stop`` and
    ``emergency`` drop the step that waits, ``clear`` takes the device back to work. All inputs are
    synchronous.

    Stops: ``reason`` tells why the device stands still and takes no blocks, 0 if it does not:
    ``STOP``, ``EMERGENCY``, ``LIMIT``, or ``RANGE`` where a line is longer than 2^n − 1 along an
    axis. ``position`` is exact; the rest of the block is gone. ``clear`` does nothing while
    ``emergency`` is given or a pulse is under way.

    Latency: ``stop``, ``emergency`` in clock t: the last leading edge is visible in t + 1,
    ``reason`` in t + 1.

    Throughput: a step in P clocks, or in two ``timing`` along an axis; between two blocks what the
    interpolator prepares.

    ``busy``: a block or a pulse is under way. ``done``: a block has ended; its last step has left
    the interpolator, and the pulse follows.

    Reset: standing at the origin. Overflow: none.
    Error bound: that of the interpolator, 1 step.
    Source: lectures on interpolation by comparison; exercise 3, figure 3.3, its БЗС a mere counter.
    Stops, limits and pulses are ours.

    Parameters
    ----------
    width : int
        n, 4 to 32.
    timing : int
        Clocks, 1 to 4095.

    Attributes
    ----------
    depth : int
        Blocks that it holds: the one that runs.
    interpolators : dict of str to Part
        By kind: ``line``.
    parameters : dict of str to object
        The parameters it was made with.
    diagram : dict of str to list of Signal
        Every register there is, by the group's title.
    registers : dict of str to Signal
        The same registers; those of the interpolator behind ``line_``, the pulse unit's ``hold`` as
        ``pulse_hold``.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """

    notation = "n = width, P = period"

    def __init__(self, width: int = 12, *, timing: int = 60):
        check_width(width)
        check_number("timing", timing, 1, 2**TIMING_BITS - 1)
        self.line = Comparison(width)
        self.pulse = PulseUnit(width, 2)
        self.interpolators: dict[str, Part] = {"line": self.line}
        point, flags = point_layout(width, 2), per_axis(2, 1)
        super().__init__(
            {
                "blocks": In(stream.Signature(line_device_layout(width))),
                "override": In(OVERRIDE_BITS),
                "acceleration": In(ACCELERATION_BITS),
                "hold": In(1),
                "single": In(1),
                "stop": In(1),
                "emergency": In(1),
                "clear": In(1),
                "low_limit": In(flags),
                "high_limit": In(flags),
                **dict.fromkeys(_TIMINGS, In(TIMING_BITS)),
                "pins": Out(self.pulse.pins.shape()),
                "position": Out(point),
                "busy": Out(1),
                "done": Out(1),
                "reason": Out(StopReason),
            }
        )
        self.width = width
        self.axes = 2
        self.depth = 1
        self.timing = timing
        self.parameters: dict[str, object] = {"width": width, "timing": timing}
        self.period = Signal(PERIOD_BITS)
        self.pause = Signal(PERIOD_BITS)
        self.reason_register = Signal(StopReason, name="reason")
        self.diagram: dict[str, list[Signal]] = {
            **self.pulse.diagram,
            "start pulses": [self.period, self.pause],
            "stops": [Value.cast(self.reason_register)],
        }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }
        # The device has an input of that name.
        self.registers["pulse_hold"] = self.registers.pop("hold")
        self.diagram |= {f"line: {title}": group for title, group in self.line.diagram.items()}
        self.registers |= {f"line_{name}": value for name, value in self.line.registers.items()}

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        line, pulse, reason = self.line, self.pulse, self.reason_register
        stands, rests, permit, taken = Signal(), Signal(), Signal(), Signal()
        m.submodules.line = ResetInserter(stands)(line)
        m.submodules.pulse = pulse
        m.d.comb += [
            stands.eq(reason != StopReason.NONE),
            rests.eq(~line.busy & ~pulse.busy & ~stands),
            line.blocks.valid.eq(self.blocks.valid & rests),
            self.blocks.ready.eq(line.blocks.ready & rests),
            permit.eq((self.pause == 0) & ~self.hold),
            pulse.steps.valid.eq(line.steps.valid & permit),
            line.steps.ready.eq(pulse.steps.ready & permit),
            taken.eq(pulse.steps.valid & pulse.steps.ready),
            pulse.stop.eq(stands | self.stop | self.emergency | pulse.limited),
            pulse.low_limit.eq(self.low_limit),
            pulse.high_limit.eq(self.high_limit),
            *(getattr(pulse, name).eq(self.timing) for name in _TIMINGS),
            self.pins.eq(pulse.pins),
            self.position.eq(pulse.position),
            self.busy.eq(line.busy | pulse.busy),
            self.done.eq(line.done),
            self.reason.eq(reason),
        ]
        for a in "xy":
            m.d.comb += [
                line.blocks.payload.start[a].eq(pulse.position[a]),
                line.blocks.payload.end[a].eq(self.blocks.payload.end[a]),
                pulse.steps.payload[a].eq(line.steps.payload[a]),
            ]
        with m.If(self.blocks.valid & self.blocks.ready):
            m.d.sync += self.period.eq(self.blocks.payload.period)
        with m.If(taken):
            m.d.sync += self.pause.eq(self.period)
        with m.Elif(self.pause != 0):
            m.d.sync += self.pause.eq(self.pause - 1)

        with m.If(self.emergency):
            m.d.sync += reason.eq(StopReason.EMERGENCY)
        with m.Elif(stands), m.If(self.clear & ~pulse.busy):
            m.d.sync += reason.eq(StopReason.NONE)
        with m.Elif(pulse.limited):
            m.d.sync += reason.eq(StopReason.LIMIT)
        with m.Elif(line.error.as_value().any()):
            m.d.sync += reason.eq(StopReason.RANGE)
        with m.Elif(self.stop):
            m.d.sync += reason.eq(StopReason.STOP)
        return m
