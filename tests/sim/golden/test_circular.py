"""The golden model against the documents: the lecture's steps, every arc, circles as such.

What becomes of the lecture's algorithm as it is printed is shown in ``test_lecture.py``.
"""

import inspect
from itertools import pairwise, product
from math import atan2, degrees, isqrt

import numpy as np
import pytest
import z3

from discreta.sim.golden import circular
from discreta.sim.golden.circular import Circular
from discreta.sim.smt import symbols
from tests.arcs import arc_steps, crossed, draw_arcs, fault, is_empty, on_curve, seen, turn

FIELDS = ("start_x", "start_y", "end_x", "end_y", "center_x", "center_y", "clockwise", "full_turns")
VARIANTS = [
    {"order": order, "normalize": normalize, "preload": preload, "guard": guard}
    for order, normalize, preload, guard in product(
        ("alternated", "simultaneous"), (True, False), ("half", "zero"), (2, 0)
    )
]
LECTURE = {"order": "simultaneous", "normalize": False, "preload": "zero", "guard": 0}


def names(variant):
    return "-".join(map(str, variant.values()))


def given(blocks, valid):
    fields = {f"blocks_{name}": column for name, column in zip(FIELDS, blocks.T, strict=True)}
    return fields | {"blocks_valid": valid, "steps_ready": 1}


def run(golden, blocks, limit=20_000):
    """Run blocks side by side, each from reset; give all of their steps, answers and last states.

    Steps: (clock, point, last) of every block; answers: (clock, done, error).
    """
    blocks = np.array(blocks, dtype=np.int64)
    steps = [[] for _ in blocks]
    answers: list[tuple[int, int, int] | None] = [None for _ in blocks]
    points = blocks[:, :2].copy()
    state = {name: np.full(len(blocks), value) for name, value in golden.reset().items()}
    for clock in range(limit):
        out = golden.outputs(state)
        moves = np.flatnonzero(out["steps_valid"])
        points[moves] += np.stack([out["steps_x"], out["steps_y"]], axis=1)[moves]
        last = np.broadcast_to(out["steps_last"], len(blocks))
        for lane, point in zip(moves.tolist(), points[moves].tolist(), strict=True):
            steps[lane].append((clock, tuple(point), int(last[lane])))
        for lane in np.flatnonzero(out["done"] | out["error"]).tolist():
            assert answers[lane] is None
            answers[lane] = (clock, int(out["done"][lane]), int(out["error"][lane]))
        if None not in answers:
            return steps, answers, state
        state = golden.step(state, given(blocks, int(clock == 0)))
    late = blocks[answers.index(None)].tolist()
    raise AssertionError(f"no answer within {limit} clocks to {late}")


def lecture(start, end, modulus, order):
    """Run steps 8 to 10 of the lecture, X counted down; an axis with no steps left stops.

    The steps in their order, as a program takes them, add the new X to SY; the summators of the
    block diagram, which sum at the same clock pulse, add the old one. Gives (summations, x, y) of
    every step, and whether it waits for ever.
    """
    (x, y), (kox, koy) = start, (start[0] - end[0], end[1] - start[1])
    sx = sy = summations = 0
    steps = []
    while kox or koy:
        if (not kox or not y) and (not koy or not x):
            return steps, True
        summations += 1
        before = x, y
        if kox:
            carry, sx = divmod(sx + y, modulus)
            x, kox = x - carry, kox - carry
        if koy:
            carry, sy = divmod(sy + (x if order == "alternated" else before[0]), modulus)
            y, koy = y + carry, koy - carry
        if (x, y) != before:
            steps.append((summations, x, y))
    return steps, False


def arcs_of_quadrant_1(width):
    """Give start and end of every arc there that needs no processing."""
    numbers = range(2**width)
    for x, y in product(numbers, numbers):
        for xk, yk in product(range(x + 1), range(max(y, 1), 2**width)):
            block = (x, y, xk, yk, 0, 0, 0, 0)
            if x and (xk, yk) != (x, y) and on_curve(block):
                yield block


@pytest.mark.parametrize(
    ("width", "order"), [(4, "simultaneous"), (4, "alternated"), (5, "simultaneous")]
)
def test_the_lectures_algorithm(width, order):
    """Every arc of quadrant I: the same steps at the same summations, and an end where it hangs."""
    golden = Circular(width, **(LECTURE | {"order": order}))
    blocks = list(arcs_of_quadrant_1(width))
    assert len(blocks) > 500
    all_steps, _, _ = run(golden, blocks)
    hangs = 0
    for block, steps in zip(blocks, all_steps, strict=True):
        wanted, hung = lecture(block[:2], block[2:4], 2**width, order)
        # The first summation is in clock 2n + 6 and its step leaves in the next.
        taken = [(clock - 2 * width - 6, *point) for clock, point, _ in steps]
        assert taken[: len(wanted)] == wanted, block
        assert (len(taken) > len(wanted)) == hung, block
        assert steps[-1][1] == block[2:4]
        hangs += hung
    assert 0 < hangs < len(blocks) / 10


