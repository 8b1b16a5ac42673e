"""The block queue: blocks of any kind, one behind the other, through the right interpolator."""

from collections.abc import Collection, Mapping
from typing import Any

from amaranth import Cat, Module, Mux, ResetInserter, Signal
from amaranth.hdl import Value, signed
from amaranth.lib import data, enum, stream
from amaranth.lib.fifo import SyncFIFOBuffered
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import (
    AXIS_LETTERS,
    ErrorCode,
    Part,
    check_axes,
    check_width,
    per_axis,
    point_layout,
    step_layout,
)
from discreta.hdl.feed import AHEAD_BITS, feed_layout

__all__ = [
    "KINDS",
    "MAX_DEPTH",
    "BlockKind",
    "BlockQueue",
    "StopReason",
    "check_depth",
    "device_block_layout",
]

#: Blocks that a queue holds at most.
MAX_DEPTH = 4096


class BlockKind(enum.Enum, shape=2):  # pyright: ignore[reportGeneralTypeIssues, reportCallIssue]
    """What a block is."""

    #: A straight line to ``end``.
    LINE = 0
    #: An arc to ``end`` around ``center``.
    ARC = 1
    #: A curve of the second order to ``end``.
    CONIC = 2
    #: No motion: from here on the machine is said to stand at ``end``.
    PLACE = 3


#: The kinds that move, by the names of their interpolators.
KINDS: dict[str, Any] = {"line": BlockKind.LINE, "arc": BlockKind.ARC, "conic": BlockKind.CONIC}


class StopReason(enum.Enum, shape=3):  # pyright: ignore[reportGeneralTypeIssues, reportCallIssue]
    """Why a device stands still and takes no blocks."""

    #: It does not.
    NONE = 0
    #: It was told to stop.
    STOP = 1
    #: The emergency stop.
    EMERGENCY = 2
    #: The next step leads towards an active limit switch.
    LIMIT = 3
    #: A block was refused: with :class:`~discreta.hdl.contract.ErrorCode` ``RANGE``.
    RANGE = 4
    #: A block was refused: ``OFF_CURVE``.
    OFF_CURVE = 5
    #: A block was refused: ``SHARP``.
    SHARP = 6
    #: A block was refused: the device has no interpolator for its kind.
    KIND = 7


#: Refusals by an interpolator begin here: the reason is its error code and so much.
_REFUSED = 3


def device_block_layout(
    width: int, axes: int, layouts: Mapping[str, data.StructLayout]
) -> data.StructLayout:
    """Lay out a block of a device: its kind, speed and path ahead, and all that its kinds need.

    ``end`` is where it leads; it starts where the block before it ends. ``ahead``: steps of path
    from its start to the end of the chain of blocks. The other fields are those of the kinds' own
    blocks, ``layouts`` by kind; what a block's kind has no use for is left alone.
    """
    fields: dict[str, object] = {
        "kind": BlockKind,
        "feed": feed_layout(),
        "ahead": AHEAD_BITS,
        "end": point_layout(width, axes),
    }
    for layout in layouts.values():
        own = layout.members
        fields |= {name: shape for name, shape in own.items() if name not in ("start", "end")}
    return data.StructLayout(fields)


