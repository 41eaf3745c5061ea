"""Whether the recorded actions, played again, give the recorded path: the column that the converter measured."""

from collections.abc import Iterator

import numpy as np

from .episode_table import EpisodeTable
from .finding import Finding
from .limits import limit
from .rule import Rule, each


def _drift(table: EpisodeTable) -> Iterator[Finding]:
    drift = table.columns["replay_drift_px"]
    warning, error = limit("drift.warning"), limit("drift.error")
    message = "the actions, played again, leave the recorded path by this many px"
    yield from each(table, drift > error, "drift", drift, error, "error", message)
    yield from each(table, (drift > warning) & ~(drift > error), "drift", drift, warning, "warning", message)
    unknown = int(np.isnan(drift).sum())
    if unknown:
        message = "episodes were not re-simulated (stored below 30 Hz, or converted with --no-drift)"
        yield Finding("", "drift", unknown, 0, "info", message)


RULES = (Rule("drift", "re-simulation follows the recorded path", _drift, (), ("replay_drift_px",), ("lerobot",)),)
