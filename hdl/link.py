"""The link: frames over a serial line become blocks and commands, and are answered.

The protocol is described in ``docs/link.md``.
"""

from binascii import crc32
from collections.abc import Iterable

from amaranth import Cat, Const, Module, Mux, Signal
from amaranth.hdl import Value
from amaranth.lib import data, enum, stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part, check_axes, check_width, per_axis, point_layout
from discreta.hdl.feed import ACCELERATION_BITS, OVERRIDE_BITS
from discreta.hdl.plain import leaves
from discreta.hdl.pulse import TIMING_BITS
from discreta.hdl.queue import StopReason, check_depth
from discreta.hdl.uart import received_layout

__all__ = [
    "CHECKSUM_BYTES",
    "ESCAPE",
    "FLAG",
    "FLIP",
    "HEADER_BYTES",
    "MAX_ROOM",
    "NUMBERED",
    "FrameType",
    "Link",
    "fingerprint",
    "layout_fields",
    "payload_bytes",
    "settings_layout",
    "status_layout",
]

#: A flag begins and ends every frame; a byte that looks like it, or like an escape, is sent as an
#: escape and the byte with one bit changed.
FLAG, ESCAPE, FLIP = 0x7E, 0x7D, 0x20
#: Bytes before the payload, type and number, and behind it.
HEADER_BYTES, CHECKSUM_BYTES = 2, 4
#: Blocks that room is told for at most.
MAX_ROOM = 255

#: CRC-32 of Ethernet and zip, and what it is after a right checksum.
_POLYNOMIAL, _PRESET, _RESIDUE = 0xEDB88320, 0xFFFFFFFF, 0xDEBB20E3


class FrameType(enum.Enum, shape=8):  # pyright: ignore[reportGeneralTypeIssues, reportCallIssue]
    """What a frame is."""

    #: Begins a session: its number is the session's, its payload the fingerprint of the blocks.
    HELLO = 1
    #: Asks for an answer, and nothing else.
    QUERY = 2
    #: Stops the machine at once.
    EMERGENCY = 3
    #: A block; these are numbered by themselves.
    BLOCK = 4
    #: Override, acceleration and timings of the pulses; like all below numbered as a command.
    SET = 5
    #: Hold.
    HOLD = 6
    #: No more hold.
    RESUME = 7
    #: A single step, under hold.
    SINGLE = 8
    #: Stop for good, down the ramp.
    STOP = 9
    #: Back to work from where it stands.
    CLEAR = 10
    #: The answer.
    STATUS = 128


#: Types whose number must be the next command's.
NUMBERED = ("SET", "HOLD", "RESUME", "SINGLE", "STOP", "CLEAR")


def settings_layout() -> data.StructLayout:
    """Lay out what a SET frame sets."""
    return data.StructLayout(
        {
            "override": OVERRIDE_BITS,
            "acceleration": ACCELERATION_BITS,
            "pulse_length": TIMING_BITS,
            "pulse_space": TIMING_BITS,
            "direction_setup": TIMING_BITS,
            "direction_hold": TIMING_BITS,
        }
    )


def status_layout(width: int, axes: int) -> data.StructLayout:
    """Lay out what a STATUS frame tells, behind its type."""
    return data.StructLayout(
        {
            "session": 8,
            "next_block": 8,
            "next_command": 8,
            "room": 8,
            "dropped": 8,
            "done": 16,
            "reason": 3,
            "busy": 1,
            "held": 1,
            "emergency": 1,
            "low_limit": per_axis(axes, 1),
            "high_limit": per_axis(axes, 1),
            "position": point_layout(width, axes),
        }
    )


def layout_fields(layout: data.StructLayout) -> list[tuple[str, int, bool]]:
    """Name every plain field of a layout, in order, with its bits and whether it is signed."""
    return [
        (name, len(value), value.shape().signed)
        for name, _, value in leaves((), layout, Signal(layout))
    ]


