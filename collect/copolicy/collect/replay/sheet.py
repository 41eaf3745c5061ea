"""A contact sheet of an episode: frames and the interaction measure on one image."""

import math
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError, OutputExistsError
from copolicy.dataset.task_spec import PLAYERS

from ..screen.canvas import Canvas, new_surface
from ..screen.dialogs import outcome_colour, outcome_text
from ..screen.palette import INK, MUTED, TEXT
from ..sdl import pygame
from .frames import write_png
from .track import Track
from .view import ReplayView

FRAMES = 12

_GAP = 12
_HEAD = 64
_GRAPH = 120
_LINE = 28  # height of the text in place of a missing graph


def write_sheet(track: Track, path: Path, frames: int = FRAMES, width: int = 1800) -> dict[str, Any]:
    """Writes evenly spaced frames of the episode, and the interaction measure below them, as PNG.

    Args:
        track: to show.
        path: of the file, `.png`.
        frames: number of frames on the sheet.
        width: of the sheet, px.

    Returns:
        Size of the sheet and steps of the frames, JSON-able.

    Raises:
        OutputExistsError: the file exists.
        InvalidValueError: the suffix, number of frames or width is invalid.
    """
    if path.suffix.lower() != ".png":
        raise InvalidValueError(str(path), "a name that ends with .png", path.suffix)
    if path.exists():
        raise OutputExistsError(path)
    if not 1 <= frames <= 200:
        raise InvalidValueError("frames", "1 to 200", frames)
    if not 300 <= width <= 10_000:
        raise InvalidValueError("width", "300 to 10000 px", width)
    sheet, positions = draw_sheet(track, frames, width)
    write_png(sheet, path)
    return {"out": str(path), "bytes": path.stat().st_size, "size": list(sheet.get_size()), "steps": positions}


def draw_sheet(track: Track, frames: int, width: int) -> tuple[pygame.Surface, list[int]]:
    """Returns the sheet and the step of each frame."""
    columns = math.ceil(math.sqrt(frames * 0.75))
    rows = math.ceil(frames / columns)
    cell = (1200 - (columns + 1) * _GAP) / columns
    scene_width, scene_height = track.task.required_outline.size
    cell_height = cell * scene_height / scene_width
    graph_height = _LINE if track.interaction is None else _GRAPH
    size = (1200, math.ceil(_HEAD + rows * (cell_height + _GAP) + graph_height + _GAP))
    surface = new_surface((width, math.ceil(width * size[1] / size[0])))
    canvas = Canvas(surface, size)
    canvas.clear()
    view = ReplayView(track)
    positions = [round(track.steps * index / max(1, frames - 1)) for index in range(frames)]
    for index, position in enumerate(positions):
        row, column = divmod(index, columns)
        x, y = _GAP + column * (cell + _GAP), _HEAD + row * (cell_height + _GAP)
        view.draw_world(surface, canvas.rect(x, y, cell, cell_height), position)
        canvas.text(f"{position / track.hz:.1f} s", (x + 9, y + 8), 22, INK)
    _draw_head(canvas, track)
    graph = canvas.rect(_GAP, size[1] - graph_height - _GAP, 1200 - 2 * _GAP, graph_height)
    view.draw_graph(surface, graph, 20 * canvas.scale)
    return surface, positions


def _draw_head(canvas: Canvas, track: Track) -> None:
    meta = track.episode.meta
    players = zip((meta.player_0_id, meta.player_1_id), PLAYERS, strict=True)
    details = [
        meta.map_id,
        meta.pair_id and f"pair {meta.pair_id}",
        " and ".join(player_id or seat for player_id, seat in players),
        f"{track.seconds:.1f} s",
        meta.quality_flags.replace(",", ", "),
    ]
    canvas.text(track.path.name, (_GAP + 4, 10), 32, TEXT, max_width=700)
    canvas.text("  ·  ".join(text for text in details if text), (_GAP + 4, 38), 22, MUTED, max_width=800)
    reason = meta.termination_reason
    canvas.text(
        outcome_text(reason), (1200 - _GAP - 4, 32), 38, outcome_colour(track.task.spec, reason), "midright", 320
    )
