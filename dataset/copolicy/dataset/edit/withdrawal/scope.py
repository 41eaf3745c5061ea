"""Finds the episodes of a consent id in recordings and data sets, also in copies that do not state the id."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ...exceptions import FileFormatError
from ...files.json_file import read_json
from ...files.meta_files import INFO_FILE
from ...files.replace_folder import finish_all_interrupted, finish_interrupted, is_unfinished
from ...lerobot_folder.folder import LeRobotFolder
from ...lerobot_folder.info import stripped_hint
from ..selection import consent_ids
from ..subset.stored_set import StoredSet
from .data_set import PEOPLE_COLUMNS, AffectedDataSet, people_in
from .recordings import ScannedRecording, is_recording, read_recording
from .traces import Traces


@dataclass
class _Scan:
    """Data sets and recordings below the paths.

    Attributes:
        sets: rows of meta/episodes by data set.
        foreign: data sets and recordings of other projects.
        unfinished: folders that a running or killed command has not finished.
    """

    sets: dict[Path, list[dict[str, Any]]] = field(default_factory=dict)
    recordings: dict[Path, ScannedRecording] = field(default_factory=dict)
    foreign: list[Path] = field(default_factory=list)
    unfinished: list[Path] = field(default_factory=list)


@dataclass(frozen=True)
class WithdrawalScope:
    """Data sets and recordings with episodes of a consent id.

    Attributes:
        sets: data sets with episodes or recordings to delete.
        recordings: recordings to delete, except those in `raw/` of a data set; of a link there, its target.
        unreadable: recordings whose consent ids cannot be read.
        foreign: data sets and recordings of other projects, which have no consent ids.
        unfinished: folders that a running or killed command has not finished; they were not searched.
        traces: names that must not remain.
        direct: data sets and recordings that contain the consent id themselves.
    """

    sets: tuple[AffectedDataSet, ...]
    recordings: tuple[ScannedRecording, ...]
    unreadable: tuple[Path, ...]
    foreign: tuple[Path, ...]
    unfinished: tuple[Path, ...]
    traces: Traces
    direct: frozenset[Path]

    @property
    def episodes(self) -> int:
        """Number of distinct episodes in data sets and recordings."""
        uuids = {part.stored.rows[number]["episode_uuid"] for part in self.sets for number in part.numbers}
        uuids |= {recording.episode_uuid or str(recording.path) for recording in self.recordings}
        return len(uuids)


def find_scope(consent: str, paths: Sequence[Path]) -> WithdrawalScope:
    """Finds the data sets and recordings with a consent id; changes nothing but completes interrupted edits."""
    scan = _scan(paths)
    sets, recordings = scan.sets, scan.recordings
    direct = {path for path, recording in recordings.items() if consent in (recording.consents or ())}
    uuids = {recordings[path].episode_uuid for path in direct} - {""}
    for root, rows in sets.items():
        uuids_of_consent = [row["episode_uuid"] for row in rows if consent in consent_ids(row)]
        uuids |= {uuid for uuid in uuids_of_consent if uuid}
        direct |= {root} if uuids_of_consent else set()
    withdrawn = {path: entry for path, entry in recordings.items() if path in direct or entry.episode_uuid in uuids}
    removed_names, remaining_names = {consent} | uuids, set()
    for path, recording in recordings.items():
        (removed_names if path in withdrawn else remaining_names).update(recording.people)
    affected: list[AffectedDataSet] = []
    for root, rows in sets.items():
        numbers = []
        for row in rows:
            if row["episode_uuid"] in uuids or consent in consent_ids(row):
                numbers.append(row["episode_index"])
                removed_names |= people_in(row) | {row.get("source_sha256") or ""}
            else:
                remaining_names |= people_in(row)
        raw = tuple(name for path in withdrawn if (name := _relative_path(path, root)) is not None)
        if numbers or raw:
            affected.append(AffectedDataSet(StoredSet.read(root), tuple(numbers), raw))
    roots = [data_set.root.resolve() for data_set in affected]
    outside = [entry for path, entry in withdrawn.items() if not any(path.resolve().is_relative_to(r) for r in roots)]
    # A link in a data set is removed with its episodes; its target has to be known before.
    linked = {entry.path for entry in outside if any(entry.path.is_relative_to(part.root) for part in affected)}
    direct |= {path.resolve() for path in linked & direct}
    outside = [replace(entry, path=entry.path.resolve()) if entry.path in linked else entry for entry in outside]
    unreadable = [path for path, recording in recordings.items() if recording.consents is None]
    traces = Traces(frozenset(removed_names - remaining_names - {""}), frozenset(path.name for path in withdrawn))
    return WithdrawalScope(
        tuple(affected), tuple(outside), tuple(unreadable), tuple(scan.foreign), tuple(scan.unfinished), traces,
        frozenset(direct),
    )  # fmt: skip


def _scan(paths: Sequence[Path]) -> _Scan:
    """Reads the data sets and recordings below the paths, each once."""
    scan = _Scan()
    visited: set[Path] = set()
    for path in paths:
        finish_interrupted(path)
        if not os.path.lexists(path):
            raise FileFormatError(path, "a folder of recordings, a data set or a recording", "no such file or folder")
        for item in _walk(path, scan.unfinished):
            if item.resolve() in visited:
                continue
            visited.add(item.resolve())
            if not item.is_dir():
                recording = read_recording(item)
                if recording.foreign:
                    scan.foreign.append(item)
                else:
                    scan.recordings[item] = recording
            elif _is_foreign(item):
                scan.foreign.append(item)
            else:
                scan.sets[item] = _rows(item)
    return scan


def _is_foreign(root: Path) -> bool:
    """Whether a data set belongs to another project; False if its `meta/info.json` cannot be read."""
    try:
        info = read_json(root / INFO_FILE, dict[str, Any], "LeRobot's data set information")
    except FileFormatError:
        return False
    return bool(info) and not stripped_hint(info, root)


def _rows(root: Path) -> list[dict[str, Any]]:
    """Reads number, uuid, consent and people of each episode of a data set.

    Raises:
        FileFormatError: not a data set of copolicy, or a column is missing.
    """
    folder = LeRobotFolder.open(root)
    present = [name for name in ("source_sha256", *PEOPLE_COLUMNS) if name in folder.episodes.column_names]
    return folder.rows(["episode_uuid", "consent_id", *present])


def _relative_path(path: Path, root: Path) -> str | None:
    """The path of a file relative to a data set that contains it, directly or by a link, else None."""
    if path.is_relative_to(root):
        return path.relative_to(root).as_posix()
    path, root = path.resolve(), root.resolve()
    return path.relative_to(root).as_posix() if path.is_relative_to(root) else None


def _walk(path: Path, unfinished: list[Path]) -> Iterator[Path]:
    """Yields data sets (folders) and recordings (files) at or below a path; visits linked folders once.

    Args:
        unfinished: list to which folders that a running or killed command has not finished are appended.
    """
    if path.is_file():
        yield path
        return
    visited: set[tuple[int, int]] = set()
    finish_all_interrupted(path)
    for folder, folders, names in os.walk(path, followlinks=True):
        status = os.stat(folder)
        if (status.st_dev, status.st_ino) in visited:
            folders.clear()
            continue
        visited.add((status.st_dev, status.st_ino))
        unfinished += [Path(folder, name) for name in folders if is_unfinished(name)]
        folders[:] = [name for name in folders if not is_unfinished(name)]
        if (Path(folder) / INFO_FILE).is_file():
            yield Path(folder)
            folders[:] = [name for name in folders if name == "raw"]
        else:
            folders.sort()
        yield from (Path(folder, name) for name in sorted(names) if is_recording(name))
