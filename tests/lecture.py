"""The lecture's circular algorithm as it is printed, in its own cells, and what becomes of it.

``python -m tests.lecture --start 20,0 --end 0,20`` runs one arc of the first quadrant and tells how
it goes; ``python -m tests.lecture --count`` runs all arcs between whole degrees. One sign is an
erratum, and two things can be read in two ways:

- **sign**: step 9.1 is ``printed`` XT = XT + 1. KOX = XH − XK and x' = −ky ask for ``minus``.
- **order**: in the ``steps``, step 10 adds the XT that step 9.1 has just changed. In the ``device``
  of the block diagram both summators add at the same clock pulse.
- **check**: step 7 is "check for the end" and no more. In exercise 3's ``program`` an axis is
  summed only while it has steps left. In the lecture's ``text`` the end is when both counters are
  0, and until then both axes are summed.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from math import cos, floor, hypot, radians, sin

import click
import numpy as np

__all__ = [
    "CHECKS",
    "ENDS",
    "LEAVES",
    "ORDERS",
    "SIGNS",
    "WAITS",
    "Cells",
    "Reading",
    "Run",
    "degree_arcs",
    "run",
    "run_all",
]

SIGNS, ORDERS, CHECKS = ("minus", "printed"), ("steps", "device"), ("program", "text")

#: What becomes of an arc: it ends, nothing changes any more, or a coordinate does not fit its cell.
ENDS, WAITS, LEAVES = FATES = ("ends", "waits for ever", "leaves the quadrant")

Point = tuple[int, int]


@dataclass(frozen=True)
class Reading:
    """How the lecture is read."""

    sign: str = "minus"
    order: str = "steps"
    check: str = "program"


@dataclass(frozen=True)
class Cells:
    """What the algorithm's cells hold, all of n bits."""

    xt: int
    yt: int
    kox: int
    koy: int
    sx: int
    sy: int


def prepare(start: Point, end: Point) -> Cells:
    """Do steps 1 to 3."""
    return Cells(xt=start[0], yt=start[1], kox=start[0] - end[0], koy=end[1] - start[1], sx=0, sy=0)


def summation(cells: Cells, width: int, reading: Reading) -> Cells:
    """Do steps 8 to 10 once; a coordinate that left its cell is left as it is, to be seen."""
    modulus = 2**width
    xt, yt, kox, koy, sx, sy = cells.xt, cells.yt, cells.kox, cells.koy, cells.sx, cells.sy
    if kox != 0 or reading.check == "text":
        sx = sx + yt  # 8
        if sx >= modulus:  # 9, 9.1
            sx = sx - modulus
            xt = xt + 1 if reading.sign == "printed" else xt - 1
            kox = (kox - 1) % modulus
    if koy != 0 or reading.check == "text":
        sy = sy + (xt if reading.order == "steps" else cells.xt) % modulus  # 10
        if sy >= modulus:  # 10.1
            sy = sy - modulus
            yt = yt + 1
            koy = (koy - 1) % modulus
    return Cells(xt, yt, kox, koy, sx, sy)


@dataclass(frozen=True)
class Run:
    """What became of an arc.

    Attributes
    ----------
    fate : str
        ``ENDS``, ``WAITS`` or ``LEAVES``.
    cells : list of Cells
        Before the first summation and after every one; the last has what is left.
    error : float
        Largest distance from the circle of the start, in steps.
    """

    fate: str
    cells: list[Cells]
    error: float


def run(start: Point, end: Point, width: int = 8, reading: Reading = Reading()) -> Run:
    """Run one arc of the first quadrant until its fate is known."""
    cells = [prepare(start, end)]
    while True:
        # 4, 5, 6 wait until the step is made, 7 checks for the end.
        now = cells[-1]
        if now.kox == 0 and now.koy == 0:
            fate = ENDS
        elif not (0 <= now.xt < 2**width and 0 <= now.yt < 2**width):
            fate = LEAVES
        elif len(cells) > 1 and now == cells[-2]:
            fate = WAITS
        else:
            cells.append(summation(now, width, reading))
            continue
        radius = hypot(*start)
        return Run(fate, cells, max(abs(hypot(at.xt, at.yt) - radius) for at in cells))


def run_all(
    arcs: np.ndarray, width: int = 8, reading: Reading = Reading()
) -> tuple[np.ndarray, np.ndarray]:
    """Do as :func:`run` with many arcs at a time.

    Parameters
    ----------
    arcs : array of int64, shape (arcs, 4)
        XH, YH, XK, YK.

    Returns
    -------
    fates : array of int64, shape (arcs,)
        Numbers in ``FATES``.
    cells : array of int64, shape (arcs, 7)
        The last cells, and the summations until then.
    """
    fits = 2**width - 1
    fates = np.zeros(len(arcs), dtype=np.int64)
    last = np.zeros((len(arcs), 7), dtype=np.int64)
    xh, yh, xk, yk = arcs.T.astype(np.int32)
    cells = np.stack([xh, yh, xh - xk, yk - yh, 0 * xh, 0 * yh])
    which, count = np.arange(len(arcs)), 0
    still = np.zeros(len(arcs), dtype=bool)
    while len(which):
        xt, yt, kox, koy, sx, sy = cells
        ends = (kox == 0) & (koy == 0)
        leaves = (xt < 0) | (xt > fits) | (yt > fits)
        known = ends | leaves | still
        fates[which[known]] = np.select([ends, leaves], [0, 2], 1)[known]
        last[which[known], :6], last[which[known], 6] = cells[:, known].T, count
        which, before = which[~known], cells[:, ~known]
        xt, yt, kox, koy, sx, sy = before
        # A cell of n bits holds x & (2^n − 1); what is above is the carry.
        sx = sx + (yt if reading.check == "text" else np.where(kox != 0, yt, 0))
        carry_x = sx >> width
        x_after = xt + carry_x if reading.sign == "printed" else xt - carry_x
        added = x_after & fits if reading.order == "steps" else xt
        sy = sy + (added if reading.check == "text" else np.where(koy != 0, added, 0))
        carry_y = sy >> width
        kox, koy = (kox - carry_x) & fits, (koy - carry_y) & fits
        cells = np.stack([x_after, yt + carry_y, kox, koy, sx & fits, sy & fits])
        still = np.all(cells == before, axis=0)
        count += 1
    return fates, last


