"""How far the steps are from the true lines, worked out as they come."""

from dataclasses import dataclass, field

import numpy as np

from discreta.sim.stretch import EVENT_COLUMNS, Stretch

__all__ = ["LineContour", "distance_from_line"]


def distance_from_line(points: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Give the distance of points from lines through the origin, in steps.

    Parameters
    ----------
    points, direction : arrays, shape (..., axes)
        In steps; no direction may be zero.
    """
    if max(np.abs(points).max(initial=0), np.abs(direction).max(initial=0)) >= 1 << 30:
        # Squares of these do not fit 64 bits; a long double has as many, and an exponent.
        points, direction = points.astype(np.longdouble), direction.astype(np.longdouble)
    length = np.sqrt(np.sum(direction * direction, axis=-1))
    axes = points.shape[-1]
    crosses = [
        points[..., i] * direction[..., k] - points[..., k] * direction[..., i]
        for i in range(axes)
        for k in range(i)
    ]
    if len(crosses) == 1:
        return np.abs(crosses[0]) / length
    return np.sqrt(sum(cross.astype(np.longdouble) ** 2 for cross in crosses)) / length


@dataclass
class LineContour:
    """Follows the steps of a run of line blocks and compares every point with its true line.

    Attributes
    ----------
    starts, ends : arrays of int64, shape (blocks, axes)
        The blocks, in steps.
    steps : int
        Steps taken; a step may move several axes.
    clocks : int
        Clocks from the acceptance of the first block to the last step taken.
    largest_error : float
        Largest distance of a point from its true line, in steps.
    error_at : tuple of int
        The point of the largest error.
    ends_reached : int
        Blocks whose end point was reached exactly with their last step.
    """

    starts: np.ndarray
    ends: np.ndarray
    steps: int = 0
    clocks: int = 0
    largest_error: float = 0.0
    error_at: tuple[int, ...] = ()
    ends_reached: int = 0
    _moving: np.ndarray = field(init=False)
    _block: int = field(init=False, default=0)
    _accepted: int | None = field(init=False, default=None)
    _moved: np.ndarray = field(init=False)

    def __post_init__(self):
        moves = np.any(self.starts != self.ends, axis=1)
        self._moving = np.flatnonzero(moves)
        self.ends_reached = int(np.count_nonzero(~moves))
        self._moved = np.zeros(self.starts.shape[1], dtype=np.int64)
        self.error_at = tuple(self.starts[0].tolist())

    def follow(self, stretch: Stretch) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Take in a stretch.

        Returns
        -------
        clocks : array of int64, shape (steps,)
            When each step was taken, counted from the acceptance of the first block.
        points : array of int64, shape (steps, axes)
            Where it led, in steps.
        errors : array of float, shape (steps,)
            Distance from the true line, in steps.
        """
        axes = self.starts.shape[1]
        fields = len(EVENT_COLUMNS)
        column = {name: index for index, name in enumerate(EVENT_COLUMNS)}
        events = stretch.events
        if self._accepted is None and len(events):
            self._accepted = int(events[0, column["clock"]])
        taken = events[events[:, column["taken"]] == 1]
        if not len(taken):
            return np.empty(0, np.int64), np.empty((0, axes), np.int64), np.empty(0)
        assert self._accepted is not None
        clocks = taken[:, column["clock"]] - self._accepted
        moves = taken[:, fields : fields + axes]
        last = taken[:, fields + axes]

        order = self._block + np.cumsum(last) - last
        which = self._moving[order]
        starts, ends = self.starts[which], self.ends[which]
        # What each block has moved: all moves so far less those before its first one.
        total = np.cumsum(moves, axis=0)
        begins = np.searchsorted(order, order)
        moved = total - (total - moves)[begins]
        moved[order == self._block] += self._moved
        points = starts + moved

        errors = distance_from_line(points - starts, ends - starts)
        worst = int(np.argmax(errors))
        if errors[worst] > self.largest_error:
            self.largest_error = float(errors[worst])
            self.error_at = tuple(points[worst].tolist())
        self.steps += len(taken)
        self.clocks = int(clocks[-1])
        reached = np.all(points == ends, axis=1)
        self.ends_reached += int(np.count_nonzero(reached & (last == 1)))
        self._block = int(order[-1] + last[-1])
        self._moved = np.zeros_like(self._moved) if last[-1] else moved[-1]
        return clocks, points, errors.astype(float)
