"""The flag `--angular-limit`: the bound on the angular acceleration, for tasks whose world has this setting."""

import math
from dataclasses import replace
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import PairTask

ANGULAR_LIMITS = {"pi/2": math.pi / 2, "pi/8": math.pi / 8}
"""Named bounds, rad/s^2: of the paper's evaluation, and of its training-time rollouts."""

LIMIT_SETTING = "angular_acceleration_limit"
"""Name of the world's setting."""


def angular_limit_of(settings: Any) -> float | None:
    """The bound in the settings of a world, rad/s^2; None where they have no such setting."""
    return getattr(settings, LIMIT_SETTING, None)


def with_angular_limit(task: PairTask, settings: Any, limit: str | float) -> Any:
    """The settings with another bound, in rad/s^2 or by its name in `ANGULAR_LIMITS`.

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
