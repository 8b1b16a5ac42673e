"""Promises of the block queue of depth 1, for all blocks, interpolators and moments.

They are shown of the golden model's own source, which the device is proven equal to: an invariant
holds after reset and survives every clock from every state that satisfies it; the promises follow.
What comes and goes is judged by the ports. Ghost values keep its history:

- ``accepted``: the block that was accepted last, by its fields;
- ``here``: blocks accepted and not yet answered by ``done`` or ``refusal``, since the last flush;
- ``inside_<kind>``: blocks that an interpolator was given and has not finished, and ``owes_<kind>``
  that the last step of one was taken a clock ago;
- ``lead``: the end of the block that was handed over last, the place that was told, or where the
  machine was at the last flush.

The interpolators are taken at their word: ``done`` follows a last step by just one clock; a block
without a last step is answered alone; blocks are finished in order, and an interpolator that has
none is silent; ``flush`` empties it.
"""

import z3

from discreta.sim.golden.logic import Value
from discreta.sim.golden.queue import CODES, PLACE, REFUSED, UNKNOWN, BlockQueue
from discreta.sim.smt import Obligation, same, symbols

__all__ = ["promises"]


def promises(golden: BlockQueue) -> list[Obligation]:
    """Give everything that is promised of the queue."""
    return _Clock(golden).obligations()


