"""Vector outline of the map and the table, for figures, pages and screens."""

import math

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.outline import Point, Shape, circle, square

from .features import theta_of
from .geometry import BOARD, BOARD_CORNER_RADIUS, CIRCLE_CENTRE, CIRCLE_RADIUS, TRIANGLE
from .map_config import WINDOW, MapConfig
from .physics import GOAL_SIZE

_CORNER = [(math.cos(k * math.pi / 12), math.sin(k * math.pi / 12)) for k in range(7)]  # a quarter of a circle
_START_RADIUS = 10  # px


def board_outline() -> list[Point]:
    """The board with its round corners, image coordinates in px."""
    left, top, right, bottom = BOARD
    r = BOARD_CORNER_RADIUS
    corners = ((right - r, bottom - r), (left + r, bottom - r), (left + r, top + r), (right - r, top + r))
    outline = []
    for quarter, (u, v) in enumerate(corners):
        cos, sin = math.cos(quarter * math.pi / 2), math.sin(quarter * math.pi / 2)
        outline += [(u + r * (a * cos - b * sin), v + r * (a * sin + b * cos)) for a, b in _CORNER]
    return outline


class TableOutline:
    """See `copolicy.dataset.outline.Outline`; lengths in px of the original's window."""

    size = (float(WINDOW[0]), float(WINDOW[1]))
    unit = "px"
    arrow = 95.0
    body = (
        Shape("body", tuple(board_outline())),
        Shape("robot", TRIANGLE),
        Shape("human", circle(CIRCLE_CENTRE, CIRCLE_RADIUS)),
    )
    hands = ((75.5, 6.0), CIRCLE_CENTRE)
    """Middle of the triangle and of the circle."""

    def fixed(self, scenario: MapConfig) -> tuple[Shape, ...]:
        """Goal, start and obstacles."""
        return (
            Shape("goal", square(scenario.goal, GOAL_SIZE)),
            Shape("start", circle(scenario.start[:2], _START_RADIUS)),
            *(Shape("obstacle", square(centre, side)) for centre, side in scenario.squares),
        )

    def poses(self, states: Array) -> Array:
        """`(T, 3)` centre of the table and its orientation in [0, 2 pi)."""
        return np.column_stack((states[:, :2], theta_of(states)))

    def forces(self, actions: Array) -> Array:
        """The actions are forces."""
        return actions
