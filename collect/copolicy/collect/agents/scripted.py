"""Scripted players of a task as an agent, one for each world."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.task import PairTask, Player, get_task

from ..rollout import Agent, EpisodeStart
from .simulated_players import simulated_players


class ScriptedAgent(Agent):
    """Acts by a scripted player of the task (`PairTask.agents`) in each world.

    Attributes:
        players: of the present episodes, one for each world.
    """

    def __init__(self, name: str, make: Callable[[int, int, EpisodeStart], Player]):
        """
        Args:
            make: makes the player of a seat, from the seat, the index of the world and its start.
        """
        self.name = name
        self.players: list[Player] = []
        self._make = make

    @classmethod
    def from_pair(cls, pair: str, task: PairTask | None = None, **options: Any) -> "ScriptedAgent":
        """Acts by the player of a simulated pair at the agent's seat.

        Args:
            options: of the task, see `SimulatedPlayers.make_pair`.

        Raises:
            CopolicyError: the task has no simulated players.
        """
        agents = simulated_players(task or get_task())

        def make(seat: int, index: int, start: EpisodeStart) -> Player:
            return agents.make_pair(start.scenario, pair, start.seed, **options)[seat]

        return cls(f"scripted:{pair}", make)

    def begin(self, seat: int, starts: Sequence[EpisodeStart]) -> None:
        """Makes new players."""
        self.players = [self._make(seat, index, start) for index, start in enumerate(starts)]

    def act(self, states: Array, worlds: Array) -> Array:
        """The actions of the players."""
        return np.array([self.players[index].act(state) for index, state in zip(worlds, states, strict=True)])
