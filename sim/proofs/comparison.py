"""Promises of the comparison line, proven for every block at a given width.

They are shown of the golden model's own source, which the device is proven equal to. Two kinds:

- about the registers, in bit-vectors: an invariant is shown to hold after reset and to survive
  every clock from every state that satisfies it, whatever the inputs; the promises follow from it.
  A few ghost values remember what the registers forget: where the running block began (``begin``)
  and ends (``end``), and where the prepared one ends (``next_end``);
- about numbers, in integers and reals, where lengths are multiplied. What the bit-vectors take over
  from there is :func:`_meant`: the axis that is to step has steps left.

Notation as in the documents: ΔX, ΔY the lengths (P1, P2), KOX, KOY the steps left (P5, P6), x = ΔX
− KOX and y = ΔY − KOY the steps put out; S the one summator, or of two SX − SY.
"""

from dataclasses import dataclass

import z3

from discreta.sim.golden.comparison import Comparison
from discreta.sim.golden.logic import Value, negate
from discreta.sim.smt import Obligation, extend, same, symbols

__all__ = ["promises", "shared"]


def shared(golden: Comparison) -> list[Obligation]:
    """Give what is promised of both forms together: they put out the same steps."""
    return [obligation for first in ("x", "y") for obligation in _same_steps(golden.width, first)]


def promises(golden: Comparison) -> list[Obligation]:
    """Give everything that is promised of the comparison line."""
    return _Registers(golden).obligations() + _numbers(golden)


def _difference(state: dict) -> Value:
    """Give S, or SX − SY."""
    return state["s"] if "s" in state else state["sx"] - state["sy"]


def _x_turn(state: dict, first: str) -> z3.BoolRef:
    """State that x is the axis that steps next, by the article's rule."""
    s, dx, dy = _difference(state), state["p1"], state["p2"]
    return z3.Or(s < 0, z3.And(s == 0, dx >= dy if first == "x" else dx > dy))


def _meant(state: dict, first: str) -> z3.BoolRef:
    """State that an axis without steps left does not step before the other one has none either.

    It follows from S = x·ΔY − y·ΔX, as the obligations about numbers show.
    """
    turn, left_x, left_y = _x_turn(state, first), state["p5"], state["p6"]
    return z3.And(
        z3.Implies(z3.And(left_x == 0, left_y != 0), z3.Not(turn)),
        z3.Implies(z3.And(left_y == 0, left_x != 0), turn),
    )


def _kept(state: dict, golden: Comparison) -> dict[str, z3.BoolRef]:
    """State how far the summators are, of which the distance from the line follows."""
    s, dx, dy = _difference(state), state["p1"], state["p2"]
    put_out = {"sx": dx - state["p5"], "sy": dy - state["p6"]}
    facts = {
        "S is at least −ΔX and at most ΔY": z3.And(s >= -dx, s <= dy),
        "S is ΔY only if y is not longer": z3.Implies(s == dy, dx >= dy),
        "S is −ΔX only if x is not longer": z3.Implies(s == -dx, dy >= dx),
        "at 45° S is 0 or that of the first step": z3.Implies(
            dx == dy, z3.Or(s == 0, s == (dy if golden.first == "x" else -dx))
        ),
        "no more steps are left than there are": z3.And(state["p5"] <= dx, state["p6"] <= dy),
        "УУ runs exactly while steps are left": (state["running"] == 1)
        == z3.Or(state["p5"] != 0, state["p6"] != 0),
    }
    if golden.form == "two":
        # x·ΔY ≤ x·(2^n − 1): far enough from 2^2n for the next sum.
        facts |= {
            f"{name.upper()} has room": state[name] <= (steps << golden.width) - steps
            for name, steps in put_out.items()
        }
    return facts


def _wide(golden: Comparison) -> int:
    """Give how many bits no sum wraps."""
    return (2 * golden.width if golden.form == "two" else golden.width) + 4


def _inputs(golden: Comparison, wide: int) -> dict[str, Value]:
    kinds = {
        f"blocks_{which}_{a}": (golden.width + 1, True) for which in ("start", "end") for a in "xy"
    }
    return symbols(kinds | dict.fromkeys(("blocks_valid", "steps_ready"), (1, False)), wide)


