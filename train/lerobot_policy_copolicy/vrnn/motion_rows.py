"""Rows of motion, the network's inputs: the displacement of the body in one stride, and its surroundings."""

import torch
from torch import Tensor, nn

from copolicy.dataset.features import ENVIRONMENT_STATE, STATE
from copolicy.dataset.task import BodyMotion

_PUBLISHED_UNIT = 8.0  # px, by which the published rows divide the places of goal and obstacles
_FAR, _NEAR = (3.0, 4.0), (1.0, 2.0)  # unit in reaches of the body, and bound of the scaled place

MOTION = 4
"""Values of a displacement: x, y, and the changes of the cosine and the sine of the orientation."""


class PointFeatures(nn.Module):
    """Goal and obstacles in the axes of the body, the published surroundings.

    Unscaled: x, y of each point in units of 8 px, and zeros for an absent point. Scaled: each at two scales, over the
    scene and around the body, and for each obstacle whether it exists. The pose is added where bounds are given.

    Args:
        motion: of the task.
        scaled: scale the places.
        bounds: `(2, n)` lowest and highest states, by which the body's own pose is scaled to [-1, 1].

    Attributes:
        repeat_last, velocity_as_goal: the surroundings as the published planner computed them in execution, see
            `VrnnConfig`; for an eval mode alone.
    """

    pose_bounds: Tensor

    def __init__(self, motion: BodyMotion, scaled: bool, bounds: Tensor | None = None):
        super().__init__()
        self.motion, self.scaled = motion, scaled
        self.repeat_last = self.velocity_as_goal = False
        points = len(motion.points)
        self.size = 5 * points - 1 if scaled else 2 * points
        self.with_pose = bounds is not None
        if bounds is not None:
            self.register_buffer("pose_bounds", motion.poses(bounds), persistent=False)
            self.size += self.pose_bounds.shape[1]

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """Columns `(..., n)` in the units of the task to `(..., size)`."""
        states = observation[STATE]
        points = self._points(states, self.motion.scenario_points(observation[ENVIRONMENT_STATE]))  # (..., P, 2)
        encoded = self._encoded(points, self.motion.poses(states)[..., None, :])
        if not self.with_pose:
            return encoded
        low, high = self.pose_bounds
        return torch.cat((encoded, (2 * self.motion.poses(states) - low - high) / (high - low)), dim=-1)

    def _encoded(self, points: Tensor, poses: Tensor) -> Tensor:
        present = (points != 0).any(dim=-1, keepdim=True).to(points.dtype)
        places = self.motion.to_body(points - poses[..., :2], poses) * present
        if not self.scaled:
            return (places / _PUBLISHED_UNIT).flatten(-2)
        copies = [(places / (unit * self.motion.reach)).clamp(-bound, bound) for unit, bound in (_FAR, _NEAR)]
        scaled = torch.cat((*copies, present), dim=-1).flatten(-2)
        return torch.cat((scaled[..., :4], scaled[..., 5:]), dim=-1)  # the goal always exists

    def _points(self, states: Tensor, points: Tensor) -> Tensor:
        if self.training or not (self.repeat_last or self.velocity_as_goal):
            return points
        goal, obstacles = points[..., :1, :], points[..., 1:, :]
        if self.velocity_as_goal:
            goal = self.motion.velocities(states)[..., None, :2]
        if self.repeat_last:
            count = (obstacles != 0).any(dim=-1).sum(dim=-1, keepdim=True)  # (..., 1)
            slots = torch.arange(obstacles.shape[-2], device=points.device).minimum((count - 1).clamp(min=0))
            obstacles = obstacles.gather(-2, slots[..., None].expand_as(obstacles))
        return torch.cat((goal, obstacles), dim=-2)


