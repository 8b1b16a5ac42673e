"""Promises of the linear interpolator, proven for every block at a given width.

They are shown of the golden model's own source, which the device is proven equal to. Two kinds:

- about the registers, in bit-vectors: an invariant is shown to hold after reset and to survive
every
  clock from every state that satisfies it, whatever the inputs; the promises follow from it. A few
  ghost values remember what the registers forget: where the running block began (``begin``), ends
  (``end``) and how long it is (``length``), and where the prepared one ends (``next_end``);
- about numbers, in integers and reals: what these promises amount to after t summations.

Notation as in the documents: M = 2^n, P the (normalized) increment of an axis, KO its steps left, S
its sum, and x = length − KO, the steps it has put out.
"""

from dataclasses import dataclass

import z3

from discreta.sim.golden.linear import Linear
from discreta.sim.golden.logic import Value, negate
from discreta.sim.smt import Obligation, extend, same, symbols

__all__ = ["promises"]


def promises(golden: Linear) -> list[Obligation]:
    """Give everything that is promised of the linear interpolator."""
    return _Registers(golden).obligations() + _numbers(golden)


@dataclass
class _Axis:
    """One axis of a state, with its ghosts; all wide bit-vectors."""

    increment: Value
    position: Value
    left: Value
    total: Value
    pulse: Value
    direction: Value
    start: Value
    delta: Value
    negative: Value
    begin: Value
    end: Value
    length: Value
    next_end: Value

    def put_out(self) -> Value:
        return self.length - self.left


