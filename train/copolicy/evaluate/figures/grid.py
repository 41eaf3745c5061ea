"""Square cells over the scene of a task."""

import math
from typing import Any, NamedTuple

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.outline import Outline


class Grid(NamedTuple):
    """Cells of the scene; the first row is at the top edge, the first column at the left edge.

    Attributes:
        cell: side of a cell, in the unit of the outline.
    """

    cell: float
    rows: int
    columns: int

    @classmethod
    def over(cls, outline: Outline, cell: float) -> "Grid":
        """Cells that cover a scene; those at the right and the lower edge may reach beyond it."""
        width, height = outline.size
        return cls(cell, math.ceil(height / cell - 1e-9), math.ceil(width / cell - 1e-9))

    def indices(self, positions: Array) -> Array:
        """`(n,)` index of the cell of each position `(n, 2)`, row by row; a position outside has the nearest cell."""
        column, row = (
            np.clip(np.floor(values / self.cell).astype(int), 0, limit - 1)
            for values, limit in zip(positions.T, (self.columns, self.rows), strict=True)
        )
        return row * self.columns + column

    def sums(self, positions: Array, weights: Array | None = None) -> Array:
        """`(rows, columns)` number of positions in each cell, or the sum of their weights."""
        sums = np.bincount(self.indices(positions), weights, self.rows * self.columns)
        return sums.reshape(self.rows, self.columns).astype(float)

    def to_json(self) -> dict[str, Any]:
        """Cell side and numbers of cells."""
        return {"cell": self.cell, "rows": self.rows, "columns": self.columns}
