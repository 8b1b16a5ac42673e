import os
import subprocess
import sys

import pytest
import yaml

from discreta import cli
from discreta.sim.corefile import core_file
from tests.needs import need


def fusesoc(folder, *arguments):
    # Its own settings and caches stay in the folder.
    places = {f"XDG_{name}_HOME": str(folder / name) for name in ("DATA", "CONFIG", "CACHE")}
    script = "import sys; from fusesoc.main import main; sys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", script, "--cores-root", ".", *arguments],
        cwd=folder,
        env=os.environ | places,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )


@pytest.mark.parametrize("broken", [False, True])
def test_fusesoc_runs_the_test_bench(tmp_path, monkeypatch, broken):
    need("icarus")
    monkeypatch.chdir(tmp_path)
    options = ["--width", "5", "--output", "line.v", "--testbench", "--core"]
    assert cli._run(["verilog", "linear", *options]) == 0
    if broken:
        text = (tmp_path / "line.v").read_text()
        (tmp_path / "line.v").write_text(text.replace("sy <= total;", "sy <= total + 1'b1;"))
    done = fusesoc(tmp_path, "run", "--target", "sim", "discreta:interpolators:linear")
    assert ("PASS: discreta_linear" in done.stdout) == (not broken), done.stderr
    assert (done.returncode != 0) == broken


def test_fusesoc_knows_its_name_and_its_files(tmp_path):
    text = core_file("linear", 'lines: "straight" ones', "discreta_linear", "a.v")
    (tmp_path / "a.core").write_text(text)
    (tmp_path / "a.v").write_text("module discreta_linear; endmodule\n")
    (tmp_path / "b.core").write_text(
        "CAPI=2:\nname: ::user:1.0\n"
        "filesets:\n  rtl:\n    depend: [discreta:interpolators:linear]\n"
        "targets:\n  default:\n    filesets: [rtl]\n    flow: sim\n    flow_options:\n"
        "      tool: icarus\n    toplevel: discreta_linear\n"
    )
    done = fusesoc(tmp_path, "run", "--setup", "::user")
    assert done.returncode == 0, done.stderr
    (copied,) = tmp_path.glob("build/**/a.v")
    assert copied.read_text() == (tmp_path / "a.v").read_text()


def test_targets_of_a_bench_only_with_a_bench():
    alone = yaml.safe_load(core_file("m", "s", "core", "a.v").partition("\n")[2])
    assert list(alone["targets"]) == ["default"]
    both = yaml.safe_load(core_file("m", "s", "core", "a.v", "a_tb.v").partition("\n")[2])
    assert list(both["targets"]) == ["default", "sim", "sim_verilator"]
    assert both["targets"]["sim"]["toplevel"] == "core_tb"
