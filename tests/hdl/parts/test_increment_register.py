import numpy as np
import pytest

from discreta.hdl.parts import IncrementRegister
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run


@pytest.mark.parametrize("width", [4, 8, 32])
def test_keeps_what_was_loaded_last(width):
    part = IncrementRegister(width, name="p1")
    rng = np.random.default_rng(width)
    limits = [2**width - 1, 0, 2 ** (width - 1)]

    async def bench(ctx):
        value = 0
        for clock in range(200):
            assert ctx.get(part.register) == value  # in clock 0: after reset
            load = clock < len(limits) or rng.random() < 0.3
            initial = limits[clock] if clock < len(limits) else int(rng.integers(2**width))
            ctx.set(part.load, load)
            ctx.set(part.initial, initial)
            assert ctx.get(part.register) == value  # the load shows only one clock later
            await ctx.tick()
            value = initial if load else value

    run(part, bench)
    assert part.register.name == "p1"


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), IncrementRegister, width)
