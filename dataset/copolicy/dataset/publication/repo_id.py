"""The name of a repository on the Hub, by the rules of the Hub's client, which the base install lacks."""

import re
from pathlib import Path

from ..exceptions import InvalidValueError

_PART = re.compile(r"[A-Za-z0-9_](?:[A-Za-z0-9_.-]{0,94}[A-Za-z0-9_])?")
_LONGEST = 96


def checked_repo_id(text: str, name: str = "--repo-id") -> str:
    """The repository as it was given.

    Args:
        name: of the flag or argument, for the message.

    Raises:
        InvalidValueError: not USER/NAME, or a name that the Hub refuses; the message says why.
    """
    problem = repo_id_problem(text)
    if problem is not None:
        raise InvalidValueError(name, f"USER/NAME as the Hub takes it ({problem})", text)
    return text


def repo_id_problem(text: str) -> str | None:
    """The rule of the Hub that a name breaks, or None.

    The rules are those of `huggingface_hub.utils.validate_repo_id`; in addition a user is wanted.
    """
    parts = text.split("/")
    if len(parts) != 2:
        return "one slash between user and name"
    if any(not part for part in parts):
        return "a user and a name"
    if any(len(part) > _LONGEST for part in parts):
        return f"at most {_LONGEST} characters each"
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
    """`local/NAME` for a data set that has no name on the Hub, after its folder as far as the Hub's rules allow."""
    name = re.sub(r"[^A-Za-z0-9_.-]+", "-", folder.resolve().name)
    name = re.sub(r"\.{2,}", ".", re.sub(r"-{2,}", "-", name)).strip("-.")[:_LONGEST].rstrip("-.")
    return f"local/{name.removesuffix('.git') or 'dataset'}"
