"""A picture of the world for videos: goal, obstacles, table, and the force of each player."""

import math

import numpy as np
import pygame

from copolicy.collect.table import BOARD, BOARD_CORNER_RADIUS, CIRCLE_CENTRE, CIRCLE_RADIUS, TRIANGLE, on_screen
from copolicy.dataset.task import GOAL_SIZE, WINDOW, MapConfig

_SCALE = 0.5
_SIZE = (round(WINDOW[0] * _SCALE), round(WINDOW[1] * _SCALE))
_BACKGROUND, _WOOD = (245, 245, 245), (150, 110, 70)
_GOAL, _OBSTACLE = (120, 190, 120), (70, 70, 70)
_ROBOT, _HUMAN = (40, 90, 200), (240, 140, 30)
_FORCE_LENGTH = 60.0  # px, of a full force
_CORNER_STEPS = 4


def draw(map_config: MapConfig, pose: tuple[float, float, float], action: np.ndarray) -> np.ndarray:
    """Draws without a display.

    Args:
        map_config: the map.
        pose: of the table, px and rad.
        action: `(4,)` forces of robot and human, drawn as lines from their ends of the table.

    Returns:
        `(300, 600, 3)` uint8, row by row.
    """
    surface = pygame.Surface(_SIZE, depth=24)
    surface.fill(_BACKGROUND)
    _square(surface, _GOAL, map_config.goal, GOAL_SIZE)
    for centre in map_config.obstacles:
        _square(surface, _OBSTACLE, centre, map_config.obstacle_size)
    _polygon(surface, _WOOD, pose, _board())
    _polygon(surface, _ROBOT, pose, TRIANGLE)
    human = on_screen(pose, CIRCLE_CENTRE)
    pygame.draw.circle(surface, _HUMAN, _scaled(human), CIRCLE_RADIUS * _SCALE)
    robot = on_screen(pose, (-CIRCLE_CENTRE[0], CIRCLE_CENTRE[1]))
    for seat, force in ((robot, action[:2]), (human, action[2:])):
        if not np.any(force):
            continue
        tip = (seat[0] + _FORCE_LENGTH * force[0], seat[1] + _FORCE_LENGTH * force[1])
        pygame.draw.line(surface, (0, 0, 0), _scaled(seat), _scaled(tip), 2)
    return np.frombuffer(pygame.image.tobytes(surface, "RGB"), np.uint8).reshape(_SIZE[1], _SIZE[0], 3)


def _board() -> list[tuple[float, float]]:
    left, top, right, bottom = BOARD
    r = BOARD_CORNER_RADIUS
    corners = (
        (right - r, top + r, -90),
        (right - r, bottom - r, 0),
        (left + r, bottom - r, 90),
        (left + r, top + r, 180),
    )
    angles = ((u, v, math.radians(a + 90 * i / _CORNER_STEPS)) for u, v, a in corners for i in range(_CORNER_STEPS + 1))
    return [(u + r * math.cos(a), v + r * math.sin(a)) for u, v, a in angles]


def _square(surface: pygame.Surface, colour, centre: tuple[float, float], size: int) -> None:
    left, top = _scaled((centre[0] - size / 2, centre[1] - size / 2))
    surface.fill(colour, (round(left), round(top), round(size * _SCALE), round(size * _SCALE)))


def _polygon(surface: pygame.Surface, colour, pose: tuple[float, float, float], points) -> None:
    pygame.draw.polygon(surface, colour, [_scaled(on_screen(pose, point)) for point in points])


def _scaled(point: tuple[float, float]) -> tuple[float, float]:
    return point[0] * _SCALE, point[1] * _SCALE
