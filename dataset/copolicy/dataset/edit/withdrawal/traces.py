"""Names of withdrawn episodes and people in texts and JSON files, and how they are taken out."""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

REMOVED = "(withdrawn)"
_BINARY = {".parquet", ".mp4", ".mcap", ".png", ".jpg", ".jpeg", ".gif", ".safetensors", ".hdf5", ".npz"}
_PART = 1 << 20
"""Characters of a file that are searched at a time."""


@dataclass(frozen=True)
class Traces:
    """Names that may not remain after a withdrawal.

    Attributes:
        names: the consent id, `episode_uuid`s, digests of recordings, and pseudonyms that nobody else has.
        files: names of deleted recordings; they count within a list of names and in a journal only, because another
            session has files of the same names.
    """

    names: frozenset[str]
    files: frozenset[str] = frozenset()

    def in_text(self, text: str) -> bool:
        """Whether a text names one of them."""
        return self._pattern is not None and self._pattern.search(text) is not None

    def without(self, text: str) -> str:
        """The text with `(withdrawn)` in the place of every name."""
        return text if self._pattern is None else self._pattern.sub(REMOVED, text)

    def without_json(self, value: Any) -> Any:
        """The same for a JSON value: entries of lists and keys of objects go, texts lose the names in them."""
        gone = self.names | self.files
        if isinstance(value, dict):
            return {key: self.without_json(item) for key, item in value.items() if key not in self.names}
        if isinstance(value, list):
            return [self.without_json(item) for item in value if not (isinstance(item, str) and item in gone)]
        if isinstance(value, str):
            return REMOVED if value in self.names else self.without(value)
        return value

    def without_lines(self, text: str) -> str:
        """A journal, one JSON object a line, without the lines that name one of them or a deleted recording."""
        return "".join(line for line in text.splitlines(keepends=True) if not self._in_line(line))

    def files_with(self, folder: Path) -> Iterable[Path]:
        """Files below a folder that still name one of them, whatever their length; a file of bytes is none of text."""
        for path in sorted(folder.rglob("*")):
            if path.is_file() and path.suffix not in _BINARY and not _is_binary(path) and self._in_file(path):
                yield path

    def _in_file(self, path: Path) -> bool:
        pattern = self._pattern
        if pattern is None:
            return False
        overlap = max(len(name) for name in self.names) + 1  # and the character before it
        with path.open(encoding="utf-8", errors="replace") as file:
            text, first = file.read(_PART), True
            while text:
                more = file.read(_PART)
                for match in pattern.finditer(text):
                    # At an edge that is not the file's, the character beyond may make it a part of a longer name.
                    if (match.start() or first) and (match.end() < len(text) or not more):
                        return True
                if not more:
                    return False
                text, first = text[-overlap - 1 :] + more, False
        return False

    @property
    def _pattern(self) -> re.Pattern[str] | None:
        # A consent id such as 12 is no name in a text: it would be found in every number.
        names = sorted((name for name in self.names if re.search(r"[^\W\d]", name)), key=len, reverse=True)
        return re.compile(rf"(?<![\w-])(?:{'|'.join(map(re.escape, names))})(?![\w-])") if names else None

    def _in_line(self, line: str) -> bool:
        try:
            values = set(_texts(json.loads(line)))
        except ValueError:
            return self.in_text(line)
        return bool(values & (self.names | self.files)) or any(self.in_text(value) for value in values)


def _is_binary(path: Path) -> bool:
    """By a zero byte near its beginning, as git tells."""
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
