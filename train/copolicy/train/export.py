"""`copolicy-train export`: a checkpoint of a training as a small folder to give away.

A training's checkpoint holds the weights twice, raw and averaged, and the state and paths of the run. What plans are
the averaged ones: the exported policy has them as its only weights, in float32, and is checked to make the same plans.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.policies.factory import make_pre_post_processors
from torch import Tensor

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, OutputExistsError, RunError
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.files.replace_folder import replaced_folder
from copolicy.dataset.files.staging import new_folder, replace_json
from copolicy.dataset.task import get_task

from .checkpoint import Checkpoint
from .recipe import EVALUATION_FILE, RECIPE_FILE, kept_evaluation, training_recipe

_AVERAGED = "ema.model."
_RAW = "denoiser."
_LARGEST_DIFFERENCE = 1e-6  # of a planned force; both are the same arithmetic, so that this is generous


def export_checkpoint(
    path: Path | str,
    out: Path,
    evaluations: Sequence[Path] = (),
    commands: Sequence[str] = (),
    overwrite: bool = False,
) -> dict[str, Any]:
    """Writes policy, processors, `recipe.json` and, where evaluations are given, `eval.json`.

    Args:
        path: a checkpoint of a co-policy.
        out: the folder to write.
        evaluations: results of `copolicy-eval` on that checkpoint or on an export of it.
        commands: how to make data and policy again, one a line; kept in the recipe.
        overwrite: replace a policy that is there, with its card.

    Returns:
        Where it is, its size, and by how much its plans differ.

    Raises:
        FileFormatError: no checkpoint of a co-policy, or a file that is no evaluation of it.
        OutputExistsError: there is something at `out`.
        RunError: the exported policy plans otherwise than the checkpoint.
    """
    source = checkpoint_folder(path)
    if out.exists() and source.resolve() == out.resolve():
        raise InvalidValueError("--out", "another folder than the checkpoint's", str(out))
    _check_output(out, overwrite)
    original = Checkpoint(source)
    policy = original.policy
    if policy.config.type != "copolicy":
        raise FileFormatError(source, "a checkpoint of a co-policy", policy.config.type)
    recipe = training_recipe(source, original.weights_sha256, averaged=policy.ema is not None, commands=commands)
    with _staged(out, overwrite) as folder:
        _save(policy, source, folder)
        replace_json(folder / RECIPE_FILE, recipe, indent=1)
        (folder / "model.safetensors").chmod(0o644)  # safetensors writes for its owner alone
        exported = Checkpoint(folder)
        digests = {original.weights_sha256, recipe["weights"]["exported_from"], exported.weights_sha256}
        results = [kept_evaluation(file, digests) for file in evaluations]
        if results:
            replace_json(folder / EVALUATION_FILE, {"evaluations": results}, indent=1)
        difference = _difference(policy, exported.policy)
        if difference > _LARGEST_DIFFERENCE:
            raise RunError(f"{out}: expected the plans of {source}, found one that differs by {difference:.2g}")
    size = sum(file.stat().st_size for file in out.iterdir())
    return {
        "policy": str(out),
        "weights_sha256": exported.weights_sha256,
        "parameters": sum(parameter.numel() for parameter in exported.policy.parameters()),
        "megabytes": round(size / 1e6, 3),
        "largest_difference_of_a_plan": difference,
        "evaluations": len(results),
    }


def _save(policy: Any, source: Path, folder: Path) -> None:
    config = type(policy.config).from_pretrained(source)
    config.ema, config.device, config.pretrained_path, config.repo_id = False, "cpu", None, None
    config.push_to_hub = False
    weights = {name: values.float() for name, values in policy.state_dict().items() if not name.startswith("ema.")}
    if policy.ema is not None:
        weights |= _averaged(policy.state_dict())
    exported = type(policy)(config)
    exported.load_state_dict(weights)
    exported.save_pretrained(folder)
    device = {"device_processor": {"device": "cpu"}}
    for processor in make_pre_post_processors(config, pretrained_path=str(source), preprocessor_overrides=device):
        processor.save_pretrained(folder)


def _averaged(state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The averaged weights under the names of the raw ones."""
    return {
        _RAW + name.removeprefix(_AVERAGED): values.float()
        for name, values in state.items()
        if name.startswith(_AVERAGED)
    }


@torch.inference_mode()
def _difference(one: Any, other: Any) -> float:
    """Largest difference between the plans of two policies from the same noise, at the starts of a task's first set."""
    task, frames = get_task(one.config.task), one.config.n_obs_steps
    scenarios = next(iter(task.scenario_sets.values()))
    starts = task.states_of(np.array([task.start_of(scenario) for scenario in scenarios]))
    vectors = np.array([task.scenario_vector(scenario) for scenario in scenarios])
    still = np.zeros((len(scenarios), len(task.spec.action)))
    batch = {
        key: torch.tensor(values, dtype=torch.float32)[:, None].repeat(1, frames, 1)
        for key, values in ((STATE, starts), (ENVIRONMENT_STATE, vectors), (HUMAN_ACTION, still))
    }
    shape = len(scenarios), one.config.horizon, len(task.spec.joint_action)
    noise = torch.randn(*shape, generator=torch.Generator().manual_seed(0))
    plans = [policy.plan(batch, torch.Generator().manual_seed(1), noise) for policy in (one, other)]
    return float((plans[0] - plans[1]).abs().max())


def _check_output(out: Path, overwrite: bool) -> None:
    if not out.exists():
        return
    # Only what is a policy itself is ever taken away for one.
    if not overwrite or not (out / "config.json").is_file():
        raise OutputExistsError(out)


@contextmanager
def _staged(out: Path, overwrite: bool) -> Iterator[Path]:
    """A folder to write to, which takes the place of `out` when all is written."""
    with (replaced_folder if out.exists() else new_folder)(out) as folder:
        folder.mkdir()
        yield folder
        _check_output(out, overwrite)
