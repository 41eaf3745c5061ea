"""The loop: any number of worlds side by side, two agents, and observers."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from copolicy.dataset.task import RUNNING, Outcome, PairTask, World

from .agent import Agent, Start


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
                Start(scenario, seed, world.observation)
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
