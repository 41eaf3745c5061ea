"""What stands around the world while a pair plays: where the session is, time, score, and both players' inputs."""

import math
from dataclasses import dataclass

from ..sdl import pygame
from .canvas import Canvas
from .palette import GREEN, MUTED, PANEL_EDGE, SKY, TEXT, VERMILION, YELLOW, Colour
from .patch import Point

_PANEL = 350  # width of a player's panel


@dataclass(frozen=True)
class SeatStatus:
    """One player's panel.

    Attributes:
        who: the player and what they hold.
        force: in [-1, 1].
        lost: the device is gone.
    """

    who: str
    force: Point = (0.0, 0.0)
    lost: bool = False


@dataclass(frozen=True)
class Hud:
    """All that the bars show.

    Attributes:
        title: of the session and the episode.
        done: share of the session.
        seconds: since the episode's start.
        limit_s: of an episode.
        score: sum of rewards so far.
        seats: robot, human.
        interaction: units of a player's full force; None where it is not measured.
        senses: what it means where it is positive, negative and zero, see `TaskWords`.
        missing: why it is not measured.
        late: late and skipped ticks of this episode.
        hz: rate that the loop keeps, nan before it runs.
        practice: it does not count.
        carrying: there is an interaction to show.
    """

    title: str
    done: float
    seconds: float
    limit_s: float
    score: float
    seats: tuple[SeatStatus, SeatStatus]
    interaction: float | None = 0.0
    senses: tuple[str, str, str] = ("positive", "negative", "zero")
    missing: str = ""
    late: int = 0
    hz: float = math.nan
    practice: bool = False
    carrying: bool = True


def draw_hud(canvas: Canvas, hud: Hud) -> None:
    """Draws the bars above and below the world."""
    canvas.text(hud.title, (20, 12), 32, max_width=380)
    canvas.bar(20, 44, 300, 8, hud.done, GREEN)
    left = max(0.0, hud.limit_s - hud.seconds)
    colour: Colour = VERMILION if left < 5 else TEXT
    canvas.text(f"{hud.seconds:.1f}", (612, 30), 50, colour, "midright")
    canvas.text(f"of {hud.limit_s:.0f} s", (624, 36), 24, MUTED, "midleft")
    canvas.text("practice" if hud.practice else "score", (1085, 36), 24, YELLOW if hud.practice else MUTED, "midright")
    canvas.text(f"{hud.score:+.0f}", (1180, 30), 46, TEXT, "midright")
    for seat, status in enumerate(hud.seats):
        _draw_seat(canvas, seat, 10 if seat == 0 else 1190 - _PANEL, status)
    if hud.carrying:
        _draw_interaction(canvas, hud)


def _draw_seat(canvas: Canvas, seat: int, x: float, status: SeatStatus) -> None:
    canvas.box(x, 668, _PANEL, 84, edge=VERMILION if status.lost else PANEL_EDGE)
    canvas.seat_mark(seat, x + 42, 710, 24)
    canvas.text(status.who, (x + 80, 680), 28, max_width=_PANEL - 175)
    if status.lost:
        canvas.text("unplugged", (x + 80, 714), 26, VERMILION)
    else:
        strength = min(1.0, math.hypot(*status.force))
        canvas.bar(x + 80, 722, _PANEL - 190, 12, strength, SKY)
    canvas.stick(x + _PANEL - 50, 710, 34, status.force, seat)


def _draw_interaction(canvas: Canvas, hud: Hud) -> None:
    """A scale of the interaction, with room for the last word of each sense, and how the loop keeps its time."""
    x, y, width = 440, 706, 320
    if hud.interaction is None:
        canvas.text(hud.missing, (600, y + 6), 20, MUTED, "center", 440)
    else:
        positive, negative, _ = (sense.rpartition(" ")[2] for sense in hud.senses)
        canvas.text(negative, (x, 676), 22, MUTED)
        canvas.text(positive, (x + width, 676), 22, MUTED, "topright")
        canvas.bar(x, y, width, 12, 0.0, SKY)
        share = min(1.0, abs(hud.interaction))
        half = width / 2 * share
        middle = x + width / 2
        colour = VERMILION if share > 0.6 else SKY
        if share > 0.02:
            left_end = middle if hud.interaction > 0 else middle - half
            pygame.draw.rect(canvas.surface, colour, canvas.rect(left_end, y + 1, half, 10))
        pygame.draw.rect(canvas.surface, TEXT, canvas.rect(middle - 2, y - 5, 4, 22))
    if hud.late:
        canvas.text(f"late ticks: {hud.late}", (600, 742), 22, YELLOW, "center")
    elif math.isfinite(hud.hz):
        canvas.text(f"{hud.hz:.1f} steps a second", (600, 742), 20, MUTED, "center")
