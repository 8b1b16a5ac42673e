"""A curve on the whole device: what the pins do against the golden models' points."""

from fractions import Fraction
from math import sqrt

import numpy as np
import pytest
from amaranth.hdl import Fragment

from discreta.hdl.device import Device, exact_device
from discreta.hdl.feed import FeedUnit
from discreta.hdl.plain import block_fields
from discreta.hdl.pulse import PulseUnit
from discreta.sim.conics import ellipse
from discreta.sim.curves import Arc, Conic, Polyline
from discreta.sim.feed import octagon
from discreta.sim.machine import Drive, Machine, Trail, device_blocks, pace_limit
from discreta.sim.methods import METHODS
from discreta.sim.plotter import PulseTiming
from discreta.sim.points import BadInputError
from tests.hdl.traces import golden_trace

WIDTH = 7
PATH = Polyline([(3, 5), (40, 20), (40, 20), (-12, 60), (-30, -7), (3, 5)])
CURVES = {
    "linear": PATH,
    "circular": Arc((30, 10), (-30, -10), (0, 0), clockwise=True),
    "conic": Conic(
        ellipse(
            (1, -2), (30, 12), 30, WIDTH, start_angle=0, end_angle=0, clockwise=False, full_turns=0
        )
    ),
}
SLOW = Drive(Fraction(1, 14), Fraction(1, 500), PulseTiming(3, 2, 4, 5))


def run(method, curve, drive, engine="pysim"):
    """Run a curve on the device; give the machine, and clocks and points of the pins' moves.

    What is expected comes from the golden model of the interpolator.
    """
    choices = METHODS[method].settings["default"]
    core, golden = METHODS[method].core(WIDTH, **choices), METHODS[method].model(WIDTH, **choices)
    _, outputs = golden_trace(golden, block_fields(core), curve.blocks, 60_000, until_idle=True)
    column = dict(zip(golden.outputs(golden.reset()), outputs.T, strict=True))
    moves = np.stack([column["steps_x"], column["steps_y"]], axis=1)[column["steps_valid"] == 1]
    expected = curve.start + np.cumsum(moves, axis=0)
    trail = Trail(curve.start)
    trail.follow(expected)
    machine = Machine(curve, {curve.kind: core}, drive, trail)
    most = pace_limit(curve, drive, int(METHODS[method].clocks(golden, curve.blocks).sum()))
    seen = list(machine.run(limit=most, engine=engine))
    when, points = (np.concatenate(parts) for parts in zip(*seen, strict=True))
    return machine, when, points, expected


@pytest.mark.parametrize("drive", [Drive(), SLOW], ids=["at once", "slow"])
@pytest.mark.parametrize("method", CURVES)
def test_the_pins_make_the_golden_steps_in_order(method, drive):
    curve = CURVES[method]
    machine, when, points, expected = run(method, curve, drive)
    assert points.tolist() == expected.tolist()
    assert np.all(np.diff(when) > 0)
    assert machine.good
    facts = machine.facts()
    assert facts["timing rules broken"] == 0
    assert facts["device clocks"] == when[-1]
    assert (
        facts["pulses"]
        == np.abs(np.diff(points, axis=0, prepend=[curve.start])).sum(axis=0).tolist()
    )
    assert machine.clocks - when[-1] < 200


@pytest.mark.usefixtures("compiled_engine")
def test_both_engines_agree_to_the_clock():
    slow = run("linear", PATH, SLOW)
    compiled = run("linear", PATH, SLOW, "compiled")
    assert slow[1].tolist() == compiled[1].tolist()
    assert slow[2].tolist() == compiled[2].tolist()
    assert slow[0].facts() == compiled[0].facts()


def test_a_line_along_an_axis_leaves_at_just_the_programmed_speed():
    """Without a ramp all pauses are 1/F but for the whole clocks that they are rounded to."""
    feed = Fraction(1, 13) * 3
    _, when, _, _ = run("linear", Polyline([(0, 0), (100, 0)]), Drive(feed))
    programmed = Drive(feed).programmed
    exact = when[0] + np.arange(100) / float(programmed)
    assert np.all((when >= exact - 1) & (when <= exact + 1))
    assert len(set(np.diff(when).tolist())) == 2


def test_a_chain_of_blocks_is_one_trapezoid():
    """Up from a standstill at its begin, down at its end, and F in between across the blocks."""
    feed, acceleration = Fraction(1, 8), Fraction(1, 2000)
    curve = Polyline([(x, 0) for x in range(0, 101, 20)])
    _, when, _, _ = run("linear", curve, Drive(feed, acceleration))
    pauses = np.diff(when)
    ramp = float(feed**2 / (2 * acceleration))
    top = pauses[int(ramp) + 2 : -int(ramp) - 3]
    assert set(top.tolist()) == {8}
    assert np.all(np.diff(pauses[: int(ramp)]) <= 0)
    assert np.all(np.diff(pauses[-int(ramp) :]) >= 0)
    # From one step on, v² = 2·a·way.
    assert pauses[0] == pytest.approx(sqrt(2 / float(acceleration)), rel=0.1)
    # The last step leaves when one is left to go, which from there takes √(2/a).
    whole = 100 / float(feed) + float(feed / acceleration) - sqrt(2 / float(acceleration))
    assert when[-1] - when[0] == pytest.approx(whole, rel=0.02)


