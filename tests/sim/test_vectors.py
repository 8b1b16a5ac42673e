from itertools import pairwise

import pytest
from amaranth.hdl import Fragment

from discreta.hdl.plain import PlainPorts
from discreta.sim.methods import METHODS
from discreta.sim.units import UNITS
from discreta.sim.vectors import golden_vectors

DESIGNS = METHODS | UNITS


def vectors_of(name, width=6, **others):
    design = DESIGNS[name]
    choices = design.settings["default"] | others
    top = PlainPorts(design.core(width, **choices))
    Fragment.get(top, None)  # a core that is made must be elaborated
    return golden_vectors(design, top, design.model(width, **choices)), top


@pytest.mark.parametrize("name", METHODS)
def test_what_a_method_is_given(name):
    """Blocks of all kinds with and without stalls, two resets, and a long block at the end."""
    vectors, top = vectors_of(name)
    assert list(vectors.inputs) == ["rst", *top.inputs]
    assert list(vectors.outputs) == list(top.outputs)
    columns = [*vectors.inputs.values(), *vectors.outputs.values()]
    assert {len(column) for column in columns} == {vectors.clocks}
    assert vectors.answers >= (4 if METHODS[name].curve == "arc" and METHODS[name].timed else 12)
    assert vectors.steps > 10
    assert any(vectors.outputs["error"])
    resets = [clock for clock, rst in enumerate(vectors.inputs["rst"]) if rst]
    assert len(resets) == 3
    assert resets[0] == 0
    assert vectors.outputs["busy"][resets[1]]
    assert not vectors.outputs["busy"][resets[2]]
    stalls = [clock for clock, ready in enumerate(vectors.inputs["steps_ready"]) if not ready]
    assert 0.05 * vectors.clocks < len(stalls) < 0.3 * vectors.clocks
    # Of a block that is not offered nothing is known.
    for name in top.block_fields:
        offered = [value is not None for value in vectors.inputs[name]]
        assert offered == [bool(valid) for valid in vectors.inputs["blocks_valid"]]


def test_what_the_device_is_given():
    vectors, _ = vectors_of("device")
    assert set(vectors.inputs["blocks_kind"]) == {None, 0, 1, 2, 3}
    assert set(vectors.outputs["reason"]) >= {0, 1, 2, 3}
    assert vectors.answers > 12
    assert vectors.steps > 200


@pytest.mark.parametrize("name", ["feed", "pulse"])
def test_every_output_of_a_unit_changes_often(name):
    vectors, _ = vectors_of(name)
    for port, column in vectors.outputs.items():
        assert sum(a != b for a, b in pairwise(column)) > 15, port


@pytest.mark.parametrize("name", ["linear", "device"])
def test_the_same_ones_every_time(name):
    assert vectors_of(name)[0] == vectors_of(name)[0]


def test_no_more_clocks_than_asked_for():
    design = METHODS["linear"]
    golden = design.model(16, normalize=False, preload="zero")
    top = PlainPorts(design.core(16, normalize=False, preload="zero"))
    Fragment.get(top, None)
    vectors = golden_vectors(design, top, golden, clocks=500)
    assert vectors.clocks == 500
    assert vectors.steps > 0
