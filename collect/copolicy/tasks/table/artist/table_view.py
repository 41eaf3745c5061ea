"""One frame of the world: map, table, forces and trails, on a pygame surface of any size."""

import math
from collections.abc import Sequence

from copolicy.collect.screen.palette import (
    FLOOR,
    FLOOR_DOT,
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
from copolicy.dataset.outline import Pose, placed

from ..map_config import WINDOW, MapConfig
from ..outline import CIRCLE_CENTRE, CIRCLE_RADIUS, TRIANGLE
from ..physics import GOAL_SIZE
from ..scene_outline import TableOutline, board_outline

_DOTS = 50  # px between the dots on the floor
_LIT = (255, 255, 255)


def letterbox(area: pygame.Rect, size: tuple[int, int] = WINDOW) -> pygame.Rect:
    """The largest rectangle with the shape of `size` in the middle of an area."""
    scale = min(area.width / size[0], area.height / size[1])
    rect = pygame.Rect(0, 0, max(1, round(size[0] * scale)), max(1, round(size[1] * scale)))
    rect.center = area.center
    return rect


class TableView:
    """Draws one map and the table on it into a rectangle of a surface.

    The rectangle's size sets the scale (1200 x 600 px of the world fill it); what stands still is drawn once a size.
    """

    def __init__(self, map_config: MapConfig):
        self.map_config = map_config
        self._background: pygame.Surface | None = None
        self._rect = pygame.Rect(0, 0, 1, 1)
        self._scale = 1.0

    def draw(
        self,
        surface: pygame.Surface,
        area: pygame.Rect,
        pose: Pose,
        forces: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
        trail: Sequence[Pose] = (),
    ) -> pygame.Rect:
        """Draws the world into the middle of `area`, in its own shape.

        Args:
            surface: what to draw on.
            area: where, px.
            pose: of the table (px, px, rad).
            forces: robot xy, human xy in [-1, 1], drawn as arrows.
            trail: earlier poses, oldest first; drawn as the ways of the two ends.

        Returns:
            The rectangle that the world fills.
        """
        rect = letterbox(area)
        if self._background is None or rect.size != self._rect.size:
            self._scale = rect.width / WINDOW[0]
            self._background = self._draw_background(rect.size)
        self._rect = rect
        clip = surface.get_clip()
        surface.blit(self._background, rect)
        surface.set_clip(rect.clip(clip))
        self._draw_trail(surface, trail)
        self._draw_table(surface, pose)
        for seat, colour in enumerate(SEATS):
            self._draw_force(surface, pose, seat, (forces[2 * seat], forces[2 * seat + 1]), colour)
        surface.set_clip(clip)
        return rect

    def to_screen(self, point: Point) -> Point:
        """Where a point of the world was drawn last, px of the surface."""
        return self._rect.left + point[0] * self._scale, self._rect.top + point[1] * self._scale

    def _of_table(self, pose: Pose, points: Sequence[Point]) -> list[Point]:
        return [self.to_screen(placed(pose, point)) for point in points]

    def _draw_background(self, size: tuple[int, int]) -> pygame.Surface:
        scale = self._scale
        floor = pygame.Surface(size, depth=32)
        floor.fill(FLOOR)
        for x in range(_DOTS, WINDOW[0], _DOTS):
            for y in range(_DOTS, WINDOW[1], _DOTS):
                pygame.draw.circle(floor, FLOOR_DOT, (x * scale, y * scale), max(1.0, 1.6 * scale))
        goal = self.map_config.goal
        _draw_goal(floor, (goal[0] * scale, goal[1] * scale), GOAL_SIZE * scale)
        start_x, start_y, _ = self.map_config.start
        with SmoothPatch(floor, [(start_x * scale, start_y * scale)], 14 * scale) as patch:
            patch.circle(mix(FLOOR, INK, 0.25), (start_x * scale, start_y * scale), 10 * scale, 3 * scale)
        for (x, y), side in self.map_config.squares:
            _draw_obstacle(floor, (x * scale, y * scale), side * scale)
        pygame.draw.rect(floor, mix(FLOOR, INK, 0.55), floor.get_rect(), max(2, round(4 * scale)))
        return floor

    def _draw_trail(self, surface: pygame.Surface, trail: Sequence[Pose]) -> None:
        if len(trail) < 2:
            return
        width = max(2, round(3 * self._scale))
        for seat, colour in enumerate(SEATS):
            points = [self.to_screen(placed(pose, TableOutline.hands[seat])) for pose in trail]
            pale = mix(colour, FLOOR, 0.55)
            pygame.draw.lines(surface, pale, False, points, width)
            pygame.draw.aalines(surface, pale, False, points)

    def _draw_table(self, surface: pygame.Surface, pose: Pose) -> None:
        scale = self._scale
        edge = 2.5 * scale
        board = self._of_table(pose, board_outline())
        triangle = self._of_table(pose, TRIANGLE)
        (circle,) = self._of_table(pose, [CIRCLE_CENTRE])
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
                patch.outline(rim, _shrunk(outline, edge / 2), edge)
            for v in (-14.0, 0.0, 14.0):
                start, end = self._of_table(pose, [(-44.0, v), (39.0, v)])
                patch.line(mix(WOOD, WOOD_EDGE, 0.3), start, end, 1.6 * scale)
            patch.circle(SEATS[1], circle, radius)
            patch.circle(mix(SEATS[1], INK, 0.4), circle, radius, edge)

    def _draw_force(
        self, surface: pygame.Surface, pose: Pose, seat: int, force: Point, colour: tuple[int, int, int]
    ) -> None:
        strength = math.hypot(*force)
        if strength < 0.03:
            return
        scale = self._scale
        (tail,) = self._of_table(pose, [TableOutline.hands[seat]])
        u, v = force[0] / strength, force[1] / strength
        length = TableOutline.arrow * strength * scale
        head = min(20 * scale, 0.6 * length)
        neck = (tail[0] + u * (length - head), tail[1] + v * (length - head))
        tip = (tail[0] + u * length, tail[1] + v * length)

        def barbs(size: float) -> list[Point]:
            return [
                (tip[0] + u * size * 0.5, tip[1] + v * size * 0.5),
                (
                    neck[0] - v * (head * 0.62 + size) - u * size * 0.4,
                    neck[1] + u * (head * 0.62 + size) - v * size * 0.4,
                ),
                (
                    neck[0] + v * (head * 0.62 + size) - u * size * 0.4,
                    neck[1] - u * (head * 0.62 + size) - v * size * 0.4,
                ),
            ]

        with SmoothPatch(surface, [tail, tip], head + 8 * scale) as patch:
            # A white rim keeps the arrow apart from whatever lies below.
            for grown, paint in ((2.2 * scale, _LIT), (0.0, mix(colour, INK, 0.12))):
                patch.line(paint, tail, neck, 7 * scale + 2 * grown)
                patch.polygon(paint, barbs(grown))
            patch.circle(mix(colour, INK, 0.4), tail, 5 * scale)


def _shrunk(outline: Sequence[Point], by: float) -> list[Point]:
    """An outline moved towards its middle, so that a border drawn along it stays inside."""
    x0 = sum(x for x, _ in outline) / len(outline)
    y0 = sum(y for _, y in outline) / len(outline)
    moved = []
    for x, y in outline:
        distance = math.hypot(x - x0, y - y0) or 1.0
        share = 1 - by / distance
        moved.append((x0 + share * (x - x0), y0 + share * (y - y0)))
    return moved


def _draw_goal(surface: pygame.Surface, centre: Point, size: float) -> None:
    square = pygame.Rect(0, 0, round(size), round(size))
    square.center = (round(centre[0]), round(centre[1]))
    pygame.draw.rect(surface, mix(GREEN, FLOOR, 0.62), square)
    with SmoothPatch(surface, [centre], size / 2) as patch:
        for share, colour in ((0.42, GREEN), (0.31, FLOOR), (0.2, GREEN), (0.08, FLOOR)):
            patch.circle(colour, centre, share * size)
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
