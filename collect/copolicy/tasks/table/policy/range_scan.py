"""A range scan of the map, as a laser scanner at the table's centre would see it."""

import math

import torch
from torch import Tensor, nn

from ..map_config import WINDOW

RAYS = 36
"""Directions of the scan, 10 degrees apart, the first along x."""

RANGE = 400.0
"""How far the scan reaches, px."""

_HALF = 25.0  # px, half the side of an obstacle; its size is not among the observations, people's were 50 px
_PARALLEL = 1e-4  # a direction's smallest component, so that rays along an axis divide by something


class RangeScan(nn.Module):
    """Distances from the table's centre to the nearest obstacle or wall, in directions fixed to the window.

    Coordinates of obstacle centres leave it to the network to work out what lies in the way, for every number and
    order of obstacles anew; a scan says it, and looks alike for layouts that no demonstration had.
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
        here = position[..., None, :]  # (..., 1, 2)
        wall = ((self.wall - here) / self.direction).amin(dim=-1)  # (..., R)
        offset = (obstacles - here)[..., None, :]  # (..., 3, 1, 2)
        # Where the ray enters and leaves the square: after its last entry, and before its first exit, of the two axes.
        one, other = (offset - _HALF) / self.direction, (offset + _HALF) / self.direction  # (..., 3, R, 2)
        entry, leave = torch.minimum(one, other).amax(dim=-1), torch.maximum(one, other).amin(dim=-1)
        present = (obstacles != 0).any(dim=-1)[..., None]  # (..., 3, 1)
        seen = present & (entry <= leave) & (leave > 0)
        obstacle = torch.where(seen, entry, torch.inf).amin(dim=-2)  # (..., R)
        return 1 - 2 * (torch.minimum(wall, obstacle) / RANGE).clamp(0, 1)
