"""Runs blocks by the thousand through the compiled RTL and judges every step and every register.

A survey has groups of blocks and runs each of them through every variant of the method, block
behind block. Every block is judged by its steps. The registers are compared with the golden model
at every clock, for all blocks or a sample of them: from the registers of a clock, as the RTL has
them, the golden model works out those of the next, thousands of clocks at a time.
"""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from itertools import repeat
from math import log, pi, sqrt
from typing import Any, Protocol

import numpy as np

from discreta.sim.arc_judge import ArcJudge
from discreta.sim.arcs import in_parts, seen_from_center
from discreta.sim.compiled import CompiledModel
from discreta.sim.conics import motion
from discreta.sim.contour import (
    ArcContour,
    ConicContour,
    Contour,
    ExactConicContour,
    LineContour,
)
from discreta.sim.groups import SEED, Group
from discreta.sim.methods import METHODS, Method
from discreta.sim.points import say_point
from discreta.sim.simulate import DeadCoreError, simulate
from discreta.sim.stretch import EVENT_COLUMNS, Stretch

__all__ = ["REGISTER_BUDGET", "SurveyRow", "say_worst", "survey"]

#: Clocks in which a survey compares registers, shared evenly by its variants and groups.
REGISTER_BUDGET = 1 << 27

#: Clocks of a part of a survey, and clocks that the golden model works out at a time.
_PART, _BATCH = 1 << 24, 1 << 13

#: What an error may be off by its rounding, in steps.
_ROUNDING = 1e-9

#: Clocks of a run beside those of its blocks: up to the first acceptance, and the last answer.
_OVERHEAD = 2


#: What judges the steps of blocks.
_Judging = Contour | ArcJudge


@dataclass
class SurveyRow:
    """What a survey found for one variant of a method and one group of blocks.

    Attributes
    ----------
    variant : dict
        The method's choices.
    group : int
        The group's number, from 0.
    blocks, compared : int
        Blocks run, and those of them during which the registers were compared.
    clocks : int
        Clocks of RTL.
    largest_error : float
        Largest distance of a point from its true curve, in steps.
    error_index : int
        The block with this error, by its number in the group; the first of several.
    error_at : tuple of int
        The point with this error, in steps.
    ends_missed : int
        Blocks that were not done on their end point, or not refused as they had to be.
    completed : int
        Arcs and conics that took completing steps.
    summations : int
        Clocks in which the device ran; not counted on a carrier.
    length : float
        Steps of the axis that moves faster, of all blocks.
    findings : list of str
        Where RTL and golden model differ, why the device was given up, or which error is above the
        proven bound, the first of every part.
    block_errors : array of float
        The largest error of every block that was not to be refused, in any order.
    """

    variant: dict[str, Any]
    group: int
    blocks: int = 0
    compared: int = 0
    clocks: int = 0
    largest_error: float = 0.0
    error_index: int = 0
    error_at: tuple[int, ...] = ()
    ends_missed: int = 0
    completed: int = 0
    summations: int = 0
    length: float = 0.0
    findings: list[str] = field(default_factory=list)
    block_errors: np.ndarray = field(default_factory=lambda: np.empty(0), repr=False, compare=False)

    @property
    def usual_error(self) -> float:
        """The 99.9-percentile of the blocks' largest errors, in steps; 0 without blocks."""
        return float(np.quantile(self.block_errors, 0.999)) if len(self.block_errors) else 0.0

    @property
    def good(self) -> bool:
        """RTL and golden model agree, no end was missed and no proven bound exceeded."""
        return not self.findings and not self.ends_missed

    def add(self, other: "SurveyRow") -> None:
        """Take in another part of the same survey."""
        # Parts come in any order: of equal errors the same one must win.
        if (other.largest_error, -other.error_index) > (self.largest_error, -self.error_index):
            self.largest_error, self.error_index = other.largest_error, other.error_index
            self.error_at = other.error_at
        for name in (
            *("blocks", "compared", "clocks", "ends_missed", "completed", "summations"),
            *("length", "findings"),
        ):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.block_errors = np.concatenate([self.block_errors, other.block_errors])


