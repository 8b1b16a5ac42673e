"""What docs/constant_speed.md says of two timers."""

from math import pi

import pytest

from docs import octants


def test_circles_are_closed_and_near():
    points = octants.circle(100)
    assert points[0] == points[-1] == (100, 0)
    assert all(abs((x * x + y * y) ** 0.5 - 100) < 0.5 for x, y in points)


@pytest.mark.parametrize("radius", octants.RADII)
def test_area_keeps_within_two_steps_and_the_leading_component_does_not_always(radius):
    points = octants.circle(radius)
    by_area = octants.by_area(points, radius)
    assert abs(by_area[-1] - 2 * pi * radius) < 2
    assert octants.off_by(points, radius, by_area) < 1.1
    off = octants.off_by(points, radius, octants.by_component(points, radius))
    assert (off > 2) == (radius < 4000)
