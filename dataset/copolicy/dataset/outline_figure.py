"""How figures draw a task: colours, and the shapes of its outline in the axes of a figure.

Nothing is imported from a plotting library: the axes are those of matplotlib that a caller made.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

from .outline import Outline, Point, Pose, Shape, to_scene

# Okabe and Ito's palette, told apart with every kind of colour vision; its yellow is darker here, on white.
BLUE, ORANGE, GREEN, PURPLE = "#0072B2", "#E69F00", "#009E73", "#CC79A7"
SKY, VERMILION, BLACK, OLIVE, GREY = "#56B4E9", "#D55E00", "#000000", "#A89B00", "#8C8C8C"

SERIES = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK, "#8C6D00")
"""Of what a figure compares, in order."""

GOAL, FAILURE, OBSTACLE, NO_LABEL = GREEN, VERMILION, "#555555", "#666666"
ROBOT, HUMAN = BLUE, ORANGE

_LABELS = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION, OLIVE, GREY)
_PANEL = 4.2  # inches, the width of one of several
_FILLS = {"body": "#E4DCCB", "robot": "#3B6FB6", "human": "#E8862E"}


def label_colours(labels: Iterable[str]) -> dict[str, str]:
    """A colour for each strategy label: of words in L and R by their letters, of others by their order; none is grey.

    Words of one length have different colours, up to three letters.
    """
    names = sorted(set(labels) - {""})
    sides = all(set(name) <= {"L", "R"} for name in names)
    places = {
        name: int(name.replace("L", "0").replace("R", "1"), 2) if sides else place for place, name in enumerate(names)
    }
    return {**{name: _LABELS[place % len(_LABELS)] for name, place in places.items()}, "": NO_LABEL}


def panels(figure: Any, outline: Outline, count: int, most: int, below: float) -> list[Any]:
    """Axes for so many pictures of the scene, up to `most` in a row, in a figure that gets the size for them.

    Args:
        figure: an empty one of matplotlib.
        below: room for a legend and a title, inches.
    """
    columns = min(most, count)
    rows = math.ceil(count / columns)
    width, height = outline.size
    panel = _PANEL if columns > 1 else 1.7 * _PANEL  # room for the title and legend above and below a single one
    figure.set_size_inches(panel * columns, (panel * height / width + 0.35) * rows + below)
    axes = list(figure.subplots(rows, columns, squeeze=False).flat)
    for unused in axes[count:]:
        unused.set_visible(False)
    return axes[:count]


def show_whole(axes: Any, outline: Outline) -> None:
    """Limits of axes at the edges of the scene, y down, without ticks."""
    width, height = outline.size
    axes.set(xlim=(0, width), ylim=(height, 0), xticks=[], yticks=[], aspect="equal")


def draw_fixed(axes: Any, shapes: Iterable[Shape], obstacle: str = OBSTACLE, **goal: Any) -> None:
    """Goals, as outlines, and filled obstacles, each once.

    Args:
        obstacle: colour of the obstacles.
        goal: of the outlines, in matplotlib's words.
    """
    for shape in dict.fromkeys(shapes):
        if shape.role == "goal":
            axes.fill(*_columns(shape.corners), **{"fill": False, "edgecolor": GOAL, **goal})
        elif shape.role == "obstacle":
            axes.fill(*_columns(shape.corners), color=obstacle)


def draw_body(axes: Any, outline: Outline, pose: Pose) -> None:
    """What moves, at a pose, below the lines of the figure."""
    for shape in outline.body:
        edge = "#8A7F6A" if shape.role == "body" else "none"
        corners = [to_scene(pose, point) for point in shape.corners]
        axes.fill(*_columns(corners), facecolor=_FILLS[shape.role], edgecolor=edge, zorder=1.5)


def obstacles_of(shapes: Iterable[Shape]) -> tuple[tuple[Point, tuple[float, float]], ...]:
    """Centre, and width and height, of each obstacle, sorted."""
    found = []
    for shape in shapes:
        if shape.role == "obstacle":
            (left, right), (top, bottom) = ((min(ends), max(ends)) for ends in _columns(shape.corners))
            found.append((((left + right) / 2, (top + bottom) / 2), (right - left, bottom - top)))
    return tuple(sorted(found))


def positions_text(obstacles: Iterable[tuple[Point, Any]], outline: Outline) -> str:
    """Where obstacles are, as `(400, 200) (800, 350)`."""
    digits = decimals(outline)
    return " ".join(f"({x:.{digits}f}, {y:.{digits}f})" for (x, y), _ in obstacles)


def decimals(outline: Outline) -> int:
    """Digits after the point of a place in the scene that tell places a thousandth of its width apart."""
    return max(0, -int(f"{outline.size[0] / 1000:e}".partition("e")[2]))


def _columns(points: Sequence[Point]) -> list[tuple[float, ...]]:
    return list(zip(*points, strict=True))
