"""Golden model of the linear interpolator, one clock at a time.

From the lecture (linear interpolation, steps 1–10) and exercise 3 (section III, steps 1–10), under
the contract common to all interpolators: blocks come by a valid/ready handshake and are prepared
one ahead; steps leave by a valid/ready handshake, one clock after the summation that carried.

A state is a dict from register name to value. Numbers are as in the documents: P1, P2 hold DX and
DY (shifted left when normalized), P3, P4 hold XT and YT (signed), P5, P6 hold KOX and KOY, SX and
SY the sums modulo M = 2^n; with more than two axes the cells' own names carry the axis letter.
Around them stand the prepared block (``start_``, ``delta_``, ``negative_``, ``fault``,
``pending``), the step that waits to be taken (``pulse_``, with the block's ``direction_``), and УУ:
``running``, ``done``, ``error``.
"""

from dataclasses import dataclass

from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["Linear"]

State = dict[str, Value]


@dataclass(frozen=True)
class Linear:
    """The linear interpolator of n = ``width`` bits in ``axes`` axes.

    Attributes
    ----------
    width : int
        n, 4 to 32.
    axes : int
        2 to 6.
    normalize : bool
        Shift the increments left together until one has its top bit set.
    preload : str
        ``"zero"`` or ``"half"``: the summators start at 0 or M/2.
    """

    width: int = 16
    axes: int = 2
    normalize: bool = True
    preload: str = "half"

    @property
    def letters(self) -> str:
        """The axis letters."""
        return "xyzabc"[: self.axes]

    @property
    def initial_sum(self) -> int:
        """What the summators start from."""
        return {"zero": 0, "half": 2 ** (self.width - 1)}[self.preload]

    def names(self, a: str) -> tuple[str, str, str, str]:
        """Name an axis's increment, position, remaining count and summator."""
        if self.axes > 2:
            return f"d{a}", f"{a}t", f"ko{a}", f"s{a}"
        return ("p1", "p3", "p5", "sx") if a == "x" else ("p2", "p4", "p6", "sy")

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        n = self.width
        kinds: dict[str, tuple[int, bool]] = {}
        for a in self.letters:
            increment, position, remaining, summator = self.names(a)
            kinds |= {
                increment: (n, False),
                position: (n + 1, True),
                remaining: (n, False),
                summator: (n, False),
                f"pulse_{a}": (1, False),
                f"direction_{a}": (1, False),
                f"start_{a}": (n + 1, True),
                f"delta_{a}": (n, False),
                f"negative_{a}": (1, False),
            }
        kinds |= dict.fromkeys(("pending", "running", "done"), (1, False))
        return kinds | dict.fromkeys(("fault", "error"), (2, False))

    def reset(self) -> State:
        """Give the state after reset."""
        state: State = dict.fromkeys(self.registers(), 0)
        return state | {self.names(a)[3]: self.initial_sum for a in self.letters}

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        waiting = self._waiting(state)
        idle = negate(state["running"]) & negate(waiting)
        out = {
            "blocks_ready": negate(state["pending"]) | idle,
            "steps_valid": waiting,
            "steps_last": negate(state["running"]),
            "busy": state["pending"] | negate(idle),
            "done": state["done"],
            "error": state["error"],
        }
        for a in self.letters:
            pulse, direction = state[f"pulse_{a}"], state[f"direction_{a}"]
            out[f"steps_{a}"] = where(pulse, where(direction, -1, 1), 0)
            out[f"position_{a}"] = state[self.names(a)[1]]
        return out

    def step(self, state: State, inputs: dict[str, Value]) -> State:
        """Give the state after one clock.

        ``inputs``: ``blocks_valid``, ``blocks_start_x``…, ``blocks_end_x``…, ``steps_ready``.
        """
        waiting = self._waiting(state)
        taken = waiting & inputs["steps_ready"]
        free = negate(waiting) | inputs["steps_ready"]
        empty: Value = 1
        for a in self.letters:
            empty = empty & equal(state[f"delta_{a}"], 0)
        # A block with nothing to sum lets the step before it go first: one answer a clock.
        sound = equal(state["fault"], 0)
        next_may = where(empty | negate(sound), negate(waiting), free)
        start = state["pending"] & negate(state["running"]) & next_may
        load = start & sound
        clock = state["running"] & free
        accept = inputs["blocks_valid"] & self.outputs(state)["blocks_ready"]

        after: State = {}
        increments = self._increments(state)
        steps_left: Value = 0
        fault: Value = 0
        for a in self.letters:
            increment, position, remaining, summator = self.names(a)

            # Lecture, steps 8 to 10: add, look for a carry, move, count down.
            total = state[summator] + state[increment]
            adds = clock & negate(equal(state[remaining], 0))
            carry = adds & negate(less(total, 2**self.width))
            after[summator] = where(adds, total & (2**self.width - 1), state[summator])
            after[remaining] = state[remaining] - carry
            steps_left = steps_left | after[remaining]

            # Output processing: the step waits, and moves its axis when it is taken.
            pulse, direction = state[f"pulse_{a}"], state[f"direction_{a}"]
            after[f"pulse_{a}"] = where(clock, carry, where(taken, 0, pulse))
            move = where(taken & pulse, where(direction, -1, 1), 0)
            after[position] = self._wrap(state[position] + move)

            # Lecture, steps 2 and 3: a block is loaded.
            after[increment] = where(load, increments[a], state[increment])
            after[position] = where(load, state[f"start_{a}"], after[position])
            after[remaining] = where(load, state[f"delta_{a}"], after[remaining])
            after[summator] = where(load, self.initial_sum, after[summator])
            after[f"direction_{a}"] = where(load, state[f"negative_{a}"], direction)

            # Input processing: a block is brought into the first quadrant.
            begin = inputs[f"blocks_start_{a}"]
            difference = inputs[f"blocks_end_{a}"] - begin
            negative = less(difference, 0)
            distance = where(negative, 0 - difference, difference)
            fault = fault | negate(less(distance, 2**self.width))
            after[f"start_{a}"] = where(accept, begin, state[f"start_{a}"])
            after[f"delta_{a}"] = where(accept, distance & (2**self.width - 1), state[f"delta_{a}"])
            after[f"negative_{a}"] = where(accept, negative, state[f"negative_{a}"])

        finished = clock & equal(steps_left, 0)
        after["running"] = where(load, negate(empty), where(finished, 0, state["running"]))
        after["done"] = (taken & negate(state["running"])) | (load & empty)
        after["error"] = where(start, state["fault"], 0)
        after["pending"] = where(accept, 1, where(start, 0, state["pending"]))
        after["fault"] = where(accept, fault, state["fault"])
        return after

    def _waiting(self, state: State) -> Value:
        waiting: Value = 0
        for a in self.letters:
            waiting = waiting | state[f"pulse_{a}"]
        return waiting

    def _increments(self, state: State) -> State:
        """Give the prepared block's increments, shifted one place at a time as in the lecture."""
        increments = {a: state[f"delta_{a}"] for a in self.letters}
        if not self.normalize:
            return increments
        for _ in range(self.width - 1):
            together: Value = 0
            for value in increments.values():
                together = together | value
            small = less(together, 2 ** (self.width - 1))
            increments = {a: where(small, value << 1, value) for a, value in increments.items()}
        return increments

    def _wrap(self, position: Value) -> Value:
        """Keep a coordinate to its n + 1 signed bits."""
        half = 2**self.width
        return ((position + half) & (2 * half - 1)) - half
