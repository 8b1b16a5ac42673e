"""Rungs 3 and 4 on the sound device, and what broken golden models do to the promises."""

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest
import z3

from discreta.sim.golden.conic import Conic
from discreta.sim.golden.logic import equal, negate, where
from discreta.sim.methods import METHODS
from discreta.sim.proofs.conic import promises, shared
from discreta.sim.prover import prove_variant
from discreta.sim.smt import Obligation, check

METHOD = METHODS["conic"]
WIDTH = 4


def test_everything_is_proven_of_the_default():
    verdicts = prove_variant("conic", WIDTH, METHOD.settings["default"])
    assert len(verdicts) >= 36
    assert [verdict for verdict in verdicts if not verdict.holds] == []


def test_everything_is_proven_of_what_the_variants_share():
    verdicts = prove_variant("conic", WIDTH, None)
    assert [verdict for verdict in verdicts if not verdict.holds] == []
    assert sum(verdict.title.startswith("scale converter:") for verdict in verdicts) == 1


# What differs between the variants.
@pytest.mark.parametrize("order", ["alternated", "simultaneous"])
def test_the_sums_of_the_other_orders_are_proven(order):
    find = _obligations(Conic(WIDTH, order=order, guard=0))
    for promise in ("scale: ", "summation:", "sums:"):
        assert check(find(promise)).holds


def test_no_obligation_holds_of_nothing():
    for obligation in [*shared(Conic(WIDTH)), *promises(Conic(WIDTH))]:
        # After reset all values are known.
        if "after reset" in obligation.title:
            continue
        solver = z3.Solver()
        solver.add(z3.And(*obligation.ranges, *obligation.assumptions, z3.BoolVal(True)))
        assert solver.check() == z3.sat, obligation.title
        # One claim's condition after the other: asked of all at once they would contradict.
        for name, claim in dict(obligation.claims).items():
            if z3.is_implies(claim):
                solver.push()
                solver.add(claim.arg(0))
                assert solver.check() == z3.sat, (obligation.title, name)
                solver.pop()


# --- broken models


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

    def model(self) -> Conic:
        method, change = getattr(Conic, self.method), self.change
        names = {"step": ("state", "inputs"), "_run": ("state", "clock", "load"), "reset": ()}

        def broken(golden, *arguments):
            after = method(golden, *arguments)
            named = zip(names[self.method], arguments, strict=False)
            return after | change(SimpleNamespace(golden=golden, after=after, **dict(named)))

        return type("Broken", (Conic,), {self.method: broken})(WIDTH)


def _stops_where_it_stands(at):
    """A block whose end is its start ends before its last change of direction, without a step."""
    state = at.state
    there = equal(state["p1"], state["xk"]) & equal(state["p2"], state["yk"])
    return {"finished": at.after["finished"] | (at.clock & there & equal(state["turns"], 1))}


def _nothing_completes(at):
    """Nothing moves, and nothing ends, with one axis on its end and the other one backward."""
    state, after = at.state, at.after
    dead = at.clock & equal(state["turns"], 0) & equal(state["p3"], 0) & state["backward_y"]
    kept = {name: state[name] for name in ("p2", "p4", "gx", "gy")}
    kept |= {"pulse_y": 0, "finished": 0}
    return {name: where(dead, value, after[name]) for name, value in kept.items()}


def _both_turn(at):
    turned = negate(equal(at.after["turns"], at.state["turns"]))
    sideways = {f"direction_{a}": at.state[f"direction_{a}"] ^ 1 for a in "xy"}
    return {name: where(turned, value, at.after[name]) for name, value in sideways.items()}


def _without_b(at):
    moved = at.after["p2"] - at.state["p2"]
    change = where(equal(moved, 0), 0, where(equal(moved, 1), 2, -2) * at.state["c"])
    return {"gy": where(at.clock, at.state["gy"] + change, at.after["gy"])}


