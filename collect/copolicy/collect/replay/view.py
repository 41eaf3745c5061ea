"""One picture of a replay: the world, who pushes how, the interaction force over time, and where in it we are."""

from collections.abc import Sequence
from dataclasses import dataclass

from copolicy.dataset.task_spec import PLAYERS

from ..screen.canvas import Canvas
from ..screen.dialogs import outcome_colour, outcome_text
from ..screen.outline_view import scene_view
from ..screen.palette import MUTED, PANEL_EDGE, SKY, SURROUND, TEXT, YELLOW
from ..sdl import pygame
from .graph import ForceGraph
from .playback import Playback
from .track import Pose, Track

SIZE = (1200, 880)
"""Units of the picture."""

_WORLD = (0, 60, 1200, 600)
_GRAPH = (186, 676, 828, 128)
_TIMELINE = (186, 816, 828, 16)
_PANEL = (12, 676, 156, 190)  # of the robot seat; the other one is its mirror image
_TRAIL_STRIDE = 3  # steps
_RULER = (1, 2, 5, 10, 20, 60)  # s between marks

HELP: Sequence[tuple[str, str]] = (
    ("Space, click", "play, pause"),
    ("left, right", "one step"),
    ("Shift + left, right; wheel", "one second"),
    ("up, down", "faster, slower"),
    ("Home, End", "beginning, end"),
    ("mouse on the graph or the line", "go there"),
    ("T, F", "trails, forces"),
    ("S", "save a picture beside the recording"),
    ("F11", "full screen"),
    ("H, F1", "this help"),
    ("Q, Esc", "quit"),
)


@dataclass
class Shown:
    """What is drawn beside the table."""

    trails: bool = True
    forces: bool = True
    help: bool = False
    hint: bool = True
    message: str = ""


