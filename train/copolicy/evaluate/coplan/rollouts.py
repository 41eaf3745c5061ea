"""The paper's co-planning study: both players execute one sampled action chunk, in all scenarios of a set in parallel.

Protocol (paper, section V-A): a joint action chunk is sampled from the last To observations, its first n_action_steps
actions are executed, then the next chunk is sampled. Chunks have the data set's rate: each action is held for
record_hz / fps steps (the original program's evaluation omits this hold and plays 10 Hz chunks three times too fast).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from copolicy.collect.agents import Policy, PolicyAgent
from copolicy.collect.rollout import Rollout, Trace
from copolicy.dataset.arrays import Array
from copolicy.dataset.task import PairTask, get_task


@dataclass(frozen=True)
class EpisodeResult:
    """Result of one episode of a study.

    Attributes:
        map_index: position of the scenario in the study's list.
        chunks: number of action chunks that were predicted.
        path: `(steps + 1, 2)` of the task's tracked point, in the unit of its outline; None if it has no outline.
        interaction: `(steps,)` the task's interaction measure; None if it has none.
        states: `(steps + 1, n)` states of the world.
        actions: `(steps, 2 m)` executed joint actions, robot first.
    """

    map_index: int
    scenario: Any
    repeat: int
    success: bool
    reason: str
    chunks: int
    path: Array | None
    interaction: Array | None
    task: PairTask = field(default_factory=get_task, kw_only=True, repr=False)
    end: int | None = field(default=None, kw_only=True, repr=False)
    states: Array | None = field(default=None, kw_only=True, repr=False)
    actions: Array | None = field(default=None, kw_only=True, repr=False)

    @property
    def steps(self) -> int:
        """Number of steps of the world."""
        return len(self.interaction) if self.end is None and self.interaction is not None else int(self.end or 0)

    def to_json(self) -> dict[str, Any]:
        """The row of `eval.json`."""
        return {
            "map_index": self.map_index,
            "map_id": self.task.identify(self.scenario)[0],
            **self.task.studies.factors(self.scenario),
            "repeat": self.repeat,
            "success": self.success,
            "reason": self.reason,
            "steps": self.steps,
            "time_s": self.steps / self.task.spec.record_hz,
            "plans": self.chunks,
            **interaction_columns(self.interaction),
        }


def interaction_columns(interaction: Array | None) -> dict[str, float | None]:
    """The interaction columns of an episode's row, from `(T,)` values; null where the task does not measure it."""
    magnitude = None if interaction is None else np.abs(interaction)
    return {
        "interaction_mean": None if magnitude is None else float(magnitude.mean()),
        "interaction_p95": None if magnitude is None else float(np.quantile(magnitude, 0.95)),
    }


def coplan(
    policy: Policy,
    scenarios: Sequence[Any],
    settings: Any,
    *,
    repeats: int = 1,
    fps: int | None = None,
    seed: int = 0,
    on_step: Callable[[int], object] = lambda finished: None,
) -> list[EpisodeResult]:
    """Runs every scenario `repeats` times; the chunks of all episodes are predicted in one batch.

    Args:
        policy: policy of which `n_action_steps` actions of each chunk are executed.
        settings: settings of the world.
        fps: actions per second; the rate of the policy's training data if None.
        on_step: called after each step with the number of finished episodes.

    Returns:
        One result for each scenario and repeat, in that order.
    """
    episodes = [(index, scenario, repeat) for index, scenario in enumerate(scenarios) for repeat in range(repeats)]
    agent = PolicyAgent(policy, get_task(policy.task), fps=fps, seed=seed)
    rollout = coplanning_rollout(agent, [scenario for _, scenario, _ in episodes], settings)
    trace = run_traced(rollout, on_step)
    return [EpisodeResult(*episode, **episode_fields(rollout, trace, agent, k)) for k, episode in enumerate(episodes)]


def coplanning_rollout(agent: PolicyAgent, scenarios: Sequence[Any], settings: Any) -> Rollout:
    """Creates a rollout in which both players execute the agent's action chunks."""
    return Rollout(agent.task, scenarios, (agent, agent.human_half()), settings=settings)


def run_traced(rollout: Rollout, on_step: Callable[[int], object]) -> Trace:
    """Steps until every episode has ended; `on_step` gets the number of finished episodes after each step."""
    trace = Trace(rollout)
    while len(rollout.running):
        rollout.step()
        on_step(len(rollout.worlds) - len(rollout.running))
    return trace


def episode_fields(rollout: Rollout, trace: Trace, agent: Any, index: int) -> dict[str, Any]:
    """The fields of a world's `EpisodeResult` from `success` on."""
    task, outcome = rollout.task, rollout.outcomes[index]
    recorded, actions = trace.states(index), trace.actions(index)
    states = task.states_of(recorded)
    return {
        "success": outcome.success,
        "reason": outcome.reason,
        "chunks": int(agent.chunks[index]) if isinstance(agent, PolicyAgent) else 0,
        "path": task.tracked_path(states),
        "interaction": task.interaction_recorded(recorded[1:], actions),
        "task": task,
        "end": rollout.ends[index],
        "states": states,
        "actions": actions,
    }