def _same_steps(width: int, first: str) -> list[Obligation]:
    """State that the machines of both forms, clocked together, stay alike."""
    two, one = (Comparison(width, form, first) for form in ("two", "signed"))
    wide = _wide(two)
    inputs = _inputs(two, wide)
    state = symbols(two.registers(), wide)
    # The frame's registers are the same, and S is the difference.
    other = {name: state[name] for name in one.registers() if name != "s"}
    other |= symbols(one.sums(), wide)
    known = [*_kept(state, two).values(), _meant(state, first), other["s"] == _difference(state)]
    after, other_after = two.step(state, inputs), one.step(other, inputs)
    frame = [name for name in other if name != "s"]
    reset = {name: z3.BitVecVal(value, wide) for name, value in two.reset().items()}
    other_reset = {name: z3.BitVecVal(value, wide) for name, value in one.reset().items()}
    title = f"both forms, first {first}: "
    return [
        Obligation(
            f"{title}after reset S = SX − SY and all other registers are the same",
            [],
            {
                **_kept(reset, two),
                "S = SX − SY": other_reset["s"] == _difference(reset),
                **same({name: reset[name] for name in frame}, other_reset),
            },
        ),
        Obligation(
            f"{title}every clock leaves S = SX − SY and all other registers the same, whatever the "
            "inputs",
            known,
            {
                **_kept(after, two),
                "S = SX − SY": other_after["s"] == _difference(after),
                **same({name: after[name] for name in frame}, other_after),
            },
        ),
        Obligation(
            f"{title}all outputs are the same, so the steps are, clock by clock",
            known,
            same(two.outputs(state), one.outputs(other)),
        ),
    ]


@dataclass
class _Axis:
    """One axis of a state, with its ghosts; all wide bit-vectors."""

    increment: Value
    position: Value
    left: Value
    pulse: Value
    direction: Value
    start: Value
    delta: Value
    negative: Value
    begin: Value
    end: Value
    next_end: Value

    def put_out(self) -> Value:
        return self.increment - self.left


