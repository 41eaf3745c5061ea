"""The statistics of some episodes together, by LeRobot's formulas, from those of each in meta/episodes."""

from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...exceptions import FileFormatError
from ...files.meta_files import EPISODES_FOLDER, STATS_FILE
from ...files.staging import write_lerobot_json

if TYPE_CHECKING:
    import pyarrow as pa

_PREFIX = "stats/"

Statistics = dict[str, dict[str, np.ndarray]]
"""By feature and kind: `min`, `max`, `mean`, `std`, `count`, and quantiles such as `q01`."""


def aggregated_statistics(episodes: "pa.Table") -> Statistics:
    """What LeRobot's `aggregate_stats` gives for the rows of meta/episodes.

    Least and largest value; mean and quantiles weighted by the number of values; the deviation of all values. An
    episode without statistics of a feature is passed over for that feature.

    Raises:
        FileFormatError: statistics of a feature that differ in shape.
    """
    columns: dict[str, dict[str, list[Any]]] = defaultdict(dict)
    for name in episodes.column_names:
        if name.startswith(_PREFIX):
            feature, _, kind = name.removeprefix(_PREFIX).rpartition("/")
            columns[feature][kind] = episodes.column(name).to_pylist()
    result: Statistics = {}
    for feature, kinds in columns.items():
        present = [row for row in range(episodes.num_rows) if all(values[row] is not None for values in kinds.values())]
        if present and {"min", "max", "mean", "std", "count"} <= kinds.keys():
            try:
                stacked = {kind: np.array([values[row] for row in present]) for kind, values in kinds.items()}
                result[feature] = _aggregated(stacked)
            except (TypeError, ValueError):
                raise FileFormatError(EPISODES_FOLDER, f"statistics of {feature} of one shape", "others") from None
    return result


def write_statistics(statistics: Statistics, folder: Path) -> None:
    """Writes `meta/stats.json` of a folder in the making."""
    nested = {
        feature: {kind: values.tolist() for kind, values in kinds.items()} for feature, kinds in statistics.items()
    }
    write_lerobot_json(folder / STATS_FILE, nested)


def _aggregated(stacked: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Statistics of one feature, `(E, ...)` each, over the first axis."""
    means, counts = stacked["mean"], stacked["count"]
    total = counts.sum(axis=0)
    while counts.ndim < means.ndim:
        counts = np.expand_dims(counts, axis=-1)
    mean = (means * counts).sum(axis=0) / total
    variance = ((stacked["std"] ** 2 + (means - mean) ** 2) * counts).sum(axis=0) / total
    quantiles = [kind for kind in stacked if kind.startswith("q") and kind[1:].isdigit()]
    return {
        "min": stacked["min"].min(axis=0),
        "max": stacked["max"].max(axis=0),
        "mean": mean,
        "std": np.sqrt(variance),
        "count": total,
        **{kind: (stacked[kind] * counts).sum(axis=0) / total for kind in quantiles},
    }
