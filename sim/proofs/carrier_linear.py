"""Promises of the linear interpolator on a constant carrier; see the module ``carrier`` here.

Notation: Δ the length of an axis, N the periods, m·2^−f the mean increment, S the fraction kept, KO
the steps left, i the periods gone.
"""

import z3

from discreta.sim.golden.carrier_linear import NAMES, CarrierLinear
from discreta.sim.proofs.carrier import CarrierRegisters, division
from discreta.sim.smt import Obligation

__all__ = ["promises"]


def promises(golden: CarrierLinear) -> list[Obligation]:
    """Give everything that is promised of it."""
    return [*_Registers(golden).obligations(), *division("Δ·2^f"), *_numbers(golden)]


class _Registers(CarrierRegisters):
    """What is promised of the registers, in bit-vectors."""

    def __init__(self, golden: CarrierLinear):
        super().__init__(golden, arc=False)
        state = self.state
        self.given = [
            z3.Implies(
                z3.And(self.running, state["periods"] != 1),
                z3.LShR(state[mean] + state[fraction], golden.fraction_bits) <= state[left],
            )
            for mean, left, fraction in NAMES.values()
        ]

    def invariant(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        facts = super().invariant(state, ghosts)
        for a, (_, left, _) in NAMES.items():
            ahead, whole = state[left], state[f"delta_{a}"]
            ahead = z3.If(state[f"direction_{a}"] == 1, -ahead, ahead)
            whole = z3.If(state[f"negative_{a}"] == 1, -whole, whole)
            moves = z3.Or(state["running"] == 1, state["waiting"] == 1)
            facts |= {
                f"way {a}": z3.Implies(moves, self.reached(state, a) + ahead == ghosts[f"end_{a}"]),
                f"arrived {a}": z3.Implies(state["running"] == 0, state[left] == 0),
                f"prepared {a}": z3.Implies(
                    z3.And(state["pending"] == 1, state["fault"] == 0),
                    state[f"start_{a}"] + whole == ghosts[f"next_end_{a}"],
                ),
            }
        return facts

    def obligations(self) -> list[Obligation]:
        """Give everything that is promised of them."""
        golden, state, after = self.golden, self.state, self.after
        initial, one = golden.initial_fraction, golden.fraction_bits
        known = [*self.invariant(state, self.ghosts).values(), *self.given]
        regular = z3.And(self.put, z3.Not(self.load), state["periods"] != 1)
        n = golden.width
        claims, begun = {}, {}
        for a, (mean, left, fraction) in NAMES.items():
            whole = state[left] - after[left]
            claims[a] = (whole << one) + after[fraction] == state[mean] + state[fraction]
            begun |= {
                f"left {a}": after[left] == state[f"delta_{a}"],
                f"mean {a}": after[mean] == state[f"quotient_{a}"],
                f"fraction {a}": after[fraction] == initial,
            }
        return [
            *super().obligations(),
            Obligation(
                "start: all the way to go, the mean increment as divided, the preload as fraction",
                [*known, self.load],
                begun | {"periods": after["periods"] == state["next_periods"]},
            ),
            Obligation(
                "period: whole steps put out and fraction kept are the mean increment and the "
                "fraction before, on every axis",
                [*known, regular],
                claims,
            ),
            Obligation(
                f"registers are wide enough: m + S has {n + one + 1} bits of {self.wide}",
                [],
                [z3.BoolVal(n + one + 1 < self.wide)],
            ),
        ]


def _numbers(golden: CarrierLinear) -> list[Obligation]:
    """What follows for numbers, of one axis."""
    one, initial = 2**golden.fraction_bits, golden.initial_fraction
    left, s, m, periods, whole, n, length, rest = z3.Ints("KO S m left whole N Δ rest")
    value = one * left - s + initial - periods * m
    inside = [s >= 0, s < one, m >= 0, periods >= 1, periods <= n, rest >= 0, rest < n]
    divided = length * one == n * m + rest
    most = 2 ** (golden.width + 8)
    return [
        Obligation(
            "numbers: V = 2^f·KO − S + S₀ − (periods left)·m is the remainder of the division at "
            "the start, and stays it",
            [divided],
            [
                z3.Implies(z3.And(left == length, s == initial, periods == n), value == rest),
                one * (left - whole) - (m + s - one * whole) + initial - (periods - 1) * m == value,
            ],
            True,
        ),
        Obligation(
            "numbers: what a period puts out is no more than is left, except for a rounding up "
            "at the end that comes to just the end point",
            [*inside, value == rest, whole * one <= m + s, m + s < (whole + 1) * one, left >= 0],
            [whole <= left],
            True,
        ),
        Obligation(
            "last period: what is left differs from the mean m/2^f by at most "
            + ("one step" if initial == 0 else "half a step")
            + " and the remainder, N/2^f ≤ 1/16",
            [*inside, value == rest, periods == 1, n < most],
            [
                one * left - m >= -initial,
                one * left - m < one - initial + n,
                16 * n <= one,
            ],
            True,
        ),
        Obligation(
            "error: after i periods an axis has put out (S₀ + i·m − S)/2^f, off the line's i·Δ/N "
            "by less than "
            + ("one step" if initial == 0 else "half a step, or that much,")
            + " and N/2^f",
            [*inside, value == rest, divided],
            # N·2^f·(put out) − i·Δ·2^f, with i = N − periods left.
            [
                n * (one * (length - left)) - (n - periods) * (n * m + rest)
                == n * (initial - s) - (n - periods) * rest
            ],
            True,
        ),
    ]
