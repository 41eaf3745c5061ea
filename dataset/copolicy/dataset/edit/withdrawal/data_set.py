"""A data set without withdrawn episodes: built beside it, with every trace of them taken out, and put in its place."""

import os
import shutil
from collections.abc import Sequence
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
from ..subset.stored_set import StoredSet, without_episodes, write_record
from ..subset.writing import kept_splits, write_subset
from .traces import Traces

PEOPLE = ("pair_id", "player_0_id", "player_1_id", "session_id")
"""The episode columns whose pseudonyms go where nobody else has them."""

MADE_ANEW = {
    CARD_FILE: "copolicy-cards dataset",
    "figures": "copolicy-cards dataset",
    CROISSANT_FILE: "copolicy-cards dataset --croissant",
    "report.html": "copolicy-cards report",
    CHECK_FILE: "copolicy-dataset check",
    STATISTICS_FILE: "copolicy-dataset stats",
    MANIFEST_FILE: "copolicy-dataset release",
}
"""Files that count, draw or name every episode, and the command that makes each anew."""

_REWRITTEN = {"data", "videos", "images", ".cache", EPISODES_FOLDER} | {
    INFO_FILE,
    STATS_FILE,
    TASKS_FILE,
    RECORD_FILE,
    WITHDRAWALS_FILE,
}


@dataclass(frozen=True)
class FoundSet:
    """A data set, and what of it is withdrawn.

    Attributes:
        numbers: of the withdrawn episodes.
        recordings: withdrawn recordings in it, below `raw/`, by their path in the folder.
    """

    stored: StoredSet
    numbers: tuple[int, ...]
    recordings: tuple[str, ...]

    @property
    def root(self) -> Path:
        return self.stored.root


def without_withdrawn(found: FoundSet, traces: Traces, episodes: int) -> dict[str, Any]:
    """Rewrites a data set; where no episode is left, it goes altogether.

    Args:
        episodes: number of episodes for the record of the withdrawal.

    Returns:
        What was deleted and has to be made anew, and which files still name something.
    """
    root, source = found.root, found.stored
    gone = set(found.numbers)
    numbers = [row["episode_index"] for row in source.rows if row["episode_index"] not in gone]
    _delete_left_over(root)
    if not numbers:
        delete_folder(root)
        return {"removed": "the whole data set: no episode is left"}
    with replaced_folder(root) as partial:
        write_subset(source, numbers, partial, kept_splits(source.info, numbers))
        _carry(root, partial, set(found.recordings))
        uuids = {source.rows[number]["episode_uuid"] for number in gone}
        write_record(partial, traces.without_json(without_episodes(source.record, uuids)))
        _clean_releases(partial, traces, [source.content.episodes[number] for number in sorted(gone)])
        entries = [*read_withdrawals(root), *([{"date": today(), "episodes": episodes}] if episodes else [])]
        if entries:
            (partial / WITHDRAWALS_FILE).write_text(withdrawals_text(entries), encoding="utf-8")
        named = [path.relative_to(partial).as_posix() for path in traces.files_with(partial)]
        anew = {name: command for name, command in MADE_ANEW.items() if os.path.lexists(root / name)}
    return {"make_anew": anew, **({"still_named_in": named} if named else {})}


def _carry(root: Path, partial: Path, withdrawn: set[str]) -> None:
    """Takes every other file along, as it is: only withdrawn recordings and what is rewritten or made anew stay."""

    side_files = {Path(name).with_name(f"._{Path(name).name}").as_posix() for name in withdrawn}
    dropped = withdrawn | side_files | _REWRITTEN | MADE_ANEW.keys()

    def left(folder: str, names: list[str]) -> set[str]:
        inside = Path(folder).relative_to(root)
        return {name for name in names if (inside / name).as_posix() in dropped}

    shutil.copytree(root, partial, symlinks=True, ignore=left, copy_function=_link, dirs_exist_ok=True)
    manifest = root / RAW_MANIFEST_FILE
    if manifest.is_file():
        try:
            entries = Manifest.read(manifest).files
        except CopolicyError:
            return  # named below, where it still names a recording
        rest = Manifest({name: entry for name, entry in entries.items() if name not in withdrawn})
        _rewrite(partial / RAW_MANIFEST_FILE, rest.to_text())
    for folder in sorted((partial / RAW_FOLDER).rglob("*"), reverse=True):
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()


def _clean_releases(partial: Path, traces: Traces, gone: Sequence[EpisodeContent]) -> None:
    """Takes the episodes out of the records of releases and out of the change log."""
    uuids = {episode.episode_uuid for episode in gone} | traces.names
    paths = [partial / RELEASE_FILE, *sorted((partial / EARLIER_FOLDER).glob("*.json"))]
    for path in (path for path in paths if path.is_file()):
        record = ReleaseRecord.read(path)
        record = replace(
            record,
            notes=traces.without(record.notes),
            changes=[traces.without(text) for text in record.changes],
            content=anonymise(record.content, lambda episode: episode.episode_uuid in uuids),
        )
        _rewrite(path, record.to_text())
    changelog = partial / CHANGELOG_FILE
    if changelog.is_file():
        _rewrite(changelog, traces.without(changelog.read_text(encoding="utf-8")))


def _rewrite(path: Path, text: str) -> None:
    path.unlink()  # a link: writing into it would change the data set in use
    path.write_text(text, encoding="utf-8")


def _delete_left_over(root: Path) -> None:
    """Deletes what killed commands left of the data set under hidden names beside it."""
    place = root.resolve()
    for path in place.parent.iterdir():
        if path.name.startswith(f".{place.name}.") and is_unfinished(path.name) and path.is_dir():
            shutil.rmtree(path)


def _link(source: str, target: str) -> None:
    if os.path.lexists(target):
        return  # written already, such as a licence
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:  # a file system without hard links
        shutil.copy2(source, target, follow_symlinks=False)


def describe(found: FoundSet) -> dict[str, Any]:
    """What would be taken out, for a summary."""
    return {
        "episodes": f"{len(found.numbers)} of {len(found.stored.rows)}",
        **({"raw_recordings": len(found.recordings)} if found.recordings else {}),
    }


def people_of(row: dict[str, Any]) -> set[str]:
    """The pseudonyms and the session of an episode."""
    return {row.get(name) or "" for name in PEOPLE} - {""}
