"""The host's end of the link: blocks and commands to a board, over any port.

The protocol is described in ``docs/link.md``. A :class:`Host` sends blocks as far as the board's
queue has room, sends again what was damaged or lost, and knows from the board's answers what it has
taken, what it has done, and where the machine stands.
"""

import time
from binascii import crc32
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from amaranth.lib import data

from discreta.hdl.contract import AXIS_LETTERS
from discreta.hdl.link import (
    CHECKSUM_BYTES,
    ESCAPE,
    FLAG,
    FLIP,
    FrameType,
    fingerprint,
    layout_fields,
    settings_layout,
    status_layout,
)
from discreta.hdl.queue import StopReason

__all__ = [
    "FrameReader",
    "Host",
    "LinkError",
    "Port",
    "Statistics",
    "Status",
    "StoppedError",
    "encode_frame",
]

#: Seconds without any answer after which a board is given up.
_PATIENCE = 3.0
#: Seconds between questions to a board whose queue is full.
_POLL = 0.005
#: Numbers are counted modulo this; frames on their way are fewer than half of it.
_NUMBERS = 256
_LAST_SESSION = 255
_MAX_WINDOW = 127
#: Frames that are on their way at least, so that the line does not wait for the answer.
_LEAST_AHEAD = 3.0

_Fields = list[tuple[str, int, bool]]


class Port(Protocol):
    """What a :class:`Host` needs of a serial port; pyserial's has it.

    ``read`` gives what has come, up to ``size`` bytes, and waits for the first of them for a short
    while: 20 ms or less.
    """

    @property
    def in_waiting(self) -> int:
        """Bytes that have come."""
        ...

    def read(self, size: int, /) -> bytes:
        """Read up to ``size`` bytes."""
        ...

    def write(self, data: bytes, /) -> Any:
        """Send bytes."""
        ...


class LinkError(Exception):
    """The board does not answer, or not as it should; the message says what to do."""


@dataclass(frozen=True)
class Status:
    """What a board has answered.

    Attributes
    ----------
    session, next_block, next_command, room, dropped : int
        Of the link: see ``docs/link.md``.
    done : int
        Blocks done since the session began.
    reason : StopReason
        Why the machine stands still and takes no blocks.
    busy, held, emergency : bool
        A block or a pulse is under way; hold was asked for; the button is pressed.
    low_limit, high_limit : str
        Letters of the axes whose switches are active.
    position : tuple of int
        Where the machine is, in steps.
    """

    session: int
    next_block: int
    next_command: int
    room: int
    dropped: int
    done: int
    reason: StopReason
    busy: bool
    held: bool
    emergency: bool
    low_limit: str
    high_limit: str
    position: tuple[int, ...]


class StoppedError(LinkError):
    """The machine has stopped before the end.

    Attributes
    ----------
    status : Status
    """

    def __init__(self, status: Status):
        self.status = status
        place = ",".join(map(str, status.position))
        super().__init__(
            f"the machine has stopped: {status.reason.name}; it stands at {place}, "
            f"{status.done} blocks are done"
        )


@dataclass
class Statistics:
    """What has gone over the line.

    Attributes
    ----------
    frames, repeated : int
        Frames sent, and those of them that were sent before.
    answers, damaged_answers : int
        Whole ones, and others.
    timeouts : int
        Times that no answer came.
    dropped : int
        Frames that the board has not acted on, repeated ones aside.
    """

    frames: int = 0
    repeated: int = 0
    answers: int = 0
    damaged_answers: int = 0
    timeouts: int = 0
    dropped: int = 0


def encode_frame(kind: str, number: int, payload: bytes = b"") -> bytes:
    """Give a frame as it goes over the line."""
    body = bytes([FrameType.__members__[kind].value, number]) + payload
    body += crc32(body).to_bytes(CHECKSUM_BYTES, "little")
    frame = bytearray([FLAG])
    for byte in body:
        frame += bytes([ESCAPE, byte ^ FLIP]) if byte in (FLAG, ESCAPE) else bytes([byte])
    return bytes(frame + bytes([FLAG]))


