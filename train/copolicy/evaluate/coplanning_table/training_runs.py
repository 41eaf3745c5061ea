"""Finds the training runs of a method and reads what is known of each, without torch."""

import hashlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.collect.agents.checkpoint_folder import PRETRAINED, checkpoint_folder, pretrained_folder
from copolicy.collect.agents.training_conditions import TrainingConditions, training_conditions
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.json_file import read_json, read_optional_json
from copolicy.dataset.files.listing import is_hidden
from copolicy.dataset.policies.training_run import PLACE_SETTINGS, find_policy_folder
from copolicy.dataset.task import PublishedMethod, Studies
from copolicy.train.recipe import RECIPE_FILE, TRAINING_FILE, reached_training

from ..file_names import split_name
from .result_files import json_files, read_result

_SECONDS = "seconds.json"


@dataclass(frozen=True)
class TrainingRun:
    """One training of a method.

    Attributes:
        folder: the run, or an exported policy.
        checkpoint: folder of its newest weights.
        weights: sha256 of the weights.
        config: content of `config.json`.
        conditions: task, rate and world settings of its training data.
        seed, steps, samples, batch_size: of the training; None if unknown.
        planned_steps: steps after which the training was to end; None if unknown.
        data: name of the data set; empty if unknown.
        seconds: duration of the training; None if unknown.
    """

    folder: Path
    checkpoint: Path
    weights: str
    config: dict[str, Any]
    conditions: TrainingConditions
    seed: int | None
    steps: int | None
    samples: int | None
    batch_size: int | None
    planned_steps: int | None
    data: str
    seconds: float | None

    @classmethod
    def read(cls, folder: Path) -> "TrainingRun":
        """
        Raises:
            FileFormatError: the folder has no checkpoint, or a file of it cannot be read.
        """
        checkpoint = checkpoint_folder(folder)
        training = read_optional_json(checkpoint / TRAINING_FILE, dict[str, Any], "the settings of a training")
        recipe = read_optional_json(checkpoint / RECIPE_FILE, dict[str, Any], "the recipe of an exported policy") or {}
        reached = reached_training(checkpoint, training) if training else recipe.get("training") or {}
        data = (training or recipe).get("dataset") or {}
        return cls(
            folder,
            checkpoint,
            weights=hashlib.sha256((checkpoint / "model.safetensors").read_bytes()).hexdigest(),
            config=read_json(checkpoint / "config.json", dict[str, Any], "the configuration of a policy"),
            conditions=training_conditions(checkpoint),
            seed=reached.get("seed"),
            steps=reached.get("steps"),
            samples=reached.get("samples"),
            batch_size=reached.get("batch_size"),
            planned_steps=(training or {}).get("steps"),
            data=str(data.get("repo_id") or ""),
            seconds=_seconds(folder),
        )

    @property
    def unfinished(self) -> str:
        """`step N of M` for a training that was not finished, else empty."""
        if self.steps is None or self.planned_steps is None or self.steps >= self.planned_steps:
            return ""
        return f"step {self.steps} of {self.planned_steps}"

    @property
    def method(self) -> dict[str, Any]:
        """What runs of one method have in common: everything but the seed."""
        first = {name: self.config.get(name) for name in ("type", "preset")}  # the first difference is reported
        shared = {"data set": self.data, "frames a second": self.conditions.fps, "batch_size": self.batch_size}
        return {**first, **shared, "steps": self.steps, **self.policy_settings}

    @property
    def policy_settings(self) -> dict[str, Any]:
        """The entries of `config.json` that say which policy it is, not where it was trained and kept."""
        return {name: value for name, value in self.config.items() if name not in PLACE_SETTINGS}


@dataclass(frozen=True)
class TrainedMethod:
    """A method and its training runs, in the order of their seeds.

    Attributes:
        source: the given folder.
    """

    name: str
    source: Path
    runs: tuple[TrainingRun, ...]

    def published(self, studies: Studies) -> PublishedMethod | None:
        """The published method that this one implements."""
        return next((method for method in studies.published if method.is_of(self.runs[0].config)), None)


def read_trained_methods(texts: Sequence[str]) -> list[TrainedMethod]:
    """Reads methods, each given as `DIR` or `NAME=DIR`.

    Raises:
        FileFormatError: a folder has no checkpoint, or two runs in it are of different methods or the same training.
        InvalidValueError: two methods have one name, or two runs one seed.
    """
    methods = [_method(text) for text in texts]
    names = [method.name for method in methods]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InvalidValueError("--runs", "methods of different names; give NAME=DIR", f"{twice} twice")
    return methods


def _method(text: str) -> TrainedMethod:
    name, path = split_name(text)
    source = pretrained_folder() if path == PRETRAINED else Path(path)
    folders = list(_run_folders(source, set())) if source.is_dir() else []
    if not folders:
        expected = "a folder with training runs (checkpoints with config.json and model.safetensors)"
        raise FileFormatError(source, expected, _instead(source))
    runs = sorted(map(TrainingRun.read, folders), key=lambda run: (-1 if run.seed is None else run.seed, run.folder))
    _require_one_method(runs)
    return TrainedMethod(name or _default_name(runs[0]), source, tuple(runs))


def _instead(folder: Path) -> str:
    """What a folder without runs has."""
    if not folder.is_dir():
        return "no such folder"
    results = [path for path in json_files(folder) if read_result(path) is not None]
    return f"results without their policy, such as {results[0]}" if results else "none"


def _run_folders(folder: Path, visited: set[Path]) -> Iterator[Path]:
    """Folders of runs and exported policies below a folder, each once; links to folders are followed."""
    if (real := folder.resolve()) in visited:
        return
    visited.add(real)
    if find_policy_folder(folder) is not None:
        yield folder
        return
    for name in sorted(os.listdir(folder)):
        if not is_hidden(name) and (folder / name).is_dir():
            yield from _run_folders(folder / name, visited)


def _default_name(run: TrainingRun) -> str:
    preset = run.config.get("preset")
    return str(run.config.get("type")) + (f" {preset}" if preset else "")


def _entries(name: str, *runs: TrainingRun) -> list[Any]:
    """An entry of the method of each run; a setting that an earlier version did not have has its default."""
    if all(name in run.method for run in runs) or not any(name in run.policy_settings for run in runs):
        return [run.method.get(name) for run in runs]
    from copolicy.train.checkpoint import read_configuration  # torch

    return [getattr(read_configuration(run.checkpoint), name, None) for run in runs]


def _require_one_method(runs: Sequence[TrainingRun]) -> None:
    first = runs[0]
    for position, run in enumerate(runs[1:], 1):
        for name in {**first.method, **run.method}:
            expected, actual = _entries(name, first, run)
            if expected != actual:
                raise FileFormatError(
                    run.folder, f"{name} {expected}, as {first.folder}: runs of one method differ in their seed alone",
                    str(actual),
                )  # fmt: skip
        for earlier in runs[:position]:
            if run.weights == earlier.weights:
                expected = f"another training than {earlier.folder}"
                raise FileFormatError(run.folder, expected, f"the same weights {run.weights[:12]}")
            if run.seed is not None and run.seed == earlier.seed:
                expected = f"another training seed than {earlier.folder}"
                raise FileFormatError(run.folder, expected, f"seed {run.seed} too")


def _seconds(folder: Path) -> float | None:
    """Duration of a training from `seconds.json` in the folder of the run or above it."""
    for path in (folder / _SECONDS, folder.parent / _SECONDS):
        if path.is_file():
            return read_json(path, float, "the duration of a training in seconds")
    return None
