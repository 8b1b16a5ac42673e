import re
from fractions import Fraction
from math import hypot, inf, pi
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discreta.sim.arcs import crossings, refusals
from discreta.sim.gcode import (
    IGNORABLE,
    STATE_WORDS,
    distance_from_arc,
    is_gcode,
    moves_of,
    read_moves,
)
from discreta.sim.points import BadInputError

#: Steps a mm of which one is a thousandth of an inch: both units reach every step exactly.
THOU = Fraction(10000, 254)


def moves(text, *, scale: Any = 10, width=16, ignored=()):
    scales = scale if isinstance(scale, tuple) else (scale,) * 3
    steps_per_mm = [Fraction(value) for value in scales]
    return moves_of(text.splitlines(keepends=True), "a.ngc", steps_per_mm, width, ignored)


def shape(move):
    """What a move is, without what was programmed."""
    if move.kind == "line":
        return (move.start, move.end)
    return (move.start, move.end, move.center, move.clockwise, move.turns)


def shapes(text, **given):
    return [shape(move) for move in moves(text, **given)]


def fails(text, message, **given):
    with pytest.raises(BadInputError) as error:
        moves(text, **given)
    assert str(error.value) == message


def fails_in(text, line, message, **given):
    fails(text, f"a.ngc, line {line}: {message}", **given)


def test_lines():
    read = moves("G21 G90\nG0 X1 Y2\nG1 X3 F600\nY-4\nM2\n")
    assert [shape(move) for move in read] == [
        ((0, 0), (10, 20)),
        ((10, 20), (30, 20)),
        ((30, 20), (30, -40)),
    ]
    assert [move.feed for move in read] == [None, 600, 600]
    assert [move.line_number for move in read] == [2, 3, 4]
    assert [move.length for move in read] == [pytest.approx(hypot(1, 2)), 2, 6]


@pytest.mark.parametrize(
    "line",
    [
        "g1x1y2f60",
        "G01 X+1. Y2.0 F60.",
        "N10 G1 X 1 Y 2 F 60 ; the end X9",
        "  G1 (X5) X1 (a ; b) Y2 F60(c)",
        "F60 Y2 X1 G1",
        "G1\tX1\tY2\tF60\r",
        "N0001 G1 X1.000 Y002 F060",
    ],
)
def test_how_a_line_may_be_written(line):
    assert shapes(f"{line}\nm30") == [((0, 0), (10, 20))]


@pytest.mark.parametrize(
    "end", ["M2", "m02", "M30 (done)", "G0 X0 M2", "%\n", "M2\nM3 X#5 nonsense"]
)
def test_the_end_of_a_program(end):
    assert shapes(f"%\nG1 X1 F1\n{end}")[0] == ((0, 0), (10, 0))


def test_a_program_without_an_end_may_be_cut_off():
    for text in ("G1 X1 F1\n", "%\nG1 X1 F1\n", ""):
        fails(text, "a.ngc ends without M2, M30 or %: it may have been cut off; end it with one")


def test_relative_ends_add_up_before_they_are_rounded():
    text = "G91 F60\n" + "G1 X0.04 Y-0.03\n" * 100 + "M2"
    read = moves(text)
    assert read[-1].end == (40, -30)
    # Half of them lead to the step where the one before did, and are left out.
    assert len(read) == 50
    for move in read:
        assert all(abs(a - b) <= 0.5 for a, b in zip(move.end, move.true_end, strict=True))


def test_units():
    assert shapes("G20\nG1 X1 F10\nM2") == [((0, 0), (254, 0))]
    (move,) = moves("G20\nG1 X1 F10\nM2")
    assert move.feed == 254
    assert shapes("G20 G0 X1\nG21 X1\nM2") == [((0, 0), (254, 0)), ((254, 0), (10, 0))]
    # A unit that is given again changes nothing.
    assert len(moves("G21 F60 G1 X1\nG21 F30 X2\nG21 X3\nM2")) == 3
    fails_in(
        "G20 F10 G1 X1",
        1,
        "F stands in the line that changes the unit, and is read in one or the other by different "
        "machines: give it in the next line",
    )
    fails_in(
        "G1 X1 F60\nG20\nX2",
        3,
        "G1 has no speed: give F in this line or before; it is forgotten where the unit changes",
    )


