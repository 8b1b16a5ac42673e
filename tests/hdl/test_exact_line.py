"""The exact line interpolator: nearest points, the contract clock by clock, the golden model."""

import numpy as np
import pytest

from discreta.hdl.exact_line import ExactLine
from discreta.sim.compiled import CompiledModel
from discreta.sim.golden.exact_line import ExactLine as GoldenExactLine
from discreta.sim.interpreted import PysimModel
from discreta.sim.stalls import NO_STALLS, Stalls
from tests.hdl.parts.clocked import BAD_AXES, BAD_WIDTHS, assert_refused
from tests.hdl.traces import golden_trace
from tests.needs import needs_compiler

STALLS = [NO_STALLS, Stalls(1, stall=0.5, gap=0.3), Stalls(2, stall=0.9), Stalls(3, gap=0.9)]
CLOCK, ACCEPTED, DONE, ERROR, TAKEN = range(5)


def watched(golden):
    return tuple(f"reg_{name}" for name in golden.registers())


def random_blocks(width, axes, count, seed):
    """Blocks of all lengths and signs: too long, of no length, one step long, and equal ways."""
    random = np.random.default_rng(seed)
    span = 2 ** random.integers(0, width + 1, (count, 1))
    starts = random.integers(-(2**width), 2**width, (count, axes))
    moves = random.integers(-span, span, (count, axes), endpoint=True)
    moves[3::7] = np.abs(moves[3::7, :1]) * random.choice([-1, 1], (len(moves[3::7]), axes))
    ends = np.clip(starts + moves, -(2**width), 2**width - 1)
    ends[::5] = starts[::5]
    ends[::5, 0] += np.where(starts[::5, 0] < 0, 1, 0)
    starts[1], ends[1] = -(2**width), 2**width - 1
    return np.concatenate([starts, ends], axis=1)


