"""The summator (SX, SY): its carry is a step."""

from amaranth import Cat, Module, Signal
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part, check_choice, check_guard, check_width

__all__ = ["PRELOADS", "Summator"]

PRELOADS = ("zero", "half")


class Summator(Part):
    """An accumulator of n + g bits that puts out its carry.

    With M = 2^(n + g), a clock with ``enable`` computes S := (S + ``addend``) mod M, and ``carry``
    is 1 in that same clock when S + ``addend`` ≥ M. The addend has n bits: every guard bit halves
    the share of a step that a summation adds.

    Latency: ``carry`` is combinational in ``addend`` and ``enable``; S follows at the clock's edge.
    Throughput: one summation a clock.
    Overflow: the carry; with ``addend`` < M there is never more than one.
    Reset: S is the preload, 0 or M/2. ``load``: S becomes ``initial``; it goes before ``enable``.
    Error: S/M is the fraction of a step not put out yet, so with preload 0 a coordinate lags its
    line by less than one step, with preload M/2 it is off by at most half a step either way.
    Source: lecture, linear interpolation, steps 3 and 8–10 (preload 0); preload M/2 and the
    guard bits are ours.

    Parameters
    ----------
    width : int
        n, 4 to 32 bits.
    guard : int
        g, 0 to 4 bits.
    preload : str
        ``"zero"`` or ``"half"``.
    name : str
        Name of the register in waveforms.

    Attributes
    ----------
    preloaded : int
        The preload as a number, to load it again.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """

    def __init__(self, width: int, *, guard: int = 0, preload: str = "zero", name: str = "s"):
        check_width(width)
        check_guard(guard)
        check_choice("preload", preload, PRELOADS)
        super().__init__(
            {
                "load": In(1),
                "initial": In(width + guard),
                "enable": In(1),
                "addend": In(width),
                "carry": Out(1),
            }
        )
        bits = width + guard
        self.preloaded = 1 << (bits - 1) if preload == "half" else 0
        self.register = Signal(bits, init=self.preloaded, name=name)

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        total = Signal.like(self.register, name="total")
        overflow = Signal()
        m.d.comb += [
            Cat(total, overflow).eq(self.register + self.addend),
            self.carry.eq(self.enable & overflow),
        ]
        with m.If(self.load):
            m.d.sync += self.register.eq(self.initial)
        with m.Elif(self.enable):
            m.d.sync += self.register.eq(total)
        return m
