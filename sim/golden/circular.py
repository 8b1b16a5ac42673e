"""Golden model of the circular interpolator, one clock at a time.

From the lecture (circular interpolation, steps 1–10, with X counted down in step 9.1) and the
design's rules for what the lecture leaves open: any quadrant, both directions, turns, the end.
Blocks come by a valid/ready handshake and are prepared one ahead; steps leave by a valid/ready
handshake, one clock after the summation that carried.

A state is a dict from register name to value. P1, P2 hold X and Y, seen from the centre in the
quadrant of the moment turned onto the first; P3, P4 hold KOX and KOY; SX and SY the sums modulo M =
2^(n + g); XT, YT the coordinates (signed). Around them stand ``turns``, ``swap``, ``backward``,
``fresh`` and the end XK, YK and ``limit`` of the running arc; the prepared block (``held``,
``fault``, ``empty``, ``start_``, ``center_``, ``negative_``, ``first_swap``, ``first_turns``); the
radius meter (``tick``, ``mask``, ``from_``, ``to_``, ``start_square``, ``end_square``, ``rest``,
``root``); the step that waits (``pulse_``, ``direction_``), and УУ: ``running``, ``done``,
``error``.
"""

from dataclasses import dataclass

from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["Circular"]

State = dict[str, Value]

RANGE, OFF_CURVE = 1, 2
FULL_TURNS_BITS, TURNS_BITS = 8, 11


