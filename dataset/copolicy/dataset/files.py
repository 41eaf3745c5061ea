"""Which files a folder holds: links entered, hidden files passed over, alike in every command."""

import os
from pathlib import Path


def visible_files(folder: Path, *patterns: str) -> list[Path]:
    """The files below a folder whose name matches one of the patterns, sorted by path.

    Linked folders are entered, each folder once, so that links that lead back do no harm. Whatever has a name that
    begins with a dot is passed over: macOS leaves a `._NAME` beside each file that it copies to a foreign disk.

    Args:
        patterns: of the file's name, as in `Path.match`, for example `*.mcap`.
    """
    found: list[Path] = []
    entered: set[tuple[int, int]] = set()
    for parent, folders, names in os.walk(folder, followlinks=True):
        status = os.stat(parent)
        if (status.st_dev, status.st_ino) in entered:
            folders.clear()
            continue
        entered.add((status.st_dev, status.st_ino))
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        paths = [Path(parent, name) for name in names if not name.startswith(".")]
        found += [path for path in paths if any(path.match(pattern) for pattern in patterns)]
    return sorted(found)
