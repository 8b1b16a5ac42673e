"""The device is its golden model and keeps its promises; a broken one breaks a promise."""

import inspect
from dataclasses import dataclass, replace

import pytest

from discreta.hdl.circular import Circular
from discreta.hdl.conic import Conic
from discreta.hdl.constant_speed import constant_arc, constant_line
from discreta.hdl.device import Device, exact_device
from discreta.hdl.exact_conic import ExactConic
from discreta.hdl.feed import PAUSES
from discreta.hdl.linear import Linear
from discreta.sim.golden import constant_speed as golden_models
from discreta.sim.golden.circular import Circular as GoldenCircular
from discreta.sim.golden.conic import Conic as GoldenConic
from discreta.sim.golden.device import EMERGENCY, LIMIT, make_device
from discreta.sim.golden.device import Device as GoldenDevice
from discreta.sim.golden.feed import FeedUnit
from discreta.sim.golden.linear import Linear as GoldenLinear
from discreta.sim.golden.logic import equal, negate, where
from discreta.sim.golden.pulse import PulseUnit
from discreta.sim.golden.queue import CODES
from discreta.sim.golden.queue import BlockQueue as GoldenQueue
from discreta.sim.proofs.device import promises
from discreta.sim.proofs.queue import promises as queue_promises
from discreta.sim.smt import check, equivalence

#: Hook of the golden models that changes nothing.
KEEP = inspect.signature(GoldenDevice.step).parameters["tell"].default

PARTS = {"line": constant_line, "arc": constant_arc, "conic": ExactConic}
LECTURE = {"line": (Linear, GoldenLinear), "arc": (Circular, GoldenCircular)}
LECTURE |= {"conic": (Conic, GoldenConic)}


# All three kinds of 8 bits take 17 s: `discreta prove device` takes what is asked for.
@pytest.mark.parametrize(
    ("width", "kinds", "choices"),
    [
        (8, ("line",), {"pins": "quadrature", "pairing": False}),
        (16, ("line", "arc"), {}),
        (4, ("conic",), {}),
    ],
    ids=str,
)
def test_it_is_the_golden_model(width, kinds, choices):
    device = Device(**{kind: PARTS[kind](width) for kind in kinds}, depth=1, **choices)
    claims = equivalence(device, make_device(width, kinds, **choices))
    assert len(claims) == 5
    assert [verdict for verdict in map(check, claims) if not verdict.holds] == []


@pytest.mark.parametrize(("width", "kinds"), [(16, ("line", "arc")), (4, ("conic",))], ids=str)
def test_it_is_the_golden_model_with_the_lectures_interpolators(width, kinds):
    device = Device(**{kind: LECTURE[kind][0](width) for kind in kinds}, depth=1)
    models = tuple((kind, LECTURE[kind][1](width)) for kind in kinds)
    golden = GoldenDevice(models, FeedUnit(), PulseUnit(width))
    claims = equivalence(device, golden)
    assert len(claims) == 5
    assert [verdict for verdict in map(check, claims) if not verdict.holds] == []


def test_it_is_the_golden_model_of_three_axes():
    """Lines in space, arcs with an axis along them."""
    models = (
        ("line", golden_models.constant_line(6, 3)),
        ("arc", golden_models.constant_arc(6, 3)),
    )
    golden = GoldenDevice(models, FeedUnit(3, PAUSES[:3]), PulseUnit(6, 3))
    claims = equivalence(exact_device(6, 3, ("line", "arc"), depth=1), golden)
    assert [verdict for verdict in map(check, claims) if not verdict.holds] == []


@pytest.mark.parametrize(
    ("width", "kinds", "pins"),
    [
        (4, ("line",), "step_direction"),
        (8, ("line", "arc"), "quadrature"),
        (16, ("line", "arc", "conic"), "step_direction"),
    ],
    ids=str,
)
def test_everything_is_promised(width, kinds, pins):
    golden = make_device(width, kinds, pins)
    verdicts = [check(promise) for promise in promises(golden)]
    assert len(verdicts) == 14 + 12
    assert [verdict for verdict in verdicts if not verdict.holds] == []