def nearest(radius: int, degree: int) -> Point:
    """Give the lattice point nearest to a degree of a circle; halves are rounded outwards."""
    # R·cos 60° is half a step for every odd R, or a little less by the rounding of the cosine.
    x, y = (floor(radius * f(radians(degree)) + 0.5 + 1e-9) for f in (cos, sin))
    return x, y


def degree_arcs() -> Iterator[tuple[int, int, int, int]]:
    """Yield the arcs between the points of two different degrees, 0 to 90, R = 2, 5 … 197."""
    for radius in range(2, 200, 3):
        points = [nearest(radius, degree) for degree in range(91)]
        for start, end in combinations(points, 2):
            if start != end:
                yield *start, *end


def off_circle(arcs: np.ndarray) -> np.ndarray:
    """Tell the arcs whose end is more than one step off the circle of the start, exactly."""
    start, end = np.square(arcs[:, :2]).sum(axis=1), np.square(arcs[:, 2:]).sum(axis=1)
    # √b > √a + 1 means b − a − 1 > 2√a.
    low, apart = np.minimum(start, end), np.abs(end - start) - 1
    return (apart > 0) & (apart * apart > 4 * low)


def count() -> None:
    """Tell what becomes of all arcs between whole degrees, as the lecture is read."""
    arcs = np.array(list(degree_arcs()))
    far = off_circle(arcs)
    click.echo(
        f"{len(arcs)} arcs, 8 bits; {np.count_nonzero(far)} of them end more than a step off the "
        "circle of their start"
    )
    for reading in (
        Reading(order="device"),
        Reading(),
        Reading(check="text"),
        Reading(sign="printed"),
    ):
        fates, last = run_all(arcs, 8, reading)
        reached = (fates == 0) & np.all(last[:, :2] == arcs[:, 2:], axis=1)
        waits = fates == 1
        share = 100 * np.count_nonzero(waits) / len(arcs)
        click.echo(f"sign {reading.sign}, order {reading.order}, check {reading.check}:")
        click.echo(
            f"  {np.count_nonzero(reached)} end on their end point, "
            f"{np.count_nonzero((fates == 0) & ~reached)} elsewhere, "
            f"{np.count_nonzero(fates == 2)} leave the quadrant"
        )
        click.echo(f"  {np.count_nonzero(waits)} wait for ever, {share:.2f} %")
        for index in np.flatnonzero(waits)[:1]:
            xh, yh, xk, yk = arcs[index].tolist()
            click.echo(f"  the first of these: --start {xh},{yh} --end {xk},{yk}")


class _Point(click.ParamType):
    name = "X,Y"

    def convert(self, value: str, param, ctx) -> Point:
        try:
            x, y = map(int, value.split(","))
        except ValueError:
            self.fail(f"{value!r} is not a point: give two whole numbers, like 20,0", param, ctx)
        return x, y


@click.command()
@click.option("--count", "counts", is_flag=True, help="Run all arcs between whole degrees.")
@click.option("--start", type=_Point(), help="XH,YH, seen from the center.")
@click.option("--end", type=_Point(), help="XK,YK: no farther right and no lower.")
@click.option("--width", type=click.IntRange(4, 16), default=8, show_default=True)
@click.option("--sign", type=click.Choice(SIGNS), default=SIGNS[0], show_default=True)
@click.option("--order", type=click.Choice(ORDERS), default=ORDERS[0], show_default=True)
@click.option("--check", type=click.Choice(CHECKS), default=CHECKS[0], show_default=True)
def main(
    counts: bool,
    start: Point | None,
    end: Point | None,
    width: int,
    sign: str,
    order: str,
    check: str,
) -> None:
    """Run the lecture's circular algorithm as it is printed.

    Example: python -m tests.lecture --start 20,0 --end 0,20
    """
    if counts:
        count()
        return
    if start is None or end is None:
        raise click.UsageError("give --start and --end, or --count")
    if not (0 <= end[0] <= start[0] < 2**width and 0 <= start[1] <= end[1] < 2**width):
        raise click.UsageError(
            f"the lecture's arcs lead from {start} to the left and upwards in quadrant I, within "
            f"{width} bits: give such an end, or more bits"
        )
    result = run(start, end, width, Reading(sign, order, check))
    last = result.cells[-1]
    where = "on its end point" if (last.xt, last.yt) == end else "NOT on its end point"
    click.echo(
        f"{result.fate} after {len(result.cells) - 1} summations at {last.xt},{last.yt}, {where}, "
        f"with KOX = {last.kox}, KOY = {last.koy}, SX = {last.sx}, SY = {last.sy}"
    )
    click.echo(f"largest distance from the circle {result.error:.4f} steps")


if __name__ == "__main__":
    main()
