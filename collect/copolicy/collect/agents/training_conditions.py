"""Task, frame rate and world settings that a policy was trained with, read from its files without torch."""

import math
import os
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, TypedDict

from copolicy.dataset.exceptions import CopolicyError, FileFormatError, InvalidValueError
from copolicy.dataset.features import ACTION, features_of
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.files.meta_files import INFO_FILE
from copolicy.dataset.lerobot_folder.info import task_of
from copolicy.dataset.task import TABLE, PairTask, get_task, installed_tasks

ASSUMED_FPS = 10
"""Frames a second where the files of a policy do not say: the default rate of converted data sets."""

_STEP_LIMIT = "step_limit"
_POLICY_TYPE, _IMAGES = "copolicy", "observation.images."


class _DataSet(TypedDict, total=False):
    fps: float | None
    root: str | None
    repo_id: str | None
    robot_type: str | None


class _Feature(TypedDict, total=False):
    shape: list[int] | None


class _Settings(TypedDict, total=False):
    """The parts of `train_config.json` or `recipe.json` that are read here."""

    dataset: _DataSet | None


class _Config(TypedDict, total=False):
    """The parts of `config.json` that are read here."""

    type: str | None
    task: str | None
    input_features: dict[str, _Feature] | None
    output_features: dict[str, _Feature] | None
    fps: float | None
    physics: dict[str, Any] | None
    physics_mixture: dict[str, int] | None


@dataclass(frozen=True)
class TrainingConditions:
    """Frame rate and dynamics of a policy's training data.

    Attributes:
        fps: frames a second of the training data; an action is held for record_hz / fps steps.
        settings: of the world in the training episodes, with the default step limit.
        notes: what was assumed, or differed between episodes; for logs and results.
        task: name of the task that was learned.
    """

    fps: int
    settings: Any
    notes: tuple[str, ...] = ()
    task: str = TABLE

    def to_json(self) -> dict[str, Any]:
        """The description in results."""
        physics = {name: value for name, value in asdict(self.settings).items() if name != _STEP_LIMIT}
        task = {} if self.task == TABLE else {"task": self.task}
        return {**task, "fps": self.fps, "physics": physics, **({"notes": list(self.notes)} if self.notes else {})}


def training_conditions(folder: Path) -> TrainingConditions:
    """Reads the conditions of a policy from `config.json` and the files beside it.

    Where `config.json` has no rate (older checkpoints), it is read from `recipe.json` or from the data set of
    `train_config.json`, else assumed. Configurations of LeRobot's policies have no task: it is that of the data set,
    else the only installed task with the policy's features, else the table. The default of a co-policy is the table.

    Args:
        folder: with `config.json`, see `checkpoint_folder`.

    Raises:
        FileFormatError: a file cannot be read, or its rate or physics are invalid.
        UnknownNameError: the task is not installed.
    """
    config = read_json(folder / "config.json", _Config, "the configuration of a policy")
    notes: list[str] = []
    data_set = _data_set(folder)
    task = _task(config, data_set, notes)
    fps = config.get("fps") or data_set.get("fps")
    if fps is None:
        fps = ASSUMED_FPS
        notes.append(f"the checkpoint does not say its rate; {fps} frames a second are assumed")
    if not (math.isfinite(fps) and fps > 0):
        raise FileFormatError(folder / "config.json", "frames a second", repr(fps))
    physics, mixture = config.get("physics"), config.get("physics_mixture") or {}
    unknown_count = mixture.get("", 0)
    if physics is None:
        default = task.settings_summary(task.settings_type())
        if mixture:
            parts = "; ".join(f"{count} episodes {text or 'unknown'}" for text, count in mixture.items())
            notes.append(f"the policy learned from episodes with different physics ({parts}); {default} is assumed")
        else:
            notes.append(f"the checkpoint does not say its physics; {default} is assumed")
    elif unknown_count:
        notes.append(f"{unknown_count} of the training episodes do not say their physics")
    # A rate such as 12.5 is not rounded: the agent that runs the policy refuses it.
    rate = int(fps) if float(fps).is_integer() else fps
    settings = _settings(folder, physics or {}, task)
    return TrainingConditions(rate, settings, tuple(notes), task.spec.name)  # pyright: ignore[reportArgumentType]


def _settings(folder: Path, physics: dict[str, Any], task: PairTask) -> Any:
    settings_type = task.settings_type
    path, names = folder / "config.json", {field.name for field in fields(settings_type)} - {_STEP_LIMIT}
    if not physics.keys() <= names:
        raise FileFormatError(path, f"physics of {', '.join(sorted(names))}", str(physics))
    try:
        return settings_type(**{name: float(value) for name, value in physics.items()})
    except (TypeError, ValueError, InvalidValueError) as error:
        raise FileFormatError(path, "valid physics", str(error)) from None


def _task(config: _Config, data_set: _DataSet, notes: list[str]) -> PairTask:
    if config.get("task") or config.get("type") in (None, _POLICY_TYPE):
        return get_task(config.get("task") or TABLE)
    if (data_set.get("robot_type") or "").startswith(f"{_POLICY_TYPE}_"):
        task, origin = task_of(data_set), "that of its data set"
    else:
        candidates = [task for task in map(_task_or_none, installed_tasks()) if task and _has_features(task, config)]
        task = candidates[0] if len(candidates) == 1 else get_task()
        origin = "the only one with its features" if len(candidates) == 1 else "assumed"
    notes.append(f"the checkpoint does not say its task; {task.spec.name!r} is {origin}")
    return task


def _task_or_none(name: str) -> PairTask | None:
    try:
        return get_task(name)
    except CopolicyError:  # a broken package, which may be unrelated to this policy
        return None


def _has_features(task: PairTask, config: _Config) -> bool:
    features = {**(config.get("input_features") or {}), **(config.get("output_features") or {})}
    shapes = {name: feature.get("shape") for name, feature in features.items() if not name.startswith(_IMAGES)}
    task_shapes = {name: list(feature["shape"]) for name, feature in features_of(task.spec).items()}
    return ACTION in shapes and all(task_shapes.get(name) == shape for name, shape in shapes.items())


def _data_set(folder: Path) -> _DataSet:
    """Facts about the training data from `recipe.json`, `train_config.json`, and the data set where it still exists."""
    facts: _DataSet = {}
    for name in ("train_config.json", "recipe.json"):
        path = folder / name
        settings = read_json(path, _Settings, "the settings of a training") if path.is_file() else {}
        data_set = settings.get("dataset") or {}
        root, repo_id = data_set.get("root"), data_set.get("repo_id")
        data_folder = Path(root) if root else _lerobot_home() / repo_id if repo_id else None
        if data_folder and (info := data_folder / INFO_FILE).is_file():
            facts |= read_json(info, _DataSet, "LeRobot's data set information")
        if fps := data_set.get("fps"):
            facts["fps"] = fps
    return facts


def _lerobot_home() -> Path:
    """LeRobot's cache of data sets that are named by their repo id alone."""
    cache = os.environ.get("HF_HOME") or Path.home() / ".cache" / "huggingface"
    return Path(os.environ.get("HF_LEROBOT_HOME") or Path(cache) / "lerobot")
