"""The speed-setting block (БЗС): the programmed speed as moments at which steps leave."""

from collections.abc import Sequence

from amaranth import Cat, Const, Module, Mux, Signal
from amaranth.hdl import signed
from amaranth.lib import data
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import Part, check_axes, check_flag, per_axis

__all__ = [
    "ACCELERATION_BITS",
    "AHEAD_BITS",
    "FULL_OVERRIDE",
    "MAX_OVERRIDE",
    "OVERRIDE_BITS",
    "PAUSES",
    "RATE_BITS",
    "FeedUnit",
    "feed_layout",
]

#: Pause after a step on 1 to 6 axes, in 1/256 of that after a step on one: their roots.
PAUSES = (256, 362, 443, 512, 572, 627)
_PAUSE_BITS = 10
#: Fraction bits of a pause.
_PAUSE_FRACTION = 8

#: Fraction bits of a speed in steps per clock, and of an acceleration in steps per clock².
RATE_BITS = 48
ACCELERATION_BITS = 40
#: Bits of the path ahead, in steps.
AHEAD_BITS = 28
#: What the override is at 100 % and at most; it is larger only by mistake.
FULL_OVERRIDE, MAX_OVERRIDE = 128, 256
OVERRIDE_BITS = 9

_MANTISSA_BITS, _EXPONENT_BITS = 16, 5
_PRODUCT_BITS = _MANTISSA_BITS + OVERRIDE_BITS
#: Fraction bits of the braking distance.
_BRAKING_FRACTION = 35


def feed_layout() -> data.StructLayout:
    """Lay out a programmed speed: F = (1 + ``mantissa``/2^16) / 2^``exponent`` steps per clock."""
    return data.StructLayout({"mantissa": _MANTISSA_BITS, "exponent": _EXPONENT_BITS})


