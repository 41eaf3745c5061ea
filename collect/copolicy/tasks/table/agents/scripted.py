"""One simulated player."""

import math
from collections import deque

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError, ShapeError
from copolicy.dataset.task_spec import PLAYERS, RECORD_HZ

from ..map_config import MapConfig
from ..physics import Physics
from .hand import UnsteadyHand
from .intention import Intention, PartnerForce
from .profiles import Habits

_GAIN = 2.0  # 1/s, how sharply it corrects the table's velocity
_TURN_GAIN = 1.5  # 1/s, how sharply it corrects the table's orientation
_MAX_SPIN = 0.6  # rad/s that it asks for
_SMOOTH_S = 0.2  # s, over which the velocity that it wants changes
_SLOW = 40.0  # px to the pose ahead below which it slows down


class ScriptedPilot:
    """One player: holds one end of the table and knows only the map and how the table moves.

    It wants a route (`Intention`), works out with which velocity and spin the table should follow it, and which two
    forces would do that, from what it saw `delay_steps` ago; then it applies its own of the two, unsteadily
    (`UnsteadyHand`). It never hears of the other player's route, force or random numbers.
    """

    def __init__(self, player: int, map_config: MapConfig, habits: Habits, seed: int):
        """
        Args:
            player: 0 for the robot seat, 1 for the human seat.
            map_config: the map, which both players see.
            habits: how it carries.
            seed: of its random numbers; equal seeds and equal states give equal forces, bit for bit.
        """
        if player not in range(len(PLAYERS)):
            raise InvalidValueError("player", "0 or 1", player)
        if seed < 0:
            raise InvalidValueError("seed", "a whole number, not negative", seed)
        rng = np.random.default_rng(seed)
        physics = Physics()
        self.player = player
        self.habits = habits
        self.intention = Intention(map_config, habits, rng)
        self.hand = UnsteadyHand(habits, rng)
        self._partner = PartnerForce()
        self._seen: deque[list[float]] = deque(maxlen=habits.delay_steps + 1)
        self._pushed: deque[tuple[float, float]] = deque(maxlen=habits.delay_steps + 1)
        self._aim = (0.0, 0.0, 0.0)
        self._smooth = 1 - math.exp(-1 / (RECORD_HZ * _SMOOTH_S))
        self._damping = physics.linear_damping / physics.mass
        self._push = physics.force_scale / physics.mass
        # Spin that a unit difference of the two forces across the table keeps up, rad/s.
        self._spin = physics.lever / 2 * physics.force_scale / physics.angular_damping

    @property
    def changes(self) -> int:
        """How often it has changed its mind about the route."""
        return self.intention.changes

    def act(self, state: np.ndarray) -> np.ndarray:
        """The own force `(2,)`, x and y in [-1, 1], for a state `(7,)` of the table; called once a step.

        Raises:
            ShapeError: a state of another shape.
        """
        if np.shape(state) != (7,):
            raise ShapeError("state", (7,), np.shape(state))
        self._seen.append(np.asarray(state, dtype=float).tolist())
        x, y, cos, sin, vx, vy, _ = self._seen[0]
        pose = (x, y, math.atan2(sin, cos))
        if len(self._seen) == self._seen.maxlen and len(self._pushed) == self._pushed.maxlen:
            self._partner.feel((vx, vy), self._pushed[0])
            self.intention.consider(pose, math.hypot(vx, vy), self._partner)
        force = self.hand.push(*self._meant_force(pose, cos, sin, vx, vy))
        self._pushed.append(force)
        return np.array(force)

    def _meant_force(self, pose, cos: float, sin: float, vx: float, vy: float) -> tuple[float, float]:
        way_x, way_y, turn = self.intention.heading(self.intention.route, pose)
        way = math.hypot(way_x, way_y)
        speed = self.habits.speed * min(1.0, way / _SLOW)
        spin = min(_MAX_SPIN, max(-_MAX_SPIN, _TURN_GAIN * turn))
        wish = (way_x / (way + 1e-9) * speed, way_y / (way + 1e-9) * speed, spin)
        aim_x, aim_y, aim_spin = self._aim = tuple(
            old + self._smooth * (new - old) for old, new in zip(self._aim, wish, strict=True)
        )
        both_x = (self._damping * vx + _GAIN * (aim_x - vx)) / self._push
        both_y = (self._damping * vy + _GAIN * (aim_y - vy)) / self._push
        across = aim_spin / self._spin
        # The human's end gets half of the difference, the robot's end the other half with the opposite sign.
        share = 0.5 * (across if self.player == 1 else -across)
        effort = self.habits.effort
        return effort * (both_x / 2 + share * sin), effort * (both_y / 2 + share * cos)
