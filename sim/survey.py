"""Runs every line of a width through the compiled RTL and judges every register at every clock."""

import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import repeat
from typing import Any

import numpy as np

from discreta.sim.compiled import CompiledModel
from discreta.sim.contour import distance_from_line
from discreta.sim.methods import METHODS, Method

__all__ = ["CLOCK_BUDGET", "SEED", "SurveyRow", "survey", "survey_lines"]

SEED = 1970

#: Clocks that the sample of a width may take for one variant; a width beyond has no survey.
CLOCK_BUDGET = 1 << 25

#: Lines that run side by side, and lines times clocks between two comparisons.
_BATCH, _WINDOW = 1024, 1 << 16

#: Clocks around the summations: acceptance, start, and the last step, which leaves a clock later.
_OVERHEAD = 4


@dataclass
class SurveyRow:
    """What a survey found for one variant of a method.

    Attributes
    ----------
    variant : dict
        The method's choices.
    lines, clocks : int
        Lines run, and clocks of RTL compared.
    largest_error : float
        Largest distance of a point from its line, in steps.
    error_at : tuple of int
        (ΔX, ΔY, x, y): the line, and the point relative to its start.
    ends_missed : int
        Lines that were not done on their end point.
    summations, longest : int
        Summations of all lines, and steps of their longer axes.
    mismatches : list of str
        Where RTL and golden model differ, the first of every batch.
    """

    variant: dict[str, Any]
    lines: int = 0
    clocks: int = 0
    largest_error: float = 0.0
    error_at: tuple[int, ...] = ()
    ends_missed: int = 0
    summations: int = 0
    longest: int = 0
    mismatches: list[str] = field(default_factory=list)

    @property
    def good(self) -> bool:
        """RTL and golden model agree and no end was missed."""
        return not self.mismatches and not self.ends_missed

    def add(self, other: "SurveyRow") -> None:
        """Take in another part of the same survey."""
        # Parts come in any order: of equal errors the same one must win.
        worst = max((row.largest_error, row.error_at) for row in (self, other))
        self.largest_error, self.error_at = worst
        for name in ("lines", "clocks", "ends_missed", "summations", "longest"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.mismatches += other.mismatches


def survey_lines(width: int) -> tuple[np.ndarray, bool]:
    """Choose the lines of a survey and where they lie.

    Every pair of lengths there is, or a sample of 2^16 seeded pairs or fewer when all of them would
    take more than :data:`CLOCK_BUDGET` clocks. Quadrant and start point are drawn from the seed.

    Returns
    -------
    blocks : array of int64, shape (lines, 4)
        XH, YH, XK, YK.
    exhaustive : bool

    Raises
    ------
    ValueError
        A single line of this width takes more clocks than the budget.
    """
    modulus = 1 << width
    random = np.random.default_rng(SEED)
    clocks = modulus + _OVERHEAD
    exhaustive = modulus * modulus * clocks <= CLOCK_BUDGET
    if exhaustive:
        lengths = np.stack(np.divmod(np.arange(modulus * modulus), modulus), axis=1)
    else:
        count = min(1 << 16, CLOCK_BUDGET // clocks)
        if count < 64:
            raise ValueError(
                f"width {width} is too large to survey: one line takes up to {modulus} clocks; "
                f"choose a width up to {(CLOCK_BUDGET // 64 - _OVERHEAD).bit_length() - 1}"
            )
        lengths = random.integers(0, modulus, (count, 2))
    signs = random.choice((-1, 1), lengths.shape)
    low = np.where(signs < 0, lengths, 0) - modulus
    high = np.where(signs > 0, -lengths, 0) + modulus - 1
    starts = random.integers(low, high, endpoint=True)
    return np.concatenate([starts, starts + signs * lengths], axis=1), exhaustive


def survey(method: Method, width: int) -> Iterator[SurveyRow]:
    """Survey every variant of a method on all cores, and give the results part by part.

    Raises
    ------
    RuntimeError
        There is no C++ compiler.
    ValueError
        The width has too many clocks; see :func:`survey_lines`.
    """
    blocks, _ = survey_lines(width)
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        jobs = []
        try:
            # Compiled here, found in the cache by every part.
            keys = [tuple(variant.items()) for variant in method.variants()]
            list(pool.map(_compile, repeat(method.name), repeat(width), keys))
            for variant in method.variants():
                # Lines of like length side by side: a part runs as long as its longest line.
                golden = method.golden(width, 2, **variant)
                order = np.argsort(method.summations(golden, _lengths(blocks)), kind="stable")
                for part in np.array_split(blocks[order], -(-len(blocks) // _BATCH)):
                    jobs.append(pool.submit(_survey_part, method.name, width, variant, part))
            for job in as_completed(jobs):
                yield job.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


@lru_cache(maxsize=1)  # a thousand copies of a design take 100 MiB
def _model(name: str, width: int, variant: tuple[tuple[str, Any], ...]) -> CompiledModel:
    """Give the RTL with every register watched, made once in a process."""
    method = METHODS[name]
    watch = tuple(f"reg_{register}" for register in method.golden(width, 2).registers())
    return CompiledModel(method.device(width, 2, **dict(variant)), watch=watch)


def _compile(name: str, width: int, variant: tuple[tuple[str, Any], ...]) -> None:
    _model(name, width, variant)


def _lengths(blocks: np.ndarray) -> np.ndarray:
    return np.abs(blocks[:, 2:] - blocks[:, :2])


def _survey_part(name: str, width: int, variant: dict[str, Any], blocks: np.ndarray) -> SurveyRow:
    """Run some lines side by side: all of them in the golden model, slice by slice in the RTL."""
    method = METHODS[name]
    golden = method.golden(width, 2, **variant)
    clocks = int(method.summations(golden, _lengths(blocks)).max()) + _OVERHEAD
    names = list(golden.registers())
    model = _model(name, width, tuple(variant.items()))
    row = SurveyRow(variant, lines=len(blocks), clocks=len(blocks) * clocks)
    judge = _Judge(row, blocks)
    window = max(1, _WINDOW // len(blocks))
    windows = model.lanes(blocks, clocks, window=window)
    clock = 0
    for seen, wanted in zip(windows, _run_golden(golden, blocks, clocks, window), strict=True):
        if not row.mismatches and not np.array_equal(seen, wanted):
            lane, late, register = np.argwhere(seen != wanted)[0]
            row.mismatches.append(
                f"{names[register]} is {seen[lane, late, register]} in clock {clock + late} of the "
                f"line {blocks[lane].tolist()}, where the golden model has "
                f"{wanted[lane, late, register]}"
            )
        judge.follow(clock, dict(zip(names, np.moveaxis(seen, 2, 0), strict=True)))
        clock += seen.shape[1]
    judge.end()
    return row


def _run_golden(golden: Any, blocks: np.ndarray, clocks: int, window: int) -> Iterator[np.ndarray]:
    """Give every register at every clock, shape (lines, clocks of a window, registers)."""
    state = {name: np.full(len(blocks), value) for name, value in golden.reset().items()}
    fields = ("blocks_start_x", "blocks_start_y", "blocks_end_x", "blocks_end_y")
    inputs: dict[str, Any] = dict(zip(fields, blocks.T, strict=True))
    inputs |= {"blocks_valid": 1, "steps_ready": 1}
    names = list(golden.registers())
    for begin in range(0, clocks, window):
        count = min(window, clocks - begin)
        record = np.empty((count, len(names), len(blocks)), dtype=np.int64)
        for clock in range(count):
            for index, name in enumerate(names):
                record[clock, index] = state[name]
            state = golden.step(state, inputs)
            inputs["blocks_valid"] = 0
        lines = np.ascontiguousarray(record.reshape(-1, len(blocks)).T)
        yield lines.reshape(len(blocks), count, len(names))


class _Judge:
    """Takes the recorded registers, window by window, into a row."""

    def __init__(self, row: SurveyRow, blocks: np.ndarray):
        self._row = row
        self._starts = blocks[:, :2]
        self._lengths = blocks[:, 2:] - blocks[:, :2]
        self._moves = np.any(self._lengths != 0, axis=1)
        self._answers = np.zeros(len(blocks), dtype=np.int64)
        self._ended = np.zeros(len(blocks), dtype=bool)
        row.longest += int(np.abs(self._lengths).max(axis=1).sum())

    def follow(self, clock: int, seen: dict[str, np.ndarray]) -> None:
        """Take in a window that begins with ``clock``; registers have shape (lines, clocks)."""
        row, moves = self._row, self._moves
        points = np.stack([seen["p3"], seen["p4"]], axis=-1) - self._starts[:, None]
        # Accepted in clock 0 and started in clock 1: the position holds from clock 2 on.
        late = max(0, 2 - clock)
        errors = distance_from_line(points[moves, late:], self._lengths[moves, None])
        if errors.size and errors.max() > row.largest_error:
            row.largest_error = float(errors.max())
            lane, when = np.unravel_index(np.argmax(errors), errors.shape)
            line, point = self._lengths[moves][lane], points[moves][lane, when + late]
            row.error_at = (*line.tolist(), *point.tolist())
        self._answers += seen["done"].sum(axis=1)
        self._ended = np.all(points[:, -1] == self._lengths, axis=1)
        row.summations += int(seen["running"].sum())

    def end(self) -> None:
        """Count the lines that were not done, once, on their end point."""
        self._row.ends_missed += int(np.count_nonzero(~(self._ended & (self._answers == 1))))
