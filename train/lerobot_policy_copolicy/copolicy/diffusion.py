"""Diffusion over action sequences: adds noise to training samples, and samples sequences from noise."""

import warnings
from collections.abc import Callable
from typing import Any

import torch
from diffusers.schedulers.scheduling_ddim import DDIMScheduler
from diffusers.schedulers.scheduling_ddpm import DDPMScheduler
from diffusers.schedulers.scheduling_dpmsolver_multistep import DPMSolverMultistepScheduler
from torch import Tensor

from copolicy.dataset.exceptions import UnknownNameError

from .configuration_copolicy import CopolicyConfig
from .fast.sampler_coefficients import SamplerCoefficients, leading_timesteps, trailing_timesteps


class ClippedDpmSolver(DPMSolverMultistepScheduler):
    """diffusers' DPM-Solver++ with the predicted clean sample clipped, as in its DDPM and DDIM.

    At the last training step the signal is 2e-7 of the variance, so an error of 2 % of the predicted noise is an error
    of 40 of the clean sample: without clipping, the next step is far outside the training distribution.
    """

    clip_range: float

    def set_timesteps(self, *args, **kwargs) -> None:
        """diffusers' method, without NumPy 2's warning about its conversion of tensors."""
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "__array__ implementation", DeprecationWarning)
            super().set_timesteps(*args, **kwargs)

    def convert_model_output(self, *args, **kwargs) -> Tensor:
        """The predicted clean sample, clipped."""
        return super().convert_model_output(*args, **kwargs).clamp(-self.clip_range, self.clip_range)


class ActionDiffusion:
    """Noise schedule, prediction target and sampler of a policy; has no weights.

    A sequence has actions, and for inpainting also observations: n values per frame.

    The schedulers are diffusers'; `coefficients` is the same sampler for `FastSampler`.
    """

    def __init__(self, config: CopolicyConfig):
        settings: dict[str, Any] = {
            "num_train_timesteps": config.num_train_timesteps,
            "beta_schedule": config.beta_schedule,
            "prediction_type": config.prediction_type,
        }
        clipped = {"clip_sample": True, "clip_sample_range": config.clip_sample_range}
        self._training: Any = DDPMScheduler(variance_type="fixed_small", **settings, **clipped)
        spaced = {"trailing": trailing_timesteps, "leading": leading_timesteps}[config.filled.timestep_spacing]
        timesteps = spaced(config.num_train_timesteps, config.filled.num_inference_steps)
        self.scheduler: Any
        if config.sampler == "ddpm":
            self.scheduler = self._training
        elif config.sampler == "ddim":
            self.scheduler = DDIMScheduler(**settings, **clipped)
        elif config.sampler == "dpmsolver++":
            self.scheduler = ClippedDpmSolver(**settings)
            self.scheduler.clip_range = config.clip_sample_range
        else:
            raise UnknownNameError("sampler", str(config.sampler), ("ddpm", "ddim", "dpmsolver++"))
        self._set_timesteps(timesteps)
        self.coefficients = SamplerCoefficients(
            config.sampler,
            config.filled.prediction_type,
            self.scheduler.alphas_cumprod,
            timesteps,
            config.clip_sample_range,
            config.filled.initial_noise_scale,
        )
        self.num_train_timesteps = config.num_train_timesteps
        self.prediction_type = config.prediction_type
        self.initial_noise_scale: float = config.filled.initial_noise_scale

    def _set_timesteps(self, timesteps: list[int]) -> None:
        """Resets the scheduler; DPM-Solver++ keeps state of the previous sampling."""
        if isinstance(self.scheduler, DDIMScheduler):
            self.scheduler.set_timesteps(len(timesteps))
            self.scheduler.timesteps = torch.tensor(timesteps)
        else:
            self.scheduler.set_timesteps(timesteps=timesteps)

    def add_noise(self, actions: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Adds noise to action sequences, each at a random diffusion step.

        Args:
            actions: `(B, T, n)` in [-1, 1].

        Returns:
            The noisy actions `(B, T, n)`, their steps `(B,)` and the target of the network's prediction `(B, T, n)`.
        """
        noise = torch.randn_like(actions)
        steps = torch.randint(self.num_train_timesteps, (len(actions),), device=actions.device)
        noisy = self._training.add_noise(actions, noise, steps)
        if self.prediction_type == "epsilon":
            return noisy, steps, noise
        if self.prediction_type == "sample":
            return noisy, steps, actions
        return noisy, steps, self._training.get_velocity(actions, noise, steps)

    def sample(
        self, denoise: Callable[[Tensor, Tensor], Tensor], noise: Tensor, generator: torch.Generator | None = None
    ) -> Tensor:
        """Samples action sequences with diffusers' scheduler; the reference for `FastSampler`.

        Args:
            denoise: the network for given histories, from noisy actions `(B, T, n)` and steps `(B,)`.
            noise: `(B, T, n)`, standard normal; scaled here by `initial_noise_scale`.
            generator: source of the noise that DDPM adds at each step.

        Returns:
            `(B, T, n)` in [-1, 1].
        """
        timesteps = self.scheduler.timesteps.tolist()
        self._set_timesteps(timesteps)
        actions = noise * self.initial_noise_scale
        for step in timesteps:
            prediction = denoise(actions, torch.full((len(actions),), step, device=actions.device))
            actions = self.scheduler.step(prediction, step, actions, generator=generator).prev_sample
        return actions.clamp(-1.0, 1.0)
