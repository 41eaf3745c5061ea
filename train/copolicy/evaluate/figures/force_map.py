"""Where the players worked against each other: the proportion of time above thresholds, cell by cell."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from copolicy.dataset.arrays import Array
from copolicy.dataset.task import PairTask
from copolicy.dataset.trajectory_figures import TrajectoryFigures

from ..trajectories import Trajectory
from ..trajectory_sources import Source
from .grid import Grid
from .samples import resampled
from .sheet import (
    COLOURS,
    colour_bar,
    draw_scene,
    heading,
    heading_lines,
    legend_note,
    new_sheet,
    set_heading,
    show_cells,
)

MIN_EPISODES = 3
"""Default of the least number of episodes in a cell that is shown."""

DEFINITION = (
    "percent of the samples in the cell, of all episodes of the source, in which the magnitude of the interaction "
    "measure is above the threshold"
)
_GREY = ListedColormap(["#DDDDDD"])


class ForceMap(NamedTuple):
    """Interaction of one source.

    Attributes:
        samples: `(rows, columns)` number of samples.
        episodes: `(rows, columns)` number of episodes that were in the cell.
        above: `(thresholds, rows, columns)` number of samples above each threshold.
    """

    samples: Array
    episodes: Array
    above: Array

    def proportion(self, min_episodes: int) -> Array:
        """`(thresholds, rows, columns)` percent; NaN in cells of fewer than `min_episodes` episodes (at least 1)."""
        shown = self.episodes >= min_episodes
        return np.where(shown, 100 * self.above / np.maximum(self.samples, 1), np.nan)


def force_map(task: PairTask, episodes: Sequence[Trajectory], grid: Grid, thresholds: Sequence[float]) -> ForceMap:
    """Counts samples above thresholds; the task must have an interaction measure."""
    samples, visiting = np.zeros((2, grid.rows, grid.columns))
    above = np.zeros((len(thresholds), grid.rows, grid.columns))
    for episode in episodes:
        positions, interaction = resampled(task, episode)
        assert interaction is not None
        counts = grid.sums(positions)
        samples += counts
        visiting += counts > 0
        for index, threshold in enumerate(thresholds):
            above[index] += grid.sums(positions, np.abs(interaction) > threshold)
    return ForceMap(samples, visiting, above)


def interaction_map(
    task: PairTask, conventions: TrajectoryFigures, sources: Sequence[Source], min_episodes: int = MIN_EPISODES
) -> tuple[Figure, Any]:
    """The figure, and its numbers for `figures.json`."""
    outline, thresholds = task.required_outline, conventions.thresholds
    grid = Grid.over(outline, conventions.interaction_cell)
    maps = [force_map(task, source.episodes, grid, thresholds) for source in sources]
    proportions = [each.proportion(min_episodes) for each in maps]
    most = max(float(np.nanmax(each, initial=0.0)) for each in proportions)
    norm = Normalize(0, max(10.0, 10 * np.ceil(most / 10)))
    name, unit = task.words.interaction, task.words.interaction_unit
    title = f"{name.capitalize()}: % of the time in a cell of {grid.cell:g} {outline.unit} above a threshold"
    few = (
        f"Grey: fewer than {min_episodes} episodes in the cell; white: none. "
        if min_episodes > 1
        else "White: no visit. "
    )
    note = (
        f"Colour: {DEFINITION}. {few}"
        f"Thresholds in {unit}: {conventions.thresholds_source}. {legend_note(outline, sources)}"
    )
    count = len(sources) * len(thresholds)
    figure, axes = new_sheet(outline, count, len(thresholds), title, note, heading_lines(sources) + 1)
    rows = [axes[index : index + len(thresholds)] for index in range(0, count, len(thresholds))]
    for row, source, force, proportion in zip(rows, sources, maps, proportions, strict=True):
        for axis, threshold, values in zip(row, thresholds, proportion, strict=True):
            too_few = (force.episodes > 0) & (force.episodes < min_episodes)
            show_cells(axis, grid, np.where(too_few, 0.0, np.nan), Normalize(0, 1), _GREY)
            show_cells(axis, grid, values, norm, COLOURS)
            draw_scene(axis, outline, source.episodes)
            above = f"|{name}| > {threshold:g}"
            set_heading(axis, f"{heading(source)}\n{above}" if axis is row[0] else above)
    colour_bar(figure, axes, norm, COLOURS, "% of the time in the cell")
    panels = {source.name: _cells(each) for source, each in zip(sources, maps, strict=True)}
    return figure, {
        "definition": DEFINITION,
        "unit": "numbers of samples; percent are 100 above / samples",
        "interaction_unit": unit,
        "thresholds": list(thresholds),
        "thresholds_source": conventions.thresholds_source,
        "min_episodes": min_episodes,
        "grid": grid.to_json(),
        "colour_scale": {"least": 0, "greatest": float(norm.vmax or 0), "exponent": 1},
        "panels": panels,
    }


def _cells(force: ForceMap) -> list[dict[str, Any]]:
    return [
        {
            "row": int(row),
            "column": int(column),
            "samples": int(force.samples[row, column]),
            "episodes": int(force.episodes[row, column]),
            "above": [int(count) for count in force.above[:, row, column]],
        }
        for row, column in np.argwhere(force.samples > 0)
    ]
