"""A curve on the whole device: blocks in, and what a virtual machine makes of the pins."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from hashlib import sha256
from math import ceil, sqrt
from typing import IO, Any, Protocol

import numpy as np

from discreta.hdl.constant_speed import ConstantSpeed
from discreta.hdl.contract import AXIS_LETTERS, Part
from discreta.hdl.device import Device
from discreta.hdl.exact_arc import ExactArc
from discreta.hdl.exact_line import ExactLine
from discreta.hdl.feed import FULL_OVERRIDE
from discreta.hdl.plain import block_fields
from discreta.hdl.pulse import TIMING_BITS
from discreta.hdl.queue import KINDS, BlockKind, StopReason
from discreta.sim.carrier import lengths
from discreta.sim.constant_speed import paced, ticks_of
from discreta.sim.curves import Curve
from discreta.sim.feed import ahead, encode_acceleration, encode_feed, feed_of, octagon, of_conic
from discreta.sim.plotter import Pen, Plotter, PulseTiming, Screen
from discreta.sim.points import BadInputError
from discreta.sim.simulate import simulate
from discreta.sim.stretch import EVENT_COLUMNS

__all__ = [
    "BlocksOfAKind",
    "Drive",
    "Machine",
    "Trail",
    "device_blocks",
    "pace_limit",
    "pace_limit_of",
    "path_of",
]

#: Clocks of a run beside all others: the queue's, the feed unit's, the last pulse's.
_OVERHEAD = 64

#: Clocks in which a block that has moved nothing, or waits for another interpolator, is passed on.
_HAND_OVER = 16


@dataclass(frozen=True)
class Drive:
    """How a device is to run: what is programmed besides the curve.

    Attributes
    ----------
    feed : Fraction
        F, 2^-24 to 1, in steps per clock.
    acceleration : Fraction
        In steps per clock²; 0: none, F is there at once.
    timing : PulseTiming
        Of the pulses, in clocks, up to 4095 each.

    Raises
    ------
    BadInputError
        One of them is out of range.
    """

    feed: Fraction = Fraction(1)
    acceleration: Fraction = Fraction(0)
    timing: PulseTiming = field(default_factory=PulseTiming)

    def __post_init__(self):
        encode_feed(self.feed)
        encode_acceleration(self.acceleration)
        for name, value in vars(self.timing).items():
            if value >= 1 << TIMING_BITS:
                raise BadInputError(
                    f"pulse {name} is {value} clocks: choose up to {(1 << TIMING_BITS) - 1}"
                )

    @property
    def programmed(self) -> Fraction:
        """F as the device has it: rounded to 17 bits."""
        return feed_of(*encode_feed(self.feed))

    @property
    def controls(self) -> dict[str, int]:
        """Give the values of the device's inputs beside the blocks."""
        timing = self.timing
        return {
            "override": FULL_OVERRIDE,
            "acceleration": encode_acceleration(self.acceleration),
            "pulse_length": timing.length,
            "pulse_space": timing.space,
            "direction_setup": timing.setup,
            "direction_hold": timing.hold,
        }


class BlocksOfAKind(Protocol):
    """Blocks of one kind, as curves have them."""

    @property
    def kind(self) -> str:
        """Give their kind."""
        ...

    @property
    def axes(self) -> int:
        """Give how many axes there are."""
        ...

    @property
    def start(self) -> np.ndarray:
        """Give where the first one begins."""
        ...

    @property
    def blocks(self) -> np.ndarray:
        """Give what the interpolator is given, shape (blocks, block fields)."""
        ...


def path_of(device: Device, curve: BlocksOfAKind) -> np.ndarray:
    """Give how long every block is as a device measures it, shape (blocks,)."""
    if isinstance(device.interpolators[curve.kind], ConstantSpeed):
        return ticks_of(curve.kind, curve.blocks, curve.axes)
    return octagon(curve.blocks, curve.kind)


