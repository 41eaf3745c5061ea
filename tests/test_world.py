"""The world against traces of the original program, and its own rules."""

import math

import numpy as np
import pytest

from copolicy.dataset.exceptions import InvalidValueError, ShapeError
from copolicy.dataset.outline import to_scene
from copolicy.dataset.task import Outcome
from copolicy.tasks.table.geometry import CIRCLE_CENTRE, TRIANGLE, image_size
from copolicy.tasks.table.interaction import interaction_force
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.reward import reward
from copolicy.tasks.table.world import Contact, TableWorld

EMPTY = MapConfig(start=(300.0, 300.0, 0.0), goal=(960.0, 300.0))
STILL = (0.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def collisions(upstream):
    """Poses, the original's verdicts (obstacle, goal, wall) on them, and ours."""
    data = np.load(upstream / "collisions.npz")
    worlds = [
        TableWorld(MapConfig((240, 120, 0), tuple(goal), tuple(map(tuple, obstacles[:count])), int(size)))
        for goal, obstacles, count, size in zip(
            data["layout_goal"],
            data["layout_obstacles"],
            data["layout_n_obs"],
            data["layout_obst_size"],
            strict=True,
        )
    ]
    ours = np.array([worlds[i].contact(pose) for i, pose in zip(data["layout"], data["pose"], strict=True)])
    theirs = np.stack([data["hit_obstacle"], data["hit_target"], data["hit_wall"]], axis=1)
    return ours, theirs, data["near"]


@pytest.mark.parametrize(("limit", "key"), [(math.pi / 2, "cap_pi_over_2"), (math.pi / 8, "cap_pi_over_8")])
def test_dynamics_equal_the_original(upstream, limit, key):
    data = np.load(upstream / "dynamics.npz")
    world = TableWorld(EMPTY, Physics(angular_acceleration_limit=limit))
    for states, actions in zip(data[f"states_{key}"], data["actions"], strict=True):
        world.reset(states[0, :3], states[0, 3:])
        for expected, action in zip(states[1:], actions, strict=True):
            world.step(action)
            error = np.abs(np.array((*world.pose, *world.velocity)) - expected)
            error[2] = min(error[2], 2 * math.pi - error[2])  # two sides of the same angle
            assert error.max() < 1e-9


@pytest.mark.parametrize(("column", "rate", "near_rate"), [(0, 0.99, 0.985), (1, 0.993, 0.99), (2, 0.9995, 0.9995)])
def test_contacts_agree_with_the_original(collisions, column, rate, near_rate):
    ours, theirs, near = collisions
    agree = ours[:, column] == theirs[:, column]
    assert agree.mean() >= rate
    assert agree[near].mean() >= near_rate
    assert agree[~near].mean() >= 0.999


def test_contact_errors_lean_to_neither_side(collisions):
    ours, theirs, _ = collisions
    missed, invented = (theirs & ~ours)[:, :2].sum(), (ours & ~theirs)[:, :2].sum()
    assert missed + invented > 0
    assert 0.3 < missed / (missed + invented) < 0.7


def test_reward_equals_the_original(upstream):
    data = np.load(upstream / "interaction.npz")
    config = MapConfig((240, 120, 0), tuple(data["reward_goal"]), tuple(map(tuple, data["reward_obstacles"])))
    ours = [reward(x, y, config) for x, y in data["state_after"][:, :2]]
    np.testing.assert_allclose(ours, data["reward"], atol=1e-6)  # the original's positions are float32 there
    world = TableWorld(config)
    world.reset(data["state_after"][0, :3])
    assert world.reward() == ours[0]


def test_interaction_force_in_legacy_mode_equals_the_original(upstream):
    data = np.load(upstream / "interaction.npz")
    ours = interaction_force(data["state_after"][:, 2], data["actions"], legacy_axis=True)
    np.testing.assert_allclose(2 * ours, data["inter_f_unit"], atol=1e-12)
    # The trace of the environment's own value was taken with its table still at the start angle.
    at_start = interaction_force(3.14, data["actions"], legacy_axis=True)
    np.testing.assert_allclose(100 * at_start, data["inter_f_env"], atol=1e-10)


def test_interaction_force_along_the_physical_axis_is_what_the_table_transmits():
    world = TableWorld(EMPTY)
    world.reset((600.0, 300.0, 0.7))
    axis = np.array((math.cos(0.7), -math.sin(0.7)))
    world.step((*axis, *-axis))
    assert world.velocity == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert interaction_force(0.7, np.array((*axis, *-axis))) == pytest.approx(1.0)


def test_robot_end_is_on_the_right_at_zero_and_theta_turns_counter_clockwise():
    tip = (sum(u for u, _ in TRIANGLE) / 4, 0.0)
    assert to_scene((600.0, 300.0, 0.0), tip)[0] > 600 > to_scene((600.0, 300.0, 0.0), CIRCLE_CENTRE)[0]
    assert to_scene((600.0, 300.0, math.pi / 2), tip)[1] < 300
    world = TableWorld(EMPTY)
    world.reset((600.0, 300.0, 0.0))
    world.step((0.0, -1.0, 0.0, 1.0))  # the robot on the right pushes up
    assert world.velocity[2] > 0


def test_action_is_clipped():
    a, b = TableWorld(EMPTY), TableWorld(EMPTY)
    a.step((7.0, -3.0, 1.0, 0.5))
    b.step(np.array((1.0, -1.0, 1.0, 0.5), dtype=np.float32))
    assert (a.pose, a.velocity) == (b.pose, b.velocity)


@pytest.mark.parametrize(
    ("action", "error", "text"),
    [
        ((0.0, 0.0, float("nan"), 0.0), InvalidValueError, "action: expected finite numbers, found [0.0, 0.0, nan, 0"),
        ((0.0, float("-inf"), 0.0, 0.0), InvalidValueError, "action: expected finite numbers, found [0.0, -inf, 0.0"),
        ((0.0, 0.0), ShapeError, "action: expected shape (4,), got (2,)"),
        (np.zeros((1, 4)), ShapeError, "action: expected shape (4,), got (1, 4)"),
        ("push", InvalidValueError, "action: expected four numbers, found 'push'"),
    ],
)
def test_wrong_actions_change_nothing(action, error, text):
    world = TableWorld(EMPTY)
    with pytest.raises(error) as raised:
        world.step(action)
    assert str(raised.value).startswith(text)
    assert (world.pose, world.step_count) == (EMPTY.start, 0)


@pytest.mark.parametrize(
    ("pose", "text"),
    [
        ((1.0, 2.0), "pose: expected three numbers, found (1.0, 2.0)"),
        ((1.0, 2.0, float("inf")), "pose: expected finite numbers, found (1.0, 2.0, inf)"),
    ],
)
def test_wrong_poses_are_refused(pose, text):
    world = TableWorld(EMPTY)
    for call in (world.reset, world.contact):
        with pytest.raises(InvalidValueError) as raised:
            call(pose)
        assert str(raised.value) == text


def test_reset_returns_to_rest_at_the_start():
    config = MAP_SETS["training"][5]
    world = TableWorld(config)
    for _ in range(20):
        world.step((1.0, 0.3, 0.4, -0.2))
    world.reset()
    assert (world.pose, world.velocity, world.step_count) == (config.start, (0.0, 0.0, 0.0), 0)
    world.reset((300.0, 200.0, -0.5), (1.0, 2.0, 0.1))
    assert world.pose == pytest.approx((300.0, 200.0, 2 * math.pi - 0.5))
    x, y, cos, sin, *velocity = world.observation
    assert (x, y, math.atan2(sin, cos)) == pytest.approx((300.0, 200.0, -0.5))
    assert velocity == [1.0, 2.0, 0.1]


def test_contact_leaves_the_world_as_it_is():
    config = MAP_SETS["unseen"][6]
    queried, plain = TableWorld(config), TableWorld(config)
    for _ in range(60):
        assert queried.contact((*config.obstacles[0], 1.0)).obstacle
        assert queried.contact((*config.goal, 0.0)) == Contact(obstacle=False, goal=True, wall=False)
        assert queried.step((1.0, 0.5, 0.5, 0.2)) == plain.step((1.0, 0.5, 0.5, 0.2))
    assert (queried.pose, queried.velocity, queried.step_count) == (plain.pose, plain.velocity, 60)


def test_gap_between_the_parts_is_empty():
    """A thin obstacle in the gap between circle and board, where a rectangle would collide."""
    world = TableWorld(MapConfig((600, 300, 0), (1100.0, 500.0), ((541.5, 300.0),), obstacle_size=1))
    assert not world.contact((600.0, 300.0, 0.0)).obstacle
    assert world.contact((606.0, 300.0, 0.0)).obstacle
    assert world.contact((594.0, 300.0, 0.0)).obstacle


def test_goal_wins_over_an_obstacle_and_both_over_a_wall():
    goal_and_obstacle = MapConfig((600, 300, 0), (700.0, 300.0), ((500.0, 300.0),))
    assert TableWorld(goal_and_obstacle).step(STILL) == Outcome(True, True, "goal")
    obstacle_and_wall = TableWorld(MapConfig((90, 300, 0), (960.0, 300.0), ((120.0, 300.0),)))
    assert obstacle_and_wall.contact((90.0, 300.0, 0.0)) == Contact(obstacle=True, goal=False, wall=True)
    assert obstacle_and_wall.step(STILL) == Outcome(True, False, "collision_obstacle")
    assert TableWorld(MapConfig((90, 300, 0), (960.0, 300.0))).step(STILL) == Outcome(True, False, "collision_wall")


@pytest.mark.parametrize("theta", [0.0, math.pi / 2, 0.4])
def test_wall_is_the_box_of_the_turned_image(theta):
    width, height = image_size(math.cos(theta), math.sin(theta))
    world = TableWorld(EMPTY)
    for pose, axis, step in (
        ((width // 2, 300.0, theta), 0, -1),
        ((600.0, height // 2, theta), 1, -1),
        ((1200 - width + width // 2, 300.0, theta), 0, 1),
        ((600.0, 600 - height + height // 2, theta), 1, 1),
    ):
        assert not world.contact(pose).wall
        outside = list(pose)
        outside[axis] += step
        assert world.contact(outside).wall


def test_time_limit_ends_the_episode():
    world = TableWorld(EMPTY, Physics(step_limit=3))
    assert [world.step(STILL) for _ in range(3)] == [Outcome(False, False, "")] * 2 + [Outcome(True, False, "timeout")]


def test_reaching_the_goal_ends_the_episode():
    world = TableWorld(EMPTY)
    outcome = world.step(STILL)
    while not outcome.done:
        outcome = world.step((1.0, 0.0, 1.0, 0.0))
    assert outcome == Outcome(True, True, "goal")
    assert world.pose[0] + 95.5 == pytest.approx(960 - 46, abs=3)
