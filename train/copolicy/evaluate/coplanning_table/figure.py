"""Figure of the table: success by method with standard errors, one panel per map set, the published values as marks."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from copolicy.dataset.files.staging import replacement
from copolicy.dataset.outline_figure import BLACK, BLUE, VERMILION

_BAR = "#9CC3DE"


def save_table_figure(table: Mapping[str, Any], path: Path) -> None:
    """Draws the mean over seeds with its standard error, each seed, and the published mean and best into a PNG."""
    rows, maps = table["methods"], table["maps"]
    figure = Figure(figsize=(2.2 + 3.4 * len(maps), 1.7 + 0.42 * len(rows)), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(1, len(maps), squeeze=False, sharey=True).flat)
    positions = range(len(rows))
    published = False
    for axis, name in zip(axes, maps, strict=True):
        for position, row in zip(positions, rows, strict=True):
            cell = row["maps"][name]
            axis.barh(position, 100 * cell["mean"], height=0.62, color=_BAR)
            seeds = [100 * rate for rate in cell["per_seed"]]
            axis.plot(seeds, [position + 0.16] * len(seeds), "o", color=BLUE, markersize=3.5, clip_on=False)
            axis.errorbar(
                100 * cell["mean"], position, xerr=100 * cell["standard_error"], color=BLACK, capsize=3, linewidth=1.2
            )
            for key, fill in (("published_best", "none"), ("published_mean", VERMILION)):
                if key in cell:
                    published = True
                    successes, episodes = cell[key]
                    axis.plot(
                        100 * successes / episodes, position - 0.2, "D", markersize=5, markeredgecolor=VERMILION,
                        markerfacecolor=fill, clip_on=False,
                    )  # fmt: skip
        axis.set(xlim=(0, 100), xlabel=f"success on {name}, %", yticks=list(positions))
        axis.set_yticklabels([row["method"] for row in rows])
        axis.grid(axis="x", alpha=0.3)
        axis.set_axisbelow(True)
    axes[0].invert_yaxis()
    handles: list[Any] = [
        Patch(color=_BAR, label="mean over seeds"),
        Line2D([], [], color=BLACK, marker="|", label="± standard error (one seed: binomial)"),
        Line2D([], [], color=BLUE, marker="o", linestyle="", markersize=4, label="a seed"),
    ]
    if published:
        mark = {"marker": "D", "linestyle": "", "markeredgecolor": VERMILION, "markersize": 5}
        handles += [
            Line2D([], [], markerfacecolor=VERMILION, label="published mean", **mark),
            Line2D([], [], markerfacecolor="none", label="published best", **mark),
        ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    figure.suptitle("Co-planning with simulated pairs")
    with replacement(path) as partial:
        figure.savefig(partial, format="png")
