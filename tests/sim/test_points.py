import re
from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discreta.sim.arcs import RANGE, refusals
from discreta.sim.points import (
    BadInputError,
    check_arc,
    check_line,
    check_path,
    parse_point,
    read_points,
)


def fails_with(message):
    return pytest.raises(BadInputError, match=f"^{re.escape(message)}$")


@settings(derandomize=True, database=None)
@given(st.lists(st.integers(), min_size=1, max_size=6))
def test_whole_numbers_are_read(point):
    assert parse_point([str(value) for value in point]) == tuple(point)
    assert parse_point([f" {value:+d}\t" for value in point]) == tuple(point)


@pytest.mark.parametrize("cell", ["", " ", "x", "1.0", "1e3", "0x1", "1_0", "٣", "- 1", "--1", "½"])
def test_anything_else_is_no_point(cell):
    assert parse_point(["1", cell]) is None


@settings(derandomize=True, database=None)
@given(
    st.integers(4, 32).flatmap(
        lambda width: st.tuples(
            st.just(width),
            *[st.tuples(*[st.integers(-(2**width) - 2, 2**width + 1)] * 3) for _ in range(2)],
        )
    )
)
def test_a_line_is_refused_just_when_there_is_no_room(case):
    width, start, end = case
    inside = all(-(2**width) <= value <= 2**width - 1 for value in (*start, *end))
    short = all(abs(b - a) <= 2**width - 1 for a, b in zip(start, end, strict=True))
    complaint = ""
    try:
        check_line(start, end, width)
    except BadInputError as error:
        complaint = str(error)
    assert (complaint == "") == (inside and short)
    # The cure that it names is one: the next width has room for what it complains of.
    cure = f"give --width {width + 1}" if width < 32 else "no device has more than 32 bits"
    assert complaint == "" or complaint.endswith(f"; {cure}")
    with fails_with(complaint) if complaint else nullcontext():
        check_path(np.array([start, end]), width)


def test_a_path_is_refused_for_its_first_bad_line():
    good = [[0, -1], [255, -256], [1, -1], [-254, 254]]
    check_path(np.array(good), 8)
    with fails_with(
        "the line from 0,-1 to 0,255 is 256 steps long: width 8 has room for 255; give --width 9"
    ):
        check_path(np.array([*good, [0, -1], [0, 255], [256, 0]]), 8)
    with fails_with(
        "coordinate 256 is out of range: width 8 has room for -256 to 255; give --width 9"
    ):
        check_path(np.array([[256, 0], [0, 0]]), 8)


SEEN = "steps from the center"
COORDINATES = "width 8 has room for coordinates from -256 to 255"
# start, end, center, clockwise, turns, width; the complaint
ARCS = {
    "a quarter": ((100, 0), (0, 100), (0, 0), False, 1, 8, ""),
    "the longest quarter": ((255, 0), (0, 255), (0, 0), False, 1, 8, ""),
    "most turns": ((100, 0), (100, 0), (0, 0), True, 256, 8, ""),
    "no length": ((7, 7), (7, 7), (7, 7), False, 256, 8, ""),
    "no turn": (
        *((100, 0), (100, 0), (0, 0), True, 0, 8),
        "number of turns is 0: choose a whole number from 1 to 256",
    ),
    "too many turns": (
        *((100, 0), (100, 0), (0, 0), True, 257, 8),
        "number of turns is 257: choose a whole number from 1 to 256",
    ),
    "coordinate": (
        *((300, 0), (0, 300), (0, 0), False, 1, 8),
        "coordinate 300 is out of range: width 8 has room for -256 to 255; give --width 9",
    ),
    "the lowest coordinate of a width": (
        *((0, 0), (0, -512), (0, -256), False, 1, 8),
        "coordinate -512 is out of range: width 8 has room for -256 to 255; give --width 9",
    ),
    "coordinate of the center": (
        *((10, 0), (0, 10), (0, -(10**60)), False, 1, 32),
        f"coordinate -1{'0' * 38}… is out of range: width 32 has room for -4294967296 to "
        "4294967295; no device has more than 32 bits",
    ),
    "start seen from the center": (
        *((200, 0), (-100, 9), (-100, 0), False, 1, 8),
        f"the start 200,0 is 300 {SEEN} -100,0 along an axis: width 8 has room for 255; give "
        "--width 9",
    ),
    "and the widest device": (
        *((2**31 - 1, 0), (0, 9), (-10, 0), False, 1, 31),
        f"the start 2147483647,0 is 2147483657 {SEEN} -10,0 along an axis: width 31 has room for "
        "2147483647; give --width 32",
    ),
    "end seen from the center": (
        *((5, -5), (6, -256), (0, 0), False, 1, 8),
        f"the end 6,-256 is 256 {SEEN} 0,0 along an axis: width 8 has room for 255; give --width 9",
    ),
    "a radius too large to cross an axis": (
        *((0, 255), (255, 0), (0, 0), False, 1, 8),
        "the arc crosses an axis of its center, up to 256 steps from it: width 8 has room for 255; "
        "give --width 9",
    ),
    "and for any device": (
        *((0, 2**32 - 1), (2**32 - 1, 0), (0, 0), False, 1, 32),
        "the arc crosses an axis of its center, up to 4294967296 steps from it: width 32 has room "
        "for 4294967295; no device has more than 32 bits",
    ),
    "just inside on the right": ((250, -9), (250, 9), (242, 0), False, 1, 8, ""),
    "out on the right": (
        *((251, -10), (251, 10), (242, 0), False, 1, 8),
        f"the arc may reach 256 where it crosses an axis of its center 242,0: {COORDINATES}; give "
        "--width 9",
    ),
    "the other way": ((251, -10), (251, 10), (242, 0), True, 1, 8, ""),
    "the other way, and a turn more": (
        *((251, -10), (251, 10), (242, 0), True, 2, 8),
        f"the arc may reach 256 where it crosses an axis of its center 242,0: {COORDINATES}; give "
        "--width 9",
    ),
    "just inside below": ((-10, -251), (10, -251), (0, -242), False, 1, 8, ""),
    "out below": (
        *((-10, -252), (10, -252), (0, -243), False, 1, 8),
        f"the arc may reach -257 where it crosses an axis of its center 0,-243: {COORDINATES}; "
        "give --width 9",
    ),
    "off the circle": (
        *((100, 0), (0, 103), (0, 0), False, 1, 8),
        f"the end 0,103 is 103.0000 {SEEN} 0,0 and the start 100,0 is 100.0000: 3.0000 apart, and "
        "1 is allowed; give an end on the start's circle",
    ),
    "within it": (
        *((5, 113), (5, 108), (5, 5), True, 1, 8),
        f"the end 5,108 is 103.0000 {SEEN} 5,5 and the start 5,113 is 108.0000: 5.0000 apart, and "
        "1 is allowed; give an end on the start's circle",
    ),
    "by hardly more than a step": (
        *((2**31, 0), (1, 2**31 + 1), (0, 0), False, 1, 32),
        f"the end 1,2147483649 is 2147483649.0000 {SEEN} 0,0 and the start 2147483648,0 is "
        "2147483648.0000: 1.0001 apart, and 1 is allowed; give an end on the start's circle",
    ),
    "by a step": ((2**31, 0), (0, 2**31 + 1), (0, 0), False, 1, 32, ""),
    "from the center": (
        *((5, 5), (5, 6), (5, 5), False, 1, 8),
        "the start 5,5 is the center and the end 5,6 is not: an arc needs a radius; give another "
        "center",
    ),
}


