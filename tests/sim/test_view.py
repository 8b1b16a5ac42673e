import io
import re

import numpy as np
import pytest
from amaranth.hdl import Fragment
from vcd.gtkw import GTKWFlag
from vcd.reader import ScopeDecl, TokenKind, tokenize

from discreta.hdl.circular import Circular
from discreta.hdl.linear import Linear
from discreta.sim.simulate import simulate
from discreta.sim.view import write_view

UU = {"УУ": ["running", "done", "error"]}
# The device, a block, some groups of registers, and the ports of a block.
DEVICES = {
    "line": (
        lambda: Linear(6, 2),
        [0, 0, 20, -9],
        UU
        | {
            "P1, P2 increments": ["p1", "p2"],
            "SX, SY summators": ["sx", "sy"],
            "P5, P6 steps left": ["p5", "p6"],
            "P3, P4 position": ["p3", "p4"],
        },
        {"start_x", "start_y", "end_x", "end_y"},
    ),
    "line in three axes": (
        lambda: Linear(6, 3),
        [0, 0, 0, 20, -9, 3],
        UU
        | {
            "P1, P2 increments": ["dx", "dy", "dz"],
            "SX, SY summators": ["sx", "sy", "sz"],
            "P5, P6 steps left": ["kox", "koy", "koz"],
            "P3, P4 position": ["xt", "yt", "zt"],
        },
        {"start_x", "start_y", "start_z", "end_x", "end_y", "end_z"},
    ),
    "arc": (
        lambda: Circular(6),
        [20, 0, 0, -20, 0, 0, 1, 1],
        UU
        | {
            "P1, P2 coordinates seen from the centre": ["p1", "p2"],
            "SX, SY summators": ["sx", "sy"],
            "P3, P4 steps left": ["p3", "p4"],
            "XT, YT position": ["xt", "yt"],
        },
        {"start_x", "start_y", "end_x", "end_y", "center_x", "center_y", "clockwise", "full_turns"},
    ),
}


@pytest.fixture(params=DEVICES)
def device(request):
    return DEVICES[request.param]


def waveform(tmp_path, device):
    """Give a block's waveform, and its view as lines."""
    make, block, *_ = device
    vcd = tmp_path / "part"
    core = make()
    with vcd.open("w", encoding="utf-8") as file:
        list(simulate(core, np.array([block]), limit=2000, vcd=file))
    view = io.StringIO()
    write_view(view, vcd, "block.vcd", core)
    return vcd, view.getvalue().splitlines()


def variables(vcd):
    """Give the id of every variable by its name as GTKWave writes it."""
    scope, found = [], {}
    with vcd.open("rb") as file:
        for token in tokenize(file):
            if token.kind is TokenKind.SCOPE:
                assert isinstance(token.data, ScopeDecl)
                scope.append(token.data.ident)
            elif token.kind is TokenKind.UPSCOPE:
                scope.pop()
            elif token.kind is TokenKind.VAR:
                bits = f"[{token.var.size - 1}:0]" if token.var.size > 1 else ""
                found[".".join([*scope, token.var.reference]) + bits] = token.var.id_code
    return found


def groups(lines):
    """Give (group, alias, name, flags) of every trace in a view."""
    group, flags = "", GTKWFlag(0)
    for line in lines:
        if line.startswith("@"):
            flags = GTKWFlag(int(line[1:], 16))
        elif line.startswith("-"):
            if flags & GTKWFlag.grp_begin:
                assert not group
                group = line[1:]
            elif flags & GTKWFlag.grp_end:
                assert line[1:] == group
                group = ""
        elif match := re.fullmatch(r"(?:\+\{(.*)\} )?([^\[].*)", line):
            yield group, match[1], match[2], flags
    assert not group


def test_every_name_is_in_the_waveform(tmp_path, device):
    vcd, lines = waveform(tmp_path, device)
    assert '[dumpfile] "block.vcd"' in lines
    names = [name for _, _, name, _ in groups(lines)]
    assert len(names) > 20
    assert set(names) <= variables(vcd).keys()


def test_every_register_is_in_the_view(tmp_path, device):
    _, lines = waveform(tmp_path, device)
    shown = {(group, alias) for group, alias, _, _ in groups(lines)}
    core = device[0]()
    Fragment.get(core, None)  # else Amaranth complains that it is not used
    for title, registers in core.diagram.items():
        assert {(title, register.name) for register in registers} <= shown
    assert core.registers.keys() <= {alias for _, alias in shown}


def test_groups_are_those_of_the_block_diagram(tmp_path, device):
    vcd, lines = waveform(tmp_path, device)
    wanted = device[2]
    names = [name for name in variables(vcd) if name.startswith("bench.top.core.")]
    found: dict[str, list[str]] = {}
    for group, alias, name, _ in groups(lines):
        if alias is not None and group in wanted:
            found.setdefault(group, []).append(alias)
            # The one nearest to the top of the device, of those that are called so.
            same = [other for other in names if re.search(rf"\.{alias}(\[\d+:0\])?$", other)]
            assert name == min(same, key=lambda other: other.count("."))
    assert found == wanted


def test_ports_and_curves(tmp_path, device):
    _, lines = waveform(tmp_path, device)
    traces = list(groups(lines))
    ports = {
        name.split("[")[0].removeprefix("bench.top."): flags
        for group, _, name, flags in traces
        if group == "blocks and steps"
    }
    letters = "xyz"[: 3 if "start_z" in device[3] else 2]
    wanted = {f"blocks_{field}" for field in device[3]}
    wanted |= {f"steps_{a}" for a in letters}
    wanted |= {"blocks_valid", "blocks_ready", "steps_valid", "steps_ready", "steps_last"}
    wanted |= {"clk", "busy", "done", "error"}
    assert ports.keys() == wanted
    # Coordinates and steps may be negative, and nothing else.
    assert all(bool(flags & GTKWFlag.signed) == (port[-2] == "_") for port, flags in ports.items())
    curves = [trace for trace in traces if trace[0] == "coordinates"]
    assert [alias for _, alias, _, _ in curves] == [f"position_{a}" for a in letters]
    for *_, flags in curves:
        assert flags & GTKWFlag.analog_step
        assert flags & GTKWFlag.signed
    assert not any(flags & GTKWFlag.analog_step for group, *_, flags in traces if group == "УУ")


@pytest.mark.parametrize(
    ("kind", "registers", "end"),
    [("line", ("p3", "p4"), (20, 2**7 - 9)), ("arc", ("xt", "yt"), (0, 2**7 - 20))],
)
def test_the_waveform_holds_the_run(tmp_path, kind, registers, end):
    """The last value of the position's registers is the end point."""
    vcd, _ = waveform(tmp_path, DEVICES[kind])
    names = variables(vcd)
    last = {}
    with vcd.open("rb") as file:
        for token in tokenize(file):
            if token.kind is TokenKind.CHANGE_VECTOR:
                last[token.vector_change.id_code] = token.vector_change.value
    seen = [last[names[f"bench.top.core.{register}[6:0]"]] for register in registers]
    assert seen == list(end)
