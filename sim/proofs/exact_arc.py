"""Promises of the exact arc interpolator, proven for every arc at a given width.

They are shown of the golden model's own source, which the device is proven equal to. Two kinds:

- about the registers, in bit-vectors: an invariant is shown to hold after reset and to survive
  every clock from every state that satisfies it, whatever the inputs. Ghost values remember what
  the registers say in their own ways: X and Y, the point that the next step leaves, and E;
- about numbers: what E grows by is what the circle's equation says, in whole numbers; and that no
  step leads half a step off the circle, in real ones.

Notation: X, Y in the frame of the moment, F = X² + Y² − R²; while Y leads E = F + 2Y − X + 1, then
E = F − 2X + Y + 1. A change is the step with which the octant ends or an axis is reached.
"""

import numpy as np
import z3

from discreta.sim.arcs import OFF_CURVE, RANGE, crossings, is_empty
from discreta.sim.golden.exact_arc import (
    AXIS_NEXT,
    CHANGE,
    OCTANT_NEXT,
    STEP,
    ExactArc,
)
from discreta.sim.smt import Exhaustive, Obligation, numbers, same

__all__ = ["promises"]

_INPUTS = ("start_x", "start_y", "end_x", "end_y", "center_x", "center_y")

#: Where a block is: the stages of its preparation, and at last the arc that runs. The ghosts of
#: these names remember its centre.
_STAGES = ("first", "seen", "ready", "run")

#: The largest width of which every arc is prepared for comparison.
_SMALL = 4


def promises(golden: ExactArc) -> list[Obligation | Exhaustive]:
    """Give everything that is promised of the exact arc interpolator."""
    found: list[Obligation | Exhaustive] = [*_Registers(golden).obligations(), *_numbers()]
    if golden.width <= _SMALL:
        found.append(_prepared(golden))
    return found


def _prepares(name: str) -> bool:
    """Tell the facts about the stages of preparation."""
    return name.split(" ")[0] in ("held", "coded", "seen", "ready")