def device_blocks(
    device: Device,
    curve: BlocksOfAKind,
    drive: Drive,
) -> np.ndarray:
    """Give what a device is given for a curve, shape (1 + blocks, block fields).

    The first block tells it where the machine stands: at the start of the curve.
    """
    interpolator = device.interpolators[curve.kind]
    own = curve.blocks
    if isinstance(interpolator, ConstantSpeed):
        own = paced(curve.kind, curve.blocks, device.width, curve.axes)
    columns = dict(zip(block_fields(interpolator), own.T, strict=True))
    mantissa, exponent = encode_feed(drive.feed)
    columns |= {
        "blocks_kind": np.full(len(curve.blocks), KINDS[curve.kind].value),
        "blocks_feed_mantissa": np.full(len(curve.blocks), mantissa),
        "blocks_feed_exponent": np.full(len(curve.blocks), exponent),
        "blocks_ahead": ahead(path_of(device, curve)),
    }
    fields = block_fields(device)
    blocks = np.zeros((1 + len(curve.blocks), len(fields)), dtype=np.int64)
    for index, name in enumerate(fields):
        # What only blocks of another kind have is left alone.
        blocks[1:, index] = columns.get(name, 0)
    letters = AXIS_LETTERS[: curve.axes]
    place = {"blocks_kind": BlockKind.__members__["PLACE"].value}
    place |= {f"blocks_end_{a}": value for a, value in zip(letters, curve.start, strict=True)}
    for name, value in place.items():
        blocks[0, fields.index(name)] = value
    return blocks


def pace_limit(curve: Curve, drive: Drive, interpolator_clocks: int) -> int:
    """Give the most clocks that a curve may take on the device."""
    path = float(octagon(curve.blocks, curve.kind).sum())
    feed = float(drive.programmed)
    return pace_limit_of(path, path / feed, feed, len(curve.blocks), drive, interpolator_clocks)


def pace_limit_of(
    path: float, pauses: float, feed: float, blocks: int, drive: Drive, interpolator_clocks: int
) -> int:
    """Give the most clocks for a path of so many steps, pauses of so many clocks and blocks.

    ``feed`` is the highest speed, in steps per clock.
    """
    acceleration = float(drive.acceleration)
    # Where both axes step, but not in turns, the pauses are longer than the path is by the octagon.
    clocks = sqrt(2) * pauses
    if acceleration:
        # Up from a standstill and down, or half of the way each.
        clocks += 2 * min(feed / acceleration, sqrt(2 * max(path, 1) / acceleration))
        clocks += 4 * sqrt(2 / acceleration)
    # Every step with a turn of direction, one axis at a time.
    period = sum(max(1, value) for value in vars(drive.timing).values()) + 4
    clocks += sqrt(2) * path * period + _HAND_OVER * blocks + _OVERHEAD + period
    return ceil(clocks) + interpolator_clocks


def _straight(moves: np.ndarray) -> np.ndarray:
    """Give the lengths of straight moves."""
    return np.hypot(*moves.T)


@dataclass
class Trail:
    """A path, of which only a digest is kept: enough to tell whether another one is the same.

    Attributes
    ----------
    moves : int
        Points so far, the start aside.
    low, high : arrays of int64, shape (axes,)
        Corners of all points, the start too, in steps.
    """

    start: np.ndarray
    moves: int = 0

    def __post_init__(self):
        self.low, self.high = self.start.copy(), self.start.copy()
        self._digest = sha256()

    def follow(self, points: np.ndarray) -> None:
        """Take in points, shape (moves, axes)."""
        if len(points):
            self.moves += len(points)
            self.low = np.minimum(self.low, points.min(axis=0))
            self.high = np.maximum(self.high, points.max(axis=0))
            self._digest.update(np.ascontiguousarray(points, dtype="<i8").tobytes())

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Trail):
            return NotImplemented
        return self.moves == other.moves and self._digest.digest() == other._digest.digest()

    __hash__ = None  # pyright: ignore[reportAssignmentType]


