"""G-code, read into lines and arcs on the grid of the steps; what is not understood is refused.

The language is that of RS274/NGC, as far as this machine can follow it: G0, G1, G2 and G3 in the
plane G17 with the way of Z along it, G20/G21, G90/G91, G90.1/G91.1, F, P turns, M2/M30, comments,
and the words that name the state the machine is in anyway (:data:`STATE_WORDS`). Any other word
ends the reading with file and line, before anything moves. See docs/gcode.md.

Numbers are kept as they are written, in fractions of a millimetre; every end is rounded to the grid
by itself, so that nothing adds up, in relative coordinates neither. An arc's centre has to be on
the grid, too, and its end no more than a step off the circle of its start: of the four grid points
about the programmed centre the one is taken whose arc is least off the programmed one. Where there
is none, or it is more than two steps off, another one of the four about the end is taken, too.

There is no parser library in this, because a program must not be run otherwise than it is written:
gcodeparser and gcode-lib leave out what they do not know (``@``, ``#1``) without a word; pygcode,
last released in 2017, makes ``X1`` of ``X1..2`` and of ``X 1 0``; tree-sitter-gcode tells errors
and their places, but takes ``%`` and ``Y+2.`` for errors; nc-gcode-interpreter reads Sinumerik's
dialect. All but the last leave modes, units and arcs, the larger part, to the caller. What is left
for them is one regular expression.
"""

import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import atan2, floor, hypot, inf, pi, sqrt, tau
from pathlib import Path

import numpy as np

from discreta.sim.arcs import OFF_CURVE, crossings, refusals
from discreta.sim.points import MAX_TURNS, BadInputError, check_arc, check_line

__all__ = [
    "IGNORABLE",
    "STATE_WORDS",
    "SUFFIXES",
    "Move",
    "distance_from_arc",
    "is_gcode",
    "moves_of",
    "read_moves",
]

#: Names of G-code files end so.
SUFFIXES = (".ngc", ".nc", ".gcode", ".tap")

#: Words that change nothing: the machine has no other state, or the path that it follows exactly is
#: what they ask for.
STATE_WORDS = ("G17", "G40", "G49", "G54", "G61", "G64", "G80", "G94")

#: Words for what is not part of this machine, and what may be ignored of them if the user says so:
#: none of them moves an axis in the plane, and G43 shifts Z as a whole.
IGNORABLE = (
    *("G43", "H", "M0", "M1", "M3", "M4", "M5", "M6", "M7", "M8", "M9", "M48", "M49", "S", "T"),
)

#: One of each may stand in a line.
_GROUPS = (
    ("G0", "G1", "G2", "G3", "G80"),
    ("G17",),
    ("G20", "G21"),
    ("G40",),
    ("G49",),
    ("G54",),
    ("G61", "G64"),
    ("G90", "G91"),
    ("G90.1", "G91.1"),
    ("G94",),
    ("M2", "M30"),
)
_GROUP_OF = {word: group for group in _GROUPS for word in group}

#: Why some of the words that are often met are refused.
_REASONS = {
    **dict.fromkeys(("G18", "G19"), "arcs lie in the XY plane, G17"),
    **dict.fromkeys(("G41", "G42", "G43", "H"), "the machine knows no tools"),
    **dict.fromkeys(("G93", "G95"), "F is in units per minute, G94"),
    **dict.fromkeys(("M3", "M4", "M5", "S"), "the machine has no spindle"),
    **dict.fromkeys(("M6", "T"), "the machine has no tool changer"),
    **dict.fromkeys(("M7", "M8", "M9"), "the machine has no coolant"),
    **dict.fromkeys("ABCUVW", "the axes are X, Y and Z"),
    "O": "there are no subroutines and no loops",
    "G4": "the machine does not wait",
    **dict.fromkeys(("M0", "M1"), "the machine does not wait"),
    "G61.1": "the machine does not stop at every corner; G61 follows the path as exactly",
    "#": "parameters are not reckoned with",
    "[": "expressions are not reckoned with",
    "/": "no line is left out on demand",
}

_WORD = re.compile(
    r"\s*([A-Z])\s*([+-]?(?:[0-9]{1,30}(?:\.[0-9]{0,30})?|\.[0-9]{1,30}))(?![0-9.])\s*"
)
_COMMENT = re.compile(r"\([^()]*\)")
_INCH = Fraction(254, 10)

