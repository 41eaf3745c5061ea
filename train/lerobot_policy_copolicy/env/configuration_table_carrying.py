"""Settings of the environment, and its registration with gymnasium."""

import math
from dataclasses import dataclass, field
from typing import Any

import gymnasium
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs import EnvConfig

from copolicy.dataset.clock import stride
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import (
    ACTION,
    ENVIRONMENT_STATE,
    GYM_ID,
    OBSERVATION_KEYS,
    SCENE_IMAGE,
    SCENE_SIDES,
    SCENE_SIZE,
)
from copolicy.dataset.task import get_task
from copolicy.tasks.table.features import FEATURES
from copolicy.tasks.table.physics import Physics

FEATURES_MAP = {**OBSERVATION_KEYS, SCENE_IMAGE: SCENE_IMAGE, ACTION: ACTION}
"""Keys of the environment, and the columns of a data set that they stand for.

The image is under `pixels` in an observation, where LeRobot looks for it; its key here is the one by which
`lerobot-eval --eval.recording=true` finds it.
"""


def _features() -> dict[str, PolicyFeature]:
    kinds = {ENVIRONMENT_STATE: FeatureType.ENV, ACTION: FeatureType.ACTION}
    return {
        key: PolicyFeature(type=kinds.get(column, FeatureType.STATE), shape=FEATURES[column]["shape"])
        for key, column in FEATURES_MAP.items()
        if column != SCENE_IMAGE
    }


@EnvConfig.register_subclass("table_carrying")
@dataclass
class TableCarryingEnvConfig(EnvConfig):
    """Settings of the environment; see `TableCarryingEnv` for what it does.

    `features` are those of a policy, which LeRobot builds by them: a policy that learned from this project's data acts
    for both players. With a partner the environment itself takes two numbers, and `get_env_processors` leaves out the
    human's half.

    LeRobot seeds episode i with `seed + i` and the environment takes map `seed % maps`, so that as many episodes as
    the set has maps visit each map once.

    Raises:
        UnknownNameError: no such map set.
        FileFormatError: a file of maps that cannot be used.
        InvalidValueError: `fps` does not divide 30, a limit that is not positive, or a size that no image of a data
            set has.
    """

    task: str | None = "TableCarrying-v0"  # name of the environment in gymnasium's registry
    fps: int = 10  # actions a second; each is held for 30 / fps steps of the world
    map_set: str = "training"  # "training", "paper36", "holdout" or "unseen"
    orientations: bool = False  # start each map in the four orientations 0, pi/2, pi and 3 pi/2
    step_limit: int = 1000  # steps of 1/30 s after which an episode is truncated
    angular_acceleration_limit: float = math.pi / 2  # rad/s^2; the paper's training-time rollouts used pi/8
    partner: str = ""  # simulated pair whose human acts, e.g. "S01", beside the robot's half of the policy's action
    pixels: bool = False  # observe the image of the scene too, for policies that learned from `--video` data sets
    observation_width: int = SCENE_SIZE[0]  # px, of the image, as in the data set
    observation_height: int = SCENE_SIZE[1]  # px, of the image, as in the data set
    features: dict[str, PolicyFeature] = field(default_factory=_features)  # fixed by the task
    features_map: dict[str, str] = field(default_factory=FEATURES_MAP.copy)  # fixed by the task

    def __post_init__(self):
        stride(self.fps)
        get_task().scenario_set(self.map_set)
        Physics(self.angular_acceleration_limit, self.step_limit)
        shape = require_image_size(self.observation_width, self.observation_height)
        self.features.pop(SCENE_IMAGE, None)  # a stored configuration may come with another choice of `pixels`
        if self.pixels:
            self.features[SCENE_IMAGE] = PolicyFeature(FeatureType.VISUAL, shape)

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
            "pixels": self.pixels,
            "observation_width": self.observation_width,
            "observation_height": self.observation_height,
        }

    def get_env_processors(self) -> tuple[Any, Any]:
        """What LeRobot puts between environment and policy: with a partner, the robot's half of the action is taken."""
        observations, actions = super().get_env_processors()
        if self.partner:
            from .processor_table_carrying import RobotHalfProcessorStep

            actions.steps = [RobotHalfProcessorStep()]
        return observations, actions


def require_image_size(width: int, height: int) -> tuple[int, int, int]:
    """The shape of an image of the scene, `(height, width, 3)`.

    Raises:
        InvalidValueError: a side that no data set can have.
    """
    shortest, longest = SCENE_SIDES
    for name, side in (("observation_width", width), ("observation_height", height)):
        if side % 2 or not shortest <= side <= longest:
            raise InvalidValueError(name, f"an even number of px from {shortest} to {longest}", side)
    return height, width, 3


if GYM_ID not in gymnasium.registry:
    # Without max_episode_steps: how many frames an episode may have follows from `step_limit` and `fps`, and the
    # environment itself truncates there and says why.
    gymnasium.register(id=GYM_ID, entry_point="lerobot_policy_copolicy.env.table_carrying:TableCarryingEnv")
