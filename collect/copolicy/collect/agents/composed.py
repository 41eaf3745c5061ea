"""Agents made of others or of chance: different agents in different worlds, and uniformly random actions."""

from collections.abc import Sequence

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.task_spec import Vector

from ..rollout import Agent, EpisodeStart


class AgentsByWorld(Agent):
    """Several agents of one rollout, each of which acts in its own worlds.

    Attributes:
        agents: the agents.
        owners: `(worlds,)` index of the agent of each world.
        local: `(worlds,)` index of each world among those of its agent.
    """

    def __init__(self, agents: Sequence[Agent], owners: Sequence[int], name: str = "several"):
        self.name = name
        self.agents = list(agents)
        self.owners: Array = np.array(owners, int)
        self.local: Array = np.zeros(len(self.owners), int)
        for index in range(len(self.agents)):
            own = self.owners == index
            self.local[own] = np.arange(own.sum())

    def begin(self, seat: int, starts: Sequence[EpisodeStart]) -> None:
        """Prepares each agent for its worlds."""
        for index, agent in enumerate(self.agents):
            own = np.flatnonzero(self.owners == index)
            if len(own):
                agent.begin(seat, [starts[world] for world in own])

    def act(self, states: Array, worlds: Array) -> Array:
        """The action of each world's agent."""
        parts: list[tuple[Array, Array]] = []
        for index, own in self._parts(worlds):
            parts.append((own, self.agents[index].act(states[own], self.local[worlds[own]])))
        actions = np.zeros((len(worlds), parts[0][1].shape[1]))
        for own, part in parts:
            actions[own] = part
        return actions

    def acted(self, actions: Array, worlds: Array) -> None:
        """Tells each agent the joint actions of its worlds."""
        for index, own in self._parts(worlds):
            self.agents[index].acted(actions[own], self.local[worlds[own]])

    def close(self) -> None:
        """Closes the agents."""
        for agent in self.agents:
            agent.close()

    def _parts(self, worlds: Array) -> list[tuple[int, Array]]:
        owners = self.owners[worlds]
        return [(int(index), owners == index) for index in np.unique(owners)]


class RandomAgent(Agent):
    """Uniformly random actions within the task's bounds, each held for some steps; each world has its own seed."""

    def __init__(self, action: Vector, hold: int, seed: int = 0, name: str = "random"):
        """
        Args:
            action: vector of one player's action.
            hold: steps for which an action is held, at least 1.
            seed: added to the seed of each world.
        """
        self.name = name
        self._low, self._high = action.bounds
        self._hold, self._seed = hold, seed

    def begin(self, seat: int, starts: Sequence[EpisodeStart]) -> None:
        """Seeds the random numbers."""
        self._rngs = [np.random.default_rng([start.seed, self._seed, seat]) for start in starts]
        self._actions = np.zeros((len(starts), len(self._low)))
        self._step = 0

    def act(self, states: Array, worlds: Array) -> Array:
        """The held actions."""
        if self._step % self._hold == 0:
            self._actions[worlds] = [self._rngs[index].uniform(self._low, self._high) for index in worlds]
        self._step += 1
        return self._actions[worlds]
