from math import atan2, hypot, isqrt, pi, tau

import numpy as np
import pytest

from discreta.hdl.circular import Circular
from discreta.sim.arcs import (
    OFF_CURVE,
    RANGE,
    crossings,
    is_empty,
    limits,
    reaches,
    refusals,
    swept,
)
from discreta.sim.simulate import simulate
from discreta.sim.stretch import EVENT_COLUMNS

WIDTH = 4
#: Far below what angles and radii of points of few bits can differ by.
TINY = 1e-9


def sample(count, seed, *, turns=(0, 0, 0, 1, 2, 255)):
    """Draw arcs of four bits whose ends are on the circle, near it, and anywhere."""
    random = np.random.default_rng(seed)
    low, high = -(1 << WIDTH), (1 << WIDTH) - 1
    center = random.integers(low, high + 1, (count, 2))
    near = center + random.integers(low // 2, high // 2 + 1, (count, 2))
    start = np.where(random.random((count, 1)) < 0.8, near, random.integers(low, high, (count, 2)))
    start = np.clip(start, low, high)
    seen = start - center
    radius = np.hypot(*seen.T) + random.choice([0, 0, 0.7, -0.7, 1.5, -1.5], count)
    angle = random.uniform(0, tau, count)
    about = np.rint(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))
    # Mirrored or not, a point is on the circle exactly.
    exact = np.where(random.random((count, 1)) < 0.5, seen, seen[:, ::-1])
    exact = exact * random.choice([-1, 1], (count, 2))
    anywhere = random.integers(low, high, (count, 2)) - center
    ends = np.stack([about.astype(np.int64), exact, seen, anywhere, np.zeros_like(seen)])
    end = center + ends[random.choice(5, count, p=[0.5, 0.35, 0.08, 0.06, 0.01]), np.arange(count)]
    start = np.where(random.random((count, 1)) < 0.02, center, start)
    return np.column_stack(
        [
            start,
            np.clip(end, low, high),
            center,
            random.integers(0, 2, count),
            random.choice(turns, count),
        ]
    )


def by_angle(block):
    """Give, in floating point, whether +x, +y, −x, −y are crossed, and the angle of one turn."""
    xh, yh, xk, yk, xc, yc, clockwise, _ = block
    way = -1 if clockwise else 1
    begin = atan2(yh - yc, xh - xc)
    sweep = way * (atan2(yk - yc, xk - xc) - begin) % tau
    if sweep < TINY or sweep > tau - TINY:
        sweep = tau
    ahead = [way * (axis * pi / 2 - begin) % tau for axis in range(4)]
    return [TINY < angle < min(sweep, tau) - TINY for angle in ahead], sweep


def by_rule(block):
    """Give what the rules say of a block, in floating point; an end off the circle has no angle."""
    xh, yh, xk, yk, xc, yc, _, full_turns = block
    modulus = 1 << WIDTH
    if any(abs(far) >= modulus for far in (xh - xc, yh - yc, xk - xc, yk - yc)):
        return RANGE
    if (xh, yh) == (xk, yk) == (xc, yc):
        return 0
    radius, away = hypot(xh - xc, yh - yc), hypot(xk - xc, yk - yc)
    if not radius or abs(radius - away) > 1 + TINY:
        return OFF_CURVE
    limit = int(radius + TINY) + 1
    ends = (xc + limit, yc + limit, xc - limit, yc - limit)
    gone = [end for end, axis in zip(ends, by_angle(block)[0], strict=True) if axis or full_turns]
    too_far = limit >= modulus or not all(-modulus <= end < modulus for end in gone)
    return RANGE if gone and too_far else 0


def test_against_angles_and_radii():
    blocks = sample(30_000, 1)
    codes, counts, angles = refusals(blocks, WIDTH), crossings(blocks), swept(blocks)
    reached, crossed = reaches(blocks)
    drawn = 0
    for index, block in enumerate(blocks.tolist()):
        xh, yh, xk, yk, xc, yc, clockwise, full_turns = block
        if (xk, yk) == (xc, yc) != (xh, yh):
            continue  # the centre has no angle
        expected = by_rule(block)
        # Of an arc that ends off the circle it is not said where it goes.
        assert codes[index] in ((RANGE, OFF_CURVE) if expected == OFF_CURVE else (expected,))
        if expected or (xh, yh) == (xc, yc):
            continue
        drawn += 1
        axes, sweep = by_angle(block)
        assert counts[index] == sum(axes) + 4 * full_turns
        assert crossed[index].tolist() == [bool(axis or full_turns) for axis in axes]
        limit = int(hypot(xh - xc, yh - yc) + TINY) + 1
        assert reached[index].tolist() == [xc + limit, yc + limit, xc - limit, yc - limit]
        assert abs(angles[index]) == pytest.approx(360 * (sweep / tau + full_turns))
        assert (angles[index] < 0) == clockwise
    assert drawn > 5000
    assert all(np.count_nonzero(codes == code) > 1000 for code in (0, RANGE, OFF_CURVE))


