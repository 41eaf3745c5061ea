"""The past frames of worlds as a policy observes them."""

import copy
from collections.abc import Sequence

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.clock import frame_actions, stride
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.task import PairTask

from ..rollout import EpisodeStart


class FrameHistory:
    """States and the partner's actions of the last frames, on the grid of frames that the policy learned from.

    At the human's seat a policy observes the world with exchanged seats, if the task has `PairTask.exchange`.

    Attributes:
        exchange: exchange of the seats; None if the policy observes the world as it is.
        stride: steps in a frame.
    """

    def __init__(self, task: PairTask, seat: int, starts: Sequence[EpisodeStart], frames: int, fps: int):
        """
        Args:
            seat: of the policy; 0 is the robot's.
            frames: in an observation.
            fps: frames a second.
        """
        spec = task.spec
        self._rate, self._record_hz, self._size = fps, spec.record_hz, len(spec.action)
        self.stride = stride(fps, spec.record_hz)
        self.exchange = task.exchange if seat == 1 else None
        scenarios, states = [start.scenario for start in starts], np.array([start.state for start in starts])
        if self.exchange is not None:
            scenarios = [self.exchange.scenario(scenario) for scenario in scenarios]
            states = self.exchange.states(states)
        self._scenarios = np.array([task.scenario_vector(scenario) for scenario in scenarios])
        # The first observation is repeated before the start, like the padding in training.
        self._states = np.repeat(states[:, None], frames, axis=1)  # (worlds, n_obs_steps, n)
        self._partner_actions = np.zeros((len(starts), frames, self._size))
        self._step_actions: list[Array] = []  # joint actions (worlds, 2 m) of the steps of this frame

    def __len__(self) -> int:
        """Number of worlds."""
        return len(self._states)

    def observations(self, worlds: Array) -> dict[str, Array]:
        """The observations `(B, frames, n)` of worlds."""
        return {
            STATE: self._states[worlds],
            ENVIRONMENT_STATE: np.repeat(self._scenarios[worlds, None], self._states.shape[1], axis=1),
            HUMAN_ACTION: self._partner_actions[worlds],
        }

    def acted(self, actions: Array, worlds: Array) -> None:
        """Adds the joint actions `(B, 2 m)` of a step to the present frame."""
        joint = np.zeros((len(self), 2 * self._size))
        joint[worlds] = actions
        self._step_actions.append(joint)

    def observe(self, states: Array, worlds: Array) -> None:
        """Begins a frame in states `(B, n)`; the partner's action is that of the steps of the frame before."""
        steps = np.array(self._step_actions)  # (stride, worlds, 2 m)
        joint = frame_actions(steps.reshape(len(steps), -1), self._rate, record_hz=self._record_hz)[0]
        mean = joint.reshape(steps.shape[1:])[worlds]
        self._step_actions = []
        if self.exchange is not None:
            states, mean = self.exchange.states(states), self.exchange.actions(mean)
        for history, newest in ((self._states, states), (self._partner_actions, mean[:, self._size :])):
            history[worlds] = np.concatenate((history[worlds, 1:], newest[:, None]), axis=1)

    def repeated(self, count: int) -> "FrameHistory":
        """The history of `count` copies of each world."""
        repeated = copy.copy(self)
        for name in ("_scenarios", "_states", "_partner_actions"):
            setattr(repeated, name, np.repeat(getattr(self, name), count, axis=0))
        repeated._step_actions = [np.repeat(actions, count, axis=0) for actions in self._step_actions]
        return repeated
