"""Golden vectors of a core: what it is given, and what it must show, clock by clock.

All of it comes from the golden model, none from the RTL. Seeded: the same design has the same
vectors on every machine. Blocks of a method are short ones in all of its coordinates, some of no
length, one that is refused, and a long one last, within which the vectors end. Every second stretch
of clocks has stalls and gaps; a reset comes within a block. Of a block that is not offered every
field is unknown. Of what has no blocks every input changes at random, and so do the inputs of the
device beside its blocks.

Source: none, it is ours.
"""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice, pairwise
from typing import Any

import numpy as np

from discreta.hdl.plain import PlainPorts
from discreta.sim.arcs import is_empty, refusals
from discreta.sim.carrier import add_timing, least_periods
from discreta.sim.conics import KINDS as CONIC_KINDS
from discreta.sim.conics import random_blocks
from discreta.sim.constant_speed import paced
from discreta.sim.golden.constant_speed import ConstantSpeed
from discreta.sim.methods import Design, Method
from discreta.sim.stalls import NO_STALLS, Stalls

__all__ = ["CLOCKS", "SEED", "Vectors", "draw_blocks", "golden_vectors", "play"]

SEED = 1970

#: The most clocks of some vectors.
CLOCKS = 6000

#: Clocks after the long block is accepted; from a block's acceptance to a reset; and of a stretch
#: with stalls or without.
_TAIL, _WITHIN, _STRETCH = 150, 9, 128

#: Short blocks; steps that they have at most along an axis, and bits of short curves.
_BLOCKS, _REACH, _CURVE_BITS = 18, 12, 4

#: Arcs on a carrier take thousands of clocks: so many are drawn, in so many times the clocks.
_TIMED_ARCS, _TIMED_ARC_CLOCKS = 5, 3

#: Steps of a period on a carrier.
_PERIOD_STEPS = 8

#: One order: from which clock on, which input, its value.
Order = tuple[int, str, int]


@dataclass(frozen=True)
class Vectors:
    """What a core is given and must show before the edge of every clock.

    Attributes
    ----------
    inputs : dict of str to list of (int or None)
        By the port, ``rst`` first; None is a value that must not matter.
    outputs : dict of str to list of int
        By the port.
    """

    inputs: dict[str, list[int | None]]
    outputs: dict[str, list[int]]

    @property
    def clocks(self) -> int:
        """How many clocks there are."""
        return len(self.inputs["rst"])

    @property
    def answers(self) -> int:
        """How many blocks are answered, be it by an error."""
        given = [self.outputs[name] for name in ("done", "error") if name in self.outputs]
        return sum(any(row) for row in zip(*given, strict=True))

    @property
    def steps(self) -> int:
        """How many steps are taken, or how often the pins change."""
        if "steps_valid" in self.outputs:
            pairs = zip(self.outputs["steps_valid"], self.inputs["steps_ready"], strict=True)
            return sum(bool(valid and ready) for valid, ready in pairs)
        pins = [row for name, row in self.outputs.items() if name.startswith("pins_")]
        return sum(a != b for a, b in pairwise(zip(*pins, strict=True)))


class _InTurns:
    """Stalls in every second stretch of clocks."""

    def __init__(self, stalls: Stalls):
        self._stalls = stalls

    def ready(self, clock: int) -> bool:
        """Say whether a step is taken in ``clock``."""
        return clock // _STRETCH % 2 == 0 or self._stalls.ready(clock)

    def offers(self, clock: int) -> bool:
        """Say whether a new block may be offered in ``clock``."""
        return clock // _STRETCH % 2 == 0 or self._stalls.offers(clock)


def play(
    golden: Any,
    fields: Collection[str],
    blocks: np.ndarray,
    stalls: Stalls | _InTurns = NO_STALLS,
    resets: Collection[int] = (),
    orders: Iterable[Order] = (),
) -> Iterator[tuple[dict[str, Any], dict[str, Any], dict[str, int | None]]]:
    """Run a golden model under the handshakes of the engines, for ever.

    Parameters
    ----------
    golden : object
        The golden model.
    fields : collection of str
        The fields of a block, as ports.
    blocks : array of int, shape (blocks, fields)
    stalls : Stalls
    resets : collection of int
        The clocks in which ``rst`` is held; what is offered then stays offered.
    orders : iterable of (int, str, int)
        Further inputs: from which clock on, which, its value; in the order of time.

    Yields
    ------
    registers, outputs, inputs : dict of str to int
        Before the edge of every clock; a field of a block that is not offered is None.
    """
    rows = blocks.tolist()
    state = golden.reset()
    fed, held, clock = 0, False, 0
    left = list(orders)[::-1]
    controls: dict[str, int] = {}
    while True:
        out = golden.outputs(state)
        while left and left[-1][0] <= clock:
            _, name, value = left.pop()
            controls[name] = value
        offered = held or (fed < len(rows) and stalls.offers(clock))
        row = rows[fed] if offered else [None] * len(fields)
        inputs: dict[str, int | None] = dict(zip(fields, row, strict=True))
        inputs |= {"blocks_valid": int(offered), "steps_ready": int(stalls.ready(clock))}
        inputs |= controls | {"rst": int(clock in resets)}
        yield state, out, inputs
        accepted = offered and bool(out.get("blocks_ready")) and clock not in resets
        given = {name: value or 0 for name, value in inputs.items()}
        state = golden.reset() if clock in resets else golden.step(state, given)
        fed, held = fed + accepted, offered and not accepted
        clock += 1


