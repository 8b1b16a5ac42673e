# amaranth: UnusedElaboratable=no
# (A part that refuses its parameters cannot be simulated.)
"""The controller's pins: line, lamps, switches. The whole way is in tests/sim/test_board.py."""

import re

import pytest
from amaranth.hdl import Fragment

from discreta.boards.host import FrameReader, encode_frame
from discreta.hdl.controller import Controller
from discreta.hdl.device import exact_device
from discreta.hdl.link import FrameType
from discreta.hdl.plain import PlainPorts
from tests.hdl.parts.clocked import run

BIT = 4
NAMES = {
    *("rx", "tx", "emergency", "leds_moving", "leds_stopped", "leds_link"),
    *(f"{side}_limit_{a}" for side in ("low", "high") for a in "xy"),
    *(f"pins_{a}_{pin}" for a in "xy" for pin in ("step", "direction")),
}


def levels(data):
    for byte in data:
        for bit in (0, *(byte >> k & 1 for k in range(8)), 1):
            yield from [bit] * BIT


def bytes_of(line):
    """Read a line that was sampled at every clock."""
    found, clock = bytearray(), 0
    while clock < len(line):
        if line[clock]:
            clock += 1
            continue
        bits = [line[clock + BIT // 2 + k * BIT] for k in range(10)]
        assert bits[0] == 0
        assert bits[9] == 1
        found.append(sum(bit << k for k, bit in enumerate(bits[1:9])))
        clock += 10 * BIT - BIT // 2
    return bytes(found)


def test_a_question_over_the_line_and_the_lamps():
    top = PlainPorts(Controller(exact_device(4, kinds=("line",), depth=1), BIT))
    assert set(top.inputs) | set(top.outputs) == NAMES
    said, lamps = [], []

    async def bench(ctx):
        async def clocks(count):
            for _ in range(count):
                said.append(ctx.get(top.outputs["tx"]))
                await ctx.tick()

        async def send(data):
            for level in levels(data):
                ctx.set(top.inputs["rx"], level)
                await clocks(1)

        def look():
            lamps.append([ctx.get(top.outputs[f"leds_{lamp}"]) for lamp in ("stopped", "link")])

        ctx.set(top.inputs["rx"], 1)
        await clocks(10)
        look()
        await send(encode_frame("QUERY", 0))
        await clocks(30 * 10 * BIT)
        look()
        ctx.set(top.inputs["emergency"], 1)
        # Two registers of the synchronizer, and one for the reason.
        await clocks(3)
        look()
        await send(encode_frame("QUERY", 0))
        await clocks(30 * 10 * BIT)

    run(top, bench)
    assert lamps == [[0, 0], [0, 1], [1, 1]]
    reader = FrameReader()
    answers = reader.feed(bytes_of(said))
    assert [answer[0] for answer in answers] == [FrameType.__members__["STATUS"].value] * 2
    # The reason is in bits 56 to 58 behind the type.
    assert [int.from_bytes(answer[1:], "little") >> 56 & 7 for answer in answers] == [0, 2]
    assert reader.damaged == 0


def test_what_is_no_device_is_refused():
    with pytest.raises(TypeError, match=r"\Adevice must be a Device, not 3\Z"):
        Controller(3, 8)  # pyright: ignore[reportArgumentType]


def test_clocks_per_bit_are_checked():
    device = exact_device(8, kinds=("line",))
    Fragment.get(device, None)
    message = "clocks per bit are 2: choose a whole number from 4 to 65536, by another baud rate or"
    with pytest.raises(ValueError, match=rf"\A{re.escape(message)} clock\Z"):
        Controller(device, 2)
