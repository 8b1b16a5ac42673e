"""The divider: a quotient bit by bit, as on paper."""

from amaranth import Cat, Module, Signal
from amaranth.lib.wiring import In

from discreta.hdl.contract import Part

__all__ = ["Divider"]


class Divider(Part):
    """Divides, one bit of the quotient a clock, without a multiplier.

    A clock with ``load`` takes the dividend into ``quotient`` and clears ``rest``. Then in every
    clock with ``divide`` the top bit of ``quotient`` goes over into ``rest``; when the divisor can
    be taken from that it is, and 1 enters ``quotient`` at the bottom, else 0. After as many clocks
    as the dividend has bits ``quotient`` is ⌊dividend / divisor⌋ and ``rest`` what remains.

    Latency: one clock for ``load`` and one a bit. Throughput: the same. ``load`` goes before
    ``divide``. Reset: 0. Overflow: none; with a divisor of 0 the quotient is all ones. Error: the
    quotient is rounded down.
    Source: none, it is ours; the Ukrainian lecture only asks for mean increments "computed with
    high precision".

    Parameters
    ----------
    dividend_bits, divisor_bits : int
        Bits of the dividend, which are those of the quotient, and of the divisor; unsigned.
    name : str
        Suffix of the registers' names in waveforms.
    """

    def __init__(self, dividend_bits: int, divisor_bits: int, *, name: str = ""):
        super().__init__(
            {
                "load": In(1),
                "dividend": In(dividend_bits),
                "divisor": In(divisor_bits),
                "divide": In(1),
            }
        )
        self.quotient = Signal(dividend_bits, name=f"quotient{name}")
        self.rest = Signal(divisor_bits, name=f"rest{name}")

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        quotient, rest, divisor = self.quotient, self.rest, self.divisor
        brought = Signal(len(rest) + 1)
        fits = Signal()
        m.d.comb += [brought.eq(Cat(quotient[-1], rest)), fits.eq(brought >= divisor)]
        with m.If(self.load):
            m.d.sync += [quotient.eq(self.dividend), rest.eq(0)]
        with m.Elif(self.divide):
            m.d.sync += quotient.eq(Cat(fits, quotient))
            with m.If(fits):
                m.d.sync += rest.eq(brought - divisor)
            with m.Else():
                m.d.sync += rest.eq(brought)
        return m
