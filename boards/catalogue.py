"""The boards there are.

Motors are on one connector: step and direction of x, then of y; the limit switches follow, low and
high end of x, then of y, and the emergency stop.

Places of pins are from the makers' own files: ``icebreaker.pcf`` of the iCEBreaker's examples, the
iCEstick Evaluation Kit User's Guide (EB82), ``ulx3s_v20.lpf`` (boards 2.x and 3.0.x),
``*.cst`` of Sipeed's TangNano-9K-example, ``Arty-A7-35-Master.xdc`` of Digilent.
"""

from functools import partial

from discreta.boards.board import Board, Pin
from discreta.hdl.device import exact_device
from discreta.hdl.line_device import LineDevice

__all__ = ["BOARDS"]

_MOTORS = ("step_x", "direction_x", "step_y", "direction_y")
_SWITCHES = ("low_x", "high_x", "low_y", "high_y", "stop")


def _connectors(motors: dict[str, str], switches: dict[str, str]) -> tuple[Pin, ...]:
    """Give the pins of motors and switches, whose sites and labels come in order."""
    return (
        *(
            Pin(port, site, label, output=True)
            for port, (site, label) in zip(_MOTORS, motors.items(), strict=True)
        ),
        *(
            Pin(port, site, label, pull="up", low=True)
            for port, (site, label) in zip(_SWITCHES, switches.items(), strict=True)
        ),
    )


def _leds(**places: tuple[str, str]) -> tuple[Pin, ...]:
    """Give the pins of LEDs: site and label, by what the LED says."""
    return tuple(
        Pin(f"led_{name}", site, label, output=True) for name, (site, label) in places.items()
    )


def _serial(rx: str, tx: str) -> tuple[Pin, ...]:
    return Pin("rx", rx, "USB", pull="up"), Pin("tx", tx, "USB", output=True)


BOARDS = {
    board.name: board
    for board in (
        Board(
            name="icebreaker",
            title="iCEBreaker (Lattice iCE40 UP5K)",
            fpga="up5k",
            oscillator=12_000_000,
            clock=12_000_000,
            pins=(
                Pin("clk", "35", "12 MHz"),
                *_serial("6", "9"),
                *_connectors(
                    {"4": "PMOD1A 1", "2": "PMOD1A 2", "47": "PMOD1A 3", "45": "PMOD1A 4"},
                    {
                        "3": "PMOD1A 7",
                        "48": "PMOD1A 8",
                        "46": "PMOD1A 9",
                        "44": "PMOD1A 10",
                        "43": "PMOD1B 1",
                    },
                ),
                Pin("button_0", "10", "UBTN", pull="up", low=True),
                Pin("led_moving", "37", "LEDG, green", output=True, low=True),
                Pin("led_stopped", "11", "LEDR, red", output=True, low=True),
            ),
            load="iceprog {}",
            # All comes in ticks of equal length: other pauses would only take room.
            device=partial(
                exact_device,
                16,
                kinds=("line", "arc"),
                depth=16,
                multiplier=True,
                pauses=(256, 256),
                pairing=False,
            ),
            draws="lines and arcs of 16 bits",
        ),
        Board(
            name="icestick",
            title="iCEstick (Lattice iCE40 HX1K)",
            fpga="hx1k",
            oscillator=12_000_000,
            clock=12_000_000,
            pins=(
                Pin("clk", "21", "12 MHz"),
                *_serial("9", "8"),
                *_connectors(
                    {"78": "J2 1", "79": "J2 2", "80": "J2 3", "81": "J2 4"},
                    {"87": "J2 7", "88": "J2 8", "90": "J2 9", "91": "J2 10", "112": "J1 3"},
                ),
                *_leds(moving=("95", "D5, green"), stopped=("99", "D1")),
            ),
            load="iceprog {}",
            device=partial(LineDevice, 12),
            draws="lines of 12 bits, no ramp",
        ),
        Board(
            name="ulx3s",
            title="ULX3S 25F (Lattice ECP5)",
            fpga="ecp5-25k",
            oscillator=25_000_000,
            clock=25_000_000,
            pins=(
                Pin("clk", "G2", "25 MHz"),
                *_serial("M1", "L4"),
                *_connectors(
                    {"B11": "GP0", "C11": "GN0", "A10": "GP1", "A11": "GN1"},
                    {"A9": "GP2", "B10": "GN2", "B9": "GP3", "C10": "GN3", "A7": "GP4"},
                ),
                Pin("button_0", "R1", "FIRE1", pull="down"),
                *_leds(moving=("B2", "D0"), stopped=("C2", "D1"), link=("C1", "D2")),
                # At 0 the ESP32 on the board takes the FPGA over.
                Pin("one", "L2", "ESP32 GPIO0", output=True),
            ),
            load="openFPGALoader --board ulx3s {}",
            device=partial(
                exact_device, 16, kinds=("line", "arc", "conic"), depth=64, multiplier=True
            ),
            draws="lines, arcs and conics of 16 bits",
        ),
        Board(
            name="tangnano9k",
            title="Tang Nano 9K (Gowin GW1NR-9)",
            fpga="gw1n-9",
            oscillator=27_000_000,
            clock=27_000_000,
            pins=(
                Pin("clk", "52", "27 MHz"),
                *_serial("18", "17"),
                *_connectors(
                    {"25": "25", "26": "26", "27": "27", "28": "28"},
                    {"29": "29", "30": "30", "33": "33", "34": "34", "40": "40"},
                ),
                # These and the LEDs are on the bank of 1.8 V.
                Pin("button_0", "3", "S2", pull="up", low=True, volts=1.8),
                Pin("button_1", "4", "S1", pull="up", low=True, volts=1.8),
                Pin("led_moving", "10", "LED 10", output=True, low=True, volts=1.8),
                Pin("led_stopped", "11", "LED 11", output=True, low=True, volts=1.8),
                Pin("led_link", "13", "LED 13", output=True, low=True, volts=1.8),
            ),
            load="openFPGALoader --board tangnano9k {}",
            device=partial(exact_device, 16, kinds=("line", "arc"), depth=64),
            draws="lines and arcs of 16 bits",
        ),
        Board(
            name="arty-a7",
            title="Arty A7-35T (Xilinx Artix-7)",
            fpga="xc7a35ticsg324-1L",
            oscillator=100_000_000,
            clock=25_000_000,
            pins=(
                Pin("clk", "E3", "100 MHz"),
                *_serial("A9", "D10"),
                *_connectors(
                    {"G13": "JA 1", "B11": "JA 2", "A11": "JA 3", "D12": "JA 4"},
                    {
                        "D13": "JA 7",
                        "B18": "JA 8",
                        "A18": "JA 9",
                        "K16": "JA 10",
                        "E15": "JB 1",
                    },
                ),
                Pin("button_0", "D9", "BTN0"),
                *_leds(moving=("H5", "LD4"), stopped=("J5", "LD5"), link=("T9", "LD6")),
            ),
            load="openFPGALoader --board arty_a7_35t {}",
            device=partial(
                exact_device, 16, kinds=("line", "arc", "conic"), depth=64, multiplier=True
            ),
            draws="lines, arcs and conics of 16 bits",
        ),
    )
}
