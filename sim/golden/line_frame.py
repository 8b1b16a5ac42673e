"""What the golden models of all line interpolators have in common: the frame of the summation.

Blocks come by a valid/ready handshake, are brought into the first quadrant and prepared one ahead;
УУ starts, clocks and ends them; steps wait, get their signs back, move the position when they are
taken and leave by a valid/ready handshake, one clock after the summation that put them out. What is
summed, and when that is a step, the models themselves say.

Numbers are as in the documents: P1, P2 hold DX and DY (of the linear interpolator shifted left when
normalized), P3, P4 hold XT and YT (signed), P5, P6 hold KOX and KOY; with more than two axes the
cells' own names carry the axis letter. Around them stand the prepared block (``start_``,
``delta_``, ``negative_``, ``fault``, ``pending``), the step that waits to be taken (``pulse_``,
with the block's ``direction_``), and УУ: ``running``, ``done``, ``error``.
"""

from abc import ABC, abstractmethod

from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["LineFrame", "State"]

State = dict[str, Value]


class LineFrame(ABC):
    """A line interpolator of n = ``width`` bits in ``axes`` axes, but for what it sums.

    A model tells what its summation is by :meth:`sums`, :meth:`summed`, :meth:`increments` and
    :meth:`initial_sums`.
    """

    width: int
    axes: int = 2

    @property
    def letters(self) -> str:
        """The axis letters."""
        return "xyzabc"[: self.axes]

    def places(self, a: str) -> tuple[str, str, str]:
        """Name an axis's increment, position and remaining count."""
        if self.axes > 2:
            return f"d{a}", f"{a}t", f"ko{a}"
        return ("p1", "p3", "p5") if a == "x" else ("p2", "p4", "p6")

    @abstractmethod
    def sums(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every summator and whether it is signed."""

    @abstractmethod
    def summed(self, state: State, clock: Value) -> tuple[State, State]:
        """Give the steps that a summation puts out, by axis letter, and every summator after it.

        Without ``clock`` nothing is summed: no steps, and the summators as they are.
        """

    def increments(self, state: State) -> State:
        """Give what the increments of the prepared block are, by axis letter."""
        return {a: state[f"delta_{a}"] for a in self.letters}

    def initial_sums(self) -> dict[str, int]:
        """Give what every summator starts a block from."""
        return dict.fromkeys(self.sums(), 0)

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        n = self.width
        kinds: dict[str, tuple[int, bool]] = {}
        for a in self.letters:
            increment, position, remaining = self.places(a)
            kinds |= {
                increment: (n, False),
                position: (n + 1, True),
                remaining: (n, False),
                f"pulse_{a}": (1, False),
                f"direction_{a}": (1, False),
                f"start_{a}": (n + 1, True),
                f"delta_{a}": (n, False),
                f"negative_{a}": (1, False),
            }
        kinds |= dict.fromkeys(("pending", "running", "done"), (1, False))
        return kinds | self.sums() | dict.fromkeys(("fault", "error"), (2, False))

    def reset(self) -> State:
        """Give the state after reset."""
        return dict.fromkeys(self.registers(), 0) | self.initial_sums()

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
            out[f"position_{a}"] = state[self.places(a)[1]]
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

        increments = self.increments(state)
        put_out, sums = self.summed(state, clock)
        after = {
            name: where(load, self.initial_sums()[name], total) for name, total in sums.items()
        }
        steps_left: Value = 0
        fault: Value = 0
        for a in self.letters:
            increment, position, remaining = self.places(a)
            # A count of none left stays.
            counted = put_out[a] & negate(equal(state[remaining], 0))
            after[remaining] = state[remaining] - counted
            steps_left = steps_left | after[remaining]

            # Output processing: the step waits, and moves its axis when it is taken.
            pulse, direction = state[f"pulse_{a}"], state[f"direction_{a}"]
            after[f"pulse_{a}"] = where(clock, put_out[a], where(taken, 0, pulse))
            move = where(taken & pulse, where(direction, -1, 1), 0)
            after[position] = self._wrap(state[position] + move)

            # Lecture, steps 2 and 3: a block is loaded.
            after[increment] = where(load, increments[a], state[increment])
            after[position] = where(load, state[f"start_{a}"], after[position])
            after[remaining] = where(load, state[f"delta_{a}"], after[remaining])
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

    def _wrap(self, value: Value) -> Value:
        """Keep a signed number to its n + 1 bits."""
        half = 2**self.width
        return ((value + half) & (2 * half - 1)) - half
