# amaranth: UnusedElaboratable=no
"""Where blocks lead: by the golden models, and by hand."""

import numpy as np
import pytest

from discreta.hdl.device import exact_layout
from discreta.hdl.link import layout_fields
from discreta.hdl.queue import KINDS, BlockKind
from discreta.sim.expected import RefusedBlockError, expected_points

KINDS_OF_MOVES = ("line", "arc", "conic")


def rows_of(axes, moves, kinds=KINDS_OF_MOVES):
    """Give the fields of blocks, and the blocks by their fields."""
    fields = tuple(f"blocks_{name}" for name, *_ in layout_fields(exact_layout(8, axes, kinds)))
    return fields, np.array(
        [[row.get(name.removeprefix("blocks_"), 0) for name in fields] for row in moves]
    )


def place(**ends):
    return {"kind": BlockKind.__members__["PLACE"].value, **ends}


def line(**ends):
    return {"kind": KINDS["line"].value, **ends}


def test_lines_and_an_arc():
    fields, rows = rows_of(
        2,
        [
            place(end_x=3, end_y=-2),
            line(end_x=6, end_y=-1),
            line(end_x=6, end_y=-1),
            {"kind": KINDS["arc"].value, "end_x": 4, "end_y": 1, "center_x": 4, "center_y": -1},
            line(end_x=4, end_y=-1),
        ],
    )
    assert expected_points(fields, rows, 8, 2).tolist() == [
        *([4, -2], [5, -1], [6, -1]),
        *([6, 0], [5, 1], [4, 1]),
        *([4, 0], [4, -1]),
    ]


def test_three_axes():
    fields, rows = rows_of(3, [place(), line(end_x=2, end_y=-1, end_z=4)], ("line",))
    points = expected_points(fields, rows, 8, 3)
    assert points[-1].tolist() == [2, -1, 4]
    assert len(points) == 4


def test_nothing_to_move():
    fields, rows = rows_of(2, [place(end_x=3)])
    assert expected_points(fields, rows, 8, 2).shape == (0, 2)


def test_a_block_that_is_refused():
    off = {"kind": KINDS["arc"].value, "end_x": 50, "center_x": 4}
    fields, rows = rows_of(2, [place(), off])
    with pytest.raises(
        RefusedBlockError, match=r"\Athe golden model refuses block 0 of its kind\Z"
    ):
        expected_points(fields, rows, 8, 2)
