"""Samplers as tables, against diffusers' schedulers with the same network and the same noise."""

import pytest
import torch
from diffusers.schedulers.scheduling_ddpm import DDPMScheduler
from diffusers.schedulers.scheduling_dpmsolver_multistep import DPMSolverMultistepScheduler

from copolicy.dataset.exceptions import UnknownNameError
from lerobot_policy_copolicy.copolicy.configuration_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.diffusion import ActionDiffusion
from lerobot_policy_copolicy.copolicy.fast.sampler_coefficients import (
    SamplerCoefficients,
    leading_timesteps,
    trailing_timesteps,
)

PREDICTIONS = ("epsilon", "sample", "v_prediction")


def diffusion(**settings) -> ActionDiffusion:
    return ActionDiffusion(CopolicyConfig(device="cpu", **settings))


def network(actions: torch.Tensor, step: torch.Tensor | int) -> torch.Tensor:
    """A prediction of the usual size that depends on actions and step."""
    step = torch.as_tensor(step).reshape(-1, 1, 1)
    return (1.3 * actions + 0.01 * step).sin() + 0.4 * actions.flip(-1)


def both(process: ActionDiffusion, noise: torch.Tensor, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    """The plan by the scheduler, and the plan by the table."""
    generators = [torch.Generator().manual_seed(seed) for _ in range(2)]
    plain = process.sample(network, noise, generators[0])
    steps = process.coefficients.steps
    table = process.coefficients.sample(
        lambda index, actions: network(actions, steps[index].timestep), noise, noise.shape[1], generators[1]
    )
    assert torch.equal(generators[0].get_state(), generators[1].get_state())
    return plain, table


@pytest.mark.parametrize("sampler", ["ddpm", "ddim", "dpmsolver++"])
@pytest.mark.parametrize("prediction_type", PREDICTIONS)
@pytest.mark.parametrize("num_inference_steps", [1, 5, 8, 10, 29, 34, 100])
def test_table_is_the_scheduler(sampler, prediction_type, num_inference_steps):
    process = diffusion(sampler=sampler, prediction_type=prediction_type, num_inference_steps=num_inference_steps)
    noise = torch.randn(5, 12, 4, generator=torch.Generator().manual_seed(1))
    plain, table = both(process, noise)
    assert len(process.coefficients.steps) == num_inference_steps
    assert plain.abs().max() > 0.3
    torch.testing.assert_close(table, plain, atol=2e-5, rtol=0)


@pytest.mark.parametrize("sampler", ["ddpm", "ddim", "dpmsolver++"])
def test_table_with_leading_steps_is_the_scheduler(sampler):
    process = diffusion(sampler=sampler, num_inference_steps=8, timestep_spacing="leading")
    plain, table = both(process, torch.randn(5, 12, 4, generator=torch.Generator().manual_seed(1)))
    assert [step.timestep for step in process.coefficients.steps] == list(range(84, -1, -12))
    torch.testing.assert_close(table, plain, atol=2e-5, rtol=0)


@pytest.mark.parametrize("prediction_type", ["epsilon", "v_prediction"])
def test_ddpm_is_bit_for_bit_the_scheduler(prediction_type):
    process = diffusion(sampler="ddpm", prediction_type=prediction_type, num_inference_steps=100)
    plain, table = both(process, torch.randn(5, 12, 4))
    assert torch.equal(table, plain)


@pytest.mark.parametrize("range_", [1.0, 0.6])
def test_clip_range_and_initial_noise_are_those_of_the_configuration(range_):
    for sampler in ("ddpm", "ddim", "dpmsolver++"):
        process = diffusion(sampler=sampler, num_inference_steps=10, clip_sample_range=range_, initial_noise_scale=0.7)
        plain, table = both(process, torch.randn(5, 12, 4))
        torch.testing.assert_close(table, plain, atol=2e-5, rtol=0)
        assert (table.abs().max() <= 0.6) == (range_ == 0.6)


@pytest.mark.parametrize("tokens", [12, 10, 3])
def test_noise_is_drawn_for_the_whole_plan(tokens):
    process = diffusion(sampler="ddpm", num_inference_steps=34)
    noise, generators = torch.randn(2, 12, 4), [torch.Generator().manual_seed(0) for _ in range(2)]
    # A network that treats every token alone.
    whole, part = (
        process.coefficients.sample(lambda index, actions: 0.5 * actions, noise, wanted, generator)
        for wanted, generator in zip((12, tokens), generators, strict=True)
    )
    assert torch.equal(part, whole[:, :tokens])


@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # of diffusers with NumPy 2
@pytest.mark.parametrize("num_inference_steps", [5, 8, 10, 34])
def test_dpm_solver_clips_as_thresholding_at_one_does(num_inference_steps):
    settings = {"prediction_type": "epsilon", "sampler": "dpmsolver++", "num_inference_steps": num_inference_steps}
    process = diffusion(**settings)
    other = DPMSolverMultistepScheduler(
        100,
        beta_schedule="squaredcos_cap_v2",
        timestep_spacing="trailing",
        thresholding=True,
        dynamic_thresholding_ratio=0.99,
        sample_max_value=1.0,
    )
    other.set_timesteps(num_inference_steps)
    assert other.timesteps.tolist() == [step.timestep for step in process.coefficients.steps]
    noise = torch.randn(3, 12, 4)
    actions = noise
    for step in other.timesteps:
        (actions,) = other.step(network(actions, step), step, actions, return_dict=False)
    for plan in both(process, noise):
        torch.testing.assert_close(plan, actions.clamp(-1, 1), atol=2e-5, rtol=0)


def test_an_error_of_the_first_step_does_not_grow():
    """Two per cent of error in the predicted noise of the last training step are a plan forty times too large."""
    plan = torch.rand(4, 12, 4) - 0.5
    process = diffusion(prediction_type="epsilon", sampler="dpmsolver++", num_inference_steps=5)
    steps, kept = process.coefficients.steps, process.scheduler.alphas_cumprod
    sizes = []

    def nearly_perfect(index: int, actions: torch.Tensor) -> torch.Tensor:
        sizes.append(actions.std().item())
        share = kept[steps[index].timestep]
        return (actions - share.sqrt() * plan) / (1 - share).sqrt() * 1.02

    sampled = process.coefficients.sample(nearly_perfect, torch.randn(4, 12, 4), 12)
    assert max(sizes) < 1.2
    assert (sampled - plan).abs().mean() < 0.1


def test_trailing_steps_are_those_of_diffusers_where_its_range_has_the_right_length():
    for steps in range(1, 101):
        timesteps = trailing_timesteps(100, steps)
        assert len(set(timesteps)) == steps
        assert timesteps[0] == 99
        assert min(timesteps) >= 0
        scheduler = DDPMScheduler(100, timestep_spacing="trailing")
        scheduler.set_timesteps(steps)
        if steps not in (29, 31, 58, 62, 97):  # where diffusers ends with the step -1
            assert scheduler.timesteps.tolist() == timesteps


def test_leading_steps_are_those_of_diffusers():
    scheduler = DDPMScheduler(100)
    for steps in range(1, 101):
        scheduler.set_timesteps(steps)
        assert scheduler.timesteps.tolist() == leading_timesteps(100, steps)


def test_the_scheduler_of_one_plan_forgets_the_one_before():
    process = diffusion(sampler="dpmsolver++", num_inference_steps=8)
    noise = torch.randn(2, 12, 4)
    assert torch.equal(process.sample(network, noise), process.sample(network, noise))


def test_unknown_names_are_told():
    kept = torch.linspace(1.0, 0.0, 100)
    with pytest.raises(UnknownNameError, match=r"^unknown sampler 'euler'; available: ddim, ddpm, dpmsolver\+\+$"):
        SamplerCoefficients("euler", "epsilon", kept, [99], 1.0)
    for sampler in ("ddpm", "ddim", "dpmsolver++"):
        with pytest.raises(UnknownNameError, match=r"^unknown prediction_type 'score'; available: epsilon, sample"):
            SamplerCoefficients(sampler, "score", kept, [99, 49], 1.0)
