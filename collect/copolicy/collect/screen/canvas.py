"""A surface of any size with fixed units, by default 1200 x 760: a bar, the world, and a panel for each player."""

from ..sdl import pygame
from .palette import FLOOR, INK, PANEL, PANEL_EDGE, SEATS, SURROUND, TEXT, Colour, mix
from .patch import Point, SmoothPatch
from .text import Anchor, draw_text

SIZE = (1200, 760)
WORLD = (0, 60, 1200, 600)
"""Left, top, width and height of the world."""


def new_surface(size: tuple[int, int]) -> pygame.Surface:
    """Makes a surface of 32 bits: pygame 2.6 crashes on antialiased lines near the edge of a surface of 24 bits."""
    return pygame.Surface(size, depth=32)


class Canvas:
    """Draws on a surface in fixed units, scaled to the largest centred area that fits."""

    def __init__(self, surface: pygame.Surface, size: tuple[int, int] = SIZE):
        self.surface = surface
        width, height = surface.get_size()
        self.scale = min(width / size[0], height / size[1])
        self._left = (width - size[0] * self.scale) / 2
        self._top = (height - size[1] * self.scale) / 2

    def clear(self) -> None:
        """Fills the surface with the background colour."""
        self.surface.fill(SURROUND)

    def point(self, x: float, y: float) -> Point:
        """Returns a point in px of the surface."""
        return self._left + x * self.scale, self._top + y * self.scale

    def rect(self, x: float, y: float, width: float, height: float) -> pygame.Rect:
        """Returns a rectangle in px of the surface."""
        left, top = self.point(x, y)
        right, bottom = self.point(x + width, y + height)
        return pygame.Rect(round(left), round(top), round(right) - round(left), round(bottom) - round(top))

    def text(
        self,
        text: str,
        position: Point,
        size: float = 26,
        colour: Colour = TEXT,
        anchor: Anchor = "topleft",
        max_width: float | None = None,
    ) -> None:
        """Draws one line of text, see `draw_text`."""
        limit = None if max_width is None else max_width * self.scale
        draw_text(self.surface, text, self.point(*position), size * self.scale, colour, anchor, limit)

    def box(
        self, x: float, y: float, width: float, height: float, fill: Colour = PANEL, edge: Colour = PANEL_EDGE
    ) -> None:
        """Draws a panel with round corners."""
        rect = self.rect(x, y, width, height)
        radius = round(12 * self.scale)
        pygame.draw.rect(self.surface, fill, rect, border_radius=radius)
        pygame.draw.rect(self.surface, edge, rect, max(1, round(2 * self.scale)), border_radius=radius)

    def bar(self, x: float, y: float, width: float, height: float, fraction: float, colour: Colour) -> None:
        """Draws a bar, filled to a fraction in [0, 1]."""
        fraction = min(1.0, max(0.0, fraction))
        middle, half = y + height / 2, height / 2
        start, end = self.point(x + half, middle), self.point(x + width - half, middle)
        with SmoothPatch(self.surface, [start, end], height * self.scale) as patch:
            patch.line(PANEL_EDGE, start, end, height * self.scale)
            if fraction > 0:
                filled = self.point(x + half + fraction * (width - height), middle)
                patch.line(colour, start, filled, height * self.scale)

    def dim(self) -> None:
        """Darkens everything drawn so far, behind a dialog."""
        shade = pygame.Surface(self.surface.get_size(), depth=32)
        shade.fill(INK)
        shade.set_alpha(135)
        self.surface.blit(shade, (0, 0))

    def patch(self, x: float, y: float, reach: float) -> SmoothPatch:
        """Returns a patch for smooth shapes around a point; `reach` is in units, the patch draws in px."""
        return SmoothPatch(self.surface, [self.point(x, y)], reach * self.scale)

    def seat_mark(self, seat: int, x: float, y: float, radius: float) -> None:
        """Draws the mark of a seat: a blue triangle or an orange circle."""
        centre_x, centre_y = self.point(x, y)
        r = radius * self.scale
        colour, rim = SEATS[seat], mix(SEATS[seat], FLOOR, 0.75)
        with self.patch(x, y, radius + 4) as patch:
            if seat == 1:
                patch.circle(rim, (centre_x, centre_y), r)
                patch.circle(colour, (centre_x, centre_y), 0.84 * r)
                return
            for size, paint in ((1.0, rim), (0.72, colour)):
                corners = ((0.0, -1.0), (0.95, 0.72), (-0.95, 0.72))
                patch.polygon(paint, [(centre_x + u * size * r, centre_y + v * size * r) for u, v in corners])

    def stick(self, x: float, y: float, radius: float, deflection: Point, seat: int, dead_zone: float = 0.0) -> None:
        """Draws a stick from above: its range, its dead zone, and its deflection, x and y in [-1, 1]."""
        centre = self.point(x, y)
        r = radius * self.scale
        with self.patch(x, y, radius + 10) as patch:
            patch.circle(PANEL_EDGE, centre, r)
            patch.circle(SURROUND, centre, r - 2.5 * self.scale)
            if dead_zone > 0:
                patch.circle(PANEL_EDGE, centre, r * dead_zone)
            dot = (centre[0] + deflection[0] * r * 0.86, centre[1] + deflection[1] * r * 0.86)
            patch.line(mix(SEATS[seat], SURROUND, 0.45), centre, dot, 5 * self.scale)
            patch.circle(mix(SEATS[seat], FLOOR, 0.75), dot, max(6, radius * 0.2) * self.scale)
            patch.circle(SEATS[seat], dot, max(6, radius * 0.2) * self.scale * 0.78)
