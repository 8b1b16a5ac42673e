"""Proves a method or a unit part by part; a process of its own for each uses all cores."""

from typing import Any

from discreta.sim.methods import METHODS
from discreta.sim.smt import Verdict, check, equivalence
from discreta.sim.units import UNITS

__all__ = ["prove_variant", "shares"]

_DESIGNS = METHODS | UNITS


def shares(name: str) -> bool:
    """Tell whether something is promised of all variants of a method alike."""
    return hasattr(_DESIGNS[name].proof_module(), "shared")


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
