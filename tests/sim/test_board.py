"""The whole way: a host, the pins of the compiled RTL, and a machine that sees these alone."""

from fractions import Fraction

import numpy as np
import pytest

from discreta.boards.host import Host, StoppedError
from discreta.hdl.controller import Controller
from discreta.hdl.device import exact_device
from discreta.hdl.feed import FULL_OVERRIDE
from discreta.hdl.plain import block_fields
from discreta.hdl.queue import KINDS, BlockKind, StopReason
from discreta.sim.board import Board, BoardPort, BoardTerminal, Wire
from discreta.sim.constant_speed import paced
from discreta.sim.expected import expected_points
from discreta.sim.feed import encode_feed
from discreta.sim.plotter import Plotter, PulseTiming

pytestmark = pytest.mark.usefixtures("optimized_engine")

TIMING = PulseTiming(2, 2, 3, 3)
CONTROLS = {
    "override": FULL_OVERRIDE,
    "acceleration": 0,
    "pulse_length": 2,
    "pulse_space": 2,
    "direction_setup": 3,
    "direction_hold": 3,
}
START = (10, -20)
#: (kind, end, centre, clockwise): a house with a round roof, and its diagonals.
MOVES = [
    ("line", (110, -20), None, 0),
    ("arc", (10, -20), (60, -20), 0),
    ("line", (10, 60), None, 0),
    ("arc", (110, 60), (60, 60), 1),
    ("line", (110, -20), None, 0),
    ("line", (10, 60), None, 0),
    ("line", (110, 60), None, 0),
    ("arc", (110, 60), (90, 75), 1),
    ("line", (10, -20), None, 0),
]


def rows_of(device, moves, speed, start=START):
    """Give the blocks of moves, the place first."""
    fields = block_fields(device)
    mantissa, exponent = encode_feed(Fraction(speed))
    place = {"blocks_kind": BlockKind.__members__["PLACE"].value}
    rows = [place | {f"blocks_end_{a}": v for a, v in zip("xy", start, strict=True)}]
    for kind, end, center, clockwise in moves:
        own = [*start, *end, *([] if center is None else [*center, clockwise, 0])]
        core = block_fields(device.interpolators[kind])
        block = paced(kind, np.array([own]), device.width, 2)[0]
        row = dict(zip(core, block.tolist(), strict=True))
        row |= {"blocks_kind": KINDS[kind].value, "blocks_ahead": 1000}
        row |= {"blocks_feed_mantissa": mantissa, "blocks_feed_exponent": exponent}
        rows.append(row)
        start = end
    return np.array([[row.get(name, 0) for name in fields] for row in rows], dtype=np.int64)


class Way:
    """A host, a line, a board and a machine at its pins."""

    def __init__(self, *, wires=None, line=1, start=START):
        self.device = exact_device(8)
        self.plotter = Plotter(start, TIMING)
        controller = Controller(self.device, 8)
        self.board = Board(controller, watch=self.plotter.follow, clocks_per_bit=8 * line)
        self.port = BoardPort(self.board, wires=wires)
        self.host = Host(
            self.port,
            *(self.device.queue.layout, 8, 2),
            clock=self.port.time,
            timeout=0.02,
        )

    def begin(self):
        self.host.open()
        self.host.set(CONTROLS)

    def rows(self, moves=MOVES, speed="1/4"):
        return rows_of(self.device, moves, speed)

    def expected(self, rows):
        return expected_points(block_fields(self.device), rows, 8, 2)

    def run(self, rows, progress=None):
        """Run blocks to their end, or to where the machine stops; give the status there."""
        try:
            self.host.send(rows.tolist(), progress)
        except StoppedError as error:
            return error.status
        return self.host.wait(progress)

    def check(self, rows):
        """Check that the machine has seen all of it, and nothing else."""
        assert np.array_equal(self.plotter.moves[1], self.expected(rows))
        assert self.plotter.violations == []
        assert self.host.query().position == tuple(self.plotter.position)


@pytest.mark.parametrize(("damage", "lose"), [(0, 0), (0.01, 0.01), (0.03, 0.1)])
def test_lines_and_arcs_arrive_at_the_pins_whatever_the_line_does(damage, lose):
    wires = (Wire(damage, lose, 1), Wire(damage, lose, 2))
    way = Way(wires=wires)
    way.begin()
    rows = way.rows()
    way.host.send(rows.tolist())
    status = way.host.wait()
    assert (status.done, status.reason, status.position) == (10, StopReason.NONE, START)
    assert (sum(wire.damaged for wire in wires) > 0) == bool(damage)
    assert (way.host.statistics.repeated > 0) == bool(damage)
    way.check(rows)


