"""Promises of the pulse unit, for all steps, timings, stops and switches at a given width.

They are shown of the golden model's own source, which the device is proven equal to: an invariant
holds after reset and survives every clock from every state that satisfies it, whatever the inputs;
the promises follow. What a driver sees is judged by the pins alone. Ghost values keep their
history, and that of the inputs:

- ``owed``: the step that was taken last, until it is put out or dropped, by axis;
- ``run``: for how many clocks the step pin (of quadrature: both pins) of an axis has been as it is,
  this clock included; ``direction_run`` the same of the direction pin. They stay at 8191: more than
  the sum of any two timings;
- ``last_length``: the pulse length in force at an axis's last leading edge;
- ``was_stop``, ``was_low``, ``was_high``: inputs of the clock before;
- ``L``, ``S``, ``U``, ``H``: the timings given in the last clock that was not busy.

In the titles L, S, U, H are at least 1, as 0 counts for 1.
"""

import z3

from discreta.sim.golden.logic import Value
from discreta.sim.golden.pulse import FOREVER, PulseUnit
from discreta.sim.smt import Obligation, symbols

__all__ = ["promises"]

#: The most clocks that the ghosts count.
AGES = 2**13 - 1

#: Ghosts of the timings: the input, and the register that holds it.
TIMINGS = {
    "L": ("pulse_length", "length"),
    "S": ("pulse_space", "space"),
    "U": ("direction_setup", "setup"),
    "H": ("direction_hold", "hold"),
}


def promises(golden: PulseUnit) -> list[Obligation]:
    """Give everything that is promised of the pulse unit."""
    return _Clock(golden).obligations()


def _inputs_of(golden: PulseUnit) -> dict[str, tuple[int, bool]]:
    kinds: dict[str, tuple[int, bool]] = dict.fromkeys(("steps_valid", "load", "stop"), (1, False))
    for a in golden.letters:
        kinds |= {f"steps_{a}": (2, True), f"initial_{a}": (golden.width + 1, True)}
        kinds |= dict.fromkeys((f"low_limit_{a}", f"high_limit_{a}"), (1, False))
    return kinds | {port: (12, False) for port, _ in TIMINGS.values()}


