"""Every rung lets the sound design pass and catches just the broken variants that it must."""

from pathlib import Path

import pytest

from tests.broken import SOUND, VARIANTS, Variant
from tests.ladder import RUNGS, matrix, missing

DESIGNS = [*SOUND, *VARIANTS]

# Verilator takes four seconds a design and must agree with Icarus: some will do. The command
# `python -m tests.ladder` takes them all.
IN_VERILATOR = {"sound", "carry dropped", "step lost under stall"}

JOBS = [
    pytest.param(design, rung, id=f"{design.name}-{rung}".replace(" ", "_"))
    for design in DESIGNS
    for rung in RUNGS
    if rung != "Verilator" or design.name in IN_VERILATOR
]


@pytest.mark.parametrize(("design", "rung"), JOBS)
def test_a_rung_catches_just_what_it_must(design: Variant, rung: str):
    if reason := missing(rung):
        pytest.skip(reason)
    finding = RUNGS[rung](design)
    assert (finding != "") == (rung in design.caught_by), finding or "nothing was seen"
    assert len(finding.splitlines()) <= 1


def test_every_variant_is_caught_and_every_rung_is_needed():
    assert len(VARIANTS) >= 8
    assert all(variant.caught_by for variant in VARIANTS)
    assert set().union(*(variant.caught_by for variant in VARIANTS)) == set(RUNGS)
    assert not any(design.caught_by for design in SOUND)
    assert {design.name for design in DESIGNS} >= IN_VERILATOR


def test_the_documentation_shows_the_matrix_and_what_is_broken():
    page = (Path(__file__).parents[1] / "docs" / "ladder.md").read_text(encoding="utf-8")
    assert matrix({design.name: design.caught_by for design in DESIGNS}) in page
    for variant in VARIANTS:
        assert f"| {variant.name} | {variant.what} |" in page
