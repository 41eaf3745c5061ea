"""One episode of a scripted pair, recorded as fast as the machine goes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.task import TABLE, get_task

from ..agents import ScriptedAgent
from ..recording.recorder import EpisodeRecorder
from ..recording.wall_clock import WallClockAnchor
from ..rollout import Agent, Rollout


@dataclass(frozen=True)
class EpisodeJob:
    """All that a worker needs for one episode."""

    path: Path
    task: str
    scenario: Any
    settings: Any
    meta: EpisodeMeta
    anchor: WallClockAnchor
    options: Mapping[str, Any] = field(default_factory=dict)

    def record(self) -> "EpisodeResult":
        """Lets the pair of `meta.pair_id`, seeded by `meta.seed`, act until the episode ends."""
        task = get_task(self.task)
        robot, human = (ScriptedAgent.from_pair(self.meta.pair_id, task, **self.options) for _ in range(2))
        agents = (robot, human)
        return record_episode(self.path, self.scenario, agents, self.meta, self.anchor, self.settings, self.task)


@dataclass(frozen=True)
class EpisodeResult:
    """How one episode went."""

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
) -> EpisodeResult:
    """Lets two agents act until the episode ends, and records it.

    Args:
        path: of the finished file.
        scenario: of the task; the map.
        agents: robot, human; `meta.seed` is their seed.
        meta: what is known at the start.
        anchor: moment of the first step.
        settings: of the world.
        task: its name.
    """
    rollout = Rollout(get_task(task), [scenario], agents, seeds=[meta.seed], settings=settings)
    with EpisodeRecorder(path, scenario, meta, anchor, settings=settings, task=task) as recorder:
        rollout.observers.append(_Recording(recorder))
        rollout.run()
        (outcome,) = rollout.outcomes
        recorder.finish(outcome.success, outcome.reason)
    return EpisodeResult(outcome.reason, outcome.success, recorder.steps, path.stat().st_size)


@dataclass
class _Recording:
    recorder: EpisodeRecorder

    def step(self, rollout: Rollout, actions: np.ndarray, worlds: np.ndarray) -> None:
        world = rollout.worlds[0]
        self.recorder.step(actions[0], world.recorded, world.reward())
