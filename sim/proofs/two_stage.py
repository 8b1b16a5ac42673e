"""Promises of two-stage interpolation: what the second stage makes of any increments.

Those of the first stage are proven of the constant-carrier method itself. Here its output is taken
as it comes: an invariant of the second stage holds after reset and survives every clock, whatever
the first one does that it promises. Ghost values: ``target``, where the increments that were taken
lead.

Notation: M the clocks of a period (``span``), Δ the increment of an axis, S its sum, S₀ the
preload, KO the steps left of it, t the clocks left.
"""

import z3

from discreta.sim.golden.logic import Value
from discreta.sim.golden.two_stage import NAMES, TwoStage
from discreta.sim.proofs.carrier import PLACES, inputs_of
from discreta.sim.smt import Obligation, extend, same, symbols

__all__ = ["promises"]


def promises(golden: TwoStage) -> list[Obligation]:
    """Give everything that is promised of the second stage."""
    return _Registers(golden).obligations() + _numbers(golden)


class _Registers:
    """What is promised of the registers, in bit-vectors."""

    def __init__(self, golden: TwoStage):
        self.golden = golden
        kinds = golden.registers()
        inputs = inputs_of(golden, "held" in kinds)
        self.wide = max(bits for bits, _ in (kinds | inputs).values()) + 4
        self.state, self.inputs = symbols(kinds, self.wide), symbols(inputs, self.wide)
        self.ghosts = {
            f"target_{a}": extend(z3.BitVec(f"ghost.target_{a}", golden.width + 1), True, self.wide)
            for a in "xy"
        }
        state, ready = self.state, self.inputs["steps_ready"]
        self.after = golden.step(state, self.inputs)
        self.outputs, self.later = golden.outputs(state), golden.outputs(self.after)
        self.first = golden.coarse.outputs(state, state["open"])
        self.waiting = self.outputs["steps_valid"] == 1
        self.taken = z3.And(self.waiting, ready == 1)
        self.free = z3.Or(z3.Not(self.waiting), ready == 1)
        self.clock = z3.And(state["fine_running"] == 1, self.free)
        #: The first stage's increments are taken.
        self.take = z3.And(
            state["waiting"] == 1,
            self.free,
            z3.Or(state["fine_running"] == 0, state["clocks_left"] == 1),
            z3.Or(
                state["fine_last"] == 0,
                state["open"] == 0,
                z3.And(self.taken, state["step_last"] == 1),
            ),
        )
        nothing = z3.And(self.first["steps_x"] == 0, self.first["steps_y"] == 0)
        carry = [
            state[f"fine_s{a}"] + state[increment] >= state["span"]
            for a, (increment, _) in NAMES.items()
        ]
        self.stepless = z3.And(
            self.take,
            self.first["steps_last"] == 1,
            nothing,
            z3.Not(z3.And(self.clock, z3.Or(carry))),
        )
        taking = z3.If(self.take, z3.BitVecVal(1, self.wide), z3.BitVecVal(0, self.wide))
        start = golden.coarse.start(state, taking, state["open"])
        self.empty = z3.And(
            start == 1, golden.coarse.fault(state) == 0, golden.coarse.empty(state) == 1
        )
        self.refused = z3.And(start == 1, golden.coarse.fault(state) != 0)
        self.ended = z3.And(self.taken, state["step_last"] == 1)
        self.to = {a: state[place] + self.first[f"steps_{a}"] for a, place in PLACES.items()}
        self.ghosts_after = {
            f"target_{a}": z3.If(
                self.take,
                self.to[a],
                z3.If(self.empty, state[f"start_{a}"], self.ghosts[f"target_{a}"]),
            )
            for a in "xy"
        }

    def ahead(self, state: dict, a: str) -> Value:
        """Give the way that is left of the increments that were taken, with its sign."""
        left = state[NAMES[a][1]]
        return z3.If(state[f"fine_direction_{a}"] == 1, -left, left)

    def invariant(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        none_left = z3.And(state["fine_p5"] == 0, state["fine_p6"] == 0)
        step = z3.Or(state["step_x"] != 0, state["step_y"] != 0)
        facts = {
            "runs": z3.Implies(state["fine_running"] == 0, none_left),
            "clocks": z3.Implies(state["fine_running"] == 1, state["clocks_left"] >= 1),
            "last": z3.Implies(
                step, (state["step_last"] == 1) == z3.And(state["fine_last"] == 1, none_left)
            ),
            "open": z3.Implies(z3.Or(step, z3.Not(none_left)), state["open"] == 1),
            "between": z3.Implies(state["fine_last"] == 0, state["open"] == 1),
            "closed": z3.Implies(
                z3.And(state["fine_last"] == 1, none_left, z3.Not(step)), state["open"] == 0
            ),
        }
        for a in "xy":
            target, reached = ghosts[f"target_{a}"], state[f"{a}t"] + state[f"step_{a}"]
            top = 2**self.golden.width
            facts |= {
                f"inside {a}": z3.And(reached >= -top, reached < top),
                f"sum {a}": z3.Implies(
                    state["fine_running"] == 1,
                    z3.And(
                        state[f"fine_s{a}"] < state["span"], state[NAMES[a][0]] <= state["span"]
                    ),
                ),
                f"way {a}": reached + self.ahead(state, a) == target,
                f"step {a}": z3.And(state[f"step_{a}"] >= -1, state[f"step_{a}"] <= 1),
                f"left {a}": z3.And(
                    state[NAMES[a][1]] <= state[NAMES[a][0]],
                    state[NAMES[a][0]] <= 2 ** (self.golden.width + 1),
                ),
            }
        return facts

    def given(self) -> list[z3.BoolRef]:
        """Give what the first stage promises, and what the numbers say of the sums."""
        state, top = self.state, 2**self.golden.width
        least = self.golden.least_period
        facts = [z3.Implies(state["waiting"] == 1, state["period"] >= least)]
        for a, (increment, left) in NAMES.items():
            total = state[f"fine_s{a}"] + state[increment]
            facts += [
                # Its points lie within the coordinates, and a block begins where it says.
                z3.And(self.to[a] >= -top, self.to[a] < top),
                z3.Implies(
                    z3.And(self.take, state["fine_last"] == 0),
                    state[PLACES[a]] == self.ghosts[f"target_{a}"],
                ),
                # A carry finds a step left, and the last clock of a period leaves none.
                z3.Implies(
                    z3.And(self.clock, total >= state["span"]),
                    state[left] >= 1,
                ),
                z3.Implies(
                    z3.And(self.clock, state["clocks_left"] == 1),
                    z3.If(total >= state["span"], state[left] == 1, state[left] == 0),
                ),
            ]
        return facts

    def obligations(self) -> list[Obligation]:
        """Give everything that is promised of them."""
        state, after = self.state, self.after
        known = [*self.invariant(state, self.ghosts).values(), *self.given()]
        reset = {
            name: z3.BitVecVal(value, self.wide) for name, value in self.golden.reset().items()
        }
        zero = dict.fromkeys(self.ghosts, z3.BitVecVal(0, self.wide))
        fine = [*(name for pair in NAMES.values() for name in pair), "fine_sx", "fine_sy"]
        fine += ["span", "clocks_left", "fine_last", "fine_running", "xt", "yt", "open"]
        initial = z3.LShR(after["span"], 1) if self.golden.preload == "half" else 0
        longest = [
            z3.If(self.first[f"steps_{a}"] < 0, -self.first[f"steps_{a}"], self.first[f"steps_{a}"])
            for a in "xy"
        ]
        return [
            Obligation("invariant: holds after reset", [], self.invariant(reset, zero)),
            Obligation(
                "invariant: survives every clock, whatever the inputs",
                known,
                self.invariant(after, self.ghosts_after),
            ),
            Obligation(
                "taken: a period's increments, all of them to go; it lasts T clocks or as many as "
                "it has steps",
                [*known, self.take],
                {
                    f"{what} {a}": after[name] == length
                    for a, length in zip("xy", longest, strict=True)
                    for what, name in zip(("increment", "left"), NAMES[a], strict=True)
                }
                | {f"preload {a}": after[f"fine_s{a}"] == initial for a in "xy"}
                | {
                    "at least": z3.And(
                        after["span"] >= state["period"], *(after["span"] >= it for it in longest)
                    ),
                    "no more": z3.Or(
                        after["span"] == state["period"], *(after["span"] == it for it in longest)
                    ),
                    "clocks": after["clocks_left"] == after["span"],
                },
            ),
            Obligation(
                "summation: an axis gains just its increment in M·(steps put out) + S, and every "
                "carry is a step that waits",
                [*known, self.clock, z3.Not(self.take)],
                {
                    f"gain {a}": after[f"fine_s{a}"]
                    == state[f"fine_s{a}"]
                    + state[increment]
                    - z3.If(after[left] == state[left], 0, state["span"])
                    for a, (increment, left) in NAMES.items()
                }
                | {
                    f"step {a}": z3.Or(
                        after[left] == state[left],
                        z3.And(after[left] == state[left] - 1, after[f"step_{a}"] != 0),
                    )
                    for a, (_, left) in NAMES.items()
                },
            ),
            Obligation(
                "position: changes by just the step that is taken, and by loading a block's start",
                known,
                {
                    a: after[f"{a}t"]
                    == z3.If(
                        self.empty,
                        state[f"start_{a}"],
                        z3.If(
                            z3.And(self.take, state["fine_last"] == 1),
                            state[PLACES[a]],
                            state[f"{a}t"] + z3.If(self.taken, state[f"step_{a}"], 0),
                        ),
                    )
                    for a in "xy"
                },
            ),
            Obligation(
                "end: with the last step of a block the point is reached to which the first stage "
                "leads with its last increments",
                [*known, self.ended],
                {
                    a: state[f"{a}t"] + state[f"step_{a}"] == self.ghosts[f"target_{a}"]
                    for a in "xy"
                },
            ),
            Obligation(
                "answer: done just one clock after the last step is taken, a block of no length is "
                "started or a block has no last step; never two of these, or one and a refusal",
                known,
                {
                    "done": (after["fine_done"] == 1)
                    == z3.Or(self.ended, self.empty, self.stepless),
                    "one": z3.AtMost(
                        z3.And(self.ended, z3.Not(self.stepless)), self.empty, self.refused, 1
                    ),
                },
            ),
            Obligation(
                "stall: a step that is not taken stays, and no register of the second stage moves",
                [*known, self.waiting, z3.Not(self.taken), z3.Not(self.empty)],
                same({name: after[name] for name in fine}, state)
                | {
                    f"steps {a}": self.later[f"steps_{a}"] == self.outputs[f"steps_{a}"]
                    for a in "xy"
                },
            ),
        ]


def _numbers(golden: TwoStage) -> list[Obligation]:
    """What follows for numbers, of one axis in one period."""
    m, delta, s, initial, left, t, carry = z3.Ints("M Δ S S₀ KO t carry")
    value = s + t * delta - m * left
    inside = [s >= 0, s < m, delta >= 0, delta <= m, initial >= 0, initial < m, t >= 1, left >= 0]
    carries = carry == z3.If(s + delta >= m, 1, 0)
    k, clock, later = z3.Ints("k n n′")
    half = golden.preload == "half"
    # The k-th carry comes in clock ⌈(k·M − S₀)/Δ⌉.
    first = [delta * clock >= k * m - initial, delta * (clock - 1) < k * m - initial]
    second = [
        delta * later >= (k + 1) * m - initial,
        delta * (later - 1) < (k + 1) * m - initial,
    ]
    obligations = [
        Obligation(
            "numbers: S + t·Δ − M·KO is S₀ at the start of a period, and stays it; S stays below M",
            [*inside, carries],
            [
                z3.Implies(z3.And(s == initial, t == m, left == delta), value == initial),
                (s + delta - m * carry) + (t - 1) * delta - m * (left - carry) == value,
                s + delta - m * carry >= 0,
                s + delta - m * carry < m,
            ],
            True,
        ),
        Obligation(
            "numbers: a carry finds a step left, and the last clock of a period leaves none",
            [*inside, carries, value == initial],
            [
                z3.Implies(carry == 1, left >= 1),
                z3.Implies(t == 1, left == carry),
            ],
            True,
        ),
        Obligation(
            "even: two steps of an axis that follow each other in a period are ⌊M/Δ⌋ or ⌈M/Δ⌉ "
            "clocks apart",
            [*inside, delta >= 1, *first, *second],
            [delta * (later - clock) > m - delta, delta * (later - clock) < m + delta],
            True,
        ),
    ]
    x = z3.Int("x")
    off = m * x - clock * delta
    bound = z3.And(2 * off <= m, 2 * off >= -m) if half else z3.And(off <= 0, off > -m)
    preload = [2 * initial <= m, 2 * initial >= m - 1] if half else [initial == 0]
    return [
        *obligations,
        Obligation(
            "error: after n clocks of a period an axis has put out x = (S₀ + n·Δ − S)/M steps: "
            + ("at most half a step" if half else "less than one step behind, or none,")
            + " off the straight line n·Δ/M between two points of the first stage",
            [*inside, *preload, m * x + s == initial + clock * delta],
            [bound],
            True,
        ),
    ]
