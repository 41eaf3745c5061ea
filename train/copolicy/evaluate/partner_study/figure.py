"""The picture of a study with partners: one panel a measure, the kinds of partner side by side, robots by colour."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from copolicy.dataset.files.staging import replacement

# Okabe and Ito's palette: told apart with every kind of colour vision. Markers differ as well.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_MARKERS = "osD^vPX"


def save_partner_figure(summaries: Mapping[str, Mapping[str, Any]], path: Path, title: str) -> None:
    """Draws robots' summaries by name into a PNG."""
    figure = Figure(figsize=(13, 3.6), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, 4)
    kinds = list(next(iter(summaries.values()))["by_partner"])
    width = 0.7 / max(1, len(summaries))
    for place, (name, summary) in enumerate(summaries.items()):
        offset = (place - (len(summaries) - 1) / 2) * width
        points = [_points(summary["by_partner"][kind]) for kind in kinds]
        for panel, axis in enumerate(axes):
            values, below, above = zip(*(point[panel] for point in points), strict=True)
            where = [k + offset for k in range(len(kinds))]
            style = {"color": _COLOURS[place % len(_COLOURS)], "marker": _MARKERS[place % len(_MARKERS)]}
            axis.errorbar(where, values, yerr=(below, above), linestyle="", capsize=2, label=name, **style)
    labels = ("success, % (Wilson 95 %)", "time of successes, s (± s.e.)", "interaction force (dot mean, bar to p95)",
              "time in deadlock, %")  # fmt: skip
    for axis, label in zip(axes, labels, strict=True):
        axis.set_xticks(range(len(kinds)), kinds)
        axis.set_ylabel(label)
        axis.margins(x=0.1)
        axis.grid(axis="y", alpha=0.3)
        axis.set_ylim(bottom=0)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(summaries), frameon=False)
    figure.suptitle(title)
    with replacement(path) as partial:
        figure.savefig(partial, format="png")


def _points(summary: Mapping[str, Any]) -> list[tuple[float, float, float]]:
    """Value, length of the bar below and above, of each panel."""
    success, force = summary["success"], summary["interaction_force"]
    low, high = success["wilson_95"]
    mean = success["mean"]
    time = summary["time_to_completion_s"]
    seconds = float("nan") if time["mean"] is None else time["mean"]
    error = time["standard_error"] or 0.0
    return [
        (100 * mean, 100 * max(0.0, mean - low), 100 * max(0.0, high - mean)),
        (seconds, error, error),
        (force["mean"], 0.0, max(0.0, force["p95"] - force["mean"])),
        (100 * summary["deadlock"]["time_share"], 0.0, 0.0),
    ]
