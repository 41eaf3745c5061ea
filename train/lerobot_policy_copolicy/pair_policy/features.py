"""Generic input features and actions of the network: columns scaled by the fixed bounds of the task.

The bounds are the task's and not a data set's, so the scaling of a checkpoint is the same in training, fine-tuning and
inference.
"""

import torch
from torch import Tensor, nn

from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE, bounds_of, scaling_of
from copolicy.dataset.task_spec import TaskSpec


class RawFeatures(nn.Module):
    """State, scenario and, if used, the human's past action in the units of the task, unscaled."""

    def __init__(self, spec: TaskSpec, past_human_action: bool):
        super().__init__()
        self.keys = (STATE, ENVIRONMENT_STATE, HUMAN_ACTION) if past_human_action else (STATE, ENVIRONMENT_STATE)
        self.size = sum(bounds_of(spec)[key].shape[1] for key in self.keys)

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """Joins observation columns `(..., n)` in the units of the task to `(..., size)`."""
        return torch.cat([observation[key] for key in self.keys], dim=-1)


class AbsoluteFeatures(RawFeatures):
    """The paper's input: the raw features scaled to [-1, 1]."""

    scale: Tensor
    offset: Tensor

    def __init__(self, spec: TaskSpec, past_human_action: bool):
        super().__init__(spec, past_human_action)
        for name, values in zip(("scale", "offset"), scaling_of(spec, self.keys), strict=True):
            self.register_buffer(name, torch.from_numpy(values), persistent=False)

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """Joins and scales observation columns `(..., n)` in the units of the task to `(..., size)`."""
        return super().forward(observation) * self.scale + self.offset


class ActionScale(nn.Module):
    """Scales both players' actions to [-1, 1] and back; the identity if these are the task's bounds."""

    scale: Tensor
    offset: Tensor

    def __init__(self, spec: TaskSpec):
        super().__init__()
        scale, offset = scaling_of(spec, (ACTION,))
        self._scaled = bool((scale != 1).any() or offset.any())
        self.register_buffer("scale", torch.from_numpy(scale), persistent=False)
        self.register_buffer("offset", torch.from_numpy(offset), persistent=False)

    def scaled(self, actions: Tensor) -> Tensor:
        """Scales actions `(..., m)` in the units of the task to [-1, 1]."""
        return actions * self.scale + self.offset if self._scaled else actions

    def physical(self, scaled: Tensor) -> Tensor:
        """The inverse of `scaled`."""
        return (scaled - self.offset) / self.scale if self._scaled else scaled
