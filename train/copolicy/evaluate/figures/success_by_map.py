"""Success rates by map, with Wilson's intervals."""

import math
import textwrap
from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from copolicy.dataset.outline_figure import SERIES
from copolicy.dataset.task import PairTask

from ..summary import success_rate
from ..trajectory_sources import Source

DEFINITION = (
    "proportion of the episodes on the map that succeeded; 95 % interval by Wilson, which takes the episodes of a map "
    "as independent; maps by rising rate of all sources together, then by name"
)
_ROWS = 30  # maps in a column of the figure
_MANY = 20  # maps from which those without a failure share a row
_ALL = "all"
_MARKERS = "osD^vPX"


def rates_by_map(sources: Sequence[Source]) -> dict[str, dict[str, dict[str, Any]]]:
    """`success_rate` by `map_id` and name of the source, in the order of `DEFINITION`; first of all maps (`all`)."""
    outcomes: dict[str, dict[str, list[bool]]] = defaultdict(lambda: defaultdict(list))
    for source in sources:
        for episode in source.episodes:
            outcomes[str(episode.columns["map_id"])][source.name].append(bool(episode.columns["success"]))

    def order(map_id: str) -> tuple[float, str]:
        flags = [flag for of_source in outcomes[map_id].values() for flag in of_source]
        return sum(flags) / len(flags), map_id

    every = {
        source.name: success_rate([bool(episode.columns["success"]) for episode in source.episodes])
        for source in sources
    }
    return {
        _ALL: every,
        **{
            map_id: {name: success_rate(flags) for name, flags in outcomes[map_id].items()}
            for map_id in sorted(outcomes, key=order)
        },
    }


def success_by_map(task: PairTask, sources: Sequence[Source]) -> tuple[Figure, Any]:
    """The figure, and its numbers for `figures.json`."""
    rates = rates_by_map(sources)
    shown = _without_perfect(rates) if len(rates) > _MANY else rates
    maps = list(shown)
    columns = math.ceil(len(maps) / _ROWS)
    rows = math.ceil(len(maps) / columns)
    row_height = 0.14 + 0.07 * len(sources)
    size = (max(7.5, 4.4 * columns), max(2.0, row_height * rows) + 1.5 + 0.3 * len(sources))
    figure = Figure(figsize=size, dpi=120, layout="constrained")
    axes = list(figure.subplots(1, columns, squeeze=False).flat)
    for index, axis in enumerate(axes):
        _column(axis, {map_id: shown[map_id] for map_id in maps[index * rows : (index + 1) * rows]}, sources)
        axis.set_ylim(rows - 0.5, -0.5)
        if index == 0:
            axis.set_ylabel(task.words.scenario, fontsize=8)
    handles = [
        Line2D([], [], color=_colour(index), marker=_marker(index), label=_legend(source), linewidth=1.2)
        for index, source in enumerate(sources)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=1, frameon=False, fontsize=8)
    title = f"{task.words.success.capitalize()}, by {task.words.scenario}: rate and Wilson's 95 % interval"
    figure.suptitle(title, fontsize=11)
    return figure, {"definition": DEFINITION, "unit": "proportion", "maps": rates}


def _without_perfect(rates: dict[str, dict[str, dict[str, Any]]]) -> dict[str, dict[str, dict[str, Any]]]:
    """The same with one row for all maps on which every episode of every source succeeded."""
    perfect = [
        map_id
        for map_id, of_source in rates.items()
        if map_id != _ALL and all(rate["mean"] == 1 for rate in of_source.values())
    ]
    episodes: Counter[str] = Counter()
    for map_id in perfect:
        episodes.update({name: rate["episodes"] for name, rate in rates[map_id].items()})
    together = {name: success_rate([True] * count) for name, count in episodes.items()}
    kept = {map_id: of_source for map_id, of_source in rates.items() if map_id not in perfect}
    return {**kept, **({f"{len(perfect)} without a failure": together} if perfect else {})}


def _column(axes: Axes, rates: dict[str, dict[str, dict[str, Any]]], sources: Sequence[Source]) -> None:
    spread = 0.6 / max(1, len(sources))
    for row, of_source in enumerate(rates.values()):
        for index, source in enumerate(sources):
            if (rate := of_source.get(source.name)) is None:
                continue
            y = row + (index - (len(sources) - 1) / 2) * spread
            low, high = (100 * bound for bound in rate["wilson_95"])
            axes.plot((low, high), (y, y), color=_colour(index), linewidth=1.2, alpha=0.7)
            axes.plot(100 * rate["mean"], y, _marker(index), color=_colour(index), markersize=4)
    labels = [_label(map_id, of_source) for map_id, of_source in rates.items()]
    axes.set_yticks(range(len(rates)), labels, fontsize=7)
    axes.set(xlim=(-2, 102))
    axes.set_xlabel("success, %", fontsize=8)
    axes.tick_params(axis="x", labelsize=7)
    axes.grid(axis="x", alpha=0.3)
    for row in range(0, len(rates), 2):
        axes.axhspan(row - 0.5, row + 0.5, color="#F3F3F3", zorder=0)


def _label(map_id: str, of_source: dict[str, dict[str, Any]]) -> str:
    counts = sorted({rate["episodes"] for rate in of_source.values()})
    number = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]}-{counts[-1]}"
    return f"{map_id} (n {number})"


def _legend(source: Source) -> str:
    text = f"{source.name}: {len(source.episodes)} episodes; {source.label}"
    return textwrap.fill(text, 95, max_lines=2, placeholder=" ...")


def _colour(index: int) -> str:
    return SERIES[index % len(SERIES)]


def _marker(index: int) -> str:
    return _MARKERS[index % len(_MARKERS)]
