"""The exact line interpolator: nearest points of the grid, a step a clock."""

from typing import Any

from amaranth import Cat, Module, Mux, Signal, Value
from amaranth.hdl import signed
from amaranth.lib import stream
from amaranth.lib.wiring import In, Out

from discreta.hdl.contract import (
    AXIS_LETTERS,
    ErrorCode,
    Part,
    check_axes,
    check_width,
    point_layout,
    step_layout,
)
from discreta.hdl.quadrant import line_block_layout

__all__ = ["ExactLine"]


class ExactLine(Part):
    """Draws a straight line by the points of the grid that are nearest to it, a step a clock.

    Computes, with L = max \\|Δ\\| of all axes, after k = 1 … L steps, for every axis::

        X(k) = XH + ⌊k·ΔX / L + ½⌋

    The axis that leads, whose way is L, moves with every step. For another one the sign of its
    residual E = Δ·(k + 1) − L·(x + ½) says whether it moves with the next step, too: E then grows
    by Δ ∓ L, otherwise by Δ. (All with the sign of Δ; ½·L is rounded to a whole number.)

    The sign would have to come back, choose an addend and be added in one clock. But of the two
    decisions one comes more often, the one of the first step, and the other one never twice in a
    row. So ``total`` is what E becomes if the step now made is one of the frequent kind; when it is
    not, the next one is, without a look at any sign. The sign of ``total`` tells the kind of a step
    while the addend of the step before is still being added, and ``addend`` is a register: between
    registers there is one adder and nothing else.

    Preparation: a block is taken in with its ways Δ, weighed (in the plane the signs of ΔX + ΔY and
    ΔX − ΔY tell who leads; with more axes the ways are compared one a clock), in the plane chosen
    (leader and follower), prepared (addends, first residual) and loaded, each in a clock. A stage
    takes a block over when the one before has it and it is empty itself. A step is decided in one
    clock and waits from the next one on.

    On an iCE40 a carry leaves one input of its LUT free. So what an accumulator is loaded with
    comes to it where its sum is known (``total`` and ``addend`` are 0 then, P5 is 1), or from the
    register that is added otherwise (``move``): no multiplexer stands behind a carry chain.

    Registers: P3, P4 = position, ``move`` = what is added to them next, or their new value; P5 =
    the steps decided less L, and 1 more: it counts up to 0, the last step, and rests at 1; with
    more than two axes XT… and KO. ``gain`` = Δ and ``loss`` = Δ ∓ L of the follower, ``addend``,
    ``total``, ``rest`` (the first E, once), ``often`` (the decision that comes more often: 1
    moves), ``first`` (the sign of the first E), ``rare`` (the step decided last is of the other
    kind, or none has been). In the plane there is one follower; with more axes every axis is one,
    also the one that leads, and the names end in its letter.

    Latency: the first step of a block that is accepted in clock 0 waits from clock 8 on, with a > 2
    axes from clock a + 6 on, if nothing is before it. ``done`` follows the last step by a clock.

    Throughput: a step a clock, and one clock between the last step of a block and the first one of
    the next, however short they are (with a > 2 axes blocks come every a + 2 clocks at best). A
    block of no length and a rejected block are answered when the steps before them have gone.

    Steps: ``steps`` holds a step until it is taken and everything but the preparation waits for it.
    ``position`` shows the steps taken, not the one that waits; it is loaded with the block's start
    in the clock before its first step waits.

    Reset: everything 0 but P5, nothing pending, position at the origin.

    Overflow: ``error`` is ``RANGE`` for one clock, in place of ``done``, for a block with an axis
    longer than 2^n − 1 steps; nothing moves and the next block runs as ever. E and what it grows by
    are L at most in magnitude, so n + 1 bits do.

    Error bound: half a step on every axis, in the direction of that axis: in a axes at most
    √(a − 1)/2 from the line, in the plane ½·L/√(ΔX² + ΔY²) < ½, or ½ on none but its own points. A
    tie goes upwards. The end point is exact.

    Source: design of the exact interpolator (the leading axis steps, the sign of the residual
    decides for the others); comparison with half preload and modulus L. Looking one step ahead is
    ours.

    Parameters
    ----------
    width : int
        n, 4 to 32. Coordinates are signed, n + 1 bits; steps are 1 long.
    axes : int
        2 to 6.

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

    notation = "n = width, L = the longest way of an axis"

    def __init__(self, width: int = 16, axes: int = 2):
        check_width(width)
        check_axes(axes)
        super().__init__(
            {
                "blocks": In(stream.Signature(line_block_layout(width, axes))),
                "steps": Out(stream.Signature(step_layout(axes))),
                "position": Out(point_layout(width, axes)),
                "busy": Out(1),
                "done": Out(1),
                "error": Out(ErrorCode),
            }
        )
        self.width = width
        self.axes = axes
        self.letters = AXIS_LETTERS[:axes]
        self.parameters: dict[str, object] = {"width": width, "axes": axes}

        plane = axes == 2
        self.followers = ("",) if plane else tuple(f"_{a}" for a in self.letters)
        places = ("p3", "p4") if plane else tuple(f"{a}t" for a in self.letters)
        left = "p5" if plane else "ko"
        wide = signed(width + 1)
        ways = {
            **{f"start_{a}": wide for a in self.letters},
            **{f"delta_{a}": wide for a in self.letters},
            **{f"beyond_{a}": 1 for a in self.letters},
        }
        starts = {f"ready_start_{a}": wide for a in self.letters}
        negatives = {f"ready_negative_{a}": 1 for a in self.letters}
        moves = {f"move_{a}": wide for a in self.letters}
        begin = {f"begin_{a}": wide for a in self.letters}
        begin |= {f"negative_{a}": 1 for a in self.letters}
        groups: dict[str, dict[str, Any]] = {
            "position": dict.fromkeys(places, wide) | moves,
            "residual of the follower": {
                f"{name}{f}": 1 if name in ("often", "first", "rare") else wide
                for f in self.followers
                for name in ("gain", "loss", "total", "addend", "rest", "often", "first", "rare")
            },
            "steps left": {left: wide},
            "block loaded": begin,
            "УУ": dict.fromkeys(("works", "loaded", "starting", "running", "done", "error"), 1),
            "step decided": {
                "decided": 1,
                "final": 1,
                **{f"moves_{a}": 1 for a in self.letters},
                **{f"falls_{a}": 1 for a in self.letters},
            },
            "step that waits": {
                "waiting": 1,
                "last": 1,
                **{f"pulse_{a}": 1 for a in self.letters},
                **{f"down_{a}": 1 for a in self.letters},
                **{f"direction_{a}": 1 for a in self.letters},
            },
            "block accepted": {"open": 1, "pending": 1, "weighed": 1, **ways},
            "block prepared": {
                "room": 1,
                "prepared": 1,
                "refused": 1,
                "ready_fault": 1,
                "ready_lead": wide,
                **{
                    f"ready_{name}{f}": wide
                    for f in self.followers
                    for name in ("gain", "loss", "rest")
                },
                **starts,
                **negatives,
            },
        }
        if plane:
            groups["steps left"]["more"] = 1
            groups["step that waits"]["follows_x"] = 1
            groups["block loaded"]["follow_x"] = 1
            groups["block accepted"] |= {
                "sum_down": 1,
                "difference_down": 1,
                "bare_x": 1,
                "bare_y": 1,
            }
            groups["block prepared"]["ready_follow_x"] = 1
            groups["leader chosen"] = {
                "chosen": 1,
                "way_fault": 1,
                "way_bare": 1,
                "way_follow": wide,
                "way_lead": wide,
                "way_follow_x": 1,
                "way_same": 1,
                **{f"way_start_{a}": wide for a in self.letters},
                **{f"way_negative_{a}": 1 for a in self.letters},
            }
        else:
            groups["block accepted"] |= {"axis": 3, "reach": width + 1}
        made = {
            title: {
                name: Signal(shape, name=name, init=name in ("open", "room", left))
                for name, shape in group.items()
            }
            for title, group in groups.items()
        }
        self.diagram: dict[str, list[Signal]] = {
            title: list(group.values()) for title, group in made.items()
        }
        self.registers: dict[str, Signal] = {
            register.name: register for group in self.diagram.values() for register in group
        }
        self.left = self.registers[left]
        #: The block prepared is loaded in this clock, or the one refused is answered.
        self.given, self.answer = Signal(), Signal()
        # Kept as it is, so that each of its bits is the fourth input of a LUT behind a carry.
        self.loaded_count = Signal(width + 1, attrs={"keep": 1})
        self.place = {a: self.registers[name] for a, name in zip(self.letters, places, strict=True)}

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        r = self.registers
        go, taken, rests, ends, load, leaves = (
            Signal(name=name) for name in ("go", "taken", "rests", "ends", "load", "leaves")
        )
        room = r["room"]
        answer = self.answer
        m.d.comb += [
            go.eq(~r["waiting"] | self.steps.ready),
            taken.eq(r["waiting"] & self.steps.ready),
            # With the last step, and where no block runs.
            rests.eq(~self.left[-1]),
            ends.eq(r["running"] & rests),
            load.eq(r["prepared"] & rests),
            answer.eq(r["refused"] & ~r["works"] & ~r["decided"] & ~r["waiting"]),
            self.given.eq(go & load),
            self.steps.valid.eq(r["waiting"]),
            self.steps.payload.last.eq(r["last"]),
            self.done.eq(r["done"]),
            self.error.eq(Mux(r["error"], ErrorCode.RANGE, ErrorCode.NONE)),
        ]
        m.d.sync += [
            r["done"].eq((taken & r["last"]) | (answer & ~r["ready_fault"])),
            r["error"].eq(answer & r["ready_fault"]),
        ]
        with m.If(go):
            m.d.sync += [
                r["works"].eq(load | r["loaded"] | (r["running"] & ~ends)),
                r["loaded"].eq(load),
                r["starting"].eq(r["loaded"]),
                r["running"].eq(r["loaded"] | (r["running"] & ~ends)),
                r["decided"].eq(r["running"]),
                r["final"].eq(ends),
                r["waiting"].eq(r["decided"]),
                r["last"].eq(r["final"]),
            ]
            # What is not loaded, as no block is prepared, is not looked at.
            with m.If(rests):
                for a in self.letters:
                    m.d.sync += [
                        r[f"begin_{a}"].eq(r[f"ready_start_{a}"]),
                        r[f"negative_{a}"].eq(r[f"ready_negative_{a}"]),
                    ]
                if self.axes == 2:
                    m.d.sync += r["follow_x"].eq(r["ready_follow_x"])
        self._accept(m, leaves, room)
        if self.axes == 2:
            m.d.comb += leaves.eq(r["weighed"] & ~r["chosen"])
            self._choose(m, leaves, room)
            self._prepare_plane(m, r["chosen"] & room, room)
        else:
            m.d.comb += leaves.eq(r["weighed"] & room)
            self._weigh(m, leaves)
            self._prepare_space(m, leaves, room)
        self._count(m, go, load)
        moves = {f: self._follow(m, f, go, rests) for f in self.followers}
        if self.axes == 2:
            follows_x = r["follows_x"]
            moved = {"x": moves[""] | ~follows_x, "y": moves[""] | follows_x}
            with m.If(go & r["loaded"]):
                m.d.sync += follows_x.eq(r["follow_x"])
        else:
            moved = {a: moves[f"_{a}"] for a in self.letters}
        for a in self.letters:
            place, pulse, direction = self.place[a], r[f"pulse_{a}"], r[f"direction_{a}"]
            down, move = r[f"down_{a}"], r[f"move_{a}"]
            next_pulse, next_down = Signal(name=f"next_pulse_{a}"), Signal(name=f"next_down_{a}")
            m.d.comb += [
                next_pulse.eq(r["running"] & moved[a]),
                next_down.eq(next_pulse & direction),
                self.position[a].eq(place),
                self.steps.payload[a].eq(Cat(pulse, down).as_signed()),
            ]
            with m.If(go):
                m.d.sync += [
                    # What waits is taken now; where nothing does, nothing is added. What is added
                    # and what is loaded come from one register: a LUT behind each carry does both.
                    place.eq(Mux(r["starting"], move, place + move)),
                    move.eq(
                        Mux(
                            r["loaded"],
                            r[f"begin_{a}"],
                            Cat(r[f"moves_{a}"], r[f"falls_{a}"].replicate(self.width)).as_signed(),
                        )
                    ),
                    pulse.eq(r[f"moves_{a}"]),
                    down.eq(r[f"falls_{a}"]),
                    r[f"moves_{a}"].eq(next_pulse),
                    r[f"falls_{a}"].eq(next_down),
                ]
                with m.If(r["loaded"]):
                    m.d.sync += direction.eq(r[f"negative_{a}"])
        stages = ("pending", "prepared", "refused", "decided", "waiting")
        stages += ("chosen",) if self.axes == 2 else ()
        m.d.comb += self.busy.eq(r["works"] | Cat(r[name] for name in stages).any())
        return m

    def _accept(self, m: Module, leaves: Value, room: Value) -> None:
        """Take in a block: its ways, and whether they fit."""
        r, n = self.registers, self.width
        block = self.blocks.payload
        accept, stays = Signal(name="accept"), Signal(name="stays")
        held = r["chosen"] & ~room if self.axes == 2 else 0
        m.d.comb += [
            self.blocks.ready.eq(r["open"]),
            accept.eq(self.blocks.valid & r["open"]),
            stays.eq(r["pending"] & ~leaves),
        ]
        m.d.sync += [
            r["pending"].eq(accept | stays),
            # In the plane a block leaves in its second clock if there is room then.
            r["open"].eq(~accept & (~stays | (~held if self.axes == 2 else 0))),
        ]
        for a in self.letters:
            delta = Signal(signed(n + 2), name=f"way_{a}")
            m.d.comb += delta.eq(block.end[a] - block.start[a])
            with m.If(accept):
                m.d.sync += [
                    r[f"start_{a}"].eq(block.start[a]),
                    Cat(r[f"delta_{a}"], r[f"beyond_{a}"]).eq(delta),
                ]
        if self.axes == 2:
            x, y = r["delta_x"], r["delta_y"]
            m.d.sync += [
                r["weighed"].eq(stays),
                r["sum_down"].eq((x + y)[-1]),
                r["difference_down"].eq((x - y)[-1]),
                # All bits but the sign: no way, or one too long.
                *[r[f"bare_{a}"].eq(r[f"delta_{a}"][:n] == 0) for a in "xy"],
            ]

    def _too_long(self) -> Value:
        """Tell whether a way of the block that came last does not fit n + 1 bits."""
        r = self.registers
        return Cat(r[f"beyond_{a}"] != r[f"delta_{a}"][-1] for a in self.letters).any()

    def _choose(self, m: Module, leaves: Value, room: Value) -> None:
        """Tell leader and follower of the plane apart."""
        r = self.registers
        x, y = r["delta_x"], r["delta_y"]
        same, follow_x = Signal(name="same"), Signal(name="follow_x")
        m.d.comb += [
            same.eq(x[-1] == y[-1]),
            # Of equal ways that of x leads, unless it goes downwards.
            follow_x.eq(Mux(same, r["difference_down"], r["sum_down"]) ^ x[-1]),
        ]
        m.d.sync += r["chosen"].eq(leaves | (r["chosen"] & ~room))
        with m.If(~r["chosen"]):
            m.d.sync += [
                r["way_fault"].eq(self._too_long()),
                r["way_bare"].eq(Mux(follow_x, r["bare_y"], r["bare_x"])),
                r["way_follow"].eq(Mux(follow_x, x, y)),
                # An inverted operand is free here, and not in front of an adder.
                r["way_lead"].eq(Mux(follow_x, y, x) ^ same.replicate(self.width + 1)),
                r["way_follow_x"].eq(follow_x),
                r["way_same"].eq(same),
            ]
            for a in self.letters:
                m.d.sync += [
                    r[f"way_start_{a}"].eq(r[f"start_{a}"]),
                    r[f"way_negative_{a}"].eq(r[f"delta_{a}"][-1]),
                ]

    def _hand_on(self, m: Module, takes: Value, refused: Value) -> None:
        """Hold a block prepared, or refused, until it is loaded or answered."""
        r = self.registers
        prepared, kept = Signal(name="prepared_on"), Signal(name="refused_on")
        m.d.comb += [
            prepared.eq(r["prepared"] & ~self.given),
            kept.eq(r["refused"] & ~self.answer),
        ]
        m.d.sync += [
            r["prepared"].eq((takes & ~refused) | prepared),
            r["refused"].eq((takes & refused) | kept),
            r["room"].eq(~(takes | prepared | kept)),
        ]

    def _prepare_plane(self, m: Module, takes: Value, room: Value) -> None:
        """Work out addends and first residual of the follower."""
        r, n = self.registers, self.width
        way, lead, same = r["way_follow"], r["way_lead"], r["way_same"]
        none = r["way_bare"]
        bad = none | r["way_fault"]
        self._hand_on(m, takes, bad)
        with m.If(room):
            m.d.sync += [
                r["ready_fault"].eq(r["way_fault"] | (none & (lead[n] != same))),
                r["ready_lead"].eq(lead),
                r["ready_follow_x"].eq(r["way_follow_x"]),
                r["ready_gain"].eq(way),
                r["ready_loss"].eq(_sum(way, lead, same)),
                r["ready_rest"].eq(_sum(way, lead >> 1, same & lead[0])),
            ]
            for a in self.letters:
                m.d.sync += [
                    r[f"ready_start_{a}"].eq(r[f"way_start_{a}"]),
                    r[f"ready_negative_{a}"].eq(r[f"way_negative_{a}"]),
                ]

    def _weigh(self, m: Module, leaves: Value) -> None:
        """Compare the ways of more than two axes, one a clock."""
        r, n = self.registers, self.width
        axis, reach = r["axis"], r["reach"]
        way = Signal(signed(n + 1), name="weighed_way")
        up, down = Signal(name="longer_upwards"), Signal(name="longer_downwards")
        last = Signal(name="last_axis")
        with m.Switch(axis):
            for number, a in enumerate(self.letters):
                with m.Case(number):
                    m.d.comb += way.eq(r[f"delta_{a}"])
        m.d.comb += [
            last.eq(axis == self.axes - 1),
            up.eq(way > reach),
            down.eq(-way > reach),
        ]
        m.d.sync += axis.eq(0)
        with m.If(r["pending"] & ~r["weighed"]):
            m.d.sync += r["weighed"].eq(last)
            with m.If(~last):
                m.d.sync += axis.eq(axis + 1)
            with m.If(up | down):
                m.d.sync += reach.eq(Mux(up, way, -way))
        with m.Elif(leaves):
            m.d.sync += [r["weighed"].eq(0), reach.eq(0)]

    def _prepare_space(self, m: Module, takes: Value, room: Value) -> None:
        """Work out addends and first residuals of more than two axes."""
        r, n = self.registers, self.width
        reach = r["reach"]
        self._hand_on(m, takes, (reach == 0) | reach[n] | self._too_long())
        with m.If(room):
            m.d.sync += [
                r["ready_fault"].eq(self._too_long() | reach[n]),
                r["ready_lead"].eq(reach),
            ]
            for a in self.letters:
                way = r[f"delta_{a}"]
                up = ~way[-1]
                lead = Cat(reach ^ up.replicate(n + 1), up).as_signed()
                m.d.sync += [
                    r[f"ready_start_{a}"].eq(r[f"start_{a}"]),
                    r[f"ready_negative_{a}"].eq(way[-1]),
                    r[f"ready_gain_{a}"].eq(way),
                    r[f"ready_loss_{a}"].eq(_sum(way, lead, up)),
                    r[f"ready_rest_{a}"].eq(_sum(way, lead >> 1, up & lead[0])),
                ]

    def _count(self, m: Module, go: Value, load: Value) -> None:
        """Count the steps of the leading axis: up to 0, the last one, and 1 between blocks."""
        r, n, left = self.registers, self.width, self.left
        lead = r["ready_lead"]
        count, counted = Signal(n + 1, name="count"), Signal(n + 1, name="counted")
        more = r["more"] if self.axes == 2 else r["loaded"]
        m.d.comb += [
            # −1 less its length, or where the leader of the plane goes downwards just less that:
            # ``more`` makes up for it in the clock after.
            count.eq(lead ^ (~lead[-1]).replicate(n + 1)),
            counted.eq((Cat(1, left) + Cat(more, r["works"]))[1 : n + 2]),
            # What is counted is 1 when a block is loaded: it is loaded around the carry.
            self.loaded_count.eq(Mux(load, count ^ 1, 0)),
        ]
        with m.If(go):
            m.d.sync += left.eq(counted ^ self.loaded_count)
            if self.axes == 2:
                down = Mux(r["ready_follow_x"], r["ready_negative_y"], r["ready_negative_x"])
                m.d.sync += more.eq(load & ~down)

    def _follow(self, m: Module, f: str, go: Value, rests: Value) -> Signal:
        """Describe a follower; tell whether it moves with the step that is decided."""
        r = self.registers
        total, addend, often = r[f"total{f}"], r[f"addend{f}"], r[f"often{f}"]
        rest, rare = r[f"ready_rest{f}"], Signal(name=f"next_rare{f}")
        moves = Signal(name=f"moves{f}")
        m.d.comb += [
            rare.eq(~r[f"rare{f}"] & (total[-1] ^ r[f"first{f}"])),
            moves.eq(rare ^ often),
        ]
        with m.If(go):
            m.d.sync += r[f"rare{f}"].eq(rare | rests | r["loaded"])
            with m.If(rests):
                m.d.sync += [
                    often.eq(rest[-1] ^ ~r[f"ready_gain{f}"][-1]),
                    r[f"first{f}"].eq(rest[-1]),
                    r[f"gain{f}"].eq(r[f"ready_gain{f}"]),
                    r[f"loss{f}"].eq(r[f"ready_loss{f}"]),
                ]
        # Both are 0 when a block is loaded: its first residual goes around the carry.
        with m.If(go & rests):
            m.d.sync += [total.eq(0), addend.eq(0)]
        with m.Elif(go):
            m.d.sync += [
                total.eq((total + addend)[: self.width + 1] ^ r[f"rest{f}"]),
                addend.eq(Mux(moves, r[f"loss{f}"], r[f"gain{f}"])),
            ]
        with m.If(go & ~rests):
            m.d.sync += r[f"rest{f}"].eq(0)
        with m.Elif(go):
            m.d.sync += r[f"rest{f}"].eq(rest)
        return moves


def _sum(a: Value, b: Value, carry: Value) -> Value:
    """Add two signed numbers and a carry with one carry chain, to the bits of the first."""
    return (Cat(1, a).as_signed() + Cat(carry, b).as_signed())[1 : len(a) + 1].as_signed()
