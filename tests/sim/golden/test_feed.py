"""The golden model against arithmetic: the speeds, hold in every clock, and the ramp."""

from fractions import Fraction
from math import ceil, sqrt

import numpy as np
import pytest
import z3

from discreta.sim.feed import encode_acceleration, encode_feed, feed_of
from discreta.sim.golden.feed import FeedUnit
from discreta.sim.smt import symbols

ONE, FULL = 2**48, 128
WORDS = ("begins", "ahead", "taken", "even", "hold", "single", "acceleration", "moves_y")


def steady(speed, **inputs):
    """Give the inputs of a block of steps of x at a speed."""
    mantissa, exponent = encode_feed(Fraction(speed))
    given = {"active": 1, "feed_mantissa": mantissa, "feed_exponent": exponent, "override": FULL}
    return dict.fromkeys(WORDS, 0) | given | {"moves_x": 1} | inputs


def run(given, steps, drive=lambda _: {}, limit=100_000):
    """Run so many steps, each taken when it is permitted.

    Gives the clocks in which they leave, the state in each clock, and that after the last step.
    """
    golden = FeedUnit()
    state, clocks, states = golden.reset(), [], []
    while len(clocks) < steps:
        assert len(states) < limit
        states.append(state)
        taken = golden.outputs(state)["permit"]
        if taken:
            clocks.append(len(states) - 1)
        state = golden.step(state, given | drive(len(states) - 1) | {"taken": taken})
    return clocks, states, state


def speeds():
    """Give mantissas and exponents of the whole range: F = 1, and 24 octaves below it."""
    random = np.random.default_rng(11)
    chosen = [(0, 0)]
    for exponent in range(1, 25):
        some = random.integers(2**16, size=4).tolist()
        chosen += [(mantissa, exponent) for mantissa in (0, 1, 2**16 - 1, *some)]
    return np.array(chosen).T


