"""Decides whether a name that is not a local path is a mistyped path or a repository on the Hub."""

import difflib
import re
from pathlib import Path

from ..exceptions import FileFormatError
from ..publication.repo_id import repo_id_problem

_URL = re.compile(r"(?:hf://|https?://(?:huggingface\.co|hf\.co)/)(?:(datasets|models)/)?(?P<id>[^/\s]+/[^/\s@?#]+)/?")


def repo_id_from_url(text: str) -> str | None:
    """Extracts `USER/NAME` from a Hub URL (`hf://datasets/U/N` or a web address); None for any other text."""
    match = _URL.fullmatch(text)
    return match["id"] if match else None


def require_repo_id(text: str, expected: str, hub_hint: str = "write hf://datasets/{} for the Hub") -> str:
    """Returns the USER/NAME on the Hub that a text names when no such local path exists.

    A text with one slash may be a path or a repository. It counts as a path if its first part is an existing folder,
    or if a path of similar name exists.

    Args:
        expected: what the text should be, for the error message.
        hub_hint: how to name the repository when the text counts as a path, with `{}` for the text.

    Raises:
        FileFormatError: a path that does not exist; the message suggests a similar existing path.
    """
    repo_id = repo_id_from_url(text)
    if repo_id is not None:
        if (problem := repo_id_problem(repo_id)) is not None:
            raise FileFormatError(text, f"{expected} that the Hub accepts ({problem})", repr(repo_id))
        return repo_id
    problem = repo_id_problem(text)
    similar = similar_path(text)
    parent = Path(text).parent
    if problem is not None or similar is not None or parent.is_dir():
        found = "no such file or folder"
        if similar is not None:
            found += f"; did you mean {similar}?"
        elif problem is not None and text.count("/") == 1 and not text.startswith((".", "/", "~")):
            found += f", and not a valid name on the Hub ({problem})"
        if problem is None:
            found += f" ({hub_hint.format(text)})"
        raise FileFormatError(text, expected, found)
    return text


def similar_path(text: str) -> str | None:
    """Finds an existing path of similar name, part by part; None if there is none."""
    path = Path(text).expanduser()
    existing = Path(path.anchor) if path.is_absolute() else Path()
    for part in path.parts[1:] if path.is_absolute() else path.parts:
        if part != ".." and not (existing / part).exists():
            names = sorted(entry.name for entry in existing.iterdir()) if existing.is_dir() else []
            close = difflib.get_close_matches(part, names, n=1, cutoff=0.7)
            if not close:
                return None
            part = close[0]
        existing = existing / part
    return str(existing)
