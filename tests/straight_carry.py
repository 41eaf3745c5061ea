"""A recording in which both players push straight on, with a swerve and a pause."""

import math

from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.task import RUNNING
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.world import TableWorld

MAP = MapConfig((240.0, 300.0, 3.0), (700.0, 300.0), ((480.0, 480.0),))
META = EpisodeMeta("u", "s", "P07", "P07-a", "P07-b", map_id="custom", source="human")


def record(path, steps=None, physics=None, config=MAP, push=(1.0, 0.1, 0.8, -0.1)):
    """Carries straight on until the episode ends, or for some steps."""
    world = TableWorld(config, physics)
    with EpisodeRecorder(path, config, META, WallClockAnchor.simulated(10**18), settings=physics) as recording:
        outcome = RUNNING
        while recording.steps < steps if steps else not outcome.done:
            action = [push[0], push[1] * math.sin(recording.steps / 9), push[2], push[3]]
            outcome = world.step(action)
            recording.step(action, world.recorded, world.reward())
            if recording.steps == 40:
                recording.event("pause", "focus lost")
        recording.finish(outcome.success, outcome.reason if outcome.done else "operator_discard")
    return path
