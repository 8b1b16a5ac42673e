"""The path as a picture: the true lines, the staircase that was stepped, and the error along it."""

from pathlib import Path

import matplotlib as mpl
import numpy as np

__all__ = ["FORMATS", "PathPlot"]

FORMATS = (".png", ".svg")

#: Points above which the picture takes every second one, again and again: no eye misses them.
_ROOM = 1 << 17


class PathPlot:
    """Collects a path as it is stepped and draws it at the end.

    The first two axes are drawn. Where the whole path is large against one step, a window shows the
    place of the largest error step by step.

    Parameters
    ----------
    corners : array of int64, shape (points, axes)
        The support points of the true path, in steps.
    """

    def __init__(self, corners: np.ndarray):
        self._corners = corners[:, :2]
        self._points = [corners[:1, :2]]
        self._errors = [np.zeros(1)]
        self._stride = 1
        self._seen = 1
        self._kept = 1
        self._window: tuple[np.ndarray, np.ndarray] | None = None
        self._worst = -1.0

    def follow(self, points: np.ndarray, errors: np.ndarray) -> None:
        """Take in points, shape (steps, axes), and their distances from the true path, in steps."""
        if not len(points):
            return
        worst = int(np.argmax(errors))
        if errors[worst] > self._worst:
            self._worst = float(errors[worst])
            near = slice(max(0, worst - 12), worst + 13)
            self._window = points[near, :2].copy(), points[worst, :2].copy()
        keep = np.arange(-self._seen % self._stride, len(points), self._stride)
        self._seen += len(points)
        self._points.append(points[keep, :2])
        self._errors.append(errors[keep])
        self._kept += len(keep)
        if self._kept > _ROOM:
            self._points = [np.concatenate(self._points)[::2]]
            self._errors = [np.concatenate(self._errors)[::2]]
            self._kept = len(self._errors[0])
            self._stride *= 2

    def save(self, path: Path, kind: str, title: str) -> None:
        """Write the picture; ``kind`` is ``.png`` or ``.svg``."""
        from matplotlib.figure import Figure

        points, errors = np.concatenate(self._points), np.concatenate(self._errors)
        # The same path gives the same bytes: no date, and names that hang on nothing random.
        with mpl.rc_context({"svg.hashsalt": "discreta", "svg.fonttype": "none", "font.size": 9}):
            figure = Figure(figsize=(9, 6.5), dpi=110, layout="constrained")
            whole, near, along = figure.subplot_mosaic(
                [["path", "near"], ["error", "error"]],
                height_ratios=[3, 1],
                width_ratios=[1.7, 1],
            ).values()
            self._draw_path(whole, points)
            whole.set(title=title, xlabel="x, steps", ylabel="y, steps")
            self._draw_window(near)
            along.plot(np.arange(len(errors)) * self._stride, errors, color="#c0392b", lw=0.7)
            along.set(
                title="distance from the true path",
                xlabel="steps taken",
                ylabel="steps",
                ylim=(0, None),
            )
            along.margins(x=0)
            along.grid(alpha=0.3)
            metadata = {"Date": None} if kind == ".svg" else {"Software": None}
            figure.savefig(path, format=kind[1:], metadata=metadata)

    def _draw_path(self, axes, points: np.ndarray) -> None:
        axes.plot(*self._corners.T, color="#2c7fb8", lw=1.6, label="true path")
        axes.plot(*points.T, color="#222222", lw=0.7, label="steps taken")
        axes.plot(*self._corners[0], "o", color="#2ca02c", ms=8, label="start")
        axes.plot(*self._corners[-1], "s", color="#c0392b", ms=4, label="end")
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(alpha=0.3)
        axes.legend(loc="best", frameon=True, fontsize=8)

    def _draw_window(self, axes) -> None:
        if self._window is None:
            axes.set_axis_off()
            return
        points, worst = self._window
        axes.plot(*self._corners.T, color="#2c7fb8", lw=1.6)
        axes.plot(*points.T, "o-", color="#222222", lw=0.9, ms=3)
        axes.plot(*worst, "o", color="#c0392b", ms=6)
        axes.set_xlim(worst[0] - 7, worst[0] + 7)
        axes.set_ylim(worst[1] - 7, worst[1] + 7)
        axes.set_aspect("equal", adjustable="box")
        axes.set(
            title=f"largest error: {self._worst:.4f} step", xlabel="x, steps", ylabel="y, steps"
        )
        axes.grid(alpha=0.3)
