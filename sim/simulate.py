"""Runs blocks through the RTL, on either engine, from reset to the last answer."""

from collections.abc import Iterator, Mapping
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
    controls: Mapping[str, int] | None = None,
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
    controls : dict of str to int or None
        Of a device the values of its inputs beside the blocks, those left out being 0. It is run
        until it is idle.

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
        idle = False
        names = model.control_fields
        orders = np.array(
            [[0, names.index(name), value] for name, value in (controls or {}).items()],
            dtype=np.int64,
        ).reshape(-1, 3)
        while not idle if controls is not None else answered < len(blocks):
            if clocks >= limit:
                raise DeadCoreError(
                    f"{answered} of {len(blocks)} blocks are answered after {clocks} clocks, "
                    f"where {limit} must do"
                )
            stretch = model.run(
                blocks[fed : fed + STRETCH],
                min(STRETCH, limit - clocks),
                until_answered=0 if controls is not None else len(blocks) - answered,
                stalls=stalls,
                event_room=STRETCH,
                orders=orders,
                until_idle=controls is not None,
            )
            orders = orders[stretch.ordered :]
            # A device that has not been offered all blocks yet only seems to have them.
            idle = stretch.idle and (fed + stretch.fed == len(blocks) or stretch.fed == 0)
            clocks += stretch.ran
            fed += stretch.fed
            answered += stretch.answered
            yield stretch
    finally:
        model.close()