class BlockQueue(Part):
    """Hands blocks to their interpolators one ahead, and lets their steps leave in order.

    A block waits at the head of the queue until the one before the last is done with. Then it is
    handed to the interpolator of its kind (``<kind>_blocks``), and is ``next``: it starts at the
    end of the block handed over before it. It prepares itself, and if it is of another kind than
    the block that runs, it goes on until its first step waits. When the ``current`` block ends,
    ``next`` becomes it (``begins``, with its ``ahead``), and from the next clock on its steps pass
    to ``steps``, under ``permit``.

    A block ends in the clock in which its ``last`` step is taken, or with its interpolator's answer
    when it has none (no length; a curve that ends without a step). ``done`` follows by a clock, in
    order. A block that is refused, and one of a kind that there is no interpolator for, gives its
    reason at ``refusal`` when its turn has come, for that one clock, and nothing runs behind it:
    whoever reads that holds ``flush``.

    ``PLACE``: when all before it is done and ``quiet`` (no pulse is under way), ``placing`` is 1
    for a clock, in which the machine takes ``place`` for its position. ``done`` follows.

    ``flush`` empties everything, and the next block starts at ``position``, where the machine is.
    No block is accepted or handed over meanwhile, and no step passes.

    Latency: a block accepted in clock 0 is at the head in clock 1 (``depth`` 1) or 2, ``next`` one
    later, ``current`` again one later if nothing runs.

    Throughput: no clock is lost between blocks whose running takes as long as the preparation of
    the next one: of another kind, from hand-over to first step; of the same kind, what its
    interpolator says of blocks prepared ahead, and three clocks.

    Reset: empty, the first block starts at the origin. Overflow: ``blocks`` are not ready when it
    is full. Errors: refusals are passed on.
    Source: exercise 3, extra tasks 1 and 3. Mixed kinds are ours.

    Parameters
    ----------
    width : int
        n of all interpolators.
    axes : int
        2 to 6.
    layouts : dict of str to StructLayout
        How the blocks of every interpolator are laid out that there is, by its kind: ``"line"``,
        ``"arc"``, ``"conic"``.
    depth : int
        Blocks that wait, 1 to 4096, those handed over aside.
    steady : collection of str
        The kinds whose steps come in ticks of equal length: ``even`` is 1 while one of them runs.

    Attributes
    ----------
    diagram : dict of str to list of Signal
        Every register there is but those of the waiting blocks beyond one, by the group's title.
    registers : dict of str to Signal
        The same registers, by their names in waveforms.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """

    def __init__(
        self,
        width: int,
        axes: int,
        layouts: Mapping[str, data.StructLayout],
        depth: int = 16,
        *,
        steady: Collection[str] = (),
    ):
        check_width(width)
        check_axes(axes)
        kinds = tuple(layouts)
        _check_kinds(kinds)
        check_depth(depth)
        self.letters = AXIS_LETTERS[:axes]
        point = point_layout(width, axes)
        layout = device_block_layout(width, axes, layouts)
        members = {"blocks": In(stream.Signature(layout))}
        for kind in kinds:
            members |= {
                f"{kind}_blocks": Out(stream.Signature(layouts[kind])),
                f"{kind}_steps": In(stream.Signature(step_layout(axes))),
                f"{kind}_done": In(1),
                f"{kind}_error": In(ErrorCode),
            }
        super().__init__(
            {
                **members,
                "flush": In(1),
                "quiet": In(1),
                "permit": In(1),
                "position": In(point),
                "steps": Out(stream.Signature(per_axis(axes, signed(2)))),
                "active": Out(1),
                "begins": Out(1),
                "even": Out(1),
                "feed": Out(feed_layout()),
                "ahead": Out(AHEAD_BITS),
                "taken": Out(1),
                "placing": Out(1),
                "place": Out(point),
                "busy": Out(1),
                "done": Out(1),
                "refusal": Out(StopReason),
            }
        )
        self.width = width
        self.axes = axes
        self.kinds = kinds
        self.steady = tuple(kind for kind in kinds if kind in steady)
        self.depth = depth
        self.layout = layout

        self.held = Signal(name="head")
        self.head = {
            path: Signal(shape, name=f"head_{'_'.join(path)}") for path, shape in _leaves(layout)
        }
        self.place_registers = {
            a: Signal(signed(width + 1), name=f"place_{a}") for a in self.letters
        }
        self.slots = {name: self._slot(name) for name in ("next", "current")}
        self.next_ahead = Signal(AHEAD_BITS)
        #: The last step of a block was taken one clock ago: its interpolator's answer comes now.
        self.ended = {kind: Signal(name=f"{kind}_ended") for kind in kinds}
        self.done_register = Signal(name="queue_done")
        waiting = [self.held, *map(Value.cast, self.head.values())] if depth == 1 else []
        self.diagram: dict[str, list[Signal]] = {
            "current block": [*self.slots["current"].values()],
            "next block": [*self.slots["next"].values(), self.next_ahead],
            "queue": [
                *waiting,
                *self.place_registers.values(),
                *self.ended.values(),
                self.done_register,
            ],
        }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }

    def _slot(self, name: str) -> dict[str, Signal]:
        """Make the registers of a block that is handed over."""
        feed = {
            f"feed_{field}": Signal(part.shape, name=f"{name}_feed_{field}")
            for field, part in feed_layout()
        }
        return {
            "valid": Signal(name=name),
            "kind": Signal(2, name=f"{name}_kind"),
            "answered": Signal(name=f"{name}_answered"),
            "refusal": Signal(3, name=f"{name}_refusal"),
            **feed,
        }

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        following, current = self.slots["next"], self.slots["current"]
        head = Signal(self.layout)
        waits, goes, filled = Signal(), Signal(), Signal()
        self._wait(m, head, waits, goes, filled)

        # The head of the queue is handed over.
        free, handed, unknown = Signal(), Signal(), Signal()
        start = {a: self.place_registers[a] for a in self.letters}
        m.d.comb += free.eq(waits & ~following["valid"] & ~self.flush)
        accepted = []
        known = []
        for kind in self.kinds:
            offered = getattr(self, f"{kind}_blocks")
            mine = Signal(name=f"head_is_{kind}")
            m.d.comb += [
                mine.eq(head.kind == KINDS[kind]),
                offered.valid.eq(free & mine),
            ]
            for field in offered.payload.shape().members:
                value = start if field == "start" else head[field]
                if field == "start":
                    m.d.comb += [offered.payload.start[a].eq(value[a]) for a in self.letters]
                else:
                    m.d.comb += offered.payload[field].eq(value)
            accepted.append(offered.valid & offered.ready)
            known.append(mine)
        placed = Signal()
        m.d.comb += [
            handed.eq(Cat(accepted).any()),
            placed.eq(head.kind == BlockKind.PLACE),
            unknown.eq(free & ~placed & ~Cat(known).any()),
            self.placing.eq(free & placed & ~current["valid"] & self.quiet),
            goes.eq(handed | unknown | self.placing),
        ]

        # What the interpolators answer belongs to the current block, or to the next one.
        ends, refusal = Signal(), Signal(3)
        passes = Signal()
        m.d.comb += passes.eq(self.permit & ~self.flush)
        next_ends, next_refusal = Signal(), Signal(3)
        m.d.comb += [ends.eq(current["answered"]), refusal.eq(current["refusal"])]
        m.d.comb += [next_ends.eq(following["answered"]), next_refusal.eq(following["refusal"])]
        for kind in self.kinds:
            steps, done, error = (
                getattr(self, f"{kind}_{what}") for what in ("steps", "done", "error")
            )
            running, answer, code = (
                Signal(name=f"{kind}_runs"),
                Signal(name=f"{kind}_answers"),
                Signal(3, name=f"{kind}_refusal"),
            )
            m.d.comb += [
                running.eq(
                    current["valid"] & ~current["answered"] & (current["kind"] == KINDS[kind].value)
                ),
                code.eq(Mux(error == ErrorCode.NONE, 0, error.as_value() + _REFUSED)),
                answer.eq((done & ~self.ended[kind]) | code.any()),
                steps.ready.eq(running & passes & self.steps.ready),
            ]
            m.d.sync += self.ended[kind].eq(running & self.taken & steps.payload.last)
            with m.If(running):
                m.d.comb += [
                    self.steps.valid.eq(steps.valid & passes),
                    ends.eq(answer | (self.taken & steps.payload.last)),
                    refusal.eq(code),
                ]
                m.d.comb += [self.steps.payload[a].eq(steps.payload[a]) for a in self.letters]
            with m.Elif(answer & (following["kind"] == KINDS[kind].value)):
                m.d.comb += [next_ends.eq(1), next_refusal.eq(code)]

        m.d.comb += [
            self.taken.eq(self.steps.valid & self.steps.ready),
            self.active.eq(current["valid"]),
            self.even.eq(Cat(current["kind"] == KINDS[kind].value for kind in self.steady).any()),
            self.feed.mantissa.eq(current["feed_mantissa"]),
            self.feed.exponent.eq(current["feed_exponent"]),
            self.ahead.eq(self.next_ahead),
            self.busy.eq(filled | following["valid"] | current["valid"]),
            self.done.eq(self.done_register),
        ]
        m.d.comb += [self.place[a].eq(head.end[a]) for a in self.letters]
        refused, ended = Signal(), Signal()
        m.d.comb += [
            ended.eq(current["valid"] & ends),
            refused.eq(ended & refusal.any()),
            self.refusal.eq(Mux(refused, refusal, 0)),
            self.begins.eq(following["valid"] & (~current["valid"] | ended) & ~refused),
        ]
        m.d.sync += self.done_register.eq((ended & ~refused) | self.placing)
        with m.If(self.begins):
            m.d.sync += [current[name].eq(following[name]) for name in current]
            m.d.sync += [current["answered"].eq(next_ends), current["refusal"].eq(next_refusal)]
        with m.Elif(ended):
            m.d.sync += current["valid"].eq(0)
        m.d.sync += [following["answered"].eq(next_ends), following["refusal"].eq(next_refusal)]
        with m.If(handed | unknown):
            m.d.sync += [
                following["valid"].eq(1),
                following["kind"].eq(head.kind),
                following["answered"].eq(unknown),
                following["refusal"].eq(Mux(unknown, StopReason.KIND, StopReason.NONE)),
                following["feed_mantissa"].eq(head.feed.mantissa),
                following["feed_exponent"].eq(head.feed.exponent),
                self.next_ahead.eq(head.ahead),
            ]
        with m.Elif(self.begins):
            m.d.sync += following["valid"].eq(0)
        for a, register in self.place_registers.items():
            with m.If(self.flush):
                m.d.sync += register.eq(self.position[a])
            with m.Elif(handed | self.placing):
                m.d.sync += register.eq(head.end[a])
        with m.If(self.flush):
            m.d.sync += [slot["valid"].eq(0) for slot in self.slots.values()]
            m.d.sync += [flag.eq(0) for flag in self.ended.values()]
            m.d.sync += self.done_register.eq(0)
        return m

    def _wait(self, m: Module, head, waits: Signal, goes: Signal, filled: Signal) -> None:
        """Keep the blocks that wait: one in a register, or more in a FIFO."""
        if self.depth == 1:
            m.d.comb += [
                waits.eq(self.held),
                filled.eq(self.held),
                self.blocks.ready.eq(~self.held & ~self.flush),
                *(_leaf(head, path).eq(register) for path, register in self.head.items()),
            ]
            with m.If(self.flush | goes):
                m.d.sync += self.held.eq(0)
            with m.Elif(self.blocks.valid & self.blocks.ready):
                m.d.sync += self.held.eq(1)
                m.d.sync += [
                    register.eq(_leaf(self.blocks.payload, path))
                    for path, register in self.head.items()
                ]
            return
        fifo = SyncFIFOBuffered(width=self.layout.size, depth=self.depth)
        m.submodules.fifo = ResetInserter(self.flush)(fifo)
        m.d.comb += [
            fifo.w_data.eq(self.blocks.payload),
            fifo.w_en.eq(self.blocks.valid & ~self.flush),
            self.blocks.ready.eq(fifo.w_rdy & ~self.flush),
            head.as_value().eq(fifo.r_data),
            waits.eq(fifo.r_rdy),
            filled.eq(fifo.level.any()),
            fifo.r_en.eq(goes),
        ]


def _leaves(layout: data.StructLayout, path: tuple[str, ...] = ()):
    """Yield (path, shape) of every plain field."""
    for name, field in layout:
        if isinstance(field.shape, data.StructLayout):
            yield from _leaves(field.shape, (*path, str(name)))
        else:
            yield (*path, str(name)), field.shape


def _leaf(view, path: tuple[str, ...]):
    """Give the field at a path."""
    for name in path:
        view = view[name]
    return view


def _check_kinds(kinds: tuple[str, ...]) -> None:
    """Raise ``ValueError`` unless these are one or more of the kinds there are."""
    if not kinds or not set(kinds) <= set(KINDS):
        raise ValueError(
            f"kinds are {kinds!r}: choose one or more of {', '.join(map(repr, KINDS))}"
        )


def check_depth(depth: int) -> None:
    """Raise ``TypeError`` or ``ValueError`` unless ``depth`` is a whole number from 1 to 4096."""
    limits = f"a whole number from 1 to {MAX_DEPTH}"
    if not isinstance(depth, int) or isinstance(depth, bool):
        raise TypeError(f"depth must be {limits}, not {depth!r}")
    if not 1 <= depth <= MAX_DEPTH:
        raise ValueError(f"depth is {depth}: choose {limits}")
