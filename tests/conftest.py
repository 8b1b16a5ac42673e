"""What tests of several modules need."""

import pytest

from discreta.sim import compiled


@pytest.fixture
def compiled_engine(monkeypatch):
    """Have the compiled engine, built in two seconds in place of six, for short runs."""
    if compiled.compiler() is None:
        pytest.skip("no C++ compiler (c++, g++, clang++ or $CXX)")
    monkeypatch.setattr(compiled, "_FLAGS", (*compiled._FLAGS, "-O0"))