def test_the_third_axis():
    assert shapes("G0 Z1\nG1 X1 F1\nM2") == [((0, 0, 0), (0, 0, 10)), ((0, 0, 10), (10, 0, 10))]
    # It counts when it moves.
    assert shapes("G0 Z0\nG1 X1 F1\nM2") == [((0, 0), (10, 0))]
    (move,) = moves("G1 X3 Y0 Z4 F1\nM2", scale=(10, 10, 20))
    assert move.end == (30, 0, 80)
    assert (move.length, move.true_length) == (5, pytest.approx(hypot(30, 80)))


@pytest.mark.parametrize(
    ("words", "clockwise"),
    [
        ("G3 X0 Y10 I-10 J0", False),
        ("G3 X0 Y10 I-10", False),
        ("G3 X0 Y10 R10", False),
        ("G90.1 G3 X0 Y10 I0 J0", False),
        ("G91 G3 X-10 Y10 R10", False),
        ("G91 G90.1 G3 X-10 Y10 I0 J0", False),
        ("G2 X0 Y10 I-10", True),
        ("G2 X0 Y10 R-10", True),
    ],
)
def test_arcs(words, clockwise):
    read = moves(f"G0 X10 F1\n{words}\nM2")
    assert shape(read[1]) == ((100, 0), (0, 100), (0, 0), clockwise, 1)
    assert read[1].sweep == pytest.approx(1.5 * pi if clockwise else pi / 2)
    assert read[1].length == pytest.approx(10 * read[1].sweep)


def test_modes_of_centers_go_back():
    text = "F1 G0 X10\nG90.1 G3 X0 Y10 I0 J0\nG91.1 G3 X-10 Y0 I0 J-10\nM2"
    assert [move.center for move in moves(text)] == [None, (0, 0), (0, 0)]


def test_the_other_arcs_by_radius():
    assert shapes("F1 G0 X10\nG3 X0 Y10 R-10\nM2")[1] == ((100, 0), (0, 100), (100, 100), False, 1)
    assert shapes("F1 G0 X10\nG2 X0 Y10 R10\nM2")[1] == ((100, 0), (0, 100), (100, 100), True, 1)
    # Half a turn, the radius rounded: a little too short, or too long, which moves the centre by
    # 1.41 steps.
    for radius, y in ((9.999, 0), (10, 0), (10.001, -1)):
        read = shapes(f"F1 G0 X10\nG3 X-10 R{radius}\nM2")
        assert read[1] == ((100, 0), (-100, 0), (0, y), False, 1)


def test_whole_turns():
    circle = ((100, 0), (100, 0), (0, 0), True, 1)
    for words in ("G2 I-10", "G2 X10 I-10", "G2 X10 Y0 I-10 J0 P1", "G91 G2 X0 I-10"):
        assert shapes(f"F1 G0 X10\n{words}\nM2")[1] == circle
    assert shapes("F1 G0 X10\nG2 I-10 P3\nM2")[1] == (*circle[:4], 3)
    read = moves("F1 G0 X10\nG3 X0 Y10 I-10 P256\nM2")[1]
    assert shape(read) == ((100, 0), (0, 100), (0, 0), False, 256)
    assert read.sweep == pytest.approx(255 * 2 * pi + pi / 2)


def test_a_helix():
    read = moves("F1 G0 X10\nG3 X0 Y10 I-10 Z-3 P2\nM2")[1]
    assert shape(read) == ((100, 0, 0), (0, 100, -30), (0, 0), False, 2)
    assert read.helical
    assert read.length == pytest.approx(hypot(2.5 * pi * 10, 3))
    assert not moves("F1 G0 X10 Z1\nG3 X0 Y10 I-10\nM2")[1].helical


