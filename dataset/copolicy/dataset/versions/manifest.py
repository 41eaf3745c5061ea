"""The files of a data set with size and sha256: `meta/manifest.json`."""

import hashlib
import json
from collections.abc import Collection
from dataclasses import asdict, dataclass
from pathlib import Path

from ..exceptions import FileFormatError
from ..files.json_file import convert_json, parse_json, read_json
from ..files.listing import is_hidden, visible_files
from ..files.meta_files import MANIFEST_FILE, RAW_FOLDER
from .digests import digest

_SCHEMA = "copolicy-manifest-1"
_WHAT = f"a manifest ({_SCHEMA})"
_NO_DATA = ("images", RAW_FOLDER)


@dataclass(frozen=True)
class FileEntry:
    """One file."""

    size: int
    sha256: str


@dataclass(frozen=True)
class _File:
    schema: str
    files: dict[str, FileEntry]


@dataclass(frozen=True)
class Manifest:
    """Files by their path below the folder, with forward slashes."""

    files: dict[str, FileEntry]

    @classmethod
    def of_folder(cls, root: Path) -> "Manifest":
        """Hashes the files of a folder, without the manifest itself and without what belongs to no data set.

        Those are hidden files and folders (`.cache`, `.gitattributes`, `._NAME` of macOS); `images/`, where LeRobot
        keeps pictures until they are encoded; and `raw/`, the recordings behind a data set, which have a manifest of
        their own.
        """
        return cls({name: file_entry(root / name) for name in data_set_files(root)})

    @classmethod
    def read(cls, path: Path) -> "Manifest":
        """Reads a manifest.

        Raises:
            FileFormatError: none there, or something else.
        """
        return cls._of(read_json(path, dict, _WHAT), path)

    @classmethod
    def from_text(cls, text: str, path: Path | str = MANIFEST_FILE) -> "Manifest":
        """The inverse of `to_text`.

        Args:
            path: where the text is from, for the error.

        Raises:
            FileFormatError: something else.
        """
        return cls._of(parse_json(text, dict, _WHAT, path), path)

    @classmethod
    def _of(cls, fields: dict, path: Path | str) -> "Manifest":
        stored = convert_json(fields, _File, _WHAT, path)
        if stored.schema != _SCHEMA:
            raise FileFormatError(path, _WHAT, f"schema {stored.schema!r}")
        return cls(stored.files)

    def to_text(self) -> str:
        """The text of the file."""
        return json.dumps(asdict(_File(_SCHEMA, dict(sorted(self.files.items())))), indent=2) + "\n"

    def differences(self, other: "Manifest", without: Collection[str] = ()) -> list[str]:
        """One line for each file but some that is not the same in both; `other` is what was found."""
        lines = []
        for name in sorted((self.files.keys() | other.files.keys()).difference(without)):
            told, found = self.files.get(name), other.files.get(name)
            if found is None:
                lines.append(f"{name} is missing")
            elif told is None:
                lines.append(f"{name} is not in the manifest")
            elif told != found:
                lines.append(f"{name} has other content")
        return lines

    def digest(self, without: Collection[str] = ()) -> str:
        """One sha256 over all entries but some."""
        return digest({name: entry.sha256 for name, entry in self.files.items() if name not in without})


def data_set_files(root: Path) -> list[str]:
    """What `Manifest.of_folder` hashes, sorted."""
    paths = (path for path in root.iterdir() if not is_hidden(path.name) and path.name not in _NO_DATA)
    files = [file for path in paths for file in (visible_files(path, "*") if path.is_dir() else [path])]
    names = (file.relative_to(root).as_posix() for file in files)
    return sorted(name for name in names if name != MANIFEST_FILE)


def file_entry(path: Path) -> FileEntry:
    """Size and sha256 of a file, read once.

    Raises:
        FileFormatError: it is a link that leads nowhere.
        OSError: it cannot be read.
    """
    if path.is_symlink() and not path.exists():
        raise FileFormatError(path, "a file", "a link that leads nowhere")
    with path.open("rb") as file:
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        return FileEntry(file.tell(), sha256)
