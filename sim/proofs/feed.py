"""Promises of the feed unit, for every speed, acceleration, path and input.

They are shown of the golden model's own source, which the device is proven equal to: an invariant
holds after reset and survives every clock from every state that satisfies it, whatever the inputs;
the promises follow, of one clock or of the two or three that follow each other.

Notation: v the velocity, B the braking way, a the acceleration, r the rate, F the programmed speed,
o the override.
"""

from collections.abc import Iterator

import numpy as np
import z3

from discreta.sim.golden.feed import ONE, STEP, FeedUnit
from discreta.sim.smt import Exhaustive, Obligation, same, symbols

__all__ = ["promises"]

#: The first acceleration that there is no room for.
_STEEPEST = 2**40


def promises(golden: FeedUnit) -> list[Obligation | Exhaustive]:
    """Give everything that is promised of the feed unit."""
    return [*_Registers(golden).obligations(), _product(golden), *_numbers()]


def _inputs_of(golden: FeedUnit) -> dict[str, tuple[int, bool]]:
    """Give width and sign of the inputs."""
    kinds: dict[str, tuple[int, bool]] = {
        "feed_mantissa": (16, False),
        "feed_exponent": (5, False),
        "ahead": (28, False),
        "override": (9, False),
        "acceleration": (40, False),
    }
    flags = ["active", "begins", "taken", "even", "hold", "single"]
    flags += [f"moves_{a}" for a in golden.letters]
    return kinds | dict.fromkeys(flags, (1, False))


def _least(a, b):
    return z3.If(a < b, a, b)


def _most(a, b):
    return z3.If(a < b, b, a)