#: Radii of start and end may differ by so much as programs are rounded: in mm, or by this part.
_APART, _APART_OF_RADIUS = Fraction(5, 1000), Fraction(1, 1000)

#: Circles of a smaller radius, in steps, are points.
_SMALL = 0.5

#: A rounded arc that is farther than this from the programmed one, in steps, is not run.
_FAR = 2

#: Points at which an arc is compared with the programmed one to choose its centre.
_SAMPLES = 65

#: Angles nearer to each other than this are one, in radians.
_SAME_ANGLE = 1e-9


@dataclass(frozen=True, slots=True)
class Move:
    """One line or arc on the grid, and what was programmed.

    Attributes
    ----------
    kind : str
        ``"line"`` or ``"arc"``.
    start, end : tuple of int
        Two or three coordinates, in steps.
    center : tuple of two int or None
        Of an arc.
    clockwise : bool
    turns : int
        The turn in which an arc ends, 1 to 256, as in :class:`~discreta.sim.curves.Arc`.
    feed : Fraction or None
        Programmed speed along the path, in mm a minute; None: a rapid, G0.
    length : float
        Of the programmed path, in mm.
    line_number : int
        Of the line in the file.
    true_start, true_end : tuple of float
        As programmed, in steps.
    true_center : tuple of two float or None
        As programmed, in steps.
    sweep : float
        Angle of the programmed arc with its whole turns, in radians, more than 0.
    """

    kind: str
    start: tuple[int, ...]
    end: tuple[int, ...]
    feed: Fraction | None
    length: float
    line_number: int
    true_start: tuple[float, ...]
    true_end: tuple[float, ...]
    center: tuple[int, int] | None = None
    clockwise: bool = False
    turns: int = 1
    true_center: tuple[float, float] | None = None
    sweep: float = 0.0

    @property
    def helical(self) -> bool:
        """It is an arc along which Z moves."""
        return self.kind == "arc" and self.start[2:] != self.end[2:]

    @property
    def true_length(self) -> float:
        """Give the length of the programmed path in steps."""
        rise = [b - a for a, b in zip(self.true_start, self.true_end, strict=True)]
        if self.true_center is None:
            return hypot(*rise)
        radii = [_away(end, self.true_center) for end in (self.true_start, self.true_end)]
        return hypot(self.sweep * sum(radii) / 2, *rise[2:])

    @property
    def block(self) -> tuple[int, ...]:
        """Give the fields of the block of an interpolator of this kind; the way of Z aside."""
        if self.center is None:
            return (*self.start, *self.end)
        ends = (*self.start[:2], *self.end[:2], *self.center)
        return (*ends, int(self.clockwise), self.turns - 1)


def is_gcode(file: str) -> bool:
    """Tell from its name whether a file has G-code."""
    return Path(file).suffix.lower() in SUFFIXES


def read_moves(
    file: str, steps_per_mm: Sequence[Fraction], width: int, ignored: Collection[str] = ()
) -> list[Move]:
    """Read a program for a machine of ``width`` bits that stands at 0,0,0.

    Moves too short for a step are left out. They have three axes if Z moves anywhere, else two.

    Parameters
    ----------
    file : str
    steps_per_mm : three Fractions
        More than 0, of X, Y and Z.
    width : int
        4 to 32.
    ignored : collection of str
        Of :data:`IGNORABLE`: what is left out without a word.

    Raises
    ------
    BadInputError
        The file cannot be read, or has something that is not understood or cannot be run; the
        message has file and line.
    """
    try:
        with Path(file).open(encoding="utf-8-sig", errors="replace") as lines:
            return moves_of(lines, file, steps_per_mm, width, ignored)
    except OSError as error:
        raise BadInputError(f"cannot read {file}: {error.strerror}; name a G-code file") from None


def moves_of(
    lines: Iterable[str],
    file: str,
    steps_per_mm: Sequence[Fraction],
    width: int,
    ignored: Collection[str] = (),
) -> list[Move]:
    """Read the lines of a program that is called ``file``, as :func:`read_moves` does."""
    programmed = list(_Reader(file, ignored).read(lines))
    axes = 3 if any(move.end[2] for move in programmed) else 2
    moves = []
    here = (0,) * axes
    for part in programmed:
        try:
            move = _on_grid(part, here, steps_per_mm[:axes], width)
        except BadInputError as error:
            raise BadInputError(f"{file}, line {part.line_number}: {error}") from None
        if move is not None:
            moves.append(move)
            here = move.end
    if not moves:
        raise BadInputError(f"{file} moves nothing: give at least one move of a step")
    return moves