@pytest.mark.usefixtures("compiled_engine")
def test_the_device_refuses_the_same():
    """Also where the angle tells nothing: ends off the circle, and in the centre."""
    blocks = sample(5_000, 2, turns=(0, 0, 0, 0, 1, 2))
    codes = []
    core = Circular(WIDTH, guard=0)
    for stretch in simulate(core, blocks, limit=400 * len(blocks), engine="compiled"):
        done, error = (stretch.events[:, EVENT_COLUMNS.index(name)] for name in ("done", "error"))
        codes += error[(done == 1) | (error != 0)].tolist()
    np.testing.assert_array_equal(refusals(blocks, WIDTH), codes)


# start, end, clockwise; crossings, degrees
CASES = {
    "a quarter": ((100, 0), (0, 100), 0, 0, 90),
    "a quarter, clockwise": ((0, 100), (100, 0), 1, 0, -90),
    "three quarters": ((0, 100), (100, 0), 0, 2, 270),
    "half, from axis to axis": ((100, 0), (-100, 0), 0, 1, 180),
    "half, between the axes": ((60, 80), (-60, -80), 1, 2, -180),
    "full, from an axis": ((100, 0), (100, 0), 0, 3, 360),
    "full, from another": ((0, -100), (0, -100), 1, 3, -360),
    "full, between the axes": ((60, 80), (60, 80), 0, 4, 360),
    "full, the end a step off": ((100, 0), (101, 0), 0, 3, 360),
    "ahead in its quadrant": ((80, 60), (60, 80), 0, 0, 16.2602),
    "behind in its quadrant": ((80, 60), (60, 80), 1, 4, -343.7398),
    "just ahead": ((80, 60), (79, 61), 0, 0, 0.8037),
    "just behind": ((79, 61), (80, 60), 0, 4, 359.1963),
    "no length": ((0, 0), (0, 0), 0, 0, 0),
}


@pytest.mark.parametrize("full_turns", [0, 1, 255])
@pytest.mark.parametrize("center", [(0, 0), (-7, 3)])
@pytest.mark.parametrize(("start", "end", "clockwise", "count", "angle"), CASES.values(), ids=CASES)
def test_known_arcs(start, end, clockwise, count, angle, center, full_turns):
    x, y = center
    block = [start[0] + x, start[1] + y, end[0] + x, end[1] + y, x, y, clockwise, full_turns]
    blocks = np.array([block])
    empty = not any(start)
    assert is_empty(blocks) == empty
    assert crossings(blocks) == (0 if empty else count + 4 * full_turns)
    turns = 0 if empty else -full_turns if clockwise else full_turns
    assert swept(blocks)[0] == pytest.approx(angle + 360 * turns, abs=1e-4)
    assert refusals(blocks, 8) == 0
    if not empty:
        assert limits(blocks) == (100 if start == (79, 61) else 101)  # its radius is 99.8


def test_the_largest_arcs_are_exact():
    """At 32 bits neither squares nor products fit 64 bits; a step decides."""
    far = 2**32 - 1
    radius = isqrt(far * far // 2)
    quarter = [radius, radius, -radius, radius, 0, 0, 0, 0]
    # One step along a diagonal is √2: too far off. Along an axis from there it is not.
    off, on = list(quarter), list(quarter)
    off[2], off[3], on[3] = -radius - 1, radius + 1, radius + 1
    # The limit of a radius of 2^32 − 1 is one too many, if it is needed.
    whole = [far, 0, far, 0, 0, 0, 0, 0]
    one_quadrant = [far, 0, 0, far, 0, 0, 0, 0]
    less = [far - 1, 0, far - 1, 0, 0, 0, 1, 0]
    blocks = np.array([quarter, off, on, whole, one_quadrant, less])
    assert refusals(blocks, 32).tolist() == [0, OFF_CURVE, 0, RANGE, 0, 0]
    assert crossings(blocks).tolist() == [1, 1, 1, 3, 0, 3]
    assert limits(blocks).tolist()[3:] == [far + 1, far + 1, far]
    # Ahead and behind by a single step, of 4·10^9 to the centre.
    ahead = [radius, radius, radius - 1, radius + 1, 0, 0, 0, 0]
    behind = [radius - 1, radius + 1, radius, radius, 0, 0, 0, 0]
    seen = swept(np.array([ahead, behind]))
    assert seen[0] == pytest.approx(np.degrees(1 / radius), rel=1e-6)
    assert 359.9999999 < seen[1] < 360
    assert crossings(np.array([ahead, behind])).tolist() == [0, 4]


@pytest.mark.parametrize("radius", [1, 5, 2**16, 2**31])
def test_an_end_may_be_off_by_just_one_step(radius):
    """Radii R and R + 1, and then one more in the square: outwards, and back inwards."""
    for point, code in (((0, radius + 1), 0), ((1, radius + 1), OFF_CURVE)):
        outwards = [radius, 0, *point, 0, 0, 0, 0]
        inwards = [*point, radius, 0, 0, 0, 1, 0]
        assert refusals(np.array([outwards, inwards]), 32).tolist() == [code, code]
