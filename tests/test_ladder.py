"""Every rung lets the sound design pass and catches just the broken variants that it must."""

from pathlib import Path

import pytest

from discreta.sim.methods import METHODS
from tests.broken import SOUND, VARIANTS, Variant
from tests.ladder import RUNGS, matrix, missing

DESIGNS = [*SOUND, *VARIANTS]

# What takes seconds a design is tried on some, among them those that no other rung catches. The
# command `python -m tests.ladder` tries everything.
SOME = {
    ("line", "Verilator"): {"sound line", "carry dropped", "step lost under stall"},
    ("comparison", "promises"): {
        *("sound comparison, lecture", "sums compared short", "other side at 45 degrees"),
        *("sum not cleared", "sum not reset", "first misread"),
    },
    ("comparison", "compiled"): {"sound comparison", "other side at 45 degrees", "first misread"},
    ("comparison", "Verilator"): {"sound comparison"},
    ("arc", "promises"): {"sign as printed", "way misread", "rim misread"},
    ("arc", "compiled"): {"sound arc", "way misread"},
    ("arc", "Icarus"): {"sound arc", "centre ignored", "crossing does not wait", "way misread"},
    ("arc", "Verilator"): {"sound arc"},
    # The sound ones are proven and surveyed in tests of their own, and run in Verilator there.
    ("conic", "equivalence"): {"still axis holds up", "sharp not refused"},
    ("conic", "promises"): set(),
    ("conic", "compiled"): set(),
    ("conic", "Icarus"): {"sound conic", "own change forgotten", "preparation not reset"},
    ("conic", "Verilator"): set(),
}

# What the promises of arcs fail on first; all that come before it hold.
FIRST_BROKEN = {
    ("sign as printed", "promises"): "invariant: to an axis P3 = P1 and P2 + P4 = L",
    ("way misread", "promises"): "accepted: ",
    ("rim misread", "promises"): "verdict: ",
}

JOBS = [
    pytest.param(design, rung, id=f"{design.name}-{rung}".replace(" ", "_"))
    for design in DESIGNS
    for rung in RUNGS
    for some in [SOME.get((design.method.curve, rung), {design.name})]
    if design.name in SOME.get((design.method.name, rung), some)
]


@pytest.mark.parametrize(("design", "rung"), JOBS)
def test_a_rung_catches_just_what_it_must(design: Variant, rung: str):
    if reason := missing(rung):
        pytest.skip(reason)
    finding = RUNGS[rung](design)
    assert (finding != "") == (rung in design.caught_by), finding or "nothing was seen"
    assert finding.startswith(FIRST_BROKEN.get((design.name, rung), ""))
    assert len(finding.splitlines()) <= 1


def test_every_variant_is_caught_and_every_rung_is_needed():
    for method in METHODS:
        variants = [variant for variant in VARIANTS if variant.method.name == method]
        assert len(variants) >= 12
        assert all(variant.caught_by for variant in variants)
        assert set().union(*(variant.caught_by for variant in variants)) == set(RUNGS)
        assert any(design.method.name == method for design in SOUND)
    assert not any(design.caught_by for design in SOUND)
    names = [design.name for design in DESIGNS]
    assert len(names) == len(set(names))
    assert set(names) >= set().union(*SOME.values())


def test_the_documentation_shows_the_matrices_and_what_is_broken():
    page = (Path(__file__).parents[1] / "docs" / "ladder.md").read_text(encoding="utf-8")
    for method in METHODS:
        assert matrix(method, {design.name: design.caught_by for design in DESIGNS}) in page
    for variant in VARIANTS:
        assert f"| {variant.name} | {variant.what} |" in page
