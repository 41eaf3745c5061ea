"""Codes of Co-GAIL: a grid over the square, visited in turn, with noise around each point."""

import torch
from torch import Tensor

_AXIS = torch.linspace(-0.8, 0.8, 5)
NOISE = 0.2
"""Half the width of the uniform noise around a grid point."""

GRID: Tensor = torch.cartesian_prod(_AXIS, _AXIS)
"""`(25, 2)` grid points in the order in which training visits them."""

EXECUTED_POINT = 1
"""The grid point of codes in execution, (-0.8, -0.4): the original program's environment always drew around it."""


def draw_codes(points: Tensor, generator: torch.Generator | None = None) -> Tensor:
    """Codes `(B, 2)` around the grid points with indices `(B,)`, uniform within `NOISE` in each axis."""
    noise = torch.rand((len(points), 2), generator=generator) * 2 - 1
    return GRID[points.cpu()] + NOISE * noise
