import errno
import os
import resource
import sys
from pathlib import Path

import pytest

from discreta.sim.outputs import Outputs


class HalfwayError(Exception):
    """Raised in the middle."""


@pytest.fixture(autouse=True)
def _in_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def there():
    return sorted(path.name for path in Path().iterdir())


def test_files_come_all_together_at_the_end(tmp_path):
    (tmp_path / "b.txt").write_text("old")
    with Outputs() as outputs:
        a, b = outputs.open("a.txt"), outputs.open("b.txt")
        a.write("à\r\n")
        b.write("new")
        a.flush()
        assert "a.txt" not in there()
        assert (tmp_path / "b.txt").read_text() == "old"
    assert there() == ["a.txt", "b.txt"]
    assert (tmp_path / "a.txt").read_bytes() == b"\xc3\xa0\r\n"
    assert (tmp_path / "b.txt").read_text() == "new"


@pytest.mark.parametrize("failure", [HalfwayError, KeyboardInterrupt, SystemExit])
def test_nothing_is_left_when_it_fails(tmp_path, failure):
    (tmp_path / "b.txt").write_text("old")

    def write():
        with Outputs() as outputs:
            outputs.open("a.txt").write("half")
            outputs.open("b.txt").write("half")
            outputs.place("c.png").write_bytes(b"half")
            raise failure

    with pytest.raises(failure):
        write()
    assert there() == ["b.txt"]
    assert (tmp_path / "b.txt").read_text() == "old"


def test_nothing_is_left_when_the_disk_is_full(tmp_path):
    (tmp_path / "b.txt").write_text("old")

    def write():
        with Outputs() as outputs:
            outputs.open("a.txt").write("short")
            # Still in the buffer when the block ends.
            outputs.open("b.txt").write("x" * 5000)
            assert there()[-1] == "b.txt"

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(OSError, match="File too large"):
            write()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert there() == ["b.txt"]
    assert (tmp_path / "b.txt").read_text() == "old"


def test_the_standard_output(capsys):
    with Outputs() as outputs:
        assert outputs.open("-") is sys.stdout
        outputs.open("-").write("said\n")
    assert capsys.readouterr().out == "said\n"
    assert there() == []


def test_devices_are_written_to_as_they_are():
    with Outputs() as outputs:
        outputs.open(os.devnull).write("gone")
        outputs.open(os.devnull).write("gone twice")
    assert there() == []


def test_a_link_stays_a_link_and_rights_stay(tmp_path):
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "real.txt").chmod(0o640)
    (tmp_path / "link.txt").symlink_to("real.txt")
    with Outputs() as outputs:
        outputs.open("link.txt").write("new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"
    assert (tmp_path / "real.txt").stat().st_mode & 0o777 == 0o640
    assert there() == ["link.txt", "real.txt"]


def test_a_new_file_has_the_usual_rights(tmp_path):
    before = os.umask(0o027)
    try:
        with Outputs() as outputs:
            outputs.open("a.txt").write("new")
    finally:
        os.umask(before)
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o640


def test_a_name_as_long_as_names_may_be():
    name = "a" * 255
    with Outputs() as outputs:
        outputs.open(name).write("new")
    assert there() == [name]


BAD = {
    "folder": ("in", errno.EISDIR, "it is a folder; give the name of a file"),
    "nothing": ("", errno.EISDIR, "it is a folder; give the name of a file"),
    "missing folder": ("no/a.txt", errno.ENOENT, "there is no folder no; make it first"),
    "file as folder": ("old.txt/a", errno.ENOENT, "there is no folder old.txt; make it first"),
    "taken": (
        "./in/../first.txt",
        errno.EEXIST,
        "this command reads or writes it already; choose another name",
    ),
    "read": (
        "in/points.csv",
        errno.EEXIST,
        "this command reads or writes it already; choose another name",
    ),
}


@pytest.mark.parametrize(("path", "number", "message"), BAD.values(), ids=BAD)
def test_bad_names(tmp_path, path, number, message):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "points.csv").write_text("x,y\n")
    (tmp_path / "old.txt").write_text("old")
    outputs = Outputs(reads=["in/points.csv"])

    def write():
        with outputs:
            outputs.open("first.txt").write("half")
            outputs.open(path)

    with pytest.raises(OSError, match=message) as raised:
        write()
    error = raised.value
    assert (error.errno, error.strerror, error.filename) == (number, message, path)
    assert there() == ["in", "old.txt"]
    assert (tmp_path / "in" / "points.csv").read_text() == "x,y\n"


def test_a_file_that_may_not_be_written(tmp_path, monkeypatch):
    (tmp_path / "old.txt").write_text("old")
    (tmp_path / "old.txt").chmod(0o444)
    # The system lets root write everywhere: the answer is what everybody else gets.
    monkeypatch.setattr(os, "access", lambda _, mode: not (mode & os.W_OK))
    with Outputs() as outputs, pytest.raises(PermissionError) as raised:
        outputs.open("old.txt")
    assert raised.value.strerror == "the file is read-only; choose another name"
    assert (tmp_path / "old.txt").read_text() == "old"
    assert there() == ["old.txt"]
