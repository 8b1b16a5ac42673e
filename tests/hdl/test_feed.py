# amaranth: UnusedElaboratable=no
# (A part that refuses its parameters cannot be simulated.)
"""The feed unit against its golden model, and the moments of its steps against arithmetic."""

from fractions import Fraction
from math import ceil

import numpy as np
import pytest

from discreta.hdl.feed import FULL_OVERRIDE, PAUSES, FeedUnit
from discreta.hdl.plain import PlainPorts
from discreta.sim.feed import encode_feed, feed_of
from discreta.sim.golden.feed import FeedUnit as Golden
from tests.hdl.parts.clocked import BAD_AXES, assert_refused, run

ONE = 2**48


def simulate(core, clocks, drive, watch=()):
    """Run a device; ``drive(clock, shown)`` gives the inputs that change, by plain names.

    Gives what is shown in every clock: outputs and registers, or those to watch alone.
    """
    top = PlainPorts(core, observe=core.registers)
    signals = {name.removeprefix("reg_"): signal for name, signal in top.outputs.items()}
    signals = {name: signals[name] for name in watch or signals}
    rows = []

    async def bench(ctx):
        given = {}
        for clock in range(clocks):
            rows.append({name: ctx.get(signal) for name, signal in signals.items()})
            for name, value in drive(clock, rows[-1]).items():
                if given.get(name, 0) != value:
                    given[name] = value
                    ctx.set(top.inputs[name], value)
            await ctx.tick()

    run(top, bench)
    return rows


def at_speed(speed, moves=({"moves_x": 1},), /, **inputs):
    """Drive a block of these moves, over and over, each taken when it is permitted."""
    mantissa, exponent = encode_feed(Fraction(speed))
    steady = {"active": 1, "feed_mantissa": mantissa, "feed_exponent": exponent}
    steady |= {"override": FULL_OVERRIDE} | inputs
    done = []

    def drive(_clock, shown):
        taken = shown["permit"]
        none = dict.fromkeys(("moves_x", "moves_y", "even"), 0)
        move = moves[len(done) % len(moves)]
        done.extend([1] * taken)
        return steady | none | move | {"taken": taken}

    return drive


def permits_of(rows):
    return [clock for clock, row in enumerate(rows) if row["permit"]]


def random_drive(axes, seed):
    """Drive everything there is, at random; most of it stays for a while."""
    random = np.random.default_rng(seed)
    letters = "xyzabc"[:axes]
    now = {"active": 1, "override": FULL_OVERRIDE, "feed_exponent": 2}
    now |= {"single": 0, "even": 0}

    def chance(probability):
        return int(random.random() < probability)

    def drive(_clock, shown):
        if chance(0.05):
            now["feed_mantissa"] = int(random.integers(2**16))
            now["feed_exponent"] = int(random.choice([0, 1, 2, 3, 5, 9, 24, 31]))
        if chance(0.05):
            now["override"] = int(random.choice([0, 1, 64, 128, 200, 255, 256, 257, 300, 511]))
        if chance(0.02):
            size = int(random.choice([0, 0, 1, 30, 36, 39, 40]))
            now["acceleration"] = int(random.integers(2**size))
        now["active"] = 1 - chance(0.01) if now["active"] else chance(0.3)
        now["hold"] = chance(0.03) if not now.get("hold") else 1 - chance(0.06)
        now["single"] ^= chance(0.2)
        now["even"] ^= chance(0.1)
        now["begins"] = chance(0.03)
        far = int(random.choice([0, 1, 3, 60, 2**28 - 1]))
        now["ahead"] = int(random.integers(far + 1))
        now["taken"] = chance(0.9) if shown["permit"] else chance(0.03)
        return now | {f"moves_{a}": chance(0.5) for a in letters}

    return drive


SETTINGS = [
    (2, (256, 362), True),
    (2, (256, 358), False),
    (3, PAUSES[:3], True),
    (6, (256, 256, 400, 400, 1023, 1023), True),
]


@pytest.mark.parametrize("multiplier", [False, True])
@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_every_register_is_the_golden_models(setting, multiplier):
    axes, pauses, pairing = setting
    golden, drive = Golden(axes, pauses, pairing), random_drive(axes, 7)
    core = FeedUnit(axes, pauses=pauses, pairing=pairing, multiplier=multiplier)
    idle = dict.fromkeys(PlainPorts(core).inputs, 0)
    given = []

    def noted(clock, shown):
        given.append(drive(clock, shown))
        return given[-1]

    rows = simulate(core, 1800, noted)
    state = golden.reset()
    for clock, (row, inputs) in enumerate(zip(rows, given, strict=True)):
        assert row == state | golden.outputs(state), clock
        state = golden.step(state, idle | inputs)
    # Of everything there is something.
    assert {row["still"] for row in rows} == {row["permit"] for row in rows} == {0, 1}
    assert len({row["velocity"] for row in rows}) > 200
    assert max(row["braking"] for row in rows) > 2**31
    assert len({row["cell"] for row in rows}) > 0.7 * 2**axes


