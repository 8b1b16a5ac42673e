"""Every method there is, found by its name: device, golden model, promises, and what to expect."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from itertools import product
from typing import Any

import numpy as np

from discreta.hdl.circular import Circular
from discreta.hdl.conic import Conic
from discreta.hdl.contract import Part
from discreta.hdl.linear import Linear
from discreta.sim.golden.circular import Circular as GoldenCircular
from discreta.sim.golden.conic import Conic as GoldenConic
from discreta.sim.golden.linear import Linear as GoldenLinear

__all__ = ["METHODS", "Method"]


@dataclass(frozen=True)
class Method:
    """A method of interpolation.

    Attributes
    ----------
    name : str
    curve : str
        What its blocks are: ``"line"`` or ``"arc"``.
    summary : str
        What it draws and how, in a few words.
    error_bound : str
        Largest distance from the true curve in the plane, in steps.
    clocks_per_step : str
    device, golden : callable
        Make the RTL and the golden model from the same parameters; see :meth:`core`.
    axes : tuple of int
        How many axes it can have.
    choices : dict of str to tuple
        The parameters besides ``width`` and ``axes``, and the values of them that are surveyed and
        proven.
    settings : dict of str to dict
        Values for all choices, by name: ``"default"``, and ``"lecture"`` for the machine of the
        documents.
    clocks : callable
        ``clocks(golden, blocks)``: the most clocks that each block takes from its acceptance to its
        last step, alone and without stalls; ``blocks`` has shape (blocks, block fields).
    bound : callable
        ``bound(golden)``: the proven error bound of one model, in steps; None without one.
    """

    name: str
    curve: str
    summary: str
    error_bound: str
    clocks_per_step: str
    device: Callable[..., Part]
    golden: Callable[..., Any]
    axes: tuple[int, ...]
    choices: dict[str, tuple[Any, ...]]
    settings: dict[str, dict[str, Any]]
    clocks: Callable[[Any, np.ndarray], np.ndarray]
    bound: Callable[[Any], float | None]

    def core(self, width: int, axes: int = 2, **choices: Any) -> Part:
        """Make the RTL; ``TypeError`` or ``ValueError`` for what its constructor refuses."""
        return self.device(width, **self._axes(axes), **choices)

    def model(self, width: int, axes: int = 2, **choices: Any) -> Any:
        """Make the golden model."""
        return self.golden(width, **self._axes(axes), **choices)

    def _axes(self, axes: int) -> dict[str, int]:
        """Name the number of axes for a method that leaves a choice."""
        return {"axes": axes} if len(self.axes) > 1 else {}

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


def _linear_clocks(golden: GoldenLinear, blocks: np.ndarray) -> np.ndarray:
    """2^bitlen of the longest axis, or 2^n without the normalizer, and what stands around them."""
    lengths = np.abs(blocks[:, golden.axes :] - blocks[:, : golden.axes])
    longest = np.max(lengths, axis=1)
    if golden.normalize:
        summations = np.array([1 << int(length).bit_length() for length in longest], dtype=np.int64)
    else:
        summations = np.full(len(blocks), 1 << golden.width)
    return np.where(longest > 0, summations, 0) + 4


def _linear_bound(golden: GoldenLinear) -> float:
    """Half a step, or less than one, on every axis but along the line: √a / 2 and √(a − 1)."""
    return math.sqrt(golden.axes) / 2 if golden.preload == "half" else math.sqrt(golden.axes - 1)


def _circular_clocks(golden: GoldenCircular, blocks: np.ndarray) -> np.ndarray:
    """A right angle and some steps for every piece, its preparation, and what stands around it."""
    start, center = blocks[:, :2].astype(float), blocks[:, 4:6].astype(float)
    radius = np.hypot(*(start - center).T) + 2
    bits = np.ceil(np.log2(radius)) if golden.normalize else float(golden.width)
    pieces = 5 + 4 * blocks[:, 7]
    per_piece = (math.pi / 2 + 4) * 2.0 ** (bits + golden.guard)
    return (pieces * per_piece).astype(np.int64) + pieces + 2 * golden.width + 12


METHODS = {
    method.name: method
    for method in (
        Method(
            name="linear",
            curve="line",
            summary="line in 2 to 6 axes by summation of its increments (DDA)",
            error_bound="1 (preload zero), √½ (half)",
            clocks_per_step="1 to 2 (normalized), 2^n a line (not)",
            device=Linear,
            golden=GoldenLinear,
            axes=(2, 3, 4, 5, 6),
            choices={"normalize": (True, False), "preload": ("half", "zero")},
            settings={
                "default": {"normalize": True, "preload": "half"},
                "lecture": {"normalize": False, "preload": "zero"},
            },
            clocks=_linear_clocks,
            bound=_linear_bound,
        ),
        Method(
            name="circular",
            curve="arc",
            summary="arc of any length by cross-coupled summation of its coordinates (DDA)",
            error_bound="0.77 a quarter arc (default), 1.8 (lecture); measured",
            clocks_per_step="5.6 (default), 1.4 (normalized, no guard bits)",
            device=Circular,
            golden=GoldenCircular,
            axes=(2,),
            choices={
                "order": ("alternated", "simultaneous"),
                "preload": ("half", "zero"),
                "normalize": (True, False),
                "guard": (2, 0),
            },
            settings={
                "default": {
                    "order": "alternated",
                    "preload": "half",
                    "normalize": True,
                    "guard": 2,
                },
                "lecture": Circular.LECTURE,
            },
            clocks=_circular_clocks,
            bound=lambda _: None,
        ),
        Method(
            name="conic",
            curve="conic",
            summary="any curve of the second order by summation of its two derivatives (DDA)",
            error_bound="surveyed",
            clocks_per_step="surveyed",
            device=Conic,
            golden=GoldenConic,
            axes=(2,),
            choices={
                "order": ("implicit", "alternated", "simultaneous"),
                "preload": ("half", "zero"),
                "guard": (2, 0),
            },
            settings={
                "default": {"order": "implicit", "preload": "half", "guard": 2},
                "lecture": {"order": "simultaneous", "preload": "zero", "guard": 0},
            },
            clocks=lambda golden, blocks: np.full(len(blocks), 1 << 24),
            bound=lambda _: None,
        ),
    )
}