@dataclass(frozen=True, slots=True)
class _Programmed:
    """A move as programmed, in mm; the centre of an R arc is as exact as floats are."""

    line_number: int
    start: tuple[Fraction, Fraction, Fraction]
    end: tuple[Fraction, Fraction, Fraction]
    feed: Fraction | None
    center: tuple[Fraction, Fraction] | None = None
    clockwise: bool = False
    turns: int = 1


@dataclass
class _Reader:
    """Follows a program line by line: its modes, and where it stands."""

    file: str
    ignored: Collection[str]
    line_number: int = 0
    motion: str | None = None
    unit: Fraction = Fraction(1)
    relative: bool = False
    absolute_centers: bool = False
    feed: Fraction | None = None
    here: tuple[Fraction, Fraction, Fraction] = (Fraction(0), Fraction(0), Fraction(0))
    ended: bool = False
    begun: bool = field(default=False, init=False)

    def read(self, lines: Iterable[str]) -> Iterator[_Programmed]:
        """Give the moves up to the end of the program."""
        for line in lines:
            self.line_number += 1
            text = self._without_comments(line)
            if text == "%":
                # The first one opens the program, the next one ends it as M2 does.
                if self.begun:
                    self.ended = True
                self.begun = True
            elif text:
                self.begun = True
                yield from self._line(self._words(text))
            if self.ended:
                return
        raise BadInputError(
            f"{self.file} ends without M2, M30 or %: it may have been cut off; end it with one"
        )

    def _fail(self, what: str) -> BadInputError:
        return BadInputError(f"{self.file}, line {self.line_number}: {what}")

    def _refuse(self, word: str, name: str) -> BadInputError:
        reason = f" ({_REASONS[name]})" if name in _REASONS else ""
        without = f", or give --ignore {name}" if name in IGNORABLE else ""
        return self._fail(f"{_cut(word)} is not understood{reason}: leave it out{without}")

    def _without_comments(self, line: str) -> str:
        """Leave out ( ) and what is behind a semicolon; the rest in capitals."""
        kept, text = "", line
        while match := re.search(r"[(;]", text):
            kept, text = kept + text[: match.start()], text[match.start() :]
            if text[0] == ";":
                text = ""
                break
            comment = _COMMENT.match(text)
            if comment is None:
                raise self._fail(f"the comment {_cut(text.strip())} has no end: close it with )")
            kept, text = kept + " ", text[comment.end() :]
        return (kept + text).strip().upper()

    def _words(self, text: str) -> dict[str, Fraction]:
        """Give the numbers of a line by their letters, and 1 by the name of every G and M word."""
        words: dict[str, Fraction] = {}
        place = 0
        while place < len(text):
            match = _WORD.match(text, place)
            if match is None:
                rest = text[place:].strip()
                raise self._refuse(rest.split()[0], _sign(rest))
            letter, number = match[1], Fraction(match[2])
            name = f"{letter}{_short(number)}" if letter in "GM" else letter
            if letter == "N" and place:
                raise self._fail("N stands behind other words: put the line's number first")
            place = match.end()
            if name in self.ignored:
                continue
            if letter in "GM" and name not in _GROUP_OF:
                raise self._refuse(name, name)
            if letter not in "GMNFPXYZIJRQK":
                raise self._refuse(match[0].strip(), letter)
            if name in words:
                raise self._fail(f"{name} stands twice: give it once")
            for other in _GROUP_OF.get(name, ()):
                if other in words:
                    raise self._fail(f"{other} and {name} exclude each other: give one of them")
            words[name] = number
        words.pop("N", None)
        return words

    def _line(self, words: dict[str, Fraction]) -> Iterator[_Programmed]:
        """Do a line: F, units, modes, then the move, then the end of the program."""
        self._modes(words)
        if "F" in words:
            self.feed = words["F"] * self.unit
            if self.feed <= 0:
                raise self._fail(f"F{_short(words['F'])} is no speed: give more than 0")
        for motion in _GROUPS[0]:
            if motion in words:
                self.motion = None if motion == "G80" else motion
        moving = [letter for letter in "XYZ" if letter in words]
        arc = self.motion in ("G2", "G3") and (moving or self.motion in words)
        if moving and self.motion is None:
            raise self._fail(f"{moving[0]} stands without a G0, G1, G2 or G3 before: give one")
        if self.motion != "G0" and (moving or arc) and self.feed is None:
            raise self._fail(
                f"{self.motion} has no speed: give F in this line or before"
                + ("; it is forgotten where the unit changes" if self.unit == _INCH else "")
            )
        # The tolerances of G64 are met by any path that is followed exactly.
        used = "XYZF" + ("IJRP" if arc else "PQ" if "G64" in words else "")
        for letter in words:
            if len(letter) == 1 and letter not in used:
                to = {"P": "G2, G3 and G64", "Q": "G64", "K": "G18 and G19"}
                raise self._fail(
                    f"{letter} goes with {to.get(letter, 'G2 and G3')}, and this line has no such "
                    "word: leave it out"
                )
        if arc and "G64" in words and "P" in words:
            raise self._fail("P may be of the arc or of G64: give them in two lines")
        if arc:
            yield self._arc(words)
        elif moving:
            end = self._end(words)
            feed = None if self.motion == "G0" else self.feed
            yield _Programmed(self.line_number, self.here, end, feed)
            self.here = end
        self.ended = "M2" in words or "M30" in words

    def _modes(self, words: dict[str, Fraction]) -> None:
        """Take over the modes that a line sets."""
        unit = _INCH if "G20" in words else Fraction(1) if "G21" in words else self.unit
        if unit != self.unit:
            if "F" in words:
                raise self._fail(
                    "F stands in the line that changes the unit, and is read in one or the other "
                    "by different machines: give it in the next line"
                )
            self.unit, self.feed = unit, None
        self.relative = "G91" in words or (self.relative and "G90" not in words)
        absolute = "G90.1" in words or (self.absolute_centers and "G91.1" not in words)
        self.absolute_centers = absolute

    def _end(self, words: dict[str, Fraction]) -> tuple[Fraction, Fraction, Fraction]:
        """Give where the move of a line ends, in mm."""
        x, y, z = (
            here
            if letter not in words
            else words[letter] * self.unit + (here if self.relative else 0)
            for letter, here in zip("XYZ", self.here, strict=True)
        )
        return x, y, z

    def _arc(self, words: dict[str, Fraction]) -> _Programmed:
        """Give the arc of a line."""
        start, end = self.here, self._end(words)
        clockwise = self.motion == "G2"
        turns = words.get("P", Fraction(1))
        if turns.denominator != 1 or not 1 <= turns <= MAX_TURNS:
            raise self._fail(f"P{_short(turns)} is no turn: give a whole number up to {MAX_TURNS}")
        by_center = "I" in words or "J" in words
        if by_center == ("R" in words):
            both = "both I or J and R" if by_center else "neither I, J nor R"
            raise self._fail(
                f"{self.motion} has {both}: give its center by I and J, or its radius by R"
            )
        if not by_center:
            center = self._center_of_radius(start, end, words["R"] * self.unit, clockwise)
        elif self.absolute_centers:
            if "I" not in words or "J" not in words:
                raise self._fail("under G90.1 an arc needs both I and J: give them")
            center = words["I"] * self.unit, words["J"] * self.unit
        else:
            i, j = (words.get(letter, Fraction(0)) * self.unit for letter in "IJ")
            center = start[0] + i, start[1] + j
        if by_center:
            self._check_radii(start, end, center)
        self.here = end
        return _Programmed(self.line_number, start, end, self.feed, center, clockwise, int(turns))

    def _center_of_radius(
        self, start: Sequence[Fraction], end: Sequence[Fraction], radius: Fraction, clockwise: bool
    ) -> tuple[Fraction, Fraction]:
        """Give the centre of an arc by R: up to half a turn of it if R > 0, else the rest."""
        x, y = end[0] - start[0], end[1] - start[1]
        chord = x * x + y * y
        if not chord:
            raise self._fail("an arc by R ends where it starts: give its center by I and J")
        high = radius * radius - chord / 4
        if high < 0:
            apart = sqrt(chord) / 2 - abs(radius)
            if apart > max(_APART, _APART_OF_RADIUS * abs(radius)):
                raise self._fail(
                    f"the end is {_mm(sqrt(chord))} mm from the start, and the radius is only "
                    f"{_mm(abs(radius))} mm: give half of that or more"
                )
            high = Fraction(0)
        side = Fraction(sqrt(high / chord)) * (-1 if clockwise == (radius > 0) else 1)
        return start[0] + x / 2 - side * y, start[1] + y / 2 + side * x

    def _check_radii(
        self,
        start: Sequence[Fraction],
        end: Sequence[Fraction],
        center: tuple[Fraction, Fraction],
    ) -> None:
        """Refuse an arc whose end is not on the circle of its start, but for rounding."""
        first, last = (
            hypot(float(point[0] - center[0]), float(point[1] - center[1]))
            for point in (start, end)
        )
        if not first:
            raise self._fail("the arc starts at its center: give another I or J")
        if abs(first - last) > max(_APART, _APART_OF_RADIUS * Fraction(max(first, last))):
            raise self._fail(
                f"the arc starts {_mm(first)} mm from its center and ends {_mm(last)} mm from it: "
                "give a center equally far from both"
            )


