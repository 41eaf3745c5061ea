"""The table as a body that moves in a plane: poses, dynamics, rewards and forces of the players, in torch."""

import torch
from torch import Tensor

from ..features import ENVIRONMENT_NAMES
from ..map_config import MAX_OBSTACLES, WINDOW
from ..physics import Physics
from ..reward import GOAL_WIDTH, OBSTACLE_WIDTH, STEP_COST
from ..spec import SPEED

_GOAL = ENVIRONMENT_NAMES.index("goal_x")
_PHYSICS = Physics()


class TableMotion:
    """The part `motion` of the table, see `BodyMotion`; px, rad and s, in the axes of the window (y down).

    theta turns counter-clockwise on screen, so that the table's long axis, from the human's end to the robot's, is
    (cos, -sin), and its second axis (sin, cos). The dynamics are those of `Physics` with its defaults.
    """

    speed: float = SPEED
    reach: float = 95.0  # half the length of the drawn table; the lever of the torque is `Physics.lever` / 2
    full_force: float = _PHYSICS.force_scale
    inertia: tuple[float, float, float] = (_PHYSICS.mass, _PHYSICS.mass, _PHYSICS.inertia)
    damping: tuple[float, float, float] = (
        _PHYSICS.linear_damping,
        _PHYSICS.linear_damping,
        _PHYSICS.angular_damping,
    )
    points: tuple[str, ...] = ("goal", *(f"obstacle_{slot}" for slot in range(MAX_OBSTACLES)))

    def poses(self, states: Tensor) -> Tensor:
        """Poses `(..., 4)` of states `(..., 7)`."""
        return states[..., :4]

    def velocities(self, states: Tensor) -> Tensor:
        """Velocities `(..., 3)` of states `(..., 7)`."""
        return states[..., 4:]

    def states(self, poses: Tensor, velocities: Tensor) -> Tensor:
        """States `(..., 7)`."""
        return torch.cat((poses, velocities), dim=-1)

    def scenario_points(self, scenarios: Tensor) -> Tensor:
        """`(..., 4, 2)` the goal, and the obstacles' centres."""
        return scenarios[..., _GOAL:].unflatten(-1, (1 + MAX_OBSTACLES, 2))

    def to_body(self, vectors: Tensor, poses: Tensor) -> Tensor:
        """Vectors `(..., 2)` along the table's long and second axis."""
        x, y = vectors.unbind(-1)
        cos, sin = poses[..., 2], poses[..., 3]
        return torch.stack((x * cos - y * sin, x * sin + y * cos), dim=-1)

    def to_scene(self, vectors: Tensor, poses: Tensor) -> Tensor:
        """The inverse of `to_body`."""
        along, across = vectors.unbind(-1)
        cos, sin = poses[..., 2], poses[..., 3]
        return torch.stack((along * cos + across * sin, across * cos - along * sin), dim=-1)

    def rewards(self, poses: Tensor, scenarios: Tensor) -> Tensor:
        """`reward` of the table's centre, `(...)`."""
        position = poses[..., :2]
        points = self.scenario_points(scenarios)
        goal = _gaussian((points[..., 0, :] - position).square().sum(dim=-1), GOAL_WIDTH)
        obstacles = points[..., 1:, :]
        distance = (obstacles - position[..., None, :]).square().sum(dim=-1)
        near = _gaussian(distance, OBSTACLE_WIDTH) * (obstacles != 0).any(dim=-1)
        size = position.new_tensor(WINDOW)
        walls = _gaussian(torch.cat((position, size - position), dim=-1).square(), OBSTACLE_WIDTH)
        return goal - STEP_COST - near.sum(dim=-1) - walls.sum(dim=-1)

    def joint_actions(self, wrenches: Tensor, poses: Tensor) -> Tensor:
        """Joint actions `(..., 4)` of the smallest norm: both push alike, and against each other for the torque.

        The torque of actions u1, u2 is full_force lever / 2 (sin, cos) . (u2 - u1), see `dynamics.torque`.
        """
        push = wrenches[..., :2] / (2 * self.full_force)
        axis = torch.stack((poses[..., 3], poses[..., 2]), dim=-1)
        half = axis * wrenches[..., 2:] / (self.full_force * _PHYSICS.lever)
        return torch.cat((push - half, push + half), dim=-1)


def _gaussian(squared_distance: Tensor, width: float) -> Tensor:
    return torch.exp(-squared_distance / (2 * width**2))
