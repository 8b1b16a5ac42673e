# amaranth: UnusedElaboratable=no
# (The parts of a device that is refused are not used.)
"""The whole device: blocks in, motor pulses out, at the programmed speed."""

from collections.abc import Sequence
from typing import Any

from amaranth import Module, ResetInserter, Signal
from amaranth.hdl import Value
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.arc_input import arc_block_layout
from discreta.hdl.conic import conic_block_layout
from discreta.hdl.constant_speed import (
    ConstantSpeed,
    constant_arc,
    constant_line,
    constant_speed_layout,
)
from discreta.hdl.contract import Part, check_axes, check_width, per_axis, point_layout
from discreta.hdl.exact_conic import ExactConic
from discreta.hdl.feed import ACCELERATION_BITS, OVERRIDE_BITS, FeedUnit
from discreta.hdl.pulse import TIMING_BITS, PulseUnit
from discreta.hdl.quadrant import line_block_layout
from discreta.hdl.queue import KINDS, BlockQueue, StopReason, device_block_layout

__all__ = ["Device", "exact_device", "exact_layout"]

_TIMINGS = ("pulse_length", "pulse_space", "direction_setup", "direction_hold")


class Device(Part):
    """Runs lines, arcs and curves from one queue, and puts them out as pulses for the motors.

    Four parts, and the interpolators: the :class:`~discreta.hdl.queue.BlockQueue` hands every block
    to the interpolator of its kind, the :class:`~discreta.hdl.feed.FeedUnit` says when the next
    step may leave, the :class:`~discreta.hdl.pulse.PulseUnit` makes pulses of it and counts the
    position. A step leaves when the interpolator has it ready, the feed unit permits it, and the
    pulse unit takes it: whoever is slowest sets the pace, and nothing is lost.

    Blocks: ``kind``, speed ``feed``, path ``ahead``, ``end``, and what the kind needs besides; a
    block starts where the one before it ended, the first one at the origin. A block of kind
    ``PLACE`` tells the device where the machine stands.

    Inputs: ``override``, ``acceleration``, ``hold``, ``single`` as in the feed unit; the timings of
    the pulses and the limit switches as in the pulse unit. ``stop`` for one clock or more ends the
    run as ``hold`` does, down the ramp; ``reason`` is ``STOP`` when the last pulse is over.
    ``emergency`` ends it at once. All inputs are synchronous.

    Stops: ``reason`` tells why the device stands still and takes no blocks, 0 if it does not:
    ``STOP``, ``EMERGENCY``, ``LIMIT``, or the refusal of a block. All steps before the place where
    it stands were made, and ``position`` is exact; the blocks of the queue and the rest of the
    current one are gone. ``clear`` takes it back to work when ``emergency`` is not given and no
    pulse is under way; then the next block starts at ``position``. Under ``LIMIT`` steps away from
    the switch are possible then, and any step towards it is the next ``LIMIT``.

    Latency: ``emergency`` in clock t: the last leading edge is visible in t + 1, ``reason`` in
    t + 1. A step that waits for a limit switch is never put out, however soon the switch is
    released; ``reason`` follows within 3 clocks of the time at which it would have been, also where
    the refusal of the next block was told before. A step that is permitted waits one clock in the
    pulse unit at least.

    Throughput: a step a clock at most, as far as interpolator, feed and pulses allow it; between
    blocks see the queue.

    ``busy``: a block or a pulse is under way. ``done``: a block has ended; its last step has left
    the interpolator, and the pulse follows. Every block is answered by ``done``, in order, until
    one is refused or the device stops.

    Reset: nothing queued, standing at the origin. Overflow: none that its parts do not have.
    Error bound: that of the interpolators. Speed: that of the feed unit; of lines and arcs that
    come in ticks, those of :class:`~discreta.hdl.constant_speed.ConstantSpeed`, it is constant
    along the path.

    Source: exercise 3, figure 3.3 (interpolator, БЗС, output device). Stops, limits and pulses are
    ours.

    Parameters
    ----------
    line, arc, conic : Part or None
        The interpolators, of the same width and number of axes, without a carrier; at least one.
    depth : int
        Blocks that the queue holds, 1 to 4096.
    pauses, pairing, multiplier
        Of the feed unit.
    pins : str
        ``"step_direction"`` or ``"quadrature"``.
    inverted_steps, inverted_directions : str
        Of the pulse unit.

    Attributes
    ----------
    interpolators : dict of str to Part
        Those there are, by kind.
    parameters : dict of str to object
        The parameters it was made with.
    diagram : dict of str to list of Signal
        Every register there is but those of waiting blocks beyond one, by the group's title.
    registers : dict of str to Signal
        The same registers; those of an interpolator by their names behind its kind: ``line_p1``,
        the pulse unit's ``hold`` as ``pulse_hold``.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """

    notation = "F = feed in steps per clock"

    def __init__(
        self,
        *,
        line: Part | None = None,
        arc: Part | None = None,
        conic: Part | None = None,
        depth: int = 16,
        pauses: Sequence[int] | None = None,
        pairing: bool = True,
        multiplier: bool = False,
        pins: str = "step_direction",
        inverted_steps: str = "",
        inverted_directions: str = "",
    ):
        given = {"line": line, "arc": arc, "conic": conic}
        self.interpolators = {kind: part for kind, part in given.items() if part is not None}
        width, axes = _shared(self.interpolators)
        self.width = width
        self.axes = axes
        self.depth = depth
        layouts = {kind: part.blocks.payload.shape() for kind, part in self.interpolators.items()}
        steady = [
            kind for kind, part in self.interpolators.items() if isinstance(part, ConstantSpeed)
        ]
        self.queue = BlockQueue(width, axes, layouts, depth, steady=steady)
        self.feed = FeedUnit(axes, pauses=pauses, pairing=pairing, multiplier=multiplier)
        self.pulse = PulseUnit(
            width,
            axes,
            kind=pins,
            inverted_steps=inverted_steps,
            inverted_directions=inverted_directions,
        )
        flags = per_axis(axes, 1)
        super().__init__(
            {
                "blocks": In(stream.Signature(self.queue.layout)),
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
                "position": Out(point_layout(width, axes)),
                "busy": Out(1),
                "done": Out(1),
                "reason": Out(StopReason),
            }
        )
        self.parameters: dict[str, object] = {
            "width": width,
            "axes": axes,
            "kinds": tuple(self.interpolators),
            "depth": depth,
            "pauses": self.feed.pauses,
            "pairing": pairing,
            "multiplier": multiplier,
            "pins": pins,
            "inverted_steps": inverted_steps,
            "inverted_directions": inverted_directions,
        }
        self.reason_register = Signal(StopReason, name="reason")
        self.stop_asked = Signal()
        self.diagram: dict[str, list[Signal]] = {
            **self.pulse.diagram,
            **self.feed.diagram,
            "stops": [Value.cast(self.reason_register), self.stop_asked],
            **self.queue.diagram,
        }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }
        # The device has an input of that name.
        self.registers["pulse_hold"] = self.registers.pop("hold")
        self.intermediates = {"taken": self.queue.taken, **self.feed.intermediates}
        for kind, part in self.interpolators.items():
            self.diagram |= {f"{kind}: {title}": group for title, group in part.diagram.items()}
            self.registers |= {f"{kind}_{name}": value for name, value in part.registers.items()}
            self.intermediates |= {
                f"{kind}_{name}": value for name, value in part.intermediates.items()
            }

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        queue, feed, pulse = self.queue, self.feed, self.pulse
        reason = self.reason_register
        stands, drops = Signal(), Signal()
        m.submodules.queue = queue
        m.submodules.feed = ResetInserter(stands)(feed)
        m.submodules.pulse = pulse
        for kind, part in self.interpolators.items():
            m.submodules[kind] = ResetInserter(stands)(part)
            offered, steps = getattr(queue, f"{kind}_blocks"), getattr(queue, f"{kind}_steps")
            m.d.comb += [
                part.blocks.payload.eq(offered.payload),
                part.blocks.valid.eq(offered.valid),
                offered.ready.eq(part.blocks.ready),
                steps.payload.eq(part.steps.payload),
                steps.valid.eq(part.steps.valid),
                part.steps.ready.eq(steps.ready),
                getattr(queue, f"{kind}_done").eq(part.done),
                getattr(queue, f"{kind}_error").eq(part.error),
            ]
        m.d.comb += [
            stands.eq(reason != StopReason.NONE),
            drops.eq(
                self.emergency
                | pulse.limited
                | (reason == StopReason.EMERGENCY)
                | (reason == StopReason.LIMIT)
            ),
            queue.blocks.payload.eq(self.blocks.payload),
            queue.blocks.valid.eq(self.blocks.valid),
            self.blocks.ready.eq(queue.blocks.ready),
            queue.flush.eq(stands),
            queue.quiet.eq(~pulse.busy),
            queue.permit.eq(feed.permit),
            queue.position.eq(pulse.position),
            feed.active.eq(queue.active),
            feed.begins.eq(queue.begins),
            feed.feed.eq(queue.feed),
            feed.ahead.eq(queue.ahead),
            feed.taken.eq(queue.taken),
            feed.even.eq(queue.even),
            feed.override.eq(self.override),
            feed.acceleration.eq(self.acceleration),
            feed.hold.eq(self.hold | self.stop_asked),
            feed.single.eq(self.single & ~self.stop_asked),
            pulse.steps.payload.eq(queue.steps.payload),
            pulse.steps.valid.eq(queue.steps.valid),
            queue.steps.ready.eq(pulse.steps.ready),
            pulse.load.eq(queue.placing),
            pulse.initial.eq(queue.place),
            pulse.stop.eq(drops),
            pulse.low_limit.eq(self.low_limit),
            pulse.high_limit.eq(self.high_limit),
            *(getattr(pulse, name).eq(getattr(self, name)) for name in _TIMINGS),
            self.pins.eq(pulse.pins),
            self.position.eq(pulse.position),
            self.busy.eq(queue.busy | pulse.busy),
            self.done.eq(queue.done),
            self.reason.eq(reason),
        ]
        m.d.comb += [feed.moves[a].eq(queue.steps.payload[a].any()) for a in queue.letters]

        m.d.sync += self.stop_asked.eq((self.stop | self.stop_asked) & ~stands)
        with m.If(self.emergency):
            m.d.sync += reason.eq(StopReason.EMERGENCY)
        with m.Elif(pulse.limited & (reason != StopReason.EMERGENCY)):
            m.d.sync += reason.eq(StopReason.LIMIT)
        with m.Elif(stands), m.If(self.clear & ~pulse.busy):
            m.d.sync += reason.eq(StopReason.NONE)
        with m.Elif(queue.refusal != StopReason.NONE):
            m.d.sync += reason.eq(queue.refusal)
        with m.Elif(self.stop_asked & feed.still & ~queue.taken & ~pulse.busy):
            m.d.sync += reason.eq(StopReason.STOP)
        return m


