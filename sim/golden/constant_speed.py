"""Golden model of constant speed along the path, one clock at a time.

The steps of an exact line or arc are spread over ticks of equal length of path. From the two laws:
a line's leading axis steps every length/L ticks, and a point that moves along a circle at a
constant speed sweeps over equal areas in equal times, R/2 for every step of length.

A state is that of the core, and ``timer_debt``, how much path was made more than was paid for by
ticks: in 2^-(n + 12) steps of a line, in 2^-12 of the radius times a step of an arc. It begins half
a tick below 0, and below 0 the next step is due. ``timer_x``, ``timer_y`` is the point seen from
the centre. Of axes beyond two, which move along an arc in ``ticks``: ``zt`` position, ``koz`` steps
left, ``sz`` sum, ``timer_way_z``, ``timer_negative_z``. ``timer_here`` says that a block runs,
``timer_next`` that the one behind it has been accepted; its values are in ``next_``. Of the last
step ``timer_ended`` is left for a clock.
"""

from dataclasses import dataclass

from discreta.sim.golden.exact_arc import ExactArc
from discreta.sim.golden.exact_line import ExactLine
from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["ConstantSpeed", "State", "constant_arc", "constant_line"]

State = dict[str, Value]

OFF_CURVE = 2
#: Fraction bits of an arc's pace.
FRACTION = 12


