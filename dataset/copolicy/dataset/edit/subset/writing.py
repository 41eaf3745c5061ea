"""Writes some episodes of a data set as a new data set: frames, videos, metadata and statistics."""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ...arrays import Array
from ...exceptions import FileFormatError, RunError
from ...files.meta_files import CARD_FILE, EPISODES_FOLDER, INFO_FILE, TASKS_FILE
from ...files.staging import write_lerobot_json
from ...lerobot_folder.info import split_range, task_name
from ...lerobot_folder.references import DATA_TEMPLATE, VIDEO_TEMPLATE, FileIndex, chunk_file, data_file, next_index
from ...lerobot_folder.tables import read_parquet
from ...publication.minimal_card import write_minimal_card
from ...versions.content import read_content
from .aggregation import aggregate_statistics, write_statistics
from .stored_set import StoredSet
from .video_cuts import cut_videos

_DATA_MB = 100  # LeRobot's default size of a data file
_UNSHIFTED = ("count", "std")  # statistics that do not change when a constant is added to the values
_PATHS = {"data_path": DATA_TEMPLATE, "video_path": VIDEO_TEMPLATE}


def write_subset(source: StoredSet, numbers: Sequence[int], folder: Path, splits: Mapping[str, str]) -> str:
    """Writes the episodes `numbers`, in this order, to a new folder; returns the content hash.

    Episode columns, tasks and keys of meta/info.json are kept; episode numbers, file indices and timestamps are new.
    Tasks keep their numbers, even those without episodes.

    Args:
        splits: splits of meta/info.json, such as `{"train": "0:40"}`.

    Raises:
        FileFormatError: frames or videos disagree with the metadata.
        RunError: the content of an episode would change.
    """
    (folder / "meta").mkdir(parents=True)
    lengths = np.array([source.rows[number]["length"] for number in numbers], np.int64)
    starts = np.cumsum(lengths) - lengths
    columns: dict[str, Sequence[Any]] = {
        "episode_index": range(len(numbers)),
        "dataset_from_index": starts.tolist(),
        "dataset_to_index": (starts + lengths).tolist(),
        "meta/episodes/chunk_index": [0] * len(numbers),
        "meta/episodes/file_index": [0] * len(numbers),
    }
    file_indices = _write_frames(source, numbers, starts, folder)
    columns["data/chunk_index"], columns["data/file_index"] = zip(*file_indices, strict=True)
    for key in (name for name, feature in source.info["features"].items() if feature["dtype"] == "video"):
        columns |= _write_videos(source, key, numbers, folder)
    rows = source.episodes.take(list(numbers))
    for name, values in columns.items():
        rows = _replace_column(rows, name, list(values))
    rows = _shift_statistics(rows, {"episode_index": range(len(numbers)), "index": starts.tolist()})
    path = chunk_file(folder / EPISODES_FOLDER, (0, 0))
    path.parent.mkdir(parents=True)
    pq.write_table(_without_pandas_metadata(rows), path, compression="snappy", use_dictionary=True)
    write_statistics(aggregate_statistics(rows), folder)
    shutil.copyfile(source.root / TASKS_FILE, folder / TASKS_FILE)
    for name in source.licences():
        shutil.copyfile(source.root / name, folder / name)
    paths = {name: path for name, path in _PATHS.items() if source.info.get(name)}
    totals = {"total_episodes": len(numbers), "total_frames": int(lengths.sum()), "splits": dict(splits)}
    info = {**source.info, **paths, **totals}
    write_lerobot_json(folder / INFO_FILE, info)
    licences = {source.rows[number]["license"] for number in numbers}
    write_minimal_card(folder / CARD_FILE, licences, task_name(source.info))
    return _verify_unchanged(source, numbers, folder)


def remaining_splits(info: Mapping[str, Any], numbers: Sequence[int]) -> dict[str, str]:
    """The splits of meta/info.json restricted to some episodes in ascending order; `train` if there are none."""
    splits: dict[str, str] = {}
    entries = info.get("splits")
    for name, text in (entries if isinstance(entries, dict) else {}).items():
        if (episodes := split_range(text)) is None:
            return {"train": f"0:{len(numbers)}"}
        indices = [index for index, number in enumerate(numbers) if number in episodes]
        if indices:
            splits[name] = f"{indices[0]}:{indices[-1] + 1}"
    return splits or {"train": f"0:{len(numbers)}"}


