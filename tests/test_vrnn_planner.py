"""The VRNN planner's controllers and choice of plans, and the published defects against their corrections."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from copolicy.collect.rollout import Agent, Rollout, Trace
from copolicy.dataset.task import get_task
from copolicy.tasks.table import MapConfig
from copolicy.tasks.table.policy.motion import TableMotion
from lerobot_policy_copolicy.vrnn.control import pose_error, proportional_actions, velocity_actions
from lerobot_policy_copolicy.vrnn.planner import MotionPlanner

MOVED = TableMotion()


def pose(x: float, y: float, theta: float) -> torch.Tensor:
    return torch.tensor([[x, y, math.cos(theta), math.sin(theta)]])


class Follower(Agent):
    """Both halves of the joint actions that follow a function from step to target pose."""

    def __init__(self, planner: MotionPlanner, path):
        self.name, self._planner, self._path, self._step = "follower", planner, path, 0

    def act(self, states, worlds):
        if not hasattr(self, "_half"):
            self._half = 0
        target = self._path(self._step)[:, None].repeat(len(states), 2, 1)
        joint = self._planner.follow(target, 0, torch.from_numpy(states).float()).double().numpy()
        half = joint[:, 2 * self._half : 2 * self._half + 2]
        self._half, self._step = 1 - self._half, self._step + self._half
        return half


def planner(**settings) -> MotionPlanner:
    """A planner whose path is the waypoint itself, a second ahead."""
    defaults = {
        "lookahead_frames": 30,
        "stride": 30,
        "wrapped_angle": True,
        "controller": "velocity",
        "proportional_gain": 0.15,
        "unit_force": False,
    }
    config = SimpleNamespace(filled=SimpleNamespace(**defaults | settings))
    rows = SimpleNamespace(motion=MOVED, period=1.0)
    bounds = torch.tensor([[-1.0] * 4, [1.0] * 4])
    return MotionPlanner(None, rows, config, bounds)  # pyright: ignore[reportArgumentType]


def driven(path, steps: int, start=(240.0, 300.0, 3.14), **settings) -> np.ndarray:
    """`(steps + 1, 6)` recorded states of the real world under the controller."""
    task = get_task()
    scenario = MapConfig(start, (1100.0, 500.0))
    agent = Follower(planner(**settings), path)
    rollout = Rollout(task, [scenario], (agent, agent))
    trace = Trace(rollout)
    rollout.run(steps)
    return trace.states(0)


@pytest.mark.parametrize(
    "target", [(440.0, 250.0, 3.14), (240.0, 300.0, 1.57), (400.0, 330.0, 5.5), (300.0, 300.0, 0.2)]
)
def test_the_controller_drives_the_table_to_a_waypoint_and_a_heading(target):
    states = driven(lambda step: pose(*target), 450)
    turn = (states[:, 2] - target[2] + math.pi) % (2 * math.pi) - math.pi
    distance = np.hypot(states[:, 0] - target[0], states[:, 1] - target[1])
    assert distance[-1] < 2
    assert abs(turn[-1]) < 0.05
    assert np.abs(states[-1, 3:]).max() < 1
    # Critically damped: it does not pass the waypoint by more than a few px.
    along = (states[:, :2] - target[:2]) @ np.subtract(target[:2], (240.0, 300.0))
    assert along.max() <= 5 * max(1.0, np.hypot(target[0] - 240, target[1] - 300))


def test_a_moving_waypoint_is_followed_at_its_speed():
    states = driven(lambda step: pose(240 + 40 * (1 + step / 30), 300, 3.14), 240)
    assert states[-60:, 3] == pytest.approx(40, abs=1)
    assert np.abs(states[:, 4:]).max() < 1


def test_the_published_controller_neither_slows_nor_turns():
    target = (440.0, 300.0, 1.57)
    fast = driven(lambda step: pose(*target), 120, controller="proportional", unit_force=True, wrapped_angle=False)
    assert fast[-1, 3] > 30  # 0.707 of a force each, near the waypoint too
    assert abs(fast[-1, 2] - 3.14) < 0.1  # of 1.57 rad
    slow = driven(lambda step: pose(*target), 450)
    assert abs(slow[-1, 2] - 1.57) < 0.05
    assert abs(slow[-1, 3]) < 1


def test_the_force_is_of_unit_norm_or_grows_with_the_distance():
    error = torch.tensor([[100.0, 0.0, 0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    poses = pose(300, 300, 0).expand(3, -1)
    unit = proportional_actions(MOVED, poses, error, 0.15, unit_force=True)
    torch.testing.assert_close(unit.norm(dim=1), torch.tensor([1.0, 1.0, 0.0]))
    torch.testing.assert_close(unit[0, [0, 2]], torch.tensor([0.5**0.5] * 2), rtol=0, atol=1e-4)
    # The proportion of the torque in baselines: 0.007 of a force for half a radian.
    assert abs(float(unit[0, 3] - unit[0, 1]) / 2) == pytest.approx(0.007, abs=5e-4)
    plain = proportional_actions(MOVED, poses, error, 0.15, unit_force=False)
    torch.testing.assert_close(plain[0, 0], torch.tensor(7.5))
    torch.testing.assert_close(plain[1], torch.tensor([0.075, 0, 0.075, 0]))


def test_the_velocity_controller_keeps_within_the_forces_and_gives_priority_to_the_torque():
    error = torch.tensor([[400.0, 100.0, 0.6]])
    still = torch.zeros(1, 3)
    actions = velocity_actions(MOVED, pose(300, 300, 0), still, error, 1.0)
    assert actions.abs().max() <= 1 + 1e-6
    # 40 rad/s of damping, 0.6 rad/s wanted: a torque of 24 of a lever of 25 for each difference of forces.
    assert float(actions[0, 3] - actions[0, 1]) * 25 == pytest.approx(24, abs=1e-3)
    push = actions[0, :2] + actions[0, 2:]
    assert float(push[0] / push[1]) == pytest.approx(4, rel=1e-3)  # in the wanted direction
    # At the wanted velocity it is the friction alone.
    moving = torch.tensor([[40.0, 10.0, 0.0]])
    steady = velocity_actions(MOVED, pose(300, 300, 0), moving, moving, 1.0)
    torch.testing.assert_close(steady, torch.tensor([[0.8, 0.2, 0.8, 0.2]]))


def test_the_angle_is_wrapped_or_not():
    before, after = pose(0, 0, 6.2), pose(0, 0, 0.1)
    wrapped = pose_error(before, after, wrapped=True)[0, 2]
    assert float(wrapped) == pytest.approx(0.1 - 6.2 + 2 * math.pi, abs=1e-5)
    assert float(pose_error(before, after, wrapped=False)[0, 2]) == pytest.approx(-6.1, abs=1e-5)


def test_the_waypoint_moves_on_between_plans():
    path = torch.cat([pose(300 + 10 * step, 300, 0)[:, None] for step in range(1, 5)], dim=1)
    state = MOVED.states(pose(300, 300, 0), torch.tensor([[5.0, 0.0, 0.0]]))
    aged = planner(stride=5, lookahead_frames=10, controller="proportional")
    # 10 frames ahead is the second pose, 20 px; after one more frame a fifth of the way to the third.
    for age, distance in ((0, 20.0), (1, 22.0), (5, 30.0), (50, 40.0)):
        expected = proportional_actions(MOVED, pose(300, 300, 0), torch.tensor([[distance, 0, 0]]), 0.15, False)
        torch.testing.assert_close(aged.follow(path, age, state), expected.clamp(-1, 1))


def test_the_future_with_the_greatest_sum_of_rewards_is_executed(monkeypatch):
    futures = torch.stack(
        [pose(600, 300, 0).expand(3, -1), pose(900, 300, 0).expand(3, -1), pose(600, 590, 0).expand(3, -1)]
    )
    chosen = planner()
    monkeypatch.setattr(chosen, "sample", lambda states, scenarios: torch.stack((futures, futures.flip(0))))
    scenario = torch.from_numpy(get_task().scenario_vector(MapConfig((240.0, 300.0, 3.14), (960.0, 300.0)))).float()
    path = chosen.plan(torch.zeros(2, 1, 7), scenario.expand(2, -1))
    torch.testing.assert_close(path, futures[1].expand(2, -1, -1))