def test_a_circle_too_small_for_a_step_is_none_but_for_its_way_along_z():
    assert shapes("F1 G2 I0.04\nG1 X1\nM2") == [((0, 0), (10, 0))]
    assert shapes("F1 G2 I0.04 Z1\nM2") == [((0, 0, 0), (0, 0, 10))]
    assert shapes("F1 G0 X10\nG3 X9.99999 Y0.01 I-10 Z1\nM2")[1] == ((100, 0, 0), (100, 0, 10))


@pytest.mark.parametrize("word", STATE_WORDS)
def test_words_of_the_state_change_nothing(word):
    assert shapes(f"{word}\n{word} (again)\nG1 F1 X1\nM2") == [((0, 0), (10, 0))]


def test_g64_takes_its_tolerance():
    assert shapes("G64 P0.01 Q0.01 G1 X1 F1\nM2") == [((0, 0), (10, 0))]
    fails_in("G1 X1 F1 Q5", 1, "Q goes with G64, and this line has no such word: leave it out")
    fails_in(
        "G64 P1 F1 G2 I1 X2",
        1,
        "P may be of the arc or of G64: give them in two lines",
    )


@pytest.mark.parametrize("word", IGNORABLE)
def test_what_may_be_ignored(word):
    name = word if word[0] in "GM" else f"{word}3"
    text = f"{name} G1 X1 F1\nM2"
    assert shapes(text, ignored=(word,)) == [((0, 0), (10, 0))]
    with pytest.raises(
        BadInputError, match=rf"^a.ngc, line 1: {name} .*, or give --ignore {word}$"
    ):
        moves(text)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("M3 S100", "M3 is not understood (the machine has no spindle): leave it out, or give "
         "--ignore M3"),
        ("G18", "G18 is not understood (arcs lie in the XY plane, G17): leave it out"),
        ("G5.1 X1", "G5.1 is not understood: leave it out"),
        ("G1 X1 A5", "A5 is not understood (the axes are X, Y and Z): leave it out"),
        ("X1", "X stands without a G0, G1, G2 or G3 before: give one"),
        ("G80 X1", "X stands without a G0, G1, G2 or G3 before: give one"),
        ("G1 X1", "G1 has no speed: give F in this line or before"),
        ("G2 I1", "G2 has no speed: give F in this line or before"),
        ("F0", "F0 is no speed: give more than 0"),
        ("F-5", "F-5 is no speed: give more than 0"),
        ("G0 G1 X1", "G0 and G1 exclude each other: give one of them"),
        ("G90 G91", "G90 and G91 exclude each other: give one of them"),
        ("M2 M30", "M2 and M30 exclude each other: give one of them"),
        ("G0 X1 X1", "X stands twice: give it once"),
        ("G17 G17", "G17 stands twice: give it once"),
        ("G0 X1 N5", "N stands behind other words: put the line's number first"),
        ("G0 I1 X1", "I goes with G2 and G3, and this line has no such word: leave it out"),
        ("G0 P1 X1", "P goes with G2, G3 and G64, and this line has no such word: leave it out"),
        ("F1 G2 I1 K1", "K goes with G18 and G19, and this line has no such word: leave it out"),
        ("F1 G2 X1", "G2 has neither I, J nor R: give its center by I and J, or its radius by R"),
        ("F1 G2 X1 I1 R1", "G2 has both I or J and R: give its center by I and J, or its radius "
         "by R"),
        ("F1 G90.1 G2 X1 I1", "under G90.1 an arc needs both I and J: give them"),
        ("F1 G2 X1 I0", "the arc starts at its center: give another I or J"),
        ("F1 G2 X1 I1", "the arc starts 1.0000 mm from its center and ends 0.0000 mm from it: give "
         "a center equally far from both"),
        ("F1 G2 I1 P0", "P0 is no turn: give a whole number up to 256"),
        ("F1 G2 I1 P1.5", "P1.5 is no turn: give a whole number up to 256"),
        ("F1 G2 I1 P257", "P257 is no turn: give a whole number up to 256"),
        ("F1 G2 R1", "an arc by R ends where it starts: give its center by I and J"),
        ("F1 G2 X2.1 R1", "the end is 2.1000 mm from the start, and the radius is only 1.0000 mm: "
         "give half of that or more"),
        ("G0 X1 (open", "the comment (open has no end: close it with )"),
        ("G0 X1 (a (b) c)", "the comment (a (b) c) has no end: close it with )"),
        ("G0 X1)", ") is not understood: leave it out"),
        ("G0 X", "X is not understood: leave it out"),
        ("G0 X1 0", "0 is not understood: leave it out"),
        ("G0 X1.2.3", "X1.2.3 is not understood: leave it out"),
        ("G0 X--1", "X--1 is not understood: leave it out"),
        ("G0 X1e3", "E3 is not understood: leave it out"),
        ("G0 X#1", "X#1 is not understood (parameters are not reckoned with): leave it out"),
        ("#1=2", "#1=2 is not understood (parameters are not reckoned with): leave it out"),
        ("G0 X[1+2]", "X[1+2] is not understood (expressions are not reckoned with): leave it out"),
        ("o<sub> call", "O<SUB> is not understood (there are no subroutines and no loops): leave "
         "it out"),
        ("/G0 X1", "/G0 is not understood (no line is left out on demand): leave it out"),
        ("x,y", "X,Y is not understood: leave it out"),
        ("G0 X1 %", "% is not understood: leave it out"),
        ("G0 X" + "9" * 31, f"X{'9' * 31} is not understood: leave it out"),
        ("G0 X9000", "coordinate 90000 is out of range: width 16 has room for -65536 to 65535; "
         "give --width 17"),
        ("F1 G2 X1 I6000 J6000 R-1", "G2 has both I or J and R: give its center by I and J, or "
         "its radius by R"),
    ],
)  # fmt: skip
def test_what_is_refused_names_its_line(line, message):
    fails_in(f"(first)\n\n{line}\nM2", 3, message)


