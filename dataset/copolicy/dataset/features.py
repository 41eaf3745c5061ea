"""The columns of a LeRobot data set of this task, and the fixed bounds that scale them.

The bounds come from the task, never from data: a goal that is constant in the training set would explode under
min-max statistics on any other map.
"""

import math

import numpy as np

from copolicy.tasks.table.map_config import MAX_OBSTACLES, WINDOW, MapConfig

from .exceptions import InvalidValueError
from .task import ACTION_NAMES, STATE_NAMES

STATE = "observation.state"
ENVIRONMENT_STATE = "observation.environment_state"
HUMAN_ACTION = "observation.human_action"
ACTION = "action"
SCENE_IMAGE = "observation.images.scene"
"""The optional image of map and table, without the forces."""

SCENE_SIZE = (600, 300)
"""Its width and height, px, unless other ones are asked for."""

SCENE_SIDES = (64, 3840)
"""The shortest and the longest side that it may have, px."""

OBSERVATION_KEYS = {"agent_pos": STATE, "environment_state": ENVIRONMENT_STATE, "human_action": HUMAN_ACTION}
"""Names of the observations in the environment and in exports, and their columns.

`agent_pos` and `environment_state` are what LeRobot reads from a gymnasium environment as `observation.state` and
`observation.environment_state`.
"""

GYM_ID = "copolicy/TableCarrying-v0"
"""Name of the environment in gymnasium's registry; importing `lerobot_policy_copolicy` registers it."""

ENVIRONMENT_NAMES = (
    "start_x",
    "start_y",
    "start_theta",
    "goal_x",
    "goal_y",
    *(f"obstacle_{slot}_{axis}" for slot in range(MAX_OBSTACLES) for axis in "xy"),
)

FEATURES: dict[str, dict] = {
    STATE: {"dtype": "float32", "shape": (7,), "names": list(STATE_NAMES)},
    ENVIRONMENT_STATE: {"dtype": "float32", "shape": (11,), "names": list(ENVIRONMENT_NAMES)},
    HUMAN_ACTION: {"dtype": "float32", "shape": (2,), "names": ["human_fx", "human_fy"]},
    ACTION: {"dtype": "float32", "shape": (4,), "names": list(ACTION_NAMES)},
    "next.reward": {"dtype": "float32", "shape": (1,), "names": None},
    "next.done": {"dtype": "bool", "shape": (1,), "names": None},
    "next.success": {"dtype": "bool", "shape": (1,), "names": None},
}
"""LeRobot's feature table of this task."""

TASK = "Carry the table to the goal together."
"""LeRobot's task sentence."""

_MAX_SPEED = 50.0  # terminal speed of an axis under two full forces, px/s
_MAX_SPIN = math.pi / 2  # rad/s
_WIDTH, _HEIGHT = float(WINDOW[0]), float(WINDOW[1])
_POSITION = ((0.0, _WIDTH), (0.0, _HEIGHT))

BOUNDS: dict[str, np.ndarray] = {
    STATE: np.array([*_POSITION, (-1, 1), (-1, 1), *[(-_MAX_SPEED, _MAX_SPEED)] * 2, (-_MAX_SPIN, _MAX_SPIN)]).T,
    ENVIRONMENT_STATE: np.array([*_POSITION, (0, 2 * math.pi), *_POSITION * (1 + MAX_OBSTACLES)]).T,
    HUMAN_ACTION: np.array([(-1.0, 1.0)] * 2).T,
    ACTION: np.array([(-1.0, 1.0)] * 4).T,
}
"""Lowest and highest value of each column, `(2, n)`."""


def state_vector(pose: tuple[float, float, float], velocity: tuple[float, float, float]) -> np.ndarray:
    """`(7,)` observation of the table from its pose (px, px, rad) and velocity (px/s, px/s, rad/s)."""
    x, y, theta = pose
    return np.array((x, y, math.cos(theta), math.sin(theta), *velocity))


def theta_of(states: np.ndarray) -> np.ndarray:
    """Orientation in [0, 2 pi) of states `(..., 7)`, rad."""
    return np.arctan2(states[..., 3], states[..., 2]) % (2 * math.pi)


def environment_state(config: MapConfig) -> np.ndarray:
    """`(11,)` observation of a map: start pose, goal, and obstacles padded with zeros."""
    vector = np.zeros(len(ENVIRONMENT_NAMES))
    values = (*config.start, *config.goal, *(value for centre in config.obstacles for value in centre))
    vector[: len(values)] = values
    return vector


def map_of(vector: np.ndarray, obstacle_size: int, obstacle_sizes: str = "") -> MapConfig:
    """The map behind an `environment_state` vector `(11,)`; its zero padding tells the number of obstacles.

    Args:
        obstacle_size: the episode column.
        obstacle_sizes: the episode column, empty where all obstacles are of `obstacle_size`.

    Raises:
        InvalidValueError: an obstacle stands behind an empty slot.
    """
    values = [float(value) for value in vector]
    slots = [(values[i], values[i + 1]) for i in range(5, len(values), 2)]
    count = sum(slot != (0.0, 0.0) for slot in slots)
    if any(slot == (0.0, 0.0) for slot in slots[:count]):
        raise InvalidValueError("environment_state", "obstacles before the zero padding", slots)
    x, y, theta, goal_x, goal_y = values[:5]
    return MapConfig((x, y, theta), (goal_x, goal_y), tuple(slots[:count]), obstacle_size, sizes_of(obstacle_sizes))


def sizes_text(config: MapConfig) -> str:
    """The episode column `obstacle_sizes` of a map."""
    return ",".join(map(str, config.obstacle_sizes))


def sizes_of(text: str) -> tuple[int, ...]:
    """The inverse of `sizes_text`.

    Raises:
        InvalidValueError: no whole numbers.
    """
    try:
        return tuple(int(size) for size in text.split(",")) if text else ()
    except ValueError:
        raise InvalidValueError("obstacle_sizes", "whole numbers of px, comma separated", text) from None
