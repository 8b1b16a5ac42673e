"""Input processing of arcs, against the rules told with exact geometry in ``tests/arcs.py``."""

from itertools import product

import numpy as np
import pytest
from amaranth import Module
from amaranth.hdl import Shape
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.arc_input import FULL_TURNS_BITS, TURNS_BITS, ArcInput, arc_block_layout
from discreta.hdl.contract import ErrorCode, Part, point_layout
from discreta.sim.compiled import CompiledModel
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS
from tests.arcs import OFF_CURVE, draw_arcs, fault, is_empty, prepare, seen
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run
from tests.needs import needs_compiler

SHOWN = ("fault", "empty", "start", "from_xy", "to_xy", "first_swap", "negative", "first_turns")
SHOWN += ("limit",)


def prepared(block, width):
    """Give what must be shown of a block, in the order of SHOWN, or a shorter part of it."""
    code = fault(block, width)
    if code:
        return [code]
    if is_empty(block):
        return [0, 1, *block[:2]]
    arc = prepare(block)
    points = [*block[:2], *arc.from_xy, *arc.to_xy]
    # The limit is that of arcs that cross an axis.
    limit = [arc.limit] if arc.turns else []
    return [0, 0, *points, arc.swap, *arc.negative, arc.turns, *limit]


class Stage(Part):
    """Input processing with the face of an interpolator: a prepared block is its only step."""

    def __init__(self, width):
        self.input = ArcInput(width)
        ports = self.input.signature.members
        shown = {name: Shape.cast(ports[name].shape) for name in ("fault", "empty", "first_swap")}
        shown = data.StructLayout({name: ports[name].shape for name in SHOWN} | shown)
        super().__init__(
            {
                "blocks": In(stream.Signature(arc_block_layout(width))),
                "steps": Out(stream.Signature(shown)),
                "done": Out(1),
                "error": Out(1),
            }
        )
        self.registers = {}

    def elaborate(self, _platform):
        m = Module()
        m.submodules.input = inp = self.input
        m.d.comb += [
            inp.blocks.payload.eq(self.blocks.payload),
            inp.blocks.valid.eq(self.blocks.valid),
            self.blocks.ready.eq(inp.blocks.ready),
            *[self.steps.payload[name].eq(getattr(inp, name)) for name in SHOWN],
            self.steps.valid.eq(inp.pending),
            inp.take.eq(inp.pending & self.steps.ready),
            self.done.eq(inp.take),
        ]
        return m


def run_stage(width, blocks, stalls=NO_STALLS):
    """Give the clocks of acceptance and of the taking of every block, and what was shown then."""
    model = CompiledModel(Stage(width))
    events = model.run(
        blocks,
        (2 * width + 40) * len(blocks),
        until_answered=len(blocks),
        stalls=stalls,
        event_room=2 * len(blocks),
    ).events
    accepted, taken = (
        events[events[:, EVENT_COLUMNS.index(name)] == 1] for name in ("accepted", "taken")
    )
    assert len(accepted) == len(taken) == len(blocks)
    return accepted[:, 0], taken[:, 0], taken[:, len(EVENT_COLUMNS) :]


def assert_prepared(shown, blocks, width):
    # An arc has no reason to be SHARP.
    reasons = [code for name, code in ErrorCode.__members__.items() if name != "SHARP"]
    counts = {code.value: 0 for code in reasons}
    for row, block in zip(shown.tolist(), blocks.tolist(), strict=True):
        wanted = prepared(block, width)
        assert row[: len(wanted)] == wanted, block
        counts[wanted[0]] += 1
    return counts


def around(center, reach):
    """Give all arcs of 4 bits with start and end up to ``reach`` steps from a centre."""
    points = [
        (x, y)
        for x in range(center[0] - reach, center[0] + reach + 1)
        for y in range(center[1] - reach, center[1] + reach + 1)
        if -16 <= x < 16 and -16 <= y < 16
    ]
    pairs = [(*start, *end, *center) for start, end in product(points, points)]
    # Some of them with one or two full turns.
    ways = [(*pair, clockwise) for pair, clockwise in product(pairs, (0, 1))]
    return [(*way, (k % 7 == 6) + (k % 11 == 10)) for k, way in enumerate(ways)]


def has_angles(block):
    """Tell whether the angles of start and end say what the arc crosses, or it crosses nothing."""
    return (0, 0) not in seen(block) or is_empty(block)


