"""The angle meter: the angle that an arc sweeps, by shifts and additions."""

from math import atan, pi

from amaranth import Module, Mux, Signal
from amaranth.hdl import signed
from amaranth.lib.wiring import In, Out

from discreta.hdl.arc_input import TURNS_BITS
from discreta.hdl.contract import Part, check_width, per_axis

__all__ = ["ANGLE_INTEGER_BITS", "AngleMeter", "angle_bits", "turnings"]

#: Bits of an angle of 1028 right angles, in radians.
ANGLE_INTEGER_BITS = 11

#: Bits of fraction of the vector that is turned.
_GUARD = 8


def angle_bits(width: int) -> int:
    """Give the bits of fraction of an angle, in radians: n + 16."""
    return width + 16


def turnings(width: int) -> int:
    """Give how many turnings measure one angle: n + 6."""
    return width + 6


class AngleMeter(Part):
    """Measures an arc in radians: right angles crossed + angle of the end − angle of the start.

    Both points are seen from the centre in their own quadrant, turned onto the first. A vector (VX,
    VY) is turned onto the x axis by ever smaller angles arctan 2^−i, i = 0, 1, 2 …; each takes two
    shifts and three additions, and which way it goes the sign of VY says::

        VX := VX ± VY·2^−i;  VY := VY ∓ VX·2^−i;  angle := angle ± arctan 2^−i

    A clock with ``load_end`` takes the end and sets ``angle`` to ``turns`` right angles; then
    ``turn`` with ``index`` 0, 1 … adds the end's angle. A clock with ``load_start`` takes the
    start; then ``turn`` with ``subtract`` takes off its angle.

    Latency: n + 6 turnings for each point, one a clock, and a clock for each load. Throughput: the
    same. Reset: 0. Overflow: none. Error: below a quarter of a step along the arc (measured over
    all arcs of small widths, see tests); ``angle`` may then be a little below 0 for an arc that
    sweeps no angle.
    Source: J. E. Volder, "The CORDIC trigonometric computing technique", 1959.

    Parameters
    ----------
    width : int
        n, 4 to 32; points are magnitudes of n bits, in steps. The angle is signed, 12 bits and n +
        16 of fraction, in radians.

    Raises
    ------
    TypeError, ValueError
        ``width`` is not a whole number from 4 to 32.
    """

    def __init__(self, width: int):
        check_width(width)
        point = per_axis(2, width)
        super().__init__(
            {
                "start": In(point),
                "end": In(point),
                "turns": In(TURNS_BITS),
                "load_end": In(1),
                "load_start": In(1),
                "turn": In(1),
                "subtract": In(1),
                "index": In(range(turnings(width))),
                "positive": Out(ANGLE_INTEGER_BITS + angle_bits(width)),
            }
        )
        self.width = width
        self.vx = Signal(width + 2 + _GUARD)
        self.vy = Signal(signed(width + 2 + _GUARD))
        self.angle = Signal(signed(1 + ANGLE_INTEGER_BITS + angle_bits(width)))

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        vx, vy, angle = self.vx, self.vy, self.angle
        one = 1 << angle_bits(self.width)
        table = [round(atan(2.0**-i) * one) for i in range(turnings(self.width))]
        part = Signal(range(one))
        with m.Switch(self.index):
            for index, value in enumerate(table):
                with m.Case(index):
                    m.d.comb += part.eq(value)
        shifted_x, shifted_y = Signal.like(vx, name="shifted_x"), Signal.like(vy, name="shifted_y")
        m.d.comb += [
            shifted_x.eq(vx >> self.index),
            shifted_y.eq(vy >> self.index),
            self.positive.eq(Mux(angle < 0, 0, angle)),
        ]
        with m.If(self.load_end):
            m.d.sync += [
                vx.eq(self.end.x << _GUARD),
                vy.eq(self.end.y << _GUARD),
                angle.eq(self.turns * round(pi / 2 * one)),
            ]
        with m.Elif(self.load_start):
            m.d.sync += [vx.eq(self.start.x << _GUARD), vy.eq(self.start.y << _GUARD)]
        with m.Elif(self.turn):
            below = vy < 0
            m.d.sync += [
                vx.eq(Mux(below, vx - shifted_y, vx + shifted_y)),
                vy.eq(Mux(below, vy + shifted_x, vy - shifted_x)),
                angle.eq(Mux(below ^ self.subtract, angle - part, angle + part)),
            ]
        return m
