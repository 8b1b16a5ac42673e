"""What can be run: lines, an arc, or a conic. Blocks, checks, and the true curve to draw."""

from collections.abc import Sequence
from math import atan2, ceil, degrees, sqrt
from typing import Any, Protocol

import numpy as np

from discreta.sim.arcs import squared_radii, swept
from discreta.sim.conics import ConicBlock, check_block, curve_near, curve_points
from discreta.sim.contour import ArcContour, ConicContour, Contour, LineContour
from discreta.sim.pace import Pace
from discreta.sim.points import check_arc, check_path

__all__ = ["Arc", "Conic", "Curve", "Drawn", "Polyline"]

#: Points of a whole circle in a picture, and of the piece of one in a window.
_ROUND, _NEAR = 1 << 12, 1 << 10


class Drawn(Protocol):
    """What a picture shows the steps of.

    Attributes
    ----------
    axes : int
    """

    axes: int

    @property
    def start(self) -> np.ndarray:
        """Give where it begins, shape (axes,), in steps."""
        ...

    def outline(self) -> np.ndarray:
        """Give the true curve as a polyline, shape (points, axes), in steps, fine for a picture."""
        ...

    def near(self, point: np.ndarray, reach: float, /) -> np.ndarray:
        """Give what of the curve lies up to ``reach`` steps from a point, as such a polyline."""
        ...


class Curve(Drawn, Protocol):
    """What :func:`~discreta.sim.run.run` runs.

    Attributes
    ----------
    kind : str
        What its blocks are, as of :class:`~discreta.sim.methods.Method`.
    """

    kind: str

    @property
    def blocks(self) -> np.ndarray:
        """Give what the device is given, shape (blocks, block fields)."""
        ...

    def check(self, width: int) -> None:
        """Raise :class:`BadInputError` for what a device of ``width`` bits has no room for."""
        ...

    def contour(self) -> Contour:
        """Give what compares the steps with the true curve."""
        ...

    def facts(self, contour: Contour, pace: Pace | None, /) -> dict[str, Any]:
        """Give what the summary says of this kind of curve alone; no pace on a carrier."""
        ...


class Polyline:
    """Lines from support point to support point; one line with two of them.

    Parameters
    ----------
    points : array of int, shape (points, axes)
        Two or more, in steps.
    """

    kind = "line"

    def __init__(self, points: Sequence[Sequence[int]] | np.ndarray):
        self.points = np.asarray(points, dtype=np.int64)
        self.axes = self.points.shape[1]
        self.start = self.points[0]
        self.blocks = np.concatenate([self.points[:-1], self.points[1:]], axis=1)

    def check(self, width: int) -> None:
        """Raise :class:`BadInputError` for a line for which there is no room."""
        check_path(self.points, width)

    def contour(self) -> LineContour:
        """Give what compares the steps with the true lines."""
        return LineContour(self.blocks)

    def facts(self, contour: Contour, pace: Pace | None) -> dict[str, Any]:
        """Give segments, support points hit, path closed, clocks lost between blocks."""
        return {
            "segments": len(self.blocks),
            "support points hit": contour.ends_reached,
            "path closed": bool(np.array_equal(self.points[0], self.points[-1])),
            **({} if pace is None else {"clocks lost between blocks": pace.lost}),
        }

    def outline(self) -> np.ndarray:
        """Give the support points."""
        return self.points

    def near(self, _point: np.ndarray, _reach: float) -> np.ndarray:
        """Give the support points: what lies farther away does no harm."""
        return self.points