@needs_compiler
def test_every_arc_around_some_centres_of_four_bits():
    # In the middle, in the four corners, at an edge, and as far from it as some limits are.
    centers = [(0, 0), (15, 15), (-16, 15), (-16, -16), (15, -16), (12, 0), (0, 13), (-13, 1)]
    blocks = [block for k, center in enumerate(centers) for block in around(center, 4 + (k == 0))]
    blocks = np.array([block for block in blocks if has_angles(block)])
    _, _, shown = run_stage(4, blocks)
    counts = assert_prepared(shown, blocks, 4)
    assert min(counts.values()) > 10_000


# Far out, where every bit counts: arcs that fit just so, and the same a step too large.
def at_the_limits(width):
    top, low = 2**width - 1, -(2**width)
    half = 2 ** (width - 1)
    return [
        # One quadrant needs no room beyond its ends, however large it is.
        (top, 0, 0, top, 0, 0, 0, 0),
        (0, low + 1, top, 0, 0, 0, 0, 0),
        (low + 1, 0, 0, low + 1, 0, 0, 0, 0),
        (low, 0, 0, low, 0, 0, 0, 0),
        (top, top, top, top - 1, 0, 0, 1, 0),
        (0, 0, top, top, top, 0, 0, 0),
        # The limit is a step more than the radius.
        (top - 1, 0, 0, 1 - top, 0, 0, 0, 0),
        (top, 0, 0, -top, 0, 0, 0, 0),
        (half - 1, 0, half - 1, 0, 0, 0, 1, 255),
        (low + half, 0, low + half, 0, low, 0, 1, 0),
        (top, 5, top, 5, top - half, 5, 0, 0),
        (top - 1, 5, top - 1, 5, top - half, 5, 0, 0),
        # The whole range between two points, with the centre in the middle or on one of them.
        (low, low, top, top, 0, 0, 0, 0),
        (low, low, top, top, low, low, 0, 0),
        (low, low, low, low, low, low, 1, 255),
        (top, low, top, low, top, low, 0, 1),
        # Radii of thousands of millions that differ by a step, and by hardly more.
        (top - 1, 0, 0, top, 0, 0, 0, 0),
        (0, top, top - 1, 1, 0, 0, 1, 0),
        (0, top, top - 1, 0, 0, 0, 1, 0),
        (0, top, 1, top - 1, 0, 0, 0, 0),
        (1, top, 0, top - 1, 0, 0, 0, 0),
    ]


@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize("width", [8, 32])
def test_random_arcs_and_arcs_at_the_limits(width):
    blocks = [draw_arcs(width, 300, seed=1, radius=2**bits) for bits in (3, width - 2, width - 1)]
    blocks = np.concatenate([*blocks, at_the_limits(width)])
    accepted, taken, shown = run_stage(width, blocks, Stalls(seed=2, stall=0.8, gap=0.9))
    counts = assert_prepared(shown, blocks, width)
    assert min(counts.values()) >= 6
    # Held while no one takes it, and the next block accepted at once or later.
    waited = taken - accepted - (2 * width + 5)
    assert waited.min() == 0
    assert waited.max() > 5
    assert (accepted[1:] - taken[:-1]).min() == 1


@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize("width", [8, 32])
def test_latency_and_throughput(width):
    blocks = draw_arcs(width, 50, seed=3, radius=100)
    accepted, taken, _ = run_stage(width, blocks)
    assert np.array_equal(taken - accepted, np.full(50, 2 * width + 5))
    assert accepted.tolist() == list(range(0, 50 * (2 * width + 6), 2 * width + 6))


