"""The pulse unit: equality to the golden model, and the very clocks that its docstring names."""

import numpy as np
import pytest
from amaranth.hdl import Fragment, Value

from discreta.hdl.plain import PlainPorts
from discreta.hdl.pulse import KINDS, TIMING_BITS, PulseUnit
from discreta.sim.golden.pulse import PulseUnit as GoldenPulseUnit
from tests.hdl.parts.clocked import BAD_AXES, BAD_WIDTHS, assert_refused, run

TIMINGS = ("pulse_length", "pulse_space", "direction_setup", "direction_hold")
TYPICAL = dict(zip(TIMINGS, (2, 3, 4, 2), strict=True))
AT_ONCE = dict.fromkeys(TIMINGS, 0)


def trace(unit, steps, clocks, timings=TYPICAL, events=None, seen=None):
    """Offer steps as (x, y), one behind the other, and give the outputs of every clock.

    ``events`` has further inputs by the clock from which on they have the value. Also given, under
    ``taken``, are the clocks in which a step is taken.
    """
    top = PlainPorts(unit)
    watch = seen or tuple(top.outputs)
    rows = {name: [] for name in (*watch, "taken")}

    async def bench(ctx):
        for name, value in timings.items():
            ctx.set(top.inputs[name], value)
        left = list(steps)
        for clock in range(clocks):
            for name, value in (events or {}).get(clock, {}).items():
                ctx.set(top.inputs[name], value)
            ctx.set(top.inputs["steps_valid"], bool(left))
            for a, value in zip("xy", left[0] if left else (0, 0), strict=True):
                ctx.set(top.inputs[f"steps_{a}"], value)
            for name in watch:
                rows[name].append(ctx.get(top.outputs[name]))
            if left and ctx.get(top.outputs["steps_ready"]):
                rows["taken"].append(clock)
                del left[0]
            await ctx.tick()

    run(top, bench)
    return rows


def shape(levels):
    """Draw a pin's levels: a character a clock."""
    return "".join("_‾"[level] for level in levels)


def rises(levels):
    return [clock for clock in range(1, len(levels)) if levels[clock] > levels[clock - 1]]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("width", "axes", "inverted_steps", "inverted_directions"),
    [(4, 2, "", ""), (16, 2, "yx", "y"), (5, 3, "z", "xz")],
)
def test_every_register_and_output_at_every_clock(
    kind, width, axes, inverted_steps, inverted_directions
):
    """Timings, stops, switches, loads and steps at random, each of them at any time."""
    options = {
        "kind": kind,
        "inverted_steps": inverted_steps,
        "inverted_directions": inverted_directions,
    }
    unit = PulseUnit(width, axes, **options)
    golden = GoldenPulseUnit(width, axes, **options)
    top = PlainPorts(unit, observe=unit.registers)
    rng = np.random.default_rng([width, axes, KINDS.index(kind)])
    watched = [(name, top.outputs[f"reg_{name}"]) for name in golden.registers()]
    shown = [(name, port) for name, port in top.outputs.items() if not name.startswith("reg_")]

    def random_inputs(clock):
        inputs = {"steps_valid": rng.random() < 0.8, "load": rng.random() < 0.02}
        # Stops and active switches are rare and last for a while.
        inputs["stop"] = clock % 97 > 93
        for index, a in enumerate(golden.letters):
            inputs[f"steps_{a}"] = rng.choice([-2, -1, 0, 1], p=[0.02, 0.33, 0.3, 0.35])
            inputs[f"initial_{a}"] = rng.integers(-(2**width), 2**width)
            inputs[f"low_limit_{a}"] = (clock + 40 * index) % 131 > 120
            inputs[f"high_limit_{a}"] = (clock + 70 * index) % 149 > 135
        most = 3 if clock // 200 % 2 else 9
        inputs |= {name: rng.integers(0, most, endpoint=True) for name in TIMINGS}
        return {name: int(value) for name, value in inputs.items()}

    async def bench(ctx):
        state, moved, limited, stopped = golden.reset(), 0, 0, 0
        for clock in range(1200):
            assert {name: ctx.get(port) for name, port in watched} == state, clock
            outputs = golden.outputs(state)
            assert {name: ctx.get(port) for name, port in shown} == outputs, clock
            inputs = random_inputs(clock)
            assert inputs.keys() == top.inputs.keys()
            for name, value in inputs.items():
                ctx.set(top.inputs[name], value)
            before = [state[f"position_{a}"] for a in golden.letters]
            state = golden.step(state, inputs)
            after = [state[f"position_{a}"] for a in golden.letters]
            moved += before != after and not inputs["load"]
            limited += state["limited"]
            stopped += state["stopping"] and any(state[f"pending_{a}"] for a in golden.letters)
            await ctx.tick()
        assert (moved > 60, limited > 20, stopped > 5) == (True, True, True)

    run(top, bench)


