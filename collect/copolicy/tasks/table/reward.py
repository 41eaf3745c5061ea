"""The reward of the original program (`custom_rewards.py`): near the goal, away from obstacles and walls."""

import math

from .map_config import WINDOW, MapConfig

_STEP_COST = 0.1
_GOAL_WIDTH = 300.0  # px, standard deviation of the bump around the goal
_OBSTACLE_WIDTH = 50.0  # px, of the dips at obstacles and walls


def reward(x: float, y: float, config: MapConfig) -> float:
    """Reward of the table's centre at (x, y) px: -0.1 + a bump at the goal - a dip at each obstacle and wall.

    Nothing is added for reaching the goal or for a collision. Not used to learn a co-policy; it ranks plans.
    """
    obstacles = sum(_bump(math.hypot(x - cx, y - cy), _OBSTACLE_WIDTH) for cx, cy in config.obstacles)
    walls = sum(_bump(distance, _OBSTACLE_WIDTH) for distance in (x, WINDOW[0] - x, y, WINDOW[1] - y))
    return _bump(math.hypot(x - config.goal[0], y - config.goal[1]), _GOAL_WIDTH) - _STEP_COST - obstacles - walls


def _bump(distance: float, width: float) -> float:
    return math.exp(-(distance**2) / (2 * width**2))
