"""The golden model against the documents: its formulas in exact fractions, its angle in doubles."""

import inspect
from fractions import Fraction
from math import atan2, cos, floor, pi, sin

import numpy as np
import pytest
import z3

from discreta.sim.golden import carrier_circular
from discreta.sim.golden.carrier_circular import CarrierCircular
from discreta.sim.smt import symbols

FIELDS = ("start_x", "start_y", "end_x", "end_y", "center_x", "center_y")
FIELDS += ("clockwise", "full_turns", "periods", "period")
VARIANTS = [
    ("plain", "series", "zero"),
    ("plain", "series", "half"),
    ("predictor_corrector", "series", "half"),
    ("rotation", "series", "half"),
    ("rotation", "table", "zero"),
]
#: Counter-clockwise and clockwise, around another centre, out of the third quadrant.
ROWS = [(7, 0, 0, 7, 0, 0, 0, 0, 4), (-9, -3, -3, 1, -4, -4, 1, 0, 5)]
ROWS += [(-5, -6, 4, -7, 0, 0, 0, 0, 6)]


def block(row, valid=1, ready=1):
    inputs = {f"blocks_{name}": value for name, value in zip(FIELDS, row, strict=True)}
    return inputs | {"blocks_valid": valid, "steps_ready": ready}


def run(golden, row, limit=3000):
    """Run one block; give the points of its increments, and the states in which these wait."""
    state, points, states = golden.reset(), [], []
    for clock in range(limit):
        out = golden.outputs(state)
        if out["done"] or out["error"]:
            return points, states, out["error"]
        if out["steps_valid"]:
            points.append(tuple(out[f"position_{a}"] + out[f"steps_{a}"] for a in "xy"))
            states.append(state)
        state = golden.step(state, block(row, valid=int(clock == 0)))
    raise AssertionError(f"no answer within {limit} clocks")


def exact(row, formula, step, factors):
    """Yield the points seen from the centre in fractions, by the formulas of the docstring."""
    x, y = Fraction(row[0] - row[4]), Fraction(row[1] - row[5])
    way = -1 if row[6] else 1
    kappa, sine = factors
    dx, dy = x * kappa / 2 - way * y * sine, y * kappa / 2 + way * x * sine
    step *= way
    while True:
        if formula == "plain":
            x, y = x - y * step, y + x * step
        elif formula == "predictor_corrector":
            u, v = x - y * step, y + x * step
            x, y = x - (y + v) / 2 * step, y + (x + u) / 2 * step
        else:
            dx, dy = dx - kappa * x, dy - kappa * y
            x, y = x + dx, y + dy
        yield x, y


@pytest.mark.parametrize(
    ("formula", "coefficient", "preload", "row"),
    [(*variant, row) for variant in VARIANTS for row in ROWS[: 1 if "table" in variant else 3]],
)
def test_points_by_exact_fractions(formula, coefficient, preload, row):
    """The registers are the formula's own points but for what products cut off, some 2^−16."""
    golden = CarrierCircular(4, formula, coefficient, preload)
    row = (*row, golden.least_period)
    points, states, error = run(golden, row)
    assert error == 0
    periods = row[8]
    one = 2**golden.bits
    first = states[0]
    step = Fraction(first["quotient_angle"], one)
    (x, y), (u, v) = ((row[k] - row[4], row[k + 1] - row[5]) for k in (0, 2))
    angle = atan2(x * v - y * u, x * u + y * v) * (-1 if row[6] else 1) % (2 * pi)
    radius = (x * x + y * y) ** 0.5
    # The angle measured is off by less than a quarter of a step along the arc.
    assert abs(float(step) * periods - angle) * radius < 0.25
    factors = Fraction(0), Fraction(0)
    if formula == "rotation":
        factors = Fraction(first["kappa"], one), Fraction(first["sine"], one)
        assert abs(factors[0] - 2 * (1 - cos(step))) < Fraction(20, one)
        assert abs(factors[1] - sin(step)) < Fraction(20, one)
    count = len(points)
    assert periods - 1 <= count <= periods
    half = Fraction({"zero": 0, "half": 1}[preload], 2)
    truths = exact(row, formula, step, factors)
    for index, (state, point) in enumerate(zip(states, points, strict=True)):
        true = next(truths)
        near = [Fraction(state[name], 2**golden.fraction) for name in ("p1", "p2")]
        for k, center in ((0, row[4]), (1, row[5])):
            # Every product loses less than one unit; these add up along the arc.
            assert abs(near[k] - true[k]) < Fraction(4 * (index + 1) ** 2, 2**golden.fraction)
            if index < periods - 1:
                whole = floor(near[k] + half) + center
                assert point[k] == max(-16, min(15, whole))
    assert points[-1] == row[2:4]
    if count == periods:
        assert points[-2] != row[2:4]


