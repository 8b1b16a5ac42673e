"""The stress run of the whole device: random blocks and orders, judged by the pins."""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field, fields
from functools import cache
from itertools import islice
from typing import Any

import numpy as np

from discreta.hdl.constant_speed import FRACTION_BITS
from discreta.hdl.contract import Part
from discreta.hdl.device import Device, exact_device
from discreta.hdl.feed import FULL_OVERRIDE, MAX_OVERRIDE, RATE_BITS
from discreta.hdl.queue import StopReason
from discreta.sim.arcs import refusals
from discreta.sim.compiled import CompiledModel
from discreta.sim.conics import KINDS as CONIC_KINDS
from discreta.sim.conics import motion, random_blocks
from discreta.sim.golden.exact_arc import ExactArc as GoldenExactArc
from discreta.sim.golden.exact_conic import ExactConic as GoldenExactConic
from discreta.sim.golden.exact_line import ExactLine as GoldenExactLine
from discreta.sim.plotter import Plotter, PulseTiming
from discreta.sim.stalls import Stalls
from discreta.sim.stretch import EVENT_COLUMNS

__all__ = ["WIDTHS", "Report", "make_device", "stress"]

#: Widths there are conics enough for, and lines short enough that a run stays quick.
WIDTHS = (6, 7)

_KINDS = ("line", "arc", "conic")
#: Which steps there are, and in which order, does not depend on their speed: without ticks.
_GOLDEN: tuple[Callable[[int], Any], ...] = (GoldenExactLine, GoldenExactArc, GoldenExactConic)
#: What the interpolators are given besides start and end, and the pace.
_OWN = (
    (),
    ("center_x", "center_y", "clockwise", "full_turns"),
    (*"abcde", "clockwise", "turns"),
)
_TIMINGS = ("pulse_length", "pulse_space", "direction_setup", "direction_hold")
_LIMITS = tuple(
    (f"{side}_limit_{a}", axis, way)
    for axis, a in enumerate("xy")
    for side, way in (("low", -1), ("high", 1))
)

#: Differences that are kept.
_KEPT = 20
#: Clocks in which an episode must be over, and those of one block in its golden model.
_MOST, _GOLDEN_MOST = 1 << 20, 1 << 13
#: A curve that starts beside its own may take for ever: after so many clocks it is stopped.
_ASTRAY = 2000
#: Clocks that the device stands between two episodes, before and behind.
_STANDS = 24
#: A step is ready so many clocks after its block was accepted, or the step before it left.
_READY = 250
#: Blocks of a part of a run, of a device of its own; and those whose steps are remembered.
_PART, _REMEMBERED = 10_000, 50_000
#: Episodes without a block after which a device is given up.
_PATIENCE = 20


def make_device(width: int) -> Device:
    """Make the device that is run: all interpolators, 16 blocks wait."""
    return exact_device(width, kinds=_KINDS, depth=16)


@dataclass
class Report:
    """What a stress run found.

    Attributes
    ----------
    blocks : int
        Accepted by the device.
    kinds : Counter
        The same by their kind.
    steps, clocks, episodes, holds, singles, violations : int
        Moves of the pins, clocks run, chains of blocks, holds, single steps ordered, and broken
        rules of the pulses' timing.
    pulses : tuple of int
        By axis.
    stops : Counter
        Episodes by the name of the reason at their end; ``NONE``: all blocks were done.
    differences : list of str
        What is wrong, the first 20 lines.
    seconds : float
    """

    blocks: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    steps: int = 0
    pulses: tuple[int, ...] = (0, 0)
    clocks: int = 0
    episodes: int = 0
    stops: Counter[str] = field(default_factory=Counter)
    holds: int = 0
    singles: int = 0
    violations: int = 0
    differences: list[str] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def good(self) -> bool:
        """Blocks were run, no rule was broken, and nothing differs."""
        return self.blocks > 0 and not self.violations and not self.differences

    def add(self, other: "Report") -> None:
        """Take in another part of the run."""
        self.pulses = tuple(a + b for a, b in zip(self.pulses, other.pulses, strict=True))
        for name in (f.name for f in fields(self) if f.name not in ("pulses", "seconds")):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        del self.differences[_KEPT:]

    def rows(self) -> list[tuple[str, str]]:
        """Give the report as a table: what, and how many."""
        return [
            ("blocks", f"{self.blocks:,}"),
            *((f"  {kind}s", f"{self.kinds[kind]:,}") for kind in _KINDS),
            ("steps", f"{self.steps:,}"),
            *((f"pulses of {a}", f"{n:,}") for a, n in zip("xy", self.pulses, strict=True)),
            ("clocks", f"{self.clocks:,}"),
            ("episodes", f"{self.episodes:,}"),
            *((f"  {name} at the end", f"{n:,}") for name, n in sorted(self.stops.items())),
            ("holds", f"{self.holds:,}"),
            ("single steps", f"{self.singles:,}"),
            ("timing rules broken", f"{self.violations:,}"),
            ("differences", "\n".join(self.differences)),
            ("seconds", f"{self.seconds:.1f}"),
        ]


