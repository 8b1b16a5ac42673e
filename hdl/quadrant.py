"""Input and output processing: any signs on a first-quadrant device."""

from amaranth import Cat, Module, Mux, Signal
from amaranth.hdl import signed
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import (
    AXIS_LETTERS,
    ErrorCode,
    Part,
    check_axes,
    check_width,
    per_axis,
    point_layout,
)

__all__ = ["QuadrantInput", "QuadrantOutput", "line_block_layout"]


def line_block_layout(width: int, axes: int) -> data.StructLayout:
    """Lay out a line block: ``start`` (XH, YH) and ``end`` (XK, YK), two points in steps."""
    point = point_layout(width, axes)
    return data.StructLayout({"start": point, "end": point})


class QuadrantInput(Part):
    """Prepares a block for the first-quadrant device while the block before it still runs.

    Keeps ``start`` and works out, for every axis, ``delta`` = \\|end − start\\| and ``negative``
    (end < start): as seen by the device every block runs into the first quadrant. ``fault`` is
    ``RANGE`` when a delta does not fit n bits. Both differences are subtracted at once and the one
    that is not negative is chosen, so a single carry chain lies between the registers. ``empty`` is
    1 when every delta is 0 (with a fault it says nothing).

    Latency: a block accepted in one clock is ``pending`` in the next. Throughput: one block a clock
    while ``idle``; otherwise one block ahead of the running one. ``take`` gives the prepared block
    away, and must be given whenever ``idle`` meets ``pending``: the next block may come then.
    Reset: nothing pending. Overflow: reported by ``fault``. Error: none, it is exact.
    Source: lecture, circular interpolation ("all other cases are brought to this one by suitable
    processing of the input and the output data") and step 2 (DX = XK − XH, KOX = DX).

    Parameters
    ----------
    width : int
        n, 4 to 32; coordinates are signed, n + 1 bits; deltas are unsigned, n bits; in steps.
    axes : int
        2 to 6.

    Raises
    ------
    TypeError, ValueError
        A parameter is out of range.
    """

    def __init__(self, width: int, axes: int):
        check_width(width)
        check_axes(axes)
        super().__init__(
            {
                "blocks": In(stream.Signature(line_block_layout(width, axes))),
                "idle": In(1),
                "take": In(1),
                "pending": Out(1),
                "fault": Out(ErrorCode),
                "start": Out(point_layout(width, axes)),
                "delta": Out(per_axis(axes, width)),
                "negative": Out(per_axis(axes, 1)),
                "empty": Out(1),
            }
        )
        self.width = width
        self.letters = AXIS_LETTERS[:axes]
        self.pending_register = Signal(name="pending")
        self.fault_register = Signal(ErrorCode, name="fault")
        self.start_registers = {
            a: Signal(signed(width + 1), name=f"start_{a}") for a in self.letters
        }
        self.delta_registers = {a: Signal(width, name=f"delta_{a}") for a in self.letters}
        self.negative_registers = {a: Signal(name=f"negative_{a}") for a in self.letters}

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        block = self.blocks.payload
        too_far = Signal(len(self.letters))
        m.d.comb += [
            self.blocks.ready.eq(~self.pending | self.idle),
            self.pending.eq(self.pending_register),
            self.fault.eq(self.fault_register),
            self.empty.eq(Cat(self.delta_registers.values()) == 0),
        ]
        with m.If(self.take):
            m.d.sync += self.pending_register.eq(0)
        with m.If(self.blocks.valid & self.blocks.ready):
            m.d.sync += [
                self.pending_register.eq(1),
                self.fault_register.eq(Mux(too_far.any(), ErrorCode.RANGE, ErrorCode.NONE)),
            ]
        for index, a in enumerate(self.letters):
            forward = Signal(signed(self.width + 2), name=f"forward_{a}")
            backward = Signal(signed(self.width + 2), name=f"backward_{a}")
            distance = Signal(self.width + 1, name=f"distance_{a}")
            m.d.comb += [
                forward.eq(block.end[a] - block.start[a]),
                backward.eq(block.start[a] - block.end[a]),
                distance.eq(Mux(forward < 0, backward, forward)),
                too_far[index].eq(distance[-1]),
                self.start[a].eq(self.start_registers[a]),
                self.delta[a].eq(self.delta_registers[a]),
                self.negative[a].eq(self.negative_registers[a]),
            ]
            with m.If(self.blocks.valid & self.blocks.ready):
                m.d.sync += [
                    self.start_registers[a].eq(block.start[a]),
                    self.delta_registers[a].eq(distance),
                    self.negative_registers[a].eq(forward < 0),
                ]
        return m


class QuadrantOutput(Part):
    """Gives the pulses of the first-quadrant device their direction and holds them until taken.

    In a clock with ``clock`` the carries become the waiting step; without, a ``taken`` step is
    forgotten. ``step`` is −1, 0 or +1 for every axis; ``up`` and ``down`` count the position when
    the step is taken.

    Latency: a carry is a waiting step one clock later. Throughput: a step a clock.
    Reset: no step waits. Overflow: none; the control unit gives no ``clock`` while a step waits
    that is not taken. Error: none.
    Source: lecture, circular interpolation (processing of the output data).

    Parameters
    ----------
    axes : int
        2 to 6.

    Raises
    ------
    TypeError, ValueError
        ``axes`` is out of range.
    """

    def __init__(self, axes: int):
        check_axes(axes)
        flags = per_axis(axes, 1)
        super().__init__(
            {
                "load": In(1),
                "negative": In(flags),
                "clock": In(1),
                "carry": In(flags),
                "taken": In(1),
                "waiting": Out(1),
                "step": Out(per_axis(axes, signed(2))),
                "up": Out(flags),
                "down": Out(flags),
            }
        )
        self.letters = AXIS_LETTERS[:axes]
        self.pulse_registers = {a: Signal(name=f"pulse_{a}") for a in self.letters}
        self.direction_registers = {a: Signal(name=f"direction_{a}") for a in self.letters}

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        waiting = 0
        for a in self.letters:
            pulse, direction = self.pulse_registers[a], self.direction_registers[a]
            waiting |= pulse
            m.d.comb += [
                self.step[a][0].eq(pulse),
                self.step[a][1].eq(pulse & direction),
                self.up[a].eq(self.taken & pulse & ~direction),
                self.down[a].eq(self.taken & pulse & direction),
            ]
            with m.If(self.load):
                m.d.sync += direction.eq(self.negative[a])
            with m.If(self.clock):
                m.d.sync += pulse.eq(self.carry[a])
            with m.Elif(self.taken):
                m.d.sync += pulse.eq(0)
        m.d.comb += self.waiting.eq(waiting)
        return m
