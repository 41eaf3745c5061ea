"""Which files a folder holds: links entered, hidden files passed over, alike in every command."""

import os
from collections.abc import Callable, Generator, Iterable, Iterator
from pathlib import Path

from ..exceptions import FileFormatError

_SIDE_FILES = {"thumbs.db", "ehthumbs.db", "desktop.ini", "__macosx"}
"""What Windows and macOS leave beside files under names that are not hidden, in lower case."""

_Identity = tuple[int, int]


def is_hidden(name: str) -> bool:
    """Whether a file or folder of this name is no part of any data.

    macOS leaves a `._NAME` beside each file that it copies to a foreign disk.
    """
    return name.startswith(".") or name.lower() in _SIDE_FILES


def visible_files(folder: Path, *patterns: str) -> list[Path]:
    """The files below a folder whose name matches one of the patterns, sorted by path.

    Linked folders are entered, but for links that lead back to where they came from. Whatever is hidden is passed
    over. A link that leads nowhere counts as a file, so that whoever opens it says so.

    Args:
        patterns: of the file's name, as in `Path.match`, for example `*.mcap`.

    Raises:
        FileFormatError: a folder that cannot be read.
    """
    return sorted(path for path in _every_path(folder, _ancestors(folder)) if _matches(path, patterns))


def distinct_files(folder: Path, *patterns: str) -> list[Path]:
    """The same with each file once, whatever links lead to it: by its own path if that is below the folder, too.

    Raises:
        FileFormatError: a folder that cannot be read.
    """
    entered = set(_ancestors(folder))
    links: list[Path] = []
    files = list(_without_links(folder, entered, links))
    for link in links:  # grows meanwhile; links wait until all is seen that needs none
        files += _without_links(link, entered, links) if link.is_dir() else [link]
    return sorted(distinct(path for path in files if _matches(path, patterns)))


def distinct(paths: Iterable[Path]) -> list[Path]:
    """The paths in their order without those that lead to a file which one before them names."""
    by_file: dict[object, Path] = {}
    for path in paths:
        by_file.setdefault(_identity(path) or os.path.realpath(path), path)
    return list(by_file.values())


def broken_links(folder: Path) -> list[Path]:
    """The visible links below a folder that lead nowhere, sorted: each may have been a session or a recording.

    Raises:
        FileFormatError: a folder that cannot be read.
    """
    return [path for path in distinct_files(folder, "*") if path.is_symlink() and not path.exists()]


class VisibleFolder(type(Path())):
    """A folder for foreign code that looks for its files with `glob`: hidden ones are not among them."""

    def glob(self, *arguments, **options) -> Generator[Path, None, None]:
        """`Path.glob` without what is hidden below this folder."""
        for path in super().glob(*arguments, **options):
            if not any(is_hidden(name) for name in path.relative_to(self).parts):
                yield Path(path)


def on_visible_files(load: Callable) -> Callable:
    """A foreign function whose first argument is a folder, kept from finding the hidden files in it."""

    def load_visible(folder, *arguments, **options):
        return load(VisibleFolder(folder), *arguments, **options)

    return load_visible


def _every_path(folder: Path, above: frozenset[_Identity]) -> Iterator[Path]:
    """The visible files below a folder; `above` are the folders that led here, which a link may lead back to."""
    identity = _identity(folder)
    if identity is not None:
        above = above | {identity}
    for entry in _entries(folder):
        path = folder / entry.name
        if not _is_folder(entry):
            yield path
        elif not entry.is_symlink() or _identity(path) not in above:
            yield from _every_path(path, above)


def _without_links(folder: Path, entered: set[_Identity], links: list[Path]) -> Iterator[Path]:
    """The visible files below a folder that is entered the first time; links are put aside."""
    identity = _identity(folder)
    if identity in entered:
        return
    if identity is not None:
        entered.add(identity)
    for entry in _entries(folder):
        path = folder / entry.name
        if entry.is_symlink():
            links.append(path)
        elif _is_folder(entry):
            yield from _without_links(path, entered, links)
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
    except OSError:  # links in a circle
        return False


def _matches(path: Path, patterns: tuple[str, ...]) -> bool:
    return any(path.match(pattern) for pattern in patterns)


def _identity(path: Path) -> _Identity | None:
    """What tells a file from all others; None where it is not there, or its file system has no such number."""
    try:
        status = path.stat()
    except OSError:
        return None
    return (status.st_dev, status.st_ino) if status.st_ino else None


def _ancestors(folder: Path) -> frozenset[_Identity]:
    above = (_identity(parent) for parent in Path(os.path.realpath(folder)).parents)
    return frozenset(identity for identity in above if identity is not None)
