"""A serial line: bytes in and out, a start bit, eight bits with the lowest first, a stop bit."""

from amaranth import Cat, Const, Module, Signal
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part

__all__ = [
    "MAX_CLOCKS_PER_BIT",
    "MIN_CLOCKS_PER_BIT",
    "UartReceiver",
    "UartTransmitter",
    "check_clocks_per_bit",
    "received_layout",
]

#: A receiver that looks into the middle of a bit needs four clocks of it.
MIN_CLOCKS_PER_BIT, MAX_CLOCKS_PER_BIT = 4, 1 << 16

#: Data bits, and the slots of a byte on the line behind its start bit.
_DATA_BITS = 8
_START, _FIRST_BIT, _STOP_BIT, _BROKEN = 1, 2, 10, 11


def received_layout() -> data.StructLayout:
    """Lay out what was received: a byte, and whether its stop bit was missing."""
    return data.StructLayout({"data": _DATA_BITS, "error": 1})


def check_clocks_per_bit(clocks: int) -> None:
    """Raise ``TypeError`` or ``ValueError`` unless a bit can have so many clocks."""
    limits = f"a whole number from {MIN_CLOCKS_PER_BIT} to {MAX_CLOCKS_PER_BIT}"
    if not isinstance(clocks, int) or isinstance(clocks, bool):
        raise TypeError(f"clocks per bit must be {limits}, not {clocks!r}")
    if not MIN_CLOCKS_PER_BIT <= clocks <= MAX_CLOCKS_PER_BIT:
        raise ValueError(
            f"clocks per bit are {clocks}: choose {limits}, by another baud rate or clock"
        )


class UartReceiver(Part):
    """Takes bytes from a line: 8N1.

    A byte begins when the idle line is 0. Half a bit later, in the middle of the start bit, the
    line is looked at again: a shorter pulse is noise, and forgotten. The data bits follow, the
    lowest first, each looked at a bit further on, and the stop bit. If that is 0 the byte is given
    with ``error``, and the line must be 1 before the next byte can begin.

    ``rx`` must be synchronous to the clock.

    Latency: the byte is valid ⌊N/2⌋ + 9·N + 1 clocks after the first clock in which the line is 0,
    N clocks a bit. Throughput: a byte in 9½ bits; so a sender may be up to 5 % too quick or too
    slow at N ≥ 16.

    Overflow: a byte that is not taken within N clocks is lost. Error: see ``error``.
    Reset: idle, nothing received.
    Source: none of the documents; the usual asynchronous line.

    Parameters
    ----------
    clocks_per_bit : int
        N, 4 to 65536.

    Attributes
    ----------
    parameters : dict of str to object
        The parameters it was made with.
    diagram : dict of str to list of Signal
        Every register there is, grouped, by the group's title.
    registers : dict of str to Signal
        The same registers, by their names in waveforms.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """

    notation = "N = clocks per bit"

    def __init__(self, clocks_per_bit: int):
        check_clocks_per_bit(clocks_per_bit)
        super().__init__({"rx": In(1), "bytes": Out(stream.Signature(received_layout()))})
        self.clocks_per_bit = clocks_per_bit
        self.parameters: dict[str, object] = {"clocks_per_bit": clocks_per_bit}
        self.slot = Signal(range(_BROKEN + 1))
        self.timer = Signal(range(clocks_per_bit))
        self.shift = Signal(_DATA_BITS)
        self.received = Signal()
        self.broken = Signal()
        self.diagram: dict[str, list[Signal]] = {
            "receiver": [self.slot, self.timer, self.shift, self.received, self.broken]
        }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        m.d.comb += [
            self.bytes.payload.data.eq(self.shift),
            self.bytes.payload.error.eq(self.broken),
            self.bytes.valid.eq(self.received),
        ]
        with m.If(self.bytes.ready):
            m.d.sync += self.received.eq(0)
        with m.If(self.slot == 0):
            m.d.sync += self.timer.eq(self.clocks_per_bit // 2 - 1)
            with m.If(~self.rx):
                m.d.sync += self.slot.eq(_START)
        with m.Elif(self.slot == _BROKEN), m.If(self.rx):
            m.d.sync += self.slot.eq(0)
        with m.Elif(self.timer != 0):
            m.d.sync += self.timer.eq(self.timer - 1)
        with m.Else():
            m.d.sync += [self.timer.eq(self.clocks_per_bit - 1), self.slot.eq(self.slot + 1)]
            with m.If(self.slot == _START), m.If(self.rx):
                m.d.sync += self.slot.eq(0)
            with m.Elif(self.slot == _STOP_BIT):
                m.d.sync += [self.received.eq(1), self.broken.eq(~self.rx)]
                with m.If(self.rx):
                    m.d.sync += self.slot.eq(0)
            with m.Else():
                m.d.sync += self.shift.eq(Cat(self.shift[1:], self.rx))
        return m


class UartTransmitter(Part):
    """Puts bytes out on a line: 8N1.

    Latency: the start bit begins in the clock after the one in which a byte is taken. Throughput: a
    byte in 10·N clocks, N clocks a bit, the stop bit a whole one.

    Reset: the line is 1, nothing to send. Overflow, error: none.
    Source: none of the documents; the usual asynchronous line.

    Parameters
    ----------
    clocks_per_bit : int
        N, 4 to 65536.

    Attributes
    ----------
    parameters : dict of str to object
        The parameters it was made with.
    diagram : dict of str to list of Signal
        Every register there is, grouped, by the group's title.
    registers : dict of str to Signal
        The same registers, by their names in waveforms.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """

    notation = "N = clocks per bit"

    def __init__(self, clocks_per_bit: int):
        check_clocks_per_bit(clocks_per_bit)
        super().__init__({"bytes": In(stream.Signature(_DATA_BITS)), "tx": Out(1)})
        self.clocks_per_bit = clocks_per_bit
        self.parameters: dict[str, object] = {"clocks_per_bit": clocks_per_bit}
        self.line = Signal(init=1)
        self.shift = Signal(_DATA_BITS + 1)
        self.left = Signal(range(_DATA_BITS + 2))
        self.timer = Signal(range(clocks_per_bit))
        self.diagram: dict[str, list[Signal]] = {
            "transmitter": [self.line, self.shift, self.left, self.timer]
        }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        m.d.comb += [
            self.tx.eq(self.line),
            self.bytes.ready.eq((self.left == 0) & (self.timer == 0)),
        ]
        with m.If(self.timer != 0):
            m.d.sync += self.timer.eq(self.timer - 1)
        with m.Elif(self.left != 0):
            m.d.sync += [
                self.line.eq(self.shift[0]),
                self.shift.eq(self.shift >> 1),
                self.left.eq(self.left - 1),
                self.timer.eq(self.clocks_per_bit - 1),
            ]
        with m.Elif(self.bytes.valid):
            m.d.sync += [
                self.line.eq(0),
                self.shift.eq(Cat(self.bytes.payload, Const(1, 1))),
                self.left.eq(_DATA_BITS + 1),
                self.timer.eq(self.clocks_per_bit - 1),
            ]
        return m
