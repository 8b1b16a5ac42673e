import io

import numpy as np
import pytest
from amaranth import Module, Signal
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import ErrorCode, Part, point_layout, step_layout
from discreta.hdl.linear import Linear
from discreta.hdl.quadrant import line_block_layout
from discreta.sim import simulate as simulation
from discreta.sim.compiled import CompiledModel, compiler
from discreta.sim.interpreted import PysimModel
from discreta.sim.simulate import ENGINES, DeadCoreError, default_engine, simulate
from discreta.sim.stalls import NO_STALLS, Stalls
from discreta.sim.stretch import EVENT_COLUMNS
from tests.lines import path_steps

WIDTH = 6
WATCH = ("blocks_ready", "steps_valid", "reg_p3", "reg_sx", "reg_running")
STALLS = [NO_STALLS, Stalls(5, stall=0.3), Stalls(6, gap=0.7), Stalls(7, stall=0.5, gap=0.5)]


def blocks():
    """Draw blocks, some of no length and some that are refused."""
    rng = np.random.default_rng(11)
    ends = rng.integers(-(2**WIDTH), 2**WIDTH, (25, 4))
    ends[::2, 2:] = np.clip(
        ends[::2, :2] + rng.integers(-9, 10, (13, 2)), -(2**WIDTH), 2**WIDTH - 1
    )
    ends[::5, 2:] = ends[::5, :2]
    return ends


def run(**options):
    stretches = list(simulate(Linear(WIDTH, 2), blocks(), limit=9000, watch=WATCH, **options))
    return [
        np.concatenate([stretch.events for stretch in stretches]),
        np.concatenate([stretch.watch for stretch in stretches]),
        [
            sum(getattr(stretch, name) for stretch in stretches)
            for name in ("ran", "fed", "answered")
        ],
    ]


def assert_same(seen, expected):
    for one, other in zip(seen, expected, strict=True):
        np.testing.assert_array_equal(one, other)


class Silent(Part):
    """Takes every block and never answers."""

    def __init__(self):
        super().__init__(
            {
                "blocks": In(stream.Signature(line_block_layout(4, 2))),
                "steps": Out(stream.Signature(step_layout(2))),
                "position": Out(point_layout(4, 2)),
                "busy": Out(1),
                "done": Out(1),
                "error": Out(ErrorCode),
            }
        )
        self.count = Signal(8, name="count")
        self.registers = {"count": self.count}

    def elaborate(self, _):
        m = Module()
        m.d.comb += self.blocks.ready.eq(1)
        m.d.sync += self.count.eq(self.count + 1)
        return m


class Deaf(Silent):
    """Takes no block at all."""

    def elaborate(self, _):
        m = Module()
        m.d.sync += self.count.eq(self.count + 1)
        return m


@pytest.fixture(params=ENGINES)
def engine(request):
    if request.param == "compiled":
        request.getfixturevalue("compiled_engine")
    return request.param


@pytest.mark.usefixtures("compiled_engine")
@pytest.mark.parametrize("stalls", STALLS)
def test_both_engines_run_the_same(stalls):
    pysim, fast = (run(engine=engine, stalls=stalls) for engine in ENGINES)
    assert_same(fast, pysim)
    events, watch, (ran, fed, answered) = pysim
    assert fed == answered == len(blocks())
    assert len(watch) == ran
    errors = events[:, EVENT_COLUMNS.index("error")].sum()
    lengths = np.abs(blocks()[:, 2:] - blocks()[:, :2]).max(axis=1)
    assert errors == np.count_nonzero(lengths >= 2**WIDTH) > 0


@pytest.mark.parametrize("stretch", [1, 3, 64])
@pytest.mark.parametrize("stalls", [STALLS[0], STALLS[-1]])
def test_stretches_joined_are_one_run(engine, stalls, stretch, monkeypatch):
    whole = run(engine=engine, stalls=stalls)
    monkeypatch.setattr(simulation, "STRETCH", stretch)
    assert_same(run(engine=engine, stalls=stalls), whole)


