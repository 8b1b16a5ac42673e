"""Golden model of the interpolator of second-order curves, one clock at a time, in integers.

Written from the lecture's general block diagram: two coordinate registers, two summators with carry
and borrow, and the scale converters of A, B, C, D and E, with x' = −(Bx + 2Cy + E) and y' = 2Ax +
By + D (of the two printed forms of the first the one that the differential of the curve supports,
and with the minus sign that is lost there). Beyond the lecture, as described of
``discreta.hdl.conic.Conic``: the sign of the direction, the pieces between two changes of direction
of an axis and their order, the common scale, the preload, the guard bits, the derivatives kept up
by additions, the completing steps and the code for a curve that has no direction or is too sharp.

The same source runs on integers, NumPy arrays and SMT bit-vectors (see
:mod:`discreta.sim.golden.logic`). It knows nothing of the RTL. State and inputs are dicts by
register and port name.

Registers: as in the block diagram, and ``running``, ``done``, ``error`` of УУ, ``pulse_x/y`` and
``direction_x/y`` of the step that waits, ``held``, ``fault`` and ``tick`` of the block that is
being prepared, which happens in the registers in which it runs.
"""

from collections.abc import Callable
from dataclasses import dataclass

from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["TURNS_BITS", "Conic"]

State = dict[str, Value]

SHARP = 3
TURNS_BITS = 11


def _keep(_name: str, value: Value) -> Value:
    """Reckon with a value itself."""
    return value


