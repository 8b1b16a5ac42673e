"""The comparison line: two summators are compared, and one axis steps a clock."""

from typing import ClassVar

from amaranth import Cat, Module, Mux, Signal, Value
from amaranth.hdl import signed
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import (
    ErrorCode,
    Part,
    check_choice,
    check_width,
    point_layout,
    register_names,
    step_layout,
)
from discreta.hdl.parts import ControlUnit, IncrementRegister, PositionRegister, RemainingCounter
from discreta.hdl.quadrant import QuadrantInput, QuadrantOutput, line_block_layout

__all__ = ["FIRSTS", "FORMS", "Comparison"]

FORMS = ("signed", "two")
FIRSTS = ("x", "y")


class Comparison(Part):
    """Draws a straight line in the plane by the comparison of two sums; one axis steps a clock.

    Computes, with ΔX, ΔY = \\|end − start\\| and both sums 0 at the start of a block: the axis with
    the smaller sum steps, of equal sums the longer axis, of equally long ones the axis ``first``; a
    step of x adds ΔY to Sx, a step of y adds ΔX to Sy. So Sx = x·ΔY and Sy = y·ΔX after x and y
    steps, and both end at ΔX·ΔY. With ``form`` signed only the difference S = Sx − Sy is kept: a
    step of x adds ΔY, one of y takes ΔX off, and S is compared with 0.

    Registers: P1, P2 = ΔX, ΔY; P3, P4 = coordinates now; P5, P6 = steps left; SX, SY, or S.

    Latency: a block accepted in clock 0 is prepared in clock 0, started in clock 1 and summed from
    clock 2 on; every summation is a step in the next clock. The last step leaves ΔX + ΔY + 2
    clocks after the block's acceptance when no step has to wait, and ``done`` follows it by one
    clock.

    Throughput: one summation a clock, and every one is a step of one axis: as many clocks as
    steps, 1 to 2 a step of the longer axis. The next block is prepared while this one runs and is
    started in the very clock in which the last step is taken: no clock is lost between that and its
    first summation. A block of no length and a rejected block take one clock, and one more behind a
    block that moved.

    Steps: ``steps`` holds a step until it is taken and the summators wait for it. ``position``
    shows the steps taken, not the one that waits; starting a block loads it with the block's start.

    Reset: everything 0, nothing pending, position at the origin.

    Overflow: ``error`` is ``RANGE`` for one clock, in place of ``done``, for a block with an axis
    longer than 2^n − 1 steps; nothing moves and the next block runs as ever. The sums do not
    overflow: SX, SY ≤ ΔX·ΔY < 2^2n, and −ΔX ≤ S ≤ ΔY, since x steps only from S ≤ 0 and y only from
    S ≥ 0.

    Error bound: the points are off the line by less than 1 step; at 45° by √½ step, always on the
    side of ``first``, or not at all. The end point is exact.

    Source: article on linear interpolation (part one); ``first`` y is its arbitrary choice at 45°.
    Signs and handshakes are as in the other methods.

    Parameters
    ----------
    width : int
        n, 4 to 32. Coordinates are signed, n + 1 bits; steps are 1 long.
    form : str
        ``"two"``: summators SX and SY of 2n bits; ``"signed"``: one summator S, signed, n + 1 bits.
    first : str
        The axis that steps first at 45°: ``"x"`` or ``"y"``.

    Attributes
    ----------
    LECTURE : dict of str to str
        The parameters of the article's own table.
    parameters : dict of str to object
        The parameters it was made with.
    diagram : dict of str to list of Signal
        Every register there is, grouped as in the block diagram, by the group's title.
    registers : dict of str to Signal
        The same registers, by their names in waveforms.

    Raises
    ------
    TypeError, ValueError
        A parameter is not one of the above.
    """

    LECTURE: ClassVar[dict[str, str]] = {"form": "two", "first": "x"}

    notation = "n = width"

    def __init__(self, width: int = 16, *, form: str = "signed", first: str = "x"):
        check_width(width)
        check_choice("form", form, FORMS)
        check_choice("first", first, FIRSTS)
        super().__init__(
            {
                "blocks": In(stream.Signature(line_block_layout(width, 2))),
                "steps": Out(stream.Signature(step_layout(2))),
                "position": Out(point_layout(width, 2)),
                "busy": Out(1),
                "done": Out(1),
                "error": Out(ErrorCode),
            }
        )
        self.width = width
        self.form = form
        self.first = first
        self.parameters: dict[str, object] = {"width": width, "form": form, "first": first}

        self.names = register_names(2)
        self.input = QuadrantInput(width, 2)
        self.uu = ControlUnit()
        self.output = QuadrantOutput(2)
        self.increment: dict[str, IncrementRegister] = {}
        self.place: dict[str, PositionRegister] = {}
        self.remaining: dict[str, RemainingCounter] = {}
        for a, names in self.names.items():
            self.increment[a] = IncrementRegister(width, name=names.increment)
            self.place[a] = PositionRegister(width, name=names.position)
            self.remaining[a] = RemainingCounter(width, name=names.remaining)
        if form == "two":
            sums = [Signal(2 * width, name=names.summator) for names in self.names.values()]
        else:
            sums = [Signal(signed(width + 1), name="s")]
        self.sums: dict[str, Signal] = {register.name: register for register in sums}
        #: The axis that steps at the next summation: 1 for x, 0 for y.
        self.turn = Signal(name="turn")

        inp, out, uu = self.input, self.output, self.uu
        groups = {
            "P1, P2 increments": [part.register for part in self.increment.values()],
            "SX, SY summators" if form == "two" else "S summator": sums,
            "P5, P6 steps left": [part.register for part in self.remaining.values()],
            "P3, P4 position": [part.register for part in self.place.values()],
            "УУ": [uu.running, uu.done_register, uu.error_register],
            "step that waits": [*out.pulse_registers.values(), *out.direction_registers.values()],
            "prepared block": [
                inp.pending_register,
                inp.fault_register,
                *inp.start_registers.values(),
                *inp.delta_registers.values(),
                *inp.negative_registers.values(),
            ],
        }
        self.diagram: dict[str, list[Signal]] = {
            title: [Value.cast(register) for register in group] for title, group in groups.items()
        }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        inp, out, uu = self.input, self.output, self.uu
        m.submodules.input = inp
        m.submodules.uu = uu
        m.submodules.output = out
        ending = Signal(2)
        m.d.comb += [
            inp.blocks.payload.eq(self.blocks.payload),
            inp.blocks.valid.eq(self.blocks.valid),
            self.blocks.ready.eq(inp.blocks.ready),
            inp.idle.eq(uu.idle),
            inp.take.eq(uu.start),
            uu.pending.eq(inp.pending),
            uu.fault.eq(inp.fault),
            uu.empty.eq(inp.empty),
            uu.waiting.eq(out.waiting),
            uu.ready.eq(self.steps.ready),
            uu.ending.eq(ending.all()),
            out.load.eq(uu.load),
            out.negative.eq(inp.negative),
            out.clock.eq(uu.clock),
            out.carry.x.eq(uu.clock & self.turn),
            out.carry.y.eq(uu.clock & ~self.turn),
            out.taken.eq(uu.taken),
            self.steps.valid.eq(out.waiting),
            self.steps.payload.last.eq(uu.last),
            self.busy.eq(uu.busy),
            self.done.eq(uu.done),
            self.error.eq(uu.error),
        ]
        for index, (a, names) in enumerate(self.names.items()):
            p_increment = m.submodules[f"{names.increment}_register"] = self.increment[a]
            p_position = m.submodules[f"{names.position}_register"] = self.place[a]
            p_remaining = m.submodules[f"{names.remaining}_counter"] = self.remaining[a]
            m.d.comb += [
                Cat(p_increment.load, p_position.load, p_remaining.load).eq(uu.load.replicate(3)),
                p_increment.initial.eq(inp.delta[a]),
                p_position.initial.eq(inp.start[a]),
                p_remaining.initial.eq(inp.delta[a]),
                p_remaining.count.eq(out.carry[a]),
                p_position.up.eq(out.up[a]),
                p_position.down.eq(out.down[a]),
                ending[index].eq(p_remaining.ending),
                self.steps.payload[a].eq(out.step[a]),
                self.position[a].eq(p_position.register),
            ]
        self._compare(m)
        return m

    def _compare(self, m: Module) -> None:
        """Compare the sums, and add to the one whose axis steps."""
        dx, dy = (self.increment[a].register for a in "xy")
        # Beside the comparison of the sums, not behind it.
        x_leads = Signal()
        m.d.comb += x_leads.eq(dx >= dy if self.first == "x" else dx > dy)
        if self.form == "two":
            sx, sy = self.sums.values()
            m.d.comb += self.turn.eq((sx < sy) | ((sx == sy) & x_leads))
            with m.If(self.uu.load):
                m.d.sync += [sx.eq(0), sy.eq(0)]
            with m.Elif(self.uu.clock):
                with m.If(self.turn):
                    m.d.sync += sx.eq(sx + dy)
                with m.Else():
                    m.d.sync += sy.eq(sy + dx)
        else:
            (s,) = self.sums.values()
            m.d.comb += self.turn.eq((s < 0) | ((s == 0) & x_leads))
            with m.If(self.uu.load):
                m.d.sync += s.eq(0)
            with m.Elif(self.uu.clock):
                # Both are worked out at once: a single carry chain lies between the registers.
                m.d.sync += s.eq(Mux(self.turn, s + dy, s - dx))
