"""The manifest of a data set, `meta/manifest.json`: size and sha256 of each file."""

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
_DESCRIPTION = f"a manifest ({_SCHEMA})"
_SKIPPED = ("images", RAW_FOLDER)


@dataclass(frozen=True)
class FileEntry:
    """Size in bytes and sha256 of a file."""

    size: int
    sha256: str


@dataclass(frozen=True)
class _ManifestDocument:
    schema: str
    files: dict[str, FileEntry]


@dataclass(frozen=True)
class Manifest:
    """Files by path relative to the folder, with forward slashes."""

    files: dict[str, FileEntry]

    @classmethod
    def from_folder(cls, root: Path) -> "Manifest":
        """Hashes the files of a folder, except the manifest itself and files that do not belong to the data set.

        These are hidden files and folders (`.cache`, `.gitattributes`, `._NAME` of macOS); `images/`, where LeRobot
        stores images until they are encoded; and `raw/`, recordings with their own manifest.
        """
        return cls({name: file_entry(root / name) for name in data_set_files(root)})

    @classmethod
    def read(cls, path: Path) -> "Manifest":
        """Reads a manifest.

        Raises:
            FileFormatError: no such file, or not a manifest.
        """
        return cls._from_fields(read_json(path, dict, _DESCRIPTION), path)

    @classmethod
    def from_text(cls, text: str, path: Path | str = MANIFEST_FILE) -> "Manifest":
        """Parses the text of `to_text`.

        Args:
            path: source of the text, for error messages.

        Raises:
            FileFormatError: not a manifest.
        """
        return cls._from_fields(parse_json(text, dict, _DESCRIPTION, path), path)

    @classmethod
    def _from_fields(cls, fields: dict, path: Path | str) -> "Manifest":
        stored = convert_json(fields, _ManifestDocument, _DESCRIPTION, path)
        if stored.schema != _SCHEMA:
            raise FileFormatError(path, _DESCRIPTION, f"schema {stored.schema!r}")
        return cls(stored.files)

    def to_text(self) -> str:
        """The manifest as JSON text."""
        return json.dumps(asdict(_ManifestDocument(_SCHEMA, dict(sorted(self.files.items())))), indent=2) + "\n"

    def differences(self, other: "Manifest", without: Collection[str] = ()) -> list[str]:
        """Lists the files, except `without`, that differ from those in `other`, one line each."""
        lines = []
        for name in sorted((self.files.keys() | other.files.keys()).difference(without)):
            expected, found = self.files.get(name), other.files.get(name)
            if found is None:
                lines.append(f"{name} is missing")
            elif expected is None:
                lines.append(f"{name} is not in the manifest")
            elif expected != found:
                lines.append(f"{name} has other content")
        return lines

    def digest(self, without: Collection[str] = ()) -> str:
        """One sha256 over all entries except `without`."""
        return digest({name: entry.sha256 for name, entry in self.files.items() if name not in without})


def data_set_files(root: Path) -> list[str]:
    """Paths of the files that `Manifest.from_folder` hashes, sorted."""
    paths = (path for path in root.iterdir() if not is_hidden(path.name) and path.name not in _SKIPPED)
    files = [file for path in paths for file in (visible_files(path, "*") if path.is_dir() else [path])]
    names = (file.relative_to(root).as_posix() for file in files)
    return sorted(name for name in names if name != MANIFEST_FILE)


def file_entry(path: Path) -> FileEntry:
    """Reads a file once and returns its size and sha256.

    Raises:
        FileFormatError: a broken link.
        OSError: the file cannot be read.
    """
    if path.is_symlink() and not path.exists():
        raise FileFormatError(path, "a file", "a broken link")
    with path.open("rb") as file:
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        return FileEntry(file.tell(), sha256)
