"""Exponential moving average of a network's weights, as a submodule of the policy so that checkpoints include it."""

import copy

import torch
from torch import Tensor, nn


class ExponentialMovingAverage(nn.Module):
    """A copy of a network whose weights are an exponential moving average.

    The decay grows as `1 - (1 + n / inv_gamma) ** -power` up to `max_decay`; n counts the updates from the third on,
    the first two copy the weights. This is the schedule of Chi et al. (2023).

    Attributes:
        model: the copy, without gradients and always in evaluation mode.
        updates: number of updates so far; saved, so that a resumed run continues with the right decay.
    """

    updates: Tensor

    def __init__(self, model: nn.Module, power: float, inv_gamma: float, max_decay: float):
        super().__init__()
        self.model = copy.deepcopy(model).requires_grad_(False).eval()
        self.power, self.inv_gamma, self.max_decay = power, inv_gamma, max_decay
        self.register_buffer("updates", torch.zeros((), dtype=torch.long))
        self._count: int | None = (
            0  # copy of `updates` on the host, so that an update need not synchronise with the device
        )

    @property
    def decay(self) -> float:
        """Weight of the old average at the next update."""
        if self._count is None:
            self._count = int(self.updates)
        n = max(0, self._count - 1)
        return min(1 - (1 + n / self.inv_gamma) ** -self.power, self.max_decay)

    @torch.no_grad()
    def update(self, model: nn.Module) -> None:
        """Updates the average with the weights of `model`."""
        weight = 1 - self.decay
        averaged, current = tuple(self.model.parameters()), tuple(model.parameters())
        torch._foreach_lerp_(averaged, current, weight)  # pyright: ignore[reportPrivateImportUsage]
        self._count = (self._count or 0) + 1
        self.updates.fill_(self._count)

    def train(self, mode: bool = True) -> "ExponentialMovingAverage":
        """Stays in evaluation mode: the copy is used in inference only."""
        return super().train(False)

    def _load_from_state_dict(self, *args, **kwargs):
        super()._load_from_state_dict(*args, **kwargs)
        self._count = None
