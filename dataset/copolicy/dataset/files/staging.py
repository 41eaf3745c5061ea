"""Writes folders and files atomically: each appears complete or not at all, even after a power failure."""

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

_DISK_ERRORS = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EROFS)
_SYNC_FLAGS = os.O_RDWR if os.name == "nt" else os.O_RDONLY  # Windows flushes only files open for writing


def require_new(*paths: Path, overwrite: bool = False) -> None:
    """Checks that no path exists, unless `overwrite` is set.

    Raises:
        OutputExistsError: one of the paths exists, if only as a broken link.
    """
    for path in paths:
        if os.path.lexists(path) and not overwrite:
            raise OutputExistsError(path)


@contextmanager
def new_folder(path: Path, suffix: str | None = None) -> Iterator[Path]:
    """Yields a temporary path for a new folder, renamed to `path` at the end of the block and removed on any error.

    Args:
        suffix: suffix of the temporary name, for a folder that only one process builds; a folder that a killed
            process left under this name is deleted first. By default the name is random.

    Raises:
        OutputExistsError: `path` exists before the block or at its end.
        OSError: the disk is full or not writable; the error names `path` or a file in it.
    """
    require_new(path)
    with named_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.parent / f".{path.name}.{suffix or _unique()}"
    shutil.rmtree(partial, ignore_errors=True)
    try:
        with named_errors(path, partial):
            yield partial
            rename_complete(partial, path)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def rename_complete(partial: Path, path: Path) -> None:
    """Renames a complete folder to `path` after syncing it to disk.

    Raises:
        OutputExistsError: `path` exists.
    """
    sync_tree(partial)
    require_new(path)
    partial.rename(path)
    sync_folder(path.parent)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """Yields a temporary path for a new file, like `new_folder`."""
    require_new(path)
    with replacement(path, new=True) as partial:
        yield partial


@contextmanager
def replacement(path: Path, new: bool = False) -> Iterator[Path]:
    """Yields a temporary path for a file that replaces `path` at the end of the block.

    Args:
        new: raise OutputExistsError if `path` exists at the end of the block.
    """
    with replacements([path]) as (partial,):
        yield partial
        if new:
            require_new(path)


@contextmanager
def replacements(paths: Sequence[Path]) -> Iterator[list[Path]]:
    """Like `replacement` for several files: all are synced to disk, then renamed in the order of `paths`."""
    partials: list[Path] = []
    try:
        for path in paths:
            with named_errors(path):
                path.parent.mkdir(parents=True, exist_ok=True)
            partials.append(path.parent / f".{path.name}.{_unique()}")
        targets = dict(zip(partials, paths, strict=True))
        with named_errors(Path(os.path.commonpath(paths)) if paths else None, targets=targets):
            yield list(partials)
        for partial, path in targets.items():
            with named_errors(path, partial):
                _sync(partial, _SYNC_FLAGS)
        for partial, path in targets.items():
            with named_errors(path, partial):
                os.replace(partial, path)
        for folder in dict.fromkeys(path.parent for path in paths):
            sync_folder(folder)
    finally:
        for partial in partials:
            with suppress(OSError):
                partial.unlink(missing_ok=True)


def replace_text(path: Path, text: str) -> None:
    """Writes a UTF-8 text file atomically."""
    with replacement(path) as partial:
        partial.write_text(text, encoding="utf-8")


def replace_json(path: Path, value: Any, indent: int = 2, allow_nan: bool = True) -> None:
    """Writes a JSON file atomically."""
    replace_text(path, json.dumps(value, indent=indent, allow_nan=allow_nan) + "\n")


def write_lerobot_json(path: Path, value: Any) -> None:
    """Writes JSON formatted as LeRobot does, into a folder that is not yet published."""
    path.write_text(json.dumps(value, indent=4, ensure_ascii=False), encoding="utf-8")


@contextmanager
def named_errors(
    path: Path | None, partial: Path | None = None, targets: Mapping[Path, Path] | None = None
) -> Iterator[None]:
    """Makes system errors in the block name the file that the user asked for.

    Libraries leave the name out, or give that of a temporary file, which no longer exists when the message is read.

    Args:
        path: the output; used where the error names no file.
        partial: temporary file or folder that becomes `path`.
        targets: final path by temporary path, for several files.
    """
    targets = dict(targets or {})
    if path is not None and partial is not None:
        targets[partial] = path
    try:
        yield
    except OSError as error:
        if error.errno is None and type(error) is not OSError:
            raise  # a network library's error, which has its own message
        if error.errno is None:
            # From h5py or pyarrow: with a file name but no number, str(error) would lose the message.
            error.errno, error.strerror = disk_error_number(error) or errno.EIO, " ".join(str(error).split())
        name = error.filename
        for temporary, target in targets.items():
            if isinstance(name, (str, os.PathLike)) and Path(name).is_relative_to(temporary):
                name = str(target / Path(name).relative_to(temporary))
        if name is None and path is not None:
            name = str(path)
        if name == error.filename:
            raise
        try:
            error.filename = name
        except AttributeError:  # PyAV's errors have a read-only file name
            raise OSError(error.errno, error.strerror, name) from error
        raise
    except Exception as error:
        number = disk_error_number(error)
        if number is None or path is None:
            raise
        # safetensors and torch give the system's error only in their message.
        raise OSError(number, os.strerror(number), str(path)) from error


def disk_error_number(error: BaseException) -> int | None:
    """The errno of an error caused by a full, limited or read-only disk, else None.

    The causes and contexts of the error count too, because libraries wrap system errors in their own.
    """
    for cause in error_chain(error):
        number = getattr(cause, "errno", None)
        if number in _DISK_ERRORS:
            return number
        if isinstance(cause, OSError) and number is not None:
            return None
        number = next((number for number in _DISK_ERRORS if os.strerror(number) in str(cause)), None)
        if number is not None:
            return number
    return None


def error_chain(error: BaseException) -> Iterator[BaseException]:
    """Yields an error, then its cause or context, and so on."""
    chain: list[BaseException] = []
    cause: BaseException | None = error
    while cause is not None and not any(cause is link for link in chain):
        chain.append(cause)
        yield cause
        cause = cause.__cause__ or cause.__context__


def sync_tree(folder: Path) -> None:
    """Syncs a folder and every file and folder below it to disk.

    Files that are already on disk, such as hard links shared by two data sets, cost little.
    """
    for parent, _, names in os.walk(folder, topdown=False):
        for name in names:
            if not Path(parent, name).is_symlink():
                _sync(Path(parent, name), _SYNC_FLAGS)
        sync_folder(Path(parent))


def sync_folder(folder: Path) -> None:
    """Syncs the entries of a folder to disk, where the system supports it (Windows cannot open a folder)."""
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
