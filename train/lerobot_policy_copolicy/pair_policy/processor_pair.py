"""The processors of every policy here: they batch and move tensors between devices, and do not change values."""

from typing import Any

import torch
from lerobot.processor import PolicyProcessorPipeline, make_default_pre_post_processors

from .configuration_pair import PairPolicyConfig


def make_pair_pre_post_processors(
    config: PairPolicyConfig, dataset_stats: dict[str, dict[str, torch.Tensor]] | None = None
) -> tuple[PolicyProcessorPipeline[dict[str, Any], dict[str, Any]], PolicyProcessorPipeline]:
    """LeRobot's default processors without statistics: the policy itself scales, see `PairPolicyConfig`.

    Inputs and outputs are in the units of the task. `dataset_stats`, which LeRobot always passes, is not used.
    """
    return make_default_pre_post_processors(config, None)
