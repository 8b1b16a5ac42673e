"""Every method there is, found by its name: device, golden model, promises, and what to expect."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from itertools import product
from typing import Any

import numpy as np

from discreta.hdl.contract import Part
from discreta.hdl.linear import Linear
from discreta.sim.golden.linear import Linear as GoldenLinear

__all__ = ["METHODS", "Method"]


@dataclass(frozen=True)
class Method:
    """A method of interpolation.

    Attributes
    ----------
    name : str
    summary : str
        What it draws and how, in a few words.
    error_bound : str
        Largest distance from the true curve in the plane, in steps.
    clocks_per_step : str
    device, golden : callable
        Make the RTL and the golden model from the same parameters.
    choices : dict of str to tuple
        The parameters besides ``width`` and ``axes``, and what they may be.
    summations : callable
        ``summations(golden, lengths)``: the most summations that blocks take; ``lengths`` has shape
        (blocks, axes), in steps.
    bound : callable
        ``bound(golden)``: the error bound of one model, in steps.
    """

    name: str
    summary: str
    error_bound: str
    clocks_per_step: str
    device: Callable[..., Part]
    golden: Callable[..., Any]
    choices: dict[str, tuple[Any, ...]]
    summations: Callable[[Any, np.ndarray], np.ndarray]
    bound: Callable[[Any], float]

    def promises(self, golden: Any) -> list:
        """Give what is proven of the method beyond its equality to the golden model."""
        # Only the prover needs the solver.
        return import_module(f"discreta.sim.proofs.{self.name}").promises(golden)

    def variants(self) -> list[dict[str, Any]]:
        """Give every combination of the choices."""
        return [
            dict(zip(self.choices, values, strict=True))
            for values in product(*self.choices.values())
        ]


def _linear_summations(golden: GoldenLinear, lengths: np.ndarray) -> np.ndarray:
    """2^bitlen of the longest axis, or 2^n without the normalizer."""
    longest = np.max(lengths, axis=1)
    if not golden.normalize:
        return np.where(longest > 0, 2**golden.width, 0)
    return np.array([1 << int(length).bit_length() for length in longest]) * (longest > 0)


def _linear_bound(golden: GoldenLinear) -> float:
    """Half a step, or less than one, on every axis but along the line: √a / 2 and √(a − 1)."""
    return math.sqrt(golden.axes) / 2 if golden.preload == "half" else math.sqrt(golden.axes - 1)


METHODS = {
    method.name: method
    for method in (
        Method(
            name="linear",
            summary="line in 2 to 6 axes by summation of its increments (DDA)",
            error_bound="1 (preload zero), √½ (half)",
            clocks_per_step="1 to 2 (normalized), 2^n a line (not)",
            device=Linear,
            golden=GoldenLinear,
            choices={"normalize": (True, False), "preload": ("half", "zero")},
            summations=_linear_summations,
            bound=_linear_bound,
        ),
    )
}
