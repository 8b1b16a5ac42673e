"""What README.md shows is what its first command prints."""

import re
from pathlib import Path

from click.testing import CliRunner

from discreta.cli import cli

ROOT = Path(__file__).parents[2]
# Another machine may have another engine, and takes another time.
OWN = ("engine", "time")


def lines(text):
    rows = [line.split() for line in text.splitlines()]
    return [row for row in rows if row and row[0] not in OWN]


def test_the_summary_of_the_border(tmp_path):
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    command = re.search(r"discreta (simulate path .*) --plot border.png", readme)
    shown = re.search(r"```\n(method .*?)```", readme, re.DOTALL)
    assert command
    assert shown
    arguments = command[1].replace("examples", str(ROOT / "examples")).split()
    picture = tmp_path / "border.png"
    result = CliRunner().invoke(cli, [*arguments, "--plot", str(picture)])
    assert result.exit_code == 0, result.output
    assert lines(result.stdout) == lines(shown[1])
    assert picture.stat().st_size > 10_000
