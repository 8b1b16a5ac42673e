"""Rungs 3 and 4 on lines and arcs at constant speed, and what broken golden models break."""

from dataclasses import dataclass

import pytest

from discreta.hdl.constant_speed import constant_arc, constant_line
from discreta.sim.golden import constant_speed as golden_models
from discreta.sim.golden.constant_speed import ConstantSpeed
from discreta.sim.golden.exact_arc import ExactArc
from discreta.sim.golden.exact_line import ExactLine
from discreta.sim.golden.logic import less, negate, where
from discreta.sim.proofs.constant_speed import promises
from discreta.sim.smt import check, equivalence

MODELS = {
    "line": (constant_line, golden_models.constant_line),
    "arc": (constant_arc, golden_models.constant_arc),
}


# Wider ones take longer: `discreta prove constant_line constant_arc --width 32` takes them.
@pytest.mark.parametrize(("width", "axes"), [(4, 2), (8, 2), (8, 3), (16, 4)])
@pytest.mark.parametrize("kind", MODELS)
def test_rtl_is_the_golden_model(kind, width, axes):
    device, golden = (make(width, axes) for make in MODELS[kind])
    assert [it for it in map(check, equivalence(device, golden)) if not it.holds] == []


@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("kind", MODELS)
def test_everything_is_promised(kind, axes):
    verdicts = [check(it) for it in promises(MODELS[kind][1](8, axes))]
    assert len(verdicts) == (11 if kind == "arc" and axes > 2 else 8)
    assert [verdict for verdict in verdicts if not verdict.holds] == []


class Broken(ConstantSpeed):
    """A model whose registers go on to something else."""

    def step(self, state, inputs):
        after = super().step(state, inputs)
        return after | self.changed(state, inputs, after)

    def changed(self, _state, _inputs, _after):
        """Go on to nothing else."""
        return {}


@dataclass(frozen=True)
class StepTwice(Broken):
    """A step that is carried stays in the core."""

    def step(self, state, inputs):
        after = super().step(state, inputs)
        kept = self.core.step(state, inputs | {"steps_ready": 0 * inputs["steps_ready"]})
        return after | {name: kept[name] for name in self.core.registers()}


@dataclass(frozen=True)
class TicksGoBy(Broken):
    """A tick that is not taken goes by."""

    def outputs(self, state):
        out = super().outputs(state)
        return out | {"steps_last": out["steps_last"] & negate(state["timer_next"])}


@dataclass(frozen=True)
class ChangesUnderStall(Broken):
    def changed(self, state, _inputs, after):
        waits = self.core.outputs(state)["steps_valid"] & state["timer_here"]
        idle = equal_debt(state, after)
        return {"timer_debt": where(waits & idle, 0 - after["timer_debt"], after["timer_debt"])}


def equal_debt(state, after):
    return negate(less(state["timer_debt"], after["timer_debt"])) & negate(
        less(after["timer_debt"], state["timer_debt"])
    )


@dataclass(frozen=True)
class EarlyTicks(Broken):
    """Ticks before the block has been taken over."""

    def outputs(self, state):
        out = super().outputs(state)
        return out | {"steps_valid": self.core.outputs(state)["steps_valid"]}


@dataclass(frozen=True)
class BlockLost(Broken):
    def changed(self, state, _inputs, after):
        return {"timer_next": after["timer_next"] & negate(state["timer_here"])}


@dataclass(frozen=True)
class PaysTwice(Broken):
    def changed(self, state, _inputs, after):
        fell = less(after["timer_debt"], state["timer_debt"])
        falls = after["timer_debt"] - fell
        return {"timer_debt": falls}


@dataclass(frozen=True)
class NeverPays(Broken):
    def changed(self, state, _inputs, after):
        fell = less(after["timer_debt"], state["timer_debt"])
        kept = where(fell & state["timer_here"], state["timer_debt"], after["timer_debt"])
        return {"timer_debt": kept}


@dataclass(frozen=True)
class LeavesAxisBehind(Broken):
    """The last step does not wait for a further axis."""

    def _due(self, state, first):
        del first
        return less(state["timer_debt"], 0) | state["timer_full"]


@dataclass(frozen=True)
class WrongWay(Broken):
    def changed(self, _state, _inputs, after):
        return {"timer_negative_z": negate(after["timer_negative_z"])}


@dataclass(frozen=True)
class SumNotReduced(Broken):
    def changed(self, state, _inputs, after):
        total = state["sz"] + state["timer_way_z"]
        high = (total & (2**self.ticks_bits - 1)) | (0 * after["sz"])
        return {"sz": where(less(after["sz"], state["sz"]), high, after["sz"])}


@dataclass(frozen=True)
class DoneAnyway(Broken):
    def outputs(self, state):
        return super().outputs(state) | {"done": self.core.outputs(state)["done"]}


@pytest.mark.parametrize(
    ("broken", "core", "axes", "promise"),
    [
        (StepTwice, ExactLine(4), 2, "steps:"),
        (TicksGoBy, ExactLine(4), 2, "steps:"),
        (ChangesUnderStall, ExactLine(4), 2, "ticks: one that waits"),
        (EarlyTicks, ExactLine(4), 2, "ticks: only while"),
        (BlockLost, ExactLine(4), 2, "blocks:"),
        (PaysTwice, ExactLine(4), 2, "debt:"),
        (PaysTwice, ExactArc(4), 2, "debt:"),
        (NeverPays, ExactArc(4), 2, "always goes on"),
        (LeavesAxisBehind, ExactArc(4), 3, "end:"),
        (WrongWay, ExactArc(4), 3, "invariant: survives"),
        (SumNotReduced, ExactArc(4), 3, "further axes:"),
        (DoneAnyway, ExactArc(4), 3, "an arc without a step"),
    ],
)
def test_a_broken_model_breaks_its_promise(broken, core, axes, promise):
    verdicts = [check(it) for it in promises(broken(core, axes))]
    failed = [verdict.title for verdict in verdicts if not verdict.holds]
    assert any(title.startswith(promise) for title in failed), failed
