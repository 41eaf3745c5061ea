"""Puts a rewritten data set in the place of the old one, so that an interruption leaves the old or the new."""

import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .staging import about, sync_folder, sync_tree

_BEFORE = "before-edit"
_DELETED = "deleted"
_LEFT = re.compile(rf"\.(?P<name>.+)\.(?P<kind>{_BEFORE}|before-append|{_DELETED})")
_UNFINISHED = re.compile(r"\..+\.(?:(?:[0-9a-f]{8}|[0-9a-f]{12})\.partial|merging)")


@contextmanager
def replaced_folder(root: Path) -> Iterator[Path]:
    """A path beside `root` to build its new content at; at the end of the block it takes the place of `root`.

    Between the two renamings the old content lies under a hidden name, from where `finish_interrupted` brings it
    back. The old content is deleted at the end.
    """
    target = root.resolve()
    partial = target.parent / f".{target.name}.{secrets.token_hex(4)}.partial"
    try:
        with about(root, partial):
            yield partial
            before = take_place(partial, target)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        finish_interrupted(root)
        raise
    shutil.rmtree(before)


def take_place(whole: Path, place: Path) -> Path:
    """Puts a complete folder in the place of another one; returns where the old one lies, to be deleted."""
    sync_tree(whole)
    before = place.parent / f".{place.name}.{_BEFORE}"
    place.rename(before)
    whole.rename(place)
    sync_folder(place.parent)
    return before


def finish_interrupted(root: Path) -> None:
    """Undoes or completes what an interrupted edit, or an interrupted append, left of a data set."""
    place = root.resolve()
    if not place.parent.is_dir():
        return
    for before in sorted(place.parent.glob(".*")):
        match = _LEFT.fullmatch(before.name)
        if match and match["name"] == place.name and before.is_dir():
            if match["kind"] == _DELETED or os.path.lexists(place):
                shutil.rmtree(before)
            else:
                before.rename(place)


def delete_folder(root: Path) -> None:
    """Deletes a folder; where that is interrupted, the next call for it deletes the rest and never brings it back."""
    place = root.resolve()
    hidden = place.parent / f".{place.name}.{_DELETED}"
    place.rename(hidden)
    shutil.rmtree(hidden)
    sync_folder(place.parent)


def finish_all_interrupted(folder: Path) -> None:
    """The same for every data set in a folder."""
    for entry in sorted(folder.iterdir()):
        if match := _LEFT.fullmatch(entry.name):
            finish_interrupted(folder / match["name"])


def is_unfinished(name: str) -> bool:
    """Whether a folder of this name is in the making, or is what a killed command left of one."""
    return _UNFINISHED.fullmatch(name) is not None
