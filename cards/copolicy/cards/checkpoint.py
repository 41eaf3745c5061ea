"""What a checkpoint and its evaluations say of themselves: everything a model card may state."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError

from .artefacts import read_json
from .facts import DatasetFacts

WEIGHTS = "model.safetensors"


@dataclass(frozen=True)
class Checkpoint:
    """A folder with a policy, as LeRobot saves it.

    Attributes:
        config: `config.json`.
        training: `train_config.json`, empty where there is none.
        weights_sha256: hash of the weights.
        dataset: facts of the data set that it was trained on, None where its folder is not at hand.
    """

    folder: Path
    config: dict[str, Any]
    training: dict[str, Any]
    weights_sha256: str
    dataset: DatasetFacts | None

    @classmethod
    def read(cls, path: Path, dataset_root: Path | None = None) -> "Checkpoint":
        """Reads a checkpoint: its folder, one that holds `pretrained_model`, or a whole run (its last checkpoint).

        Args:
            dataset_root: folder of the data set it was trained on (default: where the training found it, if it is
                still there).

        Raises:
            FileFormatError: no checkpoint, or a damaged one, or no data set at `dataset_root`.
        """
        folder = _folder(path)
        config = read_json(folder / "config.json") or {}
        if "type" not in config:
            raise FileFormatError(folder / "config.json", "a policy's configuration with its type", "none")
        training = read_json(folder / "train_config.json") or {}
        root = dataset_root or _training_root(training)
        with (folder / WEIGHTS).open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return cls(folder, config, training, digest, None if root is None else DatasetFacts.read(root))

    @property
    def repo_id(self) -> str:
        """Name of the data set that it was trained on, empty where not stated."""
        return str((self.training.get("dataset") or {}).get("repo_id") or "")

    @property
    def training_episodes(self) -> list[int] | None:
        """The episodes that it was trained on, None for all of them."""
        return (self.training.get("dataset") or {}).get("episodes")

    def evaluations(self, paths: Sequence[Path]) -> list[dict[str, Any]]:
        """Reads `eval.json` files of this very policy.

        Raises:
            FileFormatError: not there, no evaluation, or one of other weights.
            InvalidValueError: the same file twice.
        """
        if len({path.resolve() for path in paths}) < len(paths):
            raise InvalidValueError("--eval", "each file once", [str(path) for path in paths])
        return [self._evaluation(path) for path in paths]

    def _evaluation(self, path: Path) -> dict[str, Any]:
        result = read_json(path)
        if result is None:
            raise FileFormatError(path, "a result of copolicy-eval", "no such file")
        try:
            label, weights = result["label"], result["policy"]["weights_sha256"]
            success = result["summary"]["success"]
            _ = label, result["study"], result["settings"]["maps"], success["mean"], success["standard_error"]
            _ = success["episodes"], success["wilson_95"], result["summary"]["planning_ms_per_call"]
        except (KeyError, TypeError) as error:
            raise FileFormatError(path, "a result of copolicy-eval", f"none: {error} is missing") from None
        if weights != self.weights_sha256:
            expected = f"an evaluation of {self.folder.name} (weights {self.weights_sha256[:12]})"
            raise FileFormatError(path, expected, f"one of weights {str(weights)[:12]}")
        return result


def _training_root(training: dict[str, Any]) -> Path | None:
    root = (training.get("dataset") or {}).get("root")
    return Path(root) if root and (Path(root) / "meta" / "info.json").is_file() else None


def _folder(path: Path) -> Path:
    for folder in (path, path / "pretrained_model", path / "checkpoints" / "last" / "pretrained_model"):
        if (folder / "config.json").is_file() and (folder / WEIGHTS).is_file():
            return folder
    raise FileFormatError(path, f"a checkpoint folder with config.json and {WEIGHTS}", "none")
