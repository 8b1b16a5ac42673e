"""Every method there is, found by its name: device, golden model, promises, and what to expect."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from itertools import product
from typing import Any

import numpy as np

from discreta.hdl.carrier_circular import FORMULAS, CarrierCircular
from discreta.hdl.carrier_circular import MAX_WIDTH as CARRIER_CIRCULAR_MAX_WIDTH
from discreta.hdl.carrier_linear import MAX_WIDTH as CARRIER_LINEAR_MAX_WIDTH
from discreta.hdl.carrier_linear import CarrierLinear
from discreta.hdl.circular import Circular
from discreta.hdl.comparison import FIRSTS, FORMS, Comparison
from discreta.hdl.conic import MAX_WIDTH as CONIC_MAX_WIDTH
from discreta.hdl.conic import ORDERS as CONIC_ORDERS
from discreta.hdl.conic import Conic
from discreta.hdl.contract import MAX_WIDTH, Part
from discreta.hdl.exact_arc import ExactArc
from discreta.hdl.exact_conic import ExactConic
from discreta.hdl.exact_line import ExactLine
from discreta.hdl.linear import Linear
from discreta.hdl.parts.coefficient_unit import COEFFICIENTS
from discreta.hdl.two_stage import two_stage_circular, two_stage_linear
from discreta.sim.arcs import crossings, faster_steps, radii, refusals
from discreta.sim.conics import motion
from discreta.sim.golden.carrier_circular import CarrierCircular as GoldenCarrierCircular
from discreta.sim.golden.carrier_linear import CarrierLinear as GoldenCarrierLinear
from discreta.sim.golden.circular import Circular as GoldenCircular
from discreta.sim.golden.comparison import Comparison as GoldenComparison
from discreta.sim.golden.conic import Conic as GoldenConic
from discreta.sim.golden.exact_arc import ExactArc as GoldenExactArc
from discreta.sim.golden.exact_conic import ExactConic as GoldenExactConic
from discreta.sim.golden.exact_line import ExactLine as GoldenExactLine
from discreta.sim.golden.linear import Linear as GoldenLinear
from discreta.sim.golden.two_stage import TwoStage as GoldenTwoStage
from discreta.sim.golden.two_stage import two_stage_circular as golden_two_stage_circular
from discreta.sim.golden.two_stage import two_stage_linear as golden_two_stage_linear

__all__ = ["DEFAULTS", "METHODS", "Design", "Method"]


@dataclass(frozen=True, kw_only=True)
class Design:
    """Something with an RTL and a golden model, to be converted to Verilog and proven.

    Attributes
    ----------
    name : str
    summary : str
        What it does and how, in a few words.
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
    max_width : int
        Its devices have 4 to so many bits.
    differs : callable
        ``differs(choices)``: whether this combination of choices makes a machine that no other one
        makes, to be surveyed and proven.
    proofs : str or None
        The module of :mod:`discreta.sim.proofs` with what is promised; None: that of its name.
    """

    name: str
    summary: str
    device: Callable[..., Part]
    golden: Callable[..., Any]
    axes: tuple[int, ...] = (2,)
    choices: dict[str, tuple[Any, ...]]
    settings: dict[str, dict[str, Any]]
    max_width: int = MAX_WIDTH
    differs: Callable[[dict[str, Any]], bool] = lambda _: True
    proofs: str | None = None

    def core(self, width: int, axes: int = 2, **choices: Any) -> Part:
        """Make the RTL; ``TypeError`` or ``ValueError`` for what its constructor refuses."""
        return self.device(width, **self._axes(axes), **choices)

    def model(self, width: int, axes: int = 2, **choices: Any) -> Any:
        """Make the golden model."""
        return self.golden(width, **self._axes(axes), **choices)

    def _axes(self, axes: int) -> dict[str, int]:
        """Name the number of axes for a design that leaves a choice."""
        return {"axes": axes} if len(self.axes) > 1 else {}

    def promises(self, golden: Any) -> list:
        """Give what is proven of it beyond its equality to the golden model."""
        return self.proof_module().promises(golden)

    def proof_module(self) -> Any:
        """Give the module with the proofs of what is promised."""
        # Only the prover needs the solver.
        return import_module(f"discreta.sim.proofs.{self.proofs or self.name}")

    def variants(self) -> list[dict[str, Any]]:
        """Give every combination of the choices that makes another machine."""
        combinations = [
            dict(zip(self.choices, values, strict=True))
            for values in product(*self.choices.values())
        ]
        return [choices for choices in combinations if self.differs(choices)]


@dataclass(frozen=True, kw_only=True)
class Method(Design):
    """A method of interpolation.

    Attributes
    ----------
    curve : str
        What its blocks are: ``"line"``, ``"arc"`` or ``"conic"``.
    error_bound : str
        Largest distance from the true curve in the plane, in steps.
    clocks_per_step : str
    clocks : callable
        ``clocks(golden, blocks)``: the most clocks that each block takes from its acceptance to its
        last step, alone and without stalls; ``blocks`` has shape (blocks, block fields).
    bound : callable
        ``bound(golden)``: the proven error bound of one model, in steps; None without one.
    exact : bool
        No step leads half a step off the curve; a method that is in none of the documents.
    timed : bool
        It runs on a constant carrier: its blocks end with the fields ``periods`` and ``period``,
        and its golden models know their ``least_period``.
    per_period : bool
        What it puts out are the steps of a whole period, any number an axis.
    """

    curve: str
    error_bound: str
    clocks_per_step: str
    clocks: Callable[[Any, np.ndarray], np.ndarray]
    bound: Callable[[Any], float | None]
    exact: bool = False
    timed: bool = False
    per_period: bool = False


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


def _exact_line_clocks(golden: GoldenExactLine, blocks: np.ndarray) -> np.ndarray:
    """One for every step of the longest axis, and what stands around them."""
    ways = np.abs(blocks[:, golden.axes :] - blocks[:, : golden.axes])
    return np.max(ways, axis=1) + golden.axes + 9


def _comparison_clocks(_: GoldenComparison, blocks: np.ndarray) -> np.ndarray:
    """One for every step of either axis, and what stands around them."""
    return np.sum(np.abs(blocks[:, 2:] - blocks[:, :2]), axis=1) + 4


def _circular_clocks(golden: GoldenCircular, blocks: np.ndarray) -> np.ndarray:
    """A right angle and some steps for every piece, its preparation, and what stands around it."""
    start, center = blocks[:, :2].astype(float), blocks[:, 4:6].astype(float)
    radius = np.hypot(*(start - center).T) + 2
    bits = np.ceil(np.log2(radius)) if golden.normalize else float(golden.width)
    pieces = 5 + 4 * blocks[:, 7]
    per_piece = (math.pi / 2 + 4) * 2.0 ** (bits + golden.guard)
    return (pieces * per_piece).astype(np.int64) + pieces + 2 * golden.width + 12


def _exact_arc_clocks(golden: GoldenExactArc, blocks: np.ndarray) -> np.ndarray:
    """One for every step and every change of octant or quadrant, and what stands around them.

    An end that is off the circle may be missed: then the last quarter is run to its end.
    """
    pieces = crossings(blocks) + 1
    missed = refusals(blocks, golden.width) != 0
    quarters = math.sqrt(2) * (radii(blocks) + 2)
    steps = np.where(missed, pieces * quarters, faster_steps(blocks))
    return steps.astype(np.int64) + 4 * pieces + 10


#: Steps beside the curve; and how far from the end one axis may be left to go alone, and how far
#: beyond it the other one may be.
_BESIDE, _LEFT, _BEYOND = 8, 4, 2

#: How far beside the curve the gradient may be at its largest, in steps.
_ASIDE = 2


def _conic_clocks(golden: GoldenConic, blocks: np.ndarray) -> np.ndarray:
    """The motion's time by 2^(g + 1) of the largest gradient so far, and what may be slower.

    A summation is h of the motion's time, M/h being 2^g to 2^(g + 1) times the largest one of |Gx|
    and |Gy|: of all so far, or where the scale follows the gradient of those now. The time by the
    gradient is then the steps of the faster axis.
    """
    a, b, c, *_ = blocks.T
    pieces = 1 + blocks[:, 10]
    course = motion(blocks)
    # An axis is up to some steps beside the curve where it turns; in order simultaneous each piece
    # leads farther out.
    beside = _BESIDE * pieces
    steps = course.steps
    if golden.order == "simultaneous":
        beside = beside + 2 * pieces**2 / 2**golden.guard
    else:
        change = np.maximum.reduce([2 * np.abs(a), np.abs(b), 2 * np.abs(c)])
        with np.errstate(invalid="ignore", over="ignore"):
            largest = np.fmax(course.largest + _ASIDE * change, change)
            kept = (b != 0) | (a != c)
            steps = np.where(kept, course.time * largest, steps)
            slow = largest / np.fmax(course.smallest, np.fmax(change, 1))
            slow = np.fmin(slow, 2.0 ** (golden.width + 2))
            beside = beside * np.where(kept, slow, 1)
    # Whatever a block is: no axis goes beyond its coordinates, and of all ellipses in them whose
    # radius of curvature is two steps or more the gradient is up to 2^(n/2) times its smallest.
    most, none = (pieces * 2.0**bits for bits in (1.5 * golden.width + 3, golden.width + 2))
    steps = np.where(steps >= 0, np.fmin(steps, most), none)
    clocks = (steps + beside + _alone(blocks)) * 2.0 ** (golden.guard + 1)
    return clocks.astype(np.int64) + pieces + golden.width + 10


def _exact_conic_clocks(golden: GoldenExactConic, blocks: np.ndarray) -> np.ndarray:
    """One for every step and every change of the frame, the preparation, and what stands around."""
    pieces = 1 + blocks[:, 10]
    steps = motion(blocks).steps
    # A frame may have a step more than its curve is long, and there are two to a piece. Whatever a
    # block is: in a piece each axis goes one way, and no farther than the coordinates.
    most = (pieces * 2.0 ** (golden.width + 2)).astype(np.int64)
    steps = np.where(steps >= 0, np.fmin(np.ceil(np.nan_to_num(steps)), most), most)
    return steps.astype(np.int64) + 4 * pieces + golden.width + 14


#: Clocks that stand around a block on a carrier, beside its preparation and its periods.
_AROUND = 8


def _carrier_linear_clocks(golden: Any, blocks: np.ndarray) -> np.ndarray:
    """N·T, the preparation, and what stands around them; a refused block may have any N and T."""
    return blocks[:, -2] * blocks[:, -1] + 2 * golden.width + 14 + _AROUND


def _carrier_linear_bound(golden: GoldenCarrierLinear) -> float:
    """On both axes 9/16 of a step to either side, or 17/16 behind: along the line and across it."""
    return math.sqrt(2) * 9 / 16 if golden.preload == "half" else 17 / 16


def _carrier_circular_clocks(golden: Any, blocks: np.ndarray) -> np.ndarray:
    """N·T, the preparation, the products of the first period, and what stands around them."""
    preparation = 2 * golden.width + 6 + golden.prepared
    if golden.formula == "rotation":
        preparation += len(golden.program) * (golden.bits + 2)
    return blocks[:, -2] * blocks[:, -1] + preparation + golden.least_period + _AROUND


def _two_stage_linear_clocks(golden: GoldenTwoStage, blocks: np.ndarray) -> np.ndarray:
    """What the first stage takes, a period more, and as many clocks as there are steps."""
    steps = np.sum(np.abs(blocks[:, 2:4] - blocks[:, :2]), axis=1)
    return _carrier_linear_clocks(golden.coarse, blocks) + blocks[:, -1] + steps + _AROUND


def _two_stage_linear_bound(golden: GoldenTwoStage) -> float:
    """What the first stage has on an axis, and half a step to either side or one behind."""
    return math.sqrt(2) * 17 / 16 if golden.preload == "half" else 33 / 16


def _two_stage_circular_clocks(golden: GoldenTwoStage, blocks: np.ndarray) -> np.ndarray:
    """What the first stage takes, a period more, and as many clocks as there are steps."""
    radius = np.hypot(*(blocks[:, :2] - blocks[:, 4:6]).T.astype(float))
    # Twice the axes' ways of whole turns, since the radius may grow.
    steps = (16 * (radius + 1) * (blocks[:, 7] + 1)).astype(np.int64)
    return _carrier_circular_clocks(golden.coarse, blocks) + blocks[:, -1] + steps + _AROUND


def _uses_its_coefficient(choices: dict[str, Any]) -> bool:
    """Leave out the coefficient's other sources where no coefficient is used."""
    return choices["formula"] == "rotation" or choices["coefficient"] == COEFFICIENTS[0]


