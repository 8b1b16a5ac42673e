from itertools import product

import numpy as np
import pytest

from discreta.hdl.contract import ErrorCode, point_layout
from discreta.hdl.quadrant import QuadrantInput, QuadrantOutput, line_block_layout
from tests.hdl.parts.clocked import BAD_AXES, BAD_WIDTHS, assert_refused, run


def offer(ctx, part, block):
    ctx.set(part.blocks.valid, block is not None)
    if block is not None:
        points = (dict(zip(part.letters, point, strict=True)) for point in block)
        ctx.set(part.blocks.payload, dict(zip(("start", "end"), points, strict=True)))


def assert_prepared(ctx, part, block):
    """Compare everything prepared with the block's own arithmetic."""
    start, end = block
    lengths = [abs(e - s) for s, e in zip(start, end, strict=True)]
    in_range = max(lengths) < 2**part.width
    assert ctx.get(part.pending) == 1
    assert ctx.get(part.fault) == (ErrorCode.NONE if in_range else ErrorCode.RANGE), block
    assert [ctx.get(part.start[a]) for a in part.letters] == list(start), block
    directions = [e < s for s, e in zip(start, end, strict=True)]
    assert [ctx.get(part.negative[a]) for a in part.letters] == directions, block
    if in_range:
        assert [ctx.get(part.delta[a]) for a in part.letters] == lengths, block
        assert ctx.get(part.empty) == (not any(lengths)), block


def random_point(rng, width, axes):
    size = 2 ** int(rng.integers(width + 1))
    return tuple(rng.integers(-size, size, size=axes).tolist())


def test_line_block_layout():
    layout = line_block_layout(8, 3)
    assert list(layout.members) == ["start", "end"]
    assert layout["start"].shape == layout["end"].shape == point_layout(8, 3)
    assert layout.size == 2 * 3 * 9


def test_input_after_reset():
    part = QuadrantInput(8, 2)

    async def bench(ctx):
        ctx.set(part.blocks.payload, {"start": {"x": 1, "y": 2}, "end": {"x": 3, "y": 4}})
        for _ in range(3):
            assert ctx.get(part.pending) == 0  # nothing is taken that is not valid
            assert ctx.get(part.blocks.ready) == 1
            await ctx.tick()

    run(part, bench)


@pytest.mark.parametrize("axis", [0, 1])
def test_input_every_line_of_four_bits_a_block_a_clock(axis):
    part = QuadrantInput(4, 2)
    points = [(value, 0) if axis == 0 else (0, value) for value in range(-16, 16)]

    async def bench(ctx):
        ctx.set(part.idle, 1)
        before = None
        for block in product(points, points):
            offer(ctx, part, block)
            ctx.set(part.take, before is not None)
            assert ctx.get(part.blocks.ready) == 1
            if before is not None:
                assert_prepared(ctx, part, before)
            await ctx.tick()
            before = block
        assert_prepared(ctx, part, before)

    run(part, bench)


@pytest.mark.parametrize(("width", "axes"), [(4, 6), (8, 2), (8, 3), (32, 2), (32, 6)])
def test_input_random_lines(width, axes):
    part = QuadrantInput(width, axes)
    rng = np.random.default_rng([width, axes])
    low, high = (-(2**width),) * axes, (2**width - 1,) * axes
    blocks = [(low, high), (high, low), (low, low), (high, high)]
    blocks += [(random_point(rng, width, axes), random_point(rng, width, axes)) for _ in range(60)]
    # One axis alone just in range, or just out of it.
    for length, axis, sign in product((2**width - 1, 2**width), range(axes), (1, -1)):
        start = [-sign] * axes
        end = list(start)
        end[axis] += sign * length
        blocks.append((tuple(start), tuple(end)))

    async def bench(ctx):
        ctx.set(part.idle, 1)
        for block in blocks:
            offer(ctx, part, block)
            await ctx.tick()
            assert_prepared(ctx, part, block)
            ctx.set(part.take, 1)

    run(part, bench)


def test_input_keeps_one_block_ahead():
    part = QuadrantInput(8, 2)
    first, second = ((1, 2), (3, -4)), ((5, 6), (5, 6))

    async def bench(ctx):
        offer(ctx, part, first)
        assert ctx.get(part.blocks.ready) == 1
        await ctx.tick()
        offer(ctx, part, second)
        for _ in range(3):
            assert ctx.get(part.blocks.ready) == 0
            assert_prepared(ctx, part, first)
            await ctx.tick()
        ctx.set(part.take, 1)
        assert ctx.get(part.blocks.ready) == 0
        assert_prepared(ctx, part, first)
        await ctx.tick()
        ctx.set(part.take, 0)
        assert ctx.get(part.pending) == 0
        assert ctx.get(part.blocks.ready) == 1
        await ctx.tick()
        assert_prepared(ctx, part, second)
        offer(ctx, part, None)
        ctx.set(part.idle, 1)
        ctx.set(part.take, 1)
        await ctx.tick()
        assert ctx.get(part.pending) == 0

    run(part, bench)


