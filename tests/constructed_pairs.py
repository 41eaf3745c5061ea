"""Pairs whose statistics are known because they were constructed: trajectories, and data set folders of them."""

import json
import math
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet

from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.statistics import EpisodeRow, Trajectories
from copolicy.tasks.table.features import FEATURES, environment_state
from copolicy.tasks.table.map_config import MapConfig

ONE = MapConfig((240, 300, math.pi), (960, 300), ((600, 300),))
TWO = MapConfig((240, 300, math.pi), (960, 300), ((480, 300), (720, 300)))
# Letters follow atan2(y, x): the obstacle further right comes first.

FREE = MapConfig((240, 300, math.pi), (960, 300))


def row(config: MapConfig = ONE, **changes) -> EpisodeRow:
    """A successful simulated episode of 10 s."""
    base = EpisodeRow("e", "A", f"map-{config.digest}", "simulated", True, 10.0, config)
    return replace(base, **changes)


def trajectories(episodes, rows, fps: int = 10) -> Trajectories:
    """Episodes given as `(states, actions)`; either may be None for zeros."""
    filled = []
    for states, actions in episodes:
        length = len(states if states is not None else actions)
        states = still(length) if states is None else states
        filled.append((states, np.zeros((length, 4)) if actions is None else actions))
    numbered = [replace(entry, episode_uuid=f"e{index}") for index, entry in enumerate(rows)]
    return Trajectories.from_episodes(filled, numbered, fps)


def still(length: int, x: float = 300.0, y: float = 300.0) -> np.ndarray:
    """A table at rest, turned so that player 0 is on its right."""
    return np.tile(np.array([x, y, 1.0, 0.0, 0.0, 0.0, 0.0]), (length, 1))


def carried(word: str, config: MapConfig, length: int = 120, amplitude: float = 110.0, fps: int = 10) -> np.ndarray:
    """`(length, 7)` states along start-goal with a half wave past each obstacle, on the side that the word says."""
    ordered = sorted(config.obstacles, key=lambda centre: math.atan2(centre[1], centre[0]))
    x = np.linspace(config.start[0], config.goal[0], length)
    y = np.full(length, config.start[1])
    for letter, (centre, _) in zip(word, ordered, strict=True):
        wave = np.clip(1 - np.abs(x - centre) / 110, 0, None)
        y = y + (amplitude if letter == "L" else -amplitude) * np.sin(wave * np.pi / 2)
    states = still(length)
    states[:, :2] = np.column_stack((x, y))
    states[:, 4:6] = np.gradient(states[:, :2], axis=0) * fps
    return states


def carried_set(words, config: MapConfig, rng: np.random.Generator, jitter: float = 4.0) -> Trajectories:
    """One episode a word, pairs A to E in turn, each path a few pixels off."""
    episodes = []
    for word in words:
        states = carried(word, config, amplitude=110 + jitter * rng.standard_normal())
        actions = np.clip(rng.normal(0.3, 0.2, (len(states), 4)), -1, 1)
        episodes.append((states, actions))
    return trajectories(episodes, [row(config, pair_id="ABCDE"[index % 5]) for index in range(len(words))])


def write_folder(data: Trajectories, root: Path, **columns) -> Path:
    """A LeRobot v3 data set with the parts that the statistics read; `columns` are episode columns to change."""
    (root / "meta/episodes/chunk-000").mkdir(parents=True)
    (root / "data/chunk-000").mkdir(parents=True)
    episodes, frames = len(data.rows), len(data.states)
    info = {"codebase_version": "v3.0", "fps": data.fps, "total_episodes": episodes, "total_frames": frames}
    info |= {"splits": {"train": f"0:{episodes}"}, "features": FEATURES}
    (root / "meta/info.json").write_text(json.dumps(info), encoding="utf-8")
    table = []
    for index, entry in enumerate(data.rows):
        names = ("episode_uuid", "pair_id", "map_id", "source", "success", "duration_s", "route_class")
        meta = EpisodeMeta(**{name: getattr(entry, name) for name in names})
        length = int(data.lengths[index])
        table.append({"episode_index": index, "length": length, **asdict(meta)})
        table[-1].update({name: values[index] for name, values in columns.items()})
    parquet.write_table(pa.Table.from_pylist(table), root / "meta/episodes/chunk-000/file-000.parquet")
    environment = np.array([environment_state(entry.scenario) for entry in data.rows])[data.episode]
    arrays = {
        "observation.state": data.states,
        "observation.environment_state": environment,
        "action": data.actions,
    }
    parts = {
        name: pa.FixedSizeListArray.from_arrays(pa.array(values.astype(np.float32).ravel()), values.shape[1])
        for name, values in arrays.items()
    }
    parts["index"] = pa.array(np.arange(frames))
    parts["episode_index"] = pa.array(data.episode)
    parquet.write_table(pa.table(parts), root / "data/chunk-000/file-000.parquet")
    return root
