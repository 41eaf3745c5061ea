"""One episode of a scripted pair, recorded as fast as the machine goes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.task import RUNNING
from copolicy.tasks.table.agents import simulated_pair
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.world import TableWorld

from ..recording.recorder import EpisodeRecorder
from ..recording.wall_clock import WallClockAnchor


class Pilot(Protocol):
    """Whoever moves one end of the table."""

    def act(self, state: np.ndarray) -> np.ndarray:
        """The force `(2,)` in a state `(7,)`."""
        ...


@dataclass(frozen=True)
class EpisodeJob:
    """All that a worker needs for one episode."""

    path: Path
    map_config: MapConfig
    physics: Physics
    meta: EpisodeMeta
    anchor: WallClockAnchor
    clearance: float | None = None

    def record(self) -> "EpisodeResult":
        """Lets the pair of `meta.pair_id`, seeded by `meta.seed`, carry the table."""
        pilots = simulated_pair(self.map_config, self.meta.pair_id, self.meta.seed, self.clearance)
        return record_episode(self.path, self.map_config, pilots, self.meta, self.anchor, self.physics)


@dataclass(frozen=True)
class EpisodeResult:
    """How one episode went."""

    termination_reason: str
    success: bool
    steps: int
    size: int  # bytes of its file


def record_episode(
    path: Path,
    map_config: MapConfig,
    pilots: tuple[Pilot, Pilot],
    meta: EpisodeMeta,
    anchor: WallClockAnchor,
    physics: Physics | None = None,
) -> EpisodeResult:
    """Lets two pilots carry the table until the episode ends, and records it.

    Args:
        path: of the finished file.
        map_config: the map.
        pilots: robot, human.
        meta: what is known at the start.
        anchor: moment of the first step.
        physics: settings of the dynamics.
    """
    world = TableWorld(map_config, physics)
    with EpisodeRecorder(path, map_config, meta, anchor, settings=physics) as recorder:
        outcome = RUNNING
        while not outcome.done:
            state = world.observation
            action = np.clip(np.concatenate([pilot.act(state) for pilot in pilots]), -1.0, 1.0)
            outcome = world.step(action)
            recorder.step(action, world.recorded, world.reward())
        recorder.finish(outcome.success, outcome.reason)
    return EpisodeResult(outcome.reason, outcome.success, recorder.steps, path.stat().st_size)
