"""A temporal convolutional U-Net that denoises an action chunk: the CNN of Diffusion Policy (Chi et al., 2023)."""

from itertools import pairwise

import torch
from torch import Tensor, nn

from .step_embedding import SinusoidalEmbedding

_GROUPS = 8  # of the group normalisation


class UnetDenoiser(nn.Module):
    """Denoises an action chunk with 1-D convolutions over time, conditioned by FiLM on the step and the history.

    The layers are those of `ConditionalUnet1D` of Diffusion Policy, with scale and bias in FiLM: 65,987,588 parameters
    for actions of 4 values, 3 frames of 18 values and widths of 256, 512 and 1024.

    Args:
        action_size: values of an action.
        condition_size: values of an observation; 0 where the observations are part of the sequence (inpainting).
        horizon: actions of a chunk, T; a multiple of `2 ** (len(down_widths) - 1)`.
        n_obs_steps: frames of the history, To.
        down_widths: channels of each level, each level half as long as the one before.
        step_width: size of the embedding of the diffusion step.
        kernel_size: of the convolutions, odd.
    """

    def __init__(
        self,
        action_size: int,
        condition_size: int,
        horizon: int,
        n_obs_steps: int,
        down_widths: tuple[int, ...] = (256, 512, 1024),
        step_width: int = 256,
        kernel_size: int = 5,
    ):
        super().__init__()
        self.step_encoder = nn.Sequential(
            SinusoidalEmbedding(step_width),
            nn.Linear(step_width, 4 * step_width),
            nn.Mish(),
            nn.Linear(4 * step_width, step_width),
        )
        condition = step_width + n_obs_steps * condition_size
        widths = (action_size, *down_widths)

        def block(channels_in: int, channels_out: int) -> _ResidualBlock:
            return _ResidualBlock(channels_in, channels_out, condition, kernel_size)

        self.down = nn.ModuleList(_Pair(block(narrow, wide), block(wide, wide)) for narrow, wide in pairwise(widths))
        self.downsample = nn.ModuleList(nn.Conv1d(wide, wide, 3, stride=2, padding=1) for wide in down_widths[:-1])
        self.middle = _Pair(block(down_widths[-1], down_widths[-1]), block(down_widths[-1], down_widths[-1]))
        pairs = list(pairwise(down_widths))[::-1]
        self.up = nn.ModuleList(_Pair(block(2 * wide, narrow), block(narrow, narrow)) for narrow, wide in pairs)
        self.upsample = nn.ModuleList(nn.ConvTranspose1d(narrow, narrow, 4, stride=2, padding=1) for narrow, _ in pairs)
        self.head = nn.Sequential(
            _convolution(down_widths[0], down_widths[0], kernel_size), nn.Conv1d(down_widths[0], action_size, 1)
        )

    def forward(self, noisy_actions: Tensor, steps: Tensor, condition: Tensor) -> Tensor:
        """One evaluation.

        Args:
            noisy_actions: `(B, T, action_size)`.
            steps: `(B,)` diffusion steps.
            condition: `(B, To, condition_size)`.

        Returns:
            `(B, T, action_size)`, the prediction.
        """
        film = torch.cat((self.step_encoder(steps), condition.flatten(1)), dim=1)  # (B, step_width + To * size)
        hidden, skipped = noisy_actions.transpose(1, 2), []  # (B, channels, T)
        for level, blocks in enumerate(self.down):
            hidden = blocks(hidden, film)
            skipped.append(hidden)
            if level < len(self.downsample):
                hidden = self.downsample[level](hidden)
        hidden = self.middle(hidden, film)
        for blocks, upsample in zip(self.up, self.upsample, strict=True):
            hidden = upsample(blocks(torch.cat((hidden, skipped.pop()), dim=1), film))
        return self.head(hidden).transpose(1, 2)


def _convolution(channels_in: int, channels_out: int, kernel_size: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv1d(channels_in, channels_out, kernel_size, padding=kernel_size // 2),
        nn.GroupNorm(_GROUPS, channels_out),
        nn.Mish(),
    )


class _ResidualBlock(nn.Module):
    """Two convolutions; between them every channel is scaled and shifted by the condition (FiLM)."""

    def __init__(self, channels_in: int, channels_out: int, condition_size: int, kernel_size: int):
        super().__init__()
        self.first = _convolution(channels_in, channels_out, kernel_size)
        self.second = _convolution(channels_out, channels_out, kernel_size)
        self.film = nn.Sequential(nn.Mish(), nn.Linear(condition_size, 2 * channels_out))
        self.residual = nn.Conv1d(channels_in, channels_out, 1) if channels_in != channels_out else nn.Identity()

    def forward(self, hidden: Tensor, condition: Tensor) -> Tensor:
        """`(B, channels_in, T)` and `(B, condition_size)` to `(B, channels_out, T)`."""
        scale, bias = self.film(condition)[..., None].chunk(2, dim=1)  # (B, channels_out, 1) each
        return self.second(scale * self.first(hidden) + bias) + self.residual(hidden)


class _Pair(nn.Module):
    """Two residual blocks under the same condition."""

    def __init__(self, first: _ResidualBlock, second: _ResidualBlock):
        super().__init__()
        self.first, self.second = first, second

    def forward(self, hidden: Tensor, condition: Tensor) -> Tensor:
        return self.second(self.first(hidden, condition), condition)
