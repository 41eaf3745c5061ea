"""Human limits of an agent: a late sight of the world, and forces less exact than intended.

delay   time until what happens reaches the action. In continuous manual tracking the delay of people's visual
        feedback loop is 0.26 s (fast target) to 0.34 s (slow target): Miall, J. Motor Behavior 28 (1996) 125, three
        people.
noise   standard deviation of the force, as a proportion of the intended force: people's force noise grows about in
        proportion to the force (Slifkin and Newell, J. Motor Behavior 31 (1999); Hamilton et al., Exp. Brain Res.
        157 (2004) 417, where the proportion falls with the strength of the muscle group). `HUMAN_NOISE` is our
        choice within the order of magnitude of these studies of single muscle groups; a stick was not measured.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import PairTask

from ..rollout import Agent, EpisodeStart

HUMAN_DELAY_S = (0.26, 0.34)
"""Shortest and longest delay of people's visual feedback loop, s (Miall 1996)."""

HUMAN_NOISE = 0.1
"""Force noise of a `human-like` partner, as a proportion of its force."""

NOISE_S = 0.1
"""Correlation time of the force noise, s: people's force varies slowly, mostly below a few Hz."""

_STREAM = 0x11A1  # separates this noise from other random numbers of the same seed


@dataclass(frozen=True)
class HumanLimits:
    """Limits of a `LimitedAgent`.

    Attributes:
        delay_s: time by which states and actions reach the agent late, s; 0 or more.
        noise: standard deviation of the force noise, as a proportion of the intended action's length; 0 or more.

    Raises:
        InvalidValueError: a value that is negative or not finite, or a delay above 2 s.
    """

    delay_s: float = 0.0
    noise: float = 0.0

    def __post_init__(self) -> None:
        for name, value, maximum in (("delay", self.delay_s, 2.0), ("noise", self.noise, 5.0)):
            if not (math.isfinite(value) and 0 <= value <= maximum):
                raise InvalidValueError(name, f"a number from 0 to {maximum:g}", value)

    def to_json(self) -> dict[str, float]:
        """The limits in results."""
        return asdict(self)


class LimitedAgent(Agent):
    """Any agent at either seat of any task, with human limits.

    The inner agent gets the state and the joint actions of `delay_s` ago; before that time has passed, the initial
    state and actions of zero. Its action gets an Ornstein-Uhlenbeck noise in each number, with the correlation time
    `NOISE_S` and the standard deviation `noise * |action|`; a rollout clips the sum to the task's bounds. The noise of
    a world depends on its seed and seat alone.

    Attributes:
        inner: the limited agent.
    """

    def __init__(self, inner: Agent, limits: HumanLimits, task: PairTask):
        """
        Args:
            task: gives the steps per second and the size of an action.
        """
        self.name = inner.name
        self.inner = inner
        self._limits = limits
        self._size = len(task.spec.action)
        self._delay = round(limits.delay_s * task.spec.record_hz)
        self._decay = math.exp(-1 / (NOISE_S * task.spec.record_hz))

    def begin(self, seat: int, starts: Sequence[EpisodeStart]) -> None:
        """Fills the delay with the initial states."""
        states = np.array([start.state for start in starts])
        self._states = deque([states] * (self._delay + 1), self._delay + 1)  # (worlds, n) each, oldest first
        still = np.zeros((len(starts), 2 * self._size))
        self._joint_actions = deque([still] * (self._delay + 1), self._delay + 1)
        self._rngs = [np.random.default_rng([start.seed, seat, _STREAM]) for start in starts]
        self._noise = np.array([rng.standard_normal(self._size) for rng in self._rngs])
        self.inner.begin(seat, starts)

    def act(self, states: Array, worlds: Array) -> Array:
        """The inner agent's action on the delayed states, with noise."""
        newest = self._states[-1].copy()
        newest[worlds] = states
        self._states.append(newest)
        actions = self.inner.act(self._states[0][worlds], worlds)
        if self._limits.noise == 0:
            return actions
        drawn = np.array([self._rngs[index].standard_normal(self._size) for index in worlds])
        noise = self._decay * self._noise[worlds] + math.sqrt(1 - self._decay**2) * drawn
        self._noise[worlds] = noise
        length = np.linalg.norm(actions, axis=1, keepdims=True)
        return actions + self._limits.noise * length * noise

    def acted(self, actions: Array, worlds: Array) -> None:
        """Passes on the delayed joint actions."""
        newest = np.zeros_like(self._joint_actions[-1])
        newest[worlds] = actions
        self._joint_actions.append(newest)
        self.inner.acted(self._joint_actions[0][worlds], worlds)

    def close(self) -> None:
        """Closes the inner agent."""
        self.inner.close()
