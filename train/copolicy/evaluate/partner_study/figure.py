"""Figure of a study with partners: one panel per measure, kinds of partner along x, one colour per robot."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from copolicy.dataset.files.staging import replacement
from copolicy.dataset.outline_figure import SERIES

_MARKERS = "osD^vPX"

_Point = tuple[float, float, float]
"""Value, length of the error bar below, length above."""


def save_partner_figure(summaries: Mapping[str, Mapping[str, Any]], path: Path, title: str) -> None:
    """Draws summaries, by name of robot, into a PNG; a measure that the task lacks has no panel."""
    first = next(iter(summaries.values()))
    kinds = list(first["by_partner"])
    panels = {label: point for label, (measure, point) in _PANELS.items() if first[measure] is not None}
    figure = Figure(figsize=(3.25 * len(panels), 3.6), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(1, len(panels), squeeze=False).flat)
    width = 0.7 / max(1, len(summaries))
    for index, (name, summary) in enumerate(summaries.items()):
        offset = (index - (len(summaries) - 1) / 2) * width
        x = [k + offset for k in range(len(kinds))]
        style = {"color": SERIES[index % len(SERIES)], "marker": _MARKERS[index % len(_MARKERS)]}
        for axis, point in zip(axes, panels.values(), strict=True):
            values, below, above = zip(*(point(summary["by_partner"][kind]) for kind in kinds), strict=True)
            axis.errorbar(x, values, yerr=(below, above), linestyle="", capsize=2, label=name, **style)
    for axis, label in zip(axes, panels, strict=True):
        axis.set_xticks(range(len(kinds)), kinds)
        axis.set_ylabel(label)
        axis.margins(x=0.1)
        axis.grid(axis="y", alpha=0.3)
        axis.set_ylim(bottom=0)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(summaries), frameon=False)
    figure.suptitle(title)
    with replacement(path) as partial:
        figure.savefig(partial, format="png")


def _success(summary: Mapping[str, Any]) -> _Point:
    (low, high), mean = summary["success"]["wilson_95"], summary["success"]["mean"]
    return 100 * mean, 100 * max(0.0, mean - low), 100 * max(0.0, high - mean)


def _seconds(summary: Mapping[str, Any]) -> _Point:
    time = summary["time_to_completion_s"]
    error = time["standard_error"] or 0.0
    return float("nan") if time["mean"] is None else time["mean"], error, error


def _force(summary: Mapping[str, Any]) -> _Point:
    force = summary["interaction_force"]
    return force["mean"], 0.0, max(0.0, force["p95"] - force["mean"])


def _deadlock(summary: Mapping[str, Any]) -> _Point:
    return 100 * summary["deadlock"]["time_share"], 0.0, 0.0


_PANELS: dict[str, tuple[str, Callable[[Mapping[str, Any]], _Point]]] = {
    "success, % (Wilson 95 %)": ("success", _success),
    "time of successes, s (± s.e.)": ("time_to_completion_s", _seconds),
    "interaction force (dot mean, bar to p95)": ("interaction_force", _force),
    "time in deadlock, %": ("deadlock", _deadlock),
}
