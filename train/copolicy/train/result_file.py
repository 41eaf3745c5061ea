"""Result files of studies: new ones, and there whole or not at all."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError, OutputExistsError
from copolicy.dataset.file_kinds import kind_of
from copolicy.dataset.staging import replace_text


def require_new(*paths: Path, overwrite: bool = False) -> None:
    """
    Raises:
        OutputExistsError: one of them exists and must not be overwritten.
    """
    for path in paths:
        if path.exists() and not overwrite:
            raise OutputExistsError(path)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Writes a JSON object, whole or not at all; makes the folder."""
    replace_text(path, json.dumps(content, indent=1) + "\n")


def read_json(path: Path, what: str) -> dict[str, Any]:
    """A JSON object.

    Args:
        what: it should be, for the error.

    Raises:
        FileFormatError: no such file, or no JSON object.
    """
    if path.exists() and not path.is_file():
        raise FileFormatError(path, what, kind_of(path))
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError:
        raise FileFormatError(path, what, kind_of(path)) from None
    except OSError as error:
        raise FileFormatError(path, what, error.strerror or str(error)) from None
    except (ValueError, RecursionError) as error:
        raise FileFormatError(path, what, f"no JSON ({error})") from None
    if not isinstance(content, dict):
        raise FileFormatError(path, what, f"a JSON {type(content).__name__}")
    return content
