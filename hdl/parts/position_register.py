"""The position register (P3, P4 of the linear, P1, P2 of the circular interpolator)."""

from amaranth import Cat, Const, Module, Signal
from amaranth.hdl import signed, unsigned
from amaranth.lib.wiring import In

from discreta.hdl.contract import Part, check_width

__all__ = ["PositionRegister"]


class PositionRegister(Part):
    """The coordinate of an axis now: an up/down counter.

    Latency: ``register`` follows ``load``, ``up`` or ``down`` at the clock's edge. ``load`` goes
    before counting; ``up`` and ``down`` together leave the value as it is. Throughput: a step a
    clock.
    Reset: 0. Overflow: wraps; no block that is run makes it wrap. Error: none.
    Source: lecture, block diagrams of the linear interpolator (P3 = XT, P4 = YT) and of the
    circular one (P1 = XT, P2 = YT, seen from the centre in the first quadrant).

    Parameters
    ----------
    width : int
        n, 4 to 32.
    magnitude : bool
        The value is in steps; it is signed, n + 1 bits, or as a magnitude unsigned, n bits.
    name : str
        Name of the register in waveforms.

    Raises
    ------
    TypeError, ValueError
        ``width`` is not a whole number from 4 to 32.
    """

    def __init__(self, width: int, *, magnitude: bool = False, name: str = "position"):
        check_width(width)
        shape = unsigned(width) if magnitude else signed(width + 1)
        super().__init__({"load": In(1), "initial": In(shape), "up": In(1), "down": In(1)})
        self.register = Signal(shape, name=name)

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        with m.If(self.load):
            m.d.sync += self.register.eq(self.initial)
        with m.Elif(self.up != self.down):
            # 1 or −1 by one adder.
            ones = self.down.replicate(len(self.register) - 1)
            m.d.sync += self.register.eq(self.register + Cat(Const(1, 1), ones).as_signed())
        return m
