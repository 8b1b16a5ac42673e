"""Promises of the whole device: its stops, its position, its holds, and those of its queue.

They are shown of the golden model's own source, which the device is proven equal to: an invariant
holds after reset and survives every clock from every state that satisfies it, whatever the inputs;
the promises follow. Those of the feed unit, of the pulse unit and of the interpolators are proven
of each alone. A ghost value keeps history: ``given``, the emergency of the clock before.
"""

from dataclasses import replace

import z3

from discreta.sim.golden.constant_speed import ConstantSpeed
from discreta.sim.golden.device import EMERGENCY, LIMIT, STOP, Device
from discreta.sim.golden.exact_conic import ExactConic
from discreta.sim.golden.logic import Value
from discreta.sim.golden.queue import CODES, REFUSED
from discreta.sim.proofs import queue
from discreta.sim.smt import Obligation, symbols

__all__ = ["promises"]

#: Registers that prepare the next block, or tell of the last one, while a step waits.
_PREPARING = (
    *("done", "error", "pending", "fault", "start_", "delta_", "open", "weighed", "beyond_"),
    *("way_", "chosen", "sum_down", "difference_down", "ready_", "prepared", "refused"),
    *("bare_", "room", "next_", "timer_next", "timer_ended"),
)


def promises(golden: Device) -> list[Obligation]:
    """Give everything that is promised of the device and of its queue."""
    of_queue = queue.promises(golden.queue)
    return [
        *_Clock(golden).obligations(),
        *(replace(promise, title=f"queue: {promise.title}") for promise in of_queue),
    ]


