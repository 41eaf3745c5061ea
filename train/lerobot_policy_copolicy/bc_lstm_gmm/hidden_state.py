"""Input features that do not depend on chosen elements of the state."""

from collections.abc import Collection
from typing import Any

import torch
from torch import Tensor, nn

from copolicy.dataset.features import STATE
from copolicy.dataset.task_spec import TaskSpec


class HiddenState(nn.Module):
    """Features of an observation whose hidden elements of the state are 0.

    Attributes:
        size: number of features.
    """

    shown: Tensor

    def __init__(self, features: Any, spec: TaskSpec, hidden: Collection[str]):
        super().__init__()
        self._features = features
        self.size: int = features.size
        shown = torch.tensor([float(name not in hidden) for name in spec.state.names])
        self.register_buffer("shown", shown, persistent=False)

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """Encodes observation columns `(..., n)` in the units of the task to `(..., size)`."""
        return self._features({**observation, STATE: observation[STATE] * self.shown})