def test_a_speed_is_needed_before_the_first_move_only():
    assert len(moves("G0 X1\nG1 F5 X2\nX3\nG2 X4 R1\nM2")) == 4


def test_an_arc_needs_axes_of_one_scale():
    text = "F1 G0 X1\nG2 I1\nM2"
    fails_in(
        text, 2, "X has 10 steps a mm and Y 20: an arc needs as many on both", scale=(10, 20, 10)
    )
    assert len(moves("F1 G1 X1 Y1\nM2", scale=(10, 20, 10))) == 1


def test_an_arc_without_room():
    text = "F1 G0 X6000\nG3 X0 Y6000 I-6000\nG3 X-6000 Y0 I0 J-6000\nM2"
    assert len(moves(text)) == 3
    fails_in(
        "F1 G2 X1 Y1 R7000\nM2",
        1,
        "coordinate 49502 is out of range: width 15 has room for -32768 to 32767; give --width 16",
        width=15,
    )
    fails_in(
        "F1 G2 X1 Y1 R70000000000\nM2",
        1,
        "the arc or its center is beyond 2^32 steps: no device reaches there",
    )


def test_nothing_moves():
    fails("G0 X0\nM2", "a.ngc moves nothing: give at least one move of a step")


def test_files(tmp_path):
    assert [is_gcode(f"a{ending}") for ending in (".ngc", ".NC", ".gcode", ".tap", ".csv", "")] == [
        *[True] * 4,
        *[False] * 2,
    ]
    file = tmp_path / "a.ngc"
    scale = [Fraction(10)] * 3
    with pytest.raises(
        BadInputError, match=r"cannot read .*a\.ngc: No such file or directory; name"
    ):
        read_moves(str(file), scale, 16)
    # Comments may be in any encoding; the file may begin with a mark of its own.
    file.write_bytes(b"\xef\xbb\xbfG1 X1 F1 (M\xfcller)\r\nM2\r\n")
    assert [shape(move) for move in read_moves(str(file), scale, 16)] == [((0, 0), (10, 0))]
    file.write_bytes(bytes(range(256)))
    with pytest.raises(BadInputError, match=f"^{re.escape(str(file))}, line 1: "):
        read_moves(str(file), scale, 16)


