"""The units of the device beside the interpolators, and the device itself, found by their names."""

from typing import Any

from discreta.hdl.circular import Circular
from discreta.hdl.conic import MAX_WIDTH as CONIC_MAX_WIDTH
from discreta.hdl.conic import Conic
from discreta.hdl.device import Device
from discreta.hdl.feed import PAUSES, FeedUnit
from discreta.hdl.linear import Linear
from discreta.hdl.pulse import KINDS as PIN_KINDS
from discreta.hdl.pulse import PulseUnit
from discreta.sim.golden.device import make_device as golden_device
from discreta.sim.golden.feed import FeedUnit as GoldenFeedUnit
from discreta.sim.golden.fifo import QueuedDevice
from discreta.sim.golden.pulse import PulseUnit as GoldenPulseUnit
from discreta.sim.methods import Design

__all__ = ["EXERCISE_PAUSES", "UNITS", "make_device"]

#: The exercise's own: 1.4 times as long after a step on both axes.
EXERCISE_PAUSES = (256, 358)

_INTERPOLATORS = {"line": Linear, "arc": Circular, "conic": Conic}


def make_device(width: int, *, kinds: tuple[str, ...], depth: int, **choices: Any) -> Device:
    """Make a device with the default interpolators of some kinds of curves."""
    parts: dict[str, Any] = {kind: _INTERPOLATORS[kind](width) for kind in kinds}
    return Device(**parts, depth=depth, **choices)


def _golden_device(width: int, *, kinds: tuple[str, ...], depth: int) -> Any:
    """Make the golden model; that of a longer queue runs on integers alone."""
    device = golden_device(width, kinds)
    return device if depth == 1 else QueuedDevice(device, depth)


UNITS = {
    unit.name: unit
    for unit in (
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
            device=make_device,
            golden=_golden_device,
            # What waits beyond one block is in a FIFO of the library.
            choices={"kinds": (("line",), ("line", "arc")), "depth": (1,)},
            settings={"default": {"kinds": ("line", "arc", "conic"), "depth": 16}},
            max_width=CONIC_MAX_WIDTH,
        ),
    )
}
