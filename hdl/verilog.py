"""Verilog for any interpolator: one self-contained text in plain Verilog-2005."""

import inspect
import re
import textwrap
from collections.abc import Iterator
from importlib import metadata
from itertools import count

from amaranth._toolchain.yosys import find_yosys  # there is no public way to it
from amaranth.back import rtlil
from amaranth.hdl import Shape, unsigned

from discreta.hdl.contract import AXIS_LETTERS, ErrorCode, Part
from discreta.hdl.plain import PlainPorts
from discreta.hdl.queue import StopReason

__all__ = ["verilog"]

# `proc` and `opt` turn every register into a short `always` block with its reset, its enable and
# its initial value, which reads well and never shows an X. `wreduce` and `-mux_undef` drop the bits
# and the branches that no one sees, one multiplexer of a chain a round; `-purge` drops the wires
# that are only other names. A register keeps all its bits: `wreduce` lets flip-flops be, and before
# `opt_dff` what they are given too.
_FLIP_FLOPS = "t:$dff* t:$sdff* %u"
_REDUCE = f"""\
wreduce * {_FLIP_FLOPS} %d
opt -noff -mux_undef
"""
_PASSES = f"""\
proc
memory_collect
wreduce * {_FLIP_FLOPS} %d t:$mux %d t:$pmux %d
opt -noff -mux_undef
opt_dff
opt -noff -mux_undef
{5 * _REDUCE}opt_clean -purge
"""

# Verilog tools differ in what they make of a comment that is not ASCII.
_ASCII = str.maketrans(
    {
        "Δ": "delta",
        "φ": "phi",
        "κ": "kappa",
        "·": "*",
        "×": "x",
        "±": "+-",
        "−": "-",
        "–": "-",
        "√": "sqrt ",
        "½": "1/2",
        "π": "pi",
        "≤": "<=",
        "≥": ">=",
        "⌊": "floor(",
        "⌋": ")",
        "⌈": "ceil(",
        "⌉": ")",
        "₀": "0",
        "…": "...",
        "`": None,
        "\\": None,
    }
)

_HANDSHAKE = """\
A block is accepted in a clock in which blocks_valid and blocks_ready are both 1, a step is taken \
in a clock in which steps_valid and steps_ready are. A step waits, unchanged, until it is taken: \
whoever takes the steps sets the pace. Every block is answered in its turn, by done or by an error \
code for one clock. rst held for one rising edge of clk resets everything; the registers also \
start from their reset values.
"""

_DEVICE_HANDSHAKE = """\
A block is accepted in a clock in which blocks_valid and blocks_ready are both 1. It starts where \
the one before it ends. rst held for one rising edge of clk resets everything; the registers also \
start from their reset values.
"""

_MEANINGS = {
    "clk": "clock: everything happens at its rising edge",
    "rst": "synchronous reset, active high",
    "blocks_valid": "a block is offered",
    "blocks_ready": "a block is accepted if one is offered",
    "steps_valid": "a step waits to be taken",
    "steps_ready": "the step is taken if one waits",
    "steps_last": "the step is the last one of its block",
    "busy": "there is a block that is not answered yet",
    "done": "1 for one clock: a block has ended",
    "blocks_clockwise": "block: 1 runs clockwise, 0 counter-clockwise",
    "blocks_full_turns": "block: whole turns made before the arc itself",
    "blocks_periods": "block: carrier periods that it takes, N",
    "blocks_period": "block: clocks of a carrier period, T",
    "blocks_pace": "block: line: length/L - 1 in 2^-(n + 12); arc: R in 2^-12; 0 full speed",
    "blocks_ticks": "block: ticks that the arc takes, R*angle or the longest further way",
    "blocks_turns": "block: changes of direction of an axis on the way",
    **{f"blocks_{letter}": f"block: coefficient {letter.upper()}" for letter in "abcde"},
    "error": "why a block was not run; "
    + ", ".join(
        f"{code.value} {code.name}" for code in ErrorCode.__members__.values() if code.value
    ),
}

