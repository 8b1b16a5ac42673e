# amaranth: UnusedElaboratable=no
"""Bits for an FPGA: the same again, and only where they keep their clock."""

import json
import subprocess
import tempfile
from pathlib import Path

import pytest
from amaranth import ClockDomain, ClockSignal, Elaboratable, Module, Signal

from discreta.sim import bitstream
from discreta.sim.bitstream import RUNS, build
from discreta.sim.fpga import FPGAS, SynthesisError
from tests.hdl.parts.clocked import assert_refused
from tests.sim.test_synth import needs_boards

#: Places of pins that there are.
PINS = {
    "hx1k": "set_io clk 21\nset_io q 99\n",
    "ecp5-25k": 'LOCATE COMP "clk" SITE "G2";\nLOCATE COMP "q" SITE "B2";\n'
    'IOBUF PORT "clk" IO_TYPE=LVCMOS33;\nIOBUF PORT "q" IO_TYPE=LVCMOS33;\n',
    "gw1n-9": 'IO_LOC "clk" 52;\nIO_LOC "q" 25;\n',
}


class Blink(Elaboratable):
    """A counter whose highest bit is put out."""

    def __init__(self, bits=8):
        self.clk, self.q, self.counter = Signal(name="clk"), Signal(name="q"), Signal(bits)

    def elaborate(self, _):
        m = Module()
        m.domains += ClockDomain("sync")
        m.d.comb += [ClockSignal().eq(self.clk), self.q.eq(self.counter[-1])]
        m.d.sync += self.counter.eq(self.counter + 1)
        return m


def made(fpga="hx1k", bits=8, clock=12, seeds=(1,), **options):
    blink = Blink(bits)
    return build(blink, [blink.clk, blink.q], fpga, PINS[fpga], clock, seeds, **options)


@needs_boards
@pytest.mark.parametrize("fpga", PINS)
def test_the_same_input_gives_the_same_bits(fpga):
    went = []
    first = made(fpga, progress=lambda: went.append(None))
    assert len(went) == RUNS
    assert made(fpga) == first
    assert len(first.bits) > 10_000
    assert first.used["pins"] == 2
    assert first.used.keys() == first.available.keys() <= FPGAS[fpga].places.keys()
    assert all(first.used[what] <= there for what, there in first.available.items())
    assert max(first.used.values()) >= 8
    assert first.clock == 12
    assert first.margin == pytest.approx(100 * (first.fmax - 12) / 12)
    assert first.margin > 100


@needs_boards
def test_other_seeds_and_other_circuits_give_other_bits():
    bits = {made(bits=24, seeds=(seed,)).bits for seed in (1, 2)} | {made(bits=25).bits}
    assert len(bits) == 3


@needs_boards
def test_no_bits_below_the_clock_whatever_the_seed():
    with pytest.raises(SynthesisError) as error:
        made(bits=64, clock=400, seeds=(1, 2))
    first, second = (made(bits=64, seeds=(seed,)).fmax for seed in (1, 2))
    # Where more is asked for nextpnr tries harder, so only the words are known.
    assert str(error.value).startswith("it does not reach its clock of 400 MHz: ")
    assert str(error.value).endswith(" MHz with seed 2")
    assert max(first, second) < 400


def _reports(monkeypatch, fmax):
    """Place nothing: report a clock, by seed, or never come to an end where that is None."""

    class Runner:
        def __init__(self, folder, *_):
            self.folder, self.seconds = Path(folder), None

        def __call__(self, command, *, seconds=None):
            if "--seed" in command:
                assert seconds == bitstream.SECONDS
                reached = fmax[int(command[command.index("--seed") + 1])]
                if reached is None:
                    raise TimeoutError
                if isinstance(reached, str):
                    (self.folder / "0.log").write_text("SB_IO: 2/ 96\n")
                    raise SynthesisError(reached)
                report = {"fmax": {"clk": {"achieved": reached}}}
                (self.folder / "report.json").write_text(json.dumps(report))
                self.reached = reached
            else:
                (self.folder / "top.bin").write_bytes(str(getattr(self, "reached", "")).encode())
            return ["SB_IO: 2/ 96\n"]

    monkeypatch.setattr(bitstream, "Runner", Runner)
    monkeypatch.setattr(bitstream, "check_tools", lambda *_, **__: None)


def test_the_first_seed_that_reaches_the_clock_counts(monkeypatch):
    _reports(monkeypatch, {1: 11.9, 2: None, 3: 12.5, 4: 20.0})
    found = made(seeds=(1, 2, 3, 4))
    assert (found.seed, found.fmax, found.bits) == (3, 12.5, b"12.5")
    assert (found.used, found.available) == ({"pins": 2}, {"pins": 96})


def test_every_seed_that_does_not_is_named(monkeypatch):
    _reports(monkeypatch, {1: 11.994, 2: None})
    with pytest.raises(SynthesisError) as error:
        made(seeds=(1, 2))
    said = "it does not reach its clock of 12 MHz: 11.99 MHz with seed 1, no end with seed 2"
    assert str(error.value) == said


def test_another_seed_may_find_a_place(monkeypatch):
    crowded = "Unable to find legal placement for all cells, design is probably at its limit."
    _reports(monkeypatch, {1: crowded, 2: 12.5})
    assert made(seeds=(1, 2)).seed == 2
    said = "it does not reach its clock of 12 MHz: no place for all cells with seed 1"
    assert_refused((SynthesisError, said), made)
    # Any other complaint is the same with every seed.
    _reports(monkeypatch, {1: "cell 'q' is no pin", 2: 12.5})
    assert_refused((SynthesisError, "cell 'q' is no pin"), lambda: made(seeds=(1, 2)))


@needs_boards
def test_what_does_not_fit_says_how_much_it_is():
    class Large(Blink):
        def elaborate(self, _):
            m = super().elaborate(None)
            more = Signal(1400)
            m.d.sync += more.eq((more << 1) ^ (more << 2) ^ self.counter[0])
            m.d.comb += self.q.eq(more[-1])
            return m

    large = Large()
    with pytest.raises(SynthesisError, match=r"^it does not fit: 1[34]\d\d logic cells of 1280$"):
        build(large, [large.clk, large.q], "hx1k", PINS["hx1k"], 12)


@needs_boards
def test_a_placement_without_end_is_ended(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(bitstream, "SECONDS", 0)
    started = []

    class Popen(subprocess.Popen):
        def __init__(self, *args, **kwargs):
            super().__init__(*args, **kwargs)
            started.append(self)

    monkeypatch.setattr(subprocess, "Popen", Popen)
    with pytest.raises(SynthesisError, match="no end with seed 1, no end with seed 2"):
        made(seeds=(1, 2))
    assert [process.returncode for process in started] == [0, -9, -9]
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_asked():
    choose = " or ".join(map(repr, FPGAS))
    blink = Blink()
    message = f"FPGA is 'hx4k': choose {choose}"
    assert_refused((ValueError, message), lambda: build(blink, [], "hx4k", "", 12))
    message = "seeds are none: give one or more whole numbers"
    assert_refused((ValueError, message), lambda: build(blink, [], "hx1k", "", 12, ()))
