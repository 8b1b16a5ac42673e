# amaranth: UnusedElaboratable=no
# (A queue that is refused cannot be simulated.)
"""The block queue: equal to its golden model at every clock, whatever comes in."""

import numpy as np
import pytest
from amaranth.hdl import Fragment

from discreta.hdl.arc_input import arc_block_layout
from discreta.hdl.conic import conic_block_layout
from discreta.hdl.constant_speed import constant_arc, constant_line
from discreta.hdl.plain import PlainPorts
from discreta.hdl.quadrant import line_block_layout
from discreta.hdl.queue import KINDS, BlockKind, BlockQueue, StopReason, device_block_layout
from discreta.sim.golden.queue import CODES, PLACE, REFUSED, UNKNOWN
from discreta.sim.golden.queue import BlockQueue as GoldenQueue
from tests.hdl.parts.clocked import BAD_AXES, BAD_WIDTHS, assert_refused, run

#: Of lines alone, in the plane, 4 bits.
LINES = {"line": line_block_layout(4, 2)}


def layouts_of(width, axes, kinds, steady=()):
    """Give the layouts of interpolators; those of the steady ones are of constant speed."""
    layouts = {
        "line": line_block_layout(width, axes),
        "arc": arc_block_layout(width),
        "conic": conic_block_layout(width),
    }
    for kind, make in (("line", constant_line), ("arc", constant_arc)):
        if kind in steady:
            core = make(width, axes)
            Fragment.get(core, None)  # it must be used
            layouts[kind] = core.blocks.payload.shape()
    return {kind: layouts[kind] for kind in kinds}


#: How often a flag is 1: the rest every other time.
OFTEN = {"flush": 0.03, "permit": 0.8, "blocks_valid": 0.7, "steps_ready": 0.8}


def draw_inputs(golden: GoldenQueue, random: np.random.Generator) -> dict[str, int]:
    """Draw all inputs: interpolators answer as they like, also what they never should."""
    values = {}
    for name, (bits, signed) in golden.inputs().items():
        low, high = (-(1 << bits - 1), 1 << bits - 1) if signed else (0, 1 << bits)
        values[name] = int(random.integers(low, high))
        if bits == 1:
            values[name] = int(random.random() < OFTEN.get(name, 0.5))
        if name.endswith("_error") and random.random() < 0.8:
            values[name] = 0
    return values


@pytest.mark.parametrize(
    ("width", "axes", "kinds", "steady"),
    [
        (4, 2, ("line",), ("line",)),
        (8, 2, ("line", "arc"), ()),
        (5, 2, ("arc", "conic"), ("arc",)),
        (8, 2, ("line", "arc", "conic"), ("line", "arc")),
        (8, 2, ("line", "arc", "conic"), ("arc",)),
        (16, 3, ("line",), ()),
        (6, 3, ("line", "arc"), ("line", "arc")),
    ],
)
def test_every_register_and_output_at_every_clock(width, axes, kinds, steady):
    golden = GoldenQueue(width, axes, kinds, steady)
    queue = BlockQueue(width, axes, layouts_of(width, axes, kinds, steady), 1, steady=steady)
    top = PlainPorts(queue)
    assert set(top.inputs) == set(golden.inputs())
    assert set(queue.registers) == set(golden.registers())
    random = np.random.default_rng([7, width, axes])
    reached = {"begins": 0, "placing": 0, "refusal": 0, "done": 0, "taken": 0}

    even = 0

    async def bench(ctx):
        nonlocal even
        state = golden.reset()
        for _ in range(400):
            inputs = draw_inputs(golden, random)
            for name, value in inputs.items():
                ctx.set(top.inputs[name], value)
            seen = {name: ctx.get(register) for name, register in queue.registers.items()}
            assert seen == state
            shown = {name: ctx.get(port) for name, port in top.outputs.items()}
            assert shown == golden.outputs(state, inputs)
            for name in reached:
                reached[name] += bool(shown[name])
            even += shown["active"] and shown["even"]
            state = golden.step(state, inputs)
            await ctx.tick()

    run(top, bench)
    assert min(reached.values()) >= 5
    # Lines, arcs, conics and places come all as often.
    assert (even >= 5) == bool(steady)


