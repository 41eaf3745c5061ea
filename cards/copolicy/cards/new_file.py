"""A file that appears complete or not at all."""

import os
from pathlib import Path

from copolicy.dataset.exceptions import OutputExistsError


def require_new(path: Path, overwrite: bool) -> None:
    """Checks that nothing would be overwritten that should not be.

    Raises:
        OutputExistsError: there is something at `path` and `overwrite` is off.
    """
    if path.exists() and not overwrite:
        raise OutputExistsError(path)


def write_whole(path: Path, text: str) -> None:
    """Writes beside `path` and renames."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".part")
    partial.write_text(text, encoding="utf-8")
    os.replace(partial, path)
