from itertools import product

import numpy as np
import pytest

from discreta.hdl.contract import ErrorCode
from discreta.hdl.parts import ControlUnit
from tests.hdl.parts.clocked import run

INPUTS = ("pending", "fault", "empty", "waiting", "ready", "ending", "stepless")


def give(ctx, part, **inputs):
    for name in INPUTS:
        ctx.set(getattr(part, name), inputs.get(name, 0))


def get(ctx, part, names):
    return [ctx.get(getattr(part, name)) for name in names.split()]


def test_reset():
    part = ControlUnit()

    async def bench(ctx):
        give(ctx, part, ready=1, ending=1)
        for _ in range(3):
            assert get(ctx, part, "start load clock taken done busy") == [0] * 6
            assert get(ctx, part, "idle error") == [1, ErrorCode.NONE]
            await ctx.tick()

    run(part, bench)


def test_a_block_of_two_steps():
    part = ControlUnit()

    async def bench(ctx):
        give(ctx, part, pending=1)
        assert get(ctx, part, "start load clock done busy idle") == [1, 1, 0, 0, 1, 1]
        await ctx.tick()

        give(ctx, part)
        assert get(ctx, part, "start load clock done busy idle") == [0, 0, 1, 0, 1, 0]
        await ctx.tick()

        # The first step waits, and another block behind it.
        give(ctx, part, pending=1, waiting=1, ending=1)
        for _ in range(3):
            assert get(ctx, part, "start clock taken last done") == [0, 0, 0, 0, 0]
            await ctx.tick()
        give(ctx, part, pending=1, waiting=1, ready=1, ending=1)
        assert get(ctx, part, "start clock taken last done") == [0, 1, 1, 0, 0]
        await ctx.tick()

        # The last step waits, with nothing running.
        give(ctx, part, pending=1, waiting=1)
        for _ in range(3):
            assert get(ctx, part, "start clock taken last done") == [0, 0, 0, 1, 0]
            await ctx.tick()
        # It is taken, and in that very clock the block behind it is started.
        give(ctx, part, pending=1, waiting=1, ready=1)
        assert get(ctx, part, "start load clock taken last done") == [1, 1, 0, 1, 1, 0]
        await ctx.tick()

        give(ctx, part)
        assert get(ctx, part, "start clock taken done busy") == [0, 1, 0, 1, 1]
        await ctx.tick()
        assert get(ctx, part, "clock done") == [1, 0]

    run(part, bench)


def test_a_stepless_end():
    """It is answered in the next clock, once, though no step was the last one."""
    part = ControlUnit()

    async def bench(ctx):
        give(ctx, part, pending=1)
        await ctx.tick()
        # A step waits, and what ends the block waits for it.
        give(ctx, part, waiting=1, ending=1, stepless=1)
        for _ in range(3):
            assert get(ctx, part, "clock taken last done busy") == [0, 0, 0, 0, 1]
            await ctx.tick()
        give(ctx, part, waiting=1, ready=1, ending=1, stepless=1)
        assert get(ctx, part, "clock taken last done") == [1, 1, 0, 0]
        await ctx.tick()
        give(ctx, part)
        assert get(ctx, part, "clock idle done busy") == [0, 1, 1, 0]
        await ctx.tick()
        assert get(ctx, part, "clock idle done busy") == [0, 1, 0, 0]

        # A block with one alone, and another one behind it at once.
        give(ctx, part, pending=1)
        await ctx.tick()
        give(ctx, part, pending=1, ending=1, stepless=1)
        assert get(ctx, part, "start clock done") == [0, 1, 0]
        await ctx.tick()
        give(ctx, part, pending=1)
        assert get(ctx, part, "start clock done") == [1, 0, 1]
        await ctx.tick()
        # Without an end it says nothing.
        give(ctx, part, stepless=1)
        for _ in range(2):
            assert get(ctx, part, "clock done") == [1, 0]
            await ctx.tick()

    run(part, bench)


@pytest.mark.parametrize("empty", [0, 1])
@pytest.mark.parametrize("code", [ErrorCode.RANGE, ErrorCode.OFF_CURVE])
def test_a_faulty_block_is_dropped_with_an_error(code, empty):
    part = ControlUnit()

    async def bench(ctx):
        give(ctx, part, pending=1, fault=code, empty=empty)
        assert get(ctx, part, "start load done error") == [1, 0, 0, ErrorCode.NONE]
        await ctx.tick()
        give(ctx, part)
        assert get(ctx, part, "clock idle done error") == [0, 1, 0, code]
        await ctx.tick()
        assert get(ctx, part, "clock idle done error") == [0, 1, 0, ErrorCode.NONE]

    run(part, bench)


