"""Many plans from one state: which ways does a co-policy see there?"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from copolicy.collect.agents import PolicyAgent, RecordedAgent
from copolicy.collect.rollout import Rollout, Trace
from copolicy.dataset import clock
from copolicy.dataset.exceptions import RunError
from copolicy.dataset.outline import Outline, Pose
from copolicy.dataset.task import PairTask, World, get_task

from ..coplan.rollouts import Outcome, measured, together


@dataclass(frozen=True)
class PlanSample:
    """One plan, and where it led.

    Attributes:
        plan: `(frames, m)` joint actions, robot first.
        planned_path: `(n, 2)` of the body while the whole plan is executed, and nothing else, in the outline's unit.
        outcome: the episode from its start to its end; after the plan's first actions the policy planned on.
        route: the strategy label of its path, empty of a task without any; None where it did not succeed, since that
            label is not decided.
    """

    plan: np.ndarray
    planned_path: np.ndarray
    outcome: Outcome
    route: str | None


@dataclass(frozen=True)
class Decision:
    """A state and the plans sampled in it.

    Attributes:
        pose: of the body.
        way: `(steps + 1, 2)` how it came there from the start, in the unit of the outline.
        task: that they are of.
    """

    map_config: Any
    pose: Pose
    way: np.ndarray
    samples: tuple[PlanSample, ...]
    task: PairTask

    @property
    def outline(self) -> Outline:
        """Of the task."""
        return self.task.required_outline


def sample_plans(
    policy: Any,
    config: Any,
    physics: Any,
    *,
    samples: int,
    seconds: float = 0.0,
    fps: int | None = None,
    seed: int = 0,
) -> Decision:
    """Samples plans in one state and lets the policy carry on from each, as in co-planning.

    Args:
        policy: whose `wanted` actions of a chunk are predicted everywhere else than in that state.
        samples: number of plans.
        seconds: how long the policy carries before, to the nearest frame.
        fps: rate at which its actions are held; that of the data set that it was trained on if None.

    Raises:
        CopolicyError: the policy's task has no outline.
        RunError: the episode ended before `seconds`, or the policy cannot go on from there in several ways.
    """
    rate = fps or policy.fps
    task = get_task(policy.task)
    outline, record_hz = task.required_outline, task.spec.record_hz
    hold = clock.stride(rate, record_hz)
    agent = PolicyAgent(policy, task, fps=rate, seed=seed)
    rollout = together(agent, [config], physics)
    trace = Trace(rollout)
    rollout.run(round(seconds * rate) * hold)
    if rollout.outcomes[0].done:
        raise RunError(f"--seconds: expected a moment before the end, found one at {rollout.ends[0] / record_hz:.1f} s")
    if seconds and policy.keeps_history:
        raise RunError(f"--seconds: expected 0 for {policy.name}, which keeps its history itself, found {seconds:g}")
    here, configs = rollout.worlds[0], [config] * samples
    agent = agent.branch(samples)
    branch = _branched(task, here, (agent, agent.human_half()), configs, physics, begin=False)
    whole = Trace(branch, trace)
    policy.wanted, wanted = None, policy.wanted
    branch.step()
    policy.wanted = wanted
    plans = list(agent.predicted)
    # The body while each plan is executed and nothing else.
    held = [np.repeat(plan, hold, axis=0) for plan in plans]
    alone = _branched(task, here, (RecordedAgent(held), RecordedAgent(held)), configs, physics, begin=True)
    paths = Trace(alone)
    alone.run(len(held[0]))
    branch.run()

    def path(recorded: np.ndarray) -> np.ndarray:
        return outline.poses(task.states_of(recorded))[:, :2]

    drawn = []
    for k, plan in enumerate(plans):
        outcome = Outcome(0, config, k, *measured(branch, whole, agent, k), task=task, end=branch.ends[k])
        label = task.strategy(config, task.states_of(whole.states(k))) if outcome.success else None
        drawn.append(PlanSample(plan, path(paths.states(k)), outcome, label))
    (pose,) = outline.poses(here.observation[None]).tolist()
    return Decision(config, tuple(pose), path(trace.states(0)), tuple(drawn), task)


def _branched(task: PairTask, here: World, agents: Any, configs: Sequence[Any], physics: Any, begin: bool) -> Rollout:
    """A rollout that goes on from a world, in as many copies as there are scenarios."""
    worlds = [task.make_world(config, physics) for config in configs]
    for world in worlds:
        world.restore(here.recorded)
        world.step_count = here.step_count
    return Rollout(task, configs, agents, worlds=worlds, begin=begin)
