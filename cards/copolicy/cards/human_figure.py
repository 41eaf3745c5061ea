"""Figure of a data set's routes, human routes, and the divergence between both."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from copolicy.dataset.outline_figure import BLUE, ORANGE

from .artefacts import stored_statistics
from .facts import DatasetFacts
from .route_statistics import HumanDistance, RouteStatistics, route_statistics

_DATA_SET, _PEOPLE, _NULL = BLUE, ORANGE, "#BBBBBB"
_HEIGHT = 0.38  # of a bar; a route has two bars


def human_figure(facts: DatasetFacts) -> tuple[Figure, str] | None:
    """Draws the figure and writes its caption; None if the statistics are missing or hold no distance."""
    stored = stored_statistics(facts.root)
    routes = None if stored is None else route_statistics(stored)
    if routes is None or not routes.distances:
        return None
    return _draw(routes), _caption(routes)


def _caption(routes: RouteStatistics) -> str:
    computed = [distance for distance in routes.distances if distance.bits is not None]
    distances = "; ".join(f"{_obstacles(distance.obstacles)}: {_bits(distance)}" for distance in computed)
    return (
        f"Routes of this data set ({routes.played_by}) and of human-human demonstrations (Yang and Mavrogiannis, HRI "
        "2025), over all maps with the same number of obstacles, and the Jensen-Shannon divergence between both "
        f"(0: equal, 1: disjoint): {distances or 'too few episodes'}."
    )


def _bits(distance: HumanDistance) -> str:
    low, high = distance.interval or (float("nan"), float("nan"))
    return f"{distance.bits:.3f} bits (95 % interval {low:.3f} to {high:.3f})"


def _obstacles(number: int) -> str:
    return f"{number} obstacle{'' if number == 1 else 's'}"


def _draw(routes: RouteStatistics) -> Figure:
    most = max(len(distance.routes) for distance in routes.distances)
    count = len(routes.distances)
    figure = Figure(figsize=(3.1 * count + 3.4, 0.42 * most + 1.5), dpi=110, layout="constrained")
    *panels, last = figure.subplots(1, count + 1, squeeze=False, width_ratios=[*[1] * count, 1.15])[0]
    for axis, distance in zip(panels, routes.distances, strict=True):
        _proportions(axis, distance)
    _divergences(last, routes.distances)
    handles = [
        Patch(color=_DATA_SET, label=f"this data set: {routes.played_by}"),
        Patch(color=_PEOPLE, label="people"),
        Patch(color=_NULL, label="null distribution, 95 %"),
        Line2D([], [], color="black", marker="o", label="divergence, 95 % interval"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure


def _proportions(axis: Axes, distance: HumanDistance) -> None:
    for row, route in enumerate(distance.routes):
        for offset, count, total, colour in (
            (-_HEIGHT / 2, route["ours"], distance.episodes, _DATA_SET),
            (_HEIGHT / 2, route["human"], distance.demonstrations, _PEOPLE),
        ):
            proportion = count / max(1, total)
            axis.barh(row + offset, proportion, height=_HEIGHT, color=colour)
            axis.text(proportion + 0.01, row + offset, str(count), va="center", fontsize=7)
    axis.set_yticks(range(len(distance.routes)), [route["word"] for route in distance.routes], fontsize=8)
    axis.set(xlim=(0, 1), ylim=(len(distance.routes) - 0.4, -0.6), xlabel="proportion of episodes")
    mirrored = ", human L and R exchanged" if distance.reading == "mirrored" else ""
    title = f"{_obstacles(distance.obstacles)}{mirrored}\n{distance.episodes} episodes, {distance.demonstrations} human"
    axis.set_title(title, fontsize=9)
    axis.spines[["top", "right"]].set_visible(False)


def _divergences(axis: Axes, distances: Sequence[HumanDistance]) -> None:
    for row, distance in enumerate(distances):
        if distance.chance is not None:
            low, _, high = distance.chance
            axis.barh(row, high - low, left=low, height=0.5, color=_NULL)
        if distance.bits is None or distance.interval is None:
            axis.text(0.02, row, distance.note or "not computed", va="center", fontsize=7)
            continue
        axis.plot(distance.interval, (row, row), color="black", linewidth=1.5)
        axis.plot([distance.bits], [row], "o", color="black")
        axis.text(distance.interval[1] + 0.03, row, f"{distance.bits:.3f}", va="center", fontsize=8)
    axis.set_yticks(range(len(distances)), [_obstacles(distance.obstacles) for distance in distances], fontsize=8)
    axis.set(xlim=(0, 1), ylim=(len(distances) - 0.4, -0.6), xlabel="Jensen-Shannon divergence, bits")
    axis.set_title("distance from people", fontsize=9)
    axis.spines[["top", "right"]].set_visible(False)