@pytest.mark.parametrize("acceleration", [0, 2**40 - 1])
def test_latency_of_speed_and_of_hold(acceleration):
    """F and override in 3 clocks, hold in 2; the ramp a clock later."""
    late = int(acceleration > 0)
    given = {"acceleration": acceleration, "ahead": 9, "moves_x": 1}
    speed = {"feed_exponent": 0, "feed_mantissa": 0, "override": FULL_OVERRIDE, "active": 1}

    def drive(clock, _shown):
        return given | speed | {"hold": int(clock >= 12)}

    rows = simulate(FeedUnit(), 24, drive)
    assert permits_of(rows)[0] == 3 + late
    assert rows[13]["target"] == 0 < rows[12]["target"]
    assert rows[14]["rate"] == (0 if acceleration == 0 else rows[13]["velocity"])
    if not acceleration:
        assert [row["still"] for row in rows] == [1, 1, *[0] * 12, *[1] * 10]
        assert permits_of(rows) == list(range(3, 14))

        # An override: 0 for 5 clocks.
        def overridden(clock, _shown):
            return given | speed | {"override": FULL_OVERRIDE * (not 10 <= clock < 15)}

        assert [row["permit"] for row in simulate(FeedUnit(), 22, overridden)] == (
            [0] * 3 + [1] * 10 + [0] * 5 + [1] * 4
        )


@pytest.mark.parametrize(
    ("speed", "clocks"),
    [
        (Fraction(1), 300),
        (Fraction(2, 3), 900),
        (Fraction(1, 7), 2000),
        (Fraction(3, 1000), 4000),
        (Fraction(1, 1024), 5200),
    ],
    ids=str,
)
def test_the_steps_leave_at_the_speed(speed, clocks):
    """The k-th step leaves ⌈k/F⌉ clocks after the first one: no clock is lost in the mean."""
    permits = permits_of(simulate(FeedUnit(), clocks, at_speed(speed), ("permit",)))
    real = feed_of(*encode_feed(speed))
    assert abs(real / speed - 1) <= Fraction(1, 2**17)
    assert permits == [3 + ceil(k / real) for k in range(len(permits))]
    assert permits[-1] + ceil(1 / real) >= clocks


X, Y, BOTH = {"moves_x": 1}, {"moves_y": 1}, {"moves_x": 1, "moves_y": 1}
#: Ticks of an interpolator at constant speed: one that moves nothing, and others.
EMPTY, TICK_X, TICK_BOTH = ({"even": 1} | moves for moves in ({}, X, BOTH))


@pytest.mark.parametrize(
    ("pauses", "pairing", "moves", "wanted"),
    [
        ((256, 362), True, (X,), [256]),
        ((256, 362), True, (BOTH,), [362]),
        ((256, 358), True, (BOTH, X, X), [358, 256, 256]),
        # x and then y are a diagonal; y after both of them begins another one.
        ((256, 362), True, (X, Y), [256, 106]),
        ((256, 362), True, (X, Y, Y, X), [256, 106]),
        ((256, 362), True, (X, X, Y), [256, 256, 106]),
        ((256, 362), True, (BOTH, X), [362, 256]),
        ((256, 362), False, (X, Y), [256]),
        ((256, 358), False, (BOTH, Y), [358, 256]),
        # Ticks are all as long, and what comes behind one is another move.
        ((256, 362), True, (EMPTY,), [256]),
        ((256, 362), True, (TICK_BOTH, EMPTY, TICK_X), [256]),
        ((256, 362), True, (TICK_X, Y), [256]),
        ((256, 362), True, (Y, TICK_X), [256]),
        ((256, 362), True, (X, EMPTY, Y, EMPTY), [256]),
        ((256, 362), True, (BOTH, TICK_BOTH), [362, 256]),
        ((256, 358), False, (EMPTY, BOTH, TICK_BOTH), [256, 358, 256]),
    ],
)
def test_pauses_after_steps(pauses, pairing, moves, wanted):
    """By hand, at 1/256 steps per clock: a pause of p/256 lasts p clocks."""
    core = FeedUnit(pauses=pauses, pairing=pairing)
    permits = permits_of(simulate(core, 2600, at_speed(Fraction(1, 256), moves), ("permit",)))
    gaps = np.diff(permits).tolist()
    assert len(gaps) >= 7
    assert gaps == [wanted[k % len(wanted)] for k in range(len(gaps))]


def test_a_step_that_comes_late_is_not_made_up_for():
    drive = at_speed(Fraction(1, 10))
    late = [clock for clock in range(400) if 100 <= clock < 150]

    def delayed(clock, shown):
        if clock in late:
            return {"taken": 0}
        return drive(clock, shown)

    rows = simulate(FeedUnit(), 400, delayed)
    taken = [clock for clock in permits_of(rows) if clock not in late]
    assert np.diff([clock for clock in taken if clock >= 150]).tolist() == [10] * 24
    assert taken[10] == 150