class MotionRows:
    """Converts poses to rows of motion `(..., size)` and back.

    A row has the displacement from the pose before it (`MOTION` values), and the surroundings at its own pose.

    Args:
        motion: of the task.
        features: encodes observation columns as surroundings.
        period: seconds between two poses.
        in_body_axes: displacements are along the axes of the body before the stride, and the rotation is relative to
            it; else they are differences in the axes of the scene, as published.
        scaled: displacements in units of the body's greatest speed, of a rotation at the players; else px and rad.
        on_circle: the orientation after a displacement is scaled to a cosine and a sine; else their sums drift.
    """

    def __init__(
        self, motion: BodyMotion, features: nn.Module, period: float, in_body_axes: bool, scaled: bool, on_circle: bool
    ):
        self.motion, self.features, self.period = motion, features, period
        self.in_body_axes, self.on_circle = in_body_axes, on_circle
        unit = motion.speed * period if scaled else 1.0
        turn = unit / motion.reach if scaled else 1.0
        self._units = (unit, unit, turn, turn)

    def displacements(self, poses: Tensor) -> Tensor:
        """Displacements `(..., T, 4)` between consecutive poses `(..., T + 1, 4)`."""
        before, after = poses[..., :-1, :], poses[..., 1:, :]
        difference = after - before
        if self.in_body_axes:
            along = self.motion.to_body(difference[..., :2], before)
            difference = torch.cat((along, _relative(before, after) - _relative(before, before)), dim=-1)
        return difference / difference.new_tensor(self._units)

    def moved(self, poses: Tensor, displacements: Tensor) -> Tensor:
        """Poses `(B, 4)` after displacements `(B, 4)`: the inverse of `displacements`."""
        difference = displacements * displacements.new_tensor(self._units)
        if self.in_body_axes:
            position = poses[..., :2] + self.motion.to_scene(difference[..., :2], poses)
            cos, sin = poses[..., 2], poses[..., 3]
            turn_cos, turn_sin = difference[..., 2] + 1, difference[..., 3]
            heading = torch.stack((cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin), dim=-1)
        else:
            position, heading = (poses + difference).split(2, dim=-1)
        if self.on_circle:
            heading = nn.functional.normalize(heading, dim=-1)
        return torch.cat((position, heading), dim=-1)

    @torch.no_grad()
    def surroundings(
        self, before: Tensor, poses: Tensor, scenarios: Tensor, velocities: Tensor | None = None
    ) -> Tensor:
        """Surroundings `(..., n)` at poses `(..., 4)`, as constants of the training.

        Args:
            before: the poses one stride earlier, for the velocity.
            scenarios: `(..., k)` scenario vectors.
            velocities: `(..., 3)` instead of the mean over the stride.
        """
        if velocities is None:
            spin = _relative(before, poses)[..., 1:]
            velocities = torch.cat((poses[..., :2] - before[..., :2], spin), dim=-1) / self.period
        return self.features({STATE: self.motion.states(poses, velocities), ENVIRONMENT_STATE: scenarios})

    def rows(self, poses: Tensor, scenarios: Tensor, velocities: Tensor | None = None) -> Tensor:
        """Rows `(B, T, n)` of poses `(B, T + 1, 4)` in scenarios `(B, k)`; velocities `(B, T + 1, 3)` if given."""
        repeated = scenarios[:, None].expand(-1, poses.shape[1] - 1, -1)
        at_rows = None if velocities is None else velocities[:, 1:]
        surroundings = self.surroundings(poses[:, :-1], poses[:, 1:], repeated, at_rows)
        return torch.cat((self.displacements(poses), surroundings), dim=-1)


def _relative(before: Tensor, after: Tensor) -> Tensor:
    """Cosine and sine `(..., 2)` of the rotation between poses `(..., 4)`."""
    cos, sin, cos_after, sin_after = before[..., 2], before[..., 3], after[..., 2], after[..., 3]
    return torch.stack((cos * cos_after + sin * sin_after, cos * sin_after - sin * cos_after), dim=-1)