@dataclass(frozen=True)
class ConstantSpeed:
    """An exact line or arc whose steps are spread over ticks.

    Attributes
    ----------
    core : ExactLine or ExactArc
    axes : int
        2 to 6; of an arc those beyond two move along it.
    """

    core: ExactLine | ExactArc
    axes: int = 2

    @property
    def width(self) -> int:
        """n."""
        return self.core.width

    @property
    def letters(self) -> str:
        """The axis letters."""
        return "xyzabc"[: self.axes]

    @property
    def round(self) -> bool:
        """Whether it draws arcs."""
        return isinstance(self.core, ExactArc)

    @property
    def along(self) -> str:
        """The letters of the axes that move along an arc."""
        return self.letters[2:] if self.round else ""

    @property
    def pace_bits(self) -> int:
        """Bits of the field ``pace``."""
        return self.width + FRACTION + 1

    @property
    def ticks_bits(self) -> int:
        """Bits of the field ``ticks``: 8·R·2^8 fits."""
        return self.width + 11

    def inputs(self) -> dict[str, tuple[int, bool]]:
        """Give width and sign of the fields that a block has beyond the core's own."""
        kinds = {f"blocks_{side}_{a}": (self.width + 1, True) for a in self.along for side in _ENDS}
        kinds["blocks_pace"] = (self.pace_bits, False)
        return kinds | ({"blocks_ticks": (self.ticks_bits, False)} if self.along else {})

    def own_registers(self) -> dict[str, tuple[int, bool]]:
        """Give width and sign of the registers besides the core's."""
        n, pace, flag = self.width, (self.pace_bits, False), (1, False)
        kinds = {"timer_debt": (self.pace_bits + 2, True), "timer_pace": pace, "next_pace": pace}
        kinds |= dict.fromkeys(("timer_here", "timer_next", "timer_ended"), flag)
        if self.round:
            kinds |= dict.fromkeys(("timer_full", "timer_clockwise", "next_clockwise"), flag)
            kinds |= dict.fromkeys(("timer_x", "timer_y", "next_x", "next_y"), (n + 2, True))
        if self.along:
            kinds |= dict.fromkeys(("ticks", "next_ticks"), (self.ticks_bits, False))
        for a in self.along:
            kinds |= dict.fromkeys((f"{a}t", f"next_start_{a}"), (n + 1, True))
            kinds |= dict.fromkeys((f"ko{a}", f"timer_way_{a}"), (n + 1, False))
            kinds |= {f"s{a}": (self.ticks_bits, False), f"timer_negative_{a}": flag}
            kinds[f"next_way_{a}"] = (n + 2, True)
        return kinds

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        return self.own_registers() | self.core.registers()

    def reset(self) -> State:
        """Give the state after reset: nothing held."""
        return dict.fromkeys(self.own_registers(), 0) | self.core.reset()

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        first = self.core.outputs(state)
        due, moves = self._due(state, first), self._further(state, first)
        lost = self._lost(state, first)
        out = {
            "blocks_ready": first["blocks_ready"] & negate(state["timer_next"]),
            "steps_valid": first["steps_valid"] & state["timer_here"],
            "steps_last": first["steps_last"] & due,
            "busy": first["busy"] | state["timer_here"] | state["timer_next"],
            "done": first["done"] & negate(lost),
            "error": where(lost, OFF_CURVE, first["error"]),
        }
        for a in self.letters:
            if a in self.along:
                back = state[f"timer_negative_{a}"]
                out[f"steps_{a}"] = where(moves[a], where(back, -1, 1), 0)
                out[f"position_{a}"] = state[f"{a}t"]
            else:
                out[f"steps_{a}"] = where(due, first[f"steps_{a}"], 0)
                out[f"position_{a}"] = first[f"position_{a}"]
        return out

    def step(self, state: State, inputs: dict[str, Value]) -> State:
        """Give the state after one clock.

        ``inputs``: the core's, and those of :meth:`inputs`.
        """
        first, shown = self.core.outputs(state), self.outputs(state)
        due = self._due(state, first)
        here, behind = state["timer_here"], state["timer_next"]
        tick = shown["steps_valid"] & inputs["steps_ready"]
        offers = inputs["blocks_valid"] & negate(behind)
        taken = {"steps_ready": inputs["steps_ready"] & here & due, "blocks_valid": offers}
        after = self.core.step(state, inputs | taken)

        accept = offers & first["blocks_ready"]
        ended = tick & due & first["steps_last"]
        refused = negate(equal(first["error"], 0))
        answered = (first["done"] & negate(state["timer_ended"])) | refused
        leaves = here & (ended | answered)
        load = behind & (negate(here) | leaves)
        after |= {
            "timer_here": load | (here & negate(leaves)),
            "timer_next": accept | (behind & negate(load)),
            "timer_ended": ended,
            "next_pace": where(accept, inputs["blocks_pace"], state["next_pace"]),
            "timer_pace": where(load, state["next_pace"], state["timer_pace"]),
        }
        debt = state["timer_debt"]
        if self.round:
            after |= self._seen(state, inputs, accept, load, tick & due, first)
            paid = state["timer_pace"]
            length = self._area(state, first) << FRACTION
            begin = 0 - (state["next_pace"] >> 1)
            # A last step that waits for further axes leaves the debt alone.
            counts = tick & (due | negate(less(debt, 0)))
        else:
            paid = 1 << (self.width + FRACTION)
            length = paid + state["timer_pace"]
            begin, counts = -(paid >> 1), tick
        made = self._signed(debt - paid + where(due, length, 0), self.pace_bits + 2)
        after["timer_debt"] = where(load, begin, where(counts, made, debt))
        for a in self.along:
            after |= self._moved(state, inputs, a, accept, load, tick, shown[f"steps_{a}"])
        if self.along:
            after["next_ticks"] = where(accept, inputs["blocks_ticks"], state["next_ticks"])
            after["ticks"] = where(load, state["next_ticks"], state["ticks"])
        return after

    def _due(self, state: State, first: dict[str, Value]) -> Value:
        """Tell whether this tick carries the step that waits in the core."""
        due = less(state["timer_debt"], 0)
        if self.round:
            due = due | state["timer_full"]
        held: Value = 0
        for a in self.along:
            held = held | less(1, state[f"ko{a}"])
        return due & negate(first["steps_last"] & held)

    def _further(self, state: State, first: dict[str, Value]) -> dict[str, Value]:
        """Tell which further axes move in this tick."""
        final = self._due(state, first) & first["steps_last"]
        moves = {}
        for a in self.along:
            total = state[f"s{a}"] + state[f"timer_way_{a}"]
            carry = negate(less(total, state["ticks"]))
            moves[a] = less(0, state[f"ko{a}"]) & (final | carry)
        return moves

    def _lost(self, state: State, first: dict[str, Value]) -> Value:
        """Tell whether an arc was answered that had no step to take further axes along."""
        left: Value = 0
        for a in self.along:
            left = left | less(0, state[f"ko{a}"])
        return first["done"] & negate(state["timer_ended"]) & state["timer_here"] & left

    def _area(self, state: State, first: dict[str, Value]) -> Value:
        """Give twice the area that the step sweeps over, X·dY − Y·dX as the arc runs."""
        x, y = state["timer_x"], state["timer_y"]
        dx, dy = first["steps_x"], first["steps_y"]
        by_y = where(less(dy, 0), 0 - x, where(equal(dy, 0), 0, x))
        by_x = where(less(dx, 0), y, where(equal(dx, 0), 0, 0 - y))
        area = by_y + by_x
        return where(state["timer_clockwise"], 0 - area, area)

    def _seen(
        self,
        state: State,
        inputs: dict[str, Value],
        accept: Value,
        load: Value,
        made: Value,
        first: dict[str, Value],
    ) -> State:
        """Go on with the point seen from the centre."""
        after: State = {
            "timer_full": where(load, equal(state["next_pace"], 0), state["timer_full"])
        }
        for a in "xy":
            seen = inputs[f"blocks_start_{a}"] - inputs[f"blocks_center_{a}"]
            after[f"next_{a}"] = where(accept, seen, state[f"next_{a}"])
            moved = self._signed(state[f"timer_{a}"] + first[f"steps_{a}"], self.width + 2)
            goes_on = where(made, moved, state[f"timer_{a}"])
            after[f"timer_{a}"] = where(load, state[f"next_{a}"], goes_on)
        way = inputs["blocks_clockwise"]
        after["next_clockwise"] = where(accept, way, state["next_clockwise"])
        after["timer_clockwise"] = where(load, state["next_clockwise"], state["timer_clockwise"])
        return after

    def _moved(
        self,
        state: State,
        inputs: dict[str, Value],
        a: str,
        accept: Value,
        load: Value,
        tick: Value,
        step: Value,
    ) -> State:
        """Go on with an axis that moves along the arc."""
        start, way = inputs[f"blocks_start_{a}"], state[f"next_way_{a}"]
        length = where(less(way, 0), 0 - way, way) & (2 ** (self.width + 1) - 1)
        total = state[f"s{a}"] + state[f"timer_way_{a}"]
        rest = where(less(total, state["ticks"]), total, total - state["ticks"])
        ticked = {
            f"{a}t": self._signed(state[f"{a}t"] + step, self.width + 1),
            f"ko{a}": state[f"ko{a}"] - negate(equal(step, 0)),
            f"s{a}": rest & (2**self.ticks_bits - 1),
        }
        loaded = {
            f"{a}t": state[f"next_start_{a}"],
            f"ko{a}": length,
            f"s{a}": state["next_ticks"] >> 1,
            f"timer_way_{a}": length,
            f"timer_negative_{a}": less(way, 0),
        }
        after = {
            name: where(load, value, where(tick, ticked.get(name, state[name]), state[name]))
            for name, value in loaded.items()
        }
        begin = where(accept, start, state[f"next_start_{a}"])
        after[f"next_start_{a}"] = begin
        after[f"next_way_{a}"] = where(accept, inputs[f"blocks_end_{a}"] - start, way)
        return after

    def _signed(self, value: Value, bits: int) -> Value:
        """Take the low bits of a value as a signed number."""
        return ((value + 2 ** (bits - 1)) & (2**bits - 1)) - 2 ** (bits - 1)


_ENDS = ("start", "end")


def constant_line(width: int = 16, axes: int = 2) -> ConstantSpeed:
    """Make the model of an exact line at constant speed."""
    return ConstantSpeed(ExactLine(width, axes), axes)


def constant_arc(width: int = 16, axes: int = 2) -> ConstantSpeed:
    """Make the model of an exact arc at constant speed."""
    return ConstantSpeed(ExactArc(width), axes)
