"""The golden model against the documents: steps by hand, definitions, circles and lines as such."""

import inspect
from fractions import Fraction
from functools import cache
from itertools import product
from math import hypot, isqrt

import numpy as np
import pytest
import z3

from discreta.sim import conics
from discreta.sim.golden import conic
from discreta.sim.golden.circular import Circular
from discreta.sim.golden.conic import Conic
from discreta.sim.golden.linear import Linear
from discreta.sim.smt import symbols
from tests.arcs import crossed, seen
from tests.conics import (
    FIELDS,
    LANDS,
    LECTURE,
    draw_conics,
    fault,
    is_empty,
    run_conics,
)

VARIANTS = [
    {"order": order, "preload": preload, "guard": guard}
    for order, preload, guard in product(
        ("implicit", "alternated", "simultaneous"), ("half", "zero"), (2, 0)
    )
]
ARC_FIELDS = (*FIELDS[5:9], "center_x", "center_y", "clockwise", "full_turns")


def names(variant):
    return "-".join(map(str, variant.values()))


def run(golden, blocks, fields=FIELDS, limit=100_000, watch=None):
    """Run blocks side by side, each from reset; give all of their steps and answers.

    Steps: (clock, point, last) of every block; answers: (clock, done, error). Every answer but one
    of a block is an error, and so is none within the limit. ``watch`` is called with every state.
    """
    blocks = np.array(blocks, dtype=np.int64)
    steps = [[] for _ in blocks]
    answers = [(-1, 0, 0) for _ in blocks]
    points = blocks[:, [fields.index("start_x"), fields.index("start_y")]]
    state = {
        name: np.full(len(blocks), value, dtype=np.int64) for name, value in golden.reset().items()
    }
    given = {f"blocks_{name}": column for name, column in zip(fields, blocks.T, strict=True)}
    for clock in range(limit):
        out = golden.outputs(state)
        moves = np.flatnonzero(out["steps_valid"])
        points[moves] += np.stack([out["steps_x"], out["steps_y"]], axis=1)[moves]
        last = np.broadcast_to(out["steps_last"], len(blocks))
        for lane, point in zip(moves.tolist(), points[moves].tolist(), strict=True):
            steps[lane].append((clock, tuple(point), int(last[lane])))
        for lane in np.flatnonzero(out["done"] | out["error"]).tolist():
            assert answers[lane][0] < 0, blocks[lane].tolist()
            answers[lane] = (clock, int(out["done"][lane]), int(out["error"][lane]))
        if watch:
            watch(state)
        if clock and not np.any(out["busy"]):
            silent = [block for block, answer in zip(blocks, answers, strict=True) if answer[0] < 0]
            assert not silent, f"no answer to {silent[0].tolist()}"
            return steps, answers
        state = golden.step(state, given | {"blocks_valid": int(clock == 0), "steps_ready": 1})
    raise AssertionError(f"{answers.count((-1, 0, 0))} are still busy after {limit} clocks")


def follow(golden, block, fields=FIELDS, limit=20_000):
    """Give the points of one block, on Python's integers, from its start on."""
    start = fields.index("start_x")
    state, points = golden.reset(), [block[start : start + 2]]
    inputs = dict(zip((f"blocks_{name}" for name in fields), block, strict=True))
    for clock in range(limit):
        out = golden.outputs(state)
        if out["steps_valid"]:
            x, y = points[-1]
            points.append((x + out["steps_x"], y + out["steps_y"]))
        if out["done"]:
            return points
        state = golden.step(state, inputs | {"blocks_valid": int(clock == 0), "steps_ready": 1})
    raise AssertionError(f"still busy after {limit} clocks")


def points_of(all_steps):
    return [[point for _, point, _ in steps] for steps in all_steps]


# By hand, in the lecture's order, with 4 bits: M = 2^14, and derivatives are shifted below it (to
# −M itself at the most). Of every clock pulse: x, y after it, and both sums in parts of M.

