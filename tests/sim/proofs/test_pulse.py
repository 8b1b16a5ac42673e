"""The pulse unit is its golden model and keeps its promises; a broken one is caught by both."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
from amaranth import Cat, Module, Mux, Signal

from discreta.hdl.pulse import PulseUnit
from discreta.sim.golden.logic import equal, less, negate, where
from discreta.sim.golden.pulse import FOREVER
from discreta.sim.golden.pulse import PulseUnit as GoldenPulseUnit
from discreta.sim.proofs.pulse import promises
from discreta.sim.smt import check, equivalence

INVERTED: dict[str, Any] = {"inverted_steps": "x", "inverted_directions": "y"}


@pytest.mark.parametrize(("width", "kind"), [(4, "step_direction"), (8, "quadrature")])
def test_everything_is_proven(width, kind):
    golden = GoldenPulseUnit(width, 2, kind, **INVERTED)
    unit = PulseUnit(width, kind=kind, **INVERTED)
    verdicts = [check(it) for it in equivalence(unit, golden) + promises(golden)]
    assert len(verdicts) == (20 if kind == "step_direction" else 17)
    assert [verdict for verdict in verdicts if not verdict.holds] == []


@pytest.mark.parametrize("kind", ["step_direction", "quadrature"])
@pytest.mark.parametrize("axes", [2, 3])
def test_it_is_the_golden_model(kind, axes):
    """Of 16 bits, in more than two axes as well."""
    options: dict[str, Any] = {"inverted_steps": "yx", "inverted_directions": "x"}
    unit = PulseUnit(16, axes, kind=kind, **options)
    claims = equivalence(unit, GoldenPulseUnit(16, axes, kind, **options))
    assert [verdict for verdict in map(check, claims) if not verdict.holds] == []


@dataclass(frozen=True)
class Variant:
    """A broken unit, its golden model with the same mistake, and the promise that this breaks."""

    name: str
    break_it: Callable[[PulseUnit, Module], None]
    golden: type[GoldenPulseUnit]
    promise: str
    kind: str

    def device(self) -> PulseUnit:
        unit = PulseUnit(4, kind=self.kind, **INVERTED)
        elaborate = unit.elaborate

        def amended(platform):
            m = elaborate(platform)
            self.break_it(unit, m)
            return m

        unit.elaborate = amended
        return unit


VARIANTS: list[Variant] = []


def variant(
    promise: str, golden: type[GoldenPulseUnit], kind: str = "step_direction"
) -> Callable[[Callable[[PulseUnit, Module], None]], None]:
    """List a function that adds assignments behind the sound ones."""

    def add(break_it: Callable[[PulseUnit, Module], None]) -> None:
        VARIANTS.append(Variant(break_it.__name__, break_it, golden, promise, kind))

    return add


def leads(unit: PulseUnit, a: str) -> Any:
    """Tell that a pulse of an axis is launched."""
    return unit.launch & unit.moves[a]


def free(unit: PulseUnit) -> Any:
    """Tell that the step that waits may turn its axes."""
    waits = Cat(unit.moves.values()).any() & ~unit.stopping
    return waits & ~unit.blocked & ~unit.limited


class Short(GoldenPulseUnit):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        over = negate(less(state["age_x"] + 1, state["length"])) & state["pulse_x"]
        return after | {
            "pulse_x": where(over, 0, after["pulse_x"]),
            "age_x": where(over, 1, after["age_x"]),
        }


@variant("length", Short)
def pulse_a_clock_short(unit, m):
    with m.If(unit.pulse["x"] & (unit.age["x"] + 1 >= unit.length)):
        m.d.sync += [unit.pulse["x"].eq(0), unit.age["x"].eq(1)]


class NoSpace(GoldenPulseUnit):
    def _rested(self, state, a):
        return negate(state[f"pulse_{a}"])


def rested(unit: PulseUnit, m: Module, by_axis: dict[str, Any]) -> None:
    """Replace what tells that an axis has its space behind it."""
    for a, rested in by_axis.items():
        right = unit.direction[a] == unit.pending[a][1]
        m.d.comb += unit.due[a].eq(rested & right & (unit.direction_age[a] >= unit.setup))
    resting = Cat(by_axis.values()).all()
    m.d.comb += unit.busy.eq(Cat(unit.moves.values()).any() | ~resting)


@variant("space", NoSpace)
def space_ignored(unit, m):
    rested(unit, m, {a: ~unit.pulse[a] for a in "xy"})


@variant("space", NoSpace, "quadrature")
def space_of_quadrature_ignored(unit, m):
    rested(unit, m, {a: ~unit.pulse[a] for a in "xy"})


class JustInTime(GoldenPulseUnit):
    def _rested(self, state, a):
        return negate(state[f"pulse_{a}"]) & equal(state[f"age_{a}"], state["space"])


@variant("it never hangs", JustInTime)
def space_to_the_very_clock(unit, m):
    rested(unit, m, {a: ~unit.pulse[a] & (unit.age[a] == unit.space) for a in "xy"})


class NoHold(GoldenPulseUnit):
    def step(self, state, inputs):
        return super().step(state | {"hold": 0 * state["hold"]}, inputs) | {
            "hold": super().step(state, inputs)["hold"]
        }


@variant("hold", NoHold)
def hold_ignored(unit, m):
    for a in "xy":
        wrong = unit.direction[a] != unit.pending[a][1]
        m.d.comb += unit.turn[a].eq(free(unit) & unit.moves[a] & wrong & ~unit.pulse[a])


class TurnsWhenLimited(GoldenPulseUnit):
    def step(self, state, inputs):
        switches = [f"at_{end}_{a}" for end in ("low", "high") for a in "xy"]
        off = dict.fromkeys((*switches, "limited"), 0 * state["limited"])
        turned = super().step(state | off, inputs)
        names = [f"{name}_{a}" for name in ("direction", "direction_age") for a in "xy"]
        return super().step(state, inputs) | {name: turned[name] for name in names}


@variant("turn", TurnsWhenLimited)
def turns_when_limited(unit, m):
    for a in "xy":
        wrong = unit.direction[a] != unit.pending[a][1]
        may = ~unit.stopping & ~unit.pulse[a] & (unit.age[a] >= unit.hold)
        m.d.comb += unit.turn[a].eq(may & unit.moves[a] & wrong)


class NoSetup(GoldenPulseUnit):
    def _launch(self, state):
        return super()._launch(state | {"setup": 0 * state["setup"]})


@variant("set-up", NoSetup)
def setup_ignored(unit, m):
    for a in "xy":
        right = unit.direction[a] == unit.pending[a][1]
        m.d.comb += unit.due[a].eq(~unit.pulse[a] & (unit.age[a] >= unit.space) & right)


class Overrun(GoldenPulseUnit):
    def outputs(self, state):
        return super().outputs(state) | {"steps_ready": negate(state["stopping"])}


@variant("steps", Overrun)
def step_taken_over_one_that_waits(unit, m):
    m.d.comb += unit.steps.ready.eq(~unit.stopping)
    waits = Cat(unit.moves.values()).any() & ~unit.launch
    for a in "xy":
        with m.If(waits & ~unit.stopping & ~unit.steps.valid):
            m.d.sync += unit.pending[a].eq(unit.pending[a])


class LimitedInPart(GoldenPulseUnit):
    def _moves(self, state, a):
        switch = where(self._downwards(state, a), state[f"at_low_{a}"], state[f"at_high_{a}"])
        return super()._moves(state, a) & negate(switch)


@variant("steps", LimitedInPart)
def diagonal_step_put_out_in_part(unit, m):
    for a in "xy":
        switch = Mux(unit.pending[a][1], unit.at_low[a], unit.at_high[a])
        m.d.comb += unit.moves[a].eq(unit.pending[a][0] & ~switch)


class CountsUpwards(GoldenPulseUnit):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        rises = self._launch(state) & self._moves(state, "y")
        up = self._wrap(state["position_y"] + rises)
        return after | {"position_y": where(inputs["load"], inputs["initial_y"], up)}


@variant("position", CountsUpwards)
def position_counts_upwards_alone(unit, m):
    m.d.comb += [unit.place["y"].up.eq(leads(unit, "y")), unit.place["y"].down.eq(0)]


class LateStop(GoldenPulseUnit):
    def _launch(self, state):
        return super()._launch(state | {"stopping": 0 * state["stopping"]})


@variant("stop", LateStop)
def stop_a_clock_late(unit, m):
    waiting = Cat(unit.moves.values()).any()
    due = Cat(~unit.moves[a] | unit.due[a] for a in "xy").all()
    m.d.comb += unit.launch.eq(waiting & ~unit.blocked & ~unit.limited & due)


class OneSwitch(GoldenPulseUnit):
    def _blocked(self, state):
        return super()._blocked(state | {"at_high_y": 0 * state["at_high_y"]})


@variant("limit:", OneSwitch)
def switch_not_connected(unit, m):
    x, y = (unit.moves[a] & unit.pending[a][1] & unit.at_low[a] for a in "xy")
    x |= unit.moves["x"] & ~unit.pending["x"][1] & unit.at_high["x"]
    m.d.comb += unit.blocked.eq(x | y)


class StoppedIsLimited(GoldenPulseUnit):
    def step(self, state, inputs):
        return super().step(state, inputs) | {"limited": self._blocked(state)}


@variant("limited", StoppedIsLimited)
def limited_though_it_is_stopped(unit, m):
    m.d.sync += unit.limited_register.eq(unit.blocked)


class GoesOnAtOnce(GoldenPulseUnit):
    def _free(self, state):
        return super()._free(state | {"limited": 0 * state["limited"]})


@variant("limited: while", GoesOnAtOnce)
def goes_on_in_the_clock_of_the_release(unit, m):
    waits = Cat(unit.moves.values()).any() & ~unit.stopping & ~unit.blocked
    m.d.comb += unit.launch.eq(waits & Cat(~unit.moves[a] | unit.due[a] for a in "xy").all())
    for a in "xy":
        wrong = unit.direction[a] != unit.pending[a][1]
        may = waits & ~unit.pulse[a] & (unit.age[a] >= unit.hold)
        m.d.comb += unit.turn[a].eq(may & unit.moves[a] & wrong)


class NewLength(GoldenPulseUnit):
    def step(self, state, inputs):
        return super().step(state, inputs) | {"length": inputs["pulse_length"]}


@variant("invariant: survives", NewLength)
def timing_taken_over_at_any_time(unit, m):
    m.d.sync += unit.length.eq(unit.pulse_length)


class ShortMemory(GoldenPulseUnit):
    def _older(self, age):
        return (age + 1) & FOREVER


@variant("invariant: survives", ShortMemory)
def ages_wrap(unit, m):
    for a in "xy":
        with m.If(unit.age[a].all() & ~leads(unit, a) & ~unit.pulse[a]):
            m.d.sync += unit.age[a].eq(0)
        with m.If(unit.direction_age[a].all() & ~unit.turn[a]):
            m.d.sync += unit.direction_age[a].eq(0)


class IdleTooSoon(GoldenPulseUnit):
    def _busy(self, state):
        return self._waiting(state) | state["pulse_x"] | state["pulse_y"]


@variant("busy", IdleTooSoon)
def not_busy_in_the_space(unit, m):
    m.d.comb += unit.busy.eq(Cat(unit.moves.values(), unit.pulse.values()).any())


class ActiveHigh(GoldenPulseUnit):
    def outputs(self, state):
        return super().outputs(state) | {"pins_x_step": state["pulse_x"]}


@variant("invariant: holds after reset", ActiveHigh)
def pin_active_high(unit, m):
    m.d.comb += unit.pins.x.step.eq(unit.pulse["x"])


class BinaryPhase(GoldenPulseUnit):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        rises = self._launch(state) & self._moves(state, "x")
        change = where(self._downwards(state, "x"), -1, 1)
        phase = state["phase_x"]
        return after | {"phase_x": where(rises, (phase + change) & 3, phase)}


@variant("quadrature", BinaryPhase, "quadrature")
def phase_in_binary(unit, m):
    with m.If(leads(unit, "x")):
        change = Mux(unit.pending["x"][1], -1, 1)
        m.d.sync += unit.phase["x"].eq(unit.phase["x"] + change)


class ForwardsPhase(GoldenPulseUnit):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        phase, rises = state["phase_y"], self._launch(state) & self._moves(state, "y")
        up = negate(phase >> 1) | ((phase & 1) << 1)
        return after | {"phase_y": where(rises, up, phase)}


@variant("quadrature", ForwardsPhase, "quadrature")
def phase_goes_on_both_ways(unit, m):
    with m.If(leads(unit, "y")):
        first, second = unit.phase["y"]
        m.d.sync += unit.phase["y"].eq(Cat(~second, first))


def unequal(unit, golden):
    """Tell whether an obligation of the equality is broken."""
    return any(not check(obligation).holds for obligation in equivalence(unit, golden))


@pytest.mark.parametrize("broken", VARIANTS, ids=lambda broken: broken.name)
def test_a_broken_unit_is_caught(broken):
    """It is not the golden model; one with the same mistake breaks its promise."""
    assert unequal(broken.device(), GoldenPulseUnit(4, 2, broken.kind, **INVERTED))
    golden = broken.golden(4, 2, broken.kind, **INVERTED)
    assert not unequal(broken.device(), golden)
    meant = [it for it in promises(golden) if it.title.startswith(broken.promise)]
    failed = [verdict for verdict in map(check, meant) if not verdict.holds]
    assert failed
    assert all(verdict.counterexample for verdict in failed)


def test_a_register_that_is_not_reset_is_caught():
    unit = PulseUnit(4)
    fresh = Signal.like(unit.pulse["x"], name="pulse_x", reset_less=True)
    unit.registers["pulse_x"] = unit.pulse["x"] = fresh
    failed = [it for it in map(check, equivalence(unit, GoldenPulseUnit(4))) if not it.holds]
    assert [verdict.title.partition(":")[0] for verdict in failed] == ["reset"]
