"""What other commands left in a data set's `meta/` folder, when they were run."""

import json
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError

CHECK_FILE = Path("meta/copolicy_check.json")
"""Findings of `copolicy-dataset check`."""

STATISTICS_FILE = Path("meta/copolicy_stats.json")
"""Multimodality statistics of `copolicy-dataset stats`."""


def read_json(path: Path) -> dict[str, Any] | None:
    """The object in a JSON file, or None where there is no such file.

    Raises:
        FileFormatError: there is a file, and it holds no JSON object.
    """
    if not path.is_file():
        return None
    try:
        value = json.loads(path.read_text())
    except (ValueError, UnicodeDecodeError) as error:
        raise FileFormatError(path, "JSON", str(error)) from None
    if not isinstance(value, dict):
        raise FileFormatError(path, "a JSON object", type(value).__name__)
    return value


RELEASE_FILE = Path("meta/copolicy_release.json")
"""The newest release, made by `copolicy-dataset release`."""

CONVERSION_FILE = Path("meta/copolicy.json")
"""How the data set was converted, made by `copolicy-convert`."""


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
