import io
import re

import numpy as np
import pytest
from vcd.gtkw import GTKWFlag
from vcd.reader import ScopeDecl, TokenKind, tokenize

from discreta.hdl.linear import Linear
from discreta.sim.simulate import simulate
from discreta.sim.view import write_view

NAMES = {
    2: {
        "P1, P2 increments": ["p1", "p2"],
        "SX, SY summators": ["sx", "sy"],
        "P5, P6 steps left": ["p5", "p6"],
        "P3, P4 position": ["p3", "p4"],
        "УУ": ["running", "done", "error"],
    },
    3: {
        "P1, P2 increments": ["dx", "dy", "dz"],
        "SX, SY summators": ["sx", "sy", "sz"],
        "P5, P6 steps left": ["kox", "koy", "koz"],
        "P3, P4 position": ["xt", "yt", "zt"],
        "УУ": ["running", "done", "error"],
    },
}


def waveform(tmp_path, axes):
    """Give a line's waveform, and its view as lines."""
    vcd = tmp_path / "part"
    core = Linear(6, axes)
    block = np.array([[0] * axes + [20, -9, 3][:axes]])
    with vcd.open("w", encoding="utf-8") as file:
        list(simulate(core, block, limit=100, vcd=file))
    view = io.StringIO()
    write_view(view, vcd, "line.vcd", core)
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


@pytest.mark.parametrize("axes", [2, 3])
def test_every_name_is_in_the_waveform(tmp_path, axes):
    vcd, lines = waveform(tmp_path, axes)
    assert '[dumpfile] "line.vcd"' in lines
    names = [name for _, _, name, _ in groups(lines)]
    assert len(names) > 20
    assert set(names) <= variables(vcd).keys()


@pytest.mark.parametrize("axes", [2, 3])
def test_groups_are_those_of_the_block_diagram(tmp_path, axes):
    vcd, lines = waveform(tmp_path, axes)
    names = [name for name in variables(vcd) if name.startswith("bench.top.core.")]
    found: dict[str, list[str]] = {}
    for group, alias, name, _ in groups(lines):
        if alias is not None and group in NAMES[axes]:
            found.setdefault(group, []).append(alias)
            # The one nearest to the top of the device, of those that are called so.
            same = [other for other in names if re.search(rf"\.{alias}(\[\d+:0\])?$", other)]
            assert name == min(same, key=lambda other: other.count("."))
    assert found == NAMES[axes]


@pytest.mark.parametrize("axes", [2, 3])
def test_ports_and_curves(tmp_path, axes):
    _, lines = waveform(tmp_path, axes)
    traces = list(groups(lines))
    ports = {name.split("[")[0] for group, _, name, _ in traces if group == "blocks and steps"}
    letters = "xyz"[:axes]
    wanted = {f"blocks_{end}_{a}" for end in ("start", "end") for a in letters}
    wanted |= {f"steps_{a}" for a in letters}
    wanted |= {"blocks_valid", "blocks_ready", "steps_valid", "steps_ready", "steps_last"}
    wanted |= {"clk", "busy", "done", "error"}
    assert ports == {f"bench.top.{name}" for name in wanted}
    curves = [trace for trace in traces if trace[0] == "coordinates"]
    assert [alias for _, alias, _, _ in curves] == [f"position_{a}" for a in letters]
    for *_, flags in curves:
        assert flags & GTKWFlag.analog_step
        assert flags & GTKWFlag.signed
    assert not any(flags & GTKWFlag.analog_step for group, *_, flags in traces if group == "УУ")


def test_the_waveform_holds_the_run(tmp_path):
    """The last value of the position's registers is the end point."""
    vcd, _ = waveform(tmp_path, 2)
    names = variables(vcd)
    last = {}
    with vcd.open("rb") as file:
        for token in tokenize(file):
            if token.kind is TokenKind.CHANGE_VECTOR:
                last[token.vector_change.id_code] = token.vector_change.value
    assert last[names["bench.top.core.p3[6:0]"]] == 20
    assert last[names["bench.top.core.p4[6:0]"]] == 2**7 - 9
