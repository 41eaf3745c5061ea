"""Rollouts: two agents act in worlds, step by step. Used by play, simulation, studies and the check of recordings."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.recording.messages.copolicy_pb2 import PlayerInput
from copolicy.dataset.task import RUNNING, Outcome, PairTask, World


class EpisodeStart(NamedTuple):
    """The start of an episode, as agents get it.

    Attributes:
        scenario: of the task.
        seed: of the agent's random numbers.
        state: `(n,)` initial state of the world.
    """

    scenario: Any
    seed: int
    state: Array


class Agent(ABC):
    """Acts at one seat in many worlds at once.

    A rollout calls `begin` once, then in every step `act` and, after the step, `acted`. `worlds` are the indices `(B,)`
    of the worlds that still run, and `states` are their states. m is the size of one player's action.

    Attributes:
        name: the value of the column `controller_0` or `controller_1` in recordings.
        is_person: a person acts, with a device that can be unplugged and a consent to record.
        input: device input behind the present action, for recordings; only for the agent of a single world.
    """

    name: str
    is_person: bool = False
    input: PlayerInput | None = None

    def begin(self, seat: int, starts: Sequence[EpisodeStart]) -> None:  # noqa: B027 (nothing to prepare is the usual case)
        """Prepares for one episode in each world; seat 0 is the robot's."""

    @abstractmethod
    def act(self, states: Array, worlds: Array) -> Array:
        """Returns actions `(B, m)` in the states `(B, n)` of a step."""

    def acted(self, actions: Array, worlds: Array) -> None:  # noqa: B027
        """Receives the joint actions `(B, 2 m)` of both players in this step."""

    def close(self) -> None:  # noqa: B027
        """Releases resources, after the last episode."""


class Observer(Protocol):
    """Observes a rollout after each step, to record, measure, draw or keep time."""

    def step(self, rollout: "Rollout", actions: Array, worlds: Array) -> None:
        """Called after a step with the joint actions `(B, 2 m)` and the indices `(B,)` of their worlds."""
        ...


class Rollout:
    """Steps worlds at the task's rate until each episode has ended.

    In every step both agents observe the same states, and their actions are clipped to the task's bounds.

    Attributes:
        task: of the worlds.
        worlds: all worlds.
        outcomes: of each world.
        ends: number of steps after which each world ended.
        running: indices of the worlds that still run.
        agents: at the robot's seat and at the human's.
        observers: called after each step.
        actions: `(B, 2 m)` joint actions of the last step.
    """

    def __init__(
        self,
        task: PairTask,
        scenarios: Sequence[Any],
        agents: tuple[Agent, Agent],
        *,
        seeds: Sequence[int] = (),
        settings: Any = None,
        worlds: Sequence[World] = (),
        begin: bool = True,
        beyond_end: bool = False,
    ):
        """
        Args:
            scenarios: one a world.
            seeds: one a world, for both agents; zeros if empty.
            settings: of the worlds; the task's defaults if None.
            worlds: in their initial states; made from the scenarios if empty.
            begin: call `Agent.begin`; False for agents that continue an episode.
            beyond_end: continue to step worlds after their end; the first end is the outcome.
        """
        self.task = task
        self.worlds: list[World] = list(worlds) or [task.make_world(scenario, settings) for scenario in scenarios]
        self.agents = agents
        self.outcomes: list[Outcome] = [RUNNING] * len(self.worlds)
        self.ends: list[int] = [0] * len(self.worlds)
        self.running: Array = np.arange(len(self.worlds))
        self.observers: list[Observer] = []
        self._beyond_end = beyond_end
        self._bounds = task.spec.joint_action.bounds
        self.actions: Array = np.zeros((0, self._bounds.shape[1]))
        if begin:
            seeds = seeds or [0] * len(self.worlds)
            starts = [
                EpisodeStart(scenario, seed, world.observation)
                for scenario, seed, world in zip(scenarios, seeds, self.worlds, strict=True)
            ]
            for seat, agent in enumerate(agents):
                agent.begin(seat, starts)

    def step(self) -> None:
        """Steps every running world once."""
        worlds = self.running
        states = np.array([self.worlds[index].observation for index in worlds])
        actions = np.concatenate([agent.act(states, worlds) for agent in self.agents], axis=1)
        self.actions = actions = np.clip(actions, *self._bounds)
        ended = False
        for index, action in zip(worlds.tolist(), actions, strict=True):
            outcome = self.worlds[index].step(action)
            if outcome.done and not self.outcomes[index].done:
                self.outcomes[index], ended = outcome, True
                self.ends[index] = self.worlds[index].step_count
        for agent in self.agents:
            agent.acted(actions, worlds)
        for observer in self.observers:
            observer.step(self, actions, worlds)
        if ended and not self._beyond_end:
            self.running = np.array([index for index in worlds if not self.outcomes[index].done], int)

    def run(self, steps: int | None = None) -> None:
        """Steps until every world has ended, or for a number of steps."""
        while len(self.running) and steps != 0:
            self.step()
            steps = None if steps is None else steps - 1


class Trace:
    """Stores the states and joint actions of a rollout's worlds from now on."""

    def __init__(self, rollout: Rollout, prefix: "Trace | None" = None):
        """
        Args:
            prefix: trace of the single world whose present state is the initial state of all worlds.
        """
        self._states = [[*prefix._states[0]] if prefix else [world.recorded] for world in rollout.worlds]
        self._actions = [[*prefix._actions[0]] if prefix else [] for _ in rollout.worlds]
        rollout.observers.append(self)

    def step(self, rollout: Rollout, actions: Array, worlds: Array) -> None:
        """See `Observer`."""
        for index, action in zip(worlds.tolist(), actions, strict=True):
            self._states[index].append(rollout.worlds[index].recorded)
            self._actions[index].append(action)

    def states(self, world: int) -> Array:
        """`(T + 1, k)` recorded states of a world, from before the first step."""
        return np.array(self._states[world])

    def actions(self, world: int) -> Array:
        """`(T, 2 m)` joint actions of a world, clipped."""
        return np.array(self._actions[world])
