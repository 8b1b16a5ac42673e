"""Golden model of the exact interpolator of second-order curves, one clock at a time, in integers.

Written from the design's own method: the faster axis steps every clock, and the sign of the curve's
residual between the two points that it can lead to decides whether the other one steps, too. As
described of ``discreta.hdl.exact_conic.ExactConic``, whose letters are used here.

The same source runs on integers, NumPy arrays and SMT bit-vectors (see
:mod:`discreta.sim.golden.logic`). It knows nothing of the RTL. State and inputs are dicts by
register and port name.

Registers: of the block that runs ``residual``, ``outer`` (the residual, and what it would be in the
next frame), ``axial``, ``across`` (what moves them), ``alpha``, ``beta``, ``gamma`` (A, B and C as
seen along the path), five constants of the frame, ``steep``, ``slows``, ``diagonal``, ``turning``,
``turns``, P1 to P4, XT, YT; ``running``, ``done``, ``error``, ``late`` of УУ; ``pulse_x/y`` and
``direction_x/y`` of the step that waits. Of the block that is prepared ``a`` to ``e``, ``gx``,
``gy``, ``bend``, ``clockwise``, those that begin with ``next_``, ``still_x/y``, ``leads_x``,
``tie``, ``held``, ``fault``, ``tick``.
"""

from collections.abc import Callable
from dataclasses import dataclass

from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["CHANGES", "EXTRAS", "TURNS_BITS", "ExactConic"]

State = dict[str, Value]

RANGE, OFF_CURVE, SHARP = 1, 2, 3
TURNS_BITS = 11

#: Of a frame: what a step straight on and aslant adds to ``outer`` beside what it adds to
#: ``residual``; and what a change of the frame adds to the registers.
EXTRAS = ("outer_straight", "outer_aslant")
CHANGES = ("turn_outer", "turn_axial", "turn_across")


def _keep(_name: str, value: Value) -> Value:
    """Reckon with a value itself."""
    return value


