"""How far the points of the exact interpolator are from their curves, for docs/exact_conic.md.

``python docs/nearest.py WIDTH CURVES`` runs so many random curves of each kind, and whole ellipses
whose centres lie beside the grid, through the golden model and prints a table. Ends are left out:
they are where the blocks say. The RTL is proven equal to the golden model.
"""

import sys

import click
import numpy as np

from discreta.sim import conics
from discreta.sim.golden.exact_conic import ExactConic

FIELDS = (*"abcde", "start_x", "start_y", "end_x", "end_y", "clockwise", "turns")
SEED = 1


def ellipses(width: int, count: int) -> np.ndarray:
    """Draw whole ellipses; through a point of the grid their centres are anywhere."""
    random = np.random.default_rng(SEED)
    found: list[tuple[int, ...]] = []
    while len(found) < count:
        longer = 2**width * random.uniform(0.3, 0.9)
        angle = random.uniform(0, 360)
        found.append(
            conics.ellipse(
                random.integers(-3, 4, 2).tolist(),
                (longer, max(4.0, longer * random.uniform(0.3, 1))),
                random.uniform(0, 180),
                width,
                start_angle=angle,
                end_angle=angle,
                clockwise=bool(random.integers(2)),
            ).block
        )
    return np.array(found, dtype=np.int64)


def measure(blocks: np.ndarray, width: int) -> tuple[np.ndarray, int, int, int]:
    """Give the largest error of each block, steps, clocks in which blocks ran, and ends reached."""
    golden, rows = ExactConic(width), np.arange(len(blocks))
    state = {k: np.full(len(rows), value) for k, value in golden.reset().items()}
    place, errors = blocks[:, 5:7].copy(), np.zeros(len(rows))
    steps = clocks = reached = clock = 0
    while len(rows):
        out = golden.outputs(state)
        valid, last = out["steps_valid"] == 1, out["steps_last"] == 1
        place[rows] += np.stack([out["steps_x"], out["steps_y"]], axis=1)
        inner = rows[valid & ~last]
        off = conics.distance(blocks[inner, :5], blocks[inner, 5:7], place[inner])
        errors[inner] = np.fmax(errors[inner], off)
        steps, clocks = steps + int(valid.sum()), clocks + int(state["running"].sum())
        over = (out["done"] | out["error"]) != 0
        at_end = (place[rows] == blocks[rows, 7:9]).all(axis=1)
        reached += int((over & at_end & (out["done"] == 1)).sum())
        given = {f"blocks_{k}": column for k, column in zip(FIELDS, blocks[rows].T, strict=True)}
        state = golden.step(state, given | {"blocks_valid": int(clock == 0), "steps_ready": 1})
        state = {k: np.broadcast_to(value, len(rows))[~over] for k, value in state.items()}
        rows, clock = rows[~over], clock + 1
    return errors, steps, clocks, reached


def main() -> None:
    """Print the table."""
    width, count = int(sys.argv[1]), int(sys.argv[2])
    click.echo("| curves | largest error | above 0.5 | ends reached | clocks per step |")
    click.echo("|---|---|---|---|---|")
    for kind in (*conics.KINDS, "whole ellipse"):
        if kind == "whole ellipse":
            blocks = ellipses(width, min(count, 400))
        else:
            blocks = conics.random_blocks(kind, width, count, np.random.default_rng(SEED))
        errors, steps, clocks, reached = measure(blocks, width)
        above = int((errors > 0.5 + 1e-9).sum())
        title = f"{len(blocks)} {kind}s of {width} bits"
        ends = f"{reached} of {len(blocks)}"
        click.echo(f"| {title} | {errors.max():.4f} | {above} | {ends} | {clocks / steps:.4f} |")


if __name__ == "__main__":
    main()
