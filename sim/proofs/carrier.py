"""Promises of every interpolator on a constant carrier, for every block at a given width.

They are shown of the golden model's own source, which the device is proven equal to: an invariant
holds after reset and survives every clock from every state that satisfies it, whatever the inputs;
the promises follow. Ghost values remember what the registers forget: ``end`` of the running block
and ``next_end`` of the prepared one.
"""

from typing import Any

import z3

from discreta.sim.golden.logic import Value
from discreta.sim.smt import Obligation, extend, same, symbols

__all__ = ["CarrierRegisters", "division", "inputs_of"]

#: The position's register by axis.
PLACES = {"x": "p3", "y": "p4"}


def inputs_of(golden: Any, arc: bool) -> dict[str, tuple[int, bool]]:
    """Give width and sign of the inputs."""
    n = golden.width
    points = ("start", "end", "center") if arc else ("start", "end")
    kinds: dict[str, tuple[int, bool]] = {
        f"blocks_{which}_{a}": (n + 1, True) for which in points for a in "xy"
    }
    kinds |= {"blocks_periods": (n + 8, False), "blocks_period": (24, False)}
    if arc:
        kinds |= {"blocks_clockwise": (1, False), "blocks_full_turns": (8, False)}
    return kinds | dict.fromkeys(("blocks_valid", "steps_ready"), (1, False))


