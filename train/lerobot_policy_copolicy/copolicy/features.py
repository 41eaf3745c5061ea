"""What the network sees of an observation: columns in physical units, scaled by the fixed bounds of the task.

The bounds belong to the task, not to a data set, so a checkpoint sees the same numbers wherever it is trained,
fine-tuned or run.
"""

import torch
from torch import Tensor, nn

from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.tasks.table.features import BOUNDS, ENVIRONMENT_NAMES
from copolicy.tasks.table.map_config import MAX_OBSTACLES

from .range_scan import RAYS, RangeScan

_GOAL = ENVIRONMENT_NAMES.index("goal_x")
_OBSTACLES = ENVIRONMENT_NAMES.index("obstacle_0_x")

# Two copies of each distance: a far one that reaches across the window, and a near one that resolves the last
# centimetres around the table. Scale in px, and where the scaled distance is clipped.
_FAR = (300.0, 3.0)
_NEAR = (120.0, 1.5)


class AbsoluteFeatures(nn.Module):
    """The paper's input: table state and map, scaled to [-1, 1].

    x, y, cos_theta, sin_theta, vx, vy, omega; start pose, goal, three obstacles (18 values); and the human's past
    action (2 more) where it is used.
    """

    scale: Tensor
    offset: Tensor

    def __init__(self, past_human_action: bool):
        super().__init__()
        self.keys = (STATE, ENVIRONMENT_STATE, HUMAN_ACTION) if past_human_action else (STATE, ENVIRONMENT_STATE)
        self.size = sum(BOUNDS[key].shape[1] for key in self.keys)
        _register_scale(self, self.keys)

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """Observation columns `(..., n)` in px, rad and s to `(..., size)`."""
        columns = torch.cat([observation[key] for key in self.keys], dim=-1)
        return columns * self.scale + self.offset


class RelativeFeatures(nn.Module):
    """The map as seen from the table.

    The table's state scaled to [-1, 1] (7 values); the goal relative to the table, far and near copy (4); for each of
    the three obstacles the same and whether it stands there at all (5 each, zeros where it does not); and the human's
    past action (2) where it is used. The start pose is left out. Axes stay those of the window, as the forces do.
    """

    scale: Tensor
    offset: Tensor

    def __init__(self, past_human_action: bool):
        super().__init__()
        self.past_human_action = past_human_action
        self.size = BOUNDS[STATE].shape[1] + 4 + 5 * MAX_OBSTACLES + 2 * past_human_action
        _register_scale(self, (STATE,))

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """Observation columns `(..., n)` in px, rad and s to `(..., size)`."""
        state, environment = observation[STATE], observation[ENVIRONMENT_STATE]
        position = state[..., None, :2]
        points = environment[..., _GOAL:].unflatten(-1, (1 + MAX_OBSTACLES, 2))  # (..., 4, 2), the goal first
        present = (points[..., 1:, :] != 0).any(dim=-1, keepdim=True).to(points.dtype)  # (..., 3, 1)
        distance = points - position
        copies = [(distance / scale).clamp(-limit, limit) for scale, limit in (_FAR, _NEAR)]
        seen = torch.cat(copies, dim=-1)  # (..., 4, 4)
        obstacles = torch.cat((seen[..., 1:, :] * present, present), dim=-1)  # (..., 3, 5)
        parts = [state * self.scale + self.offset, seen[..., 0, :], obstacles.flatten(-2)]
        if self.past_human_action:
            parts.append(observation[HUMAN_ACTION])
        return torch.cat(parts, dim=-1)


class ScanFeatures(RelativeFeatures):
    """The map as seen from the table (`RelativeFeatures`), and a range scan of obstacles and walls (`RangeScan`)."""

    def __init__(self, past_human_action: bool):
        super().__init__(past_human_action)
        self.size += RAYS
        self.scan = RangeScan()

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """Observation columns `(..., n)` in px, rad and s to `(..., size)`."""
        obstacles = observation[ENVIRONMENT_STATE][..., _OBSTACLES:].unflatten(-1, (MAX_OBSTACLES, 2))
        return torch.cat((super().forward(observation), self.scan(observation[STATE][..., :2], obstacles)), dim=-1)


def _register_scale(module: nn.Module, keys: tuple[str, ...]) -> None:
    low, high = (torch.cat([torch.as_tensor(BOUNDS[key][end]) for key in keys]) for end in (0, 1))
    module.register_buffer("scale", (2 / (high - low)).float(), persistent=False)
    module.register_buffer("offset", (-(high + low) / (high - low)).float(), persistent=False)
