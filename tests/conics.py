"""Curves of the second order worked out from the documents alone, for comparison.

A block is (a, b, c, d, e, start x, start y, end x, end y, clockwise, turns). Nothing is updated:
derivatives and velocities are worked out from their definitions, wherever they are asked for.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from discreta.sim import conics

SHARP = 3

FIELDS = (*"abcde", "start_x", "start_y", "end_x", "end_y", "clockwise", "turns")
LECTURE = {"order": "simultaneous", "preload": "zero", "guard": 0}

Point = tuple[int, int]

#: Whose last step lands on the end while a change of direction is still to come.
LANDS = (0, 0, 27, 4884, 3362, -232, -61, -232, -63, 1, 1)


def derivatives(block: Sequence[int], point: Any) -> tuple[Any, Any]:
    """Give Gx = 2A·x + B·y + D and Gy = B·x + 2C·y + E; of many points with x and y as arrays."""
    a, b, c, d, e = block[:5]
    x, y = point
    return 2 * a * x + b * y + d, b * x + 2 * c * y + e


def velocity(block: Sequence[int], point: Sequence[int]) -> tuple[int, int]:
    """Give x' = −Gy and y' = Gx, or clockwise the opposite."""
    gx, gy = derivatives(block, point)
    return (gy, -gx) if block[9] else (-gy, gx)


def is_empty(block: Sequence[int]) -> bool:
    """Tell whether a block has nothing to do."""
    return block[5:7] == block[7:9] and not block[10]


def fault(block: Sequence[int]) -> int:
    """Tell with which code a block is refused; 0: it is run."""
    gradient = sum(map(abs, derivatives(block, block[5:7])))
    sharp = gradient == 0 or gradient < 4 * sum(map(abs, block[:3]))
    return SHARP if sharp and not is_empty(block) else 0


def first_way(block: Sequence[int]) -> list[int]:
    """Tell whether x, and y, rise (1) or fall (−1) in the first piece.

    An axis that stands still at first goes where the velocity turns to: to the left, or clockwise
    to the right.
    """
    x, y = velocity(block, block[5:7])
    left, right = (-y, x), (y, -x)
    aside = right if block[9] else left
    return [1 if (now or then) > 0 else -1 for now, then in zip((x, y), aside, strict=True)]


def conic_steps(
    block: Sequence[int],
    *,
    width: int,
    order: str = "implicit",
    preload: str = "half",
    guard: int = 2,
) -> Iterator[tuple[int, Point]]:
    """Yield (clock, point) of every step of a block that is run, if no step of it has to wait.

    The block is accepted in clock 0.
    """
    modulus = 2 ** (2 * width + 6 + guard)
    preset = {"zero": 0, "half": modulus // 2}[preload]
    largest = 2 ** (2 * width + 6)
    a, b, c = block[:3]
    point, end = list(block[5:7]), list(block[7:9])
    to_come = block[10]
    way = first_way(block)
    sums = [preset if w > 0 else modulus - 1 - preset for w in way]
    clock = width + 4
    # The scale of the last summation of both axes, below which it stays; none counts for circles.
    scale_before, fresh = 0, True
    limited = order != "simultaneous" and (b != 0 or a != c)

    while True:
        clock += 1
        assert clock < 1_000_000
        target = [2**width - 1 if w > 0 else -(2**width) for w in way] if to_come else end
        speeds = velocity(block, point)
        goes = [speed * w > 0 for speed, w in zip(speeds, way, strict=True)]
        able = [
            goes[k] and (target[k] - point[k]) * way[k] > 0  # neither there nor beyond it
            for k in (0, 1)
        ]
        # Counter-clockwise the velocity turns to the left: between +x and +y it comes to +y.
        faster = 1 if (way[0] == way[1]) != bool(block[9]) else 0
        slower = 1 - faster
        gx, gy = derivatives(block, point)
        most = scale_before if limited and all(able) and scale_before else largest
        scale = 1
        together = (gx * able[1], gy * able[0], 2 * a, b, 2 * c)
        while any(together) and all(-largest <= 2 * scale * g < largest for g in together):
            if scale == most:
                break
            scale *= 2
        if to_come and not (goes[slower] and any(able)):
            way[slower] = -way[slower]
            to_come -= 1
            if not to_come and point == end:
                return
            continue

        before = list(point)
        first = 0 if order == "simultaneous" else faster
        for k in (first, 1 - first):
            if not any(able) and not to_come:
                point[k] += (end[k] > point[k]) - (end[k] < point[k])
            elif able[k]:
                at = before if order == "simultaneous" else point
                increment = scale * velocity(block, at)[k]
                if k == first and order != "simultaneous":
                    # It is kept half a summation before the other one.
                    if fresh:
                        if preload == "half" and (a or b or c):
                            increment -= increment // 2
                    elif most == 2 * scale and most == scale_before:
                        increment += increment // 2
                total = sums[k] + increment
                if total >= modulus if way[k] > 0 else total < 0:
                    point[k] += way[k]
                    if order == "implicit" and k != first:
                        # Its own new coordinate, too.
                        total = sums[k] + scale * velocity(block, point)[k]
                    total -= way[k] * modulus
                sums[k] = min(max(total, -2 * modulus), 2 * modulus - 1)
        scale_before, fresh = scale if all(able) else 0, False
        if point != before:
            yield clock + 1, (point[0], point[1])
            if to_come <= 1 and point == end:
                return


@dataclass(frozen=True)
class Run:
    """What becomes of a block, when no step has to wait and blocks are offered all the time.

    Attributes
    ----------
    accepted, started, answered : int
        Clocks: ``answered`` is that of ``done`` or ``error``.
    code : int
        0 or SHARP.
    steps : list of (clock, point)
    """

    accepted: int
    started: int
    answered: int
    code: int
    steps: list[tuple[int, Point]]


def run_conics(blocks: Sequence[Sequence[int]], *, width: int, **variant) -> Iterator[Run]:
    """Yield what becomes of blocks that move, are empty or refused, one after the other."""
    accepted = 0
    for block in blocks:
        code = fault(block)
        still = code != 0 or is_empty(block)
        started = accepted + width + 4
        steps: list[tuple[int, Point]] = []
        if not still:
            steps = [
                (clock + accepted, point)
                for clock, point in conic_steps(block, width=width, **variant)
            ]
        answered = steps[-1][0] + 1 if steps else started + 1
        yield Run(accepted, started, answered, code, steps)
        # Blocks are taken when nothing runs and nothing waits: that is the clock of the answer.
        accepted = answered


def draw_conics(width: int, count: int, *, seed: int, turns: int = 4) -> np.ndarray:
    """Draw blocks of all kinds, seeded: every eighth is refused, and every eighth is empty.

    None has more than ``turns`` changes of direction: long ones take their time.
    """
    random = np.random.default_rng([seed, width])
    each = -(-count // len(conics.KINDS))
    drawn = []
    for kind in conics.KINDS:
        blocks = conics.random_blocks(kind, width, 8 * each + 8, random)
        drawn.append(blocks[blocks[:, 10] <= turns][:each])
    blocks = np.stack(drawn, axis=1).reshape(-1, len(FIELDS))[:count]
    for k in range(7, count, 8):
        # The centre of a curve, which has no direction there; or a start that is too sharp for it.
        a, b, c, *_, x, y, _, _, _, _ = blocks[k].tolist()
        a = a or 3
        aside = k // 8 % 2
        blocks[k, [0, 3, 4]] = a, aside - 2 * a * x - b * y, -b * x - 2 * c * y
    for k in range(3, count, 8):
        blocks[k, 7:9] = blocks[k, 5:7]
        blocks[k, 10] = 0
    return blocks


def moved_far(blocks: np.ndarray, width: int) -> np.ndarray:
    """Move blocks of few steps as far out as ``width`` bits go, and make their numbers as large.

    Every other one goes to the opposite corner. Neither changes the curve.
    """
    out = []
    square, linear = 2 ** (width + 3) - 1, 2 ** (2 * width + 4) - 1
    for k, row in enumerate(blocks.tolist()):
        a, b, c, d, e, x0, y0, x1, y1, clockwise, turns = row
        way, edge = (-1 if k % 2 else 1), 2**width - 2 ** (width // 2)
        dx, dy = (way * (edge - max(abs(p), abs(q))) for p, q in ((x0, x1), (y0, y1)))
        most = max(2 * abs(a) + abs(b), abs(b) + 2 * abs(c)) * 2**width + max(abs(d), abs(e))
        factor = min(square // max(1, abs(a), abs(b), abs(c)), linear // max(1, most))
        a, b, c, d, e = (number * factor for number in (a, b, c, d, e))
        d, e = d - 2 * a * dx - b * dy, e - b * dx - 2 * c * dy
        out.append((a, b, c, d, e, x0 + dx, y0 + dy, x1 + dx, y1 + dy, clockwise, turns))
    return np.array(out, dtype=np.int64)
