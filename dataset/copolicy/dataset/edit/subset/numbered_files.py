"""The numbered files of a LeRobot v3 data set, `chunk-000/file-000.parquet`."""

from pathlib import Path
from typing import Any

from ...exceptions import FileFormatError
from ...lerobot_folder.info import INFO_FILE

Place = tuple[int, int]
"""Numbers of a chunk and of a file in it."""

_FILES_IN_A_CHUNK = 1000  # LeRobot's, where meta/info.json does not say


def numbered(folder: Path, place: Place, suffix: str = "parquet") -> Path:
    """The path of a numbered file."""
    return folder / f"chunk-{place[0]:03d}" / f"file-{place[1]:03d}.{suffix}"


def file_of(root: Path, info: dict[str, Any], key: str, **numbers: Any) -> Path:
    """The file that `data_path` or `video_path` of meta/info.json names for some numbers.

    Raises:
        FileFormatError: no such path, or numbers that are none.
    """
    try:
        return root / info[key].format(**numbers)
    except (KeyError, AttributeError, IndexError, TypeError, ValueError):
        found = f"{key} {info.get(key)!r} and {numbers}"
        raise FileFormatError(root / INFO_FILE, "the path of a file for its numbers", found) from None


def next_place(place: Place | None, info: dict[str, Any]) -> Place:
    """The numbers after some numbers; the first ones for None."""
    if place is None:
        return 0, 0
    chunk, file = place
    size = info.get("chunks_size")
    full = file + 1 >= (size if isinstance(size, int) and size > 0 else _FILES_IN_A_CHUNK)
    return (chunk + 1, 0) if full else (chunk, file + 1)