class _Curve(Protocol):
    """What a survey must know of the curves that a method draws.

    Attributes
    ----------
    fields : tuple of str
        The fields of a block.
    watch : tuple of str
        ``running``, and what registers :meth:`completing` needs; none of a method on a carrier,
        whose clocks are those of its timing.
    cost : int
        How many times as long as another a golden model takes for a clock.
    """

    fields: tuple[str, ...]
    watch: tuple[str, ...]
    cost: int

    def contour(self, blocks: np.ndarray) -> _Judging:
        """Give what compares the steps with the true curves."""
        ...

    def clocks(self, method: Method, golden: Any, group: Group) -> np.ndarray:
        """Give about how many clocks every block takes."""
        ...

    def completing(self, seen: dict[str, np.ndarray]) -> np.ndarray:
        """Tell the clocks in which a completing step is put out, shape (clocks,)."""
        ...

    def say(self, block: np.ndarray, point: np.ndarray) -> tuple[str, str]:
        """Write a block and a point of it as a table has them."""
        ...


class _Lines:
    """Lines in the plane."""

    fields: tuple[str, ...] = ("start_x", "start_y", "end_x", "end_y")
    watch: tuple[str, ...] = ("running",)
    cost: int = 1

    def contour(self, blocks: np.ndarray) -> LineContour:
        """Compare with the lines."""
        return LineContour(blocks)

    def clocks(self, method: Method, golden: Any, group: Group) -> np.ndarray:
        """Give the most clocks that they can take, and few take fewer."""
        return method.clocks(golden, group.blocks)

    def completing(self, seen: dict[str, np.ndarray]) -> np.ndarray:
        """Tell that lines have no completing steps."""
        return np.zeros(len(seen["running"]), dtype=bool)

    def say(self, block: np.ndarray, point: np.ndarray) -> tuple[str, str]:
        """Write the lengths with their signs, and the point as seen from the start."""
        return say_point(block[2:] - block[:2]), say_point(point - block[:2])


class _Arcs:
    """Arcs of circles."""

    fields: tuple[str, ...] = (*_Lines.fields, "center_x", "center_y", "clockwise", "full_turns")
    watch: tuple[str, ...] = ("running", "turns", "backward", "p1", "p2", "p3", "p4")
    cost: int = 1

    def contour(self, blocks: np.ndarray) -> _Judging:
        """Compare with the circles."""
        return ArcContour(blocks)

    def clocks(self, method: Method, golden: Any, group: Group) -> np.ndarray:  # noqa: ARG002
        """Give 2^bits for every radian, all that the angle may take, and the preparation."""
        start, _ = seen_from_center(group.blocks)
        radius = np.maximum(np.hypot(*start.T.astype(float)), 1)
        bits = np.ceil(np.log2(radius)) if golden.normalize else golden.width
        radians = group.lengths / radius * (pi / sqrt(8))
        return (radians * 2.0 ** (bits + golden.guard)).astype(np.int64) + 2 * golden.width + 8

    def completing(self, seen: dict[str, np.ndarray]) -> np.ndarray:
        """Tell the clocks in which nothing that has steps left would move."""
        still_x = (seen["p3"] == 0) | (seen["backward"] == 1) | (seen["p2"] == 0)
        still_y = (seen["p4"] == 0) | (seen["p1"] == 0)
        return (seen["running"] == 1) & (seen["turns"] == 0) & still_x & still_y

    def say(self, block: np.ndarray, point: np.ndarray) -> tuple[str, str]:
        """Write the arc with what is not usual of it, and the point."""
        start, end, center = np.split(block[:6], 3)
        about = f" about {say_point(center)}" if center.any() else ""
        arc = f"{say_point(start)} to {say_point(end)}{about}{' cw' if block[6] else ''}"
        return arc, say_point(point)


class _ExactArcs(_Arcs):
    """Arcs of the exact interpolator."""

    watch: tuple[str, ...] = ("running",)
    cost: int = 16

    def contour(self, blocks: np.ndarray) -> ArcJudge:
        """Compare with the circles."""
        return ArcJudge(blocks)

    def clocks(self, method: Method, golden: Any, group: Group) -> np.ndarray:
        """Give the most clocks that they can take, and few take fewer."""
        return in_parts(lambda blocks: method.clocks(golden, blocks), group.blocks)

    def completing(self, seen: dict[str, np.ndarray]) -> np.ndarray:
        """Tell that there are no completing steps."""
        return np.zeros(len(seen["running"]), dtype=bool)


class _TimedLines(_Lines):
    """Lines in the plane on a carrier."""

    fields: tuple[str, ...] = (*_Lines.fields, "periods", "period")
    watch: tuple[str, ...] = ()

    def contour(self, blocks: np.ndarray) -> LineContour:
        """Compare with the lines."""
        return LineContour(blocks, 2)

    def say(self, block: np.ndarray, point: np.ndarray) -> tuple[str, str]:
        """Write the lengths with their signs and the periods, and the point from the start."""
        line, point_said = super().say(block[:4], point)
        return f"{line} in {block[-2]} periods", point_said


