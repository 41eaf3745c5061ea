"""Replaces a data set by a copy without withdrawn episodes and without their names in any file."""

import os
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...exceptions import CopolicyError
from ...files.meta_files import (
    CARD_FILE,
    CHANGELOG_FILE,
    CHECK_FILE,
    CROISSANT_FILE,
    EARLIER_FOLDER,
    EPISODES_FOLDER,
    INFO_FILE,
    MANIFEST_FILE,
    RAW_FOLDER,
    RAW_MANIFEST_FILE,
    RECORD_FILE,
    RELEASE_FILE,
    STATISTICS_FILE,
    STATS_FILE,
    TASKS_FILE,
    WITHDRAWALS_FILE,
)
from ...files.replace_folder import delete_folder, is_unfinished, replaced_folder
from ...versions.digests import EpisodeContent
from ...versions.manifest import Manifest
from ...versions.release_record import ReleaseRecord
from ...versions.withdrawals import anonymise, read_withdrawals, withdrawals_text
from ..amend import today
from ..subset.stored_set import StoredSet, drop_notes, write_record
from ..subset.writing import remaining_splits, write_subset
from .traces import Traces

PEOPLE_COLUMNS = ("pair_id", "player_0_id", "player_1_id", "session_id")
"""Episode columns with pseudonyms, which are removed if no remaining episode has them."""

REGENERATED = {
    CARD_FILE: "copolicy-cards dataset",
    "figures": "copolicy-cards dataset",
    CROISSANT_FILE: "copolicy-cards dataset --croissant",
    "report.html": "copolicy-cards report",
    CHECK_FILE: "copolicy-dataset check",
    STATISTICS_FILE: "copolicy-dataset stats",
    MANIFEST_FILE: "copolicy-dataset release",
}
"""Files about all episodes, and the command that writes each again."""

_DROPPED = ("images", ".cache")  # frames that are not encoded yet, and notes of the Hub's client on all files

_WRITTEN = {"data", "videos", EPISODES_FOLDER, *_DROPPED} | {
    INFO_FILE,
    STATS_FILE,
    TASKS_FILE,
    RECORD_FILE,
    WITHDRAWALS_FILE,
}


@dataclass(frozen=True)
class AffectedDataSet:
    """A data set with withdrawn episodes.

    Attributes:
        numbers: numbers of the withdrawn episodes.
        recordings: withdrawn recordings below `raw/`, as paths relative to the folder.
    """

    stored: StoredSet
    numbers: tuple[int, ...]
    recordings: tuple[str, ...]

    @property
    def root(self) -> Path:
        return self.stored.root

    @property
    def remaining(self) -> list[int]:
        """Numbers of the other episodes."""
        withdrawn = set(self.numbers)
        return [row["episode_index"] for row in self.stored.rows if row["episode_index"] not in withdrawn]


def remove_withdrawn(data_set: AffectedDataSet, traces: Traces, episodes: int) -> dict[str, Any]:
    """Rewrites a data set without its withdrawn episodes, or deletes it if no episode remains.

    Args:
        episodes: number of episodes for the record of the withdrawal.

    Returns:
        Files that still contain a name.
    """
    root, source = data_set.root, data_set.stored
    withdrawn, numbers = set(data_set.numbers), data_set.remaining
    for path in _unfinished_beside(root):
        shutil.rmtree(path)
    if not numbers:
        delete_folder(root)
        return {}
    with replaced_folder(root) as partial:
        write_subset(source, numbers, partial, remaining_splits(source.info, numbers))
        _link_other_files(root, partial, set(data_set.recordings))
        uuids = {source.rows[number]["episode_uuid"] for number in withdrawn}
        write_record(partial, traces.redact_json(drop_notes(source.record, uuids)))
        _clean_releases(partial, traces, [source.content.episodes[number] for number in sorted(withdrawn)])
        entries = [*read_withdrawals(root), *([{"date": today(), "episodes": episodes}] if episodes else [])]
        if entries:
            (partial / WITHDRAWALS_FILE).write_text(withdrawals_text(entries), encoding="utf-8")
        files_with_names = [path.relative_to(partial).as_posix() for path in traces.matching_files(partial)]
    return {"still_named_in": files_with_names} if files_with_names else {}


