"""An untrained co-policy as a checkpoint folder, as LeRobot's trainer would leave it."""

from pathlib import Path

import torch
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.policies.factory import make_pre_post_processors

from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.evaluate.human_study.plan import Robot
from copolicy.tasks.table.features import FEATURES
from lerobot_policy_copolicy.copolicy.configuration_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.modeling_copolicy import CopolicyPolicy

_KINDS = {STATE: FeatureType.STATE, ENVIRONMENT_STATE: FeatureType.ENV, HUMAN_ACTION: FeatureType.STATE}


def save_untrained_policy(folder: Path) -> Path:
    """Writes the small preset with its processors; its head is zero, so that it plans rest."""
    config = CopolicyConfig(
        preset="small",
        device="cpu",
        input_features={key: PolicyFeature(kind, FEATURES[key]["shape"]) for key, kind in _KINDS.items()},
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, FEATURES[ACTION]["shape"])},
    )
    CopolicyPolicy(config).save_pretrained(folder)
    for processor in make_pre_post_processors(config):
        processor.save_pretrained(folder)
    return folder


def untrained_robots(folder: Path) -> list[Robot]:
    """Two robots of a study with people, `first` and `second`, with weights of their own in folders of these names."""
    robots = []
    for seed, name in enumerate(("first", "second")):
        torch.manual_seed(seed)
        robots.append(Robot.from_checkpoint(name, str(save_untrained_policy(folder / name))))
    return robots
