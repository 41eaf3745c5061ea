"""How a hand follows the mind: not quite steadily."""

import math

import numpy as np

from copolicy.dataset.task import RECORD_HZ

_NOISE_S = 0.5  # s, correlation time of the noise
_PULSE_S = (0.6, 1.2)  # s, shortest and longest pulse
_SWELL_S = 0.1  # s, in which a pulse takes effect


class UnsteadyHand:
    """Adds slow noise to a force, and pushes in pulses of unequal strength."""

    def __init__(self, noise: float, impulsiveness: float, rng: np.random.Generator):
        self._rng = rng
        self._impulsiveness = impulsiveness
        self._keep = math.exp(-1 / (RECORD_HZ * _NOISE_S))
        self._kick = noise * math.sqrt(1 - self._keep**2)
        self._swell = 1 - math.exp(-1 / (RECORD_HZ * _SWELL_S))
        self._strength = self._aim = 1.0
        self._left = 0
        self._x, self._y = (noise * rng.standard_normal(2)).tolist()

    def push(self, x: float, y: float) -> tuple[float, float]:
        """The force that comes out of the one that was meant, each component in [-1, 1]."""
        rng = self._rng
        self._x = self._keep * self._x + self._kick * rng.standard_normal()
        self._y = self._keep * self._y + self._kick * rng.standard_normal()
        if self._left == 0:
            self._left = round(RECORD_HZ * rng.uniform(*_PULSE_S))
            self._aim = 1.0 - self._impulsiveness * rng.random()
        self._left -= 1
        self._strength += self._swell * (self._aim - self._strength)
        x, y = self._strength * x + self._x, self._strength * y + self._y
        return min(1.0, max(-1.0, x)), min(1.0, max(-1.0, y))
