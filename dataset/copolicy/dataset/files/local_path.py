"""Whether a name that is no file here is a mistyped path or a repository on the Hub."""

import difflib
import re
from pathlib import Path

from ..exceptions import FileFormatError
from ..publication.repo_id import repo_id_problem

_URL = re.compile(r"(?:hf://|https?://(?:huggingface\.co|hf\.co)/)(?:(datasets|models)/)?(?P<id>[^/\s]+/[^/\s@?#]+)/?")


def named_on_hub(text: str) -> str | None:
    """`USER/NAME` of a name that says itself that it is on the Hub (`hf://datasets/U/N`, a web address), else None."""
    match = _URL.fullmatch(text)
    return match["id"] if match else None


def require_hub_name(text: str, expected: str, way_out: str = "as hf://datasets/{} it is looked up on the Hub") -> str:
    """USER/NAME of the Hub behind a text that is no file here.

    A text with one slash may be either. It is taken for a path where its first part is a folder here, or where a path
    of nearly the same name is.

    Args:
        expected: what the text should be, for the message.
        way_out: how to mean the Hub where a path is likelier, with `{}` for the text.

    Raises:
        FileFormatError: a path that does not exist; the message names a path like it, where there is one.
    """
    hub = named_on_hub(text)
    if hub is not None:
        if (problem := repo_id_problem(hub)) is not None:
            raise FileFormatError(text, f"{expected} as the Hub takes it ({problem})", repr(hub))
        return hub
    problem = repo_id_problem(text)
    similar = similar_path(text)
    parent = Path(text).parent
    if problem is not None or similar is not None or parent.is_dir():
        found = "no such file or folder"
        if similar is not None:
            found += f"; did you mean {similar}?"
        elif problem is not None and text.count("/") == 1 and not text.startswith((".", "/", "~")):
            found += f", and no name that the Hub takes ({problem})"
        if problem is None:
            found += f" ({way_out.format(text)})"
        raise FileFormatError(text, expected, found)
    return text


def similar_path(text: str) -> str | None:
    """An existing path with nearly the same name, part by part; None where there is none."""
    path = Path(text).expanduser()
    here = Path(path.anchor) if path.is_absolute() else Path()
    for part in path.parts[1:] if path.is_absolute() else path.parts:
        if part != ".." and not (here / part).exists():
            names = sorted(entry.name for entry in here.iterdir()) if here.is_dir() else []
            close = difflib.get_close_matches(part, names, n=1, cutoff=0.7)
            if not close:
                return None
            part = close[0]
        here = here / part
    return str(here)
