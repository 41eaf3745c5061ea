"""The interaction measure of an episode over its time, with a cursor: positive above, negative below."""

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.task import PairTask

from ..screen.palette import MUTED, PANEL_EDGE, SKY, SURROUND, TEXT, VERMILION, Colour, mix
from ..screen.text import draw_text
from ..sdl import pygame

_MIN_RANGE = 0.5  # so that small values look small


class ForceGraph:
    """Draws the curve, once per size, and a cursor on it."""

    def __init__(self, interaction: Array | None, steps: int, task: PairTask):
        """
        Args:
            interaction: `(steps,)`, in the task's unit; None if it is not measured.
            steps: of the episode.
            task: gives the meaning of positive and negative values, or the text shown if there is no measure.
        """
        self._steps = steps
        self._missing = task.missing("interaction measure") if interaction is None else ""
        self._positive, self._negative, _ = task.words.interaction_senses
        self._forces = np.zeros(0) if interaction is None else interaction
        self._range = max(_MIN_RANGE, float(np.abs(self._forces).max(initial=0.0)) * 1.1)
        self._curve: pygame.Surface | None = None

    def x_of(self, rect: pygame.Rect, position: float) -> float:
        """Returns the x coordinate of a position (steps) in the rectangle, px."""
        return rect.left + rect.width * position / max(1, self._steps)

    def position_of(self, rect: pygame.Rect, x: float) -> float:
        """Returns the position of an x coordinate: the inverse of `x_of`."""
        return (x - rect.left) / rect.width * self._steps

    def draw(self, surface: pygame.Surface, rect: pygame.Rect, position: float | None, font: float) -> None:
        """Draws into a rectangle, with a cursor if there is a position; `font` is the height of text, px."""
        if self._missing:
            draw_text(surface, self._missing, rect.center, font, MUTED, "center", rect.width)
            return
        if self._curve is None or self._curve.get_size() != rect.size:
            self._curve = self._draw_curve(rect.size)
        surface.blit(self._curve, rect)
        if position is not None:
            self._shade(surface, rect, position)
        draw_text(surface, self._positive, (rect.left + 0.3 * font, rect.top + 0.1 * font), font, MUTED)
        draw_text(
            surface, self._negative, (rect.left + 0.3 * font, rect.bottom - 0.1 * font), font, MUTED, "bottomleft"
        )
        if position is None or not len(self._forces):
            return
        force = float(self._forces[min(int(position), len(self._forces) - 1)])
        x, y = round(self.x_of(rect, position)), round(rect.centery - force / self._range * rect.height / 2)
        thickness = max(2, round(font / 10))
        pygame.draw.rect(surface, TEXT, (x - thickness // 2, rect.top, thickness, rect.height))
        pygame.draw.circle(surface, SURROUND, (x, y), font * 0.42)
        pygame.draw.circle(surface, _colour(force), (x, y), font * 0.32)
        right = x < rect.right - 4 * font
        draw_text(
            surface,
            f"{force:+.2f}",
            (x + (0.5 if right else -0.5) * font, rect.top + 0.1 * font),
            1.15 * font,
            TEXT,
            "topleft" if right else "topright",
        )

    def _shade(self, surface: pygame.Surface, rect: pygame.Rect, position: float) -> None:
        """Fades the part of the curve after the cursor."""
        x = round(self.x_of(rect, position))
        shade = pygame.Surface((max(0, rect.right - x), rect.height), depth=32)
        shade.fill(SURROUND)
        shade.set_alpha(120)
        surface.blit(shade, (x, rect.top))

    def _draw_curve(self, size: tuple[int, int]) -> pygame.Surface:
        # Drawn at twice the size and scaled down, for smooth edges.
        width, height = 2 * size[0], 2 * size[1]
        canvas = pygame.Surface((width, height), depth=32)
        canvas.fill(SURROUND)
        middle = height // 2
        if len(self._forces):
            edges = np.linspace(0, len(self._forces), width + 1).astype(int)
            for x in range(width):
                column = self._forces[edges[x] : max(edges[x] + 1, edges[x + 1])]
                for extreme in (float(column.max()), float(column.min())):
                    top = middle - extreme / self._range * middle
                    fill = mix(_colour(extreme), SURROUND, 0.55)
                    pygame.draw.line(canvas, fill, (x, middle), (x, round(top)))
            xs = (np.arange(len(self._forces)) + 0.5) * width / len(self._forces)
            points = [(x, middle - f / self._range * middle) for x, f in zip(xs, self._forces, strict=True)]
            for (start, force), end in zip(zip(points, self._forces, strict=True), points[1:], strict=False):
                pygame.draw.line(canvas, _colour(float(force)), start, end, 4)
        pygame.draw.line(canvas, PANEL_EDGE, (0, middle), (width, middle), 3)
        return pygame.transform.smoothscale(canvas, size)


def _colour(force: float) -> Colour:
    return VERMILION if force > 0 else SKY
