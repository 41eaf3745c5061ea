"""A picture of many plans from one state: where they begin to differ, and which ways they lead."""

from collections import Counter
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon, Rectangle

from copolicy.dataset.files.staging import replacement
from copolicy.dataset.outline import placed
from copolicy.dataset.task_spec import PLAYERS
from copolicy.tasks.table.map_config import WINDOW
from copolicy.tasks.table.outline import BOARD, CIRCLE_CENTRE, CIRCLE_RADIUS, TRIANGLE
from copolicy.tasks.table.physics import GOAL_SIZE

from .sampling import Decision

# Okabe and Ito's palette: told apart with every kind of colour vision. The eight are the ways past three obstacles.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D00")
_FAILURE, _OBSTACLE, _BOARD = "#999999", "#555555", "#E4DCCB"
_SEATS = ((75.5, 6.0), CIRCLE_CENTRE)  # robot, human
_ARROW = 70.0  # px, a player's full force
_NEAR = 140.0  # px around the table in the second panel


def save_plans(decision: Decision, path: Path, title: str) -> None:
    """Draws the paths to their ends, and around the table the plans themselves with their first forces, as a PNG."""
    routes = Counter(sample.route for sample in decision.samples)
    words = sorted(word for word in routes if word is not None)
    colours: dict[str | None, str] = {word: _COLOURS[place] for place, word in enumerate(words)} | {None: _FAILURE}
    figure = Figure(figsize=(12, 5.0), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    far, near = figure.subplots(1, 2, width_ratios=(2, 1))
    _paths(far, decision, colours)
    _forces(near, decision, colours)
    handles: list = [
        Line2D([], [], color=colours[word], label=f"{_meaning(word)}: {routes[word]}", linewidth=2) for word in words
    ]
    if routes[None]:
        label = f"did not reach the goal: {routes[None]}"
        handles.append(Line2D([], [], color=_FAILURE, linestyle="--", marker="x", label=label))
    handles += [
        Rectangle((0, 0), 1, 1, color=_OBSTACLE, label="obstacle"),
        Rectangle((0, 0), 1, 1, fill=False, hatch="///", label="goal"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 6), frameon=False)
    figure.suptitle(title)
    with replacement(path) as partial:
        figure.savefig(partial, format="png", pil_kwargs={"optimize": True})


def _paths(axis: Axes, decision: Decision, colours: dict[str | None, str]) -> None:
    _furniture(axis, decision)
    axis.plot(*decision.way.T, color="black", linewidth=1.2)
    begin = len(decision.way) - 1
    for sample in decision.samples:
        x, y = sample.outcome.path[begin:].T
        style = "-" if sample.outcome.success else "--"
        axis.plot(x, y, style, color=colours[sample.route], linewidth=1, alpha=0.6)
        if not sample.outcome.success:
            axis.plot(x[-1], y[-1], "x", color=_FAILURE, markersize=7)
    _table(axis, decision.pose)
    axis.set(xlim=(0, WINDOW[0]), ylim=(WINDOW[1], 0), xticks=[], yticks=[], aspect="equal")
    axis.set_title("each plan, carried on to the end with new plans", fontsize=10)


def _forces(axis: Axes, decision: Decision, colours: dict[str | None, str]) -> None:
    _furniture(axis, decision)
    _table(axis, decision.pose)
    for seat, first in zip(_SEATS, (slice(0, 2), slice(2, 4)), strict=True):
        x, y = placed(decision.pose, seat)
        forces = np.array([sample.plan[0, first] for sample in decision.samples]) * _ARROW
        axis.quiver(
            np.full(len(forces), x), np.full(len(forces), y), *forces.T,
            color=[colours[sample.route] for sample in decision.samples],
            angles="xy", scale_units="xy", scale=1, width=0.005, alpha=0.6, zorder=3,
        )  # fmt: skip
    for sample in decision.samples:
        axis.plot(*sample.planned_path.T, color=colours[sample.route], linewidth=1.5, alpha=0.8, zorder=4)
    for seat, name in zip(_SEATS, PLAYERS, strict=True):
        x, y = placed(decision.pose, seat)
        axis.annotate(name, (x, y), (0, -34), textcoords="offset points", ha="center", fontsize=9)
    x, y, _ = decision.pose
    axis.set(xlim=(x - _NEAR, x + _NEAR), ylim=(y + _NEAR, y - _NEAR), xticks=[], yticks=[], aspect="equal")
    axis.set_title("first forces of both players, and the plans alone", fontsize=10)


def _furniture(axis: Axes, decision: Decision) -> None:
    config = decision.map_config
    for (x, y), size in config.squares:
        half = size / 2
        axis.add_patch(Rectangle((x - half, y - half), 2 * half, 2 * half, color=_OBSTACLE))
    x, y = config.goal
    axis.add_patch(Rectangle((x - GOAL_SIZE / 2, y - GOAL_SIZE / 2), GOAL_SIZE, GOAL_SIZE, fill=False, hatch="///"))


def _table(axis: Axes, pose: tuple[float, float, float]) -> None:
    left, top, right, bottom = BOARD
    board = [placed(pose, point) for point in ((left, top), (right, top), (right, bottom), (left, bottom))]
    axis.add_patch(Polygon(board, facecolor=_BOARD, edgecolor="#8A7F6A", zorder=1.5))
    axis.add_patch(Polygon([placed(pose, point) for point in TRIANGLE], facecolor="#3B6FB6", zorder=1.5))
    axis.add_patch(Circle(placed(pose, CIRCLE_CENTRE), CIRCLE_RADIUS, facecolor="#E8862E", zorder=1.5))


def _meaning(word: str) -> str:
    sides = set(word)
    if len(sides) != 1:
        return word or "reached the goal"
    side = "below" if sides == {"L"} else "above"  # the maps of all sets are carried through to the right
    return f"{word} ({side}{' all' if len(word) > 1 else ''})"