@pytest.mark.parametrize("empty", [0, 1])
def test_empty_and_faulty_blocks_take_one_clock(empty):
    part = ControlUnit()

    async def bench(ctx):
        give(ctx, part, pending=1, empty=empty, fault=0 if empty else ErrorCode.RANGE)
        for clock in range(5):
            answer = [int(clock > 0 and empty), ErrorCode(int(clock > 0 and not empty))]
            assert get(ctx, part, "start load done error") == [1, empty, *answer]
            await ctx.tick()

    run(part, bench)


def test_an_empty_block_behind_a_last_step_has_its_own_answer():
    part = ControlUnit()

    async def bench(ctx):
        give(ctx, part, pending=1)
        await ctx.tick()
        give(ctx, part, ending=1)
        await ctx.tick()
        started = done = 0
        waiting = pending = 1
        for _ in range(5):
            give(ctx, part, pending=pending, empty=1, waiting=waiting, ready=1)
            done += ctx.get(part.done)
            if ctx.get(part.start):
                started, pending = started + 1, 0
            waiting = 0
            await ctx.tick()
        assert (started, done) == (1, 2)  # the block before it was started above

    run(part, bench)


@pytest.mark.parametrize("running", [0, 1])
def test_every_input_in_every_state(running):
    part = ControlUnit()

    async def bench(ctx):
        for values in product((0, 1), repeat=len(INPUTS)):
            pending, fault, empty, waiting, ready, ending, stepless = values
            taken = waiting and ready
            give(ctx, part, ending=1)
            await ctx.tick()
            if running:
                give(ctx, part, pending=1)
                await ctx.tick()

            give(ctx, part, **dict(zip(INPUTS, values, strict=True)))
            free = not waiting or ready
            nothing_to_sum = empty or fault
            start = pending and not running and (not waiting if nothing_to_sum else free)
            load = start and not fault
            clock = running and free
            now = get(ctx, part, "start load clock taken idle busy")
            idle = not running and not waiting
            assert now == [start, load, clock, taken, idle, pending or not idle], values
            if waiting:
                assert ctx.get(part.last) == (not running), values
            await ctx.tick()

            give(ctx, part)
            runs = not empty if load else running and not (clock and ending)
            done = (taken and not running) or (load and empty)
            done = done or (clock and ending and stepless)
            error = ErrorCode.RANGE if start and fault else ErrorCode.NONE
            assert get(ctx, part, "clock done error") == [runs, done, error], values
            await ctx.tick()
            assert get(ctx, part, "done error") == [0, ErrorCode.NONE], values

    run(part, bench)


@pytest.mark.parametrize("seed", range(4))
def test_every_started_block_is_answered_once(seed):
    part = ControlUnit()
    rng = np.random.default_rng(seed)

    async def bench(ctx):
        block = None  # the prepared one: (fault, summations)
        left = 0  # summations of the running one
        waiting = False
        due_done, due_error = 0, ErrorCode.NONE
        started = answered = 0
        for clock in range(1200):
            draining = clock >= 1150
            if block is None and not draining and rng.random() < 0.7:
                block = (rng.random() < 0.2, int(rng.integers(5)))
            fault, length = block or (False, 0)
            pending, empty = block is not None, length == 0
            ready = draining or rng.random() < 0.6
            ending = left == 1
            stepless = ending and rng.random() < 0.3
            give(
                ctx,
                part,
                pending=pending,
                fault=ErrorCode(int(fault)),
                empty=empty,
                waiting=waiting,
                ready=ready,
                ending=ending,
                stepless=stepless,
            )

            # Two blocks can never share a clock of done: due_done would be 2.
            assert get(ctx, part, "done error") == [due_done, due_error]
            answered += due_done + (due_error != ErrorCode.NONE)

            start, load, clocked, taken = get(ctx, part, "start load clock taken")
            may_start = pending and left == 0 and (ready or not waiting)
            # A block with nothing to sum lets the step before it go first.
            assert start == (may_start and not (waiting and (empty or fault)))
            assert load == (start and not fault)
            assert clocked == (left > 0 and (ready or not waiting))
            assert taken == (waiting and ready)
            last_taken = taken and left == 0
            if waiting:
                assert ctx.get(part.last) == (left == 0)

            stepless_end = clocked and stepless
            due_done = int(last_taken) + int(load and empty) + int(stepless_end)
            due_error = ErrorCode.RANGE if start and fault else ErrorCode.NONE
            if clocked:
                waiting = not stepless if ending else rng.random() < 0.5
                left -= 1
            elif taken:
                waiting = False
            if start:
                started += 1
                block = None
                left = length if load else 0
            await ctx.tick()
        assert started == answered
        assert started > 100

    run(part, bench)
