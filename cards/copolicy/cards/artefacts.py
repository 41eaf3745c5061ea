"""What other commands left in a data set's `meta/` folder, when they were run."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.checks.stored_check import CHECK_FILE, Validity, content_hash, validity
from copolicy.dataset.exceptions import FileFormatError

__all__ = [
    "CHECK_FILE",
    "CONVERSION_FILE",
    "RELEASE_FILE",
    "STATISTICS_FILE",
    "KeptFindings",
    "estimates",
    "kept_findings",
    "read_json",
    "statistics_doubt",
]

STATISTICS_FILE = Path("meta/copolicy_stats.json")
"""Multimodality statistics of `copolicy-dataset stats`."""

RELEASE_FILE = Path("meta/copolicy_release.json")
"""The newest release, made by `copolicy-dataset release`."""

CONVERSION_FILE = Path("meta/copolicy.json")
"""How the data set was converted, made by `copolicy-convert`."""


@dataclass(frozen=True)
class KeptFindings:
    """Findings of `copolicy-dataset check`, and whether they are about the data beside them."""

    document: dict[str, Any]
    validity: Validity


def kept_findings(root: Path, path: Path | None = None) -> KeptFindings | None:
    """The findings kept in a data set or in another file, None where there are none.

    Raises:
        FileFormatError: there is a file, and it holds no JSON object.
    """
    document = read_json(path or root / CHECK_FILE)
    if document is None:
        return None
    # Reading the whole content is worth the time only where there is something to compare it with.
    content = content_hash(root) if document.get("content_hash") else None
    return KeptFindings(document, validity(document, content))


def read_json(path: Path) -> dict[str, Any] | None:
    """The object in a JSON file, or None where there is no such file.

    Raises:
        FileFormatError: there is a file, and it holds no JSON object.
    """
    if not path.is_file():
        return None
    try:
        value = json.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, UnicodeDecodeError) as error:
        raise FileFormatError(path, "JSON", str(error)) from None
    if not isinstance(value, dict):
        raise FileFormatError(path, "a JSON object", type(value).__name__)
    return value


def statistics_doubt(stored: dict[str, Any], episodes: int) -> str:
    """Why stored statistics are not those of a data set with so many episodes; empty where nothing speaks for it."""
    described = stored.get("dataset", {})
    if "episodes" not in described:
        return ""
    counted = described["episodes"] + sum(described.get("left_out", {}).values())
    if counted == episodes:
        return ""
    return f"They were computed when the data set had {counted} episodes; it has {episodes} now."


def estimates(node: Any, path: tuple[str, ...] = ()) -> list[dict[str, Any]]:
    """The statistics in a JSON tree: every object with a value and a unit, named by where it lies.

    What an estimate is made of (`details`) is left out.
    """
    if not isinstance(node, dict):
        return []
    if "value" in node and "unit" in node:
        entry = {key: value for key, value in node.items() if key != "details"}
        return [{"name": ": ".join(path).replace("_", " "), **entry}]
    return [
        entry
        for key, child in node.items()
        for entry in estimates(child, path if key == "statistics" else (*path, str(key)))
    ]
