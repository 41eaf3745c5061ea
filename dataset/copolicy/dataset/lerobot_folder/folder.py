"""A LeRobot v3 data set folder with checked metadata, used by every reader."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..episode import EPISODE_COLUMNS, LATER_COLUMNS, UNKNOWN_VALUES
from ..exceptions import FileFormatError
from ..features import ACTION, STATE, VECTORS, features_of
from ..files.listing import visible_files
from ..files.meta_files import EPISODES_FOLDER, INFO_FILE
from ..task import PairTask
from .info import episode_files, read_info, require_episodes, split_range, stripped_hint, task_of
from .tables import column_types, damaged, episode_values, feature_values, pa, read_parquet

POSITIONS = ("episode_index", "length", "dataset_from_index", "dataset_to_index")
"""The columns of meta/episodes that locate the frames of an episode."""


@dataclass(frozen=True)
class LeRobotFolder:
    """The metadata of a data set, with checked types and consistent episode numbers and lengths.

    Attributes:
        info: `meta/info.json` with checked types.
        episodes: the rows of meta/episodes in the order of `episode_index`, without statistics.
    """

    root: Path
    info: dict[str, Any]
    episodes: pa.Table

    @classmethod
    def open(cls, root: Path) -> "LeRobotFolder":
        """Reads the metadata.

        Raises:
            FileFormatError: no LeRobot v3 data set, a missing or damaged table of episodes, or an invalid
                `episode_index` or `length`.
        """
        info = read_info(root)
        require_episodes(root, info)
        table = read_episodes(root)
        path = root / EPISODES_FOLDER
        for name in POSITIONS:
            if name in table.column_names:
                values = episode_values(table, name, "int", path)
                position = table.column_names.index(name)
                table = table.set_column(position, name, pa.array(values))
            elif name in POSITIONS[:2]:
                raise FileFormatError(path, f"a column {name}", "none")
        table = table.sort_by("episode_index")
        numbers, lengths = (table.column(name).to_numpy() for name in POSITIONS[:2])
        if not np.array_equal(numbers, np.arange(len(numbers))):
            raise FileFormatError(path, f"episodes 0 to {len(numbers) - 1}, each once", _numbering_error(numbers))
        if (lengths < 1).any():
            raise FileFormatError(path, "at least one frame per episode", f"none in episode {int(np.argmin(lengths))}")
        if lengths.sum(dtype=float) > 2**40:
            raise FileFormatError(path, "plausible episode lengths", f"{lengths.max()} frames in an episode")
        return cls(root, info, table)

    @property
    def task(self) -> PairTask:
        """The task of the data set, see `task_of`."""
        return task_of(self.info)

    @property
    def splits(self) -> dict[str, range]:
        """Episodes of each split of `meta/info.json`.

        Raises:
            FileFormatError: a split of another form.
        """
        splits: dict[str, range] = {}
        for name, text in (self.info.get("splits") or {}).items():
            if (episodes := split_range(text)) is None:
                raise FileFormatError(self.root / INFO_FILE, "splits as FIRST:END", repr(text))
            splits[name] = episodes
        return splits

    @property
    def lengths(self) -> list[int]:
        """Frames of each episode."""
        return self.episodes.column("length").to_pylist()

    @property
    def data_files(self) -> list[Path]:
        """The files of frames, in the order of their paths.

        Raises:
            FileFormatError: there are none.
        """
        files = data_files(self.root)
        if not files:
            raise FileFormatError(self.root, "Parquet files under data", "none")
        return files

    def rows(self, columns: Sequence[str] = tuple(EPISODE_COLUMNS)) -> list[dict[str, Any]]:
        """`episode_index`, `length` and some episode columns of each episode; nulls become `UNKNOWN_VALUES`.

        Raises:
            FileFormatError: a column is missing or has another type.
        """
        path = self.root / EPISODES_FOLDER
        missing = [name for name in columns if name not in self.episodes.column_names and name not in LATER_COLUMNS]
        if missing:
            hint = stripped_hint(self.info, self.root) if "episode_uuid" in missing else ""
            raise FileFormatError(path, "the episode columns of copolicy", f"none named {', '.join(missing)}{hint}")
        values: dict[str, list[Any]] = {name: self.episodes.column(name).to_pylist() for name in POSITIONS[:2]}
        for name in columns:
            if name in self.episodes.column_names:
                column_type, unknown = EPISODE_COLUMNS[name], UNKNOWN_VALUES[name]
                values[name] = episode_values(self.episodes, name, column_type, path, unknown).tolist()
            else:
                values[name] = [UNKNOWN_VALUES[name]] * self.episodes.num_rows
        return [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]

    def frames(self, shapes: Mapping[str, Sequence[int]]) -> Iterator[tuple[int, dict[str, Array]]]:
        """Yields number and columns of each episode in order, `(T, n)` or `(T,)` each; reads one file at a time.

        Rows are sorted by their `index`, whatever their order in the files.

        Args:
            shapes: shape of each column.

        Raises:
            FileFormatError: a data file is missing, damaged, lacks a column, has a number that is not finite, or
                disagrees with meta/episodes.
        """
        expected_entries = iter(enumerate(self.lengths))
        for number, group in groupby(self._episode_runs(shapes), key=lambda run: run[0]):
            (_, path, columns), *rest = group
            for _, _, next_columns in rest:  # the episode continues in the next file
                columns = {name: np.concatenate((values, next_columns[name])) for name, values in columns.items()}
            due, found = next(expected_entries, None), (number, len(columns["index"]))
            if found != due:
                expected = f"episode {due[0]} with {due[1]} frames" if due else "no further episode"
                raise FileFormatError(path, f"{expected} as in meta/episodes", f"episode {found[0]} with {found[1]}")
            yield number, {name: columns[name] for name in shapes}
        if missing := next(expected_entries, None):
            raise FileFormatError(self.root / "data", f"the frames of episode {missing[0]}", "none")

    def _episode_runs(self, shapes: Mapping[str, Sequence[int]]) -> Iterator[tuple[int, Path, dict[str, Array]]]:
        """Yields number, file and columns of consecutive rows of one episode, sorted by `index`."""
        shapes = {"index": (1,), **shapes}
        for path in sorted(data_files(self.root), key=_first_index):
            table = read_parquet(path, ["episode_index", *shapes])
            index, order = np.unique(feature_values(table, "index", (1,), path), return_index=True)
            if len(index) == table.num_rows and (np.diff(order) < 0).any():
                table = table.take(pa.array(order))
            numbers = feature_values(table, "episode_index", (1,), path)
            columns = {name: feature_values(table, name, shape, path) for name, shape in shapes.items()}
            columns |= {name: columns[name].reshape(len(numbers), -1) for name in VECTORS if name in columns}
            for name, values in columns.items():
                if not np.isfinite(values).all():
                    raise FileFormatError(path, f"finite {name}", "nan or inf")
            starts = np.flatnonzero(np.diff(numbers, prepend=-1)).tolist()
            for start, end in zip(starts, [*starts[1:], len(numbers)], strict=True):
                yield int(numbers[start]), path, {name: values[start:end] for name, values in columns.items()}

    def require_task(self, features: Sequence[str] = (STATE, ACTION)) -> None:
        """Checks that the features of the data set match its task.

        Raises:
            FileFormatError: a feature is missing or has another shape, as in a data set of another task.
            UnknownNameError: the task is not installed.
        """
        difference = task_mismatch(self.info, features)
        if difference:
            expected = f"a data set of {self.task.spec.title} (copolicy-convert)"
            raise FileFormatError(self.root / INFO_FILE, expected, difference)


def _first_index(path: Path) -> int:
    """The smallest `index` of a file of frames."""
    return int(feature_values(read_parquet(path, ["index"]), "index", (1,), path).min(initial=2**62))


def data_files(root: Path) -> list[Path]:
    """The Parquet files of frames, in the order of their paths."""
    return visible_files(root / "data", "*.parquet")


def read_episodes(root: Path) -> pa.Table:
    """Reads all rows of meta/episodes, without the statistics of episodes.

    Raises:
        FileFormatError: no file, an incomplete Parquet file, or files with different columns.
    """
    folder = root / EPISODES_FOLDER
    files = episode_files(root)
    if not files:
        raise FileFormatError(root, "a LeRobot data set with episodes under meta/episodes", "none")
    tables = []
    for path in files:
        names = [name for name in column_types(path) if not name.startswith("stats/")]
        tables.append(read_parquet(path, names))
    try:
        table = pa.concat_tables(tables, promote_options="permissive").combine_chunks()
    except pa.ArrowException as error:
        raise damaged(folder, error) from None
    if not table.num_rows:
        raise FileFormatError(folder, "episodes", "none")
    return table


def task_mismatch(info: dict[str, Any], features: Sequence[str] = (STATE, ACTION)) -> str:
    """Describes how features differ from those of the task that the robot type names; empty if they do not."""
    expected = features_of(task_of(info).spec)
    for name in features:
        feature = info["features"].get(name)
        if feature is None:
            present = ", ".join(name for name in info["features"] if name not in ("timestamp", "frame_index"))
            return f"one of another task: no feature {name} ({present[:120]})"
        shape = tuple(expected[name]["shape"])
        if tuple(feature["shape"]) != shape:
            return f"one of another task: {name} of shape {tuple(feature['shape'])} instead of {shape}"
    return ""


def _numbering_error(numbers: Array) -> str:
    repeated = numbers[1:][np.diff(numbers) == 0]
    if len(repeated):
        return f"episode {repeated[0]} twice"
    return f"{', '.join(map(str, numbers[:3].tolist()))}{', ...' if len(numbers) > 3 else ''}"
