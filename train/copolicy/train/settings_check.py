"""Numbers of a training that LeRobot takes as they come: refused before any work, with the flag that holds them."""

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

from copolicy.dataset.command_line.flag_numbers import LARGEST_SEED
from copolicy.dataset.exceptions import InvalidValueError

_WHOLE = {
    "steps": 1,
    "batch_size": 1,
    "num_workers": 0,
    "prefetch_factor": 1,
    "log_freq": 0,
    "env_eval_freq": 0,
    "eval_steps": 0,
    "max_eval_samples": 0,
    "eval.n_episodes": 1,
    "eval.batch_size": 1,
    "env.step_limit": 1,
    "peft.r": 1,
}
"""The least that a setting may be; a `save_freq` of 0 or less is LeRobot's word for the last step alone."""


def require_usable_numbers(config: Any) -> None:
    """Checks a training's configuration; the policy checks its own part.

    Args:
        config: LeRobot's `TrainPipelineConfig`.

    Raises:
        InvalidValueError: a number that no training can be made with, NaN, or an empty list of episodes.
    """
    for name, least in _WHOLE.items():
        value = _value(config, name)
        if value is not None and value < least:
            raise InvalidValueError(f"--{name}", f"at least {least}", value)
    if config.seed is not None and not 0 <= config.seed <= LARGEST_SEED:
        raise InvalidValueError("--seed", f"0 to {LARGEST_SEED}", config.seed)
    if not config.tolerance_s >= 0:
        raise InvalidValueError("--tolerance_s", "a number of at least 0", config.tolerance_s)
    if config.dataset.episodes is not None and not config.dataset.episodes:
        raise InvalidValueError("--dataset.episodes", "at least one episode, or no such flag for all", [])
    for name, value in _numbers(config):
        if math.isnan(value):
            raise InvalidValueError(f"--{name}", "a number", value)


def _value(config: Any, name: str) -> Any:
    for part in name.split("."):
        config = getattr(config, part, None)
    return config


def _numbers(settings: Any, prefix: str = "") -> Iterator[tuple[str, float]]:
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name, None)
        if isinstance(value, float):
            yield prefix + field.name, value
        elif dataclasses.is_dataclass(value):
            yield from _numbers(value, f"{prefix}{field.name}.")
