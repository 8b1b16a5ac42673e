"""The normalizer: increments doubled together for speed."""

from functools import reduce
from operator import or_

from amaranth import Const, Module, Shape, Signal
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part, check_axes, check_width, per_axis

__all__ = ["Normalizer"]


class Normalizer(Part):
    """Shifts the increments of all axes left together until one of them has its top bit set.

    ``normalized`` = ``increments`` · 2^s with the same s for every axis, the greatest for which
    nothing is lost, at most n − 1. The ratios stay what they were, and at least every second
    summation of the longest axis carries. All zero stays all zero.

    Built of ⌈log2 n⌉ stages; the stage of 2^k shifts by 2^k places when the top 2^k bits of every
    axis are zero.

    ``places`` is s (all ones when the increments are all zero). ``limit``, if it is driven, is the
    most that s may be.

    With ``signed`` the increments are numbers with a sign, the stages look at the bits that repeat
    the sign, and the top bit in question is the one below it.

    Latency: none, it is combinational. Throughput: a set of increments a clock. No registers, so no
    reset. Overflow: none. Error: none, no bit is lost.
    Source: lecture, the constant k ("ΔX and ΔY are multiplied by 2 at the same time until …").

    Parameters
    ----------
    width : int
        n, 4 to 32 bits.
    axes : int
        2 to 6.
    signed : bool
        The increments have a sign; then ``width`` may be up to 72.

    Raises
    ------
    TypeError, ValueError
        A parameter is out of range.
    """

    def __init__(self, width: int, axes: int, *, signed: bool = False):
        if not signed:
            check_width(width)
        check_axes(axes)
        layout = per_axis(axes, Shape(width, signed))
        stages = (width - 1).bit_length()
        super().__init__(
            {
                "increments": In(layout),
                "limit": In(stages, init=(1 << stages) - 1),
                "normalized": Out(layout),
                "places": Out(stages),
            }
        )
        self.width = width
        self.axes = axes
        self.signed = signed

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        letters = list(per_axis(self.axes, self.width).members)
        values = {letter: self.increments[letter] for letter in letters}
        # As long as the places so far are those of the limit it decides on the next stage too.
        tight = Const(1, 1)
        for k in reversed(range(len(self.places))):
            places = 1 << k
            shape = Shape(self.width, self.signed)
            stage = {letter: Signal(shape, name=f"{letter}_{places}") for letter in letters}
            free = Signal(name=f"free_{places}")
            if self.signed:
                # Among the bits that would go and the new sign, one that differs from the next.
                tops = (
                    (values[a] ^ (values[a] << 1))[self.width - places : self.width]
                    for a in letters
                )
            else:
                tops = (values[letter][self.width - places :] for letter in letters)
            m.d.comb += [
                free.eq((reduce(or_, tops) == 0) & (~tight | self.limit[k])),
                self.places[k].eq(free),
            ]
            tight &= free == self.limit[k]
            for letter in letters:
                with m.If(free):
                    m.d.comb += stage[letter].eq(values[letter] << places)
                with m.Else():
                    m.d.comb += stage[letter].eq(values[letter])
            values = stage
        m.d.comb += [self.normalized[letter].eq(values[letter]) for letter in letters]
        return m
