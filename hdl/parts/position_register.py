"""The position register (P3, P4)."""

from amaranth import Module, Signal
from amaranth.hdl import signed
from amaranth.lib.wiring import In

from discreta.hdl.contract import Part, check_width

__all__ = ["PositionRegister"]


class PositionRegister(Part):
    """The coordinate of an axis now: an up/down counter.

    Latency: ``register`` follows ``load``, ``up`` or ``down`` at the clock's edge. ``load`` goes
    before counting; ``up`` and ``down`` together leave the value as it is. Throughput: a step a
    clock.
    Reset: 0. Overflow: wraps; a block whose start and end are in range never makes it wrap, since
    every point between lies between them. Error: none.
    Source: lecture, block diagram of the linear interpolator (P3 = XT, P4 = YT).

    Parameters
    ----------
    width : int
        n, 4 to 32; the value is signed, n + 1 bits, in steps.
    name : str
        Name of the register in waveforms.

    Raises
    ------
    TypeError, ValueError
        ``width`` is not a whole number from 4 to 32.
    """

    def __init__(self, width: int, *, name: str = "position"):
        check_width(width)
        shape = signed(width + 1)
        super().__init__({"load": In(1), "initial": In(shape), "up": In(1), "down": In(1)})
        self.register = Signal(shape, name=name)

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        with m.If(self.load):
            m.d.sync += self.register.eq(self.initial)
        with m.Elif(self.up & ~self.down):
            m.d.sync += self.register.eq(self.register + 1)
        with m.Elif(self.down & ~self.up):
            m.d.sync += self.register.eq(self.register - 1)
        return m
