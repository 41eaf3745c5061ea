"""The messages of a recording that depend on the task: states, actions, measures and the scene."""

import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

from .topics import EVENT, INPUTS, LOOP_TIMING, Record, Topic

SceneWriter = Callable[[int, Sequence[float], Sequence[float]], list[Record]]
"""Makes the scene records from a time (ns), a recorded state and the joint action applied in it."""


class TaskMessages(ABC):
    """Encoding of a task's recordings.

    Attributes:
        scenario_file: name of the attachment with the scenario.
        state: topic of the states.
        actions: topic of each player's actions.
        measures: topic of the reward after a step and, if measured, the interaction.
        scene: topics of the scene, for viewers only.
    """

    scenario_file: str = "scenario.json"
    state: Topic
    actions: tuple[Topic, Topic]
    measures: Topic
    scene: tuple[Topic, ...] = ()

    @functools.cached_property
    def topics(self) -> tuple[Topic, ...]:
        """All topics of a recording, in the order of its channels."""
        return (self.state, *INPUTS, *self.actions, self.measures, LOOP_TIMING, EVENT, *self.scene)

    @abstractmethod
    def encode_state(self, step: int, recorded: Sequence[float], monotonic_ns: int) -> bytes:
        """The message of the state at the start of a step."""

    @abstractmethod
    def decode_state(self, payload: bytes) -> tuple[int, Sequence[float]]:
        """Step and recorded state of a message."""

    @abstractmethod
    def encode_action(self, step: int, action: Sequence[float]) -> bytes:
        """The message of one player's action."""

    @abstractmethod
    def decode_action(self, payload: bytes) -> tuple[int, Sequence[float]]:
        """Step and action of a message."""

    @abstractmethod
    def encode_measures(self, step: int, recorded: Sequence[float], action: Sequence[float], reward: float) -> bytes:
        """The message after a step: `recorded` is the state after the joint action `action`."""

    @abstractmethod
    def decode_reward(self, payload: bytes) -> float:
        """The reward of a message of `measures`."""

    def scenario_records(self, scenario: Any, time_ns: int) -> list[Record]:
        """Records of the fixed parts of the scene, written once."""
        return []

    def scene_writer(self) -> SceneWriter:
        """A function that makes the records of the moving parts of the scene, called in each step."""
        return lambda time_ns, recorded, action: []