class _Registers:
    """What is promised of the registers, in bit-vectors; two clocks, each with its own inputs."""

    def __init__(self, golden: FeedUnit):
        self.golden = golden
        kinds, inputs = golden.registers(), _inputs_of(golden)
        self.wide = max(bits for bits, _ in kinds.values()) + 4
        self.state = symbols(kinds, self.wide)
        self.inputs, self.next_inputs = (symbols(inputs, self.wide, mark) for mark in ("", ".next"))
        self.after = golden.step(self.state, self.inputs)
        self.later = golden.step(self.after, self.next_inputs)
        self.known = list(self.invariant(self.state).values())
        self.active, self.taken, self.begins, self.hold, self.single = (
            self.inputs[name] == 1 for name in ("active", "taken", "begins", "hold", "single")
        )
        #: Something moves: of ticks at constant speed some move nothing.
        self.moving = z3.And(
            self.taken, z3.Or([self.inputs[f"moves_{a}"] == 1 for a in golden.letters])
        )
        self.acceleration = self.inputs["acceleration"]
        self.permit, self.still = (
            golden.outputs(self.state)[it] == 1 for it in ("permit", "still")
        )

    def invariant(self, state: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        fastest = ONE + _STEEPEST
        return {
            "target": z3.And(state["target"] >= 0, state["target"] <= ONE),
            "velocity": z3.And(state["velocity"] >= 0, state["velocity"] < fastest),
            "rate": z3.And(state["rate"] >= 0, state["rate"] < fastest),
            "braking": z3.And(state["braking"] >= 0, state["braking"] < 2**63),
            "rest": z3.Implies(state["velocity"] == 0, state["braking"] == 0),
            "to_go": z3.And(state["to_go"] >= STEP, state["to_go"] <= (2**28 - 1) * STEP),
            "debt": z3.And(
                state["debt"] > -fastest, state["debt"] <= max(self.golden.pauses) * ONE // STEP
            ),
        }

    def pauses(self) -> Iterator[tuple[str, z3.BoolRef, int, int]]:
        """Give every case of axes before and now: name, condition, pause, axes of the move."""
        axes = self.golden.axes
        pause = (0, *self.golden.pauses)
        yield "tick", self.inputs["even"] == 1, STEP, 0
        for before in range(1 << axes):
            for moves in range(1 << axes):
                joins = self.golden.pairing and before and not before & moves
                together = before | moves if joins else moves
                cost = pause[together.bit_count()] - (pause[before.bit_count()] if joins else 0)
                condition = z3.And(
                    self.inputs["even"] == 0,
                    self.state["cell"] == before,
                    *(
                        self.inputs[f"moves_{a}"] == (moves >> place & 1)
                        for place, a in enumerate(self.golden.letters)
                    ),
                )
                yield f"axes {moves:0{axes}b} after {before:0{axes}b}", condition, cost, together

    def cost(self):
        """Give the pause of the axes that move now, as a speed counts: a step is 2^48."""
        value = z3.BitVecVal(0, self.wide)
        for _, condition, cost, _ in self.pauses():
            value = z3.If(condition, z3.BitVecVal(cost * ONE // STEP, self.wide), value)
        return value

    def obligations(self) -> list[Obligation]:
        """Give everything that is promised of them."""
        reset = {
            name: z3.BitVecVal(value, self.wide) for name, value in self.golden.reset().items()
        }
        return [
            Obligation("invariant: holds after reset", [], self.invariant(reset)),
            Obligation(
                "invariant: survives every clock, whatever the inputs",
                self.known,
                self.invariant(self.after),
            ),
            *self._of_speed(),
            *self._of_steps(),
            *self._of_hold(),
            *self._of_ramp(),
            *self._of_progress(),
        ]

    def _of_speed(self) -> list[Obligation]:
        """What is promised of the target."""
        state, inputs, after = self.state, self.inputs, self.after
        # Shifted by up to 31 places, and none of them lost.
        product, target = (
            z3.ZeroExt(32, value) for value in (state["product"] << 25, after["target"])
        )
        return [
            Obligation(
                "target: min(F·o, 1), less than 2^-48 below it, from the product of a clock before",
                [self.active, z3.Not(self.hold)],
                {
                    f"exponent {exponent}": z3.Implies(
                        state["exponent"] == exponent,
                        z3.If(
                            product >= z3.BitVecVal(ONE << exponent, product.size()),
                            target == ONE,
                            z3.And(target << exponent <= product, target + 1 << exponent > product),
                        ),
                    )
                    for exponent in range(32)
                }
                | {"exponent": after["exponent"] == inputs["feed_exponent"]},
            ),
            Obligation(
                "target: 0 after a clock with hold or without a block to run",
                [z3.Or(self.hold, z3.Not(self.active))],
                [after["target"] == 0],
            ),
            Obligation(
                "no ramp: without acceleration the rate is the target of a clock before, v and B 0",
                [self.active, self.acceleration == 0],
                {
                    "rate": after["rate"] == state["target"],
                    "velocity": after["velocity"] == 0,
                    "braking": after["braking"] == 0,
                },
            ),
            Obligation(
                "no block: after a clock without one the rate is 0, v and B too",
                [z3.Not(self.active)],
                {name: after[name] == 0 for name in ("rate", "velocity", "braking", "product")},
            ),
        ]

    def _of_steps(self) -> list[Obligation]:
        """What is promised of the pauses and of the path left."""
        state, after = self.state, self.after
        debt, rate, to_go = state["debt"], state["rate"], state["to_go"]
        owed, cost = _least(debt, 0), self.cost()
        paid = z3.If(self.taken, cost, 0)
        by_itself = z3.And(debt <= 0, rate > 0)
        return [
            Obligation(
                "pause: a step leaves max(min(debt, 0) + pause, 0) - r, r of its own clock",
                [*self.known, self.taken],
                {
                    name: z3.Implies(
                        condition,
                        z3.And(
                            after["debt"] == _most(owed + pause * ONE // STEP, 0) - rate,
                            after["cell"] == together,
                        ),
                    )
                    for name, condition, pause, together in self.pauses()
                },
            ),
            Obligation(
                "pause: without a step just r a clock is taken off what is left of it",
                [*self.known, z3.Not(self.taken)],
                {
                    "debt": after["debt"] == z3.If(debt > 0, debt - rate, debt),
                    "cell": after["cell"] == state["cell"],
                },
            ),
            Obligation(
                "permit: with nothing left of the pause and a rate above 0, or as a single step",
                [],
                [self.permit == z3.Or(by_itself, state["single_step"] == 1)],
            ),
            Obligation(
                "never too fast: debt grows by the pause of a step, less r, at least, if the step "
                "was permitted by the pause; so at a permit the path is the sum of r at most",
                [*self.known, z3.Implies(self.taken, by_itself)],
                [after["debt"] - debt >= paid - rate],
            ),
            Obligation(
                "never too slow: debt grows by just that in a pause, and at a step that does not "
                "come so late that its pause is over; below 0 it gets by less than r",
                [*self.known, z3.If(self.taken, z3.And(debt <= 0, debt + cost >= 0), debt > 0)],
                {"just": after["debt"] - debt == paid - rate, "below": after["debt"] >= -rate},
            ),
            Obligation(
                "path left: loaded at a beginning, less the pause of a step, 1 at least; it "
                "changes by nothing else",
                self.known,
                {
                    "begins": z3.Implies(
                        self.begins,
                        after["to_go"] == _most(self.inputs["ahead"] * STEP, STEP),
                    ),
                    "step": z3.Implies(
                        z3.And(self.taken, z3.Not(self.begins)),
                        after["to_go"] == _most(to_go - (cost >> 40), STEP),
                    ),
                    "else": z3.Or(self.taken, self.begins, after["to_go"] == to_go),
                },
            ),
        ]

    def _of_hold(self) -> list[Obligation]:
        """What is promised of hold and of single steps."""
        state, after, golden = self.state, self.after, self.golden
        later_still = golden.outputs(after)["still"] == 1
        rises = z3.And(self.single, state["single_before"] == 0)
        waiting, waits = state["single_step"] == 1, after["single_step"] == 1
        held = [*self.known, self.hold]
        v = state["velocity"]
        return [
            Obligation(
                "hold: a rate of 0 permits single steps alone",
                [state["rate"] == 0],
                [self.permit == waiting],
            ),
            Obligation(
                "hold: it loses nothing: at a rate of 0 the pause, the axes before and the path "
                "left stay as they are until a step",
                [
                    *self.known,
                    state["rate"] == 0,
                    z3.Not(self.taken),
                    z3.Not(self.begins),
                ],
                same({name: after[name] for name in ("debt", "cell", "to_go")}, state),
            ),
            Obligation(
                "hold: it ends still: the target is 0 after a clock; then v falls by a in every "
                "clock, to 0; then the rate is 0 after another, and that is still",
                held,
                {
                    "target": after["target"] == 0,
                    "falls": z3.Implies(
                        z3.And(state["target"] == 0, v > 0),
                        after["velocity"]
                        == z3.If(
                            z3.And(self.active, self.acceleration > 0),
                            _most(v - self.acceleration, 0),
                            0,
                        ),
                    ),
                    "stays": z3.Implies(
                        z3.And(state["target"] == 0, v == 0), after["velocity"] == 0
                    ),
                    "rate": z3.Implies(z3.And(state["target"] == 0, v == 0), after["rate"] == 0),
                    "still": self.still == z3.And(state["target"] == 0, v == 0, state["rate"] == 0),
                },
            ),
            Obligation("still: it stays so under hold", [*held, self.still], [later_still]),
            Obligation(
                "single step: one waits after a rising edge under hold, until one is taken that "
                "moves an axis, and without another edge none after it",
                [],
                {
                    "edge": z3.Implies(z3.And(self.hold, rises), waits),
                    "until taken": z3.Implies(
                        z3.And(self.hold, waiting, z3.Not(self.moving)), waits
                    ),
                    "one": z3.Implies(
                        z3.And(z3.Not(rises), z3.Or(self.moving, z3.Not(waiting))), z3.Not(waits)
                    ),
                    "not without hold": z3.Implies(z3.Not(self.hold), z3.Not(waits)),
                    "edge is seen": after["single_before"] == self.inputs["single"],
                },
            ),
        ]

    def _of_ramp(self) -> list[Obligation]:
        """What is promised of velocity and braking way."""
        state, after, later, a = self.state, self.after, self.later, self.acceleration
        v, target, braking = state["velocity"], state["target"], state["braking"]
        ramped = [*self.known, self.active, a > 0]
        same_ramp = [
            *ramped,
            self.next_inputs["active"] == 1,
            self.next_inputs["acceleration"] == a,
        ]
        climb, fall = after["velocity"] == v + a, after["velocity"] == v - a
        brakes = braking >= state["to_go"] << 27
        # What B has summed up on the way from rest to v, and to v - a.
        below = z3.ZeroExt(self.wide - 63, z3.BitVec("B.below", 63))
        way, way_below = v >> 13, v - a >> 13
        return [
            Obligation(
                "ramp: v changes by a a clock at most: it climbs by just a, below the target and "
                "where it need not brake, falls by a or to 0, or stays",
                ramped,
                {
                    "changes": z3.Or(
                        after["velocity"] == v, climb, after["velocity"] == _most(v - a, 0)
                    ),
                    "climbs": climb == z3.And(v < target, z3.Not(brakes)),
                    "not above": after["velocity"] <= _most(v, target + a),
                    "brakes": z3.Implies(brakes, after["velocity"] == _most(v - a, 0)),
                    "not below": z3.Implies(
                        z3.And(z3.Not(brakes), target > 0),
                        after["velocity"] >= _least(v, target),
                    ),
                },
            ),
            Obligation(
                "ramp: the rate is v or the target, the smaller one, but v while it falls from "
                "target + a or more; so it is never above v",
                ramped,
                {
                    "rate": after["rate"] == z3.If(v >= target + a, v, _least(v, target)),
                    "below": after["rate"] <= v,
                },
            ),
            Obligation(
                "no overflow: a climb adds all of a to v and all of v to B, and B stays below 2^63",
                [*ramped, climb],
                {
                    "braking": after["braking"] == braking + way,
                    "room": z3.And(after["velocity"] < 2**49, after["braking"] < 2**63),
                },
            ),
            Obligation(
                "reversible: a climb and then a fall restore v and B to the last bit, and so do a "
                "fall and then a climb where v and B did not end at 0",
                same_ramp,
                {
                    f"{name} {order}": z3.Implies(condition, later[name] == state[name])
                    for order, condition in (
                        ("up and down", z3.And(climb, later["velocity"] == after["velocity"] - a)),
                        (
                            "down and up",
                            z3.And(
                                fall,
                                after["velocity"] > 0,
                                braking >= way_below,
                                later["velocity"] == after["velocity"] + a,
                            ),
                        ),
                    )
                    for name in ("velocity", "braking")
                },
            ),
            Obligation(
                "braking: while a stays the same B is the sum of the ways of a climb from rest to "
                "v, whatever has been before",
                [
                    *ramped,
                    z3.Implies(v > 0, z3.And(v >= a, braking == below + way_below)),
                    z3.Implies(v == a, below == 0),
                ],
                {
                    "up": z3.Implies(climb, after["braking"] == braking + way),
                    "down": z3.Implies(z3.And(v > 0, fall), after["braking"] == below),
                    "stays": z3.Implies(after["velocity"] == v, after["braking"] == braking),
                    "no other": z3.Or(climb, fall, after["velocity"] == v),
                },
            ),
        ]

    def _of_progress(self) -> list[Obligation]:
        """Why it never hangs."""
        state, after, later = self.state, self.after, self.later
        both_run = z3.And(self.active, self.next_inputs["active"] == 1)
        free = z3.And(z3.Not(self.hold), self.next_inputs["hold"] == 0)
        debt, rate = state["debt"], state["rate"]
        return [
            Obligation(
                "never hangs: the target is above 0 two clocks after an override above 0, however "
                "slow F is",
                [both_run, free, self.inputs["override"] > 0],
                [later["target"] > 0],
            ),
            Obligation(
                "never hangs: of two rates that follow two targets above 0 one is above 0, "
                "whatever the path left and the accelerations are",
                [*self.known, both_run, state["target"] > 0, after["target"] > 0],
                [z3.Or(after["rate"] > 0, later["rate"] > 0)],
            ),
            Obligation(
                "never hangs: from rest and towards a target above 0 v climbs; braking never "
                "holds it at 0",
                [
                    *self.known,
                    self.active,
                    self.acceleration > 0,
                    state["target"] > 0,
                    state["velocity"] == 0,
                ],
                [after["velocity"] == self.acceleration],
            ),
            Obligation(
                "never hangs: a rate above 0 makes what is left of a pause less in every clock, "
                "and permits a step when nothing is left",
                [*self.known, rate > 0],
                {
                    "less": z3.Implies(z3.And(debt > 0, z3.Not(self.taken)), after["debt"] < debt),
                    "permit": z3.Implies(debt <= 0, self.permit),
                },
            ),
        ]


def _product(golden: FeedUnit) -> Exhaustive:
    """Check the multiplication, on which the solver would take too long."""
    mantissas = np.arange(2**16)

    def search() -> str:
        idle = dict.fromkeys(_inputs_of(golden), 0) | {"active": 1, "feed_mantissa": mantissas}
        for override in range(2**9):
            product = golden.step(golden.reset(), idle | {"override": override})["product"]
            wrong = np.flatnonzero(product != (2**16 + mantissas) * min(override, 256))
            if wrong.size:
                return f"feed_mantissa={wrong[0]}, override={override}"
        return ""

    return Exhaustive(
        "target: the product is F's significand times min(override, 256), of every mantissa and "
        "every override",
        search,
    )


def _numbers() -> list[Obligation]:
    """What follows for numbers, of a chain of steps at one rate, each taken when permitted."""
    debt, pause, r, n = z3.Ints("debt pause r n")
    path, clocks = z3.Ints("path clocks")
    rest = debt + pause - n * r
    return [
        Obligation(
            "numbers: from a permit to the next at a constant rate there are just as many clocks "
            "as the pause and the fraction kept take, and the fraction kept is below one clock",
            [r > 0, debt <= 0, debt > -r, pause >= r, n >= 1, rest <= 0, rest + r > 0],
            [n * r >= debt + pause, (n - 1) * r < debt + pause, rest > -r],
            True,
        ),
        Obligation(
            "numbers: so a path is run in the clocks that it takes at r, and less than one more",
            [r > 0, debt == path - clocks * r, debt <= 0, debt > -r],
            [clocks * r >= path, (clocks - 1) * r < path],
            True,
        ),
    ]
