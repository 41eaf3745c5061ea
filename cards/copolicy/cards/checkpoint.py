"""What a checkpoint and its evaluations say of themselves: everything a model card may state."""

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
from .training_data import TrainingData

WEIGHTS = "model.safetensors"
RECIPE = "recipe.json"
EVALUATIONS = "eval.json"
_RESULT = "a result of copolicy-eval"


@dataclass(frozen=True)
class Checkpoint:
    """A folder with a policy, as LeRobot saves it or as `copolicy-train export` does.

    Attributes:
        config: `config.json`.
        training: steps, batch size, seed, optimizer; empty where not stated.
        data: what it was trained on.
        weights_sha256: hash of the weights.
        recipe: `recipe.json` of an exported policy, else empty.
        task: that its configuration names, else that of its data, else the table.
    """

    folder: Path
    config: dict[str, Any]
    training: dict[str, Any]
    data: TrainingData
    weights_sha256: str
    recipe: dict[str, Any]
    task: PairTask

    @classmethod
    def read(cls, path: Path, dataset_root: Path | None = None) -> "Checkpoint":
        """Reads a checkpoint: its folder, one that holds `pretrained_model`, or a whole run (its newest checkpoint).

        Args:
            dataset_root: folder of the data set it was trained on (default: where the training found it, if it is
                still there, else what the recipe says).

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
        root = dataset_root or _training_root(settings)
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
        """How to make data and policy again, as far as it is stated."""
        return [str(command) for command in self.recipe.get("commands") or ()]

    def evaluations(self, paths: Sequence[Path]) -> list[dict[str, Any]]:
        """Reads results of `copolicy-eval` on this very policy.

        Args:
            paths: one result each; without any, those that an exported policy keeps in `eval.json`.

        Raises:
            FileFormatError: not there, no evaluation, or one of other weights.
            InvalidValueError: the same file twice.
        """
        if not paths:
            kept = self.folder / EVALUATIONS
            stored = read_optional_json(kept, ExportedEvaluationsDocument, "results of copolicy-eval") or {}
            results = stored.get("evaluations") or []
            return [self._checked(kept, result) for result in results]
        if len({path.resolve() for path in paths}) < len(paths):
            raise InvalidValueError("--eval", "each file once", [str(path) for path in paths])
        return [self._checked(path, read_optional_json(path, dict, _RESULT)) for path in paths]

    def _checked(self, path: Path, result: dict[str, Any] | None) -> dict[str, Any]:
        if result is None:
            raise FileFormatError(path, _RESULT, "no such file")
        require_type(result, EvaluationDocument, _RESULT, path)
        weights = result["policy"].get("weights_sha256")
        # An exported policy makes the same plans as the checkpoint that it came from, and so has the same results.
        if weights not in (self.weights_sha256, (self.recipe.get("weights") or {}).get("exported_from")):
            expected = f"an evaluation of {self.folder.name} (weights {self.weights_sha256[:12]})"
            raise FileFormatError(path, expected, f"one of weights {str(weights)[:12]}")
        return result


def _training_root(settings: dict[str, Any]) -> Path | None:
    root = settings.get("root")
    return Path(root) if root and (Path(root) / INFO_FILE).is_file() else None
