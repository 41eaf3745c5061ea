"""Pictures of a data set for its card: trajectories, shares of the routes, and routes beside those of people."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from copolicy.dataset.files.staging import replacement
from copolicy.tasks.table.map_config import WINDOW
from copolicy.tasks.table.physics import GOAL_SIZE

from .facts import DatasetFacts
from .frames import EpisodeFrames, read_frames
from .human_figure import human_figure

FOLDER = Path("figures")

# Okabe and Ito's palette, told apart with every kind of colour vision; routes of one map never share a colour.
_ROUTES = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#A89B00", "#8C8C8C")
_NO_ROUTE, _GOAL, _OBSTACLE, _FAILURE = "#666666", "#009E73", "#3A3E48", "#D55E00"
_MOST_PANELS = 12


def save_figures(facts: DatasetFacts) -> list[tuple[str, str]]:
    """Draws the pictures into the data set's folder.

    Returns:
        For each its path in that folder, and a caption.

    Raises:
        FileFormatError: the frames or the stored statistics cannot be read.
    """
    sources = " and ".join(facts.values("source"))
    total, groups = _by_obstacles(facts)
    most = f", the {len(groups)} most frequent of {total} sets of obstacles" if len(groups) < total else ""
    what = f"{len(facts.episodes)} episodes, source: {sources}{most}"
    pictures = [
        ("trajectories.png", f"Paths of the table's centre by route class ({what}).", _trajectories(groups)),
        ("routes.png", f"Routes by set of obstacles ({what}).", _route_shares(groups)),
    ]
    people = human_figure(facts)
    if people is not None:
        pictures.append(("human_routes.png", people[1], people[0]))
    saved = []
    for name, caption, figure in pictures:
        with replacement(facts.root / FOLDER / name) as partial:
            figure.savefig(partial, format="png")
        saved.append(((FOLDER / name).as_posix(), caption))
    return saved


def _by_obstacles(facts: DatasetFacts) -> tuple[int, list[tuple[str, list[tuple[dict, EpisodeFrames]]]]]:
    """How many sets of obstacles there are; title and members of the most frequent, fewest obstacles first."""
    groups: dict[tuple, list[tuple[dict, EpisodeFrames]]] = defaultdict(list)
    for episode, frames in zip(facts.episodes, read_frames(facts), strict=True):
        groups[frames.map_config.obstacle_size, frames.map_config.layout].append((episode, frames))
    largest = sorted(groups, key=lambda key: -len(groups[key]))[:_MOST_PANELS]
    return len(groups), [
        (" ".join(f"({x:.0f}, {y:.0f})" for (x, y), _ in key[1]) or "no obstacle", groups[key])
        for key in sorted(largest, key=lambda key: (len(key[1]), key))
    ]


def _trajectories(groups: Sequence[tuple[str, list[tuple[dict, EpisodeFrames]]]]) -> Figure:
    columns = min(3, len(groups))
    rows = math.ceil(len(groups) / columns)
    figure = Figure(figsize=(4.2 * columns, 2.45 * rows + 0.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes: Iterator = iter(figure.subplots(rows, columns, squeeze=False).flat)
    for (title, members), axis in zip(groups, axes, strict=False):
        _panel(axis, title, members)
    for axis in axes:
        axis.set_visible(False)
    handles = [
        Rectangle((0, 0), 1, 1, fill=False, edgecolor=_GOAL, label="goal"),
        Rectangle((0, 0), 1, 1, color=_OBSTACLE, label="obstacle"),
        Line2D([], [], color=_FAILURE, linestyle="", marker="x", label="ended short of the goal"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return figure


def _panel(axis, title: str, members: Sequence[tuple[dict, EpisodeFrames]]) -> None:
    config = members[0][1].map_config
    for x, y in {frames.map_config.goal for _, frames in members}:
        corner = (x - GOAL_SIZE / 2, y - GOAL_SIZE / 2)
        axis.add_patch(Rectangle(corner, GOAL_SIZE, GOAL_SIZE, fill=False, edgecolor=_GOAL))
    for (x, y), size in config.squares:
        axis.add_patch(Rectangle((x - size / 2, y - size / 2), size, size, color=_OBSTACLE))
    for episode, frames in members:
        x, y = frames.states[:, 0], frames.states[:, 1]
        axis.plot(x, y, color=route_colour(episode["route_class"]), linewidth=0.9, alpha=0.6)
        if not episode["success"]:
            axis.plot(x[-1], y[-1], "x", color=_FAILURE, markersize=5)
    routes = Counter(episode["route_class"] for episode, _ in members)
    handles = [
        Line2D([], [], color=route_colour(route), label=f"{route or 'none'} {count}")
        for route, count in routes.most_common()
    ]
    axis.legend(handles=handles, loc="lower left", ncols=4, fontsize=7, frameon=False, handlelength=1)
    axis.set(xlim=(0, WINDOW[0]), ylim=(WINDOW[1], 0), xticks=[], yticks=[], aspect="equal")
    axis.set_title(f"obstacles {title}: {len(members)} episodes", fontsize=8)


def _route_shares(groups: Sequence[tuple[str, list[tuple[dict, EpisodeFrames]]]]) -> Figure:
    figure = Figure(figsize=(8, 0.5 * len(groups) + 0.9), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.subplots()
    for row, (_, members) in enumerate(groups):
        left = 0.0
        routes = Counter(episode["route_class"] for episode, _ in members)
        for route, count in sorted(routes.items()):
            part = count / len(members)
            axis.barh(row, part, left=left, color=route_colour(route), edgecolor="white")
            if part > 0.06:
                text = f"{route or 'none'} {count}"
                axis.text(left + part / 2, row, text, ha="center", va="center", fontsize=8, color=_on(route))
            left += part
    axis.set_yticks(range(len(groups)), [f"{title}\n{len(members)} episodes" for title, members in groups], fontsize=7)
    axis.set(xlim=(0, 1), xlabel="share of episodes", ylim=(len(groups) - 0.4, -0.6))
    axis.spines[["top", "right", "left"]].set_visible(False)
    return figure


def _on(route: str) -> str:
    """Colour of letters that can be read on a route's colour."""
    return "white" if route_colour(route) in ("#0072B2", _NO_ROUTE) else "black"


def route_colour(route: str) -> str:
    """Colour of a side word, the same as in the report."""
    if not route or set(route) - {"L", "R"}:
        return _NO_ROUTE
    return _ROUTES[int(route.replace("L", "0").replace("R", "1"), 2) % len(_ROUTES)]
