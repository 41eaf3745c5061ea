"""A picture of many plans from one state: where they begin to differ, and which ways they lead."""

from collections import Counter
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from copolicy.dataset.files.staging import replacement
from copolicy.dataset.outline import placed
from copolicy.dataset.outline_figure import OBSTACLE, SERIES, draw_body, draw_fixed, show_whole
from copolicy.dataset.task_spec import PLAYERS

from .sampling import Decision

_FAILURE = "#999999"
_ARROW = 70 / 95  # of the outline's arrows: many begin in one point
_NEAR = 140 / 95  # of the same, around the body in the second panel


def save_plans(decision: Decision, path: Path, title: str) -> None:
    """Draws the paths to their ends, and around the table the plans themselves with their first forces, as a PNG."""
    routes = Counter(sample.route for sample in decision.samples)
    words = sorted(word for word in routes if word is not None)
    colours: dict[str | None, str] = {word: SERIES[place % len(SERIES)] for place, word in enumerate(words)} | {
        None: _FAILURE
    }
    figure = Figure(figsize=(12, 5.0), dpi=110, layout="constrained")
    far, near = figure.subplots(1, 2, width_ratios=(2, 1))
    _paths(far, decision, colours)
    _forces(near, decision, colours)
    handles: list = [
        Line2D([], [], color=colours[word], label=f"{_meaning(word, decision)}: {routes[word]}", linewidth=2)
        for word in words
    ]
    if routes[None]:
        label = f"{decision.task.words.did_not}: {routes[None]}"
        handles.append(Line2D([], [], color=_FAILURE, linestyle="--", marker="x", label=label))
    around = any(shape.role == "obstacle" for shape in decision.outline.fixed(decision.map_config))
    handles += [
        *([Rectangle((0, 0), 1, 1, color=OBSTACLE, label="obstacle")] if around else []),
        Rectangle((0, 0), 1, 1, fill=False, hatch="///", label="goal"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 6), frameon=False)
    figure.suptitle(title)
    with replacement(path) as partial:
        figure.savefig(partial, format="png", pil_kwargs={"optimize": True})


def _paths(axis: Axes, decision: Decision, colours: dict[str | None, str]) -> None:
    _scene(axis, decision)
    axis.plot(*decision.way.T, color="black", linewidth=1.2)
    begin = len(decision.way) - 1
    for sample in decision.samples:
        assert sample.outcome.path is not None  # its task has an outline
        x, y = sample.outcome.path[begin:].T
        style = "-" if sample.outcome.success else "--"
        axis.plot(x, y, style, color=colours[sample.route], linewidth=1, alpha=0.6)
        if not sample.outcome.success:
            axis.plot(x[-1], y[-1], "x", color=_FAILURE, markersize=7)
    show_whole(axis, decision.outline)
    axis.set_title("each plan, carried on to the end with new plans", fontsize=10)


def _forces(axis: Axes, decision: Decision, colours: dict[str | None, str]) -> None:
    outline = decision.outline
    _scene(axis, decision)
    first = outline.forces(np.array([sample.plan[0] for sample in decision.samples])) * _ARROW * outline.arrow
    for hand, forces, name in zip(outline.hands, (first[:, :2], first[:, 2:]), PLAYERS, strict=True):
        x, y = placed(decision.pose, hand)
        axis.quiver(
            np.full(len(forces), x), np.full(len(forces), y), *forces.T,
            color=[colours[sample.route] for sample in decision.samples],
            angles="xy", scale_units="xy", scale=1, width=0.005, alpha=0.6, zorder=3,
        )  # fmt: skip
        axis.annotate(name, (x, y), (0, -34), textcoords="offset points", ha="center", fontsize=9)
    for sample in decision.samples:
        axis.plot(*sample.planned_path.T, color=colours[sample.route], linewidth=1.5, alpha=0.8, zorder=4)
    (x, y, _), near = decision.pose, _NEAR * outline.arrow
    axis.set(xlim=(x - near, x + near), ylim=(y + near, y - near), xticks=[], yticks=[], aspect="equal")
    axis.set_title("first forces of both players, and the plans alone", fontsize=10)


def _scene(axis: Axes, decision: Decision) -> None:
    goal = {"edgecolor": "black", "hatch": "///"}
    draw_fixed(axis, decision.outline.fixed(decision.map_config), **goal)
    draw_body(axis, decision.outline, decision.pose)


def _meaning(word: str, decision: Decision) -> str:
    words = decision.task.words
    return f"{word} ({words.meanings[word]})" if word in words.meanings else word or words.success
