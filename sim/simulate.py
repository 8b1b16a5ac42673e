"""Runs blocks through the RTL, on either engine, from reset to the last answer."""

from collections.abc import Iterator
from typing import IO

import numpy as np

from discreta.hdl.contract import Part
from discreta.sim.compiled import CompiledModel, compiler
from discreta.sim.interpreted import PysimModel
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import Stretch

__all__ = ["ENGINES", "DeadCoreError", "default_engine", "simulate"]

ENGINES = ("pysim", "compiled")

#: Clocks in one stretch: small enough for 1 MiB of records, large enough not to count.
STRETCH = 1 << 16


class DeadCoreError(RuntimeError):
    """The device has not answered all blocks within the clocks it may take."""


def default_engine() -> str:
    """Choose the compiled engine where there is a C++ compiler, else pysim."""
    return "compiled" if compiler() else "pysim"


def simulate(
    core: Part,
    blocks: np.ndarray,
    *,
    limit: int,
    engine: str = "pysim",
    stalls: Stalls = NO_STALLS,
    watch: tuple[str, ...] = (),
    vcd: IO[str] | None = None,
) -> Iterator[Stretch]:
    """Run blocks one behind the other and give what happened, stretch by stretch.

    Parameters
    ----------
    core : Part
        The interpolator.
    blocks : array of int64, shape (blocks, block fields)
    limit : int
        The most clocks the blocks may take.
    engine : str
        ``"pysim"`` or ``"compiled"``.
    stalls : Stalls
        When steps are not taken and blocks not offered.
    watch : tuple of str
        Ports, or registers prefixed with ``reg_``, to record at every clock.
    vcd : file or None
        Where pysim writes a waveform.

    Raises
    ------
    DeadCoreError
        Not all blocks are answered within ``limit`` clocks.
    """
    if engine == "pysim":
        model = PysimModel(core, watch=watch, vcd=vcd)
    else:
        model = CompiledModel(core, watch=watch)
    try:
        answered = fed = clocks = 0
        while answered < len(blocks):
            if clocks >= limit:
                raise DeadCoreError(
                    f"{answered} of {len(blocks)} blocks are answered after {clocks} clocks, "
                    f"where {limit} must do"
                )
            stretch = model.run(
                blocks[fed : fed + STRETCH],
                min(STRETCH, limit - clocks),
                until_answered=len(blocks) - answered,
                stalls=stalls,
                event_room=STRETCH,
            )
            clocks += stretch.ran
            fed += stretch.fed
            answered += stretch.answered
            yield stretch
    finally:
        model.close()