def _link_other_files(root: Path, partial: Path, withdrawn: set[str]) -> None:
    """Links all files except withdrawn recordings and files that are rewritten or regenerated."""
    dropped = withdrawn | _side_files(withdrawn) | _WRITTEN | REGENERATED.keys()

    def ignored(folder: str, names: list[str]) -> set[str]:
        relative_folder = Path(folder).relative_to(root)
        return {name for name in names if (relative_folder / name).as_posix() in dropped}

    shutil.copytree(root, partial, symlinks=True, ignore=ignored, copy_function=_link, dirs_exist_ok=True)
    manifest = root / RAW_MANIFEST_FILE
    if manifest.is_file():
        try:
            entries = Manifest.read(manifest).files
        except CopolicyError:
            return  # the caller reports it if it still names a recording
        remaining = Manifest({name: entry for name, entry in entries.items() if name not in withdrawn})
        _rewrite(partial / RAW_MANIFEST_FILE, remaining.to_text())
    for folder in sorted((partial / RAW_FOLDER).rglob("*"), reverse=True):
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()


def _clean_releases(partial: Path, traces: Traces, withdrawn: Sequence[EpisodeContent]) -> None:
    """Removes the episodes from the records of releases and from the change log."""
    uuids = {episode.episode_uuid for episode in withdrawn} | traces.names
    paths = [partial / RELEASE_FILE, *sorted((partial / EARLIER_FOLDER).glob("*.json"))]
    for path in (path for path in paths if path.is_file()):
        record = ReleaseRecord.read(path)
        record = replace(
            record,
            notes=traces.redact(record.notes),
            changes=[traces.redact(text) for text in record.changes],
            content=anonymise(record.content, lambda episode: episode.episode_uuid in uuids),
        )
        _rewrite(path, record.to_text())
    changelog = partial / CHANGELOG_FILE
    if changelog.is_file():
        _rewrite(changelog, traces.redact(changelog.read_text(encoding="utf-8")))


def _rewrite(path: Path, text: str) -> None:
    path.unlink()  # a hard link: writing to it would change the old data set
    path.write_text(text, encoding="utf-8")


def _unfinished_beside(root: Path) -> list[Path]:
    """Hidden folders beside the data set that killed commands left."""
    target = root.resolve()
    return [
        path
        for path in sorted(target.parent.glob(".*"))
        if path.name.startswith(f".{target.name}.") and is_unfinished(path.name) and path.is_dir()
    ]


def _side_files(names: Iterable[str]) -> set[str]:
    """Names of macOS side files of recordings."""
    return {Path(name).with_name(f"._{Path(name).name}").as_posix() for name in names}


def _link(source: str, target: str) -> None:
    if os.path.lexists(target):
        return  # already written, such as a licence
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:  # a file system without hard links
        shutil.copy2(source, target, follow_symlinks=False)


def describe(data_set: AffectedDataSet) -> dict[str, Any]:
    """What is withdrawn, for a summary: counts, and deleted files with the command that writes them again."""
    regenerate = {name: command for name, command in REGENERATED.items() if os.path.lexists(data_set.root / name)}
    return {
        "episodes": f"{len(data_set.numbers)} of {len(data_set.stored.rows)}",
        **({"raw_recordings": len(data_set.recordings)} if data_set.recordings else {}),
        **({"make_anew": regenerate} if data_set.remaining else {"removed": "the whole data set: no episode is left"}),
    }


def deleted_with(data_set: AffectedDataSet) -> list[Path]:
    """Files and folders that `remove_withdrawn` deletes or replaces by new ones, besides those with frames."""
    root = data_set.root
    if not data_set.remaining:
        return [root, *_unfinished_beside(root)]
    names = (*data_set.recordings, *sorted(_side_files(data_set.recordings)), *REGENERATED, *_DROPPED)
    return [path for path in (root / name for name in names) if os.path.lexists(path)] + _unfinished_beside(root)


def people_in(row: dict[str, Any]) -> set[str]:
    """The pseudonyms and the session of an episode."""
    return {row.get(name) or "" for name in PEOPLE_COLUMNS} - {""}