def test_the_queue_of_three_axes():
    kinds = ("line", "arc")
    verdicts = [check(promise) for promise in queue_promises(GoldenQueue(8, 3, kinds, kinds))]
    assert [verdict for verdict in verdicts if not verdict.holds] == []


def assert_broken(promised, name):
    """Check that some promise of that name is broken, with values that show it."""
    verdicts = [check(promise) for promise in promised if promise.title.startswith(name)]
    assert any(not verdict.holds and verdict.counterexample for verdict in verdicts), name


# Broken queues.


@dataclass(frozen=True)
class AnsweredTwice(GoldenQueue):
    """`done` after a last step is taken for the answer of the next block."""

    def _answer(self, state, inputs, kind):
        return super()._answer(state | {f"{kind}_ended": 0 * state["head"]}, inputs, kind)


@dataclass(frozen=True)
class PlaceKept(GoldenQueue):
    """The next block starts where the last one started."""

    def step(self, state, inputs):
        after = super().step(state, inputs)
        return after | {"place_x": where(inputs["flush"], after["place_x"], state["place_x"])}


@dataclass(frozen=True)
class BeginsTooEarly(GoldenQueue):
    """The next block begins while the current one has steps to go."""

    def outputs(self, state, inputs):
        out = super().outputs(state, inputs)
        return out | {"begins": state["next"] & equal(out["refusal"], 0)}


@dataclass(frozen=True)
class PermitIgnored(GoldenQueue):
    """Steps leave under a flush."""

    def outputs(self, state, inputs):
        out = super().outputs(state, inputs)
        loose = super().outputs(state, inputs | {"flush": 0 * inputs["flush"]})
        steps = ("steps_valid", "taken", *(f"{kind}_steps_ready" for kind in self.kinds))
        return out | {name: loose[name] for name in steps}


@dataclass(frozen=True)
class NextSurvives(GoldenQueue):
    """The next block survives a flush."""

    def step(self, state, inputs):
        after = super().step(state, inputs)
        return after | {"next": where(inputs["flush"], state["next"], after["next"])}


@dataclass(frozen=True)
class WrongKind(GoldenQueue):
    """Arcs go to the interpolator of lines."""

    def outputs(self, state, inputs):
        out = super().outputs(state, inputs)
        both = out["line_blocks_valid"] | out["arc_blocks_valid"]
        return out | {"line_blocks_valid": both, "arc_blocks_valid": 0 * both}


@dataclass(frozen=True)
class RunsBehindARefusal(GoldenQueue):
    """The block behind a refused one begins."""

    def outputs(self, state, inputs):
        out = super().outputs(state, inputs)
        refused = negate(equal(out["refusal"], 0))
        return out | {"begins": out["begins"] | (state["next"] & refused)}


@dataclass(frozen=True)
class HeadLost(GoldenQueue):
    """A block that is accepted takes the place of the one that waits."""

    def outputs(self, state, inputs):
        out = super().outputs(state, inputs)
        return out | {"blocks_ready": negate(inputs["flush"])}


@pytest.mark.parametrize(
    ("broken", "promise"),
    [
        (AnsweredTwice, "ends"),
        (PlaceKept, "invariant: survives"),
        (BeginsTooEarly, "begins"),
        (PermitIgnored, "steps"),
        (NextSurvives, "flush"),
        (WrongKind, "handed over"),
        (RunsBehindARefusal, "refused"),
        (HeadLost, "accepted"),
    ],
)
def test_a_broken_queue_breaks_a_promise(broken, promise):
    golden = broken(4, 2, tuple(CODES)[:2])
    assert_broken(queue_promises(golden), promise)


# Broken devices.


