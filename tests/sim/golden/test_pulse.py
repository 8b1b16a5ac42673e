"""The golden model against the rules themselves: when each step is put out, reckoned in advance."""

import numpy as np
import pytest

from discreta.sim.golden.pulse import FOREVER, PulseUnit

TIMINGS = ("pulse_length", "pulse_space", "direction_setup", "direction_hold")


def idle_inputs(golden, timings):
    inputs = {"steps_valid": 0, "load": 0, "stop": 0} | dict(zip(TIMINGS, timings, strict=True))
    for a in golden.letters:
        inputs |= {f"{name}_{a}": 0 for name in ("steps", "initial", "low_limit", "high_limit")}
    return inputs


def reckoned(steps, timings, axes):
    """Give by the rules the clocks of all leading edges and turns, of steps offered from clock 0.

    A list for every axis of (clock, step), and one of (clock, direction).
    """
    length, space, setup, hold = (max(1, clocks) for clocks in timings)
    edges, turns = [[] for _ in range(axes)], [[] for _ in range(axes)]
    taken = 0
    for step in steps:
        begins = taken + 2  # no earlier: a clock to take it, and one to launch it
        for axis in np.flatnonzero(step):
            last = edges[axis][-1][0] if edges[axis] else -FOREVER
            direction, since = turns[axis][-1][::-1] if turns[axis] else (0, -FOREVER)
            if direction != (step[axis] < 0):
                since = max(taken + 2, last + length + hold)
                turns[axis].append((since, int(step[axis] < 0)))
            begins = max(begins, last + length + space, since + setup)
        for axis in np.flatnonzero(step):
            edges[axis].append((begins, int(step[axis])))
        # The next one is taken when this one is launched; of one that moves nothing, right away.
        taken = begins - 1 if any(step) else taken + 1
    return edges, turns


def seen(golden, steps, timings, clocks):
    """Give the same of the pins, and check that no pulse is shorter or longer than it should be."""
    state, left = golden.reset(), list(steps)
    edges, turns = ([[] for _ in range(golden.axes)] for _ in range(2))
    before = golden.outputs(state)
    for clock in range(clocks):
        shown = golden.outputs(state)
        for axis, a in enumerate(golden.letters):
            direction = shown[f"pins_{a}_direction"]
            if direction != before[f"pins_{a}_direction"]:
                turns[axis].append((clock, direction))
            change = shown[f"pins_{a}_step"] - before[f"pins_{a}_step"]
            if change > 0:
                edges[axis].append((clock, 1 - 2 * direction))
            if change < 0:
                assert clock - edges[axis][-1][0] == max(1, timings[0])
        before = shown
        inputs = idle_inputs(golden, timings)
        if left:
            inputs |= {f"steps_{a}": left[0][axis] for axis, a in enumerate(golden.letters)}
            inputs["steps_valid"] = 1
            if shown["steps_ready"]:
                del left[0]
        state = golden.step(state, inputs)
    assert not left
    assert not before["busy"]
    return edges, turns


@pytest.mark.parametrize("axes", [2, 4])
@pytest.mark.parametrize(
    "timings",
    [
        (0, 0, 0, 0),
        (1, 1, 1, 1),
        (3, 1, 2, 5),
        (1, 9, 2, 2),
        (2, 5, 7, 1),
        (5, 2, 0, 3),
        (1, 4, 3, 1),
    ],
)
def test_edges_and_turns_are_in_the_reckoned_clocks(axes, timings):
    rng = np.random.default_rng([axes, *timings])
    # Runs in one direction and turns, diagonal steps, and steps that move nothing.
    steps = rng.choice([-1, 0, 1], (120, axes), p=[0.3, 0.3, 0.4])
    steps[40:80] = np.abs(steps[40:80])
    clocks = 120 * (sum(timings) + 4)
    golden = PulseUnit(8, axes)
    edges, turns = seen(golden, steps.tolist(), timings, clocks)
    assert (edges, turns) == reckoned(steps, timings, axes)
    assert min(map(len, edges)) > 40


def test_quadrature_shows_the_same_edges():
    rng = np.random.default_rng(1)
    steps = rng.integers(-1, 2, (60, 2)).tolist()
    timings = (2, 3, 1, 4)
    edges, _ = reckoned(np.array(steps), timings, 2)
    golden = PulseUnit(8, kind="quadrature", inverted_steps="y", inverted_directions="x")
    cycle = [(0, 0), (1, 0), (1, 1), (0, 1)]
    state, left, position = golden.reset(), list(steps), [0, 0]
    for clock in range(700):
        shown = golden.outputs(state)
        for axis, a in enumerate("xy"):
            position[axis] += sum(step for at, step in edges[axis] if at == clock)
            first, second = cycle[position[axis] % 4]
            assert shown[f"pins_{a}_a"] == first ^ (a == "y")
            assert shown[f"pins_{a}_b"] == second ^ (a == "x")
            assert shown[f"position_{a}"] == position[axis]
        inputs = idle_inputs(golden, timings)
        if left:
            inputs |= {"steps_valid": 1, "steps_x": left[0][0], "steps_y": left[0][1]}
            left = left[shown["steps_ready"] :]
        state = golden.step(state, inputs)
    assert not left
    assert position == np.sum(steps, axis=0).tolist()


@pytest.mark.parametrize("kind", ["step_direction", "quadrature"])
def test_a_batch_runs_as_each_of_its_runs_alone(kind):
    """The same source on NumPy arrays, with stops, switches and timings that change."""
    golden, runs = PulseUnit(4, kind=kind), 20
    rng = np.random.default_rng(2)
    names = list(idle_inputs(golden, (0, 0, 0, 0)))
    lowest = {"steps_x": -1, "steps_y": -1, "initial_x": -16, "initial_y": -16}
    highest = {"initial_x": 15, "initial_y": 15} | dict.fromkeys(TIMINGS, 3)
    rare = ("load", "stop", "low_limit_x", "low_limit_y", "high_limit_x", "high_limit_y")
    batch = {name: np.full(runs, value) for name, value in golden.reset().items()}
    alone = [golden.reset() for _ in range(runs)]
    for _ in range(80):
        inputs = {
            name: rng.integers(lowest.get(name, 0), highest.get(name, 1), runs, endpoint=True)
            for name in names
        }
        inputs |= {name: inputs[name] & (rng.random(runs) < 0.2) for name in rare}
        batch = golden.step(batch, inputs)
        alone = [
            golden.step(state, {name: int(values[run]) for name, values in inputs.items()})
            for run, state in enumerate(alone)
        ]
        shown = golden.outputs(batch)
        for run, state in enumerate(alone):
            assert {name: values[run] for name, values in batch.items()} == state
            single = golden.outputs(state)
            assert {name: np.broadcast_to(v, runs)[run] for name, v in shown.items()} == single
    assert np.ptp(batch["position_x"]) > 0


def test_every_register_stays_in_its_bits():
    golden = PulseUnit(4, 2, "quadrature")
    rng = np.random.default_rng(3)
    state = golden.reset()
    inputs = idle_inputs(golden, (1, 1, 1, 1))
    for _ in range(3000):
        inputs |= {"steps_valid": 1, "steps_x": int(rng.integers(-2, 2)), "steps_y": 1}
        state = golden.step(state, inputs)
        assert state.keys() == golden.registers().keys()
        for name, (bits, signed) in golden.registers().items():
            low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1)) if signed else (0, 2**bits)
            assert low <= state[name] < high, name
