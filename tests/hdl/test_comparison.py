"""The whole device: the article's table, the contract, and equality to the golden model."""

from pathlib import Path

import numpy as np
import pytest

from discreta.hdl.comparison import Comparison
from discreta.sim.compiled import CompiledModel
from discreta.sim.golden.comparison import Comparison as GoldenComparison
from discreta.sim.interpreted import PysimModel
from discreta.sim.stalls import NO_STALLS, Stalls
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused
from tests.hdl.traces import golden_trace
from tests.lines import article
from tests.needs import needs_compiler

VARIANTS = [(form, first) for form in ("signed", "two") for first in ("x", "y")]
STALLS = [NO_STALLS, Stalls(1, stall=0.5, gap=0.3), Stalls(2, stall=0.9), Stalls(3, gap=0.9)]
CLOCK, ACCEPTED, DONE, ERROR, TAKEN = range(5)

#: The line of the article's table.
ARTICLE = (5, 2, 35, 20)


def watched(golden):
    return tuple(f"reg_{name}" for name in golden.registers())


def random_blocks(width, count, seed):
    """Blocks of all lengths and signs: too long, of no length, at 45°, and behind one another."""
    random = np.random.default_rng(seed)
    span = 2 ** random.integers(0, width + 1, (count, 1))
    starts = random.integers(-(2**width), 2**width, (count, 2))
    moves = random.integers(-span, span, (count, 2), endpoint=True)
    ends = np.clip(starts + moves, -(2**width), 2**width - 1)
    ends[::5] = starts[::5]
    starts[1], ends[1] = -(2**width), 2**width - 1
    starts[2], ends[2] = (0, 3), (3, 0)
    return np.concatenate([starts, ends], axis=1)


def article_table(form="two"):
    """Run the article's line through the RTL, and give x, y, Sx, Sy, Sx − Sy as a Markdown table.

    With one summator there is only the difference to show.
    """
    sums = ("reg_sx", "reg_sy") if form == "two" else ("reg_s",)
    watch = ("position_x", "position_y", *sums)
    model = PysimModel(Comparison(8, form=form), watch=watch)
    seen = model.run(np.array([ARTICLE]), 60).watch.tolist()
    lines = ["| x | y | Sx | Sy | Sx − Sy |", "|---|---|---|---|---|"]
    if form == "signed":
        lines = ["| x | y | S |", "|---|---|---|"]
    for t in range(49):
        # The first summation is in clock 2; its step is taken in clock 3, as the sum shows.
        point, after = seen[3 + t][:2], seen[2 + t][2:]
        difference = [after[0] - after[1]] if form == "two" else []
        row = [*point, *after, *difference]
        lines.append(f"| {' | '.join(str(value).replace('-', '−') for value in row)} |")
    return "\n".join(lines)


@pytest.mark.parametrize("form", ["two", "signed"])
def test_the_table_of_the_article_row_by_row(form):
    """All 48 steps; tests/sim/golden/test_comparison.py has the rows that the article prints."""
    rows = [
        [int(cell.replace("−", "-")) for cell in line.strip("| ").split("|")]
        for line in article_table(form).splitlines()[2:]
    ]
    expected = list(article(ARTICLE, x_leads=True))
    if form == "signed":
        expected = [(x, y, s) for x, y, _, _, s in expected]
    assert rows == [list(row) for row in expected]


@pytest.mark.parametrize("stalls", STALLS, ids=str)
@pytest.mark.parametrize(("form", "first"), VARIANTS)
def test_every_register_at_every_clock_in_pysim(form, first, stalls):
    golden = GoldenComparison(4, form, first)
    model = PysimModel(Comparison(4, form=form, first=first), watch=watched(golden))
    blocks = random_blocks(4, 12, seed=4)
    seen = model.run(blocks, 6000, until_answered=len(blocks), stalls=stalls, event_room=6000)
    assert (seen.fed, seen.answered) == (12, 12)
    expected, _ = golden_trace(golden, model.block_fields, blocks, seen.ran, stalls)
    assert np.argwhere(seen.watch != expected).tolist() == []


