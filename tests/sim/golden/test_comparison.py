"""The golden model against the article: its table, its routine, and what it says of the error."""

import inspect

import numpy as np
import pytest
import z3

from discreta.sim.golden import comparison, line_frame
from discreta.sim.golden.comparison import Comparison
from discreta.sim.smt import symbols
from tests.lines import article, distance

VARIANTS = [(form, first) for form in ("signed", "two") for first in ("x", "y")]

#: The rows that the article prints of its table, from (5, 2) to (35, 20): x, y, Sx, Sy, Sx − Sy.
PRINTED = [
    *[(5, 2, 0, 0, 0), (6, 2, 18, 0, 18), (6, 3, 18, 30, -12), (7, 3, 36, 30, 6)],
    *[(7, 4, 36, 60, -24), (8, 4, 54, 60, -6), (9, 4, 72, 60, 12), (9, 5, 72, 90, -18)],
    *[(10, 5, 90, 90, 0), (11, 5, 108, 90, 18)],
    *[(32, 19, 486, 510, -24), (33, 19, 504, 510, -6), (34, 19, 522, 510, 12)],
    *[(34, 20, 522, 540, -18), (35, 20, 540, 540, 0)],
]


def run(golden, block):
    """Run one block; give x, y and Sx − Sy at the start and after every step, and the clocks."""
    start_x, start_y, end_x, end_y = block
    inputs = {"blocks_start_x": start_x, "blocks_start_y": start_y}
    inputs |= {"blocks_end_x": end_x, "blocks_end_y": end_y, "steps_ready": 1}
    state, rows, summations = golden.reset(), [], 0
    for clock in range(abs(end_x - start_x) + abs(end_y - start_y) + 5):
        if state["done"] or state["error"]:
            return rows, summations
        summations += state["running"]
        before, state = state, golden.step(state, inputs | {"blocks_valid": int(clock == 0)})
        # The sums are a step ahead of the position: they belong to the step that waits.
        moved = [
            state[k] + golden.outputs(state)[f"steps_{a}"] for k, a in (("p3", "x"), ("p4", "y"))
        ]
        if before["running"] or (before["pending"] and state["running"]):
            s = state["s"] if golden.form == "signed" else state["sx"] - state["sy"]
            rows.append((*moved, s))
    raise AssertionError("no answer")


def leads(block, first):
    dx, dy = abs(block[2] - block[0]), abs(block[3] - block[1])
    return dx > dy or (dx == dy and first == "x")


def test_the_routine_of_the_tests_prints_the_table_of_the_article():
    rows = list(article((5, 2, 35, 20), x_leads=True))
    assert len(rows) == 49
    assert rows[:10] + rows[-5:] == PRINTED


@pytest.mark.parametrize(("form", "first"), VARIANTS)
def test_all_lines_of_4_bits_are_the_article_s(form, first):
    golden = Comparison(4, form, first)
    random = np.random.default_rng(3)
    for dx in range(16):
        for dy in range(16):
            x, y = random.integers(-16, 1, 2).tolist()
            signs = random.choice([-1, 1], 2).tolist()
            block = (x, y, x + dx, y + dy)
            if signs[0] < 0:
                block = (block[2], block[1], block[0], block[3])
            if signs[1] < 0:
                block = (block[0], block[3], block[2], block[1])
            rows, summations = run(golden, block)
            expected = [(x, y, s) for x, y, *_, s in article(block, x_leads=leads(block, first))]
            assert rows == (expected if dx or dy else [])
            assert summations == dx + dy


@pytest.mark.parametrize("first", ["x", "y"])
def test_no_point_is_a_step_off_and_at_45_degrees_first_tells_the_side(first):
    """The article: the error is less than a step, and at 45° √½ below the line, or above it."""
    golden = Comparison(5, first=first)
    largest = 0.0
    for dx in range(32):
        for dy in range(32):
            if not (dx or dy):
                continue
            rows, _ = run(golden, (0, 0, dx, dy))
            errors = [distance((x, y), (0, 0), (dx, dy)) for x, y, _ in rows]
            largest = max(largest, *errors)
            if dx == dy:
                # Every other point is on the line, the ones between on one side.
                heights = [y - x for x, y, _ in rows]
                assert heights == [0, -1 if first == "x" else 1] * dx + [0]
                assert max(errors) == pytest.approx(0.5**0.5)
            if not (dx and dy):
                assert max(errors) == 0
    assert 0.9 < largest < 1


def test_too_long_a_block_moves_nothing():
    rows, summations = run(Comparison(8), (-256, 0, 0, 0))
    assert (rows, summations) == ([], 0)


@pytest.mark.parametrize(("form", "first"), VARIANTS)
def test_integers_arrays_and_bit_vectors_agree(form, first):
    """Random states, reachable or not, one clock, in all three."""
    golden = Comparison(8, form, first)
    random = np.random.default_rng(3)
    kinds = dict(golden.registers())
    inputs = dict.fromkeys(("blocks_valid", "steps_ready"), (1, False))
    for a in "xy":
        inputs |= {f"blocks_start_{a}": (9, True), f"blocks_end_{a}": (9, True)}

    def draw(bits, signed):
        low = -(2 ** (bits - 1)) if signed else 0
        return random.integers(low, low + 2**bits, 200)

    lanes = {name: draw(*kind) for name, kind in (kinds | inputs).items()}
    state = {name: lanes[name] for name in kinds}
    given = {name: lanes[name] for name in inputs}
    after = golden.step(state, given)

    wide = symbols(kinds | inputs, 20)
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
    for module in (comparison, line_frame):
        source = inspect.getsource(module)
        assert "discreta.hdl" not in source
        assert "import amaranth" not in source
        assert "from amaranth" not in source
