"""The whole device: the contract, clock by clock, and equality to the golden model."""

import numpy as np
import pytest

from discreta.hdl.linear import Linear
from discreta.sim.compiled import CompiledModel
from discreta.sim.golden.linear import Linear as GoldenLinear
from discreta.sim.interpreted import PysimModel
from discreta.sim.stalls import NO_STALLS, Stalls
from tests.hdl.parts.clocked import BAD_AXES, BAD_WIDTHS, assert_refused
from tests.hdl.traces import golden_trace
from tests.needs import needs_compiler

VARIANTS = [(normalize, preload) for normalize in (True, False) for preload in ("zero", "half")]
STALLS = [NO_STALLS, Stalls(1, stall=0.5, gap=0.3), Stalls(2, stall=0.9), Stalls(3, gap=0.9)]
CLOCK, ACCEPTED, DONE, ERROR, TAKEN = range(5)


def watched(golden):
    return tuple(f"reg_{name}" for name in golden.registers())


def random_blocks(width, axes, count, seed):
    """Blocks of all lengths and signs: too long, of no length, and behind one another."""
    random = np.random.default_rng(seed)
    span = 2 ** random.integers(0, width + 1, (count, 1))
    starts = random.integers(-(2**width), 2**width, (count, axes))
    moves = random.integers(-span, span, (count, axes), endpoint=True)
    ends = np.clip(starts + moves, -(2**width), 2**width - 1)
    ends[::5] = starts[::5]
    starts[1], ends[1] = -(2**width), 2**width - 1
    return np.concatenate([starts, ends], axis=1)


@pytest.mark.parametrize("stalls", STALLS, ids=str)
@pytest.mark.parametrize(("normalize", "preload"), VARIANTS)
@pytest.mark.parametrize(("width", "axes"), [(4, 2), (5, 3)])
def test_every_register_at_every_clock_in_pysim(width, axes, normalize, preload, stalls):
    golden = GoldenLinear(width, axes, normalize, preload)
    device = Linear(width, axes, normalize=normalize, preload=preload)
    model = PysimModel(device, watch=watched(golden))
    blocks = random_blocks(width, axes, 12, seed=width)
    seen = model.run(blocks, 6000, until_answered=len(blocks), stalls=stalls, event_room=6000)
    assert (seen.fed, seen.answered) == (12, 12)
    expected, _ = golden_trace(golden, model.block_fields, blocks, seen.ran, stalls)
    assert np.argwhere(seen.watch != expected).tolist() == []


@needs_compiler
@pytest.mark.parametrize("stalls", STALLS[:2], ids=str)
@pytest.mark.parametrize(("width", "axes"), [(8, 2), (12, 6), (32, 2)])
def test_every_register_at_every_clock_compiled(width, axes, stalls):
    golden = GoldenLinear(width, axes)
    model = CompiledModel(Linear(width, axes), watch=watched(golden))
    blocks = random_blocks(min(width, 8), axes, 25, seed=width)
    if width == 32:
        # Far out, where every bit of a coordinate counts.
        blocks[::2] += 2**32 - 2**9
        blocks[1] = [-(2**32), 0, 2**32 - 1, 5]
    seen = model.run(blocks, 60_000, until_answered=25, stalls=stalls, event_room=60_000)
    assert (seen.fed, seen.answered) == (25, 25)
    expected, _ = golden_trace(golden, model.block_fields, blocks, seen.ran, stalls)
    assert np.argwhere(seen.watch != expected).tolist() == []