@dataclass(frozen=True)
class Circular:
    """The circular interpolator of n = ``width`` bits.

    Attributes
    ----------
    width : int
        n, 4 to 32.
    order : str
        ``"simultaneous"``: SY adds the X from before the summation; ``"alternated"``: from after.
    normalize : bool
        Shift X and Y left together before every summation.
    preload : str
        ``"zero"`` or ``"half"``: the summators start at 0 or M/2.
    guard : int
        g: bits of the summators below those of the coordinates.
    """

    width: int = 16
    order: str = "alternated"
    normalize: bool = True
    preload: str = "half"
    guard: int = 2

    @property
    def modulus(self) -> int:
        """M."""
        return 2 ** (self.width + self.guard)

    @property
    def initial_sum(self) -> int:
        """What the summators start from."""
        return {"zero": 0, "half": self.modulus // 2}[self.preload]

    @property
    def halves(self) -> bool:
        """Half of the first increment is taken off SX."""
        return self.order == "alternated" and self.preload == "half"

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        n = self.width
        kinds: dict[str, tuple[int, bool]] = dict.fromkeys(("p1", "p2", "p3", "p4"), (n, False))
        kinds |= dict.fromkeys(("sx", "sy"), (n + self.guard, False))
        kinds |= dict.fromkeys(("xt", "yt"), (n + 1, True))
        kinds |= {"turns": (TURNS_BITS, False), "swap": (1, False), "backward": (1, False)}
        if self.halves:
            kinds["fresh"] = (1, False)
        kinds |= dict.fromkeys(("xk", "yk", "limit"), (n, False))
        kinds |= {"running": (1, False), "done": (1, False), "error": (2, False)}
        kinds |= dict.fromkeys(("pulse_x", "pulse_y", "direction_x", "direction_y"), (1, False))
        return kinds | self.prepared_registers()

    def prepared_registers(self) -> dict[str, tuple[int, bool]]:
        """Give those registers of them that prepare a block, in any method that draws arcs."""
        n = self.width
        kinds: dict[str, tuple[int, bool]] = {"held": (1, False), "fault": (2, False)}
        kinds |= {"empty": (1, False)}
        kinds |= dict.fromkeys(("start_x", "start_y", "center_x", "center_y"), (n + 1, True))
        kinds |= dict.fromkeys(("first_swap", "negative_x", "negative_y"), (1, False))
        kinds |= {"first_turns": (TURNS_BITS, False)}
        kinds |= {"tick": ((2 * n + 4).bit_length(), False), "mask": (n, False)}
        kinds |= dict.fromkeys(("from_x", "from_y", "to_x", "to_y"), (n, False))
        kinds |= {"start_square": (2 * n + 2, False), "end_square": (2 * n + 2, True)}
        return kinds | {"rest": (n + 3, False), "root": (n + 2, False)}

    def reset(self) -> State:
        """Give the state after reset."""
        state: State = dict.fromkeys(self.registers(), 0)
        return state | dict.fromkeys(("sx", "sy"), self.initial_sum)

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        waiting = state["pulse_x"] | state["pulse_y"]
        out = {
            "blocks_ready": negate(state["held"]),
            "steps_valid": waiting,
            "steps_last": negate(state["running"]),
            "busy": state["held"] | state["running"] | waiting,
            "done": state["done"],
            "error": state["error"],
            "position_x": state["xt"],
            "position_y": state["yt"],
        }
        for a in "xy":
            out[f"steps_{a}"] = where(state[f"pulse_{a}"], where(state[f"direction_{a}"], -1, 1), 0)
        return out

    def step(self, state: State, inputs: dict[str, Value]) -> State:
        """Give the state after one clock.

        ``inputs``: ``blocks_valid``, ``blocks_start_x``, ``blocks_start_y``, ``blocks_end_x``,
        ``blocks_end_y``, ``blocks_center_x``, ``blocks_center_y``, ``blocks_clockwise``,
        ``blocks_full_turns``, ``steps_ready``.
        """
        waiting = state["pulse_x"] | state["pulse_y"]
        taken = waiting & inputs["steps_ready"]
        free = negate(waiting) | inputs["steps_ready"]
        sound = equal(state["fault"], 0)
        # A block with nothing to sum lets the step before it go first: one answer a clock.
        next_may = where(state["empty"] | negate(sound), negate(waiting), free)
        prepared = state["held"] & equal(state["tick"], 0)
        start = prepared & negate(state["running"]) & next_may
        load = start & sound
        accept = inputs["blocks_valid"] & negate(state["held"])

        after = self._run(state, state["running"] & free)
        finished = after.pop("finished")
        # The position moves with the step that is taken, not with the one that waits.
        for a in "xy":
            move = where(state[f"direction_{a}"], -1, 1)
            moved = state[f"{a}t"] + where(taken & state[f"pulse_{a}"], move, 0)
            after[f"{a}t"] = self._signed(moved, self.width + 1)
            kept = where(taken, 0, state[f"pulse_{a}"])
            after[f"pulse_{a}"] = where(state["running"] & free, after[f"pulse_{a}"], kept)
        loaded = self._load(state)
        after = {name: where(load, loaded.get(name, value), value) for name, value in after.items()}

        after["running"] = where(load, negate(state["empty"]), where(finished, 0, state["running"]))
        after["done"] = (taken & negate(state["running"])) | (load & state["empty"])
        after["error"] = where(start, state["fault"], 0)

        meter = self.measure(state)
        received = self.receive(inputs)
        for name, value in meter.items():
            after[name] = where(accept, received.get(name, value), value)
        after["held"] = where(accept, 1, where(start, 0, state["held"]))
        return after

    def _run(self, state: State, clock: Value) -> State:
        """One clock pulse of УУ, if there is one: everything that a running arc changes."""
        x, y, kox, koy = (state[name] for name in ("p1", "p2", "p3", "p4"))
        last_piece = equal(state["turns"], 0)
        fresh = state["fresh"] if self.halves else 0
        turn = clock & negate(fresh) & negate(last_piece) & equal(kox, 0)
        sums = clock & negate(fresh) & negate(turn)

        # Lecture, steps 8 to 10: add the other coordinate, look for a carry, move, count down.
        lower = where(equal(x, 0), 0, x - 1)
        x_scaled, y_scaled, lower_scaled = self._scaled(x, y, lower)
        x_goes = negate(equal(kox, 0)) & negate(state["backward"])
        y_goes = negate(equal(koy, 0))
        total_x = state["sx"] + y_scaled
        carry_x = sums & x_goes & negate(less(total_x, self.modulus))
        if self.order == "alternated":
            x_scaled = where(carry_x, lower_scaled, x_scaled)
        total_y = state["sy"] + x_scaled
        carry_y = sums & y_goes & negate(less(total_y, self.modulus))

        # The end: nothing would ever carry again, and what is left is put out.
        nothing_x = negate(x_goes) | equal(y, 0)
        nothing_y = negate(y_goes) | equal(x, 0)
        complete = sums & last_piece & nothing_x & nothing_y
        step_x = carry_x | (complete & negate(equal(kox, 0)))
        step_y = carry_y | (complete & y_goes)

        after = dict(state)
        n = self.width
        low = 2**n - 1
        after["p1"] = (x + where(state["backward"], step_x, 0 - step_x)) & low
        after["p2"] = (y + step_y) & low
        after["p3"] = kox - step_x
        after["p4"] = koy - step_y
        inside = self.modulus - 1
        after["sx"] = where(sums & x_goes, total_x & inside, state["sx"])
        after["sy"] = where(sums & y_goes, total_y & inside, state["sy"])
        if self.halves:
            half = (self.modulus // 2 - (y_scaled >> 1)) & inside
            after["sx"] = where(clock & fresh, half, after["sx"])
            after["fresh"] = where(clock, 0, fresh)
        after["pulse_x"] = where(state["swap"], step_y, step_x)
        after["pulse_y"] = where(state["swap"], step_x, step_y)
        finished = clock & last_piece & equal(after["p3"], 0) & equal(after["p4"], 0)

        # An axis is crossed: Y falls from now on, and X rises from 0.
        entering = equal(state["turns"], 1)
        short = less(y, state["xk"])
        left = where(short, state["xk"] - y, y - state["xk"])
        backward = entering & short
        x_turns = state["swap"] & negate(backward)
        y_turns = negate(state["swap"]) & negate(backward)
        turned = {
            "p1": y,
            "p2": 0,
            "p3": where(entering, left, y),
            "p4": where(entering, state["yk"], state["limit"]),
            "sx": self.modulus - 1 - state["sy"],
            "sy": state["sx"],
            "turns": (state["turns"] - 1) & (2**TURNS_BITS - 1),
            "swap": negate(state["swap"]),
            "backward": backward,
            "direction_x": state["direction_x"] ^ x_turns,
            "direction_y": state["direction_y"] ^ y_turns,
        }
        after |= {name: where(turn, value, after[name]) for name, value in turned.items()}
        return after | {"finished": finished}

    def _load(self, state: State) -> State:
        """Lecture, steps 2 and 3: what a block loads when it starts."""
        low = 2**self.width - 1
        x, y, xk, yk = (state[name] for name in ("from_x", "from_y", "to_x", "to_y"))
        limit = ((state["root"] >> 1) + 1) & low
        one_piece = equal(state["first_turns"], 0)
        loaded = {
            "p1": x,
            "p2": y,
            "p3": where(one_piece, x - xk, x) & low,
            "p4": where(one_piece, yk - y, limit - y) & low,
            "sx": self.initial_sum,
            "sy": self.initial_sum,
            "xt": state["start_x"],
            "yt": state["start_y"],
            "turns": state["first_turns"],
            "swap": state["first_swap"],
            "backward": 0,
            "xk": xk,
            "yk": yk,
            "limit": limit,
            "direction_x": state["negative_x"],
            "direction_y": state["negative_y"],
        }
        return loaded | ({"fresh": 1} if self.halves else {})

    def receive(self, inputs: dict[str, Value]) -> State:
        """Input processing: what a block sets when it is accepted."""
        clockwise = inputs["blocks_clockwise"]
        center = {a: inputs[f"blocks_center_{a}"] for a in "xy"}
        quadrant: dict[str, Value] = {}
        fault: Value = 0
        received: State = {}
        for point, name in (("start", "from"), ("end", "to")):
            x = inputs[f"blocks_{point}_x"] - center["x"]
            y = inputs[f"blocks_{point}_y"] - center["y"]
            y = where(clockwise, 0 - y, y)
            # A start belongs to the quadrant after the axis it is on, an end to the one before:
            # quadrant I holds the positive x axis for a start, the positive y axis for an end.
            if point == "start":
                quadrant[point] = _quadrant(x, y)
            else:
                quadrant[point] = 3 - _quadrant(x, 0 - y)
            x, y = (where(less(value, 0), 0 - value, value) for value in (x, y))
            odd = quadrant[point] & 1
            low = 2**self.width - 1
            received[f"{name}_x"] = where(odd, y, x) & low
            received[f"{name}_y"] = where(odd, x, y) & low
            fault = fault | less(low, x) | less(low, y)
        first = quadrant["start"]
        crossings = (quadrant["end"] - first) & 3
        return received | {
            "fault": where(fault, RANGE, 0),
            "empty": 0,
            **{f"start_{a}": inputs[f"blocks_start_{a}"] for a in "xy"},
            **{f"center_{a}": center[a] for a in "xy"},
            "first_swap": first & 1,
            # In quadrants I and II x falls; in II and III y does, the other way when mirrored.
            "negative_x": less(first, 2),
            "negative_y": equal((first + 1) >> 1, 1) ^ clockwise,
            "first_turns": 4 * inputs["blocks_full_turns"] + crossings,
            "tick": 1,
            **dict.fromkeys(("mask", "start_square", "end_square", "rest", "root"), 0),
        }

    def measure(self, state: State) -> State:
        """The radius meter and what follows from it, in the clocks after a block's acceptance."""
        n = self.width
        tick = state["tick"]
        squaring = less(0, tick) & less(tick, n + 1)
        squared = equal(tick, n + 1)
        drawing = less(n + 1, tick) & less(tick, 2 * n + 4)
        measured = equal(tick, 2 * n + 4)
        after = {
            name: state[name]
            for name in (
                *("fault", "empty", "start_x", "start_y", "center_x", "center_y"),
                *("first_swap", "negative_x", "negative_y", "first_turns"),
                *("mask", "from_x", "from_y", "to_x", "to_y"),
                *("start_square", "end_square", "rest", "root"),
            )
        }
        low, square_low = 2**n - 1, 2 ** (2 * n + 2) - 1

        # Squares from the top bit: (2p + b)² = 4p² + b·(4p + 1).
        sums = {"from": 4 * state["start_square"], "to": 4 * state["end_square"]}
        for name in sums:
            for a in "xy":
                value = state[f"{name}_{a}"]
                bit = value >> (n - 1)
                prefix = value & state["mask"]
                sums[name] = sums[name] + where(bit, 4 * prefix + 1, 0)
                after[f"{name}_{a}"] = where(squaring, ((value << 1) | bit) & low, value)
        after["mask"] = where(squaring, (2 * state["mask"] + 1) & low, state["mask"])

        # The root of four times the start's square, two bits at a time.
        pair = state["start_square"] >> (2 * n)
        brought = 4 * state["rest"] + pair
        trial = 4 * state["root"] + 1
        fits = negate(less(brought, trial))
        rest = where(fits, brought - trial, brought) & (2 ** (n + 3) - 1)
        root = (2 * state["root"] + fits) & (2 ** (n + 2) - 1)
        after["rest"] = where(drawing, rest, state["rest"])
        after["root"] = where(drawing, root, state["root"])

        start_square = where(drawing, 4 * state["start_square"], state["start_square"])
        after["start_square"] = where(squaring, sums["from"], start_square) & square_low
        difference = where(
            squared, state["end_square"] - state["start_square"], state["end_square"]
        )
        after["end_square"] = self._signed(where(squaring, sums["to"], difference), 2 * n + 2)

        # One quadrant, and the end is not ahead: once round.
        x, y, xk, yk = (state[name] for name in ("from_x", "from_y", "to_x", "to_y"))
        ahead = negate(less(x, xk)) & negate(less(yk, y)) & negate(equal(x, xk) & equal(y, yk))
        once_round = squared & equal(state["first_turns"] & 3, 0) & negate(ahead)
        after["first_turns"] = (state["first_turns"] + where(once_round, 4, 0)) & (
            2**TURNS_BITS - 1
        )

        # The verdict: |√E − √S| ≤ 1 is |E − S − 1| ≤ ⌊2√S⌋ for S ≥ 1.
        d, r = state["end_square"], state["root"]
        centred = equal(r, 0)
        on_curve = negate(less(r, d - 1)) & negate(less(d, 1 - r)) & negate(centred)
        empty = centred & equal(d, 0)
        off = where(on_curve | empty, 0, OFF_CURVE)
        leaves = self._leaves(state) & negate(empty)
        fault = where(leaves, RANGE, where(state["fault"], state["fault"], off))
        after["fault"] = where(measured, fault, state["fault"])
        after["empty"] = where(measured, empty, state["empty"])
        after["tick"] = where(measured, 0, (tick + negate(equal(tick, 0)))) & (
            2 ** (2 * n + 4).bit_length() - 1
        )
        return after

    def _leaves(self, state: State) -> Value:
        """Tell whether the prepared arc goes where there are no coordinates."""
        top = 2**self.width
        limit = (state["root"] >> 1) + 1
        turns = state["first_turns"]
        out = less(0, turns) & less(top - 1, limit)
        for a, rises in (("x", state["first_swap"]), ("y", negate(state["first_swap"]))):
            center = state[f"center_{a}"]
            # Crossed first where it moves to at first, then on the other side.
            before = negate(rises)
            for again in range(2):
                downwards = state[f"negative_{a}"] ^ again
                crossed = less(before, turns)
                beyond = where(downwards, less(center - limit, -top), less(top - 1, center + limit))
                out = out | (crossed & beyond)
                before = before + 2
        return out

    def _scaled(self, x: Value, y: Value, lower: Value) -> tuple[Value, Value, Value]:
        """Shift X, Y and X − 1 left together until X or Y has its top bit set."""
        if not self.normalize:
            return x, y, lower
        for places in (16, 8, 4, 2, 1):
            if places < self.width:
                small = less(x | y, 2 ** (self.width - places))
                x, y, lower = (where(small, v << places, v) for v in (x, y, lower))
        return x, y, lower

    def _signed(self, value: Value, bits: int) -> Value:
        """Keep a number to its signed bits."""
        half = 2 ** (bits - 1)
        return ((value + half) & (2 * half - 1)) - half


def _quadrant(x: Value, y: Value) -> Value:
    """Give the quadrant, 0 to 3, of a point as the start of a counter-clockwise arc."""
    first = less(0, x) & negate(less(y, 0))
    second = negate(less(0, x)) & less(0, y)
    third = less(x, 0) & negate(less(0, y))
    return where(first, 0, where(second, 1, where(third, 2, 3)))
