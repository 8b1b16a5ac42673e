"""Promises of the interpolator of second-order curves, proven for every block at a given width.

They are shown of the golden model's own source, which the device is proven equal to. Two kinds:

- about the registers, in bit-vectors: an invariant is shown to hold after reset and to survive
  every clock from every state that satisfies it, whatever the inputs; the promises follow from it.
  Where the sums do not matter they may be any numbers at all (``tell`` of the golden model). Two
  ghost values, ``x`` and ``y``, remember the start while its coordinates are turned round;
- about numbers, in reals and integers: no product is ever asked for in bits. The bit-vectors show
  what a clock does to GX and GY by additions alone, the numbers what this comes to.

GX = 2A·P1 + B·P2 + D and GY = B·P1 + 2C·P2 + E: so it is in every clock but the first n + 2 of a
preparation (``tick`` = 1 to n + 2), in which X and Y, the bits of the start that have been taken,
stand for P1 and P2, and 0 for D and E.

Notation: P and Q are 2A and B of GX, B and 2C of GY, R is D or E; dx and dy are the steps of a
clock; s the power of two of its scale; M = 2^(2n + 6 + g). The pieces of a curve lie between two
changes of direction of an axis. An axis goes when its velocity, −GY or GX and clockwise the
opposite, leads in the direction of the piece, it has steps left, and it is not ``backward``.
A limit of s of all ones is none.
"""

from collections.abc import Iterator
from itertools import product

import z3

from discreta.sim.golden.conic import Conic
from discreta.sim.golden.logic import Value
from discreta.sim.proofs.arc_input import opposed
from discreta.sim.smt import Obligation, numbers, same

__all__ = ["promises", "shared"]

SHARP = 3

#: What is set on acceptance and stays.
PLACE = (*"abcde", "xk", "yk", "clockwise")
#: x, and y: coordinate, steps left, end, position, summator.
AXES = {"x": ("p1", "p3", "xk", "xt", "sx"), "y": ("p2", "p4", "yk", "yt", "sy")}
#: Steps of the axis that is added to first and of the other one.
STEPS = ("first_step", "second_step")
#: What a summation without a step changes.
CHANGING = ("sx", "sy", "fresh", "scale", "xt", "yt", "pulse_x", "pulse_y", "done", "error")
#: What is scaled for a summation.
LANES = ("gx", "gy", "2a", "b", "2c")


def shared(golden: Conic) -> list[Obligation]:
    """Give what is promised of the derivatives as numbers, the same in every variant."""
    return _numbers(golden)


def promises(golden: Conic) -> list[Obligation]:
    """Give everything else that is promised of the interpolator of second-order curves."""
    return [*_Registers(golden).obligations(), *_ends(golden)]


