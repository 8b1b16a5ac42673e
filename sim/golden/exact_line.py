"""Golden model of the exact line interpolator, one clock at a time.

The leading axis, the one with the longest way L, moves with every step; after k steps every axis is
at the point of the grid that is nearest to the line, ⌊k·Δ/L + ½⌋ from the start. Blocks come and
steps leave by the handshakes of the contract common to all interpolators.

A state is a dict from register name to value. An axis that follows the leading one has the residual
E = Δ·(k + 1) − L·(y + ½) of its next step, rounded, with the sign of Δ: it steps when E has the
sign of Δ, then E grows by ``loss`` = Δ ∓ L, else by ``gain`` = Δ. One of the two decisions comes
more often, that of the first step (``often``), with E of the sign ``first``; the other one never
twice in a row. So the registers are one step ahead: ``total`` is what E becomes if this step is one
of the frequent kind, ``addend`` what the kind it is adds; ``rest`` brings the first E. In the plane
only the axis that does not lead has them; with more axes every one has, behind its letter.

A block goes from ``start_``, ``delta_`` (``pending``, then ``weighed``) through, in the plane,
``way_`` (``chosen``), to ``ready_`` (``prepared``; there is ``room`` for it when none is held), and
is then ``loaded``, ``starting`` and ``running``. A step is ``decided`` (``moves_``, ``falls_``) and
then waits for its taker in ``pulse_`` and ``down_``. P3, P4 hold the position, ``move_`` what is
added to it next, or its new start. P5 counts the steps up to 0, the last one, and rests at 1.
"""

from collections.abc import Callable
from dataclasses import dataclass

from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["ExactLine", "State"]

State = dict[str, Value]
#: Gives a register that stands still while a step waits what it goes on to.
Goes = Callable[[str, Value], None]


