"""Settings of the co-policy: presets, what they refuse, and that a saved configuration comes back as it was."""

import json
import math
from typing import Any

import pytest
import torch
from lerobot.configs import FeatureType, NormalizationMode, PolicyFeature, PreTrainedConfig
from lerobot.policies import make_pre_post_processors

from copolicy.dataset.exceptions import CopolicyError, InvalidValueError, ShapeError, UnknownNameError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.tasks.table.features import FEATURES
from lerobot_policy_copolicy import CopolicyConfig
from lerobot_policy_copolicy.pair_policy.learning_rate import WarmupCosineSchedulerConfig


def features() -> tuple[dict, dict]:
    kinds = {ENVIRONMENT_STATE: FeatureType.ENV, ACTION: FeatureType.ACTION}
    table = {
        key: PolicyFeature(kinds.get(key, FeatureType.STATE), FEATURES[key]["shape"])
        for key in (STATE, ENVIRONMENT_STATE, HUMAN_ACTION, ACTION)
    }
    action = {ACTION: table.pop(ACTION)}
    return table, action


def config(**settings) -> CopolicyConfig:
    inputs, outputs = features()
    return CopolicyConfig(device="cpu", input_features=inputs, output_features=outputs, **settings)


def test_paper_preset_is_the_paper():
    paper = config(preset="paper")
    assert (paper.network, paper.n_layers, paper.width, paper.n_heads, paper.feedforward_width) == (
        "transformer", 8, 256, 4, 1024,
    )  # fmt: skip
    assert (paper.horizon, paper.n_obs_steps, paper.n_action_steps) == (12, 3, 8)
    assert (paper.prediction_type, paper.sampler, paper.num_inference_steps) == ("epsilon", "ddpm", 100)
    assert (paper.observation_features, paper.mirror, paper.permute_obstacles) == ("absolute", False, False)
    assert (paper.attention_dropout, paper.embedding_dropout, paper.initial_noise_scale) == (0.3, 0.0, 1.0)
    assert (paper.ema, paper.ema_power, paper.ema_inv_gamma, paper.ema_max_decay) == (True, 0.75, 1.0, 0.9999)
    optimizer, schedule = paper.get_optimizer_preset(), paper.get_scheduler_preset()
    assert (optimizer.lr, optimizer.weight_decay, optimizer.betas) == (1e-4, 1e-3, (0.9, 0.95))
    assert optimizer.grad_clip_norm == 0
    assert (schedule.num_warmup_steps, schedule.final_lr_fraction) == (1000, 0.0)
    # Windows that would reach beyond the end start no sample: 12 - 3 frames.
    assert paper.drop_n_last_frames == 9


def test_learning_rate_warms_up_and_falls_to_its_fraction():
    def rates(fraction: float) -> list[float]:
        optimizer = torch.optim.SGD([torch.zeros(1, requires_grad=True)], lr=2.0)
        schedule = WarmupCosineSchedulerConfig(4, fraction).build(optimizer, 12)
        found = []
        for _ in range(14):
            found.append(optimizer.param_groups[0]["lr"])
            optimizer.step()
            schedule.step()
        return found

    assert rates(0.1)[:5] == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0])
    assert rates(0.1)[8] == pytest.approx(2.0 * (0.1 + 0.9 * 0.5))
    assert rates(0.1)[12:] == pytest.approx([0.2, 0.2])
    assert rates(0.0)[12] == 0.0


def test_explicit_settings_win_over_the_preset():
    mixed = config(preset="small", width=128, prediction_type="epsilon", mirror=False)
    assert (mixed.network, mixed.width, mixed.prediction_type, mixed.mirror) == ("mlp", 128, "epsilon", False)


def test_windows_begin_with_the_history():
    assert config().observation_delta_indices == [-2, -1, 0]
    assert config().action_delta_indices == list(range(-2, 10))
    assert config().reward_delta_indices is None


@pytest.mark.parametrize("preset", ["paper", "default", "small"])
def test_saved_configuration_holds_the_values_and_loads_back(tmp_path, preset):
    learned = {"fps": 30.0, "physics": {"angular_acceleration_limit": 0.5}}  # what a training fills in
    saved = config(preset=preset, past_human_action=False, n_action_steps=4, **learned)
    saved.save_pretrained(tmp_path)
    assert None not in {
        name: value for name, value in json.loads((tmp_path / "config.json").read_text(encoding="utf-8")).items()
        if name not in ("repo_id", "private", "tags", "license", "pretrained_path", "pretrained_revision")
    }.values()  # fmt: skip
    assert PreTrainedConfig.from_pretrained(tmp_path) == saved


