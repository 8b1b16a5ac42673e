"""Golden model of the linear interpolator on a constant carrier, one clock at a time.

From the Ukrainian lecture (linear interpolation by digital differential analysers): in every
carrier period the full increment is the mean increment and the fraction kept; its integer part is
put out and the fraction kept again; the last period puts out what is left to the end point. Around
that stand the common contract, the division that gives the mean increments, and the timer.

A state is a dict from register name to value. P1, P2 hold the mean increments with f = n + 12 bits
of fraction, P3, P4 the coordinates (signed), P5, P6 the steps left, SX and SY the fractions;
``periods``, ``period`` and ``timer`` are the carrier's; ``out_`` the increments that wait;
``start_``, ``delta_``, ``negative_``, ``next_periods``, ``next_period``, ``tick``, ``quotient_``,
``rest_``, ``fault`` and ``pending`` belong to the prepared block; ``running``, ``done`` and
``error`` to УУ.
"""

from dataclasses import dataclass

from discreta.sim.golden.carrier import PERIOD_BITS, put_out, put_out_registers
from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["CarrierLinear"]

State = dict[str, Value]

RANGE = 1

#: By axis: mean increment, steps left, fraction.
NAMES = {"x": ("p1", "p5", "sx"), "y": ("p2", "p6", "sy")}