#: y² = 8x from its vertex, clockwise: x' = Gy = 2y and y' = −Gx = 8.
PARABOLA = (0, 0, 1, -8, 0, 0, 0, 8, 8, 1, 0)
PARABOLA_PULSES = [
    # Gx = −8 is shifted by 11 to −M: y steps in every summation, and x adds y/4.
    (0, 1, "0", "0"),
    (0, 2, "1/4", "0"),
    (0, 3, "3/4", "0"),
    (1, 4, "1/2", "0"),  # 3/4 + 3/4
    # Gy = 8 is shifted by 10, so that y adds 1/2 and x adds y/8.
    (2, 4, "0", "1/2"),
    (2, 5, "1/2", "0"),
    (3, 5, "1/8", "1/2"),
    (3, 6, "3/4", "0"),
    (4, 6, "1/2", "1/2"),
    (5, 7, "1/4", "0"),
    (6, 7, "1/8", "1/2"),
    (7, 8, "0", "0"),
    # y is at its end: 16 alone is shifted by 9.
    (7, 8, "1/2", "0"),
    (8, 8, "0", "0"),
]

#: x² − xy + y² = 16, a turned ellipse: x' = x − 2y and y' = 2x − y. A borrow, and a turn round.
ELLIPSE = (1, -1, 1, 0, 0, 4, 0, 2, 5, 0, 1)
ELLIPSE_PULSES = [
    # (x', y') = (4, 8) are shifted by 10.
    (4, 0, "1/4", "1/2"),
    (4, 1, "1/2", "0"),
    # (2, 7) by 11.
    (4, 1, "3/4", "7/8"),
    (5, 2, "0", "3/4"),
    # (1, 8) by 10.
    (5, 3, "1/16", "1/4"),
    # (−1, 7): x turns round in a clock of its own. Then by 11: 1/16 − 1/8 borrows.
    (5, 3, "1/16", "1/4"),
    (4, 4, "15/16", "1/8"),
    # (−4, 4) by 11.
    (4, 4, "7/16", "5/8"),
    (3, 5, "15/16", "1/8"),
    # (−7, 1), and y is at its end.
    (3, 5, "1/16", "1/8"),
    (2, 5, "3/16", "1/8"),
]


@pytest.mark.parametrize(
    ("block", "pulses"),
    [(PARABOLA, PARABOLA_PULSES), (ELLIPSE, ELLIPSE_PULSES)],
    ids=("parabola", "ellipse"),
)
def test_the_lectures_summations_by_hand(block, pulses):
    golden = Conic(4, **LECTURE)
    inputs = dict(zip((f"blocks_{name}" for name in FIELDS), block, strict=True))
    state, rows = golden.reset(), []
    for clock in range(9 + len(pulses) + 3):
        out = golden.outputs(state)
        rows.append((state["p1"], state["p2"], state["sx"], state["sy"], out["done"]))
        state = golden.step(state, inputs | {"blocks_valid": int(clock == 0), "steps_ready": 1})
    # It is started in clock 8, and what the pulse of clock 9 makes is there in clock 10.
    wanted = [(x, y, *(Fraction(part) * 2**14 for part in parts)) for x, y, *parts in pulses]
    assert [row[:4] for row in rows[10 : 10 + len(pulses)]] == wanted
    assert rows[9][:4] == (*block[5:7], 0, 0)
    # The last step leaves in the clock after its pulse, and ``done`` follows it.
    assert [row[4] for row in rows[10:]] == [0] * len(pulses) + [1, 0]


@pytest.mark.parametrize("variant", [VARIANTS[k] for k in (0, 3, 5, 8, 11)], ids=names)
def test_every_step_of_all_kinds_of_curves(variant):
    """Steps, their clocks and the answers, as told from the definitions alone."""
    blocks = draw_conics(4, 40, seed=1, turns=2).tolist()
    all_steps, answers = run(Conic(4, **variant), blocks)
    for block, steps, answer in zip(blocks, all_steps, answers, strict=True):
        (wanted,) = run_conics([block], width=4, **variant)
        assert [(clock, point) for clock, point, _ in steps] == wanted.steps, block
        assert [last for *_, last in steps] == [0] * (len(steps) - 1) + [1] * bool(steps)
        assert answer == (wanted.answered, int(not wanted.code), wanted.code)
    kinds = [answer[2] for answer in answers]
    assert kinds.count(3) == 5
    assert sum(map(bool, all_steps)) == 30


