"""The feed unit proven: equal to its golden model, and its promises; and what broken ones break."""

from dataclasses import dataclass

import pytest
from amaranth import Cat, Mux

from discreta.hdl.feed import FeedUnit
from discreta.sim.golden.feed import FeedUnit as Golden
from discreta.sim.golden.logic import equal, less, negate, where
from discreta.sim.proofs.feed import promises
from discreta.sim.smt import check, equivalence


def failures(obligations):
    return [verdict for verdict in map(check, obligations) if not verdict.holds]


@pytest.mark.parametrize(
    ("pauses", "pairing"),
    [
        ((256, 362), True),
        ((256, 358), False),
        ((256, 362, 443), True),
        ((256, 362, 443), False),
    ],
)
def test_the_device_is_the_golden_model(pauses, pairing):
    axes = len(pauses)
    obligations = equivalence(
        FeedUnit(axes, pauses=pauses, pairing=pairing), Golden(axes, pauses, pairing)
    )
    assert len(obligations) == 5
    assert failures(obligations) == []


@pytest.mark.parametrize("pairing", [True, False])
def test_everything_is_promised(pairing):
    obligations = promises(Golden(2, (256, 362) if pairing else (256, 358), pairing))
    assert len(obligations) == 29
    assert failures(obligations) == []


def test_the_promises_rest_on_nothing_that_cannot_be():
    """No promise holds because its assumptions contradict each other."""
    z3 = pytest.importorskip("z3")
    for obligation in promises(Golden()):
        assumptions = getattr(obligation, "assumptions", [])
        solver = z3.Solver()
        solver.add(*assumptions)
        assert solver.check() == z3.sat, obligation.title


class Unchecked(Golden):
    """A golden model with a mistake: ``mistake`` gives what it gets wrong of a step."""

    def step(self, state, inputs, tell=lambda _, value: value):
        after = super().step(state, inputs, tell)
        return after | self.mistake(state, inputs, after)

    def mistake(self, _state, _inputs, _after):
        """Get nothing wrong."""
        return {}


@dataclass(frozen=True)
class StepsAreNotPaidFor(Unchecked):
    def mistake(self, state, inputs, after):
        return {"debt": where(inputs["taken"], 0 - state["rate"], after["debt"])}


@dataclass(frozen=True)
class FractionIsLost(Unchecked):
    """A permitted step starts its pause afresh."""

    def mistake(self, state, inputs, after):
        fresh = super(Unchecked, self).step(state | {"debt": 0 * state["debt"]}, inputs)
        return {"debt": where(inputs["taken"], fresh["debt"], after["debt"])}


@dataclass(frozen=True)
class LateStepsAreMadeUpFor(Unchecked):
    """The pause goes on below 0."""

    def mistake(self, state, inputs, after):
        lower = where(less(state["debt"], -(2**47)), state["debt"], state["debt"] - state["rate"])
        waits = negate(inputs["taken"]) & less(state["debt"], 1)
        return {"debt": where(waits, lower, after["debt"])}


@dataclass(frozen=True)
class HoldForgetsThePause(Unchecked):
    def mistake(self, state, inputs, after):
        return {"debt": where(inputs["hold"] & equal(state["rate"], 0), 0, after["debt"])}


@dataclass(frozen=True)
class HoldLeavesTheTarget(Unchecked):
    def mistake(self, state, inputs, after):
        return {"target": where(inputs["hold"], state["target"], after["target"])}


@dataclass(frozen=True)
class SmallSpeedIsKeptUnderHold(Unchecked):
    """A velocity below the acceleration never comes down to a target of 0."""

    def mistake(self, state, inputs, after):
        kept = equal(state["target"], 0) & less(state["velocity"], inputs["acceleration"])
        kept = kept & inputs["active"] & less(state["braking"] >> 27, state["to_go"])
        return {name: where(kept, state[name], after[name]) for name in ("velocity", "braking")}


@dataclass(frozen=True)
class EdgeIsNotSeen(Unchecked):
    """As long as ``single`` is 1 one step follows the other."""

    def mistake(self, _state, _inputs, after):
        return {"single_before": 0 * after["single_before"]}


@dataclass(frozen=True)
class SpeedAboveOne(Unchecked):
    def mistake(self, state, _inputs, after):
        speed = (state["product"] << 25) >> state["exponent"]
        speed = speed & (2**49 - 1)
        return {"target": where(equal(after["target"], 0), 0, speed)}


@dataclass(frozen=True)
class OverrideIsNotLimited(Unchecked):
    def mistake(self, _state, inputs, after):
        product = (2**16 + inputs["feed_mantissa"]) * 300
        return {"product": where(less(299, inputs["override"]), product, after["product"])}


