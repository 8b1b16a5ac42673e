import csv
import json
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
        BadInputError, match=r"^method circular draws arcs and no lines: choose lin"
    ):
        run(Polyline(POINTS), CIRCULAR)
    with pytest.raises(BadInputError, match=r"^method linear draws lines and no arcs: choose circ"):
        run(ARC, LINEAR)


def test_choices_in_words():
    assert say_choices({"normalize": True, "preload": "half"}) == "normalize, preload half"
    assert say_choices({"preload": "zero", "normalize": False}) == "preload zero, no normalize"