@pytest.mark.parametrize(
    ("override", "factor"),
    [(0, 0), (1, 1), (64, 64), (128, 128), (256, 256), (257, 256), (511, 256)],
)
def test_override(override, factor):
    """From 0 to 200 %; what is above is taken for 200 %."""
    rows = simulate(FeedUnit(), 700, at_speed(Fraction(3, 16), override=override))
    rate = Fraction(3, 16) * factor / 128
    assert rows[-1]["rate"] == rate * ONE
    permits = permits_of(rows)
    assert permits == [3 + ceil(k / rate) for k in range(len(permits))] if factor else not permits
    # A speed above 1 is 1.
    fast = simulate(FeedUnit(), 9, at_speed(1, override=override))
    assert fast[-1]["rate"] == ONE * min(factor, 128) // 128


def test_single_steps():
    """One permit for every rising edge under hold, until it is taken; no other."""
    steady = at_speed(Fraction(1, 4))

    def drive(clock, shown):
        # Edges in 40 and 60; the one in 10 is not under hold; in 60 the step comes late.
        single = int(clock in (10, 11) or 40 <= clock < 50 or clock == 60)
        late = {"taken": 0} if 60 <= clock < 70 else {}
        return steady(clock, shown) | {"single": single, "hold": int(20 <= clock < 90)} | late

    rows = simulate(FeedUnit(), 120, drive)
    held = [clock for clock in permits_of(rows) if 22 <= clock < 92]
    assert held == [41, *range(61, 71)]
    assert all(row["still"] for row in rows[23:91])
    # The last one has its own pause, which is over 4 clocks after the speed is back.
    assert [clock for clock in permits_of(rows) if clock >= 91][:3] == [96, 100, 104]


def test_a_single_step_goes_on_until_an_axis_moves():
    """Under hold the ticks before it that move nothing are permitted, too, a clock each.

    At 1/4 ticks leave in 3, 7 … 19, five of them: the second one moves, and every third behind it.
    """
    steady = at_speed(Fraction(1, 4), (EMPTY, TICK_X, EMPTY))

    def drive(clock, shown):
        # The edge in 60 is kept while its first tick comes late.
        late = 60 <= clock < 65
        orders = {"single": int(clock in (40, 60)), "hold": int(20 <= clock < 90)}
        return orders | ({"taken": 0} if late else steady(clock, shown))

    rows = simulate(FeedUnit(), 110, drive)
    permits = permits_of(rows)
    assert permits[:5] == [3, 7, 11, 15, 19]
    # Two empty ones, and the one that moves; the late one waits from 61 to 64.
    assert [clock for clock in permits if 22 <= clock < 92] == [41, 42, 43, *range(61, 68)]
    assert all(row["still"] for row in rows[23:91])
    assert not any(row["cell"] for row in rows)
    # The last one has its own pause, which is over 4 clocks after the speed is back.
    assert [clock for clock in permits if clock >= 91][:3] == [96, 100, 104]


def test_hold_ends_still_also_where_the_acceleration_has_grown():
    def drive(clock, shown):
        steady = at_speed(Fraction(1, 64), ahead=9999, begins=int(clock == 0))(clock, shown)
        hold = int(clock >= 200)
        return steady | {"acceleration": 2**36 if clock < 200 else 2**40 - 1, "hold": hold}

    rows = simulate(FeedUnit(), 230, drive)
    assert not rows[199]["still"]
    assert rows[199]["velocity"] % (2**40 - 1) > 0
    assert rows[-1]["still"]
    assert (rows[-1]["velocity"], rows[-1]["braking"], rows[-1]["rate"]) == (0, 0, 0)


@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_registers_hold_every_flip_flop(setting):
    smt = pytest.importorskip("discreta.sim.smt")
    axes, pauses, pairing = setting
    core = FeedUnit(axes, pauses=pauses, pairing=pairing)
    assert smt.Rtl(core).flip_flops == sum(map(len, core.registers.values()))
    assert {name: (len(it), it.shape().signed) for name, it in core.registers.items()} == Golden(
        *setting
    ).registers()
    assert list(core.registers) == [it.name for group in core.diagram.values() for it in group]
    assert core.parameters == {
        "axes": axes,
        "pauses": pauses,
        "pairing": pairing,
        "multiplier": False,
    }


def test_pauses_are_roots():
    assert [round(256 * number**0.5) for number in range(1, 7)] == list(PAUSES)
    assert [FeedUnit(axes).pauses for axes in (2, 6)] == [PAUSES[:2], PAUSES]


def test_refuses_other_parameters():
    for axes, error, message in BAD_AXES:
        assert_refused((error, message), FeedUnit, axes)
    message = "pairing must be True or False, not 1"
    assert_refused((TypeError, message), FeedUnit, pairing=1)
    message = "multiplier must be True or False, not 1"
    assert_refused((TypeError, message), FeedUnit, multiplier=1)
    for pauses in ((256, 358.4), (256, "362"), (True, 362)):
        message = f"pauses must be whole numbers of 1/256, not {pauses!r}"
        assert_refused((TypeError, message), FeedUnit, pauses=pauses)
    for pauses in ((256,), (256, 362, 443), (255, 362), (256, 255), (256, 1024)):
        message = (
            f"pauses are {pauses!r}: choose 2 of them, 256 first and none smaller than the one "
            "before, up to 1023"
        )
        assert_refused((ValueError, message), FeedUnit, pauses=pauses)
