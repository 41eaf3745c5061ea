"""Statistics of data sets that are too small for most of them: null with a note, never an error."""

import json
from dataclasses import replace

import numpy as np
import pytest

from copolicy.dataset.statistics.command import summary
from copolicy.dataset.statistics.compute import compute_statistics
from copolicy.dataset.statistics.trajectories import EpisodeRow, Trajectories
from copolicy.tasks.table.maps import MAP_SETS


def _data(lengths, success=True, obstacles=True, pairs=1, idle=False, still=False) -> Trajectories:
    generator = np.random.default_rng(0)
    config = MAP_SETS["training"][0]
    config = config if obstacles else replace(config, obstacles=())
    parts, rows = [], []
    for index, length in enumerate(lengths):
        states = np.zeros((length, 7), np.float32)
        states[:, 0] = 300 + (0 if still else 8) * np.arange(length)
        states[:, 1:3] = 300, 1
        actions = generator.uniform(-1, 1, (length, 4)).astype(np.float32) * (not still)
        actions[:, :2] *= not idle
        parts.append((states, actions))
        route = "L" * len(config.obstacles) if success else ""
        rows.append(
            EpisodeRow(
                episode_uuid=f"u{index}", pair_id=f"P{index % pairs}", map_id="m", source="simulated", success=success,
                duration_s=length / 10, route_class=route, scenario=config, split="train",
            )
        )  # fmt: skip
    return Trajectories.from_episodes(parts, rows, 10)


@pytest.mark.parametrize("lengths", [[2], [3], [2, 2], [4], [2, 2, 2], [30]], ids=str)
@pytest.mark.parametrize(
    "kind",
    [{}, {"success": False}, {"obstacles": False}, {"idle": True}, {"pairs": 2}, {"still": True}],
    ids=lambda kind: next(iter(kind), "plain"),
)
def test_what_cannot_be_computed_is_null_with_a_note(lengths, kind):
    document = compute_statistics(_data(lengths, **kind), replicates=20)
    json.dumps(document, allow_nan=False)
    assert summary(document)
    estimates = [(name, entry) for family in document["statistics"].values() for name, entry in family.items()]
    assert [
        name for name, entry in estimates if entry["value"] is None and not entry.keys() & {"note", "details"}
    ] == []
    if max(lengths) == 2:
        assert document["statistics"]["leadership"]["leadership_share"]["value"] is None