@dataclass(frozen=True)
class Conic:
    """The interpolator of second-order curves of n = ``width`` bits, 4 to 24.

    Parameters as for ``discreta.hdl.conic.Conic``.
    """

    width: int = 16
    order: str = "implicit"
    preload: str = "half"
    guard: int = 2

    @property
    def bits(self) -> int:
        """Bits of the derivatives, signed."""
        return 2 * self.width + 7

    @property
    def modulus(self) -> int:
        """M: a full sum is a step."""
        return 2 ** (self.bits - 1 + self.guard)

    @property
    def no_limit(self) -> int:
        """What stands for no limit of the scale: as many places as there are numbers for."""
        return 2 ** (self.bits - 1).bit_length() - 1

    @property
    def initial_sum(self) -> int:
        """What the summators start from when their axis rises."""
        return {"zero": 0, "half": self.modulus // 2}[self.preload]

    @property
    def ordered(self) -> bool:
        """One axis is summed after the other and with what that has moved."""
        return self.order != "simultaneous"

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        n = self.width
        kinds: dict[str, tuple[int, bool]] = dict.fromkeys(("p1", "p2"), (n + 1, True))
        kinds |= dict.fromkeys(("gx", "gy"), (self.bits, True))
        kinds |= dict.fromkeys(("sx", "sy"), (self.bits + self.guard + 1, True))
        kinds |= dict.fromkeys(("p3", "p4"), (n + 1, False))
        kinds |= dict.fromkeys(("xt", "yt"), (n + 1, True))
        kinds |= dict.fromkeys("abc", (n + 4, True)) | dict.fromkeys("de", (2 * n + 5, True))
        kinds |= {"turns": (TURNS_BITS, False), "backward_x": (1, False), "backward_y": (1, False)}
        if self.ordered:
            kinds |= {"fresh": (1, False), "scale": ((self.bits - 1).bit_length(), False)}
        kinds |= {"clockwise": (1, False), "xk": (n + 1, True), "yk": (n + 1, True)}
        kinds |= {"running": (1, False), "done": (1, False), "error": (2, False)}
        kinds |= dict.fromkeys(("pulse_x", "pulse_y", "direction_x", "direction_y"), (1, False))
        return kinds | {
            "held": (1, False),
            "fault": (2, False),
            "tick": ((n + 3).bit_length(), False),
        }

    def reset(self) -> State:
        """Give the state after reset."""
        state: State = dict.fromkeys(self.registers(), 0)
        return state | dict.fromkeys(("sx", "sy"), self.initial_sum)

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        waiting = state["pulse_x"] | state["pulse_y"]
        busy = state["held"] | state["running"] | waiting
        out = {
            "blocks_ready": negate(busy),
            "steps_valid": waiting,
            "steps_last": negate(state["running"]),
            "busy": busy,
            "done": state["done"],
            "error": state["error"],
            "position_x": state["xt"],
            "position_y": state["yt"],
        }
        for k in "xy":
            out[f"steps_{k}"] = where(state[f"pulse_{k}"], where(state[f"direction_{k}"], -1, 1), 0)
        return out

    def step(
        self, state: State, inputs: dict[str, Value], tell: Callable[[str, Value], Value] = _keep
    ) -> State:
        """Give the state after one clock.

        ``inputs``: ``blocks_valid``, ``blocks_a`` … ``blocks_e``, ``blocks_start_x/y``,
        ``blocks_end_x/y``, ``blocks_clockwise``, ``blocks_turns``, ``steps_ready``. ``tell`` is
        told every value between the registers that has a name, and gives what is reckoned with
        instead.
        """
        n = self.width
        outputs = self.outputs(state)
        waiting = outputs["steps_valid"]
        taken = waiting & inputs["steps_ready"]
        free = negate(waiting) | inputs["steps_ready"]
        sound = equal(state["fault"], 0)
        ends_here = equal(state["p1"], state["xk"]) & equal(state["p2"], state["yk"])
        empty = equal(state["turns"], 0) & ends_here
        next_may = where(empty | negate(sound), negate(waiting), free)
        prepared = state["held"] & equal(state["tick"], 0)
        start = prepared & negate(state["running"]) & next_may
        load = start & sound
        accept = inputs["blocks_valid"] & outputs["blocks_ready"]
        clock = state["running"] & free

        after = self._run(state, clock, load, tell)
        finished, stepless = (after.pop(name) for name in ("finished", "stepless"))
        # The position moves with the step that is taken, not with the one that waits.
        for k, p in (("x", "p1"), ("y", "p2")):
            move = where(state[f"direction_{k}"], -1, 1)
            moved = state[f"{k}t"] + where(taken & state[f"pulse_{k}"], move, 0)
            after[f"{k}t"] = where(load, state[p], self._signed(moved, n + 1))
            kept = where(taken, 0, state[f"pulse_{k}"])
            after[f"pulse_{k}"] = where(clock, after[f"pulse_{k}"], kept)
        after["running"] = where(load, negate(empty), where(finished, 0, state["running"]))
        after["done"] = (taken & negate(state["running"])) | (load & empty) | stepless
        after["error"] = where(start, state["fault"], 0)

        # Preparation: Horner's rule, bit by bit; the top bit of a coordinate counts down.
        tick = state["tick"]
        multiplies = less(0, tick) & less(tick, n + 2)
        adds = equal(tick, n + 2)
        judges = equal(tick, n + 3)
        a, b, c = (state[k] for k in "abc")
        x_bit, y_bit = ((state[p] >> n) & 1 for p in ("p1", "p2"))
        for g, x_scale, y_scale, rest in (("gx", 2 * a, b, "d"), ("gy", b, 2 * c, "e")):
            digit = where(x_bit, x_scale, 0) + where(y_bit, y_scale, 0)
            grown = 2 * state[g] + where(equal(tick, 1), 0 - digit, digit)
            value = where(multiplies, grown, where(adds, state[g] + state[rest], after[g]))
            after[g] = self._signed(value, self.bits)
        for p in ("p1", "p2"):
            turned = self._signed(2 * state[p] + ((state[p] >> n) & 1), n + 1)
            after[p] = where(multiplies, turned, after[p])
        size = _size(state["gx"]) + _size(state["gy"])
        bend = _size(a) + _size(b) + _size(c)
        sharp = negate(empty) & (less(size, 4 * bend) | equal(size, 0))
        after["fault"] = where(judges & sharp, SHARP, state["fault"])
        counted = (tick + 1) & (2 ** (n + 3).bit_length() - 1)
        after["tick"] = where(judges | equal(tick, 0), 0, counted)

        received = {k: inputs[f"blocks_{k}"] for k in "abcde"} | {
            "p1": inputs["blocks_start_x"],
            "p2": inputs["blocks_start_y"],
            "xk": inputs["blocks_end_x"],
            "yk": inputs["blocks_end_y"],
            "clockwise": inputs["blocks_clockwise"],
            "turns": inputs["blocks_turns"],
            "fault": 0,
            "gx": 0,
            "gy": 0,
            "tick": 1,
        }
        after |= {name: where(accept, value, after[name]) for name, value in received.items()}
        after["held"] = where(accept, 1, where(start, 0, state["held"]))
        return after

    def _run(self, state: State, clock: Value, load: Value, tell: Callable) -> State:
        """One clock pulse of УУ, if there is one, or the start of a block."""
        n, m = self.width, self.modulus
        cw = state["clockwise"]
        gx, gy = state["gx"], state["gy"]
        last, entering = equal(state["turns"], 0), equal(state["turns"], 1)

        # x' = −Gy, y' = Gx, or with the clock the other way.
        below = {
            "x": where(cw, less(gy, 0), less(0, gy)),
            "y": where(cw, less(0, gx), less(gx, 0)),
        }
        still = {"x": equal(gy, 0), "y": equal(gx, 0)}
        piece = {k: state[f"direction_{k}"] ^ state[f"backward_{k}"] for k in "xy"}
        left = {"x": negate(equal(state["p3"], 0)), "y": negate(equal(state["p4"], 0))}
        goes = {k: negate(still[k]) & negate(below[k] ^ piece[k]) for k in "xy"}
        able = {k: left[k] & negate(state[f"backward_{k}"]) & goes[k] for k in "xy"}
        dead = negate(able["x"] | able["y"])
        # The gradient turns one way: of two axes one speeds up, the other will turn round.
        x_speeds_up = piece["x"] ^ piece["y"] ^ cw
        turn = clock & negate(last) & (dead | negate(where(x_speeds_up, goes["y"], goes["x"])))
        sums = clock & negate(turn)

        after = dict(state)
        hit = self._sum(state, after, able, piece, x_speeds_up, sums, tell)
        if self.ordered:
            after["fresh"] = where(load, 1, after["fresh"])
        complete = sums & last & dead
        step, move = {}, {}
        for k, p, count in (("x", "p1", "p3"), ("y", "p2", "p4")):
            step[k] = hit[k] | (complete & left[k])
            move[k] = where(step[k], where(state[f"direction_{k}"], -1, 1), 0)
            after[p] = self._signed(state[p] + move[k], n + 1)
            after[count] = state[count] - step[k]
            after[f"pulse_{k}"] = step[k]
        for g, x_scale, y_scale in (
            ("gx", 2 * state["a"], state["b"]),
            ("gy", state["b"], 2 * state["c"]),
        ):
            moved = state[g] + _times(move["x"], x_scale) + _times(move["y"], y_scale)
            after[g] = self._signed(moved, self.bits)

        # A new piece: which way, and how far.
        first_way = {
            "x": where(still["x"], negate(below["y"]) ^ cw, below["x"]),
            "y": where(still["y"], below["x"] ^ cw, below["y"]),
        }
        turns_round = {"x": negate(x_speeds_up), "y": x_speeds_up}
        final = where(load, last, entering)
        here, lands = {}, {}
        for k, p, end, count in (("x", "p1", "xk", "p3"), ("y", "p2", "yk", "p4")):
            ahead = where(load, first_way[k], piece[k] ^ turns_round[k])
            way = state[end] - state[p]
            here[k], lands[k] = equal(way, 0), equal(way, move[k])
            back = final & negate(here[k]) & (less(way, 0) ^ ahead)
            room = where(ahead, state[p] + 2**n, 2**n - 1 - state[p])
            loaded = {
                count: where(final, _size(way), room),
                f"backward_{k}": back,
                f"direction_{k}": ahead ^ back,
            }
            for name, value in loaded.items():
                after[name] = where(load | turn, value, after[name])
            initial = where(ahead, m - 1 - self.initial_sum, self.initial_sum)
            after[f"s{k}"] = where(load, initial, after[f"s{k}"])
        after["turns"] = (state["turns"] - turn) & (2**TURNS_BITS - 1)

        # The end, by a step or, when the last change of direction finds it reached, without one.
        stepless = turn & entering & here["x"] & here["y"]
        steps = step["x"] | step["y"]
        arrived = sums & steps & (last | entering) & lands["x"] & lands["y"]
        return after | {"finished": arrived | stepless, "stepless": stepless}

    def _sum(
        self,
        state: State,
        after: State,
        able: State,
        piece: State,
        x_speeds_up: Value,
        sums: Value,
        tell: Callable,
    ) -> State:
        """Sum both axes, the one that speeds up first; give which of them step."""
        m, cw = self.modulus, state["clockwise"]
        a, b, c = (state[k] for k in "abc")
        # An axis that does not go must not hold the other one up.
        going = [where(able["y"], state["gx"], 0), where(able["x"], state["gy"], 0)]
        none = self.no_limit
        limit: Value = none
        both = able["x"] & able["y"]
        if self.ordered:
            circle = equal(b, 0) & equal(a, c)
            free = state["fresh"] | circle | negate(both)
            limit = tell("limit", where(free, none, state["scale"]))
        scaled, places = self._scaled([*going, 2 * a, b, 2 * c], limit)
        places = tell("places", places)
        names = ("gx", "gy", "2a", "b", "2c")
        gx, gy, a2, b1, c2 = (tell(f"scaled_{k}", v) for k, v in zip(names, scaled, strict=True))
        velocity = {"x": where(cw, gy, 0 - gy), "y": where(cw, 0 - gx, gx)}
        x_first = 1 if self.order == "simultaneous" else x_speeds_up
        opposite = negate(x_first) ^ cw

        change: Value = 0
        own: Value = 0
        hits, rests, cans = [], [], []
        for which, x_now in (("first", x_first), ("second", negate(x_first))):
            speed = tell(f"{which}_velocity", where(x_now, velocity["x"], velocity["y"]))
            if which == "first" and self.ordered:
                change = self._centred(state, speed, places, limit)
            change = tell(f"{which}_change", change)
            total = tell(f"{which}_total", where(x_now, state["sx"], state["sy"]) + speed + change)
            down = where(x_now, piece["x"], piece["y"])
            can = sums & where(x_now, able["x"], able["y"])
            hit = can & where(down, less(total, 0), negate(less(total, m)))
            step = tell(f"{which}_step", where(hit, where(down, -1, 1), 0))
            if which == "second" and self.order == "implicit":
                own = where(opposite, 0 - b1, b1)
            own = tell(f"{which}_own", own)
            rest = total - tell(f"{which}_carried", _times(step, m - own))
            rest = tell(f"{which}_unlimited", rest)
            rest = where(less(rest, 2 * m), rest, 2 * m - 1)
            rest = tell(f"{which}_rest", where(less(rest, -2 * m), -2 * m, rest))
            change = 0
            if which == "first" and self.ordered:
                # What the first axis's step changes in y' = Gx, or in x' = −Gy.
                cross = _times(step, where(x_first, a2, c2))
                change = where(opposite, 0 - cross, cross)
            rests.append(rest)
            hits.append(step & 1)
            cans.append(can)

        if self.ordered:
            after["fresh"] = where(sums, 0, state["fresh"])
            after["scale"] = where(sums, where(both, places, none), state["scale"])
        hit = {}
        for k, now in (("x", x_first), ("y", negate(x_first))):
            first, second = (
                where(can, rest, state[f"s{k}"]) for can, rest in zip(cans, rests, strict=True)
            )
            after[f"s{k}"] = where(now, first, second)
            hit[k] = where(now, *hits)
        return hit

    def _centred(self, state: State, speed: Value, places: Value, limit: Value) -> Value:
        """Give what is added to the first axis's speed, half a summation before the second's.

        So it is summed from the middle of the last summation to the middle of this one, and adds
        the mean of both scales: half of this one at first, 3/2 of it when the last one was twice
        as large. Neither axis of a straight line waits for the other.
        """
        line = equal(state["a"], 0) & equal(state["b"], 0) & equal(state["c"], 0)
        at_first = where(line, 0, 0 - (speed >> 1)) if self.preload == "half" else 0
        longer = equal(limit, places + 1) & negate(equal(limit, self.no_limit))
        later = where(longer, speed >> 1, 0)
        return where(state["fresh"], at_first, later)

    def _scaled(self, values: list[Value], limit: Value) -> tuple[list[Value], Value]:
        """Shift numbers left together, until one would lose its sign or the limit is reached.

        Give also how many places.
        """
        total: Value = 0
        places = 1
        while 2 * places < self.bits:
            places *= 2
        while places:
            edge = 2 ** (self.bits - 1 - places)
            small: Value = 1
            for value in values:
                small = small & negate(less(value, -edge)) & less(value, edge)
            small = small & negate(less(limit, total + places))
            values = [where(small, value << places, value) for value in values]
            total = total + where(small, places, 0)
            places //= 2
        return values, total

    def _signed(self, value: Value, bits: int) -> Value:
        """Keep a number to its signed bits."""
        half = 2 ** (bits - 1)
        return ((value + half) & (2 * half - 1)) - half


def _size(value: Value) -> Value:
    return where(less(value, 0), 0 - value, value)


def _times(step: Value, value: Value) -> Value:
    """Multiply by a step: −1, 0 or 1."""
    return where(equal(step, 0), 0, where(less(step, 0), 0 - value, value))
