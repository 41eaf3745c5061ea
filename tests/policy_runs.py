"""Folders of training runs without a training: untrained weights in the layout of LeRobot's trainer."""

import json
from pathlib import Path
from typing import Any
from zlib import crc32

import torch
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.policies.factory import make_pre_post_processors

from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE, features_of
from copolicy.dataset.task import get_task
from lerobot_policy_copolicy.bc_lstm_gmm.configuration_bc_lstm_gmm import BcLstmGmmConfig
from lerobot_policy_copolicy.bc_lstm_gmm.modeling_bc_lstm_gmm import BcLstmGmmPolicy
from lerobot_policy_copolicy.cogail.configuration_cogail import CoGailConfig
from lerobot_policy_copolicy.cogail.modeling_cogail import CoGailPolicy
from lerobot_policy_copolicy.copolicy.configuration_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.modeling_copolicy import CopolicyPolicy

_KINDS = {STATE: FeatureType.STATE, ENVIRONMENT_STATE: FeatureType.ENV, HUMAN_ACTION: FeatureType.STATE}
_POLICIES = {
    "copolicy": (CopolicyConfig, CopolicyPolicy, {"preset": "small", "width": 16, "n_layers": 1, "backend": "torch"}),
    "bc_lstm_gmm": (BcLstmGmmConfig, BcLstmGmmPolicy, {"width": 8, "n_layers": 1}),
    "cogail": (CoGailConfig, CoGailPolicy, {"width": 8}),
}


def save_run(
    folder: Path, policy: str = "copolicy", seed: int | None = 0, *, steps: int = 100, reached: int = 100,
    weights: int | None = None, task: str = "table", **settings: Any,
) -> Path:  # fmt: skip
    """Writes a run with one checkpoint.

    Args:
        seed: training seed, also of the weights.
        steps: planned steps, of which `reached` are made.
        weights: seed of the weights, if not that of the training.
        settings: of the policy.
    """
    make_config, make_policy, default = _POLICIES[policy]
    features = features_of(get_task(task).spec)
    config: Any = make_config(
        device="cpu",
        task=task,
        input_features={key: PolicyFeature(kind, features[key]["shape"]) for key, kind in _KINDS.items()},
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, features[ACTION]["shape"])},
        **{**default, "fps": 10.0, **settings},
    )
    torch.manual_seed(crc32(f"{weights if weights is not None else seed} {policy}".encode()))
    checkpoint = folder / "checkpoints" / f"{reached:06d}"
    made: Any = make_policy(config)
    with torch.no_grad():
        for parameter in made.parameters():  # the head of a new denoiser is zero
            parameter.add_(0.1 * torch.randn_like(parameter))
    made.save_pretrained(checkpoint / "pretrained_model")
    for processor in make_pre_post_processors(config):
        processor.save_pretrained(checkpoint / "pretrained_model")
    training = {"seed": seed, "steps": steps, "batch_size": 8, "dataset": {"repo_id": "local/pairs", "root": None}}
    _write(checkpoint / "pretrained_model" / "train_config.json", training)
    _write(checkpoint / "training_state" / "training_step.json", {"step": reached})
    (folder / "checkpoints" / "last").symlink_to(checkpoint.name)
    return folder


def _write(path: Path, content: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content), encoding="utf-8")