class Broken(GoldenDevice):
    """A device that sees something else than there is, or goes on to something else."""

    def seen(self, now):
        """Give registers and inputs as it sees them."""
        return now

    def changed(self, now, after):
        """Give the registers after a clock."""
        del now  # what it works from, if it does something wrong
        return after

    def step(self, state, inputs, tell=KEEP):
        now = self.seen(state | inputs)
        after = super().step(
            {name: now[name] for name in state}, {name: now[name] for name in inputs}, tell
        )
        return after | self.changed(now, after)


class ClearedTooSoon(Broken):
    """`clear` goes before the emergency."""

    def changed(self, now, after):
        clear = now["clear"] & negate(equal(now["reason"], 0))
        return {"reason": where(clear, 0, after["reason"])}


class PendingPutOut(Broken):
    """The pulse unit is not told of the emergency."""

    def changed(self, now, after):
        stops = negate(equal(now["reason"], 0)) & equal(now["reason"], EMERGENCY)
        return {"stopping": after["stopping"] & stops}


class HoldIgnored(Broken):
    """`hold` does not come to the feed unit."""

    def seen(self, now):
        return now | {"hold": 0 * now["hold"]}


class StopForgotten(Broken):
    """`stop` counts only while it is given."""

    def changed(self, now, after):
        return {"stop_asked": now["stop"] & after["stop_asked"]}


class StopsUnderAStep(Broken):
    """It says that it stands though a single step leaves in this very clock."""

    def changed(self, now, after):
        pulse = self.pulse.outputs(self.pulse_state(now))
        still = self.feed.outputs(now)["still"] & negate(pulse["busy"])
        stops = now["stop_asked"] & still & equal(after["reason"], 0)
        return {"reason": where(stops & equal(now["reason"], 0), 1, after["reason"])}


class StepLost(Broken):
    """The position misses a step upwards."""

    def changed(self, now, after):
        risen = equal(after["position_x"], now["position_x"] + 1)
        return {"position_x": where(risen, now["position_x"], after["position_x"])}


class InterpolatorKept(Broken):
    """An interpolator keeps its step while the device stands."""

    def changed(self, now, after):
        stands = negate(equal(now["reason"], 0))
        kept = where(stands, now["line_pulse_x"], after["line_pulse_x"])
        return {"line_pulse_x": kept}


class LimitedPutOut(Broken):
    """The pulse unit is told of a limit only when the device stands for it."""

    def changed(self, now, after):
        stops = now["emergency"] | equal(now["reason"], EMERGENCY) | equal(now["reason"], LIMIT)
        return {"stopping": after["stopping"] & stops}


class LimitUnsaid(Broken):
    """A limit switch does not stop the device."""

    def seen(self, now):
        return now | {"limited": 0 * now["limited"]}


@pytest.mark.parametrize(
    ("broken", "promise"),
    [
        (ClearedTooSoon, "emergency"),
        (PendingPutOut, "invariant: survives"),
        (HoldIgnored, "hold: once it is still"),
        (StopForgotten, "stop"),
        (StopsUnderAStep, "invariant: survives"),
        (StepLost, "position"),
        (InterpolatorKept, "stands"),
        (LimitedPutOut, "invariant: survives"),
        (LimitUnsaid, "limit"),
    ],
)
def test_a_broken_device_breaks_a_promise(broken, promise):
    sound = make_device(4, ("line",))
    golden = broken(sound.interpolators, sound.feed, sound.pulse)
    assert_broken(promises(golden), promise)


# Broken parts.


class NoSwitches(PulseUnit):
    """Limit switches are not looked at."""

    def _blocked(self, state):
        return 0 * state["limited"]


class NeverHeld(FeedUnit):
    """A step is permitted at any rate, also at none."""

    def outputs(self, state):
        return super().outputs(state) | {"permit": equal(state["debt"], 0)}


@pytest.mark.parametrize(
    ("parts", "promise"),
    [
        ({"pulse": NoSwitches(4)}, "limit"),
        ({"feed": NeverHeld()}, "hold: once it is still"),
    ],
)
def test_a_broken_part_breaks_a_promise(parts, promise):
    golden = replace(make_device(4, ("line",)), **parts)
    assert_broken(promises(golden), promise)
