"""Promises of the exact interpolator of second-order curves, proven for every block at a width.

They are shown of the golden model's own source, which the device is proven equal to. Two kinds:

- about the registers, in bit-vectors: an invariant is shown to hold after reset and to survive
  every clock from every state that satisfies it, whatever the inputs; the promises follow from it;
- about numbers: no product is ever asked for in bits. The bit-vectors show what a clock does by
  additions alone, the numbers what this comes to.

Ghost values remember what no register holds: ``F``, the curve's value at the point (P1, P2), and
its derivatives ``X`` and ``Y`` there, moved along by additions as the point moves; A, B and C, and
the end of the block that runs; the same of the one that is prepared, whose derivatives are those
that its multiplication has come to. Of numbers that are kept to the bits of a register equality is
meant there: that the derivatives never leave theirs is shown of the numbers.

Notation: u is the axis that leads, v the other one, g and h the derivatives by u and v in the
direction of the piece, α, β, γ the coefficients of u², u·v and v².
"""

from itertools import product

import z3

from discreta.sim.golden.exact_conic import CHANGES, EXTRAS, ExactConic
from discreta.sim.golden.logic import Value, where
from discreta.sim.smt import Obligation, numbers

__all__ = ["promises"]

RANGE, OFF_CURVE, SHARP = 1, 2, 3

#: x, and y: coordinate, way to the end, position.
AXES = {"x": ("p1", "p3", "xt"), "y": ("p2", "p4", "yt")}
#: What is set by a block's start or by steps, and nothing else.
PATH = ("p1", "p2", "p3", "p4", "xt", "yt")


def promises(golden: ExactConic) -> list[Obligation]:
    """Give everything that is promised of the exact interpolator of second-order curves."""
    return [*_Registers(golden).obligations(), *_numbers(golden)]


