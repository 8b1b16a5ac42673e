"""Golden model of the pulse unit: steps become pulses with the timings of motor drivers.

Numbers: ``age_x`` clocks for which the pulse of an axis has been in or out, this one included, and
``direction_age_x`` the same of its direction; both stay at 4095, which is longer than any timing
asks for. ``pending_x`` is the step of the axis that waits to be put out. ``length``, ``space``,
``setup``, ``hold`` are the timings in force, ``stopping``, ``at_low_x``, ``at_high_x`` the inputs
of the clock before. ``phase_x`` are the two pins of an axis's quadrature, a in the low bit.
"""

from dataclasses import dataclass

from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["FOREVER", "PulseUnit", "State"]

State = dict[str, Value]

#: The most clocks that are counted.
FOREVER = 2**12 - 1

#: The timings in force, and the inputs that they come from.
TIMINGS = {
    "length": "pulse_length",
    "space": "pulse_space",
    "setup": "direction_setup",
    "hold": "direction_hold",
}


@dataclass(frozen=True)
class PulseUnit:
    """The pulse unit with positions of n + 1 = ``width`` + 1 bits.

    Attributes
    ----------
    width, axes : int
    kind : str
        ``"step_direction"`` or ``"quadrature"``.
    inverted_steps, inverted_directions : str
        Letters of the axes whose first or second pin is active low.
    """

    width: int = 16
    axes: int = 2
    kind: str = "step_direction"
    inverted_steps: str = ""
    inverted_directions: str = ""

    @property
    def letters(self) -> str:
        """The axis letters."""
        return "xyzabc"[: self.axes]

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        kinds: dict[str, tuple[int, bool]] = {}
        shapes = {
            "pending": (2, True),
            "pulse": (1, False),
            "age": (12, False),
            "direction": (1, False),
            "direction_age": (12, False),
            "position": (self.width + 1, True),
            "at_low": (1, False),
            "at_high": (1, False),
        }
        if self.kind == "quadrature":
            shapes["phase"] = (2, False)
        for a in self.letters:
            kinds |= {f"{name}_{a}": shape for name, shape in shapes.items()}
        kinds |= dict.fromkeys(("stopping", "limited"), (1, False))
        return kinds | dict.fromkeys(TIMINGS, (12, False))

    def reset(self) -> State:
        """Give the state after reset: no pulse and no turn for as long as is counted."""
        ages = [f"{name}_{a}" for name in ("age", "direction_age") for a in self.letters]
        return dict.fromkeys(self.registers(), 0) | dict.fromkeys(ages, FOREVER)

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        stopping, waiting = state["stopping"], self._waiting(state)
        out = {
            "steps_ready": negate(stopping) & (negate(waiting) | self._launch(state)),
            "busy": self._busy(state),
            "limited": state["limited"],
        }
        for a in self.letters:
            if self.kind == "quadrature":
                names = ("a", "b")
                levels = (state[f"phase_{a}"] & 1, state[f"phase_{a}"] >> 1)
            else:
                names = ("step", "direction")
                levels = (state[f"pulse_{a}"], state[f"direction_{a}"])
            out[f"pins_{a}_{names[0]}"] = levels[0] ^ int(a in self.inverted_steps)
            out[f"pins_{a}_{names[1]}"] = levels[1] ^ int(a in self.inverted_directions)
            out[f"position_{a}"] = state[f"position_{a}"]
        return out

    def step(self, state: State, inputs: dict[str, Value]) -> State:
        """Give the state after one clock.

        ``inputs``: ``steps_valid``, ``steps_x``…, ``load``, ``initial_x``…, ``stop``,
        ``low_limit_x``…, ``high_limit_x``…, ``pulse_length``, ``pulse_space``,
        ``direction_setup``, ``direction_hold``.
        """
        stopping, waiting = state["stopping"], self._waiting(state)
        blocked, launch = self._blocked(state), self._launch(state)
        free = self._free(state)
        busy = self._busy(state)
        accept = inputs["steps_valid"] & self.outputs(state)["steps_ready"]
        after: State = {"stopping": inputs["stop"], "limited": blocked & negate(stopping)}
        for name, port in TIMINGS.items():
            after[name] = where(busy, state[name], inputs[port])
        for a in self.letters:
            pulse, age, direction = state[f"pulse_{a}"], state[f"age_{a}"], state[f"direction_{a}"]
            moves, downwards = self._moves(state, a), self._downwards(state, a)
            pending = where(launch | negate(waiting) | stopping, 0, state[f"pending_{a}"])
            after[f"pending_{a}"] = where(accept, inputs[f"steps_{a}"], pending)

            # The pulse, which is in and out for as long as it has to be.
            rises = launch & moves
            falls = pulse & negate(less(age, state["length"]))
            after[f"pulse_{a}"] = where(rises, 1, where(falls, 0, pulse))
            after[f"age_{a}"] = where(rises | falls, 1, self._older(age))

            # The direction turns when the last pulse is over and H behind it.
            wrong = direction ^ downwards
            held = negate(pulse) & negate(less(age, state["hold"]))
            turns = free & moves & wrong & held
            after[f"direction_{a}"] = where(turns, downwards, direction)
            older = self._older(state[f"direction_age_{a}"])
            after[f"direction_age_{a}"] = where(turns, 1, older)

            moved = self._wrap(state[f"position_{a}"] + where(rises, where(downwards, -1, 1), 0))
            after[f"position_{a}"] = where(inputs["load"], inputs[f"initial_{a}"], moved)
            after[f"at_low_{a}"] = inputs[f"low_limit_{a}"]
            after[f"at_high_{a}"] = inputs[f"high_limit_{a}"]
            if self.kind == "quadrature":
                phase = state[f"phase_{a}"]
                first, second = phase & 1, phase >> 1
                up = negate(second) | (first << 1)
                down = second | (negate(first) << 1)
                after[f"phase_{a}"] = where(rises, where(downwards, down, up), phase)
        return after

    def _moves(self, state: State, a: str) -> Value:
        """Tell whether the pending step moves an axis: it is odd, −1 or +1."""
        return state[f"pending_{a}"] & 1

    def _downwards(self, state: State, a: str) -> Value:
        return less(state[f"pending_{a}"], 0)

    def _waiting(self, state: State) -> Value:
        waiting: Value = 0
        for a in self.letters:
            waiting = waiting | self._moves(state, a)
        return waiting

    def _blocked(self, state: State) -> Value:
        """Tell whether an axis of the pending step leads towards an active limit switch."""
        blocked: Value = 0
        for a in self.letters:
            switch = where(self._downwards(state, a), state[f"at_low_{a}"], state[f"at_high_{a}"])
            blocked = blocked | (self._moves(state, a) & switch)
        return blocked

    def _free(self, state: State) -> Value:
        """Tell whether a step waits for nothing but time; a switch keeps it a clock longer."""
        free = self._waiting(state) & negate(state["stopping"])
        return free & negate(self._blocked(state)) & negate(state["limited"])

    def _rested(self, state: State, a: str) -> Value:
        """Tell whether the space behind an axis's last pulse has passed with this clock."""
        return negate(state[f"pulse_{a}"]) & negate(less(state[f"age_{a}"], state["space"]))

    def _launch(self, state: State) -> Value:
        """Tell whether all pulses of the pending step begin with the next clock."""
        launch = self._free(state)
        for a in self.letters:
            right = negate(state[f"direction_{a}"] ^ self._downwards(state, a))
            set_up = negate(less(state[f"direction_age_{a}"], state["setup"]))
            due = self._rested(state, a) & right & set_up
            launch = launch & (negate(self._moves(state, a)) | due)
        return launch

    def _busy(self, state: State) -> Value:
        busy = self._waiting(state)
        for a in self.letters:
            busy = busy | negate(self._rested(state, a))
        return busy

    def _older(self, age: Value) -> Value:
        return where(equal(age, FOREVER), FOREVER, age + 1)

    def _wrap(self, value: Value) -> Value:
        """Keep a signed number to its n + 1 bits."""
        half = 2**self.width
        return ((value + half) & (2 * half - 1)) - half
