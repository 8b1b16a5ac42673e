"""The units beside the methods: each can be made, is its golden model's, and is proven."""

import pytest
from amaranth.hdl import Fragment

from discreta.sim.methods import METHODS
from discreta.sim.units import UNITS


def test_names_are_those_of_no_method():
    of_lines = {"constant_line", "constant_arc", "link", "uart_receiver", "uart_transmitter"}
    assert set(UNITS) == {*of_lines, "feed", "pulse", "device"}
    assert not set(UNITS) & set(METHODS)


@pytest.mark.parametrize("unit", UNITS.values(), ids=UNITS)
def test_every_variant_is_its_golden_models(unit):
    """Registers of the same names and widths, whatever is chosen, in all numbers of axes."""
    for axes in unit.axes:
        for choices in unit.variants():
            core, golden = unit.core(6, axes, **choices), unit.model(6, axes, **choices)
            Fragment.get(core, None)  # it must be used
            registers = {
                name: (len(register), register.shape().signed)
                for name, register in core.registers.items()
            }
            assert registers == golden.registers()


@pytest.mark.parametrize("unit", UNITS.values(), ids=UNITS)
def test_settings_give_every_choice_a_value(unit):
    assert "default" in unit.settings
    for setting in unit.settings.values():
        assert setting.keys() == unit.choices.keys()
        Fragment.get(unit.core(6, **setting), None)


@pytest.mark.parametrize("name", ["constant_line", "constant_arc"])
def test_lines_and_arcs_at_constant_speed_are_proven(name):
    prover = pytest.importorskip("discreta.sim.prover")
    assert UNITS[name].axes == (2, 3, 4, 5, 6)
    assert not prover.shares(name)
    (variant,) = UNITS[name].variants()
    verdicts = prover.prove_variant(name, 4, variant)
    titles = [verdict.title for verdict in verdicts]
    for title in ("steps:", "ticks:", "blocks:", "debt:", "always goes on"):
        assert any(it.startswith(title) for it in titles), title
    assert [verdict for verdict in verdicts if not verdict.holds] == []
