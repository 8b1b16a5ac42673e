"""All methods side by side: how exact, how quick, how large, and how many steps a second."""

import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from discreta.sim.fpga import check_tools
from discreta.sim.groups import survey_groups
from discreta.sim.methods import METHODS
from discreta.sim.speed import limits
from discreta.sim.survey import SurveyRow, survey
from discreta.sim.synth import RUNS, SEEDS, Measurement, measure

__all__ = ["PASSES", "SURVEY_WIDTH", "ComparisonRow", "compare"]

#: Bits of the devices whose error is surveyed: every line there is, in little time.
SURVEY_WIDTH = 6

#: What is done for a method: its survey, its pace, and the runs of its synthesis.
PASSES = 2 + RUNS


@dataclass(frozen=True)
class ComparisonRow:
    """What there is to say of a method, in its default setting.

    Attributes
    ----------
    name : str
    curve : str
        ``"line"``, ``"arc"`` or ``"conic"``.
    error : float
        Largest distance of a point from its curve in the survey of :data:`SURVEY_WIDTH` bits, in
        steps.
    sound : bool
        The survey found every register as the golden model has it and no end missed.
    clocks_per_step : float or None
        From one step of either axis, or of both, to the next, in the mean; None on a carrier,
        where all the steps of a period come at once.
    cells : Measurement
        Cells and clock, at the width compared.
    steps_per_second : float or None
        At this clock.
    """

    name: str
    curve: str
    error: float
    sound: bool
    clocks_per_step: float | None
    cells: Measurement

    @property
    def steps_per_second(self) -> float | None:
        """Steps a second at the clock of the FPGA; None where one of both is not known."""
        if self.clocks_per_step is None or self.cells.median is None:
            return None
        return 1e6 * self.cells.median / self.clocks_per_step


def compare(
    names: Iterable[str],
    width: int,
    device: str = "hx8k",
    seeds: Iterable[int] = SEEDS,
    *,
    progress: Callable[[], None] = lambda: None,
) -> Iterator[ComparisonRow]:
    """Measure methods in their default setting, one after the other, on all cores.

    Parameters
    ----------
    names : iterable of str
        Of :data:`~discreta.sim.methods.METHODS`.
    width : int
        n of the pace and of the cells, 4 to 32; a method that ends before has as many as it can.
    device : str
        One of :data:`~discreta.sim.fpga.FPGAS`.
    seeds : iterable of int
        Those of the placements.
    progress : callable
        Called after every pass; there are :data:`PASSES` a method.

    Raises
    ------
    ModuleNotFoundError
        The extra ``boards`` is not installed.
    RuntimeError
        There is no C++ compiler.
    """
    check_tools(device)
    workers = min(2, os.cpu_count() or 1)
    for name in names:
        method = METHODS[name]
        choices = method.settings["default"]
        bits = min(width, method.max_width)
        core = method.core(bits, **choices)
        cells = measure(core, device, seeds, workers=workers, progress=progress)
        found = SurveyRow(choices, 0)
        for part in survey(method, SURVEY_WIDTH, survey_groups(method, SURVEY_WIDTH), [choices]):
            found.add(part)
        progress()
        (pace,) = limits(bits, 1e6, methods=(name,))
        progress()
        clocks = None if pace.per_period else pace.mean
        yield ComparisonRow(name, method.curve, found.largest_error, found.good, clocks, cells)
