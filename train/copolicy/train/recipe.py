"""`recipe.json` and `eval.json` of an exported policy: its training, data and results, without paths of a machine.

They are written beside the weights; `copolicy-cards model` makes the card from them.
"""

from collections import Counter
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.json_file import read_optional_json
from copolicy.dataset.files.meta_files import INFO_FILE, RELEASE_FILE
from copolicy.dataset.lerobot_folder.folder import LeRobotFolder
from copolicy.dataset.policies.documents import TrainingDataDocument, TrainingDocument, TrainingStepDocument
from copolicy.dataset.scenarios import set_label

from .training_data import TRAINING_DATA_FILE

RECIPE_FILE = "recipe.json"
EVALUATION_FILE = "eval.json"
TRAINING_FILE = "train_config.json"

_TRAINING = ("batch_size", "seed")
_COUNTED_COLUMNS = ("source", "map_set", "license", "pair_id")
_EPISODE_COLUMNS = ("map_id", "start_theta", "partner", "robot", "repeat", "success", "reason", "time_s")


def training_recipe(folder: Path, weights_sha256: str, averaged: bool, commands: Sequence[str]) -> dict[str, Any]:
    """The recipe of a checkpoint's policy, without the parts that were not recorded.

    Args:
        folder: folder of the checkpoint; an exported one keeps its recipe.
        weights_sha256: sha256 of its weights.
        averaged: whether the exported weights are the moving average.
        commands: commands that made data and policy.

    Raises:
        FileFormatError: `train_config.json`, `recipe.json` or `training_step.json` cannot be read.
        InvalidValueError: a command has a path in this user's home or in the working directory.
    """
    for command in commands:
        if str(Path.home()) in command or str(Path.cwd()) in command:
            raise InvalidValueError("--commands", "paths that another machine has too", command)
    earlier = read_optional_json(folder / RECIPE_FILE, dict[str, Any], "the recipe of an exported policy")
    if earlier:
        return {**earlier, **({"commands": list(commands)} if commands else {})}
    recipe: dict[str, Any] = {
        "weights": {"exported_from": weights_sha256, "averaged": averaged, "dtype": "float32"},
    }
    training = read_optional_json(folder / TRAINING_FILE, TrainingDocument, "the settings of a training")
    if training:
        recipe["training"] = {
            **reached_training(folder, dict(training)),
            "optimizer": training.get("optimizer"),
            "scheduler": training.get("scheduler"),
        }
        # The policy's settings record these also if the data set is not on this machine.
        policy = training.get("policy") or {}
        recorded = {name: policy[name] for name in ("fps", "physics", "physics_mixture", "unseen") if policy.get(name)}
        recipe["dataset"] = {**recorded, **_data_set(training.get("dataset") or {}), **_recorded_data(folder)}
    if commands:
        recipe["commands"] = list(commands)
    return recipe


def reached_training(folder: Path, training: dict[str, Any]) -> dict[str, Any]:
    """Batch size and seed of a training, and the steps and samples that its checkpoint has reached; None if unknown.

    Args:
        folder: folder of the checkpoint.
        training: content of its `train_config.json`.

    Raises:
        FileFormatError: `training_step.json` cannot be read.
    """
    step_file = folder.parent / "training_state" / "training_step.json"
    reached = read_optional_json(step_file, TrainingStepDocument, "a training's step") or {}
    steps, processes = reached.get("step", training.get("steps")), reached.get("num_processes", 1)
    batch = training.get("batch_size")
    return {
        **{name: training.get(name) for name in _TRAINING},
        "steps": steps,
        "samples": steps * batch * processes if steps and batch else None,
    }


def shortened_evaluation(path: Path, digests: Collection[str]) -> dict[str, Any]:
    """A result of `copolicy-eval` with its summary and the main columns of each episode.

    Raises:
        FileFormatError: the file is no result, or one of other weights.
    """
    result = read_optional_json(path, dict[str, Any], "a result of copolicy-eval")
    try:
        if result is None:
            raise FileFormatError(path, "a result of copolicy-eval", "no such file")
        weights = result["policy"]["weights_sha256"]
        summary = _without(result["summary"], "by_map")
        episodes = [{key: row[key] for key in _EPISODE_COLUMNS if key in row} for row in result.get("episodes", ())]
        baselines = [
            {
                "name": baseline["name"],
                "policy": _without(baseline["policy"], "checkpoint"),
                "summary": _without(baseline["summary"], "by_map"),
            }
            for baseline in result.get("baselines", ())
        ]
    except (KeyError, TypeError) as error:
        raise FileFormatError(path, "a result of copolicy-eval", f"none: {error} is missing") from None
    if weights not in digests:
        expected = f"an evaluation of this policy (weights {', '.join(sorted(digest[:12] for digest in digests))})"
        raise FileFormatError(path, expected, f"one of weights {str(weights)[:12]}")
    shortened = {**result, "policy": _without(result["policy"], "checkpoint"), "summary": summary, "episodes": episodes}
    return {**shortened, "baselines": baselines} if baselines else shortened


def _without(entries: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in entries.items() if name != key}


def _data_set(settings: dict[str, Any]) -> dict[str, Any]:
    """Name of the data set, and its size, sources and version if its folder is on this machine."""
    facts: dict[str, Any] = {"repo_id": settings.get("repo_id"), "revision": settings.get("revision")}
    chosen = settings.get("episodes")
    root = Path(settings.get("root") or "")
    if not settings.get("root") or not (root / INFO_FILE).is_file():
        return {**facts, "episodes_used": None if chosen is None else len(chosen)}
    folder = LeRobotFolder.open(root)
    info = folder.info
    used = range(info["total_episodes"]) if chosen is None else chosen
    release = read_optional_json(root / RELEASE_FILE, dict[str, Any], "the record of a release") or {}
    return {
        **facts,
        "episodes": info["total_episodes"],
        "episodes_used": len(used),
        "frames": info["total_frames"],
        "fps": info["fps"],
        **{column: counts for column in _COUNTED_COLUMNS if (counts := _counts(folder, column, set(used)))},
        **{key: release[key] for key in ("version", "content_hash") if key in release},
    }


def _recorded_data(folder: Path) -> dict[str, Any]:
    """Pairs, split and content hash of `training_data.json`, which are those of the run."""
    data = read_optional_json(folder / TRAINING_DATA_FILE, TrainingDataDocument, "the data of a training") or {}
    pairs = sorted((data.get("pairs") or {}).items(), key=lambda item: -item[1])
    facts = {"pair_id": dict(pairs), **{name: data.get(name) for name in ("split", "content_hash", "people")}}
    return {name: value for name, value in facts.items() if value}


def _counts(folder: LeRobotFolder, column: str, used: Collection[int]) -> dict[str, int]:
    """The number of used episodes with each value of an episode column, most frequent first."""
    if column not in folder.episodes.column_names:
        return {}
    if column == "map_set":
        values = [set_label(row) for row in folder.rows((column, "map_set_version", "map_set_digest"))]
    else:
        values = folder.episodes.column(column).to_pylist()
    counts = Counter(str(value) for episode, value in enumerate(values) if episode in used)
    return dict(counts.most_common())
