from math import cos, hypot, radians, sin

import numpy as np
import pytest

from discreta.sim.conics import ellipse, from_coefficients, parabola
from discreta.sim.contour import ArcContour, ConicContour, LineContour
from discreta.sim.curves import Arc, Conic, Polyline
from discreta.sim.pace import Pace
from discreta.sim.points import BadInputError

# start, end, center, clockwise, turns; degrees from the start that are on it
ARCS = {
    "a quarter": ((100, 0), (0, 100), (0, 0), False, 1, 90),
    "three quarters": ((100, 0), (0, 100), (0, 0), True, 1, 270),
    "half, elsewhere": ((-7, 53), (-7, -47), (-7, 3), True, 1, 180),
    "a full turn": ((60, 80), (60, 80), (0, 0), False, 1, 360),
    "three turns": ((63, 84), (63, 84), (3, 4), True, 3, 360),
    "nearly full": ((300, -40), (300, -45), (0, 0), False, 1, 359.0639),
    "large": ((2**32 - 1, 0), (0, 2**32 - 1), (0, 0), False, 1, 90),
}


def at(start, center, clockwise, angle):
    """Turn the start around the center."""
    x, y = start[0] - center[0], start[1] - center[1]
    c, s = cos(radians(angle)), sin(radians(angle)) * (-1 if clockwise else 1)
    return center[0] + c * x - s * y, center[1] + s * x + c * y


@pytest.mark.parametrize("case", ARCS.values(), ids=ARCS)
def test_the_outline_of_an_arc(case):
    """On the circle, from the start to the end's angle, without a gap, in its direction."""
    start, end, center, clockwise, turns, angle = case
    outline = Arc(start, end, center, clockwise=clockwise, turns=turns).outline()
    assert len(outline) <= 4097
    radius = hypot(start[0] - center[0], start[1] - center[1])
    assert np.hypot(*(outline - center).T) == pytest.approx(radius, rel=1e-12)
    for part in (0, 0.25, 0.5, 1):
        place = round(part * (len(outline) - 1))
        expected = at(start, center, clockwise, angle * place / (len(outline) - 1))
        assert outline[place] == pytest.approx(expected, abs=radius * 1e-6)
    # No corner that the eye sees: the chord is within a ten-thousandth of a turn of the arc.
    assert np.hypot(*np.diff(outline, axis=0).T).max() < radius * 0.0016


@pytest.mark.parametrize("case", ARCS.values(), ids=ARCS)
def test_an_arc_near_a_point_of_it(case):
    """All that is within reach, and smooth however large the circle is."""
    start, end, center, clockwise, turns, angle = case
    arc = Arc(start, end, center, clockwise=clockwise, turns=turns)
    radius = hypot(start[0] - center[0], start[1] - center[1])
    for part in (0, 0.3, 1):
        point = np.array(at(start, center, clockwise, angle * part))
        near = arc.near(point, 14)
        drawn = near[~np.isnan(near[:, 0])]
        assert np.hypot(*(drawn - center).T) == pytest.approx(radius, abs=1e-4)
        for off in np.linspace(-20, 20, 41):
            there = angle * part + np.degrees(off / radius)
            wanted = np.array(at(start, center, clockwise, there))
            if not (0 <= there <= angle or angle == 360):
                continue
            if np.hypot(*(wanted - point)) <= 14:
                assert np.hypot(*(drawn - wanted).T).min() < 0.1
        gaps = np.hypot(*np.diff(near, axis=0).T)
        assert np.nanmax(gaps) < 0.1


def test_a_gap_stays_a_gap():
    """An arc of 359 degrees near its ends: two pieces, and nothing between."""
    arc = Arc((300, -40), (300, -45), (0, 0), clockwise=False)
    near = arc.near(np.array([300, -42]), 14)
    (gap,) = np.flatnonzero(np.isnan(near[:, 0]))
    ends = sorted([near[0], near[gap - 1], near[gap + 1], near[-1]], key=lambda point: point[1])
    # The end is a little off the circle: the arc ends at its angle.
    assert ends[1] == pytest.approx(np.array([300, -45]) * hypot(300, 40) / hypot(300, 45))
    assert ends[2] == pytest.approx([300, -40])
    assert not np.any((near[:, 1] > -44.89) & (near[:, 1] < -40.01))


def test_far_from_an_arc_there_is_nothing():
    arc = Arc((100, 0), (0, 100), (0, 0), clockwise=False)
    assert arc.near(np.array([-71, -71]), 14).shape == (0, 2)


def test_an_arc_as_a_block():
    arc = Arc((1, 2), (3, 4), (5, 6), clockwise=True, turns=7)
    assert arc.blocks.tolist() == [[1, 2, 3, 4, 5, 6, 1, 6]]
    assert arc.blocks.dtype == np.int64
    assert arc.start.tolist() == [1, 2]
    assert (arc.kind, arc.axes) == ("arc", 2)
    assert isinstance(arc.contour(), ArcContour)


def test_facts_of_arcs():
    for case in ARCS.values():
        start, end, center, clockwise, turns, angle = case
        arc = Arc(start, end, center, clockwise=clockwise, turns=turns)
        facts = arc.facts(arc.contour(), Pace())
        turn = angle + 360 * (turns - 1)
        assert facts == {
            "radius": round(hypot(start[0] - center[0], start[1] - center[1]), 4),
            "turn": pytest.approx(-turn if clockwise else turn, abs=1e-4),
        }


