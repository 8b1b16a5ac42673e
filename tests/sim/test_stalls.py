import numpy as np
import pytest

from discreta.hdl.linear import Linear
from discreta.sim.compiled import CompiledModel
from discreta.sim.interpreted import PysimModel
from discreta.sim.stalls import NO_STALLS, Stalls, _draw
from discreta.sim.stretch import EVENT_COLUMNS

SEEDS = [0, 1, 7, 2**63, 2**64 - 1]


def test_draws_are_splitmix64():
    """The published first numbers of seed 1234567, two for every clock, upper halves."""
    published = [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]
    drawn = [_draw(1234567, number // 2, number % 2) for number in range(len(published))]
    assert drawn == [number >> 32 for number in published]


def test_without_stalls_everything_goes_on():
    assert all(NO_STALLS.ready(clock) and NO_STALLS.offers(clock) for clock in range(1000))


@pytest.mark.parametrize("seed", SEEDS)
def test_stalls_and_gaps_have_their_parts_and_are_apart(seed):
    stalls = Stalls(seed, stall=0.25, gap=0.5)
    clocks = range(20000)
    waits = np.array([not stalls.ready(clock) for clock in clocks])
    gaps = np.array([not stalls.offers(clock) for clock in clocks])
    # Five standard deviations of 20000 draws are 0.018.
    assert waits.mean() == pytest.approx(0.25, abs=0.018)
    assert gaps.mean() == pytest.approx(0.5, abs=0.018)
    assert (waits & gaps).mean() == pytest.approx(0.125, abs=0.018)
    assert (waits[1:] & waits[:-1]).mean() == pytest.approx(0.0625, abs=0.018)
    other = Stalls(seed ^ 2, stall=0.25)
    assert waits.tolist() != [not other.ready(clock) for clock in clocks]


BAD = {
    "stall -0.1": ({"stall": -0.1}, "stall is -0.1: choose a part of the clocks from 0 to below"),
    "stall 1": ({"stall": 1}, "stall is 1: choose a part of the clocks from 0 to below 1"),
    "gap 1.5": ({"gap": 1.5}, "gap is 1.5: choose a part of the clocks from 0 to below 1"),
    "gap nan": ({"gap": float("nan")}, "gap is nan: choose a part of the clocks from 0 to below"),
    "seed -1": ({"seed": -1}, "seed is -1: choose a whole number from 0 to 2\\^64 - 1"),
    "seed 2^64": ({"seed": 2**64}, f"seed is {2**64}: choose a whole number from 0 to 2\\^64 - 1"),
}


@pytest.mark.parametrize(("options", "message"), BAD.values(), ids=BAD)
def test_what_is_no_pattern(options, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        Stalls(**options)


@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize("seed", SEEDS)
def test_both_engines_draw_the_same(seed):
    stalls = Stalls(seed, stall=0.4, gap=0.6)
    rng = np.random.default_rng(1)
    blocks = rng.integers(-30, 31, (20, 4))
    watch = ("blocks_valid", "steps_ready")
    seen = []
    for model in (PysimModel, CompiledModel):
        engine = model(Linear(6, 2), watch=watch)
        seen.append(engine.run(blocks, 1500, stalls=stalls, event_room=10000))
        engine.close()
    python, cpp = seen
    np.testing.assert_array_equal(python.watch, cpp.watch)
    np.testing.assert_array_equal(python.events, cpp.events)
    assert (python.ran, python.fed, python.answered) == (cpp.ran, cpp.fed, cpp.answered)
    assert python.fed == len(blocks)
    # They are what the pattern says, and not merely equal.
    ready = [stalls.ready(clock) for clock in range(1500)]
    assert python.watch[:, 1].tolist() == ready
    column = {name: index for index, name in enumerate(EVENT_COLUMNS)}
    for event in python.events:
        assert ready[event[column["clock"]]] or not event[column["taken"]]
    rises = np.flatnonzero(np.diff(python.watch[:, 0], prepend=0) == 1)
    assert len(rises) > 10
    assert all(stalls.offers(clock) for clock in rises.tolist())
