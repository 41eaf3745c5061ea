"""Writes some episodes of a data set as a data set of its own: frames, videos, metadata and statistics."""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ...exceptions import FileFormatError, RunError
from ...files.meta_files import CARD_FILE, EPISODES_FOLDER, INFO_FILE, TASKS_FILE
from ...files.staging import write_lerobot_json
from ...lerobot_folder.info import split_range, task_name
from ...lerobot_folder.references import DATA_TEMPLATE, VIDEO_TEMPLATE, FileIndex, chunk_file, data_file, next_index
from ...lerobot_folder.tables import read_parquet
from ...publication.minimal_card import write_minimal_card
from ...versions.content import read_content
from .aggregation import aggregated_statistics, write_statistics
from .stored_set import StoredSet
from .video_cuts import cut_videos

_DATA_MB = 100  # LeRobot's size of a data file, where meta/info.json does not say
_FIXED = ("count", "std")  # statistics that do not move with the values
_PATHS = {"data_path": DATA_TEMPLATE, "video_path": VIDEO_TEMPLATE}


def write_subset(source: StoredSet, numbers: Sequence[int], folder: Path, splits: Mapping[str, str]) -> str:
    """Writes the episodes `numbers`, in this order, to a new folder; returns the content hash.

    Every episode column, the tasks and all keys of meta/info.json stay; numbers, places and times are new. The tasks
    keep their numbers, so that a task without an episode left stays in the list.

    Args:
        splits: for meta/info.json, such as `{"train": "0:40"}`.

    Raises:
        FileFormatError: frames or videos are not those that the metadata tell of.
        RunError: an episode would not be what it was.
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
    places = _write_frames(source, numbers, starts, folder)
    columns["data/chunk_index"], columns["data/file_index"] = zip(*places, strict=True)
    for key in (name for name, feature in source.info["features"].items() if feature["dtype"] == "video"):
        columns |= _write_videos(source, key, numbers, folder)
    rows = source.episodes.take(list(numbers))
    for name, values in columns.items():
        rows = _replaced(rows, name, list(values))
    rows = _moved_statistics(rows, {"episode_index": range(len(numbers)), "index": starts.tolist()})
    path = chunk_file(folder / EPISODES_FOLDER, (0, 0))
    path.parent.mkdir(parents=True)
    pq.write_table(_plain(rows), path, compression="snappy", use_dictionary=True)
    write_statistics(aggregated_statistics(rows), folder)
    shutil.copyfile(source.root / TASKS_FILE, folder / TASKS_FILE)
    for name in source.licences():
        shutil.copyfile(source.root / name, folder / name)
    paths = {name: path for name, path in _PATHS.items() if source.info.get(name)}
    totals = {"total_episodes": len(numbers), "total_frames": int(lengths.sum()), "splits": dict(splits)}
    info = {**source.info, **paths, **totals}
    write_lerobot_json(folder / INFO_FILE, info)
    licences = {source.rows[number]["license"] for number in numbers}
    write_minimal_card(folder / CARD_FILE, licences, task_name(source.info))
    return _verified(source, numbers, folder)


def kept_splits(info: Mapping[str, Any], numbers: Sequence[int]) -> dict[str, str]:
    """The splits of meta/info.json over some of its episodes in ascending order; `train` where they say nothing."""
    splits: dict[str, str] = {}
    entries = info.get("splits")
    for name, text in (entries if isinstance(entries, dict) else {}).items():
        if (span := split_range(text)) is None:
            return {"train": f"0:{len(numbers)}"}
        inside = [place for place, number in enumerate(numbers) if number in span]
        if inside:
            splits[name] = f"{inside[0]}:{inside[-1] + 1}"
    return splits or {"train": f"0:{len(numbers)}"}


def _write_frames(source: StoredSet, numbers: Sequence[int], starts: np.ndarray, folder: Path) -> list[FileIndex]:
    """Writes the data files, a row group an episode; where each episode went."""
    size = source.info.get("data_files_size_in_mb")
    limit = (size if isinstance(size, int | float) and size > 0 else _DATA_MB) * 2**20
    places: list[FileIndex] = []
    place: FileIndex | None = None
    path, writer, schema = folder, None, None
    try:
        for number, start, frames in zip(numbers, starts.tolist(), _frames(source, numbers), strict=True):
            # One type for all files, as LeRobot reads them as one table.
            schema = _plain(frames).schema if schema is None else schema
            if writer is not None and path.stat().st_size >= limit:
                writer.close()
                writer = None
            if writer is None:
                place = next_index(place, source.info)
                path = chunk_file(folder / "data", place)
                path.parent.mkdir(parents=True, exist_ok=True)
                writer = pq.ParquetWriter(path, schema, compression="snappy", use_dictionary=True)
            moved = _replaced(frames, "episode_index", [len(places)] * len(frames))
            moved = _replaced(moved, "index", range(start, start + len(frames)))
            try:
                writer.write_table(moved.select(schema.names).cast(schema))
            except (pa.ArrowException, KeyError) as error:
                found = f"others in episode {number}: {str(error).splitlines()[0]}"
                raise FileFormatError(source.root / "data", "files with the same columns", found) from None
            assert place is not None
            places.append(place)
    finally:
        if writer is not None:
            writer.close()
    return places


def _frames(source: StoredSet, numbers: Sequence[int]) -> Iterator[pa.Table]:
    """The frames of each episode; one data file is in memory at a time."""
    opened: tuple[Path, pa.Table, np.ndarray] | None = None
    keys = source.episodes.select(["data/chunk_index", "data/file_index"]).to_pylist()
    for number in numbers:
        path = data_file(source.root, source.info, keys[number])
        if opened is None or opened[0] != path:
            opened = (path, *_read(path, number))
        _, table, owners = opened
        rows = np.flatnonzero(owners == number)
        length = source.rows[number]["length"]
        if len(rows) != length:
            raise FileFormatError(path, f"{length} frames of episode {number}", str(len(rows)))
        index = table.column("index").take(pa.array(rows)).to_numpy()
        yield table.take(pa.array(rows[np.argsort(index, kind="stable")]))


def _read(path: Path, number: int) -> tuple[pa.Table, np.ndarray]:
    if not path.is_file():
        raise FileFormatError(path, f"the frames of episode {number}", "no file")
    table = read_parquet(path)
    return table, table.column("episode_index").to_numpy()


def _write_videos(source: StoredSet, key: str, numbers: Sequence[int], folder: Path) -> dict[str, list[Any]]:
    names = [f"videos/{key}/{part}" for part in ("chunk_index", "file_index", "from_timestamp", "to_timestamp")]
    rows = source.episodes.select(["episode_index", "length", *names]).to_pylist()
    cut = cut_videos(source.root, key, rows, numbers, folder, source.info)
    return {name: [cut[number][name] for number in numbers] for name in names}


def _moved_statistics(rows: pa.Table, firsts: Mapping[str, Sequence[int]]) -> pa.Table:
    """Rows whose statistics of the running numbers begin where the numbers themselves now do."""
    for feature, values in firsts.items():
        least = f"stats/{feature}/min"
        if least not in rows.column_names:
            continue
        before = rows.column(least).to_pylist()
        moves = [value - low[0] if low else None for low, value in zip(before, values, strict=True)]
        for name in rows.column_names:
            if name.startswith(f"stats/{feature}/") and name.rpartition("/")[2] not in _FIXED:
                entries = zip(rows.column(name).to_pylist(), moves, strict=True)
                moved = [None if by is None else [value + by for value in entry] for entry, by in entries]
                rows = _replaced(rows, name, moved)
    return rows


def _verified(source: StoredSet, numbers: Sequence[int], folder: Path) -> str:
    content = read_content(folder)
    for number, after in zip(numbers, content.episodes, strict=True):
        before = source.content.episodes[number]
        if before.digest != after.digest:
            raise RunError(
                f"{source.root}: expected episode {number} unchanged in what was written, found otherwise; nothing is "
                "left of it"
            )
    return content.hash


def _replaced(table: pa.Table, name: str, values: Any) -> pa.Table:
    position = table.schema.get_field_index(name)
    if position < 0:
        raise FileFormatError(EPISODES_FOLDER, f"the column {name}", "none")
    field = table.schema.field(position)
    return table.set_column(position, field, pa.array(values, field.type))


def _plain(table: pa.Table) -> pa.Table:
    """Without what pandas notes about rows that are no longer there."""
    metadata = {key: value for key, value in (table.schema.metadata or {}).items() if key != b"pandas"}
    return table.replace_schema_metadata(metadata or None)
