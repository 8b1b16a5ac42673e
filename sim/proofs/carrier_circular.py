"""Promises of the circular interpolator on a constant carrier; see the module ``carrier`` here.

What a block is when it is prepared is proven of the circular interpolator, which has the same
source for it: see the module ``arc_input``.
"""

import z3

from discreta.sim.golden.carrier_circular import CarrierCircular
from discreta.sim.golden.logic import Value
from discreta.sim.proofs.carrier import PLACES, CarrierRegisters, division
from discreta.sim.smt import Obligation

__all__ = ["promises"]


def promises(golden: CarrierCircular) -> list[Obligation]:
    """Give everything that is promised of it."""
    return [*_Registers(golden).obligations(), *division("A"), *_product(), *_turning(golden)]


class _Registers(CarrierRegisters):
    """What is promised of the registers, in bit-vectors."""

    def __init__(self, golden: CarrierCircular):
        super().__init__(golden, arc=True)

    def invariant(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        facts = super().invariant(state, ghosts)
        for a in "xy":
            facts |= {
                f"running {a}": z3.Implies(
                    state["running"] == 1, state[f"{a}k"] == ghosts[f"end_{a}"]
                ),
                f"prepared {a}": state[f"next_end_{a}"] == ghosts[f"next_end_{a}"],
            }
        facts["digits"] = state["digit"] <= self.golden.bits
        if self.golden.formula != "plain":
            facts["pass"] = state["pass"] <= (2 if self.golden.formula == "rotation" else 1)
        return facts

    def whole(self, a: str, full: str) -> Value:
        """Give the coordinate that an axis comes to by its formula."""
        half = {"zero": 0, "half": 2 ** (self.golden.fraction - 1)}[self.golden.preload]
        top = 2**self.golden.width - 1
        whole = ((self.state[full] + half) >> self.golden.fraction) + self.state[f"{a}c"]
        return z3.If(whole > top, top, z3.If(whole < -1 - top, -1 - top, whole))

    def obligations(self) -> list[Obligation]:
        """Give everything that is promised of them."""
        golden, state, after = self.golden, self.state, self.after
        known = list(self.invariant(state, self.ghosts).values())
        regular = z3.And(self.put, z3.Not(self.load), state["periods"] != 1)
        goes = z3.And(self.running, self.free, z3.Not(self.load), state["computed"] == 0)
        full = {"x": "p1", "y": "p2"}
        return [
            *super().obligations(),
            Obligation(
                "start: the point seen from the centre, no fraction, all bits of a product to come",
                [*known, self.load],
                {
                    a: after[full[a]]
                    == (state[f"start_{a}"] - state[f"center_{a}"]) << golden.fraction
                    for a in "xy"
                }
                | {
                    "digits": after["digit"] == golden.bits,
                    "periods": after["periods"] == state["next_periods"],
                },
            ),
            Obligation(
                "period: what is put out leads to the whole part of the formula's point, within "
                "the coordinates there are",
                [*known, regular],
                {a: self.reached(after, a) == self.whole(a, full[a]) for a in PLACES},
            ),
            Obligation(
                "period: the fraction is kept, whatever is put out",
                [*known, self.put, z3.Not(self.load)],
                {a: after[full[a]] == state[full[a]] for a in "xy"},
            ),
            Obligation(
                f"a product takes {golden.bits + 1} clocks, one a bit and one to use it",
                [*known, goes],
                {
                    "bit": z3.Implies(state["digit"] != 0, after["digit"] == state["digit"] - 1),
                    "used": z3.Implies(
                        state["digit"] == 0,
                        z3.And(
                            after["digit"] == golden.bits,
                            z3.Or(
                                after["computed"] == 1,
                                after["pass"] == state["pass"] + 1
                                if golden.formula != "plain"
                                else z3.BoolVal(False),
                            ),
                        ),
                    ),
                },
            ),
        ]


def _product() -> list[Obligation]:
    """What the bits of a product come to, in integers: 2^k is the weight of the next one."""
    factor, x, product, low, weight, bit, half = z3.Ints("factor x product low 2^k bit half")
    lost = product + bit * x - 2 * half
    return [
        Obligation(
            "product: with the lower bits of the factor times x = product·2^k + low and 0 ≤ low < "
            "2^k the same holds of one bit more after a clock, so that at last it is ⌊factor·x⌋",
            [
                factor * x == product * weight + low,
                *(low >= 0, low < weight, bit >= 0, bit <= 1, lost >= 0, lost <= 1),
            ],
            [
                (factor + bit * weight) * x == half * (2 * weight) + (lost * weight + low),
                lost * weight + low >= 0,
                lost * weight + low < 2 * weight,
            ],
            True,
        )
    ]


def _turning(golden: CarrierCircular) -> list[Obligation]:
    """What a period makes of the radius, in real numbers without rounding."""
    x, y, u, c, s, angle, periods, whole = z3.Reals("x y Δφ cos sin A N ⌊A⌋+1")
    square = x * x + y * y
    if golden.formula == "plain":
        turned = x - y * u, y + x * u
        claim = turned[0] ** 2 + turned[1] ** 2 == square * (1 + u * u)
        title, given = "the square of the radius grows by the factor 1 + Δφ²", []
    elif golden.formula == "predictor_corrector":
        predicted = x - y * u, y + x * u
        turned = x - (y + predicted[1]) / 2 * u, y + (x + predicted[0]) / 2 * u
        claim = 4 * (turned[0] ** 2 + turned[1] ** 2) == square * (4 + u**4)
        title, given = "the square of the radius grows by the factor 1 + Δφ⁴/4", []
    else:
        # The period before was turned back by Δφ: then the next one turns on by Δφ.
        kappa = 2 * (1 - c)
        step = x - (x * c + y * s), y - (y * c - x * s)
        turned = x + step[0] - kappa * x, y + step[1] - kappa * y
        claim = z3.And(turned[0] == x * c - y * s, turned[1] == y * c + x * s)
        title, given = "the point is turned by just Δφ and the radius stays", [c * c + s * s == 1]
    obligations = [Obligation(f"turning: without rounding {title}", given, [claim], True)]
    if golden.formula == "rotation":
        return obligations
    return [
        *obligations,
        Obligation(
            "admission: N ≥ (⌊A⌋ + 1)² keeps A·Δφ ≤ 1, so that the radius grows by less than e^½",
            [angle >= 0, angle < whole, periods >= whole * whole, u * periods <= angle, u >= 0],
            [angle * u <= 1],
            True,
        ),
    ]