@pytest.mark.parametrize("line", [Fraction(97, 100), Fraction(103, 100)])
def test_a_port_whose_baud_rate_is_3_percent_off(line):
    way = Way(line=line)
    way.begin()
    rows = way.rows(MOVES[:3])
    way.host.send(rows.tolist())
    way.host.wait()
    way.check(rows)
    assert way.host.statistics.damaged_answers == way.host.statistics.dropped == 0


def test_the_queue_never_runs_empty_at_a_usual_speed():
    """Blocks of 100 steps at 1/32 step a clock, 30 bytes of 80 clocks: no gap between steps."""
    way = Way()
    way.begin()
    moves = [("line", (10 + 100 * (k % 2), -20), None, 0) for k in range(1, 30)]
    rows = way.rows(moves, "1/32")
    way.host.send(rows.tolist())
    way.host.wait()
    way.check(rows)
    # Where it turns round, the direction's set-up is waited for.
    assert np.diff(way.plotter.moves[0]).max() <= 32 + 4


def test_hold_single_steps_and_resume():
    way = Way()
    way.begin()
    assert way.host.command("HOLD").held
    way.host.send(way.rows().tolist())
    way.board.run(3000)
    assert len(way.plotter.moves[0]) == 0
    for count in range(1, 4):
        way.host.command("SINGLE")
        way.board.run(200)
        assert len(way.plotter.moves[0]) == count
    assert not way.host.command("RESUME").held
    way.host.wait()
    way.check(way.rows())


@pytest.mark.parametrize("how", ["frame", "button", "limit"])
def test_stops(how):
    way = Way()
    way.begin()
    rows = way.rows(speed="1/64")
    stopped = []

    def stop(_status):
        if len(way.plotter.moves[0]) > 5 and not stopped:
            stopped.append(way.board.clock)
            if how == "frame":
                way.host.emergency()
            elif how == "button":
                way.board.switch("emergency", 1)
            else:
                way.board.switch("high_limit_x", 1)

    reason = "LIMIT" if how == "limit" else "EMERGENCY"
    assert way.run(rows, stop).reason is StopReason.__members__[reason]
    moves = len(way.plotter.moves[0])
    way.board.run(20_000)
    assert len(way.plotter.moves[0]) == moves
    status = way.host.query()
    assert status.position == tuple(way.plotter.position)
    assert (status.emergency, status.high_limit) == (how == "button", "x" * (how == "limit"))
    assert np.array_equal(way.plotter.moves[1], way.expected(rows)[:moves])
    if how == "limit":
        # Away from the switch it can go.
        way.host.clear()
        way.host.send(
            rows_of(way.device, [("line", START, None, 0)], "1/4", status.position)[1:].tolist()
        )
        assert way.host.wait().position == START


def test_a_stop_ends_a_run_and_the_next_session_goes_on():
    way = Way()
    way.begin()

    def stop(status):
        if status.position != START and status.reason is StopReason.NONE:
            way.host.command("STOP")

    assert way.run(way.rows(speed="1/64"), stop).reason is StopReason.STOP
    status = way.host.open()
    assert status.reason is StopReason.STOP
    way.host.clear()
    # The place is told anew, where the machine stands.
    here = status.position
    way.host.send(rows_of(way.device, [("line", START, None, 0)], "1/4", here).tolist())
    assert way.host.wait().position == START == tuple(way.plotter.position)


def test_a_terminal_is_a_port():
    serial = pytest.importorskip("serial")
    way = Way()
    terminal = BoardTerminal(way.board)
    try:
        with serial.Serial(terminal.name, 115_200, timeout=0.002) as port:
            host = Host(port, way.device.queue.layout, 8, 2)
            host.open()
            host.set(CONTROLS)
            host.send(way.rows().tolist())
            assert host.wait().done == 10
    finally:
        terminal.close()
    assert np.array_equal(way.plotter.moves[1], way.expected(way.rows()))


def test_a_wire_damages_and_loses_as_much_as_it_says():
    wire = Wire(0.01, 0.1, 7)
    frame = bytes([0x7E, *range(30), 0x7E])
    arrived = [wire.carry(frame) for _ in range(2000)]
    assert (wire.bytes, wire.frames) == (64_000, 2000)
    assert 150 < wire.lost == arrived.count(b"") < 250
    assert 450 < wire.damaged < 700
    assert {len(data) for data in arrived} == {0, 32}
    assert Wire().carry(frame) == frame
    again = Wire(0.01, 0.1, 7)
    assert [again.carry(frame) for _ in range(2000)] == arrived


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ((1, 0), "damage is 1: choose a part from 0 to less than 1"),
        ((0, -0.1), "lose is -0.1: choose a part from 0 to less than 1"),
    ],
)
def test_parts_of_a_wire_are_checked(parts, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        Wire(*parts)
