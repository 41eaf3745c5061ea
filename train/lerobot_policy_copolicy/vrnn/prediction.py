"""Runs the network over rows of motion: on observed rows with the encoder, and beyond them with the prior."""

from typing import NamedTuple

import torch
from torch import Tensor

from .motion_rows import MOTION, MotionRows
from .network import MotionNetwork, Normals
from .recurrence import ObservedRecurrence, PredictedRecurrence


class Encoded(NamedTuple):
    """Results on T observed rows.

    Attributes:
        latents: `(B, T, width)` embedded latent variables; with the top states they give the predictions of the rows.
        tops: `(B, T, width)` top state before each row, which gives the prior.
        posterior: distributions of the latent variables.
        state: `(layers, B, width)` recurrent state after the last row.
    """

    latents: Tensor
    tops: Tensor
    posterior: Normals
    state: Tensor


def encode(network: MotionNetwork, rows: Tensor) -> Encoded:
    """Runs over observed rows `(B, T, n)`, T >= 1; latent variables are drawn from the encoder."""
    embedded = network.embed_row(rows).transpose(0, 1).to(rows.dtype)  # (T, B, width)
    noise = torch.randn(*embedded.shape[:2], network.latent, dtype=embedded.dtype, device=rows.device)
    with torch.autocast(rows.device.type, enabled=False):
        results = ObservedRecurrence.apply(embedded, noise, *network.observed_weights)
    tops, means, log_variances, latents, state = results  # pyright: ignore[reportGeneralTypeIssues]
    posterior = Normals(means.transpose(0, 1), log_variances.transpose(0, 1))
    return Encoded(latents.transpose(0, 1), tops.transpose(0, 1), posterior, state)


class FreeRun(NamedTuple):
    """Results of T predicted rows: predictions `(B, T, p)`, and the poses that they integrate to, `(B, T, 4)`.

    The poses have no gradient.
    """

    predicted: Tensor
    poses: Tensor


def free_run(
    network: MotionNetwork,
    motion_rows: MotionRows,
    state: Tensor,
    pose: Tensor,
    scenarios: Tensor,
    steps: int,
    temperature: float = 1.0,
) -> FreeRun:
    """Predicts rows beyond the observed ones; latent variables are drawn from the prior.

    If the network predicts the displacement alone, the surroundings are those of the integrated pose, else the
    predicted row is the next input as it is.

    Args:
        state: `(layers, B, width)` recurrent state after the last observed row.
        pose: `(B, 4)` last observed pose.
        scenarios: `(B, k)` scenario vectors.
        steps: rows to predict, T >= 1.
        temperature: factor of the prior's standard deviations.
    """
    poses = [pose]

    def next_row(predicted: Tensor) -> Tensor:
        poses.append(motion_rows.moved(poses[-1], predicted[:, :MOTION]))
        if predicted.shape[1] > MOTION or len(poses) > steps:
            return predicted
        return torch.cat((predicted, motion_rows.surroundings(poses[-2], poses[-1], scenarios)), dim=-1)

    noise = temperature * torch.randn(steps, len(pose), network.latent, dtype=pose.dtype, device=pose.device)
    weights = network.predicted_weights
    if not torch.is_grad_enabled():  # so that a plan keeps nothing for a backward pass
        weights = [weight.detach() for weight in weights]
    with torch.autocast(pose.device.type, enabled=False):
        predicted = PredictedRecurrence.apply(next_row, state.to(pose.dtype), noise, *weights)
    assert isinstance(predicted, Tensor)
    return FreeRun(predicted.transpose(0, 1), torch.stack(poses[1:], dim=1))
