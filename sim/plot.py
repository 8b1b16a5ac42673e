"""The path as a picture: the true curve, the staircase that was stepped, and the error along it."""

from pathlib import Path

import numpy as np

from discreta.hdl.contract import AXIS_LETTERS
from discreta.sim.curves import Drawn
from discreta.sim.points import BadInputError

__all__ = ["FORMATS", "PathPlot", "picture_format"]

FORMATS = (".png", ".svg")

#: Points above which the staircase takes every second one, again and again: no eye misses them.
_POINTS = 1 << 17

#: Columns of the error's curve: with more steps each has the largest error of several.
_COLUMNS = 1 << 11

#: Half the side of the window at the largest error, in steps, and the steps kept on either side of
#: it: half a turn of the largest circle whose other side the window can show.
_SIDE, _NEAR = 7, 28

#: Periods up to which each has a dot.
_DOTS = 400

#: Letters of a title in the common size; of longer ones they are smaller.
_TITLE = 56


def picture_format(option: str, name: str | None) -> str:
    """Give the ending of a picture's name, which says its format; "" without one.

    ``option`` is what asks for the picture.

    Raises
    ------
    BadInputError
        There is no such format.
    """
    if name is None:
        return ""
    ending = Path(name).suffix.lower()
    if ending not in FORMATS:
        raise BadInputError(f"{option} {name}: choose a name that ends in {' or '.join(FORMATS)}")
    return ending


