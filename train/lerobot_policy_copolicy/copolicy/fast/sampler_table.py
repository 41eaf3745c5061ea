"""A sampler as a table of numbers: what a scheduler works out anew at every step of every plan, worked out once."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from copolicy.dataset.exceptions import UnknownNameError


class SamplerStep(NamedTuple):
    """One step of a sampler, from noisy actions x and the network's prediction f to less noisy ones.

        x0   = clip((x_in x - f_in f) / divisor), or clip(f) where the network predicts the plan itself (x_in = 0)
        next = x0_out x0 + x_out x + f_out f + last_out x0 of the step before + noise_out noise

    DDPM, DDIM and DPM-Solver++ are all of this form. `draws` tells whether noise is drawn, which a DDPM step also
    does where its share is nil, and which later plans from the same generator depend on.
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


class SamplerTable:
    """The steps of a sampler, equal to those of diffusers' schedulers with clipped samples.

    The coefficients are computed in single precision in the schedulers' order of operations: near the clean end they
    are differences of numbers close to one, and a more exact result would be another one.

    Attributes:
        steps: from noise to plan.
    """

    def __init__(
        self,
        sampler: str,
        prediction_type: str,
        kept: Tensor,
        timesteps: Sequence[int],
        clip_range: float,
        initial_noise_scale: float = 1.0,
    ):
        """
        Args:
            sampler: "ddpm" (Ho et al., 2020, with the posterior's variance), "ddim" (Song et al., 2021, without
                noise) or "dpmsolver++" (Lu et al., 2022, second order in two steps, the last one of first order).
            prediction_type: "epsilon", "sample" or "v_prediction".
            kept: `(num_train_timesteps,)` share of the variance that is signal (alpha bar).
            timesteps: falling.
            clip_range: x0 is clipped to plus and minus this.
            initial_noise_scale: standard deviation of the noise that sampling begins with.

        Raises:
            UnknownNameError: no such sampler or prediction type.
        """
        make = {"ddpm": _ddpm, "ddim": _ddim, "dpmsolver++": _dpm_solver}
        if sampler not in make:
            raise UnknownNameError("sampler", sampler, make)
        self.steps = make[sampler](prediction_type, kept.float().cpu(), list(timesteps))
        self._clip_range, self._initial_noise_scale = clip_range, initial_noise_scale

    def sample(
        self,
        denoise: Callable[[int, Tensor], Tensor],
        noise: Tensor,
        tokens: int,
        generator: torch.Generator | None = None,
    ) -> Tensor:
        """The first tokens of a plan, from noise.

        Args:
            denoise: the network for a given history, from the index of a step and `(B, tokens, n)`.
            noise: `(B, T, n)`, standard normal; scaled here.
            tokens: how many of the T are sampled. Noise is drawn for all of them, so that a seed means the same
                plan however much of it is wanted.
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
    """Evenly spaced steps, the last training step first ("trailing" in diffusers).

    With fewer steps than in training, "leading" spacing (diffusers' default) would feed pure noise to the network as
    if it were half denoised. diffusers' own trailing list ends with a step -1 for some numbers of steps (29, 31, 58,
    62 and 97 of 100), by the rounding of its range; here it does not.
    """
    falling = np.arange(num_train_timesteps, 0, -num_train_timesteps / num_inference_steps)[:num_inference_steps]
    return (np.round(falling).astype(int) - 1).tolist()


def _draw(like: Tensor, generator: torch.Generator | None) -> Tensor:
    """Standard normal noise as diffusers draws it: on the generator's device."""
    device = like.device if generator is None else generator.device
    return torch.randn(like.shape, generator=generator, device=device, dtype=like.dtype).to(like.device)


def _clean(prediction_type: str, signal: Tensor, noise: Tensor) -> tuple[float, float, float]:
    """`x_in, f_in, divisor` for a noisy sample that is `signal` times the plan and `noise` times noise."""
    choices = {
        "epsilon": (1.0, noise.item(), signal.item()),
        "sample": (0.0, -1.0, 1.0),
        "v_prediction": (signal.item(), noise.item(), 1.0),
    }
    if prediction_type not in choices:
        raise UnknownNameError("prediction_type", prediction_type, choices)
    return choices[prediction_type]


def _ddpm(prediction_type: str, kept: Tensor, timesteps: list[int]) -> list[SamplerStep]:
    steps = []
    for now, then in zip(timesteps, [*timesteps[1:], None], strict=True):
        before = kept[now]
        after = torch.tensor(1.0) if then is None else kept[then]
        ratio = before / after
        variance = ((1 - after) / (1 - before) * (1 - ratio)).clamp(min=1e-20)
        steps.append(
            SamplerStep(
                now,
                *_clean(prediction_type, before**0.5, (1 - before) ** 0.5),
                x0_out=(after**0.5 * (1 - ratio) / (1 - before)).item(),
                x_out=(ratio**0.5 * (1 - after) / (1 - before)).item(),
                noise_out=(variance**0.5).item(),
                draws=now > 0,
            )
        )
    return steps


def _ddim(prediction_type: str, kept: Tensor, timesteps: list[int]) -> list[SamplerStep]:
    # As in diffusers, a step leads down by a whole number of training steps, also where the next step of the list is
    # one further: take a number of steps that divides the number of training steps where that matters.
    stride = len(kept) // len(timesteps)
    steps = []
    for now in timesteps:
        before = kept[now]
        after = kept[now - stride] if now >= stride else kept[0] * 0 + 1
        signal, noise, left = before**0.5, (1 - before) ** 0.5, (1 - after) ** 0.5
        # The direction of the noise is that of the prediction before it is clipped.
        x_out, f_out = {
            "epsilon": (torch.tensor(0.0), left),
            "sample": (left / noise, -left * signal / noise),
            "v_prediction": (left * noise, left * signal),
        }.get(prediction_type, (left, left))
        clean = _clean(prediction_type, signal, noise)
        steps.append(SamplerStep(now, *clean, x0_out=(after**0.5).item(), x_out=x_out.item(), f_out=f_out.item()))
    return steps


def _dpm_solver(prediction_type: str, kept: Tensor, timesteps: list[int]) -> list[SamplerStep]:
    ratios = torch.cat(((((1 - kept) / kept) ** 0.5)[timesteps], torch.zeros(1)))  # noise to signal
    signal = 1 / (ratios**2 + 1) ** 0.5
    noise = ratios * signal
    distance = (signal.log() - noise.log()).diff()  # of each step, in log signal to noise; infinite for the last
    steps = []
    for index, now in enumerate(timesteps):
        reach = -signal[index + 1] * (torch.exp(-distance[index]) - 1)  # of x0
        first_order = index in (0, len(timesteps) - 1)
        slope = 0.0 if first_order else (0.5 * reach * distance[index] / distance[index - 1]).item()
        steps.append(
            SamplerStep(
                now,
                *_clean(prediction_type, signal[index], noise[index]),
                x0_out=reach.item() + slope,
                x_out=(noise[index + 1] / noise[index]).item(),
                last_out=-slope,
            )
        )
    return steps
