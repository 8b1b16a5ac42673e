"""A bench in cocotb for the Verilog of any core, against golden vectors in a file.

It is a cocotb test module as it stands: ``discreta verilog METHOD --output FILE.v --vectors``
writes the core and its vectors, ``FILE.json``; the environment's ``DISCRETA_VECTORS`` names that
file. In a bench of one's own :func:`follow` does the same with any device under test that has these
ports, alone or inside something else.

The vectors: ``inputs`` and ``outputs``, by the port a value for every clock. Inputs that must not
matter are ``null``: they are driven X.

Needs the ``cocotb`` package, which the ``test`` extra brings. Source: none, it is ours.
"""

import json
import os
from pathlib import Path
from typing import Any

import cocotb
from cocotb.triggers import Timer
from cocotb.types import LogicArray

__all__ = ["follow", "golden_vectors"]

#: Half a clock, in steps of the simulator.
_HALF = 5


async def follow(dut: Any, vectors: dict[str, dict[str, list]]) -> int:
    """Drive a core by vectors, compare every output at every clock, and give how many clocks.

    Parameters
    ----------
    dut : handle
        It has the ports of the core, ``clk`` among them, which nothing else drives.
    vectors : dict
        As in the file.

    Raises
    ------
    AssertionError
        An output is not what it must be, or unknown.
    """
    inputs = {getattr(dut, name): values for name, values in vectors["inputs"].items()}
    outputs = {getattr(dut, name): values for name, values in vectors["outputs"].items()}
    clocks = len(vectors["inputs"]["rst"])
    dut.clk.value = 0
    for clock in range(clocks):
        for port, values in inputs.items():
            value = values[clock]
            bits = len(port)
            if value is None:
                port.value = LogicArray("X" * bits)
            else:
                port.value = LogicArray.from_unsigned(value & ((1 << bits) - 1), bits)
        await Timer(_HALF, "step")
        for port, values in outputs.items():
            expected = values[clock] & ((1 << len(port)) - 1)
            seen = str(port.value)
            assert seen == f"{expected:0{len(port)}b}", (
                f"clock {clock}: {port._name} is {seen}, expected {expected:0{len(port)}b}"
            )
        dut.clk.value = 1
        await Timer(_HALF, "step")
        dut.clk.value = 0
    return clocks


@cocotb.test()
async def golden_vectors(dut: Any) -> None:
    """Every output at every clock, by the vectors that ``DISCRETA_VECTORS`` names."""
    vectors = json.loads(Path(os.environ["DISCRETA_VECTORS"]).read_text())
    clocks = await follow(dut, vectors)
    dut._log.info(f"{clocks} clocks are as in the golden model")
