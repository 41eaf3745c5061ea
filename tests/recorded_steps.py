"""A recorder of the table and steps under one action."""

from collections.abc import Iterator
from typing import Any

from mcap.stream_reader import StreamReader

from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.dataset.episode import EpisodeMeta
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.world import TableWorld

MAP = MAP_SETS["training"][6]
META = EpisodeMeta("uuid-1", pair_id="S01", source="simulated")
START_NS = 1_700_000_000_000_000_000
ACTION = (0.5, -0.25, 1.0, 0.0)


def recorder(path, **options):
    """A recorder of the table whose first step is at `START_NS`."""
    return EpisodeRecorder(path, MAP, META, WallClockAnchor.simulated(START_NS), **options)


def carry(recording, steps, action=ACTION):
    """Records steps of the world under one action; returns the world."""
    world = TableWorld(MAP)
    for _ in range(steps):
        world.step(action)
        recording.step(action, world.recorded, world.reward())
    return world


def records(path, kind, **options) -> Iterator[Any]:
    """The records of a kind in a file, with the options of `StreamReader`."""
    with path.open("rb") as file:
        yield from (record for record in StreamReader(file, **options).records if isinstance(record, kind))
