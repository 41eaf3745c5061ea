"""A policy that learned from images of the scene, evaluated by LeRobot's command in the environment."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.factory import make_pre_post_processors
from lerobot.scripts import lerobot_eval

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
    seen = []
    act = ACTPolicy.select_action
    monkeypatch.setattr(ACTPolicy, "select_action", lambda self, batch: seen.append(batch) or act(self, batch))
    flags = {
        "policy.path": checkpoint, "policy.device": "cpu",
        "env.type": "table_carrying", "env.step_limit": 9, "env.partner": partner,
        "env.pixels": "true", "env.observation_width": SIZE[0], "env.observation_height": SIZE[1],
        "eval.n_episodes": 1, "eval.batch_size": 1, "eval.use_async_envs": "false", "seed": 0, "output_dir": tmp_path,
    }  # fmt: skip
    monkeypatch.setattr(sys, "argv", ["lerobot-eval", *(f"--{name}={value}" for name, value in flags.items())])
    lerobot_eval.main()
    result = json.loads((tmp_path / "eval_info.json").read_text(encoding="utf-8"))
    assert result["overall"]["n_episodes"] == 1
    assert len(seen) == 3  # frames of three steps each
    state = seen[0][STATE].numpy().astype(float)
    (image,) = TableTask().images(MAP_SETS["training"][0], state, SIZE)
    given = seen[0][SCENE_IMAGE][0].permute(1, 2, 0).numpy() * 255
    np.testing.assert_allclose(given, image, atol=0.01)
