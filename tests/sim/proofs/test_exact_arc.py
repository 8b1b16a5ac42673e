"""Rungs 3 and 4 on the sound device, and what broken golden models do to the promises."""

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest
import z3

from discreta.sim.golden.exact_arc import ExactArc
from discreta.sim.golden.logic import equal, negate, where
from discreta.sim.methods import METHODS
from discreta.sim.proofs.exact_arc import promises
from discreta.sim.prover import prove_variant, shares
from discreta.sim.smt import Exhaustive, Obligation, check

WIDTH = 4


def test_everything_is_proven():
    verdicts = prove_variant("exact_arc", WIDTH, {})
    assert len(verdicts) >= 22
    assert [verdict for verdict in verdicts if not verdict.holds] == []
    checked = [verdict.title for verdict in verdicts if verdict.exhaustive]
    assert checked == [f"prepared: crossings and faults of all {2 * 32**4} arcs"]


def test_it_has_one_variant_that_shares_nothing():
    assert METHODS["exact_arc"].variants() == [{}]
    assert not shares("exact_arc")


@pytest.mark.parametrize("width", [8, 16, 32])
def test_every_case_is_checked_of_small_widths_alone(width):
    assert not any(isinstance(it, Exhaustive) for it in promises(ExactArc(width)))


def test_no_obligation_holds_of_nothing():
    for obligation in promises(ExactArc(WIDTH)):
        # After reset all values are known.
        if isinstance(obligation, Exhaustive) or "after reset" in obligation.title:
            continue
        bits = z3.Then("simplify", "propagate-values", "solve-eqs", "bit-blast", "sat")
        solver = z3.Solver() if obligation.arithmetic else bits.solver()
        solver.add(z3.And(*obligation.ranges, *obligation.assumptions, z3.BoolVal(True)))
        assert solver.check() == z3.sat, obligation.title
        claims = obligation.claims
        for claim in claims.values() if isinstance(claims, dict) else claims:
            if z3.is_implies(claim):
                solver.push()
                solver.add(claim.arg(0))
                assert solver.check() == z3.sat, (obligation.title, claim)
                solver.pop()


@dataclass(frozen=True)
class Flaw:
    """A golden model with one of its methods changed, and the promise that this breaks.

    ``change`` gives the registers that come out wrong, from what the method gives (``after``) and
    its arguments.
    """

    name: str
    promise: str
    method: str
    change: Callable[[Any], dict[str, Any]]

    def model(self) -> ExactArc:
        method, change = getattr(ExactArc, self.method), self.change
        names = {
            "step": ("state", "inputs"),
            "_run": ("state", "begin"),
            "_sums": ("state", "ends"),
            "_begin": ("state", "after_", "begin"),
        }

        def broken(golden, *arguments):
            after = method(golden, *arguments)
            named = zip(names.get(self.method, ("state",)), arguments, strict=False)
            return after | change(SimpleNamespace(golden=golden, after=after, **dict(named)))

        return type("Broken", (ExactArc,), {self.method: broken})(WIDTH)


FLAWS = [
    Flaw(
        "running after reset",
        "invariant: it holds after reset",
        "reset",
        lambda at: {"running": at.after["running"] | 1},
    ),
    Flaw(
        "the octant's change forgets whether Y − X is odd",
        "invariant: E",
        "_run",
        lambda at: {"odd": at.after["odd"] & 0},
    ),
    Flaw(
        "E loaded one too large",
        "invariant: E",
        "_begin",
        lambda at: {"load_f": where(at.begin, at.after["load_f"] ^ 1, 0)},
    ),
    Flaw(
        "what rose goes on rising",
        "invariant: E",
        "_run",
        lambda at: {"negative_x": at.state["negative_x"]},
    ),
    Flaw(
        "the axes are not exchanged",
        "invariant: a block",
        "_see",
        lambda at: {"seen_swap": at.after["seen_swap"] & 0},
    ),
    Flaw(
        "a crossing forgotten",
        "invariant: E",
        "_run",
        lambda at: {"sole": at.after["sole"] & 0},
    ),
    Flaw(
        "the other candidate",
        "choice:",
        "_run",
        lambda at: {"pulse_x": at.after["pulse_x"] & at.state["second"]},
    ),
    Flaw(
        "an extra clock before every step",
        "extra clock:",
        "_run",
        lambda at: {"waiting": at.after["waiting"] & negate(at.state["waiting"])},
    ),
    Flaw(
        "done is lost",
        "end: when an arc is done",
        "step",
        lambda at: {"done": at.after["done"] & 0},
    ),
    Flaw(
        "steps past the end",
        "end: in the last piece",
        "_run",
        lambda at: {"running": at.after["running"] | (at.state["near"] & at.state["running"])},
    ),
    Flaw(
        "the last step turned round",
        "end: in the last piece",
        "_run",
        lambda at: {"direction_x": at.after["direction_x"] ^ at.state["near"]},
    ),
    Flaw(
        "runs on where X is 0",
        "end: an arc whose end is missed",
        "step",
        lambda at: {"running": at.after["running"] | at.state["running"]},
    ),
    Flaw(
        "the crossings do not count down",
        "it always ends:",
        "_run",
        lambda at: {"turns": where(at.begin, at.after["turns"], at.state["turns"])},
    ),
    Flaw(
        "position counts before the step is taken",
        "position:",
        "step",
        lambda at: {"kox": at.after["kox"] + (at.after["pulse_x"] & negate(at.after["kox"] & 1))},
    ),
    Flaw(
        "error and done",
        "answer:",
        "step",
        lambda at: {"done": at.after["done"] | negate(equal(at.after["error"], 0))},
    ),
    Flaw(
        "a rejected block is loaded",
        "rejected:",
        "step",
        lambda at: {
            "loading": where(equal(at.after["error"], 0), at.after["loading"], at.state["held"])
        },
    ),
    Flaw(
        "step lost under stall",
        "stall:",
        "step",
        lambda at: {"pulse_x": at.after["pulse_x"] & at.inputs["steps_ready"]},
    ),
    Flaw(
        "a gap behind a step",
        "no gap:",
        "step",
        lambda at: {
            "loading": at.after["loading"] & negate(at.state["running"]),
        },
    ),
    Flaw(
        "once round forgotten",
        "prepared:",
        "_see",
        lambda at: {"seen_round": at.after["seen_round"] & 0},
    ),
    Flaw(
        "an end on an axis in the quadrant after it",
        "prepared:",
        "_code",
        lambda at: {"end_quadrant": (at.after["end_quadrant"] + at.after["minus_x"]) & 3},
    ),
]


@pytest.mark.parametrize("flaw", FLAWS, ids=lambda flaw: flaw.name.replace(" ", "_"))
def test_a_broken_model_breaks_a_promise(flaw):
    (obligation,) = [it for it in promises(flaw.model()) if it.title.startswith(flaw.promise)]
    verdict = check(obligation)
    assert not verdict.holds
    assert verdict.counterexample
    assert "gave up" not in verdict.counterexample


@pytest.mark.parametrize("which", ["Y", "X"])
def test_half_a_step_is_not_proven_where_the_octant_is_left_late(which):
    (obligation,) = [
        it for it in promises(ExactArc(WIDTH)) if it.title.startswith(f"half a step: while {which}")
    ]
    assert isinstance(obligation, Obligation)
    # Without the last assumption, that this axis may lead, the proof must fail.
    wider = Obligation(obligation.title, obligation.assumptions[:-1], obligation.claims, True)
    assert check(obligation).holds
    assert not check(wider).holds
