"""Rungs 3 and 4 on the sound device, and what a broken golden model does to the promises."""

from dataclasses import dataclass

import pytest

from discreta.sim.golden.comparison import Comparison
from discreta.sim.golden.logic import equal, less, negate
from discreta.sim.methods import METHODS
from discreta.sim.proofs import comparison as proofs
from discreta.sim.proofs.comparison import promises, shared
from discreta.sim.prover import prove_variant, shares
from discreta.sim.smt import check

VARIANTS = METHODS["comparison"].variants()


# Of 16 and 32 bits `discreta prove comparison --width 32` takes them.
@pytest.mark.parametrize(
    ("width", "variant"),
    [(4, variant) for variant in VARIANTS] + [(8, VARIANTS[0])],
    ids=str,
)
def test_everything_is_proven(width, variant):
    verdicts = prove_variant("comparison", width, variant)
    assert len(verdicts) >= 20
    assert [verdict for verdict in verdicts if not verdict.holds] == []


def test_both_forms_are_proven_to_take_the_same_steps():
    assert shares("comparison")
    verdicts = prove_variant("comparison", 4, None)
    assert len(verdicts) == 6
    assert [verdict for verdict in verdicts if not verdict.holds] == []


@dataclass(frozen=True)
class ShorterFirst(Comparison):
    def summed(self, state, clock):
        s, dx, dy = state["s"], state["p1"], state["p2"]
        x_turn = less(s, 0) | (equal(s, 0) & less(dx, dy))
        x, y = clock & x_turn, clock & negate(x_turn)
        return {"x": x, "y": y}, {"s": self._wrap(s + x * dy - y * dx)}


@dataclass(frozen=True)
class LostUnderStall(Comparison):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        return after | {f"pulse_{a}": after[f"pulse_{a}"] & inputs["steps_ready"] for a in "xy"}


@dataclass(frozen=True)
class EarlyEnd(Comparison):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        return after | {"running": after["running"] & (state["p5"] & 1)}


@dataclass(frozen=True)
class NotCleared(Comparison):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        kept = equal(after["running"], 1) & negate(state["running"])
        return after | {"s": after["s"] + kept * state["s"]}


@pytest.mark.parametrize(
    ("broken", "promise"),
    [
        (ShorterFirst, "rule"),
        (LostUnderStall, "stall"),
        (EarlyEnd, "invariant: survives"),
        (NotCleared, "start"),
    ],
)
def test_a_broken_model_breaks_a_promise(broken, promise):
    failed = [verdict for verdict in map(check, promises(broken(4))) if not verdict.holds]
    assert any(verdict.title.startswith(promise) for verdict in failed), failed
    assert all(verdict.counterexample for verdict in failed)


def test_a_broken_form_does_not_take_the_same_steps(monkeypatch):
    def made(width, form, first):
        return (ShorterFirst if form == "signed" else Comparison)(width, form, first)

    monkeypatch.setattr(proofs, "Comparison", made)
    failed = [verdict for verdict in map(check, shared(Comparison(4))) if not verdict.holds]
    assert [verdict.title.partition(": ")[0] for verdict in failed] == [
        "both forms, first x",
        "both forms, first y",
    ]
