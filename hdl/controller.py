"""A controller: the whole device behind a serial line, as it goes onto a board."""

from amaranth import Module, Signal
from amaranth.lib import data
from amaranth.lib.cdc import FFSynchronizer
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part, per_axis
from discreta.hdl.device import Device
from discreta.hdl.line_device import LineDevice
from discreta.hdl.link import Link
from discreta.hdl.queue import StopReason
from discreta.hdl.uart import UartReceiver, UartTransmitter, check_clocks_per_bit

__all__ = ["Controller", "leds_layout"]

#: For so many clocks after a frame the link is said to be alive, as a power of 2.
_ALIVE_BITS = 24


def leds_layout() -> data.StructLayout:
    """Lay out what the lamps show: it moves, it has stopped for a reason, the link is alive."""
    return data.StructLayout({"moving": 1, "stopped": 1, "link": 1})


class Controller(Part):
    """A device, its link, and a serial line: a host sends blocks, the motors turn.

    Ports: ``rx``, ``tx``, the serial line, 8N1, 1 when idle; ``pins``, by axis letter ``step`` and
    ``direction`` (or ``a`` and ``b``); ``low_limit``, ``high_limit``, by axis letter, the limit
    switches, 1 when active; ``emergency``, the button, 1 when pressed; ``leds``: ``moving`` (a
    block or a pulse is under way), ``stopped`` (for the reason that the status tells), ``link`` (a
    frame came whole in the last 2^24 clocks). Inputs may be asynchronous: each goes through two
    registers. A switch that opens when active, or bounces, is the board's matter; a bounce does no
    harm, as the device stops at the first contact.

    Latency: that of its parts, and 2 clocks of the inputs. Throughput: a byte in 10 bits each way.
    Reset: that of its parts; the line idle, the lamps off. Overflow, error: those of its parts.
    Source: none of the documents, it is ours; the device is the one of exercise 3, figure 3.3.

    Parameters
    ----------
    device : Device or LineDevice
    clocks_per_bit : int
        Of the serial line, 4 to 65536.

    Attributes
    ----------
    device : Device or LineDevice
    link : Link
    parameters : dict of str to object
        The parameters it was made with.
    diagram : dict of str to list of Signal
        The registers of device and link, by the group's title.
    registers : dict of str to Signal
        The same registers, by their names in waveforms; those of the link behind ``link_``.

    Raises
    ------
    TypeError, ValueError
        The device is none, or the clocks are out of range.
    """

    def __init__(self, device: Device | LineDevice, clocks_per_bit: int):
        if not isinstance(device, Device | LineDevice):
            raise TypeError(f"device must be a Device, not {device!r}")
        check_clocks_per_bit(clocks_per_bit)
        flags = per_axis(device.axes, 1)
        super().__init__(
            {
                "rx": In(1, init=1),
                "tx": Out(1),
                "low_limit": In(flags),
                "high_limit": In(flags),
                "emergency": In(1),
                "pins": Out(device.pins.shape()),
                "leds": Out(leds_layout()),
            }
        )
        self.device = device
        self.clocks_per_bit = clocks_per_bit
        self.link = Link(device.blocks.payload.shape(), device.width, device.axes, device.depth)
        self.receiver = UartReceiver(clocks_per_bit)
        self.transmitter = UartTransmitter(clocks_per_bit)
        self.parameters: dict[str, object] = {
            **device.parameters,
            "clocks_per_bit": clocks_per_bit,
        }
        self.alive = Signal(_ALIVE_BITS)
        self.diagram: dict[str, list[Signal]] = {
            **{f"link: {title}": group for title, group in self.link.diagram.items()},
            **device.diagram,
        }
        self.registers: dict[str, Signal] = {
            **{f"link_{name}": value for name, value in self.link.registers.items()},
            **device.registers,
        }

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        device, link = self.device, self.link
        receiver, transmitter = self.receiver, self.transmitter
        m.submodules.device = device
        m.submodules.link = link
        m.submodules.receiver = receiver
        m.submodules.transmitter = transmitter
        emergency = Signal()
        m.submodules.rx_synchronizer = FFSynchronizer(self.rx, receiver.rx, init=1)
        m.submodules.emergency_synchronizer = FFSynchronizer(self.emergency, emergency)
        for side in ("low_limit", "high_limit"):
            m.submodules[f"{side}_synchronizer"] = FFSynchronizer(
                getattr(self, side).as_value(), getattr(device, side).as_value()
            )
            m.d.comb += getattr(link, side).eq(getattr(device, side))
        m.d.comb += [
            link.bytes.payload.eq(receiver.bytes.payload),
            link.bytes.valid.eq(receiver.bytes.valid),
            receiver.bytes.ready.eq(link.bytes.ready),
            transmitter.bytes.payload.eq(link.answers.payload),
            transmitter.bytes.valid.eq(link.answers.valid),
            link.answers.ready.eq(transmitter.bytes.ready),
            self.tx.eq(transmitter.tx),
            device.blocks.payload.eq(link.blocks.payload),
            device.blocks.valid.eq(link.blocks.valid),
            link.blocks.ready.eq(device.blocks.ready),
            *(getattr(device, name).eq(getattr(link, name)) for name in link.settings),
            *(
                getattr(device, name).eq(getattr(link, name))
                for name in ("hold", "single", "stop", "clear")
            ),
            device.emergency.eq(link.emergency | emergency),
            link.button.eq(emergency),
            link.position.eq(device.position),
            link.busy.eq(device.busy),
            link.done.eq(device.done),
            link.reason.eq(device.reason),
            self.pins.eq(device.pins),
            self.leds.moving.eq(device.busy),
            self.leds.stopped.eq(device.reason != StopReason.NONE),
            self.leds.link.eq(self.alive != 0),
        ]
        with m.If(link.heard):
            m.d.sync += self.alive.eq(2**_ALIVE_BITS - 1)
        with m.Elif(self.alive != 0):
            m.d.sync += self.alive.eq(self.alive - 1)
        return m