def _alone(blocks: np.ndarray) -> np.ndarray:
    """Give how many steps of full speed the last ones of an axis alone may take the time of."""
    a, b, c, d, e, _, _, end_x, end_y, *_ = blocks.T
    gradients = {
        "x": (2 * a * end_x + b * end_y + d, 2 * a, b),
        "y": (b * end_x + 2 * c * end_y + e, 2 * c, b),
    }
    change = np.maximum.reduce([2 * np.abs(a), np.abs(b), 2 * np.abs(c)])
    longest = np.zeros(len(blocks))
    # y' = Gx: of x stands still, beyond its end or there, that changes with y by B; x' likewise.
    for gradient, beyond, left in gradients.values():
        for aside in range(-_BEYOND, _BEYOND + 1):
            for way in (-1, 1):
                slow = np.zeros(len(blocks))
                for steps in range(1, _LEFT + 1):
                    speed = np.abs(gradient + aside * beyond + way * steps * left)
                    slow += np.where(speed > 0, change / np.fmax(speed, 1), 0)
                longest = np.fmax(longest, slow)
    return longest


#: Those of arcs on a carrier, in one stage or two.
_CARRIER_ARC_CHOICES: dict[str, tuple[Any, ...]] = {
    "formula": FORMULAS,
    "coefficient": COEFFICIENTS,
    "preload": ("half", "zero"),
}
_CARRIER_ARC_SETTINGS: dict[str, dict[str, Any]] = {
    "default": {"formula": "rotation", "coefficient": "series", "preload": "half"},
    "lecture": CarrierCircular.LECTURE,
}

