import numpy as np
import pytest
from amaranth import Cat, Module
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part
from discreta.hdl.harness import Harness, LoneAccumulator
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run


class Twice(Part):
    """Puts its input out a clock later, twice: what could be shared, and what could cancel out."""

    def __init__(self):
        super().__init__({"a": In(3), "b": Out(3), "c": Out(3)})
        self.registers = {"b": self.b}

    def elaborate(self, _):
        m = Module()
        m.d.sync += self.b.eq(self.a)
        m.d.comb += self.c.eq(self.b)
        return m


def put_out(bits, dropped=None):
    """Give what the harness of a Twice puts out; an output bit may be dropped."""
    fed, b, caught, folded = [0] * 4, [0] * 3, [0] * 6, [0] * 6
    out = []
    for bit in bits:
        out.append(folded[-1])
        folded = [now ^ before for now, before in zip(caught, [0, *folded], strict=False)]
        caught = [b[k % 3] if k != dropped else 0 for k in range(6)]
        b = [0] * 3 if fed[0] else fed[1:]
        fed = [1 - value for value in [bit, *fed[:-1]]]
    return out


def test_every_bit_of_the_core_reaches_the_pin():
    bits = np.random.default_rng(1).integers(0, 2, 200).tolist()
    harness = Harness(Twice())
    assert harness.inputs == ["rst", "a[0]", "a[1]", "a[2]"]
    assert harness.outputs == ["b[0]", "b[1]", "b[2]", "c[0]", "c[1]", "c[2]"]
    seen = []

    async def bench(ctx):
        for bit in bits:
            ctx.set(harness.d, bit)
            seen.append(ctx.get(harness.q))
            await ctx.tick()

    run(harness, bench)
    assert seen == put_out(bits)
    for dropped in range(6):
        assert seen != put_out(bits, dropped)


def test_the_lone_accumulator():
    numbers = np.random.default_rng(2).integers(0, 16, 100).tolist()
    part = LoneAccumulator(4)

    async def bench(ctx):
        total = 0
        for number in numbers:
            ctx.set(part.addend, number)
            await ctx.tick()
            total = total % 16 + number
            assert ctx.get(Cat(part.acc, part.carry)) == total

    run(part, bench)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_widths_there_are_not(width, error, message):
    assert_refused((error, message), LoneAccumulator, width)
