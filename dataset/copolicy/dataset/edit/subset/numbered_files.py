"""The numbered files of a LeRobot v3 data set, `chunk-000/file-000.parquet`."""

import re
from pathlib import Path
from typing import Any

Place = tuple[int, int]
"""Numbers of a chunk and of a file in it."""

_NAME = r"chunk-(\d+)/file-(\d+)\."
_FILES_IN_A_CHUNK = 1000  # LeRobot's, where meta/info.json does not say


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
