"""Promises of the circular interpolator, proven for every arc at a given width.

They are shown of the golden model's own source, which the device is proven equal to. Two kinds:

- about the registers, in bit-vectors: an invariant is shown to hold after reset and to survive
  every clock from every state that satisfies it, whatever the inputs; the promises follow from it.
  A few ghost values remember what the registers forget of the running arc: ``center``, ``end`` and
  ``clockwise``, and that it is an ``arc`` and not a block of no length. What a block is when it
  starts, :func:`shared` proves: see :mod:`discreta.sim.proofs.arc_input`;
- about numbers, in integers: after how many summations it ends.

Notation as there; P1, P2 are X, Y in the frame of the moment, P3, P4 the steps left, M = 2^(n + g).
A piece of an arc ends where it crosses an axis, and the last one at the arc's end. What a summation
adds to SX is what SX + M·(steps of X) has gained.
"""

from dataclasses import replace
from itertools import product

import z3

from discreta.sim.golden.circular import Circular
from discreta.sim.golden.logic import Value
from discreta.sim.proofs import arc_input
from discreta.sim.proofs.arc_input import (
    PREPARED,
    SQUARES,
    Preparation,
    opposed,
    room,
    seen_from_center,
)
from discreta.sim.smt import Exhaustive, Obligation, same

__all__ = ["promises", "shared"]


def shared(golden: Circular) -> list[Obligation | Exhaustive]:
    """Give what is promised of the preparation of an arc, the same in every variant."""
    return arc_input.promises(golden)


def promises(golden: Circular) -> list[Obligation]:
    """Give everything else that is promised of the circular interpolator."""
    return _Registers(golden).obligations() + _numbers(golden)