def golden_vectors(
    design: Design, top: PlainPorts, golden: Any, *, clocks: int = CLOCKS, seed: int = SEED
) -> Vectors:
    """Draw vectors of a design.

    Parameters
    ----------
    design : Design
        What it is: its blocks are of that kind.
    top : PlainPorts
        Says which ports there are; registers may be observed.
    golden : object
        The golden model of that very core.
    clocks : int
        The most there may be, 64 or more: blocks may take so long that few are run.
    seed : int
        Of what is drawn.
    """
    random = np.random.default_rng([seed, *design.name.encode()])
    orders: list[Order] = []
    if isinstance(design, Method):
        clocks *= _TIMED_ARC_CLOCKS if design.timed and design.curve == "arc" else 1
        blocks = draw_blocks(design, golden, len(top.block_fields), random)
    elif isinstance(golden, ConstantSpeed):
        blocks = _paced(golden, random)
    elif top.block_fields:
        blocks = _device_blocks(top, golden, random)
        orders = _device_orders(top, random, clocks)
    else:
        blocks = np.empty((0, 0), dtype=np.int64)
        orders = _any_orders(top, random, clocks)
    stalls = _InTurns(Stalls(seed, 0.4, 0.3))

    # Looked up clock by clock: where the second one falls within a block, the run itself tells.
    resets = {0}
    within = len(blocks) // 3
    rows, taken, end = [], 0, clocks
    played = play(golden, top.block_fields, blocks, stalls, resets, orders)
    for clock, (state, out, inputs) in enumerate(islice(played, clocks)):
        if clock >= end:
            break
        rows.append((out | {f"reg_{name}": value for name, value in state.items()}, inputs))
        if len(resets) == 1 and (taken > within or clock >= clocks // 2):
            resets |= {clock + _WITHIN, clock + _WITHIN + 1}
        if inputs["blocks_valid"] and out.get("blocks_ready") and not inputs["rst"]:
            taken += 1
            if taken == len(blocks) and isinstance(design, Method):
                end = min(end, clock + _TAIL)
    names = ("rst", *top.inputs)
    return Vectors(
        {name: [inputs[name] for _, inputs in rows] for name in names},
        {name: [int(out[name]) for out, _ in rows] for name in top.outputs},
    )


# Blocks


def draw_blocks(method: Method, golden: Any, fields: int, random: np.random.Generator):
    """Draw blocks of a method: short ones of all kinds, and a long one last.

    Parameters
    ----------
    method : Method
    golden : object
        Its golden model: how wide it is, and on a carrier which timings it has.
    fields : int
        How many fields a block has.
    random : numpy.random.Generator

    Returns
    -------
    array of int, shape (blocks, fields)
    """
    width = golden.width
    # What is not normalized takes 2^n clocks however short it is.
    reach = _REACH if getattr(golden, "normalize", True) else 1 << width
    if method.curve == "line":
        blocks = _lines(width, (fields - 2 * method.timed) // 2, random, reach)
    elif method.curve == "arc":
        blocks = _arcs(width, random, reach)
    else:
        blocks = _conics(width, random)
    if not method.timed:
        return blocks
    if method.curve == "arc":
        blocks = np.concatenate([blocks[:_TIMED_ARCS], blocks[-4:]])
    return _timed(method, golden, blocks, random)


def _lines(width: int, axes: int, random: np.random.Generator, reach: int = _REACH) -> np.ndarray:
    limit = 1 << width
    reach = min(reach, limit - 1)
    starts = random.integers(-limit, limit, (_BLOCKS, axes))
    ends = starts + random.integers(-reach, reach, (_BLOCKS, axes), endpoint=True)
    ends = np.clip(ends, -limit, limit - 1)
    ends[5::6] = starts[5::6]
    # Too long to run, and as long as they may be.
    starts[-4], ends[-4] = -limit, limit - 1
    starts[-1], ends[-1] = -limit, -1 - np.arange(axes)
    return np.hstack([starts, ends])


def _arcs(width: int, random: np.random.Generator, reach: int = _REACH) -> np.ndarray:
    limit = 1 << width
    blocks: list[np.ndarray] = []
    while len(blocks) < _BLOCKS:
        which = len(blocks)
        large = which == _BLOCKS - 1
        radius = (limit - 3) * 0.7 if large else random.uniform(1, min(reach, limit // 2))
        room = int(limit - 3 - radius)
        block = np.zeros(8, dtype=np.int64)
        block[4:6] = random.integers(-room, room, 2, endpoint=True)
        for column in (0, 2):
            angle = random.uniform(0, 2 * np.pi)
            if which % 4 == 1:
                angle = random.integers(4) * np.pi / 2
            point = np.rint(radius * np.array([np.cos(angle), np.sin(angle)]))
            block[column : column + 2] = block[4:6] + point.astype(np.int64)
            radius = np.hypot(*point)
        block[6] = random.integers(2)
        block[7] = which % 8 == 2
        if which % 6 == 5:
            block[:4] = np.tile(block[4:6], 2)
        # Off its circle; and so large that it leaves the coordinates.
        if which == _BLOCKS - 4:
            block[2:4] = block[4:6]
        if which == _BLOCKS - 3:
            block[:4] = limit - 1, 1 - limit, limit - 1, 1 - limit
        if which in (_BLOCKS - 4, _BLOCKS - 3) or not refusals(block[None], width)[0]:
            blocks.append(block)
    return np.array(blocks)


def _conics(width: int, random: np.random.Generator) -> np.ndarray:
    each = -(-_BLOCKS // len(CONIC_KINDS))
    drawn = []
    for kind in CONIC_KINDS:
        some = random_blocks(kind, _CURVE_BITS, 8 * each, random)
        drawn.append(some[some[:, 10] <= 2][:each])
    short = np.stack(drawn, axis=1).reshape(-1, 11)[: _BLOCKS - 1]
    for row in short[5::6]:
        row[7:9], row[10] = row[5:7], 0
    # The centre of its curve, where it has no direction.
    a, b, c, _, _, x, y, *_ = (int(value) for value in short[-4])
    short[-4, [0, 3, 4]] = a or 3, -2 * (a or 3) * x - b * y, -b * x - 2 * c * y
    if width > _CURVE_BITS:
        # To anywhere in the coordinates, which changes no curve.
        room = (1 << width) - (1 << _CURVE_BITS)
        far = random.integers(-room, room, (len(short), 2), endpoint=True)
        a, b, c = short[:, :3].T
        short[:, 3] -= 2 * a * far[:, 0] + b * far[:, 1]
        short[:, 4] -= b * far[:, 0] + 2 * c * far[:, 1]
        short[:, 5:7] += far
        short[:, 7:9] += far
    return np.concatenate([short, random_blocks("ellipse", width, 1, random)])


def _timed(
    method: Method, golden: Any, blocks: np.ndarray, random: np.random.Generator
) -> np.ndarray:
    """Give blocks their timing, among them no periods and a period too short."""
    period = int(golden.least_period)
    timed = add_timing(method.curve, blocks, Fraction(_PERIOD_STEPS, period), period)
    if method.curve == "arc":
        fewest = least_periods(blocks, getattr(golden, "formula", "rotation"))
        timed[:, -2] = np.maximum(timed[:, -2], fewest)
    timed[:, -1] += random.integers(0, 8, len(blocks))
    timed[1, -2], timed[-3, -1] = 0, 1
    return timed


def _paced(golden: ConstantSpeed, random: np.random.Generator) -> np.ndarray:
    """Draw lines or arcs at constant speed, every fourth at full speed."""
    width, axes = golden.width, golden.axes
    if golden.round:
        kind, flat = "arc", _arcs(width, random)
        further = random.integers(-3, 3, (2, len(flat), axes - 2), endpoint=True)
        # What has no arc takes no axis along.
        none = is_empty(flat) | (refusals(flat, width) != 0)
        further[1][none] = further[0][none]
        blocks = np.hstack([flat[:, :2], further[0], flat[:, 2:4], further[1], flat[:, 4:]])
    else:
        kind, blocks = "line", _lines(width, axes, random)
    told = paced(kind, blocks, width, axes)
    told[::4, blocks.shape[1]] = 0
    return told


# The device


def _device_blocks(top: PlainPorts, golden: Any, random: np.random.Generator) -> np.ndarray:
    """Draw curves of all kinds of a device, each led to by a block that places the machine."""
    width, fields = golden.width, top.block_fields
    draws = {
        "line": (0, 0, "", lambda: _lines(width, golden.axes, random)),
        "arc": (1, 0, ("center_x", "center_y", "clockwise", "full_turns"), None),
        "conic": (2, 5, (*"abcde", "clockwise", "turns"), None),
    }
    draws["arc"] = (*draws["arc"][:3], lambda: _arcs(width, random))
    draws["conic"] = (*draws["conic"][:3], lambda: _conics(width, random))
    kinds = [kind for kind, _ in golden.interpolators]
    curves = {kind: draws[kind][3]() for kind in kinds}
    rows = []
    for number in range(_BLOCKS):
        for kind in kinds:
            code, at, own, _ = draws[kind]
            row = [int(value) for value in curves[kind][number]]
            points = row[at : at + 2 * golden.axes]
            del row[at : at + 2 * golden.axes]
            start, end = points[: golden.axes], points[golden.axes :]
            common = {
                "blocks_feed_mantissa": int(random.integers(1 << 16)),
                "blocks_feed_exponent": int(random.choice([0, 0, 0, 1, 2])),
                "blocks_ahead": int(random.integers(60)),
            }
            letters = golden.letters
            rows.append({"blocks_kind": 3} | _named("blocks_end_", letters, start))
            rows.append(
                {"blocks_kind": code}
                | common
                | _named("blocks_", own, row)
                | _named("blocks_end_", letters, end)
            )
    return np.array([[row.get(name, 0) for name in fields] for row in rows], dtype=object)


def _named(prefix: str, names: Iterable[str], values: Iterable[int]) -> dict[str, int]:
    return {prefix + name: value for name, value in zip(names, values, strict=True)}


_TIMINGS = ("pulse_length", "pulse_space", "direction_setup", "direction_hold")

#: Values that an input of several bits is given, where any would tell little.
_VALUES = {
    **dict.fromkeys(_TIMINGS, (0, 1, 1, 2, 3)),
    "override": (128, 128, 256, 200, 40, 0),
    "acceleration": (0, 0, 1 << 39, 1 << 36),
    "feed_exponent": (0, 0, 1, 2),
    "ahead": (0, 3, 40, 500),
}

#: Clocks for which an input keeps a value, in the mean.
_KEPT = 25

#: Inputs that end a run: how often they are given, one clock in so many.
_RARE = ("stop", "emergency", "low_limit", "high_limit")
_EVERY = 400


def _device_orders(top: PlainPorts, random: np.random.Generator, clocks: int) -> list[Order]:
    """Draw what is given beside the blocks: calm at first, cleared again and again."""
    names = [name for name in top.control_fields if name != "clear"]
    orders = [(0, "acceleration", 0), (0, "override", 128), (0, "clear", 0)]
    orders += [(0, name, 1) for name in _TIMINGS]
    calm = _STRETCH
    for name in names:
        if name.startswith(_RARE):
            orders += _flashes(name, random, calm, clocks, _EVERY * len(_RARE))
        elif name in ("hold", "single"):
            orders += _flashes(name, random, calm, clocks, _EVERY // 2)
        else:
            for clock in range(calm, clocks, 8 * _KEPT):
                orders.append((clock, name, int(random.choice(_VALUES[name]))))
    for clock in range(calm, clocks, _EVERY // 8):
        orders += [(clock, "clear", 1), (clock + 1, "clear", 0)]
    return sorted(orders, key=lambda order: order[0])


def _flashes(
    name: str, random: np.random.Generator, first: int, last: int, every: int
) -> list[Order]:
    """Give an input now and then for some clocks."""
    orders, clock = [(0, name, 0)], first
    while (clock := clock + int(random.exponential(every)) + 2) < last:
        until = clock + int(random.integers(1, _KEPT))
        orders += [(clock, name, 1), (until, name, 0)]
        clock = until
    return orders


def _any_orders(top: PlainPorts, random: np.random.Generator, clocks: int) -> list[Order]:
    """Give every input any value, or one of those that tell more, for some clocks each."""
    orders: list[Order] = []
    for name, port in top.inputs.items():
        if name.startswith(_RARE) or name == "load":
            orders += _flashes(name, random, 0, clocks, _EVERY // 4)
            continue
        signed, bits = port.shape().signed, len(port)
        low, high = (1 - (1 << (bits - 1)), 1 << (bits - 1)) if signed else (0, 1 << bits)
        # A step and what goes with it may change at any clock.
        kept = 3 if name.startswith(("steps_", "moves_", "taken")) else _KEPT
        clock = 0
        while clock < clocks:
            values = _VALUES.get(name)
            value = random.choice(values) if values else random.integers(low, high)
            orders.append((clock, name, int(value)))
            clock += 1 + int(random.exponential(kept))
    return sorted(orders, key=lambda order: order[0])
