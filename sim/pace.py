"""What the clocks of a run went into: summations, steps that end a block, and clocks lost."""

from dataclasses import dataclass

import numpy as np

from discreta.sim.stretch import EVENT_COLUMNS, Stretch

__all__ = ["Pace"]


@dataclass
class Pace:
    """Counts the summations of a run and the clocks lost between its blocks.

    For runs in which every step is taken at once. Between the last summation of a block and the
    first one of the next is one clock, in which the next one is loaded; what else lies between the
    first summation and the last one of all is lost. Blocks of no length need clocks of their own,
    and lose them.

    Attributes
    ----------
    summations : int
        Clocks in which the device runs: the summators add, or the frame of an arc is turned.
    """

    summations: int = 0
    _clocks: int = 0
    _begun: int | None = None
    _ended: int = 0
    _blocks: int = 0

    @property
    def lost(self) -> int:
        """Clocks lost between blocks."""
        if self._begun is None:
            return 0
        return self._ended - self._begun - self.summations - self._blocks + 2

    def follow(self, stretch: Stretch) -> None:
        """Take in a stretch with ``reg_running`` watched, first of all signals."""
        running = np.flatnonzero(stretch.watch[:, 0])
        if self._begun is None and len(running):
            self._begun = self._clocks + int(running[0])
        if len(running):
            self._ended = self._clocks + int(running[-1])
        self.summations += len(running)
        self._clocks += stretch.ran
        last = stretch.events[:, -1] & stretch.events[:, EVENT_COLUMNS.index("taken")] == 1
        self._blocks += int(np.count_nonzero(last))
