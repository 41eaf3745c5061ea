"""Replaces a data set folder by a rewritten one; an interruption leaves the old or the new folder."""

import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .staging import named_errors, sync_folder, sync_tree

_BEFORE = "before-edit"
_DELETED = "deleted"
_INTERRUPTED = re.compile(rf"\.(?P<name>.+)\.(?P<kind>{_BEFORE}|before-append|{_DELETED})")
_UNFINISHED = re.compile(r"\..+\.(?:(?:[0-9a-f]{8}|[0-9a-f]{12})\.partial|merging)")


@contextmanager
def replaced_folder(root: Path) -> Iterator[Path]:
    """Yields a path beside `root` for its new content, which replaces `root` at the end of the block.

    Between the two renames the old content has a hidden name; after a crash `finish_interrupted` restores it. The old
    content is deleted at the end.
    """
    target = root.resolve()
    partial = target.parent / f".{target.name}.{secrets.token_hex(4)}.partial"
    try:
        with named_errors(root, partial):
            yield partial
            backup = swap_folders(partial, target)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        finish_interrupted(root)
        raise
    shutil.rmtree(backup)


def swap_folders(complete: Path, target: Path) -> Path:
    """Replaces `target` by a complete folder; returns the path that `target` was renamed to, to be deleted."""
    sync_tree(complete)
    backup = target.parent / f".{target.name}.{_BEFORE}"
    target.rename(backup)
    complete.rename(target)
    sync_folder(target.parent)
    return backup


def finish_interrupted(root: Path) -> None:
    """Undoes or completes an interrupted edit or append of a data set."""
    target = root.resolve()
    if not target.parent.is_dir():
        return
    for backup in sorted(target.parent.glob(".*")):
        match = _INTERRUPTED.fullmatch(backup.name)
        if match and match["name"] == target.name and backup.is_dir():
            if match["kind"] == _DELETED or os.path.lexists(target):
                shutil.rmtree(backup)
            else:
                backup.rename(target)


def delete_folder(root: Path) -> None:
    """Deletes a folder; `finish_interrupted` completes an interrupted deletion."""
    target = root.resolve()
    hidden = target.parent / f".{target.name}.{_DELETED}"
    target.rename(hidden)
    shutil.rmtree(hidden)
    sync_folder(target.parent)


def finish_all_interrupted(folder: Path) -> None:
    """Calls `finish_interrupted` for every data set in a folder."""
    for entry in sorted(folder.iterdir()):
        if match := _INTERRUPTED.fullmatch(entry.name):
            finish_interrupted(folder / match["name"])


def is_unfinished(name: str) -> bool:
    """Whether a folder of this name is being written, or was left unfinished by a killed command."""
    return _UNFINISHED.fullmatch(name) is not None
