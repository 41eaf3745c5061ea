"""Configuration of the environment of any task, and its registration with gymnasium."""

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
"""Keys of the environment and the corresponding columns of a data set.

In an observation the image is under `pixels`, as LeRobot expects; `lerobot-eval --eval.recording=true` needs the key
that it has here.
"""

_PACKAGE = "lerobot_policy_copolicy"


@EnvConfig.register_subclass("pair_task")
@dataclass
class PairTaskEnvConfig(EnvConfig):
    """Configuration of the environment of any task, `--env.type=pair_task --env.task=NAME`; see `PairEnv`.

    `features` describe a policy's inputs and outputs, from which LeRobot builds policies; a policy acts for both
    players. With a partner, the environment takes the robot's half only, and `get_env_processors` removes the human's.

    LeRobot seeds episode i with `seed + i` and the environment takes scenario `seed % scenarios`, so that as many
    episodes as the set has scenarios visit each once.

    Raises:
        UnknownNameError: the task, the scenario set or the pair does not exist.
        FileFormatError: a scenario file cannot be used.
        InvalidValueError: `fps` does not divide the task's rate, a setting of the world or the size of the image is out
            of range, or the task does not offer a feature.
    """

    task: str | None = None  # name of the task
    fps: int = 10  # actions per second; each is held for record_hz / fps steps of the world
    map_set: str = ""  # scenario set or scenario file; the task's first set if empty
    orientations: bool = False  # start each scenario in all its orientations
    step_limit: int | None = None  # steps of the world after which an episode is truncated; the task's if None
    partner: str = ""  # simulated pair whose human acts; the policy then acts for the robot only
    pixels: bool = False  # observe the image of the scene too, for policies trained on `--video` data sets
    observation_width: int = SCENE_SIZE[0]  # width of the image, px, as in the data set
    observation_height: int = SCENE_SIZE[1]  # height of the image, px, as in the data set
    settings: dict[str, float] = field(default_factory=dict)  # settings of the world, by name, other than the defaults
    features: dict[str, PolicyFeature] = field(default_factory=dict)  # fixed by the task
    features_map: dict[str, str] = field(default_factory=FEATURES_MAP.copy)  # fixed by the task

    def __post_init__(self) -> None:
        task, kinds = self.pair_task, {ENVIRONMENT_STATE: FeatureType.ENV, ACTION: FeatureType.ACTION}
        stride(self.fps, task.spec.record_hz)
        self.scenarios  # noqa: B018 (checks the set)
        if self.partner:
            pair_name(task, self.partner)
        self.world_settings  # noqa: B018 (checks the settings)
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
    def world_settings(self) -> Any:
        """Settings of the world."""
        return changed_settings(self.pair_task, self.step_limit, self.settings)

    @property
    def scenarios(self) -> tuple[Any, ...]:
        """Scenarios in which episodes start."""
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
    def gym_kwargs(self) -> dict[str, Any]:
        """Arguments of `gymnasium.make`: all settings except LeRobot's."""
        inherited = {field.name for field in fields(EnvConfig)} - {"task", "fps"}
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name not in inherited}

    def get_env_processors(self) -> tuple[Any, Any]:
        """LeRobot's processors of observations and actions; with a partner, the latter keep the robot's half."""
        observations, actions = super().get_env_processors()
        if self.partner:
            from .processor import RobotHalfProcessorStep

            actions.steps = [RobotHalfProcessorStep(len(self.pair_task.spec.action))]
        return observations, actions


def changed_settings(task: PairTask, step_limit: int | None, settings: Mapping[str, float]) -> Any:
    """The task's default world settings with some values replaced.

    Raises:
        InvalidValueError: the task has no such setting, or the value is out of range.
    """
    default = task.settings_type()
    names = [field.name for field in fields(default)]
    changes = {**settings, **({} if step_limit is None else {"step_limit": step_limit})}
    if unknown := sorted(changes.keys() - names):
        raise InvalidValueError("settings", f"some of {', '.join(names)}", ", ".join(unknown))
    if step_limit is not None and step_limit < 1:
        raise InvalidValueError("step_limit", "at least 1", step_limit)
    return replace(default, **changes)


def register(gym_id: str, entry_point: str) -> None:
    """Registers an environment of this package with gymnasium.

    `max_episode_steps` is not set: the limit follows from `step_limit` and `fps`, and the environment itself truncates
    with a reason.
    """
    if gym_id not in gymnasium.registry:
        gymnasium.register(id=gym_id, entry_point=f"{_PACKAGE}.env.{entry_point}")


register(PAIR_GYM_ID, "pair_env:PairEnv")
