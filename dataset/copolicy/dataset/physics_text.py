"""The settings of the dynamics as one text: the episode column `physics` of a data set.

Canonical JSON of all settings of `task.Physics`, keys sorted, numbers in exact digits, so that equal settings have
equal texts; an empty text where nobody knows them. What led from state to state may differ from episode to episode,
and whoever integrates an episode any further must take its own.
"""

import json
import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, fields
from typing import Any

from copolicy.tasks.table.physics import Physics

from .exceptions import InvalidValueError

UNKNOWN = "unknown"
"""What `physics_counts` calls the settings of episodes that state none."""

_INTEGERS = ("step_limit",)
_NAMES = {math.pi / 2: "pi/2", math.pi / 8: "pi/8"}


def physics_text(physics: Physics) -> str:
    """The text of some settings."""
    return json.dumps(asdict(physics), sort_keys=True, allow_nan=False)


def physics_of(text: str | None) -> Physics | None:
    """The inverse of `physics_text`; None where nothing is stated (a merge with another tool leaves a null).

    Raises:
        InvalidValueError: the text is not that of settings.
    """
    if not text:
        return None
    expected = "an empty text, or JSON of the settings of the dynamics"
    try:
        entries = json.loads(text)
    except (ValueError, TypeError, RecursionError):
        raise InvalidValueError("physics", expected, text) from None
    names = {setting.name for setting in fields(Physics)}
    if not isinstance(entries, dict) or set(entries) != names:
        raise InvalidValueError("physics", f"{expected}: {', '.join(sorted(names))}", text)
    settings: dict[str, Any] = {}
    for name, value in entries.items():
        kind = int if name in _INTEGERS else int | float
        if not isinstance(value, kind) or isinstance(value, bool):
            raise InvalidValueError(f"physics: {name}", "a number", value)
        try:
            settings[name] = value if name in _INTEGERS else float(value)
        except OverflowError:
            raise InvalidValueError(f"physics: {name}", "a finite number", value) from None
    return Physics(**settings)


def physics_summary(physics: Physics | None) -> str:
    """Settings in words: the bound on the angular acceleration, and whatever else is not the default."""
    if physics is None:
        return UNKNOWN
    limit = physics.angular_acceleration_limit
    default = asdict(Physics())
    others = [
        f"{name} {value:g}"
        for name, value in asdict(physics).items()
        if name != "angular_acceleration_limit" and value != default[name]
    ]
    return ", ".join([f"angular acceleration up to {_NAMES.get(limit, f'{limit!r}')} rad/s^2", *others])


def physics_counts(texts: Iterable[str | None]) -> dict[str, int]:
    """How many episodes have which settings, in words, most frequent first.

    Raises:
        InvalidValueError: a text is not that of settings.
    """
    summed: Counter[str] = Counter()
    for text, count in Counter(texts).items():
        summed[physics_summary(physics_of(text))] += count
    return dict(sorted(summed.items(), key=lambda entry: (-entry[1], entry[0])))
