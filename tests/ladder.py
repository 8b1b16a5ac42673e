"""The rungs of the ladder of equivalence, each as a function that judges one design.

A rung gives "" when the design passes, else one line that tells what it saw. Every rung is bounded:
a dead device is caught like any other. ``python -m tests.ladder`` sends every broken variant up the
ladder and prints what is seen, then which rungs catch which variant, as a Markdown table for every
method.
"""

import math
import os
import sys
import textwrap
from collections.abc import Callable, Collection, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import pairwise, product
from typing import Any
from unittest.mock import patch

import numpy as np
import z3
from rich.box import MARKDOWN
from rich.console import Console
from rich.table import Table

from discreta.hdl.contract import Part
from discreta.hdl.plain import PlainPorts
from discreta.hdl.verilog import verilog
from discreta.sim import compiled as engine
from discreta.sim import groups as survey_samples
from discreta.sim import survey
from discreta.sim.foreign import UnknownOutputError, available, run_foreign
from discreta.sim.groups import survey_groups
from discreta.sim.interpreted import PysimModel
from discreta.sim.methods import METHODS, Method
from discreta.sim.simulate import DeadCoreError, simulate
from discreta.sim.smt import Obligation, Rtl, check, equivalence, extend
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS
from tests import lecture
from tests.arcs import arc_steps, draw_arcs, fault, is_empty, seen
from tests.broken import ALL, SOUND, VARIANTS, Variant
from tests.conics import FIELDS, conic_steps, draw_conics
from tests.conics import fault as conic_fault
from tests.exact_arcs import exact_steps
from tests.hdl.traces import golden_trace
from tests.lines import article

__all__ = ["RUNGS", "kind", "matrix", "missing"]

WIDTH = 4
SEED = 1970

#: Clocks of the golden model after which a bench counts as wrong itself.
_CLOCK_LIMIT = 9000

#: What a document says of a block: its name, and (summations, point) of every step, from the first.
#: On a carrier it is (clocks, point) of every period.
_Said = tuple[str, list[tuple[int, tuple[int, ...]]]]


def kind(method: Method) -> str:
    """Name the kind of blocks of a method: the curve, and whether it is timed."""
    return f"timed {method.curve}" if method.timed else method.curve


def documents(variant: Variant) -> str:
    """Judge the steps of blocks, one behind the other, by what the documents say of each."""
    if variant.method.name in _UNDOCUMENTED:
        return ""
    core = variant.device(WIDTH)
    blocks, read = _DOCUMENTS.get(variant.method.name) or _DOCUMENTS[variant.method.curve]
    said = [read(core, block) for block in blocks.tolist()]
    # Twice what it takes: a clock for every summation, and some for what comes before.
    clocks = [points[-1][0] if points else 0 for ((_, points), *_) in said]
    limit = 2 * (sum(clocks) + len(blocks) * (2 * WIDTH + 8 + _preparation(core)))
    try:
        events = np.concatenate([part.events for part in simulate(core, blocks, limit=limit)])
    except DeadCoreError as error:
        return str(error)
    if refused := np.count_nonzero(events[:, EVENT_COLUMNS.index("error")]):
        return f"{refused} of the blocks are refused"
    taken = events[events[:, EVENT_COLUMNS.index("taken")] == 1]
    taken = taken[:, [EVENT_COLUMNS.index("clock"), *range(len(EVENT_COLUMNS), taken.shape[1])]]
    for block, sources in zip(blocks, said, strict=True):
        name = f"the {variant.method.curve} {block.tolist()}"
        points = sources[0][1]
        rows, taken = taken[: len(points)], taken[len(points) :]
        if len(rows) < len(points):
            return f"{name} takes {len(rows)} steps, where {sources[0][0]} has {len(points)}"
        start = _FIELDS[kind(variant.method)].index("start_x")
        seen = (block[start : start + 2] + np.cumsum(rows[:, 1:3], axis=0)).tolist()
        for source, points in sources:
            for (t, point), (clock, *_), at in zip(points, rows.tolist(), seen, strict=True):
                # The documents know no latency: summations are counted from the first step.
                summation = points[0][0] + clock - int(rows[0, 0])
                if (summation, at) != (t, list(point)):
                    return (
                        f"{name} is at {at} after {summation} summations, where {source} is at "
                        f"{list(point)} after {t}"
                    )
        if rows[:, 3].tolist() != [0] * (len(rows) - 1) + [1] * (len(rows) > 0):
            return f"{name} has last = {rows[:, 3].tolist()}"
    return f"{len(taken)} steps after the last {variant.method.curve}" if len(taken) else ""