@dataclass(frozen=True)
class CarrierLinear:
    """The linear interpolator of n = ``width`` bits on a constant carrier.

    Attributes
    ----------
    width : int
        n, 4 to 24.
    preload : str
        ``"zero"`` or ``"half"``: the fractions start at 0 or ½.
    """

    width: int = 16
    preload: str = "half"

    @property
    def fraction_bits(self) -> int:
        """Bits of fraction of the mean increments."""
        return self.width + 12

    @property
    def least_period(self) -> int:
        """Clocks that a period must have."""
        return 2

    @property
    def initial_fraction(self) -> int:
        """What the fractions start from."""
        return {"zero": 0, "half": 2 ** (self.fraction_bits - 1)}[self.preload]

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        n, f = self.width, self.fraction_bits
        kinds: dict[str, tuple[int, bool]] = {}
        for a, (mean, left, fraction) in NAMES.items():
            kinds |= {mean: (n + f, False), left: (n, False), fraction: (f, False)}
            kinds |= {f"direction_{a}": (1, False), f"quotient_{a}": (n + f, False)}
            kinds |= {f"rest_{a}": (n + 8, False), f"start_{a}": (n + 1, True)}
            kinds |= {f"delta_{a}": (n, False), f"negative_{a}": (1, False)}
        kinds |= {"periods": (n + 8, False), "next_periods": (n + 8, False)}
        kinds |= {"period": (PERIOD_BITS, False), "next_period": (PERIOD_BITS, False)}
        kinds |= {"tick": ((n + f + 1).bit_length(), False)}
        kinds |= dict.fromkeys(("pending", "running", "done"), (1, False))
        return kinds | dict.fromkeys(("fault", "error"), (2, False)) | put_out_registers(n)

    def reset(self) -> State:
        """Give the state after reset."""
        state: State = dict.fromkeys(self.registers(), 0)
        return state | dict.fromkeys(("sx", "sy"), self.initial_fraction)

    def outputs(self, state: State, busy_behind: Value = 0) -> dict[str, Value]:
        """Give what the ports show in a state."""
        return {
            "blocks_ready": self._ready(state, busy_behind),
            "steps_valid": state["waiting"],
            "steps_last": negate(state["running"]),
            "busy": state["pending"] | state["running"] | state["waiting"],
            "done": state["done"],
            "error": state["error"],
            "steps_x": state["out_x"],
            "steps_y": state["out_y"],
            "position_x": state["p3"],
            "position_y": state["p4"],
        }

    def step(self, state: State, inputs: dict[str, Value], busy_behind: Value = 0) -> State:
        """Give the state after one clock.

        ``inputs``: ``blocks_valid``, ``blocks_start_x``…, ``blocks_end_x``…, ``blocks_periods``,
        ``blocks_period``, ``steps_ready``. ``busy_behind``: a second stage is not done yet.
        """
        taken = state["waiting"] & inputs["steps_ready"]
        free = negate(state["waiting"]) | inputs["steps_ready"]
        start = self.start(state, inputs["steps_ready"], busy_behind)
        sound = equal(self.fault(state), 0)
        load = start & sound
        empty = self.empty(state)
        due = state["running"] & free & equal(state["timer"], 0)
        last_period = equal(state["periods"], 1)
        accept = inputs["blocks_valid"] & self._ready(state, busy_behind)

        after: State = {}
        n, f = self.width, self.fraction_bits
        increments: dict[str, Value] = {}
        arriving: Value = 1
        too_long: Value = 0
        for a, (mean, left, fraction) in NAMES.items():
            # Lecture: mean increment and fraction kept; the integer part goes out.
            full = state[mean] + state[fraction]
            whole = full >> f
            arriving = arriving & equal(whole, state[left])
            now = where(last_period, state[left], whole) & (2**n - 1)
            negative = state[f"direction_{a}"]
            increments[a] = where(negative, 0 - now, now)
            after[mean] = where(load, state[f"quotient_{a}"], state[mean])
            gone = (state[left] - now) & (2**n - 1)
            after[left] = where(load, state[f"delta_{a}"], where(due, gone, state[left]))
            rest = where(due, full & (2**f - 1), state[fraction])
            after[fraction] = where(load, self.initial_fraction, rest)
            after[f"direction_{a}"] = where(load, state[f"negative_{a}"], negative)

            # Division on paper: a bit of the quotient a clock.
            brought = 2 * state[f"rest_{a}"] + (state[f"quotient_{a}"] >> (n + f - 1))
            fits = negate(less(brought, state["next_periods"]))
            brought = where(fits, brought - state["next_periods"], brought) & (2 ** (n + 8) - 1)
            quotient = (2 * state[f"quotient_{a}"] + fits) & (2 ** (n + f) - 1)
            dividing, loading = less(1, state["tick"]), equal(state["tick"], 1)
            quotient = where(dividing, quotient, state[f"quotient_{a}"])
            brought = where(dividing, brought, state[f"rest_{a}"])
            after[f"quotient_{a}"] = where(loading, state[f"delta_{a}"] << f, quotient)
            after[f"rest_{a}"] = where(loading, 0, brought)

            begin = inputs[f"blocks_start_{a}"]
            difference = inputs[f"blocks_end_{a}"] - begin
            negative = less(difference, 0)
            distance = where(negative, 0 - difference, difference)
            too_long = too_long | negate(less(distance, 2**n))
            after[f"start_{a}"] = where(accept, begin, state[f"start_{a}"])
            after[f"delta_{a}"] = where(accept, distance & (2**n - 1), state[f"delta_{a}"])
            after[f"negative_{a}"] = where(accept, negative, state[f"negative_{a}"])

        starts = {a: state[f"start_{a}"] for a in "xy"}
        after |= put_out(state, increments, due, taken, where(load, 1, 0), starts, n)
        after["period"] = where(load, state["next_period"], state["period"])
        periods = (state["periods"] - due) & (2 ** (n + 8) - 1)
        after["periods"] = where(load, state["next_periods"], periods)
        finished = due & (last_period | arriving)
        after["running"] = where(load, negate(empty), where(finished, 0, state["running"]))
        after["done"] = (taken & negate(state["running"])) | (load & empty)
        after["error"] = where(start, self.fault(state), 0)

        after["pending"] = where(accept, 1, where(start, 0, state["pending"]))
        after["fault"] = where(accept, where(too_long, RANGE, 0), state["fault"])
        ended = equal(state["tick"], n + f + 1) | equal(state["tick"], 0)
        ticked = where(ended, 0, state["tick"] + 1) & (2 ** (n + f + 1).bit_length() - 1)
        after["tick"] = where(accept, 1, ticked)
        for name in ("periods", "period"):
            after[f"next_{name}"] = where(accept, inputs[f"blocks_{name}"], state[f"next_{name}"])
        return after

    def fault(self, state: State) -> Value:
        """Give what the prepared block is answered: 0, or why it is refused."""
        none = equal(state["next_periods"], 0) | less(state["next_period"], 2)
        return state["fault"] | where(none | negate(equal(state["fault"], 0)), RANGE, 0)

    def empty(self, state: State) -> Value:
        """Tell whether the prepared block has no length."""
        return equal(state["delta_x"], 0) & equal(state["delta_y"], 0)

    def _prepared(self, state: State, busy_behind: Value) -> Value:
        """Tell whether a block can be started as far as it is concerned."""
        nothing = self.empty(state) | negate(equal(self.fault(state), 0))
        held_up = nothing & busy_behind
        return state["pending"] & equal(state["tick"], 0) & negate(held_up)

    def start(self, state: State, ready: Value, busy_behind: Value) -> Value:
        """Tell whether the prepared block is started."""
        nothing = self.empty(state) | negate(equal(self.fault(state), 0))
        may = where(nothing, negate(state["waiting"]), negate(state["waiting"]) | ready)
        return self._prepared(state, busy_behind) & negate(state["running"]) & may

    def _ready(self, state: State, busy_behind: Value) -> Value:
        """Tell whether a block can be accepted: none is prepared, or it leaves for certain."""
        idle = negate(state["running"]) & negate(state["waiting"])
        return negate(state["pending"]) | (self._prepared(state, busy_behind) & idle)
