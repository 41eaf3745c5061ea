"""The networks of Co-GAIL: policy, value, inverse model and discriminator."""

import math

import torch
from torch import Tensor, nn

CODE_SIZE = 2
"""Values of a code."""


def tanh_network(input_size: int, width: int, output_size: int, gain: float) -> nn.Sequential:
    """Two hidden layers with tanh; weights are orthogonal with gain sqrt(2), those of the output with `gain`."""
    layers = (nn.Linear(input_size, width), nn.Linear(width, width), nn.Linear(width, output_size))
    for layer, layer_gain in zip(layers, (math.sqrt(2), math.sqrt(2), gain), strict=True):
        nn.init.orthogonal_(layer.weight, layer_gain)
        nn.init.zeros_(layer.bias)
    return nn.Sequential(layers[0], nn.Tanh(), layers[1], nn.Tanh(), layers[2])


class CoGailNetwork(nn.Module):
    """Actor, critic and inverse model (`base_net_small` of the original program).

    31,627 parameters for 116 inputs and actions of 4 values. Actions are scaled to [-1, 1]; the mean is not bounded.

    Args:
        input_size: values of an encoded observation.
        action_size: values of a joint action, 2 m; the partner's are the second half.
        width: hidden size.
        deviation: initial standard deviation of each action.
    """

    def __init__(self, input_size: int, action_size: int, width: int = 64, deviation: float = 1.0):
        super().__init__()
        self.partner = slice(action_size // 2, action_size)
        self.actor = tanh_network(input_size + CODE_SIZE, width, action_size, gain=1.0)
        self.log_deviation = nn.Parameter(torch.full((action_size,), math.log(deviation)))
        self.critic = tanh_network(input_size + CODE_SIZE, width, 1, gain=math.sqrt(2))
        self.inverse = nn.Sequential(
            nn.Linear(input_size + action_size // 2, width), nn.ReLU(), nn.Linear(width, CODE_SIZE), nn.Tanh()
        )

    def mean(self, inputs: Tensor, codes: Tensor) -> Tensor:
        """Mean joint actions `(B, 2 m)` for inputs `(B, size)` and codes `(B, 2)`."""
        return self.actor(torch.cat((inputs, codes), dim=-1))

    def value(self, inputs: Tensor, codes: Tensor) -> Tensor:
        """`(B,)` discounted returns that are expected."""
        return self.critic(torch.cat((inputs, codes), dim=-1))[..., 0]

    def infer_code(self, inputs: Tensor, partner_actions: Tensor) -> Tensor:
        """The code `(B, 2)` in [-1, 1] that explains the partner's action `(B, m)`."""
        return self.inverse(torch.cat((inputs, partner_actions), dim=-1))


class Discriminator(nn.Module):
    """Tells demonstrated frames from the policy's: the logit of the probability that a frame is demonstrated.

    11,969 parameters for 116 inputs and actions of 4 values.
    """

    def __init__(self, input_size: int, action_size: int, width: int = 64):
        super().__init__()
        self.network = nn.Sequential(
            nn.Linear(input_size + action_size, width),
            nn.Tanh(),
            nn.Linear(width, width),
            nn.Tanh(),
            nn.Linear(width, 1),
        )

    def forward(self, frames: Tensor) -> Tensor:
        """Logits `(B,)` of frames `(B, size + 2 m)`: an encoded observation and a joint action."""
        return self.network(frames)[:, 0]
