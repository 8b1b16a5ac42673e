"""Proves a method or a unit part by part; a process of its own for each uses all cores."""

from typing import Any

from discreta.sim.equal import netlist_equivalence, verilog_equivalence
from discreta.sim.methods import METHODS
from discreta.sim.smt import Verdict, check, equivalence
from discreta.sim.units import UNITS

__all__ = ["prove_netlist", "prove_variant", "prove_verilog", "shares"]

_DESIGNS = METHODS | UNITS


def shares(name: str) -> bool:
    """Tell whether something is promised of all variants of a method alike."""
    return hasattr(_DESIGNS[name].proof_module(), "shared")


def prove_verilog(name: str, width: int, variant: dict[str, Any]) -> list[Verdict]:
    """Prove that the Verilog of one variant, read again, is its RTL."""
    return [check(it) for it in verilog_equivalence(_DESIGNS[name].core(width, **variant))]


def prove_netlist(name: str, width: int, variant: dict[str, Any]) -> list[Verdict]:
    """Prove that the iCE40 netlist of one variant is its RTL."""
    return [check(it) for it in netlist_equivalence(_DESIGNS[name].core(width, **variant))]


def prove_variant(name: str, width: int, variant: dict[str, Any] | None) -> list[Verdict]:
    """Prove RTL = golden and the promises of one variant, in the plane.

    With None prove what is promised of all variants alike.
    """
    method = _DESIGNS[name]
    if variant is None:
        golden = method.model(width, **method.settings["default"])
        obligations = method.proof_module().shared(golden)
    else:
        golden = method.model(width, **variant)
        obligations = equivalence(method.core(width, **variant), golden)
        obligations += method.promises(golden)
    return [check(obligation) for obligation in obligations]
