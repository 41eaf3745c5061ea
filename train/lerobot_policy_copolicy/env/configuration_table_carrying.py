"""Configuration of the table's environment, and its registration with gymnasium."""

import math
from dataclasses import dataclass
from typing import Any

from lerobot.envs import EnvConfig

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import GYM_ID
from copolicy.dataset.task import TABLE, PairTask, get_task

from .configuration import PairTaskEnvConfig, changed_settings, register


@EnvConfig.register_subclass("table_carrying")
@dataclass
class TableCarryingEnvConfig(PairTaskEnvConfig):
    """Configuration of the table's environment; see `TableCarryingEnv`, and `PairTaskEnvConfig` for errors."""

    task: str | None = "TableCarrying-v0"  # name of the environment in gymnasium's registry
    map_set: str = "training"  # "training", "paper36", "holdout" or "unseen", or a file of maps
    step_limit: int | None = 1000  # steps of 1/30 s after which an episode is truncated
    partner: str = ""  # simulated pair whose human acts, e.g. "S01"; the policy then acts for the robot only
    angular_acceleration_limit: float = math.pi / 2  # rad/s^2; the paper's training-time rollouts used pi/8

    def __post_init__(self) -> None:
        if self.settings:
            expected = "none (--env.type=pair_task --env.task=table takes them)"
            raise InvalidValueError("settings", expected, self.settings)
        super().__post_init__()

    @property
    def pair_task(self) -> PairTask:
        """The table's task."""
        return get_task(TABLE)

    @property
    def world_settings(self) -> Any:
        """Settings of the world."""
        settings = {"angular_acceleration_limit": self.angular_acceleration_limit}
        return changed_settings(self.pair_task, self.step_limit, settings)

    @property
    def gym_id(self) -> str:
        """Name of the environment in gymnasium's registry."""
        return GYM_ID

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Arguments of `gymnasium.make`."""
        return {name: value for name, value in super().gym_kwargs.items() if name not in ("task", "settings")}


register(GYM_ID, "table_carrying:TableCarryingEnv")
