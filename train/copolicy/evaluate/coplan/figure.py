"""Figure of a co-planning study: the paths of all episodes, one panel for each set of obstacles."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from copolicy.dataset.files.staging import replacement
from copolicy.dataset.outline_figure import (
    BLUE,
    FAILURE,
    GOAL,
    OBSTACLE,
    draw_fixed,
    obstacles_of,
    panels,
    show_whole,
)

from .rollouts import EpisodeResult


def save_path_figure(episodes: Sequence[EpisodeResult], path: Path, title: str) -> None:
    """Draws the paths of all episodes into a PNG.

    Raises:
        CopolicyError: the task has no outline.
    """
    task = episodes[0].task
    outline = task.required_outline
    groups: dict[tuple, list[EpisodeResult]] = defaultdict(list)
    for episode in episodes:
        groups[obstacles_of(outline.fixed(episode.scenario))].append(episode)
    figure = Figure(dpi=110, layout="constrained")
    ordered = sorted(groups, key=lambda obstacles: (len(obstacles), obstacles))
    for obstacles, axes in zip(ordered, panels(figure, outline, len(groups), 4, 0.7), strict=True):
        members = groups[obstacles]
        draw_fixed(axes, (shape for episode in members for shape in outline.fixed(episode.scenario)))
        _draw_paths(axes, members)
        show_whole(axes, outline)
        heading = f"{len(obstacles)} obstacle{'s' * (len(obstacles) != 1)}: " if any(groups) else ""
        axes.set_title(f"{heading}{sum(episode.success for episode in members)} of {len(members)}", fontsize=9)
    handles = [
        Line2D([], [], color=BLUE, label=task.words.success),
        Line2D([], [], color=FAILURE, linestyle="--", marker="x", label="did not"),
        Rectangle((0, 0), 1, 1, fill=False, edgecolor=GOAL, label="goal"),
        *([Rectangle((0, 0), 1, 1, color=OBSTACLE, label="obstacle")] if any(groups) else []),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle(title)
    with replacement(path) as partial:
        figure.savefig(partial, format="png")


def _draw_paths(axes, episodes: Sequence[EpisodeResult]) -> None:
    for episode in episodes:
        assert episode.path is not None  # its task has an outline
        colour, style = (BLUE, "-") if episode.success else (FAILURE, "--")
        axes.plot(*episode.path.T, style, color=colour, linewidth=1, alpha=0.75)
        axes.plot(*episode.path[0], "o", color="black", markersize=3)
        if not episode.success:
            axes.plot(*episode.path[-1], "x", color=FAILURE, markersize=6)