def _cut(text: str) -> str:
    """Cut a text for a message, which it must not flood."""
    return text if len(text) <= 40 else f"{text[:40]}…"


def _sign(text: str) -> str:
    """Give what tells why a text that begins with no word is not one."""
    signs = re.search(r"[#\[]", text.split()[0])
    return signs[0] if signs else text[0]


def _short(number: Fraction) -> str:
    """Write a number shortly."""
    return f"{float(number):.10g}"


def _mm(length: float | Fraction) -> str:
    """Write a length in mm."""
    return f"{float(length):.4f}"


def _on_grid(
    part: _Programmed, start: tuple[int, ...], scale: Sequence[Fraction], width: int
) -> Move | None:
    """Round a move to the grid, from where the one before it led; None when it is no step long.

    Raises
    ------
    BadInputError
        There is no room for it in ``width`` bits, or no arc on the grid that is nearly it.
    """
    true_start, true_end = (
        tuple(float(value * by) for value, by in zip(point, scale, strict=False))
        for point in (part.start, part.end)
    )
    end = tuple(floor(b * by + Fraction(1, 2)) for b, by in zip(part.end, scale, strict=False))
    rise = [float(b - a) for a, b in zip(part.start, part.end, strict=True)]
    if part.center is None:
        if start == end:
            return None
        facts = (part.feed, hypot(*rise), part.line_number, true_start, true_end)
        check_line(start, end, width)
        return Move("line", start, end, *facts)
    if scale[0] != scale[1]:
        raise BadInputError(
            f"X has {_short(scale[0])} steps a mm and Y {_short(scale[1])}: an arc needs as many "
            "on both"
        )
    x, y = (float(value * by) for value, by in zip(part.center, scale, strict=False))
    sweep = _sweep(true_start, true_end, (x, y), part)
    radius = (_away(true_start, (x, y)) + _away(true_end, (x, y))) / 2
    length = hypot(sweep * radius / float(scale[0]), rise[2])
    facts = (part.feed, length, part.line_number, true_start, true_end)
    programmed = Move("arc", start, end, *facts, None, part.clockwise, part.turns, (x, y), sweep)
    move = _arc_on_grid(programmed, (x, y), radius)
    if move is None:
        return None
    check_line(move.start, move.end, width)
    if move.center is not None:
        turning = {"clockwise": move.clockwise, "turns": move.turns}
        check_arc(move.start[:2], move.end[:2], move.center, **turning, width=width)
    return move