def _preparation(core: Any) -> int:
    """Give the clocks that a block on a carrier takes before its first period."""
    coarse = getattr(core, "coarse", core)
    if not hasattr(coarse, "least_period"):
        return 0
    return coarse.least_period + getattr(coarse, "preparation", 2 * WIDTH + 14)


def _line_documents(core: Part, block: list[int]) -> list[_Said]:
    """Read exercise 3's program and the closed form."""
    xh, yh, xk, yk = block
    dx, dy = xk - xh, yk - yh

    def placed(t: int, x: int, y: int) -> tuple[int, tuple[int, ...]]:
        return t, (xh - x if dx < 0 else xh + x, yh - y if dy < 0 else yh + y)

    program = list(_exercise_3(abs(dx), abs(dy), core))
    closed = [(t, *_closed_form(t, abs(dx), abs(dy), core)) for t, *_ in program]
    return [
        ("the program", [placed(*point) for point in program]),
        ("the closed form", [placed(*point) for point in closed]),
    ]


def _exercise_3(ddx: int, ddy: int, core: Part) -> Iterator[tuple[int, int, int]]:
    """Run exercise 3's program, and give summations and point whenever it draws one.

    The program itself has 16 bits, sums from 0 and does not normalize, though section II says how.
    """
    modulus = 2**core.width
    kox, koy = ddx, ddy
    while core.normalize and 0 < max(ddx, ddy) < modulus // 2:
        ddx, ddy = 2 * ddx, 2 * ddy
    sx = sy = _initial_sum(core)
    x = y = t = 0
    while kox or koy:
        t += 1
        flag = 0
        if kox:
            carry, sx = divmod(sx + ddx, modulus)
            x, kox, flag = x + carry, kox - carry, flag + carry
        if koy:
            carry, sy = divmod(sy + ddy, modulus)
            y, koy, flag = y + carry, koy - carry, flag + carry
        if flag:
            yield t, x, y


def _closed_form(t: int, dx: int, dy: int, core: Part) -> list[int]:
    """Give ⌊(S₀ + t·Δ·2^s) / M⌋ of both axes."""
    shift = core.width - max(dx, dy).bit_length() if core.normalize else 0
    return [(_initial_sum(core) + (t * d << shift)) >> core.width for d in (dx, dy)]


def _initial_sum(core: Part) -> int:
    return 0 if core.preload == "zero" else 2 ** (core.width - 1)


def _comparison_documents(core: Part, block: list[int]) -> list[_Said]:
    """Read the article's routine."""
    xh, yh, xk, yk = block
    x_leads = abs(xk - xh) - abs(yk - yh) + (core.parameters["first"] == "x") > 0
    steps = [(t, (row[0], row[1])) for t, row in enumerate(article(block, x_leads=x_leads))]
    return [("the article", steps[1:])]


def _arc_documents(core: Part, block: list[int]) -> list[_Said]:
    """Read the lecture, where it says something: its algorithm, and the rules that it leaves."""
    options = {name: core.parameters[name] for name in METHODS["circular"].choices}
    steps = (
        []
        if block[:2] == block[2:4] == block[4:6]
        else arc_steps(block, width=core.width, **options)
    )
    # The first summation is in clock 2n + 6, and its step leaves in the next.
    said = [("the rule", [(clock - 2 * core.width - 6, point) for clock, point in steps])]
    xh, yh, xk, yk, *rest = block
    if (
        options == METHODS["circular"].settings["lecture"]
        and not any(rest)
        and (0 <= xk <= xh and 0 <= yh <= yk and (xk, yk) != (xh, yh) and yk)
    ):
        run = lecture.run((xh, yh), (xk, yk), core.width, lecture.Reading(order="device"))
        points = [(cells.xt, cells.yt) for cells in run.cells]
        drawn = [(t, points[t]) for t in range(1, len(points)) if points[t] != points[t - 1]]
        # What is waited for in vain is completed in the summation that changes nothing.
        drawn += [(len(points) - 1, (xk, yk))] * (run.fate == lecture.WAITS)
        said.append(("the lecture", drawn))
    return said


def _exact_line_documents(core: Part, block: list[int]) -> list[_Said]:  # noqa: ARG001
    """Read the rule: every axis at the nearest point, ⌊k·Δ/L + ½⌋ steps from its start."""
    start, ways = block[:2], (block[2] - block[0], block[3] - block[1])
    longest = max(map(abs, ways))
    points = [
        (
            k,
            tuple(
                s + (2 * k * way + longest) // (2 * longest)
                for s, way in zip(start, ways, strict=True)
            ),
        )
        for k in range(1, longest + 1)
    ]
    return [("the rule", points)]


