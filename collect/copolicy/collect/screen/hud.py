"""The bars around the world during an episode: progress, time, score, and both players' forces."""

import math
from dataclasses import dataclass

from ..sdl import pygame
from .canvas import Canvas
from .palette import GREEN, MUTED, PANEL_EDGE, SKY, TEXT, VERMILION, YELLOW, Colour
from .patch import Point

_PANEL = 350  # width of a player's panel


@dataclass(frozen=True)
class SeatStatus:
    """The content of one player's panel.

    Attributes:
        label: the player's device or agent.
        force: x, y in [-1, 1].
        lost: the device is gone.
    """

    label: str
    force: Point = (0.0, 0.0)
    lost: bool = False


@dataclass(frozen=True)
class Hud:
    """The content of the bars.

    Attributes:
        title: of the session and the episode.
        progress: of the session, in [0, 1].
        seconds: since the start of the episode.
        limit_s: time limit of the episode.
        score: sum of rewards so far.
        seats: robot, human.
        interaction: measure in the task's unit; None if the task has none.
        interaction_senses: meaning of positive, negative and zero values, see `TaskWords`.
        interaction_missing: why there is no measure.
        late_ticks: late and skipped ticks of this episode.
        hz: rate of the loop; nan before the episode.
        practice: the episode does not count.
        running: the episode has begun, so that the interaction is shown.
    """

    title: str
    progress: float
    seconds: float
    limit_s: float
    score: float
    seats: tuple[SeatStatus, SeatStatus]
    interaction: float | None = 0.0
    interaction_senses: tuple[str, str, str] = ("positive", "negative", "zero")
    interaction_missing: str = ""
    late_ticks: int = 0
    hz: float = math.nan
    practice: bool = False
    running: bool = True


def draw_hud(canvas: Canvas, hud: Hud) -> None:
    """Draws the bars above and below the world."""
    canvas.text(hud.title, (20, 12), 32, max_width=380)
    canvas.bar(20, 44, 300, 8, hud.progress, GREEN)
    colour: Colour = VERMILION if hud.limit_s - hud.seconds < 5 else TEXT
    canvas.text(f"{hud.seconds:.1f}", (612, 30), 50, colour, "midright")
    canvas.text(f"of {hud.limit_s:.0f} s", (624, 36), 24, MUTED, "midleft")
    canvas.text("practice" if hud.practice else "score", (1085, 36), 24, YELLOW if hud.practice else MUTED, "midright")
    canvas.text(f"{hud.score:+.0f}", (1180, 30), 46, TEXT, "midright")
    for seat, status in enumerate(hud.seats):
        _draw_seat(canvas, seat, 10 if seat == 0 else 1190 - _PANEL, status)
    if hud.running:
        _draw_interaction(canvas, hud)


def _draw_seat(canvas: Canvas, seat: int, x: float, status: SeatStatus) -> None:
    canvas.box(x, 668, _PANEL, 84, edge=VERMILION if status.lost else PANEL_EDGE)
    canvas.seat_mark(seat, x + 42, 710, 24)
    canvas.text(status.label, (x + 80, 680), 28, max_width=_PANEL - 175)
    if status.lost:
        canvas.text("unplugged", (x + 80, 714), 26, VERMILION)
    else:
        strength = min(1.0, math.hypot(*status.force))
        canvas.bar(x + 80, 722, _PANEL - 190, 12, strength, SKY)
    canvas.stick(x + _PANEL - 50, 710, 34, status.force, seat)


def _draw_interaction(canvas: Canvas, hud: Hud) -> None:
    """Draws a scale of the interaction, labelled with the last word of each sense, and the rate of the loop."""
    x, y, width = 440, 706, 320
    if hud.interaction is None:
        canvas.text(hud.interaction_missing, (600, y + 6), 20, MUTED, "center", 440)
    else:
        positive, negative, _ = (sense.rpartition(" ")[2] for sense in hud.interaction_senses)
        canvas.text(negative, (x, 676), 22, MUTED)
        canvas.text(positive, (x + width, 676), 22, MUTED, "topright")
        canvas.bar(x, y, width, 12, 0.0, SKY)
        size = min(1.0, abs(hud.interaction))
        length = width / 2 * size
        middle = x + width / 2
        colour = VERMILION if size > 0.6 else SKY
        if size > 0.02:
            start = middle if hud.interaction > 0 else middle - length
            pygame.draw.rect(canvas.surface, colour, canvas.rect(start, y + 1, length, 10))
        pygame.draw.rect(canvas.surface, TEXT, canvas.rect(middle - 2, y - 5, 4, 22))
    if hud.late_ticks:
        canvas.text(f"late ticks: {hud.late_ticks}", (600, 742), 22, YELLOW, "center")
    elif math.isfinite(hud.hz):
        canvas.text(f"{hud.hz:.1f} steps a second", (600, 742), 20, MUTED, "center")
