"""The radius meter: is the end of an arc on the circle of its start?"""

from amaranth import Cat, Module, Signal
from amaranth.hdl import signed
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part, check_width, per_axis

__all__ = ["RadiusMeter"]


class RadiusMeter(Part):
    """Works out, bit by bit and without a multiplier, the radius of an arc and how far off its end.

    With S = XH² + YH² and E = XK² + YK², it keeps ``root`` = ⌊2·√S⌋ = ⌊2R⌋ and ``difference`` = E −
    S. The end is ``near``, off the circle by at most one step, when \\|√E − √S\\| ≤ 1; for R ≥ 1
    that is (√S − 1)² ≤ E ≤ (√S + 1)², or 1 − ⌊2R⌋ ≤ E − S ≤ 1 + ⌊2R⌋, as E − S is whole.

    Both squares grow from the top bits: the coordinates turn to the left in their registers,
    ``mask`` covers the bits p that have come round, and when the next bit is b the square of 2p + b
    is 4·p² + b·(4p + 1). The root is drawn from 4·S two bits at a time, as on paper.

    Latency: after ``load`` n clocks for the squares, 1 for the difference, n + 2 for the root; in
    the clock after them, 2n + 4 clocks after the load, ``measured`` is 1 and all outputs are valid
    until the next load. Throughput: a measurement in 2n + 4 clocks. ``busy`` from the clock after
    the load until ``measured``, it included. Reset: everything 0, not busy.
    Overflow: none, S < 2^(2n + 1). Error: none, it is exact.
    Source: none, it is ours; the rule that the end is on the circle is the lecture's equation x² +
    y² = R².

    Parameters
    ----------
    width : int
        n, 4 to 32; coordinates are magnitudes seen from the centre, n bits, in steps.

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
                "load": In(1),
                "initial_start": In(point),
                "initial_end": In(point),
                "start": Out(point),
                "end": Out(point),
                "root": Out(width + 2),
                "zero": Out(1),
                "near": Out(1),
                "squared": Out(1),
                "measured": Out(1),
                "busy": Out(1),
            }
        )
        self.width = width
        self.tick = Signal(range(2 * width + 5), name="tick")
        self.mask = Signal(width, name="mask")
        self.start_registers = {a: Signal(width, name=f"from_{a}") for a in "xy"}
        self.end_registers = {a: Signal(width, name=f"to_{a}") for a in "xy"}
        self.start_square = Signal(2 * width + 2, name="start_square")
        self.end_square = Signal(signed(2 * width + 2), name="end_square")
        self.rest = Signal(width + 3, name="rest")
        self.root_register = Signal(width + 2, name="root")

    def elaborate(self, platform):
        """Describe the hardware."""
        n = self.width
        m = Module()
        tick, root, rest = self.tick, self.root_register, self.rest
        difference = self.end_square
        m.d.comb += [
            self.root.eq(root),
            self.zero.eq((root == 0) & (difference == 0)),
            # A root of 0 is that of a start in the centre, to which no other point is near.
            self.near.eq((difference + root >= 1) & (difference - 1 <= root) & (root != 0)),
            self.squared.eq(tick == n + 1),
            self.measured.eq(tick == 2 * n + 4),
            self.busy.eq(tick != 0),
        ]
        squaring, drawing = Signal(name="squaring"), Signal(name="drawing")
        m.d.comb += [
            squaring.eq((tick != 0) & (tick <= n)),
            drawing.eq((tick >= n + 2) & (tick <= 2 * n + 3)),
        ]
        with m.If(self.load):
            m.d.sync += tick.eq(1)
        with m.Elif(self.measured):
            m.d.sync += tick.eq(0)
        with m.Elif(self.busy):
            m.d.sync += tick.eq(tick + 1)

        grown = {}
        for which, square, registers, outs, initials in (
            ("start", self.start_square, self.start_registers, self.start, self.initial_start),
            ("end", self.end_square, self.end_registers, self.end, self.initial_end),
        ):
            total = square << 2
            for a, register in registers.items():
                term = Signal(n + 2, name=f"{which}_term_{a}")
                m.d.comb += outs[a].eq(register)
                with m.If(register[-1]):
                    m.d.comb += term.eq(Cat(1, 0, register & self.mask))
                total = total + term
                with m.If(self.load):
                    m.d.sync += register.eq(initials[a])
                with m.Elif(squaring):
                    m.d.sync += register.eq(register.rotate_left(1))
            grown[which] = total

        trial = Signal(n + 4)
        brought = Signal(n + 5)
        m.d.comb += [trial.eq(Cat(1, 0, root)), brought.eq(Cat(self.start_square[-2:], rest))]
        with m.If(self.load):
            m.d.sync += [
                self.mask.eq(0),
                self.start_square.eq(0),
                difference.eq(0),
                root.eq(0),
                rest.eq(0),
            ]
        with m.Elif(squaring):
            m.d.sync += [
                self.mask.eq(Cat(1, self.mask)),
                self.start_square.eq(grown["start"]),
                self.end_square.eq(grown["end"]),
            ]
        with m.Elif(self.squared):
            m.d.sync += difference.eq(self.end_square - self.start_square)
        with m.Elif(drawing):
            m.d.sync += self.start_square.eq(self.start_square << 2)
            with m.If(brought >= trial):
                m.d.sync += [rest.eq(brought - trial), root.eq(Cat(1, root))]
            with m.Else():
                m.d.sync += [rest.eq(brought), root.eq(Cat(0, root))]
        return m