@pytest.mark.parametrize(
    ("row", "code"),
    [
        ((7, 0, 0, 7, 0, 0, 0, 0, 0, 24), 1),
        ((7, 0, 0, 7, 0, 0, 0, 0, 4, 23), 1),
        ((7, 0, 0, 7, 0, 0, 0, 0, 3, 24), 1),  # π/6 is more than ½
        ((3, 0, 3, 0, 0, 0, 0, 0, 48, 24), 1),  # (⌊2π⌋ + 1)² is 49
        ((7, 0, 0, 9, 0, 0, 0, 0, 4, 24), 2),
        ((-16, 0, 0, 9, 1, 0, 0, 0, 9, 24), 1),
    ],
)
def test_what_is_refused_moves_nothing(row, code):
    points, _, error = run(CarrierCircular(4, "plain"), row)
    assert (points, error) == ([], code)


@pytest.mark.parametrize(("formula", "coefficient"), [VARIANTS[2][:2], VARIANTS[4][:2]])
def test_integers_arrays_and_bit_vectors_agree(formula, coefficient):
    """Random states, reachable or not, one clock, in all three."""
    golden = CarrierCircular(4, formula, coefficient)
    random = np.random.default_rng(4)
    kinds = dict(golden.registers())
    inputs = dict.fromkeys(("blocks_valid", "steps_ready", "blocks_clockwise"), (1, False))
    inputs |= {f"blocks_{name}": (5, True) for name in FIELDS[:6]}
    inputs |= {"blocks_full_turns": (8, False), "blocks_periods": (12, False)}
    inputs |= {"blocks_period": (24, False)}
    count = 20

    def draw(bits, signed):
        low = -(2 ** (bits - 1)) if signed else 0
        values = random.integers(low, low + 2**bits, count)
        # Counters are often at an end.
        return np.where(random.random(count) < 0.3, values & 1, values)

    lanes = {name: draw(*kind) for name, kind in (kinds | inputs).items()}
    state = {name: lanes[name] for name in kinds}
    given = {name: lanes[name] for name in inputs}
    after = golden.step(state, given)

    wide = symbols(kinds | inputs, 64)
    formulas = golden.step({k: wide[k] for k in kinds}, {k: wide[k] for k in inputs})
    for lane in range(count):
        one = golden.step(
            {name: int(values[lane]) for name, values in state.items()},
            {name: int(values[lane]) for name, values in given.items()},
        )
        assert one == {name: int(values[lane]) for name, values in after.items()}
        if lane < 1:
            values = [
                (z3.BitVec(name, bits), z3.BitVecVal(int(lanes[name][lane]), bits))
                for name, (bits, _) in (kinds | inputs).items()
            ]
            for name, value in formulas.items():
                if isinstance(value, int):
                    assert value == one[name]
                    continue
                found = z3.simplify(z3.substitute(value, *values)).as_signed_long()
                assert found == one[name], name


def test_it_shares_nothing_with_what_it_checks():
    source = inspect.getsource(carrier_circular)
    assert "discreta.hdl" not in source
    assert "import amaranth" not in source
    assert "from amaranth" not in source
