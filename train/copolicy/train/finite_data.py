"""Checks that the frames and statistics of a data set have only finite numbers.

One NaN makes a loss NaN, the next step makes every weight NaN, and LeRobot's trainer continues to the last step.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import FileFormatError, RunError
from copolicy.dataset.lerobot_folder.folder import data_files
from copolicy.dataset.lerobot_folder.info import episode_files
from copolicy.dataset.lerobot_folder.tables import DAMAGED, damaged, read_parquet

_EPISODE, _FRAME = "episode_index", "frame_index"
_TRAINED_COLUMNS = ("observation.", "action", "next.reward", "timestamp")
_NON_NUMERIC = ("image", "video", "string", "language")


class NonFiniteError(RunError):
    """A value that training needs is NaN, infinite or missing."""


class NonFiniteLossError(NonFiniteError):
    """The loss is NaN or infinite."""

    def __init__(self, value: float, step: int):
        super().__init__(f"training stopped at step {step}: expected a finite loss, found {value}")
        self.value = value


@dataclass
class _NonFinite:
    """The first value that cannot be trained on, and all frames with such values."""

    column: str = ""
    episode: int = -1
    frame: int = -1
    value: str = ""
    frames: set[tuple[int, int]] = field(default_factory=set)

    def __str__(self) -> str:
        further, episodes = len(self.frames) - 1, {episode for episode, _ in self.frames}
        more = f" (and such values in {further} more frames, of episodes {_listed(episodes)})" if further else ""
        return f"{self.value} in {self.column} of episode {self.episode}, frame {self.frame}{more}"


def require_finite_frames(root: Path, episodes: Collection[int] | None, features: Mapping[str, Any]) -> None:
    """Checks every frame of the given episodes of a local data set.

    Args:
        root: folder of the data set; without files of frames (a streamed data set) nothing is checked.
        episodes: episodes to train on; None for all.
        features: features of `meta/info.json`.

    Raises:
        FileFormatError: a file of frames cannot be read.
        NonFiniteError: a column that training reads has an empty, infinite or NaN value; names column, episode, frame.
    """
    columns = [name for name, feature in features.items() if feature["dtype"] not in _NON_NUMERIC]
    chosen = None if episodes is None else np.array(sorted(episodes), np.int64)
    non_finite, start = _NonFinite(), 0
    for table in _row_groups(root, columns):
        _collect(table, chosen, start, non_finite)
        start += len(table)
    if non_finite.frames:
        raise NonFiniteError(
            f"{root}: expected finite numbers in all frames to train on, found {non_finite}; leave such an episode out "
            "with copolicy-dataset exclude or --dataset.episodes, or correct it"
        )


def _non_finite_statistic(stats: Mapping[str, Mapping[str, Any]] | None) -> str | None:
    """Describes the first statistic that is no number, or not finite in a column that training reads; else None."""
    for column, statistics in (stats or {}).items():
        for statistic, value in statistics.items():
            try:
                numbers = np.asarray(value, np.float64)
                empty = np.asarray(value).dtype == object
            except (TypeError, ValueError):
                return f"{statistic} of {column}: {value}"
            if empty or (column.startswith(_TRAINED_COLUMNS) and not np.isfinite(numbers).all()):
                return f"{statistic} of {column}: {_described(numbers)}"
    return None


def replacement_statistics(
    root: Path, stats: Mapping[str, Any] | None, episodes: Collection[int], total: int
) -> dict[str, Any]:
    """Statistics of the selected episodes if those of the whole data set are not finite; else an empty dict.

    Args:
        root: folder of the data set.
        stats: statistics of the data set, by column.
        episodes: episodes to train on.
        total: number of episodes of the data set.

    Raises:
        NonFiniteError: statistics are empty or not finite, also without the excluded episodes.
    """
    non_finite = _non_finite_statistic(stats)
    if non_finite is None:
        return {}
    if len(set(episodes)) < total:
        from lerobot.datasets.compute_stats import aggregate_stats

        parts = _episode_statistics(root, set(episodes))
        if parts and all(parts) and not any(_non_finite_statistic(part) for part in parts):
            return aggregate_stats(parts)
    raise NonFiniteError(
        f"{root / 'meta' / 'stats.json'}: expected finite numbers, found {non_finite}; recompute it with "
        "lerobot-edit-dataset --operation.type recompute_stats"
    )


def _episode_statistics(root: Path, episodes: Collection[int]) -> list[dict[str, dict[str, Array]]]:
    """The statistics of each given episode, for the columns that training reads.

    They are read from `meta/episodes`, since LeRobot's reader skips them.

    Raises:
        FileFormatError: a file cannot be read.
    """
    statistics = []
    for path in episode_files(root):
        for row in read_parquet(path).to_pylist():
            if row[_EPISODE] in episodes:
                entry: dict[str, dict[str, Array]] = {}
                for name in (name for name in row if name.startswith("stats/")):
                    _, column, statistic = name.split("/", 2)
                    if not column.startswith(_TRAINED_COLUMNS):
                        continue
                    entry.setdefault(column, {})[statistic] = np.asarray(row[name])
                statistics.append(entry)
    return statistics


def non_finite_rows(column: pa.Array) -> Array:
    """`(N,)` whether a row of a column, lists included, has an empty value or one that is not finite as float32."""
    array = column.storage if isinstance(column, pa.ExtensionArray) else column
    invalid = np.zeros(len(array), bool)
    rows = np.arange(len(array))
    while True:
        invalid[rows[array.is_null().to_numpy(zero_copy_only=False)]] = True
        is_list = pa.types.is_list, pa.types.is_large_list, pa.types.is_fixed_size_list
        if not any(check(array.type) for check in is_list):
            break
        rows = rows[pc.call_function("list_parent_indices", [array]).to_numpy(zero_copy_only=False)]
        array = pc.call_function("list_flatten", [array])
    if pa.types.is_floating(array.type):
        # A number beyond float32 becomes infinite when LeRobot makes a tensor of it.
        with np.errstate(over="ignore"):
            values = array.to_numpy(zero_copy_only=False).astype(np.float32)
        invalid[rows[~np.isfinite(values)]] = True
    return invalid


def _row_groups(root: Path, columns: list[str]) -> Iterator[pa.Table]:
    for path in data_files(root):
        try:
            with pq.ParquetFile(path) as file:
                available = set(file.schema_arrow.names)
                if _EPISODE not in available:
                    raise FileFormatError(path, f"the column {_EPISODE}", "none")
                names = [name for name in columns if name in available]
                for group in range(file.num_row_groups):
                    yield file.read_row_group(group, columns=list(dict.fromkeys([_EPISODE, *names])))
        except DAMAGED as error:
            raise damaged(path, error) from None


def _collect(table: pa.Table, chosen: Array | None, start: int, non_finite: _NonFinite) -> None:
    """Adds the values that cannot be trained on, of a row group whose first row is row `start` of the data set."""
    episode = pc.fill_null(table.column(_EPISODE), -1).to_numpy()
    trained = np.ones(len(table), bool) if chosen is None else np.isin(episode, chosen)
    for name in table.column_names:
        column = table.column(name).combine_chunks()
        invalid = non_finite_rows(column) & (trained | (episode < 0))
        if not name.startswith(_TRAINED_COLUMNS):  # NaN is allowed, an empty value is not: LeRobot's reader fails
            invalid &= column.is_null().to_numpy(zero_copy_only=False)
        rows = np.flatnonzero(invalid)
        if len(rows) and not non_finite.frames:
            frames = table.column(_FRAME) if _FRAME in table.column_names else None
            first = int(rows[0])
            frame = frames[first].as_py() if frames is not None else None
            frame = int(first - np.argmax(episode == episode[first])) if frame is None else frame
            non_finite.column, non_finite.episode, non_finite.frame = name, int(episode[first]), frame
            non_finite.value = _described(column[first].as_py())
        non_finite.frames.update((int(episode[row]), start + int(row)) for row in rows)


def _described(value: Any) -> str:
    """Describes what is wrong with a value or with a list of values."""
    flat = np.ravel(np.array(value, dtype=object))
    if any(entry is None for entry in flat):
        return "an empty value"
    non_finite = next((float(entry) for entry in flat if not np.isfinite(float(entry))), None)
    return f"{non_finite}" if non_finite is not None else "a number beyond float32"


def _listed(episodes: Collection[int]) -> str:
    numbers = sorted(episodes)
    return ", ".join(map(str, numbers[:8])) + (", ..." if len(numbers) > 8 else "")
