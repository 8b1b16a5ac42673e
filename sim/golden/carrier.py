"""What the golden models on a constant carrier have in common: how increments leave."""

from discreta.sim.golden.logic import Value, equal, negate, where

__all__ = ["PERIOD_BITS", "put_out", "put_out_registers", "signed"]

PERIOD_BITS = 24


def put_out_registers(width: int) -> dict[str, tuple[int, bool]]:
    """Give width and sign of the registers of position, timer and increments that wait."""
    kinds = dict.fromkeys(("p3", "p4"), (width + 1, True))
    kinds |= dict.fromkeys(("out_x", "out_y"), (width + 2, True))
    return kinds | {"timer": (PERIOD_BITS, False), "waiting": (1, False)}


def put_out(
    state: dict[str, Value],
    increments: dict[str, Value],
    due: Value,
    taken: Value,
    load: Value,
    starts: dict[str, Value],
    width: int,
) -> dict[str, Value]:
    """Give position, timer and the increments that wait after a clock.

    The carrier stands still while increments wait that are not taken.
    """
    goes = negate(state["waiting"]) | taken
    zero = equal(state["timer"], 0)
    opened = (state["period"] - 1) & (2**PERIOD_BITS - 1)
    timer = where(goes, where(zero, 0, state["timer"] - 1), state["timer"])
    after = {
        "timer": where(due, opened, timer),
        "waiting": where(due, 1, where(goes, 0, state["waiting"])),
    }
    for a, place in (("x", "p3"), ("y", "p4")):
        after[f"out_{a}"] = where(due, increments[a], state[f"out_{a}"])
        moved = signed(state[place] + state[f"out_{a}"], width + 1)
        after[place] = where(load, starts[a], where(taken, moved, state[place]))
    return after


def signed(value: Value, bits: int) -> Value:
    """Keep a number to its signed bits."""
    half = 2 ** (bits - 1)
    return ((value + half) & (2 * half - 1)) - half
