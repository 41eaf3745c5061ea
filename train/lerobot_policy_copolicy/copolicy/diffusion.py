"""The diffusion over plans: how training samples are noised, and how a plan is sampled from noise."""

from collections.abc import Callable
from typing import Any

import torch
from diffusers.schedulers.scheduling_ddim import DDIMScheduler
from diffusers.schedulers.scheduling_ddpm import DDPMScheduler
from torch import Tensor

from .configuration_copolicy import CopolicyConfig


class PlanDiffusion:
    """Noise schedule, prediction target and sampler of a policy; holds no weights.

    The schedulers are diffusers'. Sampling steps are spaced "trailing": with fewer steps than in training, "leading"
    spacing (diffusers' default) would feed pure noise to the network as if it were half denoised.
    """

    def __init__(self, config: CopolicyConfig):
        settings = {
            "num_train_timesteps": config.num_train_timesteps,
            "beta_schedule": config.beta_schedule,
            "prediction_type": config.prediction_type,
            "clip_sample": True,
            "clip_sample_range": config.clip_sample_range,
            "timestep_spacing": "trailing",
        }
        self.scheduler: Any
        if config.sampler == "ddpm":
            self.scheduler = DDPMScheduler(variance_type="fixed_small", **settings)
        else:
            self.scheduler = DDIMScheduler(**settings)
        self.scheduler.set_timesteps(config.filled.num_inference_steps)
        self.num_train_timesteps = config.num_train_timesteps
        self.prediction_type = config.prediction_type
        self.initial_noise_scale: float = config.filled.initial_noise_scale

    def noised(self, actions: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """A training sample of each plan, at a random diffusion step.

        Args:
            actions: `(B, T, n)` in [-1, 1].

        Returns:
            The noisy actions `(B, T, n)`, their steps `(B,)` and what the network shall predict `(B, T, n)`.
        """
        noise = torch.randn_like(actions)
        steps = torch.randint(self.num_train_timesteps, (len(actions),), device=actions.device)
        noisy = self.scheduler.add_noise(actions, noise, steps)
        if self.prediction_type == "epsilon":
            return noisy, steps, noise
        if self.prediction_type == "sample":
            return noisy, steps, actions
        return noisy, steps, self.scheduler.get_velocity(actions, noise, steps)

    def sample(
        self, denoise: Callable[[Tensor, Tensor], Tensor], noise: Tensor, generator: torch.Generator | None = None
    ) -> Tensor:
        """A plan from noise.

        Args:
            denoise: the network for a given history, from noisy actions `(B, T, n)` and steps `(B,)`.
            noise: `(B, T, n)`, standard normal; scaled here by `initial_noise_scale`.
            generator: source of the noise that "ddpm" adds at each step.

        Returns:
            `(B, T, n)` in [-1, 1].
        """
        actions = noise * self.initial_noise_scale
        for step in self.scheduler.timesteps.tolist():
            prediction = denoise(actions, torch.full((len(actions),), step, device=actions.device))
            actions = self.scheduler.step(prediction, step, actions, generator=generator).prev_sample
        return actions.clamp(-1.0, 1.0)
