"""Figures of a data set for its card: trajectories, proportions of strategy labels, and comparison with people."""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from copolicy.dataset.arrays import Array
from copolicy.dataset.files.staging import replacement
from copolicy.dataset.outline import Outline, Shape
from copolicy.dataset.outline_figure import (
    BLUE,
    FAILURE,
    GOAL,
    NO_LABEL,
    draw_fixed,
    label_colours,
    obstacles_of,
    panels,
    positions_text,
    show_whole,
)

from .episode_frames import read_frames
from .facts import DatasetFacts
from .human_figure import human_figure

FOLDER = Path("figures")

_OBSTACLE = "#3A3E48"
_MOST_PANELS = 12


class DrawnEpisode(NamedTuple):
    """An episode prepared for drawing with its task's outline.

    Attributes:
        row: columns of meta/episodes.
        path: `(T, 2)` positions of the body, in the unit of the outline.
        fixed: shapes that do not move.
    """

    row: dict[str, Any]
    path: Array
    fixed: tuple[Shape, ...]


Group = tuple[str, list[DrawnEpisode]]
"""Description of a set of obstacles, and its episodes."""


def save_figures(facts: DatasetFacts) -> list[tuple[str, str]]:
    """Writes the figures to the data set's folder; paths and labels need a task with an outline.

    Returns:
        Path in that folder and caption of each figure.

    Raises:
        FileFormatError: the frames or the stored statistics cannot be read.
    """
    drawn: list[tuple[str, str, Figure]] = []
    task, words = facts.task, facts.words
    if task.outline is not None:
        sources = " and ".join(facts.values("source"))
        total, groups = _by_obstacles(facts, task.outline)
        most = f", the {len(groups)} most frequent of {total} sets of obstacles" if len(groups) < total else ""
        extent = f"{len(facts.episodes)} episodes, source: {sources}{most}"
        colours = label_colours(facts.counts("route_class"))
        colouring = f" by {words.label_class}" if task.offers("strategy") else ""
        paths = _trajectories(groups, task.outline, colours, words.failure, task.offers("strategy"))
        drawn.append(("trajectories.png", f"Paths of {words.body}{colouring} ({extent}).", paths))
        if task.offers("strategy"):
            caption = f"{words.label.capitalize()}s by set of obstacles ({extent})."
            drawn.append(("routes.png", caption, _label_proportions(groups, colours)))
    comparison = human_figure(facts)
    if comparison is not None:
        drawn.append(("human_routes.png", comparison[1], comparison[0]))
    saved = []
    for name, caption, figure in drawn:
        with replacement(facts.root / FOLDER / name) as partial:
            figure.savefig(partial, format="png")
        saved.append(((FOLDER / name).as_posix(), caption))
    return saved


def _by_obstacles(facts: DatasetFacts, outline: Outline) -> tuple[int, list[Group]]:
    """Number of sets of obstacles; title and episodes of the most frequent sets, fewest obstacles first."""
    groups: dict[tuple, list[DrawnEpisode]] = defaultdict(list)
    for row, frames in zip(facts.episodes, read_frames(facts), strict=True):
        episode = DrawnEpisode(row, outline.poses(frames.states)[:, :2], outline.fixed(frames.scenario))
        groups[obstacles_of(episode.fixed)].append(episode)
    largest = sorted(groups, key=lambda key: -len(groups[key]))[:_MOST_PANELS]
    return len(groups), [
        (positions_text(key, outline) or "no obstacle", groups[key])
        for key in sorted(largest, key=lambda key: (len(key), max((size for _, size in key), default=0), key))
    ]


def _trajectories(
    groups: Sequence[Group], outline: Outline, colours: Mapping[str, str], failure: str, labelled: bool
) -> Figure:
    figure = Figure(dpi=110, layout="constrained")
    for (title, members), axes in zip(groups, panels(figure, outline, len(groups), 3, 0.4), strict=True):
        _panel(axes, title, members, outline, colours, labelled)
    any_obstacles = any(obstacles_of(members[0].fixed) for _, members in groups)
    handles = [
        Rectangle((0, 0), 1, 1, fill=False, edgecolor=GOAL, label="goal"),
        *([Rectangle((0, 0), 1, 1, color=_OBSTACLE, label="obstacle")] if any_obstacles else []),
        Line2D([], [], color=FAILURE, linestyle="", marker="x", label=failure),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return figure


def _panel(
    axes: Axes, title: str, members: Sequence[DrawnEpisode], outline: Outline, colours: Mapping[str, str], labels: bool
) -> None:
    draw_fixed(axes, (shape for episode in members for shape in episode.fixed), _OBSTACLE)
    for episode in members:
        x, y = episode.path.T
        axes.plot(x, y, color=colours[episode.row["route_class"]] if labels else BLUE, linewidth=0.9, alpha=0.6)
        if not episode.row["success"]:
            axes.plot(x[-1], y[-1], "x", color=FAILURE, markersize=5)
    if labels:
        handles = [
            Line2D([], [], color=colours[label], label=f"{label or 'none'} {count}")
            for label, count in _label_counts(members).most_common()
        ]
        axes.legend(handles=handles, loc="lower left", ncols=4, fontsize=7, frameon=False, handlelength=1)
    show_whole(axes, outline)
    heading = f"obstacles {title}" if obstacles_of(members[0].fixed) else title
    axes.set_title(f"{heading}: {len(members)} episodes", fontsize=8)


def _label_counts(members: Sequence[DrawnEpisode]) -> Counter[str]:
    return Counter(episode.row["route_class"] for episode in members)


def _label_proportions(groups: Sequence[Group], colours: Mapping[str, str]) -> Figure:
    figure = Figure(figsize=(8, 0.5 * len(groups) + 0.9), dpi=110, layout="constrained")
    axes = figure.subplots()
    for row, (_, members) in enumerate(groups):
        start = 0.0
        for label, count in sorted(_label_counts(members).items()):
            proportion, colour = count / len(members), colours[label]
            axes.barh(row, proportion, left=start, color=colour, edgecolor="white")
            if proportion > 0.06:
                text_colour = "white" if colour in (BLUE, NO_LABEL) else "black"  # readable on the bar
                centre, text = start + proportion / 2, f"{label or 'none'} {count}"
                axes.text(centre, row, text, ha="center", va="center", fontsize=8, color=text_colour)
            start += proportion
    axes.set_yticks(range(len(groups)), [f"{title}\n{len(members)} episodes" for title, members in groups], fontsize=7)
    axes.set(xlim=(0, 1), xlabel="proportion of episodes", ylim=(len(groups) - 0.4, -0.6))
    axes.spines[["top", "right", "left"]].set_visible(False)
    return figure
