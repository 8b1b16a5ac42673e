import os
import re
import subprocess
import sys
from functools import cache, partial
from importlib import metadata
from pathlib import Path

import pytest

import discreta
from discreta.hdl.carrier_circular import CarrierCircular
from discreta.hdl.carrier_linear import CarrierLinear
from discreta.hdl.circular import Circular
from discreta.hdl.conic import Conic
from discreta.hdl.linear import Linear
from discreta.hdl.plain import PlainPorts
from discreta.hdl.two_stage import two_stage_linear
from discreta.hdl.verilog import verilog
from discreta.sim.golden.circular import Circular as GoldenCircular
from discreta.sim.golden.conic import Conic as GoldenConic
from discreta.sim.golden.linear import Linear as GoldenLinear

METHODS = ["linear", "circular", "conic"]
HANDSHAKE = ["input wire blocks_valid", "input wire steps_ready"]
#: Input ports of a block with 8 bits: name, bits.
POINTS = [(f"{point}_{a}", 9) for point in ("start", "end", "center") for a in "xy"]
NUMBERS = {
    "linear": POINTS[:4],
    "circular": POINTS,
    "conic": [("a", 12), ("b", 12), ("c", 12), ("d", 21), ("e", 21), *POINTS[:4]],
}
DIRECTION = {
    "linear": [],
    "circular": ["input wire blocks_clockwise", "input wire [7:0] blocks_full_turns"],
    "conic": ["input wire blocks_clockwise", "input wire [10:0] blocks_turns"],
}
OUTPUTS = [
    "output wire blocks_ready",
    "output wire signed [1:0] steps_x",
    "output wire signed [1:0] steps_y",
    "output wire steps_last",
    "output wire steps_valid",
    "output wire signed [8:0] position_x",
    "output wire signed [8:0] position_y",
    "output wire busy",
    "output wire done",
    "output wire [1:0] error",
]


def make(method: str):
    return {"linear": Linear, "circular": Circular, "conic": Conic}[method](8)


@cache
def emit(method: str) -> str:
    return verilog(make(method), f"discreta_{method}")


def test_same_bytes_in_every_folder_and_for_every_hash_seed(tmp_path):
    program = (
        "import sys\n"
        "from discreta.hdl.circular import Circular\n"
        "from discreta.hdl.linear import Linear\n"
        "from discreta.hdl.verilog import verilog\n"
        "text = verilog(Linear(8, 2), 'discreta_linear')\n"
        "text += verilog(Circular(8), 'discreta_circular')\n"
        "sys.stdout.buffer.write(text.encode())\n"
    )
    root = str(Path(discreta.__file__).parents[1])
    for seed, folder in (("1", tmp_path), ("2", root)):
        environment = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": root}
        command = [sys.executable, "-c", program]
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, timeout=100, check=True
        )
        assert done.stdout == (emit("linear") + emit("circular")).encode()


@pytest.mark.parametrize("method", ["linear", "circular"])
def test_twice_from_one_core(method):
    top = PlainPorts(make(method))
    assert verilog(top, f"discreta_{method}") == emit(method)
    assert verilog(top.core, f"discreta_{method}") == emit(method)


@pytest.mark.parametrize("method", METHODS)
def test_ports_of_the_top_module(method):
    pattern = rf"^module discreta_{method} \((.*?)\);"
    header = re.search(pattern, emit(method), re.MULTILINE | re.DOTALL)
    assert header is not None
    assert [line.strip() for line in header[1].split(",")] == [
        "input wire clk",
        "input wire rst",
        *(f"input wire signed [{bits - 1}:0] blocks_{name}" for name, bits in NUMBERS[method]),
        *DIRECTION[method],
        *HANDSHAKE,
        *OUTPUTS,
    ]


@pytest.mark.parametrize("axes", [2, 3, 6])
@pytest.mark.parametrize("width", [4, 32])
def test_hierarchy_and_registers(width, axes):
    text = verilog(Linear(width, axes), "line")
    golden = GoldenLinear(width, axes)
    kinds = {r"p[1-4]|d.|.t": "register", r"p[56]|ko.": "counter", r"s.": "summator"}
    parts = [
        f"{name}_{kind}"
        for name in golden.registers()
        for pattern, kind in kinds.items()
        if re.fullmatch(pattern, name)
    ]
    modules = re.findall(r"^module (\w+) \($", text, re.MULTILINE)
    own = ["line", *(f"line_{part}" for part in ("core", "input", "normalizer", "output", "uu"))]
    assert sorted(modules) == sorted([*own, *(f"line_{part}" for part in parts)])
    assert len(parts) == 4 * axes
    instances = re.findall(r"^  (\w+) (\w+)\($", text, re.MULTILINE)
    assert sorted(instances) == sorted(
        (module, f"u_{module.removeprefix('line_')}") for module in modules if module != "line"
    )
    assert_registers(text, golden)


