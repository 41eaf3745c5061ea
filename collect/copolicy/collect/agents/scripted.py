"""A simulated player at the table, in real time."""

import numpy as np

from copolicy.tasks.table.agents import ScriptedPilot, simulated_pair
from copolicy.tasks.table.map_config import MapConfig

from .controller import ZERO, Reading


class ScriptedController:
    """A `ScriptedPilot` with the habits of one of the simulated pairs."""

    is_person = False

    def __init__(self, pair: str):
        self.name = f"scripted:{pair}"
        self._pair = pair
        self._pilot: ScriptedPilot | None = None

    def begin(self, seat: int, map_config: MapConfig, seed: int) -> None:
        """Makes a fresh mind for the seat and the map."""
        self._pilot = simulated_pair(map_config, self._pair, seed)[seat]

    def read(self, state: np.ndarray) -> Reading:
        """Asks the pilot."""
        if self._pilot is None:
            return Reading(ZERO, None)
        x, y = self._pilot.act(state).tolist()
        return Reading((x, y), None)

    def executed(self, action: np.ndarray) -> None:
        """The pilot knows only how the table moves."""

    def close(self) -> None:
        """Nothing is open."""
