"""Distance of the table from obstacles and walls, for arrays of poses."""

import numpy as np

from copolicy.dataset.arrays import Array

from ..geometry import BOARD, BOARD_CORNER_RADIUS, CIRCLE_RADIUS, IMAGE_SIZE
from ..map_config import WINDOW

# Discs (u, v, r) that cover the table, symmetric under half a turn, since either end may lead.
_INNER_U = (BOARD[2] - BOARD[0]) / 2 - BOARD_CORNER_RADIUS + 2.5
_INNER_V = BOARD[3] - BOARD_CORNER_RADIUS
DISCS = np.array(
    [(sign_u * _INNER_U, sign_v * _INNER_V, BOARD_CORNER_RADIUS) for sign_u in (-1, 1) for sign_v in (-1, 1)]
    + [(u, 0.0, BOARD[3]) for u in (-25.0, 0.0, 25.0)]
    + [(sign * 78.0, 0.0, CIRCLE_RADIUS) for sign in (-1, 1)]
)


def square_clearance(x: Array, y: Array, theta: Array, centre: tuple[float, float], size: float) -> Array:
    """Distance between the table at poses (x, y, theta) and a square, px; negative where they overlap."""
    cos, sin = np.cos(theta), np.sin(theta)
    nearest = np.full(np.broadcast_shapes(x.shape, y.shape, theta.shape), np.inf)
    for u, v, radius in DISCS:
        outside_x = np.maximum(np.abs(x + u * cos + v * sin - centre[0]) - size / 2, 0.0)
        outside_y = np.maximum(np.abs(y - u * sin + v * cos - centre[1]) - size / 2, 0.0)
        np.minimum(nearest, np.hypot(outside_x, outside_y) - radius, out=nearest)
    return nearest


def wall_clearance(x: Array, y: Array, theta: Array) -> Array:
    """Distance between the box of the rotated table image and the edge of the window, px; negative outside."""
    width, height = IMAGE_SIZE
    cos, sin = np.abs(np.cos(theta)), np.abs(np.sin(theta))
    half_width, half_height = (width * cos + height * sin) / 2, (width * sin + height * cos) / 2
    horizontal = np.minimum(x, WINDOW[0] - x) - half_width
    vertical = np.minimum(y, WINDOW[1] - y) - half_height
    return np.minimum(horizontal, vertical)
