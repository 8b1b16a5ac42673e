"""Every rung lets the sound design pass and catches just the broken variants that it must."""

from pathlib import Path

import pytest

from discreta.sim.methods import METHODS
from tests.broken import SOUND, VARIANTS, Variant
from tests.ladder import RUNGS, kind, matrix, missing

DESIGNS = [*SOUND, *VARIANTS]

# What takes seconds a design is tried on some, among them those that no other rung catches. The
# command `python -m tests.ladder` tries everything.
SOME = {
    ("linear", "promises"): {
        *("sound line, plain", "sum not gated", "late failure", "axis misread", "stall misread"),
    },
    ("linear", "compiled"): {"sound line", "carry dropped", "axis misread"},
    ("linear", "Verilator"): {"sound line", "step lost under stall"},
    ("comparison", "promises"): {
        *("sound comparison, lecture", "sums compared short", "other side at 45 degrees"),
        *("sum not cleared", "sum not reset", "first misread"),
    },
    ("comparison", "compiled"): {"sound comparison", "other side at 45 degrees", "first misread"},
    ("comparison", "Verilator"): set(),
    ("arc", "promises"): {"sign as printed", "way misread", "rim misread"},
    ("arc", "compiled"): {"way misread"},
    ("arc", "Icarus"): {"sound arc", "centre ignored", "crossing does not wait", "way misread"},
    ("arc", "Verilator"): set(),
    # It is proven and surveyed in tests of its own.
    ("exact_line", "promises"): {"one step too many"},
    ("exact_line", "compiled"): {"first residual rounded down"},
    ("exact_line", "Icarus"): {"sound exact line", "exact step lost under stall"},
    ("exact_line", "Verilator"): set(),
    # These are proven in tests of their own; there are their broken devices, too.
    **{("exact_conic", rung): set() for rung in RUNGS if rung != "Icarus"},
    ("exact_conic", "Icarus"): {"sound exact conic"},
    ("exact_arc", "promises"): {"missed end not seen"},
    # The survey of 8 bits is a command in CI.
    ("exact_arc", "compiled"): set(),
    ("exact_arc", "Icarus"): {"sound exact arc", "stalled step lost"},
    ("exact_arc", "Verilator"): set(),
    # The sound ones are proven and surveyed in tests of their own, and run in Verilator there.
    ("conic", "equivalence"): {"still axis holds up", "sharp not refused"},
    ("conic", "promises"): set(),
    ("conic", "compiled"): set(),
    ("conic", "Icarus"): {"sound conic", "own change forgotten", "preparation not reset"},
    ("conic", "Verilator"): set(),
    ("carrier_linear", "simulation"): {
        *("sound carrier line", "mean rounded up", "timer runs while increments wait"),
        *("increments placed too soon", "waiting increments not reset"),
    },
    ("carrier_linear", "equivalence"): {"sound carrier line", "waiting increments not reset"},
    ("carrier_linear", "promises"): {"last period like the others", "timing not refused"},
    ("carrier_linear", "compiled"): {"sound carrier line"},
    ("carrier_linear", "Icarus"): {"sound carrier line", "waiting increments not reset"},
    ("carrier_linear", "Verilator"): set(),
    ("carrier_circular", "documents"): {
        *("sound carrier arc", "sound carrier arc, lecture", "sound carrier arc, rotation"),
        *("new x used for y", "half turn lost", "predicted for the mean", "turning misread"),
    },
    ("carrier_circular", "simulation"): {"sound carrier arc", "product not cleared"},
    ("carrier_circular", "equivalence"): {"factor not coming round"},
    ("carrier_circular", "promises"): {"end of the prepared block"},
    ("carrier_circular", "compiled"): set(),
    ("carrier_circular", "Icarus"): {"sound carrier arc"},
    ("carrier_circular", "Verilator"): set(),
    ("two_stage_linear", "simulation"): {"sound two-stage line", "next start placed too soon"},
    ("two_stage_linear", "equivalence"): {"carry one too late", "second stage does not wait"},
    ("two_stage_linear", "promises"): {"carry one too late"},
    ("two_stage_linear", "compiled"): set(),
    ("two_stage_linear", "Icarus"): {"open block not reset"},
    ("two_stage_linear", "Verilator"): set(),
    ("two_stage_circular", "simulation"): set(),
    ("two_stage_circular", "equivalence"): set(),
    ("two_stage_circular", "promises"): set(),
    ("two_stage_circular", "compiled"): set(),
    ("two_stage_circular", "Icarus"): set(),
    ("two_stage_circular", "Verilator"): set(),
}

# How many broken variants a method has at least, if not 12. The stages of an arc in two stages are
# those of an arc on a carrier and of a line in two stages, whose variants tell of both; exact
# conics have theirs in tests/hdl.
FEWEST = {"exact_arc": 10, "exact_conic": 0}
FEWEST |= {"carrier_linear": 8, "two_stage_linear": 8, "two_stage_circular": 0}

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
    for some in [SOME.get((kind(design.method), rung), {design.name})]
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
        fewest = FEWEST.get(method, 12)
        assert len(variants) >= fewest
        assert all(variant.caught_by for variant in variants)
        assert set().union(*(variant.caught_by for variant in variants)) == set(RUNGS) or not fewest
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
