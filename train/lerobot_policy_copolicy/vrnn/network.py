"""The variational recurrent network of the motion of the table (Chung et al., 2015), as in the planner of Ng et al."""

from typing import NamedTuple

import torch
from torch import Tensor, nn

LATENT, WIDTH, LAYERS = 6, 64, 2


class Normals(NamedTuple):
    """Diagonal normal distributions: means and logarithms of the variances, `(B, LATENT)` each."""

    mean: Tensor
    log_variance: Tensor

    def sample(self, noise: Tensor) -> Tensor:
        """Draws `(B, LATENT)` from standard normal noise of that shape."""
        return self.mean + noise * torch.exp(0.5 * self.log_variance)

    def divergence(self, other: "Normals") -> Tensor:
        """Kullback-Leibler divergence from `other`, `(B,)` nats."""
        ratio = torch.exp(self.log_variance - other.log_variance)
        distance = (self.mean - other.mean).square() * torch.exp(-other.log_variance)
        return 0.5 * (other.log_variance - self.log_variance + ratio + distance - 1).sum(dim=-1)


class MotionNetwork(nn.Module):
    """Predicts the next row of motion from the rows before it and a latent variable.

    A row holds the table's displacement over one frame and its surroundings; `n` is its size. 98,464 parameters for
    rows of 8 values, 98,980 for 12.

    Args:
        size: values of a row, n.
    """

    def __init__(self, size: int):
        super().__init__()
        self.size = size
        self.embed_row = nn.Sequential(nn.Linear(size, WIDTH), nn.ReLU(), nn.Linear(WIDTH, WIDTH), nn.ReLU())
        self.embed_latent = nn.Sequential(nn.Linear(LATENT, WIDTH), nn.ReLU())
        self.encoder = nn.Sequential(nn.Linear(2 * WIDTH, WIDTH), nn.ReLU(), nn.Linear(WIDTH, WIDTH), nn.ReLU())
        self.encoder_head = nn.ModuleList((nn.Linear(WIDTH, LATENT), nn.Linear(WIDTH, LATENT)))
        self.prior = nn.Sequential(nn.Linear(WIDTH, WIDTH), nn.ReLU(), nn.Linear(WIDTH, WIDTH), nn.ReLU())
        self.prior_head = nn.ModuleList((nn.Linear(WIDTH, LATENT), nn.Linear(WIDTH, LATENT)))
        self.decoder = nn.Sequential(nn.Linear(2 * WIDTH, WIDTH), nn.ReLU(), nn.Linear(WIDTH, size))
        self.gru = nn.GRU(2 * WIDTH, WIDTH, LAYERS)

    def zero_state(self, batch: int, device: torch.device | str = "cpu") -> Tensor:
        """`(LAYERS, batch, WIDTH)` the state at the start."""
        return torch.zeros(LAYERS, batch, WIDTH, device=device)
