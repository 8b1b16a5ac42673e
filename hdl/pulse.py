"""The pulse unit: steps become the pulses that motor drivers take, or the phases of an encoder."""

from amaranth import Cat, Module, Mux, Signal
from amaranth.hdl import signed
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import (
    AXIS_LETTERS,
    Part,
    check_axes,
    check_choice,
    check_width,
    per_axis,
    point_layout,
)
from discreta.hdl.parts import PositionRegister

__all__ = ["KINDS", "TIMING_BITS", "PulseUnit"]

#: What the pins of an axis show.
KINDS = ("step_direction", "quadrature")
#: Bits of a timing, in clocks.
TIMING_BITS = 12

#: The pins of an axis, by kind.
PINS = {"step_direction": ("step", "direction"), "quadrature": ("a", "b")}


class PulseUnit(Part):
    """Puts a step out as a pulse of every axis that it moves, by the timings of the drivers.

    Computes, with L, S, U, H = ``pulse_length``, ``pulse_space``, ``direction_setup`` and
    ``direction_hold`` in clocks, each at least 1: a pulse is high for just L clocks and the pin is
    low for at least S between two pulses of an axis; the direction pin (1 leads downwards) does not
    change while a pulse is out, stays for at least H clocks after its trailing edge, and is stable
    for at least U before a leading edge. All pulses of a step begin in the same clock: a diagonal
    step stays one. A step of all zeros (−2 is one too) is taken, and nothing is put out.

    ``quadrature`` keeps all of these rules, but shows of them only the leading edges: with each of
    them the pins (a, b) go on by one in 00, 10, 11, 01 for a step upwards, back by one for a step
    downwards.

    One step is kept pending. An axis of it that has to turn does so as soon as H allows, and the
    step is launched in the first clock in which every axis that it moves has its direction, U and S
    behind it. ``steps.ready`` is 1 when nothing is pending or the pending step is launched in this
    very clock, and the unit is not stopping.

    Latency: a step that is taken in clock 0 and has nothing to wait for is launched in clock 1; its
    leading edges, and the ``position`` after it, are visible in clock 2. A turn takes U clocks more
    from the clock on in which it is allowed. No step that is pending in a clock is launched later
    than L + max(S − 1, H − 1 + U) clocks after it, if nothing stops or limits it.

    Throughput: a step in L + S clocks along an axis, in L + max(S, H + U) where it turns round; a
    step a clock where axes take turns.

    Stop: ``stop`` in clock t drops what is pending, and what is taken in t. The last leading edge
    is visible in clock t + 1; from t + 1 to the clock after the last with ``stop`` nothing is
    taken. A pulse that is out keeps its length: ``position`` is always what was put out.

    Limits: a pending step with an axis that leads towards an active limit switch waits as a whole,
    nor does any axis turn for it. The last leading edge towards a switch that becomes active in
    clock t is visible in clock t + 1. ``limited`` is 1 in a clock after one in which a step waits
    for that, and the step waits in that clock too, so that whoever is told can still drop it by
    ``stop``; the other way out is the switch's release.

    Busy: a step is pending, a pulse is out, or the space behind one lasts beyond this clock. The
    timings are taken over in every clock that is not busy, and left alone in the others: a change
    while busy is used from the first clock after that on. Space, hold and set-up are measured from
    what the pins last did, whatever the timings were then.

    Pins: they and the position come straight from registers, behind an inverter where the pin is
    active low. ``stop`` and the limit switches go through one register; inputs from another clock,
    switches above all, need synchronizers in front.

    Reset: nothing pending, position at the origin, all pins idle from then on, directions upwards,
    and no time to wait for: no pulse was put out before.

    Overflow: the position wraps; no block that is run makes it wrap. ``load`` goes before a pulse
    that is launched in the same clock, and is meant for a clock in which nothing is pending.

    Error: none; a step that was taken is put out just once, or dropped whole by ``stop``.

    Source: none of the documents, which end at the steps; the rules are those of the data sheets of
    step/direction drivers.

    Parameters
    ----------
    width : int
        n, 4 to 32. The position is signed, n + 1 bits, in steps.
    axes : int
        2 to 6.
    kind : str
        What the pins show: ``"step_direction"`` or ``"quadrature"``.
    inverted_steps, inverted_directions : str
        Letters of the axes whose pin is active low: step and direction, or of ``quadrature`` a and
        b.

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

    notation = "n = width; L, S, U, H = pulse length, pulse space, direction set-up, direction hold"

    def __init__(
        self,
        width: int = 16,
        axes: int = 2,
        *,
        kind: str = "step_direction",
        inverted_steps: str = "",
        inverted_directions: str = "",
    ):
        check_width(width)
        check_axes(axes)
        check_choice("kind", kind, KINDS)
        self.letters = AXIS_LETTERS[:axes]
        _check_letters("inverted_steps", inverted_steps, self.letters)
        _check_letters("inverted_directions", inverted_directions, self.letters)
        point, flags = point_layout(width, axes), per_axis(axes, 1)
        super().__init__(
            {
                "steps": In(stream.Signature(per_axis(axes, signed(2)))),
                "load": In(1),
                "initial": In(point),
                "stop": In(1),
                "low_limit": In(flags),
                "high_limit": In(flags),
                "pulse_length": In(TIMING_BITS),
                "pulse_space": In(TIMING_BITS),
                "direction_setup": In(TIMING_BITS),
                "direction_hold": In(TIMING_BITS),
                "pins": Out(per_axis(axes, data.StructLayout(dict.fromkeys(PINS[kind], 1)))),
                "position": Out(point),
                "busy": Out(1),
                "limited": Out(1),
            }
        )
        self.width = width
        self.axes = axes
        self.kind = kind
        self.inverted_steps = inverted_steps
        self.inverted_directions = inverted_directions
        self.parameters: dict[str, object] = {
            "width": width,
            "axes": axes,
            "kind": kind,
            "inverted_steps": inverted_steps,
            "inverted_directions": inverted_directions,
        }

        longest = 2**TIMING_BITS - 1
        self.pending: dict[str, Signal] = {}
        self.pulse: dict[str, Signal] = {}
        self.age: dict[str, Signal] = {}
        self.direction: dict[str, Signal] = {}
        self.direction_age: dict[str, Signal] = {}
        self.phase: dict[str, Signal] = {}
        self.place: dict[str, PositionRegister] = {}
        self.at_low: dict[str, Signal] = {}
        self.at_high: dict[str, Signal] = {}
        for a in self.letters:
            self.pending[a] = Signal(signed(2), name=f"pending_{a}")
            self.pulse[a] = Signal(name=f"pulse_{a}")
            # Clocks for which a level has lasted, this one included; as good as for ever at most.
            self.age[a] = Signal(TIMING_BITS, init=longest, name=f"age_{a}")
            self.direction[a] = Signal(name=f"direction_{a}")
            self.direction_age[a] = Signal(TIMING_BITS, init=longest, name=f"direction_age_{a}")
            if kind == "quadrature":
                # The pins themselves, a in the low bit: a counter behind a Gray code could glitch.
                self.phase[a] = Signal(2, name=f"phase_{a}")
            self.place[a] = PositionRegister(width, name=f"position_{a}")
            self.at_low[a] = Signal(name=f"at_low_{a}")
            self.at_high[a] = Signal(name=f"at_high_{a}")
        self.stopping = Signal()
        self.limited_register = Signal(name="limited")
        self.length = Signal(TIMING_BITS)
        self.space = Signal(TIMING_BITS)
        self.setup = Signal(TIMING_BITS)
        self.hold = Signal(TIMING_BITS)

        self.diagram: dict[str, list[Signal]] = {
            "pending step": list(self.pending.values()),
            "pulses": [*self.pulse.values(), *self.age.values()],
            "directions": [*self.direction.values(), *self.direction_age.values()],
            "position": [part.register for part in self.place.values()],
            "stop and limits": [
                self.stopping,
                self.limited_register,
                *self.at_low.values(),
                *self.at_high.values(),
            ],
            "timings": [self.length, self.space, self.setup, self.hold],
        }
        if kind == "quadrature":
            self.diagram["phases"] = list(self.phase.values())
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }

        #: The pending step is launched in this clock.
        self.launch = Signal()
        #: An axis of the pending step leads towards an active limit switch.
        self.blocked = Signal()
        #: By axis: the pending step moves it; nothing of it has to wait; it may turn.
        self.moves = {a: Signal(name=f"moves_{a}") for a in self.letters}
        self.due = {a: Signal(name=f"due_{a}") for a in self.letters}
        self.turn = {a: Signal(name=f"turn_{a}") for a in self.letters}

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        waiting = Signal()
        free = Signal()
        m.d.comb += [
            waiting.eq(Cat(self.moves.values()).any()),
            free.eq(waiting & ~self.stopping & ~self.blocked & ~self.limited),
            self.launch.eq(
                free & Cat(~self.moves[a] | self.due[a] for a in self.letters).all(),
            ),
            self.steps.ready.eq(~self.stopping & (~waiting | self.launch)),
            self.limited.eq(self.limited_register),
        ]
        m.d.sync += [
            self.stopping.eq(self.stop),
            self.limited_register.eq(self.blocked & ~self.stopping),
        ]
        with m.If(~self.busy):
            m.d.sync += [
                self.length.eq(self.pulse_length),
                self.space.eq(self.pulse_space),
                self.setup.eq(self.direction_setup),
                self.hold.eq(self.direction_hold),
            ]
        blocked, resting = [], []
        for a in self.letters:
            pending, pulse, direction = self.pending[a], self.pulse[a], self.direction[a]
            age, direction_age = self.age[a], self.direction_age[a]
            moves, due, turn = self.moves[a], self.due[a], self.turn[a]
            place = m.submodules[f"position_{a}_register"] = self.place[a]
            downwards = Signal(name=f"downwards_{a}")
            rested = Signal(name=f"rested_{a}")
            leads = Signal(name=f"leads_{a}")  # a pulse of this axis is launched
            m.d.comb += [
                moves.eq(pending[0]),
                downwards.eq(pending[1]),
                rested.eq(~pulse & (age >= self.space)),
                due.eq(rested & (direction == downwards) & (direction_age >= self.setup)),
                turn.eq(
                    free & moves & (direction != downwards) & ~pulse & (age >= self.hold),
                ),
                leads.eq(self.launch & moves),
                place.load.eq(self.load),
                place.initial.eq(self.initial[a]),
                place.up.eq(leads & ~downwards),
                place.down.eq(leads & downwards),
                self.position[a].eq(place.register),
            ]
            blocked.append(moves & Mux(downwards, self.at_low[a], self.at_high[a]))
            resting.append(rested)

            m.d.sync += [
                self.at_low[a].eq(self.low_limit[a]),
                self.at_high[a].eq(self.high_limit[a]),
            ]
            with m.If(self.stopping):
                m.d.sync += pending.eq(0)
            with m.Elif(self.steps.ready):
                m.d.sync += pending.eq(Mux(self.steps.valid, self.steps.payload[a], 0))
            with m.If(leads):
                m.d.sync += [pulse.eq(1), age.eq(1)]
            with m.Elif(pulse & (age >= self.length)):
                m.d.sync += [pulse.eq(0), age.eq(1)]
            with m.Elif(~age.all()):
                m.d.sync += age.eq(age + 1)
            with m.If(turn):
                m.d.sync += [direction.eq(downwards), direction_age.eq(1)]
            with m.Elif(~direction_age.all()):
                m.d.sync += direction_age.eq(direction_age + 1)

            first, second = pulse, direction
            if self.kind == "quadrature":
                first, second = self.phase[a]
                with m.If(leads):
                    m.d.sync += [
                        first.eq(Mux(downwards, second, ~second)),
                        second.eq(Mux(downwards, ~first, first)),
                    ]
            pins = zip(
                PINS[self.kind],
                (first, second),
                (self.inverted_steps, self.inverted_directions),
                strict=True,
            )
            for pin, level, inverted in pins:
                m.d.comb += self.pins[a][pin].eq(level ^ (a in inverted))
        m.d.comb += [
            self.blocked.eq(Cat(blocked).any()),
            self.busy.eq(waiting | ~Cat(resting).all()),
        ]
        return m


def _check_letters(what: str, letters: str, axes: str) -> None:
    """Raise ``TypeError`` or ``ValueError`` unless ``letters`` are axes, each at most once."""
    if not isinstance(letters, str):
        raise TypeError(f"{what} must be a string of axis letters, not {letters!r}")
    if len(set(letters)) < len(letters) or not set(letters) <= set(axes):
        raise ValueError(f"{what} is {letters!r}: choose letters of {axes!r}, each at most once")
