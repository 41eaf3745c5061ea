"""The interaction along the path of one episode of each source, on one colour scale."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from copolicy.dataset.arrays import Array
from copolicy.dataset.outline_figure import FAILURE
from copolicy.dataset.task import PairTask
from copolicy.dataset.trajectory_figures import PublishedFigures

from .episode_choice import Chosen, measured_interaction
from .faults import Faults
from .published import PUBLISHED_NOTE, WARNING, as_published_title, published_interaction
from .samples import path_of
from .sheet import colour_bar, draw_scene, heading_lines, new_sheet, origin_lines, set_heading

_LIMIT = 0.98  # quantile of the magnitudes on all paths at the end of the colour scale
_COLOURS, _PUBLISHED_COLOURS = "coolwarm", "turbo"


def force_path(task: PairTask, chosen: Sequence[Chosen], rule: str) -> tuple[Figure, Any]:
    """The figure, and its numbers for `figures.json`; the task must have an interaction measure."""
    name = task.words.interaction
    values = [measured_interaction(task, each.episode) for each in chosen]
    limit = float(np.quantile(np.abs(np.concatenate(values)), _LIMIT)) or 1.0
    norm = Normalize(-limit, limit)
    apart, together, _ = task.words.interaction_senses
    title = f"{name.capitalize()} along the path of {task.words.body}"
    note = (
        f"Episodes: {rule}. Black dot: start; cross: end without success. The colour scale ends at "
        f"the {100 * _LIMIT:g} % quantile of the magnitudes of all panels. y points down, as on the screen."
    )
    figure, axes = _sheet(task, chosen, values, norm, _COLOURS, title, note)
    label = f"{name}, {task.words.interaction_unit}\n(positive: {apart}, negative: {together})"
    colour_bar(figure, axes, norm, _COLOURS, label, extend="both")
    return figure, {
        "definition": "interaction measure of each action, with the orientation after it, at the position before it",
        "choice": rule,
        "unit": task.words.interaction_unit,
        "colour_scale": {"least": -limit, "greatest": limit, "exponent": 1},
        "panels": {
            each.source.name: {
                "episode": each.number,
                "map_id": each.episode.columns["map_id"],
                "fps": each.episode.fps,
                "scenario": each.episode.scenario.to_json(),
                "path": np.round(path_of(task, each.episode.states), 4).tolist(),
                "interaction": np.round(interaction, 5).tolist(),
            }
            for each, interaction in zip(chosen, values, strict=True)
        },
    }


def published_force_path(
    task: PairTask, published: PublishedFigures, chosen: Sequence[Chosen], faults: Faults
) -> Figure:
    """The figure as the released code draws it, with the chosen faults."""
    values = [published_path_values(task, published, each, faults) for each in chosen]
    norm = Normalize(-published.colour_limit, published.colour_limit)
    name = task.words.interaction.capitalize()
    title = as_published_title(f"{name} along a path", published.source, faults.of("force-path"))
    figure, axes = _sheet(task, chosen, values, norm, _PUBLISHED_COLOURS, title, PUBLISHED_NOTE, WARNING)
    colour_bar(figure, axes, norm, _PUBLISHED_COLOURS, "scaled interaction forces")
    return figure


def published_path_values(task: PairTask, published: PublishedFigures, chosen: Chosen, faults: Faults) -> Array:
    """`(T,)` the values that the released code gives to the parts of the path."""
    values = published_interaction(task, published, chosen.source, chosen.episode, faults)
    return np.abs(values) if faults.unsigned_demonstrations and chosen.source.demonstrations else values


def _sheet(
    task: PairTask,
    chosen: Sequence[Chosen],
    values: Sequence[Array],
    norm: Normalize,
    colours: str,
    title: str,
    note: str,
    title_colour: str = "black",
) -> tuple[Figure, list[Axes]]:
    outline, sources = task.required_outline, [each.source for each in chosen]
    figure, axes = new_sheet(outline, len(chosen), 3, title, note, heading_lines(sources) + 1, title_colour)
    for axis, each, interaction in zip(axes, chosen, values, strict=True):
        draw_scene(axis, outline, [each.episode])
        _draw_path(axis, path_of(task, each.episode.every_state), interaction, norm, colours)
        if not each.episode.columns["success"]:
            axis.plot(*path_of(task, each.episode.every_state)[-1], "x", color=FAILURE, markersize=8, zorder=6)
        set_heading(axis, _heading(task, each))
    return figure, axes


def _heading(task: PairTask, chosen: Chosen) -> str:
    source, number, episode = chosen
    seconds = len(episode.actions) / episode.fps
    ended = task.words.success if episode.columns["success"] else task.words.did_not
    mean = float(np.abs(measured_interaction(task, episode)).mean())
    return "\n".join(
        (
            f"{source.name}: episode {number}, {episode.columns['map_id']}",
            f"{ended} after {seconds:.1f} s, mean magnitude {mean:.3f}",
            *origin_lines(source),
        )
    )


def _draw_path(axes: Axes, path: Array, values: Array, norm: Normalize, colours: str) -> None:
    if len(path) == len(values):  # a data set does not store the state after the last action
        values = values[:-1]
    segments = np.stack((path[:-1], path[1:]), axis=1)
    axes.plot(*path.T, color="black", linewidth=5, solid_capstyle="round", zorder=3)
    axes.add_collection(
        LineCollection(list(segments), array=values, norm=norm, cmap=colours, linewidth=3.4, capstyle="round", zorder=4)
    )
    axes.plot(*path[0], "o", color="black", markersize=6, zorder=5)
