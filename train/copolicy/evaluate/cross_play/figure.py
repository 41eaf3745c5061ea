"""Heat maps of a cross-play: one panel per measure, robots down, partners across, with the numbers in the cells."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from copolicy.dataset.arrays import Array
from copolicy.dataset.files.staging import replacement

from .measures import MEASURES, label
from .report import SCORE_LABEL

_COLUMNS = 2
_NAME = 22  # characters of a name that fit


def save_heat_maps(result: Mapping[str, Any], path: Path, title: str) -> None:
    """Draws the score and each measured measure into a PNG. Blue is better; grey measures have no better end."""
    robots, partners = list(result["cells"]), list(result["partners"])
    panels: list[tuple[str, Array, Array, int, bool | None]] = []
    if result["scores"]:
        values = [[_score(result, robot, partner) for partner in partners] for robot in robots]
        panels.append((SCORE_LABEL, *_arrays(values, 100), 0, False))
    for name, measure in MEASURES.items():
        if name not in result["not_measured"]:
            values = [[_measure(result, robot, partner, name) for partner in partners] for robot in robots]
            title_of = label(name, result["settings"]["length_unit"])
            panels.append((title_of, *_arrays(values, measure.scale), measure.digits, measure.lower_is_better))
    rows = -(-len(panels) // _COLUMNS)
    width = 2.2 + 0.85 * len(partners)
    height = 1.5 + 0.36 * len(robots)
    figure = Figure(figsize=(_COLUMNS * width, rows * height + 0.5), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(rows, _COLUMNS, squeeze=False).flat)
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    for axis, (heading, means, errors, digits, lower) in zip(axes, panels, strict=False):
        _heat_map(axis, means, errors, digits, lower)
        axis.set_title(heading, fontsize=9)
        axis.set_xticks(range(len(partners)), [_short(name) for name in partners], rotation=30, ha="right", fontsize=7)
        axis.set_yticks(range(len(robots)), [_short(name) for name in robots], fontsize=7)
    figure.suptitle(title, fontsize=10)
    with replacement(path) as partial:
        figure.savefig(partial, format="png")


def _heat_map(axis: Any, means: Array, errors: Array, digits: int, lower_is_better: bool | None) -> None:
    colours = "Greys" if lower_is_better is None else "RdYlBu_r" if lower_is_better else "RdYlBu"
    finite = means[np.isfinite(means)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    span = max(high - low, 1e-9)
    axis.imshow(means, cmap=colours, vmin=low - 0.15 * span, vmax=high + 0.15 * span, aspect="auto")
    for (row, column), mean in np.ndenumerate(means):
        error = errors[row, column]
        text = "-" if not np.isfinite(mean) else f"{mean:.{digits}f}"
        text += f"\n±{error:.{digits}f}" if np.isfinite(error) else ""
        dark = lower_is_better is None and np.isfinite(mean) and mean > low + 0.55 * span
        axis.text(column, row, text, ha="center", va="center", fontsize=6.5, color="white" if dark else "black")


def _arrays(values: list[list[Mapping[str, Any] | None]], scale: float) -> tuple[Array, Array]:
    """Means and standard errors `(robots, partners)`; NaN where there is none."""
    means, errors = (
        np.array(
            [[np.nan if cell is None or cell[key] is None else scale * cell[key] for cell in row] for row in values]
        )
        for key in ("mean", "standard_error")
    )
    return means, errors


def _score(result: Mapping[str, Any], robot: str, partner: str) -> Mapping[str, Any] | None:
    return result["scores"]["robots"].get(robot, {}).get("by_partner", {}).get(partner)


def _measure(result: Mapping[str, Any], robot: str, partner: str, name: str) -> Mapping[str, Any] | None:
    cell = result["cells"][robot].get(partner)
    return None if cell is None else cell["measures"][name]


def _short(name: str) -> str:
    return name if len(name) <= _NAME else f"{name[: _NAME - 1]}…"