def stress(
    blocks: int = 100_000,
    *,
    seed: int,
    width: int = 6,
    progress: Callable[[int], None] | None = None,
    workers: int = 2,
    make: Callable[[int], Part] = make_device,
    inputs: Mapping[str, int] | None = None,
) -> Report:
    """Run random blocks under random orders through whole devices, and judge their pins.

    In episodes: a chain of blocks, each from the end of the one before, until all are done or the
    device has stopped; then it is cleared and goes on from where it stands, without a reset. A
    block that was offered when it stopped is still offered then, from another start.

    Feeds from 1 to 1/64, accelerations, timings of the pulses and gaps in the supply are drawn, and
    so are holds, single steps, overrides, stops, emergency stops and limit switches. Every reason
    to stop comes but ``KIND``: no kind of block is unknown to this device. No device is told where
    it stands (``PLACE``): its pulses would not tell its position.

    Judged: the timing of the pulses; the position at every clock; every step, against the golden
    models; ``done`` and ``reason``; and that nothing moves that must not.

    Parameters
    ----------
    blocks : int
        To be accepted, or a few more.
    seed : int
        The same blocks and orders whatever the number of workers.
    width : int
        One of :data:`WIDTHS`.
    progress : callable or None
        Is told of blocks accepted, part by part.
    workers : int
        Processes; 1: this one alone.
    make : callable
        Makes the device of a width: a function of a module, if there are several processes.
    inputs : mapping of str to int
        What further inputs of such a device are set to.

    Raises
    ------
    ValueError
        There is no run of this width, or of so few blocks or workers.
    RuntimeError
        There is no C++ compiler.
    """
    if width not in WIDTHS:
        raise ValueError(f"width is {width}: choose {' or '.join(map(str, WIDTHS))}")
    for what, value in (("blocks", blocks), ("workers", workers)):
        if value < 1:
            raise ValueError(f"number of {what} is {value}: choose 1 or more")
    began = time.monotonic()
    counts = [min(_PART, blocks - first) for first in range(0, blocks, _PART)]
    parts = [
        (count, (seed, number), width, make, dict(inputs or {}))
        for number, count in enumerate(counts)
    ]
    reports: dict[int, Report] = {}
    for number, part in _done(parts, workers):
        reports[number] = part
        if progress is not None:
            progress(part.blocks)
    report = Report()
    for number in sorted(reports):
        report.add(reports[number])
    report.seconds = time.monotonic() - began
    return report


def _done(parts: list[tuple], workers: int) -> Iterator[tuple[int, Report]]:
    """Run parts, and give each with its number as soon as it is done."""
    if workers == 1 or len(parts) == 1:
        yield from ((number, _run_part(*part)) for number, part in enumerate(parts))
        return
    _, _, width, make, _ = parts[0]
    # Compiled here, found in the cache by every part.
    CompiledModel(make(width), watch=_WATCH).close()
    with ProcessPoolExecutor(workers) as pool:
        try:
            jobs = {pool.submit(_run_part, *part): number for number, part in enumerate(parts)}
            for job in as_completed(jobs):
                yield jobs[job], job.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _run_part(
    blocks: int,
    seed: tuple[int, int],
    width: int,
    make: Callable[[int], Part],
    inputs: dict[str, int],
) -> Report:
    """Run so many blocks through one device."""
    run = _Run(width, seed, make, inputs)
    # A device that takes nothing, or never rests, is given up.
    idle = 0
    while run.accepted < blocks and idle < _PATIENCE:
        before = run.accepted
        if not run.episode():
            break
        idle = idle + 1 if run.accepted == before else 0
    report = run.judge()
    if idle == _PATIENCE:
        report.differences.insert(0, f"no block is accepted in {idle} episodes")
    return report


# What is run


@dataclass(frozen=True)
class _Block:
    """A block: its kind's number, its end, what its kind has besides, its speed and its pace."""

    kind: int
    end: tuple[int, int]
    own: tuple[int, ...] = ()
    feed: tuple[int, int, int] = (0, 0, 0)
    pace: int = 0

    def row(self, names: tuple[str, ...]) -> list[int]:
        """Write it as the device's ports have it."""
        values = dict(zip(_OWN[self.kind], self.own, strict=True))
        values |= {"kind": self.kind, "pace": self.pace, "end_x": self.end[0], "end_y": self.end[1]}
        values |= dict(zip(("feed_mantissa", "feed_exponent", "ahead"), self.feed, strict=True))
        return [values.get(name.removeprefix("blocks_"), 0) for name in names]


