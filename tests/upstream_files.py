"""Files as the original program writes them, for the tests of its importers."""

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.convert.upstream.build_episode import UpstreamOptions
from copolicy.convert.upstream.processed import read_processed
from copolicy.convert.upstream.raw import read_raw
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.world import TableWorld

OPTIONS = UpstreamOptions()
EPISODES = (1, 2, 3, 4, 8, 11)
"""Numbers of the episodes in tests/data/upstream/examples_scripted."""

CONFIG = MAP_SETS["training"][10]


def zarr_places(examples) -> dict[int, int]:
    """Place in the store of each numbered episode."""
    index = json.loads((examples / "zarr_episode_index.json").read_text(encoding="utf-8"))
    return {int(entry["raw"].removeprefix("ep_")): entry["zarr_episode"] for entry in index}


def raw(examples: Path, number: int, options=OPTIONS):
    return read_raw(examples / "raw" / "trajectories" / f"ep_{number}.pkl", options)


def processed(examples: Path, number: int, options=OPTIONS):
    return read_processed(examples / "processed_npz" / f"ep_{number}" / f"ep_{number}.npz", options)


def random_forces(steps: int) -> np.ndarray:
    """Random forces `(steps, 4)`, each repeated for six steps."""
    return np.repeat(np.random.default_rng(0).uniform(-1, 1, (steps // 6 + 1, 4)), 6, axis=0)[:steps]


def play(actions: np.ndarray, physics: Physics = Physics()) -> tuple[np.ndarray, np.ndarray]:  # noqa: B008 - frozen
    """States `(T + 1, 6)` under actions, and the actions."""
    world = TableWorld(CONFIG, physics)
    states = [(*world.pose, *world.velocity)]
    for action in actions:
        world.step(action)
        states.append((*world.pose, *world.velocity))
    return np.array(states), actions


def write_raw(
    folder: Path, states, actions, config=CONFIG, name="ep_1", map_config: MapConfig | None = None, success=False
) -> Path:
    """The files that the original writes for one episode."""
    rows = [
        [*map(np.float64, state), action, np.float64(0), step == len(actions), success, step, 1 / 30]
        + [[np.float64(value) for value in config.goal], *(np.array(centre) for centre in config.obstacles)]
        + [np.zeros(2, int)] * 5 + [np.float64(0)]
        for step, (state, action) in enumerate(zip(states[1:], actions, strict=True), start=1)
    ]  # fmt: skip
    path = folder / "trajectories" / f"{name}.pkl"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(rows, 4))
    if map_config:
        (folder / "map_cfg").mkdir(exist_ok=True)
        x, y, angle = map_config.start
        np.savez(
            folder / "map_cfg" / f"{name}.npz",
            table=np.array({"x": x, "y": y, "angle": angle}, dtype=object),
            obstacles=np.array({"obstacles": np.array(map_config.obstacles)}, dtype=object),
            goal=np.array({"goal": np.array(map_config.goal)}, dtype=object),
        )
    return path


def write_store(folder: Path, states, actions):
    """The 10 Hz store of one episode, in double precision and without compression."""
    rows = np.arange(0, len(actions), 3)
    pose = np.column_stack((states[:, :2], np.cos(states[:, 2]), np.sin(states[:, 2]), states[:, 3:]))
    obstacles = np.array([*CONFIG.obstacles, (0, 0), (0, 0), (0, 0)])[:3].ravel()
    setting = np.tile([*CONFIG.start, *CONFIG.goal, *obstacles], (len(rows), 1))
    past = np.vstack((np.zeros(4), actions[rows[1:] - 1]))
    arrays = {
        "data/obs": np.hstack((pose[rows + 1], setting)),
        "data/action": actions[rows],
        "data/past_action": past,
        "meta/episode_ends": np.array([len(rows)]),
    }
    for name, array in arrays.items():
        (folder / name).mkdir(parents=True)
        metadata = {"zarr_format": 2, "shape": array.shape, "chunks": array.shape, "dtype": array.dtype.str}
        metadata |= {"compressor": None, "fill_value": 0, "filters": None, "order": "C"}
        (folder / name / ".zarray").write_text(json.dumps(metadata), encoding="utf-8")
        (folder / name / ".".join("0" * array.ndim)).write_bytes(array.tobytes())


def write_processed(path: Path, pose, actions, conditions):
    rewards = np.zeros((len(pose), 1))
    path.parent.mkdir()
    fields = {
        "states": np.hstack((pose, conditions[:, 3:5], conditions[:, 3:5])),
        "actions": actions,
        "rewards": rewards,
        "conditioning_var": conditions,
        "table_init": conditions[0, :2],
        "table_goal": conditions[0, 3:5],
        "obstacles": np.array(CONFIG.obstacles),
    }
    members: dict[str, Any] = {name: np.asarray(value, np.float32) for name, value in fields.items()}
    np.savez(path, **members, map_file="map.npz")
