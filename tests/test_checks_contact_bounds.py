"""The two rectangles bracket what the world itself calls a touch."""

import math

import numpy as np
import pytest

from copolicy.dataset.task_spec import RECORD_HZ
from copolicy.tasks.table.features import theta_of
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import GOAL_SIZE
from copolicy.tasks.table.rules import LIMITS
from copolicy.tasks.table.rules.contact_bounds import INNER, OUTER, final_poses, separation
from copolicy.tasks.table.world import TableWorld

GOAL = (600.0, 300.0)


def test_axis_aligned_gaps():
    positions, centres = np.array([[100.0, 100.0]] * 2), np.array([[200.0, 100.0], [100.0, 200.0]])
    assert separation(positions, np.zeros(2), (0.0, 50.0, 10.0), centres, 20.0).tolist() == [30.0, 70.0]
    turned = separation(positions, np.full(2, math.pi / 2), (0.0, 50.0, 10.0), centres, 20.0)
    assert turned == pytest.approx([70.0, 30.0])
    assert separation(positions[:1], np.zeros(1), (0.0, 50.0, 10.0), positions[:1], 20.0)[0] == pytest.approx(-30.0)


def test_an_offset_lies_along_the_table_on_screen():
    # At a quarter turn counter-clockwise on screen the table's robot end points up, to smaller y.
    centre = np.array([[100.0, 0.0]])
    near = separation(np.array([[100.0, 100.0]]), np.array([math.pi / 2]), (30.0, 10.0, 10.0), centre, 10.0)
    assert near == pytest.approx([50.0])


def test_the_world_agrees_with_both_rectangles():
    world = TableWorld(MapConfig((100.0, 300.0, 0.0), GOAL))
    random = np.random.default_rng(0)
    positions = np.array(GOAL) + random.uniform(-160, 160, (4000, 2))
    thetas = random.uniform(0, 2 * math.pi, len(positions))
    touch = np.array([world.contact((x, y, theta)).goal for (x, y), theta in zip(positions, thetas, strict=True)])
    centres = np.broadcast_to(GOAL, positions.shape)
    outer = separation(positions, thetas, OUTER, centres, GOAL_SIZE / 2)
    inner = separation(positions, thetas, INNER, centres, GOAL_SIZE / 2)
    margin = LIMITS["contact_margin"].value
    assert 500 < touch.sum() < 3500
    assert outer[touch].max() <= margin
    assert inner[~touch].min() >= -margin
    # They would bracket anything if they were far apart: most poses are decided.
    assert ((outer > margin) | (inner < -margin)).mean() > 0.75


@pytest.mark.parametrize("fps", [10, 5])
def test_where_an_episode_can_have_ended(fps):
    world = TableWorld(MapConfig((100.0, 300.0, 0.0), GOAL))
    random = np.random.default_rng(1)
    for _ in range(20):
        world.reset((600, 300, random.uniform(0, 6)), (*random.uniform(-40, 40, 2), random.uniform(-1, 1)))
        before = world.observation
        action = random.uniform(-1, 1, 4)
        positions, thetas, error = final_poses(before[None], fps, RECORD_HZ)
        assert positions.shape == (30 // fps, 1, 2)
        for position, theta in zip(positions[:, 0], thetas[:, 0], strict=True):
            world.step(action)
            end = np.array([95.8 * math.cos(theta), -95.8 * math.sin(theta)])
            true_theta = float(theta_of(world.observation))
            true_end = np.array([95.8 * math.cos(true_theta), -95.8 * math.sin(true_theta)])
            distance = np.linalg.norm(position + end - (np.array(world.pose[:2]) + true_end))
            assert distance <= error * math.sqrt(2)
