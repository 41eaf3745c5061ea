"""The folder of a session: one tool at a time, one session after the other, nothing ever overwritten."""

import json
import logging
import os
import re
import uuid
from collections import Counter
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.lock import FolderLock
from copolicy.dataset.files.staging import replace_json, sync_folder
from copolicy.dataset.task import TABLE

from .balance import Counts
from .recorded import Recorded, recordings

_LOCK = ".copolicy.lock"
_HEADER = "session.json"
_JOURNAL = "journal.jsonl"
_UNDONE = ".undone"
_EPISODE = re.compile(r"episode_(\d+)\.")


class CollectionLock(FolderLock):
    """Held while a tool collects into a folder."""

    def __init__(self, folder: Path):
        super().__init__(
            folder / _LOCK, f"{folder}: expected a folder that no other tool collects into, found one running"
        )


class SessionFolder:
    """One session of one pair in `out/PAIR-NN/`.

    `session.json` says what the session is, `journal.jsonl` what happened, line by line; the recordings beside them
    are what counts. An undone keep has `.undone` behind its name, so that no tool takes it for a recording.

    Attributes:
        path: of the folder.
        session_id: of its recordings.
        counts: what was played so far.
        continued: it was begun at an earlier time.
    """

    def __init__(
        self,
        out: Path,
        pair: str,
        settings: Mapping[str, Any],
        episodes: int,
        fresh: bool = False,
        task: str = TABLE,
    ):
        """Continues the pair's last session where it is not finished, else begins another.

        Args:
            out: folder of all sessions.
            pair: its name.
            settings: what must not change within a session; JSON-able.
            episodes: that the session is to keep.
            fresh: begin another in any case.
            task: whose recordings count.

        Raises:
            InvalidValueError: the unfinished session has other settings.
            FileFormatError: its `session.json` is damaged.
            OSError: the folder cannot be written to.
        """
        everything = [one for one in recordings(out) if one.task == task]
        self.continued = False
        number = self._last_number(out, pair)
        if number and not fresh:
            self.path = out / f"{pair}-{number:02d}"
            header = self._read_header()
            self.session_id: str = header["session_id"]
            self._count(everything)
            if self.counts.kept_here.total() < episodes:
                if header["settings"] != dict(settings):
                    raise InvalidValueError(
                        str(self.path), f"the settings that it began with, {header['settings']}, or --new-session",
                        dict(settings),
                    )  # fmt: skip
                self.continued = True
        if not self.continued:
            self._begin(out, pair, number + 1, settings)
            self._count(everything)
        self.journal("continue" if self.continued else "begin", episodes=episodes)

    @property
    def kept(self) -> list[Recorded]:
        """The recordings of this session that count, oldest first."""
        return [one for one in recordings(self.path) if one.counts and one.session_id == self.session_id]

    def next_path(self) -> Path:
        """The name of the next recording: after all that were ever begun here."""
        numbers = [int(match[1]) for entry in self.path.iterdir() if (match := _EPISODE.match(entry.name))]
        return self.path / f"episode_{max(numbers, default=-1) + 1:03d}.mcap"

    def count(self, map_id: str, seating: int, counts: bool, by: int = 1) -> None:
        """Takes an episode into the counts (or out of them)."""
        if by > 0:
            self.counts.tried[map_id, seating] += by
        if counts:
            self.counts.kept[map_id, seating] += by
            self.counts.kept_here[map_id, seating] += by

    def undo_last_keep(self) -> Recorded | None:
        """Takes the last keep back: its recording stays, but under a name that nothing reads as one.

        Returns:
            What it was; None where there is nothing to undo.
        """
        kept = self.kept
        if not kept:
            return None
        last = kept[-1]
        os.replace(last.path, last.path.with_name(last.path.name + _UNDONE))
        sync_folder(self.path)
        self.count(last.map_id, last.seating, True, by=-1)
        self.journal("undo", file=last.path.name)
        return last

    def journal(self, event: str, **entries: Any) -> None:
        """Adds a line to the journal; one that cannot be written stops nothing, since recordings are what counts."""
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

    def _count(self, everything: list[Recorded]) -> None:
        self.counts = Counts(Counter(), Counter(), Counter())
        for one in everything:
            key = (one.map_id, one.seating)
            here = one.session_id == self.session_id
            self.counts.kept[key] += one.counts
            self.counts.tried[key] += here and not one.practice
            self.counts.kept_here[key] += here and one.counts
