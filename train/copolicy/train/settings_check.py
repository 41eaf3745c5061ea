"""Checks the numbers of a training's configuration that LeRobot does not check, before any work."""

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

from copolicy.dataset.command_line.flag_numbers import LARGEST_SEED
from copolicy.dataset.exceptions import InvalidValueError

_MINIMA = {
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
"""The smallest value of each setting; `save_freq` is not among them, since 0 or less saves only the last step."""


def require_usable_numbers(config: Any) -> None:
    """Checks a training's configuration; the policy checks its own settings.

    Args:
        config: LeRobot's `TrainPipelineConfig`.

    Raises:
        InvalidValueError: a number is out of range or NaN, or the list of episodes is empty; names the flag.
    """
    for name, minimum in _MINIMA.items():
        value = _value(config, name)
        if value is not None and value < minimum:
            raise InvalidValueError(f"--{name}", f"at least {minimum}", value)
    if config.seed is not None and not 0 <= config.seed <= LARGEST_SEED:
        raise InvalidValueError("--seed", f"0 to {LARGEST_SEED}", config.seed)
    if not config.tolerance_s >= 0:
        raise InvalidValueError("--tolerance_s", "a number of at least 0", config.tolerance_s)
    if config.dataset.episodes is not None and not config.dataset.episodes:
        raise InvalidValueError("--dataset.episodes", "at least one episode, or no such flag for all", [])
    for name, value in _float_settings(config):
        if math.isnan(value):
            raise InvalidValueError(f"--{name}", "a number", value)


def _value(config: Any, name: str) -> Any:
    for part in name.split("."):
        config = getattr(config, part, None)
    return config


def _float_settings(settings: Any, prefix: str = "") -> Iterator[tuple[str, float]]:
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name, None)
        if isinstance(value, float):
            yield prefix + field.name, value
        elif dataclasses.is_dataclass(value):
            yield from _float_settings(value, f"{prefix}{field.name}.")