@pytest.mark.parametrize("seed", range(4))
def test_input_loses_and_doubles_no_block(seed):
    part = QuadrantInput(8, 2)
    rng = np.random.default_rng(seed)
    blocks = [
        (random_point(rng, 8, 2), random_point(rng, 8, 2)) for _ in range(int(rng.integers(80, 90)))
    ]

    async def bench(ctx):
        accepted = taken = 0
        running = 0  # clocks the device is busy with the block it took
        offering = False
        for clock in range(1500):
            offering |= accepted < len(blocks) and rng.random() < (0.9, 0.4)[clock // 50 % 2]
            offer(ctx, part, blocks[accepted] if offering else None)
            ctx.set(part.idle, running == 0)
            pending = accepted > taken
            assert ctx.get(part.pending) == pending
            # In its last clock a device may take the next block, and when idle it always does.
            take = pending and (running == 0 or (running == 1 and rng.random() < 0.5))
            ctx.set(part.take, take)
            ready = ctx.get(part.blocks.ready)
            assert ready == (not pending or running == 0)
            if take:
                assert_prepared(ctx, part, blocks[taken])
                taken += 1
                running = int(rng.integers(5))
            else:
                running = max(running - 1, 0)
            if offering and ready:
                accepted += 1
                offering = False
            await ctx.tick()
        assert accepted == taken == len(blocks)

    run(part, bench)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_input_refuses_width(width, error, message):
    assert_refused((error, message), QuadrantInput, width, 2)


@pytest.mark.parametrize(("axes", "error", "message"), BAD_AXES)
def test_input_refuses_axes(axes, error, message):
    assert_refused((error, message), QuadrantInput, 8, axes)


def give(ctx, part, *, load=0, clock=0, taken=0, negative=None, carry=None):
    for name, bit in (("load", load), ("clock", clock), ("taken", taken)):
        ctx.set(getattr(part, name), bit)
    for flags, bits in ((part.negative, negative), (part.carry, carry)):
        if bits is not None:
            ctx.set(flags, dict(zip(part.letters, bits, strict=True)))


def assert_shows(ctx, part, step, *, taken):
    """Compare the waiting step, all zero for none, and what it does to the position."""
    assert [ctx.get(part.step[a]) for a in part.letters] == step
    assert ctx.get(part.waiting) == any(step)
    assert [ctx.get(part.up[a]) for a in part.letters] == [taken and s > 0 for s in step]
    assert [ctx.get(part.down[a]) for a in part.letters] == [taken and s < 0 for s in step]


def signed_step(carry, negative):
    return [c * (-1 if n else 1) for c, n in zip(carry, negative, strict=True)]


def test_output_of_every_direction_and_carry_held_until_taken():
    part = QuadrantOutput(2)
    bits = list(product((0, 1), repeat=2))

    async def bench(ctx):
        assert_shows(ctx, part, [0, 0], taken=False)  # after reset
        for negative, carry in product(bits, bits):
            give(ctx, part, load=1, negative=negative)
            await ctx.tick()
            others = [1 - n for n in negative]
            give(ctx, part, clock=1, carry=carry, negative=others)  # not loaded
            assert_shows(ctx, part, [0, 0], taken=False)
            await ctx.tick()
            for _ in range(2):
                give(ctx, part, carry=(1, 1))
                assert_shows(ctx, part, signed_step(carry, negative), taken=False)
                await ctx.tick()
            # The next block may be loaded in the clock in which the step is taken.
            give(ctx, part, load=1, taken=1, negative=others)
            assert_shows(ctx, part, signed_step(carry, negative), taken=True)
            await ctx.tick()
            give(ctx, part)
            assert_shows(ctx, part, [0, 0], taken=False)
            give(ctx, part, clock=1, carry=carry)
            await ctx.tick()
            assert_shows(ctx, part, signed_step(carry, others), taken=False)
            give(ctx, part, taken=1)
            await ctx.tick()

    run(part, bench)


@pytest.mark.parametrize("axes", range(2, 7))
def test_output_random_clocks(axes):
    part = QuadrantOutput(axes)
    rng = np.random.default_rng(axes)

    async def bench(ctx):
        directions = [0] * axes
        step = [0] * axes
        moved = 0
        for _ in range(300):
            taken = any(step) and rng.random() < 0.6
            free = taken or not any(step)
            clock = free and rng.random() < 0.8
            load = free and not clock and rng.random() < 0.5
            negative, carry = rng.integers(2, size=(2, axes)).tolist()
            give(ctx, part, load=load, clock=clock, taken=taken, negative=negative, carry=carry)
            assert_shows(ctx, part, step, taken=taken)
            moved += taken
            if clock:
                step = signed_step(carry, directions)
            elif taken:
                step = [0] * axes
            if load:
                directions = negative
            await ctx.tick()
        assert moved > 50

    run(part, bench)


@pytest.mark.parametrize(("axes", "error", "message"), BAD_AXES)
def test_output_refuses_axes(axes, error, message):
    assert_refused((error, message), QuadrantOutput, axes)
