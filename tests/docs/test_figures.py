"""The pictures of the documentation: as committed, and true."""

from collections.abc import Iterator
from itertools import accumulate
from math import hypot, isqrt
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from docs import figures

# The block of the carry: DELTA steps along x, and the clock in which its first step waits.
MODULUS, DELTA, HELD = 256, 200, 4

# The block of the turn: n bits, from (XH, YH) to (−XH, YH), two points of a circle of radius R.
WIDTH, XH, YH, R = 4, 5, 12, 13


def committed(name: str) -> Path:
    return Path(figures.__file__).with_name(f"{name}.svg")


class Drawn:
    """A timing diagram, with the values of every lane read back from the WaveJSON drawn."""

    def __init__(self, timing: figures.Timing):
        self.timing, self.run = timing, timing.run()
        self.wave: dict[str, Any] = timing.wave(self.run)
        self.clocks = timing.clocks
        self.lanes: dict[str, dict[int, int]] = {}
        for lane in self.wave["signal"][1:]:
            numbers = iter(lane.get("data", ()))
            values: list[int] = []
            for letter in lane["wave"]:
                if letter == ".":
                    values.append(values[-1])
                else:
                    word = next(numbers) if letter == "5" else letter
                    values.append(int(word.replace("−", "-")))
            self.lanes[lane["name"]] = dict(zip(self.clocks, values, strict=True))

    def __getitem__(self, name: str) -> dict[int, int]:
        return self.lanes[name]

    @property
    def arrows(self) -> dict[tuple[str, str], tuple[int, int]]:
        """The clocks in which arrows begin and end, by the lanes that they join."""
        return {
            (source, target): (int(before), int(after))
            for (source, before), (target, after) in self.timing.arrows(self.run)
        }


@pytest.fixture(scope="module")
def carry() -> Drawn:
    return Drawn(figures.linear_carry())


@pytest.fixture(scope="module")
def turn() -> Drawn:
    return Drawn(figures.circular_turn())


@pytest.fixture(scope="module")
def change() -> Drawn:
    return Drawn(figures.conic_turn())


@pytest.fixture(scope="module")
def summations(carry) -> list[int]:
    """How many summations of the line there were before every clock."""
    return [0, *accumulate(carry["УУ clock"].values())][:-1]


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


@pytest.mark.parametrize("name", ["carry", "turn", "change"])
def test_lanes_ticks_and_arrows_are_where_the_clocks_are(name, request):
    drawn: Drawn = request.getfixturevalue(name)
    clocks = drawn.clocks
    assert list(drawn.lanes) == list(drawn.timing.lanes)
    assert {len(lane["wave"]) for lane in drawn.wave["signal"]} == {len(clocks)}
    assert drawn.wave["head"] == {"tock": clocks[0]}
    rows = [lane["name"] for lane in drawn.wave["signal"]]
    for edge, ((source, before), (target, after)) in zip(
        drawn.wave["edge"], drawn.timing.arrows(drawn.run), strict=True
    ):
        first, last = edge.strip("[]").replace("]~>[", "]->[").split("]->[")
        for spot, name, moment in ((first, source, before), (last, target, after)):
            row, at = spot.split(":")
            assert rows[int(row)] == name
            assert float(at) + clocks[0] == pytest.approx(moment)


def test_block_is_accepted_started_and_summed_in_clocks_0_1_2(carry):
    assert [carry["blocks.valid"][c] & carry["blocks.ready"][c] for c in (0, 1, 2)] == [1, 0, 0]
    assert [carry["УУ start"][c] for c in (0, 1, 2)] == [0, 1, 0]
    assert [carry["УУ clock"][c] for c in (0, 1, 2)] == [0, 0, 1]
    assert [carry["P1 = ΔX"][c] for c in (1, 2)] == [0, DELTA]


