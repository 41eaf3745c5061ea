"""Drawing of a task's world from its outline: floor, fixed shapes, trails, body and forces, at any size."""

import math
from collections.abc import Sequence
from typing import Any

from copolicy.dataset.outline import Outline, Pose, to_scene
from copolicy.dataset.task import PairTask, SceneView

from ..sdl import pygame
from .canvas import new_surface
from .palette import FLOOR, FLOOR_DOT, GREEN, INK, OBSTACLE, SEATS, SHADOW, WOOD, WOOD_EDGE, Colour, mix
from .patch import Point, SmoothPatch

_FULL = (1200, 600)  # px; size of a world in which line widths are as given below
_DOTS = 50  # px between the dots on the floor
_WHITE = (255, 255, 255)
_FILLS: dict[str, Colour] = {"body": WOOD, "robot": SEATS[0], "human": SEATS[1]}


def scene_view(task: PairTask, scenario: Any) -> SceneView:
    """Returns a view that draws a scenario: the task's own, or else one of its outline.

    Raises:
        CopolicyError: the task has no outline.
    """
    return task.view(scenario) or OutlineView(task.required_outline, scenario)


def letterbox(area: pygame.Rect, size: tuple[float, float]) -> pygame.Rect:
    """Returns the largest rectangle with the aspect ratio of `size`, centred in an area."""
    scale = min(area.width / size[0], area.height / size[1])
    rect = pygame.Rect(0, 0, max(1, round(size[0] * scale)), max(1, round(size[1] * scale)))
    rect.center = area.center
    return rect


