from itertools import product

import numpy as np
import pytest

from discreta.hdl.parts.step_adder import StepAdder
from tests.hdl.parts.clocked import assert_refused, run


def added(modulus, given):
    """Give step and rest in whole numbers of any size, and whether the rest met a limit."""
    start, velocity, change, own, enable, down = given
    total = start + velocity + change
    if not enable or 0 <= total < modulus or (total < 0) != bool(down):
        step = 0
    else:
        step = -1 if down else 1
    rest = total - step * (modulus - own)
    limited = sorted((-2 * modulus, rest, 2 * modulus - 1))[1]
    return step, limited, (rest > limited) - (rest < limited)


def assert_adds(velocity_bits, modulus_bits, rows):
    """Compare rows of inputs with whole numbers; each kind of end must be among them."""
    part = StepAdder(velocity_bits, modulus_bits)
    inputs = (part.sum, part.velocity, part.change, part.own, part.enable, part.down)
    met = set()

    async def bench(ctx):
        for row in rows:
            for port, value in zip(inputs, row, strict=True):
                ctx.set(port, value)
            step, rest, limit = added(2**modulus_bits, row)
            assert (ctx.get(part.step), ctx.get(part.rest)) == (step, rest), row
            met.add((step, limit))

    run(part, bench)
    if velocity_bits < modulus_bits:
        # One summation is less than a step, and only a sum that may not step comes to a limit.
        assert met == {(-1, 0), (0, -1), (0, 0), (0, 1), (1, 0)}
    else:
        # M − M − 2M is the least that is left by a carry: the limit itself.
        assert met == {*product((-1, 0, 1), repeat=2)} - {(1, -1)}


def every(bits):
    return range(-(2 ** (bits - 1)), 2 ** (bits - 1))


def test_every_number_of_two_bits_and_of_three():
    assert_adds(2, 0, product(*[every(2)] * 4, (0, 1), (0, 1)))
    assert_adds(3, 1, product(*[every(3)] * 3, (-4, -1, 0, 3), (0, 1), (0, 1)))


@pytest.mark.parametrize(
    ("velocity_bits", "modulus_bits"), [(4, 2), (16, 14), (16, 18), (56, 54), (56, 58)]
)
def test_random_and_extreme_numbers(velocity_bits, modulus_bits):
    random = np.random.default_rng([velocity_bits, modulus_bits])
    edge, velocity_edge = 2 ** (modulus_bits + 1), 2 ** (velocity_bits - 1)
    rows = []
    for _ in range(500):
        start, *velocities = random.random(4) * 2 - 1
        row = [int(start * edge), *(int(value * velocity_edge) for value in velocities)]
        # Around the limits, around a step, and the extremes of the velocities.
        corners = (-edge, edge - 1, edge // 2, edge // 2 - 1, 0, -1)
        if random.random() < 0.5:
            row[0] = corners[random.integers(6)]
        for k in (1, 2, 3):
            if random.random() < 0.4:
                row[k] = (-velocity_edge, velocity_edge - 1, 0, -1)[random.integers(4)]
        rows.append((*row, int(random.random() < 0.8), int(random.integers(2))))
    if velocity_bits < modulus_bits:
        # Velocities are small beside a step, and lead beyond the limits from there alone.
        rows += [
            (-edge, -velocity_edge, -1, 0, 1, 0),
            (-edge, -velocity_edge, -1, 0, 1, 1),
            (edge - 1, velocity_edge - 1, 1, 0, 1, 1),
            (edge - 1, velocity_edge - 1, 1, 0, 1, 0),
        ]
    assert_adds(velocity_bits, modulus_bits, rows)


def test_a_sum_of_zero_does_not_borrow_and_one_of_m_carries():
    rows = [
        # sum, velocity, change, own, enable, down: step, rest, with M = 16.
        ((0, 0, 0, 0, 1, 1), (0, 0)),
        ((0, -1, 0, 0, 1, 1), (-1, 15)),
        ((3, -2, -2, 0, 1, 1), (-1, 15)),
        ((15, 0, 0, 0, 1, 0), (0, 15)),
        ((15, 1, 0, 0, 1, 0), (1, 0)),
        ((15, -1, 2, 0, 1, 0), (1, 0)),
        # Never against the way of the piece, and not when it does not go.
        ((0, -1, 0, 0, 1, 0), (0, -1)),
        ((15, 1, 0, 0, 1, 1), (0, 16)),
        ((15, 1, 0, 0, 0, 0), (0, 16)),
        # A step up adds what it changes in its own velocity, one down takes it off.
        ((15, 3, 0, 2, 1, 0), (1, 4)),
        ((1, -3, 0, 2, 1, 1), (-1, 12)),
    ]
    for row, answer in rows:
        assert added(16, row)[:2] == answer
    part = StepAdder(5, 4)
    inputs = (part.sum, part.velocity, part.change, part.own, part.enable, part.down)

    async def bench(ctx):
        for row, answer in rows:
            for port, value in zip(inputs, row, strict=True):
                ctx.set(port, value)
            assert (ctx.get(part.step), ctx.get(part.rest)) == answer, row

    run(part, bench)


def test_refuses_a_modulus_that_one_summation_can_fill_more_than_twice():
    message = "modulus has 5 bits: velocities of 8 bits need at least 6"
    assert_refused((ValueError, message), StepAdder, 8, 5)
    run(StepAdder(8, 6), _nothing)


async def _nothing(_):
    pass