def test_latency():
    """Taken in clock 0, launched in 1; leading edge and position in 2; a turn takes U more."""
    seen = trace(PulseUnit(4), [(1, 0)], 10)
    assert seen["taken"] == [0]
    assert shape(seen["pins_x_step"]) == "__‾‾______"
    assert seen["position_x"] == [0, 0, *[1] * 8]
    # Pending in clock 1; out in 2 and 3; the space is 4, 5, 6, and in 6 a pulse may be launched.
    assert shape(seen["busy"]) == "_‾‾‾‾‾____"
    assert shape(seen["steps_ready"]) == "‾" * 10
    assert shape(seen["pins_x_direction"]) == shape(seen["pins_y_step"]) == "_" * 10

    seen = trace(PulseUnit(4), [(-1, 0)], 12)
    assert shape(seen["pins_x_direction"]) == "__" + "‾" * 10
    assert shape(seen["pins_x_step"]) == "______‾‾____"
    assert seen["position_x"] == [*[0] * 6, *[-1] * 6]
    assert shape(seen["busy"]) == "_‾‾‾‾‾‾‾‾‾__"


@pytest.mark.parametrize("length", [0, 1, 2, 5])
@pytest.mark.parametrize("space", [0, 1, 4])
def test_a_step_along_an_axis_in_length_and_space(length, space):
    timings = dict(zip(TIMINGS, (length, space, 7, 9), strict=True))
    period = max(1, length) + max(1, space)
    clocks = 2 + 6 * period
    seen = trace(PulseUnit(4), [(1, 1)] * 9, clocks, timings)
    expected = "__" + 6 * ("‾" * max(1, length) + "_" * max(1, space))
    assert shape(seen["pins_x_step"]) == shape(seen["pins_y_step"]) == expected
    # The next step is taken in the very clock in which the one before is launched.
    assert seen["taken"] == [0, *range(1, clocks, period)]


@pytest.mark.parametrize(
    ("timings", "clocks"),
    [
        ((2, 3, 4, 2), 8),
        ((2, 9, 4, 2), 11),
        ((3, 1, 0, 0), 5),
        ((0, 0, 0, 0), 3),
        ((1, 1, 6, 5), 12),
    ],
)
def test_a_step_where_an_axis_turns_round(timings, clocks):
    """L + max(S, H + U), each at least 1; the direction changes H after the trailing edge."""
    length, space, setup, hold = (max(1, clocks) for clocks in timings)
    assert clocks == length + max(space, hold + setup)
    steps = [(1, 0), (-1, 0)] * 3
    seen = trace(PulseUnit(4), steps, 70, dict(zip(TIMINGS, timings, strict=True)))
    step, direction = seen["pins_x_step"], seen["pins_x_direction"]
    assert rises(step) == [2 + clocks * k for k in range(6)]
    turns = [clock for clock in range(1, 70) if direction[clock] != direction[clock - 1]]
    assert turns == [2 + clocks * k + length + hold for k in range(5)]
    assert [direction[clock] for clock in rises(step)] == [0, 1] * 3


def test_a_step_a_clock_where_axes_take_turns():
    seen = trace(PulseUnit(4), [(1, 0), (0, 1)] * 4, 11, AT_ONCE)
    assert seen["taken"] == list(range(8))
    assert shape(seen["pins_x_step"]) == "__‾_‾_‾_‾__"
    assert shape(seen["pins_y_step"]) == "___‾_‾_‾_‾_"


def test_a_diagonal_step_waits_for_both_axes():
    """y has to turn, x has not: both pulses begin when y is set up, and the step behind waits."""
    seen = trace(PulseUnit(4), [(1, -1), (1, 0)], 20)
    assert shape(seen["pins_y_direction"]) == "__" + "‾" * 18
    assert shape(seen["pins_y_step"]) == "______‾‾" + "_" * 12
    assert shape(seen["pins_x_step"]) == "______‾‾___‾‾_______"
    assert seen["taken"] == [0, 5]


