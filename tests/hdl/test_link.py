# amaranth: UnusedElaboratable=no
# (A part that refuses its parameters cannot be simulated.)
"""The link against its golden model, with whole, damaged, repeated and oversized frames."""

from zlib import crc32

import numpy as np
import pytest
from amaranth.hdl import Fragment

from discreta.hdl.device import exact_device, exact_layout
from discreta.hdl.link import FrameType, Link, fingerprint, layout_fields
from discreta.hdl.plain import PlainPorts
from discreta.sim.golden.link import SETTINGS, TYPES, crc
from discreta.sim.golden.link import Link as Golden
from tests.hdl.parts.clocked import BAD_AXES, BAD_WIDTHS, assert_refused, run

FLAG, ESCAPE = 0x7E, 0x7D


def make(width=8, axes=2, kinds=("line",), depth=4):
    """Make a link and its golden model."""
    layout = exact_layout(width, axes, kinds)
    golden = Golden(tuple(layout_fields(layout)), fingerprint(layout), width, axes, depth)
    return Link(layout, width, axes, depth), golden


def frame(kind, number, payload=b"", spoil=0):
    """Give a frame; ``spoil`` changes its checksum."""
    body = bytes([TYPES[kind], number]) + payload
    body += (crc32(body) ^ spoil).to_bytes(4, "little")
    inside = b"".join(
        bytes([ESCAPE, byte ^ 0x20]) if byte in (FLAG, ESCAPE) else bytes([byte]) for byte in body
    )
    return bytes([FLAG]) + inside + bytes([FLAG])


def body_of(answer):
    """Undo flags and escapes, and check the checksum; give the bytes behind the type."""
    assert answer[0] == answer[-1] == FLAG
    body, escaped = bytearray(), False
    for byte in answer[1:-1]:
        assert byte != FLAG
        if byte == ESCAPE:
            escaped = True
        else:
            body.append(byte ^ 0x20 if escaped else byte)
            escaped = False
    assert crc32(body[:-4]).to_bytes(4, "little") == body[-4:]
    assert body[0] == 128
    return bytes(body[1:-4])


def unpack(fields, data):
    """Give the values of fields."""
    total, values = int.from_bytes(data, "little"), {}
    for name, bits, signed in fields:
        value = total & (2**bits - 1)
        values[name] = value - 2**bits if signed and value >> (bits - 1) else value
        total >>= bits
    assert total == 0
    return values


