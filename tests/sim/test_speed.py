# amaranth: UnusedElaboratable=no
# (A model that is found in the cache is not built again.)
"""What is measured of the speed: against closed values, and seen to tell a bad rule."""

from math import ceil, pi, sqrt

import numpy as np
import pytest

from discreta.hdl.comparison import Comparison
from discreta.hdl.linear import Linear
from discreta.sim import speed
from discreta.sim.constant_speed import paced
from discreta.sim.speed import (
    DEVICE,
    MOVES,
    RULES,
    Rule,
    accuracy,
    along_path,
    drift,
    helices,
    limits,
    move_beginnings,
    step_clocks,
)

pytestmark = pytest.mark.usefixtures("optimized_engine")

PAIRING, EXERCISE, _ = RULES

#: Of the octagon with 362/256 for √2, in %.
SLOWEST, FASTEST = -7.62, 0.03

#: Short lines, so that few clocks are run; longer ones have more of the same windows.
LENGTH = 60


def deviation_at_45_degrees(pause):
    """Give by how much a diagonal step is too fast, in %, with a pause in 1/256."""
    return 100 * (256 * sqrt(2) / pause - 1)


def test_the_default_keeps_the_speed_within_the_octagon():
    rows = along_path(PAIRING, degrees=(0, 23, 45, 112, 200, 300), radii=(), length=LENGTH)
    assert [row.what for row in rows] == [
        f"lines, {first} to {first + 90} degrees" for first in (0, 90, 180, 270)
    ]
    for row in rows:
        assert SLOWEST < row.smallest <= row.largest < FASTEST
    # 23 degrees is as good as the worst there is, 22.5.
    assert rows[0].smallest < -7.5
    assert rows[0].largest == pytest.approx(deviation_at_45_degrees(362), abs=1e-3)
    assert rows[0].smallest_at.startswith("line of 23 degrees, from (")
    assert rows[0].largest_at.startswith("line of 45 degrees, from (")


def test_the_rule_of_the_exercise_is_worse():
    line, circle = along_path(EXERCISE, degrees=(40, 45), radii=(40,), length=LENGTH)
    assert line.smallest < -10
    assert line.largest == pytest.approx(deviation_at_45_degrees(358), abs=1e-3)
    # Of a circle x and y come one after the other, and each is paid in full.
    assert circle.what == "circles, R = 40"
    assert circle.smallest < -20
    assert circle.windows > 100


def test_a_pause_that_is_too_short_is_seen():
    (row,) = along_path(
        Rule("too short", (256, 300), pairing=True), degrees=(0, 45), radii=(), length=LENGTH
    )
    assert row.smallest == pytest.approx(0, abs=1e-9)
    assert row.largest == pytest.approx(deviation_at_45_degrees(300), abs=1e-3)
    assert row.largest > FASTEST
    # The first move is left out, and the last one has no end.
    assert row.windows == sum(moves - 1 - MOVES for moves in (LENGTH, round(LENGTH / sqrt(2))))


@pytest.mark.parametrize(
    ("steps", "begins"),
    [
        ("x x x", [0, 1, 2]),
        ("x y x y", [0, 2]),
        ("x xy y", [0, 1, 2]),
        ("x x y y x", [0, 1, 3]),
        ("xy x y xy", [0, 1, 3]),
    ],
)
def test_moves_begin(steps, begins):
    moves = np.array([[axis in step for axis in "xy"] for step in steps.split()])
    assert move_beginnings(np.where(moves, -1, 0)).tolist() == begins


@pytest.mark.usefixtures("compiled_engine")
def test_at_constant_speed_the_machine_is_where_it_should_be():
    """Never two steps from F·t, over ticks rounded to clocks and to points of the grid."""
    line, circle = drift(degrees=(0, 23, 45, 200), radii=(100,), length=300, width=9)
    assert (line.what, line.curves) == ("lines of 300 steps", 4)
    assert (circle.what, circle.curves) == ("circles, R = 100", 2)
    for row in (line, circle):
        assert 0 <= row.at_end <= max(row.ahead, row.behind)
        assert 0.1 < row.ahead < 2
        assert 0.1 < row.behind < 2


