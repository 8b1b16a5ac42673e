"""The simulated board: a controller's RTL, compiled, and what is plugged into its sockets.

A serial line with a length of a bit of its own, switches, and whoever watches the pins. The line
is reached in two ways: by :class:`BoardPort`, where time is the board's and every run is the same,
and by :class:`BoardTerminal`, a pseudo-terminal that any program opens as it opens a serial port.
"""

import ctypes
import os
import random
import select
import threading
import tty
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np

from discreta.hdl.controller import Controller
from discreta.hdl.plain import PlainPorts
from discreta.sim.compiled import compiled_library

__all__ = ["Board", "BoardPort", "BoardTerminal", "Wire"]

_DRIVER = Path(__file__).with_name("board.cc")
#: Changes of the pins, and bytes, that a call to the driver has room for.
_EVENT_ROOM, _HEARD_ROOM = 1 << 14, 1 << 12
#: Parts of a clock that the driver reckons the length of a bit in.
_BIT_PARTS = 256

#: A byte between frames, of the line's own protocol.
_FLAG = 0x7E
#: Clocks that a terminal's board runs before it looks again for what was sent.
_SLICE = 1 << 11

#: Takes clocks, shape (changes,), and levels, shape (changes, pins).
Watch = Callable[[np.ndarray, np.ndarray], object]


class _Request(ctypes.Structure):
    _fields_ = (
        ("clocks", ctypes.c_uint64),
        ("until_heard", ctypes.c_uint64),
        ("bytes", ctypes.c_char_p),
        ("byte_count", ctypes.c_uint64),
        ("heard", ctypes.c_void_p),
        ("heard_room", ctypes.c_uint64),
        ("events", ctypes.c_void_p),
        ("event_room", ctypes.c_uint64),
        ("heard_count", ctypes.c_uint64),
        ("event_count", ctypes.c_uint64),
        ("clock", ctypes.c_uint64),
        ("waiting", ctypes.c_uint64),
    )


class Board:
    """A controller that runs, clock by clock, when it is told to.

    Parameters
    ----------
    controller : Controller
    watch : callable or None
        Called with every change of the pins, in order.
    clocks_per_bit : Fraction, int or None
        Length of a bit on the line; None: the controller's own.

    Attributes
    ----------
    clock : int
        Clocks since reset.
    waiting : int
        Bytes that were sent to the board and are not on the line yet.

    Raises
    ------
    RuntimeError
        There is no C++ compiler.
    """

    def __init__(
        self,
        controller: Controller,
        *,
        watch: Watch | None = None,
        clocks_per_bit: Fraction | int | None = None,
    ):
        top = PlainPorts(controller)
        self.clock = self.waiting = 0
        self._watch = watch
        self._call = ctypes.CDLL(str(compiled_library(top, _DRIVER)))
        self._call.board_create.restype = ctypes.c_void_p
        bit = controller.clocks_per_bit if clocks_per_bit is None else clocks_per_bit
        self._board = self._call.board_create(ctypes.c_uint64(round(bit * _BIT_PARTS)))
        self._pins = [name for name in top.outputs if name.startswith("pins_")]
        self._switches = [name for name in top.inputs if name != "rx"]
        for kind, names in enumerate((self._pins, self._switches)):
            for name in names:
                assert self._call.board_add(ctypes.c_void_p(self._board), kind, name.encode())
        self._events = np.empty((_EVENT_ROOM, 1 + len(self._pins)), dtype=np.int64)
        self._heard = ctypes.create_string_buffer(_HEARD_ROOM)

    def close(self) -> None:
        """Give the model's memory back."""
        self._call.board_destroy(ctypes.c_void_p(self._board))
        self._board = 0

    def __del__(self):
        if getattr(self, "_board", 0):
            self.close()

    def switch(self, name: str, level: int) -> None:
        """Set an input beside the line, by its plain name: ``emergency``, ``low_limit_x`` …"""
        index = self._switches.index(name)
        self._call.board_switch(ctypes.c_void_p(self._board), index, level)

    def run(self, clocks: int, sent: bytes = b"", *, until_heard: int = 0) -> bytes:
        """Run for so many clocks, or until so many bytes have come; give what has come.

        ``sent`` is put on the line to the board, behind what waits there.
        """
        heard, end = b"", self.clock + clocks
        while self.clock < end:
            request = _Request(
                clocks=end - self.clock,
                until_heard=until_heard - len(heard) if until_heard else 0,
                bytes=sent,
                byte_count=len(sent),
                heard=ctypes.addressof(self._heard),
                heard_room=_HEARD_ROOM,
                events=self._events.ctypes.data,
                event_room=_EVENT_ROOM,
            )
            self._call.board_run(ctypes.c_void_p(self._board), ctypes.byref(request))
            sent = b""
            heard += self._heard.raw[: request.heard_count]
            self.clock, self.waiting = request.clock, request.waiting
            if self._watch and request.event_count:
                events = self._events[: request.event_count]
                self._watch(events[:, 0].copy(), events[:, 1:].copy())
            if until_heard and len(heard) >= until_heard:
                break
        return heard


