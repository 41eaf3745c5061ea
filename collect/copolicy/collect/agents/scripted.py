"""Simulated players at a seat, one for each world."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from copolicy.dataset.task import PairTask, Player, get_task

from ..rollout import Agent, Start
from .simulated import simulated_players


class ScriptedAgent(Agent):
    """A player of the task's own (`PairTask.agents`) in each world.

    Attributes:
        players: one a world, since the episodes began.
    """

    def __init__(self, name: str, make: Callable[[int, int, Start], Player]):
        """
        Args:
            make: the player of a seat, for the world of an index and its start.
        """
        self.name = name
        self.players: list[Player] = []
        self._make = make

    @classmethod
    def of_pair(cls, pair: str, task: PairTask | None = None, **options: Any) -> "ScriptedAgent":
        """A player with the profile that a simulated pair has at the seat.

        Args:
            options: the task's own, see `SimulatedPlayers.make_pair`.

        Raises:
            CopolicyError: the task has no simulated players.
        """
        agents = simulated_players(task or get_task())

        def make(seat: int, index: int, start: Start) -> Player:
            return agents.make_pair(start.scenario, pair, start.seed, **options)[seat]

        return cls(f"scripted:{pair}", make)

    def begin(self, seat: int, starts: Sequence[Start]) -> None:
        """Makes fresh players."""
        self.players = [self._make(seat, index, start) for index, start in enumerate(starts)]

    def act(self, states: np.ndarray, worlds: np.ndarray) -> np.ndarray:
        """Asks each player."""
        return np.array([self.players[index].act(state) for index, state in zip(worlds, states, strict=True)])
