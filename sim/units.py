"""The units of the device beside the interpolators, and the device itself, found by their names."""

from typing import Any

from discreta.hdl.conic import MAX_WIDTH as CONIC_MAX_WIDTH
from discreta.hdl.constant_speed import constant_arc, constant_line
from discreta.hdl.device import exact_device, exact_layout
from discreta.hdl.feed import PAUSES, FeedUnit
from discreta.hdl.link import Link, fingerprint, layout_fields
from discreta.hdl.pulse import KINDS as PIN_KINDS
from discreta.hdl.pulse import PulseUnit
from discreta.hdl.uart import UartReceiver, UartTransmitter
from discreta.sim.golden.constant_speed import constant_arc as golden_constant_arc
from discreta.sim.golden.constant_speed import constant_line as golden_constant_line
from discreta.sim.golden.device import make_device as golden_device
from discreta.sim.golden.feed import FeedUnit as GoldenFeedUnit
from discreta.sim.golden.fifo import QueuedDevice
from discreta.sim.golden.link import Link as GoldenLink
from discreta.sim.golden.pulse import PulseUnit as GoldenPulseUnit
from discreta.sim.golden.uart import UartReceiver as GoldenUartReceiver
from discreta.sim.golden.uart import UartTransmitter as GoldenUartTransmitter
from discreta.sim.methods import Design

__all__ = ["EXERCISE_PAUSES", "UNITS"]

#: The exercise's own: 1.4 times as long after a step on both axes.
EXERCISE_PAUSES = (256, 358)


def _golden_device(width: int, *, kinds: tuple[str, ...], depth: int) -> Any:
    """Make the golden model; that of a longer queue runs on integers alone."""
    device = golden_device(width, kinds)
    return device if depth == 1 else QueuedDevice(device, depth)


def _link(width: int, axes: int = 2, *, kinds: tuple[str, ...], depth: int) -> Link:
    """Make the link of a device that has these kinds of curves."""
    return Link(exact_layout(width, axes, kinds), width, axes, depth)


def _golden_link(width: int, axes: int = 2, *, kinds: tuple[str, ...], depth: int) -> GoldenLink:
    """Make its golden model."""
    layout = exact_layout(width, axes, kinds)
    return GoldenLink(tuple(layout_fields(layout)), fingerprint(layout), width, axes, depth)


#: Clocks of a bit: the fewest, an odd number, a common one; and those of 115,200 baud at 12 MHz.
_BITS, _USUAL_BIT = (4, 5, 16), 104

UNITS = {
    unit.name: unit
    for unit in (
        Design(
            name="constant_line",
            summary="exact line at constant speed: its steps spread over ticks of equal length",
            device=constant_line,
            golden=golden_constant_line,
            axes=(2, 3, 4, 5, 6),
            choices={},
            settings={"default": {}},
            proofs="constant_speed",
        ),
        Design(
            name="constant_arc",
            summary="exact arc at constant speed, further axes linear along it",
            device=constant_arc,
            golden=golden_constant_arc,
            axes=(2, 3, 4, 5, 6),
            choices={},
            settings={"default": {}},
            proofs="constant_speed",
        ),
        Design(
            name="feed",
            summary="start pulses at the programmed speed: override, ramp, hold, single step",
            device=lambda _width, **choices: FeedUnit(**choices),
            golden=lambda _width, **choices: GoldenFeedUnit(**choices),
            choices={"pauses": (PAUSES[:2], EXERCISE_PAUSES), "pairing": (True, False)},
            settings={
                "default": {"pauses": PAUSES[:2], "pairing": True},
                "lecture": {"pauses": EXERCISE_PAUSES, "pairing": False},
            },
        ),
        Design(
            name="pulse",
            summary="pulses for the motor drivers, with their timing rules, and the position",
            device=PulseUnit,
            golden=GoldenPulseUnit,
            choices={"kind": PIN_KINDS},
            settings={"default": {"kind": PIN_KINDS[0]}},
        ),
        Design(
            name="device",
            summary="blocks in, pulses out: queue, interpolators, feed and pulse unit",
            device=lambda width, **choices: exact_device(width, **choices),
            golden=_golden_device,
            # What waits beyond one block is in a FIFO of the library.
            choices={"kinds": (("line",), ("line", "arc")), "depth": (1,)},
            settings={"default": {"kinds": ("line", "arc", "conic"), "depth": 16}},
            max_width=CONIC_MAX_WIDTH,
        ),
        Design(
            name="link",
            summary="frames over a serial line to blocks and commands, and the status back",
            device=_link,
            golden=_golden_link,
            axes=(2, 3, 4, 5, 6),
            choices={"kinds": (("line",), ("line", "arc")), "depth": (1, 16)},
            settings={"default": {"kinds": ("line", "arc"), "depth": 16}},
        ),
        Design(
            name="uart_receiver",
            summary="a serial line to bytes",
            device=lambda _width, **choices: UartReceiver(**choices),
            golden=lambda _width, **choices: GoldenUartReceiver(**choices),
            choices={"clocks_per_bit": _BITS},
            settings={"default": {"clocks_per_bit": _USUAL_BIT}},
            proofs="uart",
        ),
        Design(
            name="uart_transmitter",
            summary="bytes to a serial line",
            device=lambda _width, **choices: UartTransmitter(**choices),
            golden=lambda _width, **choices: GoldenUartTransmitter(**choices),
            choices={"clocks_per_bit": _BITS},
            settings={"default": {"clocks_per_bit": _USUAL_BIT}},
            proofs="uart",
        ),
    )
}