def test_arcs_are_checked_before_anything_else():
    """Also numbers that no array holds."""
    arc = Arc((10**30, 0), (0, 10**30), (0, 0), clockwise=False)
    with pytest.raises(BadInputError, match=r"^coordinate 10+ is out of range"):
        arc.check(32)
    arc = Arc((10, 0), (0, 10), (0, 0), clockwise=False, turns=300)
    with pytest.raises(BadInputError, match=r"^number of turns is 300"):
        arc.check(32)


def test_a_polyline_as_blocks():
    line = Polyline([(0, 0, 1), (5, 3, 1), (0, 0, 1)])
    assert line.blocks.tolist() == [[0, 0, 1, 5, 3, 1], [5, 3, 1, 0, 0, 1]]
    assert (line.kind, line.axes, line.start.tolist()) == ("line", 3, [0, 0, 1])
    assert isinstance(line.contour(), LineContour)
    assert line.outline().tolist() == line.near(line.start, 14).tolist() == line.points.tolist()
    facts = line.facts(line.contour(), Pace())
    assert facts == {
        "segments": 2,
        "support points hit": 0,
        "path closed": True,
        "clocks lost between blocks": 0,
    }
    with pytest.raises(BadInputError, match=r"^the line from 15,0 to -1,0 is 16 steps long"):
        Polyline([(-1, 0), (0, 0), (15, 0), (-1, 0)]).check(4)


def test_a_conic_as_a_block():
    """The upper half of y² = 200x from its vertex, by hand."""
    conic = Conic(parabola((0, 0), (0, 200), (800, 400), 16))
    assert conic.blocks.tolist() == [[0, 0, 1, -200, 0, 0, 0, 800, 400, 1, 0]]
    assert conic.blocks.dtype == np.int64
    assert conic.start.tolist() == [0, 0]
    assert (conic.kind, conic.axes) == ("conic", 2)
    assert isinstance(conic.contour(), ConicContour)
    facts = {"curve": "parabola", "curve moved": 0.0, "changes of direction": 0}
    assert conic.facts(conic.contour(), Pace()) == facts
    outline = conic.outline()
    assert outline[[0, -1]] == pytest.approx(np.array([[0, 0], [800, 400]]))
    assert outline[:, 1] ** 2 == pytest.approx(200 * outline[:, 0], abs=1e-6)
    assert np.all(np.diff(outline, axis=0) > 0)


@pytest.mark.parametrize(
    ("width", "message"),
    [
        (15, None),
        (12, "coordinate 5000 is out of range: width 12 has room for -4096 to 4095; give .* 13$"),
        (3, "^width is 3: choose a whole number from 4 to 24$"),
        (25, "^width is 25: choose a whole number from 4 to 24$"),
    ],
)
def test_a_conic_is_for_devices_as_wide_as_its_numbers(width, message):
    conic = Conic(from_coefficients([3, 0, 3, 0, 0], (5000, 0), (0, 5000), False, 16))
    if message is None:
        conic.check(width)
        return
    with pytest.raises(BadInputError, match=message):
        conic.check(width)


def test_coefficients_that_a_device_has_no_bits_for():
    conic = Conic(from_coefficients([4095, 0, 4095, 0, 0], (90, 0), (90, 0), False, 16))
    conic.check(9)
    room = "width 8 has room for 2047 and 1048575; give --width 9"
    with pytest.raises(BadInputError, match=f"^the coefficients 4095,0,4095,0,0 are .*: {room}$"):
        conic.check(8)


def test_a_conic_near_a_point_of_it():
    """A hyperbola whose outline is not fine enough: xy = 10^10, in a window."""
    conic = Conic(from_coefficients([0, 1, 0, 0, 0], (10**6, 10**4), (10**4, 10**6), True, 20))
    assert np.hypot(*np.diff(conic.outline(), axis=0).T).max() > 100
    for x in (10**6, 123_456.5, 10**5, 10**4):
        point = np.array([x, 1e10 / x])
        near = conic.near(point, 14)
        assert near[:, 0] * near[:, 1] == pytest.approx(1e10, rel=1e-12)
        assert np.hypot(*np.diff(near, axis=0).T).max() <= 0.1
        ends = np.hypot(*(near[[0, -1]] - point).T)
        # Out of reach on both sides, or at an end of the curve.
        assert ends == pytest.approx([0 if x == 10**6 else 14, 0 if x == 10**4 else 14], abs=0.2)


def test_both_sides_of_a_flat_ellipse_are_near():
    """A semi-axis of 7 steps: what comes back on the other side is another piece."""
    conic = Conic(ellipse((0, 0), (20, 7), 0, 8, start_angle=90, end_angle=90))
    near = conic.near(np.array([0, 7]), 16)
    gaps = np.flatnonzero(np.isnan(near[:, 0]))
    pieces = np.split(near, gaps)
    pieces = [pieces[0], *(piece[1:] for piece in pieces[1:])]
    # It begins and ends there, and passes below.
    assert len(pieces) == 3
    for piece, side in zip(pieces, (1, -1, 1), strict=True):
        assert (piece[:, 0] / 20) ** 2 + (piece[:, 1] / 7) ** 2 == pytest.approx(1)
        assert np.all(piece[:, 1] * side > 3)
    assert pieces[1][0, 0] < -4 < 4 < pieces[1][-1, 0]
    assert pieces[0][0] == pytest.approx([0, 7])
    assert pieces[2][-1] == pytest.approx([0, 7])
    assert conic.near(np.array([0, 40]), 11).shape == (0, 2)
