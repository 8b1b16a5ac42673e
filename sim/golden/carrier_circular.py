"""Golden model of the circular interpolator on a constant carrier, one clock at a time.

From the Ukrainian lecture (circular interpolation by digital differential analysers, and the
variants of its figure 6.27): in every carrier period the point is turned by Δφ, from the values of
the period before alone; whole parts are put out and fractions kept; the last period puts out what
is left. Products are made bit by bit, as on paper; the angle is measured by CORDIC turnings and
divided by the number of periods; cosine and sine come from their series or a table.

A state is a dict from register name to value. P1, P2 hold x and y seen from the centre with 2n + 8
bits of fraction, DX and DY the increments of ``rotation``, PX and PY products, UX and UY the means
of ``predictor_corrector``, ``factor`` and ``other`` what is multiplied with, ``digit`` the bits to
come, ``pass`` which product it is, ``computed`` whether the period's point is known; P3, P4 the
coordinates (signed); XC, YC the centre, XK, YK the end; ``periods``, ``period``, ``timer``,
``out_`` as on every carrier. Around them the prepared block: that of the circular interpolator, and
``next_end_``, ``next_clockwise``, ``next_periods``, ``next_period``, ``stage``, the angle meter
(``vx``, ``vy``, ``angle``), the divider (``quotient_angle``, ``rest_angle``) and the coefficient's
``square``, ``scaled``, ``term``, ``kappa``, ``sine``, ``product``, ``multiplier``, ``order``,
``place``; and УУ.
"""

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from discreta.sim.golden.carrier import PERIOD_BITS, put_out, put_out_registers, signed
from discreta.sim.golden.circular import Circular
from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["CarrierCircular"]

State = dict[str, Value]

RANGE = 1

#: Bits that the turned vector has below the steps.
GUARD = 8

#: Whole bits of an angle.
WHOLE = 11


