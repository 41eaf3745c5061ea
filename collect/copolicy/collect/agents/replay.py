"""Agents with given actions: from an earlier recording, or set by the caller."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.task import PairTask, get_task

from ..rollout import Agent, EpisodeStart


class RecordedAgent(Agent):
    """Repeats its seat's half of recorded joint actions without feedback; zero after their end."""

    def __init__(self, actions: Sequence[Array], name: str = "recorded"):
        """
        Args:
            actions: `(T, 2 m)` of each world.
        """
        self.name = name
        self._actions = actions

    def begin(self, seat: int, starts: Sequence[EpisodeStart]) -> None:
        """Starts from the first action."""
        self._step = 0
        size = self._actions[0].shape[1] // 2
        self._own_actions = [actions[:, seat * size : (seat + 1) * size] for actions in self._actions]
        self._zero = np.zeros(size)

    def act(self, states: Array, worlds: Array) -> Array:
        """The actions of this step."""
        step, self._step = self._step, self._step + 1
        own_actions = [self._own_actions[index] for index in worlds]
        return np.array([actions[step] if step < len(actions) else self._zero for actions in own_actions])


class ReplayAgent(RecordedAgent):
    """One player of an earlier recording.

    Attributes:
        scenario: of the recording; the actions are meaningful in this scenario only.
        settings: of the recorded world.
    """

    def __init__(self, path: Path, task: PairTask | None = None):
        """
        Args:
            task: the table if None.

        Raises:
            FileFormatError: the file is no recording of this task.
        """
        episode, name = read_episode(path), (task or get_task()).spec.name
        if episode.task != name:
            raise FileFormatError(path, f"a recording of the task {name!r}", f"one of {episode.task!r}")
        super().__init__((episode.actions,), f"replay:{path.stem}")
        self.scenario = episode.scenario
        self.settings = episode.settings


class ConstantAgent(Agent):
    """Repeats one action in every world; the caller may set another one at any time.

    Attributes:
        action: `(m,)`.
    """

    def __init__(self, action: Array, name: str = "held"):
        self.name = name
        self.action = action

    def act(self, states: Array, worlds: Array) -> Array:
        """The action."""
        return np.tile(self.action, (len(worlds), 1))
