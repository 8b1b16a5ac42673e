"""Files that are either whole or not there."""

import errno
import os
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import IO

__all__ = ["Outputs"]


class Outputs:
    """Collects what a command writes and puts it in place all together, at its end.

    Every file is written beside its place under another name. They are moved in place when the
    ``with`` block ends well, and removed when it does not.

    Raises
    ------
    OSError
        Opening: a file cannot be written there; nothing is left behind.
    """

    def __init__(self):
        self._stack = ExitStack()
        self._moves: list[tuple[Path, Path]] = []

    def __enter__(self) -> "Outputs":
        return self

    def open(self, path: str) -> IO[str]:
        """Open a text file to write; ``-`` is the standard output."""
        if path == "-":
            return sys.stdout
        return self.write(self.place(path))

    def write(self, part: Path) -> IO[str]:
        """Open a placed file to write text; it is closed at the end of the ``with`` block."""
        return self._stack.enter_context(part.open("w", encoding="utf-8", newline=""))

    def place(self, path: str) -> Path:
        """Give the path to write to instead of ``path``; it is there, and empty."""
        goal = Path(path)
        if goal.is_dir():
            raise IsADirectoryError(errno.EISDIR, "is a folder", path)
        if goal.exists() and not goal.is_file():
            return goal  # a device or a pipe has no half
        part = goal.with_name(f".{os.getpid()}.{goal.name}")
        part.touch(exist_ok=False)
        self._moves.append((part, goal))
        return part

    def __exit__(self, kind, value, traceback) -> None:
        self._stack.close()
        for part, goal in self._moves:
            if kind is None:
                part.replace(goal)
            else:
                part.unlink(missing_ok=True)
