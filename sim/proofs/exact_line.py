"""Promises of the exact line interpolator, proven for every block at a given width.

They are shown of the golden model's own source, which the device is proven equal to. An invariant
holds after reset and survives every clock from every state that satisfies it, whatever the inputs;
the promises follow. Ghost values remember what the registers forget:

- ``end_``: where the block in each stage ends, by the stage's name (``in``, ``way``, ``ready``,
  ``next``: loaded or running, ``out``: with steps to be taken), and where it begins, ``begin_``;
- of the block that runs: ``L``, the length of the leading axis; ``first``, the first residual of a
  follower; ``k``, the steps that have been decided; ``count``, those of them that move an axis;
- of the block with steps to be taken: ``L out``; ``k out`` and ``out``, the same of those that have
  begun to wait;
- ``f`` = k·Δ − count·(± L) of a follower, which is L times the way by which it is beside the line.

What that amounts to in numbers is shown of integers.
"""

import z3

from discreta.sim.golden.exact_line import ExactLine
from discreta.sim.golden.logic import Value
from discreta.sim.smt import Obligation, same, symbols

__all__ = ["promises"]

#: The stages that a block goes through.
STAGES = ("in", "way", "ready", "next", "out")


def promises(golden: ExactLine) -> list[Obligation]:
    """Give everything that is promised of the exact line interpolator."""
    return _Clock(golden).obligations() + _numbers(golden)