@dataclass(frozen=True)
class CarrierCircular:
    """The circular interpolator of n = ``width`` bits on a constant carrier.

    Attributes
    ----------
    width : int
        n, 4 to 16.
    formula : str
        ``"plain"``, ``"rotation"`` or ``"predictor_corrector"``.
    coefficient : str
        ``"series"`` or ``"table"``: where rotation has its coefficient from.
    preload : str
        ``"zero"`` or ``"half"``: the fractions start at 0 or ½.
    """

    width: int = 16
    formula: str = "rotation"
    coefficient: str = "series"
    preload: str = "half"

    @property
    def bits(self) -> int:
        """Bits of Δφ, κ and the sine, all of fraction."""
        return 3 * self.width + 8

    @property
    def fraction(self) -> int:
        """Bits of fraction of the coordinates."""
        return 2 * self.width + 8

    @property
    def full(self) -> int:
        """Bits of the coordinates."""
        return self.width + 3 + self.fraction

    @property
    def least_period(self) -> int:
        """Clocks that a period must have."""
        products = {"plain": 1, "predictor_corrector": 2, "rotation": 3}[self.formula]
        return products * (self.bits + 1) + 3

    @property
    def turnings(self) -> int:
        """Turnings that measure an angle."""
        return self.width + 6

    @property
    def dividing(self) -> int:
        """The stage in which the divider is loaded."""
        return 2 * (self.turnings + 1)

    @property
    def divided(self) -> int:
        """The stage after the division."""
        return self.dividing + WHOLE + self.bits + 1

    @property
    def prepared(self) -> int:
        """The last stage of the preparation."""
        return self.divided + (2 if self.formula == "rotation" else 0)

    @cached_property
    def _arc(self) -> Circular:
        return Circular(self.width)

    @cached_property
    def program(self) -> list[tuple[str, str | int | tuple[int, ...], str]]:
        """Products that give κ and the sine: multiplicand, multiplier, and what it becomes."""
        one = 1 << self.bits
        program: list[tuple[str, str | int | tuple[int, ...], str]] = []
        program.append(("angle", "angle", "square"))
        # 2(1 − cos a) = a² − 2a⁴/4! + 2a⁶/6! − …, sin a = a − a³/3! + a⁵/5! − …
        for first, what, divisors in (
            ("square", "kappa", (56, 30, 12)),
            ("angle", "sine", (42, 20, 6)),
        ):
            if self.coefficient == "series":
                for divisor in divisors:
                    program.append(("square", "term", "scaled"))
                    program.append(("scaled", one // divisor, "term"))
            else:
                program.append(("square", self._table(what), "term"))
            program.append((first, "term", what))
        return program

    def _table(self, what: str) -> tuple[int, ...]:
        """Give (1 − κ/u)/u or (1 − sin a/a)/u in the middle of 256 equal parts of u < ¼."""
        unit, entries = 1 << (self.width + 8), []
        for index in range(256):
            u = Fraction(2 * index + 1, 2048)
            # κ/u = Σ 2(−u)^k/(2k + 2)!, sin a/a = Σ (−u)^k/(2k + 1)!; less 1, by −u.
            entry = Fraction(0)
            for k in range(1, 14):
                over = math.factorial(2 * k + (2 if what == "kappa" else 1))
                entry -= Fraction(2 if what == "kappa" else 1, over) * (-1) ** k * u ** (k - 1)
            entries.append(round(entry * unit) << (self.bits - self.width - 8))
        return tuple(entries)

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        n, full = self.width, self.full
        kinds: dict[str, tuple[int, bool]] = dict.fromkeys(("p1", "p2", "px", "py"), (full, True))
        kinds |= {"factor": (self.bits, False), "digit": (self.bits.bit_length(), False)}
        kinds |= {"computed": (1, False), "clockwise": (1, False), "next_clockwise": (1, False)}
        kinds |= dict.fromkeys(("xc", "yc", "xk", "yk", "next_end_x", "next_end_y"), (n + 1, True))
        kinds |= dict.fromkeys(("periods", "next_periods"), (n + 8, False))
        kinds |= dict.fromkeys(("period", "next_period"), (PERIOD_BITS, False))
        kinds |= {"running": (1, False), "done": (1, False), "error": (2, False)}
        kinds |= {"stage": (self.prepared.bit_length(), False)}
        kinds |= {"vx": (n + 2 + GUARD, False), "vy": (n + 2 + GUARD, True)}
        kinds |= {"angle": (1 + WHOLE + n + 16, True)}
        kinds |= {"quotient_angle": (WHOLE + self.bits, False), "rest_angle": (n + 8, False)}
        if self.formula != "plain":
            kinds["pass"] = (2, False)
        if self.formula == "predictor_corrector":
            kinds |= dict.fromkeys(("ux", "uy"), (full, True))
        if self.formula == "rotation":
            kinds |= dict.fromkeys(("dx", "dy"), (full, True))
            names = ("other", "square", "term", "kappa", "sine", "product", "multiplier")
            kinds |= dict.fromkeys(names, (self.bits, False))
            if self.coefficient == "series":
                kinds["scaled"] = (self.bits, False)
            kinds |= {"order": (len(self.program).bit_length(), False)}
            kinds |= {"place": ((self.bits + 1).bit_length(), False)}
        return kinds | self._arc.prepared_registers() | put_out_registers(n)

    def reset(self) -> State:
        """Give the state after reset."""
        return dict.fromkeys(self.registers(), 0)

    def outputs(self, state: State, busy_behind: Value = 0) -> dict[str, Value]:  # noqa: ARG002
        """Give what the ports show in a state."""
        return {
            "blocks_ready": negate(state["held"]),
            "steps_valid": state["waiting"],
            "steps_last": negate(state["running"]),
            "busy": state["held"] | state["running"] | state["waiting"],
            "done": state["done"],
            "error": state["error"],
            "steps_x": state["out_x"],
            "steps_y": state["out_y"],
            "position_x": state["p3"],
            "position_y": state["p4"],
        }

    def step(self, state: State, inputs: dict[str, Value], busy_behind: Value = 0) -> State:
        """Give the state after one clock.

        ``inputs``: those of the circular interpolator, ``blocks_periods``, ``blocks_period``.
        ``busy_behind``: a second stage is not done yet.
        """
        taken = state["waiting"] & inputs["steps_ready"]
        free = negate(state["waiting"]) | inputs["steps_ready"]
        start = self.start(state, inputs["steps_ready"], busy_behind)
        load = start & equal(self.fault(state), 0)
        accept = inputs["blocks_valid"] & negate(state["held"])
        clock = state["running"] & free

        after = self._compute(state, clock)
        due = clock & state["computed"] & equal(state["timer"], 0)
        increments, final = self._increments(state)
        after["computed"] = where(due, 0, after["computed"])
        # The next period's products begin.
        for name, value in self._afresh().items():
            after[name] = where(due, value, after[name])
        after["periods"] = (state["periods"] - due) & (2 ** (self.width + 8) - 1)
        for name, value in self._load(state).items():
            after[name] = where(load, value, after[name])
        starts = {a: state[f"start_{a}"] for a in "xy"}
        after |= put_out(state, increments, due, taken, load, starts, self.width)
        finished = due & final
        after["running"] = where(load, negate(state["empty"]), where(finished, 0, state["running"]))
        after["done"] = (taken & negate(state["running"])) | (load & state["empty"])
        after["error"] = where(start, self.fault(state), 0)

        received = self._arc.receive(inputs)
        for name, value in self._arc.measure(state).items():
            after[name] = where(accept, received.get(name, value), value)
        after["held"] = where(accept, 1, where(start, 0, state["held"]))
        after |= self._prepare(state, start)
        for a in "xy":
            after[f"next_end_{a}"] = where(
                accept, inputs[f"blocks_end_{a}"], state[f"next_end_{a}"]
            )
        for name in ("clockwise", "periods", "period"):
            after[f"next_{name}"] = where(accept, inputs[f"blocks_{name}"], state[f"next_{name}"])
        return after

    def fault(self, state: State) -> Value:
        """Give what the prepared block is answered: 0, or why it is refused."""
        bad = equal(state["next_periods"], 0) | less(state["next_period"], self.least_period)
        wide = negate(equal(state["quotient_angle"] >> (self.bits - 1), 0))
        if self.formula != "rotation":
            around = (self._swept(state) >> (self.width + 16)) + 1
            wide = wide | less(state["next_periods"], around * around)
        # A block of no length sweeps no angle, whatever was measured.
        bad = bad | (wide & negate(state["empty"]))
        return where(equal(state["fault"], 0), where(bad, RANGE, 0), state["fault"])

    def empty(self, state: State) -> Value:
        """Tell whether the prepared block has no length."""
        return state["empty"]

    def start(self, state: State, ready: Value, busy_behind: Value) -> Value:
        """Tell whether the prepared block is started."""
        nothing = state["empty"] | negate(equal(self.fault(state), 0))
        waits = where(nothing, state["waiting"], state["waiting"] & negate(ready))
        prepared = equal(state["stage"], self.prepared) & negate(nothing & busy_behind)
        return prepared & negate(state["running"]) & negate(waits)

    def _compute(self, state: State, clock: Value) -> State:
        """A clock of the products, or of what is made of one."""
        going = clock & negate(state["computed"])
        multiplying = going & negate(equal(state["digit"], 0))
        finish = going & equal(state["digit"], 0)
        after = dict(state)
        after["digit"] = where(
            multiplying, state["digit"] - 1, where(finish, self.bits, state["digit"])
        )
        bit = state["factor"] & 1
        begun = equal(state["pass"], 0) if self.formula != "plain" else 1
        turned = {
            "x": where(state["clockwise"], state["py"], 0 - state["py"]),
            "y": where(state["clockwise"], 0 - state["px"], state["px"]),
        }
        complete: Value = 1
        for a, place in (("x", "p1"), ("y", "p2")):
            value, product = state[place], state[f"p{a}"]
            factor = value
            if self.formula == "predictor_corrector":
                factor = where(begun, value, state[f"u{a}"])
            added = (product + where(bit, factor, 0)) >> 1
            after[f"p{a}"] = where(finish, 0, where(multiplying, added, product))
            moved = signed(value + turned[a], self.full)
            if self.formula == "plain":
                after[place] = where(finish, moved, value)
            elif self.formula == "predictor_corrector":
                complete = negate(begun)
                mean = signed((2 * value + turned[a]) >> 1, self.full)
                after[f"u{a}"] = where(finish & begun, mean, state[f"u{a}"])
                after[place] = where(finish & complete, moved, value)
            else:
                second, complete = equal(state["pass"], 1), equal(state["pass"], 2)
                increment = state[f"d{a}"]
                later = where(second, increment + turned[a], increment - product)
                later = signed(where(begun, product >> 1, later), self.full)
                after[f"d{a}"] = where(finish, later, increment)
                moved = signed(value + increment - product, self.full)
                after[place] = where(finish & negate(begun | second), moved, value)
        factor = (state["factor"] >> 1) | (bit << (self.bits - 1))
        after["factor"] = where(multiplying, factor, state["factor"])
        if self.formula == "predictor_corrector":
            after["pass"] = where(finish, 1, state["pass"])
        if self.formula == "rotation":
            change = finish & negate(complete)
            after["pass"] = (state["pass"] + change) & 3
            after["factor"] = where(change, state["other"], after["factor"])
            after["other"] = where(change, state["factor"], state["other"])
        after["computed"] = where(finish & complete, 1, state["computed"])
        return after

    def _afresh(self) -> State:
        """Give what the products of a period begin with."""
        afresh: State = {"digit": self.bits, "px": 0, "py": 0}
        return afresh | ({"pass": 0} if self.formula == "predictor_corrector" else {})

    def _increments(self, state: State) -> tuple[dict[str, Value], Value]:
        """Give the steps of this period, and whether it is the last one."""
        top = 2**self.width - 1
        half = {"zero": 0, "half": 2 ** (self.fraction - 1)}[self.preload]
        last, arrived = equal(state["periods"], 1), equal(state["periods"], 2)
        increments = {}
        for a, full, place in (("x", "p1", "p3"), ("y", "p2", "p4")):
            whole = ((state[full] + half) >> self.fraction) + state[f"{a}c"]
            target = where(less(top, whole), top, where(less(whole, -1 - top), -1 - top, whole))
            arrived = arrived & equal(target, state[f"{a}k"])
            reached = state[place] + where(state["waiting"], state[f"out_{a}"], 0)
            to = where(last, state[f"{a}k"], target) - reached
            increments[a] = signed(to, self.width + 2)
        return increments, last | arrived

    def _load(self, state: State) -> State:
        """Give what a block loads when it is started."""
        loaded = {"computed": 0, "clockwise": state["next_clockwise"]}
        loaded |= {name: state[f"next_{name}"] for name in ("periods", "period")}
        for a, place in (("x", "p1"), ("y", "p2")):
            loaded[place] = (state[f"start_{a}"] - state[f"center_{a}"]) << self.fraction
            loaded |= {f"{a}c": state[f"center_{a}"], f"{a}k": state[f"next_end_{a}"]}
        loaded |= self._afresh()
        if self.formula == "rotation":
            return loaded | {"pass": 0, "factor": state["kappa"], "other": state["sine"]}
        return loaded | {"factor": state["quotient_angle"] & (2**self.bits - 1)}

    def _swept(self, state: State) -> Value:
        """Give the angle that was measured, none if it is less."""
        return where(less(state["angle"], 0), 0, state["angle"])

    def _prepare(self, state: State, start: Value) -> State:
        """Angle, division and coefficient, in the clocks after those of the radius meter."""
        n, stage = self.width, state["stage"]
        second = self.turnings + 1
        begins = equal(stage, 0)
        goes = negate(equal(stage, self.prepared))
        if self.formula == "rotation":
            goes = goes & negate(equal(stage, self.divided + 1) & negate(equal(state["order"], 0)))
        measured = state["held"] & equal(state["tick"], 0)
        forward = (stage + goes) & (2 ** self.prepared.bit_length() - 1)
        after: State = {"stage": where(start, 0, where(begins, measured, forward))}

        # Turn the vector onto the axis, and add up by how much.
        one = 2 ** (n + 16)
        ahead = less(stage, second)
        index = where(ahead, stage - 1, stage - second - 1)
        turning = less(stage, self.dividing) & negate(begins) & negate(equal(stage, second))
        part: Value = 0
        for i in range(self.turnings):
            part = where(equal(index, i), round(math.atan(1 / 2**i) * one), part)
        vx, vy = state["vx"], state["vy"]
        index = index & (2 ** (self.turnings - 1).bit_length() - 1)
        by_x, by_y = (v >> index for v in (vx, vy))
        below = less(vy, 0)
        turned = {
            "vx": where(below, vx - by_y, vx + by_y) & (2 ** (n + 2 + GUARD) - 1),
            "vy": signed(where(below, vy + by_x, vy - by_x), n + 2 + GUARD),
            "angle": signed(
                where(below ^ negate(ahead), state["angle"] - part, state["angle"] + part),
                1 + WHOLE + n + 16,
            ),
        }
        taken_x = where(begins, state["to_x"], state["from_x"]) << GUARD
        taken_y = where(begins, state["to_y"], state["from_y"]) << GUARD
        crossed = state["first_turns"] * round(math.pi / 2 * one)
        crossed = signed(crossed, 1 + WHOLE + n + 16)
        fresh = {"vx": taken_x, "vy": taken_y, "angle": where(begins, crossed, state["angle"])}
        loads = begins | equal(stage, second)
        for name, value in turned.items():
            after[name] = where(loads, fresh[name], where(turning, value, state[name]))

        # Divide it by the number of periods, as on paper.
        wide = WHOLE + self.bits
        loading = equal(stage, self.dividing)
        dividing = less(self.dividing, stage) & less(stage, self.divided)
        brought = 2 * state["rest_angle"] + (state["quotient_angle"] >> (wide - 1))
        fits = negate(less(brought, state["next_periods"]))
        rest = where(fits, brought - state["next_periods"], brought) & (2 ** (n + 8) - 1)
        quotient = (2 * state["quotient_angle"] + fits) & (2**wide - 1)
        dividend = (self._swept(state) << (self.bits - n - 16)) & (2**wide - 1)
        after["quotient_angle"] = where(
            loading, dividend, where(dividing, quotient, state["quotient_angle"])
        )
        after["rest_angle"] = where(loading, 0, where(dividing, rest, state["rest_angle"]))
        if self.formula == "rotation":
            after |= self._coefficient(state, equal(stage, self.divided))
        return after

    def _coefficient(self, state: State, begin: Value) -> State:
        """Products one after the other, each bit by bit."""
        low = 2**self.bits - 1
        sources = {name: state[name] for name in ("square", "term")}
        sources |= {"angle": state["quotient_angle"] & low, "scaled": state.get("scaled", 0)}
        names = ("square", "scaled", "term", "kappa", "sine")
        after = {name: state[name] for name in names if name in state}
        order, place = state["order"], state["place"]
        busy = negate(equal(order, 0))
        taking = busy & equal(place, self.bits + 1)
        giving = busy & equal(place, 0)
        multiplying = busy & negate(taking) & negate(giving)
        index = (state["square"] >> (self.bits - 10)) & 255
        multiplicand, multiplier = 0, state["multiplier"]
        for number, (factor, by, to) in enumerate(self.program, start=1):
            here = equal(order, number)
            multiplicand = where(here, sources[factor], multiplicand)
            if isinstance(by, tuple):
                value: Value = 0
                for entry, constant in enumerate(by):
                    value = where(equal(index, entry), constant, value)
            else:
                value = by if isinstance(by, int) else sources[by]
            multiplier = where(here & taking, value, multiplier)
            product = state["product"] if to != "term" else low - state["product"]
            after[to] = where(here & giving, product, after[to])
            if to == "kappa":
                after["term"] = where(here & giving, low, after["term"])
        after["term"] = where(begin, low, after["term"])
        added = (state["product"] + where(state["multiplier"] & 1, multiplicand, 0)) >> 1
        product = where(taking, 0, where(multiplying, added, state["product"]))
        multiplier = where(multiplying, state["multiplier"] >> 1, multiplier)
        after["product"] = where(begin, state["product"], product)
        after["multiplier"] = where(begin, state["multiplier"], multiplier)
        for to in names:
            if to in after and to != "term":
                after[to] = where(begin, state[to], after[to])
        later = where(equal(order, len(self.program)), 0, order + 1)
        bits = 2 ** len(self.program).bit_length() - 1
        after["order"] = where(begin, 1, where(giving, later, order) & bits)
        digits = 2 ** (self.bits + 1).bit_length() - 1
        placed = where(giving, self.bits + 1, place - 1) & digits
        after["place"] = where(begin, self.bits + 1, where(busy, placed, place))
        return after
