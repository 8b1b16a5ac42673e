"""Points as users write them, checked against what a device has room for."""

import csv
import re
from array import array
from collections.abc import Iterable, Sequence
from math import isqrt
from pathlib import Path

import numpy as np

from discreta.hdl.contract import AXIS_LETTERS, MAX_AXES, MAX_WIDTH, MIN_AXES
from discreta.sim.arcs import OFF_CURVE, RANGE, limits, reaches, refusals, squared_radii

__all__ = [
    "MAX_TURNS",
    "BadInputError",
    "check_arc",
    "check_coordinates",
    "check_line",
    "check_path",
    "check_turns",
    "give_width",
    "parse_point",
    "read_points",
    "say_point",
]

#: An arc ends in its 256th turn at the latest.
MAX_TURNS = 256

_WHOLE_NUMBER = re.compile(r"\s*[+-]?[0-9]{1,1000}\s*")


class BadInputError(ValueError):
    """What was given cannot be run; the message names the value, the limit and the cure."""


def say_point(point: Sequence[int] | np.ndarray) -> str:
    """Write a point as users do: ``200,99``."""
    return ",".join(str(value) for value in point)


def _cut(text: str) -> str:
    """Quote a text for a message, which it must not flood."""
    return repr(text if len(text) <= 40 else f"{text[:40]}…")


def parse_point(cells: Sequence[str]) -> tuple[int, ...] | None:
    """Read whole numbers of steps, one a cell; None when a cell is something else."""
    if not all(_WHOLE_NUMBER.fullmatch(cell) for cell in cells):
        return None
    return tuple(int(cell) for cell in cells)


def check_line(start: Sequence[int], end: Sequence[int], width: int) -> None:
    """Refuse a line that a device of ``width`` bits has no room for.

    Raises
    ------
    BadInputError
        A coordinate or a length is out of range.
    """
    modulus = 1 << width
    check_coordinates((start, end), width)
    length = max(abs(b - a) for a, b in zip(start, end, strict=True))
    if length >= modulus:
        raise BadInputError(
            f"the line from {say_point(start)} to {say_point(end)} is {length} steps long: "
            f"width {width} has room for {modulus - 1}; {_wider(length)}"
        )


def check_coordinates(points: Iterable[Sequence[int]], width: int, most: int = MAX_WIDTH) -> None:
    """Refuse coordinates that ``width`` bits and a sign have no room for.

    The message names a width that has, up to ``most``.

    Raises
    ------
    BadInputError
        A coordinate is out of range.
    """
    modulus = 1 << width
    for point in points:
        for value in point:
            if not -modulus <= value < modulus:
                raise BadInputError(
                    f"coordinate {_cut(str(value))[1:-1]} is out of range: width {width} has room "
                    f"for {-modulus} to {modulus - 1}; "
                    f"{_wider(value if value >= 0 else ~value, most)}"
                )


def check_path(points: np.ndarray, width: int) -> None:
    """Refuse a path, shape (points, axes), that has a line for which there is no room.

    Raises
    ------
    BadInputError
        A coordinate or a length is out of range.
    """
    modulus = 1 << width
    wrong = np.any((points < -modulus) | (points >= modulus), axis=1)
    wrong[1:] |= np.any(np.abs(np.diff(points, axis=0)) >= modulus, axis=1)
    for index in np.flatnonzero(wrong)[:1]:
        check_line(points[max(0, index - 1)].tolist(), points[index].tolist(), width)


def check_turns(turns: int) -> None:
    """Raise :class:`BadInputError` unless an arc can end in turn number ``turns``."""
    if not 1 <= turns <= MAX_TURNS:
        raise BadInputError(
            f"number of turns is {_cut(str(turns))[1:-1]}: choose a whole number from 1 to "
            f"{MAX_TURNS}"
        )


def check_arc(
    start: Sequence[int],
    end: Sequence[int],
    center: Sequence[int],
    *,
    clockwise: bool,
    turns: int,
    width: int,
) -> None:
    """Refuse just the arcs that a device of ``width`` bits refuses.

    Parameters
    ----------
    start, end, center : points of two int
        In steps.
    clockwise : bool
    turns : int
        The turn in which the arc ends.
    width : int
        4 to 32.

    Raises
    ------
    BadInputError
        A coordinate or the number of turns is out of range, the arc has no room, or its end is off
        the circle of its start.
    """
    check_turns(turns)
    check_coordinates((start, end, center), width)
    block = np.array([[*start, *end, *center, clockwise, turns - 1]], dtype=np.int64)
    refused = refusals(block, width)[0]
    if refused == RANGE:
        enough = [w for w in range(width, MAX_WIDTH + 1) if refusals(block, w)[0] != RANGE]
        raise BadInputError(f"{_no_room(start, end, center, block, width)}; {give_width(enough)}")
    if refused == OFF_CURVE:
        raise BadInputError(_off_circle(start, end, center, *squared_radii(block)[0]))


