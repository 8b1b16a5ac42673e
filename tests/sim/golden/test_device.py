"""The golden model of the device against its rules, in clocks reckoned by hand."""

import inspect
from dataclasses import replace

import numpy as np
import pytest
import z3

from discreta.sim.golden import device, queue
from discreta.sim.golden.constant_speed import ConstantSpeed
from discreta.sim.golden.device import make_device
from discreta.sim.golden.exact_arc import ExactArc
from discreta.sim.golden.exact_conic import ExactConic
from discreta.sim.golden.exact_line import ExactLine
from discreta.sim.golden.linear import Linear
from discreta.sim.smt import symbols

TIMINGS = ("pulse_length", "pulse_space", "direction_setup", "direction_hold")


def trace(golden, blocks, clocks, orders=()):
    """Run blocks; give what the ports show in every clock. ``orders``: (clock, input, value)."""
    state, shown = golden.reset(), []
    left = list(blocks)
    given = dict.fromkeys(golden.inputs(), 0) | {"override": 128} | dict.fromkeys(TIMINGS, 1)
    for clock in range(clocks):
        given |= {name: value for at, name, value in orders if at == clock}
        out = golden.outputs(state)
        shown.append(out)
        block = {f"blocks_{name}": value for name, value in (left[0] if left else {}).items()}
        state = golden.step(state, given | block | {"blocks_valid": int(bool(left))})
        if left and out["blocks_ready"]:
            left.pop(0)
    return shown


def edges(shown, pin):
    """Give the clocks of the leading edges of a pin."""
    levels = np.array([out[f"pins_{pin}"] for out in shown])
    return np.flatnonzero(np.diff(levels, prepend=0) == 1).tolist()


LINE = {"kind": 0, "end_x": 8, "end_y": 0}


def test_clocks_of_a_line():
    """Accepted in 0, handed over in 1: the first step of the exact line waits 8 clocks later, in 9.

    That is behind the speed: the block begins in 2, so F is multiplied in 3, is the target in 5 and
    the rate in 6. From then on a step waits in every clock, and leaves when the one before it is
    launched: a pulse of 1 in and 1 out takes two clocks.
    """
    shown = trace(make_device(4, ("line",)), [LINE], 40)
    # Taken in 9, pending in 10, seen in 11.
    assert edges(shown, "x_step") == list(range(11, 27, 2))
    assert [out["position_x"] for out in shown[10:28:2]] == list(range(9))
    # The second one is taken in 10 and waits for two clocks, as all behind it: the last one leaves
    # in 22, done follows by a clock; its pulse is out in 25, and in in 26.
    assert [clock for clock, out in enumerate(shown) if out["done"]] == [23]
    assert [out["busy"] for out in shown] == [0] + [1] * 25 + [0] * 14


def test_clocks_of_a_line_in_ticks():
    """At a pace of 2 every other tick carries a step, beginning with the first, half a tick due.

    A tick leaves in every clock from 9 on, also those that the pulses have nothing to do with: the
    last step in 23, the eighth one.
    """
    shown = trace(make_device(4, ("line",)), [LINE | {"pace": 2**16}], 40)
    assert edges(shown, "x_step") == list(range(11, 27, 2))
    assert [clock for clock, out in enumerate(shown) if out["done"]] == [24]


def test_done_in_order_without_steps():
    """A line of no length is answered between two that move, and a place in its turn."""
    blocks = [LINE, LINE, {"kind": 3, "end_x": -3, "end_y": 2}, {"kind": 0, "end_x": -3}]
    shown = trace(make_device(4, ("line",)), blocks, 60)
    assert sum(out["done"] for out in shown) == 4
    assert (shown[-1]["position_x"], shown[-1]["position_y"]) == (-3, 0)
    assert len(edges(shown, "x_step")) == 8
    assert len(edges(shown, "y_step")) == 2


def test_reasons():
    """A block of a kind that there is none for; a line that is too long; an arc off its circle."""
    for kinds, block, reason in (
        (("line",), {"kind": 1}, 7),
        (("line",), {"kind": 0, "end_x": -16, "end_y": 1}, 4),
        (("line", "arc"), {"kind": 1, "end_x": 9, "center_x": 2}, 5),
    ):
        shown = trace(make_device(4, kinds), [block, LINE, LINE], 60)
        assert shown[-1]["reason"] == reason
        assert shown[-1]["blocks_ready"] == 0
        assert not any(out["done"] for out in shown)


def test_emergency():
    """Given in clock 12 alone: the reason in 13, the last edge in 13, no more after it."""
    shown = trace(
        make_device(4, ("line",)),
        [LINE] * 9,
        60,
        [(12, "emergency", 1), (13, "emergency", 0), (30, "clear", 1)],
    )
    assert [out["reason"] for out in shown] == [0] * 13 + [2] * 18 + [0] * 29
    assert [clock for clock in edges(shown, "x_step") if clock <= 31] == [11, 13]
    # Six steps are left of the line that is accepted after it.
    assert len(edges(shown, "x_step")) == 8


def test_what_it_is_made_of():
    golden = make_device(6, ("conic", "line", "arc"), "quadrature", False)
    line, arc = ConstantSpeed(ExactLine(6)), ConstantSpeed(ExactArc(6))
    assert golden.interpolators == (("line", line), ("arc", arc), ("conic", ExactConic(6)))
    assert (golden.feed.pairing, golden.pulse.kind) == (False, "quadrature")
    assert (golden.width, golden.axes, golden.letters) == (6, 2, "xy")
    assert set(golden.reset()) == set(golden.registers())
    assert golden.queue.kinds == ("line", "arc", "conic")
    assert golden.queue.steady == ("line", "arc")
    # Those of the lecture can be chosen, and know nothing of ticks.
    lecture = replace(golden, interpolators=(("line", Linear(6)), ("arc", arc)))
    assert lecture.queue.steady == ("arc",)
    assert "blocks_pace" in lecture.inputs()
    assert "blocks_pace" not in replace(lecture, interpolators=(("line", Linear(6)),)).inputs()


@pytest.mark.parametrize("kinds", [("line",), ("line", "arc")])
def test_integers_and_bit_vectors_agree(kinds):
    """Random states, reachable or not, one clock, in both."""
    golden = make_device(4, kinds)
    random = np.random.default_rng(5)
    registers, inputs = golden.registers(), golden.inputs()

    def draw(bits, signed):
        low = -(2 ** (bits - 1)) if signed else 0
        value = int.from_bytes(random.bytes(8)) % 2**bits
        return low + (value if random.random() < 0.6 else value & 1)

    wide, given = symbols(registers, 70), symbols(inputs, 70, ".in")
    formula = golden.step(wide, given)
    for _ in range(8):
        state = {name: draw(*kind) for name, kind in registers.items()}
        values = {name: draw(*kind) for name, kind in inputs.items()}
        one = golden.step(state, values)
        symbol = [
            (z3.BitVec(name, bits), z3.BitVecVal(state[name], bits))
            for name, (bits, _) in registers.items()
        ]
        symbol += [
            (z3.BitVec(f"{name}.in", bits), z3.BitVecVal(values[name], bits))
            for name, (bits, _) in inputs.items()
        ]
        for name, value in formula.items():
            number = value if isinstance(value, int) else z3.simplify(z3.substitute(value, *symbol))
            number = number if isinstance(number, int) else number.as_signed_long()
            assert number == one[name], name


def test_it_shares_nothing_with_what_it_checks():
    for module in (device, queue):
        source = inspect.getsource(module)
        assert "discreta.hdl" not in source
        assert "amaranth" not in source