@pytest.mark.parametrize("depth", [1, 2, 5, 16])
def test_so_many_blocks_wait(depth):
    """As many as its depth, one that is next, and one that runs."""
    queue = BlockQueue(4, 2, LINES, depth)

    async def bench(ctx):
        ctx.set(queue.blocks.valid, 1)
        ctx.set(queue.line_blocks.ready, 1)
        accepted = []
        for number in range(3 * depth + 20):
            ctx.set(queue.blocks.payload.end.x, len(accepted) % 8)
            if ctx.get(queue.blocks.ready):
                accepted.append(number)
            await ctx.tick()
        assert len(accepted) == depth + 2
        # They come out as they went in, and the flush drops what is left.
        ends = []
        ctx.set(queue.blocks.valid, 0)
        for number in range(6 * depth + 20):
            ctx.set(queue.line_done, number % 4 == 0 and ctx.get(queue.active))
            if ctx.get(queue.line_blocks.valid):
                ends.append(ctx.get(queue.line_blocks.payload.end.x))
            await ctx.tick()
        assert ends == [number % 8 for number in range(2, depth + 2)]
        assert not ctx.get(queue.busy)

    run(queue, bench)


@pytest.mark.parametrize("depth", [1, 2, 16])
def test_a_flush_empties_it(depth):
    queue = BlockQueue(4, 2, LINES, depth)

    async def bench(ctx):
        ctx.set(queue.blocks.valid, 1)
        ctx.set(queue.blocks.payload.end.x, 3)
        ctx.set(queue.line_blocks.ready, 1)
        await ctx.tick().repeat(depth + 8)
        assert ctx.get(queue.busy)
        ctx.set(queue.flush, 1)
        ctx.set(queue.position.x, -5)
        assert not ctx.get(queue.blocks.ready)
        await ctx.tick()
        assert not ctx.get(queue.busy)
        await ctx.tick()
        ctx.set(queue.flush, 0)
        assert ctx.get(queue.blocks.ready)
        start = queue.line_blocks.payload.start
        offered = await ctx.tick().sample(start.x, start.y).until(queue.line_blocks.valid)
        assert offered == (-5, 0)

    run(queue, bench)


def test_clocks_of_an_empty_queue():
    """Accepted in clock 0, at the head in 1 or 2, next one later, current again one later."""
    for depth, head in ((1, 1), (2, 2), (16, 2)):
        queue = BlockQueue(4, 2, LINES, depth)

        async def bench(ctx, queue=queue, head=head):
            ctx.set(queue.line_blocks.ready, 1)
            ctx.set(queue.blocks.valid, 1)
            seen = {"handed": [], "begins": [], "active": []}
            for clock in range(6):
                handed = ctx.get(queue.line_blocks.valid)
                shown = {"handed": handed, "begins": ctx.get(queue.begins)}
                shown["active"] = ctx.get(queue.active)
                for name, value in shown.items():
                    seen[name] += [clock] * value
                await ctx.tick()
                ctx.set(queue.blocks.valid, 0)
            assert seen["handed"] == [head]
            assert seen["begins"] == [head + 1]
            assert seen["active"] == list(range(head + 2, 6))

        run(queue, bench)


def test_the_golden_model_names_kinds_and_reasons_alike():
    assert {kind: BlockKind(code) for kind, code in CODES.items()} == KINDS
    assert BlockKind(PLACE) is BlockKind.PLACE
    assert StopReason(UNKNOWN) is StopReason.KIND
    reasons = [StopReason(error + REFUSED) for error in (1, 2, 3)]
    assert reasons == [StopReason.RANGE, StopReason.OFF_CURVE, StopReason.SHARP]


