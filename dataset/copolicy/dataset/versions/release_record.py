"""The record of a release, `meta/copolicy_release.json`: its version and everything to compare a later state with."""

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
    """One release.

    Attributes:
        date: UTC, `YYYY-MM-DD`.
        changes: what changed since the release before, a line each.
        files_sha256: digest of all other files, which tells that a card or the layout changed.
        content: digests of each episode, feature and episode column.
        withdrawn: episodes that people had withdrawn by then.
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
        """The text of the file."""
        record = {"schema": _SCHEMA, "tag": self.data_version.tag, **asdict(self)}
        if not self.withdrawn:
            del record["withdrawn"]  # as readers of earlier versions expect it
        return json.dumps(record, indent=1) + "\n"

    @classmethod
    def read(cls, path: Path) -> "ReleaseRecord":
        """Reads a record.

        Raises:
            FileFormatError: none there, or something else.
        """
        what = f"the record of a release ({_SCHEMA})"
        stored = read_json(path, dict, what)
        record = convert_json(stored, cls, what, path)
        if stored.get("schema") != _SCHEMA:
            raise FileFormatError(path, what, f"schema {stored.get('schema')!r}")
        # What was withdrawn after the release has no digest any more.
        anonymous = any(is_anonymous(episode) for episode in record.content.episodes)
        if not anonymous and record.content.hash != record.content_hash:
            raise FileFormatError(path, what, "a content hash that is not that of the episodes listed")
        _ = record.data_version
        return record


def read_release(root: Path, version: str | None = None) -> ReleaseRecord:
    """The record of the newest release in a folder, or of an earlier one.

    Raises:
        FileFormatError: no release there, or a damaged record.
        InvalidValueError: `version` is none.
        UnknownNameError: that version was never released here.
    """
    if not (root / RELEASE_FILE).exists():
        raise FileFormatError(root, f"a release ({RELEASE_FILE}); make one with copolicy-dataset release", "none")
    newest = ReleaseRecord.read(root / RELEASE_FILE)
    if version is None:
        return newest
    wanted = str(DataVersion.parse(version))
    if wanted == newest.version:
        return newest
    path = root / EARLIER_FOLDER / f"{wanted}.json"
    if not path.exists():
        earlier = [file.stem for file in visible_files(root / EARLIER_FOLDER, "*.json")]
        raise UnknownNameError(f"release of {root}", wanted, [newest.version, *earlier])
    return ReleaseRecord.read(path)