class _Clock:
    """One clock of the unit: state and inputs, the state after it, and the ghosts of both."""

    def __init__(self, golden: PulseUnit):
        self.golden = golden
        self.letters = golden.letters
        self.pulses = golden.kind == "step_direction"
        kinds, inputs, ghosts = golden.registers(), _inputs_of(golden), self.ghost_kinds()
        self.wide = max(bits for bits, _ in (kinds | inputs | ghosts).values()) + 4
        self.state, self.inputs = symbols(kinds, self.wide), symbols(inputs, self.wide)
        self.ghosts = {
            name.removeprefix("ghost."): symbol
            for name, symbol in symbols(
                {f"ghost.{name}": kind for name, kind in ghosts.items()}, self.wide
            ).items()
        }
        self.outputs = golden.outputs(self.state)
        self.after = golden.step(self.state, self.inputs)
        self.later = golden.outputs(self.after)

        ghosts = self.ghosts
        self.length, self.space, self.setup, self.hold = (_at_least_1(ghosts[t]) for t in TIMINGS)
        self.stopped = ghosts["was_stop"] == 1
        self.accept = z3.And(self.inputs["steps_valid"] == 1, self.outputs["steps_ready"] == 1)
        #: What is seen at the pins with the next clock: −1, 0, +1 an axis.
        self.edges = {a: self.edge(a) for a in self.letters}
        self.put_out = z3.Or([edge != 0 for edge in self.edges.values()])
        self.waits = z3.Or([ghosts[f"owed_{a}"] != 0 for a in self.letters])
        self.blocked = z3.Or(
            z3.Or(
                z3.And(ghosts[f"owed_{a}"] == 1, ghosts[f"was_high_{a}"] == 1),
                z3.And(ghosts[f"owed_{a}"] == -1, ghosts[f"was_low_{a}"] == 1),
            )
            for a in self.letters
        )
        #: The switch keeps the step that waits, or kept it in the clock before.
        self.kept = z3.Or(self.blocked, self.outputs["limited"] == 1)
        self.ghosts_after = self.remembered()

    def ghost_kinds(self) -> dict[str, tuple[int, bool]]:
        """Give width and sign of the ghosts."""
        kinds: dict[str, tuple[int, bool]] = {"was_stop": (1, False)}
        kinds |= dict.fromkeys(TIMINGS, (12, False))
        for a in self.letters:
            kinds |= {f"owed_{a}": (2, True), f"run_{a}": (13, False)}
            kinds |= dict.fromkeys((f"was_low_{a}", f"was_high_{a}"), (1, False))
            if self.pulses:
                kinds[f"direction_run_{a}"] = (13, False)
            else:
                kinds[f"last_length_{a}"] = (12, False)
        return kinds

    def level(self, outputs: dict, a: str, pin: str) -> Value:
        """Give what a pin says, whatever its polarity."""
        first = pin in ("step", "a")
        active_low = self.golden.inverted_steps if first else self.golden.inverted_directions
        value = outputs[f"pins_{a}_{pin}"]
        return 1 - value if a in active_low else value

    def pair(self, a: str, pin: str) -> tuple[Value, Value]:
        """Give what a pin says in this clock and in the next."""
        return self.level(self.outputs, a, pin), self.level(self.later, a, pin)

    def gone_on(self, a: str) -> Value:
        """Give by how many of four places the quadrature of an axis goes on in its cycle."""
        places = []
        for outputs in (self.outputs, self.later):
            first, second = (self.level(outputs, a, pin) for pin in "ab")
            places.append(2 * second + (first ^ second))
        return (places[1] - places[0]) & 3

    def edge(self, a: str) -> Value:
        """Give the step of an axis that the pins show with the next clock."""
        one, minus, zero = (z3.BitVecVal(value, self.wide) for value in (1, -1, 0))
        if not self.pulses:
            gone = self.gone_on(a)
            return z3.If(gone == 0, zero, z3.If(gone == 3, minus, one))
        before, now = self.pair(a, "step")
        downwards = self.level(self.later, a, "direction") == 1
        return z3.If(z3.And(before == 0, now == 1), z3.If(downwards, minus, one), zero)

    def unchanged(self, a: str, *pins: str) -> z3.BoolRef:
        """State that pins of an axis stay as they are."""
        return z3.And([before == now for before, now in (self.pair(a, pin) for pin in pins)])

    def remembered(self) -> dict[str, Value]:
        """Give the ghosts after the clock."""
        ghosts, inputs = self.ghosts, self.inputs
        busy = self.outputs["busy"] == 1
        after = {"was_stop": inputs["stop"]}
        after |= {
            ghost: z3.If(busy, ghosts[ghost], inputs[port]) for ghost, (port, _) in TIMINGS.items()
        }
        for a in self.letters:
            step = inputs[f"steps_{a}"]
            after[f"owed_{a}"] = z3.If(
                self.accept,
                z3.If(step == -2, 0, step),
                z3.If(z3.Or(self.put_out, self.stopped), 0, ghosts[f"owed_{a}"]),
            )
            after[f"was_low_{a}"] = inputs[f"low_limit_{a}"]
            after[f"was_high_{a}"] = inputs[f"high_limit_{a}"]
            runs = {f"run_{a}": ("step",) if self.pulses else ("a", "b")}
            if self.pulses:
                runs[f"direction_run_{a}"] = ("direction",)
            else:
                after[f"last_length_{a}"] = z3.If(
                    self.edges[a] != 0, ghosts["L"], ghosts[f"last_length_{a}"]
                )
            for name, pins in runs.items():
                longer = z3.If(ghosts[name] == AGES, AGES, ghosts[name] + 1)
                after[name] = z3.If(self.unchanged(a, *pins), longer, 1)
        return after

    def invariant(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        facts = {
            f"timing {ghost}": state[register] == ghosts[ghost]
            for ghost, (_, register) in TIMINGS.items()
        }
        facts["stop"] = state["stopping"] == ghosts["was_stop"]
        length = _at_least_1(ghosts["L"])
        for a in self.letters:
            age, run = state[f"age_{a}"], ghosts[f"run_{a}"]
            out = state[f"pulse_{a}"] == 1
            pending = state[f"pending_{a}"]
            facts |= {
                f"pending {a}": ghosts[f"owed_{a}"] == z3.If(pending == -2, 0, pending),
                f"switches {a}": z3.And(
                    state[f"at_low_{a}"] == ghosts[f"was_low_{a}"],
                    state[f"at_high_{a}"] == ghosts[f"was_high_{a}"],
                ),
                f"ages {a}": z3.And(age >= 1, state[f"direction_age_{a}"] >= 1),
                f"a pulse of {a} is no longer than it has to be": z3.Implies(
                    out, z3.And(ghosts[f"run_{a}"] <= length, age == ghosts[f"run_{a}"])
                ),
            }
            if self.pulses:
                facts[f"age {a}"] = age == _counted(run)
                direction_run = ghosts[f"direction_run_{a}"]
                facts[f"direction age {a}"] = state[f"direction_age_{a}"] == _counted(direction_run)
            else:
                low_since = _at_least_1(ghosts[f"last_length_{a}"]) + age
                facts[f"age {a}"] = z3.If(
                    out,
                    z3.And(run == age, ghosts[f"last_length_{a}"] == ghosts["L"]),
                    z3.If(age == FOREVER, run >= low_since, run == low_since),
                )
        return facts

    def to_go(self, state: dict, ghosts: dict) -> dict[str, tuple[Value, Value, Value]]:
        """Give how many clocks each axis of the step that waits has to go.

        They are three: until its space has passed; until it may turn, if it has to; and from the
        turn, or from now, until its direction is set up.
        """
        length, space, setup, hold = (_at_least_1(ghosts[name]) for name in TIMINGS)
        clocks = {}
        for a in self.letters:
            age, out = state[f"age_{a}"], state[f"pulse_{a}"] == 1
            owed = ghosts[f"owed_{a}"]
            # First the pulse has to end; in the clock after it, it has been low for one.
            ends = z3.If(out, length - age + 1, 0)
            low = z3.If(out, 1, age)
            turns = (owed < 0) != (state[f"direction_{a}"] == 1)
            left = (
                ends + _beyond(space, low),
                z3.If(turns, ends + _beyond(hold, low), 0),
                z3.If(turns, setup, _beyond(setup, state[f"direction_age_{a}"])),
            )
            spaced, turned, set_up = (z3.If(owed == 0, 0, count) for count in left)
            clocks[a] = spaced, turned, set_up
        return clocks

    def pins(self) -> list[Obligation]:
        """Give what is promised of the pins of the kind."""
        known, ghosts = self.known, self.ghosts
        if not self.pulses:
            return [
                Obligation(
                    "quadrature: a step changes just one of the pins a and b of an axis that it "
                    "moves, in its direction, and nothing else changes any of them",
                    known,
                    {
                        a: z3.And(
                            self.gone_on(a) != 2,
                            z3.Or(self.edges[a] == 0, self.edges[a] == ghosts[f"owed_{a}"]),
                        )
                        for a in self.letters
                    },
                ),
                Obligation(
                    "space: two edges of an axis are at least L + S apart, by the L of the first "
                    "and the S of the second",
                    known,
                    {
                        a: z3.Implies(
                            self.edges[a] != 0,
                            ghosts[f"run_{a}"]
                            >= _at_least_1(ghosts[f"last_length_{a}"]) + self.space,
                        )
                        for a in self.letters
                    },
                ),
            ]
        length, space, held, set_up, meant = {}, {}, {}, {}, {}
        for a in self.letters:
            before, now = self.pair(a, "step")
            run, owed = ghosts[f"run_{a}"], ghosts[f"owed_{a}"]
            turns = z3.Not(self.unchanged(a, "direction"))
            downwards = self.level(self.later, a, "direction") == 1
            rises = z3.And(before == 0, now == 1)
            length[a] = z3.Implies(before == 1, (now == 0) == (run == self.length))
            space[a] = z3.Implies(rises, run >= self.space)
            held[a] = z3.Implies(turns, z3.And(before == 0, now == 0, run >= self.hold))
            set_up[a] = z3.Implies(
                rises, z3.And(z3.Not(turns), ghosts[f"direction_run_{a}"] >= self.setup)
            )
            meant[a] = z3.Implies(
                turns,
                z3.And(
                    owed == z3.If(downwards, z3.BitVecVal(-1, self.wide), 1),
                    *(z3.Not(self.stopped), z3.Not(self.kept)),
                ),
            )
        return [
            Obligation("length: every pulse is high for just L clocks", known, length),
            Obligation("space: a step pin is low for at least S before a pulse", known, space),
            Obligation(
                "hold: a direction pin does not change while a pulse is out, nor with either of "
                "its edges, nor before H clocks after it",
                known,
                held,
            ),
            Obligation(
                "set-up: a direction pin has been stable for at least U before a leading edge, and "
                "does not change with it",
                known,
                set_up,
            ),
            Obligation(
                "turn: a direction pin changes only for the step that waits, to its direction, and "
                "not for one that is stopped or limited",
                known,
                meant,
            ),
        ]

    def progress(self) -> dict[str, z3.BoolRef]:
        """State that a step that waits comes nearer to its launch."""
        before, after = (
            self.to_go(self.state, self.ghosts),
            self.to_go(self.after, self.ghosts_after),
        )
        unstopped = z3.And(self.waits, z3.Not(self.stopped))
        free, none = z3.And(unstopped, z3.Not(self.kept)), z3.Not(self.put_out)
        left = [count for counts in before.values() for count in counts]
        claims = {
            "launched": z3.Implies(free, self.put_out == z3.And([count == 0 for count in left])),
            "the same step and timings": z3.Implies(
                z3.And(unstopped, none),
                z3.And(
                    [
                        self.ghosts_after[name] == self.ghosts[name]
                        for name in (*TIMINGS, *(f"owed_{a}" for a in self.letters))
                    ]
                ),
            ),
        }
        for a in self.letters:
            spaced, turned, set_up = before[a]
            bounds = self.length + self.space - 1, self.length + self.hold - 1, self.setup
            nearer = (
                _beyond(spaced, 1),
                _beyond(turned, 1),
                z3.If(turned == 0, _beyond(set_up, 1), set_up),
            )
            for index, what in enumerate(("space", "turn", "set-up")):
                count, later = before[a][index], after[a][index]
                claims |= {
                    f"bound, {what} {a}": z3.And(count >= 0, count <= bounds[index]),
                    f"nearer, {what} {a}": z3.Implies(z3.And(free, none), later == nearer[index]),
                    f"no farther, {what} {a}": z3.Implies(
                        z3.And(unstopped, self.kept), later <= count
                    ),
                }
        return claims

    def obligations(self) -> list[Obligation]:
        """Give everything that is promised."""
        golden, state, after, ghosts = self.golden, self.state, self.after, self.ghosts
        reset = {name: z3.BitVecVal(value, self.wide) for name, value in golden.reset().items()}
        begin = {
            name: z3.BitVecVal(AGES if "run" in name else 0, self.wide)
            for name in self.ghost_kinds()
        }
        self.known = known = list(self.invariant(state, ghosts).values())
        owed = {a: ghosts[f"owed_{a}"] for a in self.letters}
        none = z3.Not(self.put_out)
        quiet = []
        for a in self.letters:
            if self.pulses:
                low = self.level(self.outputs, a, "step") == 0
                quiet.append(z3.And(low, ghosts[f"run_{a}"] >= self.space))
            else:
                period = _at_least_1(ghosts[f"last_length_{a}"]) + self.space
                quiet.append(ghosts[f"run_{a}"] >= period)
        idle = {
            f"{a} {pin}": self.level(golden.outputs(reset), a, pin) == 0
            for a in self.letters
            for pin in (("step", "direction") if self.pulses else ("a", "b"))
        }
        return [
            Obligation(
                "invariant: holds after reset, with all pins idle",
                [],
                self.invariant(reset, begin) | idle,
            ),
            Obligation(
                "invariant: survives every clock, whatever the inputs",
                known,
                self.invariant(after, self.ghosts_after),
            ),
            Obligation(
                "steps: a step that is taken is put out with one leading edge of every axis that "
                "it moves, in its direction and all in one clock, or is dropped whole by a stop, "
                "or waits; no step is taken before the one before it is put out",
                known,
                {
                    "whole": z3.Or(none, z3.And([self.edges[a] == owed[a] for a in self.letters])),
                    "in order": z3.Implies(self.accept, z3.Or(z3.Not(self.waits), self.put_out)),
                },
            ),
            *self.pins(),
            Obligation(
                "position: changes by just the leading edges at the pins, and by a load",
                known,
                {
                    a: self.later[f"position_{a}"]
                    == z3.If(
                        self.inputs["load"] == 1,
                        self.inputs[f"initial_{a}"],
                        _wrapped(self.outputs[f"position_{a}"] + self.edges[a], golden.width),
                    )
                    for a in self.letters
                },
            ),
            Obligation(
                "stop: with a stop in the clock before, no step is taken and no leading edge "
                "follows; what waited is dropped whole",
                [*known, self.stopped],
                {"not ready": self.outputs["steps_ready"] == 0, "no edge": none}
                | {f"dropped {a}": after[f"pending_{a}"] == 0 for a in self.letters},
            ),
            Obligation(
                "limit: no leading edge of an axis towards a switch that was active two clocks "
                "before it",
                known,
                {
                    a: z3.And(
                        z3.Implies(self.edges[a] == 1, ghosts[f"was_high_{a}"] == 0),
                        z3.Implies(self.edges[a] == -1, ghosts[f"was_low_{a}"] == 0),
                    )
                    for a in self.letters
                },
            ),
            Obligation(
                "limited: it says of the clock before that a step waited for a switch, which was "
                "active one clock earlier",
                known,
                [
                    (self.later["limited"] == 1)
                    == z3.And(self.waits, z3.Not(self.stopped), self.blocked)
                ],
            ),
            Obligation(
                "limited: while it says so no leading edge follows",
                [*known, self.outputs["limited"] == 1],
                [none],
            ),
            Obligation(
                "it never hangs: a step that waits is launched after at most L + max(S − 1, "
                "H − 1 + U) clocks in which it is neither stopped nor limited: each of them takes "
                "one of those that an axis has to go for its space, and one of those for its turn "
                "or, after that, its set-up; none is ever added; and the step is launched in the "
                "first clock in which there are none",
                known,
                self.progress(),
            ),
            Obligation(
                "ready: a step is taken whenever none waits, or the one that does is put out with "
                "the next clock, and no stop was given in the clock before",
                known,
                [
                    (self.outputs["steps_ready"] == 1)
                    == z3.And(z3.Not(self.stopped), z3.Or(z3.Not(self.waits), self.put_out))
                ],
            ),
            Obligation(
                "busy: 0 exactly when no step waits, no pulse is out, and S clocks have passed "
                "since with this one; the timings change with such a clock alone",
                known,
                [(self.outputs["busy"] == 0) == z3.And(z3.Not(self.waits), *quiet)],
            ),
        ]


def _at_least_1(clocks: Value) -> Value:
    return z3.If(clocks == 0, z3.BitVecVal(1, clocks.size()), clocks)


def _counted(clocks: Value) -> Value:
    """Give what a register counts of so many clocks."""
    return z3.If(clocks >= FOREVER, z3.BitVecVal(FOREVER, clocks.size()), clocks)


def _beyond(clocks: Value, passed: Value) -> Value:
    """Give how many clocks are left of so many."""
    return z3.If(clocks > passed, clocks - passed, 0)


def _wrapped(value: Value, width: int) -> Value:
    """Keep a number that is at most one off to its signed n + 1 bits."""
    top = 2**width
    return z3.If(value == top, -top, z3.If(value == -top - 1, top - 1, value))
