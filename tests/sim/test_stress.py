# amaranth: UnusedElaboratable=no
# (A device is compiled once, and found in the cache from then on.)
"""The stress run of the whole device: it is good, and no broken device is."""

from collections.abc import Callable

import pytest
from amaranth import Module, Signal
from amaranth.lib.wiring import In

from discreta.hdl.contract import Part
from discreta.hdl.device import Device
from discreta.sim.stress import Report, make_device, stress

#: How many blocks a good run has, and how many are enough to find what is broken, if the switches
#: of their seed happen to be active when a step leads there.
BLOCKS, ENOUGH = 1500, 400

#: What is broken, by the number that ``fault`` is set to, and what the report must say of it.
FAULTS = {
    1: ("pulses merge: the pin stays active over the space", "steps: step"),
    2: ("a step that follows another where x is 5 is dropped", "steps: step"),
    3: ("the position does not count up from 9", "position: "),
    4: ("the emergency stop is ignored", "emergency at clock"),
    5: ("the low limit switch of x is ignored", "limit: leading edge"),
    6: ("a hold lets go for some clocks", "hold from clock"),
    7: ("the direction is set up for a clock", "direction set-up"),
    8: ("behind a stop the next block begins a step beside", "steps: "),
    9: ("done comes twice for some blocks", "done: "),
    10: ("pulses are a clock short", "pulse length"),
    11: ("the reason is STOP for LIMIT", "reason: STOP"),
}


def amend(part: Part, change: Callable[[Module], None]) -> None:
    """Add assignments behind a part's own."""
    sound = part.elaborate

    def elaborate(platform):
        m = sound(platform)
        change(m)
        return m

    part.elaborate = elaborate


class Faulty(Part):
    """A device that is broken as ``fault`` says, 0: it is sound; one to compile for all of them."""

    def __init__(self, device: Device):
        super().__init__(dict(device.signature.members) | {"fault": In(4)})
        self.device = device
        self.registers: dict[str, Signal] = {}
        amend(device.pulse, self._break_pulses)
        amend(device.queue, self._break_queue)

    def _break_pulses(self, m: Module) -> None:
        pulse = self.device.pulse
        out, age, place = pulse.pulse["x"], pulse.age["x"], pulse.place["x"]
        with m.If(self.fault == 1):
            m.d.comb += pulse.pins.x.step.eq(out | (age <= pulse.space))
        with m.If((self.fault == 2) & pulse.launch & (place.register == 5)):
            m.d.sync += [pending.eq(0) for pending in pulse.pending.values()]
        with m.If((self.fault == 3) & (place.register == 9)):
            m.d.comb += place.up.eq(0)
        with m.If(self.fault == 7):
            m.d.sync += pulse.setup.eq(1)
        with m.If((self.fault == 10) & (pulse.pulse_length > 1) & ~pulse.busy):
            m.d.sync += pulse.length.eq(pulse.pulse_length - 1)

    def _break_queue(self, m: Module) -> None:
        queue = self.device.queue
        place = queue.place_registers["x"]
        with m.If((self.fault == 8) & queue.flush):
            m.d.sync += place.eq(queue.position.x ^ 1)

    def elaborate(self, platform):  # noqa: ARG002
        """Describe the hardware."""
        m = Module()
        device = self.device
        m.submodules.device = device
        turn = Signal(8)
        before = Signal()
        m.d.sync += [turn.eq(turn + 1), before.eq(device.done)]
        for path, member, inner in device.signature.flatten(device):
            outer = self
            for name in path:
                outer = getattr(outer, str(name))
            m.d.comb += inner.eq(outer) if member.flow == In else outer.eq(inner)
        with m.If(self.fault == 4):
            m.d.comb += device.emergency.eq(0)
        with m.If(self.fault == 5):
            m.d.comb += device.low_limit.x.eq(0)
        with m.If((self.fault == 6) & (turn < 24)):
            m.d.comb += device.hold.eq(0)
        with m.If((self.fault == 9) & before & turn[0]):
            m.d.comb += self.done.eq(1)
        with m.If((self.fault == 11) & (device.reason.as_value() == 3)):
            m.d.comb += self.reason.eq(1)
        return m


def make_faulty(width: int) -> Faulty:
    """Make a device that can be broken."""
    return Faulty(make_device(width))


def run(blocks: int, seed: int, fault: int = 0) -> Report:
    """Run a device that can be broken."""
    return stress(blocks, seed=seed, workers=1, make=make_faulty, inputs={"fault": fault})


@pytest.mark.usefixtures("optimized_engine")
@pytest.mark.parametrize("seed", [1, 2])
def test_a_run_is_good_and_meets_everything(seed):
    told = []
    report = stress(
        BLOCKS, seed=seed, workers=1, make=make_faulty, inputs={"fault": 0}, progress=told.append
    )
    assert report.differences == []
    assert report.violations == 0
    assert report.good
    assert BLOCKS <= report.blocks == sum(told)
    assert set(report.stops) == {
        *("NONE", "STOP", "EMERGENCY", "LIMIT"),
        *("RANGE", "OFF_CURVE", "SHARP"),
    }
    assert sum(report.stops.values()) == report.episodes
    assert report.blocks == sum(report.kinds.values())
    assert min(report.kinds[kind] for kind in ("line", "arc", "conic")) > BLOCKS // 10
    assert min(report.holds, report.singles) > 20
    # A diagonal step is two pulses.
    assert max(report.pulses) < report.steps < sum(report.pulses)
    rows = dict(report.rows())
    assert rows["differences"] == ""
    assert rows["blocks"] == f"{report.blocks:,}"


@pytest.mark.usefixtures("optimized_engine")
@pytest.mark.parametrize(("fault", "said"), [(n, said) for n, (_, said) in FAULTS.items()])
def test_a_broken_device_is_caught(fault, said):
    report = run(ENOUGH, seed=4, fault=fault)
    assert not report.good
    assert any(said in text for text in report.differences), report.differences
    assert len(report.differences) <= 20
    assert all("\n" not in text for text in report.differences)


@pytest.mark.usefixtures("optimized_engine")
def test_the_same_seed_gives_the_same_run():
    first, second = run(100, seed=5), run(100, seed=5)
    second.seconds = first.seconds
    assert first == second
    assert run(100, seed=6).steps != first.steps


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"width": 8}, "width is 8: choose 6 or 7"),
        ({"workers": 0}, "number of workers is 0: choose 1 or more"),
        ({"blocks": 0}, "number of blocks is 0: choose 1 or more"),
    ],
)
def test_what_is_refused(wrong, text):
    with pytest.raises(ValueError, match=text):
        stress(**{"blocks": 10, "seed": 1} | wrong)


def test_a_run_without_blocks_is_not_good():
    assert not Report().good
