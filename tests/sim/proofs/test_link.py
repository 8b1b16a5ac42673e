# amaranth: UnusedElaboratable=no
# (What cannot be equal need not be elaborated.)
"""The link and the ends of its line are their golden models and keep their promises."""

from dataclasses import dataclass

import pytest
import z3

from discreta.hdl.device import exact_layout
from discreta.hdl.link import fingerprint, layout_fields
from discreta.sim.golden.link import Link as Golden
from discreta.sim.golden.logic import equal, negate, where
from discreta.sim.golden.uart import UartReceiver, UartTransmitter
from discreta.sim.proofs.link import promises
from discreta.sim.proofs.uart import promises as uart_promises
from discreta.sim.smt import check, equivalence
from discreta.sim.units import UNITS


def failures(obligations):
    return [verdict for verdict in map(check, obligations) if not verdict.holds]


@pytest.mark.parametrize(
    ("width", "axes", "kinds", "depth"),
    [(4, 2, ("line",), 1), (8, 3, ("line", "arc"), 300), (16, 2, ("line", "arc"), 16)],
    ids=str,
)
def test_the_link_is_the_golden_model_and_keeps_its_promises(width, axes, kinds, depth):
    link = UNITS["link"]
    golden = link.model(width, axes, kinds=kinds, depth=depth)
    obligations = equivalence(link.core(width, axes, kinds=kinds, depth=depth), golden)
    obligations += promises(golden)
    assert len(obligations) == 4 + 16
    assert failures(obligations) == []


@pytest.mark.parametrize("name", ["uart_receiver", "uart_transmitter"])
@pytest.mark.parametrize("clocks", [4, 7, 104])
def test_the_ends_of_a_line(name, clocks):
    unit = UNITS[name]
    obligations = equivalence(
        unit.core(8, clocks_per_bit=clocks), unit.model(8, clocks_per_bit=clocks)
    )
    assert failures(obligations) == []


@pytest.mark.parametrize("clocks", [4, 5])
def test_every_byte(clocks):
    for golden in (UartReceiver(clocks), UartTransmitter(clocks)):
        assert failures(uart_promises(golden)) == []


def make(model=Golden):
    layout = exact_layout(4, 2, ("line",))
    return model(tuple(layout_fields(layout)), fingerprint(layout), 4, 2, 4)


def test_the_promises_rest_on_nothing_that_cannot_be():
    """No promise holds because its assumptions contradict each other."""
    for obligation in promises(make()):
        solver = z3.Solver()
        solver.add(*obligation.assumptions)
        assert solver.check() == z3.sat, obligation.title


@dataclass(frozen=True)
class LengthIgnored(Golden):
    def whole(self, state):
        right = equal(state["checksum"], 0xDEBB20E3)
        return right & negate(state["escaped"]) & negate(state["spoilt"])


@dataclass(frozen=True)
class ChecksumIgnored(Golden):
    def whole(self, state):
        right = equal(state["count"], self.expected(state))
        return right & negate(state["escaped"]) & negate(state["spoilt"])


@dataclass(frozen=True)
class ErrorsIgnored(Golden):
    def whole(self, state):
        return super().whole(state | {"spoilt": 0 * state["spoilt"]})


@dataclass(frozen=True)
class ChecksumNotPreset(Golden):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        return after | {"checksum": where(after["arrived"], 0, after["checksum"])}


@dataclass(frozen=True)
class NumberIgnored(Golden):
    def outputs(self, state):
        return super().outputs(state | {"next_block": state["number"]})


@dataclass(frozen=True)
class NumberGoesOnUntaken(Golden):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        offered = self.outputs(state)["blocks_valid"]
        return after | {"next_block": (state["next_block"] + offered) & 255}


@dataclass(frozen=True)
class SessionIgnored(Golden):
    def _open(self, state):
        return 0 * state["session"] + 1


@dataclass(frozen=True)
class AnyHelloOpens(Golden):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        hello = state["arrived"] & self.of(state, "HELLO")
        return after | {"session": where(hello, state["number"], after["session"])}


