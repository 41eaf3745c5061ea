"""Settings of the table's environment, and its registration with gymnasium."""

import math
from dataclasses import dataclass
from typing import Any

from lerobot.envs import EnvConfig

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import GYM_ID
from copolicy.dataset.task import TABLE, PairTask, get_task

from .configuration import PairTaskEnvConfig, register, settings_of


@EnvConfig.register_subclass("table_carrying")
@dataclass
class TableCarryingEnvConfig(PairTaskEnvConfig):
    """Settings of the environment of the table; see `TableCarryingEnv`, and `PairTaskEnvConfig` for what is refused."""

    task: str | None = "TableCarrying-v0"  # name of the environment in gymnasium's registry
    map_set: str = "training"  # "training", "paper36", "holdout" or "unseen", or a file of maps
    step_limit: int | None = 1000  # steps of 1/30 s after which an episode is truncated
    partner: str = ""  # simulated pair whose human acts, e.g. "S01", beside the robot's half of the policy's action
    angular_acceleration_limit: float = math.pi / 2  # rad/s^2; the paper's training-time rollouts used pi/8

    def __post_init__(self):
        if self.settings:
            expected = "none (--env.type=pair_task --env.task=table takes them)"
            raise InvalidValueError("settings", expected, self.settings)
        super().__post_init__()

    @property
    def pair_task(self) -> PairTask:
        """The table."""
        return get_task(TABLE)

    @property
    def physics(self) -> Any:
        """Settings of the world."""
        settings = {"angular_acceleration_limit": self.angular_acceleration_limit}
        return settings_of(self.pair_task, self.step_limit, settings)

    @property
    def gym_id(self) -> str:
        """Name of the environment in gymnasium's registry."""
        return GYM_ID

    @property
    def gym_kwargs(self) -> dict:
        """Arguments of `gymnasium.make`."""
        return {name: value for name, value in super().gym_kwargs.items() if name not in ("task", "settings")}


register(GYM_ID, "table_carrying:TableCarryingEnv")
