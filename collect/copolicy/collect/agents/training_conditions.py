"""Which task a policy learned, at which rate and under which physics: read from its files, without torch."""

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
"""Frames a second of a policy whose files do not say: our data sets have this rate unless asked for another."""

_FREE = "step_limit"
_OURS, _IMAGES = "copolicy", "observation.images."


class _DataSet(TypedDict, total=False):
    fps: float | None
    root: str | None
    repo_id: str | None
    robot_type: str | None


class _Feature(TypedDict, total=False):
    shape: list[int] | None


class _Settings(TypedDict, total=False):
    """`train_config.json` or `recipe.json`, as far as it is read here."""

    dataset: _DataSet | None


class _Config(TypedDict, total=False):
    """`config.json`, as far as it is read here."""

    type: str | None
    task: str | None
    input_features: dict[str, _Feature] | None
    output_features: dict[str, _Feature] | None
    fps: float | None
    physics: dict[str, Any] | None
    physics_mixture: dict[str, int] | None


@dataclass(frozen=True)
class TrainingConditions:
    """What an action of a policy means in time, and which dynamics it was fitted to.

    Attributes:
        fps: frames a second of the training data; an action is held for record_hz / fps steps.
        physics: of the training episodes, with the usual time limit.
        notes: what was assumed, or differed between episodes; for logs and results.
        task: name of the task that was learned.
    """

    fps: int
    physics: Any
    notes: tuple[str, ...] = ()
    task: str = TABLE

    def to_json(self) -> dict[str, Any]:
        """For the description of a policy in a result."""
        physics = {name: value for name, value in asdict(self.physics).items() if name != _FREE}
        task = {} if self.task == TABLE else {"task": self.task}
        return {**task, "fps": self.fps, "physics": physics, **({"notes": list(self.notes)} if self.notes else {})}


def training_conditions(folder: Path) -> TrainingConditions:
    """Reads the conditions of a policy from `config.json`, or from what stands beside it.

    The rate of a policy that was trained before it was recorded may be in `recipe.json`, or in the data set that
    `train_config.json` names; else it is assumed. A policy of LeRobot's own names no task: it is that of the data set,
    else the one installed task that has the policy's features, else the table. The co-policy's is the table.

    Args:
        folder: with `config.json`, see `checkpoint_folder`.

    Raises:
        FileFormatError: a file cannot be read, or holds no rate or no physics.
        UnknownNameError: the task is not installed.
    """
    config = read_json(folder / "config.json", _Config, "the configuration of a policy")
    notes: list[str] = []
    beside = _data_set_beside(folder)
    task = _task(config, beside, notes)
    fps = config.get("fps") or beside.get("fps")
    if fps is None:
        fps = ASSUMED_FPS
        notes.append(f"the checkpoint does not say its rate; {fps} frames a second are assumed")
    if not (math.isfinite(fps) and fps > 0):
        raise FileFormatError(folder / "config.json", "frames a second", repr(fps))
    physics, mixture = config.get("physics"), config.get("physics_mixture") or {}
    unknown = mixture.get("", 0)
    if physics is None:
        default = task.settings_summary(task.settings_type())
        if mixture:
            parts = "; ".join(f"{count} episodes {text or 'unknown'}" for text, count in mixture.items())
            notes.append(f"the policy learned from episodes of different physics ({parts}); {default} is assumed")
        else:
            notes.append(f"the checkpoint does not say its physics; {default} is assumed")
    elif unknown:
        notes.append(f"{unknown} of the training episodes do not say their physics")
    # A rate such as 12.5 is kept: what runs the policy refuses it.
    rate = int(fps) if float(fps).is_integer() else fps
    physics = _physics(folder, physics or {}, task)
    return TrainingConditions(rate, physics, tuple(notes), task.spec.name)  # pyright: ignore[reportArgumentType]


def _physics(folder: Path, settings: dict[str, Any], task: PairTask) -> Any:
    settings_type = task.settings_type
    path, known = folder / "config.json", {field.name for field in fields(settings_type)} - {_FREE}
    if not settings.keys() <= known:
        raise FileFormatError(path, f"physics of {', '.join(sorted(known))}", str(settings))
    try:
        return settings_type(**{name: float(value) for name, value in settings.items()})
    except (TypeError, ValueError, InvalidValueError) as error:
        raise FileFormatError(path, "physics that can be", str(error)) from None


def _task(config: _Config, data_set: _DataSet, notes: list[str]) -> PairTask:
    if config.get("task") or config.get("type") in (None, _OURS):
        return get_task(config.get("task") or TABLE)
    if (data_set.get("robot_type") or "").startswith(f"{_OURS}_"):
        task, origin = task_of(data_set), "that of its data set"
    else:
        candidates = [task for task in map(_installed, installed_tasks()) if task and _has_features(task, config)]
        task = candidates[0] if len(candidates) == 1 else get_task()
        origin = "the only one with its features" if len(candidates) == 1 else "assumed"
    notes.append(f"the checkpoint does not say its task; {task.spec.name!r} is {origin}")
    return task


def _installed(name: str) -> PairTask | None:
    try:
        return get_task(name)
    except CopolicyError:  # a package that is broken, which this policy may have nothing to do with
        return None


def _has_features(task: PairTask, config: _Config) -> bool:
    features = {**(config.get("input_features") or {}), **(config.get("output_features") or {})}
    shapes = {name: feature.get("shape") for name, feature in features.items() if not name.startswith(_IMAGES)}
    known = {name: list(feature["shape"]) for name, feature in features_of(task.spec).items()}
    return ACTION in shapes and all(known.get(name) == shape for name, shape in shapes.items())


def _data_set_beside(folder: Path) -> _DataSet:
    """What is known of the training data: by `recipe.json`, `train_config.json`, or themselves where they are still."""
    known: _DataSet = {}
    for name in ("train_config.json", "recipe.json"):
        path = folder / name
        settings = read_json(path, _Settings, "the settings of a training") if path.is_file() else {}
        data_set = settings.get("dataset") or {}
        root = data_set.get("root") or (_lerobot_home() / data_set["repo_id"] if data_set.get("repo_id") else None)
        if root and (info := Path(root) / INFO_FILE).is_file():
            known |= read_json(info, _DataSet, "LeRobot's data set information")
        if fps := data_set.get("fps"):
            known["fps"] = fps
    return known


def _lerobot_home() -> Path:
    """Where LeRobot keeps a data set that a training names without its folder."""
    cache = os.environ.get("HF_HOME") or Path.home() / ".cache" / "huggingface"
    return Path(os.environ.get("HF_LEROBOT_HOME") or Path(cache) / "lerobot")
