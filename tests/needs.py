"""What a test needs of the machine; without it the test is skipped, and says why."""

import pytest

from discreta.sim.compiled import compiler
from discreta.sim.foreign import available

#: For tests that run the compiled engine as it is.
needs_compiler = pytest.mark.skipif(
    compiler() is None, reason="no C++ compiler (c++, g++, clang++ or $CXX)"
)


def need(simulator: str) -> None:
    """Skip the test, saying why, where a Verilog simulator cannot be used."""
    if reason := available(simulator):
        pytest.skip(reason)
