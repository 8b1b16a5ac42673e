"""What every interpolator has in common: its streams, its error codes, its limits.

Coordinates are in steps (one step is the smallest move of an axis). A device of ``width`` n counts
up to ``2^n − 1`` steps along an axis in one block, and its coordinates are signed numbers of n + 1
bits, ``−2^n … 2^n − 1``.

Source: design of the common contract; the words follow the lecture's block diagrams (P1…P6, SX, SY,
УУ) and, for more than two axes, its memory cells (DX, XT, KOX, with the axis letter in place of X).
"""

from typing import TYPE_CHECKING, Any, ClassVar

from amaranth.hdl import Signal, signed
from amaranth.lib import data, enum, wiring

__all__ = [
    "AXIS_LETTERS",
    "MAX_AXES",
    "MAX_GUARD",
    "MAX_WIDTH",
    "MIN_AXES",
    "MIN_WIDTH",
    "ErrorCode",
    "Part",
    "RegisterNames",
    "check_axes",
    "check_choice",
    "check_flag",
    "check_guard",
    "check_number",
    "check_width",
    "per_axis",
    "point_layout",
    "register_names",
    "step_layout",
]

MIN_WIDTH, MAX_WIDTH = 4, 32
MIN_AXES, MAX_AXES = 2, 6
MAX_GUARD = 4
AXIS_LETTERS = "xyzabc"


class ErrorCode(enum.Enum, shape=2):  # pyright: ignore[reportGeneralTypeIssues, reportCallIssue]
    """Why a block was not run. Put out for one clock, in place of ``done``."""

    #: Nothing is wrong.
    NONE = 0
    #: It does not fit n bits: a line that is too long, an arc that is too large or leaves the
    #: coordinates there are. Or its timing on a carrier is out of range.
    RANGE = 1
    #: The end is more than one step off the circle around the centre on which the start lies, or
    #: the start is the centre.
    OFF_CURVE = 2
    #: The curve has no direction at the start, or is too sharp for the grid there.
    SHARP = 3


class Part(wiring.Component):
    """A piece of the device: a :class:`~amaranth.lib.wiring.Component` with checked parameters.

    Attributes
    ----------
    notation : str
        What the letters of an interpolator's docstring stand for.
    intermediates : dict of str to Signal
        Signals between the registers, by names that the golden model has for them too: a proof of
        equality goes over them. Empty where it needs none.
    """

    notation: ClassVar[str] = ""

    def __init__(self, signature: Any):
        super().__init__(signature)
        self.intermediates: dict[str, Signal] = {}

    if TYPE_CHECKING:
        # The members are made from the signature when the part is made.
        def __getattr__(self, name: str) -> Any: ...


class RegisterNames:
    """The names of one axis's registers.

    Attributes
    ----------
    increment, position, remaining, summator : str
        ``p1``/``p2``, ``p3``/``p4``, ``p5``/``p6`` and ``sx``/``sy`` for two axes; ``dx``, ``xt``,
        ``kox`` and ``sx`` with the axis's own letter for more.
    """

    def __init__(self, axes: int, index: int):
        letter = AXIS_LETTERS[index]
        if axes == 2:
            self.increment, self.position, self.remaining = (f"p{index + k}" for k in (1, 3, 5))
        else:
            self.increment = f"d{letter}"
            self.position = f"{letter}t"
            self.remaining = f"ko{letter}"
        self.summator = f"s{letter}"


def register_names(axes: int) -> dict[str, RegisterNames]:
    """Give the register names of every axis, by axis letter."""
    return {AXIS_LETTERS[index]: RegisterNames(axes, index) for index in range(axes)}


def per_axis(axes: int, shape: Any) -> data.StructLayout:
    """Lay out one ``shape`` for every axis, by axis letter."""
    return data.StructLayout(dict.fromkeys(AXIS_LETTERS[:axes], shape))


def point_layout(width: int, axes: int) -> data.StructLayout:
    """Lay out a point: one signed coordinate of ``width + 1`` bits for every axis, in steps."""
    return per_axis(axes, signed(width + 1))


def step_layout(axes: int) -> data.StructLayout:
    """Lay out a step: −1, 0 or +1 for every axis, and ``last`` on the final step of a block."""
    return data.StructLayout(
        {**{letter: signed(2) for letter in AXIS_LETTERS[:axes]}, "last": 1},
    )


def check_number(what: str, value: int, low: int, high: int) -> None:
    """Raise ``TypeError`` or ``ValueError`` unless ``value`` is a whole number in these limits."""
    if not isinstance(value, int) or isinstance(value, bool):
        raise TypeError(f"{what} must be a whole number from {low} to {high}, not {value!r}")
    if not low <= value <= high:
        raise ValueError(f"{what} is {value}: choose a whole number from {low} to {high}")


def check_width(width: int, most: int = MAX_WIDTH) -> None:
    """Raise ``TypeError`` or ``ValueError`` unless ``width`` is a whole number from 4 to ``most``.

    That is 32, if a method has no limit of its own.
    """
    check_number("width", width, MIN_WIDTH, most)


def check_axes(axes: int) -> None:
    """Raise ``TypeError`` or ``ValueError`` unless ``axes`` is a whole number from 2 to 6."""
    check_number("number of axes", axes, MIN_AXES, MAX_AXES)


def check_guard(guard: int) -> None:
    """Raise ``TypeError`` or ``ValueError`` unless ``guard`` is a whole number from 0 to 4."""
    check_number("number of guard bits", guard, 0, MAX_GUARD)


def check_flag(what: str, value: bool) -> None:
    """Raise ``TypeError`` unless ``value`` is True or False."""
    if not isinstance(value, bool):
        raise TypeError(f"{what} must be True or False, not {value!r}")


def check_choice(what: str, value: str, choices: tuple[str, ...]) -> None:
    """Raise ``ValueError`` unless ``value`` is one of ``choices``."""
    if value not in choices:
        raise ValueError(f"{what} is {value!r}: choose {' or '.join(map(repr, choices))}")