FLAWS = [
    Flaw(
        "running after reset",
        "invariant: it holds after reset",
        "reset",
        lambda at: {"running": at.after["running"] | 1},
    ),
    Flaw("B forgotten", "derivatives: in every other clock", "_run", _without_b),
    Flaw(
        "sign of the start forgotten",
        "derivatives: in n + 1",
        "step",
        lambda at: {"gx": where(equal(at.state["tick"], 1), 0 - at.after["gx"], at.after["gx"])},
    ),
    Flaw(
        "D is added twice",
        "derivatives: ... which come to",
        "step",
        lambda at: {
            "gx": at.after["gx"] + where(equal(at.state["tick"], WIDTH + 2), at.state["d"], 0)
        },
    ),
    Flaw(
        "a bit that does not turn",
        "preparation: P1 and P2",
        "step",
        lambda at: {"p2": where(equal(at.state["tick"], 3), at.state["p2"], at.after["p2"])},
    ),
    Flaw(
        "prepared a clock early",
        "preparation: it takes",
        "step",
        lambda at: {"tick": where(equal(at.after["tick"], WIDTH + 3), 0, at.after["tick"])},
    ),
    Flaw(
        "B lost while it runs",
        "preparation: A to E",
        "_run",
        lambda at: {"b": at.state["b"] - at.clock},
    ),
    Flaw("fault not raised", "verdict:", "step", lambda at: {"fault": at.after["fault"] & 0}),
    Flaw(
        "room off by one",
        "invariant: P3 and P4",
        "_run",
        lambda at: {
            "p3": at.after["p3"] - (at.load & negate(equal(at.state["turns"], 0))),
        },
    ),
    Flaw(
        "direction changes under the step that waits",
        "invariant: P1 and P2",
        "_run",
        lambda at: {"direction_x": at.after["direction_x"] ^ at.after["pulse_x"]},
    ),
    Flaw(
        "position counts before the step is taken",
        "position:",
        "step",
        lambda at: {"xt": at.after["xt"] + at.after["pulse_x"]},
    ),
    Flaw(
        "beyond the edge",
        "overflow: P1, P2",
        "_run",
        lambda at: {"p1": at.state["p1"] + at.clock},
    ),
    Flaw(
        "sum of the block before",
        "start:",
        "_run",
        lambda at: {"sy": where(at.load, at.state["sy"], at.after["sy"])},
    ),
    Flaw(
        "scale of the block before", "limit:", "_run", lambda at: {"fresh": at.after["fresh"] & 0}
    ),
    Flaw("both axes turn round", "turn:", "_run", _both_turn),
    Flaw(
        "y steps with x",
        "one step:",
        "_run",
        lambda at: {"pulse_y": at.after["pulse_y"] | at.after["pulse_x"]},
    ),
    Flaw("no completing step", "completing steps:", "_run", _nothing_completes),
    Flaw("waits for ever", "no hang:", "_run", _nothing_completes),
    Flaw(
        "summation lost",
        "summation:",
        "_run",
        lambda at: {"sx": where(at.clock, at.state["sx"], at.after["sx"])},
    ),
    Flaw(
        "starts with a full sum",
        "sums:",
        "_run",
        lambda at: {"sx": where(at.load, at.golden.modulus, at.after["sx"])},
    ),
    Flaw(
        "end not exact",
        "end: when a block is done",
        "step",
        lambda at: {"xt": where(at.after["done"], at.state["xt"], at.after["xt"])},
    ),
    Flaw(
        "block of no length runs",
        "end: a block of no length",
        "step",
        lambda at: {"running": at.after["running"] | at.after["done"]},
    ),
    Flaw(
        "stops where it stands",
        "end: the clock in which a curve stops",
        "_run",
        _stops_where_it_stands,
    ),
    Flaw("no answer", "answer: busy", "_run", _stops_where_it_stands),
    Flaw(
        "error and done",
        "answer: done or error just",
        "step",
        lambda at: {"done": at.after["done"] | negate(equal(at.after["error"], 0))},
    ),
    Flaw(
        "rejected block is loaded",
        "rejected:",
        "step",
        lambda at: {"xt": where(equal(at.after["error"], 0), at.after["xt"], at.state["p1"])},
    ),
    Flaw(
        "step lost under stall",
        "stall:",
        "step",
        lambda at: {"pulse_x": at.after["pulse_x"] & at.inputs["steps_ready"]},
    ),
]


def _obligations(golden: Conic) -> Callable[[str], Obligation]:
    """Give what finds an obligation by the beginning of its title."""
    everything = [*shared(golden), *promises(golden)]

    def find(beginning: str) -> Obligation:
        (obligation,) = [it for it in everything if it.title.startswith(beginning)]
        return obligation

    return find


