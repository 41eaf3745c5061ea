"""Observation encoders: from columns in physical units to network inputs relative to the table."""

import torch
from torch import Tensor, nn

from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE, scaling_of

from ..features import BOUNDS, ENVIRONMENT_NAMES
from ..map_config import MAX_OBSTACLES
from ..spec import SPEC
from .range_scan import RAYS, RangeScan

_GOAL = ENVIRONMENT_NAMES.index("goal_x")
_OBSTACLES = ENVIRONMENT_NAMES.index("obstacle_0_x")

# Each distance is encoded twice: over the whole window, and finely around the table. Scale in px, and bound at which
# the scaled distance is clipped.
_FAR = (300.0, 3.0)
_NEAR = (120.0, 1.5)


class RelativeFeatures(nn.Module):
    """Encodes the state, and the map relative to the table.

    The table's state scaled to [-1, 1] (7 values); the goal relative to the table at both scales (4); for each of the
    three obstacles the same and whether it exists (5 each, zeros where it does not); and the human's past action (2)
    where it is used. The start pose is left out. Axes are those of the window, as for the forces.
    """

    scale: Tensor
    offset: Tensor

    def __init__(self, past_human_action: bool):
        super().__init__()
        self.past_human_action = past_human_action
        self.size = BOUNDS[STATE].shape[1] + 4 + 5 * MAX_OBSTACLES + 2 * past_human_action
        for name, values in zip(("scale", "offset"), scaling_of(SPEC, (STATE,)), strict=True):
            self.register_buffer(name, torch.from_numpy(values), persistent=False)

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """Observation columns `(..., n)` in px, rad and s to `(..., size)`."""
        state, environment = observation[STATE], observation[ENVIRONMENT_STATE]
        position = state[..., None, :2]
        points = environment[..., _GOAL:].unflatten(-1, (1 + MAX_OBSTACLES, 2))  # (..., 4, 2), the goal first
        present = (points[..., 1:, :] != 0).any(dim=-1, keepdim=True).to(points.dtype)  # (..., 3, 1)
        distance = points - position
        copies = [(distance / scale).clamp(-limit, limit) for scale, limit in (_FAR, _NEAR)]
        encoded = torch.cat(copies, dim=-1)  # (..., 4, 4)
        obstacles = torch.cat((encoded[..., 1:, :] * present, present), dim=-1)  # (..., 3, 5)
        parts = [state * self.scale + self.offset, encoded[..., 0, :], obstacles.flatten(-2)]
        if self.past_human_action:
            parts.append(observation[HUMAN_ACTION])
        return torch.cat(parts, dim=-1)


class ScanFeatures(RelativeFeatures):
    """`RelativeFeatures`, and a range scan of obstacles and walls (`RangeScan`)."""

    def __init__(self, past_human_action: bool):
        super().__init__(past_human_action)
        self.size += RAYS
        self.scan = RangeScan()

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """Observation columns `(..., n)` in px, rad and s to `(..., size)`."""
        obstacles = observation[ENVIRONMENT_STATE][..., _OBSTACLES:].unflatten(-1, (MAX_OBSTACLES, 2))
        return torch.cat((super().forward(observation), self.scan(observation[STATE][..., :2], obstacles)), dim=-1)
