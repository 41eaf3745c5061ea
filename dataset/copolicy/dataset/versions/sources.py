"""What `copolicy-dataset diff` compares: a folder, a release of a folder, or a revision on the Hub."""

import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..exceptions import FileFormatError
from ..publication.data_version import TAG_PREFIX
from .content import read_content
from .digests import Content
from .release_record import read_release
from .statistics import read_statistics


@dataclass(frozen=True)
class Side:
    """One of the two that are compared.

    Attributes:
        statistics: value by path, or `None` where none are stored.
    """

    name: str
    content: Content
    statistics: dict[str, Any] | None
    released_hash: str = ""  # of a release, which is known even where episodes were withdrawn from its record

    @property
    def content_hash(self) -> str:
        return self.released_hash or self.content.hash


def read_side(text: str) -> Side:
    """Reads `FOLDER`, `FOLDER@1.0.0`, `U/N` or `U/N@REVISION`; what exists as a folder is one.

    A release of a folder is known by the digests in its record; its files are not needed. A revision on the Hub is
    downloaded and read like a folder.

    Raises:
        FileFormatError: nothing by this name, or no data set.
        UnknownNameError: no such release.
        HubError: the Hub does not answer, or has no such data set or revision.
    """
    if Path(text).is_dir():
        return Side(text, read_content(Path(text)), read_statistics(Path(text)))
    name, _, revision = text.rpartition("@") if "@" in text else (text, "", "")
    if revision and Path(name).is_dir():
        record = read_release(Path(name), revision)
        return Side(text, record.content, None, record.content_hash)
    if re.fullmatch(r"[\w.-]+/[\w.-]+", name):
        from ..files.meta_files import RAW_FOLDER
        from ..hub.download import download, resolve

        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder) / "data_set"
            download(name, root, resolve(name, revision or None)[1], skip=f"{RAW_FOLDER}/*")
            return Side(text, read_content(root), read_statistics(root))
    raise FileFormatError(text, f"a folder, FOLDER@{TAG_PREFIX}x.y.z, or U/N[@REVISION] on the Hub", "none of them")