class _Registers:
    """What is promised of the registers of a running arc, in bit-vectors."""

    def __init__(self, golden: Circular):
        self.golden = golden
        self.modulus = golden.modulus
        self.block = block = Preparation(golden, squares=False)
        self.state, self.after = state, after = block.state, block.after
        kinds: dict[str, tuple[int, bool]] = dict.fromkeys(("clockwise", "arc"), (1, False))
        kinds |= {
            f"{which}_{a}": (golden.width + 1, True) for which in ("center", "end") for a in "xy"
        }
        self.ghosts = block.numbers(kinds, "ghost.")
        loaded = {f"center_{a}": state[f"center_{a}"] for a in "xy"}
        loaded |= {f"end_{a}": block.ghosts[f"next_end_{a}"] for a in "xy"}
        loaded |= {"clockwise": block.ghosts["next_clockwise"], "arc": state["empty"] ^ 1}
        self.ghosts_after = {
            name: z3.If(block.load, value, self.ghosts[name]) for name, value in loaded.items()
        }
        self.found = list(block.found(state, block.ghosts).values())
        self.known = self.invariant(state, self.ghosts)
        self.counted = list(self.known["counted"].values())

        # What a clock does.
        self.x, self.y, self.p3, self.p4 = (state[name] for name in ("p1", "p2", "p3", "p4"))
        self.last = state["turns"] == 0
        self.running = state["running"] == 1
        self.clock = z3.And(self.running, block.free)
        self.half = z3.And(self.clock, state["fresh"] == 1 if golden.halves else False)
        whole = z3.And(self.clock, z3.Not(self.half))
        self.turn = z3.And(whole, z3.Not(self.last), self.p3 == 0)
        self.sums = z3.And(whole, z3.Not(self.turn))
        self.x_goes = z3.And(self.p3 != 0, state["backward"] == 0)
        self.y_goes = self.p4 != 0
        self.dead = z3.And(
            self.last,
            z3.Or(z3.Not(self.x_goes), self.y == 0),
            z3.Or(z3.Not(self.y_goes), self.x == 0),
        )
        self.step_x, self.step_y = self.p3 - after["p3"], self.p4 - after["p4"]
        self.added_x = after["sx"] - state["sx"] + self.modulus * self.step_x
        self.added_y = after["sy"] - state["sy"] + self.modulus * self.step_y

        outputs = golden.outputs(state)
        self.steps = {a: outputs[f"steps_{a}"] for a in "xy"}
        self.moved = {
            a: state[f"{a}t"] + z3.If(block.taken, self.steps[a], block.number(0)) for a in "xy"
        }
        # That these are the positions that follow is an obligation of its own.
        self.placed = after | {
            f"{a}t": z3.If(block.load, state[f"start_{a}"], self.moved[a]) for a in "xy"
        }

    def falling(self, state: dict) -> dict[str, Value]:
        """Give the directions in which X falls and Y rises: with ``backward`` X goes the other."""
        swap, backward = state["swap"], state["backward"]
        return {
            "x": state["direction_x"] ^ (backward & (swap ^ 1)),
            "y": state["direction_y"] ^ (backward & swap),
        }

    def invariant(self, state: dict, ghosts: dict) -> dict[str, dict[str, z3.BoolRef]]:
        """Give what is true of a state in every clock.

        In four parts: of P1 to P4, of the position, of the end, and of the room at the crossings.
        """
        x, y, p3, p4, xk, yk = (state[name] for name in ("p1", "p2", "p3", "p4", "xk", "yk"))
        swap, turns, limit, fall = (
            state["swap"],
            state["turns"],
            state["limit"],
            self.falling(state),
        )
        running, arc, last = state["running"] == 1, ghosts["arc"] == 1, turns == 0
        backward = state["backward"] == 1
        moves = z3.Or(running, state["pulse_x"] == 1, state["pulse_y"] == 1)
        to_axis, to_end = z3.And(running, z3.Not(last)), z3.And(arc, last)
        counted = {
            "P3": z3.Implies(to_axis, p3 == x),
            "P4": z3.Implies(to_axis, p4 == limit - y),
            "limit": z3.Implies(to_axis, z3.And(x <= limit, y <= limit)),
            "off the centre": z3.Implies(to_axis, z3.Or(x > 0, y > 0)),
            "P3 of the last piece": z3.Implies(to_end, p3 == z3.If(backward, xk - x, x - xk)),
            "P4 of the last piece": z3.Implies(to_end, p4 == yk - y),
            "backward": z3.Implies(backward, last),
            "end's quadrant": z3.Implies(arc, z3.Or(yk > 0, xk == 0)),
            "is an arc": z3.Implies(moves, arc),
            "has ended": z3.Implies(z3.And(arc, z3.Not(running)), last),
            "runs": z3.Implies(to_end, running == z3.Or(p3 > 0, p4 > 0)),
        }
        center = {a: ghosts[f"center_{a}"] for a in "xy"}
        now = seen_from_center(self.block.number(0), swap, fall, x, y)
        end = seen_from_center(turns, swap, fall, xk, yk)
        placed = {"way round": (fall["x"] ^ fall["y"] ^ swap ^ ghosts["clockwise"]) == 1}
        aimed = {}
        for a in "xy":
            # Where it is when the step that waits is taken.
            place = state[f"{a}t"] + opposed(state[f"direction_{a}"], state[f"pulse_{a}"])
            placed[a] = place == center[a] + now[a]
            aimed[a] = z3.Implies(arc, ghosts[f"end_{a}"] == center[a] + end[a])
        fits = {
            name: z3.Implies(running, fact)
            for name, fact in room(turns, swap, fall, center, limit, self.golden.width).items()
        }
        return {"counted": counted, "placed": placed, "aimed": aimed, "room": fits}

    def from_here(self) -> dict[str, z3.BoolRef]:
        """State that in the last piece the steps left lead from the position to the end."""
        facts = {}
        for index, a in enumerate("xy"):
            left = z3.If(self.state["swap"] == index, self.p3, self.p4)
            steps = opposed(self.state[f"direction_{a}"], left + self.state[f"pulse_{a}"])
            facts[a] = z3.Implies(
                z3.And(self.ghosts["arc"] == 1, self.last),
                self.ghosts[f"end_{a}"] == self.state[f"{a}t"] + steps,
            )
        return facts

    def scaled(self, value: Value) -> Value:
        """Give value·2^s, with the s that brings the top bit of X or Y to its place."""
        if not self.golden.normalize:
            return value
        n = self.golden.width
        out = value << (n - 1)
        for shift in reversed(range(n - 1)):
            out = z3.If(self.x | self.y >= 2 ** (n - 1 - shift), value << shift, out)
        return out

    def survives(self, part: str, *others: str) -> dict[str, z3.BoolRef]:
        """State that a part of the invariant survives every clock; it may rest on other parts."""
        known = [fact for name in (part, *others) for fact in self.known[name].values()]
        clocks = {
            "a start": [self.block.load, *self.found],
            "a turn": [self.turn, *known],
            "another clock": [z3.Not(self.block.load), z3.Not(self.turn), *known],
        }
        return {
            f"{name}, after {clock}": z3.Implies(z3.And(assumed), fact)
            for clock, assumed in clocks.items()
            for name, fact in self.invariant(self.placed, self.ghosts_after)[part].items()
        }

    def obligations(self) -> list[Obligation]:
        """Give the obligations."""
        return [*self._induction(), *self._rules(), *self._ends()]

    def _induction(self) -> list[Obligation]:
        """The invariant, and what it says of position and end."""
        block, state, after = self.block, self.state, self.after
        reset = {name: block.number(value) for name, value in self.golden.reset().items()}
        nothing = {name: block.number(0) for name in self.ghosts} | {"clockwise": block.number(1)}
        everything = [fact for part in self.known.values() for fact in part.values()]
        here = self.from_here()
        top = 2**self.golden.width
        fits = {f"{a}t": z3.And(self.moved[a] >= -top, self.moved[a] < top) for a in "xy"}
        return [
            block.obligation(
                "invariant: it holds after reset",
                [],
                {
                    f"{part}, {name}": fact
                    for part, facts in self.invariant(reset, nothing).items()
                    for name, fact in facts.items()
                },
            ),
            block.obligation(
                "invariant: to an axis P3 = P1 and P2 + P4 = L, to the end P3 = |P1 − XK| and P4 = "
                "YK − P2: so it is after a start, a turn of the frame and every other clock",
                [],
                self.survives("counted"),
            ),
            block.obligation(
                "invariant: the position is the centre ± P1, P2 in the frame of the moment, which "
                "turns the way of the block: likewise",
                [],
                self.survives("placed", "counted"),
            ),
            block.obligation(
                "invariant: the end is the centre ± XK, YK after the turns to come: likewise",
                [],
                self.survives("aimed", "counted"),
            ),
            block.obligation(
                "invariant: there are coordinates as far as L at the crossings to come: likewise",
                [],
                self.survives("room", "counted"),
            ),
            block.obligation(
                "position: in the last piece P3 and P4 are the steps from it to the end",
                everything,
                {
                    f"{a}, {swap}{negative}{backward}": z3.Implies(
                        z3.And(
                            state["swap"] == swap,
                            state[f"direction_{a}"] == negative,
                            state["backward"] == backward,
                        ),
                        here[a],
                    )
                    for a, swap, negative, backward in product("xy", (0, 1), (0, 1), (0, 1))
                },
            ),
            block.obligation("position: it never wraps", [*everything, *here.values()], fits),
            block.obligation(
                "position: changes by just the step that is taken, and by loading a block's start",
                [],
                {name: z3.Implies(fits[name], after[name] == self.placed[name]) for name in fits},
            ),
        ]

    def _rules(self) -> list[Obligation]:
        """What every kind of clock does."""
        block, golden, state, after = self.block, self.golden, self.state, self.after
        n, modulus, initial = golden.width, self.modulus, golden.initial_sum
        zero, one = block.number(0), block.number(1)
        live = z3.And(self.sums, z3.Not(self.dead))
        x_moves, y_moves = z3.And(self.x_goes, self.y > 0), z3.And(self.y_goes, self.x > 0)

        one_piece = state["first_turns"] == 0
        xh, yh, xk, yk = (state[name] for name in ("from_x", "from_y", "to_x", "to_y"))
        limit = block.limit(state)
        loads = {
            **{"p1": xh, "p2": yh, "xk": xk, "yk": yk, "sx": initial, "sy": initial},
            **{"turns": state["first_turns"], "swap": state["first_swap"], "backward": 0},
            **{f"{a}t": state[f"start_{a}"] for a in "xy"},
            **{f"direction_{a}": state[f"negative_{a}"] for a in "xy"},
            **{"running": state["empty"] ^ 1, "pulse_x": 0, "pulse_y": 0},
        }
        left = {
            "p3": z3.If(one_piece, xh - xk, xh),
            "p4": z3.If(one_piece, yk - yh, limit - yh),
        }
        entering, short = state["turns"] == 1, self.y < state["xk"]
        distance = z3.If(short, state["xk"] - self.y, self.y - state["xk"])
        turns = {
            **{"p1": self.y, "p2": 0, "sx": modulus - 1 - state["sy"], "sy": state["sx"]},
            "p3": z3.If(entering, distance, self.y),
            "p4": z3.If(entering, state["yk"], state["limit"]),
            "turns": state["turns"] - 1,
            "swap": 1 - state["swap"],
            "backward": z3.If(z3.And(entering, short), one, zero),
            **{"pulse_x": 0, "pulse_y": 0},
        }
        swapped = state["swap"] == 1
        pulse_x = z3.If(swapped, after["pulse_y"], after["pulse_x"])
        pulse_y = z3.If(swapped, after["pulse_x"], after["pulse_y"])
        back = z3.If(state["backward"] == 1, self.step_x, -self.step_x)
        addend_y = after["p1"] if golden.order == "alternated" else self.x
        which = "the new X" if golden.order == "alternated" else "X"
        shift = "·2^s" if golden.normalize else ""
        most = " with the greatest s that loses no bit" if golden.normalize else ""
        rules = [
            block.obligation(
                "start: P1, P2 = XH, YH; P3, P4 = XH − XK, YK − YH to the end, XH, L − YH to an "
                f"axis; SX = SY = {initial}",
                [block.load, *self.found],
                {name: after[name] == value for name, value in loads.items()}
                | {name: z3.Or(block.empty, after[name] == left[name]) for name in left}
                | {"limit": z3.Or(block.empty, one_piece, after["limit"] == limit)},
            ),
            block.obligation(
                "turn: P1, P2 = P2, 0; P3, P4 = P2, L to an axis, |P2 − XK|, YK to the end; SX, SY "
                "= M − 1 − SY, SX",
                [self.turn],
                {name: after[name] == value for name, value in turns.items()},
            ),
            block.obligation(
                f"summation: SX gains Y{shift} unless P3 = 0 or it is backward, SY gains {which}"
                f"{shift} unless P4 = 0{most}",
                [live, *self.counted],
                {
                    "x": self.added_x == z3.If(self.x_goes, self.scaled(self.y), zero),
                    "y": self.added_y == z3.If(self.y_goes, self.scaled(addend_y), zero),
                },
            ),
            block.obligation(
                "one carry: a summation adds less than 2^n ≤ M",
                [live],
                {
                    "x": z3.And(self.added_x >= 0, self.added_x < 2**n),
                    "y": z3.And(self.added_y >= 0, self.added_y < 2**n),
                },
            ),
            block.obligation(
                "one step: at most one step an axis a clock, and P1 to P4 change by just the steps "
                "that are put out",
                [self.clock, z3.Not(self.turn), *self.counted],
                {
                    "x": self.step_x == pulse_x,
                    "y": self.step_y == pulse_y,
                    "P1": after["p1"] == self.x + back,
                    "P2": after["p2"] == self.y + self.step_y,
                    "none": z3.Or(self.sums, z3.And(self.step_x == 0, self.step_y == 0)),
                },
            ),
            block.obligation(
                "completing steps: only in the last piece and when no axis with steps left would "
                "move any more; then one of every such axis",
                [self.sums, self.dead],
                {
                    "last": self.last,
                    "sums": z3.And(after["sx"] == state["sx"], after["sy"] == state["sy"]),
                    "x": self.step_x == z3.If(self.p3 != 0, one, zero),
                    "y": self.step_y == z3.If(self.p4 != 0, one, zero),
                },
            ),
            block.obligation(
                "limit: before the last piece no axis goes further from the centre than L",
                [self.running, z3.Not(self.last), *self.counted, *self.known["placed"].values()],
                {
                    a: z3.And(away <= state["limit"], -away <= state["limit"])
                    for a in "xy"
                    for away in [state[f"{a}t"] + self.steps[a] - self.ghosts[f"center_{a}"]]
                },
            ),
            block.obligation(
                "no hang: every clock of an arc whose step does not wait takes off the half "
                "increment, turns the frame, adds at least 1 or puts out a completing step",
                self.counted,
                {
                    "half": z3.Implies(
                        self.half,
                        z3.And(
                            *same({k: after[k] for k in ("p3", "p4", "turns")}, state).values(),
                            after["fresh"] == 0 if golden.halves else False,
                        ),
                    ),
                    "turn": z3.Implies(self.turn, after["turns"] == state["turns"] - 1),
                    "one moves": z3.Implies(live, z3.Or(x_moves, y_moves)),
                    "x": z3.Implies(z3.And(live, x_moves), self.added_x >= 1),
                    "y": z3.Implies(z3.And(live, y_moves), z3.Or(x_moves, self.added_y >= 1)),
                    "completing": z3.Implies(
                        z3.And(self.sums, self.dead), self.step_x + self.step_y >= 1
                    ),
                },
            ),
        ]
        if golden.halves:
            rules.append(
                block.obligation(
                    f"half increment: once, before all summations, SX = M/2 − ⌊Y{shift} / 2⌋",
                    [self.half],
                    {
                        "SX": after["sx"] == initial - (self.scaled(self.y) >> 1),
                        "SY": after["sy"] == state["sy"],
                        "once": after["fresh"] == 0,
                    },
                )
            )
        if golden.normalize:
            rules.append(
                block.obligation(
                    "speed: while both axes have steps left, a summation adds at least 2^(n − 1)",
                    [live, self.x_goes, self.y_goes, *self.counted],
                    {"x and y": self.added_x + self.added_y >= 2 ** (n - 1)},
                )
            )
        return rules

    def _ends(self) -> list[Obligation]:
        """How a block ends, waits and is answered."""
        block, golden, state, after = self.block, self.golden, self.state, self.after
        outputs, later = golden.outputs(state), golden.outputs(after)
        ended = z3.And(block.taken, outputs["steps_last"] == 1)
        emptied = z3.And(block.load, block.empty)
        rejected = z3.And(block.start, block.fault)
        idle = z3.And(z3.Not(self.running), block.prepared)
        moving = [name for name in after if name not in (*PREPARED, "done", "error")]
        unmoved = same({name: after[name] for name in moving}, state)

        # That the squares may be left out, and that what all variants share is the same in all.
        whole = Preparation(golden)
        default = replace(golden, order="alternated", preload="half", normalize=True, guard=2)
        other = default.step({"fresh": whole.number(0)} | whole.state, whole.inputs)
        without = golden.step(whole.state | dict.fromkeys(SQUARES, whole.number(0)), whole.inputs)
        return [
            block.obligation(
                "end: when an arc is done its end point is reached exactly",
                [*self.counted, *self.from_here().values(), ended],
                {"done": after["done"] == 1}
                | {a: self.moved[a] == self.ghosts[f"end_{a}"] for a in "xy"},
            ),
            block.obligation(
                "end: a block of no length is done where it is, without a step",
                [emptied, *self.found],
                {"done": after["done"] == 1, "stands": after["running"] == 0}
                | {a: after[f"{a}t"] == block.ghosts[f"next_end_{a}"] for a in "xy"}
                | {f"step {a}": after[f"pulse_{a}"] == 0 for a in "xy"},
            ),
            block.obligation(
                "end: the summation with which an arc stops puts out its last step",
                [*self.counted, self.running, after["running"] == 0],
                {"waits": later["steps_valid"] == 1, "last": later["steps_last"] == 1},
            ),
            block.obligation(
                "answer: done or error just one clock after a last step is taken, a block of no "
                "length is started or a block is rejected, and never two of these in one clock",
                self.counted,
                {
                    "done": (after["done"] == 1) == z3.Or(ended, emptied),
                    "error": after["error"] == z3.If(rejected, state["fault"], block.number(0)),
                    "one": z3.AtMost(ended, emptied, rejected, 1),
                },
            ),
            block.obligation("rejected: a block with a fault moves nothing", [rejected], unmoved),
            block.obligation(
                "stall: a step that is not taken stays, and no register of the arc moves",
                [block.waiting, z3.Not(block.taken)],
                unmoved | {f"steps {a}": later[f"steps_{a}"] == self.steps[a] for a in "xy"},
            ),
            block.obligation(
                "no gap: a prepared block starts in the clock in which the last step before it is "
                "taken, or in the next one if it has nothing to run",
                [z3.Or(z3.Not(block.waiting), block.taken), idle],
                {
                    "arc": z3.Or(block.nothing, after["held"] == 0),
                    "nothing": z3.Or(block.waiting, after["held"] == 0),
                },
            ),
            whole.obligation(
                "preparation: the same as in every other variant; of its squares a running arc "
                "reads nothing",
                [],
                same({name: whole.after[name] for name in PREPARED}, other)
                | same({k: whole.after[k] for k in whole.after if k not in PREPARED}, without),
            ),
        ]