class Arc:
    """One arc of a circle, in x and y.

    Parameters
    ----------
    start, end, center : points of two int
        In steps. An end that is the start is a full turn away from it.
    clockwise : bool
    turns : int
        1 to 256: the arc ends in this turn, like one of G2 or G3 with this P.
    """

    kind = "arc"
    axes = 2

    def __init__(
        self,
        start: Sequence[int],
        end: Sequence[int],
        center: Sequence[int],
        *,
        clockwise: bool,
        turns: int = 1,
    ):
        self._points = (tuple(start), tuple(end), tuple(center))
        self.clockwise = clockwise
        self.turns = turns

    @property
    def start(self) -> np.ndarray:
        """Give where it begins."""
        return self.blocks[0, :2]

    @property
    def blocks(self) -> np.ndarray:
        """Give the one block."""
        start, end, center = self._points
        return np.array([[*start, *end, *center, self.clockwise, self.turns - 1]], dtype=np.int64)

    def check(self, width: int) -> None:
        """Raise :class:`BadInputError` for an arc that a device of ``width`` bits refuses."""
        check_arc(*self._points, clockwise=self.clockwise, turns=self.turns, width=width)

    def contour(self) -> ArcContour:
        """Give what compares the steps with the true circle."""
        return ArcContour(self.blocks)

    def facts(self, _contour: Contour, _pace: Pace | None) -> dict[str, Any]:
        """Give the start's radius in steps, and the angle swept in degrees, positive if ccw."""
        return {"radius": round(self._radius, 4), "turn": round(self._turn, 4)}

    def outline(self) -> np.ndarray:
        """Give the circle from the start to the end's angle; of several turns one."""
        return self._at(np.linspace(0, self._once, ceil(_ROUND * self._once / 360) + 1))

    def near(self, point: np.ndarray, reach: float) -> np.ndarray:
        """Give the arc near a point that is not far from it, fine however large the radius is.

        An arc that begins and ends there has two pieces, with a row of NaN between.
        """
        x, y = point - self.blocks[0, 4:6]
        here = self._sign * (degrees(atan2(y, x)) - self._begin) % 360
        side = min(180, 90 * reach / max(self._radius, 1))
        pieces = [np.empty((0, 2))]
        for there in (here - 360, here, here + 360):
            low, high = max(0, there - side), min(self._once, there + side)
            if low < high:
                pieces += [self._at(np.linspace(low, high, _NEAR)), np.full((1, 2), np.nan)]
        return np.concatenate(pieces)[:-1]

    @property
    def _radius(self) -> float:
        """The start's distance from the centre."""
        return sqrt(squared_radii(self.blocks)[0][0])

    @property
    def _turn(self) -> float:
        """The angle swept, in degrees, with its sign."""
        return float(swept(self.blocks)[0])

    @property
    def _once(self) -> float:
        """The angle swept without its sign, a full turn at most."""
        return min(abs(self._turn), 360)

    @property
    def _sign(self) -> int:
        return -1 if self.clockwise else 1

    @property
    def _begin(self) -> float:
        """The start's angle, in degrees."""
        x, y = self.start - self.blocks[0, 4:6]
        return degrees(atan2(y, x))

    def _at(self, angles: np.ndarray) -> np.ndarray:
        """Give the points after so many degrees."""
        phi = np.radians(self._begin + self._sign * angles)
        circle = np.stack([np.cos(phi), np.sin(phi)], axis=1)
        return self.blocks[0, 4:6] + self._radius * circle


class Conic:
    """One piece of a second-order curve, in x and y.

    Parameters
    ----------
    made : ConicBlock
        From one of the functions of :mod:`discreta.sim.conics`, for the width that it is run with
        or less.
    """

    kind = "conic"
    axes = 2

    def __init__(self, made: ConicBlock):
        self._made = made

    @property
    def start(self) -> np.ndarray:
        """Give where it begins."""
        return self.blocks[0, 5:7]

    @property
    def blocks(self) -> np.ndarray:
        """Give the one block."""
        return np.array([self._made.block], dtype=np.int64)

    def check(self, width: int) -> None:
        """Raise :class:`BadInputError` for a block that has more bits than the device."""
        check_block(self._made.block, width)

    def contour(self) -> ConicContour:
        """Give what compares the steps with the block's own curve."""
        return ConicContour(self.blocks)

    def facts(self, _contour: Contour, _pace: Pace | None) -> dict[str, Any]:
        """Give the kind, how far rounding moved it in steps, and an axis's changes of direction."""
        return {
            "curve": self._made.kind,
            "curve moved": round(self._made.moved, 4),
            "changes of direction": self._made.block[-1],
        }

    def outline(self) -> np.ndarray:
        """Give the block's curve from the start to the end; whole turns once."""
        return curve_points(self._made.block)

    def near(self, point: np.ndarray, reach: float) -> np.ndarray:
        """Give the pieces of it near a point, fine however large it is, rows of NaN between."""
        return curve_near(self._made.block, point, reach)
