"""How far two timers of an arc are off: by the leading component, and by area.

``python docs/octants.py`` prints the table of docs/constant_speed.md: the steps are the nearest
points of whole circles, and nothing of the device is used.
"""

from itertools import pairwise
from math import atan2, pi

from rich.console import Console

RADII = (100, 1000, 4000)
Point = tuple[int, int]


def circle(radius: int) -> list[Point]:
    """Give the nearest points of a circle, counter-clockwise once round."""
    x, y = radius, 0
    points = [(x, y)]
    while len(points) == 1 or (x, y) != points[0]:
        dx = -1 if y > 0 or (y == 0 and x > 0) else 1
        dy = 1 if x > 0 or (x == 0 and y < 0) else -1
        axial = (x, y + dy) if abs(x) >= abs(y) else (x + dx, y)
        x, y = min(axial, (x + dx, y + dy), key=lambda p: abs(p[0] ** 2 + p[1] ** 2 - radius**2))
        points.append((x, y))
    return points


def off_by(points: list[Point], radius: int, ticks: list[int]) -> float:
    """Give the most by which the distance after so many ticks is not that number."""
    worst = 0.0
    for number, tick in enumerate(ticks, start=1):
        x, y = points[number]
        turn = atan2(y, x) % (2 * pi) if number < len(ticks) else 2 * pi
        worst = max(worst, abs(turn * radius - tick))
    return worst


def by_component(points: list[Point], radius: int) -> list[int]:
    """Give the ticks of all steps, by a timer that adds the leading component modulo R."""
    timer, tick, ticks = radius / 2, 0, []
    for point in points[:-1]:
        while True:
            tick += 1
            timer += max(map(abs, point))
            if timer >= radius:
                timer -= radius
                break
        ticks.append(tick)
    return ticks


def by_area(points: list[Point], radius: int) -> list[int]:
    """Give the ticks of all steps, by a debt that grows by the area of a step."""
    debt, tick, ticks = -radius / 2, 0, []
    for (x, y), (to_x, to_y) in pairwise(points):
        while debt >= 0:
            tick += 1
            debt -= radius
        tick += 1
        debt += x * (to_y - y) - y * (to_x - x) - radius
        ticks.append(tick)
    return ticks


if __name__ == "__main__":
    out = Console(highlight=False)
    for radius in RADII:
        points = circle(radius)
        timers = (by_component, by_area)
        found = [off_by(points, radius, timer(points, radius)) for timer in timers]
        out.print(f"R = {radius}: leading component {found[0]:.2f}, area {found[1]:.2f}")
