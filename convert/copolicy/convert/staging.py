"""A folder or file that appears complete or not at all."""

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from copolicy.dataset.exceptions import OutputExistsError


def require_new(path: Path) -> None:
    """Checks that there is nothing at `path`.

    Raises:
        OutputExistsError: there is something, be it a broken link.
    """
    if os.path.lexists(path):
        raise OutputExistsError(path)


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """A path beside `path` to build a folder at, renamed to `path` at the end of the block and removed on any error.

    Raises:
        OutputExistsError: there is something at `path`, before the block or after it.
    """
    require_new(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.parent / f".{path.name}.{secrets.token_hex(4)}.partial"
    try:
        yield partial
        require_new(path)
        partial.rename(path)
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
        require_new(path)
        partial.rename(path)
    finally:
        partial.unlink(missing_ok=True)
