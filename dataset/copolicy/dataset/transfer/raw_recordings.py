"""Selects the raw recordings to publish with a data set: only those that its episodes were made from."""

from dataclasses import dataclass
from pathlib import Path

from ..exceptions import FileFormatError, RunError
from ..files.listing import distinct_files
from ..files.meta_files import RAW_FOLDER
from ..lerobot_folder.folder import LeRobotFolder
from ..versions.manifest import FileEntry, Manifest, file_entry


@dataclass(frozen=True)
class RawRecordings:
    """Recordings to upload.

    Attributes:
        files: local file by path in the repository.
        left_out: names of recordings without an episode (discarded, withdrawn, another session).
    """

    files: dict[str, Path]
    manifest: Manifest
    left_out: list[str]


def find_raw_recordings(root: Path, folder: Path) -> RawRecordings:
    """Finds the recordings in `folder` of the episodes in the data set at `root` by their sha256.

    Raises:
        FileFormatError: no recording in `folder`.
        RunError: the recording of an episode is missing.
    """
    paths = distinct_files(folder, "*.mcap")
    if not paths:
        raise FileFormatError(folder, "recordings (*.mcap)", "none")
    episodes_by_sha256 = _episodes_by_sha256(root)
    files: dict[str, Path] = {}
    entries: dict[str, FileEntry] = {}
    left_out = []
    matched = set()
    for path in paths:
        if not path.exists():
            raise FileFormatError(path, "a recording", "a broken link")
        entry = file_entry(path)
        if entry.sha256 in episodes_by_sha256 and entry.sha256 not in matched:
            name = f"{RAW_FOLDER}/{path.relative_to(folder).as_posix()}"
            files[name], entries[name] = path, entry
            matched.add(entry.sha256)
        else:
            left_out.append(path.name)
    missing = [uuid for sha256, uuid in episodes_by_sha256.items() if sha256 not in matched]
    if missing:
        raise RunError(
            f"{folder}: expected the recording of every episode, "
            f"found {len(missing)} missing, first that of episode {missing[0]}"
        )
    return RawRecordings(files, Manifest(entries), left_out)


def remaining_recordings(root: Path, published: Manifest) -> Manifest:
    """The recordings on the Hub whose episodes are still in the data set at `root`.

    The others are deleted, because an episode may be missing since a participant withdrew it.
    """
    sources = _episodes_by_sha256(root)
    return Manifest({name: entry for name, entry in published.files.items() if entry.sha256 in sources})


def _episodes_by_sha256(root: Path) -> dict[str, str]:
    """`episode_uuid` by the sha256 of the recording that the episode was made from."""
    rows = LeRobotFolder.open(root).rows(("episode_uuid", "source_sha256"))
    return {row["source_sha256"]: row["episode_uuid"] for row in rows}