@pytest.mark.parametrize("width", [4, 16])
@pytest.mark.parametrize(
    ("axes", "kinds", "steady"),
    [
        (2, ("line",), ()),
        (2, ("line", "arc"), ()),
        (2, ("line", "arc"), ("line",)),
        (2, ("arc", "conic"), ("arc",)),
        (3, ("line", "arc"), ("line", "arc")),
        (6, ("arc",), ("arc",)),
    ],
)
def test_layout_of_a_block(width, axes, kinds, steady):
    """A pace where a kind comes in ticks, and their number where axes move along an arc."""
    layout = device_block_layout(width, axes, layouts_of(width, axes, kinds, steady))
    bits = sum(bits for bits, _ in GoldenQueue(width, axes, kinds, steady).fields().values())
    assert layout.size == bits
    assert ("pace" in layout.members) == bool(steady)
    assert ("ticks" in layout.members) == (axes > 2)


def test_even_while_a_kind_of_equal_ticks_runs():
    """Of a line at constant speed it is 1, of an arc that is not, 0: from ``begins`` + 1 on."""
    layouts = layouts_of(4, 2, ("line", "arc"), ("line",))
    queue = BlockQueue(4, 2, layouts, 2, steady=("line",))
    kinds = ["LINE", "ARC", "LINE", "LINE", "ARC"]

    async def bench(ctx):
        ctx.set(queue.permit, 1)
        ctx.set(queue.steps.ready, 1)
        for kind in ("line", "arc"):
            ctx.set(getattr(queue, f"{kind}_blocks").ready, 1)
            ctx.set(getattr(queue, f"{kind}_steps").valid, 1)
        left, seen = list(kinds), []
        for clock in range(60):
            ctx.set(queue.blocks.valid, bool(left))
            if left:
                ctx.set(queue.blocks.payload.kind, KINDS[left[0].lower()])
            # Every block has four steps at least; then all that run are at their last one.
            for kind in ("line", "arc"):
                ctx.set(getattr(queue, f"{kind}_steps").payload.last, clock % 4 == 3)
            begins, ready = ctx.get(queue.begins), ctx.get(queue.blocks.ready)
            if ctx.get(queue.taken) and ctx.get(queue.active):
                seen.append(ctx.get(queue.even))
            await ctx.tick()
            if left and ready:
                left.pop(0)
            if begins:
                seen.append("begins")
        blocks = "".join(map(str, seen)).split("begins")[1:]
        assert [set(block) for block in blocks] == [{"01"[kind == "LINE"]} for kind in kinds]

    run(queue, bench)


def test_no_kind_need_be_steady():
    queue = BlockQueue(4, 2, LINES, 1)
    assert queue.steady == ()
    assert BlockQueue(4, 2, LINES, 1, steady=("line", "arc")).steady == ("line",)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refused_widths(width, error, message):
    assert_refused((error, message), BlockQueue, width, 2, LINES)


@pytest.mark.parametrize(("axes", "error", "message"), BAD_AXES)
def test_refused_axes(axes, error, message):
    assert_refused((error, message), BlockQueue, 4, axes, LINES)


@pytest.mark.parametrize(("kinds", "said"), [((), "()"), (("curve",), "('curve',)")])
def test_refused_kinds(kinds, said):
    message = f"kinds are {said}: choose one or more of 'line', 'arc', 'conic'"
    layouts = dict.fromkeys(kinds, line_block_layout(4, 2))
    assert_refused((ValueError, message), BlockQueue, 4, 2, layouts)


@pytest.mark.parametrize(
    ("depth", "error", "message"),
    [
        (0, ValueError, "depth is 0: choose a whole number from 1 to 4096"),
        (4097, ValueError, "depth is 4097: choose a whole number from 1 to 4096"),
        (2.0, TypeError, "depth must be a whole number from 1 to 4096, not 2.0"),
        (True, TypeError, "depth must be a whole number from 1 to 4096, not True"),
    ],
)
def test_refused_depths(depth, error, message):
    assert_refused((error, message), BlockQueue, 4, 2, LINES, depth)