@pytest.mark.parametrize(
    ("variant", "block", "short"),
    [
        # Y is left when X has come to 0: one step short, along the axis that rises.
        (LECTURE, (9, 25, 0, 27, 0, 0, 0, 0), (0, 26)),
        (LECTURE, (26, -12, 0, 29, 0, 0, 0, 0), (0, 28)),
        ({}, (-16, 4, 0, -17, 0, 0, 0, 0), (0, -16)),
        ({}, (26, 10, 0, 28, 0, 0, 1, 1), (0, 27)),
        # X lies short of its end, and goes back at last: outwards again.
        (LECTURE, (-65, 10, -66, -5, 0, 0, 0, 0), (-65, -5)),
        ({}, (-8, 5, -10, -1, 0, 0, 0, 0), (-9, -1)),
        ({}, (12, 28, -4, 31, 0, 0, 0, 0), (-4, 30)),
        # An end in the centre.
        ({}, (4, -7, 3, -7, 3, -7, 0, 0), (4, -7)),
    ],
)
def test_completing_steps(variant, block, short):
    (steps,), answers, _ = run(Circular(8, **variant), [block])
    points = [block[:2], *(point for _, point, _ in steps)]
    assert points[-2:] == [short, block[2:4]]
    assert [last for *_, last in steps] == [0] * (len(steps) - 1) + [1]
    assert answers == [(steps[-1][0] + 1, 1, 0)]


@pytest.mark.parametrize("variant", VARIANTS, ids=names)
def test_every_step_of_all_kinds_of_arcs(variant):
    """Steps and their clocks as told piece by piece in the machine's own axes."""
    width = 6 if variant["normalize"] else 4
    blocks = draw_arcs(width, 120, seed=1, radius=7, turns=1).tolist()
    blocks = [block for block in blocks if not fault(block, width) and not is_empty(block)]
    all_steps, answers, _ = run(Circular(width, **variant), blocks)
    for block, steps, answer in zip(blocks, all_steps, answers, strict=True):
        assert_drawn(block, steps, answer, width, variant)


@pytest.mark.parametrize("variant", [VARIANTS[0], VARIANTS[11]], ids=names)
def test_every_step_at_32_bits(variant):
    # On Python's integers: the squares are too many bits for an array of NumPy's own numbers.
    golden = Circular(32, **variant)
    for block in draw_arcs(32, 16, seed=3, radius=9).tolist():
        state, steps, point = golden.reset(), [], list(block[:2])
        inputs = dict(zip((f"blocks_{name}" for name in FIELDS), block, strict=True))
        clock, out = 0, golden.outputs(state)
        for clock in range(2000):
            out = golden.outputs(state)
            if out["steps_valid"]:
                point = [point[0] + out["steps_x"], point[1] + out["steps_y"]]
                steps.append((clock, tuple(point), out["steps_last"]))
            if out["done"] or out["error"]:
                break
            valid = int(clock == 0)
            state = golden.step(state, inputs | {"blocks_valid": valid, "steps_ready": 1})
        answer = clock, out["done"], out["error"]
        if fault(block, 32) or is_empty(block):
            assert answer == (70, not fault(block, 32), fault(block, 32))
        else:
            assert_drawn(block, steps, answer, 32, variant)


def assert_drawn(block, steps, answer, width, variant):
    wanted = list(arc_steps(block, width=width, **variant))
    assert [(clock, point) for clock, point, _ in steps] == wanted, block
    assert [last for *_, last in steps] == [0] * (len(steps) - 1) + [1]
    assert answer == (steps[-1][0] + 1, 1, 0)
    assert steps[-1][1] == tuple(block[2:4])