@pytest.mark.parametrize("case", ARCS.values(), ids=ARCS)
def test_arcs(case):
    *points, clockwise, turns, width, complaint = case
    with fails_with(complaint) if complaint else nullcontext():
        check_arc(*points, clockwise=clockwise, turns=turns, width=width)


@st.composite
def arcs(draw):
    """Draw arcs of any width, most of them nearly on a circle; some without room."""
    width = draw(st.integers(4, 32))
    coordinate = st.integers(-(2**width) - 2, 2**width + 1)
    start, center = (draw(st.tuples(coordinate, coordinate)) for _ in range(2))
    x, y = (a - b for a, b in zip(start, center, strict=True))
    seen = draw(st.sampled_from([(x, y), (y, x), (-x, y), (-y, -x)]))
    off = draw(st.tuples(st.integers(-1, 1), st.integers(-1, 1)))
    end = tuple(a + b + c for a, b, c in zip(center, seen, off, strict=True))
    return start, end, center, draw(st.booleans()), draw(st.integers(1, 256)), width


@settings(derandomize=True, database=None, max_examples=400)
@given(arcs())
def test_an_arc_is_refused_just_when_the_device_refuses_it(case):
    start, end, center, clockwise, turns, width = case

    def complaint_at(width):
        try:
            check_arc(start, end, center, clockwise=clockwise, turns=turns, width=width)
        except BadInputError as error:
            return str(error)
        return ""

    complaint = complaint_at(width)
    if any(not -(2**width) <= value < 2**width for value in (*start, *end, *center)):
        assert complaint.startswith("coordinate ")
        return
    blocks = np.array([[*start, *end, *center, clockwise, turns - 1]])
    code = refusals(blocks, width)[0]
    assert (complaint == "") == (code == 0)
    # The width that it names is the least that has room for the arc.
    if cure := re.search(r"; give --width (\d+)$", complaint):
        enough = int(cure[1])
        assert code == RANGE
        assert width < enough <= 32
        assert "width" not in complaint_at(enough)
        assert complaint_at(enough - 1).endswith(cure[0])
    elif code == RANGE:
        assert complaint.endswith("; no device has more than 32 bits")
        assert "width 32 has room" in complaint_at(32)


GOOD = {
    "plain": b"x,y\n0,0\n-5,3\n",
    "no newline at the end": b"x,y\n0,0\n-5,3",
    "BOM and CRLF": b"\xef\xbb\xbfx,y\r\n0,0\r\n-5,3\r\n",
    "CR alone": b"x,y\r0,0\r-5,3\r",
    "blank rows": b"\n  \nx,y\n\n0,0\n , \n\t\n-5,3\n,\n\n",
    "spaces, capitals and quotes": b'X , Y\n 0,"0"\n-5 , +3\n',
}