class _Registers:
    """What is promised of the registers, in bit-vectors."""

    def __init__(self, golden: ExactArc):
        self.golden = golden
        n = golden.width
        self.bits = max(n + 3, 11) + 8
        kinds = golden.registers()
        self.state, ranges = numbers(kinds, self.bits)
        inputs: dict[str, tuple[int, bool]] = {f"blocks_{k}": (n + 1, True) for k in _INPUTS}
        inputs |= {"blocks_full_turns": (8, False)}
        flags = ("blocks_valid", "blocks_clockwise", "steps_ready")
        inputs |= dict.fromkeys(flags, (1, False))
        self.inputs, more = numbers(inputs, self.bits)
        # As far as an arc that fits may go: R < 2^n·√2, E within 2R + 1.
        ghosts: dict[str, tuple[int, bool]] = dict.fromkeys(("X", "Y"), (n + 2, True))
        ghosts |= {f"{stage}_{a}": (n + 1, True) for stage in _STAGES for a in "xy"}
        self.ghosts, still = numbers(ghosts | {"E": (n + 3, True)}, self.bits, "ghost.")
        self.ranges = ranges + more + still
        self.after = golden.step(self.state, self.inputs)
        state = self.state
        self.free = z3.Or(state["waiting"] == 0, self.inputs["steps_ready"] == 1)
        self.taken = z3.And(state["waiting"] == 1, self.inputs["steps_ready"] == 1)
        self.running, self.loading = state["running"] == 1, state["loading"] == 1
        self.near, self.lost = state["near"] == 1, state["lost"] == 1
        self.missed = z3.And(self.running, self.lost, z3.Not(self.near))
        self.ends = z3.And(self.running, z3.Or(self.near, self.lost))
        self.prepares = state["mode"] >= OCTANT_NEXT
        self.steps = z3.And(
            self.running, z3.Not(self.missed), z3.Or(self.near, z3.Not(self.prepares))
        )
        self.goes = z3.And(self.steps, z3.Not(self.near))
        self.ghosts_after = self._move()

    def number(self, value: int) -> z3.BitVecRef:
        """Give a constant."""
        return z3.BitVecVal(value, self.bits)

    def obligation(self, title: str, assumptions: list, claims: dict) -> Obligation:
        """State something of the registers."""
        return Obligation(title, assumptions, claims, ranges=self.ranges)

    def _move(self) -> dict[str, z3.BitVecRef]:
        """Give the ghosts after a clock, from the geometry."""
        state, after = self.state, self.after
        x, y, e = (self.ghosts[name] for name in ("X", "Y", "E"))
        zero, one = self.number(0), self.number(1)
        second, change = state["second"] == 1, state["mode"] == CHANGE
        on_diagonal = self.on_diagonal = z3.If(second, e < 0, e >= 0)
        to_x = z3.If(z3.Or(second, on_diagonal), x - 1, x)
        to_y = z3.If(z3.Or(z3.Not(second), on_diagonal), y + 1, y)
        axial = z3.If(second, 3 - 2 * x, 2 * y + 3)
        gain = z3.If(on_diagonal, 2 * (y - x) + 5, axial)
        unit = z3.And(state["unit"] == 1, state["final"] == 0)
        crosses = self.crosses = z3.Or(unit, z3.And(change, second))
        turned = z3.And(change, z3.Not(second))
        # E of the other octant, and of the turned frame; (1, 0) of radius 1 turns to itself.
        gain = z3.If(turned, gain - to_x - to_y, gain)
        gain = z3.If(z3.And(change, second), gain - 2 * to_y, gain)
        gain = z3.If(unit, zero, gain)
        moved = {
            "X": z3.If(crosses, to_y, to_x),
            "Y": z3.If(crosses, zero, to_y),
            "E": e + gain,
        }
        loaded = {"X": -state["ready_x"], "Y": state["ready_y"]}
        x, y = loaded["X"], loaded["Y"]
        y_leads = z3.And(y < x, z3.Not(z3.And(x == one, y == zero)))
        loaded["E"] = z3.If(y_leads, 2 * y - x + 1, y - 2 * x + 1)
        begins = z3.And(self.free, after["loading"] == 1)
        goes = z3.And(self.free, self.goes)
        accepted = z3.And(
            self.inputs["blocks_valid"] == 1,
            self.golden.outputs(state)["blocks_ready"] == 1,
        )
        comes = {
            "first": accepted,
            "seen": z3.And(state["coded"] == 1, state["seen_held"] == 0),
            "ready": z3.And(state["seen_held"] == 1, state["ready_held"] == 0),
            "run": begins,
        }
        centers = {}
        for before, stage in zip(("", *_STAGES), _STAGES, strict=False):
            for a in "xy":
                source = (
                    self.ghosts[f"{before}_{a}"] if before else self.inputs[f"blocks_center_{a}"]
                )
                own = self.ghosts[f"{stage}_{a}"]
                centers[f"{stage}_{a}"] = z3.If(comes[stage], source, own)
        return centers | {
            name: z3.If(begins, loaded[name], z3.If(goes, moved[name], self.ghosts[name]))
            for name in moved
        }

    def invariant(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        n = self.golden.width
        x, y, e = (ghosts[name] for name in ("X", "Y", "E"))
        axial, diagonal, mode = state["axial"], state["diagonal"], state["mode"]
        running, loading = state["running"] == 1, state["loading"] == 1
        second, final = state["second"] == 1, state["final"] == 1
        unit = state["unit"] == 1
        top = self.number(2 ** (n + 2))
        signed = z3.If(second, z3.If(e < 0, e + top, e - top), e)
        own = z3.If(second, 1 - x, y + 1)
        plain = z3.Or(mode == STEP, z3.And(mode >= OCTANT_NEXT))
        octant = z3.And(mode == CHANGE, z3.Not(second))
        axis = z3.And(mode == CHANGE, second)
        ended = z3.Or(state["near"] == 1, state["lost"] == 1)
        facts = {
            "E": z3.Implies(running, state["f"] == signed),
            "axial": z3.Implies(z3.And(running, plain), axial == own),
            "diagonal": z3.Implies(z3.And(running, plain), diagonal == y - x + 2),
            "axial, changing the octant": z3.Implies(octant, axial == 0),
            "diagonal, changing the octant": z3.Implies(octant, diagonal == 1 - x),
            "odd": z3.Implies(octant, state["odd"] == y - x + 2),
            "axial, at an axis": z3.Implies(axis, z3.And(axial == -y, x == 1)),
            "diagonal, at an axis": z3.Implies(axis, diagonal == 0),
            "octant's end": z3.Implies(
                mode == OCTANT_NEXT, z3.And(z3.Not(second), y - x >= -2, y - x <= -1)
            ),
            "axis's": z3.Implies(mode == AXIS_NEXT, z3.And(second, x == 1)),
            "not at a crossing": z3.Implies(
                z3.Or(mode == AXIS_NEXT, axis), z3.And(z3.Not(final), z3.Not(unit))
            ),
            "Y leads": z3.Implies(
                z3.And(running, z3.Not(second), mode == STEP), z3.Or(y - x < -2, ended)
            ),
            "to second": (state["to_second"] == 1) == octant,
            "mode": z3.Implies(mode != STEP, running),
            "X leads": z3.Implies(
                z3.And(running, second, mode == STEP, z3.Not(final)), z3.Or(x >= 2, unit)
            ),
            "X": z3.Implies(z3.And(running, z3.Not(ended)), x >= 1),
            "X leads, Y": z3.Implies(z3.And(running, second), y - x >= -1),
            "quadrant": z3.Implies(running, z3.And(x >= 0, y >= 0)),
            "unit": z3.Implies(
                z3.And(running, unit, z3.Not(final)), z3.And(x == 1, y == 0, second, e == -1)
            ),
            "unit, mode": z3.Implies(z3.And(unit, z3.Not(final)), mode == STEP),
            "last piece": z3.Implies(z3.Or(running, loading), final == (state["turns"] == 0)),
            "last crossing": z3.Implies(
                z3.Or(running, loading), (state["sole"] == 1) == (state["turns"] == 1)
            ),
            "idle": z3.Implies(z3.Not(running), z3.And(state["f"] == 0, axial == 1, diagonal == 0)),
            "nothing to load": z3.Implies(
                z3.Not(loading),
                z3.And(*(state[f"load_{k}"] == 0 for k in ("f", "axial", "diagonal"))),
            ),
            "loads E": z3.Implies(loading, state["load_f"] == signed),
            "loads axial": z3.Implies(loading, state["load_axial"] == own - 1),
            "loads diagonal": z3.Implies(loading, state["load_diagonal"] == y - x),
            "loads": z3.Implies(
                loading,
                z3.And(
                    *(x > 0, x < 2**n, y >= 0, y < 2**n),
                    second == z3.Or(y >= x, unit),
                    unit == z3.And(x == 1, y == 0),
                    e == z3.If(second, y - 2 * x + 1, 2 * y - x + 1),
                ),
            ),
            "one at a time": z3.Not(z3.And(running, loading)),
            "ends": z3.Implies(ended, z3.And(running, final)),
        }
        for a in "xy":
            moved = state[f"ko{a}"] + self._step(state, a)
            facts[f"near {a}"] = z3.Implies(state["near"] == 1, z3.And(moved >= -1, moved <= 1))
            facts["last"] = z3.Implies(
                z3.And(state["waiting"] == 1, state["last"] == 1), z3.Not(running)
            )
            facts[f"end {a}"] = z3.Implies(
                z3.And(state["waiting"] == 1, state["last"] == 1), moved == 0
            )
            facts[f"pulse {a}"] = z3.Implies(state["waiting"] == 0, state[f"pulse_{a}"] == 0)
        for stage in ("seen", "ready"):
            held = state[f"{stage}_held"] == 1
            sound = z3.And(state[f"{stage}_fault"] == 0, state[f"{stage}_empty"] == 0)
            facts[stage] = z3.Implies(
                z3.And(held, sound),
                z3.And(
                    state[f"{stage}_x"] > -(2**n),
                    state[f"{stage}_x"] <= 0,
                    state[f"{stage}_y"] - state[f"{stage}_x"] > 0,
                    state[f"{stage}_x"] < 0,
                ),
            )
        ready = state["ready_held"] == 1
        facts["ready diagonal"] = z3.Implies(
            ready, state["ready_diagonal"] == state["ready_y"] + state["ready_x"]
        )
        facts["ready unit"] = z3.Implies(
            ready,
            (state["ready_unit"] == 1) == z3.And(state["ready_x"] == -1, state["ready_y"] == 0),
        )
        for stage in ("seen", "ready"):
            held = state[f"{stage}_held"] == 1
            sound = z3.And(held, state[f"{stage}_fault"] == 0, state[f"{stage}_empty"] == 0)
            there = self._seen(
                *(-state[f"{stage}_x"], state[f"{stage}_y"]),
                state[f"{stage}_swap"] == 1,
                {a: state[f"{stage}_negative_{a}"] == 1 for a in "xy"},
            )
            for a in "xy":
                place = state[f"{stage}_end_{a}"] + state[f"{stage}_past_{a}"]
                away = self._way(place - ghosts[f"{stage}_{a}"])
                facts[f"{stage} place {a}"] = z3.Implies(sound, away == there[a])
        there = self._seen(
            *(x, y),
            state["lead"] == state["second"],
            {a: state[f"negative_{a}"] == 1 for a in "xy"},
        )
        for a in "xy":
            place = state[f"{a}k"] + state[f"ko{a}"] + self._step(state, a)
            loaded = state[f"load_end_{a}"] + state[f"load_past_{a}"]
            away = self._way(z3.If(loading, loaded, place) - ghosts[f"run_{a}"])
            facts[f"place {a}"] = z3.Implies(z3.Or(running, loading), away == there[a])
        coded = state["coded"] == 1
        for a in "xy":
            to = ~state[f"to_{a}"]
            facts[f"held to {a}"] = z3.Implies(
                state["held"] == 1, to == state[f"first_end_{a}"] - ghosts[f"first_{a}"]
            )
            facts[f"coded past {a}"] = z3.Implies(
                coded, state[f"first_past_{a}"] == self._way(state[f"from_{a}"] - to)
            )
        facts["coded"] = z3.Implies(coded, state["held"] == 1)
        codes = self.golden._code(dict(state))
        for name in ("quadrant", "minus_x", "minus_y", "at_center", "too_far"):
            facts[f"coded {name}"] = z3.Implies(coded, state[name] == codes[name])
        return facts

    def _seen(self, x, y, swap, negative: dict) -> dict[str, z3.BitVecRef]:
        """Give the point X, Y as the machine has it, from the centre: X falls and Y rises."""
        falls = {a: z3.If(negative[a], x, -x) for a in "xy"}
        rises = {a: z3.If(negative[a], -y, y) for a in "xy"}
        return {
            "x": self._way(z3.If(swap, rises["x"], falls["x"])),
            "y": self._way(z3.If(swap, falls["y"], rises["y"])),
        }

    def _way(self, value: z3.BitVecRef) -> z3.BitVecRef:
        """Take the low n + 2 bits as a signed number."""
        bits = self.golden.width + 2
        return z3.SignExt(self.bits - bits, z3.Extract(bits - 1, 0, value))

    def _step(self, state: dict, a: str) -> z3.BitVecRef:
        return self.golden.outputs(state)[f"steps_{a}"]

    def room(self, state: dict, ghosts: dict) -> list[z3.BoolRef]:
        """State how far an arc that fits may go, which the numbers' part shows."""
        n = self.golden.width
        x, y, e = (ghosts[name] for name in ("X", "Y", "E"))
        most = 2**n + 2 ** (n - 1)  # 1.5·2^n, more than √2·2^n
        running, second = state["running"] == 1, state["second"] == 1
        return [
            *(x <= most, y <= most, x >= 0, y >= 0),
            *(e < 2 ** (n + 2) - 2, e > 2 - 2 ** (n + 2)),
            # Half a step off a circle of radius 1 or more is not the centre; and where R² ≥ 2, from
            # (1, 0) the nearer point is (1, 1).
            z3.Implies(running, x + y > 0),
            z3.Implies(z3.And(running, x == 1, y == 0, z3.Not(second)), e < 0),
        ]

    def obligations(self) -> list[Obligation]:
        """Give the obligations."""
        golden, state, after = self.golden, self.state, self.after
        n = golden.width
        reset = {name: self.number(value) for name, value in golden.reset().items()}
        zero = dict.fromkeys(self.ghosts, self.number(0))
        known = self.invariant(state, self.ghosts)
        rooms = self.room(state, self.ghosts)
        rooms_after = self.room(after, self.ghosts_after)
        everything = [*known.values(), *rooms]
        outputs, later = golden.outputs(state), golden.outputs(after)
        take = z3.And(state["ready_held"] == 1, after["ready_held"] == 0)
        still = z3.Or(state["ready_empty"] == 1, state["ready_fault"] != 0)
        answered = z3.And(self.taken, state["last"] == 1)
        emptied = z3.And(take, state["ready_empty"] == 1, state["ready_fault"] == 0)
        refused = z3.And(take, state["ready_fault"] != 0)
        late = z3.And(self.free, self.missed)
        moved = {
            a: z3.If(
                z3.And(self.free, self.loading),
                self._wrapped(state[f"load_end_{a}"] + state[f"load_past_{a}"]),
                self._wrapped(
                    outputs[f"position_{a}"]
                    + z3.If(self.taken, outputs[f"steps_{a}"], self.number(0))
                ),
            )
            for a in "xy"
        }
        core = [
            name for name in after if name not in (*golden.prepared_registers(), "done", "error")
        ]
        lasting = ["f", "axial", "diagonal", "mode", "second", "turns", "lead", "running"]
        lasting += ["loading", "waiting", "pulse_x", "pulse_y", "kox", "koy", "xk", "yk"]
        unmoved = same({name: after[name] for name in core}, state)
        survives = self.invariant(after, self.ghosts_after)
        return [
            self.obligation("invariant: it holds after reset", [], self.invariant(reset, zero)),
            self.obligation(
                "invariant: E, with its sign complemented while X leads, is what the circle's "
                "equation says of X, Y; axial = Y + 1 or 1 − X, diagonal = Y − X + 2, but for the "
                "clock of a change; the position, with the step that waits, is the centre ± X, Y: "
                "so it is after every clock",
                [*everything, *rooms_after],
                {name: fact for name, fact in survives.items() if not _prepares(name)},
            ),
            self.obligation(
                "invariant: a block that is prepared begins in the first quadrant turned to that "
                "of its start, at centre ± XH, YH: likewise",
                [fact for name, fact in known.items() if _prepares(name)],
                {name: fact for name, fact in survives.items() if _prepares(name)},
            ),
            self.obligation(
                "choice: a step is diagonal when E ≥ 0 while Y leads, when E < 0 while X leads; "
                "the axis that leads moves with every step",
                [*everything, self.free, self.goes],
                {
                    "x": (after["pulse_x"] == 1) == z3.Or(self.on_diagonal, state["lead"] == 0),
                    "y": (after["pulse_y"] == 1) == z3.Or(self.on_diagonal, state["lead"] == 1),
                },
            ),
            self.obligation(
                "extra clock: at most one before a change, none before another step",
                [*everything, self.free, self.running, z3.Not(self.ends)],
                {
                    "prepares": z3.Implies(self.prepares, after["mode"] == CHANGE),
                    "step": z3.Implies(z3.Not(self.prepares), after["waiting"] == 1),
                    "twice": z3.Implies(after["mode"] == CHANGE, self.prepares),
                },
            ),
            self.obligation(
                "end: when an arc is done its end point is reached exactly",
                [*everything, answered],
                {"done": after["done"] == 1}
                | {
                    a: self._wrapped(outputs[f"position_{a}"] + outputs[f"steps_{a}"])
                    == state[f"{a}k"]
                    for a in "xy"
                },
            ),
            self.obligation(
                "end: in the last piece a point no farther than a step from the end on each axis "
                "is left for the end itself",
                [*everything, self.free, self.near],
                {
                    "last": after["last"] == 1,
                    "ends": after["running"] == 0,
                    **{f"{a}": after[f"ko{a}"] + self._step(after, a) == 0 for a in "xy"},
                },
            ),
            self.obligation(
                "end: an arc whose end is missed ends where X is 0 at the latest, late and with "
                "OFF_CURVE",
                [*everything, self.free, self.running, self.ghosts["X"] <= 0],
                {
                    "ends": after["running"] == 0,
                    "told": z3.Or(self.near, after["error"] == OFF_CURVE),
                },
            ),
            self.obligation(
                "it always ends: every step that is not the last one moves Y on, or X, or turns "
                "the frame with one crossing less",
                [*everything, self.free, self.goes],
                {
                    "steps": z3.Or(
                        z3.And(
                            after["turns"] == state["turns"],
                            self.ghosts_after["X"] <= self.ghosts["X"],
                            self.ghosts_after["Y"] >= self.ghosts["Y"],
                            self.ghosts_after["Y"] - self.ghosts_after["X"]
                            > self.ghosts["Y"] - self.ghosts["X"],
                        ),
                        z3.And(self.crosses, after["turns"] == state["turns"] - 1),
                    )
                },
            ),
            self.obligation(
                "position: changes by just the step that is taken, one at most an axis, and by "
                "loading a block's start",
                [*known.values()],
                {a: later[f"position_{a}"] == moved[a] for a in "xy"},
            ),
            self.obligation(
                "answer: done or error just one clock after a last step is taken, a block without "
                "a step is looked at or an end is missed, and never two of these in one clock",
                [*known.values()],
                {
                    "done": (after["done"] == 1) == z3.Or(answered, emptied),
                    "error": after["error"]
                    == z3.If(
                        late,
                        self.number(OFF_CURVE),
                        z3.If(refused, state["ready_fault"], self.number(0)),
                    ),
                    "one": z3.AtMost(answered, emptied, refused, late, 1),
                },
            ),
            self.obligation(
                "rejected: a block with a fault, or of no length, moves nothing",
                [take, still, *known.values()],
                {name: unmoved[name] for name in lasting},
            ),
            self.obligation(
                "stall: a step that is not taken stays, and no register of the arc moves",
                [state["waiting"] == 1, z3.Not(self.taken)],
                unmoved
                | {f"steps {a}": later[f"steps_{a}"] == outputs[f"steps_{a}"] for a in "xy"},
            ),
            self.obligation(
                "no gap: a prepared block is begun with the last step of the one before it, and "
                "runs in the clock after the next",
                [*known.values(), self.free, z3.Not(still), state["ready_held"] == 1],
                {
                    "begun": z3.Implies(z3.And(self.running, self.near), after["loading"] == 1),
                    "run": z3.Implies(self.loading, after["running"] == 1),
                },
            ),
            self.obligation(
                f"room: E takes n + 3 = {n + 3} bits where |E| ≤ 2R + 2 and R ≤ (2^n − 1)·√2; X "
                "and Y are less than 1.5·2^n",
                [],
                {
                    "E": z3.BoolVal(8 * (2**n - 1) ** 2 < (2 ** (n + 2) - 5) ** 2),
                    "X, Y": z3.BoolVal(8 * (2**n - 1) ** 2 < (3 * 2**n - 1) ** 2),
                },
            ),
        ]

    def _wrapped(self, value: z3.BitVecRef) -> z3.BitVecRef:
        """Take the low n + 1 bits as a signed number."""
        bits = self.golden.width + 1
        return z3.SignExt(self.bits - bits, z3.Extract(bits - 1, 0, value))


def _numbers() -> list[Obligation]:
    """What E is, and how far a step can lead off the circle."""
    x, y, square = z3.Ints("X Y R²")

    def f(x, y):
        return x * x + y * y - square

    def first(x, y):
        return f(x, y) + 2 * y - x + 1

    def second(x, y):
        return f(x, y) - 2 * x + y + 1

    identities = [
        2 * first(x, y) + 1 == f(x, y + 1) + f(x - 1, y + 1),
        2 * second(x, y) + 1 == f(x - 1, y) + f(x - 1, y + 1),
        first(x, y + 1) == first(x, y) + 2 * y + 3,
        first(x - 1, y + 1) == first(x, y) + 2 * (y - x) + 5,
        second(x - 1, y) == second(x, y) + 3 - 2 * x,
        second(x - 1, y + 1) == second(x, y) + 2 * (y - x) + 5,
        second(x, y) == first(x, y) - x - y,
        z3.Implies(x == 0, first(y, 0) == second(x, y) - 2 * y),
        z3.Implies(square >= 2, first(z3.IntVal(1), z3.IntVal(0)) < 0),
        z3.Implies(square == x * x + y * y, first(x, y) == 2 * y - x + 1),
        z3.Implies(square == x * x + y * y, second(x, y) == y - 2 * x + 1),
    ]
    return [
        Obligation(
            "numbers: 2E + 1 is the sum of F at both candidates; what E grows by is that of its "
            "octant, and what it changes by where that changes and where the frame is turned",
            [],
            identities,
            True,
        ),
        *_half_step(),
    ]


def _half_step() -> list[Obligation]:
    """No step leads half a step off the circle, if the one before did not."""
    x, y, r = z3.Reals("X Y R")
    residual = x * x + y * y - r * r
    quarter = z3.RealVal("1/4")

    def within(value):
        # |√(R² + F) − R| < 1/2, squared.
        return z3.And(value < r + quarter, -value < r - quarter)

    axial_1 = residual + 2 * y + 1
    axial_2 = residual - 2 * x + 1
    slanting = residual + 2 * (y - x) + 2
    common = [r >= 1, x >= 1, y >= 0, within(residual)]
    claims = []
    for first, axial, octant in ((True, axial_1, y <= x - 1), (False, axial_2, y >= x - 1)):
        low = axial + slanting
        # F is whole, and the sum of both is odd: it is 1 or more, or −1 or less.
        picks = low >= 1 if first else low <= -1
        leaves = low <= -1 if first else low >= 1
        which = "Y" if first else "X"
        claims.append(
            Obligation(
                f"half a step: while {which} leads, no step leads from a point less than half a "
                "step off the circle to one that is half a step off or more",
                [*common, octant],
                [
                    z3.Implies(picks, within(slanting)),
                    z3.Implies(leaves, within(axial)),
                ],
                True,
            )
        )
    square = x * x + y * y == r * r + residual
    sizes = []
    for octant, value in (
        (z3.And(y >= 0, y <= x - 1), residual + 2 * y - x + 1),
        (z3.And(y >= x - 1, x >= 0, y >= 0), residual - 2 * x + y + 1),
    ):
        near = [r >= 1, within(residual), square, octant]
        sizes += [
            z3.Implies(z3.And(*near), fact)
            for fact in (
                *(x <= r + 0.5, y <= r + 0.5, x + y > 0),
                *(value <= 2 * r + 2, value >= -2 * r - 2),
            )
        ]
    claims.append(
        Obligation(
            "room: less than half a step off the circle, |E| ≤ 2R + 2, and X and Y are at most "
            "R + 1/2 and not both 0",
            [],
            sizes,
            True,
        )
    )
    return claims


def _prepared(golden: ExactArc) -> Exhaustive:
    """Check the preparation of every arc of a small width."""
    n = golden.width
    side = np.arange(-(2**n), 2**n)
    start = np.stack(np.meshgrid(side, side, [0, 1], indexing="ij"), axis=-1).reshape(-1, 3)
    title = f"prepared: crossings and faults of all {len(start) * len(side) ** 2} arcs"

    def search() -> str:
        for u in side:
            for v in side:
                blocks = np.zeros((len(start), 8), dtype=np.int64)
                blocks[:, :2], blocks[:, 6] = start[:, :2], start[:, 2]
                blocks[:, 2:4] = u, v
                inputs = {f"blocks_{k}": blocks[:, i] for i, k in enumerate(_INPUTS)}
                inputs |= {"blocks_clockwise": blocks[:, 6], "blocks_full_turns": blocks[:, 7]}
                state = golden._receive(inputs)
                state |= golden._code(state)
                seen = golden._see(state)
                far = np.any(np.abs(blocks[:, :4]) == 2**n, axis=1)
                zero = ~np.any(blocks[:, :2], axis=1)
                empty = is_empty(blocks)
                fault = np.where(far, RANGE, np.where(zero & ~empty, OFF_CURVE, 0))
                wrong = seen["seen_fault"] != fault
                turns = crossings(blocks)
                told = seen["seen_turns"] + 4 * seen["seen_round"]
                wrong |= (fault == 0) & ~empty & (told != turns) & ahead_known(blocks)
                if wrong.any():
                    return str(blocks[wrong.argmax()].tolist())
        return ""

    def ahead_known(blocks: np.ndarray) -> np.ndarray:
        squares = [np.sum(blocks[:, k : k + 2] ** 2, axis=1) for k in (0, 2)]
        apart = np.abs(squares[0] - squares[1]) - 1
        return (apart <= 0) | (apart**2 <= 4 * np.minimum(*squares))

    return Exhaustive(title, search)
