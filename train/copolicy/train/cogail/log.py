"""The log of a training, one JSON object an update, and the figure of its curves."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from copolicy.dataset.files.staging import replacement

LOG_FILE, CURVES_FILE = "training_log.jsonl", "training_curves.png"

_PANELS = (
    ("reward a frame", ("reward",)),
    ("discriminator: recognised", ("expert_accuracy", "policy_accuracy")),
    ("discriminator: loss", ("discriminator_loss", "gradient_penalty")),
    ("codes: losses", ("code_loss", "inverse_loss")),
    ("policy: KL divergence, clipped", ("kl", "clipped")),
    ("policy: entropy, nats", ("entropy",)),
    ("value loss", ("value_loss",)),
)
_POINTS = 300  # of a curve; longer logs are averaged


class TrainingLog:
    """Appends rows to `training_log.jsonl` in the folder of a run and draws `training_curves.png` beside it."""

    def __init__(self, folder: Path, step: int):
        """
        Args:
            step: of the checkpoint that is resumed, or zero; rows of later steps are removed.
        """
        self._path, self._figure = folder / LOG_FILE, folder / CURVES_FILE
        self.rows: list[dict[str, Any]] = []
        if self._path.is_file():
            self.rows = [row for row in map(_row, self._path.read_text(encoding="utf-8").splitlines()) if row]
            self.rows = [row for row in self.rows if row["step"] <= step]
        folder.mkdir(parents=True, exist_ok=True)
        with replacement(self._path) as partial:
            partial.write_text("".join(f"{json.dumps(row)}\n" for row in self.rows), encoding="utf-8")

    def add(self, row: Mapping[str, Any]) -> None:
        """Appends the row of an update."""
        self.rows.append(dict(row))
        with self._path.open("a", encoding="utf-8") as file:
            file.write(f"{json.dumps(row)}\n")

    def draw(self, title: str) -> None:
        """Draws the curves."""
        if not self.rows:
            return
        figure = Figure(figsize=(14, 6.5), dpi=100, layout="constrained")
        axes = figure.subplots(2, 4).flatten()
        steps = _averaged([row["step"] / 1e6 for row in self.rows])
        for panel, (heading, names) in zip(axes, _PANELS, strict=False):
            for name in names:
                panel.plot(steps, _averaged([row[name] for row in self.rows]), label=name.replace("_", " "))
            panel.set_title(heading, fontsize=10)
            if len(names) > 1:
                panel.legend(fontsize=8, frameon=False)
        _draw_ends(axes[len(_PANELS)], self.rows, steps)
        for panel in axes:
            panel.set_xlabel("frames in the world, millions", fontsize=8)
            panel.tick_params(labelsize=8)
        figure.suptitle(title, fontsize=11)
        with replacement(self._figure) as partial:
            figure.savefig(partial, format="png")


def _draw_ends(axes: Any, rows: Sequence[Mapping[str, Any]], steps: Sequence[float]) -> None:
    reasons = sorted({reason for row in rows for reason in row["episodes"]})
    for reason in reasons:
        counts = [
            100 * row["episodes"].get(reason, 0) / total if (total := sum(row["episodes"].values())) else float("nan")
            for row in rows
        ]
        axes.plot(steps, _averaged(counts), label=reason.replace("_", " "))
    axes.set_title("ends of training episodes, %", fontsize=10)
    if reasons:
        axes.legend(fontsize=8, frameon=False)


def _averaged(values: Sequence[float]) -> list[float]:
    """Means of consecutive groups, at most `_POINTS`; NaN is left out of a group."""
    size = -(-len(values) // _POINTS)
    groups = [values[start : start + size] for start in range(0, len(values), size)]
    finite = [[value for value in group if value == value] for group in groups]
    return [sum(group) / len(group) if group else float("nan") for group in finite]


def _row(line: str) -> dict[str, Any] | None:
    """A row of the log; None for the line that a crash left unfinished."""
    try:
        row = json.loads(line)
    except ValueError:
        return None
    return row if isinstance(row, dict) and "step" in row else None
