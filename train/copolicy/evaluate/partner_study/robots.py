"""Who holds the robot's end in a study: a policy, or one of the floors that a policy has to beat."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from copolicy.collect.agents import ConstantAgent, PolicyAgent, ScriptedAgent
from copolicy.collect.agents.simulated_players import simulated_players
from copolicy.collect.rollout import Agent, EpisodeStart
from copolicy.dataset.task import PairTask, Player, get_task

if TYPE_CHECKING:
    from copolicy.train.checkpoint import Checkpoint

PASSIVE = "passive"


@dataclass(frozen=True)
class Robot:
    """A robot of a study.

    Attributes:
        name: in results.
        agent: that acts for it, from the seed of its random numbers and the frames a second of a policy.
        describe: what it is, for the result.
        policy: behind it; None for a scripted one.
    """

    name: str
    agent: Callable[[int, int], Agent]
    describe: Callable[[], Mapping[str, Any]]
    policy: "Checkpoint | None" = None


def policy_robot(name: str, policy: "Checkpoint") -> Robot:
    """The robot's half of a policy's joint action chunks."""
    task = get_task(policy.task)
    return Robot(name, lambda seed, fps: PolicyAgent(policy, task, fps=fps, seed=seed), policy.describe, policy)


def scripted_robots(task: PairTask) -> dict[str, Robot]:
    """Robots that `--baseline` knows by name: zero force, and the task's own."""
    zero = np.zeros(len(task.spec.action))
    passive = Robot(
        PASSIVE, lambda seed, fps: ConstantAgent(zero, PASSIVE), lambda: {"type": PASSIVE, "description": "zero force"}
    )
    names = task.agents.robots if task.agents is not None else ()
    return {PASSIVE: passive, **{name: _scripted(task, name) for name in names}}


def _scripted(task: PairTask, name: str) -> Robot:
    players = simulated_players(task)
    profile, description = players.robots[name]

    def agent(seed: int, fps: int) -> Agent:
        def make(seat: int, index: int, start: EpisodeStart) -> Player:
            # Random numbers apart from the partner's.
            own = np.random.SeedSequence([start.seed, seed, 0]).generate_state(1)[0]
            return players.make_robot(start.scenario, name, int(own))

        return ScriptedAgent(name, make)

    return Robot(name, agent, lambda: {"type": "scripted", "description": description, "habits": asdict(profile)})
