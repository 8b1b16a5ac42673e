"""A queue of more than one block; that it is the RTL's, the test bench of the device shows."""

import numpy as np
import pytest

from discreta.sim.golden.device import make_device
from discreta.sim.golden.fifo import QueuedDevice
from discreta.sim.vectors import play


def run(golden, rows, clocks, **others):
    """Offer lines at once, and give the outputs at every clock and when each is accepted."""
    fields = [name for name in golden.inputs() if name.startswith("blocks_")]
    fields.remove("blocks_valid")
    blocks = [[row.get(name, 0) for name in fields] for row in rows]
    orders = [(0, name, others.get(name, 0)) for name in golden.inputs()]
    orders = [order for order in orders if not order[1].startswith("blocks_")]
    orders += [
        (0, "override", 128),
        *((0, name, 1) for name in golden.inputs() if "pulse_" in name),
    ]
    outputs, accepted = [], []
    played = play(golden, fields, np.array(blocks), orders=orders)
    for clock, (_, out, inputs) in zip(range(clocks), played, strict=False):
        outputs.append(out)
        if inputs["blocks_valid"] and out["blocks_ready"]:
            accepted.append(clock)
    return outputs, accepted


def points(outputs):
    """Give where the machine was, each place once."""
    seen = [(out["position_x"], out["position_y"]) for out in outputs]
    return [at for at, before in zip(seen, [None, *seen], strict=False) if at != before]


LINES = [
    {"blocks_end_x": x, "blocks_end_y": y} for x, y in ((3, 1), (3, 4), (-2, 4), (0, 0), (5, 5))
]


@pytest.mark.parametrize("depth", [2, 3, 16])
def test_the_same_way_as_with_a_queue_of_one(depth):
    device = make_device(4, ("line",))
    one, _ = run(device, LINES, 400)
    more, accepted = run(QueuedDevice(device, depth), LINES, 400)
    assert points(more) == points(one)
    assert points(one)[-1] == (5, 5)
    assert sum(out["done"] for out in more) == len(LINES)
    assert not more[-1]["busy"]
    # A store of one block is full until its block has gone to the head.
    assert accepted[:2] == [0, 2 if depth == 2 else 1]


def test_it_takes_just_as_many_as_it_holds():
    """On hold nothing goes on: two are handed over, and the others wait."""
    device = QueuedDevice(make_device(4, ("line",)), 3)
    outputs, accepted = run(device, LINES * 3, 60, hold=1)
    assert len(accepted) == 3 + 2
    assert not outputs[-1]["blocks_ready"]
    assert outputs[-1]["busy"]


def test_a_stop_empties_it():
    device = QueuedDevice(make_device(4, ("line",)), 4)
    outputs, _ = run(device, LINES, 20, emergency=1)
    assert outputs[-1]["reason"] == 2
    assert not outputs[-1]["busy"]
    assert points(outputs) == [(0, 0)]
