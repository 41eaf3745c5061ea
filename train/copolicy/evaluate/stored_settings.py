"""Settings that determine the episodes of a stored result, so that a stopped run uses no result of another."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError

_OF_A_RUN = ("checkpoint", "planned_with")  # entries of a description that do not determine the episodes


def without_run(described: Any) -> Any:
    """A description of a policy or partner without what does not determine the episodes."""
    if not isinstance(described, Mapping):
        return described
    return {name: without_run(value) for name, value in described.items() if name not in _OF_A_RUN}


def require_same_settings(path: Path, stored: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Checks that a result has the settings of this call.

    Raises:
        InvalidValueError: it has others; the message names the first.
    """
    for name in (*now, *stored):
        if stored.get(name) != now.get(name):
            first, second = (json.dumps(each.get(name))[:80] for each in (now, stored))
            expected = f"{name} {first} as in this run (another --out, or --overwrite)"
            raise InvalidValueError(str(path), expected, f"{name} {second}")