class PathPlot:
    """Collects a path as it is stepped and draws it at the end.

    The first two axes are drawn. A window shows the place of the largest error step by step.

    Parameters
    ----------
    curve : Drawn
        The true path.
    periods : bool
        A point is where a whole period led: what it moved along both axes is drawn as well.
    """

    def __init__(self, curve: Drawn, *, periods: bool = False):
        self._curve = curve
        self._periods = periods
        self._seen = 1
        self._recent = curve.start[None, :2]
        # Every stride-th point.
        self._points = [self._recent]
        self._kept = self._stride = 1
        # The largest of every span of errors.
        self._errors = np.zeros(_COLUMNS)
        self._span = 1
        # What every span has moved, x and y.
        self._moves = np.zeros((2, _COLUMNS), dtype=np.int64)
        self._worst = -1.0
        self._window = np.empty((0, 2), dtype=np.int64)
        self._center: np.ndarray | None = None
        self._awaited = 0

    def follow(self, points: np.ndarray, errors: np.ndarray) -> None:
        """Take in points, shape (steps, axes), and their distances from the true path, in steps."""
        if not len(points):
            return
        points = points[:, :2]
        moves = np.diff(points, axis=0, prepend=self._recent[-1:])
        self._follow_worst(points, errors)
        index = np.arange(self._seen, self._seen + len(points))
        self._seen += len(points)

        kept = points[index % self._stride == 0]
        self._points.append(kept)
        self._kept += len(kept)
        while self._kept > _POINTS:
            self._points = [np.concatenate(self._points)[::2]]
            self._kept = len(self._points[0])
            self._stride *= 2

        while self._seen > _COLUMNS * self._span:
            halves = self._errors.reshape(-1, 2).max(axis=1)
            self._errors = np.concatenate([halves, np.zeros_like(halves)])
            sums = self._moves.reshape(2, -1, 2).sum(axis=2)
            self._moves = np.concatenate([sums, np.zeros_like(sums)], axis=1)
            self._span *= 2
        np.maximum.at(self._errors, index // self._span, errors)
        for total, moved in zip(self._moves, moves.T, strict=True):
            np.add.at(total, index // self._span, moved)

    def _follow_worst(self, points: np.ndarray, errors: np.ndarray) -> None:
        """Keep the points around the largest error, also when they come in two parts."""
        if self._awaited:
            self._window = np.concatenate([self._window, points[: self._awaited]])
            self._awaited = max(0, self._awaited - len(points))
        behind = len(self._recent)
        points = np.concatenate([self._recent, points])
        worst = int(np.argmax(errors))
        if errors[worst] > self._worst:
            self._worst = float(errors[worst])
            worst += behind
            self._center = points[worst]
            self._window = points[max(0, worst - _NEAR) : worst + _NEAR + 1]
            self._awaited = max(0, worst + _NEAR + 1 - len(points))
        self._recent = points[-_NEAR:]

    def save(self, path: Path, kind: str, title: str) -> None:
        """Write the picture; ``kind`` is ``.png`` or ``.svg``."""
        # Not needed, and half the start, of a command that draws nothing.
        from matplotlib import style
        from matplotlib.figure import Figure

        # The same path gives the same bytes: no one's own settings, no date, no random names.
        own = {"svg.hashsalt": "discreta", "svg.fonttype": "none", "font.size": 9}
        with style.context(["default", own]):
            figure = Figure(figsize=(9, 6.5), dpi=110, layout="constrained")
            rows = ["moves", "error"] if self._periods else ["error"]
            panels = figure.subplot_mosaic(
                [["path", "near"], *([row, row] for row in rows)],
                height_ratios=[3, *(1 for _ in rows)],
                width_ratios=[1.7, 1],
            )
            whole, near, along = (panels[name] for name in ("path", "near", "error"))
            if self._curve.axes > 2:
                title += f"; x and y of {AXIS_LETTERS[: self._curve.axes]}"
            self._draw_path(whole, title)
            self._draw_window(near)
            handles = whole.get_lines()
            if self._periods:
                handles += self._draw_moves(panels["moves"])
            self._draw_errors(along)
            figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
            metadata = {"Date": None} if kind == ".svg" else {"Software": None}
            figure.savefig(path, format=kind[1:], metadata=metadata)

    def _draw_path(self, axes, title: str) -> None:
        points = np.concatenate(self._points)
        if self._stride > 1:
            points = np.concatenate([points, self._recent[-1:]])
        true = self._curve.outline()[:, :2]
        axes.plot(*true.T, color="#2c7fb8", lw=1.6, label="true path", gid="true")
        if self._periods:
            style, label = "o-" if len(points) <= _DOTS else "-", "periods"
        else:
            style, label = "-", "steps taken"
        axes.plot(*points.T, style, color="#222222", lw=0.7, ms=2, label=label, gid="steps")
        axes.plot(*self._curve.start[:2], "o", color="#2ca02c", ms=8, label="start")
        axes.plot(*points[-1], "s", color="#c0392b", ms=4, label="end")
        axes.set_aspect("equal", adjustable="datalim")
        axes.set(title=title, xlabel="x, steps", ylabel="y, steps")
        axes.title.set_fontsize(axes.title.get_fontsize() * min(1, _TITLE / len(title)))
        axes.locator_params(integer=True)
        axes.grid(alpha=0.3)

    def _draw_window(self, axes) -> None:
        if self._center is None:
            axes.set_axis_off()
            return
        x, y = self._center
        true = self._curve.near(self._center, 2 * _SIDE)[:, :2]
        axes.plot(*true.T, color="#2c7fb8", lw=1.6, gid="true-near")
        axes.plot(*self._window.T, "o-", color="#222222", lw=0.9, ms=3, gid="near")
        axes.plot(x, y, "o", color="#c0392b", ms=6)
        axes.set_aspect("equal", adjustable="box")
        axes.set(
            title=f"largest error: {self._worst:.4f} step",
            xlabel="x, steps",
            ylabel="y, steps",
            xlim=(x - _SIDE, x + _SIDE),
            ylim=(y - _SIDE, y + _SIDE),
        )
        # Long numbers are written out, and fewer.
        axes.locator_params(integer=True, nbins=5 if max(abs(x), abs(y)) < 10**6 else 3)
        axes.ticklabel_format(useOffset=False, style="plain")
        axes.grid(alpha=0.3)

    def _draw_moves(self, axes) -> list:
        last = self._seen - 1
        # Point number 0 is the start; the period before number 1 is the first.
        edges = np.clip(np.arange(-(-self._seen // self._span) + 1) * self._span - 1, 0, last)
        periods = np.diff(edges)
        edges, some = np.unique(edges), periods > 0
        each = f", the mean of every {self._span}" if self._span > 1 else ""
        drawn = []
        for name, total, color in zip("xy", self._moves, ("#7b3294", "#e08214"), strict=True):
            mean = total[: len(periods)][some] / periods[some]
            if len(mean):
                label, gid = f"steps along {name}", f"moves-{name}"
                line = {"color": color, "lw": 1.2, "label": label, "gid": gid}
                drawn.append(axes.stairs(mean, edges, baseline=None, **line))
        axes.axhline(0, color="#888888", lw=0.5)
        axes.set(title=f"steps per period{each}", xlabel="periods", ylabel="steps")
        axes.locator_params(axis="x", integer=True)
        axes.use_sticky_edges = False
        axes.margins(x=0, y=0.1)
        axes.grid(alpha=0.3)
        return drawn

    def _draw_errors(self, axes) -> None:
        errors = self._errors[: -(-self._seen // self._span)]
        what = "periods" if self._periods else "steps"
        each = f", the largest of every {self._span} {what}" if self._span > 1 else ""
        axes.plot(np.arange(len(errors)) * self._span, errors, color="#c0392b", lw=0.7, gid="error")
        axes.set(
            title=f"distance from the true path{each}",
            xlabel="periods" if self._periods else "steps taken",
            ylabel="steps",
            ylim=(0, None),
        )
        axes.locator_params(axis="x", integer=True)
        axes.margins(x=0)
        axes.grid(alpha=0.3)
