"""`copolicy-train export`: writes a checkpoint as a small folder for publication.

A checkpoint of a run has raw and averaged weights, and the state and paths of the run. Inference uses the averaged
weights: the exported policy has only these, in float32, and is checked to predict the same actions.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from lerobot.policies.factory import make_pre_post_processors
from torch import Tensor

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.dataset.command_line.commands import DISTRIBUTION
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, OutputExistsError, RunError
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.files.replace_folder import replaced_folder
from copolicy.dataset.files.staging import new_folder, replace_json
from copolicy.dataset.task import get_task

from .checkpoint import Checkpoint
from .recipe import EVALUATION_FILE, RECIPE_FILE, shortened_evaluation, training_recipe

_AVERAGED = "ema.model."
_RAW = "denoiser."
_TOLERANCE = 1e-6  # of a predicted action; the arithmetic of both policies is the same


def export_checkpoint(
    path: Path | str,
    out: Path | str,
    evaluations: Sequence[Path | str] = (),
    commands: Sequence[str] = (),
    overwrite: bool = False,
) -> dict[str, Any]:
    """Writes policy, processors, `recipe.json` and, if evaluations are given, `eval.json`.

    Args:
        path: a checkpoint of a policy of this package, such as the co-policy.
        out: the folder to write.
        evaluations: results of `copolicy-eval` on that checkpoint or on an export of it.
        commands: commands that made data and policy; written to the recipe.
        overwrite: replace an existing policy and its card.

    Returns:
        Path, sha256, size, and the largest difference of its actions from the checkpoint's.

    Raises:
        FileFormatError: `path` is no checkpoint of such a policy, or a file is no evaluation of it.
        OutputExistsError: `out` exists and may not be replaced.
        RunError: the exported policy predicts other actions than the checkpoint.
    """
    out, evaluations = Path(out), [Path(file) for file in evaluations]
    source = checkpoint_folder(path)
    if out.exists() and source.resolve() == out.resolve():
        raise InvalidValueError("--out", "another folder than the checkpoint's", str(out))
    _check_output(out, overwrite)
    original = Checkpoint(source)
    policy = original.policy
    if not type(policy).__module__.startswith(f"{DISTRIBUTION}."):
        raise FileFormatError(source, "a checkpoint of a policy of copolicy", policy.config.type)
    averaged = getattr(policy, "ema", None) is not None
    recipe = training_recipe(source, original.weights_sha256, averaged=averaged, commands=commands)
    with _staged(out, overwrite) as folder:
        _save(policy, source, folder)
        replace_json(folder / RECIPE_FILE, recipe, indent=1)
        (folder / "model.safetensors").chmod(0o644)  # safetensors makes it readable by its owner only
        exported = Checkpoint(folder)
        digests = {original.weights_sha256, recipe["weights"]["exported_from"], exported.weights_sha256}
        results = [shortened_evaluation(file, digests) for file in evaluations]
        if results:
            replace_json(folder / EVALUATION_FILE, {"evaluations": results}, indent=1)
        difference = _difference(original, exported)
        if difference > _TOLERANCE:
            raise RunError(f"{out}: expected the actions of {source}, found one that differs by {difference:.2g}")
    size = sum(file.stat().st_size for file in out.iterdir())
    return {
        "policy": str(out),
        "weights_sha256": exported.weights_sha256,
        "parameters": sum(parameter.numel() for parameter in exported.policy.parameters()),
        "megabytes": round(size / 1e6, 3),
        "largest_action_difference": difference,
        "evaluations": len(results),
    }


def _save(policy: Any, source: Path, folder: Path) -> None:
    config = type(policy.config).from_pretrained(source)
    config.device, config.pretrained_path, config.repo_id, config.push_to_hub = "cpu", None, None, False
    weights = {name: values.float() for name, values in policy.state_dict().items() if not name.startswith("ema.")}
    if hasattr(policy, "ema"):
        config.ema = False
    if getattr(policy, "ema", None) is not None:
        weights |= _averaged(policy.state_dict())
    exported = type(policy)(config)
    exported.load_state_dict(weights)
    exported.save_pretrained(folder)
    device = {"device_processor": {"device": "cpu"}}
    for processor in make_pre_post_processors(config, pretrained_path=str(source), preprocessor_overrides=device):
        processor.save_pretrained(folder)


def _averaged(state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The averaged weights under the names of the raw weights."""
    return {
        _RAW + name.removeprefix(_AVERAGED): values.float()
        for name, values in state.items()
        if name.startswith(_AVERAGED)
    }


def _difference(original: Checkpoint, exported: Checkpoint) -> float:
    """Largest difference of the actions of two policies from the same seed, at the starts of the task's first set."""
    task, frames = get_task(original.task), original.n_obs_steps
    scenarios = next(iter(task.scenario_sets.values()))
    starts = task.states_of(np.array([task.start_of(scenario) for scenario in scenarios]))
    vectors = np.array([task.scenario_vector(scenario) for scenario in scenarios])
    human_actions = np.zeros((len(scenarios), len(task.spec.action)))
    columns = (STATE, starts), (ENVIRONMENT_STATE, vectors), (HUMAN_ACTION, human_actions)
    observations = {key: np.repeat(values[:, None], frames, axis=1) for key, values in columns}
    actions = []
    for policy in (original, exported):
        policy.reset(0)
        actions.append(policy.predict_action_chunk(observations))
    return float(np.abs(actions[0] - actions[1]).max())


def _check_output(out: Path, overwrite: bool) -> None:
    if not out.exists():
        return
    # Only a folder with a policy is ever replaced.
    if not overwrite or not (out / "config.json").is_file():
        raise OutputExistsError(out)


@contextmanager
def _staged(out: Path, overwrite: bool) -> Iterator[Path]:
    """Yields a temporary folder, which becomes or replaces `out` when all is written."""
    with (replaced_folder if out.exists() else new_folder)(out) as folder:
        folder.mkdir()
        yield folder
        _check_output(out, overwrite)
