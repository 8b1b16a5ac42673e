"""The increment register (P1, P2)."""

from amaranth import Module, Signal
from amaranth.lib.wiring import In

from discreta.hdl.contract import Part, check_width

__all__ = ["IncrementRegister"]


class IncrementRegister(Part):
    """Keeps the increment that the summator adds at every summation.

    Latency: ``register`` shows ``initial`` one clock after ``load``. Throughput: a load a clock.
    Reset: 0. Overflow: none, the value is only kept. Error: none.
    Source: lecture, block diagram of the linear interpolator (P1 = ΔX, P2 = ΔY).

    Parameters
    ----------
    width : int
        n, 4 to 32 bits; the value is 0 to 2^n − 1, in steps times the scale of the normalizer.
    name : str
        Name of the register in waveforms.

    Raises
    ------
    TypeError, ValueError
        ``width`` is not a whole number from 4 to 32.
    """

    def __init__(self, width: int, *, name: str = "increment"):
        check_width(width)
        super().__init__({"load": In(1), "initial": In(width)})
        self.register = Signal(width, name=name)

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        with m.If(self.load):
            m.d.sync += self.register.eq(self.initial)
        return m