@dataclass(frozen=True)
class HelloBeginsAtZero(Golden):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        hello = state["arrived"] & self.of(state, "HELLO")
        return after | {"next_block": where(hello, 0, after["next_block"])}


@dataclass(frozen=True)
class RepeatedCommandActs(Golden):
    def acts(self, state):
        again = equal((state["number"] + 1) & 255, state["next_command"])
        return super().acts(state) | (self._numbered(state) & self._open(state) & again)


@dataclass(frozen=True)
class EmergencyWaitsForASession(Golden):
    def outputs(self, state):
        out = super().outputs(state)
        return out | {"emergency": out["emergency"] & self._open(state)}


@dataclass(frozen=True)
class PayloadFromTheBottom(Golden):
    def outputs(self, state):
        turned = {f"payload_{k}": state[f"payload_{self.room_for - 1 - k}"] for k in range(13)}
        return super().outputs(state | turned)


@dataclass(frozen=True)
class DamagedNotAnswered(Golden):
    def step(self, state, inputs):
        return super().step(state | {"damaged": 0 * state["damaged"]}, inputs)


@dataclass(frozen=True)
class StatusLate(Golden):
    def _told(self, state, inputs):
        return super()._told(state | {"next_block": (state["next_block"] - 1) & 255}, inputs)


@dataclass(frozen=True)
class NoEscape(Golden):
    def _escapes(self, state):
        return 0 * state["flipped"]


@dataclass(frozen=True)
class RepeatedCounted(Golden):
    def step(self, state, inputs):
        after = super().step(state, inputs)
        block = (
            state["arrived"] & self.of(state, "BLOCK") & negate(self.outputs(state)["blocks_valid"])
        )
        return after | {"dropped": where(block, (state["dropped"] + 1) & 255, after["dropped"])}


BROKEN = [
    (LengthIgnored, "invariant: survives"),
    (ChecksumIgnored, "invariant: survives"),
    (ErrorsIgnored, "invariant: survives"),
    (ChecksumNotPreset, "invariant: survives"),
    (NumberIgnored, "a block is offered in the clock after"),
    (NumberGoesOnUntaken, "no block is lost"),
    (SessionIgnored, "before any session nothing moves"),
    (AnyHelloOpens, "a session is opened"),
    (HelloBeginsAtZero, "a session is opened"),
    (RepeatedCommandActs, "a command acts once"),
    (EmergencyWaitsForASession, "an emergency acts"),
    (PayloadFromTheBottom, "a block is offered as it was sent"),
    (DamagedNotAnswered, "every frame that ends"),
    (StatusLate, "an answer tells"),
    (NoEscape, "an answer: flags only"),
    (RepeatedCounted, "a repeated block"),
]


@pytest.mark.parametrize(("model", "title"), BROKEN, ids=lambda it: getattr(it, "__name__", ""))
def test_a_broken_link_breaks_a_promise(model, title):
    (promise,) = [it for it in promises(make(model)) if it.title.startswith(title)]
    verdict = check(promise)
    assert not verdict.holds
    assert verdict.counterexample


@dataclass(frozen=True)
class LooksTooEarly(UartReceiver):
    """It looks at the edge of every bit."""

    def step(self, state, inputs):
        after = super().step(state, inputs)
        return after | {"timer": where(equal(state["slot"], 0), 0, after["timer"])}


@dataclass(frozen=True)
class StopBitIgnored(UartReceiver):
    def step(self, state, inputs):
        return super().step(state, inputs) | {"broken": 0 * state["broken"]}


@dataclass(frozen=True)
class ShortStopBit(UartTransmitter):
    def outputs(self, state):
        return super().outputs(state) | {"bytes_ready": equal(state["left"], 0)}

    def step(self, state, inputs):
        early = equal(state["left"], 0) & inputs["bytes_valid"]
        return super().step(state | {"timer": where(early, 0, state["timer"])}, inputs)


@pytest.mark.parametrize("model", [LooksTooEarly, StopBitIgnored, ShortStopBit])
def test_a_broken_end_of_a_line_breaks_a_promise(model):
    assert failures(uart_promises(model(4))) != []
