"""Motor noise of a scripted player: the difference between the intended force and the applied one."""

import math

import numpy as np

from copolicy.dataset.task_spec import RECORD_HZ

from .profiles import PlayerProfile

_NOISE_S = 0.5  # s, correlation time of the additive noise
_PULSE_S = (0.6, 1.2)  # s, shortest and longest pulse
_RISE_S = 0.1  # s, time constant with which a pulse takes effect
_PAUSE_S = (0.4, 1.2)  # s, shortest and longest pause
_SLIP_S = (0.2, 0.5)  # s, shortest and longest slip
_SLIP = (0.4, 0.9)  # weakest and strongest slip, of a full force
_DRIFT_S = 3.0  # s, correlation time of the effort


class MotorNoise:
    """Turns the intended force into the applied force.

    Adds correlated noise, applies the force in pulses of unequal strength, lets the effort drift, pauses at random,
    and slips at random: a slip adds a force in a random direction for a moment, from which both players must recover.

    Attributes:
        pauses: number of pauses so far.
        slips: number of slips so far.
    """

    def __init__(self, profile: PlayerProfile, rng: np.random.Generator):
        self._rng = rng
        self._profile = profile
        self._noise_decay, self._noise_scale = _ornstein_uhlenbeck(profile.noise, _NOISE_S)
        self._drift_decay, self._drift_scale = _ornstein_uhlenbeck(profile.effort_drift, _DRIFT_S)
        self._rise = 1 - math.exp(-1 / (RECORD_HZ * _RISE_S))
        self._strength = self._target_strength = 1.0
        self._pulse_steps = self._pause_steps = self._slip_steps = 0  # steps that remain of each
        self._x, self._y = (profile.noise * rng.standard_normal(2)).tolist()
        self._drift = profile.effort_drift * rng.standard_normal()
        self._slip = (0.0, 0.0)
        self.pauses = self.slips = 0

    def apply(self, x: float, y: float) -> tuple[float, float]:
        """The applied force for an intended force, each component in [-1, 1]; called once a step."""
        rng = self._rng
        self._x = self._noise_decay * self._x + self._noise_scale * rng.standard_normal()
        self._y = self._noise_decay * self._y + self._noise_scale * rng.standard_normal()
        self._drift = self._drift_decay * self._drift + self._drift_scale * rng.standard_normal()
        if self._pulse_steps == 0:
            self._pulse_steps = round(RECORD_HZ * rng.uniform(*_PULSE_S))
            self._target_strength = 1.0 - self._profile.impulsiveness * rng.random()
        self._pulse_steps -= 1
        target = 0.0 if self._is_paused() else self._target_strength
        self._strength += self._rise * (target - self._strength)
        strength = self._strength * math.exp(self._drift)
        slip_x, slip_y = self._slip_force()
        x, y = strength * x + self._x + slip_x, strength * y + self._y + slip_y
        return min(1.0, max(-1.0, x)), min(1.0, max(-1.0, y))

    def _is_paused(self) -> bool:
        if self._pause_steps:
            self._pause_steps -= 1
        elif self._starts(self._profile.pauses_per_min):
            self.pauses += 1
            self._pause_steps = round(RECORD_HZ * self._rng.uniform(*_PAUSE_S))
        return self._pause_steps > 0

    def _slip_force(self) -> tuple[float, float]:
        if self._slip_steps:
            self._slip_steps -= 1
        elif self._starts(self._profile.slips_per_min):
            self.slips += 1
            self._slip_steps = round(RECORD_HZ * self._rng.uniform(*_SLIP_S))
            size, angle = self._rng.uniform(*_SLIP), self._rng.uniform(0, 2 * math.pi)
            self._slip = (size * math.cos(angle), size * math.sin(angle))
        return self._slip if self._slip_steps else (0.0, 0.0)

    def _starts(self, per_min: float) -> bool:
        return per_min > 0 and self._rng.random() < per_min / (60 * RECORD_HZ)


def _ornstein_uhlenbeck(deviation: float, seconds: float) -> tuple[float, float]:
    """Decay and noise scale per step of 1/30 s, from the standard deviation and the correlation time in s."""
    decay = math.exp(-1 / (RECORD_HZ * seconds))
    return decay, deviation * math.sqrt(1 - decay**2)
