"""Aggregates the statistics of episodes in meta/episodes by LeRobot's formulas."""

from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...arrays import Array
from ...exceptions import FileFormatError
from ...files.meta_files import EPISODES_FOLDER, STATS_FILE
from ...files.staging import write_lerobot_json

if TYPE_CHECKING:
    import pyarrow as pa

_COLUMN_PREFIX = "stats/"

Statistics = dict[str, dict[str, Array]]
"""Arrays by feature and name of the statistic: `min`, `max`, `mean`, `std`, `count`, quantiles such as `q01`."""


def aggregate_statistics(episodes: "pa.Table") -> Statistics:
    """Aggregates rows of meta/episodes like LeRobot's `aggregate_stats`.

    Minimum and maximum; mean and quantiles weighted by the number of values; standard deviation of all values.
    Episodes without statistics of a feature are ignored for that feature.

    Raises:
        FileFormatError: statistics of a feature that differ in shape.
    """
    columns: dict[str, dict[str, list[Any]]] = defaultdict(dict)
    for name in episodes.column_names:
        if name.startswith(_COLUMN_PREFIX):
            feature, _, statistic = name.removeprefix(_COLUMN_PREFIX).rpartition("/")
            columns[feature][statistic] = episodes.column(name).to_pylist()
    result: Statistics = {}
    for feature, lists in columns.items():
        rows = [row for row in range(episodes.num_rows) if all(values[row] is not None for values in lists.values())]
        if rows and {"min", "max", "mean", "std", "count"} <= lists.keys():
            try:
                stacked = {name: np.array([values[row] for row in rows]) for name, values in lists.items()}
                result[feature] = _aggregate_feature(stacked)
            except (TypeError, ValueError):
                raise FileFormatError(EPISODES_FOLDER, f"statistics of {feature} of one shape", "others") from None
    return result


def write_statistics(statistics: Statistics, folder: Path) -> None:
    """Writes `meta/stats.json` of a new data set."""
    nested = {
        feature: {name: values.tolist() for name, values in arrays.items()} for feature, arrays in statistics.items()
    }
    write_lerobot_json(folder / STATS_FILE, nested)


def _aggregate_feature(stacked: dict[str, Array]) -> dict[str, Array]:
    """Aggregates the statistics of one feature, `(E, ...)` each, over the first axis."""
    means, counts = stacked["mean"], stacked["count"]
    total = counts.sum(axis=0)
    while counts.ndim < means.ndim:
        counts = np.expand_dims(counts, axis=-1)
    mean = (means * counts).sum(axis=0) / total
    variance = ((stacked["std"] ** 2 + (means - mean) ** 2) * counts).sum(axis=0) / total
    quantiles = [name for name in stacked if name.startswith("q") and name[1:].isdigit()]
    return {
        "min": stacked["min"].min(axis=0),
        "max": stacked["max"].max(axis=0),
        "mean": mean,
        "std": np.sqrt(variance),
        "count": total,
        **{name: (stacked[name] * counts).sum(axis=0) / total for name in quantiles},
    }