class FeedUnit(Part):
    """Says when a step may leave, so that the path is run at the programmed speed.

    It stands beside the steps: ``permit`` is the start pulse that lets the waiting step go, and
    ``taken`` tells that it has gone, with the axes that it ``moves``. ``active`` says that there is
    a block to run, at the programmed speed F of ``feed``.

    Speed: with o = min(``override``, 256)/128 the target is min(F·o, 1) steps per clock, and 0 with
    ``hold`` or without ``active``. Without ``acceleration`` the rate r is the target. With an
    acceleration a > 0 a velocity v climbs or falls by a a clock::

        falls     where B ≥ to_go, v ≥ target + a
                  or the target is 0:     v := max(v − a, 0);  B := max(B − v, 0) (v of now)
        climbs    else where v < target:  B := B + v;          v := v + a
        r = min(v, target), or v itself where v ≥ target + a: it is still falling

    B is the way that braking from v takes: it adds up while v climbs and is used up, by just the
    same numbers, while it falls; where v is 0, so is B. v may exceed the target by less than a, and
    so may r in the first clock of a fall to a lower one. ``to_go`` is the path left to the end of
    the chain of blocks: ``begins`` loads it with ``ahead``, a step takes off its own pause, and 1
    always remains. So the speed is a trapezoid over the path, or a triangle. The first step leaves
    at a; the last one at √(2a·(2 + 3V)) + a at most, as the path left is known in whole steps and
    braking from V begins 3 clocks late. Both counts are hints: whatever they are, every step
    leaves.

    Pauses: a step on one axis is followed by a pause of 1 at the rate r, one on k axes by one of
    ``pauses``\\[k − 1\\]/256, which is √k. ``debt`` is what is left of it: a step that leaves adds
    its pause, every clock takes off r, and the next one is permitted when nothing is left. A single
    step that leaves in the middle of a pause puts its own in its place. The fraction is kept, so
    that no clock is lost in the mean; time in which no step was there is not made up.
    With ``pairing`` a step on other axes than the ones before it belongs to the same move: x and
    then y is a diagonal in two halves, and the second half adds √2 − 1 only. Without it (as in the
    exercise) an interpolator that puts out x and y one after the other is up to 29 % too slow.
    With ``even`` what is taken is a tick of an interpolator at constant speed: the pause is 1,
    whatever it moves.

    Single step: a rising edge of ``single`` under ``hold`` permits one step, and the ticks before
    it that move nothing.

    Latency: F and ``override`` of clock t act on ``permit`` in clock t + 3 (product, target, rate),
    ``hold`` in t + 2; with an acceleration their ramp begins a clock later. ``single`` acts in the
    next clock, ``taken`` too.

    Throughput: a step a clock at a rate of 1.

    ``still`` is 1 when the rate is 0 and stays so under ``hold``: no step but single ones.

    Reset: rate 0, nothing owed. Without ``active`` v and B are 0 and the pause stands still.

    Overflow: B and ``to_go`` keep within their bits; an override above 200 % is taken for 200 %, a
    speed above 1 for 1. When a is changed in motion B is wrong, until the next standstill.

    Error: F has 17 significant bits, to be chosen within 2^-17 of any speed from 2^-24 to 1, and is
    then exact to 2^-48 steps per clock. Along the path, over moves of any straight direction, the
    speed is F within −7.61 % … +0.02 %: pauses measure the octagon, max + (√2 − 1)·min. With
    ``even`` it is that of the ticks.

    Source: exercise 3, figure 3.3 and extra task 2 (F, start pulses, pause of 1.4). Override, ramp
    and pairing are ours.

    Parameters
    ----------
    axes : int
        2 to 6.
    pauses : sequence of int or None
        After a step on 1, 2, … ``axes`` axes, in 1/256: 256 first, then as large or larger, up to
        1023. None: 256·√k. The exercise has 1.4: (256, 358).
    pairing : bool
        Steps on different axes that follow each other are one move.
    multiplier : bool
        F times the override by a multiplier of the FPGA, not by adders.

    Attributes
    ----------
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

    notation = "F = feed, in steps per clock"

    def __init__(
        self,
        axes: int = 2,
        *,
        pauses: Sequence[int] | None = None,
        pairing: bool = True,
        multiplier: bool = False,
    ):
        check_axes(axes)
        check_flag("pairing", pairing)
        check_flag("multiplier", multiplier)
        chosen = PAUSES[:axes] if pauses is None else tuple(pauses)
        _check_pauses(chosen, axes)
        super().__init__(
            {
                "active": In(1),
                "begins": In(1),
                "feed": In(feed_layout()),
                "ahead": In(AHEAD_BITS),
                "taken": In(1),
                "even": In(1),
                "moves": In(per_axis(axes, 1)),
                "override": In(OVERRIDE_BITS),
                "acceleration": In(ACCELERATION_BITS),
                "hold": In(1),
                "single": In(1),
                "permit": Out(1),
                "still": Out(1),
            }
        )
        self.axes = axes
        self.pauses = chosen
        self.pairing = pairing
        self.multiplier = multiplier
        self.parameters: dict[str, object] = {
            "axes": axes,
            "pauses": chosen,
            "pairing": pairing,
            "multiplier": multiplier,
        }

        self.product = Signal(_PRODUCT_BITS)
        self.exponent = Signal(_EXPONENT_BITS)
        self.target = Signal(RATE_BITS + 1)
        self.velocity = Signal(RATE_BITS + 1)
        self.braking = Signal(AHEAD_BITS + 1 + _BRAKING_FRACTION)
        self.rate = Signal(RATE_BITS + 1)
        self.debt = Signal(signed(RATE_BITS + 3))
        self.to_go = Signal(AHEAD_BITS + _PAUSE_FRACTION, init=1 << _PAUSE_FRACTION)
        self.cell = Signal(axes)
        self.single_before = Signal()
        self.single_step = Signal()
        self.diagram: dict[str, list[Signal]] = {
            "F, speed to reach": [self.product, self.exponent, self.target],
            "ramp": [self.velocity, self.braking, self.to_go],
            "start pulses": [self.rate, self.debt, self.cell],
            "single step": [self.single_before, self.single_step],
        }
        if not multiplier:
            self.intermediates = {
                f"sum_{bit}": Signal(
                    min(_MANTISSA_BITS + 2 + bit, _PRODUCT_BITS), name=f"sum_{bit}"
                )
                for bit in range(1, MAX_OVERRIDE.bit_length())
            }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        self._set_target(m)
        self._ramp(m)
        self._pause(m)
        rising = Signal()
        m.d.comb += [
            rising.eq(self.single & ~self.single_before),
            self.permit.eq(self.single_step | ((self.debt <= 0) & self.rate.any())),
            self.still.eq(~self.target.any() & ~self.velocity.any() & ~self.rate.any()),
        ]
        m.d.sync += [
            self.single_before.eq(self.single),
            self.single_step.eq(
                self.hold
                & (rising | (self.single_step & ~(self.taken & self.moves.as_value().any())))
            ),
        ]
        return m

    def _set_target(self, m: Module) -> None:
        """F and the override multiplied, by shifted additions, and shifted by the exponent."""
        factor = Signal(OVERRIDE_BITS)
        significand = Signal(_MANTISSA_BITS + 1)
        shifted = Signal(_PRODUCT_BITS + RATE_BITS - _MANTISSA_BITS - 7)
        if self.multiplier:
            # The leading 1 aside: the multipliers of an iCE40 take 16 bits.
            total = (factor << _MANTISSA_BITS) + self.feed.mantissa * factor
        else:
            rows = [
                Mux(factor[bit], significand << bit, 0) for bit in range(MAX_OVERRIDE.bit_length())
            ]
            total = rows[0]
            for row, partial in zip(rows[1:], self.intermediates.values(), strict=True):
                m.d.comb += partial.eq(total + row)
                total = partial
        m.d.comb += [
            factor.eq(Mux(self.override > MAX_OVERRIDE, MAX_OVERRIDE, self.override)),
            significand.eq(Cat(self.feed.mantissa, Const(1, 1))),
            shifted.eq((self.product << (RATE_BITS - _MANTISSA_BITS - 7)) >> self.exponent),
        ]
        fastest = 1 << RATE_BITS
        m.d.sync += [
            self.product.eq(Mux(self.active, total, 0)),
            self.exponent.eq(self.feed.exponent),
            self.target.eq(
                Mux(self.active & ~self.hold, Mux(shifted > fastest, fastest, shifted), 0)
            ),
        ]

    def _ramp(self, m: Module) -> None:
        """Let the velocity climb and fall, and know how far braking takes."""
        falls, climbs, above = Signal(), Signal(), Signal()
        stops, brakes = Signal(), Signal()
        lower = Signal.like(self.velocity, name="lower")
        slower = Signal.like(self.velocity, name="slower")
        way = Signal(len(self.velocity) - (RATE_BITS - _BRAKING_FRACTION))
        m.d.comb += [
            brakes.eq(self.braking >> (_BRAKING_FRACTION - _PAUSE_FRACTION) >= self.to_go),
            stops.eq(self.velocity < self.acceleration),
            lower.eq(self.velocity - self.acceleration),
            above.eq(~stops & (lower >= self.target)),
            # A target of 0 is reached however small v is, also where a has grown since.
            falls.eq(brakes | above | (self.target == 0)),
            climbs.eq(~falls & (self.velocity < self.target)),
            slower.eq(Mux(stops, 0, lower)),
            way.eq(Mux(falls, slower, self.velocity) >> (RATE_BITS - _BRAKING_FRACTION)),
        ]
        # B ± way by one adder: ~B + way is ~(B − way).
        flipped = Mux(falls, ~self.braking, self.braking)
        total = Signal(len(self.braking) + 1)
        m.d.comb += total.eq(flipped + way)
        with m.If(~self.active | (self.acceleration == 0)):
            m.d.sync += [self.velocity.eq(0), self.braking.eq(0)]
        with m.Elif(falls):
            m.d.sync += [
                self.velocity.eq(slower),
                self.braking.eq(Mux((slower == 0) | total[-1], 0, ~total[:-1])),
            ]
        with m.Elif(climbs):
            m.d.sync += [
                self.velocity.eq(self.velocity + self.acceleration),
                self.braking.eq(total[:-1]),
            ]
        with m.If(~self.active):
            m.d.sync += self.rate.eq(0)
        with m.Elif(self.acceleration == 0):
            m.d.sync += self.rate.eq(self.target)
        with m.Else():
            below = self.velocity < self.target
            m.d.sync += self.rate.eq(Mux(above | below, self.velocity, self.target))

    def _pause(self, m: Module) -> None:
        """Reckon what is left of the pause, and of the path."""
        moves = Signal(self.axes)
        joins = Signal()
        together = Signal(self.axes)
        cost = Signal(_PAUSE_BITS)
        m.d.comb += [
            moves.eq(Cat(self.moves[a] for a in self.letters)),
            joins.eq(self.cell.any() & ~(self.cell & moves).any() if self.pairing else 0),
            together.eq(Mux(joins, self.cell | moves, moves)),
            cost.eq(
                Mux(
                    self.even,
                    1 << _PAUSE_FRACTION,
                    self._pause_of(together) - Mux(joins, self._pause_of(self.cell), 0),
                )
            ),
        ]
        owed = Signal.like(self.debt, name="owed")
        m.d.comb += owed.eq(
            Mux(self.debt < 0, self.debt, 0) + (cost << (RATE_BITS - _PAUSE_FRACTION))
        )
        with m.If(self.taken):
            m.d.sync += self.cell.eq(Mux(self.even, 0, together))
        with m.If(self.taken | (self.debt > 0)):
            left = Mux(self.taken, Mux(owed < 0, 0, owed), self.debt)
            m.d.sync += self.debt.eq(left - self.rate)

        one = 1 << _PAUSE_FRACTION
        with m.If(self.begins):
            m.d.sync += self.to_go.eq(Mux(self.ahead.any(), self.ahead << _PAUSE_FRACTION, one))
        with m.Elif(self.taken):
            m.d.sync += self.to_go.eq(Mux(self.to_go < cost + one, one, self.to_go - cost))

    @property
    def letters(self) -> str:
        """The axis letters."""
        return "xyzabc"[: self.axes]

    def _pause_of(self, axes: Signal):
        """Give the pause after a step on these axes."""
        count = sum((axes[index] for index in range(1, self.axes)), axes[0])
        pause = Const(0, _PAUSE_BITS)
        for number, value in enumerate(self.pauses, start=1):
            pause = Mux(count == number, value, pause)
        return pause


def _check_pauses(pauses: tuple[int, ...], axes: int) -> None:
    """Raise ``TypeError`` or ``ValueError`` unless these are pauses for so many axes."""
    if not all(isinstance(pause, int) and not isinstance(pause, bool) for pause in pauses):
        raise TypeError(f"pauses must be whole numbers of 1/256, not {pauses!r}")
    most = (1 << _PAUSE_BITS) - 1
    rising = list(pauses) == sorted(pauses)
    if len(pauses) != axes or pauses[0] != PAUSES[0] or not rising or pauses[-1] > most:
        raise ValueError(
            f"pauses are {pauses!r}: choose {axes} of them, {PAUSES[0]} first and none smaller "
            f"than the one before, up to {most}"
        )
