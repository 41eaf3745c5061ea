"""The pictures of a film of a replay, drawn without a display."""

import io
from collections.abc import Iterator
from pathlib import Path

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.staging import new_file

from ..screen.canvas import new_surface
from ..sdl import pygame
from .playback import Playback
from .track import Track, sampled
from .view import SIZE, ReplayView, Shown

LAST_S = 1.0
"""How long the last picture of a film stays."""


def picture_size(width: int) -> tuple[int, int]:
    """Width and height of a picture, even numbers as films want them, px.

    Raises:
        InvalidValueError: too small to see anything, or larger than any film.
    """
    if not 200 <= width <= 7680:
        raise InvalidValueError("width", "200 to 7680 px", width)
    return width // 2 * 2, round(width * SIZE[1] / SIZE[0] / 2) * 2


def picture_count(track: Track, frames_per_second: float, speed: float) -> int:
    """How many pictures `pictures` gives."""
    return len(sampled(track, frames_per_second, speed)) + round(LAST_S * frames_per_second)


def pictures(track: Track, size: tuple[int, int], frames_per_second: float, speed: float) -> Iterator[pygame.Surface]:
    """The pictures in order; the same surface each time, drawn anew."""
    surface = new_surface(size)
    view = ReplayView(track)
    shown = Shown(hint=False)
    playback = Playback(track.steps, speed=speed, hz=track.hz)
    for position in sampled(track, frames_per_second, speed):
        playback.position = position
        view.draw(surface, playback, shown)
        yield surface
    playback.playing = False
    view.draw(surface, playback, shown)
    for _ in range(round(LAST_S * frames_per_second)):
        yield surface


def write_png(surface: pygame.Surface, path: Path) -> None:
    """Writes a picture, whole or not at all.

    Raises:
        OutputExistsError: the file exists.
        OSError: it cannot be written.
    """
    encoded = io.BytesIO()
    pygame.image.save(surface, encoded, "picture.png")
    with new_file(path) as partial:
        partial.write_bytes(encoded.getvalue())
