"""Golden model of two-stage interpolation, one clock at a time.

From the lecture (linear interpolation) with the carrier period as the modulus, fed with the whole
increments that the Ukrainian lecture's constant-carrier methods put out once a period: within a
period an axis sums its increment every clock, and steps when the sum comes to as many clocks as the
period has.

A state is that of the first stage, and ``fine_p1``, ``fine_p2`` the increments of this period,
``fine_p5``, ``fine_p6`` the steps left of them, ``fine_sx``, ``fine_sy`` the sums, ``span`` the
clocks of this period and ``clocks_left``, ``fine_direction_``, ``fine_last``, ``fine_running``;
``step_x``, ``step_y``, ``step_last`` the step that waits; XT, YT the coordinates; ``open`` and
``fine_done``.
"""

from dataclasses import dataclass
from typing import Any

from discreta.sim.golden.carrier import PERIOD_BITS, signed
from discreta.sim.golden.carrier_circular import CarrierCircular
from discreta.sim.golden.carrier_linear import CarrierLinear
from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["TwoStage", "two_stage_circular", "two_stage_linear"]

State = dict[str, Value]

#: By axis: increment, steps left.
NAMES = {"x": ("fine_p1", "fine_p5"), "y": ("fine_p2", "fine_p6")}


@dataclass(frozen=True)
class TwoStage:
    """A constant-carrier interpolator and behind it the linear one.

    Attributes
    ----------
    coarse : CarrierLinear or CarrierCircular
        The first stage.
    """

    coarse: CarrierLinear | CarrierCircular

    def __getattr__(self, name: str) -> Any:
        """Give the parameters of the first stage as its own."""
        if name.startswith("_") or name == "coarse":
            raise AttributeError(name)
        return getattr(self.coarse, name)

    @property
    def bits(self) -> int:
        """Bits of a period's clocks."""
        return max(PERIOD_BITS, self.width + 2)

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        n = self.width
        names = [name for pair in NAMES.values() for name in pair]
        kinds: dict[str, tuple[int, bool]] = dict.fromkeys(names, (n + 2, False))
        kinds |= dict.fromkeys(("fine_sx", "fine_sy", "span", "clocks_left"), (self.bits, False))
        flags = ("fine_direction_x", "fine_direction_y", "fine_last", "fine_running", "open")
        kinds |= dict.fromkeys((*flags, "fine_done", "step_last"), (1, False))
        kinds |= dict.fromkeys(("step_x", "step_y"), (2, True))
        return kinds | dict.fromkeys(("xt", "yt"), (n + 1, True)) | self.coarse.registers()

    def reset(self) -> State:
        """Give the state after reset."""
        # The first increments there are belong to a new block.
        state: State = dict.fromkeys(self.registers(), 0) | {"fine_last": 1}
        return state | self.coarse.reset()

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        first = self.coarse.outputs(state, state["open"])
        out = {name: first[name] for name in ("blocks_ready", "error")}
        out |= {
            "steps_valid": self._waiting(state),
            "steps_last": state["step_last"],
            "busy": first["busy"] | state["open"],
            "done": state["fine_done"],
        }
        for a in "xy":
            out |= {f"steps_{a}": state[f"step_{a}"], f"position_{a}": state[f"{a}t"]}
        return out

    def step(self, state: State, inputs: dict[str, Value]) -> State:
        """Give the state after one clock.

        ``inputs``: those of the first stage.
        """
        waiting = self._waiting(state)
        taken = waiting & inputs["steps_ready"]
        free = negate(waiting) | inputs["steps_ready"]
        clock = state["fine_running"] & free
        last_clock = equal(state["clocks_left"], 1)
        take = state["waiting"] & free & (negate(state["fine_running"]) | last_clock)
        # A new block loads the position: the one before it has to be done with it.
        closes = negate(state["open"]) | (taken & state["step_last"])
        take = take & (negate(state["fine_last"]) | closes)
        first = self.coarse.outputs(state, state["open"])
        begins_empty = (
            self.coarse.start(state, take, state["open"])
            & equal(self.coarse.fault(state), 0)
            & self.coarse.empty(state)
        )
        after = self.coarse.step(state, inputs | {"steps_ready": take}, state["open"])

        nothing = equal(first["steps_x"], 0) & equal(first["steps_y"], 0)
        nothing_more = take & first["steps_last"] & nothing

        # A period lasts T clocks, or as many as it has steps.
        lengths = {
            a: where(less(first[f"steps_{a}"], 0), 0 - first[f"steps_{a}"], first[f"steps_{a}"])
            for a in "xy"
        }
        longer = where(less(lengths["x"], lengths["y"]), lengths["y"], lengths["x"])
        span = where(less(state["period"], longer), longer, state["period"])
        after["span"] = where(take, span, state["span"])
        counted = (state["clocks_left"] - clock) & (2**self.bits - 1)
        after["clocks_left"] = where(take, span, counted)
        after["fine_last"] = where(take, first["steps_last"], state["fine_last"])
        runs_on = where(clock & last_clock, 0, state["fine_running"])
        after["fine_running"] = where(take, 1, runs_on)

        # Lecture, steps 8 to 10: add, look for a carry, move, count down.
        all_gone: Value = 1
        some_carry: Value = 0
        for a, (increment, left) in NAMES.items():
            total = state[f"fine_s{a}"] + state[increment]
            carry = clock & negate(less(total, state["span"]))
            some_carry = some_carry | carry
            rest = where(carry, total - state["span"], total) & (2**self.bits - 1)
            summed = where(clock, rest, state[f"fine_s{a}"])
            preload = span >> 1 if self.coarse.preload == "half" else 0
            after[f"fine_s{a}"] = where(take, preload, summed)
            after[increment] = where(take, lengths[a], state[increment])
            gone = (state[left] - carry) & (2 ** (self.width + 2) - 1)
            after[left] = where(take, lengths[a], gone)
            all_gone = all_gone & equal(state[left], carry)
            negative = less(first[f"steps_{a}"], 0)
            direction = state[f"fine_direction_{a}"]
            after[f"fine_direction_{a}"] = where(take, negative, direction)
            step = where(carry, where(direction, -1, 1), 0)
            after[f"step_{a}"] = where(clock, step, where(taken, 0, state[f"step_{a}"]))
            moved = signed(state[f"{a}t"] + state[f"step_{a}"], self.width + 1)
            moved = where(taken, moved, state[f"{a}t"])
            moved = where(take & state["fine_last"], first[f"position_{a}"], moved)
            after[f"{a}t"] = where(begins_empty, state[f"start_{a}"], moved)
        last = (state["fine_last"] & all_gone) | nothing_more
        after["step_last"] = where(clock, last, state["step_last"])

        # A block without a last step is answered at once.
        stepless = nothing_more & negate(some_carry)
        answered = (taken & state["step_last"]) | stepless | begins_empty
        after["fine_done"] = answered
        after["open"] = where(take, negate(stepless), where(answered, 0, state["open"]))
        return after

    def _waiting(self, state: State) -> Value:
        return negate(equal(state["step_x"], 0) & equal(state["step_y"], 0))


def two_stage_linear(width: int = 16, preload: str = "half") -> TwoStage:
    """Make the model of a line in two stages."""
    return TwoStage(CarrierLinear(width, preload))


def two_stage_circular(
    width: int = 16,
    formula: str = "rotation",
    coefficient: str = "series",
    preload: str = "half",
) -> TwoStage:
    """Make the model of an arc in two stages."""
    return TwoStage(CarrierCircular(width, formula, coefficient, preload))