class _Clock:
    """One clock of the device: state and inputs, the state after it, and the ghost of both."""

    def __init__(self, golden: Device):
        self.golden = golden
        self.letters = golden.letters
        kinds, inputs = golden.registers(), golden.inputs()
        self.wide = max(bits for bits, _ in (kinds | inputs).values()) + 4
        self.state = symbols(kinds, self.wide)
        # An input may have the name of a register.
        given = symbols({f"in.{name}": kind for name, kind in inputs.items()}, self.wide)
        self.inputs = {name.removeprefix("in."): symbol for name, symbol in given.items()}
        self.given = symbols({"ghost.given": (1, False)}, self.wide)["ghost.given"]
        self.out = golden.outputs(self.state)
        self.after = golden.step(self.state, self.inputs)
        self.later = golden.outputs(self.after)
        self.queue_inputs = golden.queue_inputs(self.state, self.inputs)
        self.queue = golden.queue.outputs(self.state, self.queue_inputs)
        self.pulse = golden.pulse.outputs(golden.pulse_state(self.state))

        self.reason, self.next_reason = self.out["reason"], self.later["reason"]
        self.stands = self.reason != 0
        self.emergency = self.inputs["emergency"] == 1
        self.taken = self.queue["taken"] == 1
        self.accept = z3.And(self.inputs["blocks_valid"] == 1, self.out["blocks_ready"] == 1)
        #: What is seen with the next clock: the steps of all axes, −1, 0, +1.
        self.edges = {a: self.edge(a) for a in self.letters}
        self.edge_follows = z3.Or([edge != 0 for edge in self.edges.values()])

    def edge(self, a: str) -> Value:
        """Tell which way an axis is moved by the edge that is seen with the next clock."""
        outputs, golden = (self.out, self.later), self.golden.pulse
        if golden.kind == "step_direction":
            low, high = (self.level(out, a, "step") for out in outputs)
            downwards = self.level(self.later, a, "direction")
            size = z3.If(z3.And(low == 0, high == 1), z3.BitVecVal(1, self.wide), 0)
            return z3.If(downwards == 1, -size, size)
        places = []
        for out in outputs:
            first, second = (self.level(out, a, pin) for pin in "ab")
            places.append(2 * second + (first ^ second))
        gone_on = (places[1] - places[0]) & 3
        return z3.If(gone_on == 3, z3.BitVecVal(-1, self.wide), gone_on)

    def level(self, outputs: dict, a: str, pin: str) -> Value:
        """Give what a pin says, whatever its polarity."""
        pulse = self.golden.pulse
        inverted = pulse.inverted_steps if pin in ("step", "a") else pulse.inverted_directions
        value = outputs[f"pins_{a}_{pin}"]
        return 1 - value if a in inverted else value

    def waits(self, state: dict) -> z3.BoolRef:
        """Tell whether a step is pending in the pulse unit."""
        return z3.Or([state[f"pending_{a}"] & 1 != 0 for a in self.letters])

    def invariant(self, state: dict, given: Value) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        reason = state["reason"]
        return {
            "given": z3.Implies(given == 1, reason == EMERGENCY),
            "dropped": z3.Implies(
                z3.Or(reason == EMERGENCY, reason == LIMIT), state["stopping"] == 1
            ),
            "limit": z3.Implies(
                state["stopping"] == 1, z3.Or(reason == 0, reason == EMERGENCY, reason == LIMIT)
            ),
            "limited": z3.Implies(state["limited"] == 1, self.waits(state)),
            "stop": z3.Implies(reason == STOP, z3.Not(self.waits(state))),
        } | {
            f"refusal, {slot}": z3.Or(
                state[f"{slot}_refusal"] == 0, state[f"{slot}_refusal"] > REFUSED
            )
            for slot in ("next", "current")
        }

    def obligations(self) -> list[Obligation]:
        """Give everything that is promised of the device itself."""
        golden, state, after = self.golden, self.state, self.after
        reset = {name: z3.BitVecVal(value, self.wide) for name, value in golden.reset().items()}
        zero = z3.BitVecVal(0, self.wide)
        self.known = known = list(self.invariant(state, self.given).values())
        return [
            Obligation("invariant: holds after reset", [], self.invariant(reset, zero)),
            Obligation(
                "invariant: survives every clock, whatever the inputs",
                known,
                self.invariant(after, self.inputs["emergency"]),
            ),
            Obligation(
                "emergency: the device stands from the next clock on, whatever else is given, and "
                "until it is cleared no leading edge follows that clock, and no step is taken",
                known,
                {
                    "at once": z3.Implies(self.emergency, self.next_reason == EMERGENCY),
                    "no edge": z3.Implies(self.reason == EMERGENCY, z3.Not(self.edge_follows)),
                    "no step": z3.Implies(self.reason == EMERGENCY, self.pulse["steps_ready"] == 0),
                    "gone": z3.Implies(self.reason == EMERGENCY, z3.Not(self.waits(after))),
                },
            ),
            *self._standing(),
            *self._reasons(),
            Obligation(
                "position: changes by just the leading edges at the pins, and by the place that is "
                "told",
                known,
                {
                    a: self.later[f"position_{a}"]
                    == z3.If(
                        self.queue["placing"] == 1,
                        self.queue[f"place_{a}"],
                        _wrapped(self.out[f"position_{a}"] + self.edges[a], golden.width),
                    )
                    for a in self.letters
                },
            ),
            *self._hold(),
        ]

    def _standing(self) -> list[Obligation]:
        """Give what is promised while the device stands, and of its way back to work."""
        state, after, golden = self.state, self.after, self.golden
        fresh = golden.reset()
        begun_anew = {
            f"{kind}_{name}": after[f"{kind}_{name}"] == fresh[f"{kind}_{name}"]
            for kind, part in golden.interpolators
            for name in part.registers()
        }
        begun_anew |= {name: after[name] == fresh[name] for name in golden.feed.registers()}
        cleared = z3.And(self.stands, self.next_reason == 0)
        may_clear = z3.And(
            self.inputs["clear"] == 1, self.pulse["busy"] == 0, z3.Not(self.emergency)
        )
        return [
            Obligation(
                "stands: no block is accepted, no step taken; the queue is empty, the feed unit "
                "and the interpolators begin anew",
                [*self.known, self.stands],
                {
                    "no block": z3.Not(self.accept),
                    "no step": z3.Not(self.taken),
                    "nothing pending": z3.Implies(
                        z3.Not(self.waits(state)), z3.Not(self.waits(after))
                    ),
                    "no answer": after["queue_done"] == 0,
                }
                | {name: after[name] == 0 for name in ("head", "next", "current", "stop_asked")}
                | begun_anew,
            ),
            Obligation(
                "the reason stays until it is cleared, or becomes the emergency; that a block is "
                "refused becomes the limit, where a switch drops the last step before it",
                [*self.known, self.stands],
                [
                    z3.Or(
                        self.next_reason == self.reason,
                        z3.And(self.next_reason == EMERGENCY, self.emergency),
                        z3.And(
                            self.next_reason == LIMIT,
                            *(self.reason > REFUSED, state["limited"] == 1),
                        ),
                        z3.And(self.next_reason == 0, may_clear),
                    )
                ],
            ),
            Obligation(
                "clear: back to work whenever no emergency is given and no pulse is under way, and "
                "at no other time; the next block starts at the position",
                self.known,
                {
                    "when": z3.Implies(self.stands, (self.next_reason == 0) == may_clear),
                    "nothing pending": z3.Implies(cleared, z3.Not(self.waits(after))),
                }
                | {
                    f"from {a}": z3.Implies(
                        cleared, after[f"place_{a}"] == self.later[f"position_{a}"]
                    )
                    for a in self.letters
                },
            ),
        ]

    def _reasons(self) -> list[Obligation]:
        """Give what is promised of stops: which there are, and when."""
        state, after = self.state, self.after
        works = z3.Not(self.stands)
        pending = {a: state[f"pending_{a}"] for a in self.letters}
        # Towards a switch: of a step −1 or +1.
        blocked = z3.Or(
            z3.Or(
                z3.And(
                    pending[a] & 1 != 0,
                    z3.If(pending[a] < 0, state[f"at_low_{a}"], state[f"at_high_{a}"]) == 1,
                )
                for a in self.letters
            )
        )
        still = self.golden.feed.outputs(state)["still"] == 1
        idle = z3.And(z3.Not(self.taken), self.pulse["busy"] == 0)
        refusal = self.queue["refusal"]
        caused = {
            STOP: z3.And(state["stop_asked"] == 1, still, idle),
            EMERGENCY: self.emergency,
            LIMIT: state["limited"] == 1,
        }
        causes = [z3.And(self.next_reason == reason, cause) for reason, cause in caused.items()]
        return [
            Obligation(
                "reason: it stops for an emergency, a limit switch, the refusal of a block or a "
                "stop alone, and says which; the first of these goes before the others",
                [*self.known, works, self.next_reason != 0],
                {
                    "cause": z3.Or(
                        *causes,
                        z3.And(self.next_reason == refusal, refusal > REFUSED),
                    ),
                    "limit first": z3.Implies(
                        z3.And(state["limited"] == 1, z3.Not(self.emergency)),
                        self.next_reason == LIMIT,
                    ),
                    "then a refusal": z3.Implies(
                        z3.And(refusal != 0, state["limited"] == 0, z3.Not(self.emergency)),
                        self.next_reason == refusal,
                    ),
                },
            ),
            Obligation(
                "refusal: a block that is refused stops the device in the next clock",
                [*self.known, works, refusal != 0],
                [self.next_reason != 0],
            ),
            Obligation(
                "stop: asked for in one clock it is remembered until the device stands; it stands "
                "in the clock after one with no speed, no step and no pulse, and none follows",
                self.known,
                {
                    "asked": z3.Implies(
                        z3.And(works, z3.Or(self.inputs["stop"] == 1, state["stop_asked"] == 1)),
                        after["stop_asked"] == 1,
                    ),
                    "stands": z3.Implies(z3.And(works, caused[STOP]), self.next_reason != 0),
                    "no edge": z3.Implies(self.reason == STOP, z3.Not(self.edge_follows)),
                },
            ),
            Obligation(
                "limit: a step towards a switch that was active a clock before is not put out, "
                "then or later; it is told in the next clock, and in the one after the device "
                "stands, until it is cleared without any leading edge",
                self.known,
                {
                    "no edge": z3.Implies(
                        z3.Or(blocked, state["limited"] == 1, self.reason == LIMIT),
                        z3.Not(self.edge_follows),
                    ),
                    "gone": z3.Implies(self.reason == LIMIT, z3.Not(self.waits(after))),
                    "told": z3.Implies(
                        z3.And(blocked, state["stopping"] == 0), after["limited"] == 1
                    ),
                    "stands": z3.Implies(
                        z3.And(works, state["limited"] == 1),
                        z3.Or(
                            self.next_reason == LIMIT,
                            z3.And(self.emergency, self.next_reason == EMERGENCY),
                        ),
                    ),
                }
                | {
                    f"seen {side} {a}": after[f"at_{side}_{a}"] == self.inputs[f"{side}_limit_{a}"]
                    for side in ("low", "high")
                    for a in self.letters
                },
            ),
        ]

    def _hold(self) -> list[Obligation]:
        """Give what is promised under a hold, or a stop that was asked for."""
        state, after, golden = self.state, self.after, self.golden
        held = z3.Or(self.inputs["hold"] == 1, state["stop_asked"] == 1)
        still = golden.feed.outputs(state)["still"] == 1
        rests = [*self.known, z3.Not(self.stands), held, still, state["single_step"] == 0]
        rising = z3.And(
            self.inputs["single"] == 1, state["single_before"] == 0, state["stop_asked"] == 0
        )
        waiting = {}
        for kind, part in golden.interpolators:
            if isinstance(part, ExactConic):
                continue  # it prepares a block in the very registers in which it runs
            core = part.core if isinstance(part, ConstantSpeed) else part
            preparing = getattr(core, "prepared_registers", dict)()
            own = golden.part_state(state, kind, part)
            answers = core.outputs(own)
            # It answers only when no step waits; that is its own promise.
            steps = z3.And(
                part.outputs(own)["steps_valid"] == 1, answers["done"] == 0, answers["error"] == 0
            )
            waiting |= {
                f"{kind} {name}": z3.Implies(
                    steps, after[f"{kind}_{name}"] == state[f"{kind}_{name}"]
                )
                for name in part.registers()
                if name not in preparing and not name.startswith(_PREPARING)
            }
        ended = [
            z3.And(
                state["current_kind"] == CODES[kind],
                z3.Or(
                    z3.And(self.queue_inputs[f"{kind}_done"] == 1, state[f"{kind}_ended"] == 0),
                    self.queue_inputs[f"{kind}_error"] != 0,
                ),
            )
            for kind, _ in golden.interpolators
        ]
        answered = z3.Or(state["current_answered"] == 1, *ended)
        stopped = self.next_reason != 0
        return [
            Obligation(
                "hold: once it is still no step is taken and it stays still, but for a single "
                "step: that is permitted by a rising edge alone, and not after a stop",
                rests,
                {
                    "no step": z3.Not(self.taken),
                    "still": z3.Or(golden.feed.outputs(after)["still"] == 1, self.stands),
                    "single": (after["single_step"] == 1) == rising,
                },
            ),
            Obligation(
                "hold: an interpolator with a step that waits stands still in all registers of the "
                "block that runs",
                rests,
                waiting,
            ),
            Obligation(
                "hold: the queue loses nothing: a block stays where it is, goes on by one place, "
                "or is answered",
                rests,
                {
                    "head": z3.Implies(
                        state["head"] == 1,
                        z3.Or(after["head"] == 1, after["next"] == 1, self.queue["placing"] == 1),
                    ),
                    "next": z3.Implies(
                        state["next"] == 1,
                        z3.Or(after["next"] == 1, self.queue["begins"] == 1),
                    ),
                    "current": z3.Implies(
                        z3.And(state["current"] == 1, z3.Not(answered)), after["current"] == 1
                    ),
                    "begins": z3.Implies(self.queue["begins"] == 1, after["current"] == 1),
                    "done": z3.Implies(
                        z3.And(state["current"] == 1, answered),
                        z3.Or(after["queue_done"] == 1, stopped),
                    ),
                },
            ),
        ]


def _wrapped(value: Value, width: int) -> Value:
    """Keep a number that is at most one off to its signed n + 1 bits."""
    top = 2**width
    return z3.If(value == top, -top, z3.If(value == -top - 1, top - 1, value))