class _TimedArcs(_Arcs):
    """Arcs of circles on a carrier."""

    fields: tuple[str, ...] = (*_Arcs.fields, "periods", "period")
    watch: tuple[str, ...] = ()
    cost: int = 8

    def clocks(self, method: Method, golden: Any, group: Group) -> np.ndarray:
        """Give the most clocks that they can take, and few take fewer."""
        return method.clocks(golden, group.blocks)

    def say(self, block: np.ndarray, point: np.ndarray) -> tuple[str, str]:
        """Write the arc with what is not usual of it and the periods, and the point."""
        arc, point_said = super().say(block, point)
        return f"{arc} in {block[-2]} periods", point_said


class _Conics:
    """Curves of the second order."""

    fields: tuple[str, ...] = (*"abcde", *_Lines.fields, "clockwise", "turns")
    watch: tuple[str, ...] = (
        *("running", "turns", "gx", "gy", "p3", "p4", "clockwise"),
        *("backward_x", "backward_y", "direction_x", "direction_y"),
    )
    cost: int = 1

    def contour(self, blocks: np.ndarray) -> ConicContour:
        """Compare with the curves."""
        return ConicContour(blocks)

    def clocks(self, method: Method, golden: Any, group: Group) -> np.ndarray:  # noqa: ARG002
        """Give 2^guard / ln 2 for every step of the faster axis, and the preparation.

        A summation moves it by 2^−guard times ½ to 1, by the logarithm all of these alike; and by
        less where the gradient was larger before, if the scale does not rise.
        """
        course, steps = motion(group.blocks), group.lengths
        if golden.ordered:
            a, b, c, *_ = group.blocks.T
            # An ellipse soon has the scale of its largest gradient; elsewhere it is largest at an
            # end.
            closed = 4 * a * c > b * b
            slow = course.time * np.where(closed, course.largest, course.first)
            steps = np.where((b != 0) | (a != c), np.fmax(steps, slow), steps)
        return (steps * 2**golden.guard / log(2)).astype(np.int64) + golden.width + 7

    def completing(self, seen: dict[str, np.ndarray]) -> np.ndarray:
        """Tell the clocks in which nothing that has steps left would move."""
        clockwise = seen["clockwise"] == 1
        moves = np.zeros(len(clockwise), dtype=bool)
        for k, g, count, way in (("x", "gy", "p3", -1), ("y", "gx", "p4", 1)):
            velocity = np.where(clockwise, -way, way) * np.sign(seen[g])
            ahead = np.where(seen[f"direction_{k}"] == 1, -1, 1)
            able = (velocity == ahead) & (seen[f"backward_{k}"] == 0)
            moves |= able & (seen[count] != 0)
        return (seen["running"] == 1) & (seen["turns"] == 0) & ~moves

    def say(self, block: np.ndarray, point: np.ndarray) -> tuple[str, str]:
        """Write coefficients, start and end with what is not usual of the curve, and the point."""
        five, start, end = block[:5], block[5:7], block[7:9]
        curve = f"{say_point(five)} from {say_point(start)} to {say_point(end)}"
        turns = f", {-(-block[10] // 4)} turns" if block[10] > 4 else ""
        return f"{curve}{' cw' if block[9] else ''}{turns}", say_point(point)


class _ExactConics(_Conics):
    """Curves of the second order whose faster axis steps every clock."""

    watch: tuple[str, ...] = ("running",)
    cost: int = 1

    def contour(self, blocks: np.ndarray) -> ExactConicContour:
        """Compare with the curves."""
        return ExactConicContour(blocks)

    def clocks(self, method: Method, golden: Any, group: Group) -> np.ndarray:
        """Give the most clocks that they can take, and few take fewer."""
        return method.clocks(golden, group.blocks)

    def completing(self, seen: dict[str, np.ndarray]) -> np.ndarray:
        """Tell that they have no completing steps."""
        return np.zeros(len(seen["running"]), dtype=bool)


_CURVES: dict[tuple[str, bool], _Curve] = {
    ("line", False): _Lines(),
    ("arc", False): _Arcs(),
    ("conic", False): _Conics(),
    ("line", True): _TimedLines(),
    ("arc", True): _TimedArcs(),
}


#: Those of the exact methods, whose registers are not those of the others.
_EXACT: dict[str, _Curve] = {"arc": _ExactArcs(), "conic": _ExactConics()}


