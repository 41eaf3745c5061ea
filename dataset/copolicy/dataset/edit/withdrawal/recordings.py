"""The recordings of withdrawn episodes: found by their metadata, whatever their state, and deleted."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ...exceptions import CopolicyError, ForeignRecordingError
from ...files.staging import replace_text, sync_folder
from ...recording import reader
from ..selection import consents_of
from .traces import Traces

_PEOPLE = ("pair_id", "player_0_id", "player_1_id")
_SESSION = "session.json"
_JOURNAL = "journal.jsonl"
_OF_A_SESSION = (_SESSION, _JOURNAL, ".copolicy.lock")


@dataclass(frozen=True)
class FoundRecording:
    """What a recording says of itself.

    Attributes:
        consents: consent ids; None where the file cannot be read.
        people: pair, players and session, as far as they are named.
        foreign: the file is whole and another project's.
    """

    path: Path
    episode_uuid: str = ""
    consents: frozenset[str] | None = None
    people: frozenset[str] = frozenset()
    foreign: bool = False


def is_recording(name: str) -> bool:
    """Whether a file is a recording: finished, broken off (`.part`), undone, or left hidden by a killed program."""
    return ".mcap" in name and not name.startswith("._")


def read_recording(path: Path) -> FoundRecording:
    """The metadata of a recording that may have broken off."""
    try:
        records = reader.read_metadata(path)
    except CopolicyError:
        return FoundRecording(path)
    if "consent" not in records and "episode" not in records:
        return FoundRecording(path, foreign=_is_foreign(path))
    players, session = records.get("players", {}), records.get("session", {})
    people = {players.get(name, "") for name in _PEOPLE} | {session.get("session_id", "")}
    consents = consents_of(records.get("consent", {}))
    uuid = records.get("episode", {}).get("episode_uuid", "")
    return FoundRecording(path, uuid, frozenset(consents), frozenset(people - {""}))


def delete_recordings(paths: Iterable[Path], traces: Traces) -> list[Path]:
    """Deletes recordings, what macOS keeps beside them, and what is said of them in the files of their sessions.

    A linked file is deleted where it lies. A session without a recording left goes with its folder, whose name is
    the pair's.

    Returns:
        What else lies where no recording is left, such as a film of one: somebody has to look at it.
    """
    beside: list[Path] = []
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
                for name in _OF_A_SESSION:
                    (folder / name).unlink(missing_ok=True)
                if not any(folder.iterdir()):
                    folder.rmdir()
                    sync_folder(folder.parent)
                    continue
            beside += sorted(folder.iterdir())
        journal = folder / _JOURNAL
        if journal.is_file():
            text = journal.read_text(encoding="utf-8")
            if (rest := traces.without_lines(text)) != text:
                replace_text(journal, rest)
        sync_folder(folder)
    return beside


def _is_foreign(path: Path) -> bool:
    try:
        reader.read_recording(path)
    except ForeignRecordingError:
        return True
    except CopolicyError:
        pass
    return False


def hard_links(path: Path) -> int:
    """How many other names a file has, under which it stays on the disk."""
    return os.stat(path).st_nlink - 1
