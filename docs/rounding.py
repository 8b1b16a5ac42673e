"""How far arcs in G-code are from their steps, rounding and all, for docs/gcode.md.

``python docs/rounding.py ARCS`` writes so many random arcs of each sort as G-code with three places
behind the point, reads them at 80 steps a mm, runs them through the compiled RTL, and compares
every point with the programmed curve.
"""

import sys
from collections import Counter
from dataclasses import dataclass
from fractions import Fraction
from math import cos, pi, sin

import click
import numpy as np

from discreta.sim.gcode import Move, moves_of
from discreta.sim.points import BadInputError
from discreta.sim.program import Cores, Program

SEED, WIDTH, STEPS_PER_MM = 1, 20, 80


@dataclass(frozen=True)
class Sort:
    """A sort of arcs: radii in mm, drawn evenly by their logarithm, and sweeps in radians.

    ``steps``: the longest, in steps, which limits the sweep; ``by_radius``: written with R.
    """

    title: str
    radii: tuple[float, float] = (0.5, 20.0)
    sweeps: tuple[float, float] = (0.01, 2 * pi - 0.01)
    steps: float | None = None
    by_radius: bool = False


SORTS = (
    Sort("whole circles", sweeps=(2 * pi, 2 * pi)),
    Sort("arcs by I and J"),
    Sort("arcs by R", by_radius=True),
    Sort("half turns by I and J", sweeps=(pi, pi)),
    Sort("half turns by R", sweeps=(pi, pi), by_radius=True),
    Sort("arcs up to 10 steps long", radii=(1.0, 100.0), steps=10),
    Sort("circles of up to 8 steps radius", radii=(0.01, 0.1), sweeps=(2 * pi, 2 * pi)),
)


def written(sort: Sort, random: np.random.Generator) -> list[str]:
    """Write an arc in two lines: a rapid to its start, and itself."""
    x, y = random.uniform(-20, 20, 2)
    radius = float(np.exp(random.uniform(*np.log(sort.radii))))
    begin, sweep = random.uniform(0, 2 * pi), random.uniform(*sort.sweeps)
    if sort.steps:
        sweep = min(2 * pi, random.uniform(0, sort.steps) / STEPS_PER_MM / radius)
    clockwise = bool(random.integers(2))
    ends = [
        (round(x + radius * cos(angle), 3), round(y + radius * sin(angle), 3))
        for angle in (begin, begin + (-sweep if clockwise else sweep))
    ]
    (a, b), (u, v) = ends
    by = f"I{x - a:.3f} J{y - b:.3f}"
    if sort.by_radius:
        by = f"R{-radius if sweep > pi else radius:.3f}"
    word = "G2" if clockwise else "G3"
    return [f"G0 X{a:.3f} Y{b:.3f}", f"{word} X{u:.3f} Y{v:.3f} {by}"]


def read(lines: list[str]) -> list[Move]:
    """Read some lines as a program."""
    text = ["G21 G90 F600", *lines, "M2"]
    return moves_of(text, "random", [Fraction(STEPS_PER_MM)] * 3, WIDTH)


def measure(sort: Sort, count: int) -> tuple[Counter, np.ndarray, int]:
    """Give what became of the arcs, the largest errors of those that are arcs, and ends missed."""
    random = np.random.default_rng(SEED)
    became: Counter = Counter()
    moves: list[Move] = []
    while became.total() < count:
        try:
            made = [move for move in read(written(sort, random)) if move.line_number == 3]
        except BadInputError:
            became["refused"] += 1
            continue
        became[made[0].kind if made else "nothing"] += 1
        moves += made
    program = Program(moves)
    cores = Cores(program, WIDTH)
    cores.run("compiled")
    errors = [program.errors(number, points).max() for number, _, points in cores]
    return became, np.array(errors), len(moves) - cores.ends_reached


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1])
    heads = ("sort", "arcs", "no step", "refused", "mean", "99 %", "largest", "ends missed")
    click.echo(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    for sort in SORTS:
        became, errors, missed = measure(sort, count)
        counts = [became[kind] for kind in ("arc", "nothing", "refused")]
        off = [errors.mean(), np.quantile(errors, 0.99), errors.max()]
        cells = [sort.title, *map(str, counts), *(f"{value:.3f}" for value in off), str(missed)]
        click.echo(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
