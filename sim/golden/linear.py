"""Golden model of the linear interpolator, one clock at a time.

From the lecture (linear interpolation, steps 1–10) and exercise 3 (section III, steps 1–10), under
the contract common to all interpolators: blocks come by a valid/ready handshake and are prepared
one ahead; steps leave by a valid/ready handshake, one clock after the summation that carried.

A state is a dict from register name to value. Numbers are as in the documents: SX and SY hold the
sums modulo M = 2^n; :mod:`discreta.sim.golden.line_frame` names the others.
"""

from dataclasses import dataclass

from discreta.sim.golden.line_frame import LineFrame, State
from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["Linear"]


@dataclass(frozen=True)
class Linear(LineFrame):
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
    def initial_sum(self) -> int:
        """What the summators start from."""
        return {"zero": 0, "half": 2 ** (self.width - 1)}[self.preload]

    def names(self, a: str) -> tuple[str, str, str, str]:
        """Name an axis's increment, position, remaining count and summator."""
        return (*self.places(a), f"s{a}")

    def sums(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every summator and whether it is signed."""
        return {f"s{a}": (self.width, False) for a in self.letters}

    def initial_sums(self) -> dict[str, int]:
        """Give what every summator starts a block from."""
        return dict.fromkeys(self.sums(), self.initial_sum)

    def summed(self, state: State, clock: Value) -> tuple[State, State]:
        """Give the steps that a summation puts out, by axis letter, and every summator after it."""
        steps: State = {}
        sums: State = {}
        for a in self.letters:
            increment, _, remaining, summator = self.names(a)
            # Lecture, steps 8 to 10: add, look for a carry, move, count down.
            total = state[summator] + state[increment]
            adds = clock & negate(equal(state[remaining], 0))
            steps[a] = adds & negate(less(total, 2**self.width))
            sums[summator] = where(adds, total & (2**self.width - 1), state[summator])
        return steps, sums

    def increments(self, state: State) -> State:
        """Give what the increments of the prepared block are, by axis letter."""
        return self._increments(state)

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
