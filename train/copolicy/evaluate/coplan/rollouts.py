"""The paper's co-planning study: both players act on one sampled plan, on every map of a set at once.

Protocol (paper, section V-A): from the last To observations a joint plan is sampled, its first actions are executed,
then the next plan is sampled. A plan lives at the data set's rate, so each of its actions is held for record_hz / fps
steps of the world (the original program's evaluation skips that hold and plays a 10 Hz plan three times too fast).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from copolicy.collect.agents import Policy, PolicyAgent
from copolicy.collect.rollout import Rollout, Trace
from copolicy.dataset.task import PairTask, get_task


@dataclass(frozen=True)
class Outcome:
    """One episode of a study.

    Attributes:
        path: `(steps + 1, 2)` of the point that the task follows, in the unit of its outline; None: it has none.
        interaction: `(steps,)` the task's interaction measure; None: it has none.
        task: that it is of.
    """

    map_index: int
    map_config: Any
    repeat: int
    success: bool
    reason: str
    plans: int
    path: np.ndarray | None
    interaction: np.ndarray | None
    task: PairTask = field(default_factory=get_task, kw_only=True, repr=False)
    end: int | None = field(default=None, kw_only=True, repr=False)

    @property
    def steps(self) -> int:
        """Steps of the world."""
        return len(self.interaction) if self.end is None and self.interaction is not None else int(self.end or 0)

    def to_json(self) -> dict:
        """The row of `eval.json`."""
        return {
            "map_index": self.map_index,
            "map_id": self.task.identify(self.map_config)[0],
            **self.task.studies.factors(self.map_config),
            "repeat": self.repeat,
            "success": self.success,
            "reason": self.reason,
            "steps": self.steps,
            "time_s": self.steps / self.task.spec.record_hz,
            "plans": self.plans,
            **interaction_columns(self.interaction),
        }


def interaction_columns(interaction: np.ndarray | None) -> dict[str, float | None]:
    """The columns of an episode's row with its interaction `(T,)`; null where the task does not measure it."""
    size = None if interaction is None else np.abs(interaction)
    return {
        "interaction_mean": None if size is None else float(size.mean()),
        "interaction_p95": None if size is None else float(np.quantile(size, 0.95)),
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
    agent = PolicyAgent(policy, get_task(policy.task), fps=fps, seed=seed)
    rollout = together(agent, [config for _, config, _ in episodes], physics)
    trace = traced_to_the_end(rollout, on_step)
    return [
        Outcome(*episode, *measured(rollout, trace, agent, k), task=rollout.task, end=rollout.ends[k])
        for k, episode in enumerate(episodes)
    ]


def together(agent: PolicyAgent, maps: Sequence[Any], physics: Any) -> Rollout:
    """A rollout at the start of maps in which both players act on the agent's chunks."""
    return Rollout(agent.task, maps, (agent, agent.human_half()), settings=physics)


def traced_to_the_end(rollout: Rollout, on_step: Callable[[int], object]) -> Trace:
    """Steps until every world has ended; `on_step` is called after each step with the number of those that have."""
    trace = Trace(rollout)
    while len(rollout.running):
        rollout.step()
        on_step(len(rollout.worlds) - len(rollout.running))
    return trace


def measured(
    rollout: Rollout, trace: Trace, agent: Any, index: int
) -> tuple[bool, str, int, np.ndarray | None, np.ndarray | None]:
    """The five fields of the `Outcome` of a world from `success` on."""
    end, states = rollout.outcomes[index], trace.states(index)
    interaction = rollout.task.interaction_recorded(states[1:], trace.actions(index))
    chunks = int(agent.chunks[index]) if isinstance(agent, PolicyAgent) else 0
    return end.success, end.reason, chunks, _followed(rollout.task, states), interaction


def _followed(task: PairTask, recorded: np.ndarray) -> np.ndarray | None:
    """`(T, 2)` the point that a task follows in recorded states, else the middle of the body of its outline."""
    states = task.states_of(recorded)
    path = task.path(states)
    return path if path is not None or task.outline is None else task.outline.poses(states)[:, :2]
