"""Reads JSON files and checks the types of their values."""

import json
import re
from pathlib import Path
from typing import Any

import msgspec

from ..exceptions import FileFormatError
from .file_kinds import describe_path

_NAMES = {
    "array": "list", "str": "text", "int": "number", "float": "number", "bool": "true or false", "null": "null",
}  # fmt: skip
_MISMATCH = re.compile(r"Expected (?P<expected>.+), got (?P<found>.+?)(?: - at `(?P<location>.+)`)?")


def read_json[T](path: Path, expected_type: type[T], description: str) -> T:
    """Reads a UTF-8 JSON file, with or without a byte order mark.

    Args:
        expected_type: type of the value, for example a `TypedDict`; keys that it does not list are kept.
        description: what the file should be, for error messages.

    Raises:
        FileFormatError: no such file, invalid JSON, or a value of another type; the message says where it is.
    """
    if path.exists() and not path.is_file():  # reading from a pipe would block
        raise FileFormatError(path, description, describe_path(path))
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise FileFormatError(path, description, "no such file") from None
    except OSError as error:
        raise FileFormatError(path, description, error.strerror or str(error)) from None
    except UnicodeDecodeError as error:
        found = describe_path(path)
        if found in ("a JSON file", "a text file"):
            found = f"invalid UTF-8 (byte {error.start})"
        raise FileFormatError(path, description, found) from None
    return parse_json(text, expected_type, description, path)


def read_optional_json(path: Path, expected_type: Any, description: str) -> dict[str, Any] | None:
    """Reads a JSON object like `read_json`; returns None if the file does not exist."""
    return read_json(path, expected_type, description) if path.exists() else None


def parse_json[T](text: str | bytes, expected_type: type[T], description: str, path: Path | str) -> T:
    """Parses a JSON text and checks its type, see `read_json`.

    Args:
        path: file that the text was read from, for error messages.

    Raises:
        FileFormatError: invalid JSON, or a value of another type; the message says where it is.
    """
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FileFormatError(path, description, f"invalid JSON ({error})") from None
    return require_type(value, expected_type, description, path)


def require_type[T](value: Any, expected_type: type[T], description: str, path: Path | str) -> T:
    """Returns a value unchanged after checking its type.

    Raises:
        FileFormatError: it has another type; the message says where.
    """
    convert_json(value, expected_type, description, path)
    return value


def convert_json[T](value: Any, expected_type: type[T], description: str, path: Path | str) -> T:
    """Converts a JSON value to a type such as a dataclass; keys that the type does not list are dropped.

    Raises:
        FileFormatError: the value does not fit the type; the message says where.
    """
    try:
        return msgspec.convert(value, expected_type)
    except msgspec.ValidationError as error:
        raise _mismatch(str(error), description, path) from None


def _mismatch(message: str, description: str, path: Path | str) -> FileFormatError:
    match = _MISMATCH.fullmatch(message)
    if match is None:
        return FileFormatError(path, description, message[0].lower() + message[1:])
    expected = match["expected"].replace("`", "")
    found = match["found"].replace("`", "")
    if not match["location"]:
        return FileFormatError(path, description, f"a JSON {_NAMES.get(found, found)}")
    return FileFormatError(path, f"{description}, with {expected} at {match['location']}", found)
