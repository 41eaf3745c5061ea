"""The settings of an episode's world as one text: the episode column `physics` of a data set.

Canonical JSON of all settings (`PairTask.settings_type`), keys sorted, numbers in exact digits, so that equal settings
have equal texts; an empty text where nobody knows them. What led from state to state may differ from episode to
episode, and whoever integrates an episode any further must take its own.
"""

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, fields
from typing import Any

from .exceptions import InvalidValueError
from .task import PairTask, get_task

UNKNOWN = "unknown"
"""What `count_settings` calls the settings of episodes that state none."""


def settings_text(settings: Any) -> str:
    """The text of some settings."""
    return json.dumps(asdict(settings), sort_keys=True, allow_nan=False)


def parse_settings_text(text: str | None, task: PairTask | None = None) -> Any:
    """The inverse of `settings_text` for a task, the table by default; None where nothing is stated (a merge with
    another tool leaves a null).

    Raises:
        InvalidValueError: the text is not that of settings.
    """
    if not text:
        return None
    task = task or get_task()
    expected = "an empty text, or JSON of the settings of the dynamics"
    try:
        entries = json.loads(text)
    except (ValueError, TypeError, RecursionError):
        raise InvalidValueError("physics", expected, text) from None
    names = {setting.name for setting in fields(task.settings_type)}
    if not isinstance(entries, dict) or set(entries) != names:
        raise InvalidValueError("physics", f"{expected}: {', '.join(sorted(names))}", text)
    for name, value in entries.items():
        if isinstance(value, str):
            raise InvalidValueError(f"physics: {name}", "a number", value)
    return task.settings_of(entries, "physics: {}")


def describe_settings(settings: Any, task: PairTask | None = None) -> str:
    """Settings of a task, the table by default, in words."""
    return UNKNOWN if settings is None else (task or get_task()).settings_summary(settings)


def count_settings(texts: Iterable[str | None], task: PairTask | None = None) -> dict[str, int]:
    """How many episodes of a task, the table by default, have which settings, in words, most frequent first.

    Raises:
        InvalidValueError: a text is not that of settings.
    """
    summed: Counter[str] = Counter()
    for text, count in Counter(texts).items():
        summed[describe_settings(parse_settings_text(text, task), task)] += count
    return dict(sorted(summed.items(), key=lambda entry: (-entry[1], entry[0])))
