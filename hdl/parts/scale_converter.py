"""The scale converter (мащабен преобразувател): a derivative of the curve, P·x + Q·y + R."""

from amaranth import Module, Mux, Signal
from amaranth.hdl import signed
from amaranth.lib.wiring import In

from discreta.hdl.contract import Part, check_width
from discreta.hdl.parts.step_adder import times

__all__ = ["ScaleConverter", "coefficient_bits", "derivative_bits", "linear_bits"]


def coefficient_bits(width: int) -> int:
    """Give the bits of A, B and C, signed: n + 4."""
    return width + 4


def linear_bits(width: int) -> int:
    """Give the bits of D and E, signed: 2n + 5."""
    return 2 * width + 5


def derivative_bits(width: int) -> int:
    """Give the bits of a derivative, signed: 2n + 7.

    With coordinates of n + 1 bits \\|2A·x\\| ≤ 2^(2n + 4), \\|B·y\\| ≤ 2^(2n + 3) and \\|D\\| ≤
    2^(2n + 4), together at most 2.5·2^(2n + 4) < 2^(2n + 6): no block makes it wrap.
    """
    return 2 * width + 7


class ScaleConverter(Part):
    """Keeps G = P·x + Q·y + R for the point (x, y), in both shapes that it can have.

    - Multiplying, as in the lecture, but bit by bit: after ``clear``, every clock with ``multiply``
      takes one bit of x and one of y, the top ones first, and makes G := 2·G + P·(bit of x) +
      Q·(bit of y); the very first bit is the sign's and counts down (``sign``). After n + 1 such
      clocks G is P·x + Q·y, and a clock with ``add`` makes it P·x + Q·y + R.
    - Incremental: a clock with ``move`` makes G := G + P·(step of x) + Q·(step of y), with steps of
      −1, 0 or +1. That is all that the loop needs, and there is no multiplier in it.

    The two shapes give the same: this is proven, see docs/conic.md.

    Latency: ``register`` follows at the clock's edge; n + 2 clocks from ``clear`` to G. Throughput:
    a step a clock. Of ``clear``, ``multiply``, ``add`` and ``move`` given together the first is
    done and the others are not. Reset: 0.
    Overflow: wraps; G has 2n + 7 bits, so that no point and no coefficients make it wrap. Error:
    none.
    Source: lecture, block diagram of the general interpolator (scale converters as multipliers for
    A, B, C, D, E); the incremental shape is ours.

    Parameters
    ----------
    width : int
        n, 4 to 32: coordinates are signed, n + 1 bits. P and Q (2A and B, or B and 2C) are signed,
        n + 5 bits, R (D or E) is signed, 2n + 5 bits.
    name : str
        Name of the register in waveforms.

    Raises
    ------
    TypeError, ValueError
        ``width`` is not a whole number from 4 to 32.
    """

    def __init__(self, width: int, *, name: str = "g"):
        check_width(width)
        scale = signed(coefficient_bits(width) + 1)
        super().__init__(
            {
                "x_scale": In(scale),
                "y_scale": In(scale),
                "rest": In(signed(linear_bits(width))),
                "clear": In(1),
                "multiply": In(1),
                "sign": In(1),
                "x_bit": In(1),
                "y_bit": In(1),
                "add": In(1),
                "move": In(1),
                "x_step": In(signed(2)),
                "y_step": In(signed(2)),
            }
        )
        self.register = Signal(signed(derivative_bits(width)), name=name)

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        g = self.register
        digit = Mux(self.x_bit, self.x_scale, 0) + Mux(self.y_bit, self.y_scale, 0)
        with m.If(self.clear):
            m.d.sync += g.eq(0)
        with m.Elif(self.multiply):
            m.d.sync += g.eq((g << 1) + Mux(self.sign, -digit, digit))
        with m.Elif(self.add):
            m.d.sync += g.eq(g + self.rest)
        with m.Elif(self.move):
            m.d.sync += g.eq(
                g + times(self.x_step, self.x_scale) + times(self.y_step, self.y_scale)
            )
        return m