@pytest.mark.parametrize(("width", "variant"), [(4, {}), (6, LECTURE)])
def test_the_derivatives_are_what_they_are_defined_as(width, variant):
    """Along whole runs, at every clock: not a bit of what is added up is lost."""
    blocks = np.array(
        [
            block
            for block in draw_conics(width, 80, seed=2, turns=2).tolist()
            if not fault(block) and not is_empty(block)
        ]
    )
    compared = np.zeros(len(blocks), dtype=np.int64)

    a, b, c, d, e = blocks.T[:5]

    def watch(state):
        x, y = state["p1"], state["p2"]
        running = state["running"] == 1
        assert np.array_equal(state["gx"][running], (2 * a * x + b * y + d)[running])
        assert np.array_equal(state["gy"][running], (b * x + 2 * c * y + e)[running])
        compared[:] += running

    run(Conic(width, **variant), blocks, watch=watch)
    assert compared.min() > 0
    assert compared.sum() > 15 * len(blocks)


# Its special cases


def circles(radii):
    """Give arcs about the origin as blocks of the circular method, then of this one."""
    arcs = []
    for r in radii:
        starts = [(r, 0), (0, r), (-r, 0), (0, -r), (round(0.6 * r), -round(0.8 * r))]
        for k, (x, y) in enumerate(starts):
            for clockwise in (0, 1):
                # A quarter, half, three quarters, and the whole of it.
                quarters = (r + k + clockwise) % 4
                way = -1 if clockwise else 1
                end = [(x, y), (-way * y, way * x), (-x, -y), (way * y, -way * x)][quarters]
                arcs.append((x, y, *end, 0, 0, clockwise, 0))
    return arcs, [(1, 0, 1, 0, 0, *arc[:4], arc[6], len(crossed(*seen(arc)))) for arc in arcs]


@pytest.mark.parametrize("variant", [VARIANTS[0], VARIANTS[7], VARIANTS[9]], ids=names)
def test_a_circle_is_the_circle_of_the_circular_method(variant):
    """The same points, in all quadrants and both directions, where both have one rule.

    The circular method lets no axis go a whole step beyond the circle, and here a derivative of
    −2^k is shifted a place farther than one of 2^k. Circles with any of these are left out.
    """
    arcs, blocks = circles((5, 6, 7, 9, 10, 11, 12, 13))
    ordered = variant["order"] != "simultaneous"
    # One bit more: then half an increment is a whole number there, too.
    twin = Circular(9, **(variant | {"order": "alternated"} if ordered else variant))
    theirs = points_of(run(twin, arcs, ARC_FIELDS)[0])
    ours = points_of(run(Conic(8, **variant), blocks)[0])
    compared = set()
    for arc, own, other in zip(arcs, ours, theirs, strict=True):
        largest = [max(map(abs, point)) for point in (arc[:2], *other)]
        limited = max(largest) > isqrt(arc[0] ** 2 + arc[1] ** 2)
        powers = any(number & (number - 1) == 0 for number in largest)
        if not limited and not powers:
            assert own == other, arc
            compared.add((round(hypot(*arc[:2])), arc[6], bool(arc[0] and arc[1])))
    assert len(compared) >= 7
    assert {clockwise for _, clockwise, _ in compared} == {0, 1}


@pytest.mark.parametrize("variant", [VARIANTS[0], LECTURE], ids=names)
def test_a_quarter_of_radius_100_and_a_line_of_200_by_99(variant):
    """As the circular and the linear method draw them in the same settings."""
    ordered = variant["order"] != "simultaneous"
    twin = Circular(8, **(variant | {"order": "alternated"} if ordered else variant))
    theirs = follow(twin, (100, 0, 0, 100, 0, 0, 0, 0), ARC_FIELDS)
    quarter = (1, 0, 1, 0, 0, 100, 0, 0, 100, 0, 0)
    assert follow(Conic(8, **variant), quarter) == theirs
    theirs = follow(Linear(8, preload=variant["preload"]), (0, 0, 200, 99), FIELDS[5:9])
    line = (0, 0, 0, 99, -200, 0, 0, 200, 99, 0, 0)
    assert follow(Conic(8, **(variant | {"guard": 0})), line) == theirs


