"""What an engine gives back for a stretch of clocks."""

from dataclasses import dataclass

import numpy as np

__all__ = ["EVENT_COLUMNS", "NO_ORDERS", "Stretch"]

#: First columns of the events; the fields of the step follow.
EVENT_COLUMNS = ("clock", "accepted", "done", "error", "taken")


#: Controls that are never set.
NO_ORDERS = np.empty((0, 3), dtype=np.int64)


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
        :data:`EVENT_COLUMNS`, then the fields of the step. Clocks are counted from reset. Of a
        device ``taken`` means that a pin has changed, and the pins follow.
    watch : array of int64, shape (clocks, watched signals)
        The watched signals at every clock, before its edge.
    ordered : int
        Controls set.
    idle : bool
        Of a device: it is not busy at the end, and has taken all blocks or has stopped.
    """

    ran: int
    fed: int
    answered: int
    events: np.ndarray
    watch: np.ndarray
    ordered: int = 0
    idle: bool = False
