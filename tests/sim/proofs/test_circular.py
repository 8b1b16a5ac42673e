"""Rungs 3 and 4 on the sound device, and what broken golden models do to the promises."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest
import z3
from click.testing import CliRunner

from discreta import cli
from discreta.sim.golden.circular import Circular
from discreta.sim.golden.logic import equal, negate, where
from discreta.sim.methods import METHODS
from discreta.sim.proofs.circular import promises, shared
from discreta.sim.prover import prove_variant, shares
from discreta.sim.smt import Exhaustive, Obligation, Verdict, check

METHOD = METHODS["circular"]
WIDTH = 4


@pytest.mark.parametrize("variant", METHOD.settings.values(), ids=list(METHOD.settings))
def test_everything_is_proven_of_a_variant(variant):
    verdicts = prove_variant("circular", WIDTH, variant)
    assert len(verdicts) >= 28
    assert [verdict for verdict in verdicts if not verdict.holds] == []
    assert not any(verdict.exhaustive for verdict in verdicts)


def test_everything_is_proven_of_what_the_variants_share():
    verdicts = prove_variant("circular", WIDTH, None)
    assert [verdict for verdict in verdicts if not verdict.holds] == []
    checked = [verdict.title for verdict in verdicts if verdict.exhaustive]
    assert [title.split(" ", 1)[0] for title in checked] == ["root:", "verdict"]
    assert "all 256 starts" in checked[0]
    assert f"all {2 * 16**2 * 31**2} arcs" in checked[1]
    assert len(verdicts) - len(checked) >= 18


def test_arcs_have_sixteen_variants_that_share_something_and_lines_do_not():
    assert len(METHOD.variants()) == 16
    assert [name for name in METHODS if shares(name)] == ["comparison", "circular", "conic"]


@pytest.mark.parametrize("width", [8, 16, 32])
def test_every_case_is_checked_of_small_widths_alone(width):
    checks = [it for it in shared(Circular(width)) if isinstance(it, Exhaustive)]
    assert [it.title.split(":", 1)[0] for it in checks] == (["root"] if width == 8 else [])


@pytest.mark.parametrize("give", [promises, shared])
def test_no_obligation_holds_of_nothing(give):
    for obligation in give(Circular(WIDTH)):
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
    guard: int = 2

    def model(self) -> Circular:
        method, change = getattr(Circular, self.method), self.change
        names = {"step": ("state", "inputs"), "_run": ("state", "clock"), "receive": ("inputs",)}

        def broken(golden, *arguments):
            after = method(golden, *arguments)
            named = zip(names.get(self.method, ("state",)), arguments, strict=False)
            return after | change(SimpleNamespace(golden=golden, after=after, **dict(named)))

        return type("Broken", (Circular,), {self.method: broken})(WIDTH, guard=self.guard)


def _nothing_completes(at):
    """Nothing moves, and nothing ends, when no axis that has steps left has an addend."""
    state, after = at.state, at.after
    x_stands = equal(state["p3"], 0) | state["backward"] | equal(state["p2"], 0)
    y_stands = equal(state["p4"], 0) | equal(state["p1"], 0)
    dead = at.clock & equal(state["turns"], 0) & x_stands & y_stands
    kept = {name: state[name] for name in ("p1", "p2", "p3", "p4")}
    kept |= {"pulse_x": 0, "pulse_y": 0, "finished": 0}
    return {name: where(dead, value, after[name]) for name, value in kept.items()}


FLAWS = [
    Flaw(
        "running after reset",
        "invariant: it holds after reset",
        "reset",
        lambda at: {"running": at.after["running"] | 1},
    ),
    Flaw(
        "counter loaded one short",
        "invariant: to an axis",
        "_load",
        lambda at: {"p4": at.after["p4"] - 1},
    ),
    Flaw(
        "backward ignored",
        "invariant: to an axis",
        "_run",
        lambda at: {"backward": at.after["backward"] & 0},
    ),
    Flaw(
        "axes not exchanged",
        "invariant: the position",
        "_run",
        lambda at: {"swap": at.state["swap"]},
    ),
    Flaw(
        "one crossing too many",
        "invariant: the end",
        "_load",
        lambda at: {"turns": at.state["first_turns"] + 1},
    ),
    Flaw(
        "limit a step too far",
        "invariant: there are coordinates",
        "_load",
        lambda at: {"limit": (at.state["root"] >> 1) + 2},
    ),
    Flaw(
        "position counts before the step is taken",
        "position: changes",
        "step",
        lambda at: {"xt": at.state["xt"] + at.after["pulse_x"]},
    ),
    Flaw(
        "sum of the block before",
        "start:",
        "_load",
        lambda at: {"sy": at.state["sy"]},
    ),
    Flaw(
        "sum not complemented",
        "turn:",
        "_run",
        lambda at: {
            "sx": where(
                negate(equal(at.after["turns"], at.state["turns"])), at.state["sy"], at.after["sx"]
            )
        },
    ),
    Flaw(
        "X of before the summation",
        "summation:",
        "_run",
        lambda at: {
            "sy": Circular(WIDTH, order="simultaneous")._run(at.state | {"fresh": 0}, at.clock)[
                "sy"
            ]
        },
    ),
    Flaw(
        "a step of y too many",
        "one step:",
        "_run",
        lambda at: {"p2": at.after["p2"] + at.after["pulse_y"]},
    ),
    Flaw("no completing step", "completing steps:", "_run", _nothing_completes),
    Flaw("waits for ever", "no hang:", "_run", _nothing_completes),
    Flaw(
        "half increment again and again",
        "no hang:",
        "_run",
        lambda at: {"fresh": at.state["fresh"]},
    ),
    Flaw(
        "half increment forgotten",
        "half increment:",
        "_run",
        lambda at: {"sx": where(at.state["fresh"], at.state["sx"], at.after["sx"])},
    ),
    Flaw(
        "not normalized",
        "speed:",
        "_run",
        lambda at: Circular(WIDTH, normalize=False)._run(at.state, at.clock),
    ),
    Flaw(
        "done is lost",
        "end: when an arc is done",
        "step",
        lambda at: {"done": at.after["done"] & 0},
    ),
    Flaw(
        "block of no length runs",
        "end: a block of no length",
        "step",
        lambda at: {"running": at.after["running"] | at.after["done"]},
    ),
    Flaw(
        "ends with the first counter",
        "end: the summation",
        "_run",
        lambda at: {"finished": at.clock & equal(at.after["p3"], 0)},
    ),
    Flaw(
        "error and done",
        "answer:",
        "step",
        lambda at: {"done": at.after["done"] | negate(equal(at.after["error"], 0))},
    ),
    Flaw(
        "rejected block is loaded",
        "rejected:",
        "step",
        lambda at: {"xt": where(equal(at.after["error"], 0), at.after["xt"], at.state["start_x"])},
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
            "held": where(
                at.state["pulse_x"] | at.state["pulse_y"], at.state["held"], at.after["held"]
            )
        },
    ),
    Flaw(
        "without guard bits the root is lost",
        "preparation: the same",
        "step",
        lambda at: {"root": at.after["root"] & (15 if at.golden.guard else 0)},
        guard=0,
    ),
    Flaw(
        "sums read the radius meter",
        "preparation: the same",
        "_run",
        lambda at: {"sy": at.after["sy"] ^ (at.state["start_square"] & 1)},
    ),
    # The preparation.
    Flaw(
        "prepared a clock early",
        "preparation: it always",
        "step",
        lambda at: {"tick": where(equal(at.after["tick"], 2 * WIDTH + 4), 0, at.after["tick"])},
    ),
    Flaw(
        "clockwise ignored",
        "accepted: start and end",
        "receive",
        lambda at: {"negative_y": at.after["negative_y"] ^ at.inputs["blocks_clockwise"]},
    ),
    Flaw(
        "an end on an axis in the quadrant after it",
        "accepted: start and end",
        "receive",
        lambda at: {"first_turns": at.after["first_turns"] + equal(at.after["to_x"], 0)},
    ),
    Flaw(
        "turned while it is prepared",
        "accepted: ... and so it stays",
        "measure",
        lambda at: {"first_swap": at.state["first_swap"] ^ equal(at.state["tick"], 3)},
    ),
    Flaw(
        "once round forgotten",
        "crossings:",
        "measure",
        lambda at: {"first_turns": at.state["first_turns"]},
    ),
    Flaw(
        "bit of the mask forgotten",
        "radius meter: in n clocks",
        "measure",
        lambda at: {"mask": at.after["mask"] & 7},
    ),
    Flaw(
        "root drawn too large",
        "radius meter: in n + 2 clocks",
        "measure",
        lambda at: {"root": at.after["root"] | equal(at.state["tick"], 7)},
    ),
    Flaw(
        "fault not raised",
        "verdict: RANGE",
        "measure",
        lambda at: {"fault": at.after["fault"] & 0},
    ),
    Flaw(
        "fourth crossing not looked at",
        "verdict: RANGE",
        "measure",
        lambda at: {
            "fault": Circular(WIDTH).measure(
                at.state | {"first_turns": at.state["first_turns"] & 3}
            )["fault"]
        },
    ),
    Flaw(
        "root drawn too large, in every case",
        "root:",
        "measure",
        lambda at: {"root": at.after["root"] | equal(at.state["tick"], 7)},
    ),
    Flaw(
        "once round forgotten, in every case",
        "verdict and crossings:",
        "measure",
        lambda at: {"first_turns": at.state["first_turns"]},
    ),
]


def _obligation(golden: Circular, beginning: str) -> Obligation | Exhaustive:
    """Find an obligation by the beginning of its title."""
    for give in (promises, shared):
        if found := [it for it in give(golden) if it.title.startswith(beginning)]:
            (obligation,) = found
            return obligation
    raise AssertionError(f"no obligation begins with {beginning!r}")


@pytest.mark.parametrize("flaw", FLAWS, ids=lambda flaw: flaw.name.replace(" ", "_"))
def test_a_broken_model_breaks_a_promise(flaw):
    verdict = check(_obligation(flaw.model(), flaw.promise))
    assert not verdict.holds
    assert verdict.counterexample
    assert "gave up" not in verdict.counterexample


@dataclass(frozen=True)
class TooLong(Circular):
    """Shifts one place too far and loses no bit."""

    def _scaled(self, x, y, lower):
        return tuple(value << 1 for value in super()._scaled(x, y, lower))


def test_an_addend_of_a_bit_too_many_breaks_the_single_carry():
    assert not check(_obligation(TooLong(WIDTH), "one carry:")).holds


def test_a_counterexample_names_what_it_is_about_with_its_sign():
    flaw = next(flaw for flaw in FLAWS if flaw.name == "position counts before the step is taken")
    name, values = check(_obligation(flaw.model(), flaw.promise)).counterexample.split(": ", 1)
    assert name == "xt"
    named = dict(value.split("=") for value in values.split(", "))
    assert {"xt", "pulse_x", "steps_ready"} <= set(named)
    assert not {"mask", "root", "yt"} & set(named)
    assert -(2**WIDTH) <= int(named["xt"]) < 2**WIDTH


def test_a_case_that_breaks_is_told():
    assert check(Exhaustive("it is even", lambda: "")).holds
    verdict = check(Exhaustive("it is even", lambda: "x=3"))
    assert (verdict.holds, verdict.counterexample, verdict.exhaustive) == (False, "x=3", True)


def test_the_command_tells_what_is_proven_and_what_is_checked(monkeypatch):
    def prove(name, width, variant):
        if variant is None:
            return [Verdict(f"{name} {width}", True, 1.5, ""), Verdict("root", True, 12, "", True)]
        fails = variant == METHOD.settings["lecture"]
        return [Verdict("end", not fails, 0.25, "x=3" if fails else "")]

    monkeypatch.setattr("discreta.sim.prover.prove_variant", prove)
    monkeypatch.setattr(cli, "ProcessPoolExecutor", ThreadPoolExecutor)
    result = CliRunner().invoke(cli.cli, ["prove", "circular", "--width", "5"])
    assert result.exit_code == 1
    lines = result.output.splitlines()
    assert lines[:5] == [
        "circular, width 5, every variant",
        "  proven   1.50 s  circular 5",
        "  checked 12.00 s  root",
        "circular, width 5, order alternated, preload half, normalize, guard 2",
        "  proven   0.25 s  end",
    ]
    at = lines.index("circular, width 5, order simultaneous, preload zero, no normalize, guard 0")
    assert lines[at + 1 : at + 3] == ["  FAILED   0.25 s  end", "         x=3"]
    assert lines[-1].startswith("16 proven, 1 checked in every case, NOT ALL HOLD, ")