@pytest.mark.parametrize("content", GOOD.values(), ids=GOOD)
def test_files_as_programs_write_them(tmp_path, content):
    file = tmp_path / "a.csv"
    file.write_bytes(content)
    points = read_points(str(file), 4)
    assert points.dtype == np.int64
    assert points.tolist() == [[0, 0], [-5, 3]]


def test_six_axes(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("x,y,z,a,b,c\n1,2,3,4,5,6\n-1,-2,-3,-4,-5,-6\n")
    assert read_points(str(file), 4).tolist() == [[1, 2, 3, 4, 5, 6], [-1, -2, -3, -4, -5, -6]]


HEADER = "the first line must name the axes, x,y or up to x,y,z,a,b,c"
GIVE = "give a line x,y and a support point in every line after it"
BAD = {
    "empty": (b"", f" is empty: {GIVE}"),
    "blank": (b"\n \n,\n", f" is empty: {GIVE}"),
    "header only": (b"x,y\n", " has too few support points, 0: a path needs at least 2"),
    "one point": (b"x,y\n1,2\n", " has too few support points, 1: a path needs at least 2"),
    "no header": (b"0,0\n5,3\n", f" begins with '0,0': {HEADER}"),
    "one axis": (b"x\n0\n", f" begins with 'x': {HEADER}"),
    "seven axes": (b"x,y,z,a,b,c,d\n", f" begins with 'x,y,z,a,b,c,d': {HEADER}"),
    "axes in another order": (b"y,x\n0,0\n1,1\n", f" begins with 'y,x': {HEADER}"),
    "semicolons": (b"x;y\n0;0\n1;1\n", f" begins with 'x;y': {HEADER}"),
    "zeros": (bytes(3000), " begins with '" + r"\x00" * 40 + f"…': {HEADER}"),
    "letter": (
        b"x,y\n0,0\n5,a\n",
        ", line 3: '5,a' is not a point: give 2 whole numbers of steps",
    ),
    "float": (
        b"x,y\n0,0\n5,1.5\n",
        ", line 3: '5,1.5' is not a point: give 2 whole numbers of steps",
    ),
    "short row": (b"x,y\n\n5\n", ", line 3: '5' is not a point: give 2 whole numbers of steps"),
    "long row": (
        b"x,y\n0,0,\n",
        ", line 2: '0,0,' is not a point: give 2 whole numbers of steps",
    ),
    "very long number": (
        b"x,y\n" + b"9" * 9000 + b",0\n",
        f", line 2: '{'9' * 40}…' is not a point: give 2 whole numbers of steps",
    ),
    "long number": (
        b"x,y\n" + b"-" + b"9" * 90 + b",0\n",
        f", line 2: coordinate -{'9' * 39}… is out of range: width 8 has room for -256 to 255; "
        "no device has more than 32 bits",
    ),
    "far point": (
        b"x,y\n0,0\n0,1000\n",
        ", line 3: coordinate 1000 is out of range: width 8 has room for -256 to 255; "
        "give --width 10",
    ),
    "long line": (
        b"x,y\n0,0\n0,-200\n0,200\n",
        ", line 4: the line from 0,-200 to 0,200 is 400 steps long: width 8 has room for 255; "
        "give --width 9",
    ),
    "another encoding": ("x,y\n0,0\n".encode("utf-16"), f" is not a CSV file in UTF-8: {GIVE}"),
    "binary": (b"x,y\n\xff\xfe\x80", f" is not a CSV file in UTF-8: {GIVE}"),
    "quote without end": (b'x,y\n"' + b"0,0\n" * 50000, f" is not a CSV file in UTF-8: {GIVE}"),
}


@pytest.mark.parametrize(("content", "message"), BAD.values(), ids=BAD)
def test_bad_files(tmp_path, content, message):
    file = tmp_path / "a.csv"
    file.write_bytes(content)
    with fails_with(f"{file}{message}"):
        read_points(str(file), 8)


def test_what_is_no_file(tmp_path):
    with fails_with(f"cannot read {tmp_path}: Is a directory; name a CSV file"):
        read_points(str(tmp_path), 8)
    with fails_with(f"cannot read {tmp_path}/no: No such file or directory; name a CSV file"):
        read_points(f"{tmp_path}/no", 8)


@settings(derandomize=True, database=None, max_examples=200)
@given(st.binary(max_size=60) | st.text('xy,0123456789-+.\n\r" ;').map(str.encode))
def test_any_bytes_are_read_or_refused(tmp_path_factory, content):
    file = tmp_path_factory.getbasetemp() / "any.csv"
    file.write_bytes(content)
    points, complaint = None, ""
    try:
        points = read_points(str(file), 16)
    except BadInputError as error:
        complaint = str(error).replace(str(file), "")
    assert complaint if points is None else len(points) >= 2
    assert len(complaint) < 300
    assert "\n" not in complaint
