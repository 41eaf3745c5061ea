"""The reward of the original program (`custom_rewards.py`): near the goal, away from obstacles and walls."""

import math

from .map_config import WINDOW, MapConfig

STEP_COST = 0.1
GOAL_WIDTH = 300.0  # px, standard deviation of the Gaussian at the goal
OBSTACLE_WIDTH = 50.0  # px, standard deviation of those at obstacles and walls


def reward(x: float, y: float, config: MapConfig) -> float:
    """Reward of the table's centre at (x, y) px: -0.1 + a Gaussian at the goal - one at each obstacle and wall.

    Reaching the goal and collisions add nothing. Training does not use it; plan studies rank sampled plans by it.
    """
    obstacles = sum(_gaussian(math.hypot(x - cx, y - cy), OBSTACLE_WIDTH) for cx, cy in config.obstacles)
    walls = sum(_gaussian(distance, OBSTACLE_WIDTH) for distance in (x, WINDOW[0] - x, y, WINDOW[1] - y))
    return _gaussian(math.hypot(x - config.goal[0], y - config.goal[1]), GOAL_WIDTH) - STEP_COST - obstacles - walls


def _gaussian(distance: float, width: float) -> float:
    return math.exp(-(distance**2) / (2 * width**2))