def test_the_axis_that_may_turn_does_while_the_other_one_has_to_wait():
    """After (1, 1) y turns with x's long space behind it: the turn costs nothing."""
    timings = dict(zip(TIMINGS, (2, 9, 5, 3), strict=True))
    seen = trace(PulseUnit(4), [(1, 1), (1, -1)], 20, timings)
    assert rises(seen["pins_y_direction"]) == [2 + 2 + 3]
    assert rises(seen["pins_x_step"]) == rises(seen["pins_y_step"]) == [2, 2 + 2 + 9]


@pytest.mark.parametrize("step", [(0, 0), (-2, 0), (0, -2), (-2, -2)])
def test_a_step_that_moves_nothing_is_taken(step):
    seen = trace(PulseUnit(4), [step, step, (1, 0), step, (1, 0)], 12)
    assert rises(seen["pins_x_step"]) == [4, 9]
    assert seen["taken"] == [0, 1, 2, 3, 4]
    assert max(seen["pins_y_step"] + seen["pins_x_direction"] + seen["pins_y_direction"]) == 0


def test_nothing_is_launched_two_clocks_after_a_stop():
    """For a stop from clock t on the last leading edge is in t + 1, as if there were none."""
    free = trace(PulseUnit(8), [(1, 0), (0, 1)] * 20, 40, AT_ONCE)
    for t in range(4, 10):
        events = {t: {"stop": 1}, t + 5: {"stop": 0}}
        seen = trace(PulseUnit(8), [(1, 0), (0, 1)] * 20, 40, AT_ONCE, events)
        assert seen["steps_ready"] == [0 if t < clock <= t + 5 else 1 for clock in range(40)]
        edges, unstopped = (
            sorted(rises(rows["pins_x_step"]) + rises(rows["pins_y_step"])) for rows in (seen, free)
        )
        assert edges[: t + 2 - 2] == unstopped[: t + 2 - 2] == list(range(2, t + 2))
        # What is taken in t is dropped with what waits. In t + 6 a step is taken again.
        assert edges[t] == t + 8
        assert seen["position_x"][t + 7] + seen["position_y"][t + 7] == t


def test_a_stop_drops_what_waits_and_lets_a_pulse_end():
    timings = dict(zip(TIMINGS, (6, 9, 1, 1), strict=True))
    events = {4: {"stop": 1}, 5: {"stop": 0}}
    seen = trace(PulseUnit(8), [(1, 1), (1, -1)], 30, timings, events)
    assert seen["taken"] == [0, 1]
    assert shape(seen["pins_x_step"]) == "__" + 6 * "‾" + 22 * "_"
    assert seen["pins_x_step"] == seen["pins_y_step"]
    assert seen["pins_y_direction"] == [0] * 30
    assert seen["position_x"][-1] == seen["position_y"][-1] == 1
    # Busy until its space has passed: the step is in no clock after 5 pending.
    assert shape(seen["busy"]) == "_" + 15 * "‾" + 14 * "_"


@pytest.mark.parametrize(
    ("limit", "step", "waits"),
    [
        ("high_limit_x", (1, 0), True),
        ("high_limit_x", (1, -1), True),
        ("high_limit_x", (-1, 1), False),
        ("high_limit_x", (0, 1), False),
        ("low_limit_x", (-1, 1), True),
        ("low_limit_x", (1, 1), False),
        ("high_limit_y", (-1, 1), True),
        ("low_limit_y", (0, -1), True),
        ("low_limit_y", (-1, 0), False),
    ],
)
def test_a_step_towards_an_active_switch_waits_as_a_whole(limit, step, waits):
    """The switch is active from clock 0 to 19; the step is pending from clock 4 on."""
    events = {0: {limit: 1}, 20: {limit: 0}}
    steps = [(0, 0)] * 3 + [step]
    seen = trace(PulseUnit(8), steps, 40, TYPICAL, events)
    # In 4 it waits, 5 says so. The release is known in 21: launched or turned in 22, seen in 23.
    assert seen["limited"] == [int(waits and 5 <= clock <= 21) for clock in range(40)]
    begins = (23 if waits else 5) + 4 * (min(step) < 0)
    for a, moves in zip("xy", step, strict=True):
        assert rises(seen[f"pins_{a}_step"]) == ([begins] if moves else [])
        assert rises(seen[f"pins_{a}_direction"]) == ([begins - 4] if moves < 0 else [])


