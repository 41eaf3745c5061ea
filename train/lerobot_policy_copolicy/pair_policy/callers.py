"""Finds data sets and environments in the local variables of a policy constructor's callers.

LeRobot passes a policy the metadata of the data set at most, but neither the episodes of the training nor the
environment of an evaluation. Both are local variables of the functions that call the constructor.
"""

import sys
from collections.abc import Iterator
from typing import Any

from lerobot.configs.train import TrainPipelineConfig
from lerobot.envs import EnvConfig
from torch.utils.data import Dataset


def data_sets_of_callers(meta: Any) -> list[Any]:
    """The callers' data sets with the metadata `meta` or the same folder, which includes a held-out part."""
    datasets = [value for value in _variables() if isinstance(value, Dataset) and hasattr(value, "episodes")]
    if not any(getattr(value, "meta", None) is meta for value in datasets):
        return []
    root = meta.root
    unique = {id(value): value for value in datasets if getattr(getattr(value, "meta", None), "root", None) == root}
    return list(unique.values())


def environment_of_callers() -> EnvConfig | None:
    """The environment settings in the callers' variables or training configuration; None without any."""
    for value in _variables():
        if isinstance(value, EnvConfig):
            return value
        if isinstance(value, TrainPipelineConfig) and value.env is not None:
            return value.env
    return None


def training_steps_of_callers() -> int | None:
    """Number of steps of the training that constructs a policy; None without one."""
    return next((value.steps for value in _variables() if isinstance(value, TrainPipelineConfig)), None)


def _variables() -> Iterator[Any]:
    frame = sys._getframe(2)
    while frame is not None:
        yield from list(frame.f_locals.values())
        frame = frame.f_back
