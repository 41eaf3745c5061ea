"""Samplers as precomputed coefficients of their steps, which diffusers' schedulers compute at every step."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from copolicy.dataset.exceptions import UnknownNameError


class SamplerStep(NamedTuple):
    """One step of a sampler, from noisy actions x and the network's prediction f to less noisy actions.

        x0   = clip((x_in x - f_in f) / divisor), or clip(f) if the network predicts x0 itself (x_in = 0)
        next = x0_out x0 + x_out x + f_out f + last_out x0 of the previous step + noise_out noise

    DDPM, DDIM and DPM-Solver++ are all of this form. `draws` states whether noise is drawn; a DDPM step also draws
    noise of weight zero, which advances the generator.
    """

    timestep: int
    x_in: float
    f_in: float
    divisor: float
    x0_out: float
    x_out: float
    f_out: float = 0.0
    last_out: float = 0.0
    noise_out: float = 0.0
    draws: bool = False


class SamplerCoefficients:
    """The steps of a sampler, equal to those of diffusers' schedulers with clipped samples.

    The coefficients are computed in single precision in the schedulers' order of operations: at low noise they are
    differences of numbers close to one, so that a more exact computation would differ from the schedulers.

    Attributes:
        steps: the steps, from noise to actions.
    """

    def __init__(
        self,
        sampler: str,
        prediction_type: str,
        alphas_cumprod: Tensor,
        timesteps: Sequence[int],
        clip_range: float,
        initial_noise_scale: float = 1.0,
    ):
        """
        Args:
            sampler: "ddpm" (Ho et al., 2020, with the posterior's variance), "ddim" (Song et al., 2021, without
                noise) or "dpmsolver++" (Lu et al., 2022, second order in two steps, the last one of first order).
            prediction_type: "epsilon", "sample" or "v_prediction".
            alphas_cumprod: `(num_train_timesteps,)` proportion of the variance that is signal (alpha bar).
            timesteps: training steps at which the network is evaluated, decreasing.
            clip_range: x0 is clipped to plus and minus this.
            initial_noise_scale: standard deviation of the initial noise.

        Raises:
            UnknownNameError: the sampler or the prediction type does not exist.
        """
        make = {"ddpm": _ddpm, "ddim": _ddim, "dpmsolver++": _dpm_solver}
        if sampler not in make:
            raise UnknownNameError("sampler", sampler, make)
        self.steps = make[sampler](prediction_type, alphas_cumprod.float().cpu(), list(timesteps))
        self._clip_range, self._initial_noise_scale = clip_range, initial_noise_scale

    def sample(
        self,
        denoise: Callable[[int, Tensor], Tensor],
        noise: Tensor,
        tokens: int,
        generator: torch.Generator | None = None,
    ) -> Tensor:
        """Samples the first `tokens` actions of each sequence.

        Args:
            denoise: the network for given histories, from the index of a step and noisy actions `(B, tokens, n)`.
            noise: `(B, T, n)`, standard normal; scaled here.
            tokens: number of sampled actions. Noise is drawn for all T, so that results for a seed do not depend on it.
            generator: source of the noise that DDPM adds at each step.

        Returns:
            `(B, tokens, n)` in [-1, 1].
        """
        actions, last = noise[:, :tokens] * self._initial_noise_scale, None
        low, high = -self._clip_range, self._clip_range
        for index, step in enumerate(self.steps):
            clean = prediction = denoise(index, actions)
            if step.x_in:
                clean = (actions * step.x_in - prediction * step.f_in) / step.divisor
            clean = clean.clamp(low, high)
            following = clean * step.x0_out
            if step.x_out:
                following += actions * step.x_out
            if step.f_out:
                following += prediction * step.f_out
            if last is not None and step.last_out:
                following += last * step.last_out
            if step.draws:
                following += _draw(noise, generator)[:, :tokens] * step.noise_out
            actions, last = following, clean
        return actions.clamp(-1.0, 1.0)


def trailing_timesteps(num_train_timesteps: int, num_inference_steps: int) -> list[int]:
    """Evenly spaced steps from the last training step down ("trailing" in diffusers).

    With fewer steps than in training, "leading" spacing gives the network pure noise at a step of partly denoised
    input. diffusers' trailing list ends with a step -1 for some numbers of steps (29, 31, 58,
    62 and 97 of 100), by a rounding error of its range; this one does not.
    """
    steps = np.arange(num_train_timesteps, 0, -num_train_timesteps / num_inference_steps)[:num_inference_steps]
    return (np.round(steps).astype(int) - 1).tolist()


def leading_timesteps(num_train_timesteps: int, num_inference_steps: int) -> list[int]:
    """Evenly spaced steps down to the first training step ("leading", diffusers' default)."""
    stride = num_train_timesteps // num_inference_steps
    return [index * stride for index in reversed(range(num_inference_steps))]


def _draw(like: Tensor, generator: torch.Generator | None) -> Tensor:
    """Standard normal noise as diffusers draws it: on the generator's device."""
    device = like.device if generator is None else generator.device
    return torch.randn(like.shape, generator=generator, device=device, dtype=like.dtype).to(like.device)


def _clean(prediction_type: str, signal: Tensor, noise: Tensor) -> tuple[float, float, float]:
    """`x_in, f_in, divisor` for a noisy sample that is `signal` times the clean sample plus `noise` times noise."""
    choices = {
        "epsilon": (1.0, noise.item(), signal.item()),
        "sample": (0.0, -1.0, 1.0),
        "v_prediction": (signal.item(), noise.item(), 1.0),
    }
    if prediction_type not in choices:
        raise UnknownNameError("prediction_type", prediction_type, choices)
    return choices[prediction_type]


def _ddpm(prediction_type: str, alphas_cumprod: Tensor, timesteps: list[int]) -> list[SamplerStep]:
    steps = []
    for timestep, next_timestep in zip(timesteps, [*timesteps[1:], None], strict=True):
        before = alphas_cumprod[timestep]
        after = torch.tensor(1.0) if next_timestep is None else alphas_cumprod[next_timestep]
        ratio = before / after
        variance = ((1 - after) / (1 - before) * (1 - ratio)).clamp(min=1e-20)
        steps.append(
            SamplerStep(
                timestep,
                *_clean(prediction_type, before**0.5, (1 - before) ** 0.5),
                x0_out=(after**0.5 * (1 - ratio) / (1 - before)).item(),
                x_out=(ratio**0.5 * (1 - after) / (1 - before)).item(),
                noise_out=(variance**0.5).item(),
                draws=timestep > 0,
            )
        )
    return steps


def _ddim(prediction_type: str, alphas_cumprod: Tensor, timesteps: list[int]) -> list[SamplerStep]:
    # As in diffusers, each step goes down by the same whole number of training steps, also if the next step of the list
    # is one further; they agree if the number of sampling steps divides the number of training steps.
    stride = len(alphas_cumprod) // len(timesteps)
    steps = []
    for timestep in timesteps:
        before = alphas_cumprod[timestep]
        after = alphas_cumprod[timestep - stride] if timestep >= stride else alphas_cumprod[0] * 0 + 1
        signal, noise, next_noise = before**0.5, (1 - before) ** 0.5, (1 - after) ** 0.5
        # The direction of the noise is that of the prediction before clipping.
        x_out, f_out = {
            "epsilon": (torch.tensor(0.0), next_noise),
            "sample": (next_noise / noise, -next_noise * signal / noise),
            "v_prediction": (next_noise * noise, next_noise * signal),
        }.get(prediction_type, (next_noise, next_noise))
        clean = _clean(prediction_type, signal, noise)
        steps.append(SamplerStep(timestep, *clean, x0_out=(after**0.5).item(), x_out=x_out.item(), f_out=f_out.item()))
    return steps


def _dpm_solver(prediction_type: str, alphas_cumprod: Tensor, timesteps: list[int]) -> list[SamplerStep]:
    ratios = torch.cat(((((1 - alphas_cumprod) / alphas_cumprod) ** 0.5)[timesteps], torch.zeros(1)))  # noise to signal
    signal = 1 / (ratios**2 + 1) ** 0.5
    noise = ratios * signal
    distance = (signal.log() - noise.log()).diff()  # step sizes in log signal-to-noise ratio; the last is infinite
    steps = []
    for index, timestep in enumerate(timesteps):
        reach = -signal[index + 1] * (torch.exp(-distance[index]) - 1)  # weight of x0
        first_order = index in (0, len(timesteps) - 1)
        slope = 0.0 if first_order else (0.5 * reach * distance[index] / distance[index - 1]).item()
        steps.append(
            SamplerStep(
                timestep,
                *_clean(prediction_type, signal[index], noise[index]),
                x0_out=reach.item() + slope,
                x_out=(noise[index + 1] / noise[index]).item(),
                last_out=-slope,
            )
        )
    return steps