def _exact_arc_documents(core: Part, block: list[int]) -> list[_Said]:  # noqa: ARG001
    """Read the rule: of the two points that may come next the one nearer to the circle."""
    empty = block[:2] == block[2:4] == block[4:6]
    return [("the rule", [] if empty else exact_steps(block))]


def _conic_documents(core: Part, block: list[int]) -> list[_Said]:
    """Read the rules, with every derivative and velocity from its definition."""
    options = {name: core.parameters[name] for name in METHODS["conic"].choices}
    steps = list(conic_steps(block, width=core.width, **options))
    # The first summation is in clock n + 5, and its step leaves in the next.
    return [("the rule", [(clock - core.width - 5, point) for clock, point in steps])]


def _carrier_line_documents(core: Part, block: list[int]) -> list[_Said]:
    """Read the rule: whole parts of the fraction kept and the mean increments, in exact numbers."""
    points = _line_periods(core, block)
    return [("the rule", [(i * block[-1], point) for i, point in enumerate(points)])]


def _line_periods(core: Part, block: list[int]) -> list[tuple[int, ...]]:
    """Give the point after every period of a line, until it comes to its end."""
    xh, yh, xk, yk, periods, _ = block
    deltas, points = (xk - xh, yk - yh), []
    kept = Fraction(0) if core.preload == "zero" else Fraction(1, 2)
    # Mean increments have n + 12 bits of fraction; what is below them is lost.
    one = 1 << (core.width + 12)
    means = [Fraction(math.floor(Fraction(abs(delta), periods) * one), one) for delta in deltas]
    for i in range(1, periods + 1):
        gone = [math.floor(kept + i * mean) for mean in means]
        if i == periods:
            gone = [abs(delta) for delta in deltas]
        points.append(
            tuple(
                begin - way if delta < 0 else begin + way
                for begin, delta, way in zip((xh, yh), deltas, gone, strict=True)
            )
        )
        if gone == [abs(delta) for delta in deltas]:
            break
    return points if any(deltas) else []


def _carrier_arc_documents(core: Part, block: list[int]) -> list[_Said]:
    """Read the formula, in floating point and with the arc's true angle."""
    points = _arc_periods(core, block)
    return [("the formula", [(i * block[-1], point) for i, point in enumerate(points)])]


#: What the device's angle, and the bits of its numbers, may move a point by, in steps. No point of
#: the blocks that the documents are asked is so near to the next whole number.
_ANGLE_SLACK = 0.03


def _arc_periods(core: Part, block: list[int]) -> list[tuple[int, ...]]:
    """Give the point after every period of an arc, until it comes to its end.

    A whole number may be told from the formula only where it is not nearly another one.
    """
    if is_empty(block[:8]):
        return []
    _, _, *end, xc, yc, clockwise, full_turns, periods, _ = block
    (x, y), finish = seen(block[:8])
    angle = (math.atan2(finish[1], finish[0]) - math.atan2(y, x)) % (2 * math.pi)
    u = (angle + 2 * math.pi * full_turns) / periods
    # By its own rule a clockwise arc is mirrored in the products' signs alone.
    side = -1 if clockwise else 1
    x, y, u = float(x), float(side * y), side * u
    before = x * math.cos(u) + y * math.sin(u), y * math.cos(u) - x * math.sin(u)
    kept, top, points = 0.5 if core.preload == "half" else 0.0, 2**core.width - 1, []
    for i in range(1, periods + 1):
        if core.formula == "plain":
            later = x - y * u, y + x * u
        elif core.formula == "predictor_corrector":
            predicted = x - y * u, y + x * u
            later = x - (y + predicted[1]) / 2 * u, y + (x + predicted[0]) / 2 * u
        else:
            kappa = 2 * (1 - math.cos(u))
            later = 2 * x - before[0] - kappa * x, 2 * y - before[1] - kappa * y
        before, (x, y) = (x, y), later
        whole = [math.floor(value + kept) for value in (x, y)]
        if i == periods:
            points.append(tuple(end))
            break
        for value, floor in zip((x, y), whole, strict=True):
            # In the first period of the plain formula an axis may stand still on its whole number.
            near = min(value + kept - floor, floor + 1 - value - kept)
            assert near > _ANGLE_SLACK or (i == 1 and near == 0), (block, i, value)
        points.append(
            tuple(
                min(max(center + value, -1 - top), top)
                for center, value in zip((xc, yc), whole, strict=True)
            )
        )
        if i == periods - 1 and points[-1] == tuple(end):
            break
    return points


def _two_stage_line_documents(core: Any, block: list[int]) -> list[_Said]:
    """Read the rule of the second stage, fed by that of the first."""
    return [("the rule", list(_spread(core, block, _line_periods(core.coarse, block))))]


