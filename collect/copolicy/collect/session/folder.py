"""The folder of a session: it is locked while in use, and no file in it is ever overwritten."""

import json
import logging
import os
import re
import uuid
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError
from copolicy.dataset.files.lock import FolderLock
from copolicy.dataset.files.staging import replace_json, sync_folder
from copolicy.dataset.task import TABLE

from .recording_summaries import RecordingSummary, iter_recordings
from .schedule import EpisodeCounts

_LOCK = ".copolicy.lock"
_HEADER = "session.json"
_JOURNAL = "journal.jsonl"
_UNDONE = ".undone"
_EPISODE = re.compile(r"episode_(\d+)\.")


class CollectionLock(FolderLock):
    """The lock of a folder that a tool collects into."""

    def __init__(self, folder: Path):
        super().__init__(
            folder / _LOCK, f"{folder}: expected a folder that no other tool collects into, found one running"
        )


class SessionFolder:
    """One session of one pair in `out/PAIR-NN/`.

    `session.json` holds the session's id and settings, `journal.jsonl` a log of events. The episode counts come from
    the recordings alone. Undoing a keep appends `.undone` to the file's name, so that no tool reads it as a recording.

    Attributes:
        path: of the folder.
        session_id: of its recordings.
        counts: episodes played so far.
        continued: the session was begun by an earlier run.
    """

    def __init__(
        self,
        out: Path,
        pair: str,
        settings: Mapping[str, Any],
        episodes: int,
        new_session: bool = False,
        task: str = TABLE,
        is_open: Callable[[Path], bool] = lambda path: False,
        once: bool = False,
    ):
        """Continues the pair's last session if it is unfinished, else begins a new one.

        Args:
            out: folder of all sessions.
            pair: its name.
            settings: that must not change within a session; JSON-able.
            episodes: number of episodes to keep in the session.
            new_session: begin a new session in any case.
            task: name of the task whose recordings count.
            is_open: whether a session whose episodes were all kept is unfinished nevertheless, by its folder.
            once: no session follows a finished one, other than by `new_session`.

        Raises:
            InvalidValueError: the unfinished session has other settings.
            RunError: the pair's session is finished, with `once`.
            FileFormatError: its `session.json` is damaged.
            OSError: the folder cannot be written to.
        """
        summaries = [summary for summary in iter_recordings(out) if summary.task == task]
        self.continued = False
        number = self._last_number(out, pair)
        if number and not new_session:
            self.path = out / f"{pair}-{number:02d}"
            header = self._read_header()
            self.session_id: str = header["session_id"]
            self._count(summaries)
            if self.counts.kept_in_session.total() < episodes or is_open(self.path):
                if header["settings"] != dict(settings):
                    raise InvalidValueError(
                        str(self.path), f"the settings that it began with, {header['settings']}, or --new-session",
                        dict(settings),
                    )  # fmt: skip
                self.continued = True
            elif once:
                expected = f"a session of {pair} with episodes to play, or --new-session"
                raise RunError(f"{self.path}: expected {expected}, found all {episodes} episodes kept")
        if not self.continued:
            self._begin(out, pair, number + 1, settings)
            self._count(summaries)
        self.journal("continue" if self.continued else "begin", episodes=episodes)

    @property
    def kept_recordings(self) -> list[RecordingSummary]:
        """The recordings of this session that count, oldest first."""
        summaries = iter_recordings(self.path)
        return [summary for summary in summaries if summary.counts and summary.session_id == self.session_id]

    def next_path(self) -> Path:
        """The path of the next recording; its number follows all that were ever begun in this folder."""
        numbers = [int(match[1]) for entry in self.path.iterdir() if (match := _EPISODE.match(entry.name))]
        return self.path / f"episode_{max(numbers, default=-1) + 1:03d}.mcap"

    def count(self, map_id: str, seating: int, counts: bool, by: int = 1) -> None:
        """Adds an episode to the counts, or removes it with `by=-1`."""
        if by > 0:
            self.counts.attempted[map_id, seating] += by
        if counts:
            self.counts.kept[map_id, seating] += by
            self.counts.kept_in_session[map_id, seating] += by

    def undo_last_keep(self) -> RecordingSummary | None:
        """Undoes the last keep: its recording is renamed, so that it no longer counts.

        Returns:
            The recording as it was; None if no episode was kept.
        """
        kept = self.kept_recordings
        if not kept:
            return None
        last = kept[-1]
        os.replace(last.path, last.path.with_name(last.path.name + _UNDONE))
        sync_folder(self.path)
        self.count(last.map_id, last.seating, True, by=-1)
        self.journal("undo", file=last.path.name)
        return last

    def journal(self, event: str, **entries: Any) -> None:
        """Appends a line to the journal; a failure is only logged, since the counts come from the recordings."""
        line = {"time": datetime.now(UTC).isoformat(timespec="milliseconds"), "event": event, **entries}
        try:
            with (self.path / _JOURNAL).open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
        except OSError as error:
            logging.warning("%s: not written: %s", self.path / _JOURNAL, error.strerror)

    @staticmethod
    def _last_number(out: Path, pair: str) -> int:
        name = re.compile(re.escape(pair) + r"-(\d+)")
        return max((int(m[1]) for entry in out.iterdir() if (m := name.fullmatch(entry.name))), default=0)

    def _begin(self, out: Path, pair: str, number: int, settings: Mapping[str, Any]) -> None:
        self.path = out / f"{pair}-{number:02d}"
        self.path.mkdir()
        self.session_id = f"{self.path.name}-{uuid.uuid4().hex[:8]}"
        header = {"session_id": self.session_id, "pair_id": pair, "settings": dict(settings)}
        replace_json(self.path / _HEADER, header)

    def _read_header(self) -> dict[str, Any]:
        path = self.path / _HEADER
        try:
            header = json.loads(path.read_text(encoding="utf-8"))
            if not isinstance(header["session_id"], str) or not isinstance(header["settings"], dict):
                raise ValueError(str(header))
        except FileNotFoundError:
            raise FileFormatError(path, "a session's header (or --new-session)", "none") from None
        except (ValueError, KeyError, TypeError) as error:
            raise FileFormatError(path, "a session's header (or --new-session)", f"{error}") from None
        return header

    def _count(self, summaries: list[RecordingSummary]) -> None:
        self.counts = EpisodeCounts()
        for summary in summaries:
            key = (summary.map_id, summary.seating)
            in_session = summary.session_id == self.session_id
            self.counts.kept[key] += summary.counts
            self.counts.attempted[key] += in_session and not summary.practice
            self.counts.kept_in_session[key] += in_session and summary.counts
