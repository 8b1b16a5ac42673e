"""Lines worked out from the documents' formulas alone, for comparison."""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from math import sqrt


def line_steps(
    start: Sequence[int], end: Sequence[int], *, width: int, normalize: bool, preload: str
) -> Iterator[tuple[int, tuple[int, ...]]]:
    """Yield (summations, point) of every step: X(t) = XH ± ⌊(S₀ + t·ΔX·2^s) / 2^n⌋."""
    lengths = [abs(b - a) for a, b in zip(start, end, strict=True)]
    initial = {"zero": 0, "half": 2 ** (width - 1)}[preload]
    scale = 1
    while normalize and any(lengths) and max(lengths) * scale < 2 ** (width - 1):
        scale *= 2
    point, t = tuple(start), 0
    while point != tuple(end):
        t += 1
        assert t <= 2**width
        moved = [(initial + t * length * scale) // 2**width for length in lengths]
        before, point = (
            point,
            tuple(a + m if b > a else a - m for a, b, m in zip(start, end, moved, strict=True)),
        )
        if point != before:
            yield t, point


def path_steps(
    points: Sequence[Sequence[int]], *, width: int, normalize: bool = True, preload: str = "half"
) -> Iterator[tuple[int, tuple[int, ...]]]:
    """Yield (clock, point) of every step of a path on which no clock is lost between blocks.

    The first summation is in clock 2, a step leaves a clock after its summation, and the next
    block's first summation is in the clock after the last step. A block of no length takes a clock,
    and one more behind a block that moved.
    """
    first, behind_a_move = 2, False
    for start, end in pairwise(points):
        steps = list(line_steps(start, end, width=width, normalize=normalize, preload=preload))
        for t, point in steps:
            yield first + t, point
        first += steps[-1][0] + 1 if steps else 1 + behind_a_move
        behind_a_move = bool(steps)


def distance(point: Sequence[int], start: Sequence[int], end: Sequence[int]) -> float:
    """Give the distance of a point from the line through ``start`` and ``end``, in steps."""
    p = [b - a for a, b in zip(start, point, strict=True)]
    d = [b - a for a, b in zip(start, end, strict=True)]
    along = sum(a * b for a, b in zip(p, d, strict=True))
    return sqrt(Fraction(sum(a * a for a in p)) - Fraction(along**2, sum(a * a for a in d)))


def article(block: Sequence[int], *, x_leads: bool) -> Iterator[tuple[int, int, int, int, int]]:
    """Run the article's routine; yield x, y, Sx, Sy, Sx − Sy at the start and after every step.

    ``x_leads``: x goes first, as the longer axis, or at 45° by choice.
    """
    x, y, end_x, end_y = block
    dx, dy = abs(end_x - x), abs(end_y - y)
    sx = sy = 0
    yield x, y, sx, sy, sx - sy
    while (x, y) != (end_x, end_y):
        if sx < sy or (sx == sy and x_leads):
            x += 1 if end_x > x else -1
            sx += dy
        else:
            y += 1 if end_y > y else -1
            sy += dx
        yield x, y, sx, sy, sx - sy
