"""Antialiased shapes: drawn at a multiple of their size on a small part of a surface, then scaled down.

pygame rounds corners to whole pixels, so that a body at 20 px/s would visibly jump. Drawn at three times its size it
moves by thirds of a pixel and has smooth edges.
"""

from collections.abc import Sequence

from ..sdl import pygame
from .palette import Colour

Point = tuple[float, float]


class SmoothPatch:
    """A rectangle of a surface in which shapes are drawn with smooth edges; `close` copies them to the surface.

    Coordinates are those of the surface, in fractional px.
    """

    def __init__(self, surface: pygame.Surface, corners: Sequence[Point], margin: float):
        """
        Args:
            surface: to draw on.
            corners: points whose bounding box contains the shapes.
            margin: how far shapes may extend beyond that box, px.
        """
        left = int(min(x for x, _ in corners) - margin)
        top = int(min(y for _, y in corners) - margin)
        right = int(max(x for x, _ in corners) + margin) + 1
        bottom = int(max(y for _, y in corners) + margin) + 1
        self._surface = surface
        self._rect = pygame.Rect(left, top, right - left, bottom - top).clip(surface.get_rect())
        # Twice the size is enough for a large patch.
        self._factor = 3 if max(self._rect.size) < 320 else 2
        self._size = (self._rect.width * self._factor, self._rect.height * self._factor)
        self._canvas = pygame.Surface(self._size, pygame.SRCALPHA)

    def __enter__(self) -> "SmoothPatch":
        return self

    def __exit__(self, error_type: type[BaseException] | None, *_: object) -> None:
        if error_type is None:
            self.close()

    def polygon(self, colour: Colour, points: Sequence[Point]) -> None:
        """Draws a filled polygon."""
        pygame.draw.polygon(self._canvas, colour, [self._to_patch(point) for point in points])

    def circle(self, colour: Colour, centre: Point, radius: float, width: float = 0.0) -> None:
        """Draws a disc, or a ring if there is a width."""
        thickness = max(1, round(width * self._factor)) if width else 0
        pygame.draw.circle(self._canvas, colour, self._to_patch(centre), radius * self._factor, thickness)

    def line(self, colour: Colour, start: Point, end: Point, width: float) -> None:
        """Draws a straight line with round ends."""
        self._stroke(colour, start, end, width / 2)

    def outline(self, colour: Colour, points: Sequence[Point], width: float) -> None:
        """Draws the closed border of a polygon with round corners."""
        for start, end in zip(points, [*points[1:], points[0]], strict=True):
            self._stroke(colour, start, end, width / 2)

    def close(self) -> None:
        """Copies the shapes to the surface."""
        if self._rect.width and self._rect.height:
            shrunk = pygame.transform.smoothscale(self._canvas, self._rect.size)
            # Averaging opaque shapes on transparent black gives colours that are premultiplied by alpha.
            self._surface.blit(shrunk, self._rect, special_flags=pygame.BLEND_PREMULTIPLIED)

    def _stroke(self, colour: Colour, start: Point, end: Point, half: float) -> None:
        dx, dy = end[0] - start[0], end[1] - start[1]
        length = (dx * dx + dy * dy) ** 0.5
        if length > 0:
            u, v = -dy / length * half, dx / length * half
            corners = ((start[0] + u, start[1] + v), (end[0] + u, end[1] + v))
            back = ((end[0] - u, end[1] - v), (start[0] - u, start[1] - v))
            self.polygon(colour, (*corners, *back))
        for point in (start, end):
            self.circle(colour, point, half)

    def _to_patch(self, point: Point) -> Point:
        return (point[0] - self._rect.left) * self._factor, (point[1] - self._rect.top) * self._factor
