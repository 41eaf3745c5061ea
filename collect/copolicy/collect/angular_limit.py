"""The flag `--angular-limit` of commands that simulate: a bound on the angular acceleration, where a task has one."""

import math
from dataclasses import replace
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import PairTask

ANGULAR_LIMITS = {"pi/2": math.pi / 2, "pi/8": math.pi / 8}
"""Bounds that recordings are made with, rad/s^2."""

LIMIT_SETTING = "angular_acceleration_limit"
"""The setting of a world behind the flag."""


def angular_limit_of(settings: Any) -> float | None:
    """The bound in the settings of a world; None where they have none."""
    return getattr(settings, LIMIT_SETTING, None)


def with_angular_limit(task: PairTask, settings: Any, limit: str | float) -> Any:
    """Settings with a bound, in rad/s^2 or by its name.

    Raises:
        InvalidValueError: no such name, or the task has no such setting.
    """
    if angular_limit_of(settings) is None:
        raise InvalidValueError("--angular-limit", "no such flag", task.missing("angular acceleration"))
    if isinstance(limit, str):
        if limit not in ANGULAR_LIMITS:
            raise InvalidValueError("angular limit", f"one of {sorted(ANGULAR_LIMITS)}", limit)
        limit = ANGULAR_LIMITS[limit]
    return replace(settings, **{LIMIT_SETTING: limit})