class _Supply:
    """Draws chains of blocks. Curves lie where lines lead from each to each, and no further."""

    def __init__(self, width: int, seed: int):
        self.random = np.random.default_rng(seed)
        self.near = (1 << (width - 1)) - 1
        self.top = 1 << width
        self.curves = {1: self._arcs(width, 400), 2: self._conics(width, 300)}

    def _kept(self, rows: np.ndarray, points: slice) -> np.ndarray:
        return rows[np.all(np.abs(rows[:, points]) <= self.near, axis=1)]

    def _arcs(self, width: int, count: int) -> np.ndarray:
        drawn = self.random
        many = 16 * count
        rows = np.zeros((many, 8), dtype=np.int64)
        rows[:, 4:6] = drawn.integers(-self.near, self.near, (many, 2), endpoint=True)
        radius = np.exp(drawn.uniform(0, np.log(self.near), many))
        for column in (0, 2):
            angle = drawn.uniform(0, 2 * np.pi, many)
            point = np.rint(radius * [np.cos(angle), np.sin(angle)]).T.astype(np.int64)
            rows[:, column : column + 2] = rows[:, 4:6] + point
        rows[:, 6] = drawn.integers(0, 2, many)
        rows[:, 7] = drawn.random(many) < 0.02
        rows = self._kept(rows, slice(0, 4))
        return rows[refusals(rows, width) == 0][:count]

    def _conics(self, width: int, count: int) -> np.ndarray:
        each = count // len(CONIC_KINDS)
        drawn = [random_blocks(kind, width, 6 * each, self.random) for kind in CONIC_KINDS]
        rows = np.concatenate([self._kept(rows, slice(5, 9))[:each] for rows in drawn])
        return rows[motion(rows).steps <= 2 * self.near]

    def chain(self, first: list[_Block], at: tuple[int, int]) -> list[_Block]:
        """Draw an episode's blocks behind those that are offered already."""
        random = self.random
        feed = (int(random.integers(1 << 16)), int(random.integers(7)))
        blocks = list(first)
        if first:
            at = first[-1].end
        # From anywhere halfway back: half of the coordinates there are is always near enough.
        blocks.append(self._block(0, (at[0] // 2, at[1] // 2), (), feed))
        at = blocks[-1].end
        count = int(random.integers(40, 60, endpoint=True))
        refused = int(random.integers(count // 2)) if random.random() < 0.4 else -1
        while len(blocks) < count:
            if random.random() < 0.2:
                feed = (int(random.integers(1 << 16)), int(random.integers(7)))
            if 0 <= refused <= len(blocks):
                refused = -1
                blocks += self._refused(at, feed)
                # Behind it nothing runs, whatever it is.
                continue
            drawn = random.random()
            if drawn < 0.06:
                blocks.append(self._of_no_length(at, feed))
            elif drawn < 0.35:
                near = max(2, self.near // 3)
                move = random.integers(-near, near, 2, endpoint=True)
                end = np.clip(np.array(at) + move, -self.near, self.near)
                blocks.append(self._block(0, tuple(end.tolist()), (), feed))
            else:
                kind = 1 if drawn < 0.7 else 2
                row = self.curves[kind][random.integers(len(self.curves[kind]))].tolist()
                start, end, own = _apart(kind, row)
                if start != at:
                    blocks.append(self._block(0, start, (), feed))
                blocks.append(self._block(kind, end, own, feed))
            at = blocks[-1].end
        return blocks

    def _block(
        self, kind: int, end: tuple[int, ...], own: tuple[int, ...], feed: tuple[int, int]
    ) -> _Block:
        ahead = int(self.random.choice([0, 20, 200, 2000]))
        pace = self._pace(kind, end, own) if self.random.random() < 0.8 else 0
        return _Block(kind, (end[0], end[1]), own, (*feed, ahead), pace)

    def _pace(self, kind: int, end: tuple[int, ...], own: tuple[int, ...]) -> int:
        """Draw one that may be right, and is not always: it must be harmless."""
        if kind == 0:
            return int(self.random.integers(self.top << FRACTION_BITS))
        if kind == 1:
            radius = np.hypot(end[0] - own[0], end[1] - own[1])
            # Offered again from elsewhere an arc may be a large one: not too many ticks for a step.
            least, most = self.top << FRACTION_BITS - 5, (self.top << FRACTION_BITS + 1) - 1
            factor = self.random.choice([1, self.random.uniform(0.25, 4)])
            return min(most, max(least, round(radius * factor * 2**FRACTION_BITS)))
        return 0

    def _of_no_length(self, at: tuple[int, int], feed: tuple[int, int]) -> _Block:
        own = {0: (), 1: (*at, 0, 0), 2: (1, 0, 1, 5, 5, 0, 0)}
        kind = int(self.random.integers(3))
        return self._block(kind, at, own[kind], feed)

    def _refused(self, at: tuple[int, int], feed: tuple[int, int]) -> list[_Block]:
        """Draw one that must be refused, with what leads to it."""
        low = -self.near - 1
        x, y = at
        kind, end, own = (
            (0, (self.top - 1, y), ()),
            # Too far from the centre, on whichever side it is.
            (1, at, (self.top - 1 if x < 0 else -self.top, y, 0, 0)),
            (1, (x + 9, y), (x + 3, y, 0, 0)),
            # The start is the centre of an ellipse.
            (2, (x + 3, y), (1, 0, 1, -2 * x, -2 * y, 0, 1)),
        )[int(self.random.choice(4, p=[0.25, 0.2, 0.2, 0.35]))]
        # A line to the other side is too long from there.
        lead = [self._block(0, (low, y), (), feed)] if kind == 0 else []
        return [*lead, self._block(kind, end, own, feed)]


def _apart(kind: int, row: list[int]) -> tuple[tuple[int, int], tuple[int, int], tuple[int, ...]]:
    """Give start, end and what else a curve has."""
    at = 0 if kind == 1 else 5
    x, y, end_x, end_y = row[at : at + 4]
    return (x, y), (end_x, end_y), (*row[:at], *row[at + 4 :])


@dataclass
class _Orders:
    """What happens around the device in an episode, by the clock.

    Attributes
    ----------
    rows : list of (int, str, int)
        From which clock on, which control, its value.
    settles : int
        Clocks from a hold's begin to the last step that may still come.
    clear : int
        When it is cleared.
    holds : list of (int, int, list of int)
        From, to, and the rising edges of ``single``.
    switches : list of (str, int, int)
        Limit switches, from and to.
    stops, emergencies : list of int
        When they begin.
    """

    rows: list[tuple[int, str, int]]
    settles: int
    clear: int
    holds: list[tuple[int, int, list[int]]] = field(default_factory=list)
    switches: list[tuple[str, int, int]] = field(default_factory=list)
    stops: list[int] = field(default_factory=list)
    emergencies: list[int] = field(default_factory=list)

    def give(self, what: str, first: int, last: int, value: int = 1, then: int = 0) -> None:
        """Set a control for a while."""
        self.rows += [(first, what, value), (last, what, then)]

    def table(self, controls: tuple[str, ...]) -> np.ndarray:
        """Write them for the engine."""
        rows = sorted(self.rows, key=lambda row: row[0])
        return np.array(
            [(clock, controls.index(what), value) for clock, what, value in rows], dtype=np.int64
        )

    def towards(self, when: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Tell the steps that lead towards a switch that is active in those clocks."""
        found = np.zeros(len(when), dtype=bool)
        for name, first, last in self.switches:
            axis, way = next((axis, way) for n, axis, way in _LIMITS if n == name)
            found |= (when >= first) & (when < last) & (steps[:, axis] == way)
        return found


def _draw_orders(
    random: np.random.Generator,
    clock: int,
    timing: PulseTiming,
    inputs: dict[str, int],
    standing: StopReason,
    kept: list[str],
    astray: bool,
) -> _Orders:
    """Draw an episode's orders; switches of the one before may be ``kept`` active for a while.

    Where the first curve runs ``astray`` an emergency stop ends it soon.
    """
    exponent = int(random.choice([0, 0, 9, 10, 11]))
    ramp = 2**exponent if exponent else 0
    settles = ramp + 2 * sum(vars(timing).values()) + 16
    settings = {
        "override": FULL_OVERRIDE,
        "acceleration": 2 ** (RATE_BITS - exponent) * bool(exponent),
    }
    settings |= dict(zip(_TIMINGS, vars(timing).values(), strict=True)) | inputs
    settings |= dict.fromkeys(("hold", "single", "stop", "clear"), 0)
    settings |= {name: 0 for name, _, _ in _LIMITS if name not in kept}
    orders = _Orders([(clock, name, value) for name, value in settings.items()], settles, 0)
    for name in kept:
        until = clock + int(random.integers(100, 500))
        orders.rows.append((until, name, 0))
        orders.switches.append((name, clock - _STANDS, until))
    released = clock
    if standing is StopReason.EMERGENCY:
        # Not cleared as long as it is given.
        orders.give("clear", clock + 4, clock + 5)
        released = clock + 8
        orders.rows.append((clock, "emergency", 1))
    orders.rows.append((released, "emergency", 0))
    orders.clear = released + int(random.integers(2, _STANDS))
    orders.give("clear", orders.clear, orders.clear + 1)

    now = orders.clear + 2
    if astray:
        now += int(random.integers(20, _ASTRAY))
        orders.give("emergency", now, now + 5)
        orders.emergencies.append(now)
        return orders
    for _ in range(40):
        now += int(random.exponential(1500)) + 20
        what = random.choice(
            ["hold", "override", "limit", "stop", "emergency"], p=[0.37, 0.39, 0.14, 0.05, 0.05]
        )
        if what == "hold":
            edges = [now + settles + _READY * k + int(random.integers(9)) for k in range(4)]
            edges = edges[: int(random.integers(5))]
            last = now + settles + _READY * len(edges) + int(random.integers(20, 200))
            orders.give("hold", now, last)
            for edge in edges:
                orders.give("single", edge, edge + int(random.integers(1, 50)))
            orders.holds.append((now, last, edges))
            if random.random() < 0.1:
                what = random.choice(["stop", "emergency"])
            now = last
        elif what == "override":
            last = now + int(random.integers(20, 800))
            value = int(random.choice([0, 16, 64, 200, MAX_OVERRIDE]))
            orders.give("override", now, last, value, FULL_OVERRIDE)
            now = last
        elif what == "limit":
            name = _LIMITS[int(random.integers(4))][0]
            last = now + int(random.integers(1, 400))
            orders.give(name, now, last)
            orders.switches.append((name, now, last))
            now = last
        if what in ("stop", "emergency"):
            if orders.holds and now == orders.holds[-1][1]:
                first, last, _ = orders.holds[-1]
                now = int(random.integers(first, last))
            lasts = int(random.integers(1, 30))
            orders.give(str(what), now, now + lasts)
            (orders.stops if what == "stop" else orders.emergencies).append(now)
            break
    return orders


# What must come of it


class _Golden:
    """The golden interpolators, for many blocks at once; what was run once is remembered."""

    def __init__(self, width: int):
        self._models = [make(width) for make in _GOLDEN]
        self._known: dict[tuple, tuple[np.ndarray, int]] = {}

    def answers(
        self, starts: list[tuple[int, int]], blocks: list[_Block]
    ) -> list[tuple[np.ndarray, int]]:
        """Give every block's steps, shape (steps, 2), and the code of its refusal, or 0.

        The code is −1 if it is not answered in the clocks that any sound block takes.
        """
        keys = [
            (block.kind, *start, *block.end, *block.own)
            for start, block in zip(starts, blocks, strict=True)
        ]
        if len(self._known) > _REMEMBERED:
            self._known.clear()
        for kind in range(len(_KINDS)):
            new = list(dict.fromkeys(k for k in keys if k[0] == kind and k not in self._known))
            if new:
                self._known |= dict(zip(new, self._run(kind, new), strict=True))
        return [self._known[key] for key in keys]

    def _run(self, kind: int, keys: list[tuple]) -> list[tuple[np.ndarray, int]]:
        golden, count = self._models[kind], len(keys)
        names = ("start_x", "start_y", "end_x", "end_y", *_OWN[kind])
        columns = np.array(keys, dtype=np.int64).T[1:]
        given = {f"blocks_{name}": c for name, c in zip(names, columns, strict=True)}
        state = {name: np.full(count, value) for name, value in golden.reset().items()}
        numbers, codes = np.arange(count), np.full(count, -1)
        rows = []
        for clock in range(_GOLDEN_MOST):
            out = golden.outputs(state)
            leaves = np.flatnonzero(out["steps_valid"])
            if len(leaves):
                rows.append(
                    np.stack([numbers[leaves], *(out[f"steps_{a}"][leaves] for a in "xy")], axis=1)
                )
            ended = (out["done"] != 0) | (out["error"] != 0)
            if ended.any():
                codes[numbers[ended]] = out["error"][ended]
                left = ~ended
                numbers = numbers[left]
                state = {name: value[left] for name, value in state.items()}
                given = {name: value[left] for name, value in given.items()}
                if not len(numbers):
                    break
            valid = np.full(len(numbers), int(clock == 0))
            state = golden.step(state, given | {"blocks_valid": valid, "steps_ready": valid | 1})
        steps = np.concatenate(rows) if rows else np.empty((0, 3), dtype=np.int64)
        steps = steps[np.argsort(steps[:, 0], kind="stable")]
        edges = np.searchsorted(steps[:, 0], np.arange(1, count))
        return list(zip(np.split(steps[:, 1:], edges), codes.tolist(), strict=True))


@cache
def _golden(width: int) -> _Golden:
    """Give the golden models of a width, with what this process has run of them."""
    return _Golden(width)


#: What is recorded at every clock.
_WATCH = ("reason", "position_x", "position_y")
_COLUMN = {name: index for index, name in enumerate(EVENT_COLUMNS)}


class _Run:
    """Episodes of one device."""

    def __init__(
        self,
        width: int,
        seed: tuple[int, int],
        make: Callable[[int], Part],
        inputs: dict[str, int],
    ):
        self.report = Report()
        self._seed = seed
        self._random = np.random.default_rng(seed)
        self._inputs = inputs
        self._model = CompiledModel(make(width), watch=_WATCH)
        # The curves are those of the whole run: their steps are reckoned once a process.
        self._supply = _Supply(width, seed[0])
        self._supply.random = self._random
        self._golden = _golden(width)
        self._clock = 0
        self._pins = np.zeros(4, dtype=np.int64)
        #: What was recorded last.
        self._watched = np.zeros(len(_WATCH), dtype=np.int16)
        self._offered: list[_Block] = []
        #: Blocks so far.
        self.accepted = 0
        self._episodes: list[tuple[_Seen, _Orders, PulseTiming, list[_Block], int]] = []
        self._active: list[str] = []

    def episode(self) -> bool:
        """Run a chain of blocks until the device stands; tell whether it does."""
        random, model = self._random, self._model
        begin, start = self._clock, (int(self._watched[1]), int(self._watched[2]))
        standing = StopReason(int(self._watched[0]))
        timing = PulseTiming(*random.integers(1, 6, 4, endpoint=True).tolist())
        kept = self._active if random.random() < 0.3 else []
        astray = any(block.kind == 2 for block in self._offered)
        orders = _draw_orders(random, begin, timing, self._inputs, standing, kept, astray)
        chain = self._supply.chain(self._offered, start)
        stalls = Stalls(int(random.integers(1 << 62)), gap=float(random.choice([0, 0.5, 0.97])))
        rows = np.array([block.row(model.block_fields) for block in chain], dtype=np.int64)
        table = orders.table(model.control_fields)
        # It stands until it is cleared; what it had before is not idle but told to go on.
        first = model.run(
            rows, orders.clear - begin + 4, stalls=stalls, event_room=_MOST, orders=table
        )
        main = model.run(
            rows[first.fed :],
            _MOST,
            stalls=stalls,
            event_room=_MOST,
            orders=table[first.ordered :],
            until_idle=True,
        )
        # Nothing more is given, and nothing may come.
        rest = model.run(rows[:0], _STANDS, event_room=_MOST)
        parts = (first, main, rest)
        seen = _Seen(
            begin=begin,
            end=begin + first.ran + main.ran,
            start=np.array(start),
            fed=first.fed + main.fed,
            events=np.concatenate([part.events for part in parts]),
            watch=np.concatenate([part.watch for part in parts]).astype(np.int16),
            pins=self._pins,
            top=self._supply.top,
            total=self._clock + sum(part.ran for part in parts),
            stood=int(self._watched[0]),
            came_to_rest=main.idle,
        )
        self._clock += sum(part.ran for part in parts)
        self.accepted += seen.fed
        self._episodes.append((seen, orders, timing, chain[: seen.fed], len(chain)))
        self._after(seen, orders, chain, stalls)
        return main.idle

    def judge(self) -> Report:
        """Judge all episodes: the golden models are quick with many blocks at once."""
        starts, blocks = [], []
        for seen, _, _, given, _ in self._episodes:
            starts += [tuple(seen.start.tolist()), *(block.end for block in given)][: len(given)]
            blocks += given
        answers = iter(self._golden.answers(starts, blocks))
        for episode in self._episodes:
            self._judge(*episode, list(islice(answers, len(episode[3]))))
        return self.report

    def _after(self, seen: "_Seen", orders: _Orders, chain: list[_Block], stalls: Stalls) -> None:
        """Remember what the next episode begins with."""
        self._watched = seen.watch[-1]
        changed = seen.events[seen.events[:, _COLUMN["taken"]] == 1]
        if len(changed):
            self._pins = changed[-1, len(EVENT_COLUMNS) :]
        accepted = seen.accepted
        since = int(accepted[-1]) + 1 if len(accepted) else seen.begin
        offers = bool(self._offered) and not len(accepted)
        offers |= any(stalls.offers(clock) for clock in range(since, seen.end))
        self._offered = chain[seen.fed : seen.fed + 1] if offers else []
        self._active = [name for name, first, last in orders.switches if first < seen.end <= last]

    def _judge(
        self,
        seen: "_Seen",
        orders: _Orders,
        timing: PulseTiming,
        given: list[_Block],
        drawn: int,
        answers: list[tuple[np.ndarray, int]],
    ) -> None:
        """Judge an episode, and count it."""
        report = self.report
        plotter = Plotter(seen.start, timing)
        # The directions as they were, from long before on.
        plotter.follow(np.array([seen.begin - (1 << 13)]), seen.pins[None] * [0, 1, 0, 1])
        changed = seen.events[:, _COLUMN["taken"]] == 1
        when, points = plotter.follow(
            seen.events[changed, _COLUMN["clock"]], seen.events[changed, len(EVENT_COLUMNS) :]
        )
        plotter.finish(seen.total)
        moves = np.diff(np.concatenate([seen.start[None], points]), axis=0)
        judge = _Judge(seen, orders, when, moves, answers, drawn)
        found = [f"pulse timing: {text}" for text in plotter.violations[:3]]
        found += [f"pulse timing: {text}" for text in plotter.unfinished]
        found += judge.found()
        at = f"seed {self._seed[0]}, part {self._seed[1]}, episode {report.episodes + 1}"
        report.differences += [f"{at}: {text}" for text in found]
        del report.differences[_KEPT:]

        report.blocks += seen.fed
        report.kinds.update(_KINDS[block.kind] for block in given)
        report.steps += len(when)
        pulses = plotter.pulses.tolist()
        report.pulses = tuple(a + b for a, b in zip(report.pulses, pulses, strict=True))
        report.clocks += len(seen.watch)
        report.episodes += 1
        report.stops[StopReason(int(seen.watch[-1, 0])).name] += 1
        begun = [hold for hold in orders.holds if hold[0] < seen.end]
        report.holds += len(begun)
        report.singles += sum(edge < seen.end for *_, edges in begun for edge in edges)
        report.violations += plotter.violation_count + len(plotter.unfinished)


@dataclass
class _Seen:
    """What was seen of an episode.

    Up to ``end`` it ran, from then on it stood to ``total``; before it ``pins`` were what they were
    and ``stood`` was the reason. Coordinates are −``top`` to ``top`` − 1.
    """

    begin: int
    end: int
    start: np.ndarray
    fed: int
    events: np.ndarray
    watch: np.ndarray
    pins: np.ndarray
    top: int
    total: int
    stood: int
    came_to_rest: bool

    @property
    def accepted(self) -> np.ndarray:
        """When blocks were accepted."""
        return self.events[self.events[:, _COLUMN["accepted"]] == 1, _COLUMN["clock"]]

    def reason_at(self, clock: int) -> int:
        """Give the reason shown in a clock."""
        return int(self.watch[clock - self.begin, 0])


class _Judge:
    """Says what is wrong with an episode."""

    def __init__(
        self,
        seen: _Seen,
        orders: _Orders,
        when: np.ndarray,
        moves: np.ndarray,
        answers: list[tuple[np.ndarray, int]],
        given: int,
    ):
        self.seen, self.orders, self.when, self.moves = seen, orders, when, moves
        self.given = given
        codes = [code for _, code in answers]
        #: The first that must be refused, or that takes for ever; behind it nothing runs.
        self.refused = next((k for k, code in enumerate(codes) if code), len(codes))
        self.code = max(0, codes[self.refused]) if self.refused < len(codes) else 0
        # What is refused has no steps.
        runs = [steps for steps, _ in answers[: self.refused + 1]]
        self.expected = np.concatenate([np.empty((0, 2), dtype=np.int64), *runs])
        #: Steps up to the end of so many blocks.
        self.upto = np.concatenate([[0], np.cumsum([len(steps) for steps in runs], dtype=int)])
        self.done = int(np.count_nonzero(seen.events[:, _COLUMN["done"]]))
        self.reason = StopReason(int(seen.watch[-1, 0]))

    def found(self) -> list[str]:
        """Give what is wrong, in words."""
        return [
            text
            for judged in (
                self._rests,
                self._position,
                self._steps,
                self._answers,
                self._reason,
                self._standing,
                self._emergency,
                self._switches,
                self._holds,
            )
            if (text := judged())
        ]

    def _rests(self) -> str:
        if not self.seen.came_to_rest:
            return f"still busy at clock {self.seen.end}"
        return ""

    def _position(self) -> str:
        seen = self.seen
        points = np.concatenate([seen.start[None], seen.start + np.cumsum(self.moves, axis=0)])
        clocks = seen.begin + np.arange(len(seen.watch))
        counted = points[np.searchsorted(self.when, clocks, side="right")]
        # A curve that is offered again from elsewhere may lead out of the coordinates there are.
        counted = (counted + seen.top) % (2 * seen.top) - seen.top
        wrong = np.flatnonzero((counted != seen.watch[:, 1:]).any(axis=1))
        if not len(wrong):
            return ""
        clock = wrong[0]
        shown, made = (tuple(p[clock].tolist()) for p in (seen.watch[:, 1:], counted))
        return f"position: {shown} is shown at clock {seen.begin + clock}, the pulses make {made}"

    def _steps(self) -> str:
        many = min(len(self.moves), len(self.expected))
        wrong = np.flatnonzero((self.moves[:many] != self.expected[:many]).any(axis=1))
        if len(wrong):
            at = int(wrong[0])
            block = int(np.searchsorted(self.upto, at, side="right")) - 1
            made, right = (tuple(p[at].tolist()) for p in (self.moves, self.expected))
            return (
                f"steps: step {at - self.upto[block]} of block {block} is {made} at clock "
                f"{self.when[at]}, its golden model has {right}"
            )
        if len(self.moves) > many:
            return f"steps: one more than the blocks have, at clock {self.when[many]}"
        return ""

    def _answers(self) -> str:
        made, done = len(self.moves), self.done
        if done > self.refused:
            return f"done: {done} times, for {self.refused} blocks"
        if self.reason in (StopReason.EMERGENCY, StopReason.LIMIT):
            # The last step of a block that is done may be the one that is dropped.
            low = self.upto[done] - 1
        else:
            low = self.upto[done]
        high = self.upto[min(done + 1, len(self.upto) - 1)]
        if not low <= made <= high:
            return f"done: {done} blocks of {self.upto[done]} steps, but {made} steps were made"
        return ""

    def _reason(self) -> str:
        seen, reason, orders = self.seen, self.reason, self.orders
        made, done = len(self.moves), self.done
        all_made = done == self.refused and made == len(self.expected)
        # What was ordered at the very end may act, or not.
        stopped = [clock for clock in orders.stops if clock < seen.end]
        emergency = [clock for clock in orders.emergencies if clock < seen.end]
        text = f"reason: {reason.name} at the end, "
        if emergency and reason is not StopReason.EMERGENCY:
            return text + f"but emergency was given at clock {emergency[0]}"
        if reason is StopReason.EMERGENCY:
            return "" if emergency else text + "but none was given"
        if reason is StopReason.STOP:
            return "" if stopped else text + "but none was ordered"
        if reason is StopReason.LIMIT:
            return self._limit(text)
        if reason is StopReason.NONE:
            if stopped and stopped[0] < seen.end - 8:
                return text + f"but stop was given at clock {stopped[0]}"
            if self.code or not all_made or seen.fed != self.given:
                return text + (
                    f"but {done} of {self.given} blocks are done, {made} of "
                    f"{len(self.expected)} steps made, refusal {self.code}"
                )
            return ""
        if reason.value != self.code + 3 or not self.code or not all_made:
            return text + (
                f"but block {self.refused} is refused with {self.code}, {done} are done and "
                f"{made} of {len(self.expected)} steps made"
            )
        return ""

    def _limit(self, text: str) -> str:
        """Judge a stop at a switch: the next step leads to it, and it was active."""
        reasons = self.seen.watch[:, 0]
        since = len(reasons) - int(
            np.argmax(reasons[::-1] != StopReason.__members__["LIMIT"].value)
        )
        after = self.expected[len(self.moves) : len(self.moves) + 1]
        if not len(after):
            return text + "but no step was left"
        # The switch's register, then whether a step waits for it, then the reason.
        clock = np.array([self.seen.begin + since - 3])
        if not self.orders.towards(clock, after)[0]:
            return text + f"but the next step {tuple(after[0].tolist())} leads to no active switch"
        return ""

    def _standing(self) -> str:
        """Judge the time before the device was cleared, and that behind the end."""
        seen, clear = self.seen, self.orders.clear
        if seen.stood:
            early = self.when[self.when <= clear + 1]
            if len(early):
                return f"standing: leading edge at clock {early[0]}, not cleared until {clear}"
            before = seen.watch[: clear - seen.begin + 1, 0]
            if np.any(before != seen.stood):
                return f"standing: the reason changes before clear at clock {clear}"
            if seen.reason_at(clear + 1):
                return f"standing: not cleared at clock {clear + 1}"
        late = self.when[self.when >= seen.end]
        if len(late):
            return f"standing: leading edge at clock {late[0]}, at rest from {seen.end} on"
        return ""

    def _emergency(self) -> str:
        for clock in self.orders.emergencies:
            if clock >= self.seen.end:
                break
            late = self.when[self.when > clock + 1]
            if len(late):
                return f"emergency at clock {clock}: leading edge at clock {late[0]}"
            if self.seen.reason_at(clock + 1) != StopReason.__members__["EMERGENCY"].value:
                return f"emergency at clock {clock}: not the reason a clock later"
        return ""

    def _switches(self) -> str:
        # Active in clock t: the last leading edge is seen in t + 1.
        wrong = self.when[self.orders.towards(self.when - 2, self.moves)]
        if len(wrong):
            return f"limit: leading edge at clock {wrong[0]} towards an active switch"
        return ""

    def _holds(self) -> str:
        orders, seen = self.orders, self.seen
        ends = [clock for clock in (*orders.stops, *orders.emergencies) if clock < seen.end]
        stands = np.flatnonzero(seen.watch[orders.clear - seen.begin + 1 :, 0])
        if len(stands):
            ends.append(orders.clear + 1 + int(stands[0]))
        for first, last, edges in orders.holds:
            settled = first + orders.settles
            held = (self.when >= settled) & (self.when <= last)
            indices = np.flatnonzero(held)
            for number, index in enumerate(indices.tolist()):
                clock = self.when[index]
                if sum(edge < clock for edge in edges) < number + 1:
                    return f"hold from clock {first}: step at clock {clock} without single"
            for edge in edges:
                until = edge + _READY - 16
                if until > min([seen.end, last, *ends]):
                    break
                before = int(np.count_nonzero(self.when <= edge))
                if before >= len(self.expected):
                    break
                block = int(np.searchsorted(self.upto, before, side="right")) - 1
                if seen.accepted[block] + _READY > edge:
                    continue
                if orders.towards(np.array([edge, until]), self.expected[[before, before]]).any():
                    continue
                made = np.count_nonzero((self.when > edge) & (self.when <= until))
                if made != 1:
                    return f"hold from clock {first}: {made} steps for single at clock {edge}"
        return ""
