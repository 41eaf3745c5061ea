"""What a demonstration shows: the world, and below it who holds which end."""

from collections.abc import Iterator

from copolicy.dataset.task import SceneView

from ..replay.pictures import LAST_S
from ..replay.track import Track, sampled
from ..screen.canvas import Canvas
from ..screen.dialogs import outcome_colour, outcome_text
from ..screen.outline_view import scene_view
from ..screen.palette import MUTED, TEXT
from ..sdl import pygame

SIZE = (1200, 690)
"""Units of the picture."""

_WORLD = (0, 0, 1200, 600)
_CAPTION_Y = 646
_TRAIL_STRIDE = 3  # steps


def pictures(track: Track, size: tuple[int, int], frames_per_second: int, speed: float) -> Iterator[pygame.Surface]:
    """The pictures of an episode in order; the same surface each time, drawn anew.

    Args:
        track: the episode.
        size: of the surface, px.
        frames_per_second: of the film.
        speed: times real time.
    """
    # pygame 2.6 crashes where it draws smooth lines near the edge of a surface of 24 bits.
    surface = pygame.Surface(size, depth=32)
    view = scene_view(track.task, track.episode.scenario)
    positions = sampled(track, frames_per_second, speed)
    for position in [*positions, *[positions[-1]] * round(LAST_S * frames_per_second)]:
        _draw(surface, view, track, position, speed)
        yield surface


def _draw(surface: pygame.Surface, view: SceneView, track: Track, position: float, speed: float) -> None:
    canvas = Canvas(surface, SIZE)
    canvas.clear()
    pose = track.pose_at(position)
    trail = [*track.poses[: int(position) + 1 : _TRAIL_STRIDE], pose]
    view.draw(surface, canvas.rect(*_WORLD), pose, track.forces_at(position), trail)
    # Whole sizes of a GIF of 600 px stay readable at half of these.
    canvas.seat_mark(0, 40, _CAPTION_Y, 20)
    canvas.text("robot", (72, _CAPTION_Y - 16), 36, TEXT, "midleft")
    canvas.text(track.episode.meta.controller_0, (72, _CAPTION_Y + 18), 28, MUTED, "midleft", 400)
    ended = position >= track.steps
    reason = track.episode.meta.termination_reason
    if ended:
        canvas.text(outcome_text(reason), (600, _CAPTION_Y), 48, outcome_colour(track.task.spec, reason), "center")
    else:
        canvas.text(f"{position / track.hz:.0f} s", (600, _CAPTION_Y - 10), 44, TEXT, "center")
        canvas.text(f"{speed:g}x", (600, _CAPTION_Y + 26), 26, MUTED, "center")
    canvas.text("simulated partner", (1128, _CAPTION_Y - 16), 36, TEXT, "midright")
    canvas.text("no person takes part", (1128, _CAPTION_Y + 18), 28, MUTED, "midright")
    canvas.seat_mark(1, 1160, _CAPTION_Y, 20)