@dataclass(frozen=True)
class ExactLine:
    """The exact line interpolator of n = ``width`` bits in ``axes`` axes.

    Attributes
    ----------
    width : int
        n, 4 to 32.
    axes : int
        2 to 6.
    """

    width: int = 16
    axes: int = 2

    @property
    def letters(self) -> str:
        """The axis letters."""
        return "xyzabc"[: self.axes]

    @property
    def followers(self) -> tuple[str, ...]:
        """What stands behind the names of the registers of every follower."""
        return ("",) if self.axes == 2 else tuple(f"_{a}" for a in self.letters)

    def place(self, a: str) -> str:
        """Name an axis's position."""
        return f"{a}t" if self.axes > 2 else {"x": "p3", "y": "p4"}[a]

    @property
    def left(self) -> str:
        """Name the steps left."""
        return "ko" if self.axes > 2 else "p5"

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        wide, bit = (self.width + 1, True), (1, False)
        kinds: dict[str, tuple[int, bool]] = {self.left: wide}
        for a in self.letters:
            kinds |= {self.place(a): wide, f"pulse_{a}": bit, f"direction_{a}": bit}
            kinds[f"down_{a}"] = bit
            kinds |= {f"start_{a}": wide, f"delta_{a}": wide, f"beyond_{a}": bit}
            kinds |= {f"ready_start_{a}": wide, f"ready_negative_{a}": bit}
            kinds |= {f"begin_{a}": wide, f"negative_{a}": bit}
            kinds |= {f"move_{a}": wide, f"moves_{a}": bit, f"falls_{a}": bit}
        for f in self.followers:
            kinds |= dict.fromkeys((f"gain{f}", f"loss{f}", f"total{f}", f"addend{f}"), wide)
            kinds[f"rest{f}"] = wide
            kinds |= dict.fromkeys((f"often{f}", f"first{f}", f"rare{f}"), bit)
            kinds |= dict.fromkeys((f"ready_gain{f}", f"ready_loss{f}", f"ready_rest{f}"), wide)
        flags = ("open", "pending", "weighed", "room", "prepared", "refused", "ready_fault")
        flags += ("works", "loaded", "starting", "running", "decided", "final")
        flags += ("waiting", "last", "done", "error")
        kinds |= dict.fromkeys(flags, bit)
        if self.axes == 2:
            kinds |= {"way_lead": wide, "way_follow": wide, "ready_lead": wide}
            kinds |= {f"way_start_{a}": wide for a in self.letters}
            kinds |= {f"way_negative_{a}": bit for a in self.letters}
            flags = ("chosen", "sum_down", "difference_down", "way_follow_x", "way_same")
            flags += ("way_fault", "ready_follow_x", "follow_x", "follows_x")
            flags += ("bare_x", "bare_y", "way_bare", "more")
            kinds |= dict.fromkeys(flags, bit)
        else:
            kinds |= {"axis": (3, False), "reach": (self.width + 1, False)}
            kinds |= {"ready_lead": wide}
        return kinds

    def reset(self) -> State:
        """Give the state after reset."""
        return dict.fromkeys(self.registers(), 0) | dict.fromkeys(("open", "room", self.left), 1)

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        busy = state["works"]
        stages = ("pending", "prepared", "refused", "decided", "waiting")
        for name in (*stages, *(("chosen",) if self.axes == 2 else ())):
            busy = busy | state[name]
        out = {
            "blocks_ready": state["open"],
            "steps_valid": state["waiting"],
            "steps_last": state["last"],
            "busy": busy,
            "done": state["done"],
            "error": state["error"],
        }
        for a in self.letters:
            out[f"steps_{a}"] = self._step(state, a)
            out[f"position_{a}"] = state[self.place(a)]
        return out

    def step(self, state: State, inputs: dict[str, Value]) -> State:
        """Give the state after one clock.

        ``inputs``: ``blocks_valid``, ``blocks_start_x``…, ``blocks_end_x``…, ``steps_ready``.
        """
        ready, waiting = inputs["steps_ready"], state["waiting"]
        # The next block is loaded when the last step of the one before is decided.
        go = negate(waiting) | ready
        rests = negate(less(state[self.left], 0))
        ends = state["running"] & rests
        goes_on = state["loaded"] | (state["running"] & negate(ends))
        load = state["prepared"] & rests
        answer = state["refused"] & negate(state["works"] | state["decided"] | waiting)
        room = state["room"]

        leaves = self._leaves(state) if self.axes == 2 else state["weighed"] & room
        after = self._accepted(state, inputs, leaves, room)
        if self.axes == 2:
            after |= self._chosen(state, room)
            takes = state["chosen"] & room
        else:
            after |= self._weighed(state, leaves)
            takes = leaves
        values = self._prepared(state)
        refused = values.pop("refused")
        after |= {name: where(room, value, state[name]) for name, value in values.items()}
        after["prepared"] = (takes & negate(refused)) | (state["prepared"] & negate(load & go))
        after["refused"] = (takes & refused) | (state["refused"] & negate(answer))
        after["room"] = negate(after["prepared"] | after["refused"])

        def goes(name: str, value: Value) -> None:
            """A register that stands still while a step waits."""
            after[name] = where(go, value, state[name])

        goes("works", load | goes_on)
        goes("loaded", load)
        goes("starting", state["loaded"])
        goes("running", goes_on)
        goes("decided", state["running"])
        goes("final", ends)
        goes("waiting", state["decided"])
        goes("last", state["final"])
        after["done"] = (waiting & ready & state["last"]) | (answer & negate(state["ready_fault"]))
        after["error"] = answer & state["ready_fault"]
        carried = {f"negative_{a}": f"ready_negative_{a}" for a in self.letters}
        carried |= {f"begin_{a}": f"ready_start_{a}" for a in self.letters}
        carried |= {"follow_x": "ready_follow_x"} if self.axes == 2 else {}
        for own, prepared in carried.items():
            # Without a block prepared it is not looked at.
            goes(own, where(rests, state[prepared], state[own]))

        # 1 when a block is loaded: what that makes of it then is no sum.
        count, down = self._count(state)
        more = state["more"] if self.axes == 2 else state["loaded"]
        counted = self._wrap(state[self.left] + state["works"] + more)
        goes(self.left, counted ^ where(load, count ^ 1, 0))
        if self.axes == 2:
            goes("more", load & negate(down))
        moves = {}
        for f in self.followers:
            moves[f] = self._follow(state, f, rests, goes)
        for a in self.letters:
            if self.axes == 2:
                follows = state["follows_x"] if a == "x" else negate(state["follows_x"])
                pulse = where(follows, moves[""], 1)
            else:
                pulse = moves[f"_{a}"]
            pulse = state["running"] & pulse
            direction = state[f"direction_{a}"]
            goes(f"moves_{a}", pulse)
            goes(f"falls_{a}", pulse & direction)
            goes(f"pulse_{a}", state[f"moves_{a}"])
            goes(f"down_{a}", state[f"falls_{a}"])
            goes(f"direction_{a}", where(state["loaded"], state[f"negative_{a}"], direction))
            # A step that waits is taken; where none does it is 0.
            move, step = state[f"move_{a}"], state[f"moves_{a}"] - 2 * state[f"falls_{a}"]
            goes(f"move_{a}", where(state["loaded"], state[f"begin_{a}"], step))
            moved = self._wrap(state[self.place(a)] + move)
            goes(self.place(a), where(state["starting"], move, moved))
        if self.axes == 2:
            follows = where(state["loaded"], state["follow_x"], state["follows_x"])
            goes("follows_x", follows)
        return after

    def _follow(self, state: State, f: str, rests: Value, goes: Goes) -> Value:
        """Go on with a follower, and tell whether it moves with the step that is decided."""
        own = {
            name: state[name + f]
            for name in ("gain", "loss", "total", "addend", "often", "first", "rare")
        }
        rest = state[f"ready_rest{f}"]
        # The rare decision: the sign is another one than at first. It never comes twice in a row,
        # nor before the second step.
        rare = negate(own["rare"]) & (less(own["total"], 0) ^ own["first"])
        moves = rare ^ own["often"]
        chosen = where(moves, own["loss"], own["gain"])
        # A block's first residual comes to a total and an addend of 0.
        total = self._wrap(own["total"] + own["addend"]) ^ state[f"rest{f}"]
        goes(f"addend{f}", where(rests, 0, chosen))
        goes(f"total{f}", where(rests, 0, total))
        goes(f"rest{f}", where(rests, rest, 0))
        goes(f"rare{f}", rare | rests | state["loaded"])
        upwards = negate(less(state[f"ready_gain{f}"], 0))
        goes(f"often{f}", where(rests, less(rest, 0) ^ upwards, own["often"]))
        goes(f"first{f}", where(rests, less(rest, 0), own["first"]))
        goes(f"gain{f}", where(rests, state[f"ready_gain{f}"], own["gain"]))
        goes(f"loss{f}", where(rests, state[f"ready_loss{f}"], own["loss"]))
        return moves

    def _accepted(
        self, state: State, inputs: dict[str, Value], leaves: Value, room: Value
    ) -> State:
        """Take in a block: its ways, and whether they fit."""
        after: State = {}
        accept = inputs["blocks_valid"] & state["open"]
        for a in self.letters:
            begin = inputs[f"blocks_start_{a}"]
            delta = inputs[f"blocks_end_{a}"] - begin
            # The sign that its n + 1 bits may lose.
            beyond = less(delta, 0)
            after[f"beyond_{a}"] = where(accept, beyond, state[f"beyond_{a}"])
            after[f"start_{a}"] = where(accept, begin, state[f"start_{a}"])
            after[f"delta_{a}"] = where(accept, self._wrap(delta), state[f"delta_{a}"])
        stays = state["pending"] & negate(leaves)
        after["pending"] = accept | stays
        after["open"] = negate(accept | stays)
        if self.axes == 2:
            # It leaves in its second clock if there is room then.
            held = state["chosen"] & negate(room)
            after["open"] = after["open"] | (negate(accept) & stays & negate(held))
            x, y = state["delta_x"], state["delta_y"]
            after |= {"sum_down": less(x + y, 0), "difference_down": less(x - y, 0)}
            after["weighed"] = stays
            for a in "xy":
                # All bits but the sign are 0: no way, or one too long.
                after[f"bare_{a}"] = equal(state[f"delta_{a}"] & (2**self.width - 1), 0)
        return after

    def _weighed(self, state: State, leaves: Value) -> State:
        """Compare the ways of more than two axes, one a clock."""
        going = state["pending"] & negate(state["weighed"])
        longest = state["reach"]
        for number, a in enumerate(self.letters):
            length = self._length(state[f"delta_{a}"])
            longer = equal(state["axis"], number) & less(state["reach"], length)
            longest = where(longer, length, longest)
        last = equal(state["axis"], self.axes - 1)
        return {
            "reach": where(going, longest, where(leaves, 0, state["reach"])),
            "axis": where(going & negate(last), (state["axis"] + 1) & 7, 0),
            "weighed": (going & last) | (state["weighed"] & negate(leaves)),
        }

    def _chosen(self, state: State, room: Value) -> State:
        """Pass a block of the plane on, its axes as leader and follower."""
        x, y = state["delta_x"], state["delta_y"]
        same = equal(less(x, 0), less(y, 0))
        # Of equal ways that of x leads, unless it goes downwards.
        beyond = where(same, state["difference_down"], state["sum_down"])
        follow_x = where(less(x, 0), negate(beyond), beyond)
        follow, lead = where(follow_x, x, y), where(follow_x, y, x)
        values = {
            "way_follow": follow,
            # Its bits are turned over where both go the same way.
            "way_lead": where(same, -1 - lead, lead),
            "way_follow_x": follow_x,
            "way_same": same,
            "way_fault": self._too_long(state),
            "way_bare": where(follow_x, state["bare_y"], state["bare_x"]),
        }
        for a in self.letters:
            values[f"way_start_{a}"] = state[f"start_{a}"]
            values[f"way_negative_{a}"] = less(state[f"delta_{a}"], 0)
        empty = negate(state["chosen"])
        after = {name: where(empty, value, state[name]) for name, value in values.items()}
        after["chosen"] = self._leaves(state) | (state["chosen"] & negate(room))
        return after

    def _prepared(self, state: State) -> State:
        """Work out the two addends and the first residual of every follower; tell of a fault."""
        values: dict[str, Value] = {}
        if self.axes == 2:
            same = state["way_same"]
            against = state["way_lead"] + same
            ways = {"": (state["way_follow"], against)}
            values |= {"ready_lead": state["way_lead"], "ready_follow_x": state["way_follow_x"]}
            # No way at all, or −2^n: only the sign tells.
            bare = state["way_bare"]
            fault = state["way_fault"] | (bare & (less(state["way_lead"], 0) ^ same))
            values["refused"] = fault | bare
            for a in self.letters:
                values[f"ready_start_{a}"] = state[f"way_start_{a}"]
                values[f"ready_negative_{a}"] = state[f"way_negative_{a}"]
        else:
            length = state["reach"]
            ways = {}
            for a in self.letters:
                delta = state[f"delta_{a}"]
                ways[f"_{a}"] = (delta, where(less(delta, 0), length, 0 - length))
                values[f"ready_start_{a}"] = state[f"start_{a}"]
                values[f"ready_negative_{a}"] = less(delta, 0)
            values["ready_lead"] = self._wrap(length)
            fault = self._too_long(state) | negate(less(length, 2**self.width))
            values["refused"] = fault | equal(length, 0)
        for f, (way, against) in ways.items():
            values[f"ready_gain{f}"] = way
            values[f"ready_loss{f}"] = self._wrap(way + against)
            values[f"ready_rest{f}"] = self._wrap(way + (against >> 1))
        values["ready_fault"] = fault
        return values

    def _count(self, state: State) -> tuple[Value, Value]:
        """Give what the steps left are loaded with, and whether that is one more than usual."""
        lead = state["ready_lead"]
        # −1 less the length; or, where the leader of the plane goes downwards, less the length.
        count = where(less(lead, 0), lead, -1 - lead)
        if self.axes > 2:
            return count, 0
        x, y = (state[f"ready_negative_{a}"] for a in "xy")
        return count, where(state["ready_follow_x"], y, x)

    def _leaves(self, state: State) -> Value:
        """Tell whether the block of the plane that came last leaves its place."""
        return state["weighed"] & negate(state["chosen"])

    def _step(self, state: State, a: str) -> Value:
        """Give the step of an axis that waits."""
        return state[f"pulse_{a}"] - 2 * state[f"down_{a}"]

    def _too_long(self, state: State) -> Value:
        """Tell whether a way of the block that came last does not fit n + 1 bits."""
        fault: Value = 0
        for a in self.letters:
            fault = fault | (state[f"beyond_{a}"] ^ less(state[f"delta_{a}"], 0))
        return fault

    def _length(self, way: Value) -> Value:
        return where(less(way, 0), 0 - way, way)

    def _wrap(self, value: Value) -> Value:
        """Keep a signed number to its n + 1 bits."""
        half = 2**self.width
        return ((value + half) & (2 * half - 1)) - half
