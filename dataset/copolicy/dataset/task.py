"""The table-carrying task: its constants, the settings of its physics, and its maps.

Source: the environment of Ng, Liu and Kennedy (RA-L 2023). Units are px, rad and s; y points down,
theta turns counter-clockwise on screen. Player 0 is the robot seat, player 1 the human seat.
"""

import math
from dataclasses import asdict, dataclass

from .exceptions import InvalidValueError
from .map_config import MAX_OBSTACLES, WINDOW, MapConfig
from .maps import MAP_SETS, ORIGINAL_MAPS, identify, map_set

__all__ = [
    "ACTION_NAMES",
    "GOAL_SIZE",
    "MAP_SETS",
    "MAX_OBSTACLES",
    "ORIGINAL_MAPS",
    "PLAYERS",
    "RECORD_HZ",
    "STATE_NAMES",
    "WINDOW",
    "MapConfig",
    "Physics",
    "identify",
    "map_set",
]

RECORD_HZ = 30
"""Steps of simulation and recording per second."""

GOAL_SIZE = 92
"""Side of the solid goal square, px."""

STATE_NAMES = ("x", "y", "cos_theta", "sin_theta", "vx", "vy", "omega")
ACTION_NAMES = ("robot_fx", "robot_fy", "human_fx", "human_fy")
PLAYERS = ("robot", "human")


@dataclass(frozen=True)
class Physics:
    """Settings of the dynamics, with the corrected value of each as default.

    Attributes:
        angular_acceleration_limit: bound on the total angular acceleration, damping included, rad/s^2.
            The paper's evaluation used pi/2, its training-time rollouts pi/8.
        step_limit: steps of 1/30 s after which an episode ends as a time-out.
    """

    angular_acceleration_limit: float = math.pi / 2
    step_limit: int = 1000
    mass: float = 2.0
    linear_damping: float = 2.0
    inertia: float = 1.0
    angular_damping: float = 40.0
    lever: float = 1.0
    force_scale: float = 50.0

    def __post_init__(self):
        if not self.angular_acceleration_limit > 0:
            raise InvalidValueError("angular_acceleration_limit", "a positive number", self.angular_acceleration_limit)
        if self.step_limit < 1:
            raise InvalidValueError("step_limit", "at least 1", self.step_limit)
        for name, value in asdict(self).items():
            if not math.isfinite(value):
                raise InvalidValueError(name, "a finite number", value)
            if name in ("mass", "inertia") and not value > 0:
                raise InvalidValueError(name, "a positive number", value)

    @property
    def dt(self) -> float:
        """Length of a step, s."""
        return 1.0 / RECORD_HZ
