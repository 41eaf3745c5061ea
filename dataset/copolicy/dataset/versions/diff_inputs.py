"""Reads the inputs of `copolicy-dataset diff`: a folder, a release of a folder, or a revision on the Hub."""

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..exceptions import FileFormatError
from ..files.json_file import read_json
from ..files.meta_files import STATISTICS_FILE
from ..publication.data_version import TAG_PREFIX
from ..publication.repo_id import repo_id_problem
from .content import read_content
from .digests import Content
from .release_record import read_release


@dataclass(frozen=True)
class DiffInput:
    """One of the two data sets that are compared.

    Attributes:
        statistics: value by path, or `None` if no statistics are stored.
        released_hash: content hash in a release record; it stays known after episodes are withdrawn from the record.
    """

    name: str
    content: Content
    statistics: dict[str, Any] | None
    released_hash: str = ""

    @property
    def content_hash(self) -> str:
        return self.released_hash or self.content.hash


def read_diff_input(text: str) -> DiffInput:
    """Reads `FOLDER`, `FOLDER@1.0.0`, `U/N` or `U/N@REVISION`; an existing folder takes precedence.

    For a release the digests in its record suffice. A revision on the Hub is downloaded and read like a folder.

    Raises:
        FileFormatError: no such folder or name, or not a data set.
        UnknownNameError: no such release.
        HubError: the Hub does not answer, or has no such data set or revision.
    """
    if Path(text).is_dir():
        return DiffInput(text, read_content(Path(text)), read_statistics(Path(text)))
    name, _, revision = text.rpartition("@") if "@" in text else (text, "", "")
    if revision and Path(name).is_dir():
        record = read_release(Path(name), revision)
        return DiffInput(text, record.content, None, record.content_hash)
    if repo_id_problem(name) is None:
        from ..files.meta_files import RAW_FOLDER
        from ..hub.repository import download, resolve

        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder) / "data_set"
            download(name, root, resolve(name, revision or None)[1], skip=f"{RAW_FOLDER}/*")
            return DiffInput(text, read_content(root), read_statistics(root))
    raise FileFormatError(text, f"a folder, FOLDER@{TAG_PREFIX}x.y.z, or U/N[@REVISION] on the Hub", "none of them")


def read_statistics(root: Path) -> dict[str, Any] | None:
    """The stored statistics of a folder as value by path, `None` if there are none.

    Raises:
        FileFormatError: not a JSON object.
    """
    path = root / STATISTICS_FILE
    if not path.exists():
        return None
    return dict(_flatten(read_json(path, dict, "statistics of copolicy-dataset stats")))


def compare_statistics(before: dict[str, Any], after: dict[str, Any]) -> dict[str, tuple[Any, Any]]:
    """The values that differ, before and after; `None` stands for a missing value."""
    names = [*before, *(name for name in after if name not in before)]
    return {
        name: (before.get(name), after.get(name)) for name in names if not _equal(before.get(name), after.get(name))
    }


def _flatten(value: Any, name: str = ""):
    if isinstance(value, dict) and value:
        for key, item in value.items():
            yield from _flatten(item, f"{name}.{key}" if name else str(key))
    elif isinstance(value, list) and any(isinstance(item, (dict, list)) for item in value):
        for index, item in enumerate(value):
            yield from _flatten(item, f"{name}[{index}]")
    else:
        yield name, value


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, float) and isinstance(b, float) and math.isnan(a) and math.isnan(b):
        return True
    return a == b
