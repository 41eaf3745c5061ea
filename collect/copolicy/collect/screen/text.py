"""Text on the screen, in pygame's default font."""

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
    position: tuple[float, float],
    size: float,
    colour: Colour = TEXT,
    anchor: Anchor = "topleft",
    max_width: float | None = None,
) -> pygame.Rect:
    """Draws one line of text; `position` is that of its `anchor`, `size` the height of the font, px.

    A line wider than `max_width` is drawn smaller, down to half the size, and then truncated.

    Returns:
        The rectangle of the text.
    """
    rendered = _fitted(text, max(8, round(size)), colour, None if max_width is None else max(1, round(max_width)))
    rect = rendered.get_rect(**{anchor: (round(position[0]), round(position[1]))})
    surface.blit(rendered, rect)
    return rect


def text_size(text: str, size: float) -> tuple[int, int]:
    """Returns width and height of a line, px."""
    return _font(max(8, round(size))).size(text)


def wrapped(text: str, size: float, width: float) -> list[str]:
    """The lines of a text that fit in a width, px; a longer word has a line of its own."""
    lines: list[str] = []
    for word in text.split():
        joined = f"{lines[-1]} {word}" if lines else word
        if lines and text_size(joined, size)[0] > width:
            lines.append(word)
        else:
            lines[-1:] = [joined]
    return lines


def fitted_lines(text: str, size: float, width: float, lines: int, scale: float = 1.0) -> tuple[float, list[str]]:
    """The largest size up to `size` at which a text has no more lines than fit, and its lines; nothing is left out.

    A smaller font has room for more lines: as many as have the height of `lines` lines of the given size.

    Args:
        size: height of the font.
        width: of the lines.
        lines: number of lines of the given size.
        scale: px per unit of `size` and `width`.
    """
    height, smallest = size * lines, size / 2
    while True:
        found = wrapped(text, size * scale, width * scale)
        if size * len(found) <= height or size - 1 < smallest:
            return size, found
        size -= 1


@functools.lru_cache(maxsize=512)
def _fitted(text: str, size: int, colour: Colour, max_width: int | None) -> pygame.Surface:
    if max_width is not None:
        width = _font(size).size(text)[0]
        if width > max_width:
            smallest, size = max(8, size // 2), int(size * max_width / width)
            # The width of a font is not proportional to its size.
            while size > smallest and _font(size).size(text)[0] > max_width:
                size -= 1
            size = max(size, smallest)
            while len(text) > 2 and _font(size).size(text)[0] > max_width:
                text = text[:-2] + "…"
    return _font(size).render(text, True, colour)


@functools.lru_cache(maxsize=64)
def _font(size: int) -> pygame.font.Font:
    if not pygame.font.get_init():
        pygame.font.init()
    return pygame.font.Font(None, size)