def exact_device(
    width: int = 16, axes: int = 2, kinds: Sequence[str] = ("line", "arc"), **choices: Any
) -> Device:
    """Make a device with the exact interpolators, lines and arcs at constant speed.

    Parameters
    ----------
    width : int
        n, 4 to 32, with conics to 16.
    axes : int
        2 to 6; with conics 2. Beyond two axes an arc lies in x and y and the others move along it.
    kinds : sequence of str
        Which interpolators it has: of ``"line"``, ``"arc"``, ``"conic"``.
    choices
        Further parameters of :class:`Device`.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """
    _check_kinds(kinds, axes)
    parts: dict[str, Part] = {}
    if "line" in kinds:
        parts["line"] = constant_line(width, axes)
    if "arc" in kinds:
        parts["arc"] = constant_arc(width, axes)
    if "conic" in kinds:
        parts["conic"] = ExactConic(width)
    return Device(**parts, **choices)


def exact_layout(
    width: int = 16, axes: int = 2, kinds: Sequence[str] = ("line", "arc")
) -> data.StructLayout:
    """Lay out the blocks of :func:`exact_device` for whoever sends them and has none."""
    check_width(width)
    check_axes(axes)
    _check_kinds(kinds, axes)
    cores = {
        "line": constant_speed_layout(line_block_layout(width, axes), width, axes),
        "arc": constant_speed_layout(arc_block_layout(width), width, axes),
        "conic": conic_block_layout(width),
    }
    return device_block_layout(width, axes, {kind: cores[kind] for kind in KINDS if kind in kinds})


def _check_kinds(kinds: Sequence[str], axes: int) -> None:
    """Raise ``ValueError`` unless there are exact interpolators of all these kinds."""
    if not kinds or not set(kinds) <= set(KINDS):
        raise ValueError(f"kinds are {tuple(kinds)!r}: choose one or more of {', '.join(KINDS)}")
    if "conic" in kinds and axes != 2:
        raise ValueError(f"number of axes is {axes!r}: conics lie in a plane, choose 2")


def _shared(interpolators: dict[str, Part]) -> tuple[int, int]:
    """Give the width and the number of axes that interpolators share; ``ValueError`` if none."""
    if not interpolators:
        raise ValueError(f"no interpolator: give one or more of {', '.join(KINDS)}")
    shapes = {
        kind: (part.parameters["width"], part.parameters.get("axes", 2))
        for kind, part in interpolators.items()
    }
    if len(set(shapes.values())) > 1:
        said = ", ".join(f"{kind} {n} bits and {axes} axes" for kind, (n, axes) in shapes.items())
        raise ValueError(f"interpolators differ: {said}; choose the same for all")
    return next(iter(shapes.values()))
