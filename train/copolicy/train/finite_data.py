"""Frames and statistics that a policy can be trained on: a number everywhere, and a finite one.

One NaN makes a loss NaN, the first step with it makes every weight NaN, and LeRobot's trainer goes on to the end.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from copolicy.dataset.exceptions import FileFormatError, RunError
from copolicy.dataset.lerobot_folder.folder import data_files
from copolicy.dataset.lerobot_folder.info import episode_files
from copolicy.dataset.lerobot_folder.tables import DAMAGED, damaged, read_parquet

_EPISODE, _FRAME = "episode_index", "frame_index"
_READ = ("observation.", "action", "next.reward", "timestamp")
_NO_NUMBERS = ("image", "video", "string", "language")


class NonFiniteError(RunError):
    """A number that is NaN or infinite, or is missing, where training cannot go on with it."""


class NonFiniteLossError(NonFiniteError):
    """A loss that is NaN or infinite."""

    def __init__(self, value: float, step: int):
        super().__init__(f"training stopped at step {step}: expected a finite loss, found {value}")
        self.value = value


@dataclass
class _Unusable:
    """The first value that cannot be trained on, and how much more there is of it."""

    column: str = ""
    episode: int = -1
    frame: int = -1
    value: str = ""
    frames: set[tuple[int, int]] = field(default_factory=set)

    def __str__(self) -> str:
        rest, episodes = len(self.frames) - 1, {episode for episode, _ in self.frames}
        more = f" (and such values in {rest} more frames, of episodes {_listed(episodes)})" if rest else ""
        return f"{self.value} in {self.column} of episode {self.episode}, frame {self.frame}{more}"


def require_finite_frames(root: Path, episodes: Collection[int] | None, features: Mapping[str, Any]) -> None:
    """Checks every frame of some episodes of a local data set.

    Args:
        root: of the data set; one whose frames are not here, because they are streamed, is passed over.
        episodes: that are trained on; None for all.
        features: of `meta/info.json`.

    Raises:
        FileFormatError: a file of frames cannot be read.
        NonFiniteError: a column that training reads has an empty, infinite or NaN value; names column, episode, frame.
    """
    columns = [name for name, feature in features.items() if feature["dtype"] not in _NO_NUMBERS]
    chosen = None if episodes is None else np.array(sorted(episodes), np.int64)
    found, start = _Unusable(), 0
    for table in _row_groups(root, columns):
        _collect(table, chosen, start, found)
        start += len(table)
    if found.frames:
        raise NonFiniteError(
            f"{root}: expected finite numbers in all frames to train on, found {found}; leave such an episode out with "
            "copolicy-dataset exclude or --dataset.episodes, or mend it"
        )


def _unusable_statistic(stats: Mapping[str, Mapping[str, Any]] | None) -> str | None:
    """The first statistic that is no number, or of a column that training reads infinite or NaN, in words; None."""
    for column, kinds in (stats or {}).items():
        for kind, value in kinds.items():
            try:
                numbers = np.asarray(value, np.float64)
                empty = np.asarray(value).dtype == object
            except (TypeError, ValueError):
                return f"{kind} of {column}: {value}"
            if empty or (column.startswith(_READ) and not np.isfinite(numbers).all()):
                return f"{kind} of {column}: {_shown(numbers)}"
    return None


def mended_statistics(
    root: Path, stats: Mapping[str, Any] | None, episodes: Collection[int], total: int
) -> dict[str, Any]:
    """Statistics to put in the place of those of a data set that an excluded episode spoils; none where they are sound.

    Args:
        root: of the data set.
        stats: of the data set, by column.
        episodes: that are trained on.
        total: episodes of the data set.

    Raises:
        NonFiniteError: statistics hold an empty value or no finite number, and no episode that is left out explains it.
    """
    unusable = _unusable_statistic(stats)
    if unusable is None:
        return {}
    if len(set(episodes)) < total:
        from lerobot.datasets.compute_stats import aggregate_stats

        parts = _episode_statistics(root, set(episodes))
        if parts and all(parts) and not any(_unusable_statistic(part) for part in parts):
            return aggregate_stats(parts)
    raise NonFiniteError(
        f"{root / 'meta' / 'stats.json'}: expected finite numbers, found {unusable}; make it anew with "
        "lerobot-edit-dataset --operation.type recompute_stats"
    )


def _episode_statistics(root: Path, episodes: Collection[int]) -> list[dict[str, dict[str, np.ndarray]]]:
    """The statistics of each of some episodes, of columns that training reads.

    They are in `meta/episodes`, where LeRobot's reader leaves them out.

    Raises:
        FileFormatError: a file cannot be read.
    """
    statistics = []
    for path in episode_files(root):
        for row in read_parquet(path).to_pylist():
            if row[_EPISODE] in episodes:
                entry: dict[str, dict[str, np.ndarray]] = {}
                for name in (name for name in row if name.startswith("stats/")):
                    _, column, kind = name.split("/", 2)
                    if not column.startswith(_READ):
                        continue
                    entry.setdefault(column, {})[kind] = np.asarray(row[name])
                statistics.append(entry)
    return statistics


def unusable_rows(column: pa.Array) -> np.ndarray:
    """`(N,)` which rows of a column, lists included, hold an empty value or no finite number as float32."""
    array = column.storage if isinstance(column, pa.ExtensionArray) else column
    marks = np.zeros(len(array), bool)
    rows = np.arange(len(array))
    while True:
        marks[rows[array.is_null().to_numpy(zero_copy_only=False)]] = True
        if not (pa.types.is_list(array.type) or pa.types.is_large_list(array.type) or _fixed(array.type)):
            break
        rows = rows[pc.call_function("list_parent_indices", [array]).to_numpy(zero_copy_only=False)]
        array = pc.call_function("list_flatten", [array])
    if pa.types.is_floating(array.type):
        # A number that float32 cannot hold becomes infinite when LeRobot makes a tensor of it.
        with np.errstate(over="ignore"):
            values = array.to_numpy(zero_copy_only=False).astype(np.float32)
        marks[rows[~np.isfinite(values)]] = True
    return marks


def _fixed(kind: pa.DataType) -> bool:
    return pa.types.is_fixed_size_list(kind)


def _row_groups(root: Path, columns: list[str]) -> Iterator[pa.Table]:
    for path in data_files(root):
        try:
            with pq.ParquetFile(path) as file:
                there = set(file.schema_arrow.names)
                if _EPISODE not in there:
                    raise FileFormatError(path, f"the column {_EPISODE}", "none")
                names = [name for name in columns if name in there]
                for group in range(file.num_row_groups):
                    yield file.read_row_group(group, columns=list(dict.fromkeys([_EPISODE, *names])))
        except DAMAGED as error:
            raise damaged(path, error) from None


def _collect(table: pa.Table, chosen: np.ndarray | None, start: int, found: _Unusable) -> None:
    """Adds the unusable values of a row group whose first row is row `start` of the data set."""
    episode = pc.fill_null(table.column(_EPISODE), -1).to_numpy()
    trained = np.ones(len(table), bool) if chosen is None else np.isin(episode, chosen)
    for name in table.column_names:
        column = table.column(name).combine_chunks()
        marks = unusable_rows(column) & (trained | (episode < 0))
        if not name.startswith(_READ):  # a foreign column may hold NaN; an empty value stops LeRobot's reader
            marks &= column.is_null().to_numpy(zero_copy_only=False)
        rows = np.flatnonzero(marks)
        if len(rows) and not found.frames:
            frames = table.column(_FRAME) if _FRAME in table.column_names else None
            first = int(rows[0])
            frame = frames[first].as_py() if frames is not None else None
            frame = int(first - np.argmax(episode == episode[first])) if frame is None else frame
            found.column, found.episode, found.frame = name, int(episode[first]), frame
            found.value = _shown(column[first].as_py())
        found.frames.update((int(episode[row]), start + int(row)) for row in rows)


def _shown(value: Any) -> str:
    """The kind of what is wrong with a value or a list of them."""
    flat = np.ravel(np.array(value, dtype=object))
    if any(entry is None for entry in flat):
        return "an empty value"
    odd = next((float(entry) for entry in flat if not np.isfinite(float(entry))), None)
    return f"{odd}" if odd is not None else "a number beyond float32"


def _listed(episodes: Collection[int]) -> str:
    numbers = sorted(episodes)
    return ", ".join(map(str, numbers[:8])) + (", ..." if len(numbers) > 8 else "")