def _write_frames(source: StoredSet, numbers: Sequence[int], starts: Array, folder: Path) -> list[FileIndex]:
    """Writes the data files, one row group per episode; returns the file index of each episode."""
    size = source.info.get("data_files_size_in_mb")
    limit = (size if isinstance(size, int | float) and size > 0 else _DATA_MB) * 2**20
    file_indices: list[FileIndex] = []
    file_index: FileIndex | None = None
    path, writer, schema = folder, None, None
    try:
        for number, start, frames in zip(numbers, starts.tolist(), _frames(source, numbers), strict=True):
            # All files need the same schema, because LeRobot reads them as one table.
            schema = _without_pandas_metadata(frames).schema if schema is None else schema
            if writer is not None and path.stat().st_size >= limit:
                writer.close()
                writer = None
            if writer is None:
                file_index = next_index(file_index, source.info)
                path = chunk_file(folder / "data", file_index)
                path.parent.mkdir(parents=True, exist_ok=True)
                writer = pq.ParquetWriter(path, schema, compression="snappy", use_dictionary=True)
            renumbered = _replace_column(frames, "episode_index", [len(file_indices)] * len(frames))
            renumbered = _replace_column(renumbered, "index", range(start, start + len(frames)))
            try:
                writer.write_table(renumbered.select(schema.names).cast(schema))
            except (pa.ArrowException, KeyError) as error:
                found = f"others in episode {number}: {str(error).splitlines()[0]}"
                raise FileFormatError(source.root / "data", "files with the same columns", found) from None
            assert file_index is not None
            file_indices.append(file_index)
    finally:
        if writer is not None:
            writer.close()
    return file_indices


def _frames(source: StoredSet, numbers: Sequence[int]) -> Iterator[pa.Table]:
    """Yields the frames of each episode; one data file is in memory at a time."""
    opened: tuple[Path, pa.Table, Array] | None = None
    keys = source.episodes.select(["data/chunk_index", "data/file_index"]).to_pylist()
    for number in numbers:
        path = data_file(source.root, source.info, keys[number])
        if opened is None or opened[0] != path:
            opened = (path, *_read_frames(path, number))
        _, table, owners = opened
        rows = np.flatnonzero(owners == number)
        length = source.rows[number]["length"]
        if len(rows) != length:
            raise FileFormatError(path, f"{length} frames of episode {number}", str(len(rows)))
        index = table.column("index").take(pa.array(rows)).to_numpy()
        yield table.take(pa.array(rows[np.argsort(index, kind="stable")]))


def _read_frames(path: Path, number: int) -> tuple[pa.Table, Array]:
    if not path.is_file():
        raise FileFormatError(path, f"the frames of episode {number}", "no file")
    table = read_parquet(path)
    return table, table.column("episode_index").to_numpy()


def _write_videos(source: StoredSet, key: str, numbers: Sequence[int], folder: Path) -> dict[str, list[Any]]:
    names = [f"videos/{key}/{part}" for part in ("chunk_index", "file_index", "from_timestamp", "to_timestamp")]
    rows = source.episodes.select(["episode_index", "length", *names]).to_pylist()
    cut = cut_videos(source.root, key, rows, numbers, folder, source.info)
    return {name: [cut[number][name] for number in numbers] for name in names}


def _shift_statistics(rows: pa.Table, new_minima: Mapping[str, Sequence[int]]) -> pa.Table:
    """Shifts the statistics of features, such as `index`, to the new minimum of each row."""
    for feature, values in new_minima.items():
        minimum_column = f"stats/{feature}/min"
        if minimum_column not in rows.column_names:
            continue
        old_minima = rows.column(minimum_column).to_pylist()
        shifts = [value - old[0] if old else None for old, value in zip(old_minima, values, strict=True)]
        for name in rows.column_names:
            if name.startswith(f"stats/{feature}/") and name.rpartition("/")[2] not in _UNSHIFTED:
                pairs = zip(rows.column(name).to_pylist(), shifts, strict=True)
                shifted = [None if shift is None else [value + shift for value in entry] for entry, shift in pairs]
                rows = _replace_column(rows, name, shifted)
    return rows


def _verify_unchanged(source: StoredSet, numbers: Sequence[int], folder: Path) -> str:
    content = read_content(folder)
    for number, after in zip(numbers, content.episodes, strict=True):
        before = source.content.episodes[number]
        if before.digest != after.digest:
            raise RunError(
                f"{source.root}: expected episode {number} unchanged in the new data set, found other content; nothing "
                "was written"
            )
    return content.hash


def _replace_column(table: pa.Table, name: str, values: Any) -> pa.Table:
    position = table.schema.get_field_index(name)
    if position < 0:
        raise FileFormatError(EPISODES_FOLDER, f"the column {name}", "none")
    field = table.schema.field(position)
    return table.set_column(position, field, pa.array(values, field.type))


def _without_pandas_metadata(table: pa.Table) -> pa.Table:
    """Removes the pandas metadata, which describe the rows of the source."""
    metadata = {key: value for key, value in (table.schema.metadata or {}).items() if key != b"pandas"}
    return table.replace_schema_metadata(metadata or None)