def _is_broken(obligation: Obligation) -> None:
    verdict = check(obligation)
    assert not verdict.holds
    assert verdict.counterexample
    assert "gave up" not in verdict.counterexample


@pytest.mark.parametrize("flaw", FLAWS, ids=lambda flaw: flaw.name.replace(" ", "_"))
def test_a_broken_model_breaks_a_promise(flaw):
    _is_broken(_obligations(flaw.model())(flaw.promise))


class TooNarrow(Conic):
    """Has derivatives of a bit too few."""

    @property
    def bits(self):
        return 2 * self.width + 6


class OneTooFar(Conic):
    """Tells of one place more than it shifts."""

    def _scaled(self, values, limit):
        scaled, places = super()._scaled(values, limit)
        return scaled, places + 1


class NotLimited(Conic):
    """Shifts as far as it can, whatever the limit is."""

    def _scaled(self, values, limit):
        return super()._scaled(values, self.no_limit + 0 * limit)


class RisesAgain(Conic):
    """Has a limit nowhere."""

    def step(self, state, inputs, tell=lambda _, value: value):
        def rises(name, value):
            return tell(name, self.no_limit + 0 * value if name == "limit" else value)

        return super().step(state, inputs, rises)


class LimitsAlone(Conic):
    """Remembers the scale of a summation of which only one axis went, too."""

    def step(self, state, inputs, tell=lambda _, value: value):
        made = {}

        def kept(name, value):
            made[name] = tell(name, value)
            return made[name]

        after = super().step(state, inputs, kept)
        summed = equal(after["fresh"], 0) & state["running"]
        forgot = summed & equal(after["scale"], self.no_limit)
        return after | {"scale": where(forgot, made["places"], after["scale"])}


class NoMean(Conic):
    """Takes no account of the scale of the summation before."""

    def _centred(self, state, speed, places, limit):
        return super()._centred(state, speed, places, 0 * limit)


class MeanOfNoLimit(Conic):
    """Takes a limit that is none, one above the greatest scale that there is, for a scale."""

    def _centred(self, state, speed, places, limit):
        greatest = equal(places, self.no_limit - 1) & negate(state["fresh"])
        usual = super()._centred(state, speed, places, limit)
        return where(equal(limit, self.no_limit) & greatest, speed >> 1, usual)


class Unlimited(Conic):
    """Lets the sums run over."""

    def step(self, state, inputs, tell=lambda _, value: value):
        made = {}

        def unlimited(name, value):
            which, _, kind = name.rpartition("_")
            made[name] = tell(name, made[f"{which}_unlimited"] if kind == "rest" else value)
            return made[name]

        return super().step(state, inputs, unlimited)


class WithoutOwn(Conic):
    """Forgets what a step of the axis that slows down changes in its own velocity."""

    def step(self, state, inputs, tell=lambda _, value: value):
        def without(name, value):
            return tell(name, 0 * value if name == "second_own" else value)

        return super().step(state, inputs, without)


#: What is broken, the promise that this breaks, and those near it that still hold.
PARTS = [
    (TooNarrow, "overflow: P·x", ()),
    (OneTooFar, "scale: ", ()),
    (NotLimited, "scale: ", ("limit:",)),
    (RisesAgain, "limit:", ("scale: ", "mean scale:")),
    (LimitsAlone, "limit:", ()),
    (NoMean, "mean scale:", ()),
    (MeanOfNoLimit, "mean scale:", ("limit:",)),
    (Unlimited, "summation:", ()),
    (WithoutOwn, "summation:", ()),
]


@pytest.mark.parametrize(
    ("model", "promise", "others"), PARTS, ids=[model.__name__ for model, *_ in PARTS]
)
def test_a_broken_part_breaks_its_promise_alone(model, promise, others):
    find = _obligations(model(WIDTH))
    _is_broken(find(promise))
    for other in others:
        assert check(find(other)).holds


def test_a_broken_model_breaks_no_promise_that_does_not_speak_of_it():
    (flaw,) = [flaw for flaw in FLAWS if flaw.name == "B forgotten"]
    find = _obligations(flaw.model())
    for promise in ("one step:", "answer: busy"):
        assert check(find(promise)).holds
