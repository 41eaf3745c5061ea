"""An image with all scenarios of a set."""

import math
from pathlib import Path

import numpy as np

from copolicy.dataset.scenarios import ScenarioSet
from copolicy.dataset.task import PairTask

from ..replay.frames import write_png
from ..screen.canvas import Canvas, new_surface
from ..screen.outline_view import scene_view
from ..screen.palette import MUTED, TEXT
from ..sdl import pygame

_GAP, _HEAD, _CAPTION = 12, 64, 26
_SHEET = 1200
_MAX_HEIGHT = 16_000  # px, which drawing libraries and viewers still support


def write_map_sheet(task: PairTask, scenario_set: ScenarioSet, path: Path, width: int) -> tuple[int, int]:
    """Writes a PNG of the scenarios with the body at its start; returns width and height, px.

    Raises:
        CopolicyError: the task has no outline.
        OutputExistsError: the file exists.
    """
    surface = draw_map_sheet(task, scenario_set, width)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_png(surface, path)
    return surface.get_size()


def draw_map_sheet(task: PairTask, scenario_set: ScenarioSet, width: int) -> pygame.Surface:
    """Draws rows of scenarios, each with its name, and its weight where it is not 1; `width` in px."""
    count, outline = len(scenario_set.scenarios), task.required_outline
    starts = task.states_of(np.array([task.start_of(scenario) for scenario in scenario_set.scenarios]))
    columns = max(1, math.ceil(math.sqrt(count * 0.6)))
    cell = (_SHEET - (columns + 1) * _GAP) / columns
    height = cell * outline.size[1] / outline.size[0]
    size = (_SHEET, math.ceil(_HEAD + math.ceil(count / columns) * (height + _CAPTION + _GAP)))
    width = min(width, _MAX_HEIGHT * size[0] // size[1])
    surface = new_surface((width, math.ceil(width * size[1] / size[0])))
    canvas = Canvas(surface, size)
    canvas.clear()
    description = f"version {scenario_set.version}, {count} maps, digest {scenario_set.digest}"
    canvas.text(scenario_set.label, (_GAP + 4, 8), 34, TEXT, max_width=1100)
    canvas.text(description, (_GAP + 4, 40), 20, MUTED, max_width=1100)
    rows = zip(scenario_set.scenarios, outline.poses(starts).tolist(), scenario_set.weights, strict=True)
    for index, (scenario, (x0, y0, theta), weight) in enumerate(rows):
        row, column = divmod(index, columns)
        x, y = _GAP + column * (cell + _GAP), _HEAD + row * (height + _CAPTION + _GAP)
        scene_view(task, scenario).draw(surface, canvas.rect(x, y, cell, height), (x0, y0, theta))
        caption = task.identify(scenario)[0] + (f"  x{weight}" if weight > 1 else "")
        canvas.text(caption, (x + 2, y + height + 4), 20, TEXT, max_width=cell)
    return surface
