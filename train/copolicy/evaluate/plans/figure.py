"""Figure of the action chunks sampled in one state: first forces, planned paths, and the paths of the episodes."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from copolicy.dataset.files.staging import replacements
from copolicy.dataset.outline import Shape, to_scene
from copolicy.dataset.outline_figure import OBSTACLE, SERIES, draw_body, draw_fixed, show_whole
from copolicy.dataset.task import PairTask
from copolicy.dataset.task_spec import PLAYERS

from .sampling import BranchPoint

_FAILURE = "#999999"
_ARROW = 70 / 95  # arrow length as a proportion of the outline's: many arrows begin at one point
_NEAR = 140 / 95  # half the side of the second panel, in lengths of the outline's arrow


def save_chunk_figure(branch_points: Sequence[BranchPoint], paths: Sequence[Path], title: str) -> None:
    """Draws two panels for each state: the episodes' paths to their ends, and chunks and first forces near the body.

    A route has the same colour in all panels.

    Args:
        branch_points: of one task.
        paths: files, PNG or SVG by the end of their names.
    """
    counts = Counter(sample.route for branch_point in branch_points for sample in branch_point.samples)
    routes = sorted(route for route in counts if route is not None)
    colours: dict[str | None, str] = {route: SERIES[k % len(SERIES)] for k, route in enumerate(routes)}
    colours[None] = _FAILURE
    figure = Figure(figsize=(12, 4.3 * len(branch_points) + 0.7), dpi=110, layout="constrained")
    rows = figure.subplots(len(branch_points), 2, width_ratios=(2, 1), squeeze=False)
    for (far, near), branch_point in zip(rows, branch_points, strict=True):
        _paths(far, branch_point, colours)
        _forces(near, branch_point, colours)
        if len(branch_points) > 1:
            far.set_ylabel(_row_label(branch_point), fontsize=9)
    task = branch_points[0].task
    handles: list = [
        Line2D([], [], color=colours[route], label=f"{_route_label(route, task)}: {counts[route]}", linewidth=2)
        for route in routes
    ]
    if counts[None]:
        label = f"{task.words.did_not}: {counts[None]}"
        handles.append(Line2D([], [], color=_FAILURE, linestyle="--", marker="x", label=label))
    shapes = {shape.role for branch_point in branch_points for shape in _fixed(branch_point)}
    handles += [
        *([Rectangle((0, 0), 1, 1, color=OBSTACLE, label="obstacle")] if "obstacle" in shapes else []),
        Rectangle((0, 0), 1, 1, fill=False, hatch="///", label="goal"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 6), frameon=False)
    figure.suptitle(title)
    with replacements(paths) as partials, matplotlib.rc_context({"svg.hashsalt": "copolicy"}):
        for path, partial in zip(paths, partials, strict=True):
            svg = path.suffix.lower() == ".svg"
            options: dict[str, Any] = {"metadata": {"Date": None}} if svg else {"pil_kwargs": {"optimize": True}}
            figure.savefig(partial, format="svg" if svg else "png", **options)


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
    draw_fixed(axis, _fixed(branch_point), **goal)
    draw_body(axis, branch_point.outline, branch_point.pose)


def _fixed(branch_point: BranchPoint) -> tuple[Shape, ...]:
    return branch_point.outline.fixed(branch_point.scenario)


def _row_label(branch_point: BranchPoint) -> str:
    """Name of the scenario, and the number of chunks of each route."""
    task = branch_point.task
    counts = Counter(sample.route for sample in branch_point.samples)
    texts = [
        f"{task.words.did_not if route is None else route or task.words.success}: {count}"
        for route, count in sorted(counts.items(), key=lambda entry: (entry[0] is None, entry[0] or ""))
    ]
    return "\n".join((task.identify(branch_point.scenario)[0], ", ".join(texts)))


def _route_label(route: str, task: PairTask) -> str:
    meaning = task.words.meanings.get(route)
    return f"{route} ({meaning})" if meaning else route or task.words.success
