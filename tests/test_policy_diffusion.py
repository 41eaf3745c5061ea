"""Noise schedule and samplers, against what they must do with a perfect network."""

import pytest
import torch

from lerobot_policy_copolicy.copolicy.configuration_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.diffusion import ActionDiffusion

PREDICTIONS = ("epsilon", "sample", "v_prediction")


def diffusion(**settings) -> ActionDiffusion:
    return ActionDiffusion(CopolicyConfig(device="cpu", **settings))


@pytest.mark.parametrize("prediction_type", PREDICTIONS)
def test_the_target_leads_back_to_the_actions(prediction_type):
    torch.manual_seed(0)
    actions = torch.rand(64, 12, 4) * 2 - 1
    process = diffusion(prediction_type=prediction_type)
    noisy, steps, target = process.add_noise(actions)
    kept = process.scheduler.alphas_cumprod[steps][:, None, None]
    recovered = {
        "epsilon": (noisy - (1 - kept).sqrt() * target) / kept.sqrt(),
        "sample": target,
        "v_prediction": kept.sqrt() * noisy - (1 - kept).sqrt() * target,
    }[prediction_type]
    usable = steps < 90  # close to pure noise, epsilon says nothing in single precision
    torch.testing.assert_close(recovered[usable], actions[usable], atol=1e-3, rtol=0)


@pytest.mark.parametrize("sampler", ["ddpm", "ddim"])
@pytest.mark.parametrize("prediction_type", PREDICTIONS)
@pytest.mark.parametrize("num_inference_steps", [5, 10, 100])
def test_a_perfect_network_yields_its_plan(sampler, prediction_type, num_inference_steps):
    torch.manual_seed(0)
    plan = torch.rand(3, 12, 4) * 1.8 - 0.9
    process = diffusion(sampler=sampler, prediction_type=prediction_type, num_inference_steps=num_inference_steps)
    calls = []

    def perfect(actions: torch.Tensor, steps: torch.Tensor) -> torch.Tensor:
        calls.append(steps)
        kept = process.scheduler.alphas_cumprod[steps][:, None, None]
        noise = (actions - kept.sqrt() * plan) / (1 - kept).sqrt()
        velocity = kept.sqrt() * noise - (1 - kept).sqrt() * plan
        return {"epsilon": noise, "sample": plan, "v_prediction": velocity}[prediction_type]

    sampled = process.sample(perfect, torch.randn(3, 12, 4))
    torch.testing.assert_close(sampled, plan, atol=2e-3, rtol=0)
    # Pure noise is what the network was trained on at the last step, so sampling has to begin there.
    assert calls[0].tolist() == [99] * 3
    assert len(calls) == num_inference_steps


def test_noise_is_the_papers_schedule():
    kept = diffusion(preset="paper").scheduler.alphas_cumprod
    assert len(kept) == 100
    assert kept[-1].item() == pytest.approx(2.4e-7, rel=0.05)
    assert diffusion(preset="paper").scheduler.config.variance_type == "fixed_small"


def test_samples_stay_within_full_force():
    sampled = diffusion(preset="small").sample(lambda actions, steps: actions * 100, torch.randn(4, 12, 4))
    assert sampled.abs().max() <= 1


def test_initial_noise_is_scaled():
    first = []

    def look(actions: torch.Tensor, steps: torch.Tensor) -> torch.Tensor:
        first.append(actions.clone())
        return torch.zeros_like(actions)

    noise = torch.randn(2, 12, 4)
    diffusion(preset="small", initial_noise_scale=0.5).sample(look, noise)
    torch.testing.assert_close(first[0], 0.5 * noise)


def test_ddpm_repeats_with_its_generator():
    def sample(seed: int) -> torch.Tensor:
        generator = torch.Generator().manual_seed(seed)
        return diffusion(preset="paper").sample(lambda a, s: 0.1 * a, torch.ones(2, 12, 4), generator)

    assert torch.equal(sample(3), sample(3))
    assert not torch.equal(sample(3), sample(4))