def test_events_are_the_steps_of_the_lines(engine):
    points = [(0, 0), (20, 9), (20, 9), (-7, -13), (-7, -12)]
    path = np.hstack([points[:-1], points[1:]])
    (stretch,) = simulate(Linear(WIDTH, 2), path, limit=500, engine=engine)
    taken = stretch.events[stretch.events[:, EVENT_COLUMNS.index("taken")] == 1]
    reached = np.cumsum(taken[:, 5:7], axis=0).tolist()
    seen = [(clock, tuple(point)) for clock, point in zip(taken[:, 0], reached, strict=True)]
    expected = list(path_steps(points, width=WIDTH))
    assert seen == expected
    lasts = [point for (_, point), last in zip(expected, taken[:, -1], strict=True) if last]
    assert lasts == [(20, 9), (-7, -13), (-7, -12)]


def test_it_stops_with_the_last_answer(engine):
    stretches = list(simulate(Linear(WIDTH, 2), blocks(), limit=10**9, engine=engine))
    events = np.concatenate([stretch.events for stretch in stretches])
    assert sum(stretch.ran for stretch in stretches) == events[-1, 0] + 1
    assert events[-1, EVENT_COLUMNS.index("done")] or events[-1, EVENT_COLUMNS.index("error")]


@pytest.mark.parametrize("core", [Silent, Deaf])
def test_a_dead_core_is_given_up(engine, core, monkeypatch):
    monkeypatch.setattr(simulation, "STRETCH", 300)
    stretches = simulate(core(), np.array([[0, 0, 1, 1]] * 3), limit=1000, engine=engine)
    message = "^0 of 3 blocks are answered after 1000 clocks, where 1000 must do$"
    with pytest.raises(DeadCoreError, match=message):
        list(stretches)


@pytest.mark.parametrize("short", [1, 20])
def test_a_limit_is_kept_to_the_clock(engine, short):
    """A run of so many clocks passes with that limit, and with none below."""
    block = np.array([[0, 0, 20, 9]])
    core = Linear(WIDTH, 2)
    needed = sum(stretch.ran for stretch in simulate(core, block, limit=999, engine=engine))
    assert len(list(simulate(core, block, limit=needed, engine=engine))) == 1
    with pytest.raises(DeadCoreError, match=f"^0 of 1 .* after {needed - short} clocks"):
        list(simulate(core, block, limit=needed - short, engine=engine))


@pytest.mark.parametrize("model", [PysimModel, CompiledModel])
def test_the_model_is_closed_whatever_happens(model, monkeypatch, request):
    if model is CompiledModel:
        request.getfixturevalue("compiled_engine")
    engine = ENGINES[model is CompiledModel]
    closed = []
    close = model.close
    monkeypatch.setattr(model, "close", lambda self: (closed.append(1), close(self)))
    list(simulate(Linear(WIDTH, 2), blocks(), limit=9000, engine=engine))
    assert len(closed) == 1
    stretches = simulate(Linear(WIDTH, 2), blocks(), limit=9000, engine=engine)
    next(stretches)
    del stretches
    assert len(closed) >= 2
    with pytest.raises(DeadCoreError):
        list(simulate(Linear(WIDTH, 2), blocks(), limit=5, engine=engine))
    assert len(closed) >= 3


def test_the_waveform_is_whole():
    file = io.StringIO()
    list(simulate(Linear(WIDTH, 2), np.array([[0, 0, 3, 2]]), limit=99, vcd=file))
    text = file.getvalue()
    assert "$enddefinitions" in text
    assert len(text.split("$enddefinitions")[1].splitlines()) > 20


def test_the_engine_that_is_chosen(monkeypatch):
    assert default_engine() == ("compiled" if compiler() else "pysim")
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.delenv("CXX", raising=False)
    assert default_engine() == "pysim"
