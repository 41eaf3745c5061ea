"""Finds recordings of withdrawn episodes by their metadata, even damaged ones, and deletes them."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ...exceptions import CopolicyError, ForeignRecordingError
from ...files.staging import replace_text, sync_folder
from ...recording import reader
from ..selection import consent_ids
from .traces import Traces

_PEOPLE = ("pair_id", "player_0_id", "player_1_id")
_SESSION = "session.json"
_JOURNAL = "journal.jsonl"
_LINES = (_JOURNAL, "answers.jsonl")  # one JSON object per line
_SESSION_FILES = (*_LINES, ".copolicy.lock", _SESSION)


@dataclass(frozen=True)
class ScannedRecording:
    """Metadata of a recording.

    Attributes:
        consents: consent ids; None if the file cannot be read.
        people: ids of pair, players and session, as far as recorded.
        foreign: the file is an intact MCAP file of another project.
    """

    path: Path
    episode_uuid: str = ""
    consents: frozenset[str] | None = None
    people: frozenset[str] = frozenset()
    foreign: bool = False


def is_recording(name: str) -> bool:
    """Whether a file is a recording: finished, unfinished (`.part`), undone, or left hidden by a killed process."""
    return ".mcap" in name and not name.startswith("._")


def read_recording(path: Path) -> ScannedRecording:
    """Reads the metadata of a recording, which may be unfinished."""
    try:
        records = reader.read_metadata(path)
    except CopolicyError:
        return ScannedRecording(path)
    if "consent" not in records and "episode" not in records:
        return ScannedRecording(path, foreign=_is_foreign(path))
    players, session = records.get("players", {}), records.get("session", {})
    people = {players.get(name, "") for name in _PEOPLE} | {session.get("session_id", "")}
    consents = consent_ids(records.get("consent", {}))
    uuid = records.get("episode", {}).get("episode_uuid", "")
    return ScannedRecording(path, uuid, frozenset(consents), frozenset(people - {""}))


@dataclass(frozen=True)
class Removal:
    """What is removed with recordings.

    Attributes:
        recordings: with the targets of links, and macOS side files.
        session_files: files of sessions without other recordings, whose header comes last.
        folders: folders of these sessions with no other file, whose name is that of the pair; inner ones first.
        lines: of journals and answers that stay: number of removed and of all lines.
        other_files: other files in folders without recordings, such as videos, which the user has to check.
    """

    recordings: tuple[Path, ...]
    session_files: tuple[Path, ...]
    folders: tuple[Path, ...]
    lines: dict[Path, tuple[int, int]]
    other_files: tuple[Path, ...]


def planned_removal(paths: Iterable[Path], traces: Traces) -> Removal:
    """Determines what is removed with recordings; changes nothing."""
    recordings: dict[Path, Path] = {}  # by the place, to which several links may lead
    folders: dict[Path, Path] = {}
    for path in paths:
        for file in (path, path.resolve()):
            folder = file.parent.resolve()
            folders.setdefault(folder, file.parent)
            for each in (file, file.with_name(f"._{file.name}")):
                if os.path.lexists(each):
                    recordings.setdefault(folder / each.name, each)
    session_files: list[Path] = []
    emptied: dict[Path, Path] = {}
    lines: dict[Path, tuple[int, int]] = {}
    other_files: list[Path] = []
    for folder in sorted(folders, reverse=True):
        if not folder.is_dir():
            continue
        shown = folders[folder]
        left = sorted(entry.name for entry in folder.iterdir() if entry not in recordings and entry not in emptied)
        if not any(map(is_recording, left)):
            if _SESSION in left:
                session_files += [shown / name for name in _SESSION_FILES if name in left]
                left = [name for name in left if name not in _SESSION_FILES]
                if not left:
                    emptied[folder] = shown
            other_files += [shown / name for name in left]
        for path in (shown / name for name in _LINES if name in left):
            text = path.read_text(encoding="utf-8")
            total, remaining = (len(each.splitlines()) for each in (text, traces.drop_lines(text)))
            if remaining < total:
                lines[path] = total - remaining, total
    return Removal(tuple(recordings.values()), tuple(session_files), tuple(emptied.values()), lines, tuple(other_files))


def delete_recordings(paths: Iterable[Path], traces: Traces) -> tuple[Path, ...]:
    """Deletes recordings with all that `planned_removal` names.

    Returns:
        Other files in folders without recordings, such as videos, which the user has to check.
    """
    removal = planned_removal(paths, traces)
    # Recordings last: after an interruption, those that are left lead the next call to the rest.
    for path in removal.lines:
        replace_text(path, traces.drop_lines(path.read_text(encoding="utf-8")))
    deleted = (*removal.session_files, *removal.recordings)
    for path in deleted:
        path.unlink(missing_ok=True)
    for folder in removal.folders:
        folder.resolve().rmdir()
        if folder.is_symlink():
            folder.unlink()
    for folder in {path.parent for path in (*deleted, *removal.folders)}:
        if folder.is_dir():
            sync_folder(folder)
    return removal.other_files


def _is_foreign(path: Path) -> bool:
    try:
        reader.read_recording(path)
    except ForeignRecordingError:
        return True
    except CopolicyError:
        pass
    return False


def hard_links(path: Path) -> int:
    """Number of other hard links to a file, through which its content remains on disk."""
    return os.stat(path).st_nlink - 1
