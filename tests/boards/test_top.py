# amaranth: UnusedElaboratable=no
"""The top level: what reaches the controller, and what the pins show."""

from dataclasses import replace

import pytest
from amaranth import Module
from amaranth.hdl import Fragment
from amaranth.lib.wiring import In, Out
from amaranth.sim import Simulator

from discreta.boards import top as tops
from discreta.boards.catalogue import BOARDS
from discreta.boards.top import Top
from discreta.hdl.contract import Part, per_axis
from discreta.hdl.controller import leds_layout
from tests.hdl.parts.clocked import assert_refused

SWITCHES = ("low_x", "high_x", "low_y", "high_y", "stop")

every_board = pytest.mark.parametrize("board", BOARDS.values(), ids=BOARDS)


class Open(Part):
    """The ports of a controller, and a device that stands beside them."""

    def __init__(self, device, clocks_per_bit):
        self.device, self.clocks_per_bit = device, clocks_per_bit
        super().__init__(
            {
                "rx": In(1, init=1),
                "tx": Out(1),
                "low_limit": In(per_axis(2, 1)),
                "high_limit": In(per_axis(2, 1)),
                "emergency": In(1),
                "pins": Out(device.pins.shape()),
                "leds": Out(leds_layout()),
            }
        )

    def elaborate(self, _):
        m = Module()
        m.submodules.device = self.device
        return m


@pytest.fixture
def opened(monkeypatch):
    monkeypatch.setattr(tops, "Controller", Open)


def on_the_pins(board, normally_closed, bench):
    """Run a bench on a top level whose clock is the board's."""
    board = replace(board, clock=board.oscillator)
    top = Top(board, normally_closed=normally_closed)

    async def run(ctx):
        pins = {pin.port: pin for pin in board.pins}
        # Nothing is connected but the switches that are closed now, and the buttons' resistors.
        for port, pin in pins.items():
            if not pin.output:
                closed = normally_closed and port in SWITCHES
                ctx.set(top.ports[port], int(pin.low and not closed) | (port == "rx"))
        await bench(ctx, top, pins)

    simulator = Simulator(top)
    simulator.add_testbench(run)
    simulator.run()


def inputs(ctx, core):
    return {
        **{f"low_{a}": ctx.get(core.low_limit[a]) for a in "xy"},
        **{f"high_{a}": ctx.get(core.high_limit[a]) for a in "xy"},
        "stop": ctx.get(core.emergency),
    }


@pytest.mark.usefixtures("opened")
@pytest.mark.parametrize("normally_closed", [False, True])
@every_board
def test_every_switch_is_its_own_and_idle_where_nothing_acts(board, normally_closed):
    async def bench(ctx, top, pins):
        idle = dict.fromkeys(SWITCHES, 0)
        assert inputs(ctx, top.controller) == idle
        assert ctx.get(top.controller.rx) == 1
        buttons = [port for port in pins if port.startswith("button")]
        for port in (*SWITCHES, *buttons):
            before = ctx.get(top.ports[port])
            ctx.set(top.ports[port], 1 - before)
            acts = "stop" if port in buttons else port
            assert inputs(ctx, top.controller) == idle | {acts: 1}
            ctx.set(top.ports[port], before)
        ctx.set(top.ports["rx"], 0)
        assert ctx.get(top.controller.rx) == 0
        assert inputs(ctx, top.controller) == idle

    on_the_pins(board, normally_closed, bench)


@pytest.mark.usefixtures("opened")
@every_board
def test_every_output_is_its_own(board):
    async def bench(ctx, top, pins):
        core = top.controller
        sources = {"tx": core.tx}
        for a in "xy":
            sources |= {f"step_{a}": core.pins[a].step, f"direction_{a}": core.pins[a].direction}
        sources |= {f"led_{name}": core.leds[name] for name in core.leds.shape().members}
        shown = [port for port in sources if port in pins]
        for lit in (None, *sources):
            for port, source in sources.items():
                ctx.set(source, int(port == lit))
            for port in shown:
                assert ctx.get(top.ports[port]) == (port == lit) ^ pins[port].low, (lit, port)
        if "one" in pins:
            assert ctx.get(top.ports["one"]) == 1

    on_the_pins(board, False, bench)


@pytest.mark.usefixtures("opened")
@every_board
def test_the_device_is_the_boards(board):
    core = (top := Top(board)).controller
    Fragment.get(top, None)  # else Amaranth complains that it is not used
    device = board.device()
    Fragment.get(device, None)
    assert (type(core.device), core.device.parameters) == (type(device), device.parameters)
    assert core.clocks_per_bit == board.clocks_per_bit


@pytest.mark.parametrize("name", ["icestick", "tangnano9k"])
def test_a_stop_lights_its_lamp(name):
    """The whole of a board, with its own clock at its pin."""
    board = BOARDS[name]

    async def bench(ctx, top, pins):
        async def clocks(count):
            for _ in range(count):
                for level in (1, 0):
                    ctx.set(top.ports["clk"], level)
                    await ctx.delay(1e-6)

        def lit(lamp):
            return ctx.get(top.ports[lamp]) ^ pins[lamp].low

        await clocks(6)
        assert (lit("led_moving"), lit("led_stopped"), ctx.get(top.ports["tx"])) == (0, 0, 1)
        ctx.set(top.ports["stop"], 0)
        await clocks(6)
        assert (lit("led_moving"), lit("led_stopped")) == (0, 1)

    on_the_pins(board, False, bench)


def test_refuses_what_is_no_flag():
    message = "normally_closed must be True or False, not 1"
    assert_refused((TypeError, message), Top, BOARDS["icestick"], normally_closed=1)
