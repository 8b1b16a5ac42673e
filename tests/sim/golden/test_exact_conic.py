"""The golden model against the curve itself: nearest points, exact ends, the frame's invariants."""

import inspect

import numpy as np
import pytest

from discreta.sim import conics
from discreta.sim.golden import exact_conic
from discreta.sim.golden.exact_conic import ExactConic
from tests.conics import FIELDS, derivatives, draw_conics, fault, is_empty

WIDTH = 5


def follow(blocks, width, stop=20_000):
    """Run every block alone, in arrays; give for each its points, answer, and states while it ran.

    The states are (residual, x, y, steep, down x, down y) of every clock.
    """
    golden = ExactConic(width)
    blocks = np.asarray(blocks)
    state = {name: np.full(len(blocks), value) for name, value in golden.reset().items()}
    given = {f"blocks_{name}": row for name, row in zip(FIELDS, blocks.T, strict=True)}
    points = [[tuple(block[5:7])] for block in blocks.tolist()]
    lasts = [[] for _ in blocks]
    answers: list[tuple[int, ...]] = [()] * len(blocks)
    seen = [[] for _ in blocks]
    names = ("residual", "p1", "p2", "steep", "direction_x", "direction_y")
    for clock in range(stop):
        out = golden.outputs(state)
        for k in np.flatnonzero(np.asarray(out["steps_valid"])).tolist():
            x, y = points[k][-1]
            points[k].append((x + int(out["steps_x"][k]), y + int(out["steps_y"][k])))
            lasts[k].append(int(out["steps_last"][k]))
        for k in np.flatnonzero(np.asarray(state["running"])).tolist():
            seen[k].append([int(state[name][k]) for name in names])
        for k in np.flatnonzero(np.asarray(out["done"] | out["error"])).tolist():
            answers[k] = (int(out["done"][k]), int(out["error"][k]))
        if all(answers):
            return points, lasts, answers, seen
        state = golden.step(state, given | {"blocks_valid": int(clock == 0), "steps_ready": 1})
        state = {name: np.broadcast_to(value, len(blocks)) for name, value in state.items()}
    raise AssertionError("a block does not end")


def value(block, x, y):
    """Give F, from its definition."""
    a, b, c, d, e, x0, y0 = block[:7]

    def form(u, v):
        return a * u * u + b * u * v + c * v * v + d * u + e * v

    return form(x, y) - form(x0, y0)


def test_every_point_is_within_half_a_step_and_every_end_is_exact():
    for kind in conics.KINDS:
        blocks = conics.random_blocks(kind, 6, 150, np.random.default_rng(3))
        points, lasts, answers, _ = follow(blocks, 6)
        errors = []
        for block, path, last, answer in zip(blocks, points, lasts, answers, strict=True):
            assert answer == (1, 0)
            assert path[-1] == tuple(block[7:9])
            assert last == [0] * (len(path) - 2) + [1] * (len(path) > 1)
            assert np.abs(np.diff(path, axis=0)).max(initial=0) <= 1
            if len(path) > 2:
                errors.append(conics.distance(block[:5], block[5:7], np.array(path[1:-1])).max())
        assert 0.45 < max(errors) < 0.5 + 1e-9


def test_the_residual_is_the_curve_in_the_middle_ahead():
    """In every clock of every block: ⌊2·F(1, ½)⌋, from the definition of F."""
    blocks = draw_conics(WIDTH, 40, seed=4).tolist()
    _, _, _, seen = follow(blocks, WIDTH)
    compared = 0
    for block, rows in zip(blocks, seen, strict=True):
        # In the clock that ends the block it does not matter any more.
        for residual, x, y, steep, down_x, down_y in rows[:-1]:
            dx, dy = (-1 if down_x else 1), (-1 if down_y else 1)
            # Twice as large everywhere: the middle is a point of the grid.
            a, b, c, d, e, x0, y0 = block[:7]
            doubled = (a, b, c, 2 * d, 2 * e, 2 * x0, 2 * y0)
            middle = (2 * x + dx, 2 * y + 2 * dy) if steep else (2 * x + 2 * dx, 2 * y + dy)
            assert residual == value(doubled, *middle) // 2
            compared += 1
    assert compared > 300


