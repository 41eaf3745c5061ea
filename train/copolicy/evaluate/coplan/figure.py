"""A picture of a study: the paths of the table's centre, one panel for each set of obstacles."""

import math
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from copolicy.dataset.files.staging import replacement
from copolicy.tasks.table.map_config import WINDOW
from copolicy.tasks.table.physics import GOAL_SIZE

from .rollouts import Outcome

# Okabe and Ito's palette: told apart with every kind of colour vision. Failures are dashed as well.
_SUCCESS, _FAILURE, _GOAL, _OBSTACLE = "#0072B2", "#D55E00", "#009E73", "#555555"


def save_trajectories(outcomes: Sequence[Outcome], path: Path, title: str) -> None:
    """Draws all outcomes into a PNG."""
    panels: dict[tuple, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        panels[outcome.map_config.layout].append(outcome)
    columns = min(4, len(panels))
    rows = math.ceil(len(panels) / columns)
    figure = Figure(figsize=(4.2 * columns, 2.5 * rows + 0.7), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(rows, columns, squeeze=False).flat)
    for obstacles in sorted(panels, key=lambda obstacles: (len(obstacles), obstacles)):
        _panel(axes.pop(0), obstacles, panels[obstacles])
    for axis in axes:
        axis.set_visible(False)
    handles = [
        Line2D([], [], color=_SUCCESS, label="reached the goal"),
        Line2D([], [], color=_FAILURE, linestyle="--", marker="x", label="did not"),
        Rectangle((0, 0), 1, 1, fill=False, edgecolor=_GOAL, label="goal"),
        Rectangle((0, 0), 1, 1, color=_OBSTACLE, label="obstacle"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle(title)
    with replacement(path) as partial:
        figure.savefig(partial, format="png")


def _panel(axis, obstacles, outcomes: Sequence[Outcome]) -> None:
    for (x, y), size in obstacles:
        axis.add_patch(Rectangle((x - size / 2, y - size / 2), size, size, color=_OBSTACLE))
    for x, y in {outcome.map_config.goal for outcome in outcomes}:
        axis.add_patch(Rectangle((x - GOAL_SIZE / 2, y - GOAL_SIZE / 2), GOAL_SIZE, GOAL_SIZE, fill=False, ec=_GOAL))
    for outcome in outcomes:
        colour, style = (_SUCCESS, "-") if outcome.success else (_FAILURE, "--")
        axis.plot(outcome.path[:, 0], outcome.path[:, 1], style, color=colour, linewidth=1, alpha=0.75)
        axis.plot(*outcome.path[0], "o", color="black", markersize=3)
        if not outcome.success:
            axis.plot(*outcome.path[-1], "x", color=_FAILURE, markersize=6)
    reached = sum(outcome.success for outcome in outcomes)
    axis.set(xlim=(0, WINDOW[0]), ylim=(WINDOW[1], 0), xticks=[], yticks=[], aspect="equal")
    axis.set_title(f"{len(obstacles)} obstacle{'s' * (len(obstacles) != 1)}: {reached} of {len(outcomes)}", fontsize=9)