class FrameReader:
    """Finds the whole frames in what is received.

    Attributes
    ----------
    damaged : int
        Frames so far that were not whole.
    foreign : int
        Whole ones that are no answers of such a board, as who reads them says.
    """

    #: Bytes of a frame at most; what goes on without a flag is no frame.
    _LONGEST = 1 << 10

    def __init__(self):
        self.damaged = self.foreign = 0
        self._body = bytearray()
        self._escaped = False

    def feed(self, received: bytes) -> list[bytes]:
        """Give the bodies of the frames that end in these bytes, without their checksums."""
        bodies = []
        for byte in received:
            if byte == FLAG:
                if self._body or self._escaped:
                    if self._whole():
                        bodies.append(bytes(self._body[:-CHECKSUM_BYTES]))
                    else:
                        self.damaged += 1
                self._body.clear()
                self._escaped = False
            elif byte == ESCAPE:
                self._escaped = True
            elif len(self._body) <= self._LONGEST:
                self._body.append(byte ^ FLIP if self._escaped else byte)
                self._escaped = False
        return bodies

    def _whole(self) -> bool:
        body, check = self._body[:-CHECKSUM_BYTES], self._body[-CHECKSUM_BYTES:]
        right = crc32(body).to_bytes(CHECKSUM_BYTES, "little") == check
        return bool(body) and right and not self._escaped


