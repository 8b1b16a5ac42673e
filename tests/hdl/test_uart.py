# amaranth: UnusedElaboratable=no
# (A part that refuses its parameters cannot be simulated.)
"""The ends of a serial line against their golden models, and against a line drawn by hand."""

import numpy as np
import pytest

from discreta.hdl.plain import PlainPorts
from discreta.hdl.uart import UartReceiver, UartTransmitter
from discreta.sim.golden.uart import UartReceiver as GoldenReceiver
from discreta.sim.golden.uart import UartTransmitter as GoldenTransmitter
from tests.hdl.parts.clocked import assert_refused, run

LIMITS = "a whole number from 4 to 65536"
BAD_CLOCKS = [
    (3, ValueError, f"clocks per bit are 3: choose {LIMITS}, by another baud rate or clock"),
    (
        65537,
        ValueError,
        f"clocks per bit are 65537: choose {LIMITS}, by another baud rate or clock",
    ),
    (8.0, TypeError, f"clocks per bit must be {LIMITS}, not 8.0"),
    (True, TypeError, f"clocks per bit must be {LIMITS}, not True"),
]


def simulate(core, clocks, drive):
    """Run a part; ``drive(clock, shown)`` gives all inputs. Gives what is shown in every clock."""
    top = PlainPorts(core, observe=core.registers)
    rows = []

    async def bench(ctx):
        for clock in range(clocks):
            for name, value in drive(clock).items():
                ctx.set(top.inputs[name], value)
            rows.append(
                {name.removeprefix("reg_"): ctx.get(port) for name, port in top.outputs.items()}
            )
            await ctx.tick()

    run(top, bench)
    return rows


def levels(byte, clocks_per_bit, stop=1):
    """Draw a byte on a line."""
    bits = [0, *(byte >> k & 1 for k in range(8)), stop]
    return [bit for bit in bits for _ in range(clocks_per_bit)]


def receive(line, clocks_per_bit):
    """Give (clock, byte, error) of everything that is received of a line, each taken at once."""
    rows = simulate(
        UartReceiver(clocks_per_bit), len(line), lambda clock: {"rx": line[clock], "bytes_ready": 1}
    )
    return [
        (clock, row["bytes_data"], row["bytes_error"])
        for clock, row in enumerate(rows)
        if row["bytes_valid"]
    ]


@pytest.mark.parametrize("clocks_per_bit", [4, 7, 16])
def test_every_register_of_the_receiver_is_the_golden_models(clocks_per_bit):
    random = np.random.default_rng(clocks_per_bit)
    model, given, level = GoldenReceiver(clocks_per_bit), [], 1

    def drive(_clock):
        nonlocal level
        if random.random() < 1 / clocks_per_bit:
            level = int(random.integers(2))
        given.append({"rx": level, "bytes_ready": int(random.random() < 0.5)})
        return given[-1]

    rows = simulate(UartReceiver(clocks_per_bit), 150 * clocks_per_bit, drive)
    state = model.reset()
    for clock, (row, inputs) in enumerate(zip(rows, given, strict=True)):
        assert row == model.outputs(state) | state, clock
        state = model.step(state, inputs)
    assert {row["slot"] for row in rows} == set(range(12))
    assert {row["broken"] for row in rows} == {0, 1}


@pytest.mark.parametrize("clocks_per_bit", [4, 7, 16])
def test_every_register_of_the_transmitter_is_the_golden_models(clocks_per_bit):
    random = np.random.default_rng(clocks_per_bit)
    model, given = GoldenTransmitter(clocks_per_bit), []

    def drive(_clock):
        given.append(
            {"bytes": int(random.integers(256)), "bytes_valid": int(random.random() < 0.2)}
        )
        return given[-1]

    rows = simulate(UartTransmitter(clocks_per_bit), 100 * clocks_per_bit, drive)
    state = model.reset()
    for clock, (row, inputs) in enumerate(zip(rows, given, strict=True)):
        assert row == model.outputs(state) | state, clock
        state = model.step(state, inputs)
    assert len({row["shift"] for row in rows}) > 20


@pytest.mark.parametrize("clocks_per_bit", [4, 5, 10])
def test_bytes_one_behind_the_other(clocks_per_bit):
    sent = [0x00, 0xFF, 0x55, 0xA5, 0x7E, 0x01, 0x80]
    n = clocks_per_bit
    line = [1] * 3 + [level for byte in sent for level in levels(byte, n)] + [1] * 3
    expected = [(3 + 10 * n * k + n // 2 + 9 * n + 1, byte, 0) for k, byte in enumerate(sent)]
    assert receive(line, n) == expected


@pytest.mark.parametrize("much", [-0.04, 0.04])
def test_a_sender_that_is_too_quick_or_too_slow(much):
    """4 % of 16 clocks: drawn finely, then sampled."""
    sent = list(range(0, 256, 17))
    fine = [1] * 40 + [level for byte in sent for level in levels(byte, 100)] + [1] * 100
    scale = 100 / (16 * (1 + much))
    line = [fine[int(k * scale)] for k in range(int(len(fine) / scale))]
    assert [(byte, error) for _, byte, error in receive(line, 16)] == [(b, 0) for b in sent]


def test_a_short_pulse_is_no_start_bit():
    line = [1] * 5 + [0] * 3 + [1] * 20 + levels(0x42, 8) + [1] * 5
    assert [(byte, error) for _, byte, error in receive(line, 8)] == [(0x42, 0)]


def test_a_missing_stop_bit_is_told_and_the_line_must_be_idle_again():
    line = [1] * 5 + levels(0x42, 8, stop=0) + [0] * 200 + [1] * 9 + levels(0x43, 8) + [1] * 5
    assert [(byte, error) for _, byte, error in receive(line, 8)] == [(0x42, 1), (0x43, 0)]


@pytest.mark.parametrize("clocks_per_bit", [4, 9])
def test_the_line_as_it_is_sent(clocks_per_bit):
    sent = [0x00, 0xFF, 0x55, 0x7E]
    n = clocks_per_bit
    left = list(sent)
    core = UartTransmitter(n)
    top = PlainPorts(core)
    line = []

    async def bench(ctx):
        for _ in range(4 + 10 * n * len(sent)):
            ctx.set(top.inputs["bytes_valid"], bool(left))
            ctx.set(top.inputs["bytes"], left[0] if left else 0)
            line.append(ctx.get(top.outputs["tx"]))
            if left and ctx.get(top.outputs["bytes_ready"]):
                left.pop(0)
            await ctx.tick()

    run(top, bench)
    assert line == [1] + [level for byte in sent for level in levels(byte, n)] + [1] * 3


@pytest.mark.parametrize("part", [UartReceiver, UartTransmitter])
@pytest.mark.parametrize(("clocks", "error", "message"), BAD_CLOCKS)
def test_clocks_per_bit_are_checked(part, clocks, error, message):
    assert_refused((error, message), part, clocks)
