"""Rung 4 on the sound golden model, and what broken golden models do to the promises."""

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from discreta.sim.golden.exact_conic import ExactConic
from discreta.sim.golden.logic import equal, where
from discreta.sim.proofs.exact_conic import promises
from discreta.sim.smt import check

WIDTH = 4


def _find(golden: ExactConic, beginning: str):
    (obligation,) = [it for it in promises(golden) if it.title.startswith(beginning)]
    return obligation


def test_everything_is_promised_and_proven():
    verdicts = [check(obligation) for obligation in promises(ExactConic(WIDTH))]
    assert len(verdicts) >= 25
    assert [verdict for verdict in verdicts if not verdict.holds] == []


@dataclass(frozen=True)
class Flaw:
    """A golden model with one of its methods changed, and the promise that this breaks.

    ``change`` gives the registers that come out wrong, from what the method gives (``after``) and
    its first arguments.
    """

    name: str
    promise: str
    method: str
    change: Callable[[Any], dict[str, Any]]

    def model(self) -> ExactConic:
        method, change = getattr(ExactConic, self.method), self.change

        def broken(golden, *arguments):
            after = method(golden, *arguments)
            state = arguments[0] if arguments else {}
            return after | change(SimpleNamespace(golden=golden, after=after, state=state))

        return type("Broken", (ExactConic,), {self.method: broken})(WIDTH)


FLAWS = [
    Flaw(
        "running after reset",
        "invariant: it holds after reset",
        "reset",
        lambda at: {"running": 1 - at.after["running"], "diagonal": 0},
    ),
    Flaw(
        "slower axis steps unseen",
        "residuals: of a block",
        "_summed",
        lambda at: {"residual": at.after["residual"] + at.state["diagonal"]},
    ),
    Flaw(
        "sign of b kept",
        "residuals: of a block",
        "_summed",
        lambda at: {"beta": at.state["beta"]},
    ),
    Flaw(
        "residual lost in a stall",
        "residuals: a clock pulse",
        "step",
        lambda at: {"residual": where(at.state["running"], at.after["residual"], 0)},
    ),
    Flaw(
        "prepared a clock early",
        "preparation: it takes",
        "step",
        lambda at: {"tick": where(equal(at.after["tick"], WIDTH + 8), 0, at.after["tick"])},
    ),
    Flaw(
        "fault not raised",
        "verdict:",
        "step",
        lambda at: {"fault": at.after["fault"] & 0},
    ),
    Flaw(
        "way to the end kept",
        "place:",
        "step",
        lambda at: {"p3": at.state["p3"]},
    ),
    Flaw(
        "position counts before the step is taken",
        "place:",
        "step",
        lambda at: {"xt": at.after["xt"] + at.after["pulse_x"]},
    ),
    Flaw(
        "two steps at once",
        "one step:",
        "step",
        lambda at: {"p1": at.after["p1"] + at.after["p1"] - at.state["p1"]},
    ),
    Flaw(
        "stands still",
        "one clock a step:",
        "step",
        lambda at: {"pulse_x": at.after["pulse_x"] & at.state["slows"]},
    ),
    Flaw(
        "turn not counted",
        "it always ends: a change",
        "step",
        lambda at: {"turns": at.state["turns"]},
    ),
    Flaw(
        "step lost under stall",
        "stall:",
        "step",
        lambda at: {"pulse_x": at.after["pulse_x"] & at.after["running"] & at.after["held"]},
    ),
    Flaw(
        "error and done",
        "answer: done or error just",
        "step",
        lambda at: {"done": at.after["done"] | (equal(at.after["error"], 0) ^ 1)},
    ),
    Flaw(
        "refused block is loaded",
        "refused:",
        "step",
        lambda at: {"xt": where(equal(at.after["error"], 0), at.after["xt"], at.state["next_x"])},
    ),
]


@pytest.mark.parametrize("flaw", FLAWS, ids=lambda flaw: flaw.name.replace(" ", "_"))
def test_a_broken_model_breaks_a_promise(flaw):
    verdict = check(_find(flaw.model(), flaw.promise))
    assert not verdict.holds
    assert verdict.counterexample
    assert "gave up" not in verdict.counterexample


def test_a_broken_model_breaks_no_promise_that_does_not_speak_of_it():
    (flaw,) = [flaw for flaw in FLAWS if flaw.name == "sign of b kept"]
    for promise in ("answer: done", "it always ends: a step"):
        assert check(_find(flaw.model(), promise)).holds