def _away(point: Sequence[float], center: tuple[float, float]) -> float:
    """Give how far a point is from a centre in X and Y."""
    return hypot(point[0] - center[0], point[1] - center[1])


def _sweep(
    start: Sequence[float], end: Sequence[float], center: tuple[float, float], part: _Programmed
) -> float:
    """Give the angle of a programmed arc, whole turns with it, in radians."""
    angles = [atan2(point[1] - center[1], point[0] - center[0]) for point in (start, end)]
    way = (angles[0] - angles[1] if part.clockwise else angles[1] - angles[0]) % tau
    if min(way, tau - way) < _SAME_ANGLE:
        way = tau
    return way + tau * (part.turns - 1)


def _arc_on_grid(move: Move, center: tuple[float, float], radius: float) -> Move | None:
    """Find an arc on the grid for a programmed one, whose centre has no place there yet.

    None when it is no step long; a line if only Z moves.

    Where the nearest end has no good centre, one of the other three about the programmed end has.

    Raises
    ------
    BadInputError
        There is no such arc.
    """
    if move.start[:2] == move.end[:2] and (move.sweep < pi or radius < _SMALL):
        return None if move.start == move.end else _as_line(move)
    found = [_best_center(move, center, [move.end[:2]])]
    if found[0][0] > _FAR:
        others = _about(move.true_end) if move.end[:2] != move.start[:2] else []
        found.append(_best_center(move, center, others))
    off, block = min(found)
    if off <= _FAR:
        end = (block[2], block[3], *move.end[2:])
        return _with(move, end, (block[4], block[5]), block[7] + 1)
    raise BadInputError(
        f"rounded to steps the arc would be more than {_FAR} steps off: give more steps a mm, or "
        "lines"
    )


