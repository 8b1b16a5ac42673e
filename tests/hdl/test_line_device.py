# amaranth: UnusedElaboratable=no
# (A part that refuses its parameters cannot be simulated.)
"""The device for lines alone, judged by its pins: the article's steps, at the block's own rate."""

from itertools import pairwise

import numpy as np
import pytest
from amaranth.hdl import Fragment

from discreta.hdl.line_device import PERIOD_BITS, LineDevice
from discreta.hdl.plain import PlainPorts
from discreta.hdl.queue import StopReason
from tests.hdl.parts.clocked import BAD_WIDTHS, assert_refused, run
from tests.lines import article

WIDTH, TIMING = 6, 3
REASONS = {name: reason.value for name, reason in StopReason.__members__.items()}


class Machine:
    """A device, driven clock by clock, and what its pins say of where the machine is."""

    def __init__(self, ctx, top):
        self.ctx, self.top = ctx, top
        self.clock, self.place, self.pins = 0, [0, 0], None
        self.steps: list[tuple[int, ...]] = []
        self.done: list[int] = []
        self.reasons: list[int] = []
        self.acceptances: list[int] = []

    def get(self, name):
        return self.ctx.get(self.top.outputs[name])

    def set(self, **inputs):
        for name, value in inputs.items():
            self.ctx.set(self.top.inputs[name], value)

    async def tick(self, clocks=1):
        for _ in range(clocks):
            before, self.pins = self.pins, {a: self.get(f"pins_{a}_step") for a in "xy"}
            moved = [int(bool(before and self.pins[a] > before[a])) for a in "xy"]
            if any(moved):
                for axis, a in enumerate("xy"):
                    self.place[axis] += moved[axis] * (1 - 2 * self.get(f"pins_{a}_direction"))
                self.steps.append((self.clock, *self.place))
            # The device counts what the pins show, always.
            assert [self.get("position_x"), self.get("position_y")] == self.place
            self.done += [self.clock] * self.get("done")
            self.reasons.append(self.get("reason"))
            await self.ctx.tick()
            self.clock += 1

    async def offer(self, x, y, period, limit=3000):
        self.set(blocks_end_x=x, blocks_end_y=y, blocks_period=period, blocks_valid=1)
        for _ in range(limit):
            ready = self.get("blocks_ready")
            await self.tick()
            if ready:
                self.acceptances.append(self.clock - 1)
                # What is on the wires after that is nobody's block.
                self.set(blocks_valid=0, blocks_end_x=1, blocks_end_y=1, blocks_period=1)
                return
        raise AssertionError("no block is taken")

    async def rest(self, limit=3000):
        for _ in range(limit):
            await self.tick()
            if not self.get("busy"):
                return
        raise AssertionError("it goes on for ever")


def on(bench, width=WIDTH, timing=TIMING):
    top = PlainPorts(LineDevice(width, timing=timing))

    async def whole(ctx):
        await bench(Machine(ctx, top))

    run(top, whole)


def points(start, end):
    """Give where the article's routine goes, x first at 45°."""
    lengths = [abs(b - a) for a, b in zip(start, end, strict=True)]
    return [(x, y) for x, y, *_ in article((*start, *end), x_leads=lengths[0] >= lengths[1])][1:]


@pytest.mark.parametrize("seed", range(3))
def test_lines_one_behind_the_other_are_the_articles(seed):
    random = np.random.default_rng(seed)
    ends = [tuple(map(int, random.integers(-25, 26, 2))) for _ in range(12)]
    ends[4] = ends[3]  # no length

    async def bench(machine):
        wanted, place = [], (0, 0)
        for end in ends:
            await machine.offer(*end, int(random.integers(30)))
            wanted += points(place, end)
            place = end
            if random.random() < 0.3:
                await machine.rest()
                await machine.tick(int(random.integers(20)))
        await machine.rest()
        assert [step[1:] for step in machine.steps] == wanted
        assert len(machine.done) == len(ends)
        assert set(machine.reasons) == {0}

    on(bench)


@pytest.mark.parametrize(
    ("end", "period", "clocks"), [((20, 0), 40, 41), ((9, 9), 40, 41), ((0, -20), 0, 2 * TIMING)]
)
def test_the_rate_of_the_steps(end, period, clocks):
    async def bench(machine):
        await machine.offer(*end, period)
        await machine.rest()
        moments = [clock for clock, *_ in machine.steps]
        # The first direction and its set-up aside.
        assert {b - a for a, b in list(pairwise(moments))[2:]} == {clocks}

    on(bench)


def test_the_slowest_rate():
    async def bench(machine):
        await machine.offer(2, 0, 2**PERIOD_BITS - 1)
        for _ in range(40):
            await machine.tick()
        assert len(machine.steps) == 1
        assert machine.get("busy") == 1

    on(bench)


def test_the_next_block_waits_for_the_last_pulse():
    async def bench(machine):
        for end in ((5, 3), (0, 0), (4, -4)):
            await machine.offer(*end, 8)
        await machine.rest()
        first_of = {
            at: next(clock for clock, *_ in machine.steps if clock > at)
            for at in machine.acceptances
        }
        for at in machine.acceptances[1:]:
            last = max(clock for clock, *_ in machine.steps if clock < at)
            # Busy ends a clock before the space does.
            assert last + 2 * TIMING - 1 <= at < first_of[at] <= at + 9 + 2 * TIMING

    on(bench)


