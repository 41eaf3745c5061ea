"""Whoever holds one end of the table during an episode."""

from typing import NamedTuple, Protocol

import numpy as np

from copolicy.dataset.recording.messages.copolicy_pb2 import PlayerInput
from copolicy.tasks.table.map_config import MapConfig


class Reading(NamedTuple):
    """The force that a controller wants in a step, and what there is to record about where it came from."""

    force: tuple[float, float]
    message: PlayerInput | None


ZERO = (0.0, 0.0)


class Controller(Protocol):
    """One player's hand.

    Attributes:
        name: what the recording's column `controller_0` or `controller_1` says.
        is_person: a person acts, so there is a device to lose and a consent to ask for.
    """

    name: str
    is_person: bool

    def begin(self, seat: int, map_config: MapConfig, seed: int) -> None:
        """An episode begins; the table rests at the map's start."""
        ...

    def read(self, state: np.ndarray) -> Reading:
        """The force in a state `(7,)`; called once a step, right after the event queue was pumped."""
        ...

    def executed(self, action: np.ndarray) -> None:
        """The action `(4,)` that acted in this step, of both players."""
        ...

    def close(self) -> None:
        """The session is over."""
        ...
