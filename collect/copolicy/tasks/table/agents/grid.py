"""A grid of table poses and the moves between neighbouring cells, the same for every map."""

import functools
import math
from typing import NamedTuple

import numpy as np

from copolicy.dataset.arrays import Array

from ..map_config import WINDOW

CELL = 15.0
"""Width and height of a cell, px."""
ANGLES = 12
"""Orientations in half a turn; the table counts as symmetric under half a turn."""
COLUMNS, ROWS = int(WINDOW[0] / CELL), int(WINDOW[1] / CELL)
SHAPE = (ANGLES, ROWS, COLUMNS)
COUNT = ANGLES * ROWS * COLUMNS
RADIAN = 60.0
"""Cost of turning by one radian, px: about the path that the table covers in the same time."""

# Neighbours at the same angle: the eight around and the eight knight moves, for straighter paths than in steps of
# 45 degrees. Neighbours at the next angles: the same position and the eight around.
_AROUND = [(rows, columns) for rows in (-1, 0, 1) for columns in (-1, 0, 1)]
_KNIGHT = [(r, c) for r in (-2, -1, 1, 2) for c in (-2, -1, 1, 2) if abs(r) != abs(c)]
_OFFSETS = [(0, r, c) for r, c in (*_AROUND, *_KNIGHT) if (r, c) != (0, 0)]
_OFFSETS += [(turn, r, c) for turn in (-1, 1) for r, c in _AROUND]
REACH = max(abs(cells) for _, *step in _OFFSETS for cells in step)
"""Largest number of cells that a move covers along one axis."""


class Moves(NamedTuple):
    """Directed moves in the order of a CSR matrix, each `(M,)`, and its row pointer `(COUNT + 1,)`."""

    source: Array
    target: Array
    length: Array  # px
    pointer: Array


def poses() -> tuple[Array, Array, Array]:
    """Centres of the cells: x, y (px) and theta (rad), broadcastable to `SHAPE`."""
    angle = np.arange(ANGLES) * (math.pi / ANGLES)
    row, column = (np.arange(ROWS) + 0.5) * CELL, (np.arange(COLUMNS) + 0.5) * CELL
    return column[None, None, :], row[None, :, None], angle[:, None, None]


def cell(x: float, y: float, theta: float) -> int:
    """Index of the cell that contains a pose (px, px, rad); outside the window, of the nearest cell."""
    column = min(max(int(x / CELL), 0), COLUMNS - 1)
    row = min(max(int(y / CELL), 0), ROWS - 1)
    return (round(theta * (ANGLES / math.pi)) % ANGLES * ROWS + row) * COLUMNS + column


def pose(cell: int) -> tuple[float, float, float]:
    """Centre of a cell: x, y (px) and theta (rad, in [0, pi))."""
    angle, position = divmod(cell, ROWS * COLUMNS)
    row, column = divmod(position, COLUMNS)
    return (column + 0.5) * CELL, (row + 0.5) * CELL, angle * (math.pi / ANGLES)


@functools.cache
def moves() -> Moves:
    """All moves between neighbouring cells."""
    angle, row, column = np.meshgrid(*(np.arange(size) for size in SHAPE), indexing="ij")
    sources, targets, lengths = [], [], []
    for turn, down, right in _OFFSETS:
        inside = (row + down >= 0) & (row + down < ROWS) & (column + right >= 0) & (column + right < COLUMNS)
        a, r, c = angle[inside], row[inside], column[inside]
        sources.append((a * ROWS + r) * COLUMNS + c)
        targets.append(((a + turn) % ANGLES * ROWS + r + down) * COLUMNS + c + right)
        length = math.hypot(CELL * down, CELL * right, RADIAN * math.pi / ANGLES * turn)
        lengths.append(np.full(len(a), length, dtype=np.float32))
    source, target, length = (np.concatenate(part) for part in (sources, targets, lengths))
    order = np.lexsort((target, source))
    pointer = np.concatenate(([0], np.cumsum(np.bincount(source, minlength=COUNT))))
    return Moves(
        source[order].astype(np.int32), target[order].astype(np.int32), length[order], pointer.astype(np.int32)
    )
