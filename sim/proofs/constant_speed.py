"""Promises of constant speed: whatever ticks are made of the steps of an exact line or arc.

They are shown of the golden model's own source, which the device is proven equal to. Of the core
only this is taken: it answers a block when none of its steps waits, and not in the clock after the
last one but with ``done``; that is proven of the cores themselves. Ghost values: ``target``, where
a further axis is to end.
"""

import z3

from discreta.sim.golden.constant_speed import FRACTION, ConstantSpeed
from discreta.sim.golden.logic import Value
from discreta.sim.smt import Obligation, symbols

__all__ = ["promises"]


def promises(golden: ConstantSpeed) -> list[Obligation]:
    """Give everything that is promised of it beyond what its core promises."""
    return _Clock(golden).obligations()


class _Clock:
    """One clock: state and inputs, the state after it, and the ghosts of both."""

    def __init__(self, golden: ConstantSpeed):
        self.golden = golden
        n = golden.width
        coordinate, flag = (n + 1, True), (1, False)
        ports = {f"blocks_{p}_{a}": coordinate for p in ("start", "end") for a in golden.letters}
        ports |= dict.fromkeys(("blocks_valid", "steps_ready"), flag) | golden.inputs()
        if golden.round:
            ports |= {f"blocks_center_{a}": coordinate for a in "xy"}
            ports |= {"blocks_clockwise": flag, "blocks_full_turns": (8, False)}
        kinds = golden.registers()
        self.wide = max(bits for bits, _ in (kinds | ports).values()) + 6
        self.state, self.inputs = symbols(kinds, self.wide), symbols(ports, self.wide)
        named = symbols({f"ghost.{a}": coordinate for a in golden.along}, self.wide)
        self.target = {a: named[f"ghost.{a}"] for a in golden.along}

        state = self.state
        self.after = golden.step(state, self.inputs)
        self.out, self.later = golden.outputs(state), golden.outputs(self.after)
        self.core = golden.core.outputs(state)
        self.waits = self.out["steps_valid"] == 1
        self.tick = z3.And(self.waits, self.inputs["steps_ready"] == 1)
        self.due = self._due(state, self.core)
        self.ended = z3.And(self.tick, self.due, self.core["steps_last"] == 1)
        self.answered = z3.Or(
            z3.And(self.core["done"] == 1, state["timer_ended"] == 0), self.core["error"] != 0
        )
        self.accept = z3.And(self.inputs["blocks_valid"] == 1, self.out["blocks_ready"] == 1)
        here, behind = state["timer_here"] == 1, state["timer_next"] == 1
        self.here = here
        self.leaves = z3.And(here, z3.Or(self.ended, self.answered))
        self.load = z3.And(behind, z3.Or(z3.Not(here), self.leaves))
        self.target_after = {
            a: z3.If(
                self.load, self._wrapped(state[f"next_start_{a}"] + state[f"next_way_{a}"]), value
            )
            for a, value in self.target.items()
        }
        #: The core answers only when none of its steps waits.
        self.given = z3.Implies(
            self.core["steps_valid"] == 1, z3.And(self.core["done"] == 0, self.core["error"] == 0)
        )

    def _wrapped(self, value: Value) -> Value:
        """Give a coordinate's n + 1 bits with their sign."""
        bits = self.golden.width + 1
        return z3.SignExt(self.wide - bits, z3.Extract(bits - 1, 0, value))

    def _held(self, state: dict) -> z3.BoolRef:
        """Tell whether a further axis has more than one step left."""
        return z3.Or([state[f"ko{a}"] > 1 for a in self.golden.along])

    def _due(self, state: dict, core: dict) -> z3.BoolRef:
        """Tell whether the tick is to carry the step that waits in the core."""
        due = state["timer_debt"] < 0
        if self.golden.round:
            due = z3.Or(due, state["timer_full"] == 1)
        return z3.And(due, z3.Not(z3.And(core["steps_last"] == 1, self._held(state))))

    def invariant(self, state: dict, target: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        here = state["timer_here"] == 1
        facts = {}
        if not self.golden.round:
            one = 1 << (self.golden.width + FRACTION)
            debt = state["timer_debt"]
            facts["debt"] = z3.Implies(here, z3.And(debt >= -one, debt < 2 * one))
        else:
            facts["full"] = z3.Implies(
                here, (state["timer_full"] == 1) == (state["timer_pace"] == 0)
            )
        for a in self.golden.along:
            left = state[f"ko{a}"]
            ahead = z3.If(state[f"timer_negative_{a}"] == 1, -left, left)
            facts[f"way {a}"] = z3.Implies(here, self._wrapped(state[f"{a}t"] + ahead) == target[a])
            facts[f"left {a}"] = left <= state[f"timer_way_{a}"]
            # What a block has accepted of a way, n + 2 bits, is a difference of two coordinates.
            given, top = state[f"next_way_{a}"], 1 << (self.golden.width + 1)
            facts[f"given {a}"] = z3.And(given > -top, given < top)
        return facts

    def obligations(self) -> list[Obligation]:
        """Give everything that is promised."""
        golden, state, after, core, out = self.golden, self.state, self.after, self.core, self.out
        reset = {name: z3.BitVecVal(value, self.wide) for name, value in golden.reset().items()}
        known = [*self.invariant(state, self.target).values(), self.given]
        stays = {
            name: self.later[name] == out[name]
            for name in ("steps_valid", "steps_last", *(f"steps_{a}" for a in golden.letters))
        }
        blocks = after["timer_here"] + after["timer_next"]
        plane = "xy" if golden.round else golden.letters
        found = [
            Obligation("invariant: holds after reset", [], self.invariant(reset, self.target)),
            Obligation(
                "invariant: survives every clock, whatever the inputs",
                known,
                self.invariant(after, self.target_after),
            ),
            Obligation(
                "steps: a tick carries the core's step, and takes it there, or none; none is lost, "
                "doubled or changed, and last comes with the core's last one",
                [self.tick],
                {
                    "taken": z3.Implies(self.due, self._core_stepped()),
                    "kept": z3.Implies(z3.Not(self.due), self._core_kept()),
                    "last": (out["steps_last"] == 1) == z3.And(self.due, core["steps_last"] == 1),
                }
                | {a: out[f"steps_{a}"] == z3.If(self.due, core[f"steps_{a}"], 0) for a in plane},
            ),
            Obligation(
                "ticks: one that waits stays as it is until it is taken",
                [*known, self.waits, self.inputs["steps_ready"] == 0, self._core_waits_on()],
                stays,
            ),
            Obligation(
                "ticks: only while a block runs, and just when the core has a step for it",
                [],
                [self.waits == z3.And(self.here, core["steps_valid"] == 1)],
            ),
            Obligation(
                "blocks: one in the core and one behind it at most; none is lost or counted twice",
                [],
                {
                    "count": blocks
                    == state["timer_here"]
                    + state["timer_next"]
                    + z3.If(self.accept, z3.BitVecVal(1, self.wide), 0)
                    - z3.If(self.leaves, z3.BitVecVal(1, self.wide), 0),
                    "accepted": z3.Implies(
                        self.accept, z3.And(core["blocks_ready"] == 1, state["timer_next"] == 0)
                    ),
                },
            ),
            self._debt(known),
            self._progress(known),
        ]
        if golden.along:
            found += self._further(known)
        return found

    def _core_stepped(self) -> z3.BoolRef:
        """State that the core goes on as with a step that is taken."""
        taken = self._core_after(1)
        return z3.And([self.after[name] == taken[name] for name in self.golden.core.registers()])

    def _core_kept(self) -> z3.BoolRef:
        """State that the core goes on as with a step that is not taken."""
        kept = self._core_after(0)
        return z3.And([self.after[name] == kept[name] for name in self.golden.core.registers()])

    def _core_after(self, ready: int) -> dict:
        offered = self.inputs["blocks_valid"] & (self.state["timer_next"] ^ 1)
        inputs = self.inputs | {
            "steps_ready": z3.BitVecVal(ready, self.wide),
            "blocks_valid": offered,
        }
        return self.golden.core.step(self.state, inputs)

    def _core_waits_on(self) -> z3.BoolRef:
        """State what the core promises: a step that is not taken waits on."""
        core = self.golden.core
        kept, before = core.outputs(self.after), self.core
        letters = "xy" if self.golden.round else self.golden.letters
        names = ("steps_valid", "steps_last", *(f"steps_{a}" for a in letters))
        return z3.And([kept[name] == before[name] for name in names])

    def _debt(self, known: list) -> Obligation:
        """The law of the debt."""
        golden, state, after = self.golden, self.state, self.after
        debt, pace = state["timer_debt"], state["timer_pace"]
        later = after["timer_debt"]
        running = [*known, self.tick, z3.Not(self.load)]
        if not golden.round:
            one = 1 << (golden.width + FRACTION)
            return Obligation(
                "debt: grows by length/L − 1 with a step and falls by 1 without, never wraps; it "
                "begins with −½ of a tick",
                running,
                {
                    "step": z3.Implies(self.due, later == debt + pace),
                    "none": z3.Implies(z3.Not(self.due), later == debt - one),
                },
            )
        x, y = state["timer_x"], state["timer_y"]
        dx, dy = self.core["steps_x"], self.core["steps_y"]
        # A step is −1, 0 or 1.
        small = [z3.And(step >= -1, step <= 1) for step in (dx, dy)]
        swept = z3.If(state["timer_clockwise"] == 1, y * dx - x * dy, x * dy - y * dx)
        bits = golden.pace_bits + 2
        grown = debt - pace + z3.If(self.due, swept << FRACTION, z3.BitVecVal(0, self.wide))
        counts = z3.Or(self.due, debt >= 0)
        return Obligation(
            "debt: grows by twice the area of a step, X·dY − Y·dX, and falls by R with every tick, "
            "in its bits; but not while the last step waits for a further axis",
            [*running, *small],
            {
                "law": z3.Implies(
                    counts, z3.Extract(bits - 1, 0, later) == z3.Extract(bits - 1, 0, grown)
                ),
                "waits": z3.Implies(z3.Not(counts), later == debt),
            },
        )

    def _progress(self, known: list) -> Obligation:
        """No number of ticks is endless."""
        golden, state, after = self.golden, self.state, self.after
        debt, later = state["timer_debt"], after["timer_debt"]
        pays = z3.And(debt >= 0, state["timer_full"] == 0) if golden.round else debt >= 0
        claims = {
            "falls": z3.Implies(pays, z3.And(later < debt, later >= -(1 << golden.pace_bits)))
        }
        for a in golden.along:
            moves = self.out[f"steps_{a}"] != 0
            held = z3.And(self.core["steps_last"] == 1, state[f"ko{a}"] > 1)
            room = state[f"s{a}"] + state[f"timer_way_{a}"] < (1 << golden.ticks_bits)
            claims[f"summed {a}"] = z3.Implies(
                held, z3.Or(moves, z3.And(room, after[f"s{a}"] > state[f"s{a}"]))
            )
        return Obligation(
            "always goes on: in a tick without a step the debt falls, until it is below 0, or a "
            "further axis with steps left moves or sums up, until it does",
            [*known, self.tick, z3.Not(self.load), z3.Not(self.due)],
            claims,
        )

    def _further(self, known: list) -> list[Obligation]:
        """What is promised of axes that move along an arc."""
        golden, state, after, out = self.golden, self.state, self.after, self.out
        steps = {a: out[f"steps_{a}"] for a in golden.along}
        lost = z3.And(
            self.core["done"] == 1,
            state["timer_ended"] == 0,
            self.here,
            z3.Or([state[f"ko{a}"] > 0 for a in golden.along]),
        )
        return [
            Obligation(
                "end: with its last step an arc's further axes are at their ends, too",
                [*known, self.tick, out["steps_last"] == 1, z3.Not(self.load)],
                {a: after[f"{a}t"] == self.target[a] for a in golden.along},
            ),
            Obligation(
                "further axes: a step a tick at most, towards the end; SZ keeps below ticks, where "
                "the way is no longer than these",
                [*known, self.tick, z3.Not(self.load)],
                {
                    f"{a} {what}": claim
                    for a in golden.along
                    for what, claim in {
                        "one": z3.And(steps[a] >= -1, steps[a] <= 1),
                        "way": z3.Implies(
                            steps[a] != 0, (steps[a] < 0) == (state[f"timer_negative_{a}"] == 1)
                        ),
                        "sum": z3.Implies(
                            z3.And(
                                state[f"timer_way_{a}"] <= state["ticks"],
                                state[f"s{a}"] < state["ticks"],
                            ),
                            after[f"s{a}"] < state["ticks"],
                        ),
                    }.items()
                },
            ),
            Obligation(
                "an arc without a step that is to take a further axis along is an error, not done",
                [self.given],
                [
                    z3.Implies(lost, z3.And(out["done"] == 0, out["error"] != 0)),
                    z3.Implies(
                        z3.Not(lost),
                        z3.And(
                            out["done"] == self.core["done"], out["error"] == self.core["error"]
                        ),
                    ),
                ],
            ),
        ]
