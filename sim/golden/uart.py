"""Golden models of a serial line's two ends, one clock at a time.

A line is 1 when idle. A byte is a start bit 0, eight data bits with the lowest first, and a stop
bit 1, each N clocks long. The receiver looks into the middle of every bit.

A state of the receiver is ``slot`` (0: idle; 1: start bit; 2 to 9: data bits; 10: stop bit; 11: the
stop bit was missing), ``timer`` (clocks until it looks), ``shift`` (the byte), ``received`` and
``broken``. One of the transmitter is ``line``, ``shift`` (what is still to be sent), ``left`` (how
many bits of it) and ``timer`` (clocks left of the bit on the line).
"""

from dataclasses import dataclass

from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["UartReceiver", "UartTransmitter"]

State = dict[str, Value]

_START, _STOP, _BROKEN = 1, 10, 11


@dataclass(frozen=True)
class UartReceiver:
    """Bytes from a line.

    Attributes
    ----------
    clocks_per_bit : int
        N.
    """

    clocks_per_bit: int

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        timer = (self.clocks_per_bit - 1).bit_length()
        widths = {"slot": 4, "timer": timer, "shift": 8, "received": 1, "broken": 1}
        return {name: (bits, False) for name, bits in widths.items()}

    def reset(self) -> State:
        """Give the state after reset: idle."""
        return dict.fromkeys(self.registers(), 0)

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        return {
            "bytes_data": state["shift"],
            "bytes_error": state["broken"],
            "bytes_valid": state["received"],
        }

    def step(self, state: State, inputs: dict[str, Value]) -> State:
        """Give the state after one clock; ``inputs``: ``rx`` and ``bytes_ready``."""
        slot, timer, rx = state["slot"], state["timer"], inputs["rx"]
        idle, waits = equal(slot, 0), equal(slot, _BROKEN)
        counts = negate(idle) & negate(waits) & negate(equal(timer, 0))
        looks = negate(idle) & negate(waits) & equal(timer, 0)
        starts, stops = equal(slot, _START), equal(slot, _STOP)
        ends = looks & stops
        back = (waits & rx) | (looks & (starts | stops) & rx)
        onward = where(idle & negate(rx), _START, where(looks, (slot + 1) & 15, slot))
        bit = looks & negate(starts) & negate(stops)
        # Half a bit to the middle of the start bit, a whole one from middle to middle.
        timer = where(counts, timer - 1, where(looks, self.clocks_per_bit - 1, timer))
        return {
            "slot": where(back, 0, onward),
            "timer": where(idle, self.clocks_per_bit // 2 - 1, timer),
            "shift": where(bit, (state["shift"] >> 1) + (rx << 7), state["shift"]),
            "received": where(ends, 1, state["received"] & negate(inputs["bytes_ready"])),
            "broken": where(ends, negate(rx), state["broken"]),
        }


@dataclass(frozen=True)
class UartTransmitter:
    """Bytes to a line.

    Attributes
    ----------
    clocks_per_bit : int
        N.
    """

    clocks_per_bit: int

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        timer = (self.clocks_per_bit - 1).bit_length()
        widths = {"line": 1, "shift": 9, "left": 4, "timer": timer}
        return {name: (bits, False) for name, bits in widths.items()}

    def reset(self) -> State:
        """Give the state after reset: nothing to send, the line 1."""
        return dict.fromkeys(self.registers(), 0) | {"line": 1}

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        return {
            "tx": state["line"],
            "bytes_ready": equal(state["left"], 0) & equal(state["timer"], 0),
        }

    def step(self, state: State, inputs: dict[str, Value]) -> State:
        """Give the state after one clock; ``inputs``: ``bytes`` and ``bytes_valid``."""
        over = equal(state["timer"], 0)
        bit = over & less(0, state["left"])
        takes = self.outputs(state)["bytes_ready"] & inputs["bytes_valid"]
        whole = self.clocks_per_bit - 1
        return {
            "line": where(takes, 0, where(bit, state["shift"] & 1, state["line"])),
            "shift": where(
                takes, inputs["bytes"] + 256, where(bit, state["shift"] >> 1, state["shift"])
            ),
            "left": where(takes, 9, where(bit, state["left"] - 1, state["left"])),
            "timer": where(takes | bit, whole, where(over, 0, state["timer"] - 1)),
        }