@needs_compiler
@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize("stalls", STALLS[:2], ids=str)
@pytest.mark.parametrize(("width", "form"), [(8, "signed"), (16, "two"), (32, "signed")])
def test_every_register_at_every_clock_compiled(width, form, stalls):
    golden = GoldenComparison(width, form)
    model = CompiledModel(Comparison(width, form=form), watch=watched(golden))
    blocks = random_blocks(min(width, 8), 25, seed=width)
    if width == 32:
        # Far out, where every bit of a coordinate counts.
        blocks[::2] += 2**32 - 2**9
        blocks[1] = [-(2**32), 0, 2**32 - 1, 5]
    seen = model.run(blocks, 60_000, until_answered=25, stalls=stalls, event_room=60_000)
    assert (seen.fed, seen.answered) == (25, 25)
    expected, _ = golden_trace(golden, model.block_fields, blocks, seen.ran, stalls)
    assert np.argwhere(seen.watch != expected).tolist() == []


@pytest.mark.parametrize("form", ["signed", "two"])
def test_clocks_of_a_block_and_between_blocks(form):
    """Started in clock 1, summed from 2; a step a clock later; no clock lost between blocks."""
    points = np.array([(0, 0), (200, 99), (199, 99), (199, 100), (0, -50), (3, 3)])
    blocks = np.concatenate([points[:-1], points[1:]], axis=1)
    model = PysimModel(Comparison(8, form=form), watch=("reg_running",))
    seen = model.run(blocks, 3000, until_answered=5, event_room=3000)
    events = seen.events
    taken = events[events[:, TAKEN] == 1]
    last = taken[taken[:, -1] == 1, CLOCK]
    assert np.flatnonzero(seen.watch[:, 0])[0] == 2
    assert np.array_equal(events[events[:, DONE] == 1, CLOCK], last + 1)
    # A clock for every step, and one in which the next block is started.
    lengths = np.abs(blocks[:, 2:] - blocks[:, :2]).sum(axis=1)
    assert np.diff([1, *last]).tolist() == (lengths + 1).tolist()
    assert len(taken) == lengths.sum()
    # One axis a step.
    assert np.abs(taken[:, TAKEN + 1 : TAKEN + 3]).sum(axis=1).tolist() == [1] * len(taken)


@pytest.mark.parametrize("stalls", STALLS[:2], ids=str)
def test_both_forms_take_the_same_steps_at_the_same_clocks(stalls):
    blocks = random_blocks(6, 20, seed=8)
    signed, two = (
        PysimModel(Comparison(6, form=form)).run(
            blocks, 5000, until_answered=20, stalls=stalls, event_room=5000
        )
        for form in ("signed", "two")
    )
    assert signed.answered == 20
    assert np.array_equal(signed.events, two.events)


def test_ends_and_answers():
    blocks = random_blocks(6, 60, seed=4)
    model = PysimModel(Comparison(6))
    seen = model.run(blocks, 9000, until_answered=60, stalls=Stalls(5, 0.2, 0.2), event_room=9000)
    events = seen.events
    too_long = np.abs(blocks[:, 2:] - blocks[:, :2]).max(axis=1) > 63
    assert 0 < too_long.sum() < 60
    answers = events[(events[:, DONE] == 1) | (events[:, ERROR] == 1)]
    assert answers[:, ERROR].tolist() == too_long.astype(int).tolist()
    # A block's steps come before its answer, and lead from its start to its end.
    moved = np.zeros(2, dtype=np.int64)
    number = 0
    for event in events:
        if event[DONE] or event[ERROR]:
            whole = np.zeros(2) if too_long[number] else blocks[number, 2:] - blocks[number, :2]
            assert moved.tolist() == whole.tolist()
            moved, number = np.zeros(2, dtype=np.int64), number + 1
        if event[TAKEN]:
            moved = moved + event[TAKEN + 1 : TAKEN + 3]
    assert number == 60


@pytest.mark.parametrize("bad", BAD_WIDTHS, ids=repr)
def test_bad_width(bad):
    assert_refused(bad[1:], Comparison, bad[0])


def test_bad_options():
    message = "form is 'three': choose 'signed' or 'two'"
    assert_refused((ValueError, message), Comparison, 8, form="three")
    message = "first is 'z': choose 'x' or 'y'"
    assert_refused((ValueError, message), Comparison, 8, first="z")


def test_the_page_shows_what_the_device_does():
    page = (Path(__file__).parents[2] / "docs" / "comparison.md").read_text(encoding="utf-8")
    assert f"\n\n{article_table()}\n\n" in page
