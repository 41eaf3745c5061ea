"""Plans by sampled futures, and the joint actions that follow a plan."""

from typing import Any

import torch
from torch import Tensor

from .configuration_vrnn import VrnnConfig
from .control import pose_error, proportional_actions, velocity_actions
from .motion_rows import MotionRows
from .network import MotionNetwork
from .prediction import encode, free_run


class MotionPlanner:
    """Samples futures of the body, chooses the one with the greatest sum of rewards, and follows it.

    Args:
        bounds: `(2, m)` lowest and highest joint action.
    """

    def __init__(self, network: MotionNetwork, rows: MotionRows, config: VrnnConfig, bounds: Tensor):
        self._network, self._rows, self._bounds = network, rows, bounds
        self._settings: Any = config.filled

    def plan(self, states: Tensor, scenarios: Tensor) -> Tensor:
        """The best future `(B, plan_frames / stride, 4)`: poses one stride apart, the first after one stride.

        Args:
            states: `(B, history_frames / stride + 1, n)` history, oldest first.
            scenarios: `(B, k)` scenario vectors.
        """
        futures = self.sample(states, scenarios)  # (B, S, T, 4)
        repeated = scenarios[:, None, None].expand(*futures.shape[:3], -1)
        rewards = self._rows.motion.rewards(futures, repeated).sum(dim=-1)  # (B, S)
        return futures[torch.arange(len(futures), device=futures.device), rewards.argmax(dim=1)]

    def sample(self, states: Tensor, scenarios: Tensor) -> Tensor:
        """Sampled futures `(B, n_samples, plan_frames / stride, 4)`; arguments as of `plan`."""
        settings, motion = self._settings, self._rows.motion
        poses = motion.poses(states)
        # The velocities of the states matter only where they are read as the goal.
        velocities = motion.velocities(states) if settings.velocity_as_goal else None
        samples = settings.n_samples
        rows = self._rows.rows(poses, scenarios, velocities).repeat_interleave(samples, dim=0)
        encoded = encode(self._network, rows)
        start = poses[:, -1].repeat_interleave(samples, dim=0)
        steps = settings.plan_frames // settings.stride
        repeated = scenarios.repeat_interleave(samples, dim=0)
        run = free_run(self._network, self._rows, encoded.state, start, repeated, steps, settings.temperature)
        return run.poses.unflatten(0, (len(states), samples))

    def follow(self, path: Tensor, age: int, state: Tensor) -> Tensor:
        """Joint actions `(B, m)` that drive to the waypoint of a path `(B, T, 4)`.

        Args:
            age: frames since the plan; the waypoint moves on with them, between the poses of the path.
            state: `(B, n)` current state.
        """
        settings, motion = self._settings, self._rows.motion
        poses = motion.poses(state)
        target = _waypoint(path, (settings.lookahead_frames + age) / settings.stride - 1)
        error = pose_error(poses, target, settings.wrapped_angle)
        if settings.controller == "proportional":
            actions = proportional_actions(motion, poses, error, settings.proportional_gain, settings.unit_force)
        else:
            seconds = settings.lookahead_frames * self._rows.period / settings.stride
            actions = velocity_actions(motion, poses, motion.velocities(state), error, seconds)
        low, high = self._bounds.to(actions.device)
        return actions.clamp(low, high)


def _waypoint(path: Tensor, position: float) -> Tensor:
    """The pose `(B, 4)` at a position between the poses of a path `(B, T, 4)`."""
    position = min(max(position, 0.0), path.shape[1] - 1)
    index = min(int(position), path.shape[1] - 2) if path.shape[1] > 1 else 0
    after = min(index + 1, path.shape[1] - 1)
    return torch.lerp(path[:, index], path[:, after], position - index)
