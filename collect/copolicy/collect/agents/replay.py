"""One player of an earlier recording, force by force."""

from pathlib import Path

import numpy as np

from copolicy.dataset.recording.log import read_episode
from copolicy.tasks.table.map_config import MapConfig

from .controller import ZERO, Reading


class ReplayController:
    """Repeats the forces of the seat it is put on, whatever the table does; none after their end.

    Attributes:
        map_config: the recording's map, on which alone this makes sense.
        physics: what led from state to state in the recording.
    """

    is_person = False

    def __init__(self, path: Path):
        """
        Raises:
            FileFormatError: the file is no recording of this task.
        """
        episode = read_episode(path)
        self.name = f"replay:{path.stem}"
        self.map_config = episode.map_config
        self.physics = episode.physics
        self._actions = episode.actions
        self._seat = 0
        self._step = 0

    def begin(self, seat: int, map_config: MapConfig, seed: int) -> None:
        """Starts over."""
        self._seat, self._step = seat, 0

    def read(self, state: np.ndarray) -> Reading:
        """The recorded force of this step."""
        if self._step >= len(self._actions):
            return Reading(ZERO, None)
        x, y = self._actions[self._step, 2 * self._seat : 2 * self._seat + 2].tolist()
        return Reading((x, y), None)

    def executed(self, action: np.ndarray) -> None:
        """One step further."""
        self._step += 1

    def close(self) -> None:
        """Nothing is open."""
