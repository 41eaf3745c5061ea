"""A range scan of the map from the table's centre, as of a laser scanner."""

import math

import torch
from torch import Tensor, nn

from ..map_config import WINDOW

RAYS = 36
"""Directions of the scan, 10 degrees apart, the first along x."""

RANGE = 400.0
"""Range of the scan, px."""

_HALF = 25.0  # px, half the side of an obstacle; sizes are not observed, and those of people's data were 50 px
_PARALLEL = 1e-4  # smallest component of a direction, so that rays along an axis do not divide by zero


class RangeScan(nn.Module):
    """Distances from the table's centre to the nearest obstacle or wall, in directions fixed to the window.

    From coordinates of obstacle centres the network must learn what is in the way for every number and order of
    obstacles; a scan contains it directly, and generalises to layouts that no demonstration had.
    """

    direction: Tensor
    wall: Tensor

    def __init__(self):
        super().__init__()
        angle = torch.arange(RAYS) * (2 * math.pi / RAYS)
        direction = torch.stack((angle.cos(), angle.sin()), dim=-1)  # (R, 2)
        direction = torch.where(direction.abs() < _PARALLEL, _PARALLEL, direction)
        self.register_buffer("direction", direction, persistent=False)
        self.register_buffer("wall", torch.tensor(WINDOW, dtype=torch.float32) * (direction > 0), persistent=False)

    def forward(self, position: Tensor, obstacles: Tensor) -> Tensor:
        """Scans.

        Args:
            position: `(..., 2)` of the table's centre, px.
            obstacles: `(..., 3, 2)` centres, px; zero where there is none.

        Returns:
            `(..., RAYS)`: 1 at contact, -1 at `RANGE` and beyond.
        """
        origin = position[..., None, :]  # (..., 1, 2)
        wall = ((self.wall - origin) / self.direction).amin(dim=-1)  # (..., R)
        offset = (obstacles - origin)[..., None, :]  # (..., 3, 1, 2)
        # A ray is in the square between its last entry and its first exit over the two axes (slab method).
        low, high = (offset - _HALF) / self.direction, (offset + _HALF) / self.direction  # (..., 3, R, 2)
        entry, leave = torch.minimum(low, high).amax(dim=-1), torch.maximum(low, high).amin(dim=-1)
        present = (obstacles != 0).any(dim=-1)[..., None]  # (..., 3, 1)
        hit = present & (entry <= leave) & (leave > 0)
        obstacle = torch.where(hit, entry, torch.inf).amin(dim=-2)  # (..., R)
        return 1 - 2 * (torch.minimum(wall, obstacle) / RANGE).clamp(0, 1)
