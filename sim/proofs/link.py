"""Promises of the link: what is acted on, when, and how often, whatever bytes come.

They are shown of the golden model's own source, which the RTL is proven equal to: an invariant
holds after reset and survives every clock from every state that satisfies it, whatever the inputs;
the promises follow. Ghost values keep the history of the bytes themselves:

- ``bytes``: how many came since the last flag, escapes undone, up to 2^15; ``crc`` over them;
  ``first``, ``second``: the type and the number; ``byte_0`` and on: those behind;
- ``bad``: one of them was received with an error; ``escape``: the last one was an escape;
- ``flag``: a flag came in the clock before, with ``bytes`` and so on as they were then, in
  ``flag_bytes`` and so on;
- ``handed``: blocks that were handed over since reset, modulo 256.
"""

import z3

from discreta.sim.golden.link import SETTINGS, TYPES, Link, crc
from discreta.sim.golden.logic import Value
from discreta.sim.smt import Obligation, same, symbols

__all__ = ["promises"]

_FLAG, _ESCAPE, _FLIP = 126, 125, 32
_MANY = 2**15
_RESIDUE = 0xDEBB20E3
_AROUND = 6
_PULSES = ("single", "stop", "emergency", "clear")
_STAGES = _IDLE, _OPENING, _BODY, _CHECK, _CLOSING = range(5)


def promises(golden: Link) -> list[Obligation]:
    """Give everything that is promised of the link."""
    return _Clock(golden).obligations()


