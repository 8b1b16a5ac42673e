"""A board: its FPGA, its clock, what each of its pins is for, and the device that fits it.

The file of constraints that a placer reads and the table of pins that a user reads are both made of
the same list of pins, so they never differ.

Source: none of the documents, it is ours. Places of pins: the schematics and constraint files of
the boards' makers, named in :mod:`discreta.boards.catalogue`.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from discreta.hdl.device import Device
from discreta.hdl.line_device import LineDevice

__all__ = ["Board", "Pin", "constraints"]

#: What a port is for, by what its name begins with; the letter of its axis follows.
_MEANINGS = {
    "clk": "clock",
    "rx": "serial link, from the computer",
    "tx": "serial link, to the computer",
    "step": "step of {}",
    "direction": "direction of {}, 1 leads downwards",
    "low": "limit switch at the low end of {}",
    "high": "limit switch at the high end of {}",
    "stop": "emergency stop",
    "button": "emergency stop, button on the board",
    "led": "LED: {}",
    "one": "always 1",
}

#: What a LED says, by its name.
_LEDS = {
    "moving": "the machine moves",
    "stopped": "it has stopped for a reason",
    "link": "the computer is there",
}


@dataclass(frozen=True)
class Pin:
    """A pin of the FPGA that is used.

    Attributes
    ----------
    port : str
        The port of the top level, like ``step_x``.
    site : str
        The place on the FPGA's package.
    label : str
        Where it is on the board, as it is printed there.
    output : bool
    pull : str
        ``"up"`` or ``"down"``: what an input is where nothing is connected.
    low : bool
        It says yes by 0.
    volts : float
        Level of a 1.
    """

    port: str
    site: str
    label: str
    output: bool = False
    pull: str = ""
    low: bool = False
    volts: float = 3.3

    @property
    def level(self) -> str:
        """What the placers call its levels."""
        return f"LVCMOS{10 * self.volts:.0f}"

    @property
    def meaning(self) -> str:
        """What it is for."""
        what, _, which = self.port.partition("_")
        return _MEANINGS[what].format(_LEDS.get(which, which))

    def row(self) -> tuple[str, ...]:
        """Give its row in a table: port, meaning, label, site, what it is like, volts."""
        said = ["out" if self.output else "in"]
        said += ["0 says yes"] if self.low else []
        said += [f"pulled {self.pull}"] if self.pull else []
        return (self.port, self.meaning, self.label, self.site, ", ".join(said), f"{self.volts:g}")


@dataclass(frozen=True)
class Board:
    """A board, and the device on it.

    Attributes
    ----------
    name, title : str
    fpga : str
        The FPGA, by the name that ``discreta synth --device`` has for it. One of Xilinx, by its
        maker's name, is not built: there is a project for Vivado.
    oscillator : int
        The clock at the pin, in Hz.
    clock : int
        The device's, in Hz.
    pins : tuple of Pin
    load : str
        A command that loads the bits, ``{}`` being their file.
    device : callable
        Makes the device.
    draws : str
        What it draws.
    baud : int
        Bits a second of the serial link.
    """

    name: str
    title: str
    fpga: str
    oscillator: int
    clock: int
    pins: tuple[Pin, ...]
    load: str
    device: Callable[[], Device | LineDevice]
    draws: str
    baud: int = 115_200

    @property
    def clocks_per_bit(self) -> int:
        """Clocks of a bit of the serial link."""
        return round(self.clock / self.baud)


def _pcf(board: Board) -> Iterable[str]:
    """Write constraints for an iCE40."""
    for pin in board.pins:
        yield f"set_io{' -pullup yes' if pin.pull else ''} {pin.port} {pin.site}"


def _lpf(board: Board) -> Iterable[str]:
    """Write constraints for an ECP5."""
    for pin in board.pins:
        pull = pin.pull.upper() or "NONE"
        yield f'LOCATE COMP "{pin.port}" SITE "{pin.site}";'
        yield f'IOBUF PORT "{pin.port}" IO_TYPE={pin.level} PULLMODE={pull};'
    yield f'FREQUENCY PORT "clk" {board.oscillator / 1e6:g} MHZ;'


def _cst(board: Board) -> Iterable[str]:
    """Write constraints for a Gowin."""
    for pin in board.pins:
        pull = pin.pull.upper() or "NONE"
        yield f'IO_LOC "{pin.port}" {pin.site};'
        yield f'IO_PORT "{pin.port}" IO_TYPE={pin.level} PULL_MODE={pull};'


def _xdc(board: Board) -> Iterable[str]:
    """Write constraints for Vivado."""
    for pin in board.pins:
        pull = f" PULL{pin.pull.upper()} TRUE" if pin.pull else ""
        place = f"PACKAGE_PIN {pin.site} IOSTANDARD {pin.level}{pull}"
        yield f"set_property -dict {{{place}}} [get_ports {pin.port}]"
    yield f"create_clock -name clk -period {1e9 / board.oscillator:g} [get_ports clk]"
    yield "set_property CFGBVS VCCO [current_design]"
    yield "set_property CONFIG_VOLTAGE 3.3 [current_design]"


_WRITERS: dict[str, Callable[[Board], Iterable[str]]] = {
    "pcf": _pcf,
    "lpf": _lpf,
    "cst": _cst,
    "xdc": _xdc,
}


def constraints(board: Board, ending: str) -> str:
    """Write the places of a board's pins: a file of this ending, pcf, lpf, cst or xdc."""
    return "".join(f"{line}\n" for line in _WRITERS[ending](board))
