"""What the caller of a policy's constructor holds, as far as it matters to the policy.

LeRobot hands a policy the metadata of the data set or nothing, and neither the episodes that are trained on nor the
environment that it is tried in. Both are in the variables of the functions that called it.
"""

import sys
from collections.abc import Iterator
from typing import Any

from lerobot.configs.train import TrainPipelineConfig
from lerobot.envs import EnvConfig
from torch.utils.data import Dataset


def data_sets_of_callers(meta: Any) -> list[Any]:
    """The data sets around a policy that is made for `meta`: the one with these metadata, and its held-out part."""
    found = [value for value in _variables() if isinstance(value, Dataset) and hasattr(value, "episodes")]
    if not any(getattr(value, "meta", None) is meta for value in found):
        return []
    root = meta.root
    unique = {id(value): value for value in found if getattr(getattr(value, "meta", None), "root", None) == root}
    return list(unique.values())


def environment_of_callers() -> EnvConfig | None:
    """The settings of the environment that a policy is made for or trained beside."""
    for value in _variables():
        if isinstance(value, EnvConfig):
            return value
        if isinstance(value, TrainPipelineConfig) and value.env is not None:
            return value.env
    return None


def _variables() -> Iterator[Any]:
    frame = sys._getframe(2)
    while frame is not None:
        yield from list(frame.f_locals.values())
        frame = frame.f_back
