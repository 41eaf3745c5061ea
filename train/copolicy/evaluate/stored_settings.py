"""Settings that determine the episodes of a stored result, so that a stopped run uses no result of another."""

import json
from collections.abc import Iterator, Mapping
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
        InvalidValueError: it has others; the message names the first, that of a robot as `robot.sampler`.
    """
    for name, wanted, found in differences(now, stored):
        first, second = (json.dumps(value)[:80] for value in (wanted, found))
        raise InvalidValueError(
            str(path), f"{name} {first} as in this run (another --out, or --overwrite)", f"{name} {second}"
        )


def differences(
    first: Mapping[str, Any], second: Mapping[str, Any], prefix: str = ""
) -> Iterator[tuple[str, Any, Any]]:
    """Names of entries that differ, with both values; those of nested entries are joined by dots, null is no entry."""
    for name in dict.fromkeys((*first, *second)):
        here, there = first.get(name), second.get(name)
        if isinstance(here, Mapping) and isinstance(there, Mapping):
            yield from differences(here, there, f"{prefix}{name}.")
        elif here != there:
            yield f"{prefix}{name}", here, there
