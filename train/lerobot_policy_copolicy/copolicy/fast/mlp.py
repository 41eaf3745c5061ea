"""The residual perceptron for planning: what no step of a plan changes, and what only its step changes, once."""

from collections.abc import Callable

import torch
from torch import Tensor, nn

from ..denoiser_mlp import MlpDenoiser


class FastMlp:
    """An `MlpDenoiser` that knows the diffusion steps it will be asked for.

    The first layer is linear in actions and history, so the part of the history is computed once a plan; the encoded
    steps are a table of biases. Every input of a perceptron reaches every output, so no token can be left out.

    Attributes:
        tokens: how many tokens it denoises: all of them.
        actions: `(width, T * action_size)`, columns of the first layer.
        blocks, norm, head: the rest of the network.
    """

    def __init__(self, denoiser: MlpDenoiser, timesteps: Tensor, tokens: int):
        self.tokens = denoiser.horizon
        size = denoiser.head.out_features
        self.actions, self._history = denoiser.inner.weight.split((size, denoiser.inner.in_features - size), dim=1)
        self._bias = denoiser.inner.bias
        self.blocks, self.norm, self.head = denoiser.blocks, denoiser.norm, denoiser.head
        biases = torch.stack([block.inner.bias for block in denoiser.blocks])  # pyright: ignore
        self._steps = denoiser.step_encoder(timesteps)[:, None] + biases  # (steps, n_layers, width)

    def begin(self, condition: Tensor) -> Callable[[int], tuple[Tensor, ...]]:
        """What `denoise` reads at each index of a plan with this history, `(B, To, condition_size)`."""
        history = nn.functional.linear(condition.flatten(1), self._history, self._bias)
        return lambda index: (history, self._steps[index])

    def denoise(self, noisy_actions: Tensor, inputs: tuple[Tensor, ...]) -> Tensor:
        """One evaluation.

        Args:
            noisy_actions: `(B, T, action_size)`.
            inputs: what the first layer makes of the history, `(B, width)`; and the bias of each block,
                `(n_layers, width)`.

        Returns:
            `(B, T, action_size)`, the prediction.
        """
        linear = nn.functional.linear
        history, biases = inputs
        hidden = linear(noisy_actions.flatten(1), self.actions) + history
        for block, bias in zip(self.blocks, biases, strict=True):
            inner = linear(block.norm(hidden), block.inner.weight, bias)  # pyright: ignore
            hidden = hidden + block.outer(nn.functional.silu(inner))  # pyright: ignore
        return self.head(self.norm(hidden)).view_as(noisy_actions)