class _Registers:
    """What is promised of the registers, in bit-vectors."""

    def __init__(self, golden: Comparison):
        self.golden = golden
        n = golden.width
        self.wide = _wide(golden)
        self.state = symbols(golden.registers(), self.wide)
        self.inputs = _inputs(golden, self.wide)
        self.ghosts: dict[str, Value] = {
            f"{ghost}_{a}": extend(z3.BitVec(f"ghost.{ghost}_{a}", n + 1), True, self.wide)
            for ghost in ("begin", "end", "next_end")
            for a in "xy"
        }

        self.outputs = golden.outputs(self.state)
        free = negate(self.outputs["steps_valid"]) | self.inputs["steps_ready"]
        self.waiting = self.outputs["steps_valid"] == 1
        self.fault = self.state["fault"] != 0
        self.empty = z3.And([self.state[f"delta_{a}"] == 0 for a in "xy"])
        self.nothing = z3.Or(self.fault, self.empty)
        self.start = z3.And(
            self.state["pending"] == 1,
            self.state["running"] == 0,
            z3.If(self.nothing, z3.Not(self.waiting), free == 1),
        )
        self.load = z3.And(self.start, z3.Not(self.fault))
        self.sums = z3.And(self.state["running"] == 1, free == 1)
        self.accept = z3.And(self.inputs["blocks_valid"] == 1, self.outputs["blocks_ready"] == 1)
        self.taken = z3.And(self.waiting, self.inputs["steps_ready"] == 1)

        self.after = golden.step(self.state, self.inputs)
        ghosts, state = self.ghosts, self.state
        self.ghosts_after: dict[str, Value] = {}
        for a in "xy":
            self.ghosts_after |= {
                f"begin_{a}": z3.If(self.load, state[f"start_{a}"], ghosts[f"begin_{a}"]),
                f"end_{a}": z3.If(self.load, ghosts[f"next_end_{a}"], ghosts[f"end_{a}"]),
                f"next_end_{a}": z3.If(
                    self.accept, self.inputs[f"blocks_end_{a}"], ghosts[f"next_end_{a}"]
                ),
            }

    def axes(self, state: dict, ghosts: dict) -> list[_Axis]:
        return [
            _Axis(
                *(state[name] for name in self.golden.places(a)),
                *(state[f"{k}_{a}"] for k in ("pulse", "direction", "start", "delta", "negative")),
                *(ghosts[f"{k}_{a}"] for k in ("begin", "end", "next_end")),
            )
            for a in "xy"
        ]

    def invariant(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        axes = self.axes(state, ghosts)
        too_long = [_magnitude(axis.next_end - axis.start) >= 2**self.golden.width for axis in axes]
        facts = _kept(state, self.golden)
        facts |= {
            "a prepared block is rejected exactly when an axis is too long": state["fault"]
            == z3.If(z3.Or(too_long), z3.BitVecVal(1, self.wide), z3.BitVecVal(0, self.wide)),
            "a step of one axis waits, not of two": state["pulse_x"] + state["pulse_y"] <= 1,
        }
        for a, axis in zip("xy", axes, strict=True):
            facts |= {
                f"a step of {a} waits only if one was put out": axis.pulse <= axis.put_out(),
                f"the length of {a} leads to the end": axis.end
                == axis.begin + _signed(axis.direction, axis.increment),
                f"what is left of {a} leads to the end": axis.end
                == axis.position + _signed(axis.direction, axis.left + axis.pulse),
                f"the next length of {a} leads to the next end": z3.Implies(
                    state["fault"] == 0,
                    axis.next_end == axis.start + _signed(axis.negative, axis.delta),
                ),
            }
        return facts

    def obligations(self) -> list[Obligation]:
        golden, outputs = self.golden, self.outputs
        before, after = self.axes(self.state, self.ghosts), self.axes(self.after, self.ghosts_after)
        known = [
            *self.invariant(self.state, self.ghosts).values(),
            _meant(self.state, golden.first),
        ]
        reset = {name: z3.BitVecVal(value, self.wide) for name, value in golden.reset().items()}
        zero = dict.fromkeys(self.ghosts, z3.BitVecVal(0, self.wide))
        pairs = list(zip("xy", before, after, strict=True))
        ended = z3.And(self.taken, outputs["steps_last"] == 1)
        emptied = z3.And(self.load, self.empty)
        rejected = z3.And(self.start, self.fault)
        idle = z3.And(self.state["running"] == 0, self.state["pending"] == 1)
        left, left_after = (axes[0].left + axes[1].left for axes in (before, after))
        turn = _x_turn(self.state, golden.first)
        s, s_after = _difference(self.state), _difference(self.after)
        return [
            Obligation(
                "invariant: holds after reset",
                [],
                self.invariant(reset, zero),
            ),
            Obligation(
                "invariant: survives every clock, whatever the inputs",
                known,
                self.invariant(self.after, self.ghosts_after),
            ),
            Obligation(
                "start: the sums are 0, and every axis has its whole length to go",
                [*known, self.load],
                [
                    *[self.after[name] == 0 for name in golden.sums()],
                    *[
                        z3.And(axis.left == old.delta, axis.increment == old.delta)
                        for _, old, axis in pairs
                    ],
                ],
            ),
            Obligation(
                "rule: every summation is a step of the axis that the article's rule tells, which "
                "has steps left; S gains ΔY by a step of x and loses ΔX by one of y",
                [*known, self.sums],
                {
                    "x steps": (before[0].left - after[0].left == 1) == turn,
                    "y steps": (before[1].left - after[1].left == 1) == z3.Not(turn),
                    "S": s_after == s + z3.If(turn, self.state["p2"], -self.state["p1"]),
                },
            ),
            Obligation(
                "S and the steps left change by a summation or by starting a block alone",
                [*known, z3.Not(self.sums), z3.Not(self.load)],
                [s_after == s, *[new.left == old.left for _, old, new in pairs]],
            ),
            Obligation(
                "one axis a clock: every summation is one step that waits, and only of one axis",
                [*known, self.sums],
                {
                    "one": self.after["pulse_x"] + self.after["pulse_y"] == 1,
                    **{
                        f"the one put out, {a}": new.pulse == old.left - new.left
                        for a, old, new in pairs
                    },
                },
            ),
            Obligation(
                "one axis a clock: a step is of one axis, by 1 either way",
                [*known, outputs["steps_valid"] == 1],
                [_magnitude(outputs["steps_x"]) + _magnitude(outputs["steps_y"]) == 1],
            ),
            Obligation(
                "position: changes by just the step that is taken, and by loading a block's start",
                known,
                [
                    new.position
                    == z3.If(
                        self.load,
                        old.start,
                        old.position + z3.If(self.taken, outputs[f"steps_{a}"], 0),
                    )
                    for a, old, new in pairs
                ],
            ),
            Obligation(
                "stall: a step that is not taken stays, and no register of the block moves",
                [*known, self.waiting, z3.Not(self.taken)],
                same({name: self.after[name] for name in self.moving()}, self.state)
                | same(
                    {f"steps_{a}": outputs[f"steps_{a}"] for a in "xy"},
                    golden.outputs(self.after),
                ),
            ),
            Obligation(
                "end: when a block is done its end point is reached exactly",
                [*known, ended],
                [
                    self.after["done"] == 1,
                    *[old.position + outputs[f"steps_{a}"] == old.end for a, old, _ in pairs],
                ],
            ),
            Obligation(
                "it always ends: KOX + KOY starts from ΔX + ΔY and falls by just 1 with every "
                "summation, and a block runs until it is 0: so there are just ΔX + ΔY of them",
                known,
                {
                    "start": z3.Implies(
                        self.load,
                        left_after == self.state["delta_x"] + self.state["delta_y"],
                    ),
                    "summation": z3.Implies(self.sums, left_after == left - 1),
                    "none": z3.Implies(z3.Not(z3.Or(self.load, self.sums)), left_after == left),
                    "end": (self.state["running"] == 1) == (left != 0),
                },
            ),
            Obligation(
                "answer: done or error just one clock after a last step is taken, a block of no "
                "length is started or a block is rejected, and never two of these in one clock",
                known,
                [
                    (self.after["done"] == 1) == z3.Or(ended, emptied),
                    (self.after["error"] == 1) == rejected,
                    z3.AtMost(ended, emptied, rejected, 1),
                ],
            ),
            Obligation(
                "rejected: a block that is too long moves nothing",
                [*known, rejected],
                same({name: self.after[name] for name in [*self.moving(), "running"]}, self.state),
            ),
            Obligation(
                "progress: every clock of a block sums unless its step waits untaken, and the next "
                "block starts in the clock in which the last step is taken",
                [*known, z3.Or(z3.Not(self.waiting), self.taken)],
                [
                    z3.Implies(self.state["running"] == 1, self.sums),
                    z3.Implies(z3.And(idle, z3.Not(self.nothing)), self.start),
                    z3.Implies(z3.And(idle, z3.Not(self.waiting)), self.start),
                ],
            ),
        ]

    def moving(self) -> list[str]:
        """Name the registers that a running block changes."""
        names = [name for a in "xy" for name in (*self.golden.places(a), f"pulse_{a}")]
        return [*names, *self.golden.sums()]


def _magnitude(value: Value) -> Value:
    return z3.If(value < 0, -value, value)


def _signed(negative: Value, value: Value) -> Value:
    return z3.If(negative == 1, -value, value)


def _numbers(golden: Comparison) -> list[Obligation]:
    """What follows for numbers: which axis can step, and how far from the line it leads.

    From "start", "rule" and the invariant above.
    """
    dx, dy, x, y, s = z3.Ints("ΔX ΔY x y S")
    inside = [x >= 0, x <= dx, y >= 0, y <= dy]
    summed = s == x * dy - y * dx
    left = z3.Or(x < dx, y < dy)
    turn = z3.Or(s < 0, z3.And(s == 0, dx >= dy if golden.first == "x" else dx > dy))
    a, b, u, v, cross = z3.Reals("ΔX ΔY x y S")
    kept = [
        *[a >= 0, b >= 0, a + b > 0, cross >= -a, cross <= b],
        z3.Implies(cross == b, a >= b),
        z3.Implies(cross == -a, b >= a),
    ]
    side = cross >= 0 if golden.first == "x" else cross <= 0
    below = "below" if golden.first == "x" else "above"
    return [
        Obligation(
            "numbers: S = x·ΔY − y·ΔX holds at the start, at the end, and from step to step",
            [],
            [
                0 * dy - 0 * dx == 0,
                dx * dy - dy * dx == 0,
                z3.Implies(summed, s + dy == (x + 1) * dy - y * dx),
                z3.Implies(summed, s - dx == x * dy - (y + 1) * dx),
            ],
            True,
        ),
        Obligation(
            "numbers: until both axes have none left, the axis that is to step has steps left",
            [summed, *inside, left],
            [z3.Implies(turn, x < dx), z3.Implies(z3.Not(turn), y < dy)],
            True,
        ),
        Obligation(
            "distance: S / √(ΔX² + ΔY²) is the distance from the line, downwards",
            [cross == u * b - v * a, a + b > 0],
            # The foot of the perpendicular from (x, y), from there by S along (−ΔY, ΔX).
            [
                (u * (a * a + b * b) - b * cross) * b == (v * (a * a + b * b) + a * cross) * a,
            ],
            True,
        ),
        Obligation(
            "distance: off the line by less than 1 step",
            kept,
            [cross * cross < a * a + b * b],
            True,
        ),
        Obligation(
            f"distance: at 45° on the line, or off it by √½ step {below} it",
            [*kept, a == b, z3.Or(cross == 0, cross == (b if golden.first == "x" else -a))],
            [side, z3.Or(cross == 0, 2 * cross * cross == a * a + b * b)],
            True,
        ),
    ]
