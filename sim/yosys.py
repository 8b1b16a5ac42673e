"""Yosys, native and from PyPI: the ``prove`` and ``boards`` extras bring it."""

import sys

__all__ = ["yosys"]

_SCRIPT = "import sys; from pyosys import libyosys as ys; d = ys.Design()\n"
_SCRIPT += "for command in sys.argv[1:]: ys.run_pass(command, d)"


def yosys(*commands: str) -> list[str]:
    """Give the command line of a process that runs commands of Yosys one after the other.

    It is a process of its own, since Yosys talks on the standard output and ends what it runs in
    when something is wrong.
    """
    return [sys.executable, "-c", _SCRIPT, *commands]
