"""A sheet of panels that show the scene, on one colour scale; its files."""

import math
import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke

from copolicy.dataset.arrays import Array
from copolicy.dataset.files.staging import replacements
from copolicy.dataset.outline import Outline
from copolicy.dataset.outline_figure import OBSTACLE, draw_fixed
from copolicy.dataset.trajectory_figures import FIGURES_FILE

from ..trajectories import Trajectory
from ..trajectory_sources import Source
from .grid import Grid

FORMATS = ("png", "svg")
"""Formats of each figure, and the ends of its files' names."""

COLOURS = ListedColormap(matplotlib.colormaps["YlGnBu"](np.linspace(0.1, 1, 256)))
"""Colour map of rates: more is darker, and the least differs from white, which is no visit."""

_EDGE = [Stroke(linewidth=2.4, foreground="white"), Normal()]  # visible on dark cells
_WIDTH = 4.6  # inches, of a panel
_LINE = 64  # characters above a panel


def new_sheet(
    outline: Outline, count: int, max_columns: int, title: str, note: str, lines: int, title_colour: str = "black"
) -> tuple[Figure, list[Axes]]:
    """A figure with `count` panels that show the scene, a title and a note below.

    Args:
        lines: lines of the panels' headings.
    """
    columns = 2 if count == 4 else min(count, max_columns)
    rows = math.ceil(count / columns)
    panel = _WIDTH if columns > 1 else 1.6 * _WIDTH
    width = panel * columns + 1.1
    title, note = textwrap.fill(title, int(11 * width)), textwrap.fill(note, int(15.5 * width))
    text = 0.2 * (title.count("\n") + 1) + 0.14 * (note.count("\n") + 1)
    height = rows * ((panel - 0.45) * outline.size[1] / outline.size[0] + 0.15 * lines + 0.3) + text + 0.5
    figure = Figure(figsize=(width, height), dpi=120, layout="constrained")
    figure.suptitle(title, fontsize=11, color=title_colour)
    figure.supxlabel(note, fontsize=7.5, color="#444444")
    axes = list(figure.subplots(rows, columns, squeeze=False).flat)
    for unused in axes[count:]:
        unused.set_visible(False)
    for index, axis in enumerate(axes[:count]):
        _scene_axes(axis, outline, index % columns == 0, index + columns >= count)
    return figure, axes[:count]


def draw_scene(axes: Axes, outline: Outline, episodes: Sequence[Trajectory]) -> None:
    """Draws obstacles (those of all episodes solid, others as outlines) and goals (those of all with thick lines)."""
    counts = Counter(shape for episode in episodes for shape in dict.fromkeys(outline.fixed(episode.scenario)))
    for shape, count in counts.items():
        common = count == len(episodes)
        if shape.role == "obstacle" and not common:
            axes.fill(
                *zip(*shape.corners, strict=True), fill=False, edgecolor=OBSTACLE, linewidth=0.8, path_effects=_EDGE
            )
        else:
            draw_fixed(axes, [shape], linewidth=1.8 if common else 0.8)


def show_cells(axes: Axes, grid: Grid, values: Array, norm: Normalize, colours: str | Colormap) -> None:
    """Draws cells below the scene; NaN is white."""
    extent = (0, grid.columns * grid.cell, grid.rows * grid.cell, 0)
    limits = axes.get_xlim(), axes.get_ylim()
    axes.imshow(values, extent=extent, origin="upper", interpolation="none", norm=norm, cmap=colours, zorder=0.5)
    axes.set(xlim=limits[0], ylim=limits[1])


def heading(source: Source) -> str:
    """Name, episodes and origin of a source, in lines for a panel."""
    count = len(source.episodes)
    first = f"{source.name}: {count} episode{'s' * (count != 1)}, {source.successes} succeeded"
    return "\n".join((first, *origin_lines(source)))


def origin_lines(source: Source) -> list[str]:
    """How the episodes of a source were made, in up to three lines for a panel."""
    return textwrap.wrap(source.label, _LINE, max_lines=3, placeholder=" ...")


def set_heading(axes: Axes, text: str) -> None:
    """Writes the heading of a panel."""
    axes.set_title(text, fontsize=8, loc="left")


def heading_lines(sources: Sequence[Source]) -> int:
    """Most lines of the panels' headings."""
    return max(heading(source).count("\n") + 1 for source in sources)


def colour_bar(
    figure: Figure, axes: Axes | Sequence[Axes], norm: Normalize, colours: str | Colormap, label: str, **options: Any
) -> None:
    """Adds the colour bar of one panel or of several."""
    size = {"fraction": 0.025} if isinstance(axes, Axes) else {"shrink": 0.7, "aspect": 30, "fraction": 0.04}
    bar = figure.colorbar(ScalarMappable(norm, colours), ax=axes, **size, **options)
    bar.set_label(label, fontsize=8)
    bar.ax.tick_params(labelsize=7)


def legend_note(outline: Outline, sources: Sequence[Source]) -> str:
    """Explains how obstacles and goals are drawn; empty if the scene has no obstacle."""
    episodes = [episode for source in sources for episode in source.episodes]
    shapes = {shape.role for episode in episodes for shape in outline.fixed(episode.scenario)}
    if "obstacle" not in shapes:
        return "Green: goals. y points down, as on the screen."
    return (
        "Obstacles of all episodes of a panel are solid, those of some are outlines; green: goals (thick: of all). "
        "y points down, as on the screen."
    )


def save_files(folder: Path, figures: Mapping[str, Figure], document: str) -> dict[str, list[str]]:
    """Writes each figure in all `FORMATS`, and the document last; nothing if one fails.

    Returns:
        Names of the files of each figure.
    """
    names = {name: [f"{name}.{ending}" for ending in FORMATS] for name in figures}
    paths = [folder / file for files in names.values() for file in files]
    with replacements([*paths, folder / FIGURES_FILE]) as partials, matplotlib.rc_context({"svg.hashsalt": "copolicy"}):
        targets = iter(partials)
        for figure in figures.values():
            for ending in FORMATS:
                options: dict[str, Any] = {"metadata": {"Date": None}} if ending == "svg" else {}
                figure.savefig(next(targets), format=ending, **options)
        next(targets).write_text(document, encoding="utf-8")
    return names


def _scene_axes(axes: Axes, outline: Outline, first_column: bool, last_row: bool) -> None:
    width, height = outline.size
    axes.set(xlim=(0, width), ylim=(height, 0), aspect="equal")
    axes.locator_params(nbins=5)
    axes.tick_params(labelsize=7, length=2)
    if first_column:
        axes.set_ylabel(f"y, {outline.unit} (down)", fontsize=8)
    if last_row:
        axes.set_xlabel(f"x, {outline.unit}", fontsize=8)
