"""A picture of a study: the paths of all episodes, one panel for each set of obstacles."""

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

from .rollouts import Outcome


def save_trajectories(outcomes: Sequence[Outcome], path: Path, title: str) -> None:
    """Draws all outcomes into a PNG.

    Raises:
        CopolicyError: their task has no outline.
    """
    task = outcomes[0].task
    outline = task.required_outline
    groups: dict[tuple, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        groups[obstacles_of(outline.fixed(outcome.map_config))].append(outcome)
    figure = Figure(dpi=110, layout="constrained")
    ordered = sorted(groups, key=lambda obstacles: (len(obstacles), obstacles))
    for obstacles, axes in zip(ordered, panels(figure, outline, len(groups), 4, 0.7), strict=True):
        members = groups[obstacles]
        draw_fixed(axes, (shape for outcome in members for shape in outline.fixed(outcome.map_config)))
        _draw_paths(axes, members)
        show_whole(axes, outline)
        around = f"{len(obstacles)} obstacle{'s' * (len(obstacles) != 1)}: " if any(groups) else ""
        axes.set_title(f"{around}{sum(outcome.success for outcome in members)} of {len(members)}", fontsize=9)
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


def _draw_paths(axes, outcomes: Sequence[Outcome]) -> None:
    for outcome in outcomes:
        assert outcome.path is not None  # its task has an outline
        colour, style = (BLUE, "-") if outcome.success else (FAILURE, "--")
        axes.plot(*outcome.path.T, style, color=colour, linewidth=1, alpha=0.75)
        axes.plot(*outcome.path[0], "o", color="black", markersize=3)
        if not outcome.success:
            axes.plot(*outcome.path[-1], "x", color=FAILURE, markersize=6)
