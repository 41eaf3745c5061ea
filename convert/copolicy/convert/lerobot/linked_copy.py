"""Copies a data set by hard links, so that files can be added to the copy before it replaces the original."""

import os
import shutil
from pathlib import Path

from copolicy.dataset.episode import LATER_COLUMNS, UNKNOWN_VALUES
from copolicy.dataset.exceptions import FileFormatError, MissingExtraError
from copolicy.dataset.files.listing import broken_links
from copolicy.dataset.files.meta_files import EPISODES_FOLDER
from copolicy.dataset.lerobot_folder.references import chunk_files
from copolicy.dataset.lerobot_folder.tables import read_parquet

from .shifted_tables import write_with_schema

try:
    import pyarrow as pa
except ModuleNotFoundError:
    raise MissingExtraError("pyarrow") from None

_FOLDERS = ("data", "meta", "videos")
"""Folders of a data set that get new files."""


def copy_as_links(source: Path, target: Path) -> None:
    """Copies the folder `source` to `target` with hard links for files; `data`, `meta` and `videos` become folders.

    Other symbolic links are copied as links, since they may point to recordings.

    Raises:
        FileFormatError: `data`, `meta` or `videos` holds a broken link.
    """
    target.mkdir()
    for path in source.iterdir():
        if path.name in _FOLDERS and path.is_dir():
            for link in broken_links(path):
                raise FileFormatError(link, "a file of the data set", "a broken link")
            shutil.copytree(path, target / path.name, copy_function=_link, ignore_dangling_symlinks=True)
        elif path.is_symlink():
            (target / path.name).symlink_to(os.readlink(path))
        elif path.is_dir():
            shutil.copytree(path, target / path.name, symlinks=True, copy_function=_link)
        else:
            _link(str(path), str(target / path.name))
    shutil.copystat(source, target)


def add_later_columns(root: Path) -> list[str]:
    """Adds the episode columns that earlier versions lacked, with unknown values; returns the added names."""
    added: list[str] = []
    for path in chunk_files(root / EPISODES_FOLDER).values():
        table = read_parquet(path)
        missing = [name for name in LATER_COLUMNS if name not in table.column_names]
        for name in missing:
            table = table.append_column(name, pa.array([UNKNOWN_VALUES[name]] * table.num_rows))
        if missing:
            path.unlink()  # a hard link: writing to it would change the data set in use
            write_with_schema(table, table.schema, path)
        added += [name for name in missing if name not in added]
    return added


def _link(source: str, target: str) -> None:
    try:
        os.link(os.path.realpath(source), target)
    except OSError:  # a file system without hard links
        shutil.copy2(source, target)
