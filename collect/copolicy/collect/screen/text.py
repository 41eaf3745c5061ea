"""Text on the screen, in the font that pygame brings along."""

import functools
from typing import Literal

from ..sdl import pygame
from .palette import TEXT, Colour

Anchor = Literal[
    "topleft", "midtop", "topright", "midleft", "center", "midright", "bottomleft", "midbottom", "bottomright"
]


def draw_text(
    surface: pygame.Surface,
    text: str,
    at: tuple[float, float],
    size: float,
    colour: Colour = TEXT,
    anchor: Anchor = "topleft",
    max_width: float | None = None,
) -> pygame.Rect:
    """Writes one line; `at` is the place of its `anchor`, `size` the height of the font, px.

    A line that is wider than `max_width` is written smaller, down to half the size, and cut after that.

    Returns:
        Where it stands.
    """
    rendered = _fitted(text, max(8, round(size)), colour, None if max_width is None else max(1, round(max_width)))
    rect = rendered.get_rect(**{anchor: (round(at[0]), round(at[1]))})
    surface.blit(rendered, rect)
    return rect


def text_size(text: str, size: float) -> tuple[int, int]:
    """Width and height of a line, px."""
    return _font(max(8, round(size))).size(text)


@functools.lru_cache(maxsize=512)
def _fitted(text: str, size: int, colour: Colour, max_width: int | None) -> pygame.Surface:
    if max_width is not None:
        width = _font(size).size(text)[0]
        if width > max_width:
            size = max(8, size // 2, int(size * max_width / width))
            while len(text) > 2 and _font(size).size(text)[0] > max_width:
                text = text[:-2] + "…"
    return _font(size).render(text, True, colour)


@functools.lru_cache(maxsize=64)
def _font(size: int) -> pygame.font.Font:
    if not pygame.font.get_init():
        pygame.font.init()
    return pygame.font.Font(None, size)
