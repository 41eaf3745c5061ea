"""What differs between the statistics of two data sets."""

import math
from pathlib import Path
from typing import Any

from ..files.json_file import read_json
from ..files.meta_files import STATISTICS_FILE


def read_statistics(root: Path) -> dict[str, Any] | None:
    """The stored statistics of a folder by the path of each value, `None` where there are none.

    Raises:
        FileFormatError: a file that is no JSON object.
    """
    path = root / STATISTICS_FILE
    if not path.exists():
        return None
    return dict(_flat(read_json(path, dict, "statistics of copolicy-dataset stats")))


def compare_statistics(before: dict[str, Any], after: dict[str, Any]) -> dict[str, tuple[Any, Any]]:
    """For each value that differs, before and after; `None` where one side lacks it."""
    names = [*before, *(name for name in after if name not in before)]
    return {
        name: (before.get(name), after.get(name)) for name in names if not _equal(before.get(name), after.get(name))
    }


def _flat(value: Any, name: str = ""):
    if isinstance(value, dict) and value:
        for key, item in value.items():
            yield from _flat(item, f"{name}.{key}" if name else str(key))
    elif isinstance(value, list) and any(isinstance(item, (dict, list)) for item in value):
        for place, item in enumerate(value):
            yield from _flat(item, f"{name}[{place}]")
    else:
        yield name, value


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, float) and isinstance(b, float) and math.isnan(a) and math.isnan(b):
        return True
    return a == b