def test_every_speed_to_the_last_bit():
    """Over 1 : 2^24 the k-th step leaves ⌈k/F⌉ clocks after the first one, whatever F is.

    The clocks in which nothing can happen are left out: from a step to the clock before the next
    permit ``debt`` is taken down by r a clock at once. The golden model runs the others.
    """
    mantissa, exponent = speeds()
    golden = FeedUnit()
    given = steady(1) | {"feed_mantissa": mantissa, "feed_exponent": exponent}
    state = golden.reset()
    for _ in range(3):
        assert not np.any(golden.outputs(state)["permit"])
        state = golden.step(state, given)
    rate = state["rate"]
    # Exact: 1/F = 2^48/r.
    assert [Fraction(value, ONE) for value in rate.tolist()] == [
        feed_of(*pair) for pair in zip(mantissa.tolist(), exponent.tolist(), strict=True)
    ]
    clocks = np.zeros_like(rate)
    for k in range(1, 200):
        assert np.all(golden.outputs(state)["permit"] == 1)
        state = golden.step(state, given | {"taken": 1})
        wait = np.maximum(-(-state["debt"] // rate) - 1, 0)
        state = state | {"debt": state["debt"] - wait * rate}
        late = golden.outputs(state)["permit"] == 0
        after = golden.step(state, given)
        state = {name: np.where(late, after[name], state[name]) for name in state}
        clocks = clocks + 1 + wait + late
        assert clocks.tolist() == [ceil(Fraction(k * ONE, r)) for r in rate.tolist()], k
    # In the mean, over steps enough: within 2^-16 of 1/F.
    mean = clocks / 199 * (rate / ONE)
    slow = exponent > 9
    assert np.all(np.abs(mean[slow] - 1) < 2.0**-16)


@pytest.mark.parametrize("override", [0, 1, 64, 127, 128, 129, 256, 257, 511])
def test_target_is_the_least_of_the_speed_and_one(override):
    mantissa, exponent = speeds()
    golden = FeedUnit()
    given = steady(1) | {"feed_mantissa": mantissa, "feed_exponent": exponent}
    state = golden.reset()
    for _ in range(2):
        state = golden.step(state, given | {"override": override})
    wanted = [
        min(feed_of(m, e) * min(override, 256) / FULL, Fraction(1)) * ONE // 1
        for m, e in zip(mantissa.tolist(), exponent.tolist(), strict=True)
    ]
    assert state["target"].tolist() == wanted


@pytest.mark.parametrize("speed", [Fraction(2, 7), Fraction(1), Fraction(1, 12)])
def test_hold_in_any_clock_shifts_all_steps_after_it(speed):
    """Hold in clock h for 9 clocks: what left until h + 1 has left, the rest comes 9 later."""
    given = steady(speed)
    free, _, end = run(given, 14)
    assert free == [3 + ceil(k / feed_of(*encode_feed(speed))) for k in range(14)]
    for begin in range(free[-1] + 1):
        held, _, held_end = run(given, 14, lambda clock, h=begin: {"hold": int(h <= clock < h + 9)})
        # A target of clock 1 is the first that hold can take away.
        shift = 9 if begin >= 1 else max(0, begin + 9 - 1)
        assert held == [clock + shift * (clock >= begin + 2) for clock in free], begin
        assert all(held_end[name] == end[name] for name in ("debt", "cell", "to_go"))


def test_hold_in_any_clock_of_a_ramp_loses_nothing():
    given = steady(Fraction(1, 4), acceleration=encode_acceleration(Fraction(1, 512)), ahead=40)
    free, states, end = run(given, 40, lambda clock: {"begins": int(clock == 0)})
    top = max(state["velocity"] for state in states)
    assert top == ONE // 4
    golden = FeedUnit()
    for begin in range(0, free[-1], 3):
        held, seen, held_end = run(
            given,
            40,
            lambda clock, h=begin: {"begins": int(clock == 0), "hold": int(h <= clock < h + 200)},
        )
        still = [golden.outputs(state)["still"] for state in seen]
        if 1 not in still[begin + 1 :]:
            # The last step left on the way to a standstill.
            assert held[-1] <= begin + 128 + 3
            continue
        first = still.index(1, begin + 1)
        # From V it takes V/a = 128 clocks to stand still, and none leaves until the end of hold.
        assert first <= begin + 128 + 3
        assert all(still[first : begin + 200])
        assert not [clock for clock in held if first <= clock < begin + 201]
        kept = [[state[name] for name in ("debt", "cell", "to_go")] for state in seen]
        assert kept[first : begin + 201] == [kept[first]] * (begin + 201 - first)
        assert (held_end["to_go"], len(held)) == (end["to_go"], 40)


@pytest.mark.parametrize("pairing", [True, False])
def test_ticks_are_all_as_long(pairing):
    """Whatever a tick moves the next one comes after 1/F, the path is 1 shorter, the cell empty."""
    golden, feed = FeedUnit(2, (256, 362), pairing), Fraction(3, 7)
    given = steady(feed, even=1, ahead=100)
    state, clocks = golden.reset(), []
    for clock in range(160):
        taken = golden.outputs(state)["permit"]
        moves = {f"moves_{a}": len(clocks) >> bit & 1 for bit, a in enumerate("xy")}
        begins = {"begins": int(clock == 0)}
        state = golden.step(state, given | moves | begins | {"taken": taken})
        clocks += [clock] * taken
        assert state["cell"] == 0
        assert state["to_go"] == 256 * (100 - len(clocks))
    assert clocks == [3 + ceil(k / feed_of(*encode_feed(feed))) for k in range(len(clocks))]
    assert len(clocks) > 60


def test_a_single_step_waits_for_one_that_moves():
    golden, given = FeedUnit(), steady(1, hold=1)
    state = golden.step(golden.reset(), given | {"single": 1})
    for moves, waits in ((0, 1), (0, 1), (1, 0), (1, 0)):
        state = golden.step(state, given | {"even": 1, "taken": 1, "moves_x": moves, "single": 1})
        assert state["single_step"] == golden.outputs(state)["permit"] == waits


RAMPS = [
    (400, Fraction(1, 4), Fraction(1, 2**12)),
    (1000, Fraction(1, 2), Fraction(1, 2**10)),
    (3000, Fraction(1), Fraction(1, 2**9)),
    (300, Fraction(1, 8), Fraction(1, 2**13)),
    # Triangles.
    (200, Fraction(1, 4), Fraction(1, 2**12)),
    (50, Fraction(1, 2), Fraction(1, 2**14)),
]


@pytest.mark.parametrize(("length", "speed", "acceleration"), RAMPS, ids=str)
def test_trapezoid_and_triangle(length, speed, acceleration):
    a = encode_acceleration(acceleration)
    given = steady(speed, acceleration=a, ahead=length)
    clocks, states, _ = run(given, length, lambda clock: {"begins": int(clock == 0)})
    v = [state["velocity"] for state in states]
    top = max(v)
    # Up, along and down; while it brakes it may stay for some clocks, and climb never by more
    # than a again.
    up, down = v.index(top), len(v) - 1 - v[::-1].index(top)
    assert set(np.diff(v[2 : up + 1]).tolist()) == {a}
    assert set(v[up : down + 1]) <= {top, top - a}
    lowest = np.minimum.accumulate(v[down:])
    assert np.all(v[down:] - lowest <= a)
    assert [state["rate"] for state in states[1:]] == [
        min(before["velocity"], before["target"]) for before in states[:-1]
    ]
    # The closed form: L/F + F/a, or 2·√(L/a) where F is not reached. The last step is made at W and
    # not at rest, W/a clocks before.
    f, a = float(speed), float(acceleration)
    peak = top / ONE
    last = states[clocks[-1]]["rate"] / ONE
    late = 2 if top < speed * ONE else 1
    assert last <= sqrt(2 * a * (late + 3 * peak)) + a
    end = sqrt(2 * (1 + 3 * peak) / a)
    if length >= f * f / a:
        assert top == speed * ONE
        # The first step leaves in clock 4, and braking begins 3 clocks late.
        assert abs(clocks[-1] - (length / f + f / a + 7 - end)) <= 3
    else:
        assert top < speed * ONE
        assert abs(peak / sqrt(a * length) - 1) < 0.03
        assert abs(clocks[-1] - (2 * sqrt(length / a) - end)) <= 0.012 * clocks[-1]


def test_wrong_path_ahead_stops_nothing():
    """The path ahead is a hint: with none, or far too much, every step leaves."""
    a = encode_acceleration(Fraction(1, 256) - Fraction(1, 2**48))
    for ahead in (0, 1, 5, 2**28 - 1):
        given = steady(Fraction(1, 4), acceleration=a, ahead=ahead)
        clocks, _, _ = run(given, 60, lambda clock: {"begins": int(clock % 50 == 0)}, limit=4000)
        assert len(clocks) == 60
        # With 1 step ahead it creeps at √(2a): there and back within a.
        slowest = max(np.diff(clocks))
        assert slowest <= 1 / sqrt(2 / 256) + 40


def test_braking_way_is_that_of_a_fall_to_rest():
    """B at v = k·a is a·(0 + 1 + … + k − 1), and again after any ups and downs."""
    golden, random = FeedUnit(), np.random.default_rng(5)
    a = encode_acceleration(Fraction(1, 3000))
    given = steady(Fraction(1, 2), acceleration=a, ahead=2**27)
    state = golden.step(golden.reset(), given | {"begins": 1})
    seen, now = set(), {}
    for clock in range(4000):
        if clock % 50 == 0:
            now = {"hold": int(random.integers(2)), "override": int(random.integers(1, 256))}
        state = golden.step(state, given | now)
        k, rest = divmod(state["velocity"], a)
        assert rest == 0
        assert state["braking"] == sum((i * a) >> 13 for i in range(k))
        seen.add(k)
    assert len(seen) > 100


def test_integers_arrays_and_bit_vectors_agree():
    golden = FeedUnit(3, (256, 362, 443))
    random = np.random.default_rng(13)
    kinds = golden.registers()
    inputs = {"feed_mantissa": 16, "feed_exponent": 5, "ahead": 28, "override": 9}
    inputs |= {"acceleration": 40}
    flags = ("active", "begins", "taken", "even", "hold", "single")
    inputs |= dict.fromkeys((*flags, *(f"moves_{a}" for a in "xyz")), 1)
    count = 60
    # An array has room for B below 2^63, as it is.
    state = {
        name: random.integers(-(2 ** (bits - 1)) if signed else 0, 2 ** (bits - signed), count)
        for name, (bits, signed) in ((name, (min(b, 62), s)) for name, (b, s) in kinds.items())
    }
    given = {name: random.integers(0, 2**bits, count) for name, bits in inputs.items()}
    after, shown = golden.step(state, given), golden.outputs(state)
    wide = 68
    every = inputs | {name: bits for name, (bits, _) in kinds.items()}
    letters = symbols(kinds, wide)
    words = symbols({name: (bits, False) for name, bits in inputs.items()}, wide)
    symbolic = golden.step(letters, words) | golden.outputs(letters)
    for k in range(count):
        ints = {name: int(values[k]) for name, values in state.items()}
        words_k = {name: int(values[k]) for name, values in given.items()}
        wanted = golden.step(ints, words_k) | golden.outputs(ints)
        assert wanted == {name: int(values[k]) for name, values in (after | shown).items()}
        if k < 12:
            known = [
                (z3.BitVec(name, bits), z3.BitVecVal((ints | words_k)[name], bits))
                for name, bits in every.items()
            ]
            for name, value in symbolic.items():
                found = z3.simplify(z3.substitute(value, *known))
                assert isinstance(found, z3.BitVecNumRef)
                assert found.as_signed_long() == wanted[name], name
