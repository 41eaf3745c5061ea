"""The processors around the co-policy: they move and batch, and leave the values alone."""

from typing import Any

import torch
from lerobot.processor import PolicyProcessorPipeline, make_default_pre_post_processors

from .configuration_copolicy import CopolicyConfig


def make_copolicy_pre_post_processors(
    config: CopolicyConfig, dataset_stats: dict[str, dict[str, torch.Tensor]] | None = None
) -> tuple[PolicyProcessorPipeline[dict[str, Any], dict[str, Any]], PolicyProcessorPipeline]:
    """LeRobot's standard pair: rename, add a batch dimension, move to the device; and back to the CPU.

    Observations go in in px, rad and s, actions come out in [-1, 1]. `dataset_stats`, which LeRobot always passes, is
    not used: see `CopolicyConfig` for why the scaling is in the policy.
    """
    return make_default_pre_post_processors(config, None)
