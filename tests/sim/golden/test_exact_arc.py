"""The golden model against the circle itself: every small arc, every kind of start and end."""

import inspect
from itertools import product

import numpy as np
import pytest
import z3

from discreta.sim.golden import exact_arc
from discreta.sim.golden.exact_arc import ExactArc
from discreta.sim.smt import symbols
from tests.arcs import draw_arcs, on_curve
from tests.exact_arcs import exact_steps

FIELDS = ("start_x", "start_y", "end_x", "end_y", "center_x", "center_y", "clockwise", "full_turns")


def run(golden, blocks, limit=20_000):
    """Run blocks side by side, each from reset; give steps (clock, x, y), answers and positions."""
    blocks = np.array(blocks, dtype=np.int64)
    steps, answers = [[] for _ in blocks], np.full((len(blocks), 2), -1)
    points, places = blocks[:, :2].copy(), np.zeros((len(blocks), 2), dtype=np.int64)
    state = {name: np.full(len(blocks), value) for name, value in golden.reset().items()}
    fields = {f"blocks_{name}": column for name, column in zip(FIELDS, blocks.T, strict=True)}
    lasts = np.zeros(len(blocks), dtype=np.int64)
    for clock in range(limit):
        out = golden.outputs(state)
        for lane in np.flatnonzero(out["steps_valid"]):
            points[lane] += out["steps_x"][lane], out["steps_y"][lane]
            steps[lane].append((clock, *points[lane].tolist()))
            lasts[lane] += out["steps_last"][lane]
        told = (out["done"] | out["error"]) != 0
        answers[told] = np.stack([out["done"], out["error"]], axis=1)[told]
        places[told] = np.stack([out["position_x"], out["position_y"]], axis=1)[told]
        if np.all(answers[:, 0] >= 0):
            return steps, answers, places, lasts
        inputs = fields | {"blocks_valid": np.full(len(blocks), int(clock == 0)), "steps_ready": 1}
        state = golden.step(state, inputs)
    raise AssertionError(f"not done after {limit} clocks")


def off(point, square):
    """Tell exactly whether a point is half a step or more off the circle of a squared radius."""
    apart = point[0] ** 2 + point[1] ** 2 - square
    inner = min(square, square + apart)
    return 4 * abs(apart) > 1 and (4 * abs(apart) - 1) ** 2 >= 16 * inner


def small_arcs(radius):
    side = range(-radius, radius + 1)
    for x, y in product(side, side):
        if not 0 < x * x + y * y <= radius * radius:
            continue
        near = range(-radius - 1, radius + 2)
        for u, v, clockwise in product(near, near, (0, 1)):
            block = (x, y, u, v, 0, 0, clockwise, 0)
            if on_curve(block):
                yield block


def test_every_small_arc_with_every_end_up_to_a_step_off():
    """Never half a step off, never back, and exactly at the end with the one last step."""
    blocks = list(small_arcs(6))
    assert len(blocks) > 9000
    steps, answers, places, lasts = run(ExactArc(4), blocks)
    assert np.all(answers == [1, 0])
    assert np.array_equal(places, np.array(blocks)[:, 2:4])
    assert np.all(lasts == 1)
    for block, made in zip(blocks, steps, strict=True):
        path = [(x, y) for _, x, y in made]
        assert path[-1] == block[2:4]
        square = block[0] ** 2 + block[1] ** 2
        assert not any(off(point, square) for point in path[:-1]), block
        side = -1 if block[6] else 1
        for (x, y), (u, v) in zip([block[:2], *path], path, strict=False):
            assert max(abs(u - x), abs(v - y)) == 1
            assert side * (x * (v - y) - y * (u - x)) >= 0, block


def test_every_step_and_clock_by_the_rule():
    blocks = [b for k, b in enumerate(draw_arcs(6, 64, seed=4, radius=40).tolist()) if k % 8 < 6]
    steps, answers, _, _ = run(ExactArc(6), blocks)
    assert np.all(answers == [1, 0])
    for block, made in zip(blocks, steps, strict=True):
        # Accepted in clock 0, loaded in 5; the first step is decided in 6 and leaves in 7.
        assert made == [(clock + 7, *point) for clock, point in exact_steps(block)]


@pytest.mark.parametrize("radius", [1, 2, 3, 7, 100, 126, 127])
def test_circles_close_and_are_symmetric(radius):
    (steps,), _, _, _ = run(ExactArc(7), [(radius, 0, radius, 0, 0, 0, 0, 0)])
    path = {(x, y) for _, x, y in steps}
    assert (steps[-1][1], steps[-1][2]) == (radius, 0)
    assert path == {(-y, x) for x, y in path} == {(y, x) for x, y in path}
    # One clock a step, and one more for every change but of a circle of one step.
    eights = 0 if radius == 1 else 7
    assert steps[-1][0] - steps[0][0] - len(steps) + 1 in (eights, eights + 1, eights - 1)


def test_every_off_curve_block_ends_and_its_position_is_exact():
    blocks = [
        (x, 0, u, v, 0, 0, c, 0)
        for x in (1, 5, 12)
        for u, v, c in product(range(-15, 16, 3), range(-15, 16, 2), (0, 1))
    ]
    steps, answers, places, lasts = run(ExactArc(4), blocks, limit=300)
    for block, made, (done, error), place, last in zip(
        blocks, steps, answers, places, lasts, strict=True
    ):
        assert done or error == 2
        assert last == done
        assert (made[-1][1], made[-1][2]) == tuple(place)
        assert done == (tuple(place) == block[2:4])
        if on_curve(block):
            assert done


def test_one_source_runs_on_integers_arrays_and_bit_vectors():
    golden = ExactArc(5)
    random = np.random.default_rng(8)
    kinds = golden.registers()
    inputs = {f"blocks_{k}": (6, True) for k in FIELDS[:6]}
    inputs |= {"blocks_full_turns": (8, False)}
    flags = ("blocks_valid", "blocks_clockwise", "steps_ready")
    inputs |= dict.fromkeys(flags, (1, False))

    def draw(bits, signed):
        low = -(2 ** (bits - 1)) if signed else 0
        return random.integers(low, low + 2**bits, 200)

    lanes = {name: draw(*kind) for name, kind in (kinds | inputs).items()}
    state, given = ({k: lanes[k] for k in names} for names in (kinds, inputs))
    after = golden.step(state, given)
    wide = symbols(kinds | inputs, 24)
    formula = golden.step({k: wide[k] for k in kinds}, {k: wide[k] for k in inputs})
    assert formula.keys() == after.keys() == kinds.keys()
    for lane in range(200):
        one = golden.step(
            {name: int(values[lane]) for name, values in state.items()},
            {name: int(values[lane]) for name, values in given.items()},
        )
        assert one == {k: int(np.broadcast_to(v, 200)[lane]) for k, v in after.items()}
        for name, (bits, signed) in kinds.items():
            low = -(2 ** (bits - 1)) if signed else 0
            assert low <= one[name] < low + 2**bits, name
        if lane < 4:
            values = [
                (z3.BitVec(name, bits), z3.BitVecVal(int(lanes[name][lane]), bits))
                for name, (bits, _) in (kinds | inputs).items()
            ]
            for name, value in formula.items():
                assert z3.simplify(z3.substitute(value, *values)).as_signed_long() == one[name]


def test_it_shares_nothing_with_what_it_checks():
    source = inspect.getsource(exact_arc)
    assert "discreta.hdl" not in source
    assert "amaranth" not in source