class _Clock:
    """One clock: state and inputs, the state after it, and the ghosts of both."""

    def __init__(self, golden: ExactLine):
        self.golden = golden
        self.letters, self.followers = golden.letters, golden.followers
        n = golden.width
        self.top = 2**n
        wide = n + 6
        self.wide = wide
        coordinate = (n + 1, True)
        ports: dict[str, tuple[int, bool]]
        ports = {f"blocks_{p}_{a}": coordinate for p in ("start", "end") for a in self.letters}
        ports |= dict.fromkeys(("blocks_valid", "steps_ready"), (1, False))
        self.state = symbols(golden.registers(), wide)
        self.inputs = symbols(ports, wide)
        ghosts = {
            f"{p}_{stage}_{a}": coordinate
            for stage in STAGES
            for p in ("begin", "end")
            for a in self.letters
        }
        ghosts |= dict.fromkeys(("L", "k", "L out", "k out"), (n + 1, False))
        ghosts |= {f"first{f}": coordinate for f in self.followers}
        ghosts |= {f"f{f}": (n + 3, True) for f in self.followers}
        ghosts |= {f"{k}_{a}": (n + 1, False) for a in self.letters for k in ("count", "out")}
        named = symbols({f"ghost.{name}": kind for name, kind in ghosts.items()}, wide)
        self.ghosts = {name.removeprefix("ghost."): value for name, value in named.items()}

        self.out = golden.outputs(self.state)
        self.after = golden.step(self.state, self.inputs)
        self.later = golden.outputs(self.after)
        state = self.state
        self.waiting = state["waiting"] == 1
        self.taken = z3.And(self.waiting, self.inputs["steps_ready"] == 1)
        self.go = z3.Or(z3.Not(self.waiting), self.taken)
        self.accept = z3.And(self.inputs["blocks_valid"] == 1, self.out["blocks_ready"] == 1)
        self.ends = z3.And(state["running"] == 1, state[golden.left] >= 0)
        idle = z3.And([state[name] == 0 for name in ("works", "decided", "waiting")])
        self.load = z3.And(state["prepared"] == 1, z3.Or(state["works"] == 0, self.ends), self.go)
        self.answer = z3.And(state["refused"] == 1, idle)
        self.begins = z3.And(state["loaded"] == 1, self.go)
        self.places = z3.And(state["starting"] == 1, self.go)
        self.counts = z3.And(state["decided"] == 1, self.go)
        self.enters = z3.And(state["running"] == 1, self.go)
        self.ghosts_after = self.remembered()

    def same_place(self, a: Value, b: Value) -> z3.BoolRef:
        """State that two coordinates are the same in the n + 1 bits of a coordinate."""
        bits = self.golden.width
        return z3.Extract(bits, 0, a) == z3.Extract(bits, 0, b)

    def delta(self, ghosts: dict, stage: str, a: str) -> Value:
        """Give the way of an axis of the block in a stage."""
        return ghosts[f"end_{stage}_{a}"] - ghosts[f"begin_{stage}_{a}"]

    def leader(self, ghosts: dict, stage: str, follow_x: Value) -> tuple[Value, Value]:
        """Give the ways of leader and follower of the plane."""
        x, y = (self.delta(ghosts, stage, a) for a in "xy")
        return z3.If(follow_x == 1, y, x), z3.If(follow_x == 1, x, y)

    def ways(self, ghosts: dict, stage: str, follow_x: Value) -> dict[str, Value]:
        """Give the way of every follower."""
        if self.golden.axes == 2:
            return {"": self.leader(ghosts, stage, follow_x)[1]}
        return {f"_{a}": self.delta(ghosts, stage, a) for a in self.letters}

    def moved(self) -> dict[str, z3.BoolRef]:
        """Tell which axes the step moves that is decided."""
        return {a: self.after[f"moves_{a}"] == 1 for a in self.letters}

    def steps(self) -> dict[str, z3.BoolRef]:
        """Tell which followers the step moves that is decided."""
        moved = self.moved()
        if self.golden.axes == 2:
            return {"": z3.If(self.state["follows_x"] == 1, moved["x"], moved["y"])}
        return {f"_{a}": moved[a] for a in self.letters}

    def added(self, f: str) -> Value:
        """Give what a step adds to a follower's residual."""
        return z3.If(self.steps()[f], self.state[f"loss{f}"], self.state[f"gain{f}"])

    def remembered(self) -> dict[str, Value]:
        """Give the ghosts after the clock."""
        state, ghosts = self.state, self.ghosts
        plane = self.golden.axes == 2
        leaves = z3.And(state["weighed"] == 1, state["chosen"] == 0) if plane else False
        room = state["room"] == 1
        takes = z3.And((state["chosen"] if plane else state["weighed"]) == 1, room)
        after: dict[str, Value] = {}
        for a in self.letters:
            for p in ("begin", "end"):
                port = self.inputs[f"blocks_{'start' if p == 'begin' else 'end'}_{a}"]
                at = {stage: ghosts[f"{p}_{stage}_{a}"] for stage in STAGES}
                after |= {
                    f"{p}_in_{a}": z3.If(self.accept, port, at["in"]),
                    f"{p}_way_{a}": z3.If(leaves, at["in"], at["way"]),
                    f"{p}_ready_{a}": z3.If(takes, at["way" if plane else "in"], at["ready"]),
                    f"{p}_next_{a}": z3.If(self.load, at["ready"], at["next"]),
                    f"{p}_out_{a}": z3.If(self.places, at["next"], at["out"]),
                }
        after["L"] = z3.If(self.load, self.length(ghosts, "ready"), ghosts["L"])
        after["L out"] = z3.If(self.places, ghosts["L"], ghosts["L out"])
        more = z3.If(self.counts, ghosts["k out"] + 1, ghosts["k out"])
        after["k out"] = z3.If(self.places, 0, more)
        after["k"] = z3.If(self.begins, 0, z3.If(self.enters, ghosts["k"] + 1, ghosts["k"]))
        moved = self.moved()
        for a in self.letters:
            more = z3.If(
                z3.And(self.enters, moved[a]), ghosts[f"count_{a}"] + 1, ghosts[f"count_{a}"]
            )
            after[f"count_{a}"] = z3.If(self.begins, 0, more)
            more = z3.If(self.counts, state[f"moves_{a}"], z3.BitVecVal(0, self.wide))
            after[f"out_{a}"] = z3.If(self.places, 0, ghosts[f"out_{a}"] + more)
        for f in self.followers:
            after[f"first{f}"] = z3.If(self.load, state[f"ready_rest{f}"], ghosts[f"first{f}"])
            grown = ghosts[f"f{f}"] + self.added(f)
            after[f"f{f}"] = z3.If(self.begins, 0, z3.If(self.enters, grown, ghosts[f"f{f}"]))
        return after

    def working(self, state: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of the flags that say what goes on."""
        runs = z3.Or(state["loaded"] == 1, state["running"] == 1)
        running, starting, decided = (state[name] for name in ("running", "starting", "decided"))
        more = state["more"] if self.golden.axes == 2 else state["loaded"]
        left = state[self.golden.left]
        return {
            "one at a time": z3.And(
                (state["works"] == 1) == runs,
                z3.Or(state["loaded"] == 0, running == 0),
                z3.Implies(starting == 1, z3.And(running == 1, decided == 0)),
                z3.Or(state["prepared"] == 0, state["refused"] == 0),
                (state["room"] == 1) == z3.And(state["prepared"] == 0, state["refused"] == 0),
            ),
            "more": z3.Implies(state["loaded"] == 0, more == 0),
            "rests": z3.And(
                z3.Implies(z3.Not(runs), left == 1),
                z3.Implies(running == 1, left <= 0),
                z3.Implies(state["loaded"] == 1, left + more < 0),
            ),
            "a step is decided": z3.Implies(running == 1, decided + starting == 1),
        }

    def groups(self, state: dict, ghosts: dict) -> dict[str, dict[str, z3.BoolRef]]:
        """Give what is true in every clock by the stage of a block that it speaks of."""
        return {
            "what goes on": self.working(state),
            "blocks accepted": self.accepted(state, ghosts),
            "the block prepared": self.prepared(state, ghosts),
            "the block that runs": self.running(state, ghosts),
            "residual": self.residual(state, ghosts),
            "steps and position": self.waits(state, ghosts),
        }

    def invariant(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        facts: dict[str, z3.BoolRef] = {}
        for group in self.groups(state, ghosts).values():
            facts |= group
        return facts

    def too_long(self, ghosts: dict, stage: str, least: bool = True) -> z3.BoolRef:
        """State that a way of a block does not fit; ``least``: not even −2^n does."""
        return z3.Or(
            [
                z3.Or(
                    self.delta(ghosts, stage, a) >= self.top,
                    self.delta(ghosts, stage, a) < -self.top + least,
                )
                for a in self.letters
            ]
        )

    def accepted(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of the block that came last, and of the one chosen."""
        pending = state["pending"] == 1
        one = z3.BitVecVal(1, self.wide)
        fault = z3.Or(
            [state[f"beyond_{a}"] != z3.If(state[f"delta_{a}"] < 0, one, 0) for a in self.letters]
        )
        fits = z3.And(pending, z3.Not(fault))
        facts = {"fault": z3.Implies(pending, fault == self.too_long(ghosts, "in", False))}
        for a in self.letters:
            facts[f"accepted {a}"] = z3.Implies(
                pending, state[f"start_{a}"] == ghosts[f"begin_in_{a}"]
            )
            facts[f"way {a}"] = z3.Implies(fits, state[f"delta_{a}"] == self.delta(ghosts, "in", a))
        facts["weighed"] = z3.Implies(state["weighed"] == 1, pending)
        if self.golden.axes > 2:
            facts["weighing"] = z3.And(
                z3.Implies(state["weighed"] == 1, state["axis"] == 0),
                z3.Implies(z3.Not(pending), z3.And(state["axis"] == 0, state["reach"] == 0)),
                state["axis"] < self.golden.axes,
                z3.Implies(state["open"] == 1, z3.Not(pending)),
            )
            longest = z3.BitVecVal(0, self.wide)
            for number, a in enumerate(self.letters):
                length = _magnitude(self.delta(ghosts, "in", a))
                done = z3.Or(state["weighed"] == 1, state["axis"] > number)
                longest = z3.If(z3.And(done, length > longest), length, longest)
            facts["reach"] = z3.Implies(fits, state["reach"] == longest)
            return facts
        x, y = state["delta_x"], state["delta_y"]
        facts["compared"] = z3.Implies(
            state["weighed"] == 1,
            z3.And(
                (state["sum_down"] == 1) == (x + y < 0),
                (state["difference_down"] == 1) == (x - y < 0),
                *(
                    (state[f"bare_{a}"] == 1) == z3.Or(way == 0, way == -self.top)
                    for a, way in (("x", x), ("y", y))
                ),
            ),
        )
        facts["open"] = z3.Implies(
            state["open"] == 1,
            z3.Or(z3.Not(pending), z3.And(state["weighed"] == 1, state["chosen"] == 0)),
        )
        chosen = state["chosen"] == 1
        lead, follow = self.leader(ghosts, "way", state["way_follow_x"])
        alike = (lead < 0) == (follow < 0)
        facts["chosen fault"] = z3.Implies(
            chosen, (state["way_fault"] == 1) == self.too_long(ghosts, "way", False)
        )
        facts["chosen"] = z3.Implies(
            z3.And(chosen, state["way_fault"] == 0),
            z3.And(
                state["way_follow"] == follow,
                (state["way_same"] == 1) == alike,
                state["way_lead"] == z3.If(alike, -1 - lead, lead),
                (state["way_bare"] == 1) == z3.Or(lead == 0, lead == -self.top),
                _magnitude(follow) <= _magnitude(lead),
                *(
                    (state[f"way_negative_{a}"] == 1) == (self.delta(ghosts, "way", a) < 0)
                    for a in "xy"
                ),
            ),
        )
        for a in "xy":
            facts[f"chosen start {a}"] = z3.Implies(
                chosen, state[f"way_start_{a}"] == ghosts[f"begin_way_{a}"]
            )
        return facts

    def prepared(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of the block prepared."""
        ready = state["prepared"] == 1
        refused = state["refused"] == 1
        deltas = {a: self.delta(ghosts, "ready", a) for a in self.letters}
        follow_x = state["ready_follow_x"] if self.golden.axes == 2 else None
        facts = {
            "refused": z3.Implies(
                refused,
                z3.If(
                    state["ready_fault"] == 1,
                    self.too_long(ghosts, "ready"),
                    z3.And([delta == 0 for delta in deltas.values()]),
                ),
            ),
            "sound": z3.Implies(
                ready,
                z3.And(
                    z3.Not(self.too_long(ghosts, "ready")),
                    z3.Or([delta != 0 for delta in deltas.values()]),
                ),
            ),
        }
        for a, delta in deltas.items():
            facts[f"prepared {a}"] = z3.Implies(
                ready,
                z3.And(
                    state[f"ready_start_{a}"] == ghosts[f"begin_ready_{a}"],
                    (state[f"ready_negative_{a}"] == 1) == (delta < 0),
                ),
            )
        # In the plane that of the leader: ``shorter way`` says that it is the longest.
        plane = self.golden.axes == 2
        lead = self.leader(ghosts, "ready", follow_x)[0] if plane else None
        length = _magnitude(lead) if plane else self.length(ghosts, "ready")
        for f, way in self.ways(ghosts, "ready", follow_x).items():
            against = -_signed(way, length)
            facts |= {
                f"{name}{f}": z3.Implies(ready, fact)
                for name, fact in (
                    ("shorter way", _magnitude(way) <= length),
                    ("gain", state[f"ready_gain{f}"] == way),
                    # They fit: a way is no longer than that of the leader.
                    ("loss", self.same_place(state[f"ready_loss{f}"], way + against)),
                    ("rest", self.same_place(state[f"ready_rest{f}"], way + (against >> 1))),
                )
            }
        if self.golden.axes == 2:
            lead, follow = self.leader(ghosts, "ready", follow_x)
            alike = (lead < 0) == (follow < 0)
            facts["leader"] = z3.Implies(
                ready, state["ready_lead"] == z3.If(alike, -1 - lead, lead)
            )
        else:
            facts["leader"] = z3.Implies(ready, state["ready_lead"] == length)
        return facts

    def length(self, ghosts: dict, stage: str) -> Value:
        """Give how long the way of the leading axis is."""
        longest = z3.BitVecVal(0, self.wide)
        for a in self.letters:
            length = _magnitude(self.delta(ghosts, stage, a))
            longest = z3.If(length > longest, length, longest)
        return longest

    def running(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of the block that is loaded or runs."""
        golden = self.golden
        plane = golden.axes == 2
        loaded, running = state["loaded"] == 1, state["running"] == 1
        starting = state["starting"] == 1
        there = z3.Or(loaded, running)
        follow_x = state["follow_x"] if plane else None
        length, left = ghosts["L"], state[golden.left]
        facts = {
            "length": z3.Implies(
                there,
                z3.And(
                    length >= 1,
                    length < self.top,
                    length == self.length(ghosts, "next"),
                ),
            ),
            "steps left": z3.And(
                z3.Implies(loaded, left + (state["more"] if plane else 1) == -length),
                z3.Implies(running, left == ghosts["k"] + 1 - length),
                z3.Implies(running, ghosts["k"] < length),
                z3.Implies(starting, ghosts["k"] == 0),
                z3.Implies(z3.And(running, z3.Not(starting)), ghosts["k"] >= 1),
            ),
        }
        for a in self.letters:
            facts[f"loaded {a}"] = z3.Implies(
                loaded,
                z3.And(
                    state[f"begin_{a}"] == ghosts[f"begin_next_{a}"],
                    (state[f"negative_{a}"] == 1) == (self.delta(ghosts, "next", a) < 0),
                ),
            )
            facts[f"runs {a}"] = z3.Implies(
                z3.And(running, z3.Not(starting)),
                z3.And(
                    ghosts[f"begin_out_{a}"] == ghosts[f"begin_next_{a}"],
                    ghosts[f"end_out_{a}"] == ghosts[f"end_next_{a}"],
                ),
            )
        if plane:
            facts["same leader"] = z3.Implies(running, state["follows_x"] == state["follow_x"])
        for f, way in self.ways(ghosts, "next", follow_x).items():
            facts[f"way of the block{f}"] = z3.Implies(there, state[f"gain{f}"] == way)
            facts[f"shorter{f}"] = z3.Implies(there, _magnitude(way) <= length)
        return facts

    def residual(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of the followers' registers, by these and L alone."""
        loaded, running = state["loaded"] == 1, state["running"] == 1
        starting = state["starting"] == 1
        there = z3.Or(loaded, running)
        length = ghosts["L"]
        facts: dict[str, z3.BoolRef] = {}
        for f in self.followers:
            own = {
                name: state[name + f]
                for name in ("gain", "loss", "total", "addend", "rest", "often", "first", "rare")
            }
            way = own["gain"]
            rest, beside = ghosts[f"first{f}"], ghosts[f"f{f}"]
            frequent = z3.If(own["often"] == 1, own["loss"], own["gain"])
            rare = z3.If(own["often"] == 1, own["gain"], own["loss"])
            up = way >= 0
            residual = rest + beside
            facts[f"addends of the block{f}"] = z3.Implies(
                there,
                z3.And(
                    own["loss"] == way - _signed(way, length),
                    rest == way + (-_signed(way, length) >> 1),
                    (own["first"] == 1) == (rest < 0),
                    (own["often"] == 1) == z3.If(up, rest >= 0, rest < 0),
                    _magnitude(way) <= length,
                ),
            )
            facts["length of the block"] = z3.Implies(there, z3.And(length >= 1, length < self.top))
            facts |= {
                f"loaded{f}": z3.Implies(
                    loaded,
                    z3.And(*(own["rest"] == rest, own["addend"] == 0, own["total"] == 0)),
                ),
                f"no rest{f}": z3.Implies(running, own["rest"] == 0),
                f"rare{f}": z3.Implies(loaded, own["rare"] == 1),
                f"starting{f}": z3.Implies(
                    starting,
                    z3.And(
                        *(own["total"] == rest, own["addend"] == frequent, own["rare"] == 1),
                        beside == 0,
                    ),
                ),
                f"addend{f}": z3.Implies(
                    z3.And(running, z3.Not(starting)),
                    own["addend"] == z3.If(own["rare"] == 1, rare, frequent),
                ),
                f"total{f}": z3.Implies(
                    z3.And(running, z3.Not(starting)),
                    self.same_place(own["total"], residual - own["addend"] + frequent),
                ),
            }
            facts[f"near{f}"] = z3.Implies(
                running,
                z3.And(
                    z3.If(
                        up,
                        z3.And(residual >= way - length, residual < way),
                        z3.And(residual >= way, residual < way + length),
                    ),
                    # After the rare decision comes the frequent one.
                    z3.Implies(own["rare"] == 1, (residual < 0) == (own["first"] == 1)),
                ),
            )
        return facts

    def waits(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of the position and of the steps decided and those that wait."""
        names = ("waiting", "decided", "running", "starting")
        waiting, decided, running, starting = (state[name] == 1 for name in names)
        going = z3.And(running, z3.Not(starting))
        there = z3.Or(waiting, decided, going)
        steps, length = ghosts["k out"], ghosts["L out"]
        facts = {
            "last": z3.Implies(
                waiting,
                z3.And(
                    (state["last"] == 1) == z3.Not(decided),
                    z3.Implies(state["last"] == 1, steps == length),
                    steps >= 1,
                ),
            ),
            "final": z3.Implies(
                decided,
                z3.And(
                    (state["final"] == 1) == z3.Not(running),
                    z3.Implies(state["final"] == 1, ghosts["k"] == length),
                    ghosts["k"] == steps + 1,
                    z3.Or(waiting, steps == 0),
                ),
            ),
            "length out": z3.And(
                z3.Implies(going, length == ghosts["L"]),
                z3.Implies(there, length == self.length(ghosts, "out")),
            ),
            "nothing waits, nothing moves": z3.And(
                [
                    z3.And(
                        z3.Implies(state["waiting"] == 0, state[f"pulse_{a}"] == 0),
                        z3.Implies(state["decided"] == 0, state[f"moves_{a}"] == 0),
                        z3.Implies(state[f"pulse_{a}"] == 0, state[f"down_{a}"] == 0),
                        z3.Implies(state[f"moves_{a}"] == 0, state[f"falls_{a}"] == 0),
                    )
                    for a in self.letters
                ]
            ),
        }
        for a in self.letters:
            count, out = ghosts[f"count_{a}"], ghosts[f"out_{a}"]
            pulse, moves = state[f"pulse_{a}"], state[f"moves_{a}"]
            way = self.delta(ghosts, "out", a)
            place, move = state[self.golden.place(a)], state[f"move_{a}"]
            facts[f"position {a}"] = z3.Implies(
                there,
                z3.And(
                    self.same_place(place, ghosts[f"begin_out_{a}"] + _signed(way, out - pulse)),
                    state[f"down_{a}"] == z3.If(way < 0, pulse, 0),
                    state[f"falls_{a}"] == z3.If(way < 0, moves, 0),
                    out >= pulse,
                    out <= steps,
                    z3.Implies(decided, count == out + moves),
                ),
            )
            facts[f"moves {a}"] = z3.If(
                starting,
                move == ghosts[f"begin_next_{a}"],
                move == pulse - 2 * state[f"down_{a}"],
            )
            facts[f"direction {a}"] = z3.Implies(
                running, (state[f"direction_{a}"] == 1) == (self.delta(ghosts, "next", a) < 0)
            )
            facts[f"counted {a}"] = z3.Implies(
                running,
                z3.And(count <= ghosts["k"], z3.Implies(starting, count == 0)),
            )
        if self.golden.axes == 2:
            leads = z3.If(state["follows_x"] == 1, ghosts["count_y"], ghosts["count_x"])
            facts["leader's steps"] = z3.Implies(running, leads == ghosts["k"])
        return facts

    def by_cases(self, title: str, claims: dict[str, z3.BoolRef]) -> dict[str, z3.BoolRef]:
        """Split claims about sums by what decides on the summands: the solver is quicker then."""
        state = self.state
        if title == "residual":
            cases = {"stalled": z3.Not(self.go), "loaded": z3.And(self.go, self.load)}
            goes = z3.And(self.go, z3.Not(self.load))
            for number, steps in enumerate(self.steps().values()):
                runs = z3.And(goes, state["running"] == 1)
                cases |= {
                    f"moves {number}": z3.And(runs, steps),
                    f"stays {number}": z3.And(runs, z3.Not(steps)),
                }
            cases["else"] = z3.And(goes, state["running"] == 0)
        elif title == "the block prepared" and self.golden.axes == 2:
            follow = state["way_follow"] < 0
            cases = {}
            for same in (0, 1):
                alike = state["way_same"] == same
                cases |= {f"{same}{down}": z3.And(alike, follow == bool(down)) for down in (0, 1)}
        else:
            return claims
        return {
            f"{name}, {case}": z3.Implies(condition, claim)
            for name, claim in claims.items()
            for case, condition in cases.items()
        }

    def survival(self) -> list[Obligation]:
        """State that the invariant survives every clock, each part by what it follows from."""
        before = self.groups(self.state, self.ghosts)
        needs = {
            "what goes on": ("the block prepared",),
            "blocks accepted": (),
            "the block prepared": ("blocks accepted",),
            "the block that runs": ("the block prepared",),
            "residual": ("the block prepared",),
            "steps and position": ("the block that runs",),
        }
        obligations = []
        for title, claims in self.groups(self.after, self.ghosts_after).items():
            known = [before[name] for name in {"what goes on", title, *needs[title]}]
            more = (
                "; total and addend are the line's own equation at the points of the steps that "
                "have been worked out"
            )
            obligations.append(
                Obligation(
                    f"invariant: survives every clock, whatever the inputs: {title}"
                    + (more if title == "residual" else ""),
                    [fact for group in known for fact in group.values()],
                    self.by_cases(title, claims),
                )
            )
        return obligations

    def obligations(self) -> list[Obligation]:
        """Give everything that is promised of the registers."""
        golden, state, after, ghosts = self.golden, self.state, self.after, self.ghosts
        known = list(self.invariant(state, ghosts).values())
        reset = {name: z3.BitVecVal(value, self.wide) for name, value in golden.reset().items()}
        zero = dict.fromkeys(ghosts, z3.BitVecVal(0, self.wide))
        ended = z3.And(self.taken, state["last"] == 1)
        plane = golden.axes == 2
        emptied = z3.And(self.answer, state["ready_fault"] == 0)
        rejected = z3.And(self.answer, state["ready_fault"] == 1)
        entering = [*known, self.enters]
        near = {}
        for f in self.followers:
            beside = self.ghosts_after[f"f{f}"]
            near[f"half a step{f}"] = z3.And(2 * beside >= -ghosts["L"], 2 * beside <= ghosts["L"])
            near[f"a tie goes upwards{f}"] = z3.Implies(
                _magnitude(2 * beside) == ghosts["L"],
                beside < 0,
            )
        own = [golden.left, *(f"{name}{f}" for f in self.followers for name in ("total", "addend"))]
        own += [golden.place(a) for a in self.letters]
        stays = [*own, *(f"{k}_{a}" for a in self.letters for k in ("pulse", "moves", "move"))]
        stays += ["last", "waiting", "final", "decided", "running"]
        return [
            Obligation("invariant: holds after reset", [], self.invariant(reset, zero)),
            *self.survival(),
            Obligation(
                "equation: what is added with a step is Δ, less ± L where it moves the follower, "
                "so that f is k·Δ − count·(± L)",
                entering,
                {
                    f"adds{f}": self.added(f)
                    == state[f"gain{f}"] - z3.If(steps, _signed(state[f"gain{f}"], ghosts["L"]), 0)
                    for f, steps in self.steps().items()
                },
            ),
            Obligation(
                "error: after every step each axis is at most half a step beside the line, and "
                "upwards of it on a tie",
                entering,
                near,
            ),
            Obligation(
                "a step a clock: while a block runs a step is decided in every clock in which none "
                "waits or one is taken, and begins to wait in the next such clock; the leading "
                "axis moves with each of them",
                [*known, state["running"] == 1, self.go],
                [after["decided"] == 1, z3.Implies(state["decided"] == 1, after["waiting"] == 1)]
                + (
                    [z3.Or(list(self.moved().values()))]
                    if not plane
                    else [z3.If(state["follows_x"] == 1, self.moved()["y"], self.moved()["x"])]
                ),
            ),
            Obligation(
                "between blocks: the one prepared is loaded in the clock in which the last step of "
                "the one before is decided, or in any in which nothing runs, and its first step is "
                "decided two clocks later",
                known,
                {
                    "loaded": z3.Implies(self.load, after["loaded"] == 1),
                    "started": z3.Implies(self.begins, after["running"] == 1),
                    "when": z3.Implies(
                        z3.And(state["prepared"] == 1, self.go),
                        z3.Or(self.load, state["loaded"] == 1, z3.Not(self.ends)),
                    ),
                },
            ),
            Obligation(
                "it always ends: every step that is decided leaves one less to come, and the L-th "
                "one is the last",
                entering,
                [
                    (after["final"] == 1) == (self.ghosts_after["k"] == ghosts["L"]),
                    self.ghosts_after["k"] == ghosts["k"] + 1,
                    self.ghosts_after["k"] <= ghosts["L"],
                ],
            ),
            Obligation(
                "position: changes by just the step that is taken, and by a block's start",
                known,
                {
                    a: self.same_place(
                        after[golden.place(a)],
                        z3.If(
                            self.places,
                            ghosts[f"begin_next_{a}"],
                            state[golden.place(a)] + z3.If(self.taken, self.out[f"steps_{a}"], 0),
                        ),
                    )
                    for a in self.letters
                },
            ),
            Obligation(
                "stall: a step that is not taken stays, and nothing of its block moves",
                [*known, self.waiting, z3.Not(self.taken)],
                same({name: after[name] for name in stays}, state),
            ),
            Obligation(
                "answer: done or error just one clock after a last step is taken, a block of no "
                "length or a rejected one has its turn, and never two of these in one clock",
                known,
                [
                    (after["done"] == 1) == z3.Or(ended, emptied),
                    (after["error"] == 1) == rejected,
                    z3.AtMost(ended, emptied, rejected, 1),
                ],
            ),
            Obligation(
                "rejected: just the blocks with an axis longer than 2^n − 1, and they move nothing",
                known,
                {
                    "just these": z3.Implies(rejected, self.too_long(ghosts, "ready")),
                    "no other": z3.Implies(
                        z3.Or(self.load, emptied), z3.Not(self.too_long(ghosts, "ready"))
                    ),
                }
                | {
                    f"still {a}": z3.Implies(
                        rejected, after[golden.place(a)] == state[golden.place(a)]
                    )
                    for a in self.letters
                },
            ),
            Obligation(
                "end: with the last step taken every axis is at its start and as many steps from "
                "it as it has made, all L of them, and at most half a step beside the line",
                [*known, ended],
                {
                    a: z3.Implies(
                        z3.Not(self.places),
                        self.same_place(
                            after[golden.place(a)],
                            ghosts[f"begin_out_{a}"]
                            + _signed(self.delta(ghosts, "out", a), ghosts[f"out_{a}"]),
                        ),
                    )
                    for a in self.letters
                }
                | {"all steps": ghosts["k out"] == self.length(ghosts, "out")},
            ),
        ]


def _magnitude(value: Value) -> Value:
    return z3.If(value < 0, -value, value)


def _signed(way: Value, value: Value) -> Value:
    """Give a value the sign of a way."""
    return z3.If(way < 0, -value, value)


def _numbers(golden: ExactLine) -> list[Obligation]:
    """What follows for numbers, of one follower whose way has been made positive.

    f = k·Δ − count·L; b and c are two axes' ways beside the line, a the leading one's.
    """
    f, k, way, count, length, moves = z3.Ints("f k Δ count L moves")
    made = f == k * way - count * length
    near = [2 * f >= -length, 2 * f <= length]
    beside, along = z3.Reals("beside along")
    return [
        Obligation(
            "numbers: f = k·Δ − count·L stays true from step to step",
            [made],
            [f + way - moves * length == (k + 1) * way - (count + moves) * length],
            True,
        ),
        Obligation(
            "numbers: at most half a step beside the line means ⌊k·Δ/L + ½⌋ steps, but for a tie",
            [made, *near, length >= 1, 2 * f != length, 2 * f != -length],
            [
                z3.And(
                    2 * length * count <= 2 * k * way + length,
                    2 * k * way + length < 2 * length * (count + 1),
                )
            ],
            True,
        ),
        Obligation(
            "end: after L steps at most half a step beside the line the axis has made all its own",
            [made, *near, k == length, length >= 1],
            [count == way],
            True,
        ),
        Obligation(
            "distance: half a step along the axis is less than half a step from a line in the "
            "plane that is not along the other axis",
            [beside * beside <= z3.RealVal("1/4"), along > 0, along <= 1],
            # Δ/L = along; the distance is beside / √(1 + along²).
            [4 * beside * beside < 1 + along * along],
            True,
        ),
    ][: 4 if golden.axes == 2 else 3]
