"""Finds and removes the names of withdrawn episodes and people in texts and JSON files."""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

REMOVED = "(withdrawn)"
_NOT_TEXT = {".parquet", ".mp4", ".mcap", ".png", ".jpg", ".jpeg", ".gif", ".safetensors", ".hdf5", ".npz"}
_CHUNK_SIZE = 1 << 20
"""Number of characters of a file that are searched at a time."""


@dataclass(frozen=True)
class Traces:
    """Names that must not remain after a withdrawal.

    Attributes:
        names: the consent id, `episode_uuid`s, digests of recordings, and pseudonyms of no remaining episode.
        files: names of deleted recordings; only searched in JSON lists and journals, because other sessions have
            files of the same names.
    """

    names: frozenset[str]
    files: frozenset[str] = frozenset()

    def matches(self, text: str) -> bool:
        """Whether a text contains one of the names."""
        return self._pattern is not None and self._pattern.search(text) is not None

    def redact(self, text: str) -> str:
        """Replaces every name in a text by `(withdrawn)`."""
        return text if self._pattern is None else self._pattern.sub(REMOVED, text)

    def redact_json(self, value: Any) -> Any:
        """Removes list entries and keys that are names from a JSON value, and replaces names in texts."""
        removed = self.names | self.files
        if isinstance(value, dict):
            return {key: self.redact_json(item) for key, item in value.items() if key not in self.names}
        if isinstance(value, list):
            return [self.redact_json(item) for item in value if not (isinstance(item, str) and item in removed)]
        if isinstance(value, str):
            return REMOVED if value in self.names else self.redact(value)
        return value

    def drop_lines(self, text: str) -> str:
        """Removes the lines of a journal (one JSON object per line) that contain a name or a deleted recording."""
        return "".join(line for line in text.splitlines(keepends=True) if not self._line_matches(line))

    def matching_files(self, folder: Path) -> Iterable[Path]:
        """Yields the text files below a folder that still contain a name; reads files in chunks."""
        for path in sorted(folder.rglob("*")):
            if path.is_file() and path.suffix not in _NOT_TEXT and not _is_binary(path) and self._file_matches(path):
                yield path

    def _file_matches(self, path: Path) -> bool:
        pattern = self._pattern
        if pattern is None:
            return False
        overlap = max(len(name) for name in self.names) + 1  # and the preceding character
        with path.open(encoding="utf-8", errors="replace") as file:
            text, at_start = file.read(_CHUNK_SIZE), True
            while text:
                next_text = file.read(_CHUNK_SIZE)
                for match in pattern.finditer(text):
                    # At the edge of a chunk the next character may be part of a longer name.
                    if (match.start() or at_start) and (match.end() < len(text) or not next_text):
                        return True
                if not next_text:
                    return False
                text, at_start = text[-overlap - 1 :] + next_text, False
        return False

    @property
    def _pattern(self) -> re.Pattern[str] | None:
        # A numeric consent id such as 12 is not searched in texts: it would match other numbers.
        names = sorted((name for name in self.names if re.search(r"[^\W\d]", name)), key=len, reverse=True)
        return re.compile(rf"(?<![\w-])(?:{'|'.join(map(re.escape, names))})(?![\w-])") if names else None

    def _line_matches(self, line: str) -> bool:
        try:
            values = set(_texts(json.loads(line)))
        except ValueError:
            return self.matches(line)
        return bool(values & (self.names | self.files)) or any(self.matches(value) for value in values)


def _is_binary(path: Path) -> bool:
    """Whether a file has a zero byte near its beginning, git's test for binary files."""
    with path.open("rb") as file:
        return b"\0" in file.read(8000)


def _texts(value: Any) -> Iterable[str]:
    if isinstance(value, dict):
        for item in value.values():
            yield from _texts(item)
    elif isinstance(value, list):
        for item in value:
            yield from _texts(item)
    elif isinstance(value, str):
        yield value
