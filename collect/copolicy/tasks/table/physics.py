"""Settings of the table's dynamics.

Source: the environment of Ng, Liu and Kennedy (RA-L 2023). Units are px, rad and s; y points down, theta turns
counter-clockwise on screen.
"""

import math
from dataclasses import asdict, dataclass

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task_spec import RECORD_HZ

GOAL_SIZE = 92
"""Side of the solid goal square, px."""


@dataclass(frozen=True)
class Physics:
    """Settings of the dynamics; the defaults correct the defects of the original program.

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

    def __post_init__(self) -> None:
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
