"""How many blocks the link carries, and what damage and loss cost: the table of ``docs/link.md``.

``python docs/throughput.py [BLOCKS]`` sends blocks of one step each, 400 or so many, to the
simulated board, in the board's own time, with a host that answers at once. So the line alone is
what is measured; 115,200 baud and 1 Mbaud differ by the length of a bit alone.
"""

import sys

import numpy as np
from rich.box import MARKDOWN
from rich.console import Console
from rich.table import Table

from discreta.boards.host import Host
from discreta.hdl.controller import Controller
from discreta.hdl.device import exact_device
from discreta.sim.board import Board, BoardPort, Wire
from discreta.sim.curves import Polyline
from discreta.sim.machine import Drive, device_blocks
from discreta.sim.plotter import Plotter

#: (damaged bytes, lost frames), as parts.
LINES = ((0, 0), (0.001, 0.001), (0.003, 0.003), (0.01, 0.01), (0.03, 0.03))
BAUDS = (115_200, 1_000_000)
BITS = 8


def measure(count: int, damage: float, lose: float) -> tuple[float, Host, int]:
    """Send blocks; give the bits' time that each took, the host, and the pulses that were seen."""
    device = exact_device(16)
    points = np.stack([np.arange(count + 1), np.zeros(count + 1, dtype=np.int64)], axis=1)
    drive = Drive()
    plotter = Plotter(points[0], drive.timing)
    board = Board(Controller(device, BITS), watch=plotter.follow)
    wires = (Wire(damage, lose, 1), Wire(damage, lose, 2))
    # Time in bits: a tenth of a second of the line at 115,200 baud is the host's patience.
    port = BoardPort(board, frequency=BITS * BAUDS[0], wires=wires)
    host = Host(port, device.queue.layout, 16, 2, clock=port.time)
    host.open()
    host.set(drive.controls)
    began = board.clock
    host.send(device_blocks(device, Polyline(points), drive).tolist())
    bits = (board.clock - began) / BITS
    host.wait()
    return bits / (count + 1), host, int(plotter.pulses.sum())


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 400
    table = Table(box=MARKDOWN)
    headings = ("bytes damaged", "frames lost", *(f"blocks/s at {baud:,} baud" for baud in BAUDS))
    for heading in (*headings, "frames a block", "steps"):
        table.add_column(heading)
    for damage, lose in LINES:
        bits, host, steps = measure(count, damage, lose)
        speeds = [f"{baud / bits:,.0f}" for baud in BAUDS]
        frames = f"{host.statistics.frames / (count + 1):.2f}"
        table.add_row(f"{damage:.1%}", f"{lose:.1%}", *speeds, frames, f"{steps} of {count}")
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
