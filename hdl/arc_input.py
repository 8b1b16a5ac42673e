"""Input processing for arcs: any centre, any quadrant, both directions, any number of turns."""

from amaranth import Cat, Const, Module, Mux, Signal
from amaranth.hdl import signed
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import ErrorCode, Part, check_width, per_axis, point_layout
from discreta.hdl.parts import RadiusMeter

__all__ = ["FULL_TURNS_BITS", "TURNS_BITS", "ArcInput", "arc_block_layout"]

#: Bits of ``full_turns``, and of the axis crossings that these and the arc itself can make.
FULL_TURNS_BITS, TURNS_BITS = 8, 11


def arc_block_layout(width: int) -> data.StructLayout:
    """Lay out an arc block: three points in steps, the direction, and whole turns before the arc.

    ``start`` (XH, YH), ``end`` (XK, YK) and ``center``; ``clockwise``; ``full_turns``, 0 to 255.
    """
    point = point_layout(width, 2)
    return data.StructLayout(
        {
            "start": point,
            "end": point,
            "center": point,
            "clockwise": 1,
            "full_turns": FULL_TURNS_BITS,
        }
    )


class ArcInput(Part):
    """Prepares an arc for the first-quadrant device while the block before it still runs.

    Every arc is brought to one that begins in quadrant I and runs counter-clockwise there, X
    falling and Y rising: a clockwise arc is mirrored along y, and the quadrant of the start is
    turned onto the first. Seen so from the centre,

    - ``from_xy`` is the start and ``to_xy`` the end, each in its own quadrant turned onto the
      first;
    - ``first_swap`` is 1 when X is the machine's y, that is when the start is in quadrant II or IV;
    - ``negative`` is the direction in which each of the machine's axes moves first;
    - ``first_turns`` is the number of axis crossings between start and end;
    - ``limit`` = ⌊R⌋ + 1 is as far as an arc that crosses an axis may go along it.

    A start on an axis belongs to the quadrant after it, an end on an axis to the one before it, as
    the arc runs. In one quadrant the end lies ahead when XK ≤ XH and YK ≥ YH and they differ; else
    the arc goes once round. So start = end is a full turn. (An end off the circle by at most one
    step is never ahead on one axis and behind on the other: both lead outwards, or both inwards,
    and together by more than a step.)

    ``fault`` is ``RANGE`` when a coordinate seen from the centre does not fit n bits, or when the
    arc crosses an axis and ``limit`` does not fit n bits or leads, from the centre, out of the
    coordinates −2^n … 2^n − 1 at one of the crossings. Otherwise it is ``OFF_CURVE`` when the end
    is more than one step off the circle of the start, or the start is the centre and the end is
    not. ``empty``: start, end and centre are one point (with a fault it says nothing).

    Latency: a block accepted in clock 0 is ``pending`` in clock 2n + 5. Throughput: a block in 2n +
    6 clocks, one block ahead of the running one; ``held`` from the clock after its acceptance until
    ``take`` gives it away. Reset: nothing held. Overflow: reported by ``fault``. Error: none, it is
    exact.
    Source: lecture, circular interpolation (the centre is the origin, only the first quadrant,
    "all other cases are brought to this one by suitable processing of the input and the output
    data"); the rest is ours.

    Parameters
    ----------
    width : int
        n, 4 to 32; coordinates are signed, n + 1 bits; seen from the centre magnitudes of n bits;
        in steps.

    Raises
    ------
    TypeError, ValueError
        ``width`` is not a whole number from 4 to 32.
    """

    def __init__(self, width: int):
        check_width(width)
        seen = per_axis(2, width)
        super().__init__(
            {
                "blocks": In(stream.Signature(arc_block_layout(width))),
                "take": In(1),
                "held": Out(1),
                "pending": Out(1),
                "fault": Out(ErrorCode),
                "empty": Out(1),
                "start": Out(point_layout(width, 2)),
                "from_xy": Out(seen),
                "to_xy": Out(seen),
                "first_swap": Out(1),
                "negative": Out(per_axis(2, 1)),
                "first_turns": Out(TURNS_BITS),
                "limit": Out(width),
            }
        )
        self.width = width
        self.meter = RadiusMeter(width)
        self.held_register = Signal(name="held")
        self.fault_register = Signal(ErrorCode, name="fault")
        self.empty_register = Signal(name="empty")
        self.start_registers = {a: Signal(signed(width + 1), name=f"start_{a}") for a in "xy"}
        self.center_registers = {a: Signal(signed(width + 1), name=f"center_{a}") for a in "xy"}
        self.swap_register = Signal(name="first_swap")
        self.negative_registers = {a: Signal(name=f"negative_{a}") for a in "xy"}
        self.turns_register = Signal(TURNS_BITS, name="first_turns")

    def elaborate(self, platform):
        """Describe the hardware."""
        n = self.width
        m = Module()
        m.submodules.meter = meter = self.meter
        block = self.blocks.payload
        accept = Signal()
        m.d.comb += [
            self.blocks.ready.eq(~self.held),
            accept.eq(self.blocks.valid & self.blocks.ready),
            self.held.eq(self.held_register),
            self.pending.eq(self.held & ~meter.busy),
            self.fault.eq(self.fault_register),
            self.empty.eq(self.empty_register),
            self.first_swap.eq(self.swap_register),
            self.first_turns.eq(self.turns_register),
            meter.load.eq(accept),
        ]
        for a in "xy":
            m.d.comb += [
                self.start[a].eq(self.start_registers[a]),
                self.from_xy[a].eq(meter.start[a]),
                self.to_xy[a].eq(meter.end[a]),
                self.negative[a].eq(self.negative_registers[a]),
            ]

        begin = _Seen(m, "begin", block.start, block.center, block.clockwise, n)
        finish = _Seen(m, "finish", block.end, block.center, block.clockwise, n)
        first, last = Signal(2, name="first"), Signal(2, name="last")
        with m.If(begin.right & ~begin.below):
            m.d.comb += first.eq(0)
        with m.Elif(~begin.right & begin.above):
            m.d.comb += first.eq(1)
        with m.Elif(begin.left):
            m.d.comb += first.eq(2)
        with m.Else():
            m.d.comb += first.eq(3)
        with m.If(finish.right & ~finish.above):
            m.d.comb += last.eq(3)
        with m.Elif(~finish.right & finish.below):
            m.d.comb += last.eq(2)
        with m.Elif(finish.left):
            m.d.comb += last.eq(1)
        with m.Else():
            m.d.comb += last.eq(0)
        crossings = Signal(2)
        m.d.comb += [
            crossings.eq(last - first),
            meter.initial_start.x.eq(Mux(first[0], begin.far["y"], begin.far["x"])),
            meter.initial_start.y.eq(Mux(first[0], begin.far["x"], begin.far["y"])),
            meter.initial_end.x.eq(Mux(last[0], finish.far["y"], finish.far["x"])),
            meter.initial_end.y.eq(Mux(last[0], finish.far["x"], finish.far["y"])),
        ]

        same_quadrant, ahead, too_far = (
            Signal(name=name) for name in ("same_quadrant", "ahead", "too_far")
        )
        m.d.comb += [
            same_quadrant.eq(self.first_turns[:2] == 0),
            ahead.eq(
                (meter.end.x <= meter.start.x)
                & (meter.end.y >= meter.start.y)
                & (meter.end != meter.start)
            ),
            # A block of no length crosses nothing, though its quadrants are not the same.
            too_far.eq((self.first_turns != 0) & ~meter.zero & self._too_far(m)),
        ]
        with m.If(self.take):
            m.d.sync += self.held_register.eq(0)
        with m.If(accept):
            m.d.sync += [
                self.held_register.eq(1),
                self.fault_register.eq(
                    Mux(begin.too_far | finish.too_far, ErrorCode.RANGE, ErrorCode.NONE)
                ),
                self.empty_register.eq(0),
                self.swap_register.eq(first[0]),
                self.negative_registers["x"].eq(~first[1]),
                self.negative_registers["y"].eq(first[0] ^ first[1] ^ block.clockwise),
                self.turns_register.eq(Cat(crossings, block.full_turns)),
                *[self.start_registers[a].eq(block.start[a]) for a in "xy"],
                *[self.center_registers[a].eq(block.center[a]) for a in "xy"],
            ]
        with m.Elif(meter.squared & same_quadrant & ~ahead):
            m.d.sync += self.turns_register.eq(self.first_turns + 4)
        with m.Elif(meter.measured):
            m.d.sync += self.empty_register.eq(meter.zero)
            with m.If(too_far):
                m.d.sync += self.fault_register.eq(ErrorCode.RANGE)
            with m.Elif((self.fault == ErrorCode.NONE) & ~meter.near & ~meter.zero):
                m.d.sync += self.fault_register.eq(ErrorCode.OFF_CURVE)
        return m

    def _too_far(self, m: Module) -> Signal:
        """Tell whether an arc that crosses axes does not fit."""
        n = self.width
        limit = Signal(n + 2, name="reach")
        m.d.comb += [limit.eq(self.meter.root[1:] + 1), self.limit.eq(limit)]
        out = Signal(4)
        for index, a in enumerate("xy"):
            # Steps between the centre and the lowest coordinate; to the highest it is the rest.
            below = Cat(self.center_registers[a][:-1], ~self.center_registers[a][-1])
            first = Signal(2, name=f"crossed_{a}")
            # The axis that rises is crossed first, the other next, then both the other way.
            rises = self.first_swap if a == "x" else ~self.first_swap
            m.d.comb += first.eq(Mux(rises, 0, 1))
            for again in range(2):
                negative = self.negative[a] ^ again
                room = Mux(negative, below, ~below)
                crossed = self.first_turns > first + 2 * again
                m.d.comb += out[2 * index + again].eq(crossed & (limit > room))
        return out.any() | (limit > Const((1 << n) - 1, n))


