"""Golden model of the interpolator of second-order curves, one clock at a time. WIP"""

from dataclasses import dataclass

from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["Conic"]

State = dict[str, Value]

SHARP = 3
TURNS_BITS = 11


@dataclass(frozen=True)
class Conic:
    """The interpolator of second-order curves of n = ``width`` bits."""

    width: int = 16
    order: str = "implicit"
    preload: str = "half"
    guard: int = 2

    @property
    def bits(self) -> int:
        """Bits of the derivatives."""
        return 2 * self.width + 7

    @property
    def modulus(self) -> int:
        """M."""
        return 2 ** (self.bits - 1 + self.guard)

    @property
    def initial_sum(self) -> int:
        """What the summators start from when their axis rises."""
        return {"zero": 0, "half": self.modulus // 2}[self.preload]

    @property
    def halves(self) -> bool:
        """Half of the first increment is taken off the sum that is added to first."""
        return self.order != "simultaneous" and self.preload == "half"

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
        if self.halves:
            kinds["fresh"] = (1, False)
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

    def step(self, state: State, inputs: dict[str, Value]) -> State:
        """Give the state after one clock."""
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

        after = self._run(state, clock, load)
        finished = after.pop("finished")
        for k in "xy":
            move = where(state[f"direction_{k}"], -1, 1)
            moved = state[f"{k}t"] + where(taken & state[f"pulse_{k}"], move, 0)
            after[f"{k}t"] = where(
                load, state[{"x": "p1", "y": "p2"}[k]], self._signed(moved, n + 1)
            )
            kept = where(taken, 0, state[f"pulse_{k}"])
            after[f"pulse_{k}"] = where(clock, after[f"pulse_{k}"], kept)
        after["running"] = where(load, negate(empty), where(finished, 0, state["running"]))
        after["done"] = (taken & negate(state["running"])) | (load & empty)
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
        bend = 2 * (_size(a) + _size(b) + _size(c))
        sharp = negate(empty) & (less(size, 2 * bend) | equal(size, 0))
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

    def _run(self, state: State, clock: Value, load: Value) -> State:
        """One clock pulse of УУ, if there is one, or the start of a block."""
        n, m = self.width, self.modulus
        cw = state["clockwise"]
        a, b, c = (state[k] for k in "abc")
        gx, gy = state["gx"], state["gy"]
        last = equal(state["turns"], 0)
        fresh = state["fresh"] if self.halves else 0

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
        x_first = piece["x"] ^ piece["y"] ^ cw
        whole = clock & negate(fresh)
        turn = whole & negate(last) & (dead | negate(where(x_first, goes["y"], goes["x"])))
        sums = whole & negate(turn)

        # An axis that does not go must not hold the other one up.
        going = [where(able["y"], gx, 0), where(able["x"], gy, 0)]
        big_gx, big_gy, big_a, big_b, big_c = self._scaled([*going, 2 * a, b, 2 * c])
        velocity = {"x": where(cw, big_gy, 0 - big_gy), "y": where(cw, 0 - big_gx, big_gx)}

        def add(k: str, more: Value) -> tuple[Value, Value, Value]:
            """Sum one axis; give the sum without the carry, whether it steps, and the step."""
            total = state[f"s{k}"] + velocity[k] + more
            over = where(piece[k], less(total, 0), negate(less(total, m)))
            hit = sums & able[k] & over
            move = where(hit, where(piece[k], -1, 1), 0)
            return total - where(hit, where(piece[k], -m, m), 0), hit, move

        def changed(k: str, by: Value, times: Value) -> Value:
            """What ``by`` times a step changes in the velocity of axis k."""
            value = where(equal(times, 0), 0, where(less(times, 0), 0 - by, by))
            return where(cw ^ (1 if k == "x" else 0), 0 - value, value)

        plans = {}
        for first, second in ("xy", "yx"):
            one, hit_one, move_one = add(first, 0)
            more: Value = 0
            if self.order != "simultaneous":
                more = changed(second, big_a if second == "y" else big_c, move_one)
            two, hit_two, move_two = add(second, more)
            if self.order == "implicit":
                two = two + changed(second, big_b, move_two)
            plans[first] = {first: (one, hit_one), second: (two, hit_two)}
        if self.order == "simultaneous":
            plans["y"] = plans["x"]

        after = dict(state)
        complete = sums & last & dead
        step, move = {}, {}
        bent = negate(equal(a, 0) & equal(b, 0) & equal(c, 0))
        wide = self.bits + self.guard + 1
        for k in "xy":
            total = where(x_first, plans["x"][k][0], plans["y"][k][0])
            hit = where(x_first, plans["x"][k][1], plans["y"][k][1])
            after[f"s{k}"] = where(sums & able[k], self._signed(total, wide), state[f"s{k}"])
            step[k] = hit | (complete & left[k])
            move[k] = where(step[k], where(state[f"direction_{k}"], -1, 1), 0)
            if self.halves:
                mine = x_first if k == "x" else negate(x_first)
                half = self._signed(state[f"s{k}"] - (velocity[k] >> 1), wide)
                after[f"s{k}"] = where(clock & fresh & bent & mine, half, after[f"s{k}"])
        if self.halves:
            after["fresh"] = where(load, 1, where(clock, 0, fresh))
        low = 2 ** (n + 1) - 1
        for p, count, k in (("p1", "p3", "x"), ("p2", "p4", "y")):
            after[p] = self._signed(state[p] + move[k], n + 1)
            after[count] = (state[count] - step[k]) & low
            after[f"pulse_{k}"] = step[k]

        def times(by: Value, k: str) -> Value:
            return where(equal(move[k], 0), 0, where(less(move[k], 0), 0 - by, by))

        after["gx"] = self._signed(gx + times(2 * a, "x") + times(b, "y"), self.bits)
        after["gy"] = self._signed(gy + times(b, "x") + times(2 * c, "y"), self.bits)
        finished = clock & last & equal(after["p3"], 0) & equal(after["p4"], 0)

        # A new piece: which way, and how far.
        first_way = {
            "x": where(still["x"], negate(below["y"]) ^ cw, below["x"]),
            "y": where(still["y"], below["x"] ^ cw, below["y"]),
        }
        slows = {"x": negate(x_first), "y": x_first}
        final = where(load, last, equal(state["turns"], 1))
        enters = load | turn
        for k, p, end, count in (("x", "p1", "xk", "p3"), ("y", "p2", "yk", "p4")):
            ahead = where(load, first_way[k], piece[k] ^ slows[k])
            way = state[end] - state[p]
            back = final & negate(equal(way, 0)) & (less(way, 0) ^ ahead)
            room = where(ahead, state[p] + 2**n, 2**n - 1 - state[p])
            after[count] = where(enters, where(final, _size(way), room), after[count])
            after[f"backward_{k}"] = where(enters, back, state[f"backward_{k}"])
            after[f"direction_{k}"] = where(enters, ahead ^ back, state[f"direction_{k}"])
            initial = where(ahead, m - 1 - self.initial_sum, self.initial_sum)
            after[f"s{k}"] = where(load, initial, after[f"s{k}"])
        after["turns"] = (state["turns"] - turn) & (2**TURNS_BITS - 1)
        return after | {"finished": finished}

    def _scaled(self, values: list[Value]) -> list[Value]:
        """Shift numbers left together until one of them would lose its sign."""
        places = 1
        while 2 * places < self.bits:
            places *= 2
        while places:
            edge = 2 ** (self.bits - 1 - places)
            small: Value = 1
            for value in values:
                small = small & negate(less(value, -edge)) & less(value, edge)
            values = [where(small, value << places, value) for value in values]
            places //= 2
        return values

    def _signed(self, value: Value, bits: int) -> Value:
        """Keep a number to its signed bits."""
        half = 2 ** (bits - 1)
        return ((value + half) & (2 * half - 1)) - half


def _size(value: Value) -> Value:
    return where(less(value, 0), 0 - value, value)
