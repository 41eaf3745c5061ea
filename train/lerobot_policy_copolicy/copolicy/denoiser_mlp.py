"""A residual multilayer perceptron that denoises a whole action sequence at once: the network for a CPU."""

import torch
from torch import Tensor, nn

from .step_embedding import SinusoidalEmbedding

_STEP_SIZE = 64


class MlpDenoiser(nn.Module):
    """Denoises an action sequence; all actions and the whole history are one input vector.

    Each block adds `outer(silu(inner(norm(x)) + step))`. The last layer of a block and the head are initialised to
    zero, so that the untrained network predicts zero.

    Args:
        action_size: values of an action.
        condition_size: values of an observation.
        horizon: length of the action sequence, T.
        n_obs_steps: frames of the history, To.
        n_layers: residual blocks.
        width: size of the hidden layers.
    """

    def __init__(
        self,
        action_size: int,
        condition_size: int,
        horizon: int,
        n_obs_steps: int,
        n_layers: int = 3,
        width: int = 384,
    ):
        super().__init__()
        self.horizon = horizon
        self.step_encoder = nn.Sequential(
            SinusoidalEmbedding(_STEP_SIZE), nn.Linear(_STEP_SIZE, width), nn.SiLU(), nn.Linear(width, width)
        )
        self.inner = nn.Linear(horizon * action_size + n_obs_steps * condition_size, width)
        self.blocks = nn.ModuleList(_ResidualBlock(width) for _ in range(n_layers))
        self.norm = nn.LayerNorm(width)
        self.head = nn.Linear(width, horizon * action_size)
        nn.init.zeros_(self.head.weight)
        nn.init.zeros_(self.head.bias)

    @property
    def layers(self) -> nn.ModuleList:
        """The residual blocks, by the same name as the transformer's layers."""
        return self.blocks

    def forward(self, noisy_actions: Tensor, steps: Tensor, condition: Tensor) -> Tensor:
        """Predicts the noise, the actions or the velocity, depending on the training target.

        Args:
            noisy_actions: `(B, T, action_size)`.
            steps: `(B,)` diffusion steps.
            condition: `(B, To, condition_size)`.

        Returns:
            `(B, T, action_size)`, the prediction.
        """
        step = self.step_encoder(steps)  # (B, width)
        hidden = self.inner(torch.cat((noisy_actions.flatten(1), condition.flatten(1)), dim=1))  # (B, width)
        for block in self.blocks:
            hidden = block(hidden, step)
        return self.head(self.norm(hidden)).view_as(noisy_actions)


class _ResidualBlock(nn.Module):
    def __init__(self, width: int):
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.inner = nn.Linear(width, width)
        self.outer = nn.Linear(width, width)
        nn.init.zeros_(self.outer.weight)
        nn.init.zeros_(self.outer.bias)

    def forward(self, hidden: Tensor, step: Tensor) -> Tensor:
        return hidden + self.outer(nn.functional.silu(self.inner(self.norm(hidden)) + step))
