"""Records one episode of two agents in simulated time."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.task import TABLE, get_task

from ..agents import ScriptedAgent
from ..recording.recorder import EpisodeRecorder
from ..recording.wall_clock import WallClockAnchor
from ..rollout import Agent, Rollout


@dataclass(frozen=True)
class EpisodeJob:
    """One episode to record, as it is sent to a worker process."""

    path: Path
    task: str
    scenario: Any
    settings: Any
    meta: EpisodeMeta
    anchor: WallClockAnchor
    options: Mapping[str, Any] = field(default_factory=dict)

    def record(self) -> "RecordedEpisode":
        """Records the episode of the pair `meta.pair_id` with the seed `meta.seed`."""
        task = get_task(self.task)
        robot, human = (ScriptedAgent.from_pair(self.meta.pair_id, task, **self.options) for _ in range(2))
        agents = (robot, human)
        return record_episode(self.path, self.scenario, agents, self.meta, self.anchor, self.settings, self.task)


@dataclass(frozen=True)
class RecordedEpisode:
    """Outcome of a recorded episode."""

    termination_reason: str
    success: bool
    steps: int
    size: int  # bytes of its file


def record_episode(
    path: Path,
    scenario: Any,
    agents: tuple[Agent, Agent],
    meta: EpisodeMeta,
    anchor: WallClockAnchor,
    settings: Any = None,
    task: str = TABLE,
) -> RecordedEpisode:
    """Runs and records an episode of two agents.

    Args:
        path: of the finished file.
        scenario: of the task.
        agents: robot, human; `meta.seed` is their seed.
        meta: columns that are known at the start.
        anchor: time of the first step.
        settings: of the world; the task's default if None.
        task: name of the task.
    """
    rollout = Rollout(get_task(task), [scenario], agents, seeds=[meta.seed], settings=settings)
    with EpisodeRecorder(path, scenario, meta, anchor, settings=settings, task=task) as recorder:
        rollout.observers.append(_Recording(recorder))
        rollout.run()
        (outcome,) = rollout.outcomes
        recorder.finish(outcome.success, outcome.reason)
    return RecordedEpisode(outcome.reason, outcome.success, recorder.steps, path.stat().st_size)


@dataclass
class _Recording:
    recorder: EpisodeRecorder

    def step(self, rollout: Rollout, actions: Array, worlds: Array) -> None:
        world = rollout.worlds[0]
        self.recorder.step(actions[0], world.recorded, world.reward())