class OutlineView:
    """Draws one scenario and its moving body into a rectangle of a surface; see `SceneView`.

    The rectangle's size sets the scale; fixed shapes are drawn once per size. A task with a more detailed look
    overrides how its floor, its fixed shapes and its body are drawn.
    """

    def __init__(self, outline: Outline, scenario: Any):
        self._outline = outline
        self._fixed = outline.fixed(scenario)
        self._background: pygame.Surface | None = None
        self._rect = pygame.Rect(0, 0, 1, 1)
        self._scale = 1.0  # px of the surface per unit of the outline
        self._px = 1.0  # px of the surface per px of line widths and marks

    def draw(
        self,
        surface: pygame.Surface,
        area: pygame.Rect,
        pose: Pose,
        forces: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
        trail: Sequence[Pose] = (),
    ) -> pygame.Rect:
        """Draws the world, centred in `area`; the trail is drawn as the paths of both hands."""
        rect = letterbox(area, self._outline.size)
        if self._background is None or rect.size != self._rect.size:
            width, height = self._outline.size
            self._scale = rect.width / width
            wide = width / height >= _FULL[0] / _FULL[1]
            self._px = rect.width / _FULL[0] if wide else rect.height / _FULL[1]
            self._background = self._draw_background(rect.size)
        self._rect = rect
        clip = surface.get_clip()
        surface.blit(self._background, rect)
        surface.set_clip(rect.clip(clip))
        self._draw_trail(surface, trail)
        self._draw_body(surface, pose)
        for seat in range(2):
            self._draw_force(surface, pose, seat, (forces[2 * seat], forces[2 * seat + 1]))
        surface.set_clip(clip)
        return rect

    def to_screen(self, point: Point) -> Point:
        """Returns a point of the world in px of the surface, by the last call of `draw`."""
        return self._rect.left + point[0] * self._scale, self._rect.top + point[1] * self._scale

    def _body_points(self, pose: Pose, points: Sequence[Point]) -> list[Point]:
        return [self.to_screen(to_scene(pose, point)) for point in points]

    def _draw_background(self, size: tuple[int, int]) -> pygame.Surface:
        floor = new_surface(size)
        floor.fill(FLOOR)
        px = self._px
        width, height = (round(side / px) for side in size)
        for x in range(_DOTS, width, _DOTS):
            for y in range(_DOTS, height, _DOTS):
                pygame.draw.circle(floor, FLOOR_DOT, (x * px, y * px), max(1.0, 1.6 * px))
        self._draw_fixed(floor)
        pygame.draw.rect(floor, mix(FLOOR, INK, 0.55), floor.get_rect(), max(2, round(4 * px)))
        return floor

    def _draw_fixed(self, floor: pygame.Surface) -> None:
        edge, drop = 3 * self._px, 4 * self._px
        for role, shape in self._fixed:
            corners = [(x * self._scale, y * self._scale) for x, y in shape]
            with SmoothPatch(floor, corners, drop + edge) as patch:
                if role == "start":
                    patch.outline(mix(FLOOR, INK, 0.25), corners, edge)
                    continue
                if role == "obstacle":
                    patch.polygon(SHADOW, [(x + drop, y + drop) for x, y in corners])
                colour, rim = (mix(GREEN, FLOOR, 0.45), GREEN) if role == "goal" else (OBSTACLE, INK)
                patch.polygon(colour, corners)
                patch.outline(rim, corners, edge)

    def _draw_trail(self, surface: pygame.Surface, trail: Sequence[Pose]) -> None:
        if len(trail) < 2:
            return
        width = max(2, round(3 * self._px))
        for hand, colour in zip(self._outline.hands, SEATS, strict=True):
            points = [self.to_screen(to_scene(pose, hand)) for pose in trail]
            pale = mix(colour, FLOOR, 0.55)
            pygame.draw.lines(surface, pale, False, points, width)
            pygame.draw.aalines(surface, pale, False, points)

    def _draw_body(self, surface: pygame.Surface, pose: Pose) -> None:
        edge, drop = 2.5 * self._px, 5 * self._px
        shapes = [(role, self._body_points(pose, corners)) for role, corners in self._outline.body]
        with SmoothPatch(surface, [point for _, corners in shapes for point in corners], drop + 2 * edge) as patch:
            for _, corners in shapes:
                patch.polygon(SHADOW, [(x + drop, y + drop) for x, y in corners])
            for role, corners in shapes:
                colour = _FILLS.get(role, WOOD)
                patch.polygon(colour, corners)
                patch.outline(WOOD_EDGE if colour == WOOD else mix(colour, INK, 0.4), shrunk(corners, edge / 2), edge)
            if not {"robot", "human"} <= {role for role, _ in shapes}:  # the body has no shapes for the seats
                for hand, colour in zip(self._outline.hands, SEATS, strict=True):
                    (centre,) = self._body_points(pose, [hand])
                    patch.circle(mix(colour, INK, 0.4), centre, 7 * self._px)
                    patch.circle(colour, centre, 5 * self._px)

    def _draw_force(self, surface: pygame.Surface, pose: Pose, seat: int, force: Point) -> None:
        strength = math.hypot(*force)
        if strength < 0.03:
            return
        px, colour = self._px, SEATS[seat]
        (tail,) = self._body_points(pose, [self._outline.hands[seat]])
        u, v = force[0] / strength, force[1] / strength
        length = self._outline.arrow * strength * self._scale
        head = min(20 * px, 0.6 * length)
        neck = (tail[0] + u * (length - head), tail[1] + v * (length - head))
        tip = (tail[0] + u * length, tail[1] + v * length)

        def barbs(size: float) -> list[Point]:
            x, y = neck[0] - u * size * 0.4, neck[1] - v * size * 0.4
            side = head * 0.62 + size
            return [
                (tip[0] + u * size * 0.5, tip[1] + v * size * 0.5),
                (x - v * side, y + u * side),
                (x + v * side, y - u * side),
            ]

        with SmoothPatch(surface, [tail, tip], head + 8 * px) as patch:
            # A white rim separates the arrow from the background.
            for rim, paint in ((2.2 * px, _WHITE), (0.0, mix(colour, INK, 0.12))):
                patch.line(paint, tail, neck, 7 * px + 2 * rim)
                patch.polygon(paint, barbs(rim))
            patch.circle(mix(colour, INK, 0.4), tail, 5 * px)


def shrunk(outline: Sequence[Point], by: float) -> list[Point]:
    """Returns a polygon moved towards its centre by a distance, so that a border drawn along it stays inside."""
    x0 = sum(x for x, _ in outline) / len(outline)
    y0 = sum(y for _, y in outline) / len(outline)
    moved = []
    for x, y in outline:
        distance = math.hypot(x - x0, y - y0) or 1.0
        factor = 1 - by / distance
        moved.append((x0 + factor * (x - x0), y0 + factor * (y - y0)))
    return moved
