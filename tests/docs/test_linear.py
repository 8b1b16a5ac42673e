"""The measured table of docs/linear.md, measured again: every line of 8 bits (rung 5)."""

from pathlib import Path

from discreta.sim.groups import survey_groups
from discreta.sim.methods import METHODS
from discreta.sim.run import say_choices
from discreta.sim.survey import SurveyRow, say_worst, survey
from tests.needs import needs_compiler

PAGE = Path(__file__).parents[2] / "docs/linear.md"
LINEAR = METHODS["linear"]

#: All four variants take a minute: `discreta survey linear --width 8` runs them, and compares every
#: register, where this does so in some clocks. The lecture's own takes four times as many clocks.
SURVEYED = [{"normalize": True, "preload": preload} for preload in ("half", "zero")]
COMPARED = 1 << 21


@needs_compiler
def test_every_line_of_8_bits(monkeypatch):
    monkeypatch.setattr("discreta.sim.survey.REGISTER_BUDGET", COMPARED)
    method = LINEAR
    (lines,) = survey_groups(method, 8)
    rows = {say_choices(variant): SurveyRow(variant, 0) for variant in SURVEYED}
    for part in survey(method, 8, [lines], SURVEYED):
        rows[say_choices(part.variant)].add(part)
    page = PAGE.read_text(encoding="utf-8")
    for name, row in rows.items():
        assert row.good, row.findings
        assert row.blocks == 65536
        assert row.compared > 4000
        # From the design: all 8-bit lines, preload zero and half.
        assert f"{row.largest_error:.4f}" == ("0.9961" if "zero" in name else "0.7044")
        cells = [name, f"{row.largest_error:.4f}", *say_worst(method, lines, row)]
        cells += [f"{row.summations / row.length:.4f}", str(row.ends_missed)]
        assert f"| {' | '.join(cells)} |" in page
