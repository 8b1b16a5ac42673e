"""What the constant-carrier methods have in common: their blocks, their output, their timer."""

from amaranth import Module, Mux, Signal
from amaranth.hdl import signed
from amaranth.lib import data
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part, check_width, per_axis, point_layout

__all__ = [
    "PERIOD_BITS",
    "CarrierOutput",
    "increment_layout",
    "periods_bits",
    "timed_layout",
]

#: Bits of the carrier period, in clocks.
PERIOD_BITS = 24


def periods_bits(width: int) -> int:
    """Give the bits of the number of carrier periods of a block: n + 8."""
    return width + 8


def timed_layout(block: data.StructLayout, width: int) -> data.StructLayout:
    """Lay out a block with its timing: ``periods`` N, and ``period`` T in clocks."""
    fields = {name: field.shape for name, field in block}
    return data.StructLayout({**fields, "periods": periods_bits(width), "period": PERIOD_BITS})


def increment_layout(width: int) -> data.StructLayout:
    """Lay out the steps of one carrier period: signed, n + 2 bits; ``last`` with the last ones."""
    return data.StructLayout({"x": signed(width + 2), "y": signed(width + 2), "last": 1})


class CarrierOutput(Part):
    """Puts out the increments of a period when the carrier says so, and keeps the position.

    ``due`` is 1 when the carrier period that the increments before have opened is over. In a clock
    with ``put`` the increments ``x`` and ``y`` are taken over and the next period of ``period``
    clocks begins. They then wait, shown in ``out_x``, ``out_y``, until ``taken``; as long as they
    wait and are not taken the carrier stands still. ``reached`` is the position after what waits.

    Latency: increments wait from the clock after ``put``; the position follows ``taken`` at the
    clock's edge. Throughput: increments every ``period`` clocks, at least 1. Reset: everything 0,
    due at once. Overflow: the position wraps; no block that is run makes it wrap. Error: none.
    Source: Ukrainian lecture (control signals are put out in every cycle of the constant carrier).

    Parameters
    ----------
    width : int
        n, 4 to 32: the position is signed, n + 1 bits, increments are signed, n + 2 bits; in steps.

    Raises
    ------
    TypeError, ValueError
        ``width`` is not a whole number from 4 to 32.
    """

    def __init__(self, width: int):
        check_width(width)
        point, increment = point_layout(width, 2), per_axis(2, signed(width + 2))
        super().__init__(
            {
                "load": In(1),
                "start": In(point),
                "put": In(1),
                "increment": In(increment),
                "period": In(PERIOD_BITS),
                "taken": In(1),
                "due": Out(1),
                "waiting": Out(1),
                "reached": Out(per_axis(2, signed(width + 3))),
            }
        )
        self.timer = Signal(PERIOD_BITS)
        self.waiting_register = Signal(name="waiting")
        self.out = {a: Signal(signed(width + 2), name=f"out_{a}") for a in "xy"}
        self.place = {
            a: Signal(signed(width + 1), name=name) for a, name in (("x", "p3"), ("y", "p4"))
        }

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        waiting, timer = self.waiting_register, self.timer
        m.d.comb += [self.waiting.eq(waiting), self.due.eq(timer == 0)]
        with m.If(self.put):
            m.d.sync += [waiting.eq(1), timer.eq(self.period - 1)]
        with m.Elif(~waiting | self.taken):
            m.d.sync += [waiting.eq(0), timer.eq(Mux(self.due, 0, timer - 1))]
        for a in "xy":
            out, place = self.out[a], self.place[a]
            m.d.comb += self.reached[a].eq(place + Mux(waiting, out, 0))
            with m.If(self.put):
                m.d.sync += out.eq(self.increment[a])
            with m.If(self.load):
                m.d.sync += place.eq(self.start[a])
            with m.Elif(self.taken):
                m.d.sync += place.eq(self.reached[a])
        return m
