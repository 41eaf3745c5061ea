"""One episode of a scripted pair, recorded as fast as the machine goes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.task import get_task

from ..agents import ScriptedAgent
from ..recording.recorder import EpisodeRecorder
from ..recording.wall_clock import WallClockAnchor
from ..rollout import Agent, Rollout


@dataclass(frozen=True)
class EpisodeJob:
    """All that a worker needs for one episode."""

    path: Path
    map_config: Any
    physics: Any
    meta: EpisodeMeta
    anchor: WallClockAnchor
    clearance: float | None = None

    def record(self) -> "EpisodeResult":
        """Lets the pair of `meta.pair_id`, seeded by `meta.seed`, carry the table."""
        options = () if self.clearance is None else (self.clearance,)
        robot, human = (ScriptedAgent.of_pair(self.meta.pair_id, None, *options) for _ in range(2))
        return record_episode(self.path, self.map_config, (robot, human), self.meta, self.anchor, self.physics)


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
) -> EpisodeResult:
    """Lets two agents act until the episode ends, and records it.

    Args:
        path: of the finished file.
        scenario: the map.
        agents: robot, human; `meta.seed` is their seed.
        meta: what is known at the start.
        anchor: moment of the first step.
        settings: of the dynamics.
    """
    rollout = Rollout(get_task(), [scenario], agents, seeds=[meta.seed], settings=settings)
    with EpisodeRecorder(path, scenario, meta, anchor, settings=settings) as recorder:
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
