"""Draws the table and its maps on the screen."""

from copolicy.collect.screen.outline_view import OutlineView, shrunk
from copolicy.collect.screen.palette import (
    FLOOR,
    GREEN,
    INK,
    OBSTACLE,
    OBSTACLE_STRIPE,
    SEATS,
    SHADOW,
    WOOD,
    WOOD_EDGE,
    mix,
)
from copolicy.collect.screen.patch import Point, SmoothPatch
from copolicy.collect.sdl import pygame
from copolicy.dataset.outline import Pose

from ..geometry import CIRCLE_CENTRE, CIRCLE_RADIUS, TRIANGLE
from ..map_config import MapConfig
from ..physics import GOAL_SIZE
from ..scene_outline import TableOutline, board_outline


class TableView(OutlineView):
    """Draws a map and the table as outlines, with rings in the goal, striped obstacles and a wooden board."""

    def __init__(self, map_config: MapConfig):
        super().__init__(TableOutline(), map_config)
        self.map_config = map_config

    def _draw_fixed(self, floor: pygame.Surface) -> None:
        scale, config = self._scale, self.map_config
        goal = config.goal
        _draw_goal(floor, (goal[0] * scale, goal[1] * scale), GOAL_SIZE * scale)
        start = (config.start[0] * scale, config.start[1] * scale)
        with SmoothPatch(floor, [start], 14 * scale) as patch:
            patch.circle(mix(FLOOR, INK, 0.25), start, 10 * scale, 3 * scale)
        for (x, y), side in config.squares:
            _draw_obstacle(floor, (x * scale, y * scale), side * scale)

    def _draw_body(self, surface: pygame.Surface, pose: Pose) -> None:
        scale = self._scale
        edge = 2.5 * scale
        board = self._body_points(pose, board_outline())
        triangle = self._body_points(pose, TRIANGLE)
        (circle,) = self._body_points(pose, [CIRCLE_CENTRE])
        radius = CIRCLE_RADIUS * scale
        drop = 5 * scale
        with SmoothPatch(surface, [*board, *triangle, circle], radius + drop + 2 * edge) as patch:
            for outline in (board, triangle):
                patch.polygon(SHADOW, [(x + drop, y + drop) for x, y in outline])
            patch.circle(SHADOW, (circle[0] + drop, circle[1] + drop), radius)
            for outline, colour, rim in (
                (board, WOOD, WOOD_EDGE),
                (triangle, SEATS[0], mix(SEATS[0], INK, 0.4)),
            ):
                patch.polygon(colour, outline)
                patch.outline(rim, shrunk(outline, edge / 2), edge)
            for v in (-14.0, 0.0, 14.0):
                start, end = self._body_points(pose, [(-44.0, v), (39.0, v)])
                patch.line(mix(WOOD, WOOD_EDGE, 0.3), start, end, 1.6 * scale)
            patch.circle(SEATS[1], circle, radius)
            patch.circle(mix(SEATS[1], INK, 0.4), circle, radius, edge)


def _draw_goal(surface: pygame.Surface, centre: Point, size: float) -> None:
    square = pygame.Rect(0, 0, round(size), round(size))
    square.center = (round(centre[0]), round(centre[1]))
    pygame.draw.rect(surface, mix(GREEN, FLOOR, 0.62), square)
    with SmoothPatch(surface, [centre], size / 2) as patch:
        for radius, colour in ((0.42, GREEN), (0.31, FLOOR), (0.2, GREEN), (0.08, FLOOR)):
            patch.circle(colour, centre, radius * size)
    pygame.draw.rect(surface, GREEN, square, max(2, round(size / 28)))


def _draw_obstacle(surface: pygame.Surface, centre: Point, size: float) -> None:
    square = pygame.Rect(0, 0, round(size), round(size))
    square.center = (round(centre[0]), round(centre[1]))
    shadow = square.move(max(2, round(size / 12)), max(2, round(size / 12)))
    pygame.draw.rect(surface, SHADOW, shadow)
    block = pygame.Surface(square.size, depth=32)
    block.fill(OBSTACLE)
    step = size / 3
    for k in range(-3, 4):
        with SmoothPatch(block, [(0.0, 0.0), (size, size)], 0) as patch:
            patch.line(OBSTACLE_STRIPE, (k * step, size), (k * step + size, 0.0), size / 9)
    surface.blit(block, square)
    pygame.draw.rect(surface, INK, square, max(2, round(size / 18)))
