"""Draws the outline of a task into matplotlib axes, and the colours of figures.

Matplotlib is not imported here: callers pass their axes.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

from .outline import Outline, Point, Pose, Shape, to_scene

# Okabe and Ito's palette, distinguishable with every kind of colour vision; its yellow is darkened for white paper.
BLUE, ORANGE, GREEN, PURPLE = "#0072B2", "#E69F00", "#009E73", "#CC79A7"
SKY, VERMILION, BLACK, OLIVE, GREY = "#56B4E9", "#D55E00", "#000000", "#A89B00", "#8C8C8C"

SERIES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK, "#8C6D00")
"""Colours of the series that a figure compares, in order."""

GOAL, FAILURE, OBSTACLE, NO_LABEL = GREEN, VERMILION, "#555555", "#666666"
ROBOT, HUMAN = BLUE, ORANGE

_LABELS = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION, OLIVE, GREY)
_PANEL = 4.2  # inches, width of a panel if there are several
_FILLS = {"body": "#E4DCCB", "robot": "#3B6FB6", "human": "#E8862E"}


def label_colours(labels: Iterable[str]) -> dict[str, str]:
    """A colour for each strategy label; the empty label is grey.

    Labels of the letters L and R get a colour by their letters, so that labels of equal length, up to three letters,
    differ; other labels get a colour by their sorted order.
    """
    names = sorted(set(labels) - {""})
    sides = all(set(name) <= {"L", "R"} for name in names)
    indices = {
        name: int(name.replace("L", "0").replace("R", "1"), 2) if sides else index for index, name in enumerate(names)
    }
    return {**{name: _LABELS[index % len(_LABELS)] for name, index in indices.items()}, "": NO_LABEL}


def panels(figure: Any, outline: Outline, count: int, max_columns: int, footer_height: float) -> list[Any]:
    """Axes for `count` panels that show the scene, up to `max_columns` in a row; sets the size of the figure.

    Args:
        figure: an empty matplotlib figure.
        footer_height: height for a legend and a title, inches.
    """
    columns = min(max_columns, count)
    rows = math.ceil(count / columns)
    width, height = outline.size
    panel = _PANEL if columns > 1 else 1.7 * _PANEL  # room for the title and legend above and below a single one
    figure.set_size_inches(panel * columns, (panel * height / width + 0.35) * rows + footer_height)
    axes = list(figure.subplots(rows, columns, squeeze=False).flat)
    for unused in axes[count:]:
        unused.set_visible(False)
    return axes[:count]


def show_whole(axes: Any, outline: Outline) -> None:
    """Sets the limits of axes to the edges of the scene, y down, without ticks."""
    width, height = outline.size
    axes.set(xlim=(0, width), ylim=(height, 0), xticks=[], yticks=[], aspect="equal")


def draw_fixed(axes: Any, shapes: Iterable[Shape], obstacle: str = OBSTACLE, **goal: Any) -> None:
    """Draws goals as outlines and obstacles filled, each once.

    Args:
        obstacle: colour of the obstacles.
        goal: matplotlib properties of the goal outlines.
    """
    for shape in dict.fromkeys(shapes):
        if shape.role == "goal":
            axes.fill(*_columns(shape.corners), **{"fill": False, "edgecolor": GOAL, **goal})
        elif shape.role == "obstacle":
            axes.fill(*_columns(shape.corners), color=obstacle)


def draw_body(axes: Any, outline: Outline, pose: Pose) -> None:
    """Draws the body at a pose, below the lines of the figure."""
    for shape in outline.body:
        edge = "#8A7F6A" if shape.role == "body" else "none"
        corners = [to_scene(pose, point) for point in shape.corners]
        axes.fill(*_columns(corners), facecolor=_FILLS[shape.role], edgecolor=edge, zorder=1.5)


def obstacles_of(shapes: Iterable[Shape]) -> tuple[tuple[Point, tuple[float, float]], ...]:
    """Centre and size (width, height) of each obstacle, sorted."""
    obstacles = []
    for shape in shapes:
        if shape.role == "obstacle":
            (x0, x1), (y0, y1) = ((min(values), max(values)) for values in _columns(shape.corners))
            obstacles.append((((x0 + x1) / 2, (y0 + y1) / 2), (x1 - x0, y1 - y0)))
    return tuple(sorted(obstacles))


def positions_text(obstacles: Iterable[tuple[Point, Any]], outline: Outline) -> str:
    """Centres of obstacles as `(400, 200) (800, 350)`."""
    digits = decimals(outline)
    return " ".join(f"({x:.{digits}f}, {y:.{digits}f})" for (x, y), _ in obstacles)


def decimals(outline: Outline) -> int:
    """Decimal places that resolve a thousandth of the width of the scene."""
    return max(0, -int(f"{outline.size[0] / 1000:e}".partition("e")[2]))


def _columns(points: Sequence[Point]) -> list[tuple[float, ...]]:
    return list(zip(*points, strict=True))
