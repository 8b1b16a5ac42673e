"""The remaining-count counter (P5, P6; KOX, KOY)."""

from amaranth import Module, Signal
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part, check_width

__all__ = ["RemainingCounter"]


class RemainingCounter(Part):
    """Counts down the steps left on an axis.

    ``zero`` is 1 when no steps are left. ``ending`` is 1 when none are left after this clock: the
    value is 0, or it is 1 and ``count`` is given.

    Latency: ``register`` follows ``load`` or ``count`` at the clock's edge; ``zero`` depends on the
    register alone, ``ending`` on the register and ``count``. ``load`` goes before ``count``.
    Throughput: a count a clock. Reset: 0. Error: none.
    Overflow: none; a ``count`` at 0 is ignored.
    Source: lecture, block diagram of the linear interpolator (P5 = KOX, P6 = KOY).

    Parameters
    ----------
    width : int
        n, 4 to 32 bits; the value is 0 to 2^n − 1 steps.
    name : str
        Name of the register in waveforms.

    Raises
    ------
    TypeError, ValueError
        ``width`` is not a whole number from 4 to 32.
    """

    def __init__(self, width: int, *, name: str = "remaining"):
        check_width(width)
        super().__init__(
            {
                "load": In(1),
                "initial": In(width),
                "count": In(1),
                "zero": Out(1),
                "ending": Out(1),
            }
        )
        self.register = Signal(width, name=name)

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        m.d.comb += [
            self.zero.eq(self.register == 0),
            self.ending.eq(self.zero | (self.count & (self.register == 1))),
        ]
        with m.If(self.load):
            m.d.sync += self.register.eq(self.initial)
        with m.Elif(self.count & ~self.zero):
            m.d.sync += self.register.eq(self.register - 1)
        return m
