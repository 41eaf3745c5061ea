"""Exchange of the two seats of the table."""

import math
from dataclasses import replace

import numpy as np

from copolicy.dataset.arrays import Array

from .map_config import MapConfig

_HALF_TURN = np.array([1.0, 1.0, -1.0, -1.0, 1.0, 1.0, 1.0])  # of x, y, cos_theta, sin_theta, vx, vy, omega


class TableSeats:
    """Exchanges the seats by turning the table by pi; position, velocity and forces keep the axes of the window.

    The dynamics are the same up to rounding. The two ends differ in outline, so a contact can come some steps earlier
    or later.
    """

    def scenario(self, scenario: MapConfig) -> MapConfig:
        """The map with its start turned by pi."""
        x, y, theta = scenario.start
        return replace(scenario, start=(x, y, (theta + math.pi) % (2 * math.pi)))

    def states(self, states: Array) -> Array:
        """States `(..., 7)` turned by pi."""
        return states * _HALF_TURN

    def actions(self, actions: Array) -> Array:
        """Joint actions `(..., 4)` with the players' halves exchanged."""
        return np.concatenate((actions[..., 2:], actions[..., :2]), axis=-1)