@dataclass(frozen=True)
class FallUsesUpTooMuch(Unchecked):
    """B goes down by the v before, not by that of now."""

    def mistake(self, state, inputs, after):
        v = state["velocity"]
        used = where(less(state["braking"], v >> 13), 0, state["braking"] - (v >> 13))
        falls = less(after["velocity"], v) & inputs["active"]
        falls = falls & negate(equal(after["velocity"], 0))
        return {"braking": where(falls, used, after["braking"])}


@dataclass(frozen=True)
class ClimbsTwice(Unchecked):
    def mistake(self, state, inputs, after):
        climbs = less(state["velocity"], after["velocity"])
        twice = after["velocity"] + inputs["acceleration"]
        return {"velocity": where(climbs, twice & (2**49 - 1), after["velocity"])}


@dataclass(frozen=True)
class BrakingTooShort(Unchecked):
    """B has room for 2^24 steps."""

    def mistake(self, _state, _inputs, after):
        return {"braking": after["braking"] & (2**59 - 1)}


@dataclass(frozen=True)
class StillWhileItFalls(Golden):
    """It is said to be still where v is not 0 yet."""

    def outputs(self, state):
        still = equal(state["target"], 0) & equal(state["rate"], 0)
        return super().outputs(state) | {"still": still}


@dataclass(frozen=True)
class RateJumps(Unchecked):
    """With a ramp, too, the rate is the target at once."""

    def mistake(self, state, inputs, after):
        return {"rate": where(inputs["active"], state["target"], after["rate"])}


@dataclass(frozen=True)
class NothingAhead(Unchecked):
    """At the end of the path nothing is left, and braking holds v at 0."""

    def mistake(self, _state, inputs, after):
        gone = inputs["taken"] & equal(after["to_go"], 256)
        return {"to_go": where(gone, 0, after["to_go"])}


@dataclass(frozen=True)
class SlowSpeedsStop(Unchecked):
    """Of the slowest speeds nothing is left after the shift."""

    def mistake(self, _state, _inputs, after):
        return {"target": after["target"] >> 12 << 12}


@dataclass(frozen=True)
class TicksArePaidForAsSteps(Unchecked):
    """A tick that moves both axes is as long as a diagonal."""

    def mistake(self, state, inputs, _after):
        uneven = inputs | {"even": 0 * inputs["even"]}
        return {"debt": super(Unchecked, self).step(state, uneven)["debt"]}


@dataclass(frozen=True)
class TicksArePathAsSteps(Unchecked):
    """The path is shorter by what a tick moves."""

    def mistake(self, state, inputs, _after):
        uneven = inputs | {"even": 0 * inputs["even"]}
        return {"to_go": super(Unchecked, self).step(state, uneven)["to_go"]}


@dataclass(frozen=True)
class CellIsKeptByTicks(Unchecked):
    """A step behind a tick is the second half of a diagonal."""

    def mistake(self, state, inputs, after):
        return {"cell": where(inputs["even"], state["cell"], after["cell"])}


@dataclass(frozen=True)
class SingleEndsWithAnEmptyTick(Unchecked):
    """A single step is used up by a tick that moves nothing."""

    def mistake(self, _state, inputs, after):
        return {"single_step": where(inputs["taken"], 0, after["single_step"])}


@dataclass(frozen=True)
class SingleNeverEnds(Unchecked):
    """A tick that moves an axis does not end a single step."""

    def mistake(self, state, inputs, after):
        kept = state["single_step"] & inputs["hold"]
        return {"single_step": where(inputs["even"], kept, after["single_step"])}


@pytest.mark.parametrize(
    ("broken", "promise"),
    [
        (TicksArePaidForAsSteps, "pause: a step leaves"),
        (TicksArePathAsSteps, "path left"),
        (CellIsKeptByTicks, "pause: a step leaves"),
        (SingleEndsWithAnEmptyTick, "single step"),
        (SingleNeverEnds, "single step"),
        (StepsAreNotPaidFor, "never too fast"),
        (StepsAreNotPaidFor, "pause: a step leaves"),
        (FractionIsLost, "never too slow"),
        (LateStepsAreMadeUpFor, "pause: without a step"),
        (HoldForgetsThePause, "hold: it loses nothing"),
        (StillWhileItFalls, "still: it stays so"),
        (HoldLeavesTheTarget, "target: 0 after"),
        (SmallSpeedIsKeptUnderHold, "hold: it ends still"),
        (EdgeIsNotSeen, "single step"),
        (SpeedAboveOne, "target: min(F·o, 1)"),
        (OverrideIsNotLimited, "target: the product"),
        (FallUsesUpTooMuch, "reversible"),
        (FallUsesUpTooMuch, "braking"),
        (ClimbsTwice, "ramp: v changes"),
        (BrakingTooShort, "no overflow"),
        (RateJumps, "ramp: the rate"),
        (NothingAhead, "invariant: survives"),
        (NothingAhead, "path left"),
        (SlowSpeedsStop, "never hangs: the target"),
    ],
)
def test_a_broken_model_breaks_a_promise(broken, promise):
    spoken_of = [it for it in promises(broken()) if it.title.startswith(promise)]
    assert len(spoken_of) == 1
    failed = failures(spoken_of)
    assert failed
    assert "gave up" not in failed[0].counterexample