def _two_stage_arc_documents(core: Any, block: list[int]) -> list[_Said]:
    """Read the rule of the second stage, fed by the first one's golden model."""
    return [
        ("the second stage's rule", list(_spread(core, block, _golden_arc_periods(core, block))))
    ]


def _golden_arc_periods(core: Any, block: list[int]) -> list[tuple[int, ...]]:
    """Give the point after every period of an arc that the golden model has."""
    golden = METHODS["carrier_circular"].model(**core.parameters)
    state, fed, points = golden.reset(), 0, []
    inputs = {
        f"blocks_{name}": value for name, value in zip(_FIELDS["timed arc"], block, strict=True)
    }
    while not state["done"]:
        out = golden.outputs(state)
        assert not out["error"]
        if out["steps_valid"]:
            points.append((out["position_x"] + out["steps_x"], out["position_y"] + out["steps_y"]))
        state = golden.step(state, inputs | {"blocks_valid": int(not fed), "steps_ready": 1})
        fed = 1
    return points


def _spread(
    core: Any, block: list[int], points: list[tuple[int, ...]]
) -> Iterator[tuple[int, tuple[int, ...]]]:
    """Give clock and point of every step: increments summed modulo as many clocks as a period has.

    That is T, or the steps of the axis that has more of them.
    """
    place, began = list(block[:2]), 0
    for before, after in pairwise([tuple(place), *points]):
        ways = [int(b - a) for a, b in zip(before, after, strict=True)]
        modulus = max(block[-1], *map(abs, ways))
        sums = [0 if core.coarse.preload == "zero" else modulus // 2] * 2
        for clock in range(1, modulus + 1):
            carries = []
            for axis, way in enumerate(ways):
                carry, sums[axis] = divmod(sums[axis] + abs(way), modulus)
                carries.append(carry)
                place[axis] += carry if way > 0 else -carry
            if any(carries):
                yield began + clock, tuple(place)
        began += modulus


def _line_blocks() -> np.ndarray:
    """Draw lines of all kinds: every fourth of no length, some too long to run."""
    random = np.random.default_rng(SEED)
    limit = 2**WIDTH
    starts = random.integers(-limit, limit, (40, 2))
    ends = np.clip(starts + random.integers(-limit, limit, (40, 2)), -limit, limit - 1)
    starts[1], ends[1] = -limit, limit - 1
    ends[::4] = starts[::4]
    return np.hstack([starts, ends])


#: Arcs that end backward, that end with Y short, and whose end is one step outside the circle.
_NAMED_ARCS = [
    (-8, 5, -10, -1, 0, 0, 0, 0),
    (1, -1, 0, 2, 0, 0, 0, 0),
    (3, 4, 0, 6, 0, 0, 0, 0),
]


def _arc_blocks() -> np.ndarray:
    """Draw arcs of all kinds, with those of a name between them."""
    return np.concatenate([draw_arcs(WIDTH, 16, seed=SEED, radius=3, turns=1), _NAMED_ARCS])


def _sound_arcs() -> np.ndarray:
    """Give quarters, circles, and arcs of all kinds that are not refused."""
    axis = [(r, 0) for r in range(1, 8)]
    quarters = [(*start, *end[::-1], 0, 0, 0, 0) for start, end in zip(axis, axis, strict=True)]
    drawn = draw_arcs(WIDTH, 32, seed=SEED + 1, radius=6, turns=1)
    sound = [block for block in drawn.tolist() if not fault(block, WIDTH)]
    return np.array([*quarters, *_NAMED_ARCS, *sound])


#: Over half a turned ellipse; a quarter whose end is a step beyond the curve; an arc at whose end
#: one axis goes on alone.
_NAMED_CONICS = [
    (22, -17, 12, 0, 0, 7, 0, 0, 10, 0, 2),
    (1, 0, 1, 0, 0, 4, 0, 0, 5, 0, 0),
    (15, 0, 15, 138, 283, -4, -5, -7, -6, 0, 1),
]

#: Wrong ends and turns: ends backward along x, and along y; and one in a corner, which ends there.
_WRONG_CONICS = [
    (1, 0, 1, 0, 0, 4, 0, 2, 2, 0, 1),
    (1, 0, 1, 0, 0, 0, 4, 2, 2, 1, 1),
    (0, 0, 0, 1, -1, 15, 15, 15, 15, 0, 1),
]


def _conic_blocks() -> np.ndarray:
    """Draw curves of all kinds, refused and empty ones among them, with those of a name between."""
    return np.concatenate([draw_conics(WIDTH, 8, seed=SEED, turns=1), _NAMED_CONICS, _WRONG_CONICS])


def _sound_conics() -> np.ndarray:
    """Give curves of all kinds that are not refused, those of a name last."""
    drawn = draw_conics(WIDTH, 10, seed=SEED + 1, turns=2).tolist()
    sound = [block for block in drawn if not conic_fault(block) and block[5:7] != block[7:9]]
    return np.array([*sound, *_NAMED_CONICS])


#: Fields before ``periods`` and ``period`` of lines on a carrier of the benches that need a name:
#: a mean that is rounded down at a half; half a step in two periods; more steps than clocks.
_NAMED_TIMED_LINES = [
    (3, -2, 8, -2, 6, 5),
    (0, 0, 1, -2, 6, 4),
    (-7, 4, -7, 5, 2, 12),
    (-9, 3, 4, -12, 2, 3),
    (2, 1, 13, 6, 1, 2),
]


def _timed_lines() -> np.ndarray:
    """Give lines of all kinds on a carrier that are not refused: one of five of no length."""
    random = np.random.default_rng(SEED)
    starts = random.integers(-(2**WIDTH), 2**WIDTH, (30, 2))
    ends = starts + random.integers(1 - 2**WIDTH, 2**WIDTH, (30, 2))
    ends = np.clip(ends, -(2**WIDTH), 2**WIDTH - 1)
    ends[::5] = starts[::5]
    timing = np.column_stack([random.integers(1, 12, 30), random.integers(2, 12, 30)])
    return np.vstack([_NAMED_TIMED_LINES, np.hstack([starts, ends, timing])])


#: Timings that are refused: no periods, and periods too short.
_BAD_LINE_TIMINGS = [(0, 5), (3, 1), (7, 0)]


def _timed_line_blocks() -> np.ndarray:
    """Draw lines of all kinds on a carrier, those that are refused among them."""
    lines = _timed_lines()
    too_long = [(-(2**WIDTH), 0, 2**WIDTH - 1, 3, 4, 6)]
    bad = [(*lines[i, :4], *timing) for i, timing in enumerate(_BAD_LINE_TIMINGS)]
    return np.vstack([lines[:12], too_long, lines[12:16], bad, lines[16:24]])


#: Arcs on a carrier that the documents are asked: one that is led out of the coordinates, one
#: clockwise, one of two crossings, one of no length, one whose end is a step outside, one of a
#: single period, and one at whose end with preload half the period before the last has come.
_NAMED_TIMED_ARCS = [
    (15, 0, 0, 15, 0, 0, 0, 0, 4, 66),
    (-4, 9, 4, 1, -4, 1, 1, 0, 4, 67),
    (4, -4, -4, 4, -3, -3, 0, 0, 4, 72),
    (2, 2, 2, 2, 2, 2, 0, 0, 64, 80),
    (3, 4, 0, 6, 0, 0, 0, 0, 9, 70),
    (12, 5, 10, 8, 0, 0, 0, 0, 1, 90),
    (12, 5, 11, 7, 0, 0, 0, 0, 5, 66),
]


def _timed_arcs() -> np.ndarray:
    """Give arcs on a carrier that are not refused."""
    return np.array(_NAMED_TIMED_ARCS)


def _timed_arc_blocks() -> np.ndarray:
    """Give arcs of all kinds on a carrier, and such that are refused because of arc or timing."""
    wide, clockwise, two, none, outside, single, arrives = map(list, _NAMED_TIMED_ARCS)
    # Periods that only the plain formula has time for.
    quick = [
        (5, 0, 0, 5, 0, 0, 0, 0, 5, 24),
        *((*arc[:8], *timing) for arc, timing in ((two, (6, 25)), (outside, (5, 27)))),
        *((*arc[:8], *timing) for arc, timing in ((single, (2, 45)), (arrives, (5, 26)))),
    ]
    # No periods, a period too short, too few periods, an end off the curve, a centre too far off.
    bad = [
        (*wide[:8], 0, 70),
        (*wide[:8], 4, 23),
        (*two[:8], 3, 70),
        (3, 4, 0, 9, 0, 0, 0, 0, 4, 70),
        (-9, 0, 9, 0, 9, 0, 0, 0, 9, 70),
    ]
    return np.array([*quick[:3], wide, bad[0], none, clockwise, single, *bad[1:], *quick[3:]])


def _lines() -> np.ndarray:
    """Give every line of the width, the line of no length last, behind one that moves."""
    return np.roll(survey_groups(METHODS["linear"], WIDTH)[0].blocks, -1, axis=0)


#: By the kind of curve: the fields of a block.
_FIELDS: dict[str, tuple[str, ...]] = {"line": ("start_x", "start_y", "end_x", "end_y")}
_FIELDS["arc"] = (*_FIELDS["line"], "center_x", "center_y", "clockwise", "full_turns")
_FIELDS["conic"] = FIELDS
_FIELDS["timed line"] = (*_FIELDS["line"], "periods", "period")
_FIELDS["timed arc"] = (*_FIELDS["arc"], "periods", "period")

#: By the kind of curve, or by the method if it has documents of its own: what the documents are
#: asked, and how they are read.
_DOCUMENTS = {
    "line": (_lines(), _line_documents),
    "arc": (_sound_arcs(), _arc_documents),
    "exact_line": (_lines(), _exact_line_documents),
    "exact_arc": (_sound_arcs(), _exact_arc_documents),
    "conic": (_sound_conics(), _conic_documents),
    "comparison": (_lines(), _comparison_documents),
    "carrier_linear": (_timed_lines(), _carrier_line_documents),
    "carrier_circular": (_timed_arcs(), _carrier_arc_documents),
    "two_stage_linear": (_timed_lines(), _two_stage_line_documents),
    "two_stage_circular": (_timed_arcs(), _two_stage_arc_documents),
}

#: Of these only the golden model says which steps they take; it has tests of its own.
_UNDOCUMENTED = {"exact_conic"}

#: By the kind of curve: the blocks of the benches that know everything.
_BLOCKS = {
    "line": _line_blocks(),
    "arc": _arc_blocks(),
    "conic": _conic_blocks(),
    "timed line": _timed_line_blocks(),
    "timed arc": _timed_arc_blocks(),
}

#: The clocks of a reset in Verilog, and those for a kind of its own: lines on a carrier are also
#: reset within a block, and arcs on a carrier take so long before they run.
_RESETS = (60, 150, 151)
_OWN_RESETS = {"timed line": (43, 100, 160, 161), "timed arc": (150, 620, 621)}


@cache
def _expected(
    golden: Any, key: str, stalls: Stalls, resets: tuple[int, ...] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Give the golden registers and outputs at every clock of the blocks of a kind."""
    fields = [f"blocks_{name}" for name in _FIELDS[key]]
    return golden_trace(golden, fields, _BLOCKS[key], _CLOCK_LIMIT, stalls, resets, until_idle=True)


def simulation(variant: Variant) -> str:
    """Compare every register and output at every clock in pysim, without and with stalls."""
    key = kind(variant.method)
    for stalls in (NO_STALLS, Stalls(seed=SEED, stall=0.4, gap=0.3)):
        golden = variant.golden(WIDTH)
        names = [f"reg_{name}" for name in golden.registers()]
        names += list(golden.outputs(golden.reset()))
        expected = np.hstack(_expected(golden, key, stalls))
        model = PysimModel(variant.device(WIDTH), watch=tuple(names))
        seen = model.run(_BLOCKS[key], len(expected), stalls=stalls).watch
        if finding := _difference(seen, expected, names):
            return finding
    return ""


def _difference(seen: np.ndarray, expected: np.ndarray, names: list[str]) -> str:
    """Tell the first difference between two records of all clocks."""
    if np.array_equal(seen, expected):
        return ""
    clock, column = np.argwhere(seen != expected)[0]
    return (
        f"{names[column]} is {seen[clock, column]} in clock {clock}, where the golden model has "
        f"{expected[clock, column]}"
    )


#: The widths of rung 3, by the kind of curve if they are more.
_EQUIVALENCE_WIDTHS = {"line": (WIDTH, 2 * WIDTH)}


def equivalence_by_proof(variant: Variant) -> str:
    """Prove the device equal to the golden model, for all states and inputs."""
    for width in _EQUIVALENCE_WIDTHS.get(kind(variant.method), (WIDTH,)):
        if finding := _prove(equivalence(variant.device(width), variant.golden(width))):
            return f"width {width}: {finding}"
    return ""


def promises(variant: Variant) -> str:
    """Prove the promises of the device itself, in place of its golden model."""
    device = _Device(variant)
    proofs = variant.method.proof_module()
    # What the variants of a method have in common, if anything, is the shorter part.
    for promised in (getattr(proofs, "shared", None), proofs.promises):
        obligations = promised(device.golden) if promised else []
        finding = _prove(
            [
                device.tied(obligation)
                for obligation in obligations
                # The others are about numbers, whatever the device, or run the golden model.
                if isinstance(obligation, Obligation) and not obligation.arithmetic
            ]
        )
        if finding:
            return finding
    return ""


class _Device:
    """A device with the face of its golden model: its clock is a clock of the RTL.

    Attributes
    ----------
    golden : object
        The face, of the golden model's own class.
    """

    def __init__(self, variant: Variant):
        self._core = core = variant.device(WIDTH)
        self._rtl = Rtl(core)
        self._transition = [*self._rtl.transition, self._rtl.rst == 0]
        self._symbols = _symbols(self._transition)
        # Of every clock what ties together its values, and the clocks that these are from.
        self._clocks: list[tuple[list[z3.BoolRef], set[int]]] = []
        face = {"reset": self._reset, "step": self._step, "outputs": self._outputs}
        methods = {name: lambda _, *given, f=f: f(*given) for name, f in face.items()}
        golden = variant.golden(WIDTH)
        self.golden = type("Device", (type(golden),), methods)(**vars(golden))

    def _reset(self):
        return {name: register.init for name, register in self._core.registers.items()}

    def _step(self, state, inputs, tell=None):
        return self._clock(state | inputs, self._rtl.registers, "{}'", tell)

    def _outputs(self, state):
        return self._clock(state, self._rtl.outputs, "out.{}")

    def _clock(self, given, wanted, symbol, tell=None):
        """Make a clock of its own, with given values before it, and give some of its values.

        What ``tell`` puts in the place of a value between the registers is that value.
        """
        wide = given["running"].size()
        number = len(self._clocks)
        own = {
            name: (value, z3.Const(f"{name}#{number}", value.sort()))
            for name, value in self._symbols.items()
        }
        kinds = self._rtl.registers | self._rtl.inputs
        facts = [z3.substitute(fact, *own.values()) for fact in self._transition]
        facts += [
            extend(own[name][1], signed, wide) == given[name]
            for name, (_, signed) in kinds.items()
            if name in given
        ]
        if tell is not None:
            for name, (_, signed) in self._rtl.intermediates.items():
                value = extend(own[name][1], signed, wide)
                facts.append(tell(name, value) == value)
        self._clocks.append((facts, _clocks_of(given.values())))
        return {
            name: extend(own[symbol.format(name)][1], signed, wide)
            for name, (_, signed) in wanted.items()
        }

    def tied(self, obligation: Obligation) -> Obligation:
        """Assume those clocks of the RTL of which an obligation speaks."""
        claims = obligation.claims
        claims = list(claims.values() if isinstance(claims, dict) else claims)
        todo, spoken = _clocks_of([*obligation.assumptions, *claims]), set()
        while todo:
            spoken |= todo
            todo = set().union(*(self._clocks[number][1] for number in todo)) - spoken
        facts = [fact for number in sorted(spoken) for fact in self._clocks[number][0]]
        return replace(obligation, assumptions=[*facts, *obligation.assumptions])


def _clocks_of(terms: Iterable[Any]) -> set[int]:
    """Give the numbers of the clocks whose values occur in some terms."""
    return {int(name.partition("#")[2]) for name in _symbols(terms) if "#" in name}


def _symbols(terms: Iterable[Any]) -> dict[str, z3.ExprRef]:
    """Give all symbols in some terms that stand for a value, by name."""
    found: dict[str, z3.ExprRef] = {}
    todo, seen = [term for term in terms if isinstance(term, z3.ExprRef)], set()
    while todo:
        term = todo.pop()
        if term.get_id() in seen:
            continue
        seen.add(term.get_id())
        todo += term.children()
        if z3.is_const(term) and term.decl().kind() == z3.Z3_OP_UNINTERPRETED:
            found[term.decl().name()] = term
    return found


def _prove(obligations: list[Obligation]) -> str:
    """Tell the first thing that does not hold, and the values that break it."""
    for obligation in obligations:
        verdict = check(obligation)
        # A solver that gives up has not caught anything.
        assert "gave up" not in verdict.counterexample, verdict
        if not verdict.holds:
            claim, _, values = verdict.counterexample.rpartition(": ")
            # Not the values within a clock of the RTL.
            values = ", ".join(value for value in values.split(", ") if "#" not in value)
            return f"{verdict.title}: {claim}: {values}"
    return ""


def compiled(variant: Variant) -> str:
    """Survey a width on the compiled engine."""
    method = replace(
        variant.method, name=variant.name, device=lambda width, **_: variant.device(width)
    )
    # Some curves of each kind tell as much here as thousands.
    budget = 1 << 18 if method.timed else survey_samples.SAMPLE_BUDGET
    with (
        patch.object(survey_samples, "_CURVES", 1000),
        patch.object(survey_samples, "SAMPLE_BUDGET", budget),
    ):
        groups = survey_groups(method, WIDTH)
    bound = method.bound(variant.golden(WIDTH))
    findings = []
    with (
        patch.dict(METHODS, {method.name: method}),
        patch.object(survey, "_groups", groups),
        # Quick to build rather than to run: the runs are short.
        patch.object(engine, "_FLAGS", (*engine._FLAGS, "-O0")),
    ):
        for number, group in enumerate(groups):
            everything = (method, WIDTH, variant.options, number, group, survey.REGISTER_BUDGET)
            for part in survey._parts(*everything):
                row = survey._survey_part(part)
                findings += row.findings
                if bound is not None and row.largest_error > bound + 1e-9:
                    block, point = survey.say_worst(method, group, row)
                    findings.append(f"largest error {row.largest_error:.4f}: {block} at {point}")
                if row.ends_missed:
                    findings.append(f"{row.ends_missed} ends missed of {group.title}")
    return "; ".join(findings)


def icarus(variant: Variant) -> str:
    """Compare the outputs of the Verilog in Icarus at every clock, with stalls and resets."""
    return _foreign(variant, "icarus")


def verilator(variant: Variant) -> str:
    """Compare the outputs of the Verilog in Verilator at every clock, with stalls and resets."""
    return _foreign(variant, "verilator")


def _foreign(variant: Variant, simulator: str) -> str:
    stalls = Stalls(seed=SEED + 1, stall=0.4, gap=0.3)
    key = kind(variant.method)
    resets = _OWN_RESETS.get(key, _RESETS)
    golden, top = variant.golden(WIDTH), PlainPorts(variant.device(WIDTH))
    blocks = _BLOCKS[key]
    _, expected = _expected(golden, key, stalls, resets)
    names = list(golden.outputs(golden.reset()))
    text = verilog(top, "device")
    try:
        trace = run_foreign(
            text, "device", top, simulator, blocks, len(expected), stalls, resets=resets
        )
    except UnknownOutputError as error:
        return str(error)
    columns = [list(top.outputs).index(name) for name in names]
    return _difference(trace[:, columns], expected, names)


#: The rungs in their order, by their names in the table.
RUNGS: dict[str, Callable[[Variant], str]] = dict(
    zip(
        ALL,
        (documents, simulation, equivalence_by_proof, promises, compiled, icarus, verilator),
        strict=True,
    )
)


def missing(rung: str) -> str:
    """Say why a rung cannot be climbed here; "" when it can."""
    if rung in ("Icarus", "Verilator"):
        return available(rung.lower()) or ""
    if rung == "compiled" and engine.compiler() is None:
        return "no C++ compiler (c++, g++, clang++ or $CXX)"
    return ""


def matrix(method: str, caught_by: dict[str, set[str]], left_out: Collection[str] = ()) -> str:
    """Lay out which rungs catch which design of a method, as a Markdown table."""

    def word(rung: str, rungs: set[str]) -> str:
        return "–" if rung in left_out else "caught" if rung in rungs else "passes"

    table = Table(box=MARKDOWN)
    table.add_column("design", no_wrap=True)
    for number, rung in zip((1, 2, 3, 4, 5, 6, 6), RUNGS, strict=True):
        table.add_column(f"{number} {rung}", no_wrap=True)
    for design in (*SOUND, *VARIANTS):
        if design.method.name == method:
            table.add_row(design.name, *(word(rung, caught_by[design.name]) for rung in RUNGS))
    console = Console(width=200)
    with console.capture() as capture:
        console.print(table)
    return "\n".join(line.strip() for line in capture.get().strip().splitlines())


def _climb(job: tuple[int, str]) -> str:
    index, rung = job
    return RUNGS[rung]([*SOUND, *VARIANTS][index])


def main() -> int:
    """Print what every rung sees of every design, then the matrix; 1 if it is not as expected."""
    out = Console(highlight=False, soft_wrap=True)
    designs = [*SOUND, *VARIANTS]
    rungs = [rung for rung in RUNGS if not missing(rung)]
    for rung in RUNGS:
        if reason := missing(rung):
            out.print(f"{rung} is left out: {reason}", markup=False)
    jobs = list(product(range(len(designs)), rungs))
    caught: dict[str, set[str]] = {design.name: set() for design in designs}
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for (index, rung), finding in zip(jobs, pool.map(_climb, jobs), strict=True):
            if finding:
                name = designs[index].name
                caught[name].add(rung)
                line = textwrap.shorten(finding, 180, placeholder=" …")
                out.print(f"{name}, {rung}: {line}", markup=False)
    for method in METHODS:
        out.print(f"\n{method}:\n", markup=False)
        out.print(matrix(method, caught, RUNGS.keys() - rungs), markup=False)
    expected = {design.name: design.caught_by & set(rungs) for design in designs}
    return int(caught != expected)


if __name__ == "__main__":
    sys.exit(main())
