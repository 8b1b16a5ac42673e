"""The linear interpolator: a digital differential analyser in two to six axes."""

from amaranth import Cat, Module, Signal, Value
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import (
    AXIS_LETTERS,
    ErrorCode,
    Part,
    check_axes,
    check_choice,
    check_flag,
    check_width,
    point_layout,
    register_names,
    step_layout,
)
from discreta.hdl.parts import (
    PRELOADS,
    ControlUnit,
    IncrementRegister,
    Normalizer,
    PositionRegister,
    RemainingCounter,
    Summator,
)
from discreta.hdl.quadrant import QuadrantInput, QuadrantOutput, line_block_layout

__all__ = ["Linear"]


class Linear(Part):
    """Draws a straight line by summation of the increments; the carries are the steps.

    Computes, for every axis, with M = 2^n, Δ = \\|end − start\\|, s the shift of the normalizer (0
    without ``normalize``) and S₀ the preload (0 or M/2), after t summations::

        X(t) = XH ± ⌊(S₀ + t·ΔX·2^s) / M⌋

    Registers: P1, P2 = ΔX·2^s, ΔY·2^s; P3, P4 = coordinates now; P5, P6 = steps left; SX, SY. With
    more than two axes: DX…, XT…, KOX…, SX… with the axis's letter.

    Latency: a block accepted in clock 0 is prepared in clock 0, started in clock 1 and summed from
    clock 2 on; the carry of a summation is a step in the next clock. The last step leaves T + 2
    clocks after the block's acceptance when no step has to wait, T the number of summations, and
    ``done`` follows it by one clock.

    Throughput: one summation a clock. T ≤ M without ``normalize`` (just M with preload 0), T ≤ M /
    2^s = 2^bitlen(max Δ) with it: between 1 and 2 clocks a step of the longest axis. The next block
    is prepared while this one runs and is started in the very clock in which the last step is
    taken: no clock is lost between that and its first summation. A block of no length and a
    rejected block take one clock, and one more behind a block that moved.

    Steps: ``steps`` holds a step until it is taken and the summators wait for it. ``position``
    shows the steps taken, not the one that waits; starting a block loads it with the block's start.

    Reset: everything 0, nothing pending, position at the origin.

    Overflow: ``error`` is ``RANGE`` for one clock, in place of ``done``, for a block with an axis
    longer than 2^n − 1 steps; nothing moves and the next block runs as ever.

    Error bound: the points are off the line by less than 1 step with preload 0 and by at most √½
    step with preload M/2; in a axes by less than √(a − 1) and at most √a / 2. The end point is
    exact.

    Source: lecture, linear interpolation; exercise 3, sections II and III and its program.

    Parameters
    ----------
    width : int
        n, 4 to 32. Coordinates are signed, n + 1 bits; steps are 1 long.
    axes : int
        2 to 6.
    normalize : bool
        Shift the increments left together before the first summation.
    preload : str
        What the summators start from: ``"zero"`` or ``"half"`` (of M).

    Attributes
    ----------
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

    notation = "n = width, M = 2^n"

    def __init__(
        self, width: int = 16, axes: int = 2, *, normalize: bool = True, preload: str = "half"
    ):
        check_width(width)
        check_axes(axes)
        check_choice("preload", preload, PRELOADS)
        check_flag("normalize", normalize)
        point = point_layout(width, axes)
        super().__init__(
            {
                "blocks": In(stream.Signature(line_block_layout(width, axes))),
                "steps": Out(stream.Signature(step_layout(axes))),
                "position": Out(point),
                "busy": Out(1),
                "done": Out(1),
                "error": Out(ErrorCode),
            }
        )
        self.width = width
        self.axes = axes
        self.normalize = normalize
        self.preload = preload
        self.parameters: dict[str, object] = {
            "width": width,
            "axes": axes,
            "normalize": normalize,
            "preload": preload,
        }

        self.names = register_names(axes)
        self.input = QuadrantInput(width, axes)
        self.uu = ControlUnit()
        self.output = QuadrantOutput(axes)
        self.increment: dict[str, IncrementRegister] = {}
        self.place: dict[str, PositionRegister] = {}
        self.remaining: dict[str, RemainingCounter] = {}
        self.summator: dict[str, Summator] = {}
        for a, names in self.names.items():
            self.increment[a] = IncrementRegister(width, name=names.increment)
            self.place[a] = PositionRegister(width, name=names.position)
            self.remaining[a] = RemainingCounter(width, name=names.remaining)
            self.summator[a] = Summator(width, preload=preload, name=names.summator)

        inp, out, uu = self.input, self.output, self.uu
        groups = {
            "P1, P2 increments": [part.register for part in self.increment.values()],
            "SX, SY summators": [part.register for part in self.summator.values()],
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
        scaled = inp.delta
        if self.normalize:
            m.submodules.normalizer = normalizer = Normalizer(self.width, self.axes)
            m.d.comb += normalizer.increments.eq(inp.delta)
            scaled = normalizer.normalized

        ending = Signal(self.axes)
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
            out.taken.eq(uu.taken),
            self.steps.valid.eq(out.waiting),
            self.steps.payload.last.eq(uu.last),
            self.busy.eq(uu.busy),
            self.done.eq(uu.done),
            self.error.eq(uu.error),
        ]
        for index, a in enumerate(AXIS_LETTERS[: self.axes]):
            names = self.names[a]
            p_increment = m.submodules[f"{names.increment}_register"] = self.increment[a]
            p_position = m.submodules[f"{names.position}_register"] = self.place[a]
            p_remaining = m.submodules[f"{names.remaining}_counter"] = self.remaining[a]
            s = m.submodules[f"{names.summator}_summator"] = self.summator[a]
            m.d.comb += [
                Cat(p_increment.load, p_position.load, p_remaining.load, s.load).eq(
                    uu.load.replicate(4)
                ),
                p_increment.initial.eq(scaled[a]),
                p_position.initial.eq(inp.start[a]),
                p_remaining.initial.eq(inp.delta[a]),
                s.initial.eq(s.preloaded),
                s.addend.eq(p_increment.register),
                s.enable.eq(uu.clock & ~p_remaining.zero),
                p_remaining.count.eq(s.carry),
                out.carry[a].eq(s.carry),
                p_position.up.eq(out.up[a]),
                p_position.down.eq(out.down[a]),
                ending[index].eq(p_remaining.ending),
                self.steps.payload[a].eq(out.step[a]),
                self.position[a].eq(p_position.register),
            ]
        return m
