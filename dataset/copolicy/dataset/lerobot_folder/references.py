"""What a LeRobot data set refers to: tasks by number, files by number and template, pictures by time."""

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
"""pandas calls an index without a name so, and LeRobot before 0.4 left it without one."""


Place = tuple[int, int]
"""Numbers of a chunk and of a file in it."""
_NAME = r"chunk-(\d+)/file-(\d+)\."
_FILES_IN_A_CHUNK = 1000  # LeRobot's, where meta/info.json does not say


def read_tasks(root: Path) -> dict[int, str]:
    """The sentence of each task by its number.

    Raises:
        FileFormatError: no or a broken `meta/tasks.parquet`.
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
    """Whether pandas takes the sentences for the index of the table, where LeRobot looks for them."""
    stored = (pq.read_schema(path).metadata or {}).get(b"pandas")
    try:
        columns = json.loads(stored or b"{}").get("index_columns", [])
    except (ValueError, AttributeError):
        return False
    return any(name in columns for name in _TASK_NAMES)


def data_path(info: Mapping[str, Any], row: Mapping[str, Any]) -> str:
    """Path of the file with an episode's frames, below the data set's folder.

    Args:
        row: of meta/episodes.

    Raises:
        ValueError: no usable template, or no numbers for it; the message says what.
    """
    return _filled("data_path", info.get("data_path", DATA_TEMPLATE), row, "data/", {})


def data_file(root: Path, info: Mapping[str, Any], row: Mapping[str, Any]) -> Path:
    """The file with an episode's frames.

    Raises:
        FileFormatError: the row or the template does not say.
    """
    try:
        return root / data_path(info, row)
    except ValueError as error:
        raise FileFormatError(root / EPISODES_FOLDER, "where the frames of an episode are", str(error)) from None


def video_path(info: Mapping[str, Any], row: Mapping[str, Any], key: str) -> str:
    """The same for the file with an episode's pictures of a video feature."""
    template = info.get("video_path", VIDEO_TEMPLATE)
    return _filled("video_path", template, row, f"videos/{key}/", {"video_key": key})


def video_span(root: Path, info: Mapping[str, Any], row: Mapping[str, Any], key: str) -> tuple[Path, float, float]:
    """File, first and last moment (s) of an episode's pictures.

    Raises:
        FileFormatError: the row does not say, or there is no such file.
    """
    episodes = root / EPISODES_FOLDER
    try:
        path = root / video_path(info, row, key)
    except ValueError as error:
        raise FileFormatError(
            episodes, f"where the video {key} of episode {row['episode_index']} is", str(error)
        ) from None
    start, end = (_time(row.get(f"videos/{key}/{part}_timestamp")) for part in ("from", "to"))
    if not 0 <= start < end:
        expected = f"a span of time in the video {key} for episode {row['episode_index']}"
        raise FileFormatError(episodes, expected, f"{start} to {end}")
    if not path.is_file():
        raise FileFormatError(path, f"the video of episode {row['episode_index']}", "no such file")
    return path, start, end


def video_features(info: Mapping[str, Any]) -> Iterator[str]:
    """Names of the features that are videos."""
    return (name for name, feature in info["features"].items() if feature["dtype"] == "video")


def _time(value: object) -> float:
    """A finite number, or NaN."""
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else math.nan


def _filled(name: str, template: Any, row: Mapping[str, Any], columns: str, keys: dict[str, str]) -> str:
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


def numbered(folder: Path, place: Place, suffix: str = "parquet") -> Path:
    """The path of a numbered file."""
    return folder / f"chunk-{place[0]:03d}" / f"file-{place[1]:03d}.{suffix}"


def numbered_files(folder: Path, suffix: str = "parquet") -> dict[Place, Path]:
    """The numbered files of a folder, in the order of their numbers; files of other names are passed over."""
    found = ((re.fullmatch(_NAME + suffix, path.relative_to(folder).as_posix()), path) for path in folder.glob("*/*"))
    return dict(sorted(((int(match[1]), int(match[2])), path) for match, path in found if match))


def next_place(place: Place | None, info: dict[str, Any]) -> Place:
    """The numbers after some numbers; the first ones for None."""
    if place is None:
        return 0, 0
    chunk, file = place
    size = info.get("chunks_size")
    full = file + 1 >= (size if isinstance(size, int) and size > 0 else _FILES_IN_A_CHUNK)
    return (chunk + 1, 0) if full else (chunk, file + 1)
