"""Files that are either whole or not there."""

import errno
import os
import secrets
import shutil
import sys
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import IO

__all__ = ["Outputs"]


class Outputs:
    """Collects what a command writes and puts it in place all together, at its end.

    Every file is written beside its place under another name. They are moved in place when the
    ``with`` block ends well, and removed when it does not.

    Parameters
    ----------
    reads : iterable of str
        The files that the command reads: they are not written over.

    Raises
    ------
    OSError
        A file cannot be written there, or is named twice; nothing is left behind.
    """

    def __init__(self, reads: Iterable[str] = ()):
        self._stack = ExitStack()
        self._taken = {Path(os.path.realpath(path)) for path in reads}
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
        goal = Path(os.path.realpath(path))  # a link stays a link: what it leads to is replaced
        if goal.is_dir():
            raise IsADirectoryError(errno.EISDIR, "it is a folder; give the name of a file", path)
        if goal.exists() and not goal.is_file():
            return goal  # a device or a pipe has no half
        if goal in self._taken:
            message = "this command reads or writes it already; choose another name"
            raise FileExistsError(errno.EEXIST, message, path)
        if not goal.parent.is_dir():
            message = f"there is no folder {Path(path).parent}; make it first"
            raise FileNotFoundError(errno.ENOENT, message, path)
        if goal.exists() and not os.access(goal, os.W_OK):
            message = "the file is read-only; choose another name"
            raise PermissionError(errno.EACCES, message, path)
        part = goal.with_name(f".discreta-{secrets.token_hex(8)}")
        try:
            part.touch(exist_ok=False)
        except OSError as error:
            message = f"{error.strerror}; choose another folder"
            raise type(error)(error.errno, message, path) from None
        self._taken.add(goal)
        self._moves.append((part, goal))
        if goal.exists():
            shutil.copymode(goal, part)
        return part

    def __exit__(self, kind, value, traceback) -> None:
        whole = False
        try:
            self._stack.close()
            whole = kind is None
        finally:
            for part, goal in self._moves:
                if whole:
                    part.replace(goal)
                else:
                    part.unlink(missing_ok=True)
