"""What an engine gives back for a stretch of clocks."""

from dataclasses import dataclass

import numpy as np

__all__ = ["EVENT_COLUMNS", "Stretch"]

#: First columns of the events; the fields of the step follow.
EVENT_COLUMNS = ("clock", "accepted", "done", "error", "taken")


@dataclass(frozen=True)
class Stretch:
    """A recorded stretch of clocks.

    Attributes
    ----------
    ran : int
        Clocks run.
    fed : int
        Blocks accepted.
    answered : int
        Blocks answered by ``done`` or ``error``.
    events : array of int64, shape (events, 5 + step fields)
        A row for every clock in which a block was accepted or answered or a step was taken:
        :data:`EVENT_COLUMNS`, then the fields of the step. Clocks are counted from reset.
    watch : array of int64, shape (clocks, watched signals)
        The watched signals at every clock, before its edge.
    """

    ran: int
    fed: int
    answered: int
    events: np.ndarray
    watch: np.ndarray
