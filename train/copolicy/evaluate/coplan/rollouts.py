"""The paper's co-planning study: both players act on one sampled plan, on every map of a set at once.

Protocol (paper, section V-A): from the last To observations a joint plan is sampled, its first actions are executed,
then the next plan is sampled. A plan lives at the data set's rate, so each of its actions is held for 30 / fps steps
of the world (the original program's evaluation skips that hold and plays a 10 Hz plan three times too fast).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from copolicy.collect.agents import Policy, PolicyAgent
from copolicy.collect.rollout import Rollout, Trace
from copolicy.dataset.task import get_task
from copolicy.dataset.task_spec import RECORD_HZ
from copolicy.tasks.table.interaction import interaction_force


@dataclass(frozen=True)
class Outcome:
    """One episode of a study.

    Attributes:
        path: `(steps + 1, 2)` the table's centre, px.
        interaction: `(steps,)` interaction force, units of a player's full force.
    """

    map_index: int
    map_config: Any
    repeat: int
    success: bool
    reason: str
    plans: int
    path: np.ndarray
    interaction: np.ndarray

    @property
    def steps(self) -> int:
        """Steps of 1/30 s."""
        return len(self.interaction)

    def to_json(self) -> dict:
        """The row of `eval.json`."""
        size = np.abs(self.interaction)
        return {
            "map_index": self.map_index,
            "map_id": get_task().identify(self.map_config)[0],
            "start_theta": self.map_config.start[2],
            "obstacles": len(self.map_config.obstacles),
            "repeat": self.repeat,
            "success": self.success,
            "reason": self.reason,
            "steps": self.steps,
            "time_s": self.steps / RECORD_HZ,
            "plans": self.plans,
            "interaction_mean": float(size.mean()),
            "interaction_p95": float(np.quantile(size, 0.95)),
        }


def coplan(
    policy: Policy,
    maps: Sequence[Any],
    physics: Any,
    *,
    repeats: int = 1,
    fps: int | None = None,
    seed: int = 0,
    on_step: Callable[[int], object] = lambda finished: None,
) -> list[Outcome]:
    """Runs every map `repeats` times, all of them through one call of the policy a plan.

    Args:
        policy: whose `n_action_steps` are executed of each action chunk.
        fps: rate at which its actions are held; that of the data set that it was trained on if None.
        on_step: called after each step with the number of finished episodes.

    Returns:
        One outcome for each map and repeat, in that order.
    """
    episodes = [(index, config, repeat) for index, config in enumerate(maps) for repeat in range(repeats)]
    agent = PolicyAgent(policy, get_task(), fps=fps, seed=seed)
    rollout = together(agent, [config for _, config, _ in episodes], physics)
    trace = Trace(rollout)
    while len(rollout.running):
        rollout.step()
        on_step(len(episodes) - len(rollout.running))
    return [Outcome(*episode, *measured(rollout, trace, agent, k)) for k, episode in enumerate(episodes)]


def together(agent: PolicyAgent, maps: Sequence[Any], physics: Any) -> Rollout:
    """A rollout at the start of maps in which both players act on the agent's chunks."""
    return Rollout(get_task(), maps, (agent, agent.other_half()), settings=physics)


def measured(rollout: Rollout, trace: Trace, agent: Any, index: int) -> tuple[bool, str, int, np.ndarray, np.ndarray]:
    """The last five fields of the `Outcome` of a world."""
    end, states = rollout.outcomes[index], trace.states(index)
    force = interaction_force(states[1:, 2], trace.actions(index))
    chunks = int(agent.chunks[index]) if isinstance(agent, PolicyAgent) else 0
    return end.success, end.reason, chunks, states[:, :2], force
