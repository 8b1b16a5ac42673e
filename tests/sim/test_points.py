import re
from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discreta.sim.points import BadInputError, check_line, check_path, parse_point, read_points


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
