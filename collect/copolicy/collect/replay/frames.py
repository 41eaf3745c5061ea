"""The frames of a replay's video, drawn without a display."""

import io
from collections.abc import Iterator
from pathlib import Path

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.staging import new_file

from ..screen.canvas import new_surface
from ..sdl import pygame
from .playback import Playback
from .track import Track, frame_positions
from .view import SIZE, ReplayView, ViewOptions

LAST_FRAME_S = 1.0
"""How long the last frame of a video is shown, s."""


def frame_size(width: int) -> tuple[int, int]:
    """Returns width and height of a frame, px; even numbers, as H.264 requires.

    Raises:
        InvalidValueError: the width is too small or too large.
    """
    if not 200 <= width <= 7680:
        raise InvalidValueError("width", "200 to 7680 px", width)
    return width // 2 * 2, round(width * SIZE[1] / SIZE[0] / 2) * 2


def frame_count(track: Track, frames_per_second: float, speed: float) -> int:
    """Returns the number of frames that `render_frames` yields."""
    return len(frame_positions(track, frames_per_second, speed)) + round(LAST_FRAME_S * frames_per_second)


def render_frames(
    track: Track, size: tuple[int, int], frames_per_second: float, speed: float
) -> Iterator[pygame.Surface]:
    """Yields the frames in order; the same surface each time, drawn again."""
    surface = new_surface(size)
    view = ReplayView(track)
    options = ViewOptions(hint=False)
    playback = Playback(track.steps, speed=speed, hz=track.hz)
    for position in frame_positions(track, frames_per_second, speed):
        playback.position = position
        view.draw(surface, playback, options)
        yield surface
    playback.playing = False
    view.draw(surface, playback, options)
    for _ in range(round(LAST_FRAME_S * frames_per_second)):
        yield surface


def write_png(surface: pygame.Surface, path: Path) -> None:
    """Writes a surface as PNG, atomically.

    Raises:
        OutputExistsError: the file exists.
        OSError: the file cannot be written.
    """
    encoded = io.BytesIO()
    pygame.image.save(surface, encoded, "image.png")
    with new_file(path) as partial:
        partial.write_bytes(encoded.getvalue())