class _Registers:
    """What is promised of the registers, in bit-vectors."""

    def __init__(self, golden: Conic):
        self.golden = golden
        self.width = n = golden.width
        self.modulus = golden.modulus
        self.wide = golden.bits + golden.guard + 6
        #: The limit of s that is none.
        self.unlimited = self.number(golden.no_limit)
        self.last_tick = n + 3
        self.ranges: list[z3.BoolRef] = []
        kinds = golden.registers()
        self.kinds = dict(kinds)
        self.state = state = self.numbers(kinds)
        received = {"p1": "start_x", "p2": "start_y", "xk": "end_x", "yk": "end_y"}
        received |= {name: name for name in (*"abcde", "clockwise", "turns")}
        inputs = {f"blocks_{port}": kinds[name] for name, port in received.items()}
        flags = dict.fromkeys(("blocks_valid", "steps_ready"), (1, False))
        self.inputs = self.numbers(inputs | flags)
        # What normalizer and summators make, and any numbers of as many bits in its place.
        self.told: dict[str, Value] = {}
        self.kinds |= self._between()
        self.made = self.numbers(self._between())
        self.after = golden.step(state, self.inputs, self._tell)

        outputs = golden.outputs(state)
        self.steps = {a: outputs[f"steps_{a}"] for a in "xy"}
        ready = self.inputs["steps_ready"] == 1
        self.waiting = outputs["steps_valid"] == 1
        self.taken = z3.And(self.waiting, ready)
        self.free = z3.Or(z3.Not(self.waiting), ready)
        self.busy = outputs["busy"] == 1
        self.accept = z3.And(self.inputs["blocks_valid"] == 1, z3.Not(self.busy))
        self.ghosts = self.numbers(dict.fromkeys("xy", (n + 1, True)), "ghost.")
        self.ghosts_after = {
            a: z3.If(self.accept, self.inputs[f"blocks_start_{a}"], self.ghosts[a]) for a in "xy"
        }
        self.known = self.invariant(state)
        self.everything = [fact for part in self.known.values() for fact in part.values()]
        # What a clock does.
        self.running, self.last = state["running"] == 1, state["turns"] == 0
        self.sharp = state["fault"] != 0
        self.at_end = z3.And(*(state[p] == state[k] for p, _, k, *_ in AXES.values()))
        self.empty = z3.And(self.last, self.at_end)
        self.start = z3.And(state["held"] == 1, state["tick"] == 0)
        self.load = z3.And(self.start, z3.Not(self.sharp))
        self.way = {"x": opposed(state["clockwise"], -state["gy"])}
        self.way["y"] = opposed(state["clockwise"], state["gx"])
        self.down = {a: state[f"direction_{a}"] ^ state[f"backward_{a}"] == 1 for a in "xy"}
        leads = {a: z3.If(self.down[a], self.way[a] < 0, self.way[a] > 0) for a in "xy"}
        self.goes = {
            a: z3.And(leads[a], state[left] != 0, state[f"backward_{a}"] == 0)
            for a, (_, left, *_) in AXES.items()
        }
        self.dead = z3.Not(z3.Or(*self.goes.values()))
        self.both = z3.And(*self.goes.values())
        self.x_speeds_up = z3.Xor(z3.Xor(self.down["x"], self.down["y"]), state["clockwise"] == 1)
        slow_leads = z3.If(self.x_speeds_up, leads["y"], leads["x"])
        self.clock = z3.And(self.running, self.free)
        self.turn = z3.And(self.clock, z3.Not(self.last), z3.Or(self.dead, z3.Not(slow_leads)))
        self.sums = z3.And(self.clock, z3.Not(self.turn))
        self.live = z3.And(self.sums, z3.Not(self.dead))
        self.stepless = z3.And(self.turn, state["turns"] == 1, self.at_end)

        self.links = self._summed()
        #: When there is a step, whatever the sums are: what all else rests on.
        self.carries = [self.made[name] == self.links[name] for name in STEPS]
        self.everything += self.carries

    def _between(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every value between the registers and whether it is signed."""
        bits, sum_bits = self.golden.bits, self.golden.bits + self.golden.guard
        kinds = {"places": ((bits - 1).bit_length(), False)}
        if self.golden.ordered:
            kinds = {"limit": kinds["places"]} | kinds
        kinds |= {f"scaled_{k}": (bits, True) for k in LANES}
        for which in ("first", "second"):
            kinds |= {f"{which}_{k}": (bits + 1, True) for k in ("velocity", "change", "own")}
            sums = {"total": sum_bits + 3, "carried": sum_bits + 2, "unlimited": sum_bits + 4}
            sums |= {"step": 2, "rest": sum_bits + 1}
            kinds |= {f"{which}_{k}": (places, True) for k, places in sums.items()}
        return kinds

    def _tell(self, name: str, value: Value) -> Value:
        """Note what the golden model reckons; it goes on with any number."""
        self.told[name] = value
        return self.made[name]

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

    def obligations(self) -> list[Obligation]:
        """Give the obligations."""
        return [
            *self._preparation(),
            *self._derivatives(),
            *self._induction(),
            *self._rules(),
            *self._sums(),
            *self._answers(),
        ]

    # --- what there is to say of a state

    def invariant(self, state: dict) -> dict[str, dict[str, z3.BoolRef]]:
        """Give what is true of a state in every clock.

        In three parts: of a block that is prepared, of the steps left, and of the position.
        """
        running, last = state["running"] == 1, state["turns"] == 0
        pulses = z3.Or(state["pulse_x"] == 1, state["pulse_y"] == 1)
        held, prepares = state["held"] == 1, state["tick"] > 0
        block = {
            "alone": z3.Implies(held, z3.Not(z3.Or(running, pulses))),
            "tick": z3.And(state["tick"] <= self.last_tick, z3.Implies(prepares, held)),
            "fault": z3.Or(state["fault"] == 0, state["fault"] == SHARP),
            "no fault yet": z3.Implies(prepares, state["fault"] == 0),
        }
        free_piece, last_piece = z3.And(running, z3.Not(last)), z3.And(running, last)
        counted, placed = {}, {}
        for a, (p, left, end, position, _) in AXES.items():
            down = state[f"direction_{a}"]
            edge = z3.If(down == 1, state[p] + 2**self.width, 2**self.width - 1 - state[p])
            counted |= {
                f"{left} to the edge": z3.Implies(free_piece, state[left] == edge),
                f"{a} not backward": z3.Implies(free_piece, state[f"backward_{a}"] == 0),
                f"{left} to the end": z3.Implies(
                    last_piece, state[end] - state[p] == opposed(down, state[left])
                ),
                f"{p} at the end": z3.Implies(
                    z3.And(pulses, z3.Not(running)), state[p] == state[end]
                ),
            }
            placed[a] = z3.Implies(
                z3.Or(running, pulses),
                state[p] == state[position] + opposed(down, state[f"pulse_{a}"]),
            )
        counted["runs"] = z3.Implies(last_piece, z3.Or(state["p3"] > 0, state["p4"] > 0))
        return {"block": block, "counted": counted, "placed": placed}

    def preload(self, down: z3.BoolRef) -> Value:
        """Give what a summator starts from."""
        initial = self.golden.initial_sum
        return z3.If(down, self.number(self.modulus - 1 - initial), self.number(initial))

    def survives(self, *parts: str) -> dict[str, z3.BoolRef]:
        """State that the first part of the invariant survives every clock; it rests on all."""
        known = z3.And(
            *self.carries, *(fact for name in parts for fact in self.known[name].values())
        )
        facts = self.invariant(self.after)[parts[0]]
        return {name: z3.Implies(known, fact) for name, fact in facts.items()}

    def fits(self, name: str, value: Value) -> z3.BoolRef:
        """State that a value is one that a register can hold."""
        bits, signed = self.kinds[name]
        low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1)) if signed else (0, 2**bits)
        return z3.And(value >= low, value < high)

    def kept(self, *others: str) -> z3.BoolRef:
        """State that all registers but the others stay what they are."""
        return z3.And(
            *(self.after[k] == value for k, value in self.state.items() if k not in others)
        )

    # --- preparation and derivatives

    def turned(self, t: int, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """State what P1 and P2 are in the clock with ``tick`` = t of a block; 0 is its start's."""
        n = self.width
        facts = {}
        for a, (p, *_) in AXES.items():
            places = t - 1 if 0 < t <= n + 1 else 0
            bits = ghosts[a] & (2 ** (n + 1) - 1)
            turned = ((bits << places) | (bits >> (n + 1 - places))) & (2 ** (n + 1) - 1)
            facts[p] = state[p] & (2 ** (n + 1) - 1) == turned
        return facts

    def tick(self, t: int, *claims: z3.BoolRef) -> z3.BoolRef:
        """State that the claims follow from what is known of a block that is prepared."""
        known = self.turned(t, self.state, self.ghosts).values()
        now = z3.And(self.state["held"] == 1, self.state["tick"] == t, *known)
        return z3.Implies(now, z3.And(*claims))

    def _preparation(self) -> list[Obligation]:
        """How a block is prepared, but for its derivatives."""
        state, after, last_tick = self.state, self.after, self.last_tick
        block = [*self.known["block"].values(), *self.carries]
        prepares = z3.And(state["tick"] > 0, state["tick"] < last_tick)
        size = sum((z3.If(g < 0, -g, g) for g in (state["gx"], state["gy"])), self.number(0))
        bend = sum((z3.If(k < 0, -k, k) for k in (state[k] for k in "abc")), self.number(0))
        sharp = z3.And(z3.Not(self.empty), z3.Or(size < 4 * bend, size == 0))
        verdict = z3.If(sharp, self.number(SHARP), self.number(0))
        begun = self.turned(1, after, self.ghosts_after)
        turned = {
            f"clock {t}": self.tick(t, *self.turned(t + 1, after, self.ghosts_after).values())
            for t in range(1, last_tick)
        }
        turned[f"clock {last_tick}"] = self.tick(
            last_tick, *self.turned(0, after, self.ghosts_after).values()
        )
        return [
            self.obligation(
                f"preparation: it takes {last_tick} clocks in which nothing runs, and in the next "
                "the block starts",
                [],
                self.survives("block", "counted")
                | {
                    "begins": z3.Implies(
                        self.accept, z3.And(after["held"] == 1, after["tick"] == 1)
                    ),
                    "goes on": z3.Implies(
                        z3.And(*block, prepares),
                        z3.And(after["held"] == 1, after["tick"] == state["tick"] + 1),
                    ),
                    "ends": z3.Implies(
                        z3.And(*block, state["tick"] == last_tick),
                        z3.And(after["held"] == 1, after["tick"] == 0),
                    ),
                    "starts": z3.Implies(z3.And(*block, self.start), after["held"] == 0),
                },
            ),
            self.obligation(
                "preparation: P1 and P2 turn round once and are the start again",
                block,
                {name: z3.Implies(self.accept, fact) for name, fact in begun.items()} | turned,
            ),
            self.obligation(
                "preparation: A to E, the end and the direction stay until the next block",
                [z3.Not(self.accept)],
                {"all of them": z3.And(*(after[name] == state[name] for name in PLACE))},
            ),
            self.obligation(
                "verdict: SHARP just when both derivatives are 0 at the start, or |GX| + |GY| < "
                "4·(|A| + |B| + |C|), unless the block is empty",
                block,
                {
                    "judged": z3.Implies(state["tick"] == last_tick, after["fault"] == verdict),
                    "then kept": z3.Implies(self.start, after["fault"] == state["fault"]),
                },
            ),
        ]

    def _derivatives(self) -> list[Obligation]:
        """What a clock does to GX and GY, by additions: what follows for products, _numbers."""
        state, after, n = self.state, self.after, self.width
        block = [*self.known["block"].values(), *self.carries]
        steps = {
            a: z3.If(
                self.clock,
                opposed(state[f"direction_{a}"], after[f"pulse_{a}"]),
                self.number(0),
            )
            for a in "xy"
        }
        others = z3.And(
            z3.Not(self.accept), z3.Or(state["tick"] == 0, state["tick"] == self.last_tick)
        )
        moved = {
            name: z3.Implies(z3.And(others, self.fits(g, total)), after[g] == total)
            for g, (p, q, _) in self.scales().items()
            for name, total in [(g, state[g] + _times(steps["x"], p) + _times(steps["y"], q))]
        }
        moved |= {
            p: z3.Implies(others, after[p] == state[p] + steps[a]) for a, (p, *_) in AXES.items()
        }
        nothing = self.golden.reset()
        return [
            self.obligation(
                f"derivatives: in n + 1 = {n + 1} clocks the bits of the start are taken: X and Y "
                "become 2·X + b and 2·Y + c, G becomes 2·G + P·b + Q·c if that fits; the first "
                "ones count down",
                block,
                dict(self._multiplied()),
            ),
            self.obligation(
                "derivatives: ... which come to X = P1 and Y = P2; then G becomes G + R if that "
                "fits",
                block,
                {
                    a: self.tick(n + 2, self.prefix(n + 2, a) == state[p])
                    for a, (p, *_) in AXES.items()
                }
                | {
                    g: z3.Implies(
                        z3.And(state["tick"] == n + 2, self.fits(g, state[g] + rest)),
                        after[g] == state[g] + rest,
                    )
                    for g, (_, _, rest) in self.scales().items()
                },
            ),
            self.obligation(
                "derivatives: in every other clock G becomes G + P·dx + Q·dy if that fits, and P1 "
                "and P2 become P1 + dx and P2 + dy; after reset all are 0",
                self.everything,
                moved
                | {
                    "reset": z3.BoolVal(
                        not any(nothing[k] for k in (*"abcde", "gx", "gy", "p1", "p2"))
                    )
                },
            ),
        ]

    def scales(self) -> dict[str, tuple[Value, Value, Value]]:
        """Give P, Q and R of both derivatives."""
        a, b, c, d, e = (self.state[k] for k in "abcde")
        return {"gx": (2 * a, b, d), "gy": (b, 2 * c, e)}

    def prefix(self, t: int, axis: str) -> Value:
        """Give X or Y in the clock with ``tick`` = t: the t − 1 top bits of a start, signed."""
        return self.number(0) if t == 1 else self.ghosts[axis] >> (self.width + 2 - t)

    def _multiplied(self) -> Iterator[tuple[str, z3.BoolRef]]:
        state, after, n = self.state, self.after, self.width
        for g in ("gx", "gy"):
            yield f"{g} from 0", z3.Implies(self.accept, after[g] == 0)
        for t in range(1, n + 2):
            bit = {a: (state[p] >> n) & 1 for a, (p, *_) in AXES.items()}
            facts = []
            for a in "xy":
                taken = -bit[a] if t == 1 else 2 * self.prefix(t, a) + bit[a]
                facts.append(self.prefix(t + 1, a) == taken)
            for g, (p, q, _) in self.scales().items():
                digit = z3.If(bit["x"] == 1, p, self.number(0)) + z3.If(
                    bit["y"] == 1, q, self.number(0)
                )
                total = 2 * state[g] + (-digit if t == 1 else digit)
                facts.append(z3.Implies(self.fits(g, total), after[g] == total))
            yield f"clock {t}", self.tick(t, *facts)

    # --- the invariant and what a clock does

    def _induction(self) -> list[Obligation]:
        state, after = self.state, self.after
        reset = {name: self.number(value) for name, value in self.golden.reset().items()}
        moved = {
            a: state[position] + z3.If(self.taken, self.steps[a], self.number(0))
            for a, (_, _, _, position, _) in AXES.items()
        }
        return [
            self.obligation(
                "invariant: it holds after reset",
                [],
                {
                    f"{part}, {name}": fact
                    for part, facts in self.invariant(reset).items()
                    for name, fact in facts.items()
                },
            ),
            self.obligation(
                "invariant: P3 and P4 are the steps to the edge of the coordinates, in the last "
                "piece those to the end, |XK − P1| and |YK − P2|: it survives every clock",
                [],
                self.survives("counted", "block"),
            ),
            self.obligation(
                "invariant: P1 and P2 are the position and the step that waits: likewise",
                [],
                self.survives("placed", "counted", "block"),
            ),
            self.obligation(
                "position: changes by just the step that is taken, and by loading a block's start",
                self.everything,
                {
                    a: after[position] == z3.If(self.load, state[p], moved[a])
                    for a, (p, _, _, position, _) in AXES.items()
                },
            ),
            self.obligation(
                "overflow: P1, P2, XT, YT never wrap, and nothing else needs more bits than it has",
                self.everything,
                {
                    p: z3.Implies(
                        self.clock,
                        self.fits(p, state[p] + opposed(state[f"direction_{a}"], step)),
                    )
                    for a, (p, left, *_) in AXES.items()
                    for step in [
                        z3.If(self.sums, state[left] - after[left], self.number(0)),
                    ]
                }
                | {
                    position: self.fits(position, moved[a])
                    for a, (_, _, _, position, _) in AXES.items()
                }
                | {
                    "all others": z3.And(*(self.fits(name, after[name]) for name in state)),
                },
            ),
        ]

    def _rules(self) -> list[Obligation]:
        """What every kind of clock does to coordinates, counters and directions."""
        state, after, zero, one = self.state, self.after, self.number(0), self.number(1)
        waits = same(
            {f"steps_{a}": step for a, step in self.steps.items()}, self.golden.outputs(after)
        )
        started, turned, stepped, completed = {}, {}, {}, {}
        for a, (p, left, end, _, total) in AXES.items():
            down, down_after = state[f"direction_{a}"], after[f"direction_{a}"]
            ahead = down_after ^ after[f"backward_{a}"] == 1
            entering = state["turns"] == 1
            step, pulse = state[left] - after[left], after[f"pulse_{a}"]
            slow = self.x_speeds_up if a == "y" else z3.Not(self.x_speeds_up)
            started |= {
                f"{a} the way of the velocity": z3.Implies(
                    self.way[a] != 0, ahead == (self.way[a] < 0)
                ),
                f"{total} from the preload": after[total] == self.preload(ahead),
                f"{a} backward just if the end is": (after[f"backward_{a}"] == 1)
                == z3.And(self.last, state[end] != state[p], (state[end] < state[p]) != ahead),
            }
            turned |= {
                f"{a} turns just if it slows down": ahead == z3.Xor(self.down[a], slow),
                f"{a} backward just if the end is": (after[f"backward_{a}"] == 1)
                == z3.And(entering, state[end] != state[p], (state[end] < state[p]) != ahead),
                f"no step of {a}": pulse == 0,
            }
            stepped |= {
                f"{left} less the step": step == pulse,
                f"{p} moves by the step": after[p] == state[p] + opposed(down, pulse),
                f"direction of {a}": down_after == down,
                f"{a} only if it goes": z3.Implies(
                    z3.Or(z3.Not(self.last), z3.Not(self.dead)),
                    z3.Implies(pulse == 1, self.goes[a]),
                ),
                f"none of {a} without a summation": z3.Or(self.sums, pulse == 0),
            }
            completed |= {
                total: after[total] == state[total],
                a: pulse == z3.If(state[left] != 0, one, zero),
            }
        speeds_up = z3.Xor(
            z3.Xor(*(after[f"direction_{a}"] ^ after[f"backward_{a}"] == 1 for a in "xy")),
            state["clockwise"] == 1,
        )
        stands = {
            f"{a}, if it stands, speeds up": z3.Implies(
                z3.And(self.way[a] == 0, self.way[other] != 0),
                speeds_up if a == "x" else z3.Not(speeds_up),
            )
            for a, other in ("xy", "yx")
        }
        stay = ("p1", "p2", "gx", "gy", "sx", "sy")
        turned["coordinates and sums"] = z3.And(*(after[name] == state[name] for name in stay))
        turned["turns"] = after["turns"] == state["turns"] - 1
        return [
            self.obligation(
                "start: both axes go the way of their velocities, one that stands still is the one "
                "that speeds up; SX and SY are the preload, or its complement where an axis falls",
                [*self.everything, self.load],
                started | stands,
            ),
            self.obligation(
                "turn: the axis that slows down turns round, the other one does not; no step, and "
                "P1, P2, GX, GY, SX, SY stay",
                [*self.everything, self.turn],
                turned,
            ),
            self.obligation(
                "one step: at most one step an axis a clock, of an axis that goes, in the "
                "direction of the piece; P1 to P4 change by just the steps that are put out",
                [*self.everything, self.clock, z3.Not(self.turn)],
                stepped,
            ),
            self.obligation(
                "completing steps: only in the last piece and when no axis goes; then one of every "
                "axis with steps left",
                [*self.everything, self.sums, self.dead],
                {"last": self.last} | completed,
            ),
            self.obligation(
                "stall: a step that is not taken stays, and no register of the curve moves",
                [*self.everything, self.waiting, z3.Not(self.taken)],
                {"all registers": self.kept("done", "error"), "step": z3.And(*waits.values())},
            ),
            self.obligation(
                "rejected: a block with a fault moves nothing",
                [*self.everything, self.start, self.sharp],
                {"all registers": self.kept("held", "done", "error")},
            ),
        ]

    # --- the summators

    def lanes(self) -> dict[str, Value]:
        """Give what is scaled: the derivative of an axis that does not go counts as 0."""
        zero = self.number(0)
        return {
            "gx": z3.If(self.goes["y"], self.state["gx"], zero),
            "gy": z3.If(self.goes["x"], self.state["gy"], zero),
            "2a": 2 * self.state["a"],
            "b": self.state["b"],
            "2c": 2 * self.state["c"],
        }

    def scale(self, scaled: dict) -> list[z3.BoolRef]:
        """State what the sums rest on, as it follows of numbers times one power of two."""
        lanes = self.lanes()
        facts = []
        for k, lane in lanes.items():
            value = scaled[f"scaled_{k}"]
            facts += [(value < 0) == (lane < 0), (value == 0) == (lane == 0)]
        for g, k in (("gx", "2a"), ("gy", "2c")):
            greater = _size(scaled[f"scaled_{k}"]) > _size(scaled[f"scaled_{g}"])
            facts.append(z3.Implies(greater, _size(lanes[k]) > _size(lanes[g])))
        return facts

    def limit(self) -> Value:
        """Give the most that s may be: what it was, while both axes go and not on circles."""
        state = self.state
        circle = z3.And(state["b"] == 0, state["a"] == state["c"])
        free = z3.Or(state["fresh"] == 1, circle, z3.Not(self.both))
        return z3.If(free, self.unlimited, state["scale"])

    def first_change(self) -> Value:
        """Give what is added besides its velocity to the axis that is added to first."""
        zero, golden, state, made = self.number(0), self.golden, self.state, self.made
        if not golden.ordered:
            return zero
        # The mean of the last summation's scale and this one's; of no scale at all it is half.
        v = made["first_velocity"]
        straight = z3.And(*(state[k] == 0 for k in "abc"))
        first = z3.If(straight, zero, -(v >> 1)) if golden.preload == "half" else zero
        limited = made["limit"] != self.unlimited
        fell = z3.And(limited, made["limit"] == made["places"] + 1)
        return z3.If(state["fresh"] == 1, first, z3.If(fell, v >> 1, zero))

    def _summed(self) -> dict[str, Value]:
        """Give what the summators should make, each value from those before it."""
        golden, state, made, m = self.golden, self.state, self.made, self.modulus
        cw, zero = state["clockwise"], self.number(0)
        x_first = self.x_speeds_up if golden.ordered else z3.BoolVal(True)
        gx, gy, a2, b, c2 = (made[f"scaled_{k}"] for k in LANES)
        velocity = {"x": opposed(cw, -gy), "y": opposed(cw, gx)}
        links: dict[str, Value] = {}
        for which in ("first", "second"):
            is_x = x_first if which == "first" else z3.Not(x_first)
            down = z3.If(is_x, self.down["x"], self.down["y"])
            can = z3.And(self.sums, z3.If(is_x, self.goes["x"], self.goes["y"]))
            total, step = made[f"{which}_total"], made[f"{which}_step"]
            change = self.first_change() if which == "first" else zero
            own = zero if which == "first" else made["first_own"]
            if which == "second" and golden.ordered:
                # What the first axis's step changes in −Gy or Gx, and what its own changes.
                before = made["first_step"]
                change = opposed(cw, z3.If(is_x, -_times(before, c2), _times(before, a2)))
            if which == "second" and golden.order == "implicit":
                own = opposed(cw, z3.If(is_x, -b, b))
            hit = z3.And(can, z3.If(down, total < 0, total >= m))
            unlimited = made[f"{which}_unlimited"]
            limited = z3.If(unlimited >= 2 * m, self.number(2 * m - 1), unlimited)
            values = {
                "velocity": z3.If(is_x, velocity["x"], velocity["y"]),
                "change": change,
                "total": z3.If(is_x, state["sx"], state["sy"])
                + made[f"{which}_velocity"]
                + made[f"{which}_change"],
                "step": z3.If(hit, z3.If(down, self.number(-1), self.number(1)), zero),
                "own": own,
                "carried": _times(step, m - made[f"{which}_own"]),
                "unlimited": total - made[f"{which}_carried"],
                "rest": z3.If(unlimited < -2 * m, self.number(-2 * m), limited),
            }
            links |= {f"{which}_{name}": value for name, value in values.items()}
        return links

    def _sums(self) -> list[Obligation]:
        """What the summators do."""
        golden, m, made, told = self.golden, self.modulus, self.made, self.told
        state, after = self.state, self.after
        lanes = self.lanes()
        scale = self.scale(made)
        rests = [
            made[name] == value
            for name, value in self.links.items()
            if name.endswith(("_carried", "_unlimited", "_rest"))
        ]
        additions = [
            (made[f"{which}_velocity"], made[f"{which}_change"]) for which in ("first", "second")
        ]
        limited = [made["limit"] == self.limit()] if golden.ordered else []
        linked = [made[name] == value for name, value in self.links.items()]
        scaled = {k: told[f"scaled_{k}"] for k in LANES}
        top = 2 ** (golden.bits - 2)
        # All ones, the greatest of all, when all are 0.
        limit, places = made.get("limit", self.unlimited), told["places"]
        full = (z3.Or(v >= top, v < -top) for v in scaled.values())

        x_first = self.x_speeds_up if golden.ordered else z3.BoolVal(True)
        zero, halved = self.number(0), golden.ordered and golden.initial_sum > 0
        live: dict[str, z3.BoolRef] = {}
        forwards: dict[str, z3.BoolRef] = {}
        hang: dict[str, z3.BoolRef] = {}
        for a, (*_, total) in AXES.items():
            first = x_first if a == "x" else z3.Not(x_first)
            rest = z3.If(first, made["first_rest"], made["second_rest"])
            step = z3.If(first, made["first_step"], made["second_step"])
            live[total] = after[total] == z3.If(self.goes[a], rest, state[total])
            live[f"step of {a}"] = after[f"pulse_{a}"] == step & 1
            down, goes = state[f"direction_{a}"] == 1, self.goes[a]
            added = z3.If(first, *(velocity + change for velocity, change in additions))
            reached = z3.If(first, made["first_total"], made["second_total"])
            nothing = z3.And(first, z3.BoolVal(halved), state.get("fresh", zero) == 1, added == 0)
            forwards[f"{a} forwards"] = z3.Implies(
                goes, z3.Or(nothing, z3.If(down, added < 0, added > 0))
            )
            hang[f"{a} below a carry"] = z3.Implies(goes, z3.If(down, reached >= 0, reached < m))
            hang[total] = z3.Implies(
                self.fits(total, reached), after[total] == z3.If(goes, reached, state[total])
            )
        no_step = z3.And(after["pulse_x"] == 0, after["pulse_y"] == 0)
        hang["all other registers"] = self.kept(*CHANGING)
        hang["one goes"] = z3.Or(*self.goes.values())
        if golden.ordered:
            hang |= {"fresh": after["fresh"] == 0, "scale": after["scale"] == self.kept_scale()}
        which = {
            "implicit": ", of the axis that slows down with GX and GY as the steps leave them",
            "alternated": ", of the axis that slows down with the other one's new coordinate",
            "simultaneous": "",
        }[golden.order]
        sums = [
            self.obligation(
                "scale: 0 or GX, 0 or GY, 2A, B, 2C times one power of two 2^s, the greatest that "
                "loses no bit" + (", of those up to the limit" if golden.ordered else ""),
                [],
                {
                    k: z3.And(
                        scaled[k] == lanes[k] << places,
                        scaled[k] >> places == lanes[k],
                    )
                    for k in LANES
                }
                | {
                    "limited": places <= limit,
                    "greatest": z3.Or(places == limit, *full),
                    "none just of nothing": z3.Implies(
                        z3.Or(*(lane != 0 for lane in lanes.values())), places < self.unlimited
                    ),
                }
                | {
                    "all fit": z3.And(
                        *(self.fits(name, told[name]) for name in made if name not in self.links)
                    )
                },
            ),
            self.obligation(
                "summation: SX + M·dx gains −GY·2^s, SY + M·dy gains GX·2^s, clockwise the "
                f"opposite{which}; beyond −2M or 2M − 1 they stay there",
                [],
                {
                    name: told[name] == value
                    for name, value in self.links.items()
                    if name != "first_change" or not golden.ordered
                }
                | {"all fit": z3.And(*(self.fits(name, told[name]) for name in self.links))}
                | {name: z3.Implies(self.live, fact) for name, fact in live.items()},
            ),
            self.obligation(
                "no hang: every clock of a block whose step does not wait turns an axis round, "
                "puts out a step, or leaves all but the sums as they are; then every axis that "
                "goes adds at least 1 in its direction, below a carry"
                + (", or at least 0 in the first of a block" if halved else ""),
                [*self.everything, self.clock],
                {
                    "turn": z3.Implies(self.turn, after["turns"] == state["turns"] - 1),
                    "completing": z3.Implies(
                        z3.And(self.sums, self.dead), after["pulse_x"] + after["pulse_y"] >= 1
                    ),
                }
                | {
                    name: z3.Implies(z3.And(self.live, no_step, *scale, *linked), fact)
                    for name, fact in forwards.items()
                }
                | {
                    name: z3.Implies(z3.And(self.live, no_step, *rests), fact)
                    for name, fact in hang.items()
                },
            ),
            self._inside([*scale, *limited, *linked]),
        ]
        return [*sums, *(self._limits() if golden.ordered else [])]

    def kept_scale(self) -> Value:
        """Give what a summation leaves of its scale: nothing if only one axis goes."""
        return z3.If(self.both, self.made["places"], self.unlimited)

    def _limits(self) -> list[Obligation]:
        """What the scale of a summation has to do with that of the one before."""
        state, after, made, told = self.state, self.after, self.made, self.told
        limited = told["limit"] != self.unlimited
        never = z3.Implies(
            z3.And(
                self.sums, limited, made["limit"] == told["limit"], made["places"] <= told["limit"]
            ),
            z3.And(after["scale"] <= state["scale"], after["scale"] == made["places"]),
        )
        v, changed = made["first_velocity"], made["first_velocity"] + self.first_change()
        half = ", half of its very first one (not on lines)" if self.golden.initial_sum else ""
        return [
            self.obligation(
                "limit: none in the first summation of a block, on circles (B = 0, A = C) and "
                "where only one axis goes or went last; else s of the last summation: while both "
                "axes go s never rises",
                [*self.known["block"].values(), *self.carries],
                {
                    "limit": told["limit"] == self.limit(),
                    "fits": self.fits("limit", told["limit"]),
                    "first": z3.Implies(self.load, after["fresh"] == 1),
                    "then not": z3.Implies(self.sums, after["fresh"] == 0),
                    "kept": z3.Implies(self.sums, after["scale"] == self.kept_scale()),
                    "else both stay": z3.Implies(
                        z3.Not(z3.Or(self.load, self.sums)),
                        z3.And(*(after[k] == state[k] for k in ("fresh", "scale"))),
                    ),
                    "never rises": never,
                },
            ),
            self.obligation(
                "mean scale: the axis that speeds up gains 3/2 of its increment where s falls to 1 "
                f"below a limit{half}, and just the increment elsewhere; never the opposite",
                [],
                {
                    "mean": told["first_change"] == self.first_change(),
                    "never the opposite": z3.Implies(v >= 0, changed >= 0),
                    "nor downwards": z3.Implies(v <= 0, changed <= 0),
                },
            ),
        ]

    def _inside(self, made: list) -> Obligation:
        """State where SX and SY never leave 0 … M − 1, so that nothing is ever limited."""
        state, after = self.state, self.after
        sums = [total for *_, total in AXES.values()]
        within = {name: z3.And(after[name] >= 0, after[name] < self.modulus) for name in sums}
        before = [z3.And(state[name] >= 0, state[name] < self.modulus) for name in sums]
        title, block = "sums: SX and SY stay within 0 … M − 1", []
        if not self.golden.ordered:
            title += ", in every block"
        elif not self.golden.guard:
            title += ", for A = B = C = 0: lines"
            block = [state[k] == 0 for k in "abc"]
        else:
            title += (
                ", for B = 0, A and C not negative, and D, E multiples of 2A, 2C unless these are "
                "0: lines, and circles about a grid point"
            )
            lanes = self.lanes()
            block = [state["a"] >= 0, state["b"] == 0, state["c"] >= 0]
            block += [
                z3.Or(lanes[g] == 0, lanes[k] <= _size(lanes[g]))
                for g, k in (("gx", "2a"), ("gy", "2c"))
            ]
        return self.obligation(title, [*self.everything, *made, *before, *block], within)

    # --- the end

    def _answers(self) -> list[Obligation]:
        """How a block ends and is answered."""
        golden, state, after = self.golden, self.state, self.after
        outputs, later = golden.outputs(state), golden.outputs(after)
        ended = z3.And(self.taken, outputs["steps_last"] == 1)
        emptied = z3.And(self.load, self.empty)
        rejected = z3.And(self.start, self.sharp)
        arrived = {
            position: after[position] == state[end] for _, _, end, position, _ in AXES.values()
        }
        done, error = after["done"] == 1, after["error"] != 0
        stopped = z3.And(self.running, after["running"] == 0)
        nothing = {f"step {a}": after[f"pulse_{a}"] == 0 for a in "xy"}
        return [
            self.obligation(
                "end: when a block is done its end point is reached exactly",
                [*self.everything, z3.Or(ended, emptied, self.stepless)],
                {"done": done} | arrived,
            ),
            self.obligation(
                "end: a block of no length is done where it starts, without a step",
                [*self.everything, emptied],
                {"stands": after["running"] == 0} | nothing,
            ),
            self.obligation(
                "end: the clock in which a curve stops puts out its last step, unless it is the "
                "change of direction before the last piece and the end has been reached",
                [*self.everything, stopped],
                {
                    "waits": z3.Or(self.stepless, later["steps_valid"] == 1),
                    "last": z3.Or(self.stepless, later["steps_last"] == 1),
                    "stepless": z3.Implies(self.stepless, z3.And(*nothing.values())),
                },
            ),
            self.obligation(
                "answer: done or error just one clock after a last step is taken, a block of no "
                "length is started, a stepless end or a rejection",
                self.everything,
                {
                    "done": done == z3.Or(ended, emptied, self.stepless),
                    "error": after["error"] == z3.If(rejected, state["fault"], self.number(0)),
                    "one": z3.AtMost(ended, emptied, self.stepless, rejected, 1),
                },
            ),
            self.obligation(
                "answer: busy from the clock after acceptance, and in the clock in which it ends "
                "done or error, never both: one answer a block",
                self.everything,
                {
                    "accepted": z3.Implies(self.accept, later["busy"] == 1),
                    "idle": z3.Implies(z3.Not(z3.Or(self.busy, self.accept)), later["busy"] == 0),
                    "answered": z3.Or(done, error) == z3.And(self.busy, later["busy"] == 0),
                    "one": z3.Not(z3.And(done, error)),
                },
            ),
        ]


def _size(value: Value) -> Value:
    return z3.If(value < 0, -value, value)


def _times(step: Value, value: Value) -> Value:
    """Multiply by a step: −1, 0 or 1."""
    return z3.If(step == 0, z3.BitVecVal(0, value.size()), z3.If(step < 0, -value, value))


def _numbers(golden: Conic) -> list[Obligation]:
    """What the additions come to, in numbers; all that is whole is a real number too."""
    n, bits = golden.width, golden.bits
    p, q, r, x, y, g, new = z3.Reals("P Q R x y G G'")
    k, whole, u, v = z3.Ints("A D/2A u v")
    coefficient, constant, edge, top = 2 ** (n + 3), 2 ** (2 * n + 4), 2**n, 2 ** (bits - 1)
    # Of P and Q one is 2A or 2C, the other B.
    scales = [p >= -2 * coefficient, p <= 2 * coefficient, r >= -constant, r < constant]
    scales += [q >= -2 * coefficient, q <= 2 * coefficient]
    scales.append(z3.Or(*(z3.And(scale >= -coefficient, scale <= coefficient) for scale in (p, q))))
    taken, value = p * x + q * y, p * x + q * y + r
    steps = {(dx, dy): g + dx * p + dy * q for dx, dy in product((-1, 0, 1), repeat=2)}
    bits_taken = list(product((0, 1), repeat=2))

    def inside(*place: z3.ArithRef) -> z3.BoolRef:
        return z3.And(*(z3.And(at >= -edge, at <= edge - 1) for at in place))

    def fits(at: z3.ArithRef) -> z3.BoolRef:
        return z3.And(at >= -top, at < top)

    def follows(known: z3.BoolRef, at: tuple, total: z3.ArithRef, meant: z3.ArithRef) -> z3.BoolRef:
        """State that the register is what is meant, if it is the total whenever that fits."""
        kept = z3.Implies(fits(total), new == total)
        return z3.Implies(z3.And(known, inside(*at), kept), new == meant)

    def at(dx, dy, rest):
        return p * (x + dx) + q * (y + dy) + rest

    proven = {}
    for b, c in bits_taken:
        proven[f"first bits {b} {c}"] = follows(
            g == 0, (), 2 * g - (b * p + c * q), p * -b + q * -c
        )
        doubled = (2 * x + b, 2 * y + c)
        proven[f"bits {b} {c}"] = follows(
            g == taken, doubled, 2 * g + b * p + c * q, p * doubled[0] + q * doubled[1]
        )
    proven["R"] = follows(g == taken, (x, y), g + r, value)
    for (dx, dy), total in steps.items():
        proven[f"step {dx} {dy}"] = follows(g == value, (x + dx, y + dy), total, at(dx, dy, r))
    return [
        Obligation(
            "scale converter: what the multiplying shape gives at (x + dx, y + dy) is G + P·dx + "
            "Q·dy, the incremental shape's, from the G that it gives at (x, y); at any width",
            [],
            {
                **{
                    f"multiplying, bits {b} {c}": z3.Implies(
                        g == taken, 2 * g + b * p + c * q == p * (2 * x + b) + q * (2 * y + c)
                    )
                    for b, c in bits_taken
                },
                **{
                    f"incremental, step {dx} {dy}": z3.Implies(g == value, total == at(dx, dy, r))
                    for (dx, dy), total in steps.items()
                },
            },
            True,
        ),
        Obligation(
            f"overflow: P·x + Q·y, with R and without, fits the 2n + 7 = {bits} bits of GX and GY "
            f"for all coefficients and coordinates from −2^n to 2^n − 1",
            [*scales, inside(x, y)],
            {"without R": fits(taken), "with R": fits(value)},
            True,
        ),
        Obligation(
            "derivatives: so GX = 2A·P1 + B·P2 + D and GY = B·P1 + 2C·P2 + E when a block is "
            "prepared, and after every step",
            scales,
            proven,
            True,
        ),
        Obligation(
            "numbers: 2^s takes no number across 0, and none beyond another one",
            [k >= 1],
            {
                "sign": z3.And((u * k < 0) == (u < 0), (u * k == 0) == (u == 0)),
                "order": z3.Implies(_size(u) <= _size(v), _size(u * k) <= _size(v * k)),
            },
            True,
        ),
        Obligation(
            "numbers: where D is a multiple of 2A, GX is 0 or at least |2A|; so are E, 2C and GY",
            [],
            {
                "a multiple": 2 * k * z3.Int("x") + 2 * k * whole == 2 * k * (z3.Int("x") + whole),
                "of that size": z3.Implies(
                    2 * k * whole != 0,
                    z3.If(whole < 0, -whole, whole) * _size(2 * k) >= _size(2 * k),
                ),
            },
            True,
        ),
    ]


def _ends(golden: Conic) -> list[Obligation]:
    """What follows for the clocks of a piece."""
    m, size = golden.modulus, 2 ** (golden.width + 1)
    t, begun, now, added, new = z3.Ints("t S₀ S added S'")
    p3, p4, put_out, rest = z3.Ints("P3 P4 steps rest")
    new_fits = z3.Implies(z3.And(now + added >= -2 * m, now + added < 2 * m), new == now + added)
    return [
        Obligation(
            "it always ends: what is added without a step moves the sum by just that",
            [now >= -2 * m, now < 2 * m, new_fits],
            {
                "rising": z3.Implies(z3.And(added >= 0, now + added < m), new == now + added),
                "falling": z3.Implies(z3.And(added <= 0, now + added >= 0), new == now + added),
            },
            True,
        ),
        Obligation(
            "it always ends: so an axis that goes comes to a step after at most 3M summations "
            "without one, of which the first may add 0",
            [begun >= -2 * m, begun < 2 * m],
            {
                "rising": z3.Implies(z3.And(now >= begun + t - 1, now < m), t <= 3 * m),
                "falling": z3.Implies(z3.And(now <= begun - (t - 1), now >= 0), t <= 3 * m),
            },
            True,
        ),
        Obligation(
            "it always ends: so a piece takes fewer than (3M + 1)·(P3 + P4 + 1) summations, fewer "
            f"than {2 * (3 * m + 1) * size}; a curve has turns + 1 pieces",
            [
                *[z3.And(left >= 0, left < size) for left in (p3, p4)],
                *[put_out >= 0, put_out <= p3 + p4, rest >= 0, rest <= 3 * m],
                t <= (3 * m + 1) * put_out + rest,
            ],
            {
                "of a piece": t < (3 * m + 1) * (p3 + p4 + 1),
                "of any": t < 2 * (3 * m + 1) * size,
            },
            True,
        ),
    ]