def test_ellipses_with_centres_beside_the_grid_close():
    random = np.random.default_rng(6)
    blocks = []
    while len(blocks) < 60:
        r1, r2 = random.uniform(4, 25, 2)
        first = random.uniform(0, 360)
        if min(r1 * r1 / r2, r2 * r2 / r1) < 2.5:
            continue
        try:
            made = conics.ellipse(
                random.integers(-4, 5, 2).tolist(),
                (r1, r2),
                random.uniform(0, 180),
                WIDTH,
                start_angle=first,
                end_angle=first,
                clockwise=bool(random.integers(2)),
            )
        except conics.BadInputError:
            continue
        blocks.append(made.block)
    points, _, answers, _ = follow(blocks, WIDTH)
    for block, path, answer in zip(blocks, points, answers, strict=True):
        assert answer == (1, 0)
        assert path[-1] == path[0] == block[5:7]
        assert len(path) > 20
        off = conics.distance(np.array(block[:5]), np.array(block[5:7]), np.array(path))
        assert off.max() < 0.5 + 1e-9


def test_a_block_always_ends_whatever_it_is():
    random = np.random.default_rng(7)
    count = 400
    five = [random.integers(-(2**bits), 2**bits, count) for bits in (8, 8, 8, 13, 13)]
    places = random.integers(-16, 16, (4, count))
    rest = [random.integers(0, 2, count), random.integers(0, 9, count)]
    blocks = np.stack([*five, *places, *rest], axis=1)
    points, lasts, answers, _ = follow(blocks, 4)
    codes = {code for _, code in answers}
    assert codes == {0, 1, 2, 3}
    for block, path, last, (done, code) in zip(
        blocks.tolist(), points, lasts, answers, strict=True
    ):
        assert np.abs(np.array(path) + 0.5).max() <= 16
        if code == 3:
            assert len(path) == 1
        elif done:
            assert path[-1] == tuple(block[7:9])
        else:
            assert not any(last)


def test_what_is_refused_is_what_the_other_method_refuses():
    blocks = draw_conics(4, 64, seed=9, turns=4).tolist()
    points, _, answers, _ = follow(blocks, 4)
    assert [code for _, code in answers] == [fault(block) for block in blocks]
    for block, path in zip(blocks, points, strict=True):
        assert (len(path) == 1) == bool(fault(block) or is_empty(block))


def test_integers_arrays_and_the_named_values_agree():
    """Random states, reachable or not, one clock."""
    golden = ExactConic(WIDTH)
    random = np.random.default_rng(5)
    inputs = {f"blocks_{k}": (9, True) for k in "abc"} | {f"blocks_{k}": (15, True) for k in "de"}
    inputs |= {f"blocks_{name}": (6, True) for name in FIELDS[5:9]}
    inputs |= {"blocks_clockwise": (1, False), "blocks_turns": (11, False)}
    inputs |= {"blocks_valid": (1, False), "steps_ready": (1, False)}

    def draw(bits, signed):
        low = -(2 ** (bits - 1)) if signed else 0
        values = random.integers(low, low + 2**bits, 300)
        return np.where(random.random(300) < 0.3, random.integers(0, 2, 300) & (bits > 1), values)

    kinds = golden.registers()
    lanes = {name: draw(*kind) for name, kind in (kinds | inputs).items()}
    lanes["running"][::2] = 1
    state = {name: lanes[name] for name in kinds}
    after = golden.step(state, {name: lanes[name] for name in inputs})
    assert after.keys() == kinds.keys()
    for lane in range(300):
        one = golden.step(
            {name: int(values[lane]) for name, values in state.items()},
            {name: int(lanes[name][lane]) for name in inputs},
        )
        for name, (bits, signed) in kinds.items():
            low = -(2 ** (bits - 1)) if signed else 0
            assert one[name] == np.broadcast_to(after[name], 300)[lane], name
            assert low <= one[name] < low + 2**bits, name


@pytest.mark.parametrize("point", [(0, 0), (7, -3)])
def test_derivatives_are_those_at_the_start(point):
    """The prepared sums of a circle, by hand."""
    x, y = point
    block = (1, 0, 1, -2 * x, -2 * y, x + 5, y, x, y + 5, 0, 0)
    assert derivatives(block, (x + 5, y)) == (10, 0)
    golden, state = ExactConic(WIDTH), ExactConic(WIDTH).reset()
    given = {f"blocks_{name}": number for name, number in zip(FIELDS, block, strict=True)}
    for clock in range(golden.last_tick + 1):
        state = golden.step(state, given | {"blocks_valid": int(clock == 0), "steps_ready": 0})
    assert state["prepared"] == 1
    # y leads and x speeds up, from standing still: g = 0, h = −10, F(1, ½) = 4.5² + 1² − 5².
    assert (state["next_steep"], state["next_slows"]) == (1, 0)
    assert state["next_residual"] == -8
    assert (state["gx"], state["gy"]) == (6, -10 + 2)


def test_it_shares_nothing_with_what_it_checks():
    source = inspect.getsource(exact_conic)
    for word in ("from discreta.hdl", "import discreta.hdl", "import amaranth", "from amaranth"):
        assert word not in source
