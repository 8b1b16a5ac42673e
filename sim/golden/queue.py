"""Golden model of the block queue of depth 1, one clock at a time.

From exercise 3 (extra tasks 1 and 3: support points run one behind the other); that the blocks are
of several kinds is ours, as is PLACE, which tells where the machine stands.

A state is the block that waits (``head``, and its fields ``head_``), the block that is handed over
(``next``, with ``next_ahead``) and the one that runs (``current``): of both ``_kind``, ``_feed_``,
``_answered`` (its interpolator has answered: nothing more comes of it) and ``_refusal`` (why it was
refused); ``place_`` where the next block starts, ``<kind>_ended`` that the last step of a block was
taken a clock ago, and ``queue_done``. A register that means nothing for the moment keeps what it
has, or what came by: also that is part of the model.
"""

from dataclasses import dataclass

from discreta.sim.golden.logic import Value, equal, negate, where

__all__ = ["CODES", "PLACE", "UNKNOWN", "BlockQueue", "State"]

State = dict[str, Value]

#: What the kinds of blocks are called in a block.
CODES = {"line": 0, "arc": 1, "conic": 2}
PLACE = 3

#: Reasons for a refusal: an interpolator's error and 3, or no interpolator.
REFUSED, UNKNOWN = 3, 7


@dataclass(frozen=True)
class BlockQueue:
    """The block queue with one block that waits.

    Attributes
    ----------
    width : int
        n of all interpolators.
    axes : int
        2 to 6.
    kinds : tuple of str
        Which interpolators there are: of ``"line"``, ``"arc"``, ``"conic"``.
    steady : tuple of str
        Those of them whose steps come in ticks of equal length.
    """

    width: int = 16
    axes: int = 2
    kinds: tuple[str, ...] = ("line",)
    steady: tuple[str, ...] = ()

    @property
    def letters(self) -> str:
        """The axis letters."""
        return "xyzabc"[: self.axes]

    def own_fields(self, kind: str) -> dict[str, tuple[int, bool]]:
        """Give the fields that a kind of blocks has besides start and end: width and sign."""
        n = self.width
        ticked = {"pace": (n + 13, False)} if kind in self.steady else {}
        if ticked and kind == "arc" and self.axes > 2:
            ticked["ticks"] = (n + 11, False)
        center = {f"center_{a}": (n + 1, True) for a in "xy"}
        return {
            "line": ticked,
            "arc": {**center, "clockwise": (1, False), "full_turns": (8, False), **ticked},
            "conic": {
                **dict.fromkeys("abc", (n + 4, True)),
                **dict.fromkeys("de", (2 * n + 5, True)),
                "clockwise": (1, False),
                "turns": (11, False),
            },
        }[kind]

    def fields(self) -> dict[str, tuple[int, bool]]:
        """Give the fields of a block: width and sign."""
        kinds: dict[str, tuple[int, bool]] = {
            "kind": (2, False),
            "feed_mantissa": (16, False),
            "feed_exponent": (5, False),
            "ahead": (28, False),
            **{f"end_{a}": (self.width + 1, True) for a in self.letters},
        }
        for kind in self.kinds:
            kinds |= self.own_fields(kind)
        return kinds

    def inputs(self) -> dict[str, tuple[int, bool]]:
        """Give width and sign of every input."""
        kinds: dict[str, tuple[int, bool]] = {
            f"blocks_{name}": kind for name, kind in self.fields().items()
        }
        kinds["blocks_valid"] = (1, False)
        for kind in self.kinds:
            kinds |= {f"{kind}_steps_{a}": (2, True) for a in self.letters}
            flags = ("blocks_ready", "steps_valid", "steps_last", "done")
            kinds |= {f"{kind}_{name}": (1, False) for name in flags}
            kinds[f"{kind}_error"] = (2, False)
        kinds |= dict.fromkeys(("flush", "quiet", "permit", "steps_ready"), (1, False))
        return kinds | {f"position_{a}": (self.width + 1, True) for a in self.letters}

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        kinds: dict[str, tuple[int, bool]] = {}
        for slot in ("current", "next"):
            kinds |= {
                slot: (1, False),
                f"{slot}_kind": (2, False),
                f"{slot}_answered": (1, False),
                f"{slot}_refusal": (3, False),
                f"{slot}_feed_mantissa": (16, False),
                f"{slot}_feed_exponent": (5, False),
            }
        kinds |= {"next_ahead": (28, False), "head": (1, False)}
        kinds |= {f"head_{name}": kind for name, kind in self.fields().items()}
        kinds |= {f"place_{a}": (self.width + 1, True) for a in self.letters}
        return kinds | dict.fromkeys(
            [f"{k}_ended" for k in self.kinds] + ["queue_done"], (1, False)
        )

    def reset(self) -> State:
        """Give the state after reset: empty, at the origin."""
        return dict.fromkeys(self.registers(), 0)

    def outputs(self, state: State, inputs: dict[str, Value]) -> dict[str, Value]:
        """Give what the ports show in a state under these inputs."""
        flush = inputs["flush"]
        free = state["head"] & negate(state["next"]) & negate(flush)
        passes = inputs["permit"] & negate(flush)
        out = {
            "blocks_ready": negate(state["head"]) & negate(flush),
            "active": state["current"],
            "even": self._even(state),
            "feed_mantissa": state["current_feed_mantissa"],
            "feed_exponent": state["current_feed_exponent"],
            "ahead": state["next_ahead"],
            "placing": free
            & equal(state["head_kind"], PLACE)
            & negate(state["current"])
            & inputs["quiet"],
            "busy": state["head"] | state["next"] | state["current"],
            "done": state["queue_done"],
        }
        out |= {f"place_{a}": state[f"head_end_{a}"] for a in self.letters}
        out |= {f"steps_{a}": 0 * flush for a in self.letters}
        out["steps_valid"] = out["taken"] = 0 * flush
        for kind in self.kinds:
            mine = equal(state["head_kind"], CODES[kind])
            out[f"{kind}_blocks_valid"] = free & mine
            out |= {f"{kind}_blocks_start_{a}": state[f"place_{a}"] for a in self.letters}
            out |= {f"{kind}_blocks_end_{a}": state[f"head_end_{a}"] for a in self.letters}
            out |= {
                f"{kind}_blocks_{name}": state[f"head_{name}"] for name in self.own_fields(kind)
            }
            # The steps of the current block go by.
            runs = self._runs(state, kind)
            out[f"{kind}_steps_ready"] = runs & passes & inputs["steps_ready"]
            waits = passes & inputs[f"{kind}_steps_valid"]
            out["steps_valid"] = where(runs, waits, out["steps_valid"])
            for a in self.letters:
                name = f"steps_{a}"
                out[name] = where(runs, inputs[f"{kind}_{name}"], out[name])
        out["taken"] = out["steps_valid"] & inputs["steps_ready"]
        ended, refusal = self._end(state, inputs, out["taken"])
        out["refusal"] = where(ended, refusal, 0)
        may_begin = negate(state["current"]) | (ended & equal(refusal, 0))
        out["begins"] = state["next"] & may_begin
        return out

    def step(self, state: State, inputs: dict[str, Value]) -> State:
        """Give the state after one clock."""
        out = self.outputs(state, inputs)
        flush, taken, begins = inputs["flush"], out["taken"], out["begins"]
        free = state["head"] & negate(state["next"]) & negate(flush)
        handed: Value = 0
        known = equal(state["head_kind"], PLACE)
        for kind in self.kinds:
            handed = handed | (out[f"{kind}_blocks_valid"] & inputs[f"{kind}_blocks_ready"])
            known = known | equal(state["head_kind"], CODES[kind])
        unknown = free & negate(known)
        follows = handed | unknown
        goes = follows | out["placing"]
        accept = inputs["blocks_valid"] & out["blocks_ready"]

        after = {"head": where(flush | goes, 0, where(accept, 1, state["head"]))}
        for name in self.fields():
            after[f"head_{name}"] = where(accept, inputs[f"blocks_{name}"], state[f"head_{name}"])
        for a in self.letters:
            place = where(handed | out["placing"], state[f"head_end_{a}"], state[f"place_{a}"])
            after[f"place_{a}"] = where(flush, inputs[f"position_{a}"], place)

        # The one that is next: what was answered of it is kept, until it is the current one.
        answered, refusal = self._next_answer(state, inputs)
        after |= {
            "next": where(follows, 1, where(begins, 0, state["next"])) & negate(flush),
            "next_answered": where(follows, unknown, answered),
            "next_refusal": where(follows, where(unknown, UNKNOWN, 0), refusal),
        }
        for name in ("kind", "feed_mantissa", "feed_exponent", "ahead"):
            after[f"next_{name}"] = where(follows, state[f"head_{name}"], state[f"next_{name}"])

        ended, why = self._end(state, inputs, taken)
        after |= {
            "current": where(begins, 1, where(ended, 0, state["current"])) & negate(flush),
            "current_answered": where(begins, answered, state["current_answered"]),
            "current_refusal": where(begins, refusal, state["current_refusal"]),
            "queue_done": ((ended & equal(why, 0)) | out["placing"]) & negate(flush),
        }
        for name in ("kind", "feed_mantissa", "feed_exponent"):
            name = f"current_{name}"
            value = state[name.replace("current", "next")]
            after[name] = where(begins, value, state[name])
        for kind in self.kinds:
            last = self._runs(state, kind) & taken & inputs[f"{kind}_steps_last"]
            after[f"{kind}_ended"] = last & negate(flush)
        return after

    def _even(self, state: State) -> Value:
        """Tell whether the current block's steps come in ticks."""
        even = 0 * state["current"]
        for kind in self.steady:
            even = even | equal(state["current_kind"], CODES[kind])
        return even

    def _runs(self, state: State, kind: str) -> Value:
        """Tell whether the current block is of a kind, and still to be run."""
        of_kind = equal(state["current_kind"], CODES[kind])
        return state["current"] & negate(state["current_answered"]) & of_kind

    def _answer(self, state: State, inputs: dict[str, Value], kind: str) -> tuple[Value, Value]:
        """Tell whether an interpolator answers for a block without last step, and a refusal.

        ``done`` after a last step was taken is the answer of a block that has ended already.
        """
        error = inputs[f"{kind}_error"]
        refused = negate(equal(error, 0))
        answers = (inputs[f"{kind}_done"] & negate(state[f"{kind}_ended"])) | refused
        return answers, where(refused, error + REFUSED, 0)

    def _end(self, state: State, inputs: dict[str, Value], taken: Value) -> tuple[Value, Value]:
        """Tell whether the current block ends in this clock, and the reason if it is refused."""
        ends, why = state["current_answered"], state["current_refusal"]
        for kind in self.kinds:
            answers, refusal = self._answer(state, inputs, kind)
            runs = self._runs(state, kind)
            ends = where(runs, answers | (taken & inputs[f"{kind}_steps_last"]), ends)
            why = where(runs, refusal, why)
        return state["current"] & ends, why

    def _next_answer(self, state: State, inputs: dict[str, Value]) -> tuple[Value, Value]:
        """Give what is answered of the block that is next, by now: an answer, and a refusal."""
        answered, why = state["next_answered"], state["next_refusal"]
        for kind in self.kinds:
            answers, refusal = self._answer(state, inputs, kind)
            of_kind = equal(state["next_kind"], CODES[kind])
            mine = answers & of_kind & negate(self._runs(state, kind))
            answered, why = where(mine, 1, answered), where(mine, refusal, why)
        return answered, why
