"""The golden model against the documents: closed forms, and exercise 3's own numbers."""

import inspect

import numpy as np
import pytest
import z3

from discreta.sim.golden import linear, logic
from discreta.sim.golden.linear import Linear
from discreta.sim.smt import symbols


def block(golden, start, end, valid=1, ready=1):
    inputs = {"blocks_valid": valid, "steps_ready": ready}
    for a, begin, finish in zip(golden.letters, start, end, strict=True):
        inputs |= {f"blocks_start_{a}": begin, f"blocks_end_{a}": finish}
    return inputs


def run(golden, start, end, limit):
    """Run one block; give the state before every clock, and the clocks in which it summed."""
    state = golden.reset()
    states = []
    for clock in range(limit):
        states.append(state)
        if state["done"] or state["error"]:
            return states
        state = golden.step(state, block(golden, start, end, valid=int(clock == 0)))
    raise AssertionError(f"no answer within {limit} clocks")


def shift(golden, lengths):
    if not golden.normalize or not any(lengths):
        return 0
    return golden.width - max(lengths).bit_length()


@pytest.mark.parametrize("preload", ["zero", "half"])
@pytest.mark.parametrize("normalize", [True, False])
@pytest.mark.parametrize(
    ("width", "start", "end"),
    [
        (8, (0, 0), (200, 99)),
        (8, (-100, 100), (100, -56)),
        (8, (3, 3), (3, 4)),
        (8, (255, -256), (0, -1)),
        (6, (0, 0, 0), (40, -21, 13)),
        (5, (1, 2, 3, 4, 5, 6), (-6, -5, -4, -3, -2, -1)),
    ],
)
def test_closed_form(width, start, end, normalize, preload):
    """X(t) = XH ± ⌊(S₀ + t·ΔX·2^s) / M⌋, the step leaving one clock after its summation."""
    golden = Linear(width, len(start), normalize, preload)
    modulus = 2**width
    lengths = [abs(b - a) for a, b in zip(start, end, strict=True)]
    scale = 2 ** shift(golden, lengths)
    states = run(golden, start, end, modulus + 5)
    summations = sum(state["running"] for state in states)
    assert summations <= modulus // scale
    if preload == "zero":
        assert summations == modulus // scale
    # Accepted in clock 0, started in 1: t summations stand in S in clock t + 2, and the step of the
    # last of them is taken in that clock.
    for t in range(summations + 1):
        for index, a in enumerate(golden.letters):
            position = golden.names(a)[1]
            x = (golden.initial_sum + t * lengths[index] * scale) // modulus
            sign = 1 if end[index] >= start[index] else -1
            assert states[t + 3][position] == start[index] + sign * x, (t, a)
    assert len(states) - 1 == summations + 3


def test_lecture_example_of_8_bits():
    """The lecture's k = 1/256 for an 8-bit device: without normalizing a line takes 256 clocks."""
    states = run(Linear(8, 2, False, "zero"), (0, 0), (1, 0), 300)
    assert sum(state["running"] for state in states) == 256
    states = run(Linear(8, 2, True, "zero"), (0, 0), (1, 0), 300)
    assert sum(state["running"] for state in states) == 2


def test_too_long_a_block_moves_nothing():
    golden = Linear(8)
    states = run(golden, (-256, 0), (0, 0), 10)
    assert states[-1]["error"] == 1
    assert all(state["running"] == state["pulse_x"] == state["p3"] == 0 for state in states)


@pytest.mark.parametrize("axes", [2, 3])
def test_integers_arrays_and_bit_vectors_agree(axes):
    """Random states, reachable or not, one clock, in all three."""
    golden = Linear(8, axes)
    random = np.random.default_rng(3)
    kinds = dict(golden.registers())
    inputs = dict.fromkeys(("blocks_valid", "steps_ready"), (1, False))
    for a in golden.letters:
        inputs |= {f"blocks_start_{a}": (9, True), f"blocks_end_{a}": (9, True)}

    def draw(bits, signed):
        low = -(2 ** (bits - 1)) if signed else 0
        return random.integers(low, low + 2**bits, 200)

    lanes = {name: draw(*kind) for name, kind in (kinds | inputs).items()}
    state = {name: lanes[name] for name in kinds}
    given = {name: lanes[name] for name in inputs}
    after = golden.step(state, given)

    wide = symbols(kinds | inputs, 12)
    formula = golden.step({k: wide[k] for k in kinds}, {k: wide[k] for k in inputs})
    for lane in range(200):
        one = golden.step(
            {name: int(values[lane]) for name, values in state.items()},
            {name: int(values[lane]) for name, values in given.items()},
        )
        assert one == {name: int(values[lane]) for name, values in after.items()}
        if lane < 10:
            values = [
                (z3.BitVec(name, bits), z3.BitVecVal(int(lanes[name][lane]), bits))
                for name, (bits, _) in (kinds | inputs).items()
            ]
            for name, value in formula.items():
                assert z3.simplify(z3.substitute(value, *values)).as_signed_long() == one[name]


def test_it_shares_nothing_with_what_it_checks():
    for module in (linear, logic):
        source = inspect.getsource(module)
        assert "discreta.hdl" not in source
        assert "import amaranth" not in source
        assert "from amaranth" not in source
