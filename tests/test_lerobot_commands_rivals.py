"""LeRobot's own commands train and evaluate the paper's rivals."""

import json
import sys
from pathlib import Path

import pytest
import torch
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.policies.factory import make_pre_post_processors
from lerobot.scripts import lerobot_eval
from training_table import lerobot_train

from copolicy.dataset.exceptions import RunError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, STATE
from copolicy.tasks.table.features import FEATURES
from lerobot_policy_copolicy.cogail.configuration_cogail import CoGailConfig
from lerobot_policy_copolicy.cogail.modeling_cogail import CoGailPolicy

pytestmark = pytest.mark.filterwarnings("ignore:pkg_resources is deprecated")

SMALL = {
    "bc_lstm_gmm": {"width": 8, "n_layers": 1},
    "vrnn": {
        "width": 8, "n_samples": 2, "stride": 2, "history_frames": 4, "window_frames": 8, "encoded_frames": 4,
        "plan_frames": 10, "lookahead_frames": 6,
    },
}  # fmt: skip


def _flags(policy: str, root: Path, out: Path) -> list[str]:
    settings = {"type": policy, "device": "cpu", **SMALL.get(policy, {})}
    data = [f"--dataset.root={root}", f"--output_dir={out}", "--batch_size=8", "--steps=2", "--log_freq=1"]
    return [*data, *(f"--policy.{name}={value}" for name, value in settings.items())]


def _evaluated(checkpoint: Path, out: Path, monkeypatch) -> dict:
    """The result of `lerobot-eval` on one short episode."""
    flags = {
        "policy.path": checkpoint, "policy.device": "cpu", "env.type": "table_carrying", "env.step_limit": 30,
        "eval.n_episodes": 1, "eval.batch_size": 1, "eval.use_async_envs": "false", "seed": 0, "output_dir": out,
    }  # fmt: skip
    monkeypatch.setattr(sys, "argv", ["lerobot-eval", *(f"--{name}={value}" for name, value in flags.items())])
    lerobot_eval.main()
    return json.loads((out / "eval_info.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("policy", SMALL)
def test_lerobot_trains_and_evaluates_it(policy, random_table, tmp_path, monkeypatch):
    lerobot_train(monkeypatch, _flags(policy, random_table, tmp_path / "run"))
    result = _evaluated(
        tmp_path / "run" / "checkpoints" / "last" / "pretrained_model", tmp_path / "result", monkeypatch
    )
    assert result["overall"]["n_episodes"] == 1


def test_lerobot_evaluates_co_gail(tmp_path, monkeypatch):
    kinds = {STATE: FeatureType.STATE, ENVIRONMENT_STATE: FeatureType.ENV}
    config = CoGailConfig(
        device="cpu",
        input_features={key: PolicyFeature(kind, FEATURES[key]["shape"]) for key, kind in kinds.items()},
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, FEATURES[ACTION]["shape"])},
        push_to_hub=False,
    )
    torch.manual_seed(0)
    CoGailPolicy(config).save_pretrained(tmp_path / "policy")
    for processor in make_pre_post_processors(config):
        processor.save_pretrained(tmp_path / "policy")
    assert _evaluated(tmp_path / "policy", tmp_path / "result", monkeypatch)["overall"]["n_episodes"] == 1


def test_lerobot_cannot_train_co_gail_and_the_error_names_the_command(random_table, tmp_path, monkeypatch):
    with pytest.raises(RunError, match="use copolicy-train cogail"):
        lerobot_train(monkeypatch, _flags("cogail", random_table, tmp_path / "run"))