@pytest.mark.usefixtures("compiled_engine")
def test_a_wrong_pace_is_seen(monkeypatch):
    """With a pace of 0 a diagonal is made in 212 ticks in place of 300: it ends 88 steps ahead.

    With one of 64/65 the circle takes so much longer: 2·π·100/64 ticks are nearly 10 steps.
    """

    def untold(kind, blocks, width, axes):
        told = paced(kind, blocks, width, axes)
        told[:, -1] = 0 if kind == "line" else told[:, -1] * 64 // 65
        return told

    monkeypatch.setattr(speed, "paced", untold)
    line, circle = drift(degrees=(45,), radii=(100,), length=300, width=9)
    assert line.ahead == pytest.approx(300 - 300 / sqrt(2), abs=1.5)
    assert line.at_end == line.ahead
    assert circle.behind == pytest.approx(2 * pi * 100 / 65, abs=2)
    assert circle.ahead < 2


@pytest.mark.usefixtures("compiled_engine")
def test_helices():
    """Every one ends on its end point, half a step from its circle and from its line at most."""
    flat, steep = helices((0.5, 5), count=5, width=7)
    assert [(row.steepness, row.helices, row.ends_missed) for row in (flat, steep)] == [
        (0.5, 5, 0),
        (5, 5, 0),
    ]
    for row in (flat, steep):
        assert 0.2 < row.off_circle < 1
        assert row.off_line < 1.5
        assert row.off_ticks < 4
    # A steep axis steps in every tick, and is always where it belongs.
    assert flat.off_line > 0.2


@pytest.mark.usefixtures("compiled_engine")
def test_a_helix_that_misses_its_end_is_seen(monkeypatch):
    def beside(kind, blocks, width, axes):
        told = paced(kind, blocks, width, axes)
        told[:, 5] += 1
        return told

    monkeypatch.setattr(speed, "paced", beside)
    (row,) = helices((0.5,), count=5, width=7)
    assert row.ends_missed == 5


def test_speeds_are_exact(monkeypatch):
    # One speed of an octave, in half of the clocks: one clock more or less is half of the unit.
    monkeypatch.setattr(speed, "_MANTISSAS", ())
    monkeypatch.setattr(speed, "_LONG", 1 << 17)
    rows = accuracy(octaves=(9, 1, 0))
    assert [(row.octave, row.speeds) for row in rows] == [(0, 1), (1, 1), (9, 1)]
    for row in rows:
        assert row.clocks >= 1 << 17
        assert row.largest_error <= 0.5
    assert rows[0].largest_error == 0


def test_clocks_of_steps():
    comparison = step_clocks(Comparison(6), np.array([[0, 0, 40, 13]]), np.array([99]))
    assert comparison.tolist() == [1] * 52
    # A line of 63 steps adds 63/64 a clock, 32/64 first: there is one clock without a carry.
    axis = step_clocks(Linear(6), np.array([[0, 0, 63, 0]]), np.array([99]))
    assert sorted(axis.tolist()) == [1] * 61 + [2]
    # The k-th step comes when 32 + 33·t is 64·k.
    slow = step_clocks(Linear(6), np.array([[5, 5, 5, -28]]), np.array([99]))
    assert slow.tolist() == np.diff([ceil((64 * k - 32) / 33) for k in range(1, 34)]).tolist()


def test_limits():
    clock = 50e6
    linear, line, arc = limits(4, clock, methods=("linear", DEVICE))
    assert (linear.method, line.method, arc.method) == ("linear", DEVICE, DEVICE)
    assert (linear.curve, line.curve, arc.curve) == ("line", "line", "arc")
    assert (linear.least, linear.most) == (1, 2)
    # Where the lecture's makes two steps the exact line makes a diagonal one: its longest way.
    ways = speed._sample("line", 4)[:, 2:]
    longest = np.abs(ways).max(axis=1)
    assert line.steps == (longest - 1).sum()
    assert linear.steps > line.steps
    # A step is there in every clock, and one axis moves with each: its pulse and space are two.
    assert (line.least, line.mean, line.most) == (2, 2, 2)
    # An axis of an arc that turns round has set-up and hold of the direction for a space.
    assert (arc.least, arc.most) == (2, 3)
    assert 2 < arc.mean < 2.1
    for row in (linear, line, arc):
        assert row.mean_ns == pytest.approx(20 * row.mean)
        assert row.most_ns == 20 * row.most
        assert row.mean_speed == pytest.approx(clock / row.mean)
        assert row.kept_speed == clock / row.most


def test_a_period_has_no_highest_speed():
    (row,) = limits(6, 1e6, methods=("carrier_linear",))
    assert (row.least, row.mean, row.most) == (2, 2, 2)
    assert row.per_period
    assert row.mean_speed is row.kept_speed is None


def test_a_clock_must_tick():
    with pytest.raises(ValueError, match=r"clock_hz is 0: choose a frequency above 0"):
        limits(8, 0)