def _curve(method: Method) -> _Curve:
    exact = _EXACT.get(method.curve) if method.exact else None
    return exact or _CURVES[method.curve, method.timed]


def say_worst(method: Method, group: Group, row: SurveyRow) -> tuple[str, str]:
    """Write the block with the largest error, and the point, as a table has them.

    A line is written as its lengths with their signs, and the point as seen from its start; an arc
    as start and end, with ``about`` its center if that is not the origin, and ``cw``; both with
    their periods, if they have any; a conic as its coefficients, start and end, ``cw`` and in how
    many turns it ends if that is not one.
    """
    return _curve(method).say(group.blocks[row.error_index], np.array(row.error_at))


def survey(
    method: Method, width: int, groups: Sequence[Group], variants: Sequence[dict[str, Any]]
) -> Iterator[SurveyRow]:
    """Survey variants of a method on all cores, and give the results part by part.

    Parameters
    ----------
    method : Method
    width : int
        4 to 32.
    groups : sequence of Group
        Chosen for this width; see :mod:`discreta.sim.groups`.
    variants : sequence of dict
        Values for all of the method's choices.

    Raises
    ------
    RuntimeError
        There is no C++ compiler.
    """
    budget = REGISTER_BUDGET // _curve(method).cost // len(variants) // len(groups)
    parts = [
        part
        for variant in variants
        for number, group in enumerate(groups)
        for part in _parts(method, width, variant, number, group, budget)
    ]
    with ProcessPoolExecutor(os.cpu_count(), initializer=_begin, initargs=(groups,)) as pool:
        try:
            # Compiled here, found in the cache by every part.
            list(pool.map(_compile, repeat(method.name), repeat(width), variants))
            for job in as_completed([pool.submit(_survey_part, part) for part in parts]):
                yield job.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


@dataclass(frozen=True)
class _Part:
    """Blocks of a group, by their numbers, to be run one behind the other."""

    method: str
    width: int
    variant: dict[str, Any]
    group: int
    chosen: np.ndarray
    compared: bool


