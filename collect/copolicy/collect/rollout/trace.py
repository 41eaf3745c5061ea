"""What happened in each world of a rollout, step by step."""

import numpy as np

from .rollout import Rollout


class Trace:
    """Keeps the states and joint actions of a rollout's worlds from now on."""

    def __init__(self, rollout: Rollout, before: "Trace | None" = None):
        """
        Args:
            before: of the one world whose present state all of these start in.
        """
        self._states = [[*before._states[0]] if before else [world.recorded] for world in rollout.worlds]
        self._actions = [[*before._actions[0]] if before else [] for _ in rollout.worlds]
        rollout.observers.append(self)

    def step(self, rollout: Rollout, actions: np.ndarray, worlds: np.ndarray) -> None:
        """See `Observer`."""
        for index, action in zip(worlds.tolist(), actions, strict=True):
            self._states[index].append(rollout.worlds[index].recorded)
            self._actions[index].append(action)

    def states(self, world: int) -> np.ndarray:
        """`(T + 1, k)` recorded states, the first before the first step."""
        return np.array(self._states[world])

    def actions(self, world: int) -> np.ndarray:
        """`(T, 2 m)` joint actions as they acted."""
        return np.array(self._actions[world])
