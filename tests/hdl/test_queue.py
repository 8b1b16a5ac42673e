# amaranth: UnusedElaboratable=no
# (A queue that is refused cannot be simulated.)
"""The block queue: equal to its golden model at every clock, whatever comes in."""

import numpy as np
import pytest

from discreta.hdl.plain import PlainPorts
from discreta.hdl.queue import KINDS, BlockKind, BlockQueue, StopReason, device_block_layout
from discreta.sim.golden.queue import CODES, PLACE, REFUSED, UNKNOWN
from discreta.sim.golden.queue import BlockQueue as GoldenQueue
from tests.hdl.parts.clocked import BAD_AXES, BAD_WIDTHS, assert_refused, run

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
    ("width", "axes", "kinds"),
    [
        (4, 2, ("line",)),
        (8, 2, ("line", "arc")),
        (5, 2, ("arc", "conic")),
        (8, 2, ("line", "arc", "conic")),
        (16, 3, ("line",)),
    ],
)
def test_every_register_and_output_at_every_clock(width, axes, kinds):
    golden = GoldenQueue(width, axes, kinds)
    queue = BlockQueue(width, axes, kinds, 1)
    top = PlainPorts(queue)
    assert set(top.inputs) == set(golden.inputs())
    assert set(queue.registers) == set(golden.registers())
    random = np.random.default_rng([7, width, axes])
    reached = {"begins": 0, "placing": 0, "refusal": 0, "done": 0, "taken": 0}

    async def bench(ctx):
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
            state = golden.step(state, inputs)
            await ctx.tick()

    run(top, bench)
    assert min(reached.values()) >= 5


@pytest.mark.parametrize("depth", [1, 2, 5, 16])
def test_so_many_blocks_wait(depth):
    """As many as its depth, one that is next, and one that runs."""
    queue = BlockQueue(4, 2, ("line",), depth)

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
    queue = BlockQueue(4, 2, ("line",), depth)

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
        queue = BlockQueue(4, 2, ("line",), depth)

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
def test_layout_of_a_block(width):
    for kinds in (("line",), ("line", "arc"), ("arc", "conic")):
        layout = device_block_layout(width, 2, kinds)
        bits = sum(bits for bits, _ in GoldenQueue(width, 2, kinds).fields().values())
        assert layout.size == bits


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refused_widths(width, error, message):
    assert_refused((error, message), BlockQueue, width)


@pytest.mark.parametrize(("axes", "error", "message"), BAD_AXES)
def test_refused_axes(axes, error, message):
    assert_refused((error, message), BlockQueue, 8, axes)


@pytest.mark.parametrize(
    ("axes", "kinds", "message"),
    [
        (2, (), "kinds are (): choose one or more of 'line', 'arc', 'conic'"),
        (2, ("line", "line"), "kinds are ('line', 'line'): choose one or more of "),
        (2, ("curve",), "kinds are ('curve',): choose one or more of 'line', 'arc', 'conic'"),
        (3, ("line", "arc"), "kinds are ('line', 'arc'): choose one or more of "),
    ],
)
def test_refused_kinds(axes, kinds, message):
    if message.endswith("of "):
        message += "'line' for 3 axes" if axes == 3 else "'line', 'arc', 'conic'"
    assert_refused((ValueError, message), BlockQueue, 8, axes, kinds)


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
    assert_refused((error, message), BlockQueue, 8, 2, ("line",), depth)
