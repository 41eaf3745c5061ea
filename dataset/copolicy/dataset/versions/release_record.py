"""The record of a release, `meta/copolicy_release.json`: its version and the digests of its content."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from ..exceptions import FileFormatError, UnknownNameError
from ..files.json_file import convert_json, read_json
from ..files.listing import visible_files
from ..files.meta_files import EARLIER_FOLDER, RELEASE_FILE
from ..publication.data_version import DataVersion
from .digests import Content
from .withdrawals import is_anonymous

_SCHEMA = "copolicy-release-1"


@dataclass(frozen=True)
class ReleaseRecord:
    """A release of a data set.

    Attributes:
        date: UTC, `YYYY-MM-DD`.
        changes: changes since the previous release, one line each.
        files_sha256: digest of all other files; it changes with the card or the storage layout.
        content: digests of each episode, feature and episode column.
        withdrawn: number of episodes that participants had withdrawn before this release.
    """

    version: str
    date: str
    notes: str
    changes: list[str]
    content_hash: str
    files_sha256: str
    content: Content
    withdrawn: int = 0

    @property
    def data_version(self) -> DataVersion:
        return DataVersion.parse(self.version)

    def to_text(self) -> str:
        """The record as JSON text."""
        record = {"schema": _SCHEMA, "tag": self.data_version.tag, **asdict(self)}
        if not self.withdrawn:
            del record["withdrawn"]  # readers of earlier versions do not know this key
        return json.dumps(record, indent=1) + "\n"

    @classmethod
    def read(cls, path: Path) -> "ReleaseRecord":
        """Reads a record.

        Raises:
            FileFormatError: no such file, or not a release record.
        """
        description = f"the record of a release ({_SCHEMA})"
        stored = read_json(path, dict, description)
        record = convert_json(stored, cls, description, path)
        if stored.get("schema") != _SCHEMA:
            raise FileFormatError(path, description, f"schema {stored.get('schema')!r}")
        # Episodes withdrawn after the release have no digest, so the hash cannot be recomputed.
        anonymous = any(is_anonymous(episode) for episode in record.content.episodes)
        if not anonymous and record.content.hash != record.content_hash:
            raise FileFormatError(path, description, "a content hash that is not that of the episodes listed")
        _ = record.data_version
        return record


def read_release(root: Path, version: str | None = None) -> ReleaseRecord:
    """Reads the record of the newest release in a folder, or of the given version.

    Raises:
        FileFormatError: no release, or a damaged record.
        InvalidValueError: `version` is not a version number.
        UnknownNameError: the folder has no release of that version.
    """
    if not (root / RELEASE_FILE).exists():
        raise FileFormatError(root, f"a release ({RELEASE_FILE}); make one with copolicy-dataset release", "none")
    newest = ReleaseRecord.read(root / RELEASE_FILE)
    if version is None:
        return newest
    version_text = str(DataVersion.parse(version))
    if version_text == newest.version:
        return newest
    path = root / EARLIER_FOLDER / f"{version_text}.json"
    if not path.exists():
        earlier = [file.stem for file in visible_files(root / EARLIER_FOLDER, "*.json")]
        raise UnknownNameError(f"release of {root}", version_text, [newest.version, *earlier])
    return ReleaseRecord.read(path)
