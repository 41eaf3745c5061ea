"""Controllers that drive the body to a waypoint: joint actions of both players from poses and velocities."""

import math

import torch
from torch import Tensor

from copolicy.dataset.task import BodyMotion


def pose_error(poses: Tensor, targets: Tensor, wrapped: bool) -> Tensor:
    """Differences `(..., 3)` of position and orientation from poses to targets `(..., 4)`.

    Args:
        wrapped: the angle is in [-pi, pi); else it is the difference of two angles in [0, 2 pi), as published.
    """
    angles = [torch.atan2(pose[..., 3], pose[..., 2]) % (2 * math.pi) for pose in (targets, poses)]
    turn = angles[0] - angles[1]
    if wrapped:
        turn = (turn + math.pi) % (2 * math.pi) - math.pi
    return torch.cat((targets[..., :2] - poses[..., :2], turn[..., None]), dim=-1)


def proportional_actions(motion: BodyMotion, poses: Tensor, error: Tensor, gain: float, unit_force: bool) -> Tensor:
    """The published controller: a wrench of `gain` per px and per rad alike, in units of a player's full force.

    Args:
        error: `(B, 3)`, see `pose_error`.
        unit_force: divide the joint action by its norm, so that the force is the same at any distance.

    Returns:
        `(B, 2 m)` joint actions, not clipped.
    """
    actions = motion.joint_actions(motion.full_force * gain * error, poses)
    return torch.nn.functional.normalize(actions, dim=-1) if unit_force else actions


def velocity_actions(motion: BodyMotion, poses: Tensor, velocities: Tensor, error: Tensor, seconds: float) -> Tensor:
    """Tracks the velocity that reaches the waypoint in time.

    With inertia m and damping b of an axis, the wrench is m (error / seconds - v) / tau + b v, so that the velocity
    converges to the wanted one with time constant tau. tau is a quarter of `seconds`, which reaches a resting waypoint
    with critical damping; on an axis whose friction is faster, tau is m / b, and the wrench is b error / seconds.

    The torque has priority: the players push together with what their force bounds leave, in the wanted direction.

    Args:
        velocities: `(B, 3)` of the body.
        error: `(B, 3)`, see `pose_error`.
        seconds: time to the waypoint.

    Returns:
        `(B, 2 m)` joint actions with every number in [-1, 1].
    """
    wrenches = []
    for axis, (inertia, damping) in enumerate(zip(motion.inertia, motion.damping, strict=True)):
        tau = seconds / 4 if damping * seconds < 4 * inertia else inertia / damping
        wanted, velocity = error[:, axis] / seconds, velocities[:, axis]
        wrenches.append(inertia * (wanted - velocity) / tau + damping * velocity)
    wrench = torch.stack(wrenches, dim=-1)
    turning = wrench * wrench.new_tensor((0, 0, 1))
    twist = motion.joint_actions(turning, poses).clamp(-1, 1)
    push = motion.joint_actions(wrench - turning, poses)
    room = ((1 - twist.abs()) / push.abs().clamp(min=1e-9)).amin(dim=-1, keepdim=True).clamp(max=1)
    return twist + push * room
