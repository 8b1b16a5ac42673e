# amaranth: UnusedElaboratable=no
# (A device that is refused cannot be simulated.)
"""The whole device: equal to its golden model, and what comes out of its pins."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cache
from math import hypot
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from amaranth import Module, Signal
from amaranth.hdl import Fragment, Value

from discreta.hdl.circular import Circular
from discreta.hdl.conic import Conic
from discreta.hdl.constant_speed import ConstantSpeed, constant_arc, constant_line
from discreta.hdl.device import Device, exact_device
from discreta.hdl.exact_conic import ExactConic
from discreta.hdl.feed import PAUSES
from discreta.hdl.linear import Linear
from discreta.hdl.quadrant import line_block_layout
from discreta.hdl.queue import StopReason
from discreta.sim.compiled import CompiledModel
from discreta.sim.golden.circular import Circular as GoldenCircular
from discreta.sim.golden.conic import Conic as GoldenConic
from discreta.sim.golden.constant_speed import constant_arc as golden_constant_arc
from discreta.sim.golden.constant_speed import constant_line as golden_constant_line
from discreta.sim.golden.device import Device as GoldenDevice
from discreta.sim.golden.device import make_device
from discreta.sim.golden.exact_arc import ExactArc as GoldenExactArc
from discreta.sim.golden.exact_conic import ExactConic as GoldenExactConic
from discreta.sim.golden.exact_line import ExactLine as GoldenExactLine
from discreta.sim.golden.feed import FeedUnit as GoldenFeedUnit
from discreta.sim.golden.linear import Linear as GoldenLinear
from discreta.sim.golden.pulse import PulseUnit as GoldenPulseUnit
from discreta.sim.interpreted import PysimModel
from discreta.sim.stalls import NO_STALLS, Stalls
from tests.arcs import draw_arcs
from tests.conics import draw_conics
from tests.hdl.parts.clocked import assert_refused

Parts = dict[str, Callable[..., Any]]

PARTS: Parts = {"line": constant_line, "arc": constant_arc, "conic": ExactConic}
#: Which steps there are, in which order: whatever their pace is, it is the core's alone.
CORES: Parts = {"line": GoldenExactLine, "arc": GoldenExactArc, "conic": GoldenExactConic}
#: The lecture's interpolators, and one beside others.
LECTURE: Parts = {"line": Linear, "arc": Circular, "conic": Conic}
MIXED: Parts = {"line": Linear, "arc": constant_arc, "conic": Conic}
GOLDEN: dict[Callable, Callable] = {
    Linear: GoldenLinear,
    Circular: GoldenCircular,
    Conic: GoldenConic,
    constant_line: golden_constant_line,
    constant_arc: golden_constant_arc,
    ExactConic: GoldenExactConic,
}
CODES = {"line": 0, "arc": 1, "conic": 2, "place": 3}
TIMINGS = ("pulse_length", "pulse_space", "direction_setup", "direction_hold")
#: What is set from the first clock on: 100 %, the shortest pulses.
CALM = {"override": 128, **dict.fromkeys(TIMINGS, 1)}

#: What a block of one kind has besides its start and end, in the order in which blocks are drawn.
OWN = {
    "line": ("pace",),
    "arc": ("center_x", "center_y", "clockwise", "full_turns", "pace", "ticks"),
    "conic": (*"abcde", "clockwise", "turns"),
}

Block = tuple[str, dict[str, int]]


def make(
    width: int, kinds: Collection[str], depth: int = 1, parts: Parts = PARTS, **choices: Any
) -> Device:
    """Make a device with interpolators of some kinds."""
    return Device(**{kind: parts[kind](width) for kind in kinds}, depth=depth, **choices)


def golden_of(parts: Parts, kinds: Collection[str], width: int, axes: int = 2) -> GoldenDevice:
    """Make the golden model of a device with these interpolators."""
    more = () if axes == 2 else (axes,)
    return GoldenDevice(
        tuple((kind, GOLDEN[parts[kind]](width, *more)) for kind in parts if kind in kinds),
        GoldenFeedUnit(axes, PAUSES[:axes]),
        GoldenPulseUnit(width, axes),
    )


def line(x: int, y: int, **others: int) -> Block:
    """Make a line to a point; at full speed if no pace is given."""
    return "line", {"end_x": x, "end_y": y, **others}


def place(x: int, y: int) -> Block:
    """Make a block that tells where the machine stands."""
    return "place", {"end_x": x, "end_y": y}


def arc(
    x: int, y: int, center: tuple[int, int] = (0, 0), clockwise: int = 0, **others: int
) -> Block:
    """Make an arc to a point."""
    own = {"center_x": center[0], "center_y": center[1], "clockwise": clockwise}
    return "arc", {"end_x": x, "end_y": y, **own, **others}


def rows_of(fields: Collection[str], blocks: list[Block]) -> np.ndarray:
    """Write blocks as the device's ports have them."""
    rows = []
    for kind, values in blocks:
        row = {"blocks_kind": CODES[kind]}
        row |= {f"blocks_{name}": value for name, value in values.items()}
        assert set(row) <= set(fields) | {f"blocks_{name}" for name in sum(OWN.values(), ())}
        rows.append([row.get(name, 0) for name in fields])
    return np.array(rows, dtype=np.int64).reshape(len(rows), len(fields))


def orders_of(controls: tuple[str, ...], orders: list[tuple[int, str, int]]) -> np.ndarray:
    """Write what is set of the controls, and when, in the order of time."""
    rows = [(clock, controls.index(name), value) for clock, name, value in orders]
    return np.array(sorted(rows, key=lambda row: row[0]), dtype=np.int64).reshape(-1, 3)


def calm(**others: int) -> list[tuple[int, str, int]]:
    """Give what is set from the first clock on."""
    return [(0, name, value) for name, value in (CALM | others).items()]


