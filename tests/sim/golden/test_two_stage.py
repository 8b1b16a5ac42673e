"""The golden model against its closed form: ⌊(S₀ + t·Δ) / M⌋ steps after t clocks of a period."""

import inspect
from itertools import pairwise

import numpy as np
import pytest
import z3

from discreta.sim.golden import two_stage
from discreta.sim.golden.carrier_linear import CarrierLinear
from discreta.sim.golden.two_stage import TwoStage, two_stage_circular, two_stage_linear
from discreta.sim.smt import symbols

FIELDS = ("start_x", "start_y", "end_x", "end_y", "periods", "period")


def trace(golden, row, limit=600):
    """Run one block; give what the ports show in every clock until it is answered."""
    state, shown = golden.reset(), []
    names = [f"blocks_{name}" for name in FIELDS]
    for clock in range(limit):
        shown.append(golden.outputs(state))
        if shown[-1]["done"] or shown[-1]["error"]:
            return shown
        inputs = dict(zip(names, row, strict=True))
        inputs |= {"blocks_valid": int(clock == 0), "steps_ready": 1}
        state = golden.step(state, inputs)
    raise AssertionError(f"no answer within {limit} clocks")


@pytest.mark.parametrize("preload", ["zero", "half"])
@pytest.mark.parametrize(
    "row",
    [
        (0, 0, 100, -77, 3, 50),
        (-3, 5, 8, 60, 4, 13),
        (0, 0, -255, 200, 1, 2),  # more steps than clocks
        (9, 9, 10, 9, 1, 30),
    ],
)
def test_closed_form(row, preload):
    """X and Y in every clock: those of the first stage, and the steps since, evenly spread."""
    golden = two_stage_linear(8, preload)
    shown = trace(golden, row)
    # The first stage alone gives the points between.
    coarse, knots = CarrierLinear(8, preload), [row[:2]]
    for out in trace(coarse, row):
        if out["steps_valid"]:
            knots.append((out["position_x"] + out["steps_x"], out["position_y"] + out["steps_y"]))
    clock = 2 * 8 + 16  # in which the first increments wait and are taken
    for begin, end in pairwise(knots):
        moves = [b - a for a, b in zip(begin, end, strict=True)]
        span = max(row[5], *map(abs, moves))
        initial = {"zero": 0, "half": span // 2}[preload]
        for t in range(1, span + 1):
            # Summed in clock + t, a step that waits one clock later, taken and seen after another.
            if clock + t + 2 >= len(shown):
                break
            for k, a in enumerate("xy"):
                steps = (initial + t * abs(moves[k])) // span
                wanted = begin[k] + steps * (1 if moves[k] > 0 else -1)
                assert shown[clock + t + 2][f"position_{a}"] == wanted, (t, a)
        clock += span
    assert tuple(shown[-1][f"position_{a}"] for a in "xy") == row[2:4]
    assert [out["steps_last"] for out in shown if out["steps_valid"]][-1] == 1
    assert shown[-2]["steps_valid"] == 1


def test_it_has_the_parameters_of_its_first_stage():
    line, arc = two_stage_linear(6, "zero"), two_stage_circular(6, "plain")
    assert isinstance(line, TwoStage)
    assert (line.width, line.preload) == (6, "zero")
    assert (arc.width, arc.formula, arc.coefficient, arc.preload) == (6, "plain", "series", "half")
    with pytest.raises(AttributeError):
        _ = line.formula


@pytest.mark.parametrize("preload", ["zero", "half"])
def test_integers_arrays_and_bit_vectors_agree(preload):
    """Random states, reachable or not, one clock, in all three."""
    golden = two_stage_linear(4, preload)
    random = np.random.default_rng(5)
    kinds = dict(golden.registers())
    inputs = dict.fromkeys(("blocks_valid", "steps_ready"), (1, False))
    inputs |= {f"blocks_{name}": (5, True) for name in FIELDS[:4]}
    inputs |= {"blocks_periods": (12, False), "blocks_period": (24, False)}

    def draw(bits, signed):
        low = -(2 ** (bits - 1)) if signed else 0
        values = random.integers(low, low + 2**bits, 60)
        # Counters are often at an end.
        return np.where(random.random(60) < 0.4, values & 1, values)

    lanes = {name: draw(*kind) for name, kind in (kinds | inputs).items()}
    state = {name: lanes[name] for name in kinds}
    given = {name: lanes[name] for name in inputs}
    after = golden.step(state, given)

    wide = symbols(kinds | inputs, 32)
    formula = golden.step({k: wide[k] for k in kinds}, {k: wide[k] for k in inputs})
    for lane in range(60):
        one = golden.step(
            {name: int(values[lane]) for name, values in state.items()},
            {name: int(values[lane]) for name, values in given.items()},
        )
        assert one == {name: int(values[lane]) for name, values in after.items()}
        if lane < 2:
            values = [
                (z3.BitVec(name, bits), z3.BitVecVal(int(lanes[name][lane]), bits))
                for name, (bits, _) in (kinds | inputs).items()
            ]
            for name, value in formula.items():
                assert z3.simplify(z3.substitute(value, *values)).as_signed_long() == one[name]


def test_it_shares_nothing_with_what_it_checks():
    source = inspect.getsource(two_stage)
    assert "discreta.hdl" not in source
    assert "import amaranth" not in source
    assert "from amaranth" not in source
