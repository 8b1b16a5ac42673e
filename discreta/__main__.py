"""``python -m discreta`` is ``discreta``."""

from discreta.cli import main

main()
