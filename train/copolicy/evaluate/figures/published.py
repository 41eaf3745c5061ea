"""Visits and interaction as the figure code released with a paper draws them, with its faults as switches."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize, PowerNorm
from matplotlib.figure import Figure

from copolicy.dataset.arrays import Array
from copolicy.dataset.outline import Outline, square
from copolicy.dataset.outline_figure import GOAL, obstacles_of
from copolicy.dataset.task import PairTask
from copolicy.dataset.trajectory_figures import PublishedFigures, TrajectoryFigures

from ..trajectories import Trajectory
from ..trajectory_sources import Source
from .faults import SENTENCES, Faults
from .grid import Grid
from .samples import frames, interaction_of, states_after
from .sheet import colour_bar, heading, heading_lines, new_sheet, set_heading, show_cells
from .visitation import UNIT, visit_rates

WARNING = "#A00000"
"""Colour of the titles of figures with faults."""

_OBSTACLE = {"facecolor": "red", "alpha": 0.4}


PUBLISHED_NOTE = (
    "This figure shows what faults do to the data named above its panels; it is not the paper's figure and no result. "
    "The figure without the faults has the same name without -as-published."
)


def as_published_title(what: str, source: str, faults: Sequence[str]) -> str:
    """A title that names the faults of a figure."""
    listed = "; ".join(SENTENCES[name] for name in faults) or "none chosen"
    return f"{what} AS PUBLISHED, in the manner of {source}. Faults: {listed}"


def published_counts(task: PairTask, episodes: Sequence[Trajectory], grid: Grid) -> Array:
    """`(rows, columns)` numbers of stored frames, as the released figure code counts."""
    return np.sum([grid.sums(frames(task, episode).positions) for episode in episodes], axis=0)


def published_visitation(
    task: PairTask, conventions: TrajectoryFigures, sources: Sequence[Source], faults: Faults
) -> Figure:
    """The figure as the released code draws it, with the chosen faults; the task must have published figures."""
    outline, published = task.required_outline, conventions.published
    assert published is not None
    grid = Grid.over(outline, conventions.visit_cell)
    if faults.raw_counts:
        values = [published_counts(task, source.episodes, grid) for source in sources]
        norm: Normalize = PowerNorm(published.visit_exponent, *published.visit_limits, clip=True)
    else:
        values = [visit_rates(task, source.episodes, grid).rate for source in sources]
        norm = PowerNorm(published.visit_exponent, 0, max(float(each.max()) for each in values))
    title = as_published_title("State visitation", published.source, faults.of("visitation"))
    figure, axes = new_sheet(outline, len(sources), 3, title, PUBLISHED_NOTE, heading_lines(sources), WARNING)
    for axis, source, each in zip(axes, sources, values, strict=True):
        show_cells(axis, grid, each, norm, "viridis")
        _draw_scene(axis, outline, source.episodes, published.obstacle_side, faults.shifted_obstacles)
        set_heading(axis, heading(source))
        if faults.y_up:
            _turn_y_up(axis)
    label = "stored frames per cell" if faults.raw_counts else f"{UNIT} per cell"
    colour_bar(figure, axes, norm, "viridis", label)
    return figure


def published_weights(task: PairTask, published: PublishedFigures, source: Source, grid: Grid, faults: Faults) -> Array:
    """`(rows, columns)` weights of the bins that the released code adds: summed over frames, or their mean."""
    total, counts = np.zeros((2, grid.rows, grid.columns))
    for episode in source.episodes:
        positions = frames(task, episode).positions
        weights = bin_weights(published_interaction(task, published, source, episode, faults), published.bins)
        total += grid.sums(positions, weights)
        counts += grid.sums(positions)
    return total if faults.raw_counts else total / np.maximum(counts, 1)


def published_interaction(
    task: PairTask, published: PublishedFigures, source: Source, episode: Trajectory, faults: Faults
) -> Array:
    """`(T,)` the interaction measure in the units of the released code."""
    if faults.mirrored_axis:
        interaction = published.mirrored_interaction(states_after(episode), episode.actions)
    else:
        interaction = interaction_of(task, episode)
    assert interaction is not None
    unlike = faults.unit_demonstrations and source.demonstrations
    return interaction * (published.demonstration_scale if unlike else published.study_scale)


def bin_weights(interaction: Array, bins: Sequence[float]) -> Array:
    """`(T,)` weight of each frame, see `PublishedFigures.bins`."""
    size = np.abs(interaction)
    weights = np.sum([size > bound for bound in bins[:-1]], axis=0) + (size >= bins[-1])
    return np.where(np.isin(size, bins[:-1]), 0, weights).astype(float)


def published_arrays(
    task: PairTask, conventions: TrajectoryFigures, sources: Sequence[Source], grid: Grid, faults: Faults
) -> list[Array]:
    """The array `(rows, columns)` of each panel."""
    published = conventions.published
    assert published is not None
    arrays = [published_weights(task, published, source, grid, faults) for source in sources]
    return list(np.cumsum(arrays, axis=0)) if faults.accumulated else arrays


def published_interaction_map(
    task: PairTask, conventions: TrajectoryFigures, sources: Sequence[Source], faults: Faults
) -> Figure:
    """The figure as the released code draws it, with the chosen faults; the task must have published figures."""
    outline, published = task.required_outline, conventions.published
    assert published is not None
    grid = Grid.over(outline, conventions.interaction_cell)
    arrays = published_arrays(task, conventions, sources, grid, faults)
    title = as_published_title(task.words.interaction.capitalize(), published.source, faults.of("force-map"))
    figure, axes = new_sheet(outline, len(sources), 3, title, PUBLISHED_NOTE, heading_lines(sources), WARNING)
    common = Normalize(0, max(float(each.max()) for each in arrays))
    label = "sum of weights 0 to 3" if faults.raw_counts else "mean weight, 0 to 3"
    for axis, source, each in zip(axes, sources, arrays, strict=True):
        norm = Normalize(each.min(), max(each.max(), each.min() + 1)) if faults.own_scales else common
        show_cells(axis, grid, each, norm, "viridis")
        _draw_scene(axis, outline, source.episodes, published.obstacle_side, faults.shifted_obstacles)
        set_heading(axis, heading(source))
        if faults.y_up:
            _turn_y_up(axis)
        if faults.own_scales:
            colour_bar(figure, axis, norm, "viridis", label)
    if not faults.own_scales:
        colour_bar(figure, axes, common, "viridis", label)
    return figure


def _draw_scene(axes: Axes, outline: Outline, episodes: Sequence[Trajectory], side: float, shifted: bool) -> None:
    """Draws obstacles as red squares; a shifted one begins at its centre."""
    centres = {centre for episode in episodes for centre, _ in obstacles_of(outline.fixed(episode.scenario))}
    offset = side / 2 if shifted else 0.0
    for x, y in sorted(centres):
        corners = square((x + offset, y + offset), side)
        axes.fill(*zip(*corners, strict=True), **_OBSTACLE)
    goals = {shape for episode in episodes for shape in outline.fixed(episode.scenario) if shape.role == "goal"}
    for shape in goals:
        axes.fill(*zip(*shape.corners, strict=True), fill=False, edgecolor=GOAL, linewidth=0.8)


def _turn_y_up(axes: Axes) -> None:
    """Mirrors a panel against the screen."""
    axes.set_ylim(*reversed(axes.get_ylim()))
    if axes.get_ylabel():
        axes.set_ylabel(axes.get_ylabel().replace("(down)", "(UP: mirrored)"), fontsize=8)
