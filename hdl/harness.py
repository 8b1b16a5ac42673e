"""What a core is measured in: registers on all sides; and what it is measured against."""

from amaranth import Cat, ClockDomain, Module, ResetSignal, Signal
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part, check_width
from discreta.hdl.plain import PlainPorts

__all__ = ["Harness", "LoneAccumulator", "bit_name"]


class LoneAccumulator(Part):
    """An accumulator and nothing else: what limits every core that sums.

    A clock computes (carry, acc) := acc + ``addend``.

    Latency: one clock.
    Throughput: one summation a clock.
    Overflow: the carry.
    Reset: all is 0.
    Error: none.
    Source: none, it is ours.

    Parameters
    ----------
    width : int
        4 to 32 bits.

    Raises
    ------
    TypeError, ValueError
        ``width`` is not one of the above.
    """

    def __init__(self, width: int):
        check_width(width)
        super().__init__({"addend": In(width), "carry": Out(1)})
        self.acc = Signal(width)
        self.registers = {"acc": self.acc, "carry": self.carry}

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        m.d.sync += Cat(self.acc, self.carry).eq(self.acc + self.addend)
        return m


class Harness(wiring.Component):
    """Registers around a core, with a pin to feed them all and a pin that depends on them all.

    The inputs of the core, its reset too, are the stages of a shift register, each the inverse of
    the one before it: otherwise a register of the core that only delays an input would be the
    next stage, and be shared with it. The outputs go each into a register of its own, and from
    there into a chain of registers, each the exclusive or of the one before it and of one output.
    So every output reaches the pin at a time of its own, and no two can cancel out. Between two
    registers of the harness lies one LUT.

    Latency: as many clocks as there are bits.
    Throughput: a bit in and a bit out every clock.
    Overflow, error: none.
    Reset: none of its own; the core is reset by the first stage.
    Source: none, it is ours.

    Parameters
    ----------
    core : Part
        The core, or its :class:`~discreta.hdl.plain.PlainPorts`.

    Attributes
    ----------
    fed, caught, folded : Signal
        The shift register; the outputs; the chain.
    inputs, outputs : list of str
        What each bit of ``fed`` and of ``caught`` is for.
    """

    def __init__(self, core: Part):
        super().__init__({"d": In(1), "q": Out(1)})
        self.core = core if isinstance(core, PlainPorts) else PlainPorts(core)
        self.domain = ClockDomain("sync")
        self.inputs = ["rst", *_bits(self.core.inputs)]
        self.outputs = _bits(self.core.outputs)
        self.fed = Signal(len(self.inputs), reset_less=True, attrs={"keep": 1})
        self.caught = Signal(len(self.outputs), reset_less=True, attrs={"keep": 1})
        self.folded = Signal(len(self.outputs), reset_less=True, attrs={"keep": 1})

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        m.domains += self.domain
        m.submodules.core = self.core
        m.d.sync += [
            self.fed.eq(~Cat(self.d, self.fed)),
            self.caught.eq(Cat(self.core.outputs.values())),
            self.folded.eq(self.caught ^ (self.folded << 1)),
        ]
        m.d.comb += [
            Cat(ResetSignal(), self.core.inputs.values()).eq(self.fed),
            self.q.eq(self.folded[-1]),
        ]
        return m


def _bits(ports: dict[str, Signal]) -> list[str]:
    return [
        bit_name(name, index, len(port))
        for name, port in ports.items()
        for index in range(len(port))
    ]


def bit_name(name: str, index: int, width: int) -> str:
    """Name one bit of a signal: by its index unless it is the only one."""
    return f"{name}[{index}]" if width > 1 else name
