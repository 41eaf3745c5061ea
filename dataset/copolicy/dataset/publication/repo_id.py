"""Checks repository names by the rules of the Hub's client, which the base install does not include."""

import re
from pathlib import Path

from ..exceptions import InvalidValueError

_PART = re.compile(r"[A-Za-z0-9_](?:[A-Za-z0-9_.-]{0,94}[A-Za-z0-9_])?")
_MAX_LENGTH = 96


def checked_repo_id(text: str, name: str = "--repo-id") -> str:
    """Returns a repository name unchanged after checking it.

    Args:
        name: flag or argument, for the error message.

    Raises:
        InvalidValueError: not USER/NAME, or a name that the Hub refuses; the message says why.
    """
    problem = repo_id_problem(text)
    if problem is not None:
        raise InvalidValueError(name, f"USER/NAME that the Hub accepts ({problem})", text)
    return text


def repo_id_problem(text: str) -> str | None:
    """The rule of the Hub that a name violates, or None.

    The rules are those of `huggingface_hub.utils.validate_repo_id`; in addition a user is required.
    """
    parts = text.split("/")
    if len(parts) != 2:
        return "one slash between user and name"
    if any(not part for part in parts):
        return "a user and a name"
    if any(len(part) > _MAX_LENGTH for part in parts):
        return f"at most {_MAX_LENGTH} characters each"
    if not re.fullmatch(r"[A-Za-z0-9_./-]+", text):
        return "letters a to z, digits, '-', '_' and '.' only"
    if not all(_PART.fullmatch(part) for part in parts):
        return "no '-' or '.' at the beginning or end of user and name"
    if "--" in text or ".." in text:
        return "no '--' and no '..'"
    if text.endswith(".git"):
        return "no '.git' at the end"
    return None


def local_repo_id(folder: Path) -> str:
    """`local/NAME` for a data set without a repository, from its folder's name as far as the Hub's rules allow."""
    name = re.sub(r"[^A-Za-z0-9_.-]+", "-", folder.resolve().name)
    name = re.sub(r"\.{2,}", ".", re.sub(r"-{2,}", "-", name)).strip("-.")[:_MAX_LENGTH].rstrip("-.")
    return f"local/{name.removesuffix('.git') or 'dataset'}"
