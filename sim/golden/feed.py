"""Golden model of the feed unit, one clock at a time.

From exercise 3: the speed F makes start pulses, a step on both axes is followed by a longer pause
than one on a single axis. Override, ramp, pairing and single step are ours.

A state is ``product`` (F's significand times the override) and ``exponent``, ``target`` the speed
to reach, ``velocity`` v and ``braking`` B, the way that braking from v takes, ``to_go`` the path
left, ``rate`` the speed that counts, ``debt`` what is left of the pause, ``cell`` the axes of the
move, ``single_before`` and ``single_step``.

Fraction bits: 48 of speeds, accelerations and ``debt``; 23 of ``product``; 35 of B; 8 of ``to_go``
and of pauses. On NumPy arrays B must lie below 2^63: it does in every state that can be reached,
and the register is twice as long.
"""

from collections.abc import Callable
from dataclasses import dataclass

from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["FeedUnit"]

State = dict[str, Value]
Tell = Callable[[str, Value], Value]

#: The speed of a step per clock, and the pause and the path of a step on one axis.
ONE = 2**48
STEP = 256


def _keep(_name: str, value: Value) -> Value:
    """Reckon with a value itself."""
    return value


@dataclass(frozen=True)
class FeedUnit:
    """The speed-setting block (БЗС).

    Attributes
    ----------
    axes : int
        2 to 6.
    pauses : tuple of int
        After a step on 1, 2, … axes, in 1/256.
    pairing : bool
        Steps on different axes that follow each other are one move.
    """

    axes: int = 2
    pauses: tuple[int, ...] = (256, 362)
    pairing: bool = True

    @property
    def letters(self) -> str:
        """The axis letters."""
        return "xyzabc"[: self.axes]

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        return {
            "product": (25, False),
            "exponent": (5, False),
            "target": (49, False),
            "velocity": (49, False),
            "braking": (64, False),
            "to_go": (36, False),
            "rate": (49, False),
            "debt": (51, True),
            "cell": (self.axes, False),
            "single_before": (1, False),
            "single_step": (1, False),
        }

    def reset(self) -> State:
        """Give the state after reset: at rest, nothing owed."""
        return dict.fromkeys(self.registers(), 0) | {"to_go": STEP}

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        moving = negate(equal(state["rate"], 0))
        stands = equal(state["target"], 0) & equal(state["velocity"], 0)
        return {
            "permit": state["single_step"] | (less(state["debt"], 1) & moving),
            "still": stands & negate(moving),
        }

    def step(self, state: State, inputs: dict[str, Value], tell: Tell = _keep) -> State:
        """Give the state after one clock.

        ``inputs``: ``active``, ``begins``, ``feed_mantissa``, ``feed_exponent``, ``ahead``,
        ``taken``, ``even``, ``moves_x``, ``moves_y`` …, ``override``, ``acceleration``, ``hold``,
        ``single``. ``tell`` is told the name of every partial sum of the product, ``sum_1`` to
        ``sum_8``, and gives what to go on with.
        """
        after = self._target(state, inputs, tell) | self._ramp(state, inputs)
        after |= self._pause(state, inputs)
        rises = inputs["single"] & negate(state["single_before"])
        moves: Value = 0
        for a in self.letters:
            moves = moves | inputs[f"moves_{a}"]
        waits = state["single_step"] & negate(inputs["taken"] & moves)
        after["single_before"] = inputs["single"]
        after["single_step"] = inputs["hold"] & (rises | waits)
        return after

    def _target(self, state: State, inputs: dict[str, Value], tell: Tell) -> State:
        """Reckon min(F·o, 1)."""
        override = inputs["override"]
        override = where(less(256, override), 256, override)
        significand = 2**16 + inputs["feed_mantissa"]
        product = where(override & 1, significand, 0)
        for place in range(1, 9):
            row = where(override >> place & 1, significand << place, 0)
            product = tell(f"sum_{place}", (product + row) & (2**25 - 1))
        speed = (state["product"] << 25) >> state["exponent"]
        speed = where(less(ONE, speed), ONE, speed)
        return {
            "product": where(inputs["active"], product, 0),
            "exponent": inputs["feed_exponent"],
            "target": where(inputs["active"] & negate(inputs["hold"]), speed, 0),
        }

    def _ramp(self, state: State, inputs: dict[str, Value]) -> State:
        """Let v climb and fall, B with it; the rate follows."""
        v, target, braking = state["velocity"], state["target"], state["braking"]
        a = inputs["acceleration"]
        above = negate(less(v, target + a))
        # A target of 0 is reached however small v is, also where a has grown since.
        falls = negate(less(braking >> 27, state["to_go"])) | above | equal(target, 0)
        climbs = negate(falls) & less(v, target)
        slower = where(less(v, a), 0, v - a)
        released = slower >> 13
        emptied = equal(slower, 0) | less(braking, released)
        fallen = where(emptied, 0, braking - released)
        climbed = braking + (v >> 13)
        # The 65th bit, in shifts that an array has room for.
        climbed = climbed - (climbed >> 63 >> 1 << 63 << 1)
        faster = (v + a) & (2**49 - 1)
        ramped = inputs["active"] & negate(equal(a, 0))
        rate = where(above | less(v, target), v, target)
        return {
            "velocity": where(ramped, where(falls, slower, where(climbs, faster, v)), 0),
            "braking": where(ramped, where(falls, fallen, where(climbs, climbed, braking)), 0),
            "rate": where(inputs["active"], where(equal(a, 0), target, rate), 0),
        }

    def _pause(self, state: State, inputs: dict[str, Value]) -> State:
        """Reckon what is left of the pause, and of the path."""
        taken, cell, even = inputs["taken"], state["cell"], inputs["even"]
        moves: Value = 0
        for place, a in enumerate(self.letters):
            moves = moves | inputs[f"moves_{a}"] << place
        joins = negate(equal(cell, 0)) & equal(cell & moves, 0) if self.pairing else 0 * moves
        together = where(joins, cell | moves, moves)
        cost = self._pause_of(together) - where(joins, self._pause_of(cell), 0)
        # Ticks of an interpolator at constant speed are all as long.
        cost = where(even, STEP, cost)

        debt, rate = state["debt"], state["rate"]
        owed = where(less(debt, 0), debt, 0) + (cost << 40)
        owed = where(less(owed, 0), 0, owed)
        waited = where(less(0, debt), debt - rate, debt)
        left = where(less(state["to_go"], cost + STEP), STEP, state["to_go"] - cost)
        ahead = where(equal(inputs["ahead"], 0), STEP, inputs["ahead"] << 8)
        return {
            "debt": where(taken, owed - rate, waited),
            "cell": where(taken, where(even, 0, together), cell),
            "to_go": where(inputs["begins"], ahead, where(taken, left, state["to_go"])),
        }

    def _pause_of(self, axes: Value) -> Value:
        """Give the pause after a step on these axes; none after none."""
        count: Value = 0
        for place in range(self.axes):
            count = count + (axes >> place & 1)
        pause: Value = 0 * axes
        for number, value in enumerate(self.pauses, start=1):
            pause = where(equal(count, number), value, pause)
        return pause
