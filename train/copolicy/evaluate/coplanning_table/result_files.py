"""Files with results of co-planning below a folder, without torch."""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from copolicy.dataset.files.listing import is_hidden

CHECKPOINTS = "checkpoints"
"""Folder of the checkpoints in the folder of a training run."""

STUDY = "coplan"
"""Name of the study in results."""


def read_result(path: Path) -> dict[str, Any] | None:
    """A result of co-planning; None for any other file."""
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return None
    parts = ("policy", "settings", "summary")
    if not isinstance(content, dict) or content.get("study") != STUDY:
        return None
    return content if all(isinstance(content.get(name), dict) for name in parts) else None


def json_files(folder: Path) -> list[Path]:
    """JSON files below a folder other than in checkpoints, sorted; links to folders are followed."""
    return list(_json_files(folder, set()))


def _json_files(folder: Path, visited: set[Path]) -> Iterator[Path]:
    if (real := folder.resolve()) in visited:
        return
    visited.add(real)
    for name in sorted(os.listdir(folder)):
        path = folder / name
        if is_hidden(name) or name == CHECKPOINTS:
            continue
        if path.is_dir():
            yield from _json_files(path, visited)
        elif path.suffix == ".json":
            yield path