def _numbers(golden: Circular) -> list[Obligation]:
    """What follows for the clocks of a piece, from V = M·(P3 + P4 + 2) − SX − SY."""
    m = golden.modulus
    p3, p4, sx, sy, steps_x, steps_y, added_x, added_y = z3.Ints(
        "P3 P4 SX SY steps_x steps_y added_x added_y"
    )
    t, begun, now = z3.Ints("t V₀ V")
    value = m * (p3 + p4 + 2) - sx - sy
    sx_after, sy_after = sx + added_x - m * steps_x, sy + added_y - m * steps_y
    after = m * (p3 - steps_x + p4 - steps_y + 2) - sx_after - sy_after
    inside = [sx >= 0, sx < m, sy >= 0, sy < m, p3 >= 0, p4 >= 0]
    size = 2**golden.width
    return [
        Obligation(
            "numbers: V = M·(P3 + P4 + 2) − SX − SY is at least 2 and falls by what is added, by M "
            "with every completing step",
            inside,
            [value >= 2, after == value - added_x - added_y],
            True,
        ),
        Obligation(
            "it always ends: a piece takes fewer than M·(P3 + P4 + 2) summations for P3 and P4 as "
            f"loaded, so fewer than {2 * m * size}; an arc has turns + 1 pieces",
            [*inside, p3 < size, p4 < size, begun == value, now >= 2, now <= begun - t],
            [t < m * (p3 + p4 + 2), t < 2 * m * size],
            True,
        ),
    ]