class _Clock:
    """One clock of the queue: state and inputs, the state after it, and the ghosts of both."""

    def __init__(self, golden: BlockQueue):
        self.golden = golden
        kinds, inputs, ghosts = golden.registers(), golden.inputs(), self.ghost_kinds()
        self.wide = max(bits for bits, _ in (kinds | inputs | ghosts).values()) + 4
        self.state, self.inputs = symbols(kinds, self.wide), symbols(inputs, self.wide)
        ghost_symbols = symbols({f"ghost.{name}": it for name, it in ghosts.items()}, self.wide)
        self.ghosts = {name.removeprefix("ghost."): it for name, it in ghost_symbols.items()}
        self.out = golden.outputs(self.state, self.inputs)
        self.after = golden.step(self.state, self.inputs)

        out, inputs = self.out, self.inputs
        self.flush = inputs["flush"] == 1
        self.accept = z3.And(inputs["blocks_valid"] == 1, out["blocks_ready"] == 1)
        self.placing, self.begins = out["placing"] == 1, out["begins"] == 1
        self.handed = {
            kind: z3.And(out[f"{kind}_blocks_valid"] == 1, inputs[f"{kind}_blocks_ready"] == 1)
            for kind in golden.kinds
        }
        self.passed = {
            kind: z3.And(inputs[f"{kind}_steps_valid"] == 1, out[f"{kind}_steps_ready"] == 1)
            for kind in golden.kinds
        }
        self.last = {
            kind: z3.And(self.passed[kind], inputs[f"{kind}_steps_last"] == 1)
            for kind in golden.kinds
        }
        #: An interpolator answers for a block that has no last step.
        self.answer = {
            kind: z3.Or(
                z3.And(inputs[f"{kind}_done"] == 1, self.ghosts[f"owes_{kind}"] == 0),
                inputs[f"{kind}_error"] != 0,
            )
            for kind in golden.kinds
        }
        #: A block at the head that there is no interpolator for is taken off for its refusal.
        self.unknown = z3.And(
            self.state["head"] == 1,
            self.state["next"] == 0,
            z3.Not(self.flush),
            z3.And([self.ghosts["accepted_kind"] != CODES[kind] for kind in golden.kinds]),
            self.ghosts["accepted_kind"] != PLACE,
        )
        self.refused = out["refusal"] != 0
        self.ghosts_after = self.remembered()

    def ghost_kinds(self) -> dict[str, tuple[int, bool]]:
        """Give width and sign of the ghosts."""
        golden = self.golden
        kinds = {f"accepted_{name}": kind for name, kind in golden.fields().items()}
        kinds["here"] = (3, False)
        for kind in golden.kinds:
            kinds |= {f"inside_{kind}": (2, False), f"owes_{kind}": (1, False)}
        return kinds | {f"lead_{a}": (golden.width + 1, True) for a in golden.letters}

    def remembered(self) -> dict[str, Value]:
        """Give the ghosts after the clock."""
        ghosts, inputs, out = self.ghosts, self.inputs, self.out
        zero = z3.BitVecVal(0, self.wide)
        after = {
            f"accepted_{name}": z3.If(
                self.accept, inputs[f"blocks_{name}"], ghosts[f"accepted_{name}"]
            )
            for name in self.golden.fields()
        }
        here = ghosts["here"] + self.bit(self.accept) - out["done"] - self.bit(self.refused)
        after["here"] = z3.If(self.flush, zero, here)
        for kind in self.golden.kinds:
            over = z3.Or(self.last[kind], self.answer[kind])
            inside = ghosts[f"inside_{kind}"] + self.bit(self.handed[kind]) - self.bit(over)
            after[f"inside_{kind}"] = z3.If(self.flush, zero, inside)
            after[f"owes_{kind}"] = z3.If(self.flush, zero, self.bit(self.last[kind]))
        gone = z3.Or(self.placing, *self.handed.values())
        for a in self.golden.letters:
            lead = z3.If(gone, ghosts[f"accepted_end_{a}"], ghosts[f"lead_{a}"])
            after[f"lead_{a}"] = z3.If(self.flush, inputs[f"position_{a}"], lead)
        return after

    def bit(self, condition: z3.BoolRef) -> Value:
        """Give a condition as a number."""
        return z3.If(condition, z3.BitVecVal(1, self.wide), z3.BitVecVal(0, self.wide))

    def contract(self) -> list[z3.BoolRef]:
        """Give what the interpolators promise."""
        facts = []
        for kind in self.golden.kinds:
            done, error = (self.inputs[f"{kind}_{name}"] for name in ("done", "error"))
            owes, inside = (self.ghosts[f"{name}_{kind}"] for name in ("owes", "inside"))
            facts += [
                z3.Implies(owes == 1, z3.And(done == 1, error == 0)),
                z3.Not(z3.And(self.answer[kind], self.last[kind])),
                z3.Implies(
                    inside == 0,
                    z3.And(
                        self.inputs[f"{kind}_steps_valid"] == 0,
                        z3.Not(self.answer[kind]),
                    ),
                ),
            ]
        return facts

    def invariant(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        waits, follows, runs = (state[name] == 1 for name in ("head", "next", "current"))
        blocks = state["head"] + state["next"] + state["current"] + state["queue_done"]
        facts = {
            f"head {name}": z3.Implies(waits, state[f"head_{name}"] == ghosts[f"accepted_{name}"])
            for name in self.golden.fields()
        }
        facts |= {
            f"place {a}": state[f"place_{a}"] == ghosts[f"lead_{a}"] for a in self.golden.letters
        }
        facts["here"] = ghosts["here"] == blocks
        unfinished = {}
        for slot, there in (("next", follows), ("current", runs)):
            unfinished[slot] = z3.And(there, state[f"{slot}_answered"] == 0)
            known = [state[f"{slot}_kind"] == CODES[kind] for kind in self.golden.kinds]
            facts |= {
                f"{slot} known": z3.Implies(unfinished[slot], z3.Or(known)),
                f"{slot} refused": z3.Implies(
                    unfinished[slot],
                    state[f"{slot}_refusal"] == 0,
                ),
                f"{slot} unknown": z3.Implies(
                    z3.And(there, z3.Not(z3.Or(known))), state[f"{slot}_refusal"] == UNKNOWN
                ),
            }
        for kind in self.golden.kinds:
            inside = [
                self.bit(z3.And(unfinished[slot], state[f"{slot}_kind"] == CODES[kind]))
                for slot in ("next", "current")
            ]
            facts |= {
                f"inside {kind}": ghosts[f"inside_{kind}"] == inside[0] + inside[1],
                f"owes {kind}": ghosts[f"owes_{kind}"] == state[f"{kind}_ended"],
            }
        return facts

    def runs(self) -> z3.BoolRef:
        """Tell whether the current block is still to be run."""
        return z3.And(self.state["current"] == 1, self.state["current_answered"] == 0)

    def ends(self) -> z3.BoolRef:
        """Tell whether the current block ends in this clock."""
        state = self.state
        now = [
            z3.And(state["current_kind"] == CODES[kind], z3.Or(self.last[kind], self.answer[kind]))
            for kind in self.golden.kinds
        ]
        answered = state["current_answered"] == 1
        return z3.And(state["current"] == 1, z3.Or(answered, *now))

    def obligations(self) -> list[Obligation]:
        """Give everything that is promised."""
        golden, state, after, ghosts = self.golden, self.state, self.after, self.ghosts
        kinds, letters = golden.kinds, golden.letters
        reset = {name: z3.BitVecVal(value, self.wide) for name, value in golden.reset().items()}
        zero = dict.fromkeys(ghosts, z3.BitVecVal(0, self.wide))
        self.known = known = [*self.invariant(state, ghosts).values(), *self.contract()]
        taken = self.out["taken"] == 1
        permitted = z3.And(self.inputs["permit"] == 1, z3.Not(self.flush))
        gone = z3.Or(self.placing, self.unknown, *self.handed.values())
        return [
            Obligation("invariant: holds after reset", [], self.invariant(reset, zero)),
            Obligation(
                "invariant: survives every clock, whatever the inputs",
                known,
                self.invariant(after, self.ghosts_after),
            ),
            *self._handing_over(gone),
            Obligation(
                "conservation: blocks accepted and not yet answered are those that wait, are next, "
                "run, or are answered in this clock: none is lost and none counted twice",
                known,
                {
                    "here": self.ghosts_after["here"]
                    == after["head"] + after["next"] + after["current"] + after["queue_done"],
                    "at most": ghosts["here"] <= 4,
                },
            ),
            Obligation(
                "steps: they leave only from the current block's interpolator, permitted and not "
                "under a flush, as they are; the others wait",
                known,
                {
                    "current": taken == z3.Or(list(self.passed.values())),
                    "permitted": z3.Implies(taken, permitted),
                    "shown": z3.Implies(self.out["steps_valid"] == 1, permitted),
                }
                | {
                    f"only {kind}": z3.Implies(
                        self.passed[kind],
                        z3.And(state["current"] == 1, state["current_kind"] == CODES[kind], taken),
                    )
                    for kind in kinds
                }
                | {
                    f"step {kind} {a}": z3.Implies(
                        self.passed[kind],
                        self.out[f"steps_{a}"] == self.inputs[f"{kind}_steps_{a}"],
                    )
                    for kind in kinds
                    for a in golden.letters
                },
            ),
            *self._ends(),
            Obligation(
                "place: told when all before it is done and no pulse is under way; the next block "
                "starts there",
                [*known, self.placing],
                {
                    "kind": ghosts["accepted_kind"] == PLACE,
                    "alone": z3.And(state["next"] == 0, state["current"] == 0),
                    "quiet": self.inputs["quiet"] == 1,
                    "answered": z3.Implies(z3.Not(self.flush), after["queue_done"] == 1),
                }
                | {f"inside {kind}": ghosts[f"inside_{kind}"] == 0 for kind in kinds}
                | {
                    f"at {a}": self.out[f"place_{a}"] == ghosts[f"accepted_end_{a}"]
                    for a in letters
                }
                | {
                    f"from {a}": after[f"place_{a}"] == ghosts[f"accepted_end_{a}"] for a in letters
                },
            ),
            Obligation(
                "flush: nothing is accepted, handed over or taken, and nothing is left; the next "
                "block starts where the machine is",
                [*known, self.flush],
                {
                    "no block": z3.Not(z3.Or(self.accept, gone)),
                    "no step": z3.Not(taken),
                    "empty": z3.And([after[name] == 0 for name in ("head", "next", "current")]),
                    "no answer": z3.And(
                        after["queue_done"] == 0, *[after[f"{kind}_ended"] == 0 for kind in kinds]
                    ),
                }
                | {
                    f"from {a}": after[f"place_{a}"] == self.inputs[f"position_{a}"]
                    for a in golden.letters
                },
            ),
        ]

    def _handing_over(self, gone: z3.BoolRef) -> list[Obligation]:
        """Give what is promised of a block before it runs."""
        golden, state, after, ghosts = self.golden, self.state, self.after, self.ghosts
        known, kinds = self.known, self.golden.kinds
        ways = [self.placing, self.unknown, *self.handed.values()]
        handed = z3.Or(self.unknown, *self.handed.values())
        fields = {
            f"{kind} {name}": (
                self.handed[kind],
                self.out[f"{kind}_blocks_{name}"] == ghosts[f"accepted_{name}"],
            )
            for kind in kinds
            for name in (*(f"end_{a}" for a in golden.letters), *golden.own_fields(kind))
        }
        fields |= {
            f"{kind} start {a}": (
                self.handed[kind],
                self.out[f"{kind}_blocks_start_{a}"] == ghosts[f"lead_{a}"],
            )
            for kind in kinds
            for a in golden.letters
        }
        fields |= {
            f"{kind} kind": (self.handed[kind], ghosts["accepted_kind"] == CODES[kind])
            for kind in kinds
        }
        stays = z3.And(state["head"] == 1, z3.Not(gone), z3.Not(self.flush))
        return [
            Obligation(
                "accepted: a block waits, with all its fields, until it goes or a flush",
                known,
                {
                    "waits": z3.Implies(z3.Or(self.accept, stays), after["head"] == 1),
                    "one": z3.Implies(self.accept, state["head"] == 0),
                }
                | {
                    name: z3.Implies(
                        after["head"] == 1,
                        after[f"head_{name}"] == self.ghosts_after[f"accepted_{name}"],
                    )
                    for name in golden.fields()
                },
            ),
            Obligation(
                "handed over: a block goes just once, to the interpolator of its kind, as it was "
                "accepted; it starts where the one before it ends, where the machine was at a "
                "flush, or at the place that was told",
                known,
                {
                    "once": z3.Implies(gone, z3.And(state["head"] == 1, after["head"] == 0)),
                    "one way": z3.AtMost(*ways, 1),
                }
                | {name: z3.Implies(when, fact) for name, (when, fact) in fields.items()},
            ),
            Obligation(
                "in order: a block is handed over when none is next, and is next then, with its "
                "speed and path; one that there is no interpolator for is to be refused",
                [*known, handed],
                {
                    "free": state["next"] == 0,
                    "next": after["next"] == 1,
                    "kind": after["next_kind"] == ghosts["accepted_kind"],
                    "ahead": after["next_ahead"] == ghosts["accepted_ahead"],
                    "unknown": z3.Implies(self.unknown, after["next_refusal"] == UNKNOWN),
                }
                | {
                    name: after[f"next_{name}"] == ghosts[f"accepted_{name}"]
                    for name in ("feed_mantissa", "feed_exponent")
                },
            ),
        ]

    def _ends(self) -> list[Obligation]:
        """Give what is promised of blocks that begin and end."""
        state, after, known, kinds = self.state, self.after, self.known, self.golden.kinds
        ends, flush = self.ends(), self.flush
        done = z3.And(ends, z3.Not(self.refused))
        moved = ("kind", "feed_mantissa", "feed_exponent")
        stays = z3.And(state["current"] == 1, z3.Not(ends), z3.Not(flush))
        codes = {
            kind: z3.And(
                state["current"] == 1,
                state["current_kind"] == CODES[kind],
                self.inputs[f"{kind}_error"] != 0,
            )
            for kind in kinds
        }
        errors = {
            f"code {kind}": z3.Implies(
                z3.And(codes[kind], state["current_answered"] == 0),
                self.out["refusal"] == self.inputs[f"{kind}_error"] + REFUSED,
            )
            for kind in kinds
        }
        # What is refused while it is next is remembered until its turn has come.
        for kind in kinds:
            error = self.inputs[f"{kind}_error"]
            mine = z3.And(
                state["next"] == 1,
                state["next_kind"] == CODES[kind],
                state["next_answered"] == 0,
                error != 0,
                z3.Not(z3.And(state["current_kind"] == CODES[kind], self.runs())),
            )
            slot = z3.If(self.begins, after["current_refusal"], after["next_refusal"])
            errors[f"remembered {kind}"] = z3.Implies(mine, slot == error + REFUSED)
        return [
            Obligation(
                "begins: the next block becomes the current one when there is none or it ends in "
                "this very clock, and is the same block; until then it stays",
                known,
                {
                    "in turn": z3.Implies(
                        self.begins,
                        z3.And(state["next"] == 1, z3.Or(state["current"] == 0, done)),
                    ),
                    "at once": z3.Implies(
                        z3.And(state["next"] == 1, z3.Or(state["current"] == 0, done)), self.begins
                    ),
                    "kept": z3.Implies(stays, after["current"] == 1),
                    "next kept": z3.Implies(
                        z3.And(state["next"] == 1, z3.Not(self.begins), z3.Not(flush)),
                        z3.And(
                            after["next"] == 1,
                            *same({k: after[f"next_{k}"] for k in moved}, _slot(state)).values(),
                        ),
                    ),
                }
                | {
                    name: z3.Implies(self.begins, after[f"current_{name}"] == state[f"next_{name}"])
                    for name in moved
                }
                | {
                    f"as it was, {name}": z3.Implies(
                        stays, after[f"current_{name}"] == state[f"current_{name}"]
                    )
                    for name in moved
                },
            ),
            Obligation(
                "ends: a block ends with its last step or its interpolator's answer, is counted "
                "just once, and answered by done one clock later, or by its refusal at once",
                known,
                {
                    "done": (after["queue_done"] == 1)
                    == z3.And(z3.Or(done, self.placing), z3.Not(flush)),
                    "ended": z3.Implies(
                        z3.And(ends, z3.Not(self.begins), z3.Not(flush)), after["current"] == 0
                    ),
                    "refusal": z3.Implies(self.refused, ends),
                }
                | {
                    f"inside {kind}": z3.Implies(
                        z3.Not(flush),
                        self.ghosts_after[f"inside_{kind}"]
                        == z3.Sum(
                            [
                                self.bit(
                                    z3.And(
                                        after[slot] == 1,
                                        after[f"{slot}_answered"] == 0,
                                        after[f"{slot}_kind"] == CODES[kind],
                                    )
                                )
                                for slot in ("next", "current")
                            ]
                        ),
                    )
                    for kind in kinds
                },
            ),
            Obligation(
                "refused: nothing runs behind a block that is refused; the reason is its "
                "interpolator's, or that it has none",
                known,
                {
                    "nothing": z3.Implies(
                        self.refused, z3.And(z3.Not(self.begins), after["current"] == 0)
                    ),
                    "none": z3.Implies(
                        z3.And(
                            state["current"] == 1,
                            z3.And([state["current_kind"] != CODES[kind] for kind in kinds]),
                        ),
                        self.out["refusal"] == UNKNOWN,
                    ),
                    **errors,
                    "moved": z3.Implies(
                        z3.And(self.begins, state["next_answered"] == 1),
                        after["current_refusal"] == state["next_refusal"],
                    ),
                    "kept": z3.Implies(
                        z3.And(ends, state["current_answered"] == 1),
                        self.out["refusal"] == state["current_refusal"],
                    ),
                },
            ),
        ]


def _slot(state: dict) -> dict:
    """Give what is moved of the next block, by its names."""
    return {name: state[f"next_{name}"] for name in ("kind", "feed_mantissa", "feed_exponent")}