class ReplayView:
    """Draws a track at any position, on a surface of any size."""

    def __init__(self, track: Track):
        self._track = track
        self._scene = scene_view(track.task, track.episode.scenario)
        self._graph = ForceGraph(track.interaction, track.steps, track.task)

    def draw(self, surface: pygame.Surface, playback: Playback, shown: Shown) -> None:
        """Draws everything."""
        canvas = Canvas(surface, SIZE)
        canvas.clear()
        position = playback.position
        self.draw_world(surface, canvas.rect(*_WORLD), position, shown.trails, shown.forces)
        self._draw_head(canvas, playback)
        for seat in range(2):
            self._draw_seat(canvas, seat, position)
        self._graph.draw(surface, canvas.rect(*_GRAPH), position, 20 * canvas.scale)
        self._draw_timeline(canvas, playback)
        if shown.message:
            canvas.box(260, 70, 680, 50, edge=YELLOW)
            canvas.text(shown.message, (600, 95), 26, TEXT, "center", 650)
        if shown.help:
            self._draw_help(canvas)
        elif shown.hint:
            canvas.text("H: help", (1014, 877), 20, MUTED, "bottomright")

    def draw_world(
        self, surface: pygame.Surface, area: pygame.Rect, position: float, trails: bool = True, forces: bool = True
    ) -> pygame.Rect:
        """Draws map, table, trails and forces alone; returns where."""
        track = self._track
        pose = track.pose_at(position)
        trail: list[Pose] = [*track.poses[: int(position) + 1 : _TRAIL_STRIDE], pose] if trails else []
        acting = track.forces_at(position) if forces else (0.0, 0.0, 0.0, 0.0)
        return self._scene.draw(surface, area, pose, acting, trail)

    def draw_graph(self, surface: pygame.Surface, area: pygame.Rect, font: float) -> None:
        """Draws the interaction force alone, without a cursor, or why there is none."""
        self._graph.draw(surface, area, None, font)

    def position_at(self, surface: pygame.Surface, point: tuple[int, int], held: bool = False) -> float | None:
        """The position that a point of graph or timeline stands for; None beside them.

        Args:
            surface: what was drawn on.
            point: px.
            held: the button has been held since it was pressed there: then only its place along the time counts.
        """
        canvas = Canvas(surface, SIZE)
        graph = canvas.rect(*_GRAPH)
        reach = graph.union(canvas.rect(*_TIMELINE)).inflate(24 * canvas.scale, 12 * canvas.scale)
        if not held and not reach.collidepoint(point):
            return None
        return self._graph.position_of(graph, point[0])

    def _draw_head(self, canvas: Canvas, playback: Playback) -> None:
        track, meta = self._track, self._track.episode.meta
        canvas.text(track.path.name, (20, 9), 30, TEXT, max_width=430)
        about = (meta.map_id, meta.pair_id and f"pair {meta.pair_id}", meta.quality_flags.replace(",", ", "))
        canvas.text("  ·  ".join(text for text in about if text), (20, 36), 22, MUTED, max_width=430)
        canvas.text(f"{playback.position / track.hz:.1f}", (612, 30), 50, TEXT, "midright")
        canvas.text(f"of {track.seconds:.1f} s", (624, 24), 24, MUTED, "midleft")
        canvas.text(f"step {int(playback.position)} of {track.steps}", (624, 44), 20, MUTED, "midleft")
        _draw_play_mark(canvas, 815, 30, playback.playing)
        canvas.text(f"{playback.speed:g}x", (845, 31), 34, TEXT, "midleft")
        reason = meta.termination_reason
        canvas.text(outcome_text(reason), (1180, 31), 36, outcome_colour(track.task.spec, reason), "midright", 260)

    def _draw_seat(self, canvas: Canvas, seat: int, position: float) -> None:
        x, y, width, height = _PANEL
        if seat == 1:
            x = SIZE[0] - x - width
        meta = self._track.episode.meta
        who = (meta.player_0_id, meta.player_1_id)[seat] or PLAYERS[seat]
        canvas.box(x, y, width, height)
        canvas.seat_mark(seat, x + 26, y + 26, 14)
        canvas.text(who, (x + 48, y + 26), 24, TEXT, "midleft", width - 58)
        fx, fy = self._track.forces_at(position)[2 * seat : 2 * seat + 2]
        canvas.stick(x + width / 2, y + 102, 48, (fx, fy), seat)
        strength = (fx * fx + fy * fy) ** 0.5
        canvas.bar(x + 16, y + height - 24, width - 32, 10, strength, SKY)

    def _draw_timeline(self, canvas: Canvas, playback: Playback) -> None:
        x, y, width, height = _TIMELINE
        track = self._track
        share = playback.position / max(1, track.steps)
        canvas.bar(x, y, width, height, share, SKY)
        apart = next((mark for mark in _RULER if track.seconds / mark <= 12), 120)
        for second in range(0, int(track.seconds) + 1, apart):
            at = x + width * second * track.hz / max(1, track.steps)
            canvas.text(f"{second} s" if second else "0", (at, y + height + 6), 20, MUTED, "midtop")
        for moment in track.moments:
            at = x + width * min(moment.step, track.steps) / max(1, track.steps)
            with canvas.patch(at, y + height / 2, 9) as patch:
                patch.circle(SURROUND, canvas.point(at, y + height / 2), 6 * canvas.scale)
                patch.circle(YELLOW, canvas.point(at, y + height / 2), 4.5 * canvas.scale)
        near = [moment for moment in track.moments if 0 <= playback.position - moment.step <= track.hz]
        if near:
            text = f"{near[-1].kind}: {near[-1].detail}" if near[-1].detail else near[-1].kind
            canvas.text(text, (x, 877), 20, YELLOW, "bottomleft", 600)
        knob = canvas.point(x + width * share, y + height / 2)
        with canvas.patch(x + width * share, y + height / 2, 16) as patch:
            patch.circle(PANEL_EDGE, knob, 13 * canvas.scale)
            patch.circle(TEXT, knob, 10 * canvas.scale)

    def _draw_help(self, canvas: Canvas) -> None:
        canvas.dim()
        canvas.box(230, 96, 740, 96 + 40 * len(HELP))
        canvas.text("Replay", (600, 136), 44, TEXT, "center")
        for row, (keys, what) in enumerate(HELP):
            canvas.text(keys, (270, 174 + 40 * row), 27, SKY, max_width=330)
            canvas.text(what, (610, 174 + 40 * row), 27, TEXT, max_width=340)


def _draw_play_mark(canvas: Canvas, x: float, y: float, playing: bool) -> None:
    with canvas.patch(x, y, 18) as patch:
        if playing:
            patch.polygon(TEXT, [canvas.point(x - 10, y - 13), canvas.point(x + 14, y), canvas.point(x - 10, y + 13)])
        else:
            for left in (-10, 3):
                corners = ((left, -12), (left + 7, -12), (left + 7, 12), (left, 12))
                patch.polygon(TEXT, [canvas.point(x + u, y + v) for u, v in corners])
