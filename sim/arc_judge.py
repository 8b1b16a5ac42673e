"""Judges the steps of exact arcs in C++: billions of them.

A loop in ``arc_judge.cc`` keeps for every block the farthest point outside the circle and the
farthest one inside, by X² + Y² − R², which is a whole number; whether a step led back; whether the
end was reached. The distances of these points are worked out afterwards. The end of a block may be
off the circle, by part of a step, and is not counted; a step back, against the way round, counts as
infinitely far.
"""

import ctypes
from functools import cache
from pathlib import Path

import numpy as np

from discreta.sim.arcs import is_empty, seen_from_center
from discreta.sim.compiled import shared_library
from discreta.sim.contour import distance_from_circle
from discreta.sim.stretch import EVENT_COLUMNS, Stretch

__all__ = ["ArcJudge"]

_SOURCE = Path(__file__).with_name("arc_judge.cc")

_POINT = np.dtype([(name, np.int64) for name in ("x", "y", "off")])
_ARC = np.dtype(
    [
        *((name, np.int64) for name in ("end_x", "end_y", "side", "empty")),
        *((name, _POINT) for name in ("here", "outside", "inside", "back")),
        *((name, np.int64) for name in ("backward", "steps", "reached")),
    ]
)


@cache
def _library() -> ctypes.CDLL:
    source = _SOURCE.read_text()
    call = ctypes.CDLL(str(shared_library(source, lambda: source)))
    call.judge.restype = ctypes.c_uint64
    return call


class ArcJudge:
    """Follows arc blocks of the exact interpolator, as a :class:`~discreta.sim.contour.Contour`.

    Parameters
    ----------
    blocks : array of int64, shape (blocks, 8)
        See :mod:`discreta.sim.arcs`; coordinates up to 2^30.

    Attributes
    ----------
    block_steps, block_errors, reached, largest_error, error_at
        Those of a ``Contour``.

    Raises
    ------
    RuntimeError
        There is no C++ compiler.
    """

    def __init__(self, blocks: np.ndarray):
        self._arcs = np.zeros(len(blocks), dtype=_ARC)
        self._starts, ends = seen_from_center(blocks)
        self._centers = blocks[:, 4:6]
        self._arcs["end_x"], self._arcs["end_y"] = ends.T
        self._arcs["side"] = np.where(blocks[:, 6] == 1, -1, 1)
        self._arcs["empty"] = is_empty(blocks)
        for point in ("here", "outside", "inside"):
            self._arcs[point]["x"], self._arcs[point]["y"] = self._starts.T
        self._answered = 0
        self._judge = _library().judge

    def follow(self, stretch: Stretch) -> None:
        """Take in a stretch."""
        events = np.ascontiguousarray(stretch.events, dtype=np.int64)
        assert events.shape[1] == len(EVENT_COLUMNS) + 3  # x, y and last
        self._answered = self._judge(
            ctypes.c_void_p(self._arcs.ctypes.data),
            ctypes.c_uint64(len(self._arcs)),
            ctypes.c_uint64(self._answered),
            ctypes.c_void_p(events.ctypes.data),
            ctypes.c_uint64(len(events)),
        )

    @property
    def block_steps(self) -> np.ndarray:
        """Steps taken in every block."""
        return self._arcs["steps"]

    @property
    def reached(self) -> np.ndarray:
        """Blocks whose end point was reached exactly with their last step, or had no length."""
        return self._arcs["reached"] == 1

    @property
    def block_errors(self) -> np.ndarray:
        """The largest error of every block, in steps: infinite where a step led back."""
        return self._farthest()[0]

    @property
    def largest_error(self) -> float:
        """The largest error of all."""
        return float(self.block_errors.max())

    @property
    def error_at(self) -> tuple[int, ...]:
        """The point of the largest error."""
        errors, points = self._farthest()
        worst = int(np.argmax(errors))
        return tuple((self._centers[worst] + points[worst]).tolist())

    def _farthest(self) -> tuple[np.ndarray, np.ndarray]:
        """Give errors, shape (blocks,), and points seen from the centres, shape (blocks, 2)."""
        points = np.stack(
            [
                np.stack([self._arcs[name]["x"], self._arcs[name]["y"]], axis=1)
                for name in ("outside", "inside", "back")
            ]
        )
        errors = distance_from_circle(points, self._starts).astype(float)
        errors[2] = np.where(self._arcs["backward"] == 1, np.inf, 0.0)
        worst, every = np.argmax(errors, axis=0), np.arange(len(self._arcs))
        return errors[worst, every], points[worst, every]
