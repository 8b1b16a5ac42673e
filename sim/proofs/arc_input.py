"""Promises of the preparation of an arc, proven for every block at a given width.

They are shown of the golden model's own source, and hold in every variant: nothing in the
preparation depends on one. Three kinds:

- about the registers, in bit-vectors, by induction over the clocks of a preparation: what holds in
  the clock with ``tick`` = t holds of t + 1 in the next. A few ghost values remember what the
  registers forget: what was received (``next_end``, ``next_clockwise``, ``next_full_turns``), the
  coordinates that are turned round (``from_x`` …), and the start's square, which is shifted away;
- about numbers, in integers and reals: the bit-vectors show that the radius meter follows its
  recurrences and loses no bit, the numbers what these come to: two squares, a root, a verdict.
  :meth:`Preparation.meant` is what the bit-vectors take over from the numbers;
- checked in every case of a small width: the same, from the accepted block to the verdict.

Notation: XH, YH and XK, YK are start and end seen from the centre, each in its own quadrant turned
onto the first; S = XH² + YH², E = XK² + YK²; root = ⌊2·√S⌋; the limit L = ⌊root / 2⌋ + 1.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import z3

from discreta.sim.golden.circular import Circular
from discreta.sim.golden.logic import Value, negate
from discreta.sim.smt import Exhaustive, Obligation, numbers, same

__all__ = ["PREPARED", "SQUARES", "Preparation", "opposed", "promises", "room", "seen_from_center"]

FULL_TURNS_BITS = 8
RANGE, OFF_CURVE = 1, 2

#: XH, YH, XK, YK.
SEEN = ("from_x", "from_y", "to_x", "to_y")
#: What is set on acceptance and stays.
PLACE = ("start_x", "start_y", "center_x", "center_y", "first_swap", "negative_x", "negative_y")
#: The squares of the radius meter.
SQUARES = ("start_square", "end_square")
#: Every register of the preparation.
PREPARED = (
    *("held", "fault", "empty", "first_turns", *PLACE, *SEEN),
    *("tick", "mask", *SQUARES, "rest", "root"),
)

#: The greatest widths of which every case is checked: of the root, and of the verdict.
ROOT_WIDTH, VERDICT_WIDTH = 8, 4


def promises(golden: Circular) -> list[Obligation | Exhaustive]:
    """Give everything that is promised of the preparation of an arc."""
    return [*Preparation(golden).obligations(), *_numbers(), *_exhaustive(golden)]


def opposed(negative: Value, value: Value) -> Value:
    """Give a value, or with ``negative`` = 1 its opposite."""
    return z3.If(negative == 1, -value, value)


def seen_from_center(
    turns: Value, swap: Value, negative: dict[str, Value], x: Value, y: Value
) -> dict[str, Value]:
    """Give a point along the machine's axes, from its X and Y after turns of the frame.

    ``swap`` and ``negative`` are those of the frame of the moment: with ``swap`` X is the machine's
    y; X falls and Y rises where ``negative`` leads. ``turns`` right angles, each the way in which Y
    rises, lead from there to the frame in which X and Y are given.
    """
    odd, half = turns & 1 == 1, turns & 2 == 2
    point = {}
    for index, a in enumerate("xy"):
        is_x = swap == index
        place = z3.If(z3.Xor(is_x, odd), x, y)
        # X lies on the side from which it falls, Y on the one to which it rises. One right angle
        # brings X to where Y was, and Y to where X was going; two lead to the other side.
        back = z3.If(is_x, z3.Xor(half, z3.Not(odd)), half)
        there = opposed(negative[a], place)
        point[a] = z3.If(back, -there, there)
    return point


def room(
    turns: Value,
    swap: Value,
    negative: dict[str, Value],
    center: dict[str, Value],
    limit: Value,
    width: int,
) -> dict[str, z3.BoolRef]:
    """State that there are coordinates ``limit`` steps from the centre at all crossings to come.

    The first is on the side to which Y rises, the second on the one to which X falls, beyond the
    centre, and then come the other two sides.
    """
    facts = {}
    for index, a in enumerate("xy"):
        there = opposed(negative[a], limit)
        for first, place in enumerate((center[a] + there, center[a] - there)):
            crossed = z3.If(swap == index, turns >= 2 + 2 * first, turns >= 1 + 2 * first)
            fits = z3.And(place >= -(2**width), place < 2**width)
            facts[f"room at crossing {1 + 2 * first} or {2 + 2 * first}, {a}"] = z3.Implies(
                crossed, fits
            )
    return facts


class Preparation:
    """What is promised of the registers that prepare a block, in bit-vectors.

    Attributes
    ----------
    state, inputs, after : dict
        Every register, every input, and every register a clock later, as numbers that no sum wraps.
    ghosts, ghosts_after : dict
        What the registers forget of the block that is prepared.
    wide : int
        Bits of all these.
    ranges : list of z3.BoolRef
        What numbers the registers, inputs and ghosts can hold.
    waiting, taken, free, accept, start, load : z3.BoolRef
        What happens in the clock.

    Parameters
    ----------
    golden : Circular
        The model.
    squares : bool
        With the squares of the radius meter, of twice as many bits as all else. Without they are 0,
        and only what does not depend on them can be shown.
    """

    def __init__(self, golden: Circular, *, squares: bool = True):
        self.golden = golden
        self.width = n = golden.width
        self.wide = 2 * n + 6 if squares else n + golden.guard + 10
        self.last_tick = 2 * n + 4
        self.ranges: list[z3.BoolRef] = []
        points = dict.fromkeys(
            (f"blocks_{which}_{a}" for which in ("start", "end", "center") for a in "xy"),
            (n + 1, True),
        )
        flags = dict.fromkeys(("blocks_valid", "blocks_clockwise", "steps_ready"), (1, False))
        turns = {"blocks_full_turns": (FULL_TURNS_BITS, False)}
        registers = golden.registers()
        none: dict[str, Value] = {} if squares else dict.fromkeys(SQUARES, self.number(0))
        self.state = self.numbers({k: registers[k] for k in registers if k not in none}) | none
        self.inputs = self.numbers(points | flags | turns)
        self.after = golden.step(self.state, self.inputs)

        outputs = golden.outputs(self.state)
        free = negate(outputs["steps_valid"]) | self.inputs["steps_ready"]
        self.free = free == 1
        self.waiting = outputs["steps_valid"] == 1
        self.taken = z3.And(self.waiting, self.inputs["steps_ready"] == 1)
        self.accept = z3.And(self.inputs["blocks_valid"] == 1, outputs["blocks_ready"] == 1)
        self.prepared = z3.And(self.state["held"] == 1, self.state["tick"] == 0)
        self.fault = self.state["fault"] != 0
        self.empty = self.state["empty"] == 1
        self.nothing = z3.Or(self.fault, self.empty)
        self.start = z3.And(
            self.prepared,
            self.state["running"] == 0,
            z3.If(self.nothing, z3.Not(self.waiting), self.free),
        )
        self.load = z3.And(self.start, z3.Not(self.fault))

        kinds: dict[str, tuple[int, bool]] = dict.fromkeys(SEEN, (n, False))
        kinds |= dict.fromkeys(("next_end_x", "next_end_y"), (n + 1, True))
        kinds |= {"next_clockwise": (1, False), "next_full_turns": (FULL_TURNS_BITS, False)}
        kinds |= {"square": (2 * n + 2, False)} if squares else {}
        self.ghosts = self.numbers(kinds, "ghost.")
        received = {name: self.after[name] for name in SEEN}
        received |= {f"next_{name}": self.inputs[f"blocks_{name}"] for name in ("end_x", "end_y")}
        received["next_clockwise"] = self.inputs["blocks_clockwise"]
        received["next_full_turns"] = self.inputs["blocks_full_turns"]
        self.ghosts_after = {
            name: z3.If(self.accept, value, self.ghosts[name]) for name, value in received.items()
        }
        if squares:
            self.ghosts_after["square"] = z3.If(
                self.state["tick"] == n + 1, self.state["start_square"], self.ghosts["square"]
            )

    def numbers(self, kinds: dict[str, tuple[int, bool]], prefix: str = "") -> dict[str, Value]:
        """Make symbols, and keep their ranges for :meth:`obligation`."""
        values, ranges = numbers(kinds, self.wide, prefix)
        self.ranges += ranges
        return values

    def number(self, value: int) -> z3.BitVecNumRef:
        """Make a number as wide as the symbols."""
        return z3.BitVecVal(value, self.wide)

    def obligation(self, title: str, assumptions: list, claims: dict) -> Obligation:
        """State something about the symbols."""
        return Obligation(title, assumptions, claims, ranges=self.ranges)

    # --- what there is to say of a block

    def beyond(self, state: dict, ghosts: dict) -> z3.BoolRef:
        """State that start or end, seen from the centre, do not fit n bits."""
        places = [state[f"start_{a}"] - state[f"center_{a}"] for a in "xy"]
        places += [ghosts[f"next_end_{a}"] - state[f"center_{a}"] for a in "xy"]
        most = 2**self.width - 1
        return z3.Or([z3.Or(place < -most, place > most) for place in places])

    def geometry(self, state: dict, ghosts: dict, seen: dict) -> dict[str, z3.BoolRef]:
        """State where start and end are, when they fit; ``seen`` has XH, YH, XK and YK."""
        swap, turns = state["first_swap"], state["first_turns"]
        negative = {a: state[f"negative_{a}"] for a in "xy"}
        xh, yh, xk, yk = (seen[name] for name in SEEN)
        start = seen_from_center(self.number(0), swap, negative, xh, yh)
        end = seen_from_center(turns, swap, negative, xk, yk)
        facts = {}
        for a in "xy":
            center = state[f"center_{a}"]
            facts[f"start {a}"] = state[f"start_{a}"] == center + start[a]
            facts[f"end {a}"] = ghosts[f"next_end_{a}"] == center + end[a]
        # X the machine's x and falling leftwards, Y rising upwards: counter-clockwise. Any one of
        # the three the other way turns it.
        facts["way round"] = (negative["x"] ^ negative["y"] ^ swap ^ ghosts["next_clockwise"]) == 1
        # On an axis a start belongs to the quadrant after it, an end to the one before it.
        facts["start's quadrant"] = z3.Or(xh > 0, yh == 0)
        facts["end's quadrant"] = z3.Or(yk > 0, xk == 0)
        return facts

    def ahead(self, seen: dict) -> z3.BoolRef:
        """State that the end, if it is in the start's quadrant, lies ahead there."""
        xh, yh, xk, yk = (seen[name] for name in SEEN)
        return z3.And(xk <= xh, yk >= yh, z3.Or(xk != xh, yk != yh))

    def crossings(self, state: dict, ghosts: dict, seen: dict) -> z3.BoolRef:
        """State that ``first_turns`` has the full turns and less than a turn more.

        Or just a turn more, for an end in the start's quadrant that is not ahead there.
        """
        turns, full_turns = state["first_turns"], ghosts["next_full_turns"]
        once_round = z3.And(turns & 3 == 0, z3.Not(self.ahead(seen)))
        return turns >> 2 == z3.If(once_round, full_turns + 1, full_turns)

    def limit(self, state: dict) -> Value:
        """L, before it is cut to its bits."""
        return (state["root"] >> 1) + 1

    def fits(self, state: dict) -> dict[str, z3.BoolRef]:
        """State that an arc can go wherever it crosses an axis."""
        limit = self.limit(state)
        negative = {a: state[f"negative_{a}"] for a in "xy"}
        center = {a: state[f"center_{a}"] for a in "xy"}
        turns = state["first_turns"]
        return {
            "limit": z3.Or(turns == 0, limit < 2**self.width),
            **room(turns, state["first_swap"], negative, center, limit, self.width),
        }

    def zero(self, state: dict) -> z3.BoolRef:
        """State that the meter finds both start and end in the centre."""
        return z3.And(state["root"] == 0, state["end_square"] == 0)

    def near(self, state: dict) -> z3.BoolRef:
        """State that the meter finds the end near the circle."""
        root, difference = state["root"], state["end_square"]
        return z3.And(root >= 1, difference >= 1 - root, difference <= 1 + root)

    def meant(self, state: dict, seen: dict) -> z3.BoolRef:
        """State what root and E − S say of the block, once measured; the numbers show it."""
        xh, yh, xk, yk = (seen[name] for name in SEEN)
        root, difference = state["root"], state["end_square"]
        return z3.And(
            2 * xh <= root,
            2 * yh <= root,
            (root == 0) == z3.And(xh == 0, yh == 0),
            z3.Implies(root == 0, (difference == 0) == z3.And(xk == 0, yk == 0)),
        )

    def found(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """State what a prepared block is that is not rejected: what the running arc rests on."""
        xh, yh, *_ = seen = [state[name] for name in SEEN]
        empty = state["empty"] == 1
        limit = self.limit(state)
        facts = self.geometry(state, ghosts, state)
        facts["crossings"] = self.crossings(state, ghosts, state)
        facts["ahead"] = z3.Or(state["first_turns"] != 0, self.ahead(state))
        facts["empty"] = empty == z3.And([value == 0 for value in seen])
        facts["off the centre"] = z3.Or(empty, xh > 0)
        facts["inside the limit"] = z3.And(xh < limit, yh < limit)
        return facts | {name: z3.Or(empty, fact) for name, fact in self.fits(state).items()}

    # --- clock by clock

    def status(self, t: int, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """State what is known of a block in the clock with ``tick`` = t; 0 is for the prepared."""
        turns, full_turns = state["first_turns"], ghosts["next_full_turns"]
        beyond = self.beyond(state, ghosts)
        facts = {
            "crossings": turns >> 2 == full_turns
            if 0 < t <= self.width + 1
            else self.crossings(state, ghosts, ghosts)
        }
        if t > 0:
            facts["fault"] = state["fault"] == z3.If(beyond, self.number(RANGE), self.number(0))
            facts["empty"] = state["empty"] == 0
            return facts
        zero = self.zero(state)
        leaves = z3.And(z3.Not(zero), z3.Not(z3.And(*self.fits(state).values())))
        off = z3.If(z3.Or(zero, self.near(state)), self.number(0), self.number(OFF_CURVE))
        fault = z3.If(z3.Or(beyond, leaves), self.number(RANGE), off)
        facts["fault"] = state["fault"] == fault
        facts["empty"] = (state["empty"] == 1) == zero
        return facts

    def meter(self, t: int, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """State what the radius meter holds in the clock with ``tick`` = t; 0: when prepared."""
        n = self.width
        absorbed = min(t - 1, n) if t else n
        most = 2**absorbed - 1
        facts = {"mask": state["mask"] == most}
        for name in SEEN:
            value, places = ghosts[name], absorbed % n
            turned = ((value << places) | (value >> (n - places))) & (2**n - 1)
            facts[name] = state[name] == turned
        start_square, end_square = state["start_square"], state["end_square"]
        root, rest = state["root"], state["rest"]
        if 0 < t <= n + 1:
            facts["S"] = start_square <= 2 * most**2
            facts["E"] = z3.And(end_square >= 0, end_square <= 2 * most**2)
            facts["root"] = z3.And(root == 0, rest == 0)
            return facts
        drawn = t - (n + 2) if t else n + 2
        whole = ghosts["square"]
        left = (whole << 2 * drawn) & (2 ** (2 * n + 2) - 1)
        facts["S"] = z3.And(whole <= 2 * most**2, start_square == left)
        facts["E"] = z3.And(end_square >= -2 * most**2, end_square <= 2 * most**2)
        facts["root"] = z3.And(root <= 2**drawn - 1, rest <= 2 * root)
        return facts

    def clock(self, t: int, *claims: z3.BoolRef) -> z3.BoolRef:
        """State that the claims follow from all that is known in the clock with ``tick`` = t."""
        known = self.meter(t, self.state, self.ghosts) | self.status(t, self.state, self.ghosts)
        now = z3.And(self.state["held"] == 1, self.state["tick"] == t, *known.values())
        return z3.Implies(now, z3.And(*claims))

    def obligations(self) -> list[Obligation]:
        """Give the obligations."""
        state, ghosts = self.state, self.ghosts
        after, later = self.after, self.ghosts_after
        reset = {name: self.number(value) for name, value in self.golden.reset().items()}
        held = z3.Or(state["tick"] == 0, state["held"] == 1)
        still_held = z3.Or(after["tick"] == 0, after["held"] == 1)
        one_on = z3.If(
            state["tick"] == self.last_tick, after["tick"] == 0, after["tick"] == state["tick"] + 1
        )
        begun = self.status(1, after, later) | self.meter(1, after, later)
        fits = z3.Not(self.beyond(after, later))
        geometry = z3.And(*self.geometry(state, ghosts, ghosts).values())
        ended = self.meter(0, state, ghosts) | self.status(0, state, ghosts)
        return [
            self.obligation(
                f"preparation: it always takes {self.last_tick} clocks, and what is prepared waits "
                "until the block starts",
                [],
                {
                    "reset": z3.And(reset["held"] == 0, reset["tick"] == 0),
                    "begins": z3.Implies(
                        self.accept, z3.And(after["held"] == 1, after["tick"] == 1)
                    ),
                    "goes on": z3.Implies(
                        z3.And(held, state["tick"] > 0, state["tick"] <= self.last_tick),
                        z3.And(one_on, after["held"] == 1),
                    ),
                    "waits": z3.Implies(
                        z3.And(self.prepared, z3.Not(self.start)),
                        z3.And(*same({name: after[name] for name in PREPARED}, state).values()),
                    ),
                    "is given away": z3.Implies(self.start, after["held"] == 0),
                    "held": z3.Implies(held, still_held),
                },
            ),
            self.obligation(
                "accepted: start and end are turned onto the first quadrant, the right angles "
                "between them are counted, the way round is the block's, or it is RANGE",
                [self.accept],
                begun
                | {
                    name: z3.Implies(fits, fact)
                    for name, fact in self.geometry(after, later, later).items()
                },
            ),
            self.obligation(
                "accepted: ... and so it stays while the block is prepared",
                [state["held"] == 1, z3.Not(self.start)],
                same({name: after[name] for name in PLACE}, state)
                | same({name: later[name] for name in later if name != "square"}, ghosts)
                | {"right angles": after["first_turns"] & 3 == state["first_turns"] & 3},
            ),
            self.obligation(
                "crossings: one quadrant and the end not ahead in it is once round, and nothing "
                "else adds to the right angles",
                [],
                {
                    f"clock {t}": self.clock(t, *self.status(t + 1, after, later).values())
                    for t in range(1, self.last_tick)
                },
            ),
            self.obligation(
                "radius meter: in n clocks every prefix p of a coordinate becomes 2·p + b, the "
                "square becomes 4·square + Σ b·(4·p + 1), and no bit is lost",
                [],
                dict(self._squares()),
            ),
            self.obligation(
                "radius meter: in n + 2 clocks the root of 4·S is drawn: rest and root become "
                "4·rest + d and 2·root, or 4·rest + d − (4·root + 1) and 2·root + 1, and no bit is "
                "lost",
                [],
                dict(self._roots()),
            ),
            self.obligation(
                "verdict: RANGE just for what does not fit, else OFF_CURVE just for root = 0 or E "
                "− S not from 1 − root to 1 + root, unless it has no length",
                [],
                {
                    name: self.clock(self.last_tick, fact)
                    for name, fact in self.status(0, after, later).items()
                },
            ),
            self.obligation(
                "prepared: what starts is an arc from start to end round the centre, inside its "
                "limit, with coordinates for every crossing",
                [
                    *ended.values(),
                    z3.Or(self.beyond(state, ghosts), geometry),
                    self.meant(state, ghosts),
                    z3.Not(self.fault),
                ],
                self.found(state, ghosts),
            ),
        ]

    def _squares(self) -> Iterator[tuple[str, z3.BoolRef]]:
        n, state, after = self.width, self.state, self.after
        for t in range(1, n + 1):
            facts = []
            for which, square in (("from", "start_square"), ("to", "end_square")):
                total = 4 * state[square]
                for a in "xy":
                    name = f"{which}_{a}"
                    bit, prefix = state[name] >> (n - 1), state[name] & state["mask"]
                    facts.append(prefix == self.ghosts[name] >> (n - t + 1))
                    facts.append(after[name] & after["mask"] == 2 * prefix + bit)
                    total = total + z3.If(bit == 1, 4 * prefix + 1, self.number(0))
                facts.append(after[square] == total)
            next_one = self.meter(t + 1, after, self.ghosts_after)
            yield f"clock {t}", self.clock(t, *facts, *next_one.values())
        facts = [state[name] == self.ghosts[name] for name in SEEN]
        facts += [after["end_square"] == state["end_square"] - state["start_square"]]
        facts += [self.ghosts_after["square"] == state["start_square"]]
        next_one = self.meter(n + 2, after, self.ghosts_after)
        yield f"clock {n + 1}", self.clock(n + 1, *facts, *next_one.values())

    def _roots(self) -> Iterator[tuple[str, z3.BoolRef]]:
        n, state, after = self.width, self.state, self.after
        for drawn in range(n + 2):
            t = n + 2 + drawn
            # The next two bits of S, and then two zeros, for it is 4·S.
            pair = (self.ghosts["square"] >> 2 * (n - drawn)) & 3 if drawn <= n else self.number(0)
            rest, trial = 4 * state["rest"] + pair, 4 * state["root"] + 1
            fits = rest >= trial
            facts = [
                after["rest"] == z3.If(fits, rest - trial, rest),
                after["root"] == z3.If(fits, 2 * state["root"] + 1, 2 * state["root"]),
            ]
            next_one = self.meter(t + 1, after, self.ghosts_after)
            yield f"clock {t}", self.clock(t, *facts, *next_one.values())
        prepared = self.meter(0, after, self.ghosts_after)
        yield f"clock {self.last_tick}", self.clock(self.last_tick, *prepared.values())


def _numbers() -> list[Obligation]:
    """What the recurrences come to, whatever the width."""
    p, q, b, c, square = z3.Ints("p q b c p²+q²")
    total, rest, root, d = z3.Ints("N rest root d")
    xh, yh, xk, yk, s, e, limit, difference = z3.Ints("XH YH XK YK S E L E−S")
    radius, other = z3.Reals("√S √E")
    x, y, x_end, y_end = z3.Reals("XH YH XK YK")

    def drawn(total: Any, rest: Any, root: Any) -> list:
        return [total == root * root + rest, rest >= 0, rest <= 2 * root, root >= 0]

    grown, trial = 4 * rest + d, 4 * root + 1
    start = [xh >= 0, yh >= 0, s == xh * xh + yh * yh]
    end = [xk >= 0, yk >= 0, e == xk * xk + yk * yk]
    is_root = [root >= 0, root * root <= 4 * s, 4 * s < (root + 1) * (root + 1)]
    start_in_center, end_in_center = z3.And(xh == 0, yh == 0), z3.And(xk == 0, yk == 0)
    circle = [x >= 0, y >= 0, radius >= 1, radius * radius == x * x + y * y]
    quadrant = [xh > 0, yh >= 0, xk >= 0, yk > 0]
    cross = xh * yk - yh * xk
    return [
        Obligation(
            "numbers: 4·(p² + q²) + b·(4·p + 1) + c·(4·q + 1) = (2·p + b)² + (2·q + c)²",
            [square == p * p + q * q, *[z3.Or(bit == 0, bit == 1) for bit in (b, c)]],
            [
                4 * square + b * (4 * p + 1) + c * (4 * q + 1)
                == (2 * p + b) * (2 * p + b) + (2 * q + c) * (2 * q + c)
            ],
            True,
        ),
        Obligation(
            "numbers: N = root² + rest with 0 ≤ rest ≤ 2·root stays true of 4·N + d",
            [*drawn(total, rest, root), d >= 0, d <= 3],
            [
                *[
                    z3.Implies(grown >= trial, fact)
                    for fact in drawn(4 * total + d, grown - trial, 2 * root + 1)
                ],
                *[
                    z3.Implies(grown < trial, fact)
                    for fact in drawn(4 * total + d, grown, 2 * root)
                ],
            ],
            True,
        ),
        Obligation(
            "numbers: so root = ⌊√N⌋, for N = 4·S ⌊2·√S⌋",
            drawn(total, rest, root),
            [root * root <= total, total < (root + 1) * (root + 1)],
            True,
        ),
        Obligation(
            "numbers: L = ⌊root / 2⌋ + 1 = ⌊√S⌋ + 1",
            [*is_root, limit == root / 2 + 1],
            [(limit - 1) * (limit - 1) <= s, s < limit * limit],
            True,
        ),
        Obligation(
            "numbers: 2·XH, 2·YH ≤ root, and what root and E − S tell of the centre",
            [*start, *end, *is_root, difference == e - s],
            [
                2 * xh <= root,
                2 * yh <= root,
                (root == 0) == start_in_center,
                z3.Implies(root == 0, (difference == 0) == end_in_center),
            ],
            True,
        ),
        Obligation(
            "numbers: |√E − √S| ≤ 1 just when |E − S − 1| ≤ 2·√S, for √S ≥ 1",
            [radius >= 1, other >= 0],
            [
                z3.And(other - radius <= 1, radius - other <= 1)
                == z3.And(
                    other * other - radius * radius >= 1 - 2 * radius,
                    other * other - radius * radius <= 1 + 2 * radius,
                )
            ],
            True,
        ),
        Obligation(
            "numbers: ... just when 1 − root ≤ E − S ≤ 1 + root, for whole E − S",
            [root <= 2 * radius, 2 * radius < root + 1],
            [
                z3.And(difference >= 1 - 2 * radius, difference <= 1 + 2 * radius)
                == z3.And(difference >= 1 - root, difference <= 1 + root)
            ],
            True,
        ),
        Obligation(
            "numbers: an end that is near is inside the limit",
            [*start, *end, *is_root, limit == root / 2 + 1, e - s <= 1 + root],
            [xk <= limit, yk <= limit],
            True,
        ),
        Obligation(
            "numbers: an end in the start's quadrant that is near is ahead on no axis or behind on "
            "none",
            circle,
            [
                z3.Implies(
                    z3.And(x_end >= 0, y_end >= 0, x_end <= x - 1, y_end <= y - 1),
                    x_end * x_end + y_end * y_end < (radius - 1) * (radius - 1),
                ),
                z3.Implies(
                    z3.And(x_end >= x + 1, y_end >= y + 1),
                    x_end * x_end + y_end * y_end > (radius + 1) * (radius + 1),
                ),
            ],
            True,
        ),
        Obligation(
            "numbers: ahead is at a greater angle than the start, behind at a smaller one or the "
            "same",
            quadrant,
            [
                z3.Implies(z3.And(xk <= xh, yk >= yh, z3.Or(xk != xh, yk != yh)), cross > 0),
                z3.Implies(z3.And(xk >= xh, yk <= yh), cross <= 0),
            ],
            True,
        ),
    ]


def _exhaustive(golden: Circular) -> list[Exhaustive]:
    """What can be checked in every case."""
    n = golden.width
    most = 2**n - 1
    checks = []
    if n <= ROOT_WIDTH:
        checks.append(
            Exhaustive(
                f"root: ⌊2·√S⌋ for all {4**n} starts in a quadrant, 0 ≤ XH, YH ≤ {most}",
                lambda: _break_root(golden),
            )
        )
    if n <= VERDICT_WIDTH:
        cases = 2 * 4**n * (2 * most + 1) ** 2
        checks.append(
            Exhaustive(
                f"verdict and crossings: as exact geometry has them, for all {cases} arcs round "
                f"the origin from 0 ≤ x, y ≤ {most} to −{most} ≤ x, y ≤ {most}, both ways round",
                lambda: _break_verdict(golden),
            )
        )
    return checks


def _prepare(golden: Circular, blocks: dict[str, Any]) -> dict[str, np.ndarray]:
    """Give the registers when the blocks are prepared, each in a machine of its own."""
    state: dict[str, Any] = golden.reset()
    inputs = {f"blocks_{name}": value for name, value in blocks.items()} | {"steps_ready": 1}
    for clock in range(2 * golden.width + 5):
        state = golden.step(state, inputs | {"blocks_valid": int(clock == 0)})
    return state


def _break_root(golden: Circular) -> str:
    """Give a start with a wrong root; empty when there is none."""
    x, y = (axis.ravel() for axis in np.mgrid[0 : 2**golden.width, 0 : 2**golden.width])
    blocks = dict.fromkeys(("center_x", "center_y", "clockwise", "full_turns"), 0)
    state = _prepare(golden, blocks | {"start_x": x, "start_y": y, "end_x": x, "end_y": y})
    square, root = x * x + y * y, state["root"]
    wrong = (root * root > 4 * square) | (4 * square >= (root + 1) ** 2) | (state["tick"] != 0)
    return _first(wrong, XH=x, YH=y, root=root)


def _break_verdict(golden: Circular) -> str:
    """Give an arc that is judged wrongly; empty when there is none."""
    most = 2**golden.width - 1
    ends = np.arange(-most, most + 1)
    for clockwise in (0, 1):
        for x in range(most + 1):
            y, xe, ye = (a.ravel() for a in np.meshgrid(np.arange(most + 1), ends, ends))
            blocks = {
                **{"start_x": x, "start_y": y, "end_x": xe, "end_y": ye},
                **{"center_x": 0, "center_y": 0, "clockwise": clockwise, "full_turns": 0},
            }
            state = _prepare(golden, blocks)
            near, out, crossings, empty = _geometry(x, y, xe, ye, clockwise, most)
            sound = near & ~out
            # The centre has no angle: an arc of radius 1 may end there.
            angled = sound & ~empty & ((xe != 0) | (ye != 0))
            wrong = ((state["fault"] == 0) != sound) | (near & out & (state["fault"] != RANGE))
            wrong |= sound & (state["empty"] != empty)
            wrong |= angled & (state["first_turns"] != crossings)
            if found := _first(
                wrong, **blocks, fault=state["fault"], first_turns=state["first_turns"]
            ):
                return found
    return ""


def _geometry(x, y, xe, ye, clockwise: int, most: int) -> tuple[np.ndarray, ...]:
    """Judge arcs round the origin.

    Gives whether the end is near the circle, whether an arc to it leads too far, how many axes it
    crosses, and whether it has no length.
    """
    if clockwise:
        y, ye = -y, -ye
    square, end_square = x * x + y * y, xe * xe + ye * ye
    begin, end = _eighth(x, y), _eighth(xe, ye)
    ahead = (begin == end) & (x * ye - y * xe > 0)
    way = np.where(ahead, 0, (end - begin - 1) % 8 + 1)
    # The half axes are the even eighths: those behind the first and before the last are crossed.
    crossings = (begin + way + 1) // 2 - begin // 2 - 1
    empty = (square == 0) & (end_square == 0)
    # |√E − √S| ≤ 1 in whole numbers.
    near = empty | ((square > 0) & ((end_square - square - 1) ** 2 <= 4 * square))
    # ⌊√S⌋ + 1 does not fit.
    out = ~empty & (crossings > 0) & (square >= most**2)
    return near, out, crossings, empty


def _eighth(x, y) -> np.ndarray:
    """Number the half axes and the quadrants between them, counter-clockwise from 0, the x axis."""
    return np.select(
        [
            (x > 0) & (y == 0),
            (x > 0) & (y > 0),
            (x == 0) & (y > 0),
            (x < 0) & (y > 0),
            (x < 0) & (y == 0),
            (x < 0) & (y < 0),
            (x == 0) & (y < 0),
        ],
        range(7),
        7,
    )


def _first(wrong: np.ndarray, **values: Any) -> str:
    """Name the values of the first case that is wrong; empty when there is none."""
    if not wrong.any():
        return ""
    index = int(np.argmax(wrong))
    return ", ".join(
        f"{name}={int(np.broadcast_to(value, wrong.shape)[index])}"
        for name, value in values.items()
    )