class _Registers:
    """What is promised of the registers, in bit-vectors."""

    def __init__(self, golden: ExactConic):
        self.golden = golden
        self.width = n = golden.width
        # As wide as the residuals: their sums need no bits taken off.
        self.wide = golden.residual_bits
        self.kinds = kinds = golden.registers()
        self.ranges: list[z3.BoolRef] = []
        self.state = state = self.numbers(kinds)
        received = {"next_x": "start_x", "next_y": "start_y"}
        received |= {"next_p3": "end_x", "next_p4": "end_y", "next_turns": "turns"}
        received |= {name: name for name in (*"abcde", "clockwise")}
        inputs = {f"blocks_{port}": kinds[name] for name, port in received.items()}
        inputs |= dict.fromkeys(("blocks_end_x", "blocks_end_y"), kinds["next_x"])
        inputs["blocks_b"] = kinds["a"]
        inputs |= dict.fromkeys(("blocks_valid", "steps_ready"), (1, False))
        self.inputs = self.numbers(inputs)
        self.after = golden.step(state, self.inputs)

        outputs = golden.outputs(state)
        self.steps = {a: outputs[f"steps_{a}"] for a in "xy"}
        self.waiting = outputs["steps_valid"] == 1
        ready = self.inputs["steps_ready"] == 1
        self.taken = z3.And(self.waiting, ready)
        self.free = z3.Or(z3.Not(self.waiting), ready)
        self.busy = outputs["busy"] == 1
        self.accept = z3.And(self.inputs["blocks_valid"] == 1, state["held"] == 0)
        self.running = state["running"] == 1
        self.clock = z3.And(self.running, self.free)
        self.ends = z3.And(self.clock, self.after["running"] == 0)
        # What the point moves by in a clock that does not end the block.
        leads = {"x": state["steep"] == 0, "y": state["steep"] == 1}
        self.moves = {
            a: z3.If(
                z3.And(self.clock, state["turning"] == 0, z3.Or(leads[a], state["diagonal"] == 1)),
                where(state[f"direction_{a}"], self._number(-1), self._number(1)),
                self._number(0),
            )
            for a in "xy"
        }

        # The next block starts: it is taken over, or refused, or has nothing to do.
        self.empty = state["next_empty"] == 1
        self.pending = state["prepared"] == 1
        still = z3.Or(self.empty, state["fault"] != 0)
        may = z3.If(still, z3.Not(self.waiting), self.free)
        self.start = z3.And(self.pending, z3.Not(self.running), may)
        self.load = z3.And(self.start, state["fault"] == 0)

        most = 5 * 2 ** (2 * n + 3)
        self.ghosts = self._ghosts("")
        self.next_ghosts = self._ghosts("next.")
        for ghosts in (self.ghosts, self.next_ghosts):
            self.ranges += [z3.And(ghosts[k] >= -most, ghosts[k] <= most) for k in "XY"]
        self.ghosts_after = self._moved()
        self.next_ghosts_after = self._captured()
        #: Derivatives are within these everywhere: that is shown of the numbers.
        self.bounds = [
            z3.And(self.ghosts_after[k] >= -most, self.ghosts_after[k] <= most) for k in "XY"
        ]

    def _ghosts(self, prefix: str) -> dict[str, Value]:
        n = self.width
        kinds: dict[str, tuple[int, bool]] = dict.fromkeys("ABC", (n + 4, True))
        kinds |= dict.fromkeys("XY", (2 * n + 7, True))
        kinds |= dict.fromkeys(("end_x", "end_y"), (n + 1, True))
        ghosts = self.numbers(kinds, f"ghost.{prefix}")
        # The curve's value can be any number at all.
        return ghosts | {"F": z3.BitVec(f"ghost.{prefix}F", self.wide)}

    def numbers(self, kinds: dict[str, tuple[int, bool]], prefix: str = "") -> dict[str, Value]:
        """Make symbols, and keep their ranges for :meth:`obligation`."""
        narrow = {name: kind for name, kind in kinds.items() if kind[0] < self.wide}
        values, ranges = numbers(narrow, self.wide, prefix)
        self.ranges += ranges
        return {name: z3.BitVec(prefix + name, self.wide) for name in kinds} | values

    def obligation(self, title: str, assumptions: list, claims: dict) -> Obligation:
        """State something about the symbols."""
        return Obligation(title, assumptions, claims, ranges=self.ranges)

    def _number(self, value: int) -> z3.BitVecNumRef:
        return z3.BitVecVal(value, self.wide)

    def _bit(self, condition: z3.BoolRef) -> Value:
        return z3.If(condition, self._number(1), self._number(0))

    def _is(self, name: str, register: Value, value: Value) -> z3.BoolRef:
        """State that a register has a value, in as many bits as it has."""
        bits, _ = self.kinds[name]
        return z3.Extract(bits - 1, 0, register) == z3.Extract(bits - 1, 0, value)

    # --- ghosts

    def _moved(self) -> dict[str, Value]:
        """Give the ghosts of the block that runs after a clock: moved, or those of the next one."""
        moved, loaded = self._advanced(self.moves), self.next_ghosts | {"F": self._number(0)}
        return {name: z3.If(self.load, loaded[name], value) for name, value in moved.items()}

    def _advanced(self, moves: dict[str, Value]) -> dict[str, Value]:
        """Give the ghosts of the block that runs after the point has moved."""
        old = self.ghosts
        dx, dy = moves["x"], moves["y"]

        def by(step: Value, value: Value) -> Value:
            return where(step, where(self._bit(step < 0), -value, value), self._number(0))

        both = by(dx, by(dy, old["B"]))
        squares = where(dx, old["A"], self._number(0)) + where(dy, old["C"], self._number(0))
        return old | {
            "F": old["F"] + by(dx, old["X"]) + by(dy, old["Y"]) + squares + both,
            "X": old["X"] + by(dx, 2 * old["A"]) + by(dy, old["B"]),
            "Y": old["Y"] + by(dx, old["B"]) + by(dy, 2 * old["C"]),
        }

    def _captured(self) -> dict[str, Value]:
        """Give the ghosts of the block that is prepared after a clock."""
        state, old = self.state, self.next_ghosts
        multiplied = state["tick"] == self.width + 3
        given = {k.upper(): self.inputs[f"blocks_{k}"] for k in "abc"}
        given |= {k: self.inputs[f"blocks_{k}"] for k in ("end_x", "end_y")}
        captured = {name: z3.If(self.accept, value, old[name]) for name, value in given.items()}
        for name, register in (("X", "gx"), ("Y", "gy")):
            captured[name] = z3.If(multiplied, state[register], old[name])
        return old | captured

    def _frame(self, ghosts: dict, steep: Value, down_x: Value, down_y: Value) -> dict[str, Value]:
        """Give the derivatives and the coefficients as they are seen along a piece."""
        x, y = (where(d, -ghosts[k], ghosts[k]) for k, d in (("X", down_x), ("Y", down_y)))
        return {
            "g": where(steep, y, x),
            "h": where(steep, x, y),
            "alpha": where(steep, ghosts["C"], ghosts["A"]),
            "beta": where(down_x ^ down_y, -ghosts["B"], ghosts["B"]),
            "gamma": where(steep, ghosts["A"], ghosts["C"]),
        }

    @staticmethod
    def _middles(frame: dict[str, Value], f: Value, slows: Value) -> tuple[Value, Value]:
        """Give 2F at the middle ahead, and at that of the frame to come, rounded down."""
        g, h, alpha, beta, gamma = (frame[k] for k in ("g", "h", "alpha", "beta", "gamma"))
        ahead = 2 * f + 2 * g + h + 2 * alpha + beta + (gamma >> 1)
        turned = 2 * f + 2 * g - h + 2 * alpha - beta + (gamma >> 1)
        led = 2 * f + 2 * h + g + 2 * gamma + beta + (alpha >> 1)
        return ahead, where(slows, turned, led)

    @staticmethod
    def _extras(frame: dict[str, Value]) -> dict[str, tuple[Value, Value]]:
        """Give what steps add to the outer residual alone, where v slows down and where not."""
        alpha, beta, gamma = (frame[k] for k in ("alpha", "beta", "gamma"))
        return {
            "outer_straight": (-2 * beta, beta - 2 * alpha),
            "outer_aslant": (-2 * beta - 4 * gamma, 2 * gamma - 2 * alpha),
        }

    @staticmethod
    def _constants(frame: dict[str, Value]) -> dict[str, tuple[Value, Value]]:
        """Give what the next change of the frame adds, where v slows down and where not."""
        alpha, beta, gamma = (frame[k] for k in ("alpha", "beta", "gamma"))
        more = (alpha + (alpha >> 1)) + (2 * beta + (beta >> 1)) + (4 * gamma - (gamma >> 1))
        return {
            "turn_outer": (more, 4 * alpha + 2 * alpha - beta),
            "turn_axial": (-2 * beta, 2 * gamma - beta - 2 * beta),
            "turn_across": (4 * gamma, 2 * beta - alpha - (beta >> 1)),
        }

    # --- what there is to say of a state

    def summed(self, state: dict, ghosts: dict, *, modular: bool = False) -> dict[str, z3.BoolRef]:
        """State that the registers of the running block are what the curve says.

        With ``modular`` axial and across are meant in as many bits as they have.
        """
        slows = state["slows"]
        frame = self._frame(ghosts, state["steep"], state["direction_x"], state["direction_y"])
        ahead, other = self._middles(frame, ghosts["F"], slows)
        axial = 2 * frame["g"] + 6 * frame["alpha"] + frame["beta"]
        across = frame["h"] + 2 * frame["beta"] + 2 * frame["gamma"]
        stays = z3.And(slows == 1, state["turns"] == 0)
        constants = self._extras(frame) | self._constants(state)
        values = {"residual": ahead, "outer": other, "axial": axial, "across": across}
        values |= {name: frame[name] for name in ("alpha", "beta", "gamma")}
        facts = {name: state[name] == value for name, value in values.items()}
        if modular:
            facts |= {k: self._is(k, state[k], values[k]) for k in ("axial", "across")}
        facts |= {name: state[name] == where(slows, *constants[name]) for name in EXTRAS}
        settled = state["fresh"] == 0
        facts |= {
            name: z3.Implies(settled, state[name] == where(slows, *constants[name]))
            for name in CHANGES
        }
        facts["diagonal"] = (state["diagonal"] == 1) == (
            z3.If(slows == 1, state["residual"] < 0, state["residual"] >= 0)
        )
        facts["turning"] = (state["turning"] == 1) == z3.And(state["outer"] >= 0, z3.Not(stays))
        running = state["running"] == 1
        return {name: z3.Implies(running, fact) for name, fact in facts.items()}

    def prepared(
        self, state: dict, ghosts: dict, *, modular: bool = False
    ) -> dict[str, z3.BoolRef]:
        """State what is known of a block that is prepared, tick by tick.

        With ``modular`` the constants of its first frame are meant in as many bits as they have.
        """
        n, tick, held = self.width, state["tick"], state["held"] == 1
        last = self.golden.last_tick
        directions = (state[f"next_down_{a}"] for a in "xy")
        frame = self._frame(ghosts, state["next_steep"], *directions)
        g, h, alpha, beta, gamma = (frame[k] for k in ("g", "h", "alpha", "beta", "gamma"))
        slows = state["next_slows"]
        ahead, other = self._middles(frame, self._number(0), slows)
        small = (2 * alpha + beta + (gamma >> 1), ahead - 2 * g - h)
        rest = where(slows, 2 * alpha - beta + (gamma >> 1), 2 * gamma + beta + (alpha >> 1))

        def at(k: int) -> z3.BoolRef:
            return z3.And(held, tick == n + k)

        done = state["prepared"] == 1
        extras = self._extras(frame)
        pairs = [
            (k, state[k], where(slows, *extras[name])) for k, name in zip("de", EXTRAS, strict=True)
        ]
        same = self._is if modular else lambda _, register, value: register == value
        turned = z3.Or(z3.And(held, tick > n + 5), done)
        axial, across = 2 * g + 6 * alpha + beta, h + 2 * beta + 2 * gamma
        way = {
            f"{p} to the end": z3.Implies(
                z3.Or(z3.And(held, tick > n + 2), done), state[p] == ghosts[f"end_{a}"] - state[s]
            )
            for a, p, s in (("x", "next_p3", "next_x"), ("y", "next_p4", "next_y"))
        }
        end = {
            f"{p} is the end": z3.Implies(
                z3.And(held, tick > 0, tick < n + 3), state[p] == ghosts[f"end_{a}"]
            )
            for a, p in (("x", "next_p3"), ("y", "next_p4"))
        }
        raw = z3.And(*(state[k] == ghosts[k.upper()] for k in "abc"))
        placed = z3.And(state["gx"] == ghosts["X"], state["gy"] == ghosts["Y"])
        return (
            way
            | end
            | {
                "tick": z3.And(tick >= 0, tick <= last, z3.Implies(tick > 0, held)),
                "prepared": z3.And(
                    z3.Implies(done, z3.And(held, tick == 0)),
                    z3.Implies(z3.And(held, tick == 0), done),
                ),
                "empty": z3.Implies(
                    z3.Or(z3.And(held, tick > n + 3), done),
                    (state["next_empty"] == 1)
                    == z3.And(*(state[name] == 0 for name in ("next_turns", "next_p3", "next_p4"))),
                ),
                "extras": z3.Implies(done, z3.And(*(same(*it) for it in pairs))),
                "fault": z3.Or(state["fault"] == 0, state["fault"] == SHARP),
                "no fault yet": z3.Implies(z3.And(tick > 0, tick < n + 8), state["fault"] == 0),
                "coefficients": z3.Implies(z3.And(held, tick > 0, tick < n + 6), raw),
                "derivatives": z3.Implies(z3.Or(at(4), at(5)), placed),
                "frame": z3.Implies(
                    turned,
                    z3.And(state["a"] == alpha, state["b"] == beta, state["c"] == gamma),
                ),
                "seen": z3.Implies(at(6), z3.And(state["gx"] == g, state["gy"] == h)),
                "seen still": z3.Implies(at(7), z3.And(state["gx"] == g, state["gy"] == h)),
                "first sums": z3.Implies(
                    at(7),
                    z3.And(
                        state["d"] == 6 * alpha + beta,
                        state["e"] == 2 * beta + 2 * gamma,
                        state["next_residual"] == where(slows, h - g, g - h),
                    ),
                ),
                "axial, across": z3.Implies(
                    z3.Or(at(8), done),
                    z3.And(state["gx"] == axial, state["gy"] == across),
                ),
                "second sums": z3.Implies(
                    at(8),
                    z3.And(
                        state["next_residual"] == 2 * g + h,
                        state["next_outer"] == where(slows, 2 * g - h, 2 * h + g),
                        state["d"] == small[0],
                        state["e"] == rest,
                    ),
                ),
                "residuals": z3.Implies(
                    done,
                    z3.And(state["next_residual"] == ahead, state["next_outer"] == other),
                ),
            }
        )

    def placed(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """State what is known of the place on the curve."""
        running = state["running"] == 1
        pulses = z3.Or(state["pulse_x"] == 1, state["pulse_y"] == 1)
        facts = {}
        for a, (p, left, position) in AXES.items():
            pulse, down = state[f"pulse_{a}"], state[f"direction_{a}"]
            step = where(pulse, where(down, self._number(-1), self._number(1)), self._number(0))
            facts |= {
                f"{left} to the end": z3.Implies(
                    running, state[left] == ghosts[f"end_{a}"] - state[p]
                ),
                f"{p} and the step that waits": z3.Implies(
                    running, state[p] == state[position] + step
                ),
                f"{a}: the step that waits leads to the end": z3.Implies(
                    z3.And(pulses, z3.Not(running)), state[position] + step == ghosts[f"end_{a}"]
                ),
            }
        return facts

    def invariant(self, state: dict, ghosts: dict, next_ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        return (
            self.summed(state, ghosts)
            | self.placed(state, ghosts)
            | self.prepared(state, next_ghosts)
        )

    # --- obligations

    def obligations(self) -> list[Obligation]:
        """Give the obligations."""
        return [*self._induction(), *self._preparation(), *self._path(), *self._answers()]

    def _cases(self) -> dict[str, z3.BoolRef]:
        """State that a clock pulse, and a start, keep what is known of the residuals.

        In each case, by frame and by what the clock does, the sums are all there is to compare.
        """
        state, golden = self.state, self.golden
        names = ("steep", "slows", "turning", "diagonal", "direction_x", "direction_y")
        claims = {}
        for bits in product((0, 1), repeat=len(names)):
            known: dict[str, int] = dict(zip(names, bits, strict=True))
            here = state | {name: self._number(bit) for name, bit in known.items()}
            after = golden._summed(here, self._number(0), _keep)
            after |= {"running": self._number(1)}
            # The slower axis turns round.
            flips = known["turning"] & known["slows"]
            after["direction_x"] = here["direction_x"] ^ (flips & known["steep"])
            after["direction_y"] = here["direction_y"] ^ (flips & (1 - known["steep"]))
            if not known["turning"]:
                after |= {name: here[name] for name in ("alpha", "beta", "gamma")}
            constants = self._constants(here)
            after |= {name: constants[name][1 - known["slows"]] for name in CHANGES}
            half = (here["axial"] >> 1, self._half(here))
            after = {name: z3.substitute(value, half) for name, value in after.items()}
            way = {
                "x": (not known["steep"] or known["diagonal"]) and not known["turning"],
                "y": (known["steep"] or known["diagonal"]) and not known["turning"],
            }
            moves = {
                a: self._number((1 - 2 * known[f"direction_{a}"]) if way[a] else 0) for a in "xy"
            }
            case = [state[name] == bit for name, bit in known.items()]
            case += [state["running"] == 1, z3.Or(state["turning"] == 0, state["fresh"] == 0)]
            words = "".join(map(str, bits))
            for name, fact in self.summed(after, self._advanced(moves), modular=True).items():
                claims[f"{name} {words}"] = z3.Implies(z3.And(*case), z3.simplify(fact))
        frame = ("next_steep", "next_slows", "next_down_x", "next_down_y")
        loaded = golden._summed(state, self._number(1), _keep) | {"running": self._number(1)}
        loaded |= {f"direction_{a}": state[f"next_down_{a}"] for a in "xy"}
        loaded |= dict.fromkeys(CHANGES, self._number(0))
        ghosts = self.next_ghosts | {"F": self._number(0)}
        for bits in product((0, 1), repeat=len(frame)):
            case = [state[k] == bit for k, bit in zip(frame, bits, strict=True)]
            case += [state["prepared"] == 1, state["held"] == 1, state["tick"] == 0]
            words = "".join(map(str, bits))
            for name, fact in self.summed(loaded, ghosts).items():
                claims[f"{name} at a start {words}"] = z3.Implies(z3.And(*case), fact)
        return claims

    def _handed(self) -> dict[str, z3.BoolRef]:
        """State that these are just what the registers become."""
        state, after, golden = self.state, self.after, self.golden
        waits = z3.And(state["turning"] == 1, state["fresh"] == 1)
        pulse = golden._summed(state, self._number(0), _keep)
        start = golden._summed(state, self._number(1), _keep)
        claims = {}
        for name in pulse:
            kept = self._number(0) if name == "fresh" else state[name]
            claims |= {
                f"{name} by a pulse": z3.Implies(
                    z3.And(self.clock, z3.Not(waits)), after[name] == pulse[name]
                ),
                f"{name} at a start": z3.Implies(self.load, after[name] == start[name]),
                f"{name} in a wait": z3.Implies(z3.And(self.clock, waits), after[name] == kept),
                f"{name} kept": z3.Implies(
                    z3.Not(z3.Or(self.clock, self.load)), after[name] == state[name]
                ),
            }
        claims |= {
            f"{name} in a step": z3.Implies(state["turning"] == 0, pulse[name] == state[name])
            for name in ("alpha", "beta", "gamma")
        }
        flips = z3.And(state["turning"] == 1, state["fresh"] == 0, state["slows"] == 1)
        goes = z3.And(self.clock, z3.Not(self.ends))
        for a, minor in (("x", state["steep"] == 1), ("y", state["steep"] == 0)):
            name = f"direction_{a}"
            turned = z3.If(z3.And(flips, minor), 1 - state[name], state[name])
            claims |= {
                f"{name} by a pulse": z3.Implies(goes, after[name] == turned),
                f"{name} at a start": z3.Implies(self.load, after[name] == state[f"next_down_{a}"]),
                f"{name} kept": z3.Implies(
                    z3.Not(z3.Or(self.clock, self.load)), after[name] == state[name]
                ),
            }
        kept = self._constants(state)
        small = z3.And(
            state["beta"] <= 2 ** (self.width + 3), state["beta"] > -(2 ** (self.width + 4))
        )
        claims |= {
            f"{name} anew": z3.Implies(small, after[name] == where(state["slows"], *kept[name]))
            for name in CHANGES
        }
        return claims

    def _frame_of(self, state: dict) -> dict[str, Value]:
        return self._frame(
            self.ghosts, *(state[k] for k in ("steep", "direction_x", "direction_y"))
        )

    def _half(self, state: dict) -> Value:
        """Give half of what axial is, rounded down."""
        frame = self._frame_of(state)
        return frame["g"] + 3 * frame["alpha"] + (frame["beta"] >> 1)

    def _ticks(self, facts: dict[str, z3.BoolRef]) -> dict[str, z3.BoolRef]:
        """Split what is claimed of a preparation by the clock, and by the frame if it is known."""
        state, n = self.state, self.width
        names = ("next_steep", "next_slows", "next_down_x", "next_down_y")
        claims = {
            "there are no other cases": z3.Or(
                z3.And(state["held"] == 0, state["prepared"] == 0, state["tick"] == 0),
                z3.And(state["held"] == 1, state["prepared"] == 1, state["tick"] == 0),
                z3.And(state["held"] == 1, state["prepared"] == 0, state["tick"] > 0),
            )
        }
        for name, fact in facts.items():
            for words, held, prepared, tick in (
                ("without a block", 0, 0, state["tick"] == 0),
                ("when prepared", 1, 1, state["tick"] == 0),
                ("before", 1, 0, z3.And(state["tick"] > 0, state["tick"] < n + 5)),
            ):
                case = (state["held"] == held, state["prepared"] == prepared, tick)
                claims[f"{name} {words}"] = z3.Implies(z3.And(*case), fact)
            for tick in range(n + 5, n + 9):
                for bits in product((0, 1), repeat=len(names)):
                    case = [state[k] == bit for k, bit in zip(names, bits, strict=True)]
                    case += [state["held"] == 1, state["prepared"] == 0]
                    now = z3.And(state["tick"] == tick, *case)
                    words = "".join(map(str, bits))
                    claims[f"{name} {tick} {words}"] = z3.Implies(now, fact)
        return claims

    def _induction(self) -> list[Obligation]:
        state, after = self.state, self.after
        known = self.invariant(state, self.ghosts, self.next_ghosts)
        reset = {name: self._number(value) for name, value in self.golden.reset().items()}
        prepared = list(self.prepared(state, self.next_ghosts).values())
        placed = list(self.placed(state, self.ghosts).values())
        summed = list(self.summed(state, self.ghosts).values())
        return [
            self.obligation(
                "invariant: it holds after reset, whatever the ghosts are",
                [],
                self.invariant(reset, self.ghosts, self.next_ghosts),
            ),
            self.obligation(
                "residuals: of a block that runs residual is 2F in the middle between the two "
                "points ahead, outer that of the frame to come; axial and across, the coefficients "
                "and the constants are those of the frame, diagonal and turning what the signs say",
                [*summed, *prepared, *self.bounds],
                self._cases(),
            ),
            self.obligation(
                "residuals: axial, across and the constants of the first frame are what they are "
                "in their own bits, since neither these nor what they stand for can be more",
                [
                    z3.And(value >= -(2 ** (bits - 1)), value < 2 ** (bits - 1))
                    for value, bits in (
                        (self.ghosts["F"], self.golden.bits + 1),
                        (self.next_ghosts["F"], self.golden.bits),
                    )
                ],
                {
                    **{
                        f"{k}: {name}": z3.Implies(self._is(k, state[k], value), state[k] == value)
                        for k, name in zip("de", EXTRAS, strict=True)
                        for value in self._extras(state)[name]
                    },
                    "axial": z3.Implies(
                        self._is("axial", state["axial"], self.ghosts["F"]),
                        state["axial"] == self.ghosts["F"],
                    ),
                    "across": z3.Implies(
                        self._is("across", state["across"], self.next_ghosts["F"]),
                        state["across"] == self.next_ghosts["F"],
                    ),
                },
            ),
            self.obligation(
                "residuals: half of axial, rounded down, is g + 3α and half of β",
                [],
                {
                    "half": z3.Implies(
                        state["axial"]
                        == 2 * self._half(state) + (self._frame_of(state)["beta"] & 1),
                        state["axial"] >> 1 == self._half(state),
                    ),
                    "axial": 2 * self._half(state) + (self._frame_of(state)["beta"] & 1)
                    == 2 * self._frame_of(state)["g"]
                    + 6 * self._frame_of(state)["alpha"]
                    + self._frame_of(state)["beta"],
                },
            ),
            self.obligation(
                "residuals: a clock pulse and a start make just that of the registers, and nothing "
                "else changes them",
                [],
                self._handed(),
            ),
            self.obligation(
                "preparation: from the derivatives at the start to the frame, its sums and the "
                "residuals of the start, where F = 0",
                prepared,
                self._ticks(self.prepared(after, self.next_ghosts_after, modular=True)),
            ),
            self.obligation(
                "place: P3 and P4 are the way to the end, P1 and P2 the position with the step "
                "that waits, and the end when this is the last one",
                [*placed, *prepared],
                self.placed(after, self.ghosts_after),
            ),
            self.obligation(
                "end: the last step of a block leads to its end",
                list(known.values()),
                {
                    a: z3.Implies(
                        z3.And(self.taken, z3.Not(self.running)),
                        state[position] + self.steps[a] == self.ghosts[f"end_{a}"],
                    )
                    for a, (_, _, position) in AXES.items()
                },
            ),
            self.obligation(
                "end: a block is done without a last step only where it stands on its end",
                list(known.values()),
                {
                    "stepless": z3.Implies(
                        z3.And(self.ends, after["done"] == 1),
                        z3.And(
                            *(state[p] == self.ghosts[f"end_{a}"] for a, (p, *_) in AXES.items())
                        ),
                    ),
                    "empty": z3.Implies(
                        z3.And(self.load, after["running"] == 0),
                        z3.And(
                            *(
                                state[s] == self.next_ghosts[f"end_{a}"]
                                for a, s in (("x", "next_x"), ("y", "next_y"))
                            ),
                            after["done"] == 1,
                        ),
                    ),
                },
            ),
        ]

    def _preparation(self) -> list[Obligation]:
        """How a block is prepared, up to its derivatives."""
        n, state, after = self.width, self.state, self.after
        tick = state["tick"]
        multiplies = z3.And(tick > 0, tick < n + 2)
        claims = {}
        for g, x_scale, y_scale, rest in (
            ("gx", 2 * state["a"], state["b"], "d"),
            ("gy", state["b"], 2 * state["c"], "e"),
        ):
            bits = {a: (state[f"next_{a}"] >> n) & 1 for a in "xy"}
            digit = where(bits["x"], x_scale, self._number(0))
            digit += where(bits["y"], y_scale, self._number(0))
            signed = z3.If(tick == 1, -digit, digit)
            claims |= {
                f"{g}: begins": z3.Implies(self.accept, after[g] == 0),
                f"{g}: a bit": z3.Implies(multiplies, self._is(g, after[g], 2 * state[g] + signed)),
                f"{g}: the rest": z3.Implies(
                    tick == n + 2, self._is(g, after[g], state[g] + state[rest])
                ),
            }
        for a in "xy":
            p = f"next_{a}"
            turned = z3.Extract(n, 0, state[p])
            claims |= {
                f"{p}: begins": z3.Implies(
                    self.accept, after[p] == self.inputs[f"blocks_start_{a}"]
                ),
                f"{p}: turns": z3.Implies(
                    multiplies, z3.Extract(n, 0, after[p]) == z3.RotateLeft(turned, 1)
                ),
                f"{p}: stays": z3.Implies(
                    z3.And(z3.Not(self.accept), z3.Not(multiplies)), after[p] == state[p]
                ),
            }
        slow = self.next_ghosts
        size = sum((z3.If(slow[k] < 0, -slow[k], slow[k]) for k in "XY"), self._number(0))
        judged = z3.And(state["held"] == 1, tick == n + 7)
        prepared = list(self.prepared(state, self.next_ghosts).values())
        return [
            self.obligation(
                "preparation: a clock of the first n + 1 takes the top bits of the coordinates, "
                "the first ones as signs, and turns them; D and E follow",
                [z3.Implies(self.accept, tick == 0), z3.Implies(tick > 0, state["held"] == 1)],
                claims,
            ),
            self.obligation(
                f"preparation: it takes {self.golden.last_tick} clocks, whatever runs meanwhile",
                prepared,
                {
                    "begins": z3.Implies(self.accept, after["tick"] == 1),
                    "goes on": z3.Implies(
                        z3.And(tick > 0, tick < self.golden.last_tick), after["tick"] == tick + 1
                    ),
                    "ends": z3.Implies(tick == self.golden.last_tick, after["tick"] == 0),
                    "stays": z3.Implies(tick > 0, after["held"] == 1),
                },
            ),
            self.obligation(
                "verdict: SHARP where |Gx| + |Gy| < 4·(|A| + |B| + |C|), of what was added up",
                prepared,
                {
                    "sharp": z3.Implies(
                        z3.And(judged, z3.Not(self.empty)),
                        (after["fault"] == SHARP)
                        == z3.Or(
                            state["next_residual"] < 4 * state["bend"],
                            z3.And(state["still_x"] == 1, state["still_y"] == 1),
                        ),
                    ),
                    "empty": z3.Implies(z3.And(judged, self.empty), after["fault"] == 0),
                    "size": z3.Implies(
                        z3.And(judged, state["next_residual"] >= 0),
                        state["next_residual"] <= size,
                    ),
                },
            ),
        ]

    def _path(self) -> list[Obligation]:
        """What a clock does to the place, and that there is an end to it."""
        state, after = self.state, self.after
        room, room_after = self._room(state), self._room(after)
        goes = z3.And(self.clock, z3.Not(self.ends))
        event = state["turning"] == 1
        settled = state["fresh"] == 0
        flips = z3.And(goes, event, settled, state["slows"] == 1)
        swaps = z3.And(goes, event, settled, state["slows"] == 0)
        stepped = z3.And(goes, z3.Not(event))
        leads = {"x": state["steep"] == 0, "y": state["steep"] == 1}
        pulses = z3.Or(*(after[f"pulse_{a}"] == 1 for a in "xy"))
        known = [
            *self.summed(state, self.ghosts).values(),
            *self.placed(state, self.ghosts).values(),
        ]
        wide = self.width + 1
        kept = {name: after[name] == state[name] for name in PATH}
        return [
            self.obligation(
                "one step: in a clock each axis moves by one step at most, and no coordinate wraps",
                known,
                {
                    f"{p} by one": z3.Implies(goes, after[p] == state[p] + self.moves[a])
                    for a, (p, *_) in AXES.items()
                }
                | {
                    f"{a} as it is put out": z3.Implies(
                        goes,
                        self.moves[a]
                        == where(
                            after[f"pulse_{a}"],
                            where(after[f"direction_{a}"], self._number(-1), self._number(1)),
                            self._number(0),
                        ),
                    )
                    for a in "xy"
                }
                | {
                    f"{position} by one": z3.Or(
                        self.load,
                        *(after[position] == state[position] + step for step in (-1, 0, 1)),
                    )
                    for _, _, position in AXES.values()
                },
            ),
            self.obligation(
                "one clock a step: a clock makes a step of the leading axis, changes the frame, or "
                "ends the block",
                known,
                {
                    **{
                        f"{a} leads": z3.Implies(
                            z3.And(stepped, leads[a]), after[f"pulse_{a}"] == 1
                        )
                        for a in "xy"
                    },
                    "frame": z3.Implies(z3.And(goes, event), z3.Not(pulses)),
                },
            ),
            self.obligation(
                "it always ends: a step leaves less room ahead, within the coordinates",
                known,
                {
                    "less": z3.Implies(stepped, room_after < room),
                    "room": z3.Implies(
                        self.running, z3.And(room >= 0, room < self._number(2 ** (wide + 1)))
                    ),
                    "turns": z3.Implies(
                        stepped,
                        z3.And(after["turns"] == state["turns"], after["slows"] == state["slows"]),
                    ),
                },
            ),
            self.obligation(
                "it always ends: a change of the frame takes one of the turns, or v slows down "
                "from then on",
                known,
                {
                    "turns": z3.Implies(
                        flips,
                        z3.And(after["turns"] == state["turns"] - 1, after["slows"] == 0),
                    ),
                    "leads": z3.Implies(
                        swaps,
                        z3.And(
                            *(after["turns"] == state["turns"], after["slows"] == 1),
                            room_after == room,
                        ),
                    ),
                    "a wait is one clock": z3.Implies(
                        z3.And(goes, event, state["fresh"] == 1),
                        z3.And(after["fresh"] == 0, after["turning"] == 1),
                    ),
                },
            ),
            self.obligation(
                "stall: while a step waits nothing of the path changes, and it stays",
                [self.waiting, z3.Not(self.taken)],
                kept
                | {
                    name: after[name] == state[name]
                    for name in ("residual", "outer", "axial", "across", "turns", "running")
                }
                | {
                    name: after[name] == state[name]
                    for name in ("pulse_x", "pulse_y", "direction_x", "direction_y")
                },
            ),
        ]

    def _room(self, state: dict) -> Value:
        """Give the steps from the place to the edges ahead, of both axes together."""
        low, high = 2**self.width, 2**self.width - 1
        return sum(
            (
                where(state[f"direction_{a}"], state[p] + low, high - state[p])
                for a, (p, *_) in AXES.items()
            ),
            self._number(0),
        )

    def _answers(self) -> list[Obligation]:
        state, after = self.state, self.after
        prepared = list(self.prepared(state, self.next_ghosts).values())
        ended_late = z3.And(self.ends, after["late"] != 0)
        refused = z3.And(self.start, state["fault"] != 0)
        last_step = z3.And(self.taken, z3.Not(self.running))
        stepless = z3.And(self.ends, after["done"] == 1)
        empty = z3.And(self.load, self.empty)
        ways = (ended_late, refused, last_step, stepless, empty)
        pulses = z3.Or(after["pulse_x"] == 1, after["pulse_y"] == 1)
        answered = z3.Or(after["done"] == 1, (after["error"] | after["late"]) != 0)
        return [
            self.obligation(
                "answer: done or error just when the last step is taken, a block of no length or "
                "a refused one starts, or a block ends without a last step; one answer a clock",
                prepared,
                {
                    "just then": answered == z3.Or(*ways),
                    "one": z3.AtMost(*ways, 1),
                    "not both": z3.Implies(
                        after["done"] == 1, (after["error"] | after["late"]) == 0
                    ),
                    "not two errors": z3.Or(after["error"] == 0, after["late"] == 0),
                },
            ),
            self.obligation(
                "answer: a block that ends has a last step that waits, or its answer",
                prepared,
                {
                    "ends": z3.Implies(
                        self.ends, z3.Xor(pulses, z3.Or(stepless, after["late"] != 0))
                    ),
                    "late": z3.Implies(after["late"] != 0, self.ends),
                    "code": z3.Or(*(after["late"] == code for code in (0, RANGE, OFF_CURVE))),
                },
            ),
            self.obligation(
                "late: OFF_CURVE only with the end two steps or more behind in the last piece, "
                "RANGE only at the edge of the coordinates",
                [],
                {
                    "OFF_CURVE": z3.Implies(
                        after["late"] == OFF_CURVE,
                        z3.And(
                            state["turns"] == 0,
                            z3.Or(
                                *(
                                    where(state[f"direction_{a}"], -state[left], state[left]) <= -2
                                    for a, (_, left, _) in AXES.items()
                                )
                            ),
                        ),
                    ),
                    "RANGE": z3.Implies(
                        after["late"] == RANGE,
                        z3.Or(
                            *(
                                state[p]
                                == where(
                                    state[f"direction_{a}"],
                                    self._number(-(2**self.width)),
                                    self._number(2**self.width - 1),
                                )
                                for a, (p, *_) in AXES.items()
                            )
                        ),
                    ),
                },
            ),
            self.obligation(
                "refused: a block that is refused moves nothing and is answered SHARP",
                prepared,
                {name: z3.Implies(refused, after[name] == state[name]) for name in PATH}
                | {
                    "answer": z3.Implies(refused, after["error"] == SHARP),
                    "over": z3.Implies(refused, z3.And(after["held"] == 0, after["running"] == 0)),
                },
            ),
        ]


def _keep(_name: str, value: Value) -> Value:
    return value


def _numbers(golden: ExactConic) -> list[Obligation]:
    """What the additions come to, in whole numbers."""
    n = golden.width
    a, b, c, x, y, dx, dy = z3.Ints("A B C x y dx dy")
    d, e, f, p, q, bit = z3.Ints("D E F P Q bit")
    square, edge, linear = 2 ** (n + 3), 2**n, 2 ** (2 * n + 4)
    point = [x >= -edge, x < edge]

    def value(u: z3.ArithRef, v: z3.ArithRef) -> z3.ArithRef:
        return a * u * u + b * u * v + c * v * v + d * u + e * v + f

    gx, gy = 2 * a * x + b * y + d, b * x + 2 * c * y + e
    moved = value(x, y) + dx * gx + dy * gy + a * dx * dx + b * dx * dy + c * dy * dy
    g, h, alpha, beta, gamma = z3.Ints("g h α β γ")
    product, other = z3.Ints("2Ax By")
    most = 5 * 2 ** (2 * n + 3)
    steps, turns, room = z3.Ints("clocks turns room")
    two = z3.IntVal(2)
    doubled = 2 * f + 2 * g + h + 2 * alpha + beta + gamma / two
    # F(1, ½), four times, to stay with whole numbers.
    middle = 4 * f + 4 * g + 2 * h + 4 * alpha + 2 * beta + gamma
    return [
        Obligation(
            "curve: F, Gx and Gy moved by additions are those of the point moved to",
            [],
            {
                "F": value(x + dx, y + dy) == moved,
                "Gx": 2 * a * (x + dx) + b * (y + dy) + d == gx + 2 * a * dx + b * dy,
                "Gy": b * (x + dx) + 2 * c * (y + dy) + e == gy + b * dx + 2 * c * dy,
            },
            True,
        ),
        Obligation(
            "curve: residual is negative just when F is in the middle between the two points",
            [],
            {
                "sign": (doubled < 0) == (middle < 0),
                "halved": z3.And(2 * doubled <= middle, middle <= 2 * doubled + 1),
            },
            True,
        ),
        Obligation(
            "derivatives: P·X + Q·Y takes a bit of x and one of y as 2·(P·X + Q·Y) + P·bit + Q·bit",
            [],
            {
                "bit": p * (2 * x + bit) + q * (2 * y + dy)
                == 2 * (p * x + q * y) + p * bit + q * dy,
                "sign": z3.And(p * -bit == -(p * bit), q * -bit == -(q * bit)),
            },
            True,
        ),
        Obligation(
            f"overflow: |2A·x| ≤ 2^(2n + 4) and |B·y| ≤ 2^(2n + 3) (n = {n})",
            [*point, a >= -square, a < square],
            {
                "2A·x": z3.And(2 * a * x <= linear, 2 * a * x >= -linear),
                "B·y": z3.And(2 * (a * x) <= linear, 2 * (a * x) >= -linear),
            },
            True,
        ),
        Obligation(
            "overflow: so a derivative is at most 2.5·2^(2n + 4), and axial and across fit",
            [
                *(z3.And(it >= -linear, it <= linear) for it in (product, d)),
                z3.And(2 * other >= -linear, 2 * other <= linear),
                *(z3.And(it >= -most, it <= most) for it in (g, h)),
                *(z3.And(it >= -square, it <= square) for it in (alpha, beta, gamma)),
            ],
            {
                "derivative": z3.And(product + other + d <= most, product + other + d >= -most),
                "axial": z3.And(
                    2 * g + 6 * alpha + beta < 2 ** (2 * n + 7),
                    2 * g + 6 * alpha + beta >= -(2 ** (2 * n + 7)),
                ),
                "across": z3.And(
                    h + 2 * beta + 2 * gamma < 2 ** (2 * n + 6),
                    h + 2 * beta + 2 * gamma >= -(2 ** (2 * n + 6)),
                ),
            },
            True,
        ),
        Obligation(
            "it always ends: within a frame there is a clock for each step of room at most, a wait "
            "and a change, and two frames to a turn: fewer than 2·(turns + 1)·(2^(n + 2) + 2) "
            "clocks",
            [
                *(turns >= 0, room >= 0, room < 2 ** (n + 2)),
                steps <= 2 * (turns + 1) * (room + 2),
            ],
            {"clocks": steps < 2 * (turns + 1) * (2 ** (n + 2) + 2)},
            True,
        ),
    ]
