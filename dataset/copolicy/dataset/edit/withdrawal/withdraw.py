"""`withdraw`: every episode of a consent id out of recordings, data sets, raw copies and the records of releases."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...exceptions import FileFormatError, InvalidValueError, RunError
from ...files.json_file import read_json
from ...files.meta_files import INFO_FILE
from ...files.replace_folder import finish_all_interrupted, finish_interrupted, is_unfinished
from ...lerobot_folder.folder import LeRobotFolder
from ...lerobot_folder.info import stripped_hint
from ..selection import consents_of
from ..subset.stored_set import StoredSet
from .data_set import PEOPLE, FoundSet, describe, people_of, without_withdrawn
from .recordings import FoundRecording, delete_recordings, hard_links, is_recording, read_recording
from .traces import Traces

OUT_OF_REACH = (
    "copies elsewhere: backups, exports (zarr, robomimic, minari), checkpoints trained on the episodes, caches of "
    "LeRobot and the Hub's client (~/.cache/huggingface), and what others have downloaded"
)
ON_THE_HUB = (
    "earlier commits keep the episodes: release and publish the data set, delete the tags of earlier releases "
    "(HfApi().delete_tag), then HfApi().super_squash_history(REPO, repo_type='dataset'); or delete the repository "
    "(HfApi().delete_repo)"
)


@dataclass
class _Below:
    """What lies below the paths.

    Attributes:
        sets: the rows of each data set.
        foreign: data sets and recordings of other projects.
        unfinished: folders that a running or killed command has not finished.
    """

    sets: dict[Path, list[dict[str, Any]]] = field(default_factory=dict)
    recordings: dict[Path, FoundRecording] = field(default_factory=dict)
    foreign: list[Path] = field(default_factory=list)
    unfinished: list[Path] = field(default_factory=list)


@dataclass(frozen=True)
class Survey:
    """Everything below some paths that is tied to a consent id.

    Attributes:
        sets: the data sets that lose something.
        recordings: the recordings to delete, apart from those in `raw/` of a data set.
        unreadable: recordings that do not tell whose they are.
        foreign: data sets and recordings of other projects, which have no consent ids.
        unfinished: folders that a running or killed command has not finished, and nobody looked into.
        traces: the names that must not be found any more.
        direct: whether a path's own consent ids led to it, by data set or recording.
    """

    sets: tuple[FoundSet, ...]
    recordings: tuple[FoundRecording, ...]
    unreadable: tuple[Path, ...]
    foreign: tuple[Path, ...]
    unfinished: tuple[Path, ...]
    traces: Traces
    direct: frozenset[Path]

    @property
    def episodes(self) -> int:
        """Different episodes, wherever they lie."""
        uuids = {found.stored.rows[number]["episode_uuid"] for found in self.sets for number in found.numbers}
        uuids |= {recording.episode_uuid or str(recording.path) for recording in self.recordings}
        return len(uuids)


def withdraw(consent: str, paths: Sequence[Path], really: bool = False) -> dict[str, Any]:
    """Deletes every episode of a consent id below some paths: recordings, data sets with their raw copies.

    An episode that one path names by the consent id is deleted from all of them, also where a copy does not state it
    (a consent id that was amended in a data set is not in its recordings). A data set is replaced in one step and
    keeps a record of when how many episodes were withdrawn, not which.

    Args:
        consent: one id; an episode of two people may name two, and goes with either.
        paths: folders with recordings or data sets, searched with all that is in them, or single recordings.
        really: delete; by default only tell what would be deleted.

    Returns:
        Summary.

    Raises:
        InvalidValueError: no consent id.
        FileFormatError: a path does not exist, or a data set below it cannot be read; nothing was changed.
        RunError: no episode has the consent id.
    """
    consent = consent.strip()
    if not consent or "," in consent:
        raise InvalidValueError("CONSENT_ID", "one consent id", consent)
    survey = survey_paths(consent, paths)
    if not survey.sets and not survey.recordings:
        shown = ", ".join(map(str, paths))
        unread = f" ({len(survey.unreadable)} recordings cannot be read)" if survey.unreadable else ""
        raise RunError(f"{shown}: expected an episode with consent id {consent}, found none{unread}")
    summary: dict[str, Any] = {
        "withdrawn" if really else "would_be_withdrawn": survey.episodes,
        "recordings": len(survey.recordings),
        "data_sets": {},
    }
    linked = [str(found.path) for found in survey.recordings if hard_links(found.path)]
    # What only another copy tells of goes first: after an interruption the consent id still leads there.
    for found in sorted(survey.sets, key=lambda found: found.root in survey.direct):
        facts = describe(found)
        if really:
            facts |= without_withdrawn(found, survey.traces, len(found.numbers))
        summary["data_sets"][str(found.root)] = facts
    if really:
        beside: list[Path] = []
        for direct in (False, True):
            inside = [found.path for found in survey.recordings if (found.path in survey.direct) is direct]
            beside += delete_recordings(inside, survey.traces)
        reports = {
            "still_named_in": [str(path) for path in _still_named(paths, survey)],
            "beside_deleted_recordings": [str(path) for path in beside if os.path.lexists(path)],
            "next": "copolicy-dataset release ROOT --bump major, then publish",
        }
    else:
        files = [str(found.path) for found in survey.recordings]
        reports = {"files": files, "next": "nothing was changed; --yes deletes"}
    reports |= {
        "hard_links_elsewhere": linked,
        "git_history": [str(found.root) for found in survey.sets if (found.root / ".git").exists()],
        "of_other_projects": [str(path) for path in survey.foreign],
        "unfinished": [str(path) for path in survey.unfinished if path.exists()],
        "unreadable": [str(path) for path in survey.unreadable],
        "on_the_hub": ON_THE_HUB,
        "out_of_reach": OUT_OF_REACH,
    }
    summary |= {name: value for name, value in reports.items() if value}
    return summary | ({"exit_status": 1} if survey.unreadable else {})


def survey_paths(consent: str, paths: Sequence[Path]) -> Survey:
    """Looks below the paths; changes nothing but what an interrupted call left undone."""
    below = _read_below(paths)
    sets, recordings = below.sets, below.recordings
    direct = {path for path, found in recordings.items() if consent in (found.consents or ())}
    uuids = {recordings[path].episode_uuid for path in direct} - {""}
    for root, rows in sets.items():
        named = [row["episode_uuid"] for row in rows if consent in consents_of(row)]
        uuids |= {uuid for uuid in named if uuid}
        direct |= {root} if named else set()
    gone = {path: found for path, found in recordings.items() if path in direct or found.episode_uuid in uuids}
    names, staying = {consent} | uuids, set()
    for path, found in recordings.items():
        (names if path in gone else staying).update(found.people)
    concerned: list[FoundSet] = []
    for root, rows in sets.items():
        numbers = []
        for row in rows:
            if row["episode_uuid"] in uuids or consent in consents_of(row):
                numbers.append(row["episode_index"])
                names |= people_of(row) | {row.get("source_sha256") or ""}
            else:
                staying |= people_of(row)
        raw = tuple(name for path in gone if (name := _inside(path, root)) is not None)
        if numbers or raw:
            concerned.append(FoundSet(StoredSet.read(root), tuple(numbers), raw))
    places = [found.root.resolve() for found in concerned]
    outside = [found for path, found in gone.items() if not any(path.resolve().is_relative_to(p) for p in places)]
    unreadable = [path for path, found in recordings.items() if found.consents is None]
    traces = Traces(frozenset(names - staying - {""}), frozenset(path.name for path in gone))
    return Survey(
        tuple(concerned), tuple(outside), tuple(unreadable), tuple(below.foreign), tuple(below.unfinished), traces,
        frozenset(direct),
    )  # fmt: skip


def _read_below(paths: Sequence[Path]) -> _Below:
    """Reads what lies below the paths, each file and folder once."""
    below = _Below()
    known: set[Path] = set()
    for path in paths:
        finish_interrupted(path)
        if not os.path.lexists(path):
            raise FileFormatError(path, "a folder of recordings, a data set or a recording", "nothing there")
        for item in _walk(path, below.unfinished):
            if item.resolve() in known:
                continue
            known.add(item.resolve())
            if not item.is_dir():
                recording = read_recording(item)
                if recording.foreign:
                    below.foreign.append(item)
                else:
                    below.recordings[item] = recording
            elif _is_foreign(item):
                below.foreign.append(item)
            else:
                below.sets[item] = _rows(item)
    return below


def _is_foreign(root: Path) -> bool:
    """Whether a data set is another project's. One whose information cannot be read may be ours."""
    try:
        info = read_json(root / INFO_FILE, dict[str, Any], "LeRobot's data set information")
    except FileFormatError:
        return False
    return bool(info) and not stripped_hint(info, root)