def draw_pace(random: np.random.Generator, width: int, kind: str, values: dict[str, int]) -> int:
    """Draw a pace: of full speed, the right one of an arc, or any with which it ends soon."""
    if random.random() < 0.3:
        return 0
    if kind == "line":
        return int(random.integers(2 ** (width + 12)))
    radius = hypot(*(values[f"end_{a}"] - values[f"center_{a}"] for a in "xy"))
    factor = float(random.choice([1, random.uniform(0.25, 4)]))
    return min(2 ** (width + 13) - 1, max(1, round(radius * factor * 2**12)))


def draw_blocks(
    width: int, kinds: Collection[str], count: int, seed: int, axes: int = 2
) -> list[Block]:
    """Draw blocks of all kinds, seeded: also such of no length, refused and of no known kind.

    Most curves begin where a block before them leads to; where one was refused they are refused.
    With three axes z goes to and fro, and an arc's ``ticks`` are anything.
    """
    more = np.random.default_rng([seed, width, axes])
    blocks, z = [], 0
    for kind, values in draw_plane(width, kinds, count, seed):
        if "arc" in kinds and blocks and more.random() < 0.02:
            # From its own centre no arc leads anywhere.
            x, y = (blocks[-1][1][f"end_{a}"] for a in "xy")
            blocks.append(arc(x + (3 if x < 0 else -3), y, (x, y)))
        values = dict(values)
        if kind in ("line", "arc") and kind in kinds:
            values["pace"] = draw_pace(more, width, kind, values)
        if axes > 2:
            z = int(np.clip(z + more.integers(-9, 9, endpoint=True), -(2**width), 2**width - 1))
            values["end_z"] = z
            if kind == "arc" and kind in kinds:
                values["ticks"] = int(more.integers(1, 60))
        blocks.append((kind, values))
    return blocks


