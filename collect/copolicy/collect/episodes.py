"""Runs two agents on a set of scenarios and returns the episodes."""

import uuid
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from copolicy.dataset.episode import Episode, EpisodeMeta
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import TABLE, get_task

from .agents.agent_names import make_agent
from .agents.policy import PolicyAgent
from .rollout import Agent, Rollout, Trace


def run_episodes(
    robot: Agent | str,
    human: Agent | str | None,
    maps: str | Sequence[Any] = "holdout",
    *,
    task: str = TABLE,
    limit: int | None = None,
    seed: int = 0,
    settings: Any = None,
) -> list[Episode]:
    """Runs two agents on every scenario of a set, in parallel worlds, until each episode ends.

        episodes = run_episodes("policy:pretrained", "scripted:stubborn", maps="unseen", limit=12)
        np.mean([episode.meta.success for episode in episodes])

    Args:
        robot: at the robot's seat; an agent, or its name for `make_agent`.
        human: at the human's seat, another agent than `robot`. None: the robot's policy acts for both players
            (co-planning).
        maps: name of a set of scenarios, a map file, or one of its splits as `FILE#split`; or a sequence of scenarios.
        task: name of the task.
        limit: use the first `limit` scenarios; all if None.
        seed: of the agents' random numbers; episode k gets `seed + k`.
        settings: of the worlds; the task's defaults if None.

    Returns:
        One episode a scenario at the task's rate, in order; its `meta` has the outcome.

    Raises:
        UnknownNameError: no such agent or set.
        InvalidValueError: the same agent at both seats, an agent that cannot act at its seat, no human beside a robot
            that is not a policy, or a policy of another task.
        FileFormatError: a checkpoint, recording or map file that cannot be used.
    """
    pair_task = get_task(task)
    if limit is not None and limit < 1:
        raise InvalidValueError("limit", "at least 1", limit)
    scenarios = (pair_task.scenario_set(maps).scenarios if isinstance(maps, str) else maps)[:limit]
    if not scenarios:
        raise InvalidValueError("maps", "at least one", "none")
    if robot is human and not isinstance(robot, str):
        raise InvalidValueError("human", "another agent than the robot's", robot.name)
    robot_agent = make_agent(robot, task) if isinstance(robot, str) else robot
    if human is None:
        if not isinstance(robot_agent, PolicyAgent):
            raise InvalidValueError("robot", "a policy, which acts for both players", robot_agent.name)
        human_agent: Agent = robot_agent.human_half()
    else:
        human_agent = make_agent(human, task) if isinstance(human, str) else human
    for agent in (robot_agent, human_agent):
        if isinstance(agent, PolicyAgent) and agent.task is not pair_task:
            raise InvalidValueError("task", f"{agent.task.spec.name!r}, which {agent.name} has learned", task)
    seeds = [seed + index for index in range(len(scenarios))]
    rollout = Rollout(pair_task, scenarios, (robot_agent, human_agent), seeds=seeds, settings=settings)
    trace = Trace(rollout)
    rollout.run()
    return [
        episode_from_trace(rollout, trace, index, scenario, seed + index, settings)
        for index, scenario in enumerate(scenarios)
    ]


def episode_from_trace(rollout: Rollout, trace: Trace, index: int, scenario: Any, seed: int, settings: Any) -> Episode:
    """The episode of a world of a rollout, from its start to its end; `index` is that of the world."""
    task, outcome = rollout.task, rollout.outcomes[index]
    states, actions = task.states_of(trace.states(index)), trace.actions(index)
    robot, human = (agent.name for agent in rollout.agents)
    name = task.name_of(scenario)
    identity = f"{task.spec.name} {scenario.digest} {robot} {human} {seed}"
    meta = EpisodeMeta(
        episode_uuid=str(uuid.uuid5(uuid.NAMESPACE_OID, identity)),
        controller_0=robot,
        controller_1=human,
        **name.columns,
        seed=seed,
        source="simulated",
        success=outcome.success,
        termination_reason=outcome.reason,
        duration_s=len(actions) / task.spec.record_hz,
        route_class=task.strategy(scenario, states) if outcome.success else "",
        software_version=version("lerobot_policy_copolicy"),
    )
    return Episode(
        states[:-1], np.asarray(actions), states[-1], meta, scenario,
        fps=task.spec.record_hz, settings=settings, task=task.spec.name,
    )  # fmt: skip
