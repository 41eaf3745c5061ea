"""Settings of the environment, and its registration with gymnasium."""

import math
from dataclasses import dataclass, field

import gymnasium
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs import EnvConfig

from copolicy.dataset.clock import stride
from copolicy.dataset.exceptions import UnknownNameError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, FEATURES, HUMAN_ACTION, STATE
from copolicy.dataset.maps import MAP_SETS

GYM_ID = "copolicy/TableCarrying-v0"

FEATURES_MAP = {
    "agent_pos": STATE,
    "environment_state": ENVIRONMENT_STATE,
    "human_action": HUMAN_ACTION,
    "action": ACTION,
}
"""Keys of the environment, and the columns of a data set that they stand for."""


def _features() -> dict[str, PolicyFeature]:
    kinds = {ENVIRONMENT_STATE: FeatureType.ENV, ACTION: FeatureType.ACTION}
    return {
        key: PolicyFeature(type=kinds.get(column, FeatureType.STATE), shape=FEATURES[column]["shape"])
        for key, column in FEATURES_MAP.items()
    }


@EnvConfig.register_subclass("table_carrying")
@dataclass
class TableCarryingEnvConfig(EnvConfig):
    """Settings of the environment; see `TableCarryingEnv` for what it does.

    LeRobot seeds episode i with `seed + i` and the environment takes map `seed % maps`, so that as many episodes as
    the set has maps visit each map once.

    Raises:
        UnknownNameError: no such map set.
        InvalidValueError: `fps` does not divide 30.
    """

    task: str | None = "TableCarrying-v0"  # name of the environment in gymnasium's registry
    fps: int = 10  # actions a second; each is held for 30 / fps steps of the world
    map_set: str = "training"  # "training", "paper36", "holdout" or "unseen"
    orientations: bool = False  # start each map in the four orientations 0, pi/2, pi and 3 pi/2
    step_limit: int = 1000  # steps of 1/30 s after which an episode is truncated
    angular_acceleration_limit: float = math.pi / 2  # rad/s^2; the paper's training-time rollouts used pi/8
    partner: str = ""  # simulated pair whose human plays the human half, e.g. "S01"; empty: the action's own half
    features: dict[str, PolicyFeature] = field(default_factory=_features)  # fixed by the task
    features_map: dict[str, str] = field(default_factory=FEATURES_MAP.copy)  # fixed by the task

    def __post_init__(self):
        stride(self.fps)
        if self.map_set not in MAP_SETS:
            raise UnknownNameError("map set", self.map_set, MAP_SETS)

    @property
    def package_name(self) -> str:
        """Package whose import registers the environment."""
        return "lerobot_policy_copolicy"

    @property
    def gym_id(self) -> str:
        """Name of the environment in gymnasium's registry."""
        return GYM_ID

    @property
    def gym_kwargs(self) -> dict:
        """Arguments of `gymnasium.make`."""
        return {
            "fps": self.fps,
            "map_set": self.map_set,
            "orientations": self.orientations,
            "step_limit": self.step_limit,
            "angular_acceleration_limit": self.angular_acceleration_limit,
            "partner": self.partner,
            "max_episode_steps": frames(self.step_limit, self.fps),
        }


def frames(step_limit: int, fps: int) -> int:
    """Frames that a limit in steps of the world covers, the last one perhaps in part."""
    return math.ceil(step_limit / stride(fps))


if GYM_ID not in gymnasium.registry:
    gymnasium.register(
        id=GYM_ID,
        entry_point="lerobot_policy_copolicy.env.table_carrying:TableCarryingEnv",
        max_episode_steps=frames(1000, 10),
    )
