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
_SESSION_FILES = (_SESSION, *_LINES, ".copolicy.lock")


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


def delete_recordings(paths: Iterable[Path], traces: Traces) -> list[Path]:
    """Deletes recordings, their macOS side files, and their lines in the journals and answers of their sessions.

    The target of a link is deleted too. A session without recordings is deleted with its folder, whose name is that
    of the pair.

    Returns:
        Other files in folders without recordings, such as videos, which the user has to check.
    """
    other_files: list[Path] = []
    folders: set[Path] = set()
    for path in paths:
        folders.add(path.parent)
        target = path.resolve()
        target.unlink(missing_ok=True)
        path.unlink(missing_ok=True)
        path.with_name(f"._{path.name}").unlink(missing_ok=True)
    for folder in sorted(folders, reverse=True):
        if not folder.is_dir():
            continue
        if not any(is_recording(entry.name) for entry in folder.iterdir()):
            if (folder / _SESSION).exists():
                for name in _SESSION_FILES:
                    (folder / name).unlink(missing_ok=True)
                if not any(folder.iterdir()):
                    folder.rmdir()
                    sync_folder(folder.parent)
                    continue
            other_files += sorted(folder.iterdir())
        for path in (folder / name for name in _LINES if (folder / name).is_file()):
            text = path.read_text(encoding="utf-8")
            if (remaining := traces.drop_lines(text)) != text:
                replace_text(path, remaining)
        sync_folder(folder)
    return other_files


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