def test_registers_are_the_closed_form(carry, summations):
    for clock, t in enumerate(summations):
        carries = t * DELTA // MODULUS
        assert carry["SX"][clock] == t * DELTA % MODULUS
        if clock >= 2:  # loaded
            assert carry["P5 = KOX"][clock] == DELTA - carries
        reached = (t + carry["УУ clock"][clock]) * DELTA // MODULUS
        assert carry["SX carry"][clock] == reached - carries


def test_position_is_the_closed_form_once_the_step_is_taken(carry, summations):
    for clock in carry.clocks[:-1]:
        if not carry["steps.valid"][clock] or carry["steps.ready"][clock]:
            assert carry["P3 = XT"][clock + 1] == summations[clock] * DELTA // MODULUS


def test_step_of_the_first_carry_is_held_for_one_clock_and_nothing_moves(carry):
    assert next(c for c in carry.clocks if carry["SX carry"][c]) == HELD - 1
    assert next(c for c in carry.clocks if carry["steps.valid"][c]) == HELD
    assert [c for c in carry.clocks if not carry["steps.ready"][c]] == [HELD]
    assert carry.wave["shade"][0].split()[:2] == [str(HELD), "*"]
    assert not carry["УУ clock"][HELD]
    for name, lane in carry.timing.lanes.items():
        if lane.number:
            assert carry[name][HELD] == carry[name][HELD + 1]
    assert carry["P3 = XT"][HELD + 2] == 1
    assert not any(carry["done = край"].values())
    assert carry.arrows == {
        ("SX carry", "steps.valid"): (HELD - 1, HELD),
        ("steps.ready", "P3 = XT"): (HELD + 1, HELD + 2),
    }


def by_the_rule() -> Iterator[dict[str, int]]:
    """Work the arc out by the lecture's rule: what the registers are in every clock summed in.

    Seen from quadrant II, turned onto the first, the end (−XH, YH) is at (YH, XH).
    """
    modulus = 1 << WIDTH
    x, y, left_x, left_y, sx, sy, turns = XH, YH, XH, isqrt(XH**2 + YH**2) + 1 - YH, 0, 0, 1
    for _ in range(4 * modulus):
        yield {
            **{"turns": turns, "swap": 1 - turns, "P1 = X": x, "P2 = Y": y},
            **{"P3 = KOX": left_x, "P4 = KOY": left_y, "SX": sx, "SY": sy},
        }
        if turns and not left_x:
            x, y, sx, sy, turns = y, 0, modulus - 1 - sy, sx, 0
            left_x, left_y = abs(x - YH), XH
        elif left_x or left_y:
            step_x, sx = divmod(sx + (y if left_x else 0), modulus)
            step_y, sy = divmod(sy + (x if left_y else 0), modulus)
            x, left_x = x - step_x, left_x - step_x
            y, left_y = y + step_y, left_y - step_y
        else:
            return


def test_registers_of_the_arc_are_the_rule(turn):
    # Prepared in 2n + 5 clocks, started in clock 2n + 5, summed from the next one on.
    rule = dict(enumerate(by_the_rule(), 2 * WIDTH + 6))
    last = max(rule)
    assert turn.clocks[0] in rule
    assert turn.clocks[-1] == last + 1  # the last step waits in clock last
    for clock in turn.clocks:
        for name, value in rule[min(clock, last)].items():
            assert turn[name][clock] == value, (clock, name)
        assert turn["УУ clock"][clock] == (clock < last)
        assert turn["done = край"][clock] == (clock > last)


def test_the_frame_is_turned_in_one_clock(turn):
    before = int(turn.wave["shade"][0].split()[0]) + turn.clocks[0]
    after = before + 1
    assert [c for c in turn.clocks[1:] if turn["turns"][c] != turn["turns"][c - 1]] == [after]
    assert turn["P1 = X"][before] == turn["P3 = KOX"][before] == 0
    assert turn["P1 = X"][after] == turn["P2 = Y"][before]
    assert turn["P2 = Y"][after] == 0
    assert turn["SX"][after] == (1 << WIDTH) - 1 - turn["SY"][before]
    assert turn["SY"][after] == turn["SX"][before]
    assert turn["steps.valid"][after] == 0  # a turn moves nothing
    joined = ("P2 = Y", "P1 = X"), ("SX", "SY"), ("SY", "SX")
    assert turn.arrows == dict.fromkeys(joined, (before, after))


