"""A policy that learned from images of the scene, evaluated by LeRobot's command in the environment."""

from pathlib import Path

import numpy as np
import pytest
import torch
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.factory import make_pre_post_processors
from lerobot_evaluation import evaluated

from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, SCENE_IMAGE, STATE
from copolicy.tasks.table import TableTask
from copolicy.tasks.table.features import FEATURES
from copolicy.tasks.table.maps import MAP_SETS

pytestmark = pytest.mark.filterwarnings("ignore:pkg_resources is deprecated")

SIZE = (96, 64)


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory) -> Path:
    """An untrained ACT with images, as LeRobot's trainer would leave it for a data set of `--video --video-size`."""
    folder = tmp_path_factory.mktemp("act")
    kinds = {STATE: FeatureType.STATE, ENVIRONMENT_STATE: FeatureType.ENV}
    inputs = {key: PolicyFeature(kind, FEATURES[key]["shape"]) for key, kind in kinds.items()}
    config = ACTConfig(
        device="cpu",
        input_features={**inputs, SCENE_IMAGE: PolicyFeature(FeatureType.VISUAL, (3, SIZE[1], SIZE[0]))},
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, FEATURES[ACTION]["shape"])},
        pretrained_backbone_weights=None,
        chunk_size=2, n_action_steps=1, dim_model=16, n_heads=2, dim_feedforward=16, n_encoder_layers=1,
        use_vae=False, push_to_hub=False,
    )  # fmt: skip
    torch.manual_seed(0)
    ACTPolicy(config).save_pretrained(folder)
    for processor in make_pre_post_processors(config):
        processor.save_pretrained(folder)
    return folder


@pytest.mark.parametrize("partner", ["", "S01"])
def test_lerobot_evaluates_a_policy_that_sees_the_scene(checkpoint, tmp_path, monkeypatch, partner):
    images = {"pixels": "true", "observation_width": SIZE[0], "observation_height": SIZE[1]}
    seen = evaluated(monkeypatch, "act", checkpoint, tmp_path, step_limit=9, partner=partner, **images)
    assert len(seen) == 3  # frames of three steps each
    state = seen[0][STATE].numpy().astype(float)
    (image,) = TableTask().images(MAP_SETS["training"][0], state, SIZE)
    given = seen[0][SCENE_IMAGE][0].permute(1, 2, 0).numpy() * 255
    np.testing.assert_allclose(given, image, atol=0.01)
