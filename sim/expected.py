"""Where the blocks of a device lead, step by step, by the golden models of its interpolators."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from discreta.hdl.contract import AXIS_LETTERS
from discreta.hdl.queue import KINDS, BlockKind
from discreta.sim.golden.constant_speed import constant_arc, constant_line
from discreta.sim.golden.exact_conic import ExactConic
from discreta.sim.points import BadInputError

__all__ = ["RefusedBlockError", "expected_points"]

#: The models of :func:`~discreta.hdl.device.exact_device`, by the kind of block.
_MODELS = {
    KINDS["line"].value: constant_line,
    KINDS["arc"].value: constant_arc,
    KINDS["conic"].value: lambda width, _axes: ExactConic(width),
}
_PLACE = BlockKind.__members__["PLACE"].value

#: A model that needs more clocks than this for each step that its blocks can have hangs.
_CLOCKS_PER_STEP, _CLOCKS = 4, 1000


class RefusedBlockError(BadInputError):
    """The golden model refuses a block, or does not end; the message names it."""


def expected_points(
    fields: tuple[str, ...], blocks: np.ndarray, width: int, axes: int
) -> np.ndarray:
    """Give every point behind the first one, shape (moves, axes), in steps.

    Parameters
    ----------
    fields : tuple of str
        The fields of the blocks, as ports.
    blocks : array of int64, shape (blocks, fields)
        As an exact device is given them; the first one says where it stands.
    width : int
    axes : int

    Raises
    ------
    RefusedBlockError
        A block is refused.
    """
    columns = dict(zip(fields, blocks.T, strict=True))
    kinds = columns["blocks_kind"]
    ends = np.stack([columns[f"blocks_end_{a}"] for a in AXIS_LETTERS[:axes]], axis=1)
    starts = np.vstack([np.zeros((1, axes), dtype=np.int64), ends[:-1]])
    for index, a in enumerate(AXIS_LETTERS[:axes]):
        columns[f"blocks_start_{a}"] = starts[:, index]
    moves: list[np.ndarray] = [np.empty((0, axes), dtype=np.int64)] * len(blocks)
    for kind, make in _MODELS.items():
        which = np.flatnonzero(kinds == kind)
        if len(which):
            given = {name: column[which] for name, column in columns.items()}
            longest = int(np.abs(ends - starts)[which].sum(axis=1).max())
            radius = 0 if kind == KINDS["line"].value else 8 << width
            limit = _CLOCKS + _CLOCKS_PER_STEP * (longest + radius)
            for number, steps in zip(which, _run(make(width, axes), given, limit), strict=True):
                moves[number] = steps
    points = [starts[:1][:0]]
    for start, steps in zip(starts, moves, strict=True):
        points.append(start + np.cumsum(steps, axis=0))
    return np.concatenate(points)


def _run(golden: Any, given: Mapping[str, np.ndarray], limit: int) -> list[np.ndarray]:
    """Give the moves of blocks that are run all at once, each by a model of its own."""
    count = len(next(iter(given.values())))
    letters = getattr(golden, "letters", "xy")
    state = {name: np.full(count, value) for name, value in golden.reset().items()}
    numbers = np.arange(count)
    rows = []
    for clock in range(limit):
        out = golden.outputs(state)
        steps = np.stack([out[f"steps_{a}"] for a in letters], axis=1)
        leaves = np.flatnonzero((out["steps_valid"] != 0) & np.any(steps != 0, axis=1))
        if len(leaves):
            rows.append(np.column_stack([numbers[leaves], steps[leaves]]))
        refused = np.flatnonzero(out["error"])
        if len(refused):
            raise RefusedBlockError(
                f"the golden model refuses block {numbers[refused[0]]} of its kind"
            )
        left = out["done"] == 0
        if not left.all():
            numbers = numbers[left]
            state = {name: value[left] for name, value in state.items()}
            given = {name: value[left] for name, value in given.items()}
        if not len(numbers):
            break
        handshake = {
            "blocks_valid": np.full(len(numbers), int(clock == 0)),
            "steps_ready": np.ones(len(numbers), dtype=np.int64),
        }
        state = golden.step(state, {**given, **handshake})
    else:
        raise RefusedBlockError(f"block {numbers[0]} of its kind does not end")
    order = np.concatenate(rows) if rows else np.empty((0, 1 + len(letters)), dtype=np.int64)
    order = order[np.argsort(order[:, 0], kind="stable")]
    return np.split(order[:, 1:], np.searchsorted(order[:, 0], np.arange(1, count)))
