"""The device of the iCEstick behind its link: the same host, and a machine at the pins."""

import pytest

from discreta.boards.catalogue import BOARDS
from discreta.boards.host import Host
from discreta.hdl.controller import Controller
from discreta.hdl.line_device import line_device_layout
from discreta.hdl.queue import StopReason
from discreta.sim.board import Board, BoardPort

WIDTH = 12
BLOCKS = [(200, 99, 60), (-37, 150, 40), (0, 0, 100)]


@pytest.mark.usefixtures("compiled_engine")
def test_lines_over_the_link():
    pulses = {"x": 0, "y": 0}
    before = [0, 0, 0, 0]

    def watch(_clocks, levels):
        for step_x, direction_x, step_y, direction_y in levels.tolist():
            rose = (step_x > before[0], step_y > before[2])
            pulses["x"] += rose[0] * (1 - 2 * direction_x)
            pulses["y"] += rose[1] * (1 - 2 * direction_y)
            before[:] = step_x, direction_x, step_y, direction_y

    board = Board(Controller(BOARDS["icestick"].device(), 8), watch=watch)
    port = BoardPort(board)
    host = Host(port, line_device_layout(WIDTH), WIDTH, 2, clock=port.time)
    host.open()
    for x, y, period in BLOCKS:
        host.send([(x, y, period)])
        status = host.wait()
        assert status.reason is StopReason.NONE
        assert status.position == (x, y) == (pulses["x"], pulses["y"])
    # The button, on the way.
    host.send([(300, 0, 500)])
    board.switch("emergency", 1)
    status = host.wait()
    assert status.reason is StopReason.EMERGENCY
    assert status.position == (pulses["x"], pulses["y"])
    assert status.position[0] < 300
    board.close()
