"""Lists the files of a folder for every command: follows links and skips hidden files."""

import os
from collections.abc import Callable, Generator, Iterable, Iterator
from pathlib import Path

from ..exceptions import FileFormatError

_SYSTEM_FILES = {"thumbs.db", "ehthumbs.db", "desktop.ini", "__macosx"}
"""Names, in lower case, of files that Windows and macOS create without hiding them."""

_FileId = tuple[int, int]


def is_hidden(name: str) -> bool:
    """Whether a file or folder of this name is hidden or created by the operating system.

    macOS writes a `._NAME` beside each file that it copies to a disk without its own file system.
    """
    return name.startswith(".") or name.lower() in _SYSTEM_FILES


def visible_files(folder: Path, *patterns: str) -> list[Path]:
    """Lists the files below a folder whose name matches one of the patterns, sorted by path.

    Follows links to folders, except links back to an ancestor, and skips hidden files and folders. A broken link is
    listed as a file, so that opening it reports the error.

    Args:
        patterns: patterns of `Path.match`, for example `*.mcap`.

    Raises:
        FileFormatError: a folder that cannot be read.
    """
    return sorted(path for path in _walk(folder, _ancestors(folder)) if _matches(path, patterns))


def distinct_files(folder: Path, *patterns: str) -> list[Path]:
    """Lists files like `visible_files`, but each file once, by its own path where that is below the folder.

    Raises:
        FileFormatError: a folder that cannot be read.
    """
    visited = set(_ancestors(folder))
    links: list[Path] = []
    files = list(_walk_without_links(folder, visited, links))
    for link in links:  # the loop appends to `links`; files reached without a link come first
        files += _walk_without_links(link, visited, links) if link.is_dir() else [link]
    return sorted(without_duplicates(path for path in files if _matches(path, patterns)))


def without_duplicates(paths: Iterable[Path]) -> list[Path]:
    """Removes paths that lead to the same file as an earlier path; keeps the order."""
    by_file: dict[object, Path] = {}
    for path in paths:
        by_file.setdefault(_file_id(path) or os.path.realpath(path), path)
    return list(by_file.values())


def broken_links(folder: Path) -> list[Path]:
    """Lists the broken links below a folder, sorted; each may stand for a missing session or recording.

    Raises:
        FileFormatError: a folder that cannot be read.
    """
    return [path for path in distinct_files(folder, "*") if path.is_symlink() and not path.exists()]


class VisibleFolder(type(Path())):
    """A path for code of other libraries: its `glob` skips hidden files."""

    def glob(self, *arguments, **options) -> Generator[Path, None, None]:
        """`Path.glob` without the hidden files below this folder."""
        for path in super().glob(*arguments, **options):
            if not any(is_hidden(name) for name in path.relative_to(self).parts):
                yield Path(path)


def skipping_hidden_files(load: Callable) -> Callable:
    """Wraps a library function whose first argument is a folder so that it skips the hidden files in it."""

    def load_visible(folder, *arguments, **options):
        return load(VisibleFolder(folder), *arguments, **options)

    return load_visible


def _walk(folder: Path, ancestors: frozenset[_FileId]) -> Iterator[Path]:
    """Yields the visible files below a folder; links to one of `ancestors` are not followed."""
    file_id = _file_id(folder)
    if file_id is not None:
        ancestors = ancestors | {file_id}
    for entry in _entries(folder):
        path = folder / entry.name
        if not _is_folder(entry):
            yield path
        elif not entry.is_symlink() or _file_id(path) not in ancestors:
            yield from _walk(path, ancestors)


def _walk_without_links(folder: Path, visited: set[_FileId], links: list[Path]) -> Iterator[Path]:
    """Yields the visible files below a folder not yet in `visited`; appends links to `links` instead."""
    file_id = _file_id(folder)
    if file_id in visited:
        return
    if file_id is not None:
        visited.add(file_id)
    for entry in _entries(folder):
        path = folder / entry.name
        if entry.is_symlink():
            links.append(path)
        elif _is_folder(entry):
            yield from _walk_without_links(path, visited, links)
        else:
            yield path


def _entries(folder: Path) -> list[os.DirEntry]:
    try:
        with os.scandir(folder) as entries:
            return sorted((entry for entry in entries if not is_hidden(entry.name)), key=lambda entry: entry.name)
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        raise FileFormatError(folder, "a folder that can be read", error.strerror or str(error)) from None


def _is_folder(entry: os.DirEntry) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # circular links
        return False


def _matches(path: Path, patterns: tuple[str, ...]) -> bool:
    return any(path.match(pattern) for pattern in patterns)


def _file_id(path: Path) -> _FileId | None:
    """Device and inode of a file; None if it does not exist or the file system has no inode numbers."""
    try:
        status = path.stat()
    except OSError:
        return None
    return (status.st_dev, status.st_ino) if status.st_ino else None


def _ancestors(folder: Path) -> frozenset[_FileId]:
    parent_ids = (_file_id(parent) for parent in Path(os.path.realpath(folder)).parents)
    return frozenset(file_id for file_id in parent_ids if file_id is not None)
