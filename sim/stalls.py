"""Seeded stall patterns: the same on every engine, and a function of the clock alone."""

from dataclasses import dataclass

__all__ = ["NO_STALLS", "Stalls"]

_MASK = (1 << 64) - 1


def _draw(seed: int, clock: int, channel: int) -> int:
    """Draw 32 bits: SplitMix64 (Steele, Lea, Flood 2014) of seed, clock and channel."""
    z = (seed + (2 * clock + channel + 1) * 0x9E3779B97F4A7C15) & _MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return (z ^ (z >> 31)) >> 32


@dataclass(frozen=True)
class Stalls:
    """When a step is not taken and when no block is offered.

    Attributes
    ----------
    seed : int
        Names the pattern; 0 to 2^64 − 1.
    stall : float
        Part of the clocks, 0 to 1, in which ``steps_ready`` is low.
    gap : float
        Part of the clocks, 0 to 1, in which no new block is offered. A block once offered stays.
    """

    seed: int = 0
    stall: float = 0.0
    gap: float = 0.0

    def __post_init__(self):
        if not 0 <= self.seed <= _MASK:
            raise ValueError(f"seed is {self.seed}: choose a whole number from 0 to 2^64 - 1")
        for what, value in (("stall", self.stall), ("gap", self.gap)):
            if not 0 <= value < 1:
                raise ValueError(
                    f"{what} is {value}: choose a part of the clocks from 0 to below 1"
                )

    @property
    def stall_below(self) -> int:
        """Threshold of the 32-bit draw under which a step is not taken."""
        return int(self.stall * 2**32)

    @property
    def gap_below(self) -> int:
        """Threshold of the 32-bit draw under which no new block is offered."""
        return int(self.gap * 2**32)

    def ready(self, clock: int) -> bool:
        """Say whether a step is taken in ``clock``, counted from reset."""
        return not self.stall_below or _draw(self.seed, clock, 0) >= self.stall_below

    def offers(self, clock: int) -> bool:
        """Say whether a new block may be offered in ``clock``, counted from reset."""
        return not self.gap_below or _draw(self.seed, clock, 1) >= self.gap_below


NO_STALLS = Stalls()
