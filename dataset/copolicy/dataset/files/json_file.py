"""JSON files that others wrote, read with their types checked."""

import json
import re
from pathlib import Path
from typing import Any

import msgspec

from ..exceptions import FileFormatError
from .file_kinds import kind_of

_NAMES = {
    "array": "list", "str": "text", "int": "number", "float": "number", "bool": "true or false", "null": "null",
}  # fmt: skip
_MISMATCH = re.compile(r"Expected (?P<expected>.+), got (?P<found>.+?)(?: - at `(?P<place>.+)`)?")


def read_json[T](path: Path, kind: type[T], what: str) -> T:
    """The content of a JSON file in UTF-8, with or without a byte order mark.

    Args:
        kind: the type it must have, for example a `TypedDict`, whose further keys are passed on.
        what: the file is, for the error.

    Raises:
        FileFormatError: no such file, no JSON, or a value of another type; the line names where it is.
    """
    if path.exists() and not path.is_file():  # reading a pipe would wait for ever
        raise FileFormatError(path, what, kind_of(path))
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise FileFormatError(path, what, "no such file") from None
    except OSError as error:
        raise FileFormatError(path, what, error.strerror or str(error)) from None
    except UnicodeDecodeError as error:
        file_kind = kind_of(path)
        found = f"no text in UTF-8 (byte {error.start})" if file_kind in ("a JSON file", "a text file") else file_kind
        raise FileFormatError(path, what, found) from None
    return parse_json(text, kind, what, path)


def read_optional_json(path: Path, kind: Any, what: str) -> dict[str, Any] | None:
    """The same for an object, or None where there is no such file."""
    return read_json(path, kind, what) if path.exists() else None


def parse_json[T](text: str | bytes, kind: type[T], what: str, path: Path | str) -> T:
    """The value in a JSON text, see `read_json`.

    Args:
        path: of the file that the text is from, for the error.

    Raises:
        FileFormatError: no JSON, or a value of another type; the line names where it is.
    """
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FileFormatError(path, what, f"no JSON ({error})") from None
    return require_type(value, kind, what, path)


def require_type[T](value: Any, kind: type[T], what: str, path: Path | str) -> T:
    """A value as it is, if it has a type.

    Raises:
        FileFormatError: it has another one; the line names where it is.
    """
    converted(value, kind, what, path)
    return value


def converted[T](value: Any, kind: type[T], what: str, path: Path | str) -> T:
    """A value as a dataclass; further keys are left out.

    Raises:
        FileFormatError: it is none; the line names where it is.
    """
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        raise _mismatch(str(error), what, path) from None


def _mismatch(message: str, what: str, path: Path | str) -> FileFormatError:
    match = _MISMATCH.fullmatch(message)
    if match is None:
        return FileFormatError(path, what, message[0].lower() + message[1:])
    expected = match["expected"].replace("`", "")
    found = match["found"].replace("`", "")
    if not match["place"]:
        return FileFormatError(path, what, f"a JSON {_NAMES.get(found, found)}")
    return FileFormatError(path, f"{what}, with {expected} at {match['place']}", found)