# From the rules, by name: the crossings of arcs around the origin.
@pytest.mark.parametrize(
    ("block", "turns", "swap", "negative"),
    [
        ((100, 0, 0, 100, 0, 0, 0, 0), 0, 0, (1, 0)),
        ((100, 0, 100, 0, 0, 0, 0, 0), 3, 0, (1, 0)),
        ((60, 80, 60, 80, 0, 0, 0, 0), 4, 0, (1, 0)),
        ((60, 80, 60, 80, 0, 0, 1, 0), 4, 1, (0, 1)),
        ((100, 0, 0, 100, 0, 0, 0, 255), 1020, 0, (1, 0)),
        ((60, 80, 60, 80, 0, 0, 0, 255), 1024, 0, (1, 0)),
        ((100, 0, 0, 100, 0, 0, 1, 0), 2, 0, (1, 1)),
        ((0, 100, 100, 0, 0, 0, 1, 0), 0, 1, (0, 1)),
        ((0, 100, -100, 0, 0, 0, 0, 0), 0, 1, (1, 1)),
        ((-100, 0, 0, -100, 0, 0, 0, 0), 0, 0, (0, 1)),
        ((0, -100, 100, 0, 0, 0, 0, 0), 0, 1, (0, 0)),
        ((60, 80, 60, 81, 0, 0, 0, 0), 0, 0, (1, 0)),
        ((60, 80, 60, 79, 0, 0, 0, 0), 4, 0, (1, 0)),
        ((60, 80, 61, 80, 0, 0, 0, 0), 4, 0, (1, 0)),
        ((100, 0, 101, 0, 0, 0, 0, 0), 3, 0, (1, 0)),
        ((100, 0, 99, 0, 0, 0, 1, 1), 7, 0, (1, 1)),
    ],
)
def test_prepared_arcs_held_until_taken(block, turns, swap, negative):
    part = ArcInput(8)
    assert prepare(block).turns == turns  # what is compared with below is right

    async def bench(ctx):
        names = ("clockwise", "full_turns")
        points = [dict(zip("xy", block[k : k + 2], strict=True)) for k in (0, 2, 4)]
        payload = dict(zip(("start", "end", "center"), points, strict=True))
        ctx.set(part.blocks.payload, payload | dict(zip(names, block[6:], strict=True)))
        ctx.set(part.blocks.valid, 1)
        assert ctx.get(part.held) == ctx.get(part.pending) == 0
        assert ctx.get(part.blocks.ready) == 1
        await ctx.tick()
        # Another block stands behind it, and waits.
        ctx.set(part.blocks.payload.start.x, -1)
        ctx.set(part.blocks.payload.clockwise, 1 - block[6])
        for clock in range(1, 30):
            assert ctx.get(part.held) == 1
            assert ctx.get(part.blocks.ready) == 0
            assert ctx.get(part.pending) == (clock >= 21)
            if clock >= 21:
                assert ctx.get(part.fault) == ErrorCode.NONE
                assert [ctx.get(part.start.x), ctx.get(part.start.y)] == list(block[:2])
                assert ctx.get(part.first_turns) == turns
                assert ctx.get(part.first_swap) == swap
                assert (ctx.get(part.negative.x), ctx.get(part.negative.y)) == negative
            await ctx.tick()
        ctx.set(part.take, 1)
        assert ctx.get(part.blocks.ready) == 0
        await ctx.tick()
        ctx.set(part.take, 0)
        assert ctx.get(part.held) == ctx.get(part.pending) == 0
        assert ctx.get(part.blocks.ready) == 1
        await ctx.tick()
        ctx.set(part.blocks.valid, 0)
        for clock in range(1, 22):
            assert ctx.get(part.held) == 1
            assert ctx.get(part.pending) == (clock == 21)
            await ctx.tick()
        assert ctx.get(part.start.x) == -1

    run(part, bench)


@pytest.mark.usefixtures("compiled_engine")
def test_a_start_or_an_end_in_the_centre():
    """An end there is off by R, so R = 1 is allowed; a start there is on no circle."""
    points = [(x, y) for x in range(-2, 3) for y in range(-2, 3) if (x, y) != (0, 0)]
    center = (2, -3)
    far = [(x + center[0], y + center[1]) for x, y in points]
    blocks = [(*start, *center, *center, way, 0) for start in far for way in (0, 1)]
    blocks += [(*center, *end, *center, way, 0) for end in far for way in (0, 1)]
    _, _, shown = run_stage(8, np.array(blocks))
    wanted = [0 if x * x + y * y == 1 else OFF_CURVE for x, y in points for _ in (0, 1)]
    assert shown[:, 0].tolist() == wanted + [OFF_CURVE] * len(wanted)
    assert not shown[:, 1].any()


def test_nothing_is_held_after_reset():
    part = ArcInput(4)

    async def bench(ctx):
        ctx.set(part.blocks.payload.full_turns, 3)
        for _ in range(20):
            assert ctx.get(part.held) == ctx.get(part.pending) == 0
            assert ctx.get(part.blocks.ready) == 1
            await ctx.tick()

    run(part, bench)


def test_arc_block_layout():
    layout = arc_block_layout(8)
    assert list(layout.members) == ["start", "end", "center", "clockwise", "full_turns"]
    assert all(layout[name].shape == point_layout(8, 2) for name in ("start", "end", "center"))
    assert layout.size == 3 * 2 * 9 + 1 + 8
    # As many crossings as there can be: a whole turn from between two axes after all full turns.
    assert FULL_TURNS_BITS == 8
    assert 2**TURNS_BITS > 4 * 255 + 4


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), ArcInput, width)