def assert_registers(text, golden):
    reset = golden.reset()
    for name, (bits, _) in golden.registers().items():
        size = rf" \[{bits - 1}:0\]" if bits > 1 else ""
        ((base, value),) = re.findall(rf"reg{size} {name} = {bits}'([hd])(\w+)", text)
        assert int(value, {"h": 16, "d": 10}[base]) == reset[name], name


@pytest.mark.parametrize(
    ("width", "order", "normalize", "preload", "guard"),
    [
        (4, "simultaneous", True, "half", 4),
        (5, "alternated", False, "half", 0),
        (16, "simultaneous", False, "zero", 0),
        (32, "alternated", True, "zero", 1),
    ],
)
def test_hierarchy_and_registers_of_the_circular(width, order, normalize, preload, guard):
    options = {"order": order, "normalize": normalize, "preload": preload, "guard": guard}
    text = verilog(Circular(width, **options), "arc")
    registers = [f"{name}_register" for name in ("p1", "p2", "xt", "yt", "xk", "yk", "limit")]
    parts = [*registers, "p3_counter", "p4_counter", "sx_summator", "sy_summator"]
    parts += ["core", "input", "input_meter", "output", "uu", *["normalizer"] * normalize]
    modules = re.findall(r"^module (\w+) \($", text, re.MULTILINE)
    assert sorted(modules) == sorted(["arc", *(f"arc_{part}" for part in parts)])
    instances = re.findall(r"^  (\w+) (\w+)\($", text, re.MULTILINE)
    assert sorted(instances) == sorted(
        (f"arc_{part}", f"u_{part.removeprefix('input_')}") for part in parts
    )
    assert_registers(text, GoldenCircular(width, **options))
    assert_plain(text)


def test_hierarchy_and_registers_of_the_conic():
    text = emit("conic")
    parts = [*(f"{name}_register" for name in ("xt", "yt")), "p3_counter", "p4_counter"]
    parts += ["gx_converter", "gy_converter", "first_adder", "second_adder"]
    parts += ["core", "normalizer", "output", "uu"]
    modules = re.findall(r"^module (\w+) \($", text, re.MULTILINE)
    named = {f"discreta_conic_{part}": f"u_{part}" for part in parts}
    assert sorted(modules) == sorted(["discreta_conic", *named])
    instances = re.findall(r"^  (\w+) (\w+)\($", text, re.MULTILINE)
    assert sorted(instances) == sorted(named.items())
    assert_registers(text, GoldenConic(8))
    # There is no multiplier anywhere: multiplying is adding, bit by bit.
    assert not re.search(r"[\w)] \* [\w($]", text.partition("module ")[2])


@pytest.mark.parametrize("method", ["linear", "circular"])
def test_what_is_read_of_a_register_has_its_name(method):
    for register in ("p1", "p2", *(("sx", "sy", "xk", "yk") if method == "circular" else ())):
        assert re.search(rf"^    \.{register}\({register}\)", emit(method), re.MULTILINE)


def test_what_a_linear_summator_starts_from_is_a_constant():
    summators = re.findall(r"^module \w+_summator .*?^endmodule", emit("linear"), re.M | re.S)
    assert len(summators) == 2
    assert "initial" not in "".join(summators)


@pytest.mark.parametrize("method", METHODS)
def test_identifiers_are_plain(method):
    assert_plain(emit(method))


def assert_plain(text):
    assert "\\" not in text
    assert re.findall(r"\w*\$\w+", text.replace("$signed(", "")) == []
    assert re.findall(r"'[bdh]\w*[xz]", text) == []


BEGINS = {
    "linear": "discreta_linear: Draws a straight line by summation of the increments; ",
    "circular": "discreta_circular: Draws an arc: each coordinate is summed to move the other; ",
    "conic": "discreta_conic: Draws any curve of the second order: its two derivatives are summed ",
}
PARAMETERS = {
    "linear": "width = 8, axes = 2, normalize = True, preload = half (n = width, M = 2^n).",
    "circular": "width = 8, order = alternated, normalize = True, preload = half, guard = 2 "
    "(n = width, g = guard, M = 2^(n + g)).",
    "conic": "width = 8, order = implicit, preload = half, guard = 2 "
    "(n = width, g = guard, M = 2^(2n + 6 + g)).",
}


