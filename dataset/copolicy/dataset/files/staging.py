"""A folder or file that appears complete or not at all, also where the power fails."""

import errno
import json
import os
import secrets
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ..exceptions import OutputExistsError

_REFUSALS = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EROFS)
_FILE = os.O_RDWR if os.name == "nt" else os.O_RDONLY  # Windows flushes only what is open for writing


def require_new(*paths: Path, overwrite: bool = False) -> None:
    """Checks that nothing would be overwritten that should not be.

    Raises:
        OutputExistsError: there is something at one of the paths, be it a broken link, and `overwrite` is off.
    """
    for path in paths:
        if os.path.lexists(path) and not overwrite:
            raise OutputExistsError(path)


@contextmanager
def new_folder(path: Path, suffix: str | None = None) -> Iterator[Path]:
    """A path beside `path` to build a folder at, renamed to `path` at the end of the block and removed on any error.

    Args:
        suffix: of its name, where only one process builds this folder: what a killed one left under the same name goes
            first. By default a name of its own, which no other process uses.

    Raises:
        OutputExistsError: there is something at `path`, before the block or after it.
        OSError: the disk refuses; it names `path` or a file in it.
    """
    require_new(path)
    with about(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.parent / f".{path.name}.{suffix or _unique()}"
    shutil.rmtree(partial, ignore_errors=True)
    try:
        with about(path, partial):
            yield partial
            take_name(partial, path)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def take_name(partial: Path, path: Path) -> None:
    """Renames a finished folder once all of it is on the disk.

    Raises:
        OutputExistsError: there is something at `path`.
    """
    sync_tree(partial)
    require_new(path)
    partial.rename(path)
    sync_folder(path.parent)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """The same for one file."""
    require_new(path)
    with replacement(path, new=True) as partial:
        yield partial


@contextmanager
def replacement(path: Path, new: bool = False) -> Iterator[Path]:
    """The same for a file that may be there already: the old one stays until the new one takes its place.

    Args:
        new: nothing may be there when the block ends.
    """
    with replacements([path]) as (partial,):
        yield partial
        if new:
            require_new(path)


@contextmanager
def replacements(paths: Sequence[Path]) -> Iterator[list[Path]]:
    """The same for several files: all are on the disk before the first takes its place, in the order of `paths`."""
    partials: list[Path] = []
    try:
        for path in paths:
            with about(path):
                path.parent.mkdir(parents=True, exist_ok=True)
            partials.append(path.parent / f".{path.name}.{_unique()}")
        places = dict(zip(partials, paths, strict=True))
        with about(Path(os.path.commonpath(paths)) if paths else None, places=places):
            yield list(partials)
        for partial, path in places.items():
            with about(path, partial):
                _sync(partial, _FILE)
        for partial, path in places.items():
            with about(path, partial):
                os.replace(partial, path)
        for folder in dict.fromkeys(path.parent for path in paths):
            sync_folder(folder)
    finally:
        for partial in partials:
            with suppress(OSError):
                partial.unlink(missing_ok=True)


def replace_text(path: Path, text: str) -> None:
    """Writes a text file in UTF-8, whole or not at all."""
    with replacement(path) as partial:
        partial.write_text(text, encoding="utf-8")


def replace_json(path: Path, value: Any, indent: int = 2, allow_nan: bool = True) -> None:
    """The same for a value as JSON."""
    replace_text(path, json.dumps(value, indent=indent, allow_nan=allow_nan) + "\n")


def write_as_lerobot(path: Path, value: Any) -> None:
    """Writes JSON into a folder in the making in the form that LeRobot gives its own."""
    path.write_text(json.dumps(value, indent=4, ensure_ascii=False), encoding="utf-8")


@contextmanager
def about(path: Path | None, partial: Path | None = None, places: Mapping[Path, Path] | None = None) -> Iterator[None]:
    """Gives an error of the system the name of the file that a user knows.

    Libraries leave the name out, or name the hidden file that was in the making; nobody finds that one when they read
    the message.

    Args:
        path: what is being written; named where the error names nothing.
        partial: where it is being written, a file or a folder.
        places: the same for several files.
    """
    places = dict(places or {})
    if path is not None and partial is not None:
        places[partial] = path
    try:
        yield
    except OSError as error:
        if error.errno is None and type(error) is not OSError:
            raise  # of a network library, with a text of its own
        if error.errno is None:
            # Of h5py or pyarrow: a path beside a text without a number would take the place of the text.
            error.errno, error.strerror = refusal(error) or errno.EIO, " ".join(str(error).split())
        name = error.filename
        for hidden, known in places.items():
            if isinstance(name, (str, os.PathLike)) and Path(name).is_relative_to(hidden):
                name = str(known / Path(name).relative_to(hidden))
        if name is None and path is not None:
            name = str(path)
        if name == error.filename:
            raise
        try:
            error.filename = name
        except AttributeError:  # of PyAV, whose errors keep the name that they were made with
            raise OSError(error.errno, error.strerror, name) from error
        raise
    except Exception as error:
        number = refusal(error)
        if number is None or path is None:
            raise
        # An error of safetensors or torch says it in its text alone.
        raise OSError(number, os.strerror(number), str(path)) from error


def refusal(error: BaseException) -> int | None:
    """Number of the system's error where the disk is full or takes no more, whatever the error is called.

    What an error was raised from, or while, counts too: libraries put errors of their own around it.
    """
    for cause in causes(error):
        number = getattr(cause, "errno", None)
        if number in _REFUSALS:
            return number
        if isinstance(cause, OSError) and number is not None:
            return None
        found = next((number for number in _REFUSALS if os.strerror(number) in str(cause)), None)
        if found is not None:
            return found
    return None


def causes(error: BaseException) -> Iterator[BaseException]:
    """An error, what it was raised from, what that was raised from, and so on."""
    seen: list[BaseException] = []
    cause: BaseException | None = error
    while cause is not None and not any(cause is earlier for earlier in seen):
        seen.append(cause)
        yield cause
        cause = cause.__cause__ or cause.__context__


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


def _unique() -> str:
    return f"{secrets.token_hex(4)}.partial"


def _sync(path: Path, flags: int) -> None:
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
