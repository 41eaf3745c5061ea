"""The world settings of an episode as text: the episode column `physics` of a data set.

Canonical JSON of all settings (`PairTask.settings_type`) with sorted keys and exact numbers, so that equal settings
have equal texts; empty if the settings are unknown. Settings may differ between the episodes of a data set: integrate
an episode under its own.
"""

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, fields
from typing import Any

from .exceptions import InvalidValueError
from .task import PairTask, get_task

UNKNOWN = "unknown"
"""Description of the settings of an episode that states none."""


def settings_text(settings: Any) -> str:
    """The canonical JSON of settings."""
    return json.dumps(asdict(settings), sort_keys=True, allow_nan=False)


def parse_settings_text(text: str | None, task: PairTask | None = None) -> Any:
    """Settings from their text, the inverse of `settings_text`; None if the text is empty or None (null).

    Args:
        task: task of the settings; the table by default.

    Raises:
        InvalidValueError: the text is not JSON of the settings of the task.
    """
    if not text:
        return None
    task = task or get_task()
    expected = "an empty text, or JSON of the settings of the dynamics"
    try:
        entries = json.loads(text)
    except (ValueError, TypeError, RecursionError):
        raise InvalidValueError("physics", expected, text) from None
    names = {field.name for field in fields(task.settings_type)}
    if not isinstance(entries, dict) or set(entries) != names:
        raise InvalidValueError("physics", f"{expected}: {', '.join(sorted(names))}", text)
    for name, value in entries.items():
        if isinstance(value, str):
            raise InvalidValueError(f"physics: {name}", "a number", value)
    return task.settings_of(entries, "physics: {}")


def describe_settings(settings: Any, task: PairTask | None = None) -> str:
    """A readable summary of settings (`PairTask.settings_summary`); `unknown` for None. The table by default."""
    return UNKNOWN if settings is None else (task or get_task()).settings_summary(settings)


def count_settings(texts: Iterable[str | None], task: PairTask | None = None) -> dict[str, int]:
    """Number of episodes for each summary of settings, most frequent first. The table task by default.

    Raises:
        InvalidValueError: a text is not JSON of the settings of the task.
    """
    counts: Counter[str] = Counter()
    for text, count in Counter(texts).items():
        counts[describe_settings(parse_settings_text(text, task), task)] += count
    return dict(sorted(counts.items(), key=lambda entry: (-entry[1], entry[0])))