METHODS = {
    method.name: method
    for method in (
        Method(
            name="exact_line",
            curve="line",
            summary="line in 2 to 6 axes by the nearest points of the grid, looking a step ahead",
            error_bound="½ on every axis",
            clocks_per_step="1",
            device=ExactLine,
            golden=GoldenExactLine,
            axes=(2, 3, 4, 5, 6),
            choices={},
            settings={"default": {}},
            clocks=_exact_line_clocks,
            bound=lambda golden: math.sqrt(golden.axes - 1) / 2,
            exact=True,
        ),
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
            name="comparison",
            curve="line",
            summary="line by comparison of two sums, one axis a clock",
            error_bound="1",
            clocks_per_step="1 a step, up to 2 a step of the longer axis",
            device=Comparison,
            golden=GoldenComparison,
            axes=(2,),
            choices={"form": FORMS, "first": FIRSTS},
            settings={
                "default": {"form": "signed", "first": "x"},
                "lecture": Comparison.LECTURE,
            },
            clocks=_comparison_clocks,
            bound=lambda _: 1.0,
        ),
        Method(
            name="exact_arc",
            curve="arc",
            summary="arc of any length, every step chosen by the circle's own residual",
            error_bound="½, and the end exact",
            clocks_per_step="1 a step, 1 more where the faster axis or a direction changes",
            device=ExactArc,
            golden=GoldenExactArc,
            axes=(2,),
            choices={},
            settings={"default": {}},
            clocks=_exact_arc_clocks,
            bound=lambda _: 0.5,
            exact=True,
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
            name="exact_conic",
            curve="conic",
            summary="any curve of the second order through its nearest points, by its residual",
            error_bound="0.5; measured",
            clocks_per_step="1, and 1 for each of the 8 octants of a turn",
            device=ExactConic,
            golden=GoldenExactConic,
            choices={},
            settings={"default": {}},
            clocks=_exact_conic_clocks,
            bound=lambda _: None,
            exact=True,
            max_width=CONIC_MAX_WIDTH,
        ),
        Method(
            name="conic",
            curve="conic",
            summary="any curve of the second order by cross-coupled summation of its derivatives "
            "(DDA)",
            error_bound="1.07 for 99.9 % of curves (default), 9.5 (lecture); measured",
            clocks_per_step="5.7 to 7.5 (default), 1.4 to 1.6 (lecture)",
            device=Conic,
            golden=GoldenConic,
            axes=(2,),
            choices={
                "order": CONIC_ORDERS,
                "preload": ("half", "zero"),
                "guard": (2, 0),
            },
            settings={
                "default": {"order": "implicit", "preload": "half", "guard": 2},
                "lecture": Conic.LECTURE,
            },
            clocks=_conic_clocks,
            bound=lambda _: None,
            max_width=CONIC_MAX_WIDTH,
        ),
        Method(
            name="carrier_linear",
            curve="line",
            summary="line on a constant carrier: all the steps of a period at once",
            error_bound="17/16 (preload zero), 0.80 (half)",
            clocks_per_step="as timed: a period of T clocks for up to F·T steps",
            device=CarrierLinear,
            golden=GoldenCarrierLinear,
            axes=(2,),
            choices={"preload": ("half", "zero")},
            settings={"default": {"preload": "half"}, "lecture": CarrierLinear.LECTURE},
            clocks=_carrier_linear_clocks,
            bound=_carrier_linear_bound,
            max_width=CARRIER_LINEAR_MAX_WIDTH,
            timed=True,
            per_period=True,
        ),
        Method(
            name="carrier_circular",
            curve="arc",
            summary="arc on a constant carrier: all the steps of a period at once",
            error_bound="0.70 (rotation), 71 (plain) a turn of 8 bits; measured",
            clocks_per_step="as timed: a period of T clocks for up to F·T steps",
            device=CarrierCircular,
            golden=GoldenCarrierCircular,
            axes=(2,),
            choices=_CARRIER_ARC_CHOICES,
            settings=_CARRIER_ARC_SETTINGS,
            clocks=_carrier_circular_clocks,
            bound=lambda _: None,
            max_width=CARRIER_CIRCULAR_MAX_WIDTH,
            timed=True,
            per_period=True,
            differs=_uses_its_coefficient,
        ),
        Method(
            name="two_stage_linear",
            curve="line",
            summary="line on a constant carrier, its steps spread evenly over every period",
            error_bound="33/16 (preload zero), 1.50 (half)",
            clocks_per_step="as timed: a period of T clocks for up to F·T steps",
            device=two_stage_linear,
            golden=golden_two_stage_linear,
            axes=(2,),
            choices={"preload": ("half", "zero")},
            settings={"default": {"preload": "half"}, "lecture": CarrierLinear.LECTURE},
            clocks=_two_stage_linear_clocks,
            bound=_two_stage_linear_bound,
            max_width=CARRIER_LINEAR_MAX_WIDTH,
            timed=True,
            proofs="two_stage",
        ),
        Method(
            name="two_stage_circular",
            curve="arc",
            summary="arc on a constant carrier, its steps spread evenly over every period",
            error_bound="1.59 (rotation), 71 (plain) a turn of 8 bits; measured",
            clocks_per_step="as timed: a period of T clocks for up to F·T steps",
            device=two_stage_circular,
            golden=golden_two_stage_circular,
            axes=(2,),
            choices=_CARRIER_ARC_CHOICES,
            settings=_CARRIER_ARC_SETTINGS,
            clocks=_two_stage_circular_clocks,
            bound=lambda _: None,
            max_width=CARRIER_CIRCULAR_MAX_WIDTH,
            timed=True,
            differs=_uses_its_coefficient,
            proofs="two_stage",
        ),
    )
}

#: The default method of every kind of curve: the exact one, by its name.
DEFAULTS = {method.curve: method.name for method in METHODS.values() if method.exact}
