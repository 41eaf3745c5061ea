"""Texts that people write: UTF-8, with or without a byte order mark."""

import logging
from pathlib import Path

from ..exceptions import FileFormatError

_OLDER = "cp1252"  # what editors on Windows wrote; Latin-1 for every letter


def read_text(path: Path) -> str:
    """The text of a file in UTF-8.

    Raises:
        FileFormatError: in another encoding.
        OSError: it cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        found = f"the byte 0x{error.object[error.start]:02x} at position {error.start}"
        raise FileFormatError(path, "a text in UTF-8", found) from None


def read_older_text(path: Path) -> str:
    """The same of a text that must not be lost: one in another encoding is read as Windows-1252, with a warning."""
    try:
        return read_text(path)
    except FileFormatError:
        logging.warning("warning: %s: not in UTF-8, read as Windows-1252", path)
        return path.read_bytes().decode(_OLDER, errors="replace")
