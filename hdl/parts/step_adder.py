"""The adder of a summator with carry and borrow: what it carries or borrows is a step."""

from amaranth import Cat, Const, Module, Mux, Signal
from amaranth.hdl import Value, signed
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part

__all__ = ["StepAdder", "times"]


def times(step: Value, value: Value) -> Value:
    """Multiply a value by a step, −1, 0 or +1."""
    return Mux(step[0], Mux(step[1], -value, value), 0)


class StepAdder(Part):
    """Adds a velocity to a sum and takes a step out of it when it leaves 0 … M − 1.

    With M = 2^b: total = ``sum`` + ``velocity`` + ``change``; with ``enable`` the ``step`` is +1
    where ``down`` is 0 and total ≥ M, −1 where ``down`` is 1 and total < 0, and otherwise 0. Then
    ``rest`` = total − step·(M − ``own``): ``own`` is what a step of +1 changes in the velocity that
    was added. The sum never steps against ``down``; it may then lie outside 0 … M − 1.

    Latency: none, it is combinational; the sum's register lies outside, since two axes share two
    such adders in an order that changes. Throughput: a summation a clock. Reset: no registers.
    Overflow: ``rest`` has b + 2 bits, −2M … 2M − 1, and stays at the limit it would go beyond.
    Error: none but that.
    Source: lecture, block diagram of the general interpolator (SX and SY with carry and borrow);
    ``change``, ``own`` and the limits are ours.

    Parameters
    ----------
    velocity_bits : int
        Bits of ``velocity``, ``change`` and ``own``, all signed.
    modulus_bits : int
        b, at least ``velocity_bits`` − 2: ``sum`` and ``rest`` are signed, b + 2 bits.

    Attributes
    ----------
    total, carried, unlimited : Signal
        What is compared with 0 and M, what a step takes off it, and their difference.

    Raises
    ------
    ValueError
        ``modulus_bits`` is too small: one summation could be worth many steps.
    """

    def __init__(self, velocity_bits: int, modulus_bits: int):
        if modulus_bits < velocity_bits - 2:
            raise ValueError(
                f"modulus has {modulus_bits} bits: velocities of {velocity_bits} bits need at "
                f"least {velocity_bits - 2}"
            )
        velocity, total = signed(velocity_bits), signed(modulus_bits + 2)
        super().__init__(
            {
                "sum": In(total),
                "velocity": In(velocity),
                "change": In(velocity),
                "own": In(velocity),
                "enable": In(1),
                "down": In(1),
                "step": Out(signed(2)),
                "rest": Out(total),
            }
        )
        self.modulus = 1 << modulus_bits
        self.total = Signal(signed(modulus_bits + 4))
        self.carried = Signal(signed(modulus_bits + 3))
        self.unlimited = Signal(signed(modulus_bits + 4))

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        total, carried, rest = self.total, self.carried, self.unlimited
        hit = Signal()
        m.d.comb += [
            total.eq(self.sum + self.velocity + self.change),
            hit.eq(self.enable & Mux(self.down, total < 0, total >= self.modulus)),
            self.step.eq(Cat(hit, hit & self.down)),
            carried.eq(times(self.step, Const(self.modulus) - self.own)),
            rest.eq(total - carried),
            self.rest.eq(rest),
        ]
        with m.If(rest >= 2 * self.modulus):
            m.d.comb += self.rest.eq(2 * self.modulus - 1)
        with m.Elif(rest < -2 * self.modulus):
            m.d.comb += self.rest.eq(-2 * self.modulus)
        return m
