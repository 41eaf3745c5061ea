"""How a hand follows the mind: not quite steadily."""

import math

import numpy as np

from copolicy.dataset.task_spec import RECORD_HZ

from .profiles import Habits

_NOISE_S = 0.5  # s, correlation time of the noise
_PULSE_S = (0.6, 1.2)  # s, shortest and longest pulse
_SWELL_S = 0.1  # s, in which a pulse takes effect
_PAUSE_S = (0.4, 1.2)  # s, shortest and longest pause
_SLIP_S = (0.2, 0.5)  # s, shortest and longest slip
_SLIP = (0.4, 0.9)  # weakest and strongest slip, of a full force
_DRIFT_S = 3.0  # s, correlation time of the effort


class UnsteadyHand:
    """Turns the force that is meant into the one that comes out.

    It adds slow noise, pushes in pulses of unequal strength, works now more and now less than its share, rests now
    and then, and slips now and then: pushes for a moment in some other direction, from which both must recover.

    Attributes:
        pauses: how often it has rested.
        slips: how often it has slipped.
    """

    def __init__(self, habits: Habits, rng: np.random.Generator):
        self._rng = rng
        self._habits = habits
        self._keep, self._kick = _wander(habits.noise, _NOISE_S)
        self._drift_keep, self._drift_kick = _wander(habits.effort_drift, _DRIFT_S)
        self._swell = 1 - math.exp(-1 / (RECORD_HZ * _SWELL_S))
        self._strength = self._aim = 1.0
        self._left = self._pause_left = self._slip_left = 0
        self._x, self._y = (habits.noise * rng.standard_normal(2)).tolist()
        self._drift = habits.effort_drift * rng.standard_normal()
        self._slip = (0.0, 0.0)
        self.pauses = self.slips = 0

    def push(self, x: float, y: float) -> tuple[float, float]:
        """The force that comes out of the one that was meant, each component in [-1, 1]."""
        rng = self._rng
        self._x = self._keep * self._x + self._kick * rng.standard_normal()
        self._y = self._keep * self._y + self._kick * rng.standard_normal()
        self._drift = self._drift_keep * self._drift + self._drift_kick * rng.standard_normal()
        if self._left == 0:
            self._left = round(RECORD_HZ * rng.uniform(*_PULSE_S))
            self._aim = 1.0 - self._habits.impulsiveness * rng.random()
        self._left -= 1
        resting = self._rests()
        self._strength += self._swell * ((0.0 if resting else self._aim) - self._strength)
        strength = self._strength * math.exp(self._drift)
        slip_x, slip_y = self._slips()
        x, y = strength * x + self._x + slip_x, strength * y + self._y + slip_y
        return min(1.0, max(-1.0, x)), min(1.0, max(-1.0, y))

    def _rests(self) -> bool:
        if self._pause_left:
            self._pause_left -= 1
        elif self._begins(self._habits.pauses_per_min):
            self.pauses += 1
            self._pause_left = round(RECORD_HZ * self._rng.uniform(*_PAUSE_S))
        return self._pause_left > 0

    def _slips(self) -> tuple[float, float]:
        if self._slip_left:
            self._slip_left -= 1
        elif self._begins(self._habits.slips_per_min):
            self.slips += 1
            self._slip_left = round(RECORD_HZ * self._rng.uniform(*_SLIP_S))
            size, angle = self._rng.uniform(*_SLIP), self._rng.uniform(0, 2 * math.pi)
            self._slip = (size * math.cos(angle), size * math.sin(angle))
        return self._slip if self._slip_left else (0.0, 0.0)

    def _begins(self, per_min: float) -> bool:
        return per_min > 0 and self._rng.random() < per_min / (60 * RECORD_HZ)


def _wander(spread: float, seconds: float) -> tuple[float, float]:
    """Factor and kick of an Ornstein-Uhlenbeck process in steps of 1/30 s, by its spread and correlation time."""
    keep = math.exp(-1 / (RECORD_HZ * seconds))
    return keep, spread * math.sqrt(1 - keep**2)