def test_pulses_slow_the_interpolator_down_and_lose_nothing():
    drive = Drive(Fraction(1), Fraction(0), PulseTiming(9, 6, 4, 5))
    machine, when, points, expected = run("linear", Polyline([(0, 0), (30, 30)]), drive)
    assert machine.good
    assert points.tolist() == expected.tolist()
    assert set(np.diff(when).tolist()) == {15}


def test_blocks_of_a_device():
    """On the lecture's interpolator the path is the octagon's; there is no pace to be told."""
    device = Device(line=METHODS["linear"].core(WIDTH))
    Fragment.get(device, None)  # it must be used
    blocks = device_blocks(device, PATH, Drive(Fraction(3, 8)))
    ends = PATH.points[1:].tolist()
    ahead = np.cumsum(octagon(PATH.blocks, "line")[::-1])[::-1].round()
    assert blocks.tolist() == [
        [3, 0, 0, 0, 3, 5],
        *([0, 0x8000, 2, far, *end] for far, end in zip(ahead, ends, strict=True)),
    ]


def test_blocks_of_a_device_at_constant_speed():
    """A line is as long as it is: that is the path, and its pace is length/L − 1."""
    device = exact_device(WIDTH)
    Fragment.get(device, None)  # it must be used
    assert block_fields(device)[4:7] == ("blocks_end_x", "blocks_end_y", "blocks_pace")
    blocks = device_blocks(device, PATH, Drive(Fraction(3, 8)))[:, :7]
    ends = PATH.points[1:]
    ways = np.abs(np.diff(PATH.points, axis=0))
    length, longest = np.hypot(*ways.T), ways.max(axis=1)
    ahead = np.cumsum(length[::-1])[::-1].round()
    pace = np.rint((length / np.maximum(longest, 1) - 1) * 2 ** (WIDTH + 12))
    # One of them has no length.
    pace[longest == 0] = 0
    assert blocks.tolist() == [
        [3, 0, 0, 0, 3, 5, 0],
        *([0, 0x8000, 2, *row] for row in zip(ahead, *ends.T, pace, strict=True)),
    ]


@pytest.mark.parametrize(
    ("part", "spoil", "said"),
    [
        (
            PulseUnit,
            lambda m, part: m.d.sync.__iadd__(part.length.eq(1)),
            ("timing rules broken", lambda count: count > 0),
        ),
        (
            PulseUnit,
            lambda m, part: m.d.comb.__iadd__(part.place["x"].down.eq(0)),
            ("position is the pulses", lambda same: not same),
        ),
        (
            FeedUnit,
            lambda m, part: m.d.comb.__iadd__(part.permit.eq(0)),
            None,
        ),
    ],
    ids=["pulse too short", "position wrong", "dead"],
)
def test_a_broken_device_is_seen(monkeypatch, part, spoil, said):
    sound = part.elaborate

    def elaborate(self, platform):
        m = sound(self, platform)
        spoil(m, self)
        return m

    monkeypatch.setattr(part, "elaborate", elaborate)
    if said is None:
        with pytest.raises(RuntimeError, match=r"\A\d of 6 blocks are answered after \d+ clocks"):
            run("linear", PATH, Drive())
        return
    machine, *_ = run("linear", PATH, Drive(timing=PulseTiming(3, 2, 1, 1)))
    assert not machine.good
    fact, wrong = said
    assert wrong(machine.facts()[fact])


def test_trails_tell_order_and_place():
    points = np.array([[1, 0], [1, 1], [2, 1]])
    trails = [Trail(np.array([0, 0])) for _ in range(4)]
    trails[0].follow(points)
    for point in points:
        trails[1].follow(point[None])
    trails[2].follow(points[[1, 0, 2]])
    trails[3].follow(points[:2])
    assert trails[0] == trails[1]
    assert trails[0] != trails[2]
    assert trails[0] != trails[3]
    assert (trails[2].low.tolist(), trails[2].high.tolist()) == ([0, 0], [2, 1])


def test_what_a_device_cannot_be_programmed_with():
    with pytest.raises(BadInputError, match=r"\Apulse space is 4096 clocks: choose up to 4095\Z"):
        Drive(timing=PulseTiming(space=4096))
    with pytest.raises(BadInputError, match="steps per clock"):
        Drive(Fraction(3, 2))
