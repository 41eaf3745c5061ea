"""Settings of the environment of any task, and its registration with gymnasium."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import gymnasium
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs import EnvConfig

from copolicy.collect.agents.simulated_players import pair_name
from copolicy.dataset.clock import stride
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import (
    ACTION,
    ENVIRONMENT_STATE,
    OBSERVATION_KEYS,
    PAIR_GYM_ID,
    SCENE_IMAGE,
    SCENE_SIDES,
    SCENE_SIZE,
    features_of,
)
from copolicy.dataset.task import PairTask, get_task, installed_tasks

FEATURES_MAP = {**OBSERVATION_KEYS, SCENE_IMAGE: SCENE_IMAGE, ACTION: ACTION}
"""Keys of the environment, and the columns of a data set that they stand for.

The image is under `pixels` in an observation, where LeRobot looks for it; its key here is the one by which
`lerobot-eval --eval.recording=true` finds it.
"""

_PACKAGE = "lerobot_policy_copolicy"


@EnvConfig.register_subclass("pair_task")
@dataclass
class PairTaskEnvConfig(EnvConfig):
    """Settings of the environment of any task, `--env.type=pair_task --env.task=NAME`; see `PairEnv`.

    `features` are those of a policy, which LeRobot builds by them: a policy that learned from this project's data acts
    for both players. With a partner the environment itself takes the robot's half, and `get_env_processors` leaves out
    the human's.

    LeRobot seeds episode i with `seed + i` and the environment takes scenario `seed % scenarios`, so that as many
    episodes as the set has scenarios visit each once.

    Raises:
        UnknownNameError: no such task, set of scenarios or pair.
        FileFormatError: a file of scenarios that cannot be used.
        InvalidValueError: `fps` does not divide the task's rate, a setting of the world that cannot be, a size that no
            image of a data set has, or something that the task does not offer.
    """

    task: str | None = None  # name of the task
    fps: int = 10  # actions a second; each is held for record_hz / fps steps of the world
    map_set: str = ""  # set of scenarios, or a file of them; the task's first set if empty
    orientations: bool = False  # start each scenario in all its orientations
    step_limit: int | None = None  # steps of the world after which an episode is truncated; the task's if None
    partner: str = ""  # simulated pair whose human acts beside the robot's half of the policy's action
    pixels: bool = False  # observe the image of the scene too, for policies that learned from `--video` data sets
    observation_width: int = SCENE_SIZE[0]  # px, of the image, as in the data set
    observation_height: int = SCENE_SIZE[1]  # px, of the image, as in the data set
    settings: dict[str, float] = field(default_factory=dict)  # of the world, by name, where they are not the usual
    features: dict[str, PolicyFeature] = field(default_factory=dict)  # fixed by the task
    features_map: dict[str, str] = field(default_factory=FEATURES_MAP.copy)  # fixed by the task

    def __post_init__(self):
        task, kinds = self.pair_task, {ENVIRONMENT_STATE: FeatureType.ENV, ACTION: FeatureType.ACTION}
        stride(self.fps, task.spec.record_hz)
        self.scenarios  # noqa: B018 (checks the set)
        if self.partner:
            pair_name(task, self.partner)
        self.physics  # noqa: B018 (checks the settings)
        shortest, longest = SCENE_SIDES
        for name in ("observation_width", "observation_height"):
            if (side := getattr(self, name)) % 2 or not shortest <= side <= longest:
                raise InvalidValueError(name, f"an even number of px from {shortest} to {longest}", side)
        if self.pixels and not task.offers("images"):
            raise InvalidValueError("pixels", f"false ({task.missing('images')})", self.pixels)
        columns = features_of(task.spec)
        self.features = {
            key: PolicyFeature(kinds.get(column, FeatureType.STATE), columns[column]["shape"])
            for key, column in FEATURES_MAP.items()
            if column != SCENE_IMAGE
        }
        if self.pixels:
            shape = self.observation_height, self.observation_width, 3
            self.features[SCENE_IMAGE] = PolicyFeature(FeatureType.VISUAL, shape)

    @property
    def pair_task(self) -> PairTask:
        """The task."""
        if not self.task:
            raise InvalidValueError("--env.task", f"a task, of {', '.join(installed_tasks())}", self.task or "none")
        return get_task(self.task)

    @property
    def physics(self) -> Any:
        """Settings of the world."""
        return settings_of(self.pair_task, self.step_limit, self.settings)

    @property
    def scenarios(self) -> tuple[Any, ...]:
        """Where episodes start."""
        task = self.pair_task
        chosen = task.scenario_set(self.map_set or next(iter(task.scenario_sets)))
        return (task.turned(chosen) if self.orientations else chosen).scenarios

    @property
    def package_name(self) -> str:
        """Package whose import registers the environment."""
        return _PACKAGE

    @property
    def gym_id(self) -> str:
        """Name of the environment in gymnasium's registry."""
        return PAIR_GYM_ID

    @property
    def gym_kwargs(self) -> dict:
        """Arguments of `gymnasium.make`: all settings but those of LeRobot."""
        known = {one.name for one in fields(EnvConfig)} - {"task", "fps"}
        return {one.name: getattr(self, one.name) for one in fields(self) if one.name not in known}

    def get_env_processors(self) -> tuple[Any, Any]:
        """What LeRobot puts between environment and policy: with a partner, the robot's half of the action is taken."""
        observations, actions = super().get_env_processors()
        if self.partner:
            from .processor import RobotHalfProcessorStep

            actions.steps = [RobotHalfProcessorStep(len(self.pair_task.spec.action))]
        return observations, actions


def settings_of(task: PairTask, step_limit: int | None, settings: Mapping[str, float]) -> Any:
    """Settings of a world: the task's own, but for those that are given.

    Raises:
        InvalidValueError: the task has no such setting, or it cannot have that value.
    """
    usual = task.settings_type()
    known = [one.name for one in fields(usual)]
    given = {**settings, **({} if step_limit is None else {"step_limit": step_limit})}
    if unknown := sorted(given.keys() - known):
        raise InvalidValueError("settings", f"some of {', '.join(known)}", ", ".join(unknown))
    if step_limit is not None and step_limit < 1:
        raise InvalidValueError("step_limit", "at least 1", step_limit)
    return replace(usual, **given)


def register(gym_id: str, entry_point: str) -> None:
    """Registers an environment of this package with gymnasium.

    Without max_episode_steps: how many frames an episode may have follows from `step_limit` and `fps`, and the
    environment itself truncates there and says why.
    """
    if gym_id not in gymnasium.registry:
        gymnasium.register(id=gym_id, entry_point=f"{_PACKAGE}.env.{entry_point}")


register(PAIR_GYM_ID, "pair_env:PairEnv")
