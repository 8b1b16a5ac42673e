"""Golden model of the link, one clock at a time: a byte in at most, and a byte out.

From the protocol in ``docs/link.md``. Frames begin and end with a flag (126); inside, a flag or an
escape (125) is sent as an escape and the byte with bit 5 changed. A frame has a type, a number, a
payload of its type's length, and a CRC-32 (as of zip), the lowest byte first.

A state is the frame that comes in (``count`` bytes so far, ``escaped`` and ``spoilt``, the CRC in
``checksum``, ``kind``, ``number``, ``payload_0`` and on, and for the clock after its end
``arrived`` or ``damaged``), the session (``session``, ``next_block``, ``next_command``,
``dropped``, the settings ``set_…``, ``held``, ``unanswered`` blocks, ``done_count``), and the
answer (``due``, its ``stage``, bytes ``left``, ``flipped`` behind an escape, its CRC in ``proof``,
``answer_0`` and on).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from discreta.sim.golden.logic import Value, equal, less, negate, where

__all__ = ["SETTINGS", "TYPES", "Field", "Link", "crc"]

State = dict[str, Value]
#: Name, bits, signed.
Field = tuple[str, int, bool]

TYPES = {
    "HELLO": 1,
    "QUERY": 2,
    "EMERGENCY": 3,
    "BLOCK": 4,
    "SET": 5,
    "HOLD": 6,
    "RESUME": 7,
    "SINGLE": 8,
    "STOP": 9,
    "CLEAR": 10,
}
_COMMANDS = ("SET", "HOLD", "RESUME", "SINGLE", "STOP", "CLEAR")
_STATUS = 128
_FLAG, _ESCAPE, _FLIP = 126, 125, 32
_AROUND = 6  # bytes of a frame beside its payload

SETTINGS: tuple[Field, ...] = (
    ("override", 9, False),
    ("acceleration", 40, False),
    ("pulse_length", 12, False),
    ("pulse_space", 12, False),
    ("direction_setup", 12, False),
    ("direction_hold", 12, False),
)

_IDLE, _OPENING, _BODY, _CHECK, _CLOSING = range(5)


def crc(before: Value, byte: Value) -> Value:
    """Give the CRC-32 after one more byte: bit by bit, as the standard says it."""
    value = before ^ byte
    for _ in range(8):
        value = where(value & 1, (value >> 1) ^ 0xEDB88320, value >> 1)
    return value


def _bytes(fields: Sequence[Field]) -> int:
    """Count the bytes of fields, one behind the other, filled up to a whole byte."""
    return -(-sum(bits for _, bits, _ in fields) // 8)


@dataclass(frozen=True)
class Link:
    """Frames to blocks and commands, and the status back.

    Attributes
    ----------
    blocks : tuple of (str, int, bool)
        The fields of a block, in order: name, bits, signed.
    fingerprint : int
        What a HELLO must carry, 32 bits.
    width, axes, depth : int
        Of the device: n, its axes, and blocks that wait in its queue.
    """

    blocks: tuple[Field, ...]
    fingerprint: int
    width: int
    axes: int
    depth: int

    @property
    def letters(self) -> str:
        """The axis letters."""
        return "xyzabc"[: self.axes]

    @cached_property
    def status(self) -> tuple[Field, ...]:
        """The fields of a status, in order."""
        counts = ("session", "next_block", "next_command", "room", "dropped")
        fields: list[Field] = [(name, 8, False) for name in counts]
        fields += [("done", 16, False), ("reason", 3, False)]
        fields += [(name, 1, False) for name in ("busy", "held", "emergency")]
        fields += [
            (f"{side}_limit_{a}", 1, False) for side in ("low", "high") for a in self.letters
        ]
        fields += [(f"position_{a}", self.width + 1, True) for a in self.letters]
        return tuple(fields)

    @cached_property
    def sizes(self) -> dict[str, int]:
        """Bytes of payload, by type."""
        own = {"HELLO": 4, "BLOCK": _bytes(self.blocks), "SET": _bytes(SETTINGS)}
        return dict.fromkeys(TYPES, 0) | own

    @cached_property
    def room_for(self) -> int:
        """Bytes of the longest payload."""
        return max(self.sizes.values())

    @cached_property
    def answer_size(self) -> int:
        """Bytes of an answer before its CRC."""
        return 1 + _bytes(self.status)

    def inputs(self) -> dict[str, tuple[int, bool]]:
        """Give width and sign of every input."""
        flags = ["bytes_error", "bytes_valid", "answers_ready", "blocks_ready"]
        flags += ["button", "busy", "done"]
        flags += [f"{side}_limit_{a}" for side in ("low", "high") for a in self.letters]
        kinds = {"bytes_data": (8, False), "reason": (3, False)} | dict.fromkeys(flags, (1, False))
        return kinds | {f"position_{a}": (self.width + 1, True) for a in self.letters}

    def registers(self) -> dict[str, tuple[int, bool]]:
        """Give the width in bits of every register and whether it is signed."""
        longest = _AROUND + self.room_for
        widths = {"count": (longest + 1).bit_length(), "escaped": 1, "spoilt": 1, "checksum": 32}
        widths |= {"kind": 8, "number": 8}
        widths |= {f"payload_{k}": 8 for k in range(self.room_for)}
        widths |= {"arrived": 1, "damaged": 1}
        widths |= dict.fromkeys(("session", "next_block", "next_command", "dropped"), 8)
        widths |= {"unanswered": (self.depth + 3).bit_length(), "done_count": 16}
        widths |= {f"set_{name}": bits for name, bits, _ in SETTINGS}
        widths |= {"held": 1, "due": 1, "stage": 3}
        widths |= {"left": (self.answer_size - 1).bit_length(), "flipped": 1, "proof": 32}
        widths |= {f"answer_{k}": 8 for k in range(self.answer_size)}
        return {name: (bits, False) for name, bits in widths.items()}

    def reset(self) -> State:
        """Give the state after reset: no session, nothing heard."""
        ones = 2**32 - 1
        return dict.fromkeys(self.registers(), 0) | {"checksum": ones, "proof": ones}

    def outputs(self, state: State) -> dict[str, Value]:
        """Give what the ports show in a state."""
        arrived = state["arrived"]
        offered = arrived & self.of(state, "BLOCK") & self._open(state)
        out = {"bytes_ready": 0 * arrived + 1, "heard": arrived}
        out |= {f"blocks_{name}": value for name, value in self._fields(state, self.blocks).items()}
        out["blocks_valid"] = offered & equal(state["number"], state["next_block"])
        out |= {name: state[f"set_{name}"] for name, _, _ in SETTINGS}
        out |= {"hold": state["held"]}
        acts = self.acts(state)
        for name in ("SINGLE", "STOP", "CLEAR"):
            out[name.lower()] = acts & self.of(state, name)
        out["emergency"] = arrived & self.of(state, "EMERGENCY")
        stage = state["stage"]
        between = equal(stage, _OPENING) | equal(stage, _CLOSING)
        byte, escapes = self._plain(state), self._escapes(state)
        inside = where(escapes, _ESCAPE, where(state["flipped"], byte ^ _FLIP, byte))
        out["answers"] = where(between, _FLAG, inside)
        out["answers_valid"] = negate(equal(stage, _IDLE))
        return out

    def step(self, state: State, inputs: dict[str, Value]) -> State:
        """Give the state after one clock; ``inputs``: those of :meth:`inputs`."""
        after = self._receive(state, inputs)
        after |= self._act(state, inputs)
        after |= self._answer(state, inputs)
        return after

    def of(self, state: State, name: str) -> Value:
        """Tell whether the frame is of a type."""
        return equal(state["kind"], TYPES[name])

    def acts(self, state: State) -> Value:
        """Tell whether the frame is a command that is the next one."""
        due = equal(state["number"], state["next_command"])
        return self._numbered(state) & self._open(state) & due

    def _open(self, state: State) -> Value:
        return negate(equal(state["session"], 0))

    def _numbered(self, state: State) -> Value:
        """Tell whether a command has arrived."""
        command: Value = 0
        for name in _COMMANDS:
            command = command | self.of(state, name)
        return state["arrived"] & command

    def _fields(self, state: State, fields: Sequence[Field]) -> dict[str, Value]:
        """Give the fields of a payload: it ends with the last byte that is stored."""
        first = 8 * (self.room_for - _bytes(fields))
        values = {}
        for name, bits, signed in fields:
            value: Value = 0
            for k in range(first // 8, (first + bits + 7) // 8):
                low = 8 * k - first
                byte = state[f"payload_{k}"]
                value = value + ((byte << low if low >= 0 else byte >> -low) & (2**bits - 1))
            values[name] = value - (value >> (bits - 1) << bits) if signed else value
            first += bits
        return values

    def expected(self, state: State) -> Value:
        """Give how many bytes a frame of this type has; 0 for a type that there is not."""
        length: Value = 0
        for name, size in self.sizes.items():
            length = where(self.of(state, name), _AROUND + size, length)
        return length

    def whole(self, state: State) -> Value:
        """Tell whether what has come so far is a whole frame."""
        right = equal(state["count"], self.expected(state)) & equal(state["checksum"], 0xDEBB20E3)
        return right & negate(state["escaped"]) & negate(state["spoilt"])

    def _receive(self, state: State, inputs: dict[str, Value]) -> State:
        """Take a byte in."""
        byte, count, escaped = inputs["bytes_data"], state["count"], state["escaped"]
        broken = inputs["bytes_valid"] & inputs["bytes_error"]
        good = inputs["bytes_valid"] & negate(inputs["bytes_error"])
        flag, escape = good & equal(byte, _FLAG), good & equal(byte, _ESCAPE)
        inside = good & negate(equal(byte, _FLAG)) & negate(equal(byte, _ESCAPE))
        byte = where(escaped, byte ^ _FLIP, byte)
        whole = self.whole(state)
        nothing = equal(count, 0) & negate(escaped) & negate(state["spoilt"])
        stored = inside & negate(less(count, 2)) & less(count + 4, self.expected(state))
        more = where(less(count, _AROUND + self.room_for + 1), count + 1, count)
        after = {
            "count": where(flag, 0, where(inside, more, count)),
            "escaped": where(escape, 1, where(flag | inside, 0, escaped)),
            "spoilt": where(broken, 1, where(flag, 0, state["spoilt"])),
            "checksum": where(
                flag, 2**32 - 1, where(inside, crc(state["checksum"], byte), state["checksum"])
            ),
            "kind": where(inside & equal(count, 0), byte, state["kind"]),
            "number": where(inside & equal(count, 1), byte, state["number"]),
            "arrived": flag & whole,
            "damaged": flag & negate(whole) & negate(nothing),
        }
        for k in range(self.room_for):
            following = byte if k == self.room_for - 1 else state[f"payload_{k + 1}"]
            after[f"payload_{k}"] = where(stored, following, state[f"payload_{k}"])
        return after

    def _act(self, state: State, inputs: dict[str, Value]) -> State:
        """Do what a frame says that has come whole."""
        arrived, acts = state["arrived"], self.acts(state)
        block = arrived & self.of(state, "BLOCK")
        taken = self.outputs(state)["blocks_valid"] & inputs["blocks_ready"]
        hello = arrived & self.of(state, "HELLO")
        told = self._fields(state, (("fingerprint", 32, False),))["fingerprint"]
        opened = where(equal(told, self.fingerprint), state["number"], 0)
        # Of the 256 numbers those of the last 128 frames are repeated ones.
        ahead = less((state["number"] - state["next_block"]) & 255, 128)
        command_ahead = less((state["number"] - state["next_command"]) & 255, 128)
        dropped = (
            state["damaged"]
            | (block & negate(taken) & ahead)
            | (self._numbered(state) & negate(acts) & command_ahead)
        )
        sets = acts & self.of(state, "SET")
        held = where(acts & self.of(state, "RESUME"), 0, state["held"])
        stands = negate(equal(inputs["reason"], 0))
        least = (1 << self.registers()["unanswered"][0]) - 1
        unanswered = (state["unanswered"] + taken - inputs["done"]) & least
        after = {
            "session": where(hello, opened, state["session"]),
            "next_block": (state["next_block"] + taken) & 255,
            "next_command": (state["next_command"] + acts) & 255,
            "dropped": (state["dropped"] + dropped) & 255,
            "unanswered": where(stands, 0, unanswered),
            "done_count": (state["done_count"] + inputs["done"]) & 65535,
            "held": where(acts & self.of(state, "HOLD"), 1, held),
        }
        for name, value in self._fields(state, SETTINGS).items():
            after[f"set_{name}"] = where(sets, value, state[f"set_{name}"])
        return after

    def _plain(self, state: State) -> Value:
        """Give the byte of the answer that is sent next, before escapes."""
        return where(equal(state["stage"], _BODY), state["answer_0"], (state["proof"] & 255) ^ 255)

    def _escapes(self, state: State) -> Value:
        """Tell whether an escape goes before it."""
        byte = self._plain(state)
        inside = equal(state["stage"], _BODY) | equal(state["stage"], _CHECK)
        return (equal(byte, _FLAG) | equal(byte, _ESCAPE)) & inside & negate(state["flipped"])

    def _told(self, state: State, inputs: dict[str, Value]) -> list[Value]:
        """Give the bytes of an answer that is begun now."""
        free = where(less(self.depth, state["unanswered"]), 0, self.depth - state["unanswered"])
        told = {name: state[name] for name in ("session", "next_block", "next_command", "dropped")}
        told |= {"room": where(less(255, free), 255, free), "done": state["done_count"]}
        told |= {"held": state["held"], "emergency": inputs["button"]}
        # A block that ends just now is not counted yet.
        told["busy"] = inputs["busy"] | inputs["done"]
        told |= {name: inputs[name] for name, _, _ in self.status if name not in told}
        answer: list[Value] = [0] * (self.answer_size - 1)
        first = 0
        for name, bits, _ in self.status:
            for k in range(first // 8, (first + bits + 7) // 8):
                low = first - 8 * k
                value = told[name] & (2**bits - 1)
                part = (value << low if low >= 0 else value >> -low) & 255
                answer[k] = answer[k] + part
            first += bits
        return [_STATUS, *answer]

    def _answer(self, state: State, inputs: dict[str, Value]) -> State:
        """Begin an answer, or send a byte of it."""
        stage, left = state["stage"], state["left"]
        begins = state["due"] & equal(stage, _IDLE)
        sent = negate(equal(stage, _IDLE)) & inputs["answers_ready"]
        escapes = self._escapes(state)
        body = sent & equal(stage, _BODY) & negate(escapes)
        check = sent & equal(stage, _CHECK) & negate(escapes)
        last = equal(left, 0)
        onward = where(body & last, _CHECK, where(check & last, _CLOSING, stage))
        onward = where(sent & equal(stage, _OPENING), _BODY, onward)
        over = sent & negate(less(stage, _CLOSING))
        size = self.answer_size
        counted = where(body & last, 3, (left - 1) & ((1 << (size - 1).bit_length()) - 1))
        proof = where(body, crc(state["proof"], self._plain(state)), state["proof"])
        after = {
            "due": (state["due"] & negate(begins)) | state["arrived"] | state["damaged"],
            "stage": where(begins, _OPENING, where(over, _IDLE, onward)),
            "left": where(begins, size - 1, where(body | check, counted, left)),
            "flipped": where(sent, escapes, state["flipped"]),
            "proof": where(begins, 2**32 - 1, where(check, state["proof"] >> 8, proof)),
        }
        told = self._told(state, inputs)
        for k in range(size):
            kept = state[f"answer_{k}"]
            following = kept if k == size - 1 else state[f"answer_{k + 1}"]
            after[f"answer_{k}"] = where(begins, told[k], where(body, following, kept))
        return after
