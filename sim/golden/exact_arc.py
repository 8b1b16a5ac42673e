"""Golden model of the exact arc interpolator, one clock at a time.

From the geometry alone. Seen from the centre in the quadrant of the moment, turned onto the first,
X falls and Y rises; F = X² + Y² − R² is what the point is off, R² being that of the start. While Y
leads (``second`` = 0) the candidates are (0, +1) and (−1, +1), then X leads and they are (−1, 0)
and (−1, +1). The sum of F at both candidates, 2E + 1, tells which is the nearer one::

    Y leads: E = F + 2Y − X + 1, the diagonal one if E ≥ 0
    X leads: E = F − 2X + Y + 1, the diagonal one if E < 0

and what a step adds to E is twice a number more 1: ``axial`` = Y + 1 or 1 − X, which grows by 1
with every step, or ``diagonal`` = Y − X + 2, which grows by 1 or, with a diagonal step, by 2.

Where the leading axis changes, and where an axis is crossed, one clock puts into ``axial`` and
``diagonal`` what the next step is to add to E, that step and the change together.

A state is a dict from register name to value; see ``registers``.
"""

from dataclasses import dataclass

from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["ExactArc"]

State = dict[str, Value]

RANGE, OFF_CURVE = 1, 2
FULL_TURNS_BITS, TURNS_BITS = 8, 11

#: What ``mode`` says a clock is for: a step; the step that changes the octant or crosses the axis;
#: the clock before that, in which ``axial`` and ``diagonal`` are prepared.
STEP, CHANGE, OCTANT_NEXT, AXIS_NEXT = range(4)

#: An end that lies farther back than this on an axis has been missed, in steps.
BACK = 4