ALPHABET = "GgMXYZIJRFPNSTQK0123456789.-+ ()\n;%#[]/=\t\x00é"
WORDS = st.sampled_from(
    [
        *("G0", "G1", "G2", "G3", "G17", "G20", "G21", "G90", "G91", "G90.1", "G80", "M2", "M3"),
        *("X1", "X-2.5", "Y3", "Z1", "I1", "J-1", "R2", "R-3", "F60", "P2", "N1", "%", "(c)"),
        *(";", "\n", "\n"),
    ]
)


@settings(derandomize=True, database=None, max_examples=400)
@given(
    st.one_of(st.text(ALPHABET, max_size=60), st.lists(WORDS, max_size=30).map(" ".join), st.text())
)
def test_whatever_is_read_is_moves_or_one_line(text):
    complaint, read = "", []
    try:
        read = moves(text, ignored=("M3",))
    except BadInputError as error:
        complaint = str(error)
    if complaint:
        where = re.match(r"a\.ngc(, line (\d+):| moves nothing| ends without)", complaint)
        assert where
        assert 1 <= int(where[2] or 1) <= max(1, len(text.splitlines()))
        return
    here = (0,) * len(read[0].start)
    for move in read:
        assert move.start == here
        here = move.end


# On the grid: lines, and arcs about a centre to a point of the same circle.
PYTHAGOREAN = [(5, 0), (4, 3), (3, 4), (0, 5), (-3, 4), (-4, 3), (-5, 0), (-4, -3), (-3, -4)]
PYTHAGOREAN += [(0, -5), (3, -4), (4, -3)]


@st.composite
def programs(draw):
    """Draw moves in steps, and a program of them in modes drawn anew for every line."""
    integers = st.integers(-300, 300)
    number = draw(st.integers(1, 12))
    inch = relative = absolute_centers = False
    lines, made, here, feed = ["g21 f100"], [], (0, 0), "100"
    for index in range(number):
        words = []
        if draw(st.booleans()):
            inch = draw(st.booleans())
            feed = str(draw(st.integers(1, 999)))
            lines.append("G20" if inch else "G21")
            lines.append(f"F{feed}")
        if draw(st.booleans()):
            relative = draw(st.booleans())
            words.append("G91" if relative else "G90")
        if draw(st.booleans()):
            absolute_centers = draw(st.booleans())
            words.append("G90.1" if absolute_centers else "G91.1")

        def written(value, inch=inch):
            """Write a number of steps in the unit: 3 places in inches, 4 in mm."""
            number = Fraction(value, 1000) * (1 if inch else Fraction(254, 10))
            text = f"{float(number):.4f}"
            assert Fraction(text) == number
            return text.rstrip("0") if draw(st.booleans()) else text

        def end_words(end, here=here, relative=relative, written=written):
            shown = [b - a if relative else b for a, b in zip(here, end, strict=True)]
            return [f"{a}{written(value)}" for a, value in zip("XY", shown, strict=True)]

        if draw(st.booleans()):
            end = draw(st.tuples(integers, integers).filter(lambda end, here=here: end != here))
            rapid = draw(st.booleans())
            words += ["G0" if rapid else "G1", *end_words(end)]
            made.append((here, end))
        else:
            size = draw(st.integers(1, 40))
            first, last = draw(st.sampled_from(PYTHAGOREAN)), draw(st.sampled_from(PYTHAGOREAN))
            clockwise = draw(st.booleans())
            turns = draw(st.integers(1, 3))
            center = (here[0] - size * first[0], here[1] - size * first[1])
            end = (center[0] + size * last[0], center[1] + size * last[1])
            seen = center if absolute_centers else (center[0] - here[0], center[1] - here[1])
            words += ["G2" if clockwise else "G3", *end_words(end)]
            words += [f"I{written(seen[0])}", f"J{written(seen[1])}"]
            if turns > 1:
                words.append(f"P{turns}")
            made.append((here, end, center, clockwise, turns))
        here = end
        words = draw(st.permutations(words))
        if draw(st.booleans()):
            words = [f"N{index}", *words, "(c)"]
        line = draw(st.sampled_from(["", " "])).join(words)
        lines.append(line.lower() if draw(st.booleans()) else line)
    return made, "\n".join([*lines, "M2"])


