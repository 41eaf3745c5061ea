"""Reads the facts that a model card states, from a checkpoint and its evaluations."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.json_file import read_optional_json, require_type
from copolicy.dataset.files.meta_files import INFO_FILE
from copolicy.dataset.policies.documents import (
    EvaluationDocument,
    ExportedEvaluationsDocument,
    PolicyConfigDocument,
    RecipeDocument,
    TrainingDocument,
)
from copolicy.dataset.policies.training_run import find_policy_folder
from copolicy.dataset.task import TABLE, PairTask, get_task

from .facts import DatasetFacts
from .training_facts import TrainingData

WEIGHTS = "model.safetensors"
RECIPE = "recipe.json"
EVALUATIONS = "eval.json"
_RESULT = "a result of copolicy-eval"


@dataclass(frozen=True)
class CheckpointFacts:
    """A policy folder as saved by LeRobot or by `copolicy-train export`.

    Attributes:
        config: `config.json`.
        training: steps, batch size, seed, optimizer; empty if not stated.
        data: the training data.
        weights_sha256: hash of the weights.
        recipe: `recipe.json` of an exported policy, else empty.
        task: the task named in the configuration, else that of the data, else the table.
    """

    folder: Path
    config: dict[str, Any]
    training: dict[str, Any]
    data: TrainingData
    weights_sha256: str
    recipe: dict[str, Any]
    task: PairTask

    @classmethod
    def read(cls, path: Path, dataset_root: Path | None = None) -> "CheckpointFacts":
        """Reads a checkpoint from its folder, the parent of `pretrained_model`, or a run folder (newest checkpoint).

        Args:
            dataset_root: folder of the training data (default: the folder used in training if it exists, else the facts
                in the recipe).

        Raises:
            FileFormatError: no checkpoint, or a damaged one, or no data set at `dataset_root`.
            UnknownNameError: its task is not installed.
        """
        folder = find_policy_folder(path)
        if folder is None:
            raise FileFormatError(path, f"a checkpoint folder with config.json and {WEIGHTS}", "none")
        config = read_optional_json(folder / "config.json", dict, "a policy's configuration") or {}
        if "type" not in config:
            raise FileFormatError(folder / "config.json", "a policy's configuration with its type", "none")
        require_type(config, PolicyConfigDocument, "a policy's configuration", folder / "config.json")
        training = read_optional_json(folder / "train_config.json", TrainingDocument, "settings of a training") or {}
        recipe = read_optional_json(folder / RECIPE, RecipeDocument, "the recipe of a policy") or {}
        settings = training.get("dataset") or {}
        root, training_root = dataset_root, settings.get("root")
        if root is None and training_root and (Path(training_root) / INFO_FILE).is_file():
            root = Path(training_root)
        task = config.get("task")
        if root is not None:
            facts = DatasetFacts.read(root)
            task = task or facts.task.spec.name
            data = TrainingData.from_data_set(facts, settings or recipe.get("dataset") or {})
        elif recipe.get("dataset"):
            data = TrainingData.from_recipe(recipe["dataset"])
        else:
            data = TrainingData.from_settings(settings, config.get("fps"))
        with (folder / WEIGHTS).open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        training = training or recipe.get("training") or {}
        return cls(folder, config, training, data, digest, recipe, get_task(task or TABLE))

    @property
    def commands(self) -> list[str]:
        """Commands that reproduce data and policy, as far as stated."""
        return [str(command) for command in self.recipe.get("commands") or ()]

    def evaluations(self, paths: Sequence[Path]) -> list[dict[str, Any]]:
        """Reads results of `copolicy-eval` and checks that they are of this policy.

        Args:
            paths: files with one result each; if empty, `eval.json` of an exported policy is read.

        Raises:
            FileFormatError: a missing file, no evaluation, or one of other weights.
            InvalidValueError: the same file twice.
        """
        if not paths:
            path = self.folder / EVALUATIONS
            stored = read_optional_json(path, ExportedEvaluationsDocument, "results of copolicy-eval") or {}
            results = stored.get("evaluations") or []
            return [self._checked(path, result) for result in results]
        if len({path.resolve() for path in paths}) < len(paths):
            raise InvalidValueError("--eval", "each file once", [str(path) for path in paths])
        return [self._checked(path, read_optional_json(path, dict, _RESULT)) for path in paths]

    def _checked(self, path: Path, result: dict[str, Any] | None) -> dict[str, Any]:
        if result is None:
            raise FileFormatError(path, _RESULT, "no such file")
        require_type(result, EvaluationDocument, _RESULT, path)
        weights = result["policy"].get("weights_sha256")
        # An exported policy predicts the same actions as its checkpoint, so the results of both are the same.
        if weights not in (self.weights_sha256, (self.recipe.get("weights") or {}).get("exported_from")):
            expected = f"an evaluation of {self.folder.name} (weights {self.weights_sha256[:12]})"
            raise FileFormatError(path, expected, f"one of weights {str(weights)[:12]}")
        return result
