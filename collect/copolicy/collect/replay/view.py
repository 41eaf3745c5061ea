"""Drawing of a replay: the world, both players' forces, the interaction measure over time, and a timeline."""

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
"""Width and height of the canvas, in its units."""

_WORLD = (0, 60, 1200, 600)
_GRAPH = (186, 676, 828, 128)
_TIMELINE = (186, 816, 828, 16)
_PANEL = (12, 676, 156, 190)  # of the robot seat; that of the human seat is mirrored
_TRAIL_STRIDE = 3  # steps
_TICK_SPACINGS = (1, 2, 5, 10, 20, 60)  # s between marks of the timeline

HELP: Sequence[tuple[str, str]] = (
    ("Space, click", "play, pause"),
    ("left, right", "one step"),
    ("Shift + left, right; wheel", "one second"),
    ("up, down", "faster, slower"),
    ("Home, End", "start, end"),
    ("click or drag on the timeline", "go to a time"),
    ("T, F", "trails, forces"),
    ("S", "save an image next to the recording"),
    ("F11", "full screen"),
    ("H, F1", "this help"),
    ("Q, Esc", "quit"),
)


@dataclass
class ViewOptions:
    """What is drawn besides the world."""

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

    def draw(self, surface: pygame.Surface, playback: Playback, options: ViewOptions) -> None:
        """Draws the whole replay."""
        canvas = Canvas(surface, SIZE)
        canvas.clear()
        position = playback.position
        self.draw_world(surface, canvas.rect(*_WORLD), position, options.trails, options.forces)
        self._draw_head(canvas, playback)
        for seat in range(2):
            self._draw_seat(canvas, seat, position)
        self._graph.draw(surface, canvas.rect(*_GRAPH), position, 20 * canvas.scale)
        self._draw_timeline(canvas, playback)
        if options.message:
            canvas.box(260, 70, 680, 50, edge=YELLOW)
            canvas.text(options.message, (600, 95), 26, TEXT, "center", 650)
        if options.help:
            self._draw_help(canvas)
        elif options.hint:
            canvas.text("H: help", (1014, 877), 20, MUTED, "bottomright")

    def draw_world(
        self, surface: pygame.Surface, area: pygame.Rect, position: float, trails: bool = True, forces: bool = True
    ) -> pygame.Rect:
        """Draws only scenario, body, trails and forces; returns their rectangle, px."""
        track = self._track
        pose = track.pose_at(position)
        trail: list[Pose] = [*track.poses[: int(position) + 1 : _TRAIL_STRIDE], pose] if trails else []
        acting = track.forces_at(position) if forces else (0.0, 0.0, 0.0, 0.0)
        return self._scene.draw(surface, area, pose, acting, trail)

    def draw_graph(self, surface: pygame.Surface, area: pygame.Rect, font: float) -> None:
        """Draws only the interaction measure, without a cursor, or the text for a missing one."""
        self._graph.draw(surface, area, None, font)

    def position_at(self, surface: pygame.Surface, point: tuple[int, int], dragging: bool = False) -> float | None:
        """Returns the position at a point of graph or timeline; None outside of them.

        Args:
            surface: that was drawn on.
            point: px.
            dragging: a drag began there: then only the point's x coordinate counts.
        """
        canvas = Canvas(surface, SIZE)
        graph = canvas.rect(*_GRAPH)
        reach = graph.union(canvas.rect(*_TIMELINE)).inflate(24 * canvas.scale, 12 * canvas.scale)
        if not dragging and not reach.collidepoint(point):
            return None
        return self._graph.position_of(graph, point[0])

    def _draw_head(self, canvas: Canvas, playback: Playback) -> None:
        track, meta = self._track, self._track.episode.meta
        canvas.text(track.path.name, (20, 9), 30, TEXT, max_width=430)
        details = (meta.map_id, meta.pair_id and f"pair {meta.pair_id}", meta.quality_flags.replace(",", ", "))
        canvas.text("  ·  ".join(text for text in details if text), (20, 36), 22, MUTED, max_width=430)
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
        player = (meta.player_0_id, meta.player_1_id)[seat] or PLAYERS[seat]
        canvas.box(x, y, width, height)
        canvas.seat_mark(seat, x + 26, y + 26, 14)
        canvas.text(player, (x + 48, y + 26), 24, TEXT, "midleft", width - 58)
        fx, fy = self._track.forces_at(position)[2 * seat : 2 * seat + 2]
        canvas.stick(x + width / 2, y + 102, 48, (fx, fy), seat)
        strength = (fx * fx + fy * fy) ** 0.5
        canvas.bar(x + 16, y + height - 24, width - 32, 10, strength, SKY)

    def _draw_timeline(self, canvas: Canvas, playback: Playback) -> None:
        x, y, width, height = _TIMELINE
        track = self._track
        elapsed = playback.position / max(1, track.steps)
        canvas.bar(x, y, width, height, elapsed, SKY)
        spacing = next((seconds for seconds in _TICK_SPACINGS if track.seconds / seconds <= 12), 120)
        for second in range(0, int(track.seconds) + 1, spacing):
            tick_x = x + width * second * track.hz / max(1, track.steps)
            canvas.text(f"{second} s" if second else "0", (tick_x, y + height + 6), 20, MUTED, "midtop")
        for event in track.events:
            event_x = x + width * min(event.step, track.steps) / max(1, track.steps)
            with canvas.patch(event_x, y + height / 2, 9) as patch:
                patch.circle(SURROUND, canvas.point(event_x, y + height / 2), 6 * canvas.scale)
                patch.circle(YELLOW, canvas.point(event_x, y + height / 2), 4.5 * canvas.scale)
        recent = [event for event in track.events if 0 <= playback.position - event.step <= track.hz]
        if recent:
            text = f"{recent[-1].kind}: {recent[-1].detail}" if recent[-1].detail else recent[-1].kind
            canvas.text(text, (x, 877), 20, YELLOW, "bottomleft", 600)
        knob = canvas.point(x + width * elapsed, y + height / 2)
        with canvas.patch(x + width * elapsed, y + height / 2, 16) as patch:
            patch.circle(PANEL_EDGE, knob, 13 * canvas.scale)
            patch.circle(TEXT, knob, 10 * canvas.scale)

    def _draw_help(self, canvas: Canvas) -> None:
        canvas.dim()
        canvas.box(230, 96, 740, 96 + 40 * len(HELP))
        canvas.text("Replay", (600, 136), 44, TEXT, "center")
        for row, (keys, action) in enumerate(HELP):
            canvas.text(keys, (270, 174 + 40 * row), 27, SKY, max_width=330)
            canvas.text(action, (610, 174 + 40 * row), 27, TEXT, max_width=340)


def _draw_play_mark(canvas: Canvas, x: float, y: float, playing: bool) -> None:
    with canvas.patch(x, y, 18) as patch:
        if playing:
            patch.polygon(TEXT, [canvas.point(x - 10, y - 13), canvas.point(x + 14, y), canvas.point(x - 10, y + 13)])
        else:
            for bar_x in (-10, 3):
                corners = ((bar_x, -12), (bar_x + 7, -12), (bar_x + 7, 12), (bar_x, 12))
                patch.polygon(TEXT, [canvas.point(x + u, y + v) for u, v in corners])
