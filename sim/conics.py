"""Blocks for the interpolator of second-order curves, from the curves as users know them.

A block is the row a, b, c, d, e, start_x, start_y, end_x, end_y, clockwise, turns. Its curve is
``a·x² + b·x·y + c·y² + d·x + e·y + f = 0`` with f from the start, and all is worked out around the
start: with u = x − start_x, v = y − start_y and the derivatives Gx, Gy at the start::

    f(u, v) = a·u² + b·u·v + c·v² + Gx·u + Gy·v
    Q = a·Gy² − b·Gx·Gy + c·Gx²

Q is the same at every point of the curve, and the curvature is 2Q / |G|³: a curve with Q > 0 bends
to the left of (−Gy, Gx), and it is sharpest where the gradient G is smallest. The motion
x' = −Gy, y' = Gx is linear and has one solution for all kinds: with ω² = 4ac − b²::

    (u, v) = v0·sin(ωt)/ω + a0·(1 − cos(ωt))/ω²        (sinh, cosh when 4ac < b²)

v0 and a0 being velocity and acceleration at the start; ωt is the angle that an ellipse is usually
described by. Clockwise motion is the counter-clockwise one in a mirror.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from discreta.hdl.conic import MAX_WIDTH, TURNS_BITS, coefficient_bits, linear_bits
from discreta.hdl.contract import check_width
from discreta.sim.points import BadInputError, check_coordinates, give_width, say_point

__all__ = [
    "KINDS",
    "ConicBlock",
    "Motion",
    "check_block",
    "curve_near",
    "curve_points",
    "distance",
    "ellipse",
    "from_coefficients",
    "motion",
    "parabola",
    "random_blocks",
]

Number = int | float | Fraction

KINDS = ("line", "circle", "ellipse", "parabola", "hyperbola")

#: In steps: the smallest radius of curvature, how far an end may be off the curve, and no distance.
_SHARPEST, _OFF, _NOTHING = 2.0, 1.0, 1e-6

#: Steps of Newton's method from the first guess before a nearest point is searched.
_NEWTON = 3

#: Points at which an arc is looked at, and scales that are tried, when coefficients are rounded.
_SAMPLES, _SCALES = 4096, 1 << 14


@dataclass(frozen=True)
class ConicBlock:
    """A block of the conic interpolator, and how true it is.

    Attributes
    ----------
    block : tuple of int
        a, b, c, d, e, start_x, start_y, end_x, end_y, clockwise, turns.
    kind : str
        What was asked for, one of :data:`KINDS`.
    moved : float
        How far rounding moved the curve from the one asked for, in steps: the largest distance of
        4096 points of the arc that was asked for from the block's curve. 0 when the block's curve
        is the very one.
    """

    block: tuple[int, ...]
    kind: str
    moved: float


# Distances


def _foot(
    value: np.ndarray, gx: np.ndarray, gy: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Give the way (x, y) from points to the nearest points of their curves.

    A nearest point is w = −m·(1 + m·H)⁻¹·G away, with H the second derivatives and m a number for
    which the curve is met. The one that keeps 1 + m·H positive belongs to the nearest of all. It is
    f/|G|² for a straight line, and near a curve Newton's method needs a step or two from there;
    where it does not lead to an m that is well within its limits, they are searched.

    Parameters
    ----------
    value, gx, gy : arrays of float
        f and its derivatives at the points.
    a, b, c : arrays of float
        Broadcast against them.
    """
    shape = np.broadcast_shapes(np.shape(value), np.shape(a))
    rows = tuple(np.broadcast_to(row, shape).ravel() for row in (value, gx, gy, a, b, c))
    found = np.empty((2, len(rows[0])))
    rest = np.arange(len(rows[0]))
    with np.errstate(all="ignore"):
        f, gx, gy, a, b, c = rows
        steep = gx * gx + gy * gy
        m = f / steep
        m *= 1 + 3 * m * (a * gx * gx + b * gx * gy + c * gy * gy) / steep
        for _ in range(_NEWTON):
            f, gx, gy, a, b, c = rows
            # 1 + m·H, and k = (1 + m·H)⁻¹·G: the gradient at the foot.
            t1, t2, cross = 1 + 2 * a * m, 1 + 2 * c * m, b * m
            whole = t1 * t2 - cross * cross
            kx, ky = (t2 * gx - cross * gy) / whole, (t1 * gy - cross * gx) / whole
            # By how much the foot moves with m.
            px, py = (t2 * kx - cross * ky) / whole, (t1 * ky - cross * kx) / whole
            left = f - m / 2 * (kx * (gx + kx) + ky * (gy + ky))
            more = left / (kx * px + ky * py)
            found[:, rest] = -m * kx - more * px, -m * ky - more * py
            # What is still wrong is about the square of this last part over the radius.
            part = more * more * (px * px + py * py) * (np.abs(a) + np.abs(b) + np.abs(c))
            trace = t1 + t2
            close = part * part < 1e-22 * (kx * kx + ky * ky)
            coarse = ~(close & (trace > 0) & (whole > 0.1 * trace))
            rest = rest[coarse]
            if not len(rest):
                break
            m = (m + more)[coarse]
            rows = tuple(row[coarse] for row in rows)
    if len(rest):
        found[:, rest] = _searched(*rows)
    wx, wy = found.reshape(2, *shape)
    return wx, wy


