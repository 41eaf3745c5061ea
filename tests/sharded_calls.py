"""Calls of `copolicy-convert mcap` for the tests of shards, what these leave behind, and recordings with a flaw."""

from pathlib import Path

import numpy as np

from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.versions.content import read_content
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.world import TableWorld

EPISODES = 6
"""Recordings of the fixture `unsharded` in conftest.py."""


def call(recordings: Path, root: Path, *flags: str) -> list[str]:
    return ["mcap", str(recordings), "--out", str(root), "--repo-id", "lab/table", "--license", "cc-by-4.0", *flags]


def content(root: Path) -> str:
    return read_content(root).hash


def times_of(shards: Path) -> dict[str, int]:
    """When each finished shard was made."""
    return {path.parent.name: path.stat().st_mtime_ns for path in shards.glob("shards/[0-9]*/shard.json")}


def record_rest(path: Path) -> None:
    """A recording of half a second without any action."""
    config = MAP_SETS["training"][0]
    world = TableWorld(config)
    meta = EpisodeMeta("at-rest", map_id="training-00", map_set="training", pair_id="nobody")
    with EpisodeRecorder(path, config, meta) as recorder:
        for _ in range(15):
            world.step(np.zeros(4))
            recorder.step(np.zeros(4), world.recorded, world.reward())
        recorder.finish(False, "timeout")


def damage(path: Path) -> None:
    """Truncates a file."""
    path.write_bytes(path.read_bytes()[:-2000])