class Host:
    """Speaks with a board.

    Blocks go ahead as far as the board has room for them, up to ``window`` that are not yet
    acknowledged. When an answer says that something was dropped, or none comes for ``timeout``, all
    that is not acknowledged is sent again. A command waits for its own acknowledgement alone, and
    may be given while blocks are on their way: from ``progress``.

    Parameters
    ----------
    port : Port
    layout : StructLayout
        Of the blocks that the board takes: :func:`~discreta.hdl.device.exact_layout`.
    width, axes : int
        Of the board's device.
    timeout : float
        Seconds.
    window : int
        1 to 127.
    clock : callable
        Gives the time, in seconds.

    Attributes
    ----------
    accepted : int
        Blocks that the board has taken in this session.
    status : Status or None
        The last answer of this session.
    statistics : Statistics

    Raises
    ------
    ValueError
        The window or the time is out of range.
    """

    def __init__(
        self,
        port: Port,
        layout: data.StructLayout,
        width: int,
        axes: int,
        *,
        timeout: float = 0.1,
        window: int = 64,
        clock: Callable[[], float] = time.monotonic,
    ):
        if not 1 <= window <= _MAX_WINDOW:
            raise ValueError(f"window is {window}: choose a whole number from 1 to {_MAX_WINDOW}")
        if not timeout > 0:
            raise ValueError(f"time-out is {timeout}: choose more than 0 seconds")
        self._block_fields = layout_fields(layout)
        self._setting_fields = layout_fields(settings_layout())
        self._status_fields = layout_fields(status_layout(width, axes))
        self._letters = AXIS_LETTERS[:axes]
        self._fingerprint = fingerprint(layout).to_bytes(4, "little")
        self._port, self._clock = port, clock
        self._timeout, self._window = timeout, window
        self._reader = FrameReader()
        self._session = 0
        #: Blocks that are not acknowledged, by their frames: the first one's number, how many of
        #: them were sent since the last time that all were sent again, and how many ever.
        self._frames: deque[bytes] = deque()
        self._first = self._sent = self._ever_sent = 0
        #: Frames before that time which the board will drop, as they are not the next.
        self._stale = 0
        #: Frames that may be on their way: fewer where many are dropped, as all behind are, too.
        self._ahead: float = window
        self._command = 0
        self._heard = self._clock()
        self.accepted = 0
        self.status: Status | None = None
        self.statistics = Statistics()

    def open(self) -> Status:
        """Begin a session, whatever was before; give the board's first answer.

        The numbers go on where the board is. Two greetings, each with a number that the last
        session had not: an answer to the second one can be no old one that was still on its way.

        Raises
        ------
        LinkError
            No board answers, or one that is built for other blocks.
        """
        before = self._greet("QUERY", 0, b"", lambda _: True)
        first = before.session % _LAST_SESSION + 1
        second = first % _LAST_SESSION + 1
        for session in (first, second):
            status = self._greet("HELLO", session, self._fingerprint, session.__eq__)
        self._session = second
        self._frames.clear()
        self._first, self._command = status.next_block, status.next_command
        self._sent = self._ever_sent = self._stale = self.accepted = 0
        self.status = replace(status, done=0)
        self._done_before = status.done
        return self.status

    def _greet(
        self, kind: str, number: int, payload: bytes, right: Callable[[int], bool]
    ) -> Status:
        """Send a frame until the answer has the right session."""
        answered = False
        began = self._clock()
        while self._clock() - began < _PATIENCE:
            self._write(kind, number, payload)
            until = self._clock() + self._timeout
            while self._clock() < until:
                for status in self._read():
                    answered = True
                    if right(status.session):
                        return status
        if answered or self._reader.foreign:
            raise LinkError(
                "the board is built for other blocks: give the width, the axes and the kinds of "
                "curves that it was built with"
            )
        raise LinkError(
            "no answer from the board: check the port, the baud rate, and that the board runs"
        )

    def send(
        self,
        blocks: Iterable[Sequence[int]],
        progress: Callable[[Status], object] | None = None,
    ) -> None:
        """Send blocks until the board has taken all of them.

        Parameters
        ----------
        blocks : iterable of sequences of int
            Each the fields of a block, in the order of
            :func:`~discreta.hdl.plain.block_fields`.
        progress : callable or None
            Called with every answer. It may give commands.

        Raises
        ------
        StoppedError
            The machine has stopped; the blocks that it had are gone.
        LinkError
            The board answers no more, or was reset.
        """
        rows = iter(blocks)
        self._heard = asked = self._clock()
        deadline = asked + self._timeout
        while self._fill(rows):
            if self._sent == 0 and self._clock() - asked >= _POLL:
                asked = self._clock()
                self._write("QUERY")
            before = (self.accepted, self._sent > 0)
            for status in self._answers():
                if progress:
                    progress(status)
                if status.reason is not StopReason.NONE:
                    raise StoppedError(status)
            if before != (self.accepted, True):
                deadline = self._clock() + self._timeout
            elif self._clock() >= deadline:
                self.statistics.timeouts += 1
                self._go_back(0)
                deadline = self._clock() + self._timeout

    def _fill(self, rows: Iterator[Sequence[int]]) -> bool:
        """Send what the board has room for; tell whether there is anything left to do."""
        assert self.status is not None, "no session is open"
        allowed = min(int(self._ahead), self.status.room)
        while self._sent < max(allowed, 1):
            if self._sent == len(self._frames):
                row = next(rows, None)
                if row is None:
                    return bool(self._frames)
                number = (self._first + len(self._frames)) % _NUMBERS
                payload = _pack(self._block_fields, row)
                self._frames.append(encode_frame("BLOCK", number, payload))
            if self._sent >= allowed:
                return True
            self.statistics.frames += 1
            self.statistics.repeated += self._sent < self._ever_sent
            self._sent += 1
            self._ever_sent = max(self._ever_sent, self._sent)
            self._port.write(self._frames[self._sent - 1])
        return True

    def command(self, kind: str, payload: bytes = b"") -> Status:
        """Give a command, and wait until the board has acted on it.

        Parameters
        ----------
        kind : str
            ``"HOLD"``, ``"RESUME"``, ``"SINGLE"``, ``"STOP"`` or ``"CLEAR"``.

        Raises
        ------
        LinkError
            The board answers no more, or was reset.
        """
        number = self._command
        self._command = (number + 1) % _NUMBERS
        return self._repeat(kind, number, payload, lambda now: now.next_command != number)

    def set(self, settings: Mapping[str, int]) -> Status:
        """Set override, acceleration and timings of the pulses, by the device's names for them."""
        row = [settings[name] for name, _, _ in self._setting_fields]
        return self.command("SET", _pack(self._setting_fields, row))

    def emergency(self) -> Status:
        """Stop the machine at once, and wait until the board says so.

        What has not left the port yet is thrown away, where the port can do that.
        """
        if hasattr(self._port, "reset_output_buffer"):
            self._port.reset_output_buffer()  # pyright: ignore[reportAttributeAccessIssue]
        return self._repeat("EMERGENCY", 0, b"", lambda now: now.reason is StopReason.EMERGENCY)

    def clear(self) -> Status:
        """Let the machine work again from where it stands, when its last pulse is over.

        Raises
        ------
        LinkError
            It does not, as long as the emergency button is pressed.
        """
        began = self._clock()
        while (status := self.command("CLEAR")).reason is not StopReason.NONE:
            if status.emergency or self._clock() - began > _PATIENCE:
                raise LinkError(
                    f"the machine stands still: {status.reason.name}; release the emergency button"
                )
        self._frames.clear()
        self._sent = self._ever_sent = self._stale = 0
        return status

    def query(self) -> Status:
        """Ask for the status."""
        return self._repeat("QUERY", 0, b"", lambda _: True)

    def wait(self, progress: Callable[[Status], object] | None = None) -> Status:
        """Wait until all is done that the board has taken, or the machine has stopped.

        Raises
        ------
        LinkError
            The board answers no more, or was reset.
        """
        while True:
            status = self.query()
            if progress:
                progress(status)
            if not status.busy:
                return status

    def _repeat(
        self, kind: str, number: int, payload: bytes, answered: Callable[[Status], bool]
    ) -> Status:
        """Send a frame until an answer is as it should be."""
        self._heard = self._clock()
        while True:
            self._write(kind, number, payload)
            until = self._clock() + self._timeout
            while self._clock() < until:
                for status in self._answers():
                    if answered(status):
                        return status
            self.statistics.timeouts += 1

    def _write(self, kind: str, number: int = 0, payload: bytes = b"") -> None:
        self.statistics.frames += 1
        self._port.write(encode_frame(kind, number, payload))

    def _answers(self) -> Iterator[Status]:
        """Give the answers of this session that have come.

        Raises
        ------
        LinkError
            None has come for long, or they are not of this session.
        """
        for status in self._read():
            self._heard = self._clock()
            if self._take(status):
                assert self.status is not None
                yield self.status
        if self._clock() - self._heard > _PATIENCE:
            raise LinkError("the board answers no more: check the cable, and that the board runs")

    def _take(self, status: Status) -> bool:
        """Take note of an answer; tell whether it is a new one."""
        before = self.status
        assert before is not None
        if status.session != self._session:
            raise LinkError(
                "the board was reset, or another program speaks with it: the blocks that it had "
                "are lost; find out where the machine stands and begin anew"
            )
        more = (status.next_block - self._first) % _NUMBERS
        if more >= _NUMBERS // 2:
            return False  # an old answer that came twice
        if more > self._ever_sent:
            raise LinkError(
                "the board has taken blocks that were not sent: another program speaks with it; "
                "end that one and begin anew"
            )
        for _ in range(more):
            self._frames.popleft()
        self._first = status.next_block
        self.accepted += more
        self._sent, self._ever_sent = max(0, self._sent - more), self._ever_sent - more
        dropped = (status.dropped - before.dropped) % _NUMBERS
        self.statistics.dropped += dropped
        if dropped > self._stale and self._sent:
            # All that is on its way behind the one that was dropped is dropped too.
            self._go_back(max(0, self._sent - dropped))
        else:
            self._stale = 0 if more else max(0, self._stale - dropped)
        self._ahead = min(self._window, self._ahead + more / self._ahead)
        done = before.done + (status.done - self._done_before) % (1 << 16)
        self._done_before = status.done
        self.status = replace(status, done=done)
        return True

    def _go_back(self, stale: int) -> None:
        """Send all again that is not acknowledged; so many frames on their way are in vain."""
        self._sent, self._stale = 0, stale
        self._ahead = max(_LEAST_AHEAD, self._ahead / 2)

    def _read(self) -> list[Status]:
        """Give the answers that have come, of whatever session."""
        found = []
        received = self._port.read(max(1, self._port.in_waiting))
        for body in self._reader.feed(received):
            values = _unpack(self._status_fields, body[1:])
            if body[0] != FrameType.__members__["STATUS"].value or values is None:
                self._reader.foreign += 1
                continue
            found.append(self._status(values))
        self.statistics.answers += len(found)
        self.statistics.damaged_answers = self._reader.damaged
        return found

    def _status(self, values: dict[str, int]) -> Status:
        switches = {
            f"{side}_limit": "".join(a for a in self._letters if values.pop(f"{side}_limit_{a}"))
            for side in ("low", "high")
        }
        position = tuple(values.pop(f"position_{a}") for a in self._letters)
        reason = StopReason(values.pop("reason"))
        flags = {name: bool(values.pop(name)) for name in ("busy", "held", "emergency")}
        return Status(**values, **flags, **switches, reason=reason, position=position)  # pyright: ignore[reportArgumentType]


def _pack(fields: _Fields, row: Sequence[int]) -> bytes:
    """Give the bytes of fields, the lowest bits first."""
    bits = total = 0
    for (_, width, _), value in zip(fields, row, strict=True):
        total |= (int(value) & ((1 << width) - 1)) << bits
        bits += width
    return total.to_bytes(-(-bits // 8), "little")


def _unpack(fields: _Fields, data: bytes) -> dict[str, int] | None:
    """Give the values of fields by their names; None when there are more or fewer bytes."""
    if len(data) != -(-sum(width for _, width, _ in fields) // 8):
        return None
    total = int.from_bytes(data, "little")
    values = {}
    for name, width, signed in fields:
        value = total & ((1 << width) - 1)
        values[name] = value - (1 << width) if signed and value >> (width - 1) else value
        total >>= width
    return values
