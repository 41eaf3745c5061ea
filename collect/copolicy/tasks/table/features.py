"""State and scenario vectors of the table, to and from poses and maps."""

import math

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import bounds_of, features_of

from .map_config import MapConfig
from .spec import SPEC

STATE_NAMES, ENVIRONMENT_NAMES, ACTION_NAMES = SPEC.state.names, SPEC.scenario.names, SPEC.joint_action.names
FEATURES, BOUNDS = features_of(SPEC), bounds_of(SPEC)
TASK = SPEC.sentence


def state_vector(pose: tuple[float, float, float], velocity: tuple[float, float, float]) -> Array:
    """`(7,)` observation of the table from its pose (px, px, rad) and velocity (px/s, px/s, rad/s)."""
    x, y, theta = pose
    return np.array((x, y, math.cos(theta), math.sin(theta), *velocity))


def theta_of(states: Array) -> Array:
    """Orientation in [0, 2 pi) of states `(..., 7)`, rad."""
    return np.arctan2(states[..., 3], states[..., 2]) % (2 * math.pi)


def states_7(states: Array) -> Array:
    """States `(..., 6)` with theta as `(..., 7)` with cosine and sine; their last bit may differ from `math.cos`."""
    cosine, sine = np.cos(states[..., 2]), np.sin(states[..., 2])
    return np.concatenate((states[..., :2], cosine[..., None], sine[..., None], states[..., 3:]), axis=-1)


def environment_state(config: MapConfig) -> Array:
    """`(11,)` observation of a map: start pose, goal, and the centres of the obstacles padded with zeros."""
    vector = np.zeros(len(ENVIRONMENT_NAMES))
    values = (*config.start, *config.goal, *(value for centre in config.obstacles for value in centre))
    vector[: len(values)] = values
    return vector


def map_from_vector(vector: Array, obstacle_size: int, obstacle_sizes: str = "") -> MapConfig:
    """The map of an `environment_state` vector `(11,)`; the zero padding gives the number of obstacles.

    Args:
        obstacle_size: the episode column, px.
        obstacle_sizes: the episode column, empty where all obstacles have `obstacle_size`.

    Raises:
        InvalidValueError: an obstacle after an empty slot.
    """
    values = [float(value) for value in vector]
    slots = [(values[i], values[i + 1]) for i in range(5, len(values), 2)]
    count = sum(slot != (0.0, 0.0) for slot in slots)
    if any(slot == (0.0, 0.0) for slot in slots[:count]):
        raise InvalidValueError("environment_state", "obstacles before the zero padding", slots)
    x, y, theta, goal_x, goal_y = values[:5]
    return MapConfig((x, y, theta), (goal_x, goal_y), tuple(slots[:count]), obstacle_size, parse_sizes(obstacle_sizes))


def format_sizes(config: MapConfig) -> str:
    """The episode column `obstacle_sizes` of a map."""
    return ",".join(map(str, config.obstacle_sizes))


def parse_sizes(text: str) -> tuple[int, ...]:
    """The inverse of `format_sizes`.

    Raises:
        InvalidValueError: no whole numbers.
    """
    try:
        return tuple(int(size) for size in text.split(",")) if text else ()
    except ValueError:
        raise InvalidValueError("obstacle_sizes", "whole numbers of px, comma separated", text) from None