def test_steps_and_position_are_the_arc_seen_by_the_machine(turn):
    for clock in turn.clocks:
        x, y = turn["P1 = X"][clock], turn["P2 = Y"][clock]
        step = turn["steps.x"][clock], turn["steps.y"][clock]
        now = turn["XT"][clock], turn["YT"][clock]
        assert turn["steps.valid"][clock] == any(step)
        # The step that waits leads to where the registers are already.
        reached = now[0] + step[0], now[1] + step[1]
        assert reached == ((-y, x) if turn["swap"][clock] else (x, y))
        assert abs(hypot(*now) - R) < 1
        if clock + 1 in turn.clocks:
            assert (turn["XT"][clock + 1], turn["YT"][clock + 1]) == reached
    assert (turn["XT"][turn.clocks[-1]], turn["YT"][turn.clocks[-1]]) == (-XH, YH)


def by_the_parabola() -> Iterator[dict[str, int]]:
    """Work y² = 8x out by the lecture's rule: what the registers are in every clock summed in.

    From (2, 4) to (2, −4), so that y falls all the time, and x falls and then rises.
    """
    modulus, edge = 1 << (2 * WIDTH + 6), 1 << WIDTH
    x, y, sx, sy, turns = 2, 4, modulus - 1, modulus - 1, 1
    left_x, left_y = x + edge, y + edge
    for _ in range(100):
        gx, gy = -8, 2 * y
        yield {
            **{"turns": turns, "x falls": turns, "P1 = X": x, "P2 = Y": y, "GX": gx, "GY": gy},
            **{"P3": left_x, "P4": left_y, "SX": sx, "SY": sy},
        }
        x_goes = left_x and (gy > 0 if turns else gy < 0)
        if turns and not x_goes:
            turns, left_x, left_y = 0, abs(2 - x), abs(-4 - y)
            continue
        if not (left_x or left_y):
            return
        step_x = step_y = 0
        if not x_goes and not left_y:
            step_x = 1
        else:
            scale = 1
            while all(-modulus <= 2 * scale * g < modulus for g in (gx * (left_y > 0), gy, 2)):
                scale *= 2
            if x_goes:
                sx -= gy * scale
                step_x = (sx >= modulus) - (sx < 0)
                sx -= step_x * modulus
            if left_y:
                sy += gx * scale
                step_y = -(sy < 0)
                sy -= step_y * modulus
        x, y = x + step_x, y + step_y
        left_x, left_y = left_x - abs(step_x), left_y - abs(step_y)


def test_registers_of_the_parabola_are_the_rule(change):
    # Prepared in n + 4 clocks, started in clock n + 4, summed from the next one on.
    rule = dict(enumerate(by_the_parabola(), WIDTH + 5))
    last = max(rule)
    assert change.clocks[0] in rule
    assert last in change.clocks
    for clock in change.clocks:
        for name, value in rule[min(clock, last)].items():
            assert change[name][clock] == value, (clock, name)
        assert change["УУ clock"][clock] == (clock < last)
        assert change["done = край"][clock] == (clock > last)


def test_x_turns_round_in_one_clock_at_the_vertex(change):
    before = int(change.wave["shade"][0].split()[0]) + change.clocks[0]
    after = before + 1
    assert [c for c in change.clocks[1:] if change["turns"][c] != change["turns"][c - 1]] == [after]
    assert change["GY"][before] == change["P1 = X"][before] == change["P2 = Y"][before] == 0
    assert change["steps.valid"][after] == 0  # a turn moves nothing
    assert {step for c, step in change["steps.x"].items() if c <= before} == {0, -1}
    assert {step for c, step in change["steps.x"].items() if c > before} == {0, 1}
    assert change.arrows == {("GY", name): (before, after) for name in ("x falls", "P3", "P4")}