# Of the whole device and of its units.
_DEVICE_MEANINGS = {
    "blocks_kind": "block: 0 line, 1 arc, 2 conic, 3 the machine stands at end",
    "blocks_feed_mantissa": "block: speed F = (1 + mantissa/2^16) / 2^exponent, steps per clock",
    "blocks_feed_exponent": "block: its exponent",
    "blocks_ahead": "block: path from its start to the end of the chain, in steps",
    "override": "128 is 100 %, up to 256",
    "acceleration": "in 2^-48 steps per clock^2; 0: no ramp",
    "hold": "no further step, down the ramp; goes on when it is 0 again",
    "single": "a rising edge lets one step go under hold",
    "stop": "ends the run, down the ramp",
    "emergency": "ends the run at once",
    "clear": "back to work after a stop",
    **{
        f"{end}_limit_{letter}": f"limit switch at the {end} end of {letter}"
        for end in ("low", "high")
        for letter in AXIS_LETTERS
    },
    "pulse_length": "clocks of a pulse",
    "pulse_space": "clocks between two pulses of an axis, at least",
    "direction_setup": "clocks of a direction before a pulse, at least",
    "direction_hold": "clocks of a direction behind a pulse, at least",
    "busy": "a block or a pulse is under way",
    "reason": "why the device stands: "
    + ", ".join(f"{why.value} {why.name}" for why in StopReason.__members__.values() if why.value),
}

# Where the steps of a whole carrier period are put out at once.
_PERIOD_MEANINGS = {
    "steps_valid": "the steps of a period wait to be taken",
    "steps_ready": "the steps are taken if some wait",
    "steps_last": "the steps are the last ones of their block",
    **{f"steps_{letter}": f"steps of the period along {letter}" for letter in "xy"},
}

# What stands before the name of a field, by the group of ports it belongs to.
_GROUPS = {
    "blocks": "block: ",
    "steps": "steps to make along ",
    "position": "coordinate now, in steps: ",
    "pins": "to the motor driver: ",
}


def verilog(core: Part, name: str) -> str:
    """Give an interpolator as Verilog-2005, the same text on every machine.

    The registers keep their names and stand in one module for every part, ``<name>_p1`` and so on,
    with the instances named ``u_p1``. A comment at the top tells the parameters, the handshake, the
    timing (from the class docstring) and the ports.

    Parameters
    ----------
    core : Part
        The interpolator, or its :class:`~discreta.hdl.plain.PlainPorts`.
    name : str
        Name of the top module, which has the ports of ``PlainPorts``: ``clk``, ``rst``, then the
        inputs and the outputs in the order of the interpolator's signature.

    Raises
    ------
    ValueError
        ``name`` is not an identifier, or it is a keyword of Verilog or SystemVerilog.
    """
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        raise ValueError(
            f"name of the module is {name!r}: choose letters, digits and _, no digit first"
        )
    top = core if isinstance(core, PlainPorts) else PlainPorts(core)
    design = _marked(rtlil.convert(top, name=name, emit_src=False), top.core)
    yosys = find_yosys(lambda version: version >= (0, 40))
    text = yosys.run(
        ["-q", "-"], f"read_rtlil <<rtlil\n{design}\nrtlil\n{_PASSES}write_verilog -noattr\n"
    )
    # Bits of a branch that no register takes over are X; this Yosys has no `setundef`.
    text = re.sub(
        r"(?<=\d)'[bh][\da-fx]*x[\da-fx]*", lambda match: match[0].replace("x", "0"), text
    )
    if f"module \\{name} " in text:
        raise ValueError(f"name of the module is {name!r}, a keyword: choose another")
    _, first, *others = re.split(r"^(?=module )", _plain_names(text, name), flags=re.MULTILINE)
    ports = _ports(top)
    # Only the top module has signed ports: it is wires alone, so that no expression changes its
    # meaning, and Yosys writes $signed where the other modules mean it.
    modules = [_module(first, ports), *(_module(text, {}) for text in others)]
    return "\n\n".join([_header(top, name), *modules]) + "\n"


def _marked(design: str, core: Part) -> str:
    """Give every wire that has the name of a register an attribute, in RTLIL.

    Of several names for one wire Yosys keeps the one with more attributes.
    """
    names = "|".join(map(re.escape, core.registers))
    wire = re.compile(rf"^  wire .*\\(?:{names})(?:\$\d+)?$", flags=re.MULTILINE)
    return wire.sub(r"  attribute \\register 1\n\g<0>", design)


def _ports(top: PlainPorts) -> dict[str, tuple[str, Shape]]:
    """Give direction and shape of every port of the top module, in their order."""
    ports = {"clk": ("input", unsigned(1)), "rst": ("input", unsigned(1))}
    ports |= {name: ("input", port.shape()) for name, port in top.inputs.items()}
    return ports | {name: ("output", port.shape()) for name, port in top.outputs.items()}


