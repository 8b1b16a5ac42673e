"""The host's end of the link against the golden model of the board's, over lines of all sorts."""

import random
import re
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discreta.boards.host import FrameReader, Host, LinkError, StoppedError, encode_frame
from discreta.hdl.device import exact_layout
from discreta.hdl.link import fingerprint, layout_fields
from discreta.hdl.queue import StopReason
from discreta.sim.golden.link import SETTINGS
from discreta.sim.golden.link import Link as Golden

WIDTH, AXES, KINDS = 8, 2, ("line",)
LAYOUT = exact_layout(WIDTH, AXES, KINDS)
FIELDS = layout_fields(LAYOUT)
CONTROLS = {name: 3 + index for index, (name, *_) in enumerate(SETTINGS)}


@dataclass
class Line:
    """One way of a line: it damages and leaves out bytes, repeats them, and stops for a while."""

    seed: int = 0
    damage: float = 0
    drop: float = 0
    repeat: float = 0
    gap: float = 0
    left: int = field(default=0, init=False)

    def __post_init__(self):
        self._random = random.Random(self.seed)

    def carry(self, sent):
        arrived = bytearray()
        for byte in sent:
            draw = self._random.random
            if self.left:
                self.left -= 1
                continue
            if draw() < self.gap:
                self.left = self._random.randrange(60)
            if draw() < self.drop:
                continue
            changed = byte ^ self._random.randrange(1, 256) if draw() < self.damage else byte
            arrived += bytes([changed] * (1 + (draw() < self.repeat)))
        return bytes(arrived)


class Board:
    """A port with a board at its end: the golden link, and a queue that is worked off by and by.

    Attributes
    ----------
    given : list of tuple
        The blocks that it has been given.
    """

    def __init__(self, depth=4, there=None, back=None, quick=1.0, layout=LAYOUT):
        self.golden = Golden(tuple(layout_fields(layout)), fingerprint(layout), WIDTH, AXES, depth)
        self.state = self.golden.reset()
        self.there, self.back = there or Line(), back or Line()
        self.quick, self.depth = quick, depth
        self.given, self.queue = [], 0
        self.controls = []
        self.reason = 0
        self.now = 0.0
        self.mute = False
        self._random = random.Random(5)
        self._sent, self._arrived = b"", b""

    def time(self):
        return self.now

    @property
    def in_waiting(self):
        return len(self._arrived)

    def write(self, data):
        self._sent += self.there.carry(data)

    def read(self, size):
        if not self._arrived:
            answers = b"".join(self._clock([byte]) for byte in self._sent)
            answers += self._clock([])
            while self.state["due"] or self.state["stage"]:
                answers += self._clock([])
            self._arrived, self._sent = self.back.carry(answers), b""
            self.now += 1e-3
        given, self._arrived = self._arrived[:size], self._arrived[size:]
        return given

    def _clock(self, data):
        golden, state = self.golden, self.state
        out = golden.outputs(state)
        stands = self.reason != 0
        done = int(self.queue > 0 and not stands and self._random.random() < self.quick / 4)
        ready = int(self.queue < self.depth and not stands)
        inputs = dict.fromkeys(golden.inputs(), 0) | {
            "bytes_valid": len(data),
            "bytes_data": data[0] if data else 0,
            "answers_ready": 1,
            "blocks_ready": ready,
            "done": done,
            "busy": int(self.queue > 0),
            "reason": self.reason,
            "position_x": len(self.given) % 100,
        }
        self.queue -= done
        if out["blocks_valid"] and ready:
            self.given.append(tuple(out[f"blocks_{name}"] for name, *_ in golden.blocks))
            self.queue += 1
        for name in ("single", "stop", "emergency", "clear"):
            if out[name]:
                self.controls.append(name)
        if out["stop"] or out["emergency"]:
            self.reason = 2 if out["emergency"] else 1
        elif out["clear"]:
            self.reason = 0
        if self.reason:
            self.queue = 0
        self.state = golden.step(state, inputs)
        return bytes([out["answers"]]) if out["answers_valid"] and not self.mute else b""

    def reset(self):
        self.state, self.queue = self.golden.reset(), 0


def host_of(board, **choices):
    return Host(board, LAYOUT, WIDTH, AXES, clock=board.time, **choices)


def draw_blocks(count, seed=1):
    draw = random.Random(seed)
    return [
        tuple(
            draw.randrange(2**bits) - (2 ** (bits - 1) if signed else 0)
            for _, bits, signed in FIELDS
        )
        for _ in range(count)
    ]


lines = st.builds(
    Line,
    seed=st.integers(0, 2**32),
    damage=st.sampled_from([0, 0.002, 0.01]),
    drop=st.sampled_from([0, 0.004]),
    repeat=st.sampled_from([0, 0.004]),
    gap=st.sampled_from([0, 0.001]),
)


@settings(max_examples=10, deadline=None, derandomize=True)
@given(
    there=lines,
    back=lines,
    depth=st.sampled_from([1, 4, 40]),
    quick=st.sampled_from([0.1, 1.0]),
    window=st.sampled_from([1, 5, 64]),
)
def test_every_block_arrives_once_and_in_order_whatever_the_line_does(
    there, back, depth, quick, window
):
    board = Board(depth, there, back, quick)
    host = host_of(board, window=window, timeout=0.05)
    host.open()
    host.set(CONTROLS)
    blocks = draw_blocks(30)
    host.send(blocks)
    status = host.wait()
    assert board.given == blocks
    assert status.done == host.accepted == 30
    assert {name: board.state[f"set_{name}"] for name in CONTROLS} == CONTROLS


