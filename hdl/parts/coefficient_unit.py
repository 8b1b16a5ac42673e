"""The coefficient unit: κ = 2(1 − cos Δφ) and sin Δφ, by series or from a table."""

from fractions import Fraction

from amaranth import Module, Mux, Signal
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part, check_choice, check_width

__all__ = ["COEFFICIENTS", "CoefficientUnit", "factor_bits"]

COEFFICIENTS = ("series", "table")

#: What divides Δφ² in the series of the cosine and of the sine, the innermost term first.
_COSINE, _SINE = (7 * 8, 5 * 6, 3 * 4), (6 * 7, 4 * 5, 2 * 3)

#: Entries of each table; more terms than tell in them.
_ENTRIES, _TERMS = 256, 12


def factor_bits(width: int) -> int:
    """Give the bits of Δφ, κ and sin Δφ, all of fraction: 3n + 8."""
    return 3 * width + 8


def _brought_in(divisors: tuple[int, ...], square: Fraction) -> Fraction:
    """Give what is multiplied by Δφ² and taken off 1, from the first divisors of a series."""
    term = Fraction(1)
    for divisor in divisors:
        term = 1 - square * term / divisor
    return (1 - term) / square


class CoefficientUnit(Part):
    r"""Works out κ = 2(1 − cos Δφ) and sin Δφ with one multiplier, bit by bit.

    With u = Δφ², by four terms of their series::

        κ = u·(1 − u/12·(1 − u/30·(1 − u/56)));  sin Δφ = Δφ·(1 − u/6·(1 − u/20·(1 − u/42)))

    or with what stands behind the first u from a table of 256 fractions of n + 8 bits, by the top 8
    bits of u below ¼::

        κ = u·(1 − u·h(u));  sin Δφ = Δφ·(1 − u·q(u))

    ``begin`` starts it with the Δφ of that clock, which must stay; ``busy`` from the next clock on.

    Latency: 15 products (series) or 5 (table) of 3n + 10 clocks each. Throughput: the same. Reset:
    0, not busy. Overflow: none for Δφ < ½.
    Error: for Δφ < ½ κ is off by less than 2^−28 and sin Δφ by less than 2^−26 of itself by the
    terms left out of the series, and both by less than 2^−18 by the table's steps and 2^−(n + 11)
    by its entries' rounding; besides some units of their last place, 2^−(3n + 8).
    Source: Ukrainian lecture (the cosine of the angle is computed by its series while the
    interpolation is prepared, or taken from a table).

    Parameters
    ----------
    width : int
        n, 4 to 32. Δφ, κ and sin Δφ are unsigned fractions of 3n + 8 bits; Δφ in radians.
    coefficient : str
        ``"series"`` or ``"table"``.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """

    def __init__(self, width: int, *, coefficient: str = "series"):
        check_width(width)
        check_choice("coefficient", coefficient, COEFFICIENTS)
        bits = factor_bits(width)
        super().__init__({"begin": In(1), "angle": In(bits), "busy": Out(1)})
        self.bits = bits
        self.entry_bits = width + 8
        self.coefficient = coefficient
        self.square, self.scaled, self.term, self.kappa, self.sine, self.product = (
            Signal(bits, name=name)
            for name in ("square", "scaled", "term", "kappa", "sine", "product")
        )
        self.multiplier = Signal(bits)
        #: What is multiplied, what it is multiplied by, and where the product goes.
        self.program = self._program()
        self.order = Signal(range(len(self.program) + 1))
        self.digit = Signal(range(bits + 2), name="place")
        self.registers = [
            *(self.square, *([self.scaled] if coefficient == "series" else []), self.term),
            *(self.kappa, self.sine, self.product, self.multiplier, self.order, self.digit),
        ]

    def _program(self):
        one = 1 << self.bits
        program = [(self.angle, self.angle, self.square)]
        for divisors, last, to in (
            (_COSINE, self.square, self.kappa),
            (_SINE, self.angle, self.sine),
        ):
            if self.coefficient == "series":
                for divisor in divisors:
                    program.append((self.square, self.term, self.scaled))
                    program.append((self.scaled, one // divisor, self.term))
            else:
                program.append((self.square, self._table(divisors), self.term))
            program.append((last, self.term, to))
        return program

    def _table(self, divisors: tuple[int, ...]) -> list[int]:
        """Give a table's entries, worked out for the middle of what each stands for."""
        first = divisors[-1] == _SINE[-1]
        longer = tuple((2 * k + 1 - first) * (2 * k + 2 - first) for k in range(_TERMS, 0, -1))
        unit = 1 << self.entry_bits
        return [
            round(_brought_in(longer, Fraction(2 * index + 1, 8 * _ENTRIES)) * unit)
            << (self.bits - self.entry_bits)
            for index in range(_ENTRIES)
        ]

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        order, digit, product, multiplier = self.order, self.digit, self.product, self.multiplier
        multiplicand = Signal(self.bits)
        index = self.square[-2 - 8 : -2]
        m.d.comb += self.busy.eq(order != 0)
        with m.If(self.begin):
            m.d.sync += [order.eq(1), digit.eq(self.bits + 1), self.term.eq(~0)]
        with m.Elif(self.busy):
            m.d.sync += digit.eq(digit - 1)
            with m.If(digit == self.bits + 1):
                m.d.sync += product.eq(0)
            with m.Elif(digit != 0):
                m.d.sync += [
                    product.eq((product + Mux(multiplier[0], multiplicand, 0)) >> 1),
                    multiplier.eq(multiplier >> 1),
                ]
            with m.Else():
                m.d.sync += [
                    digit.eq(self.bits + 1),
                    order.eq(Mux(order == len(self.program), 0, order + 1)),
                ]
            with m.Switch(order):
                for number, (factor, by, to) in enumerate(self.program, start=1):
                    with m.Case(number):
                        m.d.comb += multiplicand.eq(factor)
                        with m.If(digit == self.bits + 1):
                            if isinstance(by, list):
                                with m.Switch(index):
                                    for entry, value in enumerate(by):
                                        with m.Case(entry):
                                            m.d.sync += multiplier.eq(value)
                            else:
                                m.d.sync += multiplier.eq(by)
                        with m.If(digit == 0):
                            m.d.sync += to.eq(~product if to is self.term else product)
                            if to is self.kappa:
                                m.d.sync += self.term.eq(~0)
        return m
