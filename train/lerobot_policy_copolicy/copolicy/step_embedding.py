"""Sinusoidal embedding of the diffusion step."""

import math

import torch
from torch import Tensor, nn


class SinusoidalEmbedding(nn.Module):
    """Sines and cosines of the step at `size / 2` frequencies from 1 to 1/10000 (Vaswani et al., 2017)."""

    frequencies: Tensor

    def __init__(self, size: int):
        super().__init__()
        half = size // 2
        self.register_buffer(
            "frequencies", torch.exp(torch.arange(half) * (-math.log(10000) / (half - 1))), persistent=False
        )

    def forward(self, steps: Tensor) -> Tensor:
        """Embeds steps `(B,)` as `(B, size)`."""
        angles = steps[:, None].float() * self.frequencies
        return torch.cat((angles.sin(), angles.cos()), dim=-1)