def test_the_last_edge_towards_a_switch_is_a_clock_after_it_is_active():
    for t in range(4, 12):
        events = {t: {"high_limit_x": 1}}
        seen = trace(PulseUnit(8), [(1, 0)] * 40, 24, AT_ONCE, events)
        edges = rises(seen["pins_x_step"])
        assert edges == list(range(2, t + 2, 2))
        assert seen["position_x"][-1] == len(edges)


def test_a_limited_step_is_dropped_by_a_stop():
    events = {0: {"high_limit_x": 1}, 8: {"stop": 1}, 9: {"stop": 0}}
    seen = trace(PulseUnit(8), [(1, 0), (-1, 0)], 30, TYPICAL, events)
    assert seen["limited"] == [int(2 <= clock <= 9) for clock in range(30)]
    assert seen["taken"] == [0, 10]
    assert seen["position_x"][-1] == -1


def test_timings_that_change_while_busy_are_not_used_before_it_ends():
    events = {
        2: dict(zip(TIMINGS, (1, 1, 1, 1), strict=True)),
        5: dict(zip(TIMINGS, (9, 9, 9, 9), strict=True)),
    }
    seen = trace(PulseUnit(8), [(1, 0), (1, 0)], 12, TYPICAL, events)
    assert shape(seen["pins_x_step"]) == "__‾‾___‾‾___"
    assert shape(seen["busy"]) == "_‾‾‾‾‾‾‾‾‾‾_"
    # A step that is taken in the first clock that is not busy has the new ones: it leaves a space
    # of 9 clocks, 9 to 17, and is 9 clocks long.
    seen = trace(PulseUnit(8), [(1, 0), (1, 0), *[(0, 0)] * 5, (1, 0)], 40, TYPICAL, events)
    assert seen["taken"][-1] == seen["busy"].index(0, 1) == 11
    assert seen["pins_x_step"][9:] == [int(18 <= clock < 27) for clock in range(9, 40)]


def test_the_longest_timings():
    """A space of 4095 has passed when the count of clocks stands still, not before."""
    timings = dict.fromkeys(TIMINGS, 2**TIMING_BITS - 1)
    seen = trace(
        PulseUnit(4),
        [(1, 0), (1, 0), (-1, 0)],
        21_000,
        timings,
        seen=("pins_x_step", "steps_ready"),
    )
    edges = [2, 2 + 2 * 4095, 2 + 5 * 4095]
    assert rises(seen["pins_x_step"]) == edges
    assert sum(seen["pins_x_step"][: edges[2]]) == 2 * 4095


def test_position_wraps_and_is_loaded():
    events = {0: {"load": 1, "initial_x": 15, "initial_y": -16}, 1: {"load": 0}}
    seen = trace(PulseUnit(4), [(0, 0), (1, -1), (-1, 1)], 20, AT_ONCE, events)
    assert sorted(set(seen["position_x"])) == [-16, 0, 15]
    assert sorted(set(seen["position_y"])) == [-16, 0, 15]
    assert seen["position_x"][1:3] == [15, 15]
    assert (seen["position_x"][-1], seen["position_y"][-1]) == (15, -16)
    # A load goes before a pulse that is launched in the same clock.
    events = {1: {"load": 1, "initial_x": 7}, 2: {"load": 0}}
    seen = trace(PulseUnit(4), [(1, 0)], 6, AT_ONCE, events)
    assert seen["position_x"] == [0, 0, 7, 7, 7, 7]
    assert rises(seen["pins_x_step"]) == [2]


def test_quadrature_goes_through_its_cycle_both_ways():
    """a leads b upwards; edges come as the pulses of the other kind do."""
    steps = [(1, 0)] * 6 + [(-1, 1)] * 6
    pulses = trace(PulseUnit(8), steps, 90)
    seen = trace(PulseUnit(8, kind="quadrature"), steps, 90)
    for name in ("position_x", "position_y", "steps_ready", "busy", "taken"):
        assert seen[name] == pulses[name]
    cycle = [(0, 0), (1, 0), (1, 1), (0, 1)]
    for a in "xy":
        pins = list(zip(seen[f"pins_{a}_a"], seen[f"pins_{a}_b"], strict=True))
        assert pins == [cycle[position % 4] for position in seen[f"position_{a}"]]
    assert set(seen["position_x"]) == set(range(7))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("steps", ["", "x", "yx"])
