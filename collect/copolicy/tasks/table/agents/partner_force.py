"""What a pilot makes of the motion of the table: where the other one pulls."""

import math

from ..physics import Physics

_MEMORY_S = 0.4  # s, how long a pull is felt


class PartnerForce:
    """The other player's force, as one player can feel it: what moves the table beyond its own push.

    From v' = v + (-(b/m) v + (f/m) (u_own + u_other)) dt, solved for u_other and smoothed over 0.4 s.
    """

    def __init__(self):
        physics = Physics()
        self._dt = physics.dt
        self._damping = physics.linear_damping / physics.mass
        self._push = physics.force_scale / physics.mass
        self._weight = physics.dt / _MEMORY_S
        self._velocity: tuple[float, float] | None = None
        self.x = self.y = 0.0

    def feel(self, velocity: tuple[float, float], own_force: tuple[float, float]) -> None:
        """Takes in the velocity of the table now, and the own force since the velocity before, px/s and [-1, 1]."""
        if self._velocity is not None:
            vx, vy = self._velocity
            pull_x = ((velocity[0] - vx) / self._dt + self._damping * vx) / self._push - own_force[0]
            pull_y = ((velocity[1] - vy) / self._dt + self._damping * vy) / self._push - own_force[1]
            # A table that is set elsewhere moves by more than any hand could move it.
            if math.hypot(pull_x, pull_y) < 2.0:
                self.x += self._weight * (pull_x - self.x)
                self.y += self._weight * (pull_y - self.y)
        self._velocity = velocity