def amended(change):
    """Make a device with assignments behind its own; the last one wins."""
    core = FeedUnit()
    elaborate = core.elaborate

    def broken(platform):
        m = elaborate(platform)
        change(m, core)
        return m

    core.elaborate = broken
    return core


def no_pairing(m, core):
    """The axes before are forgotten, also where both steps are one move."""
    with m.If(core.taken):
        m.d.sync += core.cell.eq(Cat(core.moves.x, core.moves.y))


def cell_kept_by_ticks(m, core):
    """The axes before a tick are remembered."""
    with m.If(core.taken & core.even):
        m.d.sync += core.cell.eq(core.cell)


def ticks_cost_as_steps(m, core):
    """A tick that moves both axes is as long as a diagonal."""
    with m.If(core.taken & core.even & core.moves.x & core.moves.y & (core.debt == 0)):
        m.d.sync += core.debt.eq((362 << 40) - core.rate)


def single_ends_with_an_empty_tick(m, core):
    """A single step is used up by whatever is taken."""
    with m.If(core.taken):
        m.d.sync += core.single_step.eq(0)


def pause_too_long(m, core):
    """A pause ends below 0, not at 0."""
    m.d.comb += core.permit.eq(core.single_step | ((core.debt < 0) & core.rate.any()))


def debt_not_limited(m, core):
    """Time in which no step was there is made up for."""
    with m.If(~core.taken & (core.debt <= 0)):
        m.d.sync += core.debt.eq(core.debt - core.rate)


def rate_a_clock_too_soon(m, core):
    """Without acceleration the rate is 0 in the clock of hold, not after it."""
    with m.If(core.hold):
        m.d.sync += core.rate.eq(0)


def late_braking(m, core):
    """The path left is taken for one longer when it is loaded."""
    with m.If(core.begins & core.ahead.any()):
        m.d.sync += core.to_go.eq((core.ahead << 8) + 1)


def begins_and_taken(m, core):
    """A step in the clock in which a block begins counts, the beginning does not."""
    with m.If(core.begins & core.taken):
        m.d.sync += core.to_go.eq(core.to_go)


def braking_kept(m, core):
    """Without a block B stays."""
    with m.If(~core.active):
        m.d.sync += core.braking.eq(core.braking)


def small_speed_kept(m, core):
    """A velocity below the acceleration never comes down to a target of 0."""
    with m.If((core.target == 0) & (core.velocity < core.acceleration) & core.active):
        m.d.sync += core.velocity.eq(core.velocity)


def single_without_hold(m, core):
    """A rising edge permits a step without hold, too."""
    with m.If(core.single & ~core.single_before):
        m.d.sync += core.single_step.eq(1)


def override_cut(m, core):
    """An override of 256 is taken for 255."""
    with m.If((core.override == 256) & core.active):
        m.d.sync += core.product.eq((core.feed.mantissa + (1 << 16)) * 255)


def still_too_soon(m, core):
    """It is still while the velocity has not come down."""
    m.d.comb += core.still.eq(~core.target.any() & ~core.rate.any())


def late_failure(m, core):
    """At the one speed of 2^-48 the debt grows."""
    with m.If((core.rate == 1) & ~core.taken & (core.debt > 0)):
        m.d.sync += core.debt.eq(Mux(core.debt > 2, core.debt, core.debt - 1))


@pytest.mark.parametrize(
    ("change", "seen_by"),
    [
        (no_pairing, "every register"),
        (cell_kept_by_ticks, "every register"),
        (ticks_cost_as_steps, "every register"),
        (single_ends_with_an_empty_tick, "every register"),
        (pause_too_long, "every output"),
        (debt_not_limited, "every register"),
        (rate_a_clock_too_soon, "every register"),
        (late_braking, "every register"),
        (begins_and_taken, "every register"),
        (braking_kept, "every register"),
        (small_speed_kept, "every register"),
        (single_without_hold, "every register"),
        (override_cut, "every register"),
        (still_too_soon, "every output"),
        (late_failure, "every register"),
    ],
)
def test_a_broken_device_is_not_the_golden_model(change, seen_by):
    obligations = equivalence(amended(change), Golden())
    failed = failures(it for it in obligations if seen_by in it.title)
    assert len(failed) == 1
    assert "gave up" not in failed[0].counterexample
