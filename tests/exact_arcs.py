"""What the exact interpolator of arcs does, worked out from the circle alone, for comparison."""

from collections.abc import Sequence

from tests.arcs import crossed, quadrant_after, quadrant_before, seen, turn

Point = tuple[int, int]


def exact_steps(block: Sequence[int]) -> list[tuple[int, Point]]:
    """Give (clock, point) of every step of an arc that no step has to wait for.

    Clock 0 is the one in which the first step is decided, at the earliest. Of the two points that
    can come next the one is taken whose square of the radius is nearer to that of the start; an
    octant is left with the step after which the faster axis may be another one.
    """
    start, end = seen(block)
    quadrant = quadrant_after(start)
    x, y = turn(start, -quadrant)
    xk, yk = turn(end, -quadrant_before(end))
    square = x * x + y * y
    crossings = len(crossed(start, end)) + 4 * block[7]
    x_leads = y >= x or square == 1
    side = -1 if block[6] else 1
    clock, steps = 0, []

    def place() -> Point:
        u, v = turn((x, y), quadrant)
        return block[4] + u, block[5] + side * v

    while True:
        if crossings == 0 and abs(x - xk) <= 1 and abs(y - yk) <= 1:
            return [*steps, (clock, (block[2], block[3]))]
        assert x > 0 or crossings
        candidates = [(x - 1, y), (x - 1, y + 1)] if x_leads else [(x, y + 1), (x - 1, y + 1)]
        changes = not x_leads and y >= x - 2
        x, y = min(candidates, key=lambda point: abs(point[0] ** 2 + point[1] ** 2 - square))
        crosses = x == 0 and crossings > 0
        clock += changes or (crosses and square > 1)
        steps.append((clock, place()))
        clock += 1
        x_leads |= changes
        if crosses:
            x, y, quadrant, crossings = y, 0, quadrant + 1, crossings - 1
            x_leads = square == 1
