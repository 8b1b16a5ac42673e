import pytest
from amaranth import Shape, signed, unsigned
from amaranth.lib import data

from discreta.hdl.contract import (
    AXIS_LETTERS,
    MAX_AXES,
    MAX_GUARD,
    MAX_WIDTH,
    MIN_AXES,
    MIN_WIDTH,
    ErrorCode,
    check_axes,
    check_choice,
    check_flag,
    check_guard,
    check_width,
    point_layout,
    register_names,
    step_layout,
)
from tests.hdl.parts.clocked import BAD_AXES, BAD_GUARDS, BAD_WIDTHS, assert_refused


def test_limits():
    assert (MIN_WIDTH, MAX_WIDTH, MIN_AXES, MAX_AXES, MAX_GUARD) == (4, 32, 2, 6, 4)
    assert AXIS_LETTERS == "xyzabc"


def test_error_codes():
    assert {name: code.value for name, code in ErrorCode.__members__.items()} == {
        "NONE": 0,
        "RANGE": 1,
        "OFF_CURVE": 2,
        "SHARP": 3,
    }
    assert Shape.cast(ErrorCode) == unsigned(2)


@pytest.mark.parametrize("width", range(4, 33))
def test_accepts_width(width):
    check_width(width)


@pytest.mark.parametrize("axes", range(2, 7))
def test_accepts_axes(axes):
    check_axes(axes)


@pytest.mark.parametrize(
    ("width", "error", "message"),
    [
        *BAD_WIDTHS,
        (0, ValueError, "width is 0: choose a whole number from 4 to 32"),
        (-8, ValueError, "width is -8: choose a whole number from 4 to 32"),
        (None, TypeError, "width must be a whole number from 4 to 32, not None"),
    ],
)
def test_refuses_width(width, error, message):
    assert_refused((error, message), check_width, width)


def test_a_method_may_have_a_limit_of_its_own():
    check_width(24, 24)
    check_width(4, 24)
    for width in (3, 25):
        message = f"width is {width}: choose a whole number from 4 to 24"
        assert_refused((ValueError, message), check_width, width, 24)
    message = "width must be a whole number from 4 to 24, not 8.0"
    assert_refused((TypeError, message), check_width, 8.0, 24)


@pytest.mark.parametrize(("axes", "error", "message"), BAD_AXES)
def test_refuses_axes(axes, error, message):
    assert_refused((error, message), check_axes, axes)


@pytest.mark.parametrize("guard", range(5))
def test_accepts_guard(guard):
    check_guard(guard)


@pytest.mark.parametrize(("guard", "error", "message"), BAD_GUARDS)
def test_refuses_guard(guard, error, message):
    assert_refused((error, message), check_guard, guard)


def test_flag():
    check_flag("hot", True)
    check_flag("hot", False)
    for value in (0, 1, "yes", None):
        message = f"hot must be True or False, not {value!r}"
        assert_refused((TypeError, message), check_flag, "hot", value)


def test_choice():
    check_choice("colour", "red", ("red", "green", "blue"))
    message = "colour is 'pink': choose 'red' or 'green' or 'blue'"
    assert_refused((ValueError, message), check_choice, "colour", "pink", ("red", "green", "blue"))


@pytest.mark.parametrize("width", [4, 8, 32])
@pytest.mark.parametrize("axes", range(2, 7))
def test_point_layout(width, axes):
    layout = point_layout(width, axes)
    assert layout == data.StructLayout({a: signed(width + 1) for a in "xyzabc"[:axes]})
    assert list(layout.members) == list("xyzabc"[:axes])
    assert layout.size == axes * (width + 1)


@pytest.mark.parametrize("axes", range(2, 7))
def test_step_layout(axes):
    layout = step_layout(axes)
    assert layout == data.StructLayout({a: signed(2) for a in "xyzabc"[:axes]} | {"last": 1})
    assert list(layout.members) == [*"xyzabc"[:axes], "last"]
    assert layout["last"].offset == 2 * axes


def all_names(axes):
    return {
        a: (names.increment, names.position, names.remaining, names.summator)
        for a, names in register_names(axes).items()
    }


def test_register_names_of_two_axes():
    assert all_names(2) == {"x": ("p1", "p3", "p5", "sx"), "y": ("p2", "p4", "p6", "sy")}


@pytest.mark.parametrize("axes", [3, 4, 5, 6])
def test_register_names_of_more_axes(axes):
    expected = {
        "x": ("dx", "xt", "kox", "sx"),
        "y": ("dy", "yt", "koy", "sy"),
        "z": ("dz", "zt", "koz", "sz"),
        "a": ("da", "at", "koa", "sa"),
        "b": ("db", "bt", "kob", "sb"),
        "c": ("dc", "ct", "koc", "sc"),
    }
    assert list(all_names(axes).items()) == list(expected.items())[:axes]