def payload_bytes(layout: data.StructLayout) -> int:
    """Count the bytes of a layout: its bits, the lowest first, and zeros to a whole byte."""
    return -(-layout.size // 8)


def fingerprint(layout: data.StructLayout) -> int:
    """Give 32 bits that tell the layout of a device's blocks from any other."""
    said = ",".join(
        f"{name}:{'i' if signed else 'u'}{bits}" for name, bits, signed in layout_fields(layout)
    )
    return crc32(said.encode())


class Link(Part):
    """Takes blocks and commands for a device from frames, and answers with its status.

    A frame is a flag, the type, a number, the payload, a CRC-32, and a flag, with escapes for flags
    inside. It is acted on only when it has come whole: checksum and length of its type are right,
    and no byte of it was received with an error. A HELLO of the right ``fingerprint`` sets
    ``session`` to its number, any other one to 0. A BLOCK is offered to the device in the clock in
    which it is acted on, if a session is open and its number is ``next_block``; that goes on by one
    if the device takes it, and the block is dropped otherwise. The commands go the same way by
    ``next_command``; SET sets all settings at once; HOLD and RESUME set ``hold``; SINGLE, STOP and
    CLEAR are given for one clock. EMERGENCY is given for one clock, session or not, whatever its
    number.

    Every frame is answered, a damaged one too. An answer is made when it is sent, so that one may
    answer several frames. ``dropped`` counts, modulo 256, the frames that were not acted on, but
    no repeated ones: those have one of the last 128 numbers. ``room`` is the number of blocks that
    the queue takes for sure: its depth less the blocks it was given and has not answered.

    Latency: a frame is acted on in the clock after its closing flag. Throughput: a byte a
    clock in, a byte a clock out.

    Reset: no session, no block, override 0, so that nothing moves before a SET; numbers begin at 0.
    Overflow: of a frame that is longer than any should be the rest is not stored, and it is
    dropped. Error: a frame that is damaged passes with a chance of 2^-32.
    Source: framing and escapes as in RFC 1662 (PPP), CRC-32 as in zip; the rest is ours.

    Parameters
    ----------
    layout : StructLayout
        Of the device's blocks.
    width, axes : int
        Of the device.
    depth : int
        Of its queue.

    Attributes
    ----------
    layout : StructLayout
    fingerprint : int
        What a HELLO must carry.
    parameters : dict of str to object
        The parameters it was made with.
    diagram : dict of str to list of Signal
        Every register there is, grouped, by the group's title.
    registers : dict of str to Signal
        The same registers, by their names in waveforms.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """

    def __init__(self, layout: data.StructLayout, width: int, axes: int, depth: int):
        check_width(width)
        check_axes(axes)
        check_depth(depth)
        flags = per_axis(axes, 1)
        settings = settings_layout()
        super().__init__(
            {
                "bytes": In(stream.Signature(received_layout())),
                "answers": Out(stream.Signature(8)),
                "blocks": Out(stream.Signature(layout)),
                **{name: Out(field.shape) for name, field in settings},
                "hold": Out(1),
                "single": Out(1),
                "stop": Out(1),
                "emergency": Out(1),
                "clear": Out(1),
                "heard": Out(1),
                "button": In(1),
                "low_limit": In(flags),
                "high_limit": In(flags),
                "position": In(point_layout(width, axes)),
                "busy": In(1),
                "done": In(1),
                "reason": In(StopReason),
            }
        )
        self.layout = layout
        self.fingerprint = fingerprint(layout)
        self.depth = depth
        self.parameters: dict[str, object] = {
            "layout": layout,
            "width": width,
            "axes": axes,
            "depth": depth,
        }
        self._status = status_layout(width, axes)
        self._settings = settings
        #: Bytes of payload, by type.
        self.sizes = dict.fromkeys(FrameType.__members__, 0)
        self.sizes |= {"HELLO": 4, "BLOCK": payload_bytes(layout), "SET": payload_bytes(settings)}
        del self.sizes["STATUS"]

        # The frame that comes in.
        size = max(self.sizes.values())
        self.longest = HEADER_BYTES + size + CHECKSUM_BYTES
        self.count = Signal(range(self.longest + 2))
        self.escaped = Signal()
        self.spoilt = Signal()
        self.checksum = Signal(32, init=_PRESET)
        self.kind = Signal(8)
        self.number = Signal(8)
        self.payload = [Signal(8, name=f"payload_{k}") for k in range(size)]
        self.arrived = Signal()
        self.damaged = Signal()
        # Where the session stands.
        self.session = Signal(8)
        self.next_block = Signal(8)
        self.next_command = Signal(8)
        self.dropped = Signal(8)
        self.unanswered = Signal(range(depth + 4))
        self.done_count = Signal(16)
        self.settings = {name: Signal(field.shape, name=f"set_{name}") for name, field in settings}
        self.held = Signal()
        # The answer.
        self.due = Signal()
        self.stage = Signal(range(5))
        self.left = Signal(range(1 + payload_bytes(self._status)))
        self.flipped = Signal()
        self.proof = Signal(32, init=_PRESET)
        self.answer = [
            Signal(8, name=f"answer_{k}") for k in range(1 + payload_bytes(self._status))
        ]
        self.diagram: dict[str, list[Signal]] = {
            "frame": [
                *(self.count, self.escaped, self.spoilt, self.checksum),
                *(self.kind, self.number, *self.payload, self.arrived, self.damaged),
            ],
            "session": [
                *(self.session, self.next_block, self.next_command, self.dropped),
                *(self.unanswered, self.done_count, *self.settings.values(), self.held),
            ],
            "answer": [
                *(self.due, self.stage, self.left, self.flipped, self.proof, *self.answer),
            ],
        }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        self._receive(m)
        self._act(m)
        self._answer(m)
        return m

    def _is(self, *names: str) -> Value:
        """Tell whether the frame is of one of these types."""
        return Cat(self.kind == FrameType.__members__[name].value for name in names).any()

    def _top(self, count: int) -> Value:
        """Give the bytes of the payload that came last: it is shifted in from the top."""
        return Cat(self.payload[-count:])

    def _receive(self, m: Module) -> None:
        """Undo the escapes, check, and store."""
        byte = self.bytes.payload
        inside = Signal(8)
        expected = Signal.like(self.count, name="expected")
        wanted = Signal()
        whole, nothing = Signal(), Signal()
        m.d.comb += [
            self.bytes.ready.eq(1),
            inside.eq(byte.data ^ Mux(self.escaped, FLIP, 0)),
            whole.eq(
                (self.count == expected)
                & (self.checksum == _RESIDUE)
                & ~self.escaped
                & ~self.spoilt
            ),
            nothing.eq((self.count == 0) & ~self.escaped & ~self.spoilt),
            wanted.eq((self.count >= HEADER_BYTES) & (self.count + CHECKSUM_BYTES < expected)),
        ]
        with m.Switch(self.kind):
            for name, size in self.sizes.items():
                with m.Case(FrameType.__members__[name].value):
                    m.d.comb += expected.eq(HEADER_BYTES + size + CHECKSUM_BYTES)
        m.d.sync += [self.arrived.eq(0), self.damaged.eq(0)]
        with m.If(self.bytes.valid):
            with m.If(byte.error):
                m.d.sync += self.spoilt.eq(1)
            with m.Elif(byte.data == FLAG):
                m.d.sync += [
                    self.arrived.eq(whole),
                    self.damaged.eq(~whole & ~nothing),
                    self.count.eq(0),
                    self.escaped.eq(0),
                    self.spoilt.eq(0),
                    self.checksum.eq(_PRESET),
                ]
            with m.Elif(byte.data == ESCAPE):
                m.d.sync += self.escaped.eq(1)
            with m.Else():
                m.d.sync += [
                    self.escaped.eq(0),
                    self.checksum.eq(_checksum(self.checksum, inside)),
                ]
                with m.If(self.count <= self.longest):
                    m.d.sync += self.count.eq(self.count + 1)
                with m.If(self.count == 0):
                    m.d.sync += self.kind.eq(inside)
                with m.If(self.count == 1):
                    m.d.sync += self.number.eq(inside)
                with m.If(wanted):
                    following = [*self.payload[1:], inside]
                    m.d.sync += [
                        register.eq(value)
                        for register, value in zip(self.payload, following, strict=True)
                    ]

    def _act(self, m: Module) -> None:
        """Do what a frame says that has come whole, if its number is the next one."""
        stands = self.reason != StopReason.NONE
        opened, acts = Signal(), Signal()
        taken = Signal()
        hello, block, numbered = Signal(), Signal(), Signal()
        ahead, command_ahead = Signal(8), Signal(8)
        m.d.comb += [
            hello.eq(self.arrived & self._is("HELLO")),
            block.eq(self.arrived & self._is("BLOCK")),
            numbered.eq(self.arrived & self._is(*NUMBERED)),
            opened.eq(self.session != 0),
            ahead.eq(self.number - self.next_block),
            command_ahead.eq(self.number - self.next_command),
            acts.eq(numbered & opened & (command_ahead == 0)),
            self.heard.eq(self.arrived),
            self.blocks.payload.eq(self._top(self.sizes["BLOCK"])[: self.layout.size]),
            self.blocks.valid.eq(block & opened & (ahead == 0)),
            taken.eq(self.blocks.valid & self.blocks.ready),
            self.single.eq(acts & self._is("SINGLE")),
            self.stop.eq(acts & self._is("STOP")),
            self.clear.eq(acts & self._is("CLEAR")),
            self.emergency.eq(self.arrived & self._is("EMERGENCY")),
            self.hold.eq(self.held),
            *(getattr(self, name).eq(register) for name, register in self.settings.items()),
        ]
        with m.If(hello):
            right = self._top(self.sizes["HELLO"]) == self.fingerprint
            m.d.sync += self.session.eq(Mux(right, self.number, 0))
        with m.If(taken):
            m.d.sync += self.next_block.eq(self.next_block + 1)
        with m.If(acts):
            m.d.sync += self.next_command.eq(self.next_command + 1)
            with m.If(self._is("HOLD")):
                m.d.sync += self.held.eq(1)
            with m.If(self._is("RESUME")):
                m.d.sync += self.held.eq(0)
            with m.If(self._is("SET")):
                given = data.View(
                    self._settings, self._top(self.sizes["SET"])[: self._settings.size]
                )
                m.d.sync += [register.eq(given[name]) for name, register in self.settings.items()]
        # A repeated frame is no news: its number is behind.
        missed = (block & ~taken & ~ahead[7]) | (numbered & ~acts & ~command_ahead[7])
        with m.If(self.damaged | missed):
            m.d.sync += self.dropped.eq(self.dropped + 1)
        with m.If(self.done):
            m.d.sync += self.done_count.eq(self.done_count + 1)
        with m.If(stands):
            m.d.sync += self.unanswered.eq(0)
        with m.Elif(taken & ~self.done):
            m.d.sync += self.unanswered.eq(self.unanswered + 1)
        with m.Elif(self.done & ~taken):
            m.d.sync += self.unanswered.eq(self.unanswered - 1)

    def _answer(self, m: Module) -> None:
        """Send the status: flag, bytes, checksum, flag."""
        status = Signal(self._status)
        room = Signal(range(self.depth + 1))
        asked, begins, sent = Signal(), Signal(), Signal()
        plain, escapes = Signal(8), Signal()
        idle, opening, body, check, closing = range(5)
        m.d.comb += [
            room.eq(Mux(self.unanswered > self.depth, 0, self.depth - self.unanswered)),
            status.session.eq(self.session),
            status.next_block.eq(self.next_block),
            status.next_command.eq(self.next_command),
            status.room.eq(Mux(room > MAX_ROOM, MAX_ROOM, room)),
            status.dropped.eq(self.dropped),
            status.done.eq(self.done_count),
            status.reason.eq(self.reason.as_value()),
            # Who sees it end sees the last block counted.
            status.busy.eq(self.busy | self.done),
            status.held.eq(self.held),
            status.emergency.eq(self.button),
            status.low_limit.eq(self.low_limit),
            status.high_limit.eq(self.high_limit),
            status.position.eq(self.position),
            asked.eq(self.arrived | self.damaged),
            begins.eq(self.due & (self.stage == idle)),
            plain.eq(Mux(self.stage == body, self.answer[0], ~self.proof[:8])),
            escapes.eq(
                ((plain == FLAG) | (plain == ESCAPE))
                & ~self.flipped
                & ((self.stage == body) | (self.stage == check))
            ),
            self.answers.valid.eq(self.stage != idle),
            sent.eq(self.answers.valid & self.answers.ready),
        ]
        with m.If((self.stage == opening) | (self.stage == closing)):
            m.d.comb += self.answers.payload.eq(FLAG)
        with m.Elif(escapes):
            m.d.comb += self.answers.payload.eq(ESCAPE)
        with m.Else():
            m.d.comb += self.answers.payload.eq(plain ^ Mux(self.flipped, FLIP, 0))

        # A frame that comes while an answer is begun is answered by the next one.
        m.d.sync += self.due.eq((self.due & ~begins) | asked)
        with m.If(begins):
            size = len(self.answer) - 1
            bits = Cat(status.as_value(), Const(0, 8 * size - self._status.size))
            m.d.sync += [
                self.stage.eq(opening),
                self.left.eq(len(self.answer) - 1),
                self.proof.eq(_PRESET),
                self.answer[0].eq(FrameType.STATUS),
                *(self.answer[1 + k].eq(bits.word_select(k, 8)) for k in range(size)),
            ]
        with m.Elif(sent):
            m.d.sync += self.flipped.eq(escapes)
            with m.Switch(self.stage):
                with m.Case(opening):
                    m.d.sync += self.stage.eq(body)
                with m.Case(body), m.If(~escapes):
                    m.d.sync += [
                        self.proof.eq(_checksum(self.proof, plain)),
                        self.left.eq(self.left - 1),
                        *(a.eq(b) for a, b in zip(self.answer, self.answer[1:], strict=False)),
                    ]
                    with m.If(self.left == 0):
                        m.d.sync += [self.stage.eq(check), self.left.eq(CHECKSUM_BYTES - 1)]
                with m.Case(check), m.If(~escapes):
                    m.d.sync += [
                        self.proof.eq(self.proof >> 8),
                        self.left.eq(self.left - 1),
                    ]
                    with m.If(self.left == 0):
                        m.d.sync += self.stage.eq(closing)
                with m.Default():
                    m.d.sync += self.stage.eq(idle)


def _checksum(before: Value, byte: Value) -> Value:
    """Give the CRC-32 after one more byte."""
    bits: Iterable[Value] = (before[k] ^ byte[k] if k < 8 else before[k] for k in range(32))
    value = list(bits)
    for _ in range(8):
        lowest, value = value[0], [*value[1:], Const(0, 1)]
        value = [bit ^ lowest if _POLYNOMIAL >> k & 1 else bit for k, bit in enumerate(value)]
    return Cat(value)
