import csv
import json
from fractions import Fraction
from math import hypot
from pathlib import Path

import numpy as np
import pytest

from discreta.sim.curves import Arc, Polyline
from discreta.sim.methods import METHODS
from discreta.sim.points import BadInputError
from discreta.sim.run import run, say_choices
from tests.arcs import arc_steps
from tests.lines import distance, path_steps

LINEAR, CIRCULAR = METHODS["linear"], METHODS["circular"]
ARC = Arc((40, 9), (-9, 40), (0, 0), clockwise=True, turns=2)
POINTS = np.array([(0, 0), (20, 9), (-7, -13), (-7, -12), (0, 0)])


def worst(points, **options):
    """Give the largest error and the number of steps, worked out line by line."""
    largest, count = 0.0, 0
    for start, end in zip(points[:-1].tolist(), points[1:].tolist(), strict=True):
        for _, point in path_steps([start, end], **options):
            largest = max(largest, distance(point, start, end))
            count += 1
    return largest, count


def test_one_call_runs_a_path(tmp_path):
    trace, json_file = tmp_path / "t.csv", tmp_path / "s.json"
    seen = []
    summary = run(
        Polyline(POINTS),
        LINEAR,
        width=6,
        engine="pysim",
        trace=str(trace),
        summary_file=str(json_file),
        progress=lambda *counts: seen.append(counts),
        normalize=False,
        preload="zero",
    )
    options = {"width": 6, "normalize": False, "preload": "zero"}
    expected = list(path_steps(POINTS.tolist(), **options))
    rows = list(csv.reader(trace.read_text().splitlines()))
    assert rows[:2] == [["clock", "x", "y"], ["0", "0", "0"]]
    numbers = [[int(cell) for cell in row] for row in rows[2:]]
    assert [(clock, tuple(point)) for clock, *point in numbers] == expected
    largest, steps = worst(POINTS, **options)
    assert summary == {
        "method": "linear",
        "width": 6,
        "axes": 2,
        "normalize": False,
        "preload": "zero",
        "engine": "pysim",
        "clocks": expected[-1][0],
        "summations": 4 * 64,
        "steps": steps,
        "clocks per step": round(expected[-1][0] / steps, 4),
        "largest error": round(largest, 4),
        "largest error at": summary["largest error at"],
        "error bound": 1.0,
        "segments": 4,
        "support points hit": 4,
        "path closed": True,
        "clocks lost between blocks": 0,
        "end point reached": True,
    }
    assert json.loads(json_file.read_text()) == summary
    at = tuple(summary["largest error at"])
    errors = [
        distance(at, start, end)
        for start, end in zip(POINTS[:-1].tolist(), POINTS[1:].tolist(), strict=True)
    ]
    assert any(error == pytest.approx(largest) for error in errors)
    # The bar begins with nothing done, and goes on by clocks up to a total that is enough.
    (first, total), *_, (last, _) = seen
    assert first == 0
    assert expected[-1][0] < last <= total
    assert {most for _, most in seen} == {total}


def test_one_call_runs_an_arc(tmp_path):
    trace, json_file = tmp_path / "t.csv", tmp_path / "s.json"
    seen = []
    summary = run(
        ARC,
        CIRCULAR,
        width=6,
        engine="pysim",
        trace=str(trace),
        summary_file=str(json_file),
        progress=lambda *counts: seen.append(counts),
        preload="zero",
        guard=1,
    )
    block = ARC.blocks[0].tolist()
    steps = list(arc_steps(block, width=6, preload="zero", guard=1))
    rows = list(csv.reader(trace.read_text().splitlines()))
    assert rows[:2] == [["clock", "x", "y"], ["0", "40", "9"]]
    numbers = [[int(cell) for cell in row] for row in rows[2:]]
    assert [(clock, tuple(point)) for clock, *point in numbers] == steps
    errors = {point: abs(hypot(*point) - hypot(40, 9)) for _, point in steps}
    clocks = steps[-1][0]
    assert summary == {
        "method": "circular",
        "width": 6,
        "order": "alternated",
        "normalize": True,
        "preload": "zero",
        "guard": 1,
        "engine": "pysim",
        "clocks": clocks,
        # Prepared for 2n + 5 clocks, started in the next; the last step leaves behind the last sum.
        "summations": clocks - (2 * 6 + 5) - 1,
        "steps": len(steps),
        "clocks per step": round(clocks / len(steps), 4),
        "largest error": round(max(errors.values()), 4),
        "largest error at": summary["largest error at"],
        "radius": 41.0,
        # A right angle the long way, and a turn before it.
        "turn": -270.0 - 360,
        "end point reached": True,
    }
    assert json.loads(json_file.read_text()) == summary
    at = tuple(summary["largest error at"])
    assert errors[at] == pytest.approx(max(errors.values()), abs=1e-9)
    (first, total), *_, (last, _) = seen
    assert first == 0
    assert clocks < last <= total


@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize(("curve", "method"), [(Polyline(POINTS), LINEAR), (ARC, CIRCULAR)])
def test_both_engines_write_the_same(tmp_path, curve, method):
    files = {}
    for engine in ("pysim", "compiled"):
        names = {kind: str(tmp_path / f"{engine}.{kind}") for kind in ("csv", "svg")}
        summary = run(curve, method, width=6, engine=engine, trace=names["csv"], plot=names["svg"])
        assert summary.pop("engine") == engine
        files[engine] = [summary, *(Path(name).read_bytes() for name in names.values())]
    assert files["pysim"] == files["compiled"]