def _searched(
    value: np.ndarray, gx: np.ndarray, gy: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Give what :func:`_foot` gives, for any points, shape (points,).

    Between the limits of m the curve's value falls: one root, found by Newton's method in a
    bracket.
    """
    turned = 0.5 * np.arctan2(b, a - c)
    cos, sin = np.cos(turned), np.sin(turned)
    spread = np.hypot(a - c, b)

    def along(second: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # From a point on an axis of the curve two points can be equally near, and m is at its
        # limit: a hundred millionth of a step aside it is not.
        least = 1e-8 * np.abs(second)
        return second, np.where(np.abs(first) < least, np.copysign(least, first), first)

    h1, g1 = along(a + c + spread, cos * gx + sin * gy)
    h2, g2 = along(a + c - spread, cos * gy - sin * gx)
    f = value
    with np.errstate(divide="ignore", invalid="ignore"):
        low = np.where(h1 > 0, -1 / h1, -np.inf)
        high = np.where(h2 < 0, -1 / h2, np.inf)
        m = np.clip(np.nan_to_num(f / (g1 * g1 + g2 * g2)), 0.875 * low, 0.875 * high)

    found = np.zeros((2, len(f)))
    rest = np.arange(len(f))
    for _ in range(100):
        t1, t2 = 1 + m * h1, 1 + m * h2
        k1, k2 = g1 / t1, g2 / t2
        left = f - m * ((1 + t1) * k1 * k1 + (1 + t2) * k2 * k2) / 2
        slope = k1 * k1 / t1 + k2 * k2 / t2
        low, high = np.where(left > 0, m, low), np.where(left < 0, m, high)
        better = m + left / np.where(slope > 0, slope, np.inf)
        wild = ~((low <= better) & (better <= high))
        better[wild] = (low[wild] + high[wild]) / 2
        size, change = np.hypot(k1, k2), np.fmax(np.abs(k1) / t1, np.abs(k2) / t2)
        coarse = np.abs(better - m) * change > 1e-10 + 1e-13 * np.abs(m) * size
        m = better
        found[:, rest] = -m * g1 / (1 + m * h1), -m * g2 / (1 + m * h2)
        if not np.any(coarse):
            break
        rest = rest[coarse]
        rows = (f, h1, h2, g1, g2, low, high, m)
        f, h1, h2, g1, g2, low, high, m = (row[coarse] for row in rows)
    w1, w2 = found
    return cos * w1 - sin * w2, sin * w1 + cos * w2


def _to_curve(
    coefficients: np.ndarray, starts: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Give the ways (x, y) from points to their curves; parameters as for :func:`distance`."""
    whole = np.rint(points).astype(np.int64)
    a, b, c, d, e = np.moveaxis(coefficients, -1, 0)
    x0, y0 = np.moveaxis(starts, -1, 0)
    x, y = np.moveaxis(whole, -1, 0)
    u, v = x - x0, y - y0
    hx, hy = 2 * a * u + b * v, b * u + 2 * c * v
    gx, gy = 2 * a * x0 + b * y0 + d, b * x0 + 2 * c * y0 + e
    # 2f: what 64 bits lose of the products is nothing in the sum, unless that is too large itself.
    sides = hx + 2 * gx, hy + 2 * gy
    with np.errstate(over="ignore"):
        exact = np.asarray(u * sides[0] + v * sides[1], dtype=float)
    a, b, c, u, v, gx, gy, *sides = (
        np.asarray(row, dtype=float) for row in (a, b, c, u, v, gx + hx, gy + hy, *sides)
    )
    rough = u * sides[0] + v * sides[1]
    value = np.where(np.abs(rough) < 2**62, exact, rough) / 2
    if not np.issubdtype(points.dtype, np.integer):
        # f is exact on the grid, and the way from there is short.
        px, py = np.moveaxis(np.asarray(points - whole, dtype=float), -1, 0)
        value = value + px * (gx + a * px + b * py) + py * (gy + c * py)
        gx, gy = gx + 2 * a * px + b * py, gy + b * px + 2 * c * py
    return _foot(value, gx, gy, a, b, c)


def distance(coefficients: np.ndarray, starts: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Give the distance of points from curves, in steps.

    It is the distance from the whole curve, beyond its ends and on both branches of a hyperbola; it
    is right to 1e-6 for points that are nearer to the curve than its centre of curvature.

    Parameters
    ----------
    coefficients : array of int64, shape (..., 5)
        a, b, c, d, e of a curve, of the bits that a block has for them.
    starts : array of int64, shape (..., 2)
        A point of each curve.
    points : array of int64 or float, shape (..., 2)
        In steps. All three are broadcast against each other.
    """
    return np.hypot(*_to_curve(coefficients, starts, points))


# Courses: how a curve runs from its start to its end


@dataclass(frozen=True)
class _Course:
    """How curves run from their starts to the points nearest to their ends; arrays, one a curve.

    Attributes
    ----------
    bend, curl : arrays of int objects
        Q and 4ac − b².
    straight : array of bool
        a = b = c = 0.
    size, second : arrays of int objects
        |Gx| + |Gy| at the start, and |a| + |b| + |c|.
    foot : array of float, shape (2, curves)
        Where the curve is nearest to the end, from the start.
    gradient : array of float, shape (2, curves)
        Gx, Gy there.
    off : array of float
        How far that is from the end, in steps.
    other : array of bool
        It is on the other branch of the hyperbola.
    time, period : arrays of float
        Of the motion to there, not a number when it is not ahead, and of a whole turn.
    turns : array of int
    radius, room : arrays of float
        On the way: the smallest radius of curvature, and the smallest ratio of |G| to the largest
        second derivative (nearer than that no point has a zero gradient), in steps.
    least, most : arrays of float, shape (2, curves)
        The extremes of x and y on the way, from the start; not a number without one.
    """

    bend: np.ndarray
    curl: np.ndarray
    straight: np.ndarray
    size: np.ndarray
    second: np.ndarray
    foot: np.ndarray
    gradient: np.ndarray
    off: np.ndarray
    other: np.ndarray
    time: np.ndarray
    period: np.ndarray
    turns: np.ndarray
    radius: np.ndarray
    room: np.ndarray
    least: np.ndarray
    most: np.ndarray


def _course(
    local: Sequence[np.ndarray] | np.ndarray,
    end: Sequence[np.ndarray] | np.ndarray,
    clockwise: np.ndarray,
) -> _Course:
    """Work out how curves run.

    Parameters
    ----------
    local : five arrays of int objects
        a, b, c, and Gx, Gy at the start.
    end : two arrays of int objects
        From the start.
    clockwise : array of bool
    """
    mirror = np.where(clockwise, -1, 1).astype(object)
    a, b, c, gx, gy = local[0], local[1] * mirror, local[2], local[3], local[4] * mirror
    ux, uy = end[0], end[1] * mirror
    curl = 4 * a * c - b * b
    bend = a * gy * gy - b * gx * gy + c * gx * gx
    value = ux * (a * ux + b * uy + gx) + uy * (c * uy + gy)
    hx, hy = 2 * a * ux + b * uy, b * ux + 2 * c * uy
    ex, ey = gx + hx, gy + hy
    exact = np.asarray(value == 0, dtype=bool)
    same = np.asarray((ux == 0) & (uy == 0), dtype=bool)
    straight = np.asarray((a == 0) & (b == 0) & (c == 0), dtype=bool)
    closed = np.asarray(curl > 0, dtype=bool)
    parabolic = np.asarray(curl == 0, dtype=bool)
    begins = _quadrant(gx, gy, after=True)
    seen = _quadrant(ex, ey, after=False)
    whole_numbers = {
        "bend": bend,
        "curl": curl,
        "size": abs(gx) + abs(gy),
        "second": abs(a) + abs(b) + abs(c),
    }

    rows = (a, b, c, gx, gy, ux, uy, curl, bend, value, hx, hy, ex, ey)
    rows = (*rows, gx * hy - gy * hx, ux * hx + uy * hy)
    a, b, c, gx, gy, ux, uy, curl, bend, value, hx, hy, ex, ey, across, square = (
        np.asarray(row, dtype=float) for row in rows
    )
    wx, wy = (np.where(exact, 0, way) for way in _foot(value, ex, ey, a, b, c))
    kx, ky = 2 * a * wx + b * wy, b * wx + 2 * c * wy
    fx, fy, ex, ey = ux + wx, uy + wy, ex + kx, ey + ky
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = (across + gx * ky - gy * kx) / (2 * bend)  # sin(ωt)/ω
        verse = (square + 2 * (hx * wx + hy * wy) + wx * kx + wy * ky) / (4 * bend)  # (1 − cos)/ω²
        omega = np.sqrt(np.abs(curl))
        period = np.where(closed, 2 * np.pi / omega, np.inf)
        other = ~straight & ~closed & (verse < 0)
        away = np.hypot(fx, fy) > _NOTHING
        # 1 − cos is no less than sin²/2, however short the way is.
        part = 2 / omega * np.arctan2(omega * np.fmax(verse, sine * sine / 2), sine)
        time = np.select(
            [straight, closed, parabolic],
            [
                (gx * fy - gy * fx) / (gx * gx + gy * gy),
                np.where(away, part, period),
                sine,
            ],
            np.arcsinh(omega * sine) / omega,
        )
    ahead = closed | (away & (time > 0) & ~other)
    time = np.where(same & ~closed, 0, np.where(ahead, time, np.nan))

    # The axes that the gradient crosses on its way. What the foot has off the curve is known to
    # 1e-10 of a step, and an axis must not be missed by that.
    near = np.where(exact, 0, 1e-9 * np.hypot(ex, ey))
    stops = _quadrant(
        np.where(np.abs(ex) <= near, 0, ex), np.where(np.abs(ey) <= near, 0, ey), after=False
    )
    crossed = (stops - begins) % 4
    crossed = np.where((crossed == 0) & (time > period / 2), 4, crossed)
    crossed = np.where(straight | (same & ~closed), 0, crossed)
    # The end itself may see the axis still before it: then the device would have to pass it.
    early = ~same & (crossed > 0) & ((stops - seen) % 4 == 1)

    least = most = np.full((2, len(fx)), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        for index in range(1, 5):
            passed = crossed >= index
            place = _extreme((a, b, c, gx, gy), curl, bend, (begins + index) % 4)
            least = np.where(passed, np.fmin(least, place), least)
            most = np.where(passed, np.fmax(most, place), most)
        # The gradient is smallest along the direction of the smaller second derivative.
        spread = np.hypot(a - c, b)
        first = np.arctan2(gy, gx)
        swept = np.where(time == period, 2 * np.pi, (np.arctan2(ey, ex) - first) % (2 * np.pi))
        swept = np.where(time > 0, swept, 0)
        smallest = np.fmin(np.hypot(gx, gy), np.hypot(ex, ey))
        for turned in (0.5, 1.5):
            way = (0.5 * np.arctan2(b, a - c) + turned * np.pi - first) % (2 * np.pi)
            smallest = np.where(
                way < swept,
                np.fmin(smallest, np.sqrt(2 * bend / (a + c + spread))),
                smallest,
            )
        radius = np.where(straight, np.inf, smallest**3 / (2 * bend))
        room = np.where(straight, np.inf, smallest / (np.abs(a + c) + spread))
    sign = np.where(clockwise, -1, 1)
    return _Course(
        **whole_numbers,
        straight=straight,
        foot=np.stack([fx, sign * fy]),
        gradient=np.stack([ex, sign * ey]),
        off=np.hypot(wx, wy),
        other=other,
        time=time,
        period=period,
        turns=crossed - early,
        radius=radius,
        room=room,
        least=np.stack([least[0], np.where(clockwise, -most[1], least[1])]),
        most=np.stack([most[0], np.where(clockwise, -least[1], most[1])]),
    )


def _extreme(
    local: tuple[np.ndarray, ...], curl: np.ndarray, bend: np.ndarray, axis: np.ndarray
) -> np.ndarray:
    """Give where curves are when their gradient comes to an axis, from the start, shape (2, …).

    Parameters
    ----------
    local : five arrays of float
        a, b, c, and Gx, Gy at the start, run counter-clockwise.
    curl, bend : arrays of float
        4ac − b² and Q.
    axis : array of int
        0 to 3: +x, +y, −x, −y. There is such a place, or what is given is no number.
    """
    nx, ny = (axis == 0) * 1.0 - (axis == 2), (axis == 1) * 1.0 - (axis == 3)
    return _place(local, curl, bend, nx, ny)[0]


def _place(
    local: tuple[np.ndarray, ...],
    curl: np.ndarray,
    bend: np.ndarray,
    nx: np.ndarray,
    ny: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Give where curves are when their gradient has a direction; and sin(ωt)/ω and cos(ωt) there.

    Parameters
    ----------
    local, curl, bend
        As for :func:`_extreme`.
    nx, ny : arrays of float
        The direction, of any length.
    """
    a, b, c, gx, gy = local
    with np.errstate(divide="ignore", invalid="ignore"):
        # Q is the same everywhere: the gradient has only one size for a direction.
        length = np.sqrt(bend / (a * ny * ny - b * nx * ny + c * nx * nx))
        nx, ny = nx * length, ny * length
        s = (gx * ny - gy * nx) / (2 * bend)
        cos = (2 * c * gx * nx - b * (gx * ny + gy * nx) + 2 * a * gy * ny) / (2 * bend)
        k = np.where(cos > -0.5, s * s / (1 + cos), (1 - cos) / curl)
        place = np.stack([k * (b * gy - 2 * c * gx) - s * gy, k * (b * gx - 2 * a * gy) + s * gx])
    return place, s, cos


def _quadrant(gx: np.ndarray, gy: np.ndarray, *, after: bool) -> np.ndarray:
    """Give the quadrants of directions; an axis belongs to the one after it, or before it."""
    if after:
        quadrants = [(gx > 0) & (gy >= 0), (gx <= 0) & (gy > 0), (gx < 0) & (gy <= 0)]
    else:
        quadrants = [(gx >= 0) & (gy > 0), (gx < 0) & (gy >= 0), (gx <= 0) & (gy < 0)]
    return np.select([np.asarray(row, dtype=bool) for row in quadrants], [0, 1, 2], 3)


def _flow(local: Sequence | np.ndarray, clockwise, time) -> np.ndarray:
    """Give where the motion from (0, 0) has come to, shape (2, …); floats, broadcast."""
    a, b, c, gx, gy = local
    way = np.where(clockwise, -1.0, 1.0)
    curl = 4 * a * c - b * b
    omega = np.sqrt(np.abs(curl))
    angle = omega * time
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        s = np.where(curl > 0, np.sin(angle), np.sinh(angle)) / omega
        half = np.where(curl > 0, np.sin(angle / 2), np.sinh(angle / 2)) / omega
    s, half = np.where(curl == 0, time, s), np.where(curl == 0, time / 2, half)
    k = 2 * half * half
    return np.stack(
        [k * (b * gy - 2 * c * gx) - way * s * gy, k * (b * gx - 2 * a * gy) + way * s * gx]
    )


# Blocks


def _edges(width: int) -> tuple[int, int]:
    """Give the largest a, b, c and the largest d, e."""
    return 2 ** (coefficient_bits(width) - 1) - 1, 2 ** (linear_bits(width) - 1) - 1


def _flaws(course: _Course, start: np.ndarray, width: int) -> dict[str, np.ndarray]:
    """Find what speaks against curves, the first cause first; ``start`` has shape (2, curves)."""
    runs = course.time != 0
    low, high = start + course.least, start + course.most
    outside = (low < 1 - 2**width) | (high > 2**width - 2)
    least = _SHARPEST * (1 - 1e-9)
    flaws = {
        "still": course.size == 0,
        "lines": (course.bend == 0) & ~course.straight,
        "off": course.off > _OFF + _NOTHING,
        "branch": course.other,
        "behind": np.isnan(course.time),
        "sharp start": runs & (course.size < 4 * course.second),
        "sharp": runs & (course.radius < least),
        "narrow": runs & (course.room < least),
        "outside": runs & outside.any(axis=0),
    }
    return {flaw: np.asarray(found, dtype=bool) for flaw, found in flaws.items()}


def _objects(*numbers: int) -> list[np.ndarray]:
    return [np.array([number], dtype=object) for number in numbers]


class _Curve:
    """One curve through a start, in whole numbers of any size, bent to the side it is run.

    Parameters
    ----------
    local : sequence of rational
        a, b, c, and Gx, Gy at the start; up to a factor.
    start : tuple of int
    clockwise : bool
    """

    def __init__(self, local: Sequence[int | Fraction], start: tuple[int, int], clockwise: bool):
        self.local = _whole_numbers(local)
        self.start = start
        self.clockwise = clockwise
        a, b, c, gx, gy = self.local
        if a * gy * gy - b * gx * gy + c * gx * gx < 0:
            self._turn()

    def _turn(self) -> None:
        self.local = [-number for number in self.local]

    @property
    def kind(self) -> str:
        """One of :data:`KINDS`."""
        a, b, c, *_ = self.local
        if a == b == c == 0:
            return "line"
        if a == c and b == 0:
            return "circle"
        curl = 4 * a * c - b * b
        return "ellipse" if curl > 0 else "hyperbola" if curl else "parabola"

    @classmethod
    def of_coefficients(
        cls, five: Sequence[int | Fraction], start: tuple[int, int], clockwise: bool
    ) -> "_Curve":
        """Make a curve from a, b, c, d, e."""
        a, b, c, d, e = five
        x, y = start
        return cls([a, b, c, 2 * a * x + b * y + d, b * x + 2 * c * y + e], start, clockwise)

    @property
    def coefficients(self) -> list[int]:
        """a, b, c, d, e."""
        a, b, c, gx, gy = self.local
        x, y = self.start
        return [a, b, c, gx - 2 * a * x - b * y, gy - b * x - 2 * c * y]

    def course(self, end: tuple[int, int]) -> _Course:
        """Give the way to the point nearest to an end; a line is turned to have it ahead."""
        offset = [b - a for a, b in zip(self.start, end, strict=True)]
        clockwise = np.array([self.clockwise])
        course = _course(_objects(*self.local), _objects(*offset), clockwise)
        if course.straight[0] and np.isnan(course.time[0]):
            self._turn()
            course = _course(_objects(*self.local), _objects(*offset), clockwise)
        return course

    def refuse(self, end: tuple[int, int], width: int, full_turns: int) -> _Course:
        """Give the course to an end; raise ``BadInputError`` if it cannot be run."""
        course = self.course(end)
        self._refuse(course, end, width)
        if full_turns:
            if full_turns < 0:
                raise BadInputError(f"{full_turns} whole turns cannot be made: give 0 or more")
            if not np.isfinite(course.period[0]):
                raise BadInputError(
                    f"a {self.kind} does not come back to its start: leave the turns out"
                )
            self._refuse(self.course(self.start), self.start, width)
        turns = int(course.turns[0]) + 4 * full_turns
        if turns >= 2**TURNS_BITS:
            most = (2**TURNS_BITS - 1 - int(course.turns[0])) // 4
            raise BadInputError(
                f"{full_turns} whole turns are too many: a block has room for {most}; "
                "give several blocks"
            )
        return course

    def _refuse(self, course: _Course, end: tuple[int, int], width: int) -> None:
        flaws = _flaws(course, np.array([self.start], dtype=float).T, width)
        flaw = next((name for name, found in flaws.items() if found[0]), None)
        if flaw is None:
            return
        start = say_point(self.start)
        feet = zip(self.start, course.foot[:, 0], strict=True)
        near = say_point([round(own + float(way)) for own, way in feet])
        room = 2**width
        # Rounded so that what is too much or too little is seen to be so.
        off = np.ceil(100 * course.off[0]) / 100
        sharpest, narrow = np.floor(100 * np.array([course.radius[0], course.room[0]])) / 100
        steep = 100 * course.size[0] // max(1, course.second[0]) / 100
        reach, cure = "", ""
        if flaw == "outside":
            extremes = [
                (axis, own + float(value[0]))
                for bounds in (course.least, course.most)
                for axis, own, value in zip("xy", self.start, bounds, strict=True)
                if not np.isnan(value[0])
            ]
            axis, value = max(extremes, key=lambda extreme: max(extreme[1] + 1, -extreme[1]))
            reach = f"{axis} = {value:.1f}"
            enough = [w for w in range(width, MAX_WIDTH + 1) if 1 - 2**w <= value <= 2**w - 2]
            cure = f"{give_width(enough, MAX_WIDTH)} or" if enough else "give"
        stop = say_point(end)
        raise BadInputError(
            {
                "still": f"the curve has no direction at its start {start}, where both derivatives "
                "are 0: start at another point",
                "lines": f"the curve through {start} is a pair of straight lines, where a curve is "
                "needed: give a line by its own D and E, with A, B and C = 0",
                "off": f"the end {stop} is {off:.2f} steps off the curve, where at most "
                f"{_OFF:g} is allowed: end at a point such as {near}",
                "branch": f"the end {stop} is on the other branch of the hyperbola: end on the "
                f"branch of the start {start}",
                "behind": f"the end {stop} is not ahead of the start {start} on the {self.kind}: "
                "run it the other way round, or exchange start and end",
                "sharp start": f"the curve is too sharp at its start {start}: |Gx| + |Gy| is "
                f"{steep:.2f} times |A| + |B| + |C|, where 4 "
                "times is needed; start at a flatter place or make the curve larger",
                "sharp": f"the curve is too sharp: it bends within {sharpest:.2f} steps, where "
                f"{_SHARPEST:g} are needed; leave the sharp place out or make the curve larger",
                "narrow": f"the {self.kind} comes within {narrow:.2f} steps of a point without a "
                f"direction, where {_SHARPEST:g} are needed; leave that place out or make the "
                "curve larger",
                "outside": f"the curve goes as far as {reach}, where width {width} has room for "
                f"{1 - room} to {room - 2} between start and end; {cure} a shorter arc",
            }[flaw]
        )


def _whole_numbers(numbers: Sequence[int | Fraction]) -> list[int]:
    """Bring rational numbers to the smallest whole ones in the same ratio, of up to 200 bits."""
    scale = math.lcm(*(number.denominator for number in numbers))
    whole = [int(number * scale) for number in numbers]
    common = math.gcd(*whole) or 1
    whole = [number // common for number in whole]
    excess = max(abs(number).bit_length() for number in whole) - 200
    return [round(Fraction(number, 2**excess)) for number in whole] if excess > 0 else whole


def _fits(coefficients: Sequence[int], width: int) -> bool:
    square, linear = _edges(width)
    return all(abs(k) <= square for k in coefficients[:3]) and all(
        abs(k) <= linear for k in coefficients[3:]
    )


def _round(curve: _Curve, arc: np.ndarray, width: int) -> _Curve:
    """Give the curve through the same start, with coefficients that fit, that is nearest to an arc.

    Every scale is tried from the largest that fits down to its half. At each of them a, b and c
    are rounded and Gx and Gy at the start are chosen by least squares; the one with the smallest
    largest distance, of first order, wins.

    Parameters
    ----------
    curve : _Curve
    arc : array of float, shape (2, points)
        From the start.
    width : int
    """
    local = np.array([float(number) for number in curve.local])
    square, linear = _edges(width)
    limits = zip(curve.coefficients, (square, square, square, linear, linear), strict=True)
    scale = min(limit / abs(number) for number, limit in limits if number)
    scales = scale * (1 - 1e-9) * np.linspace(1, 0.5, _SCALES)
    u, v = arc
    a, b, c, gx, gy = local
    steep = np.hypot(2 * a * u + b * v + gx, b * u + 2 * c * v + gy)
    wanted = scales[:, None] * local[:3]
    errors = (np.rint(wanted) - wanted) @ (np.stack([u * u, u * v, v * v]) / steep)
    slopes = np.stack([u, v]) / steep
    shifts = -errors @ np.linalg.pinv(slopes, rcond=1e-12)
    moved = np.abs(errors + shifts @ slopes).max(axis=1) / scales
    for index in np.argsort(moved, kind="stable")[:64]:
        exact = Fraction(float(scales[index]))
        rounded = [
            *(round(float(number)) for number in np.rint(wanted[index])),
            *(
                round(number * exact + Fraction(float(shift)))
                for number, shift in zip(curve.local[3:], shifts[index], strict=True)
            ),
        ]
        found = _Curve([Fraction(number) for number in rounded], curve.start, curve.clockwise)
        a, b, c, gx, gy = found.local
        bend = a * gy * gy - b * gx * gy + c * gx * gx
        bent = bend > 0 or a == b == c == 0 or curve.kind == "line"
        closed = 4 * a * c > b * b or curve.kind not in ("ellipse", "circle")
        if _fits(found.coefficients, width) and bent and (gx or gy) and closed:
            return found
    raise BadInputError(
        f"the coefficients of the {curve.kind} are too far apart for those of width {width}, which "
        f"have {coefficient_bits(width)} and {linear_bits(width)} bits: {_more_bits(width)}"
    )


def _more_bits(width: int) -> str:
    """Give the cure for what a few bits more may do for."""
    return f"give a larger --width, up to {MAX_WIDTH}" if width < MAX_WIDTH else "there are no more"


def _arc(curve: _Curve, course: _Course, time: np.ndarray) -> np.ndarray:
    """Give where the motion has come to at these times, shape (2, times), from the start."""
    local = [float(number) for number in curve.local]
    # From both ends: the way along a hyperbola grows without limit, and its rounding with it.
    late = time > course.time[0] / 2
    back = [*local[:3], *course.gradient[:, 0]]
    points = np.empty((2, len(time)))
    points[:, ~late] = _flow(local, curve.clockwise, time[~late])
    left = course.time[0] - time[late]
    points[:, late] = course.foot + _flow(back, not curve.clockwise, left)
    return points


def _spread(course: _Course, points: int) -> np.ndarray:
    """Give times evenly spread over the way."""
    return np.linspace(0, course.time[0], points)


def _numbers(what: str, numbers: Sequence[Number], count: int) -> list[Fraction]:
    """Take finite numbers as they are."""
    if len(numbers) != count:
        raise BadInputError(f"{what}: {len(numbers)} numbers are given, where {count} are needed")
    for number in numbers:
        if isinstance(number, float) and not math.isfinite(number):
            raise BadInputError(f"{what}: {number} is no number to work with: give finite numbers")
    return [Fraction(number) for number in numbers]


def _point(point: Sequence[int], width: int) -> tuple[int, int]:
    x, y = (int(value) for value in point)
    check_coordinates([(x, y)], width, MAX_WIDTH)
    return x, y


def _wider(width: int, fits: Callable[[int], bool]) -> str:
    """Give the cure where a width must do for what this one does not."""
    return give_width([more for more in range(width + 1, MAX_WIDTH + 1) if fits(more)], MAX_WIDTH)


def _check_width(width: int) -> None:
    try:
        check_width(width, MAX_WIDTH)
    except ValueError as error:
        raise BadInputError(str(error)) from None


def check_block(block: Sequence[int], width: int) -> None:
    """Refuse a block that does not fit a device of ``width`` bits; its curve is not looked at.

    Raises
    ------
    BadInputError
        The width, a coefficient or a coordinate is out of range.
    """
    _check_width(width)
    five, points = block[:5], (block[5:7], block[7:9])
    check_coordinates(points, width, MAX_WIDTH)
    if not _fits(five, width):
        cure = _wider(width, lambda more: _fits(five, more))
        raise BadInputError(
            f"the coefficients {say_point(five)} are out of range: width {width} has room for "
            f"{' and '.join(map(str, _edges(width)))}; {cure}"
        )


def from_coefficients(
    coefficients: Sequence[Number],
    start: Sequence[int],
    end: Sequence[int],
    clockwise: bool,
    width: int,
    full_turns: int = 0,
) -> ConicBlock:
    """Make the block of a·x² + b·x·y + c·y² + d·x + e·y + f = 0, f following from the start.

    Whole numbers that fit are kept, with the sign that makes the curve bend to the side it is run;
    a line gets the sign that has its end ahead. Other numbers are scaled to whole ones: exactly if
    that fits, else so that the curve is moved least. On a circle or ellipse the same start and end
    are a whole turn, on other curves a block of no length.

    Parameters
    ----------
    coefficients : five int, float or Fraction
    start, end : two int
        In steps; the end is on the curve or up to a step off it.
    clockwise : bool
    width : int
        4 to 24.
    full_turns : int
        Whole turns before the arc itself.

    Raises
    ------
    BadInputError
        The curve cannot be run from start to end; the message names the reason, the limit, the
        cure.
    """
    _check_width(width)
    five = _numbers("coefficients", coefficients, 5)
    start, end = _point(start, width), _point(end, width)
    curve = _Curve.of_coefficients(five, start, clockwise)
    common = math.gcd(*map(int, five)) if all(k.denominator == 1 for k in five) else 1
    return _make(curve, end, width, full_turns, common)


def _make(
    curve: _Curve, end: tuple[int, int], width: int, full_turns: int = 0, common: int = 1
) -> ConicBlock:
    """Make the block of a curve; exactly, and multiplied by ``common``, if that fits."""
    course = curve.refuse(end, width, full_turns)
    for factor in (common, 1):
        exact = [factor * number for number in curve.coefficients]
        if _fits(exact, width):
            turns = int(course.turns[0]) + 4 * full_turns
            row = (*exact, *curve.start, *end, int(curve.clockwise), turns)
            return ConicBlock(row, curve.kind, 0.0)
    passed = curve.course(curve.start) if full_turns else course
    arc = _arc(curve, passed, _spread(passed, _SAMPLES))
    rounded = _round(curve, arc[:, :: _SAMPLES // 128], width)
    return _stand_in(rounded, end, curve.kind, arc, width, full_turns)


def _stand_in(
    curve: _Curve, end: tuple[int, int], kind: str, arc: np.ndarray, width: int, full_turns: int
) -> ConicBlock:
    """Make the block of a curve that stands for an arc, shape (2, points), from its start."""
    course = curve.refuse(end, width, full_turns)
    five, start = np.array(curve.coefficients), np.array(curve.start)
    moved = float(distance(five, start, arc.T + start).max())
    turns = int(course.turns[0]) + 4 * full_turns
    return ConicBlock((*five, *curve.start, *end, int(curve.clockwise), turns), kind, moved)


def parabola(
    start: Sequence[int], control: Sequence[int], end: Sequence[int], width: int
) -> ConicBlock:
    """Make the block of the parabola with the points of a quadratic Bézier curve.

    Parameters
    ----------
    start, end : two int
        In steps.
    control : two int
        Where the tangents at start and end meet; it may lie outside the coordinates.
    width : int
        4 to 24.

    Raises
    ------
    BadInputError
        The parabola cannot be run; the message names the reason, the limit, the cure.
    """
    _check_width(width)
    start, end = _point(start, width), _point(end, width)
    # start + t·p + t²·q; t is found from (u, v) as (u, v) × q / (p × q).
    px, py = (2 * (int(m) - s) for s, m in zip(start, control, strict=True))
    qx, qy = (s - 2 * int(m) + e for s, m, e in zip(start, control, end, strict=True))
    cross = px * qy - py * qx
    if cross == 0:
        raise BadInputError(
            f"the points {say_point(start)}, {say_point(control)} and {say_point(end)} are in a "
            "line, where a parabola needs a triangle: give a line"
        )
    local = [qy * qy, -2 * qx * qy, qx * qx, cross * py, -cross * px]
    return _make(_Curve(local, start, cross < 0), end, width)


def ellipse(
    center: Sequence[int],
    semi_axes: Sequence[Number],
    angle_degrees: Number,
    width: int,
    *,
    start_angle: Number = 0,
    end_angle: Number = 0,
    clockwise: bool = False,
    full_turns: int = 0,
) -> ConicBlock:
    """Make the block of an arc of an ellipse, or of a circle.

    The start is the point of the grid that is nearest to the ellipse's. The ellipse is then shifted
    by the little that it passes this point by, which is the least that it must be moved; its
    coefficients are rounded, and the end is the point of the grid that is nearest to the curve's.

    Parameters
    ----------
    center : two int
        In steps; it may lie outside the coordinates.
    semi_axes : two numbers
        In steps.
    angle_degrees : number
        From the x axis to the first semi-axis.
    width : int
        4 to 24.
    start_angle, end_angle : numbers
        In degrees of the angle that describes the ellipse: 0 is the end of the first semi-axis, 90
        that of the second. Equal ones are a whole turn.
    clockwise : bool
    full_turns : int
        Whole turns before the arc itself.

    Raises
    ------
    BadInputError
        The ellipse cannot be run; the message names the reason, the limit, the cure.
    """
    _check_width(width)
    r1, r2 = _numbers("semi-axes", semi_axes, 2)
    longest = 2 ** (width + 8)
    for semi_axis in (r1, r2):
        if semi_axis < _SHARPEST:
            raise BadInputError(
                f"the semi-axis {float(semi_axis):g} is too short: give {_SHARPEST:g} or more"
            )
    middle = [int(value) for value in center]
    for what, said, far in (
        ("semi-axis", f"{float(max(r1, r2)):g}", max(r1, r2)),
        ("center", say_point(middle), max(map(abs, middle))),
    ):
        if far > longest:
            cure = _wider(width, lambda more, far=far: far <= 2 ** (more + 8))
            raise BadInputError(
                f"the {what} {said} is out of range: width {width} has room for {longest} steps; "
                f"{cure}"
            )
    turned, first, last = _numbers("angles", (angle_degrees, start_angle, end_angle), 3)
    # a·u² + b·u·v + c·v² = r1²·r2² around the centre.
    cos, sin = _direction(2 * turned)
    total, spread = r1 * r1 + r2 * r2, r2 * r2 - r1 * r1
    a, b, c = (total + cos * spread) / 2, sin * spread, (total - cos * spread) / 2

    sweep = (first - last if clockwise else last - first) % 360 or Fraction(360)
    # All of the ellipse that is passed, and the end.
    way = -1 if clockwise else 1
    passed = np.linspace(0, 360 if full_turns else float(sweep), _SAMPLES - 1, dtype=np.longdouble)
    angles = way * np.radians(np.append(passed, float(sweep)))
    beside = [np.longdouble(float(part)) for part in _direction(first)]
    across = [np.longdouble(float(part)) for part in _direction(turned)]
    x, y = _rotated(np.cos(angles), np.sin(angles), *beside)
    points = np.stack(_rotated(float(r1) * x, float(r2) * y, *across))
    points += np.array(middle, dtype=np.longdouble)[:, None]
    start = _point([round(value) for value in points[:, 0]], width)

    u, v = (s - m for s, m in zip(start, middle, strict=True))
    value = a * u * u + b * u * v + c * v * v - (r1 * r2) ** 2
    gx, gy = 2 * a * u + b * v, b * u + 2 * c * v
    wx, wy = Fraction(0), Fraction(0)
    if value:
        floats = [np.array(float(number)) for number in (value, gx, gy, a, b, c)]
        wx, wy = (Fraction(float(way)) for way in _foot(*floats))
    local = [a, b, c, gx + 2 * a * wx + b * wy, gy + b * wx + 2 * c * wy]
    curve = _Curve(local, start, clockwise)
    origin = np.array(start)
    arc = np.asarray(points - origin[:, None], dtype=float)
    kind = curve.kind
    exact = not value and _fits(curve.coefficients, width)
    if not exact:
        shifted = arc - np.array([[float(wx)], [float(wy)]])
        curve = _round(curve, shifted[:, :: _SAMPLES // 128], width)
    end = start
    if sweep < 360:
        last_point = arc[:, -1] + origin
        last_point += _to_curve(np.array(curve.coefficients), origin, last_point)
        end = _point([round(value) for value in last_point], width)
    course = curve.course(end)
    if abs(course.time[0] / course.period[0] - float(sweep) / 360) > 0.5:
        raise BadInputError(
            f"the arc from {float(first):g} to {float(last):g} degrees begins and ends within a "
            f"step of {say_point(start)}: give angles farther apart, or equal ones for a whole turn"
        )
    if exact:
        return _make(curve, end, width, full_turns)
    return _stand_in(curve, end, kind, arc, width, full_turns)


def _direction(degrees: Fraction) -> tuple[Fraction, Fraction]:
    """Give cosine and sine, exact for right angles."""
    turns, rest = divmod(degrees, 90)
    angle = math.radians(float(rest))
    cos, sin = Fraction(math.cos(angle)), Fraction(math.sin(angle))
    for _ in range(turns % 4):
        cos, sin = -sin, cos
    return cos, sin


def _rotated(x, y, cos, sin):
    return cos * x - sin * y, sin * x + cos * y


class _Outline:
    """The way that a block goes, for pictures; whole turns are gone through once.

    Raises
    ------
    BadInputError
        The curve does not lead from start to end.
    """

    def __init__(self, block: Sequence[int] | np.ndarray):
        *five, x, y, end_x, end_y, clockwise, turns = (int(value) for value in block)
        self._curve = _Curve.of_coefficients(five, (x, y), bool(clockwise))
        self._course = self._curve.course((end_x, end_y))
        if np.isnan(self._course.time[0]):
            raise BadInputError(
                f"the {self._curve.kind} does not lead from {x},{y} to {end_x},{end_y}: give "
                "another end"
            )
        if np.isfinite(self._course.period[0]) and turns > self._course.turns[0] + 1:
            self._course = self._curve.course((x, y))

    def times(self, points: int) -> np.ndarray:
        """Give times evenly spread over the way."""
        return _spread(self._course, points)

    def at(self, time: np.ndarray) -> np.ndarray:
        """Give where it is at these times, shape (times, 2), in steps."""
        start, five = np.array(self._curve.start), np.array(self._curve.coefficients)
        points = _arc(self._curve, self._course, time).T + start
        return points + np.stack(_to_curve(five, start, points), axis=-1)

    def acceleration(self, points: np.ndarray) -> np.ndarray:
        """Give the size of the acceleration at points of it, shape (points,)."""
        a, b, c, *_ = (float(number) for number in self._curve.local)
        d, e = (float(number) for number in self._curve.coefficients[3:])
        x, y = points.T
        gx, gy = 2 * a * x + b * y + d, b * x + 2 * c * y + e
        return np.hypot(b * gy - 2 * c * gx, b * gx - 2 * a * gy)


def curve_points(block: Sequence[int] | np.ndarray, most: int = 4096) -> np.ndarray:
    """Give points of a block's curve in the order of the motion, for a picture.

    Straight lines between them are within a hundredth of a step of the curve, unless that takes
    more than ``most`` points. Whole turns are gone through once.

    Returns
    -------
    array of float, shape (points, 2)
        From the start to the point of the curve that is nearest to the end, in steps.

    Raises
    ------
    BadInputError
        The curve does not lead from start to end.
    """
    way = _Outline(block)
    # The way between two points is off its chord by at most |acceleration|·time²/8.
    few = way.times(65)
    fastest = way.acceleration(way.at(few)).max()
    needed = 2 + few[-1] * math.sqrt(fastest / (8 * 0.01))
    return way.at(way.times(max(2, int(min(needed, most)))))


def curve_near(block: Sequence[int] | np.ndarray, point: np.ndarray, reach: float) -> np.ndarray:
    """Give what of a block's curve lies near a point, for a picture, fine however large it is.

    Parameters
    ----------
    block : 11 int
    point : two numbers
    reach : float
        In steps.

    Returns
    -------
    array of float, shape (points, 2)
        At most a tenth of a step from each other, in steps; between pieces there is a row of NaN.

    Raises
    ------
    BadInputError
        The curve does not lead from start to end.
    """
    way = _Outline(block)
    edges = way.times(1025)
    first, last = edges[:-1], edges[1:]
    while True:
        one, other = way.at(first), way.at(last)
        chord, to_point = other - one, point - one
        square = (chord * chord).sum(axis=1)
        part = np.clip((to_point * chord).sum(axis=1) / np.fmax(square, 1e-30), 0, 1)
        off = np.hypot(*(to_point - part[:, None] * chord).T)
        bulge = np.fmax(way.acceleration(one), way.acceleration(other)) * (last - first) ** 2 / 4
        near = off - bulge <= reach
        first, last, one, other = (row[near] for row in (first, last, one, other))
        if square[near].max(initial=0) <= 0.01:
            break
        cuts = first + np.linspace(0, 1, 9)[:, None] * (last - first)
        cuts[-1] = last
        first, last = cuts[:-1].T.ravel(), cuts[1:].T.ravel()
    pieces = [np.empty((0, 2))]
    breaks = np.flatnonzero(first[1:] != last[:-1]) + 1
    for piece in np.split(np.arange(len(first)), breaks):
        pieces += [one[piece], other[piece[-1:]], np.full((1, 2), np.nan)]
    return np.concatenate(pieces)[:-1]


@dataclass(frozen=True)
class Motion:
    """How far and how long curves run: what the clocks of their blocks follow from.

    Attributes
    ----------
    steps : array of float, shape (blocks,)
        ∫max(|dx|, |dy|): steps of the axis that moves faster.
    time : array of float, shape (blocks,)
        Of the motion x' = −Gy, y' = Gx.
    first, largest : array of float, shape (blocks,)
        The larger one of |Gx| and |Gy| at the start, and where it is largest on the way.
    smallest : array of float, shape (blocks,)
        √(Gx² + Gy²) where it is smallest on the way; of an ellipse where it is smallest at all.
    """

    steps: np.ndarray
    time: np.ndarray
    first: np.ndarray
    largest: np.ndarray
    smallest: np.ndarray


def motion(blocks: np.ndarray) -> Motion:
    """Work out how curves run, quick, for many blocks at once, shape (blocks, 11).

    It is as exact as it takes to judge how long they run. What does not lead from its start to its
    end is not a number, or any.
    """
    a, b, c, d, e, x, y, end_x, end_y, clockwise, turns = blocks.T
    mirror = np.where(clockwise == 1, -1, 1)
    whole = (a, mirror * b, c, 2 * a * x + b * y + d, mirror * (b * x + 2 * c * y + e))
    curl = np.asarray(4 * whole[0] * whole[2] - whole[1] ** 2, dtype=float)
    # Its parts may be much larger than Q.
    a, b, c, gx, gy = (np.asarray(row, dtype=np.longdouble) for row in whole)
    bend = np.asarray(a * gy * gy - b * gx * gy + c * gx * gx, dtype=float)
    local = a, b, c, gx, gy = tuple(row.astype(float) for row in (a, b, c, gx, gy))
    u, v = (end_x - x).astype(float), (mirror * (end_y - y)).astype(float)
    straight, closed = (a == 0) & (b == 0) & (c == 0), curl > 0
    with np.errstate(all="ignore"):
        ex, ey = gx + 2 * a * u + b * v, gy + b * u + 2 * c * v
        # The end is not quite on the curve.
        for _ in range(4):
            off = (u * (a * u + b * v + gx) + v * (c * v + gy)) / (ex * ex + ey * ey)
            u, v = u - off * ex, v - off * ey
            ex, ey = gx + 2 * a * u + b * v, gy + b * u + 2 * c * v
        swept = (np.arctan2(ey, ex) - np.arctan2(gy, gx)) % (2 * np.pi)
        rounds = np.where(straight, 0, np.rint((turns - swept / (np.pi / 2)) / 4))
        bent = _faster_steps(local, curl, bend, swept)
        steps = np.where(straight, np.fmax(np.abs(u), np.abs(v)), bent)
        around = rounds > 0
        of_these = (tuple(row[around] for row in local), curl[around], bend[around])
        steps[around] += rounds[around] * _faster_steps(*of_these, 2 * np.pi)

        _, sine, cosine = _place(local, curl, bend, ex, ey)
        omega = np.sqrt(np.abs(curl))
        angle = np.arctan2(omega * sine, cosine)
        # Less than half a turn from what the gradient has turned by, which knows of a whole one.
        angle += 2 * np.pi * np.rint((swept - angle) / (2 * np.pi)) + 2 * np.pi * rounds
        time = np.select(
            [straight, closed, curl == 0],
            [(gx * v - gy * u) / (gx * gx + gy * gy), angle / omega, sine],
            np.arcsinh(omega * sine) / omega,
        )

        # |G|, |Gx| and |Gy| are convex but on ellipses, where both of these go up and down.
        first = np.fmax(np.abs(gx), np.abs(gy))
        largest = np.fmax(first, np.fmax(np.abs(ex), np.abs(ey)))
        for h, before, after in (
            (a, gx * (b * gx - 2 * a * gy), ex * (b * ex - 2 * a * ey)),
            (c, gy * (2 * c * gx - b * gy), ey * (2 * c * ex - b * ey)),
        ):
            # Half a turn leads from a largest to a largest, smallest or none in the middle.
            rises, falls = before > 0, after < 0
            either = (angle >= np.pi / 2) & (rises | falls)
            passed = closed & ((angle >= np.pi) | either | (rises & falls))
            largest = np.where(passed, np.fmax(largest, np.sqrt(4 * h * bend / curl)), largest)
        before, after = (
            b * (kx * kx - ky * ky) + 2 * (c - a) * kx * ky for kx, ky in ((gx, gy), (ex, ey))
        )
        smallest = np.fmin(np.hypot(gx, gy), np.hypot(ex, ey))
        inside = ~straight & (closed | ((before < 0) & (after > 0)))
        least = np.sqrt(2 * bend / (a + c + np.hypot(a - c, b)))
        smallest = np.where(inside, np.fmin(smallest, least), smallest)
    return Motion(steps, time, first, largest, smallest)


def _faster_steps(
    local: tuple[np.ndarray, ...], curl: np.ndarray, bend: np.ndarray, swept: np.ndarray | float
) -> np.ndarray:
    """Give the steps of the axis that moves faster until the gradient has turned by an angle.

    Where the gradient is nearer to the y axis x is the faster one, for a right angle, and goes one
    way all the time. So only the points between are needed.

    Parameters
    ----------
    local, curl, bend
        As for :func:`_extreme`.
    swept : array of float, or one
        The angle, up to 2π.
    """
    begin = np.arctan2(local[4], local[3])
    diagonal = (np.pi / 4 - begin) % (np.pi / 2)
    steps, before = 0, 0
    for right_angles in range(5):
        way = begin + np.minimum(diagonal + right_angles * np.pi / 2, swept)
        place, _, _ = _place(local, curl, bend, np.cos(way), np.sin(way))
        steps, before = steps + np.abs(place - before).max(axis=0), place
    return np.asarray(steps)


# Random blocks


def random_blocks(kind: str, width: int, count: int, random: np.random.Generator) -> np.ndarray:
    """Draw blocks that can be run, of curves of any size, shape and place there is room for.

    The start is on the curve, the end the point of the grid nearest to it; both directions; of
    circles and ellipses one in eight is a whole turn.

    Parameters
    ----------
    kind : str
        One of :data:`KINDS`.
    width : int
        4 to 24.
    count : int
    random : numpy.random.Generator

    Returns
    -------
    array of int64, shape (count, 11)
    """
    check_width(width, MAX_WIDTH)
    if kind not in KINDS:
        raise ValueError(f"kind is {kind!r}: choose {' or '.join(map(repr, KINDS))}")
    found = [np.empty((0, 11), dtype=np.int64)]
    while (missing := count - sum(map(len, found))) > 0:
        found.append(_draw(kind, width, min(1 << 14, 2 * missing + 64), random))
    return np.concatenate(found)[:count]


def _logarithmic(
    random: np.random.Generator, low: float, high: float | np.ndarray, count: int
) -> np.ndarray:
    """Draw numbers of all sizes alike."""
    return low * np.exp(random.random(count) * np.log(high / low))


def _rounded(numbers: np.ndarray) -> np.ndarray:
    """Give the nearest whole numbers, of any size, as objects."""
    return np.asarray(np.frompyfunc(int, 1, 1)(np.rint(numbers)), dtype=object)


def _shapes(
    kind: str, width: int, count: int, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Draw a, b, c, Gx, Gy, shape (5, count), and for how long they are run: by ωt, or by t."""
    square, linear = _edges(width)
    room = 2.0**width
    turned = random.uniform(0, 2 * np.pi, count)
    turned = np.where(random.random(count) < 0.25, np.pi / 2 * random.integers(0, 4, count), turned)
    cos, sin = np.cos(turned), np.sin(turned)
    length = _logarithmic(random, 1, 2 * room, count)
    if kind == "line":
        # Half of them go through their ends exactly.
        exact = random.random(count) < 0.5
        size = np.where(exact, length, _logarithmic(random, 1, linear, count))
        none = np.zeros(count)
        return _rounded(np.stack([none, none, none, size * sin, -size * cos])), length / size

    # In the curve's own axes: half the second derivatives h, and the gradient g at the start.
    if kind == "parabola":
        # One of them must still be none when a, b and c are whole: its direction is, too.
        size = _logarithmic(random, 1, math.sqrt(square), count)
        across, along = np.rint(size * np.stack([cos, sin]))
        size = np.fmax(1, np.hypot(across, along))
        cos, sin = across / size, along / size
        h1 = size**2 * np.floor(_logarithmic(random, 1, np.fmax(1, square / size**2), count))
        h2 = np.zeros(count)
        g1 = 2 * h1 * _logarithmic(random, 1, 2 * room, count) * random.choice((-1, 1), count)
        g2 = 2 * h1 * _logarithmic(random, _SHARPEST, room, count)
        span = length / g2
    else:
        r1, r2 = (_logarithmic(random, _SHARPEST, room, count) for _ in range(2))
        if kind == "hyperbola":
            h1, h2 = -1 / r1**2, 1 / r2**2
            farthest = np.arcsinh(room / r2)
            angle = farthest * random.uniform(-1, 1, count)
            g1, g2 = 2 * h1 * r1 * np.cosh(angle), 2 * h2 * r2 * np.sinh(angle)
            span = _logarithmic(random, 1e-3, 2 * farthest, count)
        else:
            r2 = r1 if kind == "circle" else r2
            h1, h2 = 1 / r1**2, 1 / r2**2
            angle = random.uniform(0, 2 * np.pi, count)
            g1, g2 = 2 * h1 * r1 * np.cos(angle), 2 * h2 * r2 * np.sin(angle)
            part = _logarithmic(random, 1e-3, 1, count)
            part = np.where(random.random(count) < 0.5, random.random(count), part)
            span = 2 * np.pi * np.where(random.random(count) < 0.125, 1, part)
    a, b, c = h1 * cos**2 + h2 * sin**2, 2 * cos * sin * (h1 - h2), h1 * sin**2 + h2 * cos**2
    rows = np.stack([a, b, c, cos * g1 - sin * g2, sin * g1 + cos * g2])
    if kind != "parabola":
        largest = np.abs(rows[:3]).max(axis=0)
        rows *= _logarithmic(random, 1, square, count) / largest
    return _rounded(rows), span


def _draw(kind: str, width: int, count: int, random: np.random.Generator) -> np.ndarray:
    """Draw some curves and keep those that can be run, shape (kept, 11)."""
    room = 2.0**width
    local, span = _shapes(kind, width, count, random)
    clockwise = random.random(count) < 0.5
    a, b, c, gx, gy = floats = local.astype(float)
    curl = 4 * a * c - b * b
    bent = {"circle": curl > 0, "ellipse": curl > 0, "hyperbola": curl < 0}.get(kind, curl == 0)
    whole = (span == 2 * np.pi) & (curl > 0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        time = span / np.where(curl == 0, 1, np.sqrt(np.abs(curl)))
        end = np.where(whole, 0, _flow(floats, clockwise, time))
        kept = bent & ((gx != 0) | (gy != 0)) & (np.abs(end) < 2 * room).all(axis=0)
    local, clockwise, whole = local[:, kept], clockwise[kept], whole[kept]
    end = _rounded(end[:, kept])
    course = _course(local, end, clockwise)

    # Where there is room for it.
    offset = end.astype(float)
    low = np.fmax(-room - np.fmin(0, offset), np.ceil(1 - room - course.least))
    high = np.fmin(room - 1 - np.fmax(0, offset), np.floor(room - 2 - course.most))
    place = np.floor(low + random.random(low.shape) * (high - low + 1))
    flaws = _flaws(course, place, width)
    good = (low <= high).all(axis=0) & (course.time != 0) & ~np.any(list(flaws.values()), axis=0)
    a, b, c, gx, gy = local
    x, y = start = _rounded(place)
    five = np.array([a, b, c, gx - 2 * a * x - b * y, gy - b * x - 2 * c * y])
    square, linear = _edges(width)
    edges = np.array([square, square, square, linear, linear], dtype=object)
    good &= np.asarray(np.abs(five) <= edges[:, None], dtype=bool).all(axis=0)
    turns = course.turns + 4 * (whole & (random.random(len(whole)) < 1 / 16))
    rows = [*five, *start, *(start + end), clockwise.astype(object), turns.astype(object)]
    return np.array(rows, dtype=object).T[good].astype(np.int64)