def test_loaded_configuration_takes_overrides(tmp_path):
    config(preset="small").save_pretrained(tmp_path)
    loaded = PreTrainedConfig.from_pretrained(tmp_path, cli_overrides=["--num_inference_steps=5", "--mirror=false"])
    assert isinstance(loaded, CopolicyConfig)
    assert (loaded.num_inference_steps, loaded.mirror, loaded.network) == (5, False, "mlp")


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        (
            {"preset": "big"},
            UnknownNameError,
            "unknown preset 'big'; available: cnn, cnn-inpainting, cnn-small, default, paper, small",
        ),
        ({"network": "rnn"}, UnknownNameError, "unknown network 'rnn'; available: mlp, transformer, unet"),
        (
            {"timestep_spacing": "linspace"},
            UnknownNameError,
            "unknown timestep_spacing 'linspace'; available: leading, trailing",
        ),
        ({"sampler": "euler"}, UnknownNameError, "unknown sampler 'euler'; available: ddim, ddpm, dpmsolver++"),
        (
            {"n_action_steps": 11},
            InvalidValueError,
            "n_action_steps: expected 1 to 10 (horizon 12 - n_obs_steps 3 + 1), found 11",
        ),
        ({"horizon": 2}, InvalidValueError, "horizon: expected at least n_obs_steps = 3, found 2"),
        ({"n_obs_steps": 0}, InvalidValueError, "n_obs_steps: expected at least 1, found 0"),
        (
            {"num_inference_steps": 101},
            InvalidValueError,
            "num_inference_steps: expected 1 to num_train_timesteps = 100, found 101",
        ),
        (
            {"backend": "onnx", "planner": "plain"},
            InvalidValueError,
            "backend, for planner=plain: expected torch, found 'onnx'",
        ),
        ({"width": 30}, InvalidValueError, "width: expected a multiple of n_heads = 4, found 30"),
        ({"n_layers": 0}, InvalidValueError, "n_layers: expected at least 1, found 0"),
        ({"num_train_timesteps": 0}, InvalidValueError, "num_train_timesteps: expected 1 to 10000, found 0"),
        (
            {"embedding_dropout": 1.0},
            InvalidValueError,
            "embedding_dropout: expected 0 or more and less than 1, found 1.0",
        ),
        ({"optimizer_lr": math.nan}, InvalidValueError, "optimizer_lr: expected at least 0, found nan"),
        ({"optimizer_lr": math.inf}, InvalidValueError, "optimizer_lr: expected at least 0, found inf"),
        (
            {"optimizer_betas": (0.9, 1.5)},
            InvalidValueError,
            "optimizer_betas: expected 0 or more and less than 1, found (0.9, 1.5)",
        ),
        ({"ema_max_decay": 2.0}, InvalidValueError, "ema_max_decay: expected 0 to 1, found 2.0"),
        ({"fps": 0.0}, InvalidValueError, "fps: expected a number above 0, found 0.0"),
        ({"clip_sample_range": 0.0}, InvalidValueError, "clip_sample_range: expected a number above 0, found 0.0"),
        ({"initial_noise_scale": math.nan}, InvalidValueError, "initial_noise_scale: expected zero or more, found nan"),
        ({"initial_noise_scale": -1.0}, InvalidValueError, "initial_noise_scale: expected zero or more, found -1.0"),
    ],
)
def test_wrong_settings_are_named(settings, error, message):
    with pytest.raises(error) as caught:
        config(**settings)
    assert str(caught.value) == message
    assert isinstance(caught.value, CopolicyError)


def test_other_normalisation_is_refused():
    with pytest.raises(InvalidValueError, match=r"normalization_mapping: expected IDENTITY throughout"):
        config(normalization_mapping={"STATE": NormalizationMode.MIN_MAX})


def test_features_are_checked():
    settings = config()
    settings.validate_features()
    settings.input_features = {**(settings.input_features or {}), STATE: PolicyFeature(FeatureType.STATE, (9,))}
    with pytest.raises(ShapeError, match=r"^observation.state: expected shape \(7,\), got \(9,\)$"):
        settings.validate_features()


def test_missing_feature_is_named_and_human_action_is_needed_only_where_it_is_used():
    settings = config()
    assert settings.input_features is not None
    del settings.input_features[HUMAN_ACTION]
    with pytest.raises(InvalidValueError) as caught:
        settings.validate_features()
    assert str(caught.value) == (
        "features of the data set or environment: expected observation.human_action, "
        "found ['observation.environment_state', 'observation.state']"
    )
    settings.past_human_action = False
    settings.validate_features()


def test_processors_leave_values_alone_whatever_the_statistics(tmp_path):
    settings: Any = config(preset="small")
    statistics = {STATE: {"min": torch.full((7,), 240.0), "max": torch.full((7,), 240.0)}}
    first, last = make_pre_post_processors(settings, dataset_stats=statistics)
    first.save_pretrained(tmp_path)
    last.save_pretrained(tmp_path)
    # What LeRobot's trainer does with a checkpoint that is fine-tuned on another data set.
    table = {**settings.input_features, **settings.output_features}
    normalizer = {"features": table, "norm_map": settings.normalization_mapping, "stats": statistics}
    tuned, tuned_last = make_pre_post_processors(
        settings,
        pretrained_path=str(tmp_path),
        preprocessor_overrides={"normalizer_processor": normalizer},
        postprocessor_overrides={"unnormalizer_processor": normalizer},
    )
    state = torch.tensor([[241.0, 300.0, 1.0, 0.0, 50.0, -50.0, 1.0]])
    for before in (first, tuned):
        assert torch.equal(before({STATE: state})[STATE], state)
    action = torch.tensor([[0.3, -0.4, 1.0, -1.0]])
    for after in (last, tuned_last):
        assert torch.equal(after(action), action)
