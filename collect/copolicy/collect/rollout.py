"""Worlds that two agents act in, step by step: what play, simulation, studies and the check of a recording share."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from copolicy.dataset.recording.messages.copolicy_pb2 import PlayerInput
from copolicy.dataset.task import RUNNING, Outcome, PairTask, World


class EpisodeStart(NamedTuple):
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

    def begin(self, seat: int, starts: Sequence[EpisodeStart]) -> None:  # noqa: B027 (nothing to prepare is the usual case)
        """Episodes begin side by side, one in each world; seat 0 is the robot's."""

    @abstractmethod
    def act(self, states: np.ndarray, worlds: np.ndarray) -> np.ndarray:
        """Actions `(B, m)` in the states `(B, n)` of a step."""

    def acted(self, actions: np.ndarray, worlds: np.ndarray) -> None:  # noqa: B027
        """The joint actions `(B, 2 m)` that acted in this step."""

    def close(self) -> None:  # noqa: B027
        """The agent is needed no more."""


class Observer(Protocol):
    """Whoever looks on: records, measures, draws, keeps the time."""

    def step(self, rollout: "Rollout", actions: np.ndarray, worlds: np.ndarray) -> None:
        """A step was made: joint actions `(B, 2 m)` in the worlds of these indices `(B,)`."""
        ...


class Rollout:
    """Steps worlds at the task's rate until each has come to its end.

    In every step both agents see the same states, and their actions are clipped to the task's bounds.

    Attributes:
        task: of the worlds.
        worlds: all of them.
        outcomes: how each stands.
        ends: steps after which each ended.
        running: indices of those that still run.
        agents: at the robot's seat and at the human's.
        observers: who look on, told after each step.
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
            seeds: one a world, told to both agents; zeros if empty.
            settings: of the worlds; the task's usual ones if None.
            worlds: in the states that they start in; made from the scenarios if empty.
            begin: tell the agents that episodes begin; False where they know what was before.
            beyond_end: worlds go on after their end, of which the first counts.
        """
        self.task = task
        self.worlds = list(worlds) or [task.make_world(scenario, settings) for scenario in scenarios]
        self.agents = agents
        self.outcomes: list[Outcome] = [RUNNING] * len(self.worlds)
        self.ends = [0] * len(self.worlds)
        self.running = np.arange(len(self.worlds))
        self.observers: list[Observer] = []
        self._beyond_end = beyond_end
        self._bounds = task.spec.joint_action.bounds
        self.actions = np.zeros((0, self._bounds.shape[1]))
        if begin:
            seeds = seeds or [0] * len(self.worlds)
            starts = [
                EpisodeStart(scenario, seed, world.observation)
                for scenario, seed, world in zip(scenarios, seeds, self.worlds, strict=True)
            ]
            for seat, agent in enumerate(agents):
                agent.begin(seat, starts)

    def step(self) -> None:
        """One step of every world that runs."""
        worlds = self.running
        states = np.array([self.worlds[index].observation for index in worlds])
        chosen = [agent.act(states, worlds) for agent in self.agents]
        self.actions = actions = np.clip(np.concatenate(chosen, axis=1), *self._bounds)
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