def pack(fields, values):
    """Give the bytes of fields."""
    total = first = 0
    for name, bits, _ in fields:
        total |= (values[name] & (2**bits - 1)) << first
        first += bits
    return total.to_bytes(-(-first // 8), "little")


class Bench:
    """A link in simulation: bytes in, and everything that it does, clock by clock.

    Attributes
    ----------
    done : list of (clock, name, value)
        Blocks that were taken, and controls that were given for a clock.
    answers : list of bytes
    """

    def __init__(self, link, golden):
        self.golden = golden
        self.top = PlainPorts(link)
        self.inputs = {}
        self.done, self.answers = [], []
        self.clock = 0
        self._answer = b""

    async def clocks(self, ctx, count=1, **inputs):
        idle = dict.fromkeys(self.top.inputs, 0) | {"answers_ready": 1, "blocks_ready": 1}
        inputs = idle | self.inputs | inputs
        for name, value in inputs.items():
            ctx.set(self.top.inputs[name], value)
        for _ in range(count):
            shown = {name: ctx.get(port) for name, port in self.top.outputs.items()}
            for name in ("single", "stop", "emergency", "clear"):
                if shown[name]:
                    self.done.append((self.clock, name, 1))
            if shown["blocks_valid"] and inputs["blocks_ready"]:
                row = tuple(shown[f"blocks_{name}"] for name, *_ in self.golden.blocks)
                self.done.append((self.clock, "block", row))
            if shown["answers_valid"] and inputs["answers_ready"]:
                self._answer += bytes([shown["answers"]])
                if len(self._answer) > 1 and shown["answers"] == FLAG:
                    self.answers.append(self._answer)
                    self._answer = b""
            self.settings = {name: shown[name] for name, *_ in SETTINGS} | {"hold": shown["hold"]}
            self.clock += 1
            await ctx.tick()

    async def send(self, ctx, data, **inputs):
        for byte in data:
            await self.clocks(ctx, bytes_data=byte, bytes_valid=1, **inputs)

    async def ask(self, ctx, data, **inputs):
        """Send bytes; give the status that answers them."""
        self.answers.clear()
        await self.send(ctx, data, **inputs)
        await self.clocks(ctx, 120)
        return unpack(self.golden.status, body_of(self.answers[-1]))

    async def hello(self, ctx, session=77):
        return await self.ask(
            ctx, frame("HELLO", session, self.golden.fingerprint.to_bytes(4, "little"))
        )


def bench_of(story, **made):
    """Run a story: ``await story(bench, ctx)``."""
    link, golden = make(**made)
    bench = Bench(link, golden)

    async def tell(ctx):
        await story(bench, ctx)

    run(bench.top, tell)
    return bench


def block(golden, random):
    """Draw a block: values by name."""
    return {
        name: int(random.integers(2**bits)) - (2 ** (bits - 1) if signed else 0)
        for name, bits, signed in golden.blocks
    }


def test_types_and_checksum_are_those_of_the_golden_model():
    there_are = {name: kind.value for name, kind in FrameType.__members__.items()}
    assert there_are == TYPES | {"STATUS": 128}
    value = 2**32 - 1
    for byte in b"123456789":
        value = crc(value, byte)
    assert value ^ (2**32 - 1) == 0xCBF43926 == crc32(b"123456789")


def draw_frame(golden, state, random):
    """Draw a frame for a link in a state: of any kind, often damaged, repeated, cut or too long."""
    kind = str(random.choice(["BLOCK"] * 6 + [*TYPES]))
    following = state["next_block" if kind == "BLOCK" else "next_command"]
    number = (following + int(random.choice([0, 0, 0, -1, 1, 200]))) % 256
    payload = random.bytes(golden.sizes[kind])
    if kind == "HELLO":
        number = int(random.integers(1, 256))
    if kind == "HELLO" and random.random() < 0.8:
        payload = golden.fingerprint.to_bytes(4, "little")
    what = random.random()
    if what < 0.08:
        payload += random.bytes(int(random.integers(1, 60)))
    elif what < 0.12:
        payload = payload[:-1]
    data = bytearray(frame(kind, number, payload, spoil=int(what > 0.97)))
    if 0.12 < what < 0.2:
        data[int(random.integers(len(data)))] ^= int(random.integers(1, 256))
    elif 0.2 < what < 0.24:
        data = data[: int(random.integers(1, len(data)))]
    if what > 0.95:
        data += random.bytes(int(random.integers(1, 8)))
    return list(data)


@pytest.mark.parametrize(
    ("made", "stall"),
    [({}, 0.0), ({"kinds": ("line", "arc")}, 0.5), ({"width": 5, "axes": 3, "depth": 1}, 0.2)],
    ids=str,
)
def test_every_register_is_the_golden_models(made, stall):
    link, golden = make(**made)
    top = PlainPorts(link, observe=link.registers)
    random = np.random.default_rng(11)
    data = list(frame("HELLO", 77, golden.fingerprint.to_bytes(4, "little")))
    seen = {"handed": 0, "dropped": 0, "acted": 0}

    async def bench(ctx):
        state = golden.reset()
        for clock in range(2500):
            data.extend([] if data else draw_frame(golden, state, random))
            valid = int(random.random() >= stall)
            inputs = {
                "bytes_data": data.pop(0) if valid else int(random.integers(256)),
                "bytes_valid": valid,
                "bytes_error": int(random.random() < 0.001),
                "answers_ready": int(random.random() >= stall),
                "blocks_ready": int(random.random() < 0.9),
                "done": int(random.random() < 0.02),
                "busy": int(random.integers(2)),
                "button": int(random.integers(2)),
                "reason": int(random.integers(1, 8)) if random.random() < 0.02 else 0,
            }
            for a in golden.letters:
                for side in ("low", "high"):
                    inputs[f"{side}_limit_{a}"] = int(random.integers(2))
                span = 2**golden.width
                inputs[f"position_{a}"] = int(random.integers(-span, span))
            for name, value in inputs.items():
                ctx.set(top.inputs[name], value)
            shown = {name.removeprefix("reg_"): ctx.get(port) for name, port in top.outputs.items()}
            assert shown == golden.outputs(state) | state, clock
            seen["handed"] += shown["blocks_valid"] and inputs["blocks_ready"]
            after = golden.step(state, inputs)
            seen["dropped"] += after["dropped"] != state["dropped"]
            seen["acted"] += after["next_command"] != state["next_command"]
            state = after
            await ctx.tick()

    run(top, bench)
    assert min(seen.values()) >= 5, seen


def test_a_block_is_handed_over_once_as_it_was_sent_and_acknowledged():
    random = np.random.default_rng(3)

    async def story(bench, ctx):
        golden = bench.golden
        assert (await bench.hello(ctx))["session"] == 77
        for number in range(300):
            values = block(golden, random)
            data = frame("BLOCK", number % 256, pack(golden.blocks, values))
            bench.done.clear()
            await bench.send(ctx, data)
            closing = bench.clock - 1
            # The second one is a repetition: acknowledged, not acted on, not counted.
            await bench.send(ctx, data)
            status = await bench.ask(ctx, frame("QUERY", 0)) if number % 16 == 0 else None
            assert bench.done == [(closing + 1, "block", tuple(values.values()))]
            if status:
                assert status["next_block"] == (number + 1) % 256
                assert status["dropped"] == 0

    bench_of(story, kinds=("line", "arc"))


@pytest.mark.parametrize(
    "what", ["number", "checksum", "length", "error", "noise", "cut", "no session"]
)
def test_a_block_that_is_not_whole_and_next_is_dropped(what):
    async def story(bench, ctx):
        if what != "no session":
            await bench.hello(ctx)
        payload = bytes(bench.golden.sizes["BLOCK"])
        data = frame("BLOCK", int(what == "number"), payload, spoil=int(what == "checksum"))
        if what == "length":
            data = frame("BLOCK", 0, payload + b"\0")
        if what == "cut":
            data = data[:9] + data[10:]
        bench.answers.clear()
        for place, byte in enumerate(data):
            if what == "noise" and place == 5:
                await bench.clocks(ctx, bytes_data=byte, bytes_valid=1, bytes_error=1)
            error = int(what == "error" and place == 5)
            await bench.clocks(ctx, bytes_data=byte, bytes_valid=1, bytes_error=error)
        await bench.clocks(ctx, 100)
        status = unpack(bench.golden.status, body_of(bench.answers[0]))
        assert bench.done == []
        assert (status["next_block"], status["dropped"]) == (0, 1)
        # What follows is not harmed.
        if what != "no session":
            assert (await bench.ask(ctx, frame("BLOCK", 0, payload)))["next_block"] == 1
            assert len(bench.done) == 1

    bench_of(story)


def test_a_block_that_the_device_does_not_take_is_not_acknowledged():
    async def story(bench, ctx):
        await bench.hello(ctx)
        data = frame("BLOCK", 0, bytes(bench.golden.sizes["BLOCK"]))
        bench.inputs = {"blocks_ready": 0}
        status = await bench.ask(ctx, data)
        assert (status["next_block"], status["dropped"], bench.done) == (0, 1, [])
        bench.inputs = {}
        assert (await bench.ask(ctx, data))["next_block"] == 1

    bench_of(story)


def test_commands():
    async def story(bench, ctx):
        await bench.hello(ctx)
        assert bench.settings == dict.fromkeys([name for name, *_ in SETTINGS], 0) | {"hold": 0}
        values = {name: 2**bits - 3 for name, bits, _ in SETTINGS}
        story = (
            ("SET", {}),
            ("HOLD", {}),
            ("SINGLE", {"single": 1}),
            ("RESUME", {}),
            ("STOP", {"stop": 1}),
            ("CLEAR", {"clear": 1}),
        )
        for number, (kind, given) in enumerate(story):
            payload = pack(SETTINGS, values) if kind == "SET" else b""
            bench.done.clear()
            data = frame(kind, number, payload)
            status = await bench.ask(ctx, data)
            # Again: acknowledged only. With another number: dropped.
            assert await bench.ask(ctx, data) == status
            assert (await bench.ask(ctx, frame(kind, number + 2, payload)))["dropped"] == number + 1
            assert [name for _, name, _ in bench.done] == list(given)
            assert status["next_command"] == number + 1
            assert bench.settings == values | {"hold": int(kind in ("HOLD", "SINGLE"))}
            assert status["held"] == bench.settings["hold"]

    bench_of(story)


def test_an_emergency_acts_at_once_whatever_its_number_and_without_a_session():
    async def story(bench, ctx):
        for number in (0, 99):
            bench.done.clear()
            await bench.send(ctx, frame("EMERGENCY", number))
            closing = bench.clock - 1
            await bench.clocks(ctx, 100)
            assert bench.done == [(closing + 1, "emergency", 1)]

    bench_of(story)


def test_a_hello_for_other_blocks_opens_no_session():
    async def story(bench, ctx):
        other = (bench.golden.fingerprint ^ 1).to_bytes(4, "little")
        assert (await bench.ask(ctx, frame("HELLO", 5, other)))["session"] == 0
        assert (await bench.hello(ctx))["session"] == 77
        assert (await bench.ask(ctx, frame("HELLO", 5, other)))["session"] == 0

    bench_of(story)


def test_the_status_tells_what_the_device_shows():
    async def story(bench, ctx):
        await bench.hello(ctx)
        bench.inputs = {
            **{"position_x": -256, "position_y": 255, "reason": 3, "busy": 1, "button": 1},
            **{"low_limit_x": 1, "high_limit_y": 1},
        }
        status = await bench.ask(ctx, frame("QUERY", 0))
        assert status == {
            **{"session": 77, "next_block": 0, "next_command": 0, "room": 4, "dropped": 0},
            **{"done": 0, "reason": 3, "busy": 1, "held": 0, "emergency": 1},
            **{"low_limit_x": 1, "low_limit_y": 0, "high_limit_x": 0, "high_limit_y": 1},
            **{"position_x": -256, "position_y": 255},
        }

    bench_of(story)


@pytest.mark.parametrize("depth", [1, 4, 300])
def test_room_is_what_the_queue_takes_for_sure(depth):
    async def story(bench, ctx):
        await bench.hello(ctx)
        payload = bytes(bench.golden.sizes["BLOCK"])
        for number in range(3):
            status = await bench.ask(ctx, frame("BLOCK", number, payload))
            assert status["room"] == min(255, max(0, depth - number - 1))
        await bench.clocks(ctx, 2, done=1)
        status = await bench.ask(ctx, frame("QUERY", 0))
        assert (status["room"], status["done"]) == (min(255, depth - 1), 2)
        # A device that stands has thrown all away.
        await bench.clocks(ctx, reason=2)
        await bench.clocks(ctx, reason=0)
        assert (await bench.ask(ctx, frame("QUERY", 0)))["room"] == min(255, depth)

    bench_of(story, depth=depth)


def test_one_answer_for_what_comes_while_an_answer_is_sent():
    async def story(bench, ctx):
        await bench.hello(ctx)
        bench.answers.clear()
        for _ in range(5):
            await bench.send(ctx, frame("QUERY", 0), answers_ready=0)
        await bench.clocks(ctx, 200)
        # The first was begun with the first question; the second is made for all others.
        assert len(bench.answers) == 2

    bench_of(story)


@pytest.mark.parametrize(("width", "error", "message"), BAD_WIDTHS)
def test_width_is_checked(width, error, message):
    layout = exact_layout(8, kinds=("line",))
    assert_refused((error, message), Link, layout, width, 2, 4)


@pytest.mark.parametrize(("axes", "error", "message"), BAD_AXES)
def test_axes_are_checked(axes, error, message):
    layout = exact_layout(8, kinds=("line",))
    assert_refused((error, message), Link, layout, 8, axes, 4)


def test_depth_is_checked():
    layout = exact_layout(8, kinds=("line",))
    message = "depth is 0: choose a whole number from 1 to 4096"
    assert_refused((ValueError, message), Link, layout, 8, 2, 0)


def test_the_fingerprint_tells_layouts_apart():
    layouts = [
        exact_layout(width, axes, kinds)
        for width, axes, kinds in (
            (8, 2, ("line",)),
            (9, 2, ("line",)),
            (8, 3, ("line",)),
            (8, 2, ("line", "arc")),
        )
    ]
    assert len({fingerprint(layout) for layout in layouts}) == 4


@pytest.mark.parametrize(
    ("width", "axes", "kinds"),
    [(8, 2, ("line",)), (16, 3, ("arc", "line")), (12, 2, ("line", "arc", "conic"))],
)
def test_a_sender_and_a_device_lay_out_the_same_blocks(width, axes, kinds):
    device = exact_device(width, axes, kinds)
    assert exact_layout(width, axes, kinds) == device.queue.layout
    Fragment.get(device, None)
