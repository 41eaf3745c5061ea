"""A scripted player of the table."""

import math
from collections import deque

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import InvalidValueError, ShapeError
from copolicy.dataset.task_spec import PLAYERS, RECORD_HZ

from ..map_config import MapConfig
from ..physics import Physics
from .motor_noise import MotorNoise
from .profiles import PlayerProfile
from .route_choice import PartnerForce, RouteChoice

_GAIN = 2.0  # 1/s, gain on the error of the table's velocity
TURN_GAIN = 1.5  # 1/s, gain on the error of the table's orientation
MAX_SPIN = 0.6  # rad/s, bound on the target spin
_SMOOTH_S = 0.2  # s, time constant of the target velocity
_SLOW = 40.0  # px to the target pose below which the target speed falls


def spin_per_force(physics: Physics) -> float:
    """Steady spin under a unit difference of the two forces across the table, rad/s."""
    return physics.lever / 2 * physics.force_scale / physics.angular_damping


class ScriptedPlayer:
    """Acts at one end of the table from the map and delayed states of the table.

    It follows a route (`RouteChoice`), computes the velocity and spin of the table along it and the two forces that
    would produce them, from the state `delay_steps` ago, and applies its own one of the two with `MotorNoise`. It has
    no access to the other player's route, force or random numbers.
    """

    def __init__(self, player: int, map_config: MapConfig, profile: PlayerProfile, seed: int):
        """
        Args:
            player: 0 for the robot's seat, 1 for the human's.
            seed: of its random numbers; equal seeds and equal states give equal forces, bit for bit.
        """
        if player not in range(len(PLAYERS)):
            raise InvalidValueError("player", "0 or 1", player)
        if seed < 0:
            raise InvalidValueError("seed", "a whole number, not negative", seed)
        rng = np.random.default_rng(seed)
        physics = Physics()
        self.player = player
        self.profile = profile
        self.route_choice = RouteChoice(map_config, profile, rng)
        self.motor_noise = MotorNoise(profile, rng)
        self._partner_force = PartnerForce()
        self._states: deque[list[float]] = deque(maxlen=profile.delay_steps + 1)
        self._forces: deque[tuple[float, float]] = deque(maxlen=profile.delay_steps + 1)
        self._target = (0.0, 0.0, 0.0)  # vx, vy, omega
        self._smoothing = 1 - math.exp(-1 / (RECORD_HZ * _SMOOTH_S))
        self._damping = physics.linear_damping / physics.mass
        self._push = physics.force_scale / physics.mass
        self._spin = spin_per_force(physics)

    @property
    def changes(self) -> int:
        """Number of changes of route so far."""
        return self.route_choice.changes

    def act(self, state: Array) -> Array:
        """The own force `(2,)`, x and y in [-1, 1], for a state `(7,)` of the table; called once a step.

        Raises:
            ShapeError: a state of another shape.
        """
        if np.shape(state) != (7,):
            raise ShapeError("state", (7,), np.shape(state))
        self._states.append(np.asarray(state, dtype=float).tolist())
        x, y, cos, sin, vx, vy, _ = self._states[0]
        pose = (x, y, math.atan2(sin, cos))
        if len(self._states) == self._states.maxlen and len(self._forces) == self._forces.maxlen:
            self._partner_force.update((vx, vy), self._forces[0])
            self.route_choice.update(pose, math.hypot(vx, vy), self._partner_force)
        force = self.motor_noise.apply(*self._intended_force(pose, cos, sin, vx, vy))
        self._forces.append(force)
        return np.array(force)

    def _intended_force(self, pose, cos: float, sin: float, vx: float, vy: float) -> tuple[float, float]:
        dx, dy, turn = self.route_choice.heading(self.route_choice.route, pose)
        distance = math.hypot(dx, dy)
        speed = self.profile.speed * min(1.0, distance / _SLOW)
        spin = min(MAX_SPIN, max(-MAX_SPIN, TURN_GAIN * turn))
        target = (dx / (distance + 1e-9) * speed, dy / (distance + 1e-9) * speed, spin)
        target_vx, target_vy, target_spin = self._target = tuple(
            old + self._smoothing * (new - old) for old, new in zip(self._target, target, strict=True)
        )
        joint_x = (self._damping * vx + _GAIN * (target_vx - vx)) / self._push
        joint_y = (self._damping * vy + _GAIN * (target_vy - vy)) / self._push
        across = target_spin / self._spin
        # The human's end gets half of the difference, the robot's end the other half with the opposite sign.
        own_half = 0.5 * (across if self.player == 1 else -across)
        effort = self.profile.effort
        return effort * (joint_x / 2 + own_half * sin), effort * (joint_y / 2 + own_half * cos)
