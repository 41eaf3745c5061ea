"""A LeRobot v3 data set folder: the first step of every reader."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from ..episode import EPISODE_COLUMNS, LATER_COLUMNS, UNKNOWN_VALUES
from ..exceptions import FileFormatError
from ..features import ACTION, STATE, VECTORS, features_of
from ..files.listing import visible_files
from ..files.meta_files import EPISODES_FOLDER, INFO_FILE
from ..task import PairTask
from .info import episode_files, read_info, require_episodes, split_range, stripped_hint, task_of
from .tables import column_types, damaged, episode_values, feature_values, pa, read_parquet

POSITIONS = ("episode_index", "length", "dataset_from_index", "dataset_to_index")
"""The columns of meta/episodes that say which rows of the frames an episode has."""


@dataclass(frozen=True)
class LeRobotFolder:
    """The metadata of a data set, checked for types and for consistent episode numbers and lengths.

    Attributes:
        info: `meta/info.json`, the types of its entries checked.
        episodes: the rows of meta/episodes in the order of `episode_index`, without statistics.
    """

    root: Path
    info: dict[str, Any]
    episodes: pa.Table

    @classmethod
    def open(cls, root: Path) -> "LeRobotFolder":
        """Reads the metadata.

        Raises:
            FileFormatError: no LeRobot v3 data set, or one whose episodes cannot be told apart: no or a broken table
                of episodes, or an `episode_index` or `length` that is none.
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
            raise FileFormatError(path, f"episodes 0 to {len(numbers) - 1}, each once", _wrong_numbers(numbers))
        if (lengths < 1).any():
            raise FileFormatError(path, "episodes of at least one frame", f"episode {int(np.argmin(lengths))} of none")
        if lengths.sum(dtype=float) > 2**40:
            raise FileFormatError(path, "lengths that add up to a data set", f"{lengths.max()} frames in an episode")
        return cls(root, info, table)

    @property
    def task(self) -> PairTask:
        """The task of the data set, as `task_of`."""
        return task_of(self.info)

    @property
    def splits(self) -> dict[str, range]:
        """Episodes of each split of `meta/info.json`.

        Raises:
            FileFormatError: a split of another form.
        """
        found: dict[str, range] = {}
        for name, text in (self.info.get("splits") or {}).items():
            if (span := split_range(text)) is None:
                raise FileFormatError(self.root / INFO_FILE, "splits as FIRST:END", repr(text))
            found[name] = span
        return found

    @property
    def lengths(self) -> list[int]:
        """Frames of each episode."""
        return self.episodes.column("length").to_pylist()

    @property
    def data_files(self) -> list[Path]:
        """The files of frames, in the order of their paths.

        Raises:
            FileFormatError: there is none.
        """
        files = data_files(self.root)
        if not files:
            raise FileFormatError(self.root, "Parquet files under data", "none")
        return files

    def rows(self, columns: Sequence[str] = tuple(EPISODE_COLUMNS)) -> list[dict[str, Any]]:
        """`episode_index`, `length` and some episode columns of each episode; an empty entry is the one of
        `UNKNOWN_VALUES`.

        Raises:
            FileFormatError: a column is missing or holds something else.
        """
        path = self.root / EPISODES_FOLDER
        missing = [name for name in columns if name not in self.episodes.column_names and name not in LATER_COLUMNS]
        if missing:
            hint = stripped_hint(self.info, self.root) if "episode_uuid" in missing else ""
            raise FileFormatError(path, "the episode columns of copolicy", f"none named {', '.join(missing)}{hint}")
        values: dict[str, list[Any]] = {name: self.episodes.column(name).to_pylist() for name in POSITIONS[:2]}
        for name in columns:
            if name in self.episodes.column_names:
                kind, unknown = EPISODE_COLUMNS[name], UNKNOWN_VALUES[name]
                values[name] = episode_values(self.episodes, name, kind, path, unknown).tolist()
            else:
                values[name] = [UNKNOWN_VALUES[name]] * self.episodes.num_rows
        return [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]

    def frames(self, shapes: Mapping[str, Sequence[int]]) -> Iterator[tuple[int, dict[str, np.ndarray]]]:
        """Number and columns of each episode in order, `(T, n)` or `(T,)` each; one file is in memory at a time.

        Rows are taken in the order of their `index`, whatever the order in a file and of the files.

        Args:
            shapes: of the columns, by name.

        Raises:
            FileFormatError: a data file is missing, damaged, without a column, with a number that is not finite, or
                holds other episodes than meta/episodes says.
        """
        expected = iter(enumerate(self.lengths))
        for number, group in groupby(self._parts(shapes), key=lambda part: part[0]):
            (_, path, columns), *rest = group
            for _, _, more in rest:  # an episode that goes on in the next file
                columns = {name: np.concatenate((values, more[name])) for name, values in columns.items()}
            due, found = next(expected, None), (number, len(columns["index"]))
            if found != due:
                named = f"episode {due[0]} with {due[1]} frames" if due else "its end"
                raise FileFormatError(path, f"{named} as in meta/episodes", f"episode {found[0]} with {found[1]}")
            yield number, {name: columns[name] for name in shapes}
        if left := next(expected, None):
            raise FileFormatError(self.root / "data", f"the frames of episode {left[0]}", "none")

    def _parts(self, shapes: Mapping[str, Sequence[int]]) -> Iterator[tuple[int, Path, dict[str, np.ndarray]]]:
        """Number, file and columns of each run of rows of one episode, in the order of their `index`."""
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
        """Checks that the data set is one of its task.

        Raises:
            FileFormatError: a feature is missing or has another shape, as in a data set of another task.
            UnknownNameError: its task is not installed.
        """
        difference = other_task(self.info, features)
        if difference:
            expected = f"a data set of {self.task.spec.title} (copolicy-convert)"
            raise FileFormatError(self.root / INFO_FILE, expected, difference)


def _first_index(path: Path) -> int:
    """The least `index` of a file of frames."""
    return int(feature_values(read_parquet(path, ["index"]), "index", (1,), path).min(initial=2**62))


def data_files(root: Path) -> list[Path]:
    """The Parquet files of frames, in the order of their paths."""
    return visible_files(root / "data", "*.parquet")


def read_episodes(root: Path) -> pa.Table:
    """All rows of meta/episodes, without the statistics of episodes.

    Raises:
        FileFormatError: no file, one that is no complete Parquet file, or files that do not fit together.
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


def other_task(info: dict[str, Any], features: Sequence[str] = (STATE, ACTION)) -> str:
    """What makes a feature table none of the task that its robot type names; empty where nothing does."""
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


def _wrong_numbers(numbers: np.ndarray) -> str:
    repeated = numbers[1:][np.diff(numbers) == 0]
    if len(repeated):
        return f"episode {repeated[0]} twice"
    return f"{', '.join(map(str, numbers[:3].tolist()))}{', ...' if len(numbers) > 3 else ''}"
