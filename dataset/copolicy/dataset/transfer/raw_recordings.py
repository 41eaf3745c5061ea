"""Which raw recordings go up with a data set: those that its episodes were made from, and no other."""

from dataclasses import dataclass
from pathlib import Path

from ..exceptions import FileFormatError, RunError
from ..files.listing import distinct_files
from ..files.meta_files import RAW_FOLDER
from ..lerobot_folder.folder import LeRobotFolder
from ..versions.manifest import FileEntry, Manifest, file_entry


@dataclass(frozen=True)
class RawRecordings:
    """Recordings by their path in the repository.

    Attributes:
        left_out: names of recordings that no episode was made from (discarded, withdrawn, another session).
    """

    files: dict[str, Path]
    manifest: Manifest
    left_out: list[str]


def find_raw_recordings(root: Path, folder: Path) -> RawRecordings:
    """The recordings in `folder` of the episodes in the data set at `root`, matched by their sha256.

    Raises:
        FileFormatError: no recording in `folder`.
        RunError: an episode's recording is not among them.
    """
    paths = distinct_files(folder, "*.mcap")
    if not paths:
        raise FileFormatError(folder, "recordings (*.mcap)", "none")
    wanted = _sources(root)
    files: dict[str, Path] = {}
    entries: dict[str, FileEntry] = {}
    left_out = []
    found = set()
    for path in paths:
        if not path.exists():
            raise FileFormatError(path, "a recording", "a broken link")
        entry = file_entry(path)
        if entry.sha256 in wanted and entry.sha256 not in found:
            name = f"{RAW_FOLDER}/{path.relative_to(folder).as_posix()}"
            files[name], entries[name] = path, entry
            found.add(entry.sha256)
        else:
            left_out.append(path.name)
    missing = [uuid for sha256, uuid in wanted.items() if sha256 not in found]
    if missing:
        raise RunError(
            f"{folder}: expected the recording of every episode, "
            f"found none of {len(missing)}, first of episode {missing[0]}"
        )
    return RawRecordings(files, Manifest(entries), left_out)


def still_wanted(root: Path, published: Manifest) -> Manifest:
    """The recordings on the Hub whose episodes are still in the data set at `root`.

    A recording goes when its episode goes: that may be because a person withdrew.
    """
    wanted = _sources(root)
    return Manifest({name: entry for name, entry in published.files.items() if entry.sha256 in wanted})


def _sources(root: Path) -> dict[str, str]:
    """`episode_uuid` by the sha256 of the recording that the episode was made from."""
    rows = LeRobotFolder.open(root).rows(("episode_uuid", "source_sha256"))
    return {row["source_sha256"]: row["episode_uuid"] for row in rows}