def nearest(ways):
    """Give the steps of a line: every axis goes to ⌊k·Δ/L + ½⌋."""
    longest = int(np.abs(ways).max())
    k = np.arange(longest + 1)[:, None]
    return np.diff((2 * k * ways + longest) // max(2 * longest, 1), axis=0)


@pytest.mark.parametrize("stalls", STALLS, ids=str)
@pytest.mark.parametrize(("width", "axes"), [(4, 2), (5, 3)])
def test_every_register_at_every_clock_in_pysim(width, axes, stalls):
    golden = GoldenExactLine(width, axes)
    model = PysimModel(ExactLine(width, axes), watch=watched(golden))
    blocks = random_blocks(width, axes, 30, seed=width)
    seen = model.run(blocks, 6000, until_answered=30, stalls=stalls, event_room=6000)
    assert (seen.fed, seen.answered) == (30, 30)
    expected, _ = golden_trace(golden, model.block_fields, blocks, seen.ran, stalls)
    assert np.argwhere(seen.watch != expected).tolist() == []


@needs_compiler
@pytest.mark.parametrize("stalls", STALLS[:2], ids=str)
@pytest.mark.parametrize(("width", "axes"), [(8, 6), (32, 2)])
def test_every_register_at_every_clock_compiled(width, axes, stalls):
    golden = GoldenExactLine(width, axes)
    model = CompiledModel(ExactLine(width, axes), watch=watched(golden))
    blocks = random_blocks(min(width, 8), axes, 25, seed=width)
    if width == 32:
        # Far out, where every bit of a coordinate counts.
        blocks[::2] += 2**32 - 2**9
    seen = model.run(blocks, 60_000, until_answered=25, stalls=stalls, event_room=60_000)
    assert (seen.fed, seen.answered) == (25, 25)
    expected, _ = golden_trace(golden, model.block_fields, blocks, seen.ran, stalls)
    assert np.argwhere(seen.watch != expected).tolist() == []


@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("stalls", STALLS[:2], ids=str)
def test_the_path_is_that_of_the_nearest_points(axes, stalls):
    width, blocks = 6, random_blocks(6, axes, 60, seed=4)
    ways = blocks[:, axes:] - blocks[:, :axes]
    fits = np.abs(ways).max(axis=1) < 2**width
    assert 0 < (~fits).sum() < 30
    watch = tuple(f"position_{a}" for a in "xyz"[:axes])
    model = PysimModel(ExactLine(width, axes), watch=watch)
    seen = model.run(blocks, 20_000, until_answered=60, stalls=stalls, event_room=20_000)
    events = seen.events
    answers = events[(events[:, DONE] == 1) | (events[:, ERROR] != 0)]
    assert answers[:, ERROR].tolist() == (~fits).astype(int).tolist()
    steps = events[events[:, TAKEN] == 1]
    wanted = [nearest(way) for way in ways[fits]]
    assert np.array_equal(steps[:, TAKEN + 1 : TAKEN + 1 + axes], np.concatenate(wanted))
    lengths = np.array([len(steps) for steps in wanted])
    last = np.cumsum(lengths)[lengths > 0] - 1
    assert np.flatnonzero(steps[:, -1]).tolist() == last.tolist()
    # In the clock after the last step the position is the end, or the start of the next block.
    ends = blocks[fits][lengths > 0, axes:]
    clocks = steps[last, CLOCK]
    shown = seen.watch[np.minimum(clocks + 1, len(seen.watch) - 1)]
    following = np.roll(blocks[fits][lengths > 0, :axes], -1, axis=0)
    assert np.all((shown == ends).all(axis=1) | (shown == following).all(axis=1))


def test_clocks_of_a_block_and_between_blocks():
    """The first step waits in clock 8; then a step a clock, and one clock between two blocks."""
    points = np.array([(0, 0), (1, 0), (0, 0), (0, 1), (3, -9), (3, 0), (200, 99), (199, 99)])
    blocks = np.concatenate([points[:-1], points[1:]], axis=1)
    model = PysimModel(ExactLine(8, 2))
    seen = model.run(blocks, 900, until_answered=len(blocks), event_room=900)
    events = seen.events
    assert events[events[:, ACCEPTED] == 1, CLOCK][0] == 0
    taken = events[events[:, TAKEN] == 1]
    wanted, clock = [], 8
    for length in np.abs(blocks[:, 2:] - blocks[:, :2]).max(axis=1).tolist():
        wanted += range(clock, clock + length)
        clock += length + 1
    assert taken[:, CLOCK].tolist() == wanted
    done = events[events[:, DONE] == 1, CLOCK]
    assert done.tolist() == (taken[taken[:, -1] == 1, CLOCK] + 1).tolist()


@pytest.mark.parametrize("axes", [3, 6])
def test_clocks_of_more_axes(axes):
    blocks = np.zeros((4, 2 * axes), dtype=np.int64)
    blocks[:, axes] = [1, 40, 2, 40]
    seen = PysimModel(ExactLine(6, axes)).run(blocks, 900, until_answered=4, event_room=900)
    taken = seen.events[seen.events[:, TAKEN] == 1]
    first = taken[np.append(True, taken[:-1, -1] == 1), CLOCK]
    assert first[0] == axes + 6
    # Behind a long block the next one has been prepared.
    last = taken[taken[:, -1] == 1, CLOCK]
    assert first[2] == last[1] + 2
    # Behind a short one it comes a + 2 clocks after it.
    assert first[1] == first[0] + axes + 2


@pytest.mark.parametrize("stall", [0.0, 0.5])
def test_the_path_is_the_same_however_long_a_step_waits(stall):
    blocks = random_blocks(6, 3, 15, seed=9)
    free, held = (
        PysimModel(ExactLine(6, 3)).run(
            blocks, 5000, until_answered=15, stalls=stalls, event_room=5000
        )
        for stalls in (NO_STALLS, Stalls(7, stall=stall))
    )
    moves = [run.events[run.events[:, TAKEN] == 1, TAKEN + 1 :] for run in (free, held)]
    assert np.array_equal(moves[0], moves[1])
    assert (held.ran > free.ran) == (stall > 0)


@pytest.mark.parametrize("bad", BAD_WIDTHS, ids=repr)
def test_bad_width(bad):
    assert_refused(bad[1:], ExactLine, bad[0], 2)


@pytest.mark.parametrize("bad", BAD_AXES, ids=repr)
def test_bad_axes(bad):
    assert_refused(bad[1:], ExactLine, 8, bad[0])