@pytest.mark.parametrize("method", METHODS)
def test_comment_at_the_top(method):
    lines = [line for line in emit(method).splitlines() if line.startswith("//")]
    assert emit(method).startswith("\n".join(lines))
    comment = " ".join(line.removeprefix("//").strip() for line in lines)
    assert comment.startswith(BEGINS[method])
    assert f"Parameters: {PARAMETERS[method]} " in comment
    assert f"Generated by discreta {metadata.version('discreta')};" in comment
    for word in ("Latency: ", "Throughput: ", "blocks_valid and blocks_ready"):
        assert word in comment
    top = PlainPorts(make(method))
    verilog(top, f"discreta_{method}")
    names = ["clk", "rst", *top.inputs, *top.outputs]
    rows = dict(line.removeprefix("// ").split(maxsplit=1) for line in lines[-len(names) :])
    assert list(rows) == names
    assert rows["blocks_end_y"].split() == ["input", "9", "signed", "block:", "end", "y"]
    assert rows["steps_valid"].split()[:2] == ["output", "1"]
    assert rows["error"].endswith("why a block was not run; 1 RANGE, 2 OFF_CURVE, 3 SHARP")
    if method == "circular":
        assert rows["blocks_center_x"].endswith("signed   block: center x")
        assert rows["blocks_full_turns"].endswith("block: whole turns made before the arc itself")
    if method == "conic":
        assert rows["blocks_e"].split() == ["input", "21", "signed", "block:", "coefficient", "E"]
        assert rows["blocks_turns"].endswith("block: changes of direction of an axis on the way")
    if method != "linear":
        assert rows["blocks_clockwise"].endswith("block: 1 runs clockwise, 0 counter-clockwise")


@pytest.mark.parametrize("method", METHODS)
def test_text_names_no_machine_and_reads_anywhere(method):
    text = emit(method)
    assert text.isascii()
    assert text.endswith("endmodule\n")
    assert [line for line in text.splitlines() if line != line.rstrip()] == []
    comment = text.partition("module ")[0]
    assert max(map(len, comment.splitlines())) <= 100
    for word in ("yosys", "amaranth", "python", "/root", "/home", ".py", "\t", str(Path.cwd())):
        assert word.lower() not in text.lower()


@pytest.mark.parametrize("method", ["carrier_linear", "carrier_circular", "two_stage_linear"])
def test_on_a_carrier(method):
    """A block has its timing; the steps are those of a period, or one by one again."""
    device = {
        "carrier_linear": CarrierLinear,
        "carrier_circular": partial(CarrierCircular, formula="plain"),
        "two_stage_linear": two_stage_linear,
    }[method]
    text = verilog(device(8), f"discreta_{method}")
    assert_plain(text)
    assert text.isascii()
    comment, _, module = text.partition("\nmodule ")
    header = module.partition("(")[2].partition(");")[0]
    assert max(map(len, comment.splitlines())) <= 105
    assert ":attr:" not in comment
    ports = [line.strip() for line in header.split(",")]
    for port in ("input wire [15:0] blocks_periods", "input wire [23:0] blocks_period"):
        assert port in ports
    rows = dict(re.findall(r"^// (\w+) +(?:in|out)put +(\d.*)$", comment, re.MULTILINE))
    assert rows["blocks_periods"].endswith("block: carrier periods that it takes, N")
    assert rows["blocks_period"].endswith("block: clocks of a carrier period, T")
    at_once = not method.startswith("two_stage")
    steps = (
        "10  signed   steps of the period along x" if at_once else " 2  signed   steps to make al"
    )
    assert rows["steps_x"].startswith(steps.strip())
    assert (
        rows["steps_last"].split(maxsplit=1)[1] == "the steps are the last ones of their block"
    ) == (at_once)


@pytest.mark.parametrize("name", ["", "1st", "a b", "a.b", "a$b", "a\n", "\\a", "длина"])
def test_refuses_a_name_that_is_no_identifier(name):
    core = Linear(4, 2)
    verilog(core, "line")
    with pytest.raises(ValueError, match=r"name of the module is .*: choose letters, digits and _"):
        verilog(core, name)


@pytest.mark.parametrize("name", ["module", "initial", "logic"])
def test_refuses_a_keyword(name):
    with pytest.raises(ValueError, match=rf"name of the module is '{name}', a keyword"):
        verilog(Linear(4, 2), name)