@pytest.mark.parametrize("directions", ["", "y"])
def test_pins_that_are_active_low(kind, steps, directions):
    moves = [(1, -1), (1, -1), (-1, 1)]
    plain = trace(PulseUnit(8, kind=kind), moves, 40)
    unit = PulseUnit(8, kind=kind, inverted_steps=steps, inverted_directions=directions)
    seen = trace(unit, moves, 40)
    first, second = ("step", "direction") if kind == "step_direction" else ("a", "b")
    inverted = {f"pins_{a}_{first}" for a in steps} | {f"pins_{a}_{second}" for a in directions}
    for name, values in seen.items():
        assert values == [value ^ (name in inverted) for value in plain[name]]
        if name.startswith("pins_"):
            assert values[0] == (name in inverted)  # idle after reset
            assert len(set(values)) == 2


@pytest.mark.parametrize("kind", KINDS)
def test_a_load_leaves_the_pins_alone(kind):
    events = {t: {"load": t % 2, "initial_x": t - 20, "initial_y": 3 * t} for t in range(10, 20)}
    unit, other = PulseUnit(8, kind=kind), PulseUnit(8, kind=kind)
    seen, plain = trace(unit, [(1, 1)], 25, TYPICAL, events), trace(other, [(1, 1)], 25)
    for name, values in seen.items():
        if not name.startswith("position"):
            assert values == plain[name]
    assert seen["position_x"][-1] == -1


@pytest.mark.parametrize("kind", KINDS)
def test_what_it_says_of_itself(kind):
    unit = PulseUnit(8, 3, kind=kind, inverted_steps="z", inverted_directions="xy")
    parameters = {
        "width": 8,
        "axes": 3,
        "kind": kind,
        "inverted_steps": "z",
        "inverted_directions": "xy",
    }
    assert unit.parameters == parameters
    assert {name: getattr(unit, name) for name in parameters} == parameters
    listed = [register for group in unit.diagram.values() for register in group]
    assert [Value.cast(register).name for register in listed] == list(unit.registers)
    golden = GoldenPulseUnit(**parameters)
    assert golden.registers() == {
        name: (len(register), register.shape().signed) for name, register in unit.registers.items()
    }
    assert {name: register.init for name, register in unit.registers.items()} == golden.reset()
    Fragment.get(unit, None)  # all of its parts are used


def test_ports_are_in_their_order():
    inputs = [
        *("steps_x", "steps_y", "steps_valid", "load", "initial_x", "initial_y", "stop"),
        *("low_limit_x", "low_limit_y", "high_limit_x", "high_limit_y", *TIMINGS),
    ]
    for kind, (first, second) in zip(KINDS, (("step", "direction"), ("a", "b")), strict=True):
        top = PlainPorts(PulseUnit(8, kind=kind))
        assert list(top.inputs) == inputs
        assert list(top.outputs) == [
            *("steps_ready", f"pins_x_{first}", f"pins_x_{second}", f"pins_y_{first}"),
            *(f"pins_y_{second}", "position_x", "position_y", "busy", "limited"),
        ]
        Fragment.get(top, None)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_refuses_width(width, error, message):
    assert_refused((error, message), PulseUnit, width)


@pytest.mark.parametrize(("axes", "error", "message"), BAD_AXES)
def test_refuses_axes(axes, error, message):
    assert_refused((error, message), PulseUnit, 8, axes)


def test_refuses_kind():
    message = "kind is 'pulse': choose 'step_direction' or 'quadrature'"
    assert_refused((ValueError, message), PulseUnit, kind="pulse")


@pytest.mark.parametrize("what", ["inverted_steps", "inverted_directions"])
@pytest.mark.parametrize(
    ("letters", "axes", "error", "end"),
    [
        ("z", 2, ValueError, "is 'z': choose letters of 'xy', each at most once"),
        ("xx", 2, ValueError, "is 'xx': choose letters of 'xy', each at most once"),
        ("yXz", 3, ValueError, "is 'yXz': choose letters of 'xyz', each at most once"),
        ("x y", 6, ValueError, "is 'x y': choose letters of 'xyzabc', each at most once"),
        (True, 2, TypeError, "must be a string of axis letters, not True"),
        (["x"], 2, TypeError, "must be a string of axis letters, not ['x']"),
        (None, 2, TypeError, "must be a string of axis letters, not None"),
    ],
)
def test_refuses_inverted_pins(what, letters, axes, error, end):
    assert_refused((error, f"{what} {end}"), PulseUnit, 8, axes, **{what: letters})
