"""The variational recurrent network of body motion (Chung et al., 2015, arXiv 1506.02216)."""

from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor, nn

LOG_VARIANCE = 10.0
"""Bound of the logarithm of a variance, so that its exponential is finite."""


class Normals(NamedTuple):
    """Diagonal normal distributions: means and logarithms of the variances, `(..., latent)` each."""

    mean: Tensor
    log_variance: Tensor

    def sample(self, noise: Tensor) -> Tensor:
        """Draws `(..., latent)` from standard normal noise of that shape."""
        return self.mean + noise * torch.exp(0.5 * self.log_variance)

    def divergence(self, other: "Normals") -> Tensor:
        """Kullback-Leibler divergence from `other`, `(...)` nats."""
        ratio = torch.exp(self.log_variance - other.log_variance)
        distance = (self.mean - other.mean).square() * torch.exp(-other.log_variance)
        return 0.5 * (other.log_variance - self.log_variance + ratio + distance - 1).sum(dim=-1)


class MotionNetwork(nn.Module):
    """Predicts the next row of motion from the rows before it, in a recurrent state, and a latent variable.

    98,980 parameters for rows of 12 values that are predicted whole, 98,464 for 8, with the published sizes. As there,
    weights are initialised by Xavier's rule, except those of the prior and the recurrent cells.

    Args:
        row_size: values of a row, n.
        predicted_size: values of a row that are predicted, p, the first ones.
        latent: values of the latent variable.
        width: of all layers and of the recurrent state.
        n_layers: recurrent cells (GRU) on top of each other.
    """

    def __init__(self, row_size: int, predicted_size: int, latent: int = 6, width: int = 64, n_layers: int = 2):
        super().__init__()
        self.latent, self.width, self.n_layers = latent, width, n_layers
        self.embed_row = _layers(row_size, width, width)
        self.embed_latent = _layers(latent, width)
        self.encoder = nn.Sequential(_layers(2 * width, width, width), nn.Linear(width, 2 * latent))
        self.decoder = nn.Sequential(_layers(2 * width, width), nn.Linear(width, predicted_size))
        for module in self.modules():
            if isinstance(module, nn.Linear):
                nn.init.xavier_uniform_(module.weight)
        self.prior_layers = nn.Sequential(_layers(width, width, width), nn.Linear(width, 2 * latent))
        self.cells = nn.ModuleList(nn.GRUCell(width if layer else 2 * width, width) for layer in range(n_layers))

    @property
    def observed_weights(self) -> list[Tensor]:
        """Weights of encoder, embedding of the latent variable, and cells, for `ObservedRecurrence`."""
        return [*self.encoder.parameters(), *self.embed_latent.parameters(), *self._cell_weights]

    @property
    def predicted_weights(self) -> list[Tensor]:
        """Weights of prior, embedding of the latent variable, decoder, embedding of a row, and cells.

        For `PredictedRecurrence`.
        """
        layers = (self.prior_layers, self.embed_latent, self.decoder, self.embed_row)
        return [*(weight for layer in layers for weight in layer.parameters()), *self._cell_weights]

    @property
    def _cell_weights(self) -> list[Tensor]:
        names = ("weight_ih", "bias_ih", "weight_hh", "bias_hh")
        return [getattr(cell, name) for cell in self.cells for name in names]

    def prior(self, top: Tensor) -> Normals:
        """Distribution of the latent variable given the top state `(..., width)` before its row."""
        return _normals(self.prior_layers(top))

    def decode(self, latent: Tensor, top: Tensor) -> Tensor:
        """The predicted values `(..., p)` of a row from its embedded latent variable and the top state before it."""
        return self.decoder(torch.cat((latent, top), dim=-1))


def _layers(*sizes: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for size, after in pairwise(sizes):
        layers += [nn.Linear(size, after), nn.ReLU()]
    return nn.Sequential(*layers)


def _normals(values: Tensor) -> Normals:
    mean, log_variance = values.chunk(2, dim=-1)
    return Normals(mean, log_variance.clamp(-LOG_VARIANCE, LOG_VARIANCE))
