"""A folder or file that appears complete or not at all, also where the power fails."""

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .exceptions import OutputExistsError

_FILE = os.O_RDWR if os.name == "nt" else os.O_RDONLY  # Windows flushes only what is open for writing


def require_new(path: Path) -> None:
    """Checks that there is nothing at `path`.

    Raises:
        OutputExistsError: there is something, be it a broken link.
    """
    if os.path.lexists(path):
        raise OutputExistsError(path)


@contextmanager
def new_folder(path: Path, suffix: str | None = None) -> Iterator[Path]:
    """A path beside `path` to build a folder at, renamed to `path` at the end of the block and removed on any error.

    Args:
        suffix: of its name, where only one process builds this folder: what a killed one left under the same name goes
            first. By default a name of its own, which no other process uses.

    Raises:
        OutputExistsError: there is something at `path`, before the block or after it.
    """
    require_new(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.parent / f".{path.name}.{suffix or f'{secrets.token_hex(4)}.partial'}"
    shutil.rmtree(partial, ignore_errors=True)
    try:
        yield partial
        sync_tree(partial)
        require_new(path)
        partial.rename(path)
        sync_folder(path.parent)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """The same for one file."""
    require_new(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.parent / f".{path.name}.{secrets.token_hex(4)}.partial"
    try:
        yield partial
        _sync(partial, _FILE)
        require_new(path)
        partial.rename(path)
        sync_folder(path.parent)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def replacement(path: Path) -> Iterator[Path]:
    """The same for a file that may be there already: the old one stays until the new one takes its place."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.parent / f".{path.name}.{secrets.token_hex(4)}.partial"
    try:
        yield partial
        _sync(partial, _FILE)
        os.replace(partial, path)
        sync_folder(path.parent)
    except OSError as error:
        # Nobody finds the hidden file when they read this.
        if error.filename is None or Path(error.filename) == partial:
            error.filename = str(path)
        raise
    finally:
        partial.unlink(missing_ok=True)


def replace_text(path: Path, text: str) -> None:
    """Writes a text file in UTF-8, whole or not at all."""
    with replacement(path) as partial:
        partial.write_text(text, encoding="utf-8")


def sync_tree(folder: Path) -> None:
    """Waits until every file and folder below `folder`, and itself, are on the disk.

    What was written back already, such as a file that two data sets share by a hard link, costs next to nothing.
    """
    for inside, _, names in os.walk(folder, topdown=False):
        for name in names:
            if not Path(inside, name).is_symlink():
                _sync(Path(inside, name), _FILE)
        sync_folder(Path(inside))


def sync_folder(folder: Path) -> None:
    """Waits until the names in a folder are on the disk, where the system can (Windows cannot open a folder)."""
    if hasattr(os, "O_DIRECTORY"):
        _sync(folder, os.O_RDONLY | os.O_DIRECTORY)


def _sync(path: Path, flags: int) -> None:
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