class _Registers:
    """What is promised of the registers, in bit-vectors."""

    def __init__(self, golden: Linear):
        self.golden = golden
        n = golden.width
        self.modulus = 2**n
        self.wide = n + 4
        self.state = symbols(golden.registers(), self.wide)
        coordinates = {
            f"blocks_{which}_{a}": (n + 1, True)
            for which in ("start", "end")
            for a in golden.letters
        }
        flags = dict.fromkeys(("blocks_valid", "steps_ready"), (1, False))
        self.inputs = symbols(coordinates | flags, self.wide)
        self.ghosts: dict[str, Value] = {}
        for a in golden.letters:
            for ghost in ("begin", "end", "next_end"):
                self.ghosts[f"{ghost}_{a}"] = extend(
                    z3.BitVec(f"ghost.{ghost}_{a}", n + 1), True, self.wide
                )
            self.ghosts[f"length_{a}"] = extend(z3.BitVec(f"ghost.length_{a}", n), False, self.wide)

        outputs = golden.outputs(self.state)
        free = negate(outputs["steps_valid"]) | self.inputs["steps_ready"]
        self.waiting = outputs["steps_valid"] == 1
        self.fault = self.state["fault"] != 0
        self.empty = z3.And([self.state[f"delta_{a}"] == 0 for a in golden.letters])
        self.nothing = z3.Or(self.fault, self.empty)
        self.start = z3.And(
            self.state["pending"] == 1,
            self.state["running"] == 0,
            z3.If(self.nothing, z3.Not(self.waiting), free == 1),
        )
        self.load = z3.And(self.start, z3.Not(self.fault))
        self.sums = z3.And(self.state["running"] == 1, free == 1)
        self.accept = z3.And(self.inputs["blocks_valid"] == 1, outputs["blocks_ready"] == 1)
        self.taken = z3.And(self.waiting, self.inputs["steps_ready"] == 1)

        self.after = golden.step(self.state, self.inputs)
        self.ghosts_after: dict[str, Value] = {}
        for a in golden.letters:
            ghosts, state = self.ghosts, self.state
            self.ghosts_after |= {
                f"begin_{a}": z3.If(self.load, state[f"start_{a}"], ghosts[f"begin_{a}"]),
                f"end_{a}": z3.If(self.load, ghosts[f"next_end_{a}"], ghosts[f"end_{a}"]),
                f"length_{a}": z3.If(self.load, state[f"delta_{a}"], ghosts[f"length_{a}"]),
                f"next_end_{a}": z3.If(
                    self.accept, self.inputs[f"blocks_end_{a}"], ghosts[f"next_end_{a}"]
                ),
            }

    def axes(self, state: dict, ghosts: dict) -> list[_Axis]:
        axes = []
        for a in self.golden.letters:
            increment, position, left, total = self.golden.names(a)
            axes.append(
                _Axis(
                    *(state[name] for name in (increment, position, left, total)),
                    *(
                        state[f"{k}_{a}"]
                        for k in ("pulse", "direction", "start", "delta", "negative")
                    ),
                    *(ghosts[f"{k}_{a}"] for k in ("begin", "end", "length", "next_end")),
                )
            )
        return axes

    def invariant(self, state: dict, ghosts: dict) -> list[z3.BoolRef]:
        axes = self.axes(state, ghosts)
        some_left = z3.Or([axis.left != 0 for axis in axes])
        facts = [
            # УУ runs exactly while steps are left to be summed.
            (state["running"] == 1) == some_left,
            # A prepared block is rejected exactly when an axis is too long.
            state["fault"]
            == z3.If(
                z3.Or([_magnitude(axis.next_end - axis.start) >= self.modulus for axis in axes]),
                z3.BitVecVal(1, self.wide),
                z3.BitVecVal(0, self.wide),
            ),
            self.scaled(axes),
        ]
        for axis in axes:
            facts += [
                axis.left <= axis.length,
                axis.pulse <= axis.put_out(),
                axis.end == axis.begin + _signed(axis.direction, axis.length),
                # Shorter for the solver than the same said from the beginning: ± (x − pulse).
                axis.end == axis.position + _signed(axis.direction, axis.left + axis.pulse),
                z3.Implies(
                    state["fault"] == 0,
                    axis.next_end == axis.start + _signed(axis.negative, axis.delta),
                ),
            ]
        return facts

    def scaled(self, axes: list[_Axis]) -> z3.BoolRef:
        """State that the increments are the lengths times one power of two, and the best one."""
        n = self.golden.width
        if not self.golden.normalize:
            return z3.And([axis.increment == axis.length for axis in axes])
        top = z3.Or([axis.increment >= 2 ** (n - 1) for axis in axes])
        nothing = z3.And([axis.length == 0 for axis in axes])
        return z3.And(
            z3.Or(top, nothing),
            z3.Or(
                [
                    z3.And([axis.increment == axis.length << shift for axis in axes])
                    for shift in range(n)
                ]
            ),
        )

    def obligations(self) -> list[Obligation]:
        before, after = self.axes(self.state, self.ghosts), self.axes(self.after, self.ghosts_after)
        inv = z3.And(self.invariant(self.state, self.ghosts))
        reset = {
            name: z3.BitVecVal(value, self.wide) for name, value in self.golden.reset().items()
        }
        zero = dict.fromkeys(self.ghosts, z3.BitVecVal(0, self.wide))
        outputs = self.golden.outputs(self.state)
        letters = self.golden.letters
        pairs = list(zip(before, after, strict=True))
        initial = self.golden.initial_sum
        ended = z3.And(self.taken, outputs["steps_last"] == 1)
        emptied = z3.And(self.load, self.empty)
        rejected = z3.And(self.start, self.fault)
        idle = z3.And(self.state["running"] == 0, self.state["pending"] == 1)
        return [
            Obligation("invariant: holds after reset", [], self.invariant(reset, zero)),
            Obligation(
                "invariant: survives every clock, whatever the inputs",
                [inv],
                self.invariant(self.after, self.ghosts_after),
            ),
            Obligation(
                "start: every sum is the preload, every axis has its whole length to go, "
                + (
                    "increments share one power of two with a top bit set"
                    if self.golden.normalize
                    else "increments are the lengths"
                ),
                [inv, self.load],
                [
                    self.scaled(after),
                    *[axis.total == initial for axis in after],
                    *[axis.left == axis.length for axis in after],
                ],
            ),
            Obligation(
                "summation: an axis with steps left gains just P in M·x + S, one without keeps it",
                [inv, z3.Not(self.load)],
                [
                    self.added(new)
                    == self.added(old)
                    + z3.If(z3.And(self.sums, old.left != 0), self.widest(old.increment), 0)
                    for old, new in pairs
                ],
            ),
            Obligation(
                "one step: at most one step an axis a clock, and every carry is a step that waits",
                [inv, z3.Not(self.load)],
                [
                    z3.If(
                        self.sums,
                        new.put_out() - old.put_out() == new.pulse,
                        new.put_out() == old.put_out(),
                    )
                    for old, new in pairs
                ]
                + [
                    z3.And(outputs[f"steps_{a}"] >= -1, outputs[f"steps_{a}"] <= 1) for a in letters
                ],
            ),
            Obligation(
                "position: changes by just the step that is taken, and by loading a block's start",
                [inv],
                [
                    new.position
                    == z3.If(
                        self.load,
                        old.start,
                        old.position + z3.If(self.taken, outputs[f"steps_{a}"], 0),
                    )
                    for a, (old, new) in zip(letters, pairs, strict=True)
                ],
            ),
            Obligation(
                "stall: a step that is not taken stays, and no register of the block moves",
                [inv, self.waiting, z3.Not(self.taken)],
                same({name: self.after[name] for name in self.moving()}, self.state)
                | same(
                    {f"steps_{a}": outputs[f"steps_{a}"] for a in letters},
                    self.golden.outputs(self.after),
                ),
            ),
            Obligation(
                "end: when a block is done its end point is reached exactly",
                [inv, ended],
                [
                    self.after["done"] == 1,
                    *[
                        old.position + outputs[f"steps_{a}"] == old.end
                        for a, old in zip(letters, before, strict=True)
                    ],
                ],
            ),
            Obligation(
                "answer: done or error just one clock after a last step is taken, a block of no "
                "length is started or a block is rejected, and never two of these in one clock",
                [inv],
                [
                    (self.after["done"] == 1) == z3.Or(ended, emptied),
                    (self.after["error"] == 1) == rejected,
                    z3.AtMost(ended, emptied, rejected, 1),
                ],
            ),
            Obligation(
                "rejected: a block that is too long moves nothing",
                [inv, rejected],
                same({name: self.after[name] for name in [*self.moving(), "running"]}, self.state),
            ),
            Obligation(
                "progress: every clock of a block sums unless its step waits untaken, and the next "
                "block starts in the clock in which the last step is taken",
                [inv, z3.Or(z3.Not(self.waiting), self.taken)],
                [
                    z3.Implies(self.state["running"] == 1, self.sums),
                    z3.Implies(z3.And(idle, z3.Not(self.nothing)), self.start),
                    z3.Implies(z3.And(idle, z3.Not(self.waiting)), self.start),
                ],
            ),
        ]

    def widest(self, value: Value) -> Value:
        """Widen a value that is not negative until M·x + S fits."""
        return z3.ZeroExt(self.golden.width, value)

    def added(self, axis: _Axis) -> Value:
        """M·x + S: all that has been added up on an axis."""
        return (self.widest(axis.put_out()) << self.golden.width) + self.widest(axis.total)

    def moving(self) -> list[str]:
        """Name the registers that a running block changes."""
        names = [name for a in self.golden.letters for name in self.golden.names(a)]
        return names + [f"pulse_{a}" for a in self.golden.letters]


