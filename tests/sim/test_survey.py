from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from discreta.hdl.linear import Linear
from discreta.sim import survey as module
from discreta.sim.methods import METHODS
from discreta.sim.survey import SurveyRow, survey, survey_lines
from tests.lines import distance, line_steps

WIDTH = 4
METHOD = METHODS["linear"]


@pytest.fixture
def one_process(monkeypatch):
    """Survey in this process, which has what a test has changed."""
    monkeypatch.setattr(module, "ProcessPoolExecutor", lambda _: ThreadPoolExecutor(1))


def rows_of(method, width=WIDTH):
    rows = {tuple(variant.values()): SurveyRow(variant) for variant in method.variants()}
    for part in survey(method, width):
        rows[tuple(part.variant.values())].add(part)
    return rows


def brute_force(normalize, preload):
    """Give the largest error, summations, and steps of the longer axes of all lines."""
    largest, summations, longest = 0.0, 0, 0
    for length in product(range(2**WIDTH), repeat=2):
        last = 0
        for t, point in line_steps(
            (0, 0), length, width=WIDTH, normalize=normalize, preload=preload
        ):
            largest = max(largest, distance(point, (0, 0), length))
            last = t
        summations += last
        longest += max(length)
    return largest, summations, longest


@pytest.mark.usefixtures("compiled_engine")
def test_every_line_of_4_bits():
    """On all cores, as the command runs it."""
    rows = rows_of(METHOD)
    assert len(rows) == 4
    for (normalize, preload), row in rows.items():
        largest, summations, longest = brute_force(normalize, preload)
        assert row.largest_error == pytest.approx(largest, abs=1e-12)
        assert (row.summations, row.longest) == (summations, longest)
        assert (row.lines, row.ends_missed, row.mismatches) == (256, 0, [])
        assert row.good
        line, point = row.error_at[:2], row.error_at[2:]
        assert distance(point, (0, 0), line) == pytest.approx(largest, abs=1e-12)
        lengths = [abs(value) for value in line]
        at = tuple(abs(value) for value in point)
        steps = line_steps((0, 0), lengths, width=WIDTH, normalize=normalize, preload=preload)
        assert at in [step for _, step in steps]


class Wrong(Linear):
    """Starts its summators from the other preload."""

    def __init__(self, width, axes, *, normalize, preload):
        other = {"zero": "half", "half": "zero"}[preload]
        super().__init__(width, axes, normalize=normalize, preload=other)


class Upright(Linear):
    """Moves along y alone."""

    def elaborate(self, platform):
        m = super().elaborate(platform)
        m.d.comb += self.input.blocks.payload.end.x.eq(self.blocks.payload.start.x)
        return m


def broken(monkeypatch, device, *preloads):
    """Make a method of a broken device, with the golden model of the sound one."""
    choices = {"normalize": (True,), "preload": preloads}
    method = replace(METHOD, name=device.__name__, device=device, choices=choices)
    monkeypatch.setitem(METHODS, method.name, method)
    return method


@pytest.mark.usefixtures("compiled_engine", "one_process")
def test_a_broken_device_is_reported(monkeypatch):
    rows = rows_of(broken(monkeypatch, Wrong, "half", "zero"))
    for (_, preload), row in rows.items():
        assert not row.good
        right, wrong = (8, 0) if preload == "half" else (0, 8)
        assert len(row.mismatches) == 1
        assert row.mismatches[0].startswith(f"sx is {wrong} in clock 0 of the line [")
        assert row.mismatches[0].endswith(f"], where the golden model has {right}")
        # It is judged by what it did: as the other preload.
        other = {"zero": "half", "half": "zero"}[preload]
        assert row.largest_error == pytest.approx(brute_force(True, other)[0], abs=1e-12)


@pytest.mark.usefixtures("compiled_engine", "one_process")
def test_ends_that_are_missed_are_counted(monkeypatch):
    (row,) = rows_of(broken(monkeypatch, Upright, "half")).values()
    assert not row.good
    # All lines but those that are upright anyway.
    assert (row.lines, row.ends_missed) == (256, 240)
    assert len(row.mismatches) == 1
    # The corner (0, 15) is that far from the line to (15, 15).
    assert row.largest_error == pytest.approx(15 / 2**0.5)


def test_parts_of_a_row_add_up():
    row = SurveyRow({}, lines=2, clocks=30, largest_error=0.5, error_at=(1, 2, 3, 4), longest=7)
    row.add(SurveyRow({}, lines=1, clocks=9, largest_error=0.7, error_at=(5, 6, 7, 8), longest=1))
    row.add(SurveyRow({}, lines=1, summations=3, largest_error=0.6, error_at=(9, 9, 9, 9)))
    assert row == SurveyRow(
        {}, lines=4, clocks=39, largest_error=0.7, error_at=(5, 6, 7, 8), longest=8, summations=3
    )
    assert row.good
    row.add(SurveyRow({}, ends_missed=1))
    assert not row.good
    assert not SurveyRow({}, mismatches=["p1 is 3"]).good


@pytest.mark.parametrize(("width", "exhaustive"), [(4, True), (8, True), (9, False), (18, False)])
def test_the_lines_are_as_said(width, exhaustive):
    lines, every = survey_lines(width)
    assert every == exhaustive
    lengths = np.abs(lines[:, 2:] - lines[:, :2])
    modulus = 2**width
    assert lengths.max() < modulus
    assert lines.min() >= -modulus
    assert lines.max() < modulus
    if exhaustive:
        assert len(lines) == modulus**2
        assert len(np.unique(lengths, axis=0)) == modulus**2
    else:
        assert 64 <= len(lines) <= 1 << 16
        assert lengths.max() > 0.9 * modulus
    # Every quadrant, and starts on either side.
    for column in range(2):
        assert {-1, 1} <= set(np.sign(lines[:, 2 + column] - lines[:, column]).tolist())
        assert {-1, 1} <= set(np.sign(lines[:, column]).tolist())
    np.testing.assert_array_equal(survey_lines(width)[0], lines)


@pytest.mark.parametrize("width", [19, 20, 32])
def test_a_width_that_takes_too_long_is_refused(width):
    message = (
        f"^width {width} is too large to survey: one line takes up to {2**width} clocks; "
        "choose a width up to 18$"
    )
    with pytest.raises(ValueError, match=message):
        survey_lines(width)
    with pytest.raises(ValueError, match=message):
        next(survey(METHOD, width))