def test_hold_keeps_back_and_loses_nothing():
    async def bench(machine):
        await machine.offer(20, 12, 10)
        await machine.tick(100)
        machine.set(hold=1)
        await machine.tick(1 + 2 * TIMING)
        held = len(machine.steps)
        await machine.tick(100)
        assert 2 < len(machine.steps) == held < 32
        machine.set(hold=0)
        await machine.rest()
        assert [step[1:] for step in machine.steps] == points((0, 0), (20, 12))

    on(bench)


@pytest.mark.parametrize("name", ["stop", "emergency"])
@pytest.mark.parametrize("after", range(60, 72))
def test_stops_at_once_and_goes_on_from_there(name, after):
    reason = REASONS[name.upper()]

    async def bench(machine):
        await machine.offer(20, -12, 10)
        await machine.tick(after)
        machine.set(**{name: 1})
        at = machine.clock
        await machine.tick()
        machine.set(**{name: 0})
        await machine.tick(60)
        assert machine.reasons[at + 1 :] == [reason] * 60
        assert max(clock for clock, *_ in machine.steps) <= at + 1
        assert (machine.get("busy"), machine.get("blocks_ready"), machine.done) == (0, 0, [])
        # Where it is given it cannot be cleared; then it can, and works from where it stands.
        if name == "emergency":
            machine.set(emergency=1, clear=1)
            await machine.tick(5)
            assert machine.get("reason") == reason
            machine.set(emergency=0)
        machine.set(clear=1)
        await machine.tick()
        machine.set(clear=0)
        count, place = len(machine.steps), tuple(machine.place)
        await machine.offer(3, 4, 0)
        await machine.rest()
        assert [step[1:] for step in machine.steps[count:]] == points(place, (3, 4))

    on(bench)


def test_nothing_is_cleared_under_a_pulse():
    async def bench(machine):
        await machine.offer(9, 0, 30)
        while not machine.steps:
            await machine.tick()
        machine.set(emergency=1)
        await machine.tick()
        machine.set(emergency=0, clear=1)
        at = machine.clock
        await machine.tick(20)
        # The leading edge was a clock before; the pulse and the space behind it last on.
        assert machine.reasons[at:].index(0) >= 9

    on(bench, timing=6)


LIMITS = {
    "high_limit_x": (12, 3),
    "low_limit_x": (-12, 3),
    "high_limit_y": (3, 12),
    "low_limit_y": (3, -12),
}


@pytest.mark.parametrize(("switch", "end"), LIMITS.items())
def test_no_step_towards_a_limit_switch(switch, end):
    async def bench(machine):
        await machine.offer(*end, 10)
        await machine.tick(80)
        machine.set(**{switch: 1})
        at = machine.clock
        await machine.tick(60)
        assert machine.get("reason") == REASONS["LIMIT"]
        # A step along the other axis may still leave.
        axis = "xy".index(switch[-1])
        after = [step for step in machine.steps if step[0] > at + 1]
        before = [step for step in machine.steps if step[0] <= at + 1]
        assert {step[1 + axis] for step in after} <= {before[-1][1 + axis]}
        machine.set(clear=1)
        await machine.tick()
        machine.set(clear=0)
        await machine.offer(0, 0, 0)
        await machine.rest()
        assert (machine.place, machine.get("reason")) == ([0, 0], 0)

    on(bench)


@pytest.mark.parametrize("contact", [1, 2, 3])
def test_a_step_that_a_switch_has_held_never_leaves(contact):
    """However short its contact is, at whatever time of the period."""
    hit = []

    async def bench(machine):
        for phase in range(12):
            await machine.offer(40, 0, 10)
            await machine.tick(60 + phase)
            at = machine.clock
            machine.set(high_limit_x=1)
            await machine.tick(contact)
            machine.set(high_limit_x=0)
            await machine.tick(30)
            hit.append(machine.get("reason") == REASONS["LIMIT"])
            assert (machine.steps[-1][0] <= at + 1) == hit[-1]
            if not hit[-1]:
                machine.set(stop=1)
                await machine.tick()
                machine.set(stop=0)
                await machine.tick(20)
            machine.set(clear=1)
            await machine.tick()
            machine.set(clear=0)
            await machine.offer(0, 0, 0)
            await machine.rest()

    on(bench)
    assert {*hit} == {False, True}


def test_a_line_that_is_too_long_is_refused():
    async def bench(machine):
        await machine.offer(-60, 0, 0)
        await machine.rest()
        await machine.offer(60, 0, 0)
        await machine.tick(20)
        assert machine.get("reason") == REASONS["RANGE"]
        assert machine.place == [-60, 0]

    on(bench)


def test_registers_are_those_of_its_parts():
    core = LineDevice(WIDTH)
    Fragment.get(core, None)  # else Amaranth complains that its parts are not used
    inside = {id(it) for part in (core.pulse, core.line) for it in part.registers.values()}
    own = {name for name, it in core.registers.items() if id(it) not in inside}
    assert own == {"period", "pause", "reason"}
    assert len(core.registers) == len(inside) + 3
    assert sum(map(len, core.diagram.values())) == len(core.registers)
    assert core.parameters == {"width": WIDTH, "timing": 60}


def test_refuses_other_parameters():
    for width, error, message in BAD_WIDTHS:
        assert_refused((error, message), LineDevice, width)
    message = "timing is 0: choose a whole number from 1 to 4095"
    assert_refused((ValueError, message), LineDevice, timing=0)
    message = "timing must be a whole number from 1 to 4095, not 1.5"
    assert_refused((TypeError, message), LineDevice, timing=1.5)
