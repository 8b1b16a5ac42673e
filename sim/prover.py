"""Proves one variant of a method; a process of its own for each uses all cores."""

from typing import Any

from discreta.sim.methods import METHODS
from discreta.sim.smt import Verdict, check, equivalence

__all__ = ["prove_variant"]


def prove_variant(name: str, width: int, variant: dict[str, Any]) -> list[Verdict]:
    """Prove RTL = golden and the promises of one variant, in the plane."""
    method = METHODS[name]
    golden = method.golden(width, 2, **variant)
    obligations = equivalence(method.device(width, 2, **variant), golden)
    return [check(obligation) for obligation in obligations + method.promises(golden)]
