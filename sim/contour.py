"""How far the steps are from the true curves, worked out as they come."""

from abc import ABC, abstractmethod

import numpy as np

from discreta.sim.arcs import is_empty
from discreta.sim.conics import distance
from discreta.sim.constant_speed import plane
from discreta.sim.stretch import EVENT_COLUMNS, Stretch

__all__ = [
    "ArcContour",
    "ConicContour",
    "Contour",
    "ExactConicContour",
    "LineContour",
    "distance_from_circle",
    "distance_from_line",
]

#: Points that are compared with curves at a time: what they need stays in a processor's cache.
_BATCH = 1 << 14


def _squarable(*points: np.ndarray) -> tuple[np.ndarray, ...]:
    """Give points with which squares can be reckoned: of large ones those do not fit 64 bits.

    A long double has as many bits, and an exponent.
    """
    if any(np.abs(part).max(initial=0) >= 1 << 30 for part in points):
        return tuple(part.astype(np.longdouble) for part in points)
    return points


def distance_from_line(points: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Give the distance of points from lines through the origin, in steps.

    Parameters
    ----------
    points, direction : arrays, shape (..., axes)
        In steps; the distance is 0 where the direction is.
    """
    points, direction = _squarable(points, direction)
    length = np.maximum(np.sqrt(np.sum(direction * direction, axis=-1)), 1)
    axes = points.shape[-1]
    crosses = [
        points[..., i] * direction[..., k] - points[..., k] * direction[..., i]
        for i in range(axes)
        for k in range(i)
    ]
    if len(crosses) == 1:
        return np.abs(crosses[0]) / length
    return np.sqrt(sum(cross.astype(np.longdouble) ** 2 for cross in crosses)) / length


def distance_from_circle(points: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Give the distance of points from circles around the origin, in steps.

    The difference of the radii is worked out from that of their squares, which is small near the
    circle: so nothing is lost at radii of 2^32 steps.

    Parameters
    ----------
    points, start : arrays, shape (..., 2)
        In steps; the circle goes through ``start``.
    """
    points, start = _squarable(points, start)
    squares = np.sum((points - start) * (points + start), axis=-1)
    radii = [np.sqrt(np.sum(part * part, axis=-1)) for part in (points, start)]
    # The sum is 0 when both are the origin, and else 1 or more.
    return np.abs(squares) / np.maximum(radii[0] + radii[1], 1)


class Contour(ABC):
    """Follows the steps of a run of blocks and compares every point with its true curve.

    The device answers every block by ``done`` or ``error``, a clock behind its last step. So the
    answers tell which block a step belongs to, whether the blocks before it moved, had no length
    or were refused.

    Attributes
    ----------
    starts, ends : arrays of int64, shape (blocks, axes)
        In steps.
    steps : int
        Steps taken; a step may move several axes.
    clocks : int
        Clocks from the acceptance of the first block to the last step taken.
    largest_error : float
        Largest distance of a point from its true curve, in steps.
    error_at : tuple of int
        The point of the largest error.
    block_errors : array of float, shape (blocks,)
        The largest error of every block, in steps; 0 for a block without steps.
    block_steps : array of int64, shape (blocks,)
        Steps taken in every block.
    reached : array of bool, shape (blocks,)
        Blocks whose end point was reached exactly with their last step; of those of no length, the
        ones answered by ``done`` without a step.
    done_ends : bool
        A block that moved may also end with its answer, ``done``, when no step of it was ``last``,
        as in two stages. False unless it is set before the first stretch.
    """

    def __init__(self, starts: np.ndarray, ends: np.ndarray, empty: np.ndarray):
        """Begin with nothing followed; ``empty`` tells the blocks of no length."""
        self.starts, self.ends = starts, ends
        self.steps = self.clocks = 0
        self.largest_error = 0.0
        self.error_at: tuple[int, ...] = tuple(starts[0].tolist())
        self.block_errors = np.zeros(len(starts))
        self.block_steps = np.zeros(len(starts), dtype=np.int64)
        self.reached = np.zeros(len(starts), dtype=bool)
        self.done_ends = False
        self._empty = empty
        #: Where the last step of every block has led.
        self._places = starts.copy()
        #: The blocks of which a step was the last one.
        self._closed = np.zeros(len(starts), dtype=bool)
        #: The clock of every block's last step; without one, of its answer.
        self._ended = np.zeros(len(starts), dtype=np.int64)
        self._accepted: int | None = None
        self._answered = 0
        #: The block of the last step, and what it has moved.
        self._block = 0
        self._moved = np.zeros(starts.shape[1], dtype=np.int64)

    @abstractmethod
    def errors(self, points: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        """Give the distances of points, shape (points, axes), from the curves of their blocks.

        ``blocks``, shape (points,), has the number of the block of each.
        """

    @property
    def ends_reached(self) -> int:
        """Blocks whose end point was reached."""
        return int(np.count_nonzero(self.reached))

    @property
    def block_clocks(self) -> np.ndarray:
        """Clocks from the last step of the block before to that of every block, shape (blocks,).

        From the acceptance for the first block; a block without steps ends with its answer. 0 where
        there is no answer yet. Together they are :attr:`clocks` when the last block has steps.
        """
        clocks = np.zeros(len(self.starts), dtype=np.int64)
        ended = self._ended[: self._answered]
        clocks[: len(ended)] = np.diff(ended, prepend=self._accepted or 0)
        return clocks

    def follow(self, stretch: Stretch) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Take in a stretch.

        Returns
        -------
        clocks : array of int64, shape (steps,)
            When each step was taken, counted from the acceptance of the first block.
        points : array of int64, shape (steps, axes)
            Where it led, in steps.
        errors : array of float, shape (steps,)
            Distance from the true curve, in steps.
        """
        axes, fields = self.starts.shape[1], len(EVENT_COLUMNS)
        column = dict(zip(EVENT_COLUMNS, stretch.events.T, strict=False))
        if self._accepted is None and len(stretch.events):
            self._accepted = int(column["clock"][0])
        accepted = self._accepted or 0

        answers = (column["done"] | column["error"]) != 0
        # A device that answers too often is not followed beyond the blocks there are.
        block = np.minimum(self._answered + np.cumsum(answers), len(self.starts) - 1)
        answered = np.minimum(self._answered + np.arange(answers.sum()), len(self.starts) - 1)
        self._answered += len(answered)

        taken = column["taken"] == 1
        when, which = column["clock"][taken], block[taken]
        points = self._points(which, stretch.events[taken, fields : fields + axes])
        errors = self.errors(points, which).astype(float)
        self._judge(which, points, errors)
        last = stretch.events[taken, fields + axes] == 1
        reached = np.all(points == self.ends[which], axis=1) & ~self._empty[which]
        self.reached[which[last]] = reached[last]
        self._closed[which[last]] = True
        self._ended[which] = when
        self._places[which] = points

        still = self.block_steps[answered] == 0
        self._ended[answered[still]] = column["clock"][answers][still]
        done = still & (column["done"][answers] == 1)
        self.reached[answered[done]] = self._empty[answered[done]]
        if self.done_ends:
            ended = answered[~still & ~self._closed[answered] & (column["done"][answers] == 1)]
            self.reached[ended] = np.all(self._places[ended] == self.ends[ended], axis=1)
        if len(when):
            self.clocks = int(when[-1]) - accepted
        return when - accepted, points, errors

    def _points(self, which: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """Give where every step led, from the blocks of the steps and from what they move."""
        if not len(which):
            return np.empty_like(moves)
        # What each block has moved: all moves so far less those before its first one.
        total = np.cumsum(moves, axis=0)
        moved = total - (total - moves)[np.searchsorted(which, which)]
        moved[which == self._block] += self._moved
        self._block, self._moved = int(which[-1]), moved[-1]
        return self.starts[which] + moved

    def _judge(self, which: np.ndarray, points: np.ndarray, errors: np.ndarray) -> None:
        """Count the steps and keep the largest errors."""
        if not len(which):
            return
        self.steps += len(which)
        first = np.flatnonzero(np.diff(which, prepend=-1))
        blocks, largest = which[first], np.maximum.reduceat(errors, first)
        self.block_steps[blocks] += np.diff(first, append=len(which))
        self.block_errors[blocks] = np.maximum(self.block_errors[blocks], largest)
        worst = int(np.argmax(errors))
        if errors[worst] > self.largest_error:
            self.largest_error = float(errors[worst])
            self.error_at = tuple(points[worst].tolist())


class LineContour(Contour):
    """Follows line blocks: the distance of a point is that from the line through start and end.

    Parameters
    ----------
    blocks : array of int64, shape (blocks, 2 × axes) or more columns
        Start and end of every line, in steps; then its timing, if it has one.
    axes : int or None
        None: there are no other columns.
    """

    def __init__(self, blocks: np.ndarray, axes: int | None = None):
        starts, ends = np.hsplit(blocks if axes is None else blocks[:, : 2 * axes], 2)
        super().__init__(starts, ends, np.all(starts == ends, axis=1))

    def errors(self, points: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        """Give the distances of points from the lines of their blocks."""
        starts = self.starts[blocks]
        return distance_from_line(points - starts, self.ends[blocks] - starts)


class ArcContour(Contour):
    """Follows arc blocks: the distance of a point is that from the circle of the start.

    The circle lies around the block's centre and goes through its start; an end that is off it by
    part of a step has that much of an error itself.

    Parameters
    ----------
    blocks : array of int64, shape (blocks, 8) or more columns
        See :mod:`discreta.sim.arcs`; then its timing, if it has one. With axes that move along the
        arc as :func:`~discreta.sim.constant_speed.plane` has them.
    axes : int
        Those beyond two are followed, but the distance is that in the plane.
    """

    def __init__(self, blocks: np.ndarray, axes: int = 2):
        arcs = plane(blocks, axes)
        super().__init__(blocks[:, :axes], blocks[:, axes : 2 * axes], is_empty(arcs))
        self.centers = arcs[:, 4:6]

    def errors(self, points: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        """Give the distances of points from the circles of their blocks."""
        centers = self.centers[blocks]
        return distance_from_circle(points[:, :2] - centers, self.starts[blocks, :2] - centers)


class ConicContour(Contour):
    """Follows blocks of second-order curves: the distance of a point is that from its whole curve.

    The curve goes through the block's start; an end that is off it by part of a step has that much
    of an error itself.

    Parameters
    ----------
    blocks : array of int64, shape (blocks, 11)
        See :mod:`discreta.sim.conics`.
    """

    def __init__(self, blocks: np.ndarray):
        starts, ends = blocks[:, 5:7], blocks[:, 7:9]
        super().__init__(starts, ends, np.all(starts == ends, axis=1) & (blocks[:, 10] == 0))
        # The values of a field side by side, which is quicker to work with.
        self._curves = np.ascontiguousarray(blocks[:, :7].T)

    def errors(self, points: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        """Give the distances of points from the curves of their blocks."""
        errors = np.empty(len(points))
        for first in range(0, len(points), _BATCH):
            part = slice(first, first + _BATCH)
            curves = self._curves[:, blocks[part]]
            errors[part] = distance(curves[:5].T, curves[5:].T, points[part])
        return errors


class ExactConicContour(ConicContour):
    """Follows blocks of the exact interpolator: the end of a block may be off its curve.

    It is not counted: between the curve and the point of the grid that is nearest to its end there
    may be √½ of a step.

    Parameters
    ----------
    blocks : array of int64, shape (blocks, 11)
        See :mod:`discreta.sim.conics`.
    """

    def errors(self, points: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        """Give the distances of points from the curves of their blocks, 0 for ends."""
        ends = np.all(points == self.ends[blocks], axis=1)
        return np.where(ends, 0.0, super().errors(points, blocks))
