"""Resolves references in a LeRobot data set: tasks by number, files by index and template, video frames by time."""

import json
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..exceptions import FileFormatError
from ..files.meta_files import EPISODES_FOLDER, TASKS_FILE
from .tables import column_types, episode_values, pq, read_parquet

DATA_TEMPLATE = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_TEMPLATE = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_TASK_NAMES = ("task", "__index_level_0__")
"""The second is pandas' name of an unnamed index, which LeRobot before 0.4 wrote."""


FileIndex = tuple[int, int]
"""Index of a chunk and of a file in it."""
_CHUNK_FILE = r"chunk-(\d+)/file-(\d+)\."
_FILES_PER_CHUNK = 1000  # LeRobot's default if meta/info.json has no chunks_size


def read_tasks(root: Path) -> dict[int, str]:
    """Reads the sentence of each task by task number.

    Raises:
        FileFormatError: `meta/tasks.parquet` is missing or damaged.
    """
    path = root / TASKS_FILE
    if not path.is_file():
        raise FileFormatError(root, f"a LeRobot v3 data set with {TASKS_FILE}", "none")
    name = next((name for name in column_types(path) if name in _TASK_NAMES), None)
    if name is None:
        raise FileFormatError(path, "columns task_index and task", f"{', '.join(column_types(path)) or 'none'}")
    table = read_parquet(path)
    numbers = episode_values(table, "task_index", "int", path)
    return dict(zip(numbers.tolist(), episode_values(table, name, "str", path).tolist(), strict=True))


def tasks_are_indexed(path: Path) -> bool:
    """Whether the sentences are the pandas index of the table, where LeRobot reads them."""
    stored = (pq.read_schema(path).metadata or {}).get(b"pandas")
    try:
        columns = json.loads(stored or b"{}").get("index_columns", [])
    except (ValueError, AttributeError):
        return False
    return any(name in columns for name in _TASK_NAMES)


def data_path(info: Mapping[str, Any], row: Mapping[str, Any]) -> str:
    """Path of the file with an episode's frames, relative to the data set's folder.

    Args:
        row: row of meta/episodes.

    Raises:
        ValueError: the template is not usable, or the row lacks an index.
    """
    return _fill_template("data_path", info.get("data_path", DATA_TEMPLATE), row, "data/", {})


def data_file(root: Path, info: Mapping[str, Any], row: Mapping[str, Any]) -> Path:
    """The file with an episode's frames.

    Raises:
        FileFormatError: the template is not usable, or the row lacks an index.
    """
    try:
        return root / data_path(info, row)
    except ValueError as error:
        raise FileFormatError(root / EPISODES_FOLDER, "where the frames of an episode are", str(error)) from None


def video_path(info: Mapping[str, Any], row: Mapping[str, Any], key: str) -> str:
    """Path of the video file with an episode's frames of a video feature, see `data_path`."""
    template = info.get("video_path", VIDEO_TEMPLATE)
    return _fill_template("video_path", template, row, f"videos/{key}/", {"video_key": key})


def video_span(root: Path, info: Mapping[str, Any], row: Mapping[str, Any], key: str) -> tuple[Path, float, float]:
    """Video file, start and end (s) of an episode.

    Raises:
        FileFormatError: the row lacks an entry, or the file does not exist.
    """
    episodes = root / EPISODES_FOLDER
    try:
        path = root / video_path(info, row, key)
    except ValueError as error:
        raise FileFormatError(
            episodes, f"where the video {key} of episode {row['episode_index']} is", str(error)
        ) from None
    start, end = (_finite(row.get(f"videos/{key}/{part}_timestamp")) for part in ("from", "to"))
    if not 0 <= start < end:
        expected = f"a span of time in the video {key} for episode {row['episode_index']}"
        raise FileFormatError(episodes, expected, f"{start} to {end}")
    if not path.is_file():
        raise FileFormatError(path, f"the video of episode {row['episode_index']}", "no such file")
    return path, start, end


def video_features(info: Mapping[str, Any]) -> Iterator[str]:
    """Names of the features that are videos."""
    return (name for name, feature in info["features"].items() if feature["dtype"] == "video")


def _finite(value: object) -> float:
    """Converts to a finite number, else NaN."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else math.nan


def _fill_template(name: str, template: Any, row: Mapping[str, Any], columns: str, keys: dict[str, str]) -> str:
    if not isinstance(template, str):
        raise ValueError(f"{name} {template!r} in meta/info.json")
    numbers: dict[str, int] = {}
    for part in ("chunk_index", "file_index"):
        value = row.get(columns + part)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise ValueError(f"{columns}{part} {'missing' if value is None else repr(value)}")
        numbers[part] = value
    try:
        filled = template.format(**numbers, **keys)
    except (KeyError, IndexError, ValueError, AttributeError, TypeError) as error:
        raise ValueError(f"{name} {template!r} in meta/info.json ({error})") from None
    if Path(filled).is_absolute() or ".." in Path(filled).parts or "\0" in filled:
        raise ValueError(f"{name} {template!r} in meta/info.json leads out of the data set")
    return filled


def chunk_file(folder: Path, index: FileIndex, suffix: str = "parquet") -> Path:
    """Path of a file by its chunk and file index."""
    return folder / f"chunk-{index[0]:03d}" / f"file-{index[1]:03d}.{suffix}"


def chunk_files(folder: Path, suffix: str = "parquet") -> dict[FileIndex, Path]:
    """The files `chunk-NNN/file-NNN` of a folder in the order of their indices; other files are ignored."""
    pattern = re.compile(_CHUNK_FILE + suffix)
    matches = ((pattern.fullmatch(path.relative_to(folder).as_posix()), path) for path in folder.glob("*/*"))
    return dict(sorted(((int(match[1]), int(match[2])), path) for match, path in matches if match))


def next_index(index: FileIndex | None, info: dict[str, Any]) -> FileIndex:
    """The index after `index`; the first one for None."""
    if index is None:
        return 0, 0
    chunk, file = index
    size = info.get("chunks_size")
    full = file + 1 >= (size if isinstance(size, int) and size > 0 else _FILES_PER_CHUNK)
    return (chunk + 1, 0) if full else (chunk, file + 1)
