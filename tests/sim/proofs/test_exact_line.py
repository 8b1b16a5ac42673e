"""Rungs 3 and 4 on the sound exact line, and what a broken golden model does to the promises."""

from dataclasses import dataclass

import pytest

from discreta.sim.golden.exact_line import ExactLine
from discreta.sim.golden.logic import negate, where
from discreta.sim.proofs.exact_line import promises
from discreta.sim.prover import prove_variant
from discreta.sim.smt import check


# Wider ones take minutes: `discreta prove exact_line --width 32` takes them.
@pytest.mark.parametrize("width", [4, 8])
def test_everything_is_proven(width):
    verdicts = prove_variant("exact_line", width, {})
    assert len(verdicts) >= 22
    assert [verdict for verdict in verdicts if not verdict.holds] == []


def test_everything_is_proven_of_three_axes():
    assert [it for it in map(check, promises(ExactLine(4, 3))) if not it.holds] == []


class Broken(ExactLine):
    """A line whose registers go on to something else."""

    def step(self, state, inputs):
        after = super().step(state, inputs)
        return after | self.changed(state, inputs, after)

    def changed(self, _state, _inputs, _after):
        """Go on to nothing else."""
        return {}


@dataclass(frozen=True)
class RareTwice(Broken):
    def changed(self, state, inputs, after):
        go = negate(state["waiting"]) | inputs["steps_ready"]
        again = go & state["running"] & negate(state["starting"]) & state["rare"]
        return {"rare": where(again, 1, after["rare"])}


@dataclass(frozen=True)
class OneTooMany(Broken):
    def changed(self, state, _inputs, after):
        return {"more": after["more"] & state["works"]}


@dataclass(frozen=True)
class LostUnderStall(Broken):
    def changed(self, _state, inputs, after):
        return {f"pulse_{a}": after[f"pulse_{a}"] & inputs["steps_ready"] for a in "xy"}


@dataclass(frozen=True)
class OtherStart(Broken):
    def changed(self, state, _inputs, after):
        return {"p3": where(state["starting"], state["p3"], after["p3"])}


@dataclass(frozen=True)
class RoundedDown(Broken):
    """The first residual without the carry that rounds it."""

    def _prepared(self, state):
        way = state["way_follow"] + (state["way_lead"] >> 1)
        return super()._prepared(state) | {"ready_rest": self._wrap(way)}


@dataclass(frozen=True)
class NeverAnswers(Broken):
    def changed(self, state, inputs, after):
        last = state["waiting"] & state["last"] & inputs["steps_ready"]
        return {"done": after["done"] & negate(last)}


@dataclass(frozen=True)
class RunsTooLong(Broken):
    """A way of −2^n is not refused."""

    def _prepared(self, state):
        return super()._prepared(state) | {"ready_fault": state["way_fault"]}


@pytest.mark.parametrize(
    ("broken", "promise"),
    [
        (RareTwice, "invariant: survives every clock, whatever the inputs: residual"),
        (OneTooMany, "invariant: survives every clock, whatever the inputs: the block that runs"),
        (LostUnderStall, "stall"),
        (OtherStart, "position"),
        (RoundedDown, "invariant: survives every clock, whatever the inputs: the block prepared"),
        (NeverAnswers, "answer"),
        (RunsTooLong, "invariant: survives every clock, whatever the inputs: the block prepared"),
    ],
)
def test_a_broken_model_breaks_a_promise(broken, promise):
    meant = [it for it in promises(broken(4)) if it.title.startswith(promise)]
    failed = [verdict for verdict in map(check, meant) if not verdict.holds]
    assert failed
    assert all(verdict.counterexample for verdict in failed)
