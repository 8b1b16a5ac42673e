"""The simulated board: a controller's RTL, compiled, and what is plugged into its sockets.

A serial line with a length of a bit of its own, switches, and a machine that sees the pins
alone.
"""

import ctypes
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np

from discreta.hdl.controller import Controller
from discreta.hdl.plain import PlainPorts
from discreta.sim.compiled import compiled_library

__all__ = ["Board"]

_DRIVER = Path(__file__).with_name("board.cc")
#: Changes of the pins, and bytes, that a call to the driver has room for.
_EVENT_ROOM, _HEARD_ROOM = 1 << 14, 1 << 12
#: Parts of a clock that the driver reckons the length of a bit in.
_BIT_PARTS = 256

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
    clocks_per_bit : Fraction or None
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
        clocks_per_bit: Fraction | None = None,
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