@pytest.mark.parametrize(("normalize", "preload"), VARIANTS)
def test_clocks_of_a_block_and_between_blocks(normalize, preload):
    """Started in clock 1, summed from 2; a step a clock later; no clock lost between blocks."""
    device = Linear(8, 2, normalize=normalize, preload=preload)
    points = np.array([(0, 0), (200, 99), (199, 99), (199, 100), (0, -50), (3, 3)])
    blocks = np.concatenate([points[:-1], points[1:]], axis=1)
    model = PysimModel(device, watch=("reg_running",))
    seen = model.run(blocks, 3000, until_answered=5, event_room=3000)
    running = np.flatnonzero(seen.watch[:, 0])
    events = seen.events
    last = events[(events[:, TAKEN] == 1) & (events[:, -1] == 1), CLOCK]
    done = events[events[:, DONE] == 1, CLOCK]
    assert running[0] == 2
    assert len(last) == 5
    assert np.array_equal(done, last + 1)
    # Every clock from the first summation on sums, but for the one in which a last step is taken
    # and the next block is started.
    assert sorted([*running, *last]) == list(range(2, last[-1] + 1))

    lengths = np.abs(blocks[:, 2:] - blocks[:, :2])
    for length, begin, end in zip(lengths, [1, *last[:-1]], last, strict=True):
        scale = 2 ** (8 - int(length.max()).bit_length()) if normalize else 1
        initial = 128 if preload == "half" else 0
        # The last carry of an axis comes when S₀ + t·P reaches M·L.
        summations = max(-(-(256 * n - initial) // (n * scale)) for n in length.tolist() if n)
        assert end - begin - 1 == summations


@pytest.mark.parametrize("stall", [0.0, 0.5])
def test_the_path_is_the_same_however_long_a_step_waits(stall):
    blocks = random_blocks(6, 3, 15, seed=9)
    free, held = (
        PysimModel(Linear(6, 3)).run(
            blocks, 5000, until_answered=15, stalls=stalls, event_room=5000
        )
        for stalls in (NO_STALLS, Stalls(7, stall=stall))
    )
    moves = [run.events[run.events[:, TAKEN] == 1, TAKEN + 1 :] for run in (free, held)]
    assert np.array_equal(moves[0], moves[1])
    assert (held.ran > free.ran) == (stall > 0)


def test_ends_answers_and_single_steps():
    blocks = random_blocks(6, 2, 60, seed=4)
    watch = ("position_x", "position_y")
    model = PysimModel(Linear(6, 2), watch=watch)
    seen = model.run(blocks, 9000, until_answered=60, stalls=Stalls(5, 0.2, 0.2), event_room=9000)
    answers = seen.events[(seen.events[:, DONE] == 1) | (seen.events[:, ERROR] == 1)]
    too_long = np.abs(blocks[:, 2:] - blocks[:, :2]).max(axis=1) > 63
    assert 0 < too_long.sum() < 60
    assert answers[:, ERROR].tolist() == too_long.astype(int).tolist()
    assert answers[:, DONE].tolist() == (~too_long).astype(int).tolist()
    for answer, block in zip(answers, blocks, strict=True):
        if answer[DONE]:
            # The position in the clock of done, or the next block's start if that follows at once.
            before = seen.watch[answer[CLOCK] - 1]
            step = seen.events[seen.events[:, CLOCK] == answer[CLOCK] - 1]
            move = step[0, TAKEN + 1 : TAKEN + 3] if len(step) and step[0, TAKEN] else 0
            if np.any(block[:2] != block[2:]):
                assert (before + move).tolist() == block[2:].tolist()
    steps = seen.events[seen.events[:, TAKEN] == 1, TAKEN + 1 : TAKEN + 3]
    assert np.abs(steps).max() == 1
    assert np.any(steps != 0, axis=1).all()


@pytest.mark.parametrize("bad", BAD_WIDTHS, ids=repr)
def test_bad_width(bad):
    assert_refused(bad[1:], Linear, bad[0], 2)


@pytest.mark.parametrize("bad", BAD_AXES, ids=repr)
def test_bad_axes(bad):
    assert_refused(bad[1:], Linear, 8, bad[0])


def test_bad_options():
    message = "preload is 'full': choose 'zero' or 'half'"
    assert_refused((ValueError, message), Linear, 8, 2, preload="full")
    message = "normalize must be True or False, not 1"
    assert_refused((TypeError, message), Linear, 8, 2, normalize=1)
