"""The golden model against the documents: exact fractions, period by period."""

import inspect
from fractions import Fraction
from math import floor

import numpy as np
import pytest
import z3

from discreta.sim.golden import carrier, carrier_linear
from discreta.sim.golden.carrier_linear import CarrierLinear
from discreta.sim.golden.logic import Value
from discreta.sim.smt import symbols

FIELDS = ("start_x", "start_y", "end_x", "end_y", "periods", "period")


def block(row, valid: Value = 1, ready: Value = 1):
    inputs = {f"blocks_{name}": value for name, value in zip(FIELDS, row, strict=True)}
    return inputs | {"blocks_valid": valid, "steps_ready": ready}


def points_of(golden, row, limit=2000):
    """Run one block; give the clocks of its increments and the points that they lead to."""
    state, points = golden.reset(), []
    for clock in range(limit):
        out = golden.outputs(state)
        if out["done"] or out["error"]:
            assert (state["p3"], state["p4"]) == (points[-1][1:3] if points else (0, 0))
            return points, out["error"]
        if out["steps_valid"]:
            x, y = out["position_x"] + out["steps_x"], out["position_y"] + out["steps_y"]
            points.append((clock, x, y, out["steps_last"]))
        state = golden.step(state, block(row, valid=int(clock == 0)))
    raise AssertionError(f"no answer within {limit} clocks")


@pytest.mark.parametrize("preload", ["zero", "half"])
@pytest.mark.parametrize(
    "row",
    [
        (0, 0, 200, -99, 7, 2),
        (-100, 100, 100, -56, 13, 5),
        (3, 3, 3, 4, 1, 2),
        (3, 3, 3, 4, 9, 3),
        (255, -256, 1, -1, 40, 2),
        (0, 0, 5, 2, 300, 2),
    ],
)
def test_closed_form(row, preload):
    """X(i) = XH ± ⌊S₀ + i·m⌋ every T clocks; what is left in the last period."""
    golden = CarrierLinear(8, preload)
    points, error = points_of(golden, row)
    assert error == 0
    xh, yh, xk, yk, periods, period = row
    initial = Fraction({"zero": 0, "half": 1}[preload], 2)
    wanted = []
    for i in range(1, periods + 1):
        point = []
        for begin, end in ((xh, xk), (yh, yk)):
            mean = Fraction(floor(Fraction(abs(end - begin), periods) * 2**20), 2**20)
            far = floor(initial + i * mean) if i < periods else abs(end - begin)
            point.append(begin + far * (1 if end >= begin else -1))
        wanted.append(tuple(point))
        if tuple(point) == (xk, yk):
            break
    assert [point[1:3] for point in points] == wanted
    # Accepted in clock 0, waiting from 2n + 16.
    assert [point[0] for point in points] == [32 + i * period for i in range(len(wanted))]
    assert [point[3] for point in points] == [0] * (len(wanted) - 1) + [1]


@pytest.mark.parametrize("preload", ["zero", "half"])
@pytest.mark.parametrize("periods", [1, 2, 3, 7, 16, 50])
def test_every_pair_of_lengths_of_four_bits(periods, preload):
    """All pairs at once: ends, distance of an axis from the line, and the last increment."""
    golden = CarrierLinear(4, preload)
    x, y = (lengths.ravel() for lengths in np.meshgrid(np.arange(16), np.arange(16)))
    x, y = x[1:], y[1:]  # without the one of no length
    zero = np.zeros(255, np.int64)
    row = (zero, zero, x, -y, zero + periods, zero + 2)
    state = {name: zero + value for name, value in golden.reset().items()}
    most, least = {"zero": (17 / 16, 0.0), "half": (9 / 16, 0.5)}[preload]
    lengths = np.stack([x, y])
    mean = (lengths << 16) // periods / 2**16
    count, reached, last, ended = zero, zero, np.zeros((2, 255)), zero
    furthest = 0.0
    for clock in range(30 + 2 * periods):
        out = golden.outputs(state)
        valid = out["steps_valid"] == 1
        count = count + valid
        moves = np.stack([out["steps_x"], -out["steps_y"]])
        reached = np.where(
            valid, np.stack([out["position_x"], -out["position_y"]]) + moves, reached
        )
        before_last = valid & (out["steps_last"] == 0)
        behind = (lengths * count / periods - reached)[:, before_last]
        if behind.size:
            assert behind.max() < most
            assert behind.min() >= -least
            furthest = max(furthest, np.abs(behind).max())
        ends = valid & (out["steps_last"] == 1)
        last = np.where(ends, moves, last)
        ended = ended + ends
        state = golden.step(state, block(row, valid=zero + (clock == 0), ready=zero + 1))
    assert (ended == 1).all()
    assert np.array_equal(reached, lengths)
    assert (np.abs(last - mean) < 1 + periods / 2**16).all()
    # The bounds are not far above what there is.
    if periods > 1:
        assert furthest >= {"zero": 0.5, "half": 0.33}[preload]
        assert np.abs(last - mean).max() >= 0.32


@pytest.mark.parametrize(
    "row", [(-256, 0, 0, 0, 4, 4), (0, 0, 1, 1, 0, 4), (0, 0, 1, 1, 4, 1), (0, 0, 0, 0, 0, 4)]
)
def test_what_is_refused_moves_nothing(row):
    assert points_of(CarrierLinear(8), row) == ([], 1)


@pytest.mark.parametrize("preload", ["zero", "half"])
def test_integers_arrays_and_bit_vectors_agree(preload):
    """Random states, reachable or not, one clock, in all three."""
    golden = CarrierLinear(4, preload)
    random = np.random.default_rng(3)
    kinds = dict(golden.registers())
    inputs = dict.fromkeys(("blocks_valid", "steps_ready"), (1, False))
    inputs |= {f"blocks_{name}": (5, True) for name in FIELDS[:4]}
    inputs |= {"blocks_periods": (12, False), "blocks_period": (24, False)}

    def draw(bits, signed):
        low = -(2 ** (bits - 1)) if signed else 0
        values = random.integers(low, low + 2**bits, 80)
        # Counters are often at an end.
        return np.where(random.random(80) < 0.3, values & 1, values)

    lanes = {name: draw(*kind) for name, kind in (kinds | inputs).items()}
    state = {name: lanes[name] for name in kinds}
    given = {name: lanes[name] for name in inputs}
    after = golden.step(state, given)

    wide = symbols(kinds | inputs, 32)
    formula = golden.step({k: wide[k] for k in kinds}, {k: wide[k] for k in inputs})
    for lane in range(80):
        one = golden.step(
            {name: int(values[lane]) for name, values in state.items()},
            {name: int(values[lane]) for name, values in given.items()},
        )
        assert one == {name: int(values[lane]) for name, values in after.items()}
        for name, (bits, signed) in kinds.items():
            low = -(2 ** (bits - 1)) if signed else 0
            assert low <= one[name] < low + 2**bits, name
        if lane < 2:
            values = [
                (z3.BitVec(name, bits), z3.BitVecVal(int(lanes[name][lane]), bits))
                for name, (bits, _) in (kinds | inputs).items()
            ]
            for name, value in formula.items():
                assert z3.simplify(z3.substitute(value, *values)).as_signed_long() == one[name]


def test_it_shares_nothing_with_what_it_checks():
    for module in (carrier, carrier_linear):
        source = inspect.getsource(module)
        assert "discreta.hdl" not in source
        assert "import amaranth" not in source
        assert "from amaranth" not in source