@pytest.mark.parametrize("preload", ["half", "zero"])
def test_a_line_is_the_line_of_the_linear_method(preload):
    """With no guard bits the same points in the same clocks from the first one, in any order.

    But for lengths of 2^k: a derivative of −2^k is shifted a place farther than one of 2^k.
    """
    random = np.random.default_rng(7)
    ends = np.concatenate([random.integers(-40, 41, (60, 2)), [[0, 9], [-7, 0]]])
    longest = np.abs(ends).max(axis=1)
    ends = ends[longest & (longest - 1) != 0]
    starts = random.integers(np.maximum(-ends, 0) - 256, 256 - np.maximum(ends, 0))
    lines = np.hstack([starts, starts + ends])
    theirs, _ = run(Linear(9, preload=preload), lines, FIELDS[5:9])
    for order in ("implicit", "alternated", "simultaneous"):
        blocks = [
            # Along (−E, D), or clockwise the opposite.
            (0, 0, 0, *((y, -x) if k % 2 == 0 else (-y, x)), *line, k % 2, 0)
            for k, ((x, y), line) in enumerate(zip(ends.tolist(), lines.tolist(), strict=True))
        ]
        ours, _ = run(Conic(8, order=order, preload=preload, guard=0), blocks)
        assert points_of(ours) == points_of(theirs)
        for own, other in zip(ours, theirs, strict=True):
            first, second = own[0][0], other[0][0]
            assert [step[0] - first for step in own] == [step[0] - second for step in other]


#: Section 6.2 of the design: the largest radial error of all quarters with R < 2^12, in steps.
QUARTER_ERRORS = {
    ("simultaneous", "zero"): 1.80,
    ("simultaneous", "half"): 1.28,
    ("alternated", "zero"): 1.48,
    ("alternated", "half"): 0.95,
}


@pytest.mark.parametrize("order_preload", QUARTER_ERRORS, ids="-".join)
def test_quarter_circles_are_as_true_as_the_circular_methods(order_preload):
    order, preload = order_preload
    blocks = [(1, 0, 1, 0, 0, r, 0, 0, r, 0, 0) for r in range(4, 128)]
    all_steps, _ = run(Conic(8, order=order, preload=preload, guard=0), blocks)
    errors = [
        max(abs(hypot(*point) - r) for point in points)
        for r, points in enumerate(points_of(all_steps), start=4)
    ]
    assert max(errors) <= QUARTER_ERRORS[order_preload]
    assert max(errors) > 0.6


# The errata of the lecture

#: A turned ellipse about a point beside the origin.
TURNED = conics.ellipse((3, -4), (40, 20), 30, 6).block


def integrated(first, second):
    """Follow (x', y') around with small steps of Runge and Kutta, and give all points."""
    start = np.array(TURNED[5:7], dtype=float)

    def speed(p):
        way = np.array([first(*p), second(*p)])
        return way / hypot(*way)

    points, h = [start], 0.15
    for _ in range(1000):
        p = points[-1]
        middle = speed(p + h / 2 * speed(p))
        points.append(p + h * middle)
    return np.array(points)


def farthest(points):
    five, start = np.array(TURNED[:5], dtype=object), np.array(TURNED[5:7])
    return conics.distance(five, start, np.asarray(points)).max()


def test_the_printed_derivatives_lead_off_the_curve():
    """(By + 2Cy + E) once stands for (Bx + 2Cy + E), and one of the two signs is lost."""
    a, b, c, d, e = TURNED[:5]

    def gx(x, y):
        return 2 * a * x + b * y + d

    def gy(x, y):
        return b * x + 2 * c * y + e

    assert farthest(integrated(lambda x, y: -gy(x, y), gx)) < 0.01
    assert farthest(integrated(lambda _, y: -(b * y + 2 * c * y + e), gx)) > 5
    assert farthest(integrated(gy, gx)) > 5
    assert farthest(integrated(lambda x, y: -gy(x, y), lambda x, y: -gx(x, y))) > 5
    assert farthest(follow(Conic(6), TURNED)) < 1.4


