"""The residual perceptron for fast sampling: parts that do not depend on the noisy actions are precomputed."""

from collections.abc import Callable

import torch
from torch import Tensor, nn

from ..denoiser_mlp import MlpDenoiser


class FastMlp:
    """An `MlpDenoiser` for known diffusion steps.

    The first layer is linear in actions and history, so the history's part is computed once per sampling. The encoded
    steps are precomputed as biases. Every input reaches every output, so all tokens are denoised.

    Attributes:
        tokens: number of denoised tokens, always T.
        actions: `(width, T * action_size)` weights of the first layer for the actions.
        blocks, norm, head: the other layers of the network.
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
        """Returns a function of the step's index that gives the `inputs` of `denoise` for `(B, To, condition_size)`."""
        history = nn.functional.linear(condition.flatten(1), self._history, self._bias)
        return lambda index: (history, self._steps[index])

    def denoise(self, noisy_actions: Tensor, inputs: tuple[Tensor, ...]) -> Tensor:
        """Evaluates the network.

        Args:
            noisy_actions: `(B, T, action_size)`.
            inputs: the first layer's output for the history, `(B, width)`, and the bias of each block,
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
