"""Whoever acts at one seat: a person, a scripted player, an earlier recording, a policy."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from copolicy.dataset.recording.messages.copolicy_pb2 import PlayerInput


class Start(NamedTuple):
    """What an agent is told before an episode.

    Attributes:
        scenario: of the task.
        seed: of whatever the agent draws at random.
        state: `(n,)` that the world starts in.
    """

    scenario: Any
    seed: int
    state: np.ndarray


class Agent(ABC):
    """Acts for one seat in many worlds at once.

    A rollout calls `begin` once, then in every step `act` and, once the joint action has acted, `acted`. `worlds` are
    the indices `(B,)` of the worlds that still run, and `states` are theirs. m is the size of one player's action.

    Attributes:
        name: what the recording's column `controller_0` or `controller_1` says.
        is_person: a person acts, so there is a device to lose and a consent to ask for.
        input: what there is to record about where the present action came from, for the agent of a single world.
    """

    name: str
    is_person: bool = False
    input: PlayerInput | None = None

    def begin(self, seat: int, starts: Sequence[Start]) -> None:  # noqa: B027 (nothing to prepare is the usual case)
        """Episodes begin side by side, one in each world; seat 0 is the robot's."""

    @abstractmethod
    def act(self, states: np.ndarray, worlds: np.ndarray) -> np.ndarray:
        """Actions `(B, m)` in the states `(B, n)` of a step."""

    def acted(self, actions: np.ndarray, worlds: np.ndarray) -> None:  # noqa: B027
        """The joint actions `(B, 2 m)` that acted in this step."""

    def close(self) -> None:  # noqa: B027
        """The agent is needed no more."""
