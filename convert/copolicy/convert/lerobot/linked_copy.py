"""A data set beside another one that shares its files by hard links, to be added to before it takes its place."""

import os
import shutil
from pathlib import Path

from copolicy.dataset.episode import LATER_COLUMNS, UNKNOWN_VALUES
from copolicy.dataset.exceptions import FileFormatError, MissingExtraError
from copolicy.dataset.files.listing import broken_links
from copolicy.dataset.files.meta_files import EPISODES_FOLDER
from copolicy.dataset.lerobot_folder.references import chunk_files
from copolicy.dataset.lerobot_folder.tables import read_parquet

from .shifted_tables import write_like

try:
    import pyarrow as pa
except ModuleNotFoundError:
    raise MissingExtraError("pyarrow") from None

_WRITTEN = ("data", "meta", "videos")
"""Folders of a data set that new files are put into."""


def copy_as_links(place: Path, whole: Path) -> None:
    """A folder like `place`: its files by hard links, `data`, `meta` and `videos` as folders of its own.

    What else is a link stays one: recordings may lie behind it.

    Raises:
        FileFormatError: a link in one of the three leads nowhere.
    """
    whole.mkdir()
    for path in place.iterdir():
        if path.name in _WRITTEN and path.is_dir():
            for link in broken_links(path):
                raise FileFormatError(link, "a file of the data set", "a link that leads nowhere")
            shutil.copytree(path, whole / path.name, copy_function=_link, ignore_dangling_symlinks=True)
        elif path.is_symlink():
            (whole / path.name).symlink_to(os.readlink(path))
        elif path.is_dir():
            shutil.copytree(path, whole / path.name, symlinks=True, copy_function=_link)
        else:
            _link(str(path), str(whole / path.name))
    shutil.copystat(place, whole)


def add_later_columns(whole: Path) -> list[str]:
    """Gives the episodes of an earlier version the columns that it lacked, as not known; returns their names."""
    added: list[str] = []
    for path in chunk_files(whole / EPISODES_FOLDER).values():
        table = read_parquet(path)
        missing = [name for name in LATER_COLUMNS if name not in table.column_names]
        for name in missing:
            table = table.append_column(name, pa.array([UNKNOWN_VALUES[name]] * table.num_rows))
        if missing:
            path.unlink()  # a link: writing into it would change the data set in use
            write_like(table, table.schema, path)
        added += [name for name in missing if name not in added]
    return added


def _link(source: str, target: str) -> None:
    try:
        os.link(os.path.realpath(source), target)
    except OSError:  # a file system without hard links
        shutil.copy2(source, target)