@settings(max_examples=10, deadline=None, derandomize=True)
@given(there=lines, back=lines)
def test_every_command_acts_once_whatever_the_line_does(there, back):
    board = Board(there=there, back=back)
    host = host_of(board, timeout=0.05)
    host.open()
    for _ in range(3):
        host.command("SINGLE")
    assert host.command("STOP").reason in (StopReason.STOP, StopReason.NONE)
    assert host.clear().reason is StopReason.NONE
    assert [name for name in board.controls if name != "clear"] == ["single"] * 3 + ["stop"]
    host.emergency()
    assert set(board.controls[-1:]) == {"emergency"}


def test_a_sound_line_is_used_without_repetition():
    board = Board(depth=8)
    host = host_of(board)
    host.open()
    host.send(draw_blocks(100))
    host.wait()
    statistics = host.statistics
    assert board.given == draw_blocks(100)
    assert (statistics.repeated, statistics.timeouts, statistics.dropped) == (0, 0, 0)
    assert statistics.damaged_answers == 0


def test_a_session_goes_on_where_the_board_is_and_loses_nothing():
    """Whatever the last one has left: blocks half sent, numbers anywhere, answers on their way."""
    board = Board(depth=40)
    for session in range(8):
        host = host_of(board)
        host.open()
        before = len(board.given)
        host.send(draw_blocks(17, session))
        assert board.given[before:] == draw_blocks(17, session)
        # It breaks off: half a frame, and an answer that nobody reads.
        board.write(encode_frame("QUERY", 0) + encode_frame("BLOCK", 7, bytes(9))[: 3 + session])


def test_old_blocks_on_their_way_are_not_taken_for_new_ones():
    board = Board(depth=40)
    host = host_of(board)
    host.open()
    old = draw_blocks(3, 8)
    rows = iter(old)
    host._fill(rows)  # sent, and not looked at again
    host = host_of(board)
    host.open()
    host.send(draw_blocks(5, 9))
    assert board.given == old + draw_blocks(5, 9)


def test_a_stop_is_told_with_the_place():
    board = Board(quick=0.1)
    host = host_of(board)
    host.open()

    def stop(status):
        if status.next_block == 2 and not board.controls:
            host.command("STOP")

    with pytest.raises(StoppedError, match=r"STOP; it stands at [0-9]+,0, [0-9]+ blocks are done"):
        host.send(draw_blocks(30), progress=stop)
    assert host.clear().reason is StopReason.NONE
    host.send(draw_blocks(3, 2))
    assert board.given[-3:] == draw_blocks(3, 2)


def test_progress_is_told_of_every_answer():
    board = Board()
    host = host_of(board)
    host.open()
    seen = []
    host.send(draw_blocks(30), progress=seen.append)
    assert [status.done for status in seen] == sorted(status.done for status in seen)
    assert seen[-1].next_block == 30


def refused(words):
    return pytest.raises(LinkError, match=re.escape(words))


def test_no_answer():
    board = Board()
    board.mute = True
    with refused(
        "no answer from the board: check the port, the baud rate, and that the board runs"
    ):
        host_of(board).open()


def test_a_board_that_answers_no_more():
    board = Board()
    host = host_of(board)
    host.open()
    board.mute = True
    with refused("the board answers no more: check the cable, and that the board runs"):
        host.send(draw_blocks(3))


def test_a_board_for_other_blocks():
    board = Board(layout=exact_layout(WIDTH, AXES, ("line", "arc")))
    with refused("the board is built for other blocks"):
        host_of(board).open()


def test_a_board_with_other_coordinates():
    board = Board()
    layout = exact_layout(WIDTH + 8, AXES, KINDS)
    with refused("the board is built for other blocks"):
        Host(board, layout, WIDTH + 8, AXES, clock=board.time).open()


def test_a_board_that_is_reset_gets_no_more_blocks():
    board = Board()
    host = host_of(board)
    host.open()
    host.send(draw_blocks(3))
    board.reset()
    with refused("the board was reset, or another program speaks with it"):
        host.send(draw_blocks(20))
    assert board.given == draw_blocks(3)


def test_a_board_that_another_program_speaks_with():
    board = Board(depth=40)
    host = host_of(board)
    host.open()
    for number in range(3):
        board.write(encode_frame("BLOCK", number, bytes(board.golden.sizes["BLOCK"])))
    with refused("the board has taken blocks that were not sent"):
        host.query()


@pytest.mark.parametrize(
    ("choices", "message"),
    [
        ({"window": 0}, "window is 0: choose a whole number from 1 to 127"),
        ({"window": 128}, "window is 128: choose a whole number from 1 to 127"),
        ({"timeout": 0}, "time-out is 0: choose more than 0 seconds"),
    ],
)
def test_choices_are_checked(choices, message):
    with pytest.raises(ValueError, match=rf"\A{re.escape(message)}\Z"):
        host_of(Board(), **choices)


@given(st.lists(st.binary(max_size=40), max_size=5), st.binary(max_size=10).filter(len))
def test_whole_frames_are_found_and_no_others(payloads, noise):
    reader = FrameReader()
    noise = noise.replace(b"\x7e", b"")
    sent = b"".join(encode_frame("BLOCK", k, payload) for k, payload in enumerate(payloads))
    found = [body for byte in noise + sent for body in reader.feed(bytes([byte]))]
    assert found == [bytes([4, k]) + payload for k, payload in enumerate(payloads)]
    assert reader.damaged == bool(noise and payloads)


def test_noise_without_a_flag_takes_no_room():
    reader = FrameReader()
    assert reader.feed(bytes(1_000_000)) == []
    assert len(reader._body) < 2000
    reader.feed(encode_frame("QUERY", 1))
    assert reader.feed(encode_frame("QUERY", 1)) == [bytes([2, 1])]