class Machine:
    """A curve on a device with one interpolator, and what a virtual machine makes of its pins.

    A machine of several kinds of blocks overrides :meth:`blocks` and :attr:`length`.

    Parameters
    ----------
    curve : Curve
        Of a machine of several kinds its ``start`` and ``axes`` are enough.
    interpolators : dict of str to Part
        By kind; of methods that draw such curves. An exact line or arc runs at constant speed here.
    drive : Drive
    expected : Trail
        The points of the interpolator alone.

    Attributes
    ----------
    device : Device
    plotter : Plotter
        It has seen the pins.
    pen : Pen
        It has drawn what the plotter made of them.
    screen : Screen
        It shows the same, as far as it has the expected points' corners.
    clocks : int
        Run so far.
    """

    def __init__(self, curve: Any, interpolators: dict[str, Part], drive: Drive, expected: Trail):
        exact = (ExactLine, ExactArc)
        self.device = Device(
            **{
                kind: ConstantSpeed(part) if isinstance(part, exact) else part
                for kind, part in interpolators.items()
            }
        )
        self.plotter = Plotter(curve.start, drive.timing, keep_moves=False)
        self.pen = Pen(curve.start)
        self.screen = Screen(curve.start, expected.low, expected.high)
        self.clocks = 0
        self._curve, self._drive = curve, drive
        self._expected, self._trail = expected, Trail(curve.start)
        self._accepted: int | None = None
        self._last = 0
        self._reason = 0
        self._position = curve.start

    def blocks(self) -> np.ndarray:
        """Give what the device is given."""
        return device_blocks(self.device, self._curve, self._drive)

    @property
    def length(self) -> float:
        """Give the true curve's length, in steps."""
        if self._curve.kind == "conic":
            return sum(of_conic(block, _straight) for block in self._curve.blocks)
        return float(lengths(self._curve.kind, self._curve.blocks).sum())

    def run(
        self, *, limit: int, engine: str, vcd: IO[str] | None = None
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Run the curve; give clocks, from the first block on, and points of the pins' moves."""
        letters = AXIS_LETTERS[: self._curve.axes]
        stretches = simulate(
            self.device,
            self.blocks(),
            limit=limit,
            engine=engine,
            watch=("reason", *(f"position_{a}" for a in letters)),
            vcd=vcd,
            controls=self._drive.controls,
        )
        column = {name: index for index, name in enumerate(EVENT_COLUMNS)}
        for stretch in stretches:
            events = stretch.events
            if self._accepted is None and len(events):
                # The block behind the one that says where the machine stands.
                offered = events[events[:, column["accepted"]] == 1, column["clock"]]
                self._accepted = int(offered[1])
            changed = events[:, column["taken"]] == 1
            when, points = self.plotter.follow(
                events[changed, column["clock"]], events[changed, len(column) :]
            )
            self._trail.follow(points)
            self.pen.follow(points)
            inside = np.all(
                (points >= self._expected.low) & (points <= self._expected.high), axis=1
            )
            self.screen.plot(points[inside])
            self.clocks += stretch.ran
            if len(when):
                self._last = int(when[-1])
            self._reason, *position = stretch.watch[-1].tolist()
            self._position = np.array(position)
            yield when - (self._accepted or 0), points
        self.plotter.finish(self.clocks)

    @property
    def good(self) -> bool:
        """The pins show the same points in order, as they are counted, within the rules."""
        return (
            self._trail == self._expected
            and np.array_equal(self.plotter.position, self._position)
            and not self.plotter.violation_count
            and not self.plotter.unfinished
            and not self._reason
        )

    def facts(self) -> dict[str, Any]:
        """Give what the summary says of a run on the device.

        F, acceleration and pulses as programmed; clocks from the acceptance of the first block to
        the last pulse; speed, the true curve's length by them; pulses by axis; broken rules; the
        same points as of the interpolator alone.
        """
        drive, length = self._drive, self.length
        clocks = self._last - (self._accepted or 0)
        return {
            "feed": round(float(drive.programmed), 12),
            "acceleration": float(drive.acceleration),
            "pulse length, space, set-up, hold": list(vars(drive.timing).values()),
            "device clocks": clocks,
            "mean speed": round(length / clocks, 6) if clocks else None,
            "pulses": self.plotter.pulses.tolist(),
            "timing rules broken": self.plotter.violation_count,
            "position is the pulses": bool(np.array_equal(self.plotter.position, self._position)),
            "same points from the pins": self._trail == self._expected,
            **({"stopped": StopReason(self._reason).name} if self._reason else {}),
        }