def _plain_names(text: str, name: str) -> str:
    """Replace every escaped identifier by a plain one, the same everywhere in ``text``."""
    # An instance is called u_p1 because p1 itself is the register.
    text = re.sub(r"^(  \S+ +)\\?(\S+?) +\($", r"\1\\u_\2 (", text, flags=re.MULTILINE)
    used = set(re.findall(r"(?<![\\.$\w])[A-Za-z_]\w*", text))
    names: dict[str, str] = {}

    def plain(match: re.Match[str]) -> str:
        escaped = match[1]
        if escaped not in names:
            names[escaped] = next(name for name in candidates(escaped) if name not in used)
            used.add(names[escaped])
        return names[escaped]

    def candidates(escaped: str) -> Iterator[str]:
        stem = re.sub(r"\$\d+", "", escaped.replace(f"{name}.core.", f"{name}."))
        if stem == escaped and re.fullmatch(r"\w+", stem) and not stem.startswith("u_"):
            yield f"{stem}_"  # a keyword
        stem = re.sub(r"\W", "_", stem)
        if "." in escaped or stem.startswith("u_"):
            yield stem
        # One word that had a number gets a number, as the word may be a keyword.
        yield from (f"{stem}_{number}" for number in count(2))

    return re.sub(r"\\(\S+) ", plain, text)


def _module(text: str, shapes: dict[str, tuple[str, Shape]]) -> str:
    """Write every port of a module once, in its header, in the order of ``shapes`` if given."""
    head, lines = text.split(");\n", 1)
    ports: dict[str, str] = {}
    body: list[str] = []
    for line in lines.rstrip().splitlines():
        declared = re.fullmatch(r"  (input|output|wire|reg)( \[\d+:0\])? (\w+)( = \S+)?;", line)
        if declared is None:
            body.append(line)
            continue
        kind, bits, name, init = (group or "" for group in declared.groups())
        if kind in ("input", "output"):
            sign = " signed" if name in shapes and shapes[name][1].signed else ""
            ports[name] = f"{kind} wire{sign}{bits} {name}"
        elif name not in ports:
            body.append(line)
        elif kind == "reg":
            ports[name] = f"output reg{bits} {name}{init}"
    inputs_first = sorted(ports, key=lambda name: (ports[name].startswith("output"), name))
    order = shapes or sorted(inputs_first, key=lambda name: name not in ("clk", "rst"))
    header = ",\n".join(f"  {ports[name]}" for name in order)
    return "\n".join([head.partition("(")[0].rstrip() + " (", header, ");", *body])


def _header(top: PlainPorts, name: str) -> str:
    """Write the comment at the top of the text."""
    first, *paragraphs = (inspect.getdoc(type(top.core)) or name).split("\n\n")
    timing = [
        re.sub(r":[a-z]+:(?=`)", "", text)
        for text in paragraphs
        if text.startswith(("Latency", "Throughput"))
    ]
    values = ", ".join(f"{key} = {value}" for key, value in top.core.parameters.items())
    ports = _ports(top)
    room = max(map(len, ports))
    # More than a sign and a bit: not one step or none.
    many = "steps_x" in ports and ports["steps_x"][1].width > 2
    device = "steps_valid" not in ports or ports["steps_valid"][0] == "input"
    handshake = _HANDSHAKE
    if device:
        handshake = _DEVICE_HANDSHAKE if "blocks_valid" in ports else ""
    table = [f"{'port':{room}}  dir     bits           meaning"]
    for port, (direction, shape) in ports.items():
        kind = f"{direction:6}  {shape.width:4}  {'signed' if shape.signed else '':7}"
        table.append(f"{port:{room}}  {kind}  {_meaning(port, per_period=many, device=device)}")
    sections = [
        f"{name}: {first}",
        f"Generated by discreta {metadata.version('discreta')}; do not edit.",
        f"Parameters: {values} ({top.core.notation}).",
        *([handshake] if handshake else []),
        *timing,
    ]
    wrapped = [textwrap.fill(" ".join(section.split()), 95) for section in sections]
    text = "\n\n".join([*wrapped, "\n".join(table)]).translate(_ASCII)
    text = text.encode("ascii", "backslashreplace").decode()
    return "\n".join(f"// {line}".rstrip() for line in text.splitlines())


def _meaning(port: str, *, per_period: bool, device: bool) -> str:
    """Say in a few words what a port is for; ``per_period``: many steps are taken at once.

    ``device``: it is one of the whole device or of a unit of it.
    """
    group, _, field = port.partition("_")
    if per_period and port in _PERIOD_MEANINGS:
        return _PERIOD_MEANINGS[port]
    if device and port in _DEVICE_MEANINGS:
        return _DEVICE_MEANINGS[port]
    return _MEANINGS.get(port) or _GROUPS.get(group, "") + (field or group).replace("_", " ")
