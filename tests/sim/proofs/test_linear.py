"""Rungs 3 and 4 on the sound device, and what a broken golden model does to the promises."""

from dataclasses import dataclass

import pytest

from discreta.sim.golden.linear import Linear
from discreta.sim.methods import METHODS
from discreta.sim.proofs.linear import promises
from discreta.sim.prover import prove_variant
from discreta.sim.smt import check

VARIANTS = METHODS["linear"].variants()


# All four of 32 bits take more than a minute: `discreta prove linear --width 32` takes them.
@pytest.mark.parametrize(
    ("width", "variant"),
    [(width, variant) for width in (4, 8) for variant in VARIANTS]
    + [(32, METHODS["linear"].settings["lecture"])],
    ids=str,
)
def test_everything_is_proven(width, variant):
    verdicts = prove_variant("linear", width, variant)
    assert len(verdicts) >= 20
    assert [verdict for verdict in verdicts if not verdict.holds] == []


@dataclass(frozen=True)
class WrongPreload(Linear):
    @property
    def initial_sum(self):
        return 2**self.width - 1


@dataclass(frozen=True)
class LostUnderStall(Linear):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        return after | {f"pulse_{a}": after[f"pulse_{a}"] & inputs["steps_ready"] for a in "xy"}


@dataclass(frozen=True)
class EarlyEnd(Linear):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        return after | {"running": after["running"] & (state["p5"] & 1)}


@dataclass(frozen=True)
class OneShiftTooFar(Linear):
    def _increments(self, state):
        return {
            a: (value << 1) & (2**self.width - 1) for a, value in super()._increments(state).items()
        }


@pytest.mark.parametrize(
    ("broken", "promise"),
    [
        (WrongPreload, "distance: off"),
        (LostUnderStall, "stall"),
        (EarlyEnd, "invariant: survives"),
        (OneShiftTooFar, "start"),
    ],
)
def test_a_broken_model_breaks_a_promise(broken, promise):
    failed = [verdict for verdict in map(check, promises(broken(8))) if not verdict.holds]
    assert any(verdict.title.startswith(promise) for verdict in failed), failed
    assert all(verdict.counterexample for verdict in failed)
