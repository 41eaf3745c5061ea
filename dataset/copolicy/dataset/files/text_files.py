"""Reads text files written by people: UTF-8, with or without a byte order mark."""

import logging
from pathlib import Path

from ..exceptions import FileFormatError

_LEGACY_ENCODING = "cp1252"  # former default of Windows editors; agrees with Latin-1 for all letters


def read_text(path: Path) -> str:
    """Reads a UTF-8 text file.

    Raises:
        FileFormatError: the file has another encoding.
        OSError: the file cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        found = f"the byte 0x{error.object[error.start]:02x} at position {error.start}"
        raise FileFormatError(path, "UTF-8 text", found) from None


def read_legacy_text(path: Path) -> str:
    """Reads a text file; one that is not UTF-8 is read as Windows-1252 with a warning instead of an error."""
    try:
        return read_text(path)
    except FileFormatError:
        logging.warning("warning: %s: not in UTF-8, read as Windows-1252", path)
        return path.read_bytes().decode(_LEGACY_ENCODING, errors="replace")
