"""Sends blocks to a board, or to the simulated one: all of ``discreta send``."""

import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from discreta.boards.host import Host, LinkError, Status, StoppedError
from discreta.hdl.controller import Controller
from discreta.hdl.device import Device
from discreta.hdl.plain import block_fields
from discreta.hdl.queue import StopReason
from discreta.sim.board import Board, BoardTerminal, Wire
from discreta.sim.expected import expected_points
from discreta.sim.machine import Drive, Trail
from discreta.sim.plotter import Pen, Plotter
from discreta.sim.points import BadInputError

__all__ = ["SIMULATED", "Job", "Simulation", "send"]

#: The port that is no port but the simulated board.
SIMULATED = "sim:"

#: Seconds that a read of a port waits for the first byte.
_READ = 0.002
#: Seconds, or bits, in which an answer comes to what was sent: two frames, and their way.
_TIMEOUT, _TIMEOUT_BITS = 0.1, 1500

Progress = Callable[[int, int], object]


@dataclass(frozen=True)
class Job:
    """What is sent: blocks, and how the device is programmed besides.

    Attributes
    ----------
    device : Device
        Like the board's.
    blocks : array of int64, shape (blocks, block fields)
        The first one says where the machine stands.
    drive : Drive
    """

    device: Device
    blocks: np.ndarray
    drive: Drive

    @property
    def start(self) -> np.ndarray:
        """Give where the first block says that the machine stands."""
        fields = block_fields(self.device)
        columns = [fields.index(f"blocks_end_{a}") for a in self.device.queue.letters]
        return self.blocks[0, columns]


def send(
    job: Job, port: str, *, baud: int = 115_200, clear: bool = False, progress: Progress
) -> dict[str, Any]:
    """Send a job to the board at a port, wait for its end, and give the summary.

    Interrupted by the user it stops the machine, down the ramp, and says where it stands.

    Parameters
    ----------
    job : Job
    port : str
    baud : int
    clear : bool
        Go on where the machine stands still for a limit switch, an emergency or a refused block.
    progress : callable
        Called with the blocks that are done, and all there are.

    Raises
    ------
    BadInputError
        There is no such port.
    LinkError
        The board does not answer as it should, or the machine stands still and is not cleared.
    """
    serial = _pyserial()
    try:
        line = serial.Serial(port, baud, timeout=_READ)
    except (OSError, ValueError) as error:
        raise BadInputError(f"cannot open {port}: {error}") from None
    with line, _interrupts() as interrupted:
        try:
            host = Host(line, *_format(job.device), timeout=max(_TIMEOUT, _TIMEOUT_BITS / baud))
            return _send(job, host, clear, progress, interrupted)
        except serial.SerialException as error:
            raise LinkError(f"the port {port} is gone: {error}") from None


def _pyserial() -> Any:
    """Give the library of serial ports."""
    try:
        import serial
    except ImportError:
        raise BadInputError(
            "send needs pyserial: install it, or discreta with its extra, discreta[boards]"
        ) from None
    return serial


def _format(device: Device) -> tuple[Any, int, int]:
    """Give what a host must know of a device."""
    return device.queue.layout, device.width, device.axes


@contextmanager
def _interrupts() -> Iterator[threading.Event]:
    """Note the user's first interrupt in place of breaking off at any point."""
    event = threading.Event()
    before = signal.getsignal(signal.SIGINT)

    def note(*_: object) -> None:
        event.set()
        signal.signal(signal.SIGINT, before)  # whoever cannot wait interrupts once more

    signal.signal(signal.SIGINT, note)
    try:
        yield event
    finally:
        signal.signal(signal.SIGINT, before)


class _Interrupted(Exception):  # noqa: N818
    """The user does not want any more."""


def _send(
    job: Job, host: Host, clear: bool, progress: Progress, interrupted: threading.Event
) -> dict[str, Any]:
    """Send a job, and give the summary."""
    began = time.monotonic()
    total = len(job.blocks)

    def follow(status: Status) -> None:
        progress(min(status.done, total), total)
        if interrupted.is_set():
            raise _Interrupted

    status = host.open()
    if status.reason is StopReason.STOP or (clear and status.reason is not StopReason.NONE):
        status = host.clear()
    if status.reason is not StopReason.NONE:
        raise LinkError(f"the machine stands still: {_why(status)}; see to it, and give --clear")
    if status.held:
        host.command("RESUME")
    host.set(job.drive.controls)
    try:
        host.send(job.blocks.tolist(), follow)
        status = host.wait(follow)
    except StoppedError:
        status = host.wait()
    except _Interrupted:
        host.command("STOP")
        status = host.wait()
    seconds = time.monotonic() - began
    return {
        "blocks": total,
        "blocks done": status.done,
        **{name.replace("_", " "): value for name, value in vars(host.statistics).items()},
        "position": list(status.position),
        **({} if status.reason is StopReason.NONE else {"stopped": _why(status)}),
        "seconds": round(seconds, 3),
    }


def _why(status: Status) -> str:
    """Name the reason for which the machine stands still."""
    return StopReason(status.reason).name


class Simulation:
    """The simulated board, and a machine behind it that sees the pins alone.

    Parameters
    ----------
    job : Job
    clocks_per_bit : int
    damage, lose : float
        Parts of the bytes that are damaged and of the frames that are lost, both ways.
    seed : int

    Attributes
    ----------
    name : str
        Of the port that the board is behind.
    pen : Pen
        It has drawn what the machine made of the pins.
    good : bool
        Behind :meth:`facts`: all is as the golden models have it.

    Raises
    ------
    RuntimeError
        There is no C++ compiler.
    ValueError
        A choice is out of range.
    """

    def __init__(
        self,
        job: Job,
        *,
        clocks_per_bit: int = 8,
        damage: float = 0,
        lose: float = 0,
        seed: int = 0,
    ):
        self._job = job
        self._wires = (Wire(damage, lose, 2 * seed), Wire(damage, lose, 2 * seed + 1))
        self._plotter = Plotter(job.start, job.drive.timing, keep_moves=False)
        self.pen, self.good = Pen(job.start), False
        self._trail, self._last = Trail(job.start), 0
        self._board = Board(Controller(job.device, clocks_per_bit), watch=self._watch)
        self._terminal = BoardTerminal(self._board, wires=self._wires)
        self.name = self._terminal.name

    def _watch(self, clocks: np.ndarray, pins: np.ndarray) -> None:
        when, points = self._plotter.follow(clocks, pins)
        if len(when):
            self._last = int(when[-1])
        self._trail.follow(points)
        self.pen.follow(points)

    def close(self) -> None:
        """Switch the board off."""
        self._terminal.close()
        self._plotter.finish(self._board.clock)

    def facts(self, sent: Mapping[str, Any]) -> dict[str, Any]:
        """Give what the machine has seen, when the board is switched off, and whether it is right.

        ``sent``: the summary of what was sent.
        """
        job = self._job
        expected = Trail(job.start)
        device = job.device
        expected.follow(
            expected_points(block_fields(device), job.blocks, device.width, device.axes)
        )
        same = self._trail == expected
        counted = self._plotter.position.tolist() == sent["position"]
        broken = self._plotter.violation_count + len(self._plotter.unfinished)
        self.good = same and counted and not broken
        return {
            "bytes damaged": sum(wire.damaged for wire in self._wires),
            "frames lost": sum(wire.lost for wire in self._wires),
            "clocks": self._last,
            "pulses": self._plotter.pulses.tolist(),
            "timing rules broken": broken,
            "position is the pulses": counted,
            "same points from the pins": same,
        }
