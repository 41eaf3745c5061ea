"""The temporal CNN as a network of the co-policy: LeRobot's module, global conditioning and inpainting."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch
from diffusers.schedulers.scheduling_ddim import DDIMScheduler
from lerobot.configs import FeatureType, PolicyFeature, PreTrainedConfig
from lerobot.policies.diffusion.configuration_diffusion import DiffusionConfig
from lerobot.policies.diffusion.modeling_diffusion import DiffusionConditionalUnet1d
from small_policies import UNET, columns, policy

from copolicy.cards.cli import main as cards
from copolicy.collect.agents import PolicyAgent, load_policy
from copolicy.collect.rollout import Rollout
from copolicy.dataset.exceptions import InvalidValueError, ShapeError
from copolicy.dataset.features import ACTION, STATE
from copolicy.dataset.task import get_task
from copolicy.evaluate.cli import main as evaluate
from copolicy.train.cli import main as train
from lerobot_policy_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.denoiser_unet import UnetDenoiser
from lerobot_policy_copolicy.copolicy.networks import make_denoiser

INPAINTING = {**UNET, "preset": "cnn-inpainting"}


def sequences(size: int = 5, **settings) -> dict[str, torch.Tensor]:
    """A training batch with observations of all 12 frames."""
    generator = torch.Generator().manual_seed(1)
    return {**columns(size, 12, **settings), ACTION: torch.rand(size, 12, 4, generator=generator) * 2 - 1}


def inputs_of(learner) -> list[torch.Tensor]:
    """A list that gets the sequences that the U-Net is given from now on."""
    seen: list[torch.Tensor] = []
    network = learner.denoiser if learner.training or learner.ema is None else learner.ema.model
    network.unet.register_forward_pre_hook(lambda _, arguments: seen.append(arguments[0].clone()))
    return seen


def scaled_history(learner, batch: dict[str, torch.Tensor]) -> torch.Tensor:
    return learner.features({key: values[:, :3] for key, values in batch.items()})


@pytest.mark.parametrize(
    ("preset", "settings", "parameters"),
    [
        ("cnn", {}, 65_987_588),
        ("cnn", {"past_human_action": True}, 66_073_604),
        ("cnn-inpainting", {}, 65_245_718),
        ("cnn", {"past_human_action": True, "down_widths": (64, 128, 256)}, 5_484_740),
    ],
)
def test_it_has_as_many_parameters_as_the_original(preset, settings, parameters):
    config = CopolicyConfig(device="cpu", preset=preset, **settings)
    with torch.device("meta"):
        network = make_denoiser(config, 4, 20 if config.past_human_action else 18)
    assert sum(parameter.numel() for parameter in network.parameters()) == parameters


def test_it_is_lerobots_module_with_the_history_as_global_condition():
    network = UnetDenoiser(4, 18, 3, (8, 16, 16), step_width=8).eval()
    settings = DiffusionConfig(
        device="cpu",
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, (4,))},
        down_dims=(8, 16, 16),
        diffusion_step_embed_dim=8,
    )
    other = DiffusionConditionalUnet1d(settings, 54).eval()
    other.load_state_dict(network.unet.state_dict())
    noisy, condition, steps = torch.randn(2, 12, 4), torch.randn(2, 3, 18), torch.tensor([3, 90])
    expected = other(noisy, steps, condition.flatten(1))
    torch.testing.assert_close(network(noisy, steps, condition), expected, rtol=0, atol=0)


def test_the_cnn_preset_is_that_of_diffusion_policy():
    cnn = CopolicyConfig(device="cpu", preset="cnn")
    assert (cnn.network, cnn.down_widths, cnn.kernel_size, cnn.n_groups, cnn.step_width) == (
        "unet", (256, 512, 1024), 5, 8, 256,
    )  # fmt: skip
    assert (cnn.inpainting, cnn.past_human_action, cnn.observation_features) == (False, False, "absolute")
    assert (cnn.sampler, cnn.num_inference_steps, cnn.prediction_type) == ("ddpm", 100, "epsilon")
    assert (cnn.horizon, cnn.n_obs_steps, cnn.drop_n_last_frames, cnn.beta_schedule) == (12, 3, 9, "squaredcos_cap_v2")
    optimizer, schedule = cnn.get_optimizer_preset(), cnn.get_scheduler_preset()
    assert (optimizer.lr, optimizer.betas, optimizer.weight_decay) == (1e-4, (0.95, 0.999), 1e-6)
    assert (optimizer.grad_clip_norm, schedule.num_warmup_steps, schedule.final_lr_fraction) == (0.0, 500, 0.0)
    assert (cnn.ema, cnn.ema_power, cnn.ema_max_decay) == (True, 0.75, 0.9999)
    assert cnn.observation_delta_indices == [-2, -1, 0]


def test_the_inpainting_preset_is_the_released_configuration():
    released, cnn = (CopolicyConfig(device="cpu", preset=name) for name in ("cnn-inpainting", "cnn"))
    assert (released.inpainting, released.sampler, released.num_inference_steps) == (True, "ddim", 8)
    assert (released.timestep_spacing, released.clip_sample_range) == ("leading", 1.0)
    assert released.get_optimizer_preset() == cnn.get_optimizer_preset()
    assert released.observation_delta_indices == released.action_delta_indices == list(range(-2, 10))


def test_the_small_preset_is_small_with_another_network():
    cnn, small = (CopolicyConfig(device="cpu", preset=name) for name in ("cnn-small", "small"))
    differing = {name for name, value in vars(small).items() if value != getattr(cnn, name)}
    assert differing == {"preset", "network", "down_widths"}
    assert (cnn.network, cnn.down_widths) == ("unet", (64, 128, 256))


@pytest.mark.parametrize("preset", ["cnn", "cnn-inpainting", "cnn-small"])
def test_saved_settings_load_back(tmp_path, preset):
    saved = CopolicyConfig(device="cpu", preset=preset, down_widths=(8, 16))
    saved.save_pretrained(tmp_path)
    assert PreTrainedConfig.from_pretrained(tmp_path) == saved


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"horizon": 14}, "horizon: expected a multiple of 4, because down_widths has 3 levels, found 14"),
        ({"down_widths": (64, 100)}, "down_widths: expected multiples of n_groups = 8, the first one also of 8"),
        (
            {"down_widths": (12, 24), "n_groups": 4},
            "down_widths: expected multiples of n_groups = 4, the first one als",
        ),
        ({"down_widths": ()}, "down_widths: expected multiples of n_groups = 8, the first one also of 8, found []"),
        ({"down_widths": (0,)}, "down_widths: expected at least 1, found (0,)"),
        ({"kernel_size": 4}, "kernel_size: expected an odd number, found 4"),
        ({"step_width": 7}, "step_width: expected an even number, found 7"),
        ({"step_width": 2}, "step_width: expected at least 4, found 2"),
        ({"backend": "onnx"}, "backend, for network=unet: expected torch, found 'onnx'"),
        ({"backend": "numba"}, "backend, for network=unet: expected torch, found 'numba'"),
        (
            {"preset": "small", "inpainting": True},
            "inpainting: expected false for network=mlp, only the unet has it, found True",
        ),
        (
            {"preset": "cnn-inpainting", "observation_features": "scan"},
            "observation_features, for inpainting: expected absolute, whose values are in [-1, 1]",
        ),
    ],
)
def test_a_wrong_setting_is_one_line(settings, message):
    with pytest.raises(InvalidValueError) as caught:
        CopolicyConfig(device="cpu", **{"preset": "cnn", **settings})
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("backend", ["auto", "torch"])
def test_any_planner_samples_with_the_modules(backend):
    settings = {**UNET, "preset": "cnn", "num_inference_steps": 10}
    fast, plain = policy(backend=backend, **settings).eval(), policy(planner="plain", **settings).eval()
    noise = torch.randn(2, 12, 4)
    chunks = [one.sample_actions(columns(2, 3), torch.Generator().manual_seed(0), noise, 8) for one in (fast, plain)]
    assert torch.equal(*chunks)
    assert chunks[0].shape == (2, 10, 4)
    assert fast.planned_with == plain.planned_with == ("torch",)


@pytest.mark.parametrize("settings", [{**UNET, "preset": "cnn-small"}, INPAINTING], ids=["global", "inpainting"])
def test_mixed_precision_does_not_change_the_convolutions_of_a_cpu(settings):
    learner = policy(**settings, mirror=False).eval()
    losses = []
    for enabled in (False, True):
        torch.manual_seed(0)
        with torch.autocast("cpu", torch.bfloat16, enabled=enabled):
            batch = sequences()
            if not learner.config.inpainting:
                batch |= {key: batch[key][:, :3] for key in learner.config.observation_keys}
            losses.append(learner(batch)[0])
    assert torch.equal(*losses)


def test_every_weight_of_the_network_decays_as_in_diffusion_policy():
    learner = policy(**UNET)
    (group,) = learner.get_optim_params()
    assert [id(weight) for weight in group["params"]] == [id(weight) for weight in learner.denoiser.parameters()]
    assert "weight_decay" not in group  # the optimizer's


def test_the_average_follows_the_network():
    learner = policy(**UNET).train()
    for _ in range(2):
        learner.update()
    with torch.no_grad():
        learner.denoiser.unet.final_conv[1].bias.add_(1.0)
    before = learner.ema.model.unet.final_conv[1].bias.clone()
    learner.update()
    decay = 1 - (1 + 1) ** -0.75
    torch.testing.assert_close(learner.ema.model.unet.final_conv[1].bias, before + (1 - decay))


def test_training_gives_the_network_the_clean_history_and_noise_elsewhere():
    learner, batch = policy(**INPAINTING).train(), sequences()
    seen = inputs_of(learner)
    learner(batch)
    (sequence,) = seen
    clean = torch.cat((batch[ACTION], learner.features(batch)), dim=-1)
    assert sequence.shape == clean.shape == (5, 12, 22)
    is_clean = (sequence == clean).all(dim=0)
    assert is_clean[:3, 4:].all()
    assert not is_clean[3:].any()
    assert not is_clean[:3, :4].any()


def test_the_loss_leaves_the_history_out():
    learner = policy(**INPAINTING).eval()
    for weight in learner.denoiser.unet.final_conv.parameters():  # predicts zero, so that the loss is the noise's
        torch.nn.init.zeros_(weight)
    torch.manual_seed(3)
    noise = torch.randn(5, 12, 22)
    noise[:, :3, 4:] = 0
    for reduction, expected in (("mean", noise.square().mean()), ("none", noise.square().mean(dim=(1, 2)))):
        torch.manual_seed(3)
        torch.testing.assert_close(learner(sequences(), reduction)[0], expected)


def test_a_sample_never_changes_what_was_observed():
    planner, batch = policy(**INPAINTING).eval(), columns(4, 3)
    seen = inputs_of(planner)
    planner.sample_actions(batch)
    assert len(seen) == 8
    history = scaled_history(planner, batch)
    for sequence in seen:
        assert torch.equal(sequence[:, :3, 4:], history)
    assert all(not torch.equal(one[:, 3:], other[:, 3:]) for one, other in pairwise(seen))


def test_samples_are_those_of_the_loop_of_diffusion_policy():
    planner, batch = policy(**INPAINTING).eval(), columns(4, 3)
    noise = torch.randn(4, 12, 22)
    history, sequence = scaled_history(planner, batch), noise.clone()
    scheduler = DDIMScheduler(100, beta_schedule="squaredcos_cap_v2")  # "leading", clipped
    scheduler.set_timesteps(8)
    assert scheduler.timesteps.tolist() == list(range(84, -1, -12))
    with torch.no_grad():
        for step in scheduler.timesteps:
            sequence[:, :3, 4:] = history
            prediction = planner.ema.model.unet(sequence, step.expand(4))
            sequence = scheduler.step(prediction, int(step), sequence, return_dict=False)[0]
    sampled = planner.sample_actions(batch, noise=noise)
    torch.testing.assert_close(sampled, sequence[..., :4].clamp(-1, 1), rtol=0, atol=1e-6)
    with pytest.raises(ShapeError, match=r"^noise: expected shape \(4, 12, 22\), got \(4, 12, 4\)$"):
        planner.sample_actions(batch, noise=noise[..., :4])


def test_inpainting_needs_the_observations_of_all_frames():
    batch = sequences()
    batch[STATE] = batch[STATE][:, :3]
    with pytest.raises(ShapeError, match=r"observation.state: expected shape \(B, 12, 7\), got \(5, 3, 7\)"):
        policy(**INPAINTING)(batch)


@pytest.mark.usefixtures("peg")
@pytest.mark.parametrize("settings", [{**UNET, "preset": "cnn"}, INPAINTING], ids=["global", "inpainting"])
def test_it_acts_in_another_task(settings):
    planner = policy(task="peg", **{**settings, "num_inference_steps": 2}).eval()
    actions = planner.predict_action_chunk(columns(2, 3, task="peg"))
    assert actions.shape == (2, 8, 2)
    assert actions.isfinite().all()


@pytest.fixture(scope="module", params=["cnn-inpainting", "cnn-small"])
def run(request, sound_recordings, sound, tmp_path_factory) -> Path:
    """A training run of 20 steps on the data set of six recordings."""
    out = tmp_path_factory.mktemp("runs") / request.param
    flags = [f"--policy.preset={request.param}", "--policy.down_widths=[8,16]", "--policy.step_width=8"]
    where = [f"--dataset.root={sound_recordings.parent / 'set'}", f"--output_dir={out}", "--policy.device=cpu"]
    assert train(["--policy.type=copolicy", *flags, *where, "--batch_size=8", "--steps=20", "--save_freq=20"]) == 0
    return out


def test_it_is_trained_resumed_evaluated_and_exported(run, tmp_path):
    settings = run / "checkpoints" / "last" / "pretrained_model" / "train_config.json"
    assert train([f"--config_path={settings}", "--resume=true", "--steps=22"]) == 0
    out = tmp_path / "eval.json"
    flags = ["--maps", "unseen", "--limit", "2", "--step-limit", "60", "--out", str(out)]
    assert evaluate(["coplan", "--policy", str(run), *flags]) == 0
    described = json.loads(out.read_text(encoding="utf-8"))["policy"]
    assert (described["network"], described["preset"], described["planned_with"]) == ("unet", run.name, ["torch"])
    assert evaluate(["coplan", "--policy", str(run), *flags[:-1], str(tmp_path / "x"), "--backend", "onnx"]) == 2
    assert train(["export", str(run), "--out", str(tmp_path / "exported"), "--eval", str(out)]) == 0
    assert cards(["model", str(tmp_path / "exported")]) == 0
    card = (tmp_path / "exported" / "README.md").read_text(encoding="utf-8")
    assert "| `down_widths` | [8, 16] |" in card
    assert "`n_layers`" not in card


def test_it_acts_at_either_seat(run):
    task = get_task()
    players = PolicyAgent(load_policy(run), task, seed=1), PolicyAgent(load_policy(run), task, seed=2)
    rollout = Rollout(task, task.scenario_sets["unseen"][:2], players, settings=task.settings_type(step_limit=30))
    rollout.run()
    assert np.isfinite(rollout.actions).all()
    assert (np.abs(rollout.actions).max(axis=-1) > 0).all()