class CarrierRegisters:
    """What is promised of the registers, in bit-vectors.

    Parameters
    ----------
    golden : CarrierLinear or CarrierCircular
    arc : bool
        Its blocks are arcs.
    """

    def __init__(self, golden: Any, *, arc: bool):
        self.golden = golden
        kinds = golden.registers()
        inputs = inputs_of(golden, arc)
        self.wide = max(bits for bits, _ in (kinds | inputs).values()) + 4
        self.state, self.inputs = symbols(kinds, self.wide), symbols(inputs, self.wide)
        self.ghosts = {
            f"{ghost}_{a}": extend(
                z3.BitVec(f"ghost.{ghost}_{a}", golden.width + 1), True, self.wide
            )
            for ghost in ("end", "next_end")
            for a in "xy"
        }
        state, ready = self.state, self.inputs["steps_ready"]
        self.outputs = golden.outputs(state)
        self.waiting = state["waiting"] == 1
        self.running = state["running"] == 1
        self.taken = z3.And(self.waiting, ready == 1)
        self.free = z3.Or(z3.Not(self.waiting), ready == 1)
        self.start = golden.start(state, ready, 0) == 1
        self.fault = golden.fault(state) != 0
        self.empty = golden.empty(state) == 1
        self.load = z3.And(self.start, z3.Not(self.fault))
        self.accept = z3.And(self.inputs["blocks_valid"] == 1, self.outputs["blocks_ready"] == 1)
        self.after = golden.step(state, self.inputs)
        self.later = golden.outputs(self.after)
        #: New increments are put out.
        self.put = z3.And(self.running, self.free, state["timer"] == 0)
        if arc:
            self.put = z3.And(self.put, state["computed"] == 1)
        #: What the numbers say of a state, and bit-vectors need not find out.
        self.given: list[z3.BoolRef] = []
        self.ghosts_after = {}
        for a in "xy":
            self.ghosts_after |= {
                f"end_{a}": z3.If(self.load, self.ghosts[f"next_end_{a}"], self.ghosts[f"end_{a}"]),
                f"next_end_{a}": z3.If(
                    self.accept, self.inputs[f"blocks_end_{a}"], self.ghosts[f"next_end_{a}"]
                ),
            }

    def reached(self, state: dict, a: str) -> Value:
        """Give the position after the increments that wait."""
        waiting = z3.If(state["waiting"] == 1, state[f"out_{a}"], 0)
        return state[PLACES[a]] + waiting

    def invariant(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        waiting, running = state["waiting"] == 1, state["running"] == 1
        facts = {
            "periods": z3.Implies(running, state["periods"] >= 1),
            "period": z3.Implies(running, state["period"] >= self.golden.least_period),
        }
        for a in "xy":
            reached, top = self.reached(state, a), 2**self.golden.width
            facts[f"end {a}"] = z3.Implies(
                z3.And(waiting, z3.Not(running)), reached == ghosts[f"end_{a}"]
            )
            facts[f"inside {a}"] = z3.And(reached >= -top, reached < top)
        return facts

    def answers(self) -> tuple[z3.BoolRef, z3.BoolRef, z3.BoolRef]:
        """Tell whether a block ends, is started without a length, is refused."""
        ended = z3.And(self.taken, z3.Not(self.running))
        return ended, z3.And(self.load, self.empty), z3.And(self.start, self.fault)

    def unmoved(self) -> dict[str, z3.BoolRef]:
        """Tell that nothing of a running block changes."""
        names = (*PLACES.values(), "out_x", "out_y", "running", "periods", "period")
        return same({name: self.after[name] for name in names}, self.state)

    def obligations(self) -> list[Obligation]:
        """Give everything that is promised of them."""
        state, after = self.state, self.after
        known = [*self.invariant(state, self.ghosts).values(), *self.given]
        reset = {
            name: z3.BitVecVal(value, self.wide) for name, value in self.golden.reset().items()
        }
        zero = dict.fromkeys(self.ghosts, z3.BitVecVal(0, self.wide))
        ended, emptied, rejected = self.answers()
        idle = z3.And(z3.Not(self.running), z3.Not(self.waiting))
        prepared = self.golden.start(state | {"running": 0 * state["running"]}, 1, 0) == 1
        nothing = z3.Or(self.fault, self.empty)
        return [
            Obligation("invariant: holds after reset", [], self.invariant(reset, zero)),
            Obligation(
                "invariant: survives every clock, whatever the inputs",
                known,
                self.invariant(after, self.ghosts_after),
            ),
            Obligation(
                "carrier: a period is T clocks, of which only those count in which no increments "
                "wait in vain; the next ones are due when it is over",
                known,
                {
                    "opened": z3.Implies(self.put, after["timer"] == state["period"] - 1),
                    "counts": z3.Implies(
                        z3.And(self.free, z3.Not(self.put), state["timer"] != 0),
                        after["timer"] == state["timer"] - 1,
                    ),
                    "stands still": z3.Implies(z3.Not(self.free), after["timer"] == state["timer"]),
                    "waits": z3.Implies(self.put, after["waiting"] == 1),
                    "not before": z3.Implies(
                        z3.And(after["waiting"] == 1, state["timer"] != 0),
                        z3.And(self.waiting, z3.Not(self.taken)),
                    ),
                },
            ),
            Obligation(
                "it always ends: every result takes one of the periods left, and with the last "
                "of them the block stops",
                known,
                {
                    "counts": z3.Implies(
                        z3.And(self.put, z3.Not(self.load)),
                        after["periods"] == state["periods"] - 1,
                    ),
                    "stops": z3.Implies(
                        z3.And(self.put, state["periods"] == 1), after["running"] == 0
                    ),
                    "only then": z3.Implies(z3.And(self.running, after["running"] == 0), self.put),
                },
            ),
            Obligation(
                "position: changes by just the increments that are taken, and by loading a start",
                known,
                {
                    a: after[place]
                    == z3.If(
                        self.load,
                        state[f"start_{a}"],
                        state[place] + z3.If(self.taken, self.outputs[f"steps_{a}"], 0),
                    )
                    for a, place in PLACES.items()
                },
            ),
            Obligation(
                "end: when a block is done its end point is reached exactly",
                [*known, ended],
                {
                    a: state[place] + self.outputs[f"steps_{a}"] == self.ghosts[f"end_{a}"]
                    for a, place in PLACES.items()
                }
                | {"last": self.outputs["steps_last"] == 1, "done": after["done"] == 1},
            ),
            Obligation(
                "answer: done or error just one clock after the last increments are taken, a block "
                "of no length is started or a block is refused, and never two of these at once",
                known,
                {
                    "done": (after["done"] == 1) == z3.Or(ended, emptied),
                    "error": (after["error"] != 0) == rejected,
                    "one": z3.AtMost(ended, emptied, rejected, 1),
                },
            ),
            Obligation(
                "refused: a block with a fault moves nothing", [*known, rejected], self.unmoved()
            ),
            Obligation(
                "stall: increments that are not taken stay, and no register of the block moves",
                [*known, self.waiting, z3.Not(self.taken)],
                self.unmoved()
                | {
                    f"steps {a}": self.later[f"steps_{a}"] == self.outputs[f"steps_{a}"]
                    for a in "xy"
                },
            ),
            Obligation(
                "no gap: a prepared block starts in the clock in which the last increments before "
                "it are taken, or in the next one if it has nothing to run",
                [*known, z3.Not(self.running), self.free, prepared],
                {
                    "moves": z3.Or(nothing, self.start),
                    "nothing": z3.Implies(idle, self.start),
                },
            ),
        ]


def division(wide: str) -> list[Obligation]:
    """Give what is proven of the division, in integers: ``wide`` names what is divided."""
    top, bit, rest, quotient, divisor, fits = z3.Ints("top bit rest quotient N fits")
    brought = 2 * rest + bit
    return [
        Obligation(
            f"division: with the top bits of {wide} = quotient·N + rest and 0 ≤ rest < N the same "
            "holds of one bit more after a clock, so that at last the quotient is ⌊…/N⌋",
            [
                top == quotient * divisor + rest,
                *(rest >= 0, rest < divisor, bit >= 0, bit <= 1),
                fits == z3.If(brought >= divisor, 1, 0),
            ],
            [
                2 * top + bit == (2 * quotient + fits) * divisor + brought - fits * divisor,
                brought - fits * divisor >= 0,
                brought - fits * divisor < divisor,
            ],
            True,
        )
    ]
