"""Samples many action chunks in one state and continues the episode from each."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from copolicy.collect.agents import PolicyAgent, RecordedAgent
from copolicy.collect.rollout import Rollout, Trace
from copolicy.dataset import clock
from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import RunError
from copolicy.dataset.outline import Outline, Pose
from copolicy.dataset.task import PairTask, World, get_task

from ..coplan.rollouts import EpisodeResult, coplanning_rollout, episode_fields


@dataclass(frozen=True)
class ChunkSample:
    """One action chunk and the episode that continues with it.

    Attributes:
        chunk: `(frames, m)` joint actions, robot first.
        planned_path: `(n, 2)` of the body while the whole chunk is executed without replanning, in the outline's unit.
        episode: the episode from its start to its end, continued with new chunks after n_action_steps actions.
        route: strategy label of the episode's path, empty if the task has no labels; None if the episode failed, since
            its label is undefined.
    """

    chunk: Array
    planned_path: Array
    episode: EpisodeResult
    route: str | None


@dataclass(frozen=True)
class BranchPoint:
    """A state and the action chunks sampled in it.

    Attributes:
        pose: pose of the body in that state.
        approach: `(steps + 1, 2)` path of the body from the start to that state, in the unit of the outline.
    """

    scenario: Any
    pose: Pose
    approach: Array
    samples: tuple[ChunkSample, ...]
    task: PairTask

    @property
    def outline(self) -> Outline:
        """The task's outline."""
        return self.task.required_outline


def sample_chunks(
    policy: Any,
    scenario: Any,
    settings: Any,
    *,
    samples: int,
    seconds: float = 0.0,
    fps: int | None = None,
    seed: int = 0,
) -> BranchPoint:
    """Samples action chunks in one state and continues the co-planning episode from each.

    Args:
        policy: `Checkpoint`; in the state it predicts whole chunks, elsewhere `n_predicted_actions` of each.
        settings: settings of the world.
        samples: number of chunks.
        seconds: time of the state in an episode of the policy, rounded to the nearest frame.
        fps: actions per second; the rate of the policy's training data if None.

    Raises:
        CopolicyError: the policy's task has no outline.
        RunError: the episode ended before `seconds`, or the policy keeps its own history, which cannot be copied.
    """
    rate = fps or policy.fps
    task = get_task(policy.task)
    outline, record_hz = task.required_outline, task.spec.record_hz
    hold = clock.stride(rate, record_hz)
    agent = PolicyAgent(policy, task, fps=rate, seed=seed)
    rollout = coplanning_rollout(agent, [scenario], settings)
    trace = Trace(rollout)
    rollout.run(round(seconds * rate) * hold)
    if rollout.outcomes[0].done:
        expected = f"less than {rollout.ends[0] / record_hz:.1f}, when the episode ended"
        raise RunError(f"--seconds: expected {expected}, found {seconds:g}")
    if seconds and policy.keeps_history:
        raise RunError(f"--seconds: expected 0 for {policy.name}, which keeps its history itself, found {seconds:g}")
    world, scenarios = rollout.worlds[0], [scenario] * samples
    agent = agent.branch(samples)
    branch = _copied_rollout(task, world, (agent, agent.human_half()), scenarios, settings, begin=False)
    branch_trace = Trace(branch, trace)
    policy.n_predicted_actions, n_predicted_actions = None, policy.n_predicted_actions
    branch.step()
    policy.n_predicted_actions = n_predicted_actions
    chunks = list(agent.predicted)
    # Execute each chunk to its end without replanning.
    actions = [np.repeat(chunk, hold, axis=0) for chunk in chunks]
    players = RecordedAgent(actions), RecordedAgent(actions)
    planned = _copied_rollout(task, world, players, scenarios, settings, begin=True)
    planned_trace = Trace(planned)
    planned.run(len(actions[0]))
    branch.run()

    def path(recorded: Array) -> Array:
        return outline.poses(task.states_of(recorded))[:, :2]

    chunk_samples = []
    for k, chunk in enumerate(chunks):
        episode = EpisodeResult(0, scenario, k, **episode_fields(branch, branch_trace, agent, k))
        route = task.strategy(scenario, task.states_of(branch_trace.states(k))) if episode.success else None
        chunk_samples.append(ChunkSample(chunk, path(planned_trace.states(k)), episode, route))
    (pose,) = outline.poses(world.observation[None]).tolist()
    return BranchPoint(scenario, tuple(pose), path(trace.states(0)), tuple(chunk_samples), task)


def _copied_rollout(
    task: PairTask, source: World, agents: Any, scenarios: Sequence[Any], settings: Any, begin: bool
) -> Rollout:
    """Creates a rollout whose worlds are copies of the source's present state, one for each scenario."""
    worlds = [task.make_world(scenario, settings) for scenario in scenarios]
    for world in worlds:
        world.restore(source.recorded)
        world.step_count = source.step_count
    return Rollout(task, scenarios, agents, worlds=worlds, begin=begin)