def _no_room(
    start: Sequence[int], end: Sequence[int], center: Sequence[int], block: np.ndarray, width: int
) -> str:
    """Say why an arc has no room."""
    modulus = 1 << width
    for name, point in (("start", start), ("end", end)):
        far = max(abs(a - b) for a, b in zip(point, center, strict=True))
        if far >= modulus:
            return (
                f"the {name} {say_point(point)} is {far} steps from the center {say_point(center)} "
                f"along an axis: width {width} has room for {modulus - 1}"
            )
    limit = int(limits(block)[0])
    if limit >= modulus:
        return (
            f"the arc crosses an axis of its center, up to {limit} steps from it: width {width} "
            f"has room for {modulus - 1}"
        )
    reached, crossed = reaches(block)
    far = [value for value in reached[crossed].tolist() if not -modulus <= value < modulus]
    return (
        f"the arc may reach {far[0]} where it crosses an axis of its center {say_point(center)}: "
        f"width {width} has room for coordinates from {-modulus} to {modulus - 1}"
    )


def _off_circle(
    start: Sequence[int], end: Sequence[int], center: Sequence[int], square: int, other: int
) -> str:
    """Say how far an end is from the circle of its start; the squares are those of the radii."""
    if not square:
        return (
            f"the start {say_point(start)} is the center and the end {say_point(end)} is not: an "
            "arc needs a radius; give another center"
        )
    # Exact to 36 places, which no two radii need that differ by just more than a step.
    radius, away = (isqrt(value * 10**80) for value in (square, other))
    apart = -(-abs(radius - away) // 10**36)  # rounded up: never the 1 that is allowed
    return (
        f"the end {say_point(end)} is {_places(away // 10**36)} steps from the center "
        f"{say_point(center)} and the start {say_point(start)} is {_places(radius // 10**36)}: "
        f"{_places(apart)} apart, and 1 is allowed; give an end on the start's circle"
    )


def _places(value: int) -> str:
    """Write ten-thousandths with four places."""
    return f"{value // 10**4}.{value % 10**4:04d}"


def _wider(value: int, most: int = MAX_WIDTH) -> str:
    """Give the cure for a value that needs more bits."""
    return give_width(range(value.bit_length(), most + 1), most)


def give_width(enough: Sequence[int], most: int = MAX_WIDTH) -> str:
    """Give the cure where these widths, the least of them first, would do, of those up to most."""
    if enough:
        return f"give --width {enough[0]}"
    return f"no {'device' if most == MAX_WIDTH else 'such device'} has more than {most} bits"


def read_points(file: str, width: int) -> np.ndarray:
    """Read the support points of a path for a device of ``width`` bits.

    The file has a header with the axis letters and a point in every row; blank rows are left out.

    Returns
    -------
    array of int64, shape (points, axes)

    Raises
    ------
    BadInputError
        The file cannot be read, is not such a file, has fewer than two points, or has one out of
        range.
    """
    axes = 0
    last: tuple[int, ...] | None = None
    points = array("q")
    try:
        with Path(file).open(encoding="utf-8-sig", newline="") as lines:
            rows = csv.reader(lines)
            for row in rows:
                if not any(cell.strip() for cell in row):
                    continue
                if not axes:
                    axes = _axes(file, row)
                    continue
                where = f"{file}, line {rows.line_num}"
                point = parse_point(row)
                if point is None or len(point) != axes:
                    raise BadInputError(
                        f"{where}: {_cut(','.join(row))} is not a point: give {axes} whole numbers "
                        "of steps"
                    )
                try:
                    check_line(point if last is None else last, point, width)
                except BadInputError as error:
                    raise BadInputError(f"{where}: {error}") from None
                points.extend(point)
                last = point
    except OSError as error:
        raise BadInputError(f"cannot read {file}: {error.strerror}; name a CSV file") from None
    except (UnicodeDecodeError, csv.Error):
        raise BadInputError(
            f"{file} is not a CSV file in UTF-8: give a line x,y and a support point in every line "
            "after it"
        ) from None
    if not axes:
        raise BadInputError(
            f"{file} is empty: give a line x,y and a support point in every line after it"
        )
    if len(points) < 2 * axes:
        raise BadInputError(
            f"{file} has too few support points, {len(points) // axes}: a path needs at least 2"
        )
    return np.array(points, dtype=np.int64).reshape(-1, axes)


def _axes(file: str, header: list[str]) -> int:
    """Give the number of axes that a header names."""
    axes = len(header)
    names = [name.strip().lower() for name in header]
    if not MIN_AXES <= axes <= MAX_AXES or names != list(AXIS_LETTERS[:axes]):
        raise BadInputError(
            f"{file} begins with {_cut(','.join(header))}: the first line must name the axes, "
            f"{','.join(AXIS_LETTERS[:MIN_AXES])} or up to {','.join(AXIS_LETTERS)}"
        )
    return axes
