"""The pictures of the documentation: as committed, and true."""

from itertools import accumulate
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from docs import figures

MODULUS = 1 << figures.WIDTH
DELTA = figures.END[0]
CLOCKS = range(figures.CLOCKS)


def committed(name: str) -> Path:
    return Path(figures.__file__).with_name(f"{name}.svg")


@pytest.fixture(scope="module")
def drawn() -> dict[str, list[int]]:
    """The values of every lane at every clock, read back from the WaveJSON that is drawn."""
    wave: dict[str, Any] = figures.carry_wave(figures.carry_run())
    lanes = {}
    for lane in wave["signal"][1:]:
        numbers = iter(lane.get("data", ()))
        values: list[int] = []
        for letter in lane["wave"]:
            if letter == ".":
                values.append(values[-1])
            else:
                values.append(int(next(numbers) if letter == "5" else letter))
        lanes[lane["name"]] = values
    return lanes


@pytest.fixture(scope="module")
def summations(drawn) -> list[int]:
    """How many summations there were before every clock."""
    return [0, *accumulate(drawn["УУ clock"])][: figures.CLOCKS]


@pytest.mark.parametrize("name", figures.FIGURES)
def test_committed_pictures_are_what_is_drawn_now(name):
    assert committed(name).read_text(encoding="utf-8") == figures.draw(name), (
        "run: python docs/figures.py"
    )


@pytest.mark.parametrize("name", figures.FIGURES)
def test_a_picture_is_small_and_the_same_every_time(name):
    first, second = figures.draw(name), figures.draw(name)
    assert first == second
    assert len(first.encode()) < 60_000


def test_only_pictures_there_are_can_be_asked_for():
    result = CliRunner().invoke(figures.main, ["no-such-picture"])
    assert result.exit_code == 2
    assert "no-such-picture" in result.output


def test_lanes_are_as_long_as_the_picture(drawn):
    assert list(drawn) == list(figures.LANES)
    assert {len(values) for values in drawn.values()} == {figures.CLOCKS}


def test_block_is_accepted_started_and_summed_in_clocks_0_1_2(drawn):
    assert [drawn["blocks.valid"][c] & drawn["blocks.ready"][c] for c in (0, 1, 2)] == [1, 0, 0]
    assert drawn["УУ start"][:3] == [0, 1, 0]
    assert drawn["УУ clock"][:3] == [0, 0, 1]
    assert drawn["P1 = ΔX"][1:3] == [0, DELTA]


def test_registers_are_the_closed_form(drawn, summations):
    for clock, t in enumerate(summations):
        carries = t * DELTA // MODULUS
        assert drawn["SX"][clock] == t * DELTA % MODULUS
        if clock >= 2:  # loaded
            assert drawn["P5 = KOX"][clock] == DELTA - carries
        reached = (t + drawn["УУ clock"][clock]) * DELTA // MODULUS
        assert drawn["SX carry"][clock] == reached - carries


def test_position_is_the_closed_form_once_the_step_is_taken(drawn, summations):
    for clock in CLOCKS[:-1]:
        if not drawn["steps.valid"][clock] or drawn["steps.ready"][clock]:
            assert drawn["P3 = XT"][clock + 1] == summations[clock] * DELTA // MODULUS


def test_step_of_the_first_carry_is_held_for_one_clock_and_nothing_moves(drawn):
    held = figures.HELD_CLOCK
    assert drawn["SX carry"].index(1) == held - 1
    assert drawn["steps.valid"].index(1) == held
    assert [clock for clock in CLOCKS if not drawn["steps.ready"][clock]] == [held]
    assert not drawn["УУ clock"][held]
    for name in figures.NUMBERS:
        assert drawn[name][held] == drawn[name][held + 1]
    assert drawn["P3 = XT"][held + 2] == 1
    assert not any(drawn["done = край"])
