"""The top level of a board: the device with its serial link, between the pins."""

from amaranth import Cat, ClockDomain, ClockSignal, Const, Elaboratable, Instance, Module, Signal
from amaranth.hdl import Value

from discreta.boards.board import Board
from discreta.hdl.contract import check_flag
from discreta.hdl.controller import Controller

__all__ = ["Top"]

#: The axes of every board.
_AXES = "xy"


class Top(Elaboratable):
    """Joins a controller to the pins of a board.

    What a pin says by 0 is inverted. The emergency stop is that of the connector or any button that
    there is for it.

    Where the device's clock is slower than the board's, a clock manager of Xilinx makes it; there
    are no other boards with that.

    Latency: none, it is wires alone; the controller takes the inputs over into the clock.
    Throughput: a clock. Reset: none but the start values, which the FPGA has when it is loaded.
    Overflow, error: none.
    Source: none of the documents, it is ours.

    Parameters
    ----------
    board : Board
    normally_closed : bool
        Switches of the connectors are open when they act: a broken wire acts, too.

    Attributes
    ----------
    controller : Controller
    ports : dict of str to Signal
        The signal at every pin, by the port's name.

    Raises
    ------
    TypeError
        ``normally_closed`` is none of both.
    """

    def __init__(self, board: Board, *, normally_closed: bool = False):
        check_flag("normally_closed", normally_closed)
        self.board = board
        self.normally_closed = normally_closed
        self.controller = Controller(board.device(), board.clocks_per_bit)
        self.ports = {pin.port: Signal(name=pin.port) for pin in board.pins}

    def elaborate(self, platform):
        """Describe the hardware."""
        m = Module()
        m.domains += ClockDomain("sync")
        m.submodules.controller = core = self.controller
        self._clock(m)
        emergency: list[Value] = []
        # What a pin goes to, or comes from; anything else is a matter of the catalogue.
        inputs: dict[str, Value] = {"rx": core.rx}
        outputs: dict[str, Value] = {"tx": core.tx, "one": Const(1)}
        for a in _AXES:
            inputs |= {f"low_{a}": core.low_limit[a], f"high_{a}": core.high_limit[a]}
            outputs |= {f"step_{a}": core.pins[a].step, f"direction_{a}": core.pins[a].direction}
        outputs |= {f"led_{name}": core.leds[name] for name in core.leds.shape().members}
        for pin in self.board.pins:
            port, inverted = self.ports[pin.port], pin.low
            what = pin.port.partition("_")[0]
            if pin.output:
                m.d.comb += port.eq(outputs[pin.port] ^ inverted)
            elif what != "clk":
                if what in ("low", "high", "stop"):
                    inverted ^= self.normally_closed
                if what in ("stop", "button"):
                    emergency.append(port ^ inverted)
                else:
                    m.d.comb += inputs[pin.port].eq(port ^ inverted)
        m.d.comb += core.emergency.eq(Cat(emergency).any())
        return m

    def _clock(self, m: Module) -> None:
        """Give the clock of the pin, or a slower one made of it."""
        board = self.board
        if board.clock == board.oscillator:
            m.d.comb += ClockSignal().eq(self.ports["clk"])
            return
        feedback, slow = Signal(), Signal()
        # The manager runs at 1 GHz inside, of 0.6 to 1.2 that it may.
        m.submodules.manager = Instance(
            "MMCME2_BASE",
            ("p", "CLKIN1_PERIOD", 1e9 / board.oscillator),
            ("p", "CLKFBOUT_MULT_F", 1e9 / board.oscillator),
            ("p", "CLKOUT0_DIVIDE_F", 1e9 / board.clock),
            ("i", "CLKIN1", self.ports["clk"]),
            ("i", "CLKFBIN", feedback),
            ("i", "PWRDWN", Const(0)),
            ("i", "RST", Const(0)),
            ("o", "CLKFBOUT", feedback),
            ("o", "CLKOUT0", slow),
        )
        m.submodules.buffer = Instance("BUFG", ("i", "I", slow), ("o", "O", ClockSignal()))
