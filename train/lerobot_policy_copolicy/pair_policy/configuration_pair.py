"""Settings that every policy for two players has."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from lerobot.configs import NormalizationMode, PolicyFeature, PreTrainedConfig

from copolicy.dataset.exceptions import InvalidValueError, ShapeError, UnknownNameError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE, features_of
from copolicy.dataset.task import PairTask, get_task

from .bounds import Bounds, require_bounds

_FEATURES = "observation_features"
_SYMMETRIES = ("mirror", "permute_obstacles")


def _identity() -> dict[str, NormalizationMode]:
    return dict.fromkeys(("STATE", "ENV", "ACTION"), NormalizationMode.IDENTITY)


@dataclass
class PairPolicyConfig(PreTrainedConfig):
    """Settings of a policy that predicts the actions of both players.

    A setting that is None takes the value of `preset`. The saved configuration has all values, so changing its `preset`
    has no effect. Features and symmetries of a preset that the task does not offer are left out.

    `normalization_mapping` is IDENTITY for all features. LeRobot puts the statistics of the current data set into the
    processors, also when a checkpoint is fine-tuned on another set; a column that is constant there (a goal, an
    obstacle) then gets huge values. Instead the policy scales by the fixed bounds of the task.

    A subclass gives `presets` (settings by preset), `choices` and `bounds` (of its own settings), the names of the
    inputs that it has for any task (`generic_features`, the first where a preset asks for what a task lacks),
    `_validate` for rules between settings, and a setting in frames with its published value, by which settings of 30 Hz
    are noticed on data of another rate (`frames_at_30_hz`).

    Raises:
        UnknownNameError: the preset does not exist.
        InvalidValueError: a setting is out of range or not offered by the task.
    """

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    bounds: ClassVar[Mapping[str, Bounds]] = {}
    generic_features: ClassVar[tuple[str, ...]] = ("absolute",)
    frames_at_30_hz: ClassVar[Mapping[str, int]] = {}

    task: str | None = None  # task that defines columns, bounds, features; default: that of the data, else the table
    preset: str = "default"  # named set of values for the settings that are not given
    past_human_action: bool | None = False  # condition on the human's past action

    observation_features: str | None = None  # "absolute"; for the table also "relative" and "scan" (with a range scan)
    mirror: bool | None = None  # mirror half of the training samples (for the table in y)
    permute_obstacles: bool | None = None  # shuffle the order of the obstacles in training samples
    symmetries: list[str] = field(default_factory=list)  # names of further symmetries that the task offers

    fps: float | None = None  # actions per second; set from the training data
    physics: dict[str, float] | None = None  # world settings of the training episodes if equal; set from the data
    physics_mixture: dict[str, int] = field(default_factory=dict)  # episodes by world settings (JSON) if these differ
    unseen: str = ""  # properties of the training episodes that policies do not observe; set from the data

    normalization_mapping: dict[str, NormalizationMode] = field(default_factory=_identity)  # fixed, see above

    def __post_init__(self):
        super().__post_init__()
        if self.preset not in self.presets:
            raise UnknownNameError("preset", self.preset, self.presets)
        self._open = {name for name in ("task", *self.presets[self.preset]) if getattr(self, name) is None}
        self._fill(get_task() if self.task is None else get_task(self.task))

    @property
    def filled(self) -> Any:
        """`self` typed as Any: type checkers cannot know that the preset has set every optional field."""
        return self

    def use_task(self, task: PairTask) -> None:
        """Sets the task of the training data, unless the settings name one.

        Raises:
            InvalidValueError: the settings name another task, or features or symmetries that this one does not offer.
        """
        if "task" in self._open:
            self._fill(task)
        elif task.spec.name != self.task:
            raise InvalidValueError("task", f"{task.spec.name!r}, that of the data", self.task)

    def _fill(self, task: PairTask) -> None:
        """Sets the open settings for a task, and checks all settings."""
        self.task = task.spec.name
        for name in self._open - {"task"}:
            setattr(self, name, self.presets[self.preset][name])
        from_preset = {name: problem for name, problem in self._not_offered(task).items() if name in self._open}
        for name in from_preset:
            setattr(self, name, self.generic_features[0] if name == _FEATURES else False)
        if from_preset:
            values = ", ".join(f"{name}={value}" for name, (_, value) in from_preset.items())
            logging.info("%s", task.missing(f"{values} (preset {self.preset!r})"))
        for name, (expected, actual) in self._not_offered(task).items():
            raise InvalidValueError(name, expected, actual)
        for name, choices in self.choices.items():
            if getattr(self, name) not in choices:
                raise UnknownNameError(name, getattr(self, name), choices)
        require_bounds(self.filled, self.bounds)
        self._validate()
        if any(mode is not NormalizationMode.IDENTITY for mode in self.normalization_mapping.values()):
            raise InvalidValueError(
                "normalization_mapping",
                "IDENTITY throughout, because the policy scales by the fixed bounds of the task",
                {kind: mode.value for kind, mode in self.normalization_mapping.items()},
            )

    def _not_offered(self, task: PairTask) -> dict[str, tuple[str, Any]]:
        """Expected and actual values of the settings that the task does not offer."""
        offered = task.features
        problems: dict[str, tuple[str, Any]] = {}
        if self.observation_features not in (choices := (*self.generic_features, *offered.encoders)):
            expected = f"{', '.join(choices)} (the task {self.task!r} offers no other features)"
            problems[_FEATURES] = expected, self.observation_features
        for name in _SYMMETRIES:
            if getattr(self, name) and name not in offered.symmetries:
                problems[name] = f"false (the task {self.task!r} has no such symmetry)", True
        if not set(self.symmetries) <= offered.symmetries.keys():
            expected = f"some of {', '.join(offered.symmetries) or 'none'} (the task {self.task!r} has no others)"
            problems["symmetries"] = expected, self.symmetries
        return problems

    def _validate(self) -> None:
        """Checks the rules between settings; a subclass that has such rules overrides it.

        Raises:
            InvalidValueError: a setting contradicts another.
        """

    @property
    def used_symmetries(self) -> frozenset[str]:
        """Names of the symmetries that augment training samples."""
        return frozenset(self.symmetries).union(name for name in _SYMMETRIES if getattr(self, name))

    @property
    def observation_keys(self) -> tuple[str, ...]:
        """Columns that the policy reads."""
        return (STATE, ENVIRONMENT_STATE, HUMAN_ACTION) if self.past_human_action else (STATE, ENVIRONMENT_STATE)

    @property
    def reward_delta_indices(self) -> None:
        """The policy reads no reward."""
        return None

    def validate_features(self) -> None:
        """Checks that the data set or the environment has the columns of the task.

        Raises:
            InvalidValueError: a column is missing.
            ShapeError: a column has another shape.
        """
        columns = features_of(get_task(self.filled.task).spec)
        for name in self.observation_keys:
            _check_feature(name, columns[name]["shape"], self.input_features or {})
        _check_feature(ACTION, columns[ACTION]["shape"], self.output_features or {})


def _check_feature(name: str, expected: tuple[int, ...], features: dict[str, PolicyFeature]) -> None:
    if name not in features:
        raise InvalidValueError("features of the data set or environment", name, sorted(features))
    actual = tuple(features[name].shape)
    if actual != expected:
        raise ShapeError(name, expected, actual)