def draw_plane(width: int, kinds: Collection[str], count: int, seed: int) -> list[Block]:
    """Draw the same without their paces, in the plane."""
    random = np.random.default_rng([seed, width])
    top, reach = 2**width, min(2**width, 24)
    near = max(2, reach // 4)
    curves = {}
    if "arc" in kinds:
        curves["arc"] = [(r[:4], r[4:]) for r in draw_arcs(width, count, seed=seed, radius=near)]
    if "conic" in kinds:
        drawn = draw_conics(width, 8 * count, seed=seed, turns=2)
        short = np.abs(drawn[:, 5:7] - drawn[:, 7:9]).max(axis=1) < 2 * reach
        curves["conic"] = [(r[5:9], [*r[:5], *r[9:]]) for r in drawn[short]]
    blocks: list[Block] = []
    at = np.zeros(2, dtype=np.int64)
    while len(blocks) < count:
        speed = {
            "feed_mantissa": int(random.integers(2**16)),
            "feed_exponent": int(random.choice([0, 0, 0, 1, 2])),
            "ahead": int(random.integers(40)),
        }
        drawn = int(random.integers(10))
        if drawn == 0:
            at = random.integers(-top // 2, top // 2, 2)
            blocks.append(place(*at.tolist()))
        elif drawn == 1:
            blocks.append(("line", {"end_x": int(at[0]), "end_y": int(at[1]), **speed}))
        elif drawn == 2 and random.random() < 0.3:
            # From one corner to the other is too far.
            blocks += [place(-top, -top), line(top - 1, top - 1, **speed)]
            at = np.full(2, -top)
        elif drawn == 3 and len(kinds) < 3 and random.random() < 0.3:
            missing = next(kind for kind in CODES if kind not in kinds)
            blocks.append((missing, {"end_x": 1, "end_y": 0}))
        elif drawn > 5 and any(map(len, curves.values())):
            kind = str(random.choice([kind for kind in curves if curves[kind]]))
            points, own = curves[kind].pop()
            x, y, *at = map(int, points)
            near_by = max(abs(x), abs(y)) < 2 * near
            blocks.append(line(x, y, **speed) if near_by and drawn > 7 else place(x, y))
            own = dict(zip(OWN[kind], map(int, own), strict=False))
            blocks.append((kind, {"end_x": at[0], "end_y": at[1], **own, **speed}))
            at = np.array(at)
        else:
            at = np.clip(at + random.integers(-near, near, 2, endpoint=True), -top, top - 1)
            blocks.append(line(*at.tolist(), **speed))
    return blocks


def draw_orders(clocks: int, seed: int, *, acceleration: int = 0) -> list[tuple[int, str, int]]:
    """Draw what happens around a device: holds, single steps, overrides, stops, switches, clears.

    The acceleration stays.
    """
    random = np.random.default_rng(seed)
    orders = [*calm(acceleration=acceleration)]
    clock = 0
    while clock < clocks:
        clock += int(random.integers(1, 32))
        what = str(
            random.choice(
                ["hold", "single", "override", "stop", "emergency", "limit", "timing", "clear"],
                p=[0.1, 0.1, 0.06, 0.06, 0.06, 0.14, 0.08, 0.4],
            )
        )
        lasts = int(random.integers(1, 12))
        if what == "limit":
            what = f"{random.choice(['low', 'high'])}_limit_{random.choice(['x', 'y'])}"
            orders += [(clock, what, 1), (clock + 6 * lasts, what, 0)]
        elif what == "timing":
            orders.append((clock, str(random.choice(TIMINGS)), int(random.integers(5))))
        elif what == "override":
            orders.append((clock, what, int(random.choice([0, 64, 128, 200, 256, 511]))))
            orders.append((clock + 20, what, 128))
        elif what == "hold":
            orders += [(clock, what, 1), (clock + 4 * lasts, what, 0)]
            singles = (clock + int(value) for value in random.integers(4 * lasts, size=2))
            orders += [(at + k, "single", 1 - k) for at in singles for k in (0, 1)]
        else:
            orders += [(clock, what, 1), (clock + lasts, what, 0)]
        if what == "emergency" and random.random() < 0.5:
            # Too soon: it is still given, or a pulse is out.
            orders += [(clock + 1, "clear", 1), (clock + lasts + 1, "clear", 0)]
    return orders


@dataclass
class Seen:
    """What was recorded of a device, by name, at every clock before its edge."""

    columns: dict[str, np.ndarray]
    fed: int

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]


def golden_run(
    golden: GoldenDevice,
    fields: tuple[str, ...],
    controls: tuple[str, ...],
    blocks: np.ndarray,
    clocks: int,
    orders: np.ndarray,
    stalls: Stalls = NO_STALLS,
) -> Seen:
    """Give every register (``reg_…``) and every output of the golden model at every clock."""
    rows, waiting = blocks.tolist(), orders.tolist()
    names = [f"reg_{name}" for name in golden.registers()]
    state, fed, offering = golden.reset(), 0, False
    given = dict.fromkeys(controls, 0) | {"blocks_valid": 0} | dict.fromkeys(fields, 0)
    seen, shown = [], []
    for clock in range(clocks):
        while waiting and waiting[0][0] <= clock:
            _, control, value = waiting.pop(0)
            given[controls[control]] = value
        if not offering and fed < len(rows) and stalls.offers(clock):
            given |= dict(zip(fields, rows[fed], strict=True))
            offering = True
        given["blocks_valid"] = int(offering)
        out = golden.outputs(state)
        seen.append([state[name] for name in golden.registers()])
        shown.append(list(out.values()))
        if offering and out["blocks_ready"]:
            offering, fed = False, fed + 1
        state = golden.step(state, given)
    columns = np.hstack([np.array(seen, dtype=np.int64), np.array(shown, dtype=np.int64)])
    return Seen(dict(zip([*names, *golden.outputs(state)], columns.T, strict=True)), fed)


#: The ports that tests look at.
PINS = ("pins_x_step", "pins_x_direction", "pins_y_step", "pins_y_direction")
PORTS = (*PINS, "blocks_ready", "position_x", "position_y", "busy", "done", "reason")


def run(
    make_model: Callable,
    device: Device,
    blocks: list[Block],
    clocks: int,
    orders: list[tuple[int, str, int]],
    *,
    watch: tuple[str, ...] = PORTS,
    stalls: Stalls = NO_STALLS,
    until_idle: bool = False,
) -> Seen:
    """Run a device, and give what was seen of it: the outputs, and registers if told."""
    model = make_model(device, watch=watch)
    stretch = model.run(
        rows_of(model.block_fields, blocks),
        clocks,
        orders=orders_of(model.control_fields, orders),
        stalls=stalls,
        until_idle=until_idle,
    )
    assert stretch.idle or not until_idle
    return Seen(dict(zip(watch, stretch.watch.T, strict=True)), stretch.fed)


def differences(
    make_model: Callable,
    device: Device,
    golden: GoldenDevice,
    blocks: list[Block],
    orders: list[tuple[int, str, int]],
    clocks: int,
    stalls: Stalls = NO_STALLS,
    wanted: Seen | None = None,
) -> tuple[Seen, list[tuple[int, str]]]:
    """Run a device beside its golden model; give that, and the first places where they differ.

    ``wanted``: what the golden model gives, if that is known already.
    """
    watch = (*(f"reg_{name}" for name in golden.registers()), *golden.outputs(golden.reset()))
    model = make_model(device, watch=watch)
    rows = rows_of(model.block_fields, blocks)
    table = orders_of(model.control_fields, orders)
    fields, controls = model.block_fields, model.control_fields
    wanted = wanted or golden_run(golden, fields, controls, rows, clocks, table, stalls)
    stretch = model.run(rows, clocks, orders=table, stalls=stalls)
    expected = np.stack([wanted[name] for name in watch], axis=1)
    wrong = [(clock, watch[at]) for clock, at in np.argwhere(stretch.watch != expected).tolist()]
    if not wrong:
        assert stretch.fed == wanted.fed
    return wanted, wrong[:5]


@pytest.mark.parametrize(
    ("kinds", "seed", "stalls", "acceleration"),
    [
        (("line",), 1, NO_STALLS, 0),
        (("line", "arc"), 8, Stalls(1, gap=0.8), 0),
        (("line", "arc"), 4, NO_STALLS, 2**33),
        (("line", "arc", "conic"), 1, NO_STALLS, 0),
    ],
    ids=str,
)
def test_every_register_at_every_clock_in_pysim(kinds, seed, stalls, acceleration):
    seen, wrong = differences(
        PysimModel,
        make(4, kinds),
        make_device(4, kinds),
        draw_blocks(4, kinds, 400, seed),
        draw_orders(1200, seed, acceleration=acceleration),
        1200,
        stalls,
    )
    assert wrong == []
    # So slowly no line comes near a switch.
    assert {0, 1, 2} | ({3} if not acceleration else set()) <= set(seen["reason"].tolist())
    assert set(seen["reg_current_kind"].tolist()) >= {CODES[kind] for kind in kinds}


@pytest.mark.parametrize("parts", [LECTURE, MIXED], ids=["lecture", "mixed"])
def test_every_register_with_the_lectures_interpolators(parts):
    kinds = ("line", "arc", "conic")
    seen, wrong = differences(
        PysimModel,
        make(4, kinds, parts=parts),
        golden_of(parts, kinds, 4),
        draw_blocks(4, kinds, 400, 1),
        draw_orders(1000, 1),
        1000,
    )
    assert wrong == []
    assert {0, 1, 2} <= set(seen["reason"].tolist())
    assert set(seen["reg_current_kind"].tolist()) >= {0, 1, 2}


def test_every_register_of_three_axes():
    """Lines of three axes, and arcs with z along them."""
    kinds = ("line", "arc")
    seen, wrong = differences(
        PysimModel,
        exact_device(4, 3, kinds, depth=1),
        golden_of(PARTS, kinds, 4, 3),
        draw_blocks(4, kinds, 400, 1, axes=3),
        draw_orders(1000, 1),
        1000,
    )
    assert wrong == []
    assert {0, 1, 2} <= set(seen["reason"].tolist())
    assert len(set(seen["position_z"].tolist())) > 5


@pytest.mark.usefixtures("compiled_engine")
def test_every_register_at_every_clock_compiled():
    width, kinds, seed = 8, ("line", "arc"), 4
    choices: dict[str, Any] = {"pins": "quadrature", "pairing": False}
    seen, wrong = differences(
        CompiledModel,
        make(width, kinds, **choices),
        make_device(width, kinds, **choices),
        draw_blocks(width, kinds, 400, seed),
        draw_orders(2500, seed, acceleration=2**34),
        2500,
    )
    assert wrong == []
    reasons = set(seen["reason"].tolist())
    assert reasons >= {0, 1, 2, 3, 4, 5, 7}
    assert set(seen["reg_current_kind"].tolist()) >= {CODES[kind] for kind in kinds}


# What comes out, whatever the depth.


@cache
def expected_path(kind: str, width: int, start: tuple[int, int], block: tuple) -> list:
    """Give the steps of one block: those of its exact golden interpolator alone."""
    return expected_steps(CORES[kind](width), kind, start, dict(block))


def expected_steps(
    golden: Any, kind: str, start: tuple[int, ...], values: dict[str, int], letters: str = "xy"
) -> list:
    """Give the steps of one block on a golden interpolator; ticks without one are left out."""
    own = {f"blocks_{name}": values.get(name, 0) for name in OWN[kind]}
    given = own | {f"blocks_start_{a}": value for a, value in zip(letters, start, strict=True)}
    given |= {f"blocks_end_{a}": values[f"end_{a}"] for a in letters}
    state, steps, fed = golden.reset(), [], False
    for _ in range(20_000):
        out = golden.outputs(state)
        assert not out["error"], (kind, start, values)
        if out["done"]:
            return steps
        step = tuple(out[f"steps_{a}"] for a in letters)
        if out["steps_valid"] and any(step):
            steps.append(step)
        state = golden.step(state, given | {"blocks_valid": int(not fed), "steps_ready": 1})
        fed = True
    raise AssertionError(f"no answer to {kind} from {start} with {values}")


def expected_pulses(width: int, blocks: list[Block]) -> list[tuple[int, int]]:
    """Give the steps of blocks one behind the other; none may be refused."""
    at, steps = (0, 0), []
    for kind, values in blocks:
        if kind != "place":
            steps += expected_path(kind, width, at, tuple(values.items()))
        at = (values["end_x"], values["end_y"])
    return steps


def pulses_of(seen: Seen, letters: str = "xy") -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """Give the clocks of leading edges on the pins, and the step that each shows."""
    edges = {
        a: np.flatnonzero(np.diff(seen[f"pins_{a}_step"], prepend=0) == 1).tolist() for a in letters
    }
    clocks = sorted(set().union(*edges.values()))
    ways = {a: dict.fromkeys(edges[a], 1) for a in letters}
    for a, way in ways.items():
        way.update({clock: 1 - 2 * int(seen[f"pins_{a}_direction"][clock]) for clock in way})
    steps = [tuple(ways[a].get(clock, 0) for a in letters) for clock in clocks]
    return np.array(clocks), steps


#: Some at full speed, some at a constant one, and some at a pace that is not their own.
TOUR = [
    line(7, 3, pace=round((hypot(7, 3) / 7 - 1) * 2**16)),
    line(7, 3),
    line(5, 0),
    arc(0, 5, pace=5 << 12),
    arc(-5, 0, pace=2 << 12),
    line(-5, 0, pace=2**17 - 1),
    line(-9, 6),
    place(-2, 2),
    arc(0, 0, center=(0, 2), clockwise=1),
    line(3, -4),
    line(3, 9),
]


@pytest.mark.parametrize("depth", [1, 2, 16])
@pytest.mark.parametrize("gap", [0.0, 0.9])
def test_pins_show_the_steps_of_the_interpolators_in_order(depth, gap):
    seen = run(
        PysimModel,
        make(4, ("line", "arc"), depth),
        TOUR,
        2000,
        calm(pulse_length=2, direction_setup=3),
        stalls=Stalls(7, gap=gap),
        until_idle=True,
    )
    _, steps = pulses_of(seen)
    assert steps == expected_pulses(4, TOUR)
    assert seen.fed == len(TOUR)
    # Of the last block `done` comes long before its last pulse is over.
    assert seen["done"].sum() == len(TOUR)
    assert [seen[f"position_{a}"][-1] for a in "xy"] == [3, 9]
    assert not seen["reason"].any()


def test_a_conic_on_the_device():
    conic = {"a": 1, "c": 1, "end_x": 0, "end_y": 7}
    blocks = [line(7, 0), ("conic", conic), line(2, 7)]
    seen = run(PysimModel, make(4, ("line", "conic"), 16), blocks, 1000, calm(), until_idle=True)
    assert pulses_of(seen)[1] == expected_pulses(4, blocks)
    assert seen["done"].sum() == 3


@pytest.mark.parametrize("ticks", [31, 5, 400])
def test_three_axes_on_the_pins(ticks):
    """A line in space, a helix, and back: x and y of the exact arc, z as its ticks have it.

    Half a circle of R = 8 is 25 ticks long, and z moves 31: with 31 ticks it steps in each, with 5
    it is there after 31 ticks, too, and with 400 the last step waits until there is only one left.
    """
    helix = {"center_x": 0, "center_y": 0, "pace": round(8 * 8 * np.pi / 31 * 2**12)}
    helix |= {"ticks": ticks}
    blocks: list[Block] = [
        line(8, 0, end_z=-15, pace=round((hypot(8, 15) / 15 - 1) * 2**17)),
        ("arc", {"end_x": -8, "end_y": 0, "end_z": 16, **helix}),
        line(-8, 0, end_z=16),
        line(-5, -6, end_z=9),
    ]
    letters = "xyz"
    pins = [f"pins_{a}_{pin}" for a in letters for pin in ("step", "direction")]
    watch = (*pins, *(f"position_{a}" for a in letters), "done", "reason")
    device = exact_device(5, 3, depth=4)
    seen = run(PysimModel, device, blocks, 3000, calm(), watch=watch, until_idle=True)
    _, steps = pulses_of(seen, letters)
    starts = [(0, 0, 0), *(tuple(b[f"end_{a}"] for a in letters) for _, b in blocks)]
    makes = {"line": GoldenExactLine(5, 3), "arc": golden_constant_arc(5, 3)}
    expected = [
        expected_steps(makes[kind], kind, start, values, letters)
        for start, (kind, values) in zip(starts, blocks, strict=False)
    ]
    assert steps == [step for block in expected for step in block]
    # In the plane the helix is the arc; z goes up with each step, or not.
    plane = [step[:2] for step in expected[1] if any(step[:2])]
    on_arc = tuple((name, blocks[1][1][name]) for name in ("end_x", "end_y"))
    assert plane == expected_path("arc", 5, (8, 0), on_arc)
    assert sum(step[2] for step in expected[1]) == 31
    assert {step[2] for step in expected[1]} <= {0, 1}
    assert seen["done"].sum() == len(blocks)
    assert [seen[f"position_{a}"][-1] for a in letters] == [-5, -6, 9]
    assert not seen["reason"].any()


@pytest.mark.parametrize("depth", [1, 2, 16])
def test_a_block_for_nobody_is_refused_in_its_turn(depth):
    blocks = [line(3, 0), ("conic", {"end_x": 1, "end_y": 1}), line(9, 9)]
    seen = run(PysimModel, make(4, ("line",), depth), blocks, 120, calm())
    assert pulses_of(seen)[1] == [(1, 0)] * 3
    assert seen["done"].sum() == 1
    assert StopReason(int(seen["reason"][-1])) is StopReason.KIND
    # Once it stands nothing is kept, and nothing more is taken.
    assert not seen["busy"][-1]
    assert not seen["blocks_ready"][-1]


# Clocks between blocks.


def edges_of(blocks: list[Block], depth: int = 16) -> list[int]:
    """Give the clocks of all leading edges at F = 1 and with pulses of one clock each way."""
    seen = run(PysimModel, make(8, ("line", "arc"), depth), blocks, 3000, calm(), until_idle=True)
    clocks, steps = pulses_of(seen)
    assert steps == expected_pulses(8, blocks)
    return clocks.tolist()


@pytest.mark.parametrize("depth", [1, 2, 16])
def test_lines_follow_each_other_without_a_gap(depth):
    """A pulse is out for a clock and in for one: every edge comes two clocks after the last.

    Between two lines the interpolator has no step for one clock, in which the last one waits.
    """
    clocks = edges_of([line(16, 0), line(32, 0), line(48, 0)], depth)
    assert np.diff(clocks).tolist() == [2] * 47


def test_another_kind_follows_without_a_gap():
    """16 steps take 32 clocks, the arc is prepared in 7 of them: no clock is lost.

    The arc begins with y, and the line behind it, too, after a last step of x: nothing but the step
    before it, which is put out in the clock in which the next one is taken, is waited for.
    """
    blocks = [line(16, 0), arc(0, 16), line(0, 32), line(0, 48)]
    clocks = edges_of(blocks)
    per_block = [len(expected_pulses(8, blocks[: k + 1])) for k in range(len(blocks))]
    gaps = np.diff(clocks)
    # From the last edge of a block to the first one of the next.
    assert [int(gaps[count - 1]) for count in per_block[:-1]] == [1, 1, 2]
    assert gaps[: per_block[0] - 1].tolist() == [2] * 15
    assert gaps[per_block[1] :].tolist() == [2] * 31


def test_a_short_line_before_an_arc_waits_for_its_preparation():
    """The second line begins when the last step of the first is taken, in clock t.

    The arc is handed over in t + 1 and offers its first step 7 clocks later: taken in t + 8,
    launched in t + 9. The only step of the second line waits from t + 2 on, and is taken then, when
    the one before is launched; its own launch is two clocks later, in t + 4.
    """
    clocks = edges_of([line(16, 0), line(17, 0), arc(0, 17)])
    assert np.diff(clocks)[15:17].tolist() == [2, 9 - 4]


# Stops.


def run_stopped(name: str, *, at: int, clear: int, extra: tuple = ()) -> Seen:
    """Stop a device on its way, clear it, and send it on."""
    orders = [*calm(pulse_length=2, pulse_space=2), (at, name, 1), (at + 1, name, 0)]
    orders += [(clear, "clear", 1), (clear + 1, "clear", 0), *extra]
    blocks = [line(12, 5), line(0, 7), arc(0, -7), line(3, 3)]
    return run(PysimModel, make(4, ("line", "arc")), blocks, clear + 200, orders)


def path_of(seen: Seen) -> np.ndarray:
    """Give where the pulses on the pins lead, from the origin, at every clock."""
    at = np.zeros((len(seen["done"]), 2), dtype=np.int64)
    clocks, steps = pulses_of(seen)
    for clock, step in zip(clocks.tolist(), steps, strict=True):
        at[clock:] += step
    return at


@pytest.mark.parametrize("at", range(12, 60, 5))
@pytest.mark.parametrize(("name", "reason"), [("stop", 1), ("emergency", 2)])
def test_a_stop_keeps_the_position(name, reason, at):
    seen = run_stopped(name, at=at, clear=at + 40)
    path = path_of(seen)
    for k, a in enumerate("xy"):
        assert (seen[f"position_{a}"] == path[:, k]).all()
    stood = np.flatnonzero(seen["reason"])
    assert set(seen["reason"][stood].tolist()) == {reason}
    assert stood.tolist() == list(range(stood[0], at + 41))
    clocks = pulses_of(seen)[0]
    if reason == 2:
        assert stood[0] == at + 1
        assert not ((clocks > at + 1) & (clocks <= at + 40)).any()
    else:
        # F = 1 without a ramp: 4 clocks until `still`, a pulse and its space, and the register.
        assert at + 4 <= stood[0] <= at + 12
        assert not ((clocks >= stood[0]) & (clocks <= at + 40)).any()
    # What is accepted afterwards begins where the machine is: the blocks lost are not made up.
    assert seen["busy"][at + 40] == 0


def test_the_next_block_starts_at_the_position():
    orders = [*calm(), (30, "emergency", 1), (34, "emergency", 0), (60, "clear", 1)]
    # Three are lost: one runs, one is handed over, one waits. The last one is offered until then.
    blocks = [line(15, 0), line(15, 15), line(15, 9), line(-3, 4)]
    seen = run(PysimModel, make(4, ("line",)), blocks, 400, orders)
    stopped = [int(seen[f"position_{a}"][60]) for a in "xy"]
    assert 0 < stopped[0] < 15
    after = [step for clock, step in zip(*pulses_of(seen), strict=True) if clock > 60]
    assert after == expected_path("line", 4, tuple(stopped), (("end_x", -3), ("end_y", 4)))
    assert seen["reason"][61:].tolist() == [0] * 339


def test_clear_under_emergency_does_nothing():
    orders = [*calm(), (20, "emergency", 1), (30, "clear", 1), (50, "emergency", 0)]
    seen = run(PysimModel, make(4, ("line",)), [line(9, 0)], 70, orders)
    # The last clock with the emergency is 49; it is cleared in 50.
    assert seen["reason"].tolist() == [0] * 21 + [2] * 30 + [0] * 19


@pytest.mark.parametrize(("switch", "end"), [("high_limit_x", (12, 0)), ("low_limit_y", (0, -12))])
def test_a_limit_switch_stops_it(switch, end):
    """The edge towards it in clock 22 is the last one, and 3 clocks after the next one it says so.

    Pulses take two clocks: the next edge would have been in 24.
    """
    orders = [*calm(), (21, switch, 1), (60, "clear", 1), (61, "clear", 0)]
    blocks = [line(*end)] * 3 + [line(0, 0)]
    seen = run(PysimModel, make(4, ("line",)), blocks, 160, orders)
    clocks, steps = pulses_of(seen)
    before = clocks[clocks <= 60]
    assert before[-1] <= 22
    would_be = before[-1] + 2
    stood = np.flatnonzero(seen["reason"] == 3)
    assert would_be <= stood[0] <= would_be + 3
    # Away from the switch is allowed: back to the origin, on the way it came.
    back = tuple(-value for value in steps[0])
    assert steps == [steps[0]] * len(before) + [back] * len(before)
    assert [seen[f"position_{a}"][-1] for a in "xy"] == [0, 0]
    assert seen["reason"][61:].tolist() == [0] * (len(seen["reason"]) - 61)


def test_a_switch_that_is_active_for_a_clock_drops_the_step_that_waits():
    """Whenever it is: each step is put out before it, or not at all."""
    free = pulses_of(run(PysimModel, make(4, ("line",)), [line(9, 0)], 60, calm()))[0]
    assert len(free) == 9
    limited = 0
    for clock in range(free[0], free[-1]):
        orders = [*calm(), (clock, "high_limit_x", 1), (clock + 1, "high_limit_x", 0)]
        seen = run(PysimModel, make(4, ("line",)), [line(9, 0)], 60, orders)
        clocks, steps = pulses_of(seen)
        stood = np.flatnonzero(seen["reason"] == 3)
        limited += len(stood) > 0
        assert len(steps) == (9 if not len(stood) else np.sum(clocks <= stood[0]))
        assert seen["position_x"][-1] == len(steps)
        assert (len(steps) < 9) == (len(stood) > 0)
    assert limited > 5


def test_the_last_step_before_a_refused_block_is_dropped_by_a_limit():
    orders = [*calm(), (0, "high_limit_x", 1), (60, "high_limit_x", 0), (70, "clear", 1)]
    blocks = [line(1, 0), arc(5, 0, (0, 0))]
    seen = run(PysimModel, make(4, ("line", "arc")), blocks, 90, orders)
    # The end of the arc is off its circle: told while the step before it waits at the switch.
    assert seen["reason"][69] == 3
    assert not seen["pins_x_step"].any()


def test_a_limit_switch_stops_it_again():
    orders = [*calm(), (0, "high_limit_x", 1), (40, "clear", 1), (41, "clear", 0)]
    seen = run(PysimModel, make(4, ("line",)), [line(9, 0)] * 4, 100, orders)
    assert not seen["pins_x_step"].any()
    # Twice: before and after the clear.
    assert (np.diff(seen["reason"]) == 3).sum() == 2


def test_hold_loses_nothing_and_single_steps_go():
    blocks = [line(9, 4), line(0, 0)]
    orders = [*calm(), (14, "hold", 1), (120, "hold", 0)]
    orders += [(clock, "single", value) for clock, value in ((60, 1), (61, 0), (80, 1), (90, 0))]
    seen = run(PysimModel, make(4, ("line",)), blocks, 400, orders, until_idle=True)
    clocks, steps = pulses_of(seen)
    assert steps == expected_pulses(4, blocks)
    # Permitted in the clock after the edge of `single`, pending in the next, seen after another.
    assert clocks[(clocks > 18) & (clocks < 122)].tolist() == [63, 83]
    assert seen["done"].sum() == 2
    assert not seen["reason"].any()


def test_a_single_step_passes_ticks_that_move_nothing():
    """A line of which every other tick carries a step: at F = 1 they leave from clock 9 on.

    Handed over in 1, so the first one waits in 9. The hold acts two clocks later: ticks leave in 9
    to 15, the last of them with a step. So every single step has an empty tick to pass before: that
    leaves in the clock after the edge, the step in the next one, and it is seen two later.
    """
    orders = [*calm(), (14, "hold", 1), (120, "hold", 0)]
    orders += [(at + k, "single", 1 - k) for at in (60, 80, 100) for k in (0, 1)]
    blocks = [line(9, 0, pace=2**16)]
    seen = run(PysimModel, make(4, ("line",)), blocks, 400, orders, until_idle=True)
    clocks, steps = pulses_of(seen)
    assert steps == [(1, 0)] * 9
    assert clocks[clocks < 122].tolist() == [11, 13, 15, 17, 64, 84, 104]


def test_stop_under_hold_with_a_single_step_that_waits():
    """It stands where it stopped: the single step does not leave after it."""
    arcs = [arc(9, 0, (0, 0))]
    for clock in range(19, 26):
        orders = [*calm(), (0, "hold", 1), (clock - 2, "single", 1), (clock, "stop", 1)]
        orders += [(clock + 1, "stop", 0), (44, "clear", 0)]
        seen = run(PysimModel, make(4, ("line", "arc")), [place(9, 0), *arcs], 70, orders)
        stood = np.flatnonzero(seen["reason"])
        assert not (pulses_of(seen)[0] > stood[0]).any()
        assert seen["busy"][stood[0] + 1] == 0


# Broken variants: each must differ from the golden model.

BROKEN: dict[str, Callable[[Any], None]] = {}


def broken(change: Callable[[Device, Module], None]) -> Callable[[Device, Module], None]:
    """List what breaks a device: assignments behind those of its queue or of itself."""
    part = "queue" if change.__code__.co_varnames[0] == "queue" else "device"

    def break_it(device: Device) -> None:
        target: Any = device.queue if part == "queue" else device
        elaborate = target.elaborate

        def amended(platform):
            m = elaborate(platform)
            change(target, m)
            return m

        target.elaborate = amended

    BROKEN[change.__name__] = break_it
    return change


def _head_kind(queue) -> Value:
    return Value.cast(queue.head[("kind",)])


@broken
def answer_counted_twice(queue, m):
    """`done` after the last step is the answer of the next line."""
    m.d.sync += queue.ended["line"].eq(0)


@broken
def ended_flag_not_cleared(queue, m):
    """Once a line has ended by a step, no line without steps is answered."""
    with m.If(queue.ended["line"] & ~queue.flush):
        m.d.sync += queue.ended["line"].eq(1)


@broken
def next_begins_too_early(queue, m):
    """The next block begins while the current one has steps to go."""
    following, current = queue.slots["next"], queue.slots["current"]
    with m.If(following["valid"] & current["valid"] & queue.taken & ~queue.flush):
        m.d.sync += [current["kind"].eq(following["kind"]), following["valid"].eq(0)]


@broken
def place_not_updated(queue, m):
    """The start of the next block stays when a line is handed over."""
    handed = queue.line_blocks.valid & queue.line_blocks.ready
    with m.If(handed & ~queue.flush):
        m.d.sync += queue.place_registers["x"].eq(queue.place_registers["x"])


@broken
def flush_forgets_next(queue, m):
    """The block that is handed over survives a flush."""
    with m.If(queue.flush):
        m.d.sync += queue.slots["next"]["valid"].eq(queue.slots["next"]["valid"])


@broken
def flush_leaves_the_place(queue, m):
    """After a stop the next block starts where the lost one was to begin."""
    with m.If(queue.flush):
        m.d.sync += [register.eq(register) for register in queue.place_registers.values()]


@broken
def refusal_lets_next_run(queue, m):
    """A block behind a refused one begins."""
    following, current = queue.slots["next"], queue.slots["current"]
    with m.If(following["valid"] & (queue.refusal != StopReason.NONE)):
        m.d.sync += [current["valid"].eq(1), following["valid"].eq(0)]


@broken
def refusal_of_the_next_lost(queue, m):
    """What is answered of a block before it begins is forgotten."""
    with m.If(queue.begins):
        m.d.sync += queue.slots["current"]["refusal"].eq(0)


@broken
def wrong_kind_selected(queue, m):
    """An arc is handed to the interpolator of lines."""
    m.d.comb += queue.line_blocks.valid.eq(
        queue.held & ~queue.slots["next"]["valid"] & ~queue.flush & ~_head_kind(queue)[1]
    )


@broken
def permit_ignored(queue, m):
    """Steps leave when the pulse unit is ready, whatever the feed unit says."""
    current = queue.slots["current"]
    running = current["valid"] & ~current["answered"] & (current["kind"] == 0)
    with m.If(running & ~queue.flush):
        m.d.comb += queue.steps.valid.eq(queue.line_steps.valid)
        m.d.comb += queue.line_steps.ready.eq(queue.steps.ready)


@broken
def done_of_a_refused_block(queue, m):
    """A refused block is answered by `done` as well."""
    with m.If(queue.refusal != StopReason.NONE):
        m.d.sync += queue.done_register.eq(1)


@broken
def placed_under_a_pulse(queue, m):
    """PLACE does not wait for the pulse that is out."""
    m.d.comb += queue.placing.eq(
        queue.held
        & ~queue.slots["next"]["valid"]
        & ~queue.slots["current"]["valid"]
        & ~queue.flush
        & _head_kind(queue).all()
    )


@broken
def pace_lost(queue, m):
    """Lines run at full speed."""
    m.d.comb += queue.line_blocks.payload.pace.eq(0)


@broken
def pace_halved(queue, m):
    """Arcs are told half of their pace."""
    m.d.comb += queue.arc_blocks.payload.pace.eq(Value.cast(queue.head[("pace",)]) >> 1)


@broken
def ticks_paid_as_steps(device, m):
    """A tick that moves both axes is as long as a diagonal, one that moves none takes no time."""
    m.d.comb += device.feed.even.eq(0)


@broken
def hold_ignored(device, m):
    """`hold` does not come to the feed unit."""
    m.d.comb += device.feed.hold.eq(device.stop_asked)


@broken
def stop_forgotten(device, m):
    """`stop` counts only while it is given."""
    m.d.sync += device.stop_asked.eq(device.stop)


@broken
def emergency_ignored_for_pending(device, m):
    """What is pending in the pulse unit at an emergency is put out."""
    reason = device.reason_register
    m.d.comb += device.pulse.stop.eq(
        device.pulse.limited | (reason == StopReason.EMERGENCY) | (reason == StopReason.LIMIT)
    )


@broken
def clear_under_emergency(device, m):
    """`clear` goes before `emergency`."""
    with m.If(device.clear & (device.reason_register != StopReason.NONE) & ~device.pulse.busy):
        m.d.sync += device.reason_register.eq(StopReason.NONE)


@broken
def clear_under_a_pulse(device, m):
    """`clear` does not wait for the pulse that is out."""
    stands = device.reason_register != StopReason.NONE
    with m.If(device.clear & stands & ~device.emergency):
        m.d.sync += device.reason_register.eq(StopReason.NONE)


def run_broken(break_it: Callable[[Any], None], wanted: Seen | None = None) -> tuple[Seen, list]:
    """Run a device that is broken so, beside the golden model."""
    device = make(4, ("line", "arc"))
    break_it(device)
    blocks, orders = draw_blocks(4, ("line", "arc"), 200, 9), draw_orders(700, 9)
    golden = make_device(4, ("line", "arc"))
    return differences(PysimModel, device, golden, blocks, orders, 700, wanted=wanted)


@pytest.fixture(scope="module")
def sound() -> Seen:
    """Give what the golden model does: the sound device does the same."""
    wanted, wrong = run_broken(lambda _: None)
    assert wrong == []
    return wanted


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_device_differs_from_the_golden_model(name, sound):
    assert run_broken(BROKEN[name], sound)[1]


# Constructor.


def stand_in(width: int, axes: int = 2) -> Any:
    """Give what a device asks an interpolator before it uses it: one that is made must be used."""
    blocks = SimpleNamespace(payload=Signal(line_block_layout(width, axes)))
    return SimpleNamespace(parameters={"width": width, "axes": axes}, blocks=blocks)


@pytest.mark.parametrize(
    ("refusal", "parameters"),
    [
        ((ValueError, "no interpolator: give one or more of line, arc, conic"), {}),
        (
            (
                ValueError,
                "interpolators differ: line 8 bits and 2 axes, arc 6 bits and 2 axes; choose the "
                "same for all",
            ),
            {"line": stand_in(8), "arc": stand_in(6)},
        ),
        (
            (
                ValueError,
                "interpolators differ: line 8 bits and 3 axes, arc 8 bits and 2 axes; choose the "
                "same for all",
            ),
            {"line": stand_in(8, 3), "arc": stand_in(8)},
        ),
        (
            (ValueError, "depth is 0: choose a whole number from 1 to 4096"),
            {"line": stand_in(8), "depth": 0},
        ),
        (
            (TypeError, "depth must be a whole number from 1 to 4096, not True"),
            {"line": stand_in(8), "depth": True},
        ),
        (
            (ValueError, "kind is 'steps': choose 'step_direction' or 'quadrature'"),
            {"line": stand_in(8), "pins": "steps"},
        ),
    ],
    ids=lambda value: "" if isinstance(value, dict) else value[1],
)
def test_refused_parameters(refusal, parameters):
    assert_refused(refusal, Device, **parameters)


def test_parameters_and_registers():
    device = make(8, ("line", "arc"), depth=4, pins="quadrature")
    assert device.parameters == {
        "width": 8,
        "axes": 2,
        "kinds": ("line", "arc"),
        "depth": 4,
        "pauses": (256, 362),
        "pairing": True,
        "multiplier": False,
        "pins": "quadrature",
        "inverted_steps": "",
        "inverted_directions": "",
    }
    run(PysimModel, device, [], 1, [], watch=("busy",))  # a device that is made must be used
    own = {"line_timer_debt", "line_p3", "arc_timer_debt", "arc_timer_x"}
    assert own | {"pulse_hold", "reason", "current"} <= set(device.registers)
    assert "head" not in device.registers
    grouped = [signal for group in device.diagram.values() for signal in group]
    assert len(grouped) == len(device.registers)
    assert {id(signal) for signal in grouped} == set(map(id, device.registers.values()))


@pytest.mark.parametrize(
    ("kinds", "axes", "message"),
    [
        ((), 2, "kinds are (): choose one or more of line, arc, conic"),
        (("line", "curve"), 2, "kinds are ('line', 'curve'): choose one or more of "),
        (("conic",), 3, "number of axes is 3: conics lie in a plane, choose 2"),
        (("line", "arc", "conic"), 3, "number of axes is 3: conics lie in a plane, choose 2"),
    ],
)
def test_an_exact_device_is_refused(kinds, axes, message):
    if message.endswith("of "):
        message += "line, arc, conic"
    assert_refused((ValueError, message), exact_device, 8, axes, kinds)


def test_an_exact_device():
    for axes, kinds in ((2, ("line", "arc", "conic")), (6, ("line", "arc"))):
        device = exact_device(8, axes, kinds, depth=2, pins="quadrature")
        Fragment.get(device, None)  # it must be used
        assert {kind: type(part) for kind, part in device.interpolators.items()} == {
            kind: ExactConic if kind == "conic" else ConstantSpeed for kind in kinds
        }
        assert device.queue.steady == ("line", "arc")
        assert device.parameters["axes"] == axes
        assert (device.parameters["depth"], device.parameters["pins"]) == (2, "quadrature")