def test_the_half_increment():
    """Half a summation of x is taken off before the first one, in a clock of its own."""
    golden = Circular(8)
    for start, shift in (((60, 80), 1), ((15, 8), 4), ((100, 0), 1), ((0, -1), 7), ((3, 90), 1)):
        state = golden.reset()
        block = (*start, *start, 0, 0, 0, 0)
        inputs = dict(zip((f"blocks_{name}" for name in FIELDS), block, strict=True))
        sums = []
        for clock in range(25):
            sums.append((state["sx"], state["sy"]))
            valid = int(clock == 0)
            state = golden.step(state, inputs | {"blocks_valid": valid, "steps_ready": 1})
        rising = min(map(abs, start)) if 0 in start else start[1]
        scaled = rising << shift
        falling = (max(map(abs, start)) if 0 in start else start[0]) << shift
        assert sums[22] == (512, 512)  # started in clock 21
        assert sums[23] == (512 - scaled // 2, 512)
        assert sums[24] == ((512 - scaled // 2 + scaled), 512 + falling)


def test_no_half_increment_elsewhere():
    for variant in VARIANTS:
        golden = Circular(8, **variant)
        halves = variant["order"] == "alternated" and variant["preload"] == "half"
        assert ("fresh" in golden.registers()) == halves


@pytest.mark.parametrize("variant", [VARIANTS[0], VARIANTS[3], LECTURE], ids=names)
def test_an_arc_turned_or_mirrored_makes_the_same_steps_turned_or_mirrored(variant):
    arcs = draw_arcs(5, 80, seed=4, radius=7, turns=1).tolist()
    arcs = [block for block in arcs if not fault(block, 5) and not is_empty(block)]
    # Around the origin, so that the range of coordinates makes no difference.
    arcs = [(*sum(seen(block), ()), 0, 0, 0, *block[7:]) for block in arcs]
    ways = list(product(range(4), (0, 1)))

    def moved(point, way):
        x, y = turn(point, way[0])
        return (x, -y) if way[1] else (x, y)

    blocks = [
        (*moved(arc[:2], way), *moved(arc[2:4], way), 0, 0, way[1], arc[7])
        for arc, way in product(arcs, ways)
    ]
    all_steps, answers, _ = run(Circular(5, **variant), blocks)
    for k, way in enumerate(ways):
        for steps, other in zip(all_steps[:: len(ways)], all_steps[k :: len(ways)], strict=True):
            assert other == [(clock, moved(point, way), last) for clock, point, last in steps]
        assert answers[k :: len(ways)] == answers[:: len(ways)]


def angle_swept(points):
    """Give the degrees that a path goes around the origin."""
    total = 0.0
    for (x, y), (u, v) in pairwise(points):
        total += degrees(atan2(x * v - y * u, x * u + y * v))
    return total


def test_turns_go_round_as_often_as_they_should():
    """Full turns are those of start = end; full_turns come on top, of these and of all others."""
    golden = Circular(6)
    points = [(5, 0), (0, -7), (3, 4), (-5, 12), (-9, -2), (8, -1)]
    blocks = [
        (*points[k], *points[other], 0, 0, clockwise, full)
        for k, clockwise, full in product(range(6), (0, 1), (0, 2))
        for other in (k, (k + 1) % 6)
        if on_curve((*points[k], *points[other], 0, 0, 0, 0))
    ]
    all_steps, _, _ = run(golden, blocks)
    for block, steps in zip(blocks, all_steps, strict=True):
        start, end, side = block[:2], block[2:4], -1 if block[6] else 1
        ahead = degrees(side * (atan2(end[1], end[0]) - atan2(start[1], start[0]))) % 360
        wanted = side * ((ahead or 360) + 360 * block[7])
        swept = angle_swept([start, *(point for _, point, _ in steps)])
        assert swept == pytest.approx(wanted, abs=1e-6), block
        assert steps[-1][1] == end


@pytest.mark.parametrize("variant", [VARIANTS[0], VARIANTS[11], LECTURE], ids=names)
def test_no_axis_rises_above_the_limit(variant):
    """⌊R⌋ + 1 is as far as a whole turn goes along an axis, and some go so far."""
    numbers = range(-5, 6)
    blocks = [
        (x, y, x, y, 0, 0, clockwise, 0)
        for x, y, clockwise in product(numbers, numbers, (0, 1))
        if x or y
    ]
    all_steps, _, _ = run(Circular(4, **variant), blocks)
    reached = 0
    for block, steps in zip(blocks, all_steps, strict=True):
        limit = isqrt(block[0] ** 2 + block[1] ** 2) + 1
        far = max(max(map(abs, point)) for _, point, _ in steps)
        assert far <= limit
        reached += far == limit
    assert reached > 20


def test_an_axis_at_the_limit_waits():
    """An arc of the lecture's machine that would go two steps beyond its circle."""
    block = (73, -12, 70, 25, 0, 0, 0, 0)
    (steps,), _, _ = run(Circular(8, **LECTURE), [block])
    xs = [x for _, (x, _), _ in steps]
    assert max(xs) == isqrt(73**2 + 12**2) + 1 == 74
    assert steps[-1][1] == (70, 25)


def test_what_is_refused_is_refused():
    """The codes of every arc of 4 bits around some centres."""
    centers = [(0, 0), (15, -16), (-13, 12)]
    blocks = [
        (*start, *end, *center, clockwise, full)
        for center in centers
        for start, end in product(near(center), near(center))
        for clockwise, full in ((0, 0), (1, 0), (0, 1))
        if (0, 0) not in seen((*start, *end, *center, 0, 0)) or start == end == center
    ]
    state = {name: np.zeros(len(blocks), dtype=np.int64) for name in Circular(4).registers()}
    for clock in range(13):
        state = Circular(4).step(state, given(np.array(blocks), int(clock == 0)))
    wanted = [fault(block, 4) for block in blocks]
    assert state["fault"].tolist() == wanted
    assert {wanted.count(code) > 500 for code in range(3)} == {True}
    for block, code, empty in zip(blocks, wanted, state["empty"].tolist(), strict=True):
        assert code or empty == is_empty(block)


def near(center):
    reach = range(-3, 4)
    points = [(center[0] + x, center[1] + y) for x, y in product(reach, reach)]
    return [point for point in points if all(-16 <= value < 16 for value in point)]


def test_turns_of_an_arc():
    """The crossings of the rules' own examples, and the clocks they take."""
    for block, crossings in (
        ((100, 0, 0, 100, 0, 0, 0, 0), 0),
        ((100, 0, 100, 0, 0, 0, 0, 0), 3),
        ((60, 80, 60, 80, 0, 0, 0, 0), 4),
        ((60, 80, 60, 80, 0, 0, 1, 2), 12),
    ):
        assert len(crossed(*seen(block))) + 4 * block[7] == crossings
        state = Circular(8).reset()
        inputs = dict(zip((f"blocks_{name}" for name in FIELDS), block, strict=True))
        for clock in range(22):
            valid = int(clock == 0)
            state = Circular(8).step(state, inputs | {"blocks_valid": valid, "steps_ready": 1})
        assert state["turns"] == crossings


@pytest.mark.parametrize("variant", [VARIANTS[0], VARIANTS[15]], ids=names)
def test_integers_arrays_and_bit_vectors_agree(variant):
    """Random states, reachable or not, one clock, in all three."""
    golden = Circular(6, **variant)
    random = np.random.default_rng(5)
    kinds = golden.registers()
    inputs = {f"blocks_{name}": (7, True) for name in FIELDS[:6]}
    inputs |= {"blocks_clockwise": (1, False), "blocks_full_turns": (8, False)}
    inputs |= {"blocks_valid": (1, False), "steps_ready": (1, False)}

    def draw(bits, signed):
        low = -(2 ** (bits - 1)) if signed else 0
        values = random.integers(low, low + 2**bits, 300)
        # Rare values lead everywhere: a counter at 0, the last crossing, the last clock.
        return np.where(random.random(300) < 0.3, random.integers(0, 2, 300) & (bits > 0), values)

    lanes = {name: draw(*kind) for name, kind in (kinds | inputs).items()}
    state = {name: lanes[name] for name in kinds}
    after = golden.step(state, {name: lanes[name] for name in inputs})
    wide = symbols(kinds | inputs, 2 * 6 + 8)
    formula = golden.step({k: wide[k] for k in kinds}, {k: wide[k] for k in inputs})
    assert formula.keys() == after.keys() == kinds.keys()
    for lane in range(300):
        one = golden.step(
            {name: int(values[lane]) for name, values in state.items()},
            {name: int(lanes[name][lane]) for name in inputs},
        )
        assert one == {name: int(values[lane]) for name, values in after.items()}
        for name, (bits, signed) in kinds.items():
            low = -(2 ** (bits - 1)) if signed else 0
            assert low <= one[name] < low + 2**bits, name
        if lane < 8:
            values = [
                (z3.BitVec(name, bits), z3.BitVecVal(int(lanes[name][lane]), bits))
                for name, (bits, _) in (kinds | inputs).items()
            ]
            for name, value in formula.items():
                assert z3.simplify(z3.substitute(value, *values)).as_signed_long() == one[name]


def test_it_shares_nothing_with_what_it_checks():
    source = inspect.getsource(circular)
    assert "discreta.hdl" not in source
    assert "import amaranth" not in source
    assert "from amaranth" not in source
