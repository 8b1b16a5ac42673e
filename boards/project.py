"""The files of a project for Vivado, for a board that the open tools do not build for.

Source: none of the documents, it is ours.
"""

from amaranth.back import verilog

from discreta.boards.board import Board, constraints
from discreta.boards.top import Top

__all__ = ["project"]

_SCRIPT = """\
# vivado -mode batch -source build.tcl
read_verilog top.v
read_xdc top.xdc
synth_design -top top -part {part}
opt_design
place_design
route_design
report_utilization
report_timing_summary
write_bitstream -force top.bit
"""


def project(board: Board, top: Top) -> dict[str, str]:
    """Give the texts of a project, by the names of their files: Verilog, pins, script."""
    return {
        "top.v": verilog.convert(
            top,
            name="top",
            ports=list(top.ports.values()),
            emit_src=False,
            strip_internal_attrs=True,
        ),
        "top.xdc": constraints(board, "xdc"),
        "build.tcl": _SCRIPT.format(part=board.fpga),
    }