def _magnitude(value: Value) -> Value:
    return z3.If(value < 0, -value, value)


def _signed(negative: Value, value: Value) -> Value:
    return z3.If(negative == 1, -value, value)


def _numbers(golden: Linear) -> list[Obligation]:
    """What follows for numbers: of one axis after t summations, and of two axes together.

    From "start" and "summation" above. T = M / 2^s; L the length, P = L·2^s the increment.
    """
    m, initial = 2**golden.width, golden.initial_sum
    t, x, s, p, limit, scale, length = z3.Ints("t x S P T 2^s L")
    block = [
        scale >= 1,
        limit * scale == m,
        p == length * scale,
        length >= 0,
        t >= 0,
    ]
    summed = m * x + s == initial + t * p
    inside = [s >= 0, s < m]
    common = z3.And(p * limit == m * length)
    obligations = [
        Obligation(
            "numbers: P·T = M·L on every axis, with the same T = M / 2^s", block, [common], True
        ),
        Obligation(
            "numbers: M·x + S = S₀ + t·P stays true from summation to summation",
            [summed],
            [m * x + s + p == initial + (t + 1) * p],
            True,
        ),
        Obligation(
            f"it always ends: an axis with steps left has had fewer than T ≤ {m} summations",
            [common, *inside, summed, x < length, x >= 0, p >= 0],
            [t < limit],
            True,
        ),
        Obligation(
            "X(t) = XH ± ⌊(S₀ + t·P) / M⌋ while the axis has steps left"
            + ("" if golden.normalize or initial else ", that is ⌊t·ΔX / M⌋"),
            [*inside, summed],
            [x == (initial + t * p) / m],
            True,
        ),
        Obligation(
            "... and after, until the block ends at t ≤ T",
            [common, *inside, t <= limit, p >= 0, initial + t * p >= m * length],
            [length == (initial + t * p) / m],
            True,
        ),
    ]
    if golden.normalize:
        obligations.append(
            Obligation(
                "speed: L < T ≤ 2·L for the longest axis, so between 1 and 2 clocks a step",
                [*block, 2 * p >= m, p < m],
                [length < limit, limit <= 2 * length],
                True,
            )
        )
    return obligations + _deviation(golden)


def _deviation(golden: Linear) -> list[Obligation]:
    """What follows for the distance from the line, in the plane of any two axes.

    By the closed form M·x = S₀ + t·a·2^s − r with 0 ≤ r < M, likewise M·y with b and q; the
    distance of (x, y) from the line through (a, b) is \\|cross\\| / √(a² + b²) with cross = b·x −
    a·y.
    """
    m, initial = 2**golden.width, golden.initial_sum
    a, b, x, y, q, r, u, cross = z3.Reals("ΔX ΔY x y q r t·2^s cross")
    lengths = [a >= 0, b >= 0, a + b > 0]
    rests = [r >= 0, r <= m - 1, q >= 0, q <= m - 1]
    residual = cross * m == b * (initial - r) - a * (initial - q)
    bound = (
        ("less than 1 step", cross * cross < a * a + b * b)
        if initial == 0
        else ("at most √½ step", 2 * cross * cross <= a * a + b * b)
    )
    return [
        Obligation(
            "distance: (ΔY·x − ΔX·y)·M = ΔY·(S₀ − r) − ΔX·(S₀ − q) with the rests r and q",
            [
                m * x == initial + u * a - r,
                m * y == initial + u * b - q,
                cross == b * x - a * y,
            ],
            [residual],
            True,
        ),
        Obligation(
            f"distance: off the line by {bound[0]}",
            [*lengths, *rests, residual],
            [bound[1]],
            True,
        ),
    ]
