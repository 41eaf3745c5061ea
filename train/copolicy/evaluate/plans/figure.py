"""Figure of the action chunks sampled in one state: first forces, planned paths, and the paths of the episodes."""

from collections import Counter
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from copolicy.dataset.files.staging import replacement
from copolicy.dataset.outline import to_scene
from copolicy.dataset.outline_figure import OBSTACLE, SERIES, draw_body, draw_fixed, show_whole
from copolicy.dataset.task_spec import PLAYERS

from .sampling import BranchPoint

_FAILURE = "#999999"
_ARROW = 70 / 95  # arrow length as a proportion of the outline's: many arrows begin at one point
_NEAR = 140 / 95  # half the side of the second panel, in lengths of the outline's arrow


def save_chunk_figure(branch_point: BranchPoint, path: Path, title: str) -> None:
    """Draws a PNG of two panels: the episodes' paths to their ends, and the chunks near the body with first forces."""
    counts = Counter(sample.route for sample in branch_point.samples)
    routes = sorted(route for route in counts if route is not None)
    colours: dict[str | None, str] = {route: SERIES[k % len(SERIES)] for k, route in enumerate(routes)}
    colours[None] = _FAILURE
    figure = Figure(figsize=(12, 5.0), dpi=110, layout="constrained")
    far, near = figure.subplots(1, 2, width_ratios=(2, 1))
    _paths(far, branch_point, colours)
    _forces(near, branch_point, colours)
    handles: list = [
        Line2D([], [], color=colours[route], label=f"{_route_label(route, branch_point)}: {counts[route]}", linewidth=2)
        for route in routes
    ]
    if counts[None]:
        label = f"{branch_point.task.words.did_not}: {counts[None]}"
        handles.append(Line2D([], [], color=_FAILURE, linestyle="--", marker="x", label=label))
    has_obstacles = any(shape.role == "obstacle" for shape in branch_point.outline.fixed(branch_point.scenario))
    handles += [
        *([Rectangle((0, 0), 1, 1, color=OBSTACLE, label="obstacle")] if has_obstacles else []),
        Rectangle((0, 0), 1, 1, fill=False, hatch="///", label="goal"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 6), frameon=False)
    figure.suptitle(title)
    with replacement(path) as partial:
        figure.savefig(partial, format="png", pil_kwargs={"optimize": True})


def _paths(axis: Axes, branch_point: BranchPoint, colours: dict[str | None, str]) -> None:
    _scene(axis, branch_point)
    axis.plot(*branch_point.approach.T, color="black", linewidth=1.2)
    begin = len(branch_point.approach) - 1
    for sample in branch_point.samples:
        assert sample.episode.path is not None  # its task has an outline
        x, y = sample.episode.path[begin:].T
        style = "-" if sample.episode.success else "--"
        axis.plot(x, y, style, color=colours[sample.route], linewidth=1, alpha=0.6)
        if not sample.episode.success:
            axis.plot(x[-1], y[-1], "x", color=_FAILURE, markersize=7)
    show_whole(axis, branch_point.outline)
    axis.set_title("each chunk, continued to the end with new chunks", fontsize=10)


def _forces(axis: Axes, branch_point: BranchPoint, colours: dict[str | None, str]) -> None:
    outline = branch_point.outline
    _scene(axis, branch_point)
    first = outline.forces(np.array([sample.chunk[0] for sample in branch_point.samples])) * _ARROW * outline.arrow
    for grip, forces, name in zip(outline.hands, (first[:, :2], first[:, 2:]), PLAYERS, strict=True):
        x, y = to_scene(branch_point.pose, grip)
        axis.quiver(
            np.full(len(forces), x), np.full(len(forces), y), *forces.T,
            color=[colours[sample.route] for sample in branch_point.samples],
            angles="xy", scale_units="xy", scale=1, width=0.005, alpha=0.6, zorder=3,
        )  # fmt: skip
        axis.annotate(name, (x, y), (0, -34), textcoords="offset points", ha="center", fontsize=9)
    for sample in branch_point.samples:
        axis.plot(*sample.planned_path.T, color=colours[sample.route], linewidth=1.5, alpha=0.8, zorder=4)
    (x, y, _), near = branch_point.pose, _NEAR * outline.arrow
    axis.set(xlim=(x - near, x + near), ylim=(y + near, y - near), xticks=[], yticks=[], aspect="equal")
    axis.set_title("first forces of both players, and the chunks' paths", fontsize=10)


def _scene(axis: Axes, branch_point: BranchPoint) -> None:
    goal = {"edgecolor": "black", "hatch": "///"}
    draw_fixed(axis, branch_point.outline.fixed(branch_point.scenario), **goal)
    draw_body(axis, branch_point.outline, branch_point.pose)


def _route_label(route: str, branch_point: BranchPoint) -> str:
    words = branch_point.task.words
    return f"{route} ({words.meanings[route]})" if route in words.meanings else route or words.success
