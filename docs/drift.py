"""Measures how far carrier_circular drifts: ``python docs/drift.py``, from the root; two minutes.

A circle is run on the compiled RTL at the least carrier period, and every result compared with the
point that a true circle has at that period: off the circle, and along it.
"""

from itertools import product
from math import hypot, pi
from typing import Any

import numpy as np
from rich.box import MARKDOWN
from rich.console import Console
from rich.table import Table

from discreta.hdl.carrier_circular import FORMULAS
from discreta.hdl.parts.coefficient_unit import COEFFICIENTS
from discreta.sim.methods import METHODS
from discreta.sim.simulate import simulate
from discreta.sim.stretch import EVENT_COLUMNS

__all__ = ["CASES", "WIDTH", "drift", "theory"]

WIDTH, RADIUS = 12, 2000

#: Periods a turn, and turns.
CASES = ((64, 1), (4096, 1), (4096, 10), (4096, 100))

#: The last results, over which rounding is evened out.
_EVENED = 200


def theory(formula: str, angle: float, turned: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give how many steps off the circle and along it a formula without rounding is.

    A period's Δφ is ``angle``, and ``turned`` the angles swept, in radians. Along: ahead of the
    true point.
    """
    if formula == "plain":
        return RADIUS * np.expm1(turned * angle / 2), -RADIUS * turned * angle**2 / 3
    if formula == "predictor_corrector":
        return RADIUS * turned * angle**3 / 8, RADIUS * turned * angle**2 / 6
    return 0 * turned, 0 * turned


def drift(formula: str, coefficient: str, periods: int, turns: int) -> list[str]:
    """Run turns of the circle; give the cells of a table's row."""
    method = METHODS["carrier_circular"]
    choices: dict[str, Any] = {"formula": formula, "coefficient": coefficient, "preload": "half"}
    core = method.core(WIDTH, **choices)
    period = core.least_period
    block = [RADIUS, 0, RADIUS, 0, 0, 0, 0, turns - 1, periods * turns, period]
    blocks = np.array([block])
    limit = int(method.clocks(method.model(WIDTH, **choices), blocks)[0]) + 2
    taken, x = EVENT_COLUMNS.index("taken"), len(EVENT_COLUMNS)
    moves = np.concatenate(
        [
            stretch.events[stretch.events[:, taken] == 1, x : x + 2]
            for stretch in simulate(core, blocks, limit=limit, engine="compiled")
        ]
    )
    points = RADIUS + np.cumsum(moves @ [1, 1j])
    angle = 2 * pi / periods
    swept = angle * np.arange(1, len(points) + 1)
    # All but the last, which makes up for what they are off.
    turned_back = (points * np.exp(-1j * swept))[:-1]
    off, along = np.abs(turned_back) - RADIUS, np.angle(turned_back) * RADIUS
    last = hypot(*moves[-1])
    evened = min(_EVENED, len(off) // 8)
    wanted = [part.mean() for part in theory(formula, angle, swept[:-1][-evened:])]
    name = f"{formula}, {coefficient}" if formula == "rotation" else formula
    return [
        *(name, str(periods), str(turns), f"{np.abs(off).max():.2f}"),
        *(f"{off[-evened:].mean():.2f}", f"{wanted[0]:.2f}"),
        *(f"{along[-evened:].mean():.2f}", f"{wanted[1]:.2f}"),
        f"{last - RADIUS * angle:.2f}",
    ]


def main() -> None:
    """Print the table."""
    table = Table(box=MARKDOWN)
    for heading in (
        *("formula", "periods a turn", "turns", "largest", "off the circle", "theory"),
        *("along it", "theory", "last − mean"),
    ):
        table.add_column(heading, no_wrap=True)
    for formula, coefficient in product(FORMULAS, COEFFICIENTS):
        if formula == "rotation" or coefficient == "series":
            for case in CASES:
                table.add_row(*drift(formula, coefficient, *case))
    Console(width=200).print(table)


if __name__ == "__main__":
    main()