class _Clock:
    """One clock of the link: state and inputs, the state after it, and the ghosts of both."""

    def __init__(self, golden: Link):
        self.golden = golden
        self.size = golden.room_for
        kinds, inputs, ghosts = golden.registers(), golden.inputs(), self._ghost_kinds()
        self.wide = max(bits for bits, _ in (kinds | inputs | ghosts).values()) + 4
        self.state, self.inputs = symbols(kinds, self.wide), symbols(inputs, self.wide)
        named = symbols({f"ghost.{name}": kind for name, kind in ghosts.items()}, self.wide)
        self.ghosts = {name.removeprefix("ghost."): value for name, value in named.items()}
        self.out = golden.outputs(self.state)
        self.after = golden.step(self.state, self.inputs)
        self.later = golden.outputs(self.after)
        self.taken = z3.And(self.out["blocks_valid"] == 1, self.inputs["blocks_ready"] == 1)
        self.ghosts_after = self._ghosts_after()
        self.arrived = self.state["arrived"] == 1
        self.session = self.state["session"] != 0

    def _ghost_kinds(self) -> dict[str, tuple[int, bool]]:
        widths = {"bytes": 16, "crc": 32, "first": 8, "second": 8, "bad": 1, "escape": 1}
        widths |= {f"byte_{k}": 8 for k in range(self.size)}
        widths |= {f"flag_{name}": bits for name, bits in widths.items()}
        return {name: (bits, False) for name, bits in (widths | {"flag": 1, "handed": 8}).items()}

    def _ghosts_after(self) -> dict[str, Value]:
        """Say what the bytes are, without a look at the link."""
        ghosts, byte = self.ghosts, self.inputs["bytes_data"]
        good = z3.And(self.inputs["bytes_valid"] == 1, self.inputs["bytes_error"] == 0)
        broken = z3.And(self.inputs["bytes_valid"] == 1, self.inputs["bytes_error"] == 1)
        flag = z3.And(good, byte == _FLAG)
        escape = z3.And(good, byte == _ESCAPE)
        inside = z3.And(good, byte != _FLAG, byte != _ESCAPE)
        meant = z3.If(ghosts["escape"] == 1, byte ^ _FLIP, byte)
        count = ghosts["bytes"]
        at = {"first": 0, "second": 1} | {f"byte_{k}": 2 + k for k in range(self.size)}
        after = {
            "bytes": z3.If(
                flag, self.number(0), z3.If(z3.And(inside, count < _MANY), count + 1, count)
            ),
            "crc": z3.If(
                flag,
                self.number(2**32 - 1),
                z3.If(inside, crc(ghosts["crc"], meant), ghosts["crc"]),
            ),
            "bad": z3.If(broken, self.number(1), z3.If(flag, self.number(0), ghosts["bad"])),
            "escape": z3.If(
                escape,
                self.number(1),
                z3.If(z3.Or(flag, inside), self.number(0), ghosts["escape"]),
            ),
        }
        after |= {
            name: z3.If(z3.And(inside, count == place), meant, ghosts[name])
            for name, place in at.items()
        }
        kept = {f"flag_{name}": z3.If(flag, ghosts[name], ghosts[f"flag_{name}"]) for name in after}
        handed = z3.If(self.taken, (ghosts["handed"] + 1) & 255, ghosts["handed"])
        return after | kept | {"flag": self.bit(flag), "handed": handed}

    def number(self, value: int) -> z3.BitVecRef:
        """Give a number as the symbols are."""
        return z3.BitVecVal(value, self.wide)

    def bit(self, condition: z3.BoolRef) -> z3.BitVecRef:
        """Give a condition as 0 or 1."""
        return z3.If(condition, self.number(1), self.number(0))

    def payload(self, state: dict, ghosts: dict, prefix: str, count: Value) -> z3.BoolRef:
        """Say that what is stored of a frame is its payload, its last byte on top.

        ``count``: bytes that have come of it.
        """
        facts = []
        for kind, length in self.golden.sizes.items():
            of_kind = ghosts[f"{prefix}first"] == TYPES[kind]
            for stored in range(length + 1):
                # With all of the payload stored the checksum may have come, too.
                here = count == 2 + stored if stored < length else count >= 2 + length
                equal = [
                    state[f"payload_{self.size - stored + k}"] == ghosts[f"{prefix}byte_{k}"]
                    for k in range(stored)
                ]
                facts.append(z3.Implies(z3.And(of_kind, here), z3.And(equal)))
        return z3.And(facts)

    def whole(self, ghosts: dict) -> z3.BoolRef:
        """Say that what came before the last flag was a whole frame, of a type that there is."""
        right = [
            z3.And(ghosts["flag_first"] == TYPES[kind], ghosts["flag_bytes"] == _AROUND + length)
            for kind, length in self.golden.sizes.items()
        ]
        return z3.And(
            ghosts["flag"] == 1,
            z3.Or(right),
            ghosts["flag_crc"] == _RESIDUE,
            ghosts["flag_bad"] == 0,
            ghosts["flag_escape"] == 0,
        )

    def invariant(self, state: dict, ghosts: dict) -> dict[str, z3.BoolRef]:
        """Give what is true of a state in every clock."""
        count, most = ghosts["bytes"], _AROUND + self.size + 1
        nothing = z3.And(
            ghosts["flag_bytes"] == 0, ghosts["flag_bad"] == 0, ghosts["flag_escape"] == 0
        )
        behind = z3.And(ghosts["flag"] == 1, ghosts["bytes"] == 0)
        # The byte of the answer that is sent next, but for escapes.
        check = self.number(255) - (state["proof"] & 255)
        plain = z3.If(state["stage"] == _BODY, state["answer_0"], check)
        return {
            "ghosts": z3.And(count <= _MANY, ghosts["flag_bytes"] <= _MANY),
            "count": state["count"] == z3.If(count > most, self.number(most), count),
            "checksum": state["checksum"] == ghosts["crc"],
            "preset": z3.Implies(count == 0, ghosts["crc"] == 2**32 - 1),
            "spoilt": state["spoilt"] == ghosts["bad"],
            "escaped": state["escaped"] == ghosts["escape"],
            "kind": z3.Implies(count >= 1, state["kind"] == ghosts["first"]),
            "number": z3.Implies(count >= 2, state["number"] == ghosts["second"]),
            "payload": self.payload(state, ghosts, "", count),
            "just ended": z3.Implies(ghosts["flag"] == 1, count == 0),
            "ended kind": z3.Implies(
                z3.And(behind, ghosts["flag_bytes"] >= 1), state["kind"] == ghosts["flag_first"]
            ),
            "ended number": z3.Implies(
                z3.And(behind, ghosts["flag_bytes"] >= 2), state["number"] == ghosts["flag_second"]
            ),
            "ended payload": z3.Implies(
                behind, self.payload(state, ghosts, "flag_", ghosts["flag_bytes"])
            ),
            "arrived": (state["arrived"] == 1) == self.whole(ghosts),
            "damaged": (state["damaged"] == 1)
            == z3.And(ghosts["flag"] == 1, z3.Not(self.whole(ghosts)), z3.Not(nothing)),
            "handed": state["next_block"] == ghosts["handed"],
            "stage": state["stage"] <= _CLOSING,
            "flipped": z3.Implies(
                state["flipped"] == 1,
                z3.And(
                    z3.Or(state["stage"] == _BODY, state["stage"] == _CHECK),
                    z3.Or(plain == _FLAG, plain == _ESCAPE),
                ),
            ),
        }

    def obligations(self) -> list[Obligation]:
        """Give everything that is promised."""
        golden = self.golden
        reset = {name: self.number(value) for name, value in golden.reset().items()}
        zero = dict.fromkeys(self.ghosts, self.number(0))
        zero |= dict.fromkeys(("crc", "flag_crc"), self.number(2**32 - 1))
        self.known = list(self.invariant(self.state, self.ghosts).values())
        return [
            Obligation("invariant: holds after reset", [], self.invariant(reset, zero)),
            Obligation(
                "invariant: survives every clock, whatever the inputs",
                self.known,
                self.invariant(self.after, self.ghosts_after),
            ),
            *self._blocks(),
            *self._commands(),
            *self._others(),
            *self._answers(),
        ]

    def _field(self, fields, prefix: str) -> dict[str, Value]:
        """Give fields as the bits of the bytes of the frame that has just ended."""
        values, first = {}, 0
        for name, bits, signed in fields:
            pieces = []
            for k in range(first, first + bits):
                byte = self.ghosts[f"{prefix}byte_{k // 8}"]
                pieces.append(z3.Extract(k % 8, k % 8, byte))
            value = z3.Concat(*reversed(pieces)) if bits > 1 else pieces[0]
            extend = z3.SignExt if signed else z3.ZeroExt
            values[name] = extend(self.wide - bits, value)
            first += bits
        return values

    def _is(self, *kinds: str) -> z3.BoolRef:
        """Say that a whole frame of one of these types ended in the clock before."""
        first = self.ghosts["flag_first"]
        return z3.And(self.whole(self.ghosts), z3.Or([first == TYPES[kind] for kind in kinds]))

    def _blocks(self) -> list[Obligation]:
        """Give what is promised of blocks."""
        state, after, ghosts, out = self.state, self.after, self.ghosts, self.out
        offered = out["blocks_valid"] == 1
        due = ghosts["flag_second"] == state["next_block"]
        shown = {
            f"blocks_{name}": value
            for name, value in self._field(self.golden.blocks, "flag_").items()
        }
        return [
            Obligation(
                "a block is offered in the clock after the flag of a whole frame, and then only: "
                "its bytes came without an error, as many as a block has, with the right CRC-32, "
                "in a session, and its number is the next",
                self.known,
                [offered == z3.And(self._is("BLOCK"), self.session, due)],
            ),
            Obligation(
                "a block is offered as it was sent: its fields are the bits of the frame's bytes",
                [*self.known, offered],
                {name: out[name] == value for name, value in shown.items()},
            ),
            Obligation(
                "no block is lost, none handed over twice: the next number goes on by one with a "
                "block that is taken, and with nothing else",
                self.known,
                [
                    after["next_block"]
                    == z3.If(self.taken, (state["next_block"] + 1) & 255, state["next_block"])
                ],
            ),
            Obligation(
                "a repeated block, one of the last 128, is not offered and not counted as dropped",
                [
                    *self.known,
                    self._is("BLOCK"),
                    (state["next_block"] - 1 - ghosts["flag_second"]) & 255 < 128,
                ],
                [z3.Not(offered), after["dropped"] == state["dropped"]],
            ),
        ]

    def _commands(self) -> list[Obligation]:
        """Give what is promised of commands."""
        state, after, ghosts, out = self.state, self.after, self.ghosts, self.out
        commands = ("SET", "HOLD", "RESUME", "SINGLE", "STOP", "CLEAR")
        due = z3.And(self.session, ghosts["flag_second"] == state["next_command"])
        acts = z3.And(self._is(*commands), due)
        given = self._field(SETTINGS, "flag_")
        sets = z3.And(self._is("SET"), due)
        held = z3.If(
            z3.And(self._is("HOLD"), due),
            self.number(1),
            z3.If(z3.And(self._is("RESUME"), due), self.number(0), state["held"]),
        )
        return [
            Obligation(
                "a command acts once: in the clock after a whole frame of it whose number is the "
                "next, in a session; then the next number goes on by one",
                self.known,
                {
                    name: (out[name] == 1) == z3.And(self._is(name.upper()), due)
                    for name in ("single", "stop", "clear")
                }
                | {
                    "number": after["next_command"]
                    == z3.If(acts, (state["next_command"] + 1) & 255, state["next_command"]),
                    "held": after["held"] == held,
                },
            ),
            Obligation(
                "SET sets all settings at once, to the bits of the frame's bytes; nothing else "
                "changes them",
                self.known,
                {
                    name: after[f"set_{name}"] == z3.If(sets, given[name], state[f"set_{name}"])
                    for name, _, _ in SETTINGS
                },
            ),
            Obligation(
                "an emergency acts in the clock after its flag, whatever its number is and with or "
                "without a session; nothing but a whole frame is one",
                self.known,
                [(out["emergency"] == 1) == self._is("EMERGENCY")],
            ),
        ]

    def _others(self) -> list[Obligation]:
        """Give what is promised of sessions, and of frames that are not acted on."""
        state, after, out = self.state, self.after, self.out
        hello = self._is("HELLO")
        told = self._field((("fingerprint", 32, False),), "flag_")["fingerprint"]
        right = told == self.golden.fingerprint
        opened = z3.If(right, self.ghosts["flag_second"], self.number(0))
        kept = (
            "session",
            "next_block",
            "next_command",
            "held",
            *(f"set_{s}" for s, *_ in SETTINGS),
        )
        return [
            Obligation(
                "a session is opened by a whole HELLO with this very fingerprint alone, and closed "
                "by one with another; numbers and settings go on as they are",
                self.known,
                {
                    "session": after["session"] == z3.If(hello, opened, state["session"]),
                    **{
                        name: z3.Implies(hello, after[name] == state[name])
                        for name in kept
                        if name != "session"
                    },
                },
            ),
            Obligation(
                "what is no whole frame does nothing: no block, no command, and all stays as it is",
                [*self.known, z3.Not(self.whole(self.ghosts))],
                {name: out[name] == 0 for name in ("blocks_valid", *_PULSES)}
                | {name: after[name] == state[name] for name in kept},
            ),
            Obligation(
                "before any session nothing moves: no block and no command but an emergency",
                [*self.known, z3.Not(self.session)],
                {name: out[name] == 0 for name in ("blocks_valid", "single", "stop", "clear")}
                | {name: after[name] == state[name] for name in kept if name != "session"},
            ),
        ]

    def _answers(self) -> list[Obligation]:
        """Give what is promised of answers."""
        golden, state, after, out = self.golden, self.state, self.after, self.out
        asked = z3.Or(state["arrived"] == 1, state["damaged"] == 1)
        begins = z3.And(state["due"] == 1, state["stage"] == _IDLE)
        sent = z3.And(out["answers_valid"] == 1, self.inputs["answers_ready"] == 1)
        told, first = {}, 0
        for name, bits, signed in golden.status:
            pieces = [
                z3.Extract(k % 8, k % 8, after[f"answer_{1 + k // 8}"])
                for k in range(first, first + bits)
            ]
            value = z3.Concat(*reversed(pieces)) if bits > 1 else pieces[0]
            told[name] = (z3.SignExt if signed else z3.ZeroExt)(self.wide - bits, value)
            first += bits
        now = {name: self.inputs[name] for name, *_ in golden.status if name in self.inputs}
        now |= {name: state[name] for name in ("session", "next_block", "next_command", "dropped")}
        now |= {"done": state["done_count"], "held": state["held"]}
        now |= {"emergency": self.inputs["button"]}
        now["busy"] = self.inputs["busy"] | self.inputs["done"]
        free = golden.depth - state["unanswered"]
        free = z3.If(free < 0, self.number(0), z3.If(free > 255, self.number(255), free))
        between = z3.Or(state["stage"] == _OPENING, state["stage"] == _CLOSING)
        return [
            Obligation(
                "every frame that ends, whole or not, is answered: an answer that begins behind it "
                "is due until it begins",
                self.known,
                {
                    "asked": z3.Implies(asked, after["due"] == 1),
                    "kept": z3.Implies(
                        z3.And(state["due"] == 1, z3.Not(begins)), after["due"] == 1
                    ),
                    "begins": z3.Implies(begins, after["stage"] == _OPENING),
                },
            ),
            Obligation(
                "an answer tells what was so in the clock in which it began",
                [*self.known, begins],
                {name: told[name] == value for name, value in now.items()}
                | {"room": told["room"] == free, "type": after["answer_0"] == 128},
            ),
            Obligation(
                "an answer: flags only around it, an escape before every byte that looks like one, "
                "and no byte changes while it waits",
                self.known,
                {
                    "flags": z3.Implies(
                        out["answers_valid"] == 1, (out["answers"] == _FLAG) == between
                    ),
                    "escape": z3.Implies(
                        z3.And(sent, out["answers"] == _ESCAPE), after["flipped"] == 1
                    ),
                    "behind": z3.Implies(
                        z3.And(sent, out["answers"] != _ESCAPE), after["flipped"] == 0
                    ),
                    "waits": z3.Implies(
                        z3.And(out["answers_valid"] == 1, z3.Not(sent)),
                        z3.And(
                            self.later["answers_valid"] == 1,
                            *same({"b": self.later["answers"]}, {"b": out["answers"]}).values(),
                        ),
                    ),
                },
            ),
            Obligation(
                "an answer ends: each byte that is taken goes on to the next stage, or leaves less",
                [*self.known, sent, out["answers"] != _ESCAPE],
                [
                    z3.Or(
                        after["stage"]
                        == z3.If(state["stage"] == _CLOSING, _IDLE, state["stage"] + 1),
                        z3.And(
                            after["stage"] == state["stage"], after["left"] == state["left"] - 1
                        ),
                    )
                ],
            ),
        ]
