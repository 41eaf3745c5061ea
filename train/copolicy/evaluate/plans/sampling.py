"""Many plans from one state: which ways does a co-policy see there?"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from copolicy.collect.agents import PolicyAgent, RecordedAgent
from copolicy.collect.rollout import Rollout, Trace
from copolicy.dataset import clock
from copolicy.dataset.exceptions import RunError
from copolicy.dataset.task import World, get_task
from copolicy.dataset.task_spec import RECORD_HZ
from copolicy.tasks.table.routes import route_class

from ..coplan.rollouts import Outcome, measured, together


@dataclass(frozen=True)
class PlanSample:
    """One plan, and where it led.

    Attributes:
        plan: `(frames, 4)` joint actions, robot xy, human xy.
        planned_path: `(n, 2)` the table's centre while the whole plan is executed, and nothing else, px.
        outcome: the episode from the map's start to its end; after the plan's first actions the policy planned on.
    """

    plan: np.ndarray
    planned_path: np.ndarray
    outcome: Outcome

    @property
    def route(self) -> str | None:
        """The side word of its path; None where it did not reach the goal, since that route is not decided."""
        return route_class(self.outcome.path, self.outcome.map_config) if self.outcome.success else None


@dataclass(frozen=True)
class Decision:
    """A state and the plans sampled in it.

    Attributes:
        pose: (x, y, theta), px and rad.
        way: `(steps + 1, 2)` how the table came there from the map's start, px.
    """

    map_config: Any
    pose: tuple[float, float, float]
    way: np.ndarray
    samples: tuple[PlanSample, ...]


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
        RunError: the episode ended before `seconds`, or the policy cannot go on from there in several ways.
    """
    rate = fps or policy.fps
    hold = clock.stride(rate)
    agent = PolicyAgent(policy, get_task(), fps=rate, seed=seed)
    rollout = together(agent, [config], physics)
    trace = Trace(rollout)
    rollout.run(round(seconds * rate) * hold)
    if rollout.outcomes[0].done:
        raise RunError(f"--seconds: expected a moment before the end, found one at {rollout.ends[0] / RECORD_HZ:.1f} s")
    if seconds and policy.keeps_history:
        raise RunError(f"--seconds: expected 0 for {policy.name}, which keeps its history itself, found {seconds:g}")
    here, configs = rollout.worlds[0], [config] * samples
    agent = agent.branch(samples)
    branch = _branched(here, (agent, agent.other_half()), configs, physics, begin=False)
    whole = Trace(branch, trace)
    policy.wanted, wanted = None, policy.wanted
    branch.step()
    policy.wanted = wanted
    plans = list(agent.predicted)
    # The table's centre while each plan is executed and nothing else.
    held = [clock.zero_order_hold(plan, rate) for plan in plans]
    alone = _branched(here, (RecordedAgent(held), RecordedAgent(held)), configs, physics, begin=True)
    paths = Trace(alone)
    alone.run(len(held[0]))
    branch.run()
    x, y, theta, *_ = here.recorded
    drawn = [
        PlanSample(plan, paths.states(k)[:, :2], Outcome(0, config, k, *measured(branch, whole, agent, k)))
        for k, plan in enumerate(plans)
    ]
    return Decision(config, (x, y, theta), trace.states(0)[:, :2], tuple(drawn))


def _branched(here: World, agents: Any, configs: Sequence[Any], physics: Any, begin: bool) -> Rollout:
    """A rollout that goes on from a world, in as many copies as there are maps."""
    worlds = [get_task().make_world(config, physics) for config in configs]
    for world in worlds:
        world.restore(here.recorded)
        world.step_count = here.step_count
    return Rollout(get_task(), configs, agents, worlds=worlds, begin=begin)
