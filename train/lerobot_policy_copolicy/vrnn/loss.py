"""The training loss of the motion network: prediction error and Kullback-Leibler divergence."""

import torch
from torch import Tensor

from .network import Normals


def kl_weight(step: int, steps: int | None, cycles: int, ramp: float) -> float:
    """Weight of the divergence in a training step: in each cycle it rises from 0 to 1, then stays 1.

    Args:
        step: finished training steps.
        steps: of the whole training; the weight is 1 if unknown.
        cycles: of equal length in the training.
        ramp: fraction of a cycle in which the weight rises.

    Source: Fu et al. (2019), "Cyclical Annealing Schedule".
    """
    if not steps or not ramp or step >= steps:
        return 1.0
    return min(1.0, step * cycles / steps % 1 / ramp)


def published_loss(error: Tensor, posterior: Normals, prior: Normals, weight: float) -> Tensor:
    """The published balance `(B,)`, whose mean over the batch is the published loss.

    The squared error is averaged over columns and samples and summed over frames, while the divergence is summed over
    samples too, so that its weight grows with the batch.

    Args:
        error: `(B, T, p)` errors, zero for frames that do not count.
    """
    divergence = posterior.divergence(prior).sum(dim=1)  # (B,)
    return error.square().mean(dim=-1).sum(dim=-1) + weight * len(error) * divergence


def balanced_loss(
    error: Tensor, counts: Tensor, posterior: Normals, prior: Normals, weight: float, deviation: float
) -> Tensor:
    """The negative evidence lower bound per frame, `(B,)` nats without its constant.

    Args:
        error: `(B, T, p)` errors of the prediction, the mean of a normal distribution.
        counts: `(B, T)` whether a frame counts.
        deviation: standard deviation of that distribution.
    """
    likelihood = 0.5 * (error / deviation).square().sum(dim=-1)  # (B, T)
    divergence = posterior.divergence(prior)  # (B, encoded frames)
    encoded = counts[:, : divergence.shape[1]]
    total = torch.where(counts, likelihood, 0).sum(dim=1) + weight * torch.where(encoded, divergence, 0).sum(dim=1)
    return total / counts.sum(dim=1).clamp(min=1)