@dataclass(frozen=True)
class ExactArc:
    """The exact arc interpolator of n = ``width`` bits.

    Attributes
    ----------
    width : int
        n, 4 to 32.
    """

    width: int = 16

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        n = self.width
        kinds: dict[str, tuple[int, bool]] = {"f": (n + 3, True)}
        kinds |= {"axial": (n + 2, True), "diagonal": (n + 2, True)}
        kinds |= {"mode": (2, False)}
        kinds |= dict.fromkeys(("second", "to_second", "odd"), (1, False))
        kinds |= {"turns": (TURNS_BITS, False)}
        kinds |= dict.fromkeys(("sole", "final", "unit"), (1, False))
        kinds |= dict.fromkeys(("lead", "negative_x", "negative_y"), (1, False))
        kinds |= dict.fromkeys(("kox", "koy"), (n + 2, True))
        kinds |= dict.fromkeys(("xk", "yk"), (n + 1, True))
        kinds |= dict.fromkeys(("near", "behind", "lost", "running", "loading", "done"), (1, False))
        kinds |= {"error": (2, False)}
        waits = ("waiting", "pulse_x", "pulse_y", "direction_x", "direction_y", "last")
        kinds |= dict.fromkeys(waits, (1, False))
        # What the clock of loading loads.
        kinds |= {"load_f": (n + 3, True), "load_axial": (n + 2, True)}
        kinds |= {"load_diagonal": (n + 2, True)} | self._ends("load")
        return kinds | self.prepared_registers()

    def prepared_registers(self) -> dict[str, tuple[int, bool]]:
        """Give those registers of them that prepare blocks, in three stages."""
        n = self.width
        kinds: dict[str, tuple[int, bool]] = {"held": (1, False), "coded": (1, False)}
        points = ("from_x", "from_y", "to_x", "to_y")
        kinds |= dict.fromkeys(points, (n + 2, True)) | self._ends("first")
        kinds |= {"clockwise": (1, False), "full_turns": (FULL_TURNS_BITS, False)}
        kinds |= dict.fromkeys(("quadrant", "end_quadrant"), (2, False))
        flags = ("minus_x", "minus_y", "too_far", "at_center", "to_center")
        kinds |= dict.fromkeys(flags, (1, False))
        for stage in ("seen", "ready"):
            kinds |= {f"{stage}_held": (1, False), f"{stage}_fault": (2, False)}
            names = ("empty", "swap", "negative_x", "negative_y")
            kinds |= {f"{stage}_{name}": (1, False) for name in names}
            kinds |= {f"{stage}_turns": (TURNS_BITS, False)} | self._ends(stage)
            kinds |= {f"{stage}_x": (n + 1, True), f"{stage}_y": (n, False)}
        kinds |= {"ready_diagonal": (n + 2, True), "ready_unit": (1, False)}
        return kinds | {"seen_round": (1, False)}

    def _ends(self, stage: str) -> dict[str, tuple[int, bool]]:
        """Give a stage's registers for the way to the end and the end."""
        kinds = {f"{stage}_past_{a}": (self.width + 2, True) for a in "xy"}
        return kinds | {f"{stage}_end_{a}": (self.width + 1, True) for a in "xy"}

    def reset(self) -> State:
        """Give the state after reset."""
        return dict.fromkeys(self.registers(), 0) | {"axial": 1}

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        out = {
            "blocks_ready": negate(state["held"]) | (state["coded"] & negate(state["seen_held"])),
            "steps_valid": state["waiting"],
            "steps_last": state["last"],
            "busy": state["held"]
            | state["seen_held"]
            | state["ready_held"]
            | state["loading"]
            | state["running"]
            | state["waiting"],
            "done": state["done"],
            "error": state["error"],
        }
        for a in "xy":
            # KOX is how far the steps taken lead past the end.
            position = state[f"{a}k"] + state[f"ko{a}"]
            out[f"position_{a}"] = self._signed(position, self.width + 1)
            out[f"steps_{a}"] = _move(state[f"pulse_{a}"], state[f"direction_{a}"])
        return out

    def step(self, state: State, inputs: dict[str, Value]) -> State:
        """Give the state after one clock.

        ``inputs``: ``blocks_valid``, ``blocks_start_x``, ``blocks_start_y``, ``blocks_end_x``,
        ``blocks_end_y``, ``blocks_center_x``, ``blocks_center_y``, ``blocks_clockwise``,
        ``blocks_full_turns``, ``steps_ready``.
        """
        waiting, running, near = (state[name] for name in ("waiting", "running", "near"))
        free = negate(waiting) | inputs["steps_ready"]
        still = state["ready_empty"] | negate(equal(state["ready_fault"], 0))
        idle = negate(running) & negate(state["loading"])
        # A block without a step lets the one before it be answered first: one answer a clock.
        may = where(still, idle & negate(waiting), (idle | (running & near)) & free)
        take = state["ready_held"] & may
        begin = take & negate(still)

        after = self._run(state, begin)
        missed = after.pop("missed")
        after = {name: where(free, value, state[name]) for name, value in after.items()}
        answered = waiting & inputs["steps_ready"] & state["last"]
        after["done"] = answered | (take & state["ready_empty"] & equal(state["ready_fault"], 0))
        refused = where(take, state["ready_fault"], 0)
        after["error"] = where(free & missed, OFF_CURVE, refused)
        return after | self._prepare(state, inputs, take)

    def _run(self, state: State, begin: Value) -> State:
        """One clock in which no step waits or the one that waits is taken."""
        loading, running, near = (state[name] for name in ("loading", "running", "near"))
        final, unit, second, lead = (state[name] for name in ("final", "unit", "second", "lead"))
        mode, axial = state["mode"], state["axial"]
        prepares = negate(less(mode, OCTANT_NEXT))
        changes = equal(mode, CHANGE)
        diagonal = negate(less(state["f"], 0))

        missed = running & state["lost"] & negate(near)
        runs = running & negate(missed)
        ends = (runs & near) | missed
        goes = runs & negate(near)
        steps = runs & (near | negate(prepares))
        quarter = unit & negate(final) & running
        turn = (changes & second) | quarter

        after = self._sums(state, ends)
        final_next = final | (turn & state["sole"])
        turns = (state["turns"] - turn) & (2**TURNS_BITS - 1)
        second_next = second ^ changes
        sums = [after.pop(name) for name in ("new_axial", "new_diagonal")]
        changing = goes & prepares
        goes_on = (loading | goes) & negate(changing)
        # Before the last piece no end is near.
        crosses_on = (loading | (running & negate(prepares))) & negate(final | unit)
        to_octant = goes_on & negate(second_next) & negate(less(sums[1], 0))
        to_axis = crosses_on & second_next & negate(less(sums[0], 0))
        # Never two of these: CHANGE, OCTANT_NEXT and AXIS_NEXT are 1, 2 and 3.
        after["mode"] = 2 * (to_octant | to_axis) + (changing | to_axis)
        after["second"] = second_next
        after["to_second"] = goes & equal(mode, OCTANT_NEXT)
        after["odd"] = state["diagonal"] & 1
        after["turns"] = turns
        after["sole"] = equal(turns, 1)
        after["final"] = final_next
        after["unit"] = unit
        after["lead"] = lead ^ (state["to_second"] | quarter)
        # What rose falls now: that axis which does not lead.
        after["negative_x"] = state["negative_x"] ^ (turn & lead)
        after["negative_y"] = state["negative_y"] ^ (turn & negate(lead))

        close: Value = 1
        for a, leads in (("x", negate(lead)), ("y", lead)):
            way = state[f"negative_{a}"]
            pulse = leads | diagonal
            here = state[f"ko{a}"] + _move(state[f"pulse_{a}"], state[f"direction_{a}"])
            rest = where(
                loading, state[f"load_past_{a}"], here + _move(negate(prepares) & pulse, way)
            )
            close = close & less(-2, rest) & less(rest, 2)
            after[f"ko{a}"] = where(
                loading, state[f"load_past_{a}"], self._signed(here, self.width + 2)
            )
            after[f"{a}k"] = where(loading, state[f"load_end_{a}"], state[f"{a}k"])
            after[f"pulse_{a}"] = steps & where(near, here & 1, pulse)
            after[f"direction_{a}"] = where(near, negate((here >> 1) & 1), way)
        after["near"] = (loading | goes) & final_next & close
        # No axis is left to cross, and X is 1 before this step or the end was behind.
        to_axis = second & negate(less(axial, 0))
        behind: Value = 0
        for a in "xy":
            past = state[f"ko{a}"]
            back = where(state[f"negative_{a}"], less(past, -BACK), less(BACK - 1, past))
            behind = behind | back
        after["behind"] = running & final & behind
        after["lost"] = goes & final & (to_axis | state["behind"])
        after["waiting"] = steps
        after["last"] = near
        after["running"] = loading | goes
        after["loading"] = begin
        return self._begin(state, after, begin) | {"missed": missed}

    def _sums(self, state: State, ends: Value) -> State:
        """E and what it grows by."""
        n = self.width
        mode, loading = state["mode"], state["loading"]
        f, axial, diagonal = state["f"], state["axial"], state["diagonal"]
        octant_next, axis_next = equal(mode, OCTANT_NEXT), equal(mode, AXIS_NEXT)
        changes = equal(mode, CHANGE)
        to_second = state["to_second"]
        goes_diagonal = negate(less(f, 0))

        # In octant 1 with Y − X = −2 or −1 the change adds E's own difference Y − X + 2 on the
        # axial step. On the axis itself the diagonal step adds 1.
        by = where(changes, diagonal, where(octant_next, -1, where(axis_next, ~diagonal, axial)))
        more = where(to_second, goes_diagonal, negate(loading))
        new_axial = by + (state["load_axial"] | axis_next) + more
        by = where(changes, axial, where(octant_next, ~axial, where(axis_next, -1, diagonal)))
        # Axial is 0 where the octant changes.
        low = where(to_second, state["odd"], (by | state["load_diagonal"]) & 1)
        by = by - (by & 1) + low + state["load_diagonal"] - (state["load_diagonal"] & 1)
        turned = goes_diagonal ^ (changes & negate(to_second))
        more = where(octant_next, diagonal & 1, negate(axis_next) & turned)
        new_diagonal = by + more + 1

        # Twice a number and 1 or, with the change of the octant, what makes it Y − X + 2.
        low = f & 1
        extra = where(to_second, goes_diagonal + state["odd"], 1)
        carry = (low + extra) >> 1
        half = (f >> 1) + (where(goes_diagonal, diagonal, axial) | (state["load_f"] >> 1)) + carry
        # The sign of E is kept the other way round while X leads: diagonal is f ≥ 0 in both.
        half = half + where(changes, 2 ** (n + 1), 0)
        new_low = where(loading, state["load_f"] & 1, (low + extra) & 1)
        new_f = 2 * self._signed(half, n + 2) + new_low

        new_axial = self._signed(new_axial, n + 2)
        new_diagonal = self._signed(new_diagonal, n + 2)
        # Of radius 1 a quarter is one step: (1, 0) is where it begins and, turned, where it ends.
        frozen = state["unit"] & negate(state["final"])
        keeps = negate(loading | (state["running"] & negate(frozen)))
        prepares = octant_next | axis_next
        return {
            "f": where(keeps, f, where(ends, 0, where(prepares, f, new_f))),
            "axial": where(keeps, axial, where(ends, 1, new_axial)),
            "diagonal": where(keeps, diagonal, where(ends, 0, new_diagonal)),
            "new_axial": new_axial,
            "new_diagonal": new_diagonal,
        }

    def _begin(self, state: State, after: State, begin: Value) -> State:
        """Take over the prepared block."""
        n = self.width
        x, y, diagonal = state["ready_x"], state["ready_y"], state["ready_diagonal"]
        second = negate(less(diagonal, 0)) | state["ready_unit"]
        axial = where(second, x, y)
        f = diagonal + axial + 1 + where(second, 2 ** (n + 2), 0)
        begun = {
            "second": second,
            # In octant 1 Y leads, and Y is the machine's y unless they are exchanged.
            "lead": negate(state["ready_swap"]) ^ second,
            "turns": state["ready_turns"],
            "sole": equal(state["ready_turns"], 1),
            "final": equal(state["ready_turns"], 0),
            **{name: state[f"ready_{name}"] for name in ("negative_x", "negative_y", "unit")},
        }
        after |= {name: where(begin, value, after[name]) for name, value in begun.items()}
        after["load_f"] = where(begin, self._signed(f, n + 3), 0)
        after["load_axial"] = where(begin, axial, 0)
        after["load_diagonal"] = where(begin, diagonal, 0)
        for name in self._ends("load"):
            after[name] = state[name.replace("load", "ready")]
        return after

    def _prepare(self, state: State, inputs: dict[str, Value], take: Value) -> State:
        """The three stages of preparation; a block goes on when the stage after it is empty."""
        accept = inputs["blocks_valid"] & self.outputs(state)["blocks_ready"]
        leave = state["coded"] & negate(state["seen_held"])
        follow = state["seen_held"] & negate(state["ready_held"])
        after = {
            "held": accept | (state["held"] & negate(leave)),
            "coded": (state["held"] & negate(state["coded"])) | (state["coded"] & negate(leave)),
            "seen_held": leave | (state["seen_held"] & negate(follow)),
            "ready_held": follow | (state["ready_held"] & negate(take)),
        }
        received = self._receive(inputs)
        after |= {name: where(accept, value, state[name]) for name, value in received.items()}
        coded, codes = state["held"] & negate(state["coded"]), self._code(state)
        after |= {name: where(coded, value, state[name]) for name, value in codes.items()}
        seen = self._see(state)
        after |= {name: where(leave, value, state[name]) for name, value in seen.items()}
        names = [name for name in self.prepared_registers() if name.startswith("ready_")]
        ready = {name: state[name.replace("ready", "seen")] for name in names[1:-2]}
        turns = state["seen_turns"] + 4 * state["seen_round"]
        ready["ready_turns"] = turns & (2**TURNS_BITS - 1)
        ready["ready_diagonal"] = state["seen_y"] + state["seen_x"]
        ready["ready_unit"] = equal(state["seen_x"], -1) & equal(state["seen_y"], 0)
        return after | {name: where(follow, value, state[name]) for name, value in ready.items()}

    def _receive(self, inputs: dict[str, Value]) -> State:
        """Stage 1: the differences."""
        received: State = {}
        for a in "xy":
            start, end, center = (inputs[f"blocks_{p}_{a}"] for p in ("start", "end", "center"))
            # The end's is complemented, so that it is subtracted without inverters.
            received |= {f"from_{a}": start - center, f"to_{a}": ~(end - center)}
            received[f"first_end_{a}"] = end
        received["clockwise"] = inputs["blocks_clockwise"]
        return received | {"full_turns": inputs["blocks_full_turns"]}

    def _code(self, state: State) -> State:
        """Stage 1, a clock later: quadrants, signs, and what is to be refused."""
        n = self.width
        clockwise = state["clockwise"]
        zero: State = {}
        too_far: Value = 0
        quadrants: list[Value] = []
        for point in ("from", "to"):
            x, y = (state[f"{point}_{a}"] for a in "xy")
            if point == "to":
                x, y = ~x, ~y
            zero[point] = equal(x, 0) & equal(y, 0)
            y = where(clockwise, 0 - y, y)
            # A start belongs to the quadrant after the axis it is on, an end to the one before:
            # quadrant I holds the positive x axis for a start, the positive y axis for an end.
            if point == "from":
                quadrants.append(_quadrant(x, y))
            else:
                quadrants.append(3 - _quadrant(x, 0 - y))
            for value in (x, y):
                too_far = too_far | less(2**n - 1, value) | less(value, 1 - 2**n)
        swap = quadrants[0] & 1
        minus = {a: less(state[f"from_{a}"], 0) for a in "xy"}
        return {
            "quadrant": quadrants[0],
            "end_quadrant": quadrants[1],
            "minus_x": where(swap, minus["y"], minus["x"]),
            "minus_y": where(swap, minus["x"], minus["y"]),
            **{f"first_past_{a}": self._past(state, a) for a in "xy"},
            "too_far": too_far,
            "at_center": zero["from"],
            "to_center": zero["to"],
        }

    def _past(self, state: State, a: str) -> Value:
        """Give how far the start is past the end."""
        return self._signed(state[f"from_{a}"] + state[f"to_{a}"] + 1, self.width + 2)

    def _see(self, state: State) -> State:
        """Stage 2: the start in its quadrant, and how many axes are crossed."""
        clockwise = state["clockwise"]
        first = state["quadrant"]
        swap = first & 1
        # In quadrants I and II x falls; in II and III y does, the other way when mirrored.
        negative = {"x": less(first, 2), "y": equal((first + 1) >> 1, 1) ^ clockwise}
        ahead: Value = 1
        still = {a: equal(state[f"first_past_{a}"], 0) for a in "xy"}
        for a in "xy":
            wrong = equal(less(state[f"first_past_{a}"], 0), negative[a])
            ahead = ahead & (still[a] | negate(wrong))
        ahead = ahead & negate(still["x"] & still["y"])
        crossings = (state["end_quadrant"] - first) & 3
        round_ = equal(crossings, 0) & negate(ahead)
        x, y = (where(swap, state[f"from_{b}"], state[f"from_{a}"]) for a, b in ("xy", "yx"))
        off = where(state["at_center"] & negate(state["to_center"]), OFF_CURVE, 0)
        seen = {
            "fault": where(state["too_far"], RANGE, off),
            "empty": state["at_center"] & state["to_center"],
            "swap": swap,
            "negative_x": negative["x"],
            "negative_y": negative["y"],
            "turns": 4 * state["full_turns"] + crossings,
            "round": round_,
            "x": self._signed(where(state["minus_x"], x, 0 - x), self.width + 1),
            "y": where(state["minus_y"], 0 - y, y) & (2**self.width - 1),
            **{name[6:]: state[name] for name in self._ends("first")},
        }
        return {f"seen_{name}": value for name, value in seen.items()}

    def _signed(self, value: Value, bits: int) -> Value:
        """Take the low bits of a value as a signed number."""
        return ((value + 2 ** (bits - 1)) & (2**bits - 1)) - 2 ** (bits - 1)


def _move(pulse: Value, negative: Value) -> Value:
    """Give −1, 0 or +1."""
    return where(pulse, where(negative, -1, 1), 0)


def _quadrant(x: Value, y: Value) -> Value:
    """Give the quadrant, 0 to 3, counter-clockwise; an axis belongs to the one after it."""
    right, left = less(0, x), less(x, 0)
    above, below = less(0, y), less(y, 0)
    second = negate(right) & above
    third = left & negate(above)
    return where(right & negate(below), 0, where(second, 1, where(third, 2, 3)))
