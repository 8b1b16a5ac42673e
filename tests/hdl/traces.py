"""The golden model under the handshakes of the engines, clock by clock."""

from collections.abc import Collection
from itertools import islice
from typing import Any

import numpy as np

from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.vectors import play


def golden_trace(
    golden: Any,
    fields: Collection[str],
    blocks: np.ndarray,
    clocks: int,
    stalls: Stalls = NO_STALLS,
    resets: Collection[int] = (),
    *,
    until_idle: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Give every register and every output at every clock, before its edge.

    Parameters
    ----------
    golden : object
        The golden model.
    fields : collection of str
        The fields of a block, as ports.
    blocks : array of int, shape (blocks, fields)
    clocks : int
        How many to run.
    stalls : Stalls
    resets : collection of int
        The clocks in which ``rst`` is held; what is offered then stays offered.
    until_idle : bool
        Stop when all blocks are answered; it is an error if ``clocks`` do not do.

    Returns
    -------
    registers, outputs : arrays of int, shape (clocks, registers), (clocks, outputs)
        In the model's own order; of Python's integers when a register has more than 63 bits.
    """
    registers, outputs, taken = [], [], 0
    for state, out, inputs in islice(play(golden, fields, blocks, stalls, resets), clocks):
        registers.append([state[name] for name in golden.registers()])
        outputs.append(list(out.values()))
        idle = taken == len(blocks) and not (out["busy"] or out["done"] or out["error"])
        if until_idle and idle:
            break
        taken += bool(inputs["blocks_valid"] and out["blocks_ready"] and not inputs["rst"])
    else:
        assert not until_idle, f"the golden model is not done after {clocks} clocks"
    wide = any(bits > 63 for bits, _ in golden.registers().values())
    return np.array(registers, dtype=object if wide else np.int64), np.array(outputs)