def _parts(
    method: Method, width: int, variant: dict[str, Any], number: int, group: Group, budget: int
) -> Iterator[_Part]:
    """Split a group: into what is compared within a budget of clocks and what is not, and these."""
    golden = method.model(width, 2, **variant)
    clocks = _curve(method).clocks(method, golden, group)
    mixed = np.random.default_rng(SEED).permutation(len(clocks))
    count = np.searchsorted(np.cumsum(clocks[mixed]), budget, side="right")
    for compared, chosen in ((True, mixed[:count]), (False, mixed[count:])):
        chosen = np.sort(chosen)
        pieces = min(len(chosen), -(-int(clocks[chosen].sum()) // _PART))
        for first in range(pieces):
            yield _Part(method.name, width, variant, number, chosen[first::pieces], compared)


#: The groups that this process surveys.
_groups: Sequence[Group] = ()


def _begin(groups: Sequence[Group]) -> None:
    global _groups
    _groups = groups


def _compile(name: str, width: int, variant: dict[str, Any]) -> None:
    CompiledModel(METHODS[name].core(width, 2, **variant)).close()


def _survey_part(part: _Part) -> SurveyRow:
    """Run blocks one behind the other and judge them."""
    method, group = METHODS[part.method], _groups[part.group]
    core = method.core(part.width, 2, **part.variant)
    golden = method.model(part.width, 2, **part.variant)
    blocks, answers = group.blocks[part.chosen], group.answers[part.chosen]
    judge = _Judge(method, blocks, golden if part.compared else None)
    limit = int(method.clocks(golden, blocks).sum()) + _OVERHEAD
    watch = tuple(f"reg_{name}" for name in judge.names)
    try:
        for stretch in simulate(core, blocks, limit=limit, engine="compiled", watch=watch):
            judge.follow(stretch)
    except DeadCoreError as error:
        judge.findings.append(str(error))
    contour = judge.contour
    bound = method.bound(golden)
    if bound is not None and contour.largest_error > bound + _ROUNDING:
        judge.findings.append(
            f"the error is {contour.largest_error:.4f} at {say_point(contour.error_at)}, where "
            f"{bound:.4f} is proven"
        )
    right = np.where(answers == 0, contour.reached, contour.block_steps == 0)
    return SurveyRow(
        part.variant,
        part.group,
        blocks=len(blocks),
        compared=len(blocks) if part.compared else 0,
        clocks=judge.clocks,
        largest_error=contour.largest_error,
        error_index=int(part.chosen[np.argmax(contour.block_errors)]),
        error_at=contour.error_at,
        ends_missed=int(np.count_nonzero(~(right & (judge.errors == answers)))),
        completed=int(np.count_nonzero(judge.completed)),
        summations=judge.summations,
        length=float(group.lengths[part.chosen].sum()),
        findings=judge.findings,
        block_errors=contour.block_errors[answers == 0],
    )


class _Judge:
    """Takes in a run of blocks, stretch by stretch.

    Without a golden model no registers are compared.
    """

    def __init__(self, method: Method, blocks: np.ndarray, golden: Any | None):
        self._curve, self._name = _curve(method), method.curve
        self._blocks, self._golden = blocks, golden
        self.names = tuple(golden.registers()) if golden else self._curve.watch
        self.contour = self._curve.contour(blocks)
        if isinstance(self.contour, Contour):
            self.contour.done_ends = method.timed and not method.per_period
        self.clocks = self.summations = 0
        self.findings: list[str] = []
        self.completed = np.zeros(len(blocks), dtype=bool)
        #: The error that each block was answered with; −1 without an answer.
        self.errors = np.full(len(blocks), -1)
        #: The clocks of the acceptances and of the answers so far.
        self._accepted = self._answered = np.empty(0, dtype=np.int64)
        #: The registers that the golden model has in the next clock.
        self._next = (
            np.array([golden.reset()[name] for name in self.names]) if golden else np.empty(0)
        )

    def follow(self, stretch: Stretch) -> None:
        """Take in a stretch."""
        self.contour.follow(stretch)
        column = dict(zip(EVENT_COLUMNS, stretch.events.T, strict=False))
        accepted, answers = column["accepted"] == 1, (column["done"] | column["error"]) != 0
        answered = len(self._answered)
        self._accepted = np.append(self._accepted, column["clock"][accepted])
        self._answered = np.append(self._answered, column["clock"][answers])
        self.errors[answered : len(self._answered)] = column["error"][answers]
        for begin in range(0, stretch.ran, _BATCH):
            # The values of a register side by side, which is quicker to work with.
            seen = np.ascontiguousarray(stretch.watch[begin : begin + _BATCH].T)
            self._watch(self.clocks + begin, dict(zip(self.names, seen, strict=True)))
            if self._golden and not self.findings:
                self._compare(self.clocks + begin, seen)
        self.clocks += stretch.ran

    def _watch(self, first: int, seen: dict[str, np.ndarray]) -> None:
        """Take in what was watched in the clocks from ``first`` on."""
        if not self._curve.watch:
            return
        self.summations += int(seen["running"].sum())
        completing = first + np.flatnonzero(self._curve.completing(seen))
        # A block is answered before the next one runs for the first time.
        blocks = np.searchsorted(self._answered, completing, side="right")
        self.completed[np.minimum(blocks, len(self.completed) - 1)] = True

    def _compare(self, first: int, seen: np.ndarray) -> None:
        """Compare every register, shape (registers, clocks), with what follows from before."""
        assert self._golden
        clocks = np.arange(first, first + seen.shape[1])
        offered = np.searchsorted(self._accepted, clocks, side="left")
        block = self._blocks[np.minimum(offered, len(self._blocks) - 1)]
        inputs = {f"blocks_{name}": block.T[i] for i, name in enumerate(self._curve.fields)}
        inputs |= {"blocks_valid": (offered < len(self._blocks)).astype(np.int64), "steps_ready": 1}
        after = self._golden.step(dict(zip(self.names, seen, strict=True)), inputs)
        after = np.stack([np.broadcast_to(after[name], clocks.shape) for name in self.names])
        wanted = np.column_stack([self._next, after[:, :-1]])
        self._next = after[:, -1]
        wrong = seen != wanted
        if wrong.any():
            clock = int(wrong.any(axis=0).argmax())
            register = int(wrong[:, clock].argmax())
            self.findings.append(
                f"{self.names[register]} is {seen[register, clock]} in clock "
                f"{self._when(first + clock)}, where the golden model has {wanted[register, clock]}"
            )

    def _when(self, clock: int) -> str:
        """Tell a clock from the last acceptance."""
        accepted = np.searchsorted(self._accepted, clock, side="right")
        if not accepted:
            return f"{clock} after reset"
        block = self._blocks[accepted - 1].tolist()
        return f"{clock - self._accepted[accepted - 1]} of the {self._name} {block}"
