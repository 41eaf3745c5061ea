"""At which rate, and under which physics, a policy learned: read from its files, without torch."""

import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, TypedDict

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.files.meta_files import INFO_FILE
from copolicy.dataset.task import PairTask, get_task

ASSUMED_FPS = 10
"""Frames a second of a policy whose files do not say: our data sets have this rate unless asked for another."""

_FREE = "step_limit"


class _Rate(TypedDict, total=False):
    fps: float | None
    root: str | None


class _Settings(TypedDict, total=False):
    """`train_config.json` or `recipe.json`, as far as it is read here."""

    dataset: _Rate | None


class _Config(TypedDict, total=False):
    """`config.json`, as far as it is read here."""

    task: str | None
    fps: float | None
    physics: dict[str, Any] | None
    physics_mixture: dict[str, int] | None


@dataclass(frozen=True)
class TrainingConditions:
    """What an action of a policy means in time, and which dynamics it was fitted to.

    Attributes:
        fps: frames a second of the training data; an action is held for 30 / fps steps.
        physics: of the training episodes, with the usual time limit.
        notes: what was assumed, or differed between episodes; for logs and results.
    """

    fps: int
    physics: Any
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """For the description of a policy in a result."""
        physics = {name: value for name, value in asdict(self.physics).items() if name != _FREE}
        return {"fps": self.fps, "physics": physics, **({"notes": list(self.notes)} if self.notes else {})}


def training_conditions(folder: Path) -> TrainingConditions:
    """Reads the conditions of a policy from `config.json`, or from what stands beside it.

    The rate of a policy that was trained before it was recorded may be in `recipe.json`, or in the data set that
    `train_config.json` names; else it is assumed.

    Args:
        folder: with `config.json`, see `checkpoint_folder`.

    Raises:
        FileFormatError: a file cannot be read, or holds no rate or no physics.
    """
    config = read_json(folder / "config.json", _Config, "the configuration of a policy")
    notes: list[str] = []
    fps = config.get("fps") or _rate_beside(folder)
    if fps is None:
        fps = ASSUMED_FPS
        notes.append(f"the checkpoint does not say its rate; {fps} frames a second are assumed")
    if not (math.isfinite(fps) and fps > 0):
        raise FileFormatError(folder / "config.json", "frames a second", repr(fps))
    physics, mixture = config.get("physics"), config.get("physics_mixture") or {}
    unknown = mixture.get("", 0)
    if physics is None:
        default = "angular acceleration up to pi/2 rad/s^2"
        if mixture:
            parts = "; ".join(f"{count} episodes {text or 'unknown'}" for text, count in mixture.items())
            notes.append(f"the policy learned from episodes of different physics ({parts}); {default} is assumed")
        else:
            notes.append(f"the checkpoint does not say its physics; {default} is assumed")
    elif unknown:
        notes.append(f"{unknown} of the training episodes do not say their physics")
    # A rate such as 12.5 is kept: what runs the policy refuses it.
    rate = int(fps) if float(fps).is_integer() else fps
    task = get_task(config.get("task") or "table")
    return TrainingConditions(rate, _physics(folder, physics or {}, task), tuple(notes))  # pyright: ignore[reportArgumentType]


def _physics(folder: Path, settings: dict[str, Any], task: PairTask) -> Any:
    settings_type = task.settings_type
    path, known = folder / "config.json", {field.name for field in fields(settings_type)} - {_FREE}
    if not settings.keys() <= known:
        raise FileFormatError(path, f"physics of {', '.join(sorted(known))}", str(settings))
    try:
        return settings_type(**{name: float(value) for name, value in settings.items()})
    except (TypeError, ValueError, InvalidValueError) as error:
        raise FileFormatError(path, "physics that can be", str(error)) from None


def _rate_beside(folder: Path) -> float | None:
    for name in ("recipe.json", "train_config.json"):
        path = folder / name
        data_set = (
            (read_json(path, _Settings, "the settings of a training").get("dataset") or {}) if path.is_file() else {}
        )
        if fps := data_set.get("fps"):
            return fps
        info = Path(data_set.get("root") or "") / INFO_FILE
        if data_set.get("root") and info.is_file():
            return read_json(info, _Rate, "LeRobot's data set information").get("fps")
    return None