@dataclass(frozen=True)
class ExactConic:
    """The exact interpolator of second-order curves of n = ``width`` bits, 4 to 24."""

    width: int = 16

    @property
    def bits(self) -> int:
        """Bits of the derivatives, signed."""
        return 2 * self.width + 7

    @property
    def residual_bits(self) -> int:
        """Bits of the residual, signed."""
        return 2 * self.width + 9

    @property
    def last_tick(self) -> int:
        """The last clock of a preparation."""
        return self.width + 8

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        n = self.width
        point, way, square = (n + 1, True), (n + 2, True), (n + 4, True)
        flag = (1, False)
        kinds: dict[str, tuple[int, bool]] = {
            "p1": point,
            "p2": point,
            "p3": way,
            "p4": way,
            "residual": (self.residual_bits, True),
            "outer": (self.residual_bits, True),
            "axial": (self.bits + 1, True),
            "across": (self.bits, True),
            "alpha": square,
            "beta": (n + 5, True),
            "gamma": square,
            **dict.fromkeys((*EXTRAS, *CHANGES), (n + 8, True)),
            **dict.fromkeys(("steep", "slows", "diagonal", "turning", "fresh"), flag),
            "turns": (TURNS_BITS, False),
            "xt": point,
            "yt": point,
            "running": flag,
            "done": flag,
            "error": (2, False),
            "late": (2, False),
            **dict.fromkeys(("pulse_x", "pulse_y", "direction_x", "direction_y"), flag),
        }
        return kinds | {
            "held": flag,
            "prepared": flag,
            "fault": (2, False),
            "tick": (self.last_tick.bit_length(), False),
            "a": square,
            "b": (n + 5, True),
            "c": square,
            "d": (2 * n + 5, True),
            "e": (2 * n + 5, True),
            "gx": (self.bits + 1, True),
            "gy": (self.bits, True),
            "bend": (n + 6, False),
            "next_residual": (self.residual_bits, True),
            "next_outer": (self.residual_bits, True),
            "clockwise": flag,
            **dict.fromkeys(("still_x", "still_y", "leads_x", "tie"), flag),
            **dict.fromkeys(("next_down_x", "next_down_y", "next_steep", "next_slows"), flag),
            "next_turns": (TURNS_BITS, False),
            "next_empty": flag,
            "next_x": point,
            "next_y": point,
            "next_p3": way,
            "next_p4": way,
        }

    def reset(self) -> State:
        """Give the state after reset: all registers are 0."""
        return dict.fromkeys(self.registers(), 0)

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        waiting = state["pulse_x"] | state["pulse_y"]
        out = {
            "blocks_ready": negate(state["held"]),
            "steps_valid": waiting,
            "steps_last": negate(state["running"]),
            "busy": state["held"] | state["running"] | waiting,
            "done": state["done"],
            "error": state["error"] | state["late"],
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
        outputs = self.outputs(state)
        waiting = outputs["steps_valid"]
        taken = waiting & inputs["steps_ready"]
        free = negate(waiting) | inputs["steps_ready"]
        sound = equal(state["fault"], 0)
        empty = state["next_empty"]
        next_may = where(empty | negate(sound), negate(waiting), free)
        start = state["prepared"] & negate(state["running"]) & next_may
        load = start & sound
        accept = inputs["blocks_valid"] & outputs["blocks_ready"]
        clock = state["running"] & free

        after = dict(state)
        ends = self._run(state, after, clock, load, tell)
        # The position moves with the step that is taken, not with the one that waits.
        for k in "xy":
            move = where(state[f"direction_{k}"], -1, 1)
            moved = state[f"{k}t"] + where(taken & state[f"pulse_{k}"], move, 0)
            after[f"{k}t"] = self._signed(moved, self.width + 1)
            kept = where(taken, 0, state[f"pulse_{k}"])
            after[f"pulse_{k}"] = where(clock, after[f"pulse_{k}"], kept)
        self._load(state, after, load)
        after["running"] = where(load, negate(empty), where(ends["ended"], 0, state["running"]))
        last_taken = taken & negate(state["running"])
        after["done"] = last_taken | (load & empty) | ends["stepless"]
        after["error"] = where(start, state["fault"], 0)
        after["late"] = ends["late"]

        self._prepare(state, after, where(accept, 0, state["tick"]))
        received = {k: inputs[f"blocks_{k}"] for k in ("a", "b", "c", "d", "e", "clockwise")}
        received |= {
            "next_x": inputs["blocks_start_x"],
            "next_y": inputs["blocks_start_y"],
            "next_p3": inputs["blocks_end_x"],
            "next_p4": inputs["blocks_end_y"],
            "next_turns": inputs["blocks_turns"],
            "fault": 0,
            "gx": 0,
            "gy": 0,
            "tick": 1,
        }
        after |= {name: where(accept, value, after[name]) for name, value in received.items()}
        after["held"] = where(accept, 1, where(start, 0, state["held"]))
        after["prepared"] = where(start, 0, after["prepared"])
        return after

    def _run(
        self, state: State, after: State, clock: Value, load: Value, tell: Callable
    ) -> dict[str, Value]:
        """One clock pulse of УУ, if there is one; give how it ends the block, if it does."""
        n = self.width
        steep, slows, diagonal = state["steep"], state["slows"], state["diagonal"]
        down = {k: state[f"direction_{k}"] for k in "xy"}
        left = {"x": state["p3"], "y": state["p4"]}
        place = {"x": state["p1"], "y": state["p2"]}
        last, few = equal(state["turns"], 0), less(state["turns"], 2)

        # The end: near, or behind.
        close = [negate(less(left[k], -1)) & less(left[k], 2) for k in "xy"]
        near = few & close[0] & close[1]
        here = equal(left["x"], 0) & equal(left["y"], 0)
        passed = [where(down[k], less(1, left[k]), less(left[k], -1)) for k in "xy"]
        missed = last & negate(near) & (passed[0] | passed[1])
        event = state["turning"]
        steps = {"x": negate(steep) | diagonal, "y": steep | diagonal}
        edge = {k: equal(place[k], where(down[k], -(2**n), 2**n - 1)) for k in "xy"}
        outside = (steps["x"] & edge["x"]) | (steps["y"] & edge["y"])
        outside = negate(near | missed | event) & outside
        late = where(missed, OFF_CURVE, where(outside, RANGE, 0))
        goes = negate(near | missed | event | outside)

        flip = event & negate(state["fresh"]) & slows
        for k, p, way in (("x", "p1", "p3"), ("y", "p2", "p4")):
            pulse = where(near, negate(equal(left[k], 0)), goes & steps[k])
            minor = negate(steep) if k == "y" else steep
            # In the clock that ends the block they do not matter.
            move = where(steps[k] & negate(event), where(down[k], -1, 1), 0)
            self._set(after, clock, p, self._signed(place[k] + move, n + 1))
            self._set(after, clock, way, self._signed(left[k] - move, n + 2))
            after[f"pulse_{k}"] = pulse
            turned = where(near, less(left[k], 0), down[k] ^ (flip & minor))
            self._set(after, clock, f"direction_{k}", turned)
        # Right after a change of the frame the constants of the next one are not there yet.
        waits = event & state["fresh"]
        for name, value in self._summed(state, load, tell).items():
            self._set(after, (clock & negate(waits)) | load, name, value)
        self._set(after, clock & waits, "fresh", 0)
        after |= self._changes(state, tell)
        ended = clock & (near | missed | outside)
        return {
            "ended": ended,
            "stepless": clock & near & here,
            "late": where(clock, late, 0),
        }

    def _summed(self, state: State, load: Value, tell: Callable) -> State:
        """Give what one clock makes of the residuals and of what belongs to them, or a block loads.

        What it makes of them in the clock that ends the block does not matter.
        """
        outer, axial, across = state["outer"], state["axial"], state["across"]
        alpha, beta, gamma = state["alpha"], state["beta"], state["gamma"]
        slows, diagonal, event = state["slows"], state["diagonal"], state["turning"]

        increment = tell("increment", axial + where(diagonal, 2 * across, 0))
        extra = where(diagonal, state["outer_aslant"], state["outer_straight"])
        stepped = {
            "residual": state["residual"] + increment,
            "outer": outer + increment + extra,
            "axial": axial + 4 * alpha + where(diagonal, 2 * beta, 0),
            "across": across + beta + where(diagonal, 2 * gamma, 0),
        }
        # The slower axis turns round, or becomes the faster one.
        half = axial >> 1
        opposite = where(slows, half, axial) + where(slows, across, 0)
        opposite = tell("opposite", state["turn_outer"] - opposite)
        changed = {
            "residual": outer,
            "outer": outer + opposite,
            "axial": where(slows, axial, 2 * across) + state["turn_axial"],
            "across": where(slows, 0 - across, half) + state["turn_across"],
        }
        loaded = {
            "residual": state["next_residual"],
            "outer": state["next_outer"],
            "axial": state["gx"],
            "across": state["gy"],
        }
        flip, swap = event & slows, event & negate(slows)
        after = {
            name: where(load, loaded[name], where(event, changed[name], value))
            for name, value in stepped.items()
        } | {
            "alpha": where(load, state["a"], where(swap, gamma, alpha)),
            "beta": where(load, state["b"], where(flip, 0 - beta, beta)),
            "gamma": where(load, state["c"], where(swap, alpha, gamma)),
        }
        kinds = self.registers()
        after = {
            name: tell(f"{name}_after", self._signed(value, kinds[name][0]))
            for name, value in after.items()
        }
        turns = (state["turns"] - flip) & (2**TURNS_BITS - 1)
        after |= {
            "turns": where(load, state["next_turns"], turns),
            "steep": where(load, state["next_steep"], state["steep"] ^ swap),
            "slows": where(load, state["next_slows"], slows ^ event),
        }
        after |= self._signs(after)
        extras = {
            "outer_straight": (0 - beta - 2 * alpha, 0 - 2 * beta),
            "outer_aslant": (2 * gamma - 2 * alpha, 0 - 2 * beta - 4 * alpha),
        }
        for name, pair in extras.items():
            value = self._signed(where(slows, *pair), kinds[name][0])
            after[name] = where(event, value, state[name])
        for name, value in zip(EXTRAS, (state["d"], state["e"]), strict=True):
            after[name] = where(load, self._signed(value, kinds[name][0]), after[name])
        after["fresh"] = load | event
        return after

    def _signs(self, frame: State) -> State:
        """Give what the signs of the residuals mean: for the next step, and for the frame."""
        stays = frame["slows"] & equal(frame["turns"], 0)
        return {
            "diagonal": negate(less(frame["residual"], 0) ^ frame["slows"]),
            "turning": negate(less(frame["outer"], 0)) & negate(stays),
        }

    def _changes(self, state: State, tell: Callable) -> State:
        """Give what the next change of the frame adds, in every clock anew."""
        alpha, beta, gamma = state["alpha"], state["beta"], state["gamma"]
        more_alpha = tell("more_alpha", alpha + (alpha >> 1))
        more_beta = tell("more_beta", 2 * beta + (beta >> 1))
        more_gamma = tell("more_gamma", 4 * gamma - (gamma >> 1))
        pairs = {
            "turn_outer": (more_alpha + more_beta + more_gamma, 4 * alpha + 2 * alpha - beta),
            "turn_axial": (0 - 2 * beta, 2 * gamma - beta - 2 * beta),
            "turn_across": (4 * gamma, 2 * beta - alpha - (beta >> 1)),
        }
        kinds = self.registers()
        return {
            name: self._signed(where(state["slows"], *pair), kinds[name][0])
            for name, pair in pairs.items()
        }

    def _load(self, state: State, after: State, load: Value) -> None:
        """Take the prepared block over."""
        loaded = {
            "p1": state["next_x"],
            "p2": state["next_y"],
            "xt": state["next_x"],
            "yt": state["next_y"],
            "p3": state["next_p3"],
            "p4": state["next_p4"],
            "direction_x": state["next_down_x"],
            "direction_y": state["next_down_y"],
        }
        for name, value in loaded.items():
            self._set(after, load, name, value)

    def _prepare(self, state: State, after: State, tick: Value) -> None:
        """Horner's rule, bit by bit; then the frame of the first piece and the residuals in it."""
        n = self.width
        a, b, c, gx, gy = (state[k] for k in ("a", "b", "c", "gx", "gy"))
        kinds = self.registers()
        multiplies = less(0, tick) & less(tick, n + 2)
        at = {k: equal(tick, n + k) for k in range(2, 9)}

        def put(k: int, **values: Value) -> None:
            for name, value in values.items():
                bits, signed = kinds[name]
                kept = self._signed(value, bits) if signed else value & (2**bits - 1)
                self._set(after, at[k], name, kept)

        x_bit, y_bit = ((state[p] >> n) & 1 for p in ("next_x", "next_y"))
        for g, x_scale, y_scale in (("gx", 2 * a, b), ("gy", b, 2 * c)):
            digit = where(x_bit, x_scale, 0) + where(y_bit, y_scale, 0)
            grown = 2 * state[g] + where(equal(tick, 1), 0 - digit, digit)
            self._set(after, multiplies, g, self._signed(grown, kinds[g][0]))
        for p in ("next_x", "next_y"):
            turned = self._signed(2 * state[p] + ((state[p] >> n) & 1), n + 1)
            self._set(after, multiplies, p, turned)
        put(2, gx=gx + state["d"], gy=gy + state["e"])
        put(2, next_p3=state["next_p3"] - state["next_x"])
        put(2, next_p4=state["next_p4"] - state["next_y"])

        no_way = equal(state["next_p3"], 0) & equal(state["next_p4"], 0)
        put(3, next_empty=equal(state["next_turns"], 0) & no_way)
        rising, falling = gx + gy, gx - gy
        put(3, still_x=equal(gy, 0), still_y=equal(gx, 0))
        put(3, leads_x=less(rising, 0) ^ less(falling, 0))
        put(3, tie=equal(rising, 0) | equal(falling, 0), bend=_size(a) + _size(c))

        cw, still_x, still_y = (state[k] for k in ("clockwise", "still_x", "still_y"))
        below_x, below_y = less(gy, 0) ^ negate(cw), less(gx, 0) ^ cw
        # An axis that stands still goes where the curve bends to.
        down_x = where(still_x, negate(below_y) ^ cw, below_x)
        down_y = where(still_y, below_x ^ cw, below_y)
        # The axes in turn speed up and slow down; of two that are as fast as each other the one
        # leads that does not slow down.
        x_slows = negate(down_x ^ down_y ^ cw)
        leads_x = where(state["tie"], negate(x_slows), state["leads_x"])
        put(4, next_down_x=down_x, next_down_y=down_y, next_steep=negate(leads_x))
        put(4, next_slows=x_slows ^ leads_x, bend=state["bend"] + _size(b))

        steep, slows = state["next_steep"], state["next_slows"]
        ahead_x = where(state["next_down_x"], 0 - gx, gx)
        ahead_y = where(state["next_down_y"], 0 - gy, gy)
        opposed = state["next_down_x"] ^ state["next_down_y"]
        put(5, gx=where(steep, ahead_y, ahead_x), gy=where(steep, ahead_x, ahead_y))
        put(5, a=where(steep, c, a), b=where(opposed, 0 - b, b), c=where(steep, a, c))

        # D and E have been added: their registers hold what else there is to add.
        put(6, next_residual=where(slows, gy - gx, gx - gy))
        put(6, d=4 * a + 2 * a + b, e=2 * (b + c))
        sharp = less(state["next_residual"], 4 * state["bend"]) | (still_x & still_y)
        self._set(after, at[7] & negate(state["next_empty"]) & sharp, "fault", SHARP)
        put(7, gx=2 * gx + state["d"], gy=gy + state["e"], next_residual=2 * gx + gy)
        put(7, next_outer=where(slows, 2 * gx - gy, 2 * gy + gx))
        put(7, d=2 * a + b + (c >> 1))
        put(7, e=where(slows, 2 * a - b + (c >> 1), 2 * c + b + (a >> 1)))
        put(8, next_residual=state["next_residual"] + state["d"])
        put(8, next_outer=state["next_outer"] + state["e"])
        # What is left of a frame is what its steps add to the outer residual.
        put(8, d=where(slows, 0 - 2 * b, b - 2 * a))
        put(8, e=where(slows, 0 - 2 * b - 4 * c, 2 * c - 2 * a), prepared=1)
        counted = (tick + 1) & (2 ** self.last_tick.bit_length() - 1)
        after["tick"] = where(at[8] | equal(tick, 0), 0, counted)

    def _set(self, after: State, condition: Value, name: str, value: Value) -> None:
        """Let a register have a value where the condition holds."""
        after[name] = where(condition, value, after[name])

    def _signed(self, value: Value, bits: int) -> Value:
        """Keep a number to its signed bits."""
        half = 2 ** (bits - 1)
        return ((value + half) & (2 * half - 1)) - half


def _size(value: Value) -> Value:
    return where(less(value, 0), 0 - value, value)