def test_points_without_room_are_refused():
    with pytest.raises(BadInputError, match=r"^coordinate 20 is out of range: width 4 has room"):
        run(Polyline(POINTS), LINEAR, width=4)
    with pytest.raises(BadInputError, match=r"^coordinate 40 is out of range: width 4 has room"):
        run(ARC, CIRCULAR, width=4)


def test_a_method_draws_its_own_curves_alone():
    with pytest.raises(
        BadInputError, match=r"^method circular draws arcs and no lines: choose exact_line or lin"
    ):
        run(Polyline(POINTS), CIRCULAR)
    with pytest.raises(
        BadInputError, match=r"^method linear draws lines and no arcs: choose exact_arc or circ"
    ):
        run(ARC, LINEAR)


def test_a_line_on_a_carrier(tmp_path):
    """By the lecture: ⌊i·Δ/N⌋ after i periods of T clocks, and the end after the last one."""
    trace = tmp_path / "t.csv"
    line, speed, period = Polyline([(-3, 5), (30, -39)]), Fraction(1, 7), 30
    method = METHODS["carrier_linear"]
    summary = run(
        line,
        method,
        width=6,
        engine="pysim",
        trace=str(trace),
        speed=speed,
        period=period,
        preload="zero",
    )
    # 55 steps long.
    periods = -(-55 * 7 // period)
    means = [Fraction(delta * 2**18 // periods, 2**18) for delta in (33, 44)]
    expected = [(int(i * means[0]) - 3, 5 - int(i * means[1])) for i in range(periods)]
    _, *lines = csv.reader(trace.read_text().splitlines())
    rows = [[int(cell) for cell in row] for row in lines]
    assert [tuple(point) for _, *point in rows] == [*expected, (30, -39)]
    clocks = [clock for clock, *_ in rows]
    assert set(np.diff(clocks[1:])) == {period}
    largest = max(distance(point, (-3, 5), (30, -39)) for point in expected)
    steps = sum(max(np.abs(np.diff(rows, axis=0)[i, 1:])) for i in range(periods))
    assert summary == {
        "method": "carrier_linear",
        "width": 6,
        "preload": "zero",
        "engine": "pysim",
        "clocks": clocks[-1],
        "steps": steps,
        "clocks per step": round(clocks[-1] / steps, 4),
        "period": period,
        "periods": periods,
        "steps per period": round(55 / periods, 4),
        "mean increments": [round(33 / periods, 4), round(-44 / periods, 4)],
        "largest error": round(largest, 4),
        "largest error at": summary["largest error at"],
        "error bound": 1.0625,
        "segments": 1,
        "support points hit": 1,
        "path closed": False,
        "end point reached": True,
    }


@pytest.mark.parametrize("name", ["carrier_circular", "two_stage_circular"])
def test_an_arc_on_a_carrier(name):
    summary = run(ARC, METHODS[name], width=6, engine="pysim", period=110)
    turn = np.radians(630)
    periods = int(np.ceil(41 * turn / 11))
    facts = {"period": 110, "periods": periods, "steps per period": round(41 * turn / periods, 4)}
    facts |= {"mean angle": round(-turn / periods, 6), "turn": -630.0, "end point reached": True}
    assert summary == summary | facts
    assert 110 * (periods - 1) < summary["clocks"] < 110 * (periods + 9)


def test_paths_on_a_carrier_say_what_their_lines_have_together():
    summary = run(Polyline(POINTS), METHODS["two_stage_linear"], width=6, engine="pysim", period=50)
    lengths = np.hypot(*np.diff(POINTS, axis=0).T)
    periods = int(np.ceil(lengths / 5).sum())
    assert (summary["periods"], summary["support points hit"]) == (periods, len(POINTS) - 1)
    assert summary["steps per period"] == round(lengths.sum() / periods, 4)
    assert not {"mean increments", "summations", "clocks lost between blocks"} & summary.keys()


def test_a_timing_that_cannot_be_is_refused():
    fast = Fraction(1)
    with pytest.raises(BadInputError, match=r"too few periods; lower --speed or --period$"):
        run(ARC, METHODS["carrier_circular"], width=8, speed=fast)
    with pytest.raises(BadInputError, match=r"^--period 101: the device takes 102 to 16777215 clo"):
        run(ARC, METHODS["two_stage_circular"], width=8, period=101)
    without = r" is no option of circular, which has no carrier"
    with pytest.raises(BadInputError, match=f"^--speed{without}"):
        run(ARC, CIRCULAR, speed=fast)
    with pytest.raises(BadInputError, match=f"^--period{without}"):
        run(ARC, CIRCULAR, period=9)
    with pytest.raises(BadInputError, match=r"^the line has 3 axes and method carrier_linear 2: c"):
        run(Polyline([(0, 0, 0), (1, 2, 3)]), METHODS["carrier_linear"])


def test_choices_in_words():
    assert say_choices({"normalize": True, "preload": "half"}) == "normalize, preload half"
    assert say_choices({"preload": "zero", "normalize": False}) == "preload zero, no normalize"