class _Seen:
    """A point seen from the centre, mirrored along y when the arc runs clockwise.

    Both differences are subtracted at once and the one that is not negative is chosen, so a single
    carry chain lies between the registers.
    """

    def __init__(self, m: Module, name: str, point, center, clockwise, n: int):
        self.far: dict[str, Signal] = {}
        too_far = Signal(2, name=f"{name}_too_far")
        side: dict[str, tuple[Signal, Signal]] = {}
        for index, a in enumerate("xy"):
            outward = Signal(signed(n + 2), name=f"{name}_outward_{a}")
            inward = Signal(signed(n + 2), name=f"{name}_inward_{a}")
            distance = Signal(n + 1, name=f"{name}_distance_{a}")
            low = Signal(name=f"{name}_low_{a}")
            high = Signal(name=f"{name}_high_{a}")
            m.d.comb += [
                outward.eq(point[a] - center[a]),
                inward.eq(center[a] - point[a]),
                low.eq(outward < 0),
                high.eq(inward < 0),
                distance.eq(Mux(low, inward, outward)),
                too_far[index].eq(distance[n]),
            ]
            self.far[a] = distance[:n]
            side[a] = low, high
        self.too_far = too_far.any()
        self.left, self.right = side["x"]
        low, high = side["y"]
        self.below, self.above = Mux(clockwise, high, low), Mux(clockwise, low, high)