@settings(derandomize=True, database=None, max_examples=150, deadline=None)
@given(programs())
def test_programs_on_the_grid_come_back_as_they_are(program):
    made, text = program
    assert shapes(text, scale=THOU) == made


def sampled(move):
    """Give points of the arc on the grid."""
    angles = np.linspace(0, 1, 200)
    x, y = np.array(move.start[:2]) - move.center
    u, v = np.array(move.end[:2]) - move.center
    side = -1 if move.clockwise else 1
    sweep = side * (np.arctan2(v, u) - np.arctan2(y, x)) % (2 * pi)
    if move.start[:2] == move.end[:2]:
        sweep = 2 * pi
    angle = np.arctan2(y, x) + side * sweep * angles
    circle = hypot(x, y) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.concatenate([move.center + circle, [move.end[:2]]])


@settings(derandomize=True, database=None, max_examples=400, deadline=None)
@given(
    st.tuples(st.floats(-20, 20), st.floats(-20, 20)),
    st.floats(-1, 4).map(lambda exponent: 10**exponent / 10),
    st.floats(0, 2 * pi),
    st.one_of(st.floats(0, 2 * pi), st.floats(0, 0.1), st.floats(2 * pi - 0.1, 2 * pi)),
    st.booleans(),
)
def test_any_arc_can_be_run_and_is_nearly_the_programmed_one(
    center, radius, begin, sweep, clockwise
):
    ends = [
        (center[0] + radius * np.cos(angle), center[1] + radius * np.sin(angle))
        for angle in (begin, begin + (-sweep if clockwise else sweep))
    ]
    (a, b), (u, v) = [(f"{x:.6f}", f"{y:.6f}") for x, y in ends]
    i, j = f"{center[0] - float(a):.6f}", f"{center[1] - float(b):.6f}"
    word = "G2" if clockwise else "G3"
    text = f"F1 G0 X1000\nX{a} Y{b}\n{word} X{u} Y{v} I{i} J{j}\nM2"
    read = [move for move in moves(text, width=24) if move.kind == "arc"]
    for move in read:
        assert move.center is not None
        block = np.array([move.block], dtype=np.int64)
        assert refusals(block, 24)[0] == 0
        # The device goes round as often as was programmed.
        assert abs(crossings(block)[0] - move.sweep / (pi / 2)) <= 2
        assert distance_from_arc(move, sampled(move)).max() <= 2 + 1e-9
    if not read:
        assert radius * 10 < 0.5 or sweep * radius * 10 < 2


def test_the_distance_from_an_arc():
    (_, move) = moves("F1 G0 X10\nG3 X0 Y10 I-10\nM2")
    points = np.array([[100, 0], [0, 100], [60, 80], [66, 88], [100, -7], [-3, 100], [0, 0]])
    off = distance_from_arc(move, points).tolist()
    assert off == pytest.approx([0, 0, 0, 10, 7, 3, 100])
    assert off[0] < inf
