"""What tests of several modules need."""

import pytest

from discreta.sim import compiled


@pytest.fixture
def optimized_engine():
    """Have the compiled engine as it is: the whole device is 40 times as slow unoptimized."""
    if compiled.compiler() is None:
        pytest.skip("no C++ compiler (c++, g++, clang++ or $CXX)")


@pytest.fixture
def compiled_engine(optimized_engine, monkeypatch):  # noqa: ARG001
    """Have the compiled engine, built in two seconds in place of six, for short runs."""
    monkeypatch.setattr(compiled, "_FLAGS", (*compiled._FLAGS, "-O0"))
