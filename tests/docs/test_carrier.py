"""What docs/carrier_circular.md says of the drift and of the last increment, measured again."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from discreta.sim.arcs import squared_radii
from discreta.sim.carrier import angles
from discreta.sim.groups import survey_groups
from discreta.sim.methods import METHODS
from discreta.sim.simulate import simulate
from docs.drift import drift

PAGE = Path(__file__).parents[2] / "docs/carrier_circular.md"
CARRIER = METHODS["carrier_circular"]


@pytest.mark.usefixtures("compiled_engine")
def test_a_turn_drifts_as_the_page_says():
    cells = drift("plain", "series", 4096, 1)
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in PAGE.read_text(encoding="utf-8").splitlines()
        if line.startswith("|")
    ]
    assert cells in rows


@pytest.mark.usefixtures("compiled_engine")
def test_the_last_increment_makes_up_for_no_more_than_the_drift():
    """\\|last − R·Δφ\\| ≤ √(off² + along²) + 2 for every block of the survey's sample."""
    width = 6
    group = survey_groups(CARRIER, width)[-1]
    admitted = np.flatnonzero(group.answers == 0)[:60]
    blocks = group.blocks[admitted]
    choices: dict[str, Any] = {"formula": "plain", "coefficient": "series", "preload": "half"}
    limit = int(CARRIER.clocks(CARRIER.model(width, **choices), blocks).sum()) + 2
    core = CARRIER.core(width, **choices)
    events = np.concatenate(
        [s.events for s in simulate(core, blocks, limit=limit, engine="compiled")]
    )
    taken = events[events[:, 4] == 1]
    last = taken[taken[:, 7] == 1, 5:7]
    assert len(last) == len(blocks)
    radius = np.sqrt(np.array([float(square) for square, _ in squared_radii(blocks)]))
    swept, periods = angles(blocks), blocks[:, -2].astype(float)
    turned = swept / periods
    off, along = radius * np.expm1(swept * turned / 2), radius * swept * turned**2 / 3
    differs = np.abs(np.hypot(*last.T) - radius * turned)
    assert np.all(differs <= np.hypot(off, along) + 2)
    # And the bound is no empty promise.
    assert np.any(differs > 0.5)