def _best_center(
    move: Move, center: tuple[float, float], ends: Sequence[tuple[int, ...]]
) -> tuple[float, list[int]]:
    """Give how far the best arc to one of these ends is off, and its block; infinity for none."""
    rows = []
    for end in ends:
        turn = (int(move.clockwise), move.turns - 1)
        rows += [(*move.start[:2], *end, *grid_point, *turn) for grid_point in _about(center)]
    if max((abs(value) for row in rows for value in row), default=0) >= 1 << 32:
        raise BadInputError("the arc or its center is beyond 2^32 steps: no device reaches there")
    blocks = np.array(rows, dtype=np.int64).reshape(-1, 8)
    # A start and an end that are nearly one may have changed sides: a turn more, or one less.
    blocks[:, 7] += np.rint((move.sweep / (pi / 2) - crossings(blocks)) / 4).astype(np.int64)
    fits = (blocks[:, 7] >= 0) & (blocks[:, 7] < MAX_TURNS)
    fits &= np.any(blocks[:, 0:2] != blocks[:, 4:6], axis=1)
    fits[fits] = refusals(blocks[fits], 32) != OFF_CURVE
    if not fits.any():
        return inf, []
    off = _deviations(move, blocks[fits])
    return float(off.min()), blocks[fits][int(np.argmin(off))].tolist()


def _with(move: Move, end: tuple[int, ...], center: tuple[int, int], turns: int) -> Move:
    """Give a move with another end, centre and number of turns."""
    return Move(
        "arc",
        *(move.start, end, move.feed, move.length, move.line_number),
        *(move.true_start, move.true_end, center, move.clockwise, turns),
        *(move.true_center, move.sweep),
    )


def _as_line(move: Move) -> Move:
    """Give the line between the ends of an arc, which is what it programmed still."""
    return Move(
        "line",
        *(move.start, move.end, move.feed, move.length, move.line_number),
        *(move.true_start, move.true_end, None, move.clockwise, move.turns),
        *(move.true_center, move.sweep),
    )


def _about(point: Sequence[float]) -> list[tuple[int, int]]:
    """Give the four grid points about a point in X and Y."""
    x, y = (floor(value) for value in point[:2])
    return [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)]


def _deviations(move: Move, blocks: np.ndarray) -> np.ndarray:
    """Give how far arcs on the grid are at most from the programmed one, in steps, by blocks."""
    center = blocks[:, None, 4:6]
    start = blocks[:, None, 0:2] - center
    side = -1 if move.clockwise else 1
    part = np.linspace(0, min(move.sweep, tau), _SAMPLES)
    angle = np.arctan2(start[..., 1], start[..., 0]) + side * part
    points = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = center + np.hypot(start[..., 0], start[..., 1])[..., None] * points
    ends = np.broadcast_to(blocks[:, None, 2:4], (len(blocks), 1, 2))
    points = np.concatenate([points, ends], axis=1)
    return distance_from_arc(move, points.reshape(-1, 2)).reshape(len(blocks), -1).max(axis=1)


def distance_from_arc(move: Move, points: np.ndarray) -> np.ndarray:
    """Give the distance of points from the programmed arc of a move in X and Y, in steps.

    Where the programmed radii of start and end differ, the radius goes evenly from one to the
    other. Points beyond the ends are compared with these.

    Parameters
    ----------
    points : array, shape (points, 2)
    """
    assert move.true_center is not None
    ends = np.array([move.true_start[:2], move.true_end[:2]])
    seen, (first, last) = points - move.true_center, ends - move.true_center
    side = -1 if move.clockwise else 1
    angle = np.arctan2(seen[:, 1], seen[:, 0]) - atan2(first[1], first[0])
    angle = side * angle % tau
    once = min(move.sweep, tau)
    radii = hypot(*first) + (hypot(*last) - hypot(*first)) * np.minimum(angle / once, 1)
    across = np.abs(np.hypot(*seen.T) - radii)
    beyond = np.minimum(*(np.hypot(*(points - end).T) for end in ends))
    return np.where(angle <= once, np.minimum(across, beyond), beyond)
