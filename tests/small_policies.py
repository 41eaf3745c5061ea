"""Co-policies of a few thousand weights, and observations for them."""

from typing import Any

import torch
from lerobot.configs import FeatureType, PolicyFeature

from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE, bounds_of, features_of
from copolicy.dataset.task import get_task
from lerobot_policy_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.modeling_copolicy import CopolicyPolicy

OBSERVATIONS = (STATE, ENVIRONMENT_STATE, HUMAN_ACTION)
TRANSFORMER = {"network": "transformer", "n_layers": 1, "width": 16, "n_heads": 2, "feedforward_width": 32}
MLP = {"network": "mlp", "n_layers": 2, "width": 32}
UNET = {"network": "unet", "down_widths": (8, 16, 16), "step_width": 8}


def policy(seed: int = 0, task: str = "table", **settings) -> Any:
    """An untrained policy: one layer of a transformer, planning with torch, unless said otherwise."""
    kinds, features = {ENVIRONMENT_STATE: FeatureType.ENV}, features_of(get_task(task).spec)
    config = CopolicyConfig(
        task=task,
        device="cpu",
        input_features={
            key: PolicyFeature(kinds.get(key, FeatureType.STATE), features[key]["shape"]) for key in OBSERVATIONS
        },
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, features[ACTION]["shape"])},
        **{"backend": "torch", **TRANSFORMER, **settings},
    )
    torch.manual_seed(seed)
    return CopolicyPolicy(config, dataset_stats={}, dataset_meta=None)


def lively_policy(seed: int = 0, **settings) -> Any:
    """One whose every weight matters: fresh networks predict next to nothing, whatever they are shown."""
    planner = policy(seed, **settings).eval()
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for network in (planner.denoiser, *([planner.ema.model] if planner.ema else [])):
            generator.manual_seed(seed)
            for weight in network.parameters():
                scale = weight.shape[-1] ** -0.5 if weight.ndim > 1 else 0.3
                weight.add_(torch.randn(weight.shape, generator=generator) * scale)
            network.head.weight *= 0.4
            network.head.bias *= 0.4
    return planner


def columns(*shape: int, seed: int = 0, task: str = "table") -> dict[str, torch.Tensor]:
    """Random observations within the bounds of the task, `shape + (n,)` each."""
    generator = torch.Generator().manual_seed(seed)
    batch, bounds = {}, bounds_of(get_task(task).spec)
    for key in OBSERVATIONS:
        low, high = (torch.tensor(bounds[key][end], dtype=torch.float32) for end in (0, 1))
        batch[key] = low + (high - low) * torch.rand(*shape, len(low), generator=generator)
    return batch
