"""Where the tracked point was: one panel for each source, on one colour scale."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.colors import PowerNorm
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

DEFINITION = (
    "percent of an episode's time in the cell, mean over the episodes of the source: the cells of a panel add up to "
    "100 %. Every episode counts once, so neither long episodes nor many episodes nor a higher rate darken a panel"
)
UNIT = "% of an episode's time"


class Visits(NamedTuple):
    """Visits of one source, `(rows, columns)` each.

    Attributes:
        rate: see `DEFINITION`.
        episodes: number of episodes that were in the cell.
    """

    rate: Array
    episodes: Array


def visit_rates(task: PairTask, episodes: Sequence[Trajectory], grid: Grid) -> Visits:
    """Visit rates of episodes."""
    rate, visiting = np.zeros((2, grid.rows, grid.columns))
    for episode in episodes:
        counts = grid.sums(resampled(task, episode).positions)
        rate += 100 * counts / counts.sum()
        visiting += counts > 0
    return Visits(rate / len(episodes), visiting)


def visitation(task: PairTask, conventions: TrajectoryFigures, sources: Sequence[Source]) -> tuple[Figure, Any]:
    """The figure, and its numbers for `figures.json`.

    Raises:
        CopolicyError: the task has no outline.
    """
    outline = task.required_outline
    grid = Grid.over(outline, conventions.visit_cell)
    visits = [visit_rates(task, source.episodes, grid) for source in sources]
    norm = PowerNorm(0.5, 0, max(float(each.rate.max()) for each in visits))
    title = f"State visitation of {task.words.body}: {UNIT} per cell of {grid.cell:g} {outline.unit}"
    note = f"Colour: {DEFINITION}. White: no visit. {legend_note(outline, sources)}"
    figure, axes = new_sheet(outline, len(sources), 3, title, note, heading_lines(sources))
    for axis, source, (rate, _) in zip(axes, sources, visits, strict=True):
        show_cells(axis, grid, np.where(rate > 0, rate, np.nan), norm, COLOURS)
        draw_scene(axis, outline, source.episodes)
        set_heading(axis, heading(source))
    colour_bar(figure, axes, norm, COLOURS, f"{UNIT}\nper cell (square-root scale)")
    panels = {
        source.name: [
            {"row": int(row), "column": int(column), "rate": float(f"{rate[row, column]:.6g}"),
             "episodes": int(visiting[row, column])}
            for row, column in np.argwhere(visiting > 0)
        ]
        for source, (rate, visiting) in zip(sources, visits, strict=True)
    }  # fmt: skip
    return figure, {
        "definition": DEFINITION,
        "unit": f"{UNIT} per cell",
        "grid": grid.to_json(),
        "colour_scale": {"least": 0, "greatest": float(norm.vmax or 0), "exponent": 0.5},
        "panels": panels,
    }