class Wire:
    """One way of a line that damages bytes and loses frames.

    Parameters
    ----------
    damage : float
        Part of the bytes that become another one.
    lose : float
        Part of the frames that are left out whole, with both of their flags.
    seed : int

    Attributes
    ----------
    bytes, damaged, frames, lost : int
        How many there were.

    Raises
    ------
    ValueError
        A part is not between 0 and 1.
    """

    def __init__(self, damage: float = 0, lose: float = 0, seed: int = 0):
        for what, part in (("damage", damage), ("lose", lose)):
            if not 0 <= part < 1:
                raise ValueError(f"{what} is {part}: choose a part from 0 to less than 1")
        self.bytes = self.damaged = self.frames = self.lost = 0
        self._damage, self._lose = damage, lose
        self._random = random.Random(seed)
        self._inside = self._losing = False

    def carry(self, sent: bytes) -> bytes:
        """Give what arrives of these bytes."""
        arrived = bytearray()
        for byte in sent:
            self.bytes += 1
            if byte == _FLAG:
                self._inside = not self._inside
                if self._inside:
                    self.frames += 1
                    self._losing = self._random.random() < self._lose
                    self.lost += self._losing
            if self._losing:
                # A flag that ends a frame that is lost is the last that is left out.
                self._losing = self._inside
                continue
            if self._random.random() < self._damage:
                self.damaged += 1
                byte ^= self._random.randrange(1, 256)
            arrived.append(byte)
        return bytes(arrived)


class BoardPort:
    """A port to a board whose time is the board's: it runs while somebody reads.

    Parameters
    ----------
    board : Board
    frequency : float
        Of its clock, in Hz: what :meth:`time` counts in.
    wires : tuple of Wire
        To the board and back.
    timeout : float
        Seconds that a read waits for the first byte.
    """

    def __init__(
        self,
        board: Board,
        frequency: float = 1e6,
        *,
        wires: tuple[Wire, Wire] | None = None,
        timeout: float = 1e-3,
    ):
        self.board, self.frequency = board, frequency
        self._there, self._back = wires or (Wire(), Wire())
        self._timeout = round(timeout * frequency)
        self._sent, self._arrived = b"", b""

    def time(self) -> float:
        """Give the board's time, in seconds."""
        return self.board.clock / self.frequency

    @property
    def in_waiting(self) -> int:
        """Bytes that have come."""
        return len(self._arrived)

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self._sent += self._there.carry(data)

    def read(self, size: int) -> bytes:
        """Read up to ``size`` bytes, waiting for the first one."""
        if not self._arrived:
            heard = self.board.run(self._timeout, self._sent, until_heard=1)
            self._arrived, self._sent = self._back.carry(heard), b""
        given, self._arrived = self._arrived[:size], self._arrived[size:]
        return given


class BoardTerminal:
    """A board behind a pseudo-terminal; it runs as fast as it can, until :meth:`close`.

    Parameters
    ----------
    board : Board
        Nobody else may run it meanwhile.
    wires : tuple of Wire
        To the board and back.

    Attributes
    ----------
    name : str
        Of the terminal, to be opened as a serial port.
    """

    def __init__(self, board: Board, *, wires: tuple[Wire, Wire] | None = None):
        self._board = board
        self._there, self._back = wires or (Wire(), Wire())
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.name = os.ttyname(self._slave)
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ends.is_set():
            readable, _, _ = select.select([self._master], [], [], 0)
            sent = self._there.carry(os.read(self._master, 1 << 12)) if readable else b""
            heard = self._back.carry(self._board.run(_SLICE, sent))
            if heard:
                os.write(self._master, heard)

    def close(self) -> None:
        """Stop the board and close the terminal."""
        self._ends.set()
        self._thread.join()
        os.close(self._master)
        os.close(self._slave)