def _rows(root: Path) -> list[dict[str, Any]]:
    """Number, name, consent and people of each episode of a data set, their types checked.

    Raises:
        FileFormatError: no data set of this project, or one that does not tell.
    """
    folder = LeRobotFolder.open(root)
    there = [name for name in ("source_sha256", *PEOPLE) if name in folder.episodes.column_names]
    return folder.rows(["episode_uuid", "consent_id", *there])


def _inside(path: Path, root: Path) -> str | None:
    """The path in a data set of a file that lies, or is linked, there."""
    if path.is_relative_to(root):
        return path.relative_to(root).as_posix()
    place = root.resolve()
    return path.resolve().relative_to(place).as_posix() if path.resolve().is_relative_to(place) else None


def _walk(path: Path, unfinished: list[Path]) -> Iterator[Path]:
    """Data sets (folders) and recordings (files) at or below a path; linked folders are entered once.

    Args:
        unfinished: takes the folders that a running or killed command has not finished.
    """
    if path.is_file():
        yield path
        return
    entered: set[tuple[int, int]] = set()
    finish_all_interrupted(path)
    for folder, folders, names in os.walk(path, followlinks=True):
        status = os.stat(folder)
        if (status.st_dev, status.st_ino) in entered:
            folders.clear()
            continue
        entered.add((status.st_dev, status.st_ino))
        unfinished += [Path(folder, name) for name in folders if is_unfinished(name)]
        folders[:] = [name for name in folders if not is_unfinished(name)]
        if (Path(folder) / INFO_FILE).is_file():
            yield Path(folder)
            folders[:] = [name for name in folders if name == "raw"]
        else:
            folders.sort()
        yield from (Path(folder, name) for name in sorted(names) if is_recording(name))


def _still_named(paths: Sequence[Path], survey: Survey) -> Iterator[Path]:
    """Text files outside of data sets that name what was withdrawn; they are somebody's own and are left alone."""
    roots = [found.root.resolve() for found in survey.sets]
    for path in paths:
        if path.is_dir():
            for file in survey.traces.files_with(path):
                if not any(file.resolve().is_relative_to(root) for root in roots):
                    yield file