# What a turn does


def areas_of_turns(points, center):
    """Give the area inside each turn of a path."""
    x, y = (np.array(points) - center).T
    turn = np.unwrap(np.arctan2(y, x)) / (2 * np.pi)
    turn -= turn[0]
    loops = [np.flatnonzero((turn >= k) & (turn < k + 1)) for k in range(round(turn[-1]))]
    return [
        np.sum(x[loop] * np.roll(y[loop], -1) - y[loop] * np.roll(x[loop], -1)) / 2
        for loop in loops
    ]


def test_the_area_of_a_turn():
    """Simultaneous summation lets it grow, an alternated one shrink if B ≠ 0; implicit keeps it."""
    turned = conics.ellipse((0, 0), (30, 15), 30, 6, full_turns=9).block
    upright = conics.ellipse((0, 0), (30, 15), 0, 6, full_turns=1).block
    assert turned[1]
    five, start = np.array(turned[:5], dtype=object), np.array(turned[5:7])
    errors = {}
    for order, least, most in (
        ("simultaneous", 1.5, np.inf),
        ("alternated", 0, 0.8),
        ("implicit", 0.95, 1.05),
    ):
        points = follow(Conic(6, order=order, guard=0), turned)
        areas = areas_of_turns(points, (0, 0))
        assert len(areas) == 10
        assert areas[0] == pytest.approx(450 * np.pi, rel=0.15)
        # The last one ends where the block does.
        assert least < areas[8] / areas[0] < most, order
        errors[order] = conics.distance(five, start, np.array(points[-len(points) // 9 :])).max()
    assert errors["implicit"] < 1.5
    assert min(errors["simultaneous"], errors["alternated"]) > 2
    # Where B = 0 both are one rule.
    path = follow(Conic(6, order="alternated", guard=0), upright)
    assert path == follow(Conic(6, guard=0), upright)
    first, second = areas_of_turns(path, (0, 0))
    assert second == pytest.approx(first, rel=0.05)


# The end


def test_a_block_ends_on_its_end_point_whatever_its_turns():
    """Right ones, too many, too few, and none: one answer, and the last step is on the end."""
    blocks = draw_conics(4, 240, seed=3, turns=2)
    blocks = np.repeat([block for block in blocks.tolist() if not fault(block)], 4, axis=0)
    blocks[1::4, 10] += 1
    blocks[2::4, 10] += 3
    blocks[3::4, 10] = np.maximum(blocks[3::4, 10] - 1, 0)
    all_steps, answers = run(Conic(4, guard=0), blocks)
    stood = 0
    for k, (steps, answer) in enumerate(zip(all_steps, answers, strict=True)):
        block = blocks[k].tolist()
        assert answer[1:] == (1, 0), block
        point = steps[-1][1] if steps else tuple(block[5:7])
        assert point == tuple(block[7:9]), block
        lasts = [last for *_, last in steps]
        # It ends with a step or, with wrong turns, where it stands.
        with_a_step = bool(steps) and answer[0] == steps[-1][0] + 1
        assert lasts == [0] * (len(steps) - 1) + [int(with_a_step)] * bool(steps)
        if k % 4 == 0 and not is_empty(block):
            assert with_a_step
        stood += not with_a_step and not is_empty(block)
    assert stood > 0


def test_a_step_that_lands_on_the_end_is_the_last_with_a_change_of_direction_to_come():
    (steps,), answers = run(Conic(8), [LANDS])
    assert steps[-1][1:] == ((-232, -63), 1)
    assert answers == [(steps[-1][0] + 1, 1, 0)]


@pytest.mark.parametrize("width", [4, 8, 12])
def test_a_line_of_the_smallest_derivatives(width):
    """Gx = Gy = −1 are shifted as far as there are places, which is no change of the scale."""
    points = follow(Conic(width), (0, 0, 0, -1, -1, 0, 0, 15, -15, 0, 0))
    assert points == [(k, -k) for k in range(16)]


@cache
def whole_ellipses():
    return [
        conics.ellipse(
            (2, -3), axes, angle, 5, start_angle=first, end_angle=first, clockwise=clockwise
        ).block
        for axes, angle, first in product(((14, 7), (7, 12)), (30, 135), (50,))
        for clockwise in (False, True)
    ]


@pytest.mark.parametrize("variant", [{}, LECTURE, {"order": "alternated", "guard": 0}], ids=str)
def test_whole_turned_ellipses_close(variant):
    blocks = whole_ellipses()
    all_steps, _ = run(Conic(5, **variant), blocks)
    for block, points in zip(blocks, points_of(all_steps), strict=True):
        assert points[-1] == block[5:7] == block[7:9]
        x, y = (np.array([block[5:7], *points]) - (2, -3)).T
        angle = np.unwrap(np.arctan2(y, x))
        assert angle[-1] - angle[0] == pytest.approx((-1 if block[9] else 1) * 2 * np.pi)


def test_which_blocks_are_refused():
    """Those without a direction at the start, or nearer to where there is none than four steps."""
    blocks = []
    for a, b, c, x, y in product((-3, 0, 3), (-2, 0, 1), (0, 2), (-8, 5), (-1, 7)):
        for gx, gy in ((0, 0), (4, 0), (-7, 12), (12, -8), (-13, 12), (24, -1)):
            five = (a, b, c, gx - 2 * a * x - b * y, gy - b * x - 2 * c * y)
            blocks += [(*five, x, y, *end, 0, turns) for end, turns in (((x, y), 0), ((0, 0), 1))]
    golden = Conic(4)
    array = np.array(blocks, dtype=np.int64)
    state = {name: np.full(len(blocks), value) for name, value in golden.reset().items()}
    given = {f"blocks_{name}": column for name, column in zip(FIELDS, array.T, strict=True)}
    for clock in range(8):
        state = golden.step(state, given | {"blocks_valid": int(clock == 0), "steps_ready": 1})
    wanted = [fault(block) for block in blocks]
    assert state["fault"].tolist() == wanted
    assert wanted.count(3) > 150
    runs = [not fault(block) and not is_empty(block) for block in blocks]
    assert sum(runs) > 150


@pytest.mark.parametrize("variant", [VARIANTS[0], VARIANTS[11]], ids=names)
def test_integers_arrays_and_bit_vectors_agree(variant):
    """Random states, reachable or not, one clock, in all three."""
    golden = Conic(5, **variant)
    random = np.random.default_rng(5)
    kinds = golden.registers()
    inputs = {f"blocks_{name}": (9, True) for name in FIELDS[:3]}
    inputs |= {f"blocks_{name}": (15, True) for name in FIELDS[3:5]}
    inputs |= {f"blocks_{name}": (6, True) for name in FIELDS[5:9]}
    inputs |= {"blocks_clockwise": (1, False), "blocks_turns": (11, False)}
    inputs |= {"blocks_valid": (1, False), "steps_ready": (1, False)}

    def draw(bits, signed):
        low = -(2 ** (bits - 1)) if signed else 0
        values = random.integers(low, low + 2**bits, 200)
        # Rare values lead everywhere: a counter at 0, the last piece, the last clock.
        return np.where(random.random(200) < 0.3, random.integers(0, 2, 200) & (bits > 1), values)

    lanes = {name: draw(*kind) for name, kind in (kinds | inputs).items()}
    lanes["running"][::2], lanes["tick"][::2] = 1, 0
    state = {name: lanes[name] for name in kinds}
    after = golden.step(state, {name: lanes[name] for name in inputs})
    wide = symbols(kinds | inputs, 17 + 2 + 6)
    formula = golden.step({k: wide[k] for k in kinds}, {k: wide[k] for k in inputs})
    assert formula.keys() == after.keys() == kinds.keys()
    for lane in range(200):
        one = golden.step(
            {name: int(values[lane]) for name, values in state.items()},
            {name: int(lanes[name][lane]) for name in inputs},
        )
        assert one == {name: int(values[lane]) for name, values in after.items()}
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
    source = inspect.getsource(conic)
    assert "from discreta.hdl" not in source
    assert "import discreta.hdl" not in source
    assert "import amaranth" not in source
    assert "from amaranth" not in source
