"""Some of the measured table of docs/circular.md, measured again: quarter arcs of 8 bits."""

from itertools import product
from pathlib import Path

import pytest

from discreta.sim.groups import survey_groups
from discreta.sim.methods import METHODS
from discreta.sim.run import say_choices
from discreta.sim.survey import SurveyRow, survey

PAGE = Path(__file__).parents[2] / "docs/circular.md"
CIRCULAR = METHODS["circular"]

#: Largest errors of the design's own trial, in hundredths of a step, by order and preload.
TRIAL = {
    ("alternated", "half"): (92, 95),
    ("alternated", "zero"): (146, 148),
    ("simultaneous", "half"): (124, 126),
    ("simultaneous", "zero"): (177, 177),
}
SURVEYED = [
    {"order": order, "preload": preload, "normalize": True, "guard": 0} for order, preload in TRIAL
]


@pytest.mark.usefixtures("compiled_engine")
def test_every_quarter_arc_of_8_bits():
    quarters = survey_groups(CIRCULAR, 8)[0]
    variants = [*SURVEYED[::3], CIRCULAR.settings["default"]]
    rows = {say_choices(variant): SurveyRow(variant, 0) for variant in variants}
    for part in survey(CIRCULAR, 8, [quarters], variants):
        rows[say_choices(part.variant)].add(part)
    page = PAGE.read_text(encoding="utf-8")
    for name, row in rows.items():
        assert row.good, row.findings
        assert row.blocks == row.compared == 255
        radius = quarters.blocks[row.error_index, 0]
        assert f"| {name} | {row.largest_error:.4f} at {radius} |" in page
    for variant in SURVEYED[::3]:
        low, high = TRIAL[variant["order"], variant["preload"]]
        assert low <= round(100 * rows[say_choices(variant)].largest_error) <= high


def test_the_page_has_every_variant():
    page = PAGE.read_text(encoding="utf-8")
    for values in product(*CIRCULAR.choices.values()):
        name = say_choices(dict(zip(CIRCULAR.choices, values, strict=True)))
        assert f"| {name} |" in page
