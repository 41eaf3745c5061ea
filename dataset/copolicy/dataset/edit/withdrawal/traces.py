"""Names of withdrawn episodes and people in texts and JSON files, and how they are taken out."""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

REMOVED = "(withdrawn)"
_TEXTS = {".json", ".jsonl", ".md", ".txt", ".csv", ".html", ".yaml", ".yml", ".toml"}
_LARGEST = 64 << 20


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
        """Text files below a folder that still name one of them."""
        for path in sorted(folder.rglob("*")):
            text = path.suffix in _TEXTS and path.is_file() and path.stat().st_size <= _LARGEST
            if text and self.in_text(path.read_text(encoding="utf-8", errors="replace")):
                yield path

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


def _texts(value: Any) -> Iterable[str]:
    if isinstance(value, dict):
        for item in value.values():
            yield from _texts(item)
    elif isinstance(value, list):
        for item in value:
            yield from _texts(item)
    elif isinstance(value, str):
        yield value
