"""A person's answers: one line of JSON an answer, on the disk before the next question is shown."""

import errno
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.listing import distinct_files
from copolicy.dataset.files.staging import sync_folder

ANSWERS = "answers.jsonl"
"""Name of the file in the folder of a session."""


@dataclass(frozen=True)
class Answer:
    """One answer; a later one to the same item replaces it.

    Attributes:
        study: id of the study's plan; empty without one.
        participant: pseudonym.
        block: number of the block that it is about, from 1.
        questionnaire, item: names.
        value: on the item's scale.
        seconds: that the item was selected before the answer.
        source: `human`, or `simulated` if no person took part.
        consent: id of the person's consent record, for a withdrawal; empty if there is none.
        time: of the answer, ISO 8601 in UTC; that of its creation if empty.
    """

    study: str
    participant: str
    block: int
    questionnaire: str
    item: str
    value: float
    seconds: float
    source: str
    consent: str = ""
    time: str = ""

    def __post_init__(self) -> None:
        if not self.time:
            object.__setattr__(self, "time", datetime.now(UTC).isoformat(timespec="milliseconds"))


class AnswerFile:
    """The answers of a session, appended one by one.

    A line that a crash cut short is removed when the file is opened: the person sees that question again.

    Attributes:
        path: of the file; it appears with the first answer.
    """

    def __init__(self, folder: Path):
        """
        Raises:
            FileFormatError: a complete line is no answer.
        """
        self.path = folder / ANSWERS
        self._values: dict[tuple[int, str, str], float] = {}
        for answer in _read(self.path):
            self._keep(answer)

    def values(self, block: int, questionnaire: str) -> dict[str, float]:
        """The newest answer to each answered item of a questionnaire after a block."""
        return {
            item: value
            for (number, name, item), value in self._values.items()
            if (number, name) == (block, questionnaire)
        }

    def add(self, answer: Answer) -> None:
        """Appends an answer; it is on the disk when this returns.

        Raises:
            OSError: it cannot be written; the file has no part of it.
        """
        is_new = not self.path.exists()
        line = (json.dumps(asdict(answer)) + "\n").encode()
        with self.path.open("ab", buffering=0) as file:
            size = _intact_size(self.path)
            file.truncate(size)
            try:
                if file.write(line) < len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                os.fsync(file.fileno())
            except OSError:
                file.truncate(size)
                raise
        if is_new:
            sync_folder(self.path.parent)
        self._keep(answer)

    def _keep(self, answer: Answer) -> None:
        self._values[answer.block, answer.questionnaire, answer.item] = answer.value


def answers_in(folder: Path) -> Iterator[tuple[Path, Answer]]:
    """All answers in a folder and its subfolders with their files, by path and in the order they were given.

    Raises:
        FileFormatError: a complete line is no answer.
    """
    for path in distinct_files(folder, ANSWERS):
        for answer in _read(path):
            yield path, answer


def _intact_size(path: Path) -> int:
    """Bytes until the end of the last complete line."""
    return path.read_bytes().rfind(b"\n") + 1


def _read(path: Path) -> list[Answer]:
    if not path.exists():
        return []
    answers = []
    lines = path.read_bytes()[: _intact_size(path)].splitlines()
    for number, line in enumerate(lines, 1):
        try:
            content: dict[str, Any] = json.loads(line)
            answer = Answer(**content)
            _require_types(answer)
        except (ValueError, TypeError) as error:
            raise FileFormatError(path, f"an answer in line {number}", f"none: {error}") from None
        answers.append(answer)
    return answers


def _require_types(answer: Answer) -> None:
    for name, value in vars(answer).items():
        expected = {"block": int, "value": (int, float), "seconds": (int, float)}.get(name, str)
        if not isinstance(value, expected):
            raise ValueError(f"{name} {value!r}")
