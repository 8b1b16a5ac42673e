"""Golden model of the whole device with one block that waits, one clock at a time.

From exercise 3, figure 3.3: interpolator, speed-setting block and output device. It wires the
golden models of its parts; stops, limits and pulses are ours.

A state is that of all parts: the pulse unit, the feed unit, ``reason`` why the device stands still
and ``stop_asked``, the queue, and every interpolator, its registers behind its kind (``line_p1``).
The pulse unit's ``hold`` is ``pulse_hold`` here, where ``hold`` is an input.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from discreta.sim.golden.conic import Conic
from discreta.sim.golden.constant_speed import ConstantSpeed, constant_arc, constant_line
from discreta.sim.golden.exact_conic import ExactConic
from discreta.sim.golden.feed import FeedUnit
from discreta.sim.golden.logic import Value, equal, negate, where
from discreta.sim.golden.pulse import TIMINGS, PulseUnit
from discreta.sim.golden.queue import BlockQueue

__all__ = ["EMERGENCY", "INTERPOLATORS", "LIMIT", "STOP", "Device", "State", "make_device"]

State = dict[str, Value]
Tell = Callable[[str, Value], Value]

#: Why a device stands still: its own reasons; the others are the queue's refusals.
STOP, EMERGENCY, LIMIT = 1, 2, 3

#: The interpolators of a device that is made by its kinds.
INTERPOLATORS: dict[str, Callable[[int], Any]] = {
    "line": constant_line,
    "arc": constant_arc,
    "conic": ExactConic,
}

#: Registers whose part calls them by the name of an input of the device.
_RENAMED = {"hold": "pulse_hold"}


def _keep(_name: str, value: Value) -> Value:
    """Reckon with a value itself."""
    return value


@dataclass(frozen=True)
class Device:
    """The whole device, of a queue of depth 1.

    Attributes
    ----------
    interpolators : tuple of (str, object)
        The golden models, each with its kind: in the order line, arc, conic.
    feed : FeedUnit
    pulse : PulseUnit
    """

    interpolators: tuple[tuple[str, Any], ...]
    feed: FeedUnit
    pulse: PulseUnit

    @property
    def queue(self) -> BlockQueue:
        """The block queue."""
        kinds = tuple(kind for kind, _ in self.interpolators)
        steady = tuple(kind for kind, part in self.interpolators if isinstance(part, ConstantSpeed))
        return BlockQueue(self.width, self.axes, kinds, steady)

    @property
    def width(self) -> int:
        """n."""
        return self.pulse.width

    @property
    def axes(self) -> int:
        """How many axes."""
        return self.pulse.axes

    @property
    def letters(self) -> str:
        """The axis letters."""
        return self.pulse.letters

    def inputs(self) -> dict[str, tuple[int, bool]]:
        """Give width and sign of every input."""
        kinds = {f"blocks_{name}": kind for name, kind in self.queue.fields().items()}
        kinds |= {"blocks_valid": (1, False), "override": (9, False), "acceleration": (40, False)}
        flags = ("hold", "single", "stop", "emergency", "clear")
        switches = [f"{side}_limit_{a}" for side in ("low", "high") for a in self.letters]
        kinds |= dict.fromkeys((*flags, *switches), (1, False))
        return kinds | dict.fromkeys(TIMINGS.values(), (12, False))

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        kinds = {_RENAMED.get(name, name): kind for name, kind in self.pulse.registers().items()}
        kinds |= self.feed.registers()
        kinds |= {"reason": (3, False), "stop_asked": (1, False)}
        kinds |= self.queue.registers()
        for which, part in self.interpolators:
            kinds |= {f"{which}_{name}": kind for name, kind in part.registers().items()}
        return kinds

    def reset(self) -> State:
        """Give the state after reset: nothing queued, standing at the origin."""
        state: State = {"reason": 0, "stop_asked": 0}
        state |= self.pulse_named(self.pulse.reset()) | self.feed.reset() | self.queue.reset()
        for kind, part in self.interpolators:
            state |= {f"{kind}_{name}": value for name, value in part.reset().items()}
        return state

    def pulse_named(self, state: State) -> State:
        """Call the pulse unit's registers by their names in the device."""
        return {_RENAMED.get(name, name): value for name, value in state.items()}

    def pulse_state(self, state: State) -> State:
        """Give the pulse unit's registers, by its own names."""
        return {name: state[_RENAMED.get(name, name)] for name in self.pulse.registers()}

    def part_state(self, state: State, kind: str, part: Any) -> State:
        """Give an interpolator's registers, by its own names."""
        return {name: state[f"{kind}_{name}"] for name in part.registers()}

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        pulse = self.pulse.outputs(self.pulse_state(state))
        stands = negate(equal(state["reason"], 0))
        out = {
            "blocks_ready": negate(state["head"]) & negate(stands),
            "busy": state["head"] | state["next"] | state["current"] | pulse["busy"],
            "done": state["queue_done"],
            "reason": state["reason"],
        }
        return out | {
            name: value for name, value in pulse.items() if name.startswith(("pins_", "position_"))
        }

    def queue_inputs(self, state: State, inputs: dict[str, Value]) -> dict[str, Value]:
        """Give what the queue's inputs are in a clock."""
        pulse = self.pulse.outputs(self.pulse_state(state))
        given = {name: inputs[name] for name in inputs if name.startswith("blocks_")}
        for kind, part in self.interpolators:
            shown = part.outputs(self.part_state(state, kind, part))
            wanted = ("blocks_ready", "steps_valid", "steps_last", "done", "error")
            steps = [f"steps_{a}" for a in self.letters]
            given |= {f"{kind}_{name}": shown[name] for name in (*wanted, *steps)}
        given |= {
            "flush": negate(equal(state["reason"], 0)),
            "quiet": negate(pulse["busy"]),
            "permit": self.feed.outputs(state)["permit"],
            "steps_ready": pulse["steps_ready"],
        }
        return given | {f"position_{a}": pulse[f"position_{a}"] for a in self.letters}

    def step(
        self,
        state: State,
        inputs: dict[str, Value],
        tell: Tell = _keep,
    ) -> State:
        """Give the state after one clock.

        ``inputs``: those of :meth:`inputs`. ``tell`` is told the values between the registers that
        have a name: ``taken`` (a step leaves its interpolator), those of the feed unit, and those
        that an interpolator names, behind its kind; it gives what is reckoned with instead.
        """
        stands = negate(equal(state["reason"], 0))
        queue_inputs = self.queue_inputs(state, inputs)
        queue = self.queue.outputs(state, queue_inputs)
        queue["taken"] = tell("taken", queue["taken"])
        after = self.queue.step(state, queue_inputs)

        # While the device stands, whatever could run begins anew.
        for kind, part in self.interpolators:
            prefix = f"{kind}_"
            offered = {
                name.removeprefix(prefix): value
                for name, value in queue.items()
                if name.startswith((f"{kind}_blocks_", f"{kind}_steps_"))
            }
            named = _named(tell, prefix) if isinstance(part, (Conic, ExactConic)) else ()
            later = part.step(self.part_state(state, kind, part), offered, *named)
            fresh = part.reset()
            after |= {prefix + name: where(stands, fresh[name], later[name]) for name in fresh}
        feed_inputs = {name: queue[name] for name in ("active", "begins", "taken", "even", "ahead")}
        feed_inputs |= {name: queue[name] for name in ("feed_mantissa", "feed_exponent")}
        feed_inputs |= {name: inputs[name] for name in ("override", "acceleration")}
        feed_inputs |= {
            "hold": inputs["hold"] | state["stop_asked"],
            "single": inputs["single"] & negate(state["stop_asked"]),
        }
        feed_inputs |= {f"moves_{a}": negate(equal(queue[f"steps_{a}"], 0)) for a in self.letters}
        later, fresh = self.feed.step(state, feed_inputs, tell), self.feed.reset()
        after |= {name: where(stands, fresh[name], later[name]) for name in fresh}

        pulse = self.pulse.outputs(self.pulse_state(state))
        emergency, reason = inputs["emergency"], state["reason"]
        pulse_inputs = inputs | {f"initial_{a}": queue[f"place_{a}"] for a in self.letters}
        pulse_inputs |= {f"steps_{a}": queue[f"steps_{a}"] for a in self.letters}
        pulse_inputs |= {
            "steps_valid": queue["steps_valid"],
            "load": queue["placing"],
            "stop": emergency | pulse["limited"] | equal(reason, EMERGENCY) | equal(reason, LIMIT),
        }
        after |= self.pulse_named(self.pulse.step(self.pulse_state(state), pulse_inputs))

        # Why the device stands still: the first of these there is.
        goes_on = queue["taken"] | pulse["busy"] | negate(self.feed.outputs(state)["still"])
        slowed = state["stop_asked"] & negate(goes_on)
        why = where(slowed, STOP, reason)
        why = where(equal(queue["refusal"], 0), why, queue["refusal"])
        cleared = where(inputs["clear"] & negate(pulse["busy"]), 0, reason)
        why = where(stands, cleared, why)
        why = where(pulse["limited"] & negate(equal(reason, EMERGENCY)), LIMIT, why)
        after["reason"] = where(emergency, EMERGENCY, why)
        after["stop_asked"] = (inputs["stop"] | state["stop_asked"]) & negate(stands)
        return after


def _named(tell: Tell, prefix: str) -> tuple[Tell]:
    """Give the hook of an interpolator that names values between its registers."""
    return (lambda name, value: tell(prefix + name, value),)


def make_device(
    width: int = 16,
    kinds: tuple[str, ...] = ("line", "arc"),
    pins: str = "step_direction",
    pairing: bool = True,
) -> Device:
    """Make the model of a device in the plane, its interpolators with their default parameters."""
    return Device(
        tuple((kind, INTERPOLATORS[kind](width)) for kind in INTERPOLATORS if kind in kinds),
        FeedUnit(2, pairing=pairing),
        PulseUnit(width, 2, pins),
    )
